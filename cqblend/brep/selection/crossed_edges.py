"""Finds and reads the smooth edges that the rails of a chain cross, as curves on the surfaces on both sides."""

from __future__ import annotations

from OCP.BRep import BRep_Tool
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from cqblend.blends.network.junction_stations import CrossedEdge, Crossings, CurveOnSurface
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.measurement.edge_samples import read_edge_curve
from cqblend.brep.measurement.edge_sides import read_pcurve
from cqblend.brep.selection.chains import Junction
from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.topology import ShapeIndex, is_among, make_vertex, orient_forward
from cqblend.splines.bernstein import Array


def read_crossings(before: Joint, after: Joint, junction: Junction) -> Crossings:
    """Return the smooth edges that the rails cross at a junction of two cells, one on either side at most."""
    first, second = (
        _read_crossed_edge(crossed[0], one, other) if crossed else None
        for crossed, one, other in zip(junction.crossed, before.sides, after.sides, strict=True)
    )
    return first, second


def find_smooth_edge(index: SolidIndex, faces: tuple[TopoDS_Face, TopoDS_Face], near: Array) -> TopoDS_Edge | None:
    """Return the edge at which two faces go on smoothly in each other that is nearest to a point (3,)."""
    shared = [edge for edge in ShapeIndex(faces[0], TopAbs_EDGE) if is_among(faces[1], index.faces_at_edge(edge))]
    angles = map(index.measure_dihedral_angles, shared)
    smooth = [edge for edge, found in zip(shared, angles, strict=True) if found is not None and found.is_smooth]
    vertex = make_vertex(near)
    return min(smooth, key=lambda edge: BRepExtrema_DistShapeShape(vertex, edge).Value(), default=None)


def _read_crossed_edge(edge: TopoDS_Edge, before: SupportFace, after: SupportFace) -> CrossedEdge:
    """Return an edge on the surfaces of the two faces that meet there."""
    return CrossedEdge(_read_curve(edge, before), _read_curve(edge, after), BRep_Tool.Range_s(edge))


def _read_curve(edge: TopoDS_Edge, side: SupportFace) -> CurveOnSurface:
    """Return an edge of a face in the parameters on which rails are solved, with its velocity in space."""
    curve, pcurve = read_edge_curve(edge), CurveEvaluator(read_pcurve(orient_forward(edge), side.face)[0])

    def evaluate(sigma: Array) -> tuple[Array, Array]:
        return side.to_working_parameters(pcurve(sigma, 0)[0].T), curve(sigma, 1)[1].T

    return evaluate
