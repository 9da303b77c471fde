r"""Bicubically blended Coons patches whose boundaries depend on unknowns, and the energy that tells the best of them.

With the cubic Hermite functions h_k, k = 0 .. 3 for value and derivative at 0, derivative and value at 1,

.. math:: Q(u, v) = \sum_k r_k(u) h_k(v) + \sum_l c_l(v) h_l(u) - \sum_{k,l} t_{kl} h_l(u) h_k(v),

r and c the values and cross derivatives along the four sides, t the values and derivatives of r at its ends, which must
be those of c. Everything is restricted to knot intervals: Q has the knots of r along u and those of c along v.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import comb

import numpy as np

from cqblend.blends.corners.affine_curves import Unknowns
from cqblend.blends.corners.tolerances import CORNER_TOLERANCES
from cqblend.splines import Curve, interpolation
from cqblend.splines.bernstein import Array, differentiate_coefs
from cqblend.splines.breaks import align_breaks
from cqblend.splines.tolerances import SPLINE_TOLERANCES

_HERMITE = Curve.bezier(interpolation.tabulate_hermite_basis(1).reshape(4, 4)[:, [0, 1, 3, 2]])
"""The functions h_k as the components of one curve."""


@dataclass(frozen=True)
class CoonsBoundary:
    """The boundary of a patch, affine curves on [0, 1].

    ``rows`` are functions of u: Q and Q_v at v = 0, then Q_v and Q at v = 1. ``columns`` are those of v: Q and Q_u at
    u = 0, then Q_u and Q at u = 1.
    """

    rows: tuple[Curve, Curve, Curve, Curve]
    columns: tuple[Curve, Curve, Curve, Curve]


@dataclass(frozen=True)
class AffinePatch:
    """A patch that depends on unknowns: its breaks, and coefficients (p + 1, q + 1, D, columns, nu, nv)."""

    breaks: tuple[Array, Array]
    coefs: Array

    @classmethod
    def from_boundary(cls, boundary: CoonsBoundary, unknowns: Unknowns) -> AffinePatch:
        """Return the Coons patch of a boundary."""
        rows, along = _align_bundle(boundary.rows)
        columns, across = _align_bundle(boundary.columns)
        corners = np.stack([_list_end_jets(row) for row in boundary.rows])  # (k, l, D columns)
        columns = columns - np.einsum("kle,qkn->qlen", corners, across.coefs)[:, :, :, :]
        first = np.einsum("pkem,qkn->pqemn", rows, across.coefs)
        second = np.einsum("plm,qlen->pqemn", along.coefs, columns)
        coefs = first + second
        p, q, _, nu, nv = coefs.shape
        return cls((along.breaks, across.breaks), coefs.reshape(p, q, -1, unknowns.columns, nu, nv))

    def measure_energy(self) -> Array:
        r"""Return the symmetric matrix (columns, columns) of :math:`\int |D^3 Q|^2 + \mu |D^2 Q|^2 du dv`."""
        coefs = np.moveaxis(self.coefs, 3, -1)  # (p+1, q+1, D, nu, nv, columns)
        weight = CORNER_TOLERANCES.bending_weight
        lengths = np.diff(self.breaks[0]), np.diff(self.breaks[1])
        total = np.zeros((coefs.shape[-1], coefs.shape[-1]))
        flat = coefs.reshape(-1, coefs.shape[-1])
        for k in range(4):
            across = sum(
                factor * comb(order, k) * _tabulate_products(coefs.shape[1] - 1, order - k, tuple(lengths[1].tolist()))
                for order, factor in ((3, 1.0), (2, weight))
                if order >= k
            )
            along = _tabulate_products(coefs.shape[0] - 1, k, tuple(lengths[0].tolist()))
            half = np.einsum("mip,pqdmnc->iqdmnc", along, coefs, optimize=True)
            whole = np.einsum("njq,iqdmnc->ijdmnc", across, half, optimize=True)
            total += flat.T @ whole.reshape(-1, coefs.shape[-1])
        return total


def _align_bundle(curves: Sequence[Curve]) -> tuple[Array, Curve]:
    """Return curves on common breaks and of a common degree, (p + 1, 4, D columns, n), and h_k, as high, on these."""
    aligned = align_breaks([*curves, _HERMITE], SPLINE_TOLERANCES.same_break)
    degree = max(one.degree for one in aligned)
    raised = [one.elevate(degree - one.degree) for one in aligned]
    return np.stack([one.coefs for one in raised[:-1]], axis=1), raised[-1]


def _list_end_jets(curve: Curve) -> Array:
    """Return value and derivative at 0, derivative and value at 1, (4, dim)."""
    start, leaving = curve.jet(np.zeros(1), 1, side="right")[:, 0]
    stop, arriving = curve.jet(np.ones(1), 1, side="left")[:, 0]
    return np.stack([start, leaving, arriving, stop])


@lru_cache(maxsize=256)
def _tabulate_products(degree: int, order: int, lengths: tuple[float, ...]) -> Array:
    """Return integrals of products of derivatives of the Bernstein basis over n intervals, (n, p + 1, p + 1)."""
    lowered = degree - order
    if lowered < 0:
        return np.zeros((len(lengths), degree + 1, degree + 1))
    derive = np.eye(degree + 1)
    for _ in range(order):
        derive = differentiate_coefs(derive)
    i = np.arange(lowered + 1)
    binomials = np.array([comb(lowered, int(one)) for one in i], dtype=float)
    sums = np.array([comb(2 * lowered, int(one)) for one in range(2 * lowered + 1)], dtype=float)
    gram = np.multiply.outer(binomials, binomials) / sums[i[:, None] + i] / (2 * lowered + 1)
    unit = derive.T @ gram @ derive
    return np.stack([unit * length ** (1 - 2 * order) for length in lengths])
