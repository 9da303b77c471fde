"""The sizes of a blend at one joint: its radius, or the widths on both sides, numbers or laws along the edge."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from cqblend.blend_numbers import Size
from cqblend.blend_options import BlendRequest, EdgeSizes
from cqblend.errors import InputError
from cqblend.sizes.size_law import SizeLaw
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class BlendSizes:
    """One size (mm) for both sides of a blend, or one for each; laws are functions of the joint's t."""

    sizes: tuple[Size, ...]

    @property
    def laws(self) -> tuple[SizeLaw, ...]:
        """Those that vary."""
        return tuple(size for size in self.sizes if isinstance(size, SizeLaw))

    @property
    def largest(self) -> tuple[float, ...]:
        """The sizes, the largest of those that vary."""
        return tuple(size.largest if isinstance(size, SizeLaw) else size for size in self.sizes)

    @property
    def least(self) -> float:
        """The smallest size anywhere along the edge, but next to ends at which it goes to 0."""
        return min(size.smallest if isinstance(size, SizeLaw) else size for size in self.sizes)

    def measure(self, t: Array) -> Array:
        """Return the sizes at t (n,), (1 or 2, n)."""
        return np.stack([size(t) if isinstance(size, SizeLaw) else np.full(len(t), size) for size in self.sizes])

    def measure_largest(self, t: float) -> float:
        """Return the larger size at one t."""
        return float(self.measure(np.array([t])).max())

    @property
    def vanishes(self) -> tuple[bool, bool]:
        """Whether the sizes go to 0 at t = 0 and at t = 1, so that the blend ends in a point there.

        Raises
        ------
        InputError
            Only one of two does.
        """
        found = [size.vanishes if isinstance(size, SizeLaw) else (False, False) for size in self.sizes]
        if any(len({own[end] for own in found}) > 1 for end in (0, 1)):
            raise InputError(
                "width goes to 0 at an end on one side only: the blend can end in a point there, if both widths do"
            )
        return found[0]

    def find_vanishing_limit(self, end: int) -> float:
        """Return the t next to an end, where the sizes go to 0, from which they are more than next to nothing."""
        limits = [law.find_vanishing_limit(end) for law in self.laws]
        return min(limits) if end else max(limits)

    def locate_corners(self, domain: tuple[float, float]) -> Array:
        """Return the t in a range at which a size is no more than C1."""
        return np.unique(np.concatenate([np.empty(0), *(law.locate_corners(domain) for law in self.laws)]))


def read_sizes(request: BlendRequest) -> BlendSizes:
    """Return the radius or the widths of a request; where each edge has its own, those of all edges."""
    if request.edge_sizes:
        return BlendSizes(tuple(size for one in request.edge_sizes for size in one.sizes))
    return BlendSizes((request.radius,) if request.radius is not None else request.width or (0.0,))


def replace_sizes(request: BlendRequest, sizes: Sequence[Size]) -> BlendRequest:
    """Return a request with one size, the radius, or with two, the widths on both sides."""
    radius, width = (sizes[0], None) if len(sizes) == 1 else (None, (sizes[0], sizes[1]))
    return replace(request, radius=radius, width=width, edge_sizes=(), taper=None)


def scale_sizes(request: BlendRequest, factor: float) -> BlendRequest:
    """Return a request with all sizes times a factor."""

    def scale_all(sizes: Sequence[Size]) -> tuple[Size, ...]:
        return tuple(size.scale(factor) if isinstance(size, SizeLaw) else size * factor for size in sizes)

    if request.edge_sizes:
        scaled = tuple(EdgeSizes(one.edge, scale_all(one.sizes)) for one in request.edge_sizes)
        return replace(request, edge_sizes=scaled)
    return replace_sizes(request, scale_all(read_sizes(request).sizes))


def take_largest_sizes(request: BlendRequest) -> BlendRequest:
    """Return a request with the largest size anywhere, all along; the same one if no size varies."""
    sizes = read_sizes(request)
    if not request.edge_sizes and not sizes.laws:
        return request
    is_radius = request.radius is not None or any(len(one.sizes) == 1 for one in request.edge_sizes)
    return replace_sizes(request, (max(sizes.largest),) * (1 if is_radius else 2))
