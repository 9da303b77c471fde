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

from functools import lru_cache

import numpy as np

from cqblend.patterns.strips.surface_bands import SurfaceBands, to_points
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.splines.bernstein import Array, multiply_polynomials, restrict_pieces
from cqblend.splines.coefficient_bounds import has_value_below


def bound_mesh_deviation(bands: SurfaceBands, row_fractions: Array) -> Array:
    """Bounds (k,), mm, of Elber's equation (3) for row fractions: the largest coefficient of the difference.

    Of a rational surface a coefficient is that of the numerator over that of the common denominator, which bounds
    the quotient because all of the latter are positive.
    """
    vectors = _form_deviations(_build_patches(bands, row_fractions), bands.stack.separable)
    square = np.einsum("ijdn,ijdn->ijn", vectors, vectors).max(axis=(0, 1)).reshape(-1, len(bands.owner))
    return np.sqrt(np.maximum.reduceat(square.max(axis=0), np.flatnonzero(bands.rank == 0)))


def bound_deviation(bands: SurfaceBands, tolerance: float, row_fractions: Array | None = None) -> Array:
    """Bound the deviations of bands, mm.

    Parameters
    ----------
    bands
        k bands.
    tolerance
        Where a deviation just below it is attained, the bound is sharpened until it is below as well, if possible.
    row_fractions
        Of the rows of control points (q+1, m); None for the foot of the perpendicular.

    Returns
    -------
    Array
        (k,). Not more than 1.01 times a deviation that is attained, except where the bound is below a hundredth of the
        tolerance or would take too many patches. If a deviation above the tolerance is attained, that is returned,
        and need not be a bound. Infinite if the foot of the perpendicular is not proven to move from rail to rail
        without turning back.
    """
    count, slacks, separable = len(bands.starts), bands.slacks, bands.stack.separable
    u_parts = 4 if len(bands.coefs) > 2 else 2
    patches = _split_patches(_build_patches(bands, row_fractions), u_parts, 4)
    owner = np.tile(bands.owner, 4 * u_parts * bands.coefs.shape[3])
    result, is_open_band = np.full(count, np.inf), np.ones(count, dtype=bool)
    if row_fractions is None:
        is_open_band = _has_advancing_feet(patches, owner, count, separable)
        patches, owner = _take_open(patches, owner, is_open_band)
    attained, settled = np.zeros(count), np.zeros(count)  # deviations of points; bounds of patches that are not split
    for level in range(STRIP_TOLERANCES.max_levels):
        if not len(owner):
            break
        vectors = _form_deviations(patches, separable)
        bounds = np.sqrt(np.einsum("ijdn,ijdn->ijn", vectors, vectors).max(axis=(0, 1)))
        np.maximum.at(attained, owner, _measure_corner_deviations(patches, vectors))
        is_too_far = is_open_band & (attained + slacks > tolerance)
        result[is_too_far] = (attained + slacks)[is_too_far]
        is_open_band &= ~is_too_far
        goal = STRIP_TOLERANCES.bound_ratio * attained
        goal = np.where(goal > tolerance, tolerance - slacks, goal)
        enough = np.maximum(np.maximum(goal, slacks), STRIP_TOLERANCES.negligible_bound * tolerance)
        is_open = (bounds > enough[owner]) & is_open_band[owner]
        open_count = np.bincount(owner[is_open], minlength=count)
        is_last = (open_count > STRIP_TOLERANCES.max_patches) | (level == STRIP_TOLERANCES.max_levels - 1)
        is_open &= ~is_last[owner]
        np.maximum.at(settled, owner[~is_open], bounds[~is_open])
        patches, owner = patches[..., is_open], owner[is_open]
        if len(owner):
            patches, owner = _split_patches(patches, 2, 2), np.tile(owner, 4)
    result[is_open_band] = (settled + slacks)[is_open_band]
    return result


def _take_open(patches: Array, owner: Array, is_open_band: Array) -> tuple[Array, Array]:
    """Take the patches of bands that are still of interest."""
    if is_open_band.all():
        return patches, owner
    is_open = is_open_band[owner]
    return patches[..., is_open], owner[is_open]


def _build_patches(bands: SurfaceBands, row_fractions: Array | None) -> Array:
    """Patches (p+1, q+3, 4 or 5, n): rows, then both rails of the band; a fifth component is w times weight."""
    coefs, rails = bands.coefs, bands.rail_coefs[..., bands.owner]
    if row_fractions is not None:
        coefs = np.concatenate([coefs, coefs[:, :, 3:] * row_fractions[:, None, None]], axis=2)
        rails = np.concatenate([rails, np.zeros_like(rails[:, :, :1])], axis=2)
    patches = np.concatenate([coefs, rails], axis=1)
    return patches.reshape(*patches.shape[:3], -1)


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


def _has_advancing_feet(patches: Array, owner: Array, count: int, separable: bool) -> Array:
    """Whether (count,) on every patch of a band the foot of the perpendicular moves from the first to the last rail.

    The patches (p+1, q+3, 4, n) belong to the bands `owner` (n,).
    """
    rows, first, last = patches[:, :-2], patches[:, -2:-1], patches[:, -1:]
    if separable:
        steps = np.diff(to_points(rows), axis=1) * rows[:, :1, 3:4]
        chord = (to_points(last) - to_points(first)) * rows[:, :1, 3:4]
    else:
        steps, chord = _subtract_homogeneous(rows[:, :-1], rows[:, 1:]), _subtract_homogeneous(first, last)
    dots = multiply_polynomials(steps, chord).sum(axis=2)  # (r+1, q, n)
    largest = np.zeros(count)
    np.maximum.at(largest, owner, np.abs(dots).max(axis=(0, 1)))
    relative = np.divide(dots, largest[owner], out=np.zeros_like(dots), where=largest[owner] > 0)
    flat = relative.reshape(len(dots), -1)
    return ~has_value_below(flat, -STRIP_TOLERANCES.receding_foot, np.tile(owner, dots.shape[1]), count)


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
    points = to_points(patches)
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


def _measure_corner_deviations(patches: Array, vectors: Array) -> Array:
    """Return the largest deviation (n,) at a corner of every patch."""
    if patches.shape[2] == 5:
        off = vectors[[0, -1]][:, [0, -1]]
    else:
        points = to_points(patches[[0, -1]][:, [0, -3, -2, -1]])
        off = offset_from_segments(points[:, :2], points[:, 2:3], points[:, 3:], 2)
    return np.asarray(np.sqrt(np.einsum("ijdn,ijdn->ijn", off, off).max(axis=(0, 1))))


def offset_from_segments(
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
