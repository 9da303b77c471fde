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
RATIO = 1.25  # how much larger than a value that is taken a bound may be; pieces are halved until it is
HALVINGS = 12
MOST = 4096  # pieces that are halved


class Poly(NamedTuple):
    """Bernstein coefficients (p+1, dim, n), and by how much those of each piece may be off (n,)."""

    coefs: Array
    error: Array

    @property
    def size(self) -> Array:
        """Largest absolute coefficient of each piece, (n,)."""
        return np.abs(self.coefs).max(axis=(0, 1))

    def pick(self, *components: int) -> Poly:
        """Take components, in the given order."""
        return Poly(self.coefs[:, list(components)], self.error)

    def at(self, pieces: Array) -> Poly:
        """Take pieces, (n,) bool."""
        return Poly(self.coefs[..., pieces], self.error[pieces])

    def elevated(self, amount: int) -> Poly:
        """Raise the degree."""
        if not amount:
            return self
        return Poly(bernstein.elevate(self.coefs, amount), self.error + EPS * (amount + 8) * self.size)

    def __mul__(self, other: Poly) -> Poly:  # type: ignore[override]
        """Multiply component by component; a scalar with each."""
        x, y = self.size, other.size
        rounding = EPS * (min(len(self.coefs), len(other.coefs)) + 8)
        error = rounding * x * y + x * other.error + self.error * y + self.error * other.error
        return Poly(bernstein.product(self.coefs, other.coefs), error)

    def __sub__(self, other: Poly) -> Poly:
        degree = max(len(self.coefs), len(other.coefs))
        x, y = (poly.elevated(degree - len(poly.coefs)) for poly in (self, other))
        return Poly(x.coefs - y.coefs, x.error + y.error + EPS * (x.size + y.size))

    def times(self, factor: float) -> Poly:
        """Multiply by a number."""
        return Poly(self.coefs * factor, (self.error + EPS * self.size) * abs(factor))

    def dot(self, other: Poly) -> Poly:
        """Scalar product."""
        terms = self * other
        return Poly(terms.coefs.sum(axis=1, keepdims=True), terms.coefs.shape[1] * (terms.error + EPS * terms.size))

    def cross(self, other: Poly) -> Poly:
        """Vector product."""
        return self.pick(1, 2, 0) * other.pick(2, 0, 1) - self.pick(2, 0, 1) * other.pick(1, 2, 0)

    def halves(self) -> Poly:
        """Both halves of every piece, the left ones first."""
        n = len(self.error)
        x0, x1 = np.repeat([0.0, 0.5], n), np.repeat([0.5, 1.0], n)
        error = self.error + EPS * len(self.coefs) * self.size
        return Poly(bernstein.restrict(np.tile(self.coefs, 2), x0, x1), np.tile(error, 2))

    def norms(self) -> tuple[Array, Array]:
        """Bound the norm on each piece, (n,) from below, along the mean direction, and (n,) from above, by the hull."""
        slack = np.sqrt(self.coefs.shape[1]) * self.error * (1 + 16 * EPS)
        lengths = np.linalg.norm(self.coefs, axis=1)
        mean = self.coefs.mean(axis=0)
        length = np.linalg.norm(mean, axis=0)
        mean = np.divide(mean, length, out=np.zeros_like(mean), where=length > 0)
        low = (self.coefs * mean).sum(axis=1).min(axis=0) * (1 - 16 * EPS) - slack
        return np.maximum(low, 0.0), lengths.max(axis=0) * (1 + 16 * EPS) + slack

    def ends(self) -> tuple[Array, Array]:
        """Bound the norm at both ends of each piece, (2, n) from below and from above."""
        slack = np.sqrt(self.coefs.shape[1]) * self.error
        lengths = np.linalg.norm(self.coefs[[0, -1]], axis=1)
        return np.maximum(lengths - slack, 0.0), lengths + slack


class Row(NamedTuple):
    """A homogeneous curve (xyz, w), its positions taken from a point of each piece."""

    xyz: Poly
    w: Poly

    def over(self, base: Row) -> Poly:
        """Return what a jet is in space, times the square of the weight: Y w - X Y_w, for a base (X, w)."""
        return self.xyz * base.w - base.xyz * self.w


def even_weight(coefs: Array, error: Array) -> Poly:
    """Return a weight; one that is constant to rounding, as a constant."""
    middle = coefs.mean(axis=0, keepdims=True)
    spread = np.abs(coefs - middle).max(axis=(0, 1))
    if np.all(spread <= 64 * EPS * np.maximum(np.abs(middle[0, 0]), 1.0)):
        return Poly(middle, error + spread)
    return Poly(coefs, error)


Norms = Mapping[str, Array]


def largest(polys: Mapping[str, Poly], quantity: Callable[[Norms, Norms], Array]) -> float:
    """Bound a quantity that depends on the norms of polynomials: from above, and within ``RATIO`` of a value if it can.

    ``quantity`` takes bounds of all norms, from below and from above, (n,) each, and returns a bound (n,).
    """
    taken = bound = 0.0
    for halving in range(HALVINGS + 1):
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found, values = (
                quantity(*({name: pair[k] for name, pair in bounds.items()} for k in (0, 1)))
                for bounds in (
                    {name: poly.norms() for name, poly in polys.items()},
                    {name: poly.ends() for name, poly in polys.items()},
                )
            )
        found = np.where(np.isnan(found), np.inf, found)
        taken = max(taken, float(values[np.isfinite(values)].max(initial=0.0)))
        open_ = found > RATIO * taken
        if halving == HALVINGS or open_.sum() > MOST:
            open_[:] = False
        bound = max(bound, float(found[~open_].max(initial=0.0)))
        if not open_.any():
            break
        polys = {name: poly.at(open_).halves() for name, poly in polys.items()}
    return bound
