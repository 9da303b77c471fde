r"""Ruled strips laid flat, at nodes chosen so that what lies between them is within a tolerance, and rolled back.

The default lays rails and rulings flat with all their lengths (see :mod:`cqblend.patterns.flatten.development`),
exactly on developables. ``layout="triangles"`` is the paper's strip of triangles. Must not know neighbours, trimming,
or pieces.

References
----------
G. Elber: Model fabrication using surface layout projection (1995), section 2, equation (4) and figure 4.
"""

from dataclasses import dataclass
from math import isfinite
from typing import Literal, Protocol

import numpy as np
from numpy.typing import ArrayLike

from cqblend.errors import GeometryError, InputError, shown
from cqblend.patterns.flatten.arc_length import ArcLength
from cqblend.patterns.flatten.development import RailDevelopment, RulingMotion, develop_rails, strain_from_turn
from cqblend.patterns.outline import plane_path
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.strips.developability import (
    RailPair,
    StripKind,
    bound_normal_turn,
    check_rails,
    classify_strip,
    stack_rail_and_ruling,
)
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array, elevate_degree
from cqblend.splines.bracketing import solve_in_brackets
from cqblend.splines.evaluation import locate_pieces
from cqblend.splines.integral import Antiderivative

Layout = Literal["smooth", "triangles"]
"""How a strip is laid flat: rails and rulings with their lengths, or the paper's triangles."""

MAX_SEGMENTS = 20_000
"""Segments along a rail at most."""

_CANDIDATE_COUNT = 3
_GOLDEN_RATIO = (np.sqrt(5) - 1) / 2
_BLOCK_SIZE = 512


class StripChart(Protocol):
    """The maps between a strip's parameters, the plane, and space."""

    def to_plane(self, t: Array, w: Array) -> Array:
        """Return the points (m,) in the plane, complex, at (t, w)."""

    def to_space(self, points: Array) -> Array:
        """Return where points (m,) of the plane, complex, are in space, (m, 3)."""

    def to_parameters(self, points: Array) -> tuple[Array, Array]:
        """Return the (t, w) that are nearest to points (m,) of the plane, complex."""


@dataclass(frozen=True, slots=True, eq=False)
class FlatStrip:
    r"""A strip laid flat.

    Attributes
    ----------
    kind
        Of the ruled surface.
    layout
        ``"smooth"`` or ``"triangles"``.
    nodes
        (n,) increasing parameters along the rails.
    first, second
        (n, 2), mm: the rails at the nodes, in the plane.
    lengths
        (2, n - 1), mm: of the rails between nodes; arc lengths in space, or chords for ``"triangles"``.
    error
        Mm. For developables the distance of the outline, of arcs between nodes, from the exact one. For twisted strips
        also the distance between the ruled surface and triangles along it: equation (4), from coefficients, and the
        twist of each quadrilateral. There are as many triangles as the tolerance takes, up to 20000 along a rail; they
        need not be between the nodes, because strips of ever narrower triangles have this layout as their limit. For
        ``"triangles"``, whose triangles are between the nodes, the same distance.
    ruling
        Largest error of a ruling's length at a node, relative.
    turn
        Bound of the angle between the normals at the two ends of a ruling, rad; zero for developables.
    strain
        By how much a length inside the strip is too long in the plane, relative, at most: 1 / cos(turn / 2) - 1. Zero
        for developables; nan for ``"triangles"``.
    area_space, area_flat
        Mm^2: of the ruled surface, and of the flat strip.
    chart
        The maps.
    """

    kind: StripKind
    layout: Layout
    nodes: Array
    first: Array
    second: Array
    lengths: Array
    error: float
    ruling: float
    turn: float
    strain: float
    area_space: float
    area_flat: float
    chart: StripChart

    def __call__(self, t: ArrayLike, w: ArrayLike) -> Array:
        """Return the points in the plane at parameters t along the rails and fractions w of the rulings, (.., 2)."""
        t, w = np.broadcast_arrays(np.asarray(t, dtype=np.float64), np.asarray(w, dtype=np.float64))
        return _to_coordinates(self.chart.to_plane(t.ravel(), w.ravel())).reshape(*t.shape, 2)

    def fold(self, points: ArrayLike) -> Array:
        """Roll points (.., 2) of the flat strip back into space, (.., 3).

        Points a little outside are taken as they continue the rulings or triangles next to them.
        """
        points = np.asarray(points, dtype=np.float64)
        flat = points.reshape(-1, 2)
        return self.chart.to_space(flat[:, 0] + 1j * flat[:, 1]).reshape(*points.shape[:-1], 3)

    def to_parameters(self, points: ArrayLike) -> tuple[Array, Array]:
        """Return the parameters t and the fractions w, within the strip, of points (n, 2) of the plane: (n,) each."""
        x, y = np.asarray(points, dtype=np.float64).T
        t, w = self.chart.to_parameters(x + 1j * y)
        return np.clip(t, self.nodes[0], self.nodes[-1]), np.clip(w, 0.0, 1.0)

    def make_rail_path(self, side: int) -> Path:
        """Return the first (0) or second (1) rail through its nodes: arcs of the rail's lengths, or straight chords."""
        points = self.second if side else self.first
        if self.layout == "triangles":
            return Path.from_points(points)
        middle = self((self.nodes[:-1] + self.nodes[1:]) / 2, float(side))
        return Path(points, _find_bulges(points, middle, self.lengths[side]))


def flatten_rails(
    rails: RailPair,
    tolerance: float,
    *,
    nodes: ArrayLike = (),
    kind: StripKind | None = None,
    flip: bool = False,
    layout: Layout = "smooth",
) -> FlatStrip:
    r"""Lay the ruled strip between two rails flat.

    Parameters
    ----------
    rails
        C1 and C2: dim 3, one domain, polynomial or rational; one may be a point. The strip is (1 - w) C1(t) + w C2(t).
    tolerance
        Mm, of :attr:`Flat.error`: nodes are added until it is met.
    nodes
        Parameters that are to be among the nodes.
    kind
        Of the strip, where it is known; else it is found out, see :func:`classify`.
    flip
        The strip shows the side to which R_t x R_w points, with t to the right and w up where it starts. True mirrors
        it, to show the other side.
    layout
        ``"smooth"``: rails and rulings keep their lengths; isometric if the strip is developable. ``"triangles"``: the
        paper's 2 n triangles between equidistant parameters, one diagonal, chords.

    Raises
    ------
    InputError
        If an argument is none of that.
    GeometryError
        If there is no strip, if rulings meet inside it, or if more than 20000 segments would be needed.

    References
    ----------
    Elber (1995), section 2.

    Examples
    --------
    >>> arc = Curve.bezier([[1.0, 0, 0], [1, 1, 0], [0, 1, 0]], [1.0, np.sqrt(0.5), 1.0])
    >>> flat = flatten((arc, arc + [0, 0, 2]), 0.01)
    >>> flat.kind, len(flat.nodes), bool(abs(flat(1.0, 1.0) - [np.pi / 2, 2]).max() < 1e-14)
    ('cylinder', 2, True)
    """
    rails = check_rails(rails)
    if not (isinstance(tolerance, (int, float)) and isfinite(tolerance) and tolerance > 0):
        raise InputError(f"tolerance {shown(tolerance)}: it must be a positive number")
    if layout not in ("smooth", "triangles"):
        raise InputError(f"layout {shown(layout)}: choose 'smooth' or 'triangles'")
    both = stack_rail_and_ruling(rails)
    start, end = both.domain
    wanted = np.asarray(nodes, dtype=np.float64).ravel()
    slack = 1e-12 * (end - start)
    if not np.isfinite(wanted).all() or (wanted < start - slack).any() or (wanted > end + slack).any():
        raise InputError(f"nodes must lie in the rails' domain [{start:.9g}, {end:.9g}], not {shown(wanted)}")
    initial = _merge_nodes(both.breaks, wanted, slack)
    known = classify_strip(rails) if kind is None else kind
    turn = bound_normal_turn(rails) if known == "twisted" else 0.0
    motion = RulingMotion(rails, checked=layout == "smooth")
    areas = Antiderivative(lambda t: np.dot([1.0, 1j], motion.compute_area_rates(t)), both.breaks)  # flat, and in space
    space, plane = float(areas.values[-1].imag), float(areas.values[-1].real)
    mirror = -1.0 if flip else 1.0
    if layout == "triangles":
        return _flatten_as_triangles(both, initial, tolerance, known, mirror, space, turn)
    smooth = _RulingChart(both, develop_rails(rails, known), mirror)
    lengths = ArcLength(rails[0]), ArcLength(rails[1])
    at, error = _refine_nodes(smooth, lengths, initial, tolerance)
    if known == "twisted":
        error = max(error, _bound_triangle_error(both, at, tolerance))
    first, second = smooth.map_rails(at)
    rulings = np.linalg.norm(both(at)[:, 3:], axis=1)
    return FlatStrip(
        kind=known,
        layout=layout,
        nodes=at,
        first=_to_coordinates(first),
        second=_to_coordinates(second),
        lengths=np.stack([_measure_steps(length, at) for length in lengths]),
        error=error,
        ruling=_max_relative_error(np.abs(second - first), rulings),
        turn=turn,
        strain=strain_from_turn(turn),
        area_space=space,
        area_flat=plane if known == "twisted" else space,
        chart=smooth,
    )


def _merge_nodes(breaks: Array, wanted: Array, slack: float) -> Array:
    """Merge breaks and nodes; nodes give way to breaks, and to earlier nodes, that they equal to rounding."""
    new = np.unique(wanted)
    new = new[np.abs(new[:, None] - breaks).min(axis=1) > slack]
    new = new[np.diff(new, prepend=-np.inf) > slack]
    return np.sort(np.concatenate([breaks, new]))


def _measure_steps(length: ArcLength, nodes: Array) -> Array:
    """Return arc lengths between nodes; where a rail stands still but for rounding, zero."""
    steps = np.diff(length(nodes))
    return np.where(steps > 1e-14 * length.length, steps, 0.0)


def _max_relative_error(found: Array, wanted: Array) -> float:
    """Largest relative error; of lengths that are zero to rounding, none."""
    real = wanted > 1e-12 * wanted.max()
    return float((np.abs(found - wanted)[real] / wanted[real]).max())


def _to_coordinates(points: Array) -> Array:
    return np.stack([points.real, points.imag], axis=-1)


def _cross_complex(a: Array, b: Array) -> Array:
    return np.asarray(a.real * b.imag - a.imag * b.real)


def _find_bulges(points: Array, middle: Array, lengths: Array) -> Array:
    """Bulges of arcs of given lengths through points (n, 2), on the side of (n - 1, 2) points between."""
    chord, to_middle = np.diff(points, axis=0), middle - points[:-1]
    left = chord[:, 0] * to_middle[:, 1] - chord[:, 1] * to_middle[:, 0]
    return np.where(lengths > 0, -np.sign(left) * plane_path.solve_bulges(np.linalg.norm(chord, axis=1), lengths), 0.0)


# -- lengths kept


@dataclass(frozen=True, slots=True, eq=False)
class _RulingChart:
    """Chart of rulings that stay straight, given where their ends are."""

    both: Curve
    development: RailDevelopment
    mirror: float

    def map_rails(self, t: Array) -> tuple[Array, Array]:
        first, second = self.development(t)
        return (first, second) if self.mirror > 0 else (-first.conj(), -second.conj())

    def to_plane(self, t: Array, w: Array) -> Array:
        first, second = self.map_rails(t)
        return first + w * (second - first)

    def to_space(self, points: Array) -> Array:
        t, w = self.to_parameters(points)
        value = self.both(t)
        return np.asarray(value[:, :3] + w[:, None] * value[:, 3:])

    def to_parameters(self, points: Array) -> tuple[Array, Array]:
        """Return (t, w) of points: the ruling through each, found between two of many.

        Where several come near a point, as next to an edge of regression, that on which it lies is taken.
        """
        breaks = self.both.breaks
        t = np.append((breaks[:-1, None] + np.diff(breaks)[:, None] * np.arange(64) / 64).ravel(), breaks[-1])
        first, second = self.map_rails(t)
        blocks = [points[i : i + _BLOCK_SIZE] for i in range(0, len(points), _BLOCK_SIZE)]
        index = np.concatenate([_find_nearest_intervals(block, first, second) for block in blocks]).T
        size = float(np.abs(np.concatenate([first, second])).max())
        found = self._solve_rulings(t[index].ravel(), t[index + 1].ravel(), np.tile(points, len(index)), size)
        along, w, off = (f.reshape(index.shape) for f in found)
        best = off.argmin(axis=0), np.arange(len(points))
        along, w, off = along[best], w[best], off[best]
        lost = off > 1e-9 * size
        if lost.any():
            near = index[0, lost]
            found = self._solve_rulings(
                *self._separate_double_roots(t[near], t[near + 1], points[lost]), points[lost], size
            )
            better = found[2] < off[lost]
            along[lost], w[lost] = np.where(better, found[:2], (along[lost], w[lost]))
        return along, w

    def _separate_double_roots(self, low: Array, high: Array, points: Array) -> tuple[Array, Array]:
        """Part intervals with two roots, where rulings on both sides of an edge of regression pass through a point.

        The root at which the miss changes as it does within strips is on one side of its extremum, which golden section
        finds. Where that is no root either, the interval becomes the extremum, which touches zero at the edge.
        """
        sign = np.sign(self._signed_miss(low, points))
        a, b = low, high
        for _ in range(45):
            c, d = b - _GOLDEN_RATIO * (b - a), a + _GOLDEN_RATIO * (b - a)
            left = sign * self._signed_miss(c, points) < sign * self._signed_miss(d, points)
            a, b = np.where(left, a, c), np.where(left, d, b)
        middle = (a + b) / 2
        crossed = sign * self._signed_miss(middle, points) < 0
        rising = sign * self.mirror > 0
        return np.where(crossed & ~rising, low, middle), np.where(crossed & rising, high, middle)

    def _solve_rulings(self, low: Array, high: Array, points: Array, size: float) -> tuple[Array, Array, Array]:
        """Return t, w, and by how much points are off the strip there."""
        miss_low, miss_high = self._signed_miss(low, points), self._signed_miss(high, points)
        t = solve_in_brackets(
            lambda t: self._signed_miss(t, points), (low, high), (miss_low, miss_high), 1e-15 * size**2
        )
        first, second = self.map_rails(t)
        ruling = second - first
        square = np.abs(ruling) ** 2
        along = ((points - first) * ruling.conj()).real
        w = np.divide(along, square, out=np.zeros(len(t)), where=square > 0)
        return t, w, np.abs(points - first - np.clip(w, 0.0, 1.0) * ruling)

    def _signed_miss(self, t: Array, points: Array) -> Array:
        first, second = self.map_rails(t)
        return _cross_complex(second - first, points - first)


def _find_nearest_intervals(points: Array, first: Array, second: Array) -> Array:
    """Find the intervals between rulings that each point lies in, or is nearest to, best first: (m, 3)."""
    ruling = second - first
    to = points[:, None] - first
    miss = _cross_complex(ruling, to)
    before, after = miss[:, :-1], miss[:, 1:]
    part = np.divide(before, before - after, out=np.zeros_like(before), where=before != after)
    part = np.clip(part, 0.0, 1.0)
    foot = first[:-1] + part * np.diff(first)
    there = ruling[:-1] + part * np.diff(ruling)
    square = np.abs(there) ** 2
    w = np.divide(((points[:, None] - foot) * there.conj()).real, square, out=np.zeros_like(part), where=square > 0)
    off = np.abs(points[:, None] - foot - np.clip(w, 0.0, 1.0) * there)
    return np.asarray(np.argsort(off, axis=1)[:, :_CANDIDATE_COUNT])


def _refine_nodes(
    smooth: _RulingChart, lengths: tuple[ArcLength, ArcLength], nodes: Array, tolerance: float
) -> tuple[Array, float]:
    """Add nodes until arcs between them are close enough to the flat rails."""
    while True:
        off = _measure_arc_error(smooth, lengths, nodes, tolerance)
        if off.max() <= tolerance:
            return nodes, float(off.max())
        nodes = _split_intervals(nodes, np.where(off <= tolerance, 1, 2), tolerance)


def _bound_triangle_error(both: Curve, nodes: Array, tolerance: float) -> float:
    """Bound the distance of a ruled surface from triangles, of which there are as many as it takes, within limits."""
    while True:
        chord, quad = _bound_chord_deviations(both, nodes), _bound_quad_twists(both, nodes)
        worst = float((chord + quad).max())
        parts = _count_parts(chord, quad, tolerance)
        if worst <= tolerance or parts.sum() > MAX_SEGMENTS:
            return worst
        nodes = _split_intervals(nodes, parts, tolerance)


def _count_parts(chord: Array, quad: Array, tolerance: float) -> Array:
    """How many parts an interval needs: chord deviations fall with the square of the length, twists with the length."""
    need = np.maximum(np.sqrt(2 * chord / tolerance), 2 * quad / tolerance)
    return np.where(chord + quad > tolerance, np.clip(np.ceil(need), 2, 64), 1).astype(int)


def _split_intervals(nodes: Array, parts: Array, tolerance: float) -> Array:
    if parts.sum() > MAX_SEGMENTS:
        raise GeometryError(
            f"more than {MAX_SEGMENTS} segments along the strip would be needed for a tolerance of {tolerance:.3g}: "
            "raise it, "
            "or divide the strip into narrower ones"
        )
    which = np.repeat(np.arange(len(parts)), parts)
    part = (np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[which]
    return np.append(nodes[which] + part * np.diff(nodes)[which], nodes[-1])


def _measure_arc_error(
    smooth: _RulingChart, lengths: tuple[ArcLength, ArcLength], nodes: Array, tolerance: float
) -> Array:
    """Distances of the flat rails from arcs of their lengths, (n - 1,); infinite where a long arc is no good."""
    count = plane_path.ARC_SAMPLES
    t = nodes[:-1, None] + np.diff(nodes)[:, None] * np.arange(count) / count
    t = np.append(t.ravel(), nodes[-1])
    worst = np.zeros(len(nodes) - 1)
    for length, points in zip(lengths, smooth.map_rails(t), strict=True):
        whole = _measure_steps(length, t[::count])
        flat = _to_coordinates(points)
        corners = flat[::count]
        path = Path(corners, _find_bulges(corners, flat[count // 2 :: count], whole))
        off = plane_path.measure_arc_deviations(path, flat[:-1].reshape(-1, count, 2)[:, 1:])
        worst = np.maximum(worst, np.where((path.chords < 0.9 * whole) & (whole > tolerance), np.inf, off))
    return worst


# -- triangles


def _bound_chord_deviations(both: Curve, nodes: Array) -> Array:
    r"""Bound equation (4), \|C_i - chord\| at equal parameters, between nodes: (n - 1,), from coefficients."""
    cut = both.cut(nodes)
    coefs = cut.coefs
    weight = coefs[:, 6:] if both.rational else np.ones((1, 1, coefs.shape[2]))
    worst = np.zeros(coefs.shape[2])
    for rail in (coefs[:, :3], coefs[:, :3] + coefs[:, 3:6]):
        if not both.rational:
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


def _bound_quad_twists(both: Curve, nodes: Array) -> Array:
    """Bound the distance of each bilinear quadrilateral from two triangles along its diagonal, (n - 1,).

    A quarter of the distance of the fourth corner from the plane of the smaller triangle, if the quadrilateral
    projected on that plane is convex: the bilinear is x y times that distance above the plane, and the triangles rise
    to it beyond the diagonal. Else a quarter of P00 - P10 - P01 + P11.
    """
    value = both(nodes)
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


def _flatten_as_triangles(
    both: Curve, nodes: Array, tolerance: float, kind: StripKind, mirror: float, area_space: float, turn: float
) -> FlatStrip:
    """Refine uniformly until the triangles are close enough, and lay them out (figure 4)."""
    initial = nodes
    count = 1
    while True:
        error = _bound_chord_deviations(both, nodes) + _bound_quad_twists(both, nodes)
        if error.max() <= tolerance:
            break
        count *= 2
        nodes = _split_intervals(initial, np.full(len(initial) - 1, count), tolerance)
    value = both(nodes)
    corners = np.stack([value[:, :3], value[:, :3] + value[:, 3:]])
    flat = _lay_out_triangles(corners[0], corners[1])
    if mirror < 0:
        flat = -flat.conj()
    triangles = _TriangleChart(nodes, flat, corners)
    rulings = np.linalg.norm(value[:, 3:], axis=1)
    quads = _cross_complex(flat[0, 1:] - flat[1, :-1], flat[1, 1:] - flat[0, :-1])
    return FlatStrip(
        kind=kind,
        layout="triangles",
        nodes=nodes,
        first=_to_coordinates(flat[0]),
        second=_to_coordinates(flat[1]),
        lengths=np.linalg.norm(np.diff(corners, axis=1), axis=2),
        error=float(error.max()),
        ruling=_max_relative_error(np.abs(flat[1] - flat[0]), rulings),
        turn=turn,
        strain=np.nan,
        area_space=area_space,
        area_flat=float(np.abs(quads.sum()) / 2),
        chart=triangles,
    )


def _lay_out_triangles(first: Array, second: Array) -> Array:
    """Lay out the triangles between two polygons (n, 3) along the diagonals first[i], second[i + 1]: (2, n) complex."""
    p00, p10, p01, p11 = first[:-1], first[1:], second[:-1], second[1:]
    up, out = _angles_between(p01 - p00, p11 - p00), _angles_between(p11 - p00, p10 - p00)
    turn = _angles_between(p00 - p11, p10 - p11) - up
    ruling = np.pi / 2 + np.concatenate([[0.0], np.cumsum(turn)])
    steps = np.linalg.norm(p10 - p00, axis=1) * np.exp(1j * (ruling[:-1] - up - out))
    start = np.concatenate([[0.0], np.cumsum(steps)])
    return np.stack([start, start + np.linalg.norm(second - first, axis=1) * np.exp(1j * ruling)])


def _angles_between(a: Array, b: Array) -> Array:
    """Angles between vectors (n, 3); zero if one of them is."""
    return np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class _TriangleChart:
    """Chart of triangles, affine on each: nodes (n,), corners in the plane (2, n), complex, and in space (2, n, 3)."""

    nodes: Array
    corners: Array
    in_space: Array

    def to_plane(self, t: Array, w: Array) -> Array:
        cell, _, x, _ = locate_pieces(self.nodes, t)
        (p00, p01), (p10, p11) = self.corners[:, cell], self.corners[:, cell + 1]
        return np.where(x >= w, p00 + x * (p10 - p00) + w * (p11 - p10), p00 + w * (p01 - p00) + x * (p11 - p01))

    def to_space(self, points: Array) -> Array:
        return self._interpolate_values(points, _triangle_corners(self.in_space))

    def to_parameters(self, points: Array) -> tuple[Array, Array]:
        along = np.tile(self.nodes, (2, 1))
        parameters = np.stack([along, np.broadcast_to([[0.0], [1.0]], along.shape)], axis=-1)
        t, w = self._interpolate_values(points, _triangle_corners(parameters)).T
        return t, w

    def _interpolate_values(self, points: Array, values: tuple[Array, Array, Array]) -> Array:
        """Return values (m, k), linear on each triangle, at points of the plane, given those at the corners."""
        a, b, c = _triangle_corners(self.corners)
        out = np.empty((len(points), values[0].shape[1]))
        with np.errstate(divide="ignore", invalid="ignore"):
            for start in range(0, len(points), 512):
                to = points[start : start + 512, None] - a
                area = _cross_complex(b - a, c - a)
                x, y = _cross_complex(to, c - a) / area, _cross_complex(b - a, to) / area
                inside = np.nan_to_num(np.minimum(np.minimum(x, y), 1 - x - y), nan=-np.inf, neginf=-np.inf)
                best = inside.argmax(axis=1)
                x, y = (np.take_along_axis(f, best[:, None], axis=1) for f in (x, y))
                first, second, third = (value[best] for value in values)
                out[start : start + 512] = first + x * (second - first) + y * (third - first)
        return out


def _triangle_corners(corners: Array) -> tuple[Array, Array, Array]:
    """Corners of the triangles below the diagonals, then of those above."""
    first, second = corners
    return (
        np.concatenate([first[:-1], first[:-1]]),
        np.concatenate([first[1:], second[1:]]),
        np.concatenate([second[1:], second[:-1]]),
    )
