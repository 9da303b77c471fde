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

from cqblend.blends.rails.ribbon import along
from cqblend.splines import Curve, fit
from cqblend.splines.evaluation import Side
from cqblend.surfaces.primaries import Array, Primary, tangent_coordinates


@dataclass(frozen=True)
class Kinks:
    """What lifted values that are fitted have besides at bends: limits from before, and changes of their slopes.

    Bend i has its limit from before at node ``last[i]``, that from after at node ``first[i]``: two nodes only where
    a closed rail meets itself. ``before`` are the former (m, k); ``turns`` (2, m, k) are added to the slopes on both
    sides that values alone would give.
    """

    last: Array
    first: Array
    before: Array
    turns: Array

    def scaled(self, factors: Array) -> Kinks:
        """Return them for values multiplied by factors (m,)."""
        return Kinks(self.last, self.first, self.before * factors[:, None], self.turns * factors[:, None])


Maker = Callable[[Array, Kinks | None], Curve]
"""Turns lifted values at parameters into a curve."""


@dataclass(frozen=True)
class Bends:
    """The bends of a rail, m of them, as a fit meets them.

    ``nodes`` (2, m) are its nodes there, from before and from after, ``at`` (2, m) the same among its parameters, of
    which every third is a node, and ``t`` (2, m) these parameters. ``uv`` (2, m, 2) are the native parameters, and
    ``frames`` (2, 3, m, 3) hold Su and Sv on both sides, as native jets do.
    """

    nodes: Array
    t: Array
    uv: Array
    frames: Array

    @classmethod
    def of(cls, primary: Primary, c: Curve, uv: Array, t: Array, nodes: Array) -> Bends:
        """Read the frames beside bends at nodes (2, m) of a rail, whose native parameters at t are uv (n, 2)."""
        frames = np.zeros((2, 3, nodes.shape[1], 3))
        at = nodes * 3
        for axis in (0, 1):
            unit = primary.push(uv[::3], c(t[::3]), np.tile(np.eye(2)[axis], (len(t[::3]), 1)))
            beside = _beside(primary.jets(c, [fit.interpolate(t[::3], unit, degree=1)]), t[at])
            frames[:, 1 + axis] = [rows[1, 0] for rows in beside]
        return cls(nodes, t[at], uv[at], frames)

    @property
    def at(self) -> Array:
        """The bends among the parameters of the fit, (2, m)."""
        return self.nodes * 3

    def limits(self, jets: Sequence[Curve]) -> Array:
        """Return homogeneous jets just before the bends, (jets, m, 4)."""
        t = _at(jets, self.t[0])
        return np.stack([jet(t, side="left") for jet in jets])

    def coordinates(self, vectors: Array, side: int = 0) -> Array:
        """Return (r, s), (m, 2), of tangent vectors (m, 3) just before (0) or after (1) the bends."""
        return tangent_coordinates(self.frames[side], vectors)

    def fitted(
        self,
        primary: Primary,
        values: Array,
        before: Array,
        make: Maker,
        rail: Callable[[Curve], Curve],
        jets: Callable[[Curve], Sequence[Curve]],
    ) -> Curve:
        """Fit lifted values (n, k), with limits ``before`` (m, k), so that the highest jet that they tell has no kink.

        ``rail`` and ``jets`` return the rail and the jets of a ribbon of which the curve is the highest direction, or
        the rail itself.
        """
        none = np.zeros((2, *before.shape))
        curve = make(values, Kinks(self.nodes[0], self.nodes[1], before, none))
        c, rates = rail(curve), [rows[-1, 1] for rows in _beside(jets(curve), self.t)]
        middle = (rates[0] + rates[1]) / 2
        turns = [
            primary.push(self.uv[i], c(self.t[i], side=side), self.coordinates(middle - rates[i], i))
            for i, side in enumerate(SIDES)
        ]
        return make(values, Kinks(self.nodes[0], self.nodes[1], before, np.stack(turns)))


SIDES: tuple[Side, Side] = ("left", "right")


def _at(jets: Sequence[Curve], t: Array) -> Array:
    """Return the breaks of jets next to t: what is read on one side must not be a rounding beside them."""
    breaks = jets[0].breaks
    return np.asarray(breaks[np.abs(t[:, None] - breaks).argmin(axis=1)])


def _beside(jets: Sequence[Curve], t: Array) -> list[Array]:
    """Return jets in space and their derivatives by t, (jets, 2, m, 3), from before and from after t (2, m)."""
    return [along(jets, _at(jets, at), 1, side) for at, side in zip(t, SIDES, strict=True)]
