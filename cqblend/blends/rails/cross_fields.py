"""Cross directions of a fitted rail: Kim and Elber's fields T1 to T3 as numbers, on any primary.

A field tells, at each station, in which tangent direction a blend leaves its surface; a ribbon is then fitted to it in
the parameter plane (:mod:`cqblend.blends.rails.direction_fit`). Only directions count here: lengths are chosen apart
from them. On rails that are given, on splines, all five fields are those of :class:`cqblend.blends.rails.rail.Rail`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, normalise_vectors, to_tangent_coordinates

LEAST_TANGENT_SHARE = 1e-6  # share of a vector that is tangent, below which it has no tangent direction


@dataclass(frozen=True)
class RailStations:
    """Stations (n,) along one rail: the surface's native jet (6, n, 3), the rail's velocity, the way to the other rail.

    ``towards`` (n, 3) points from the rail to where the blend will be, ``chord_field`` (n, 3) to the other rail.
    """

    t: Array
    jet: Array
    velocity: Array
    towards: Array
    chord: Array


CrossField = Callable[[RailStations], Array]
"""The vectors (n, 3) of a cross direction, of any length; their projections on the tangent planes are meant."""


def perpendicular_field(at: RailStations) -> Array:
    """T2 = +-(C' x n): perpendicular to the rail in space, on the side of the blend on the whole."""
    return _orient_towards_blend(cross_product(at.velocity, normalise_vectors(cross_product(at.jet[1], at.jet[2]))), at)


def parametric_field(at: RailStations) -> Array:
    """T1 = +-(v' Su - u' Sv): perpendicular to the rail in the parameter plane."""
    rate = to_tangent_coordinates(at.jet, at.velocity)
    return _orient_towards_blend(rate[:, 1:] * at.jet[1] - rate[:, :1] * at.jet[2], at)


def chord_field(at: RailStations) -> Array:
    """T3: the way to the other rail."""
    return at.chord


def _orient_towards_blend(vectors: Array, at: RailStations) -> Array:
    """Turn a field, as a whole, to the side of the blend."""
    return vectors * (np.sign((vectors * at.towards).sum()) or 1.0)


def compute_unit_directions(field: CrossField, at: RailStations) -> Array:
    """Return the unit tangent vectors (n, 3) of a field.

    Raises
    ------
    GeometryError
        If the field vanishes or stands on the surface somewhere.
    """
    n = normalise_vectors(cross_product(at.jet[1], at.jet[2]))
    vectors = field(at)
    flat = vectors - (vectors * n).sum(1, keepdims=True) * n
    length = np.linalg.norm(flat, axis=1)
    if not np.all(length > LEAST_TANGENT_SHARE * np.linalg.norm(vectors, axis=1)):
        raise GeometryError(
            f"the cross direction at t = {at.t[length.argmin()]:.6g} is zero or normal to the surface: it has no "
            "tangent part; choose other tangents"
        )
    return flat / length[:, None]
