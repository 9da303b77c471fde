"""Evaluates a tensor-product spline with all derivatives up to the second order at a few hundred scattered points.

Solvers ask for the same surface again and again, at so few points that the number of array operations counts, not that
of multiplications: coefficients are arranged once, and a point costs two small matrix products.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import JET_ORDERS

ORDERS_BY_U, ORDERS_BY_V = np.array(JET_ORDERS).T


@dataclass(frozen=True)
class PatchTable:
    """Coefficients of a spline, arranged for evaluation.

    ``coefs`` (patches, (q + 1) d, p + 1) are Bernstein coefficients of homogeneous coordinates about the ``centre``
    (3,), which keeps the rounding of derivatives small far from the origin; d is 3, or 4 if there are weights.
    """

    breaks: tuple[Array, Array]
    coefs: Array
    centre: Array
    degrees: tuple[int, int]

    @classmethod
    def from_patches(cls, breaks: tuple[Array, Array], patches: Array, *, rational: bool) -> PatchTable:
        """Arrange homogeneous coefficients (p + 1, q + 1, 4, nu, nv), whose weights are 1 if not rational."""
        p, q = patches.shape[0] - 1, patches.shape[1] - 1
        low, high = (f(patches[:, :, :3] / patches[:, :, 3:], axis=(0, 1, 3, 4)) for f in (np.min, np.max))
        centre = (low + high) / 2
        local = patches[:, :, : 4 if rational else 3].copy()
        local[:, :, :3] -= centre[:, None, None] * patches[:, :, 3:]
        rows = local.transpose(3, 4, 1, 2, 0)
        dim = rows.shape[3]
        return cls(breaks, np.ascontiguousarray(rows.reshape(-1, (q + 1) * dim, p + 1)), centre, (p, q))

    def evaluate_homogeneous(self, uv: Array) -> Array:
        """Return derivatives of homogeneous coordinates about the centre, (6, n, d), at parameters (n, 2).

        Outside the domain the end patches go on.
        """
        count, (p, q) = len(uv), self.degrees
        row, along_u = _tabulate_basis(self.breaks[0], p, uv[:, 0])
        column, along_v = _tabulate_basis(self.breaks[1], q, uv[:, 1])
        patches = self.coefs[row * (len(self.breaks[1]) - 1) + column]
        dim = self.coefs.shape[1] // (q + 1)
        by_u = (patches @ along_u.transpose(2, 1, 0)).reshape(count, q + 1, 3 * dim)
        both = (along_v.transpose(2, 0, 1) @ by_u).reshape(count, 3, dim, 3)  # (n, order by v, d, order by u)
        return both[:, ORDERS_BY_V, :, ORDERS_BY_U]

    def evaluate_jet(self, uv: Array) -> Array:
        """Return position and derivatives (6, n, 3) at parameters (n, 2)."""
        jet = self.evaluate_homogeneous(uv)
        if jet.shape[2] == 4:
            w, wu, wv, wuu, wuv, wvv = jet[:, :, 3:]
            s, su, sv, suu, suv, svv = jet = jet[:, :, :3] / w
            su -= s * (wu / w)
            sv -= s * (wv / w)
            suu -= su * (2 * wu / w) + s * (wuu / w)
            suv -= su * (wv / w) + sv * (wu / w) + s * (wuv / w)
            svv -= sv * (2 * wv / w) + s * (wvv / w)
        jet[0] += self.centre
        return jet


def _tabulate_basis(breaks: Array, degree: int, t: Array) -> tuple[Array, Array]:
    """Return the pieces of parameters t (n,), and Bernstein polynomials with two derivatives, (3, degree + 1, n)."""
    piece = breaks[1:-1].searchsorted(t, "right")
    start = breaks[piece]
    length = breaks[piece + 1] - start
    x = (t - start) / length
    s = 1 - x
    basis = np.zeros((3, degree + 1, len(t)))
    rows = [np.ones((1, len(t)))]  # of the degrees 0, 1, ..
    for k in range(1, degree + 1):
        wider = np.empty((k + 1, len(t)))
        np.multiply(rows[-1], s, out=wider[:-1])
        wider[-1] = 0.0
        wider[1:] += rows[-1] * x
        rows.append(wider)
    basis[0] = rows[degree]
    if degree > 0:
        slope = rows[degree - 1] * (degree / length)
        basis[1, 1:] = slope
        basis[1, :-1] -= slope
    if degree > 1:
        bend = rows[degree - 2] * (degree * (degree - 1) / length**2)
        basis[2, 2:] = bend
        basis[2, 1:-1] -= 2 * bend
        basis[2, :-2] += bend
    return piece, basis
