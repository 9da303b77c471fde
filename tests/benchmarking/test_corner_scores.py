"""Scores of blends that meet at corners, on OCCT's own fillets, which are right, and on bodies with something wrong."""

import math

import cadquery as cq
import pytest
from OCP.BRepFilletAPI import BRepFilletAPI_MakeChamfer, BRepFilletAPI_MakeFillet

from benchmarks.blend_scores import Blended, Limits
from benchmarks.corner_bodies import FAMILIES, draw_corners, find_tight_places, list_sharp_edges
from benchmarks.corner_features import FEATURES, HARD_FEATURES
from benchmarks.corner_parts import PARTS
from benchmarks.corner_scores import measure_volume, score_corners, score_fillet
from benchmarks.corner_volumes import Volume, expect_volume, find_opened_volume
from benchmarks.touching_balls import Body

LIMITS = Limits(gap=1e-9, angle=1e-8)


def make_box():
    return cq.Workplane().box(30, 20, 10).val()


def round_edges(body, edges, radius):
    maker = BRepFilletAPI_MakeFillet(body.wrapped)
    for edge in edges:
        maker.Add(radius, edge.wrapped)
    maker.Build()
    return maker.Shape()


def list_new_faces(made):
    """List the faces that are not on planes of a box."""
    return [face.wrapped for face in cq.Shape.cast(made).Faces() if face.geomType() != "PLANE"]


def score(body, edges, made, radius, expected=None):
    blended = Blended(body.wrapped, [edge.wrapped for edge in edges], radius, made, list_new_faces(made))
    return score_corners(blended, LIMITS, expected)


def test_all_edges_of_a_box_are_complete():
    body = make_box()
    expected = expect_volume(body.wrapped, [edge.wrapped for edge in body.Edges()], 2.0)
    found = score(body, body.Edges(), round_edges(body, body.Edges(), 2.0), 2.0, expected)
    assert found.verdict == "complete", found.message
    assert (found.faces, found.sharp) == (26, 0)
    assert found.angle < 1e-12
    assert expected.doubt < 1e-4


def test_mitres_may_be_sharp():
    body = make_box()
    edges = cq.Workplane(body).faces(">Z").edges().vals()
    found = score(body, edges, round_edges(body, edges, 2.0), 2.0)
    assert found.verdict == "complete", found.message
    assert found.sharp > 4


def test_an_edge_that_was_left_is_missing():
    body = make_box()
    found = score(body, body.Edges(), round_edges(body, body.Edges()[1:], 2.0), 2.0)
    assert found.verdict == "incomplete"
    assert "edge 1 is left" in found.message or "edge 1 is still there" in found.message
    assert "there is a sharp edge" in found.message


def test_another_radius_has_another_volume():
    body = make_box()
    expected = expect_volume(body.wrapped, [edge.wrapped for edge in body.Edges()], 2.0)
    found = score(body, body.Edges(), round_edges(body, body.Edges(), 2.001), 2.0, expected)
    assert found.verdict == "unsound"
    assert "the volume is" in found.message


def test_chamfers_are_sharp():
    body = make_box()
    maker = BRepFilletAPI_MakeChamfer(body.wrapped)
    for edge in body.Edges():
        maker.Add(2.0, edge.wrapped)
    maker.Build()
    found = score_fillet(Blended(body.wrapped, [e.wrapped for e in body.Edges()], 2.0, maker.Shape(), []))
    assert found.verdict == "incomplete"
    assert found.sharp == 48


def test_a_blend_that_bulges_out_is_unsound():
    body = make_box()
    moved = cq.Shape.cast(round_edges(body, body.Edges(), 2.0)).translate(cq.Vector(0, 0, 0.1)).wrapped
    found = score(body, body.Edges(), moved, 2.0)
    assert found.verdict == "unsound"
    assert "is not a blend face, and 0.1 mm off the old body" in found.message
    assert "is outside of the old body" in found.message


def test_the_volume_that_a_ball_reaches_is_exact():
    a, b, c, r = 30.0, 20.0, 10.0, 2.5
    x, y, z = a - 2 * r, b - 2 * r, c - 2 * r
    exact = x * y * z + 2 * r * (x * y + y * z + z * x) + math.pi * r**2 * (x + y + z) + 4 / 3 * math.pi * r**3
    assert find_opened_volume(make_box().wrapped, r, 12) == pytest.approx(exact, rel=1e-14)
    assert find_opened_volume(make_box().wrapped, 5.1, 12) is None
    prism = cq.Workplane().polygon(5, 20).extrude(8).val().rotate(cq.Vector(), cq.Vector(1, 2, 3), 40)
    rounded = measure_volume(round_edges(prism, prism.Edges(), 1.5))
    assert find_opened_volume(prism.wrapped, 1.5, 15) == pytest.approx(rounded, rel=1e-9)


def test_volumes_of_other_bodies_are_estimated_well_enough_to_see_a_side_mistaken():
    body = cq.Workplane().box(30, 20, 6).faces(">Z").workplane().rect(12, 8).extrude(5).val()
    edges = [edge.wrapped for edge in list_sharp_edges(body)]
    expected = expect_volume(body.wrapped, edges, 1.0)
    made = measure_volume(round_edges(body, body.Edges(), 1.0))
    assert abs(made - expected.value) < expected.doubt < abs(made - measure_volume(body.wrapped))
    assert isinstance(expected, Volume)


def test_rails_that_use_up_an_edge_are_told():
    outline = [(0, 0), (20, 0), (20, 4)]
    wedge = cq.Workplane("XZ").polyline(outline).close().extrude(10).val()
    assert list(find_tight_places(Body(wedge.wrapped), wedge.Edges(), 0.1)) == []
    assert "rails take" in next(find_tight_places(Body(wedge.wrapped), wedge.Edges(), 1.9))


@pytest.mark.slow
@pytest.mark.parametrize("family", FAMILIES, ids=lambda family: family.__name__)
def test_a_number_draws_the_same_body_again(family):
    one, other = (draw_corners(family, 1) for _ in range(2))
    assert one.body.isValid()
    assert one.body.Volume() == other.body.Volume() > 0
    assert one.radius == other.radius
    assert len(one.edges) >= 6
    shortest = min(edge.Length() for edge in one.edges)
    assert one.radius <= min(one.wall, shortest) / 3 + 1e-12


def test_parts_are_valid_and_have_edges_to_blend():
    makers = (*PARTS, *FEATURES, *HARD_FEATURES)
    assert len({maker.__name__ for maker in makers}) == len(makers) > 80
    for maker in makers[::7]:
        part = maker()
        assert part.body.isValid()
        assert len(part.edges) == len(part.radii) > 0
