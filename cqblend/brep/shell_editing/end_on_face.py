"""Natural ends of an open blend: on the one face across the edge.

There, the end curve takes the place of the face's corner, and the two edges that the face shares with the support faces
are trimmed, or extended, to where the end curve starts and stops. Flat caps are in
:mod:`cqblend.brep.shell_editing.end_cap`.
"""

from __future__ import annotations

import numpy as np
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Vertex

from cqblend.blends.network.blend_plan import EdgeUse, FacePlan
from cqblend.brep.shell_editing.end_curve import EndCurveStart, plan_end_edge, solve_end_curve
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim
from cqblend.brep.shell_editing.strip_end import StripEnd
from cqblend.brep.shell_editing.strip_placement import StripPlacement
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import (
    explore_subshapes,
    find_end_uv,
    find_end_vertices,
    find_vertex_uv,
    locate_vertex,
)
from cqblend.errors import TopologyError


def end_on_face(placement: StripPlacement, end: int) -> StripEnd:
    """End the blend on the one face across from the edge at its start (``end`` 0) or stop (1).

    Raises
    ------
    TopologyError
        If there is not exactly one such face, next to both sides, or the blend does not meet it.
    """
    joint = placement.joint
    vertex = joint.spine.vertices[end]
    target = joint.read_end_face(end)
    number = placement.number_face(target.face)
    shared_edges = _find_shared_edges(placement, vertex, number)
    use = next(use for use in explore_subshapes(target.face, TopAbs_EDGE) if use.IsSame(shared_edges[0]))
    stops_at_vertex = find_end_vertices(use)[1].IsSame(vertex)
    uv = find_end_uv(use, target.face)[1 if stops_at_vertex else 0]
    normals = [side.face_primary.evaluate_normals(find_vertex_uv(vertex, side.face)[None])[0] for side in joint.sides]
    sines = np.linalg.norm(np.cross(normals, target.face_primary.evaluate_normals(uv[None])), axis=1)
    tangent_side = int(sines.argmin()) if sines.min() < SHELL_EDIT_TOLERANCES.tangent_faces else None
    start = EndCurveStart(placement.locate_edge_parameter(end), uv, locate_vertex(vertex))
    cut = solve_end_curve(placement.strip, target.face_primary, start, tangent_side)
    edge, corners = plan_end_edge(placement, cut, number)
    trims = tuple(
        EdgeTrim(placement, end, shared, vertex, corner, (side.face, target.face))
        for shared, corner, side in zip(shared_edges, corners, joint.sides, strict=True)
    )
    added = FacePlan(number, added=(EdgeUse(edge, forward=stops_at_vertex),))
    return StripEnd(edge, corners, cut.rail_parameters, placement.keep_vertex(vertex), trims, (added,))


def _find_shared_edges(placement: StripPlacement, vertex: TopoDS_Vertex, end_face: int) -> list[TopoDS_Edge]:
    """Return the two edges at a vertex that an end face shares with the support faces.

    Raises
    ------
    TopologyError
        If there is not exactly one with each.
    """
    index = placement.index
    edges, shared_edges = index.edges_at_vertex(vertex), []
    for support in placement.face_numbers:
        pair = {support, end_face}
        shared = [
            edge for edge in edges if {index.faces.find_number(face) for face in index.faces_at_edge(edge)} == pair
        ]
        if len(shared) != 1:
            raise TopologyError("the face at the end of the edge does not share exactly one edge with each side")
        shared_edges.append(shared[0])
    return shared_edges
