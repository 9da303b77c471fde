"""Knots, knot lines and crossings: where they are known beforehand, and as OCCT's adaptors count them."""

import math

import numpy as np
import pytest
from OCP.Geom import (
    Geom_Circle,
    Geom_CylindricalSurface,
    Geom_OffsetSurface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_ToroidalSurface,
)
from OCP.Geom2d import Geom2d_Line
from OCP.GeomAbs import GeomAbs_C1, GeomAbs_C2, GeomAbs_C3, GeomAbs_CN
from OCP.GeomAdaptor import GeomAdaptor_Surface
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Ax3, gp_Dir, gp_Dir2d, gp_Pnt2d
from OCP.TColStd import TColStd_Array1OfReal

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.knot_lines import find_curve_knots, find_knot_crossings, find_knot_lines

KNOTS_U = np.array([0, 0, 0, 0, 0.2, 0.4, 0.4, 0.7, 0.7, 0.7, 1, 1, 1, 1])
KNOTS_V = np.array([0, 0, 0, 0.3, 0.6, 0.6, 1, 1, 1])


def sheet():
    """A cubic by quadratic sheet with single, double and triple knots."""
    x, y = np.meshgrid(np.linspace(0, 1, 10), np.linspace(0, 1, 6), indexing="ij")
    return spline_arrays.surface_from_arrays((3, 2), (KNOTS_U, KNOTS_V), np.stack((x, y, x * y), axis=-1))


def periodic():
    return GeomConvert.SurfaceToBSplineSurface_s(Geom_ToroidalSurface(gp_Ax3(), 5, 2))


def profile():
    return spline_arrays.curve_from_arrays(2, KNOTS_V, np.random.default_rng(0).normal(size=(6, 3)))


def intervals(adaptor, direction, order):
    count = getattr(adaptor, f"Nb{direction}Intervals")(order)
    ends = TColStd_Array1OfReal(1, count + 1)
    getattr(adaptor, f"{direction}Intervals")(ends, order)
    return [ends.Value(i) for i in range(1, count + 2)]


@pytest.mark.parametrize("bounds", [(0, 1, 0, 1), (0.1, 0.5, 0.35, 0.9)])
@pytest.mark.parametrize("order", [GeomAbs_C1, GeomAbs_C2, GeomAbs_C3])
@pytest.mark.parametrize(
    "make",
    [
        sheet,
        lambda: Geom_SurfaceOfLinearExtrusion(profile(), gp_Dir(0, 0, 1)),
        lambda: Geom_CylindricalSurface(gp_Ax3(), 1),
    ],
)
def test_knot_lines_of_a_class_are_the_intervals_of_occt(make, order, bounds):
    surface = make()
    adaptor = GeomAdaptor_Surface(surface, *bounds)
    found = find_knot_lines(SurfaceEvaluator(surface), order, bounds)
    for direction, ends in zip("UV", found, strict=True):
        np.testing.assert_allclose(ends, intervals(adaptor, direction, order), atol=1e-15)


def test_all_knots_bound_polynomials_also_smooth_ones():
    u, v = find_knot_lines(SurfaceEvaluator(sheet()), GeomAbs_CN)
    assert u.tolist() == [0, 0.2, 0.4, 0.7, 1]
    assert v.tolist() == [0, 0.3, 0.6, 1]


def test_offset_surfaces_have_the_intervals_of_occt():
    surface = Geom_OffsetSurface(GeomConvert.SurfaceToBSplineSurface_s(smooth_sheet()), 0.1)
    u, _ = find_knot_lines(SurfaceEvaluator(surface), GeomAbs_C1)
    assert 0.4 in u.tolist()


def smooth_sheet():
    x, y = np.meshgrid(np.linspace(0, 1, 6), np.linspace(0, 1, 4), indexing="ij")
    knots = np.array([0, 0, 0, 0, 0.4, 0.4, 1, 1, 1, 1]), np.array([0, 0, 0, 0, 1, 1, 1, 1])
    return spline_arrays.surface_from_arrays((3, 3), knots, np.stack((x, y, x**2 * y), axis=-1))


def test_knots_of_a_periodic_spline_repeat_over_the_range():
    circle = GeomConvert.CurveToBSplineCurve_s(Geom_Circle(gp_Ax3().Ax2(), 2))
    own = [circle.Knot(i) for i in range(1, circle.NbKnots() + 1)]
    found = find_curve_knots(CurveEvaluator(circle), own[0] - 1.0, own[-1] + 1.0)
    inside = [k + m * (own[-1] - own[0]) for m in (-1, 0, 1) for k in own[:-1]]
    expected = sorted(k for k in inside if own[0] - 1 < k < own[-1] + 1)
    np.testing.assert_allclose(found, [own[0] - 1, *expected, own[-1] + 1], atol=1e-14)


def test_a_straight_pcurve_crosses_where_it_is_at_a_knot():
    surface = SurfaceEvaluator(sheet())
    line = Geom2d_Line(gp_Pnt2d(0.05, 0.9), gp_Dir2d(0.8, -0.6))
    found = np.sort(find_knot_crossings(CurveEvaluator(line), 0.0, 1.1, surface))
    at_u = [(k - 0.05) / 0.8 for k in (0.2, 0.4, 0.7)]
    at_v = [(0.9 - k) / 0.6 for k in (0.3, 0.6)]
    np.testing.assert_allclose(found, sorted(at_u + at_v), atol=1e-15)
    by_samples = find_knot_crossings(lambda t: CurveEvaluator(line)(t)[0], 0.0, 1.1, surface)
    np.testing.assert_allclose(np.sort(by_samples), found, atol=1e-14)


def test_a_pcurve_along_a_knot_line_does_not_cross_it():
    surface = SurfaceEvaluator(sheet())
    line = Geom2d_Line(gp_Pnt2d(0.0, 0.3), gp_Dir2d(1, 0))
    found = find_knot_crossings(CurveEvaluator(line), 0.0, 1.0, surface)
    np.testing.assert_allclose(np.sort(found), [0.2, 0.4, 0.7], atol=1e-15)


def test_crossings_go_on_round_a_periodic_surface():
    surface = SurfaceEvaluator(periodic())
    u, _ = find_knot_lines(surface, GeomAbs_CN)
    line = Geom2d_Line(gp_Pnt2d(0.5, 0.1), gp_Dir2d(1, 0))
    found = np.sort(find_knot_crossings(CurveEvaluator(line), 0.0, 4 * math.pi, surface)) + 0.5
    every = np.concatenate([u[:-1] + 2 * math.pi * m for m in range(-1, 4)])
    np.testing.assert_allclose(found, np.sort(every[(every > 0.5) & (every < 0.5 + 4 * math.pi)]), atol=1e-12)


def test_a_curved_pcurve_is_at_a_knot_line_where_it_is_said_to_cross():
    surface = SurfaceEvaluator(sheet())
    curve = CurveEvaluator(
        spline_arrays.curve2d_from_arrays(3, [0] * 4 + [1] * 4, [(0.05, 0.1), (0.4, 0.95), (0.65, 0.05), (0.95, 0.9)])
    )
    found = find_knot_crossings(curve, 0.0, 1.0, surface)
    uv = curve.evaluate_by_occt(found)[0]
    lines = find_knot_lines(surface, GeomAbs_CN)
    nearest = np.minimum(*(np.abs(uv[k, :, None] - lines[k][1:-1]).min(axis=1) for k in (0, 1)))
    dense = curve.evaluate_by_occt(np.linspace(0, 1, 2001))[0]
    signs = [np.sign(dense[k] - line) for k in (0, 1) for line in lines[k][1:-1]]
    assert len(found) == sum(int((np.diff(sign) != 0).sum()) for sign in signs)
    assert nearest.max() < 1e-15
