"""Signed distances of points from surfaces for which there is a formula: planes, quadrics of revolution and tori."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from OCP.Geom import (
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_Plane,
    Geom_SphericalSurface,
    Geom_Surface,
    Geom_ToroidalSurface,
)

from cqblend.splines.bernstein import Array


def find_distance(surface: Geom_Surface) -> Callable[[Array], Array] | None:
    """Return the function that measures how far points (n, 3) are from a plane, a quadric of revolution or a torus.

    Negative on one side. None for any other surface.
    """
    if not isinstance(
        surface,
        Geom_Plane | Geom_CylindricalSurface | Geom_SphericalSurface | Geom_ConicalSurface | Geom_ToroidalSurface,
    ):
        return None
    position = surface.Position()
    origin, axis = np.array(position.Location().Coord()), np.array(position.Direction().Coord())

    def measure_from_axis(points: Array) -> tuple[Array, Array]:
        heights = (points - origin) @ axis
        return np.linalg.norm(points - origin - heights[:, None] * axis, axis=1), heights

    if isinstance(surface, Geom_Plane):
        return lambda points: np.asarray((points - origin) @ axis)
    if isinstance(surface, Geom_SphericalSurface):
        return lambda points: np.linalg.norm(points - origin, axis=1) - surface.Radius()
    if isinstance(surface, Geom_CylindricalSurface):
        return lambda points: measure_from_axis(points)[0] - surface.Radius()
    if isinstance(surface, Geom_ToroidalSurface):

        def measure_from_torus(points: Array) -> Array:
            distances, heights = measure_from_axis(points)
            return np.asarray(np.hypot(distances - surface.MajorRadius(), heights) - surface.MinorRadius())

        return measure_from_torus
    sine, cosine = np.sin(surface.SemiAngle()), np.cos(surface.SemiAngle())

    def measure_from_cone(points: Array) -> Array:
        distances, heights = measure_from_axis(points)
        both = [(sign * distances - surface.RefRadius()) * cosine - heights * sine for sign in (1.0, -1.0)]
        return np.asarray(np.where(np.abs(both[0]) < np.abs(both[1]), both[0], both[1]))

    return measure_from_cone
