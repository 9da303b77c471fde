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
from cqblend.brep.shell_editing.corner_sides import CornerStrip, cross_all_rails, require_faces_between
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
    stations = []
    for k, strip in enumerate(strips):
        t = np.array([crossings[k - 1].parameters[1], crossings[k].parameters[0]])
        stations.append(strip.placement.strip.map_from_blend(np.stack([t, [0.0, 1.0]], axis=1))[:, 0])
    circles = [arc.locate_section(float(s.mean())).curve for arc, s in zip(arcs, stations, strict=True)]
    centres = np.array([circle.frame.origin for circle in circles if isinstance(circle, Circle)])
    allowed = SHELL_EDIT_TOLERANCES.resting_ball * max(radius, float(np.abs(centres).max()))
    if not np.abs(centres - centres.mean(axis=0)).max() <= allowed:
        off = float(np.abs(centres - centres.mean(axis=0)).max())
        raise GeometryError(
            f"no ball of radius {radius:.6g} touches all faces of the corner: it would have to be in places {off:.2g} "
            "mm apart",
            kind="ball",
            value=off,
        )
    vertices = [PlannedVertex(crossing.point) for crossing in crossings]
    return _plan_sphere(strips, stations, vertices, centres.mean(axis=0))


def _plan_sphere(
    strips: Sequence[CornerStrip], stations: Sequence[Array], vertices: Sequence[PlannedVertex], centre: Array
) -> CornerPlan:
    """Plan the sphere about a centre; ``vertices`` are where strips and those after them meet."""
    radius = float(np.linalg.norm(vertices[0].point - centre))
    sphere = _place_sphere(centre, radius, np.array([vertex.point for vertex in vertices]))
    surface = PlannedSurface(sphere)
    ends, boundary = [], []
    for k, (strip, parameters) in enumerate(zip(strips, stations, strict=True)):
        placement, corners = strip.placement, (vertices[k - 1], vertices[k])
        if strip.end == 0:
            corners = corners[::-1]
        s = float(parameters.mean())
        section = placement.strip.locate_section(s)
        on_sphere = PlannedPcurve(surface, _fit_on_sphere(sphere, section.curve, section.span))
        pcurves = placement.plan_pcurve(section.make_pcurve(s)), on_sphere
        edge = NewEdge("section", section.curve, section.span, corners, pcurves, 1)
        boundary.append(EdgeUse(edge, strip.end == 1))
        vertex = placement.keep_vertex(placement.joint.spine.vertices[strip.end])
        ends.append(StripEnd((EdgeUse(edge),), corners, (s, s), vertex))
    is_inverted = not strips[0].placement.joint.is_convex
    first = strips[0].placement
    number = first.index.vertices.find_number(first.joint.spine.vertices[strips[0].end])
    spines = tuple(strip.placement.spine_numbers[-strip.end] for strip in strips)
    return CornerPlan("ball", tuple(ends), (PatchPlan(number, spines, surface, tuple(boundary), is_inverted),))


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


def _fit_on_sphere(sphere: Sphere, circle: Curve | Circle, span: tuple[float, float]) -> Curve:
    """Return the parameters on a sphere of a curve on it, far from its poles and its seam."""

    def locate_points(t: Array) -> Array:
        x, y, z = ((circle(t) - sphere.frame.origin) @ sphere.frame.axes.T).T
        return np.stack([np.mod(np.arctan2(y, x), 2 * np.pi), np.arctan2(z, np.hypot(x, y))], axis=1)

    breaks = np.linspace(*span, SHELL_EDIT_TOLERANCES.ball_arc_spans + 1)
    return approximate_curve(locate_points, breaks, SHELL_EDIT_TOLERANCES.ball_arc_fit)
