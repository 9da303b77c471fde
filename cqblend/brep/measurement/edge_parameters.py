"""Parameters along an edge at which to measure: samples, and more of them beside breaks and near maxima.

The difference of two surfaces along a common curve is smooth between the knots of both surfaces and of the curve, but
any span, however short, may hold the largest one.
"""

from collections.abc import Callable, Sequence

import numpy as np

from cqblend.brep.measurement.tolerances import MEASURE_TOLERANCES
from cqblend.splines.bernstein import Array

CLUSTER_OFFSETS = np.array([1e-8, 1e-5, 1e-3])
"""Distances of the samples clustered on either side of a break, relative to the edge's range."""

SPAN_SHARES = (1 - np.cos(np.pi * (np.arange(11) + 0.5) / 11)) / 2
"""Samples inside every span, as shares of it: denser towards its ends, where errors are largest."""


def spread_samples(breaks: Array, count: int) -> Array:
    """Return samples of a range: ``count`` equidistant ones, others beside breaks (n,) and, in short spans, in between.

    The ends of the range are the first and the last break. No sample is on a break.
    """
    low, high = breaks[0], breaks[-1]
    around = CLUSTER_OFFSETS * (high - low)
    clusters = breaks[:, None] + np.concatenate((-around, around))
    ts = np.concatenate((np.linspace(low, high, count), clusters.ravel()))
    ts = ts[_measure_nearest_distance(ts, breaks) > around[0] / 2]
    lengths = np.diff(breaks)
    sparse = lengths < len(SPAN_SHARES) * (high - low) / (count - 1)
    if sparse.any():
        sparse &= lengths > MEASURE_TOLERANCES.shortest_knot_span * max(abs(low), abs(high))
        ts = np.concatenate((ts, (breaks[:-1] + SPAN_SHARES[:, None] * lengths)[:, sparse].ravel()))
    return np.unique(ts[(ts > low) & (ts < high)])


def resample_near_maxima(
    measure: Callable[[Array], tuple[Array, ...]], ts: Array, values: tuple[Array, ...], negligible: Sequence[float]
) -> tuple[Array, Array]:
    """Measure again, more densely, around the largest values; return all parameters (m,) and values (k, m).

    ``values`` is one array (n,) for each of the k quantities that ``measure`` returns, at parameters ts (n,);
    ``negligible`` is one number for each, below which it does not matter. Where a value is nearly that of its
    neighbours, nothing much larger is in between; and what has hardly risen will not rise again. Spans beside a
    sample that is not finite are left out: towards a degenerate point, rounding grows without limit. Every twentieth
    old sample is measured again with the new ones, as normals are judged degenerate beside the others of a call.
    """
    rows, level = np.stack(values), MEASURE_TOLERANCES.level_value
    top = np.fmax.reduce(rows, axis=1)
    can_rise = (top > negligible) & (np.fmin.reduce(rows, axis=1) < (1.0 - level) * top)
    for _ in range(MEASURE_TOLERANCES.resampling_rounds):
        if not can_rise.any():
            break
        rising = rows[can_rise]
        worst = np.argsort(np.nan_to_num(rising, nan=-1.0), axis=1)[:, -MEASURE_TOLERANCES.worst_count :]
        before, after = np.maximum(worst - 1, 0), np.minimum(worst + 1, len(ts) - 1)
        at, left, right = (np.take_along_axis(rising, index, axis=1) for index in (worst, before, after))
        is_finite = np.isfinite(rows).all(axis=0)
        usable = is_finite[before] & is_finite[after] & (np.minimum(left, right) < (1.0 - level) * at)
        if not usable.any():
            break
        low, high = ts[before[usable]], ts[after[usable]]
        fine = np.unique(np.concatenate([(low + SPAN_SHARES[:, None] * (high - low)).ravel(), ts[::20]]))
        found = np.stack(measure(fine))
        risen = np.fmax.reduce(found, axis=1)
        can_rise &= risen > (1.0 + level) * top
        top = np.fmax(top, risen)
        ts, index = np.unique(np.concatenate([ts, fine]), return_index=True)
        rows = np.concatenate([rows, found], axis=1)[:, index]
    return ts, rows


def map_to_range(ts: Array, source: tuple[float, float], target: tuple[float, float]) -> Array:
    """Map parameters from one range onto another; identical ranges leave every bit as it was."""
    if source == target:
        return ts
    return target[0] + (ts - source[0]) * ((target[1] - target[0]) / (source[1] - source[0]))


def _measure_nearest_distance(ts: Array, breaks: Array) -> Array:
    """Return the distances from parameters to the nearest of some sorted breaks."""
    i = np.searchsorted(breaks, ts).clip(1, len(breaks) - 1)
    return np.asarray(np.minimum(np.abs(ts - breaks[i - 1]), np.abs(ts - breaks[i])))
