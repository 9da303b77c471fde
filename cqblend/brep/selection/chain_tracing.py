"""Trace which edges follow one another in a chain: tangential ones between faces that go on smoothly on both sides.

At the end of an edge the faces around the vertex are followed on either side, past smooth edges, up to the first sharp
one. If that is the same edge on both sides, and it leaves in the direction in which the first one arrives, then the
chain goes on along it. Only topology and angles are asked for here; cells are made of the trace elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.brep.measurement.edge_sides import EdgeSide
from cqblend.brep.selection.chains import ChainEnd, Junction
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.topology import find_end_uv, find_end_vertices, reverse_edge
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import normalise_vectors


@dataclass(frozen=True, eq=False)
class TracedEdge:
    """One edge of a chain, as the boundary of the face to its left uses it, and the faces to its left and right."""

    use: TopoDS_Edge
    faces: tuple[TopoDS_Face, TopoDS_Face]

    def reverse(self) -> TracedEdge:
        """Return the same edge in the other sense, with the faces the other way round."""
        return TracedEdge(reverse_edge(self.use), self.faces[::-1])


@dataclass(frozen=True, eq=False)
class ChainTrace:
    """The edges of a chain in their order, the junctions between them, and why it ends at either end, if it is open.

    Junctions are as those of a :class:`~cqblend.brep.selection.chains.Chain`, but there is one at every vertex: where
    both faces go on, it crosses no smooth edges.
    """

    edges: tuple[TracedEdge, ...]
    junctions: tuple[Junction, ...]
    ends: tuple[ChainEnd, ...]

    @property
    def closed(self) -> bool:
        """Whether the last edge is followed by the first one."""
        return not self.ends

    def find_position(self, edge: TopoDS_Edge) -> int:
        """Return the position of an edge that is part of the chain."""
        return next(i for i, one in enumerate(self.edges) if one.use.IsSame(edge))

    def reverse(self) -> ChainTrace:
        """Return the same chain in the other sense, with its sides the other way round."""
        junctions = [
            Junction(one.vertex, (one.crossed[1][::-1], one.crossed[0][::-1])) for one in reversed(self.junctions)
        ]
        if self.closed:
            junctions = junctions[1:] + junctions[:1]
        return ChainTrace(tuple(one.reverse() for one in reversed(self.edges)), tuple(junctions), self.ends[::-1])

    def rotate(self, start: int) -> ChainTrace:
        """Return the same closed chain with another of its edges as the first one, given by its position."""
        edges, junctions = self.edges, self.junctions
        return ChainTrace(edges[start:] + edges[:start], junctions[start:] + junctions[:start], self.ends)


def trace_chain(
    index: SolidIndex, sides: tuple[EdgeSide, EdgeSide], may_follow: Callable[[TopoDS_Edge], bool] | None = None
) -> ChainTrace:
    """Trace the chain through an edge, which is given by its two sides; the first of them is to the left of the chain.

    The chain goes on along edges for which ``may_follow`` holds; without it, along all.
    """
    first = TracedEdge(sides[0][1], (sides[0][0], sides[1][0]))
    edges, junctions = [first], list[Junction]()
    ends = list[ChainEnd]()
    for end in (1, 0):
        while True:
            found = _find_next_edge(index, edges[-end], end, may_follow)
            if not isinstance(found, tuple):
                ends.insert(0, found)
                break
            following, junction = found
            if following.use.IsEqual(edges[end - 1].use):
                return ChainTrace(tuple(edges), (*junctions, junction), ())
            position = len(edges) if end else 0
            edges.insert(position, following)
            junctions.insert(position, junction)
    return ChainTrace(tuple(edges), tuple(junctions), tuple(ends))


def _find_next_edge(
    index: SolidIndex, traced: TracedEdge, end: int, may_follow: Callable[[TopoDS_Edge], bool] | None
) -> tuple[TracedEdge, Junction] | ChainEnd:
    """Return the edge that continues another one past its start (``end`` 0) or stop (1), or why there is none."""
    vertex = find_end_vertices(traced.use)[end]
    angles = index.measure_dihedral_angles(traced.use)
    if angles is None or abs(angles.find_end_angle(traced.use, end)) < SELECT_TOLERANCES.smooth_angle:
        return "fading"
    if not _has_tangential_edge(index, traced.use, vertex, end):
        return "corner"
    left = _find_sharp_edge(index, (traced.faces[0], traced.use), end)
    right = _find_sharp_edge(index, (traced.faces[1], reverse_edge(traced.use)), 1 - end)
    if left is None or right is None:
        return "sharp edge"
    (face1, use), (face2, _) = left.side, right.side
    if not use.IsEqual(reverse_edge(right.side[1])):
        return "sharp edge"
    turn = _find_tangent(use, 1 - end) - _find_tangent(traced.use, end)
    if np.linalg.norm(turn) > SELECT_TOLERANCES.continuation_angle:
        return "corner"
    after = index.measure_dihedral_angles(use)
    if after is None or face1.IsSame(face2) or not after.is_sharp or after.is_convex != angles.is_convex:
        return "unlike edge"
    if may_follow is not None and not may_follow(use):
        return "not picked"
    crossed = (left.crossed, right.crossed) if end else (left.crossed[::-1], right.crossed[::-1])
    return TracedEdge(use, (face1, face2)), Junction(vertex, crossed)


def _has_tangential_edge(index: SolidIndex, use: TopoDS_Edge, vertex: TopoDS_Vertex, end: int) -> bool:
    """Whether any edge continues another one past its start (``end`` 0) or stop (1) in the same direction."""
    wanted = _find_tangent(use, end)
    for edge in index.edges_at_vertex(vertex):
        for one in (edge, reverse_edge(edge)):
            if find_end_vertices(one)[1 - end].IsSame(vertex) and not BRep_Tool.Degenerated_s(one):
                turn = np.linalg.norm(_find_tangent(one, 1 - end) - wanted)
                if turn < SELECT_TOLERANCES.continuation_angle:
                    return True
    return False


def _find_tangent(use: TopoDS_Edge, end: int) -> Array:
    """Return the unit tangent (3,) of an edge at its start (``end`` 0) or stop (1), in the sense of its use."""
    curve, is_reversed = BRepAdaptor_Curve(use), use.Orientation() == TopAbs_REVERSED
    tangent = curve.DN(curve.LastParameter() if bool(end) != is_reversed else curve.FirstParameter(), 1)
    unit: Array = normalise_vectors(np.array([tangent.X(), tangent.Y(), tangent.Z()]))
    return -unit if is_reversed else unit


@dataclass(frozen=True)
class _SharpEdge:
    """The first sharp edge around a vertex, on the face from which it is met, and the smooth edges crossed before."""

    side: EdgeSide
    crossed: tuple[TopoDS_Edge, ...]


def _find_sharp_edge(index: SolidIndex, side: EdgeSide, end: int) -> _SharpEdge | None:
    """Return the first sharp edge around the start (``end`` 0) or stop (1) of an edge, beyond a face at it.

    Seams and poles of a face are passed, too, but not recorded as crossed. None if the faces have a border there, or if
    the boundary of one passes the vertex more than once.
    """
    crossed: list[TopoDS_Edge] = []
    face, use = side
    for _ in range(2 * len(index.edges_at_vertex(find_end_vertices(use)[end]))):
        adjacent = _find_adjacent_use(index, face, use, end)
        if adjacent is None:
            return None
        if BRep_Tool.Degenerated_s(adjacent):
            use = adjacent
            continue
        sides, angles = index.find_sides(adjacent), index.measure_dihedral_angles(adjacent)
        if sides is None or angles is None:
            return None
        if not angles.is_smooth:
            return _SharpEdge((face, adjacent), tuple(crossed))
        beyond, use = sides[1] if sides[0][0].IsSame(face) and sides[0][1].IsEqual(adjacent) else sides[0]
        if not beyond.IsSame(face):
            crossed.append(adjacent)
        face = beyond
    return None


def _find_adjacent_use(index: SolidIndex, face: TopoDS_Face, use: TopoDS_Edge, end: int) -> TopoDS_Edge | None:
    """Return the edge before (``end`` 0) or after (1) another one in the boundary of a face, as it is used there.

    None if the boundary passes the vertex there more than once, so that it is not clear which one that is.
    """
    vertex = index.vertices.find_number(find_end_vertices(use)[end])
    fitting = [other.edge for other in index.list_edge_uses(face) if other.vertices[1 - end] == vertex]
    if len(fitting) == 1:
        return fitting[0]
    corner = find_end_uv(use, face)[end]
    gaps = [float(np.linalg.norm(find_end_uv(other, face)[1 - end] - corner)) for other in fitting]
    nearest, second = np.argsort(gaps)[:2].tolist()
    return None if gaps[second] - gaps[nearest] < SELECT_TOLERANCES.same_corner else fitting[nearest]
