"""The proof of a blend around an axis, from the finished faces: its profile, its axis, and its rails on both sides."""

from __future__ import annotations

from functools import reduce
from typing import Literal

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_SurfaceOfRevolution
from OCP.Geom2d import Geom2d_Circle, Geom2d_Line
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from cqblend.blends.quality.circular_joint_proof import (
    AngularLine,
    TurnedProfile,
    prove_circular_joint,
)
from cqblend.blends.quality.smoothness_proof import Proof
from cqblend.brep.conversion import spline_arrays
from cqblend.brep.conversion.support_face import read_support_face
from cqblend.brep.shell_editing.plan_application import BuiltStrip
from cqblend.brep.verification.pole_proof import prove_pole
from cqblend.surfaces.circle import PlanarCircle
from cqblend.surfaces.coaxial_surfaces import CoaxialSurface
from cqblend.surfaces.quadrics import Plane


def prove_revolved_strip(strip: BuiltStrip, orders: tuple[int, int]) -> Proof:
    """Prove how a blend face on a surface of revolution meets both of its support faces, along all of its rail edges.

    ``orders`` are those of the continuity on both sides.
    """
    profile = _read_turned_profile(strip.blend_face)

    def prove_rail(end: Literal[0, 1]) -> Proof:
        pole = prove_pole(strip, end, float(np.ptp(profile.profile[2], axis=0).max()))
        if pole is not None:
            return pole
        faces, edges, order = (strip.blend_face, strip.trimmed_faces[end]), strip.rail_edges[end], orders[end]
        return reduce(_take_larger_bounds, (_prove_edge(profile, end, faces, edge, order) for edge in edges))

    return prove_rail(0) | prove_rail(1)


def _take_larger_bounds(one: Proof, other: Proof) -> Proof:
    """Return what is proven of two edges of one rail."""
    both = one | other
    return Proof(both.gap, both.angle, both.curvature_jump)


def _read_turned_profile(face: TopoDS_Face) -> TurnedProfile:
    """Read the surface of a blend face."""
    surface = BRep_Tool.Surface_s(face)
    if not isinstance(surface, Geom_SurfaceOfRevolution):
        raise TypeError(f"a blend around an axis is a surface of revolution, no {surface.DynamicType().Name()}")
    axis = surface.Axis()
    return TurnedProfile(
        np.array(axis.Location().Coord()),
        np.array(axis.Direction().Coord()),
        spline_arrays.curve_to_arrays(surface.BasisCurve()),
    )


def _prove_edge(
    profile: TurnedProfile, end: Literal[0, 1], faces: tuple[TopoDS_Face, TopoDS_Face], edge: TopoDS_Edge, order: int
) -> Proof:
    """Prove how the second face at a rail edge meets the turned profile, which the first is on."""
    first, last = BRep_Tool.Range_s(edge)
    curve = BRep_Tool.Curve_s(edge, 0.0, 0.0)
    points = np.array([curve.Value(t).Coord() for t in np.linspace(first, last, 4)[:-1].tolist()])
    support = read_support_face(faces[1], points, edge_is_circular=True).face_primary
    if not isinstance(support, Plane | CoaxialSurface):
        raise TypeError(f"a {type(support).__name__} has no axis")
    own, rail = (_read_rail(face, edge) for face in faces)
    if not isinstance(own, AngularLine):
        raise TypeError("a rail of a turned profile is a line along its angle")
    turn = float(np.abs(own.start[0] + own.sign * np.array([first, last])).max())
    return prove_circular_joint(profile, end, support, _follow_own_angle(rail, own), turn, order)


def _follow_own_angle(rail: PlanarCircle | AngularLine, own: AngularLine) -> PlanarCircle | AngularLine:
    """Return a rail on its support by the angle of the turned profile, given the line on which that has the rail.

    The parameter of the edge is that angle, but where the edge was made for another strip.
    """
    if isinstance(rail, PlanarCircle):
        if own.start[0] != 0 or own.sign != 1:
            raise TypeError("a rail on a plane has the angle of its strip for its parameter")
        return rail
    sign = rail.sign * own.sign
    return AngularLine(rail.start - [sign * own.start[0], 0.0], sign)


def _read_rail(face: TopoDS_Face, edge: TopoDS_Edge) -> PlanarCircle | AngularLine:
    """Read the pcurve of a rail edge."""
    pcurve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0)
    if isinstance(pcurve, Geom2d_Circle):
        position = pcurve.Position()
        axes = np.array([position.XDirection().Coord(), position.YDirection().Coord()])
        return PlanarCircle(np.array(position.Location().Coord()), axes, pcurve.Radius())
    if not isinstance(pcurve, Geom2d_Line):
        raise TypeError(f"a rail around an axis is a circle or a line, no {pcurve.DynamicType().Name()}")
    return AngularLine(np.array(pcurve.Location().Coord()), float(pcurve.Direction().X()))
