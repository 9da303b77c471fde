"""The edges of a blend face that are no rails, measured on the finished faces.

No validity check sees a crease or, between the parameters that it looks at, a gap.
"""

from __future__ import annotations

from OCP.BRep import BRep_Tool

from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.curve_deviation import measure_curve_deviation
from cqblend.brep.measurement.edge_continuity import measure_continuity_between
from cqblend.brep.measurement.edge_sides import read_pcurve
from cqblend.brep.selection.joint import Joint
from cqblend.brep.shell_editing.plan_application import BuiltEdge
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.certificate import EdgeRecord


def certify_edge(edge: BuiltEdge, joint: Joint, blend_surface: SurfaceEvaluator | None = None) -> EdgeRecord:
    """Measure an edge of the blend of a joint: its gap, and the angle there if the faces are promised to be smooth.

    ``blend_surface`` is the evaluator of the surface of the blend's face, which is the first of the two, if there is
    one already.

    Raises
    ------
    GeometryError
        If OCCT cannot evaluate a face along the edge.
    """
    gap = max(measure_curve_deviation(use, face) for face, use in edge.sides)
    tolerance = BRep_Tool.Tolerance_s(edge.sides[0][1])
    if edge.kind == "end":
        return EdgeRecord("end", joint.edge_number, joint.find_vertex_number(_find_end(edge)), gap, None, tolerance)
    surfaces = (blend_surface, blend_surface if edge.kind == "seam" else None)
    angle = measure_continuity_between(edge.sides, VERIFICATION_TOLERANCES.new_edge_samples, surfaces=surfaces).angle
    return EdgeRecord(edge.kind, joint.edge_number, 0, gap, angle, tolerance)


def _find_end(edge: BuiltEdge) -> int:
    """Return which end of the spine an end edge is at: 0 its start, 1 its end, by u in the middle of the edge."""
    blend_face, use = edge.sides[0]
    pcurve, first, last = read_pcurve(use, blend_face)
    low, high, _, _ = BRep_Tool.Surface_s(blend_face).Bounds()
    return int(2 * pcurve.Value((first + last) / 2).X() > low + high)
