"""The largest deviation of an edge from its face: never less than OCCT's exact search finds, or many samples do."""

import cadquery as cq
import numpy as np
import pytest
from OCP.Adaptor3d import Adaptor3d_CurveOnSurface
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepLib import BRepLib_ValidateEdge
from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
from OCP.GeomAdaptor import GeomAdaptor_Curve, GeomAdaptor_Surface
from OCP.gp import gp_Vec, gp_Vec2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from places import CASES

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.measurement.curve_deviation import measure_curve_deviation
from cqblend.brep.step_files import read_step
from cqblend.brep.topology import CONFUSION, attach_pcurves, explore_subshapes, make_bare_face, make_edge, make_vertex
from cqblend.errors import GeometryError
from cqblend.splines import Curve, interpolation

WHISKER = 1e-4
"""Relative: how much less than another search may be found."""

ROUNDING = 1e-12
"""mm"""


def search_by_occt(use, face) -> float:
    """Return what OCCT's own search for the largest deviation finds, in its exact mode."""
    curve, pcurve = BRep_Tool.Curve_s(use, 0.0, 0.0), BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0)
    image = Adaptor3d_CurveOnSurface(
        Geom2dAdaptor_Curve(pcurve, *BRep_Tool.Range_s(use, face)), GeomAdaptor_Surface(BRep_Tool.Surface_s(face))
    )
    search = BRepLib_ValidateEdge(
        GeomAdaptor_Curve(curve, *BRep_Tool.Range_s(use)), image, BRep_Tool.SameParameter_s(use)
    )
    search.SetExactMethod(True)
    search.Process()
    assert search.IsDone()
    return search.GetMaxDistance()


def search_densely(use, face, count=20001) -> float:
    """Return the largest deviation at many parameters, by OCCT's evaluation alone."""
    curve, surface = BRep_Tool.Curve_s(use, 0.0, 0.0), BRep_Tool.Surface_s(face)
    pcurve = BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0)
    ts = np.linspace(*BRep_Tool.Range_s(use), count).tolist()
    return max(curve.Value(t).Distance(surface.Value(*pcurve.Value(t).Coord())) for t in ts)


def random_spline_edge(seed: int):
    """Return an edge whose curve interpolates some points of the image of its pcurve: it strays in between.

    Surface and pcurve are random splines of random degrees and knots.
    """
    rng = np.random.default_rng(seed)
    degrees = tuple(int(p) for p in rng.integers(1, 6, 2))
    counts = [p + int(rng.integers(1, 9)) for p in degrees]
    x, y = np.meshgrid(*(np.linspace(0, 10, n) for n in counts), indexing="ij")
    poles = np.stack((x, y, rng.normal(size=x.shape)), axis=-1)
    weights = rng.uniform(0.5, 2, x.shape) if seed % 2 else None
    knots = tuple(clamped(rng, p, n) for p, n in zip(degrees, counts, strict=True))
    face = make_bare_face(spline_arrays.surface_from_arrays(degrees, knots, poles, weights))
    count = int(rng.integers(4, 12))
    pcurve = spline_arrays.curve2d_from_arrays(3, clamped(rng, 3, count), rng.uniform(0.05, 0.95, (count, 2)))
    surface = BRep_Tool.Surface_s(face)
    ts = np.linspace(0, 1, int(rng.integers(6, 40)))
    points = np.array([surface.Value(*pcurve.Value(t).Coord()).Coord() for t in ts.tolist()])
    degree, knots, poles, _ = interpolation.interpolate(ts, points).to_bspline()
    return make_face_edge(spline_arrays.curve_from_arrays(degree, knots, poles), pcurve, face), face


def make_face_edge(curve, pcurve, face, span=(0.0, 1.0)):
    ends = [make_vertex(np.array(curve.Value(t).Coord()), 1.0) for t in span]
    edge = make_edge(curve, (ends[0], ends[1]), span)
    attach_pcurves(edge, face, pcurve)
    return edge


def clamped(rng, degree: int, count: int) -> np.ndarray:
    inner = np.sort(rng.uniform(0.02, 0.98, count - degree - 1))
    return np.concatenate((np.zeros(degree + 1), inner, np.ones(degree + 1)))


@pytest.mark.parametrize("seed", range(24))
def test_random_splines(seed):
    edge, face = random_spline_edge(seed)
    found = measure_curve_deviation(edge, face)
    densely = search_densely(edge, face)
    assert densely * (1 - WHISKER) - ROUNDING <= found <= densely * (1 + 5e-3) + ROUNDING
    assert search_by_occt(edge, face) * (1 - WHISKER) - ROUNDING <= found


@pytest.mark.parametrize("at", [0.1234, 0.5, 0.98765])
@pytest.mark.parametrize("width", [1e-3, 1e-5, 1e-7])
def test_a_peak_in_a_short_span_is_found(at, width):
    """Between knots that are nearer than any equidistant samples, the pcurve alone leaves its line by 0.01."""
    knots = np.sort(np.concatenate((np.zeros(4), at + width * np.linspace(-2, 2, 5), np.ones(4))))
    degree, count = 3, len(knots) - 4
    greville = np.array([knots[i + 1 : i + 4].mean() for i in range(count)])
    poles = np.column_stack((greville, np.zeros(count)))
    poles[count // 2, 1] = 0.01
    face = cq.Face.makePlane(4, 4).wrapped
    pcurve = spline_arrays.curve2d_from_arrays(degree, knots, poles)
    plane = BRep_Tool.Surface_s(face)
    line = Curve.bezier([plane.Value(0, 0).Coord(), plane.Value(1, 0).Coord()]).to_bspline()
    edge = make_face_edge(spline_arrays.curve_from_arrays(*line[:3]), pcurve, face)
    assert measure_curve_deviation(edge, face) == pytest.approx(0.01 * 2 / 3, rel=0.2)
    assert measure_curve_deviation(edge, face) >= search_by_occt(edge, face) * (1 - WHISKER)


@pytest.mark.parametrize("shift", [1e-8, 1e-5, 0.2])
def test_a_moved_curve_deviates_by_its_move(shift):
    cylinder = cq.Solid.makeCylinder(3, 8)
    for face in cylinder.Faces():
        for use in explore_subshapes(face.wrapped, TopAbs_EDGE):
            curve = BRep_Tool.Curve_s(use, 0.0, 0.0).Translated(gp_Vec(0.48 * shift, 0.36 * shift, 0.8 * shift))
            moved = make_face_edge(
                curve, BRep_Tool.CurveOnSurface_s(use, face.wrapped, 0.0, 0.0), face.wrapped, BRep_Tool.Range_s(use)
            )
            assert measure_curve_deviation(moved, face.wrapped) == pytest.approx(shift, rel=1e-6, abs=1e-14)


def test_the_orientation_tells_the_sides_of_a_seam_apart():
    cylinder = cq.Solid.makeCylinder(3, 8)
    face = cylinder.Faces()[0].wrapped
    one, two = (use for use in explore_subshapes(face, TopAbs_EDGE) if BRep_Tool.IsClosed_s(use, face))
    pcurves = [BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0) for use in (one, two)]
    forward, reverse = pcurves if one.Orientation().name.endswith("FORWARD") else pcurves[::-1]
    BRep_Builder().UpdateEdge(one, forward, reverse.Translated(gp_Vec2d(0, 1e-3)), face, CONFUSION)
    assert sorted(measure_curve_deviation(use, face) for use in (one, two)) == pytest.approx([0.0, 1e-3], abs=1e-12)


def test_an_edge_of_another_parametrisation_is_measured_by_distance():
    """Its curve lies on the face, at other parameters: the flag says so, and OCCT's distances count."""
    edge, face = random_spline_edge(3)
    BRep_Builder().SameParameter(edge, False)
    assert measure_curve_deviation(edge, face) == pytest.approx(search_by_occt(edge, face), rel=1e-12)


def test_a_degenerate_edge_deviates_by_nothing_and_a_foreign_one_is_refused():
    ball = cq.Solid.makeSphere(2, angleDegrees1=-90)
    face = ball.Faces()[0].wrapped
    pole = next(use for use in explore_subshapes(face, TopAbs_EDGE) if BRep_Tool.Degenerated_s(use))
    assert measure_curve_deviation(pole, face) == 0.0
    foreign = cq.Edge.makeCircle(2).wrapped
    with pytest.raises(GeometryError, match="no curve in the parameter plane"):
        measure_curve_deviation(foreign, face)


@pytest.mark.skipif(not CASES.is_dir(), reason="the STEP cases are not at hand")
@pytest.mark.parametrize("name", ["occt__trj9_io1-sy-214.stp", "occt__ec_exhaust-A.stp", "f360__138756_a39897f4_0.stp"])
@pytest.mark.filterwarnings("ignore:.*damaged")
def test_edges_of_step_files_whose_pcurves_are_coarse(name):
    shape = read_step(CASES / name)
    for face in explore_subshapes(shape, TopAbs_FACE):
        for use in explore_subshapes(face, TopAbs_EDGE):
            if not BRep_Tool.Degenerated_s(use):
                found = measure_curve_deviation(use, face)
                assert found >= search_by_occt(use, face) * (1 - WHISKER) - ROUNDING
