"""Sections other than Hermite's in chains: where cells meet they have one section, and one tangent plane along it."""

import cadquery as cq
import numpy as np
import pytest
from chained_solids import rounded_box, slot, spline_outline

import cqblend


def two_cubics():
    """Return a prism whose outline has two splines that meet smoothly, with different curvatures."""
    outline = (
        cq.Workplane()
        .moveTo(-20, -8)
        .lineTo(-10, -8)
        .spline([(0, -10), (10, -9)], tangents=[(1, 0), (1, 0.4)], includeCurrent=True)
        .spline([(17, -2), (14, 8)], tangents=[(1, 0.4), (-1, 0.6)], includeCurrent=True)
    )
    return outline.lineTo(-20, 8).close().extrude(12).val()


BODIES = {"slot": slot, "rounded box": rounded_box, "line and spline": spline_outline, "two cubics": two_cubics}
SECTIONS = {
    "potential": {"section": "potential", "a": 1.2},
    "sharp potential": {"section": "potential", "a": 1.2, "lam": -12},
    "uneven potential": {"section": "potential", "a": 0.8, "b": 1.4, "lam": 0.5},
    "pde": {"section": "pde", "radius": 1.2},
    "pde, order 6": {"section": "pde", "radius": 1.2, "order": 6},
    "pde, local": {"section": "pde", "radius": 1.2, "parameters": "local"},
}


@pytest.mark.parametrize("section", SECTIONS)
@pytest.mark.parametrize("body", BODIES)
def test_cells_share_section_and_tangent_planes(body, section):
    solid = cq.Workplane(BODIES[body]())
    top = solid.faces(">Z").edges()
    edges = top.edges(cq.NearestToPointSelector((0, -10, 12))) if body == "two cubics" else top
    result = cqblend.blend_edges(solid, edges, **SECTIONS[section])
    certificate = result.certificate
    between = [edge for edge in certificate.edges if edge.kind == "between"]
    assert certificate.valid
    assert len(between) >= 2
    assert max(edge.gap for edge in between) < 1e-9
    assert max(edge.angle for edge in between) < 1e-10


def test_shared_sections_are_the_exact_ones():
    """On planes that meet at a right angle, moved by a conic's amounts, the section is that conic."""
    solid = cq.Workplane(slot())
    a, b, lam = 1.2, 0.9, -3.0
    top = solid.faces(">Z").val()
    result = cqblend.blend_edges(solid, solid.faces(">Z").edges(), section="potential", a=a, b=b, lam=lam, first=top)
    height = top.Center().z
    for face in result.faces:
        for edge in face.Edges():
            points = np.array([edge.positionAt(share).toTuple() for share in np.linspace(0, 1, 41)])
            if np.ptp(points[:, 2]) < 0.1:
                continue  # a rail
            s1 = height - points[:, 2]
            s2 = np.array([solid_wall_distance(point, solid.val()) for point in points])
            conic = (
                b**2 * s1**2 + a**2 * s2**2 + a**2 * b**2 - 2 * a * b**2 * s1 - 2 * a**2 * b * s2 + 2 * lam * s1 * s2
            )
            assert np.abs(conic).max() < 1e-8


def solid_wall_distance(point, solid):
    """Return the distance of a point from the upright faces."""
    vertex = cq.Vertex.makeVertex(*point)
    return min(face.distance(vertex) for face in solid.Faces() if abs(face.normalAt().z) < 0.5)


@pytest.mark.parametrize("section", ["potential", "pde", "pde, order 6", "pde, local"])
def test_corners_are_as_exact(section):
    """Three edges that meet in a vertex of a box, which is cut through afterwards."""
    box = cq.Workplane().box(30, 20, 12)
    edges = [edge for edge in box.edges().vals() if any(v.toTuple() == (15, 10, 6) for v in edge.Vertices())]
    assert len(edges) == 3
    result = cqblend.blend_edges(box, edges, **SECTIONS[section])
    certificate = result.certificate
    assert certificate.valid
    assert result.shape.isValid()
    assert max(edge.gap for edge in certificate.edges) < 1e-9
    assert max(edge.angle for edge in certificate.edges if edge.kind == "between") < 1e-10
    knife = cq.Workplane().box(40, 40, 40).translate((0, 0, 25)).val()
    parts = result.shape.cut(knife), result.shape.intersect(knife)
    assert all(part.isValid() for part in parts)
    assert abs(sum(part.Volume() for part in parts) - result.shape.Volume()) < 1e-6 * result.shape.Volume()
