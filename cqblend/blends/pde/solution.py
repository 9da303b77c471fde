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
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from cqblend.blends.pde.bubble_basis import evaluate_bubbles, evaluate_hermite_basis, measure_bubble_heights
from cqblend.blends.pde.equations import Equation
from cqblend.blends.pde.least_squares import (
    CollocationCounts,
    LeastSquaresProblem,
    Minimise,
    SplineProblem,
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
    clock : callable
        The map from t to the w of the equations.
    """

    equations: tuple[Equation, Equation, Equation]
    basis: Basis
    minimise: Minimise
    residual: tuple[float, float, float]
    missed: float
    clock: Callable[[Array], Array]
    centre: Array  # that of the boundary data, (3,)
    boundary: tuple[Array, ...]  # boundary data in the basis, by component, (2, half, count)
    bubbles: tuple[Array, ...]  # coefficients q, by component, (terms, count)

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


ComponentGroups: TypeAlias = list[tuple[list[int], LeastSquaresProblem[Basis]]]


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
    equations: tuple[Equation, Equation, Equation]
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
        coefs, rail_error = self.data.project_onto_basis(self.basis)
        for count in self._choose_term_counts() if terms is None else [terms]:
            groups = [
                (members, self._pose_least_squares(coefs, members, count)) for members in self._group_components()
            ]
            if self._is_accurate_enough(groups):
                break
        bubbles = [np.empty(0)] * 3
        for members, problem in groups:
            for k, i in enumerate(members):
                bubbles[i] = problem.bubble_coefficients[..., k]
        return Solution(
            equations=self.equations,
            basis=self.basis,
            minimise=self.minimise,
            residual=self._measure_residuals(groups),
            missed=rail_error,
            clock=self.rail_parameter,
            centre=self.data.centre,
            boundary=tuple(
                np.moveaxis(coefs[:, :, : equation.half, i], 0, -1) for i, equation in enumerate(self.equations)
            ),
            bubbles=tuple(bubbles),
        )

    def _measure_residuals(self, groups: ComponentGroups) -> tuple[float, float, float]:
        """Return the relative residuals of x, y and z; 0 for a component that is rounding beside the others."""
        estimates = [(members, problem.error_estimate) for members, problem in groups]
        size = max(float(estimate.terms_size.max()) for _, estimate in estimates)
        residuals = [0.0] * 3
        for members, estimate in estimates:
            for i, remainder, total in zip(members, estimate.remainder.tolist(), estimate.total.tolist(), strict=True):
                residuals[i] = remainder / total if total > PDE_TOLERANCES.negligible_residual * size else 0.0
        return residuals[0], residuals[1], residuals[2]

    def _group_components(self) -> list[list[int]]:
        """Group the components that have the same equation."""
        groups: dict[Equation, list[int]] = {}
        for i, equation in enumerate(self.equations):
            groups.setdefault(equation, []).append(i)
        return list(groups.values())

    def _pose_least_squares(self, coefs: Array, members: list[int], terms: int) -> LeastSquaresProblem[Basis]:
        equation = self.equations[members[0]]
        data = coefs[:, :, : equation.half, members]
        if isinstance(self.basis, Waves):
            return WaveProblem(equation, self.basis, data, terms, self.points)
        if self.basis.closed:
            prescribed = np.zeros((2, 0, terms, len(members)))
        else:
            prescribed = self._prescribe_end_coefficients(self.basis, equation, data, members, terms)
        return SplineProblem(equation, self.basis, data, terms, self.points, prescribed, self.minimise)

    def _prescribe_end_coefficients(
        self, basis: Splines, equation: Equation, data: Array, members: list[int], terms: int
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

    def _is_accurate_enough(self, groups: ComponentGroups) -> bool:
        """Whether the last two bubbles change so little that further ones are not needed."""
        if self.minimise == "energy":
            return max(self._measure_residuals(groups)) <= self.relative_accuracy
        largest_values = np.abs(self.basis(self.data.w)).max(axis=0)
        contributions = [
            measure_bubble_heights(problem.equation.half, problem.terms)[:, None]
            * np.einsum("mjc,j->mc", np.abs(problem.bubble_coefficients), largest_values)
            for _, problem in groups
        ]
        largest = max(float(heights.max()) for heights in contributions)
        last = max(float(heights[-2:].max()) for heights in contributions)
        return last <= max(self.accuracy, self.relative_accuracy * largest)
