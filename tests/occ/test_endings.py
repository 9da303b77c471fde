"""Flat ends: where a joint goes on past the vertex of the blended edge, or fades out before it."""

import math
from io import BytesIO

import cadquery as cq
import numpy as np
import pytest
from OCP.BinTools import BinTools
from OCP.BRepCheck import BRepCheck_Analyzer

import cqblend


def content(shape: cq.Shape) -> bytes:
    stream = BytesIO()
    BinTools.Write_s(shape.wrapped, stream)
    return stream.getvalue()


def rounded_box() -> cq.Shape:
    """A box with rounded upright edges: the edges around its top go on tangentially from face to face."""
    return cq.Workplane().box(30, 20, 10).edges("|Z").fillet(4).val()


def top_edge(box: cq.Shape) -> cq.Edge:
    return next(edge for edge in box.Edges() if (edge.Center() - cq.Vector(0, -10, 5)).Length < 1e-6)


def ridge() -> cq.Shape:
    """Two equal cylinders that cross: the angle along each quarter of the joint fades to nothing at its ends."""
    rods = [
        cq.Solid.makeCylinder(5, 40, cq.Vector(*start), cq.Vector(*along))
        for start, along in (((-20, 0, 0), (1, 0, 0)), ((0, -20, 0), (0, 1, 0)))
    ]
    return rods[0].fuse(rods[1]).Solids()[0]


def apex() -> cq.Shape:
    """A pyramid: four faces meet at its tip."""
    base = [cq.Vector(x, y, 0) for x, y in ((-10, -10), (10, -10), (10, 10), (-10, 10))]
    tip = cq.Vector(0, 0, 12)
    loops = [base, *([base[k - 1], base[k], tip] for k in range(4))]
    faces = [cq.Face.makeFromWires(cq.Wire.makePolygon([*loop, loop[0]])) for loop in loops]
    return cq.Solid.makeSolid(cq.Shell.makeShell(faces))


def check(body: cq.Shape, result: cqblend.BlendResult, *, grows: bool) -> None:
    assert result.certificate.method == "wire substitution, flat ends"
    assert BRepCheck_Analyzer(result.shape.wrapped, True, False, True).IsValid()
    assert cqblend.verify(result.shape, result.faces).ok
    assert (result.shape.Volume() > body.Volume()) == grows


@pytest.mark.parametrize("radius", [0.5, 1.5])
def test_a_piece_of_a_tangent_chain(radius):
    box = rounded_box()
    before = content(box)
    result = cqblend.blend_edges(box, top_edge(box), radius)
    check(box, result, grows=False)
    assert content(box) == before
    assert result.certificate.angle < 1e-12
    # the caps stand across the edge a little before its ends, as large as the corner that the section cuts off
    added = [f for f in result.shape.Faces() if f.geomType() == "PLANE" and f.Area() < radius**2]
    assert len(added) == 2
    where = abs(added[0].Center().x)
    assert 11 - 0.2 * radius < where < 11
    for cap in added:
        assert abs(abs(cap.Center().x) - where) < 1e-9
        assert abs(cap.normalAt().x) == pytest.approx(1, abs=1e-12)
        assert cap.Area() == pytest.approx((1 - math.pi / 4) * radius**2, rel=2e-3)
    removed = box.Volume() - result.shape.Volume()
    assert removed == pytest.approx((1 - math.pi / 4) * radius**2 * 2 * where, rel=2e-3)


def test_the_edges_at_the_vertex_stay_whole():
    box = rounded_box()
    result = cqblend.blend_edges(box, top_edge(box), 1)
    lengths = sorted(edge.Length() for edge in box.Edges())
    left = sorted(edge.Length() for edge in result.shape.Edges())
    for length in lengths:
        if abs(length - 22) > 1e-9:  # of the blended edge a little is left at either end
            nearest = min(left, key=lambda other: abs(other - length))
            assert nearest == pytest.approx(length, abs=1e-12)


def test_a_concave_piece():
    """The foot of a rounded box on a plate: straight and curved pieces in turn."""
    body = cq.Workplane().box(60, 60, 6).union(cq.Workplane().box(30, 20, 20).edges("|Z").fillet(4)).val().Solids()[0]
    edge = next(e for e in body.Edges() if (e.Center() - cq.Vector(0, -10, 3)).Length < 1e-6)
    check(body, cqblend.blend_edges(body, edge, 2), grows=True)


def test_a_joint_that_fades_out():
    body = ridge()
    sharp = [e for e in body.Edges() if len(e.ancestors(body, "Face").Faces()) == 2 and e.geomType() == "ELLIPSE"]
    if not sharp:
        sharp = [e for e in body.Edges() if cqblend.continuity(body, e).angle > 1]
    result = cqblend.blend_edges(body, sharp[0], 0.8)
    check(body, result, grows=True)
    assert result.certificate.angle < 1e-7


def test_a_vertex_of_many_faces():
    body = apex()
    edge = max(body.Edges(), key=lambda e: e.Center().z if e.Length() > 1 else -1)
    result = cqblend.blend_edges(body, edge, 1)
    assert cqblend.verify(result.shape, result.faces).ok
    ends = np.array([vertex.toTuple() for vertex in result.shape.Vertices()])
    assert ends[:, 2].max() == pytest.approx(12, abs=1e-9)
