"""Tolerances and limits of blend surfaces."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.splines.bernstein import EPSILON


@dataclass(frozen=True)
class SectionTolerances:
    """Limits of the assembly of blend surfaces, and of the interiors that are added to their sections.

    Attributes
    ----------
    largest_degree
        Largest degree of OCCT's B-splines.
    most_auto_degree
        Degree along the rail up to which form "auto" is the exact one.
    grazing_sine
        Sine of the angle between rail and cross direction below which they span no tangent plane.
    torn_jump
        Jump of a cross derivative, as a share of the largest one, up to which it is rounding.
    fold_sections
        Points across, at which folds are looked for.
    fold_sections_per_degree
        Points of the coarser grid across each piece, for each degree that it has across.
    quiet_cosine, quiet_ratio
        Cosine of the angle, and ratio of the lengths, of neighbouring normals, above which they do not turn over.
    unit_weight_share
        Difference of a weight from 1 up to which a blend is polynomial.
    most_interior_degree
        Degree across of interiors: OCCT's rounding grows with it, by a factor of 2.4 for each.
    least_points_across
        Points across, at least, at which solutions of differential equations are sampled.
    finer_points_factor
        Factor on the points across where these are not enough.
    spans_per_point
        Most spans across for each point: there are points in every span.
    joint_share
        Largest error of an interior in a section that two blends share, as a share of its size.
    joint_step
        Step of the difference that gives its slope there, as a share of the domain.
    coefficient_share
        Difference of interiors, as a share of their size, and of weights, up to which they are the same.
    polynomial_share
        Share of the tolerance within which an interior may be polynomials on the section's own pieces.
    smooth_continuity
        Continuity of the splines along that interiors are approximated by.
    most_smooth_spans
        Most spans along before an interior gets kinks that it could do without.
    most_simple_degree
        Degree along of sections whose interior may be polynomial, as between planes and around axes.
    size_samples
        Parameters along, at least, at which the size of an interior is measured.
    revolved_deviation
        Deviation of a blend from a turned profile, as a share of its largest coordinate about the axis, that is
        rounding.
    arc_deviation
        Deviation of a blend from arcs of one ball, as a share of its coordinates, that is rounding.
    longitude_slack
        Angle (rad) below 0 that is 0 but for rounding, where angles start there.
    revolved_gap, revolved_full_turn
        Gap between the ends of a circular rail, as a share of its size, and difference of its angle from a full turn
        (rad), up to which it is closed.
    """

    largest_degree: int = 25
    most_auto_degree: int = 7
    grazing_sine: float = 1e-6
    torn_jump: float = 1e-7
    fold_sections: int = 97
    fold_sections_per_degree: int = 8
    quiet_cosine: float = 0.5
    quiet_ratio: float = 0.2
    unit_weight_share: float = 1e-12
    most_interior_degree: int = 7
    least_points_across: int = 72
    finer_points_factor: int = 3
    spans_per_point: float = 2 / np.pi
    coefficient_share: float = 1e-13
    joint_share: float = 1e-9
    joint_step: float = 5e-4
    polynomial_share: float = 1e-4
    smooth_continuity: int = 4
    most_smooth_spans: int = 128
    most_simple_degree: int = 4
    size_samples: int = 257
    revolved_deviation: float = 1e-12
    arc_deviation: float = 1e-12
    longitude_slack: float = 1e-6
    revolved_gap: float = 1e-9
    revolved_full_turn: float = 1e-9


@dataclass(frozen=True)
class CompactTolerances:
    """Limits of the compact form, and what decides on its knots.

    Attributes
    ----------
    curvature
        Tolerance in curvature, in units of 1 / size of the rail.
    used_share
        Share of the tolerances that may be used up where they are measured.
    most_spans
        Most spans of a compact blend.
    most_stretch_spans
        Most spans between two multiple knots: longer stretches are halved, so that matrices stay small.
    least_growth, most_growth
        Factors from one number of spans to the next.
    least_half_factor
        Smallest factor by which the span count of one half of a stretch shrinks when the other half needs more.
    harmless_jump_share
        Share of the tolerance up to which a jump is averaged away.
    multiple_knot_cost
        Poles that a multiple knot costs beyond single knots.
    candidate_pieces
        A jump may get a multiple knot if spans as long as so many pieces of the exact jets may not ignore it.
    most_candidates_apart
        Most places for multiple knots from one that is predicted to the next one.
    forgiven_span_share
        Share of a span that a predicted stretch may lack.
    explained_share
        A jump explains an error if ignoring it costs this share of the error.
    snap_share
        Share of a span: breaks of the exact jets that are nearer take the place of the middle of a stretch.
    tiny_length
        Length that stands in for that of vectors which have none.
    coefficient_rounding
        Rounding of the coefficients of a jet, relative, as far as it shows in what is compared.
    gathered_numbers
        Coefficients gathered for one evaluation, which should stay in the processor's cache.
    samples_per_span, test_points_per_span
        Samples of each span that a fit is made of, and points at which it is measured.
    """

    curvature: float = 1e-5
    used_share: float = 0.9
    most_spans: int = 4096
    most_stretch_spans: int = 48
    least_growth: float = 1.08
    most_growth: float = 4.0
    least_half_factor: float = 0.5
    harmless_jump_share: float = 0.05
    multiple_knot_cost: int = 3
    candidate_pieces: float = 2.0
    most_candidates_apart: int = 128
    forgiven_span_share: float = 0.4
    explained_share: float = 0.3
    snap_share: float = 0.1
    tiny_length: float = 1e-100
    coefficient_rounding: float = 16 * EPSILON
    gathered_numbers: int = 1 << 17
    samples_per_span: int = 4
    test_points_per_span: int = 10


SECTION_TOLERANCES = SectionTolerances()
COMPACT_TOLERANCES = CompactTolerances()
