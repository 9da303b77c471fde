"""Checks that a curve in the parameter plane of a surface can be a rail, and tells where it cannot.

At every parameter a blend needs one position, one tangent plane and one direction of its rail. So the curve must stay
in the domain of the surface, move, have no kinks, and meet neither a singular point of the surface nor itself. Domain
and self-crossings are decided on control polygons, whose convex hulls contain the curve; zeros of its speed and of
Su x Sv are searched wherever samples leave room for one. Depends on splines only.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.errors import GeometryError, InputError
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.self_intersection import control_points, find_self_crossing, measure_diagonal
from cqblend.splines.tolerances import SPLINE_TOLERANCES
from cqblend.surfaces.vectors import cross_product


def sample_stations(breaks: Array) -> Array:
    """Return parameters (n,) along a spline: every break, and equal steps between."""
    count = RAIL_TOLERANCES.samples_per_piece
    inner = breaks[:-1, None] + np.diff(breaks)[:, None] * (np.arange(count) / count)
    return np.append(inner.ravel(), breaks[-1])


def check_rail(surface: Surface, curve: Curve, position: Curve) -> None:
    """Check that a curve in the parameter plane can be a rail; ``position`` is its composition with the surface.

    Raises
    ------
    InputError
        If the curve leaves the surface's domain.
    GeometryError
        If it has no length, stands still, jumps, has a kink, crosses a crease or a singular point of the surface, or
        meets itself, or if a weight is not positive. Messages name the parameter.
    """
    _check_domain(surface, curve)
    t = sample_stations(position.breaks)
    _check_tangent_plane(surface, curve, t)
    _check_speed(surface, curve, t)
    _check_smoothness(surface, curve, position)
    crossing = find_self_crossing(position)
    if crossing is not None:
        a, b = crossing
        raise GeometryError(
            f"the rail meets itself: t = {a:.9g}, at {_format_uv(curve(a))}, and t = {b:.9g}, at "
            f"{_format_uv(curve(b))}, are the same point; clip it to a part that does not"
        )


def _format_uv(uv: Array) -> str:
    return f"(u, v) = ({uv[0]:.9g}, {uv[1]:.9g})"


def _check_domain(surface: Surface, curve: Curve) -> None:
    """Halve the pieces that have control points outside, until an end of a piece is outside or no control point is."""
    curve.bounds()  # refuses weights that are not positive
    low, high = (np.array(bound)[:, None] for bound in np.transpose(surface.domain))
    for _ in range(RAIL_TOLERANCES.halvings):
        points = control_points(curve)
        excess = (np.maximum(low - points, points - high) / (high - low)).max(axis=1)
        doubtful = excess.max(axis=0) > RAIL_TOLERANCES.domain_slack
        if not doubtful.any():
            return
        ends = np.append(excess[0], excess[-1, -1])
        if ends.max() > RAIL_TOLERANCES.domain_slack:
            t = curve.breaks[ends.argmax()]
            (u0, u1), (v0, v1) = surface.domain
            raise InputError(
                f"the rail leaves the surface: at t = {t:.9g} it is at {_format_uv(curve(t))}, outside of the domain "
                f"[{u0:.9g}, {u1:.9g}] x [{v0:.9g}, {v1:.9g}]; clip the rail, or extend the surface"
            )
        curve = curve.cut(((curve.breaks[:-1] + curve.breaks[1:]) / 2)[doubtful])


def _check_tangent_plane(surface: Surface, curve: Curve, t: Array) -> None:
    (u0, u1), (v0, v1) = surface.domain
    jet = _evaluate_jet(surface, curve(t))
    along_u, along_v = (float(np.linalg.norm(s, axis=-1).max()) for s in (jet[1, 0] * (u1 - u0), jet[0, 1] * (v1 - v0)))
    largest = max(along_u, along_v) ** 2 / ((u1 - u0) * (v1 - v0))
    at = _find_zero(
        lambda t: np.linalg.norm(_evaluate_normals(surface, curve(t)), axis=-1),
        t,
        RAIL_TOLERANCES.vanishing_share * largest,
    )
    if at is not None:
        raise GeometryError(
            f"the surface is singular on the rail, at t = {at:.9g}, {_format_uv(curve(at))}: Su x Sv is zero there "
            "(a pole, "
            f"or a side shrunk to a point), so no tangent plane to blend with; keep the rail clear of it"
        )


def _evaluate_jet(surface: Surface, uv: Array) -> Array:
    return surface.jet(uv[..., 0], uv[..., 1], 1)


def _evaluate_normals(surface: Surface, uv: Array) -> Array:
    """Return Su x Sv, (n, 3)."""
    jet = _evaluate_jet(surface, uv)
    return cross_product(jet[1, 0], jet[0, 1])


def _check_speed(surface: Surface, curve: Curve, t: Array) -> None:
    def evaluate_speed(t: Array) -> Array:
        c, rate = curve.jet(t, 1)
        jet = _evaluate_jet(surface, c)
        return np.asarray(np.linalg.norm(rate[:, :1] * jet[1, 0] + rate[:, 1:] * jet[0, 1], axis=-1))

    low, high = surface.bounds()
    fastest = float(evaluate_speed(t).max())
    if fastest * (t[-1] - t[0]) <= SPLINE_TOLERANCES.touching * np.linalg.norm(high - low):
        raise GeometryError(
            f"the rail has no length: from t = {t[0]:.9g} to t = {t[-1]:.9g} it stays at {_format_uv(curve(t[0]))}"
        )
    at = _find_zero(evaluate_speed, t, RAIL_TOLERANCES.vanishing_share * fastest)
    if at is not None:
        raise GeometryError(
            f"the rail stands still at t = {at:.9g}, {_format_uv(curve(at))}: its derivative is zero, and no "
            "direction is "
            f"across it; reparametrise it, or clip it there"
        )


def _find_zero(f: Callable[[Array], Array], t: Array, tolerance: float) -> float | None:
    """Return the first parameter found at which f >= 0 is zero to the tolerance, or None."""
    y = f(t)
    steps = np.abs(np.diff(y))
    slope = np.maximum(np.append(steps, 0), np.append(0, steps))
    (at,) = np.nonzero(y <= np.maximum(2 * slope, tolerance))
    if not len(at):
        return None
    low, high = t[np.maximum(at - 1, 0)], t[np.minimum(at + 1, len(t) - 1)]
    for _ in range(RAIL_TOLERANCES.thirding_steps):
        third = (high - low) / 3
        left, right = f(np.concatenate([low + third, high - third])).reshape(2, -1)
        low, high = np.where(left < right, low, low + third), np.where(left < right, high - third, high)
    candidates = np.concatenate([t[at], (low + high) / 2])
    zeros = candidates[f(candidates) <= tolerance]
    return float(zeros.min()) if len(zeros) else None


def _check_smoothness(surface: Surface, curve: Curve, position: Curve) -> None:
    """Compare both sides of the breaks across which neither the curve nor the surface is known to be C1."""
    t = position.breaks[1:-1][position.continuity < 1]
    if not len(t):
        return
    before, after = position.jet(t, 1, side="left"), position.jet(t, 1, side="right")
    gap = np.linalg.norm(after[0] - before[0], axis=-1)
    i = int(gap.argmax())
    if gap[i] > SPLINE_TOLERANCES.touching * measure_diagonal(position):
        raise GeometryError(f"the rail is broken at t = {t[i]:.9g}: its pieces are {gap[i]:.3g} apart there; join them")
    beside = RAIL_TOLERANCES.domain_slack * (position.domain[1] - position.domain[0])
    crease = _measure_angles(
        _evaluate_normals(surface, curve(t - beside)), _evaluate_normals(surface, curve(t + beside))
    )
    i = int(crease.argmax())
    if crease[i] > RAIL_TOLERANCES.crease_angle:
        raise GeometryError(
            f"the rail crosses a crease of the surface at t = {t[i]:.9g}, {_format_uv(curve(t[i]))}, where the "
            "normal turns "
            f"by {crease[i]:.3g} rad; split surface and rail there"
        )
    kink = _measure_angles(before[1], after[1])
    i = int(kink.argmax())
    if kink[i] > RAIL_TOLERANCES.crease_angle:
        raise GeometryError(
            f"the rail has a kink of {kink[i]:.3g} rad at its break t = {t[i]:.9g}; split it there, or round it off"
        )


def _measure_angles(a: Array, b: Array) -> Array:
    """Return the angles between vectors (n, 3)."""
    return np.arctan2(np.linalg.norm(cross_product(a, b), axis=-1), (a * b).sum(axis=-1))
