"""How well a blend face meets its neighbour where its rail is one point, about which it turns."""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.ShapeAnalysis import ShapeAnalysis_Surface
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.edge_sides import read_pcurve
from cqblend.brep.measurement.surface_evaluation import compute_cross_products, normalise_vectors
from cqblend.brep.topology import CONFUSION, find_end_vertices
from cqblend.splines.bernstein import Array


def measure_pole_contact(
    blend_face: TopoDS_Face, pole: TopoDS_Edge, support_face: TopoDS_Face, samples: int
) -> tuple[float, float, float]:
    """Return gap (mm), angle (rad) and jump of curvature (1/mm) between a blend face at a pole and the face beside it.

    The blend has no normal at a pole, but its sections leave it in all directions: they are to be tangent to the face,
    and to curve as it does. ``samples`` of them are looked at.
    """
    vertex = find_end_vertices(pole)[0]
    pcurve, low, high = read_pcurve(pole, blend_face)
    uv = CurveEvaluator(pcurve)(np.linspace(low, high, samples), 0)[0]
    _, su, sv, suu, svv, _ = jets = SurfaceEvaluator(BRep_Tool.Surface_s(blend_face))(uv, 2)
    across, second = (sv, svv) if np.linalg.norm(su) < np.linalg.norm(sv) else (su, suu)
    surface = BRep_Tool.Surface_s(support_face)
    foot = ShapeAnalysis_Surface(surface).ValueOfUV(BRep_Tool.Pnt_s(vertex), CONFUSION)
    support = SurfaceEvaluator(surface)(np.array([foot.Coord()]).T, 2)
    normal = normalise_vectors(compute_cross_products(support[1], support[2]))[:, 0]
    lengths = np.linalg.norm(across, axis=0)
    rs = np.linalg.lstsq(support[1:3, :, 0].T, across)[0]
    bending = _bend_surface(support[:, :, 0], rs) @ normal
    gap = np.linalg.norm(jets[0] - support[0], axis=0).max()
    angle = np.arcsin(np.clip(np.abs(normal @ across) / lengths, 0, 1)).max()
    jump = np.abs((normal @ second - bending) / lengths**2).max()
    return float(gap), float(angle), float(jump)


def _bend_surface(jet: Array, rs: Array) -> Array:
    """Return the second derivatives (n, 3) of a surface with a jet (6, 3) along directions (2, n) in its parameters."""
    r, s = rs[:, :, None]
    return np.asarray(r**2 * jet[3] + s**2 * jet[4] + 2 * r * s * jet[5])
