"""Tolerances and limits of rails and of the cross directions along them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class RailTolerances:
    """Limits of the check of given rails, of the fit of rails and directions, and of steering.

    Attributes
    ----------
    domain_slack
        How far a rail may run outside the domain of its surface, as a share of the width of the domain.
    vanishing_share
        Speed, |Su x Sv| and wanted cross derivatives up to this, as a share of the largest along the rail, count as
        zero.
    kink_angle
        Angle (rad) by which a rail, or the surface across a knot line, may turn at a break.
    samples_per_piece
        Samples per polynomial piece; a zero between two of them shows as a slope that is steep for the value.
    halvings
        Most halvings of pieces whose control points are outside the domain.
    thirding_steps
        Steps that shrink an interval by 2/3 each in search for a minimum, 80 of them to 1e-14 of it.
    parallel_sine
        Sine of the angle between a direction and the rail up to which they count as parallel.
    undecided_cosine
        Cosine between the normal of a rail and what it should point to, up to which that lies on neither side.
    decisive_share
        Share of a rail, by length and cosine, that tells on which side of it something lies.
    operand_domain_slack
        How far the domain of an operand of a field may differ from that of the rail, relative.
    least_tangent_share
        Share of a vector that must be tangent to the surface, else it gives no cross direction.
    point_rail_share
        Size of a rail, as a share of its distance from the edge, up to which it is one point.
    measurable_share
        Shortest cross derivative that spans a tangent plane with the rail, as a share of the longest along it.
    periodic_share
        Difference of the jets at both ends of a closed ribbon, as a share of the largest, up to which it is periodic.
    light_degree_share
        Relative change that a ``light`` ribbon's jets may suffer when their degree is reduced.
    direction, length
        What a fitted direction may miss: the angle (rad), and the length (relative).
    compared_vector_share
        Vectors shorter than this share of the longest along a rail have no direction to be compared with.
    same_fit_share
        Relative difference up to which two fits of a direction are the same.
    same_value_share
        Relative difference of the values on both sides of a corner up to which the curve is continuous there.
    initial_spans
        Spans that a cubic fit starts with.
    spacing_rounds
        Fits whose spans are spaced by the errors of the one before; after these, spans that err are halved.
    aimed_share
        Share of a tolerance that a predicted number of spans aims at.
    position_order, direction_order
        Powers of the length of spans with which the errors of cubic rails, and of directions along them, fall: those of
        directions with the fourth, that of the slope of the rail with the third.
    least_span_growth, most_span_growth
        Factors from one number of spans to the next, at least and at most.
    neighbour_growth
        Share of the growth of its neighbours that a span takes part in.
    spared_span
        Part of a span that is spared when the number of spans is rounded up.
    shortest_span_by_order
        Shortest span of the directions of a given rail, as a share of the rail, by order of continuity: the rounding of
        a blend's poles shows in its derivatives of order k divided by spans to the power of k.
    shortest_span_for_direction, shortest_span_for_position
        Shortest spans of a rail fitted to contacts, as shares of it, for the sake of its directions and its position.
    least_divided_span
        Shortest span that is halved for the sake of directions, as a multiple of the shortest span that there may be.
    overlap_stations
        Stations by which a closed rail is fitted past its ends: the influence of the end of a cubic spline fades as
        0.27^n.
    exact_residual
        Distance of a straight or circular rail from the contacts, as a share of the size of the edge, up to which it is
        the rail.
    exact_deviation
        Deviation of its directions, in rad and relative, up to which they are the wanted ones.
    largest_miss
        Distance of a fitted rail from the contacts that is accepted on the shortest spans, as a multiple of the
        tolerance.
    same_station_share, same_node_share
        Differences of parameters up to which they are one station, and one node of a fit: shares of the domain.
    largest_closed_arc, largest_open_arc
        Angle (rad) of the largest piece of a circular rail that is closed, or open.
    largest_turning_arc
        The same beside a ball that turns in place, on arcs that may be longer than a quarter of a circle.
    sliver_share
        Breaks nearer to each other than this share of the rail become one.
    fade_fit_share
        Error of the fit of a turn where it fades, as a share of the turn, that is accepted.
    fade_length_share
        Length, as a share of the rail, over which a turn fades, unless the next pin is nearer.
    fastest_turn
        By how much the end of a cross derivative may be moved by a turn, as a share of the length of the rail on which
        it turns.
    near_rail_angle
        Angle (rad) between a knot line and the rail below which a direction along the line is too near to the rail.
    folding_turn, largest_turn
        Turns of directions (rad): above the first a blend may fold, the second is the largest that can be asked for.
    foot_steps, foot_step
        Most steps to the foot of a point that is on the surface to a tolerance, and the length of the last one, as a
        share of the coordinates.
    turn_margin
        Added to a turn (rad) that is proposed, since what is needed depends a little on what is turned.
    """

    domain_slack: float = 1e-9
    point_rail_share: float = 1e-10
    vanishing_share: float = 1e-9
    crease_angle: float = 1e-6
    samples_per_piece: int = 8
    halvings: int = 40
    thirding_steps: int = 80
    parallel_sine: float = 1e-6
    undecided_cosine: float = 1e-9
    decisive_share: float = 2 / 3
    operand_domain_slack: float = 1e-14
    least_tangent_share: float = 1e-6
    measurable_share: float = 1e-4
    periodic_share: float = 1e-6
    light_degree_share: float = 1e-13
    direction: float = 1e-5
    length: float = 1e-3
    compared_vector_share: float = 1e-3
    same_fit_share: float = 1e-6
    same_value_share: float = 1e-14
    initial_spans: int = 16
    spacing_rounds: int = 3
    aimed_share: float = 0.6
    position_order: float = 4.0
    direction_order: float = 3.4
    least_span_growth: float = 1.0
    most_span_growth: float = 5.0
    neighbour_growth: float = 0.8
    spared_span: float = 0.05
    shortest_span_by_order: tuple[float, float, float, float] = (1 / 512, 1 / 512, 1 / 128, 1 / 64)
    shortest_span_for_direction: float = 1 / 128
    shortest_span_for_position: float = 1 / 4096
    least_divided_span: float = 1.3
    overlap_stations: int = 24
    projection_residual: float = 2e-13
    exact_deviation: float = 1e-11
    largest_miss: float = 10.0
    same_station_share: float = 1e-13
    same_node_share: float = 1e-9
    largest_closed_arc: float = np.pi / 2
    largest_open_arc: float = 2 * np.pi / 3
    largest_turning_arc: float = np.pi / 4
    sliver_share: float = 2e-5
    fade_fit_share: float = 0.02
    fade_length_share: float = 0.1
    fastest_turn: float = 0.4
    near_rail_angle: float = 0.05
    folding_turn: float = 0.8
    largest_turn: float = 1.57
    turn_margin: float = 0.01
    foot_steps: int = 20
    foot_step: float = 1e-16


@dataclass(frozen=True)
class ProjectionTolerances:
    """Limits of the projection of space curves onto surfaces.

    Attributes
    ----------
    guide_stations
        Stations whose foot points are the starts of all others.
    seeds_per_patch, most_grid_lines
        Points of the grid, in each direction, among which the nearest is looked for: per patch, and at most.
    foot_newton_steps, damping_steps
        Most Newton steps, and halvings of each.
    converged_step
        Newton step, as a share of the domain, at which an iteration ends: the next one would be its square.
    domain_margin
        How far outside the domain iterations may run, as a share of its width.
    jump_share
        Step of the foot point between neighbouring stations, as a share of the domain, that is taken for a jump.
    refinements
        Times that spans are halved, from a quarter of the domain to 2e-6 of it: what is sharper than that is a kink.
    most_stations
        Most stations of a projection.
    closing_share
        Relative difference of both ends up to which curve and foot points are periodic.
    least_station_gap
        Share of the domain by which stations at knot-line crossings keep away from others.
    """

    guide_stations: int = 129
    seeds_per_patch: int = 3
    most_grid_lines: int = 96
    foot_newton_steps: int = 60
    damping_steps: int = 12
    converged_step: float = 1e-12
    domain_margin: float = 0.125
    jump_share: float = 0.25
    refinements: int = 17
    most_stations: int = 4000
    closing_share: float = 1e-9
    least_station_gap: float = 1e-9


RAIL_TOLERANCES = RailTolerances()
PROJECTION_TOLERANCES = ProjectionTolerances()
