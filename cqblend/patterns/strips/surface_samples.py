"""Samples of the derivatives of stacked surfaces: whether these have an area, and how many strips they take at least.

Depends on splines only.
"""

from functools import lru_cache

import numpy as np

from cqblend.patterns.strips.surface_bands import PieceStack
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.splines.antiderivative import gauss_rule
from cqblend.splines.bernstein import Array, differentiate_coefs, evaluate_basis

_PLACES_ALONG = np.append(np.arange(8) / 8, 1.0 - 1e-9)
"""Places in u in every piece: up to just before the next one."""

_PLACES_ACROSS = 8
"""Number of places in v in every piece, those of Gauss's rule."""


class SurfaceSamples:
    """Normals and bends of stacked surfaces on a grid of 9 places in u and 8 in v in every piece.

    Parameters
    ----------
    stack
        k surfaces.
    """

    def __init__(self, stack: PieceStack) -> None:
        self.stack = stack
        p, q = (size - 1 for size in stack.coefs.shape[:2])
        rows = np.tensordot(
            _tabulate_derivatives(p, 1, tuple(_PLACES_ALONG)), stack.coefs, (1, 0)
        )  # (2, x, q+1, 4, nu, m)
        nodes = tuple(gauss_rule(_PLACES_ACROSS)[0])
        jets = np.tensordot(rows, _tabulate_derivatives(q, 2, nodes), (2, 1))  # (2, x, 4, nu, m, 3, y)
        (value, by_v, by_vv), by_u = np.moveaxis(jets[0], 4, 0), jets[1, ..., 0, :]  # (x, 4, nu, m, y)
        weight = value[:, 3:]
        self.points = value[:, :3] / weight
        su, sv = (_divide_weight(one, self.points, weight) for one in (by_u, by_v))
        svv = _divide_weight(by_vv, self.points, weight)  # but for a part along sv
        self.normals = np.cross(su, sv, axis=1)
        self.normal_lengths = np.linalg.norm(self.normals, axis=1)  # (x, nu, m, y)
        self.bends = (self.normals * svv).sum(axis=1)

    def have_area(self) -> Array:
        """Whether (k,) the surfaces have an area, and are not lines or points, or folded onto such."""
        breaks = [member.breaks for member in self.stack.members]
        pieces = np.repeat(np.arange(len(breaks)), np.diff(self.stack.offsets))
        across = np.array([(v[-1] - v[0]) for _, v in breaks])[pieces] / (self.stack.ends - self.stack.starts)
        along = np.array([(u[-1] - u[0]) / np.diff(u) for u, _ in breaks])[pieces].T  # (nu, m)
        areas = self._find_largest((self.normal_lengths * (across * along)[..., None]).max(axis=(0, 1, 3)))
        lows = np.minimum.reduceat(self.points.min(axis=(0, 2, 4)), self.stack.offsets[:-1], axis=1)
        highs = np.maximum.reduceat(self.points.max(axis=(0, 2, 4)), self.stack.offsets[:-1], axis=1)
        return areas > STRIP_TOLERANCES.degenerate_area * (highs - lows).max(axis=0) ** 2

    def estimate_ideal_counts(self, tolerance: float) -> Array:
        """N* (k,): the integral over v of max_u sqrt(|<n, S_vv>| / (8 tolerance)), by Gauss's rule on every piece."""
        longest = self._find_largest(self.normal_lengths.max(axis=(0, 1, 3)))
        pieces = np.repeat(np.arange(len(longest)), np.diff(self.stack.offsets))
        has_normal = self.normal_lengths > STRIP_TOLERANCES.pole_normal * longest[pieces, None]  # none at a pole
        bends = np.divide(self.bends, self.normal_lengths, out=np.zeros_like(self.bends), where=has_normal)
        widths = np.sqrt(np.abs(bends).max(axis=(0, 1)) / (8 * tolerance)) @ gauss_rule(_PLACES_ACROSS)[1]
        return np.add.reduceat(widths, self.stack.offsets[:-1])

    def _find_largest(self, values: Array) -> Array:
        """Return the largest of values (m,) of all pieces of every surface, (k,)."""
        return np.maximum.reduceat(values, self.stack.offsets[:-1])


@lru_cache(maxsize=64)
def _tabulate_derivatives(degree: int, order: int, places: tuple[float, ...]) -> Array:
    """Return derivatives up to an order of Bernstein polynomials at places in a piece, (order + 1, p + 1, n)."""
    x = np.array(places)
    out = np.zeros((order + 1, degree + 1, len(x)))
    rows = np.eye(degree + 1)
    for k in range(min(order, degree) + 1):
        out[k] = rows.T @ evaluate_basis(degree - k, 1 - x, x)
        rows = differentiate_coefs(rows)
    return out


def _divide_weight(rates: Array, points: Array, weight: Array) -> Array:
    """Return the derivatives of points from those of homogeneous ones, (x, 4, nu, m, y)."""
    return np.asarray((rates[:, :3] - rates[:, 3:] * points) / weight)
