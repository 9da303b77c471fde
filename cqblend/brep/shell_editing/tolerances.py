"""Tolerances and limits of putting a blend face into a solid."""

from __future__ import annotations

from dataclasses import dataclass

from cqblend.splines.bernstein import EPSILON


@dataclass(frozen=True)
class ShellEditTolerances:
    """Tolerances and limits of the modules in :mod:`cqblend.brep.shell_editing`."""

    at_seam: float = 1e-6
    """mm: a point of a rail this near to a seam, or to another one on it, is there."""

    rail_end_at_seam: float = 1e-9
    """Relative to a parameter's range or period: parameters this near to a seam, or to an end, lie on it."""

    point_end: float = 1e-12
    """Relative to the extent of the solid: a section of a blend that is shorter is a point."""

    tangent_faces: float = 1e-3
    """Radians: an end face and a support face that meet at less are tangent to each other."""

    curve_fit: float = 1e-9
    """mm: a curve in which two surfaces meet is fitted until it lies this near to both, if it can."""

    max_fit_refinement: int = 64
    """Largest number by which the six spans of the samples of such a curve are multiplied."""

    boundary_chords: int = 32
    """Number of chords, at least, that an edge is replaced by where a first guess of crossings is looked for."""

    rail_chords: int = 128
    """The same of a rail between the middle of its edge and its end."""

    chord_slack: float = 1e-9
    """Share of a chord by which a crossing may miss its ends."""

    trace_step: float = 1 / 16
    """Relative to the blend's width: length of the steps in which it is followed over the faces at its end."""

    trace_sag: float = 0.1
    """Relative to such a step: largest distance of its chord in the parameter plane from that in space."""

    least_trace_step: float = 1e-3
    """Relative to these steps: the smallest."""

    guide_terms: int = 8
    """Number of terms by which a polynomial is brought near to the points of such a curve, at most."""

    max_trace_steps: int = 500
    """Largest number of these steps on one face."""

    max_end_faces: int = 24
    """Largest number of faces that one end of a blend takes the place of."""

    max_end_attempts: int = 90
    """Largest number of ways to go on from one face to the next that are tried at one end of a blend."""

    edge_on_blend: float = 1e-7
    """mm: an edge of the input that lies this near to a blend all along is one of its edges."""

    near_rail_end: float = 1e-2
    """Relative to a step in which a blend is followed: what is nearer to the end of a rail than that is there."""

    checked_end_points: int = 7
    """Number of points of an end curve of which it is asked whether they are on the face that it ends on."""

    unit_speed: float = 4 * EPSILON
    """Share of a pcurve's parameters by which its length may differ from its range: rounding, at unit speed."""

    free_edge_samples: int = 129
    """Points of a rail, and of a free edge, among which the places are looked for where these are nearest."""

    least_border_sine: float = 0.05
    """Sine of the angle below which a free edge runs along a rail, rather than across it."""

    full_turn: float = 1e-6
    """Radians: by how much the longitude along a rail around a sphere's axis may miss a full turn."""

    deviation_margin: float = 1.05
    """Factor on a measured deviation: the smallest tolerance that surely covers it."""

    refit_deviation: float = 1e-6
    """mm: a pcurve whose image is further than this from the edge's curve is fitted again."""

    equal_depth: float = 1e-6
    """mm: the strips of a mitre whose rails arrive at the sharp edge this near to each other are equally deep."""

    square_edge: float = 1e-9
    """Radians: a sharp edge, and sections that turn about it, may be oblique by that."""

    at_mitre: float = 1e-7
    """mm: rails on one face cross where they are this near to each other."""

    longest_overrun: float = 4.0
    """Relative to the wider of two strips: how far past its end, at most, the rail of one is looked for to cross."""

    mitre_start_samples: int = 33
    """Number of points across a strip among which the first guess is looked for of where a mitre arrives at a wall."""

    shared_rail_samples: int = 17
    """Points at which two rails are compared that may be one."""

    shared_rail_speed: float = 1e-9
    """Relative: rails that differ by less in length have the same parameter, shifted."""

    corner_slack: float = 3.0
    """Factor on the largest tolerance of a face's edges: how near to a common vertex two of them may cross."""

    distinct_lines: float = 1e-6
    """Sine of the angle between straight edges above which they meet at one point alone."""

    boundary_gap: float = 1e-3
    """Relative to the size of a face in its parameter plane: how far its edges' ends may be apart to be one."""

    swallowed_edge_samples: int = 33
    """Points of each edge of a swallowed face at which it is checked that it does not reach through the blend."""

    swallowed_face_samples: int = 7
    """Points of such a face along each of its parameters."""

    clearance_samples: int = 65
    """Points of an edge or a rail by which their distances are measured for messages."""

    least_setback: float = 1e-3
    """Relative to the width of a blend of the compact form: distance of its end from the vertex of a corner from which
    on it has been made to end there."""

    compact_sides: float = 1e-6
    """Relative: by how much tangent planes and twists of sides of a corner may differ, and these be apart, where a
    blend of the compact form ends inside of its range."""

    resting_ball: float = 1e-12
    """Relative to the radius, or to the largest coordinate: by how much places in which a ball would have to be, to
    touch all faces of a corner, may differ."""

    least_ball_side: float = 0.05
    """Length of the mean direction from a resting ball's centre to its contacts, from which on they are on one side."""

    ball_axes: int = 12
    """Directions that are tried for the axis of a sphere."""

    ball_arc_spans: int = 4
    """Spans from which on an arc is fitted in the parameters of a sphere."""

    ball_arc_fit: float = 1e-12
    """rad: largest error of that fit."""

    foot_count: int = 257
    """Number of points of an edge that are projected to a face to fit its pcurve again."""

    foot_iterations: int = 4
    """Number of Newton steps of that projection."""


SHELL_EDIT_TOLERANCES = ShellEditTolerances()
