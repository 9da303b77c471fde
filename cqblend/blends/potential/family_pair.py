"""Two surfaces that are reshaped together along a relation: their points and derivatives at any parameters and any x.

Parameters of a pair are q = (u1, v1, u2, v2), on both surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.potential.relations import Relation
from cqblend.blends.potential.surface_family import Course, Family
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary


@dataclass(frozen=True)
class FamilyPair:
    """Two surfaces, reshaped together.

    Attributes
    ----------
    families : tuple of Family
        Surface 1 and surface 2.
    s : Curve
        (s1, s2) at x in [0, 1], those of :attr:`Relation.eased`.
    courses : tuple of Course
        The amounts of both surfaces at x.
    bounds : array of shape (4, 2)
        Domains of u1, v1, u2, v2; infinite where a surface goes on periodically.
    scale : float
        Size of the surfaces, mm, that residuals and steps are relative to.
    """

    families: tuple[Family, ...]
    s: Curve
    courses: tuple[Course, ...]
    bounds: Array
    scale: float

    @staticmethod
    def from_relation(families: tuple[Family, Family], relation: Relation) -> FamilyPair:
        """Prepare two families, that of surface 1 first."""
        first, second = families
        s = relation.eased
        courses = first.course(s[0], "1"), second.course(s[1], "2")
        bounds = np.concatenate([family.bounds() for family in families])
        return FamilyPair(families, s, courses, bounds, min(family.size() for family in families))

    def evaluate_jets(self, q: Array, x: Array) -> tuple[Array, ...]:
        """Return S, Su, Sv, Sx, (4, n, 3), of both surfaces at parameters (n, 4) and x (n,)."""
        (first, second), (first_course, second_course) = self.families, self.courses
        return first.jet(q[:, :2], first_course(x)), second.jet(q[:, 2:], second_course(x))

    @property
    def primaries(self) -> tuple[Primary, ...]:
        """The surfaces as they are before they are reshaped."""
        return tuple(family.primary for family in self.families)

    def describe_place(self, q: Array, x: Array, row: int) -> str:
        """Describe one of n places q (n, 4) at x (n,) for messages: s of both surfaces, and the coordinates."""
        return describe_offsets(self.s(x[row]), self.evaluate_jets(q[row, None], x[row, None])[0][0, 0])

    def measure_outside(self, q: Array) -> Array:
        """Return how far (n, 4) parameters are outside of the domains, as a share of these; 0 inside."""
        width = np.where(np.isfinite(self.bounds[:, 1]), self.bounds[:, 1] - self.bounds[:, 0], 1.0)
        return np.asarray(np.maximum(np.maximum(self.bounds[:, 0] - q, q - self.bounds[:, 1]) / width, 0.0))


def format_point(point: Array) -> str:
    """Return the coordinates of a point as messages write them."""
    return "(" + ", ".join(f"{x:.5g}" for x in point) + ")"


def describe_offsets(s: Array, point: Array) -> str:
    """Return how far both surfaces are reshaped, and the coordinates of a point, as messages write them."""
    return f"s = ({s[0]:.4g}, {s[1]:.4g}), at {format_point(point)}"
