"""Circles by their angle, in space and in a parameter plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import LocalFrame


@dataclass(frozen=True)
class Circle:
    """C(t) = O + R (cos t X + sin t Y) in a frame of origin O and axes X, Y, Z, by the angle t (radians)."""

    frame: LocalFrame
    radius: float

    def __call__(self, t: Array, order: int = 0) -> Array:
        """Return points, or derivatives of an order, (n, 3) at angles (n,)."""
        (x, y, _), turned = self.frame.axes, np.asarray(t) + order * np.pi / 2
        arms = self.radius * (np.cos(turned)[:, None] * x + np.sin(turned)[:, None] * y)
        return arms if order else self.frame.origin + arms


@dataclass(frozen=True)
class PlanarCircle:
    """C(t) = M + R (cos t X + sin t Y) in a plane, X and Y orthonormal in either sense, by the angle t (radians)."""

    centre: Array  # (2,)
    axes: Array  # (2, 2), rows X and Y
    radius: float

    @property
    def arms(self) -> Array:
        """The vectors from the centre to the points at 0 and at a quarter of a turn, (2, 2)."""
        return self.radius * self.axes

    def __call__(self, t: Array) -> Array:
        """Return points (n, 2) at angles (n,)."""
        return self.centre + self.radius * (np.cos(t)[:, None] * self.axes[0] + np.sin(t)[:, None] * self.axes[1])
