"""Query the topology of shapes, and make vertices, edges, wires, faces and shells one by one.

Thin functions over OCP: no geometry is computed here, and nothing is searched by distance.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import Geom_Curve, Geom_Surface
from OCP.Geom2d import Geom2d_Curve
from OCP.gp import gp_Pnt
from OCP.TopAbs import (
    TopAbs_EDGE,
    TopAbs_FACE,
    TopAbs_FORWARD,
    TopAbs_REVERSED,
    TopAbs_ShapeEnum,
    TopAbs_SHELL,
    TopAbs_SOLID,
    TopAbs_VERTEX,
    TopAbs_WIRE,
)
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopoDS import (
    TopoDS,
    TopoDS_Compound,
    TopoDS_Edge,
    TopoDS_Face,
    TopoDS_Shape,
    TopoDS_Vertex,
    TopoDS_Wire,
)
from OCP.TopTools import (
    TopTools_IndexedDataMapOfShapeListOfShape,
    TopTools_IndexedMapOfShape,
    TopTools_ListOfShape,
    TopTools_MapOfShape,
)

from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import normalise_vectors

CONFUSION = 1e-7
"""mm, OCCT's ``Precision::Confusion``: points nearer than this are one, and edges and vertices have no less."""

BUILDER = BRep_Builder()
_CAST = {
    TopAbs_EDGE: TopoDS.Edge_s,
    TopAbs_FACE: TopoDS.Face_s,
    TopAbs_VERTEX: TopoDS.Vertex_s,
    TopAbs_WIRE: TopoDS.Wire_s,
    TopAbs_SHELL: TopoDS.Shell_s,
    TopAbs_SOLID: TopoDS.Solid_s,
}


class ShapeIndex:
    """The distinct sub-shapes of one kind, numbered from 1 as ``TopExp.MapShapes`` numbers them.

    Shapes that differ in nothing but orientation are the same; each is kept as it was first met.
    """

    def __init__(self, shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> None:
        self._map = TopTools_IndexedMapOfShape()
        self._kind = kind
        TopExp.MapShapes_s(shape, kind, self._map)

    @classmethod
    def from_shapes(cls, shapes: Iterable[TopoDS_Shape], kind: TopAbs_ShapeEnum) -> ShapeIndex:
        """Return the index of the sub-shapes of several shapes; a shape of the kind is its own sub-shape."""
        index = cls(TopoDS_Shape(), kind)
        for shape in shapes:
            TopExp.MapShapes_s(shape, kind, index._map)
        return index

    def __len__(self) -> int:
        return int(self._map.Extent())

    def __iter__(self) -> Iterator[TopoDS_Shape]:
        return (self[number] for number in range(1, len(self) + 1))

    def __getitem__(self, number: int) -> TopoDS_Shape:
        return _CAST[self._kind](self._map.FindKey(number))

    def __contains__(self, shape: TopoDS_Shape) -> bool:
        return bool(self._map.Contains(shape))

    def find_number(self, shape: TopoDS_Shape) -> int:
        """Return the number of a sub-shape, whatever its orientation; 0 if it is foreign."""
        return int(self._map.FindIndex(shape))


class AncestorMap:
    """Which sub-shapes of one kind (the ancestors) use which of another (the parts), such as faces their edges."""

    def __init__(self, shape: TopoDS_Shape, part_kind: TopAbs_ShapeEnum, ancestor_kind: TopAbs_ShapeEnum) -> None:
        self._map = TopTools_IndexedDataMapOfShapeListOfShape()
        self._kind = ancestor_kind
        TopExp.MapShapesAndUniqueAncestors_s(shape, part_kind, ancestor_kind, self._map)

    def __contains__(self, part: TopoDS_Shape) -> bool:
        return bool(self._map.Contains(part))

    def __call__(self, part: TopoDS_Shape) -> list[TopoDS_Shape]:
        """Return the distinct ancestors of a part, in the order of the shape; none for a foreign part."""
        if part not in self:
            return []
        return [_CAST[self._kind](ancestor) for ancestor in _list_shapes(self._map.FindFromKey(part))]


def _list_shapes(shapes: TopTools_ListOfShape) -> list[TopoDS_Shape]:
    """Return what is in one of OCCT's lists: iterating over it takes OCP half a millisecond, whatever its length."""
    if shapes.Size() <= 2:
        return [] if shapes.IsEmpty() else [shapes.First(), shapes.Last()][: shapes.Size()]
    rest, found = TopTools_ListOfShape(shapes), []
    while not rest.IsEmpty():
        found.append(rest.First())
        rest.RemoveFirst()
    return found


def chain_segments(
    starts: Sequence[int],
    stops: Sequence[int],
    measure_gap: Callable[[int, int], float] | None = None,
    *,
    both_ways: bool = False,
    until_closed: bool = False,
) -> list[list[int]]:
    """Order directed segments head to tail into chains, each as the list of its segments' indices.

    A chain begins with the first segment that is left over, and grows at its tail for as long as one fits there.

    Parameters
    ----------
    starts, stops
        Numbers of the points at which the segments start and stop: a segment fits where another stops.
    measure_gap
        ``measure_gap(i, k)`` is a distance between the stop of segment i and the start of k: of several that fit, the
        nearest follows. Without it, the first one does.
    both_ways
        Whether a chain also grows at its head: the first segment left over that fits at either end is taken.
    until_closed
        Whether a chain is complete as soon as its own first segment is the one that follows, even if others fit.

    Examples
    --------
    >>> chain_segments([1, 3, 5, 2], [2, 1, 6, 3])
    [[0, 3, 1], [2]]
    >>> chain_segments([2, 1, 3], [3, 2, 4], both_ways=True)
    [[1, 0, 2]]
    """
    waiting = list(range(len(starts)))
    chains: list[list[int]] = []
    while waiting:
        chain = [waiting.pop(0)]
        while True:
            head, tail = chain[0], chain[-1]
            fitting = [k for k in ([head] if until_closed else []) + waiting if starts[k] == stops[tail]]
            leading = [k for k in waiting if stops[k] == starts[head]] if both_ways else []
            if leading and (not fitting or leading[0] < fitting[0]):
                chain.insert(0, leading[0])
                waiting.remove(leading[0])
                continue
            if not fitting:
                break
            nearest = fitting[0]
            if measure_gap is not None and len(fitting) > 1:
                nearest = min(fitting, key=lambda k: measure_gap(tail, k))
            if nearest == head:
                break
            chain.append(nearest)
            waiting.remove(nearest)
        chains.append(chain)
    return chains


def is_among(shape: TopoDS_Shape, shapes: Iterable[TopoDS_Shape]) -> bool:
    """Whether a shape is one of some shapes, orientation ignored."""
    return any(shape.IsSame(other) for other in shapes)


def drop_duplicate_shapes(shapes: Iterable[TopoDS_Shape]) -> list[TopoDS_Shape]:
    """Drop repeated shapes, orientation ignored; order is kept."""
    known = TopTools_MapOfShape()
    return [shape for shape in shapes if known.Add(shape)]


def explore_subshapes(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> Iterator[TopoDS_Shape]:
    """Yield every use of sub-shapes of a kind, with its orientation in the shape; a seam comes twice."""
    explorer = TopExp_Explorer(shape, kind)
    while explorer.More():
        yield _CAST[kind](explorer.Current())
        explorer.Next()


def orient_forward(shape: TopoDS_Shape) -> TopoDS_Shape:
    """Return the shape with orientation FORWARD."""
    return _CAST[shape.ShapeType()](shape.Oriented(TopAbs_FORWARD))


def reverse_edge(edge: TopoDS_Edge) -> TopoDS_Edge:
    """Return the edge with the opposite orientation."""
    return TopoDS.Edge_s(edge.Reversed())


def find_end_vertices(edge: TopoDS_Edge) -> tuple[TopoDS_Vertex, TopoDS_Vertex]:
    """Return the start and stop vertex of an edge use, by its orientation."""
    return TopExp.FirstVertex_s(edge, True), TopExp.LastVertex_s(edge, True)


def find_end_uv(use: TopoDS_Edge, face: TopoDS_Face) -> tuple[Array, Array]:
    """Return the (u, v) at which an edge use starts and stops."""
    curve = BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0)
    first, last = BRep_Tool.Range_s(use)
    a, b = (np.array([p.X(), p.Y()]) for p in (curve.Value(first), curve.Value(last)))
    return (b, a) if use.Orientation() == TopAbs_REVERSED else (a, b)


def find_outgoing_tangent(vertex: TopoDS_Vertex, edge: TopoDS_Edge) -> Array:
    """Return the unit tangent of an edge at one of its vertices, pointing away from it."""
    curve, sign = BRepAdaptor_Curve(edge), 1.0
    parameter = curve.FirstParameter()
    if not find_end_vertices(orient_forward(edge))[0].IsSame(vertex):
        parameter, sign = curve.LastParameter(), -1.0
    tangent = curve.DN(parameter, 1)
    return sign * normalise_vectors(np.array([tangent.X(), tangent.Y(), tangent.Z()]))


def find_vertex_uv(vertex: TopoDS_Vertex, face: TopoDS_Face) -> Array:
    """Return a vertex's (u, v) on a face, from the end of an edge of that face."""
    for use in explore_subshapes(face, TopAbs_EDGE):
        for i, end in enumerate(find_end_vertices(use)):
            if end.IsSame(vertex) and not BRep_Tool.Degenerated_s(use):
                return find_end_uv(use, face)[i]
    raise GeometryError("a vertex is not on the boundary of its face")


def find_seam_edges(face: TopoDS_Face) -> list[TopoDS_Edge]:
    """Return the seams of a face, FORWARD: the edges that its boundary uses twice.

    An edge with two pcurves on a face need not be a seam: booleans leave such edges where a seam has become a border.
    """
    uses = [use for use in explore_subshapes(face, TopAbs_EDGE) if BRep_Tool.IsClosed_s(use, face)]
    return [orient_forward(use) for use in drop_duplicate_shapes(uses) if sum(use.IsSame(other) for other in uses) == 2]


def locate_vertex(vertex: TopoDS_Vertex) -> Array:
    """Return a vertex's point (3,)."""
    p = BRep_Tool.Pnt_s(vertex)
    return np.array([p.X(), p.Y(), p.Z()])


def make_vertex(point: Array, tolerance: float = CONFUSION) -> TopoDS_Vertex:
    """Make a vertex."""
    vertex = TopoDS_Vertex()
    BUILDER.MakeVertex(vertex, gp_Pnt(*(float(x) for x in point)), max(tolerance, CONFUSION))
    return vertex


def make_edge(
    curve: Geom_Curve,
    vertices: tuple[TopoDS_Vertex, TopoDS_Vertex],
    span: tuple[float, float],
    tolerance: float = CONFUSION,
) -> TopoDS_Edge:
    """Make a FORWARD edge on a 3D curve; pcurves are added with :func:`attach_pcurves`."""
    edge = TopoDS_Edge()
    BUILDER.MakeEdge(edge, curve, max(tolerance, CONFUSION))
    BUILDER.Add(edge, vertices[0].Oriented(TopAbs_FORWARD))
    BUILDER.Add(edge, vertices[1].Oriented(TopAbs_REVERSED))
    BUILDER.Range(edge, *span)
    BUILDER.SameParameter(edge, True)
    BUILDER.SameRange(edge, True)
    return edge


def make_degenerate_edge(
    face: TopoDS_Face, vertex: TopoDS_Vertex, pcurve: Geom2d_Curve, span: tuple[float, float]
) -> TopoDS_Edge:
    """Make a FORWARD degenerate edge: a vertex in space, a line on the face."""
    edge = TopoDS_Edge()
    BUILDER.MakeEdge(edge)
    BUILDER.UpdateEdge(edge, pcurve, face, CONFUSION)
    BUILDER.Add(edge, vertex.Oriented(TopAbs_FORWARD))
    BUILDER.Add(edge, vertex.Oriented(TopAbs_REVERSED))
    BUILDER.Range(edge, *span)
    BUILDER.Degenerated(edge, True)
    return edge


def attach_pcurves(edge: TopoDS_Edge, face: TopoDS_Face, *pcurves: Geom2d_Curve) -> None:
    """Give an edge its pcurve on a face, whatever its location; two, for FORWARD and REVERSED use, make it a seam."""
    BUILDER.UpdateEdge(edge, *pcurves, face, BRep_Tool.Tolerance_s(edge))


def make_trimmed_copy(
    edge: TopoDS_Edge, vertices: tuple[TopoDS_Vertex, TopoDS_Vertex], span: tuple[float, float]
) -> TopoDS_Edge:
    """Return a FORWARD copy of an edge over another parameter range, with its curve and all its pcurves."""
    copy = TopoDS.Edge_s(orient_forward(edge).EmptyCopied())
    BUILDER.Add(copy, vertices[0].Oriented(TopAbs_FORWARD))
    BUILDER.Add(copy, vertices[1].Oriented(TopAbs_REVERSED))
    BUILDER.Range(copy, *span)
    return copy


def raise_vertex_tolerance(vertex: TopoDS_Vertex, tolerance: float) -> None:
    """Raise a vertex's tolerance to at least the given one."""
    if tolerance > BRep_Tool.Tolerance_s(vertex):
        BUILDER.UpdateVertex(vertex, tolerance)


def make_closed_wire(edges: Iterable[TopoDS_Edge]) -> TopoDS_Wire:
    """Make a closed wire of edge uses in order."""
    wire = TopoDS_Wire()
    BUILDER.MakeWire(wire)
    for edge in edges:
        BUILDER.Add(wire, edge)
    wire.Closed(True)
    return wire


def make_bare_face(surface: Geom_Surface) -> TopoDS_Face:
    """Make a face without a boundary."""
    face = TopoDS_Face()
    BUILDER.MakeFace(face, surface, CONFUSION)
    return face


def make_compound(shapes: Iterable[TopoDS_Shape]) -> TopoDS_Compound:
    """Return shapes as one compound."""
    compound = TopoDS_Compound()
    BUILDER.MakeCompound(compound)
    for shape in shapes:
        BUILDER.Add(compound, shape)
    return compound
