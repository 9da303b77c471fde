"""Edges on which a rail is to be held: the far border of the face between them and the blended edge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_BSplineCurve, Geom_Circle
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.measurement.edge_sides import find_sides_on_face
from cqblend.brep.measurement.surface_evaluation import evaluate_face_normals
from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.topology import ShapeIndex, find_end_vertices, is_among, orient_forward, reverse_edge
from cqblend.errors import SelectionError, TopologyError, UnsupportedError
from cqblend.splines.approximation import Kinks
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import normalise_vectors


@dataclass(frozen=True)
class HeldCircle:
    """The circle of a held edge; the edge turns by ``turn`` (rad) about the axis, in the sense of the spine."""

    centre: Array
    axis: Array
    radius: float
    turn: float


@dataclass(frozen=True, eq=False)
class HeldEdge:
    """An edge that takes the place of one rail of a joint, all along, with the face between, which the blend consumes.

    ``side`` (0 or 1) is that of the rail, ``use`` the edge in the sense of the spine, ``face_beyond`` the face that the
    blend meets there. ``end_edges`` are those of the consumed face at the start and at the stop of an open spine.
    """

    joint: Joint
    side: int
    use: TopoDS_Edge
    face_beyond: TopoDS_Face
    end_edges: tuple[TopoDS_Edge, ...]

    @property
    def face(self) -> TopoDS_Face:
        """The face between the edge and the spine."""
        return self.joint.sides[self.side].face

    @property
    def oriented_face(self) -> TopoDS_Face:
        """The same, oriented as in the solid."""
        faces = self.joint.index.faces
        return faces[faces.find_number(self.face)]

    @property
    def circle(self) -> HeldCircle | None:
        """The circle that the edge is an arc of; None if its curve is none."""
        curve = BRep_Tool.Curve_s(self.edge, 0.0, 0.0)
        if not isinstance(curve, Geom_Circle):
            return None
        first, last = BRep_Tool.Range_s(self.edge)
        circle = curve.Circ()
        centre, axis = (np.array(one.Coord()) for one in (circle.Location(), circle.Axis().Direction()))
        return HeldCircle(centre, axis if self.is_forward else -axis, circle.Radius(), last - first)

    @property
    def kinks(self) -> Kinks | None:
        """The shares at which the curve of the edge is less smooth than C5; None if it is not made of pieces."""
        curve = BRep_Tool.Curve_s(self.edge, 0.0, 0.0)
        if not isinstance(curve, Geom_BSplineCurve):
            return None
        first, last = BRep_Tool.Range_s(self.edge)
        numbers = range(curve.FirstUKnotIndex() + 1, curve.LastUKnotIndex())
        shares = (np.array([curve.Knot(n) for n in numbers]) - first) / (last - first)
        orders = np.array([curve.Degree() - curve.Multiplicity(n) for n in numbers])
        least = orders < 5
        return Kinks((shares if self.is_forward else 1 - shares)[least], np.maximum(orders[least], 0))

    @property
    def edge(self) -> TopoDS_Edge:
        """The edge, FORWARD."""
        return TopoDS.Edge_s(orient_forward(self.use))

    @property
    def is_forward(self) -> bool:
        """Whether the edge's own curve runs in the sense of the spine."""
        return self.use.IsEqual(self.edge)

    @property
    def vertices(self) -> tuple[TopoDS_Vertex, TopoDS_Vertex]:
        """The vertices at its start and its stop, in the sense of the spine."""
        return find_end_vertices(self.use)

    def map_to_edge(self, t: Array) -> Array:
        """Return the parameters (n,) of the edge's curve at shares t of it, in the sense of the spine."""
        first, last = BRep_Tool.Range_s(self.edge)
        return first + t * (last - first) if self.is_forward else last - t * (last - first)

    def evaluate(self, t: Array) -> tuple[Array, Array]:
        """Return points and unit tangents (n, 3), in the sense of the spine, at shares t, also past both ends."""
        point, rate = CurveEvaluator(BRep_Tool.Curve_s(self.edge, 0.0, 0.0))(self.map_to_edge(t), 1)
        return point.T, normalise_vectors(rate.T) * (1.0 if self.is_forward else -1.0)

    def evaluate_face_directions(self, t: Array, face: TopoDS_Face) -> tuple[Array, Array]:
        """Return the outward normals of one of its two faces at shares t, and the unit directions into it, (n, 3)."""
        ((_, use),) = find_sides_on_face(face, self.use)
        pcurve = CurveEvaluator(BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0))
        _, normals = evaluate_face_normals(face, pcurve(self.map_to_edge(t))[0].T)
        sense = 1.0 if use.IsEqual(self.use) else -1.0  # a face is to the left of its boundary, seen from outside
        return normals, sense * np.cross(normals, self.evaluate(t)[1])


def is_beside(edge: TopoDS_Edge, joint: Joint) -> bool:
    """Whether an edge bounds a face beside a joint."""
    return any(edge in ShapeIndex(side.face, TopAbs_EDGE) for side in joint.sides)


def find_held_edge(joint: Joint, edges: Sequence[TopoDS_Edge]) -> HeldEdge:
    """Return the edge that one rail of a joint is to be held on, of those that were given.

    Raises
    ------
    SelectionError
        If they do not bound one of the two faces beside the spine.
    TopologyError
        If that face has other edges than the spine, the held edge, and one at each end between them.
    UnsupportedError
        If there are several.
    """
    index, spine = joint.index, joint.spine
    beside = [
        i for i, side in enumerate(joint.sides) if all(edge in ShapeIndex(side.face, TopAbs_EDGE) for edge in edges)
    ]
    if len(beside) != 1 or any(is_among(edge, spine.edges) for edge in edges):
        raise SelectionError(f"the held edges are not those of one face beside {joint.name}")
    if len(edges) > 1:
        raise UnsupportedError(f"a rail is held on one edge, not on {len(edges)} in a row; unite them first")
    (side,) = beside
    held, name = edges[0], joint.name_part(edges[0])
    face = index.faces[index.faces.find_number(joint.sides[side].face)]
    others = [one for one in index.faces_at_edge(held) if not one.IsSame(face)]
    if len(others) != 1 or others[0].IsSame(joint.sides[1 - side].face):
        raise SelectionError(f"{name} cannot hold a rail: no further face lies beyond it")
    rest = [
        edge
        for edge in ShapeIndex(face, TopAbs_EDGE)
        if not is_among(edge, [*spine.edges, held]) and not BRep_Tool.IsClosed_s(edge, face)
    ]
    use = _orient_along(joint, held)
    ends = []
    for vertex, far in () if spine.closed else zip(spine.vertices, find_end_vertices(use), strict=True):
        ends += [edge for edge in rest if all(is_among(one, find_end_vertices(edge)) for one in (vertex, far))]
    if len(ends) != len(rest) or len(ends) != (0 if spine.closed else 2):
        raise TopologyError(
            f"{name} cannot hold the rail: {joint.name_part(face)} between it and {joint.name} has other edges than "
            "these two and one at each end, so that the blend would not take all of it"
        )
    return HeldEdge(joint, side, use, others[0], tuple(ends))


def _orient_along(joint: Joint, edge: TopoDS_Edge) -> TopoDS_Edge:
    """Return an edge in the sense in which the spine of a joint runs beside it."""
    forward = TopoDS.Edge_s(orient_forward(edge))
    first, last = BRep_Tool.Range_s(forward)
    point, rate = CurveEvaluator(BRep_Tool.Curve_s(forward, 0.0, 0.0))(np.array([(first + last) / 2]), 1)[:, :, 0]
    spine = joint.spine.evaluate_points(np.linspace(0, 1, SELECT_TOLERANCES.spine_samples))
    k = int(np.clip(np.linalg.norm(spine - point, axis=1).argmin(), 1, len(spine) - 2))
    return forward if rate @ (spine[k + 1] - spine[k - 1]) > 0 else reverse_edge(forward)
