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
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.splines.bernstein import Array


def find_folds(face: TopoDS_Face) -> list[str]:
    """Return a line if a face folds over itself.

    Its normals at neighbouring points of a grid point apart, or of a finer one around the shortest |Su x Sv|, and so
    do those at two neighbours of nine points in between (of the finer one, of three): the normal flips, rather than
    turns fast.
    """
    surface = SurfaceEvaluator(BRep_Tool.Surface_s(face))
    lines = find_knot_lines(surface, GeomAbs_C3, BRepTools.UVBounds_s(face))
    most = VERIFICATION_TOLERANCES.fold_samples[min(len(ends) for ends in lines) > VERIFICATION_TOLERANCES.few_spans]
    u, v = (_sample_intervals(ends, most) for ends in lines)
    pairs, sizes = _compare_normals(face, surface, u, v)
    between = 9
    i, j = map(int, np.unravel_index(np.nanargmin(sizes), sizes.shape))
    if not len(pairs) and sizes[i, j] < VERIFICATION_TOLERANCES.short_normal * np.median(sizes[~np.isnan(sizes)]):
        near_u, near_v = (
            np.linspace(t[max(k - 2, 0)], t[min(k + 2, len(t) - 1)], count)
            for t, k, count in zip((u, v), (i, j), VERIFICATION_TOLERANCES.samples_near_short_normal, strict=True)
        )
        pairs, _ = _compare_normals(face, surface, near_u, near_v)
        between = 3
    if not len(pairs):
        return []
    boundary = BRepTopAdaptor_FClass2d(face, 1e-9)
    within = [all(boundary.Perform(gp_Pnt2d(*end)) != TopAbs_OUT for end in pair) for pair in pairs.tolist()]
    first, last = pairs[within][:, :1], pairs[within][:, 1:]
    path = first + np.linspace(0.0, 1.0, between)[:, None] * (last - first)
    found = evaluate_face_normals(face, path.reshape(-1, 2), surface)
    points, normals = (array.reshape(*path.shape[:2], 3) for array in found)
    flips = np.argwhere(np.einsum("ijk,ijk->ij", normals[:, 1:], normals[:, :-1]) < 0.0)
    if not len(flips):
        return []
    x, y, z = points[tuple(flips[0])].tolist()
    return [f"a face folds over near ({x:.4g}, {y:.4g}, {z:.4g}): its normal flips"]


def _compare_normals(face: TopoDS_Face, surface: SurfaceEvaluator, u: Array, v: Array) -> tuple[Array, Array]:
    """Compare normals at all pairs of parameters u (n,) and v (m,).

    Returns the parameters (k, 2, 2) of neighbours whose normals are more than pi / 2 apart, and sizes of |Su x Sv|
    (n, m), which are nearly 0 somewhere near a fold; nan where there is no normal.
    """
    if surface.spline is not None and not any(surface.spline.is_periodic):
        normals = surface.spline.compute_normals_on_grid(u, v)
    else:
        uv = np.stack(np.meshgrid(u, v, indexing="ij"), axis=-1).reshape(-1, 2)
        normals = evaluate_face_normals(face, uv, surface)[1].T.reshape(3, len(u), len(v))
    along = np.argwhere((normals[:, 1:] * normals[:, :-1]).sum(axis=0) < 0.0)
    across = np.argwhere((normals[:, :, 1:] * normals[:, :, :-1]).sum(axis=0) < 0.0)
    first = np.concatenate((along, across))
    last = np.concatenate((along + np.array([1, 0]), across + np.array([0, 1])))
    pairs = np.stack([np.stack((u[ends[:, 0]], v[ends[:, 1]]), axis=-1) for ends in (first, last)], axis=1)
    return pairs, np.sqrt((normals * normals).sum(axis=0))


def _sample_intervals(ends: Array, most: int) -> Array:
    """Return parameters inside intervals, equally many in each, from about 25 up to a number in all.

    They stand at odd shares of an interval (0.41 of a step), as folds at its ends or in its middle have no normal.
    """
    count = ends.size - 1
    each = max(1, min(max(math.ceil(25 / count), VERIFICATION_TOLERANCES.normals_per_span), most // count))
    inner = (ends[:-1, None] + np.diff(ends)[:, None] * ((np.arange(each) + 0.41) / each)).ravel()
    return np.asarray(inner[:: math.ceil(inner.size / most)])
