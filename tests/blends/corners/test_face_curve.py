"""Curves on support faces, and the sides that they make."""

import numpy as np
import pytest

from cqblend.blends.corners.corner_side import CornerFrame, make_face_side
from cqblend.blends.corners.face_curve import CurveEnd, build_face_curve, choose_velocities
from cqblend.splines import Surface
from cqblend.surfaces.quadrics import Cone, Cylinder, Plane, Sphere
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import LocalFrame

FRAME = LocalFrame(np.array([1.0, -2.0, 3.0]), np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0])


def make_bicubic():
    """Return a wavy bicubic surface over the unit square."""
    rng = np.random.default_rng(5)
    i, j = np.meshgrid(np.arange(4), np.arange(4), indexing="ij")
    poles = np.stack([i / 3, j / 3, 0.3 * rng.normal(size=(4, 4))], axis=2)
    return TensorSurface.from_spline(Surface(([0.0, 1.0], [0.0, 1.0]), poles[..., None, None]))


SURFACES = {
    "plane": (Plane(FRAME), 3),
    "plane in 4-space": (Plane(FRAME), 4),
    "cylinder": (Cylinder(FRAME, 2.0), 4),
    "cone": (Cone(FRAME, 2.0, 0.4), 4),
    "sphere": (Sphere(FRAME, 2.0, FRAME.axes[0]), 4),
    "torus": (RevolvedEllipse.from_radii(FRAME, 3.0, 1.0), 4),
    "bicubic": (make_bicubic(), 3),
    "bicubic in 4-space": (make_bicubic(), 4),
}


@pytest.mark.parametrize("name", SURFACES)
def test_face_curves_run_from_rail_to_rail_on_their_surface(name):
    primary, dim = SURFACES[name]
    uv = np.array([[0.2, 0.3], [0.7, 0.8]])
    jet = primary.jet(uv)
    velocities = [0.7 * jet[1, 0] + 0.4 * jet[2, 0], 0.2 * jet[1, 1] + 0.5 * jet[2, 1]]
    weights = (1.0, 1.0) if dim == 3 else (1.3, 0.8)
    ends = [CurveEnd(*one) for one in zip(uv, velocities, weights, strict=True)]
    curve = build_face_curve(primary, *ends)
    position = primary.compose_position(curve)
    for t, end, point in zip((0.0, 1.0), ends, jet[0], strict=True):
        *weighted, weight = position(np.array([t]))[0]
        *rate, weight_rate = position(np.array([t]), 1)[0]
        at = np.array(weighted) / weight
        velocity = (np.array(rate) - weight_rate * at) / weight
        assert np.abs(at - point).max() < 1e-13
        assert np.abs(velocity / np.linalg.norm(velocity) - end.velocity / np.linalg.norm(end.velocity)).max() < 1e-13
        assert abs(weight - end.weight) < 1e-13


@pytest.mark.parametrize("name", SURFACES)
def test_fields_of_face_sides_span_tangent_planes(name):
    primary, dim = SURFACES[name]
    uv = np.array([[0.2, 0.3], [0.7, 0.8]])
    jet = primary.jet(uv)
    curve = build_face_curve(primary, CurveEnd(uv[0], jet[1, 0]), CurveEnd(uv[1], jet[2, 1]))
    side = make_face_side(primary, curve, dim)
    t = np.linspace(0, 1, 21)
    native = primary.unlift_points(curve(t), uv[0] + t[:, None] * (uv[1] - uv[0]))
    normals = primary.evaluate_normals(native)
    point = side.curve(t)
    for field in side.fields:
        vector = field(t)
        if dim == 4:
            vector = vector[:, :3] - point[:, :3] / point[:, 3:] * vector[:, 3:]
        assert np.abs((vector * normals).sum(axis=1)).max() < 1e-12
    span = np.stack([field(t) for field in side.fields], axis=2)
    assert {int(one) for one in np.linalg.matrix_rank(span, 1e-9)} == {dim - 1}


def test_speeds_are_shares_of_the_distance_to_the_crossing():
    points = np.array([[0.0, -2.0, 0.0], [-3.0, 0.0, 0.0]])
    directions = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    assert np.allclose(choose_velocities(points, directions, is_reflex=False), [[0, 1.7, 0], [-2.55, 0, 0]])
    assert np.allclose(choose_velocities(points, directions, is_reflex=True), [[0, 3.2, 0], [-4.8, 0, 0]])


def test_speeds_are_the_chord_where_rails_do_not_cross_ahead():
    points = np.array([[0.0, -2.0, 0.0], [0.1, 2.0, 0.0]])
    directions = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    chord = np.linalg.norm(points[1] - points[0])
    assert np.allclose(choose_velocities(points, directions, is_reflex=False), chord * directions)


def test_a_frame_is_left_as_it_was_entered():
    primary, dim = SURFACES["cylinder"]
    uv = np.array([[0.2, 0.3], [0.7, 0.8]])
    jet = primary.jet(uv)
    side = make_face_side(
        primary, build_face_curve(primary, CurveEnd(uv[0], jet[1, 0]), CurveEnd(uv[1], jet[2, 1])), dim
    )
    frame = CornerFrame(np.array([4.0, 5.0, 6.0]), 0.3)
    coefs = frame.bring_in(side).curve.coefs[:, None, :, :, None]
    assert np.abs(frame.bring_back(coefs)[:, 0, :, :, 0] - side.curve.coefs).max() < 1e-13
