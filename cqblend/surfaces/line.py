"""Straight lines in space, by their length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class Line:
    """C(t) = O + t D with a unit direction D, by the length t (mm)."""

    origin: Array  # (3,)
    direction: Array  # (3,)

    def __call__(self, t: Array, order: int = 0) -> Array:
        """Return points, or derivatives of an order, (n, 3) at lengths (n,)."""
        if order > 0:
            return np.tile(self.direction if order == 1 else np.zeros(3), (len(t), 1))
        return self.origin + np.multiply.outer(t, self.direction)
