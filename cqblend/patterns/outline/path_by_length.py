"""A path by its arc length: points, tangents and curvature at stations, stretches between them, offset curves.

Tabs, labels and cuts are set out with it. A station is a distance along the path, mm from its beginning. Depends on
plane paths only.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from cqblend.errors import GeometryError
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.outline.tolerances import OUTLINE_TOLERANCES
from cqblend.splines.bernstein import Array


@dataclass(frozen=True, eq=False)
class PathByLength:
    """A path with the stations of its vertices.

    Attributes
    ----------
    path
        Without segments of zero length.

    Examples
    --------
    >>> quarter = PathByLength(Path(np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([np.tan(np.pi / 8)])))
    >>> bool(np.allclose(quarter.points_at(np.pi / 4), np.sqrt(0.5)))
    True
    >>> wider = quarter.offset_curve(0.0, np.pi / 2, 1.0)  # to the right, which is outside
    >>> wider.points.round(12) + 0.0, round(float(wider.length / np.pi), 12)
    (array([[2., 0.],
           [0., 2.]]), 1.0)
    """

    path: Path

    @classmethod
    def from_path(cls, path: Path) -> Self:
        """Return a path by its length, without its segments of zero length."""
        keep = path.chords > 0
        if keep.all():
            return cls(path)
        if not keep.any():
            raise GeometryError(f"a path at {path.points[0]} is a point: it has no directions")
        last = np.flatnonzero(keep)[-1]
        points = path.points[:-1][keep]
        return cls(Path(np.concatenate([points, path.points[last + 1 :][:1]]), path.bulges[keep]))

    @cached_property
    def stations(self) -> Array:
        """Stations of the vertices, (n + 1,), mm."""
        return np.concatenate([[0.0], np.cumsum(self.path.lengths)])

    @property
    def length(self) -> float:
        """Length of the path, mm."""
        return float(self.stations[-1])

    @cached_property
    def directions(self) -> Array:
        """Unit tangents at the beginning and at the end of every segment, (2, n, 2)."""
        chord = np.diff(self.path.points, axis=0)
        chord = chord / np.linalg.norm(chord, axis=1)[:, None]
        half = 2 * np.arctan(self.path.bulges)
        return np.stack([rotate_vectors(chord, -half), rotate_vectors(chord, half)])

    @cached_property
    def kink_angles(self) -> Array:
        """Angles (rad) by which the tangent turns at the inner vertices, (n - 1,), positive to the left."""
        return signed_angles(self.directions[1, :-1], self.directions[0, 1:])

    @cached_property
    def turning_angles(self) -> Array:
        """Angles (rad) by which the tangent turns along each segment and at the vertex after it, if any, (n,)."""
        return 4 * np.arctan(self.path.bulges) + np.append(self.kink_angles, 0.0)

    @cached_property
    def _heading_angles(self) -> Array:
        """Angles (rad) by which the tangent has turned at the start of each segment and at the end, (n + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.turning_angles)])

    def mean_curvature(self, start: Array | float, stop: Array | float) -> Array:
        """Return the mean curvature between pairs of stations, 1/mm, positive to the left; kinks in between count."""
        start, stop = np.broadcast_arrays(np.asarray(start, dtype=np.float64), np.asarray(stop, dtype=np.float64))
        headings = []
        near = self._station_rounding
        for station in (start + near, stop - near):
            segment, fraction = self.locate_segments(station)
            headings.append(self._heading_angles[segment] + fraction * 4 * np.arctan(self.path.bulges[segment]))
        return np.divide(
            headings[1] - headings[0], stop - start, out=np.zeros(start.shape), where=stop - start > 4 * near
        )

    @property
    def _station_rounding(self) -> float:
        """Distance within which stations are one, mm."""
        return OUTLINE_TOLERANCES.rounding_of_stations * self.length

    def tangents_at(self, station: Array | float) -> Array:
        """Return the unit tangents at stations, (..., 2); at a kink, that of the segment after it."""
        segment, fraction = self.locate_segments(np.asarray(station))
        return rotate_vectors(self.directions[0, segment], fraction * 4 * np.arctan(self.path.bulges[segment]))

    def locate_segments(self, station: Array) -> tuple[Array, Array]:
        """Return the indices of the segments that hold stations, and the fractions (0 to 1) of their lengths."""
        station = np.asarray(station, dtype=np.float64)
        segment = np.clip(np.searchsorted(self.stations, station, side="right") - 1, 0, len(self.path.bulges) - 1)
        span = self.stations[segment + 1] - self.stations[segment]
        return segment, np.clip((station - self.stations[segment]) / span, 0.0, 1.0)

    def points_at(self, station: Array | float) -> Array:
        """Return the points at stations, (..., 2)."""
        station = np.asarray(station, dtype=np.float64)
        return self.path.at(*self.locate_segments(station.ravel())).reshape(*station.shape, 2)

    def clip_between(self, start: float, stop: float) -> Path:
        """Return the stretch of the path between two stations; a vertex within rounding of one is taken exactly."""
        near = self._station_rounding
        inner = np.flatnonzero((self.stations > start + near) & (self.stations < stop - near))
        ends = np.array([start, stop])
        snapped = np.abs(self.stations - ends[:, None]).argmin(axis=1)
        exact = np.abs(self.stations[snapped] - ends) <= near
        first, last = np.where(exact[:, None], self.path.points[snapped], self.points_at(ends))
        breaks = np.concatenate([[start], self.stations[inner], [stop]])
        segment = self.locate_segments((breaks[:-1] + breaks[1:]) / 2)[0]
        fraction = np.diff(breaks) / (self.stations[segment + 1] - self.stations[segment])
        bulges = np.tan(np.minimum(fraction, 1.0) * np.arctan(self.path.bulges[segment]))
        return Path(np.concatenate([first[None], self.path.points[inner], last[None]]), bulges)

    def offset_curve(self, start: float, stop: float, distance: float) -> Path:
        """Return the offset curve, at a distance (mm) to the right of the stretch between two stations.

        Arcs stay arcs about their centres. At a kink the offset is mitred: its vertex lies on the bisector, so that the
        offsets of straight segments keep the distance.
        """
        stretch = self.clip_between(start, stop)
        return Path(stretch.points + distance * PathByLength(stretch)._offset_directions, stretch.bulges)

    @cached_property
    def _offset_directions(self) -> Array:
        """Vectors from the vertices to those of the offset curve at distance 1, (n + 1, 2), mitred at kinks."""
        at_start, at_end = self.directions
        before, after = np.concatenate([at_start[:1], at_end]), np.concatenate([at_start, at_end[-1:]])
        bisector = before + after
        bisector = bisector / np.maximum(np.linalg.norm(bisector, axis=1), 1e-12)[:, None]
        mitre = 1 / np.maximum((bisector * after).sum(axis=1), OUTLINE_TOLERANCES.least_mitre_cosine)
        return mitre[:, None] * np.stack([bisector[:, 1], -bisector[:, 0]], axis=1)

    def sample_for_offsets(self, tolerance: float, distance: float) -> tuple[Array, Array, Array]:
        """Return stations (m,) from which all offset curves up to a distance are sampled within a tolerance, mm.

        With their points (m, 2), and the vectors (m, 2) from these to the offset curve at distance 1. All vertices are
        among them.
        """
        angles = 4 * np.arctan(self.path.bulges)
        radius = self.path.lengths / np.maximum(np.abs(angles), 1e-300) + distance
        counts = np.maximum(np.ceil(np.abs(angles) / np.sqrt(8 * tolerance / radius)), 1).astype(int)
        segment = np.repeat(np.arange(len(counts)), counts)
        fraction = (np.arange(len(segment)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[segment]
        stations = np.append(self.stations[segment] + fraction * np.diff(self.stations)[segment], self.stations[-1])
        points = np.concatenate([self.path.at(segment, fraction), self.path.points[-1:]])
        tangents = rotate_vectors(self.directions[0, segment], fraction * angles[segment])
        normals = np.stack([tangents[:, 1], -tangents[:, 0]], axis=1)
        right = np.where((fraction == 0)[:, None], self._offset_directions[segment], normals)
        return stations, points, np.concatenate([right, self._offset_directions[-1:]])


def rotate_vectors(vectors: Array, angle: Array | float) -> Array:
    """Return vectors (..., 2) turned to the left by angles (...), rad."""
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def signed_angles(first: Array, second: Array) -> Array:
    """Return the angles (rad, from -pi to pi, positive to the left) from vectors (..., 2) to others."""
    cross = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return np.arctan2(cross, (first * second).sum(axis=-1))
