"""Where curves and surfaces may jump: knots of curves, knot lines of surfaces, and where a curve crosses them.

The difference of two surfaces along a common curve is smooth between all of these, but any span, however short, may
hold the largest one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from OCP.Geom import Geom_BSplineSurface, Geom_Curve
from OCP.Geom2d import Geom2d_Curve, Geom2d_Line
from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
from OCP.GeomAbs import GeomAbs_C1, GeomAbs_C2, GeomAbs_C3, GeomAbs_CN, GeomAbs_Shape
from OCP.GeomAdaptor import GeomAdaptor_Curve, GeomAdaptor_Surface
from OCP.TColStd import TColStd_Array1OfReal

from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.tolerances import MEASURE_TOLERANCES
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import solve_in_brackets

Bounds = tuple[float, float, float, float]
"""Least u, largest u, least v, largest v."""

_CONTINUITY = {GeomAbs_C1: 1, GeomAbs_C2: 2, GeomAbs_C3: 3}


def find_curve_knots(curve: CurveEvaluator, low: float, high: float) -> Array:
    """Return the parameters between which a curve is one polynomial, if it is a spline, with both ends of its range.

    OCCT's own intervals end only where a derivative jumps, which is less than knots do. Of curves that are no splines,
    they are all there is.
    """
    ends = np.array([low, high])
    if curve.is_single_span:
        return ends
    if curve.knots is not None:
        return _clip_knots(curve.knots, ends)
    adaptor = curve.curve
    if isinstance(adaptor, Geom2d_Curve):
        adaptor = Geom2dAdaptor_Curve(adaptor, low, high)
    elif isinstance(adaptor, Geom_Curve):
        adaptor = GeomAdaptor_Curve(adaptor, low, high)
    return _read_intervals(adaptor.NbIntervals(GeomAbs_CN), lambda found: adaptor.Intervals(found, GeomAbs_CN))


def find_knot_lines(
    surface: SurfaceEvaluator, order: GeomAbs_Shape, bounds: Bounds | None = None
) -> tuple[Array, Array]:
    """Return the u and the v between which a surface is certainly of a class, with both ends of its domain.

    For the class CN these are all knots of a spline, also those at which continuity equals its degree or more, which
    OCCT's own intervals leave out: they bound polynomial spans all the same. The domain is all of the surface's, or of
    the given bounds.
    """
    low_u, high_u, low_v, high_v = bounds or surface.surface.Bounds()
    ends = np.array([low_u, high_u]), np.array([low_v, high_v])
    if surface.spline is not None:
        u, v = (_select_knots(surface, axis, order) for axis in (0, 1))
        return _clip_knots(u, ends[0]), _clip_knots(v, ends[1])
    if surface.is_analytic:
        return ends
    adaptor = GeomAdaptor_Surface(surface.surface, low_u, high_u, low_v, high_v)
    return (
        _read_intervals(adaptor.NbUIntervals(order), lambda found: adaptor.UIntervals(found, order)),
        _read_intervals(adaptor.NbVIntervals(order), lambda found: adaptor.VIntervals(found, order)),
    )


class LineFamily(NamedTuple):
    """The knot lines of a surface in one direction.

    ``axis`` is 0 for lines of constant u, at u in ``lines`` (m,), 1 for lines of constant v; ``size`` is the length of
    the domain, which repeats if ``is_periodic``.
    """

    axis: int
    lines: Array
    size: float
    is_periodic: bool

    def measure_distances(self, uv: Array) -> Array:
        """Return the signed distances (n, m) of points (2, n) from the lines; on a periodic surface the nearest."""
        distances = uv[self.axis, :, None] - self.lines
        if self.is_periodic:
            distances -= self.size * np.round(distances / self.size)
        return np.asarray(distances)


def list_inner_lines(surface: SurfaceEvaluator, order: GeomAbs_Shape) -> list[LineFamily]:
    """Return the knot lines inside a surface's domain at which it need not be of a class, one family a direction."""
    if surface.is_single_patch:
        return []
    periodic = (surface.surface.IsUPeriodic(), surface.surface.IsVPeriodic())
    families = []
    for axis, ends in enumerate(find_knot_lines(surface, order)):
        repeats = periodic[axis] and isinstance(surface.surface, Geom_BSplineSurface)
        lines = ends[:-1] if repeats else ends[1:-1]
        if lines.size:
            families.append(LineFamily(axis, lines, float(ends[-1] - ends[0]), periodic[axis]))
    return families


def find_knot_crossings(
    curve: CurveEvaluator | Callable[[Array], Array], low: float, high: float, surface: SurfaceEvaluator
) -> Array:
    """Return where a curve in the parameter plane crosses knot lines of a surface, found to rounding.

    The curve is one of OCCT's, or a function that returns its values (2, n) at parameters (n,) between the two ends.
    """
    families = list_inner_lines(surface, GeomAbs_CN)
    if not families:
        return np.empty(0)
    if not isinstance(curve, CurveEvaluator):
        return _find_sign_changes(curve, low, high, families)
    if isinstance(curve.curve, Geom2d_Line):
        start, stop = curve.evaluate_by_occt(np.array([low, high]))[0].T
        return low + (high - low) * np.concatenate([_cross_straight(start, stop, family) for family in families])
    evaluator = curve
    return _find_sign_changes(lambda ts: np.asarray(evaluator(ts)[0]), low, high, families)


def _cross_straight(start: Array, stop: Array, family: LineFamily) -> Array:
    """Return the shares of the way from one point (2,) to another at which it crosses knot lines."""
    first, last = start[family.axis], stop[family.axis]
    if abs(last - first) <= MEASURE_TOLERANCES.knot_line * family.size:
        return np.empty(0)  # it runs along the lines
    lines = family.lines
    if family.is_periodic:
        low, high = min(first, last), max(first, last)
        turns = np.arange(np.floor((low - lines[-1]) / family.size), np.ceil((high - lines[0]) / family.size) + 1)
        lines = (lines + family.size * turns[:, None]).ravel()
    shares = (lines - first) / (last - first)
    return np.asarray(shares[(shares > 0.0) & (shares < 1.0)])


def _find_sign_changes(
    curve: Callable[[Array], Array], low: float, high: float, families: Sequence[LineFamily]
) -> Array:
    """Return where the distance of a curve from a knot line changes sign between samples, refined by regula falsi."""
    ts = np.linspace(low, high, MEASURE_TOLERANCES.crossing_samples)
    uv = curve(ts)
    found = [np.empty(0)]
    for family in families:
        distances = family.measure_distances(uv)
        before, after = distances[:-1], distances[1:]
        steps = np.abs(after - before)
        crosses = (before * after <= 0.0) & (steps < family.size / 2)
        crosses &= steps > MEASURE_TOLERANCES.knot_line * family.size  # else it runs along the line
        i, line = np.nonzero(crosses)
        bracket = before[i, line], after[i, line]
        knot = uv[family.axis, i] - bracket[0]

        def measure_past_knot(t: Array, axis: int = family.axis, knot: Array = knot) -> Array:
            return np.asarray(curve(t)[axis] - knot)

        tolerance, most = np.spacing(np.abs(knot)), MEASURE_TOLERANCES.crossing_iterations
        found.append(solve_in_brackets(measure_past_knot, (ts[i], ts[i + 1]), bracket, tolerance, most))
    return np.concatenate(found)


def _select_knots(surface: SurfaceEvaluator, axis: int, order: GeomAbs_Shape) -> Array:
    """Return the distinct knots of a spline surface in one direction at which it need not be of a class."""
    assert surface.spline is not None
    breaks = surface.spline.breaks[axis]
    if order == GeomAbs_CN:
        return breaks
    return breaks[surface.spline.multiplicities[axis] > surface.spline.degrees[axis] - _CONTINUITY[order]]


def _clip_knots(knots: Array, ends: Array) -> Array:
    """Return the knots inside a range, with both its ends; over several periods the knots of each."""
    low, high, period = ends[0], ends[1], knots[-1] - knots[0]
    if high > knots[-1] or low < knots[0]:
        periods = np.arange(np.floor((low - knots[0]) / period), np.floor((high - knots[0]) / period) + 1)
        knots = np.unique(knots + period * periods[:, None])
    return np.concatenate([ends[:1], knots[(knots > low) & (knots < high)], ends[1:]])


def _read_intervals(count: int, write_ends: Callable[[TColStd_Array1OfReal], None]) -> Array:
    """Return the ends of a number of intervals, which a method of one of OCCT's adaptors writes into an array."""
    ends = TColStd_Array1OfReal(1, count + 1)
    write_ends(ends)
    return np.array([ends.Value(i) for i in range(1, count + 2)])
