"""A strip of arcs, on the cylinder, torus or sphere that a rolling ball leaves behind."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.network.strip_surface import StripCut, StripSection, find_meridian_angle, fit_mapped_curve
from cqblend.blends.network.tolerances import NETWORK_TOLERANCES
from cqblend.blends.sections.arc_section import ArcSection, BallSurface
from cqblend.splines import Curve
from cqblend.splines.approximation import approximate_curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.circle import Circle, PlanarCircle
from cqblend.surfaces.ellipse import Ellipse, PlanarEllipse
from cqblend.surfaces.line import Line
from cqblend.surfaces.primary_surface import JET_ORDERS
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.vectors import LocalFrame, cross_product, measure_lengths, normalise_vectors


@dataclass(frozen=True)
class ArcStrip:
    """A strip whose sections are arcs of one ball: :class:`~cqblend.blends.network.strip_surface.StripSurface`."""

    section: ArcSection

    @property
    def geometry(self) -> BallSurface:
        return self.section.surface

    @property
    def domain(self) -> tuple[float, float]:
        return 0.0, self.section.length

    @property
    def is_mirrored(self) -> bool:
        return self.section.is_mirrored

    @property
    def rail_curves(self) -> tuple[Line | Circle, Line | Circle]:
        section, ends = self.section, np.array([0.0, 1.0])
        first, second = section.surface.jet(section.map_to_surface(np.zeros(2), ends))[0]
        frame = section.surface.frame
        if section.is_straight:
            along = section.along[1] * frame.axes[2]
            return Line(first, along), Line(second, along)

        def make_circle(point: Array) -> Circle:
            radius, _, height = frame.axes @ (point - frame.origin)
            return Circle(LocalFrame(frame.origin + height * frame.axes[2], frame.axes), float(radius))

        return make_circle(first), make_circle(second)

    def locate_section(self, s: float) -> StripSection:
        return StripSection(self._make_circle(s), (0.0, self.section.opening))

    def _make_circle(self, s: float) -> Circle:
        """Return the circle of the ball at s, by the angle from rail 1 towards rail 2."""
        jet = self.jet(np.array([s]), np.zeros(1), 2)[:, :, 0]
        x, y = -normalise_vectors(jet[0, 2]), normalise_vectors(jet[0, 1])
        radius = self.section.radius
        return Circle(LocalFrame(jet[0, 0] - radius * x, np.stack([x, y, cross_product(x, y)])), radius)

    def __call__(self, s: Array, v: Array) -> Array:
        s, v = np.broadcast_arrays(s, v)
        return np.asarray(self.section.surface.jet(self.section.map_to_surface(s, v))[0])

    def jet(self, s: Array, v: Array, order: int) -> Array:
        """Return all partial derivatives up to a total order, 2 at most."""
        s, v = np.broadcast_arrays(s, v)
        section = self.section
        native = dict(zip(JET_ORDERS, section.surface.jet(section.map_to_surface(s, v)), strict=True))
        axis = int(np.abs(section.along).argmax())  # of the surface's own parameters, the one that runs along
        along, across = section.along[axis], section.across[1 - axis]
        out = np.zeros((order + 1, order + 1, *s.shape, 3))
        for i in range(order + 1):
            for j in range(order + 1 - i):
                out[i, j] = along**i * across**j * native[(j, i) if axis else (i, j)]
        return out

    def to_rail_parameters(self, s: Array) -> Array:
        return self.section.map_to_parameters(s)

    def map_from_blend(self, tv: Array) -> Array:
        return self.section.map_from_spline(tv[:, 0], tv[:, 1])

    def map_curve_from_blend(self, curve: Curve) -> Curve:
        return fit_mapped_curve(self.map_from_blend, curve, self.section.breaks, self.section.length)

    def map_to_surface(self, curve: Curve) -> Curve:
        section = self.section
        coefs = np.einsum("ak,qkn->qan", np.stack([section.along, section.across], axis=1), curve.coefs)
        return Curve(curve.breaks, coefs + section.start[:, None], continuity=curve.continuity)

    def cut_with_plane(self, plane: Plane, near: float) -> StripCut | None:
        """Return the circle or ellipse in which a plane cuts a cylinder, or a torus whose axis lies in it."""
        section, tolerance = self.section, NETWORK_TOLERANCES.arc_plane
        frame, normal = section.surface.frame, plane.frame.axes[2]
        if section.is_straight:
            cosine = float(frame.axes[2] @ normal)
            if abs(cosine) <= NETWORK_TOLERANCES.least_cut_sine:
                return None
            height = float((plane.frame.origin - frame.origin) @ normal) / cosine
            across = frame.axes[:2] @ normal
            if np.linalg.norm(across) > tolerance:
                return self._cut_obliquely(plane, height, across / cosine)
            s = section.along[1] * height
        else:
            radius = float(measure_lengths(self.jet(np.zeros(1), np.zeros(1), 1)[1, 0, 0]))
            angle = find_meridian_angle(frame, plane, near, radius, tolerance)
            if angle is None:
                return None
            s = angle
        circle, span = self._make_circle(s), (0.0, section.opening)
        centre, axes = _project_to_plane(plane, circle.frame)
        on_strip = Curve.bezier([(s, 0.0), (s, 1.0)], domain=span)
        return StripCut(circle, span, on_strip, PlanarCircle(centre, axes, section.radius))

    def _cut_obliquely(self, plane: Plane, height: float, slope: Array) -> StripCut:
        """Return the ellipse in which a plane cuts a cylinder.

        The plane meets the axis at ``height`` and falls by ``slope`` (2,) along the other axes of the frame. The
        parameter of the ellipse is the cylinder's angle, less that of the steepest way.
        """
        section, radius = self.section, self.section.radius
        frame, steepness = section.surface.frame, float(np.linalg.norm(slope))
        steepest = float(np.arctan2(slope[1], slope[0]))
        low, high = section.start[0] - steepest, section.start[0] - steepest + section.opening
        (x, y), z = np.array([slope, [-slope[1], slope[0]]]) / steepness @ frame.axes[:2], frame.axes[2]
        longer = float(np.hypot(1.0, steepness))
        x = (x - steepness * z) / longer
        placed = LocalFrame(frame.origin + height * z, np.stack([x, y, cross_product(x, y)]))
        radii = radius * longer, radius

        def locate_on_strip(t: Array) -> Array:
            s = section.along[1] * (height - radius * steepness * np.cos(t))
            return np.stack([s, (t - low) / section.opening], axis=-1)

        breaks = np.linspace(low, high, NETWORK_TOLERANCES.cut_spans + 1)
        size = max(1.0, abs(height) + radius * longer)  # of s; v is at most 1
        on_strip = approximate_curve(locate_on_strip, breaks, NETWORK_TOLERANCES.cut_fit * size)
        centre, axes = _project_to_plane(plane, placed)
        return StripCut(Ellipse(placed, radii), (low, high), on_strip, PlanarEllipse(centre, axes, radii))


def _project_to_plane(plane: Plane, frame: LocalFrame) -> tuple[Array, Array]:
    """Return the origin (2,) and the first two axes (2, 2) of a frame in the parameters of a plane that it lies in."""
    axes = plane.frame.axes[:2]
    return axes @ (frame.origin - plane.frame.origin), frame.axes[:2] @ axes.T
