"""Tolerances and limits of potential blends."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class PotentialTolerances:
    """Numbers below which something counts as zero or as equal, and how long a step may be."""

    axis_gap: float = 1e-9
    """How far a relation may end off its axes, as a share of the larger of a and b."""

    axis_slope: float = 1e-6
    """Largest slope of a relation off the axis at its ends, as a share of its speed: derivatives of sampled functions
    have errors of this size."""

    closing_gap: float = 1e-9
    """Largest distance between the two ends of a closed surface, as a share of its coordinates."""

    closing_slope: float = 1e-6
    """Largest difference of the derivatives there, as a share of them."""

    surface_crease: float = 1e-4
    """Largest jump of the normal of a surface that is offset, rad: files of other programs are no better."""

    normal_fit: float = 1e-13
    """Largest error, for each pole, of a spline that counts as the unit normal."""

    stationary_reference: float = 1e-9
    """Largest part of the movement from a reference that is normal to the surface, as a share of the distance: below
    that the reference does not move the surface."""

    vanishing_amount: float = 1e-6
    """Largest value, and largest slope, of an amount at s = 0, as a share of the largest amount."""

    domain: float = 1e-9
    """How far a parameter may be outside of a surface, as a share of the domain."""

    kink_parameter: float = 1e-9
    """How far a kink of the swept surface may be outside of its domain [0, 1]; as near to 0, it is at 0."""

    touching_sine: float = 1e-5
    """Sine of the angle between two surfaces, below which they touch."""

    longest_correction: float = 0.3
    """Longest step of a Newton iteration, as a share of the size of the surfaces."""

    correction: float = 0.5
    """Largest correction of a predicted step in x, as a share of the step: with more, the solution may lie on another
    branch."""

    negligible_correction: float = 1e-3
    """Size of a correction that is always accepted, as a share of the size of the surfaces."""

    steady_turn: float = 1e-9
    """Largest deviation of unit tangents at equal steps from those of a line or a circle."""

    station_turn: float = 1e-5
    """Largest change of a tangent, rad, by which stations may be made smooth: more is a kink."""

    station_shift: float = 1e-3
    """Largest distance by which they may be moved, as a share of the distance of those that are interpolated."""

    start_correction: float = 0.1
    """Largest correction of a solution from a start that was interpolated along the edge, as a share of its distance
    from the edge: with more, it may lie on another branch."""

    prediction_gap: float = 0.1
    """Largest gap between known stations in which others are predicted, over the edge."""

    least_prediction_gap: float = 1e-5
    """Gap of two known stations, over the edge, below which one of them is forgotten: as nodes of an interpolation they
    would amplify rounding."""

    extrapolation: float = 2.0
    """How far past the known stations others are predicted, as a share of the last gap between these."""

    shortest_x_step: float = 1e-3
    """Shortest step in x, over [0, 1]."""

    box_fit: float = 1e-4
    """Largest error of the splines whose boxes are tested for overlap, as a share of the size of the surfaces."""

    candidate_rank: float = 1e-9
    """Singular values below this share of the largest are dropped when candidates are projected onto both surfaces."""

    candidate_converged: float = 1e-14
    """Distance of both surfaces at which the projection stops, as a share of their size."""

    candidate_gap: float = 1e-10
    """Largest distance of both surfaces at a point that counts as an intersection, as a share of their size."""

    step_turn: float = 0.25
    """Angle by which a branch turns in one step of tracing, about, rad."""

    shortest_step: float = 1e-7
    """Shortest step of tracing, as a share of the size of the surfaces."""

    longest_step: float = 1 / 12
    """Longest step of tracing, as a share of the size of the surfaces."""

    midpoint: float = 0.01
    """How far the point half-way along a step may be off the smooth curve between both ends, as a share of the step."""

    same_branch: float = 0.07
    """Distance from a traced branch up to which a point lies on it, as a share of a step."""

    relative_speed: float = 0.1
    """Least rate of a parameter along a branch whose isolines may cut the swept curves, as a share of its mean."""

    singular_area: float = 0.15
    """Share of the largest length of Su x Sv along a rail, below which the surface is nearly singular."""

    table_fit: float = 1 / 16
    """Largest error of interpolated sections, as a share of the tolerance of the interior."""

    gradient_step: float = 1e-5
    """Step of the differences by which the gradient of an implicit surface is checked, as a share of the size of the
    other one."""

    gradient_error: float = 1e-4
    """Largest difference of a gradient from these, as a share of the largest gradient."""

    strip_fit: float = 1e-10
    """Largest error of rail and derivative on an implicit surface, as a share of the size of the other one."""

    rail_fit: float = 1 / 16
    """Tolerance of the rails, as a share of that of the interior."""


@dataclass(frozen=True)
class PotentialLimits:
    """Counts: samples, steps and parts."""

    root_samples: int = 513
    """Samples of a relation among which roots are bracketed."""

    subdivision: int = 48
    """Subdivision of surfaces stops at parts whose diagonal is the common box's over this number."""

    pairs: int = 60_000
    """Largest number of pairs of parts whose boxes overlap: more are surfaces that touch along an area."""

    projection_steps: int = 25
    """Gauss-Newton steps that project candidates onto both surfaces."""

    gradient_samples: int = 17
    """Places in both directions at which the gradient of an implicit surface is checked."""

    contour_cells: int = 96
    """Cells in both directions of the grid on which contours are found."""

    shortest_contour: int = 4
    """Cells that a contour crosses at least."""

    branch_points: int = 128
    """Points of a contour."""

    branch_rounds: int = 2
    """How often these are spaced evenly and corrected."""

    tracing_steps: int = 5_000
    """Largest number of steps along one branch."""

    branch_samples: int = 257
    """Points of a branch at which the rates of its parameters are compared."""

    table_stations: int = 65
    """Stations along, of the table from which solutions are interpolated."""

    table_x_values: int = 17
    """Values of x of that table."""

    smoothed_stations: int = 64
    """Spans between stations of an edge that others are interpolated from."""

    prediction_nodes: int = 4
    """Known stations from which one in between is predicted."""

    table_cells: int = 16
    """Least number of cells of a table of sections."""

    table_shortest_cell: int = 1024
    """The domain over the length of the shortest cell: shorter ones would be at a kink."""

    table_stencil: int = 6
    """Exact sections from which one in between is interpolated."""

    closing_points: int = 8
    """Points repeated beyond both ends of a closed branch, so that its interpolant is periodic."""

    trim_bisections: int = 40
    """Bisections that find where swept curves leave a surface."""

    points_across: int = 24
    """Points across at which the swept surface is evaluated."""

    loosening_factors: tuple[float, ...] = (1.0, 10.0, 100.0)
    """Factors that are tried in turn on the default tolerance of the interior."""

    measuring_grid: tuple[int, int] = (149, 33)
    """Points along and across at which the error of a finished blend is measured."""


POTENTIAL_TOLERANCES = PotentialTolerances()
POTENTIAL_LIMITS = PotentialLimits()
