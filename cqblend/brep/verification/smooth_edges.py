"""Edges that a shape flags as smooth, measured by OCCT's own analysis of continuity."""

from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.GeomAbs import GeomAbs_C0, GeomAbs_G1
from OCP.LocalAnalysis import LocalAnalysis_SurfaceContinuity
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from cqblend.brep.measurement.edge_samples import SideSampler, choose_sample_parameters, read_edge_curve
from cqblend.brep.measurement.edge_sides import EdgeSide, get_two_sides
from cqblend.brep.topology import AncestorMap, ShapeIndex, make_compound
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES

_ANALYSIS_EPSILONS = (VERIFICATION_TOLERANCES.analysis_epsilon,) * 5
"""Null vector, C0, C1, C2, G1."""


@dataclass(frozen=True)
class EdgeCheck:
    """An edge as OCCT's ``LocalAnalysis_SurfaceContinuity`` sees it.

    Attributes
    ----------
    index : int
        Number of the edge in the shape's edge map (``TopExp.MapShapes``), from 1.
    smooth : bool
        Whether the shape promises a smooth joint: the edge is flagged at least G1.
    gap : float
        Largest ``C0Value``, mm.
    angle : float
        Largest ``G1Angle``, radians; orientation does not count.
    """

    index: int
    smooth: bool
    gap: float
    angle: float

    def __str__(self) -> str:
        kind = "smooth" if self.smooth else "end   "
        return f"edge {self.index:<5d} {kind}  gap {self.gap:.1e} mm  angle {self.angle:.1e} rad"


def check_edges(
    shape: TopoDS_Shape, faces: list[TopoDS_Face], *, everything: bool, angular_tolerance: float
) -> tuple[list[EdgeCheck], list[str]]:
    """Measure the edges of some faces that are flagged smooth, or everything that they share with another face.

    Returns the measurements, and one line for everything that is wrong.
    """
    index = ShapeIndex(shape, TopAbs_EDGE)
    faces_of = AncestorMap(shape, TopAbs_EDGE, TopAbs_FACE)
    checks, lines = [], []
    for edge in ShapeIndex(make_compound(faces), TopAbs_EDGE):
        sides = get_two_sides(edge, faces_of)
        if sides is None:
            continue
        smooth = BRep_Tool.Continuity_s(edge, sides[0][0], sides[1][0]) != GeomAbs_C0
        if not smooth and (not everything or sides[0][0].IsSame(sides[1][0])):
            continue
        gap, angle, folded = analyse_continuity(sides)
        check = EdgeCheck(index.find_number(edge), smooth, gap, angle)
        checks.append(check)
        tolerance = BRep_Tool.Tolerance_s(edge)
        if gap > 2 * tolerance:
            lines.append(f"edge {check.index}: its faces are {gap:.2g} mm apart, its tolerance is {tolerance:.2g} mm")
        if smooth and angle > angular_tolerance:
            lines.append(f"edge {check.index} is flagged smooth, but its faces meet at {angle:.2g} rad")
        elif smooth and folded:
            lines.append(f"edge {check.index} is flagged smooth, but its faces fold back on each other")
    return checks, lines


def analyse_continuity(sides: tuple[EdgeSide, EdgeSide]) -> tuple[float, float, bool]:
    """Return OCCT's largest gap and angle along an edge, and whether the outward normals ever point apart.

    Angles do not count next to poles, where those of OCCT are rounding.
    """
    first, second = (SideSampler(side) for side in sides)
    curve = read_edge_curve(sides[0][1])
    ts = choose_sample_parameters((first, second), curve, VERIFICATION_TOLERANCES.analysis_samples)
    one, two = first.sample(ts), second.sample(ts)
    gap = angle = 0.0
    known = np.isfinite(one.normals + two.normals).all(axis=0).tolist()
    pairs = zip(one.parameters.T.tolist(), two.parameters.T.tolist(), known, strict=True)
    for (u1, v1), (u2, v2), has_normals in pairs:
        local = LocalAnalysis_SurfaceContinuity(
            first.surface.surface, u1, v1, second.surface.surface, u2, v2, GeomAbs_G1, *_ANALYSIS_EPSILONS
        )
        if local.IsDone():
            gap, angle = max(gap, local.C0Value()), max(angle, local.G1Angle() if has_normals else 0.0)
    return gap, angle, bool((np.einsum("in,in->n", one.normals, two.normals) < 0.0).any())
