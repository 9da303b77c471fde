"""A shape sent through a STEP file and measured again."""

import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SHELL
from OCP.TopoDS import TopoDS_Edge, TopoDS_Shape

from cqblend.brep.measurement.edge_sides import get_two_sides
from cqblend.brep.step_files import read_step, write_step
from cqblend.brep.topology import AncestorMap, ShapeIndex
from cqblend.brep.verification.brep_check import is_valid
from cqblend.brep.verification.content import Content
from cqblend.brep.verification.smooth_edges import EdgeCheck, analyse_continuity
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.errors import CqblendError


@dataclass(frozen=True)
class StepCheck:
    """The solid after a round trip through STEP.

    ``faces`` is their number, ``volume`` in mm^3, ``mismatch`` is relative to the volume before; ``gap`` (mm) and
    ``angle`` (radians) are the largest over the edges that were smooth before. The volume of shells that bound no solid
    is that between them and some plane.
    """

    valid: bool
    faces: int
    volume: float
    mismatch: float
    gap: float
    angle: float


def check_step(shape: TopoDS_Shape, edges: list[EdgeCheck], content: Content) -> tuple[StepCheck | None, list[str]]:
    """Send a shape through a STEP file and measure it again.

    ``content`` is that of the shape. Returns the measurements, None if the file cannot be written or read, and one line
    for everything that is wrong. Edges of loose faces are not measured: STEP has each of these for itself.
    """
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "verify.step"
            write_step(shape, path)
            again = read_step(path)
    except CqblendError as failure:
        return None, [f"the shape does not survive STEP: {failure}"]
    volume, error = content.measure(again)
    in_shells = ShapeIndex.from_shapes(ShapeIndex(shape, TopAbs_SHELL), TopAbs_EDGE)
    numbered = ShapeIndex(shape, TopAbs_EDGE)
    smooth = [edge for edge in edges if edge.smooth and numbered[edge.index] in in_shells]
    counts = [len(ShapeIndex(one, TopAbs_FACE)) for one in (shape, again)]
    gap, angle, lines = _remeasure_edges(shape, again, smooth)
    valid = is_valid(again)
    if not valid:
        lines.append("the shape read back from STEP is not valid")
    if content.differs(volume, error):
        lines.append(f"the volume read back from STEP is {volume:.9g} mm^3 instead of {content.whole:.9g}")
    if counts[0] != counts[1]:
        lines.append(f"{counts[1]} faces are read back from STEP instead of {counts[0]}")
    return StepCheck(valid, counts[1], volume, content.measure_mismatch(volume), gap, angle), lines


def _remeasure_edges(
    shape: TopoDS_Shape, again: TopoDS_Shape, smooth: list[EdgeCheck]
) -> tuple[float, float, list[str]]:
    """Find the smooth edges, by their middles, in the shape read back, and measure them there.

    Returns the largest gap and angle, and one line for every edge that is lost or worse than before.
    """
    before = list(ShapeIndex(shape, TopAbs_EDGE))
    after = [edge for edge in ShapeIndex(again, TopAbs_EDGE) if not BRep_Tool.Degenerated_s(edge)]
    middles = np.array([_evaluate_edge_middle(edge) for edge in after]).reshape(-1, 3)
    faces_of = AncestorMap(again, TopAbs_EDGE, TopAbs_FACE)
    gap = angle = 0.0
    lines = []
    for check in smooth:
        edge = before[check.index - 1]
        distances = np.linalg.norm(middles - _evaluate_edge_middle(edge), axis=1)
        near = int(distances.argmin()) if distances.size else -1
        sides = (
            get_two_sides(after[near], faces_of)
            if near >= 0 and distances[near] <= 10 * BRep_Tool.Tolerance_s(edge)
            else None
        )
        if sides is None:
            lines.append(f"edge {check.index} is not read back from STEP with two faces")
            continue
        gap_again, angle_again, _ = analyse_continuity(sides)
        if (
            gap_again > 1.1 * check.gap + VERIFICATION_TOLERANCES.step_deviation
            or angle_again > 1.1 * check.angle + VERIFICATION_TOLERANCES.step_deviation
        ):
            lines.append(
                f"edge {check.index} comes back from STEP with gap {gap_again:.2g} mm and angle {angle_again:.2g} rad "
                f"instead of {check.gap:.2g} and {check.angle:.2g}"
            )
        gap, angle = max(gap, gap_again), max(angle, angle_again)
    return gap, angle, lines


def _evaluate_edge_middle(edge: TopoDS_Edge) -> tuple[float, float, float]:
    """Return the point in the middle of an edge's parameters."""
    curve = BRepAdaptor_Curve(edge)
    x, y, z = curve.Value((curve.FirstParameter() + curve.LastParameter()) / 2).Coord()
    return x, y, z
