"""Angles as surface parameters: periods, half-angle pairs on circles, and quaternions on spheres.

A point of a circle is (a^2 - b^2, 2ab) / (a^2 + b^2) for the *half-angle pair* (a, b), any multiple of (cos u/2,
sin u/2). Depends on NumPy only.
"""

from __future__ import annotations

import numpy as np

from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import cross_product


def shift_to_period(value: Array, near: Array, period: float) -> Array:
    """Shift values by whole periods to within half a period of ``near``."""
    return value + period * np.round((near - value) / period)


def unwrap_parameters(uv: Array, periods: tuple[float | None, float | None]) -> Array:
    """Remove jumps by whole periods from native parameters (n, 2) of consecutive points of a curve."""
    out = uv.copy()
    for axis, period in enumerate(periods):
        if period is not None:
            out[:, axis] = np.unwrap(out[:, axis], period=period)
    return out


def turn_parameters(uv: Array, angles: Array) -> Array:
    """Return native parameters (n, 2) of a point (2,) whose first one is an angle, turned by angles (n,)."""
    out = np.tile(uv, (len(angles), 1))
    out[:, 0] += angles
    return out


def to_half_angle_pair(angle: Array) -> Array:
    """Return (cos, sin) of half the angles, (n, 2): the homogeneous parameter of a circle."""
    return np.stack([np.cos(angle / 2), np.sin(angle / 2)], -1)


def half_angle_velocity(pair: Array, rate: Array) -> Array:
    """Return the velocity (n, 2) of half-angle pairs that turn at the given angular rate (n,)."""
    return np.stack([-pair[:, 1], pair[:, 0]], -1) * (rate / 2)[:, None]


def multiply_quaternions(p: Array, q: Array) -> Array:
    """Return the products of quaternions (n, 4), real part first."""
    real = p[:, 0] * q[:, 0] - (p[:, 1:] * q[:, 1:]).sum(1)
    return np.column_stack([real, p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + cross_product(p[:, 1:], q[:, 1:])])


def locate_on_rational_arcs(angles: Array, stops: Array, breaks: Array) -> Array:
    """Return the parameters (n,) at angles (n,) of a chain of rational quadratic arcs.

    The arcs end at the angles ``stops`` (m + 1,), where the parameters are ``breaks`` (m + 1,). On each of them, with
    half its angle h and x from 0 to 1, the half-angle pair is (1 + x (cos h - 1), x sin h).
    """
    arc = np.clip(np.searchsorted(stops, angles, side="right") - 1, 0, len(stops) - 2)
    half, tangent = np.diff(stops)[arc] / 2, np.tan((angles - stops[arc]) / 2)
    x = tangent / (np.sin(half) - tangent * (np.cos(half) - 1))
    return np.asarray(breaks[arc] + x * np.diff(breaks)[arc])


def measure_rational_arcs(t: Array, stops: Array, breaks: Array) -> Array:
    """Return the angles (n,) at parameters (n,) of such a chain: the inverse of :func:`locate_on_rational_arcs`.

    On each arc tan of half the angle is a quotient of linear functions of the parameter.
    """
    arc = np.clip(np.searchsorted(breaks, t, side="right") - 1, 0, len(breaks) - 2)
    half = np.diff(stops)[arc] / 2
    x = (t - breaks[arc]) / np.diff(breaks)[arc]
    return np.asarray(stops[arc] + 2 * np.arctan2(x * np.sin(half), 1 + x * (np.cos(half) - 1)))


CIRCLE_FORM = np.array([[[1, 0], [0, -1]], [[0, 1], [1, 0]], [[1, 0], [0, 1]]], float)
"""Coefficients (3, 2, 2) of the circle (a^2 - b^2, 2ab, a^2 + b^2) as a symmetric bilinear form in (a, b)."""
