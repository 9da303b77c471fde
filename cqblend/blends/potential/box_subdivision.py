"""Candidates for the intersection of two spline surfaces: small parts of both whose bounding boxes overlap.

A spline surface lies in the convex hull of its control points. So both are subdivided wherever boxes of control points
overlap, down to parts of a given size: no branch of the intersection that is longer than a part is missed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.potential.family_pair import format_point
from cqblend.blends.potential.tolerances import POTENTIAL_LIMITS
from cqblend.errors import GeometryError
from cqblend.splines import Surface, bernstein
from cqblend.splines.bernstein import Array


def find_candidates(first: Surface, second: Surface, tolerance: float) -> tuple[Array, Array]:
    """Return the parts of both surfaces whose boxes overlap, subdivided to the limit.

    They are given by the middles (n, 4) and the half widths (n, 4) of their windows in q = (u1, v1, u2, v2). Each
    surface may differ from the one that is meant by ``tolerance`` (mm).

    Raises
    ------
    GeometryError
        There are so many that the surfaces touch along an area.
    """
    parts = _SurfaceParts.from_surface(first), _SurfaceParts.from_surface(second)
    i, j = (grid.ravel() for grid in np.indices((len(parts[0].windows), len(parts[1].windows))))
    common_low = np.maximum(*(side.low.min(axis=0) for side in parts))
    common_high = np.minimum(*(side.high.max(axis=0) for side in parts))
    limit = float(np.linalg.norm(np.maximum(common_high - common_low, 0))) / POTENTIAL_LIMITS.subdivision
    while True:
        low = np.maximum(parts[0].low[i], parts[1].low[j])
        high = np.minimum(parts[0].high[i], parts[1].high[j])
        overlap = (low <= high + 2 * tolerance).all(axis=1)
        i, j = i[overlap], j[overlap]
        if len(i) > POTENTIAL_LIMITS.pairs:
            middle = (low[overlap] + high[overlap]).mean(axis=0) / 2
            raise GeometryError(
                f"the surfaces touch, or coincide, over an area around {format_point(middle)}: move one of them"
            )
        large = parts[0].diagonals > limit, parts[1].diagonals > limit
        if not large[0][i].any() and not large[1][j].any():
            break
        parts, (i, j) = _subdivide_pairs(parts, large, (i, j))
    windows = np.concatenate([parts[0].windows[i], parts[1].windows[j]], axis=1)
    return windows.mean(axis=2), np.ptp(windows, axis=2) / 2


def _subdivide_pairs(
    parts: tuple[_SurfaceParts, _SurfaceParts], large: tuple[Array, Array], pairs: tuple[Array, Array]
) -> tuple[tuple[_SurfaceParts, _SurfaceParts], tuple[Array, Array]]:
    """Quarter the large ones among the parts that occur in pairs; return the new parts and all pairs of them."""
    quartered, starts, counts = [], [], []
    for side, is_large, index in zip(parts, large, pairs, strict=True):
        used, inverse = np.unique(index, return_inverse=True)
        new, offset, count = side.quarter_large_parts(used, is_large[used])
        quartered.append(new)
        starts.append(offset[inverse])
        counts.append(count[inverse])
    total = counts[0] * counts[1]
    pair = np.repeat(np.arange(len(total)), total)
    k = np.arange(total.sum()) - np.repeat(np.cumsum(total) - total, total)
    first, second = starts[0][pair] + k // counts[1][pair], starts[1][pair] + k % counts[1][pair]
    return (quartered[0], quartered[1]), (first, second)


@dataclass(frozen=True)
class _SurfaceParts:
    """Parts of a surface, as Bernstein patches.

    ``coefs`` are homogeneous, (p + 1, q + 1, 4, n); ``windows`` (n, 2, 2) are the intervals of u and v; ``low`` and
    ``high`` (n, 3) are the corners of the boxes of the control points.
    """

    coefs: Array
    windows: Array
    low: Array
    high: Array

    @classmethod
    def from_surface(cls, surface: Surface) -> _SurfaceParts:
        coefs = surface.coefs
        if not surface.rational:
            coefs = np.concatenate([coefs, np.ones_like(coefs[:, :, :1])], axis=2)
        bu, bv = surface.breaks
        u = np.stack([bu[:-1], bu[1:]], axis=-1)[:, None].repeat(len(bv) - 1, axis=1)
        v = np.stack([bv[:-1], bv[1:]], axis=-1)[None].repeat(len(bu) - 1, axis=0)
        return cls.from_coefficients(coefs.reshape(*coefs.shape[:3], -1), np.stack([u, v], axis=2).reshape(-1, 2, 2))

    @classmethod
    def from_coefficients(cls, coefs: Array, windows: Array) -> _SurfaceParts:
        points = coefs[:, :, :3] / coefs[:, :, 3:]
        return cls(coefs, windows, points.min(axis=(0, 1)).T, points.max(axis=(0, 1)).T)

    @property
    def diagonals(self) -> Array:
        """Lengths (n,) of the diagonals of the boxes."""
        return np.asarray(np.linalg.norm(self.high - self.low, axis=1))

    def quarter_large_parts(self, used: Array, large: Array) -> tuple[_SurfaceParts, Array, Array]:
        """Return the ``used`` parts with the ``large`` ones quartered, and the first index and number of each one's."""
        coefs, windows = self.coefs[..., used], self.windows[used]
        counts = np.where(large, 4, 1)
        offsets = np.cumsum(counts) - counts
        new_coefs, new_windows = [coefs[..., ~large]], [windows[~large]]
        whole = coefs[..., large]
        halvings = [
            bernstein.restrict_pieces(np.eye(n)[..., None], np.array([a]), np.array([a + 0.5]))[..., 0]
            for n in whole.shape[:2]
            for a in (0.0, 0.5)
        ]
        for iu in (0, 1):
            for iv in (0, 1):
                quarter = np.einsum("ap,bq,pqdn->abdn", halvings[iu], halvings[2 + iv], whole, optimize=True)
                new_coefs.append(quarter)
                window = windows[large].copy()
                middle = window.mean(axis=2)
                window[:, 0, 1 - iu] = middle[:, 0]
                window[:, 1, 1 - iv] = middle[:, 1]
                new_windows.append(window)
        order = np.concatenate([offsets[~large], *(offsets[large] + k for k in range(4))])
        sort = np.argsort(order, kind="stable")
        parts = _SurfaceParts.from_coefficients(
            np.concatenate(new_coefs, axis=-1)[..., sort], np.concatenate(new_windows)[sort]
        )
        return parts, offsets, counts
