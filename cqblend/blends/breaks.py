"""Breaks of several curves over one domain, made common: those that nearly coincide become one.

Curves that belong together reach a break on different ways, a knot-line crossing for one, the same for another: two
breaks next to each other would leave a piece between them whose derivatives are rounding noise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cqblend.splines import Curve, bernstein
from cqblend.splines.bernstein import Array

SAME = 1e-9  # of the domain: breaks that differ by less are one


def merged(*sets: Array) -> Array:
    """Unite sets of parameters, ascending; of those that differ by less than ``SAME`` one stays, the ends for sure."""
    t = np.unique(np.concatenate(sets))
    same = SAME * (t[-1] - t[0])
    inner = t[(t - t[0] > same) & (t[-1] - t > same)]
    inner = inner[np.append(True, np.diff(inner) > same)] if len(inner) else inner
    return np.concatenate([t[:1], inner, t[-1:]])


def aligned(curves: Sequence[Curve]) -> list[Curve]:
    """Cut curves at each other's breaks."""
    first = curves[0].breaks
    if all(np.array_equal(curve.breaks, first) for curve in curves[1:]):
        return list(curves)
    breaks = merged(*(curve.breaks for curve in curves))
    return [onto(curve, breaks) for curve in curves]


def onto(curve: Curve, breaks: Array) -> Curve:
    """Cut at the breaks, to which its own ones next to them move: pieces go on as polynomials as far as that takes.

    Over such a distance d, that errs by d to the power of the continuity and one.
    """
    old = curve.breaks
    own = breaks[np.abs(old[:, None] - breaks).argmin(axis=1)]
    if not np.array_equal(own, old):
        kept = np.flatnonzero(np.diff(own) > 0)
        start, end, length = own[kept], own[kept + 1], np.diff(old)[kept]
        coefs = bernstein.restrict(curve.coefs[..., kept], (start - old[kept]) / length, (end - old[kept]) / length)
        curve = Curve(np.append(start, end[-1]), coefs, continuity=curve.continuity[kept[1:] - 1])
    return curve.cut(breaks[1:-1])
