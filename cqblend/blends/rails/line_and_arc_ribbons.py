"""Makes ribbons in the lightest forms, straight and circular, where these are the contacts to rounding.

A straight rail is one span of degree 1; a circular one consists of rational arcs of degree 2 about a common axis, at
most a quarter of a circle each (a third on open edges). Other rails are C2 cubics
(:mod:`cqblend.blends.rails.cubic_ribbons`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cqblend.blends.contacts.contact_solver import ContactSolver
from cqblend.blends.rails.cornered_spline import CurveMaker, KinkData
from cqblend.blends.rails.cross_directions import chord_field
from cqblend.blends.rails.direction_steering import Steering, find_pins
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.ribbon_fit import ContactSamples, Domain, RibbonCurves, RibbonTargets, fit_ribbon
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.splines import Curve, bernstein
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary


@dataclass(frozen=True)
class ArcLayout:
    """How circular rails are divided into arcs.

    The edge is an arc of angle ``turn`` (rad) over t in [0, 1]; the rails are made over ``domain``, in pieces that turn
    by ``largest_arc`` (rad) at most.
    """

    domain: Domain
    turn: float
    largest_arc: float = RAIL_TOLERANCES.largest_closed_arc

    @property
    def count(self) -> int:
        """The number of arcs."""
        return max(1, int(np.ceil(self.turn * (self.domain[1] - self.domain[0]) / self.largest_arc - 1e-9)))

    @property
    def breaks(self) -> Array:
        """The ends of the arcs."""
        return np.linspace(*self.domain, self.count + 1)

    def map_parameters(self, t: Array) -> tuple[Array, Array]:
        """Return the edge's parameters at parameters t (n,) of the rails, and the weights of the rails there."""
        domain, count = self.domain, self.count
        step = self.turn * (domain[1] - domain[0]) / count
        x = (t - domain[0]) / (domain[1] - domain[0]) * count
        piece = np.clip(x.astype(int), 0, count - 1)
        a, b = 1 + (x - piece) * (np.cos(step / 2) - 1), (x - piece) * np.sin(step / 2)
        return domain[0] + (step * piece + 2 * np.arctan2(b, a)) / self.turn, a**2 + b**2


def fit_straight_ribbons(
    primaries: tuple[Primary, Primary], solve: ContactSolver, domain: Domain, wanted: RibbonTargets, size: float
) -> tuple[Ribbon, Ribbon] | None:
    """Return the ribbons as one span of degree 1, or None if that is not what they are.

    ``size`` (mm) is the extent of the edge, which rounding is relative to.
    """
    t = np.linspace(*domain, 7)

    def make_segment(values: Array, _: KinkData | None) -> Curve:
        return Curve(np.array(domain), values[[0, -1], :, None])

    return _fit_exact_pair(ContactSamples(primaries, t, solve(t), np.ones(7)), make_segment, wanted, size)


def fit_circular_ribbons(
    primaries: tuple[Primary, Primary], solve: ContactSolver, layout: ArcLayout, wanted: RibbonTargets, size: float
) -> tuple[Ribbon, Ribbon] | None:
    """Return the ribbons as rational arcs of degree 2, or None if the joint is not one of revolution.

    On each arc the half-angle pair about the axis is linear in the parameter, so that all points rotated about the axis
    are quadratic. ``size`` (mm) is the extent of the edge, which rounding is relative to.
    """
    count, breaks = layout.count, layout.breaks
    t = np.interp(np.arange(4 * count + 1) / 4, np.arange(count + 1), breaks)
    edge_t, weight = layout.map_parameters(t)

    def make_arcs(values: Array, _: KinkData | None) -> Curve:
        return Curve(breaks, _interpolate_pieces(values, 2), continuity=np.zeros(count - 1, int))

    return _fit_exact_pair(ContactSamples(primaries, t, solve(edge_t), weight), make_arcs, wanted, size)


def _interpolate_pieces(values: Array, degree: int) -> Array:
    """Return the Bernstein coefficients (degree + 1, k, m) of polynomials through values (4 m + 1, k), at quarters."""
    nodes = np.arange(0, 5, 4 // degree)
    points = np.stack([values[k : len(values) - 4 + k : 4] for k in nodes.tolist()])  # (degree + 1, m, k)
    basis = bernstein.evaluate_basis(degree, 1 - nodes / 4, nodes / 4).T
    return np.asarray(np.einsum("pq,qmk->pkm", np.linalg.inv(basis), points))


def fit_turning_ribbons(
    primaries: tuple[Primary, Primary], solve: ContactSolver, layout: ArcLayout, wanted: RibbonTargets, size: float
) -> tuple[Ribbon, Ribbon] | None:
    """Return ribbons of a ball that turns in place: one rail is a point, the other an arc about an axis of its own.

    Their directions are those of the ball's arcs, which leave the circle obliquely. None if the rails are no such
    curves to rounding; ``size`` (mm) is the extent of the edge, which that is relative to.
    """
    count, breaks = layout.count, layout.breaks
    t = np.interp(np.arange(4 * count + 1) / 4, np.arange(count + 1), breaks)
    edge_t, weight = layout.map_parameters(t)
    samples = ContactSamples(primaries, t, solve(edge_t), weight)
    smoothness = np.zeros(count - 1, int)

    def make_arcs(values: Array, _: KinkData | None) -> Curve:
        return Curve(breaks, _interpolate_pieces(values, 2), continuity=smoothness)

    def make_directions(values: Array, _: KinkData | None) -> Curve:
        return Curve(breaks, _interpolate_pieces(values, 4), continuity=smoothness)

    towards = replace(wanted, fields=(chord_field, chord_field))
    ribbons = []
    for side in (0, 1):
        curves = RibbonCurves(make_arcs, (make_directions,) * max(wanted.orders[side], 1))
        ribbon, errors = fit_ribbon(samples, side, curves, towards, Steering((), (t[0], t[-1]), False))
        if errors.position.max() > RAIL_TOLERANCES.projection_residual * size:
            return None
        ribbons.append(replace(ribbon, light=True, direction=0.0, length=0.0))
    return ribbons[0], ribbons[1]


def _fit_exact_pair(
    samples: ContactSamples, make_curve: CurveMaker, wanted: RibbonTargets, size: float
) -> tuple[Ribbon, Ribbon] | None:
    """Return both ribbons if the curves reproduce contacts and directions to rounding, unsteered, else None."""
    ribbons = []
    no_steering = Steering((), (samples.t[0], samples.t[-1]), False)
    for side, primary in enumerate(samples.primaries):
        curves = RibbonCurves(make_curve, (make_curve,) * max(wanted.orders[side], 1))
        ribbon, errors = fit_ribbon(samples, side, curves, wanted, no_steering)
        if errors.position.max() > RAIL_TOLERANCES.projection_residual * size:
            return None
        if ribbon.direction > RAIL_TOLERANCES.exact_deviation or ribbon.length > RAIL_TOLERANCES.exact_deviation:
            return None
        order = wanted.orders[side]
        crossings = primary.find_knot_crossings(ribbon.c, order)
        if find_pins(ribbon, wanted.steer) or any(crossing.is_parametric_kink(order) for crossing in crossings):
            return None
        ribbons.append(replace(ribbon, light=True))
    return ribbons[0], ribbons[1]
