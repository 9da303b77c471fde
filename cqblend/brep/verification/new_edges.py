"""What can be wrong with the edges and vertices that came in with replaced faces: kind, tolerance, length, pcurves."""

from __future__ import annotations

from OCP.Adaptor3d import Adaptor3d_CurveOnSurface
from OCP.BRep import BRep_Tool
from OCP.BRepLib import BRepLib_ValidateEdge
from OCP.Geom import Geom_BSplineCurve, Geom_Surface
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
from OCP.GeomAdaptor import GeomAdaptor_Curve, GeomAdaptor_Surface
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.brep.measurement.curve_deviation import measure_curve_deviation
from cqblend.brep.topology import (
    CONFUSION,
    ShapeIndex,
    drop_duplicate_shapes,
    explore_subshapes,
    find_end_vertices,
)
from cqblend.brep.verification.brep_check import get_shared_curve
from cqblend.brep.verification.replaced_faces import Check, ReplacedFaces, ReplacementProblem
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.errors import CqblendError


def find_missing_curves(replaced: ReplacedFaces) -> list[ReplacementProblem]:
    """Return a problem for every new edge that lacks a curve, or is marked degenerate although it is not.

    OCCT's own checks crash on edges without a curve in space.
    """
    problems = []
    for use, face in replaced.new_uses:
        if BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0) is None:
            problems.append(_describe(replaced, use, "has no curve in the parameters of a face", face))
        elif BRep_Tool.Degenerated_s(use):
            if _measure_image(use, face) > 2 * max(map(BRep_Tool.Tolerance_s, find_end_vertices(use))):
                problems.append(_describe(replaced, use, "is marked degenerate, and is not", face))
        elif BRep_Tool.Curve_s(use, 0.0, 0.0) is None:
            problems.append(_describe(replaced, use, "has no curve in space", face))
    return problems


def find_loose_edges(replaced: ReplacedFaces, limit: float) -> list[ReplacementProblem]:
    """Return a problem for every new edge or vertex whose tolerance (mm) is above a limit, or above an edge's length.

    Pieces of old edges, and their ends, may have the tolerance that the old edges needed.
    """
    edges = drop_duplicate_shapes(use for use, _ in replaced.new_uses)
    loose = [edge for edge in edges if BRep_Tool.Tolerance_s(edge) > limit]
    inherited = _list_inherited(replaced, loose) if loose else []
    problems = [
        _describe(replaced, edge, f"has tolerance {BRep_Tool.Tolerance_s(edge):.2g} mm, above {limit:.2g}")
        for edge in loose
        if not any(edge.IsSame(other) for other in inherited)
    ]
    allowed = max([limit, *(BRep_Tool.Tolerance_s(edge) for edge in inherited)])
    for edge in edges:
        for vertex in find_end_vertices(edge):
            if _is_loose(vertex, allowed) and vertex not in replaced.old_vertices:
                what = f"has a vertex of tolerance {BRep_Tool.Tolerance_s(vertex):.2g} mm, above {limit:.2g}"
                problems.append(_describe(replaced, edge, what))
        if _is_shorter_than(edge, max(2 * CONFUSION, BRep_Tool.Tolerance_s(edge))):
            problems.append(_describe(replaced, edge, "is shorter than its tolerance"))
    return problems


def find_deviations(replaced: ReplacedFaces) -> list[ReplacementProblem]:
    """Return a problem for every use of a new edge whose curve and pcurve are further apart than its tolerance.

    This is what BRepCheck's exact mode finds more than the ordinary one, which looks at 23 parameters only. Pieces of
    old edges that had the same fault are left out.
    """
    problems = []
    for use, face in replaced.new_uses:
        if BRep_Tool.Degenerated_s(use):
            continue
        tolerance = BRep_Tool.Tolerance_s(use)
        if _is_surely_near(use, face, BRep_Tool.Surface_s(face), tolerance):
            continue
        try:
            deviation = measure_curve_deviation(use, face)
        except CqblendError as error:
            problems.append(_describe(replaced, use, f"cannot be compared with its face: {error}", face))
            continue
        if deviation > tolerance + VERIFICATION_TOLERANCES.deviation_slack and not _had_fault(replaced, use, deviation):
            what = f"is {deviation:.2g} mm off its curve on a face, its tolerance is {tolerance:.2g} mm"
            problems.append(_describe(replaced, use, what, face))
    return problems


def _is_surely_near(use: TopoDS_Edge, face: TopoDS_Face, surface: Geom_Surface, tolerance: float) -> bool:
    """Whether samples show that an edge is no further from its pcurve than a tolerance (mm).

    Either they are much nearer, or three times as many samples find nothing larger.
    """
    sampled = _sample_deviation(use, face, surface)
    if sampled is None:
        return False
    if sampled <= VERIFICATION_TOLERANCES.undoubted_deviation * tolerance:
        return True
    margin = VERIFICATION_TOLERANCES.resolved_deviation
    again = _sample_deviation(use, face, surface, 3)
    return again is not None and again <= margin * sampled and margin * again <= tolerance


def _sample_deviation(use: TopoDS_Edge, face: TopoDS_Face, surface: Geom_Surface, factor: int = 1) -> float | None:
    """Return the largest distance (mm) between an edge's curve and pcurve at many parameters; None if OCCT cannot."""
    curve, pcurve = BRep_Tool.Curve_s(use, 0.0, 0.0), BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0)
    if curve is None or pcurve is None:
        return None
    search = BRepLib_ValidateEdge(
        GeomAdaptor_Curve(curve, *BRep_Tool.Range_s(use)),
        Adaptor3d_CurveOnSurface(
            Geom2dAdaptor_Curve(pcurve, *BRep_Tool.Range_s(use, face)), GeomAdaptor_Surface(surface)
        ),
        BRep_Tool.SameParameter_s(use),
    )
    spans = sum(c.NbKnots() for c in (curve, pcurve) if isinstance(c, Geom_BSplineCurve | Geom2d_BSplineCurve))
    fewest, each = VERIFICATION_TOLERANCES.deviation_samples
    search.SetControlPointsNumber(factor * (fewest + each * spans))
    search.Process()
    return float(search.GetMaxDistance()) if search.IsDone() else None


def _had_fault(replaced: ReplacedFaces, use: TopoDS_Edge, deviation: float) -> bool:
    """Whether an edge is a piece of an old one that was no nearer to its pcurve on some face than its tolerance."""
    curve = get_shared_curve(use)
    for face in replaced.old:
        for old in _list_edges(face):
            if get_shared_curve(old) is curve and not BRep_Tool.Degenerated_s(old):
                found = measure_curve_deviation(old, face)
                if found > BRep_Tool.Tolerance_s(old) and found > deviation / 2:
                    return True
    return False


def _list_edges(face: TopoDS_Face) -> list[TopoDS_Edge]:
    return list(explore_subshapes(face, TopAbs_EDGE))


def _list_inherited(replaced: ReplacedFaces, edges: list[TopoDS_Edge]) -> list[TopoDS_Edge]:
    """Return those of some edges that are pieces of old ones, on the same curves."""
    known = [get_shared_curve(edge) for edge in replaced.old_edges]
    return [edge for edge in edges if any(get_shared_curve(edge) is curve for curve in known)]


def _is_loose(vertex: TopoDS_Vertex, allowed: float) -> bool:
    return not vertex.IsNull() and BRep_Tool.Tolerance_s(vertex) > VERIFICATION_TOLERANCES.vertex_slack * allowed


def _is_shorter_than(edge: TopoDS_Edge, length: float) -> bool:
    """Whether an edge, which is not degenerate, stays within a length (mm) of its start."""
    if BRep_Tool.Degenerated_s(edge):
        return False
    curve, (first, last) = BRep_Tool.Curve_s(edge, 0.0, 0.0), BRep_Tool.Range_s(edge)
    start = curve.Value(first)
    return all(start.Distance(curve.Value(first + share * (last - first))) <= length for share in (1.0, 0.5, 0.3))


def _measure_image(use: TopoDS_Edge, face: TopoDS_Face) -> float:
    """Return how far (mm) the image of an edge's pcurve goes from where it starts."""
    pcurve = BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0)
    (first, last), surface = BRep_Tool.Range_s(use, face), BRep_Tool.Surface_s(face)
    points = [surface.Value(*pcurve.Value(first + share * (last - first)).Coord()) for share in (0.0, 0.3, 0.5, 1.0)]
    return max(points[0].Distance(point) for point in points[1:])


def _describe(
    replaced: ReplacedFaces, edge: TopoDS_Edge, what: str, face: TopoDS_Face | None = None
) -> ReplacementProblem:
    """Return a problem of an edge, by its number in the result."""
    check = Check.EDGES if face is None else Check.DEVIATION
    name = f"edge {ShapeIndex(replaced.after, TopAbs_EDGE).find_number(edge)}"
    return ReplacementProblem(f"{name} {what}", check, replaced.find_new_faces([edge]), (edge,))
