"""Antiderivatives of functions of one variable, to rounding: Legendre series on cells as small as they must be.

Flattening is made of integrals (arc length, turning angle, position) whose values are needed at any parameter, not only
at the ends. Depends on NumPy and the evaluation of pieces only.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import locate_pieces
from cqblend.splines.tolerances import SPLINE_LIMITS, SPLINE_TOLERANCES

_GAUSS_POINTS = 16


def evaluate_legendre(degree: int, x: Array) -> Array:
    """Return the Legendre polynomials P_0 .. P_degree at x in [-1, 1], (degree + 1, ..)."""
    out = np.empty((degree + 1, *np.shape(x)))
    out[0] = 1.0
    if degree:
        out[1] = x
    for k in range(1, degree):
        np.multiply(x, out[k], out=out[k + 1])
        out[k + 1] *= (2 * k + 1) / (k + 1)
        out[k + 1] -= k / (k + 1) * out[k - 1]
    return out


@lru_cache(maxsize=8)
def gauss_rule(points: int) -> tuple[Array, Array]:
    """Return nodes and weights of Gauss's rule on [0, 1]."""
    x, w = np.polynomial.legendre.leggauss(points)
    return (1 + x) / 2, w / 2


@lru_cache(maxsize=1)
def _build_series_matrices() -> tuple[Array, Array]:
    """Matrices from values at Gauss points to the coefficients of the function, and to those of its antiderivative."""
    x, w = np.polynomial.legendre.leggauss(_GAUSS_POINTS)
    k = np.arange(_GAUSS_POINTS)
    series = (k[:, None] + 0.5) * w * evaluate_legendre(_GAUSS_POINTS - 1, x)
    # integral of P_k from -1: (P_(k+1) - P_(k-1)) / (2 k + 1), and P_1 + P_0 for k = 0; half of it on a unit interval
    integral = np.zeros((_GAUSS_POINTS + 1, _GAUSS_POINTS))
    integral[k + 1, k] = 0.5 / (2 * k + 1)
    integral[k[:-1], k[1:]] = -0.5 / (2 * k[1:] + 1)
    integral[0, 0] = 0.5
    return series, integral @ series


class Antiderivative:
    r"""The antiderivative F of a function, zero at the first break.

    .. math:: F(t) = \int_{t_0}^t f

    Every cell holds a Legendre series through the values at 16 Gauss points; cells are halved until the terms that the
    series leave out add up to less than 1e-14 of the integral of \|f\|.

    Parameters
    ----------
    function
        Vectorised, (m,) to (m,), real or complex; smooth between the breaks, or continuous with kinks.
    breaks
        (n + 1,) increasing; the function is not evaluated there.
    scale
        Size to which the error is relative where the integral itself is smaller.

    Raises
    ------
    GeometryError
        If a value is not finite; the message says where.

    Attributes
    ----------
    cells
        (m + 1,) ends of the cells.
    values
        (m + 1,) values of F there.

    Examples
    --------
    >>> sine = Antiderivative(np.cos, [0.0, 3.0])
    >>> bool(np.abs(sine([0.5, 3.0]) - np.sin([0.5, 3.0])).max() < 1e-15)
    True
    """

    __slots__ = ("_coefs", "cells", "values")

    def __init__(self, function: Callable[[Array], Array], breaks: ArrayLike, scale: float = 0.0) -> None:
        series, integral = _build_series_matrices()
        x, weights = gauss_rule(_GAUSS_POINTS)
        breaks = np.asarray(breaks, dtype=np.float64)
        start, end = breaks[:-1], breaks[1:]
        done: list[tuple[Array, Array, Array]] = []
        settled = 0.0
        for level in range(SPLINE_LIMITS.cell_halvings):
            width = end - start
            t = start + x[:, None] * width
            values = function(t.ravel()).reshape(t.shape)
            if not np.isfinite(values).all():
                bad = float(t[~np.isfinite(values)][0])
                raise GeometryError(f"there is no direction or length at t = {bad:.9g}: the geometry is singular there")
            size = weights @ np.abs(values) * width
            left_out = np.abs(series[-3:] @ values).max(axis=0) * width
            unsettled = (left_out > SPLINE_TOLERANCES.integral * max(settled + size.sum(), scale)) & (
                level < SPLINE_LIMITS.cell_halvings - 1
            )
            done.append((start[~unsettled], end[~unsettled], integral @ values[:, ~unsettled] * width[~unsettled]))
            settled += size[~unsettled].sum()
            if not unsettled.any():
                break
            middle = (start[unsettled] + end[unsettled]) / 2
            start, end = np.concatenate([start[unsettled], middle]), np.concatenate([middle, end[unsettled]])
        starts = np.concatenate([part[0] for part in done])
        order = np.argsort(starts)
        coefs = np.concatenate([part[2] for part in done], axis=1)[:, order]
        # at the end of a cell every P_k is 1
        self.values = np.concatenate([[0.0], np.cumsum(coefs.sum(axis=0))])
        coefs[0] += self.values[:-1]
        self._coefs = coefs
        self.cells = np.append(starts[order], breaks[-1])

    def __call__(self, t: ArrayLike) -> Array:
        """Return F(t), of the shape of t."""
        t = np.asarray(t, dtype=np.float64)
        cell, below, above, _ = locate_pieces(self.cells, t.ravel())
        basis = evaluate_legendre(_GAUSS_POINTS, above - below)
        return np.asarray(np.einsum("kn,kn->n", basis, self._coefs[:, cell]).reshape(t.shape))
