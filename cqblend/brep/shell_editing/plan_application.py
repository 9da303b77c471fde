"""Build the solid that a plan describes: each vertex and edge once, each touched face once, one shell.

The result is a proposal: :mod:`cqblend.solid_blends.blend_pipeline` verifies it before anybody sees it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.GeomAbs import GeomAbs_C0, GeomAbs_G1, GeomAbs_G2
from OCP.GeomAPI import GeomAPI
from OCP.TopAbs import TopAbs_EDGE, TopAbs_VERTEX, TopAbs_WIRE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex

from cqblend.blends.network.blend_plan import (
    EdgePiece,
    EdgeUse,
    FacePlan,
    KeptEdge,
    NewEdge,
    PatchPlan,
    PlannedEdge,
    PlannedSurface,
    PlannedVertex,
    SolidPlan,
    StripPlan,
    SurfaceGeometry,
    reverse_path,
)
from cqblend.brep.bodies import replace_body_faces
from cqblend.brep.measurement.edge_sides import EdgeSide
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.edge_tolerance import EdgeDeviations, raise_edge_tolerances
from cqblend.brep.shell_editing.face_pieces import group_loops
from cqblend.brep.shell_editing.planned_geometry import make_curve, make_pcurve, make_pcurves, make_surface
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import (
    BUILDER,
    ShapeIndex,
    attach_pcurves,
    chain_segments,
    explore_subshapes,
    find_end_uv,
    find_end_vertices,
    is_among,
    make_bare_face,
    make_closed_wire,
    make_degenerate_edge,
    make_edge,
    make_trimmed_copy,
    make_vertex,
    orient_forward,
    raise_vertex_tolerance,
    reverse_edge,
)
from cqblend.certificate import NewEdgeKind
from cqblend.errors import TopologyError

CONTINUITY_FLAGS = (GeomAbs_C0, GeomAbs_G1, GeomAbs_G2)
"""OCCT's flags of an edge, by the order of the continuity across it."""


@dataclass(frozen=True)
class BuiltEdge:
    """An edge of a blend face that is no rail, with its two sides, that of the blend face first.

    An edge in the border of an open shell has but that one side.

    ``deviation`` is the largest distance (mm) of its curve from either face; ``end`` tells which end of the blended
    edge it is at, 0 or 1, if it is at one.
    """

    kind: NewEdgeKind
    sides: tuple[EdgeSide, ...]
    deviation: float
    end: int | None = None


@dataclass(frozen=True)
class BuiltStrip:
    """A blend face in a rewritten solid, the support faces, trimmed at its rails, and its edges: rails and others."""

    blend_face: TopoDS_Face
    geometry: SurfaceGeometry  # of the blend face
    trimmed_faces: tuple[TopoDS_Face, TopoDS_Face]
    rail_edges: tuple[list[TopoDS_Edge], list[TopoDS_Edge]]
    poles: tuple[TopoDS_Edge | None, TopoDS_Edge | None]  # those of rails that are one point
    other_edges: tuple[BuiltEdge, ...]
    cap_count: int
    is_held: tuple[bool, bool]  # whether the rail on either side is held on an edge of the input


@dataclass(frozen=True)
class BuiltPatch:
    """A face of a corner in a rewritten solid, and those of its edges that bound no strip, each of one patch only."""

    face: TopoDS_Face
    plan: PatchPlan
    edges: tuple[BuiltEdge, ...]


@dataclass(frozen=True)
class ProposedSolid:
    """A rewritten solid or shell, not yet verified, and its strips and patches in the order of the plan."""

    solid: TopoDS_Shape
    strips: tuple[BuiltStrip, ...]
    patches: tuple[BuiltPatch, ...]
    tolerance: float  # the largest of an edge that was made or cut (mm)
    free_edges: tuple[TopoDS_Edge, ...]  # new ones in the border of an open shell
    gone_faces: tuple[int, ...]  # consumed between two blends, or swallowed by one
    removed_faces: tuple[int, ...]  # all faces of the input of which nothing remains
    rebuilt_faces: Mapping[int, TopoDS_Face]  # by the numbers of those of the input that they replace
    split_faces: Mapping[
        int, tuple[TopoDS_Face, ...]
    ]  # all pieces of those that are cut in several, the first included
    edge_pieces: Mapping[int, tuple[TopoDS_Edge, ...]]  # what remains of edges of the input that were cut, by number


def apply_plan(index: SolidIndex, plan: SolidPlan) -> ProposedSolid:
    """Build the solid that a plan describes. The input's own faces, edges and vertices stay as they were.

    Raises
    ------
    TopologyError
        If the new boundary of a face does not close.
    """
    parts = _PartBuilder(index)
    for edge in plan.edges:
        parts.build_edge(edge)
    pieces = {face_plan.number: _rebuild_face(face_plan, parts) for face_plan in plan.faces}
    blend_faces, caps = [], []
    for strip in plan.strips:
        boundary = tuple(reverse_path(strip.boundary)) if strip.is_mirrored else strip.boundary
        forward = parts.bound_face(strip.surface, boundary)
        blend_faces.append(forward if strip.is_mirrored else TopoDS.Face_s(forward.Reversed()))
        caps.append([parts.bound_face(cap.surface, cap.boundary) for cap in strip.caps])
    patch_faces = [parts.bound_patch(patch) for patch in plan.patches]
    new_faces = [*blend_faces, *patch_faces, *chain.from_iterable(caps)]
    deviations = raise_edge_tolerances([*chain.from_iterable(pieces.values()), *new_faces], index)
    owners = _list_edge_owners(plan, pieces, blend_faces, caps, parts)
    for patch, face in zip(plan.patches, patch_faces, strict=True):
        for use in patch.boundary:
            owners.setdefault(use.edge, []).append(face)
    strips = []
    for strip, blend_face in zip(plan.strips, blend_faces, strict=True):
        first, second = (
            (_find_piece(pieces[number], [parts.build_edge(edge) for edge in rail]) if number in pieces else None)
            or _find_partner(plan, strip, rail, blend_faces)
            or index.faces[number]
            for number, rail in zip(strip.support_faces, strip.rails, strict=True)
        )
        rails = ([parts.build_edge(edge) for edge in strip.rails[0]], [parts.build_edge(e) for e in strip.rails[1]])
        for face, planned, edges in zip((first, second), strip.rails, rails, strict=True):
            for one, edge in zip(planned, edges, strict=True):
                BUILDER.Continuity(edge, face, blend_face, CONTINUITY_FLAGS[one.order])
        others = _list_other_edges(strip, blend_face, [*blend_faces, *patch_faces], owners, deviations, parts)
        geometry = strip.surface.geometry
        poles = [None if edge is None else parts.build_edge(edge) for edge in strip.poles]
        held1, held2 = (any(isinstance(edge, EdgePiece) for edge in side) for side in strip.rails)
        strips.append(
            BuiltStrip(
                blend_face,
                geometry,
                (first, second),
                rails,
                (poles[0], poles[1]),
                others,
                len(strip.caps),
                (held1, held2),
            )
        )
    patches = [
        BuiltPatch(face, patch, _list_patch_edges(patch, face, owners, deviations, parts))
        for patch, face in zip(plan.patches, patch_faces, strict=True)
    ]
    rebuilt = {number: faces[0] for number, faces in pieces.items()}
    split = {number: tuple(faces) for number, faces in pieces.items() if len(faces) > 1}
    more = [face for faces in split.values() for face in faces[1:]]
    solid = replace_body_faces(index.solid, rebuilt, plan.removed_faces, index.faces, [*more, *new_faces])
    free = (edge for edge, faces in owners.items() if len(faces) == 1 and isinstance(edge, NewEdge))
    free_edges = tuple(parts.build_edge(edge) for edge in free if edge.role in ("end curve", "cap border"))
    gone = (*plan.consumed_faces, *plan.swallowed_faces)
    changes = {number: planned for face_plan in plan.faces for number, planned in face_plan.pieces.items()}
    return ProposedSolid(
        solid,
        tuple(strips),
        tuple(patches),
        deviations.largest_tolerance,
        free_edges,
        gone,
        removed_faces=plan.removed_faces,
        rebuilt_faces=rebuilt,
        split_faces=split,
        edge_pieces={number: parts.list_pieces(number, planned) for number, planned in changes.items()},
    )


def _find_partner(
    plan: SolidPlan, strip: StripPlan, rail: Sequence[PlannedEdge], blend_faces: Sequence[TopoDS_Face]
) -> TopoDS_Face | None:
    """Return the face of the other strip that shares a rail, whose support face is consumed; None of a pole."""
    partners = (
        face
        for other, face in zip(plan.strips, blend_faces, strict=True)
        if rail and other is not strip and any(rail[0] in side for side in other.rails)
    )
    return next(partners, None)


def _find_piece(pieces: Sequence[TopoDS_Face], edges: Sequence[TopoDS_Edge]) -> TopoDS_Face:
    """Return which of the pieces of a face has one of some edges; the first if none has."""
    if len(pieces) == 1:
        return pieces[0]
    return next((one for one in pieces if any(edge in ShapeIndex(one, TopAbs_EDGE) for edge in edges)), pieces[0])


def _list_edge_owners(
    plan: SolidPlan,
    pieces: Mapping[int, Sequence[TopoDS_Face]],
    blend_faces: Sequence[TopoDS_Face],
    caps: Sequence[Sequence[TopoDS_Face]],
    parts: _PartBuilder,
) -> dict[PlannedEdge, list[TopoDS_Face]]:
    """Return the faces that use each planned edge, one for each use."""
    owners: dict[PlannedEdge, list[TopoDS_Face]] = {}
    boundaries = [(strip.boundary, face) for strip, face in zip(plan.strips, blend_faces, strict=True)]
    for strip, faces in zip(plan.strips, caps, strict=True):
        boundaries += [(cap.boundary, face) for cap, face in zip(strip.caps, faces, strict=True)]
    boundaries += [
        ((use,), _find_piece(pieces[face_plan.number], [parts.build_edge(use.edge)]))
        for face_plan in plan.faces
        for use in face_plan.added
    ]
    for boundary, face in boundaries:
        for use in boundary:
            owners.setdefault(use.edge, []).append(face)
    return owners


def _list_other_edges(
    strip: StripPlan,
    blend_face: TopoDS_Face,
    blend_faces: Sequence[TopoDS_Face],
    owners: Mapping[PlannedEdge, Sequence[TopoDS_Face]],
    deviations: EdgeDeviations,
    parts: _PartBuilder,
) -> tuple[BuiltEdge, ...]:
    """Return the edges of a blend face that are no rails, with their sides; those between blends only of the first."""
    found = []
    for planned in strip.other_edges:
        if planned.role == "pole":
            continue
        edge, faces = parts.build_edge(planned), owners[planned]
        if planned.role in ("section", "mitre") and not faces[0].IsSame(blend_face):
            continue
        deviation = deviations.get(edge)
        end = next((k for k, edges in enumerate(strip.end_edges) if planned in edges), None)
        if len(faces) == 1:
            found.append(BuiltEdge("border", ((blend_face, edge),), deviation, end))
            continue
        first, second = faces if faces[0].IsSame(blend_face) else faces[::-1]
        if first.IsSame(second):
            found.append(BuiltEdge("seam", ((first, edge), (second, reverse_edge(edge))), deviation))
            continue
        between: NewEdgeKind = "mitre" if planned.role == "mitre" else "between"
        kind = between if is_among(second, blend_faces) else "end"
        BUILDER.Continuity(edge, first, second, CONTINUITY_FLAGS[planned.order])
        found.append(BuiltEdge(kind, ((first, edge), (second, edge)), deviation, end))
    return tuple(found)


def _list_patch_edges(
    patch: PatchPlan,
    face: TopoDS_Face,
    owners: Mapping[PlannedEdge, Sequence[TopoDS_Face]],
    deviations: EdgeDeviations,
    parts: _PartBuilder,
) -> tuple[BuiltEdge, ...]:
    """Return the edges of a patch beside other patches, of the first of both only, and beside support faces."""
    found = []
    for use in patch.boundary:
        planned, edge = use.edge, parts.build_edge(use.edge)
        if isinstance(planned, NewEdge) and planned.role == "pole":
            continue
        first, second = owners[planned]
        BUILDER.Continuity(edge, first, second, CONTINUITY_FLAGS[planned.order])
        if not isinstance(planned, NewEdge) or planned.role not in ("spoke", "corner curve"):
            continue
        if planned.role == "spoke" and not first.IsSame(face):
            continue
        other = second if first.IsSame(face) else first
        found.append(BuiltEdge(planned.role, ((face, edge), (other, edge)), deviations.get(edge)))
    return tuple(found)


class _PartBuilder:
    """Builds the vertices, edges and surfaces of a plan, each of them once."""

    def __init__(self, index: SolidIndex) -> None:
        self.index = index
        self._vertices: dict[PlannedVertex, TopoDS_Vertex] = {}
        self._edges: dict[PlannedEdge, TopoDS_Edge] = {}
        self._faces: dict[PlannedSurface, TopoDS_Face] = {}

    def build_vertex(self, planned: PlannedVertex) -> TopoDS_Vertex:
        """Return a vertex: the input's own, or a new one."""
        if planned.number:
            return TopoDS.Vertex_s(self.index.vertices[planned.number])
        if planned not in self._vertices:
            self._vertices[planned] = make_vertex(planned.point, SHELL_EDIT_TOLERANCES.deviation_margin * planned.gap)
        return self._vertices[planned]

    def get_face(self, face: int | PlannedSurface) -> TopoDS_Face:
        """Return a face of the input, FORWARD, or one without a boundary on a planned surface."""
        if isinstance(face, int):
            return TopoDS.Face_s(orient_forward(self.index.faces[face]))
        if face not in self._faces:
            self._faces[face] = make_bare_face(make_surface(face))
        return self._faces[face]

    def build_edge(self, planned: PlannedEdge) -> TopoDS_Edge:
        """Return a FORWARD edge."""
        if planned not in self._edges:
            self._edges[planned] = (
                self._make_new_edge(planned) if isinstance(planned, NewEdge) else self._cut_edge(planned)
            )
        return self._edges[planned]

    def list_pieces(self, number: int, planned: Sequence[PlannedEdge | KeptEdge]) -> tuple[TopoDS_Edge, ...]:
        """Return what remains of an edge of the input, of all that takes its place."""
        kept = (one for one in planned if isinstance(one, EdgePiece | KeptEdge) and one.number == number)
        return tuple(
            TopoDS.Edge_s(self.index.edges[number]) if isinstance(one, KeptEdge) else self.build_edge(one)
            for one in kept
        )

    def orient_edge(self, use: EdgeUse) -> TopoDS_Edge:
        """Return an edge as it is used."""
        edge = self.build_edge(use.edge)
        return edge if use.forward else reverse_edge(edge)

    def bound_face(self, surface: PlannedSurface, boundary: tuple[EdgeUse, ...]) -> TopoDS_Face:
        """Return the FORWARD face on a planned surface that a boundary encloses."""
        face = TopoDS.Face_s(self.get_face(surface).EmptyCopied())
        BUILDER.Add(face, make_closed_wire(map(self.orient_edge, boundary)))
        return face

    def bound_patch(self, patch: PatchPlan) -> TopoDS_Face:
        """Return the face of a corner, as it is oriented in the solid."""
        if patch.is_inverted:
            return TopoDS.Face_s(self.bound_face(patch.surface, tuple(reverse_path(patch.boundary))).Reversed())
        return self.bound_face(patch.surface, patch.boundary)

    def _make_new_edge(self, planned: NewEdge) -> TopoDS_Edge:
        first, last = map(self.build_vertex, planned.vertices)
        if planned.curve is None:
            (pcurve,) = planned.pcurves
            return make_degenerate_edge(self.get_face(pcurve.face), first, make_pcurve(pcurve.curve), planned.span)
        edge = make_edge(make_curve(planned.curve), (first, last), planned.span)
        for pcurve in planned.pcurves:
            attach_pcurves(edge, self.get_face(pcurve.face), *make_pcurves(pcurve))
        return edge

    def _cut_edge(self, planned: EdgePiece) -> TopoDS_Edge:
        vertices = (self.build_vertex(planned.vertices[0]), self.build_vertex(planned.vertices[1]))
        edge = make_trimmed_copy(self.index.edges[planned.number], vertices, planned.span)
        for vertex, gap in zip(vertices, planned.gaps, strict=True):
            raise_vertex_tolerance(vertex, SHELL_EDIT_TOLERANCES.deviation_margin * gap)
        if planned.cap is not None:
            face = self.get_face(planned.cap)
            plane = BRep_Tool.Surface_s(face)
            attach_pcurves(edge, face, GeomAPI.To2d_s(BRep_Tool.Curve_s(edge, 0.0, 0.0), plane.Pln()))
        for pcurve in planned.pcurves:
            attach_pcurves(edge, self.get_face(pcurve.face), *make_pcurves(pcurve))
        return edge


def _rebuild_face(plan: FacePlan, parts: _PartBuilder) -> list[TopoDS_Face]:
    """Return a face with its new boundary, oriented as before; wires of which no edge is changed are shared with it.

    Several faces, if it is cut in pieces.

    Raises
    ------
    TopologyError
        If the new boundary does not close.
    """
    edges, before = parts.index.edges, parts.index.faces[plan.number]
    if plan.surface is not None:
        face = parts.bound_face(plan.surface, plan.added)
        return [TopoDS.Face_s(face.Oriented(before.Orientation()))]
    old, kept = TopoDS.Face_s(orient_forward(before)), list[TopoDS_Shape]()
    loose = list(map(parts.orient_edge, plan.added))
    for wire in explore_subshapes(old, TopAbs_WIRE):
        uses = list(explore_subshapes(wire, TopAbs_EDGE))
        numbers = [edges.find_number(use) for use in uses]
        if plan.pieces.keys().isdisjoint(numbers):
            kept.append(wire)
            continue
        for use, number in zip(uses, numbers, strict=True):
            if number not in plan.pieces:
                loose.append(use)
                continue
            for piece in plan.pieces[number]:
                edge = edges[number] if isinstance(piece, KeptEdge) else parts.build_edge(piece)
                loose.append(TopoDS.Edge_s(edge.Oriented(use.Orientation())))
    loops = trace_loops(loose, old)
    groups = group_loops(old, loops, kept) if len(loops) > 1 else [[*map(make_closed_wire, loops), *kept]]
    faces = []
    for wires in groups:
        face = TopoDS.Face_s(old.EmptyCopied())
        for wire in wires:
            BUILDER.Add(face, wire)
        face.Orientation(before.Orientation())
        faces.append(face)
    return faces


def trace_loops(uses: list[TopoDS_Edge], face: TopoDS_Face) -> list[list[TopoDS_Edge]]:
    """Sort edge uses of a FORWARD face into closed loops.

    Each use is followed by one that starts at its last vertex; by the one whose pcurve starts nearest, if several do.

    Raises
    ------
    TopologyError
        If a loop does not close: the new boundary crosses itself or leaves out an edge.
    """
    find_ends = cache(lambda k: find_end_uv(uses[k], face))
    vertices = ShapeIndex.from_shapes(uses, TopAbs_VERTEX)
    starts, stops = zip(*(map(vertices.find_number, find_end_vertices(use)) for use in uses), strict=True)

    def measure_gap(one: int, following: int) -> float:
        return float(np.abs(find_ends(following)[0] - find_ends(one)[1]).max())

    loops = chain_segments(starts, stops, measure_gap, until_closed=True)
    if any(stops[loop[-1]] != starts[loop[0]] for loop in loops):
        raise TopologyError(
            "the face's boundary cannot be closed along the rail: the size is too large for the face", kind="too large"
        )
    return [[uses[k] for k in loop] for loop in loops]
