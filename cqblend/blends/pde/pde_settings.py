"""Sets up the equations between two ribbons: their order, the basis along the rails, and the accuracies.

Ribbons on surfaces are parametrised by the length of their rails, so that the blend does not depend on how the rails
are parametrised: w runs over [0, 2 pi] on closed rails, over [0, 1] on open ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Literal, TypeAlias

import numpy as np

from cqblend.blends.pde.equations import Equation, LinearEquation, Minimise
from cqblend.blends.pde.pde_section import PdeSection
from cqblend.blends.pde.rail_basis import LEAST_SPLINE_DEGREE, Splines, Waves
from cqblend.blends.pde.rail_parameter import LengthParameter, evaluate_mean_speed
from cqblend.blends.pde.refinement import solve_within
from cqblend.blends.pde.solution import BoundaryData, BoundaryProblem, EndSections, Solution
from cqblend.blends.pde.tolerances import PDE_LIMITS, PDE_TOLERANCES
from cqblend.blends.pde.varying_equation import (
    ParameterFunction,
    RailInterval,
    VaryingEquation,
    VaryingParameters,
    make_varying_equations,
    make_width_equations,
)
from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets
from cqblend.blends.sections.blend_surface import BlendSurface, blend_ribbons
from cqblend.blends.sections.tolerances import SECTION_TOLERANCES
from cqblend.errors import GeometryError, InputError
from cqblend.splines import Curve
from cqblend.splines.antiderivative import Antiderivative, gauss_rule
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import merge_breaks

BasisName: TypeAlias = Literal["auto", "trigonometric", "bspline", "polynomial"]
BASIS_NAMES: tuple[BasisName, ...] = ("auto", "trigonometric", "bspline", "polynomial")


LOCAL_WIDTH = "local"
"""The parameters whose width is the distance of the rails at each place."""


@dataclass(frozen=True)
class SideSetup:
    """How both sides of a blend are laid out along.

    Attributes
    ----------
    closed : bool
        Whether both are closed.
    by_length : bool
        Whether w is the length of the rails, scaled, or else t itself. Between rails (by length), the blend need not be
        nearer to the solution than ``PDE_TOLERANCES.interior``, and the solution is computed accordingly.
    ends : EndSections or None
        End sections of open sides; None for those of the Hermite section.
    joined : bool
        Whether other blends go on at the ends of open sides: then the derivative along is that of the Hermite section
        there, too.
    """

    closed: bool
    by_length: bool = True
    ends: EndSections | None = None
    joined: bool = False


@dataclass(frozen=True)
class PdeSettings:
    """The options of a blend by partial differential equations.

    Attributes
    ----------
    order : tuple of int
        Orders of the equations of x, y and z.
    parameters
        As :func:`cqblend.blends.pde.varying_equation.make_varying_equations` takes them, or "local" for the distance of
        the rails at each place.
    terms : int or None
        Number of bubbles across; None for as many as it takes.
    basis : str
        Functions along; "auto" for waves on closed rails and B-splines on open ones.
    modes : int or None
        Number of waves or spans, or the degree of polynomials; None for as many as the data take.
    points : tuple of (int or None)
        Collocation points across and along.
    minimise : {"auto", "residual", "energy"}
        The sum of squares; "auto" for the residual where solutions are smooth: on closed sides, and between end
        sections that are given.
    """

    order: tuple[int, int, int]
    parameters: VaryingParameters = None
    terms: int | None = None
    basis: BasisName = "auto"
    modes: int | None = None
    points: tuple[int | None, int | None] = (None, None)
    minimise: Literal["auto"] | Minimise = "auto"

    @property
    def halves(self) -> tuple[int, int, int]:
        """Number of conditions on each rail for x, y and z."""
        x, y, z = self.order
        return x // 2, y // 2, z // 2

    def blend_ribbons(
        self,
        ribbons: tuple[Ribbon, Ribbon],
        form: str,
        tolerance: float,
        angular_tolerance: float,
        setup: SideSetup,
    ) -> tuple[BlendSurface, Solution]:
        """Blend two ribbons, which have as many directions as the highest order takes.

        Parameters
        ----------
        ribbons, form, tolerance, angular_tolerance
            As :func:`cqblend.blends.sections.blend_surface.blend_ribbons` takes them.
        setup
            How the sides are laid out along.

        Raises
        ------
        InputError
            The parameters are degenerate, there are too few collocation points, or the basis does not suit the rails.
        CqblendError
            As :func:`cqblend.blends.sections.blend_surface.blend_ribbons`, and where the interior takes too many spans.
        """
        problem = self.pose_boundary_problem(ribbons, setup, accuracy=tolerance / 10)
        interior_tolerance = (
            max(tolerance, PDE_TOLERANCES.interior * problem.data.width) if setup.by_length else tolerance
        )
        varies = any(isinstance(equation, VaryingEquation) for equation in problem.equations)
        if self._refines(setup) or (varies and setup.closed):
            solution = solve_within(problem, interior_tolerance, self.terms, free_basis=self.modes is None)
        else:
            solution = problem.solve(self.terms)
        rail_parameter = problem.rail_parameter
        knots, (kinks, orders) = rail_parameter.invert_parameter(solution.basis.knots), rail_parameter.find_kinks()
        interior = PdeSection(
            solution.halves,
            max(SECTION_TOLERANCES.least_points_across, 4 * solution.terms),
            interior_tolerance,
            setup.closed,
            np.concatenate([knots, kinks]),
            np.concatenate([np.full(len(knots), LEAST_SPLINE_DEGREE - 1), orders]),
            setup.joined,
            solution,
        )
        blend = blend_ribbons(ribbons, form, tolerance, angular_tolerance, interior)
        lowest = min(self.halves) - 1
        first, second = (replace(ribbon, order=lowest) for ribbon in ribbons)
        return replace(blend, ribbons=(first, second), kind="pde", residual=max(solution.residual)), solution

    def _refines(self, setup: SideSetup) -> bool:
        """Whether all solutions are refined to the tolerance, or are as fine as their boundary data tell."""
        return not setup.by_length and not setup.closed and self.basis != "polynomial"

    def pose_boundary_problem(
        self, ribbons: tuple[Ribbon, Ribbon], setup: SideSetup, *, accuracy: float
    ) -> BoundaryProblem:
        """Return the boundary value problem; ``accuracy`` (mm) is that of the expansion along and of free terms.

        Raises
        ------
        InputError
            The parameters are degenerate, or the basis does not suit the rails.
        GeometryError
            Both rails are one curve.
        """
        jets = [ribbon.jets[: max(self.halves)] for ribbon in ribbons]
        breaks = merge_breaks(*(jet.breaks for side in jets for jet in side))
        rails = jets[0][0], jets[1][0]
        lengths = Antiderivative(partial(evaluate_mean_speed, rails), breaks)
        end = None if not setup.by_length else 2 * np.pi if setup.closed else 1.0
        rail_parameter = LengthParameter(rails, lengths, end)
        least_pieces = max(PDE_LIMITS.pieces, self.modes or 0)
        data = _read_boundary_data((jets[0], jets[1]), breaks, rail_parameter, setup.closed, least_pieces)
        interval = RailInterval(data.domain, data.closed)
        ratio = _compute_length_ratio(data, float(lengths.values[-1]))
        if isinstance(self.parameters, str) and self.parameters == LOCAL_WIDTH:
            width = _make_local_width(rails, rail_parameter, data, ratio)
            equations = make_width_equations(self.order, width, interval, PDE_TOLERANCES.local_width)
        else:
            equations = make_varying_equations(self.order, self.parameters, ratio, interval)
        if not setup.by_length and not self._refines(setup):
            accuracy = min(accuracy, PDE_TOLERANCES.data_accuracy * data.size)
        accuracy = max(accuracy, PDE_TOLERANCES.coordinate_rounding * float(np.abs(data.centre).max() + data.size))
        basis = self._choose_basis(data, equations, accuracy, limited=setup.by_length)
        minimise = self.minimise
        if minimise == "auto":
            has_all_ends = setup.ends is not None and setup.ends.jets.shape[1] >= max(self.halves)
            minimise = "residual" if setup.closed or has_all_ends else "energy"
        elif minimise == "energy" and isinstance(basis, Waves) and any(isinstance(one, Equation) for one in equations):
            raise InputError('minimise="energy" is for splines and polynomials along: take "residual"')
        if minimise == "residual":
            relative_accuracy = PDE_TOLERANCES.residual_terms if setup.by_length else 0.0
        else:
            relative_accuracy = PDE_TOLERANCES.rail_energy if setup.by_length else PDE_TOLERANCES.data_energy
        return BoundaryProblem(
            data=data,
            equations=equations,
            basis=basis,
            rail_parameter=rail_parameter,
            minimise=minimise,
            points=self.points,
            ends=setup.ends,
            joined=setup.joined,
            accuracy=accuracy,
            relative_accuracy=relative_accuracy,
            keeps_low_degree=setup.by_length,
        )

    def _choose_basis(
        self, data: BoundaryData, equations: tuple[LinearEquation, ...], accuracy: float, *, limited: bool
    ) -> Waves | Splines:
        """Choose the fewest functions along whose expansion of the data is accurate.

        If their number is ``limited``, waves that would make thin boundary layers are left out.
        """
        kind = self.basis
        if kind == "auto":
            kind = "trigonometric" if data.closed else "bspline"
        if kind != "bspline" and data.closed != (kind == "trigonometric"):
            state, way = ("closed", "trigonometric") if data.closed else ("open", "polynomial")
            raise InputError(f'basis="{kind}" does not suit {state} rails: take "{way}" or "bspline"')
        order, period = max(self.order), data.domain[1] - data.domain[0]
        if kind == "polynomial":
            degree = max(PDE_LIMITS.polynomial_degree, order + 1) if self.modes is None else self.modes
            if not order <= degree <= PDE_LIMITS.most_polynomial_degree:
                raise InputError(
                    f"polynomials of degree {degree} do not suit equations of order {order}: modes from {order} to "
                    f"{PDE_LIMITS.most_polynomial_degree} do"
                )
            return Splines(data.domain, degree, 1)
        most = PDE_LIMITS.most_modes
        if limited:
            exponent = max(equation.largest_exponent for equation in equations) * 2 * np.pi / period
            most = int(np.clip(PDE_LIMITS.wave_exponent / exponent, PDE_LIMITS.fewest_modes, PDE_LIMITS.most_modes))
        if kind == "trigonometric":
            if self.modes is not None:
                return Waves(data.domain, self.modes)
            return _drop_small_waves(data, Waves(data.domain, most), accuracy)
        degree = max(order + 1, LEAST_SPLINE_DEGREE)
        if self.modes is not None:
            return Splines(data.domain, degree, self.modes, data.closed)
        spans = PDE_LIMITS.fewest_modes
        while True:
            basis = Splines(data.domain, degree, spans, data.closed)
            if spans >= most or data.project_onto_basis(basis)[1] <= accuracy:
                return basis
            spans *= 2


def _drop_small_waves(data: BoundaryData, waves: Waves, accuracy: float) -> Waves:
    """Drop the last waves that together add less than the accuracy."""
    coefs = np.abs(data.project_onto_basis(waves)[0]).max(axis=-1).sum(axis=(1, 2))  # (count,)
    amplitudes = coefs[1::2] + coefs[2::2]
    tails = np.cumsum(amplitudes[::-1])[::-1]
    return waves.with_modes(int((tails > accuracy).sum()))


def _read_boundary_data(
    jets: tuple[tuple[Curve, ...], tuple[Curve, ...]],
    breaks: Array,
    rail_parameter: LengthParameter,
    closed: bool,
    least_pieces: int,
) -> BoundaryData:
    """Evaluate the boundary data of two ribbons at Gauss points of their pieces, those of side 2 with v reversed.

    Pieces end at the breaks, and at the ends of ``least_pieces`` pieces of equal length in w.
    """
    domain = (float(breaks[0]), float(breaks[-1])) if rail_parameter.end is None else (0.0, rail_parameter.end)
    even = rail_parameter.invert_parameter(np.linspace(*domain, least_pieces + 1))
    pieces = np.union1d(breaks, even.clip(breaks[0], breaks[-1]))
    nodes, weights = gauss_rule(PDE_LIMITS.gauss_points)
    steps = np.diff(pieces)
    t = (pieces[:-1, None] + steps[:, None] * nodes).ravel()
    first, second = (dehomogenise_jets(np.stack([jet(t) for jet in side])) for side in jets)
    signs = (-1.0) ** np.arange(len(second))[:, None, None]
    measure = (steps[:, None] * weights).ravel() * rail_parameter.evaluate_rate(t)
    both = np.stack([first, second * signs])
    centre = both[:, 0].mean(axis=(0, 1))
    both[:, 0] -= centre
    return BoundaryData(rail_parameter(t), measure, both, centre, domain, closed)


def _compute_length_ratio(data: BoundaryData, length: float) -> float:
    """Return the factor on derivatives along with which v and w count in lengths: width over the length of a unit of w.

    Raises
    ------
    GeometryError
        Both rails are points, or one curve.
    """
    if not length > 0:
        raise GeometryError("both sides are points: there is nothing along them")
    if not data.width > 0:
        raise GeometryError("the rails are the same curve: there is nothing between them")
    return data.width * (data.domain[1] - data.domain[0]) / length


def _make_local_width(
    rails: tuple[Curve, Curve], rail_parameter: LengthParameter, data: BoundaryData, ratio: float
) -> ParameterFunction:
    """Return the distance of the rails at w (n,), over the length of a unit of w; it levels off where they meet."""

    def measure_distances(w: Array) -> Array:
        t = rail_parameter.invert_parameter(w)
        first, second = (dehomogenise_jets(rail(t)[None])[0] for rail in rails)
        return np.asarray(np.linalg.norm(second - first, axis=1))

    least = PDE_TOLERANCES.least_local_width * float(measure_distances(data.w).max())
    return lambda w: np.hypot(measure_distances(w), least) * (ratio / data.width)
