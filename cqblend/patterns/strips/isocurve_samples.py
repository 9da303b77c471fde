"""Deviations of bands sampled along isoparametric curves, of many candidates at once, to search for the ends of strips.

What is found is proven afterwards (:mod:`cqblend.patterns.strips.ruled_deviation`). Depends on splines only.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from cqblend.patterns.strips.ruled_deviation import offset_from_segments
from cqblend.patterns.strips.surface_bands import PieceStack, sample_basis
from cqblend.splines.bernstein import Array, evaluate_basis

_INNER_FRACTIONS = np.arange(1, 12) / 12
"""Of the interval of v of a band, at which its deviation is sampled."""


@dataclass(frozen=True, slots=True, eq=False)
class IsocurveSamples:
    """Isoparametric curves u = const of stacked surfaces on a grid of u.

    Attributes
    ----------
    stack
        The surfaces.
    coefs
        (m, q+1, 4, n) homogeneous coefficients in v, of the pieces of n curves of each.
    """

    stack: PieceStack
    coefs: Array

    @classmethod
    def from_stack(cls, stack: PieceStack) -> "IsocurveSamples":
        """Sample surfaces at 2 p + 1 parameters u in every piece."""
        rows = np.tensordot(sample_basis(len(stack.coefs) - 1), stack.coefs, (0, 0))  # (x, q+1, 4, nu, m)
        rows = rows.transpose(4, 1, 2, 3, 0)
        return cls(stack, rows.reshape(*rows.shape[:3], -1))

    def find_poles(self, member: int) -> Array:
        """Return the control points (nv, q+1, 3, n) of the curves of a surface, by its index."""
        rows = self.coefs[self.stack.offsets[member] : self.stack.offsets[member + 1]]
        return np.asarray(rows[:, :, :3] / rows[:, :, 3:])

    def evaluate_points(self, member: Array, v: Array) -> Array:
        """Return the points (k, .., 3, n) of the curves of k surfaces, by their index, at parameters v (k, ..)."""
        at = v.reshape(len(member), -1)
        inner = (self.stack.inner_breaks[member][:, None] <= at[..., None]).sum(axis=-1)
        piece = (self.stack.offsets[member][:, None] + inner).ravel()
        start, end = self.stack.starts[piece], self.stack.ends[piece]
        x = (at.ravel() - start) / (end - start)
        values = evaluate_basis(self.coefs.shape[1] - 1, 1 - x, x).T
        found = np.empty((len(x), self.coefs.shape[2] * self.coefs.shape[3]))
        order = np.argsort(piece, kind="stable")
        bounds = [0, *(np.flatnonzero(np.diff(piece[order])) + 1).tolist(), len(x)]
        for first, last in pairwise(bounds):  # one product for every piece
            here = order[first:last]
            found[here] = values[here] @ self.coefs[piece[here[0]]].reshape(values.shape[1], -1)
        points = found.reshape(*v.shape, 4, -1)
        return np.asarray(points[..., :3, :] / points[..., 3:, :])

    def sample_deviations(self, member: Array, starts: Array, ends: Array) -> Array:
        """Return the deviations (k, n), mm, of the bands of k surfaces from v = starts (k,) to each of ends (k, n).

        Feet do not turn back. Infinite where the rails coincide.
        """
        steps = (ends - starts[:, None])[..., None] * np.append(0.0, _INNER_FRACTIONS)
        v = np.concatenate([starts[:, None, None] + steps, ends[..., None]], axis=-1)
        points = self.evaluate_points(member, v)  # (k, n, 13, 3, curves)
        first, inner, last = points[:, :, :1], points[:, :, 1:-1], points[:, :, -1:]
        off = offset_from_segments(inner, first, last, 3, monotone_axis=2)
        found = np.sqrt((off * off).sum(axis=3).max(axis=(2, 3)))
        return np.where((first != last).any(axis=(2, 3, 4)), found, np.inf)
