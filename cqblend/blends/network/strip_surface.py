"""The surface of a strip as it goes into the solid: a spline, or a profile that is turned about an axis.

Both have v from 0 on the first rail to 1 on the second. Along a spline, the parameter is that of the rails, t; around
an axis, it is the angle (rad) from the first section. Edges of the strip are planned in these parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cqblend.blends.network.tolerances import NETWORK_TOLERANCES
from cqblend.blends.sections.revolved_section import RevolvedSection
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.surfaces.circle import Circle
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.vectors import LocalFrame


class StripSurface(Protocol):
    """The surface H(s, v) of a strip over ``domain`` in s, and its boundary rows at v = 0 and v = 1."""

    @property
    def domain(self) -> tuple[float, float]:
        """The range of s."""

    @property
    def rail_curves(self) -> tuple[Curve | Circle, Curve | Circle]:
        """The curves s -> H(s, 0) and s -> H(s, 1)."""

    @property
    def first_section(self) -> Curve:
        """The curve v -> H(s, v) at the start of the domain."""

    @property
    def last_section(self) -> Curve:
        """The curve v -> H(s, v) at the end of the domain."""

    def __call__(self, s: Array, v: Array) -> Array:
        """Return points (n, 3) at parameters (n,)."""

    def jet(self, s: Array, v: Array, order: int) -> Array:
        """Return all partial derivatives up to a total order, (order + 1, order + 1, n, 3)."""

    def to_rail_parameters(self, s: Array) -> Array:
        """Return the parameters t (n,) of the rails at s (n,)."""

    def cut_with_plane(self, plane: Plane, near: float) -> Curve | None:
        """Return the curve v -> (s, v, a, b, x, y, z) in which the strip meets a plane, a, b the plane's parameters.

        The one nearest to s = ``near``. None if the curve has no closed form.
        """


@dataclass(frozen=True)
class SplineStrip:
    """A strip on a spline surface."""

    surface: Surface

    @property
    def domain(self) -> tuple[float, float]:
        breaks = self.surface.breaks[0]
        return float(breaks[0]), float(breaks[-1])

    @property
    def rail_curves(self) -> tuple[Curve, Curve]:
        return self.surface.isoparametric(v=0.0), self.surface.isoparametric(v=1.0)

    @property
    def first_section(self) -> Curve:
        return self.surface.isoparametric(u=self.domain[0])

    @property
    def last_section(self) -> Curve:
        return self.surface.isoparametric(u=self.domain[1])

    def __call__(self, s: Array, v: Array) -> Array:
        return self.surface(s, v)

    def jet(self, s: Array, v: Array, order: int) -> Array:
        return self.surface.jet(s, v, order)

    def to_rail_parameters(self, s: Array) -> Array:
        return s

    def cut_with_plane(self, plane: Plane, near: float) -> Curve | None:
        """Return the exact curve if the surface is A(v) + s B."""
        del near  # there is but one
        coefs = self.surface.coefs
        if self.surface.degree[0] != 1 or self.surface.rational or coefs.shape[3] != 1:
            return None
        low, high = self.domain
        first, steps = coefs[0, :, :, 0], coefs[1, :, :, 0] - coefs[0, :, :, 0]  # (q + 1, 3, n)
        step, normal = steps.mean(axis=(0, 2)), plane.frame.axes[2]
        along = float(step @ normal)
        size = np.linalg.norm(step)
        is_parallel = np.abs(steps - step[:, None]).max() <= NETWORK_TOLERANCES.parallel_rails * size
        if not is_parallel or abs(along) <= NETWORK_TOLERANCES.least_cut_sine * size:
            return None
        share = np.einsum("qkn,k->qn", plane.frame.origin[:, None] - first, normal) / along
        points = first + share[:, None] * step[:, None]
        return _collect_section(self.surface.breaks[1], low + (high - low) * share, points, plane)


@dataclass(frozen=True)
class RevolvedStrip:
    """A strip on a surface of revolution."""

    section: RevolvedSection

    @property
    def domain(self) -> tuple[float, float]:
        return 0.0, self.section.turn

    @property
    def rail_curves(self) -> tuple[Circle, Circle]:
        (r0, z0), (r1, z1) = self.section.profile(np.array([0.0, 1.0])).tolist()
        return self._make_circle(r0, z0), self._make_circle(r1, z1)

    def _make_circle(self, radius: float, height: float) -> Circle:
        frame = self.section.frame
        return Circle(LocalFrame(frame.origin + height * frame.axes[2], frame.axes), radius)

    @property
    def first_section(self) -> Curve:
        return self.section.place_profile()

    @property
    def last_section(self) -> Curve:
        return self.section.place_profile(self.section.turn)

    def __call__(self, s: Array, v: Array) -> Array:
        return self.jet(s, v, 0)[0, 0]

    def jet(self, s: Array, v: Array, order: int) -> Array:
        s, v = np.broadcast_arrays(s, v)
        x, y, z = self.section.frame.axes
        out = np.zeros((order + 1, order + 1, *s.shape, 3))
        for j in range(order + 1):
            radius, height = np.moveaxis(self.section.profile(v, j), -1, 0)
            for i in range(order + 1 - j):
                angle = s + i * np.pi / 2
                out[i, j] = radius[..., None] * (np.cos(angle)[..., None] * x + np.sin(angle)[..., None] * y)
            out[0, j] += height[..., None] * z
        out[0, 0] += self.section.frame.origin
        return out

    def to_rail_parameters(self, s: Array) -> Array:
        return self.section.map_to_parameters(s)

    def cut_with_plane(self, plane: Plane, near: float) -> Curve | None:
        """Return the section in a plane that the axis lies in."""
        frame, normal = self.section.frame, plane.frame.axes[2]
        profile = self.first_section
        offset = float((plane.frame.origin - frame.origin) @ normal)
        size = float(np.abs(profile.coefs).max())
        tilt = abs(float(frame.axes[2] @ normal)) * size
        if profile.rational or max(tilt, abs(offset)) > NETWORK_TOLERANCES.section_plane * size:
            return None
        angle = float(np.arctan2(-(frame.axes[0] @ normal), frame.axes[1] @ normal))
        angle += np.pi * np.round((near - angle) / np.pi)
        cos, sin = np.cos(angle), np.sin(angle)
        arms = profile.coefs - frame.origin[:, None]
        x, y, z = (np.einsum("qkn,k->qn", arms, axis) for axis in frame.axes)
        local = np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=1)
        points = frame.origin[:, None] + np.einsum("qan,ak->qkn", local, frame.axes)
        return _collect_section(profile.breaks, np.full(x.shape, angle), points, plane)


def _collect_section(breaks: Array, s: Array, points: Array, plane: Plane) -> Curve:
    """Return the curve v -> (s, v, a, b, x, y, z) of coefficients s (q + 1, n) and points (q + 1, 3, n)."""
    degree = len(s) - 1
    v = breaks[:-1] + np.arange(degree + 1)[:, None] / degree * np.diff(breaks)
    on_plane = np.einsum("qkn,ak->qan", points - plane.frame.origin[:, None], plane.frame.axes[:2])
    return Curve(breaks, np.concatenate([s[:, None], v[:, None], on_plane, points], axis=1))
