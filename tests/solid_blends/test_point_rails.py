"""Chains past edges rounded by the radius of the ball: there it turns about one point of the face on one side."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepGProp import BRepGProp_Face
from OCP.gp import gp_Pnt, gp_Vec

import cqblend

RADIUS = 4.0


def make_rounded_box(turn: float = 0.0) -> cq.Shape:
    box = cq.Workplane().box(30, 20, 10).edges("|Z").fillet(RADIUS)
    return box.solids().val().rotate(cq.Vector(), cq.Vector(1, 2, 3), turn)


def find_rim(body: cq.Shape) -> list[cq.Edge]:
    (top,) = [face for face in body.Faces() if len(face.Edges()) == 8 and face.normalAt().z > 0]
    return top.Edges()


@pytest.mark.parametrize("turn", [0.0, 31.0])
@pytest.mark.parametrize("options", [{}, {"section": "hermite"}, {"continuity": "G2"}], ids=str)
def test_the_rim_of_a_box_is_rounded_by_the_radius_of_its_uprights(options, turn):
    body = make_rounded_box(turn)
    result = cqblend.blend_edges(body, find_rim(body), RADIUS, **options)
    assert result.shape.isValid()
    assert cqblend.verify(result.shape).ok
    assert len(result.faces) == 8
    assert result.certificate.coverage == 1.0
    assert result.certificate.angle < 1e-10
    assert result.certificate.gap < 1e-10
    between = [edge for edge in result.certificate.edges if edge.kind == "between"]
    assert len(between) == 8
    assert max(edge.angle for edge in between) < 1e-10
    assert max(edge.gap for edge in between) < 1e-9


def test_what_is_left_is_the_box_that_a_ball_sweeps():
    # the outer parallel body of a rectangle: prism, quarter cylinders and eighths of spheres, in closed form
    body = make_rounded_box()
    shape = cqblend.blend_edges(body, find_rim(body), RADIUS, section="arc").shape
    a, b, r = 30 - 2 * RADIUS, 20 - 2 * RADIUS, RADIUS
    plan = a * b + 2 * (a + b) * r + np.pi * r**2
    expected = plan * (10 - r) + a * b * r + 2 * (a + b) * np.pi * r**2 / 4 + 2 / 3 * np.pi * r**3
    assert cqblend.verify(shape).volume == pytest.approx(expected, rel=1e-9)


def test_the_blend_is_tangent_to_the_top_all_around_the_point():
    body = make_rounded_box()
    result = cqblend.blend_edges(body, find_rim(body), RADIUS, section="hermite")
    corners = [face for face in result.faces if len(face.Edges()) == 4 and any(e.Length() < 1e-9 for e in face.Edges())]
    for face in corners:
        reader, point, normal = BRepGProp_Face(face.wrapped), gp_Pnt(), gp_Vec()
        u0, u1, v0, v1 = BRep_Tool.Surface_s(face.wrapped).Bounds()
        for u in np.linspace(u0, u1, 7):
            # so near to the point, the normal differs from that at the point by its distance over the radius
            ways = [(u, v0 + 1e-7 * (v1 - v0)), (u, v1 - 1e-7 * (v1 - v0))]
            angles = []
            for way in ways:
                reader.Normal(*way, point, normal)
                angles.append(normal.Angle(gp_Vec(0, 0, 1)))
            assert min(angles) < 1e-6


def test_an_edge_rounded_before_by_the_same_radius_is_passed():
    body = cq.Workplane().box(24, 18, 12).edges("|Z and >X and >Y").fillet(3)
    result = cqblend.blend_edges(body.val(), body.edges("|Y and >X and >Z").vals(), 3)
    assert result.shape.isValid()
    assert cqblend.verify(result.shape).ok
    assert len(result.faces) == 3
    assert result.certificate.angle < 1e-10


def test_alone_such_an_edge_has_nothing_to_end_on():
    body = make_rounded_box()
    arc = next(edge for edge in find_rim(body) if edge.geomType() == "CIRCLE")
    with pytest.raises(cqblend.CqblendError):
        cqblend.blend_edges(body, arc, RADIUS, chain=False, ends="natural")


def test_the_top_of_a_slot_becomes_one_round():
    # both straight rails meet in the middle, both round ends turn about one point each: nothing of the top is left
    slot = cq.Workplane().slot2D(30, 10).extrude(8)
    result = cqblend.blend_edges(slot.solids().val(), slot.faces(">Z").edges().vals(), 5)
    assert result.shape.isValid()
    assert cqblend.verify(result.shape).ok
    assert len(result.shape.Faces()) == 9
    assert result.certificate.angle < 1e-10


@pytest.mark.parametrize(("upright", "radius", "kind"), [(2, 1, "TORUS"), (4, 2, "TORUS"), (3, 1.7, "REVOLUTION")])
def test_tori_that_cross_themselves_stay_polynomial_since_step_does_not_keep_them(upright, radius, kind):
    # at twice the radius the torus touches itself in the axis: rounding must not make it cross itself
    box = cq.Workplane().box(30, 20, 10).edges("|Z").fillet(upright)
    result = cqblend.blend_edges(box.solids().val(), box.faces(">Z").edges(">Y").vals(), radius)
    assert {face.geomType() for face in result.faces[1::2]} == {kind}
    assert cqblend.verify(result.shape).ok
