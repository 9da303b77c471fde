"""Natural ends of an open blend: on the one face across the edge, or around its end over whatever faces lie there.

There, end curves take the place of what the blend cuts off the faces: their corners at the blended edge, with all edges
and faces between. The edges that the end curves start, stop and cross at are trimmed, or extended, to there. Flat caps
are in :mod:`cqblend.brep.shell_editing.end_cap`.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.gp import gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_OUT
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.blends.network.blend_plan import EdgeUse, FacePlan, NewEdge, PlannedVertex
from cqblend.blends.network.strip_surface import StripCut
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.shell_editing.end_crossings import BlendEnd, Crossing
from cqblend.brep.shell_editing.end_curve import (
    EndCurveStart,
    plan_cut_edge,
    solve_end_curve,
    solve_touch_point,
)
from cqblend.brep.shell_editing.end_path import EndPath, PathPiece, find_end_path
from cqblend.brep.shell_editing.end_tracing import Meeting
from cqblend.brep.shell_editing.face_boundary import BoundaryMark, FaceBoundary
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim, is_corner_behind, reaches_corner
from cqblend.brep.shell_editing.strip_end import RailsTooShortError, StripEnd
from cqblend.brep.shell_editing.strip_placement import StripPlacement
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import (
    explore_subshapes,
    find_end_uv,
    find_end_vertices,
    find_vertex_uv,
    is_among,
    locate_vertex,
    make_vertex,
)
from cqblend.errors import CqblendError, GeometryError, SizeError, TopologyError
from cqblend.splines.bernstein import Array


def end_on_faces(placement: StripPlacement, end: int) -> StripEnd:
    """End the blend on the faces that lie at the start (``end`` 0) or stop (1) of its edge.

    On the one face across from the edge, if there is one that takes the whole end; else over several faces.

    Raises
    ------
    RailsTooShortError
        If the blend must reach further.
    SizeError, TopologyError, GeometryError
        If it does not meet what lies there all across.
    """
    failure: CqblendError | None = None
    across = placement.joint.read_end_face(end)
    if across is not None:
        try:
            return _end_on_one_face(placement, end, across)
        except (SizeError, TopologyError, GeometryError) as error:
            failure = error
    if placement.joint.faces_at_edge is not None:
        raise failure or TopologyError("a rail has gone on over a smooth edge, and no one face lies across the end")
    try:
        at = BlendEnd(placement, end)
        return _end_along_path(at, find_end_path(at))
    except RailsTooShortError:
        raise
    except (SizeError, TopologyError, GeometryError) as error:
        raise (failure or error) from error


def _end_on_one_face(placement: StripPlacement, end: int, target: SupportFace) -> StripEnd:
    """End the blend on the one face across from the edge.

    Raises
    ------
    SizeError, TopologyError, GeometryError
        If the blend does not meet that face all across, between the two edges that it shares with the support faces.
    """
    joint = placement.joint
    vertex = joint.spine.vertices[end]
    number = placement.number_face(target.face)
    meetings = _find_meetings(placement, vertex, number)
    use = next(use for use in explore_subshapes(target.face, TopAbs_EDGE) if use.IsSame(meetings[0].of_end_face))
    stops_at_vertex = find_end_vertices(use)[1].IsSame(meetings[0].vertex)
    uv = find_end_uv(use, target.face)[1 if stops_at_vertex else 0]
    normals = [
        side.face_primary.evaluate_normals(find_vertex_uv(meeting.vertex, side.face)[None])[0]
        for side, meeting in zip(joint.sides, meetings, strict=True)
    ]
    sines = np.linalg.norm(np.cross(normals, target.face_primary.evaluate_normals(uv[None])), axis=1)
    start = EndCurveStart(end, placement.locate_edge_parameter(end), uv, locate_vertex(meetings[0].vertex))
    touch = None
    if sines.min() < SHELL_EDIT_TOLERANCES.tangent_faces:
        side = int(sines.argmin())
        at = placement.rail_curves[side](np.array([start.t]))[0]
        grows = is_corner_behind(meetings[side].of_support, meetings[side].vertex, at)
        touch = solve_touch_point(placement.strip, target.face_primary, start, side, into_blend=grows)
    cut = solve_end_curve(placement.strip, target.face_primary, start, touch)
    points = (PlannedVertex(cut.ends[0]), PlannedVertex(cut.ends[1]))
    first, second = (
        placement.keep_vertex_at(corner, () if side is own else [meeting.vertex])
        for corner, meeting, side, own in zip(points, meetings, joint.sides, joint.edge_sides, strict=True)
    )
    corners = (first, second)
    edge = plan_cut_edge(placement, cut, corners, number)
    trims = tuple(
        EdgeTrim(placement, end, edge_there, meeting.vertex, corner, faces)
        for meeting, corner, side in zip(meetings, corners, joint.sides, strict=True)
        for edge_there, faces in meeting.list_edges(side.face, target.face)
    )
    reach = [reaches_corner(trim) for trim in trims]
    outside = None if not all(reach) or _grows(placement, end, target, cut) else _find_outside(placement, target, cut)
    if outside is not None:
        raise SizeError(
            f"the end curve on {joint.name_part(target.face)} runs into "
            f"{joint.name_part(_find_nearest_edge(target, outside))}: the size is too large",
            kind="too large",
        )
    added = FacePlan(number, added=(EdgeUse(edge, forward=stops_at_vertex),))
    return StripEnd((EdgeUse(edge),), corners, cut.rail_parameters, placement.keep_vertex(vertex), trims, (added,))


def _grows(placement: StripPlacement, end: int, target: SupportFace, cut: StripCut) -> bool:
    """Whether the face that a blend ends on is to get more of its surface there, not less."""
    middle = np.array([sum(cut.span) / 2])
    x = np.concatenate([cut.on_strip(middle)[0], cut.on_other(middle)[0]])
    return bool(Meeting.at_end(placement, end, target).evaluate_rates(x)[1] < 0)


def _find_outside(placement: StripPlacement, target: SupportFace, cut: StripCut) -> Array | None:
    """Return a point (3,) of an end curve outside of the face that it is on; None if there is none."""
    shares = (np.arange(SHELL_EDIT_TOLERANCES.checked_end_points) + 0.5) / SHELL_EDIT_TOLERANCES.checked_end_points
    classifier = placement.index.get_classifier(target.face, SELECT_TOLERANCES.face_boundary)
    on_face = target.wrap_to_window(cut.on_other(cut.span[0] + shares * (cut.span[1] - cut.span[0])))
    outside = [k for k, uv in enumerate(on_face.tolist()) if classifier.Perform(gp_Pnt2d(*uv)) == TopAbs_OUT]
    return np.asarray(target.face_primary.jet(on_face[outside[:1]])[0, 0]) if outside else None


def _find_nearest_edge(target: SupportFace, point: Array) -> TopoDS_Edge:
    """Return the edge of a face that is nearest to a point (3,)."""
    vertex = make_vertex(point)
    edges = (TopoDS.Edge_s(edge) for edge in explore_subshapes(target.face, TopAbs_EDGE))
    return min(edges, key=lambda edge: BRepExtrema_DistShapeShape(vertex, edge).Value())


class _Meeting(NamedTuple):
    """The edge in which a support face meets the end face; two where a shell has not sewn them together there.

    It loses what is between ``vertex``, its end on the side of the blended edge, and the blend.
    """

    of_support: TopoDS_Edge
    of_end_face: TopoDS_Edge
    vertex: TopoDS_Vertex

    def list_edges(
        self, support: TopoDS_Face, end_face: TopoDS_Face
    ) -> list[tuple[TopoDS_Edge, tuple[TopoDS_Face, ...]]]:
        """Return the edge, or both, each with the faces that have it."""
        if self.of_support.IsSame(self.of_end_face):
            return [(self.of_support, (support, end_face))]
        return [(self.of_support, (support,)), (self.of_end_face, (end_face,))]


def _is_seam(edge: TopoDS_Edge, face: TopoDS_Face) -> bool:
    return bool(BRep_Tool.IsClosed_s(edge, face))


def _find_meetings(placement: StripPlacement, vertex: TopoDS_Vertex, end_face: int) -> list[_Meeting]:
    """Return the edges at a vertex in which an end face meets the two support faces.

    Raises
    ------
    TopologyError
        If there is not exactly one with each, nor one free edge of either.
    """
    index = placement.index
    owners = [
        (edge, {index.faces.find_number(face) for face in index.faces_at_edge(edge)})
        for edge in index.edges_at_vertex(vertex)
    ]
    meetings = []
    for support, side in zip(placement.joint.sides, placement.joint.edge_sides, strict=True):
        own = placement.number_face(side.face)
        shared = [edge for edge, faces in owners if faces == {own, end_face}]
        of_support, of_end_face = (
            shared or [edge for edge, faces in owners if faces == {number} and not _is_seam(edge, index.faces[number])]
            for number in (own, end_face)
        )
        if len(of_support) != 1 or len(of_end_face) != 1:
            raise TopologyError("the face at the end of the edge does not share exactly one edge with each side")
        meeting = _Meeting(of_support[0], of_end_face[0], vertex)
        meetings.append(meeting if support is side else _find_meeting_beyond(placement, meeting, support, end_face))
    return meetings


def _find_meeting_beyond(placement: StripPlacement, at_edge: _Meeting, support: SupportFace, end_face: int) -> _Meeting:
    """Return the edge in which an end face meets a support face beyond that at the edge.

    It is the next one with that face, from the edge in which the end face meets the face at the blended edge.

    Raises
    ------
    TopologyError
        If there is none.
    """
    boundary = FaceBoundary(placement.index.faces[end_face])
    first = boundary.find_uses(at_edge.of_end_face)[0]
    far = 0 if find_end_vertices(boundary.uses[first])[1].IsSame(at_edge.vertex) else 1
    at, vertex = first, at_edge.vertex
    while True:
        vertex = find_end_vertices(boundary.uses[at])[far]
        at = boundary.find_following(at) if far else boundary.find_preceding(BoundaryMark(at, 0.0))
        if is_among(support.face, placement.index.faces_at_edge(boundary.uses[at])):
            return _Meeting(boundary.uses[at], boundary.uses[at], vertex)
        if at == first:
            name = placement.joint.name_part(support.face)
            raise TopologyError(
                f"the rail has gone on into {name}, which does not meet the face at the end of the edge"
            )


def _end_along_path(at: BlendEnd, path: EndPath) -> StripEnd:
    """End the blend along a way around its end.

    Raises
    ------
    SizeError, TopologyError
        If what the way cuts off is not just what lies around the end of the edge.
    """
    placement, end = at.placement, at.end
    vertices = _plan_corners(placement, path)
    edges = tuple(
        plan_cut_edge(placement, piece.cut, (vertices[k], vertices[k + 1]), placement.number_face(piece.side.face))
        for k, piece in enumerate(path.pieces)
    )
    cuts = _FaceCuts(at)
    for i, crossing in enumerate((path.crossings[0], path.crossings[-1])):
        cuts.cut_support(i, crossing)
    for piece, edge in zip(path.pieces, edges, strict=True):
        cuts.cut_piece(piece, edge)
    plans, removed_faces = cuts.list_face_plans()
    trims = tuple(
        EdgeTrim(
            placement,
            end,
            crossing.edge,
            cuts.find_lost_vertex(crossing),
            vertex,
            tuple(placement.index.faces_at_edge(crossing.edge)),
        )
        for crossing, vertex in zip(path.crossings, vertices, strict=True)
        if crossing.vertex is None
    )
    return StripEnd(
        tuple(map(EdgeUse, edges)),
        (vertices[0], vertices[-1]),
        (path.pieces[0].cut.rail_parameters[0], path.pieces[-1].cut.rail_parameters[1]),
        placement.keep_vertex(placement.joint.spine.vertices[end]),
        trims,
        plans,
        removed_faces,
    )


def _plan_corners(placement: StripPlacement, path: EndPath) -> list[PlannedVertex]:
    """Return the vertices at the crossings of a way.

    Where an edge is off the surfaces of its two faces, the ends of the pieces there differ.
    """
    ends = [piece.cut.ends for piece in path.pieces]
    arriving, leaving = [ends[0][0], *(one[1] for one in ends)], [*(one[0] for one in ends), ends[-1][1]]
    vertices = []
    for crossing, point, other in zip(path.crossings, arriving, leaving, strict=True):
        if crossing.vertex is None:
            vertices.append(PlannedVertex(point, gap=float(np.linalg.norm(point - other))))
        else:
            vertices.append(placement.keep_vertex(crossing.vertex))
    return vertices


class _FaceCuts:
    """What a way around the end of a blend cuts off the faces there."""

    def __init__(self, at: BlendEnd) -> None:
        self.at, self.placement, self.index = at, at.placement, at.placement.index
        self._removed: dict[int, set[int]] = {}  # number of the face -> numbers of its edges that go
        self._added: dict[int, list[EdgeUse]] = {}
        self._marks: dict[int, tuple[FaceBoundary, list[BoundaryMark], list[BoundaryMark]]] = {}  # leaving, returning
        self._lost_ends: dict[tuple[int, float], TopoDS_Vertex] = {}  # a crossing of an edge -> its end that is cut off

    def cut_support(self, i: int, crossing: Crossing) -> None:
        """Cut support face ``i`` between the blended edge and the crossing where its rail leaves it."""
        self._cut(crossing.boundary, self.at.list_cut_uses(i, crossing))
        self._lose_end(crossing.boundary, crossing.mark, leaves=self.at.leaves_support(i))

    def cut_piece(self, piece: PathPiece, edge: NewEdge) -> None:
        """Cut a face along one piece of the way, which becomes an edge."""
        forward = piece.runs_forward
        leaves, returns = (piece.entry, piece.exit) if forward else (piece.exit, piece.entry)
        self._lose_end(piece.boundary, leaves, leaves=True)
        self._lose_end(piece.boundary, returns, leaves=False)
        number = self.placement.number_face(piece.side.face)
        _, leaving, returning = self._marks.setdefault(number, (piece.boundary, [], []))
        leaving.append(leaves)
        returning.append(returns)
        self._added.setdefault(number, []).append(EdgeUse(edge, forward))

    def _cut(self, boundary: FaceBoundary, between: Iterable[int]) -> None:
        """Take uses of edges out of the boundary of a face."""
        numbers = {self.index.edges.find_number(boundary.uses[k]) for k in between}
        self._removed.setdefault(self.placement.number_face(boundary.face), set()).update(numbers)

    def _cut_between_marks(self) -> None:
        """Cut the faces of all pieces, each from where its boundary leaves it on to where it next comes back."""
        for boundary, leaving, returning in self._marks.values():
            for mark in leaving:
                between = boundary.list_between(mark, returning)
                if between is None:
                    name = self.placement.joint.name_part(boundary.face)
                    raise TopologyError(f"the end of the blend would take {name} apart")
                self._cut(boundary, between)

    def _lose_end(self, boundary: FaceBoundary, mark: BoundaryMark, *, leaves: bool) -> None:
        """Record which end of a crossed edge is cut off, seen from one of its faces."""
        if mark.vertex is None:
            crossed = self.index.edges.find_number(boundary.uses[mark.use]), mark.parameter
            lost = boundary.find_lost_vertex(mark, leaves=leaves)
            if not lost.IsSame(self._lost_ends.setdefault(crossed, lost)):
                raise TopologyError(
                    f"{self.placement.joint.name_part(boundary.uses[mark.use])} is crossed in two senses"
                )

    def find_lost_vertex(self, crossing: Crossing) -> TopoDS_Vertex:
        """Return the end of a crossed edge that is cut off."""
        return self._lost_ends[self.index.edges.find_number(crossing.edge), crossing.mark.parameter]

    def list_face_plans(self) -> tuple[tuple[FacePlan, ...], tuple[int, ...]]:
        """Return what becomes of the faces that the way runs over and of the support faces, and which faces go.

        Raises
        ------
        TopologyError
            If an edge would go from one of its faces and stay with the other.
        """
        self._cut_between_marks()
        gone: dict[int, None] = {}
        waiting = {edge for edges in self._removed.values() for edge in edges}
        known = set(waiting)
        while waiting:
            edge = waiting.pop()
            for face in self.index.faces_at_edge(self.index.edges[edge]):
                number = self.index.faces.find_number(face)
                if number in gone or edge in self._removed.get(number, ()):
                    continue
                if number in self._removed or len(gone) >= SHELL_EDIT_TOLERANCES.max_end_faces:
                    names = map(self.placement.joint.name_part, (self.index.edges[edge], face))
                    raise TopologyError("the end of the blend would cut {} off, but {} goes on there".format(*names))
                gone[number] = None
                own = {self.index.edges.find_number(use) for use in explore_subshapes(face, TopAbs_EDGE)}
                waiting |= own - known
                known |= own
        plans = tuple(
            FacePlan(number, dict.fromkeys(sorted(edges), ()), tuple(self._added.get(number, ())))
            for number, edges in self._removed.items()
            if edges or number in self._added
        )
        return plans, tuple(gone)
