"""Divide a chain into more cells where its rails leave their faces over smooth edges inside its cells.

A cell has one pair of faces. Where a rail crosses a smooth edge that does not meet the chain in a vertex, or runs on a
face that does not reach the chain at all, the edge is divided into stretches with different faces
(:mod:`.contact_landing`). Consecutive stretches are joined as the cells of any chain are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from cqblend.brep.selection.chains import Chain, Junction
from cqblend.brep.selection.crossed_edges import find_smooth_edge
from cqblend.errors import GeometryError, UnsupportedError
from cqblend.solid_blends.strip_context import StripContext
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge


@dataclass(frozen=True)
class DividedChain:
    """A chain with more cells than it has pairs of faces, and the contexts of these cells."""

    chain: Chain
    cells: tuple[StripContext, ...]


def divide_chain(chain: Chain, cells: Sequence[StripContext]) -> DividedChain | None:
    """Divide the cells of a chain, given by their contexts, at the ends of their stretches.

    None if there is nothing to divide: all are on the faces at their edges.

    Raises
    ------
    SizeError, GeometryError
        If a rail leaves its face, and does not go on smoothly.
    """
    pieces = [list(map(cell.take_stretch, cell.stretches)) for cell in cells]
    for k in range(len(chain.junctions)):
        _unite_at_vertex(pieces[k], pieces[(k + 1) % len(pieces)])
    divided = [piece for some in pieces for piece in some]
    passes = any(len(edges) > 1 for junction in chain.junctions for edges in junction.crossed)
    if not passes and len(divided) == len(cells) and all(one.known is None for one in divided):
        return None
    if chain.closed and not chain.junctions and len(divided) > 1:
        raise UnsupportedError(
            "the rail of a closed edge crosses a smooth edge of its face, and such an edge is not divided yet"
        )
    links = [*pairwise(divided), *([(divided[-1], divided[0])] if chain.closed and chain.junctions else [])]
    junctions = tuple(Junction(None, _find_crossed_edges(before, after)) for before, after in links)
    joints = tuple(one.joint for one in divided)
    return DividedChain(replace(chain, cells=joints, junctions=junctions, divides=chain), tuple(divided))


def _unite_at_vertex(before: list[StripContext], after: list[StripContext]) -> None:
    """Let one stretch go on past the vertex between two edges where the next one has the same faces and is short."""
    first, second = before[-1], after[0]
    if not (before and after and _have_same_faces(first, second)):
        return
    lengths = [_measure_length(one) for one in (first, second)]
    if min(lengths) > SOLID_BLEND_TOLERANCES.overrun_widths * first.measure_reach():
        return
    if lengths[0] < lengths[1] and len(before) > 1:
        before.pop()
        low = second.window[0] - lengths[0] / second.joint.spine.length
        after[0] = replace(second, window=(low, second.window[1]))
    elif len(after) > 1:
        after.pop(0)
        before[-1] = replace(first, window=(first.window[0], first.window[1] + lengths[1] / first.joint.spine.length))


def _measure_length(cell: StripContext) -> float:
    return (cell.window[1] - cell.window[0]) * cell.joint.spine.length


def _have_same_faces(one: StripContext, other: StripContext) -> bool:
    return all(a.face.IsSame(b.face) for a, b in zip(one.joint.sides, other.joint.sides, strict=True))


def _find_crossed_edges(
    before: StripContext, after: StripContext
) -> tuple[tuple[TopoDS_Edge, ...], tuple[TopoDS_Edge, ...]]:
    """Return the smooth edges, by side, over which the rails pass from one cell to the next.

    Raises
    ------
    GeometryError
        If a rail passes to a face over no such edge.
    """
    found: list[tuple[TopoDS_Edge, ...]] = []
    contacts = before.solve(np.array([before.window[1]]))
    for one, other, uv in zip(before.joint.sides, after.joint.sides, contacts.uv, strict=True):
        if one.face.IsSame(other.face):
            found.append(())
            continue
        edge = find_smooth_edge(before.joint.index, (one.face, other.face), one.primary.jet(uv)[0, 0])
        if edge is None:
            names = before.joint.name_part(one.face), before.joint.name_part(other.face)
            raise GeometryError("the rail passes from {} to {}, which have no smooth edge in common".format(*names))
        found.append((edge,))
    return found[0], found[1]
