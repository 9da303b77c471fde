"""Conversion of shapes of CadQuery and build123d to TopoDS shapes and back.

A result belongs to the library of the shape that was given. The library is read off the classes of the objects, so that
none is imported here, and so that objects of modules that CQ-editor has reloaded are still understood.
"""

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from cqblend.argument_checks import call_user_function
from cqblend.brep.selection.bridge_sides import GivenSide
from cqblend.brep.shape_kinds import ShapeKind, downcast_shape, find_shape_kind, is_topods, list_children
from cqblend.brep.topology import drop_duplicate_shapes, make_compound
from cqblend.errors import InputError, reason, shown, with_article
from cqblend.splines import Curve

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape


_MAX_NESTING = 9
"""Largest number of iterables within each other in which edges are looked for."""


@dataclass(frozen=True, slots=True)
class UnrollShapes:
    """The shapes that are to be unrolled.

    Attributes
    ----------
    model
        The first of them as it was given, in whose library results are returned.
    shapes
        All of them.
    solid
        The solid that they may be faces of, where they were given by a Workplane that has one.
    """

    model: Any
    shapes: "list[TopoDS_Shape]"
    solid: "TopoDS_Shape | None"


def resolve_shape(thing: Any) -> Any:
    """Return a shape as it is given, or the solid of a Workplane, or, if there is none, the shell.

    Raises
    ------
    InputError
        It is no shape, is null, or a Workplane without a solid and without a shell.
    """
    if _is_workplane(thing):
        thing = _find_body(thing)
    if _find_topods(thing) is None:
        raise InputError(f"shape must be a CadQuery, build123d or TopoDS shape, not {_describe_shape(thing)}")
    return thing


def to_topods(shape: Any) -> "TopoDS_Shape":
    """Return the TopoDS shape of a shape that `resolve_shape` returned."""
    topods = _find_topods(shape)
    if topods is None:
        raise InputError(f"a CadQuery, build123d or TopoDS shape is needed, not {_describe_shape(shape)}")
    return topods


def collect_edges(things: Any) -> "list[TopoDS_Edge]":
    """Return the edges in an edge, a Workplane, a ShapeList, a compound, or nested iterables of those, once each.

    Raises
    ------
    InputError
        There is none, or something else among them.
    """
    edges: list[TopoDS_Edge] = drop_duplicate_shapes(_iterate_edges(things))
    if not edges:
        raise InputError("edges is empty: select at least one edge")
    return edges


def collect_held_edges(things: Any) -> "list[TopoDS_Edge]":
    """Return the edges in an edge, a wire, a Workplane, a compound, or nested iterables of those, once each.

    Raises
    ------
    InputError
        There is none, or something else among them.
    """
    edges: list[TopoDS_Edge] = drop_duplicate_shapes(_iterate_edges(things, name="hold"))
    if not edges:
        raise InputError("hold is empty: give the edges to hold a rail on, or leave it out")
    return edges


def to_topods_face(thing: Any, name: str) -> "TopoDS_Face":
    """Return the TopoDS face of a face; `name` is the caller's parameter, for the message."""
    topods = _find_topods(thing)
    if topods is None or find_shape_kind(topods) != "face":
        raise InputError(f"{name} must be a face, not {_describe_shape(thing)}")
    return topods


def to_topods_edge(thing: Any) -> "TopoDS_Edge":
    """Return the TopoDS edge of one edge, or of a Workplane or an iterable with one edge."""
    edges = collect_edges(thing)
    if len(edges) > 1:
        raise InputError(f"edge must be one edge, not {len(edges)}")
    return edges[0]


def convert_size_keys(name: str, sizes: Mapping[Any, Any]) -> "dict[TopoDS_Edge, Any]":
    """Return a mapping from edges of any library as one from TopoDS edges; `name` is the caller's parameter."""
    rule, found = f"{name} for each edge is a mapping from edges to sizes", {}
    for edge, size in call_user_function(rule, list, call_user_function(rule, sizes.items)):
        topods = _find_topods(edge)
        if topods is None or find_shape_kind(topods) != "edge":
            raise InputError(f"{rule}, not from {_describe_shape(edge)}")
        found[topods] = size
    return found


def collect_faces(things: Any) -> "list[TopoDS_Face]":
    """Return the TopoDS faces of a face, a Workplane with faces on its stack, or an iterable of faces."""
    if _find_topods(things) is not None:
        return [to_topods_face(things, "faces")]
    if _is_workplane(things):
        things = things.vals()
    return [to_topods_face(thing, "faces") for thing in _list_items(things, "faces must be faces")]


def collect_unroll_shapes(things: Any) -> UnrollShapes:
    """Return the faces, shells, solids and compounds in one of those, an iterable of them, or a Workplane's stack.

    Raises
    ------
    InputError
        There is none, or something else among them.
    """
    solid = None
    if _is_workplane(things):
        with suppress(ValueError):
            solid = _find_topods(things.findSolid())
        things = things.vals()
    elif _find_topods(_resolve_builder(things)) is not None:
        things = [things]
    found = [_resolve_builder(thing) for thing in _list_items(things, "faces, shells or solids are unrolled")]
    for thing in found:
        topods = _find_topods(thing)
        if topods is None or find_shape_kind(topods) in ("wire", "edge", "vertex"):
            raise InputError(f"faces, shells or solids are unrolled, not {_describe_shape(thing)}")
    if not found:
        raise InputError("nothing is selected: select at least one face")
    return UnrollShapes(found[0], [to_topods(thing) for thing in found], solid)


def _resolve_builder(thing: Any) -> Any:
    """Return the part or sketch of a build123d builder, the compound of a CadQuery assembly, or the thing itself."""
    if _find_topods(thing) is None and _find_library(thing) == "build123d":
        return next((made for name in ("part", "sketch") if (made := getattr(thing, name, None)) is not None), thing)
    if _find_library(thing) == "cadquery" and hasattr(thing, "toCompound"):
        return thing.toCompound()
    return thing


def wrap_like(model: Any, result: "TopoDS_Shape") -> Any:
    """Return a result as a shape of the library of `model`, a shape that `resolve_shape` returned.

    The class follows from the kind of the result, but a solid or compound made from a build123d ``Part`` is a ``Part``
    as well; it keeps the label and the color of the model.
    """
    if is_topods(model):
        return downcast_shape(result)
    shape = type(model).cast(result)
    if find_shape_kind(result) in ("solid", "compsolid", "compound") and _find_library(model) == "build123d":
        part = next((base for base in type(model).__mro__ if base.__name__ == "Part"), None)
        if part is not None:
            shape = part([shape]) if find_shape_kind(result) == "solid" else part(downcast_shape(result))
        shape.label, shape.color = model.label, model.color
    return shape


@dataclass(frozen=True, slots=True)
class GivenBodies:
    """The bodies that a bridge is to join: the first of them as it was given, and all of them as one shape."""

    model: Any
    shape: "TopoDS_Shape"


def collect_bodies(things: Any) -> GivenBodies:
    """Return the bodies in a solid, a compound, a Workplane, or a sequence of solids.

    Raises
    ------
    InputError
        There is none, or something else among them.
    """
    if _is_workplane(things):
        solids = [one for one in things.vals() if _has_kind(one, "solid")]
        things = solids if len(solids) > 1 else _find_body(things)
    if _find_topods(things) is not None:
        return GivenBodies(things, to_topods(things))
    rule = "shape must be a solid, a compound, or a sequence of solids"
    found = [resolve_shape(one) for one in _list_items(things, rule)]
    if not found or not all(_has_kind(one, "solid") or _has_kind(one, "compound") for one in found):
        raise InputError(f"{rule}, not {_describe_shape(things)}")
    return GivenBodies(found[0], make_compound(to_topods(one) for one in found))


def to_given_side(name: str, value: Any) -> GivenSide:
    """Return a side of a bridge: a face, a closed edge or wire, or a pair of a face and a wire or a `Curve` on it.

    Raises
    ------
    InputError
        It is something else.
    """
    rule = f"{name} must be a face, a closed edge or wire, or a pair of a face and a closed wire or Curve on it"
    if _is_workplane(value):
        value = value.vals()
        value = value[0] if len(value) == 1 else value
    if isinstance(value, tuple | list) and len(value) == 2 and _has_kind(value[0], "face"):
        face, curve = to_topods_face(value[0], name), value[1]
        if isinstance(curve, Curve):
            if curve.dim not in (2, 3):
                raise InputError(f"{rule}: a Curve has dim 2, in the parameters of the face, or 3, not {curve.dim}")
            return GivenSide(face, curve=curve)
        return GivenSide(face, _collect_wire(name, rule, curve))
    if _has_kind(value, "face"):
        return GivenSide(to_topods_face(value, name))
    if isinstance(value, Curve):
        raise InputError(f"{rule}: a Curve needs its face, as a pair")
    return GivenSide(None, _collect_wire(name, rule, value))


def _collect_wire(name: str, rule: str, things: Any) -> "tuple[TopoDS_Edge, ...]":
    """Return the edges of a wire, an edge, or an iterable of these."""
    if _find_topods(things) is None and not isinstance(things, Iterable) and not _is_workplane(things):
        raise InputError(f"{rule}, not {_describe_shape(things)}")
    edges: list[TopoDS_Edge] = drop_duplicate_shapes(_iterate_edges(things, name=name))
    if not edges:
        raise InputError(f"{rule}: this one is empty")
    return tuple(edges)


def _has_kind(thing: Any, kind: ShapeKind) -> bool:
    """Whether a thing is a shape of a kind."""
    topods = _find_topods(thing)
    return topods is not None and find_shape_kind(topods) == kind


def _list_items(things: Any, wanted: str) -> list[Any]:
    """Return the items of an iterable; `wanted` says in the message what they should be."""
    if isinstance(things, str | bytes | dict) or not isinstance(things, Iterable):
        raise InputError(f"{wanted}, not {_describe_shape(things)}")
    try:
        return list(things)
    except Exception as error:
        raise InputError(f"{wanted}, and going through what is given raises {reason(error)}") from error


def _iterate_edges(things: Any, depth: int = 0, name: str = "edges") -> "Iterable[TopoDS_Edge]":
    """Yield the edges in nested things; those of wires, too, unless edges to blend are looked for."""
    if depth > _MAX_NESTING:
        raise InputError(f"{name} is nested more than {_MAX_NESTING} deep")
    topods = _find_topods(things)
    if topods is not None and find_shape_kind(topods) == "edge":
        yield topods
        return
    if topods is not None and find_shape_kind(topods) in ("compound", *(["wire"] if name != "edges" else [])):
        things = list_children(topods)
    elif _is_workplane(things):
        things = things.vals()
    elif topods is not None:
        raise InputError(f"{name} must be edges, not {_describe_shape(things)}")
    for thing in _list_items(things, f"{name} must be edges"):
        yield from _iterate_edges(thing, depth + 1, name)


def _find_topods(thing: Any) -> "TopoDS_Shape | None":
    """Return the TopoDS shape in a CadQuery, build123d or TopoDS shape, None if there is none."""
    inner = _get_wrapped(thing) if _find_library(thing) else thing
    return downcast_shape(inner) if is_topods(inner) else None


def _get_wrapped(thing: Any) -> Any:
    """Return the TopoDS shape that a shape of a library wraps, None if there is none."""
    try:
        return thing.wrapped
    except (AttributeError, AssertionError):  # build123d asserts that there is one
        return None


def _find_library(thing: Any) -> str | None:
    """Return the library that defines the class of an object or one of its base classes, None if it is another one."""
    roots = {base.__module__.partition(".")[0] for base in type(thing).__mro__}
    return next((name for name in ("cadquery", "build123d") if name in roots), None)


def _find_body(workplane: Any) -> Any:
    """Return the solid or compound that CadQuery finds for a Workplane, else the nearest shell."""
    try:
        return workplane.findSolid()
    except ValueError:
        pass
    place = workplane
    while place is not None:
        for thing in place.objects:
            topods = _find_topods(thing)
            if topods is not None and find_shape_kind(topods) == "shell":
                return thing
        place = place.parent
    raise InputError("shape is a Workplane with no solid and no shell on its stack or in its parents")


def _is_workplane(thing: Any) -> bool:
    return _find_library(thing) == "cadquery" and hasattr(thing, "findSolid")


def _describe_shape(thing: Any) -> str:
    """Return the kind of a shape, or any other object, as an error message names it."""
    topods = _find_topods(thing)
    if topods is not None:
        return with_article(find_shape_kind(topods))
    return shown(thing)
