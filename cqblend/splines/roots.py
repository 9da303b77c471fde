"""Sign changes of Bernstein polynomials in (0, 1), many at a time, to full precision.

Needed to cut a curve where it crosses the knot lines of a surface. A control polygon without sign change has no root.
Up to degree 2 roots are in closed form; cubics are cut where their slope is zero, and have one root at most in each
part. Of higher degrees roots are isolated by Descartes' rule under eight-fold subdivision, and found by Newton's method
in a bracket. A coefficient within the tolerance counts as zero, so that subdivision ends at tangencies, at curves that
run along a line, and at rounding noise. Depends on the arithmetic of coefficients only.
"""

from functools import lru_cache

import numpy as np

from cqblend.splines.bernstein import EPSILON, Array, restrict_pieces
from cqblend.splines.tolerances import SPLINE_LIMITS

_PARTS_PER_LEVEL = 8


@lru_cache(maxsize=64)
def _build_subdivision_matrix(degree: int) -> Array:
    """Matrix (8, p+1, p+1) from coefficients to those of the eight equal parts; convex combinations only."""
    x = np.arange(_PARTS_PER_LEVEL + 1) / _PARTS_PER_LEVEL
    identity = np.repeat(np.eye(degree + 1)[:, :, None], _PARTS_PER_LEVEL, axis=2)
    return np.ascontiguousarray(np.moveaxis(restrict_pieces(identity, x[:-1], x[1:]), -1, 0))


def _fill_signs(f: Array) -> Array:
    """Signs down each column; a zero has the sign of what is above it."""
    sign: Array = np.sign(f)
    if not sign.all():
        for i in range(1, len(sign)):
            np.copyto(sign[i], sign[i - 1], where=sign[i] == 0)
    return sign


def _find_changes(sign: Array) -> Array:
    """Where a sign differs from that above it, zeros apart, one row less."""
    return np.asarray(sign[1:] * sign[:-1] < 0)


def _solve_quadratics(f: Array) -> Array:
    """Roots in (0, 1) of quadratics f (3, n): (2, n) in increasing order, with 1 in place of those that are missing.

    For r = t / (1 - t) they are the positive roots of f0 + 2 f1 r + f2 r^2.
    """
    first, middle, last = f
    with np.errstate(divide="ignore", invalid="ignore"):
        q = -middle - np.copysign(np.sqrt(middle * middle - first * last), middle)
        roots = np.array([q / (q + last), first / (q + first)])  # r = q / f2 and r = f0 / q
        roots[~((roots > 0) & (roots < 1))] = 1.0
    roots.sort(axis=0)
    return roots


def _solve_cubics(f: Array, tolerance: Array) -> tuple[Array, Array]:
    """Column and parameter of each sign change of cubics f (4, n) in (0, 1).

    Between the places where its slope is zero a cubic is monotone: there is one root if the ends differ in sign, and
    none otherwise.
    """
    turns = _solve_quadratics(f[1:] - f[:-1])
    turns = turns[np.minimum.reduce(turns, axis=1) < 1]
    ends = np.empty((len(turns) + 2, f.shape[1]))
    ends[0], ends[1:-1], ends[-1] = 0.0, turns, 1.0
    values = np.empty_like(ends)
    values[0], values[-1] = f[0], f[-1]
    if len(turns):
        values[1:-1] = _drop_noise(_evaluate_with_slope(f[:, None], turns)[0], tolerance)
    part, column = _find_changes(_fill_signs(values)).nonzero()
    f, low, high = f[:, column], ends[part, column], ends[part + 1, column]
    before = values[part, column]
    share = before / (before - values[part + 1, column])
    if len(turns):  # the root of a parabola, or of a cubic, that has slope zero where this one has; else that of a line
        rises_slowly, ends_slowly = part > 0, high < 1
        share = np.where(
            rises_slowly,
            np.where(ends_slowly, 0.5 - np.sin(np.arcsin(1 - 2 * share) / 3), np.sqrt(share)),
            np.where(ends_slowly, 1 - np.sqrt(1 - share), share),
        )
    t = low + share * (high - low)
    c1, c2, c3 = 3 * (f[1] - f[0]), 3 * (f[0] - 2 * f[1] + f[2]), f[3] - f[0] + 3 * (f[1] - f[2])
    with np.errstate(divide="ignore", invalid="ignore"):
        for _ in range(_HALLEY_STEPS):
            a = c3 * t
            b = a + c2
            c = b * t + c1
            value, slope, bend = c * t + f[0], c + t * (b + a), b + a + a
            step = value * slope / (slope * slope - value * bend)
            t = np.minimum(np.maximum(t - step, low), high)
        value, slope = _evaluate_with_slope(f, t)
        step = value / slope
        new = np.minimum(np.maximum(t - step, low), high)
        settled = (step * step <= EPSILON * np.minimum(t - low, high - t)) | (np.abs(value) <= _bound_noise(f))
    (unsettled,) = (~settled).nonzero()
    if len(unsettled):
        low, high = low[unsettled], high[unsettled]
        parts = restrict_pieces(f[:, unsettled], low, high)
        new[unsettled] = low + (high - low) * _solve_single_roots(parts)
    return column, new


_HALLEY_STEPS = 3
"""Steps from a first guess to a root of a cubic; each triples the number of digits that are right."""


def _bound_noise(f: Array) -> Array:
    """Value (n,) up to which polynomials (p+1, n) are zero to rounding."""
    return np.asarray(2 * EPSILON * np.maximum.reduce(np.abs(f)))


def _evaluate_with_slope(f: Array, t: Array) -> tuple[Array, Array]:
    """Values and slopes of polynomials (p+1, n), one at each t (n,)."""
    s, c = 1 - t, f
    for _ in range(len(f) - 2):  # de Casteljau, which yields the slope as well
        c = s * c[:-1] + t * c[1:]
    return s * c[0] + t * c[1], (len(f) - 1) * (c[1] - c[0])


def _solve_single_roots(f: Array) -> Array:
    """Find the root of each column of f, which has exactly one sign change, by Newton inside a shrinking bracket."""
    degree, count = len(f) - 1, f.shape[1]
    columns = np.arange(count)
    sign = np.sign(f)
    left_sign = sign[(sign != 0).argmax(axis=0), columns]
    change = (sign * left_sign < 0).argmax(axis=0)
    before, after = np.abs(f[change - 1, columns]), np.abs(f[change, columns])
    t: Array = (change - 1 + before / (before + after)) / degree
    if degree == 1:
        return t
    noise = _bound_noise(f)
    lo, hi = np.zeros(count), np.ones(count)
    for _ in range(80):
        value, rise = _evaluate_with_slope(f, t)
        left = value * left_sign > 0
        lo, hi = np.where(left, t, lo), np.where(left, hi, t)
        new = t - value / np.where(rise == 0, 1.0, rise)
        new = np.where((new >= lo) & (new <= hi) & (rise != 0), new, (lo + hi) / 2)
        done = (np.abs(new - t) <= 4 * EPSILON) | (np.abs(value) <= noise)
        t = new
        if done.all():
            break
    return t


def _drop_noise(f: Array, tolerance: Array) -> Array:
    """Coefficients with those up to the tolerance made zero."""
    small = np.abs(f) <= tolerance
    return np.where(small, 0.0, f) if small.any() else f


def find_sign_changes(f: Array, tolerance: Array | float) -> tuple[Array, Array]:
    """Where the columns of f change sign inside (0, 1).

    Parameters
    ----------
    f
        (p+1, n) Bernstein coefficients.
    tolerance
        Coefficients up to this absolute value count as zero; a number, or (n,) one for each column.

    Returns
    -------
    columns, roots
        Index of the column and parameter, one entry each for every sign change, in no particular order. Points of
        tangency, and ends of intervals on which the polynomial is zero to the tolerance, may be among them.

    Examples
    --------
    >>> find_sign_changes(np.array([[-1.0, 1.0], [3.0, 1.0]]), np.zeros(2))
    (array([0]), array([0.25]))
    """
    zero: Array = np.full(f.shape[1], tolerance)
    f = _drop_noise(f, zero)
    if len(f) == 2:
        (column,) = (f[0] * f[1] < 0).nonzero()
        first, last = f[:, column]
        return column, first / (first - last)
    (column,) = np.logical_or.reduce(_find_changes(_fill_signs(f))).nonzero()
    f, zero = f[:, column], zero[column]
    if not len(column):
        return column, np.empty(0)
    if len(f) == 3:
        roots = _solve_quadratics(f)
        row, at = (roots < 1).nonzero()
        return column[at], roots[row, at]
    if len(f) == 4:
        found, roots = _solve_cubics(f, zero)
        return column[found], roots
    start, width = np.zeros(len(column)), 1.0
    touched: list[tuple[Array, Array]] = []  # column, root
    brackets: list[tuple[Array, Array, float, Array]] = []  # column, start, width, coefficients
    for level in range(SPLINE_LIMITS.root_levels):
        f = _drop_noise(f, zero)
        count = np.add.reduce(_find_changes(_fill_signs(f)))
        single, several = np.flatnonzero(count == 1), np.flatnonzero(count > 1)
        if len(single):
            brackets.append((column[single], start[single], width, f[:, single]))
        if not len(several) or level == SPLINE_LIMITS.root_levels - 1:
            break
        parts = _build_subdivision_matrix(len(f) - 1) @ f[:, several]  # (8, p+1, k)
        width /= _PARTS_PER_LEVEL
        column, zero = np.tile(column[several], _PARTS_PER_LEVEL), np.tile(zero[several], _PARTS_PER_LEVEL)
        start = np.add.outer(width * np.arange(_PARTS_PER_LEVEL), start[several]).ravel()
        f = np.moveaxis(parts, 0, 1).reshape(parts.shape[1], -1)
        at = np.flatnonzero((np.abs(f[0]) <= zero) & (start > 0))
        touched.append((column[at], start[at]))
    if brackets:
        local = _solve_single_roots(np.concatenate([b[3] for b in brackets], axis=1))
        widths = np.repeat([b[2] for b in brackets], [len(b[0]) for b in brackets])
        solved = np.concatenate([b[1] for b in brackets]) + widths * local
        touched.append((np.concatenate([b[0] for b in brackets]), solved))
    if not touched:
        return np.empty(0, dtype=int), np.empty(0)
    return np.concatenate([c for c, _ in touched]), np.concatenate([r for _, r in touched])
