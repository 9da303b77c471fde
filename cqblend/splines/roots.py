"""Sign changes of Bernstein polynomials in (0, 1), many at a time, to full precision.

Needed to cut a curve where it crosses the knot lines of a surface. Roots are isolated by Descartes' rule on the control
polygon under eight-fold subdivision, then found by Newton's method in a bracket. A coefficient within the tolerance
counts as zero, so that subdivision ends at tangencies, at curves that run along a line, and at rounding noise. Depends
on the arithmetic of coefficients only.
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


def _count_sign_changes(f: Array) -> Array:
    """Count the sign changes down each column, zeros ignored."""
    sign = np.sign(f)
    if not sign.all():
        for i in range(1, len(sign)):
            np.copyto(sign[i], sign[i - 1], where=sign[i] == 0)
    return np.asarray((sign[1:] * sign[:-1] < 0).sum(axis=0))


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
    noise = 2 * EPSILON * np.abs(f).max(axis=0)
    lo, hi = np.zeros(count), np.ones(count)
    for _ in range(80):
        s, c = 1 - t, f
        for _ in range(degree - 1):  # de Casteljau, which yields the slope as well
            c = s * c[:-1] + t * c[1:]
        value, rise = s * c[0] + t * c[1], degree * (c[1] - c[0])
        left = value * left_sign > 0
        lo, hi = np.where(left, t, lo), np.where(left, hi, t)
        new = t - value / np.where(rise == 0, 1.0, rise)
        new = np.where((new >= lo) & (new <= hi) & (rise != 0), new, (lo + hi) / 2)
        done = (np.abs(new - t) <= 4 * EPSILON) | (np.abs(value) <= noise)
        t = new
        if done.all():
            break
    return t


def find_sign_changes(f: Array, tolerance: Array) -> tuple[Array, Array]:
    """Where the columns of f change sign inside (0, 1).

    Parameters
    ----------
    f
        (p+1, n) Bernstein coefficients.
    tolerance
        (n,) Coefficients up to this absolute value count as zero.

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
    column = np.arange(f.shape[1])
    start, width = np.zeros(f.shape[1]), 1.0
    touched: list[tuple[Array, Array]] = []  # column, root
    brackets: list[tuple[Array, Array, float, Array]] = []  # column, start, width, coefficients
    for level in range(SPLINE_LIMITS.root_levels):
        f = np.where(np.abs(f) <= tolerance, 0.0, f)
        count = _count_sign_changes(f)
        single, several = np.flatnonzero(count == 1), np.flatnonzero(count > 1)
        if len(single):
            brackets.append((column[single], start[single], width, f[:, single]))
        if not len(several) or level == SPLINE_LIMITS.root_levels - 1:
            break
        parts = _build_subdivision_matrix(len(f) - 1) @ f[:, several]  # (8, p+1, k)
        width /= _PARTS_PER_LEVEL
        column, tolerance = np.tile(column[several], _PARTS_PER_LEVEL), np.tile(tolerance[several], _PARTS_PER_LEVEL)
        start = np.add.outer(width * np.arange(_PARTS_PER_LEVEL), start[several]).ravel()
        f = np.moveaxis(parts, 0, 1).reshape(parts.shape[1], -1)
        at = np.flatnonzero((np.abs(f[0]) <= tolerance) & (start > 0))
        touched.append((column[at], start[at]))
    if brackets:
        local = _solve_single_roots(np.concatenate([b[3] for b in brackets], axis=1))
        widths = np.repeat([b[2] for b in brackets], [len(b[0]) for b in brackets])
        solved = np.concatenate([b[1] for b in brackets]) + widths * local
        touched.append((np.concatenate([b[0] for b in brackets]), solved))
    if not touched:
        return np.empty(0, dtype=int), np.empty(0)
    return np.concatenate([c for c, _ in touched]), np.concatenate([r for _, r in touched])
