"""Breaks of several curves over one domain, made common: those equal to rounding become one.

Curves that belong together reach a break on different ways, a knot-line crossing for one, the same for another: two
breaks a rounding apart would leave a piece between them whose derivatives mean nothing.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cqblend.splines import Curve
from cqblend.splines.bernstein import Array

SAME = 1e-13  # of the domain: breaks that differ by less are one


def merged(*sets: Array) -> Array:
    """Unite sets of parameters, ascending; of those equal to rounding the first stays."""
    t = np.unique(np.concatenate(sets))
    return t[np.append(True, np.diff(t) > SAME * (t[-1] - t[0]))]


def aligned(curves: Sequence[Curve]) -> list[Curve]:
    """Cut curves at each other's breaks."""
    first = curves[0].breaks
    if all(np.array_equal(curve.breaks, first) for curve in curves[1:]):
        return list(curves)
    breaks = merged(*(curve.breaks for curve in curves))
    return [_onto(curve, breaks) for curve in curves]


def _onto(curve: Curve, breaks: Array) -> Curve:
    """Cut at the breaks, to which those of the curve move that equal them to rounding."""
    own = breaks[np.abs(curve.breaks[:, None] - breaks).argmin(axis=1)]
    return Curve(own, curve.coefs, continuity=curve.continuity).cut(breaks[1:-1])
