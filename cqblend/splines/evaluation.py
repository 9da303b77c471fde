"""Evaluation of pieces: which piece a parameter is in, and values and derivatives from homogeneous coefficients.

Shared by curves and surfaces, on bare arrays. Derivatives are differences of coefficients first (so a plane has exactly
zero second derivatives), then a contraction with Bernstein polynomials. Depends on the arithmetic of coefficients only.
"""

from math import comb
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


BLOCK_SIZE = 4096
"""Scattered points evaluated at a time: the coefficients gathered for them should stay in the cache."""


def locate_pieces(breaks: Array, t: Array, side: BreakSide = "right") -> tuple[Array, Array, Array, Array]:
    """Piece of each parameter, its barycentric coordinates (s, x) there, and the piece's length.

    At a break the piece on `side` is taken; beyond the ends the end piece, as polynomial continuation.
    """
    piece = np.searchsorted(breaks[1:-1], t, side)
    start, end = breaks[piece], breaks[piece + 1]
    length = end - start
    return piece, (end - t) / length, (t - start) / length, length


def build_design_matrix(breaks: Array, degree: int, t: Array, order: int) -> Array:
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


def dehomogenise_derivatives(jets: Array) -> Array:
    """Euclidean partial derivatives from homogeneous ones, by the Leibniz rule for x = (w x) / w.

    Parameters
    ----------
    jets
        (K+1, L+1, dim+1, ..) homogeneous derivatives of orders 0..K by 0..L, weight last.

    Returns
    -------
    Array
        (K+1, L+1, dim, ..).
    """
    weight = jets[:, :, -1:]
    out = jets[:, :, :-1].copy()
    for k in range(out.shape[0]):
        for m in range(out.shape[1]):
            for i in range(k + 1):
                for j in range(m + 1):
                    if i or j:
                        out[k, m] -= comb(k, i) * comb(m, j) * weight[i, j] * out[k - i, m - j]
            out[k, m] /= weight[0, 0]
    return out
