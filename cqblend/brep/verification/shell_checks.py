"""Whether shells stay closed and consistently oriented when faces are replaced, and solids are not inside out.

All of it is asked where faces changed, so that it takes no longer on a body of a thousand faces. What cannot be decided
there is asked of the whole solid.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepTools import BRepTools
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt
from OCP.IntCurvesFace import IntCurvesFace_Intersector
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FORWARD, TopAbs_IN, TopAbs_SHELL, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape, TopoDS_Solid

from cqblend.brep.measurement.surface_evaluation import evaluate_face_normals
from cqblend.brep.topology import BUILDER, CONFUSION, ShapeIndex, explore_subshapes
from cqblend.brep.verification.brep_check import find_shell_problems
from cqblend.brep.verification.face_boxes import FaceBoxes
from cqblend.brep.verification.replaced_faces import Check, ReplacedFaces, ReplacementProblem
from cqblend.brep.verification.volumes import find_inverted_solids
from cqblend.splines.bernstein import Array


def find_new_shell_problems(replaced: ReplacedFaces) -> list[ReplacementProblem]:
    """Return a problem for every shell that became open, or inconsistently oriented, or lost its place in the solid."""
    lines = []
    shells = ShapeIndex(replaced.after, TopAbs_SHELL)
    has_repeated_faces = sum(shell.NbChildren() for shell in shells) != len(replaced.index_after)
    if replaced.turned or has_repeated_faces or not _keep_shells_closed(replaced):
        known = set(find_shell_problems(replaced.before))
        lines = [line for line in find_shell_problems(replaced.after) if line not in known]
    lines += _find_displaced_shells(replaced)
    everything = tuple(range(len(replaced.new_faces)))
    return [ReplacementProblem(line, Check.SHELLS, everything) for line in lines]


def _keep_shells_closed(replaced: ReplacedFaces) -> bool:
    """Whether the new faces use every edge as often, and in the same senses, as a closed shell has room for.

    The faces that stay use an edge of the old ones once in each sense, less what the old ones did; a new edge not at
    all. The new faces must hang together as the old ones did.
    """
    edges = ShapeIndex.from_shapes([replaced.old_compound, replaced.new_compound], TopAbs_EDGE)
    (taken, old_groups), (given, new_groups) = (_count_uses(faces, edges) for faces in (replaced.old, replaced.new))
    if new_groups > old_groups:
        return False
    known, old_count = replaced.edges_before, len(replaced.old_edges)
    for number in {abs(use) for use in (*taken, *given)}:
        kept = 1 if number <= old_count or edges[number] in known else 0
        forward, backward = (kept - taken[use] + given[use] for use in (number, -number))
        if (forward, backward) not in ((0, 0), (1, 1)):
            return False
    return True


def _count_uses(faces: list[TopoDS_Face], edges: ShapeIndex) -> tuple[Counter[int], int]:
    """Count the uses of edges by faces, by number, negative where reversed, and groups of faces that share edges.

    Two uses by one face in both senses, those of a seam, count as well.
    """
    uses: Counter[int] = Counter()
    groups: list[set[int]] = []
    for face in faces:
        own = [
            edges.find_number(use) * (1 if use.Orientation() == TopAbs_FORWARD else -1)
            for use in explore_subshapes(face, TopAbs_EDGE)
        ]
        uses.update(own)
        numbers = {abs(use) for use in own}
        touching = [group for group in groups if not group.isdisjoint(numbers)]
        groups = [group for group in groups if group.isdisjoint(numbers)] + [numbers.union(*touching)]
    return uses, len(groups)


def _find_displaced_shells(replaced: ReplacedFaces) -> list[str]:
    """Return a line for every shell that was not touched, but left inside or outside by one that was.

    Only shells of a solid that has several, and that come near to what changed, are looked at.
    """
    shells = ShapeIndex(replaced.after, TopAbs_SHELL)
    if len(shells) < 2:
        return []
    shells_before = ShapeIndex(replaced.before, TopAbs_SHELL)
    changed = FaceBoxes([*replaced.old, *replaced.new])
    low, high = changed.low.min(axis=0, initial=np.inf), changed.high.max(axis=0, initial=-np.inf)
    touched = [[s for s in one if s not in other] for one, other in ((shells_before, shells), (shells, shells_before))]
    lines = []
    for i, shell in enumerate(shells, 1):
        if shell not in shells_before:
            continue
        point = BRep_Tool.Pnt_s(next(explore_subshapes(shell, TopAbs_VERTEX)))
        place = np.array(point.Coord())
        if (place > low).all() and (place < high).all() and len({_count_around(point, one) for one in touched}) > 1:
            lines.append(f"shell {i} is no longer on the same side of the others")
    return lines


def _count_around(point: gp_Pnt, shells: Iterable[TopoDS_Shape]) -> tuple[bool, ...]:
    """Tell for every shell whether a point is inside."""
    states = []
    for shell in shells:
        solid = TopoDS_Solid()
        BUILDER.MakeSolid(solid)
        BUILDER.Add(solid, shell)
        states.append(BRepClass3d_SolidClassifier(solid, point, CONFUSION).State() == TopAbs_IN)
    return tuple(states)


def find_new_inversions(replaced: ReplacedFaces, boxes: FaceBoxes) -> list[ReplacementProblem]:
    """Return a problem for every solid that is inside out.

    A ray that leaves the solid at a point of a new face, along its normal, meets the boundary an even number of times
    after that. ``boxes`` are those of the faces of the solid after.
    """
    faces = [face for face in replaced.new_faces if face in replaced.index_after]
    if faces and len(ShapeIndex(replaced.after, TopAbs_SOLID)) == 1:
        oriented = replaced.index_after[replaced.index_after.find_number(faces[0])]
        crossings = _count_crossings(oriented, replaced.index_after, boxes)
        if crossings is not None and crossings % 2 == 0:
            return []
    everything = tuple(range(len(replaced.new_faces)))
    return [ReplacementProblem(line, Check.SIDES, everything) for line in find_inverted_solids(replaced.after)]


def _count_crossings(face: TopoDS_Face, faces: ShapeIndex, boxes: FaceBoxes) -> int | None:
    """Return how often a ray from the middle of a face meets faces on its way out; None where it grazes one."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    (point,), (normal,) = evaluate_face_normals(face, np.array([[0.53 * u0 + 0.47 * u1, 0.47 * v0 + 0.53 * v1]]))
    if not np.isfinite(normal).all():
        return None
    directions = normal + _LEANINGS
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    hits = boxes.find_hits(point, directions)
    fewest = int(hits.sum(axis=1).argmin())
    ray = gp_Lin(gp_Pnt(*point.tolist()), gp_Dir(*directions[fewest].tolist()))
    count, found_start = 0, False
    for i in np.flatnonzero(hits[fewest]).tolist():
        search = IntCurvesFace_Intersector(faces[i + 1], CONFUSION)
        search.Perform(ray, -1e-3, _FAR)
        if not search.IsDone():
            return None
        for k in range(1, search.NbPnt() + 1):
            if search.State(k) != TopAbs_IN:
                return None
            if search.WParameter(k) > 1e-6:
                count += 1
            elif abs(search.WParameter(k)) <= 1e-6:
                found_start = True
    return count if found_start else None


_FAR = 1e10
"""mm: further than any body reaches."""

_LEANINGS: Array = 0.45 * np.array(
    [
        [0.1, 0.2, -0.1],
        [1.0, 0.1, 0.2],
        [-1.0, 0.2, 0.1],
        [0.2, 1.0, -0.1],
        [-0.1, -1.0, 0.2],
        [0.1, 0.2, 1.0],
        [0.2, 0.1, -1.0],
    ]
)
"""By how much rays lean from a unit normal: odd, so that none runs along an axis of the body."""
