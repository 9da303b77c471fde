"""Tolerances and limits of the verification of finished shapes."""

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

    analysis_samples: int = 200
    """Number of samples along an edge for OCCT's own analysis of continuity."""

    analysis_epsilon: float = 1e-12
    """Values (mm, radians) that OCCT's analysis of continuity takes for zero; its default of 1e-3 would hide gaps."""

    step_deviation: float = 1e-7
    """mm, radians: by how much the gap and the angle of a smooth edge may grow in a STEP file, beside a tenth."""

    certificate_samples: int = 400
    """Number of points at which a certificate measures each edge of a rail, beside those at knots."""

    new_edge_samples: int = 200
    """Number of points at which it measures the angle along each other edge that is promised to be smooth."""

    surface_certificate_samples: int = 1000
    """The same of a rail that is no edge."""


VERIFICATION_TOLERANCES = VerificationTolerances()
