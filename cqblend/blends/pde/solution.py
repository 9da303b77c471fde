r"""You and Zhang's partial differential equations between two rails, solved as their paper does, for many terms.

Boundary data are the derivatives by v, across, on both rails. They are expanded in functions g_j(w) along the rails
(eq. 7), and so is each component of the blend (eq. 8; v and w are the paper's u and v),

.. math:: f(v, w) = \sum_j \Big( \sum_{e, r} h_{er}(v)\, a_{erj} + \sum_m \varphi_m(v)\, q_{mj} \Big)\, g_j(w),

with the polynomials h that carry the data and the bubbles that vanish with them
(:mod:`cqblend.blends.pde.bubble_basis`): it satisfies its boundary conditions exactly, whatever q is (eq. 9 and
10). The unknowns q minimise a sum of squares (:mod:`cqblend.blends.pde.least_squares`): that of the residual (eq. 11
and 12), or the energy.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cqblend.blends.pde.bubble_basis import evaluate_bubbles, evaluate_hermite_basis, measure_bubble_heights
from cqblend.blends.pde.equations import Equation
from cqblend.blends.pde.least_squares import ROUNDING_SHARE, CollocationCounts, LeastSquaresProblem, Minimise
from cqblend.blends.pde.rail_basis import Basis, Splines, Waves
from cqblend.blends.pde.rail_parameter import LengthParameter
from cqblend.splines.bernstein import Array

TERM_COUNTS = (4, 6, 9, 13, 18, 24, 32, 40)  # bubbles that are tried, one number after the other
MOST_FREE_DEGREE = 9  # degree across of solutions by the energy, at most, where the number of bubbles is free
MOST_FREE_UNKNOWNS = 1500  # of an equation that is solved at once, at most, where the number of bubbles is free


@dataclass(frozen=True)
class BoundaryData:
    """Derivatives by v of orders 0, 1, .. on both rails, ``jets`` (2, orders, n, 3), at ``w`` (n,).

    Positions are taken from ``centre`` (3,), so that equations do not lose what coordinates far from the origin would.
    ``weights`` (n,) are those of a quadrature over ``domain``, ``closed`` says that all return at its end.
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
        apart = np.linalg.norm(self.jets[1, 0] - self.jets[0, 0], axis=-1)
        return float((apart * self.weights).sum() / self.weights.sum())

    def project_onto_basis(self, basis: Basis) -> tuple[Array, float]:
        """Expand in functions: coefficients (count, 2, orders, 3), and how far the rails are from that."""
        n = len(self.w)
        flat = np.moveaxis(self.jets, 2, 0).reshape(n, -1)
        coefs = basis.fit_coefficients(self.w, self.weights, flat)
        missed = (basis(self.w) @ coefs - flat).reshape(n, *self.jets.shape[:2], 3)[:, :, 0]
        shape = (basis.count, *self.jets.shape[:2], 3)
        return coefs.reshape(shape), float(np.linalg.norm(missed, axis=-1).max())


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
        Of x, y and z. Of "residual": root mean square of what is left of the equation between the collocation points,
        as a share of that of the polynomial that carries the data alone. Of "energy": how much two further bubbles
        would change it, as a share of what the bubbles there are have changed, both in the norm of the energy.
    missed : float
        How far the rails are from their expansion in the basis, mm.
    clock : callable
        From t to the w of the equations.
    """

    equations: tuple[Equation, Equation, Equation]
    basis: Basis
    minimise: Minimise
    residual: tuple[float, float, float]
    missed: float
    clock: Callable[[Array], Array]
    centre: Array  # of the positions in the boundary data
    boundary: tuple[Array, ...]  # by component, (2, half, count)
    bubbles: tuple[Array, ...]  # by component, (terms, count)

    @property
    def terms(self) -> int:
        """Number of bubbles."""
        return len(self.bubbles[0])

    @property
    def halves(self) -> tuple[int, int, int]:
        """How many conditions x, y and z take on each rail."""
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
            carried = np.einsum("ner,erj->nj", evaluate_hermite_basis(half, v.ravel(), kv), data)
            out[:, i] = self.centre[i] * (kv == 0) + (
                (carried + evaluate_bubbles(half, len(q), v.ravel(), kv) @ q) * values
            ).sum(axis=1)
        return out.reshape(*t.shape, 3)


@dataclass(frozen=True)
class BoundaryProblem:
    """What is to be solved.

    Attributes
    ----------
    data : Data
        With as many derivatives as the highest order takes.
    equations : tuple of Equation
        Of x, y and z.
    basis : Basis
        Functions along.
    clock : Clock
        From t to w, for the solution.
    minimise : {"residual", "energy"}
    points : tuple of (int or None)
        Number of collocation points across and along; None for as many as make the sum of squares an integral.
    ends : Ends or None
        End sections of an open blend; None for those of the polynomials that carry the data. Of these, the energy needs
        the position alone.
    accuracy, share : float
        What further terms may change, where their number is free: mm, and a share of what all of them do; of the
        energy, a share of its root.
    light : bool
        Whether the energy is to make do with terms that keep the degree across low.
    """

    data: BoundaryData
    equations: tuple[Equation, Equation, Equation]
    basis: Basis
    clock: LengthParameter
    minimise: Minimise
    points: CollocationCounts
    ends: EndSections | None
    accuracy: float
    share: float
    light: bool

    def solve(self, terms: int | None) -> Solution:
        """Solve with so many bubbles; None for as many as it takes.

        Raises
        ------
        InputError
            If there are fewer collocation points than unknowns.
        """
        coefs, missed = self.data.project_onto_basis(self.basis)
        for count in self._choose_term_counts() if terms is None else [terms]:
            groups = [
                (members, self._pose_least_squares(coefs, members, count)) for members in self._group_components()
            ]
            if self._is_accurate_enough(groups):
                break
        found = [np.empty(0)] * 3
        for members, minimum in groups:
            for k, i in enumerate(members):
                found[i] = minimum.bubble_coefficients[..., k]
        error = self._measure_residuals(groups)
        data = tuple(np.moveaxis(coefs[:, :, : one.half, i], 0, -1) for i, one in enumerate(self.equations))
        return Solution(
            self.equations,
            self.basis,
            self.minimise,
            (error[0], error[1], error[2]),
            missed,
            self.clock,
            self.data.centre,
            data,
            tuple(found),
        )

    def _measure_residuals(self, groups: list[tuple[list[int], LeastSquaresProblem]]) -> list[float]:
        """Return the residuals of x, y and z; what is nothing but rounding beside the others has none."""
        parts = [(members, *minimum.estimate_error()) for members, minimum in groups]
        size = max(float(scale.max()) for *_, scale in parts)
        out = [0.0] * 3
        for members, left, whole, _ in parts:
            for i, part, all_ in zip(members, left.tolist(), whole.tolist(), strict=True):
                out[i] = part / all_ if all_ > ROUNDING_SHARE * size else 0.0
        return out

    def _group_components(self) -> list[list[int]]:
        """Put together the components that have one equation."""
        groups: dict[Equation, list[int]] = {}
        for i, equation in enumerate(self.equations):
            groups.setdefault(equation, []).append(i)
        return list(groups.values())

    def _pose_least_squares(self, coefs: Array, members: list[int], terms: int) -> LeastSquaresProblem:
        equation = self.equations[members[0]]
        data = coefs[:, :, : equation.half, members]
        held = np.zeros((2, 0, terms, len(members)))
        if isinstance(self.basis, Splines) and not self.basis.closed:
            held = self._hold_end_coefficients(self.basis, equation, data, members, terms)
        return LeastSquaresProblem(equation, self.basis, data, held, self.points, self.minimise)

    def _hold_end_coefficients(
        self, basis: Splines, equation: Equation, data: Array, members: list[int], terms: int
    ) -> Array:
        """Return the outermost coefficients of the bubbles at both ends of open rails, (2, k, terms, c)."""
        ends = self.ends
        if ends is None:
            return np.zeros((2, equation.half if self.minimise == "residual" else 1, terms, len(members)))
        k = min(equation.half, ends.jets.shape[1])
        jets = ends.jets[:, :k] - self.data.centre * (np.arange(k) == 0)[:, None, None]
        along = np.stack([basis(np.array(basis.domain), order) for order in range(k)])  # (k, 2, count)
        carried = np.einsum("ner,jerc->njc", evaluate_hermite_basis(equation.half, ends.v), data)
        rest = jets[..., members] - np.einsum("njc,kej->eknc", carried, along)
        inner = np.linalg.pinv(evaluate_bubbles(equation.half, terms, ends.v))
        return np.einsum("ekl,mn,elnc->ekmc", basis.build_end_matrices(k), inner, rest, optimize=True)

    def _choose_term_counts(self) -> list[int]:
        """Return the numbers of bubbles to try, fewer where all of them are solved for at once."""
        if self.light and self.minimise == "energy":
            most = MOST_FREE_DEGREE + 1 - 2 * max(one.half for one in self.equations)
            return [n for n in range(most % 2 or 2, most + 1, 2) if n >= 4]
        waves = isinstance(self.basis, Waves)
        return [n for n in TERM_COUNTS if waves or n == TERM_COUNTS[0] or n * self.basis.count <= MOST_FREE_UNKNOWNS]

    def _is_accurate_enough(self, groups: list[tuple[list[int], LeastSquaresProblem]]) -> bool:
        """Whether the last two bubbles say that further ones do not matter."""
        if self.minimise == "energy":
            return max(self._measure_residuals(groups)) <= self.share
        values = np.abs(self.basis(self.data.w)).max(axis=0)
        reach = [
            measure_bubble_heights(one.equation.half, one.terms)[:, None]
            * np.einsum("mjc,j->mc", np.abs(one.bubble_coefficients), values)
            for _, one in groups
        ]
        largest = max(float(one.max()) for one in reach)
        return max(float(one[-2:].max()) for one in reach) <= max(self.accuracy, self.share * largest)
