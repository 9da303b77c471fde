"""Sign changes of Bernstein polynomials in (0, 1), many at a time, to full precision.

Needed to cut a curve where it crosses the knot lines of a surface. Isolation is Descartes' rule on the control polygon,
subdividing eight-fold; then safeguarded Newton. A coefficient within the tolerance counts as zero, which is what lets
tangencies, curves along a line and rounding noise come to an end. This module must not know what the polynomials mean.
"""

from functools import lru_cache

import numpy as np

from cqblend.splines.bernstein import Array, basis, derivative, evaluate, restrict

_PARTS = 8
_LEVELS = 17  # 8^17 = 2^51 parts of the unit interval


@lru_cache(maxsize=64)
def _subdivision(degree: int) -> Array:
    """Matrix (8, p+1, p+1) from coefficients to those of the eight equal parts; convex combinations only."""
    x = np.arange(_PARTS + 1) / _PARTS
    identity = np.repeat(np.eye(degree + 1)[:, :, None], _PARTS, axis=2)
    return np.ascontiguousarray(np.moveaxis(restrict(identity, x[:-1], x[1:]), -1, 0))


def _variations(f: Array) -> Array:
    """Number of sign changes down each column, zeros ignored."""
    sign = np.sign(f)
    if not sign.all():
        for i in range(1, len(sign)):
            np.copyto(sign[i], sign[i - 1], where=sign[i] == 0)
    return (sign[1:] * sign[:-1] < 0).sum(axis=0)


def _solve(f: Array) -> Array:
    """The root of each column of f, which has exactly one sign change: Newton inside a shrinking bracket."""
    degree, count = len(f) - 1, f.shape[1]
    slope = derivative(f)
    sign = np.sign(f)
    columns = np.arange(count)
    last_left = np.argmax(sign * sign[(sign != 0).argmax(axis=0), columns] < 0, axis=0) - 1
    before, after = np.abs(f[last_left, columns]), np.abs(f[last_left + 1, columns])
    left_sign = -sign[last_left + 1, columns]
    t = (last_left + before / (before + after)) / degree
    lo, hi = np.zeros(count), np.ones(count)
    for _ in range(80):
        value = evaluate(f, basis(degree, 1 - t, t))
        left = value * left_sign > 0
        lo, hi = np.where(left, t, lo), np.where(left, hi, t)
        with np.errstate(divide="ignore", invalid="ignore"):
            new = t - value / evaluate(slope, basis(degree - 1, 1 - t, t))
        new = np.where((new >= lo) & (new <= hi), new, (lo + hi) / 2)
        step = np.abs(new - t).max()
        t = new
        if step <= 1e-16:
            break
    return t


def sign_changes(f: Array, tolerance: float) -> tuple[Array, Array]:
    """Where the columns of f change sign inside (0, 1).

    Parameters
    ----------
    f
        (p+1, n) Bernstein coefficients.
    tolerance
        Coefficients up to this absolute value count as zero.

    Returns
    -------
    columns, roots
        Index of the column and parameter, one entry each for every sign change, in no particular order. Points of
        tangency, and ends of intervals on which the polynomial is zero to the tolerance, may be among them.

    Examples
    --------
    >>> sign_changes(np.array([[-1.0, 1.0], [3.0, 1.0]]), 0.0)
    (array([0]), array([0.25]))
    """
    column = np.arange(f.shape[1])
    start, width = np.zeros(f.shape[1]), 1.0
    columns, roots = [], []
    for level in range(_LEVELS):
        f = np.where(np.abs(f) <= tolerance, 0.0, f)
        count = _variations(f)
        single = np.flatnonzero(count == 1)
        if len(single):
            columns.append(column[single])
            roots.append(start[single] + width * _solve(f[:, single]))
        several = np.flatnonzero(count > 1)
        if not len(several) or level == _LEVELS - 1:
            break
        parts = _subdivision(len(f) - 1) @ f[:, several]  # (8, p+1, k)
        width /= _PARTS
        column = np.tile(column[several], _PARTS)
        start = np.add.outer(width * np.arange(_PARTS), start[several]).ravel()
        f = np.moveaxis(parts, 0, 1).reshape(parts.shape[1], -1)
        touching = np.flatnonzero((np.abs(f[0]) <= tolerance) & (start > 0))
        columns.append(column[touching])
        roots.append(start[touching])
    if not roots:
        return np.empty(0, dtype=int), np.empty(0)
    return np.concatenate(columns), np.concatenate(roots)
