"""Where to measure along an edge: the places at which a curve or a surface may jump, and samples in between.

What is measured between two surfaces along a common curve is smooth between knots of any of them, and may be anything
on a span that is as short as two knot lines are close. Reads OCCT's own curves and surfaces, and knows nothing of what
is measured.
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import Geom_BSplineSurface, Geom_Surface
from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
from OCP.GeomAbs import GeomAbs_BSplineCurve, GeomAbs_BSplineSurface, GeomAbs_CN, GeomAbs_Shape
from OCP.GeomAdaptor import GeomAdaptor_Surface
from OCP.TColStd import TColStd_Array1OfReal

from cqblend.splines.bracketing import solve_in_brackets

Array = NDArray[np.float64]

CLUSTER_OFFSETS = np.array([1e-8, 1e-5, 1e-3])
"""Distances of the samples clustered on either side of a break, relative to the edge's range."""

SPAN_SHARES = (1 - np.cos(np.pi * (np.arange(11) + 0.5) / 11)) / 2
"""Samples inside every span, as shares of it, however short: denser towards its ends, where errors are largest."""

_SHORTEST_SPAN = 64 * float(np.finfo(float).eps)
"""Length of a span, relative to the parameters, below which there are no parameters inside it."""

_RESAMPLING_ROUNDS, WORST_COUNT = 2, 4
"""How often it is measured again around the largest values, and around how many of each."""

_BRACKETS, _STEPS = 1025, 40
"""Points between which crossings with knot lines are looked for, and steps in which they are found at most."""

KNOT_LINE_TOLERANCE = 1e-7
"""A pcurve that stays this near a knot line, relative to the domain, runs along it: those read from STEP do stray."""


def spread_samples(at: Array, samples: int) -> Array:
    """Spread samples over a range: equidistant, beside given places (n,), its ends among them, and in between.

    However close two places are, there are samples between them, as long as there are numbers.
    """
    low, high = at[0], at[-1]
    grid = np.linspace(low, high, samples)
    around = CLUSTER_OFFSETS * (high - low)
    clusters = (at[:, None] + np.concatenate((-around, around))).ravel()
    ts = np.concatenate((grid, clusters))
    ts = ts[_measure_nearest_distance(ts, at) > around[0] / 2]
    lengths = np.diff(at)
    sparse = lengths < len(SPAN_SHARES) * (high - low) / (samples - 1)
    sparse &= lengths > _SHORTEST_SPAN * max(abs(low), abs(high))
    inside = (at[:-1] + SPAN_SHARES[:, None] * lengths)[:, sparse].ravel()
    ts = np.unique(np.concatenate((ts, inside)))
    return np.asarray(ts[(ts > low) & (ts < high)])


def resample_near_maxima(
    measure: Callable[[Array], tuple[Array, ...]], ts: Array, values: tuple[Array, ...]
) -> tuple[Array, list[Array]]:
    """Measure again, more densely, around the largest of each of some values (n,) at ts (n,); return all that is known.

    Not next to degenerate places, towards which rounding grows without limit. These show beside other samples only, so
    that every twentieth is measured along.
    """
    rows = np.stack(values)
    for _ in range(_RESAMPLING_ROUNDS):
        worst = np.argsort(np.nan_to_num(rows, nan=-1.0), axis=1)[:, -WORST_COUNT:].ravel()
        sound = np.asarray(np.isfinite(rows).all(axis=0))
        before, after = np.maximum(worst - 1, 0), np.minimum(worst + 1, len(ts) - 1)
        clear = sound[before] & sound[after]
        low, high = ts[before][clear], ts[after][clear]
        fine = np.unique(np.concatenate([(low + SPAN_SHARES[:, None] * (high - low)).ravel(), ts[::20]]))
        ts, index = np.unique(np.concatenate([ts, fine]), return_index=True)
        rows = np.concatenate([rows, np.stack(measure(fine))], axis=1)[:, index]
    return ts, list(rows)


def find_knot_crossings(curve: Callable[[Array], Array], low: float, high: float, surface: Geom_Surface) -> Array:
    """Return where a curve in the parameter plane crosses knot lines of a surface: sign changes, found to rounding.

    The curve is given by its values (n, 2) at parameters (n,) from ``low`` to ``high``.
    """
    ts = np.linspace(low, high, _BRACKETS)
    uv = curve(ts)
    found = [np.empty(0)]
    for k, beyond, size in measure_line_distances(surface, GeomAbs_CN, uv):
        before, after = beyond[:-1], beyond[1:]
        crosses = (before * after <= 0.0) & (np.abs(after - before) < size / 2)
        crosses &= np.abs(after - before) > KNOT_LINE_TOLERANCE * size  # else it runs along the line
        i, line = np.nonzero(crosses)
        distances = before[i, line], after[i, line]
        knot = uv[i, k] - distances[0]

        def measure_past_knot(t: Array, k: int = k, knot: Array = knot) -> Array:
            return np.asarray(curve(t)[:, k] - knot)

        found.append(
            solve_in_brackets(measure_past_knot, (ts[i], ts[i + 1]), distances, np.spacing(np.abs(knot)), _STEPS)
        )
    return np.concatenate(found)


def find_curve_knots(curve: BRepAdaptor_Curve | Geom2dAdaptor_Curve) -> Array:
    """Return the parameters between which a curve is one and the same function, with both ends of its range."""
    ends = np.array([curve.FirstParameter(), curve.LastParameter()])
    if curve.GetType() != GeomAbs_BSplineCurve:
        return _read_intervals(curve.NbIntervals(GeomAbs_CN), lambda found: curve.Intervals(found, GeomAbs_CN))
    spline = curve.BSpline()
    return _clip_knots([spline.Knot(i) for i in range(1, spline.NbKnots() + 1)], ends)


def find_knot_lines(surface: GeomAdaptor_Surface, order: GeomAbs_Shape) -> tuple[Array, Array]:
    """Return the u and the v between which a surface is certainly of a class, with both ends of its domain.

    The knots of a B-spline are between what is CN, even of the highest degree; OCCT's own intervals leave those out.
    """
    if order == GeomAbs_CN and surface.GetType() == GeomAbs_BSplineSurface:
        spline = surface.BSpline()
        u = [spline.UKnot(i) for i in range(1, spline.NbUKnots() + 1)]
        v = [spline.VKnot(i) for i in range(1, spline.NbVKnots() + 1)]
        ends = np.array([surface.FirstUParameter(), surface.LastUParameter()])
        across = np.array([surface.FirstVParameter(), surface.LastVParameter()])
        return _clip_knots(u, ends), _clip_knots(v, across)
    return (
        _read_intervals(surface.NbUIntervals(order), lambda ends: surface.UIntervals(ends, order)),
        _read_intervals(surface.NbVIntervals(order), lambda ends: surface.VIntervals(ends, order)),
    )


def measure_line_distances(
    surface: Geom_Surface, order: GeomAbs_Shape, uv: Array
) -> Iterator[tuple[int, Array, float]]:
    """Yield, per direction with knot lines: its index, points' signed distances (n, lines), the domain's length."""
    adaptor = GeomAdaptor_Surface(surface)
    periodic = (surface.IsUPeriodic(), surface.IsVPeriodic())
    for k, ends in enumerate(find_knot_lines(adaptor, order)):
        closed = periodic[k] and isinstance(surface, Geom_BSplineSurface)
        lines = ends[:-1] if closed else ends[1:-1]
        if lines.size:
            size = float(ends[-1] - ends[0])
            beyond = uv[:, k, None] - lines
            yield k, beyond - size * np.round(beyond / size) if periodic[k] else beyond, size


def _clip_knots(knots: Sequence[float], ends: Array) -> Array:
    """Return the knots inside a range, with both its ends; over several periods the knots of each."""
    inner, period = np.array(knots), knots[-1] - knots[0]
    laps = np.arange(np.floor((ends[0] - knots[0]) / period), np.floor((ends[1] - knots[0]) / period) + 1)
    inner = (inner + period * laps[:, None]).ravel() if len(laps) > 1 else inner
    return np.unique(np.concatenate([ends[:1], inner[(inner > ends[0]) & (inner < ends[1])], ends[1:]]))


def _read_intervals(count: int, fill: Callable[[TColStd_Array1OfReal], None]) -> Array:
    """Read the ends of a number of intervals from one of OCCT's adaptors."""
    ends = TColStd_Array1OfReal(1, count + 1)
    fill(ends)
    return np.array([ends.Value(i) for i in range(1, count + 2)])


def _measure_nearest_distance(ts: Array, at: Array) -> Array:
    """Distances from parameters to the nearest of some sorted places."""
    i = np.searchsorted(at, ts).clip(1, len(at) - 1)
    return np.asarray(np.minimum(np.abs(ts - at[i - 1]), np.abs(ts - at[i])))
