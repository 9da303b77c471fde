"""Spaces of B-splines, kept span by span: least squares with effort and memory that grow with the number of spans.

On a span, only degree + 1 of the B-splines do not vanish. The normal equations of a fit to values couple no others, so
that they are a band, which is solved by cyclic reduction of its blocks.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.splines.bernstein import Array, evaluate_basis
from cqblend.splines.curve import Curve
from cqblend.splines.knots import extract_pieces


@dataclass(frozen=True)
class SplineSpace:
    """All B-splines of degree p over given breaks; on a span, those that do not vanish there.

    Attributes
    ----------
    breaks : array of shape (n + 1,)
    tables : array of shape (p + 1, p + 1, n)
        Bernstein coefficients, on every span, of its p + 1 functions.
    functions : array of shape (n, p + 1)
        The numbers of these functions.
    count : int
        Number of all functions.
    continuity : array of shape (n - 1,)
        At the inner breaks.
    closed : bool
        Whether the functions are periodic.
    """

    breaks: Array
    tables: Array
    functions: Array
    count: int
    continuity: Array
    closed: bool

    @classmethod
    def from_knots(cls, degree: int, breaks: Array, multiplicities: Array, *, closed: bool) -> SplineSpace:
        """Return the space with knots at breaks (n + 1,), of given multiplicities (n,) at all of these but the last.

        Knots of closed spaces go on periodically; others are clamped at both ends, whatever the first multiplicity.
        """
        order = degree + 1
        knots = breaks[:-1].repeat(multiplicities)
        if closed:
            count, first = len(knots), int(multiplicities[0])
            index = np.arange(first - order, count + order)  # the domain starts at the last one of the first knots
            knots = knots[index % count] + (breaks[-1] - breaks[0]) * (index // count)
        else:
            knots = np.concatenate(
                [breaks[:1].repeat(order), knots[int(multiplicities[0]) :], breaks[-1:].repeat(order)]
            )
            count = len(knots) - order
        colours = np.eye(order)[np.arange(len(knots) - order) % order]  # neighbours, of which no two are alike
        found, tables, continuity = extract_pieces(degree, knots, colours)
        first_active = np.searchsorted(knots, found[:-1], side="right") - order
        functions = first_active[:, None] + (np.arange(order) - first_active[:, None]) % order
        return cls(found, tables, functions % count, count, continuity, closed)

    def evaluate_functions(self, places: Array) -> Array:
        """Return the values (n, m, p + 1) of the functions of every span at relative places (m,) in it."""
        basis = evaluate_basis(len(self.tables) - 1, 1 - places, places)
        return np.asarray(np.einsum("pm,pfn->nmf", basis, self.tables))

    def fit_values(self, places: Array, values: Array) -> Curve:
        """Return the least-squares spline of values (n, m, dim) at relative places (m,) in every span."""
        functions = self.evaluate_functions(places)
        products = functions.swapaxes(1, 2) @ functions
        right = np.zeros((self.count, values.shape[2]))
        np.add.at(right, self.functions, functions.swapaxes(1, 2) @ values)
        poles = self._solve_normal_equations(products, right)
        return Curve(
            self.breaks, np.einsum("pfn,nfd->pdn", self.tables, poles[self.functions]), continuity=self.continuity
        )

    def _solve_normal_equations(self, products: Array, right: Array) -> Array:
        """Solve for all coefficients (count, dim), given the products (n, p + 1, p + 1) of the functions of every span.

        The first p functions of a closed space, which also meet the last ones, are eliminated from the others.
        """
        size = len(self.tables) - 1
        border = size if self.closed else 0
        rows = np.broadcast_to(self.functions[:, :, None] - border, products.shape)
        columns = rows.swapaxes(1, 2)
        blocks = -(-max(self.count - border, 1) // size)
        band = np.zeros((blocks, size, 3 * size))
        inner = (rows >= 0) & (columns >= 0)
        i, j = rows[inner], columns[inner]
        np.add.at(band, (i // size, i % size, (j // size - i // size + 1) * size + j % size), products[inner])
        rest = np.arange(self.count - border, blocks * size)
        band[rest // size, rest % size, size + rest % size] = 1.0  # functions that fill up the last block
        coupling, corner = np.zeros((blocks * size, border)), np.zeros((border, border))
        upper, within = (rows >= 0) & (columns < 0), (rows < 0) & (columns < 0)
        np.add.at(coupling, (rows[upper], columns[upper] + border), products[upper])
        np.add.at(corner, (rows[within] + border, columns[within] + border), products[within])
        sides = np.zeros((blocks * size, right.shape[1] + border))
        sides[: self.count - border, : right.shape[1]] = right[border:]
        sides[:, right.shape[1] :] = coupling
        found = solve_block_tridiagonal(band, sides.reshape(blocks, size, -1)).reshape(blocks * size, -1)
        found, reaction = found[:, : right.shape[1]], found[:, right.shape[1] :]
        first = np.linalg.solve(corner - coupling.T @ reaction, right[:border] - coupling.T @ found)
        return np.concatenate([first, (found - reaction @ first)[: self.count - border]])

    def as_curve(self) -> Curve:
        """Return all functions as the coordinates of one curve."""
        n, order = self.functions.shape
        coefs = np.zeros((order, self.count, n))
        coefs[:, self.functions.T, np.arange(n)] = self.tables
        return Curve(self.breaks, coefs, continuity=self.continuity)


def solve_block_tridiagonal(band: Array, right: Array) -> Array:
    """Solve a block tridiagonal system for (m, b, dim), by cyclic reduction.

    ``band`` (m, b, 3 b) has, for every block of rows, the columns of the block before, of itself, and of that after;
    ``right`` is (m, b, dim). Every second block is eliminated, all at once, until one is left.
    """
    size = band.shape[1]
    if len(band) == 1:
        return np.asarray(np.linalg.solve(band[:, :, size : 2 * size], right))
    before, itself, after = np.split(band[1::2], 3, axis=2)
    eliminated = np.linalg.solve(itself, np.concatenate([before, after, right[1::2]], axis=2))
    by_before, by_after, constant = np.split(eliminated, [size, 2 * size], axis=2)
    before, itself, after = np.split(band[::2], 3, axis=2)
    kept, rest = np.zeros_like(band[::2]), right[::2].copy()
    n, m = len(constant), len(kept) - 1  # blocks with one after them, and with one before them
    kept[:, :, size : 2 * size] = itself
    kept[:n, :, size : 2 * size] -= after[:n] @ by_before
    kept[1:, :, size : 2 * size] -= before[1:] @ by_after[:m]
    kept[1:, :, :size] = -before[1:] @ by_before[:m]
    kept[:n, :, 2 * size :] = -after[:n] @ by_after
    rest[:n] -= after[:n] @ constant
    rest[1:] -= before[1:] @ constant[:m]
    solution = np.empty_like(right)
    solution[::2] = found = solve_block_tridiagonal(kept, rest)
    solution[1::2] = constant - by_before @ found[:n]
    solution[1 : 2 * m : 2] -= by_after[:m] @ found[1:]
    return solution
