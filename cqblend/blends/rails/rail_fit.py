"""From contacts to ribbons: fits the two rails that a blend runs between, and its directions along them.

Ribbon and direction are fitted in lifted parameters (see :mod:`cqblend.surfaces.primary`), the only place where a
blend approximates: the boundary S(c(t)) and the tangent planes stay exact whatever the fit.

Three forms, the lightest that reproduces the contacts to rounding: one straight span (degree 1), circular arcs about a
common axis (degree 2, quarters of a circle, thirds at most of an open arc), else C2 cubic splines through the contacts,
on as many stations as the tolerances need.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts, ContactSolver
from cqblend.blends.contacts.knot_line_crossings import ContactCrossing, distance_past_knot, find_contact_crossings
from cqblend.blends.rails.cross_fields import CrossField, RailStations, compute_unit_directions, perpendicular_field
from cqblend.blends.rails.direction_fit import (
    DIRECTION_TOLERANCE,
    INITIAL_SPANS,
    LENGTH_TOLERANCE,
    add_third_points,
    fit_directions,
    interpolate_with_corners,
)
from cqblend.blends.rails.fit_errors import TooManySpansError
from cqblend.blends.rails.knot_line_bends import CurveMaker, KinkData, ParametricKinks
from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets
from cqblend.blends.rails.steering import SLIVER_SHARE, Steering, SteeringPin, find_pins
from cqblend.splines import Curve, interpolation
from cqblend.splines.bernstein import Array
from cqblend.surfaces.angles import shift_to_period, unwrap_parameters
from cqblend.surfaces.primary import Primary
from cqblend.surfaces.vectors import cross_product, normalise_vectors

OVERLAP_STATIONS = (
    24  # stations a closed rail is fitted past its joint: the influence of a cubic spline's end fades as 0.27^n
)
EXACT_RESIDUAL = 2e-13  # residual, relative to the size, up to which a lighter form counts as the same curve
QUARTER_TURN, THIRD_TURN = np.pi / 2, 2 * np.pi / 3  # rad: the largest pieces of closed and of open circular rails
SHORTEST_FOR_DIRECTION, SHORTEST_FOR_POSITION = (
    1 / 128,
    1 / 4096,
)  # its shortest spans, as shares of it, for the sake of directions and of position

NO_PARAMETERS = np.empty(0)

Domain = tuple[float, float]
LengthFactor = Callable[[Array], Array]
ContactMoves = list[tuple[int, float, Array]]  # of contacts: on which side, at which t, to which native parameters


@dataclass(frozen=True)
class RibbonTargets:
    """What ribbons are to be: within tolerances in space (mm), in direction (rad) and in length (relative).

    By side, ``fields`` are their cross directions, ``bulges`` factors on the lengths that the contacts suggest, as
    functions of t, ``orders`` those of continuity; ``steer`` is the largest angle (rad) by which directions are turned
    for the sake of what is inside the blend. Ribbons that are ``given_derivatives`` take the cross derivatives that the
    contacts have, instead of fields, bulges and lengths; these belong to points of the rails, which then may not shift
    along.
    """

    position: float = 1e-7
    direction: float = DIRECTION_TOLERANCE
    length: float = LENGTH_TOLERANCE
    fields: tuple[CrossField, CrossField] = (perpendicular_field, perpendicular_field)
    bulges: tuple[LengthFactor, LengthFactor] = (np.ones_like, np.ones_like)
    orders: tuple[int, int] = (1, 1)
    steer: float = 0.0
    given_derivatives: bool = False


@dataclass(frozen=True)
class RibbonErrors:
    """How far a fitted ribbon is from what was wanted, at every sample.

    In space (mm), of that across the rail (what is along it only shifts the common parameter, unless derivatives are
    given), in direction (rad), in
    length (relative), both less the slack of steering.
    """

    position: Array
    across: Array
    direction: Array
    length: Array


def unwrap_open_solver(solve: ContactSolver, primaries: tuple[Primary, Primary]) -> ContactSolver:
    """Make a solver over an open edge, asked for ascending t, return native parameters that are continuous."""

    def solve_along(t: Array) -> Contacts:
        solved = solve(t)
        uv = [unwrap_parameters(found, primary.periods) for primary, found in zip(primaries, solved.uv, strict=True)]
        return replace(solved, uv=(uv[0], uv[1]))

    return solve_along


def unwrap_closed_solver(solve: ContactSolver, primaries: tuple[Primary, Primary]) -> ContactSolver:
    """Extend a solver over a closed edge, t in [0, 1), to all t, with native parameters that are continuous.

    The parameters asked for must include an integer, and follow the edge densely enough to tell which way it winds.
    """

    def solve_around(t: Array) -> Contacts:
        lap = np.floor(t)
        base, index = np.unique(t - lap, return_inverse=True)
        solved = solve(base)
        uv = []
        for primary, found in zip(primaries, solved.uv, strict=True):
            found = unwrap_parameters(found, primary.periods)
            winding = np.zeros(2)
            for axis, period in enumerate(primary.periods):
                if period is not None:
                    winding[axis] = period * np.round((found[-1, axis] - found[0, axis]) / period)
            uv.append(found[index] + lap[:, None] * winding)
        return replace(solved.select_stations(index), t=t, uv=(uv[0], uv[1]))

    return solve_around


def _fit_ribbon(
    primaries: tuple[Primary, Primary],
    t: Array,
    solved: Contacts,
    side: int,
    weight: Array,
    make: CurveMaker,
    wanted: RibbonTargets,
    steering: Steering,
    turn: CurveMaker | None = None,
    bent: tuple[Array, Array] = (NO_PARAMETERS, NO_PARAMETERS),
) -> tuple[Ribbon, RibbonErrors]:
    """Fit one ribbon to the contacts at the rail's parameters t; also return its errors there.

    ``make`` turns lifted values at t, scaled to the given homogeneous weight, into a curve; it need not use all of
    them. ``turn`` does so for directions, if these take another way. ``bent`` are the nodes, every third of the
    parameters, at which the rail has kinks, and at which directions have. The samples may reach past the domain of the
    steering, on which the ribbon is wanted and errors are measured.
    """
    primary, uv = primaries[side], solved.uv[side]
    jet = primary.jet(uv)
    values, bends = primary.scale_weight(primary.lift_points(uv), weight), None
    own, turning = bent
    if len(own):
        before = values[3 * own]
        plain = make(values, KinkData(own, own, before, np.zeros((2, *before.shape))))
        bends = ParametricKinks.from_rail(primary, plain, uv, t, np.stack([own, own]))
        c = bends.fit_curve(primary, values, before, make, lambda c: c, lambda c: primary.compose_jets(c, ()))
    else:
        c = make(values, None)
    if len(turning) > len(own):
        bends = ParametricKinks.from_rail(primary, c, uv, t, np.stack([turning, turning]))
    point, rate = dehomogenise_jets(primary.compose_position(c).jet(t, 1))
    if wanted.given_derivatives:
        assert solved.cross_vectors is not None
        asked = solved.cross_vectors[side]
    else:
        other = primaries[1 - side].jet(solved.uv[1 - side])[0]
        asked = compute_unit_directions(
            wanted.fields[side], RailStations(t, jet, rate, solved.edge_points - jet[0], other - jet[0])
        )
        asked = asked * (wanted.bulges[side](t) * solved.cross_lengths[side])[:, None]
    made, turned, ratio = fit_directions(primary, c, uv, t, asked, wanted.orders[side], turn or make, steering, bends)
    domain = steering.domain
    inside = (t >= domain[0]) & (t <= domain[1])
    if not inside.all():
        c, made = c.clip(*domain), tuple(d.clip(*domain) for d in made)
    near = np.stack([np.interp(c.breaks, t, column) for column in uv.T], -1)
    offset = (point - jet[0])[inside]
    errors = RibbonErrors(
        np.linalg.norm(offset, axis=1),
        np.linalg.norm(
            offset if wanted.given_derivatives else cross_product(offset, normalise_vectors(rate[inside])), axis=1
        ),
        (turned - steering.evaluate_slack(t))[inside],
        (ratio - steering.evaluate_slack(t))[inside],
    )
    direction = (turned + np.abs(steering.evaluate_angle(t)))[inside]
    ribbon = Ribbon(primary, c, made, near, wanted.orders[side], float(direction.max()), float(ratio[inside].max()))
    return ribbon, errors


def _fit_exact_pair(
    primaries: tuple[Primary, Primary],
    solved: Contacts,
    t: Array,
    weight: Array,
    make: CurveMaker,
    wanted: RibbonTargets,
    size: float,
) -> tuple[Ribbon, Ribbon] | None:
    """Return both ribbons if the made curves reproduce contacts and directions to rounding, unsteered, else None."""
    ribbons = []
    for side in (0, 1):
        ribbon, errors = _fit_ribbon(
            primaries, t, solved, side, weight, make, wanted, Steering((), (t[0], t[-1]), False)
        )
        if errors.position.max() > EXACT_RESIDUAL * size or ribbon.direction > 1e-11 or ribbon.length > 1e-11:
            return None
        order = wanted.orders[side]
        if find_pins(ribbon, wanted.steer) or any(
            one.is_parametric_kink(order) for one in primaries[side].find_knot_crossings(ribbon.c, order)
        ):
            return None
        ribbons.append(replace(ribbon, light=True))
    return ribbons[0], ribbons[1]


def fit_straight_ribbons(
    primaries: tuple[Primary, Primary], solve: ContactSolver, domain: Domain, wanted: RibbonTargets, size: float
) -> tuple[Ribbon, Ribbon] | None:
    """Return the ribbons as one span of degree 1, or None if that is not what they are."""
    t = np.linspace(*domain, 7)

    def make_segment(values: Array, _: KinkData | None) -> Curve:
        return Curve(np.array(domain), values[[0, -1], :, None])

    return _fit_exact_pair(primaries, solve(t), t, np.ones(7), make_segment, wanted, size)


def fit_circular_ribbons(
    primaries: tuple[Primary, Primary],
    solve: ContactSolver,
    domain: Domain,
    turn: float,
    wanted: RibbonTargets,
    size: float,
    largest: float = QUARTER_TURN,
) -> tuple[Ribbon, Ribbon] | None:
    """Return the ribbons as rational arcs of degree 2, or None if the joint is not one of revolution.

    The edge is an arc of angle ``turn`` over t in [0, 1]; the rails are made over ``domain``, in pieces that turn by
    ``largest`` at most. On each the half-angle pair about the axis is linear in the parameter, so that everything
    carried round the axis is quadratic.
    """
    count = _count_arcs(domain, turn, largest)
    breaks = np.linspace(*domain, count + 1)
    t = np.interp(np.arange(4 * count + 1) / 4, np.arange(count + 1), breaks)
    at, weight = map_arc_parameters(domain, turn, t, largest)
    solved = solve(at)

    def make_arcs(values: Array, _: KinkData | None) -> Curve:
        start, middle, end = values[:-4:4], values[2::4], values[4::4]
        coefs = np.stack([start, 2 * middle - (start + end) / 2, end])
        return Curve(breaks, coefs.transpose(0, 2, 1), continuity=np.zeros(count - 1, int))

    return _fit_exact_pair(primaries, solved, t, weight, make_arcs, wanted, size)


def _count_arcs(domain: Domain, turn: float, largest: float) -> int:
    """Return into how many arcs a rail is divided."""
    return max(1, int(np.ceil(turn * (domain[1] - domain[0]) / largest - 1e-9)))


def map_arc_parameters(domain: Domain, turn: float, t: Array, largest: float = QUARTER_TURN) -> tuple[Array, Array]:
    """Return, at parameters t (n,) of :func:`fit_circular_ribbons` rails, the edge's own, and the weight."""
    count = _count_arcs(domain, turn, largest)
    step = turn * (domain[1] - domain[0]) / count
    x = (t - domain[0]) / (domain[1] - domain[0]) * count
    piece = np.clip(x.astype(int), 0, count - 1)
    a, b = 1 + (x - piece) * (np.cos(step / 2) - 1), (x - piece) * np.sin(step / 2)
    return domain[0] + (step * piece + 2 * np.arctan2(b, a)) / turn, a**2 + b**2


def fit_cubic_ribbons(
    primaries: tuple[Primary, Primary],
    solve: ContactSolver,
    domain: Domain,
    wanted: RibbonTargets,
    *,
    closed: bool,
    corners: Array = NO_PARAMETERS,
) -> tuple[Ribbon, Ribbon]:
    """Return C2 cubic ribbons on the fewest stations that meet what is wanted, by halving the spans that do not.

    At ``corners``, where contacts are known to be no more than C1, the ribbons are C1 too; and where they bend; and, if
    derivatives are given, where they cross knot lines at which their surface is less than C3.

    Where faces are not smooth the contacts have kinks, which no C2 curve follows: there, spans are halved down to 1/128
    of the rail for the sake of the directions, to 1/4096 for that of the position. What remains in direction and length
    stands in the certificate; the tangent planes are exact all the same.

    Raises
    ------
    GeometryError
        If what remains in position is more than ten times what is wanted.
    """
    lines = [
        one._replace(smooth=one.smooth and not wanted.given_derivatives)
        for i, (primary, order) in enumerate(zip(primaries, wanted.orders, strict=True))
        for one in find_contact_crossings(solve, primary, i, domain, max(1, order))
        if wanted.given_derivatives or one.bend
    ]
    if lines:
        at = np.array([one.t for one in lines])
        corners = _drop_near_duplicates(np.concatenate([corners, at]), SLIVER_SHARE * (domain[1] - domain[0]))
        lines = [one._replace(t=float(corners[np.abs(corners - one.t).argmin()])) for one in lines]
    task = _CubicFit(primaries, solve, domain, wanted, closed, corners, tuple(lines))
    moves: ContactMoves = []
    straight_on = (task.no_steering, task.no_steering)
    breaks, built = task.refine_breaks(task.choose_initial_breaks(), moves, straight_on)
    breaks, moves = _merge_knot_crossings(built, breaks, corners)
    if moves:
        built = task.interpolate_contacts(breaks, moves, straight_on)[0]
    found = [find_pins(ribbon, wanted.steer) for ribbon in built]
    if any(found):
        breaks, moves = _add_pin_breaks(built, found, breaks, moves)
        steered = tuple(replace(task.no_steering, pins=tuple(some)) for some in found)
        breaks, built = task.refine_breaks(breaks, moves, (steered[0], steered[1]))
    return built


def _drop_near_duplicates(t: Array, slack: float) -> Array:
    """Return parameters in order, without those that nearly repeat another."""
    t = np.sort(t)
    return t[np.append(True, np.diff(t) > slack)] if len(t) else t


@dataclass(frozen=True)
class _CubicFit:
    """The task of :func:`fit_cubic_ribbons`."""

    primaries: tuple[Primary, Primary]
    solve: ContactSolver
    domain: Domain
    wanted: RibbonTargets
    closed: bool
    corners: Array
    knot_crossings: tuple[ContactCrossing, ...]  # knot lines, at some of the corners

    def choose_initial_breaks(self) -> Array:
        """Return the breaks to start with: equal spans, and the corners."""
        even = np.linspace(*self.domain, INITIAL_SPANS + 1)
        if not len(self.corners):
            return even
        clear = np.abs(even[:, None] - self.corners).min(axis=1) > (even[1] - even[0]) / 3
        clear[[0, -1]] = True
        inside = (self.corners > even[0] + SLIVER_SHARE * (even[-1] - even[0])) & (
            self.corners < even[-1] - SLIVER_SHARE * (even[-1] - even[0])
        )
        return np.sort(np.concatenate([even[clear], self.corners[inside]]))

    @property
    def no_steering(self) -> Steering:
        return Steering((), self.domain, self.closed)

    def refine_breaks(
        self, breaks: Array, moves: ContactMoves, steering: tuple[Steering, Steering]
    ) -> tuple[Array, tuple[Ribbon, Ribbon]]:
        """Halve spans until the ribbons are as wanted; return the breaks, and the ribbons."""
        wanted = self.wanted
        while True:
            built, measured = self.interpolate_contacts(breaks, moves, steering)
            share = np.diff(breaks) / (self.domain[1] - self.domain[0])
            bad = np.zeros(len(share), bool)
            for errors in measured:
                for inner in (slice(1, None, 3), slice(2, None, 3)):
                    bad |= (errors.across[inner] > wanted.position) & (share > SHORTEST_FOR_POSITION)
                    turned = (errors.direction[inner] > wanted.direction) | (errors.length[inner] > wanted.length)
                    bad |= turned & (share > 1.9 * SHORTEST_FOR_DIRECTION)
            if not bad.any():
                break
            breaks = np.sort(np.concatenate([breaks, (breaks[:-1] + breaks[1:])[bad] / 2]))
        missed = max(float(errors.across.max()) for errors in measured)
        if missed > 10 * wanted.position:
            raise TooManySpansError(
                f"the rails miss the contacts by {missed:.2g} mm on {len(breaks)} stations",
                "the edge or its faces are not smooth enough for this size; try a smaller one",
            )
        return breaks, built

    def interpolate_contacts(
        self, breaks: Array, moves: ContactMoves, steering: tuple[Steering, Steering]
    ) -> tuple[tuple[Ribbon, Ribbon], list[RibbonErrors]]:
        """Interpolate the contacts at the breaks, moved as told; measure there and at a third and two of every span.

        Half-way would flatter: there, and at the breaks, the slope of a spline is nearly that of what it interpolates.
        """
        nodes = _extend_closed_breaks(breaks) if self.closed else breaks
        t = add_third_points(nodes)
        solved = self.solve(t)
        for side, at, target in moves:
            apart = t - at
            if self.closed:
                apart -= (self.domain[1] - self.domain[0]) * np.round(apart / (self.domain[1] - self.domain[0]))
            here = np.abs(apart) < 1e-13
            found = solved.uv[side]
            for axis, period in enumerate(self.primaries[side].periods):
                value = target[axis]
                found[here, axis] = value if period is None else shift_to_period(value, found[here, axis], period)

        for one in self.knot_crossings:
            here, found = self._find_corner_nodes(t, np.array([one.t])), solved.uv[one.side]
            found[here, one.axis] -= distance_past_knot(
                found[here, one.axis], one.value, self.primaries[one.side].periods[one.axis]
            )
        corners = self._find_corner_nodes(nodes, self.corners)
        level, kinked = (
            self._find_corner_nodes(
                nodes, np.array([one.t for one in self.knot_crossings if one.bend and one.smooth == smooth])
            )
            for smooth in (True, False)
        )
        level = np.setdiff1d(level, kinked)
        ones = np.ones(len(t))

        def make_spline(values: Array, kinks: KinkData | None, corners: Array, sharp: Array) -> Curve:
            if not len(corners):
                return interpolation.interpolate(nodes, values[::3])
            pieces = np.unique([0, *corners, len(nodes) - 1])
            return interpolate_with_corners(nodes, values, pieces, closed=False, sharp=sharp, kinks=kinks)

        def fit_side(side: int) -> tuple[Ribbon, RibbonErrors]:
            mine = [one for one in self.knot_crossings if one.side == side]
            sharp = self._find_crossing_nodes(nodes, [one for one in mine if one.sharp and not one.bend])
            bent = self._find_crossing_nodes(nodes, [one for one in mine if one.bend])
            return _fit_ribbon(
                self.primaries,
                t,
                solved,
                side,
                ones,
                partial(make_spline, corners=np.setdiff1d(corners, level), sharp=NO_PARAMETERS),
                self.wanted,
                steering[side],
                partial(make_spline, corners=corners, sharp=sharp),
                (np.setdiff1d(bent, level), bent),
            )

        (first, missed), (second, lost) = fit_side(0), fit_side(1)
        return (first, second), [missed, lost]

    def _find_crossing_nodes(self, nodes: Array, some: list[ContactCrossing]) -> Array:
        """Return which nodes, but the first and the last, are at crossings."""
        found = self._find_corner_nodes(nodes, np.array([one.t for one in some]))
        return found[(found > 0) & (found < len(nodes) - 1)]

    def _find_corner_nodes(self, nodes: Array, corners: Array) -> Array:
        """Return which nodes, overlapping ones among them, are corners."""
        if not len(corners):
            return np.empty(0, dtype=int)
        apart, period = nodes[:, None] - corners, self.domain[1] - self.domain[0]
        if self.closed:
            apart -= period * np.round(apart / period)
        return np.flatnonzero(np.abs(apart).min(axis=1) < 1e-9 * period)


def _add_pin_breaks(
    ribbons: tuple[Ribbon, Ribbon], found: list[list[SteeringPin]], breaks: Array, moves: ContactMoves
) -> tuple[Array, ContactMoves]:
    """Let both rails have a break at every pin, and run through its knot line just there."""
    fixed = {at for _, at, _ in moves} | {breaks[0], breaks[-1]}
    moves = list(moves)
    for side, some in enumerate(found):
        for pin in some:
            uv = ribbons[side].find_native_parameters(np.array([pin.t]))[0]
            uv[pin.axis] = pin.value
            if pin.t not in fixed:
                i = int(np.abs(breaks - pin.t).argmin())
                room = np.diff(breaks)[max(i - 1, 0) : i + 1].min()
                if breaks[i] not in fixed and abs(breaks[i] - pin.t) < room / 3:
                    breaks = np.delete(breaks, i)
                breaks = np.sort(np.append(breaks, pin.t))
                fixed.add(pin.t)
            moves = [move for move in moves if move[:2] != (side, pin.t)] + [(side, pin.t, uv)]
    return breaks, moves


def _merge_knot_crossings(rails: tuple[Ribbon, Ribbon], breaks: Array, corners: Array) -> tuple[Array, ContactMoves]:
    """Bring knot-line crossings together with those that nearly coincide, and breaks together with crossings.

    The blend has a knot wherever one of its rails crosses a knot line; two knots nearly at one place would leave a
    sliver between them, whose derivatives are rounding noise. On a symmetric part that is the rule: both rails cross
    theirs in the plane of symmetry, apart by the tolerance of the edge. A break gives way to a crossing as far as a
    third of its span off, unless it is a corner. Returns the breaks, and the native parameters through which a rail is
    to run at some of them, so that it crosses just there.
    """
    slack = SLIVER_SHARE * (breaks[-1] - breaks[0])
    crossings = []
    for side, rail in enumerate(rails):
        cut = rail.primary.compose_position(rail.c).breaks
        crossings += [(t, side) for t in cut[~np.isin(cut, rail.c.breaks)].tolist()]
    clusters: list[dict[int, float]] = []  # of each, the first crossing of either rail
    last = -np.inf
    for t, side in sorted(crossings):
        if t - last > slack:
            clusters.append({})
        clusters[-1].setdefault(side, t)
        last = t
    moves: ContactMoves = []
    for cluster in clusters:
        first = min(cluster.values())
        spans = np.diff(breaks)
        fixed = np.isin(breaks, corners)
        fixed[[0, -1]] = True
        room = np.where(fixed, 0.0, np.minimum(np.append(np.inf, spans), np.append(spans, np.inf)) / 3)
        near = np.abs(breaks - first) <= np.maximum(room, 2 * slack)
        if not near.any() and len(cluster) == 1:
            continue
        at = float(breaks[near & fixed][0]) if (near & fixed).any() else first
        breaks = np.sort(np.append(breaks[~near], at))
        moves += [(side, at, rails[side].find_native_parameters(np.array([t]))[0]) for side, t in cluster.items()]
    return breaks, moves


def _extend_closed_breaks(breaks: Array) -> Array:
    """Continue the breaks of a closed rail past its joint, by ``OVERLAP_STATIONS`` stations each way."""
    period, count = breaks[-1] - breaks[0], len(breaks) - 1
    laps = -(-OVERLAP_STATIONS // count)
    tiled = (breaks[:-1] + period * np.arange(-laps, laps + 1)[:, None]).ravel()
    start = laps * count
    return np.concatenate(
        [tiled[start - OVERLAP_STATIONS : start], breaks, tiled[start + count + 1 : start + count + OVERLAP_STATIONS]]
    )
