"""Junctions of a chain: the edge in which two consecutive blend faces meet, and the smooth edges that end there."""

from __future__ import annotations

import numpy as np

from cqblend.blends.network.blend_plan import NewEdge, PlannedVertex
from cqblend.brep.selection.chains import Junction
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim
from cqblend.brep.shell_editing.strip_end import StripEnd
from cqblend.brep.shell_editing.strip_placement import StripPlacement


def join_cells(before: StripPlacement, after: StripPlacement, junction: Junction) -> tuple[StripEnd, StripEnd]:
    """Return the ends at a junction, of the cell before and of the cell after: edge and corners are common.

    The common edge is the end section of the cell before, of which the start section of the cell after is a copy to
    rounding. Smooth edges of the input that the rails cross there are trimmed to the corners.
    """
    stop, start = before.domain[1], after.domain[0]
    corners = [
        PlannedVertex(
            first(np.array([stop]))[0], gap=float(np.linalg.norm(first(np.array([stop])) - second(np.array([start]))))
        )
        for first, second in zip(before.rail_curves, after.rail_curves, strict=True)
    ]
    section = before.strip.locate_section(stop)
    pcurves = (before.plan_pcurve(section.make_pcurve(stop)), after.plan_pcurve(section.make_pcurve(start)))
    order = min(1, *(ribbon.order for cell in (before, after) for ribbon in cell.blend.ribbons))
    pair = (corners[0], corners[1])
    edge = NewEdge("section", section.curve, section.span, pair, pcurves, order)
    trims = []
    for i, crossed in enumerate(junction.crossed):
        faces = (before.joint.sides[i].face, after.joint.sides[i].face)
        trims += [EdgeTrim(before, 1, smooth, junction.vertex, corners[i], faces) for smooth in crossed]
    vertex = before.keep_vertex(junction.vertex)
    return (
        StripEnd(edge, pair, (stop, stop), vertex, tuple(trims)),
        StripEnd(edge, pair, (start, start), vertex),
    )
