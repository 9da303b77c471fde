r"""The sums of squares whose minimum solves an equation between two rails, and their minimum, by QR factorisations.

Unknown are the coefficients of the bubbles across (polynomials in v that vanish at both rails with their derivatives,
:mod:`cqblend.blends.pde.bubble_basis`) times the functions along. There are two sums:

- the *residual* of the equation at collocation points, You and Zhang's eq. 11 and 12. The equation does not couple
  waves of different frequencies, so each of them is solved by itself;
- the *energy*: forms f of half the order whose squares add up to the equation's symbol
  (:meth:`cqblend.blends.pde.equations.LinearEquation.list_forms`). Its minimum solves the equation weakly. Open rails
  need that: at the corners of the blend solutions are singular and their residual is not square integrable, so that
  its minimum is not the solution.

Where the coefficients of an equation vary along, waves are coupled, and solved for as splines are. Normal equations are
never formed. Depends on the equation and on the functions along and across, not on rails.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Generic, TypeAlias, TypeVar

import numpy as np

from cqblend.blends.pde.bubble_basis import evaluate_bubbles, evaluate_hermite_basis
from cqblend.blends.pde.equations import Equation, LinearEquation, Minimise
from cqblend.blends.pde.rail_basis import Basis, Waves
from cqblend.blends.pde.span_system import SpanSystem
from cqblend.blends.pde.tolerances import PDE_LIMITS
from cqblend.errors import InputError
from cqblend.splines.antiderivative import gauss_rule
from cqblend.splines.bernstein import Array

CollocationCounts: TypeAlias = tuple[int | None, int | None]

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

    equation: LinearEquation
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
        half, shape = self.equation.half, (len(v), len(w), self.boundary_data.shape[-1])
        before, after, size = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        for coefficient, kv, kw in self.equation.list_forms("residual", w)[0]:
            along = coefficient * self.basis(w, kw).T
            outer = np.einsum("per,jerc->pjc", evaluate_hermite_basis(half, v, kv), self.boundary_data)
            inner = np.einsum("pm,mjc->pjc", evaluate_bubbles(half, self.terms, v, kv), self.bubble_coefficients)
            carried, added = (np.einsum("pjc,jl->plc", part, along, optimize=True) for part in (outer, inner))
            before += carried
            after += carried + added
            size += np.abs(carried)
        return ErrorEstimate(*(np.sqrt(np.einsum("p,plc->c", weights, x**2)) for x in (after, before, size)))

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


@dataclass(frozen=True)
class WaveProblem(LeastSquaresProblem[Waves]):
    """The residual for waves, each frequency by itself, of an equation with constant coefficients."""

    equation: Equation

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


@dataclass(frozen=True)
class CoupledProblem(LeastSquaresProblem[Basis]):
    """The residual or the energy for all functions along at once: splines, or waves that coefficients couple.

    ``end_coefficients`` (2, k, terms, c) are the prescribed outermost coefficients at both ends of open rails.
    """

    end_coefficients: Array
    minimise: Minimise

    @cached_property
    def bubble_coefficients(self) -> Array:
        """The coefficients of the bubbles, (terms, count, c), solved at once."""
        return self._fill_end_coefficients() + self._system[0].solution.swapaxes(0, 1)

    @cached_property
    def _system(self) -> tuple[SpanSystem, Array]:
        """The least-squares system for all free coefficients, from zero, and the norm (c,) of its right side."""
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
        system, size = self._system
        further = np.zeros((PDE_LIMITS.extra_bubbles, *self.bubble_coefficients.shape[1:]))
        padded = np.concatenate([self.bubble_coefficients, further])
        remainder, _ = self._build_system(range(self.terms, len(padded)), padded)
        return ErrorEstimate(remainder.solution_norm, system.solution_norm, size)

    @cached_property
    def _free_functions(self) -> Array:
        """Which functions along (count,) have coefficients that are free."""
        k, free = self.end_coefficients.shape[1], np.ones(self.basis.count, dtype=bool)
        free[:k] = free[len(free) - k :] = False
        return free

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

    def _build_system(self, bubbles: range, coefficients: Array) -> tuple[SpanSystem, Array]:
        """Return the least-squares system for changes of the free coefficients of some bubbles, from given ones.

        And the norm (c,) of the sum before the changes. A form of one term is the tensor product of a matrix across and
        one along; that across is replaced by its triangular factor.
        """
        basis, half = self.basis, self.equation.half
        v, root = self._choose_collocation_nodes()
        w, weights = basis.choose_gauss_points(self.points[1])
        spans, width = (basis.spans_apart, basis.span_width) if self.points[1] is None else (1, basis.count)
        if len(v) * len(w) < self.terms * int(self._free_functions.sum()):
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
        reached = np.arange(spans)[:, None] + np.arange(width)  # the functions on each span
        blocks, rights, size = [], [], np.zeros(self.boundary_data.shape[-1])
        for form in self.equation.list_forms(self.minimise, w):
            right, factors = np.zeros((len(v), len(w), self.boundary_data.shape[-1])), []
            for coefficient, kv, kw in form:
                across = evaluate_bubbles(half, len(coefficients), v, kv) * root[:, None]
                along = (coefficient * np.sqrt(weights) * basis(w, kw).T).T
                outer = np.einsum(
                    "per,jerc->pjc", evaluate_hermite_basis(half, v, kv) * root[:, None, None], self.boundary_data
                )
                inner = np.einsum("pm,mjc->pjc", across, coefficients)
                right -= np.einsum("pjc,lj->plc", outer + inner, along, optimize=True)
                on_spans = np.take_along_axis(along.reshape(spans, -1, basis.count), reached[:, None], axis=2)
                factors.append((across[:, bubbles], on_spans))
            size += (right**2).sum(axis=(0, 1))
            if len(factors) == 1:
                across, on_spans = factors[0]
                q, triangle = np.linalg.qr(across)
                factors, right = [(triangle, on_spans)], np.einsum("pm,plc->mlc", q, right)
            block = np.einsum("kpm,kslj->sljpm", *map(np.stack, zip(*factors, strict=True)), optimize=True)
            block = np.moveaxis(block, 2, 3)
            blocks.append(block.reshape(spans, -1, width, len(bubbles)))
            rights.append(np.moveaxis(right.reshape(len(right), spans, -1, right.shape[-1]), 0, 2))
        return (
            SpanSystem(
                np.concatenate(blocks, axis=1),
                np.concatenate([right.reshape(spans, -1, right.shape[-1]) for right in rights], axis=1),
                self._free_functions,
            ),
            np.sqrt(size),
        )
