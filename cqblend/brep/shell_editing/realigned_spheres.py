"""Turns the axis of a sphere face to that of the rail, so that seam and poles stay clear of the rail.

A sphere face that ends at the blended edge alone may have its poles and its seam anywhere: next to the rail, where no
pcurve can be followed, or so that the seam falls into pieces, which OCCT's STEP reader does not survive. With the
rail's axis in place of its own, the same sphere keeps one pole, has one uncut seam from the rail's start to that pole,
and the rail's pcurve runs once around.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_SphericalSurface
from OCP.Geom2d import Geom2d_Line
from OCP.gp import gp_Ax3, gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Wire

from cqblend.blends.rails.ribbon import Ribbon
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import (
    BUILDER,
    attach_pcurves,
    explore_subshapes,
    find_end_vertices,
    find_seam_edges,
    is_among,
    locate_vertex,
    make_bare_face,
    make_closed_wire,
    make_degenerate_edge,
    make_edge,
    make_vertex,
    reverse_edge,
)
from cqblend.splines.bernstein import Array
from cqblend.surfaces.quadrics import Sphere
from cqblend.surfaces.vectors import LocalFrame

SPHERE_BOUNDS = np.array([[0.0, 2 * np.pi], [-np.pi / 2, np.pi / 2]])
"""Longitude and latitude of a whole sphere."""


@dataclass(frozen=True)
class RealignedSphere:
    """A support face on a sphere that has got the rail's axis: ``side.face`` has no boundary yet."""

    side: SupportFace
    sphere: Sphere


def realign_sphere(side: SupportFace, rail: Ribbon, blended: Sequence[TopoDS_Edge]) -> RealignedSphere | None:
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
    face = make_bare_face(_make_sphere_surface(turned))
    return RealignedSphere(replace(side, face=face, face_primary=turned, bounds=SPHERE_BOUNDS), turned)


def make_realigned_face(realigned: RealignedSphere, rail_use: TopoDS_Edge, into_blend: Array) -> TopoDS_Face:
    """Return the FORWARD face that a rail bounds on a realigned sphere.

    ``into_blend`` is the direction (3,) into the blend at the rail's start.
    """
    face = TopoDS.Face_s(realigned.side.face.EmptyCopied())
    BUILDER.Add(face, _make_boundary(face, realigned.sphere, rail_use, into_blend))
    return face


def _make_sphere_surface(sphere: Sphere) -> Geom_SphericalSurface:
    """Return a sphere as a surface of OCCT."""
    x, y, z = sphere.frame.axes
    position = gp_Ax3(gp_Pnt(*sphere.frame.origin.tolist()), gp_Dir(*z.tolist()), gp_Dir(*x.tolist()))
    if np.cross(x, y) @ z < 0:
        position.YReverse()
    return Geom_SphericalSurface(position, sphere.radius)


def _make_boundary(face: TopoDS_Face, sphere: Sphere, rail_use: TopoDS_Edge, into_blend: Array) -> TopoDS_Wire:
    """Return the boundary of a sphere face: the rail's use, the seam, and the pole away from the blend."""
    corner = find_end_vertices(rail_use)[0]
    normal = (locate_vertex(corner) - sphere.frame.origin) / sphere.radius
    latitude = float(np.arcsin(np.clip(normal @ sphere.frame.axes[2], -1, 1)))
    is_north = float(into_blend @ sphere.frame.axes[2]) < 0
    pole_latitude = np.pi / 2 if is_north else -np.pi / 2
    pole = make_vertex(sphere.frame.origin + np.sign(pole_latitude) * sphere.radius * sphere.frame.axes[2])
    vertices, span = (
        ((corner, pole), (latitude, pole_latitude)) if is_north else ((pole, corner), (pole_latitude, latitude))
    )
    seam = make_edge(BRep_Tool.Surface_s(face).UIso(0.0), vertices, span)
    up = gp_Dir2d(0, 1)
    attach_pcurves(seam, face, Geom2d_Line(gp_Pnt2d(2 * np.pi, 0), up), Geom2d_Line(gp_Pnt2d(0, 0), up))
    along_pole = Geom2d_Line(gp_Pnt2d(0, pole_latitude), gp_Dir2d(1, 0))
    degenerate = make_degenerate_edge(face, pole, along_pole, (0.0, 2 * np.pi))
    if is_north:
        return make_closed_wire([rail_use, seam, reverse_edge(degenerate), reverse_edge(seam)])
    return make_closed_wire([rail_use, reverse_edge(seam), degenerate, seam])
