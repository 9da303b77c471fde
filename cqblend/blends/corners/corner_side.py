r"""Sides of a hole that corner patches fill: a curve, and fields along it that span the tangent plane beyond.

Curves and fields are splines on [0, 1], in space (dim 3) or in homogeneous 4-space (dim 4, not flagged rational). In
space, the fields span the tangent plane; in homogeneous space, the three-dimensional space that is made of the point
and the derivatives of the homogeneous surface. Whatever scalar functions f_k are, a patch with the cross derivative

.. math:: D(t) = \sum_k f_k(t) F_k(t)

along its side meets the surface beyond with a common tangent plane. Knows splines and primary surfaces only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cqblend.blends.corners.tolerances import CORNER_TOLERANCES
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.quadrics import Quadric
from cqblend.surfaces.tensor_surface import TensorSurface


@dataclass(frozen=True)
class CornerSide:
    """One side of a hole: its curve, which runs around the hole with the others head to tail, and its fields."""

    curve: Curve
    fields: tuple[Curve, ...]

    @property
    def dim(self) -> int:
        """3 in space, 4 in homogeneous space."""
        return self.curve.dim

    def reverse(self) -> CornerSide:
        """Return the same side, run through the other way."""
        return CornerSide(self.curve.reverse(), tuple(field.reverse() for field in self.fields))

    def level_weights(self) -> CornerSide:
        """Return the same side with the weight 1 where it starts and stops, in space as it is."""
        if self.dim == 3:
            return self
        weights = self.curve(np.array([0.0, 1.0]))[:, 3]
        if np.abs(weights - 1.0).max() <= CORNER_TOLERANCES.level_weight:
            return self
        return CornerSide(Curve.bezier(1.0 / weights[:, None]) * self.curve, self.fields)

    def to_space_curve(self) -> Curve:
        """Return its curve in space, rational if it is in homogeneous space."""
        curve = self.curve
        return curve if self.dim == 3 else Curve(curve.breaks, curve.coefs, rational=True, continuity=curve.continuity)

    def evaluate_point(self, t: float) -> Array:
        """Return a point (3,) in space."""
        return np.asarray(self.to_space_curve()(np.array([t]))[0])

    def evaluate_ends(self) -> Array:
        """Return the points (2, 3) in space where it starts and stops."""
        return np.asarray(self.to_space_curve()(np.array([0.0, 1.0])))


def make_strip_side(surface: Surface, pcurve: Curve, dim: int) -> CornerSide:
    """Return the side where a strip H(t, v) ends in a curve of its parameter plane.

    Parameters
    ----------
    surface
        H, rational or not.
    pcurve
        The curve, polynomial, on [0, 1].
    dim
        4 for homogeneous space, 3 if the strip is polynomial and space will do.
    """
    plain = to_plain_surface(surface, dim)
    partials = plain, plain.derivative(1, 0), plain.derivative(0, 1)
    curve, along, across = (_compose_lightly(one, pcurve) for one in partials)
    fields = (along, across) if dim == 3 else (along, across, curve)
    return CornerSide(curve, fields)


def _compose_lightly(surface: Surface, pcurve: Curve) -> Curve:
    """Return a surface on a curve in its parameter plane, of the degree that it has where v runs evenly."""
    excess = pcurve.degree - pcurve[1].reduce().degree
    return surface.compose(pcurve).reduce(excess * surface.degree[1])


def make_face_side(primary: Primary, curve: Curve, dim: int) -> CornerSide:
    """Return the side that runs on a support face along a curve of lifted parameters on [0, 1].

    ``dim`` is 4 for homogeneous space; 3, which is for planes and polynomial splines with curves of weight 1.
    """
    directions = _list_directions(primary, curve.dim, dim)
    domain = np.array(curve.domain)
    position = primary.compose_position(curve)
    fields = [primary.compose_jets(curve, (Curve(domain, one[None, :, None]),))[1] for one in directions]
    if dim == 4:
        if isinstance(primary, TensorSurface):
            fields.append(position)
        return CornerSide(position, tuple(fields))
    return CornerSide(position[:3], tuple(field[:3] for field in fields))


def _list_directions(primary: Primary, size: int, dim: int) -> Array:
    """Return constant lifted directions (n, k) whose fields span the tangent planes of a surface, with its position.

    In homogeneous space those of a quadric, or of an angle, are all unit directions; those of a spline's parameter keep
    the sum of its barycentric pair. In space, weights stay 1.
    """
    if isinstance(primary, Quadric):
        return np.eye(size) if dim == 4 else np.eye(size)[:2]
    if not isinstance(primary, TensorSurface):
        return np.eye(size)
    rows: list[list[float]] = []
    for axis, is_angle in enumerate(primary.is_angular):
        before, after = [0.0] * (2 * axis), [0.0] * (2 - 2 * axis)
        pairs = [[1.0, 0.0], [0.0, 1.0]] if is_angle else [[-1.0, 1.0]]
        rows += [[*before, *pair, *after] for pair in pairs]
    return np.array(rows)


def to_plain_surface(surface: Surface, dim: int) -> Surface:
    """Return a surface with its homogeneous coefficients for components (dim 4), or as it is (dim 3)."""
    if dim == 3:
        return surface
    coefs = surface.coefs
    if not surface.rational:
        coefs = np.concatenate([coefs, np.ones_like(coefs[:, :, :1])], axis=2)
    return Surface(surface.breaks, coefs, continuity=surface.continuity)


@dataclass(frozen=True)
class CornerFrame:
    """The frame of a corner, (x - centre) / size: energies of homogeneous coefficients depend on where these are."""

    centre: Array
    size: float

    @classmethod
    def around_sides(cls, sides: Sequence[CornerSide]) -> CornerFrame:
        """Return the frame about the corners of a hole."""
        points = np.array([side.evaluate_ends()[0] for side in sides])
        centre = points.mean(axis=0)
        return cls(centre, float(np.linalg.norm(points - centre, axis=1).max()))

    def bring_in(self, side: CornerSide) -> CornerSide:
        """Return a side in the frame."""
        return CornerSide(
            self._bring_in(side.curve, is_point=True), tuple(self._bring_in(one, is_point=False) for one in side.fields)
        )

    def _bring_in(self, curve: Curve, *, is_point: bool) -> Curve:
        coefs = curve.coefs.copy()
        if curve.dim == 4:
            coefs[:, :3] -= coefs[:, 3:] * self.centre[:, None]
        elif is_point:
            coefs -= self.centre[:, None]
        coefs[:, :3] /= self.size
        return Curve(curve.breaks, coefs, continuity=curve.continuity)

    def bring_back(self, coefs: Array) -> Array:
        """Return coefficients (p + 1, q + 1, dim, nu, nv) in the frame as those of a surface in space."""
        out = coefs.copy()
        out[:, :, :3] *= self.size
        centre = self.centre[:, None, None]
        out[:, :, :3] += centre if coefs.shape[2] == 3 else centre * coefs[:, :, 3:]
        return out
