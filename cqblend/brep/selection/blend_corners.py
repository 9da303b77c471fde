"""Corners: vertices of a solid at which the ends of several chains meet that are blended together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from OCP.BRep import BRep_Tool
from OCP.TopoDS import TopoDS, TopoDS_Face

from cqblend.brep.selection.chains import Chain

CornerMethod = Literal["ball", "cross", "setback", "mitre", "turn"]
"""How the blends of a corner are put together: a sphere, patches (rails cross, or ends set back), a mitre, a turn."""

CORNER_METHODS: tuple[CornerMethod, ...] = get_args(CornerMethod)
"""All of them."""


@dataclass(frozen=True)
class ChainEnd:
    """One end of an open chain: its index among the chains of a network, and 0 for its start, 1 for its stop."""

    chain: int
    end: int


@dataclass(frozen=True)
class BlendCorner:
    """A vertex where ends of chains meet, by its number in the solid, and how their blends are put together there.

    ``ends`` go around the vertex counter-clockwise, seen from outside of the solid. Where the ``method`` does not fit,
    the ``alternatives`` are tried. ``setbacks`` are the distances (mm) from the vertex at which ends stop, as asked
    for, None where a rule of thumb tells; that of all if there are none.
    """

    vertex: int
    ends: tuple[ChainEnd, ...]
    method: CornerMethod
    alternatives: tuple[CornerMethod, ...] = ()
    setbacks: tuple[float | None, ...] = ()


def find_blended_corners(
    chains: Sequence[Chain], methods: Sequence[CornerMethod], setbacks: Mapping[int, float] | None = None
) -> list[BlendCorner]:
    """Return the corners of a network at which every edge is blended, three at least.

    ``methods`` are tried in this order; ``setbacks`` are those (mm) that were asked for, by the index of the chain.
    """
    asked = setbacks or {}
    first, *others = methods
    corners = []
    for vertex, ends in group_ends(chains).items():
        ring = order_all_ends(chains, ends)
        if ring is not None:
            given = tuple(asked.get(one.chain) for one in ring)
            setbacks_here = given if any(one is not None for one in given) else ()
            corners.append(BlendCorner(vertex, ring, first, tuple(others), setbacks_here))
    return corners


def order_all_ends(chains: Sequence[Chain], ends: Sequence[ChainEnd]) -> tuple[ChainEnd, ...] | None:
    """Return ends of chains at one vertex as :func:`order_ends` does; None if they are not all of its edges, or two."""
    joint = chains[ends[0].chain].cells[-ends[0].end]
    around = joint.index.edges_at_vertex(joint.spine.vertices[ends[0].end])
    edges = [edge for edge in around if not BRep_Tool.Degenerated_s(TopoDS.Edge_s(edge))]
    return order_ends(chains, ends) if len(ends) == len(edges) > 2 else None


def order_ends(chains: Sequence[Chain], ends: Sequence[ChainEnd]) -> tuple[ChainEnd, ...] | None:
    """Return ends of chains at one vertex counter-clockwise, seen from outside; None if they do not go all around it.

    They do if each, and the next one, have the face between them in common.
    """
    ring, rest = [ends[0]], list(ends[1:])
    while True:
        joint = chains[ring[-1].chain].cells[-ring[-1].end]
        face = joint.sides[ring[-1].end].face
        following = [one for one in (rest or ring[:1]) if _get_preceding_face(chains, one).IsSame(face)]
        if len(following) != 1:
            return None
        if not rest:
            return tuple(ring)
        ring.append(following[0])
        rest.remove(following[0])


def _get_preceding_face(chains: Sequence[Chain], end: ChainEnd) -> TopoDS_Face:
    """Return the support face on the side of an end towards the one before it."""
    return chains[end.chain].cells[-end.end].sides[1 - end.end].face


def group_ends(chains: Sequence[Chain]) -> dict[int, list[ChainEnd]]:
    """Return the ends of open chains by the number of the vertex that they are at."""
    found: dict[int, list[ChainEnd]] = {}
    for k, chain in enumerate(chains):
        if not chain.closed:
            for end in (0, 1):
                joint = chain.cells[-end]
                vertex = joint.index.vertices.find_number(joint.spine.vertices[end])
                found.setdefault(vertex, []).append(ChainEnd(k, end))
    return found


def find_mitres(chains: Sequence[Chain]) -> list[BlendCorner]:
    """Return the corners of a network at which two blended edges and one other meet, and the blends can be mitred.

    The two edges have one convexity, and one face in common.
    """
    corners = []
    for vertex, ends in group_ends(chains).items():
        if len(ends) == 2:
            ordered = _order_mitred_ends(chains, (ends[0], ends[1]))
            if ordered is not None:
                corners.append(BlendCorner(vertex, ordered, "mitre"))
    return corners


def _order_mitred_ends(chains: Sequence[Chain], ends: tuple[ChainEnd, ChainEnd]) -> tuple[ChainEnd, ChainEnd] | None:
    """Return two ends that can be mitred with the common face to the left of the first; None if they cannot be."""
    joints = [chains[one.chain].cells[-one.end] for one in ends]
    index, vertex = joints[0].index, joints[0].spine.vertices[ends[0].end]
    edges = [edge for edge in index.edges_at_vertex(vertex) if not BRep_Tool.Degenerated_s(TopoDS.Edge_s(edge))]
    if len(edges) != 3 or joints[0].is_convex != joints[1].is_convex:
        return None
    for first, second in ((0, 1), (1, 0)):
        left = joints[first].sides[ends[first].end].face
        right = joints[second].sides[1 - ends[second].end].face
        walls = joints[first].sides[1 - ends[first].end].face, joints[second].sides[ends[second].end].face
        if left.IsSame(right) and not walls[0].IsSame(walls[1]):
            return ends[first], ends[second]
    return None
