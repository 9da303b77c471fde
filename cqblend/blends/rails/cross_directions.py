"""Computes the cross directions of rails fitted to contacts: Kim and Elber's fields T1 to T3, on any primary surface.

A field gives, at each station, the tangent direction in which a blend leaves its surface; ribbons are then fitted to it
in the parameter plane (:mod:`cqblend.blends.rails.direction_fit`). Only directions count here: lengths come from the
contacts. On rails that are given, on splines, all five fields are exact curves: those of
:class:`cqblend.blends.rails.rail.Rail`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cqblend.blends.contacts.surface_normals import differentiate_normal
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, measure_lengths, normalise_vectors, to_tangent_coordinates


@dataclass(frozen=True)
class RailStations:
    """Stations at ``t`` (n,) along one rail, with what the fields need there.

    ``jet`` (6, n, 3) is the native jet of the surface, ``velocity`` (n, 3) the derivative of the rail in space,
    ``towards_blend`` (n, 3) points from the rail to the edge point, and ``chord`` (n, 3) to the other rail.
    """

    t: Array
    jet: Array
    velocity: Array
    towards_blend: Array
    chord: Array

    @cached_property
    def normals(self) -> Array:
        """Unit normals of the surface, (n, 3)."""
        return normalise_vectors(cross_product(self.jet[1], self.jet[2]))


CrossField = Callable[[RailStations], Array]
"""A function from stations to vectors (n, 3) of any length, whose projections on the tangent planes are the field."""


def perpendicular_field(stations: RailStations) -> Array:
    """T2 = +-(C' x n): perpendicular to the rail in space, on the side of the blend on the whole."""
    return _orient_towards_blend(cross_product(stations.velocity, stations.normals), stations)


def parametric_field(stations: RailStations) -> Array:
    """T1 = +-(v' Su - u' Sv): perpendicular to the rail in the parameter plane."""
    rate = to_tangent_coordinates(stations.jet, stations.velocity)
    return _orient_towards_blend(rate[:, 1:] * stations.jet[1] - rate[:, :1] * stations.jet[2], stations)


def chord_field(stations: RailStations) -> Array:
    """T3: the direction to the other rail."""
    return stations.chord


@dataclass(frozen=True)
class BallField:
    """T = +-(m' x n): along the circle in which a ball of varying radius R(t) touches its envelope, m its centre.

    That circle lies in the plane square to m', the path of the centre; the contacts on both surfaces are points of it.
    As m = C + R n, with the normal n towards the ball, m' x n = (C' + R n') x n. If R is constant along a plane or
    around an axis, T is perpendicular to the rail.
    """

    measure_radii: Callable[[Array], Array]
    """The radii (n,) at t (n,), mm."""

    def __call__(self, stations: RailStations) -> Array:
        """Return the vectors (n, 3) of the field at stations."""
        normals, by_u, by_v = differentiate_normal(stations.jet)
        sign = np.sign((normals * stations.chord).sum()) or 1.0  # the other contact is on the ball's side
        r, s = to_tangent_coordinates(stations.jet, stations.velocity).T[..., None]
        reach = sign * self.measure_radii(stations.t)[:, None]
        return _orient_towards_blend(
            cross_product(stations.velocity + reach * (by_u * r + by_v * s), normals), stations
        )


def measure_arc_lengths(directions: Array, chords: Array) -> Array:
    """Return the lengths (n,) of the derivatives at the start of circular arcs with these chords (n, 3).

    ``directions`` (n, 3) are the unit tangents there. Of an arc of radius r and angle Theta, it is 4 r tan(Theta / 4):
    that of the cubic that is nearest to the arc. As Theta / 2 is the angle between tangent and chord d, that is
    2 |d| / (1 + cos(Theta / 2)).
    """
    lengths = measure_lengths(chords)
    sums = lengths + (directions * chords).sum(axis=1)
    return 2 * lengths**2 / sums


def _orient_towards_blend(vectors: Array, stations: RailStations) -> Array:
    """Return a field, or its negative, whichever points to the blend at most stations by the sum of its vectors.

    A rail that is one point has no direction across it, so that the field is the one straight to the edge.
    """
    sizes = [float(measure_lengths(one).max()) for one in (stations.velocity, stations.towards_blend)]
    if sizes[0] <= RAIL_TOLERANCES.point_rail_share * sizes[1]:
        return stations.towards_blend
    return vectors * (np.sign((vectors * stations.towards_blend).sum()) or 1.0)


def compute_unit_directions(field: CrossField, stations: RailStations) -> Array:
    """Return the unit tangent vectors (n, 3) of a field.

    Raises
    ------
    GeometryError
        If the field vanishes or is normal to the surface somewhere.
    """
    n, vectors = stations.normals, field(stations)
    flat = vectors - (vectors * n).sum(1, keepdims=True) * n
    length = measure_lengths(flat)
    if not (length > RAIL_TOLERANCES.least_tangent_share * measure_lengths(vectors)).all():
        raise GeometryError(
            f"the cross direction at t = {stations.t[length.argmin()]:.6g} is zero or normal to the surface: it has no "
            "tangent part; choose other tangents"
        )
    return flat / length[:, None]
