"""From picked edges to joints: which edges belong together, and what each joint is called in the input."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.errors import InputError, SelectionError, UnsupportedError
from cqblend.occ.joint import Joint, find_joint
from cqblend.occ.topology import Ancestors, Index

Find = Callable[[TopoDS_Shape], Joint]


def joints(shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], first: TopoDS_Face | None) -> Iterator[Find]:
    """Yield, for one joint after the other, the function that finds it in a shape in which the earlier ones are blended.

    Raises
    ------
    SelectionError
        An edge or the face given as first is foreign, or no joint; see :func:`cqblend.occ.joint.find_joint`.
    UnsupportedError
        A joint has a vertex in common with an earlier one.
    """
    edge_index, face_index = Index(shape, TopAbs_EDGE), Index(shape, TopAbs_FACE)
    faces_at = Ancestors(shape, TopAbs_EDGE, TopAbs_FACE)
    numbers = [edge_index.of(edge) for edge in edges]
    if not numbers:
        raise InputError("no edge was given")
    if 0 in numbers:
        raise SelectionError("an edge does not belong to the shape: select edges of the very shape that is blended")
    named = {number: sorted(face_index.of(face) for face in faces_at(edge_index[number])) for number in numbers}
    if first is not None and not any(face_index.of(first) in pair for pair in named.values()):
        raise SelectionError(f"first= is not one of the faces at edge {numbers[0]}")
    waiting = list(dict.fromkeys(numbers))
    while waiting:
        number, pair = waiting[0], named[waiting[0]]
        swap = first is not None and len(pair) == 2 and pair[1] == face_index.of(first)
        done: list[TopoDS_Edge] = []

        def find(current: TopoDS_Shape, number: int = number, pair: list[int] = pair, swap: bool = swap) -> Joint:
            picked = [edge_index[n] for n in waiting]
            if not Index(current, TopAbs_EDGE).of(picked[0]):
                raise UnsupportedError(
                    f"edge {number} shares a vertex with one blended before it: chains are not built yet"
                )
            faces = (pair[-1], pair[0]) if swap else (pair[0], pair[-1])
            joint = find_joint(current, picked, number, faces, swap=swap)
            done.extend(joint.spine.edges)
            return joint

        yield find
        waiting = [n for n in waiting if not any(edge_index[n].IsSame(edge) for edge in done)]
