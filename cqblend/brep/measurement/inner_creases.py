"""Creases inside a face: along knot lines of its surface across which the normal jumps."""

from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepTools import BRepTools
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.GeomAbs import GeomAbs_C1, GeomAbs_C3
from OCP.gp import gp_Pnt2d
from OCP.TopAbs import TopAbs_FACE, TopAbs_OUT
from OCP.TopoDS import TopoDS, TopoDS_Face

from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.edge_parameters import CLUSTER_OFFSETS
from cqblend.brep.measurement.edge_samples import compute_side_step
from cqblend.brep.measurement.edge_sides import require_shape
from cqblend.brep.measurement.knot_lines import find_knot_lines, list_inner_lines
from cqblend.brep.measurement.surface_evaluation import evaluate_face_normals, measure_angle_between


@dataclass(frozen=True)
class Crease:
    """The sharpest crease inside a face: largest angle (radians) between the one-sided normals of its surface.

    ``parameters`` (u, v) and ``point`` (x, y, z) tell where; both are None if the surface has no knot line that could
    crease.
    """

    angle: float
    parameters: tuple[float, float] | None
    point: tuple[float, float, float] | None

    def __str__(self) -> str:
        if self.parameters is None or self.point is None:
            return "no crease"
        (u, v), (x, y, z) = self.parameters, self.point
        return f"crease of {self.angle:.2g} rad at (u, v) = ({u:.6g}, {v:.6g}), ({x:.6g}, {y:.6g}, {z:.6g})"


def find_inner_crease(face: TopoDS_Face, samples: int = 101, surface: SurfaceEvaluator | None = None) -> Crease:
    """Find the sharpest crease inside a face: along knot lines across which its surface need not be C1.

    Both one-sided normals are read beside every such line, at ``samples`` points of it and beside the knots that
    cross it; what lies outside the face's boundary does not count. Seams are edges, and not measured here. ``surface``
    is the evaluator of the face's surface, if there is one already.

    Raises
    ------
    InputError
        ``face`` is not a face.
    """
    face = TopoDS.Face_s(require_shape(face, "face", TopAbs_FACE))
    surface = surface or SurfaceEvaluator(BRep_Tool.Surface_s(face))
    if not list_inner_lines(surface, GeomAbs_C1):
        return Crease(0.0, None, None)
    bounds = BRepTools.UVBounds_s(face)
    lines = find_knot_lines(surface, GeomAbs_C1, bounds)
    knots = find_knot_lines(surface, GeomAbs_C3, bounds)
    pairs = [np.empty((0, 2, 2))]
    for k, other in ((0, 1), (1, 0)):
        low, high = bounds[2 * other : 2 * other + 2]
        offset = CLUSTER_OFFSETS[0] * (high - low)
        along = np.linspace(low + offset, high - offset, samples)
        along = np.concatenate((along, (knots[other][1:-1, None] + np.array([-offset, offset])).ravel()))
        for line in lines[k][1:-1]:
            step = compute_side_step(bounds[2 * k + 1] - bounds[2 * k], line)
            pair = np.empty((along.size, 2, 2))
            pair[:, :, other] = along[:, None]
            pair[:, :, k] = line - step, line + step
            pairs.append(pair)
    uv = np.concatenate(pairs)
    if len(uv):
        boundary = BRepTopAdaptor_FClass2d(face, 1e-9)
        uv = uv[[boundary.Perform(gp_Pnt2d(*middle)) != TopAbs_OUT for middle in uv.mean(axis=1).tolist()]]
    if not len(uv):
        return Crease(0.0, None, None)
    points, normals = (array.reshape(-1, 2, 3) for array in evaluate_face_normals(face, uv.reshape(-1, 2), surface))
    angles = np.nan_to_num(measure_angle_between(normals[:, 0].T, normals[:, 1].T))
    worst = int(angles.argmax())
    u, v = uv[worst].mean(axis=0).tolist()
    x, y, z = points[worst, 0].tolist()
    return Crease(float(angles[worst]), (u, v), (x, y, z))
