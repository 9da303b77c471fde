"""Chart of a flat strip whose rulings stay straight, and its inverse: the ruling through a point of the plane.

Points in the plane are complex numbers in this module.
"""

from dataclasses import dataclass

import numpy as np

from cqblend.patterns.flattening.complex_plane import cross_product
from cqblend.patterns.flattening.development import RailDevelopment
from cqblend.patterns.flattening.tolerances import FLATTENING_TOLERANCES
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import solve_in_brackets

_CANDIDATE_COUNT = 3
"""Intervals between rulings in which the ruling through a point is searched for."""

_GOLDEN_RATIO = (np.sqrt(5) - 1) / 2


@dataclass(frozen=True, slots=True, eq=False)
class RulingChart:
    """Chart of rulings that stay straight, given by where both rails are in the plane.

    Attributes
    ----------
    rail_and_ruling
        (C1, C2 - C1), of dim 6.
    development
        Of both rails.
    mirror
        -1.0 to mirror the strip at the vertical axis, else 1.0.
    """

    rail_and_ruling: Curve
    development: RailDevelopment
    mirror: float

    def map_rails(self, t: Array) -> tuple[Array, Array]:
        """Return the points of both rails in the plane, (m,) complex each, at parameters (m,)."""
        first, second = self.development(t)
        return (first, second) if self.mirror > 0 else (-first.conj(), -second.conj())

    def to_plane(self, t: Array, w: Array) -> Array:
        """Return the points (m,) in the plane, complex, at (t, w)."""
        first, second = self.map_rails(t)
        return first + w * (second - first)

    def to_space(self, points: Array) -> Array:
        """Return where points (m,) of the plane, complex, are in space, (m, 3)."""
        t, w = self.to_parameters(points)
        value = self.rail_and_ruling(t)
        return np.asarray(value[:, :3] + w[:, None] * value[:, 3:])

    def to_parameters(self, points: Array) -> tuple[Array, Array]:
        """Return (t, w) of points: the ruling through each, found between two of many.

        Where several rulings come near a point, as next to an edge of regression, the nearest one is taken.
        """
        breaks = self.rail_and_ruling.breaks
        t = np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(64) / 64).ravel(), breaks[-1])
        first, second = self.map_rails(t)
        step = FLATTENING_TOLERANCES.block_size
        blocks = [points[i : i + step] for i in range(0, len(points), step)]
        index = np.concatenate([_find_nearest_intervals(block, first, second) for block in blocks]).T
        size = float(np.abs(np.concatenate([first, second])).max())
        found = self._solve_rulings(t[index].ravel(), t[index + 1].ravel(), np.tile(points, len(index)), size)
        roots, w, distance = (f.reshape(index.shape) for f in found)
        best = distance.argmin(axis=0), np.arange(len(points))
        roots, w, distance = roots[best], w[best], distance[best]
        is_lost = distance > FLATTENING_TOLERANCES.point_on_strip * size
        if is_lost.any():
            near = index[0, is_lost]
            intervals = self._separate_double_roots(t[near], t[near + 1], points[is_lost])
            found = self._solve_rulings(*intervals, points[is_lost], size)
            is_better = found[2] < distance[is_lost]
            roots[is_lost], w[is_lost] = np.where(is_better, found[:2], (roots[is_lost], w[is_lost]))
        return roots, w

    def _separate_double_roots(self, low: Array, high: Array, points: Array) -> tuple[Array, Array]:
        """Shorten intervals with two roots, where rulings on both sides of an edge of regression pass through a point.

        The root at which the cross product changes sign in the direction in which it does inside strips is on one side
        of its extremum, which golden section finds. Where that is no root either, the interval becomes the extremum,
        which is zero at the edge of regression.
        """
        sign = np.sign(self._cross_with_ruling(low, points))
        a, b = low, high
        for _ in range(45):
            c, d = b - _GOLDEN_RATIO * (b - a), a + _GOLDEN_RATIO * (b - a)
            is_left = sign * self._cross_with_ruling(c, points) < sign * self._cross_with_ruling(d, points)
            a, b = np.where(is_left, a, c), np.where(is_left, d, b)
        middle = (a + b) / 2
        is_crossed = sign * self._cross_with_ruling(middle, points) < 0
        is_rising = sign * self.mirror > 0
        return np.where(is_crossed & ~is_rising, low, middle), np.where(is_crossed & is_rising, high, middle)

    def _solve_rulings(self, low: Array, high: Array, points: Array, size: float) -> tuple[Array, Array, Array]:
        """Return t, w, and the distance of points from the ruling there."""
        value_low, value_high = self._cross_with_ruling(low, points), self._cross_with_ruling(high, points)
        residual = FLATTENING_TOLERANCES.root_residual * size**2
        t = solve_in_brackets(
            lambda t: self._cross_with_ruling(t, points), (low, high), (value_low, value_high), residual
        )
        first, second = self.map_rails(t)
        ruling = second - first
        square = np.abs(ruling) ** 2
        dots = ((points - first) * ruling.conj()).real
        w = np.divide(dots, square, out=np.zeros(len(t)), where=square > 0)
        return t, w, np.abs(points - first - np.clip(w, 0.0, 1.0) * ruling)

    def _cross_with_ruling(self, t: Array, points: Array) -> Array:
        """Return the cross product of the rulings at t with the vectors to points, which is zero on the ruling."""
        first, second = self.map_rails(t)
        return cross_product(second - first, points - first)


def _find_nearest_intervals(points: Array, first: Array, second: Array) -> Array:
    """Find the intervals between rulings that each point lies in, or is nearest to, best first: (m, 3)."""
    ruling = second - first
    cross = cross_product(ruling, points[:, None] - first)
    before, after = cross[:, :-1], cross[:, 1:]
    part = np.divide(before, before - after, out=np.zeros_like(before), where=before != after)
    part = np.clip(part, 0.0, 1.0)
    start = first[:-1] + part * np.diff(first)
    inner_ruling = ruling[:-1] + part * np.diff(ruling)
    square = np.abs(inner_ruling) ** 2
    dots = ((points[:, None] - start) * inner_ruling.conj()).real
    w = np.divide(dots, square, out=np.zeros_like(part), where=square > 0)
    distance = np.abs(points[:, None] - start - np.clip(w, 0.0, 1.0) * inner_ruling)
    return np.asarray(np.argsort(distance, axis=1)[:, :_CANDIDATE_COUNT])
