"""Corners with faces of their own: patches, and the sphere of a ball at rest, in one pass."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from cornered_solids import SMOOTH_KINDS, check_corners, find_edges_at, make_pyramid

import cqblend
from cqblend.errors import CqblendError, GeometryError, InputError, SizeError, UnsupportedError


def make_box() -> cq.Shape:
    return cq.Workplane().box(20, 20, 20).val()


def make_quarter_cylinder() -> cq.Shape:
    return (
        cq.Workplane().circle(10).extrude(20).intersect(cq.Workplane().rect(20, 20, centered=False).extrude(20)).val()
    )


def make_hollow_box() -> cq.Shape:
    """Return a box of which a corner is cut away by a cylinder: a concave face meets planes."""
    return make_box().cut(cq.Workplane().center(10, 10).circle(12).extrude(40, both=True).val())


def make_half_cylinder() -> cq.Shape:
    """Return a half cylinder: rails on its flat face and along its rim cross twice."""
    return cq.Workplane().circle(10).extrude(20).intersect(cq.Workplane().box(40, 40, 40).translate((0, 20, 0))).val()


BODIES = {
    "box": (make_box, (10, 10, 10), 2.0),
    "pyramid 4": (lambda: make_pyramid(4), (0, 0, 6), 0.8),
    "pyramid 5": (lambda: make_pyramid(5), (0, 0, 6), 0.8),
    "pyramid 6": (lambda: make_pyramid(6), (0, 0, 6), 0.8),
    "quarter cylinder": (make_quarter_cylinder, (0, 10, 20), 1.0),
    "half cylinder": (make_half_cylinder, (10, 0, 20), 1.0),
    "hollow box": (make_hollow_box, (10, -2, 10), 1.0),
    "pocket": (
        lambda: cq.Workplane().box(30, 30, 10).faces(">Z").workplane().rect(16, 16).cutBlind(-6).val(),
        (8, 8, -1),
        1.5,
    ),
}
QUADS = {"pyramid 4": 1}
"""Patches where rails cross, if there are not as many as edges."""


def blend_at(name: str, corner: str, **options):
    """Blend all edges at the vertex of a body, and return that, the edges and the result."""
    make, point, radius = BODIES[name]
    body = make()
    edges = find_edges_at(body, point)
    return body, edges, cqblend.blend_edges(body, edges, radius, corner=corner, **options)


@pytest.mark.parametrize("name", BODIES)
def test_a_ball_at_rest_leaves_one_sphere(name):
    body, edges, result = blend_at(name, "ball")
    (patch,) = check_corners(result, 1)
    assert patch.geomType() == "SPHERE"
    assert len(patch.Edges()) == len(edges)
    assert len(result.faces) == len(edges) + 1
    assert [one.kind for one in result.certificate.ends].count("ball") == len(edges)
    native = body.fillet(BODIES[name][2], edges) if len(edges) == 3 else None
    if native is not None and native.isValid():
        assert result.shape.Volume() == pytest.approx(native.Volume(), rel=1e-7)


@pytest.mark.parametrize(
    ("name", "section"), [*((name, "auto") for name in BODIES), ("box", "hermite"), ("quarter cylinder", "hermite")]
)
def test_patches_where_rails_cross(name, section):
    _, edges, result = blend_at(name, "cross", section=section)
    check_corners(result, QUADS.get(name, len(edges)))
    assert [one.kind for one in result.certificate.ends].count("cross") == len(edges)


@pytest.mark.parametrize("name", ["box", "pyramid 4", "hollow box", "pocket"])
def test_patches_where_ends_are_set_back(name):
    _, edges, result = blend_at(name, "setback")
    check_corners(result, 2 * len(edges))
    assert [one.kind for one in result.certificate.ends].count("setback") == len(edges)


@pytest.mark.parametrize("corner", ["cross", "setback"])
@pytest.mark.parametrize("sizes", [(2.0, 2.0, 1.0), (1.0, 2.0, 3.0)])
def test_unequal_sizes_at_a_box_corner(sizes, corner):
    body = make_box()
    edges = find_edges_at(body, (10, 10, 10))
    result = cqblend.blend_edges(body, edges, dict(zip(edges, sizes, strict=True)), corner=corner)
    check_corners(result, 3 if corner == "cross" else 6)


def test_sizes_too_unequal_for_rails_to_cross_take_setbacks():
    body = make_box()
    edges = find_edges_at(body, (10, 10, 10))
    sizes = dict(zip(edges, (0.5, 0.5, 4.0), strict=True))
    check_corners(cqblend.blend_edges(body, edges, sizes, corner="setback"), 6)
    with pytest.raises(GeometryError, match="the patches of the corner fold"):
        cqblend.blend_edges(body, edges, sizes, corner="cross")


def test_the_sphere_of_a_box_corner_is_an_octant():
    _, _, result = blend_at("box", "ball")
    assert result.faces[-1].Area() == pytest.approx(np.pi * 4 / 2, rel=1e-9)


def test_all_edges_of_a_box_take_eight_balls():
    body = make_box()
    result = cqblend.blend_edges(body, body.Edges(), 2.0, corner="ball")
    check_corners(result, 8)
    rounded = 16**3 + 6 * 2 * 16**2 + 12 * np.pi * 16 + 4 / 3 * np.pi * 8
    assert result.shape.Volume() == pytest.approx(rounded, rel=1e-9)
    later = cq.Workplane(result.shape).cut(cq.Workplane().box(5, 5, 40)).val()
    assert later.isValid()
    assert later.Volume() == pytest.approx(rounded - 500, rel=1e-9)


def test_four_edges_at_an_apex_are_blended_without_being_asked_how():
    _, edges, result = blend_at("pyramid 4", "auto")
    (patch,) = check_corners(result, 1)
    assert patch.geomType() == "SPHERE"
    assert f"{len(edges)} edges between blends: gap " in str(result.certificate)


def test_where_no_ball_fits_rails_cross():
    body = make_pyramid(4)
    edges = find_edges_at(body, (0, 0, 6))
    result = cqblend.blend_edges(body, edges, dict(zip(edges, (0.8, 0.9, 0.8, 0.7), strict=True)))
    check_corners(result, 1)
    assert {one.kind for one in result.certificate.ends} == {"cross", "natural"}
    with pytest.raises(GeometryError, match="no ball rests in the corner: the blends there are not arcs of one radius"):
        cqblend.blend_edges(body, edges, dict(zip(edges, (0.8, 0.9, 0.8, 0.7), strict=True)), corner="ball")


def test_a_mixed_corner_is_set_back():
    outline = [(0, 0), (20, 0), (20, 10), (10, 10), (10, 20), (0, 20)]
    body = cq.Workplane().polyline(outline).close().extrude(15).val()
    edges = find_edges_at(body, (10, 10, 15))
    check_corners(cqblend.blend_edges(body, edges, 1.5, corner="setback"), 6)
    with pytest.raises(GeometryError, match="some of its edges are convex, others concave"):
        cqblend.blend_edges(body, edges, 1.5, corner="ball")


@pytest.mark.parametrize(("corner", "patches"), [("ball", 1), ("setback", 6)])
def test_an_acute_wedge(corner, patches):
    outline = [(0, 0), (20, 0), (20, 20 * np.tan(np.radians(17)))]
    body = cq.Workplane("XZ").polyline(outline).close().extrude(15).val()
    check_corners(cqblend.blend_edges(body, find_edges_at(body, (0, 0, 0)), 0.4, corner=corner), patches)


def test_setbacks_are_as_asked():
    body = make_box()
    edges = find_edges_at(body, (10, 10, 10))
    setbacks = dict(zip(edges, (3.0, 4.0, 5.0), strict=True))
    result = cqblend.blend_edges(body, edges, 1.0, corner="setback", setback=setbacks)
    check_corners(result, 6)
    lengths = [max(edge.Length() for edge in face.Edges()) for face in result.faces[:3]]
    assert np.allclose(sorted(lengths), [15.0, 16.0, 17.0])
    with pytest.raises(SizeError, match=r"setback 0\.9 ends where the rails have crossed already, 1 mm") as caught:
        cqblend.blend_edges(body, edges, 1.0, corner="setback", setback=0.9)
    assert caught.value.kind == "setback"


def test_setbacks_of_other_edges_are_refused():
    body = make_box()
    edges = find_edges_at(body, (10, 10, 10))
    others = find_edges_at(body, (-10, -10, -10))
    with pytest.raises(InputError, match=r"a setback is given for edge .*, which is not picked"):
        cqblend.blend_edges(body, edges, 1.0, corner="setback", setback={others[0]: 3.0})


def test_edges_that_are_too_short_for_setbacks_are_named():
    body = cq.Workplane().box(20, 20, 3).val()
    with pytest.raises(CqblendError, match="the patches of the corner take"):
        cqblend.blend_edges(body, find_edges_at(body, (10, 10, 1.5)), 1.4, corner="setback")


def test_a_corner_that_there_is_not_is_refused():
    body = make_box()
    with pytest.raises(InputError, match="corner='ball' has no effect"):
        cqblend.blend_edges(body, find_edges_at(body, (10, 10, 10))[:1], 1.0, corner="ball")


def test_more_than_three_edges_beside_sharp_ones_are_refused():
    body = make_pyramid(5)
    with pytest.raises(UnsupportedError, match=r"4 of the edges meet .*, beside others, sharp or smooth"):
        cqblend.blend_edges(body, find_edges_at(body, (0, 0, 6))[:4], 0.5)


def make_wavy_block() -> cq.Shape:
    """Return a block whose top is a wavy bicubic face."""
    rng = np.random.default_rng(1)
    steps = np.linspace(-10, 10, 4).tolist()
    points = [[cq.Vector(x, y, 10 + 0.8 * rng.normal()) for y in steps] for x in steps]
    top = cq.Face.makeSplineApprox(points, tol=1e-9, minDeg=3, maxDeg=3)
    return cq.Solid.extrudeLinear(top, cq.Vector(0, 0, -20))


def find_top_corner(body: cq.Shape) -> list[cq.Edge]:
    vertex = max(body.Vertices(), key=lambda one: one.Z > 0 and one.X + one.Y)
    return find_edges_at(body, vertex.toTuple())


def test_a_freeform_face_exactly():
    body = make_wavy_block()
    result = cqblend.blend_edges(body, find_top_corner(body), 1.0, corner="setback", form="exact")
    check_corners(result, 6)


@pytest.mark.parametrize(("corner", "patches", "angle"), [("setback", 6, 1e-10), ("cross", 3, 1e-6)])
def test_a_freeform_face_in_the_compact_form(corner, patches, angle):
    """Strips that are set back end there, exactly; others are cut inside, where they are as exact as they promise."""
    body = make_wavy_block()
    result = cqblend.blend_edges(body, find_top_corner(body), 1.0, corner=corner)
    assert result.certificate.form == "compact"
    records = [one for one in result.certificate.edges if one.kind in SMOOTH_KINDS]
    assert max(one.angle for one in records) <= angle
    assert result.shape.isValid()
    assert cqblend.verify(result.shape, list(result.faces)).problems == ()
    assert len(result.faces) == 3 + patches


def make_tetrahedron(seed: int) -> cq.Shape:
    """Return a tetrahedron with random vertices on a sphere."""
    points = np.random.default_rng(seed).normal(size=(4, 3))
    points *= 10 / np.linalg.norm(points, axis=1)[:, None]
    faces = []
    for k in range(4):
        a, b, c = np.delete(points, k, axis=0)
        if np.cross(b - a, c - a) @ (points[k] - a) > 0:
            b, c = c, b
        faces.append(cq.Face.makeFromWires(cq.Wire.makePolygon([cq.Vector(*one) for one in (a, b, c, a)])))
    return cq.Solid.makeSolid(cq.Shell.makeShell(faces))


@pytest.mark.parametrize("seed", [0, 4])
def test_six_sizes_at_the_edges_of_a_tetrahedron(seed):
    """Whatever goes on around what, or ends in patches: all of it is sound."""
    body = make_tetrahedron(seed)
    rng, length = np.random.default_rng(seed), min(edge.Length() for edge in body.Edges())
    sizes = {edge: float(size) for edge, size in zip(body.Edges(), rng.uniform(0.01, 0.05, 6) * length, strict=True)}
    result = cqblend.blend_edges(body, body.Edges(), sizes)
    assert result.shape.isValid()
    assert cqblend.verify(result.shape, list(result.faces)).problems == ()
    assert all(one.angle <= 1e-10 for one in result.certificate.edges if one.kind in SMOOTH_KINDS)
