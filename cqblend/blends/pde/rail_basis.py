"""Functions along a blend, g_j(w): what its boundary data are made of, and its interior with them.

Waves on closed rails; on open ones splines or polynomials, whose ends can be held. Knows no equations.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.integral import gauss_rule

LEAST_SPLINE_DEGREE = 5  # least degree of splines: what they fill is C4
LEAST_GAUSS_POINTS = 4  # points of a span, where an equation is to hold


class Basis(ABC):
    """Functions g_j on the interval ``domain``."""

    domain: tuple[float, float]

    @property
    @abstractmethod
    def count(self) -> int:
        """How many they are."""

    @property
    def knots(self) -> Array:
        """Where they are not smooth, inside the domain."""
        return np.empty(0)

    @abstractmethod
    def __call__(self, w: Array, k: int = 0) -> Array:
        """Return their k-th derivatives at w (n,): (n, count)."""

    def fit_coefficients(self, w: Array, weights: Array, values: Array) -> Array:
        """Return the coefficients (count, dim) closest to values (n, dim), in the mean with weights (n,)."""
        root = np.sqrt(weights)[:, None]
        q, r = np.linalg.qr(self(w) * root)
        return np.asarray(np.linalg.solve(r, q.T @ (values * root)))


@dataclass(frozen=True)
class Waves(Basis):
    """1, cos w, sin w, .., cos J w, sin J w, for a domain of length 2 pi; others are scaled."""

    domain: tuple[float, float]
    modes: int

    @property
    def count(self) -> int:
        return 2 * self.modes + 1

    @property
    def frequencies(self) -> Array:
        """Those of the functions, (count,): 0, 1, 1, .., J, J times 2 pi over the length of the domain."""
        return ((np.arange(self.count) + 1) // 2) * (2 * np.pi / (self.domain[1] - self.domain[0]))

    def __call__(self, w: Array, k: int = 0) -> Array:
        omega = self.frequencies
        phase = np.where(np.arange(self.count) % 2, 0.0, -np.pi / 2)  # cos(x - pi/2) = sin x
        phase[0] = 0.0
        if k == 0:
            return np.cos(np.multiply.outer(w - self.domain[0], omega) + phase)
        return omega**k * np.cos(np.multiply.outer(w - self.domain[0], omega) + phase + k * np.pi / 2)

    def with_modes(self, modes: int) -> Waves:
        """Return the first of them."""
        return Waves(self.domain, modes)


@dataclass(frozen=True)
class Splines(Basis):
    """B-splines with simple knots on equal spans, one span for polynomials; periodic if ``closed``."""

    domain: tuple[float, float]
    degree: int
    spans: int
    closed: bool = False

    @property
    def count(self) -> int:
        return self.spans if self.closed else self.spans + self.degree

    @property
    def knots(self) -> Array:
        return np.linspace(*self.domain, self.spans + 1)[1:-1]

    @cached_property
    def _basis_functions(self) -> Curve:
        p, (a, b) = self.degree, self.domain
        inner = np.linspace(a, b, self.spans + 1)
        if not self.closed:
            knots = np.concatenate([np.full(p, a), inner, np.full(p, b)])
            return Curve.from_bspline(p, knots, np.eye(self.spans + p))
        step = (b - a) / self.spans
        before, after = a - step * np.arange(p, 0, -1), b + step * np.arange(1, p + 1)
        # the functions that leave at one end come back at the other
        poles = np.eye(self.spans)[np.arange(self.spans + p) % self.spans]
        return Curve.from_bspline(p, np.concatenate([before, inner, after]), poles)

    def __call__(self, w: Array, k: int = 0) -> Array:
        return self._basis_functions(w, k)

    def choose_gauss_points(self, count: int | None = None) -> tuple[Array, Array]:
        """Return Gauss's nodes and weights: some for every span, or ``count`` on the whole."""
        a, b = self.domain
        pieces = self.spans if count is None else 1
        nodes, weights = gauss_rule(
            max(LEAST_GAUSS_POINTS, (2 * self.degree) // pieces + 2) if count is None else count
        )
        step = (b - a) / pieces
        starts = a + step * np.arange(pieces)
        return (starts[:, None] + step * nodes).ravel(), np.tile(step * weights, pieces)

    def build_end_matrices(self, orders: int) -> Array:
        """Return the matrix (2, orders, orders) from derivatives 0 .. at both ends to the outermost coefficients."""
        ends = np.array(self.domain)
        values = np.stack([self(ends, k) for k in range(orders)])  # (orders, 2, count)
        first, last = values[:, 0, :orders], values[:, 1, self.count - orders :]
        return np.stack([np.linalg.inv(first), np.linalg.inv(last)])
