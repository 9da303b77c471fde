"""A parametric surface that is reshaped together with an implicit one: points, equations and their continuation.

A point has two unknowns q = (u, v) on the parametric surface, and the equation f(S(u, v; s1)) = s2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.potential.continuation import IntersectionCurves, LinearisedSystem
from cqblend.blends.potential.family_pair import FamilyPair
from cqblend.blends.potential.implicit_surface import ImplicitSurface, check_gradient, evaluate_implicit
from cqblend.blends.potential.relations import Relation
from cqblend.blends.potential.surface_family import Family
from cqblend.blends.potential.tolerances import POTENTIAL_LIMITS, POTENTIAL_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, normalise_vectors


@dataclass(frozen=True)
class ImplicitPair(FamilyPair):
    """A family of surfaces, and the implicit surface that it meets.

    ``steepness`` is the length of the gradient of f, about: residuals of f are divided by it, which makes them mm.
    """

    implicit: ImplicitSurface
    steepness: float

    @staticmethod
    def from_family(family: Family, implicit: ImplicitSurface, relation: Relation) -> ImplicitPair:
        """Prepare a family, as surface 1, and an implicit surface, after a check of its gradient.

        Raises
        ------
        InputError
            If the gradient is wrong, or zero all over the family's surface, or as :meth:`Family.course`.
        """
        s, size = relation.eased, family.size()
        u, v = (np.linspace(*domain, POTENTIAL_LIMITS.gradient_samples) for domain in family.surface.domain)
        points = family.surface.grid(u, v).reshape(-1, 3)
        check_gradient(implicit, points, size)
        steepness = float(np.median(np.linalg.norm(evaluate_implicit(implicit, points)[1], axis=1)))
        if not steepness > 0:
            raise GeometryError("the gradient of the implicit surface is 0 on the surface that it is blended with")
        return ImplicitPair((family,), s, (family.course(s[0], "1"),), family.bounds(), size, implicit, steepness)

    def evaluate_jets(self, q: Array, x: Array) -> tuple[Array, ...]:
        """Return S, Su, Sv, Sx, (4, n, 3), of the parametric surface at parameters (n, 2) and x (n,)."""
        return (self.families[0].jet(q, self.courses[0](x)),)

    def evaluate_level(self, points: Array, x: Array) -> tuple[Array, Array, Array]:
        """Return how far f is from s2 (n,), in mm about, its gradient (n, 3), and its derivative by x (n,)."""
        value, gradient = evaluate_implicit(self.implicit, points)
        level, rate = self.s[1].jet(x, 1)[..., 0]
        return (value - level) / self.steepness, gradient / self.steepness, -rate / self.steepness


@dataclass(frozen=True)
class ImplicitCurves(IntersectionCurves[ImplicitPair]):
    """The curves in which a reshaped surface meets level sets of an implicit one."""

    def linearise_system(self, q: Array, t: Array, x: Array) -> LinearisedSystem:
        """Return the two equations and their derivatives at parameters (n, 2), t (n,) and x (n,)."""
        jets = self.pair.evaluate_jets(q, x)
        value, gradient, level_rate = self.pair.evaluate_level(jets[0][0], x)
        slopes = (jets[0][1:] * gradient).sum(axis=2)  # by u, v and x
        cut_residual, cut_gradient, cut_rate = self.cut_condition(t, q, jets)
        return LinearisedSystem(
            np.stack([slopes[:2].T, cut_gradient], axis=1),
            np.stack([value, cut_residual], axis=1),
            np.stack([slopes[2] + level_rate, cut_rate], axis=1),
            jets,
        )

    def check_regularity(self, q: Array, x: Array) -> None:
        """Raise GeometryError where both surfaces touch, or the reshaped one is folded, at (n, 2) and x (n,)."""
        self.check_folds(q, x)
        (jet,) = self.pair.evaluate_jets(q, x)
        normals = normalise_vectors(cross_product(jet[1], jet[2]))
        gradient = self.pair.evaluate_level(jet[0], x)[1]
        sine = np.linalg.norm(cross_product(normals, normalise_vectors(gradient)), axis=1)
        if sine.min() < POTENTIAL_TOLERANCES.touching_sine:
            i = int(sine.argmin())
            raise GeometryError(
                f"the reshaped surface touches a level set at an angle of {sine[i]:.2g} rad, at "
                f"{self.pair.describe_place(q, x, i)}: choose other a and b"
            )
