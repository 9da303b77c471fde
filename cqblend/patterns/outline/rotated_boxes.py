"""Bounding boxes of turned point sets: finds the angle at which a piece lies flattest, or fits a sheet.

Both placing pieces and cutting them to size need it. Depends on paths only.
"""

from collections.abc import Sequence

import numpy as np
import shapely

from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.outline.tolerances import OUTLINE_TOLERANCES
from cqblend.splines.bernstein import Array

TRIED_DIRECTIONS = 180
"""How many angles, evenly spread over half a turn, are tried besides those of the edges of the convex hull."""


def find_convex_hull(paths: Sequence[Path], tolerance: float) -> Array:
    """Return the convex hull (m, 2) of paths, their arcs replaced by polygons within a tolerance."""
    points = np.concatenate([path.sampled(tolerance) for path in paths])
    return np.unique(shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(points))), axis=0)


def measure_rotated_extents(points: Array, turns: Array) -> Array:
    """Return width and height (k, 2) of points (m, 2) that are turned by angles (k,), rad."""
    cos, sin = np.cos(turns)[:, None], np.sin(turns)[:, None]
    x, y = points.T
    return np.stack([np.ptp(cos * x - sin * y, axis=1), np.ptp(sin * x + cos * y, axis=1)], axis=1)


def find_flattest_angle(points: Array) -> float:
    """Return the angle (rad) by which points are turned so that their box is least high: an edge of the hull lies flat.

    Examples
    --------
    >>> round(find_flattest_angle(np.array([[0.0, 0.0], [0.0, 3.0], [1.0, 3.0], [1.0, 0.0]])) / np.pi, 6)
    -0.5
    """
    turns = _list_edge_angles(points)
    return float(turns[measure_rotated_extents(points, turns)[:, 1].argmin()])


def find_fitting_angle(points: Array, size: tuple[float, float]) -> float | None:
    """Return an angle (rad) by which points are turned to fit a size, the flattest box first; None if none is found."""
    flattest = find_flattest_angle(points)
    evenly_spread = np.arange(TRIED_DIRECTIONS) * np.pi / TRIED_DIRECTIONS
    turns = np.concatenate([[flattest, flattest + np.pi / 2], _list_edge_angles(points), evenly_spread])
    allowed = np.asarray(size) * (1 + OUTLINE_TOLERANCES.rounding_of_boxes)
    fits = (measure_rotated_extents(points, turns) <= allowed).all(axis=1)
    return float(turns[fits.argmax()]) if fits.any() else None


def _list_edge_angles(points: Array) -> Array:
    """Return the angles that lay an edge of the convex hull along the x axis; 0 if it has none."""
    border = shapely.get_coordinates(shapely.convex_hull(shapely.multipoints(points)))
    edges = np.diff(border, axis=0)
    return -np.arctan2(edges[:, 1], edges[:, 0]) if len(edges) else np.zeros(1)
