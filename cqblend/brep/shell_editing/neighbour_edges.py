"""The edges next to a blend's ends: trimmed where the blend's corners lie on them, or extended to there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.GeomAPI import GeomAPI_ProjectPointOnCurve
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.network.blend_plan import EdgePiece, FacePlan, KeptEdge, NewEdge, PlannedEdge, PlannedVertex
from cqblend.brep.conversion.support_face import read_support_face
from cqblend.brep.measurement.curve_deviation import measure_curve_deviation
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.end_curve import BlendEndError, fit_solved_curve, plan_shared_edge
from cqblend.brep.shell_editing.strip_placement import StripPlacement
from cqblend.brep.topology import (
    CONFUSION,
    explore_subshapes,
    find_end_vertices,
    find_vertex_uv,
    locate_vertex,
    make_trimmed_copy,
    orient_forward,
)
from cqblend.errors import SizeError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.angles import shift_to_period
from cqblend.surfaces.vectors import to_tangent_coordinates

LEAST_REMAINDER = 10 * CONFUSION
"""mm: what is shorter does not remain of an edge."""


@dataclass(frozen=True)
class EdgeTrim:
    """An edge of the input next to one ``end`` (0 or 1) of a blend, to be trimmed or extended to the blend's corner.

    It loses what is between ``spine_vertex``, its end on the side of the blended edge, and ``corner``; or it is
    lengthened to there, but for a free edge, which has one face. Where a flat cap stands on the edge, ``cap_border`` is
    the part between vertex and corner: then only the face ``face_without_border``, which ends at the rail, loses that
    part.
    """

    placement: StripPlacement
    end: int
    edge: TopoDS_Edge
    spine_vertex: TopoDS_Vertex
    corner: PlannedVertex
    faces: tuple[TopoDS_Face, ...]
    cap_border: EdgePiece | None = None
    face_without_border: TopoDS_Face | None = None


def trim_neighbour_edges(trims: Iterable[EdgeTrim], index: SolidIndex) -> list[FacePlan]:
    """Trim the edges at the ends of blends where the blends' corners lie on them, or extend them to there.

    Returns what that means for the faces that share these edges.

    Raises
    ------
    BlendEndError, SizeError
        If an edge is too short, or its faces do not go on meeting as far as it would be extended.
    """
    plans: list[FacePlan] = []
    trims_by_edge: dict[int, list[EdgeTrim]] = {}
    for trim in trims:
        trims_by_edge.setdefault(index.edges.find_number(trim.edge), []).append(trim)
    for number, edge_trims in trims_by_edge.items():
        edge = TopoDS.Edge_s(orient_forward(index.edges[number]))
        pieces = _trim_edge(edge, number, edge_trims)
        for face in index.faces_at_edge(edge):
            borders = [
                trim.cap_border
                for trim in edge_trims
                if trim.cap_border is not None and not face.IsSame(trim.face_without_border)
            ]
            plans.append(FacePlan(index.faces.find_number(face), {number: (*pieces, *borders)}))
    return plans


def _trim_edge(edge: TopoDS_Edge, number: int, trims: Sequence[EdgeTrim]) -> list[PlannedEdge | KeptEdge]:
    """Return what remains of a FORWARD edge after its trims, with the edges that extend it."""
    whole, extensions = BRep_Tool.Range_s(edge), list[PlannedEdge | KeptEdge]()
    span, gaps = list(whole), [0.0, 0.0]
    own, vertices = (
        find_end_vertices(edge),
        [trims[0].placement.keep_vertex(vertex) for vertex in find_end_vertices(edge)],
    )
    for trim in trims:
        which = 0 if own[0].IsSame(trim.spine_vertex) else 1  # the end of the edge that is trimmed
        try:
            found = _find_trim_parameter(edge, which, trim)
            if found is None:
                extensions.append(_plan_extension_edge(trim))
                continue
        except SizeError as error:
            name = trim.placement.joint.name_part(edge)
            raise BlendEndError(trim.end, error.with_details(before=f"{name} next to the blend: ")) from error
        span[which], gaps[which] = found
        vertices[which] = trim.corner
    if len(trims) > 1 and vertices[0] is vertices[1]:
        return extensions  # two blends meet there, and consume it
    distance = np.linalg.norm(vertices[0].point - vertices[1].point)
    if distance < LEAST_REMAINDER or span[0] >= span[1]:
        name = trims[0].placement.joint.name_part(edge)
        nothing = _make_nothing_left_error(name, _measure_room(edge, trims))
        raise nothing if len(trims) > 1 else BlendEndError(trims[0].end, nothing)
    if tuple(span) == whole:
        return [KeptEdge(number), *extensions]
    piece = EdgePiece(number, (span[0], span[1]), (vertices[0], vertices[1]), (gaps[0], gaps[1]))
    return [piece, *extensions]


def _measure_room(edge: TopoDS_Edge, trims: Sequence[EdgeTrim]) -> float:
    """Return the distance between the ends of an edge relative to those of its ends from the corners of its trims."""
    start, stop = map(locate_vertex, find_end_vertices(edge))
    taken = sum(np.linalg.norm(trim.corner.point - locate_vertex(trim.spine_vertex)) for trim in trims)
    return float(np.linalg.norm(stop - start) / taken)


def _find_trim_parameter(edge: TopoDS_Edge, which: int, trim: EdgeTrim) -> tuple[float, float] | None:
    """Return the parameter at which a FORWARD edge is to end, and how far (mm) the corner is from its curve there.

    None if its own curves do not reach the corner.

    ``which`` end of the edge is at the trim's vertex: 0 its start, 1 its end.

    Raises
    ------
    SizeError
        If the corner lies beyond the other end.
    """
    at_corner = _locate_corner(edge, trim)
    return _find_extension_parameter(edge, which, trim) if at_corner is None else at_corner


def _locate_corner(edge: TopoDS_Edge, trim: EdgeTrim) -> tuple[float, float] | None:
    """Return the parameter of a FORWARD edge at a corner, and how far (mm) it is from its curve; None if it is behind.

    Raises
    ------
    SizeError
        If the corner lies beyond the other end.
    """
    parameter, distance = project_to_edge(edge, trim.corner)
    if np.isfinite(distance) and _is_within_tolerance(distance, edge, trim.faces):
        return parameter, distance
    if len(trim.faces) == 1 or not is_corner_behind(edge, trim.spine_vertex, trim.corner.point):
        raise SizeError("the blend reaches beyond its other end: the size is too large for it", kind="too large")
    return None


def reaches_corner(trim: EdgeTrim) -> bool:
    """Whether an edge has the corner that it is to be trimmed to; False if it must be extended to there.

    Raises
    ------
    SizeError
        If the corner lies beyond its other end, or so near that nothing remains.
    """
    edge = TopoDS.Edge_s(orient_forward(trim.edge))
    name = trim.placement.joint.name_part(edge)
    try:
        found = _locate_corner(edge, trim)
    except SizeError as error:
        raise error.with_details(before=f"{name} next to the blend: ") from error
    (other_end,) = (vertex for vertex in find_end_vertices(edge) if not vertex.IsSame(trim.spine_vertex))
    if np.linalg.norm(locate_vertex(other_end) - trim.corner.point) < LEAST_REMAINDER:
        raise _make_nothing_left_error(name)
    return found is not None


def _make_nothing_left_error(name: str, room: float = 0.0) -> SizeError:
    """Return the error of an edge of which nothing would remain."""
    message = f"nothing would remain of {name} next to the blend: the size is too large"
    return SizeError(message, kind="too large", room=room)


def project_to_edge(edge: TopoDS_Edge, corner: PlannedVertex) -> tuple[float, float]:
    """Return the parameter of a FORWARD edge nearest to a corner, and the distance (mm), infinite if it is beyond."""
    project = GeomAPI_ProjectPointOnCurve(
        gp_Pnt(*corner.point.tolist()), BRep_Tool.Curve_s(edge, 0.0, 0.0), *BRep_Tool.Range_s(edge)
    )
    if project.NbPoints() == 0:
        return np.nan, np.inf
    return project.LowerDistanceParameter(), project.LowerDistance()


def _is_within_tolerance(distance: float, edge: TopoDS_Edge, faces: tuple[TopoDS_Face, ...]) -> bool:
    """Whether a point of the faces at an edge is as near to it (mm) as it may be, given how far it is from them."""
    if distance <= 10 * max(BRep_Tool.Tolerance_s(edge), CONFUSION):
        return True
    deviations = (
        measure_curve_deviation(use, face)
        for face in faces
        for use in explore_subshapes(face, TopAbs_EDGE)
        if use.IsSame(edge)
    )
    return distance <= 2 * max(deviations)


def is_corner_behind(edge: TopoDS_Edge, vertex: TopoDS_Vertex, corner: Array) -> bool:
    """Whether a corner lies past the end of an edge at a vertex: it does at a vertex of mixed convexity."""
    point, rate = gp_Pnt(), gp_Vec()
    edge = TopoDS.Edge_s(orient_forward(edge))
    first, last = BRep_Tool.Range_s(edge)
    starts = find_end_vertices(edge)[0].IsSame(vertex)
    BRep_Tool.Curve_s(edge, 0.0, 0.0).D1(first if starts else last, point, rate)
    away = np.array(rate.Coord()) * (1.0 if starts else -1.0)
    return bool((corner - locate_vertex(vertex)) @ away < 0)


def _find_extension_parameter(edge: TopoDS_Edge, which: int, trim: EdgeTrim) -> tuple[float, float] | None:
    """Return the parameter past an end of a FORWARD edge at which its own curves reach a corner, and the distance (mm).

    None if they do not.

    Lines and circles go on past the ends of their edges. They are used only if their pcurves go on as well.
    """
    curve, (first, last) = BRep_Tool.Curve_s(edge, 0.0, 0.0), BRep_Tool.Range_s(edge)
    project = GeomAPI_ProjectPointOnCurve(gp_Pnt(*trim.corner.point.tolist()), curve)
    if project.NbPoints() == 0:
        return None
    at = project.LowerDistanceParameter()
    if curve.IsPeriodic():
        at = float(shift_to_period(np.array(at), np.array((first, last)[which]), curve.Period()))
    span = (at, last) if which == 0 else (first, at)
    pcurves = [BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0) for face in trim.faces]
    within = all(
        one.IsPeriodic() or (one.FirstParameter() <= span[0] and span[1] <= one.LastParameter())
        for one in (curve, *pcurves)
    )
    if not within or not span[0] < span[1] or (first <= at <= last):
        return None
    longer = make_trimmed_copy(edge, find_end_vertices(edge), span)
    deviation = max(project.LowerDistance(), *(measure_curve_deviation(longer, face) for face in trim.faces))
    reaches = deviation <= 10 * max(BRep_Tool.Tolerance_s(edge), CONFUSION)
    return (at, project.LowerDistance()) if reaches else None


def _plan_extension_edge(trim: EdgeTrim) -> NewEdge:
    """Plan the edge in which two faces go on meeting, past the end of their own edge, to a corner of the blend.

    FORWARD in the sense of that edge, and it starts or stops exactly at that edge's vertex.
    """
    start, stop = locate_vertex(trim.spine_vertex), trim.corner.point
    first, second = (read_support_face(face, start[None]) for face in trim.faces)
    length = float(np.linalg.norm(stop - start))
    chord = (stop - start) / length
    guesses = [find_vertex_uv(trim.spine_vertex, side.face)[None] for side in (first, second)]

    def solve_curve_points(s: Array, near: Array | None) -> Array:
        """Return (u1, v1, u2, v2, x, y, z) on both surfaces at shares s (n,) of the chord."""

        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            one, other = first.face_primary.jet(x[:, :2]), second.face_primary.jet(x[:, 2:])
            residual = np.column_stack([one[0] - other[0], (one[0] - start) @ chord - s * length])
            jacobian = np.zeros((len(x), 4, 4))
            for column, rate in enumerate((one[1], one[2], -other[1], -other[2])):
                jacobian[:, :3, column] = rate
                if column < 2:
                    jacobian[:, 3, column] = rate @ chord
            return residual, jacobian, np.linalg.norm(np.concatenate([one[1:3], other[1:3]]), axis=2).T

        guess = (
            np.column_stack(
                [
                    at
                    + to_tangent_coordinates(
                        side.face_primary.jet(np.repeat(at, len(s), axis=0)), s[:, None] * (stop - start)
                    )
                    for side, at in zip((first, second), guesses, strict=True)
                ]
            )
            if near is None
            else near[:, :4]
        )
        x, good = solve_damped_newton(evaluate_system, guess, length, length)
        if not good.all():
            raise SizeError("its faces do not go on meeting past its end, as far as the blend needs them to")
        return np.column_stack([x, first.face_primary.jet(x[:, :2])[0]])

    # The vertex may lie off the surfaces. The edge starts there all the same, offset from their intersection by what
    # fades out linearly to its other end.
    vertex_offset = start - solve_curve_points(np.zeros(1), None)[0, 4:]

    def offset_to_vertex(s: Array, near: Array | None) -> Array:
        """Return the same with points that start exactly at the vertex."""
        values = solve_curve_points(s, near)
        values[:, 4:] += (1 - s)[:, None] * vertex_offset
        return values

    def measure_error(values: Array, s: Array) -> float:
        """Return how far (mm) points, but for the offset, are from their images on both surfaces."""
        points = values[:, 4:] - (1 - s)[:, None] * vertex_offset
        images = first.face_primary.jet(values[:, :2])[0], second.face_primary.jet(values[:, 2:4])[0]
        return float(max(np.abs(image - points).max() for image in images))

    starts_at_vertex = find_end_vertices(TopoDS.Edge_s(orient_forward(trim.edge)))[0].IsSame(trim.spine_vertex)
    curve = fit_solved_curve(offset_to_vertex, measure_error)
    pair = (trim.placement.keep_vertex(trim.spine_vertex), trim.corner)
    if starts_at_vertex:
        curve, pair = curve.reverse(), pair[::-1]
    numbers = (trim.placement.number_face(trim.faces[0]), trim.placement.number_face(trim.faces[1]))
    return plan_shared_edge("extension", curve, pair, numbers)
