"""Full rounds: the face between two blends whose rails meet is gone, and the blends are tangent to each other."""

from __future__ import annotations

import math

import cadquery as cq
import numpy as np
import pytest
from OCP.BRepCheck import BRepCheck_Analyzer

import cqblend
from cqblend.errors import SizeError


def slab(thickness: float = 10.0) -> cq.Workplane:
    return cq.Workplane().box(50, 30, thickness)


def front_edges(body: cq.Workplane) -> list[cq.Edge]:
    return body.edges("|Y and >X").vals()


def wedge(slope: float) -> cq.Workplane:
    """A slab 10 thick at its front, x = 50, whose top falls off towards the back."""
    outline = [(0, 0), (50, 0), (50, 10), (0, 10 - 50 * slope)]
    return cq.Workplane("XZ").polyline(outline).close().extrude(30)


def find_common_edges(result: cqblend.BlendResult) -> list[cq.Edge]:
    first, second = result.faces
    return [one for one in first.Edges() if any(one.isSame(other) for other in second.Edges())]


def check(result: cqblend.BlendResult, removed_face: tuple[float, float, float], normal: tuple) -> None:
    """The solid is sound, the middle face is gone, and OCCT's own analysis finds the blends tangent."""
    assert result.shape.isValid()
    assert BRepCheck_Analyzer(result.shape.wrapped, True, False, True).IsValid()
    found = cqblend.verify(result.shape, result.faces)
    assert found.ok, found.problems
    assert result.certificate.valid
    assert result.certificate.coverage == 1
    assert result.certificate.angle <= 1e-10
    assert result.certificate.gap <= 1e-9
    assert result.certificate.proof.angle <= 1e-10
    for face in result.shape.Faces():
        is_there = face.geomType() == "PLANE" and (face.Center() - cq.Vector(*removed_face)).Length < 1
        assert not (is_there and abs(face.normalAt().dot(cq.Vector(*normal))) > 0.99)
    assert find_common_edges(result)
    for edge in find_common_edges(result):
        measured = cqblend.continuity(result.shape, edge)
        assert measured.angle <= 1e-10
        assert measured.gap <= 1e-9


@pytest.mark.parametrize("options", [{}, {"continuity": "G2"}, {"form": "compact"}, {"section": "arc"}])
def test_a_slab_gets_a_round_front(options):
    body = slab()
    result = cqblend.blend_edges(body, front_edges(body), 5, **options)
    check(result, (25, 0, 0), (1, 0, 0))
    assert len(result.shape.Faces()) == 7
    front = body.val().Faces().index(body.faces(">X").val()) + 1
    assert result.certificate.method == f"wire substitution, face {front} gone"
    single = slab(20)
    alone = cqblend.blend_edges(single, front_edges(single)[0], 5, **options)
    removed = cqblend.verify(single).volume - cqblend.verify(alone.shape).volume
    assert cqblend.verify(body).volume - cqblend.verify(result.shape).volume == pytest.approx(2 * removed, rel=1e-9)


@pytest.mark.parametrize("radius", [4.9, 4.999999])
def test_a_little_less_leaves_a_face(radius):
    body = slab()
    result = cqblend.blend_edges(body, front_edges(body), radius)
    assert len(result.shape.Faces()) == 8
    assert cqblend.verify(result.shape, result.faces).ok
    middle = [face for face in result.shape.Faces() if abs(face.Center().x - 25) < 1e-6]
    assert sum(face.Area() for face in middle) == pytest.approx(30 * (10 - 2 * radius), rel=1e-3)


@pytest.mark.parametrize("radius", [5.0000005, 5.1, 7])
def test_a_little_more_is_refused_with_half_the_thickness(radius):
    body = slab()
    with pytest.raises(SizeError, match="at most about 5 fits there") as caught:
        cqblend.blend_edges(body, front_edges(body), radius)
    assert caught.value.room * radius == pytest.approx(5)
    assert "together with the blend of edge" in str(caught.value)


@pytest.mark.parametrize("slope", [0.0, 0.05, 0.1, 0.2])
def test_sloped_slabs(slope):
    """The ball that touches front, bottom and top: 10 = R (1 + m + sqrt(1 + m^2)) for a top of slope m."""
    radius = 10 / (1 + slope + math.hypot(1, slope))
    body = wedge(slope)
    edges = [edge for edge in body.edges("|Y").vals() if edge.Center().x > 49]
    check(cqblend.blend_edges(body, edges, radius), (50, -15, 5), (1, 0, 0))
    with pytest.raises(SizeError) as caught:
        cqblend.blend_edges(body, edges, 1.02 * radius)
    assert caught.value.room * 1.02 == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("slope", [0.05, 0.1, 0.2])
def test_a_ball_that_grows_along_a_slab(slope):
    """A slab whose thickness grows along its front: the ball's contacts run along the line halfway between both edges.

    There it is as far from either edge: R is the tangent of half the angle between them times the distance from where
    they meet.
    """
    body = cq.Workplane("YZ").polyline([(0, 0), (30, 0), (30, 10 + slope * 30), (0, 10)]).close().extrude(50)
    front = [edge for edge in body.faces(">X").edges().vals() if abs(edge.tangentAt(0.5).y) > 0.9]
    meeting = cq.Vector(50, -10 / slope, 0)
    tangent = math.tan(math.atan(slope) / 2)

    def take_share(share: float) -> dict:
        ends = {edge: (edge.startPoint(), edge.endPoint()) for edge in front}
        return {
            edge: cqblend.linear(*(share * tangent * (point - meeting).Length for point in points))
            for edge, points in ends.items()
        }

    result = cqblend.blend_edges(body, front, take_share(1.0))
    check(result, (50, 15, 5), (1, 0, 0))
    assert len(result.shape.Faces()) == 7
    assert len(cqblend.blend_edges(body, front, take_share(0.98)).shape.Faces()) == 8
    with pytest.raises(SizeError) as caught:
        cqblend.blend_edges(body, front, take_share(1.02))
    assert caught.value.room * 1.02 == pytest.approx(1, abs=1e-3)


@pytest.mark.parametrize("section", ["hermite", "arc"])
@pytest.mark.parametrize("which", [0, 1])
def test_the_rim_of_a_ring(which, section):
    """Around an axis, outside and inside: each pair of blends makes half a torus, exactly so by arcs."""
    ring = cq.Workplane().circle(20).circle(10).extrude(4)
    rims = ring.edges(cq.selectors.RadiusNthSelector(which)).vals()
    result = cqblend.blend_edges(ring, rims, 2, section=section)
    check(result, (0, 0, 2), (0, 0, 1))
    assert len(result.shape.Faces()) == 5
    if section == "arc":
        assert [face.geomType() for face in result.faces] == ["TORUS", "TORUS"]
        half_disc, middle = (
            math.pi * 2,
            4 * 2 / (3 * math.pi),
        )  # area, and distance of its centroid from the torus circle
        centroid = 18 + middle if which else 12 - middle
        box = 2 * 4 * 2 * math.pi * (19 if which else 11)
        removed = cqblend.verify(ring).volume - cqblend.verify(result.shape).volume
        assert removed == pytest.approx(box - 2 * math.pi * centroid * half_disc, rel=1e-9)


def test_the_top_of_a_curved_wall():
    """Rails are arcs of one circle, the parameters of both angles of their own."""
    tube = cq.Workplane().circle(20).circle(16).extrude(10)
    wall = tube.intersect(cq.Workplane().box(25, 25, 40, centered=(False, False, True)))
    result = cqblend.blend_edges(wall, wall.faces(">Z").edges("%CIRCLE").vals(), 2)
    check(result, (12, 12, 10), (0, 0, 1))
    (edge,) = find_common_edges(result)
    points = np.array([point.toTuple() for point in edge.positions(np.linspace(0, 1, 9))])
    assert np.hypot(points[:, 0], points[:, 1]) == pytest.approx(18, abs=1e-9)
    assert points[:, 2] == pytest.approx(10, abs=1e-9)


@pytest.mark.parametrize("section", ["hermite", "arc"])
@pytest.mark.parametrize("turn", [40.0, -120.0])
@pytest.mark.parametrize("step", [1, -1])
def test_the_top_of_a_tube_whose_rims_start_elsewhere(turn, step, section):
    """Both rails are one circle, which starts at another place for either blend: it is cut in two arcs."""
    hole = cq.Workplane().circle(16).extrude(10).rotate((0, 0, 0), (0, 0, 1), turn)
    tube = cq.Workplane().circle(20).extrude(10).cut(hole)
    rims = tube.faces(">Z").edges("%CIRCLE").vals()[::step]
    assert len({round(math.atan2(v.Y, v.X), 6) for rim in rims for v in rim.Vertices()}) == 2
    result = cqblend.blend_edges(tube, rims, 2, section=section)
    check(result, (0, 0, 10), (0, 0, 1))
    arcs = find_common_edges(result)
    assert len(arcs) == 2
    assert sum(arc.Length() for arc in arcs) == pytest.approx(2 * math.pi * 18, rel=1e-12)


def test_edges_in_either_order_give_the_same_solid():
    body = slab()
    results = [cqblend.blend_edges(body, front_edges(body)[::step], 5) for step in (1, -1)]
    volumes = [cqblend.verify(result.shape, result.faces).volume for result in results]
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-12)


def test_a_hole_in_the_middle_face_is_named():
    body = slab().faces(">X").workplane().center(0.6, 0).hole(0.4, 20)
    hole = body.val().Edges().index(body.faces(">X").edges("%CIRCLE").val()) + 1
    with pytest.raises(SizeError, match=f"the two blends meet all along .* but edge {hole} of it would be left"):
        cqblend.blend_edges(body, [e for e in body.edges("|Y").vals() if e.Center().x > 24], 5)


def test_flat_ends_leave_something_of_the_middle_face():
    body = slab()
    with pytest.raises(SizeError, match=r"the two blends meet all along face .*, but edge .* of it would be left"):
        cqblend.blend_edges(body, front_edges(body), 5, ends="flat")


def test_the_full_round_goes_through_step_and_into_later_features(tmp_path):
    body = slab()
    result = cqblend.blend_edges(body, front_edges(body), 5)
    path = tmp_path / "round.step"
    cq.exporters.export(cq.Workplane(result.shape), str(path))
    again = cq.importers.importStep(str(path)).val()
    assert again.isValid()
    assert again.Volume() == pytest.approx(result.shape.Volume(), rel=1e-9)
    drilled = cq.Workplane(result.shape).faces("<X").workplane().hole(4)
    assert drilled.val().isValid()
