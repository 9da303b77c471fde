r"""You and Zhang's partial differential equations between two rails, solved as in their paper, for many terms.

Boundary data are the derivatives by v, across, on both rails. They are expanded in functions g_j(w) along the rails
(eq. 7), and so is each component of the blend (eq. 8; v and w are the paper's u and v),

.. math:: f(v, w) = \sum_j \Big( \sum_{e, r} h_{er}(v)\, a_{erj} + \sum_m \varphi_m(v)\, q_{mj} \Big)\, g_j(w),

with Hermite's polynomials h, which have the boundary data, and the bubbles :math:`\varphi`, which vanish at both rails
with their derivatives (:mod:`cqblend.blends.pde.bubble_basis`): it satisfies its boundary conditions exactly,
whatever q is (eq. 9 and 10). The unknowns q minimise a sum of squares, that of the residual (eq. 11 and 12) or the
energy (:mod:`cqblend.blends.pde.least_squares`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from cqblend.blends.pde.bubble_basis import evaluate_bubbles, evaluate_hermite_basis, measure_bubble_heights
from cqblend.blends.pde.equations import Equation, LinearEquation, Minimise
from cqblend.blends.pde.least_squares import (
    CollocationCounts,
    CoupledProblem,
    LeastSquaresProblem,
    WaveProblem,
)
from cqblend.blends.pde.rail_basis import Basis, Splines, Waves
from cqblend.blends.pde.rail_parameter import LengthParameter
from cqblend.blends.pde.tolerances import PDE_LIMITS, PDE_TOLERANCES
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class BoundaryData:
    """Derivatives by v of orders 0, 1, .. on both rails, ``jets`` (2, orders, n, 3), at ``w`` (n,).

    Positions are relative to ``centre`` (3,), which limits cancellation far from the origin. ``weights`` (n,) are those
    of a quadrature over ``domain``; ``closed`` says whether the rails are closed.
    """

    w: Array
    weights: Array
    jets: Array
    centre: Array
    domain: tuple[float, float]
    closed: bool

    @property
    def size(self) -> float:
        """Diagonal of the box around both rails."""
        return float(np.linalg.norm(np.ptp(self.jets[:, 0].reshape(-1, 3), axis=0)))

    @property
    def width(self) -> float:
        """Mean distance of the rails."""
        distances = np.linalg.norm(self.jets[1, 0] - self.jets[0, 0], axis=-1)
        return float((distances * self.weights).sum() / self.weights.sum())

    def project_onto_basis(self, basis: Basis) -> tuple[Array, float]:
        """Expand in functions along: coefficients (count, 2, orders, 3), and the largest error on the rails (mm)."""
        n = len(self.w)
        flat = np.moveaxis(self.jets, 2, 0).reshape(n, -1)
        coefs = basis.fit_coefficients(self.w, self.weights, flat)
        rail_errors = (basis(self.w) @ coefs - flat).reshape(n, *self.jets.shape[:2], 3)[:, :, 0]
        shape = (basis.count, *self.jets.shape[:2], 3)
        return coefs.reshape(shape), float(np.linalg.norm(rail_errors, axis=-1).max())


@dataclass(frozen=True)
class EndSections:
    """The end sections of an open blend: derivatives by w of orders 0, 1, .. at v (n,), ``jets`` (2, orders, n, 3)."""

    v: Array
    jets: Array


@dataclass(frozen=True)
class Solution:
    """A solution, to be evaluated at t along the rails and v across.

    Attributes
    ----------
    equations : tuple of Equation
        Of x, y and z.
    basis : Basis
        The functions along.
    minimise : {"residual", "energy"}
        The sum of squares that it minimises.
    residual : tuple of float
        Of x, y and z. For "residual": root mean square of the equation's residual between the collocation points, as
        a share of that without bubbles. For "energy": how much two further bubbles would change the solution, as a
        share of what all bubbles have changed, both in the norm of the energy.
    missed : float
        Largest error of the expansion of the rails in the basis, mm.
    change : float or None
        How far twice as many functions along, or the next number of bubbles, would move it, mm, where it was refined to
        a tolerance; else None.
    clock : callable
        The map from t to the w of the equations.
    """

    equations: tuple[LinearEquation, LinearEquation, LinearEquation]
    basis: Basis
    minimise: Minimise
    residual: tuple[float, float, float]
    missed: float
    clock: Callable[[Array], Array]
    centre: Array  # that of the boundary data, (3,)
    boundary: tuple[Array, ...]  # boundary data in the basis, by component, (2, half, count)
    bubbles: tuple[Array, ...]  # coefficients q, by component, (terms, count)
    change: float | None = None

    @property
    def terms(self) -> int:
        """Number of bubbles."""
        return len(self.bubbles[0])

    @property
    def halves(self) -> tuple[int, int, int]:
        """Number of conditions on each rail for x, y and z."""
        first, second, third = (equation.half for equation in self.equations)
        return first, second, third

    def evaluate_coefficients(self, w: Array) -> list[Array]:
        """Return the coefficients of the bubbles at w (n,), by component (n, terms)."""
        values = self.basis(w)
        return [values @ q.T for q in self.bubbles]

    def evaluate_grid(self, w: Array, v: Array) -> Array:
        """Return the points at all w (n,), not t, and v (m,): (n, m, 3)."""
        values, components = self.basis(w), []
        for half, data, q in zip(self.halves, self.boundary, self.bubbles, strict=True):
            across = np.einsum("mer,erj->mj", evaluate_hermite_basis(half, v), data)
            across += evaluate_bubbles(half, len(q), v) @ q
            components.append(values @ across.T)
        return np.stack(components, axis=-1) + self.centre

    def __call__(self, t: ArrayLike, v: ArrayLike, kv: int = 0) -> Array:
        """Points of the solution, or their kv-th derivatives by v, at t and v, which broadcast: (.., 3)."""
        t, v = np.broadcast_arrays(np.asarray(t, dtype=np.float64), np.asarray(v, dtype=np.float64))
        values = self.basis(self.clock(t.ravel()))
        out = np.empty((t.size, 3))
        for i, (half, data, q) in enumerate(zip(self.halves, self.boundary, self.bubbles, strict=True)):
            boundary_part = np.einsum("ner,erj->nj", evaluate_hermite_basis(half, v.ravel(), kv), data)
            bubble_part = evaluate_bubbles(half, len(q), v.ravel(), kv) @ q
            out[:, i] = self.centre[i] * (kv == 0) + ((boundary_part + bubble_part) * values).sum(axis=1)
        return out.reshape(*t.shape, 3)


@dataclass(frozen=True)
class PosedProblem:
    """A boundary value problem with a number of bubbles: the least-squares problems of its components.

    ``coefs`` (count, 2, orders, 3) are the boundary data in the basis, with the largest error ``rail_error`` on the
    rails (mm); ``groups`` are the components that have one equation, with their problem.
    """

    problem: BoundaryProblem
    coefs: Array
    rail_error: float
    groups: list[tuple[list[int], LeastSquaresProblem[Basis]]]

    @cached_property
    def unmeasured_solution(self) -> Solution:
        """The solution, whose residual is not a number."""
        bubbles = [np.empty(0)] * 3
        for members, problem in self.groups:
            for k, i in enumerate(members):
                bubbles[i] = problem.bubble_coefficients[..., k]
        equations = self.problem.equations
        return Solution(
            equations=equations,
            basis=self.problem.basis,
            minimise=self.problem.minimise,
            residual=(np.nan,) * 3,
            missed=self.rail_error,
            clock=self.problem.rail_parameter,
            centre=self.problem.data.centre,
            boundary=tuple(
                np.moveaxis(self.coefs[:, :, : equation.half, i], 0, -1) for i, equation in enumerate(equations)
            ),
            bubbles=tuple(bubbles),
        )

    @property
    def solution(self) -> Solution:
        """The solution, with its residual."""
        return replace(self.unmeasured_solution, residual=self.residuals)

    @cached_property
    def residuals(self) -> tuple[float, float, float]:
        """The relative residuals of x, y and z; 0 for a component that is rounding beside the others."""
        estimates = [(members, problem.error_estimate) for members, problem in self.groups]
        size = max(float(estimate.terms_size.max()) for _, estimate in estimates)
        residuals = [0.0] * 3
        for members, estimate in estimates:
            for i, remainder, total in zip(members, estimate.remainder.tolist(), estimate.total.tolist(), strict=True):
                residuals[i] = remainder / total if total > PDE_TOLERANCES.negligible_residual * size else 0.0
        return residuals[0], residuals[1], residuals[2]


@dataclass(frozen=True)
class BoundaryProblem:
    """The boundary value problem of a blend.

    Attributes
    ----------
    data : BoundaryData
        With as many derivatives as the highest order takes.
    equations : tuple of Equation
        Of x, y and z.
    basis : Basis
        Functions along.
    rail_parameter : LengthParameter
        The map from t to w, for the solution.
    minimise : {"residual", "energy"}
    points : tuple of (int or None)
        Number of collocation points across and along; None for as many as make the sum of squares an integral.
    ends : EndSections or None
        End sections of an open blend; None for Hermite's between the boundary data. Of these, the energy keeps the
        position alone.
    joined : bool
        Whether the derivative along at open ends is Hermite's as well, also with the energy.
    accuracy, relative_accuracy : float
        What the last two bubbles may change, where their number is free: mm, and a share of what all bubbles change;
        with the energy, a share of its root.
    keeps_low_degree : bool
        Whether the number of bubbles of a solution by the energy is limited so that the degree across stays low.
    """

    data: BoundaryData
    equations: tuple[LinearEquation, LinearEquation, LinearEquation]
    basis: Waves | Splines
    rail_parameter: LengthParameter
    minimise: Minimise
    points: CollocationCounts
    ends: EndSections | None
    joined: bool
    accuracy: float
    relative_accuracy: float
    keeps_low_degree: bool

    def solve(self, terms: int | None) -> Solution:
        """Solve with ``terms`` bubbles; None for as many as it takes.

        Raises
        ------
        InputError
            If there are fewer collocation points than unknowns.
        """
        if terms is not None:
            return self.pose(terms).solution
        for count in self._choose_term_counts():
            posed = self.pose(count)
            if self._is_accurate_enough(posed):
                break
        return posed.solution

    def pose(self, terms: int) -> PosedProblem:
        """Return the least-squares problems for ``terms`` bubbles."""
        coefs, rail_error = self._expanded_data
        groups = [(members, self._pose_least_squares(coefs, members, terms)) for members in self._group_components()]
        return PosedProblem(self, coefs, rail_error, groups)

    @cached_property
    def _expanded_data(self) -> tuple[Array, float]:
        """The boundary data in the basis, and their largest error on the rails (mm)."""
        return self.data.project_onto_basis(self.basis)

    def _group_components(self) -> list[list[int]]:
        """Group the components that have the same equation."""
        groups: dict[LinearEquation, list[int]] = {}
        for i, equation in enumerate(self.equations):
            groups.setdefault(equation, []).append(i)
        return list(groups.values())

    def _pose_least_squares(self, coefs: Array, members: list[int], terms: int) -> LeastSquaresProblem[Basis]:
        equation = self.equations[members[0]]
        data = coefs[:, :, : equation.half, members]
        if isinstance(self.basis, Waves) and isinstance(equation, Equation) and self.minimise == "residual":
            return WaveProblem(equation, self.basis, data, terms, self.points)
        if isinstance(self.basis, Waves) or self.basis.closed:
            prescribed = np.zeros((2, 0, terms, len(members)))
        else:
            prescribed = self._prescribe_end_coefficients(self.basis, equation, data, members, terms)
        return CoupledProblem(equation, self.basis, data, terms, self.points, prescribed, self.minimise)

    def _prescribe_end_coefficients(
        self, basis: Splines, equation: LinearEquation, data: Array, members: list[int], terms: int
    ) -> Array:
        """Return the outermost coefficients of the bubbles at both ends of open rails, (2, k, terms, c)."""
        ends = self.ends
        if ends is None:
            count = equation.half if self.minimise == "residual" else 1
            return np.zeros((2, max(count, 2) if self.joined else count, terms, len(members)))
        k = min(equation.half, ends.jets.shape[1])
        jets = ends.jets[:, :k] - self.data.centre * (np.arange(k) == 0)[:, None, None]
        along = np.stack([basis(np.array(basis.domain), order) for order in range(k)])  # (k, 2, count)
        boundary_part = np.einsum("ner,jerc->njc", evaluate_hermite_basis(equation.half, ends.v), data)
        rest = jets[..., members] - np.einsum("njc,kej->eknc", boundary_part, along)
        inner = np.linalg.pinv(evaluate_bubbles(equation.half, terms, ends.v))
        return np.einsum("ekl,mn,elnc->ekmc", basis.build_end_matrices(k), inner, rest, optimize=True)

    def _choose_term_counts(self) -> list[int]:
        """Return the numbers of bubbles to try, fewer where all of them are solved for at once."""
        if self.keeps_low_degree and self.minimise == "energy":
            most = PDE_LIMITS.most_degree_across + 1 - 2 * max(equation.half for equation in self.equations)
            return [n for n in range(most % 2 or 2, most + 1, 2) if n >= 4]
        counts = PDE_LIMITS.term_counts
        if isinstance(self.basis, Waves):
            return list(counts)
        return [n for n in counts if n == counts[0] or n * self.basis.count <= PDE_LIMITS.most_free_unknowns]

    def _is_accurate_enough(self, posed: PosedProblem) -> bool:
        """Whether the last two bubbles change so little that further ones are not needed."""
        if self.minimise == "energy":
            return max(posed.residuals) <= self.relative_accuracy
        largest_values = np.abs(self.basis(self.data.w)).max(axis=0)
        contributions = [
            measure_bubble_heights(problem.equation.half, problem.terms)[:, None]
            * np.einsum("mjc,j->mc", np.abs(problem.bubble_coefficients), largest_values)
            for _, problem in posed.groups
        ]
        largest = max(float(heights.max()) for heights in contributions)
        last = max(float(heights[-2:].max()) for heights in contributions)
        return last <= max(self.accuracy, self.relative_accuracy * largest)
