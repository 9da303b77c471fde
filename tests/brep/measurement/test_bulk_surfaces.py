"""Surfaces evaluated in bulk against OCCT, which evaluates them point by point."""

import numpy as np
import pytest
from OCP.Geom import (
    Geom_BezierSurface,
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_OffsetSurface,
    Geom_Plane,
    Geom_RectangularTrimmedSurface,
    Geom_SphericalSurface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
)
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Ax1, gp_Ax3, gp_Dir, gp_Pnt
from OCP.TColgp import TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array2OfReal

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.errors import GeometryError

FRAME = gp_Ax3(gp_Pnt(1, 2, 3), gp_Dir(1, 2, 2), gp_Dir(1, 0, 0.3))
MIRRORED = gp_Ax3(gp_Pnt(-1, 2, 3), gp_Dir(1, 2, 2), gp_Dir(1, 0, 0.3))
MIRRORED.YReverse()


def clamped(rng, degree, count):
    return np.concatenate((np.zeros(degree + 1), np.sort(rng.uniform(0, 1, count - degree - 1)), np.ones(degree + 1)))


def spline(p, q, nu, nv, rational=False):
    rng = np.random.default_rng(p + 10 * q)
    x, y = np.meshgrid(np.linspace(0, 1, nu), np.linspace(0, 1, nv), indexing="ij")
    poles = np.stack((x, y, x * y), axis=-1) + 0.1 * rng.normal(size=(nu, nv, 3))
    weights = rng.uniform(0.5, 2, (nu, nv)) if rational else None
    return spline_arrays.surface_from_arrays((p, q), (clamped(rng, p, nu), clamped(rng, q, nv)), poles, weights)


def curve(degree, count, rational=False):
    rng = np.random.default_rng(degree)
    weights = rng.uniform(0.5, 2, count) if rational else None
    return spline_arrays.curve_from_arrays(degree, clamped(rng, degree, count), rng.normal(size=(count, 3)), weights)


def bezier():
    poles, weights = TColgp_Array2OfPnt(1, 3, 1, 4), TColStd_Array2OfReal(1, 3, 1, 4)
    rng = np.random.default_rng(0)
    for i, j in np.ndindex(3, 4):
        poles.SetValue(i + 1, j + 1, gp_Pnt(i, j, float(rng.normal())))
        weights.SetValue(i + 1, j + 1, float(rng.uniform(0.5, 2)))
    return Geom_BezierSurface(poles, weights)


def periodic():
    surface = GeomConvert.SurfaceToBSplineSurface_s(Geom_ToroidalSurface(FRAME, 5, 2))
    assert surface.IsUPeriodic()
    assert surface.IsVPeriodic()
    return surface


IN_BULK = {
    "plane": lambda: Geom_Plane(FRAME),
    "cylinder": lambda: Geom_CylindricalSurface(FRAME, 3),
    "left-handed cylinder": lambda: Geom_CylindricalSurface(MIRRORED, 3),
    "cone": lambda: Geom_ConicalSurface(MIRRORED, 0.4, 3),
    "inward cone": lambda: Geom_ConicalSurface(FRAME, -0.4, 3),
    "sphere": lambda: Geom_SphericalSurface(FRAME, 3),
    "torus": lambda: Geom_ToroidalSurface(MIRRORED, 5, 2),
    "spline": lambda: spline(3, 3, 10, 9),
    "rational spline": lambda: spline(3, 2, 10, 9, rational=True),
    "ruled spline": lambda: spline(1, 5, 2, 9),
    "bilinear spline": lambda: spline(1, 1, 5, 4, rational=True),
    "periodic spline": periodic,
    "Bezier": bezier,
    "revolution": lambda: Geom_SurfaceOfRevolution(curve(4, 9, True), gp_Ax1(gp_Pnt(1, 2, 3), gp_Dir(1, 2, 2))),
    "extrusion": lambda: Geom_SurfaceOfLinearExtrusion(curve(3, 7), gp_Dir(1, 2, 3)),
    "trimmed": lambda: Geom_RectangularTrimmedSurface(Geom_CylindricalSurface(FRAME, 3), 0, 1, 0, 1, True, True),
}
SURFACES = IN_BULK | {"offset": lambda: Geom_OffsetSurface(spline(3, 3, 10, 9), 0.01)}


def parameters(along):
    """Return parameters (2, 300) inside the unit square: anywhere, or along an isoparameter, an end of the domain."""
    uv = np.random.default_rng(1).uniform(0, 1, (2, 300))
    if along != "anywhere":
        uv["vu".index(along)] = 1.0
    return uv


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("along", ["anywhere", "u", "v"])
@pytest.mark.parametrize("name", SURFACES)
def test_jets_are_those_of_occt(name, along, order):
    evaluate, uv = SurfaceEvaluator(SURFACES[name]()), parameters(along)
    found, expected = evaluate(uv, order), evaluate.evaluate_by_occt(uv, order)
    assert found.shape == ((1, 3, 6)[order], 3, 300)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one, other, rtol=0, atol=2e-14 * (1 + np.abs(other).max()))
    assert evaluate.is_in_bulk == (name in IN_BULK)


@pytest.mark.parametrize("name", ["periodic spline", "cylinder", "torus", "revolution"])
def test_closed_surfaces_go_on_past_their_period(name):
    evaluate = SurfaceEvaluator(SURFACES[name]())
    uv = parameters("anywhere")
    uv[0] = 40 * uv[0] - 20
    np.testing.assert_allclose(evaluate(uv, 1), evaluate.evaluate_by_occt(uv, 1), atol=1e-13)


def test_a_pole_has_no_longitude():
    """All of a sphere's pole is one point; jets there are nothing along u, in bulk as in OCCT."""
    evaluate = SurfaceEvaluator(Geom_SphericalSurface(FRAME, 3))
    uv = np.stack((np.linspace(0, 6, 50), np.full(50, np.pi / 2)))
    jets = evaluate(uv, 1)
    assert np.abs(jets[1]).max() < 1e-15
    np.testing.assert_allclose(jets, evaluate.evaluate_by_occt(uv, 1), atol=1e-15)


class Liar:
    """A surface of OCCT that evaluates another surface than it is read as, past a parameter."""

    def __init__(self, surface, after):
        self.surface, self.after = surface, after

    def D0(self, u, v, point):
        raise AssertionError

    D2 = D0

    def D1(self, u, v, point, su, sv):
        self.surface.D1(u, v, point, su, sv)
        if u > self.after:
            sv.SetX(sv.X() + 1e-7)


def test_a_formula_that_occt_contradicts_is_given_up():
    evaluate, uv = SurfaceEvaluator(spline(3, 3, 10, 9)), np.sort(parameters("anywhere"), axis=1)
    truth = evaluate.surface
    evaluate.surface = Liar(truth, 0.9)
    inside = uv * 0.9
    np.testing.assert_allclose(evaluate(inside, 1), SurfaceEvaluator(truth)(inside, 1), atol=1e-14)
    assert np.array_equal(evaluate(uv, 1), evaluate.evaluate_by_occt(uv, 1))
    assert not evaluate.is_in_bulk
    assert np.array_equal(evaluate(inside, 1), evaluate.evaluate_by_occt(inside, 1))  # from then on, everywhere


def test_few_points_are_left_to_occt():
    evaluate, uv = SurfaceEvaluator(spline(3, 3, 10, 9)), parameters("anywhere")[:, :5]
    assert np.array_equal(evaluate(uv, 2), evaluate.evaluate_by_occt(uv, 2))


def test_what_occt_cannot_evaluate_is_refused():
    """A surface of extrusion along its own curve has no normal to offset it by."""
    line = spline_arrays.curve_from_arrays(1, [0, 0, 1, 1], np.array([[0.0, 0, 0], [0, 0, 1]]))
    evaluate = SurfaceEvaluator(Geom_OffsetSurface(Geom_SurfaceOfLinearExtrusion(line, gp_Dir(0, 0, 1)), 1.0))
    with pytest.raises(GeometryError, match=r"OCCT cannot differentiate the surface at \(u, v\)"):
        evaluate(parameters("anywhere"), 2)
