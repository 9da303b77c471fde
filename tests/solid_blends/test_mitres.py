"""Mitres in one pass: two blended edges and a sharp one meet, and the blends end in each other."""

from __future__ import annotations

import cadquery as cq
import pytest
from mitred_solids import integrate_insets

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
