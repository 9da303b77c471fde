"""Common breaks of several curves over one domain: those that nearly coincide become one.

Two breaks close to each other would leave a piece of length h between them, in whose derivatives the rounding of poles
is divided by h. To move a break over a distance d, pieces go on past their ends as polynomials, which errs by d to the
power of continuity + 1. That is far less where curves of one ribbon have the same break, computed in different ways, or
where both rails of a blend cross knot lines at nearly one parameter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cqblend.splines import SMOOTH, Curve, bernstein
from cqblend.splines.bernstein import Array
from cqblend.splines.tolerances import SPLINE_TOLERANCES


def merge_breaks(*sets: Array, near: float = SPLINE_TOLERANCES.near_breaks) -> Array:
    """Unite sets of parameters, ascending; of those closer than ``near``, a share of the range, one stays."""
    t = np.unique(np.concatenate(sets))
    return _pick_from_clusters(t, np.zeros(len(t)), near * (t[-1] - t[0]))


def _pick_from_clusters(t: Array, order: Array, near: float) -> Array:
    """Choose one of each cluster of ascending parameters (n,): the first of least order; both ends always stay."""
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
    """Cut a curve at given breaks, after moving its own breaks to the nearest of them.

    Pieces go on past their ends as polynomials, and pieces between breaks that move to one place vanish. Moving a break
    by d errs by d to the power of continuity + 1 in values, and by k powers less in derivatives of order k; a break
    that has moved is known to one order of continuity less.
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
        own = np.append(start, end[-1])
        curve = Curve._from_pieces((own,), coefs, curve.rational, (least[to[kept[1:]]],))
    return curve._subdivide_at(0, breaks)


def _close_gaps(coefs: Array, moved: Array) -> None:
    """Let pieces (in place) meet at breaks that have moved, unless their gap is so large that it is meant."""
    before, after = coefs[-1, :, :-1], coefs[0, :, 1:]
    jump = np.abs(after - before).max(axis=0, initial=0.0)
    meet = moved & (jump <= SPLINE_TOLERANCES.piece_gap * np.abs(coefs).max())
    before[:, meet] = after[:, meet] = (before[:, meet] + after[:, meet]) / 2
