"""How smooth a surface is at a point of a knot line: in its parameters, and in its shape.

Two patches may meet in one smooth shape although their parameters have a kink there: circles as rational splines are
made of such arcs. Shape shows in what does not depend on parameters, the height above the tangent plane as a function
of the place in it. With both patches as Taylor series (x, y, z)(u, v) in a common frame, the coefficients a of

    z(u, v) = sum of a[i, j] x(u, v)^i y(u, v)^j,  1 <= i + j <= 4,

are a linear system for each patch. The shape is C^k, with k the highest total order up to which these coefficients
agree. Depends on NumPy only.
"""

from __future__ import annotations

from math import comb

import numpy as np

from cqblend.splines.bernstein import Array

HIGHEST_ORDER = 4
"""Highest order of continuity that is told apart: a smoother surface counts as C4."""

SERIES_EXPONENTS = [(i, k - i) for k in range(1, HIGHEST_ORDER + 1) for i in range(k, -1, -1)]
"""Exponents (i, j) of the terms of a power series in two variables, by total order, without the constant."""


def expand_patches(patches: Array, pairs: tuple[Array, Array], rates: tuple[Array, Array]) -> Array:
    """Return Taylor coefficients of patches at points, along lines in both pairs of barycentric parameters.

    Parameters
    ----------
    patches
        Homogeneous, (p+1, q+1, 4, n).
    pairs, rates
        By parameter: the points (2, n), and how fast they move (2, n).

    Returns
    -------
    Array
        (HIGHEST_ORDER + 1, HIGHEST_ORDER + 1, 3, n), in space; zero above the total order.
    """
    rows = _expand_in_powers(patches, pairs[0], rates[0])
    both = np.stack([_expand_in_powers(row, pairs[1], rates[1]) for row in rows])
    both[np.add.outer(np.arange(HIGHEST_ORDER + 1), np.arange(HIGHEST_ORDER + 1)) > HIGHEST_ORDER] = 0
    return _divide_series(both[:, :, :3], both[:, :, 3:])


def _expand_in_powers(coefs: Array, pair: Array, rate: Array) -> Array:
    """Expand Bernstein coefficients (p+1, .., n) along pair + x rate in powers of x, (HIGHEST_ORDER + 1, .., n)."""
    p = len(coefs) - 1
    out = np.zeros((HIGHEST_ORDER + 1, *coefs.shape[1:]))
    moved = coefs
    for k in range(min(p, HIGHEST_ORDER) + 1):
        value = moved
        for _ in range(p - k):
            value = pair[0] * value[:-1] + pair[1] * value[1:]
        out[k] = comb(p, k) * value[0]
        if k < p:
            moved = rate[0] * moved[:-1] + rate[1] * moved[1:]
    return out


def _multiply_series(a: Array, b: Array) -> Array:
    """Multiply power series in two variables, (HIGHEST_ORDER + 1, HIGHEST_ORDER + 1, ..)."""
    out = np.zeros(np.broadcast_shapes(a.shape, b.shape))
    for i, j in [(0, 0), *SERIES_EXPONENTS]:
        out[i:, j:] += a[i, j] * b[: HIGHEST_ORDER + 1 - i, : HIGHEST_ORDER + 1 - j]
    return out


def _divide_series(a: Array, b: Array) -> Array:
    """Divide power series in two variables, a / b; the constant of b is not zero."""
    out = np.zeros_like(a)
    for i, j in [(0, 0), *SERIES_EXPONENTS]:
        out[i, j] = (a[i, j] - _multiply_series(out, b)[i, j]) / b[0, 0]
    return out


def measure_shape_continuity(before: Array, after: Array, axis: int, tolerance: float) -> tuple[Array, Array]:
    """Compare the shapes of two patches at points (n,) of the line between them.

    Parameters
    ----------
    before, after
        Their Taylor series, (HIGHEST_ORDER + 1, HIGHEST_ORDER + 1, 3, n), in units of their own spans.
    axis
        Which of the parameters is across the line.
    tolerance
        By how much the shape may jump over the shorter of the two spans, in mm.

    Returns
    -------
    order, crease
        (n,) each: the order up to which they agree, at most ``HIGHEST_ORDER``, and the angle between normals, rad.
    """
    across, along = ((1, 0), (0, 1))[axis], ((0, 1), (1, 0))[axis]
    shorter = np.where(np.linalg.norm(before[across], axis=0) < np.linalg.norm(after[across], axis=0), 0, 1)
    chosen = np.where(shorter == 0, before, after)
    first, second = chosen[across], chosen[along]
    normals = [np.cross(series[1, 0], series[0, 1], axis=0) for series in (before, after)]
    frame = np.stack([first, second, np.cross(first, second, axis=0)], axis=1)  # (3, 3, n), one vector a column
    frame[:, 2] /= np.maximum(np.linalg.norm(frame[:, 2], axis=0), np.finfo(float).tiny)
    inverse = np.linalg.inv(frame.transpose(2, 0, 1))
    heights = [_expand_height(np.einsum("nij,kljn->klin", inverse, series)) for series in (before, after)]
    jump = np.abs(heights[0] - heights[1])  # (terms, n)
    orders = np.array([i + j for i, j in SERIES_EXPONENTS])
    order = np.full(jump.shape[1], HIGHEST_ORDER)
    for k in range(HIGHEST_ORDER, 0, -1):
        order[jump[orders == k].max(axis=0) > tolerance] = k - 1
    sine, cosine = (
        np.linalg.norm(np.cross(normals[0], normals[1], axis=0), axis=0),
        (normals[0] * normals[1]).sum(axis=0),
    )
    return order, np.arctan2(sine, cosine)


def _expand_height(series: Array) -> Array:
    """Return the coefficients (terms, n) of z as a function of x and y, all three given as power series."""
    x, y, z = (series[:, :, i].copy() for i in range(3))
    for coordinate in (x, y, z):
        coordinate[0, 0] = 0
    powers = {(0, 0): np.ones_like(x)}
    powers[0, 0][...] = 0
    powers[0, 0][0, 0] = 1
    for i, j in SERIES_EXPONENTS:
        powers[i, j] = _multiply_series(powers[i - 1, j], x) if i else _multiply_series(powers[i, j - 1], y)
    matrix = np.array([[powers[term][at] for term in SERIES_EXPONENTS] for at in SERIES_EXPONENTS])  # (terms, terms, n)
    right = np.array([z[at] for at in SERIES_EXPONENTS])
    return np.asarray(np.linalg.solve(matrix.transpose(2, 0, 1), right.T[..., None])[..., 0].T)
