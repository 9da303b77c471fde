"""Mitres in one pass: two blended edges and a sharp one meet, and the blends end in each other."""

from __future__ import annotations

import math

import cadquery as cq
import numpy as np
import pytest
from mitred_solids import integrate_insets
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf

import cqblend

L_OUTLINE = ((0, 0), (20, 0), (20, 8), (8, 8), (8, 20), (0, 20))
OUTLINES = {
    "rectangle": ((0, 0), (20, 0), (20, 14), (0, 14)),
    "acute triangle": ((0, 0), (20, 0), (16, 9)),
    "L": L_OUTLINE,
    "T": ((0, 0), (20, 0), (20, 6), (13, 6), (13, 20), (7, 20), (7, 6), (0, 6)),
    "star": ((0, 0), (10, 3), (20, 0), (17, 10), (20, 20), (10, 17), (0, 20), (3, 10)),
}


def extrude(outline) -> cq.Shape:
    return cq.Workplane().polyline(list(outline)).close().extrude(10).val()


def find_edge(body: cq.Shape, start, stop, z: float) -> cq.Edge:
    """Return the edge between two points at a height."""
    middle = cq.Vector((start[0] + stop[0]) / 2, (start[1] + stop[1]) / 2, z)
    return min(body.Edges(), key=lambda edge: (edge.Center() - middle).Length)


def list_top_edges(body: cq.Shape, outline) -> list[cq.Edge]:
    following = (*outline[1:], outline[0])
    return [find_edge(body, one, other, 10) for one, other in zip(outline, following, strict=True)]


def check(result, mitres: int) -> float:
    """Check that a result is sound, and return its volume."""
    assert result.shape.isValid()
    assert cqblend.verify(result.shape, result.faces).ok
    certificate = result.certificate
    assert certificate.angle <= 1e-12
    found = [edge for edge in certificate.edges if edge.kind == "mitre"]
    assert len(found) == mitres
    assert all(edge.gap <= 1e-9 and edge.angle is None and edge.vertex for edge in found)
    return result.shape.Volume()


@pytest.mark.parametrize("outline", OUTLINES.values(), ids=OUTLINES)
def test_all_top_edges_of_a_prism_are_mitred_in_one_pass(outline):
    body = extrude(outline)
    result = cqblend.blend_edges(body, list_top_edges(body, outline), 1.5)
    volume = check(result, len(outline))
    assert len(result.faces) == len(outline)
    assert len(result.shape.Faces()) == len(body.Faces()) + len(outline)
    assert volume == pytest.approx(body.Volume() - integrate_insets(outline, [1.5] * len(outline)), rel=1e-9)


@pytest.mark.parametrize("outline", OUTLINES.values(), ids=OUTLINES)
def test_where_depths_differ_the_deeper_strip_ends_on_the_other_and_on_its_wall(outline):
    body = extrude(outline)
    edges = list_top_edges(body, outline)
    radii = [1.0 + 0.5 * (k % 2) + 0.25 * (k % 3) for k in range(len(edges))]
    result = cqblend.blend_edges(body, edges, dict(zip(edges, radii, strict=True)))
    volume = check(result, len(outline))
    assert volume == pytest.approx(body.Volume() - integrate_insets(outline, radii), rel=1e-9)


@pytest.mark.parametrize("radii", [(2.0, 2.0), (2.0, 3.0), (3.0, 2.0), (0.5, 4.0), (2.0, 2.0001)])
def test_two_edges_at_a_reflex_corner_are_mitred_and_end_naturally_elsewhere(radii):
    body = extrude(L_OUTLINE)
    edges = [find_edge(body, L_OUTLINE[k], L_OUTLINE[k + 1], 10) for k in (2, 3)]
    result = cqblend.blend_edges(body, edges, dict(zip(edges, radii, strict=True)))
    volume = check(result, 1)
    # The other edges keep their place, so that the insets are those of an outline of which two edges are rounded.
    expected = integrate_insets(L_OUTLINE, [1e-9, 1e-9, *radii, 1e-9, 1e-9])
    assert volume == pytest.approx(body.Volume() - expected, rel=1e-8)


@pytest.mark.parametrize("radii", [(2.0, 2.0), (2.0, 3.0)])
def test_the_foot_of_a_boss_is_mitred_outside_its_upright_edges(radii):
    body = cq.Workplane().box(40, 30, 8).faces(">Z").workplane().rect(16, 12).extrude(10).val()
    foot = [edge for edge in body.Edges() if abs(edge.Center().z - 4) < 1e-6 and edge.Length() < 17]
    sizes = {edge: radii[int(edge.Length() > 14)] for edge in foot}
    result = cqblend.blend_edges(body, foot, sizes)
    outline = ((-8, -6), (-8, 6), (8, 6), (8, -6))  # clockwise, so that inside is outside
    added = integrate_insets(outline, [radii[0], radii[1], radii[0], radii[1]])
    assert check(result, 4) == pytest.approx(body.Volume() + added, rel=1e-9)


def make_lobes(distance: float) -> cq.Shape:
    """Return two cylinders of radius 5 that overlap."""
    second = cq.Workplane().center(distance, 0).circle(5).extrude(3)
    return cq.Workplane().circle(5).extrude(3).union(second).val().Solids()[0]


def test_where_rails_run_apart_past_a_reflex_vertex_the_ball_turns_about_the_sharp_edge():
    distance, big, r = 9.9, 5.0, 0.3
    body = make_lobes(distance)
    edges = cq.Workplane(body).faces(">Z").edges().vals()
    result = cqblend.blend_edges(body, edges, r)
    assert result.shape.isValid()
    assert cqblend.verify(result.shape, result.faces).ok
    certificate = result.certificate
    assert {end.kind for end in certificate.ends} == {"turn"}
    assert {edge.kind for edge in certificate.edges} == {"between", "corner curve"}
    assert max(edge.angle for edge in certificate.edges) <= 1e-8  # as OCCT rounds normals next to the pole
    assert max(edge.gap for edge in certificate.edges) <= 1e-9
    # An arc takes away d(z) at depth z; I and J are the integrals of d and of its square over the depth.
    once, twice = r**2 * (1 - math.pi / 4), r**3 * (5 / 3 - math.pi / 2)
    half_waist = math.acos(distance / 2 / big)
    around_lobes = 2 * (2 * math.pi - 2 * half_waist) * (big * once - twice / 2)
    around_sharp_edges = 2 * (math.pi - 2 * half_waist) * twice / 2
    assert result.shape.Volume() == pytest.approx(body.Volume() - around_lobes - around_sharp_edges, rel=1e-9)


def test_a_waist_that_is_wide_enough_is_mitred():
    body = make_lobes(9.0)
    result = cqblend.blend_edges(body, cq.Workplane(body).faces(">Z").edges().vals(), 0.3)
    check(result, 2)
    assert {end.kind for end in result.certificate.ends} == {"mitre"}


@pytest.mark.parametrize("inward", [False, True])
def test_curved_walls_are_mitred_in_a_curve_that_is_solved(inward):
    sign = 1 if inward else -1
    outline = cq.Workplane().moveTo(0, 0).spline([(10, 3 * sign), (20, 0)], includeCurrent=True)
    outline = outline.spline([(20 - 3 * sign, 10), (20, 20)], includeCurrent=True)
    outline = outline.spline([(10, 20 - 3 * sign), (0, 20)], includeCurrent=True)
    body = outline.spline([(3 * sign, 10), (0, 0)], includeCurrent=True).close().extrude(8).val()
    edges = cq.Workplane(body).faces(">Z").edges().vals()
    result = cqblend.blend_edges(body, edges, 1)
    assert len([edge for edge in result.certificate.edges if edge.kind == "mitre"]) == 4
    assert result.certificate.angle <= 1e-12
    assert result.shape.isValid()
    volume = result.shape.Volume()
    assert volume == pytest.approx(body.fillet(1, edges).Volume(), rel=2e-5)  # whose sections are arcs


@pytest.mark.parametrize(
    "options", [{"continuity": "G2"}, {"section": "hermite"}, {"section": "hermite", "form": "compact"}]
)
@pytest.mark.parametrize("outline", [OUTLINES["rectangle"], L_OUTLINE], ids=["rectangle", "L"])
def test_sections_that_are_no_arcs_are_mitred(outline, options):
    body = extrude(outline)
    result = cqblend.blend_edges(body, list_top_edges(body, outline), 1.5, **options)
    check(result, len(outline))


def test_a_mitred_solid_can_be_cut_and_sent_through_step(tmp_path):
    body = extrude(L_OUTLINE)
    result = cqblend.blend_edges(body, list_top_edges(body, L_OUTLINE), 1.5)
    shape = cq.Shape.cast(result.shape.wrapped)
    drilled = shape.cut(cq.Solid.makeCylinder(1, 20, cq.Vector(7, 7, -5)))
    assert drilled.isValid()
    assert drilled.Volume() < shape.Volume()
    cq.exporters.export(cq.Workplane(shape), str(tmp_path / "mitred.step"))
    again = cq.importers.importStep(str(tmp_path / "mitred.step")).val()
    assert again.isValid()
    assert again.Volume() == pytest.approx(shape.Volume(), rel=1e-9)


def test_mitres_lie_on_both_blends_as_occt_has_them():
    body = extrude(OUTLINES["star"])
    result = cqblend.blend_edges(body, list_top_edges(body, OUTLINES["star"]), 1.0)
    blends = [cq.Face(face.wrapped) for face in result.faces]
    found = 0
    for one, other in ((a, b) for k, a in enumerate(blends) for b in blends[k + 1 :]):
        common = [edge for edge in one.Edges() if any(edge.isSame(twin) for twin in other.Edges())]
        for edge in common:
            found += 1
            curve = BRepAdaptor_Curve(edge.wrapped)
            for t in np.linspace(curve.FirstParameter(), curve.LastParameter(), 9).tolist():
                for surface in (BRep_Tool.Surface_s(one.wrapped), BRep_Tool.Surface_s(other.wrapped)):
                    assert GeomAPI_ProjectPointOnSurf(curve.Value(t), surface).LowerDistance() <= 1e-9
    assert found == len(OUTLINES["star"])


def test_blends_of_edges_that_nearly_go_on_in_each_other_are_mitred_with_sections_of_one_kind():
    turn = 0.005  # rad: strips of arcs and of polynomials would be further apart there than the turn makes up for
    outline = (
        cq.Workplane()
        .lineTo(10, 0)
        .spline([(15, 1), (18, 6)], tangents=[(math.cos(turn), math.sin(turn)), (0, 1)], includeCurrent=True)
    )
    body = outline.lineTo(18, 12).lineTo(0, 12).close().extrude(4).val()
    edges = cq.Workplane(body).faces(">Z").edges().vals()
    result = cqblend.blend_edges(body, edges, 1)
    assert result.shape.isValid()
    assert len([edge for edge in result.certificate.edges if edge.kind == "mitre"]) == 4
    sections = {rail.edge: rail.section for rail in result.certificate.rails}
    number = {edge.Center().toTuple(): body.Edges().index(edge) + 1 for edge in edges}
    (straight,) = (number[edge.Center().toTuple()] for edge in edges if abs(edge.Center().y) < 1e-9)
    (upper,) = (number[edge.Center().toTuple()] for edge in edges if abs(edge.Center().y - 12) < 1e-9)
    assert (sections[straight], sections[upper]) == ("hermite", "arc")
    assert result.shape.Volume() == pytest.approx(body.fillet(1, edges).Volume(), rel=2e-5)


@pytest.mark.parametrize("is_boss", [False, True])
def test_edges_on_a_cylinder_are_mitred(is_boss):
    round_bar = cq.Workplane().circle(20).extrude(40)
    block = cq.Workplane("XZ").center(0, 20).rect(12, 10).extrude(-30)
    body = (round_bar.union(block) if is_boss else round_bar.cut(block)).val()
    edges = [
        edge
        for edge in body.Edges()
        if edge.Center().y > 12
        and all(abs(math.hypot(vertex.X, vertex.Y) - 20) < 1e-6 and 10 < vertex.Z < 30 for vertex in edge.Vertices())
    ]
    result = cqblend.blend_edges(body, edges, 1)
    assert result.shape.isValid()
    assert len([edge for edge in result.certificate.edges if edge.kind == "mitre"]) == 4
    assert result.certificate.angle <= 1e-12
    assert result.shape.Volume() == pytest.approx(body.fillet(1, edges).Volume(), rel=2e-6)


def test_a_small_radius_far_from_the_middle_of_an_edge_is_no_trouble():
    """Ellipses are fitted in the parameters of their cylinders to rounding of these, not of the radius."""
    outline = ((0, 0), (40, 0), (37, 22), (3, 31))
    body = extrude(outline)
    result = cqblend.blend_edges(body, list_top_edges(body, outline), 0.02)
    assert check(result, 4) == pytest.approx(body.Volume() - integrate_insets(outline, [0.02] * 4), rel=1e-12)
