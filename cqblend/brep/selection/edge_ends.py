"""What lies at the ends of a chain of edges: other faces there, and edges across it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.GeomAPI import GeomAPI_ProjectPointOnCurve
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.topology import (
    CONFUSION,
    drop_duplicate_shapes,
    explore_subshapes,
    find_end_vertices,
    find_outgoing_tangent,
    find_seam_edges,
    is_among,
    locate_vertex,
    orient_forward,
)
from cqblend.splines.bernstein import Array

SAME_DIRECTION = 0.15
"""Norm of the difference of two unit tangents (about radians): edges that differ by less continue each other."""


def find_neighbour_faces(index: SolidIndex, vertex: TopoDS_Vertex, sides: Sequence[SupportFace]) -> list[TopoDS_Face]:
    """Return the faces at a vertex of the blended edge that are none of its two sides."""
    return [face for face in index.faces_at_vertex(vertex) if not is_among(face, [side.face for side in sides])]


def find_continuing_edge(index: SolidIndex, vertex: TopoDS_Vertex, edge: TopoDS_Edge) -> TopoDS_Edge | None:
    """Return another edge that leaves a vertex in the direction in which this edge arrives; None if none does."""
    arriving = -find_outgoing_tangent(vertex, edge)
    for other in index.edges_at_vertex(vertex):
        turn = np.linalg.norm(find_outgoing_tangent(vertex, other) - arriving)
        if not other.IsSame(edge) and turn < SAME_DIRECTION:
            return TopoDS.Edge_s(other)
    return None


def find_edge_in_plane(
    face: TopoDS_Face, vertex: TopoDS_Vertex, blended: Sequence[TopoDS_Edge], normal: Array, corner: Array
) -> TopoDS_Edge | None:
    """Return the edge of a face that runs from a vertex to a point in the plane through the vertex; None if none does.

    ``normal`` is the plane's. Edges that are ``blended``, and seams, do not count.
    """
    start = locate_vertex(vertex)
    for edge in drop_duplicate_shapes(orient_forward(use) for use in explore_subshapes(face, TopAbs_EDGE)):
        if BRep_Tool.Degenerated_s(edge) or is_among(edge, (*blended, *find_seam_edges(face))):
            continue
        own = find_end_vertices(edge)
        if own[0].IsSame(own[1]) or not is_among(vertex, own):
            continue
        curve, (first, last) = BRep_Tool.Curve_s(edge, 0.0, 0.0), BRep_Tool.Range_s(edge)
        slack = 10 * max(BRep_Tool.Tolerance_s(edge), CONFUSION)
        project = GeomAPI_ProjectPointOnCurve(gp_Pnt(*corner.tolist()), curve, first, last)
        if project.NbPoints() == 0 or project.LowerDistance() > slack:
            continue
        span = np.linspace(first if own[0].IsSame(vertex) else last, project.LowerDistanceParameter(), 17)
        points = np.array([curve.Value(t).Coord() for t in span.tolist()])
        if np.abs((points - start) @ normal).max() <= slack:
            return edge
    return None
