"""Tolerances and settings of corner patches."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CornerTolerances:
    """What a corner must fulfil, and how its patches are found."""

    tangent_plane: float = 1e-10
    """Relative to the speed of a side: by how much the side before may leave its tangent plane where both meet."""

    twist: float = 1e-10
    """Relative to the speed of a side: by how much the twists that both sides of a corner ask for may differ out of the
    tangent plane."""

    closed_sides: float = 1e-9
    """Relative to the size of the hole: distance of the end of a side from the start of the next one."""

    span_rank: float = 1e-10
    """Relative to the largest: singular values of fields that span a tangent plane below which they are zero."""

    level_weight: float = 1e-15
    """By how much the weight at the end of a side may differ from 1, and is left as it is."""

    bending_weight: float = 1e-2
    """Weight of squared second derivatives in the energy that patches minimise, beside that of the third ones."""

    regularisation: float = 1e-13
    """Added to the diagonal of the scaled normal equations."""

    unused_unknown: float = 1e-250
    """Energy of a unit of an unknown below which it moves nothing."""

    end_speed: float = 0.85
    """Speed of a curve on a face at its ends, as a share of the distance from there to where the rails cross."""

    reflex_speed: float = 1.6
    """The same on a face whose angle at the vertex is reflex."""

    crossing_distances: tuple[float, float] = (0.1, 5.0)
    """Range of these distances, in chords of the curve, in which they tell its speeds."""

    setback_factors: tuple[float, ...] = (1.5, 2.0, 1.2, 3.0)
    """Setback of a blend from where its rails meet those of its neighbours, as a factor on the distance of that place
    from the vertex: tried in this order."""

    setback_widths: float = 0.25
    """What is added to it, in widths of the blend."""

    least_setback_factor: float = 1.1
    """The same factor at least, where an edge is short."""

    most_setback_share: float = 0.47
    """Share of an edge that the setback at one of its ends may take."""

    rail_crossing_samples: int = 129
    """Points of each rail with which the search for the crossing of two of them starts."""

    crossing_step: float = 0.25
    """Longest step of that search, as a share of the rail."""

    crossing_steps: int = 50
    """Most steps."""

    crossing_exact: float = 1e-14
    """Steps, relative to the longest, that are due to rounding."""

    crossing_gap: float = 1e-6
    """Distance of two rails, relative to their length, from which on they do not cross."""

    square_section: float = 1e-13
    """Share of a strip by which its end section may be off one parameter, and is taken to be square."""

    quality_samples: int = 17
    """Points in each direction of a patch, at which normals and curvatures are looked at."""

    least_neighbour_cosine: float = 0.2
    """Cosine of the angle between the normals at neighbouring samples below which a patch folds."""

    largest_curvature: float = 3.0
    """Curvature of a patch times the least radius of the blends around it, at most."""


CORNER_TOLERANCES = CornerTolerances()
