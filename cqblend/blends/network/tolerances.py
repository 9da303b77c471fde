"""Tolerances of strips and plans."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class NetworkTolerances:
    """Tolerances of the modules in :mod:`cqblend.blends.network`."""

    parallel_rails: float = 1e-14
    """Relative to their length: by how much the rulings of a straight strip may differ, that of rounding."""

    least_cut_sine: float = 1e-3
    """Sine of the angle between a plane and the rulings of a strip below which they do not cut cleanly."""

    section_plane: float = 1e-15
    """Relative to the size: by how much an axis may miss a plane that a section is to lie in."""

    first_chords: int = 16
    """Chords of each curve of a face's boundary to begin with."""

    chord_parts: int = 6
    """Parts of a chord that is too long to tell whether it meets another one."""

    chord_refinements: int = 14
    """Largest number of times that chords are cut finer."""

    most_chord_pairs: int = 50_000
    """Pairs of chords above which curves that run along each other are taken to meet."""

    sagitta_margin: float = 1.25
    """Factor on the distance of a curve from the middle of its chord: the most that it is from all of the chord."""

    same_parameter: float = 1e-12
    """Relative: chords whose parameters are this near to each other are neighbours."""

    parting_angle: float = 1e-2
    """Radians: curves that leave a common end at more do not meet again before they bend."""

    coincident_lines: float = 1e-7
    """Radians: straight curves that leave a common end at less lie on each other."""

    cut_fit: float = 1e-13
    """Relative to their size, at least 1: largest error of an ellipse in the parameters of its strip, as a spline."""

    mapped_rounding: float = 1e-14
    """Relative to the largest parameter: what is added to that error where a curve is mapped to another plane."""

    cut_spans: int = 4
    """Spans from which on that is fitted."""

    turned_fit: float = 1e-12
    """Radians: largest error of the great circle beside a ball that turns in place, in longitude and latitude."""

    same_arc: float = 1e-11
    """Relative to the width of a chain, or rad: by how much the arcs of two cells may differ where these meet."""

    arc_plane: float = 1e-12
    """Relative to the radius of the strip, or rad: by how much a plane in which the section of a strip of arcs is to
    lie may miss its axis, or turn from it."""

    natural_gap: float = 1e-12
    """Distance (mm) of the end sections of two cells up to which they have one by nature, near the origin."""

    section_rounding: float = 4e-15
    """The same, relative to the largest coordinate, farther from there."""

    torn_section: float = 1e-9
    """Distance (mm) of the end sections of two cells from which on they are apart."""

    natural_angle: float = 1e-12
    """Angle (rad) of their tangent planes up to which they have them in common by nature."""

    same_curvature: float = 1e-11
    """Difference of normal curvatures (1/mm) up to which two faces are one surface to the second order."""

    section_samples: int = 33
    """Points of a section at which two cells are compared."""

    parallel_rates: float = 1e-12
    """Relative to the largest: by how much derivatives of jets along a cell may be off a direction that they share."""

    pole_rate: float = 1e-6
    """Relative to that on the other side: square of the speed of a rail at a pole, where it stands still."""

    pole_rounds: int = 2
    """How often rates beside a pole are corrected: once, and for rounding."""

    nearly_parallel_rates: float = 1e-5
    """The same of estimated ones, which are then made parallel."""

    parallel_normals: float = 1e-6
    """Sine of the angle between the normals of both surfaces below which they do not tell the direction of a cell."""

    along_edge: float = 1e-12
    """Sine of the angle between a cross derivative and a smooth edge up to which it runs along the edge."""

    edge_curvature: float = 1e-9
    """Difference of curvature (1/mm) up to which a section bends as the smooth edge does that it runs along."""

    largest_obliquity: float = np.pi / 3
    """Angle (rad) from square up to which a smooth edge may cross a rail for cross derivatives to run along it."""

    bending_widths: float = 1.0
    """Length over which a rail that arrives at the end of a cell at an angle is bent, in widths of the blend."""

    checked_stations: int = 129
    """Parameters of a cell at which shifted stations must follow one another."""

    bend_samples: int = 17
    """Points along a bend at which it is measured how far it is from the natural rail."""

    turning_widths: float = 2.0
    """Length over which stations at the end of a cell are shifted, and cross derivatives turned, in the same unit."""

    most_faded: float = 0.4
    """These lengths, as a share of the cell, at most."""

    probe_count: int = 6
    """Contacts from which derivatives at the end of a cell are found."""

    probe_width: float = 1 / 32
    """Distance between them, as a share of the width of the blend."""

    probe_share: float = 1 / 96
    """The same distance, as a share of the cell, at most."""

    lifted_step: float = 0.05
    """Step from an end into a cell, as a share of it, on which derivatives of lifted curves are taken."""

    inner_share: float = 0.05
    """Share of a cell, from its end, at which its rail tells on which side of a smooth edge the cell is."""

    side_step: float = 1e-11
    """Share of the way from the edge to there: a step that passes a knot line, and nothing else."""

    edge_samples: int = 65
    """Points of a smooth edge of which the nearest starts the search for its crossing with a rail."""

    station_probe: float = 1e-4
    """Step in t for the derivative of interpolated contacts along a cell, in that search."""

    station_steps: int = 40
    """Most steps of the search."""

    station_exact: float = 1e-14
    """Steps, in t and as a share of the edge, with which it ends at once."""

    common_stations: float = 1e-13
    """In t: stations of both sides that differ by no more are the same but for rounding."""

    station_rounding: float = 1e-9
    """Steps, in t and as a share of the edge, from which on they are due to rounding if they no longer halve."""

    longest_station_step: float = 0.1
    """Longest step in t, unless ``station_step_width`` is more: a short cell may be left by several lengths of it."""

    station_step_width: float = 1 / 8
    """The same, as a share of the width of the blend."""

    least_normal_share: float = 1e-9
    """Length of the normal of a cell along its end section, as a share of the longest, from which on it has one."""

    tangent_count: int = 7
    """Points of a smooth edge from which its curvature is found."""

    tangent_step: float = 1 / 100
    """Distance between them, as a share of the edge."""

    edge_slack: float = 1e-6
    """Share of a smooth edge by which a rail may miss its end."""

    order_trials: int = 4000
    """How many choices are tried to find an order in which edges that meet in corners can be blended."""

    matching_trials: int = 400
    """How many choices are tried to find edges that are first at all of these corners, so that there are few stages."""


@dataclass(frozen=True)
class BridgeTolerances:
    """Tolerances of the modules that make the rails and ribbons of bridges."""

    most_newton_steps: int = 30
    """Most steps of Newton's method for the point at a length, and for its foot on a surface."""

    exact_step: float = 2e-15
    """Relative to the parameters, or to coordinates: steps with which it ends."""

    same_place: float = 1e-9
    """Relative to a loop: lengths that differ by less are one place."""

    loop_samples: int = 512
    """Points of a loop by which it is compared with another."""

    frame_steps: int = 64
    """Steps in which a frame is carried along a bridge."""

    matched_share: float = 0.55
    """Corners of both rails this near to each other, in shares of the mean distance of corners where they are more, are
    matched: a little more than half of it."""

    rail_share: float = 1e-8
    """Relative to the size of a bridge: largest distance of a rail from the edge or curve that it is to follow."""

    least_rail: float = 1e-9
    """mm: the least that this is taken for."""

    turn_softening: float = 0.5
    """Softening of 1 + cos in the length of arcs, by the angle between tangent and chord, so that those that leave
    backwards stay short: they have at most so many chords as 2 over this."""

    inset: tuple[float, float, float, float] = (2.0, 2.0, 1.4, 1.1)
    """Largest length of cross derivatives that lead into an opening, in radii of the largest circle in it there, by the
    order of continuity: sections of a higher order go on further at the same length."""

    bend_weight: float = 0.75
    """Share of the curvature of a loop that counts like that of the largest circle in the opening."""

    facing_cosine: float = -0.75
    """Cosine between the tangents of a loop below which parts of it face each other across the opening."""

    tightness_reach: float = 0.025
    """Share of a loop over which its bends count, to either side of them."""


NETWORK_TOLERANCES = NetworkTolerances()
BRIDGE_TOLERANCES = BridgeTolerances()
