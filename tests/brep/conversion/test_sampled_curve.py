"""Curves at their own parameters, against OCCT's evaluation."""

from __future__ import annotations

import numpy as np
import pytest
from OCP.Geom import (
    Geom_BezierCurve,
    Geom_Circle,
    Geom_Ellipse,
    Geom_Hyperbola,
    Geom_Line,
    Geom_OffsetCurve,
    Geom_Parabola,
    Geom_TrimmedCurve,
)
from OCP.Geom2d import Geom2d_BezierCurve, Geom2d_Circle, Geom2d_Ellipse, Geom2d_Line, Geom2d_OffsetCurve
from OCP.gp import gp_Ax2, gp_Ax2d, gp_Ax22d, gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array1OfPnt2d

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.conversion.sampled_curve import read_sampled_curve

AXES = gp_Ax2(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 1))
AXIS = gp_Ax2d(gp_Pnt2d(1, 2), gp_Dir2d(1, 1))
LEFT_HANDED = gp_Ax22d(gp_Pnt2d(1, 2), gp_Dir2d(0, 1), gp_Dir2d(1, 0))
RING = (3, np.arange(-3.0, 9.0), np.random.default_rng(4).normal(size=(8, 3)))


def bezier(kind, array, point, poles):
    points = array(1, len(poles))
    for i, pole in enumerate(poles, start=1):
        points.SetValue(i, point(*pole))
    return kind(points)


def periodic():
    curve = spline_arrays.curve_from_arrays(*RING)
    curve.SetPeriodic()
    return curve


CURVES = {
    "line": (Geom_Line(gp_Pnt(1, 2, 3), gp_Dir(1, 2, 3)), -1.0, 2.5),
    "circle": (Geom_Circle(AXES, 3.0), -1.0, 5.0),
    "whole circle": (Geom_Circle(AXES, 3.0), 0.0, 2 * np.pi),
    "ellipse": (Geom_Ellipse(AXES, 3.0, 2.0), 6.0, 7.5),
    "hyperbola": (Geom_Hyperbola(AXES, 3.0, 2.0), -1.0, 2.5),
    "parabola": (Geom_Parabola(AXES, 1.5), -1.0, 2.5),
    "bezier": (bezier(Geom_BezierCurve, TColgp_Array1OfPnt, gp_Pnt, [(0, 0, 0), (1, 3, 0), (2, 0, 4)]), 0.25, 1.0),
    "trimmed": (Geom_TrimmedCurve(Geom_Circle(AXES, 3.0), 1.0, 3.0), 1.25, 2.0),
    "spline": (spline_arrays.curve_from_arrays(*RING), 0.5, 4.25),
    "periodic": (periodic(), 3.5, 8.25),
    "offset": (Geom_OffsetCurve(Geom_Circle(AXES, 3.0), 0.5, gp_Dir(1, 1, 1)), 0.0, 2.0),
    "flat line": (Geom2d_Line(AXIS), -1.0, 2.0),
    "flat circle": (Geom2d_Circle(LEFT_HANDED, 3.0), -1.0, 3.0),
    "flat ellipse": (Geom2d_Ellipse(AXIS, 3.0, 2.0), -1.0, 3.0),
    "flat bezier": (bezier(Geom2d_BezierCurve, TColgp_Array1OfPnt2d, gp_Pnt2d, [(0, 0), (1, 3), (2, 0)]), 0.25, 1.0),
    "flat offset": (Geom2d_OffsetCurve(Geom2d_Circle(AXIS, 3.0), 0.5), 0.0, 2.0),
}


@pytest.mark.parametrize("name", CURVES)
def test_a_track_is_the_curve_at_its_own_parameter(name):
    curve, first, last = CURVES[name]
    t = np.linspace(first, last, 97)
    found = read_sampled_curve(curve, first, last)
    np.testing.assert_allclose(found(t), [curve.Value(float(one)).Coord() for one in t], rtol=0, atol=3e-14)
    assert found.breaks[0] == first
    assert found.breaks[-1] == last
    assert (np.diff(found.breaks) > 0).all()
    assert (found.curve is None) == ("offset" in name)
    if found.curve is not None:
        assert found.curve.domain == pytest.approx((first, last), abs=1e-12)
        np.testing.assert_array_equal(found.curve(found.to_curve_parameter(t)), found(t))
