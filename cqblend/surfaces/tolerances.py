"""Tolerances and limits of primary surfaces."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SurfaceTolerances:
    """Numbers below which something counts as zero or as equal."""

    derivative_jump: float = 1e-10
    """Jump of a derivative at a knot line, times the power of the span and as a share of the largest coefficient, that
    is rounding: larger ones are kinks."""

    seam_parameter: float = 1e-12
    """Distance from the ends of a periodic parameter, as a share of its period, at which a point is on the seam."""

    seam_jump: float = 1e-11
    """Jump of a derivative at the seam of a closed surface, times the power of the period and as a share of the largest
    coefficient, that is rounding."""

    same_direction: float = 1e-13
    """Sine of the angle between two directions, and share of the coordinates between two axes, up to which they are
    the same."""

    antipode: float = 1e-6
    """Least 1 + cosine of the angle between a point of a sphere and its pole: below it, the lift is singular."""


SURFACE_TOLERANCES = SurfaceTolerances()
