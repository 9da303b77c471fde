"""Fits ribbons to the contacts of a blend as C2 cubic splines, on as many stations as the tolerances need.

Straight and circular rails have lighter forms (:mod:`cqblend.blends.rails.line_and_arc_ribbons`).
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts, ContactSolver
from cqblend.blends.contacts.knot_line_crossings import ContactCrossing, distance_past_knot, find_contact_crossings
from cqblend.blends.rails.break_spacing import halve_spans, predict_growth, space_breaks
from cqblend.blends.rails.cornered_spline import KinkData, add_third_points, interpolate_with_corners
from cqblend.blends.rails.direction_steering import Steering, SteeringPin, drop_hasty_pins, find_pins
from cqblend.blends.rails.fit_exceptions import TooManySpansError
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.ribbon_end import FREE_ENDS, GivenEnds
from cqblend.blends.rails.ribbon_fit import (
    ContactSamples,
    Domain,
    RibbonCurves,
    RibbonErrors,
    RibbonTargets,
    fit_ribbon,
)
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.interpolation import interpolate
from cqblend.surfaces.angles import shift_to_period
from cqblend.surfaces.primary_surface import Primary

NO_CORNERS = np.empty(0)


class ContactMove(NamedTuple):
    """A contact of a side that is moved, at ``t``, to the native parameters ``uv`` (2,): onto a knot line."""

    side: int
    t: float
    uv: Array


class FittedPair(NamedTuple):
    """Both ribbons, and their errors."""

    ribbons: tuple[Ribbon, Ribbon]
    errors: tuple[RibbonErrors, RibbonErrors]


def fit_cubic_ribbons(
    primaries: tuple[Primary, Primary],
    solve: ContactSolver,
    domain: Domain,
    wanted: RibbonTargets,
    *,
    closed: bool,
    corners: Array = NO_CORNERS,
    ends: tuple[GivenEnds, GivenEnds] = (FREE_ENDS, FREE_ENDS),
) -> tuple[Ribbon, Ribbon]:
    """Return C2 cubic ribbons on about the fewest stations that meet what is wanted.

    The ribbons are only C1 at ``corners``, where contacts are known to be no more than C1, and where the rail crosses
    a parametric kink of its surface; if derivatives are given, also at knot lines at which the surface is less than C3.
    Those of an open joint have the ``ends`` that are given, by side, whatever the contacts are there.

    Where faces are not smooth the contacts have kinks, which no C2 curve follows: there, spans get shorter down to
    1/128 of the rail for the sake of the directions, to 1/4096 for that of the position. What the directions miss then
    stands in the certificate; the tangent planes are exact all the same.

    Raises
    ------
    GeometryError
        If what remains in position is more than ten times what is wanted.
    """
    crossings = [
        replace(one, smooth_in_parameters=one.smooth_in_parameters and not wanted.given_derivatives)
        for side, (primary, order) in enumerate(zip(primaries, wanted.orders, strict=True))
        for one in find_contact_crossings(solve, primary, side, domain, max(1, order))
        if wanted.given_derivatives or one.parametric_kink
    ]
    if crossings:
        at = np.array([crossing.t for crossing in crossings])
        slack = RAIL_TOLERANCES.sliver_share * (domain[1] - domain[0])
        corners = _drop_near_duplicates(np.concatenate([corners, at]), slack)
        crossings = [replace(one, t=float(corners[np.abs(corners - one.t).argmin()])) for one in crossings]
    task = _CubicFit(primaries, solve, domain, wanted, closed, corners, tuple(crossings), ends)
    moves: list[ContactMove] = []
    unsteered = task.no_steering
    breaks, ribbons = task.refine_breaks(task.choose_initial_breaks(), moves, unsteered, RAIL_TOLERANCES.spacing_rounds)
    breaks, moves = _merge_knot_crossings(ribbons, breaks, corners)
    if moves:
        ribbons = task.interpolate_contacts(breaks, moves, unsteered).ribbons
    first_pins, second_pins = (
        drop_hasty_pins(ribbon, find_pins(ribbon, wanted.steer), steering.fixed_ends)
        for ribbon, steering in zip(ribbons, unsteered, strict=True)
    )
    if first_pins or second_pins:
        breaks, moves = _add_pin_breaks(ribbons, (first_pins, second_pins), breaks, moves)
        steering = (replace(unsteered[0], pins=tuple(first_pins)), replace(unsteered[1], pins=tuple(second_pins)))
        breaks, ribbons = task.refine_breaks(breaks, moves, steering, 0)  # breaks stay where crossings brought them
    return ribbons


def _drop_near_duplicates(t: Array, slack: float) -> Array:
    """Return parameters in order, without those that nearly repeat another."""
    t = np.sort(t)
    return t[np.append(True, np.diff(t) > slack)] if len(t) else t


@dataclass(frozen=True)
class _CubicFit:
    """The task of :func:`fit_cubic_ribbons`: ``knot_crossings`` are at some of the ``corners``."""

    primaries: tuple[Primary, Primary]
    solve: ContactSolver
    domain: Domain
    wanted: RibbonTargets
    closed: bool
    corners: Array
    knot_crossings: tuple[ContactCrossing, ...]
    ends: tuple[GivenEnds, GivenEnds]

    @property
    def length(self) -> float:
        """The length of the domain, the period of a closed rail."""
        return self.domain[1] - self.domain[0]

    @property
    def no_steering(self) -> tuple[Steering, Steering]:
        """Steering, by side, that turns nothing."""
        first, second = (
            Steering((), self.domain, self.closed, (start is not None, stop is not None)) for start, stop in self.ends
        )
        return first, second

    def choose_initial_breaks(self) -> Array:
        """Return the breaks to start with: equal spans, and the corners."""
        even = np.linspace(*self.domain, RAIL_TOLERANCES.initial_spans + 1)
        if not len(self.corners):
            return even
        clear = np.abs(even[:, None] - self.corners).min(axis=1) > (even[1] - even[0]) / 3
        clear[[0, -1]] = True
        margin = RAIL_TOLERANCES.sliver_share * (even[-1] - even[0])
        inside = (self.corners > even[0] + margin) & (self.corners < even[-1] - margin)
        return np.sort(np.concatenate([even[clear], self.corners[inside]]))

    def refine_breaks(
        self, breaks: Array, moves: Sequence[ContactMove], steering: tuple[Steering, Steering], spacing_rounds: int
    ) -> tuple[Array, tuple[Ribbon, Ribbon]]:
        """Shorten spans until the ribbons are as wanted; return the breaks, and the ribbons.

        In so many rounds all breaks but those at corners are spaced anew; after these, spans are halved.
        """
        for count in itertools.count():
            fitted = self.interpolate_contacts(breaks, moves, steering)
            missed, growth = self._find_missed_spans(breaks, fitted.errors)
            if not missed.any():
                break
            if count < spacing_rounds:
                shortest = RAIL_TOLERANCES.shortest_span_for_direction * self.length
                breaks = space_breaks(breaks, growth, self.corners, shortest)
            else:
                breaks = halve_spans(breaks, np.where(missed, 2.0, 0.0)[:, None].repeat(2, axis=1))
        gap = max(float(errors.across.max()) for errors in fitted.errors)
        if gap > RAIL_TOLERANCES.largest_miss * self.wanted.position:
            raise TooManySpansError(
                f"the rails miss the contacts by {gap:.2g} mm on {len(breaks)} stations",
                "the edge or its faces are not smooth enough for this size; try a smaller one",
            )
        return breaks, fitted.ribbons

    def _find_missed_spans(self, breaks: Array, errors: tuple[RibbonErrors, RibbonErrors]) -> tuple[Array, Array]:
        """Return which spans (n,) err too much and are not too short already, and the factors by which they must grow.

        That is, by which there must be more spans in their place.
        """
        wanted, share = self.wanted, np.diff(breaks) / self.length
        across, turned = np.zeros(len(share)), np.zeros(len(share))
        for one in errors:
            for inner in (slice(1, None, 3), slice(2, None, 3)):
                across = np.maximum(across, one.across[inner] / wanted.position)
                turned = np.maximum(turned, one.direction[inner] / wanted.direction)
                turned = np.maximum(turned, one.length[inner] / wanted.length)
        shortest = RAIL_TOLERANCES.shortest_span_for_direction
        across[share <= RAIL_TOLERANCES.shortest_span_for_position] = 0.0
        turned = np.where(share > RAIL_TOLERANCES.least_divided_span * shortest, turned, 0.0)
        growth = np.maximum(
            predict_growth(across, RAIL_TOLERANCES.position_order),
            np.minimum(predict_growth(turned, RAIL_TOLERANCES.direction_order), share / shortest),
        )
        return np.maximum(across, turned) > 1, growth

    def interpolate_contacts(
        self, breaks: Array, moves: Sequence[ContactMove], steering: tuple[Steering, Steering]
    ) -> FittedPair:
        """Interpolate the contacts at the breaks, some of them moved; measure errors there, and twice in every span.

        That is at a third and at two thirds of it: half-way the slope of a spline is nearly that of what it
        interpolates, and errors would look too small.
        """
        nodes = _extend_closed_breaks(breaks) if self.closed else breaks
        t = add_third_points(nodes)
        contacts = self._solve_moved_contacts(t, moves)
        corners = self._find_nodes_at(nodes, self.corners)
        smooth, kinked = (
            self._find_nodes_at(
                nodes,
                np.array(
                    [
                        crossing.t
                        for crossing in self.knot_crossings
                        if crossing.parametric_kink and crossing.smooth_in_parameters == in_parameters
                    ]
                ),
            )
            for in_parameters in (True, False)
        )
        smooth = np.setdiff1d(smooth, kinked)

        def make_spline(
            values: Array, kinks: KinkData | None, row: int, ends: GivenEnds, corners: Array, sharp: Array
        ) -> Curve:
            slopes = None if ends[0] is None else ends[0].slopes[row], None if ends[1] is None else ends[1].slopes[row]
            values = _put_end_values(values, t, ends, row)
            if not len(corners):
                return interpolate(nodes, values[::3], derivatives=slopes)
            pieces = np.unique([0, *corners, len(nodes) - 1])
            return interpolate_with_corners(
                nodes, values, pieces, closed=False, sharp=sharp, kinks=kinks, end_slopes=slopes
            )

        samples = ContactSamples(self.primaries, t, contacts, np.ones(len(t)))

        def fit_side(side: int) -> tuple[Ribbon, RibbonErrors]:
            mine = [crossing for crossing in self.knot_crossings if crossing.side == side]
            kinks = self._find_inner_nodes(nodes, [one for one in mine if one.parametric_kink])
            sharp = self._find_inner_nodes(nodes, [one for one in mine if one.below_c2 and not one.parametric_kink])
            make_direction = partial(make_spline, ends=self.ends[side], corners=corners, sharp=sharp)
            curves = RibbonCurves(
                partial(
                    make_spline,
                    row=0,
                    ends=self.ends[side],
                    corners=np.setdiff1d(corners, smooth),
                    sharp=NO_CORNERS,
                ),
                tuple(partial(make_direction, row=1 + k) for k in range(max(self.wanted.orders[side], 1))),
                np.setdiff1d(kinks, smooth),
                kinks,
            )
            return fit_ribbon(samples, side, curves, self.wanted, steering[side])

        (first, first_errors), (second, second_errors) = fit_side(0), fit_side(1)
        return FittedPair((first, second), (first_errors, second_errors))

    def _solve_moved_contacts(self, t: Array, moves: Sequence[ContactMove]) -> Contacts:
        """Solve for contacts; bring those to be moved to their places, and those at crossings onto their knot lines."""
        contacts = self.solve(t)
        first, second = (uv.copy() for uv in contacts.uv)
        moved = first, second
        for move in moves:
            here = np.abs(self._measure_offset(t, move.t)) < RAIL_TOLERANCES.same_station_share
            uv = moved[move.side]
            for axis, period in enumerate(self.primaries[move.side].periods):
                value = move.uv[axis]
                uv[here, axis] = value if period is None else shift_to_period(value, uv[here, axis], period)
        for crossing in self.knot_crossings:
            here, uv = self._find_nodes_at(t, np.array([crossing.t])), moved[crossing.side]
            uv[here, crossing.axis] -= distance_past_knot(
                uv[here, crossing.axis], crossing.value, self.primaries[crossing.side].periods[crossing.axis]
            )
        return replace(contacts, uv=moved)

    def _measure_offset(self, t: Array, at: float | Array) -> Array:
        """Return how far parameters are past others, on a closed rail past the nearest repetition of these."""
        offset = np.asarray(t - at)
        if self.closed:
            offset -= self.length * np.round(offset / self.length)
        return offset

    def _find_inner_nodes(self, nodes: Array, crossings: list[ContactCrossing]) -> Array:
        """Return the indices of the nodes, but for the first and the last, that are at crossings."""
        found = self._find_nodes_at(nodes, np.array([crossing.t for crossing in crossings]))
        return found[(found > 0) & (found < len(nodes) - 1)]

    def _find_nodes_at(self, nodes: Array, t: Array) -> Array:
        """Return the indices of the nodes that are at parameters t, or at their repetitions on a closed rail."""
        if not len(t):
            return np.empty(0, dtype=int)
        offset = self._measure_offset(nodes[:, None], t)
        return np.flatnonzero(np.abs(offset).min(axis=1) < RAIL_TOLERANCES.same_node_share * self.length)


def _put_end_values(values: Array, t: Array, ends: GivenEnds, row: int) -> Array:
    """Return lifted values (n, k) of one curve of a ribbon at t (n,), with those of given ends first and last.

    Those of the second and the third direction lead there over some length.
    """
    if ends == FREE_ENDS:
        return values
    values = values.copy()
    for index, end in zip((0, -1), ends, strict=True):
        if end is not None:
            if row > 1 and end.fade:
                x = np.clip(np.abs(t - t[index]) / end.fade, 0.0, 1.0)
                values += np.multiply.outer((1 - x) ** 3 * (1 + 3 * x), end.values[row] - values[index])
            values[index] = end.values[row]
    return values


def _add_pin_breaks(
    ribbons: tuple[Ribbon, Ribbon],
    pins: tuple[list[SteeringPin], list[SteeringPin]],
    breaks: Array,
    moves: Sequence[ContactMove],
) -> tuple[Array, list[ContactMove]]:
    """Return breaks and moves with which both rails have a break at every pin, and cross its knot line just there."""
    fixed = {move.t for move in moves} | {breaks[0], breaks[-1]}
    all_moves = list(moves)
    for side, of_rail in enumerate(pins):
        for pin in of_rail:
            uv = ribbons[side].find_native_parameters(np.array([pin.t]))[0]
            uv[pin.axis] = pin.value
            if pin.t not in fixed:
                i = int(np.abs(breaks - pin.t).argmin())
                room = np.diff(breaks)[max(i - 1, 0) : i + 1].min()
                if breaks[i] not in fixed and abs(breaks[i] - pin.t) < room / 3:
                    breaks = np.delete(breaks, i)
                breaks = np.sort(np.append(breaks, pin.t))
                fixed.add(pin.t)
            others = [move for move in all_moves if (move.side, move.t) != (side, pin.t)]
            all_moves = [*others, ContactMove(side, pin.t, uv)]
    return breaks, all_moves


def _merge_knot_crossings(
    ribbons: tuple[Ribbon, Ribbon], breaks: Array, corners: Array
) -> tuple[Array, list[ContactMove]]:
    """Bring knot-line crossings together with those that nearly coincide, and breaks together with crossings.

    The blend has a knot wherever one of its rails crosses a knot line; two knots nearly at one place would leave a
    sliver between them, whose derivatives are rounding noise. On a symmetric part that is the rule: both rails cross
    theirs in the plane of symmetry, apart by the tolerance of the edge. A break gives way to a crossing as far as a
    third of its span off, unless it is a corner. Returns the breaks, and the moves of contacts at some of them onto the
    knot line that the rail crosses just there.
    """
    slack = RAIL_TOLERANCES.sliver_share * (breaks[-1] - breaks[0])
    moves: list[ContactMove] = []
    for cluster in _cluster_crossings(ribbons, slack):
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
        moves += [
            ContactMove(side, at, ribbons[side].find_native_parameters(np.array([t]))[0]) for side, t in cluster.items()
        ]
    return breaks, moves


def _cluster_crossings(ribbons: tuple[Ribbon, Ribbon], slack: float) -> list[dict[int, float]]:
    """Return the clusters of knot-line crossings nearer to each other than ``slack``.

    Each has the t of the first crossing of either rail, by the index of the rail.
    """
    crossings = []
    for side, ribbon in enumerate(ribbons):
        breaks = ribbon.primary.compose_position(ribbon.c).breaks
        crossings += [(t, side) for t in breaks[~np.isin(breaks, ribbon.c.breaks)].tolist()]
    clusters: list[dict[int, float]] = []
    last = -np.inf
    for t, side in sorted(crossings):
        if t - last > slack:
            clusters.append({})
        clusters[-1].setdefault(side, t)
        last = t
    return clusters


def _extend_closed_breaks(breaks: Array) -> Array:
    """Continue the breaks of a closed rail past both ends, by ``RailTolerances.overlap_stations`` stations."""
    period, count, overlap = breaks[-1] - breaks[0], len(breaks) - 1, RAIL_TOLERANCES.overlap_stations
    laps = -(-overlap // count)
    tiled = (breaks[:-1] + period * np.arange(-laps, laps + 1)[:, None]).ravel()
    start = laps * count
    return np.concatenate([tiled[start - overlap : start], breaks, tiled[start + count + 1 : start + count + overlap]])
