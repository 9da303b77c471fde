"""Surfaces reshaped from a reference: control points move along their vectors from a point, each by its own amount.

With control points :math:`p_{jk}` of group g(jk), amounts f_g and reference C (Lee, Bedi and Dubey),

    p_jk(s) = p_jk + f_g(jk)(s) (p_jk - C(s)).

The surface at s is a spline over the same knots: nothing is approximated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from cqblend.argument_checks import call_user_function, check_number, to_float_array
from cqblend.blends.potential.surface_family import (
    AmountFunction,
    Course,
    Family,
    State,
    check_uv_and_state,
    find_closed_directions,
    split_by_group,
)
from cqblend.blends.potential.tolerances import POTENTIAL_TOLERANCES
from cqblend.errors import InputError
from cqblend.splines import Curve, Surface
from cqblend.splines.approximation import approximate_to_rounding
from cqblend.splines.bernstein import Array
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import cross_product


@dataclass(frozen=True)
class ReferenceFamily(Family):
    """Control points moved along their vectors from a reference point.

    ``groups`` (nu, nv) are the indices of the amount functions of the control points; ``reference`` is a point (3,) or
    a function from an array of s to points (n, 3).
    """

    groups: Array = field(repr=False)
    reference: Array | Callable[[Array], Any]

    @classmethod
    def from_surface(
        cls,
        surface: Surface,
        functions: tuple[AmountFunction, ...],
        groups: Array,
        reference: Array | Callable[[Array], Any],
        tolerance: float,
    ) -> ReferenceFamily:
        """Make the family of a surface, periodic in the directions in which surface and amounts are closed."""
        shares = split_by_group(surface, groups, len(functions), surface.to_bspline()[2])
        primary = TensorSurface.from_spline(surface, find_closed_directions(shares))
        family = cls(primary, functions, groups, reference, tolerance=tolerance)
        family._check_reference_moves()
        return family

    @cached_property
    def _group_shares(self) -> Surface:
        """For each group, its control points' share of the surface (dim 3), and of unity (dim 1)."""
        return split_by_group(self.surface, self.groups, len(self.functions), self.surface.to_bspline()[2])

    def jet(self, uv: Array, state: State) -> Array:
        """Return S, Su, Sv and the derivative by x, (4, n, 3), at (n, 2)."""
        check_uv_and_state(uv, state)
        u, v = self.primary.wrap_parameters(uv).T
        n, m = len(uv), len(self.functions)
        jet = self._group_shares.jet(u, v, 1)
        partials = np.stack([jet[0, 0], jet[1, 0], jet[0, 1]]).reshape(3, n, m, 4)
        share, unity = partials[..., :3], partials[..., 3:]
        vectors = share - unity * state.reference[:, None]  # from the reference: amounts multiply these
        out = np.empty((4, n, 3))
        out[:3] = (share + state.amounts[..., None] * vectors).sum(axis=2)
        out[3] = (
            state.rates[..., None] * vectors[0] - (state.amounts[..., None] * unity[0]) * state.drift[:, None]
        ).sum(axis=1)
        return out

    def __call__(self, s: float, tolerance: float | None = None) -> Surface:
        """Return the surface at s, over the same parameters, exactly."""
        self._check_tolerance(tolerance)
        degrees, knots, poles, weights = self.surface.to_bspline()
        at = np.array([check_number("s", s)])
        amounts = self._evaluate_amounts(at, "given")[0][self.groups][..., None]
        return Surface.from_bspline(
            degrees, knots, poles + amounts * (poles - self._evaluate_reference(at)[0]), weights
        )

    def course(self, s: Curve, which: str) -> Course:
        """Return the amounts, and the reference, along a relation.

        Raises
        ------
        InputError
            As :meth:`Family.course`.
        """
        amounts = super().course(s, which).amounts
        return Course(amounts, approximate_to_rounding(lambda x: self._evaluate_reference(s(x)[:, 0]), (0.0, 1.0)))

    def _evaluate_reference(self, s: Array) -> Array:
        """Return the reference points (n, 3)."""
        rule = "a reference that is a function takes an array of s and returns as many points"
        given = call_user_function(rule, self.reference, s) if callable(self.reference) else self.reference
        points = to_float_array("reference points", given)
        try:
            points = np.broadcast_to(
                points if points.ndim < 2 or points.shape[0] != 3 or len(s) == 3 else points.T, (len(s), 3)
            )
        except ValueError as error:
            raise InputError(
                f"a reference that is a function takes an array of s and returns as many points: {error}"
            ) from error
        if not np.isfinite(points).all():
            raise InputError("the reference point is not finite")
        return points

    def _check_reference_moves(self) -> None:
        """Raise InputError if all points move within the surface, as those of a plane do from a reference in it."""
        poles = self.surface.to_bspline()[2]
        (u0, u1), (v0, v1) = self.surface.domain
        u, v = (grid.ravel() for grid in np.meshgrid(np.linspace(u0, u1, 9), np.linspace(v0, v1, 9), indexing="ij"))
        jet = self.surface.jet(u, v, 1)
        normal = cross_product(jet[1, 0], jet[0, 1])
        length = np.linalg.norm(normal, axis=1)
        normal[length > 0] /= length[length > 0, None]
        reference = self._evaluate_reference(np.zeros(1))[0]
        vectors = jet[0, 0] - reference
        size = max(float(np.abs(poles - poles.mean(axis=(0, 1))).max()), float(np.abs(vectors).max()))
        if np.abs((normal * vectors).sum(axis=1)).max() <= POTENTIAL_TOLERANCES.stationary_reference * size:
            point = ", ".join(f"{x:.6g}" for x in reference)
            raise InputError(
                f"the reference ({point}) lies in the surface, which is a plane, or a cone with its apex there: moving "
                'control points from it does not move the surface; take another reference, or by="normal"'
            )
