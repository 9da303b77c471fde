"""Corners that a ball fits into: one face on a sphere, between the arcs in which the strips of that ball end.

The ball that rolls along every blended edge of a vertex comes to rest where it touches all faces there. Each strip ends
in the section through the ball's centre, a great circle, and the rails of two neighbours in one point of contact.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cqblend.blends.network.arc_strip import ArcStrip
from cqblend.blends.network.blend_plan import (
    EdgeUse,
    NewEdge,
    PatchPlan,
    PlannedPcurve,
    PlannedSurface,
    PlannedVertex,
)
from cqblend.brep.shell_editing.corner_plan import CornerPlan
from cqblend.brep.shell_editing.corner_sides import CornerStrip, cross_all_rails, require_faces_between, require_reach
from cqblend.brep.shell_editing.strip_end import PlacedEnd, StripEnd
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines import Curve
from cqblend.splines.approximation import approximate_curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.circle import Circle
from cqblend.surfaces.quadrics import Sphere
from cqblend.surfaces.vectors import LocalFrame, cross_product, normalise_vectors


def rest_ball(ends: Sequence[PlacedEnd]) -> CornerPlan:
    """Plan the sphere between strips of one ball that touches all faces of the vertex.

    Raises
    ------
    GeometryError
        If there is no such ball.
    TopologyError
        If the strips do not meet on the faces between them.
    """
    strips = [CornerStrip(end) for end in ends]
    require_faces_between(strips)
    arcs = [strip.placement.strip for strip in strips]
    radius = arcs[0].section.radius if isinstance(arcs[0], ArcStrip) else 0.0
    if not all(isinstance(arc, ArcStrip) and arc.section.radius == radius for arc in arcs):
        raise GeometryError("no ball rests in the corner: the blends there are not arcs of one radius")
    if len({strip.placement.joint.is_convex for strip in strips}) > 1:
        raise GeometryError("no ball rests in the corner: some of its edges are convex, others concave")
    crossings = cross_all_rails(strips)
    stops = [np.array([crossings[k - 1].parameters[1], one.parameters[0]]) for k, one in enumerate(crossings)]
    require_reach(strips, [Curve.bezier(np.stack([t, [0.0, 1.0]], axis=1)) for t in stops])
    vertices = [PlannedVertex(crossing.point) for crossing in crossings]
    sections = [
        _EndSection(strip, float(t.mean()), (vertices[k - 1], vertices[k]))
        for k, (strip, t) in enumerate(zip(strips, stops, strict=True))
    ]
    centres = np.array([section.circle.frame.origin for section in sections])
    centre = centres.mean(axis=0)
    off = max(float(np.abs(centres - centre).max()), *(section.measure_gap() for section in sections))
    if not off <= SHELL_EDIT_TOLERANCES.resting_ball * max(radius, float(np.abs(centres).max())):
        raise GeometryError(
            f"no ball of radius {radius:.6g} touches all faces of the corner: it would have to be in places {off:.2g} "
            "mm apart",
            kind="ball",
            value=off,
        )
    return _plan_sphere(sections, _place_sphere(centre, radius, np.array([vertex.point for vertex in vertices])))


class _EndSection:
    """The section in which a strip ends, at the parameter t of its rails; ``vertices`` are in the sense of the hole."""

    def __init__(self, strip: CornerStrip, t: float, vertices: tuple[PlannedVertex, PlannedVertex]) -> None:
        self.strip = strip
        self.placement = strip.placement
        self.s = float(self.placement.strip.map_from_blend(np.array([[t, 0.0]]))[0, 0])
        self.vertices = vertices if strip.end else vertices[::-1]  # from rail 1 to rail 2
        section = self.placement.strip.locate_section(self.s)
        if not isinstance(section.curve, Circle):
            raise TypeError("the section of a strip of arcs is a circle")
        self.circle, self.span, self.make_pcurve = section.curve, section.span, section.make_pcurve

    def measure_gap(self) -> float:
        """Return how far (mm) its ends are from the vertices."""
        points = np.stack([vertex.point for vertex in self.vertices])
        return float(np.linalg.norm(self.circle(np.array(self.span)) - points, axis=1).max())

    def plan_edge(self, on_sphere: PlannedPcurve) -> NewEdge:
        """Plan its edge."""
        pcurves = self.placement.plan_pcurve(self.make_pcurve(self.s)), on_sphere
        return NewEdge("section", self.circle, self.span, self.vertices, pcurves, 1)


def _plan_sphere(sections: Sequence[_EndSection], sphere: Sphere) -> CornerPlan:
    """Plan the face on a sphere between the sections in which strips end."""
    surface = PlannedSurface(sphere)
    ends, boundary = [], []
    for section in sections:
        on_sphere = PlannedPcurve(surface, _fit_on_sphere(sphere, section.circle, section.span))
        edge = section.plan_edge(on_sphere)
        boundary.append(EdgeUse(edge, section.strip.end == 1))
        vertex = section.placement.keep_vertex(section.strip.vertex)
        ends.append(StripEnd((EdgeUse(edge),), section.vertices, (section.s, section.s), vertex))
    first = sections[0].placement
    patch = PatchPlan(
        first.index.vertices.find_number(sections[0].strip.vertex),
        tuple(section.placement.spine_numbers[-section.strip.end] for section in sections),
        surface,
        tuple(boundary),
        is_inverted=not first.joint.is_convex,
    )
    return CornerPlan("ball", tuple(ends), (patch,))


def _place_sphere(centre: Array, radius: float, points: Array) -> Sphere:
    """Return a sphere whose poles and seam are far from points (n, 3) of it.

    Raises
    ------
    GeometryError
        If they go all around it.
    """
    directions = normalise_vectors(points - centre)
    middle = directions.mean(axis=0)
    if not np.linalg.norm(middle) > SHELL_EDIT_TOLERANCES.least_ball_side:
        raise GeometryError("the ball that rests in the corner would be seen from all around")
    middle = normalise_vectors(middle)
    across = normalise_vectors(cross_product(middle, np.eye(3)[np.abs(middle).argmin()]))
    turns = np.pi * np.arange(SHELL_EDIT_TOLERANCES.ball_axes) / SHELL_EDIT_TOLERANCES.ball_axes
    axes = np.cos(turns)[:, None] * across + np.sin(turns)[:, None] * cross_product(middle, across)
    axis = axes[np.abs(directions @ axes.T).max(axis=0).argmin()]
    frame = LocalFrame(centre, np.stack([-middle, cross_product(axis, -middle), axis]))
    return Sphere(frame, radius, axis)


def _fit_on_sphere(sphere: Sphere, circle: Circle, span: tuple[float, float]) -> Curve:
    """Return the parameters on a sphere of a curve on it, far from its poles and its seam."""

    def locate_points(t: Array) -> Array:
        x, y, z = ((circle(t) - sphere.frame.origin) @ sphere.frame.axes.T).T
        return np.stack([np.mod(np.arctan2(y, x), 2 * np.pi), np.arctan2(z, np.hypot(x, y))], axis=1)

    breaks = np.linspace(*span, SHELL_EDIT_TOLERANCES.ball_arc_spans + 1)
    return approximate_curve(locate_points, breaks, SHELL_EDIT_TOLERANCES.ball_arc_fit)
