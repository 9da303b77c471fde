"""What lies between a chain and its rails where these leave the faces at the edges: parts of faces that all go.

Rails cross smooth edges of which a part is lost, wherever it ends; other edges, and whole faces, are lost altogether.
Found from the vertices of the chain: what hangs on a lost vertex is lost up to where a rail or an end of the blend
crosses it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Vertex

from cqblend.blends.network.blend_plan import EdgePiece, FacePlan, PlannedVertex
from cqblend.brep.selection.chains import Chain, Junction
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.end_cap import plan_edge_remainders
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim, project_to_edge
from cqblend.brep.shell_editing.strip_end import StripEnd
from cqblend.brep.shell_editing.strip_placement import CapStations, StripPlacement
from cqblend.brep.topology import ShapeIndex, find_end_vertices, orient_forward
from cqblend.errors import SizeError
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class EdgeCrossing:
    """Where a rail crosses a smooth edge: the corner of the blend there, and the direction (3,) into the blend."""

    edge: TopoDS_Edge
    corner: PlannedVertex
    into: Array


@dataclass(frozen=True)
class LostParts:
    """What goes under a chain: changes of faces, trims of edges, whole faces by their numbers, and all vertices."""

    face_plans: tuple[FacePlan, ...]
    edge_trims: tuple[EdgeTrim, ...]
    faces: tuple[int, ...]
    vertices: tuple[TopoDS_Vertex, ...]


def find_lost_parts(
    placements: Sequence[StripPlacement],
    chain: Chain,
    joined: Sequence[tuple[StripEnd, StripEnd]],
    ends: tuple[Sequence[StripEnd], Sequence[StripEnd]],
    caps: CapStations,
) -> LostParts:
    """Return what goes under a divided chain, its own edges included.

    ``joined`` are the ends of its cells at every junction, ``ends`` the starts and the stops of all cells, and ``caps``
    where it ends in flat caps.

    Raises
    ------
    SizeError
        If a rail crosses a smooth edge past its end, or in a sense that leaves nothing between it and the chain.
    """
    numbers = map(placements[0].index.edges.find_number, chain.edges)
    remainders: dict[int, tuple[EdgePiece, ...]] = dict.fromkeys(numbers, ())
    kept: list[TopoDS_Vertex] = []
    cells = [] if chain.closed else list(zip(placements, *ends, strict=True))
    for k, (placement, start, stop) in enumerate(cells):
        own = caps[0] if k == 0 else None, caps[1] if k == len(placements) - 1 else None
        kept += list_kept_vertices(placement, own)
        for number, pieces in plan_edge_remainders(placement, (start, stop), own).items():
            remainders[number] += pieces
    search = _LossSearch(placements, chain, () if chain.closed else (ends[0][0], ends[1][-1]), remainders)
    for before, (stop, _), junction in zip(placements, joined, chain.junctions, strict=False):
        for crossing in _list_crossings(before, junction, stop.corners):
            search.mark_crossing(crossing)
    return search.collect(kept)


def list_kept_vertices(placement: StripPlacement, caps: CapStations) -> list[TopoDS_Vertex]:
    """Return the ends of the blended edges at which a flat cap stands, or the blend ends in a point."""
    return [
        vertex
        for end, (vertex, cap) in enumerate(zip(placement.joint.spine.vertices, caps, strict=True))
        if cap is not None or placement.ends_in_point(end)
    ]


def _list_crossings(
    before: StripPlacement, junction: Junction, corners: tuple[PlannedVertex, PlannedVertex]
) -> list[EdgeCrossing]:
    """Return where the rails of a cell cross smooth edges at its stop."""
    rates = before.strip.jet(np.full(2, before.domain[1]), np.array([0.0, 1.0]), 1)[0, 1]
    ways = rates[0], -rates[1]
    return [
        EdgeCrossing(edge, corner, into)
        for edges, corner, into in zip(junction.crossed, corners, ways, strict=True)
        for edge in edges
    ]


@dataclass(frozen=True)
class _Mark:
    """A crossing of an edge: its parameter, the distance (mm) of the corner, and whether what comes after is lost."""

    parameter: float
    gap: float
    corner: PlannedVertex
    loses_rest: bool


@dataclass
class _LossSearch:
    """The search for what is lost, from vertex to vertex."""

    placements: Sequence[StripPlacement]
    chain: Chain
    ends: Sequence[StripEnd]
    remainders: Mapping[int, tuple[EdgePiece, ...]]
    _marks: dict[int, list[_Mark]] = field(default_factory=dict)

    @property
    def _index(self) -> SolidIndex:
        return self.placements[0].index

    def mark_crossing(self, crossing: EdgeCrossing) -> None:
        """Record where a rail crosses an edge."""
        number = self._index.edges.find_number(crossing.edge)
        edge = TopoDS.Edge_s(orient_forward(self._index.edges[number]))
        parameter, gap = project_to_edge(edge, crossing.corner)
        if not np.isfinite(gap):
            name = self.placements[0].joint.name_part(edge)
            raise SizeError(f"the rail passes beyond the end of {name}, which it should cross", kind="smooth edge")
        along = np.array(BRep_Tool.Curve_s(edge, 0.0, 0.0).DN(parameter, 1).Coord())
        mark = _Mark(parameter, gap, crossing.corner, bool(along @ crossing.into > 0))
        self._marks.setdefault(number, []).append(mark)

    def collect(self, kept: Sequence[TopoDS_Vertex]) -> LostParts:
        """Return what is lost; ``kept`` are vertices of the chain that stay."""
        find, spine = self._index.vertices.find_number, self.chain.edges
        own = {find(vertex) for edge in spine for vertex in find_end_vertices(edge)} - set(map(find, kept))
        waiting, vertices, edges = list(own), dict.fromkeys(sorted(own)), dict[int, None]()

        def lose_vertex(number: int) -> None:
            if number not in vertices:
                vertices[number] = None
                waiting.append(number)

        for number in self._marks:
            for vertex in self._list_lost_ends(number):
                lose_vertex(vertex)
        stopped = self._list_stopped()
        while waiting:
            vertex = waiting.pop()
            for edge in self._index.edges_at_vertex(self._index.vertices[vertex]):
                number = self._index.edges.find_number(edge)
                if number in self.remainders or number in edges or (number, vertex) in stopped:
                    continue
                if number in self._marks or self._is_cut_seam(number):
                    continue
                edges[number] = None
                for end in find_end_vertices(self._index.edges[number]):
                    lose_vertex(find(end))
        return self._describe(list(edges), list(vertices))

    def _list_lost_ends(self, number: int) -> list[int]:
        """Return the numbers of the ends of a crossed edge that are lost."""
        marks = sorted(self._marks[number], key=lambda mark: mark.parameter)
        ends = find_end_vertices(TopoDS.Edge_s(orient_forward(self._index.edges[number])))
        lost = [not marks[0].loses_rest, marks[-1].loses_rest]
        return [self._index.vertices.find_number(one) for one, is_lost in zip(ends, lost, strict=True) if is_lost]

    def _list_stopped(self) -> set[tuple[int, int]]:
        """Return edges, with a vertex from which on they are lost, that an end of the chain trims or takes away."""
        edges, vertices = self._index.edges, self._index.vertices
        stopped = {
            (edges.find_number(trim.edge), vertices.find_number(trim.spine_vertex))
            for end in self.ends
            for trim in end.edge_trims
        }
        gone = {number for end in self.ends for plan in end.face_plans for number in plan.pieces}
        return stopped | {
            (number, vertices.find_number(vertex)) for number in gone for vertex in find_end_vertices(edges[number])
        }

    def _is_cut_seam(self, number: int) -> bool:
        """Whether an edge is a seam of a face that rails run on, where they cut it."""
        faces = list(self._index.faces_at_edge(self._index.edges[number]))
        supports = {one for placement in self.placements for one in placement.face_numbers}
        return len(faces) == 1 and self._index.faces.find_number(faces[0]) in supports

    def _describe(self, edges: Sequence[int], vertices: Sequence[int]) -> LostParts:
        """Return what is lost with some edges, by their numbers, and vertices."""
        pieces: dict[int, tuple[EdgePiece, ...]] = {**self.remainders, **dict.fromkeys(edges, ())}
        trims: list[EdgeTrim] = []
        for number, marks in self._marks.items():
            lost = self._list_lost_ends(number)
            if len(marks) == 1:
                edge = self._index.edges[number]
                faces = tuple(self._index.faces_at_edge(edge))
                vertex = self._index.vertices[lost[0]]
                trims.append(EdgeTrim(self.placements[0], 1, edge, vertex, marks[0].corner, faces))
            else:
                pieces[number] = self._cut_edge(number, marks)
        touched = {one for placement in self.placements for one in placement.face_numbers}
        touched |= {plan.number for end in self.ends for plan in end.face_plans}
        by_face: dict[int, dict[int, tuple[EdgePiece, ...]]] = {}
        for number, parts in pieces.items():
            for face in self._index.faces_at_edge(self._index.edges[number]):
                by_face.setdefault(self._index.faces.find_number(face), {})[number] = parts
        gone = [face for face, own in by_face.items() if face not in touched and self._is_all_lost(face, own)]
        plans = tuple(FacePlan(face, own) for face, own in by_face.items() if face not in gone)
        lost_vertices = tuple(TopoDS.Vertex_s(self._index.vertices[number]) for number in vertices)
        return LostParts(plans, tuple(trims), tuple(gone), lost_vertices)

    def _cut_edge(self, number: int, marks: Sequence[_Mark]) -> tuple[EdgePiece, ...]:
        """Return what remains of an edge that rails cross several times.

        Raises
        ------
        SizeError
            If it is not lost and left by turns.
        """
        marks = sorted(marks, key=lambda mark: mark.parameter)
        edge = TopoDS.Edge_s(orient_forward(self._index.edges[number]))
        placement, (first, last) = self.placements[0], BRep_Tool.Range_s(edge)
        start, stop = map(placement.keep_vertex, find_end_vertices(edge))
        stops = [(mark.parameter, mark.corner, mark.gap) for mark in marks]
        if marks[0].loses_rest:
            stops.insert(0, (first, start, 0.0))
        if not marks[-1].loses_rest:
            stops.append((last, stop, 0.0))
        if len(stops) % 2 or any(one.loses_rest == two.loses_rest for one, two in pairwise(marks)):
            raise SizeError(f"rails cross {placement.joint.name_part(edge)} in ways that exclude each other")
        return tuple(
            EdgePiece(number, (low[0], high[0]), (low[1], high[1]), (low[2], high[2]))
            for low, high in zip(stops[::2], stops[1::2], strict=True)
        )

    def _is_all_lost(self, face: int, lost: Mapping[int, tuple[EdgePiece, ...]]) -> bool:
        """Whether nothing is left of the edges of a face."""
        edges = map(TopoDS.Edge_s, ShapeIndex(self._index.faces[face], TopAbs_EDGE))
        numbers = [self._index.edges.find_number(edge) for edge in edges if not BRep_Tool.Degenerated_s(edge)]
        return all(not lost.get(number, (number,)) for number in numbers)
