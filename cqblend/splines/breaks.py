"""Breaks of several curves over one domain, made common: those that nearly coincide become one.

Two breaks next to each other would leave a piece between them, of length h, whose derivatives are the rounding of poles
over h. Bringing them together over a distance d costs what polynomials miss when they go on past their end: d to the
power of the continuity and one. Where curves belong together and reach a break on different ways, or both rails of a
blend cross knot lines at nearly one place, that is less by far.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cqblend.splines import SMOOTH, Curve, bernstein
from cqblend.splines.bernstein import Array
from cqblend.splines.tolerances import SPLINE_TOLERANCES


def merge_breaks(*sets: Array, near: float = SPLINE_TOLERANCES.near_breaks) -> Array:
    """Unite sets of parameters, ascending; of those that differ by less than ``near`` one stays, the ends for sure."""
    t = np.unique(np.concatenate(sets))
    return _pick_from_clusters(t, np.zeros(len(t)), near * (t[-1] - t[0]))


def _pick_from_clusters(t: Array, order: Array, near: float) -> Array:
    """Choose one of each cluster of parameters (n,), ascending: the first of least order; the ends for sure."""
    apart = np.diff(t) > near
    if apart.all():
        return t
    cluster = np.append(0, np.cumsum(apart))
    order = order.astype(float)
    order[[0, -1]] = -np.inf
    chosen = np.lexsort((order, cluster))
    best = chosen[np.append(True, np.diff(cluster[chosen]) > 0)]
    return np.unique(np.concatenate([t[[0]], t[best], t[[-1]]]))


def align_breaks(curves: Sequence[Curve], near: float = SPLINE_TOLERANCES.near_breaks) -> list[Curve]:
    """Cut curves at each other's breaks; those that differ by less than ``near`` become the least smooth of them."""
    first = curves[0].breaks
    slack = near * (first[-1] - first[0])
    if all(np.array_equal(curve.breaks, first) for curve in curves[1:]) and np.diff(first).min() > slack:
        return list(curves)
    t = np.concatenate([curve.breaks[1:-1] for curve in curves])
    order = np.concatenate([curve.continuity for curve in curves])
    inner = np.unique(t)
    least = np.full(len(inner), SMOOTH)
    np.minimum.at(least, np.searchsorted(inner, t), order)
    ends = np.array([0])
    breaks = _pick_from_clusters(
        np.concatenate([first[:1], inner, first[-1:]]), np.concatenate([ends, least, ends]), slack
    )
    return [cut_at_breaks(curve, breaks) for curve in curves]


def cut_at_breaks(curve: Curve, breaks: Array) -> Curve:
    """Cut at the breaks, to which its own ones next to them move: pieces go on as polynomials as far as that takes.

    Pieces between own breaks that move to one place vanish. Over a distance d, going on errs by d to the power of the
    continuity and one, and derivatives of order k by k powers less: a break that has moved keeps one order less.
    """
    old = curve.breaks
    to = np.abs(old[:, None] - breaks).argmin(axis=1)
    own = breaks[to]
    if not np.array_equal(own, old):
        kept = np.flatnonzero(np.diff(to) > 0)
        start, end, length = own[kept], own[kept + 1], np.diff(old)[kept]
        coefs = bernstein.restrict_pieces(
            curve.coefs[..., kept], (start - old[kept]) / length, (end - old[kept]) / length
        )
        moved = np.abs(own - old)[1:-1] > SPLINE_TOLERANCES.moved_break * (old[-1] - old[0])
        rough = moved & (curve.continuity > 0) & (curve.continuity < SMOOTH)
        order = curve.continuity - rough
        least = np.full(len(breaks), SMOOTH)
        np.minimum.at(least, to[1:-1], order)
        apart = np.zeros(len(breaks), bool)
        np.logical_or.at(apart, to[1:-1], moved)
        _close_gaps(coefs, apart[to[kept[1:]]])
        curve = Curve(np.append(start, end[-1]), coefs, continuity=least[to[kept[1:]]])
    return curve.cut(breaks[1:-1])


def _close_gaps(coefs: Array, moved: Array) -> None:
    """Let pieces meet at breaks that have moved, but not those that jump: at creases, or what comes near to them."""
    before, after = coefs[-1, :, :-1], coefs[0, :, 1:]
    jump = np.abs(after - before).max(axis=0, initial=0.0)
    meet = moved & (jump <= SPLINE_TOLERANCES.piece_gap * np.abs(coefs).max())
    before[:, meet] = after[:, meet] = (before[:, meet] + after[:, meet]) / 2
