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

    setback_factor: float = 1.5
    """Setback of a blend from where its rails meet those of its neighbours, as a factor on the distance of that place
    from the vertex."""

    setback_widths: float = 0.25
    """What is added to it, in widths of the blend."""

    least_setback_factor: float = 1.1
    """The same factor at least, where an edge is short."""

    most_setback_share: float = 0.94
    """Share of an edge that the setbacks at both of its ends may take."""

    quality_samples: int = 17
    """Points in each direction of a patch, at which normals and curvatures are looked at."""

    least_neighbour_cosine: float = 0.2
    """Cosine of the angle between the normals at neighbouring samples below which a patch folds."""

    largest_curvature: float = 3.0
    """Curvature of a patch times the least radius of the blends around it, at most."""


CORNER_TOLERANCES = CornerTolerances()
