"""Evaluation of pieces: which piece a parameter is in, and values and derivatives from homogeneous coefficients.

Shared by curves and surfaces, on bare arrays. Derivatives are differences of coefficients first (so a plane has exactly
zero second derivatives), then a contraction with Bernstein polynomials. Depends on the arithmetic of coefficients only.
"""

from collections.abc import Sequence
from functools import lru_cache
from math import factorial, perm
from typing import Literal

import numpy as np

from cqblend.errors import InputError, shown
from cqblend.splines import bernstein
from cqblend.splines.bernstein import Array

BreakSide = Literal["left", "right"]


def check_break_side(side: object) -> BreakSide:
    """Return the side of a break.

    Raises
    ------
    InputError
        If it is neither "left" nor "right".
    """
    if isinstance(side, str):
        if side == "right":
            return "right"
        if side == "left":
            return "left"
    raise InputError(f'the side of a break is "left" or "right", not {shown(side)}')


BLOCK_SIZE = 1024
"""Scattered points evaluated at a time: the coefficients gathered for them should stay in the cache."""


def locate_pieces(breaks: Array, t: Array, side: BreakSide = "right") -> tuple[Array, Array, Array, Array]:
    """Piece of each parameter, its barycentric coordinates (s, x) there, and the piece's length.

    At a break the piece on `side` is taken; beyond the ends the end piece, as polynomial continuation.
    """
    piece = breaks[1:-1].searchsorted(t, side)
    start, end = breaks[piece], breaks[piece + 1]
    length = end - start
    return piece, (end - t) / length, (t - start) / length, length


def tabulate_derivative_basis(degree: int, orders: Sequence[int], s: Array, x: Array, length: Array) -> list[Array]:
    """Factors (p - k + 1, n) that turn differences of each order k into derivatives; none beyond the degree.

    Parameters
    ----------
    degree
        p.
    orders
        Increasing.
    s, x, length
        (n,) barycentric coordinates, and the lengths of the pieces.
    """
    powers = bernstein.tabulate_powers(degree, s, x)
    first, second = powers[:, 0], powers[:, 1]
    factors = []
    for order in orders:
        size = degree - order + 1
        if size > 0:
            basis = first[size - 1 :: -1] * second[:size] * _tabulate_factors(degree, order)
            factors.append(basis / length**order if order else basis)
    return factors


def contract_differences(
    coefs: Array, orders: Sequence[int], factors: Sequence[Array], dropped: int | None = None
) -> Array:
    """Contract axis 0 of coefs (p+1, .., n) to derivatives (len(orders), .., n).

    Parameters
    ----------
    coefs
        If `dropped` is given, the second axis counts orders, of another parameter.
    orders, factors
        As of :func:`tabulate_derivative_basis`.
    dropped
        Sum of both orders from which on derivatives are zero.
    """
    out = np.zeros((len(orders), *coefs.shape[1:]), dtype=coefs.dtype)
    taken = 0
    for row, (order, basis) in enumerate(zip(orders, factors, strict=False)):
        for _ in range(order - taken):
            coefs = coefs[1:] - coefs[:-1]
        taken = order
        if dropped is None:
            np.einsum("in,i...n->...n", basis, coefs, out=out[row])
        else:
            kept = dropped - order
            np.einsum("in,i...n->...n", basis, coefs[:, :kept], out=out[row, :kept])
    return out


@lru_cache(maxsize=256)
def _tabulate_factors(degree: int, order: int) -> Array:
    """Factors (p - k + 1, 1) of the monomials of degree p - k in the derivative of order k; read-only."""
    table = perm(degree, order) * bernstein.tabulate_binomials((degree - order,), 1, False)
    table.flags.writeable = False
    return table


def evaluate_everywhere(breaks: Array, coefs: Array, t: Array, orders: Sequence[int]) -> Array:
    """Evaluate derivatives (len(orders), .., N) of splines with coefficients (p+1, .., n), each at all t (N,)."""
    size, *rest, n = coefs.shape
    if n <= _DENSE_PIECES:
        matrix = coefs.transpose(*range(1, coefs.ndim - 1), 0, -1).reshape(-1, size * n)
        values = [matrix @ _build_design_matrix(breaks, size - 1, t, order).T for order in orders]
        return np.array(values).reshape(len(orders), *rest, len(t))
    block = max(1, _GATHERED_SIZE * n // coefs.size)
    out = np.empty((len(orders), *rest, len(t)))
    for start in range(0, len(t), block):
        chosen = slice(start, start + block)
        piece, s, x, length = locate_pieces(breaks, t[chosen])
        factors = tabulate_derivative_basis(size - 1, orders, s, x, length)
        out[..., chosen] = contract_differences(coefs.take(piece, axis=-1), orders, factors)
    return out


_DENSE_PIECES = 32
"""Number of pieces up to which one matrix for all of them is faster than gathering the coefficients at each point."""

_GATHERED_SIZE = 1 << 18
"""Coefficients gathered at a time."""


def _build_design_matrix(breaks: Array, degree: int, t: Array, order: int) -> Array:
    """Matrix (len(t), (p + 1) n) from coefficients (p+1, n) of all pieces of degree p to derivatives at t."""
    piece, s, x, length = locate_pieces(breaks, t)
    n = len(breaks) - 1
    out = np.zeros((len(t), degree + 1, n))
    if order <= degree:
        values = bernstein.evaluate_basis(degree - order, s, x)
        for _ in range(order):  # transpose of taking differences
            wider = np.zeros((len(values) + 1, len(t)))
            wider[1:] += values
            wider[:-1] -= values
            values = len(values) / length * wider
        out[np.arange(len(t)), :, piece] = values.T
    return out.reshape(len(t), (degree + 1) * n)


@lru_cache(maxsize=64)
def _tabulate_factorials(rows: int, columns: int, trailing: int) -> Array:
    """Products k! m!, (rows, columns, 1, ..) with `trailing` axes of length one; read-only."""
    one, other = ([float(factorial(k)) for k in range(count)] for count in (rows, columns))
    table = np.multiply.outer(one, other).reshape(rows, columns, *(1,) * trailing)
    table.flags.writeable = False
    return table


def dehomogenise_derivatives(jets: Array, total: int | None = None) -> Array:
    """Euclidean partial derivatives from homogeneous ones, by the Leibniz rule for x = (w x) / w.

    Parameters
    ----------
    jets
        (K+1, L+1, dim+1, ..) homogeneous derivatives of orders 0..K by 0..L, weight last.
    total
        Largest sum of the two orders that is wanted; derivatives beyond it are zero.

    Returns
    -------
    Array
        (K+1, L+1, dim, ..).
    """
    rows, columns = jets.shape[:2]
    # for Taylor coefficients the rule is a plain convolution; weights relative to the first, which counts as zero
    taylor = jets / jets[0, 0, -1]
    factorials = None if max(rows, columns) <= 2 else _tabulate_factorials(rows, columns, jets.ndim - 2)
    if factorials is not None:
        taylor /= factorials
    taylor[0, 0, -1] = 0.0
    out, weight = taylor[:, :, :-1], taylor[:, :, -1:]
    for k in range(rows):
        for m in range(columns):
            if total is not None and k + m > total:
                out[k, m] = 0.0
            elif k or m:
                terms = weight[: k + 1, : m + 1] * out[k::-1, m::-1][: k + 1, : m + 1]
                out[k, m] -= np.add.reduce(terms, axis=(0, 1))
    return out if factorials is None else np.asarray(out * factorials)
