"""Where an open blend ends: on the face across its end.

The other way, flat caps, is in :mod:`cqblend.brep.rewrite.end_cap`.

Either way the end curve X of the blend surface is solved point by point on the surface it ends on. On a neighbour face,
X replaces the corner, and the two edges there are cut short, or lengthened, to where X starts and stops.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from OCP.TopAbs import TopAbs_EDGE, TopAbs_VERTEX
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.brep.read.face_surface import read_support_face
from cqblend.brep.rewrite.end_curve import get_end_parameters, make_end_edge, solve_end_curve
from cqblend.brep.rewrite.neighbour_edges import EdgeTrim, find_end_face
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

if TYPE_CHECKING:
    from cqblend.brep.rewrite.shell_edit import ShellEdit

TANGENT_ANGLE = 1e-3  # rad: faces that meet at less go on smoothly into each other


@dataclass(frozen=True)
class BlendEnd:
    """One end of an open blend.

    ``edge`` is X, FORWARD from the corner on rail 1 to that on rail 2, at the parameters ``rail_parameters`` of the
    rails. A capped end has the ``cap``, and a wall inside each side, FORWARD from the edge point to the corner, but
    where the cap stands on an edge of the input.
    """

    edge: TopoDS_Edge
    corners: tuple[TopoDS_Vertex, TopoDS_Vertex]
    rail_parameters: tuple[float, float]
    vertex: TopoDS_Vertex
    edge_trims: tuple[EdgeTrim, ...] = ()
    cap_borders: tuple[list[TopoDS_Edge], list[TopoDS_Edge]] = ([], [])
    cap: TopoDS_Face | None = None


def end_on_face(surgery: ShellEdit, end: int) -> BlendEnd:
    """End the blend on the one face across from the edge at its start (``end`` 0) or stop (1).

    Raises
    ------
    TopologyError
        If there is not exactly one such face, next to both sides.
    """
    vertex = surgery.spine.vertices[end]
    sides = [side.face for side in surgery.sides]
    across = find_end_face(surgery.solid, surgery.spine, end, surgery.sides)
    neighbour = read_support_face(across, locate_vertex(vertex)[None])
    edges, shared_edges = AncestorMap(surgery.solid, TopAbs_VERTEX, TopAbs_EDGE)(vertex), []
    for side in sides:
        pair = {surgery.face_index.find_number(side), surgery.face_index.find_number(across)}
        shared = [
            edge
            for edge in edges
            if {surgery.face_index.find_number(face) for face in surgery.faces_at_edge(edge)} == pair
        ]
        if len(shared) != 1:
            raise TopologyError("the face at the end of the edge does not share exactly one edge with each side")
        shared_edges.append(shared[0])
    use = next(use for use in explore_subshapes(neighbour.face, TopAbs_EDGE) if use.IsSame(shared_edges[0]))
    arrives = find_end_vertices(use)[1].IsSame(vertex)
    at = find_end_uv(use, neighbour.face)[1 if arrives else 0]
    normals = [side.face_primary.evaluate_normals(find_vertex_uv(vertex, side.face)[None])[0] for side in surgery.sides]
    sines = np.linalg.norm(np.cross(normals, neighbour.face_primary.evaluate_normals(at[None])), axis=1)
    tangent = int(sines.argmin()) if sines.min() < TANGENT_ANGLE else None
    curve = solve_end_curve(surgery, neighbour.face_primary, locate_vertex(vertex), at, float(end), tangent)
    edge, corners = make_end_edge(surgery, curve, neighbour.face)
    surgery.get_face_edit(across).added_uses.append(edge if arrives else reverse_edge(edge))
    cuts = [
        EdgeTrim(end, shared, vertex, corner, (side, across))
        for shared, corner, side in zip(shared_edges, corners, sides, strict=True)
    ]
    return BlendEnd(edge, corners, get_end_parameters(curve), vertex, tuple(cuts))
