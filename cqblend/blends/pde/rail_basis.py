"""Bases along the rails, functions g_j(w), in which the boundary data and the interior of a PDE blend are expanded.

Waves on closed rails; on open ones splines or polynomials, whose outermost coefficients can be prescribed. Depends on
splines only.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cqblend.blends.pde.tolerances import PDE_LIMITS
from cqblend.splines import Curve
from cqblend.splines.antiderivative import gauss_rule
from cqblend.splines.bernstein import Array

LEAST_SPLINE_DEGREE = 5  # of splines along: with simple knots they are C4


class Basis(ABC):
    """Functions g_j on the interval ``domain``."""

    domain: tuple[float, float]

    @property
    @abstractmethod
    def count(self) -> int:
        """Number of functions."""

    @property
    def knots(self) -> Array:
        """Inner parameters at which they are not smooth."""
        return np.empty(0)

    @property
    def spans_apart(self) -> int:
        """Number of stretches of equal length that have functions of their own: ``span_width`` each from its number on.

        1 where every function reaches over the whole domain.
        """
        return 1

    @property
    def span_width(self) -> int:
        """Number of functions that are not zero on each of these."""
        return self.count

    @abstractmethod
    def refined(self) -> Basis:
        """Return a basis of about twice as many functions."""

    @abstractmethod
    def choose_gauss_points(self, count: int | None = None) -> tuple[Array, Array]:
        """Return nodes and weights of a quadrature, as many as the products of functions take, or ``count``."""

    @abstractmethod
    def __call__(self, w: Array, k: int = 0) -> Array:
        """Return their k-th derivatives at w (n,): (n, count)."""

    def fit_coefficients(self, w: Array, weights: Array, values: Array) -> Array:
        """Return the coefficients (count, dim) of the least-squares fit to values (n, dim) with weights (n,)."""
        root = np.sqrt(weights)[:, None]
        q, r = np.linalg.qr(self(w) * root)
        return np.asarray(np.linalg.solve(r, q.T @ (values * root)))


@dataclass(frozen=True)
class Waves(Basis):
    """1, cos w, sin w, .., cos J w, sin J w on a domain of length 2 pi, scaled to other domains; J is ``modes``."""

    domain: tuple[float, float]
    modes: int

    @property
    def count(self) -> int:
        return 2 * self.modes + 1

    @property
    def frequencies(self) -> Array:
        """Frequencies of the functions, (count,): 0, 1, 1, .., J, J times 2 pi over the length of the domain."""
        return ((np.arange(self.count) + 1) // 2) * (2 * np.pi / (self.domain[1] - self.domain[0]))

    def __call__(self, w: Array, k: int = 0) -> Array:
        omega = self.frequencies
        phase = np.where(np.arange(self.count) % 2, 0.0, -np.pi / 2)  # cos(x - pi/2) = sin x
        phase[0] = 0.0
        if k == 0:
            return np.cos(np.multiply.outer(w - self.domain[0], omega) + phase)
        return omega**k * np.cos(np.multiply.outer(w - self.domain[0], omega) + phase + k * np.pi / 2)

    def choose_gauss_points(self, count: int | None = None) -> tuple[Array, Array]:
        """Return equidistant nodes, which are Gauss's of waves."""
        n = PDE_LIMITS.points_per_wave * self.count if count is None else count
        low, high = self.domain
        return low + (high - low) * np.arange(n) / n, np.full(n, (high - low) / n)

    def refined(self) -> Waves:
        return self.with_modes(max(2 * self.modes, PDE_LIMITS.fewest_modes))

    def with_modes(self, modes: int) -> Waves:
        """Return the basis of the first ``modes`` waves."""
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

    @property
    def spans_apart(self) -> int:
        return 1 if self.closed else self.spans

    @property
    def span_width(self) -> int:
        return self.count if self.closed else self.degree + 1

    def refined(self) -> Splines:
        return replace(self, spans=2 * self.spans)

    @cached_property
    def _basis_functions(self) -> Curve:
        p, (a, b) = self.degree, self.domain
        inner = np.linspace(a, b, self.spans + 1)
        if not self.closed:
            knots = np.concatenate([np.full(p, a), inner, np.full(p, b)])
            return Curve.from_bspline(p, knots, np.eye(self.spans + p))
        step = (b - a) / self.spans
        before, after = a - step * np.arange(p, 0, -1), b + step * np.arange(1, p + 1)
        # a function that reaches past one end of the domain is continued at the other
        poles = np.eye(self.spans)[np.arange(self.spans + p) % self.spans]
        return Curve.from_bspline(p, np.concatenate([before, inner, after]), poles)

    def __call__(self, w: Array, k: int = 0) -> Array:
        return self._basis_functions(w, k)

    def choose_gauss_points(self, count: int | None = None) -> tuple[Array, Array]:
        """Return Gauss's nodes and weights: of each span, or ``count`` on the whole domain."""
        a, b = self.domain
        pieces = self.spans if count is None else 1
        nodes, weights = gauss_rule(
            max(PDE_LIMITS.span_gauss_points, (2 * self.degree) // pieces + 2) if count is None else count
        )
        step = (b - a) / pieces
        starts = a + step * np.arange(pieces)
        return (starts[:, None] + step * nodes).ravel(), np.tile(step * weights, pieces)

    def build_end_matrices(self, orders: int) -> Array:
        """Return matrices (2, orders, orders): from derivatives 0, 1, .. at an end to the outermost coefficients."""
        ends = np.array(self.domain)
        values = np.stack([self(ends, k) for k in range(orders)])  # (orders, 2, count)
        first, last = values[:, 0, :orders], values[:, 1, self.count - orders :]
        return np.stack([np.linalg.inv(first), np.linalg.inv(last)])
