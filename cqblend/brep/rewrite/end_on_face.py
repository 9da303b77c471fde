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

from cqblend.brep.read.face_surface import face_side
from cqblend.brep.rewrite.end_curve import end_curve, end_edge, span_of
from cqblend.brep.rewrite.neighbour_edges import Cut, face_across
from cqblend.brep.topology import Ancestors, ends, ends_uv, explore, flipped, location_of, parameters_at
from cqblend.errors import TopologyError

if TYPE_CHECKING:
    from cqblend.brep.rewrite.shell_edit import Surgery

TANGENT = 1e-3  # rad: faces that meet at less go on smoothly into each other


@dataclass(frozen=True)
class Ending:
    """One end of an open blend.

    ``edge`` is X, FORWARD from the corner on rail 1 to that on rail 2, at the parameters ``t`` of the rails. A capped
    end has the ``cap``, and a wall inside each side, FORWARD from the edge point to the corner, but where the cap
    stands on an edge of the input.
    """

    edge: TopoDS_Edge
    corners: tuple[TopoDS_Vertex, TopoDS_Vertex]
    t: tuple[float, float]
    vertex: TopoDS_Vertex
    cuts: tuple[Cut, ...] = ()
    walls: tuple[list[TopoDS_Edge], list[TopoDS_Edge]] = ([], [])
    cap: TopoDS_Face | None = None


def on_neighbour(surgery: Surgery, end: int) -> Ending:
    """End the blend on the one face across from the edge at its start (``end`` 0) or stop (1).

    Raises
    ------
    TopologyError
        If there is not exactly one such face, next to both sides.
    """
    vertex = surgery.spine.vertices[end]
    sides = [side.face for side in surgery.sides]
    across = face_across(surgery.solid, surgery.spine, end, surgery.sides)
    neighbour = face_side(across, location_of(vertex)[None])
    edges, shared_edges = Ancestors(surgery.solid, TopAbs_VERTEX, TopAbs_EDGE)(vertex), []
    for side in sides:
        pair = {surgery.faces.of(side), surgery.faces.of(across)}
        shared = [edge for edge in edges if {surgery.faces.of(face) for face in surgery.faces_at_edge(edge)} == pair]
        if len(shared) != 1:
            raise TopologyError("the face at the end of the edge does not share exactly one edge with each side")
        shared_edges.append(shared[0])
    use = next(use for use in explore(neighbour.face, TopAbs_EDGE) if use.IsSame(shared_edges[0]))
    arrives = ends(use)[1].IsSame(vertex)
    at = ends_uv(use, neighbour.face)[1 if arrives else 0]
    normals = [side.native.normals(parameters_at(vertex, side.face)[None])[0] for side in surgery.sides]
    sines = np.linalg.norm(np.cross(normals, neighbour.native.normals(at[None])), axis=1)
    tangent = int(sines.argmin()) if sines.min() < TANGENT else None
    curve = end_curve(surgery, neighbour.native, location_of(vertex), at, float(end), tangent)
    edge, corners = end_edge(surgery, curve, neighbour.face)
    surgery.rewrite(across).added.append(edge if arrives else flipped(edge))
    cuts = [
        Cut(end, shared, vertex, corner, (side, across))
        for shared, corner, side in zip(shared_edges, corners, sides, strict=True)
    ]
    return Ending(edge, corners, span_of(curve), vertex, tuple(cuts))
