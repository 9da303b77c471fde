"""Ends of two strips past a sharp edge about which their ball turns, from the end section of one to that of the other.

Where the rails on the common face run apart past the vertex, or cross far from it, there is no mitre. The ball then
stays in touch with the common plane and with the sharp edge, which stands square on it: its section turns about that
edge. Both strips are smooth with that face, which has the new end of the sharp edge for a pole.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.network.blend_plan import (
    EdgeUse,
    FacePlan,
    NewEdge,
    PatchPlan,
    PlannedPcurve,
    PlannedSurface,
    PlannedVertex,
)
from cqblend.blends.sections.revolved_section import RevolvedSection
from cqblend.brep.shell_editing.corner_plan import CornerPlan
from cqblend.brep.shell_editing.mitred_strip import MitredStrip, find_sharp_edge
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim
from cqblend.brep.shell_editing.strip_end import StripEnd
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import find_outgoing_tangent, locate_vertex
from cqblend.errors import TopologyError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.circle import Circle, PlanarCircle
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.vectors import LocalFrame, normalise_vectors


def turn_ends(first: MitredStrip, second: MitredStrip) -> CornerPlan:
    """Plan the turn from the end of one strip to that of the other, counter-clockwise about the sharp edge.

    Raises
    ------
    TopologyError
        If the sections do not turn into one another.
    """
    return _Turn(first, second).plan_corner()


@dataclass(frozen=True)
class _EndSection:
    """The section in which a strip ends, from its rail on the common face on: v -> C on [0, 1], and its t."""

    strip: MitredStrip
    t: float
    curve: Curve

    @classmethod
    def at_end(cls, strip: MitredStrip) -> _EndSection:
        """Return the section at the end of the edge of a strip."""
        t = strip.placement.blend.surface.domain[0][strip.end]
        curve = strip.placement.blend.surface.isoparametric(u=t)
        return cls(strip, t, curve if strip.common == 0 else curve.reverse())

    @property
    def parameter(self) -> float:
        """The parameter s of the strip, which ends there."""
        return self.strip.placement.domain[self.strip.end]

    def evaluate_rates(self, v: Array) -> Array:
        """Return the derivatives of the strip along its edge at points (n, 3) of the section."""
        own = v if self.strip.common == 0 else 1 - v
        return self.strip.placement.blend.surface(np.full(len(v), self.t), own, 1, 0)

    def plan_edge(self, surface: PlannedSurface, angle: float, corners: tuple[PlannedVertex, PlannedVertex]) -> NewEdge:
        """Plan its edge, from the common face on, which lies at an angle of the turned face."""
        v = (0.0, 1.0) if self.strip.common == 0 else (1.0, 0.0)
        own = Curve.bezier([(self.t, v[0]), (self.t, v[1])])
        placement = self.strip.placement
        pcurves = (
            placement.plan_pcurve(placement.strip.map_curve_from_blend(own)),
            PlannedPcurve(surface, Curve.bezier([(angle, 0.0), (angle, 1.0)])),
        )
        return NewEdge("section", self.curve, (0.0, 1.0), corners, pcurves, 1)


class _Turn:
    """The sections of two strips, of which one turns into the other about the sharp edge."""

    def __init__(self, first: MitredStrip, second: MitredStrip) -> None:
        self.first, self.second = _EndSection.at_end(first), _EndSection.at_end(second)
        self.sharp_edge = find_sharp_edge(first, second)
        common = first.common_face
        origin = locate_vertex(first.vertex)
        ends = [section.curve(np.zeros(1))[0] - origin for section in (self.first, self.second)]
        if not isinstance(common.face_primary, Plane):
            raise _make_error("the face between them is no plane")
        self.plane = common.face_primary
        axis = self.plane.frame.axes[2] * common.outward
        tangent = find_outgoing_tangent(first.vertex, self.sharp_edge)
        if np.linalg.norm(np.cross(tangent, axis)) > SHELL_EDIT_TOLERANCES.square_edge:
            raise _make_error("it does not stand square on the face between them")
        x = normalise_vectors(ends[0] - (ends[0] @ axis) * axis)
        self.frame = LocalFrame(origin, np.stack([x, np.cross(axis, x), axis]))
        across = self.frame.axes @ ends[1]
        self.angle = float(np.arctan2(across[1], across[0]))
        self.radius = float(np.linalg.norm(ends[0]))
        if self.angle <= SHELL_EDIT_TOLERANCES.square_edge:
            raise _make_error("they run into each other before it")
        self.surface = PlannedSurface(self._turn_section())

    def _turn_section(self) -> RevolvedSection:
        """Return the first section turned about the sharp edge.

        Raises
        ------
        TopologyError
            If the second one is not the same, or a strip is not smooth with that.
        """
        x, _, axis = self.frame.axes
        curve = self.first.curve
        weight = curve.coefs[:, 3:] if curve.rational else np.ones_like(curve.coefs[:, :1])
        arms = curve.coefs[:, :3] - weight * self.frame.origin[:, None]
        parts = [np.einsum("qkn,k->qn", arms, direction)[:, None] for direction in (x, axis)]
        coefs = np.concatenate([*parts, weight] if curve.rational else parts, axis=1)
        profile = Curve(curve.breaks, coefs, rational=curve.rational, continuity=curve.continuity)
        turned = RevolvedSection(profile, self.frame, np.array([0.0, 1.0]), np.array([0.0, self.angle]), 0.0)
        v = np.linspace(0.0, 1.0, SHELL_EDIT_TOLERANCES.shared_rail_samples)
        for section, angle in ((self.first, 0.0), (self.second, self.angle)):
            apart = np.abs(turned.place_profile(angle)(v) - section.curve(v)).max()
            if apart > SHELL_EDIT_TOLERANCES.curve_fit:
                raise _make_error(f"the sections in which they end there differ by {apart:.2g} mm")
            around = np.cross(axis, np.cos(angle) * x + np.sin(angle) * self.frame.axes[1])
            sines = np.linalg.norm(np.cross(normalise_vectors(section.evaluate_rates(v)), around), axis=1)
            if sines.max() > SHELL_EDIT_TOLERANCES.square_edge:
                raise _make_error(f"they arrive at it oblique by {sines.max():.2g} rad")
        return turned

    def plan_corner(self) -> CornerPlan:
        """Return the ends of both strips, and the face between."""
        first, second = self.first, self.second
        corners = [PlannedVertex(section.curve(np.zeros(1))[0]) for section in (first, second)]
        pole = PlannedVertex(first.curve(np.ones(1))[0])
        sections = [
            section.plan_edge(self.surface, angle, (corner, pole))
            for section, angle, corner in ((first, 0.0, corners[0]), (second, self.angle, corners[1]))
        ]
        arc = self._plan_arc((corners[0], corners[1]))
        span = (0.0, self.angle)
        at_pole = PlannedPcurve(self.surface, Curve.bezier([(0.0, 1.0), (self.angle, 1.0)], domain=span))
        pole_edge = NewEdge("pole", None, span, (pole, pole), (at_pole,))
        strip = first.strip
        number = strip.placement.index.vertices.find_number(strip.vertex)
        spines = tuple(one.placement.spine_numbers[-one.end] for one in (first.strip, second.strip))
        boundary = (EdgeUse(arc), EdgeUse(sections[1]), EdgeUse(pole_edge, False), EdgeUse(sections[0], False))
        faces = (strip.wall_face.face, second.strip.wall_face.face)
        trim = EdgeTrim(strip.placement, strip.end, self.sharp_edge, strip.vertex, pole, faces)
        common = FacePlan(strip.common_number, added=(EdgeUse(arc, strip.enters_by(strip.common)),))
        ends = (
            _make_end(first, sections[0], (corners[0], pole), (trim,), (common,)),
            _make_end(second, sections[1], (corners[1], pole)),
        )
        patch = PatchPlan(number, spines, self.surface, boundary)
        return CornerPlan("turn", ends, (patch,))

    def _plan_arc(self, corners: tuple[PlannedVertex, PlannedVertex]) -> NewEdge:
        """Plan the edge between the common face and the turned one."""
        span, plane = (0.0, self.angle), self.plane.frame
        centre = plane.axes[:2] @ (self.frame.origin - plane.origin)
        on_plane = PlanarCircle(centre, self.frame.axes[:2] @ plane.axes[:2].T, self.radius)
        on_surface = Curve.bezier([(0.0, 0.0), (self.angle, 0.0)], domain=span)
        pcurves = (
            PlannedPcurve(self.first.strip.common_number, on_plane),
            PlannedPcurve(self.surface, on_surface),
        )
        return NewEdge("corner curve", Circle(self.frame, self.radius), span, corners, pcurves, 1)


def _make_error(reason: str) -> TopologyError:
    """Return the error of two blends between which there can be neither a mitre nor a turn."""
    return TopologyError(
        "the rails of the two blends do not cross on the face between them, or far from their edges, and the blends "
        f"cannot turn into each other about the sharp edge there: {reason}"
    )


def _make_end(
    section: _EndSection,
    edge: NewEdge,
    corners: tuple[PlannedVertex, PlannedVertex],
    trims: tuple[EdgeTrim, ...] = (),
    plans: tuple[FacePlan, ...] = (),
) -> StripEnd:
    """Return the end of a strip in its section; the edge and its corners are given from the common face on."""
    strip = section.strip
    use = EdgeUse(edge, strip.common == 0)
    vertex = strip.placement.keep_vertex(strip.vertex)
    return StripEnd((use,), strip.order(corners), (section.parameter,) * 2, vertex, trims, plans)
