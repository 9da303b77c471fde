"""Bernstein arithmetic on bare arrays: product, composition, subdivision, degree changes, evaluation.

Every function takes coefficients with the degree axis first and the batch of pieces last, and is a sum of products of
weights of one sign as long as parameters stay inside the pieces: that is why nothing here loses digits, at degree 48 as
at degree 3. Arrays may hold float64, or Python objects (``fractions.Fraction``, ``mpmath.mpf``): run on those, the same
code is its own oracle (all but `reduce_degree`). Depends on NumPy only; which component is a weight plays no part.
"""

import itertools
from collections.abc import Sequence
from functools import lru_cache
from functools import reduce as reduce_by
from math import comb
from operator import add
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from cqblend.errors import GeometryError

Array = NDArray[Any]

EPSILON = float(np.finfo(float).eps)
"""Distance from 1 to the next float64, 2^-52: twice the largest relative rounding error of one operation."""

PowerSeries: TypeAlias = Sequence[Array]
"""A truncated power series in a second variable: by order, polynomials of any degrees."""


@lru_cache(maxsize=512)
def tabulate_binomials(degrees: tuple[int, ...], trailing: int, exact: bool) -> Array:
    """Tensor of products of binomials C(p1, i1) C(p2, i2) ..; cached, read-only.

    `trailing` axes of length one are appended; `exact` gives Python integers in place of float64.
    """
    table = np.array(1, dtype=object)
    for degree in degrees:
        table = np.multiply.outer(table, np.array([comb(degree, i) for i in range(degree + 1)], dtype=object))
    table = np.asarray(table).reshape(*(degree + 1 for degree in degrees), *(1,) * trailing)
    if not exact:
        try:
            table = table.astype(np.float64)
        except OverflowError:
            raise GeometryError(
                f"a polynomial of degree {max(degrees)} is beyond floats, whose binomials end at degree 1029",
                kind="degree",
                value=float(max(degrees)),
            ) from None
    table.setflags(write=False)
    return table


def _binomial_weights(coefs: Array, degree_axes: int = 1) -> Array:
    """Binomials that turn `coefs` into coefficients of the scaled basis t^i (1-t)^(p-i), ready to multiply."""
    degrees = tuple(n - 1 for n in coefs.shape[:degree_axes])
    return tabulate_binomials(degrees, coefs.ndim - degree_axes, coefs.dtype == object)


def _convolve_scaled(a: Array, b: Array, degree_axes: int = 1) -> Array:
    """Multiply in the scaled basis: plain convolution over the leading axes, broadcasting over the others."""
    small, large = a.shape[:degree_axes], b.shape[:degree_axes]
    if small > large:
        a, b, small, large = b, a, large, small
    if max(small) == 1:
        return np.asarray(a * b)
    dtype = a.dtype if a.dtype == b.dtype else np.result_type(a, b)
    rest = a.shape[degree_axes:]
    if rest != b.shape[degree_axes:]:
        rest = np.broadcast_shapes(rest, b.shape[degree_axes:])
    if degree_axes == 1 and len(a) * b.size < _SKEWED_SIZE:
        skewed = np.zeros((len(a), len(a) + len(b), *rest), dtype=dtype)
        np.multiply(a[:, None], b, out=skewed[:, : len(b)])
        return _sum_skewed(skewed)
    out = np.zeros((*(m + n - 1 for m, n in zip(small, large, strict=True)), *rest), dtype=dtype)
    for index in itertools.product(*map(range, small)):
        window = tuple([slice(i, i + n) for i, n in zip(index, large, strict=True)])
        out[window] += a[index] * b
    return out


_SKEWED_SIZE = 8192
"""Number of products of coefficients up to which one large array of them is faster than one after the other."""


def _sum_skewed(products: Array) -> Array:
    """Sum products of coefficients i and j, (m, m + n, ..) with m columns of zeros last, by i + j, (m + n - 1, ..).

    Read as rows that are shorter by one, each row stands one place further to the right than the last, so that
    products of one degree stand in one column.
    """
    m, rest = len(products), products.shape[2:]
    width = products.shape[1] - 1
    return np.asarray(np.add.reduce(products.reshape(-1, *rest)[: m * width].reshape(m, width, *rest)))


def multiply_polynomials(a: Array, b: Array, degree_axes: int = 1) -> Array:
    r"""Multiply Bernstein polynomials, of one variable or of two.

    .. math:: c_k = \binom{p+q}{k}^{-1} \sum_{i+j=k} \binom{p}{i} a_i \binom{q}{j} b_j

    Parameters
    ----------
    a, b
        Coefficients (p+1, ..) and (q+1, ..); with ``degree_axes=2`` (p1+1, p2+1, ..) and (q1+1, q2+1, ..). The
        remaining axes (components, pieces) broadcast against each other; both arrays have the same number of axes.
    degree_axes
        How many leading axes are degree axes.

    Returns
    -------
    Array
        Coefficients of the product, of degree p + q.

    Examples
    --------
    >>> multiply_polynomials(np.array([[1.0], [0.0]]), np.array([[0.0], [1.0]])).ravel()  # (1 - t) t
    array([0. , 0.5, 0. ])
    """
    out = _convolve_scaled(a * _binomial_weights(a, degree_axes), b * _binomial_weights(b, degree_axes), degree_axes)
    return np.asarray(out / _binomial_weights(out, degree_axes))


def elevate_degree(coefs: Array, amount: int) -> Array:
    """Raise the degree by `amount` (>= 0) along axis 0: the product with a one of that degree.

    Examples
    --------
    >>> elevate_degree(np.array([[0.0], [1.0]]), 1).ravel()
    array([0. , 0.5, 1. ])
    """
    if amount == 0:
        return coefs
    one = np.ones((amount + 1,) + (1,) * (coefs.ndim - 1), dtype=coefs.dtype)
    return multiply_polynomials(coefs, one)


@lru_cache(maxsize=128)
def _build_reduction_matrix(degree: int, amount: int) -> tuple[Array, Array]:
    """Elevation matrix from degree - amount to degree, and its pseudoinverse."""
    matrix = elevate_degree(np.eye(degree - amount + 1), amount)
    return matrix, np.linalg.pinv(matrix)


def reduce_degree(coefs: Array, amount: int) -> Array:
    """Lower the degree by `amount` along axis 0, right if the polynomials really are of lower degree.

    Least squares for the coefficients whose elevation is given, refined once: 3e-16 from degree 48 to 47. Division by
    (1 + x) in the scaled basis, from both ends towards the middle, is as good for one step, but uses few coefficients
    and loses where least squares does not (48 to 8: 6e-12 against 1e-15; 48 to 28: 1e-10 against 4e-13). For float64
    only. The caller checks the remainder by elevating the result.
    """
    up, down = _build_reduction_matrix(len(coefs) - 1, amount)
    flat = coefs.reshape(len(coefs), -1)
    out = down @ flat
    out += down @ (flat - up @ out)
    return out.reshape(-1, *coefs.shape[1:])


def differentiate_coefs(coefs: Array) -> Array:
    """Differentiate along axis 0 by the local parameter in [0, 1]; a constant gives the constant zero."""
    degree = len(coefs) - 1
    return degree * (coefs[1:] - coefs[:-1]) if degree else np.zeros_like(coefs)


def restrict_pieces(coefs: Array, x0: Array | float, x1: Array | float) -> Array:
    """Coefficients over the part [x0, x1] of each piece, 0 <= x0 < x1 <= 1 (or outside, as polynomial continuation).

    Parameters
    ----------
    coefs
        (p+1, .., n).
    x0, x1
        Local parameters, numbers or (n,), x0 < 1. Where x0 = 0 and x1 = 1 the piece comes back bit for bit.
    """
    out = coefs.copy()
    p = len(out) - 1
    t, s = x0, 1 - x0
    for r in range(p):
        out[: p - r] = s * out[: p - r] + t * out[1 : p - r + 1]
    t, s = (x1 - x0) / (1 - x0), (1 - x1) / (1 - x0)
    for r in range(p):
        out[r + 1 :] = s * out[r:-1] + t * out[r + 1 :]
    return out


def evaluate_blossom(coefs: Array, arguments: Array) -> Array:
    """Polar form of each piece at p local arguments.

    Parameters
    ----------
    coefs
        (p+1, .., n).
    arguments
        (p, n) local arguments; zeros and ones select coefficients without rounding, so pass those first.

    Returns
    -------
    Array
        (.., n).
    """
    for x in arguments:
        coefs = (1 - x) * coefs[:-1] + x * coefs[1:]
    return np.asarray(coefs[0])


def evaluate_basis(degree: int, s: Array, t: Array) -> Array:
    """Bernstein polynomials C(p, i) s^(p-i) t^i, shape (p+1, ..); ordinary for s = 1 - t.

    Pass s and t each computed from the ends of its piece, and both ends are met without rounding.
    """
    powers = tabulate_powers(degree, s, t)
    out = powers[:, 1] * powers[::-1, 0]
    return np.asarray(out * _binomial_weights(out) if degree > 1 else out)


def tabulate_powers(degree: int, s: Array, t: Array) -> Array:
    """Powers 0 .. p of s and of t, (p+1, 2, ..)."""
    out = np.empty((degree + 1, 2, *np.shape(t)), dtype=np.result_type(s, t))
    out[0] = 1
    if degree:
        out[1, 0], out[1, 1] = s, t
    for i in range(1, degree):
        np.multiply(out[i], out[1], out=out[i + 1])
    return out


def contract_with_basis(coefs: Array, values: Array) -> Array:
    """Contract the degree axis of coefs (p+1, .., n) with basis values (p+1, n), column by column of the batch."""
    return np.asarray(np.einsum("i...,i...->...", coefs, values.reshape(len(values), *(1,) * (coefs.ndim - 2), -1)))


def _add_scaled(terms: Sequence[Array]) -> Array:
    """Add polynomials of several degrees in the scaled basis."""
    if len(terms) == 1:
        return terms[0]
    size = max(map(len, terms))
    return np.asarray(
        reduce_by(
            add,
            [
                _convolve_scaled(term, tabulate_binomials((size - len(term),), term.ndim - 1, term.dtype == object))
                if len(term) < size
                else term
                for term in terms
            ],
        )
    )


def _multiply_series(a: PowerSeries, b: PowerSeries) -> list[Array]:
    """Multiply power series of equal length whose coefficients are in the scaled basis, up to that length."""
    return [_add_scaled([_convolve_scaled(a[k - j], b[j]) for j in range(k + 1)]) for k in range(len(a))]


def _form_basis_products(degree: int, pair: PowerSeries) -> list[Array]:
    """Form C(p, i) x^(p-i) y^i for all i, (.., p+1, n) by order, from x and y, (m+1, 2, n), in the scaled basis.

    The products x^(r-i) y^i of degree r come from those of the degrees r - r // 2 and r // 2.
    """
    known: dict[int, PowerSeries] = {1: pair}

    def form_products(r: int) -> PowerSeries:
        if r not in known:
            longer, shorter = form_products(r - r // 2), form_products(r // 2)
            first, second = _split_exponents(r)
            known[r] = _multiply_series(
                [part.take(first, axis=1) for part in longer], [part.take(second, axis=1) for part in shorter]
            )
        return known[r]

    if degree == 0:
        return [np.ones_like(pair[0][:1, :1]), *(np.zeros_like(part[:1, :1]) for part in pair[1:])]
    if degree == 1:
        return list(pair)
    binomials = tabulate_binomials((degree,), 1, pair[0].dtype == object)
    return [binomials * part for part in form_products(degree)]


@lru_cache(maxsize=64)
def _split_exponents(degree: int) -> tuple[Array, Array]:
    """Exponents 0 .. degree as sums of two, at most degree - degree // 2 and degree // 2."""
    exponent = np.arange(degree + 1)
    first = np.minimum(exponent, degree - degree // 2)
    return first, exponent - first


def compose_patch(patch: Array, alpha: Array, beta: Array, gamma: Array, delta: Array) -> Array:
    r"""Compose patches with barycentric coordinate functions.

    .. math:: \sum_{i,j} \binom{p}{i} \binom{q}{j} P_{ij}\, \alpha^{p-i} \beta^i \gamma^{q-j} \delta^j

    For an ordinary curve alpha = 1 - u, beta = u; for a rational one, u = U / w, alpha = w - U, beta = U up to a common
    factor, and the result carries the weight of the patch times w^p. Nothing is divided, so (alpha, beta) is a
    projective parameter and alpha may pass through zero. Likewise (gamma, delta) for v.

    Parameters
    ----------
    patch
        (p+1, q+1, dim, n), homogeneous if the surface is rational.
    alpha, beta
        (m+1, n) Bernstein coefficients.
    gamma, delta
        (k+1, n) Bernstein coefficients.

    Returns
    -------
    Array
        (m p + k q + 1, dim, n) Bernstein coefficients.
    """
    return compose_series(patch, [alpha], [beta], [gamma], [delta])[0]


def compose_series(
    patch: Array, alpha: PowerSeries, beta: PowerSeries, gamma: PowerSeries, delta: PowerSeries
) -> list[Array]:
    """Compose patches with power series in a second variable, whose coefficients are as those of :func:`compose_patch`.

    Parameters
    ----------
    patch
        (p+1, q+1, dim, n).
    alpha, beta, gamma, delta
        By order 0 .. K, the same for all: (m+1, n) Bernstein coefficients, of any degree in each order.

    Returns
    -------
    list of Array
        By order 0 .. K: (.., dim, n) Bernstein coefficients, of the least degree that the terms of that order have.

    Notes
    -----
    Basis products (Kim and Elber, eq. 1 and 2), contracted with the patch one direction after the other, and a last
    convolution in one stroke. Bernstein-Horner is as accurate; it took 1.2 to 1.5 times as long in NumPy at degrees 6
    to 48, most of it in calls.
    """
    p, q = patch.shape[0] - 1, patch.shape[1] - 1
    first, second = (
        [_pair_scaled(x, y) for x, y in zip(*pair, strict=True)] for pair in ((alpha, beta), (gamma, delta))
    )
    if p == q and [f.shape for f in first] == [f.shape for f in second]:  # both directions at once
        n = patch.shape[-1]
        both = _form_basis_products(p, [np.concatenate(pair, axis=-1) for pair in zip(first, second, strict=True)])
        columns, others = [basis[..., :n] for basis in both], [basis[..., n:] for basis in both]
    else:
        columns, others = _form_basis_products(p, first), _form_basis_products(q, second)
    rows = [np.einsum("ljn,ijdn->ildn", basis, patch) for basis in others]
    out = []
    for k in range(len(columns)):
        total = _add_scaled([_multiply_and_sum(columns[k - j], rows[j]) for j in range(k + 1)])
        out.append(np.asarray(total / _binomial_weights(total)))
    return out


def _pair_scaled(x: Array, y: Array) -> Array:
    """Pair two polynomials (m+1, n), of one degree, in the scaled basis: (m+1, 2, n)."""
    pair = np.empty((len(x), 2, x.shape[-1]), dtype=x.dtype)
    pair[:, 0], pair[:, 1] = x, y
    return pair * _binomial_weights(pair) if len(x) > 2 else pair


def _multiply_and_sum(columns: Array, rows: Array) -> Array:
    """Multiply (m, p+1, n) by (p+1, k, dim, n), both in the scaled basis, and sum over p."""
    m, k = len(columns), rows.shape[1]
    skewed = np.zeros((m, m + k, *rows.shape[2:]), dtype=rows.dtype)
    np.einsum("min,ildn->mldn", columns, rows, out=skewed[:, :k])
    return _sum_skewed(skewed)


def compose_curve(coefs: Array, alpha: Array, beta: Array) -> Array:
    """Compose polynomials (p+1, dim, n) with barycentric functions (m+1, n); see :func:`compose_patch`."""
    (products,) = _form_basis_products(len(coefs) - 1, [_pair_scaled(alpha, beta)])
    out = np.einsum("min,idn->mdn", products, coefs)
    return np.asarray(out / _binomial_weights(out))
