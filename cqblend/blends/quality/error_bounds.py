"""Polynomials in Bernstein form with a bound on the error of their coefficients, and bounds of what depends on them.

Every product and sum carries the rounding of its own arithmetic along. Quantities that depend on norms of polynomials
are bounded by the hulls of coefficients, on ever shorter pieces until that is sharp. This module must not know what is
proven with it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from cqblend.splines import bernstein
from cqblend.splines.bernstein import Array

EPS = float(np.finfo(float).eps)
SHARPNESS_RATIO = 1.25  # how much larger than a value that is taken a bound may be; pieces are halved until it is
MOST_HALVINGS = 12
MOST_HALVED_PIECES = 4096  # pieces that are halved


class BoundedPolynomial(NamedTuple):
    """Bernstein coefficients (p+1, dim, n), and by how much those of each piece may be off (n,)."""

    coefs: Array
    error: Array

    @property
    def size(self) -> Array:
        """Largest absolute coefficient of each piece, (n,)."""
        return np.abs(self.coefs).max(axis=(0, 1))

    def take_components(self, *components: int) -> BoundedPolynomial:
        """Take components, in the given order."""
        return BoundedPolynomial(self.coefs[:, list(components)], self.error)

    def take_pieces(self, pieces: Array) -> BoundedPolynomial:
        """Take pieces, (n,) bool."""
        return BoundedPolynomial(self.coefs[..., pieces], self.error[pieces])

    def elevate_degree(self, amount: int) -> BoundedPolynomial:
        """Raise the degree."""
        if not amount:
            return self
        return BoundedPolynomial(
            bernstein.elevate_degree(self.coefs, amount), self.error + EPS * (amount + 8) * self.size
        )

    def __mul__(self, other: BoundedPolynomial) -> BoundedPolynomial:  # type: ignore[override]
        """Multiply component by component; a scalar with each."""
        x, y = self.size, other.size
        rounding = EPS * (min(len(self.coefs), len(other.coefs)) + 8)
        error = rounding * x * y + x * other.error + self.error * y + self.error * other.error
        return BoundedPolynomial(bernstein.multiply_polynomials(self.coefs, other.coefs), error)

    def __sub__(self, other: BoundedPolynomial) -> BoundedPolynomial:
        degree = max(len(self.coefs), len(other.coefs))
        x, y = (poly.elevate_degree(degree - len(poly.coefs)) for poly in (self, other))
        return BoundedPolynomial(x.coefs - y.coefs, x.error + y.error + EPS * (x.size + y.size))

    def scale_by(self, factor: float) -> BoundedPolynomial:
        """Multiply by a number."""
        return BoundedPolynomial(self.coefs * factor, (self.error + EPS * self.size) * abs(factor))

    def dot(self, other: BoundedPolynomial) -> BoundedPolynomial:
        """Scalar product."""
        terms = self * other
        return BoundedPolynomial(
            terms.coefs.sum(axis=1, keepdims=True), terms.coefs.shape[1] * (terms.error + EPS * terms.size)
        )

    def cross(self, other: BoundedPolynomial) -> BoundedPolynomial:
        """Vector product."""
        return self.take_components(1, 2, 0) * other.take_components(2, 0, 1) - self.take_components(
            2, 0, 1
        ) * other.take_components(1, 2, 0)

    def halve_pieces(self) -> BoundedPolynomial:
        """Both halves of every piece, the left ones first."""
        n = len(self.error)
        x0, x1 = np.repeat([0.0, 0.5], n), np.repeat([0.5, 1.0], n)
        error = self.error + EPS * len(self.coefs) * self.size
        return BoundedPolynomial(bernstein.restrict_pieces(np.tile(self.coefs, 2), x0, x1), np.tile(error, 2))

    def bound_norms(self) -> tuple[Array, Array]:
        """Bound the norm on each piece, (n,) from below, along the mean direction, and (n,) from above, by the hull."""
        slack = np.sqrt(self.coefs.shape[1]) * self.error * (1 + 16 * EPS)
        lengths = np.linalg.norm(self.coefs, axis=1)
        mean = self.coefs.mean(axis=0)
        length = np.linalg.norm(mean, axis=0)
        mean = np.divide(mean, length, out=np.zeros_like(mean), where=length > 0)
        low = (self.coefs * mean).sum(axis=1).min(axis=0) * (1 - 16 * EPS) - slack
        return np.maximum(low, 0.0), lengths.max(axis=0) * (1 + 16 * EPS) + slack

    def bound_end_norms(self) -> tuple[Array, Array]:
        """Bound the norm at both ends of each piece, (2, n) from below and from above."""
        slack = np.sqrt(self.coefs.shape[1]) * self.error
        lengths = np.linalg.norm(self.coefs[[0, -1]], axis=1)
        return np.maximum(lengths - slack, 0.0), lengths + slack


class HomogeneousRow(NamedTuple):
    """A homogeneous curve (xyz, w), its positions taken from a point of each piece."""

    xyz: BoundedPolynomial
    w: BoundedPolynomial

    def derive_in_space(self, base: HomogeneousRow) -> BoundedPolynomial:
        """Return what a jet is in space, times the square of the weight: Y w - X Y_w, for a base (X, w)."""
        return self.xyz * base.w - base.xyz * self.w


def simplify_weight(coefs: Array, error: Array) -> BoundedPolynomial:
    """Return a weight; one that is constant to rounding, as a constant."""
    middle = coefs.mean(axis=0, keepdims=True)
    spread = np.abs(coefs - middle).max(axis=(0, 1))
    if np.all(spread <= 64 * EPS * np.maximum(np.abs(middle[0, 0]), 1.0)):
        return BoundedPolynomial(middle, error + spread)
    return BoundedPolynomial(coefs, error)


NormBounds = Mapping[str, Array]


def bound_largest(polys: Mapping[str, BoundedPolynomial], quantity: Callable[[NormBounds, NormBounds], Array]) -> float:
    """Bound a quantity that depends on the norms of polynomials: from above, at best within ``SHARPNESS_RATIO``.

    ``quantity`` takes bounds of all norms, from below and from above, (n,) each, and returns a bound (n,).
    """
    taken = bound = 0.0
    for halving in range(MOST_HALVINGS + 1):
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found, values = (
                quantity(*({name: pair[k] for name, pair in bounds.items()} for k in (0, 1)))
                for bounds in (
                    {name: poly.bound_norms() for name, poly in polys.items()},
                    {name: poly.bound_end_norms() for name, poly in polys.items()},
                )
            )
        found = np.where(np.isnan(found), np.inf, found)
        taken = max(taken, float(values[np.isfinite(values)].max(initial=0.0)))
        open_ = found > SHARPNESS_RATIO * taken
        if halving == MOST_HALVINGS or open_.sum() > MOST_HALVED_PIECES:
            open_[:] = False
        bound = max(bound, float(found[~open_].max(initial=0.0)))
        if not open_.any():
            break
        polys = {name: poly.take_pieces(open_).halve_pieces() for name, poly in polys.items()}
    return bound
