"""Bends: where a rail crosses a knot line at which the parameters of its surface have a kink, and its shape has none.

What is smooth in space has a kink in such parameters: with S1 and S2 on both sides, S2 = S1(phi), derivatives of a
rail c and of the directions d, e, .. along it are related by those of phi. Fitted without a kink, they would leave a
crease inside the blend. phi itself is not needed: for jets X_k of the ribbon,

    X_k = Su r_k + Sv s_k + ..,    X_k' = Su r_k' + Sv s_k' + ..,

both sides take the (r_k, s_k) that give one and the same X_k, and then the slopes that give one and the same X_k'. What
is normal to the surface in these agrees by itself, as far as the shape is smooth.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cqblend.blends.rails.ribbon import evaluate_space_jets
from cqblend.splines import Curve, interpolation
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide
from cqblend.surfaces.primary import Primary
from cqblend.surfaces.vectors import to_tangent_coordinates


@dataclass(frozen=True)
class KinkData:
    """What lifted values that are fitted have besides at bends: limits from before, and changes of their slopes.

    Bend i has its limit from before at node ``last[i]``, that from after at node ``first[i]``: two nodes only where
    a closed rail meets itself. ``values_before`` are the former (m, k); ``slope_changes`` (2, m, k) are added to the
    slopes on both sides that values alone would give.
    """

    nodes_before: Array
    nodes_after: Array
    values_before: Array
    slope_changes: Array

    def scale_values(self, factors: Array) -> KinkData:
        """Return them for values multiplied by factors (m,)."""
        return KinkData(
            self.nodes_before,
            self.nodes_after,
            self.values_before * factors[:, None],
            self.slope_changes * factors[:, None],
        )


CurveMaker = Callable[[Array, KinkData | None], Curve]
"""Turns lifted values at parameters into a curve."""


@dataclass(frozen=True)
class ParametricKinks:
    """The bends of a rail, m of them, as a fit meets them.

    ``nodes`` (2, m) are its nodes there, from before and from after, ``sample_indices`` (2, m) the same among its
    parameters, of which every third is a node, and ``t`` (2, m) these parameters. ``uv`` (2, m, 2) are the native
    parameters, and ``partials`` (2, 3, m, 3) hold Su and Sv on both sides, as native jets do.
    """

    nodes: Array
    t: Array
    uv: Array
    partials: Array

    @classmethod
    def from_rail(cls, primary: Primary, c: Curve, uv: Array, t: Array, nodes: Array) -> ParametricKinks:
        """Read the frames beside bends at nodes (2, m) of a rail, whose native parameters at t are uv (n, 2)."""
        frames = np.zeros((2, 3, nodes.shape[1], 3))
        at = nodes * 3
        for axis in (0, 1):
            unit = primary.lift_directions(uv[::3], c(t[::3]), np.tile(np.eye(2)[axis], (len(t[::3]), 1)))
            beside = _evaluate_both_sides(
                primary.compose_jets(c, [interpolation.interpolate(t[::3], unit, degree=1)]), t[at]
            )
            frames[:, 1 + axis] = [rows[1, 0] for rows in beside]
        return cls(nodes, t[at], uv[at], frames)

    @property
    def sample_indices(self) -> Array:
        """The bends among the parameters of the fit, (2, m)."""
        return self.nodes * 3

    def evaluate_left_limits(self, jets: Sequence[Curve]) -> Array:
        """Return homogeneous jets just before the bends, (jets, m, 4)."""
        t = _find_nearest_breaks(jets, self.t[0])
        return np.stack([jet(t, side="left") for jet in jets])

    def to_coordinates(self, vectors: Array, side: int = 0) -> Array:
        """Return (r, s), (m, 2), of tangent vectors (m, 3) just before (0) or after (1) the bends."""
        return to_tangent_coordinates(self.partials[side], vectors)

    def fit_curve(
        self,
        primary: Primary,
        values: Array,
        before: Array,
        make: CurveMaker,
        rail: Callable[[Curve], Curve],
        jets: Callable[[Curve], Sequence[Curve]],
    ) -> Curve:
        """Fit lifted values (n, k), with limits ``values_before`` (m, k), so that their highest jet has no kink.

        ``rail`` and ``jets`` return the rail and the jets of a ribbon of which the curve is the highest direction, or
        the rail itself.
        """
        none = np.zeros((2, *before.shape))
        curve = make(values, KinkData(self.nodes[0], self.nodes[1], before, none))
        c, rates = rail(curve), [rows[-1, 1] for rows in _evaluate_both_sides(jets(curve), self.t)]
        middle = (rates[0] + rates[1]) / 2
        turns = [
            primary.lift_directions(self.uv[i], c(self.t[i], side=side), self.to_coordinates(middle - rates[i], i))
            for i, side in enumerate(SIDES)
        ]
        return make(values, KinkData(self.nodes[0], self.nodes[1], before, np.stack(turns)))


SIDES: tuple[BreakSide, BreakSide] = ("left", "right")


def _find_nearest_breaks(jets: Sequence[Curve], t: Array) -> Array:
    """Return the breaks of jets next to t: what is read on one side must not be a rounding beside them."""
    breaks = jets[0].breaks
    return np.asarray(breaks[np.abs(t[:, None] - breaks).argmin(axis=1)])


def _evaluate_both_sides(jets: Sequence[Curve], t: Array) -> list[Array]:
    """Return jets in space and their derivatives by t, (jets, 2, m, 3), from before and from after t (2, m)."""
    return [
        evaluate_space_jets(jets, _find_nearest_breaks(jets, at), 1, side) for at, side in zip(t, SIDES, strict=True)
    ]
