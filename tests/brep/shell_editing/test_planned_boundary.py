"""Planned boundaries of faces as curves: closed, inside their boxes, and told apart where nothing can meet."""

from __future__ import annotations

from collections import Counter

import cadquery as cq
import numpy as np
import pytest
from test_strip_planning import plan

from cqblend.blends.network.blend_plan import FacePlan
from cqblend.brep.shell_editing.planned_boundary import find_close_pairs, list_boundary_parts, measure_scale
from cqblend.surfaces.circle import PlanarCircle


def blended_box():
    box = cq.Workplane().box(30, 20, 10)
    return plan(box.val(), box.edges("|Z and >X and >Y").vals(), 2)


def blended_wall():
    """Rails and end curves are arcs, of all quadrants."""
    body = (
        cq.Workplane().circle(20).circle(12).extrude(10).intersect(cq.Workplane().box(90, 90, 90).translate((35, 0, 0)))
    )
    return plan(body.val(), body.faces(">Z").edges("%CIRCLE").vals(), 2)


def blended_cylinder():
    body = cq.Workplane().circle(10).extrude(20)
    return plan(body.val(), body.faces(">Z").edges().vals(), 3)


@pytest.mark.parametrize("make", [blended_box, blended_cylinder])
def test_each_part_starts_where_another_stops(make):
    index, planned = make()
    for face_plan in planned.faces:
        for one in (face_plan, FacePlan(face_plan.number)):
            parts = list_boundary_parts(index, one)
            ends = Counter(part.ends[0] for part in parts)
            ends.subtract(part.ends[1] for part in parts)
            assert not any(ends.values())
            places = np.array([part.evaluate(np.array(part.span)) for part in parts])
            gaps = np.linalg.norm(places[:, None, 0] - places[None, :, 1], axis=2)
            assert gaps.min(axis=0).max() < 1e-9


@pytest.mark.parametrize("make", [blended_box, blended_wall, blended_cylinder])
def test_parts_lie_in_their_boxes(make):
    index, planned = make()
    for face_plan in planned.faces:
        for part in list_boundary_parts(index, face_plan):
            points = part.evaluate(np.linspace(*part.span, 101))
            assert (points >= part.box[0] - 1e-12).all()
            assert (points <= part.box[1] + 1e-12).all()
            if part.pcurve is not None and isinstance(part.pcurve, PlanarCircle):
                assert points.min(axis=0) == pytest.approx(part.box[0], abs=1e-2)
                assert points.max(axis=0) == pytest.approx(part.box[1], abs=1e-2)
            straight = np.linspace(*points[[0, -1]], 101)
            assert part.is_straight == (np.abs(points - straight).max() < 1e-9)


def test_a_rail_on_a_box_is_near_nothing():
    index, planned = blended_box()
    for face_plan in planned.faces:
        assert not list(find_close_pairs(list_boundary_parts(index, face_plan), np.full(2, 1e-6)))


def test_the_scale_is_that_of_lengths():
    index, planned = blended_cylinder()
    (side,) = [plan for plan in planned.faces if cq.Shape.cast(index.faces[plan.number]).geomType() == "CYLINDER"]
    face = list_boundary_parts(index, side)[0].face
    assert measure_scale(face, np.array([1.0, 5.0])) == pytest.approx([10, 1])
