"""Creases inside a face against closed forms."""

import math

import cadquery as cq
import pytest
from measured_shapes import bspline, faces, roof, wave, wrapped
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_NurbsConvert

from cqblend.brep.measurement.inner_creases import find_inner_crease
from cqblend.errors import InputError


class TestInnerCrease:
    def test_the_ridge_of_a_roof(self):
        crease = find_inner_crease(BRepBuilderAPI_MakeFace(roof(), 1e-7).Face())
        assert crease.angle == pytest.approx(math.pi / 2, abs=1e-14)
        assert crease.parameters[0] == pytest.approx(1.0, abs=1e-10)
        assert crease.point[0] == pytest.approx(1.0, abs=1e-10)
        assert crease.point[2] == pytest.approx(1.0, abs=1e-10)
        assert "1.6 rad" in str(crease)

    def test_a_face_that_stays_clear_of_the_ridge_has_none(self):
        crease = find_inner_crease(BRepBuilderAPI_MakeFace(roof(), 0, 0.9, 0, 1, 1e-7).Face())
        assert crease.angle == 0.0
        assert crease.parameters is None
        assert str(crease) == "no crease"

    def test_a_crease_in_the_other_direction_that_opens_linearly(self):
        """z = a u |v - 1|: the one-sided slopes are +-a u, so the angle is 2 atan(a u), largest at u = 1."""
        poles = [[[0, 0, 0], [0, 1, 0], [0, 2, 0]], [[1, 0, 0.5], [1, 1, 0], [1, 2, 0.5]]]
        face = BRepBuilderAPI_MakeFace(bspline(poles, ((0, 1), (2, 2)), ((0, 1, 2), (2, 1, 2)), (1, 1)), 1e-7).Face()
        crease = find_inner_crease(face)
        assert crease.angle == pytest.approx(2 * math.atan(0.5), rel=1e-7)
        assert crease.parameters == pytest.approx((1.0, 1.0), abs=1e-7)

    def test_knot_lines_without_a_crease(self):
        shape = BRepBuilderAPI_NurbsConvert(wrapped(cq.Workplane().circle(4).extrude(9)), True).Shape()
        for face in faces(shape):
            assert find_inner_crease(face).angle < 1e-11
        assert find_inner_crease(wave()).parameters is None

    def test_not_a_face(self):
        with pytest.raises(InputError, match="face is of type solid: face is needed"):
            find_inner_crease(wrapped(cq.Workplane().box(1, 1, 1)))
