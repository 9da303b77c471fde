"""How far the curves of an edge lie apart, and the tolerance that says so.

A STEP reader gives an edge the deviation of its curve and parameter curves at 23 parameters, and ordinary ``BRepCheck``
looks at the same 23; between them they may part by a thousand times as much. Cut such an edge, and it is looked at
elsewhere: a body that was valid no longer is, through no fault of the cut. So every edge that surgery makes or cuts is
measured along its whole length, by OCCT's own search for the largest deviation, and gets the tolerance that it needs.
"""

from __future__ import annotations

from collections.abc import Iterable

from OCP.Adaptor3d import Adaptor3d_CurveOnSurface
from OCP.BRep import BRep_Tool
from OCP.BRepLib import BRepLib_ValidateEdge
from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
from OCP.GeomAdaptor import GeomAdaptor_Curve, GeomAdaptor_Surface
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from cqblend.errors import GeometryError
from cqblend.occ.topology import BUILDER, Index, ends, explore, loosen

MARGIN = 1.05  # of a measured deviation: the least tolerance that surely covers it


def deviation(use: TopoDS_Edge, face: TopoDS_Face) -> float:
    """Return the largest distance (mm) between an edge's curve and the image of its parameter curve on a face.

    Both at the same parameter, if the edge claims as much, along all of the edge. The orientation of the use tells the
    two sides of a seam apart. 0 of a degenerate edge.

    Raises
    ------
    GeometryError
        If the edge has no parameter curve on the face, or OCCT cannot compare them.
    """
    curve, pcurve = BRep_Tool.Curve_s(use, 0.0, 0.0), BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0)
    if BRep_Tool.Degenerated_s(use) or curve is None:
        return 0.0
    if pcurve is None:
        raise GeometryError("an edge has no curve in the parameters of its face: repair the shape first (ShapeFix)")
    on_face = Adaptor3d_CurveOnSurface(
        Geom2dAdaptor_Curve(pcurve, *BRep_Tool.Range_s(use, face)), GeomAdaptor_Surface(BRep_Tool.Surface_s(face))
    )
    search = BRepLib_ValidateEdge(
        GeomAdaptor_Curve(curve, *BRep_Tool.Range_s(use)), on_face, BRep_Tool.SameParameter_s(use)
    )
    search.SetExactMethod(True)
    search.Process()
    if not search.IsDone():
        raise GeometryError("OCCT cannot tell how far an edge lies from its curve on a face")
    return float(search.GetMaxDistance())


def settle(faces: Iterable[TopoDS_Face], edges: Index, vertices: Index) -> float:
    """Raise the tolerance of every edge of faces that is not among the input's ``edges`` to what its curves need.

    New vertices follow. Edges and vertices of the input are shared with it, and stay as they are. Returns the largest
    tolerance of an edge that is not the input's (mm).
    """
    largest = 0.0
    for face in faces:
        for use in explore(face, TopAbs_EDGE):
            if edges.of(use):
                continue
            needed = MARGIN * deviation(use, face)
            if needed > BRep_Tool.Tolerance_s(use):
                BUILDER.UpdateEdge(use, needed)
            largest = max(largest, BRep_Tool.Tolerance_s(use))
            for vertex in ends(use):
                if not vertices.of(vertex):
                    loosen(vertex, BRep_Tool.Tolerance_s(use))
    return largest
