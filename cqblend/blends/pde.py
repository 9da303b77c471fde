r"""You and Zhang's partial differential equations between two rails, solved as their paper does, for many terms.

Boundary data are the derivatives by v, across, on both rails. They are expanded in functions g_j(w) along the rails
(eq. 7), and so is each component of the blend (eq. 8; v and w are the paper's u and v),

.. math:: f(v, w) = \sum_j \Big( \sum_{e, r} h_{er}(v)\, a_{erj} + \sum_m \varphi_m(v)\, q_{mj} \Big)\, g_j(w),

with the polynomials h that carry the data and the bubbles that vanish with them (:mod:`cqblend.blends.across`): it
satisfies its boundary conditions exactly, whatever q is (eq. 9 and 10). The unknowns q minimise the sum of squares of
the equation's residual at collocation points (eq. 11 and 12), Gauss's points, by a QR factorisation of the residual
itself: its normal equations are never formed. Waves do not mix, and are solved one by one; on open rails the end
sections and their derivatives along are held.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from cqblend.blends.across import bubbles, carriers, heights
from cqblend.blends.along import Basis, Splines, Waves
from cqblend.blends.equations import Equation
from cqblend.blends.primaries import Array
from cqblend.errors import InputError
from cqblend.splines.integral import gauss

TERMS = (4, 6, 9, 13, 18, 24, 32, 40)  # bubbles that are tried, one number after the other
UNKNOWNS = 1500  # of an equation that is solved at once, at most, where the number of bubbles is free
CHECKS = 5  # further Gauss points, at which the residual is read


@dataclass(frozen=True)
class Data:
    """Derivatives by v of orders 0, 1, .. on both rails, ``jets`` (2, orders, n, 3), at ``w`` (n,).

    ``weights`` (n,) are those of a quadrature over ``domain``, ``closed`` says that all return at its end.
    """

    w: Array
    weights: Array
    jets: Array
    domain: tuple[float, float]
    closed: bool

    @property
    def size(self) -> float:
        """Diagonal of the box around both rails."""
        return float(np.linalg.norm(np.ptp(self.jets[:, 0].reshape(-1, 3), axis=0)))

    def project(self, basis: Basis) -> tuple[Array, float]:
        """Expand in functions: coefficients (count, 2, orders, 3), and how far the rails are from that."""
        n = len(self.w)
        flat = np.moveaxis(self.jets, 2, 0).reshape(n, -1)
        coefs = basis.fitted(self.w, self.weights, flat)
        missed = (basis(self.w) @ coefs - flat).reshape(n, *self.jets.shape[:2], 3)[:, :, 0]
        shape = (basis.count, *self.jets.shape[:2], 3)
        return coefs.reshape(shape), float(np.linalg.norm(missed, axis=-1).max())


@dataclass(frozen=True)
class Ends:
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
    residual : tuple of float
        Root mean square of each equation's residual, as a share of that of the polynomial that carries the data alone;
        read between the collocation points. 0 where that has none.
    missed : float
        How far the rails are from their expansion in the basis, mm.
    terms : int
        Number of bubbles.
    clock : callable
        From t to the w of the equations.
    """

    equations: tuple[Equation, Equation, Equation]
    basis: Basis
    residual: tuple[float, float, float]
    missed: float
    clock: Callable[[Array], Array]
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

    def inside(self, w: Array) -> list[Array]:
        """Return the coefficients of the bubbles at w (n,), by component (n, terms)."""
        values = self.basis(w)
        return [values @ q.T for q in self.bubbles]

    def __call__(self, t: ArrayLike, v: ArrayLike, kv: int = 0) -> Array:
        """Points of the solution, or their kv-th derivatives by v, at t and v, which broadcast: (.., 3)."""
        t, v = np.broadcast_arrays(np.asarray(t, dtype=np.float64), np.asarray(v, dtype=np.float64))
        values = self.basis(self.clock(t.ravel()))
        out = np.empty((t.size, 3))
        for i, (equation, data, q) in enumerate(zip(self.equations, self.boundary, self.bubbles, strict=True)):
            half = equation.half
            carried = np.einsum("ner,erj->nj", carriers(half, v.ravel(), kv), data)
            out[:, i] = ((carried + bubbles(half, len(q), v.ravel(), kv) @ q) * values).sum(axis=1)
        return out.reshape(*t.shape, 3)


def solve(
    data: Data,
    equations: tuple[Equation, Equation, Equation],
    basis: Basis,
    clock: Callable[[Array], Array],
    *,
    terms: int | None,
    points: tuple[int | None, int | None] = (None, None),
    ends: Ends | None = None,
    accuracy: float,
    share: float = 0.0,
) -> Solution:
    """Solve the equations of x, y and z.

    Parameters
    ----------
    data
        With as many derivatives as the highest order takes.
    basis
        Functions along.
    clock
        From t to w, for the solution.
    terms
        Number of bubbles; None for as many as it takes until the last two add less than ``accuracy``, or than a
        ``share`` of all.
    points
        Number of collocation points across and along; None for as many as make the sum of squares an integral.
    ends
        End sections of an open blend; None for those of the polynomials that carry the data.
    accuracy, share
        mm, and of the largest bubble.

    Raises
    ------
    InputError
        If there are fewer collocation points than unknowns.
    """
    coefs, missed = data.project(basis)
    tried = [terms] if terms is not None else [n for n in TERMS if n == TERMS[0] or _light(basis, n)]
    for count in tried:
        parts = [_Part(one, basis, coefs[:, :, : one.half, i], count, points) for i, one in enumerate(equations)]
        solved = _solved(parts, ends)
        values = np.abs(basis(data.w)).max(axis=0)
        reach = [
            heights(part.equation.half, count) * (np.abs(q) @ values) for part, q in zip(parts, solved, strict=True)
        ]
        enough = max(accuracy, share * max(float(one.max()) for one in reach))
        if max(float(one[-2:].max()) for one in reach) <= enough:
            break
    residual = [part.residual(q) for part, q in zip(parts, solved, strict=True)]
    return Solution(
        equations,
        basis,
        (residual[0], residual[1], residual[2]),
        missed,
        clock,
        tuple(np.moveaxis(part.data, 0, -1) for part in parts),
        tuple(solved),
    )


def _light(basis: Basis, terms: int) -> bool:
    return isinstance(basis, Waves) or terms * basis.count <= UNKNOWNS


def _solved(parts: Sequence[_Part], ends: Ends | None) -> list[Array]:
    """Solve all components, those with one equation at once: coefficients of bubbles, (terms, count) each."""
    solved: list[Array] = [np.empty(0)] * len(parts)
    groups: dict[Equation, list[int]] = {}
    for i, part in enumerate(parts):
        groups.setdefault(part.equation, []).append(i)
    for members in groups.values():
        first = parts[members[0]]
        data = np.stack([parts[i].data for i in members], axis=-1)
        if isinstance(first.basis, Waves):
            found = first.solve_waves(first.basis, data)
        else:
            assert isinstance(first.basis, Splines)
            held = np.stack([parts[i].held(first.basis, ends, i) for i in members], axis=-1)
            found = first.solve_splines(first.basis, data, held)
        for k, i in enumerate(members):
            solved[i] = found[..., k]
    return solved


@dataclass(frozen=True)
class _Part:
    """One component: its equation, and its data (count, 2, half) in a basis."""

    equation: Equation
    basis: Basis
    data: Array
    terms: int
    points: tuple[int | None, int | None]

    def across(self, v: Array) -> tuple[Array, Array]:
        """Return the derivatives n, n - 2, .. 0 of bubbles, (half + 1, p, terms), and of what carries the data."""
        half, n = self.equation.half, self.equation.order
        orders = range(n, -1, -2)
        return (
            np.stack([bubbles(half, self.terms, v, k) for k in orders]),
            np.stack([carriers(half, v, k) for k in orders]),
        )

    def nodes(self) -> tuple[Array, Array]:
        """Return the collocation points across, and the roots of their weights."""
        least = self.equation.order + self.terms
        count = least if self.points[0] is None else self.points[0]
        if count < self.terms:
            raise InputError(
                f"{count} collocation points across are fewer than {self.terms} terms: give at least as many, better "
                f"{least}"
            )
        v, weights = gauss(count)
        return v, np.sqrt(weights)

    def solve_waves(self, basis: Waves, data: Array) -> Array:
        """Solve wave by wave, for data (count, 2, half, c): (terms, count, c)."""
        if self.points[1] is not None and self.points[1] < basis.count:
            raise InputError(f"{self.points[1]} collocation points along are fewer than the {basis.count} functions")
        v, root = self.nodes()
        inner, outer = self.across(v)
        numbers = (np.arange(basis.count) + 1) // 2
        omega = basis.frequencies[::2]  # of 1, sin w, ..: once each
        signs = np.array([c * (-1.0) ** i for i, c in enumerate(self.equation.coefficients)])
        powers = signs * omega[:, None] ** (2 * np.arange(len(signs)))  # (modes + 1, half + 1)
        matrix = np.einsum("ji,ipm->jpm", powers, inner) * root[:, None]
        carried = np.einsum("ji,iper->jper", powers, outer) * root[:, None, None]
        right = np.zeros((len(omega), len(v), 2, data.shape[-1]))
        right[numbers, :, np.arange(basis.count) % 2] = -np.einsum("jper,jerc->jpc", carried[numbers], data)
        size = np.linalg.norm(matrix, axis=1, keepdims=True)
        q, r = np.linalg.qr(matrix / size)
        flat = right.reshape(len(omega), len(v), -1)
        found = np.linalg.solve(r, q.swapaxes(1, 2) @ flat) / size.swapaxes(1, 2)
        found = found.reshape(len(omega), self.terms, 2, -1)
        return np.moveaxis(found[numbers, :, np.arange(basis.count) % 2], 0, 1)

    def held(self, basis: Splines, ends: Ends | None, component: int) -> Array:
        """Return the outermost coefficients of the bubbles at both ends of open rails, (2, half, terms)."""
        half = self.equation.half
        if ends is None or basis.closed:
            return np.zeros((2, half, self.terms))
        edges = np.array(basis.domain)
        along = np.stack([basis(edges, k) for k in range(half)])  # (half, 2, count)
        carried = np.einsum("ner,jer->nj", carriers(half, ends.v), self.data)
        rest = ends.jets[:, :half, :, component] - np.einsum("nj,rbj->brn", carried, along)
        inner = bubbles(half, self.terms, ends.v)
        return basis.held(half) @ np.einsum("mn,brn->brm", np.linalg.pinv(inner), rest)

    def solve_splines(self, basis: Splines, data: Array, held: Array) -> Array:
        """Solve all at once, for data (count, 2, half, c) and outermost coefficients (2, half, terms, c)."""
        half = 0 if basis.closed else self.equation.half
        v, root_v = self.nodes()
        w, weights = basis.points(self.points[1])
        unknowns = self.terms * (basis.count - 2 * half)
        if unknowns <= 0:
            raise InputError(f"{basis.count} functions along leave none free between ends that hold {half} each")
        if len(v) * len(w) < unknowns:
            raise InputError(
                f"{len(v)} x {len(w)} collocation points are fewer than {unknowns} unknowns: give more points, or "
                "fewer terms or modes"
            )
        root = root_v[:, None] * np.sqrt(weights)
        inner, outer = self.across(v)
        along = np.stack(
            [c * basis(w, 2 * i) for i, c in enumerate(self.equation.coefficients)]
        )  # (half + 1, l, count)
        matrix = np.einsum("ipm,ilj->plmj", inner, along, optimize=True) * root[..., None, None]
        carried = np.einsum("iper,jerc->ipjc", outer, data)
        right = -np.einsum("ipjc,ilj->plc", carried, along, optimize=True) * root[..., None]
        solved = np.zeros((self.terms, basis.count, data.shape[-1]))
        free = slice(half, basis.count - half)
        if half:
            solved[:, :half], solved[:, -half:] = held[0].swapaxes(0, 1), held[1].swapaxes(0, 1)
            right -= np.einsum("plmj,mjc->plc", matrix, solved, optimize=True)
        system = matrix[..., free].reshape(len(v) * len(w), unknowns)
        size = np.linalg.norm(system, axis=0)
        q, r = np.linalg.qr(system / size)
        found = np.linalg.solve(r, q.T @ right.reshape(len(system), -1)) / size[:, None]
        solved[:, free] = found.reshape(self.terms, -1, data.shape[-1])
        return solved

    def residual(self, q: Array) -> float:
        """Return how much of the residual of what carries the data is left by coefficients (terms, count)."""
        v, weights_v = gauss(self.equation.order + self.terms + CHECKS)
        (low, high), count = self.basis.domain, 3 * self.basis.count + CHECKS
        w = low + (high - low) * (np.arange(count) + 0.5) / count
        inner, outer = self.across(v)
        along = np.stack([c * self.basis(w, 2 * i) for i, c in enumerate(self.equation.coefficients)])
        carried = np.einsum("iper,jer->ipj", outer, self.data)
        before = np.einsum("ipj,ilj->pl", carried, along)
        after = before + np.einsum("ipm,mj,ilj->pl", inner, q, along, optimize=True)
        each = np.einsum("ipj,ilj->ipl", carried, along)
        left, whole, scale = (
            float(np.sqrt((weights_v @ values**2).sum())) for values in (after, before, np.abs(each).sum(0))
        )
        return left / whole if whole > 1e-12 * scale else 0.0
