"""Translations along a line and rotations about an axis, which map some surfaces onto themselves.

Along an edge between two such surfaces everything is as at one of its points, moved.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.splines.bernstein import Array
from cqblend.surfaces.tolerances import SURFACE_TOLERANCES
from cqblend.surfaces.vectors import LocalFrame, cross_product


@dataclass(frozen=True)
class Motion:
    """Translations along a unit ``direction`` (3,), or rotations about the axis of that direction through ``centre``.

    Amounts are lengths (mm) or angles (rad).
    """

    direction: Array
    centre: Array | None = None

    def move_vector(self, vector: Array, amounts: Array) -> Array:
        """Move a vector (3,) by amounts (n,): (n, 3)."""
        if self.centre is None:
            return np.tile(vector, (len(amounts), 1))
        along = (vector @ self.direction) * self.direction
        across = vector - along
        cos, sin = np.cos(amounts)[:, None], np.sin(amounts)[:, None]
        return np.asarray(along + cos * across + sin * cross_product(self.direction, across))

    def move_point(self, point: Array, amounts: Array) -> Array:
        """Move a point (3,) by amounts (n,): (n, 3)."""
        if self.centre is None:
            return np.asarray(point + np.multiply.outer(amounts, self.direction))
        return self.centre + self.move_vector(point - self.centre, amounts)

    def is_across(self, normal: Array) -> bool:
        """Whether it moves planes with a unit normal (3,) onto themselves."""
        if self.centre is None:
            return bool(abs(self.direction @ normal) <= SURFACE_TOLERANCES.same_direction)
        return self.find_sense(normal) != 0

    def find_sense(self, axis: Array) -> float:
        """Return 1 if the direction is that of a vector (3,), -1 if it is the opposite one, else 0."""
        axis = axis / np.linalg.norm(axis)
        if np.abs(cross_product(self.direction, axis)).max() > SURFACE_TOLERANCES.same_direction:
            return 0.0
        return float(np.sign(self.direction @ axis))

    def find_turning_sense(self, frame: LocalFrame) -> float:
        """Return by which factor the angle about the Z axis of a frame grows in a rotation, 1 or -1; 0 if it is none.

        The axis must be that of the rotation, and the frame orthonormal.
        """
        if (
            self.centre is None
            or np.abs(frame.axes @ frame.axes.T - np.eye(3)).max() > SURFACE_TOLERANCES.same_direction
        ):
            return 0.0
        arm = frame.origin - self.centre
        away = np.linalg.norm(cross_product(arm, self.direction))
        size = max(np.abs(frame.origin).max(), np.abs(self.centre).max())
        if away > SURFACE_TOLERANCES.same_direction * size:
            return 0.0
        x, y, _ = frame.axes
        return self.find_sense(cross_product(x, y))
