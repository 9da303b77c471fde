"""Arcs as sections: the surface that a rolling ball leaves behind, where it is a cylinder, a torus or a sphere.

A ball of radius R that touches both faces all along leaves a surface whose sections are arcs of radius R between the
points of contact. It is a cylinder if the ball's centre moves along a straight line, a torus if it moves around an
axis, and a sphere if it stays where it is, on the axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.splines.bernstein import Array
from cqblend.surfaces.angles import locate_on_rational_arcs, measure_rational_arcs
from cqblend.surfaces.quadrics import Cylinder, Sphere
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse

BallSurface = Cylinder | Sphere | RevolvedEllipse
"""What a ball of one radius leaves behind, along a line or around an axis; the ellipse is a circle."""


@dataclass(frozen=True)
class ArcSection:
    """A blend by arcs as an analytic surface, and where on it the blend is.

    The blend H(s, v) is at the surface's own parameters ``start`` + s ``along`` + v ``across``, v from 0 on rail 1 to 1
    on rail 2. Along a line, s is the length from the first section (mm), around an axis, the angle from it (rad).

    Attributes
    ----------
    surface
        A cylinder, a torus or a sphere, in a right-handed frame. Around an axis, that is the third axis of the frame.
    radius
        The radius of the ball (mm).
    start, along, across
        As above, (2,) each. One number in ``along`` is 1 or -1, the other 0; in ``across``, one is the opening of the
        arc (rad) or the opposite, the other 0.
    stops, breaks
        The values of s at the ends of the rational arcs that circular rails consist of, or at the ends of straight
        ones, from 0, (n + 1,); and the parameters t of the rails there, (n + 1,).
    """

    surface: BallSurface
    radius: float
    start: Array
    along: Array
    across: Array
    stops: Array
    breaks: Array

    @property
    def length(self) -> float:
        """The largest s."""
        return float(self.stops[-1])

    @property
    def is_straight(self) -> bool:
        """Whether it is a cylinder."""
        return isinstance(self.surface, Cylinder)

    @property
    def opening(self) -> float:
        """The angle of the arc (rad)."""
        return float(np.abs(self.across).max())

    @property
    def least_opening(self) -> float:
        """The least angle of an arc (rad): that of all."""
        return self.opening

    @property
    def is_mirrored(self) -> bool:
        """Whether (s, v) run around each other in the opposite sense to the surface's own parameters."""
        return bool(self.along[0] * self.across[1] < self.along[1] * self.across[0])

    def map_to_surface(self, s: Array, v: Array) -> Array:
        """Return the surface's own parameters (n, 2) at s and v, (n,) each."""
        return self.start + np.multiply.outer(s, self.along) + np.multiply.outer(v, self.across)

    def map_from_surface(self, uv: Array) -> tuple[Array, Array]:
        """Return s and v, (n,) each, at the surface's own parameters (n, 2)."""
        s, v = np.linalg.solve(np.stack([self.along, self.across], axis=1), (uv - self.start).T)
        return s, v

    def map_to_parameters(self, s: Array) -> Array:
        """Return the parameters t (n,) of the rails at s (n,)."""
        if not self.is_straight:
            return locate_on_rational_arcs(s, self.stops, self.breaks)
        low, high = self.breaks
        return np.asarray(low + s / self.length * (high - low))

    def map_from_spline(self, t: Array, v: Array) -> Array:
        """Return s and v, (n, 2), at parameters (n,) of the rational spline that is the same surface."""
        if self.is_straight:
            low, high = self.breaks
            s = (t - low) / (high - low) * self.length
        else:
            s = measure_rational_arcs(t, self.stops, self.breaks)
        across = measure_rational_arcs(v, np.array([0.0, self.opening]), np.array([0.0, 1.0])) / self.opening
        return np.stack([s, across], axis=-1)

    def map_to_spline(self, s: Array, v: Array) -> Array:
        """Return the parameters (n, 2) of the rational spline that is the same surface, at s and v, (n,) each."""
        across = locate_on_rational_arcs(v * self.opening, np.array([0.0, self.opening]), np.array([0.0, 1.0]))
        return np.stack([self.map_to_parameters(s), across], axis=-1)
