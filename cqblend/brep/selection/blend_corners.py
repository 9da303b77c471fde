"""Corners: vertices of a solid at which the ends of several chains meet that are blended together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

from OCP.BRep import BRep_Tool
from OCP.TopoDS import TopoDS

from cqblend.brep.selection.chains import Chain

CornerMethod = Literal["ball", "cross", "setback", "mitre"]
"""How the blends of a corner are put together: a sphere, patches (rails cross, or ends set back), or a mitre."""

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

    ``ends`` go around the vertex counter-clockwise, seen from outside of the solid.
    """

    vertex: int
    ends: tuple[ChainEnd, ...]
    method: CornerMethod


def find_mitres(chains: Sequence[Chain]) -> list[BlendCorner]:
    """Return the corners of a network at which two blended edges and one other meet, and the blends can be mitred.

    The two edges have one convexity, and one face in common.
    """
    found: dict[int, list[ChainEnd]] = {}
    for k, chain in enumerate(chains):
        if not chain.closed:
            for end in (0, 1):
                joint = chain.cells[-end]
                vertex = joint.index.vertices.find_number(joint.spine.vertices[end])
                found.setdefault(vertex, []).append(ChainEnd(k, end))
    corners = []
    for vertex, ends in found.items():
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
