"""Ends of an open blend in a point: where its size goes to 0, both rails run into the vertex of the edge.

Nothing else ends there: the faces across keep their corners, and the blend face has a degenerate edge at the vertex.
"""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Tool

from cqblend.blends.network.blend_plan import EdgeUse, NewEdge, PlannedPcurve
from cqblend.brep.shell_editing.strip_end import StripEnd
from cqblend.brep.shell_editing.strip_placement import StripPlacement
from cqblend.brep.topology import locate_vertex
from cqblend.errors import TopologyError
from cqblend.splines import Curve


def end_in_point(placement: StripPlacement, end: int) -> StripEnd:
    """End the blend in the vertex at its start (``end`` 0) or stop (1), where its rails meet.

    Raises
    ------
    TopologyError
        The vertex is too far from the surfaces of the faces, which the rails run on.
    """
    at, vertex = placement.domain[end], placement.joint.spine.vertices[end]
    point = placement.rail_curves[0](np.array([at]))[0]
    if np.linalg.norm(locate_vertex(vertex) - point) > BRep_Tool.Tolerance_s(vertex):
        raise TopologyError("the edge's vertex is too far from its faces for a blend to end there in a point")
    kept = placement.keep_vertex(vertex)
    across = PlannedPcurve(placement.surface, Curve.bezier([(at, 0.0), (at, 1.0)]))
    pole = NewEdge("pole", None, (0.0, 1.0), (kept, kept), (across,))
    return StripEnd((EdgeUse(pole),), (kept, kept), (at, at), kept)
