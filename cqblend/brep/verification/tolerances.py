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

    proof_samples: int = 33
    """Number of places at which a rail edge of arcs is compared with its rail; what is found counts twice, for what
    lies between."""

    step_deviation: float = 1e-7
    """mm, radians: by how much the gap and the angle of a smooth edge may grow in a STEP file, beside a tenth."""

    many_wires: int = 4
    """Faces with at least so many wires are checked without those that a change did not come near to."""

    wire_box_margin: float = 1e-6
    """mm or radians, in parameters: by how much the boxes of wires and edges in a face are enlarged."""

    deviation_samples: tuple[int, int] = (211, 8)
    """Number of parameters at which a new edge and its pcurve are compared, and how many more for each knot."""

    undoubted_deviation: float = 0.25
    """Relative to the edge's tolerance: a sampled deviation up to which the largest one is not searched for."""

    resolved_deviation: float = 1.03
    """Factor: largest deviations that differ by no more, of few samples and of three times as many, are resolved."""

    deviation_slack: float = 1e-10
    """mm: by how much a deviation may be above the edge's tolerance; it is rounding, of large coordinates too."""

    ray_step: float = 1e-4
    """mm: how far from a face a ray starts that is to tell inside from outside."""

    vertex_slack: float = 2.0
    """Relative to the largest tolerance of edges that is allowed: the same of their vertices."""

    tangent_cosine: float = 0.995
    """Faces whose normals at the middle of a common edge have at least this cosine are tangent there: 6 degrees."""

    most_foot_steps: int = 30
    """Number of Newton steps to the foot of a point on a surface."""

    foot_accuracy: float = 1e-4
    """Relative to the distance from it: the last step to a foot."""

    piece_counts: tuple[tuple[int, int], ...] = ((8, 4), (48, 16), (192, 48))
    """Into how many pieces in u and in v surfaces are cut, until their boxes are apart."""

    fold_samples: tuple[int, int] = (1025, 129)
    """Largest number of parameters in one direction at which the normals of a face are compared: of a face with few
    spans in the other direction, and of one with many."""

    few_spans: int = 12
    """How many spans are few in that sense."""

    normals_per_span: int = 5
    """How many of these parameters there are in every span, if so many are allowed."""

    short_normal: float = 0.3
    """Relative to the median of |Su x Sv| on a face: where it is shorter, a fold may be near."""

    samples_near_short_normal: tuple[int, int] = (65, 33)
    """Number of parameters in u and v around the shortest one at which normals are compared again."""

    most_piece_pairs: int = 300_000
    """Largest number of pairs of pieces that are compared: beyond that, OCCT's exact distance takes no longer."""

    certificate_samples: int = 400
    """Number of points at which a certificate measures each edge of a rail, beside those at knots."""

    new_edge_samples: int = 200
    """Number of points at which it measures the angle along each other edge that is promised to be smooth."""

    surface_certificate_samples: int = 1000
    """The same of a rail that is no edge."""

    bridge_points: tuple[int, int] = (24, 9)
    """Points along and across each face of a bridge of which it is asked whether they are in a body."""

    bridge_middle: tuple[float, float] = (0.1, 0.9)
    """Shares of a bridge, from rail to rail, between which these points lie: nearer to a rail it hugs the face."""

    bridge_net: tuple[int, int] = (64, 32)
    """Meshes along and across of the net in which a bridge is searched for places where it passes through itself."""


VERIFICATION_TOLERANCES = VerificationTolerances()
