"""Faces that go on in a neighbour on the same surface are seen through; picks with nothing to blend are passed over."""

from __future__ import annotations

import math
from io import BytesIO

import cadquery as cq
import pytest
from OCP.BinTools import BinTools
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.TopAbs import TopAbs_EDGE

import cqblend
from cqblend.brep.topology import ShapeIndex
from cqblend.certificate import SkippedEdges
from cqblend.errors import SelectionError

V = cq.Vector
W = cq.Workplane


def near(body: cq.Shape, *point: float) -> list[cq.Edge]:
    return [edge for edge in body.Edges() if (edge.Center() - V(*point)).Length < 1e-6]


def circles(body: cq.Shape, z: float) -> list[cq.Edge]:
    return [edge for edge in body.Edges() if edge.geomType() == "CIRCLE" and abs(edge.Center().z - z) < 1e-6]


def plates() -> cq.Shape:
    """Two plates side by side; the front edges are in two pieces each."""
    one = W().box(20, 10, 5, centered=False)
    return one.union(one.translate((20, 0, 0)), clean=False).val()


def ell() -> cq.Shape:
    """Two plates that overlap in a corner; faces are split beside the outer edge and at both of its ends."""
    one, two = W().box(12, 12, 2.2, centered=False), W().box(12, 2.2, 12, centered=False)
    return one.union(two, clean=False).val()


def tee() -> cq.Shape:
    """A strip and two blocks behind it; the split that is crossed meets another one."""
    strip, block = W().box(30, 3, 10, centered=False), W().box(15, 10, 10, centered=False)
    return strip.union(block.translate((0, 3, 0)), clean=False).union(block.translate((15, 3, 0)), clean=False).val()


def halves(kind: str) -> cq.Shape:
    half = (
        cq.Solid.makeCylinder(5, 10, angleDegrees=180)
        if kind == "cylinder"
        else cq.Solid.makeCone(8, 4, 10, angleDegrees=180)
    )
    both = W(half).union(W(half.rotate(V(), V(0, 0, 1), 180)), clean=False)
    return W().box(30, 30, 4).translate((0, 0, -2)).union(both, clean=False).val()


def stacked() -> cq.Shape:
    return cq.Solid.makeCylinder(5, 3).fuse(cq.Solid.makeCylinder(5, 7, V(0, 0, 3)))


def boss() -> cq.Shape:
    """A boss across the seam of two plates."""
    plate = W().box(30, 40, 8)
    both = plate.translate((-15, 0, 0)).union(plate.translate((15, 0, 0)), clean=False)
    return both.union(W().circle(8).extrude(20), clean=False).val()


def sheets() -> cq.Shape:
    """Two blocks with tops on one spline."""
    points = [[V(x, y, math.sin(x / 4) * math.cos(y / 5)) for y in range(-15, 16, 6)] for x in range(-15, 16, 6)]
    parts = cq.Solid.makeBox(20, 20, 40, V(-10, -10, -20)).split(cq.Face.makeSplineApprox(points, tol=1e-3)).Solids()
    body = min(parts, key=lambda part: part.Center().z)
    left, right = (body.intersect(cq.Solid.makeBox(10, 20, 60, V(x, -10, -30))) for x in (-10, 0))
    return left.fuse(right)


def front(body: cq.Shape) -> list[cq.Edge]:
    return [
        edge for edge in body.Edges() if edge.Center().y < -9.9 and edge.Center().z > -5 and edge.geomType() != "LINE"
    ]


SPLITS = {
    "edge in two pieces": (plates, lambda b: near(b, 10, 0, 5) + near(b, 30, 0, 5), lambda b: near(b, 20, 0, 5), 2),
    "one piece picked": (plates, lambda b: near(b, 30, 0, 5), lambda b: near(b, 20, 0, 5), 2),
    "splits at the ends, too": (ell, lambda b: near(b, 6, 0, 0), lambda b: near(b, 6, 0, 0), 3.2),
    "splits that meet": (tee, lambda b: near(b, 15, 0, 10), lambda b: near(b, 15, 0, 10), 5),
    "half cylinders": (lambda: halves("cylinder"), lambda b: circles(b, 0), lambda b: circles(b, 0), 2),
    "one of two half circles": (lambda: halves("cylinder"), lambda b: circles(b, 10)[:1], lambda b: circles(b, 10), 2),
    "half cones": (lambda: halves("cone"), lambda b: circles(b, 10), lambda b: circles(b, 10), 1),
    "cylinder upon cylinder": (stacked, lambda b: circles(b, 0), lambda b: circles(b, 0), 4),
    "boss on a seam": (boss, lambda b: circles(b, 4), lambda b: circles(b, 4), 3),
    "one spline": (sheets, front, front, 1),
}


@pytest.mark.parametrize("name", SPLITS)
def test_blends_across_splits_are_those_of_the_cleaned_body(name):
    make, pick, picked_when_clean, radius = SPLITS[name]
    body = make()
    clean = body.clean()
    assert len(clean.Faces()) < len(body.Faces())
    before = cqblend.verify(body).volume
    result = cqblend.blend_edges(body, pick(body), radius)
    expected = cqblend.blend_edges(clean, picked_when_clean(clean), radius)
    assert "taken as one" in result.certificate.method
    assert "flat" not in result.certificate.method
    assert len(result.faces) == len(expected.faces) == 1
    assert result.shape.isValid()
    assert BRepCheck_Analyzer(result.shape.wrapped, True, False, True).IsValid()
    change, wanted = (cqblend.verify(one.shape).volume - before for one in (result, expected))
    assert change == pytest.approx(wanted, rel=1e-4, abs=1e-6 * before if name == "one spline" else 1e-9)
    assert cqblend.verify(body).volume == before


def test_splits_out_of_reach_stay_as_they_are():
    body = tee()
    result = cqblend.blend_edges(body, near(body, 15, 0, 10), 2)
    assert "taken" not in result.certificate.method
    assert len(result.shape.Faces()) == len(body.Faces()) + 1


def test_other_faces_are_the_same_objects_and_numbers_those_of_the_input():
    body = cq.Compound.makeCompound([cq.Solid.makeBox(5, 5, 5, V(100, 0, 0)), tee().Solids()[0]])
    (edge,) = near(body, 15, 0, 10)
    result = cqblend.blend_edges(body, edge, 5)
    kept = [face for face in result.shape.Faces() if any(face.isSame(one) for one in body.Faces())]
    assert len(kept) >= 6
    beside = [i for i, face in enumerate(body.Faces(), 1) if any(edge.isSame(one) for one in face.Edges())]
    assert [rail.face for rail in result.certificate.rails] == beside
    assert {rail.edge for rail in result.certificate.rails} == {body.Edges().index(edge) + 1}
    for group in result.certificate.method.split(", faces ")[1:]:
        numbers = [int(number) for number in group.removesuffix(" taken as one").split(", ")]
        normals = [body.Faces()[number - 1].normalAt() for number in numbers]
        assert all((normal - normals[0]).Length < 1e-9 for normal in normals)


@pytest.mark.parametrize("first", [0, 1])
def test_side_1_is_the_face_that_is_asked_for_across_splits(first):
    body = ell()
    (edge,) = near(body, 6, 0, 0)
    sides = [face for face in body.Faces() if any(edge.isSame(one) for one in face.Edges())]
    result = cqblend.blend_edges(body, edge, width=(2.5, 4), first=sides[first])
    assert result.certificate.rails[0].face == body.Faces().index(sides[first]) + 1
    blend = result.faces[0]
    reach = [max(abs(getattr(vertex.Center(), axis)) for vertex in blend.Vertices()) for axis in "yz"]
    normal = sides[first].normalAt()
    assert (reach[1] if abs(normal.y) > 0.5 else reach[0]) == pytest.approx(2.5)
    assert result.shape.isValid()


# Passed over.


def test_seams_among_picks_are_passed_over_and_listed():
    body = W().circle(11.3).extrude(19, both=True).val()
    upper, lower = circles(body, 19), circles(body, -19)
    middle = [edge for edge in body.Edges() if not any(edge.isSame(one) for one in upper + lower)]
    result = cqblend.blend_edges(body, body.Edges(), 0.6)
    assert len(result.faces) == 2
    assert sorted(one.edges[0] for one in result.skipped) == sorted(body.Edges().index(edge) + 1 for edge in middle)
    assert {one.kind for one in result.skipped} == {"seam", "smooth"}
    for one in result.skipped:
        assert isinstance(one, SkippedEdges)
        assert f"passed over: {one.message}" in str(result.certificate)
        assert str(one.edges[0]) in one.message


def test_poles_are_passed_over():
    body = W().sphere(8).intersect(W().box(30, 30, 15).translate((0, 0, 7.5))).val()
    edges = ShapeIndex(body.wrapped, TopAbs_EDGE)  # CadQuery leaves poles out
    result = cqblend.blend_edges(body, [edges[i + 1] for i in range(len(edges))], 1)
    assert {one.kind for one in result.skipped} >= {"degenerate"}
    assert len(result.faces) == 1
    assert result.shape.isValid()


def test_where_nothing_is_left_the_selection_is_wrong():
    body = W().circle(11.3).extrude(19, both=True).val()
    rest = [edge for edge in body.Edges() if abs(edge.Center().z) < 1]
    with pytest.raises(SelectionError, match=r"smooth already|seam"):
        cqblend.blend_edges(body, rest, 0.6)
    with pytest.raises(SelectionError, match=r"smooth already|seam"):
        cqblend.blend_edges(body, rest[0], 0.6)


def test_nothing_is_listed_where_all_picks_are_sharp():
    box = cq.Solid.makeBox(3, 4, 5)
    assert cqblend.blend_edges(box, box.edges("|Z"), 0.5).skipped == ()


def test_halves_are_left_alone_where_the_other_side_stays_halved():
    """A drill tip of two half cones, which have an apex, under two half cylinders: one whole side would have a seam."""
    profile = W("XZ").polyline([(0, -20), (8, -20), (8, -5), (0, 0)]).close()
    half = profile.revolve(180, (0, 0, 0), (0, 1, 0)).val()
    body = half.fuse(half.rotate(V(), V(0, 0, 1), 180))
    rim = next(edge for edge in body.Edges() if edge.geomType() == "CIRCLE" and edge.Center().z > -6)
    result = cqblend.blend_edges(body, rim, 1, chain=False, ends="flat")
    assert result.shape.isValid()
    assert "taken" not in result.certificate.method


@pytest.mark.parametrize("count", [3, 5])
def test_a_row_of_boxes_is_one_edge_wherever_it_is_picked(count):
    """What the joint is made one with goes on in others: to the end of the row, from any of its pieces or all."""
    row = cq.Workplane().box(10, 10, 5)
    for k in range(1, count):
        row = row.union(cq.Workplane().box(10, 10, 5).translate((10 * k, 0, 0)), clean=False)
    body = row.val().Solids()[0]
    pieces = [e for e in body.Edges() if abs(e.Center().y + 5) < 1e-6 and abs(e.Center().z - 2.5) < 1e-6]
    assert len(pieces) == count
    for picked in (*pieces, pieces):
        result = cqblend.blend_edges(body, picked, 1.0)
        assert result.shape.isValid()
        box = result.faces[0].BoundingBox()
        assert (box.xmin, box.xmax) == pytest.approx((-5, 10 * count - 5), abs=1e-6)
        assert [end.kind for end in result.certificate.ends] == ["natural", "natural"]
        assert result.certificate.method.count("taken as one") == 2


def test_the_input_stays_as_it_was_where_curved_faces_are_made_one():
    half = cq.Workplane(cq.Solid.makeCylinder(10, 8, angleDegrees=180))
    body = half.union(half.rotate((0, 0, 0), (0, 0, 1), 180), clean=False).val().Solids()[0]
    before, after = BytesIO(), BytesIO()
    BinTools.Write_s(body.wrapped, before)
    rim = next(e for e in body.Edges() if e.geomType() == "CIRCLE")
    result = cqblend.blend_edges(body, rim, 1.0)
    assert "taken as one" in result.certificate.method
    BinTools.Write_s(body.wrapped, after)
    assert after.getvalue() == before.getvalue()
