"""Polynomials in Bernstein form with a bound on the error of their coefficients, and bounds of what depends on them.

Every product and sum adds the rounding of its own arithmetic to that bound. Quantities that depend on norms of
polynomials are bounded by the hulls of coefficients, on pieces that are halved until the bounds are sharp. Depends on
Bernstein polynomials only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple, TypeAlias

import numpy as np

from cqblend.blends.quality.tolerances import PROOF_TOLERANCES
from cqblend.splines import bernstein
from cqblend.splines.bernstein import EPSILON, Array


class BoundedPolynomial(NamedTuple):
    """Bernstein coefficients (p+1, dim, n) of n pieces, and a bound of their error on each piece (n,)."""

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
            bernstein.elevate_degree(self.coefs, amount), self.error + EPSILON * (amount + 8) * self.size
        )

    def __mul__(self, other: BoundedPolynomial) -> BoundedPolynomial:  # type: ignore[override]
        """Multiply component by component; a scalar with each."""
        x, y = self.size, other.size
        rounding = EPSILON * (min(len(self.coefs), len(other.coefs)) + 8)
        error = rounding * x * y + x * other.error + self.error * y + self.error * other.error
        return BoundedPolynomial(bernstein.multiply_polynomials(self.coefs, other.coefs), error)

    def __sub__(self, other: BoundedPolynomial) -> BoundedPolynomial:
        degree = max(len(self.coefs), len(other.coefs))
        x, y = (poly.elevate_degree(degree - len(poly.coefs)) for poly in (self, other))
        return BoundedPolynomial(x.coefs - y.coefs, x.error + y.error + EPSILON * (x.size + y.size))

    def scale_by(self, factor: float) -> BoundedPolynomial:
        """Multiply by a number."""
        return BoundedPolynomial(self.coefs * factor, (self.error + EPSILON * self.size) * abs(factor))

    def dot(self, other: BoundedPolynomial) -> BoundedPolynomial:
        """Scalar product."""
        terms = self * other
        return BoundedPolynomial(
            terms.coefs.sum(axis=1, keepdims=True), terms.coefs.shape[1] * (terms.error + EPSILON * terms.size)
        )

    def cross(self, other: BoundedPolynomial) -> BoundedPolynomial:
        """Vector product."""
        return self.take_components(1, 2, 0) * other.take_components(2, 0, 1) - self.take_components(
            2, 0, 1
        ) * other.take_components(1, 2, 0)

    def halve_pieces(self) -> BoundedPolynomial:
        """Return both halves of every piece, the left ones first."""
        n = len(self.error)
        x0, x1 = np.repeat([0.0, 0.5], n), np.repeat([0.5, 1.0], n)
        error = self.error + EPSILON * len(self.coefs) * self.size
        return BoundedPolynomial(bernstein.restrict_pieces(np.tile(self.coefs, 2), x0, x1), np.tile(error, 2))

    def bound_norms(self) -> tuple[Array, Array]:
        """Bound the norm on each piece: (n,) from below, along the mean direction, (n,) from above, by the hull."""
        slack = np.sqrt(self.coefs.shape[1]) * self.error * (1 + 16 * EPSILON)
        lengths = np.linalg.norm(self.coefs, axis=1)
        mean = self.coefs.mean(axis=0)
        length = np.linalg.norm(mean, axis=0)
        mean = np.divide(mean, length, out=np.zeros_like(mean), where=length > 0)
        low = (self.coefs * mean).sum(axis=1).min(axis=0) * (1 - 16 * EPSILON) - slack
        return np.maximum(low, 0.0), lengths.max(axis=0) * (1 + 16 * EPSILON) + slack

    def bound_end_norms(self) -> tuple[Array, Array]:
        """Bound the norm at both ends of each piece: (2, n) from below, (2, n) from above."""
        slack = np.sqrt(self.coefs.shape[1]) * self.error
        lengths = np.linalg.norm(self.coefs[[0, -1]], axis=1)
        return np.maximum(lengths - slack, 0.0), lengths + slack


class HomogeneousRow(NamedTuple):
    """A homogeneous curve (xyz, w), its positions relative to a point of each piece."""

    xyz: BoundedPolynomial
    w: BoundedPolynomial

    def derive_in_space(self, base: HomogeneousRow) -> BoundedPolynomial:
        """Return the derivative in space that a homogeneous derivative (Y, Y_w) at a curve (X, w) means, times w^2.

        That is Y w - X Y_w.
        """
        return self.xyz * base.w - base.xyz * self.w


def simplify_weight(coefs: Array, error: Array) -> BoundedPolynomial:
    """Return a weight as a polynomial, of degree 0 if it is constant to rounding."""
    middle = coefs.mean(axis=0, keepdims=True)
    spread = np.abs(coefs - middle).max(axis=(0, 1))
    if np.all(spread <= PROOF_TOLERANCES.constant_weight * np.maximum(np.abs(middle[0, 0]), 1.0)):
        return BoundedPolynomial(middle, error + spread)
    return BoundedPolynomial(coefs, error)


NormBounds: TypeAlias = Mapping[str, Array]  # by the names of the polynomials, (n,) for n pieces


def bound_largest(
    polynomials: Mapping[str, BoundedPolynomial], bound_quantity: Callable[[NormBounds, NormBounds], Array]
) -> float:
    """Bound the largest value of a quantity that depends on the norms of polynomials.

    ``bound_quantity`` takes bounds of all norms, from below and from above, (n,) each, and returns an upper bound (n,).
    Pieces are halved until the bound is at most ``PROOF_TOLERANCES.sharpness`` times a value that is attained.
    """
    attained = bound = 0.0
    for halving in range(PROOF_TOLERANCES.proof_halvings + 1):
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            piece_bounds, end_values = (
                bound_quantity(*({name: pair[k] for name, pair in norms.items()} for k in (0, 1)))
                for norms in (
                    {name: polynomial.bound_norms() for name, polynomial in polynomials.items()},
                    {name: polynomial.bound_end_norms() for name, polynomial in polynomials.items()},
                )
            )
        piece_bounds = np.where(np.isnan(piece_bounds), np.inf, piece_bounds)
        attained = max(attained, float(end_values[np.isfinite(end_values)].max(initial=0.0)))
        too_loose = piece_bounds > PROOF_TOLERANCES.sharpness * attained
        if halving == PROOF_TOLERANCES.proof_halvings or too_loose.sum() > PROOF_TOLERANCES.halved_pieces:
            too_loose[:] = False
        bound = max(bound, float(piece_bounds[~too_loose].max(initial=0.0)))
        if not too_loose.any():
            break
        polynomials = {
            name: polynomial.take_pieces(too_loose).halve_pieces() for name, polynomial in polynomials.items()
        }
    return bound
