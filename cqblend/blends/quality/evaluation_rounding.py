r"""Bounds of the rounding in OCCT's evaluation of B-spline surfaces (BSplCLib) and of their derivatives.

OCCT uses Boehm's algorithm, in one direction after the other: p rounds of divided differences of the poles around a
span, the largest of order j being n_j, then p rounds of nested multiplication by the distances s_i from the knots to
the left, which give

.. math:: A_k = \frac{p!}{(p-k)!}\, \Big(\text{sums of products}\ n_j\, s_{i_1} \cdots s_{i_{j-k}}\Big),

terms of the k-th derivative taken with one sign. Differences of doubles err by their own rounding alone, sums by the
rounding of their terms; with r rounds of the second kind whose distance is not zero, the error is at most

.. math:: e_k = \epsilon \big(2 + \tfrac{3}{2} r\big) A_k, \qquad
          e_0 = \epsilon \big(2 + \tfrac{3}{2} r\big) (A_0 - n_0) + \tfrac{\epsilon}{2} r\, n_0 .

The error of one direction enters the other, whose l-th derivative magnifies it by :math:`D_l`, 1 or 2q/h or
4q(q-1)/h^2, with h the length of the span:

.. math:: E_{kl} = e_k D_l + e_l D_k + \delta\, D_k D_l.

Here delta is the rounding of products of poles and weights, if there are weights. The direction of the lower degree
comes first; where that is v, at a boundary v = const, only rows along the boundary remain for u. At the left end of
the knots nothing is added. Derivatives in space follow by the quotient rule, whose terms are as large as the
coordinates: far from the origin the errors of rational surfaces are larger. Depends on B-splines only.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, perm
from typing import TypeAlias

import numpy as np

from cqblend.splines import bernstein
from cqblend.splines.bernstein import EPSILON, Array
from cqblend.splines.knots import extract_pieces
from cqblend.splines.surface import BSplineSurface

DERIVATIVE_ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


BoundTable: TypeAlias = dict[tuple[int, int], Array]  # by the orders of a derivative in u and v


@dataclass(frozen=True)
class RoundingBounds:
    """Bounds for each span, (nu, nv), by order (k, l): of the error of a derivative, and of the derivative itself."""

    error: BoundTable
    size: BoundTable

    def take_spans(self, u: Array, v: Array | int) -> RoundingBounds:
        """Return the bounds of some spans, by their indices."""
        error, size = ({order: table[u, v] for order, table in tables.items()} for tables in (self.error, self.size))
        return RoundingBounds(error, size)


def bound_rounding(
    spline: BSplineSurface, end: int | None = None, parameter_errors: tuple[float, float] = (0.0, 0.0)
) -> RoundingBounds:
    """Bound the rounding of OCCT's evaluation, to second order.

    Parameters
    ----------
    spline
        Degrees, full clamped knot vectors, poles and weights.
    end
        0 or 1 for the boundary at the first or at the last v, None for all of the surface.
    parameter_errors
        By how much u and v may themselves be off.
    """
    degrees, knots, poles, weights = spline
    largest_coordinate = float(np.abs(poles).max())
    net = (
        poles
        if weights is None
        else np.concatenate([poles, np.full_like(poles[..., :1], largest_coordinate)], -1) * weights[..., None]
    )
    spans = [p + np.flatnonzero(k[p : -p - 1] < k[p + 1 : len(k) - p]) for p, k in zip(degrees, knots, strict=True)]
    if end is not None:
        spans[1] = spans[1][[-end]]
    product_rounding = 0.0 if weights is None else EPSILON / 2 * float(np.abs(net).max())

    errors, factors = [], []
    for axis in (0, 1):
        p, k, span = degrees[axis], knots[axis], spans[axis]
        local = np.moveaxis(net, axis, 0)[span - p + np.arange(p + 1)[:, None]]  # (p + 1, spans, other, dim)
        direction_errors = _bound_direction_errors(p, k, span, local, start=end == 0 and axis == 1)
        errors.append([np.moveaxis(table, 0, axis) for table in direction_errors])
        length = (k[span + 1] - k[span])[:, None] if axis == 0 else (k[span + 1] - k[span])[None]
        factors.append([np.ones_like(length), 2 * p / length, 4 * p * max(p - 1, 0) / length**2])
    error: BoundTable = {}
    size = _bound_derivatives(degrees, knots, net, end)
    v_is_first = end is not None and degrees[1] < degrees[0]
    rows = _bound_row_errors(degrees, knots, spans[0], net, end) if end is not None and v_is_first else None
    for i, j in DERIVATIVE_ORDERS:
        if rows is None:
            first = _take_largest(errors[0][i], spans[1], degrees[1], 1, j + 1 if end == 0 else None) * factors[1][j]
        else:
            first = rows[i][:, [j]]
        second = _take_largest(errors[1][j], spans[0], degrees[0], 0)
        error[i, j] = first + second * factors[0][i] + product_rounding * factors[0][i] * factors[1][j]
    for (i, j), extra in _bound_parameter_errors(size, factors, parameter_errors).items():
        error[i, j] = error[i, j] + extra
    if weights is None:
        return RoundingBounds({o: 2 * e for o, e in error.items()}, {o: 2 * s for o, s in size.items()})
    return _apply_quotient_rule(error, size, 1 / float(weights.min()), largest_coordinate)


def bound_curve_rounding(spline: tuple[int, Array, Array, Array | None], at: float) -> Array:
    """Bound the rounding of OCCT's evaluation of a curve and its first two derivatives, (3,), in the span of ``at``.

    At the first knot of a curve, at that very point. ``spline`` has degree, full clamped knot vector, poles (n, 3), and
    weights (n,) or None.
    """
    degree, knots, poles, weights = spline
    largest_coordinate = float(np.abs(poles).max())
    net = poles if weights is None else np.column_stack([poles, np.full(len(poles), largest_coordinate)])
    net = net if weights is None else net * weights[:, None]
    breaks, coefs, _ = extract_pieces(degree, knots, net)
    piece = int(np.clip(np.searchsorted(breaks, at, "right") - 1, 0, len(breaks) - 2))
    span = np.array([np.searchsorted(knots, breaks[piece], "right") - 1])
    local = net[span - degree + np.arange(degree + 1)[:, None]][:, :, None]  # (degree + 1, 1, 1, dim)
    terms = _bound_direction_errors(degree, knots, span, local, start=at == breaks[0])
    length, table = float(breaks[piece + 1] - breaks[piece]), coefs[..., piece]
    product_rounding = 0.0 if weights is None else EPSILON / 2 * float(np.abs(net).max())
    zero = np.zeros(())
    error, size = dict.fromkeys(DERIVATIVE_ORDERS, zero), dict.fromkeys(DERIVATIVE_ORDERS, zero)
    for k in range(3):
        error[0, k] = terms[k][0, 0] + product_rounding * (2 * degree / length) ** k
        size[0, k] = np.abs(table).max() / length**k
        table = bernstein.differentiate_coefs(table)
    if weights is None:
        return np.array([2 * error[0, k] for k in range(3)])
    found = _apply_quotient_rule(error, size, 1 / float(weights.min()), largest_coordinate).error
    return np.array([found[0, k] for k in range(3)])


def _bound_direction_errors(
    degree: int, knots: Array, spans: Array, local: Array, *, start: bool = False
) -> list[Array]:
    """Return the errors of the k-th derivatives in one direction, k = 0, 1, 2: (spans, other) each.

    From poles ``local`` (degree + 1, spans, other, dim); anywhere in the spans, or at their ``start`` alone.
    """
    p = degree
    left = knots[spans - p + 1 + np.arange(p)[:, None]]  # (p, spans)
    right = knots[spans + 1 + np.arange(p)[:, None]]
    terms, differences = [np.abs(local).max(axis=(0, -1))], local
    for r in range(p):
        # differences of order r + 1: entry j belongs to the knots left[j] and right[j - r]
        knot_distance = (right[: p - r] - left[r:])[..., None, None]
        differences = np.diff(differences, axis=0) / knot_distance
        terms.append(np.abs(differences).max(axis=(0, -1)))
    value = terms[0]
    steps = (knots[spans] if start else knots[spans + 1]) - left  # (p, spans)
    for i in range(p):
        for j in range(i, -1, -1):
            terms[j] = terms[j] + steps[i, :, None] * terms[j + 1]
    rounds = (steps > 0).sum(axis=0)[:, None]
    terms += [np.zeros_like(value)] * 2
    errors = [EPSILON / 2 * (4 + 3 * rounds) * perm(p, k) * terms[k] for k in range(3)]
    errors[0] -= EPSILON / 2 * (4 + 2 * rounds) * value  # the pole itself is no difference, and is not multiplied
    return errors


def _bound_row_errors(
    degrees: tuple[int, int], knots: tuple[Array, Array], spans: Array, net: Array, end: int
) -> list[Array]:
    """Return the errors of derivatives by u of orders 0, 1, 2 at an end, for orders 0, 1, 2 by v: (spans, 3) each."""
    breaks, table, _ = extract_pieces(degrees[1], knots[1], np.moveaxis(net, 1, 0))  # (q + 1, nu, dim, nv)
    table, length, rows = table[..., -end], np.diff(breaks)[-end], []
    for _ in range(3):
        rows.append(table[-end])
        table = bernstein.differentiate_coefs(table) / length
    p = degrees[0]
    local = np.stack(rows, axis=1)[spans - p + np.arange(p + 1)[:, None]]
    return _bound_direction_errors(p, knots[0], spans, local)


def _bound_derivatives(degrees: tuple[int, int], knots: tuple[Array, Array], net: Array, end: int | None) -> BoundTable:
    """Bound the derivatives of a net by the hulls of its Bernstein pieces: (nu, nv) each, or (nu, 1) at an end."""
    breaks, rows, _ = extract_pieces(degrees[0], knots[0], net)
    other, coefs, _ = extract_pieces(degrees[1], knots[1], np.moveaxis(rows, 1, 0))  # (q+1, p+1, dim, nu, nv)
    lengths, across = np.diff(breaks)[:, None], np.diff(other)
    if end is not None:
        coefs, across = coefs[..., [-end]], across[[-end]]
    bounds = {}
    for i, j in DERIVATIVE_ORDERS:
        table = coefs
        for _ in range(j):
            table = bernstein.differentiate_coefs(table)
        table = np.moveaxis(table if end is None else table[[-end]], 1, 0)
        for _ in range(i):
            table = bernstein.differentiate_coefs(table)
        bounds[i, j] = np.abs(table).max(axis=(0, 1, 2)) / (lengths**i * across**j)
    return bounds


def _take_largest(table: Array, spans: Array, degree: int, axis: int, most: int | None = None) -> Array:
    """Return the largest value over the poles of each span in direction ``axis``, over the first ``most`` of them."""
    local = np.moveaxis(table, axis, 0)[spans - degree + np.arange(degree + 1)[:most, None]]
    return np.asarray(np.moveaxis(local.max(axis=0), 0, axis))


def _bound_parameter_errors(
    size: BoundTable, factors: list[list[Array]], parameter_errors: tuple[float, float]
) -> BoundTable:
    """Bound the change of the derivatives when the parameters are off."""
    u, v = parameter_errors
    third = {(3, 0): size[2, 0] * factors[0][1], (2, 1): size[2, 0] * factors[1][1]}
    third |= {(1, 2): size[0, 2] * factors[0][1], (0, 3): size[0, 2] * factors[1][1]}
    all_sizes = size | third
    return {(i, j): all_sizes[i + 1, j] * u + all_sizes[i, j + 1] * v for i, j in DERIVATIVE_ORDERS}


def _apply_quotient_rule(
    error: BoundTable, size: BoundTable, inverse_weight: float, largest_coordinate: float
) -> RoundingBounds:
    """Apply the quotient rule to bounds of homogeneous derivatives, with weights times the largest coordinate.

    ``inverse_weight`` is one over the least weight.
    """
    errors: BoundTable = {}
    sizes: BoundTable = {}
    relative_weight = {order: inverse_weight * value / largest_coordinate for order, value in size.items()}
    for i, j in DERIVATIVE_ORDERS:
        sizes[i, j] = 2 * inverse_weight * size[i, j]
        bound = 2 * inverse_weight * error[i, j] + 8 * EPSILON * inverse_weight * size[i, j]
        for a in range(i + 1):
            for b in range(j + 1):
                if a or b:
                    times = comb(i, a) * comb(j, b)
                    sizes[i, j] = sizes[i, j] + times * relative_weight[a, b] * sizes[i - a, j - b]
                    bound = bound + times * (
                        relative_weight[a, b] * (errors[i - a, j - b] + 4 * EPSILON * sizes[i - a, j - b])
                        + inverse_weight * error[a, b] / largest_coordinate * sizes[i - a, j - b]
                    )
        errors[i, j] = bound + inverse_weight * error[0, 0] / largest_coordinate * sizes[i, j]
    return RoundingBounds(errors, sizes)
