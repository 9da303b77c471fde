"""The bodies of a shape, which are blended one by one: solids, shells that bound no solid, and loose faces.

A body comes out as what it was: a solid as a solid, a shell as a shell, and loose faces as faces of the compound that
they were in.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

from OCP.BRep import BRep_Tool
from OCP.BRepTools import BRepTools_ReShape
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape, TopoDS_Shell, TopoDS_Solid

from cqblend.brep.shape_kinds import find_shape_kind, list_children
from cqblend.brep.topology import BUILDER, ShapeIndex, explore_subshapes, make_compound, orient_forward


def list_bodies(shape: TopoDS_Shape) -> list[TopoDS_Shape]:
    """Return the solids of a shape, its shells outside of solids, and for each compound a shell of its own loose faces.

    Solids and shells are those of the shape; a shell of loose faces is made for the purpose, in their order.
    """
    shells = []
    explorer = TopExp_Explorer(shape, TopAbs_SHELL, TopAbs_SOLID)
    while explorer.More():
        shells.append(TopoDS.Shell_s(explorer.Current()))
        explorer.Next()
    return [*explore_subshapes(shape, TopAbs_SOLID), *shells, *map(make_shell, _list_loose_faces(shape))]


def is_solid(body: TopoDS_Shape) -> bool:
    """Whether a body bounds a volume, so that inside and outside are defined away from its faces, too."""
    return bool(body.ShapeType() == TopAbs_SOLID)


def make_shell(faces: Iterable[TopoDS_Face]) -> TopoDS_Shell:
    """Make a shell of faces, flagged as closed if it is."""
    shell = TopoDS_Shell()
    BUILDER.MakeShell(shell)
    for face in faces:
        BUILDER.Add(shell, face)
    shell.Closed(BRep_Tool.IsClosed_s(shell))
    return shell


def _list_loose_faces(shape: TopoDS_Shape) -> list[list[TopoDS_Face]]:
    """Return the faces that lie in a compound directly, for every compound that has some; a face lies in itself."""
    kind = find_shape_kind(shape)
    if kind == "face":
        return [[TopoDS.Face_s(shape)]]
    if kind != "compound":
        return []
    parts = list_children(shape)
    own = [TopoDS.Face_s(part) for part in parts if find_shape_kind(part) == "face"]
    inner = [faces for part in parts if find_shape_kind(part) == "compound" for faces in _list_loose_faces(part)]
    return [own, *inner] if own else inner


def replace_body_faces(
    body: TopoDS_Shape,
    replacements: dict[int, TopoDS_Face],
    removed: Collection[int],
    face_index: ShapeIndex,
    new_faces: Sequence[TopoDS_Face],
) -> TopoDS_Shape:
    """Return a body with faces replaced, and others removed, by their number in its face index.

    New faces go into the first shell of which a face is replaced.
    """
    if not is_solid(body):
        return _replace_shell_faces(body, replacements, removed, face_index, new_faces)
    out = TopoDS_Solid()
    BUILDER.MakeSolid(out)
    pending = new_faces
    for shell in explore_subshapes(orient_forward(body), TopAbs_SHELL):
        if any(face_index.find_number(face) in replacements for face in explore_subshapes(shell, TopAbs_FACE)):
            shell, pending = _replace_shell_faces(shell, replacements, removed, face_index, pending), ()
        BUILDER.Add(out, shell)
    return out


def _replace_shell_faces(
    shell: TopoDS_Shape,
    replacements: dict[int, TopoDS_Face],
    removed: Collection[int],
    face_index: ShapeIndex,
    new_faces: Sequence[TopoDS_Face],
) -> TopoDS_Shell:
    numbered = ((face_index.find_number(face), face) for face in explore_subshapes(shell, TopAbs_FACE))
    kept = (replacements.get(number, face) for number, face in numbered if number not in removed)
    return make_shell([*kept, *new_faces])


def join_shells(solids: Sequence[TopoDS_Shape], parts: Sequence[TopoDS_Shape]) -> TopoDS_Solid:
    """Return one solid with all shells of some, of which those that have one of some parts are made one shell.

    It is no sound solid yet, but what a bridge between these parts turns into one.
    """
    shells = [shell for solid in solids for shell in explore_subshapes(orient_forward(solid), TopAbs_SHELL)]
    bridged = [any(part in ShapeIndex(shell, part.ShapeType()) for part in parts) for shell in shells]
    pairs = list(zip(shells, bridged, strict=True))
    together = [face for shell, flag in pairs if flag for face in explore_subshapes(shell, TopAbs_FACE)]
    out = TopoDS_Solid()
    BUILDER.MakeSolid(out)
    for shell in [make_shell(together), *(shell for shell, flag in pairs if not flag)]:
        BUILDER.Add(out, shell)
    return out


def replace_bodies(shape: TopoDS_Shape, old: Sequence[TopoDS_Shape], new: TopoDS_Shape) -> TopoDS_Shape:
    """Return a shape with one body in the place of the first of some solids of it, and without the others.

    If nothing else is left, that is the body itself.
    """
    reshape = BRepTools_ReShape()
    reshape.Replace(old[0], new)
    for other in old[1:]:
        reshape.Remove(other)
    result = new if shape.IsSame(old[0]) else reshape.Apply(shape)
    while find_shape_kind(result) == "compound" and len(list_children(result)) == 1:
        (result,) = list_children(result)
    return result


def replace_body(shape: TopoDS_Shape, old: TopoDS_Shape, new: TopoDS_Shape) -> TopoDS_Shape:
    """Return a shape with one of its bodies, as :func:`list_bodies` returns them, replaced.

    Faces that take the place of loose ones stand where the first of these did.
    """
    if shape.IsSame(old):
        return new
    if old not in ShapeIndex(shape, old.ShapeType()):
        return _replace_loose_faces(shape, ShapeIndex(old, TopAbs_FACE), list(explore_subshapes(new, TopAbs_FACE)))
    reshape = BRepTools_ReShape()
    reshape.Replace(old, new)
    return reshape.Apply(shape)


def _replace_loose_faces(shape: TopoDS_Shape, old: ShapeIndex, new: Sequence[TopoDS_Face]) -> TopoDS_Shape:
    """Return a compound in which faces that lie directly in it, or in a compound in it, are replaced."""
    parts, pending = list[TopoDS_Shape](), new
    for part in list_children(shape):
        if find_shape_kind(part) == "compound":
            parts.append(_replace_loose_faces(part, old, new))
        elif find_shape_kind(part) == "face" and part in old:
            parts.extend(pending)
            pending = ()
        else:
            parts.append(part)
    return make_compound(parts) if _differ(parts, list_children(shape)) else shape


def _differ(parts: Sequence[TopoDS_Shape], others: Sequence[TopoDS_Shape]) -> bool:
    return len(parts) != len(others) or not all(one.IsSame(other) for one, other in zip(parts, others, strict=True))
