"""Natural ends of an open blend: on the one face across the edge.

There, the end curve takes the place of the face's corner, and the two edges that the face shares with the support faces
are trimmed, or extended, to where the end curve starts and stops. Flat caps are in
:mod:`cqblend.brep.shell_editing.end_cap`.
"""

from __future__ import annotations

import numpy as np
from OCP.TopAbs import TopAbs_EDGE, TopAbs_VERTEX
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.brep.conversion.support_face import read_support_face
from cqblend.brep.selection.edge_ends import find_end_face
from cqblend.brep.shell_editing.blend_placement import BlendPlacement
from cqblend.brep.shell_editing.end_curve import EndCurveStart, get_end_parameters, make_end_edge, solve_end_curve
from cqblend.brep.shell_editing.face_edits import BlendEnd, EdgeTrim, FaceEdit
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import (
    AncestorMap,
    explore_subshapes,
    find_end_uv,
    find_end_vertices,
    find_vertex_uv,
    locate_vertex,
    reverse_edge,
)
from cqblend.errors import TopologyError


def end_on_face(placement: BlendPlacement, end: int) -> BlendEnd:
    """End the blend on the one face across from the edge at its start (``end`` 0) or stop (1).

    Raises
    ------
    TopologyError
        If there is not exactly one such face, next to both sides, or the blend does not meet it.
    """
    vertex = placement.spine.vertices[end]
    support_faces = [side.face for side in placement.sides]
    end_face = find_end_face(placement.solid, placement.spine, end, placement.sides)
    target = read_support_face(end_face, locate_vertex(vertex)[None])
    shared_edges = _find_shared_edges(placement, vertex, end_face)
    use = next(use for use in explore_subshapes(target.face, TopAbs_EDGE) if use.IsSame(shared_edges[0]))
    stops_at_vertex = find_end_vertices(use)[1].IsSame(vertex)
    uv = find_end_uv(use, target.face)[1 if stops_at_vertex else 0]
    normals = [
        side.face_primary.evaluate_normals(find_vertex_uv(vertex, side.face)[None])[0] for side in placement.sides
    ]
    sines = np.linalg.norm(np.cross(normals, target.face_primary.evaluate_normals(uv[None])), axis=1)
    tangent_side = int(sines.argmin()) if sines.min() < SHELL_EDIT_TOLERANCES.tangent_faces else None
    start = EndCurveStart(float(end), uv, locate_vertex(vertex))
    curve = solve_end_curve(placement.blend.surface, target.face_primary, start, tangent_side)
    edge, corners = make_end_edge(placement.blend_face, curve, target.face)
    trims = [
        EdgeTrim(end, shared, vertex, corner, (face, end_face))
        for shared, corner, face in zip(shared_edges, corners, support_faces, strict=True)
    ]
    edit = FaceEdit(end_face, (edge if stops_at_vertex else reverse_edge(edge),))
    return BlendEnd(edge, corners, get_end_parameters(curve), vertex, tuple(trims), (edit,))


def _find_shared_edges(placement: BlendPlacement, vertex: TopoDS_Vertex, end_face: TopoDS_Face) -> list[TopoDS_Edge]:
    """Return the two edges at a vertex that an end face shares with the support faces.

    Raises
    ------
    TopologyError
        If there is not exactly one with each.
    """
    number = placement.face_index.find_number
    edges, shared_edges = AncestorMap(placement.solid, TopAbs_VERTEX, TopAbs_EDGE)(vertex), []
    for side in placement.sides:
        pair = {number(side.face), number(end_face)}
        shared = [edge for edge in edges if {number(face) for face in placement.faces_at_edge(edge)} == pair]
        if len(shared) != 1:
            raise TopologyError("the face at the end of the edge does not share exactly one edge with each side")
        shared_edges.append(shared[0])
    return shared_edges
