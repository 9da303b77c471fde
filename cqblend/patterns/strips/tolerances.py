"""Tolerances and limits of dividing a surface into strips and of pairing rulings."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class StripTolerances:
    """Tolerances and limits of the division of surfaces into strips.

    Attributes
    ----------
    kink_angle
        Rad: angle between tangents in the ruled direction from which on a knot line is a kink, at which strips end.
    max_strips
        Strips of one surface from which on the tolerance counts as out of reach.
    shortest_strip
        Relative to the domain: no strip is shorter.
    sampled_deviation
        Relative to the tolerance: largest sampled deviation of a strip, so that its bound is mostly within the
        tolerance at once.
    length_shrink
        Factor on the length of a strip, one time more for every bound that exceeds the tolerance.
    length_margin
        Relative: by how much an interpolated length is made shorter.
    even_start
        First bound, relative to the mean bound of the longest strips, that is tried for even ones.
    even_stop
        Ratio between a bound that is too small for as many strips and one that is not, at which the search stops.
    closed_gap
        Relative to the size: opposite sides that are closer together make the surface closed.
    pole_normal
        Relative to the largest normal: below it there is none, as at a pole.
    degenerate_area
        Relative to the squared size: a surface of less area has none.
    coincident_points
        Relative to the size: points closer together are one.
    receding_foot
        Relative to the largest scalar product of a step and its ruling: below minus this, feet of perpendiculars turn
        back.
    bound_ratio
        Between a bound and a deviation that is attained, at which the bound is not sharpened further.
    negligible_bound
        Relative to the tolerance: bounds below it are not sharpened further.
    max_levels
        How often patches are subdivided to sharpen a bound, at most.
    max_patches
        How many patches are subdivided at once, at most.
    peak_excess
        Relative to the largest squared curvature: by how much a maximum exceeds its neighbours.
    border_margin
        Relative to the domain: strip along the borders, which may be poles, where no curvature is evaluated.
    maxima_merge
        Relative to the domain: maxima of the curvature that are closer together are one.
    max_refinement_step
        Largest factor by which the tolerances of a face are divided at once, when it is divided again.
    max_refinement
        Largest factor altogether.
    max_cross_cuts
        How often a strip is cut across at most.
    equal_strain
        Strains that differ by less are equal.
    """

    kink_angle: float = 1e-3
    max_strips: int = 10_000
    shortest_strip: float = 1e-11
    sampled_deviation: float = 0.998
    length_shrink: float = 0.998
    length_margin: float = 1e-4
    even_start: float = 1.01
    even_stop: float = 1.002
    closed_gap: float = 1e-9
    pole_normal: float = 1e-9
    degenerate_area: float = 1e-10
    coincident_points: float = 1e-9
    receding_foot: float = 1e-12
    bound_ratio: float = 1.01
    negligible_bound: float = 0.01
    max_levels: int = 9
    max_patches: int = 1 << 14
    peak_excess: float = 1e-9
    border_margin: float = 1e-3
    maxima_merge: float = 1e-5
    max_refinement_step: float = 4.0
    max_refinement: float = 64.0
    max_cross_cuts: int = 32
    equal_strain: float = 1e-6


@dataclass(frozen=True, slots=True)
class RulingTolerances:
    """Tolerances and limits of developability, and of the pairing of rulings.

    Attributes
    ----------
    developable
        Relative tolerance at which a strip counts as developable, planar, cylindrical or conical.
    least_twist
        Rad: twists below it are not told apart.
    least_squared_turn
        Squared tangent of an angle between normals below which angles are not told apart.
    clearly_twisted
        Twist (rad) of a sampled ruling from which on a strip needs no proof that it is twisted.
    twist_bound_ratio
        Between the bound of the squared twist and a value that is attained, at which it is not sharpened further.
    turn_bound_ratio
        The same for the squared tangent of the angle between the normals at the ends of a ruling.
    stationary_rail
        Relative to the fastest piece: a rail that is slower does not move.
    farthest_apex
        Relative to the size: a point farther away is no apex.
    worst_condition
        Of the equations for the apex.
    path_error
        Relative to the parameters of the rails: largest error of the fitted path of the pairing.
    parameter_snap
        Relative to the parameters of the rails: parameters closer to a break or an end are there.
    settled_step
        Relative to the parameters of the rails: steps of Newton's method that are shorter, and no longer halve, are
        rounding.
    corner_sine
        Sine of the angle between tangents at a break, from which on a rail has a corner.
    turning_back
        Relative: by how much the path of a pairing may exceed its steepest slope before it turns back.
    """

    developable: float = 1e-9
    least_twist: float = 1e-12
    least_squared_turn: float = 1e-24
    clearly_twisted: float = 1e-4
    twist_bound_ratio: float = 1.2
    turn_bound_ratio: float = 1.02
    stationary_rail: float = 1e-9
    farthest_apex: float = 1e4
    worst_condition: float = 1e12
    path_error: float = 1e-11
    parameter_snap: float = 1e-12
    settled_step: float = 1e-9
    corner_sine: float = 1e-9
    turning_back: float = 1e-9


STRIP_TOLERANCES = StripTolerances()
RULING_TOLERANCES = RulingTolerances()
