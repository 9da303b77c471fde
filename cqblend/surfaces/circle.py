"""A circle in space, by its angle."""

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

    def __call__(self, t: Array) -> Array:
        """Return points (n, 3) at angles (n,)."""
        x, y, _ = self.frame.axes
        return self.frame.origin + self.radius * (np.cos(t)[:, None] * x + np.sin(t)[:, None] * y)
