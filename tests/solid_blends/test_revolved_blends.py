"""Polynomial sections around an axis go into solids as surfaces of revolution: light in STEP, exact, good to work on.

What is measured is measured by OCCT: types, sizes of files, volumes, and integrals over the finished faces.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_Circle, Geom_SphericalSurface, Geom_SurfaceOfRevolution
from OCP.gp import gp_Pnt, gp_Vec
from round_solids import find_corner, find_rails, measure_joint, place_at_random, revolve_outline

import cqblend

TOP = cq.Vector(0, 0, 10)


def make_rod() -> cq.Solid:
    """A cylinder of radius 5 and height 10."""
    return cq.Solid.makeCylinder(5, 10)


def make_slanted() -> cq.Solid:
    """The same rod, cut by a plane that leans, so that its rim is an arc with end faces that are oblique to it."""
    cutter = cq.Solid.makeBox(40, 40, 60, cq.Vector(-20, -40, -30)).rotate(cq.Vector(), cq.Vector(1, 0.4, 0.1), -20)
    return cq.Workplane(make_rod()).cut(cq.Workplane(cutter.moved(cq.Location(cq.Vector(0, -1, 0))))).val()


def find_faces(result: cqblend.BlendResult) -> list[cq.Face]:
    """The blend faces of a result."""
    found = [cq.Face(getattr(face, "wrapped", face)) for face in result.faces]
    return [face for face in found if isinstance(BRep_Tool.Surface_s(face.wrapped), Geom_SurfaceOfRevolution)]


def assert_smooth(result: cqblend.BlendResult) -> None:
    """All rails are circles, met to rounding by both faces, in OCCT's own derivatives."""
    rails = find_rails(result)
    assert len(rails) >= 2
    for blend, face, edge in rails:
        assert isinstance(BRep_Tool.Curve_s(edge.wrapped, 0.0, 0.0), Geom_Circle)
        for measured in measure_joint(blend.wrapped, face.wrapped, edge.wrapped):
            assert measured.gap < 1e-12
            assert measured.angle < 1e-12


def integrate_bending(face: cq.Face) -> float:
    """Integrate the squares of the principal curvatures over a face, between its end curves, by Gauss and OCCT's D2.

    By symmetry they depend on v alone: at each v they count as often as its parallel within the face is long.
    """
    surface = BRep_Tool.Surface_s(face.wrapped)
    u0, u1, *_ = BRepTools.UVBounds_s(face.wrapped)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    v, weights = (nodes + 1) / 2, weights / 2
    ends = []
    for edge in face.Edges():
        pcurve = BRep_Tool.CurveOnSurface_s(edge.wrapped, face.wrapped, 0.0, 1.0)
        first, last = BRep_Tool.Range_s(edge.wrapped)
        uv = np.array([pcurve.Value(t).Coord() for t in np.linspace(first, last, 4001)])
        if np.ptp(uv[:, 1]) > 0.5:  # an end, across the blend
            uv = uv[np.argsort(uv[:, 1])]
            ends.append(np.interp(v, uv[:, 1], uv[:, 0]))
    length = np.abs(ends[1] - ends[0]) if len(ends) == 2 else np.full_like(v, u1 - u0)
    p, *d = gp_Pnt(), *(gp_Vec() for _ in range(5))
    total = 0.0
    for at, share in zip(v.tolist(), (weights * length).tolist(), strict=True):
        surface.D2((u0 + u1) / 2, at, p, *d)
        su, sv, suu, svv, suv = (np.array(x.Coord()) for x in d)
        normal = np.cross(su, sv)
        area = np.linalg.norm(normal)
        first = np.array([[su @ su, su @ sv], [su @ sv, sv @ sv]])
        second = np.array([[suu @ normal, suv @ normal], [suv @ normal, svv @ normal]]) / area
        total += share * area * float((np.linalg.eigvals(np.linalg.solve(first, second)) ** 2).sum())
    return total


def test_a_rim_takes_less_than_10_kb_in_step_and_comes_back_the_same(tmp_path: Path):
    rod = make_rod()
    result = cqblend.blend_edges(rod, find_corner(rod, TOP), 1.0, section="hermite")
    path = tmp_path / "rim.step"
    result.shape.exportStep(str(path))
    assert path.stat().st_size < 10_000
    again = cq.importers.importStep(str(path)).val()
    assert again.isValid()
    assert again.Volume() == pytest.approx(result.shape.Volume(), rel=1e-12)
    (face,) = (face for face in again.Faces() if face.geomType() == "REVOLUTION")
    assert face.Area() == pytest.approx(find_faces(result)[0].Area(), rel=1e-9)


@pytest.mark.parametrize("continuity", ["G0", "G1", "G2", "G3"])
def test_any_order_of_continuity_is_a_surface_of_revolution(continuity):
    rod = make_rod()
    result = cqblend.blend_edges(rod, find_corner(rod, TOP), 1.0, continuity=continuity, section="hermite")
    assert len(find_faces(result)) == 1
    assert result.shape.isValid()
    if continuity != "G0":
        assert_smooth(result)
    if continuity in ("G2", "G3"):
        jumps = [
            measure_joint(blend.wrapped, face.wrapped, edge.wrapped)[1].curvature_jump
            for blend, face, edge in find_rails(result)
        ]
        assert max(jumps) < 1e-12
        assert max(jumps) <= result.certificate.proof.curvature_jump


@pytest.mark.parametrize("kind", ["cylinder", "cone", "sphere", "torus", "spline", "step", "groove", "ring", "ball"])
def test_rims_of_all_kinds_of_bodies_are_stored_so_anywhere_in_space(kind):
    rng = np.random.default_rng(12)
    body = revolve_outline(kind, 10.0, rng).val()
    body, at = (place_at_random(one, 30.0, np.random.default_rng(5)) for one in (body, cq.Vertex.makeVertex(0, 0, 0)))
    result = cqblend.blend_edges(body, find_corner(body, at.Center()), 0.6, section="hermite")
    assert len(find_faces(result)) == 1
    assert_smooth(result)
    assert cqblend.verify(result.shape, result.faces).ok


def test_a_sphere_that_is_given_the_axis_of_its_rim_keeps_its_shape():
    ball = cq.Solid.makeSphere(8, angleDegrees1=-90)
    skew = cq.Solid.makeCylinder(3, 20, cq.Vector(0, 0, 0), cq.Vector(1, 2, 1))
    solid = ball.cut(skew)
    (rim,) = (edge for edge in solid.Edges() if edge.geomType() == "CIRCLE" and abs(edge.Center().Length - 7.4) < 0.1)
    result = cqblend.blend_edges(solid, rim, 0.5, section="hermite")
    assert_smooth(result)
    (sphere,) = (
        surface
        for surface in (BRep_Tool.Surface_s(face.wrapped) for face in result.shape.Faces())
        if isinstance(surface, Geom_SphericalSurface)
    )
    assert abs(np.dot(sphere.Axis().Direction().Coord(), np.array([1, 2, 1]) / 6**0.5)) == pytest.approx(1, abs=1e-14)
    assert result.certificate.proof.angle < 1e-13


def test_both_rims_of_a_rod_in_one_call():
    rod = make_rod()
    result = cqblend.blend_edges(rod, [find_corner(rod, TOP), find_corner(rod, cq.Vector())], 1.0, section="hermite")
    assert len(find_faces(result)) == 2
    assert_smooth(result)
    one = cqblend.blend_edges(rod, find_corner(rod, TOP), 1.0, section="hermite")
    assert rod.Volume() - result.shape.Volume() == pytest.approx(2 * (rod.Volume() - one.shape.Volume()), rel=1e-10)
    assert len(result.certificate.proof.sides) == 4


@pytest.mark.parametrize("ends", ["natural", "flat"])
@pytest.mark.parametrize("oblique", [True, False])
def test_arcs_are_stored_so_and_their_energy_is_that_within_the_face(ends, oblique):
    body = make_slanted() if oblique else revolve_outline("cylinder", 10.0, np.random.default_rng(3), 200.0).val()
    corner = find_corner(body, TOP if oblique else cq.Vector())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # flat ends are warned of
        result = cqblend.blend_edges(body, corner, 0.7, ends=ends, section="hermite")
    (face,) = find_faces(result)
    assert_smooth(result)
    assert not face.wrapped.Closed()
    # its boundary is a polyline of 65 points an edge there, of 4001 here
    assert result.certificate.fairness == pytest.approx(integrate_bending(face), rel=1e-5)
    assert cqblend.verify(result.shape, result.faces).ok


def test_the_energy_of_a_full_turn_is_that_of_the_face():
    rod = make_rod()
    result = cqblend.blend_edges(rod, find_corner(rod, TOP), 1.0, section="hermite")
    assert result.certificate.fairness == pytest.approx(integrate_bending(find_faces(result)[0]), rel=1e-9)


@pytest.mark.parametrize("turned", [0.0, 90.0, 180.0])
def test_an_arc_may_cross_the_seam_of_its_face(turned):
    """The wall is a whole cylinder's, cut: where its seam is inside the rim, rails are split there."""
    rod = make_rod().rotate(cq.Vector(), cq.Vector(0, 0, 1), turned)
    cutter = cq.Solid.makeBox(20, 20, 20, cq.Vector(-10, -24, -5))
    body = cq.Workplane(rod).cut(cq.Workplane(cutter)).val()
    result = cqblend.blend_edges(body, find_corner(body, TOP), 0.7, section="hermite")
    assert len(find_faces(result)) == 1
    assert_smooth(result)
    assert result.shape.isValid()
    assert result.certificate.proof.angle < 1e-13


@pytest.mark.parametrize("change", ["cut", "fillet", "blend"])
def test_later_operations_work_on_top(change):
    rod = make_rod()
    solid = cqblend.blend_edges(rod, find_corner(rod, TOP), 1.0, section="hermite").shape
    if change == "cut":
        later = solid.cut(cq.Solid.makeBox(4, 4, 30, cq.Vector(2, -2, -10)))
    elif change == "fillet":
        later = solid.fillet(0.5, [find_corner(solid, cq.Vector())])
    else:
        later = cqblend.blend_edges(solid, find_corner(solid, cq.Vector()), 0.5, section="hermite").shape
    assert later.isValid()
    assert 0 < later.Volume() < solid.Volume()


def test_a_blended_rod_can_be_shelled():
    rod = make_rod()
    solid = cqblend.blend_edges(rod, find_corner(rod, TOP), 1.0, section="hermite").shape
    hollow = cq.Workplane(solid).faces("<Z").shell(-0.5).val()
    assert hollow.isValid()
    assert 0 < hollow.Volume() < solid.Volume()
