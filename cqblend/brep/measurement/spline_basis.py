"""B-spline basis functions at many parameters at once, by the recursion of Cox and de Boor.

Algorithm A2.2 of Piegl and Tiller, *The NURBS Book*. It shares nothing with :mod:`cqblend.splines`, which works on
Bernstein pieces: what was computed there is measured here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class LocalBasis:
    """The basis functions of a B-spline of degree p that do not vanish at each of n parameters.

    Attributes
    ----------
    poles : ndarray of int, shape (p + 1, n)
        The indices of the poles that count at each parameter.
    values : tuple of ndarray, shape (p + 1 - k, n)
        For k = 0, 1, ...: the basis functions of degree p - k, which belong to the k-th differences of these poles.
    rates : tuple of ndarray, shape (p + 1 - k, n)
        For k = 1, 2, ...: the factors that make derivatives of the k-th differences.
    """

    poles: NDArray[np.intp]
    values: tuple[Array, ...]
    rates: tuple[Array, ...]

    def combine(self, picked: Array) -> list[Array]:
        """Return the values, and as many derivatives as there are rates, of poles (..., p + 1, n) picked by index.

        Derivatives are of differences of poles, so that those of a straight line are exact.
        """
        found = [np.einsum("rn,...rn->...n", self.values[0], picked)]
        for values, rates in zip(self.values[1:], self.rates, strict=True):
            picked = (picked[..., 1:, :] - picked[..., :-1, :]) * rates
            found.append(np.einsum("rn,...rn->...n", values, picked))
        return found


def evaluate_basis(knots: Array, degree: int, ts: Array, order: int) -> LocalBasis:
    """Evaluate what a B-spline over a full knot vector needs for its values and derivatives up to an order.

    At a knot, the span of larger parameters is taken; before the first and past the last one, the first and the last
    span go on. Derivatives past the degree have no differences left, and are sums over nothing: zero.
    """
    span = np.searchsorted(knots[degree + 1 : len(knots) - degree - 1], ts, side="right") + degree
    near = knots.take(span + np.arange(1 - degree, degree + 1)[:, None])
    behind, ahead = ts - near[:degree], near[degree:] - ts
    values = np.ones((1, len(ts)))
    stages = [values]
    for j in range(1, degree + 1):
        share = values / (ahead[:j] + behind[degree - j :])
        values = np.empty((j + 1, len(ts)))
        values[:j] = ahead[:j] * share
        values[j] = 0.0
        values[1:] += behind[degree - j :] * share
        stages.append(values)
    chosen = tuple(stages[degree - k] if k <= degree else values[:0] for k in range(order + 1))
    rates = tuple(
        (degree + 1 - k) / (near[degree : 2 * degree + 1 - k] - near[k - 1 : degree]) for k in range(1, order + 1)
    )
    return LocalBasis(span + np.arange(-degree, 1)[:, None], chosen, rates)


def count_knots(knots: Array) -> tuple[Array, NDArray[np.intp]]:
    """Return the distinct knots of a full knot vector, and how often each is repeated."""
    bounds = np.concatenate(((0,), (knots[1:] > knots[:-1]).nonzero()[0] + 1, (len(knots),)))
    return knots[bounds[:-1]], bounds[1:] - bounds[:-1]


def divide_by_weights(found: list[Array]) -> list[Array]:
    """Return value and derivatives (d, n) of a rational curve from those (d + 1, n) of its homogeneous coordinates."""
    weight = found[0][-1]
    quotients = [found[0][:-1] / weight]
    if len(found) > 1:
        quotients.append((found[1][:-1] - found[1][-1] * quotients[0]) / weight)
    if len(found) > 2:
        rest = found[2][:-1] - 2.0 * found[1][-1] * quotients[1] - found[2][-1] * quotients[0]
        quotients.append(rest / weight)
    return quotients
