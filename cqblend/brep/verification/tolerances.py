"""Tolerances, sample counts and limits of the verification of finished shapes, in one place."""

from dataclasses import dataclass


@dataclass(frozen=True)
class VerificationTolerances:
    """Tolerances, sample counts and limits of the modules in :mod:`cqblend.brep.verification`."""

    volume: float = 1e-6
    """Relative: accuracy asked of OCCT's volume integration, and of volumes that are to add up."""

    volume_changes: tuple[float, float] = (1e-5, 1e-8)
    """Relative: the same for the volume between a few faces and those that replaced them; the second where the first
    leaves a doubt."""

    flagged_smooth_angle: float = 1e-4
    """Radians: largest angle between normals at an edge that is flagged smooth. Native fillets on freeform faces reach
    4e-5."""

    smooth_edge_angle: float = 1e-3
    """Radians: largest angle between normals at an edge of the kind 'smooth', 0.06 degrees."""

    analysis_samples: int = 200
    """Number of samples along an edge for OCCT's own analysis of continuity."""

    analysis_epsilon: float = 1e-12
    """Values (mm, radians) that OCCT's analysis of continuity takes for zero; its default of 1e-3 would hide gaps."""

    step_deviation: float = 1e-7
    """mm, radians: by how much the gap and the angle of a smooth edge may grow in a STEP file, beside a tenth."""

    knot_line: float = 1e-7
    """Relative to the surface's domain: a pcurve that stays this near to a knot line runs along it. Those read from
    STEP files do stray."""

    knot_line_step: float = 1e-14
    """Relative to the surface's domain: step off a knot line to evaluate one side of it. OCCT tells sides apart down
    to 1e-15."""

    degenerate_ratio: float = 1e-7
    """|Su x Sv| below this share of its largest value along the edge is mostly rounding: the normal is nan."""

    shortest_span: float = 64 * 2.0**-52
    """Relative to the parameters: a span that is shorter holds no parameters inside."""

    resampling_rounds: int = 2
    """How often it is measured again, more densely, around the largest values."""

    worst_count: int = 4
    """Around how many of the largest values."""

    crossing_samples: int = 1025
    """Number of points of a pcurve between which crossings with knot lines are looked for."""

    crossing_iterations: int = 40
    """Largest number of regula falsi steps to find such a crossing."""

    certificate_samples: int = 400
    """Number of points at which a certificate measures each edge of a rail, beside those at knots."""

    surface_certificate_samples: int = 1000
    """The same of a rail that is no edge."""


VERIFICATION_TOLERANCES = VerificationTolerances()
