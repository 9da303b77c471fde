"""Junctions of a chain: the edge in which two consecutive blend faces meet, and the smooth edges that end there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cqblend.blends.network.blend_plan import EdgeUse, NewEdge, PlannedVertex
from cqblend.brep.selection.chains import Chain, Junction
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim
from cqblend.brep.shell_editing.strip_end import StripEnd
from cqblend.brep.shell_editing.strip_placement import StripPlacement
from cqblend.brep.topology import find_end_vertices


def join_chain(placements: Sequence[StripPlacement], chain: Chain) -> list[tuple[StripEnd, StripEnd]]:
    """Return the ends at every junction of a chain, of the cell before and of the cell after.

    They have one edge in common, and its corners.
    """
    count = len(placements)
    pairs = [(placements[k], placements[(k + 1) % count]) for k in range(len(chain.junctions))]
    corners = [
        _plan_corners(before, after, junction) for (before, after), junction in zip(pairs, chain.junctions, strict=True)
    ]
    for k, placement in enumerate(placements):
        start, stop = (k - 1) % count, k
        if max(start, stop) >= len(pairs):
            continue  # an end of an open chain
        for i, ribbon in enumerate(placement.blend.ribbons):
            if ribbon.is_point:  # the cell has one corner there instead of two
                dropped, kept = corners[stop][i], corners[start][i]
                corners = [tuple(kept if one is dropped else one for one in pair) for pair in corners]
    return [
        _join_cells(before, after, junction, (pair[0], pair[1]))
        for (before, after), junction, pair in zip(pairs, chain.junctions, corners, strict=True)
    ]


def _plan_corners(before: StripPlacement, after: StripPlacement, junction: Junction) -> tuple[PlannedVertex, ...]:
    """Return where the rails of two cells meet: at the end of a smooth edge, if they cross it there."""
    stop, start = np.array([before.domain[1]]), np.array([after.domain[0]])
    points = [
        (first(stop)[0], second(start)[0]) for first, second in zip(before.rail_curves, after.rail_curves, strict=True)
    ]
    corners = (PlannedVertex(one, gap=float(np.linalg.norm(one - other))) for one, other in points)
    ends = ([vertex for edge in edges for vertex in find_end_vertices(edge)] for edges in junction.crossed)
    return tuple(before.keep_vertex_at(corner, near) for corner, near in zip(corners, ends, strict=True))


def _join_cells(
    before: StripPlacement, after: StripPlacement, junction: Junction, corners: tuple[PlannedVertex, PlannedVertex]
) -> tuple[StripEnd, StripEnd]:
    """Return the ends at a junction between given corners.

    The common edge is the end section of the cell before, of which the start section of the cell after is a copy to
    rounding. Smooth edges of the input that the rails cross at a vertex are trimmed to the corners; others are cut as
    :mod:`.lost_parts` has it.
    """
    stop, start = before.domain[1], after.domain[0]
    section = before.strip.locate_section(stop)
    pcurves = (before.plan_pcurve(section.make_pcurve(stop)), after.plan_pcurve(section.make_pcurve(start)))
    order = min(1, *(ribbon.order for cell in (before, after) for ribbon in cell.blend.ribbons))
    edge = NewEdge("section", section.curve, section.span, corners, pcurves, order)
    trims = []
    if junction.vertex is not None:
        for i, crossed in enumerate(junction.crossed):
            faces = (before.joint.sides[i].face, after.joint.sides[i].face)
            trims += [EdgeTrim(before, 1, smooth, junction.vertex, corners[i], faces) for smooth in crossed]
    use, vertex = EdgeUse(edge), before.keep_vertex(before.joint.spine.vertices[1])
    return (
        StripEnd((use,), corners, (stop, stop), vertex, tuple(trims)),
        StripEnd((use,), corners, (start, start), vertex),
    )
