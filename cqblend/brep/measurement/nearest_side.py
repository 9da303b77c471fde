"""On which side of faces a point lies, told by the nearest of them: the inside of a shell that bounds no solid."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape, BRepExtrema_IsInFace, BRepExtrema_IsOnEdge
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX
from OCP.TopoDS import TopoDS, TopoDS_Face

from cqblend.brep.measurement.surface_evaluation import evaluate_face_normals
from cqblend.brep.topology import AncestorMap, ShapeIndex, find_vertex_uv, make_compound
from cqblend.splines.bernstein import Array


def measure_height(point: Array, faces: Iterable[TopoDS_Face]) -> float:
    """Return how far (mm) a point (3,) is outside of the nearest of some faces, by their orientation; negative inside.

    Where an edge or a vertex of several faces is nearest, the mean of their normals tells. nan if OCCT finds no foot.
    """
    body = make_compound(faces)
    search = BRepExtrema_DistShapeShape(BRepBuilderAPI_MakeVertex(gp_Pnt(*point.tolist())).Vertex(), body)
    if not search.IsDone() or not search.NbSolution():
        return float("nan")
    foot, kind = np.array(search.PointOnShape2(1).Coord()), search.SupportTypeShape2(1)
    support = search.SupportOnShape2(1)
    places: list[tuple[TopoDS_Face, Array]] = []
    if kind == BRepExtrema_IsInFace:
        known = ShapeIndex(body, TopAbs_FACE)  # with the orientations that count
        places = [(known[known.find_number(support)], np.array(search.ParOnFaceS2(1)))]
    elif kind == BRepExtrema_IsOnEdge:
        edge, (at,) = TopoDS.Edge_s(support), search.ParOnEdgeS2(1)
        for face in AncestorMap(body, TopAbs_EDGE, TopAbs_FACE)(edge):
            pcurve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
            places.append((face, np.array(pcurve.Value(at).Coord())))
    else:
        vertex = TopoDS.Vertex_s(support)
        places = [
            (face, find_vertex_uv(vertex, face)) for face in AncestorMap(body, TopAbs_VERTEX, TopAbs_FACE)(vertex)
        ]
    normal = np.sum([evaluate_face_normals(face, uv[None])[1][0] for face, uv in places], axis=0)
    return float(np.sign((point - foot) @ normal) * search.Value())
