"""The faces on both sides of an edge, and the edge's pcurves on them."""

from OCP.BRep import BRep_Tool
from OCP.Geom2d import Geom2d_Curve
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_ShapeEnum
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.topology import AncestorMap, explore_subshapes
from cqblend.errors import GeometryError, InputError, SelectionError

EdgeSide = tuple[TopoDS_Face, TopoDS_Edge]
"""A face, and the edge with the orientation it has in that face (which picks the pcurve of a seam)."""


def require_shape(shape: object, name: str, kind: TopAbs_ShapeEnum | None = None) -> TopoDS_Shape:
    """Return a shape if it is one, of the given kind.

    Raises
    ------
    InputError
        It is no shape, a null shape, or one of another kind.
    """
    if not isinstance(shape, TopoDS_Shape):
        raise InputError(f"{name} is of type {type(shape).__name__}: a TopoDS shape is needed")
    if shape.IsNull():
        raise InputError(f"{name} is a null shape")
    if kind is not None and shape.ShapeType() != kind:
        given, wanted = (one.name.removeprefix("TopAbs_").lower() for one in (shape.ShapeType(), kind))
        raise InputError(f"{name} is of type {given}: {wanted} is needed")
    return shape


def find_edge_sides(shape: TopoDS_Shape, edge: TopoDS_Edge) -> tuple[EdgeSide, EdgeSide]:
    """Return the two sides of an edge in a shape, in the order of the shape's faces.

    Raises
    ------
    InputError
        An argument is of the wrong type.
    SelectionError
        The edge is not in the shape, is degenerate, or does not have exactly two sides.
    """
    require_shape(shape, "shape")
    edge = TopoDS.Edge_s(require_shape(edge, "edge", TopAbs_EDGE))
    faces_of = AncestorMap(shape, TopAbs_EDGE, TopAbs_FACE)
    if edge not in faces_of:
        raise SelectionError("the edge is not an edge of the shape: pick it from the shape itself, not from a copy")
    if BRep_Tool.Degenerated_s(edge):
        raise SelectionError("the edge is degenerate (the pole of a surface): it has no length and no continuity")
    sides = _list_sides(edge, faces_of)
    if len(sides) != 2:
        what = "a free boundary" if len(sides) == 1 else f"used {len(sides)} times"
        raise SelectionError(f"the edge is {what}: continuity is measured between exactly two sides")
    return sides[0], sides[1]


def find_sides_on_face(face: TopoDS_Face, edge: TopoDS_Edge) -> list[EdgeSide]:
    """Return the sides of an edge on which a face lies: two on a seam, none if the edge does not bound the face."""
    return [
        (face, use)
        for use in explore_subshapes(face, TopAbs_EDGE)
        if use.IsSame(edge) and use.Orientation() in (TopAbs_FORWARD, TopAbs_REVERSED)
    ]


def get_two_sides(edge: TopoDS_Edge, faces_of: AncestorMap) -> tuple[EdgeSide, EdgeSide] | None:
    """Return the two sides of an edge of a shape; None if it is degenerate, or has not exactly two."""
    if BRep_Tool.Degenerated_s(edge):
        return None
    sides = _list_sides(edge, faces_of)
    return (sides[0], sides[1]) if len(sides) == 2 else None


def _list_sides(edge: TopoDS_Edge, faces_of: AncestorMap) -> list[EdgeSide]:
    """Return all sides of an edge, in the order of its faces."""
    return [side for face in faces_of(edge) for side in find_sides_on_face(face, edge)]


def read_pcurve(edge: TopoDS_Edge, face: TopoDS_Face) -> tuple[Geom2d_Curve, float, float]:
    """Return the pcurve of an edge on a face, and its range.

    Raises
    ------
    GeometryError
        There is none.
    """
    pcurve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
    if pcurve is None:
        raise GeometryError("the edge has no curve in the parameter plane of its face: repair it first (ShapeFix)")
    low, high = BRep_Tool.Range_s(edge, face)
    return pcurve, low, high
