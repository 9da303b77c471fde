"""Faces to splines: OCCT's own evaluation is the judge, at random parameters carried over by the parameter map."""

import math

import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_Transform
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeTorus
from OCP.BRepTools import BRepTools
from OCP.Geom import (
    Geom_BezierCurve,
    Geom_BezierSurface,
    Geom_Circle,
    Geom_ConicalSurface,
    Geom_CylindricalSurface,
    Geom_Ellipse,
    Geom_Hyperbola,
    Geom_Line,
    Geom_OffsetCurve,
    Geom_OffsetSurface,
    Geom_Parabola,
    Geom_Plane,
    Geom_RectangularTrimmedSurface,
    Geom_SphericalSurface,
    Geom_SurfaceOfLinearExtrusion,
    Geom_SurfaceOfRevolution,
    Geom_ToroidalSurface,
    Geom_TrimmedCurve,
)
from OCP.GeomAPI import GeomAPI_Interpolate
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Ax1, gp_Ax2, gp_Ax3, gp_Dir, gp_Pln, gp_Pnt, gp_Trsf, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.TColgp import TColgp_Array1OfPnt, TColgp_Array2OfPnt, TColgp_HArray1OfPnt
from OCP.TColStd import TColStd_Array1OfReal
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Face

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.conversion.spline_conversion import ConicArcs, ParameterMap, to_face, to_surface, to_surface_with_map
from cqblend.brep.conversion.tolerances import CONVERSION_TOLERANCES
from cqblend.errors import DegreeError, GeometryError, InputError
from cqblend.splines.surface import Surface

PI = math.pi
FRAME = gp_Ax3(gp_Pnt(3, -2, 5), gp_Dir(1, 2, 3), gp_Dir(2, -1, 0.5))
PLACE = gp_Ax2(gp_Pnt(3, -2, 5), gp_Dir(1, 2, 3))
AXIS = gp_Ax1(gp_Pnt(-20, 1, 2), gp_Dir(0.2, 1, -0.3))


def left_handed() -> gp_Ax3:
    frame = gp_Ax3(FRAME.Location(), FRAME.Direction(), FRAME.XDirection())
    frame.YReverse()
    return frame


def bezier_curve(rational: bool):
    rng = np.random.default_rng(11)
    points, weights = TColgp_Array1OfPnt(1, 5), TColStd_Array1OfReal(1, 5)
    for i, (point, weight) in enumerate(zip(rng.normal(size=(5, 3)) * 4, rng.uniform(0.5, 2, 5), strict=True)):
        points.SetValue(i + 1, gp_Pnt(*point))
        weights.SetValue(i + 1, weight)
    return Geom_BezierCurve(points, weights) if rational else Geom_BezierCurve(points)


def interpolated(periodic: bool):
    points = TColgp_HArray1OfPnt(1, 8)
    for i in range(8):
        points.SetValue(i + 1, gp_Pnt(8 * math.cos(i * PI / 4), 5 * math.sin(i * PI / 4), i % 3))
    fit = GeomAPI_Interpolate(points, periodic, 1e-9)
    fit.Perform()
    return fit.Curve()


def bspline_surface(rational: bool, seed: int = 5):
    rng = np.random.default_rng(seed)
    knots_u = np.repeat([-1.0, 0.25, 1.0, 3.0], [4, 1, 2, 4])
    knots_v = np.repeat([0.0, 0.5, 2.0], [3, 1, 3])
    poles = np.stack(np.meshgrid(np.linspace(-9, 9, 7), np.linspace(-5, 5, 4), [0.0], indexing="ij"), -1)[:, :, 0]
    weights = rng.uniform(0.5, 2, (7, 4)) if rational else None
    return spline_arrays.surface_from_arrays((3, 2), (knots_u, knots_v), poles + rng.normal(size=poles.shape), weights)


def bezier_surface():
    rng = np.random.default_rng(13)
    points = TColgp_Array2OfPnt(1, 4, 1, 3)
    for i in range(4):
        for j in range(3):
            points.SetValue(i + 1, j + 1, gp_Pnt(4 * i, 5 * j, *rng.normal(size=1)))
    return Geom_BezierSurface(points)


def face_of(surface, *bounds: float) -> TopoDS_Face:
    return BRepBuilderAPI_MakeFace(surface, *(bounds or surface.Bounds()), 1e-7).Face()


def periodic_surface():
    return GeomConvert.SurfaceToBSplineSurface_s(Geom_ToroidalSurface(FRAME, 7, 2))


def extruded(curve, *bounds: float):
    return lambda: face_of(Geom_SurfaceOfLinearExtrusion(curve, gp_Dir(0.1, 0.2, 1)), *bounds)


def revolved(curve, *bounds: float):
    return lambda: face_of(Geom_SurfaceOfRevolution(curve, AXIS), *bounds)


def trimmed_twice():
    surface = Geom_RectangularTrimmedSurface(Geom_CylindricalSurface(FRAME, 4), 1.0, 5.0, -3.0, 8.0)
    return face_of(surface, 1.5, 4.0, -2.0, 6.0)


EXACT = {
    "plane": lambda: face_of(Geom_Plane(FRAME), -3, 7, 2, 4),
    "cylinder": lambda: face_of(Geom_CylindricalSurface(FRAME, 4), 0.3, 2.9, -3, 8),
    "cylinder, whole": lambda: face_of(Geom_CylindricalSurface(FRAME, 4), 0, 2 * PI, -3, 8),
    "cylinder across its seam": lambda: face_of(Geom_CylindricalSurface(FRAME, 4), 5.5, 7.5, -3, 8),
    "cylinder, left-handed": lambda: face_of(Geom_CylindricalSurface(left_handed(), 4), 0.3, 4.9, -3, 8),
    "cone": lambda: face_of(Geom_ConicalSurface(FRAME, 0.4, 3), 1, 4, -2, 8),
    "cone to its apex": lambda: face_of(Geom_ConicalSurface(FRAME, 0.4, 3), 0, 2 * PI, -3 / math.sin(0.4), 4),
    "cone, falling and left-handed": lambda: face_of(Geom_ConicalSurface(left_handed(), -0.7, 5), 0, 2 * PI, -2, 6),
    "sphere": lambda: face_of(Geom_SphericalSurface(FRAME, 6), 0.5, 2, -0.4, 1.2),
    "sphere, whole": lambda: face_of(Geom_SphericalSurface(FRAME, 6)),
    "torus": lambda: face_of(Geom_ToroidalSurface(FRAME, 7, 2), 0.5, 2, 2.5, 6),
    "torus, whole": lambda: face_of(Geom_ToroidalSurface(FRAME, 7, 2)),
    "torus, left-handed": lambda: face_of(Geom_ToroidalSurface(left_handed(), 7, 2), 1, 3, 5, 8),
    "revolved line": revolved(Geom_Line(gp_Pnt(3, 1, 2), gp_Dir(1, 1, 1)), 0.2, 5, -3, 6),
    "revolved circle": revolved(Geom_Circle(PLACE, 3), 0.2, 2, 1, 5.5),
    "revolved ellipse": revolved(Geom_Ellipse(PLACE, 5, 2), 0, 2 * PI, 0, 2 * PI),
    "revolved parabola": revolved(Geom_Parabola(PLACE, 1.5), 0.2, 3, -4, 3),
    "revolved hyperbola": revolved(Geom_Hyperbola(PLACE, 3, 2), 0.2, 3, -1.5, 2),
    "revolved Bezier": revolved(bezier_curve(True), 1, 6, 0.1, 0.9),
    "revolved B-spline": revolved(interpolated(False), 0, 2 * PI, 2.0, 20.0),
    "revolved trimmed circle": revolved(Geom_TrimmedCurve(Geom_Circle(PLACE, 3), 1, 4), 0.2, 2, 1.5, 3.5),
    "extruded line": extruded(Geom_Line(gp_Pnt(3, 1, 2), gp_Dir(1, 1, 1)), -3, 6, 1, 2),
    "extruded circle": extruded(Geom_Circle(PLACE, 3), 0, 2 * PI, -5, 5),
    "extruded ellipse": extruded(Geom_Ellipse(PLACE, 5, 2), 4, 8, -5, 5),
    "extruded parabola": extruded(Geom_Parabola(PLACE, 1.5), -2, 5, 0, 4),
    "extruded hyperbola": extruded(Geom_Hyperbola(PLACE, 3, 2), -1, 2.5, 0, 4),
    "extruded Bezier": extruded(bezier_curve(False), 0, 1, -5, 5),
    "extruded periodic spline": extruded(interpolated(True), 0, interpolated(True).LastParameter(), -1, 1),
    "extruded periodic spline across its seam": extruded(interpolated(True), 20, 50, -1, 1),
    "Bezier": lambda: face_of(bezier_surface()),
    "Bezier, part": lambda: face_of(bezier_surface(), 0.2, 0.7, 0.1, 1),
    "B-spline": lambda: face_of(bspline_surface(False)),
    "B-spline, rational": lambda: face_of(bspline_surface(True)),
    "B-spline, part": lambda: face_of(bspline_surface(True), -0.5, 2, 0.3, 1.9),
    "B-spline, periodic": lambda: face_of(periodic_surface()),
    "B-spline, periodic, part": lambda: face_of(periodic_surface(), 1, 3, 2, 4),
    "B-spline, periodic, across its seam": lambda: face_of(periodic_surface(), 5, 7.5, 4, 9),
    "trimmed": trimmed_twice,
    "offset plane": lambda: face_of(Geom_OffsetSurface(Geom_Plane(FRAME), 1.5), -3, 7, 2, 4),
    "offset cylinder": lambda: face_of(Geom_OffsetSurface(Geom_CylindricalSurface(FRAME, 4), -1.5), 1, 4, 2, 4),
    "offset cone": lambda: face_of(Geom_OffsetSurface(Geom_ConicalSurface(FRAME, 0.4, 3), 1), 1, 4, 2, 4),
    "offset sphere": lambda: face_of(Geom_OffsetSurface(Geom_SphericalSurface(FRAME, 6), 1.5), 1, 4, -1, 1),
    "offset torus": lambda: face_of(Geom_OffsetSurface(Geom_ToroidalSurface(FRAME, 7, 2), 0.5), 1, 4, 2, 5),
}
OFFSET = {
    "offset B-spline": lambda: face_of(Geom_OffsetSurface(bspline_surface(False, 3), 0.3), 1.1, 2.8, 0.6, 1.9),
    "offset extrusion": lambda: face_of(
        Geom_OffsetSurface(Geom_SurfaceOfLinearExtrusion(Geom_Ellipse(PLACE, 5, 2), gp_Dir(0.1, 0.2, 1)), 1),
        *(0.5, 3, -2, 3),
    ),
    "extruded offset curve": extruded(Geom_OffsetCurve(Geom_Ellipse(PLACE, 5, 2), 1, gp_Dir(1, 2, 3)), 0.5, 3, -2, 3),
}
TYPES = {**EXACT, **OFFSET}


def placed(face: TopoDS_Face, how: str) -> TopoDS_Face:
    move = gp_Trsf()
    if how == "reversed":
        return TopoDS.Face_s(face.Reversed())
    if how == "located":
        move.SetRotation(gp_Ax1(gp_Pnt(1, 2, 3), gp_Dir(1, -1, 2)), 0.8)
        turn = gp_Trsf()
        turn.SetTranslation(gp_Vec(30, -20, 10))
        return TopoDS.Face_s(face.Moved(TopLoc_Location(turn.Multiplied(move))))
    if how == "mirrored":
        move.SetMirror(gp_Ax2(gp_Pnt(1, 2, 3), gp_Dir(1, -1, 2)))
        return TopoDS.Face_s(BRepBuilderAPI_Transform(face, move, True).Shape())
    return face


def xyz(point) -> np.ndarray:
    return np.array([point.X(), point.Y(), point.Z()])


@pytest.mark.parametrize("how", ["as it is", "reversed", "located", "mirrored"])
@pytest.mark.parametrize("name", TYPES)
def test_surface_is_occts_surface(name, how):
    face = placed(TYPES[name](), how)
    surface, parameters = to_surface_with_map(face)
    truth = BRep_Tool.Surface_s(face)
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    np.testing.assert_allclose(np.ravel(surface.domain), [u0, u1, v0, v1], atol=1e-9)
    (u0, u1), (v0, v1) = surface.domain
    rng = np.random.default_rng(17)
    uv = rng.uniform([u0, v0], [u1, v1], (60, 2))
    uv[:4] = [[u0, v0], [u0, v1], [u1, v0], [u1, v1]]
    there = parameters.to_spline(uv)
    np.testing.assert_allclose(parameters.to_face(there), uv, rtol=0, atol=1e-12)
    points, du, dv = (surface(there[:, 0], there[:, 1], i, j) for i, j in ((0, 0), (1, 0), (0, 1)))
    size = np.ptp(points, axis=0).max()
    exact = name in EXACT
    for k, (u, v) in enumerate(uv):
        point, along_u, along_v = gp_Pnt(), gp_Vec(), gp_Vec()
        truth.D1(u, v, point, along_u, along_v)
        assert (
            np.linalg.norm(points[k] - xyz(point))
            < (1e-12 if exact else CONVERSION_TOLERANCES.offset_surface_error) * size
        )
        for arcs, mine, other in ((parameters.u, du[k], xyz(along_u)), (parameters.v, dv[k], xyz(along_v))):
            tolerance = (1e-11 if exact else 1e-4) * (np.linalg.norm(other) + size * 1e-2)
            if arcs is None:
                assert np.linalg.norm(mine - other) < tolerance
            elif np.linalg.norm(mine) > 1e-6 * size:
                assert np.linalg.norm(np.cross(mine, other)) / np.linalg.norm(mine) < tolerance
                assert mine @ other >= 0


@pytest.mark.parametrize("name", TYPES)
def test_parameters_are_the_faces_own_where_promised(name):
    own = to_surface_with_map(TYPES[name]())[1] == ParameterMap()
    conic = ("cylinder", "cone", "sphere", "torus", "revolved", "circle", "ellipse", "hyperbola", "trimmed")
    assert own == (not any(word in name for word in conic) or name == "offset extrusion")


@pytest.mark.parametrize("name", [name for name in EXACT if name != "offset cone"])
def test_face_of_the_surface_is_valid_and_keeps_the_parametrisation(name):
    surface = to_surface(EXACT[name]())
    face = to_face(surface)
    assert BRepCheck_Analyzer(face).IsValid()
    geometry = BRep_Tool.Surface_s(face)
    (u0, u1), (v0, v1) = surface.domain
    np.testing.assert_allclose(BRepTools.UVBounds_s(face), [u0, u1, v0, v1], atol=1e-12)
    for u, v in np.random.default_rng(19).uniform([u0, v0], [u1, v1], (20, 2)):
        assert np.linalg.norm(xyz(geometry.Value(u, v)) - surface(u, v)) < 1e-13 * 40
    np.testing.assert_array_equal(to_surface(face).coefs, surface.coefs)


def area(face: TopoDS_Face) -> float:
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, properties, 1e-9)
    return properties.Mass()


@pytest.mark.parametrize(
    ("name", "expected"),
    [("sphere, whole", 4 * PI * 36), ("torus, whole", 4 * PI**2 * 14), ("cylinder, whole", 2 * PI * 4 * 11)],
)
def test_closed_surfaces_make_faces_of_the_right_area(name, expected):
    """The whole, and once; OCCT's quadrature is good to 2e-7 here, exactness is tested point by point above."""
    assert area(to_face(to_surface(EXACT[name]()))) == pytest.approx(expected, rel=1e-6)


def test_a_scaled_location_keeps_the_parameters_of_the_face():
    move = gp_Trsf()
    move.SetScale(gp_Pnt(1, 2, 3), 2.5)
    face = TopoDS.Face_s(EXACT["cone"]().Moved(TopLoc_Location(move), False))
    surface, parameters = to_surface_with_map(face)
    truth = BRepAdaptor_Surface(face)
    (u0, u1), (v0, v1) = surface.domain
    for u, v in np.random.default_rng(29).uniform([u0, v0], [u1, v1], (20, 2)):
        found = surface(*parameters.to_spline([u, v]))
        assert np.linalg.norm(found - xyz(truth.Value(u, v))) < 1e-12 * 20


def test_polynomial_bspline_passes_bit_for_bit():
    geometry = bspline_surface(False)
    before = spline_arrays.surface_to_arrays(geometry)
    after = to_surface(face_of(geometry)).to_bspline()
    np.testing.assert_array_equal(after[2], before[2])
    assert after[3] is None


def test_arcs_are_few_and_weights_mild():
    surface = to_surface(EXACT["torus, whole"]())
    assert surface.degree == (2, 2)
    assert [len(b) - 1 for b in surface.breaks] == [3, 3]
    assert surface.to_bspline()[3].min() == pytest.approx(0.25)
    assert len(to_surface(face_of(Geom_CylindricalSurface(FRAME, 1), 0, 2 * PI / 3, 0, 1)).breaks[0]) == 2


@pytest.mark.parametrize(
    "arcs", [ConicArcs(np.linspace(-1, 5.2, 4)), ConicArcs(np.array([-1.5, 0.2, 2.0]), hyperbolic=True)]
)
def test_arcs_there_and_back(arcs):
    inside = np.random.default_rng(23).uniform(arcs.breaks[0], arcs.breaks[-1], (50, 3))
    np.testing.assert_allclose(arcs.to_conic(arcs.to_spline(inside)), inside, atol=1e-14)
    np.testing.assert_allclose(arcs.to_spline(arcs.breaks), arcs.breaks, atol=1e-15)
    beyond = arcs.breaks[[0, -1]] + [-0.3, 0.3]
    np.testing.assert_allclose(arcs.to_conic(arcs.to_spline(beyond)), beyond, atol=1e-13)


def test_beyond_its_end_an_arc_stays_on_the_circle():
    surface, parameters = to_surface_with_map(face_of(Geom_CylindricalSurface(gp_Ax3(), 4), 0.5, 1.5, 0, 1))
    u, v = parameters.to_spline([[0.1, 0.5], [2.0, 0.5]]).T
    expected = [[4 * math.cos(a), 4 * math.sin(a), 0.5] for a in (0.1, 2.0)]
    np.testing.assert_allclose(surface(u, v), expected, atol=1e-14)


def test_every_face_of_a_solid():
    for solid in (BRepPrimAPI_MakeBox(1, 2, 3).Shape(), BRepPrimAPI_MakeTorus(9, 2, 1.0).Shape()):
        explorer = TopExp_Explorer(solid, TopAbs_ShapeEnum.TopAbs_FACE)
        while explorer.More():
            face = TopoDS.Face_s(explorer.Current())
            assert BRepCheck_Analyzer(to_face(to_surface(face))).IsValid()
            explorer.Next()


def test_what_is_not_a_bounded_face_is_refused():
    with pytest.raises(InputError, match="is not a face"):
        to_surface(BRepPrimAPI_MakeBox(1, 2, 3).Shape())
    with pytest.raises(InputError, match="is not a face"):
        to_surface(TopoDS_Face())
    with pytest.raises(InputError, match="the face is unbounded; trim it first"):
        to_surface(BRepBuilderAPI_MakeFace(gp_Pln()).Face())


def test_what_occt_cannot_hold_is_refused():
    line = np.array([0.0, 0, 1, 1])
    high = np.repeat([0.0, 1.0], 27)
    poles = np.stack(np.meshgrid(np.linspace(0, 1, 27), [0.0, 1.0], [0.0], indexing="ij"), -1)[:, :, 0]
    with pytest.raises(DegreeError, match="degree 26"):
        to_face(Surface.from_bspline((26, 1), (high, line), poles))
    with pytest.raises(InputError, match="dimension 2"):
        to_face(Surface.from_bspline((1, 1), (line, line), np.zeros((2, 2, 2))))
    with pytest.raises(GeometryError):
        to_face(Surface.from_bspline((1, 1), (line, line), np.zeros((2, 2, 3))))


def test_a_crease_is_kept():
    knots = np.array([0.0, 0, 1, 2, 2])
    poles = np.array([[[x, y, abs(x - 1)] for y in (0.0, 1.0)] for x in (0.0, 1.0, 2.0)])
    surface = Surface.from_bspline((1, 1), (knots, knots[[0, 1, 3, 4]]), poles)
    face = to_face(surface)
    assert BRepCheck_Analyzer(face).IsValid()
    assert xyz(BRep_Tool.Surface_s(face).Value(1.0, 0.5)) == pytest.approx([1, 0.25, 0])
