"""Elber's strips of triangles: how far a ruled surface is from them, and how they are laid out in the plane.

Points in the plane are complex numbers in this module.

References
----------
G. Elber: Model fabrication using surface layout projection (1995), section 2, equation (4) and figure 4.
"""

from dataclasses import dataclass

import numpy as np

from cqblend.patterns.flattening.complex_plane import cross_product
from cqblend.patterns.flattening.node_refinement import split_intervals
from cqblend.patterns.flattening.tolerances import FLATTENING_TOLERANCES
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array, elevate_degree
from cqblend.splines.evaluation import locate_pieces


@dataclass(frozen=True, slots=True, eq=False)
class TriangleChart:
    """Chart of triangles along one diagonal of the quadrilaterals between nodes, affine on each of them.

    Attributes
    ----------
    nodes
        (n,) parameters along the rails.
    corners
        (2, n) points of both rails in the plane, complex.
    corners_3d
        (2, n, 3) in space.
    """

    nodes: Array
    corners: Array
    corners_3d: Array

    @classmethod
    def from_rails(cls, rail_and_ruling: Curve, nodes: Array, mirror: float) -> "TriangleChart":
        """Lay out the triangles between points of the rails at nodes; mirror -1.0 mirrors them."""
        value = rail_and_ruling(nodes)
        corners_3d = np.stack([value[:, :3], value[:, :3] + value[:, 3:]])
        corners = _lay_out_triangles(corners_3d[0], corners_3d[1])
        return cls(nodes, corners if mirror > 0 else -corners.conj(), corners_3d)

    @property
    def chord_lengths(self) -> Array:
        """Lengths (2, n - 1) of the chords of both rails, mm."""
        return np.asarray(np.linalg.norm(np.diff(self.corners_3d, axis=1), axis=2))

    @property
    def area(self) -> float:
        """Area of the flat triangles, mm^2."""
        flat = self.corners
        doubled = cross_product(flat[0, 1:] - flat[1, :-1], flat[1, 1:] - flat[0, :-1])
        return float(np.abs(doubled.sum()) / 2)

    def to_plane(self, t: Array, w: Array) -> Array:
        """Return the points (m,) in the plane, complex, at (t, w)."""
        cell, _, x, _ = locate_pieces(self.nodes, t)
        (p00, p01), (p10, p11) = self.corners[:, cell], self.corners[:, cell + 1]
        return np.where(x >= w, p00 + x * (p10 - p00) + w * (p11 - p10), p00 + w * (p01 - p00) + x * (p11 - p01))

    def to_space(self, points: Array) -> Array:
        """Return where points (m,) of the plane, complex, are in space, (m, 3)."""
        return self._interpolate_values(points, _triangle_corners(self.corners_3d))

    def to_parameters(self, points: Array) -> tuple[Array, Array]:
        """Return the (t, w) that are nearest to points (m,) of the plane, complex."""
        t_corners = np.tile(self.nodes, (2, 1))
        parameters = np.stack([t_corners, np.broadcast_to([[0.0], [1.0]], t_corners.shape)], axis=-1)
        t, w = self._interpolate_values(points, _triangle_corners(parameters)).T
        return t, w

    def _interpolate_values(self, points: Array, values: tuple[Array, Array, Array]) -> Array:
        """Return values (m, k), linear on each triangle, at points of the plane, given those at the corners."""
        a, b, c = _triangle_corners(self.corners)
        found = np.empty((len(points), values[0].shape[1]))
        with np.errstate(divide="ignore", invalid="ignore"):
            for start in range(0, len(points), FLATTENING_TOLERANCES.block_size):
                block = slice(start, start + FLATTENING_TOLERANCES.block_size)
                offset = points[block, None] - a
                area = cross_product(b - a, c - a)
                x, y = cross_product(offset, c - a) / area, cross_product(b - a, offset) / area
                inside = np.nan_to_num(np.minimum(np.minimum(x, y), 1 - x - y), nan=-np.inf, neginf=-np.inf)
                best = inside.argmax(axis=1)
                x, y = (np.take_along_axis(f, best[:, None], axis=1) for f in (x, y))
                first, second, third = (value[best] for value in values)
                found[block] = first + x * (second - first) + y * (third - first)
        return found


def refine_for_triangles(rail_and_ruling: Curve, nodes: Array, tolerance: float) -> tuple[Array, float]:
    """Split all intervals between nodes, each into as many parts, until triangles are close enough to the surface.

    Returns the nodes, and the bound of the distance, mm.
    """
    initial = nodes
    count = 1
    while True:
        error = _bound_chord_deviations(rail_and_ruling, nodes) + _bound_quad_twists(rail_and_ruling, nodes)
        if error.max() <= tolerance:
            return nodes, float(error.max())
        count *= 2
        nodes = split_intervals(initial, np.full(len(initial) - 1, count), tolerance)


def bound_triangle_error(rail_and_ruling: Curve, nodes: Array, tolerance: float) -> float:
    """Bound the distance of a ruled surface from triangles, as many as the tolerance takes, up to the limit, mm."""
    while True:
        chord, twist = _bound_chord_deviations(rail_and_ruling, nodes), _bound_quad_twists(rail_and_ruling, nodes)
        worst = float((chord + twist).max())
        parts = _count_parts(chord, twist, tolerance)
        if worst <= tolerance or parts.sum() > FLATTENING_TOLERANCES.max_segments:
            return worst
        nodes = split_intervals(nodes, parts, tolerance)


def _count_parts(chord: Array, twist: Array, tolerance: float) -> Array:
    """How many parts an interval needs: chord deviations fall with the square of the length, twists with the length."""
    wanted = np.maximum(np.sqrt(2 * chord / tolerance), 2 * twist / tolerance)
    return np.where(chord + twist > tolerance, np.clip(np.ceil(wanted), 2, 64), 1).astype(int)


def _bound_chord_deviations(rail_and_ruling: Curve, nodes: Array) -> Array:
    r"""Bound \|C_i - chord\| at equal parameters (equation 4), between nodes, from coefficients: (n - 1,), mm."""
    cut = rail_and_ruling.cut(nodes)
    coefs = cut.coefs
    weight = coefs[:, 6:] if rail_and_ruling.rational else np.ones((1, 1, coefs.shape[2]))
    worst = np.zeros(coefs.shape[2])
    for rail in (coefs[:, :3], coefs[:, :3] + coefs[:, 3:6]):
        if not rail_and_ruling.rational:
            off = rail - elevate_degree(rail[[0, -1]], len(rail) - 2) if len(rail) > 2 else np.zeros_like(rail)
        else:
            start, end = rail[0] / weight[0], rail[-1] / weight[-1]
            degree = len(weight) - 1
            # W(x) ((1 - x) start + x end), of one degree more
            i = np.arange(degree + 2)[:, None, None] / (degree + 1)
            shift = np.zeros((1, *weight.shape[1:]))
            line = (1 - i) * np.concatenate([weight, shift]) * start + i * np.concatenate([shift, weight]) * end
            off = (elevate_degree(rail, 1) - line) / elevate_degree(weight, 1)
        worst = np.maximum(worst, np.linalg.norm(off, axis=1).max(axis=0))
    return worst


def _bound_quad_twists(rail_and_ruling: Curve, nodes: Array) -> Array:
    """Bound the distance of each bilinear quadrilateral from two triangles along its diagonal, (n - 1,), mm.

    A quarter of the distance h of the fourth corner from the plane of the smaller triangle, if the quadrilateral
    projected on that plane is convex: the bilinear surface is x y h above the plane, and the triangles rise to h beyond
    the diagonal. Else a quarter of the norm of P00 - P10 - P01 + P11.
    """
    value = rail_and_ruling(nodes)
    first, second = value[:, :3], value[:, :3] + value[:, 3:]
    p00, p10, p01, p11 = first[:-1], first[1:], second[:-1], second[1:]
    bound = np.linalg.norm(p00 - p10 - p01 + p11, axis=1) / 4
    lower, upper = np.cross(p10 - p00, p11 - p00), np.cross(p11 - p00, p01 - p00)
    low, up = np.linalg.norm(lower, axis=1), np.linalg.norm(upper, axis=1)
    small = low <= up
    normal, area = np.where(small[:, None], lower, upper), np.minimum(low, up)
    normal = np.divide(normal, area[:, None], out=np.zeros_like(normal), where=area[:, None] > 0)
    height = np.abs((np.where(small[:, None], p01, p10) * normal).sum(axis=1) - (p00 * normal).sum(axis=1))
    corners = [p00, p10, p11, p01]
    convex = np.all(
        [
            (np.cross(corners[i] - corners[i - 1], corners[(i + 1) % 4] - corners[i]) * normal).sum(axis=1) >= 0
            for i in range(4)
        ],
        axis=0,
    )
    return np.where((area == 0) | (convex & (height / 4 < bound)), height / 4, bound)


def _lay_out_triangles(first: Array, second: Array) -> Array:
    """Lay out triangles between two polygons (n, 3) along the diagonals first[i], second[i + 1]: (2, n) complex."""
    p00, p10, p01, p11 = first[:-1], first[1:], second[:-1], second[1:]
    up, out = _angles_between(p01 - p00, p11 - p00), _angles_between(p11 - p00, p10 - p00)
    turn = _angles_between(p00 - p11, p10 - p11) - up
    ruling = np.pi / 2 + np.concatenate([[0.0], np.cumsum(turn)])
    steps = np.linalg.norm(p10 - p00, axis=1) * np.exp(1j * (ruling[:-1] - up - out))
    start = np.concatenate([[0.0], np.cumsum(steps)])
    return np.stack([start, start + np.linalg.norm(second - first, axis=1) * np.exp(1j * ruling)])


def _angles_between(a: Array, b: Array) -> Array:
    """Return the angles (n,) between vectors (n, 3); zero if one of them is."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))


def _triangle_corners(corners: Array) -> tuple[Array, Array, Array]:
    """Return the corners (2 n - 2, ..) of the triangles below the diagonals, then of those above, given (2, n, ..)."""
    first, second = corners
    return (
        np.concatenate([first[:-1], first[:-1]]),
        np.concatenate([first[1:], second[1:]]),
        np.concatenate([second[1:], second[:-1]]),
    )
