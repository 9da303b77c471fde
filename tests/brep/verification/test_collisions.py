"""Pieces and formulas never keep two faces apart that touch, and mostly do so where they are apart."""

import cadquery as cq
import numpy as np
import pytest
from measured_shapes import wrapped
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.TopAbs import TopAbs_FACE

from cqblend.brep.topology import CONFUSION, ShapeIndex
from cqblend.brep.verification.collisions import _FacePieces
from cqblend.brep.verification.face_boxes import FaceBoxes
from cqblend.brep.verification.surface_distance import find_distance

BODIES = {
    "box": cq.Workplane().box(3, 4, 5),
    "cylinder": cq.Workplane().circle(2).extrude(5),
    "cone": cq.Workplane(cq.Solid.makeCone(3, 1, 4)),
    "sphere": cq.Workplane().sphere(2.5),
    "torus": cq.Workplane(cq.Solid.makeTorus(4, 1)),
}


def faces_of(shape):
    return list(ShapeIndex(shape, TopAbs_FACE))


@pytest.mark.parametrize("name", BODIES)
@pytest.mark.parametrize("as_spline", [False, True])
def test_faces_that_touch_are_never_kept_apart(name, as_spline):
    rng = np.random.default_rng(5)
    pins = [cq.Workplane().sphere(0.8).translate(tuple(place)) for place in rng.uniform(-4, 4, (12, 3)).tolist()]
    body = wrapped(BODIES[name])
    if as_spline:
        body = BRepBuilderAPI_NurbsConvert(body).Shape()
    apart = decided = 0
    for pin in pins:
        (ball,) = faces_of(BRepBuilderAPI_NurbsConvert(wrapped(pin)).Shape())
        pieces = _FacePieces(ball)
        for face in faces_of(body):
            touches = BRepExtrema_DistShapeShape(ball, face).Value() <= CONFUSION
            assert pieces.may_touch(face) or not touches
            apart += not touches
            decided += not pieces.may_touch(face)
    assert decided > 0.8 * apart > 0


@pytest.mark.parametrize("name", BODIES)
def test_distances_are_no_larger_than_those_that_occt_measures(name):
    points = np.random.default_rng(3).uniform(-5, 5, (20, 3))
    for face in faces_of(wrapped(BODIES[name])):
        found = np.abs(find_distance(BRep_Tool.Surface_s(face))(points))
        for point, distance in zip(points.tolist(), found.tolist(), strict=True):
            vertex = cq.Vertex.makeVertex(*point).wrapped
            assert distance <= BRepExtrema_DistShapeShape(vertex, face).Value() + 1e-9


def test_points_of_a_surface_are_at_no_distance():
    for body in BODIES.values():
        for face in faces_of(wrapped(body)):
            surface = BRep_Tool.Surface_s(face)
            points = np.array([surface.Value(u, v).Coord() for u in (0.1, 2.0, 5.0) for v in (0.2, 0.9)])
            assert np.abs(find_distance(surface)(points)).max() < 1e-12


def test_boxes_that_overlap_and_that_rays_meet():
    boxes = FaceBoxes(faces_of(wrapped(cq.Workplane().box(2, 2, 2))))
    overlaps = boxes.find_overlaps(np.arange(6))
    assert overlaps.sum() == 6 * 5  # all but the opposite ones
    assert (overlaps == overlaps.T).all()
    hits = boxes.find_hits(np.zeros(3), np.array([[1.0, 0.1, 0.2], [0.0, 0.0, -1.0]]))
    assert hits.sum(axis=1).tolist() == [1, 1]
