"""Tolerances and limits of what is measured and proven of a finished blend."""

from __future__ import annotations

from dataclasses import dataclass

from cqblend.splines.bernstein import EPSILON


@dataclass(frozen=True)
class CreaseTolerances:
    """Creases inside a blend: what counts as one."""

    rounding_angle: float = 1e-9
    """Largest jump of the normal that is rounding, rad, even where no crease is allowed."""

    section_points: int = 33
    """Points of each section, at which normals are compared."""

    thin_section: float = 1e-6
    """Share of the largest length of H_t x H_v, below which a section has shrunk to a point and has no normal."""

    closing_gap: float = 1e-9
    """Largest distance between both end sections of a closed blend, as a share of its coordinates."""

    closing_kink: float = 1e-6
    """Largest kink of a closed rail where it meets itself, rad; and largest relative jump of the speed of a rail."""


@dataclass(frozen=True)
class ProofTolerances:
    """Errors of the numbers that a proof starts from, and how sharp its bounds are to be."""

    composition: float = 8 * EPSILON
    """Error of a rail composed with its primary, and of the derivatives, as a share of the largest coefficient of a
    piece; measured, it is below 2 epsilon."""

    equal_weight: float = 256 * EPSILON
    """Largest relative difference of two weights that are taken as equal; the difference then counts as an error."""

    normal_comparison: float = 8 * EPSILON
    """Error of the angle between two unit normals that are compared, rad."""

    closed_form: float = 64 * EPSILON
    """Relative error of the first derivatives, both together, of surfaces that OCCT evaluates by formulas; of each
    second derivative, half as much."""

    torus_zero: float = 10 * EPSILON
    """Share of the sum of a torus' radii up to which OCCT sets coordinates, and derivatives, to zero."""

    rotation: float = 16 * EPSILON
    """Relative error of vectors that OCCT turns about the axis of a surface of revolution, and of its cross products
    with that axis."""

    point: float = 16 * EPSILON
    """Error of points of turned profiles, planes and quadrics, as a share of the largest coordinates of the point and
    of the origin."""

    section: float = 8.0
    """Errors of a section and of its derivatives where it is taken from a profile, in units of the rounding of
    coefficients, for each degree and one more."""

    rail_parameter: float = 4 * EPSILON
    """Relative error of a rail's parameters where they are evaluated, for each degree and one more."""

    constant_weight: float = 64 * EPSILON
    """Relative variation of a weight that is taken as constant; the variation then counts as an error."""

    sharpness: float = 1.25
    """Largest ratio of a bound to a value that is attained; pieces are halved until it is reached."""

    proof_halvings: int = 12
    """Largest number of times that a piece is halved."""

    halved_pieces: int = 4096
    """Largest number of pieces that are halved at once."""


@dataclass(frozen=True)
class FairnessSampling:
    """Quadrature of the bending energy."""

    points_across: int = 24
    """Gauss points of each span across."""

    points_along: int = 4
    """Gauss points of each cell along."""

    cells: int = 128
    """Least number of cells along."""


CREASE_TOLERANCES = CreaseTolerances()
PROOF_TOLERANCES = ProofTolerances()
FAIRNESS_SAMPLING = FairnessSampling()
