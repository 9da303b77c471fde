"""How sound patches are: their largest curvature, and whether they fold. Knows spline surfaces only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from cqblend.blends.corners.tolerances import CORNER_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product, measure_lengths


@dataclass(frozen=True)
class PatchQuality:
    """The largest absolute principal curvature (1/mm) and the least cosine of the angle of neighbouring normals."""

    curvature: float
    neighbour_cosine: float


def measure_patches(patches: Sequence[Surface]) -> PatchQuality:
    """Measure patches on a grid of each."""
    found = [_measure_patch(patch) for patch in patches]
    return PatchQuality(max(curvature for curvature, _ in found), min(cosine for _, cosine in found))


def check_patches(patches: Sequence[Surface], radius: float) -> PatchQuality:
    """Raise GeometryError if patches fold, or bend far more than the blends around them, of least ``radius`` (mm)."""
    quality = measure_patches(patches)
    if not quality.neighbour_cosine >= CORNER_TOLERANCES.least_neighbour_cosine:
        raise GeometryError("the patches of the corner fold", kind="fold", value=quality.neighbour_cosine)
    bend = quality.curvature * radius
    if not bend <= CORNER_TOLERANCES.largest_curvature:
        raise GeometryError(
            f"the patches of the corner bend {bend:.3g} times as sharply as the blends around it, "
            f"{CORNER_TOLERANCES.largest_curvature:g} times is allowed",
            kind="curvature",
            value=bend,
        )
    return quality


def _measure_patch(patch: Surface) -> tuple[float, float]:
    (u0, u1), (v0, v1) = patch.domain
    count = CORNER_TOLERANCES.quality_samples
    u, v = np.meshgrid(np.linspace(u0, u1, count), np.linspace(v0, v1, count), indexing="ij")
    jet = patch.jet(u, v, 2)
    across = cross_product(jet[1, 0], jet[0, 1])
    area = measure_lengths(across)
    if not area.all():
        return np.inf, -1.0
    normals = across / area[..., None]
    cosines = [(normals[1:] * normals[:-1]).sum(-1).min(), (normals[:, 1:] * normals[:, :-1]).sum(-1).min()]
    return _find_largest_curvature(jet, normals), float(min(cosines))


def _find_largest_curvature(jet: Array, normals: Array) -> float:
    """Return the largest absolute principal curvature of jets (3, 3, .., 3) with unit normals."""

    def multiply(a: Array, b: Array) -> Array:
        return np.asarray((a * b).sum(axis=-1))

    e, f, g = multiply(jet[1, 0], jet[1, 0]), multiply(jet[1, 0], jet[0, 1]), multiply(jet[0, 1], jet[0, 1])
    x, y, z = multiply(jet[2, 0], normals), multiply(jet[1, 1], normals), multiply(jet[0, 2], normals)
    area = e * g - f * f
    gauss, mean = (x * z - y * y) / area, (e * z - 2 * f * y + g * x) / (2 * area)
    spread = np.sqrt(np.maximum(mean * mean - gauss, 0.0))
    return float((np.abs(mean) + spread).max())
