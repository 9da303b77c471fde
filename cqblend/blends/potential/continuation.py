"""The intersection curves of reshaped surfaces, one for every x of a relation, and how solutions are carried on in x.

A *phase* tells which points of different curves belong together: it cuts all of them at one t. With it, the unknowns
(u1, v1, u2, v2) have four equations, solved by Newton for all t at once; each step in x is predicted from the
derivative.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.potential.family_pair import FamilyPair
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, normalise_vectors

TOUCHING_SINE = 1e-5  # sine of the angle between surfaces, below which they touch
SHORTEST_X_STEP = 1e-3  # step in x
LONGEST_CORRECTION = 0.3  # of the scale, the longest step of a correction
CORRECTION_SHARE = 0.5  # of a step, by which its correction may be off the prediction: more may be another branch
NEGLIGIBLE_CORRECTION = 1e-3  # of the scale: a correction as small as that is none


class CutCondition(Protocol):
    """What cuts the curves at t: a residual (n,), in mm, with its derivatives by (u1, v1, u2, v2) and by x."""

    def __call__(self, t: Array, q: Array, jets: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """Return residual (n,), gradient (n, 4), and derivative by x (n,)."""
        ...


@dataclass(frozen=True)
class PlaneCut:
    """Planes through points, normal to directions, (n, 3) each, functions of t."""

    at: Callable[[Array], tuple[Array, Array]]

    def __call__(self, t: Array, q: Array, jets: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """Return how far the points on surface 1 are from the planes."""
        del q
        point, normal = self.at(t)
        first = jets[0]
        gradient = np.zeros((len(t), 4))
        gradient[:, 0], gradient[:, 1] = (first[1] * normal).sum(axis=1), (first[2] * normal).sum(axis=1)
        return ((first[0] - point) * normal).sum(axis=1), gradient, (first[3] * normal).sum(axis=1)


@dataclass(frozen=True)
class IsoparametricCut:
    """Lines of one of the four parameters, from ``first`` to ``last`` for t in [0, 1]; ``size`` is mm in a unit."""

    axis: int
    first: float
    last: float
    size: float

    def parameter_at(self, t: Array) -> Array:
        """Return the parameter at t (n,)."""
        return self.first + t * (self.last - self.first)

    def __call__(self, t: Array, q: Array, jets: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """Return how far the parameter is from its value."""
        del jets
        gradient = np.zeros((len(t), 4))
        gradient[:, self.axis] = self.size
        return (q[:, self.axis] - self.parameter_at(t)) * self.size, gradient, np.zeros(len(t))


@dataclass(frozen=True)
class IntersectionCurves:
    """The intersection curves of a meeting, cut by a phase: equations, and how solutions are carried on."""

    family_pair: FamilyPair
    cut_condition: CutCondition

    def _evaluate_system(self, q: Array, t: Array, x: Array) -> tuple[Array, Array, Array, tuple[Array, Array]]:
        """Return matrix (n, 4, 4), residual (n, 4), its derivative by x, and the jets."""
        jets = self.family_pair.evaluate_jets(q, x)
        first, second = jets
        off, gradient, drift = self.cut_condition(t, q, jets)
        matrix = np.empty((len(q), 4, 4))
        matrix[:, :3] = np.stack([first[1], first[2], -second[1], -second[2]], axis=-1)
        matrix[:, 3] = gradient
        residual = np.concatenate([first[0] - second[0], off[:, None]], axis=1)
        return matrix, residual, np.concatenate([first[3] - second[3], drift[:, None]], axis=1), jets

    def correct_solutions(self, start: Array, t: Array, x: Array, stride: float | None = None) -> tuple[Array, Array]:
        """Return solutions (n, 4) next to a start, in steps of ``stride`` (mm) at most, and which of them there are."""

        def evaluate_newton_system(q: Array) -> tuple[Array, Array, Array]:
            matrix, residual, _, jets = self._evaluate_system(q, t, x)
            return residual, matrix, np.concatenate([np.linalg.norm(jet[1:3], axis=2).T for jet in jets], axis=1)

        scale = self.family_pair.scale
        return solve_damped_newton(
            evaluate_newton_system, start, scale, LONGEST_CORRECTION * scale if stride is None else stride
        )

    def differentiate_solutions(self, q: Array, t: Array, x: Array) -> tuple[Array, tuple[Array, Array]]:
        """Return the derivative (n, 4) of the parameters by x, and the jets."""
        matrix, _, change, jets = self._evaluate_system(q, t, x)
        try:
            return np.linalg.solve(matrix, -change[..., None])[..., 0], jets
        except np.linalg.LinAlgError:
            raise self.make_lost_error(q[0], float(x[0])) from None

    def evaluate_cross_derivatives(self, q: Array, t: Array, x: Array, side: int) -> Array:
        """Return the derivatives (n, 3) by x, tangent to the surface of side 0 or 1 as it is at x."""
        rate, jets = self.differentiate_solutions(q, t, x)
        along = rate[:, 2 * side : 2 * side + 2]
        return np.asarray(along[:, :1] * jets[side][1] + along[:, 1:] * jets[side][2])

    def make_lost_error(self, q: Array, x: float) -> GeometryError:
        """Return the error that says where an intersection is lost."""
        return GeometryError(
            f"the intersection of the reshaped surfaces is lost near {self.family_pair.describe_place(q, x)}: there, "
            "they part, "
            "touch, or one is singular (a pole); choose smaller a and b, or another reference"
        )

    def continue_solutions(self, start: Array, t: Array, x0: float, nodes: Array) -> Array:
        """Carry solutions (k, 4) at x0 to all nodes, ascending: (k, n, 4).

        Raises
        ------
        GeometryError
            Where they are lost, where the surfaces touch, or one is folded; the message names s and the place.
        """
        q0, good = self.correct_solutions(start, t, np.full(len(t), x0))
        if not good.all():
            raise self.make_lost_error(start[~good][0], x0)
        table = np.empty((len(t), len(nodes), 4))
        ahead = np.arange(len(nodes))[nodes >= x0]
        for order in (ahead, np.arange(len(nodes))[nodes < x0][::-1]):
            q, x = q0, x0
            for j in order.tolist():
                q, x = self._continue_to(q, t, x, float(nodes[j])), float(nodes[j])
                table[:, j] = q
        self._check_regularity(table, nodes)
        return table

    def _continue_to(self, q: Array, t: Array, x: float, target: float) -> Array:
        """Carry solutions from x to a target, in steps as long as Newton's corrections stay small."""
        step = target - x
        while x != target:
            rate, _ = self.differentiate_solutions(q, t, np.full(len(q), x))
            guess, there = q + step * rate, np.full(len(q), x + step)
            made, good = self.correct_solutions(guess, t, there)
            if good.all():
                jet = self.family_pair.evaluate_jets(made, there)
                moved, off = (_estimate_displacement(made - other, jet) for other in (q, guess))
                good = off <= np.maximum(CORRECTION_SHARE * moved, NEGLIGIBLE_CORRECTION * self.family_pair.scale)
            if not good.all():
                step /= 2
                if abs(step) < SHORTEST_X_STEP:
                    raise self.make_lost_error(q[~good][0], x)
                continue
            q, x = made, x + step
            if abs(target - x) < SHORTEST_X_STEP / 2:
                x = target
            step = float(np.clip(2 * step, -abs(target - x), abs(target - x)))
        return q

    def _check_regularity(self, table: Array, nodes: Array) -> None:
        """Raise GeometryError where the surfaces touch, or a reshaped one is folded."""
        q, x = table.reshape(-1, 4), np.tile(nodes, len(table))
        jets = self.family_pair.evaluate_jets(q, x)
        outer = [cross_product(jet[1], jet[2]) for jet in jets]
        for number, (family, jet, normal) in enumerate(zip(self.family_pair.families, jets, outer, strict=True), 1):
            own = family.primary.jet(q[:, 2 * number - 2 : 2 * number])
            upright = (normal * cross_product(own[1], own[2])).sum(axis=1)
            turned = ((jet[1] * own[1]).sum(axis=1) < 0) & ((jet[2] * own[2]).sum(axis=1) < 0)
            bad = (upright <= 0) | turned
            if bad.any():
                i = int(bad.argmax())
                raise GeometryError(
                    f"surface {number} is reshaped so far that it turns over on itself, at "
                    f"{self.family_pair.describe_place(q[i], float(x[i]))}: choose a smaller {'ab'[number - 1]}, or "
                    "smaller amounts"
                )
        sine = np.linalg.norm(cross_product(normalise_vectors(outer[0]), normalise_vectors(outer[1])), axis=1)
        if sine.min() < TOUCHING_SINE:
            i = int(sine.argmin())
            raise GeometryError(
                f"the reshaped surfaces touch at an angle of {sine[i]:.2g} rad, at "
                f"{self.family_pair.describe_place(q[i], float(x[i]))}: choose other a and b"
            )


def _estimate_displacement(change: Array, jets: tuple[Array, Array]) -> Array:
    """Return how far (n,) a change of parameters moves the points on the surfaces, about."""
    steps = [change[:, 2 * i, None] * jet[1] + change[:, 2 * i + 1, None] * jet[2] for i, jet in enumerate(jets)]
    return np.asarray(np.linalg.norm(np.stack(steps), axis=2).max(axis=0))
