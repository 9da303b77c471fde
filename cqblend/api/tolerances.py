"""Tolerances and limits of blends between surfaces."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SurfaceBlendTolerances:
    """Tolerances of the functions that blend surfaces."""

    direction_jump: float = 1e-9
    """Largest jump of a guiding curve at a break that counts as rounding, relative to its largest coordinate."""

    closure: float = 1e-9
    """Largest difference of the cross derivatives at both ends of a closed rail that counts as rounding, relative to
    their length."""

    corner: float = 1e-6
    """Largest distance between an end section and a side at a corner, relative to the size of the sides."""

    default_offset_error: float = 1e-6
    """Default accuracy of offset surfaces as splines, relative to the largest offset."""

    default_skin: float = 1e-5
    """Default distance between a blend and the intersection curves that it follows, relative to that of the rails."""

    finest_skin: float = 1e-7
    """Smallest such distance that may be asked for, relative to that of the rails: less takes too many spans."""


BLEND_TOLERANCES = SurfaceBlendTolerances()
