"""The edges of a blend face that are no rails, measured on the finished faces.

No validity check sees a crease or, between the parameters that it looks at, a gap.
"""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Tool

from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.curve_deviation import measure_curve_deviation
from cqblend.brep.measurement.edge_continuity import measure_continuity_between
from cqblend.brep.measurement.edge_samples import SideSampler
from cqblend.brep.selection.joint import Joint
from cqblend.brep.shell_editing.plan_application import BuiltEdge
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.certificate import EdgeRecord


def certify_edge(edge: BuiltEdge, joint: Joint) -> EdgeRecord:
    """Measure an edge of the blend of a joint: its gap, and the angle there if the faces are promised to be smooth.

    Raises
    ------
    GeometryError
        If OCCT cannot evaluate a face along the edge.
    """
    gap = max(measure_curve_deviation(use, face) for face, use in edge.sides)
    tolerance = BRep_Tool.Tolerance_s(edge.sides[0][1])
    if edge.kind == "end":
        return EdgeRecord("end", joint.edge_number, joint.find_vertex_number(_find_end(edge)), gap, None, tolerance)
    angle = measure_continuity_between(edge.sides, VERIFICATION_TOLERANCES.new_edge_samples).angle
    return EdgeRecord(edge.kind, joint.edge_number, 0, gap, angle, tolerance)


def _find_end(edge: BuiltEdge) -> int:
    """Return which end of the spine an end edge is at: 0 its start, 1 its end, by u in the middle of the edge."""
    blend_face, use = edge.sides[0]
    surface = SurfaceEvaluator(BRep_Tool.Surface_s(blend_face))
    middle = SideSampler(edge.sides[0], surface).sample(np.array([sum(BRep_Tool.Range_s(use)) / 2]))
    low, high, _, _ = surface.surface.Bounds()
    return int(2 * middle.parameters[0, 0] > low + high)
