"""Turn picked edges into joints: which edges belong together, and which numbers they have in the input shape."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import cast, get_args

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED, TopAbs_VERTEX
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.selection.joint import Joint, find_joint
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.selection.unified_faces import UnifiedSolid
from cqblend.brep.topology import AncestorMap, ShapeIndex, explore_subshapes, find_end_vertices, is_among
from cqblend.certificate import SkippedEdge, SkippedKind
from cqblend.errors import InputError, SelectionError, UnsupportedError
from cqblend.splines.bernstein import Array


class PendingEdges:
    """The picked edges of a shape that are still to be blended; true as long as there are any.

    Joints are taken one by one, each from the shape in which the earlier ones are blended already. Picked edges at
    which there is nothing to blend are skipped, and listed in ``skipped``.

    Raises
    ------
    InputError
        No edge was given.
    SelectionError
        An edge, or the face that is to be side 1, does not belong there, or there is nothing to blend at any of them.
    """

    def __init__(self, shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], side1_face: TopoDS_Face | None) -> None:
        self._edge_index, self._face_index = ShapeIndex(shape, TopAbs_EDGE), ShapeIndex(shape, TopAbs_FACE)
        self._vertex_index = ShapeIndex(shape, TopAbs_VERTEX)
        faces_at = AncestorMap(shape, TopAbs_EDGE, TopAbs_FACE)
        numbers = [self._edge_index.find_number(edge) for edge in edges]
        if not numbers:
            raise InputError("no edge was given")
        if 0 in numbers:
            raise SelectionError("an edge does not belong to the shape: select edges of the very shape that is blended")
        self._waiting = list(dict.fromkeys(numbers))
        self._oriented_picks = dict(zip(reversed(numbers), reversed(edges), strict=True))  # as the user oriented them
        self._faces_of_edge = {
            n: sorted(map(self._face_index.find_number, faces_at(self._edge_index[n]))) for n in self._waiting
        }
        # numbers of the faces that are to be side 1: the given one, and those unified with it
        self._side1_numbers = {0 if side1_face is None else self._face_index.find_number(side1_face)}
        self._unified_faces: list[tuple[TopoDS_Face, list[int]]] = []  # each with the numbers of its parts
        self._reported_count = 0  # of unified faces that describe_unified_faces has reported
        self._rebuilt_edges: dict[int, TopoDS_Edge] = {}  # picked edges that unification has replaced
        if side1_face is not None and not any(self._side1_numbers & set(pair) for pair in self._faces_of_edge.values()):
            raise SelectionError(f"first= is not one of the faces at edge {numbers[0]}")

        skipped = []
        if len(self._waiting) > 1:  # errors about any pick are raised before the first is blended
            for number in tuple(self._waiting):
                try:
                    self._find_oriented_joint(shape, [self._edge_index[number]], number)
                except SelectionError as error:
                    if error.kind not in get_args(SkippedKind):
                        raise
                    skipped.append(SkippedEdge(number, cast(SkippedKind, error.kind), str(error)))
                    self._waiting.remove(number)
            if not self._waiting:
                raise SelectionError("; ".join(one.message for one in skipped))
        self.skipped = tuple(skipped)
        self._picked = tuple(self._waiting)

    def _find_current_edge(self, number: int) -> TopoDS_Edge:
        """Return a picked edge, or what has replaced it."""
        return self._rebuilt_edges.get(number) or self._edge_index[number]

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def find_next_joint(self, shape: TopoDS_Shape) -> Joint:
        """Return the next joint.

        Raises
        ------
        SelectionError
            It is not a joint of two faces; see :func:`cqblend.brep.selection.joint.find_joint`.
        """
        return self._find_oriented_joint(shape, [self._find_current_edge(n) for n in self._waiting], self._waiting[0])

    def find_joints(self, shape: TopoDS_Shape) -> list[Joint]:
        """Return the joint of each of the edges that are left."""
        return [self._find_oriented_joint(shape, [self._find_current_edge(number)], number) for number in self._waiting]

    def take_joint(self, joint: Joint) -> Joint:
        """Drop all picked edges that are part of the next joint, and return it.

        Raises
        ------
        UnsupportedError
            The joint shares a vertex with another picked edge.
        """
        if not joint.spine.closed:
            self._refuse_shared_vertices(joint, self._waiting[0])
        self._waiting = [n for n in self._waiting if not is_among(self._find_current_edge(n), joint.spine.edges)]
        return joint

    def record_unified_faces(self, united: UnifiedSolid) -> None:
        """Record that faces have been unified, so that numbers and side 1 are found again."""
        for new, faces in united.face_replacements:
            numbers = sorted({number for face in faces for number in self._find_input_numbers(face)})
            if len(numbers) > 1:
                self._unified_faces.append((new, numbers))
                if self._side1_numbers & set(numbers):
                    self._side1_numbers |= set(numbers)
        for new, edges in united.edge_replacements:
            for number in self._picked:
                if is_among(self._find_current_edge(number), edges):
                    self._rebuilt_edges[number] = TopoDS.Edge_s(new)

    def describe_unified_faces(self) -> str:
        """Say which faces were unified since the last call; nothing if none were."""
        groups = [numbers for _, numbers in self._unified_faces[self._reported_count :]]
        self._reported_count = len(self._unified_faces)
        whole = [numbers for numbers in groups if not any(set(numbers) < set(other) for other in groups)]
        return "".join(f", faces {', '.join(map(str, numbers))} taken as one" for numbers in whole)

    def _find_input_numbers(self, face: TopoDS_Face) -> list[int]:
        """Return the numbers in the input of a face, or of all those that were unified to it."""
        parts = next((numbers for new, numbers in reversed(self._unified_faces) if new.IsSame(face)), None)
        number = self._face_index.find_number(face)
        return parts or ([number] if number else [])

    def find_number(self, part: TopoDS_Shape) -> int:
        """Return the number of a part in the input, the least one for unified faces; 0 if it is new."""
        if part.ShapeType() != TopAbs_FACE:
            return (self._edge_index if part.ShapeType() == TopAbs_EDGE else self._vertex_index).find_number(part)
        unified = (numbers[0] for new, numbers in self._unified_faces if new.IsSame(part))
        return self._face_index.find_number(part) or next(unified, 0)

    def _refuse_shared_vertices(self, joint: Joint, number: int) -> None:
        """Raise UnsupportedError if another picked edge meets an end of a joint: corners are not supported."""
        for other in self._picked:
            edge = self._find_current_edge(other)
            if is_among(edge, joint.spine.edges):
                continue
            if any(is_among(vertex, find_end_vertices(edge)) for vertex in joint.spine.vertices):
                raise UnsupportedError(
                    f"edge {number} shares a vertex with edge {other}, and corners and chains over several faces are "
                    "not built yet; pick edges without common vertices"
                )

    def _find_oriented_joint(self, shape: TopoDS_Shape, picked: list[TopoDS_Edge], number: int) -> Joint:
        """Return the joint of a picked edge, with the faces as its sides as they are numbered in the input."""
        low, high = min(self._faces_of_edge[number], default=0), max(self._faces_of_edge[number], default=0)
        swap = low != high and high in self._side1_numbers and low not in self._side1_numbers
        faces = (high, low) if swap else (low, high)
        joint = find_joint(shape, picked, number, faces, swap=swap, lookup_number=self.find_number)
        side = joint.sides[0]
        side_face = side.face if side.outward > 0 else side.face.Reversed()
        before = _find_boundary_direction(self._edge_index[number], self._face_index[faces[0]])
        if before @ _find_boundary_direction(self._find_current_edge(number), side_face) < 0:
            # unified faces come in another order, so that the sides are the other way round
            joint = find_joint(shape, picked, number, faces, swap=not swap, lookup_number=self.find_number)
        return replace(joint, is_backward=_is_backward(joint, self._oriented_picks[number]))


def _is_backward(joint: Joint, edge: TopoDS_Edge) -> bool:
    """Whether the spine of a joint has the sense opposite to that of an edge of it, as that is oriented."""
    middle, direction = _evaluate_middle(edge)
    points = joint.spine.evaluate_points(np.linspace(0, 1, SELECT_TOLERANCES.spine_samples))
    i = int(np.clip(np.linalg.norm(points - middle, axis=1).argmin(), 1, len(points) - 2))
    return bool((points[i + 1] - points[i - 1]) @ direction < 0)


def _find_boundary_direction(edge: TopoDS_Edge, face: TopoDS_Shape) -> Array:
    """Return the direction (3,) of an edge in the boundary of a face, in the middle of the edge."""
    return _evaluate_middle(next(use for use in explore_subshapes(face, TopAbs_EDGE) if use.IsSame(edge)))[1]


def _evaluate_middle(use: TopoDS_Edge) -> tuple[Array, Array]:
    """Return the point in the middle of an edge's parameters and the direction of its use there, (3,) each."""
    curve, point, tangent = BRepAdaptor_Curve(use), gp_Pnt(), gp_Vec()
    curve.D1((curve.FirstParameter() + curve.LastParameter()) / 2, point, tangent)
    sign = -1.0 if use.Orientation() == TopAbs_REVERSED else 1.0
    return np.array(point.Coord()), sign * np.array(tangent.Coord())
