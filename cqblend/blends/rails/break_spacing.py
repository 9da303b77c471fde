"""Spaces the breaks of a fit so that all of its spans are about as long as their errors allow.

Halving the spans that err, round by round, takes many fits, and spans of two lengths side by side fit worse than equal
ones. Here the lengths that are needed are predicted from the errors of a fit and the order with which these fall.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.splines.bernstein import Array


def predict_growth(errors: Array, order: float) -> Array:
    """Return the factors (n,) by which spans must grow in number, of their errors (n,) as shares of what is allowed.

    Errors fall with that power of the length of the spans.
    """
    tolerances = RAIL_TOLERANCES
    growth = (errors / tolerances.aimed_share) ** (1 / order)
    return np.asarray(np.clip(growth, tolerances.least_span_growth, tolerances.most_span_growth))


def space_breaks(breaks: Array, growth: Array, fixed: Array, shortest: float = 0.0) -> Array:
    """Return breaks anew, of which there are as many times more in each span (n,) as ``growth`` (n,) says.

    Both ends, and those at ``fixed``, stay where they are. For the sake of its neighbours alone, no span gets shorter
    than ``shortest``.
    """
    growth = _grade_growth(growth, np.diff(breaks) / shortest if shortest else np.full(len(growth), np.inf))
    share = np.append(0.0, np.cumsum(growth))  # the number of new spans up to each break
    stays = np.isin(breaks, fixed)
    stays[[0, -1]] = True
    parts = [breaks[:1]]
    for i, j in pairwise(np.flatnonzero(stays).tolist()):
        count = max(1, int(np.ceil(share[j] - share[i] - RAIL_TOLERANCES.spared_span)))
        at = np.interp(share[i] + (share[j] - share[i]) * np.arange(1, count) / count, share, breaks)
        parts += [at, breaks[j : j + 1]]
    return np.concatenate(parts)


def _grade_growth(growth: Array, most: Array) -> Array:
    """Let no span grow by much less than its neighbours: a spline is only as good as the spans around."""
    beside = np.maximum(np.append(growth[1:], 0.0), np.append(0.0, growth[:-1]))
    return np.asarray(np.maximum(growth, np.minimum(beside * RAIL_TOLERANCES.neighbour_growth, most)))


def halve_spans(breaks: Array, errors: Array, shortest: float = 0.0) -> Array:
    """Return breaks with the middles of spans that err, and with the middles of their halves that will still err.

    ``errors`` (n, 2) are those of the two halves of every span, as shares of what is allowed. It is assumed that they
    fall with the fourth power of the length of the spans, which they hardly ever exceed. No span that is as short as
    ``shortest`` is halved.
    """
    fall = 2**RAIL_TOLERANCES.position_order
    while (missed := (errors.max(axis=1) > 1) & (np.diff(breaks) > shortest)).any():
        middles = (breaks[:-1] + breaks[1:])[missed] / 2
        copies = np.where(missed, 2, 1)
        halves = np.repeat(errors, copies, axis=0)
        ends = np.cumsum(copies)[missed] - 1
        halves[ends] = (errors[missed, 1:] / fall).repeat(2, axis=1)
        halves[ends - 1] = (errors[missed, :1] / fall).repeat(2, axis=1)
        breaks, errors = np.sort(np.concatenate([breaks, middles])), halves
    return breaks
