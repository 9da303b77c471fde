"""A strip of the arcs of a ball that turns in place, on a sphere: between one point of it and a great circle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.network.strip_surface import StripCut, StripSection, fit_mapped_curve
from cqblend.blends.network.tolerances import NETWORK_TOLERANCES
from cqblend.blends.sections.turned_arcs import TurnedArcs
from cqblend.splines import Curve
from cqblend.splines.approximation import approximate_curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.circle import Circle
from cqblend.surfaces.quadrics import Plane, Sphere
from cqblend.surfaces.vectors import LocalFrame, cross_product, normalise_vectors


@dataclass(frozen=True)
class TurnedStrip:
    """A strip between a pole of a sphere and a circle: :class:`~cqblend.blends.network.strip_surface.StripSurface`."""

    section: TurnedArcs

    @property
    def geometry(self) -> Sphere:
        return self.section.surface

    @property
    def domain(self) -> tuple[float, float]:
        return 0.0, self.section.length

    @property
    def is_mirrored(self) -> bool:
        return self.section.is_mirrored

    @property
    def rail_curves(self) -> tuple[Circle, Circle]:
        frame = self.geometry.frame
        pole = Circle(LocalFrame(frame.origin + self.geometry.radius * frame.axes[2], frame.axes), 0.0)
        return (pole, self.section.rail) if self.section.pole_end == 0 else (self.section.rail, pole)

    def locate_section(self, s: float) -> StripSection:
        jet = self.jet(np.array([s]), np.array([0.5]), 2)[:, :, 0]
        radius, half = self.section.radius, float(self.section.measure_openings(np.array([s]))[0]) / 2
        middle, along = -normalise_vectors(jet[0, 2]), normalise_vectors(jet[0, 1])
        x, y = np.cos(half) * middle - np.sin(half) * along, np.sin(half) * middle + np.cos(half) * along
        frame = LocalFrame(jet[0, 0] - radius * middle, np.stack([x, y, cross_product(x, y)]))
        return StripSection(Circle(frame, radius), (0.0, 2 * half))

    def map_to_surface(self, curve: Curve) -> Curve:
        """Return a curve in longitude and latitude: a line of a section, and of the pole; else fitted in them."""
        section, (low, high) = self.section, curve.domain
        ends = curve(np.array([low, high]))
        is_line = curve.degree == 1 and len(curve.breaks) == 2
        if is_line and (ends[0, 0] == ends[1, 0] or (ends[:, 1] == section.pole_end).all()):
            return Curve.bezier(section.map_to_surface(*ends.T), domain=(low, high))
        breaks = np.linspace(low, high, NETWORK_TOLERANCES.cut_spans + 1)
        return approximate_curve(lambda t: section.map_to_surface(*curve(t).T), breaks, NETWORK_TOLERANCES.turned_fit)

    def map_from_blend(self, tv: Array) -> Array:
        return self.section.map_from_spline(tv[:, 0], tv[:, 1])

    def map_curve_from_blend(self, curve: Curve) -> Curve:
        return fit_mapped_curve(self.map_from_blend, curve, self.section.breaks, self.section.length)

    def __call__(self, s: Array, v: Array) -> Array:
        return np.asarray(self.jet(s, v, 0)[0, 0])

    def jet(self, s: Array, v: Array, order: int) -> Array:
        s, v = np.broadcast_arrays(s, v)
        return self.section.jet(s, v, order)

    def to_rail_parameters(self, s: Array) -> Array:
        return self.section.map_to_parameters(s)

    def cut_with_plane(self, plane: Plane, near: float) -> StripCut | None:
        del plane, near  # a circle in space, but not in longitude and latitude
        return None
