"""Volumes of prisms with mitred edges, by integrals over their depth."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np


def integrate_insets(outline: Sequence[tuple[float, float]], radii: Sequence[float]) -> float:
    """Return by how much the area of an outline shrinks, integrated over the depth, if edges are rounded by radii.

    Edge k runs from corner k to the next one, counter-clockwise. At depth z, it is moved inside by what an arc of its
    radius takes away there, and neighbours meet where their lines cross: which is what a mitre is, at convex corners
    and at reflex ones.
    """
    corners = np.array(outline)
    rates = np.roll(corners, -1, axis=0) - corners
    normals = np.stack([-rates[:, 1], rates[:, 0]], axis=1) / np.linalg.norm(rates, axis=1, keepdims=True)
    heights = (normals * corners).sum(axis=1)
    sizes = np.array(radii)

    def measure_area(depth: float) -> float:
        below = np.clip(sizes - depth, 0.0, None)
        moved = heights + sizes - np.sqrt(sizes**2 - below**2)
        points = np.array([np.linalg.solve(normals[[k - 1, k]], moved[[k - 1, k]]) for k in range(len(corners))])
        x, y = points.T
        return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2

    whole = measure_area(float(sizes.max()))
    return integrate_by_angle(lambda depth: whole - measure_area(depth), np.unique(sizes))


def integrate_by_angle(function: Callable[[float], float], stops: Sequence[float]) -> float:
    """Integrate a function from 0 to the last of some stops that behaves like a root at 0 and at each of them."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    total = 0.0
    for low, high in zip([0.0, *stops[:-1]], stops, strict=True):
        angle = (nodes + 1) * np.pi / 2
        depths = (low + high) / 2 - (high - low) / 2 * np.cos(angle)
        values = np.array([function(depth) for depth in depths.tolist()])
        total += float((weights * values * np.sin(angle)).sum()) * (high - low) / 2 * np.pi / 2
    return total
