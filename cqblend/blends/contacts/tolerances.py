"""Tolerances and limits of the search for contacts."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ContactTolerances:
    """Limits of Newton's method, of the continuation in the size, and of the search for knot-line crossings.

    Attributes
    ----------
    smooth_edge_sine
        Sine of the angle between two faces below which an edge counts neither as convex nor as concave.
    newton_steps
        Most iterations of the damped Newton method; four suffice next to the solution, starts far away need the rest,
        since their steps are shortened.
    exact_residual
        Residual, as a share of the scale of the equations, below which an iteration stops at once.
    stalled_residual
        The same share, below which it stops as soon as the residual no longer halves: what moves then is rounding.
    converged_residual
        The same share, up to which a result counts as a solution.
    kinked_residual
        The same where the iteration has not come to an end: it goes to and fro across a kink of a face.
    quadratic_step, quadratic_residual
        A step, as a share of the longest one, and the residual before it, as that share, that lead to the solution: the
        error left is about the square of the step.
    round_radii
        Radii of a face that is looked at more closely, whether it is round: the least and the largest, as shares of
        that of the ball.
    round_spread
        Distance of the contacts, at both ends of an edge, of a ball that fits into a face, as a share of its radius, up
        to which the face is round.
    straight_arc
        Sine of the angle between the chords of three points, by which they are on a line.
    radius_steps
        Steps in which the radius of the ball is changed from that of the face.
    turning_share
        Distance of the contacts of a ball that turns in place, as a share of its radius, up to which they are one: by
        so much polynomial blends, in which it turns, are off their balls.
    turning_probes, turning_stations
        Stations at which such a ball is looked for, and by which the edge is known.
    longest_projection_step
        Longest Newton step onto the intersection of two surfaces, as a share of the length of the edge.
    least_ball_opening
        Angle (rad) between the radii to the two contacts of a ball, below which they are one point.
    first_size_share
        Share of a radius or width at which a continuation in the size starts, and the least by which it grows (relative
        to the size reached).
    largest_prediction_error
        How far a contact may be from where the continuation expects it, as a share of the step.
    largest_tracing_error
        How far a contact may be from where its neighbours along the edge let expect it, as a share of its distance from
        the edge.
    full_turn_slack
        Difference of the angle of an edge around an axis from a full turn (rad) up to which it is one.
    least_held_radius, held_growth_steps
        Radius, as a share of the distance of a held point from the surface, from which balls grow where they are not
        found at once, and in how many steps; half that distance is the least that reaches.
    tracing_stations
        Stations that a polynomial through known contacts runs through.
    least_tracing_gap
        Share of the known range: of stations that are nearer to each other, one is used for that.
    extrapolated_share
        How far past the ends of the known range, as a share of it, contacts are expected from known ones.
    rough_continuity
        Knot lines at which a surface is less smooth than C3, this number, are looked for.
    crossing_stations
        Stations between which contacts are checked for crossing a knot line. Those of a first fit of 16 equal spans are
        among them.
    secant_steps
        Most steps of regula falsi towards a crossing.
    kink_probe_share
        Step of the one-sided differences that tell a kink at a crossing, as a share of the rail.
    crossing_residual
        Distance of a native parameter from its knot line at which a crossing counts as reached.
    """

    smooth_edge_sine: float = 1e-3
    newton_steps: int = 40
    exact_residual: float = 1e-15
    stalled_residual: float = 1e-11
    converged_residual: float = 1e-9
    kinked_residual: float = 1e-5
    quadratic_step: float = 1e-8
    quadratic_residual: float = 1e-6
    round_radii: tuple[float, float] = (0.99, 2.0)
    round_spread: float = 1e-2
    straight_arc: float = 1e-6
    radius_steps: int = 4
    turning_share: float = 2e-2
    turning_probes: int = 9
    turning_stations: int = 33
    longest_projection_step: float = 0.1
    least_ball_opening: float = 1e-9
    first_size_share: float = 1 / 128
    largest_prediction_error: float = 0.5
    largest_tracing_error: float = 0.1
    full_turn_slack: float = 1e-9
    least_held_radius: float = 0.7
    held_growth_steps: int = 16
    tracing_stations: int = 6
    least_tracing_gap: float = 1e-5
    extrapolated_share: float = 0.5
    rough_continuity: int = 3
    crossing_stations: int = 145
    secant_steps: int = 30
    kink_probe_share: float = 1e-3
    crossing_residual: float = 1e-13


CONTACT_TOLERANCES = ContactTolerances()
