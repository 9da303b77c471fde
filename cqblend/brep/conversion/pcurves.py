"""Read edges of OCCT as symbolic curves: in the parameter plane of a face's spline surface, and in space.

The parameters are those of :func:`cqblend.brep.conversion.spline_conversion.to_surface`, in which the rails of freeform
blends are given. On planes, B-splines and extrusions they are the face's own, and a pcurve is converted exactly; on
analytic faces an angle becomes the parameter of a rational arc, and a pcurve oblique to the parameter lines is fitted.
"""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeEdge
from OCP.Geom import Geom_TrimmedCurve
from OCP.Geom2d import Geom2d_BSplineCurve, Geom2d_Curve, Geom2d_OffsetCurve, Geom2d_TrimmedCurve
from OCP.Geom2dConvert import Geom2dConvert
from OCP.GeomConvert import GeomConvert
from OCP.TopAbs import TopAbs_EDGE, TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from cqblend.blends.rails import projection
from cqblend.brep.conversion import spline_arrays
from cqblend.brep.conversion.pcurve_fit import CHECKED_SHARES, interpolate_jets
from cqblend.brep.conversion.spline_conversion import ConicArcs, ParameterMap, to_surface_with_map
from cqblend.brep.conversion.tolerances import CONVERSION_TOLERANCES
from cqblend.brep.topology import explore_subshapes, is_among
from cqblend.errors import GeometryError, InputError, SelectionError, UnsupportedError
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide
from cqblend.splines.knot_line_cuts import cut_at_knot_lines


def read_edge_pcurve(face: TopoDS_Face, edge: TopoDS_Edge) -> Curve:
    """Return an edge of a face as a curve of dim 2 in the parameters of ``to_surface(face)``, in the edge's sense.

    Exact where those are the face's own parameters, and for straight pcurves along u or v on any face. Pcurves that are
    conics, and straight ones along an angle, are reparametrised: the ends are at the edge's own parameters, points
    between them are not. Everything else is fitted at the edge's own speed, as C2 quintics (C1 where arcs of the
    surface meet) within 1e-11.

    Parameters
    ----------
    face : TopoDS_Face
    edge : TopoDS_Edge
        One of its edges. For a REVERSED edge the curve is reversed, over the same range of t; the orientation also
        tells the two sides of a seam apart.

    Raises
    ------
    SelectionError
        If the edge is not on the face.
    GeometryError
        If a fit does not reach 1e-11.
    UnsupportedError
        If the pcurve is an offset curve.
    """
    if not is_among(edge, explore_subshapes(face, TopAbs_EDGE)):
        raise SelectionError("the edge is not one of the face's: take it from the face, or project it")
    plane = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
    if plane is None:
        raise SelectionError("the edge has no curve in the parameters of the face: project it")
    curve = _read_plane_curve(plane, *BRep_Tool.Range_s(edge, face))
    curve = _convert_to_spline_parameters(curve, to_surface_with_map(face)[1])
    return curve.reverse() if edge.Orientation() == TopAbs_REVERSED else curve


def edge_to_curve(edge: TopoDS_Edge) -> Curve:
    """Return an edge as a curve of dim 3 in space, in the edge's sense; conics as rational arcs.

    Raises
    ------
    SelectionError
        If the edge is degenerate: a point.
    """
    curve = BRep_Tool.Curve_s(edge, 0.0, 0.0)
    if curve is None:
        raise SelectionError("the edge has no curve in space: it is degenerate, or has curves on faces only")
    spline = GeomConvert.CurveToBSplineCurve_s(Geom_TrimmedCurve(curve, *BRep_Tool.Range_s(edge)))
    result = Curve.from_bspline(*spline_arrays.curve_to_arrays(spline))
    return result.reverse() if edge.Orientation() == TopAbs_REVERSED else result


def curve_to_edge(curve: Curve) -> TopoDS_Edge:
    """Return the edge that covers the whole of a curve of dim 3.

    Raises
    ------
    InputError
        If the curve is not in space.
    GeometryError
        If OCCT cannot make an edge of it.
    """
    if curve.dim != 3:
        raise InputError(f"an edge needs a curve in space; this one has dimension {curve.dim}")
    maker = BRepBuilderAPI_MakeEdge(spline_arrays.curve_from_arrays(*curve.to_bspline()))
    if not maker.IsDone():
        raise GeometryError(f"OCCT cannot make an edge of the curve ({maker.Error().name}): has it no length?")
    return maker.Edge()


def project_to_parameters(surface: Surface, curve: Curve | TopoDS_Edge, tolerance: float = 1e-7) -> Curve:
    """Return the projection of an edge, or of a curve of dim 3, into the parameter plane of a surface.

    See :func:`cqblend.blends.rails.projection.project_curve`.

    Raises
    ------
    SelectionError
        If the edge is degenerate.
    GeometryError
        If a point has no foot inside the surface's domain, or the tolerance cannot be reached.
    """
    return projection.project_curve(surface, curve if isinstance(curve, Curve) else edge_to_curve(curve), tolerance)


def _read_plane_curve(curve: Geom2d_Curve, first: float, last: float) -> Curve:
    """Return a curve of the parameter plane over a part of its range."""
    while isinstance(curve, Geom2d_TrimmedCurve):
        curve = curve.BasisCurve()
    if isinstance(curve, Geom2d_OffsetCurve):
        raise UnsupportedError("the edge's curve on the face is an offset curve, which is no spline: project the edge")
    if not curve.IsPeriodic():
        first, last = max(first, curve.FirstParameter()), min(last, curve.LastParameter())
    whole = (first, last) == (curve.FirstParameter(), curve.LastParameter())
    if not (whole and isinstance(curve, Geom2d_BSplineCurve)):
        curve = Geom2dConvert.CurveToBSplineCurve_s(Geom2d_TrimmedCurve(curve, first, last))
    return Curve.from_bspline(*spline_arrays.curve2d_to_arrays(curve))


def _convert_to_spline_parameters(curve: Curve, parameters: ParameterMap) -> Curve:
    """Convert a curve from a face's own parameters to those of its spline."""
    both = (parameters.u, parameters.v)
    if both == (None, None):
        return curve
    ends = curve(curve.domain)
    if curve.degree == 1 and len(curve.breaks) == 2 and not curve.rational and (ends[0] == ends[1]).any():
        return Curve.bezier(parameters.to_spline(ends), domain=curve.domain)
    lines = [np.array([0.0, 1.0]) if arcs is None else arcs.breaks for arcs in both]
    cut, index, _ = cut_at_knot_lines(curve, lines, [np.zeros(len(line) - 2, dtype=int) for line in lines])
    pieces, breaks = index, cut.breaks
    rounding = 16 * np.finfo(float).eps * max(float(np.abs(bound).max()) for bound in curve.bounds())
    for _ in range(CONVERSION_TOLERANCES.pcurve_refinements):
        starts = _convert_parameter_jets(cut, both, pieces, breaks[:-1], "right")
        stops = _convert_parameter_jets(cut, both, pieces, breaks[1:], "left")
        fitted = interpolate_jets(breaks, starts, stops)
        t = breaks[:-1] + CHECKED_SHARES * np.diff(breaks)
        error = np.abs(fitted(t) - parameters.to_spline(curve(t))).max(axis=(0, 2))
        bad = error > CONVERSION_TOLERANCES.pcurve + rounding
        if not bad.any():
            return fitted
        at = np.flatnonzero(bad)
        breaks = np.insert(breaks, at + 1, t[1, at])
        pieces = np.insert(pieces, at + 1, pieces[:, at], axis=1)
    raise GeometryError(
        f"the edge's curve on the face errs by {error.max():.3g} in the spline's parameters at t = "
        f"{breaks[int(error.argmax())]:.9g}, more than {CONVERSION_TOLERANCES.pcurve:g}"
    )


def _convert_parameter_jets(
    curve: Curve, arcs: tuple[ConicArcs | None, ConicArcs | None], pieces: Array, t: Array, side: BreakSide
) -> Array:
    """Return a curve's points in the parameters of a spline, with their first two derivatives, (3, n, 2).

    ``pieces`` (2, n) are the indices of the arcs in u and v that the points belong to: where two arcs meet, the second
    derivative depends on that.
    """
    out = curve.jet(t, 2, side=side)
    for axis, whole in enumerate(arcs):
        if whole is None:
            continue
        for k in np.unique(pieces[axis]):
            on = pieces[axis] == k
            arc = ConicArcs(whole.breaks[k : k + 2], whole.hyperbolic)
            angle, turn, bend = out[:, on, axis]
            value = arc.to_spline(angle)
            slope, curvature = arc.evaluate_conic_rates(value)
            rate = turn / slope
            out[:, on, axis] = value, rate, (bend - curvature * rate**2) / slope
    return out
