"""Primary surfaces as a blend sees them: numerically in their own parameters, symbolically through lifted ones.

A blend needs two things of the surface it leaves from. Numbers, for the solvers: position and derivatives at many
points, in the *native* parameters (u, v) of the CAD surface (angles on a cylinder). And symbols, for the result: the
exact spline S(c(t)) of a rail and the exact tangent field along it.

The symbols use *lifted* parameters, homogeneous coordinates c in which the surface is a polynomial map P into
homogeneous 4-space and has neither seams nor knot lines that its geometry does not have:

===============  =====================================  ========================
surface          lifted coordinates c                   degree of P(c), c cubic
===============  =====================================  ========================
plane            (u, v, w)                              3
cylinder, cone   half-angle pair (a, b) and a length    6
sphere           unit quaternion                        6
torus, ring      two half-angle pairs                   12
revolution       half-angle pair, (gamma, delta)        6 + 3 q
spline (p, q)    barycentric pairs of u and of v        3 (p + q)
===============  =====================================  ========================

*Every* curve c(t) of lifted coordinates lies on the surface, and with *every* lifted direction d(t) the field DP(c) d
is tangent to it: approximation errors in c and d move a rail or turn a direction, never take the blend off the tangent
plane. A component of d along c itself is the scalar gauge of a rational Hermite blend; :meth:`Primary.lift_directions`
chooses it so that the weight starts flat.

The interface is here; the kinds of surface are in :mod:`~cqblend.surfaces.quadrics`,
:mod:`~cqblend.surfaces.tensor_surface` and :mod:`~cqblend.surfaces.revolved_surfaces`.
:mod:`cqblend.brep.read.face_surface` reads a face of OCCT into one of them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, normalise_vectors

# Order of the partial derivatives in a native jet: S, Su, Sv, Suu, Suv, Svv.
JET_ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


class KnotCrossing(NamedTuple):
    """Where a rail crosses a knot line: at t, the line native parameter ``axis`` = ``value``.

    ``continuity`` is that of the surface at this very point, ``shape_continuity`` that of its shape, which may be
    smooth where parameters have a kink; both counted up to 4. ``crease`` is the angle by which its normal turns there,
    rad.
    """

    t: float
    axis: int
    value: float
    continuity: int
    shape_continuity: int
    crease: float

    def is_parametric_kink(self, order: int) -> bool:
        """Whether jets of an order have a kink here that is one of the parameters alone, at least in part."""
        return self.continuity <= order and self.continuity < self.shape_continuity


class Primary(ABC):
    """A surface that a blend leaves from. ``periods`` are those of the native parameters, None where there is none."""

    periods: tuple[float | None, float | None] = (None, None)

    @abstractmethod
    def jet(self, uv: Array) -> Array:
        """Return position and derivatives (6, n, 3), in the order of ``JET_ORDERS``, at native parameters (n, 2)."""

    @abstractmethod
    def lift_points(self, uv: Array) -> Array:
        """Lift native parameters (n, 2), continuous along a curve, to (n, k), continuous along it and of weight 1."""

    @abstractmethod
    def lift_directions(self, uv: Array, c: Array, rs: Array) -> Array:
        """Lift the directions r Su + s Sv, (n, 2), at lifted points c (n, k), with the gauge that keeps the weight."""

    @abstractmethod
    def unlift_points(self, c: Array, near: Array) -> Array:
        """Return the native parameters (n, 2) of lifted points (n, k), in the period next to ``near`` (n, 2)."""

    @property
    @abstractmethod
    def weight_exponents(self) -> Array:
        """Exponents (k,) with P(w^powers c) = w P(c): by them lifted points are scaled to a homogeneous weight."""

    @abstractmethod
    def compose_jets(self, c: Curve, directions: Sequence[Curve], order: int | None = None) -> tuple[Curve, ...]:
        """Return the derivatives by v, at v = 0, of P(c + v d + v^2/2 e + ..) along a rail.

        Parameters
        ----------
        c
            The rail, lifted.
        directions
            d, e, ..: as many derivatives of the lifted ribbon as there are; higher ones are zero.
        order
            The highest derivative, by default as many as there are directions.

        Returns
        -------
        tuple of Curve
            By order, exact, splines in homogeneous 4-space (dim 4, not flagged rational).
        """

    @abstractmethod
    def compose_normal(self, c: Curve) -> Curve:
        """Return a normal of the tangent plane along a rail: an exact spline (dim 3), of any sign and length.

        It is worked out beside the rail, so that its rounding does not grow with the distance from the origin.

        Parameters
        ----------
        c
            The rail, lifted.
        """

    def scale_weight(self, c: Array, weight: Array) -> Array:
        """Scale lifted points (n, k) so that the homogeneous weight of P(c) is multiplied by ``weight`` (n,)."""
        return c * weight[:, None] ** self.weight_exponents

    def compose_position(self, c: Curve) -> Curve:
        """Return P(c(t)), exact, in homogeneous 4-space."""
        return self.compose_jets(c, ())[0]

    def inner_knot_lines(self, axis: int) -> Array:
        """Return the inner knot lines of a native parameter."""
        return np.empty(0)

    def find_knot_crossings(self, c: Curve, most: int) -> list[KnotCrossing]:
        """Return where a rail crosses knot lines at points where the surface is C``most`` or less, along the rail."""
        return []

    def has_exact_pcurves(self) -> bool:
        """Whether a rail's native curve is the lifted one, so that a pcurve can be taken from it without fitting."""
        return False

    def evaluate_normals(self, uv: Array) -> Array:
        """Return unit normals Su x Sv / |Su x Sv|, (n, 3)."""
        jet = self.jet(uv)
        return normalise_vectors(cross_product(jet[1], jet[2]))
