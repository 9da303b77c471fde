"""From two ribbons to a blend by partial differential equations: the choice of equations and of functions, and the way.

Ribbons on surfaces are parametrised by their rails' lengths for that, so that what comes out does not depend on how the
rails happen to be: w runs over [0, 2 pi] on closed ones, over [0, 1] on open ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, TypeAlias

import numpy as np

from cqblend.blends.pde.equations import Equation, ShapeParameters, make_equations
from cqblend.blends.pde.least_squares import Minimise
from cqblend.blends.pde.pde_section import PdeSection
from cqblend.blends.pde.rail_basis import LEAST_SPLINE_DEGREE, Basis, Splines, Waves
from cqblend.blends.pde.rail_parameter import LengthParameter, evaluate_mean_speed
from cqblend.blends.pde.solution import BoundaryData, BoundaryProblem, EndSections, Solution
from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets
from cqblend.blends.sections.blend_surface import BlendSurface, blend_ribbons
from cqblend.blends.sections.tolerances import SECTION_TOLERANCES
from cqblend.errors import GeometryError, InputError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import merge_breaks
from cqblend.splines.integral import Antiderivative, gauss_rule

BasisName: TypeAlias = Literal["auto", "trigonometric", "bspline", "polynomial"]
BASIS_NAMES: tuple[BasisName, ...] = ("auto", "trigonometric", "bspline", "polynomial")

GAUSS_POINTS_PER_PIECE, LEAST_PIECES = 4, 128  # Gauss points of a piece, and pieces at least, at which data are read
LARGEST_WAVE_EXPONENT = (
    8.0  # exponents above belong to layers that no one sees: such waves are left to the Hermite interpolant
)
FEWEST_MODES, MOST_FREE_MODES = 8, 64  # waves or spans, where their number is free
DEFAULT_POLYNOMIAL_DEGREE, MOST_POLYNOMIAL_DEGREE = 14, 24  # of polynomials, where it is free, and at all
DATA_ACCURACY_SHARE = 1e-12  # of the size: accuracy of solutions for data, unless a better one is asked for
COORDINATE_ROUNDING = 1e-13  # of coordinates: what is below it in data is rounding
INTERIOR_TOLERANCE_SHARE = (
    1e-5  # of the distance between rails: what is between them need not be nearer to the solution
)
RESIDUAL_TERM_SHARE = 1e-4  # of the interior, that terms along rails may leave out
RAIL_ENERGY_SHARE, DATA_ENERGY_SHARE = (
    0.02,
    1e-3,
)  # of the root of the energy, likewise, and between data; the middle of the blend is right to
# the square of that


@dataclass(frozen=True)
class PdeSettings:
    """What is asked of a blend by partial differential equations.

    Attributes
    ----------
    order : tuple of int
        Of the equations of x, y and z.
    parameters
        As :func:`cqblend.blends.pde.equations.make_equations` takes them.
    terms : int or None
        Number of bubbles across; None for as many as it takes.
    basis : str
        Functions along; "auto" for waves on closed rails and B-splines on open ones.
    modes : int or None
        Waves, spans, or the degree of polynomials; None for as many as the data take.
    points : tuple of (int or None)
        Collocation points across and along.
    minimise : {"auto", "residual", "energy"}
        The sum of squares; "auto" for the residual where solutions are smooth: on closed sides, and between end
        sections that are given.
    """

    order: tuple[int, int, int]
    parameters: ShapeParameters = None
    terms: int | None = None
    basis: BasisName = "auto"
    modes: int | None = None
    points: tuple[int | None, int | None] = (None, None)
    minimise: Literal["auto"] | Minimise = "auto"

    @property
    def halves(self) -> tuple[int, int, int]:
        """How many conditions x, y and z take on each rail."""
        x, y, z = self.order
        return x // 2, y // 2, z // 2

    def blend_ribbons(
        self,
        ribbons: tuple[Ribbon, Ribbon],
        form: str,
        tolerance: float,
        angular_tolerance: float,
        *,
        closed: bool,
        by_length: bool = True,
        ends: EndSections | None = None,
    ) -> tuple[BlendSurface, Solution]:
        """Blend two ribbons, which have as many directions as the highest order takes.

        Parameters
        ----------
        ribbons, form, tolerance, angular_tolerance
            As :func:`cqblend.blends.sections.blend_surface.blend_ribbons` takes them.
        closed
            Whether both ribbons are.
        by_length
            Whether w is the rails' length, scaled, or t itself. If so, what is between the rails need not be nearer to
            the solution than a share of their distance, and neither need the solution be.
        ends
            End sections; None for those of the ribbons.

        Raises
        ------
        InputError
            The parameters are degenerate, there are too few collocation points, or the basis does not suit the rails.
        CqblendError
            As :func:`cqblend.blends.sections.blend_surface.blend_ribbons`, and where the interior takes too many spans.
        """
        task = self.pose_boundary_problem(
            ribbons, closed=closed, by_length=by_length, ends=ends, accuracy=tolerance / 10
        )
        solution, clock = task.solve(self.terms), task.clock
        knots, (kinks, orders) = clock.invert_parameter(task.basis.knots), clock.find_kinks()
        fill = PdeSection(
            solution.halves,
            max(SECTION_TOLERANCES.least_points_across, 4 * solution.terms),
            max(tolerance, INTERIOR_TOLERANCE_SHARE * task.data.width) if by_length else tolerance,
            closed,
            np.concatenate([knots, kinks]),
            np.concatenate([np.full(len(knots), LEAST_SPLINE_DEGREE - 1), orders]),
            solution,
        )
        blend = blend_ribbons(ribbons, form, tolerance, angular_tolerance, fill)
        lowest = min(self.halves) - 1
        first, second = (replace(ribbon, order=lowest) for ribbon in ribbons)
        return replace(blend, ribbons=(first, second), residual=max(solution.residual)), solution

    def pose_boundary_problem(
        self,
        ribbons: tuple[Ribbon, Ribbon],
        *,
        closed: bool,
        by_length: bool,
        ends: EndSections | None = None,
        accuracy: float,
    ) -> BoundaryProblem:
        """Return what is to be solved; ``accuracy`` (mm) is that of the data along rails, and of free terms.

        Raises
        ------
        InputError
            The parameters are degenerate, or the basis does not suit the rails.
        GeometryError
            Both rails are one curve.
        """
        jets = [ribbon.compose_jets()[: max(self.halves)] for ribbon in ribbons]
        breaks = merge_breaks(*(jet.breaks for side in jets for jet in side))
        rails = jets[0][0], jets[1][0]
        lengths = Antiderivative(partial(evaluate_mean_speed, rails), breaks)
        clock = LengthParameter(rails, lengths, None if not by_length else 2 * np.pi if closed else 1.0)
        domain = (float(breaks[0]), float(breaks[-1])) if clock.end is None else (0.0, clock.end)
        data = _read_boundary_data(
            (jets[0], jets[1]), breaks, clock, domain, closed, max(LEAST_PIECES, self.modes or 0)
        )
        made = make_equations(self.order, self.parameters, _compute_length_ratio(data, float(lengths.values[-1])))
        if not by_length:
            accuracy = min(accuracy, DATA_ACCURACY_SHARE * data.size)
        accuracy = max(accuracy, COORDINATE_ROUNDING * float(np.abs(data.centre).max() + data.size))
        basis = self._choose_basis(data, made, accuracy, limited=by_length)
        minimise = self.minimise
        if minimise == "auto":
            whole = ends is not None and ends.jets.shape[1] >= max(self.halves)
            minimise = "residual" if closed or whole else "energy"
        elif minimise == "energy" and isinstance(basis, Waves):
            raise InputError('minimise="energy" is for splines and polynomials along: take "residual"')
        share = (
            (RESIDUAL_TERM_SHARE if by_length else 0.0)
            if minimise == "residual"
            else (RAIL_ENERGY_SHARE if by_length else DATA_ENERGY_SHARE)
        )
        return BoundaryProblem(data, made, basis, clock, minimise, self.points, ends, accuracy, share, light=by_length)

    def _choose_basis(
        self, data: BoundaryData, made: tuple[Equation, Equation, Equation], accuracy: float, *, limited: bool
    ) -> Basis:
        """Choose the functions along: the fewest that hold the data."""
        kind = self.basis
        if kind == "auto":
            kind = "trigonometric" if data.closed else "bspline"
        if kind != "bspline" and data.closed != (kind == "trigonometric"):
            state, way = ("closed", "trigonometric") if data.closed else ("open", "polynomial")
            raise InputError(f'basis="{kind}" does not suit {state} rails: take "{way}" or "bspline"')
        order, period = max(self.order), data.domain[1] - data.domain[0]
        if kind == "polynomial":
            degree = max(DEFAULT_POLYNOMIAL_DEGREE, order + 1) if self.modes is None else self.modes
            if not order <= degree <= MOST_POLYNOMIAL_DEGREE:
                raise InputError(
                    f"polynomials of degree {degree} do not suit equations of order {order}: modes from {order} to "
                    f"{MOST_POLYNOMIAL_DEGREE} do"
                )
            return Splines(data.domain, degree, 1)
        most = MOST_FREE_MODES
        if limited:
            steepest = max(one.largest_exponent for one in made) * 2 * np.pi / period
            most = int(np.clip(LARGEST_WAVE_EXPONENT / steepest, FEWEST_MODES, MOST_FREE_MODES))
        if kind == "trigonometric":
            if self.modes is not None:
                return Waves(data.domain, self.modes)
            return _drop_small_waves(data, Waves(data.domain, most), accuracy)
        degree = max(order + 1, LEAST_SPLINE_DEGREE)
        if self.modes is not None:
            return Splines(data.domain, degree, self.modes, data.closed)
        spans = FEWEST_MODES
        while True:
            basis = Splines(data.domain, degree, spans, data.closed)
            if spans >= most or data.project_onto_basis(basis)[1] <= accuracy:
                return basis
            spans *= 2


def _drop_small_waves(data: BoundaryData, waves: Waves, accuracy: float) -> Waves:
    """Leave out waves that add less than the accuracy, all that follow included."""
    coefs = np.abs(data.project_onto_basis(waves)[0]).max(axis=-1).sum(axis=(1, 2))  # (count,)
    each = coefs[1::2] + coefs[2::2]
    tail = np.cumsum(each[::-1])[::-1]
    return waves.with_modes(int((tail > accuracy).sum()))


def _read_boundary_data(
    jets: tuple[tuple[Curve, ...], tuple[Curve, ...]],
    breaks: Array,
    clock: LengthParameter,
    domain: tuple[float, float],
    closed: bool,
    count: int,
) -> BoundaryData:
    """Read the boundary data of two ribbons at Gauss points of their pieces, those of side 2 with v reversed.

    There are ``count`` pieces at least, of equal lengths in w.
    """
    pieces = np.union1d(breaks, clock.invert_parameter(np.linspace(*domain, count + 1)).clip(breaks[0], breaks[-1]))
    nodes, weights = gauss_rule(GAUSS_POINTS_PER_PIECE)
    steps = np.diff(pieces)
    t = (pieces[:-1, None] + steps[:, None] * nodes).ravel()
    first, second = (dehomogenise_jets(np.stack([jet(t) for jet in side])) for side in jets)
    signs = (-1.0) ** np.arange(len(second))[:, None, None]
    measure = (steps[:, None] * weights).ravel() * clock.evaluate_rate(t)
    both = np.stack([first, second * signs])
    centre = both[:, 0].mean(axis=(0, 1))
    both[:, 0] -= centre
    return BoundaryData(clock(t), measure, both, centre, domain, closed)


def _compute_length_ratio(data: BoundaryData, length: float) -> float:
    """Return the factor on derivatives along with which v and w both count in lengths: width over length of a unit."""
    if not length > 0:
        raise GeometryError("both sides are points: there is nothing along them")
    if not data.width > 0:
        raise GeometryError("the rails are the same curve: there is nothing between them")
    return data.width * (data.domain[1] - data.domain[0]) / length
