"""Bulk exchange: what goes in comes back bit for bit, and OCCT evaluates what the arrays say."""

import math

import numpy as np
import pytest
from OCP.Geom import Geom_BSplineCurve, Geom_BSplineSurface, Geom_Circle, Geom_ToroidalSurface
from OCP.GeomAPI import GeomAPI_Interpolate
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Ax2, gp_Ax3, gp_Dir, gp_Pnt
from OCP.TColgp import TColgp_HArray1OfPnt

from cqblend.brep.conversion import spline_arrays
from cqblend.errors import CqblendError, DegreeError, InputError

RNG_SEED = 20240611


def clamped(count: int, degree: int, rng: np.random.Generator) -> np.ndarray:
    inner = np.sort(rng.uniform(-1, 2, count - degree - 1))
    return np.concatenate([np.full(degree + 1, -1.0), inner, np.full(degree + 1, 2.0)])


def repeated(knots: list[float], multiplicities: list[int]) -> np.ndarray:
    return np.repeat(np.asarray(knots, dtype=float), multiplicities)


def assert_same_arrays(left, right) -> None:
    for a, b in zip(left, right, strict=True):
        if isinstance(a, tuple):
            assert_same_arrays(a, b)
        elif a is None:
            assert b is None
        else:
            np.testing.assert_array_equal(a, b)


def basis(knots: np.ndarray, degree: int, t: float) -> np.ndarray:
    """Cox and de Boor, by the definition; t inside the clamped domain, not at its end."""
    values = ((knots[:-1] <= t) & (t < knots[1:])).astype(float)
    for k in range(1, degree + 1):
        raised = np.zeros(len(values) - 1)
        for i in range(len(raised)):
            left, right = knots[i + k] - knots[i], knots[i + k + 1] - knots[i + 1]
            if left > 0:
                raised[i] += (t - knots[i]) / left * values[i]
            if right > 0:
                raised[i] += (knots[i + k + 1] - t) / right * values[i + 1]
        values = raised
    return values


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("degrees", [(1, 1), (3, 2), (5, 7), (25, 25)])
def test_surface_round_trip_is_bit_exact(degrees, rational):
    rng = np.random.default_rng(RNG_SEED)
    shape = (degrees[0] + 4, degrees[1] + 6)
    knots = tuple(clamped(n, d, rng) for n, d in zip(shape, degrees, strict=True))
    weights = rng.uniform(0.1, 3, shape) if rational else None
    arrays = (degrees, knots, rng.normal(size=(*shape, 3)) * 37.0, weights)
    surface = spline_arrays.surface_from_arrays(*arrays)
    assert isinstance(surface, Geom_BSplineSurface)
    assert_same_arrays(spline_arrays.surface_to_arrays(surface), arrays)


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize(
    ("dimension", "into", "out"),
    [
        (3, spline_arrays.curve_from_arrays, spline_arrays.curve_to_arrays),
        (2, spline_arrays.curve2d_from_arrays, spline_arrays.curve2d_to_arrays),
    ],
)
@pytest.mark.parametrize("degree", [1, 3, 25])
def test_curve_round_trip_is_bit_exact(dimension, into, out, degree, rational):
    rng = np.random.default_rng(RNG_SEED)
    count = degree + 5
    weights = rng.uniform(0.1, 3, count) if rational else None
    arrays = (degree, clamped(count, degree, rng), rng.normal(size=(count, dimension)), weights)
    assert_same_arrays(out(into(*arrays)), arrays)


@pytest.mark.parametrize("rational", [False, True])
def test_occt_evaluates_what_the_arrays_define(rational):
    rng = np.random.default_rng(RNG_SEED)
    p, q, shape = 3, 2, (7, 5)
    knots = repeated([0, 1, 3, 4], [4, 1, 2, 4]), repeated([-2, 0, 5], [3, 2, 3])
    poles = rng.normal(size=(*shape, 3))
    weights = rng.uniform(0.5, 2, shape) if rational else np.ones(shape)
    surface = spline_arrays.surface_from_arrays((p, q), knots, poles, weights if rational else None)
    curve = spline_arrays.curve_from_arrays(p, knots[0], poles[:, 0], weights[:, 0] if rational else None)
    flat = spline_arrays.curve2d_from_arrays(p, knots[0], poles[:, 0, :2], weights[:, 0] if rational else None)
    for u, v in zip(rng.uniform(0, 4, 20), rng.uniform(-2, 5, 20), strict=True):
        bu, bv = basis(knots[0], p, u), basis(knots[1], q, v)
        blend = weights * np.outer(bu, bv)
        point, found = np.einsum("ij,ijk->k", blend, poles) / blend.sum(), surface.Value(u, v)
        np.testing.assert_allclose([found.X(), found.Y(), found.Z()], point, atol=1e-14)
        line = weights[:, 0] * bu
        point, found, below = line @ poles[:, 0] / line.sum(), curve.Value(u), flat.Value(u)
        np.testing.assert_allclose([found.X(), found.Y(), found.Z()], point, atol=1e-14)
        np.testing.assert_allclose([below.X(), below.Y()], point[:2], atol=1e-14)


def test_equal_weights_come_back_polynomial():
    knots = repeated([0, 1], [2, 2])
    surface = spline_arrays.surface_from_arrays((1, 1), (knots, knots), np.ones((2, 2, 3)), np.full((2, 2), 3.0))
    assert spline_arrays.surface_to_arrays(surface)[3] is None


def test_unclamped_surface_comes_back_clamped():
    rng = np.random.default_rng(RNG_SEED)
    knots = np.arange(10.0), repeated([0, 1, 2, 3, 4, 5, 6], [1, 1, 2, 1, 1, 1, 1])
    surface = spline_arrays.surface_from_arrays((3, 2), knots, rng.normal(size=(6, 5, 3)))
    (p, q), (knots_u, knots_v), *points = spline_arrays.surface_to_arrays(surface)
    np.testing.assert_array_equal(knots_u, repeated([3, 4, 5, 6], [4, 1, 1, 4]))
    np.testing.assert_array_equal(knots_v, repeated([2, 3, 4], [3, 1, 3]))
    again = spline_arrays.surface_from_arrays((p, q), (knots_u, knots_v), *points)
    for u, v in zip(rng.uniform(3, 6, 30), rng.uniform(2, 4, 30), strict=True):
        assert surface.Value(u, v).Distance(again.Value(u, v)) < 1e-14


def test_periodic_torus_comes_back_clamped_over_one_period():
    torus = GeomConvert.SurfaceToBSplineSurface_s(Geom_ToroidalSurface(gp_Ax3(), 7, 2))
    assert torus.IsUPeriodic()
    assert torus.IsVPeriodic()
    arrays = spline_arrays.surface_to_arrays(torus)
    for degree, knots in zip(arrays[0], arrays[1], strict=True):
        assert (knots[0], knots[-1]) == (0, 2 * math.pi)
        assert (knots[degree], knots[-degree - 1]) == (0, 2 * math.pi)
    again = spline_arrays.surface_from_arrays(*arrays)
    assert not again.IsUPeriodic()
    rng = np.random.default_rng(RNG_SEED)
    for u, v in rng.uniform(0, 2 * math.pi, (50, 2)):
        assert torus.Value(u, v).Distance(again.Value(u, v)) < 1e-14
    assert torus.IsUPeriodic(), "the input must not be touched"


def smooth_periodic_curve() -> Geom_BSplineCurve:
    points = TColgp_HArray1OfPnt(1, 8)
    for i in range(8):
        points.SetValue(i + 1, gp_Pnt(20 * math.cos(i * math.pi / 4), 10 * math.sin(i * math.pi / 4), i % 3))
    fit = GeomAPI_Interpolate(points, True, 1e-9)
    fit.Perform()
    return fit.Curve()


@pytest.mark.parametrize(
    "curve",
    [
        smooth_periodic_curve(),
        GeomConvert.CurveToBSplineCurve_s(Geom_Circle(gp_Ax2(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 1)), 5)),
    ],
    ids=["smooth", "circle"],
)
@pytest.mark.parametrize("origin", [1, 3])
def test_periodic_curve_comes_back_clamped_over_one_period(curve, origin):
    curve = curve.Copy()
    curve.SetOrigin(min(origin, curve.NbKnots() - 1))
    assert curve.IsPeriodic()
    degree, knots, poles, weights = spline_arrays.curve_to_arrays(curve)
    again = spline_arrays.curve_from_arrays(degree, knots, poles, weights)
    assert (again.FirstParameter(), again.LastParameter()) == (curve.FirstParameter(), curve.LastParameter())
    assert (knots[degree], knots[-degree - 1]) == (knots[0], knots[-1])
    for t in np.random.default_rng(RNG_SEED).uniform(knots[0], knots[-1], 50):
        assert curve.Value(t).Distance(again.Value(t)) < 1e-14 * 20


@pytest.mark.parametrize(("degrees", "name"), [((26, 1), "u"), ((1, 30), "v")])
def test_degree_above_25_is_refused_before_occt_sees_it(degrees, name):
    shape = (degrees[0] + 1, degrees[1] + 1)
    knots = tuple(repeated([0, 1], [n, n]) for n in shape)
    with pytest.raises(DegreeError, match=rf"surface, {name}: degree {max(degrees)} is above 25"):
        spline_arrays.surface_from_arrays(degrees, knots, np.zeros((*shape, 3)))


LINE = repeated([0, 1], [2, 2])
BAD_CURVES = {
    "nan pole": (1, LINE, [[0, 0, 0], [1, math.nan, 0]], None, r"poles: entry \(1, 1\) is not a finite number"),
    "infinite weight": (1, LINE, np.eye(2, 3), [1, math.inf], r"weights: entry \(1,\) is not a finite number"),
    "nan knot": (1, [0, 0, math.nan, 1], np.eye(2, 3), None, r"knots: entry \(2,\) is not a finite number"),
    "flat poles": (1, LINE, np.eye(2), None, r"poles have shape \(2, 2\); OCCT needs \(n, 3\)"),
    "weights too few": (1, LINE, np.eye(2, 3), [1], r"weights have shape \(1,\); the poles need \(2,\)"),
    "weight zero": (1, LINE, np.eye(2, 3), [1, 0], r"the smallest weight is 0"),
    "knots too few": (1, [0, 0, 1], np.eye(2, 3), None, r"2 poles of degree 1 need \(4,\)"),
    "knots falling": (1, [0, 1, 0.5, 1], np.eye(2, 3), None, "knot 2 is smaller than the one before it"),
    "degree zero": (0, [0, 1, 2], np.eye(2, 3), None, "degree 0; OCCT needs at least 1"),
    "no length": (1, [0, 0, 0, 0], np.eye(2, 3), None, "knot 0 is repeated 4 times"),
    "broken inside": (1, [0, 0, 0.5, 0.5, 1, 1], np.eye(4, 3), None, "knot 0.5 is repeated 2 times"),
    "knots one ulp apart": (1, [0, 0, 0.5, np.nextafter(0.5, 1), 1, 1], np.eye(4, 3), None, "differ by rounding only"),
}


@pytest.mark.parametrize("case", BAD_CURVES)
def test_bad_arrays_are_refused_with_the_reason(case):
    *arrays, message = BAD_CURVES[case]
    with pytest.raises(InputError, match=message):
        spline_arrays.curve_from_arrays(*arrays)


@pytest.mark.parametrize("seed", range(30))
def test_refuses_or_builds_but_never_lets_occt_raise(seed):
    """Random knots with repeats: whatever passes our checks passes OCCT's too."""
    rng = np.random.default_rng(seed)
    degree, count = int(rng.integers(1, 5)), int(rng.integers(2, 9))
    knots = np.sort(rng.integers(0, 6, count + degree + 1)) / 3.0
    try:
        curve = spline_arrays.curve_from_arrays(degree, knots, rng.normal(size=(count, 3)))
    except CqblendError:
        return
    assert curve.Degree() == degree
