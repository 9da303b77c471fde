"""Tell the kind of a TopoDS shape, and list its direct parts.

These are the checks that every public function makes of a shape before anything is computed. OCP returns shapes as
plain ``TopoDS_Shape``; :func:`downcast_shape` gives them their own class.
"""

from typing import Literal, TypeGuard, cast

from OCP.TopoDS import TopoDS, TopoDS_Iterator, TopoDS_Shape

ShapeKind = Literal["compound", "compsolid", "solid", "shell", "face", "wire", "edge", "vertex"]

_DOWNCAST = {
    "compound": TopoDS.Compound_s,
    "compsolid": TopoDS.CompSolid_s,
    "solid": TopoDS.Solid_s,
    "shell": TopoDS.Shell_s,
    "face": TopoDS.Face_s,
    "wire": TopoDS.Wire_s,
    "edge": TopoDS.Edge_s,
    "vertex": TopoDS.Vertex_s,
}


def is_topods(thing: object) -> TypeGuard[TopoDS_Shape]:
    """Whether a thing is a TopoDS shape that is not null."""
    return isinstance(thing, TopoDS_Shape) and not thing.IsNull()


def find_shape_kind(shape: TopoDS_Shape) -> ShapeKind:
    """Return the kind of a shape that is not null, as a word."""
    return cast(ShapeKind, shape.ShapeType().name.removeprefix("TopAbs_").lower())


def downcast_shape(shape: TopoDS_Shape) -> TopoDS_Shape:
    """Return the same shape as an object of its own class."""
    return _DOWNCAST[find_shape_kind(shape)](shape)


def list_children(shape: TopoDS_Shape) -> list[TopoDS_Shape]:
    """Return the direct parts of a shape, each with the location and the orientation it has in there."""
    parts = []
    iterator = TopoDS_Iterator(shape)
    while iterator.More():
        parts.append(downcast_shape(iterator.Value()))
        iterator.Next()
    return parts
