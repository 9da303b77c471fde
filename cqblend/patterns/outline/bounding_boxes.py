"""The boxes around a piece, turned any way: which is least, and whether one fits a sheet.

Exists because both placing pieces and cutting them to size ask for it. Must not know pieces.
"""

from collections.abc import Sequence

import numpy as np
import shapely

from cqblend.patterns.outline.plane_path import Path
from cqblend.splines.bernstein import Array

TRIED_DIRECTIONS = 180
"""Directions that are tried besides those of the hull's edges."""


def find_convex_hull(paths: Sequence[Path], tolerance: float) -> Array:
    """Return the convex hull (m, 2) of paths, their arcs replaced by polygons within a tolerance."""
    points = np.concatenate([path.sampled(tolerance) for path in paths])
    return np.unique(shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(points))), axis=0)


def measure_rotated_extents(points: Array, turns: Array) -> Array:
    """Return width and height (k, 2) of points (m, 2) that are turned by angles (k,)."""
    cos, sin = np.cos(turns)[:, None], np.sin(turns)[:, None]
    x, y = points.T
    return np.stack([np.ptp(cos * x - sin * y, axis=1), np.ptp(sin * x + cos * y, axis=1)], axis=1)


def find_flattest_angle(points: Array) -> float:
    """Return the angle by which points are turned so that their box is least high: an edge of the hull lies flat.

    Examples
    --------
    >>> round(least_turn(np.array([[0.0, 0.0], [0.0, 3.0], [1.0, 3.0], [1.0, 0.0]])) / np.pi, 6)
    -0.5
    """
    turns = _list_edge_angles(points)
    return float(turns[measure_rotated_extents(points, turns)[:, 1].argmin()])


def find_fitting_angle(points: Array, size: tuple[float, float]) -> float | None:
    """Return an angle by which points are turned to fit a size, the least high box first; None if none is found."""
    least = find_flattest_angle(points)
    turns = np.concatenate(
        [[least, least + np.pi / 2], _list_edge_angles(points), np.arange(TRIED_DIRECTIONS) * np.pi / TRIED_DIRECTIONS]
    )
    fits = (measure_rotated_extents(points, turns) <= np.asarray(size) * (1 + 1e-12)).all(axis=1)
    return float(turns[fits.argmax()]) if fits.any() else None


def _list_edge_angles(points: Array) -> Array:
    """Return the angles that lay an edge of the convex hull along the x axis; 0 if it has none."""
    border = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(points)))
    edges = np.diff(border, axis=0)
    return -np.arctan2(edges[:, 1], edges[:, 0]) if len(edges) else np.zeros(1)
