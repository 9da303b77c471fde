"""Steering: turns a cross direction where its rail crosses a knot line, so that the blend has no crease inside.

The derivative of order k across the rail contains the surface's derivatives of order k. Where those of order k + 1 jump
across a knot line u = u0, by D, its derivative along the rail jumps by r^k u' D, and the blend has a crease along the
whole section through the crossing. The crease vanishes if r = 0 there: if the direction is parallel to the knot line.
Where the surface is one order less smooth still, the second direction must be parallel as well. All this is about the
shape of the surface: where only its parametrisation has a kink, the directions get a kink that cancels it
(:mod:`cqblend.blends.rails.parametric_kinks`).

Directions are turned within the tangent plane, by an angle that is what it must be at the crossings and falls to zero
between them, so the blend meets its surface exactly as before.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import KnotCrossing
from cqblend.surfaces.vectors import cross_product, measure_lengths, normalise_vectors


@dataclass(frozen=True)
class SteeringPin:
    """A crossing at ``t`` of the knot line ``axis`` = ``value``.

    The first direction is turned by ``angle`` (rad) there; ``second_order`` says that the second direction is to be
    parallel to the line, too.
    """

    t: float
    axis: int
    value: float
    angle: float
    second_order: bool


@dataclass(frozen=True)
class Steering:
    """The pins of one rail over ``domain``, in order; on a closed rail they repeat.

    At ``fixed_ends``, the start and the end of the domain, the directions are given and must not be turned.
    """

    pins: tuple[SteeringPin, ...]
    domain: tuple[float, float]
    closed: bool
    fixed_ends: tuple[bool, bool] = (False, False)

    def evaluate_angle(self, t: Array) -> Array:
        """Return the angles (n,) to turn by: those of the pins at their t, C2 in between, zero far from all pins."""
        if not self.pins:
            return np.zeros_like(t)
        period = self.domain[1] - self.domain[0]
        if self.closed:
            t = self.domain[0] + np.mod(t - self.domain[0], period)
        laps = (-1, 0, 1) if self.closed else (0,)
        nodes = np.array([pin.t + lap * period for lap in laps for pin in self.pins])
        angles = np.array([pin.angle for _ in laps for pin in self.pins])
        total = np.zeros_like(t)
        gaps = np.diff(nodes)
        to_start, to_end = nodes[0] - self.domain[0], self.domain[1] - nodes[-1]
        first, last = (
            room if fixed else np.inf for room, fixed in zip((to_start, to_end), self.fixed_ends, strict=True)
        )
        before = np.minimum(np.append(first, gaps), RAIL_TOLERANCES.fade_length_share * period)
        after = np.minimum(np.append(gaps, last), RAIL_TOLERANCES.fade_length_share * period)
        for node, angle, left, right in zip(nodes, angles, before, after, strict=True):
            total += angle * _evaluate_fade(np.where(t < node, (node - t) / left, (t - node) / right))
        return total

    def evaluate_slack(self, t: Array) -> Array:
        """Return by how much (n,), in rad, a fit may miss the turn near pins: only its value at the pins matters."""
        if not self.pins:
            return np.zeros_like(t)
        largest = max((abs(pin.angle) for pin in self.pins), default=0.0)
        reach = 2 * RAIL_TOLERANCES.fade_length_share * (self.domain[1] - self.domain[0])
        near = [np.abs(self._measure_offset(t, pin)) < reach for pin in self.pins]
        return np.where(np.any(near, axis=0), RAIL_TOLERANCES.fade_fit_share * largest, np.zeros_like(t))

    def turn_vectors(self, vectors: Array, normals: Array, t: Array) -> Array:
        """Turn tangent vectors (n, 3) about the normals."""
        angle = self.evaluate_angle(t)[:, None]
        return np.cos(angle) * vectors + np.sin(angle) * cross_product(normals, vectors)

    def zero_at_pins(self, rs: Array, t: Array, *, second_order: bool = False) -> Array:
        """Set to zero, at pins, the component of directions that is across the knot line.

        Directions (n, 2) are (r, s), their components along Su and Sv.

        With ``second_order``, at those pins only at which the second direction is to be parallel to the line, too.
        """
        aligned = rs.copy()
        for pin in self.pins:
            if second_order and not pin.second_order:
                continue
            aligned[self._measure_offset(t, pin) == 0, pin.axis] = 0.0
        return aligned

    def align_second_directions(self, rs: Array, t: Array) -> Array:
        """Make second directions (n, 2) parallel to the knot lines at pins of second order.

        The correction is full at the pin and falls to zero over the reach of the pin; t has to contain every pin.
        """
        aligned = rs.copy()
        for pin in self.pins:
            if pin.second_order:
                offset = self._measure_offset(t, pin)
                at = np.flatnonzero(offset == 0)
                aligned[:, pin.axis] -= rs[at[0], pin.axis] * _evaluate_fade(np.abs(offset) / self._find_reach(pin))
                aligned[at, pin.axis] = 0.0
        return aligned

    def _measure_offset(self, t: Array, pin: SteeringPin) -> Array:
        """Return t relative to a pin, with its sign; zero where it is the pin to rounding."""
        offset = t - pin.t
        period = self.domain[1] - self.domain[0]
        if self.closed:
            offset -= period * np.round(offset / period)
        return np.where(np.abs(offset) < 1e-13 * period, 0.0, offset)

    def _find_reach(self, pin: SteeringPin) -> float:
        """Return the distance within which a pin may have influence: it ends at the next one of the same axis."""
        others = [abs(float(self._measure_offset(np.array(other.t), pin))) for other in self.pins if other is not pin]
        ends = [abs(pin.t - end) for end, fixed in zip(self.domain, self.fixed_ends, strict=True) if fixed]
        return min([*others, *ends, RAIL_TOLERANCES.fade_length_share * (self.domain[1] - self.domain[0])])


def _evaluate_fade(x: Array) -> Array:
    """Return the polynomial that falls from 1 to 0 over [0, 1] with two vanishing derivatives at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return 1 - x**3 * (10 - 15 * x + 6 * x**2)


class RequiredTurn(NamedTuple):
    """The crossing of a knot line at which the direction of a ribbon would have to be parallel to the line.

    A turn by ``angle`` (rad, signed, at most a quarter turn) makes it so; ``angle_to_rail`` (rad) is the angle between
    the line and the rail.
    """

    crossing: KnotCrossing
    angle: float
    angle_to_rail: float


def find_required_turns(ribbon: Ribbon, order: int) -> list[RequiredTurn]:
    """Return where and how far the first direction of a ribbon would have to turn for jets smooth up to an order."""
    crossings = [
        crossing
        for crossing in ribbon.primary.find_knot_crossings(ribbon.c, order)
        if crossing.shape_continuity <= order
    ]
    if not crossings:
        return []
    t = np.array([crossing.t for crossing in crossings])
    axis = np.array([crossing.axis for crossing in crossings])
    uv = ribbon.find_native_parameters(t)
    uv[np.arange(len(t)), axis] = [crossing.value for crossing in crossings]
    jet = ribbon.primary.jet(uv)
    rail, field = ribbon.jets[:2]
    normal = normalise_vectors(cross_product(jet[1], jet[2]))
    line = np.where((axis == 0)[:, None], jet[2], jet[1])

    def measure_angle(vectors: Array) -> Array:
        sine, cosine = (cross_product(vectors, line) * normal).sum(1), (vectors * line).sum(1)
        return np.asarray(np.arctan2(np.where(cosine < 0, -sine, sine), np.abs(cosine)))

    angle = measure_angle(dehomogenise_jets(np.stack([rail(t), field(t)]))[1])
    angle_to_rail = np.abs(measure_angle(dehomogenise_jets(rail.jet(t, 1))[1]))
    return [RequiredTurn(*turn) for turn in zip(crossings, angle.tolist(), angle_to_rail.tolist(), strict=True)]


def find_pins(ribbon: Ribbon, largest_turn: float) -> list[SteeringPin]:
    """Return the pins that an unsteered ribbon needs, along the rail, with turns of at most ``largest_turn`` (rad).

    Crossings that need a larger turn are left out: there a crease remains, which is measured later. Of crossings that
    nearly coincide, the one with the least turn gets the pin.
    """
    order, ends = ribbon.order, ribbon.c.domain
    needed = find_required_turns(ribbon, order) if order else []
    if order == 3 and needed:
        rough = min((turn.crossing for turn in needed), key=lambda crossing: crossing.shape_continuity)
        if rough.shape_continuity < 3:
            raise GeometryError(
                f"G3 needs surfaces that are C3, but the rail crosses the knot line {'uv'[rough.axis]} = "
                f"{rough.value:.6g}, where one is only C{rough.shape_continuity}, at t = {rough.t:.6g}; use G2"
            )
    least_gap = RAIL_TOLERANCES.sliver_share * (ends[1] - ends[0])
    pins: list[SteeringPin] = []
    for crossing, angle, _ in sorted(needed, key=lambda turn: abs(turn.angle)):
        is_apart = all(abs(crossing.t - pin.t) > least_gap for pin in pins)
        if abs(angle) <= largest_turn and is_apart:
            second_order = crossing.shape_continuity < order
            pins.append(SteeringPin(crossing.t, crossing.axis, crossing.value, angle, second_order))
    return sorted(pins, key=lambda pin: pin.t)


def drop_hasty_pins(ribbon: Ribbon, pins: list[SteeringPin], fixed_ends: tuple[bool, bool]) -> list[SteeringPin]:
    """Return the pins of an unsteered ribbon that leave room to turn back before ends at which directions are given.

    Directions that turn too fast make a blend fold. Where a pin is left out, a crease remains, which is measured later.
    """
    ends = np.array([end for end, fixed in zip(ribbon.c.domain, fixed_ends, strict=True) if fixed])
    if not pins or not len(ends):
        return pins
    t = np.array([pin.t for pin in pins])
    rail, to_end = ribbon.jets[0].jet(t, 1), np.abs(t[:, None] - ends).min(axis=1)
    rate, vector = dehomogenise_jets(rail)[1], dehomogenise_jets(np.stack([rail[0], ribbon.jets[1](t)]))[1]
    swing = measure_lengths(vector) * np.abs([pin.angle for pin in pins])
    is_slow = swing <= RAIL_TOLERANCES.fastest_turn * measure_lengths(rate) * to_end
    is_slow |= to_end >= RAIL_TOLERANCES.fade_length_share * np.ptp(ribbon.c.domain)  # as long as turns ever take
    return [pin for pin, is_kept in zip(pins, is_slow, strict=True) if is_kept]
