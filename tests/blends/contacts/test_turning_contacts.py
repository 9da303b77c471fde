"""Balls inside round faces: where they stand, and that they are told from those that move along."""

from __future__ import annotations

import numpy as np
import pytest

from cqblend.blends.contacts.contact_solver import Stations, SupportSurface
from cqblend.blends.contacts.turning_contacts import RoundFace, find_round_face
from cqblend.surfaces.quadrics import Cylinder, Plane
from cqblend.surfaces.vectors import LocalFrame

RADIUS = 2.0
TILT = 0.3
SHARES = np.linspace(0, 1, 9)


def find_face(radius: float) -> RoundFace | None:
    """Look for a round face in a quarter of a cylinder about the z axis, below an oblique plane through the origin.

    The solid is inside the cylinder, and below the plane.
    """
    cylinder = SupportSurface(Cylinder(LocalFrame(np.zeros(3), np.eye(3)), RADIUS), 1.0)
    x, y = np.array([np.cos(TILT), 0.0, np.sin(TILT)]), np.array([0.0, 1.0, 0.0])
    plane = SupportSurface(Plane(LocalFrame(np.zeros(3), np.stack([x, y, np.cross(x, y)]))), 1.0)

    def locate_on_surfaces(t: np.ndarray) -> Stations:
        angle = t * np.pi / 2
        rise = np.tan(TILT) * RADIUS
        points = np.stack([RADIUS * np.cos(angle), RADIUS * np.sin(angle), rise * np.cos(angle)], axis=1)
        tangents = np.stack([-RADIUS * np.sin(angle), RADIUS * np.cos(angle), -rise * np.sin(angle)], axis=1)
        tangents /= np.linalg.norm(tangents, axis=1)[:, None]
        on_cylinder = np.stack([angle, points[:, 2]], axis=1)
        on_plane = np.stack([points @ x, points @ y], axis=1)
        return Stations(t, points, tangents, (on_plane, on_cylinder))

    return find_round_face((plane, cylinder), locate_on_surfaces, radius, 1e-6)


def locate_contacts(face: RoundFace, contacts) -> tuple[np.ndarray, np.ndarray]:
    first, second = (side.primary.jet(uv)[0] for side, uv in zip(face.sides, contacts.uv, strict=True))
    return first, second


def test_a_ball_of_the_radius_of_the_cylinder_stands_below_the_plane():
    face = find_face(RADIUS)
    assert face is not None
    ball = face.find_standing_ball(RADIUS, 1e-6)
    assert ball is not None
    assert face.turn == pytest.approx(np.pi / 2, abs=1e-14)
    contacts = face.solve_contacts(SHARES, np.full(9, RADIUS), ball)
    centre = np.array([0.0, 0.0, -RADIUS / np.cos(TILT)])  # on the axis, by the radius below the plane
    foot = centre + RADIUS * np.array([-np.sin(TILT), 0.0, np.cos(TILT)])
    on_plane, on_cylinder = locate_contacts(face, contacts)
    assert np.abs(on_plane - foot).max() < 1e-13
    assert np.abs(np.linalg.norm(on_cylinder - centre, axis=1) - RADIUS).max() < 1e-13
    assert np.abs(np.arctan2(on_cylinder[:, 1], on_cylinder[:, 0]) - SHARES * np.pi / 2).max() < 1e-13
    # each has the point of the edge that is as far around
    assert np.abs(np.arctan2(*contacts.edge_points[:, 1::-1].T) - SHARES * np.pi / 2).max() < 1e-4


def test_smaller_balls_of_any_radii_are_tangent_to_both_faces():
    face = find_face(0.97 * RADIUS)
    assert face is not None
    assert face.find_standing_ball(0.97 * RADIUS, 1e-6) is None
    radii = RADIUS * (0.7 + 0.27 * SHARES)
    on_plane, on_cylinder = locate_contacts(face, face.solve_contacts(SHARES, radii))
    down = np.array([np.sin(TILT), 0.0, -np.cos(TILT)])
    centres = on_plane + radii[:, None] * down
    outward = on_cylinder * [1, 1, 0] / RADIUS
    assert np.abs(on_plane @ down).max() < 1e-13
    assert np.abs(on_cylinder - radii[:, None] * outward - centres).max() < 1e-12
    assert np.abs(np.arctan2(on_cylinder[:, 1], on_cylinder[:, 0]) - SHARES * np.pi / 2).max() < 1e-13


@pytest.mark.parametrize("radius", [0.4 * RADIUS, 1.2 * RADIUS])
def test_a_ball_with_much_room_or_none_rolls_as_anywhere(radius):
    assert find_face(radius) is None


def test_a_radius_that_differs_by_rounding_makes_no_difference():
    face = find_face(RADIUS * (1 - 1e-9))
    assert face is not None
    ball = face.find_standing_ball(RADIUS * (1 - 1e-9), 1e-6)
    assert ball is not None
    assert 0 < ball.deviation < 1e-8
