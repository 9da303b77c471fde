"""Arcs of a ball that turns in place: a piece of a sphere between one point of it and a great circle.

Where a ball stands still, touching one face at a point and a round face along a section, its arcs from that point to
that section are great circles, and their openings vary unless the section lies across the line from point to centre.
The piece of the sphere has its pole in the point, so that the arcs are meridians.

As a spline it is the stereographic image, from the opposite pole, of a fan of straight lines: with N / w the image of
the great circle, both quadratic in t, the unit vectors from the centre are, in homogeneous coordinates of the pole's
frame, (2 v N w, w^2 - v^2 |N|^2) over w^2 + v^2 |N|^2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets
from cqblend.blends.sections.tolerances import SECTION_TOLERANCES
from cqblend.errors import UnsupportedError
from cqblend.splines import Surface, bernstein
from cqblend.splines.bernstein import Array
from cqblend.surfaces.angles import locate_on_rational_arcs, measure_rational_arcs
from cqblend.surfaces.circle import Circle
from cqblend.surfaces.quadrics import Sphere
from cqblend.surfaces.vectors import LocalFrame, cross_product, measure_lengths, normalise_vectors


@dataclass(frozen=True)
class TurnedArcs:
    """A blend by the arcs of a ball that turns in place, as a sphere, and where on it the blend is.

    Attributes
    ----------
    surface
        The sphere. Its north pole is the rail that is a point, and the rail that is a circle runs eastwards or
        westwards, as ``sense`` (1 or -1) tells, from or to the longitude 0.
    rail
        The other rail, a great circle by its angle s from 0.
    pole_end
        Which rail is the point: that at v = 0 or at v = 1.
    stops, breaks
        The values of s at the ends of the rational arcs that the circle consists of, from 0, (n + 1,); and the
        parameters t of the rails there, (n + 1,).
    """

    surface: Sphere
    rail: Circle
    pole_end: Literal[0, 1]
    sense: float
    stops: Array
    breaks: Array

    is_straight = False

    @property
    def radius(self) -> float:
        """The radius of the ball (mm)."""
        return self.surface.radius

    @property
    def length(self) -> float:
        """The largest s."""
        return float(self.stops[-1])

    @cached_property
    def least_opening(self) -> float:
        """The least angle of an arc (rad), at an end or where the circle is nearest to the pole."""
        _, second, first = self._rail_axes
        nearest = float(np.arctan2(second @ self._pole, first @ self._pole))
        s = np.array([0.0, self.length, np.clip(nearest % (2 * np.pi), 0.0, self.length)])
        return float(self.measure_openings(s).min())

    @property
    def is_mirrored(self) -> bool:
        """Whether (s, v) run around each other in the opposite sense to longitude and latitude."""
        return (self.sense > 0) == (self.pole_end == 0)

    @property
    def _pole(self) -> Array:
        return np.asarray(self.surface.frame.axes[2])

    @property
    def _rail_axes(self) -> tuple[Array, Array, Array]:
        """The normal of the rail's plane, and the unit vectors to its points at a quarter of a turn and at 0."""
        x, y, z = self.rail.frame.axes
        return z, y, x

    def measure_openings(self, s: Array) -> Array:
        """Return the angles (n,) of the arcs at s (n,)."""
        return np.asarray(np.pi / 2 - self._locate_rail(s)[1])

    def _locate_rail(self, s: Array) -> tuple[Array, Array]:
        """Return longitudes and latitudes (n,) of the rail that is a circle, at s (n,)."""
        _, second, first = self._rail_axes
        towards = np.multiply.outer(np.cos(s), first) + np.multiply.outer(np.sin(s), second)
        east, north, up = np.moveaxis(towards @ self.surface.frame.axes.T, -1, 0)
        longitude = np.arctan2(north, east)
        # from the first longitude to the last, which are 0 or more: rounding may have 0 a little less
        longitude = np.where(longitude < -SECTION_TOLERANCES.longitude_slack, longitude + 2 * np.pi, longitude)
        return longitude, np.arctan2(up, np.hypot(east, north))

    def _share_from_pole(self, v: Array) -> tuple[Array, float]:
        """Return the share (n,) of the way from the pole to the circle at v (n,), and its derivative."""
        return (v, 1.0) if self.pole_end == 0 else (1 - v, -1.0)

    def map_to_surface(self, s: Array, v: Array) -> Array:
        """Return longitudes and latitudes (n, 2) at s and v, (n,) each."""
        longitude, latitude = self._locate_rail(s)
        return np.stack([longitude, np.pi / 2 - self._share_from_pole(v)[0] * (np.pi / 2 - latitude)], axis=-1)

    def map_from_surface(self, uv: Array) -> tuple[Array, Array]:
        """Return s and v, (n,) each, at longitudes and latitudes (n, 2).

        The meridian plane of a longitude meets the plane of the circle where s is.
        """
        x, y, _ = self.surface.frame.axes
        across = np.multiply.outer(-np.sin(uv[..., 0]), x) + np.multiply.outer(np.cos(uv[..., 0]), y)
        _, second, first = self._rail_axes
        s = np.arctan2(-(across @ first) * self.sense, (across @ second) * self.sense)
        s = np.where(s < -SECTION_TOLERANCES.longitude_slack, s + 2 * np.pi, s)
        share = (np.pi / 2 - uv[..., 1]) / self.measure_openings(s)
        return s, share if self.pole_end == 0 else 1 - share

    def map_to_parameters(self, s: Array) -> Array:
        """Return the parameters t (n,) of the rails at s (n,)."""
        return locate_on_rational_arcs(s, self.stops, self.breaks)

    def map_from_spline(self, t: Array, v: Array) -> Array:
        """Return s and v, (n, 2), at parameters (n,) of the rational spline that is the same surface."""
        s = measure_rational_arcs(t, self.stops, self.breaks)
        half, (share, _) = self.measure_openings(s) / 2, self._share_from_pole(v)
        across, _ = self._share_from_pole(np.arctan(share * np.tan(half)) / half)
        return np.stack([s, across], axis=-1)

    def map_to_spline(self, s: Array, v: Array) -> Array:
        """Return the parameters (n, 2) of the rational spline that is the same surface, at s and v, (n,) each."""
        half, (share, _) = self.measure_openings(s) / 2, self._share_from_pole(v)
        across, _ = self._share_from_pole(np.tan(share * half) / np.tan(half))
        return np.stack([self.map_to_parameters(s), across], axis=-1)

    def jet(self, s: Array, v: Array, order: int) -> Array:
        """Return all partial derivatives by s and v up to a total order, 2 at most, (order + 1, order + 1, n, 3)."""
        normal, second, first = self._rail_axes
        along = np.multiply.outer(np.cos(s), second) - np.multiply.outer(np.sin(s), first)
        latitude, (share, rate) = self._locate_rail(s)[1], self._share_from_pole(v)
        cosine, sine, turn = np.cos(latitude), np.sin(latitude), float(normal @ self._pole)
        rise = along @ self._pole / cosine
        u1, u2 = turn / cosine**2, 2 * turn * sine / cosine**3 * rise
        opening, fall, bend = np.pi / 2 - latitude, rise, sine / cosine * (rise**2 - 1)
        vs, vss, vv, vsv = share * fall, share * bend, -rate * opening, rate * fall
        point, su, sv, suu, suv, svv = self.surface.jet(self.map_to_surface(s, v))

        def combine(*terms: tuple[Array, Array]) -> Array:
            return np.asarray(sum(factor[..., None] * vector for factor, vector in terms))

        out = np.zeros((order + 1, order + 1, *s.shape, 3))
        out[0, 0] = point
        if order >= 1:
            out[1, 0], out[0, 1] = combine((u1, su), (vs, sv)), combine((vv, sv))
        if order >= 2:
            out[2, 0] = combine((u1**2, suu), (2 * u1 * vs, suv), (vs**2, svv), (u2, su), (vss, sv))
            out[1, 1] = combine((u1 * vv, suv), (vs * vv, svv), (vsv, sv))
            out[0, 2] = combine((vv**2, svv))
        return out

    def build_rational_net(self) -> Array:
        """Return the homogeneous Bernstein coefficients (5, 3, 4, n, 1) of the spline."""
        frame, (_, second, first) = self.surface.frame, self._rail_axes
        step = np.diff(self.stops) / 2
        angles = self.stops[:-1] + np.multiply.outer(np.arange(3), step)  # (3, n)
        weight = np.stack([np.ones_like(step), np.cos(step), np.ones_like(step)])
        towards = np.multiply.outer(np.cos(angles), first) + np.multiply.outer(np.sin(angles), second)
        east, north, up = np.moveaxis(towards @ frame.axes.T, -1, 0)
        multiply, w = bernstein.multiply_polynomials, weight + up
        square, image = multiply(w, w), multiply(east, east) + multiply(north, north)
        zero = np.zeros_like(square)
        still = np.stack([zero, zero, square, square])
        linear = np.stack([2 * multiply(east, w), 2 * multiply(north, w), zero, zero])
        quadratic = np.stack([zero, zero, -image, image])
        rows = np.stack([still, still + linear / 2, still + linear + quadratic])  # (3, 4, 5, n)
        if self.pole_end == 1:
            rows = rows[::-1]
        rows = rows / square[0, 0]
        xyz = self.radius * np.einsum("ikpn,kd->idpn", rows[:, :3], frame.axes)
        xyz += np.einsum("ipn,d->idpn", rows[:, 3], frame.origin)
        return np.moveaxis(np.concatenate([xyz, rows[:, 3:]], axis=1), 2, 0)[..., None]

    def make_surface(self) -> Surface:
        """Return the rational spline that the piece of the sphere is."""
        return Surface(
            (self.breaks, np.array([0.0, 1.0])),
            self.build_rational_net(),
            rational=True,
            continuity=(np.zeros(len(self.breaks) - 2, int), np.empty(0, int)),
        )


def find_turned_arcs(ribbons: tuple[Ribbon, Ribbon], radius: float) -> TurnedArcs:
    """Return the arcs of a ball between a ribbon whose rail is a point and one whose rail is a circle.

    Raises
    ------
    UnsupportedError
        If these are not on one ball, to rounding.
    """
    pole_end: Literal[0, 1] = 0 if ribbons[0].is_point else 1
    still, turning = ribbons[pole_end], ribbons[1 - pole_end]
    breaks = turning.c.breaks
    t = np.interp(np.arange(4 * len(breaks) - 3) / 4, np.arange(len(breaks)), breaks)
    uv = turning.find_native_parameters(t)
    points, normals = turning.primary.jet(uv)[0], turning.primary.evaluate_normals(uv)
    pole = dehomogenise_jets(still.primary.compose_position(still.c)(t[:1])[None])[0, 0]
    sign = np.sign((normals[0] * (pole - points[0])).sum())
    centres = points + sign * radius * normals
    centre = centres.mean(axis=0)
    size = max(radius, float(np.abs(points).max()))
    off = max(float(np.abs(centres - centre).max()), abs(float(np.linalg.norm(pole - centre)) - radius))
    if not off <= SECTION_TOLERANCES.arc_deviation * size:
        raise UnsupportedError(f"its sections are off the arcs of one ball by {off:.2g} mm")
    arms = normalise_vectors(points - centre)
    normal = normalise_vectors(cross_product(arms[:-1], arms[1:]).sum(axis=0))
    if np.abs(arms @ normal).max() > SECTION_TOLERANCES.arc_deviation * size / radius:
        raise UnsupportedError("its contacts are on no great circle of the ball")
    up = normalise_vectors(pole - centre)
    sense = float(np.sign(normal @ up))
    start = arms[0 if sense > 0 else -1]
    x = normalise_vectors(start - (start @ up) * up)
    frame = LocalFrame(centre, np.stack([x, cross_product(up, x), up]))
    first = normalise_vectors(arms[0] - (arms[0] @ normal) * normal)
    rail = Circle(LocalFrame(centre, np.stack([first, cross_product(normal, first), normal])), radius)
    turns = np.arctan2(measure_lengths(cross_product(arms[:-1:4], arms[4::4])), (arms[:-1:4] * arms[4::4]).sum(axis=1))
    stops = np.append(0.0, np.cumsum(turns))
    return TurnedArcs(Sphere(frame, radius, up), rail, pole_end, sense, stops, breaks)
