"""What OCCT's ``BRepCheck`` finds wrong with a shape, in its ordinary and in its exact mode."""

from collections.abc import Iterable
from dataclasses import dataclass

from OCP.BRep import BRep_Tool
from OCP.BRepCheck import (
    BRepCheck_Analyzer,
    BRepCheck_ListOfStatus,
    BRepCheck_NoError,
    BRepCheck_Result,
    BRepCheck_Shell,
    BRepCheck_Status,
)
from OCP.Standard import Standard_NoSuchObject
from OCP.TopAbs import (
    TopAbs_EDGE,
    TopAbs_FACE,
    TopAbs_FORWARD,
    TopAbs_REVERSED,
    TopAbs_SHELL,
    TopAbs_SOLID,
    TopAbs_VERTEX,
    TopAbs_WIRE,
)
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Shape

from cqblend.brep.topology import ShapeIndex

CHECKED_KINDS = (TopAbs_VERTEX, TopAbs_EDGE, TopAbs_WIRE, TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID)
"""Kinds of sub-shapes, parts before wholes."""


CROSSING_STATUSES = frozenset(
    (
        BRepCheck_Status.BRepCheck_IntersectingWires,
        BRepCheck_Status.BRepCheck_SelfIntersectingWire,
        BRepCheck_Status.BRepCheck_InvalidImbricationOfWires,
    )
)
"""Errors that mean that the boundary of a face crosses itself."""


@dataclass(frozen=True)
class Flaw:
    """An error of ``BRepCheck``: of a sub-shape, in the context of a shape that it is part of (itself if none)."""

    shape: TopoDS_Shape
    context: TopoDS_Shape
    status: BRepCheck_Status


def is_valid(shape: TopoDS_Shape) -> bool:
    """Whether ordinary BRepCheck accepts a shape: what ``isValid()`` of CadQuery and ``is_valid`` of build123d ask."""
    return bool(BRepCheck_Analyzer(shape).IsValid())


def find_flaws(shape: TopoDS_Shape, *, exact: bool = True) -> list[Flaw]:
    """Return the errors that BRepCheck finds, in exact mode or in the ordinary one."""
    analyzer = BRepCheck_Analyzer(shape, True, False, exact)
    if analyzer.IsValid():
        return []
    found: dict[tuple[TopoDS_Shape, TopoDS_Shape, BRepCheck_Status], Flaw] = {}
    for kind in CHECKED_KINDS:
        for part in ShapeIndex(shape, kind):
            for use in (part.Oriented(TopAbs_FORWARD), part.Oriented(TopAbs_REVERSED)):
                try:
                    result = analyzer.Result(use)  # there is one for each orientation that the shape uses
                except Standard_NoSuchObject:
                    continue
                for flaw in _list_subshape_flaws(result, part):
                    found.setdefault((flaw.shape, flaw.context.Oriented(TopAbs_FORWARD), flaw.status), flaw)
    return list(found.values())


def _list_subshape_flaws(result: BRepCheck_Result, part: TopoDS_Shape) -> list[Flaw]:
    """Return the errors of one sub-shape: those in the shapes that it is part of, and others of its own."""
    found = []
    result.InitContextIterator()
    while result.MoreShapeInContext():
        found += [Flaw(part, result.ContextualShape(), status) for status in _list_errors(result.StatusOnShape())]
        result.NextShapeInContext()
    in_context = {flaw.status for flaw in found}
    return found + [Flaw(part, part, status) for status in _list_errors(result.Status()) if status not in in_context]


def _list_errors(statuses: BRepCheck_ListOfStatus) -> list[BRepCheck_Status]:
    """Return the errors in a list of statuses; "no error" stands alone, and OCP takes long to iterate."""
    return [] if statuses.IsEmpty() or statuses.First() == BRepCheck_NoError else list(statuses)


def drop_inherited_flaws(found: list[Flaw], before: list[Flaw]) -> list[Flaw]:
    """Drop flaws that were there before, of the same sub-shape or of one on the same curve or surface."""
    known = [(flaw, _get_shared_geometry(flaw)) for flaw in before]
    return [
        flaw for flaw in found if not any(_is_same_flaw(flaw, _get_shared_geometry(flaw), *other) for other in known)
    ]


def _is_same_flaw(flaw: Flaw, geometry: object, other: Flaw, other_geometry: object) -> bool:
    """Whether a flaw is another one again: of the same status, and of the same sub-shape or geometry."""
    if flaw.status != other.status or flaw.shape.ShapeType() != other.shape.ShapeType():
        return False
    return bool(flaw.shape.IsSame(other.shape)) or (geometry is not None and geometry is other_geometry)


def _get_shared_geometry(flaw: Flaw) -> object:
    """Return what a sub-shape shares with its trimmed copies: the curve of an edge, the surface of a face or wire."""
    owner = flaw.context if flaw.shape.ShapeType() == TopAbs_WIRE else flaw.shape
    if owner.ShapeType() == TopAbs_FACE:
        return BRep_Tool.Surface_s(TopoDS.Face_s(owner), TopLoc_Location())
    return get_shared_curve(TopoDS.Edge_s(owner)) if owner.ShapeType() == TopAbs_EDGE else None


def get_shared_curve(edge: TopoDS_Edge) -> object:
    """Return the 3D curve of an edge, which its trimmed copies share; None if it has none."""
    return BRep_Tool.Curve_s(edge, TopLoc_Location(), 0.0, 0.0)


def describe_flaws(shape: TopoDS_Shape, found: list[Flaw], *, exact: bool = True) -> list[str]:
    """Return one line for every flaw, with the number of the sub-shape in the shape."""
    lines, state = [], "exactly valid" if exact else "valid"
    for flaw in found:
        kind = flaw.shape.ShapeType()
        name = f"{kind.name.removeprefix('TopAbs_').lower()} {ShapeIndex(shape, kind).find_number(flaw.shape)}"
        lines.append(f"{name} is not {state}: {flaw.status.name.removeprefix('BRepCheck_')}")
    return list(dict.fromkeys(lines))


def find_shell_problems(shape: TopoDS_Shape) -> list[str]:
    """Return one line for every shell that is open, or whose faces are not oriented consistently."""
    lines = []
    for i, shell in enumerate(ShapeIndex(shape, TopAbs_SHELL), 1):
        check = BRepCheck_Shell(shell)
        if check.Closed(False) != BRepCheck_NoError:
            lines.append(f"shell {i} is not closed")
        elif check.Orientation(False) != BRepCheck_NoError:
            lines.append(f"shell {i} is not consistently oriented")
    return lines


def find_turned_faces(shells: Iterable[TopoDS_Shape]) -> list[str]:
    """Return one line for every shell, which may be open, whose faces are not oriented consistently."""
    return [
        f"open shell {i} is not consistently oriented"
        for i, shell in enumerate(shells, 1)
        if BRepCheck_Shell(shell).Orientation(False) != BRepCheck_NoError
    ]
