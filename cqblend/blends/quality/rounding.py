r"""How far from a B-spline surface its derivatives are as OCCT evaluates them, in doubles, from the poles it holds.

OCCT does as Boehm does, in one direction after the other: p rounds of divided differences of the poles around a span,
in whose order j the largest is n_j, then p rounds of nested multiplication by the distances s_i from the knots to the
left, which give

.. math:: A_k = \frac{p!}{(p-k)!}\, \Big(\text{sums of products}\ n_j\, s_{i_1} \cdots s_{i_{j-k}}\Big),

terms of the k-th derivative taken with one sign. Differences of doubles err by their own rounding alone, sums by the
rounding of their terms; with r rounds of the second kind that do anything, that makes at most

.. math:: e_k = \epsilon \big(2 + \tfrac{3}{2} r\big) A_k, \qquad
          e_0 = \epsilon \big(2 + \tfrac{3}{2} r\big) (A_0 - n_0) + \tfrac{\epsilon}{2} r\, n_0 .

What one direction errs is then data for the other, whose l-th derivative magnifies it by :math:`D_l`, 1 or 2q/h or
4q(q-1)/h^2, with h the length of the span:

.. math:: E_{kl} = e_k D_l + e_l D_k + \delta\, D_k D_l.

In this, delta is the rounding of products of poles and weights, where there are any. The direction of the lower degree
comes first; where that is the one across, the other has nothing but rows along the boundary left to do. At the left end
of the knots nothing is added. Derivatives in space follow by the quotient rule, whose terms are as large
as coordinates are: far from the origin rational surfaces err by more. This module knows arrays and nothing of blends.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, perm

import numpy as np

from cqblend.splines import bernstein
from cqblend.splines.bernstein import Array
from cqblend.splines.knots import extract_pieces
from cqblend.splines.surface import BSplineSurface

EPS = float(np.finfo(float).eps)
DERIVATIVE_ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


@dataclass(frozen=True)
class RoundingBounds:
    """Bounds for each span, (nu, nv), by order (k, l): of the error of a derivative, and of the derivative itself."""

    error: dict[tuple[int, int], Array]
    size: dict[tuple[int, int], Array]

    def take_spans(self, u: Array, v: Array | int) -> RoundingBounds:
        """Take spans."""
        error, size = ({order: table[u, v] for order, table in tables.items()} for tables in (self.error, self.size))
        return RoundingBounds(error, size)


def bound_rounding(
    spline: BSplineSurface, end: int | None = None, doubt: tuple[float, float] = (0.0, 0.0)
) -> RoundingBounds:
    """Bound the rounding of OCCT's evaluation, to second order.

    Parameters
    ----------
    spline
        Degrees, full clamped knot vectors, poles and weights.
    end
        0 or 1 for the boundary at the first or at the last v, None for all of the surface.
    doubt
        How far u and v may themselves be off.
    """
    degrees, knots, poles, weights = spline
    far = float(np.abs(poles).max())
    least = 1.0 if weights is None else float(weights.min())
    net = (
        poles
        if weights is None
        else np.concatenate([poles, np.full_like(poles[..., :1], far)], -1) * weights[..., None]
    )
    spans = [p + np.flatnonzero(k[p : -p - 1] < k[p + 1 : len(k) - p]) for p, k in zip(degrees, knots, strict=True)]
    if end is not None:
        spans[1] = spans[1][[-end]]
    lost = 0.0 if weights is None else EPS / 2 * float(np.abs(net).max())

    errors, powers = [], []
    for axis in (0, 1):
        p, k, at = degrees[axis], knots[axis], spans[axis]
        local = np.moveaxis(net, axis, 0)[at - p + np.arange(p + 1)[:, None]]  # (p + 1, spans, other, dim)
        found = _bound_direction_errors(p, k, at, local, start=end == 0 and axis == 1)
        errors.append([np.moveaxis(table, 0, axis) for table in found])
        length = (k[at + 1] - k[at])[:, None] if axis == 0 else (k[at + 1] - k[at])[None]
        powers.append([np.ones_like(length), 2 * p / length, 4 * p * max(p - 1, 0) / length**2])
    error, size = {}, _bound_derivatives(degrees, knots, net, end)
    last = None if end is None or degrees[1] >= degrees[0] else _bound_row_errors(degrees, knots, spans[0], net, end)
    for i, j in DERIVATIVE_ORDERS:
        if last is None:
            first = _take_largest(errors[0][i], spans[1], degrees[1], 1, j + 1 if end == 0 else None) * powers[1][j]
        else:
            first = last[i][:, [j]]
        second = _take_largest(errors[1][j], spans[0], degrees[0], 0)
        error[i, j] = first + second * powers[0][i] + lost * powers[0][i] * powers[1][j]
    for (i, j), extra in _bound_parameter_errors(size, powers, doubt).items():
        error[i, j] = error[i, j] + extra
    if weights is None:
        return RoundingBounds({o: 2 * e for o, e in error.items()}, {o: 2 * s for o, s in size.items()})
    return _apply_quotient_rule(error, size, 1 / least, far)


def _bound_direction_errors(
    degree: int, knots: Array, spans: Array, local: Array, *, start: bool = False
) -> list[Array]:
    """Return the errors of the k-th derivatives in one direction, k = 0, 1, 2, anywhere in spans: (spans, other).

    Or, at the ``start`` of the spans, from poles (degree + 1, spans, other, dim).
    """
    p = degree
    left = knots[spans - p + 1 + np.arange(p)[:, None]]  # (p, spans)
    right = knots[spans + 1 + np.arange(p)[:, None]]
    terms, differences = [np.abs(local).max(axis=(0, -1))], local
    for r in range(p):
        # of order r + 1: entry j stands between the knots left[j] and right[j - r]
        reach = (right[: p - r] - left[r:])[..., None, None]
        differences = np.diff(differences, axis=0) / reach
        terms.append(np.abs(differences).max(axis=(0, -1)))
    value = terms[0]
    steps = (knots[spans] if start else knots[spans + 1]) - left  # (p, spans)
    for i in range(p):
        for j in range(i, -1, -1):
            terms[j] = terms[j] + steps[i, :, None] * terms[j + 1]
    rounds = (steps > 0).sum(axis=0)[:, None]
    terms += [np.zeros_like(value)] * 2
    errors = [EPS / 2 * (4 + 3 * rounds) * perm(p, k) * terms[k] for k in range(3)]
    errors[0] -= EPS / 2 * (4 + 2 * rounds) * value  # which is no difference, and not multiplied
    return errors


def _bound_row_errors(
    degrees: tuple[int, int], knots: tuple[Array, Array], spans: Array, net: Array, end: int
) -> list[Array]:
    """Return the errors of derivatives along, of orders 0 to 2, of those across at an end: (spans, 3) each."""
    breaks, table, _ = extract_pieces(degrees[1], knots[1], np.moveaxis(net, 1, 0))  # (q + 1, nu, dim, nv)
    table, length, rows = table[..., -end], np.diff(breaks)[-end], []
    for _ in range(3):
        rows.append(table[-end])
        table = bernstein.differentiate_coefs(table) / length
    p = degrees[0]
    local = np.stack(rows, axis=1)[spans - p + np.arange(p + 1)[:, None]]
    return _bound_direction_errors(p, knots[0], spans, local)


def _bound_derivatives(
    degrees: tuple[int, int], knots: tuple[Array, Array], net: Array, end: int | None
) -> dict[tuple[int, int], Array]:
    """Bound derivatives of a net by the hulls of its Bernstein pieces, by order: (nu, nv), or (nu, 1) at an end."""
    breaks, rows, _ = extract_pieces(degrees[0], knots[0], net)
    other, coefs, _ = extract_pieces(degrees[1], knots[1], np.moveaxis(rows, 1, 0))  # (q+1, p+1, dim, nu, nv)
    lengths, across = np.diff(breaks)[:, None], np.diff(other)
    if end is not None:
        coefs, across = coefs[..., [-end]], across[[-end]]
    found = {}
    for i, j in DERIVATIVE_ORDERS:
        table = coefs
        for _ in range(j):
            table = bernstein.differentiate_coefs(table)
        table = np.moveaxis(table if end is None else table[[-end]], 1, 0)
        for _ in range(i):
            table = bernstein.differentiate_coefs(table)
        found[i, j] = np.abs(table).max(axis=(0, 1, 2)) / (lengths**i * across**j)
    return found


def _take_largest(table: Array, spans: Array, degree: int, axis: int, most: int | None = None) -> Array:
    """Return the largest over the poles, ``most`` of them, that take part in each span of the other direction."""
    local = np.moveaxis(table, axis, 0)[spans - degree + np.arange(degree + 1)[:most, None]]
    return np.asarray(np.moveaxis(local.max(axis=0), 0, axis))


def _bound_parameter_errors(
    size: dict[tuple[int, int], Array], powers: list[list[Array]], doubt: tuple[float, float]
) -> dict[tuple[int, int], Array]:
    """Return by how much derivatives differ at parameters that are off."""
    u, v = doubt
    higher = {(3, 0): size[2, 0] * powers[0][1], (2, 1): size[2, 0] * powers[1][1]}
    higher |= {(1, 2): size[0, 2] * powers[0][1], (0, 3): size[0, 2] * powers[1][1]}
    known = size | higher
    return {(i, j): known[i + 1, j] * u + known[i, j + 1] * v for i, j in DERIVATIVE_ORDERS}


def _apply_quotient_rule(
    error: dict[tuple[int, int], Array], size: dict[tuple[int, int], Array], scale: float, far: float
) -> RoundingBounds:
    """Apply the quotient rule to homogeneous bounds, whose weights count times the largest coordinate."""
    found: dict[tuple[int, int], Array] = {}
    vector: dict[tuple[int, int], Array] = {}
    slope = {order: scale * value / far for order, value in size.items()}  # of weights, relative
    for i, j in DERIVATIVE_ORDERS:
        vector[i, j], doubt = 2 * scale * size[i, j], 2 * scale * error[i, j] + 8 * EPS * scale * size[i, j]
        for a in range(i + 1):
            for b in range(j + 1):
                if a or b:
                    times = comb(i, a) * comb(j, b)
                    vector[i, j] = vector[i, j] + times * slope[a, b] * vector[i - a, j - b]
                    doubt = doubt + times * (
                        slope[a, b] * (found[i - a, j - b] + 4 * EPS * vector[i - a, j - b])
                        + scale * error[a, b] / far * vector[i - a, j - b]
                    )
        found[i, j] = doubt + scale * error[0, 0] / far * vector[i, j]
    return RoundingBounds(found, vector)
