"""Unit normals of surfaces with their first derivatives: what Newton's method needs for offset points and balls."""

from __future__ import annotations

import numpy as np

from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product


def differentiate_normal(jet: Array) -> tuple[Array, Array, Array]:
    """Return the unit normal and its two derivatives, each (n, 3), of a native jet."""
    if not np.all(np.linalg.norm(cross_product(jet[1], jet[2]), axis=1) > 0):
        raise GeometryError("a face is singular under the blend: its partial derivatives span no tangent plane")
    return differentiate_normal_unchecked(jet)


def differentiate_normal_unchecked(jet: Array) -> tuple[Array, Array, Array]:
    """As :func:`differentiate_normal`, but nan where the surface is singular: an iteration may touch such a point."""
    outer = cross_product(jet[1], jet[2])
    length = np.linalg.norm(outer, axis=1, keepdims=True)

    def normalise_rate(change: Array) -> Array:
        return (change - (change * n).sum(1, keepdims=True) * n) / length

    n = outer / length
    du = normalise_rate(cross_product(jet[3], jet[2]) + cross_product(jet[1], jet[4]))
    dv = normalise_rate(cross_product(jet[4], jet[2]) + cross_product(jet[1], jet[5]))
    return n, du, dv
