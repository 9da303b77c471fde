"""Scores of blends, on OCCT's own fillets, which are right, and on bodies with something wrong."""

import math

import cadquery as cq
import numpy as np
import pytest
from OCP.BRepFilletAPI import BRepFilletAPI_MakeChamfer, BRepFilletAPI_MakeFillet
from OCP.TopoDS import TopoDS
from places import ROOT

from benchmarks.blend_scores import Blended, Limits, score_blend
from benchmarks.chain_sizes import estimate_largest_radius, estimate_volume_change, measure_mesh_volume
from benchmarks.tangent_chains import EdgeLinks
from benchmarks.touching_balls import Body

RADIUS = 1.0


def rounded_box():
    body = cq.Workplane().box(30, 20, 10).edges("|Z").fillet(4)
    return body.val(), body.edges(">Z").vals()


def fillet(body, edges, radius=RADIUS):
    """Round edges, and chains through them, as OCCT does."""
    maker = BRepFilletAPI_MakeFillet(body.wrapped)
    maker.Add(radius, edges[0].wrapped)
    maker.Build()
    return maker.Shape(), [TopoDS.Face_s(face) for edge in edges for face in maker.Generated(edge.wrapped)]


def score(body, edges, made, radius=RADIUS, **options):
    shape, faces = made
    return score_blend(Blended(body.wrapped, [edges[0].wrapped], radius, shape, faces), Limits(angle=1e-7), **options)


def test_a_chain_that_is_right_is_complete():
    body, edges = rounded_box()
    found = score(body, edges, fillet(body, edges))
    assert found.verdict == "complete", found.message
    assert found.gap < 1e-10
    assert found.angle < 1e-10


def test_what_is_left_of_a_chain_is_missing():
    body, edges = rounded_box()
    straight = max(edges, key=lambda edge: edge.Length())
    place = [edge.isSame(straight) for edge in body.Edges()].index(True) + 1
    short = cq.Workplane(body).cut(cq.Workplane().box(16, 40, 4).translate((0, 0, 5))).val()
    found = score(body, [straight], (short.wrapped, []))
    assert found.verdict == "unsound"
    assert "there is no blend face" in found.message
    assert f"edge {place}" in found.message


def test_a_chamfer_is_no_smooth_joint():
    body, edges = rounded_box()
    maker = BRepFilletAPI_MakeChamfer(body.wrapped)
    maker.Add(RADIUS, edges[0].wrapped)
    maker.Build()
    faces = [TopoDS.Face_s(face) for edge in edges for face in maker.Generated(edge.wrapped)]
    found = score(body, edges, (maker.Shape(), faces))
    assert found.verdict == "unsound"
    assert "a sharp edge of the blend" in found.message


def test_a_body_without_a_face_is_not_valid_any_more():
    body, edges = rounded_box()
    shape, faces = fillet(body, edges)
    torn = cq.Shell.makeShell(cq.Shape.cast(shape).Faces()[1:])
    found = score(body, edges, (cq.Solid.makeSolid(torn).wrapped, faces))
    assert found.verdict == "unsound"


def test_a_crease_between_two_blend_faces_is_found():
    """The sides of a prism over a polygon meet at 2 pi / n: taken for a blend, they have creases."""
    body, edges = rounded_box()
    prism = cq.Workplane().polygon(90, 20).extrude(5)
    sides = [face.wrapped for face in prism.faces("#Z").vals()]
    found = score(body, edges, (prism.val().wrapped, sides))
    assert found.angle == pytest.approx(2 * math.pi / 90, rel=1e-6)
    assert any("a joint (between) has an angle" in problem for problem in found.unsound)


def test_nothing_of_the_library_is_used():
    for name in ("blend_scores", "tangent_chains", "chain_sizes", "chain_bodies", "everyday_parts"):
        text = (ROOT / "benchmarks" / f"{name}.py").read_text(encoding="utf-8")
        assert "import cqblend" not in text
        assert "from cqblend" not in text


@pytest.mark.parametrize("radius", [0.5, 2.0])
def test_the_estimated_change_of_volume_is_that_of_pappus(radius):
    rod = cq.Workplane().circle(8).extrude(20)
    rim = rod.edges(">Z").val()
    body = Body(rod.val().wrapped)
    change, doubt = estimate_volume_change(body, EdgeLinks(body).follow_chain(rim.wrapped), radius)
    area = (1 - math.pi / 4) * radius**2
    exact = -2 * math.pi * (8 - _find_centroid(radius)) * area
    assert change == pytest.approx(exact, rel=1e-3)
    assert abs(change - exact) < doubt


def _find_centroid(radius):
    """Return how far from both sides of a right angle the centroid is of what an arc leaves of it (by sums)."""
    at = (np.arange(20000) + 0.5) / 20000 * radius
    height = radius - np.sqrt(radius**2 - (radius - at) ** 2)
    return float((at * height).sum() / height.sum())


def test_the_estimated_radius_fits_and_is_no_tiny_one():
    body, edges = rounded_box()
    faces = Body(body.wrapped)
    largest = estimate_largest_radius(faces, EdgeLinks(faces).follow_chain(edges[0].wrapped))
    assert 2.5 < largest < 4


def test_meshes_tell_volumes():
    ball = cq.Solid.makeSphere(5, angleDegrees1=-90)
    volume, area = measure_mesh_volume(ball.wrapped, 1e-3)
    assert volume == pytest.approx(4 / 3 * math.pi * 125, abs=1e-3 * area)
    assert area == pytest.approx(4 * math.pi * 25, rel=1e-3)
