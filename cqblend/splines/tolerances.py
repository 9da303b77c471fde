"""Tolerances and limits of spline arithmetic."""

from dataclasses import dataclass


@dataclass(frozen=True)
class SplineTolerances:
    """Numbers below which something counts as zero or as equal."""

    near_breaks: float = 1e-6
    """Distance, as a share of the domain, below which breaks of the curves of one blend are brought together."""

    same_break: float = 1e-9
    """Distance, as a share of the domain, below which breaks of the curves of one ribbon are one break, computed in
    different ways."""

    moved_break: float = 1e-13
    """Distance, as a share of the domain, from which a break counts as moved and loses an order of continuity."""

    piece_gap: float = 1e-4
    """Gap between pieces at a break that has moved, as a share of the largest coefficient, up to which it is closed."""

    crossing_merge: float = 1e-9
    """Distance, as a share of the domain, below which crossings of C1 knot lines are one break. Going on with the wrong
    patch over such a distance errs by its square, while a piece so short would have derivatives of rounding noise."""

    kink_crossing_merge: float = 1e-12
    """The same for knot lines with a kink: a crossing that is closer to a break than this is that break."""

    integral: float = 1e-14
    """Largest error of an antiderivative, as a share of the integral of the absolute value."""

    touching: float = 1e-9
    """Distance, as a share of a curve's size, at which two of its points count as one."""

    neighbour_gap: float = 1e-7
    """Length of parameter, as a share of the domain, across which two pieces of a curve count as neighbours."""

    amplification: float = 50.0
    """Largest factor by which re-assembly of a B-spline may amplify rounding errors before it keeps another knot."""

    closed_surface_gap: float = 1e-7
    """Largest gap between the ends of a closed surface, as a share of its largest coefficient."""

    consecutive_domains: float = 1e-14
    """Largest gap between the domains of curves that are joined, as a share of the parameters."""

    antiperiodic_gap: float = 1e-9
    """Largest sum of the first and the last value of an antiperiodic function, as a share of its largest value."""

    least_weight: float = 1e-9
    """Least weight of a change of parameter, as a share of its largest weight."""

    standing_speed: float = 1e-12
    """Speed below which a curve stands still, as a share of its size over its domain."""

    vanishing_field: float = 1e-9
    """Length below which a vector field has no direction, as a share of its largest length."""

    coupling: float = 1e-17
    """Coupling of two equations, as a share of what multiplies their own unknowns, that counts as none."""

    refined_fit: float = 5e-14
    """Error, as a share of the largest value, that ends the refinement of a spline that reproduces a function."""

    accepted_fit: float = 1e-12
    """Error, as a share of the largest value, that is accepted where refinement no longer helps: functions have
    rounding errors of their own."""

    same_kink: float = 1e-9
    """Distance, as a share of the domain, below which kinks of a function that is fitted are one."""

    kink_snap: float = 0.01
    """Distance, as a share of the domain, within which kinks where a function is C4 move to a given break: next to it,
    a knot would leave a sliver."""


@dataclass(frozen=True)
class SplineLimits:
    """Counts beyond which an argument is refused, or a computation gives up."""

    derivative: int = 100
    """Largest order of a derivative: doubles hold nothing beyond."""

    elevation: int = 500
    """Largest amount by which a degree is raised."""

    bspline_degree: int = 10_000
    """Largest degree of a B-spline, far beyond what doubles hold."""

    periods: int = 1000
    """Largest number of further periods of a closed surface."""

    factor_pieces: int = 4096
    """Largest number of pieces of the factor that gives a vector field its length, and of knots inserted into it."""

    factor_attempts: int = 5
    """Number of times that such a factor is made, each time for a smaller error."""

    fit_pieces: int = 4096
    """Largest number of pieces of a spline that reproduces a function to rounding."""

    initial_spans: int = 16
    """Number of nearly equal spans that a least-squares fit of a curve starts with."""

    shortest_span: float = 1 / 4096
    """Shortest span of a least-squares fit, as a share of the domain."""

    cell_halvings: int = 48
    """Number of times that the cells of an antiderivative are halved."""

    root_levels: int = 17
    """Number of times that a piece is cut into 8 to isolate roots: 8^17 = 2^51 parts of the unit interval."""

    crossing_halvings: int = 50
    """Number of times that the pieces of a curve are halved to find where it meets itself."""

    close_pairs: int = 4000
    """Number of pairs of pieces that are still close from which a curve counts as running along itself."""


SPLINE_TOLERANCES = SplineTolerances()
SPLINE_LIMITS = SplineLimits()
