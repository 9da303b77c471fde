"""Ellipses by their angle, in space and in a parameter plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import LocalFrame


@dataclass(frozen=True)
class Ellipse:
    """C(t) = O + A cos t X + B sin t Y in a frame of origin O and axes X, Y, Z, A at least B, by t (radians)."""

    frame: LocalFrame
    radii: tuple[float, float]  # A, B

    def __call__(self, t: Array) -> Array:
        """Return points (n, 3) at parameters (n,)."""
        return self.frame.origin + np.stack([np.cos(t), np.sin(t)], -1) * self.radii @ self.frame.axes[:2]


@dataclass(frozen=True)
class PlanarEllipse:
    """C(t) = M + A cos t X + B sin t Y in a plane, X and Y orthonormal in either sense, A at least B, t in radians."""

    centre: Array  # (2,)
    axes: Array  # (2, 2), rows X and Y
    radii: tuple[float, float]  # A, B

    @property
    def arms(self) -> Array:
        """The vectors from the centre to the points at 0 and at a quarter of a turn, (2, 2)."""
        return np.array(self.radii)[:, None] * self.axes

    def __call__(self, t: Array) -> Array:
        """Return points (n, 2) at parameters (n,)."""
        return self.centre + np.stack([np.cos(t), np.sin(t)], -1) * self.radii @ self.axes
