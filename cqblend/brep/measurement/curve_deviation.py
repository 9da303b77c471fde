"""How far an edge's curve and the image of its parameter curve on a face lie apart, at equal parameters.

A STEP reader sets an edge's tolerance to the deviation at 23 parameters, and ordinary ``BRepCheck`` looks at the same
23; between them, the deviation may be a thousand times as large. Here it is searched for along the whole edge: in every
span between knots, of the curves and of the surface, and again around the largest values.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from OCP.Adaptor3d import Adaptor3d_CurveOnSurface
from OCP.BRep import BRep_Tool
from OCP.BRepLib import BRepLib_ValidateEdge
from OCP.Geom import Geom_Plane
from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
from OCP.GeomAdaptor import GeomAdaptor_Curve, GeomAdaptor_Surface
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.edge_parameters import SPAN_SHARES, map_to_range
from cqblend.brep.measurement.edge_sides import read_pcurve
from cqblend.brep.measurement.knot_lines import find_curve_knots, find_knot_crossings
from cqblend.brep.measurement.surface_evaluation import measure_lengths
from cqblend.brep.measurement.tolerances import MEASURE_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array

_PART_SHARES = np.concatenate(((0.0,), SPAN_SHARES))
"""Where a part of a span is sampled, its start included, as shares of it."""


def measure_curve_deviation(use: TopoDS_Edge, face: TopoDS_Face) -> float:
    """Return the largest distance (mm) between an edge's curve and the image of its parameter curve on a face.

    Both at the same parameter, if the edge claims as much, along all of the edge. The orientation of the use tells the
    two sides of a seam apart. 0 of a degenerate edge, or of one that has no curve in space.

    Raises
    ------
    GeometryError
        If the edge has no parameter curve on the face, or OCCT cannot evaluate or compare them.
    """
    curve = BRep_Tool.Curve_s(use, 0.0, 0.0)
    if BRep_Tool.Degenerated_s(use) or curve is None:
        return 0.0
    pcurve, low, high = read_pcurve(use, face)
    surface = BRep_Tool.Surface_s(face)
    ends, pcurve_ends = BRep_Tool.Range_s(use), (low, high)
    if not BRep_Tool.SameParameter_s(use):
        return _measure_distance_to_image(
            GeomAdaptor_Curve(curve, *ends), Geom2dAdaptor_Curve(pcurve, low, high), GeomAdaptor_Surface(surface)
        )
    space, plane, on_surface = CurveEvaluator(curve), CurveEvaluator(pcurve), SurfaceEvaluator(surface)

    if space.is_straight and plane.is_straight and isinstance(surface, Geom_Plane):
        ts = np.array(ends)  # a difference of straight lines is largest at an end
        return float(measure_lengths(space(ts)[0] - on_surface(plane(np.array(pcurve_ends))[0], 0)[0]).max())

    def measure_distances(ts: Array, *, by_occt: bool = False) -> Array:
        at = map_to_range(ts, ends, pcurve_ends)
        if by_occt:
            image = on_surface.evaluate_by_occt(plane.evaluate_by_occt(at)[0], 0)[0]
            return measure_lengths(space.evaluate_by_occt(ts)[0] - image)
        return measure_lengths(space(ts)[0] - on_surface(plane(at)[0], 0)[0])

    if space.is_single_span and plane.is_single_span and on_surface.is_single_patch:
        largest = float(measure_distances(_spread_over_spans(np.array(ends), 1), by_occt=True).max())
        if largest < MEASURE_TOLERANCES.exact_deviation:
            return largest  # so smooth a difference is nothing elsewhere either
    crossings = find_knot_crossings(plane, low, high, on_surface)
    breaks = map_to_range(np.concatenate((find_curve_knots(plane, low, high), crossings)), pcurve_ends, ends)
    breaks = np.unique(np.concatenate((find_curve_knots(space, *ends), breaks.clip(*ends))))
    return _search_largest_value(measure_distances, _spread_over_spans(breaks, MEASURE_TOLERANCES.deviation_samples))


def _spread_over_spans(breaks: Array, least: int) -> Array:
    """Return parameters in all spans between breaks, these included: denser towards the ends of each part of a span.

    There are at least as many as asked for, and one part of twelve to each span.
    """
    parts = -(-least // (len(_PART_SHARES) * (len(breaks) - 1)))
    nodes = (breaks[:-1] + np.arange(parts)[:, None] / parts * (breaks[1:] - breaks[:-1])).T.ravel()
    ends = np.concatenate((nodes, breaks[-1:]))
    inside = nodes[:, None] + _PART_SHARES * (ends[1:] - ends[:-1])[:, None]
    return np.concatenate((inside.ravel(), breaks[-1:]))


def _search_largest_value(measure: Callable[[Array], Array], ts: Array) -> float:
    """Return the largest value of a function, known to be smooth between parameters (n,): refined near maxima.

    Of the local maxima, those are refined that a parabola through a sample and its neighbours may lift above the
    largest.
    """
    values = measure(ts)
    for _ in range(MEASURE_TOLERANCES.deviation_rounds):
        if values.max() < MEASURE_TOLERANCES.negligible_deviation:
            break
        padded = np.concatenate((values[:1], values, values[-1:]))
        before, after = padded[:-2], padded[2:]
        peaks = np.flatnonzero((values >= before) & (values >= after) & (values > np.minimum(before, after)))
        within_reach = 2 * values[peaks] - np.minimum(before, after)[peaks] > values.max()
        peaks = peaks[within_reach]
        peaks = peaks[np.argsort(values[peaks])[-MEASURE_TOLERANCES.deviation_peaks :]]
        low, high = ts[np.maximum(peaks - 1, 0)], ts[np.minimum(peaks + 1, len(ts) - 1)]
        fine = (low + SPAN_SHARES[:, None] * (high - low)).ravel()
        ts, index = np.unique(np.concatenate((ts, fine)), return_index=True)
        values = np.concatenate((values, measure(fine)))[index]
    return float(values.max())


def _measure_distance_to_image(
    curve: GeomAdaptor_Curve, pcurve: Geom2dAdaptor_Curve, surface: GeomAdaptor_Surface
) -> float:
    """Return OCCT's largest distance (mm) from points of a curve to the image of a pcurve, at whatever parameters.

    Raises
    ------
    GeometryError
        If OCCT cannot tell.
    """
    search = BRepLib_ValidateEdge(curve, Adaptor3d_CurveOnSurface(pcurve, surface), False)
    search.Process()
    if not search.IsDone():
        raise GeometryError("OCCT cannot tell how far an edge lies from its curve on a face")
    return float(search.GetMaxDistance())
