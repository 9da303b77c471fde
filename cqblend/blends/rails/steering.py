"""Steering: turning a cross direction so that a blend has no crease inside where its rail crosses a knot line.

A ribbon's jet of order k contains the surface's derivatives of order k. Where those of order k + 1 jump across a knot
line u = u0, by D, the jet's derivative along the rail jumps by r^k u' D, and the blend has a crease along the whole
section through the crossing. It vanishes if r = 0 there: if the direction is parallel to the knot line. Where the
surface is one order less smooth still, the second direction must be parallel as well. All of that is about the shape of
the surface: where only its parameters have a kink, directions get the kink that makes up for it
(:mod:`cqblend.blends.rails.knot_line_bends`).

Directions are turned within the tangent plane, by an angle that is what it must be at the crossings and fades between
them: nothing changes about how the blend meets its surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary import KnotCrossing
from cqblend.surfaces.vectors import cross_product, normalise_vectors

SLIVER_SHARE = 2e-5  # of the rail: breaks nearer to each other than that are one
FADE_FIT_SHARE = 0.02  # share of a turn by which the fit of its fading may err
FADE_LENGTH_SHARE = 0.1  # of the rail: over such a length a turn fades, unless the next crossing is nearer


@dataclass(frozen=True)
class SteeringPin:
    """A crossing at ``t`` of the knot line ``axis`` = ``value``, where ``evaluate_angle`` (rad) turns a direction.

    ``second_order`` says that the second direction is to be parallel to the line, too.
    """

    t: float
    axis: int
    value: float
    angle: float
    second_order: bool


@dataclass(frozen=True)
class Steering:
    """The pins of one rail over ``domain``, in order; on a closed rail they repeat."""

    pins: tuple[SteeringPin, ...]
    domain: tuple[float, float]
    closed: bool

    def evaluate_angle(self, t: Array) -> Array:
        """Return the angle (n,) to turn by: that of the pins at their t, C2 in between, zero far from all."""
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
        before = np.minimum(np.append(np.inf, gaps), FADE_LENGTH_SHARE * period)
        after = np.minimum(np.append(gaps, np.inf), FADE_LENGTH_SHARE * period)
        for node, angle, left, right in zip(nodes, angles, before, after, strict=True):
            total += angle * _evaluate_fade(np.where(t < node, (node - t) / left, (t - node) / right))
        return total

    def evaluate_slack(self, t: Array) -> Array:
        """Return how far from the turn a fit may be (rad): how it fades, and rings on, means nothing of its own."""
        largest = max((abs(pin.angle) for pin in self.pins), default=0.0)
        reach = 2 * FADE_LENGTH_SHARE * (self.domain[1] - self.domain[0])
        near = [np.abs(self._measure_offset(t, pin)) < reach for pin in self.pins]
        return np.where(np.any(near, axis=0), FADE_FIT_SHARE * largest, np.zeros_like(t))

    def turn_vectors(self, vectors: Array, normals: Array, t: Array) -> Array:
        """Turn tangent vectors (n, 3) about the normals."""
        angle = self.evaluate_angle(t)[:, None]
        return np.cos(angle) * vectors + np.sin(angle) * cross_product(normals, vectors)

    def zero_at_pins(self, rs: Array, t: Array, *, deep: bool = False) -> Array:
        """Make the component r or s of directions (n, 2) that vanishes at a pin, or a deep one, exactly zero there."""
        out = rs.copy()
        for pin in self.pins:
            if deep and not pin.second_order:
                continue
            out[self._measure_offset(t, pin) == 0, pin.axis] = 0.0
        return out

    def align_second_directions(self, rs: Array, t: Array) -> Array:
        """Let second directions (n, 2) be parallel to the knot lines at deep pins, by what fades beside them."""
        out = rs.copy()
        for pin in self.pins:
            if pin.second_order:
                apart = self._measure_offset(t, pin)
                at = np.flatnonzero(apart == 0)
                out[:, pin.axis] -= rs[at[0], pin.axis] * _evaluate_fade(np.abs(apart) / self._find_reach(pin))
                out[at, pin.axis] = 0.0
        return out

    def _measure_offset(self, t: Array, pin: SteeringPin) -> Array:
        """Return how far t is from a pin; zero where it is the pin to rounding."""
        apart = t - pin.t
        period = self.domain[1] - self.domain[0]
        if self.closed:
            apart -= period * np.round(apart / period)
        return np.where(np.abs(apart) < 1e-13 * period, 0.0, apart)

    def _find_reach(self, pin: SteeringPin) -> float:
        """Return the distance within which a pin may have influence: it ends at the next one of the same axis."""
        others = [abs(float(self._measure_offset(np.array(one.t), pin))) for one in self.pins if one is not pin]
        return min([*others, FADE_LENGTH_SHARE * (self.domain[1] - self.domain[0])])


def _evaluate_fade(x: Array) -> Array:
    """Return the polynomial that falls from 1 to 0 over [0, 1] with two vanishing derivatives at both ends."""
    x = np.clip(x, 0.0, 1.0)
    return 1 - x**3 * (10 - 15 * x + 6 * x**2)


class RequiredTurn(NamedTuple):
    """A crossing of a knot line whose shape asks for a direction along it: how far the ribbon's is from that.

    ``evaluate_angle`` (rad, signed) turns the direction onto the line, in either sense; ``clear`` (rad) is how far the
    line is from the rail.
    """

    crossing: KnotCrossing
    angle: float
    clear: float


def find_required_turns(ribbon: Ribbon, order: int) -> list[RequiredTurn]:
    """Return where and how far the first direction of a ribbon would have to turn for its jets up to an order."""
    crossings = [one for one in ribbon.primary.find_knot_crossings(ribbon.c, order) if one.shape_continuity <= order]
    if not crossings:
        return []
    t = np.array([one.t for one in crossings])
    axis = np.array([one.axis for one in crossings])
    uv = ribbon.find_native_parameters(t)
    uv[np.arange(len(t)), axis] = [one.value for one in crossings]
    jet = ribbon.primary.jet(uv)
    rail, field = ribbon.compose_jets()[:2]
    normal = normalise_vectors(cross_product(jet[1], jet[2]))
    line = np.where((axis == 0)[:, None], jet[2], jet[1])

    def measure_angle(vectors: Array) -> Array:
        sine, cosine = (cross_product(vectors, line) * normal).sum(1), (vectors * line).sum(1)
        return np.asarray(np.arctan2(np.where(cosine < 0, -sine, sine), np.abs(cosine)))

    angle = measure_angle(dehomogenise_jets(np.stack([rail(t), field(t)]))[1])
    clear = np.abs(measure_angle(dehomogenise_jets(rail.jet(t, 1))[1]))
    return [RequiredTurn(*one) for one in zip(crossings, angle.tolist(), clear.tolist(), strict=True)]


def find_pins(ribbon: Ribbon, limit: float) -> list[SteeringPin]:
    """Return where an unsteered ribbon needs steering, by at most ``limit`` (rad), along the rail."""
    order, ends = ribbon.order, ribbon.c.domain
    needed = find_required_turns(ribbon, order) if order else []
    if order == 3 and needed:
        rough = min((one.crossing for one in needed), key=lambda one: one.shape_continuity)
        if rough.shape_continuity < 3:
            raise GeometryError(
                f"G3 needs surfaces that are C3, but the rail crosses the knot line {'uv'[rough.axis]} = "
                f"{rough.value:.6g}, where one is only C{rough.shape_continuity}, at t = {rough.t:.6g}; use G2"
            )
    close = SLIVER_SHARE * (ends[1] - ends[0])
    found: list[SteeringPin] = []
    for one, angle, _ in sorted(needed, key=lambda turn: abs(turn.angle)):
        clear = all(abs(one.t - other.t) > close for other in found)
        if abs(angle) <= limit and clear:
            found.append(SteeringPin(one.t, one.axis, one.value, angle, second_order=one.shape_continuity < order))
    return sorted(found, key=lambda pin: pin.t)
