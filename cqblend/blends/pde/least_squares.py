r"""The sums of squares whose minimum solves an equation between two rails, and their minimum, by QR factorisations.

Unknown are the coefficients of the bubbles across (polynomials in v that vanish at both rails with their derivatives,
:mod:`cqblend.blends.pde.bubble_basis`) times the functions along. There are two sums:

- the *residual* of the equation at collocation points, You and Zhang's eq. 11 and 12. The equation does not couple
  waves of different frequencies, so each of them is solved by itself;
- the *energy*: forms f of half the order whose squares add up to the equation's symbol
  (:meth:`cqblend.blends.pde.equations.Equation.split_into_squares`). Its minimum solves the equation weakly. Open rails
  need that: at the corners of the blend solutions are singular and their residual is not square integrable, so that
  its minimum is not the solution.

Normal equations are never formed. Depends on the equation and on the functions along and across, not on rails.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, Literal, TypeAlias, TypeVar

import numpy as np

from cqblend.blends.pde.bubble_basis import evaluate_bubbles, evaluate_hermite_basis
from cqblend.blends.pde.equations import Equation
from cqblend.blends.pde.rail_basis import Basis, Splines, Waves
from cqblend.blends.pde.tolerances import PDE_LIMITS
from cqblend.errors import InputError
from cqblend.splines.antiderivative import gauss_rule
from cqblend.splines.bernstein import Array

Minimise: TypeAlias = Literal["residual", "energy"]
CollocationCounts: TypeAlias = tuple[int | None, int | None]
DerivativeForm: TypeAlias = list[tuple[float, int, int]]  # terms: coefficient, order across, order along

AlongBasis = TypeVar("AlongBasis", bound=Basis, covariant=True)


@dataclass(frozen=True)
class ErrorEstimate:
    """How far from exact a solution is, (c,) each for the components that it has.

    Of the residual: root mean squares between the collocation points, with bubbles (``remainder``) and without
    (``total``). Of the energy: the roots of what two more bubbles would take of it, and of what the bubbles took.
    ``terms_size`` is the size of the terms that are added up.
    """

    remainder: Array
    total: Array
    terms_size: Array


@dataclass(frozen=True)
class LeastSquaresProblem(ABC, Generic[AlongBasis]):
    """The least-squares problem of the c components that have one equation.

    ``boundary_data`` (count, 2, half, c) are their derivatives by v of orders 0 to half - 1 on both rails, expanded in
    the functions along; ``terms`` is the number of bubbles, ``points`` that of collocation points across and along.
    """

    equation: Equation
    basis: AlongBasis
    boundary_data: Array
    terms: int
    points: CollocationCounts

    @property
    @abstractmethod
    def bubble_coefficients(self) -> Array:
        """The coefficients of the bubbles, (terms, count, c).

        Raises
        ------
        InputError
            If there are fewer collocation points than unknowns.
        """

    @cached_property
    def error_estimate(self) -> ErrorEstimate:
        """How far from exact the solution is."""
        return self._estimate_error()

    def _estimate_error(self) -> ErrorEstimate:
        """Return what is left of the residual between the collocation points."""
        v, weights = gauss_rule(self.equation.order + self.terms + PDE_LIMITS.extra_points)
        (low, high), count = self.basis.domain, 3 * self.basis.count + PDE_LIMITS.extra_points
        w = low + (high - low) * (np.arange(count) + 0.5) / count
        inner, outer = self._evaluate_across(v)
        along = np.stack(
            [c * self.basis(w, 2 * i) for i, c in enumerate(self.equation.normalised_coefficients.tolist())]
        )
        each = np.einsum("iper,jerc,ilj->iplc", outer, self.boundary_data, along, optimize=True)
        before = each.sum(axis=0)
        after = before + np.einsum("ipm,mjc,ilj->plc", inner, self.bubble_coefficients, along, optimize=True)
        return ErrorEstimate(
            *(np.sqrt(np.einsum("p,plc->c", weights, x**2)) for x in (after, before, np.abs(each).sum(0)))
        )

    def _evaluate_across(self, v: Array) -> tuple[Array, Array]:
        """Return derivatives by v of orders n, n - 2, .., 0 at v (p,).

        Of the bubbles, (half + 1, p, terms), and of the polynomials that have the boundary data, (half + 1, p, 2,
        half).
        """
        half, orders = self.equation.half, range(self.equation.order, -1, -2)
        return (
            np.stack([evaluate_bubbles(half, self.terms, v, k) for k in orders]),
            np.stack([evaluate_hermite_basis(half, v, k) for k in orders]),
        )

    def _choose_collocation_nodes(self) -> tuple[Array, Array]:
        """Return the collocation points across, and the square roots of their weights."""
        least = self.equation.order + self.terms + PDE_LIMITS.extra_bubbles
        count = least if self.points[0] is None else self.points[0]
        if count < self.terms:
            raise InputError(
                f"{count} collocation points across are fewer than {self.terms} terms: give at least as many, better "
                f"{least}"
            )
        v, weights = gauss_rule(count)
        return v, np.sqrt(weights)


class WaveProblem(LeastSquaresProblem[Waves]):
    """The residual for waves, each frequency by itself."""

    @cached_property
    def bubble_coefficients(self) -> Array:
        """The coefficients of the bubbles, (terms, count, c), solved frequency by frequency."""
        basis = self.basis
        if self.points[1] is not None and self.points[1] < basis.count:
            raise InputError(f"{self.points[1]} collocation points along are fewer than the {basis.count} functions")
        v, root = self._choose_collocation_nodes()
        inner, outer = self._evaluate_across(v)
        numbers, kinds = (np.arange(basis.count) + 1) // 2, np.arange(basis.count) % 2
        omega = basis.frequencies[::2]  # each frequency once
        signs = np.array([c * (-1.0) ** i for i, c in enumerate(self.equation.normalised_coefficients.tolist())])
        powers = signs * omega[:, None] ** (2 * np.arange(len(signs)))  # (modes + 1, half + 1)
        matrix = np.einsum("ji,ipm->jpm", powers, inner) * root[:, None]
        boundary_part = np.einsum("ji,iper->jper", powers, outer) * root[:, None, None]
        right = np.zeros((len(omega), len(v), 2, self.boundary_data.shape[-1]))
        right[numbers, :, kinds] = -np.einsum("jper,jerc->jpc", boundary_part[numbers], self.boundary_data)
        size = np.linalg.norm(matrix, axis=1, keepdims=True)
        q, r = np.linalg.qr(matrix / size)
        solved = np.linalg.solve(r, q.swapaxes(1, 2) @ right.reshape(*right.shape[:2], -1)) / size.swapaxes(1, 2)
        return np.moveaxis(solved.reshape(len(omega), self.terms, 2, -1)[numbers, :, kinds], 0, 1)


@dataclass(frozen=True)
class SplineProblem(LeastSquaresProblem[Splines]):
    """The residual or the energy for splines, all of their coefficients at once.

    ``end_coefficients`` (2, k, terms, c) are the prescribed outermost coefficients at both ends of open rails.
    """

    end_coefficients: Array
    minimise: Minimise

    @cached_property
    def bubble_coefficients(self) -> Array:
        """The coefficients of the bubbles, (terms, count, c), solved at once."""
        coefficients = self._fill_end_coefficients()
        coefficients[:, self._free_functions] += self._free_coefficients.reshape(self.terms, -1, coefficients.shape[-1])
        return coefficients

    @cached_property
    def _free_coefficients(self) -> Array:
        """The free ones of them, (terms times free functions, c)."""
        system, right, _ = self._system
        return _solve_least_squares(system, right)

    @cached_property
    def _system(self) -> tuple[Array, Array, Array]:
        """The least-squares system for all free coefficients, from zero."""
        start = self._fill_end_coefficients()
        if start[..., 0].size > PDE_LIMITS.most_unknowns:
            raise InputError(
                f"{self.terms} terms times {self.basis.count} functions along are more than {PDE_LIMITS.most_unknowns} "
                "unknowns: take fewer terms or modes"
            )
        return self._build_system(range(self.terms), start)

    def _estimate_error(self) -> ErrorEstimate:
        """Return the residual, or what more bubbles would take of the energy."""
        if self.minimise == "residual":
            return super()._estimate_error()
        system, _, size = self._system
        total = np.linalg.norm(system @ self._free_coefficients, axis=0)
        further = np.zeros((PDE_LIMITS.extra_bubbles, *self.bubble_coefficients.shape[1:]))
        padded = np.concatenate([self.bubble_coefficients, further])
        system, right, _ = self._build_system(range(self.terms, len(padded)), padded)
        return ErrorEstimate(np.linalg.norm(system @ _solve_least_squares(system, right), axis=0), total, size)

    @property
    def _free_functions(self) -> slice:
        """The functions along whose coefficients are free."""
        return slice(self.end_coefficients.shape[1], self.basis.count - self.end_coefficients.shape[1])

    def _fill_end_coefficients(self) -> Array:
        """Return coefficients (terms, count, c): the prescribed ones at the ends, zeros elsewhere."""
        out = np.zeros((self.terms, self.basis.count, self.boundary_data.shape[-1]))
        k = self.end_coefficients.shape[1]
        if self.basis.count <= 2 * k:
            raise InputError(
                f"{self.basis.count} functions along leave none free between ends that hold {k} each: more modes"
            )
        if k:
            out[:, :k], out[:, -k:] = self.end_coefficients[0].swapaxes(0, 1), self.end_coefficients[1].swapaxes(0, 1)
        return out

    def _list_forms(self) -> list[DerivativeForm]:
        """Return the forms whose squares are integrated: the equation itself, or those of the energy."""
        half, n = self.equation.half, self.equation.order
        if self.minimise == "residual":
            return [[(c, n - 2 * i, 2 * i) for i, c in enumerate(self.equation.normalised_coefficients.tolist()) if c]]
        forms = [
            [(c, half - i, i) for i, c in enumerate(form) if c] for form in self.equation.split_into_squares().tolist()
        ]
        return [form for form in forms if form]

    def _build_system(self, bubbles: range, coefficients: Array) -> tuple[Array, Array, Array]:
        """Return the least-squares system for changes of the free coefficients of some bubbles, from given ones.

        Matrix, right side, and the norm (c,) of the sum before the changes. A form of one term is the tensor product of
        a matrix across and one along; it is replaced by the product of their triangular factors.
        """
        basis, half = self.basis, self.equation.half
        v, root = self._choose_collocation_nodes()
        w, weights = basis.choose_gauss_points(self.points[1])
        if len(v) * len(w) < self.terms * len(range(*self._free_functions.indices(basis.count))):
            raise InputError(
                f"{len(v)} x {len(w)} collocation points are fewer than the unknowns, {self.terms} terms times "
                f"{basis.count} functions along: give more points, or fewer terms or modes"
            )
        entries = len(v) * len(w) * len(bubbles) * basis.count
        if self.points != (None, None) and entries > PDE_LIMITS.most_matrix_entries:
            raise InputError(
                f"{len(v)} x {len(w)} collocation points for {self.terms} terms times {basis.count} functions along "
                f"would take {8e-9 * entries:.3g} GB: give fewer points"
            )
        blocks, rights, size = [], [], np.zeros(self.boundary_data.shape[-1])
        for form in self._list_forms():
            right, factors = np.zeros((len(v), len(w), self.boundary_data.shape[-1])), []
            for c, kv, kw in form:
                across = evaluate_bubbles(half, len(coefficients), v, kv) * root[:, None]
                along = c * basis(w, kw) * np.sqrt(weights)[:, None]
                outer = np.einsum(
                    "per,jerc->pjc", evaluate_hermite_basis(half, v, kv) * root[:, None, None], self.boundary_data
                )
                inner = np.einsum("pm,mjc->pjc", across, coefficients)
                right -= np.einsum("pjc,lj->plc", outer + inner, along, optimize=True)
                factors.append((across[:, bubbles], along[:, self._free_functions]))
            size += (right**2).sum(axis=(0, 1))
            if len(factors) == 1:
                (qv, rv), (qw, rw) = (np.linalg.qr(factor) for factor in factors[0])
                factors = [(rv, rw)]
                right = np.einsum("pm,plc,ln->mnc", qv, right, qw, optimize=True)
            block = _sum_tensor_products(factors)
            blocks.append(block.reshape(block.shape[0] * block.shape[1], -1))
            rights.append(right.reshape(len(blocks[-1]), -1))
        return np.concatenate(blocks), np.concatenate(rights), np.sqrt(size)


def _sum_tensor_products(factors: list[tuple[Array, Array]]) -> Array:
    """Return the sum (p, l, m, j) of products of matrices across (p, m) and along (l, j)."""
    total: Array = np.zeros(())
    for across, along in factors:
        total = total + np.einsum("pm,lj->plmj", across, along)
    return total


def _solve_least_squares(system: Array, right: Array) -> Array:
    """Solve a least-squares system of full rank."""
    size = np.linalg.norm(system, axis=0)
    q, r = np.linalg.qr(system / size)
    return np.asarray(np.linalg.solve(r, q.T @ right) / size[:, None])
