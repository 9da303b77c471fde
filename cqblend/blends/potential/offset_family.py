"""Surfaces reshaped by offsets: points move along the unit normal, by an amount that may vary over the surface.

Offsets are evaluated from the surface itself, with their derivatives. Only a whole offset surface as a spline needs a
tolerance, unless the unit normals are a spline over the same knots, as those of planes, cylinders, cones, spheres and
tori are: then that is exact, too.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import ClassVar

import numpy as np

from cqblend.argument_checks import check_number
from cqblend.blends.contacts.surface_normals import differentiate_normal
from cqblend.blends.potential.surface_family import (
    AmountFunction,
    Family,
    State,
    check_uv_and_state,
    find_closed_directions,
    split_by_group,
)
from cqblend.blends.potential.tolerances import POTENTIAL_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines import Curve, Surface
from cqblend.splines.approximation import approximate_surface
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import cross_product, normalise_vectors


@dataclass(frozen=True)
class OffsetFamily(Family):
    """A spline surface whose points move along unit normals, by ``sign`` times the amount.

    ``shares``, of dimension m, are the sums of the basis functions of the control points that have each amount; None
    stands for 1, if there is one amount.
    """

    sign: float = 1.0
    shares: Surface | None = field(default=None, repr=False)

    lost: ClassVar[int] = 1

    @classmethod
    def from_surface(
        cls, surface: Surface, functions: tuple[AmountFunction, ...], groups: Array, tolerance: float, sign: float = 1.0
    ) -> OffsetFamily:
        """Make the family of a spline surface, periodic in the directions in which surface and amounts are closed.

        Raises
        ------
        GeometryError
            If the surface has a crease: there, it has two normals, and the offset is torn.
        """
        _check_creases(surface)
        shares = split_by_group(surface, groups, len(functions), np.zeros((*groups.shape, 0)))
        both = find_closed_directions(surface), find_closed_directions(shares)
        closed = both[0][0] and both[1][0], both[0][1] and both[1][1]
        primary = TensorSurface.from_spline(surface, closed)
        return cls(primary, functions, sign=sign, shares=shares, tolerance=tolerance)

    def jet(self, uv: Array, state: State) -> Array:
        """Return S, Su, Sv and the derivative by x, (4, n, 3), at (n, 2)."""
        check_uv_and_state(uv, state)
        base = self.primary.jet(uv)
        n, nu, nv = differentiate_normal(base)
        if self.shares is None:
            f, rate = self.sign * state.amounts, self.sign * state.rates
            return np.stack([base[0] + f * n, base[1] + f * nu, base[2] + f * nv, rate * n])
        out = np.empty((4, len(uv), 3))
        u, v = self.primary.wrap_parameters(uv).T
        jet = self.shares.jet(u, v, 1)
        f, fu, fv = (self.sign * (jet[k] * state.amounts).sum(axis=1)[:, None] for k in ((0, 0), (1, 0), (0, 1)))
        out[0] = base[0] + f * n
        out[1], out[2] = base[1] + f * nu + fu * n, base[2] + f * nv + fv * n
        out[3] = self.sign * (jet[0, 0] * state.rates).sum(axis=1)[:, None] * n
        return out

    def __call__(self, s: float, tolerance: float | None = None) -> Surface:
        """Return the surface at s, over the same parameters: exactly, or within a tolerance (mm).

        Raises
        ------
        GeometryError
            If it is not a spline within the tolerance.
        """
        tolerance = self._check_tolerance(tolerance)
        amounts = self._evaluate_amounts(np.array([check_number("s", s)]), "given")[0]
        surface, normals = self.surface, self.normals
        if not amounts.any():
            return surface
        if normals is not None and len(amounts) == 1:
            degrees, knots, poles, weights = surface.to_bspline()
            offset = poles + self.sign * amounts[0] * normals.to_bspline()[2]
            return Surface.from_bspline(degrees, knots, offset, weights)
        zeros = np.zeros_like(amounts)

        def evaluate_offset_grid(u: Array, v: Array) -> Array:
            uv = np.stack([grid.ravel() for grid in np.meshgrid(u, v, indexing="ij")], axis=-1)
            values, rates = (np.broadcast_to(given, (len(uv), len(amounts))) for given in (amounts, zeros))
            state = State(values, rates, uv, uv)  # an offset has no reference: uv stands for one
            return self.jet(uv, state)[0].reshape(len(u), len(v), 3)

        return approximate_surface(
            evaluate_offset_grid,
            surface.breaks,
            self.tolerance * float(np.abs(amounts).max()) if tolerance is None else tolerance,
            orders=(surface.continuity[0] - 1, surface.continuity[1] - 1),
        )

    @cached_property
    def normals(self) -> Surface | None:
        """The unit normals as a spline of the surface's own degrees, knots and weights; None if they are not one."""
        return interpolate_unit_normals(self.surface)


def _check_creases(surface: Surface) -> None:
    """Raise GeometryError where the normal jumps across a knot line."""
    for axis in (0, 1):
        lines = surface.breaks[axis][1:-1][surface.continuity[axis] < 1]
        along = np.linspace(*surface.domain[1 - axis], 35)[1:-1]
        at, other = (grid.ravel() for grid in np.meshgrid(lines, along, indexing="ij"))
        u, v = (at, other) if axis == 0 else (other, at)
        sides: list[BreakSide] = ["left", "right"]
        before, after = (
            cross_product(surface(u, v, 1, 0, side=side), surface(u, v, 0, 1, side=side)).reshape(-1, 3)
            for side in sides
        )
        angle = np.arctan2(np.linalg.norm(cross_product(before, after), axis=1), (before * after).sum(axis=1))
        if len(angle) and angle.max() > POTENTIAL_TOLERANCES.surface_crease:
            i = int(angle.argmax())
            raise GeometryError(
                f"the surface has a crease of {angle[i]:.2g} rad at {'uv'[axis]} = {at[i]:.6g}: moved along its two "
                "normals there, it would be torn; reshape it from a reference, or the smooth parts one by one"
            )


def interpolate_unit_normals(surface: Surface) -> Surface | None:
    """Return unit normals as a spline of the surface's own degrees, knots and weights; None if they are not one."""
    degrees, knots, poles, weights = surface.to_bspline()
    greville = [_compute_greville_abscissae(degree, vector) for degree, vector in zip(degrees, knots, strict=True)]
    designs = [
        Curve.from_bspline(degree, vector, np.eye(len(g)))(g)
        for degree, vector, g in zip(degrees, knots, greville, strict=True)
    ]
    u, v = np.meshgrid(*greville, indexing="ij")
    try:
        normal = _evaluate_unit_normals(surface, u.ravel(), v.ravel())
        weight = np.ones(poles.shape[:2]) if weights is None else designs[0] @ weights @ designs[1].T
        values = normal.reshape(*u.shape, 3) * weight[..., None]
        net = np.einsum("ij,jkd,lk->ild", np.linalg.inv(designs[0]), values, np.linalg.inv(designs[1]))
    except (ArithmeticError, np.linalg.LinAlgError):
        return None
    normals = Surface.from_bspline(degrees, knots, net if weights is None else net / weights[..., None], weights)
    (u0, u1), (v0, v1) = surface.domain
    u, v = np.meshgrid(np.linspace(u0, u1, 37)[1:-1], np.linspace(v0, v1, 31)[1:-1], indexing="ij")
    error = np.abs(normals(u.ravel(), v.ravel()) - _evaluate_unit_normals(surface, u.ravel(), v.ravel())).max()
    return normals if error <= POTENTIAL_TOLERANCES.normal_fit * len(poles) * poles.shape[1] else None


def _evaluate_unit_normals(surface: Surface, u: Array, v: Array) -> Array:
    jet = surface.jet(u, v, 1)
    return normalise_vectors(cross_product(jet[1, 0], jet[0, 1]))


def _compute_greville_abscissae(degree: int, knots: Array) -> Array:
    """Return the Greville abscissae, moved inwards a little from the ends, where surfaces may be singular."""
    count = len(knots) - degree - 1
    g = np.array([knots[i + 1 : i + degree + 1].mean() for i in range(count)])
    return g + (knots[degree + 1] - knots[degree]) * 1e-2 * np.linspace(1, -1, count)
