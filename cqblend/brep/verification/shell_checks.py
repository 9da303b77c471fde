"""Whether shells keep their borders and senses when faces are replaced, and solids are not inside out.

All of it is asked where faces changed, so that it takes no longer on a body of a thousand faces. What cannot be decided
there is asked of the whole solid.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepTools import BRepTools
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.ElSLib import ElSLib
from OCP.Geom import Geom_Plane
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt, gp_Pnt2d, gp_Vec
from OCP.IntCurvesFace import IntCurvesFace_Intersector
from OCP.TopAbs import (
    TopAbs_EDGE,
    TopAbs_FORWARD,
    TopAbs_IN,
    TopAbs_REVERSED,
    TopAbs_SHELL,
    TopAbs_SOLID,
    TopAbs_VERTEX,
)
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Solid

from cqblend.brep.measurement.surface_evaluation import evaluate_face_normals
from cqblend.brep.topology import BUILDER, CONFUSION, ShapeIndex, explore_subshapes, is_among
from cqblend.brep.verification.brep_check import find_shell_problems, get_shared_curve
from cqblend.brep.verification.face_boxes import FaceBoxes
from cqblend.brep.verification.replaced_faces import Check, ReplacedFaces, ReplacementProblem
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.brep.verification.volumes import find_inverted_solids
from cqblend.splines.bernstein import Array


def find_new_shell_problems(
    replaced: ReplacedFaces, free_edges: Sequence[TopoDS_Edge] = ()
) -> list[ReplacementProblem]:
    """Return a problem for every shell that became open, or inconsistently oriented, or lost its place in the solid.

    A shell that bounds no solid may be open where it was, and at given new ``free_edges``.
    """
    everything = tuple(range(len(replaced.new_faces)))
    if not replaced.bounds_solid:
        found = _find_new_borders(replaced, free_edges)
        return [
            ReplacementProblem(line, Check.SHELLS, replaced.find_new_faces(edges), tuple(edges))
            for line, edges in found
        ]
    lines = []
    shells = ShapeIndex(replaced.after, TopAbs_SHELL)
    has_repeated_faces = sum(shell.NbChildren() for shell in shells) != len(replaced.index_after)
    if replaced.turned or has_repeated_faces or not _keep_shells_closed(replaced):
        known = set(find_shell_problems(replaced.before))
        lines = [line for line in find_shell_problems(replaced.after) if line not in known]
    lines += _find_displaced_shells(replaced)
    return [ReplacementProblem(line, Check.SHELLS, everything) for line in lines]


def _find_new_borders(
    replaced: ReplacedFaces, free_edges: Sequence[TopoDS_Edge]
) -> list[tuple[str, list[TopoDS_Edge]]]:
    """Return a line, and the edges it is about, for what is wrong with the border and the sense of a shell's faces.

    Of the edges that changed faces have, each must be used once in each sense or not at all; or as often as before; or,
    once, if it is one of the given free edges, or a piece of an edge that was free. Points bound one face only.
    """
    edges = ShapeIndex.from_shapes([replaced.old_compound, replaced.new_compound], TopAbs_EDGE)
    (taken, old_groups), (given, new_groups) = (_count_uses(faces, edges) for faces in (replaced.old, replaced.new))
    before = Counter(
        edges.find_number(use) * (1 if use.Orientation() == TopAbs_FORWARD else -1)
        for use in explore_subshapes(replaced.before, TopAbs_EDGE)
    )
    was_free = [edge for n, edge in enumerate(edges, 1) if before[n] + before[-n] == 1]
    lines: list[tuple[str, list[TopoDS_Edge]]] = []
    if replaced.turned:
        lines.append(("faces that stay are turned over", []))
    if new_groups > old_groups:
        lines.append(("the shell comes apart", []))
    for number, edge in enumerate(edges, 1):
        uses = [before[n] - taken[n] + given[n] for n in (number, -number)]
        if BRep_Tool.Degenerated_s(edge) or uses in ([0, 0], [1, 1], [before[number], before[-number]]):
            continue
        is_border = sum(uses) == 1 and (is_among(edge, free_edges) or any(_is_piece(edge, one) for one in was_free))
        if not is_border:
            lines.append(
                (f"an edge of the shell is used {uses[0]} times in its sense and {uses[1]} against it", [edge])
            )
    return lines


def _is_piece(edge: TopoDS_Edge, whole: TopoDS_Edge) -> bool:
    """Whether an edge runs on the curve of another, within its range."""
    curve = get_shared_curve(edge)
    if curve is None or curve is not get_shared_curve(whole):
        return False
    (first, last), (low, high) = BRep_Tool.Range_s(edge), BRep_Tool.Range_s(whole)
    return bool(low <= first and last <= high)


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

    A changed plane beyond which the solid does not go tells, or a ray that starts just outside of a changed face and
    meets the boundary an even number of times. ``boxes`` are those of the faces of the solid after.
    """
    if len(ShapeIndex(replaced.after, TopAbs_SOLID)) == 1:
        if any(_is_outermost(face, boxes) for face in replaced.new):
            return []
        start = _find_ray_start(replaced)
        crossings = None if start is None else _count_crossings(*start, replaced.index_after, boxes)
        if crossings is not None and crossings % 2 == 0:
            return []
    everything = tuple(range(len(replaced.new_faces)))
    return [ReplacementProblem(line, Check.SIDES, everything) for line in find_inverted_solids(replaced.after)]


def _is_outermost(face: TopoDS_Face, boxes: FaceBoxes) -> bool:
    """Whether a face is a plane and all faces are on its inner side: then it tells outside from inside."""
    if not isinstance(BRep_Tool.Surface_s(face), Geom_Plane):
        return False
    point, normal = _read_plane(face)
    reach = np.maximum(boxes.low * normal, boxes.high * normal).sum(axis=1).max()
    return bool(reach <= float(point @ normal) + VERIFICATION_TOLERANCES.ray_step)


def _read_plane(face: TopoDS_Face) -> tuple[Array, Array]:
    """Return a point (3,) of a planar face and the outward normal (3,)."""
    position = BRep_Tool.Surface_s(face).Pln().Position()
    is_reversed = (face.Orientation() == TopAbs_REVERSED) == position.Direct()
    normal = np.array(position.Direction().Coord())
    return np.array(position.Location().Coord()), -normal if is_reversed else normal


def _find_ray_start(replaced: ReplacedFaces) -> tuple[Array, Array] | None:
    """Return a point (3,) just outside of a face that changed, and the way (3,) from there; None if none is found.

    Outside of a plane, beside the middle of an edge of a new face, if there is one, and away from that: rays meet
    planes in no time, and the new face not at all. Else outside of the middle of a new face.
    """
    for face in replaced.new_faces[:1]:
        (middle,), (normal,) = evaluate_face_normals(face, _find_middle(face)[None])
        for use in explore_subshapes(face, TopAbs_EDGE):
            for other in replaced.faces_of_edge(use):
                has_few_wires = other.NbChildren() < VERIFICATION_TOLERANCES.many_wires
                if has_few_wires and isinstance(BRep_Tool.Surface_s(other), Geom_Plane):
                    start = _step_into_plane(use, middle, other)
                    if start is not None:
                        return start
        if np.isfinite(normal).all() and _is_inside(face, _find_middle(face)):
            oriented = replaced.index_after[replaced.index_after.find_number(face)]
            outwards = normal if oriented.Orientation() == face.Orientation() else -normal
            return middle + VERIFICATION_TOLERANCES.ray_step * outwards, outwards
    return None


def _find_middle(face: TopoDS_Face) -> Array:
    """Return parameters (2,) near the middle of a face."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    return np.array([0.53 * u0 + 0.47 * u1, 0.47 * v0 + 0.53 * v1])


def _is_inside(face: TopoDS_Face, uv: Array) -> bool:
    """Whether parameters (2,) lie inside the boundary of a face."""
    return bool(BRepTopAdaptor_FClass2d(face, CONFUSION).Perform(gp_Pnt2d(*uv.tolist())) == TopAbs_IN)


def _step_into_plane(edge: TopoDS_Edge, away_from: Array, plane: TopoDS_Face) -> tuple[Array, Array] | None:
    """Return a point just outside of a planar face, next to the middle of an edge, and the way on from there.

    Away from a point (3,) beyond the edge. None if that is not inside the boundary of the face.
    """
    curve, (first, last) = BRep_Tool.Curve_s(edge, 0.0, 0.0), BRep_Tool.Range_s(edge)
    point, tangent = gp_Pnt(), gp_Vec()
    curve.D1(0.53 * first + 0.47 * last, point, tangent)
    place, (_, normal) = np.array(point.Coord()), _read_plane(plane)
    across = np.cross(normal, tangent.Coord())
    size = float(np.linalg.norm(across))
    if not size:
        return None
    inwards = across / size * np.sign((place - away_from) @ across)
    place += VERIFICATION_TOLERANCES.ray_step * inwards
    u, v = ElSLib.Parameters_s(BRep_Tool.Surface_s(plane).Pln(), gp_Pnt(*place.tolist()))
    if not _is_inside(plane, np.array([u, v])):
        return None
    return place + VERIFICATION_TOLERANCES.ray_step * normal, normal + inwards


def _count_crossings(start: Array, way: Array, faces: ShapeIndex, boxes: FaceBoxes) -> int | None:
    """Return how often a ray from a point meets faces, the one of several rays that meets fewest boxes.

    None where it grazes one.
    """
    directions = way + _LEANINGS
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    hits = boxes.find_hits(start, directions)
    fewest = int(hits.sum(axis=1).argmin())
    ray = gp_Lin(gp_Pnt(*start.tolist()), gp_Dir(*directions[fewest].tolist()))
    count = 0
    for i in np.flatnonzero(hits[fewest]).tolist():
        search = IntCurvesFace_Intersector(faces[i + 1], CONFUSION)
        search.Perform(ray, 0.0, _FAR)
        if not search.IsDone() or any(search.State(k) != TopAbs_IN for k in range(1, search.NbPnt() + 1)):
            return None
        count += search.NbPnt()
    return count


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
