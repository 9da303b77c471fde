"""Faces read as primaries: in the face's own parameters they are OCCT's surface, and rails come back as its pcurves."""

from __future__ import annotations

import math

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_NurbsConvert, BRepBuilderAPI_Transform
from OCP.BRepTools import BRepTools
from OCP.Geom import (
    Geom_Circle,
    Geom_Ellipse,
    Geom_OffsetSurface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
)
from OCP.gp import gp_Ax1, gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec
from OCP.TopoDS import TopoDS, TopoDS_Face

from cqblend.blends.rails.ribbon import Ribbon
from cqblend.brep.conversion.support_face import build_rail_pcurve, read_support_face
from cqblend.errors import CqblendError
from cqblend.splines import interpolation

V = cq.Vector


def face_of(body: cq.Shape, kind: str) -> TopoDS_Face:
    return next(face for face in body.Faces() if face.geomType() == kind).wrapped


def ball() -> cq.Solid:
    return cq.Solid.makeSphere(6, angleDegrees1=-90)


def wave() -> cq.Face:
    grid = [[V(x, y, math.sin(x / 2) * math.cos(y / 3)) for y in range(-9, 10, 3)] for x in range(-9, 10, 3)]
    return cq.Face.makeSplineApprox(grid, tol=1e-3, minDeg=3, maxDeg=3)


def tube() -> cq.Solid:
    return cq.Workplane().spline([(9, 0), (0, 6), (-9, 0), (0, -6)], periodic=True).close().extrude(8).val()


def vase() -> cq.Solid:
    profile = cq.Workplane("XZ").moveTo(0, 0).lineTo(6, 0)
    profile = profile.spline([(6, 0), (8, 4), (5, 9), (6, 12)], includeCurrent=False)
    return profile.lineTo(0, 12).close().revolve(360, (0, 0), (0, 1)).val()


def swept(kind: str) -> TopoDS_Face:
    place = gp_Ax2(gp_Pnt(1, 2, 3), gp_Dir(0.1, 1, 0.2))
    if kind == "extruded circle":
        surface = Geom_SurfaceOfLinearExtrusion(Geom_Circle(place, 4), gp_Dir(0.2, 1, 0.3))
    elif kind == "extruded ellipse":
        surface = Geom_SurfaceOfLinearExtrusion(Geom_Ellipse(place, 4, 2), gp_Dir(0.2, 1, 0.3))
    else:
        surface = Geom_SurfaceOfRevolution(Geom_Ellipse(place, 2, 1), gp_Ax1(gp_Pnt(9, 0, 0), gp_Dir(0.1, 0, 1)))
    return BRepBuilderAPI_MakeFace(surface, 0.1, 3.0, 0.2, 2.5, 1e-7).Face()


def offset() -> TopoDS_Face:
    surface = Geom_OffsetSurface(BRep_Tool.Surface_s(wave().wrapped), 0.5)
    return BRepBuilderAPI_MakeFace(surface, *surface.Bounds(), 1e-7).Face()


def nurbs(body: cq.Shape) -> cq.Shape:
    return cq.Shape.cast(BRepBuilderAPI_NurbsConvert(body.wrapped).Shape())


def mirrored(face: TopoDS_Face) -> TopoDS_Face:
    turn = gp_Trsf()
    turn.SetMirror(gp_Ax2(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 1)))
    return TopoDS.Face_s(BRepBuilderAPI_Transform(face, turn, True).Shape())


def located(face: TopoDS_Face) -> TopoDS_Face:
    return cq.Face(face).moved(cq.Location(V(5, 6, 7), V(1, 2, 3), 40)).wrapped


FACES = {
    "plane": lambda: face_of(cq.Solid.makeBox(5, 6, 7), "PLANE"),
    "cylinder": lambda: face_of(cq.Solid.makeCylinder(4, 9), "CYLINDER"),
    "cone": lambda: face_of(cq.Solid.makeCone(6, 2, 9), "CONE"),
    "widening cone": lambda: face_of(cq.Solid.makeCone(2, 6, 9), "CONE"),
    "sphere": lambda: face_of(ball(), "SPHERE"),
    "torus": lambda: face_of(cq.Solid.makeTorus(8, 3), "TORUS"),
    "spline": lambda: wave().wrapped,
    "extruded spline": lambda: face_of(tube(), "EXTRUSION"),
    "revolved spline": lambda: face_of(vase(), "REVOLUTION"),
    "extruded circle": lambda: swept("extruded circle"),
    "extruded ellipse": lambda: swept("extruded ellipse"),
    "revolved ellipse": lambda: swept("revolved ellipse"),
    "NURBS cylinder": lambda: face_of(nurbs(cq.Solid.makeCylinder(4, 9)), "BSPLINE"),
    "NURBS sphere": lambda: face_of(nurbs(ball()), "BSPLINE"),
    "offset": offset,
}
PLACES = {"as made": lambda face: face, "mirrored": mirrored, "located": located}
every = pytest.mark.parametrize("name", FACES)
everywhere = pytest.mark.parametrize("place", PLACES)


def inside(face: TopoDS_Face, n: int = 7) -> np.ndarray:
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    x = np.linspace(0.12, 0.88, n)
    u, v = np.meshgrid(u0 + (u1 - u0) * x, v0 + (v1 - v0) * x[::-1])
    return np.stack([u.ravel(), v.ravel()], -1)


def kernel(face: TopoDS_Face, uv: np.ndarray) -> np.ndarray:
    """Return OCCT's S, Su, Sv, Suu, Suv, Svv at (n, 2), as (6, n, 3)."""
    surface = BRep_Tool.Surface_s(face)
    rows = []
    for u, v in uv.tolist():
        p, su, sv, suu, svv, suv = gp_Pnt(), *(gp_Vec() for _ in range(5))
        surface.D2(u, v, p, su, sv, suu, svv, suv)
        rows.append([x.Coord() for x in (p, su, sv, suu, suv, svv)])
    return np.array(rows).swapaxes(0, 1)


def read(name: str, place: str, *, around: bool = False):
    face = PLACES[place](FACES[name]())
    middle = inside(face)
    points = kernel(face, middle[24:31])[0]
    return face, read_support_face(face, points, edge_is_circular=around)


@every
@everywhere
def test_native_parameters_are_the_faces_own(name, place):
    face, side = read(name, place)
    uv = inside(face)
    exact, found = kernel(face, uv), side.face_primary.jet(uv)
    accuracy = 1e-9 if name == "offset" else 1e-13  # an offset surface is approximated, to a stated tolerance
    for order, (a, b) in enumerate(zip(exact, found, strict=True)):
        slack = 1 if name != "offset" or order == 0 else 1e4
        assert np.abs(a - b).max() < accuracy * slack * (20 + np.abs(a).max()), order


@every
@everywhere
def test_working_parameters_are_the_same_points(name, place):
    face, side = read(name, place)
    uv = inside(face)
    if name == "sphere":
        normals = kernel(face, uv)[0] - side.primary.frame.origin
        uv = uv[normals @ side.primary.pole > -5]
    points = side.primary.jet(side.to_working_parameters(uv))[0]
    assert np.abs(points - kernel(face, uv)[0]).max() < (1e-8 if name == "offset" else 1e-12)


@every
@pytest.mark.parametrize("reverse", [False, True])
def test_outward_is_that_of_the_face(name, reverse):
    face = FACES[name]()
    if reverse:
        face = TopoDS.Face_s(face.Reversed())
    side = read_support_face(face, kernel(face, inside(face)[24:31])[0])
    uv = inside(face)[24:25]
    _, su, sv = kernel(face, uv)[:3]
    geometric = np.cross(su, sv)[0]
    ours = side.outward * side.primary.evaluate_normals(side.to_working_parameters(uv))[0]
    sign = -1 if face.Orientation().name.endswith("REVERSED") else 1
    assert sign * geometric @ ours > 0.999 * np.linalg.norm(geometric)


@every
def test_a_rail_comes_back_as_a_pcurve_on_the_same_points(name):
    face, side = read(name, "mirrored")
    a = np.linspace(0, 3, 14)
    u0, u1, v0, v1 = BRepTools.UVBounds_s(side.face)
    middle = np.array([(u0 + u1) / 2, (v0 + v1) / 2])
    reach = 0.3 * np.minimum(np.array([u1 - u0, v1 - v0]), 2.0 if name in ("sphere",) else np.inf)
    uv = middle + reach * np.stack([np.cos(a), np.sin(a)], -1)
    working = side.to_working_parameters(uv)
    if name == "sphere":
        side = read_support_face(face, side.face_primary.jet(uv)[0])
        working = side.to_working_parameters(uv)
    c = interpolation.interpolate(a, side.primary.lift_points(working))
    rail = Ribbon(side.primary, c, (c,), working)
    curve = build_rail_pcurve(side, rail)
    t = np.linspace(0, 3, 333)
    x = side.primary.compose_position(c)(t)
    on_face = kernel(side.face, curve(t))[0]
    size = 1e-9 if name == "offset" else 2e-10  # 1e-11 in the parameters
    assert np.abs(on_face - x[:, :3] / x[:, 3:]).max() < size
    away = curve(a) - uv
    for axis, period in enumerate(side.face_primary.periods):
        if period is not None:
            assert np.ptp(np.round(away[:, axis] / period)) == 0  # in one lap from end to end, whichever
            away[:, axis] -= period * np.round(away[0, axis] / period)
    assert np.abs(away).max() < 1e-8


def test_a_cone_face_knows_its_nappe():
    for body in (cq.Solid.makeCone(6, 2, 9), cq.Solid.makeCone(2, 6, 9)):
        face = face_of(body, "CONE")
        side = read_support_face(face, kernel(face, inside(face))[0])
        assert np.isfinite(side.primary.lift_points(inside(face))).all()


def test_a_sphere_whose_edge_runs_around_turns_about_the_edges_axis():
    body = ball().cut(cq.Solid.makeBox(30, 30, 30, V(-15, -15, 2)).rotate(V(), V(1, 0, 0), 70)).Solids()[0]
    edge = next(e for e in body.Edges() if e.geomType() == "CIRCLE" and abs(e.Center().Length - 2) < 1e-6)
    points = np.array([edge.positionAt(x).toTuple() for x in np.linspace(0, 1, 40, endpoint=False)])
    side = read_support_face(face_of(body, "SPHERE"), points, edge_is_circular=True)
    axis = side.primary.frame.axes[2]
    assert np.ptp(points @ axis) < 1e-12
    assert side.primary.follows_latitude


def test_a_surface_that_cannot_be_read_is_a_typed_error_or_read():
    """Whatever OCCT offers: an offset of an offset has no closed form."""
    surface = Geom_OffsetSurface(Geom_OffsetSurface(BRep_Tool.Surface_s(wave().wrapped), 0.5), 0.5)
    face = BRepBuilderAPI_MakeFace(surface, *surface.Bounds(), 1e-7).Face()
    try:
        side = read_support_face(face, kernel(face, inside(face))[0])
    except CqblendError:
        return
    assert np.abs(side.face_primary.jet(inside(face))[0] - kernel(face, inside(face))[0]).max() < 1e-7
