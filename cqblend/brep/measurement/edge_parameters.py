"""Parameters along an edge at which to measure: samples, knots, and both sides of jumps.

The difference of two surfaces along a common curve is smooth between the knots of both surfaces and of the curve, but
any span, however short, may hold the largest one. Evaluates OCCT's curves and surfaces only.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import Geom_BSplineSurface, Geom_Surface
from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
from OCP.GeomAbs import GeomAbs_BSplineCurve, GeomAbs_BSplineSurface, GeomAbs_CN, GeomAbs_Shape
from OCP.GeomAdaptor import GeomAdaptor_Surface
from OCP.TColStd import TColStd_Array1OfReal

from cqblend.brep.measurement.tolerances import MEASURE_TOLERANCES
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import solve_in_brackets

CLUSTER_OFFSETS = np.array([1e-8, 1e-5, 1e-3])
"""Distances of the samples clustered on either side of a break, relative to the edge's range."""

SPAN_SHARES = (1 - np.cos(np.pi * (np.arange(11) + 0.5) / 11)) / 2
"""Samples inside every span, as shares of it: denser towards its ends, where errors are largest."""


def spread_samples(breaks: Array, count: int) -> Array:
    """Return samples of a range: ``count`` equidistant ones, others beside breaks (n,) and, in short spans, in between.

    The ends of the range are the first and the last break. No sample is on a break.
    """
    low, high = breaks[0], breaks[-1]
    grid = np.linspace(low, high, count)
    around = CLUSTER_OFFSETS * (high - low)
    clusters = (breaks[:, None] + np.concatenate((-around, around))).ravel()
    ts = np.concatenate((grid, clusters))
    ts = ts[_measure_nearest_distance(ts, breaks) > around[0] / 2]
    lengths = np.diff(breaks)
    sparse = lengths < len(SPAN_SHARES) * (high - low) / (count - 1)
    sparse &= lengths > MEASURE_TOLERANCES.shortest_knot_span * max(abs(low), abs(high))
    inside = (breaks[:-1] + SPAN_SHARES[:, None] * lengths)[:, sparse].ravel()
    ts = np.unique(np.concatenate((ts, inside)))
    return np.asarray(ts[(ts > low) & (ts < high)])


def resample_near_maxima(
    measure: Callable[[Array], tuple[Array, ...]], ts: Array, values: tuple[Array, ...]
) -> tuple[Array, list[Array]]:
    """Measure again, more densely, around the largest values; return all parameters and values, old and new.

    ``values`` is one array (n,) for each quantity that ``measure`` returns, at parameters ts (n,). Spans beside a
    sample that is not finite are left out: towards a degenerate point, rounding grows without limit. Every twentieth
    old sample is measured again with the new ones, as normals are judged degenerate beside the others of a call.
    """
    rows = np.stack(values)
    for _ in range(MEASURE_TOLERANCES.resampling_rounds):
        worst = np.argsort(np.nan_to_num(rows, nan=-1.0), axis=1)[:, -MEASURE_TOLERANCES.worst_count :].ravel()
        is_finite = np.asarray(np.isfinite(rows).all(axis=0))
        before, after = np.maximum(worst - 1, 0), np.minimum(worst + 1, len(ts) - 1)
        usable = is_finite[before] & is_finite[after]
        low, high = ts[before][usable], ts[after][usable]
        fine = np.unique(np.concatenate([(low + SPAN_SHARES[:, None] * (high - low)).ravel(), ts[::20]]))
        ts, index = np.unique(np.concatenate([ts, fine]), return_index=True)
        rows = np.concatenate([rows, np.stack(measure(fine))], axis=1)[:, index]
    return ts, list(rows)


def find_knot_crossings(curve: Callable[[Array], Array], low: float, high: float, surface: Geom_Surface) -> Array:
    """Return where a curve in the parameter plane crosses knot lines of a surface: sign changes, found to rounding.

    The curve is given by its values (n, 2) at parameters (n,) from ``low`` to ``high``.
    """
    ts = np.linspace(low, high, MEASURE_TOLERANCES.crossing_samples)
    uv = curve(ts)
    found = [np.empty(0)]
    for k, line_distances, size in measure_line_distances(surface, GeomAbs_CN, uv):
        before, after = line_distances[:-1], line_distances[1:]
        crosses = (before * after <= 0.0) & (np.abs(after - before) < size / 2)
        crosses &= np.abs(after - before) > MEASURE_TOLERANCES.knot_line * size  # else it runs along the line
        i, line = np.nonzero(crosses)
        distances = before[i, line], after[i, line]
        knot = uv[i, k] - distances[0]

        def measure_past_knot(t: Array, k: int = k, knot: Array = knot) -> Array:
            return np.asarray(curve(t)[:, k] - knot)

        tolerance, steps = np.spacing(np.abs(knot)), MEASURE_TOLERANCES.crossing_iterations
        found.append(solve_in_brackets(measure_past_knot, (ts[i], ts[i + 1]), distances, tolerance, steps))
    return np.concatenate(found)


def find_curve_knots(curve: BRepAdaptor_Curve | Geom2dAdaptor_Curve) -> Array:
    """Return the knots of a curve, between which it is one polynomial or analytic piece, and both ends of its range."""
    ends = np.array([curve.FirstParameter(), curve.LastParameter()])
    if curve.GetType() != GeomAbs_BSplineCurve:
        return _read_intervals(curve.NbIntervals(GeomAbs_CN), lambda found: curve.Intervals(found, GeomAbs_CN))
    spline = curve.BSpline()
    return _clip_knots([spline.Knot(i) for i in range(1, spline.NbKnots() + 1)], ends)


def find_knot_lines(surface: GeomAdaptor_Surface, order: GeomAbs_Shape) -> tuple[Array, Array]:
    """Return the u and the v between which a surface is certainly of a class, with both ends of its domain.

    For the class CN these are all knots of a B-spline, also those at which continuity equals its degree or more, which
    OCCT's own intervals leave out: they bound polynomial spans all the same.
    """
    if order == GeomAbs_CN and surface.GetType() == GeomAbs_BSplineSurface:
        spline = surface.BSpline()
        u = [spline.UKnot(i) for i in range(1, spline.NbUKnots() + 1)]
        v = [spline.VKnot(i) for i in range(1, spline.NbVKnots() + 1)]
        u_ends = np.array([surface.FirstUParameter(), surface.LastUParameter()])
        v_ends = np.array([surface.FirstVParameter(), surface.LastVParameter()])
        return _clip_knots(u, u_ends), _clip_knots(v, v_ends)
    return (
        _read_intervals(surface.NbUIntervals(order), lambda ends: surface.UIntervals(ends, order)),
        _read_intervals(surface.NbVIntervals(order), lambda ends: surface.VIntervals(ends, order)),
    )


def measure_line_distances(
    surface: Geom_Surface, order: GeomAbs_Shape, uv: Array
) -> Iterator[tuple[int, Array, float]]:
    """Yield, per direction with knot lines: its index, signed distances of points (n, lines), the domain's length."""
    adaptor = GeomAdaptor_Surface(surface)
    periodic = (surface.IsUPeriodic(), surface.IsVPeriodic())
    for k, ends in enumerate(find_knot_lines(adaptor, order)):
        closed = periodic[k] and isinstance(surface, Geom_BSplineSurface)
        lines = ends[:-1] if closed else ends[1:-1]
        if lines.size:
            size = float(ends[-1] - ends[0])
            distances = uv[:, k, None] - lines
            yield k, distances - size * np.round(distances / size) if periodic[k] else distances, size


def _clip_knots(knots: Sequence[float], ends: Array) -> Array:
    """Return the knots inside a range, with both its ends; over several periods the knots of each."""
    inner, period = np.array(knots), knots[-1] - knots[0]
    periods = np.arange(np.floor((ends[0] - knots[0]) / period), np.floor((ends[1] - knots[0]) / period) + 1)
    inner = (inner + period * periods[:, None]).ravel() if len(periods) > 1 else inner
    return np.unique(np.concatenate([ends[:1], inner[(inner > ends[0]) & (inner < ends[1])], ends[1:]]))


def _read_intervals(count: int, write_ends: Callable[[TColStd_Array1OfReal], None]) -> Array:
    """Return the ends of a number of intervals, which a method of one of OCCT's adaptors writes into an array."""
    ends = TColStd_Array1OfReal(1, count + 1)
    write_ends(ends)
    return np.array([ends.Value(i) for i in range(1, count + 2)])


def _measure_nearest_distance(ts: Array, breaks: Array) -> Array:
    """Return the distances from parameters to the nearest of some sorted breaks."""
    i = np.searchsorted(breaks, ts).clip(1, len(breaks) - 1)
    return np.asarray(np.minimum(np.abs(ts - breaks[i - 1]), np.abs(ts - breaks[i])))
