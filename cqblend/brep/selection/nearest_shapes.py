"""Find the edge or face of a shape that is nearest to a point.

Exists for the command line, where edges are picked by coordinates.
"""

from dataclasses import dataclass

from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.measurement.edge_continuity import measure_continuity_between
from cqblend.brep.measurement.edge_sides import find_edge_sides
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.topology import ShapeIndex
from cqblend.errors import CqblendError, SelectionError

Point = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class PickedEdge:
    """An edge, its 1-based index in the shape's edge map, and its distance from the point it was picked by, mm."""

    edge: TopoDS_Edge
    index: int
    distance: float


@dataclass(frozen=True, slots=True)
class PickedFace:
    """A face, its 1-based index in the shape's face map, and its distance from the point it was picked by, mm."""

    face: TopoDS_Face
    index: int
    distance: float


def find_nearest_face(shape: TopoDS_Shape, point: Point) -> PickedFace:
    """Return the face nearest to a point.

    Raises
    ------
    SelectionError
        The shape has no face.
    """
    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex()
    faces = ShapeIndex(shape, TopAbs_FACE)
    if not len(faces):
        raise SelectionError("the shape has no faces")
    picked = [
        PickedFace(face, number, BRepExtrema_DistShapeShape(vertex, face).Value())
        for number, face in enumerate(faces, 1)
    ]
    return min(picked, key=lambda one: one.distance)


def find_nearest_edge(shape: TopoDS_Shape, point: Point, *, sharp: bool) -> PickedEdge:
    """Return the edge nearest to a point that has two different faces on its two sides.

    Seams, degenerate and free edges are skipped; with ``sharp``, also those at which the faces meet smoothly all along.

    Raises
    ------
    SelectionError
        The shape has no such edge.
    """
    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex()
    edges = ShapeIndex(shape, TopAbs_EDGE)
    picked = [
        PickedEdge(edge, number, BRepExtrema_DistShapeShape(vertex, edge).Value())
        for number, edge in enumerate(edges, 1)
        if not BRep_Tool.Degenerated_s(edge)
    ]
    for candidate in sorted(picked, key=lambda one: one.distance):
        if _is_joint(shape, candidate.edge, sharp=sharp):
            return candidate
    raise SelectionError(f"the shape has {len(edges)} edges, but none is {'sharp ' * sharp}between two faces")


def _is_joint(shape: TopoDS_Shape, edge: TopoDS_Edge, *, sharp: bool) -> bool:
    try:
        sides = find_edge_sides(shape, edge)
        if sides[0][0].IsSame(sides[1][0]):
            return False
        return not sharp or measure_continuity_between(sides, SELECT_TOLERANCES.sharpness_samples).kind != "smooth"
    except CqblendError:
        return False
