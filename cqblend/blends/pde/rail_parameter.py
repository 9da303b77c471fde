"""The parameter w along a blend in which its equations are written: the length of its rails, or their own parameter t.

The length is that of root mean square speed of both rails. With it, solutions do not depend on how the rails are
parametrised. Depends on curves only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.pde.tolerances import PDE_LIMITS
from cqblend.blends.rails.ribbon import dehomogenise_jets
from cqblend.splines import Curve
from cqblend.splines.antiderivative import Antiderivative
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class LengthParameter:
    """The map from t to w: length of a pair of rails from their start, scaled to end at ``end``; w = t if that is None.

    ``lengths`` is the integral of :func:`evaluate_mean_speed`.
    """

    rails: tuple[Curve, Curve]
    lengths: Antiderivative
    end: float | None

    def __call__(self, t: Array) -> Array:
        """Return w (n,) from t."""
        return t if self.end is None else np.asarray(self.lengths(t) * self._length_factor)

    def invert_parameter(self, w: Array) -> Array:
        """Return t (n,) from w (n,)."""
        if self.end is None:
            return w
        a, b = self.rails[0].domain
        t = np.linspace(a, b, 1025)
        t = np.interp(w, self(t), t)
        for _ in range(4):
            t = np.clip(t - (self(t) - w) / self.evaluate_rate(t), a, b)
        return np.asarray(t)

    def find_kinks(self) -> tuple[Array, Array]:
        """Return the t at which w is less than C5, and the continuity there; the start of the rails counts as C1."""
        if self.end is None:
            return np.empty(0), np.empty(0, int)
        t = np.concatenate([[self.rails[0].domain[0]], *(rail.breaks[1:-1] for rail in self.rails)])
        orders = np.concatenate([[1], *(rail.continuity for rail in self.rails)])
        kinked = orders <= PDE_LIMITS.smooth_continuity
        return t[kinked], orders[kinked]

    def evaluate_rate(self, t: Array) -> Array:
        """Return dw/dt."""
        return np.ones_like(t) if self.end is None else evaluate_mean_speed(self.rails, t) * self._length_factor

    @property
    def _length_factor(self) -> float:
        return (self.end or 0.0) / float(self.lengths.values[-1])


def evaluate_mean_speed(rails: tuple[Curve, Curve], t: Array) -> Array:
    """Return the root mean square (n,) of both rails' speeds at t (n,)."""
    velocities = [dehomogenise_jets(rail.jet(t, 1))[1] for rail in rails]
    return np.asarray(np.sqrt(sum((velocity**2).sum(axis=1) for velocity in velocities) / 2))
