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

from cqblend.blends.rails.knot_line_bends import Bends, Kinks, Maker
from cqblend.blends.rails.rail import Rail
from cqblend.blends.rails.ribbon import Ribbon, in_space
from cqblend.blends.rails.steering import Steering, pins
from cqblend.splines import Curve, fit
from cqblend.splines.breaks import NEAR, SAME, merged
from cqblend.surfaces.primaries import Array, Primary, Tensor, cross, tangent_coordinates, unit

FEWEST = 16  # spans of a cubic fit
FINE = (1 / 512, 1 / 512, 1 / 128, 1 / 64)
"""Its shortest span for the sake of directions, as a share of the whole, by order of continuity.

The rounding of a blend's poles shows in its derivatives of order k divided by spans to the power of k.
"""
DIRECTION, LENGTH = 1e-5, 1e-3  # rad, and relative: what a direction may miss
FADED = 1e-3  # of the largest vector along a rail: what is shorter has faded
ALIKE = 1e-6  # relative: fits that differ by less are the same
EVEN = 1e-14  # relative: values on both sides of a bend that differ by less are one


def thirds(nodes: Array) -> Array:
    """Return the nodes, and two parameters between neighbouring ones; those of a span depend on its ends alone."""
    steps = np.diff(nodes)
    inside = np.stack([nodes[:-1], nodes[:-1] + steps / 3, nodes[:-1] + 2 * steps / 3], axis=1)
    return np.append(inside.ravel(), nodes[-1])


def aim(
    primary: Primary,
    c: Curve,
    uv: Array,
    t: Array,
    vectors: Array,
    order: int,
    make: Maker,
    steering: Steering,
    bends: Bends | None = None,
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
    vectors = steering.turned(vectors, unit(cross(jet[1], jet[2])), t)
    values = primary.push(uv, c(t), steering.pinned(tangent_coordinates(jet, vectors), t))
    if bends is None:
        first = make(values, None)
    else:
        rs = steering.pinned(bends.coordinates(vectors[bends.at[1]]), bends.t[0])
        before = primary.push(bends.uv[0], c(bends.t[0], side="left"), rs)
        first = bends.fitted(primary, values, before, make, lambda _: c, lambda d: primary.jets(c, [d]))
    directions = further(primary, c, [first], uv, t, order, make, steering, bends)
    return directions, *_deviations(primary.jets(c, [first]), t, vectors)


def _deviations(jets: Sequence[Curve], t: Array, vectors: Array) -> tuple[Array, Array]:
    """Return how far the first derivatives of a ribbon are from vectors (n, 3) at t: rad, and relative.

    Where vectors vanish they have no direction, and what is left of them is compared with the largest.
    """
    fitted = in_space(np.stack([curve(t) for curve in jets]))[1]
    length = np.linalg.norm(vectors, axis=1)
    least = FADED * length.max()
    angle = np.arctan2(np.linalg.norm(cross(fitted, vectors), axis=1), (fitted * vectors).sum(1))
    ratio = (np.linalg.norm(fitted, axis=1) - length) / np.maximum(length, least)
    return np.where(length > least, angle, 0.0), np.abs(ratio)


def further(
    primary: Primary,
    c: Curve,
    first: Sequence[Curve],
    uv: Array,
    t: Array,
    order: int,
    make: Maker,
    steering: Steering,
    bends: Bends | None = None,
) -> tuple[Curve, ...]:
    """Add second and third directions, up to an order: see :func:`aim`."""
    directions = list(first)
    jet, lifted = primary.jet(uv), c(t)

    def pushed(uv: Array, lifted: Array, rs: Array, jets: Array) -> Array:
        gauge = -jets[-1, :, 3:] / jets[0, :, 3:]
        return np.asarray(primary.push(uv, lifted, rs) + gauge * lifted * primary.powers)

    for k in range(2, order + 1):
        known = primary.jets(c, directions, k)
        jets = np.stack([curve(t) for curve in known])
        space = in_space(jets)
        target = np.zeros_like(space[1])
        if k == 3:
            target -= space[1] * ((space[2] ** 2).sum(1) / (space[1] ** 2).sum(1))[:, None]
        plain = tangent_coordinates(jet, target - space[k])
        rs = steering.faded(plain, t)
        values = pushed(uv, lifted, rs, jets)
        if bends is None:
            directions.append(make(values, None))
            continue
        limits, (before, after) = bends.limits(known), bends.at
        rs = bends.coordinates(target[after] - in_space(limits)[k]) + (rs - plain)[before]
        rs = steering.pinned(rs, bends.t[0], deep=True)
        ends = pushed(bends.uv[0], c(bends.t[0], side="left"), rs, limits)
        directions.append(
            bends.fitted(
                primary,
                values,
                ends,
                make,
                lambda _: c,
                lambda d: primary.jets(c, [*directions, d]),
            )
        )
    return tuple(directions)


@dataclass(frozen=True)
class Aim:
    """What a ribbon on a given rail is to be.

    Attributes
    ----------
    rail
        Kept as it is: the blend will start on the whole of S(c(t)).
    vectors
        The wanted cross derivatives: tangent vectors (n, 3) at t (n,).
    order
        Of the continuity between blend and surface.
    closed
        Whether rail and vectors return to where they start.
    exact
        The wanted direction (r, s) as a curve, if it is one of low degree: it is taken as it is, unless it must be
        turned.
    """

    rail: Rail
    vectors: Callable[[Array], Array]
    order: int
    closed: bool
    exact: Curve | None

    @cached_property
    def primary(self) -> Tensor:
        """The surface."""
        surface = self.rail.surface
        return Tensor.of(surface, level=surface.rational or self.rail.curve.rational)

    @cached_property
    def c(self) -> Curve:
        """The rail, lifted: barycentric pairs (w - U, U, w - V, V) of the plane curve (U, V) / w."""
        curve = self.rail.curve
        u, v = curve.coefs[:, 0], curve.coefs[:, 1]
        w = curve.coefs[:, 2] if curve.rational else np.ones_like(u)
        return Curve(curve.breaks, np.stack([w - u, u, w - v, v], axis=1), continuity=curve.continuity)

    @cached_property
    def corners(self) -> Array:
        """The parameters at which the wanted directions are no more than C1."""
        if self.exact is not None and self.order < 2:
            return merged(self.c.breaks, self.bends)
        return merged(self.c.breaks, np.array([one.t for one in self.primary.crossings(self.c, max(2, self.order))]))

    @cached_property
    def bends(self) -> Array:
        """The parameters at which the surface's own have a kink that its shape has not."""
        crossings = self.primary.crossings(self.c, self.order) if self.order else []
        return np.array([one.t for one in crossings if one.bends(self.order)])

    @cached_property
    def joint(self) -> bool:
        """Whether a closed rail meets itself in a seam of the surface, at which parameters or derivatives jump."""
        uv = self.rail.curve(np.array(self.rail.domain))
        if not (self.closed and self.order) or np.abs(uv[1] - uv[0]).max() <= SAME * np.ptp(self.rail.surface.domain):
            return False
        jet = self.rail.surface.jet(uv[:, 0], uv[:, 1], self.order + 1)
        return bool(np.any(np.abs(jet[:, :, 1] - jet[:, :, 0]).max(axis=-1) > SAME * np.abs(jet).max()))

    @property
    def bent(self) -> bool:
        """Whether the rail bends anywhere."""
        return self.joint or len(self.bends) > 0

    def ribbon(self, nodes: Array, steering: Steering) -> tuple[Ribbon, Array]:
        """Fit the directions at nodes; also tell which spans between them miss what is wanted."""
        t = thirds(nodes)
        kinks = merged(self.corners, np.array([pin.t for pin in steering.pins]))
        corners = np.flatnonzero(np.abs(nodes[:, None] - kinks).min(axis=1) <= NEAR * (nodes[-1] - nodes[0]))
        weight = self.c[0] + self.c[1]  # of a rational rail: it may have kinks, which directions per weight have not

        def make(values: Array, kinks: Kinks | None) -> Curve:
            if not self.rail.curve.rational:
                return through(nodes, values, corners, closed=self.closed, kinks=kinks)
            if kinks is not None:
                kinks = kinks.scaled(1 / weight(nodes[kinks.last])[:, 0])
            return through(nodes, values / weight(t), corners, closed=self.closed, kinks=kinks) * weight

        uv, ends = self.rail.curve(t), self.rail.curve(self.c.breaks)
        bends = self._bends(nodes, uv, t)
        if self.exact is not None and not steering.pins and bends is None:
            r, s = self.exact.coefs[:, 0], self.exact.coefs[:, 1]
            first = Curve(self.exact.breaks, np.stack([-r, r, -s, s], axis=1), continuity=self.exact.continuity)
            made = further(self.primary, self.c, [first], uv, t, self.order, make, steering)
            return Ribbon(self.primary, self.c, made, ends, self.order), np.zeros(len(nodes) - 1, bool)
        made, turned, ratio = aim(self.primary, self.c, uv, t, self.vectors(t), self.order, make, steering, bends)
        bad = (turned > DIRECTION + steering.slack(t)) | (ratio > LENGTH + steering.slack(t))
        return Ribbon(self.primary, self.c, made, ends, self.order), bad[1::3] | bad[2::3]

    def _bends(self, nodes: Array, uv: Array, t: Array) -> Bends | None:
        """Return the bends at nodes of a fit."""
        if not self.bent:
            return None
        apart = np.abs(nodes[:, None] - self.bends).min(axis=1, initial=np.inf)
        (at,) = np.nonzero(apart <= NEAR * (nodes[-1] - nodes[0]))
        joint = [0] if self.joint else []
        pairs = np.array([[*at, *(len(nodes) - 1 for _ in joint)], [*at, *joint]])
        return Bends.of(self.primary, self.c, uv, t, pairs)

    def measured(self, ribbon: Ribbon) -> Ribbon:
        """Return a ribbon that says how far its direction is from the wanted one, at eight points of every span."""
        breaks = ribbon.directions[0].breaks
        t = np.append((breaks[:-1] + np.arange(8)[:, None] / 8 * np.diff(breaks)).ravel(), breaks[-1])
        turned, ratio = _deviations(self.primary.jets(self.c, ribbon.directions[:1]), t, self.vectors(t))
        return replace(ribbon, direction=float(turned.max()), length=float(ratio.max()))


def on_rails(aims: tuple[Aim, Aim], steer: float) -> tuple[Ribbon, Ribbon]:
    """Make ribbons on two given rails, on common nodes, with directions turned by ``steer`` (rad) at most."""
    domain = aims[0].c.domain
    steering = [Steering((), domain, aim.closed) for aim in aims]
    finest = max(FINE[aim.order] for aim in aims) * (domain[1] - domain[0])

    def refined(nodes: Array) -> tuple[list[Ribbon], Array]:
        while True:
            (first, bad), (second, worse) = (aim.ribbon(nodes, s) for aim, s in zip(aims, steering, strict=True))
            bad = (bad | worse) & (np.diff(nodes) > 1.9 * finest)
            if not bad.any():
                return [first, second], nodes
            nodes = np.sort(np.concatenate([nodes, (nodes[:-1] + nodes[1:])[bad] / 2]))

    corners = merged(aims[0].corners, aims[1].corners)
    spread = np.linspace(*domain, FEWEST + 1)
    clear = np.abs(spread[:, None] - corners).min(axis=1) > (spread[1] - spread[0]) / 3
    ribbons, nodes = refined(np.sort(np.concatenate([corners, spread[clear]])))
    found = [pins(ribbon, steer) for ribbon in ribbons]
    if any(found):
        nodes = merged(nodes, np.array([pin.t for some in found for pin in some]))
        at = [[replace(pin, t=float(nodes[np.abs(nodes - pin.t).argmin()])) for pin in some] for some in found]
        steering = [replace(one, pins=tuple(some)) for one, some in zip(steering, at, strict=True)]
        ribbons, _ = refined(nodes)
    elif any(aim.exact is None for aim in aims):
        lighter = [aim.ribbon(corners, s)[0] for aim, s in zip(aims, steering, strict=True)]
        if all(map(_alike, lighter, ribbons)):
            ribbons = lighter
    first, second = (
        ribbon if aim.exact is not None and not one.pins and not aim.bent else aim.measured(ribbon)
        for aim, ribbon, one in zip(aims, ribbons, steering, strict=True)
    )
    return first, second


def _alike(one: Ribbon, other: Ribbon) -> bool:
    """Whether two fits of a ribbon have the same directions, well within what these may miss."""
    t = np.linspace(*other.c.domain, 8 * FEWEST + 1)
    pairs = zip(one.directions, other.directions, strict=True)
    return all(np.abs(a(t) - b(t)).max() <= ALIKE * np.abs(b(t)).max() for a, b in pairs)


def through(
    nodes: Array,
    values: Array,
    corners: Array,
    *,
    closed: bool,
    sharp: Sequence[int] | Array = (),
    kinks: Kinks | None = None,
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
        spans[3, kinks.last - 1] = kinks.before
    right, left = (
        np.einsum("w,wnd->nd", weights, spans) / steps[:, None],
        np.einsum("w,wnd->nd", -weights[::-1], spans) / steps[:, None],
    )
    before, after = (np.concatenate(pair) for pair in ((right[:1], left), (right, left[-1:])))
    even = np.ones(len(nodes), dtype=bool)
    even[np.asarray(sharp, dtype=int)] = False
    if kinks is not None:
        even[np.concatenate([kinks.last, kinks.first])] = False
        before[kinks.last] += kinks.turns[0]
        after[kinks.first] += kinks.turns[1]
    before[even] = after[even] = (before[even] + after[even]) / 2
    if closed and even[0] and even[-1]:
        before[-1] = after[0] = (right[0] + left[-1]) / 2
    whole: Curve | None = None
    order = np.where(even, 1, 0)
    size = np.abs(values).max()
    for i, j in zip(corners[:-1].tolist(), corners[1:].tolist(), strict=True):
        ends = np.concatenate([values[3 * i : 3 * j : 3], spans[3, j - 1 : j]])
        piece = fit.interpolate(nodes[i : j + 1], ends, derivatives=np.stack([after[i], before[j]]))
        if np.abs(ends[-1] - values[3 * j]).max() > EVEN * size:
            order[j] = -1
        whole = piece if whole is None else whole.join(piece, continuity=int(order[i]))
    assert whole is not None
    return whole.reduce(tolerance=1e-13)
