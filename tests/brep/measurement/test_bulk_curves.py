"""Curves evaluated in bulk against OCCT, which evaluates them one by one."""

import numpy as np
import pytest
from OCP.Geom import (
    Geom_BezierCurve,
    Geom_Circle,
    Geom_Ellipse,
    Geom_Line,
    Geom_OffsetCurve,
    Geom_Parabola,
    Geom_TrimmedCurve,
)
from OCP.Geom2d import Geom2d_BezierCurve, Geom2d_Circle, Geom2d_Ellipse, Geom2d_Line, Geom2d_OffsetCurve
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Ax2, gp_Ax2d, gp_Ax22d, gp_Dir, gp_Dir2d, gp_Pnt, gp_Pnt2d
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array1OfPnt2d

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.errors import GeometryError

FRAME = gp_Ax2(gp_Pnt(1, 2, 3), gp_Dir(1, 2, 2), gp_Dir(1, 0, 0.3))
MIRRORED = gp_Ax22d(gp_Pnt2d(1, 2), gp_Dir2d(0.6, 0.8), gp_Dir2d(0.8, -0.6))  # left-handed


def spline(degree, count, dimension=3, rational=False):
    rng = np.random.default_rng(degree + count)
    inner = np.sort(rng.uniform(0, 1, count - degree - 1))
    knots = np.concatenate((np.zeros(degree + 1), inner, np.ones(degree + 1)))
    make = spline_arrays.curve_from_arrays if dimension == 3 else spline_arrays.curve2d_from_arrays
    weights = rng.uniform(0.5, 2, count) if rational else None
    return make(degree, knots, rng.normal(size=(count, dimension)), weights)


def bezier(dimension):
    points = [(0, 0, 0), (1, 2, 1), (3, -1, 2), (4, 1, 0)]
    array, make, build = (
        (TColgp_Array1OfPnt(1, 4), gp_Pnt, Geom_BezierCurve)
        if dimension == 3
        else (TColgp_Array1OfPnt2d(1, 4), gp_Pnt2d, Geom2d_BezierCurve)
    )
    for i, point in enumerate(points, 1):
        array.SetValue(i, make(*point[:dimension]))
    return build(array)


def periodic():
    curve = GeomConvert.CurveToBSplineCurve_s(Geom_Circle(FRAME, 3))
    assert curve.IsPeriodic()
    return curve


IN_BULK = {
    "line": lambda: Geom_Line(gp_Pnt(1, 2, 3), gp_Dir(1, 2, 2)),
    "circle": lambda: Geom_Circle(FRAME, 3),
    "ellipse": lambda: Geom_Ellipse(FRAME, 3, 1),
    "spline": lambda: spline(3, 9),
    "rational spline": lambda: spline(4, 9, rational=True),
    "polyline": lambda: spline(1, 9),
    "two poles": lambda: spline(1, 2),
    "two weighted poles": lambda: spline(1, 2, rational=True),
    "periodic spline": periodic,
    "Bezier": lambda: bezier(3),
    "trimmed": lambda: Geom_TrimmedCurve(Geom_Circle(FRAME, 3), 0.1, 0.9),
    "plane line": lambda: Geom2d_Line(gp_Pnt2d(1, 2), gp_Dir2d(1, 2)),
    "plane circle": lambda: Geom2d_Circle(MIRRORED, 3),
    "plane ellipse": lambda: Geom2d_Ellipse(MIRRORED, 3, 1),
    "plane spline": lambda: spline(3, 9, 2),
    "two plane poles": lambda: spline(1, 2, 2),
    "rational plane spline": lambda: spline(2, 9, 2, rational=True),
    "plane Bezier": lambda: bezier(2),
}

ONE_BY_ONE = {
    "offset": lambda: Geom_OffsetCurve(spline(3, 9), 0.1, gp_Dir(0, 0, 1)),
    "parabola": lambda: Geom_Parabola(FRAME, 2),
    "plane offset": lambda: Geom2d_OffsetCurve(Geom2d_Circle(gp_Ax2d(), 2), 0.1),
}


def parameters(curve):
    low, high = max(curve.FirstParameter(), -5.0), min(curve.LastParameter(), 5.0)
    return np.random.default_rng(1).uniform(low, high, 300)


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("name", [*IN_BULK, *ONE_BY_ONE])
def test_points_and_derivatives_are_those_of_occt(name, order):
    curve = (IN_BULK | ONE_BY_ONE)[name]()
    evaluate = CurveEvaluator(curve)
    found, expected = evaluate(parameters(curve), order), evaluate.evaluate_by_occt(parameters(curve), order)
    assert found.shape == (order + 1, evaluate.dimension, 300)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=2e-14 * (1 + np.abs(other).max()))
    assert evaluate.is_in_bulk == (name in IN_BULK)


def test_periodic_splines_go_on_past_their_period():
    evaluate = CurveEvaluator(periodic())
    ts = np.linspace(-20, 20, 101)
    np.testing.assert_allclose(evaluate(ts, 1), evaluate.evaluate_by_occt(ts, 1), atol=1e-13)


def test_splines_go_on_past_their_ends_as_polynomials():
    evaluate = CurveEvaluator(spline(3, 9))
    ts = np.linspace(-0.2, 1.2, 101)
    np.testing.assert_allclose(evaluate(ts, 1), evaluate.evaluate_by_occt(ts, 1), atol=1e-10)


class Liar:
    """A curve of OCCT that evaluates another curve than it is read as, past a parameter."""

    def __init__(self, curve, after):
        self.curve, self.after = curve, after

    def D0(self, t, point):
        raise AssertionError

    D2 = D0

    def D1(self, t, point, vector):
        self.curve.D1(t, point, vector)
        if t > self.after:
            point.SetX(point.X() + 1e-6)


def test_circles_and_their_arcs_know_centre_and_radius():
    for curve in (Geom_Circle(FRAME, 3), Geom_TrimmedCurve(Geom_Circle(FRAME, 3), 0.1, 0.9)):
        centre, radius = CurveEvaluator(curve).circle
        np.testing.assert_array_equal(centre, (1, 2, 3))
        assert radius == 3
    assert CurveEvaluator(Geom_Ellipse(FRAME, 3, 1)).circle is None


def test_a_formula_that_occt_contradicts_is_given_up():
    evaluate = CurveEvaluator(spline(3, 9))
    truth = evaluate.curve
    evaluate.curve = Liar(truth, 0.9)
    first = evaluate(np.linspace(0, 0.8, 50), 1)
    np.testing.assert_allclose(first, CurveEvaluator(truth)(np.linspace(0, 0.8, 50), 1), atol=1e-13)
    ts = np.linspace(0.8, 1, 50)
    assert np.array_equal(evaluate(ts, 1), evaluate.evaluate_by_occt(ts, 1))
    assert not evaluate.is_in_bulk
    again = np.linspace(0, 0.8, 50)
    assert np.array_equal(evaluate(again, 1), evaluate.evaluate_by_occt(again, 1))  # from then on, everywhere


def test_what_occt_cannot_evaluate_is_refused():
    point = spline_arrays.curve_from_arrays(1, [0, 0, 1, 1], np.zeros((2, 3)))
    evaluate = CurveEvaluator(Geom_OffsetCurve(point, 0.1, gp_Dir(0, 0, 1)))
    with pytest.raises(GeometryError, match="OCCT cannot evaluate a curve at t"):
        evaluate(np.linspace(0, 1, 20), 1)
