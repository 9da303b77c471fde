"""Tolerances of strips and plans."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class NetworkTolerances:
    """Tolerances of the modules in :mod:`cqblend.blends.network`."""

    parallel_rails: float = 1e-14
    """Relative to their length: by how much the rulings of a straight strip may differ, that of rounding."""

    least_cut_sine: float = 1e-3
    """Sine of the angle between a plane and the rulings of a strip below which they do not cut cleanly."""

    section_plane: float = 1e-15
    """Relative to the size: by how much an axis may miss a plane that a section is to lie in."""

    arc_plane: float = 1e-12
    """Relative to the radius of the strip, or rad: by how much a plane in which the section of a strip of arcs is to
    lie may miss its axis, or turn from it."""


NETWORK_TOLERANCES = NetworkTolerances()
