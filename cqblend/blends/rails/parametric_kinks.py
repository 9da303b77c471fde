"""Kinks of rails and directions at knot lines where only the parametrisation has a kink, not the shape.

At a knot line the parametrisation of a surface may have a kink across which its shape is smooth: with S1 and S2 on both
sides, S2 = S1(phi). What is smooth in space has a kink in such parameters; fitted without it, rails and directions
would leave a crease inside the blend. phi itself is not needed: for jets X_k of the ribbon, derivatives by v of order
k,

    X_k = Su r_k + Sv s_k + ..,    X_k' = Su r_k' + Sv s_k' + ..,

both sides take the (r_k, s_k) that give one and the same X_k, and then the slopes that give one and the same X_k'. What
is normal to the surface in these agrees by itself, as far as the shape is smooth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cqblend.blends.rails.cornered_spline import CurveMaker, KinkData
from cqblend.blends.rails.ribbon import BREAK_SIDES, SampledRail, evaluate_space_jets
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.interpolation import interpolate
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import to_tangent_coordinates


@dataclass(frozen=True)
class ParametricKinks:
    """The m crossings of a rail with knot lines at which the parametrisation of its surface has a kink.

    ``nodes`` (2, m) are the nodes of the fit there, with the left limits and with the right ones, and ``t`` (2, m)
    their parameters. ``uv`` (2, m, 2) are the native parameters, and ``partials`` (2, 3, m, 3) hold Su and Sv on both
    sides, as native jets do.
    """

    primary: Primary
    nodes: Array
    t: Array
    uv: Array
    partials: Array

    @classmethod
    def from_rail(cls, rail: SampledRail, nodes: Array) -> ParametricKinks:
        """Evaluate Su and Sv on both sides of the kinks, at nodes (2, m) of a rail: every third sample is a node."""
        partials = np.zeros((2, 3, nodes.shape[1], 3))
        at = nodes * 3
        node_uv, node_t = rail.uv[::3], rail.t[::3]
        for axis in (0, 1):
            unit = rail.primary.lift_directions(node_uv, rail.c(node_t), np.tile(np.eye(2)[axis], (len(node_t), 1)))
            jets = rail.primary.compose_jets(rail.c, [interpolate(node_t, unit, degree=1)])
            partials[:, 1 + axis] = [rows[1, 0] for rows in _evaluate_both_sides(jets, rail.t[at])]
        return cls(rail.primary, nodes, rail.t[at], rail.uv[at], partials)

    @property
    def sample_indices(self) -> Array:
        """The indices of the kinks among the samples of the fit, (2, m)."""
        return self.nodes * 3

    def evaluate_left_limits(self, jets: Sequence[Curve]) -> Array:
        """Return homogeneous jets just before the kinks, (jets, m, 4)."""
        t = _find_nearest_breaks(jets, self.t[0])
        return np.stack([jet(t, side="left") for jet in jets])

    def to_coordinates(self, vectors: Array, side: int = 0) -> Array:
        """Return (r, s), (m, 2), of tangent vectors (m, 3) just before (side 0) or after (1) the kinks."""
        return to_tangent_coordinates(self.partials[side], vectors)

    def fit_curve(
        self,
        values: Array,
        values_before: Array,
        make_curve: CurveMaker,
        compose: Callable[[Curve], tuple[Curve, Sequence[Curve]]],
    ) -> Curve:
        """Fit lifted values (n, k), with left limits (m, k) at the kinks, so that the highest jet has no kink in space.

        ``compose`` returns, for the fitted curve, the rail and the jets of the ribbon of which the curve is the highest
        direction, or the rail itself.
        """
        no_changes = np.zeros((2, *values_before.shape))
        curve = make_curve(values, KinkData(self.nodes[0], self.nodes[1], values_before, no_changes))
        c, jets = compose(curve)
        slopes = [rows[-1, 1] for rows in _evaluate_both_sides(jets, self.t)]
        mean = (slopes[0] + slopes[1]) / 2
        changes = [
            self.primary.lift_directions(self.uv[i], c(self.t[i], side=side), self.to_coordinates(mean - slopes[i], i))
            for i, side in enumerate(BREAK_SIDES)
        ]
        return make_curve(values, KinkData(self.nodes[0], self.nodes[1], values_before, np.stack(changes)))


def _find_nearest_breaks(jets: Sequence[Curve], t: Array) -> Array:
    """Return the breaks of jets nearest to t: a limit at a break must not be evaluated a rounding beside it."""
    breaks = jets[0].breaks
    return np.asarray(breaks[np.abs(t[:, None] - breaks).argmin(axis=1)])


def _evaluate_both_sides(jets: Sequence[Curve], t: Array) -> list[Array]:
    """Return jets in space with their derivatives by t, (jets, 2, m, 3): left limits at t[0], right ones at t[1]."""
    return [
        evaluate_space_jets(jets, _find_nearest_breaks(jets, at), 1, side)
        for at, side in zip(t, BREAK_SIDES, strict=True)
    ]
