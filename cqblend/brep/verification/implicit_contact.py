"""How exactly the border of a surface lies on an implicit surface, and is tangent to it, measured on OCCT's surface."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from OCP.gp import gp_Pnt, gp_Vec

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array


def measure_implicit_contact(
    surface: Surface, v: float, evaluate: Callable[[Array], tuple[Array, Array]]
) -> tuple[float, float]:
    """Return the largest distance (mm), to first order, and the largest angle (rad) along the line of one v.

    ``evaluate`` returns f (n,) and its gradient (n, 3) at points (n, 3).
    """
    spline = spline_arrays.surface_from_arrays(*surface.to_bspline())
    breaks = surface.breaks[0]
    t = np.union1d(breaks, np.linspace(breaks[0], breaks[-1], VERIFICATION_TOLERANCES.surface_certificate_samples))
    points, normals = np.empty((len(t), 3)), np.empty((len(t), 3))
    for k, at in enumerate(t.tolist()):
        point, along, across = gp_Pnt(), gp_Vec(), gp_Vec()
        spline.D1(at, v, point, along, across)
        points[k], normals[k] = point.Coord(), along.Crossed(across).Coord()
    value, gradient = evaluate(points)
    size = np.linalg.norm(gradient, axis=1)
    sine = np.linalg.norm(np.cross(normals, gradient), axis=1)
    cosine = np.abs((normals * gradient).sum(axis=1))
    return float((np.abs(value) / size).max()), float(np.arctan2(sine, cosine).max())
