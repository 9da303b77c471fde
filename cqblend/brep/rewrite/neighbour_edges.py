"""The edges next to a blend's ends: cut where the blend's corners lie on them, or lengthened to there."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.GeomAPI import GeomAPI_ProjectPointOnCurve
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.brep.read.face_surface import SupportFace, read_support_face
from cqblend.brep.rewrite.edge_accuracy import TOLERANCE_MARGIN, measure_deviation
from cqblend.brep.rewrite.end_curve import BlendEndError, fit_solved_curve, make_shared_edge
from cqblend.brep.select.spine import EdgeSpine
from cqblend.brep.topology import (
    CONFUSION,
    AncestorMap,
    drop_duplicate_shapes,
    explore_subshapes,
    find_end_vertices,
    find_outgoing_tangent,
    find_seam_edges,
    find_vertex_uv,
    locate_vertex,
    make_trimmed_copy,
    orient_forward,
    raise_vertex_tolerance,
)
from cqblend.errors import SizeError, TopologyError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.angles import shift_to_period
from cqblend.surfaces.vectors import to_tangent_coordinates

if TYPE_CHECKING:
    from cqblend.brep.rewrite.shell_edit import ShellEdit


SAME_DIRECTION = 0.15  # rad: a joint that turns by less at a vertex goes on there


@dataclass(frozen=True)
class EdgeTrim:
    """An edge of the input, at one ``end`` of the blend, that a corner of it cuts in two, or is beyond the end of.

    It loses what is between ``vertex``, its end at the blended edge, and ``corner``; or it is lengthened.
    ``cap_border`` is the part cut off where a cap stands on it: then only the face ``trimmed_face``, which ends at the
    rail, loses that.
    """

    end: int
    edge: TopoDS_Edge
    vertex: TopoDS_Vertex
    corner: TopoDS_Vertex
    faces: tuple[TopoDS_Face, TopoDS_Face]
    cap_border: TopoDS_Edge | None = None
    trimmed_face: TopoDS_Face | None = None


def find_neighbour_faces(solid: TopoDS_Shape, vertex: TopoDS_Vertex, sides: Sequence[SupportFace]) -> list[TopoDS_Face]:
    """Return the faces at a vertex of the blended edge that are none of its two sides."""
    faces = AncestorMap(solid, TopAbs_VERTEX, TopAbs_FACE)(vertex)
    return [face for face in faces if not any(face.IsSame(side.face) for side in sides)]


def find_end_face(solid: TopoDS_Shape, spine: EdgeSpine, end: int, sides: Sequence[SupportFace]) -> TopoDS_Face:
    """Return the one face at the start (``end`` 0) or stop (1) of the blended edge on which its blend can end.

    Raises
    ------
    TopologyError
        If there is not exactly one further face, or another edge goes on there in the direction of the blended one.
    """
    vertex, edge = spine.vertices[end], spine.edges[-end]
    others = find_neighbour_faces(solid, vertex, sides)
    if len(others) != 1:
        raise TopologyError(
            f"the joint goes on there: a natural end takes one further face, across the edge, not {len(others)}"
        )
    arriving = -find_outgoing_tangent(vertex, edge)
    for other in AncestorMap(solid, TopAbs_VERTEX, TopAbs_EDGE)(vertex):
        if not other.IsSame(edge) and np.linalg.norm(find_outgoing_tangent(vertex, other) - arriving) < SAME_DIRECTION:
            raise TopologyError("the joint goes on there: another edge leaves in the same direction")
    return others[0]


def trim_neighbour_edges(surgery: ShellEdit, cuts: Iterable[EdgeTrim]) -> None:
    """Cut the edges at the ends of the blended one where the blend's corners lie on them, or lengthen them to there."""
    cuts_of: dict[int, list[EdgeTrim]] = {}
    for cut in cuts:
        cuts_of.setdefault(surgery.edge_index.find_number(cut.edge), []).append(cut)
    for number, changes in cuts_of.items():
        edge = TopoDS.Edge_s(orient_forward(surgery.edge_index[number]))
        whole = BRep_Tool.Range_s(edge)
        span, vertices, beyond = list(whole), list(find_end_vertices(edge)), []
        for cut in changes:
            which = 0 if vertices[0].IsSame(cut.vertex) else 1
            try:
                at = _find_trim_parameter(edge, which, cut)
                if at is None:
                    beyond.append(_make_extension_edge(cut))
                    continue
            except SizeError as error:
                cause = error.with_details(before=f"{surgery.name_part(edge)} next to the blend: ")
                raise BlendEndError(cut.end, cause) from error
            span[which], vertices[which] = at, cut.corner
        if (
            np.linalg.norm(locate_vertex(vertices[0]) - locate_vertex(vertices[1])) < 100 * CONFUSION
            or span[0] >= span[1]
        ):
            name = surgery.name_part(edge)
            nothing = SizeError(f"nothing would remain of {name} next to the blend: the size is too large")
            raise nothing if len({cut.end for cut in changes}) > 1 else BlendEndError(changes[0].end, nothing)
        piece = (
            edge if tuple(span) == whole else make_trimmed_copy(edge, (vertices[0], vertices[1]), (span[0], span[1]))
        )
        for face in surgery.faces_at_edge(edge):
            walls = [
                cut.cap_border for cut in changes if cut.cap_border is not None and not face.IsSame(cut.trimmed_face)
            ]
            surgery.get_face_edit(face).replaced_edges[number] = [piece, *beyond, *walls]


def _find_trim_parameter(edge: TopoDS_Edge, which: int, cut: EdgeTrim) -> float | None:
    """Return the parameter at which a FORWARD edge is to end; None if none of its own does, and it is to be extended.

    Raises
    ------
    SizeError
        If the corner lies beyond the other end.
    """
    at, distance = project_to_edge(edge, cut.corner)
    if distance <= _compute_corner_tolerance(edge, cut.faces):
        raise_vertex_tolerance(cut.corner, TOLERANCE_MARGIN * distance)
        return at
    if not _is_corner_behind(edge, cut):
        raise SizeError("the blend reaches beyond its other end: the size is too large for it")
    return _find_extension_parameter(edge, which, cut)


def find_edge_in_plane(
    face: TopoDS_Face, vertex: TopoDS_Vertex, blended: Sequence[TopoDS_Edge], normal: Array, corner: Array
) -> TopoDS_Edge | None:
    """Return the edge of a face that runs from a vertex to a point in the plane through the vertex; None if none does.

    ``normal`` is the plane's, and the edges that are ``blended`` do not count.
    """
    start = locate_vertex(vertex)
    for edge in drop_duplicate_shapes(orient_forward(use) for use in explore_subshapes(face, TopAbs_EDGE)):
        if BRep_Tool.Degenerated_s(edge) or any(edge.IsSame(one) for one in (*blended, *find_seam_edges(face))):
            continue
        own = find_end_vertices(edge)
        if own[0].IsSame(own[1]) or not any(vertex.IsSame(end) for end in own):
            continue
        curve, (first, last) = BRep_Tool.Curve_s(edge, 0.0, 0.0), BRep_Tool.Range_s(edge)
        slack = 10 * max(BRep_Tool.Tolerance_s(edge), CONFUSION)
        project = GeomAPI_ProjectPointOnCurve(gp_Pnt(*corner.tolist()), curve, first, last)
        if project.NbPoints() == 0 or project.LowerDistance() > slack:
            continue
        span = np.linspace(first if own[0].IsSame(vertex) else last, project.LowerDistanceParameter(), 17)
        points = np.array([curve.Value(t).Coord() for t in span.tolist()])
        if np.abs((points - start) @ normal).max() <= slack:
            return edge
    return None


def project_to_edge(edge: TopoDS_Edge, corner: TopoDS_Vertex) -> tuple[float, float]:
    """Return the parameter of a FORWARD edge nearest to a vertex, and the distance (mm), infinite if it is beyond."""
    project = GeomAPI_ProjectPointOnCurve(
        BRep_Tool.Pnt_s(corner), BRep_Tool.Curve_s(edge, 0.0, 0.0), *BRep_Tool.Range_s(edge)
    )
    if project.NbPoints() == 0:
        return np.nan, np.inf
    return project.LowerDistanceParameter(), project.LowerDistance()


def _compute_corner_tolerance(edge: TopoDS_Edge, faces: tuple[TopoDS_Face, TopoDS_Face]) -> float:
    """Return how far a point of both faces may be from their edge (mm): as far as that strays from them itself."""
    strays = (
        measure_deviation(use, face)
        for face in faces
        for use in explore_subshapes(face, TopAbs_EDGE)
        if use.IsSame(edge)
    )
    return max(10 * BRep_Tool.Tolerance_s(edge), 10 * CONFUSION, 2 * max(strays))


def _is_corner_behind(edge: TopoDS_Edge, cut: EdgeTrim) -> bool:
    """Whether a corner lies past the end of an edge at the cut's vertex: at a vertex of mixed convexity."""
    point, rate = gp_Pnt(), gp_Vec()
    first, last = BRep_Tool.Range_s(edge)
    starts = find_end_vertices(edge)[0].IsSame(cut.vertex)
    BRep_Tool.Curve_s(edge, 0.0, 0.0).D1(first if starts else last, point, rate)
    away = np.array(rate.Coord()) * (1.0 if starts else -1.0)
    return bool((locate_vertex(cut.corner) - locate_vertex(cut.vertex)) @ away < 0)


def _find_extension_parameter(edge: TopoDS_Edge, which: int, cut: EdgeTrim) -> float | None:
    """Return the parameter past an end of a FORWARD edge at which its own curves reach a corner; None if they do not.

    Lines and circles go on past the ends of their edges, and so do their parameter curves, or none of these is used.
    """
    curve, (first, last) = BRep_Tool.Curve_s(edge, 0.0, 0.0), BRep_Tool.Range_s(edge)
    project = GeomAPI_ProjectPointOnCurve(BRep_Tool.Pnt_s(cut.corner), curve)
    if project.NbPoints() == 0:
        return None
    at = project.LowerDistanceParameter()
    if curve.IsPeriodic():
        at = float(shift_to_period(np.array(at), np.array((first, last)[which]), curve.Period()))
    span = (at, last) if which == 0 else (first, at)
    pcurves = [BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0) for face in cut.faces]
    within = all(
        one.IsPeriodic() or (one.FirstParameter() <= span[0] and span[1] <= one.LastParameter())
        for one in (curve, *pcurves)
    )
    if not within or not span[0] < span[1] or (first <= at <= last):
        return None
    longer = make_trimmed_copy(edge, find_end_vertices(edge), span)
    strays = max(project.LowerDistance(), *(measure_deviation(longer, face) for face in cut.faces))
    return at if strays <= 10 * max(BRep_Tool.Tolerance_s(edge), CONFUSION) else None


def _make_extension_edge(cut: EdgeTrim) -> TopoDS_Edge:
    """Make the edge in which two faces go on meeting, past the end of their own edge, to a corner of the blend.

    FORWARD in the sense of that edge, at whose vertex it starts or stops exactly.
    """
    start, stop = locate_vertex(cut.vertex), locate_vertex(cut.corner)
    first, second = (read_support_face(face, start[None]) for face in cut.faces)
    length = float(np.linalg.norm(stop - start))
    chord = (stop - start) / length
    guesses = [find_vertex_uv(cut.vertex, side.face)[None] for side in (first, second)]

    def solve_curve_points(s: Array) -> Array:
        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            one, other = first.face_primary.jet(x[:, :2]), second.face_primary.jet(x[:, 2:])
            residual = np.column_stack([one[0] - other[0], (one[0] - start) @ chord - s * length])
            jacobian = np.zeros((len(x), 4, 4))
            for column, rate in enumerate((one[1], one[2], -other[1], -other[2])):
                jacobian[:, :3, column] = rate
                if column < 2:
                    jacobian[:, 3, column] = rate @ chord
            return residual, jacobian, np.linalg.norm(np.concatenate([one[1:3], other[1:3]]), axis=2).T

        guess = np.column_stack(
            [
                at
                + to_tangent_coordinates(
                    side.face_primary.jet(np.repeat(at, len(s), axis=0)), s[:, None] * (stop - start)
                )
                for side, at in zip((first, second), guesses, strict=True)
            ]
        )
        x, good = solve_damped_newton(evaluate_system, guess, length, length)
        if not good.all():
            raise SizeError("its faces do not go on meeting past its end, as far as the blend needs them to")
        return np.column_stack([x, first.face_primary.jet(x[:, :2])[0]])

    # The vertex may be beside the surfaces; the edge starts there all the same, and is on them where it stops.
    beside = start - solve_curve_points(np.zeros(1))[0, 4:]

    def offset_to_vertex(s: Array) -> Array:
        values = solve_curve_points(s)
        values[:, 4:] += (1 - s)[:, None] * beside
        return values

    def measure_error(values: Array, s: Array) -> float:
        points = values[:, 4:] - (1 - s)[:, None] * beside
        images = first.face_primary.jet(values[:, :2])[0], second.face_primary.jet(values[:, 2:4])[0]
        return float(max(np.abs(image - points).max() for image in images))

    backward = find_end_vertices(TopoDS.Edge_s(orient_forward(cut.edge)))[0].IsSame(cut.vertex)
    curve, pair = fit_solved_curve(offset_to_vertex, measure_error), (cut.vertex, cut.corner)
    return make_shared_edge(
        curve.reverse() if backward else curve, pair[::-1] if backward else pair, first.face, second.face
    )
