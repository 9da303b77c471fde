"""Tolerances and limits of measurements on finished shapes."""

from dataclasses import dataclass


@dataclass(frozen=True)
class MeasureTolerances:
    """Tolerances and sample counts of the modules in :mod:`cqblend.brep.measurement`."""

    smooth_edge_angle: float = 1e-3
    """Radians: largest angle between normals at an edge of the kind 'smooth', 0.06 degrees."""

    knot_line: float = 1e-7
    """Relative to the surface's domain: a pcurve that stays this near to a knot line runs along it. Those read from
    STEP files do stray."""

    knot_line_step: float = 1e-14
    """Relative to the surface's domain: step off a knot line to evaluate one side of it. OCCT tells sides apart down
    to 1e-15."""

    degenerate_ratio: float = 1e-7
    """|Su x Sv| below this share of its largest value along the edge is mostly rounding: the normal is nan."""

    shortest_knot_span: float = 64 * 2.0**-52
    """Relative to the parameters: a span that is shorter holds no parameters inside."""

    resampling_rounds: int = 2
    """How often it is measured again, more densely, around the largest values."""

    level_value: float = 1e-3
    """Relative: between values that differ by less from each other, none is larger by more than an eighth of that."""

    negligible_continuity: tuple[float, float, float] = (1e-11, 1e-12, 1e-9)
    """mm, radians, 1/mm: gaps, angles and curvature jumps below these are not searched more closely. OCCT takes points
    nearer than 1e-7 mm for one, and directions nearer than 1e-12."""

    worst_count: int = 4
    """Around how many of the largest values."""

    fewest_in_bulk: int = 12
    """Fewer points than this are evaluated by OCCT itself, which takes no longer."""

    witness_count: int = 8
    """Number of points in a new range or region that OCCT evaluates too, when others are evaluated in bulk."""

    witness_position: float = 1e-12
    """Relative to the coordinates: by how much points evaluated in bulk may differ from OCCT's."""

    witness_derivative: float = 1e-9
    """Relative to the largest derivative of the same order: by how much derivatives may."""

    deviation_samples: int = 240
    """Number of points at which the two curves of an edge are compared, at least."""

    deviation_rounds: int = 3
    """How often they are compared again, more densely, around the largest deviations."""

    deviation_peaks: int = 8
    """Around how many of them at most."""

    exact_deviation: float = 1e-11
    """mm: a curve and an image without knots that are this near at a dozen points are the same but for rounding."""

    negligible_deviation: float = 1e-9
    """mm: deviations below this are not searched more closely. OCCT takes points nearer than 1e-7 mm for one."""

    crossing_samples: int = 1025
    """Number of points of a pcurve between which crossings with knot lines are looked for."""

    crossing_iterations: int = 40
    """Largest number of regula falsi steps to find such a crossing."""


MEASURE_TOLERANCES = MeasureTolerances()
