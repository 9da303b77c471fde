"""The surface of a strip as it goes into the solid: a spline, a profile turned about an axis, or arcs of a ball.

All have v from 0 on the first rail to 1 on the second. Along a spline, the parameter is that of the rails, t; around an
axis, it is the angle (rad) from the first section; along a cylinder, the length (mm) from there. Edges of the strip are
planned in these parameters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cqblend.blends.network.tolerances import NETWORK_TOLERANCES
from cqblend.blends.sections.arc_section import BallSurface
from cqblend.blends.sections.revolved_section import RevolvedSection
from cqblend.splines import Curve, Surface
from cqblend.splines.approximation import Kinks, approximate_curve
from cqblend.splines.bernstein import Array
from cqblend.splines.roots import find_sign_changes
from cqblend.surfaces.circle import Circle, PlanarCircle
from cqblend.surfaces.ellipse import Ellipse, PlanarEllipse
from cqblend.surfaces.line import Line
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.vectors import LocalFrame

RailCurve = Curve | Circle | Line
"""A rail in space."""

PlaneCurve = Curve | PlanarCircle | PlanarEllipse
"""A curve in a parameter plane."""


@dataclass(frozen=True)
class StripSection:
    """A section of a strip as a curve in space, over a span of its parameter, which is a linear function of v."""

    curve: Curve | Circle
    span: tuple[float, float] = (0.0, 1.0)

    def make_pcurve(self, s: float) -> Curve:
        """Return the line, over the same span, of the sections at s in the parameters of the strip."""
        return Curve.bezier([(s, 0.0), (s, 1.0)], domain=self.span)


@dataclass(frozen=True)
class StripCut:
    """A curve across a strip, from rail 1 to rail 2, in which it meets another surface, over a span of its parameter.

    ``on_strip`` is the same curve in the parameters (s, v) of the strip, ``on_other`` in those of the other surface.
    """

    curve: Curve | Circle | Ellipse
    span: tuple[float, float]
    on_strip: Curve
    on_other: PlaneCurve

    @classmethod
    def from_solution(cls, solution: Curve) -> StripCut:
        """Return the cut of which a curve v -> (s, v, a, b, x, y, z) has both parameters and the points."""
        on_strip, on_other, points = (
            Curve(solution.breaks, solution.coefs[:, part], continuity=solution.continuity)
            for part in (slice(0, 2), slice(2, 4), slice(4, 7))
        )
        return cls(points, solution.domain, on_strip, on_other)

    @property
    def rail_parameters(self) -> tuple[float, float]:
        """The s at which it leaves rail 1 and reaches rail 2."""
        first, last = self.on_strip(np.array(self.span))[:, 0]
        return float(first), float(last)

    def restrict(self, first: float, last: float) -> StripCut:
        """Return the part of a cut whose parameter is a linear function of v from one v to another."""
        low, high = self.span
        span = (low + first * (high - low), low + last * (high - low))
        on_other = self.on_other.clip(*span) if isinstance(self.on_other, Curve) else self.on_other
        return StripCut(self.curve, span, self.on_strip.clip(*span), on_other)

    @property
    def ends(self) -> Array:
        """Its ends in space, (2, 3)."""
        return self.curve(np.array(self.span))


class StripSurface(Protocol):
    """The surface H(s, v) of a strip over ``domain`` in s, and its boundary rows at v = 0 and v = 1."""

    @property
    def geometry(self) -> Surface | RevolvedSection | BallSurface:
        """The surface that it is built on."""

    @property
    def domain(self) -> tuple[float, float]:
        """The range of s."""

    @property
    def rail_curves(self) -> tuple[RailCurve, RailCurve]:
        """The curves s -> H(s, 0) and s -> H(s, 1)."""

    @property
    def is_mirrored(self) -> bool:
        """Whether (s, v) run around each other in the opposite sense to the parameters of ``geometry``."""

    def locate_section(self, s: float) -> StripSection:
        """Return the curve v -> H(s, v)."""

    def map_to_surface(self, curve: Curve) -> Curve:
        """Return a curve of parameters (s, v) in the parameters of the surface it is built on."""

    def __call__(self, s: Array, v: Array) -> Array:
        """Return points (n, 3) at parameters (n,)."""

    def jet(self, s: Array, v: Array, order: int) -> Array:
        """Return all partial derivatives up to a total order, (order + 1, order + 1, n, 3)."""

    def to_rail_parameters(self, s: Array) -> Array:
        """Return the parameters t (n,) of the rails at s (n,)."""

    def map_from_blend(self, tv: Array) -> Array:
        """Return the parameters (s, v), (n, 2), at parameters (n, 2) of the blend as a spline."""

    def map_curve_from_blend(self, curve: Curve) -> Curve:
        """Return a curve of parameters of the blend as a spline in the parameters (s, v)."""

    def cut_with_plane(self, plane: Plane, near: float) -> StripCut | None:
        """Return the curve in which the strip meets a plane, the one nearest to s = ``near``.

        None if the curve has no closed form.
        """


@dataclass(frozen=True)
class SplineStrip:
    """A strip on a spline surface."""

    surface: Surface

    @property
    def geometry(self) -> Surface:
        return self.surface

    @property
    def domain(self) -> tuple[float, float]:
        breaks = self.surface.breaks[0]
        return float(breaks[0]), float(breaks[-1])

    @property
    def rail_curves(self) -> tuple[Curve, Curve]:
        return self.surface.isoparametric(v=0.0), self.surface.isoparametric(v=1.0)

    @property
    def is_mirrored(self) -> bool:
        return False

    def locate_section(self, s: float) -> StripSection:
        return StripSection(self.surface.isoparametric(u=s))

    def map_to_surface(self, curve: Curve) -> Curve:
        return curve

    def __call__(self, s: Array, v: Array) -> Array:
        return self.surface(s, v)

    def jet(self, s: Array, v: Array, order: int) -> Array:
        return self.surface.jet(s, v, order)

    def to_rail_parameters(self, s: Array) -> Array:
        return s

    def map_from_blend(self, tv: Array) -> Array:
        return tv

    def map_curve_from_blend(self, curve: Curve) -> Curve:
        return curve

    def cut_with_plane(self, plane: Plane, near: float) -> StripCut | None:
        """Return the exact curve if the surface is A(v) + s B."""
        del near  # there is but one
        coefs = self.surface.coefs
        if self.surface.degree[0] != 1 or self.surface.rational or coefs.shape[3] != 1:
            return None
        low, high = self.domain
        first, steps = coefs[0, :, :, 0], coefs[1, :, :, 0] - coefs[0, :, :, 0]  # (q + 1, 3, n)
        step, normal = steps.mean(axis=(0, 2)), plane.frame.axes[2]
        along = float(step @ normal)
        size = np.linalg.norm(step)
        is_parallel = np.abs(steps - step[:, None]).max() <= NETWORK_TOLERANCES.parallel_rails * size
        if not is_parallel or abs(along) <= NETWORK_TOLERANCES.least_cut_sine * size:
            return None
        share = np.einsum("qkn,k->qn", plane.frame.origin[:, None] - first, normal) / along
        points = first + share[:, None] * step[:, None]
        return _collect_section(self.surface.breaks[1], low + (high - low) * share, points, plane)


@dataclass(frozen=True)
class RevolvedStrip:
    """A strip on a surface of revolution."""

    section: RevolvedSection

    @property
    def geometry(self) -> RevolvedSection:
        return self.section

    @property
    def domain(self) -> tuple[float, float]:
        return 0.0, self.section.turn

    @property
    def rail_curves(self) -> tuple[Circle, Circle]:
        (r0, z0), (r1, z1) = self.section.profile(np.array([0.0, 1.0])).tolist()
        return self._make_circle(r0, z0), self._make_circle(r1, z1)

    def _make_circle(self, radius: float, height: float) -> Circle:
        frame = self.section.frame
        return Circle(LocalFrame(frame.origin + height * frame.axes[2], frame.axes), radius)

    @property
    def is_mirrored(self) -> bool:
        return False

    def locate_section(self, s: float) -> StripSection:
        return StripSection(self.section.place_profile(s))

    def map_to_surface(self, curve: Curve) -> Curve:
        return curve

    def __call__(self, s: Array, v: Array) -> Array:
        return self.jet(s, v, 0)[0, 0]

    def jet(self, s: Array, v: Array, order: int) -> Array:
        s, v = np.broadcast_arrays(s, v)
        x, y, z = self.section.frame.axes
        out = np.zeros((order + 1, order + 1, *s.shape, 3))
        for j in range(order + 1):
            radius, height = np.moveaxis(self.section.profile(v, j), -1, 0)
            for i in range(order + 1 - j):
                angle = s + i * np.pi / 2
                out[i, j] = radius[..., None] * (np.cos(angle)[..., None] * x + np.sin(angle)[..., None] * y)
            out[0, j] += height[..., None] * z
        out[0, 0] += self.section.frame.origin
        return out

    def to_rail_parameters(self, s: Array) -> Array:
        return self.section.map_to_parameters(s)

    def map_from_blend(self, tv: Array) -> Array:
        return np.stack([self.section.map_to_angles(tv[:, 0]), tv[:, 1]], axis=1)

    def map_curve_from_blend(self, curve: Curve) -> Curve:
        return fit_mapped_curve(self.map_from_blend, curve, self.section.breaks, self.section.turn)

    def cut_with_plane(self, plane: Plane, near: float) -> StripCut | None:
        """Return the section in a plane that the axis lies in."""
        frame, profile = self.section.frame, self.section.place_profile(0.0)
        size = float(np.abs(profile.coefs).max())
        angle = find_meridian_angle(frame, plane, near, size, NETWORK_TOLERANCES.section_plane)
        if profile.rational or angle is None:
            return None
        cos, sin = np.cos(angle), np.sin(angle)
        arms = profile.coefs - frame.origin[:, None]
        x, y, z = (np.einsum("qkn,k->qn", arms, axis) for axis in frame.axes)
        local = np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)
        points = frame.origin[:, None] + np.einsum("qan,ak->qkn", local, frame.axes)
        return _collect_section(profile.breaks, np.full(x.shape, angle), points, plane)


def fit_mapped_curve(mapping: Callable[[Array], Array], curve: Curve, arcs: Array, size: float) -> Curve:
    """Return a curve of parameters (t, v) that is mapped to another plane, where parameters are up to ``size``.

    The map is smooth but for the t at which one of a chain of ``arcs`` (n + 1,) ends and the next one starts.
    """
    shifted = curve.coefs[:, 0, None] - arcs[1:-1, None]  # (p + 1, inner ends, pieces)
    degree, _, pieces = shifted.shape
    column, root = find_sign_changes(shifted.reshape(degree, -1), np.zeros(shifted[0].size))
    piece = column % pieces
    kinks = curve.breaks[piece] + root * np.diff(curve.breaks)[piece]
    breaks = np.linspace(*curve.domain, NETWORK_TOLERANCES.cut_spans + 1)
    tolerance = NETWORK_TOLERANCES.cut_fit + NETWORK_TOLERANCES.mapped_rounding * size
    return approximate_curve(
        lambda x: mapping(curve(x)),
        np.unique(np.concatenate([breaks, curve.breaks])),
        tolerance,
        kinks=Kinks(kinks, np.zeros(len(kinks), dtype=int)),
    )


def find_meridian_angle(frame: LocalFrame, plane: Plane, near: float, size: float, tolerance: float) -> float | None:
    """Return the angle (rad) about a frame's Z axis at which a half of a plane lies, the one nearest to ``near``.

    None if the axis misses the plane by more than a share ``tolerance`` of ``size`` (mm).
    """
    normal = plane.frame.axes[2]
    offset, tilt = float((plane.frame.origin - frame.origin) @ normal), float(frame.axes[2] @ normal) * size
    if max(abs(offset), abs(tilt)) > tolerance * size:
        return None
    angle = float(np.arctan2(-(frame.axes[0] @ normal), frame.axes[1] @ normal))
    return float(angle + np.pi * np.round((near - angle) / np.pi))


def _collect_section(breaks: Array, s: Array, points: Array, plane: Plane) -> StripCut:
    """Return the cut with a plane of coefficients s (q + 1, n) and points (q + 1, 3, n)."""
    degree = len(s) - 1
    v = breaks[:-1] + np.arange(degree + 1)[:, None] / degree * np.diff(breaks)
    on_plane = np.einsum("qkn,ak->qan", points - plane.frame.origin[:, None], plane.frame.axes[:2])
    return StripCut.from_solution(Curve(breaks, np.concatenate([s[:, None], v[:, None], on_plane, points], axis=1)))
