"""Curves that depend on unknowns: every coefficient is a constant and a linear function of them.

Such a curve, of dim D and with n unknowns, is a spline of dim D (1 + n): for each component the constant and then the
factors of all unknowns. So the algebra of splines applies to it, and a number that depends on unknowns is an array
whose last axis has 1 + n columns. Knows splines only.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cqblend.splines import Curve, bernstein, interpolation
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import align_breaks
from cqblend.splines.evaluation import BreakSide
from cqblend.splines.tolerances import SPLINE_TOLERANCES


class Unknowns:
    """The unknowns of a corner, handed out in order."""

    def __init__(self, count: int) -> None:
        self.columns = 1 + count
        self._taken = 0

    def take(self, *shape: int) -> Array:
        """Return the next unknowns, as an array (.., columns)."""
        count = int(np.prod(shape))
        rows = np.zeros((count, self.columns))
        rows[np.arange(count), 1 + self._taken + np.arange(count)] = 1.0
        self._taken += count
        return rows.reshape(*shape, self.columns)

    def hold(self, value: Array) -> Array:
        """Return a given array as one that depends on no unknown, (.., columns)."""
        out = np.zeros((*np.shape(value), self.columns))
        out[..., 0] = value
        return out

    def hold_curve(self, curve: Curve) -> Curve:
        """Return a given curve as one that depends on no unknown."""
        degrees, dim, pieces = curve.coefs.shape
        out = np.zeros((degrees, dim, self.columns, pieces))
        out[:, :, 0] = curve.coefs
        return Curve(curve.breaks, out.reshape(degrees, -1, pieces), continuity=curve.continuity)

    def evaluate(self, curve: Curve, t: float, order: int = 0, side: BreakSide = "right") -> Array:
        """Return a derivative of an affine curve at t, (D, columns)."""
        return np.asarray(curve(np.array([t]), order, side=side).reshape(-1, self.columns))

    def combine_fields(self, factors: Curve, fields: Sequence[Curve]) -> Curve:
        """Return the sum of fields (K) times scalar functions that are the components of an affine curve (dim K)."""
        aligned = align_breaks([factors, *fields], SPLINE_TOLERANCES.same_break)
        scalars, splines = aligned[0], aligned[1:]
        degree, pieces = max(one.degree for one in splines), len(scalars.breaks) - 1
        coefs = np.stack([one.elevate(degree - one.degree).coefs for one in splines], axis=1)
        dim = coefs.shape[2]
        numbers = scalars.coefs.reshape(-1, len(splines), 1, self.columns, pieces)
        product = bernstein.multiply_polynomials(numbers, coefs[:, :, :, None])
        order = np.min([one.continuity for one in aligned], axis=0)
        total = product.sum(axis=1).reshape(len(product), dim * self.columns, pieces)
        return Curve(scalars.breaks, total, continuity=order)


def interpolate_jets(breaks: Array, jets: Array) -> Curve:
    """Return the affine curve of least degree with given derivatives (k + 1, n + 1, D, columns) at its breaks."""
    return interpolation.hermite(breaks, jets.reshape(*jets.shape[:2], -1))


def interpolate_between(start: Sequence[Array], stop: Sequence[Array]) -> Curve:
    """Return the affine curve on [0, 1] with given derivatives (D, columns) at its ends, of which one may have more."""
    low, high = len(start), len(stop)
    degree = low + high - 1
    coefs = np.empty((degree + 1, *start[0].shape))
    for given, sign, index in ((start, 1.0, range(low)), (stop, -1.0, range(degree, degree - high, -1))):
        places = list(index)
        for k, place in enumerate(places):
            # the k-th difference from this end is the k-th derivative times (degree - k)! / degree!
            factor = float(np.prod(np.arange(degree - k + 1, degree + 1))) * sign**k
            row = bernstein.tabulate_binomials((k,), 0, False) * (-1.0) ** (k - np.arange(k + 1))
            before = sum((row[j] * coefs[places[j]] for j in range(k)), np.zeros_like(start[0]))
            coefs[place] = given[k] / factor - before
    return Curve.bezier(coefs.reshape(degree + 1, -1))
