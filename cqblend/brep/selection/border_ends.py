"""Ends of a blended edge in the border of an open shell, where no face lies across the edge.

There the support faces end in free edges, one each, and the blend ends with them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopoDS import TopoDS_Edge, TopoDS_Vertex

from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.selection.spine import EdgeSpine
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.topology import CONFUSION, find_outgoing_tangent, is_among, locate_vertex
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product


@dataclass(frozen=True)
class BorderEnd:
    """The end of a blended edge at the border of an open shell.

    ``edges`` are the free edges there, of side 1 and of side 2; ``normal`` is that of the plane through both of their
    tangents at the ``point`` of the vertex.
    """

    vertex: TopoDS_Vertex
    edges: tuple[TopoDS_Edge, TopoDS_Edge]
    point: Array
    normal: Array

    @property
    def is_planar(self) -> bool:
        """Whether both edges lie in one plane all along, so that a planar face could close the shell there."""
        for edge in self.edges:
            first, last = BRep_Tool.Range_s(edge)
            t = np.linspace(first, last, SELECT_TOLERANCES.spine_samples)
            heights = (CurveEvaluator(BRep_Tool.Curve_s(edge, 0.0, 0.0))(t, 0)[0].T - self.point) @ self.normal
            if np.abs(heights).max() > 10 * max(BRep_Tool.Tolerance_s(edge), CONFUSION):
                return False
        return True


def find_border_end(index: SolidIndex, spine: EdgeSpine, end: int, sides: Sequence[SupportFace]) -> BorderEnd | None:
    """Return what lies at the start (``end`` 0) or stop (1) of the blended edge if that is in the border of a shell.

    None if there are other faces than its two sides, if not each of these has one free edge there, or if these two
    edges leave in one line.
    """
    if spine.closed:
        return None
    vertex = spine.vertices[end]
    if not all(is_among(face, [side.face for side in sides]) for face in index.faces_at_vertex(vertex)):
        return None
    found = []
    for side in sides:
        free = [edge for edge in index.edges_at_vertex(vertex) if _is_free_edge_of(index, edge, side)]
        if len(free) != 1:
            return None
        found.append(free[0])
    first, second = (find_outgoing_tangent(vertex, edge) for edge in found)
    normal = cross_product(first, second)
    size = float(np.linalg.norm(normal))
    if size < SELECT_TOLERANCES.smooth_angle:
        return None
    return BorderEnd(vertex, (found[0], found[1]), locate_vertex(vertex), normal / size)


def _is_free_edge_of(index: SolidIndex, edge: TopoDS_Edge, side: SupportFace) -> bool:
    """Whether an edge bounds the face of a side, once, and no other."""
    faces = index.faces_at_edge(edge)
    return len(faces) == 1 and faces[0].IsSame(side.face) and not BRep_Tool.IsClosed_s(edge, side.face)
