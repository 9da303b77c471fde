"""The edges of a blend face that are no rails, measured on the finished faces.

No validity check sees a crease or, between the parameters that it looks at, a gap.
"""

from __future__ import annotations

from typing import Protocol

from OCP.BRep import BRep_Tool

from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.edge_continuity import measure_continuity_between
from cqblend.brep.shell_editing.plan_application import BuiltEdge
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.certificate import EdgeRecord


class BlendPlace(Protocol):
    """Where in a solid a blend is: at a joint, or between the rails of a bridge.

    Numbers are those of the *input* shape; ``edge_number`` is 0 where no edge is blended.
    """

    @property
    def sides(self) -> tuple[SupportFace, SupportFace]:
        """The support faces."""

    @property
    def face_numbers(self) -> tuple[int, int]:
        """Their numbers."""

    @property
    def edge_number(self) -> int:
        """The number of the blended edge."""

    @property
    def is_closed(self) -> bool:
        """Whether the blend closes by itself."""

    def find_vertex_number(self, end: int) -> int:
        """Return the number of the vertex at the start (0) or the stop (1) of an open one."""


def certify_edge(edge: BuiltEdge, place: BlendPlace, blend_surface: SurfaceEvaluator | None = None) -> EdgeRecord:
    """Return the record of an edge of a blend; the angle there is measured where faces are to be smooth.

    ``blend_surface`` is the evaluator of the surface of the blend's face, which is the first of the two, if there is
    one already.

    Raises
    ------
    GeometryError
        If OCCT cannot evaluate a face along the edge.
    """
    tolerance = BRep_Tool.Tolerance_s(edge.sides[0][1])
    vertex = 0 if edge.end is None else place.find_vertex_number(edge.end)
    angle, curvature_jump = None, None
    if edge.kind == "seam" and BRep_Tool.Surface_s(edge.sides[0][0]).IsUPeriodic():
        angle, curvature_jump = 0.0, 0.0  # a periodic surface does not end there
    elif edge.kind in ("seam", "between"):
        first, second = edge.sides
        samples = VERIFICATION_TOLERANCES.new_edge_samples
        surfaces = (blend_surface, blend_surface if edge.kind == "seam" else None)
        measured = measure_continuity_between((first, second), samples, surfaces=surfaces)
        angle, curvature_jump = measured.angle, measured.curvature_jump
    return EdgeRecord(edge.kind, place.edge_number, vertex, edge.deviation, angle, tolerance, curvature_jump)
