r"""Potential blends: the surface swept by the intersection curves of two reshaped surfaces, and its ribbons.

At every x of a relation, S1(., .; s1(x)) and S2(., .; s2(x)) meet in a curve; all of these curves together are the
blend. The curve at x = 0 lies on surface 2, that at x = 1 on surface 1. They are the rails, and the derivatives by x
are tangent to the surfaces there: so rails and derivatives are fitted as ribbons, and the joints of the Hermite section
between them are exact. :mod:`cqblend.blends.potential.swept_section` adds the difference to the swept surface.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts, ContactSolver
from cqblend.blends.contacts.parameter_unwrapping import unwrap_closed_solver, unwrap_open_solver
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.blends.potential.continuation import CutCondition, IntersectionCurves, IsoparametricCut, PlaneCut
from cqblend.blends.potential.family_pair import FamilyPair, format_point
from cqblend.blends.potential.intersection_branches import IntersectionBranch
from cqblend.blends.potential.swept_section import NO_KINKS, make_ribbon_targets
from cqblend.blends.potential.tolerances import POTENTIAL_LIMITS, POTENTIAL_TOLERANCES
from cqblend.blends.rails.cubic_ribbons import fit_cubic_ribbons
from cqblend.blends.rails.fit_exceptions import TooManySpansError
from cqblend.blends.rails.line_and_arc_ribbons import fit_straight_ribbons
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines import Curve, interpolation
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import bisect_interval
from cqblend.surfaces.vectors import cross_product, normalise_vectors


@dataclass(frozen=True)
class Sweep:
    """The intersection curves over a domain of t and x in [0, 1].

    ``q`` (k, j, 4) are their parameters (u1, v1, u2, v2) at stations ``t`` (k,) and at ``x`` (j,): any other point is
    solved from a start interpolated in this table. ``t`` covers the domain, once round if the curves are ``closed``.
    """

    curves: IntersectionCurves[FamilyPair]
    closed: bool
    t: Array
    x: Array
    q: Array

    @property
    def domain(self) -> tuple[float, float]:
        """The range of t."""
        return float(self.t[0]), float(self.t[-1])

    def solve_parameters(self, t: Array, x: Array) -> Array:
        """Return parameters q (n, 4) at t (n,), within the domain, and x (n,).

        Raises
        ------
        GeometryError
            Where the intersection is lost; the message names s and the place.
        """
        start = self._interpolate_table(t, x)
        q, converged = self.curves.correct_solutions(start, t, x)
        if not converged.all():
            raise self.curves.make_lost_error(start, x, int((~converged).argmax()))
        return q

    def evaluate_points(self, t: Array, x: Array) -> Array:
        """Return the points (n, m, 3) of the curves at t (n,) and x (m,)."""
        tt, xx = (grid.ravel() for grid in np.meshgrid(t, x, indexing="ij"))
        return self.curves.pair.evaluate_jets(self.solve_parameters(tt, xx), xx)[0][0].reshape(len(t), len(x), 3)

    def solve_contacts(self, t: Array) -> Contacts:
        """Return the rails' parameters and cross derivatives at t (n,): rail 1 is at x = 1, rail 2 at x = 0."""
        uv, vectors = self._solve_rails(t)
        half = np.full(len(t), 0.5)
        middle = self.curves.pair.evaluate_jets(self._interpolate_table(t, half), half)[0][0]
        return Contacts(t, middle, uv, np.linalg.norm(vectors, axis=2), vectors)

    def _solve_rails(self, t: Array) -> tuple[tuple[Array, Array], Array]:
        """Return the native parameters (n, 2) of both rails at t (n,), and their cross derivatives (2, n, 3)."""
        ones, zeros = np.ones(len(t)), np.zeros(len(t))
        first, second = self.solve_parameters(t, ones), self.solve_parameters(t, zeros)
        vectors = np.stack(
            [
                -self.curves.evaluate_cross_derivatives(first, t, ones, 0),
                self.curves.evaluate_cross_derivatives(second, t, zeros, 1),
            ]
        )
        return (first[:, :2], second[:, 2:]), vectors

    def _interpolate_table(self, t: Array, x: Array) -> Array:
        """Return q (n, 4) at t (n,) and x (n,) by bilinear interpolation in the table."""
        i = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        j = np.clip(np.searchsorted(self.x, x, side="right") - 1, 0, len(self.x) - 2)
        a = ((t - self.t[i]) / (self.t[i + 1] - self.t[i]))[:, None]
        b = ((x - self.x[j]) / (self.x[j + 1] - self.x[j]))[:, None]
        low = (1 - b) * self.q[i, j] + b * self.q[i, j + 1]
        high = (1 - b) * self.q[i + 1, j] + b * self.q[i + 1, j + 1]
        return np.asarray((1 - a) * low + a * high)

    def trim_to_domains(self) -> Sweep:
        """Return the sweep over the longest range of t in which all curves are on both surfaces.

        Raises
        ------
        GeometryError
            There is none, or the curves may not be trimmed: they are closed, or run along a parameter from end to end.
        """
        family_pair = self.curves.pair
        outside = family_pair.measure_outside(self.q.reshape(-1, self.q.shape[2])).max(axis=1).reshape(self.q.shape[:2])
        inside = (outside <= POTENTIAL_TOLERANCES.domain).all(axis=1)
        if inside.all():
            return self
        if self.closed or not inside.any() or isinstance(self.curves.cut_condition, IsoparametricCut):
            i, j = np.unravel_index(int(outside.argmax()), outside.shape)
            q = self.q[i, j]
            axis = int(family_pair.measure_outside(q[None])[0].argmax())
            value = np.clip(q[axis], *family_pair.bounds[axis])
            raise GeometryError(
                f"the intersection leaves surface {axis // 2 + 1} at {'uv'[axis % 2]} = {value:.4g}, near "
                f"{family_pair.describe_place(q[None], self.x[j, None], 0)}: choose smaller a and b, or a larger "
                "surface"
            )
        runs = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]])))
        first, last = max(
            zip(runs[::2].tolist(), (runs[1::2] - 1).tolist(), strict=True), key=lambda run: run[1] - run[0]
        )
        low = self.t[0] if first == 0 else self._find_domain_exit(self.t[first], self.t[first - 1])
        high = self.t[-1] if last == len(inside) - 1 else self._find_domain_exit(self.t[last], self.t[last + 1])
        t = np.linspace(low, high, POTENTIAL_LIMITS.table_stations)
        tt, xx = (grid.ravel() for grid in np.meshgrid(t, self.x, indexing="ij"))
        return replace(self, t=t, q=self.solve_parameters(tt, xx).reshape(len(t), len(self.x), -1))

    def _find_domain_exit(self, inside: float, outside: float) -> float:
        """Return the last t, from ``inside`` to ``outside``, at which all curves are on both surfaces, by bisection."""

        def is_on_surfaces(t: float) -> bool:
            q = self.solve_parameters(np.full(len(self.x), t), self.x)
            return bool(self.curves.pair.measure_outside(q).max() <= POTENTIAL_TOLERANCES.domain / 2)

        return bisect_interval(is_on_surfaces, inside, outside, POTENTIAL_LIMITS.trim_bisections)[0]

    def _explain_roughness(self) -> str:
        """Return the reason why rails cannot be fitted: a singular point next to one, or too little continuity."""
        for side, uv in enumerate(self.solve_contacts(self.t).uv):
            jet = self.curves.pair.families[side].primary.jet(uv)
            area = np.linalg.norm(cross_product(jet[1], jet[2]), axis=1)
            if area.min() < POTENTIAL_TOLERANCES.singular_area * area.max():
                return (
                    f"surface {side + 1} is singular (a pole, or a side shrunk to a point) at or next to its rail, "
                    f"near {format_point(jet[0, area.argmin()])}; keep the blend clear of it, or turn the surface so "
                    "that it lies elsewhere"
                )
        return (
            "a surface is not smooth enough, as offsets of surfaces that are only C1 are not; reshape it from a "
            "reference, or ask for a larger skin"
        )

    def _check_sides(self) -> None:
        """Raise GeometryError where the cross derivatives point to the other side of a rail than elsewhere."""
        rails, cross_vectors = self._solve_rails(self.t)
        for side, (uv, vectors) in enumerate(zip(rails, cross_vectors, strict=True)):
            length = np.linalg.norm(vectors, axis=1)
            jet = self.curves.pair.families[side].primary.jet(uv)
            rate = np.gradient(jet[0], self.t, axis=0)
            across = (cross_product(rate, vectors) * normalise_vectors(cross_product(jet[1], jet[2]))).sum(axis=1)
            across[length <= RAIL_TOLERANCES.measurable_share * length.max()] = 0.0
            backwards = across * np.sign(across.sum()) < 0
            if backwards.any():
                i = int(backwards.argmax())
                other = 2 - side
                raise GeometryError(
                    f"surface {other} does not move to the same side all along: at s = 0 of surface {side + 1}, "
                    f"{format_point(jet[0, i])}, the blend would set out backwards; choose another reference for "
                    f"surface {other}, on the other side of it, or amounts of one sign"
                )

    @cached_property
    def kinks(self) -> tuple[Array, Array]:
        """Parameters t at which the swept surface is known not to be smooth, and its continuity there.

        They are known where stations are fixed values of a surface parameter: they are its knots.
        """
        cut = self.curves.cut_condition
        if not isinstance(cut, IsoparametricCut):
            return NO_KINKS
        within = min(cut.first, cut.last), max(cut.first, cut.last)
        knots, orders = self.curves.pair.families[cut.axis // 2].kinks(cut.axis % 2, within)
        t, tolerance = (knots - cut.first) / (cut.last - cut.first), POTENTIAL_TOLERANCES.kink_parameter
        inside = (t >= -tolerance) & (t < 1 - tolerance if self.closed else t <= 1 + tolerance) & (orders < 5)
        return np.where(np.abs(t[inside]) < tolerance, 0.0, t[inside]), orders[inside]

    @cached_property
    def width(self) -> float:
        """The largest distance between the rails (mm)."""
        family_pair = self.curves.pair
        rails = [family_pair.evaluate_jets(self.q[:, j], np.full(len(self.t), self.x[j]))[0][0] for j in (0, -1)]
        return float(np.linalg.norm(rails[0] - rails[1], axis=1).max())

    def fit_ribbons(self, tolerance: float) -> tuple[Ribbon, Ribbon]:
        """Fit ribbons to the rails and to the derivatives by x, well within the tolerance (mm) of the interior."""
        self._check_sides()
        first, second = (family.primary for family in self.curves.pair.families)
        unwrap: Callable[..., ContactSolver] = unwrap_closed_solver if self.closed else unwrap_open_solver
        solve = unwrap(self.solve_contacts, (first, second))
        wanted = replace(make_ribbon_targets(tolerance, self.width), fades=True)
        straight = (
            None if self.closed else fit_straight_ribbons((first, second), solve, self.domain, wanted, self.width)
        )
        kinks, orders = self.kinks
        try:
            return straight or fit_cubic_ribbons(
                (first, second),
                solve,
                self.domain,
                wanted,
                closed=self.closed,
                corners=kinks[orders < CONTACT_TOLERANCES.rough_continuity],
            )
        except TooManySpansError as error:
            raise TooManySpansError(error.finding, self._explain_roughness()) from error


def sweep_branch(family_pair: FamilyPair, branch: IntersectionBranch, x0: float) -> Sweep:
    """Continue one branch of the intersection at x0 to all x of the relation."""
    stations = place_stations(family_pair, branch)
    x = np.union1d(np.linspace(0, 1, POTENTIAL_LIMITS.table_x_values), x0)
    curves = IntersectionCurves(family_pair, stations.cut)
    table = curves.continue_solutions(stations.start, stations.t, x0, x)
    return Sweep(curves, branch.closed, stations.t, x, table).trim_to_domains()


class BranchStations(NamedTuple):
    """Stations ``t`` (k,) of a branch, the condition that selects their points, and the parameters ``start`` there."""

    cut: CutCondition
    t: Array
    start: Array


def place_stations(family_pair: FamilyPair, branch: IntersectionBranch) -> BranchStations:
    """Return stations along a branch: at values of a parameter that goes along it steadily, else in planes across."""
    branch = _restart_off_knots(family_pair, branch) if branch.closed else branch
    count = branch.parameters.shape[1]
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(branch.points, axis=0), axis=1)))
    length_share = length / length[-1]
    values = np.concatenate([branch.parameters, branch.points], axis=1)
    branch_curve = _interpolate_branch(length_share, values, branch.closed)
    t = np.linspace(0, 1, POTENTIAL_LIMITS.table_stations)
    axis = _find_steady_parameter(family_pair, branch, branch_curve)
    cut: CutCondition
    if axis is None:
        points, velocities = branch_curve[count:], branch_curve[count:].derivative()
        start = branch_curve(t)[:, :count]
        cut = PlaneCut(lambda t: (points(t), normalise_vectors(velocities(t))))
    else:
        first, last = branch.parameters[[0, -1], axis].tolist()
        cut = IsoparametricCut(axis, first, last, float(length[-1] / abs(last - first)))
        shares = np.interp(t, (branch.parameters[:, axis] - first) / (last - first), length_share)
        start = branch_curve(shares)[:, :count]
    return BranchStations(cut, t, start)


def _restart_off_knots(family_pair: FamilyPair, branch: IntersectionBranch) -> IntersectionBranch:
    """Return a closed branch that starts where it is farthest from knot lines and seams, in shares of the domains."""
    clearance = np.full(len(branch.parameters) - 1, np.inf)
    for axis in range(branch.parameters.shape[1]):
        primary = family_pair.families[axis // 2].primary
        breaks, period = primary.breaks[axis % 2], primary.periods[axis % 2]
        distances = branch.parameters[:-1, axis, None] - (breaks if period is not None else breaks[1:-1])
        if period is not None:
            distances -= period * np.round(distances / period)
        if distances.size:
            clearance = np.minimum(clearance, np.abs(distances).min(axis=1) / (breaks[-1] - breaks[0]))
    i = int(clearance.argmax())
    periods = branch.parameters[-1] - branch.parameters[0]
    return IntersectionBranch(
        np.concatenate([branch.points[i:], branch.points[1 : i + 1]]),
        np.concatenate([branch.parameters[i:], branch.parameters[1 : i + 1] + periods]),
        closed=True,
    )


def _interpolate_branch(t: Array, values: Array, closed: bool) -> Curve:
    """Interpolate values (n, d) at t (n,) over [0, 1] along a branch, with a C4 curve.

    If the branch is ``closed``, so is the curve, up to periods of its parameters: points are repeated beyond both ends.
    """
    if not closed:
        return interpolation.interpolate(t, values, degree=5 if len(t) > 5 else 3)
    periods, k = values[-1] - values[0], min(POTENTIAL_LIMITS.closing_points, len(t) - 1)
    before, after = values[-1 - k : -1] - periods, values[1 : k + 1] + periods
    extended = np.concatenate([t[-1 - k : -1] - 1, t, t[1 : k + 1] + 1])
    return interpolation.interpolate(extended, np.concatenate([before, values, after]), degree=5).clip(0.0, 1.0)


def _find_steady_parameter(family_pair: FamilyPair, branch: IntersectionBranch, branch_curve: Curve) -> int | None:
    """Return the index of the parameter whose rate along a branch is the most even; None if none is even enough.

    It must run over the whole domain, or over a period if the branch is closed.
    """
    rates = branch_curve.derivative()(np.linspace(0, 1, POTENTIAL_LIMITS.branch_samples))
    best, steady = POTENTIAL_TOLERANCES.relative_speed, None
    for axis in range(branch.parameters.shape[1]):
        low, high = family_pair.bounds[axis]
        change = branch.parameters[-1, axis] - branch.parameters[0, axis]
        if np.isfinite(low):
            ends = np.sort(branch.parameters[[0, -1], axis])
            if branch.closed or np.abs(ends - (low, high)).max() > POTENTIAL_TOLERANCES.domain * (high - low):
                continue
        elif not branch.closed or change == 0:
            continue
        relative_speed = float((rates[:, axis] / change).min())
        if relative_speed > best:
            best, steady = relative_speed, axis
    return steady
