"""Tolerances and limits of selecting edges and of what a rail must stay clear of."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SelectTolerances:
    """Tolerances and limits of :mod:`cqblend.brep.selection`."""

    smooth_angle: float = 1e-3
    """rad: faces that meet at less are smooth already; at less from pi, a knife edge."""
    continuation_angle: float = 1e-2
    """rad: a chain goes on past a vertex only where it turns by less."""
    dihedral_samples: int = 17
    """Samples inside an edge at which the angle between its faces is measured."""
    dihedral_margin: float = 0.02
    """Part of an edge at either end in which its faces may become tangent, and none of these samples are."""
    sharpness_samples: int = 50
    """Samples along an edge that tell whether it is sharp anywhere."""
    spine_samples: int = 65
    """Equidistant points along a spine that stand for it: for the axis of a sphere, for the sense of an edge."""
    speed_samples: int = 65
    """Entries of an edge's table of parameters by arc length."""
    circle_samples: int = 33
    """Points along a spine to which a circle is fitted."""
    circle: float = 1e-9
    """Deviation, relative to the radius, up to which a spine is an arc of a circle."""
    full_turn: float = 1e-6
    """rad: a closed arc that turns by less or more than that beside 2 pi is no full circle."""
    contact_boundary: float = 1e-7
    """In parameters: a contact this near to its face's boundary lies on it, and leaves nothing of the face."""
    face_boundary: float = 1e-9
    """In parameters: any other point this near to a face's boundary lies on it."""
    same_corner: float = 1e-6
    """In parameters: corners of a face's boundary at one vertex that are not further apart are not told apart."""
    cap_probe_share: float = 0.12
    """Part of the sum of both legs of an end section: a point between them, which the cap cuts off."""
    cap_probe_step: float = 1e-3
    """Step from that point to behind the cap, along the edge, relative to the legs."""
    opposite_cosine: float = -0.9
    """Cosine between the outward normals of two faces below which these are the two sides of a wall."""
    width_bisections: int = 40
    """Bisections that find how far a face reaches."""
    least_width: float = 1e-6
    """Part of the way to a contact: a face that does not even reach that far has no width."""
    border_samples: int = 65
    """Points of the border at which the face beyond is looked for."""
    reach_margin: float = 1.1
    """Factor: how much further than its rails a blend may touch something."""
    merged_area: float = 1e-4
    """Relative difference of a merged face's area from the sum of its parts: OCCT integrates at few points."""
    merged_samples: int = 9
    """Samples along an edge at which two faces are compared that may be merged."""
    fading_sine: float = 0.02
    """Sine of the angle between two faces from which on contacts are solved for, where a joint fades out."""
    fading_range: tuple[float, float] = (1e-5, 0.5)
    """Shares of a joint's length, from its end, between which that angle is looked for."""
    fading_samples: int = 65
    """Number of places at which it is looked for."""
    parallel_angle: float = 1e-9
    """rad, between the normals of planes, or the axes of cylinders, that are the same."""

    wire_gap: float = 1e-5
    """mm: largest gap of a closed wire that a bridge starts from, and largest distance of it from its face."""
    bend: float = 1e-9
    """Relative to the curvature: by how much that of a wire may jump and count as continuous."""


SELECT_TOLERANCES = SelectTolerances()
