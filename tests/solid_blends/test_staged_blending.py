"""Whole selections: edges that meet in corners, blended in one call, beside OCCT's own fillet."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from cornered_solids import find_edges_at, measure_edge

import cqblend


def make_profile(points, height: float = 10.0) -> cq.Shape:
    return cq.Workplane().polyline(points).close().extrude(height).val()


BODIES = {
    "box": lambda: cq.Workplane().box(20, 14, 10).val(),
    "angle": lambda: make_profile([(0, 0), (20, 0), (20, 8), (8, 8), (8, 20), (0, 20)]),
    "channel": lambda: make_profile([(0, 0), (20, 0), (20, 12), (14, 12), (14, 5), (6, 5), (6, 12), (0, 12)]),
    "boss": lambda: cq.Workplane().box(40, 30, 8).faces(">Z").workplane().rect(16, 12).extrude(10).val(),
    "pocket": lambda: cq.Workplane().box(40, 30, 12).faces(">Z").workplane().rect(20, 14).cutBlind(-6).val(),
    "open box": lambda: cq.Workplane().box(30, 24, 16).faces(">Z").shell(-3).val(),
    "hexagon": lambda: cq.Workplane().polygon(6, 20).extrude(10).val(),
    "bars that cross": lambda: cq.Workplane().box(30, 8, 10).union(cq.Workplane().box(8, 30, 5)).val(),
    "flush step": lambda: (
        cq.Workplane().box(20, 14, 6, centered=False).union(cq.Workplane().box(9, 8, 13, centered=False)).clean().val()
    ),
}


@pytest.mark.parametrize("name", BODIES)
def test_all_edges_of_a_body_take_a_face_each_and_a_face_a_corner(name):
    body = BODIES[name]()
    result = cqblend.blend_edges(body, body.Edges(), 1.0)
    assert len(result.faces) == len(body.Edges()) + len(body.Vertices())
    assert result.shape.isValid()
    certificate = result.certificate
    assert certificate.coverage == 1
    assert sorted(certificate.blended) == list(range(1, len(body.Edges()) + 1))
    assert certificate.ends == ()
    assert certificate.angle < 1e-10
    native = body.fillet(1.0, body.Edges())
    assert result.shape.Volume() == pytest.approx(native.Volume(), rel=1e-9)


def test_whole_selections_are_smooth_at_every_edge():
    body = BODIES["angle"]()
    result = cqblend.blend_edges(body, body.Edges(), 1.0)
    for edge in result.shape.Edges():
        gap, angle = measure_edge(result.shape, edge)
        assert gap < 1e-11
        assert angle < 1e-11


def test_the_order_of_picks_does_not_matter():
    body = BODIES["boss"]()
    edges = list(np.random.default_rng(0).permutation(np.array(body.Edges(), dtype=object)))
    result = cqblend.blend_edges(body, [*edges, edges[0]], 1.0)
    assert result.shape.Volume() == pytest.approx(
        cqblend.blend_edges(body, body.Edges(), 1.0).shape.Volume(), rel=1e-13
    )


@pytest.mark.parametrize(
    "options",
    [
        {"radius": 2.0, "continuity": "G2"},
        {"radius": 2.0, "bulge": 0.8},
        {"width": 2.0},
        {"width": (2.0, 3.0)},
        {"section": "potential", "a": 2.0},
        {"radius": cqblend.linear(1, 2)},
    ],
)
def test_where_no_ball_can_turn_corners_are_patched(options):
    body = BODIES["box"]()
    corner = find_edges_at(body, (10, 7, 5))
    result = cqblend.blend_edges(body, corner, **options)
    assert len(result.faces) == 3 + 3
    assert result.shape.isValid()
    assert result.certificate.coverage == 1
    for edge in (edge for face in result.faces for edge in face.Edges()):
        if all(cq.Workplane(face).val().geomType() == "BSPLINE" for face in faces_at(result.shape, edge)):
            assert measure_edge(result.shape, edge)[1] < 1e-10


def faces_at(body: cq.Shape, edge: cq.Edge) -> list[cq.Face]:
    return [face for face in body.Faces() if any(edge.isSame(one) for one in face.Edges())]


def test_the_largest_of_three_is_gone_round():
    body = BODIES["box"]()
    sizes = {edge: 3.0 if abs(edge.tangentAt(0.5).z) > 0.5 else 1.0 for edge in body.Edges()}
    result = cqblend.blend_edges(body, body.Edges(), sizes)
    assert sum(face.geomType() == "TORUS" for face in result.faces) == 8
    assert result.shape.isValid()


def test_flat_ends_are_for_ends_and_not_for_corners():
    body = BODIES["box"]()
    result = cqblend.blend_edges(body, find_edges_at(body, (10, 7, 5)), 2.0, ends="flat")
    assert [end.kind for end in result.certificate.ends] == ["flat"] * 3
    assert len(result.faces) == 4
    assert result.shape.isValid()


def test_a_network_that_fails_is_left_out_whole():
    bodies = cq.Workplane().box(26, 14, 10).faces(">Z").workplane().pushPoints([(-6, 0), (6, 0)]).rect(4, 4).extrude(3)
    body = bodies.val()
    sizes = {edge: 2.5 if edge.Center().z > 5.1 and edge.Center().x < 0 else 1.0 for edge in body.Edges()}
    with pytest.raises(cqblend.errors.SizeError):
        cqblend.blend_edges(body, body.Edges(), sizes)
    result = cqblend.blend_edges(body, body.Edges(), sizes, on_error="skip")
    assert result.shape.isValid()
    (skipped,) = result.skipped
    assert sorted([*skipped.edges, *result.certificate.blended]) == list(range(1, len(body.Edges()) + 1))
    assert 0 < result.certificate.coverage < 1


def test_mitres_are_had_for_the_asking_where_an_edge_stays_sharp():
    body = BODIES["box"]()
    top = body.edges(">Z")
    result = cqblend.blend_edges(body, top, 2.0, corner="mitre")
    assert len(result.faces) == 4
    native = body.fillet(2.0, top.Edges())
    assert result.shape.Volume() == pytest.approx(native.Volume(), rel=1e-9)
    with pytest.raises(cqblend.errors.UnsupportedError, match=r"all edges at vertex 7 .* one that stays sharp"):
        cqblend.blend_edges(body, find_edges_at(body, (10, 7, 5)), 2.0, corner="mitre")
    with pytest.raises(cqblend.errors.InputError, match="two of three edges"):
        cqblend.blend_edges(body, body.edges("|Z"), 2.0, corner="mitre")


def test_straight_edges_go_first_so_that_corners_are_tori():
    rod = cq.Workplane().circle(10).extrude(12).intersect(cq.Workplane().box(30, 14, 30)).val()
    result = cqblend.blend_edges(rod, rod.Edges(), 1.0)
    assert {face.geomType() for face in result.faces} == {"CYLINDER", "TORUS", "SPHERE"}
    native = rod.fillet(1.0, rod.Edges())
    assert result.shape.Volume() == pytest.approx(native.Volume(), rel=1e-12)


def test_the_certificate_says_that_patches_are_g1_beside_blends_of_g2():
    body = BODIES["box"]()
    result = cqblend.blend_edges(body, find_edges_at(body, (10, 7, 5)), 2.0, continuity="G2")
    certificate = result.certificate
    assert certificate.curvature_jump < 1e-9
    jumps = [edge.curvature_jump for edge in certificate.edges if edge.kind == "between"]
    measured = [cqblend.continuity(result.shape, edge) for face in result.faces[3:] for edge in face.Edges()]
    assert max(jumps) == pytest.approx(max(one.curvature_jump for one in measured), rel=0.1)
    assert "curvature jump" in str(certificate)


def test_edges_of_split_faces_are_passed_over_in_a_whole_selection():
    halves = cq.Workplane().box(20, 10, 5).union(cq.Workplane().box(20, 10, 5).translate((20, 0, 0)), clean=False).val()
    between = [edge for edge in halves.Edges() if abs(edge.Center().x - 10) < 1e-9]
    assert len(between) == 4
    result = cqblend.blend_edges(halves, halves.Edges(), 1.0)
    assert {number for one in result.skipped for number in one.edges} == {
        1 + k for k, edge in enumerate(halves.Edges()) if any(edge.isSame(one) for one in between)
    }
    assert {one.kind for one in result.skipped} == {"smooth"}
    assert len(result.faces) == 12 + 8
    assert result.certificate.coverage == 1
