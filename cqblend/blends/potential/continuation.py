"""The intersection curves of two reshaped surfaces, one for every x of a relation, by continuation in x.

A point of a curve has four unknowns q = (u1, v1, u2, v2) and three equations, S1(u1, v1) = S2(u2, v2). The fourth is a
*cut condition*, which selects the point of station t on every curve: a plane, or a fixed value of one parameter. Newton
solves all stations at once; each step in x is predicted from the derivative.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, NamedTuple, Protocol, TypeVar

import numpy as np

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.potential.tolerances import POTENTIAL_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import cross_product, normalise_vectors


class ReshapedPair(Protocol):
    """Two surfaces that are reshaped together, as x goes from 0 to 1.

    Parameters of a pair are q = (u1, v1, u2, v2), on both surfaces. ``scale`` (mm) is what residuals and steps are
    relative to.
    """

    @property
    def primaries(self) -> tuple[Primary, ...]:
        """The surfaces as they are before they are reshaped."""
        ...

    @property
    def scale(self) -> float:
        """Size of the surfaces, or of what happens on them (mm)."""
        ...

    def evaluate_jets(self, q: Array, x: Array) -> tuple[Array, ...]:
        """Return S, Su, Sv, Sx, (4, n, 3), of both surfaces at parameters (n, 4) and x (n,)."""
        ...

    def describe_place(self, q: Array, x: Array, row: int) -> str:
        """Describe one of n places q (n, 4) at x (n,) for messages: how far both are reshaped, and the point."""
        ...


Pair = TypeVar("Pair", bound=ReshapedPair, covariant=True)


class CutCondition(Protocol):
    """The equation that selects the point of station t: a residual (n,), mm, and its derivatives by q and by x."""

    def __call__(self, t: Array, q: Array, jets: tuple[Array, ...]) -> tuple[Array, Array, Array]:
        """Return residual (n,), gradient (n, 4), and derivative by x (n,)."""
        ...


@dataclass(frozen=True)
class PlaneCut:
    """A plane for each t: ``planes_at`` returns points and normals, (n, 3) each."""

    planes_at: Callable[[Array], tuple[Array, Array]]

    def __call__(self, t: Array, q: Array, jets: tuple[Array, ...]) -> tuple[Array, Array, Array]:
        """Return the distance of the points on surface 1 from the planes."""
        point, normal = self.planes_at(t)
        first = jets[0]
        gradient = np.zeros_like(q)
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

    def __call__(self, t: Array, q: Array, jets: tuple[Array, ...]) -> tuple[Array, Array, Array]:
        """Return the difference of the parameter from its value, times ``length_per_unit``."""
        del jets
        gradient = np.zeros_like(q)
        gradient[:, self.axis] = self.length_per_unit
        return (q[:, self.axis] - self.parameter_at(t)) * self.length_per_unit, gradient, np.zeros(len(t))


class LinearisedSystem(NamedTuple):
    """The four equations at n places, and what they were computed from.

    ``matrix`` (n, 4, 4) is the derivative of the ``residual`` (n, 4) by q, ``rate`` (n, 4) that by x; ``jets`` are
    those of both surfaces.
    """

    matrix: Array
    residual: Array
    rate: Array
    jets: tuple[Array, ...]

    def differentiate_solutions(self) -> Array | None:
        """Return the derivative (n, 4) of the parameters by x, None where a matrix is singular."""
        try:
            return np.asarray(np.linalg.solve(self.matrix, -self.rate[..., None])[..., 0])
        except np.linalg.LinAlgError:
            return None

    def estimate_displacement(self, change: Array) -> Array:
        """Return how far (n,) a change (n, 4) of parameters moves the points on the surfaces, to first order (mm)."""
        steps = [
            change[:, 2 * i, None] * jet[1] + change[:, 2 * i + 1, None] * jet[2] for i, jet in enumerate(self.jets)
        ]
        return np.asarray(np.linalg.norm(np.stack(steps), axis=2).max(axis=0))


@dataclass(frozen=True)
class IntersectionCurves(Generic[Pair]):
    """The intersection curves of a pair of reshaped surfaces with a cut condition: equations and continuation."""

    pair: Pair
    cut_condition: CutCondition

    def linearise_system(self, q: Array, t: Array, x: Array) -> LinearisedSystem:
        """Return the equations and their derivatives at parameters (n, 4), t (n,) and x (n,)."""
        jets = self.pair.evaluate_jets(q, x)
        first, second = jets
        cut_residual, gradient, cut_rate = self.cut_condition(t, q, jets)
        matrix = np.empty((len(q), 4, 4))
        matrix[:, :3, 0], matrix[:, :3, 1] = first[1], first[2]
        matrix[:, :3, 2], matrix[:, :3, 3] = -second[1], -second[2]
        matrix[:, 3] = gradient
        residual, rate = np.empty((len(q), 4)), np.empty((len(q), 4))
        residual[:, :3], residual[:, 3] = first[0] - second[0], cut_residual
        rate[:, :3], rate[:, 3] = first[3] - second[3], cut_rate
        return LinearisedSystem(matrix, residual, rate, jets)

    def correct_solutions(
        self, start: Array, t: Array, x: Array, longest_step: float | None = None
    ) -> tuple[Array, Array]:
        """Return solutions q (n, 4) next to a start, and which of them have converged (n,).

        Steps are at most ``longest_step`` (mm) long.
        """

        def evaluate_newton_system(q: Array) -> tuple[Array, Array, Array]:
            system = self.linearise_system(q, t, x)
            lengths = np.concatenate([np.linalg.norm(jet[1:3], axis=2).T for jet in system.jets], axis=1)
            return system.residual, system.matrix, lengths

        scale = self.pair.scale
        if longest_step is None:
            longest_step = POTENTIAL_TOLERANCES.longest_correction * scale
        return solve_damped_newton(evaluate_newton_system, start, scale, longest_step)

    def evaluate_cross_derivatives(self, q: Array, t: Array, x: Array, side: int) -> Array:
        """Return the derivatives (n, 3) of the points by x within the surface of side 0 or 1, held as it is at x."""
        system = self.linearise_system(q, t, x)
        return map_rates_to_space(self._differentiate_solutions(system, q, x), system.jets, side)

    def _differentiate_solutions(self, system: LinearisedSystem, q: Array, x: Array) -> Array:
        """Return the derivative (n, 4) of the parameters by x."""
        rates = system.differentiate_solutions()
        if rates is None:
            raise self.make_lost_error(q, x, 0)
        return rates

    def make_lost_error(self, q: Array, x: Array, row: int) -> GeometryError:
        """Return the error that says where, among n places q (n, 4) at x (n,), an intersection is lost."""
        return GeometryError(
            f"the intersection of the reshaped surfaces is lost near {self.pair.describe_place(q, x, row)}: there, "
            "they part, touch, or one is singular (a pole); choose smaller a and b, or another reference"
        )

    def continue_solutions(self, start: Array, t: Array, x0: float, x_values: Array) -> Array:
        """Continue solutions (k, 4) at x0 to other values ``x_values`` (n,) of x, ascending: (k, n, 4).

        Raises
        ------
        GeometryError
            Where they are lost, where the surfaces touch, or one is folded; the message names s and the place.
        """
        at_start = np.full(len(t), x0)
        q0, converged = self.correct_solutions(start, t, at_start)
        if not converged.all():
            raise self.make_lost_error(start, at_start, int((~converged).argmax()))
        table = np.empty((len(t), len(x_values), start.shape[1]))
        indices = np.arange(len(x_values))
        for order in (indices[x_values >= x0], indices[x_values < x0][::-1]):
            q, x = q0, x0
            for j in order.tolist():
                q, x = self.follow_solutions(q, t, x, float(x_values[j])), float(x_values[j])
                table[:, j] = q
        self.check_regularity(table.reshape(-1, start.shape[1]), np.tile(x_values, len(t)))
        return table

    def follow_solutions(self, q: Array, t: Array, x: float, target: float) -> Array:
        """Follow solutions (n, 4) from x to a target, in steps that are halved while Newton's corrections are large.

        Raises
        ------
        GeometryError
            Where they are lost.
        """
        step = target - x
        negligible = POTENTIAL_TOLERANCES.negligible_correction * self.pair.scale
        while x != target:
            here, there = np.full(len(q), x), np.full(len(q), x + step)
            rates = self._differentiate_solutions(self.linearise_system(q, t, here), q, here)
            guess = q + step * rates
            solution, accepted = self.correct_solutions(guess, t, there)
            if accepted.all():
                system = self.linearise_system(solution, t, there)
                moved, corrected = (system.estimate_displacement(solution - other) for other in (q, guess))
                accepted = corrected <= np.maximum(POTENTIAL_TOLERANCES.correction * moved, negligible)
            if not accepted.all():
                step /= 2
                if abs(step) < POTENTIAL_TOLERANCES.shortest_x_step:
                    raise self.make_lost_error(q, here, int((~accepted).argmax()))
                continue
            q, x = solution, x + step
            if abs(target - x) < POTENTIAL_TOLERANCES.shortest_x_step / 2:
                x = target
            step = float(np.clip(2 * step, -abs(target - x), abs(target - x)))
        return q

    def check_regularity(self, q: Array, x: Array) -> None:
        """Raise GeometryError where the surfaces touch, or a reshaped one is folded, at solutions (n, 4) at x (n,)."""
        self.check_folds(q, x)
        normals = [cross_product(jet[1], jet[2]) for jet in self.pair.evaluate_jets(q, x)]
        sine = np.linalg.norm(cross_product(normalise_vectors(normals[0]), normalise_vectors(normals[1])), axis=1)
        if sine.min() < POTENTIAL_TOLERANCES.touching_sine:
            i = int(sine.argmin())
            raise GeometryError(
                f"the reshaped surfaces touch at an angle of {sine[i]:.2g} rad, at "
                f"{self.pair.describe_place(q, x, i)}: choose other a and b"
            )

    def check_folds(self, q: Array, x: Array) -> None:
        """Raise GeometryError where a reshaped surface turns over on itself, at solutions (n, ..) at x (n,)."""
        for number, (primary, jet) in enumerate(
            zip(self.pair.primaries, self.pair.evaluate_jets(q, x), strict=True), 1
        ):
            normal = cross_product(jet[1], jet[2])
            original = primary.jet(q[:, 2 * number - 2 : 2 * number])
            same_side = (normal * cross_product(original[1], original[2])).sum(axis=1)
            reversed_both = ((jet[1] * original[1]).sum(axis=1) < 0) & ((jet[2] * original[2]).sum(axis=1) < 0)
            folded = (same_side <= 0) | reversed_both
            if folded.any():
                raise GeometryError(
                    f"surface {number} is reshaped so far that it turns over on itself, at "
                    f"{self.pair.describe_place(q, x, int(folded.argmax()))}: choose a smaller {'ab'[number - 1]}, or "
                    "smaller amounts"
                )


def map_rates_to_space(rates: Array, jets: tuple[Array, ...], side: int) -> Array:
    """Return the vectors (n, 3) in the tangent planes of side 0 or 1 that rates (n, 4) of the parameters stand for."""
    uv_rates = rates[:, 2 * side : 2 * side + 2]
    return np.asarray(uv_rates[:, :1] * jets[side][1] + uv_rates[:, 1:] * jets[side][2])
