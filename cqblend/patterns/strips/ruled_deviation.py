r"""Bounds of the distance between a surface and the ruled surface between two of its isoparametric curves.

Let C1(u) = S(u, v0), C2(u) = S(u, v1), D = C2 - C1. A point S(u, v) is compared with the point of the ruling at the
same u that divides it at a fraction w,

.. math:: E(u, v) = S(u, v) - C_1(u) - w(u, v)\, D(u)

With w continuous, 0 at v0 and 1 at v1, the largest \|E\| bounds the distance both ways. Two choices of w are made:

*Row fractions* (Elber, figure 1): w = sum w_j beta_j, where beta_j are the basis functions in v of S itself, weights
included. For every u that is a B-spline in v with coefficients w_j, hence monotone if they are. In the basis of S the
difference then has the coefficients P_ij - (1 - w_j) C1_i - w_j C2_i, up to weights that are not a product of one
function of u and one of v: those take the common denominator W W1 W2.

*The foot of the perpendicular*, which minimises \|E\|. Its \|E\| is bounded on a patch by that of any other w within
[0, 1], and row fractions, chosen for every patch anew, come as close to it as the patches are small.

All bounds are those of coefficients, sharpened by subdividing the pieces they come from; rounding is added. Depends on
splines only.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from cqblend.errors import GeometryError
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import EPSILON, Array, evaluate_basis, multiply_polynomials, restrict_pieces
from cqblend.splines.coefficient_bounds import find_value_below

_INNER_FRACTIONS = np.arange(1, 12) / 12
"""Of the interval of v of a band, at which its deviation is sampled."""


@dataclass(frozen=True, slots=True, eq=False)
class BezierPieces:
    """A surface in homogeneous Bernstein pieces, to be cut in v.

    Attributes
    ----------
    coefs
        (p+1, q+1, 4, nu, nv); the weight is 1 if the surface is polynomial.
    breaks
        (nu + 1,) and (nv + 1,).
    continuity
        (nu - 1,) in u.
    rational
        Whether rails have weights.
    separable
        Whether the weights are a product of one function of u and one of v, to rounding.
    size
        Largest extent of the control points.
    max_coordinate
        Largest absolute value of a coordinate of the control points.
    """

    coefs: Array
    breaks: tuple[Array, Array]
    continuity: Array
    rational: bool
    separable: bool
    size: float
    max_coordinate: float

    @classmethod
    def from_surface(cls, surface: Surface) -> "BezierPieces":
        """Prepare a surface of dim 3.

        Raises
        ------
        GeometryError
            If a weight is not positive, or all control points coincide.
        """
        coefs = surface.coefs
        if not surface.rational:
            shape = coefs.shape
            coefs = np.concatenate([coefs, np.ones((*shape[:2], 1, *shape[3:]))], axis=2)
        weight = coefs[:, :, 3]
        if weight.min() <= 0:
            raise GeometryError(f"a weight of the surface is {weight.min():.3g}: its deviation cannot be bounded")
        points = coefs[:, :, :3] / weight[:, :, None]
        size = float((points.max(axis=(0, 1, 3, 4)) - points.min(axis=(0, 1, 3, 4))).max())
        if not size > 0:
            raise GeometryError("the surface is a single point: there is nothing to divide into strips")
        table = weight.transpose(0, 2, 1, 3).reshape(weight.shape[0] * weight.shape[2], -1)
        rank_one = np.outer(table[:, 0], table[0]) / table[0, 0]
        separable = bool((np.abs(table - rank_one) <= 32 * EPSILON * table).all())
        max_coordinate = float(np.abs(points).max())
        return cls(coefs, surface.breaks, surface.continuity[0], surface.rational, separable, size, max_coordinate)

    def take_pieces(self, first: int, last: int) -> "BezierPieces":
        """Take the pieces first .. last - 1 in v."""
        u, v = self.breaks
        coefs = self.coefs[..., first:last]
        return replace(self, coefs=coefs, breaks=(u, v[first : last + 1]))

    @property
    def domain(self) -> tuple[float, float]:
        """First and last v."""
        v = self.breaks[1]
        return float(v[0]), float(v[-1])

    @property
    def slack(self) -> float:
        """Rounding, mm, that bounds are enlarged by: of a deviation, and of points of surface and strips in OCCT."""
        return 64 * EPSILON * self.size + 16 * EPSILON * self.max_coordinate

    def cut_bands(self, starts: ArrayLike, ends: ArrayLike) -> "SurfaceBands":
        """Cut bands out: one from v = starts to ends, or several (k,)."""
        low, high = (
            np.atleast_1d(np.asarray(starts, dtype=np.float64)),
            np.atleast_1d(np.asarray(ends, dtype=np.float64)),
        )
        v = self.breaks[1]
        first = np.searchsorted(v[1:-1], low, "right")
        count = np.searchsorted(v[1:-1], high, "left") - first + 1
        owner = np.repeat(np.arange(len(low)), count)
        rank = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
        piece = first[owner] + rank
        start, end = v[piece], v[piece + 1]
        x0 = (np.maximum(start, low[owner]) - start) / (end - start)
        x1 = (np.minimum(end, high[owner]) - start) / (end - start)
        rows = self.coefs[..., piece].swapaxes(0, 1)
        return SurfaceBands(self, restrict_pieces(rows, x0, x1).swapaxes(0, 1), low, high, owner, rank)


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceBands:
    """Bands of a surface, each between two of its isoparametric curves.

    Attributes
    ----------
    surface_pieces
        The surface.
    coefs
        (p+1, q+1, 4, nu, m) homogeneous, the pieces in v of all bands one after the other.
    starts, ends
        (k,) intervals of v.
    owner, rank
        (m,) index of the band that a piece belongs to, and its place in v within that band.
    """

    surface_pieces: BezierPieces
    coefs: Array
    starts: Array
    ends: Array
    owner: Array
    rank: Array

    @property
    def _rail_coefs(self) -> Array:
        """Homogeneous coefficients (p+1, 2, 4, nu, k) of both rails."""
        first = self.rank == 0
        last = np.append(first[1:], True)
        return np.stack([self.coefs[:, 0][..., first], self.coefs[:, -1][..., last]], axis=1)

    def make_rails(self) -> tuple[Curve, Curve]:
        """Return C1 and C2 of a single band."""
        pieces, rails = self.surface_pieces, self._rail_coefs[..., 0]
        components = 4 if pieces.rational else 3
        first, last = (
            Curve(pieces.breaks[0], rails[:, i, :components], rational=pieces.rational, continuity=pieces.continuity)
            for i in (0, 1)
        )
        return first, last

    def is_spannable(self) -> Array:
        """Whether (k,) there is a ruled surface between the rails: they are not both points, nor the same curve."""
        rails = _to_points(self._rail_coefs)
        extents = (rails.max(axis=(0, 3)) - rails.min(axis=(0, 3))).max(axis=1)  # (2, k)
        small = STRIP_TOLERANCES.coincident_points * self.surface_pieces.size
        return np.asarray((extents.max(axis=0) > small) & (self.measure_widths() > small))

    def measure_widths(self) -> Array:
        """Lengths (k,), mm, of the longest of sampled rulings."""
        rails = _to_points(np.tensordot(_sample_basis(len(self.coefs) - 1), self._rail_coefs, (0, 0)))
        return np.asarray(np.linalg.norm(rails[:, 1] - rails[:, 0], axis=1).max(axis=(0, 1)))

    def fit_row_fractions(self, *, middle_column: bool = False) -> Array:
        """Fit a fraction w to every row of control points: (q+1, m), not decreasing from 0 to 1 in every band.

        Rows are projected on the rulings: all columns at once, by least squares, or only the column in the middle of
        the control mesh (if its ends coincide, the one whose ends are farthest apart), as in Elber's figure 1.
        """
        points, rails = _to_points(self.coefs), _to_points(self._rail_coefs)
        chord = rails[:, 1] - rails[:, 0]  # (p+1, 3, nu, k)
        if middle_column:
            square = (chord * chord).sum(axis=1)  # (p+1, nu, k)
            i, piece = self._choose_columns(square)
            band, owner = np.arange(len(i)), self.owner
            chord = chord[i, :, piece, band]  # (k, 3)
            relative = points[i[owner], :, :, piece[owner], np.arange(len(owner))]  # (m, q+1, 3)
            relative = relative - rails[i, 0, :, piece, band][owner, None]
            dots = (relative @ chord[owner, :, None])[..., 0].T
            square = square[i, piece, band]
        else:
            relative = points - rails[:, :1][..., self.owner]
            dots = np.einsum("ijdnm,idnm->jm", relative, chord[..., self.owner])
            square = (chord * chord).sum(axis=(0, 1, 2))
        square = square[self.owner]
        fractions = np.clip(np.divide(dots, square, out=np.zeros_like(dots), where=square > 0), 0.0, 1.0)
        fractions[0, self.rank == 0] = 0.0
        reached = np.zeros(len(self.starts))
        for rank in range(int(self.rank.max()) + 1):
            here = self.rank == rank
            fractions[:, here] = np.maximum(np.maximum.accumulate(fractions[:, here]), reached[self.owner[here]])
            reached[self.owner[here]] = fractions[-1, here]
        fractions[-1, np.append(self.rank[1:] == 0, True)] = 1.0
        return fractions

    def _choose_columns(self, square: Array) -> tuple[Array, Array]:
        """Choose the columns that are projected: index within a piece and index of the piece in u, (k,) each.

        `square` are the squared chords (p+1, nu, k) of all columns.
        """
        degree, pieces, count = square.shape[0] - 1, square.shape[1], square.shape[2]
        piece, i = divmod((degree * pieces + 1) // 2, degree)
        if piece == pieces:
            piece, i = pieces - 1, degree
        rows, columns = np.full(count, i), np.full(count, piece)
        is_zero = square[i, piece] <= (STRIP_TOLERANCES.coincident_points * self.surface_pieces.size) ** 2
        if is_zero.any():
            longest = square[..., is_zero].reshape(-1, int(is_zero.sum())).argmax(axis=0)
            rows[is_zero], columns[is_zero] = np.unravel_index(longest, square.shape[:2])
        return rows, columns

    def make_fraction_surface(self, row_fractions: Array) -> Surface:
        """Return the fraction w(u, v) that row fractions give, over a single band."""
        weight = self.coefs[:, :, 3:]
        coefs = np.concatenate([weight * row_fractions[:, None, None], weight], axis=2)
        v, start, end = self.surface_pieces.breaks[1], self.starts[0], self.ends[0]
        inner = v[(v > start) & (v < end)]
        return Surface((self.surface_pieces.breaks[0], np.concatenate([[start], inner, [end]])), coefs, rational=True)

    def bound_mesh_deviation(self, row_fractions: Array) -> Array:
        """Bounds (k,), mm, of Elber's equation (3) for row fractions: the largest coefficient of the difference.

        Of a rational surface a coefficient is that of the numerator over that of the common denominator, which bounds
        the quotient because all of the latter are positive.
        """
        vectors = _form_deviations(self._build_patches(row_fractions), self.surface_pieces.separable)
        square = np.einsum("ijdn,ijdn->ijn", vectors, vectors).max(axis=(0, 1)).reshape(-1, len(self.owner))
        return np.sqrt(np.maximum.reduceat(square.max(axis=0), np.flatnonzero(self.rank == 0)))

    def _build_patches(self, row_fractions: Array | None) -> Array:
        """Patches (p+1, q+3, 4 or 5, n): rows, then both rails of the band; a fifth component is w times weight."""
        coefs, rails = self.coefs, self._rail_coefs[..., self.owner]
        if row_fractions is not None:
            coefs = np.concatenate([coefs, coefs[:, :, 3:] * row_fractions[:, None, None]], axis=2)
            rails = np.concatenate([rails, np.zeros_like(rails[:, :, :1])], axis=2)
        patches = np.concatenate([coefs, rails], axis=1)
        return patches.reshape(*patches.shape[:3], -1)

    def bound_deviation(self, tolerance: float, row_fractions: Array | None = None) -> float:
        """Bound the deviation of a single band, mm.

        Parameters
        ----------
        tolerance
            Where a deviation just below it is attained, the bound is sharpened until it is below as well, if possible.
        row_fractions
            Of the rows of control points; None for the foot of the perpendicular.

        Returns
        -------
        float
            Not more than 1.01 times a deviation that is attained, except where the bound is below a hundredth of the
            tolerance or would take too many patches. If a deviation above the tolerance is attained, that is returned,
            and need not be a bound. Infinite if the foot of the perpendicular is not proven to move from rail to rail
            without turning back.
        """
        slack, separable = self.surface_pieces.slack, self.surface_pieces.separable
        patches = _split_patches(self._build_patches(row_fractions), 4 if len(self.coefs) > 2 else 2, 4)
        if row_fractions is None and not _has_advancing_feet(patches, separable):
            return np.inf
        attained = settled = 0.0  # largest deviation of a point; largest bound of a patch that is not subdivided
        for level in range(STRIP_TOLERANCES.max_levels):
            vectors = _form_deviations(patches, separable)
            bounds = np.sqrt(np.einsum("ijdn,ijdn->ijn", vectors, vectors).max(axis=(0, 1)))
            attained = max(attained, _measure_corner_deviation(patches, vectors))
            if attained + slack > tolerance:
                return attained + slack
            goal = STRIP_TOLERANCES.bound_ratio * attained
            if goal > tolerance:
                goal = tolerance - slack
            is_open = bounds > max(goal, slack, STRIP_TOLERANCES.negligible_bound * tolerance)
            settled = max(settled, float(bounds[~is_open].max(initial=0.0)))
            if not is_open.any():
                break
            if level == STRIP_TOLERANCES.max_levels - 1 or is_open.sum() > STRIP_TOLERANCES.max_patches:
                settled = max(settled, float(bounds.max()))
                break
            patches = _split_patches(patches[..., is_open], 2, 2)
        return settled + slack


@lru_cache(maxsize=64)
def _sample_basis(degree: int) -> Array:
    """Bernstein polynomials (p+1, 2 p+1) at equal steps."""
    x = np.linspace(0.0, 1.0, 2 * degree + 1)
    return evaluate_basis(degree, 1 - x, x)


@lru_cache(maxsize=64)
def _make_split_matrices(degree: int, count: int) -> Array:
    """Matrices (count, p+1, p+1) from coefficients to those of equal parts."""
    x = np.arange(count + 1) / count
    identity = np.repeat(np.eye(degree + 1)[:, :, None], count, axis=2)
    return np.ascontiguousarray(np.moveaxis(restrict_pieces(identity, x[:-1], x[1:]), -1, 0))


@lru_cache(maxsize=64)
def _make_row_split_matrices(degree: int, count: int) -> Array:
    """Return the same for the rows of patches (q+3): rows are split, the two rails after them stay."""
    out = np.zeros((count, degree + 3, degree + 3))
    out[:, :-2, :-2] = _make_split_matrices(degree, count)
    out[:, -2:, -2:] = np.eye(2)
    return out


def _split_patches(patches: Array, u_parts: int, v_parts: int) -> Array:
    """Cut patches into equal parts in u and in v."""
    p, q, components, n = patches.shape
    columns = _make_split_matrices(p - 1, u_parts).reshape(u_parts * p, p) @ patches.reshape(p, -1)
    rows = columns.reshape(u_parts, p, q, components * n).transpose(2, 0, 1, 3).reshape(q, -1)
    parts = _make_row_split_matrices(q - 3, v_parts).reshape(v_parts * q, q) @ rows
    parts = parts.reshape(v_parts, q, u_parts, p, components, n).transpose(3, 1, 4, 0, 2, 5)
    return parts.reshape(p, q, components, -1)


def _has_advancing_feet(patches: Array, separable: bool) -> bool:
    """Whether on every patch the foot of the perpendicular moves from the first to the last rail."""
    rows, first, last = patches[:, :-2], patches[:, -2:-1], patches[:, -1:]
    if separable:
        steps = np.diff(_to_points(rows), axis=1) * rows[:, :1, 3:4]
        chord = (_to_points(last) - _to_points(first)) * rows[:, :1, 3:4]
    else:
        steps, chord = _subtract_homogeneous(rows[:, :-1], rows[:, 1:]), _subtract_homogeneous(first, last)
    dots = multiply_polynomials(steps, chord).sum(axis=2)
    flat = dots.reshape(len(dots), -1)
    return find_value_below(flat, -STRIP_TOLERANCES.receding_foot * float(np.abs(flat).max())) is None


def _to_points(homogeneous: Array) -> Array:
    """Divide the three coordinates, axis 2, by the weight after them."""
    return np.asarray(homogeneous[:, :, :3] / homogeneous[:, :, 3:4])


def _subtract_homogeneous(first: Array, second: Array) -> Array:
    """Numerator of second - first on the product of the weights; u is the degree axis."""
    return multiply_polynomials(second[:, :, :3], first[:, :, 3:4]) - multiply_polynomials(
        first[:, :, :3], second[:, :, 3:4]
    )


def _form_deviations(patches: Array, separable: bool) -> Array:
    """Return coefficients (r+1, q+1, 3, n) of E, numerators over those of the common denominator.

    The fraction w is the fifth component of the patches over the weight; without that, the rows of every patch are
    projected on its rulings, or its single control points, if weights are not separable and degrees high anyway.
    """
    points = _to_points(patches)
    first = points[:, -2:-1]
    chord = points[:, -1] - first[:, 0]
    relative = points[:, :-2] - first
    rows, weight = patches[:, :-2, :3], patches[:, :-2, 3:4]
    if patches.shape[2] == 5:
        fraction = patches[:, :-2, 4:] / weight
    else:
        dots = np.einsum("ijdn,idn->ijn", relative, chord)
        square = np.einsum("idn,idn->in", chord, chord)[:, None]
        if separable:
            dots, square = dots.sum(axis=0, keepdims=True), square.sum(axis=0, keepdims=True)
        feet = np.divide(dots, square, out=np.zeros_like(dots), where=square > 0)
        fraction = np.clip(feet, 0.0, 1.0)[:, :, None]
    if separable:
        return np.asarray(relative - fraction * chord[:, None])
    rails, w1, w2 = patches[:, -2:], patches[:, -2:-1, 3:4], patches[:, -1:, 3:4]
    both = multiply_polynomials(w1, w2)
    fixed = multiply_polynomials(rows, both) - multiply_polynomials(weight, multiply_polynomials(rails[:, :1, :3], w2))
    moving = multiply_polynomials(weight * fraction, _subtract_homogeneous(rails[:, :1], rails[:, 1:]))
    return np.asarray((fixed - moving) / multiply_polynomials(weight, both))


def _measure_corner_deviation(patches: Array, vectors: Array) -> float:
    """Return the largest deviation at a corner of a patch."""
    if patches.shape[2] == 5:
        off = vectors[[0, -1]][:, [0, -1]]
    else:
        points = _to_points(patches[[0, -1]][:, [0, -3, -2, -1]])
        off = _offset_from_segments(points[:, :2], points[:, 2:3], points[:, 3:], 2)
    return float(np.sqrt(np.einsum("ijdn,ijdn->ijn", off, off).max()))


def _offset_from_segments(
    points: Array, starts: Array, ends: Array, axis: int, *, monotone_axis: int | None = None
) -> Array:
    """Return vectors to points from the nearest points of segments, their feet; coordinates are along an axis.

    Along the axis `monotone_axis`, if given, a foot is not before that of an earlier point.
    """
    chord, relative = ends - starts, points - starts
    square = (chord * chord).sum(axis=axis, keepdims=True)
    dots = (relative * chord).sum(axis=axis, keepdims=True)
    feet = np.clip(np.divide(dots, square, out=np.zeros_like(dots), where=square > 0), 0.0, 1.0)
    if monotone_axis is not None:
        feet = np.maximum.accumulate(feet, axis=monotone_axis)
    return np.asarray(relative - feet * chord)


@dataclass(frozen=True, slots=True, eq=False)
class IsocurveSamples:
    """Isoparametric curves u = const of a surface on a grid of u, to sample the deviations of many bands at once.

    Attributes
    ----------
    coefs
        (nv, q+1, 4, n) homogeneous coefficients in v, of n curves.
    breaks
        (nv + 1,) in v.
    """

    coefs: Array
    breaks: Array

    @classmethod
    def from_pieces(cls, pieces: BezierPieces) -> "IsocurveSamples":
        """Sample a surface at 2 p + 1 parameters u in every piece."""
        rows = np.tensordot(_sample_basis(len(pieces.coefs) - 1), pieces.coefs, (0, 0))  # (x, q+1, 4, nu, nv)
        rows = rows.transpose(4, 1, 2, 3, 0)
        return cls(rows.reshape(*rows.shape[:3], -1), pieces.breaks[1])

    def take_pieces(self, first: int, last: int) -> "IsocurveSamples":
        """Take the pieces first .. last - 1 in v."""
        return IsocurveSamples(self.coefs[first:last], self.breaks[first : last + 1])

    @property
    def poles(self) -> Array:
        """Control points (nv, q+1, 3, n) of the isoparametric curves of the grid."""
        return np.asarray(self.coefs[:, :, :3] / self.coefs[:, :, 3:])

    def evaluate_points(self, v: Array) -> Array:
        """Return the points (.., 3, n) of all curves at parameters v."""
        flat = v.ravel()
        piece = np.searchsorted(self.breaks[1:-1], flat, "right")
        start, end = self.breaks[piece], self.breaks[piece + 1]
        x = (flat - start) / (end - start)
        values = evaluate_basis(self.coefs.shape[1] - 1, 1 - x, x)
        rows = self.coefs[piece]
        found = (values.T[:, None] @ rows.reshape(*rows.shape[:2], -1)).reshape(len(flat), 4, -1)
        return np.asarray((found[:, :3] / found[:, 3:]).reshape(*v.shape, 3, -1))

    def sample_deviations(self, start: float, ends: Array) -> Array:
        """Return the deviations (n,), mm, of the bands from v = start to each of the ends; feet do not turn back.

        Infinite where the rails coincide.
        """
        first, last = self.evaluate_points(np.array([start])), self.evaluate_points(ends)[:, None]
        inner = self.evaluate_points(start + np.multiply.outer(ends - start, _INNER_FRACTIONS))  # (n, inner, 3, nu)
        off = _offset_from_segments(inner, first, last, 2, monotone_axis=1)
        found = np.sqrt((off * off).sum(axis=2).max(axis=(1, 2)))
        return np.where((first != last).any(axis=(1, 2, 3)), found, np.inf)
