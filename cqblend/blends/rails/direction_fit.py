"""Fits the directions of a ribbon, on a rail that is given, to wanted cross derivatives in space.

Directions are curves of lifted parameters, C2 and of low degree. They may be approximate, since with any directions the
blend is exactly smooth with its surface. What a fit misses is the wanted angle and length of the cross derivatives, and
it measures by how much.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cqblend.blends.rails.break_spacing import halve_spans
from cqblend.blends.rails.cornered_spline import CurveMaker, KinkData, add_third_points, interpolate_with_corners
from cqblend.blends.rails.direction_steering import Steering, find_pins
from cqblend.blends.rails.parametric_kinks import ParametricKinks
from cqblend.blends.rails.rail import Rail
from cqblend.blends.rails.ribbon import Ribbon, SampledRail, dehomogenise_jets
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import merge_breaks
from cqblend.splines.tolerances import SPLINE_TOLERANCES
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import cross_product, measure_lengths, normalise_vectors, to_tangent_coordinates


@dataclass(frozen=True)
class DirectionMethod:
    """How the directions of a ribbon are fitted.

    ``order`` is that of the continuity, and so the number of directions, but for one that there always is;
    ``make_curves`` make them, one each, of lifted values at the samples of the rail; ``steering`` turns the directions;
    ``kinks`` are the parametric kinks on the rail.
    """

    order: int
    make_curves: tuple[CurveMaker, ...]
    steering: Steering
    kinks: ParametricKinks | None = None


@dataclass(frozen=True)
class FittedDirections:
    """Fitted directions, and how far the first one is from the (steered) vectors at the samples: rad, and relative."""

    curves: tuple[Curve, ...]
    angle_errors: Array
    length_errors: Array


def fit_directions(rail: SampledRail, vectors: Array, method: DirectionMethod) -> FittedDirections:
    """Fit directions to wanted cross derivatives, tangent vectors (n, 3) at the samples of a rail.

    The second direction is such that the second derivative of the ribbon is normal to the surface, the third one such
    that the speed of its sections is constant: those of curves that run as straight as they can, at constant speed.
    """
    steering, kinks, c, jet = method.steering, method.kinks, rail.c, rail.jet
    if steering.pins:
        vectors = steering.turn_vectors(vectors, normalise_vectors(cross_product(jet[1], jet[2])), rail.t)
    rs = steering.zero_at_pins(to_tangent_coordinates(jet, vectors), rail.t)
    values = rail.primary.lift_directions(rail.uv, rail.lifted, rs)
    if kinks is None:
        first = method.make_curves[0](values, None)
        fitted = rail.evaluate_tangents(first(rail.t))
    else:
        rs = steering.zero_at_pins(kinks.to_coordinates(vectors[kinks.sample_indices[1]]), kinks.t[0])
        before = rail.primary.lift_directions(kinks.uv[0], c(kinks.t[0], side="left"), rs)
        first = kinks.fit_curve(values, before, method.make_curves[0], lambda d: (c, rail.primary.compose_jets(c, [d])))
        fitted = _evaluate_first_jet(rail.primary.compose_jets(c, [first]), rail.t)
    angles, lengths = _measure_deviations(fitted, vectors)
    return FittedDirections(add_higher_directions(rail, first, method), angles, lengths)


def _evaluate_first_jet(jets: Sequence[Curve], t: Array) -> Array:
    """Return the first derivative of a ribbon in space, (n, 3), of its homogeneous jets."""
    return dehomogenise_jets(np.stack([curve(t) for curve in jets[:2]]))[1]


def _measure_deviations(fitted: Array, vectors: Array) -> tuple[Array, Array]:
    """Return how far the first derivatives (n, 3) of a ribbon are from wanted vectors (n, 3): rad, and relative.

    Vectors that vanish have no direction, and differences of length are then measured relative to a short one.
    """
    length = measure_lengths(vectors)
    least = RAIL_TOLERANCES.compared_vector_share * length.max()
    angle = np.arctan2(measure_lengths(cross_product(fitted, vectors)), (fitted * vectors).sum(1))
    ratio = (measure_lengths(fitted) - length) / np.maximum(length, least)
    return np.where(length > least, angle, 0.0), np.abs(ratio)


def add_higher_directions(rail: SampledRail, first: Curve, method: DirectionMethod) -> tuple[Curve, ...]:
    """Return the first direction with second and third ones, up to an order: see :func:`fit_directions`."""
    primary, c, steering, kinks = rail.primary, rail.c, method.steering, method.kinks
    directions, lifted = [first], rail.lifted

    def lift_without_weight(uv: Array, lifted: Array, rs: Array, jets: Array) -> Array:
        """Return lifted directions (r, s), with that multiple of the lifted point for which their jet has no weight.

        A multiple of the lifted point leaves the point on the surface unchanged.
        """
        factor = -jets[-1, :, 3:] / jets[0, :, 3:]
        return np.asarray(primary.lift_directions(uv, lifted, rs) + factor * lifted * primary.weight_exponents)

    for k in range(2, method.order + 1):
        known, make_curve = primary.compose_jets(c, directions, k), method.make_curves[k - 1]
        jets = np.stack([curve(rail.t) for curve in known])
        space = dehomogenise_jets(jets)
        target = np.zeros_like(space[1])
        if k == 3:
            squared = (space[1] ** 2).sum(1)  # 0 where the blend ends in a point
            share = np.divide((space[2] ** 2).sum(1), squared, out=np.zeros_like(squared), where=squared > 0)
            target -= space[1] * share[:, None]
        plain = to_tangent_coordinates(rail.jet, target - space[k])
        rs = steering.align_second_directions(plain, rail.t)
        values = lift_without_weight(rail.uv, lifted, rs, jets)
        if kinks is None:
            directions.append(make_curve(values, None))
            continue
        limits, (before, after) = kinks.evaluate_left_limits(known), kinks.sample_indices
        rs = kinks.to_coordinates(target[after] - dehomogenise_jets(limits)[k]) + (rs - plain)[before]
        rs = steering.zero_at_pins(rs, kinks.t[0], second_order=True)
        values_before = lift_without_weight(kinks.uv[0], c(kinks.t[0], side="left"), rs, limits)

        def compose(d: Curve, lower: tuple[Curve, ...] = tuple(directions)) -> tuple[Curve, tuple[Curve, ...]]:
            return c, primary.compose_jets(c, [*lower, d])

        directions.append(kinks.fit_curve(values, values_before, make_curve, compose))
    return tuple(directions)


@dataclass(frozen=True)
class DirectionFit:
    """The task of fitting a ribbon on a rail that is given.

    Attributes
    ----------
    rail
        The rail, which is kept as it is: the blend will start on the whole of S(c(t)).
    target_vectors
        The wanted cross derivatives: tangent vectors (n, 3) at t (n,).
    order
        The order of continuity between blend and surface.
    closed
        Whether rail and vectors return to where they start.
    exact_direction
        The wanted direction (r, s) as a curve, if it is one of low degree: it is taken as it is, unless it must be
        turned.
    """

    rail: Rail
    target_vectors: Callable[[Array], Array]
    order: int
    closed: bool
    exact_direction: Curve | None

    @cached_property
    def primary(self) -> TensorSurface:
        """The surface."""
        surface = self.rail.surface
        return TensorSurface.from_spline(surface, level=surface.rational or self.rail.curve.rational)

    @cached_property
    def lifted_rail(self) -> Curve:
        """The rail, lifted: barycentric pairs (w - U, U, w - V, V) of the plane curve (U, V) / w."""
        curve = self.rail.curve
        u, v = curve.coefs[:, 0], curve.coefs[:, 1]
        w = curve.coefs[:, 2] if curve.rational else np.ones_like(u)
        return Curve(curve.breaks, np.stack([w - u, u, w - v, v], axis=1), continuity=curve.continuity)

    @cached_property
    def corners(self) -> Array:
        """The parameters at which the wanted directions are no more than C1."""
        if self.exact_direction is not None and self.order < 2:
            return merge_breaks(self.lifted_rail.breaks, self.kink_parameters)
        return merge_breaks(
            self.lifted_rail.breaks, self.primary.locate_knot_crossings(self.lifted_rail, max(2, self.order))
        )

    @cached_property
    def kink_parameters(self) -> Array:
        """The parameters t at which the surface's parametrisation has a kink that its shape has not."""
        crossings = self.primary.find_knot_crossings(self.lifted_rail, self.order) if self.order else []
        return np.array([crossing.t for crossing in crossings if crossing.is_parametric_kink(self.order)])

    @cached_property
    def has_seam_kink(self) -> bool:
        """Whether a closed rail closes on a seam of the surface, at which native parameters or derivatives jump."""
        uv = self.rail.curve(np.array(self.rail.domain))
        if not (self.closed and self.order) or np.abs(uv[1] - uv[0]).max() <= SPLINE_TOLERANCES.same_break * np.ptp(
            self.rail.surface.domain
        ):
            return False
        jet = self.rail.surface.jet(uv[:, 0], uv[:, 1], self.order + 1)
        return bool(
            np.any(np.abs(jet[:, :, 1] - jet[:, :, 0]).max(axis=-1) > SPLINE_TOLERANCES.same_break * np.abs(jet).max())
        )

    @property
    def has_kinks(self) -> bool:
        """Whether the surface's parametrisation has a kink anywhere on the rail, or where it closes."""
        return self.has_seam_kink or len(self.kink_parameters) > 0

    def fit_ribbon(self, nodes: Array, steering: Steering) -> tuple[Ribbon, Array]:
        """Fit the directions at nodes; also return their errors as shares of what is allowed, (n, 2).

        They are those at a third and at two thirds of every span.
        """
        t = add_third_points(nodes)
        kinks = merge_breaks(self.corners, np.array([pin.t for pin in steering.pins]))
        apart = np.abs(nodes[:, None] - kinks).min(axis=1)
        corners = np.flatnonzero(apart <= SPLINE_TOLERANCES.near_breaks * (nodes[-1] - nodes[0]))
        # the weight of a rational rail may have kinks that directions divided by the weight have not
        weight = self.lifted_rail[0] + self.lifted_rail[1]

        def make_direction(values: Array, kinks: KinkData | None) -> Curve:
            if not self.rail.curve.rational:
                return interpolate_with_corners(nodes, values, corners, closed=self.closed, kinks=kinks)
            if kinks is not None:
                kinks = kinks.scale_values(1 / weight(nodes[kinks.nodes_before])[:, 0])
            return (
                interpolate_with_corners(nodes, values / weight(t), corners, closed=self.closed, kinks=kinks) * weight
            )

        sampled = SampledRail(self.primary, self.lifted_rail, self.rail.curve(t), t, exact=True)
        break_uv = self.rail.curve(self.lifted_rail.breaks)
        makers = (make_direction,) * max(self.order, 1)
        method = DirectionMethod(self.order, makers, steering, self._find_kinks(nodes, sampled))
        if self.exact_direction is not None and not steering.pins and method.kinks is None:
            r, s = self.exact_direction.coefs[:, 0], self.exact_direction.coefs[:, 1]
            first = Curve(
                self.exact_direction.breaks,
                np.stack([-r, r, -s, s], axis=1),
                continuity=self.exact_direction.continuity,
            )
            directions = add_higher_directions(sampled, first, method)
            exact = Ribbon(self.primary, self.lifted_rail, directions, break_uv, self.order)
            return exact, np.zeros((len(nodes) - 1, 2))
        fitted, slack = fit_directions(sampled, self.target_vectors(t), method), steering.evaluate_slack(t)
        errors = np.maximum(
            fitted.angle_errors / (RAIL_TOLERANCES.direction + slack),
            fitted.length_errors / (RAIL_TOLERANCES.length + slack),
        )
        ribbon = Ribbon(self.primary, self.lifted_rail, fitted.curves, break_uv, self.order)
        return ribbon, np.stack([errors[1::3], errors[2::3]], axis=1)

    def _find_kinks(self, nodes: Array, rail: SampledRail) -> ParametricKinks | None:
        """Return the parametric kinks at nodes of a fit, the seam of a closed rail among them."""
        if not self.has_kinks:
            return None
        apart = np.abs(nodes[:, None] - self.kink_parameters).min(axis=1, initial=np.inf)
        (inner,) = np.nonzero(apart <= SPLINE_TOLERANCES.near_breaks * (nodes[-1] - nodes[0]))
        before, after = inner.tolist(), inner.tolist()
        if self.has_seam_kink:
            before, after = [*before, len(nodes) - 1], [*after, 0]
        return ParametricKinks.from_rail(rail, np.array([before, after], dtype=int))

    def measure_ribbon(self, ribbon: Ribbon) -> Ribbon:
        """Return a ribbon with the deviations of its direction from the wanted one, at eight points of every span."""
        breaks = ribbon.directions[0].breaks
        t = np.append((breaks[:-1] + np.arange(8)[:, None] / 8 * np.diff(breaks)).ravel(), breaks[-1])
        if self.has_kinks:
            fitted = _evaluate_first_jet(ribbon.jets, t)
        else:
            rail = SampledRail(self.primary, self.lifted_rail, self.rail.curve(t), t, exact=True)
            fitted = rail.evaluate_tangents(ribbon.directions[0](t))
        angles, lengths = _measure_deviations(fitted, self.target_vectors(t))
        return replace(ribbon, direction=float(angles.max()), length=float(lengths.max()))


def fit_ribbons_on_rails(fits: tuple[DirectionFit, DirectionFit], steer: float) -> tuple[Ribbon, Ribbon]:
    """Make ribbons on two given rails, on common nodes, with directions turned by ``steer`` (rad) at most."""
    domain = fits[0].lifted_rail.domain
    no_steering = (Steering((), domain, fits[0].closed), Steering((), domain, fits[1].closed))
    corners = merge_breaks(fits[0].corners, fits[1].corners)
    spread = np.linspace(*domain, RAIL_TOLERANCES.initial_spans + 1)
    clear = np.abs(spread[:, None] - corners).min(axis=1) > (spread[1] - spread[0]) / 3
    first_nodes = np.sort(np.concatenate([corners, spread[clear]]))
    ribbons, nodes = _refine_nodes(fits, first_nodes, no_steering)
    steering, pins = no_steering, [find_pins(ribbon, steer) for ribbon in ribbons]
    if any(pins):
        nodes = merge_breaks(nodes, np.array([pin.t for of_rail in pins for pin in of_rail]))
        at_nodes = [
            tuple(replace(pin, t=float(nodes[np.abs(nodes - pin.t).argmin()])) for pin in of_rail) for of_rail in pins
        ]
        steering = (replace(no_steering[0], pins=at_nodes[0]), replace(no_steering[1], pins=at_nodes[1]))
        ribbons, _ = _refine_nodes(fits, nodes, steering)
    elif len(nodes) == len(first_nodes) and any(one.exact_direction is None for one in fits):
        on_corners = [one.fit_ribbon(corners, turns)[0] for one, turns in zip(fits, no_steering, strict=True)]
        if all(map(_has_same_directions, on_corners, ribbons)):
            ribbons = on_corners
    first, second = (
        ribbon
        if one.exact_direction is not None and not turns.pins and not one.has_kinks
        else one.measure_ribbon(ribbon)
        for one, ribbon, turns in zip(fits, ribbons, steering, strict=True)
    )
    return first, second


def _refine_nodes(
    fits: tuple[DirectionFit, DirectionFit], nodes: Array, steering: tuple[Steering, Steering]
) -> tuple[list[Ribbon], Array]:
    """Halve spans until both ribbons are as wanted, or spans as short as they may be.

    Returns the ribbons, and the nodes, which both have in common.
    """
    shortest = max(RAIL_TOLERANCES.shortest_span_by_order[one.order] for one in fits) * (nodes[-1] - nodes[0])
    while True:
        (first, first_errors), (second, second_errors) = (
            one.fit_ribbon(nodes, turns) for one, turns in zip(fits, steering, strict=True)
        )
        halved = halve_spans(
            nodes, np.maximum(first_errors, second_errors), RAIL_TOLERANCES.least_divided_span * shortest
        )
        if len(halved) == len(nodes):
            return [first, second], nodes
        nodes = halved


def _has_same_directions(one: Ribbon, other: Ribbon) -> bool:
    """Whether two fits of a ribbon have the same directions, well within what these may miss."""
    t = np.linspace(*other.c.domain, 8 * RAIL_TOLERANCES.initial_spans + 1)
    pairs = zip(one.directions, other.directions, strict=True)
    return all(np.abs(a(t) - b(t)).max() <= RAIL_TOLERANCES.same_fit_share * np.abs(b(t)).max() for a, b in pairs)
