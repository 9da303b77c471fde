"""The parameter along a blend that its equations know: the length of its rails, or their own parameter.

Solutions in terms of length do not depend on how rails happen to be parametrised. Knows curves, and no equations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.rails.ribbon import dehomogenise_jets
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.integral import Antiderivative

SMOOTH_ORDER = 4  # continuity from which on a function counts as smooth


@dataclass(frozen=True)
class LengthParameter:
    """From t to w: the length of a pair of curves from their start, scaled to end at ``end``; t itself without one."""

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
        """Return the t at which w is less than C5, and its continuity there; the start of closed rails is one."""
        if self.end is None:
            return np.empty(0), np.empty(0, int)
        found = [(rail.breaks[1:-1], rail.continuity) for rail in self.rails]
        t = np.concatenate([[self.rails[0].domain[0]], *(one for one, _ in found)])
        orders = np.concatenate([[1], *(one for _, one in found)])
        return t[orders <= SMOOTH_ORDER], orders[orders <= SMOOTH_ORDER]

    def evaluate_rate(self, t: Array) -> Array:
        """Return dw/dt."""
        return np.ones_like(t) if self.end is None else evaluate_mean_speed(self.rails, t) * self._length_factor

    @property
    def _length_factor(self) -> float:
        return (self.end or 0.0) / float(self.lengths.values[-1])


def evaluate_mean_speed(rails: tuple[Curve, Curve], t: Array) -> Array:
    """Return the root mean square of both rails' speeds."""
    rates = [dehomogenise_jets(rail.jet(t, 1))[1] for rail in rails]
    return np.asarray(np.sqrt(sum((rate**2).sum(axis=1) for rate in rates) / 2))
