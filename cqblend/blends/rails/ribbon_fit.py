"""Fits one ribbon, rail and directions, to the contacts of a blend, and measures what the fit misses.

Rail and directions are fitted in lifted parameters (see :mod:`cqblend.surfaces`), the only place where a blend
approximates: the boundary S(c(t)) and the tangent planes there are exact whatever the fit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.blends.rails.cornered_spline import CurveMaker, KinkData
from cqblend.blends.rails.cross_directions import (
    CrossField,
    RailStations,
    compute_unit_directions,
    measure_arc_lengths,
    perpendicular_field,
)
from cqblend.blends.rails.direction_fit import DirectionMethod, fit_directions
from cqblend.blends.rails.direction_steering import Steering
from cqblend.blends.rails.parametric_kinks import ParametricKinks
from cqblend.blends.rails.ribbon import Ribbon, SampledRail, dehomogenise_jets
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import cross_product, measure_lengths

Domain = tuple[float, float]
LengthFactor = Callable[[Array], Array]


@dataclass(frozen=True)
class RibbonTargets:
    """What the two ribbons of a blend are to be, and how far they may be from that.

    Attributes
    ----------
    position, direction, length
        Tolerances: in space (mm), and of the first cross derivative, its angle (rad) and its length (relative).
    fields
        The cross directions, by side.
    bulges
        Factors on the lengths that the contacts suggest, by side, as functions of t.
    orders
        Orders of continuity, by side.
    steer
        Largest angle (rad) by which directions are turned so that the blend has no crease inside.
    arcs
        Whether the lengths are those of the circular arcs that leave in the wanted directions to the other contact,
        instead of those that the contacts suggest.
    fades
        Whether the cross derivatives may vanish somewhere.
    given_derivatives
        Whether the cross derivatives are those that the contacts have, instead of fields, bulges and lengths. They
        belong to points of the rails, so rails may not shift along themselves then.
    """

    position: float = 1e-7
    direction: float = RAIL_TOLERANCES.direction
    length: float = RAIL_TOLERANCES.length
    fields: tuple[CrossField, CrossField] = (perpendicular_field, perpendicular_field)
    bulges: tuple[LengthFactor, LengthFactor] = (np.ones_like, np.ones_like)
    orders: tuple[int, int] = (1, 1)
    steer: float = 0.0
    arcs: bool = False
    fades: bool = False
    given_derivatives: bool = False


@dataclass(frozen=True)
class ContactSamples:
    """Contacts to which both ribbons of a blend are fitted.

    ``t`` (n,) are the parameters of the rails at the contacts, and ``weight`` (n,) the homogeneous weights that the
    lifted points are scaled to there.
    """

    primaries: tuple[Primary, Primary]
    t: Array
    contacts: Contacts
    weight: Array

    def compute_cross_derivatives(self, side: int, rate: Array, wanted: RibbonTargets) -> Array:
        """Return the wanted cross derivatives (n, 3) of a side, whose rail has the derivative ``rate`` (n, 3)."""
        if wanted.given_derivatives:
            return self.contacts.get_cross_vectors(side)
        jet, lengths = self.jets[side], self.contacts.cross_lengths[side]
        towards_blend, chord = self.contacts.edge_points - jet[0], self.jets[1 - side][0] - jet[0]
        vectors, bulges = np.zeros_like(rate), wanted.bulges[side](self.t)
        held = lengths > (RAIL_TOLERANCES.vanishing_share * lengths.max() if wanted.fades else -1.0)
        stations = RailStations(self.t[held], jet[:, held], rate[held], towards_blend[held], chord[held])
        unit = compute_unit_directions(wanted.fields[side], stations)
        lengths = measure_arc_lengths(unit, stations.chord) if wanted.arcs else lengths[held]
        vectors[held] = unit * (bulges[held] * lengths)[:, None]
        return vectors

    @cached_property
    def jets(self) -> tuple[Array, Array]:
        """The native jets of both surfaces at the contacts, (6, n, 3) each."""
        first, second = (primary.jet(uv) for primary, uv in zip(self.primaries, self.contacts.uv, strict=True))
        return first, second


@dataclass(frozen=True)
class RibbonCurves:
    """How the curves of one ribbon are made of lifted values at the samples.

    ``make_rail`` and ``make_directions``, one for each direction, return curves through values, but need not use all of
    them. The nodes, every third sample, at which the surface's parametrisation has a kink are ``rail_kink_nodes`` where
    the rail takes it, and ``direction_kink_nodes`` where the directions do.
    """

    make_rail: CurveMaker
    make_directions: tuple[CurveMaker, ...]
    rail_kink_nodes: Array = field(default_factory=lambda: np.empty(0, dtype=int))
    direction_kink_nodes: Array = field(default_factory=lambda: np.empty(0, dtype=int))


@dataclass(frozen=True)
class RibbonErrors:
    """How far a fitted ribbon is from what was wanted, at every sample (n,).

    ``position`` is the distance in space (mm), ``across`` its part across the rail (what is along it only shifts the
    common parameter; all of it, if derivatives are given), ``direction`` (rad) and ``length`` (relative) are those of
    the first cross derivative, less what steering allows.
    """

    position: Array
    across: Array
    direction: Array
    length: Array


def fit_ribbon(
    samples: ContactSamples, side: int, curves: RibbonCurves, wanted: RibbonTargets, steering: Steering
) -> tuple[Ribbon, RibbonErrors]:
    """Fit the ribbon of one side to contacts; also return its errors there.

    The samples may reach past the domain of the steering, to which the ribbon is cut, and errors are confined.
    """
    primary, uv, t = samples.primaries[side], samples.contacts.uv[side], samples.t
    c, kinks = _fit_rail(samples, side, curves)
    rail = SampledRail(primary, c, uv, t)
    if kinks is None:
        point, rate = rail.own_jet[0], rail.evaluate_tangents(rail.lifted_jet[1])
    else:
        point, rate = dehomogenise_jets(primary.compose_position(c).jet(t, 1))
    vectors = samples.compute_cross_derivatives(side, rate, wanted)
    method = DirectionMethod(wanted.orders[side], curves.make_directions, steering, kinks)
    fitted = fit_directions(rail, vectors, method)
    domain, directions = steering.domain, fitted.curves
    inside = (t >= domain[0]) & (t <= domain[1])
    if not inside.all():
        c, directions = c.clip(*domain), tuple(d.clip(*domain) for d in directions)
    break_uv = np.stack([np.interp(c.breaks, t, column) for column in uv.T], -1)
    offset, slack = (point - samples.jets[side][0])[inside], steering.evaluate_slack(t)
    errors = RibbonErrors(
        measure_lengths(offset),
        measure_lengths(offset) if wanted.given_derivatives else _measure_across(offset, rate[inside]),
        (fitted.angle_errors - slack)[inside],
        (fitted.length_errors - slack)[inside],
    )
    direction = (fitted.angle_errors + np.abs(steering.evaluate_angle(t)))[inside].max()
    length = fitted.length_errors[inside].max()
    ribbon = Ribbon(
        primary,
        c,
        directions,
        break_uv,
        wanted.orders[side],
        direction=float(direction),
        length=float(length),
        fades=wanted.fades,
    )
    return ribbon, errors


def _measure_across(offset: Array, rate: Array) -> Array:
    """Return the parts (n,) of offsets (n, 3) from a rail that are across it; none where it stays at one point."""
    speed = measure_lengths(rate)
    return measure_lengths(cross_product(offset, rate)) / np.where(speed > 0, speed, 1.0)


def _fit_rail(samples: ContactSamples, side: int, curves: RibbonCurves) -> tuple[Curve, ParametricKinks | None]:
    """Return the rail of one side as a curve of lifted parameters, and the parametric kinks of its directions."""
    primary, uv = samples.primaries[side], samples.contacts.uv[side]
    values = primary.scale_weight(primary.lift_points(uv), samples.weight)
    own, turning = curves.rail_kink_nodes, curves.direction_kink_nodes

    def find_kinks(c: Curve, nodes: Array) -> ParametricKinks:
        return ParametricKinks.from_rail(SampledRail(primary, c, uv, samples.t), np.stack([nodes, nodes]))

    kinks = None
    if len(own):
        before = values[3 * own]
        plain = curves.make_rail(values, KinkData(own, own, before, np.zeros((2, *before.shape))))
        kinks = find_kinks(plain, own)
        c = kinks.fit_curve(values, before, curves.make_rail, lambda c: (c, primary.compose_jets(c, ())))
    else:
        c = curves.make_rail(values, None)
    if len(turning) > len(own):
        kinks = find_kinks(c, turning)
    return c, kinks
