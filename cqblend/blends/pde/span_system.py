"""Least-squares systems whose rows belong to spans along, each of which few functions reach: solved span by span.

A B-spline of degree p is zero but on p + 1 spans. Once the rows of a span are reduced to a triangle, the functions that
end there occur in no later row: they are set aside, and the triangle of the others goes on to the next span. So the
work grows with the number of spans, and not with its cube. Knows no equations.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class SpanSystem:
    """A least-squares system for m unknowns of each of the free functions along, with c right sides.

    Attributes
    ----------
    blocks : numpy.ndarray
        (spans, rows, width, m) the rows of each span, for the ``width`` functions from the span's own number on.
    rights : numpy.ndarray
        (spans, rows, c).
    free : numpy.ndarray
        (count,) bool, which functions have unknowns. Only one block may have all functions, with no limit to its rows.
    """

    blocks: Array
    rights: Array
    free: Array

    @cached_property
    def solution(self) -> Array:
        """The unknowns (count, m, c) with the least sum of squares; 0 for functions that are not free."""
        sizes = self._column_sizes
        unknowns = np.zeros((len(self.free), self.blocks.shape[3], self.rights.shape[2]))
        for leaving, staying, triangle in reversed(self._eliminate(sizes)):
            _, m, c = unknowns.shape
            k, n = len(leaving) * m, (len(leaving) + len(staying)) * m
            known = (unknowns[staying] * sizes[staying, :, None]).reshape(-1, c)
            scaled = np.linalg.solve(triangle[:k, :k], triangle[:k, n:] - triangle[:k, k:n] @ known)
            unknowns[leaving] = scaled.reshape(-1, m, c) / sizes[leaving, :, None]
        return unknowns

    @cached_property
    def solution_norm(self) -> Array:
        """The norm (c,) of what the solution takes from the right side."""
        total = np.zeros(self.rights.shape[2])
        for span, block in enumerate(self.blocks):
            functions = slice(span, span + block.shape[1])
            total += (np.einsum("rjm,jmc->rc", block, self.solution[functions], optimize=True) ** 2).sum(axis=0)
        return np.asarray(np.sqrt(total))

    @property
    def _column_sizes(self) -> Array:
        """The norms (count, m) of the columns, 1 where they are 0."""
        squares = np.zeros((len(self.free), self.blocks.shape[3]))
        for span, block in enumerate(self.blocks):
            squares[span : span + block.shape[1]] += (block**2).sum(axis=0)
        return np.sqrt(np.where(squares > 0, squares, 1.0))

    def _eliminate(self, sizes: Array) -> list[tuple[Array, Array, Array]]:
        """Return for each span the functions that end there, those that go on, and the triangle and right side of both.

        Columns are divided by ``sizes`` (count, m).
        """
        m, c = self.blocks.shape[3], self.rights.shape[2]
        going_on, triangle = np.empty(0, dtype=int), np.empty((0, c))
        steps = []
        for span, (block, right) in enumerate(zip(self.blocks, self.rights, strict=True)):
            functions = np.arange(span, span + block.shape[1])
            kept = self.free[functions]
            own = (block / sizes[functions])[:, kept].reshape(len(block), -1)
            functions = functions[kept]
            carried = np.zeros((len(triangle), own.shape[1] + c))
            k = len(going_on) * m  # they are the first of this span's functions
            carried[:, :k], carried[:, -c:] = triangle[:, :k], triangle[:, k:]
            triangle = np.asarray(np.linalg.qr(np.concatenate([carried, np.hstack([own, right])]), mode="r"))
            last = span == len(self.blocks) - 1
            leaving = functions if last else functions[functions == span]
            going_on = functions[len(leaving) :]
            if len(leaving):
                steps.append((leaving, going_on, triangle))
            triangle = triangle[len(leaving) * m : len(functions) * m, len(leaving) * m :]
        return steps
