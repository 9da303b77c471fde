"""Whether two faces that share an edge are on one surface, on which they could be one face."""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.Geom import Geom_RectangularTrimmedSurface, Geom_Surface
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.GeomLProp import GeomLProp_SLProps
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from cqblend.brep.measurement.edge_continuity import measure_continuity_between
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.topology import CONFUSION, drop_duplicate_shapes, explore_subshapes


def is_same_surface(one: TopoDS_Face, two: TopoDS_Face, shared: TopoDS_Edge) -> bool:
    """Whether two faces that share an edge meet smoothly there and are on the same surface, of the same type.

    False for faces with a pole or an apex: OCCT crashes when it unifies these.
    """
    if BRepAdaptor_Surface(one, False).GetType() != BRepAdaptor_Surface(two, False).GetType():
        return False
    if _measure_middle_angle(one, two, shared) > SELECT_TOLERANCES.smooth_angle:
        return False
    surface = _get_basis_surface(one)
    for edge in drop_duplicate_shapes(explore_subshapes(two, TopAbs_EDGE)):
        if edge.IsSame(shared):
            continue
        if BRep_Tool.Degenerated_s(edge):
            return False
        curve = BRepAdaptor_Curve(edge)
        allowed = max(CONFUSION, BRep_Tool.Tolerance_s(edge))
        for t in np.linspace(curve.FirstParameter(), curve.LastParameter(), 5).tolist():
            foot = GeomAPI_ProjectPointOnSurf(curve.Value(t), surface)
            if foot.NbPoints() == 0 or foot.LowerDistance() > allowed:
                return False
    if any(BRep_Tool.Degenerated_s(edge) for edge in explore_subshapes(one, TopAbs_EDGE)):
        return False
    return (
        measure_continuity_between(((one, shared), (two, shared)), SELECT_TOLERANCES.merged_samples).angle
        < SELECT_TOLERANCES.smooth_angle
    )


def _measure_middle_angle(one: TopoDS_Face, two: TopoDS_Face, shared: TopoDS_Edge) -> float:
    """Return the angle (rad) between the surfaces of two faces in the middle of an edge; 0 where one has no normal."""
    normals = []
    for face in (one, two):
        pcurve = BRep_Tool.CurveOnSurface_s(shared, face, 0.0, 0.0)
        uv = pcurve.Value(sum(BRep_Tool.Range_s(shared, face)) / 2)
        tangents = GeomLProp_SLProps(BRep_Tool.Surface_s(face), uv.X(), uv.Y(), 1, CONFUSION)
        if not tangents.IsNormalDefined():
            return 0.0
        normals.append(tangents.Normal())
    angle = float(normals[0].Angle(normals[1]))
    return min(angle, np.pi - angle)


def _get_basis_surface(face: TopoDS_Face) -> Geom_Surface:
    surface = BRep_Tool.Surface_s(face)
    while isinstance(surface, Geom_RectangularTrimmedSurface):
        surface = surface.BasisSurface()
    return surface
