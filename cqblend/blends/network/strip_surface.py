"""The surface of a strip as it goes into the solid: a spline, or a profile that is turned about an axis.

Both have v from 0 on the first rail to 1 on the second. Along a spline, the parameter is that of the rails, t; around
an axis, it is the angle (rad) from the first section. Edges of the strip are planned in these parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from cqblend.blends.sections.revolved_section import RevolvedSection
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.surfaces.circle import Circle
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

    def __call__(self, s: Array, v: Array) -> Array:
        """Return points (n, 3) at parameters (n,)."""

    def jet(self, s: Array, v: Array, order: int) -> Array:
        """Return all partial derivatives up to a total order, (order + 1, order + 1, n, 3)."""

    def from_rail_parameters(self, t: Array) -> Array:
        """Return s (n,) at parameters t (n,) of the rails."""

    def to_rail_parameters(self, s: Array) -> Array:
        """Return the parameters t (n,) of the rails at s (n,)."""


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

    def __call__(self, s: Array, v: Array) -> Array:
        return self.surface(s, v)

    def jet(self, s: Array, v: Array, order: int) -> Array:
        return self.surface.jet(s, v, order)

    def from_rail_parameters(self, t: Array) -> Array:
        return t

    def to_rail_parameters(self, s: Array) -> Array:
        return s


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

    def from_rail_parameters(self, t: Array) -> Array:
        return self.section.map_to_angles(t)

    def to_rail_parameters(self, s: Array) -> Array:
        return self.section.map_to_parameters(s)
