"""The intersection curves of two reshaped surfaces, one for every x of a relation, by continuation in x.

A point of a curve has four unknowns q = (u1, v1, u2, v2) and three equations, S1(u1, v1) = S2(u2, v2). The fourth is a
*cut condition*, which selects the point of station t on every curve: a plane, or a fixed value of one parameter. Newton
solves all stations at once; each step in x is predicted from the derivative.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol

import numpy as np

from cqblend.blends.contacts.contact_solver import solve_damped_newton
from cqblend.blends.potential.family_pair import FamilyPair, Reshaped
from cqblend.blends.potential.tolerances import POTENTIAL_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, normalise_vectors


class CutCondition(Protocol):
    """The equation that selects the point of station t: a residual (n,), mm, and its derivatives by q and by x."""

    def __call__(self, t: Array, q: Array, jets: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """Return residual (n,), gradient (n, 4), and derivative by x (n,)."""
        ...


@dataclass(frozen=True)
class PlaneCut:
    """A plane for each t: ``planes_at`` returns points and normals, (n, 3) each."""

    planes_at: Callable[[Array], tuple[Array, Array]]

    def __call__(self, t: Array, q: Array, jets: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """Return the distance of the points on surface 1 from the planes."""
        del q
        point, normal = self.planes_at(t)
        first = jets[0]
        gradient = np.zeros((len(t), 4))
        gradient[:, 0], gradient[:, 1] = (first[1] * normal).sum(axis=1), (first[2] * normal).sum(axis=1)
        return ((first[0] - point) * normal).sum(axis=1), gradient, (first[3] * normal).sum(axis=1)


@dataclass(frozen=True)
class IsoparametricCut:
    """A value of one of the four parameters for each t, linear from ``first`` to ``last`` for t in [0, 1].

    ``axis`` 0 to 3 is u1, v1, u2 or v2, ``length_per_unit`` about the length (mm) of a unit of the parameter.
    """

    axis: int
    first: float
    last: float
    length_per_unit: float

    def parameter_at(self, t: Array) -> Array:
        """Return the parameter at t (n,)."""
        return self.first + t * (self.last - self.first)

    def __call__(self, t: Array, q: Array, jets: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """Return the difference of the parameter from its value, times ``length_per_unit``."""
        del jets
        gradient = np.zeros((len(t), 4))
        gradient[:, self.axis] = self.length_per_unit
        return (q[:, self.axis] - self.parameter_at(t)) * self.length_per_unit, gradient, np.zeros(len(t))


@dataclass(frozen=True)
class IntersectionCurves(Generic[Reshaped]):
    """The intersection curves of a pair of reshaped surfaces with a cut condition: equations and continuation."""

    family_pair: FamilyPair[Reshaped]
    cut_condition: CutCondition

    def _evaluate_system(self, q: Array, t: Array, x: Array) -> tuple[Array, Array, Array, tuple[Array, Array]]:
        """Return matrix (n, 4, 4), residual (n, 4), its derivative by x, and the jets."""
        jets = self.family_pair.evaluate_jets(q, x)
        first, second = jets
        cut_residual, gradient, cut_rate = self.cut_condition(t, q, jets)
        matrix = np.empty((len(q), 4, 4))
        matrix[:, :3] = np.stack([first[1], first[2], -second[1], -second[2]], axis=-1)
        matrix[:, 3] = gradient
        residual = np.concatenate([first[0] - second[0], cut_residual[:, None]], axis=1)
        return matrix, residual, np.concatenate([first[3] - second[3], cut_rate[:, None]], axis=1), jets

    def correct_solutions(
        self, start: Array, t: Array, x: Array, longest_step: float | None = None
    ) -> tuple[Array, Array]:
        """Return solutions q (n, 4) next to a start, and which of them have converged (n,).

        Steps are at most ``longest_step`` (mm) long.
        """

        def evaluate_newton_system(q: Array) -> tuple[Array, Array, Array]:
            matrix, residual, _, jets = self._evaluate_system(q, t, x)
            return residual, matrix, np.concatenate([np.linalg.norm(jet[1:3], axis=2).T for jet in jets], axis=1)

        scale = self.family_pair.scale
        if longest_step is None:
            longest_step = POTENTIAL_TOLERANCES.longest_correction * scale
        return solve_damped_newton(evaluate_newton_system, start, scale, longest_step)

    def differentiate_solutions(self, q: Array, t: Array, x: Array) -> tuple[Array, tuple[Array, Array]]:
        """Return the derivative (n, 4) of the parameters by x, and the jets."""
        matrix, _, residual_rate, jets = self._evaluate_system(q, t, x)
        try:
            return np.linalg.solve(matrix, -residual_rate[..., None])[..., 0], jets
        except np.linalg.LinAlgError:
            raise self.make_lost_error(q[0], float(x[0])) from None

    def evaluate_cross_derivatives(self, q: Array, t: Array, x: Array, side: int) -> Array:
        """Return the derivatives (n, 3) of the points by x within the surface of side 0 or 1, held as it is at x."""
        rates, jets = self.differentiate_solutions(q, t, x)
        uv_rates = rates[:, 2 * side : 2 * side + 2]
        return np.asarray(uv_rates[:, :1] * jets[side][1] + uv_rates[:, 1:] * jets[side][2])

    def make_lost_error(self, q: Array, x: float) -> GeometryError:
        """Return the error that says where an intersection is lost."""
        return GeometryError(
            f"the intersection of the reshaped surfaces is lost near {self.family_pair.describe_place(q, x)}: there, "
            "they part, touch, or one is singular (a pole); choose smaller a and b, or another reference"
        )

    def continue_solutions(self, start: Array, t: Array, x0: float, x_values: Array) -> Array:
        """Continue solutions (k, 4) at x0 to other values ``x_values`` (n,) of x, ascending: (k, n, 4).

        Raises
        ------
        GeometryError
            Where they are lost, where the surfaces touch, or one is folded; the message names s and the place.
        """
        q0, converged = self.correct_solutions(start, t, np.full(len(t), x0))
        if not converged.all():
            raise self.make_lost_error(start[~converged][0], x0)
        table = np.empty((len(t), len(x_values), 4))
        indices = np.arange(len(x_values))
        for order in (indices[x_values >= x0], indices[x_values < x0][::-1]):
            q, x = q0, x0
            for j in order.tolist():
                q, x = self._continue_to(q, t, x, float(x_values[j])), float(x_values[j])
                table[:, j] = q
        self._check_regularity(table, x_values)
        return table

    def _continue_to(self, q: Array, t: Array, x: float, target: float) -> Array:
        """Continue solutions from x to a target, in steps that are halved while Newton's corrections are large."""
        step = target - x
        negligible = POTENTIAL_TOLERANCES.negligible_correction * self.family_pair.scale
        while x != target:
            rates, _ = self.differentiate_solutions(q, t, np.full(len(q), x))
            guess, next_x = q + step * rates, np.full(len(q), x + step)
            solution, accepted = self.correct_solutions(guess, t, next_x)
            if accepted.all():
                jets = self.family_pair.evaluate_jets(solution, next_x)
                moved, corrected = (_estimate_displacement(solution - other, jets) for other in (q, guess))
                accepted = corrected <= np.maximum(POTENTIAL_TOLERANCES.correction * moved, negligible)
            if not accepted.all():
                step /= 2
                if abs(step) < POTENTIAL_TOLERANCES.shortest_x_step:
                    raise self.make_lost_error(q[~accepted][0], x)
                continue
            q, x = solution, x + step
            if abs(target - x) < POTENTIAL_TOLERANCES.shortest_x_step / 2:
                x = target
            step = float(np.clip(2 * step, -abs(target - x), abs(target - x)))
        return q

    def _check_regularity(self, table: Array, x_values: Array) -> None:
        """Raise GeometryError where the surfaces touch, or a reshaped one is folded."""
        q, x = table.reshape(-1, 4), np.tile(x_values, len(table))
        jets = self.family_pair.evaluate_jets(q, x)
        normals = [cross_product(jet[1], jet[2]) for jet in jets]
        for number, (family, jet, normal) in enumerate(zip(self.family_pair.families, jets, normals, strict=True), 1):
            original = family.primary.jet(q[:, 2 * number - 2 : 2 * number])
            same_side = (normal * cross_product(original[1], original[2])).sum(axis=1)
            reversed_both = ((jet[1] * original[1]).sum(axis=1) < 0) & ((jet[2] * original[2]).sum(axis=1) < 0)
            folded = (same_side <= 0) | reversed_both
            if folded.any():
                i = int(folded.argmax())
                raise GeometryError(
                    f"surface {number} is reshaped so far that it turns over on itself, at "
                    f"{self.family_pair.describe_place(q[i], float(x[i]))}: choose a smaller {'ab'[number - 1]}, or "
                    "smaller amounts"
                )
        sine = np.linalg.norm(cross_product(normalise_vectors(normals[0]), normalise_vectors(normals[1])), axis=1)
        if sine.min() < POTENTIAL_TOLERANCES.touching_sine:
            i = int(sine.argmin())
            raise GeometryError(
                f"the reshaped surfaces touch at an angle of {sine[i]:.2g} rad, at "
                f"{self.family_pair.describe_place(q[i], float(x[i]))}: choose other a and b"
            )


def _estimate_displacement(change: Array, jets: tuple[Array, Array]) -> Array:
    """Return how far (n,) a change of parameters moves the points on the surfaces, to first order (mm)."""
    steps = [change[:, 2 * i, None] * jet[1] + change[:, 2 * i + 1, None] * jet[2] for i, jet in enumerate(jets)]
    return np.asarray(np.linalg.norm(np.stack(steps), axis=2).max(axis=0))
