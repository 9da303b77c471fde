"""Edges that stray from their faces between the parameters OCCT looks at: cut, they get the tolerance they need."""

import json
from functools import cache

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.Geom2dAPI import Geom2dAPI_Interpolate
from OCP.GeomAPI import GeomAPI_Interpolate
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.TColgp import TColgp_HArray1OfPnt, TColgp_HArray1OfPnt2d
from OCP.TColStd import TColStd_HArray1OfReal
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopoDS import TopoDS
from places import CASES

import cqblend
from cqblend.brep.measurement.curve_deviation import measure_curve_deviation
from cqblend.brep.step_files import read_step
from cqblend.brep.topology import ShapeIndex, explore_subshapes, find_end_vertices, locate_vertex

V = cq.Vector
STRAY = 2e-3


def wave(first: float, last: float) -> tuple[list[float], list[float]]:
    """Return parameters and a wave over them that vanishes at 23 equidistant ones, where OCCT looks, and only there."""
    count = 22 * 4 + 1
    return np.linspace(first, last, count).tolist(), (STRAY * np.sin(np.pi * np.arange(count) / 4)).tolist()


def stray_on_face(body: cq.Shape, edge: cq.Edge) -> None:
    """Let an edge's parameter curve on the top face of a box run in waves; its curve in space stays straight."""
    face = next(f for f in edge.ancestors(body, "Face").Faces() if f.normalAt().z > 0.9)
    line = BRep_Tool.CurveOnSurface_s(edge.wrapped, face.wrapped, 0.0, 0.0)
    ts, away = wave(*BRep_Tool.Range_s(edge.wrapped))
    points, parameters = TColgp_HArray1OfPnt2d(1, len(ts)), TColStd_HArray1OfReal(1, len(ts))
    for i, (t, off) in enumerate(zip(ts, away, strict=True), 1):
        u, v = line.Value(t).Coord()
        points.SetValue(i, gp_Pnt2d(u + off, v + off))
        parameters.SetValue(i, t)
    fit = Geom2dAPI_Interpolate(points, parameters, False, 1e-12)
    fit.Perform()
    BRep_Builder().UpdateEdge(edge.wrapped, fit.Curve(), face.wrapped, 1e-7)


def stray_in_space(body: cq.Shape, edge: cq.Edge) -> None:
    """Let an edge's curve in space run in waves above the top face of a box; nothing on a face is so high."""
    line = BRep_Tool.Curve_s(edge.wrapped, 0.0, 0.0)
    ts, away = wave(*BRep_Tool.Range_s(edge.wrapped))
    points, parameters = TColgp_HArray1OfPnt(1, len(ts)), TColStd_HArray1OfReal(1, len(ts))
    for i, (t, off) in enumerate(zip(ts, away, strict=True), 1):
        x, y, z = line.Value(t).Coord()
        points.SetValue(i, gp_Pnt(x, y, z + off))
        parameters.SetValue(i, t)
    fit = GeomAPI_Interpolate(points, parameters, False, 1e-12)
    fit.Perform()
    BRep_Builder().UpdateEdge(edge.wrapped, fit.Curve(), 1e-7)


def dense(edge, face, count=3001) -> float:
    """Return the largest deviation found at many parameters, by OCCT's evaluation alone."""
    first, last = BRep_Tool.Range_s(edge)
    curve, surface = BRep_Tool.Curve_s(edge, 0.0, 0.0), BRep_Tool.Surface_s(face)
    pcurve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
    ts = np.linspace(first, last, count).tolist()
    return max(curve.Value(t).Distance(surface.Value(*pcurve.Value(t).Coord())) for t in ts)


def nearest(body: cq.Shape, x: float, y: float, z: float) -> cq.Edge:
    return min(body.Edges(), key=lambda e: (e.Center() - V(x, y, z)).Length)


def straying_box(stray) -> cq.Shape:
    """A valid box, two of whose edges stray between the parameters looked at."""
    box = cq.Solid.makeBox(40, 20, 10)
    for y in (0, 20):
        stray(box, nearest(box, 20, y, 10))
    return box


def tolerances(body: cq.Shape) -> list[float]:
    edges = [BRep_Tool.Tolerance_s(edge.wrapped) for edge in body.Edges()]
    return edges + [BRep_Tool.Tolerance_s(vertex.wrapped) for vertex in body.Vertices()]


@pytest.mark.parametrize("stray", [stray_on_face, stray_in_space])
def test_deviations_are_found_between_the_parameters_that_are_looked_at(stray):
    box = straying_box(stray)
    edge = nearest(box, 20, 0, 10).wrapped
    for face in edge_faces(box, edge):
        measured = dense(edge, face)
        assert measured <= measure_curve_deviation(edge, face) * (1 + 1e-9) + 1e-15
        assert measure_curve_deviation(edge, face) <= 1.05 * measured + 1e-12
    assert max(measure_curve_deviation(edge, face) for face in edge_faces(box, edge)) > 0.9 * STRAY


def edge_faces(body: cq.Shape, edge) -> list:
    return [face.wrapped for face in cq.Edge(edge).ancestors(body, "Face").Faces()]


@pytest.mark.parametrize("stray", [stray_on_face, stray_in_space])
def test_a_valid_body_stays_valid_when_an_edge_that_strays_is_cut(stray):
    """What only a parameter curve does is mended; where the curve itself leaves the face, the tolerance says so."""
    box = straying_box(stray)
    assert box.isValid()
    assert not BRepCheck_Analyzer(box.wrapped, True, False, True).IsValid()
    before = tolerances(box)
    result = cqblend.blend_edges(box, nearest(box, 0, 10, 10), 3)
    assert tolerances(box) == before  # what the input has in common with the result is as it was
    assert result.shape.isValid()
    assert result.certificate.valid
    assert BRepCheck_Analyzer(result.shape.wrapped, True, False, True).IsValid()
    old = ShapeIndex(box.wrapped, TopAbs_EDGE)
    new = [edge for edge in result.shape.Edges() if not old.find_number(edge.wrapped)]
    needed = {edge: max(dense(edge.wrapped, face) for face in edge_faces(result.shape, edge.wrapped)) for edge in new}
    assert (max(needed.values()) > 0.9 * STRAY) == (stray is stray_in_space)
    assert max(needed.values()) < (1e-9 if stray is stray_on_face else 2 * STRAY)
    for edge, deviates in needed.items():
        assert deviates <= BRep_Tool.Tolerance_s(edge.wrapped) <= max(1.2 * deviates, 1.1e-7)
        for vertex in find_end_vertices(edge.wrapped):
            inherited = any(vertex.IsSame(v.wrapped) for v in box.Vertices())
            assert inherited or BRep_Tool.Tolerance_s(vertex) >= BRep_Tool.Tolerance_s(edge.wrapped)
    assert result.certificate.edge_tolerance == max(BRep_Tool.Tolerance_s(edge.wrapped) for edge in new)
    assert result.certificate.tolerance < 2e-7  # of the rails, which stray nowhere


def test_a_body_that_is_not_valid_is_blended_and_not_called_valid():
    """A hole's rim with a parameter curve out of place by 0.01 mm: nothing that the blend touches."""
    part = cq.Workplane().box(10, 10, 10).faces("<Z").workplane().hole(3)
    side = part.faces("%CYLINDER").val().wrapped
    rim = part.edges("%CIRCLE").edges("<Z").val().wrapped
    pcurve = BRep_Tool.CurveOnSurface_s(rim, side, 0.0, 0.0)
    pcurve.Translate(gp_Pnt2d(0, 0), gp_Pnt2d(0, 0.01))
    assert not part.val().isValid()
    result = cqblend.blend_edges(part, part.edges("|Z and >X and >Y"), 2)
    assert not result.shape.isValid()
    assert not result.certificate.valid
    assert str(result.certificate).startswith("INVALID")
    assert not cqblend.verify(result.shape).valid


body_of = cache(lambda name: read_step(CASES / name))


def listed() -> list[tuple[str, int, float]]:
    """Return the edges of which results were not valid although their bodies were, or that were refused for that."""
    if not CASES.is_dir():
        return []
    rows = json.loads((CASES / "edges_more.json").read_text())
    faults = ("returned, but IsValid() is false", "refused")
    return [
        (row["file"], row["edge"], row["radius"])
        for row in rows
        if row["cqblend"] in faults and (row["cqblend"] == faults[0] or "did not verify" in row["why"])
    ]


@pytest.mark.skipif(not CASES.is_dir(), reason="the STEP cases are not at hand")
@pytest.mark.parametrize(("name", "number", "radius"), listed())
def test_edges_of_step_files_whose_neighbours_stray(name, number, radius):
    shape = body_of(name)
    assert BRepCheck_Analyzer(shape).IsValid()
    points = [
        locate_vertex(vertex) for edge in explore_subshapes(shape, TopAbs_EDGE) for vertex in find_end_vertices(edge)
    ]
    before = [BRep_Tool.Tolerance_s(TopoDS.Edge_s(edge)) for edge in explore_subshapes(shape, TopAbs_EDGE)]
    edge = ShapeIndex(shape, TopAbs_EDGE)[number]
    result = cqblend.blend_edges(shape, edge, radius, ends="flat", chain=False)
    assert BRepCheck_Analyzer(result.shape).IsValid()
    assert result.certificate.angle < 1e-6
    assert [BRep_Tool.Tolerance_s(TopoDS.Edge_s(edge)) for edge in explore_subshapes(shape, TopAbs_EDGE)] == before
    again = [
        locate_vertex(vertex) for edge in explore_subshapes(shape, TopAbs_EDGE) for vertex in find_end_vertices(edge)
    ]
    assert np.array_equal(points, again)
    # face by face, no face that was exactly valid has become less
    exact = BRepCheck_Analyzer(shape, True, False, True)
    after = BRepCheck_Analyzer(result.shape, True, False, True)
    was_bad = [face for face in explore_subshapes(shape, TopAbs_FACE) if not exact.IsValid(face)]
    is_bad = [face for face in explore_subshapes(result.shape, TopAbs_FACE) if not after.IsValid(face)]
    surfaces = [BRep_Tool.Surface_s(TopoDS.Face_s(face)) for face in was_bad]
    assert all(any(BRep_Tool.Surface_s(TopoDS.Face_s(face)) is one for one in surfaces) for face in is_bad)
