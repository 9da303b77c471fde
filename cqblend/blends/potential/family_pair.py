"""Two families that are reshaped together: where their surfaces are, at any parameters and any x of a relation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.potential.relations import Relation
from cqblend.blends.potential.surface_family import Course, Family
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array

DOMAIN_TOLERANCE = 1e-9  # of a domain, by which a point may be outside


@dataclass(frozen=True)
class FamilyPair:
    """Two families, reshaped together.

    ``s`` are the (s1, s2) at x in [0, 1], eased, ``courses`` what the families are there.
    """

    families: tuple[Family, Family]
    s: Curve
    courses: tuple[Course, Course]
    bounds: Array  # (4, 2) of u1, v1, u2, v2; infinite where a surface goes on periodically
    scale: float  # of the surfaces in space, mm

    @classmethod
    def from_relation(cls, families: tuple[Family, Family], relation: Relation) -> FamilyPair:
        """Prepare two families, that of surface 1 first."""
        first, second = families
        s = relation.eased
        courses = first.course(s[0], "1"), second.course(s[1], "2")
        bounds = np.concatenate([family.bounds() for family in families])
        return cls(families, s, courses, bounds, min(family.size() for family in families))

    def evaluate_jets(self, q: Array, x: Array) -> tuple[Array, Array]:
        """Return S, Su, Sv, Sx, (4, n, 3), of both surfaces at parameters (n, 4) and x (n,)."""
        (first, second), (one, two) = self.families, self.courses
        return first.jet(q[:, :2], one(x)), second.jet(q[:, 2:], two(x))

    def describe_place(self, q: Array, x: float) -> str:
        """Say where a point is: s on both surfaces, and its coordinates."""
        s1, s2 = self.s(x)
        at = self.evaluate_jets(q[None], np.array([x]))[0][0, 0]
        return f"s = ({s1:.4g}, {s2:.4g}), at " + format_point(at)

    def measure_outside(self, q: Array) -> Array:
        """Return how far (n, 4) parameters are out of the surfaces, in shares of their domains; 0 inside."""
        width = np.where(np.isfinite(self.bounds[:, 1]), self.bounds[:, 1] - self.bounds[:, 0], 1.0)
        return np.asarray(np.maximum(np.maximum(self.bounds[:, 0] - q, q - self.bounds[:, 1]) / width, 0.0))


def format_point(at: Array) -> str:
    """Write a point as messages do."""
    return "(" + ", ".join(f"{x:.5g}" for x in at) + ")"
