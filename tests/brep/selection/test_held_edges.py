"""Edges to hold a rail on: which face goes, which lies beyond, and the directions into both."""

import cadquery as cq
import numpy as np
import pytest

from cqblend.brep.selection.held_edges import find_held_edge, is_beside
from cqblend.brep.selection.picked_edges import select_chains

PLATE = cq.Workplane().box(30, 20, 3).val()
DISC = cq.Workplane().circle(12).extrude(3).val()


def edge_at(body: cq.Shape, point: tuple[float, float, float]) -> cq.Edge:
    return min(body.Edges(), key=lambda edge: (edge.positionAt(0.5) - cq.Vector(*point)).Length)


def held(body: cq.Shape, near: tuple[float, float, float], far: tuple[float, float, float]):
    selection = select_chains(body.wrapped, [edge_at(body, near).wrapped], None, None, follow=True)
    ((found,),) = selection.networks
    (joint,) = found.chain.cells
    return find_held_edge(joint, [edge_at(body, far).wrapped])


@pytest.mark.parametrize("near", [(15, 0, 1.5), (0, 10, 1.5), (-15, 0, 1.5)])
def test_the_edge_runs_with_the_spine_between_the_same_end_faces(near):
    far = (near[0], near[1], -1.5)
    found = held(PLATE, near, far)
    points, tangents = found.evaluate(np.linspace(0, 1, 5))
    stations = found.joint.locate_stations(np.linspace(0, 1, 5))
    assert points == pytest.approx(stations.points - (0, 0, 3), abs=1e-12)
    assert tangents == pytest.approx(stations.tangents, abs=1e-12)
    assert cq.Face(found.face).Center().toTuple() == pytest.approx((near[0], near[1], 0), abs=1e-9)
    assert cq.Face(found.face_beyond).Center().z == pytest.approx(-1.5)
    assert len(found.end_edges) == 2
    t = np.array([0.25, 0.75])
    wall_normals, up = found.evaluate_face_directions(t, found.oriented_face)
    bottom_normals, inwards = found.evaluate_face_directions(t, found.face_beyond)
    outwards = np.array([near[0] / 15, near[1] / 10, 0.0])
    assert wall_normals == pytest.approx(np.tile(outwards, (2, 1)), abs=1e-12)
    assert up == pytest.approx(np.tile([0.0, 0, 1], (2, 1)), abs=1e-12)
    assert bottom_normals == pytest.approx(np.tile([0.0, 0, -1], (2, 1)), abs=1e-12)
    assert inwards == pytest.approx(np.tile(-outwards, (2, 1)), abs=1e-12)


def test_a_closed_edge_has_no_end_edges_and_turns_with_the_spine():
    found = held(DISC, (-12, 0, 3), (-12, 0, 0))
    assert found.end_edges == ()
    circle = found.circle
    assert circle.radius == pytest.approx(12)
    assert circle.turn == pytest.approx(2 * np.pi)
    points, tangents = found.evaluate(np.array([0.1, 0.4]))
    assert np.cross(circle.axis, (points - circle.centre) / 12) == pytest.approx(tangents, abs=1e-12)
    assert found.kinks is None


def test_edges_of_other_faces_are_not_beside():
    found = held(PLATE, (15, 0, 1.5), (15, 0, -1.5))
    assert is_beside(edge_at(PLATE, (15, 10, 0)).wrapped, found.joint)
    assert not is_beside(edge_at(PLATE, (-15, 0, -1.5)).wrapped, found.joint)
