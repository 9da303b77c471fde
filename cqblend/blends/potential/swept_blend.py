r"""Potential blends: the surface swept by the curves in which two reshaped surfaces meet.

At every x of a relation, S1(., .; s1(x)) and S2(., .; s2(x)) meet in a curve; all of them together are the blend. The
curve at x = 0 lies on surface 2, that at x = 1 on surface 1, and the derivatives by x are tangent to them there: these
make ribbons, and whatever fills the Hermite section between these ribbons up to the swept surface leaves the joints
exact.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts, ContactSolver
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.blends.contacts.unwrapped_solvers import unwrap_closed_solver, unwrap_open_solver
from cqblend.blends.fit_errors import TooManySpansError
from cqblend.blends.potential.continuation import CutCondition, IntersectionCurves, IsoparametricCut, PlaneCut
from cqblend.blends.potential.family_pair import DOMAIN_TOLERANCE, FamilyPair, format_point
from cqblend.blends.potential.intersection_branches import IntersectionBranch
from cqblend.blends.potential.swept_section import NO_KINKS, make_ribbon_targets
from cqblend.blends.rails.cubic_rails import fit_cubic_ribbons
from cqblend.blends.rails.exact_rails import fit_straight_ribbons
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines import Curve, interpolation
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import bisect_interval
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import cross_product, normalise_vectors

TABLE_STATIONS, TABLE_STEPS = 65, 17  # of the table from which solutions start
CLOSING_POINTS = 8  # points by which a closed branch is continued before it is interpolated
LEAST_RELATIVE_SPEED = 0.1  # of its mean rate: a parameter that goes slower somewhere is no phase
TRIM_BISECTIONS = 40  # halvings
SINGULAR_AREA_SHARE = 0.15  # of the largest |Su x Sv| along a rail: where it is less, the surface is nearly singular


@dataclass(frozen=True)
class Sweep:
    """Curves, solved at a table of (t, x) from which every other point starts.

    ``t`` (k,) covers the domain, or one lap of a closed one; ``q`` is (k, j, 4).
    """

    curves: IntersectionCurves
    closed: bool
    t: Array
    x: Array
    q: Array

    @property
    def domain(self) -> tuple[float, float]:
        """The range of t."""
        return float(self.t[0]), float(self.t[-1])

    def solve_parameters(self, t: Array, x: Array) -> Array:
        """Return parameters (n, 4) at t (n,), within the domain, and x (n,).

        Raises
        ------
        GeometryError
            Where the intersection is lost; the message names s and the place.
        """
        q, good = self.curves.correct_solutions(self._interpolate_table(t, x), t, x)
        if not good.all():
            i = int((~good).argmax())
            raise self.curves.make_lost_error(self._interpolate_table(t, x)[i], float(x[i]))
        return q

    def evaluate_points(self, t: Array, x: Array) -> Array:
        """Return the points (n, m, 3) of the curves at t (n,) and x (m,)."""
        tt, xx = (grid.ravel() for grid in np.meshgrid(t, x, indexing="ij"))
        return self.curves.family_pair.evaluate_jets(self.solve_parameters(tt, xx), xx)[0][0].reshape(len(t), len(x), 3)

    def solve_contacts(self, t: Array) -> Contacts:
        """Return the rails' parameters and cross derivatives at t (n,): rail 1 is at x = 1, rail 2 at x = 0."""
        one, none = np.ones(len(t)), np.zeros(len(t))
        first, second = self.solve_parameters(t, one), self.solve_parameters(t, none)
        vectors = np.stack(
            [
                -self.curves.evaluate_cross_derivatives(first, t, one, 0),
                self.curves.evaluate_cross_derivatives(second, t, none, 1),
            ]
        )
        half = np.full(len(t), 0.5)
        middle = self.curves.family_pair.evaluate_jets(self._interpolate_table(t, half), half)[0][0]
        return Contacts(t, middle, (first[:, :2], second[:, 2:]), np.linalg.norm(vectors, axis=2), vectors)

    def _interpolate_table(self, t: Array, x: Array) -> Array:
        """Interpolate the table bilinearly."""
        i = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        j = np.clip(np.searchsorted(self.x, x, side="right") - 1, 0, len(self.x) - 2)
        a = ((t - self.t[i]) / (self.t[i + 1] - self.t[i]))[:, None]
        b = ((x - self.x[j]) / (self.x[j + 1] - self.x[j]))[:, None]
        low = (1 - b) * self.q[i, j] + b * self.q[i, j + 1]
        high = (1 - b) * self.q[i + 1, j] + b * self.q[i + 1, j + 1]
        return np.asarray((1 - a) * low + a * high)

    def trim_to_domains(self) -> Sweep:
        """Return the sweep over the range of t over which all curves are on both surfaces.

        Raises
        ------
        GeometryError
            There is none, or the curves may not be cut: they are closed, or follow a parameter to its ends.
        """
        meeting = self.curves.family_pair
        out = meeting.measure_outside(self.q.reshape(-1, 4)).max(axis=1).reshape(self.q.shape[:2])
        inside = (out <= DOMAIN_TOLERANCE).all(axis=1)
        if inside.all():
            return self
        if self.closed or not inside.any() or isinstance(self.curves.cut_condition, IsoparametricCut):
            i, j = np.unravel_index(int(out.argmax()), out.shape)
            q = self.q[i, j]
            axis = int(meeting.measure_outside(q[None])[0].argmax())
            raise GeometryError(
                f"the intersection leaves surface {axis // 2 + 1} at {'uv'[axis % 2]} = "
                f"{np.clip(q[axis], *meeting.bounds[axis]):.4g}, near {meeting.describe_place(q, float(self.x[j]))}: "
                "choose "
                "smaller a and b, or a larger surface"
            )
        runs = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]])))
        first, last = max(
            zip(runs[::2].tolist(), (runs[1::2] - 1).tolist(), strict=True), key=lambda run: run[1] - run[0]
        )
        low = self.t[0] if first == 0 else self._find_domain_exit(self.t[first], self.t[first - 1])
        high = self.t[-1] if last == len(inside) - 1 else self._find_domain_exit(self.t[last], self.t[last + 1])
        t = np.linspace(low, high, TABLE_STATIONS)
        tt, xx = (grid.ravel() for grid in np.meshgrid(t, self.x, indexing="ij"))
        return replace(self, t=t, q=self.solve_parameters(tt, xx).reshape(len(t), len(self.x), 4))

    def _find_domain_exit(self, inside: float, outside: float) -> float:
        """Return the last t, from inside on, at which all curves are on both surfaces."""

        def is_on_surfaces(t: float) -> bool:
            q = self.solve_parameters(np.full(len(self.x), t), self.x)
            return bool(self.curves.family_pair.measure_outside(q).max() <= DOMAIN_TOLERANCE / 2)

        return bisect_interval(is_on_surfaces, inside, outside, TRIM_BISECTIONS)[0]

    def _explain_roughness(self) -> str:
        """Say why rails cannot be fitted: they run next to a singular point, or a surface is not smooth enough."""
        for side, uv in enumerate(self.solve_contacts(self.t).uv):
            jet = self.curves.family_pair.families[side].primary.jet(uv)
            area = np.linalg.norm(cross_product(jet[1], jet[2]), axis=1)
            if area.min() < SINGULAR_AREA_SHARE * area.max():
                return (
                    f"surface {side + 1} is singular (a pole, or a side shrunk to a point) at or next to its rail, "
                    f"near {format_point(jet[0, area.argmin()])}; keep the blend clear of it, or turn the surface so "
                    "that it "
                    "lies elsewhere"
                )
        return (
            "a surface is not smooth enough, as offsets of surfaces that are only C1 are not; reshape it from a "
            "reference, or ask for a larger skin"
        )

    def _check_sides(self) -> None:
        """Raise GeometryError where the blend would set out to the other side of a rail than elsewhere."""
        contacts = self.solve_contacts(self.t)
        assert contacts.cross_vectors is not None
        for side, (uv, vectors, size) in enumerate(
            zip(contacts.uv, contacts.cross_vectors, contacts.cross_lengths, strict=True)
        ):
            jet = self.curves.family_pair.families[side].primary.jet(uv)
            rate = np.gradient(jet[0], self.t, axis=0)
            across = (cross_product(rate, vectors) * normalise_vectors(cross_product(jet[1], jet[2]))).sum(axis=1)
            across[size <= RAIL_TOLERANCES.measurable_share * size.max()] = 0.0
            wrong = across * np.sign(across.sum()) < 0
            if wrong.any():
                i = int(wrong.argmax())
                other = 2 - side
                raise GeometryError(
                    f"surface {other} does not move to the same side all along: at s = 0 of surface {side + 1}, "
                    f"{format_point(jet[0, i])}, the blend would set out backwards; choose another reference for "
                    "surface "
                    f"{other}, on the other side of it, or amounts of one sign"
                )

    @cached_property
    def kinks(self) -> tuple[Array, Array]:
        """Parameters t at which the swept surface is known not to be smooth, and its continuity there.

        That is where curves are cut by knot lines.
        """
        phase = self.curves.cut_condition
        if not isinstance(phase, IsoparametricCut):
            return NO_KINKS
        lines, orders = self.curves.family_pair.families[phase.axis // 2].kinks(phase.axis % 2)
        t = (lines - phase.first) / (phase.last - phase.first)
        inside = (
            (t >= -DOMAIN_TOLERANCE)
            & (t < 1 - DOMAIN_TOLERANCE if self.closed else t <= 1 + DOMAIN_TOLERANCE)
            & (orders < 5)
        )
        return np.where(np.abs(t[inside]) < DOMAIN_TOLERANCE, 0.0, t[inside]), orders[inside]

    @cached_property
    def width(self) -> float:
        """The largest distance between the rails (mm)."""
        meeting = self.curves.family_pair
        rails = [meeting.evaluate_jets(self.q[:, j], np.full(len(self.t), self.x[j]))[0][0] for j in (0, -1)]
        return float(np.linalg.norm(rails[0] - rails[1], axis=1).max())

    def fit_ribbons(self, tolerance: float) -> tuple[Ribbon, Ribbon]:
        """Fit ribbons to the rails and to the derivatives by x, well within the tolerance (mm) of what is between."""
        self._check_sides()
        first, second = (family.primary for family in self.curves.family_pair.families)
        around: Callable[..., ContactSolver] = unwrap_closed_solver if self.closed else unwrap_open_solver
        solve = around(self.solve_contacts, (first, second))
        wanted = make_ribbon_targets(tolerance, self.width)
        found = None if self.closed else fit_straight_ribbons((first, second), solve, self.domain, wanted, self.width)
        at, orders = self.kinks
        try:
            one, two = found or fit_cubic_ribbons(
                (first, second),
                solve,
                self.domain,
                wanted,
                closed=self.closed,
                corners=at[orders < CONTACT_TOLERANCES.rough_continuity],
            )
        except TooManySpansError as error:
            raise TooManySpansError(error.finding, self._explain_roughness()) from error
        return replace(one, fades=True), replace(two, fades=True)


def sweep_branch(meeting: FamilyPair, branch: IntersectionBranch, x0: float) -> Sweep:
    """Carry one branch of the intersection at x0 through the whole family."""
    branch = _restart_off_knots(meeting, branch) if branch.closed else branch
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(branch.points, axis=0), axis=1)))
    along = length / length[-1]
    at = _interpolate_branch(along, np.concatenate([branch.parameters, branch.points], axis=1), branch.closed)
    t = np.linspace(0, 1, TABLE_STATIONS)
    axis = _find_steady_parameter(meeting, branch, at)
    phase: CutCondition
    if axis is None:
        points, rates, start = at[4:], at[4:].derivative(), at(t)[:, :4]
        phase = PlaneCut(lambda t: (points(t), normalise_vectors(rates(t))))
    else:
        first, last = branch.parameters[[0, -1], axis].tolist()
        phase = IsoparametricCut(axis, first, last, float(length[-1] / abs(last - first)))
        start = at(np.interp(t, (branch.parameters[:, axis] - first) / (last - first), along))[:, :4]
    x = np.union1d(np.linspace(0, 1, TABLE_STEPS), x0)
    curves = IntersectionCurves(meeting, phase)
    return Sweep(curves, branch.closed, t, x, curves.continue_solutions(start, t, x0, x)).trim_to_domains()


def _restart_off_knots(meeting: FamilyPair, branch: IntersectionBranch) -> IntersectionBranch:
    """Return a closed branch that starts where it is farthest from knot lines and seams, in shares of the domains."""
    clearance = np.full(len(branch.parameters) - 1, np.inf)
    for axis in range(4):
        primary = meeting.families[axis // 2].primary
        assert isinstance(primary, TensorSurface)
        breaks, period = primary.breaks[axis % 2], primary.periods[axis % 2]
        apart = branch.parameters[:-1, axis, None] - (breaks if period is not None else breaks[1:-1])
        if period is not None:
            apart -= period * np.round(apart / period)
        if apart.size:
            clearance = np.minimum(clearance, np.abs(apart).min(axis=1) / (breaks[-1] - breaks[0]))
    i = int(clearance.argmax())
    lap = branch.parameters[-1] - branch.parameters[0]
    return IntersectionBranch(
        np.concatenate([branch.points[i:], branch.points[1 : i + 1]]),
        np.concatenate([branch.parameters[i:], branch.parameters[1 : i + 1] + lap]),
        closed=True,
    )


def _interpolate_branch(t: Array, values: Array, closed: bool) -> Curve:
    """Interpolate points along a branch: C4, round a closed one too, whose parameters may go on by a period."""
    if not closed:
        return interpolation.interpolate(t, values, degree=5 if len(t) > 5 else 3)
    lap, k = values[-1] - values[0], min(CLOSING_POINTS, len(t) - 1)
    before, after = values[-1 - k : -1] - lap, values[1 : k + 1] + lap
    long = np.concatenate([t[-1 - k : -1] - 1, t, t[1 : k + 1] + 1])
    return interpolation.interpolate(long, np.concatenate([before, values, after]), degree=5).clip(0.0, 1.0)


def _find_steady_parameter(meeting: FamilyPair, branch: IntersectionBranch, at: Curve) -> int | None:
    """Return which parameter goes steadily along a branch, from end to end of its domain, or round; None if none."""
    rates = at.derivative()(np.linspace(0, 1, 257))[:, :4]
    best, found = LEAST_RELATIVE_SPEED, None
    for axis in range(4):
        low, high = meeting.bounds[axis]
        turn = branch.parameters[-1, axis] - branch.parameters[0, axis]
        if np.isfinite(low):
            ends = np.sort(branch.parameters[[0, -1], axis])
            if branch.closed or np.abs(ends - (low, high)).max() > DOMAIN_TOLERANCE * (high - low):
                continue
        elif not branch.closed or turn == 0:
            continue
        share = float((rates[:, axis] / turn).min())
        if share > best:
            best, found = share, axis
    return found
