"""From picked edges to joints: which edges belong together, and what each joint is called in the input."""

from __future__ import annotations

from collections.abc import Sequence

from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.errors import InputError, SelectionError, UnsupportedError
from cqblend.occ.joint import Joint, Names, find_joint
from cqblend.occ.topology import Ancestors, ends


class Picks:
    """The edges of a shape that are still to be blended; true as long as there are any.

    Joints are taken one by one, each from the shape in which the earlier ones are blended already.

    Raises
    ------
    InputError
        No edge was given.
    SelectionError
        An edge, or the face that is to be side 1, does not belong there.
    """

    def __init__(self, shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], first: TopoDS_Face | None) -> None:
        self._names = Names(shape)
        faces = self._names.faces
        faces_at = Ancestors(shape, TopAbs_EDGE, TopAbs_FACE)
        numbers = [self._names.edges.of(edge) for edge in edges]
        self._edges = dict(zip(reversed(numbers), reversed(edges), strict=True))  # the first pick of each
        if not numbers:
            raise InputError("no edge was given")
        if 0 in numbers:
            raise SelectionError("an edge does not belong to the shape: select edges of the very shape that is blended")
        self._waiting = list(dict.fromkeys(numbers))
        self._picked = tuple(self._waiting)
        self._faces = {n: sorted(faces.of(face) for face in faces_at(self._edges[n])) for n in self._waiting}
        self._first = 0 if first is None else faces.of(first)
        if first is not None and not any(self._first in pair for pair in self._faces.values()):
            raise SelectionError(f"first= is not one of the faces at edge {numbers[0]}")

        if len(self._waiting) > 1:  # a bad pick is told before any other is blended
            for number in self._waiting:
                self._find(shape, [self._edges[number]], number)

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def take(self, shape: TopoDS_Shape) -> Joint:
        """Return the next joint, and drop all picked edges that are part of it.

        Raises
        ------
        UnsupportedError
            The joint shares a vertex with another picked edge.
        SelectionError
            It is not a joint of two faces; see :func:`cqblend.occ.joint.find_joint`.
        """
        number = self._waiting[0]
        picked = [self._edges[n] for n in self._waiting]
        joint = self._find(shape, picked, number)
        if not joint.spine.closed:
            self._refuse_chains(joint, number)
        self._waiting = [n for n in self._waiting if not any(self._edges[n].IsSame(edge) for edge in joint.spine.edges)]
        return joint

    def _refuse_chains(self, joint: Joint, number: int) -> None:
        """Raise UnsupportedError if another picked edge starts where a joint ends: the blends would meet in a notch."""
        for other in self._picked:
            edge = self._edges[other]
            if any(edge.IsSame(one) for one in joint.spine.edges):
                continue
            if any(mine.IsSame(theirs) for mine in joint.spine.vertices for theirs in ends(edge)):
                raise UnsupportedError(
                    f"edge {number} shares a vertex with edge {other}, and corners and chains over several faces are "
                    "not built yet; pick edges without common vertices"
                )

    def _find(self, shape: TopoDS_Shape, picked: list[TopoDS_Edge], number: int) -> Joint:
        low, high = min(self._faces[number], default=0), max(self._faces[number], default=0)
        swap = low != high == self._first
        return find_joint(shape, picked, number, (high, low) if swap else (low, high), swap=swap, names=self._names)
