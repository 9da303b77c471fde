"""Turns the axis of a sphere face to that of the rail, so that seam and poles stay clear of the rail.

A sphere face that ends at the blended edge alone may have its poles and its seam anywhere: next to the rail, where no
pcurve can be followed, or so that the seam falls into pieces, which OCCT's STEP reader does not survive. With the
rail's axis in place of its own, the same sphere keeps one pole, has one uncut seam from the rail's start to that pole,
and the rail's pcurve runs once around.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS_Edge

from cqblend.blends.network.blend_plan import EdgeUse, NewEdge, PlannedPcurve, PlannedSurface, PlannedVertex
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import explore_subshapes, find_seam_edges, is_among
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.circle import Circle
from cqblend.surfaces.quadrics import Sphere
from cqblend.surfaces.vectors import LocalFrame

SPHERE_BOUNDS = np.array([[0.0, 2 * np.pi], [-np.pi / 2, np.pi / 2]])
"""Longitude and latitude of a whole sphere."""


def realign_sphere(side: SupportFace, rail: Ribbon, blended: Sequence[TopoDS_Edge]) -> SupportFace | None:
    """Return a support face on a sphere with the rail's axis instead of its own, its seam at the rail's start.

    None if the face is not on a sphere whose axis is free, has other edges than the ``blended`` ones, or the rail does
    not run around its axis.
    """
    sphere = side.primary
    if not isinstance(sphere, Sphere) or not sphere.follows_latitude:
        return None
    own = [*find_seam_edges(side.face), *blended]
    for use in explore_subshapes(side.face, TopAbs_EDGE):
        if not BRep_Tool.Degenerated_s(use) and not is_among(use, own):
            return None
    t = np.linspace(*rail.c.domain, 129)
    longitudes = np.unwrap(sphere.unlift_points(rail.c(t), np.zeros((len(t), 2)))[:, 0])
    if abs(abs(longitudes[-1] - longitudes[0]) - 2 * np.pi) > SHELL_EDIT_TOLERANCES.full_turn:
        return None
    x, y, z = sphere.frame.axes
    start = longitudes[0]
    axes = np.array([np.cos(start) * x + np.sin(start) * y, np.cos(start) * y - np.sin(start) * x, z])
    turned = replace(sphere, frame=LocalFrame(sphere.frame.origin, axes))
    return replace(side, face_primary=turned, bounds=SPHERE_BOUNDS)


def plan_sphere_boundary(surface: PlannedSurface, rail_use: EdgeUse, into_blend: Array) -> tuple[EdgeUse, ...]:
    """Return the boundary of a realigned sphere: the rail's use, the seam, and the pole away from the blend.

    ``into_blend`` is the direction (3,) into the blend at the rail's start.
    """
    sphere = surface.geometry
    if not isinstance(sphere, Sphere):
        raise TypeError("only spheres are realigned")
    x, _, z = sphere.frame.axes
    corner = rail_use.start_vertex
    latitude = float(np.arcsin(np.clip((corner.point - sphere.frame.origin) @ z / sphere.radius, -1, 1)))
    is_north = float(into_blend @ z) < 0
    pole_latitude = np.pi / 2 if is_north else -np.pi / 2
    pole = PlannedVertex(sphere.frame.origin + np.sign(pole_latitude) * sphere.radius * z)
    vertices, span = (
        ((corner, pole), (latitude, pole_latitude)) if is_north else ((pole, corner), (pole_latitude, latitude))
    )
    meridian = Circle(LocalFrame(sphere.frame.origin, np.array([x, z, np.cross(x, z)])), sphere.radius)
    before, after = (
        Curve.bezier([(u, -np.pi / 2), (u, np.pi / 2)], domain=(-np.pi / 2, np.pi / 2)) for u in (0.0, 2 * np.pi)
    )
    seam = EdgeUse(NewEdge("seam", meridian, span, vertices, (PlannedPcurve(surface, after, before),)))
    around = Curve.bezier([(0.0, pole_latitude), (2 * np.pi, pole_latitude)], domain=(0.0, 2 * np.pi))
    point = EdgeUse(NewEdge("pole", None, (0.0, 2 * np.pi), (pole, pole), (PlannedPcurve(surface, around),)))
    if is_north:
        return rail_use, seam, point.reverse(), seam.reverse()
    return rail_use, seam.reverse(), point, seam
