"""Aiming: fits the directions of a ribbon, on a rail that is already there, to wanted vectors in space.

Directions are fitted as curves of lifted parameters, C2 and of low degree, because nothing else may approximate: with
every one of them the blend is exactly smooth. What a fit misses is the direction and the length that were asked for,
and it says by how much.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cqblend.blends.rails.knot_line_bends import CurveMaker, KinkData, ParametricKinks
from cqblend.blends.rails.rail import Rail
from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets
from cqblend.blends.rails.steering import Steering, find_pins
from cqblend.splines import Curve, interpolation
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import merge_breaks
from cqblend.splines.tolerances import SPLINE_TOLERANCES
from cqblend.surfaces.primary import Primary
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import cross_product, normalise_vectors, to_tangent_coordinates

INITIAL_SPANS = 16  # spans of a cubic fit
SHORTEST_SPAN_BY_ORDER = (1 / 512, 1 / 512, 1 / 128, 1 / 64)
"""Its shortest span for the sake of directions, as a share of the whole, by order of continuity.

The rounding of a blend's poles shows in its derivatives of order k divided by spans to the power of k.
"""
DIRECTION_TOLERANCE, LENGTH_TOLERANCE = 1e-5, 1e-3  # rad, and relative: what a direction may miss
LEAST_VECTOR_SHARE = 1e-3  # of the largest vector along a rail: what is shorter has faded
SAME_FIT_TOLERANCE = 1e-6  # relative: fits that differ by less are the same
SAME_VALUE_TOLERANCE = 1e-14  # relative: values on both sides of a bend that differ by less are one


def add_third_points(nodes: Array) -> Array:
    """Return the nodes, and two parameters between neighbouring ones; those of a span depend on its ends alone."""
    steps = np.diff(nodes)
    inside = np.stack([nodes[:-1], nodes[:-1] + steps / 3, nodes[:-1] + 2 * steps / 3], axis=1)
    return np.append(inside.ravel(), nodes[-1])


def fit_directions(
    primary: Primary,
    c: Curve,
    uv: Array,
    t: Array,
    vectors: Array,
    order: int,
    make: CurveMaker,
    steering: Steering,
    bends: ParametricKinks | None = None,
) -> tuple[tuple[Curve, ...], Array, Array]:
    """Fit the directions of a ribbon on a rail to wanted first ones, tangent vectors (n, 3) at t.

    ``uv`` (n, 2) are the rail's native parameters at t; ``make`` turns lifted values there into a curve. Second
    directions are such that the second derivative is normal to the surface, third ones such that the speed of the
    ribbon's sections stays constant: those of curves run through at constant speed and as straight as they can be.

    Returns
    -------
    directions, direction, length
        The lifted curves, and how far the first one is from the (steered) vectors at t: rad, and relative.
    """
    jet = primary.jet(uv)
    vectors = steering.turn_vectors(vectors, normalise_vectors(cross_product(jet[1], jet[2])), t)
    values = primary.lift_directions(uv, c(t), steering.zero_at_pins(to_tangent_coordinates(jet, vectors), t))
    if bends is None:
        first = make(values, None)
    else:
        rs = steering.zero_at_pins(bends.to_coordinates(vectors[bends.sample_indices[1]]), bends.t[0])
        before = primary.lift_directions(bends.uv[0], c(bends.t[0], side="left"), rs)
        first = bends.fit_curve(primary, values, before, make, lambda _: c, lambda d: primary.compose_jets(c, [d]))
    directions = add_higher_directions(primary, c, [first], uv, t, order, make, steering, bends)
    return directions, *_measure_deviations(primary.compose_jets(c, [first]), t, vectors)


def _measure_deviations(jets: Sequence[Curve], t: Array, vectors: Array) -> tuple[Array, Array]:
    """Return how far the first derivatives of a ribbon are from vectors (n, 3) at t: rad, and relative.

    Where vectors vanish they have no direction, and what is left of them is compared with the largest.
    """
    fitted = dehomogenise_jets(np.stack([curve(t) for curve in jets]))[1]
    length = np.linalg.norm(vectors, axis=1)
    least = LEAST_VECTOR_SHARE * length.max()
    angle = np.arctan2(np.linalg.norm(cross_product(fitted, vectors), axis=1), (fitted * vectors).sum(1))
    ratio = (np.linalg.norm(fitted, axis=1) - length) / np.maximum(length, least)
    return np.where(length > least, angle, 0.0), np.abs(ratio)


def add_higher_directions(
    primary: Primary,
    c: Curve,
    first: Sequence[Curve],
    uv: Array,
    t: Array,
    order: int,
    make: CurveMaker,
    steering: Steering,
    bends: ParametricKinks | None = None,
) -> tuple[Curve, ...]:
    """Add second and third directions, up to an order: see :func:`fit_directions`."""
    directions = list(first)
    jet, lifted = primary.jet(uv), c(t)

    def push_with_gauge(uv: Array, lifted: Array, rs: Array, jets: Array) -> Array:
        gauge = -jets[-1, :, 3:] / jets[0, :, 3:]
        return np.asarray(primary.lift_directions(uv, lifted, rs) + gauge * lifted * primary.weight_exponents)

    for k in range(2, order + 1):
        known = primary.compose_jets(c, directions, k)
        jets = np.stack([curve(t) for curve in known])
        space = dehomogenise_jets(jets)
        target = np.zeros_like(space[1])
        if k == 3:
            target -= space[1] * ((space[2] ** 2).sum(1) / (space[1] ** 2).sum(1))[:, None]
        plain = to_tangent_coordinates(jet, target - space[k])
        rs = steering.align_second_directions(plain, t)
        values = push_with_gauge(uv, lifted, rs, jets)
        if bends is None:
            directions.append(make(values, None))
            continue
        limits, (before, after) = bends.evaluate_left_limits(known), bends.sample_indices
        rs = bends.to_coordinates(target[after] - dehomogenise_jets(limits)[k]) + (rs - plain)[before]
        rs = steering.zero_at_pins(rs, bends.t[0], deep=True)
        ends = push_with_gauge(bends.uv[0], c(bends.t[0], side="left"), rs, limits)
        directions.append(
            bends.fit_curve(
                primary,
                values,
                ends,
                make,
                lambda _: c,
                lambda d: primary.compose_jets(c, [*directions, d]),
            )
        )
    return tuple(directions)


@dataclass(frozen=True)
class DirectionFit:
    """What a ribbon on a given rail is to be.

    Attributes
    ----------
    rail
        Kept as it is: the blend will start on the whole of S(c(t)).
    target_vectors
        The wanted cross derivatives: tangent vectors (n, 3) at t (n,).
    order
        Of the continuity between blend and surface.
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
            self.lifted_rail.breaks,
            np.array([one.t for one in self.primary.find_knot_crossings(self.lifted_rail, max(2, self.order))]),
        )

    @cached_property
    def kink_parameters(self) -> Array:
        """The parameters at which the surface's own have a kink that its shape has not."""
        crossings = self.primary.find_knot_crossings(self.lifted_rail, self.order) if self.order else []
        return np.array([one.t for one in crossings if one.is_parametric_kink(self.order)])

    @cached_property
    def has_seam_kink(self) -> bool:
        """Whether a closed rail meets itself in a seam of the surface, at which parameters or derivatives jump."""
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
        """Whether the rail bends anywhere."""
        return self.has_seam_kink or len(self.kink_parameters) > 0

    def fit_ribbon(self, nodes: Array, steering: Steering) -> tuple[Ribbon, Array]:
        """Fit the directions at nodes; also tell which spans between them miss what is wanted."""
        t = add_third_points(nodes)
        kinks = merge_breaks(self.corners, np.array([pin.t for pin in steering.pins]))
        corners = np.flatnonzero(
            np.abs(nodes[:, None] - kinks).min(axis=1) <= SPLINE_TOLERANCES.near_breaks * (nodes[-1] - nodes[0])
        )
        weight = (
            self.lifted_rail[0] + self.lifted_rail[1]
        )  # of a rational rail: it may have kinks, which directions per weight have not

        def make_direction(values: Array, kinks: KinkData | None) -> Curve:
            if not self.rail.curve.rational:
                return interpolate_with_corners(nodes, values, corners, closed=self.closed, kinks=kinks)
            if kinks is not None:
                kinks = kinks.scale_values(1 / weight(nodes[kinks.nodes_before])[:, 0])
            return (
                interpolate_with_corners(nodes, values / weight(t), corners, closed=self.closed, kinks=kinks) * weight
            )

        uv, ends = self.rail.curve(t), self.rail.curve(self.lifted_rail.breaks)
        bends = self._find_kinks(nodes, uv, t)
        if self.exact_direction is not None and not steering.pins and bends is None:
            r, s = self.exact_direction.coefs[:, 0], self.exact_direction.coefs[:, 1]
            first = Curve(
                self.exact_direction.breaks,
                np.stack([-r, r, -s, s], axis=1),
                continuity=self.exact_direction.continuity,
            )
            made = add_higher_directions(
                self.primary, self.lifted_rail, [first], uv, t, self.order, make_direction, steering
            )
            return Ribbon(self.primary, self.lifted_rail, made, ends, self.order), np.zeros(len(nodes) - 1, bool)
        made, turned, ratio = fit_directions(
            self.primary, self.lifted_rail, uv, t, self.target_vectors(t), self.order, make_direction, steering, bends
        )
        bad = (turned > DIRECTION_TOLERANCE + steering.evaluate_slack(t)) | (
            ratio > LENGTH_TOLERANCE + steering.evaluate_slack(t)
        )
        return Ribbon(self.primary, self.lifted_rail, made, ends, self.order), bad[1::3] | bad[2::3]

    def _find_kinks(self, nodes: Array, uv: Array, t: Array) -> ParametricKinks | None:
        """Return the bends at nodes of a fit."""
        if not self.has_kinks:
            return None
        apart = np.abs(nodes[:, None] - self.kink_parameters).min(axis=1, initial=np.inf)
        (at,) = np.nonzero(apart <= SPLINE_TOLERANCES.near_breaks * (nodes[-1] - nodes[0]))
        joint = [0] if self.has_seam_kink else []
        pairs = np.array([[*at, *(len(nodes) - 1 for _ in joint)], [*at, *joint]])
        return ParametricKinks.from_rail(self.primary, self.lifted_rail, uv, t, pairs)

    def measure_ribbon(self, ribbon: Ribbon) -> Ribbon:
        """Return a ribbon that says how far its direction is from the wanted one, at eight points of every span."""
        breaks = ribbon.directions[0].breaks
        t = np.append((breaks[:-1] + np.arange(8)[:, None] / 8 * np.diff(breaks)).ravel(), breaks[-1])
        turned, ratio = _measure_deviations(
            self.primary.compose_jets(self.lifted_rail, ribbon.directions[:1]), t, self.target_vectors(t)
        )
        return replace(ribbon, direction=float(turned.max()), length=float(ratio.max()))


def fit_ribbons_on_rails(aims: tuple[DirectionFit, DirectionFit], steer: float) -> tuple[Ribbon, Ribbon]:
    """Make ribbons on two given rails, on common nodes, with directions turned by ``steer`` (rad) at most."""
    domain = aims[0].lifted_rail.domain
    steering = [Steering((), domain, aim.closed) for aim in aims]
    finest = max(SHORTEST_SPAN_BY_ORDER[aim.order] for aim in aims) * (domain[1] - domain[0])

    def refine_nodes(nodes: Array) -> tuple[list[Ribbon], Array]:
        while True:
            (first, bad), (second, worse) = (aim.fit_ribbon(nodes, s) for aim, s in zip(aims, steering, strict=True))
            bad = (bad | worse) & (np.diff(nodes) > 1.9 * finest)
            if not bad.any():
                return [first, second], nodes
            nodes = np.sort(np.concatenate([nodes, (nodes[:-1] + nodes[1:])[bad] / 2]))

    corners = merge_breaks(aims[0].corners, aims[1].corners)
    spread = np.linspace(*domain, INITIAL_SPANS + 1)
    clear = np.abs(spread[:, None] - corners).min(axis=1) > (spread[1] - spread[0]) / 3
    ribbons, nodes = refine_nodes(np.sort(np.concatenate([corners, spread[clear]])))
    found = [find_pins(ribbon, steer) for ribbon in ribbons]
    if any(found):
        nodes = merge_breaks(nodes, np.array([pin.t for some in found for pin in some]))
        at = [[replace(pin, t=float(nodes[np.abs(nodes - pin.t).argmin()])) for pin in some] for some in found]
        steering = [replace(one, pins=tuple(some)) for one, some in zip(steering, at, strict=True)]
        ribbons, _ = refine_nodes(nodes)
    elif any(aim.exact_direction is None for aim in aims):
        lighter = [aim.fit_ribbon(corners, s)[0] for aim, s in zip(aims, steering, strict=True)]
        if all(map(_has_same_directions, lighter, ribbons)):
            ribbons = lighter
    first, second = (
        ribbon if aim.exact_direction is not None and not one.pins and not aim.has_kinks else aim.measure_ribbon(ribbon)
        for aim, ribbon, one in zip(aims, ribbons, steering, strict=True)
    )
    return first, second


def _has_same_directions(one: Ribbon, other: Ribbon) -> bool:
    """Whether two fits of a ribbon have the same directions, well within what these may miss."""
    t = np.linspace(*other.c.domain, 8 * INITIAL_SPANS + 1)
    pairs = zip(one.directions, other.directions, strict=True)
    return all(np.abs(a(t) - b(t)).max() <= SAME_FIT_TOLERANCE * np.abs(b(t)).max() for a, b in pairs)


def interpolate_with_corners(
    nodes: Array,
    values: Array,
    corners: Array,
    *,
    closed: bool,
    sharp: Sequence[int] | Array = (),
    kinks: KinkData | None = None,
) -> Curve:
    """Interpolate values at the nodes by a cubic spline: C2, but C1 at corners (indices of nodes, both ends included).

    There are two more values between neighbouring nodes, at equal distances. From them come the slopes at the corners,
    of third order, and the same on both sides; at ``sharp`` corners each side has its own, and at ``kinks``, which must
    be corners too, its own value besides.
    """
    steps = np.diff(nodes)
    weights = np.array([-11, 18, -9, 2]) / 2  # of the slope at the first of four equidistant values, times 3 steps
    spans = np.stack([values[i::3][: len(steps)] for i in range(4)])
    if kinks is not None:
        spans[3, kinks.nodes_before - 1] = kinks.values_before
    right, left = (
        np.einsum("w,wnd->nd", weights, spans) / steps[:, None],
        np.einsum("w,wnd->nd", -weights[::-1], spans) / steps[:, None],
    )
    before, after = (np.concatenate(pair) for pair in ((right[:1], left), (right, left[-1:])))
    even = np.ones(len(nodes), dtype=bool)
    even[np.asarray(sharp, dtype=int)] = False
    if kinks is not None:
        even[np.concatenate([kinks.nodes_before, kinks.nodes_after])] = False
        before[kinks.nodes_before] += kinks.slope_changes[0]
        after[kinks.nodes_after] += kinks.slope_changes[1]
    before[even] = after[even] = (before[even] + after[even]) / 2
    if closed and even[0] and even[-1]:
        before[-1] = after[0] = (right[0] + left[-1]) / 2
    whole: Curve | None = None
    order = np.where(even, 1, 0)
    size = np.abs(values).max()
    for i, j in zip(corners[:-1].tolist(), corners[1:].tolist(), strict=True):
        ends = np.concatenate([values[3 * i : 3 * j : 3], spans[3, j - 1 : j]])
        piece = interpolation.interpolate(nodes[i : j + 1], ends, derivatives=np.stack([after[i], before[j]]))
        if np.abs(ends[-1] - values[3 * j]).max() > SAME_VALUE_TOLERANCE * size:
            order[j] = -1
        whole = piece if whole is None else whole.join(piece, continuity=int(order[i]))
    assert whole is not None
    return whole.reduce(tolerance=1e-13)
