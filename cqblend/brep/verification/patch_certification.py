"""The certificate of a face of a corner: its edges beside other such faces and beside neighbours, and its inside."""

from __future__ import annotations

from dataclasses import dataclass

from OCP.BRep import BRep_Tool
from OCP.TopoDS import TopoDS_Face

from cqblend.brep.measurement.edge_continuity import measure_continuity_between
from cqblend.brep.measurement.inner_creases import find_inner_crease
from cqblend.brep.selection.joint import Joint
from cqblend.brep.shell_editing.plan_application import BuiltPatch
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.certificate import EdgeRecord


@dataclass(frozen=True)
class CertifiedPatch:
    """A face of a corner in a verified solid, the records of its edges that bound no strip, and its inner crease (rad).

    Those between two faces of a corner are recorded with one of them only.
    """

    face: TopoDS_Face
    edges: tuple[EdgeRecord, ...]
    inner_crease: float


def certify_patch(joint: Joint, patch: BuiltPatch) -> CertifiedPatch:
    """Measure a face of a corner; ``joint`` is one of those that are blended there.

    Raises
    ------
    GeometryError
        If OCCT cannot evaluate a face along an edge.
    """
    ends = [joint.index.vertices.find_number(vertex) for vertex in joint.spine.vertices]
    vertex = joint.find_vertex_number(ends.index(patch.plan.vertex))
    samples = VERIFICATION_TOLERANCES.new_edge_samples
    records = []
    for edge in patch.edges:
        measured = measure_continuity_between((edge.sides[0], edge.sides[1]), samples)
        tolerance = BRep_Tool.Tolerance_s(edge.sides[0][1])
        figures = (edge.deviation, measured.angle, tolerance, measured.curvature_jump)
        records.append(EdgeRecord(edge.kind, joint.edge_number, vertex, *figures))
    return CertifiedPatch(patch.face, tuple(records), find_inner_crease(patch.face).angle)
