"""Tolerances and limits of blends by partial differential equations."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PdeTolerances:
    """Numbers below which something counts as zero, as equal, or as accurate enough."""

    tangent_area: float = 1e-9
    """Least length of C' x T of boundary data, as a share of the largest of C' times the largest of T: below that,
    position C and first derivative T span no tangent plane."""

    closing_gap: float = 1e-9
    """Largest distance between start and end of closed boundary data, as a share of their size."""

    slope_step: float = 1e-4
    """Step of the one-sided differences by which the slopes of a function at its ends are compared, as a share of its
    domain."""

    function_slope_gap: float = 1e-5
    """Largest difference of these slopes of a closed function, times the domain, as a share of the function's size."""

    curve_slope_gap: float = 1e-6
    """The same for a curve, whose slopes are exact."""

    degenerate_symbol: float = 1e-9
    """Share of the sum of the absolute values of its terms, up to which an equation's symbol counts as zero."""

    real_extremum: float = 1e-6
    """Largest imaginary part, as a share of the absolute value, of an extremum of the symbol that counts as real."""

    real_root: float = 1e-4
    """The same of a root of the symbol."""

    negligible_residual: float = 1e-7
    """Share of the terms of an equation, up to which their sum is rounding."""

    data_accuracy: float = 1e-12
    """Accuracy of solutions between boundary data, as a share of the size of the data, unless a better one is asked
    for."""

    coordinate_rounding: float = 1e-13
    """Share of the coordinates, below which differences in boundary data are rounding."""

    interior: float = 1e-5
    """How far, as a share of the distance of the rails, a blend between rails may be from the solution."""

    residual_terms: float = 1e-4
    """Share of the interior that the last two terms along rails may change, where the residual is minimised."""

    rail_energy: float = 0.02
    """Share of the root of the energy that two more terms along rails may change. The middle of the blend is right to
    the square of that."""

    data_energy: float = 1e-3
    """The same between boundary data."""

    parameter_fit: float = 1e-9
    """Largest error of a parameter that varies, as a curve, as a share of its largest value."""

    local_width: float = 1e-4
    """The same of the distance of the rails, whose own fit is no better."""

    least_local_width: float = 0.01
    """Distance of the rails, as a share of the largest, below which the width by which parameters vary levels off."""

    least_parameter_width: float = 1e-4
    """Least width of a strip by which parameters vary, as a share of the largest."""

    refinement: float = 0.5
    """Share of the tolerance of a solution that the next refinement of either kind may change."""


@dataclass(frozen=True)
class PdeLimits:
    """Counts, degrees and ratios: what is tried, and what is refused."""

    coefficient_ratio: float = 1e12
    """Largest ratio of another coefficient of an equation to its first one. Beyond, boundary layers along the rails are
    thinner than anything that resolves them."""

    parameter_samples: int = 1025
    """Places along at which parameters that vary are checked."""

    exponent_stride: int = 32
    """Of these, every so many tell the largest exponent."""

    smooth_continuity: int = 4
    """Greatest continuity at which a break of a rail still counts as a kink of its length."""

    gauss_points: int = 4
    """Gauss points of a piece of the rails, at which boundary data are read."""

    pieces: int = 128
    """Least number of these pieces."""

    span_gauss_points: int = 4
    """Least number of Gauss points of a spline span along, at which an equation is to hold."""

    points_per_wave: int = 4
    """Points along for each function, at which an equation that couples waves is to hold."""

    wave_exponent: float = 8.0
    """Largest exponent of a solution in v that is resolved where the number of waves is free. Waves with larger ones
    make boundary layers that nobody sees; they are left to the Hermite interpolant."""

    fewest_modes: int = 8
    """Least number of waves or spans along, where it is free."""

    most_modes: int = 64
    """Largest number of waves or spans along, where it is free."""

    polynomial_degree: int = 14
    """Degree of polynomials along, where it is free."""

    most_polynomial_degree: int = 24
    """Largest degree of polynomials along that may be asked for."""

    term_counts: tuple[int, ...] = (4, 6, 9, 13, 18, 24, 32, 40)
    """Numbers of bubbles that are tried in turn, where the number is free."""

    most_degree_across: int = 9
    """Largest degree across of solutions by the energy, where the number of bubbles is free."""

    most_free_unknowns: int = 1500
    """Largest number of unknowns of one least-squares system, where the number of bubbles is free."""

    most_span_unknowns: int = 3000
    """The same where the system is solved span by span."""

    most_unknowns: int = 6000
    """Largest number of unknowns of one least-squares system."""

    most_matrix_entries: int = 10**8
    """Largest number of entries of a matrix for collocation points that the caller asks for: 0.8 GB."""

    fewest_refined_terms: int = 6
    """Least number of bubbles where solutions are refined until a tolerance is met."""

    change_grid: tuple[int, int] = (65, 17)
    """Points along and across at which two solutions are compared."""

    extra_points: int = 5
    """Further points, beside those of the solution, at which a residual is measured."""

    extra_bubbles: int = 2
    """Further bubbles, for which the error of the energy is estimated."""


PDE_TOLERANCES = PdeTolerances()
PDE_LIMITS = PdeLimits()
