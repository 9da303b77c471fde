"""What remains of touched faces: holes beside, under and across rails, on plates where all distances are known."""

from __future__ import annotations

import cadquery as cq
import pytest

import cqblend
from cqblend.errors import SizeError

RADIUS = 4.0
X = 8.0  # where the holes are, between two of the stations at which contacts are checked


def plate(distance: float, diameter: float, depth: float | None = None) -> cq.Workplane:
    """A long plate with a hole or a dimple in its top, at a distance from the edge at y = 15."""
    work = cq.Workplane().box(400, 30, 10).faces(">Z").workplane().pushPoints([(X, 15 - distance)])
    return work.hole(diameter) if depth is None else work.hole(diameter, depth)


def long_edge(body: cq.Workplane) -> cq.Edge:
    return body.edges("|X and >Y and >Z").val()


def name(body: cq.Workplane, edge: cq.Edge) -> str:
    return f"edge {body.val().Edges().index(edge) + 1}"


def rim(body: cq.Workplane) -> cq.Edge:
    return body.faces(">Z").edges("%CIRCLE").val()


def check_sound(result: cqblend.BlendResult) -> float:
    """Check a result, and return its volume."""
    assert result.shape.isValid()
    found = cqblend.verify(result.shape, result.faces)
    assert found.ok, found.problems
    return found.volume


@pytest.mark.parametrize("clearance", [1e-6, 1e-3, 0.5])
def test_a_hole_that_the_rail_just_clears(clearance):
    body = plate(RADIUS + 1 + clearance, 2)
    check_sound(cqblend.blend_edges(body, long_edge(body), RADIUS))


@pytest.mark.parametrize("clearance", [0.0, -1e-6, -1e-3, -0.5, -1.9])
def test_a_hole_that_the_rail_cuts_is_named(clearance):
    body = plate(RADIUS + 1 + clearance, 2)
    face = body.val().Faces().index(body.faces(">Z").val()) + 1
    with pytest.raises(SizeError) as caught:
        cqblend.blend_edges(body, long_edge(body), RADIUS)
    error = caught.value
    assert f"the rail on face {face} runs into {name(body, rim(body))}, of a hole in it" in str(error)
    assert error.kind == "too large"
    assert error.shape == name(body, long_edge(body))
    assert error.room == pytest.approx((RADIUS + clearance) / RADIUS, abs=1e-3)
    largest = error.room * RADIUS
    assert "fits there" in str(error)
    check_sound(cqblend.blend_edges(body, long_edge(body), largest - 0.01))


def test_a_dimple_that_the_blend_swallows_is_consumed():
    """The blend is what it is without the dimple."""
    clearance = 0.5
    body, smooth = plate(RADIUS - 1 - clearance, 2, 0.025), cq.Workplane().box(400, 30, 10)
    result = cqblend.blend_edges(body, long_edge(body), RADIUS)
    assert len(result.shape.Faces()) == 7
    expected = check_sound(cqblend.blend_edges(smooth, long_edge(smooth), RADIUS))
    assert check_sound(result) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("clearance", [1e-6, 1e-3, 0.1])
def test_a_dimple_whose_floor_is_below_the_blend_near_the_rail(clearance):
    """Its rim is swallowed, but near the rail the blend is less deep than the dimple."""
    body = plate(RADIUS - 1 - clearance, 2, 0.01)
    message = r"the blend swallows the rim of face .*, which reaches through it; at most about"
    with pytest.raises(SizeError, match=message) as caught:
        cqblend.blend_edges(body, long_edge(body), RADIUS)
    assert caught.value.room == pytest.approx((RADIUS - 2 - clearance) / RADIUS, abs=1e-3)


@pytest.mark.parametrize("clearance", [0.0, -1e-6, -1e-3])
def test_a_dimple_that_the_rail_cuts_is_named(clearance):
    body = plate(RADIUS - 1 - clearance, 2, 0.05)
    with pytest.raises(SizeError, match=f"the rail on face .* runs into {name(body, rim(body))}, of a hole in it"):
        cqblend.blend_edges(body, long_edge(body), RADIUS)


def test_the_end_curve_may_run_into_a_hole_of_the_end_face():
    """A cross hole near the corner of the end face: the curve in which the blend ends there cuts it."""
    body = cq.Workplane().box(40, 30, 20).faces(">X").workplane().center(13.2, 8.2).hole(1, 5)
    edge = body.edges("|X and >Y and >Z").val()
    check_sound(cqblend.blend_edges(body, edge, 2))
    face = body.val().Faces().index(body.faces(">X").val()) + 1
    hole = name(body, body.faces(">X").edges("%CIRCLE").val())
    with pytest.raises(SizeError, match=f"the end curve on face {face} runs into {hole}"):
        cqblend.blend_edges(body, edge, 6, ends="natural")


def test_a_waist_between_stations_is_named():
    """A slot narrower than the distance of the stations reaches over the rail: the face would fall in two."""
    body = cq.Workplane().box(400, 30, 10).faces(">Z").workplane().center(X, -5).rect(0.5, 34).cutThruAll()
    edge = body.edges("|X and >Y and >Z").val()
    slot = {name(body, one) for one in body.faces(">Z").edges("|Y").vals()}
    with pytest.raises(SizeError, match=r"the rail on face .* runs into edge") as caught:
        cqblend.blend_edges(body, edge, RADIUS)
    assert any(one in str(caught.value) for one in slot)
    assert caught.value.room == pytest.approx(3 / RADIUS, abs=1e-3)
    check_sound(cqblend.blend_edges(body, edge, 2.9))


@pytest.mark.parametrize("radius", [1.9999, 2.1, 3.0])
def test_two_rims_of_one_ring(radius):
    """Rails of both outer rims lie on the same cylinder, of height 4: beyond 2 they pass each other at its seam."""
    ring = cq.Workplane().circle(20).circle(10).extrude(4)
    rims = ring.edges(cq.selectors.RadiusNthSelector(1)).vals()
    if radius < 2:
        check_sound(cqblend.blend_edges(ring, rims, radius))
        return
    with pytest.raises(SizeError, match=r"nothing would remain of the face .*, together with the blend of") as caught:
        cqblend.blend_edges(ring, rims, radius)
    assert caught.value.room * radius == pytest.approx(2)


def test_two_strips_that_cross_on_the_face_between_them():
    """The face narrows to 6 in its middle: rails of 3.5 cross there, and neighbour edges say nothing."""
    outline = (
        cq.Workplane().moveTo(0, -6).threePointArc((30, -3), (60, -6)).lineTo(60, 6).threePointArc((30, 3), (0, 6))
    )
    body = outline.close().extrude(10)
    edges = body.faces(">Z").edges("%CIRCLE").vals()
    assert len(edges) == 2
    with pytest.raises(SizeError, match=r"the rail on face .* runs into the rail of the other blend") as caught:
        cqblend.blend_edges(body, edges, 3.5)
    assert caught.value.room * 3.5 == pytest.approx(3, abs=0.02)
    check_sound(cqblend.blend_edges(body, edges, 2.9))


def test_a_hole_beside_the_rim_of_another():
    """Boxes of strip and hole overlap, curves do not meet: the arrangement needs the outline around both."""
    plate = cq.Workplane().box(60, 60, 8).faces(">Z").workplane().pushPoints([(0, 0)]).hole(10)
    body = plate.faces(">Z").workplane(origin=(0, 0, 0)).pushPoints([(7, 7)]).hole(4)
    edge = min(body.faces(">Z").edges("%CIRCLE").vals(), key=lambda one: one.Center().x)
    check_sound(cqblend.blend_edges(body, edge, 2))
