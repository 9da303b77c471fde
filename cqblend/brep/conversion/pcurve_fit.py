"""Interpolate curves in a parameter plane by C2 quintics: the step that every refinement of a fitted pcurve repeats."""

from __future__ import annotations

import numpy as np

from cqblend.brep.conversion.tolerances import CONVERSION_TOLERANCES
from cqblend.splines import Curve, interpolation
from cqblend.splines.bernstein import Array

CHECKED_SHARES = (np.arange(1, 4) / 4)[:, None]
"""Parts of a span, a column (3, 1), at which a fit is compared with what it stands for."""


def interpolate_jets(breaks: Array, starts: Array, stops: Array) -> Curve:
    """Return the quintic spline with given values and first two derivatives at both ends of every span.

    Where the derivatives on both sides of a break differ by rounding only, they are made equal, so that the spline is
    C2 there.

    Parameters
    ----------
    breaks
        (n + 1,) ends of the spans.
    starts, stops
        (3, n, 2) value, first and second derivative at the start and at the end of each span. Changes ``stops``.
    """
    allowed = CONVERSION_TOLERANCES.equal_derivatives * (1 + np.abs(starts[:, 1:]))
    is_same = np.abs(stops[:, :-1] - starts[:, 1:]) <= allowed
    stops[:, :-1] = np.where(is_same, starts[:, 1:], stops[:, :-1])
    return interpolation.hermite(breaks, np.stack([starts, stops], axis=2))
