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


CIRCLE_FORM = np.array([[[1, 0], [0, -1]], [[0, 1], [1, 0]], [[1, 0], [0, 1]]], float)
"""Coefficients (3, 2, 2) of the circle (a^2 - b^2, 2ab, a^2 + b^2) as a symmetric bilinear form in (a, b)."""
