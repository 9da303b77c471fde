"""Corners with faces of their own: patches, and the sphere of a ball at rest, in one pass."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from cornered_solids import blend_corners, find_edges_at, make_pyramid

from cqblend.errors import CqblendError, GeometryError, SizeError


def make_box() -> cq.Shape:
    return cq.Workplane().box(20, 20, 20).val()


def make_quarter_cylinder() -> cq.Shape:
    return (
        cq.Workplane().circle(10).extrude(20).intersect(cq.Workplane().rect(20, 20, centered=False).extrude(20)).val()
    )


def make_hollow_box() -> cq.Shape:
    """Return a box of which a corner is cut away by a cylinder: a concave face meets planes."""
    return make_box().cut(cq.Workplane().center(10, 10).circle(12).extrude(40, both=True).val())


BODIES = {
    "box": (make_box, (10, 10, 10), 2.0),
    "pyramid 4": (lambda: make_pyramid(4), (0, 0, 6), 0.8),
    "pyramid 5": (lambda: make_pyramid(5), (0, 0, 6), 0.8),
    "pyramid 6": (lambda: make_pyramid(6), (0, 0, 6), 0.8),
    "quarter cylinder": (make_quarter_cylinder, (0, 10, 20), 1.0),
    "hollow box": (make_hollow_box, (10, -2, 10), 1.0),
    "pocket": (
        lambda: cq.Workplane().box(30, 30, 10).faces(">Z").workplane().rect(16, 16).cutBlind(-6).val(),
        (8, 8, -1),
        1.5,
    ),
}
QUADS = {"pyramid 4": 1}
"""Patches where rails cross, if there are not as many as edges."""


@pytest.mark.parametrize("name", BODIES)
def test_a_ball_at_rest_leaves_one_sphere(name):
    make, point, radius = BODIES[name]
    body = make()
    edges = find_edges_at(body, point)
    result = blend_corners(body, edges, "ball", radius=radius).check()
    (patch,) = result.patches
    assert patch.geomType() == "SPHERE"
    assert len(patch.Edges()) == len(edges)
    native = body.fillet(radius, edges) if len(edges) == 3 else None
    if native is not None and native.isValid():
        assert result.shape.Volume() == pytest.approx(native.Volume(), rel=1e-7)


@pytest.mark.parametrize(
    ("name", "section"), [*((name, "auto") for name in BODIES), ("box", "hermite"), ("quarter cylinder", "hermite")]
)
def test_patches_where_rails_cross(name, section):
    make, point, radius = BODIES[name]
    body = make()
    edges = find_edges_at(body, point)
    result = blend_corners(body, edges, "cross", radius=radius, section=section).check()
    assert len(result.patches) == QUADS.get(name, len(edges))


@pytest.mark.parametrize("name", ["box", "pyramid 4", "hollow box", "pocket"])
def test_patches_where_ends_are_set_back(name):
    make, point, radius = BODIES[name]
    body = make()
    edges = find_edges_at(body, point)
    result = blend_corners(body, edges, "setback", radius=radius).check()
    assert len(result.patches) == 2 * len(edges)


def test_the_sphere_of_a_box_corner_is_an_octant():
    body = make_box()
    result = blend_corners(body, find_edges_at(body, (10, 10, 10)), "ball", radius=2.0)
    assert result.patches[0].Area() == pytest.approx(np.pi * 4 / 2, rel=1e-9)


def test_all_edges_of_a_box_take_eight_balls():
    body = make_box()
    result = blend_corners(body, body.Edges(), "ball", radius=2.0).check()
    assert len(result.patches) == 8
    rounded = 16**3 + 6 * 2 * 16**2 + 12 * np.pi * 16 + 4 / 3 * np.pi * 8
    assert result.shape.Volume() == pytest.approx(rounded, rel=1e-9)
    later = cq.Workplane(result.shape).cut(cq.Workplane().box(5, 5, 40)).val()
    assert later.isValid()
    assert later.Volume() == pytest.approx(rounded - 500, rel=1e-9)


def test_a_mixed_corner_is_set_back():
    outline = [(0, 0), (20, 0), (20, 10), (10, 10), (10, 20), (0, 20)]
    body = cq.Workplane().polyline(outline).close().extrude(15).val()
    edges = find_edges_at(body, (10, 10, 15))
    result = blend_corners(body, edges, "setback", radius=1.5).check()
    assert len(result.patches) == 6
    with pytest.raises(GeometryError, match="some of its edges are convex, others concave"):
        blend_corners(body, edges, "ball", radius=1.5)


@pytest.mark.parametrize("method", ["ball", "setback"])
def test_an_acute_wedge(method):
    outline = [(0, 0), (20, 0), (20, 20 * np.tan(np.radians(17)))]
    body = cq.Workplane("XZ").polyline(outline).close().extrude(15).val()
    blend_corners(body, find_edges_at(body, (0, 0, 0)), method, radius=0.4).check()


def test_setbacks_are_as_asked():
    body = make_box()
    edges = find_edges_at(body, (10, 10, 10))
    result = blend_corners(body, edges, "setback", {0: 3.0, 1: 4.0, 2: 5.0}, radius=1.0).check()
    lengths = sorted(max(edge.Length() for edge in strip.Edges()) for strip in result.strips)
    assert np.allclose(lengths, [15.0, 16.0, 17.0])
    with pytest.raises(SizeError, match=r"setback 0\.9 ends where the rails have crossed already, 1 mm") as caught:
        blend_corners(body, edges, "setback", {1: 0.9}, radius=1.0)
    assert caught.value.kind == "setback"


def test_edges_that_are_too_short_for_setbacks_are_named():
    body = cq.Workplane().box(20, 20, 3).val()
    with pytest.raises(CqblendError, match="the patches of the corner take"):
        blend_corners(body, find_edges_at(body, (10, 10, 1.5)), "setback", radius=1.4)
