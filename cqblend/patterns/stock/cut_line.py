"""The straight line along which a piece is cut: sides of points, and crossings with segments and arcs.

Depends on outlines only.
"""

import numpy as np

from cqblend.errors import GeometryError, InputError
from cqblend.patterns.outline.path_by_length import PathByLength
from cqblend.patterns.outline.pieces import Piece
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.stock_proportions import CUTTING_LIMITS
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import bisect_interval


class CutLine:
    """A line that cuts a piece.

    Attributes
    ----------
    piece
        The piece that is cut.
    foot, direction, left
        (2,): a point on the line, and unit vectors along it and to the left of it.
    clearance
        Least distance of the line from vertices, and from points of arcs where these are parallel to it, mm.
    """

    def __init__(self, piece: Piece, points: Array) -> None:
        points = np.asarray(points, dtype=np.float64)
        if points.shape != (2, 2) or not np.isfinite(points).all() or (points[0] == points[1]).all():
            raise InputError(f"piece {piece.name} is cut along a line through two different points (2, 2)")
        self.piece = piece
        self.foot = points[0]
        self.direction = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
        self.left = np.array([-self.direction[1], self.direction[0]])
        vertices = np.concatenate([path.points for path in piece.outlines])
        self.clearance = CUTTING_LIMITS.vertex_clearance * float(np.linalg.norm(np.ptp(vertices, axis=0)))

    def signed_distances(self, points: Array) -> Array:
        """Return the distances of points (..., 2) from the line, mm, positive to the left."""
        return (points - self.foot) @ self.left

    def side_of(self, point: Array) -> int:
        """Return 1 for a point to the left of the line, -1 to the right."""
        return int(np.sign(self.signed_distances(point)))

    def find_crossing_stations(self, path: PathByLength) -> list[float]:
        """Return the stations, mm, at which a path crosses the line.

        An arc is divided where it is parallel to the line; each part crosses it at most once.

        Raises
        ------
        GeometryError
            If the line touches the path.
        """
        plane_path = path.path
        distances = self.signed_distances(plane_path.points)
        self.check_clearance(distances, plane_path.points)
        crossed = distances[:-1] * distances[1:] < 0
        near = np.minimum(np.abs(distances[:-1]), np.abs(distances[1:])) < plane_path.lengths / 2
        found = []
        for k in np.flatnonzero(crossed | ((plane_path.bulges != 0) & near)).tolist():
            breaks = np.array([0.0, *self._find_extremal_parts(plane_path, k), 1.0])
            levels = self.signed_distances(plane_path.at(np.full(len(breaks), k), breaks))
            self.check_clearance(levels, plane_path.points[k : k + 1])
            for low, high, changes_side in zip(breaks[:-1], breaks[1:], levels[:-1] * levels[1:] < 0, strict=True):
                if changes_side:
                    part = self._bisect_crossing(plane_path, k, low, high)
                    found.append(float(path.stations[k] + part * plane_path.lengths[k]))
        return found

    def check_clearance(self, distances: Array, points: Array) -> None:
        """Raise GeometryError if the line touches the boundary at one of points with given distances from it."""
        if np.abs(distances).min() < self.clearance:
            x, y = points[min(int(np.abs(distances).argmin()), len(points) - 1)]
            raise GeometryError(
                f"the line along which piece {self.piece.name} is to be cut touches its boundary "
                f"near ({x:.6g}, {y:.6g}): shift it by more than {self.clearance:.1g} mm"
            )

    def _find_extremal_parts(self, path: Path, k: int) -> list[float]:
        """Return the parts (0 to 1) of the length of segment k at which its tangent is parallel to the line."""
        half = 2 * np.arctan(path.bulges[k])
        if half == 0:
            return []
        dx, dy = path.points[k + 1] - path.points[k]
        wanted = np.arctan2(self.direction[1], self.direction[0]) - np.arctan2(dy, dx) + np.pi * np.arange(-3, 4)
        return sorted(part for part in (1 + wanted / half) / 2 if 0 < part < 1)

    def _bisect_crossing(self, path: Path, k: int, low: float, high: float) -> float:
        """Return the part of segment k at which it crosses the line; the distance is monotone from `low` to `high`."""
        segment = np.array([k])
        rising = self.signed_distances(path.at(segment, np.array([high])))[0] > 0

        def is_before_line(part: float) -> bool:
            return bool((self.signed_distances(path.at(segment, np.array([part])))[0] > 0) != rising)

        low, high = bisect_interval(is_before_line, low, high)
        return (low + high) / 2
