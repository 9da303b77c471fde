r"""The sums of squares whose minimum solves an equation between two rails, and their minimum, by QR factorisations.

Unknown are the coefficients of bubbles across (:mod:`cqblend.blends.pde.bubble_basis`) times functions along. Two
sums are there:

- the *residual* of the equation at collocation points, You and Zhang's eq. 11 and 12. Waves do not mix, and are solved
  one by one;
- the *energy*: forms f of half the order whose squares add up to the equation's symbol
  (:meth:`cqblend.blends.pde.equations.Equation.split_into_squares`). Its minimum solves the equation weakly. Open rails
  need that: at the corners of the blend solutions are singular, their residual is not square integrable, and its
  minimum is something else.

Normal equations are never formed. This module must not know where data come from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, TypeAlias

import numpy as np

from cqblend.blends.pde.bubble_basis import evaluate_bubbles, evaluate_hermite_basis
from cqblend.blends.pde.equations import Equation
from cqblend.blends.pde.rail_basis import Basis, Splines, Waves
from cqblend.errors import InputError
from cqblend.splines.bernstein import Array
from cqblend.splines.integral import gauss_rule

Minimise: TypeAlias = Literal["residual", "energy"]
CollocationCounts: TypeAlias = tuple[int | None, int | None]
DerivativeForm: TypeAlias = list[tuple[float, int, int]]  # terms: coefficient, order across, order along

RESIDUAL_EXTRA_POINTS = 5  # further points, at which a residual is read
ERROR_EXTRA_BUBBLES = 2  # further bubbles, for which an error of the energy is estimated
MOST_UNKNOWNS = 6000  # unknowns that are solved for at once
MOST_MATRIX_ENTRIES = 10**8  # of a matrix for points that somebody asks for: 0.8 GB
ROUNDING_SHARE = 1e-7  # share of the terms of an equation, below which their sum is rounding


@dataclass(frozen=True)
class LeastSquaresProblem:
    """The task for components that have one equation, with boundary data (count, 2, half, c) in a basis.

    ``end_coefficients`` (2, k, terms, c) are the outermost coefficients at both ends of open rails.
    """

    equation: Equation
    basis: Basis
    boundary_data: Array
    end_coefficients: Array
    points: CollocationCounts
    minimise: Minimise

    @property
    def terms(self) -> int:
        """Number of bubbles."""
        return int(self.end_coefficients.shape[2])

    @cached_property
    def bubble_coefficients(self) -> Array:
        """The coefficients of the bubbles, (terms, count, c).

        Raises
        ------
        InputError
            If there are fewer collocation points than unknowns.
        """
        if isinstance(self.basis, Waves):
            return self._solve_waves(self.basis)
        start = self._fill_end_coefficients(self._spline_basis)
        if start[..., 0].size > MOST_UNKNOWNS:
            raise InputError(
                f"{self.terms} terms times {self.basis.count} functions along are more than {MOST_UNKNOWNS} "
                "unknowns: take "
                "fewer terms or modes"
            )
        system, right, _ = self._build_system(range(self.terms), start)
        start[:, self._free_functions] += _solve_least_squares(system, right).reshape(self.terms, -1, start.shape[-1])
        return start

    def estimate_error(self) -> tuple[Array, Array, Array]:
        """Return how far from exact the solution is: what is left, of what, and the size of its terms, (c,) each.

        Of the residual: root mean squares between the collocation points, with bubbles and without. Of the energy, the
        roots of what two more bubbles would take of it, and of what the bubbles took.
        """
        if self.minimise == "residual":
            return self._measure_residuals()
        none = self._fill_end_coefficients(self._spline_basis)
        system, _, size = self._build_system(range(self.terms), none)
        whole = np.linalg.norm(
            system @ (self.bubble_coefficients - none)[:, self._free_functions].reshape(len(system.T), -1), axis=0
        )
        more = np.concatenate(
            [self.bubble_coefficients, np.zeros((ERROR_EXTRA_BUBBLES, *self.bubble_coefficients.shape[1:]))]
        )
        system, right, _ = self._build_system(range(self.terms, self.terms + ERROR_EXTRA_BUBBLES), more)
        return np.linalg.norm(system @ _solve_least_squares(system, right), axis=0), whole, size

    # -- waves

    def _evaluate_across(self, v: Array) -> tuple[Array, Array]:
        """Return the derivatives n, n - 2, .. 0 of bubbles, (half + 1, p, terms), and of what carries the data."""
        half, orders = self.equation.half, range(self.equation.order, -1, -2)
        return (
            np.stack([evaluate_bubbles(half, self.terms, v, k) for k in orders]),
            np.stack([evaluate_hermite_basis(half, v, k) for k in orders]),
        )

    def _choose_collocation_nodes(self) -> tuple[Array, Array]:
        """Return the collocation points across, and the roots of their weights."""
        least = self.equation.order + self.terms + ERROR_EXTRA_BUBBLES
        count = least if self.points[0] is None else self.points[0]
        if count < self.terms:
            raise InputError(
                f"{count} collocation points across are fewer than {self.terms} terms: give at least as many, better "
                f"{least}"
            )
        v, weights = gauss_rule(count)
        return v, np.sqrt(weights)

    def _solve_waves(self, basis: Waves) -> Array:
        if self.points[1] is not None and self.points[1] < basis.count:
            raise InputError(f"{self.points[1]} collocation points along are fewer than the {basis.count} functions")
        v, root = self._choose_collocation_nodes()
        inner, outer = self._evaluate_across(v)
        numbers, kinds = (np.arange(basis.count) + 1) // 2, np.arange(basis.count) % 2
        omega = basis.frequencies[::2]  # of 1, sin w, ..: once each
        signs = np.array([c * (-1.0) ** i for i, c in enumerate(self.equation.normalised_coefficients.tolist())])
        powers = signs * omega[:, None] ** (2 * np.arange(len(signs)))  # (modes + 1, half + 1)
        matrix = np.einsum("ji,ipm->jpm", powers, inner) * root[:, None]
        carried = np.einsum("ji,iper->jper", powers, outer) * root[:, None, None]
        right = np.zeros((len(omega), len(v), 2, self.boundary_data.shape[-1]))
        right[numbers, :, kinds] = -np.einsum("jper,jerc->jpc", carried[numbers], self.boundary_data)
        size = np.linalg.norm(matrix, axis=1, keepdims=True)
        q, r = np.linalg.qr(matrix / size)
        solved = np.linalg.solve(r, q.swapaxes(1, 2) @ right.reshape(*right.shape[:2], -1)) / size.swapaxes(1, 2)
        return np.moveaxis(solved.reshape(len(omega), self.terms, 2, -1)[numbers, :, kinds], 0, 1)

    # -- splines

    @property
    def _spline_basis(self) -> Splines:
        assert isinstance(self.basis, Splines)
        return self.basis

    @property
    def _free_functions(self) -> slice:
        """The functions along whose coefficients are free."""
        return slice(self.end_coefficients.shape[1], self.basis.count - self.end_coefficients.shape[1])

    def _fill_end_coefficients(self, basis: Splines) -> Array:
        """Return the coefficients that are held, (terms, count, c), and zeros."""
        out = np.zeros((self.terms, basis.count, self.boundary_data.shape[-1]))
        k = self.end_coefficients.shape[1]
        if basis.count <= 2 * k:
            raise InputError(
                f"{basis.count} functions along leave none free between ends that hold {k} each: more modes"
            )
        if k:
            out[:, :k], out[:, -k:] = self.end_coefficients[0].swapaxes(0, 1), self.end_coefficients[1].swapaxes(0, 1)
        return out

    def _list_forms(self) -> list[DerivativeForm]:
        """Return what is to be small: forms, of whose squares the integral is taken."""
        half, n = self.equation.half, self.equation.order
        if self.minimise == "residual":
            return [[(c, n - 2 * i, 2 * i) for i, c in enumerate(self.equation.normalised_coefficients.tolist()) if c]]
        forms = [
            [(c, half - i, i) for i, c in enumerate(form) if c] for form in self.equation.split_into_squares().tolist()
        ]
        return [form for form in forms if form]

    def _build_system(self, some: range, given: Array) -> tuple[Array, Array, Array]:
        """Return the least-squares system for changes of some bubbles' free coefficients, given all coefficients.

        Its matrix and right side, and the norm (c,) of what is to be made least. A form of one term is the product of a
        matrix across and one along, and shrinks to that of their triangular factors.
        """
        basis, half = self._spline_basis, self.equation.half
        v, root = self._choose_collocation_nodes()
        w, weights = basis.choose_gauss_points(self.points[1])
        if len(v) * len(w) < self.terms * len(range(*self._free_functions.indices(basis.count))):
            raise InputError(
                f"{len(v)} x {len(w)} collocation points are fewer than the unknowns, {self.terms} terms times "
                f"{basis.count} functions along: give more points, or fewer terms or modes"
            )
        entries = len(v) * len(w) * len(some) * basis.count
        if self.points != (None, None) and entries > MOST_MATRIX_ENTRIES:
            raise InputError(
                f"{len(v)} x {len(w)} collocation points for {self.terms} terms times {basis.count} functions along "
                f"would take {8e-9 * entries:.3g} GB: give fewer points"
            )
        blocks, rights, size = [], [], np.zeros(self.boundary_data.shape[-1])
        for form in self._list_forms():
            right, factors = np.zeros((len(v), len(w), self.boundary_data.shape[-1])), []
            for c, kv, kw in form:
                across = evaluate_bubbles(half, len(given), v, kv) * root[:, None]
                along = c * basis(w, kw) * np.sqrt(weights)[:, None]
                outer = np.einsum(
                    "per,jerc->pjc", evaluate_hermite_basis(half, v, kv) * root[:, None, None], self.boundary_data
                )
                inner = np.einsum("pm,mjc->pjc", across, given)
                right -= np.einsum("pjc,lj->plc", outer + inner, along, optimize=True)
                factors.append((across[:, some], along[:, self._free_functions]))
            size += (right**2).sum(axis=(0, 1))
            if len(factors) == 1:
                (qv, rv), (qw, rw) = (np.linalg.qr(factor) for factor in factors[0])
                factors = [(rv, rw)]
                right = np.einsum("pm,plc,ln->mnc", qv, right, qw, optimize=True)
            block = sum(np.einsum("pm,lj->plmj", across, along) for across, along in factors)
            assert isinstance(block, np.ndarray)
            blocks.append(block.reshape(block.shape[0] * block.shape[1], -1))
            rights.append(right.reshape(len(blocks[-1]), -1))
        return np.concatenate(blocks), np.concatenate(rights), np.sqrt(size)

    # -- how good it is

    def _measure_residuals(self) -> tuple[Array, Array, Array]:
        """Return the norms (c,) of the residual with bubbles, without, and of the terms of that."""
        v, weights = gauss_rule(self.equation.order + self.terms + RESIDUAL_EXTRA_POINTS)
        (low, high), count = self.basis.domain, 3 * self.basis.count + RESIDUAL_EXTRA_POINTS
        w = low + (high - low) * (np.arange(count) + 0.5) / count
        inner, outer = self._evaluate_across(v)
        along = np.stack(
            [c * self.basis(w, 2 * i) for i, c in enumerate(self.equation.normalised_coefficients.tolist())]
        )
        each = np.einsum("iper,jerc,ilj->iplc", outer, self.boundary_data, along, optimize=True)
        before = each.sum(axis=0)
        after = before + np.einsum("ipm,mjc,ilj->plc", inner, self.bubble_coefficients, along, optimize=True)
        left, whole, size = (
            np.sqrt(np.einsum("p,plc->c", weights, x**2)) for x in (after, before, np.abs(each).sum(0))
        )
        return left, whole, size


def _solve_least_squares(system: Array, right: Array) -> Array:
    """Solve a least-squares system of full rank."""
    size = np.linalg.norm(system, axis=0)
    q, r = np.linalg.qr(system / size)
    return np.asarray(np.linalg.solve(r, q.T @ right) / size[:, None])
