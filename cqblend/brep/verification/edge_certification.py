"""The edges of a blend face that are no rails, measured on the finished faces.

No validity check sees a crease or, between the parameters that it looks at, a gap.
"""

from __future__ import annotations

from OCP.BRep import BRep_Tool

from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.edge_continuity import measure_continuity_between
from cqblend.brep.selection.joint import Joint
from cqblend.brep.shell_editing.plan_application import BuiltEdge
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.certificate import EdgeRecord


def certify_edge(edge: BuiltEdge, joint: Joint, blend_surface: SurfaceEvaluator | None = None) -> EdgeRecord:
    """Return the record of an edge of the blend of a joint; the angle there is measured where faces are to be smooth.

    ``blend_surface`` is the evaluator of the surface of the blend's face, which is the first of the two, if there is
    one already.

    Raises
    ------
    GeometryError
        If OCCT cannot evaluate a face along the edge.
    """
    tolerance = BRep_Tool.Tolerance_s(edge.sides[0][1])
    vertex = 0 if edge.end is None else joint.find_vertex_number(edge.end)
    angle = None
    if edge.kind == "seam" and BRep_Tool.Surface_s(edge.sides[0][0]).IsUPeriodic():
        angle = 0.0  # a periodic surface does not end there
    elif edge.kind in ("seam", "between"):
        first, second = edge.sides
        samples = VERIFICATION_TOLERANCES.new_edge_samples
        surfaces = (blend_surface, blend_surface if edge.kind == "seam" else None)
        angle = measure_continuity_between((first, second), samples, surfaces=surfaces).angle
    return EdgeRecord(edge.kind, joint.edge_number, vertex, edge.deviation, angle, tolerance)
