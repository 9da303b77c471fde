"""What ordinary BRepCheck finds wrong with the faces of a solid that changed."""

from __future__ import annotations

from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.TopAbs import TopAbs_EDGE, TopAbs_VERTEX
from OCP.TopoDS import TopoDS_Shape

from cqblend.brep.topology import ShapeIndex, make_compound
from cqblend.brep.verification.brep_check import (
    CROSSING_STATUSES,
    Flaw,
    describe_flaws,
    drop_inherited_flaws,
    find_flaws,
)
from cqblend.brep.verification.replaced_faces import Check, ReplacedFaces, ReplacementProblem
from cqblend.brep.verification.slim_faces import ChangedPart, list_changed_parts


def find_invalid_parts(replaced: ReplacedFaces) -> list[ReplacementProblem]:
    """Return a problem for everything that BRepCheck finds in the changed parts of faces and that was not there before.

    A face in place of one that failed may fail for the same reason.
    """
    parts = list_changed_parts(replaced)
    if BRepCheck_Analyzer(make_compound(part.slim_face for part in parts)).IsValid():
        return []
    before = find_flaws(replaced.old_compound, exact=False)
    problems: list[ReplacementProblem] = []
    for part in parts:
        for flaw in drop_inherited_flaws(find_flaws(part.slim_face, exact=False), before):
            (line,) = describe_flaws(replaced.after, [_name_face(flaw, part)], exact=False)
            if line not in {problem.line for problem in problems}:
                concerned = replaced.find_new_faces(_list_concerned(flaw, part))
                crosses = flaw.status in CROSSING_STATUSES
                problems.append(ReplacementProblem(line, Check.VALIDITY, concerned, (part.face,), crosses))
    return problems


def _name_face(flaw: Flaw, part: ChangedPart) -> Flaw:
    """Return a flaw of the face itself where it is one of its slim copy."""
    return Flaw(part.face, flaw.context, flaw.status) if flaw.shape.IsSame(part.slim_face) else flaw


def _list_concerned(flaw: Flaw, part: ChangedPart) -> list[TopoDS_Shape]:
    """Return what a flaw is about: its edge or vertex if that is new, else all that changed there."""
    if flaw.shape.ShapeType() in (TopAbs_EDGE, TopAbs_VERTEX):
        changed = ShapeIndex(make_compound(part.uses), flaw.shape.ShapeType())
        if flaw.shape in changed:
            return [flaw.shape]
    return list(part.uses)
