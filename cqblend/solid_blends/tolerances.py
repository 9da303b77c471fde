"""Tolerances and limits of blending edges of solids."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SolidBlendTolerances:
    """Tolerances and limits of the modules in :mod:`cqblend.solid_blends`.

    The size of a blend is its largest length.
    """

    rail: float = 1e-5
    """Relative to the size: largest distance of the rails from the contacts of the ball."""

    min_rail: float = 1e-7
    """mm: the least that this is taken for."""

    exact_angle: float = 1e-7
    """Radians: largest angle that may be measured along a rail of an exact blend, by OCCT, whose derivatives of splines
    of high degree are rounded."""

    exact_curvature_jump: float = 1e-6
    """In units of 1 / size: largest jump of curvature that may be measured along a rail of an exact G2 or G3 blend."""

    compact_curvature_jump: float = 1e-3
    """The same of a compact blend."""

    gap: float = 1e-7
    """mm: largest gap that may be measured along a rail on clean input."""

    edge: float = 5e-7
    """mm: largest tolerance that a new edge may have on clean input."""

    inner_crease_margin: float = 1.05
    """Factor on the allowed crease inside a blend, for the measurement by OCCT."""

    same_surface: float = 1e-10
    """Relative to the size of a solid: a surface that differs less from that of a face is the same."""

    max_rail_fits: int = 4
    """How often rails are fitted, longer each time, until they reach the faces at the ends of the edge."""

    cap_offsets: tuple[float, ...] = (0.0, 0.1, 0.2, 0.5, 1.0, 1.5, 2.0)
    """Distances before the end of the edge at which a flat cap is tried, relative to the reach of the blend."""

    parallel_cosine: float = 0.15
    """Least |cos| between an edge and the normal of the face at its end: below it, the face runs along the edge."""

    max_uncovered: float = 0.3
    """Relative to the edge: more than that no cap leaves unblended at one end."""

    landing_stations: int = 33
    """Stations of an edge at which it is found on which faces the contacts lie."""

    landing_resolution: float = 1e-4
    """In t: how near to where a rail passes to another face stations are halved; Newton's method goes on from there."""

    landing_margin: float = 1e-6
    """Share of the way from the edge to a contact by which that is lengthened, for contacts on a boundary."""

    landing_steps: int = 16
    """Steps in which a blend is grown from none, where its contacts are not found at once."""

    least_landing_step: float = 1e-4
    """Relative to the size: a step that does not succeed although it is smaller ends that."""

    overrun_widths: float = 2.0
    """How far, in widths of the blend, past the end of its edge a cell may go on, in place of one more cell."""

    most_faces_beyond: int = 8
    """Smooth edges over which a contact is followed."""

    held_stations: int = 257
    """Points of the blended edge among which the nearest to a point of a held edge is looked for."""

    held_constancy: float = 1e-12
    """How much unit tangents and directions along a held edge may differ if it is straight, or all around its axis."""

    held_curve: float = 1e-11
    """Relative to the solid: how near the curve on which a rail is held is to the edge."""

    held_way: float = 1e-6
    """Radians: how near the directions there are to those of the ball, which nothing is smooth with."""

    held_spans: int = 8
    """Spans with which both are begun to be fitted."""

    held_overrun: float = 0.5
    """In units of the radius: how far rails beside a held edge are made longer than it, to begin with."""

    held_angle: float = 1e-3
    """Radians: least angle at a held edge between the blend and the face on either side."""

    check_stations: int = 25
    """Number of stations whose contacts are checked before a size is tried."""

    min_tolerance_ratio: float = 3.0
    """Relative to the edge's tolerance: the least size."""

    fallback_size: float = 1e-2
    """Relative to the solid's size: tried where contacts let no size pass, to get the error that says why."""

    square_cosine: float = 1e-9
    """1 - |cos| of the angle between an edge and the normal of a plane, below which it is square to that."""

    equal_sizes: float = 1e-6
    """Relative: sizes of blends that meet at a corner are taken as equal if they differ by less."""


@dataclass(frozen=True)
class SizeSearch:
    """How the largest size that works is looked for: steps of the cheap trials, and of the trials proper after them."""

    cheap_growth: float = 1.1
    """Factor between sizes of trials that look at contacts only."""

    cheap_count: int = 90
    """Number of these: over nearly four decades."""

    start_ratio: float = 1 / 8
    """Relative to the largest size that contacts allow: where trials proper start; and by how much smaller each further
    start is, where that fails."""

    max_starts: int = 3
    """Number of starts."""

    growth: float = 1.25
    """Factor between sizes of trials proper."""


SOLID_BLEND_TOLERANCES = SolidBlendTolerances()
SIZE_SEARCH = SizeSearch()
