"""From picked edges to joints: which edges belong together, and what each joint is called in the input."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_REVERSED, TopAbs_VERTEX
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.select.edge_joint import Joint, NothingToBlendError, find_joint
from cqblend.brep.select.united_faces import UnifiedSolid
from cqblend.brep.topology import AncestorMap, ShapeIndex, explore_subshapes, find_end_vertices
from cqblend.certificate import SkippedEdge
from cqblend.errors import InputError, SelectionError, UnsupportedError
from cqblend.splines.bernstein import Array


class PendingEdges:
    """The edges of a shape that are still to be blended; true as long as there are any.

    Joints are taken one by one, each from the shape in which the earlier ones are blended already. Picked edges at
    which there is nothing to blend are passed over, and listed in ``skipped``.

    Raises
    ------
    InputError
        No edge was given.
    SelectionError
        An edge, or the face that is to be side 1, does not belong there, or there is nothing to blend at any of them.
    """

    def __init__(self, shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], first: TopoDS_Face | None) -> None:
        self._edges, self._numbers = ShapeIndex(shape, TopAbs_EDGE), ShapeIndex(shape, TopAbs_FACE)
        self._vertices = ShapeIndex(shape, TopAbs_VERTEX)
        self._faces_at = AncestorMap(shape, TopAbs_EDGE, TopAbs_FACE)
        numbers = [self._edges.find_number(edge) for edge in edges]
        if not numbers:
            raise InputError("no edge was given")
        if 0 in numbers:
            raise SelectionError("an edge does not belong to the shape: select edges of the very shape that is blended")
        self._waiting = list(dict.fromkeys(numbers))
        self._as_picked = dict(zip(reversed(numbers), reversed(edges), strict=True))  # with their own orientation
        self._faces = {
            n: sorted(self._numbers.find_number(face) for face in self._faces_at(self._edges[n])) for n in self._waiting
        }
        self._first = {0 if first is None else self._numbers.find_number(first)}  # side 1, and what is one with it
        self._made_one: list[tuple[TopoDS_Face, list[int]]] = []
        self._told = 0
        self._now: dict[int, TopoDS_Edge] = {}  # picked edges that have been remade
        if first is not None and not any(self._first & set(pair) for pair in self._faces.values()):
            raise SelectionError(f"first= is not one of the faces at edge {numbers[0]}")

        skipped = []
        if len(self._waiting) > 1:  # a bad pick is told before any other is blended
            for number in tuple(self._waiting):
                try:
                    self._find_oriented_joint(shape, [self._edges[number]], number)
                except NothingToBlendError as error:
                    skipped.append(SkippedEdge(number, error.kind, str(error)))
                    self._waiting.remove(number)
            if not self._waiting:
                raise SelectionError("; ".join(one.message for one in skipped))
        self.skipped = tuple(skipped)
        self._picked = tuple(self._waiting)

    def _find_current_edge(self, number: int) -> TopoDS_Edge:
        """Return a picked edge as it is now."""
        return self._now.get(number) or self._edges[number]

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def find_next_joint(self, shape: TopoDS_Shape) -> Joint:
        """Return the next joint.

        Raises
        ------
        SelectionError
            It is not a joint of two faces; see :func:`cqblend.brep.select.edge_joint.find_joint`.
        """
        return self._find_oriented_joint(shape, [self._find_current_edge(n) for n in self._waiting], self._waiting[0])

    def find_joints(self, shape: TopoDS_Shape) -> list[Joint]:
        """Return what each of the edges that are left is part of."""
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
        self._waiting = [
            n for n in self._waiting if not any(self._find_current_edge(n).IsSame(edge) for edge in joint.spine.edges)
        ]
        return joint

    def record_unified_faces(self, united: UnifiedSolid) -> None:
        """Take note that faces have been made one; side 1 stays side 1."""
        for new, faces in united.face_replacements:
            numbers = sorted({number for face in faces for number in self._find_input_numbers(face)})
            if len(numbers) > 1:
                self._made_one.append((new, numbers))
                if self._first & set(numbers):
                    self._first |= set(numbers)
        for new, edges in united.edge_replacements:
            for number in self._picked:
                if any(self._find_current_edge(number).IsSame(edge) for edge in edges):
                    self._now[number] = TopoDS.Edge_s(new)

    def describe_unified_faces(self) -> str:
        """Say which faces were made one since this was last asked; nothing if there are none."""
        groups = [numbers for _, numbers in self._made_one[self._told :]]
        self._told = len(self._made_one)
        whole = [numbers for numbers in groups if not any(set(numbers) < set(other) for other in groups)]
        return "".join(f", faces {', '.join(map(str, numbers))} taken as one" for numbers in whole)

    def _find_input_numbers(self, face: TopoDS_Face) -> list[int]:
        """Return the numbers in the input of a face, or of all those that it was made of."""
        made = next((numbers for new, numbers in reversed(self._made_one) if new.IsSame(face)), None)
        number = self._numbers.find_number(face)
        return made or ([number] if number else [])

    def find_number(self, part: TopoDS_Shape) -> int:
        """Return the number that a part has in the input, the least of faces made one; 0 if it has none."""
        if part.ShapeType() != TopAbs_FACE:
            return (self._edges if part.ShapeType() == TopAbs_EDGE else self._vertices).find_number(part)
        made = (numbers[0] for new, numbers in self._made_one if new.IsSame(part))
        return self._numbers.find_number(part) or next(made, 0)

    def _refuse_shared_vertices(self, joint: Joint, number: int) -> None:
        """Raise UnsupportedError if another picked edge starts where a joint ends: the blends would meet in a notch."""
        for other in self._picked:
            edge = self._find_current_edge(other)
            if any(edge.IsSame(one) for one in joint.spine.edges):
                continue
            if any(mine.IsSame(theirs) for mine in joint.spine.vertices for theirs in find_end_vertices(edge)):
                raise UnsupportedError(
                    f"edge {number} shares a vertex with edge {other}, and corners and chains over several faces are "
                    "not built yet; pick edges without common vertices"
                )

    def _find_oriented_joint(self, shape: TopoDS_Shape, picked: list[TopoDS_Edge], number: int) -> Joint:
        low, high = min(self._faces[number], default=0), max(self._faces[number], default=0)
        swap = low != high and high in self._first and low not in self._first
        faces = (high, low) if swap else (low, high)
        joint = find_joint(shape, picked, number, faces, swap=swap, numbers=self.find_number)
        side = joint.sides[0]
        before = _find_boundary_direction(self._edges[number], self._numbers[faces[0]])
        if (
            before
            @ _find_boundary_direction(
                self._find_current_edge(number), side.face if side.outward > 0 else side.face.Reversed()
            )
            < 0
        ):
            # faces that became one are counted anew
            joint = find_joint(shape, picked, number, faces, swap=not swap, numbers=self.find_number)
        return replace(joint, is_backward=_is_backward(joint, self._as_picked[number]))


def _is_backward(joint: Joint, edge: TopoDS_Edge) -> bool:
    """Whether the spine of a joint runs against an edge of it, as that is oriented."""
    middle, ahead = _evaluate_middle(edge)
    points = joint.spine.evaluate_points(np.linspace(0, 1, 65))
    i = int(np.clip(np.linalg.norm(points - middle, axis=1).argmin(), 1, 63))
    return bool((points[i + 1] - points[i - 1]) @ ahead < 0)


def _find_boundary_direction(edge: TopoDS_Edge, face: TopoDS_Shape) -> Array:
    """Return the direction (3,) in which an edge bounds a face, in the middle of it."""
    return _evaluate_middle(next(use for use in explore_subshapes(face, TopAbs_EDGE) if use.IsSame(edge)))[1]


def _evaluate_middle(use: TopoDS_Edge) -> tuple[Array, Array]:
    """Return the point in the middle of an edge's parameters and the direction of its use there, (3,) each."""
    curve, point, tangent = BRepAdaptor_Curve(use), gp_Pnt(), gp_Vec()
    curve.D1((curve.FirstParameter() + curve.LastParameter()) / 2, point, tangent)
    sign = -1.0 if use.Orientation() == TopAbs_REVERSED else 1.0
    return np.array(point.Coord()), sign * np.array(tangent.Coord())
