r"""Polynomials across a blend: Hermite functions for the boundary data, and bubbles that vanish at both rails.

A polynomial is given by its derivatives 0 .. h - 1 at both ends, and by coefficients of the *bubbles*

.. math:: \varphi_m(v) = N_m\, (1 - x^2)^h\, P_m^{(h, h)}(x), \quad x = 2 v - 1,\; m = 0, 1, ..,

with Jacobi's polynomials. Bubbles vanish at both ends with their derivatives up to h - 1: boundary conditions hold
exactly whatever their coefficients are (You and Zhang's eq. 9 and 10 reach the same with powers of v). Their h-th
derivatives are Legendre's polynomials, and N_m makes these orthonormal on [0, 1]: so any number of them is well
conditioned. Knows no equations.
"""

from __future__ import annotations

from functools import lru_cache
from math import prod, sqrt

import numpy as np

from cqblend.splines import bernstein
from cqblend.splines.bernstein import Array
from cqblend.splines.interpolation import tabulate_hermite_basis


def evaluate_jacobi(count: int, alpha: int, x: Array) -> Array:
    r"""Return Jacobi's polynomials :math:`P_m^{(\alpha, \alpha)}`, m = 0 .. count - 1, at x (n,): (count, n)."""
    out = np.ones((count, len(x)))
    if count > 1:
        out[1] = (alpha + 1) * x
    for n in range(2, count):
        a = n + alpha
        out[n] = ((2 * a - 1) * a * x * out[n - 1] - a * (a - 1) * out[n - 2]) / (n * (n + 2 * alpha))
    return out


def evaluate_bubbles(half: int, count: int, v: Array, k: int = 0) -> Array:
    """Return the k-th derivatives by v of the first bubbles that vanish up to order half - 1: (n, count)."""
    x, m = 2 * v - 1, np.arange(count)
    scale = np.array([sqrt(2 * (i + half) + 1) / (4**half * prod(range(i + 1, i + half + 1))) for i in range(count)])
    if k <= half:
        values = (1 - x**2) ** (half - k) * evaluate_jacobi(count + k, half - k, x)[k:]
        factors = np.array([(-4.0) ** k * prod(range(i + 1, i + k + 1)) for i in range(count)])
    else:
        # derivatives of P_(m + half): of lower degree, none where that is below zero
        more, degree = k - half, m + half
        values = np.zeros((count, len(x)))
        some = degree >= more
        values[some] = evaluate_jacobi(count + half, more, x)[(degree - more)[some]]
        factors = np.array(
            [
                (-4.0) ** half * prod(range(i + 1, i + half + 1)) * prod(range(i + half + 1, i + half + more + 1))
                for i in range(count)
            ]
        )
    return np.asarray((values * (scale * factors)[:, None]).T)


@lru_cache(maxsize=64)
def measure_bubble_heights(half: int, count: int) -> Array:
    """Return the largest absolute values of the first bubbles, (count,)."""
    values = np.abs(evaluate_bubbles(half, count, np.linspace(0, 1, 8 * (count + 2 * half) + 1))).max(axis=0)
    values.setflags(write=False)
    return np.asarray(values)


def evaluate_hermite_basis(half: int, v: Array, k: int = 0) -> Array:
    """Return the k-th derivatives of the polynomials of degree 2 half - 1 that have one of the data: (n, 2, half).

    Entry [:, e, r] is that with the r-th derivative 1 at v = e, and all others 0 at both ends.
    """
    poles = tabulate_hermite_basis(half - 1)
    if k >= len(poles):
        return np.zeros((len(v), 2, half))
    for _ in range(k):
        poles = (len(poles) - 1) * np.diff(poles, axis=0)
    return np.asarray(np.einsum("in,ier->ner", bernstein.evaluate_basis(len(poles) - 1, 1 - v, v), poles))
