r"""Potential blends: the surface swept by the curves in which two reshaped surfaces meet.

At every x of a relation, S1(., .; s1(x)) and S2(., .; s2(x)) meet in a curve; all of them together are the blend. One
common parameter t tells which points of them belong together: a *phase* that cuts all of them, planes across one of
them, or, where one of the surfaces' own parameters runs along them, that parameter. Unknowns are (u1, v1, u2, v2) at
(t, x): four equations, solved by Newton for all t at once and carried on in x, each step predicted from the derivative.

The curve at x = 0 lies on surface 2, that at x = 1 on surface 1, and the derivatives by x are tangent to them there:
these make ribbons, and whatever fills the Hermite section between these ribbons up to the swept surface leaves the
joints exact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Protocol, TypeAlias

import numpy as np

from cqblend.blends import fitting
from cqblend.blends.contact import FLAT, Contacts, Side, Solver, Stations, intersect, inward, newton
from cqblend.blends.families import Course, Offset
from cqblend.blends.filling import Filling
from cqblend.blends.fitting import Wanted
from cqblend.blends.meeting import OUTSIDE, TANGENTIAL, Branch, Meeting, point
from cqblend.blends.primaries import Array, cross, unit
from cqblend.blends.relations import Relation
from cqblend.blends.ribbons import FADED, Ribbon
from cqblend.blends.sections import Jets, section
from cqblend.errors import GeometryError, SizeError
from cqblend.splines import Curve, Surface, fit

STATIONS, STEPS = 65, 17  # of the table from which solutions start
SHORTEST = 1e-3  # step in x
FAR = 0.3  # of the scale, the longest step of a correction
ASTRAY = 0.5  # of a step, by which its correction may be off the prediction: more may be another branch
OVERLAP = 8  # points by which a closed branch is continued before it is interpolated
STEADY = 0.1  # of its mean rate: a parameter that goes slower somewhere is no phase
TRIM = 40  # halvings
SHARE = 1 / 16  # of a tolerance inside, that of the rails
ACROSS = 24  # points at which the swept surface is read
MEASURED = (149, 33)  # points along and across, at which a blend is measured

ANYWHERE = np.tile([-np.inf, np.inf], (4, 1))
SMOOTH = np.empty(0), np.empty(0, dtype=int)

Ends: TypeAlias = tuple[tuple[Array, Array], tuple[Array, Array]]


class Swept(Protocol):
    """A swept surface: what :class:`Skin` needs of it, and what ribbons are fitted to."""

    @property
    def domain(self) -> tuple[float, float]:
        """The range of t."""
        ...

    def points(self, t: Array, x: Array) -> Array:
        """Return the points (n, m, 3) of the curves at t (n,) and x (m,)."""
        ...

    def ends(self, t: Array) -> Ends:
        """Return parameters (n, 2) and cross derivatives (n, 3), into the blend, on rail 1 (x = 1) and 2 (x = 0)."""
        ...


class Phase(Protocol):
    """What cuts the curves at t: a residual (n,), in mm, with its derivatives by (u1, v1, u2, v2) and by x."""

    def __call__(self, t: Array, q: Array, jets: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """Return residual (n,), gradient (n, 4), and derivative by x (n,)."""
        ...


@dataclass(frozen=True)
class Planes:
    """Planes through points, normal to directions, (n, 3) each, functions of t."""

    at: Callable[[Array], tuple[Array, Array]]

    def __call__(self, t: Array, q: Array, jets: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """Return how far the points on surface 1 are from the planes."""
        del q
        point, normal = self.at(t)
        first = jets[0]
        gradient = np.zeros((len(t), 4))
        gradient[:, 0], gradient[:, 1] = (first[1] * normal).sum(axis=1), (first[2] * normal).sum(axis=1)
        return ((first[0] - point) * normal).sum(axis=1), gradient, (first[3] * normal).sum(axis=1)


@dataclass(frozen=True)
class Isoparametric:
    """Lines of one of the four parameters, from ``first`` to ``last`` for t in [0, 1]; ``size`` is mm in a unit."""

    axis: int
    first: float
    last: float
    size: float

    def value(self, t: Array) -> Array:
        """Return the parameter at t (n,)."""
        return self.first + t * (self.last - self.first)

    def __call__(self, t: Array, q: Array, jets: tuple[Array, Array]) -> tuple[Array, Array, Array]:
        """Return how far the parameter is from its value."""
        del jets
        gradient = np.zeros((len(t), 4))
        gradient[:, self.axis] = self.size
        return (q[:, self.axis] - self.value(t)) * self.size, gradient, np.zeros(len(t))


@dataclass(frozen=True)
class Curves:
    """The intersection curves of a meeting, cut by a phase: equations, and how solutions are carried on."""

    meeting: Meeting
    phase: Phase

    def _system(self, q: Array, t: Array, x: Array) -> tuple[Array, Array, Array, tuple[Array, Array]]:
        """Return matrix (n, 4, 4), residual (n, 4), its derivative by x, and the jets."""
        jets = self.meeting.jets(q, x)
        first, second = jets
        off, gradient, drift = self.phase(t, q, jets)
        matrix = np.empty((len(q), 4, 4))
        matrix[:, :3] = np.stack([first[1], first[2], -second[1], -second[2]], axis=-1)
        matrix[:, 3] = gradient
        residual = np.concatenate([first[0] - second[0], off[:, None]], axis=1)
        return matrix, residual, np.concatenate([first[3] - second[3], drift[:, None]], axis=1), jets

    def corrected(self, start: Array, t: Array, x: Array) -> tuple[Array, Array]:
        """Return solutions (n, 4) next to a start, and which of them there are."""

        def system(q: Array) -> tuple[Array, Array, Array]:
            matrix, residual, _, jets = self._system(q, t, x)
            return residual, matrix, np.concatenate([np.linalg.norm(jet[1:3], axis=2).T for jet in jets], axis=1)

        scale = self.meeting.scale
        return newton(system, start, scale, FAR * scale)

    def rate(self, q: Array, t: Array, x: Array) -> tuple[Array, tuple[Array, Array]]:
        """Return the derivative (n, 4) of the parameters by x, and the jets."""
        matrix, _, change, jets = self._system(q, t, x)
        try:
            return np.linalg.solve(matrix, -change[..., None])[..., 0], jets
        except np.linalg.LinAlgError:
            raise self.lost(q[0], float(x[0])) from None

    def cross_derivatives(self, q: Array, t: Array, x: Array, side: int) -> Array:
        """Return the derivatives (n, 3) by x, tangent to the surface of side 0 or 1 as it is at x."""
        rate, jets = self.rate(q, t, x)
        along = rate[:, 2 * side : 2 * side + 2]
        return np.asarray(along[:, :1] * jets[side][1] + along[:, 1:] * jets[side][2])

    def lost(self, q: Array, x: float) -> GeometryError:
        """Return the error that says where an intersection is lost."""
        return GeometryError(
            f"the intersection of the reshaped surfaces is lost near {self.meeting.place(q, x)}: there, they part or "
            "touch; choose smaller a and b, or another reference"
        )

    def carried(self, start: Array, t: Array, x0: float, nodes: Array) -> Array:
        """Carry solutions (k, 4) at x0 to all nodes, ascending: (k, n, 4).

        Raises
        ------
        GeometryError
            Where they are lost, where the surfaces touch, or one is folded; the message names s and the place.
        """
        q0, good = self.corrected(start, t, np.full(len(t), x0))
        if not good.all():
            raise self.lost(start[~good][0], x0)
        table = np.empty((len(t), len(nodes), 4))
        ahead = np.arange(len(nodes))[nodes >= x0]
        for order in (ahead, np.arange(len(nodes))[nodes < x0][::-1]):
            q, x = q0, x0
            for j in order.tolist():
                q, x = self._onwards(q, t, x, float(nodes[j])), float(nodes[j])
                table[:, j] = q
        self._check(table, nodes)
        return table

    def _onwards(self, q: Array, t: Array, x: float, target: float) -> Array:
        """Carry solutions from x to a target, in steps as long as Newton's corrections stay small."""
        step = target - x
        while x != target:
            rate, _ = self.rate(q, t, np.full(len(q), x))
            guess, there = q + step * rate, np.full(len(q), x + step)
            made, good = self.corrected(guess, t, there)
            if good.all():
                jet = self.meeting.jets(made, there)
                moved, off = (_apart(made - other, jet) for other in (q, guess))
                good = off <= np.maximum(ASTRAY * moved, 1e-3 * self.meeting.scale)
            if not good.all():
                step /= 2
                if abs(step) < SHORTEST:
                    raise self.lost(q[~good][0], x)
                continue
            q, x = made, x + step
            if abs(target - x) < SHORTEST / 2:
                x = target
            step = float(np.clip(2 * step, -abs(target - x), abs(target - x)))
        return q

    def _check(self, table: Array, nodes: Array) -> None:
        """Raise GeometryError where the surfaces touch, or a reshaped one is folded."""
        q, x = table.reshape(-1, 4), np.tile(nodes, len(table))
        jets = self.meeting.jets(q, x)
        outer = [cross(jet[1], jet[2]) for jet in jets]
        for number, (family, jet, normal) in enumerate(zip(self.meeting.families, jets, outer, strict=True), 1):
            own = family.primary.jet(q[:, 2 * number - 2 : 2 * number])
            upright = (normal * cross(own[1], own[2])).sum(axis=1)
            turned = ((jet[1] * own[1]).sum(axis=1) < 0) & ((jet[2] * own[2]).sum(axis=1) < 0)
            bad = (upright <= 0) | turned
            if bad.any():
                i = int(bad.argmax())
                raise GeometryError(
                    f"surface {number} is reshaped so far that it turns over on itself, at "
                    f"{self.meeting.place(q[i], float(x[i]))}: choose a smaller {'ab'[number - 1]}, or smaller amounts"
                )
        sine = np.linalg.norm(cross(unit(outer[0]), unit(outer[1])), axis=1)
        if sine.min() < TANGENTIAL:
            i = int(sine.argmin())
            raise GeometryError(
                f"the reshaped surfaces touch at an angle of {sine[i]:.2g} rad, at "
                f"{self.meeting.place(q[i], float(x[i]))}: choose other a and b"
            )


def _apart(change: Array, jets: tuple[Array, Array]) -> Array:
    """Return how far (n,) a change of parameters moves the points on the surfaces, about."""
    steps = [change[:, 2 * i, None] * jet[1] + change[:, 2 * i + 1, None] * jet[2] for i, jet in enumerate(jets)]
    return np.asarray(np.linalg.norm(np.stack(steps), axis=2).max(axis=0))


@dataclass(frozen=True)
class Sweep:
    """Curves, solved at a table of (t, x) from which every other point starts.

    ``t`` (k,) covers the domain, or one lap of a closed one; ``q`` is (k, j, 4).
    """

    curves: Curves
    closed: bool
    t: Array
    x: Array
    q: Array

    @property
    def domain(self) -> tuple[float, float]:
        """The range of t."""
        return float(self.t[0]), float(self.t[-1])

    def solve(self, t: Array, x: Array) -> Array:
        """Return parameters (n, 4) at t (n,), within the domain, and x (n,).

        Raises
        ------
        GeometryError
            Where the intersection is lost; the message names s and the place.
        """
        q, good = self.curves.corrected(self._interpolated(t, x), t, x)
        if not good.all():
            i = int((~good).argmax())
            raise self.curves.lost(self._interpolated(t, x)[i], float(x[i]))
        return q

    def points(self, t: Array, x: Array) -> Array:
        """Return the points (n, m, 3) of the curves at t (n,) and x (m,)."""
        tt, xx = (grid.ravel() for grid in np.meshgrid(t, x, indexing="ij"))
        return self.curves.meeting.jets(self.solve(tt, xx), xx)[0][0].reshape(len(t), len(x), 3)

    def ends(self, t: Array) -> Ends:
        """Return parameters (n, 2) and cross derivatives (n, 3), into the blend, on rail 1 (x = 1) and 2 (x = 0)."""
        one, none = np.ones(len(t)), np.zeros(len(t))
        if self.closed:
            t = self.domain[0] + np.mod(t - self.domain[0], self.domain[1] - self.domain[0])
        first, second = self.solve(t, one), self.solve(t, none)
        return (
            (first[:, :2], -self.curves.cross_derivatives(first, t, one, 0)),
            (second[:, 2:], self.curves.cross_derivatives(second, t, none, 1)),
        )

    def _interpolated(self, t: Array, x: Array) -> Array:
        """Interpolate the table bilinearly."""
        i = np.clip(np.searchsorted(self.t, t, side="right") - 1, 0, len(self.t) - 2)
        j = np.clip(np.searchsorted(self.x, x, side="right") - 1, 0, len(self.x) - 2)
        a = ((t - self.t[i]) / (self.t[i + 1] - self.t[i]))[:, None]
        b = ((x - self.x[j]) / (self.x[j + 1] - self.x[j]))[:, None]
        low = (1 - b) * self.q[i, j] + b * self.q[i, j + 1]
        high = (1 - b) * self.q[i + 1, j] + b * self.q[i + 1, j + 1]
        return np.asarray((1 - a) * low + a * high)

    def within(self) -> Sweep:
        """Return the sweep over the range of t over which all curves are on both surfaces.

        Raises
        ------
        GeometryError
            There is none, or the curves may not be cut: they are closed, or follow a parameter to its ends.
        """
        meeting = self.curves.meeting
        out = meeting.outside(self.q.reshape(-1, 4)).max(axis=1).reshape(self.q.shape[:2])
        inside = (out <= OUTSIDE).all(axis=1)
        if inside.all():
            return self
        if self.closed or not inside.any() or isinstance(self.curves.phase, Isoparametric):
            i, j = np.unravel_index(int(out.argmax()), out.shape)
            q = self.q[i, j]
            axis = int(meeting.outside(q[None])[0].argmax())
            raise GeometryError(
                f"the intersection leaves surface {axis // 2 + 1} at {'uv'[axis % 2]} = "
                f"{np.clip(q[axis], *meeting.bounds[axis]):.4g}, near {meeting.place(q, float(self.x[j]))}: choose "
                "smaller a and b, or a larger surface"
            )
        runs = np.flatnonzero(np.diff(np.concatenate([[False], inside, [False]])))
        first, last = max(
            zip(runs[::2].tolist(), (runs[1::2] - 1).tolist(), strict=True), key=lambda run: run[1] - run[0]
        )
        low = self.t[0] if first == 0 else self._edge(self.t[first], self.t[first - 1])
        high = self.t[-1] if last == len(inside) - 1 else self._edge(self.t[last], self.t[last + 1])
        t = np.linspace(low, high, STATIONS)
        tt, xx = (grid.ravel() for grid in np.meshgrid(t, self.x, indexing="ij"))
        return replace(self, t=t, q=self.solve(tt, xx).reshape(len(t), len(self.x), 4))

    def _edge(self, inside: float, outside: float) -> float:
        """Return the last t, from inside on, at which all curves are on both surfaces."""
        for _ in range(TRIM):
            middle = (inside + outside) / 2
            q = self.solve(np.full(len(self.x), middle), self.x)
            if self.curves.meeting.outside(q).max() <= OUTSIDE / 2:
                inside = middle
            else:
                outside = middle
        return inside

    def _check_sides(self) -> None:
        """Raise GeometryError where the blend would set out to the other side of a rail than elsewhere."""
        for side, (uv, vectors) in enumerate(self.ends(self.t)):
            jet = self.curves.meeting.families[side].primary.jet(uv)
            rate = np.gradient(jet[0], self.t, axis=0)
            size = np.linalg.norm(vectors, axis=1)
            across = (cross(rate, vectors) * unit(cross(jet[1], jet[2]))).sum(axis=1)
            across[size <= FADED * size.max()] = 0.0
            wrong = across * np.sign(across.sum()) < 0
            if wrong.any():
                i = int(wrong.argmax())
                other = 2 - side
                raise GeometryError(
                    f"surface {other} does not move to the same side all along: at s = 0 of surface {side + 1}, "
                    f"{point(jet[0, i])}, the blend would set out backwards; choose another reference for surface "
                    f"{other}, on the other side of it, or amounts of one sign"
                )

    @cached_property
    def kinks(self) -> tuple[Array, Array]:
        """Parameters t at which the swept surface is known not to be smooth, and its continuity there.

        That is where curves are cut by knot lines.
        """
        phase = self.curves.phase
        if not isinstance(phase, Isoparametric):
            return SMOOTH
        lines, orders = self.curves.meeting.families[phase.axis // 2].kinks(phase.axis % 2)
        t = (lines - phase.first) / (phase.last - phase.first)
        inside = (t >= -OUTSIDE) & (t < 1 - OUTSIDE if self.closed else t <= 1 + OUTSIDE) & (orders < 5)
        return np.where(np.abs(t[inside]) < OUTSIDE, 0.0, t[inside]), orders[inside]

    @cached_property
    def width(self) -> float:
        """The largest distance between the rails (mm)."""
        meeting = self.curves.meeting
        rails = [meeting.jets(self.q[:, j], np.full(len(self.t), self.x[j]))[0][0] for j in (0, -1)]
        return float(np.linalg.norm(rails[0] - rails[1], axis=1).max())

    def ribbons(self, tolerance: float) -> tuple[Ribbon, Ribbon]:
        """Fit ribbons to the rails and to the derivatives by x, well within the tolerance (mm) of what is between."""

        def contacts(t: Array) -> Contacts:
            ends, half = self.ends(t), np.full(len(t), 0.5)
            middle = self.curves.meeting.jets(self._interpolated(t, half), half)[0][0]
            return Contacts(t, middle, (ends[0][0], ends[1][0]), np.ones((2, len(t))))

        self._check_sides()
        first, second = (family.primary for family in self.curves.meeting.families)
        around: Callable[..., Solver] = fitting.around if self.closed else fitting.along
        solve = around(contacts, (first, second))
        wanted = tied(self, tolerance, self.width)
        at, orders = self.kinks
        one, two = fitting.cubic(
            (first, second), solve, self.domain, wanted, closed=self.closed, corners=at[orders < 3]
        )
        return replace(one, fades=True), replace(two, fades=True)


def tied(swept: Swept, tolerance: float, width: float) -> Wanted:
    """Return what ribbons are to be so that what is between them can be within a tolerance (mm) of a swept surface."""
    return Wanted(
        position=SHARE * tolerance,
        length=tolerance / width,
        vectors=(lambda t: swept.ends(t)[0][1], lambda t: swept.ends(t)[1][1]),
    )


@dataclass(frozen=True)
class Skin(Filling):
    """Fills the section between two ribbons up to a swept surface."""

    swept: Swept

    firm: ClassVar[bool] = True
    advice: ClassVar[tuple[str, str]] = ("a relation that is less sharp", "a larger skin")

    @classmethod
    def over(cls, swept: Swept, closed: bool, tolerance: float, kinks: tuple[Array, Array] = SMOOTH) -> Skin:
        """Return what fills G1 sections within a tolerance (mm)."""
        return cls((2, 2, 2), ACROSS, tolerance, closed, *kinks, swept)

    def added(self, sides: tuple[Jets, Jets], v: Array) -> Callable[[Array], Array]:
        """Return how far the swept surface is from the section."""
        plain = section(sides)
        return lambda t: self.swept.points(t, 1 - v) - plain.grid(t, v)

    @property
    def compact(self) -> float:
        """What compact joints may be off (mm), so that what is between them can be within the tolerance."""
        return self.tolerance / 8

    def missed(self, surface: Surface) -> float:
        """Return how far a blend surface is from the curves at most (mm), between where these were read."""
        (low, high), (along, across) = self.swept.domain, MEASURED
        t, v = low + (high - low) * (np.arange(along) + 0.37) / along, np.linspace(0, 1, across)
        return float(np.linalg.norm(surface.grid(t, v) - self.swept.points(t, 1 - v), axis=2).max())


def sweep(meeting: Meeting, branch: Branch, x0: float) -> Sweep:
    """Carry one branch of the intersection at x0 through the whole family."""
    length = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(branch.points, axis=0), axis=1)))
    along = length / length[-1]
    at = _through(along, np.concatenate([branch.q, branch.points], axis=1), branch.closed)
    t = np.linspace(0, 1, STATIONS)
    axis = _steady(meeting, branch, at)
    phase: Phase
    if axis is None:
        points, rates, start = at[4:], at[4:].derivative(), at(t)[:, :4]
        phase = Planes(lambda t: (points(t), unit(rates(t))))
    else:
        first, last = branch.q[[0, -1], axis].tolist()
        phase = Isoparametric(axis, first, last, float(length[-1] / abs(last - first)))
        start = at(np.interp(t, (branch.q[:, axis] - first) / (last - first), along))[:, :4]
    x = np.union1d(np.linspace(0, 1, STEPS), x0)
    curves = Curves(meeting, phase)
    return Sweep(curves, branch.closed, t, x, curves.carried(start, t, x0, x)).within()


def _through(t: Array, values: Array, closed: bool) -> Curve:
    """Interpolate points along a branch: C4, round a closed one too, whose parameters may go on by a period."""
    if not closed:
        return fit.interpolate(t, values, degree=5 if len(t) > 5 else 3)
    lap, k = values[-1] - values[0], min(OVERLAP, len(t) - 1)
    before, after = values[-1 - k : -1] - lap, values[1 : k + 1] + lap
    long = np.concatenate([t[-1 - k : -1] - 1, t, t[1 : k + 1] + 1])
    return fit.interpolate(long, np.concatenate([before, values, after]), degree=5).clip(0.0, 1.0)


def _steady(meeting: Meeting, branch: Branch, at: Curve) -> int | None:
    """Return which parameter goes steadily along a branch, from end to end of its domain, or round; None if none."""
    rates = at.derivative()(np.linspace(0, 1, 257))[:, :4]
    best, found = STEADY, None
    for axis in range(4):
        low, high = meeting.bounds[axis]
        turn = branch.q[-1, axis] - branch.q[0, axis]
        if np.isfinite(low):
            ends = np.sort(branch.q[[0, -1], axis])
            if branch.closed or np.abs(ends - (low, high)).max() > OUTSIDE * (high - low):
                continue
        elif not branch.closed or turn == 0:
            continue
        share = float((rates[:, axis] / turn).min())
        if share > best:
            best, found = share, axis
    return found


@dataclass(frozen=True)
class EdgeSweep:
    """Curves that set out from a sharp edge, cut by its stations' planes; solved anew wherever they are asked for.

    ``ramp`` is how both sides are moved from 0 to where the relation is half-way; ``start`` returns the edge's stations
    at the edge's own t, which ``clock`` tells. On a ``closed`` edge, that is taken modulo 1.
    """

    meeting: Meeting
    ramp: Meeting
    start: Callable[[Array], Stations]
    closed: bool = False
    domain: tuple[float, float] = (0.0, 1.0)
    clock: Callable[[Array], Array] = np.positive

    def _solved(self, t: Array, x: Sequence[float] | Array) -> tuple[Array, Stations, Curves]:
        """Return parameters (n, m, 4) at t (n,) and x (m,), ascending; the stations, and the curves there."""
        t = self.clock(t)
        at = self.start(np.mod(t, 1.0) if self.closed else t)
        phase = Planes(lambda _: (at.point, at.direction))
        ramp, curves = Curves(self.ramp, phase), Curves(self.meeting, phase)
        try:
            half = ramp.carried(np.concatenate(at.uv, axis=1), at.t, 0.0, np.array([0.0, 1.0]))[:, 1]
            return curves.carried(half, at.t, 0.5, np.asarray(x, dtype=np.float64)), at, curves
        except GeometryError as error:
            raise SizeError(str(error)) from error

    def points(self, t: Array, x: Array) -> Array:
        """Return the points (n, m, 3) of the curves at t (n,) and x (m,).

        Raises
        ------
        SizeError
            Where the moved sides do not meet; the message names s and the place.
        """
        order = np.argsort(x)
        q, _, _ = self._solved(t, x[order])
        found = np.empty((len(t), len(x), 3))
        points = self.meeting.jets(q.reshape(-1, 4), np.tile(x[order], len(t)))[0][0]
        found[:, order] = points.reshape(found.shape)
        return found

    def ends(self, t: Array) -> Ends:
        """Return parameters (n, 2) and cross derivatives (n, 3), into the blend, on rail 1 (x = 1) and 2 (x = 0)."""
        q, at, curves = self._solved(t, (0.0, 1.0))
        one, none = np.ones(len(t)), np.zeros(len(t))
        return (
            (q[:, 1, :2], -curves.cross_derivatives(q[:, 1], at.t, one, 0)),
            (q[:, 0, 2:], curves.cross_derivatives(q[:, 0], at.t, none, 1)),
        )

    def contacts(self, t: Array) -> Contacts:
        """Return the rails' points at t, with their distances from the edge."""
        q, at, _ = self._solved(t, (0.0, 1.0))
        uv = q[:, 1, :2], q[:, 0, 2:]
        primaries = (family.primary for family in self.meeting.families)
        reach = [
            np.linalg.norm(primary.jet(one)[0] - at.point, axis=1) for primary, one in zip(primaries, uv, strict=True)
        ]
        return Contacts(t, at.point, uv, np.stack(reach))


def from_edge(
    sides: tuple[Side, Side],
    stations: Callable[[Array], Stations],
    length: float,
    relation: Relation,
    *,
    closed: bool,
) -> EdgeSweep:
    """Return the curves in which two sides of an edge meet while they are moved along their normals.

    They move to where the blend will be: into the material at a convex edge, out of it at a concave one. Side 1 by a
    moves the rail on side 2, and conversely.

    Raises
    ------
    GeometryError
        The edge is convex here and concave there.
    """

    def start(t: Array) -> Stations:
        return intersect(sides, stations(t), length)

    turn = inward(sides, start(np.linspace(0.02, 0.98, 25)))[2]
    if turn.max() > FLAT and turn.min() < -FLAT:
        raise GeometryError("the edge changes between convex and concave: its sides cannot be moved towards the blend")
    into = -float(np.sign(turn.sum()))
    first, second = (Offset(side.primary, (np.positive,), sign=into * side.outward) for side in sides)
    size = 4 * max(relation.a, relation.b)

    def along(s: Curve) -> Meeting:
        return Meeting((first, second), s, (Course(s[0], None), Course(s[1], None)), ANYWHERE, size)

    return EdgeSweep(
        along(relation.eased), along(Curve.bezier(np.stack([np.zeros(2), relation.eased(0.5)]))), start, closed
    )
