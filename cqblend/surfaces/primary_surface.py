"""The interface of primary surfaces, from which a blend leaves: evaluated as numbers, and composed with rails exactly.

A blend needs two things of the surface it leaves from. Numbers, for the solvers: position and derivatives at many
points, in the *native* parameters (u, v) of the CAD surface (angles on a cylinder). And splines, for the result: the
exact spline S(c(t)) of a rail and the exact tangent field along it.

The splines are made in *lifted* parameters, homogeneous coordinates c in which the surface is a polynomial map P into
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
plane. Adding a multiple of c to d changes no direction in space, only the derivative dw/dv of the homogeneous weight
across the rail (the *gauge* of the direction); :meth:`Primary.lift_directions` chooses it so that dw/dv = 0 there.

The interface is here; the kinds of surface are in :mod:`~cqblend.surfaces.quadrics`,
:mod:`~cqblend.surfaces.tensor_surface` and :mod:`~cqblend.surfaces.revolved_surfaces`.
:mod:`cqblend.brep.conversion.support_face` reads a face of OCCT into one of them.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.motions import Motion
from cqblend.surfaces.vectors import cross_product, normalise_vectors

JET_ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
"""Orders by u and v of the partial derivatives in a native jet: S, Su, Sv, Suu, Suv, Svv."""


class KnotCrossing(NamedTuple):
    """A point at which a rail crosses a knot line of its surface."""

    t: float
    """Parameter of the rail."""
    axis: int
    """Which native parameter is constant along the knot line: 0 for u, 1 for v."""
    value: float
    """Its value there."""
    continuity: int
    """Order of continuity of the parametrisation at this very point, up to 4."""
    shape_continuity: int
    """Order of continuity of the shape, up to 4: it may be smooth where its parameters have a kink."""
    crease: float
    """Angle by which the normal turns there, rad."""

    def is_parametric_kink(self, order: int) -> bool:
        """Whether derivatives up to an order have a kink here to which the parametrisation contributes."""
        return self.continuity <= order and self.continuity < self.shape_continuity


class Primary(ABC):
    """A surface that a blend leaves from."""

    periods: tuple[float | None, float | None] = (None, None)
    """Periods of the native parameters, None where there is none."""

    @abstractmethod
    def jet(self, uv: Array) -> Array:
        """Return position and derivatives (6, n, 3), in the order of ``JET_ORDERS``, at native parameters (n, 2)."""

    @abstractmethod
    def lift_points(self, uv: Array) -> Array:
        """Lift native parameters (n, 2) to points c (n, k) such that the homogeneous weight of P(c) is 1.

        Where the parameters are consecutive points of a continuous curve, so are the lifted ones.
        """

    @abstractmethod
    def lift_directions(self, uv: Array, c: Array, rs: Array) -> Array:
        """Lift the directions r Su + s Sv, (n, 2), at lifted points c (n, k), such that dw/dv = 0 for P(c + v d)."""

    @abstractmethod
    def unlift_points(self, c: Array, near: Array) -> Array:
        """Return the native parameters (n, 2) of lifted points c (n, k).

        Parameters
        ----------
        c
            Lifted points.
        near
            (n, 2) native parameters: of all periods, the one next to these is taken.
        """

    @abstractmethod
    def unlift_directions(self, c: Array, d: Array) -> Array:
        """Return (r, s), (n, 2), of lifted directions d (n, k) at lifted points c (n, k).

        r Su + s Sv is the derivative of the point P(c + v d) by v, in space.
        """

    @property
    @abstractmethod
    def weight_exponents(self) -> Array:
        """Exponents e (k,) such that P(w^e c) = w P(c), by which lifted points are scaled to a homogeneous weight."""

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

        It is computed from coefficients about a centre near the rail, which limits cancellation: the rounding does not
        grow with the distance from the origin.

        Parameters
        ----------
        c
            The rail, lifted.
        """

    def carry_parameters(self, uv: Array, motion: Motion, amounts: Array) -> Array | None:
        """Return the native parameters (n, 2) of a point (2,) that is moved by amounts (n,).

        None if the surface is not known to be mapped onto itself.
        """
        return None

    def scale_weight(self, c: Array, weight: Array) -> Array:
        """Scale lifted points (n, k) so that the homogeneous weight of P(c) is multiplied by ``weight`` (n,)."""
        return c * weight[:, None] ** self.weight_exponents

    def compose_position(self, c: Curve) -> Curve:
        """Return P(c(t)), exact, in homogeneous 4-space."""
        return self.compose_jets(c, ())[0]

    def inner_knot_lines(self, axis: int) -> Array:
        """Return the inner knot lines of a native parameter."""
        return np.empty(0)

    def find_knot_crossings(self, c: Curve, highest_continuity: int) -> list[KnotCrossing]:
        """Return where a lifted rail crosses knot lines at points of at most this continuity, in the order of t."""
        return []

    def has_exact_pcurves(self) -> bool:
        """Whether native parameters are quotients of lifted ones, so that a rail's pcurve needs no fit."""
        return False

    def evaluate_normals(self, uv: Array) -> Array:
        """Return unit normals Su x Sv / |Su x Sv|, (n, 3)."""
        jet = self.jet(uv)
        return normalise_vectors(cross_product(jet[1], jet[2]))
