"""Places along a path by its length, stretches of it, and curves parallel to it: what tabs and labels are set out with.

Exists beside paths because these need a frame along the path, which cutting does not. Must not know pieces or seams.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np

from cqblend.errors import GeometryError
from cqblend.patterns.outline.plane_path import Path
from cqblend.splines.bernstein import Array

LEAST_MITRE_COSINE = 0.25
"""Normals at kinks are lengthened so that the parallel keeps its distance, at most by the inverse of this."""


@dataclass(frozen=True, eq=False)
class PathByLength:
    """A path and the distances along it, mm from its beginning.

    Attributes
    ----------
    path
        The path, of segments that are not points.

    Examples
    --------
    >>> quarter = Track(Path(np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([np.tan(np.pi / 8)])))
    >>> bool(np.allclose(quarter.at(np.pi / 4), np.sqrt(0.5)))
    True
    >>> wider = quarter.parallel(0.0, np.pi / 2, 1.0)  # to the right, which is outside
    >>> wider.points.round(12) + 0.0, round(float(wider.length / np.pi), 12)
    (array([[2., 0.],
           [0., 2.]]), 1.0)
    """

    path: Path

    @classmethod
    def from_path(cls, path: Path) -> Self:
        """Return the track of a path, without those of its segments that are points."""
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
        """Distances of the vertices from the beginning, (n + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.path.lengths)])

    @property
    def length(self) -> float:
        """Length of the whole."""
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
        """Angles by which the tangent turns at the inner vertices, (n - 1,)."""
        return signed_angles(self.directions[1, :-1], self.directions[0, 1:])

    @cached_property
    def turning_angles(self) -> Array:
        """Angle by which the tangent turns along each segment and, but for the last, at the vertex behind it, (n,)."""
        return 4 * np.arctan(self.path.bulges) + np.append(self.kink_angles, 0.0)

    @cached_property
    def _heading_angles(self) -> Array:
        """Angles by which the tangent has turned at the beginning of each segment, and of an end, (n + 1,)."""
        return np.concatenate([[0.0], np.cumsum(self.turning_angles)])

    def mean_curvature(self, start: Array | float, stop: Array | float) -> Array:
        """Return the mean curvature between pairs of stations, 1/mm, positive to the left; kinks within count."""
        start, stop = np.broadcast_arrays(np.asarray(start, dtype=np.float64), np.asarray(stop, dtype=np.float64))
        heading = []
        near = 1e-9 * self.length
        for station in (start + near, stop - near):
            which, part = self.locate_segments(station)
            heading.append(self._heading_angles[which] + part * 4 * np.arctan(self.path.bulges[which]))
        return np.divide(
            heading[1] - heading[0], stop - start, out=np.zeros(start.shape), where=stop - start > 4 * near
        )

    def tangents_at(self, station: Array | float) -> Array:
        """Return the unit tangents at stations, (..., 2); at a kink, that behind it."""
        which, part = self.locate_segments(np.asarray(station))
        return rotate_vectors(self.directions[0, which], part * 4 * np.arctan(self.path.bulges[which]))

    def locate_segments(self, station: Array) -> tuple[Array, Array]:
        """Return the segments that hold stations, and the parts (0 to 1) along them."""
        station = np.asarray(station, dtype=np.float64)
        which = np.clip(np.searchsorted(self.stations, station, side="right") - 1, 0, len(self.path.bulges) - 1)
        span = self.stations[which + 1] - self.stations[which]
        return which, np.clip((station - self.stations[which]) / span, 0.0, 1.0)

    def points_at(self, station: Array | float) -> Array:
        """Return the points at stations, (..., 2)."""
        station = np.asarray(station, dtype=np.float64)
        return self.path.at(*self.locate_segments(station.ravel())).reshape(*station.shape, 2)

    def clip_between(self, start: float, stop: float) -> Path:
        """Return the path between two stations; vertices within rounding of them are kept as they are."""
        near = 1e-9 * self.length
        inner = np.flatnonzero((self.stations > start + near) & (self.stations < stop - near))
        ends = np.array([start, stop])
        snapped = np.abs(self.stations - ends[:, None]).argmin(axis=1)
        exact = np.abs(self.stations[snapped] - ends) <= near
        first, last = np.where(exact[:, None], self.path.points[snapped], self.points_at(ends))
        knots = np.concatenate([[start], self.stations[inner], [stop]])
        which = self.locate_segments((knots[:-1] + knots[1:]) / 2)[0]
        part = np.diff(knots) / (self.stations[which + 1] - self.stations[which])
        bulges = np.tan(np.minimum(part, 1.0) * np.arctan(self.path.bulges[which]))
        return Path(np.concatenate([first[None], self.path.points[inner], last[None]]), bulges)

    def offset_curve(self, start: float, stop: float, distance: float) -> Path:
        """Return the curve at a distance to the right of the stretch between two stations.

        Arcs stay arcs about their centres. At a kink the offset vertex lies on the bisector, so that the parallels of
        straight segments keep their distance.
        """
        stretch = self.clip_between(start, stop)
        return Path(stretch.points + distance * PathByLength(stretch)._offset_directions, stretch.bulges)

    @cached_property
    def _offset_directions(self) -> Array:
        """By what the vertices of a parallel at the distance 1 lie beside those of the path, (n + 1, 2)."""
        ahead, behind = self.directions
        before, after = np.concatenate([ahead[:1], behind]), np.concatenate([ahead, behind[-1:]])
        middle = before + after
        middle = middle / np.maximum(np.linalg.norm(middle, axis=1), 1e-12)[:, None]
        reach = 1 / np.maximum((middle * after).sum(axis=1), LEAST_MITRE_COSINE)
        return reach[:, None] * np.stack([middle[:, 1], -middle[:, 0]], axis=1)

    def sample_for_offsets(self, tolerance: float, distance: float) -> tuple[Array, Array, Array]:
        """Return stations (m,) so close that parallels at most at a distance are sampled within a tolerance.

        With their points (m, 2), and by what the parallel at the distance 1 lies beside them (m, 2). The vertices are
        among them.
        """
        bend = 4 * np.arctan(self.path.bulges)
        radius = self.path.lengths / np.maximum(np.abs(bend), 1e-300) + distance
        counts = np.maximum(np.ceil(np.abs(bend) / np.sqrt(8 * tolerance / radius)), 1).astype(int)
        which = np.repeat(np.arange(len(counts)), counts)
        part = (np.arange(len(which)) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[which]
        stations = np.append(self.stations[which] + part * np.diff(self.stations)[which], self.stations[-1])
        points = np.concatenate([self.path.at(which, part), self.path.points[-1:]])
        ahead = rotate_vectors(self.directions[0, which], part * bend[which])
        right = np.where(
            (part == 0)[:, None], self._offset_directions[which], np.stack([ahead[:, 1], -ahead[:, 0]], axis=1)
        )
        return stations, points, np.concatenate([right, self._offset_directions[-1:]])


def rotate_vectors(vectors: Array, angle: Array | float) -> Array:
    """Return vectors (..., 2) turned to the left by angles (...)."""
    cos, sin = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def signed_angles(first: Array, second: Array) -> Array:
    """Return the angles from vectors (..., 2) to others, in -pi to pi, positive to the left."""
    cross = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return np.arctan2(cross, (first * second).sum(axis=-1))
