"""Plane curves of straight segments and circular arcs, which bound pieces and which a cutter runs along.

Arcs of given length give both sides of a seam the same length to rounding, and a cut file has nothing but lines and
arcs. An arc is given by its bulge, as in DXF: the tangent of a quarter of its angle, positive if it turns
counterclockwise. Depends on nothing else in patterns but tolerances.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from cqblend.errors import InputError
from cqblend.patterns.outline.tolerances import OUTLINE_TOLERANCES
from cqblend.splines.bernstein import EPSILON, Array

ARC_SAMPLES = 12
"""Even number of equal parts of its parameter at whose ends a curve is compared with the arc that stands for it."""


def sinc(x: Array) -> Array:
    """Return sin(x) / x, 1 at 0."""
    return np.sinc(np.asarray(x) / np.pi)


def solve_bulges(chords: Array, lengths: Array) -> Array:
    """Return the bulges, none negative, of arcs with given chords and lengths.

    Half the angle of the arc, h, solves 1 - sin(h) / h = (length - chord) / length by Newton's method. A length that is
    not above its chord gives a straight segment; the arc is at most a full turn.

    Examples
    --------
    >>> solve_bulges([2.0, 1.0], [np.pi, 1.0]).round(12)  # a half circle, a straight segment
    array([1., 0.])
    """
    chords, lengths = np.broadcast_arrays(np.asarray(chords, dtype=np.float64), np.asarray(lengths, dtype=np.float64))
    excess = np.clip(np.divide(lengths - chords, lengths, out=np.zeros(lengths.shape), where=lengths > 0), 0.0, 1.0)
    half = np.minimum(np.sqrt(6 * excess) * (1 + 0.15 * excess), np.pi)  # 1 - sin(h) / h = h^2 / 6 - h^4 / 120 + ..
    for _ in range(6):
        small = half < 0.05
        h = np.where(small, 1.0, half)
        square = half * half
        value = np.where(
            small, square / 6 * (1 - square / 20 * (1 - square / 42 * (1 - square / 72))), 1 - np.sin(h) / h
        )
        slope = np.where(
            small,
            half / 3 * (1 - square / 10 * (1 - square / 28 * (1 - square / 54))),
            np.sin(h) / h**2 - np.cos(h) / h,
        )
        step = np.divide(value - excess, slope, out=np.zeros(half.shape), where=slope > 0)
        half = np.clip(half - step, 0.0, np.pi)
        rounding = np.where(small, half, half + 1 / h)  # of the step, over that of numbers near 1
        if (np.abs(step) <= 4 * EPSILON * rounding).all():
            break
    return np.tan(half / 2)


def measure_arc_deviations(path: "Path", points: Array) -> Array:
    """Return the distances (n,), mm, of curves from the arcs that replace them, with a margin on the sampled maxima.

    The distance is to first order (Sampson): that of a point (x, y) to the zeros of
    f = s (x^2 + y^2 - c^2) + (s^2 - c^2) y, abs(f) / norm(grad f), with the circle through (-c, 0), (c, 0), (0, -s).

    Parameters
    ----------
    path
        With n segments and arcs.
    points
        (n, k, 2): k points of each curve between the ends of its arc; :data:`ARC_SAMPLES` - 1 of them, evenly spread,
        are enough.
    """
    start, chord = path.points[:-1, None], np.diff(path.points, axis=0)[:, None]
    length = np.linalg.norm(chord, axis=-1)
    along = np.divide(chord, length[..., None], out=np.zeros_like(chord), where=length[..., None] > 0)
    offset = points - start - chord / 2
    half = length / 2
    x, y = (offset * along).sum(axis=-1), along[..., 0] * offset[..., 1] - along[..., 1] * offset[..., 0]
    sagitta = path.bulges[:, None] * half
    residual = sagitta * (x * x + y * y - half**2) + (sagitta**2 - half**2) * y
    slope = np.hypot(2 * sagitta * x, 2 * sagitta * y + sagitta**2 - half**2)
    distance = np.divide(np.abs(residual), slope, out=np.hypot(x, y), where=slope > 0)
    return np.asarray(OUTLINE_TOLERANCES.arc_error_margin * distance.max(axis=1, initial=0.0))


@dataclass(frozen=True, slots=True, eq=False)
class Path:
    """A chain of segments and arcs in the plane, directed, open or closed.

    Attributes
    ----------
    points
        (n + 1, 2), mm. Closed if the last is the first.
    bulges
        (n,), tangent of a quarter of each arc's angle; 0 is straight, positive turns to the left.

    Examples
    --------
    >>> disc = Path(np.array([[1.0, 0.0], [-1.0, 0.0], [1.0, 0.0]]), np.array([1.0, 1.0]))
    >>> disc.length / np.pi, disc.area / np.pi
    (2.0, 1.0)
    """

    points: Array
    bulges: Array

    def __post_init__(self) -> None:
        if self.points.ndim != 2 or self.points.shape[1] != 2 or self.bulges.shape != (len(self.points) - 1,):
            raise InputError(f"{len(self.points)} points of a path need one bulge less, not {self.bulges.shape}")

    @classmethod
    def from_points(cls, points: Array) -> Self:
        """Return the polygon through points (n + 1, 2)."""
        return cls(np.asarray(points, dtype=np.float64), np.zeros(len(points) - 1))

    @classmethod
    def from_paths(cls, paths: Sequence["Path"]) -> Self:
        """Return paths one after another; each starts where the one before ends."""
        points = [path.points[:-1] for path in paths] + [paths[-1].points[-1:]]
        return cls(np.concatenate(points), np.concatenate([path.bulges for path in paths]))

    @property
    def closed(self) -> bool:
        """Whether the last point is the first, exactly."""
        return bool((self.points[0] == self.points[-1]).all())

    @property
    def chords(self) -> Array:
        """Lengths of the chords, (n,)."""
        return np.linalg.norm(np.diff(self.points, axis=0), axis=1)

    @property
    def lengths(self) -> Array:
        """Lengths of the segments and arcs, (n,)."""
        return np.asarray(self.chords / sinc(2 * np.arctan(self.bulges)))

    @property
    def length(self) -> float:
        """Length of the path."""
        return float(self.lengths.sum())

    @property
    def area(self) -> float:
        """Area to the left of a closed path, by the shoelace and the segments of its arcs."""
        base = self.points - self.points[0]
        x, y = base[:-1].T
        dx, dy = np.diff(base, axis=0).T
        angle = 4 * np.arctan(self.bulges)
        square = self.chords**2
        # r^2 / 2 (a - sin a) with r = chord / (2 sin(a / 2)), from its series where the arc is flat
        flat = np.abs(angle) < 1e-2
        sine = np.where(flat, 1.0, np.sin(angle / 2))
        cap = np.where(flat, angle / 12 * (1 + angle**2 / 30), (angle - np.sin(angle)) / (8 * sine**2))
        return float((x * dy - y * dx).sum() / 2 + (square * cap).sum())

    def reversed(self) -> "Path":
        """Return the path run backwards."""
        return Path(self.points[::-1], -self.bulges[::-1])

    def moved(self, turn: float, shift: Array) -> "Path":
        """Return the path turned about the origin by an angle (rad), then shifted."""
        cos, sin = np.cos(turn), np.sin(turn)
        return Path(self.points @ np.array([[cos, sin], [-sin, cos]]) + shift, self.bulges)

    def mirrored(self) -> "Path":
        """Return the mirror image in the y axis."""
        return Path(self.points * [-1.0, 1.0], -self.bulges)

    def sampled(self, tolerance: float) -> Array:
        """Return points (m, 2) of a polygon that is nowhere further from the path than a tolerance; ends included."""
        angle = 4 * np.arctan(self.bulges)
        radius = np.divide(self.chords, 2 * np.abs(np.sin(angle / 2)), out=np.zeros(len(angle)), where=angle != 0)
        step = 2 * np.arccos(np.clip(1 - tolerance / np.maximum(radius, tolerance), 0.0, 1.0))
        counts = np.maximum(np.ceil(np.abs(angle) / np.maximum(step, 1e-9)), 1).astype(int)
        segment = np.repeat(np.arange(len(counts)), counts)
        part = (np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)) / counts[segment]
        return np.concatenate([self.at(segment, part), self.points[-1:]])

    def at(self, segment: Array, part: Array) -> Array:
        """Return the points at given parts (0 to 1, by length) of given segments, (m, 2)."""
        chord = np.diff(self.points, axis=0)[segment]
        half = 2 * np.arctan(self.bulges[segment])
        # the chord from the start to the point is turned by -half (1 - part), and shorter by sin(part half) / sin(half)
        turn = -half * (1 - part)
        shrink = part * sinc(part * half) / sinc(half)
        cos, sin = np.cos(turn) * shrink, np.sin(turn) * shrink
        x, y = chord.T
        return np.asarray(self.points[:-1][segment] + np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1))
