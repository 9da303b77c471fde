"""Sphere faces with one boundary, given a new axis.

A sphere face that ends at the blended edge alone may have its poles and its seam anywhere: next to the rail, where no
pcurve can be followed, or so that the seam falls into pieces, which OCCT's STEP reader does not survive. Turning the
axis of the same sphere into that of the rail leaves one pole, one uncut seam from the rail's start to it, and a pcurve
once around.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_SphericalSurface
from OCP.Geom2d import Geom2d_Line
from OCP.gp import gp_Ax3, gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Wire

from cqblend.blends.rails.ribbon import Ribbon
from cqblend.brep.read.face_surface import SupportFace
from cqblend.brep.topology import (
    attach_pcurves,
    explore_subshapes,
    find_end_vertices,
    find_seam_edges,
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


def realign_sphere(side: SupportFace, rail: Ribbon, joint: list[TopoDS_Edge]) -> SupportFace | None:
    """Return the side on a sphere with the rail's axis, its seam at the rail's start, the face without a boundary.

    None if the face is not a sphere, has other edges than those of the joint, or the rail does not run around its axis.
    """
    sphere = side.primary
    if not isinstance(sphere, Sphere) or not sphere.spinning:
        return None
    own = [*find_seam_edges(side.face), *joint]
    for use in explore_subshapes(side.face, TopAbs_EDGE):
        if not BRep_Tool.Degenerated_s(use) and not any(use.IsSame(edge) for edge in own):
            return None
    t = np.linspace(*rail.c.domain, 129)
    turned = np.unwrap(sphere.unlift_points(rail.c(t), np.zeros((len(t), 2)))[:, 0])
    if abs(abs(turned[-1] - turned[0]) - 2 * np.pi) > 1e-6:
        return None
    x, y, z = sphere.frame.axes
    start = turned[0]
    axes = np.array([np.cos(start) * x + np.sin(start) * y, np.cos(start) * y - np.sin(start) * x, z])
    native = replace(sphere, frame=LocalFrame(sphere.frame.origin, axes))
    return replace(side, face=make_bare_face(_make_sphere_surface(native)), face_primary=native, bounds=SPHERE_BOUNDS)


def _make_sphere_surface(sphere: Sphere) -> Geom_SphericalSurface:
    x, y, z = sphere.frame.axes
    position = gp_Ax3(gp_Pnt(*sphere.frame.origin.tolist()), gp_Dir(*z.tolist()), gp_Dir(*x.tolist()))
    if np.cross(x, y) @ z < 0:
        position.YReverse()
    return Geom_SphericalSurface(position, sphere.radius)


def make_sphere_boundary(side: SupportFace, rail_use: TopoDS_Edge, into_blend: Array) -> TopoDS_Wire:
    """Return the boundary of a respun FORWARD face: the rail's use, the seam, and the pole away from the blend.

    ``into_blend`` is the direction (3,) into the blend at the rail's start.
    """
    surface = BRep_Tool.Surface_s(side.face)
    native = side.face_primary
    assert isinstance(native, Sphere)
    corner = find_end_vertices(rail_use)[0]
    normal = (locate_vertex(corner) - native.frame.origin) / native.radius
    latitude = float(np.arcsin(np.clip(normal @ native.frame.axes[2], -1, 1)))
    up = float(into_blend @ native.frame.axes[2]) < 0
    top = np.pi / 2 if up else -np.pi / 2
    pole = make_vertex(native.frame.origin + np.sign(top) * native.radius * native.frame.axes[2])
    vertices, span = ((corner, pole), (latitude, top)) if up else ((pole, corner), (top, latitude))
    seam = make_edge(surface.UIso(0.0), vertices, span)
    rising = gp_Dir2d(0, 1)
    attach_pcurves(seam, side.face, Geom2d_Line(gp_Pnt2d(2 * np.pi, 0), rising), Geom2d_Line(gp_Pnt2d(0, 0), rising))
    degenerate = make_degenerate_edge(side.face, pole, Geom2d_Line(gp_Pnt2d(0, top), gp_Dir2d(1, 0)), (0.0, 2 * np.pi))
    if up:
        return make_closed_wire([rail_use, seam, reverse_edge(degenerate), reverse_edge(seam)])
    return make_closed_wire([rail_use, reverse_edge(seam), degenerate, seam])
