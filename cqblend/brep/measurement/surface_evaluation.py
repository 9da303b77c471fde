"""Normals, curvatures and angles of OCCT's surfaces, from jets that are evaluated in bulk.

Nothing here uses cqblend's own evaluation of splines: certificates are measured with these functions.
"""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Face

from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.tolerances import MEASURE_TOLERANCES
from cqblend.splines.bernstein import Array


def evaluate_face_normals(face: TopoDS_Face, uv: Array, surface: SurfaceEvaluator | None = None) -> tuple[Array, Array]:
    """Return points and outward unit normals (n, 3) of a face at parameters (n, 2); normals are nan where degenerate.

    ``surface`` is the evaluator of the face's surface, if there is one already.

    Raises
    ------
    GeometryError
        OCCT cannot evaluate the surface.
    """
    points, su, sv = (surface or SurfaceEvaluator(BRep_Tool.Surface_s(face)))(uv, 1)
    normals = normalise_rows(compute_cross_products(su, sv))
    return points, -normals if face.Orientation() == TopAbs_REVERSED else normals


def compute_cross_products(a: Array, b: Array) -> Array:
    """Return the cross products of vectors (n, 3), in a third of the time of ``numpy.cross``."""
    products = np.empty((3, len(a)))
    np.subtract(a[:, 1] * b[:, 2], a[:, 2] * b[:, 1], out=products[0])
    np.subtract(a[:, 2] * b[:, 0], a[:, 0] * b[:, 2], out=products[1])
    np.subtract(a[:, 0] * b[:, 1], a[:, 1] * b[:, 0], out=products[2])
    return products.T


def compute_dot_products(a: Array, b: Array) -> Array:
    """Return the dot products (n,) of vectors (n, 3)."""
    return np.asarray(a[:, 0] * b[:, 0] + a[:, 1] * b[:, 1] + a[:, 2] * b[:, 2])


def measure_lengths(vectors: Array) -> Array:
    """Return the lengths (n,) of vectors (n, 3)."""
    return np.asarray(np.sqrt(compute_dot_products(vectors, vectors)))


def normalise_rows(vectors: Array) -> Array:
    """Return unit vectors; nan for vectors that are so short beside the longest that they may be rounding."""
    size = measure_lengths(vectors)
    is_sound = size > MEASURE_TOLERANCES.degenerate_ratio * np.fmax.reduce(size, initial=0.0)
    return np.asarray(vectors / np.where(is_sound, size, np.nan)[:, None])


def measure_angle_between(a: Array, b: Array) -> Array:
    """Angles between vectors, ``atan2(|a x b|, a.b)``: exact to rounding also near 0 and pi, unlike arccos."""
    return np.asarray(np.arctan2(measure_lengths(compute_cross_products(a, b)), compute_dot_products(a, b)))
