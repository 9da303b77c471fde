"""Unit normals of surfaces with their first derivatives: what Newton's method needs for offset points and balls."""

from __future__ import annotations

import numpy as np

from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, measure_lengths

LEFT_FACTORS = np.array([1, 3, 1, 4, 1])
RIGHT_FACTORS = np.array([2, 2, 4, 2, 5])
"""Derivatives in a native jet whose vector products are Su x Sv, and in pairs its two derivatives."""


def differentiate_normal(jet: Array) -> tuple[Array, Array, Array]:
    """Return the unit normal and its two derivatives, each (n, 3), of a native jet."""
    if not np.all(measure_lengths(cross_product(jet[1], jet[2])) > 0):
        raise GeometryError("a face is singular under the blend: its partial derivatives span no tangent plane")
    n, du, dv = differentiate_normals(jet[None])[:, 0]
    return n, du, dv


def differentiate_normals(jets: Array) -> Array:
    """Return unit normals and their two derivatives, (3, sides, n, 3), of native jets (sides, 6, n, 3).

    They are nan where a surface is singular: an iteration may touch such a point.
    """
    products = cross_product(jets[:, LEFT_FACTORS], jets[:, RIGHT_FACTORS])
    length = measure_lengths(products[:, 0])[..., None]
    out = np.empty((3, *products[:, 0].shape))
    n = np.divide(products[:, 0], length, out=out[0])
    for row, change in ((1, products[:, 1] + products[:, 2]), (2, products[:, 3] + products[:, 4])):
        out[row] = (change - (change * n).sum(axis=-1, keepdims=True) * n) / length
    return out


def normalise_unchecked(vectors: Array) -> Array:
    """Return unit vectors (..., 3), nan where a vector is zero: an iteration may touch such a point."""
    return np.asarray(vectors / measure_lengths(vectors)[..., None])
