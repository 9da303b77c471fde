"""Folds of a face over itself, found from normals that flip between neighbouring points."""

import math

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepTools import BRepTools
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.GeomAbs import GeomAbs_C3
from OCP.gp import gp_Pnt2d
from OCP.TopAbs import TopAbs_OUT
from OCP.TopoDS import TopoDS_Face

from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.knot_lines import find_knot_lines
from cqblend.brep.measurement.surface_evaluation import evaluate_face_normals
from cqblend.splines.bernstein import Array


def find_folds(face: TopoDS_Face) -> list[str]:
    """Return a line if a face folds over itself.

    Its normals at neighbouring points of a grid point apart, and so do those at two neighbours of nine points in
    between: the normal flips, rather than turns fast.
    """
    surface = SurfaceEvaluator(BRep_Tool.Surface_s(face))
    lines = find_knot_lines(surface, GeomAbs_C3, BRepTools.UVBounds_s(face))
    uv = np.stack(np.meshgrid(*(_sample_intervals(ends) for ends in lines), indexing="ij"), axis=-1)
    _, normals = evaluate_face_normals(face, uv.reshape(-1, 2), surface)
    normals = normals.reshape(*uv.shape[:2], 3)
    pairs = np.concatenate(
        [_find_opposed_normals(uv, normals), _find_opposed_normals(uv.swapaxes(0, 1), normals.swapaxes(0, 1))]
    )
    if not len(pairs):
        return []
    boundary = BRepTopAdaptor_FClass2d(face, 1e-9)
    within = [all(boundary.Perform(gp_Pnt2d(*end)) != TopAbs_OUT for end in pair) for pair in pairs.tolist()]
    first, last = pairs[within][:, :1], pairs[within][:, 1:]
    path = first + np.linspace(0.0, 1.0, 9)[:, None] * (last - first)
    found = evaluate_face_normals(face, path.reshape(-1, 2), surface)
    points, normals = (array.reshape(*path.shape[:2], 3) for array in found)
    flips = np.argwhere(np.einsum("ijk,ijk->ij", normals[:, 1:], normals[:, :-1]) < 0.0)
    if not len(flips):
        return []
    x, y, z = points[tuple(flips[0])].tolist()
    return [f"a face folds over near ({x:.4g}, {y:.4g}, {z:.4g}): its normal flips"]


def _find_opposed_normals(uv: Array, normals: Array) -> Array:
    """Return the parameters (n, 2, 2) of neighbours along the first axis whose normals are more than pi / 2 apart."""
    apart = np.einsum("ijk,ijk->ij", normals[1:], normals[:-1]) < 0.0
    return np.stack((uv[:-1][apart], uv[1:][apart]), axis=1)


def _sample_intervals(ends: Array) -> Array:
    """Return parameters inside intervals, equally many in each, about 25 to 129 in all.

    They stand at odd shares of an interval (0.41 of a step), as folds at its ends or in its middle have no normal.
    """
    count = ends.size - 1
    each = max(1, min(math.ceil(25 / count), 129 // count))
    inner = (ends[:-1, None] + np.diff(ends)[:, None] * ((np.arange(each) + 0.41) / each)).ravel()
    return np.asarray(inner[:: math.ceil(inner.size / 129)])
