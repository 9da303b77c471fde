"""Balls that turn in place: where they stand, and that they are told from those that roll along."""

from __future__ import annotations

import numpy as np
import pytest

from cqblend.blends.contacts.contact_solver import Stations, SupportSurface
from cqblend.blends.contacts.turning_contacts import TurningBall, find_turning_ball
from cqblend.surfaces.quadrics import Cylinder, Plane
from cqblend.surfaces.vectors import LocalFrame

RADIUS = 2.0
TILT = 0.3


def find_ball(radius: float, tolerance: float = 1e-6) -> TurningBall | None:
    """Look for a ball in a quarter of a cylinder about the z axis, below an oblique plane through the origin.

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

    return find_turning_ball((plane, cylinder), locate_on_surfaces, radius, tolerance)


def test_a_ball_of_the_radius_of_the_cylinder_stands_below_the_plane():
    ball = find_ball(RADIUS)
    assert ball is not None
    assert ball.turn == pytest.approx(np.pi / 2, abs=1e-14)
    t = np.linspace(0, 1, 9)
    contacts = ball.solve_contacts(t)
    centre = np.array([0.0, 0.0, -RADIUS / np.cos(TILT)])  # on the axis, by the radius below the plane
    foot = centre + RADIUS * np.array([-np.sin(TILT), 0.0, np.cos(TILT)])
    on_plane, on_cylinder = (side.primary.jet(uv)[0] for side, uv in zip(ball.sides, contacts.uv, strict=True))
    assert np.abs(on_plane - foot).max() < 1e-13
    assert np.abs(np.linalg.norm(on_cylinder - centre, axis=1) - RADIUS).max() < 1e-13
    assert np.abs(np.arctan2(on_cylinder[:, 1], on_cylinder[:, 0]) - t * np.pi / 2).max() < 1e-13
    # each has the point of the edge that is as far around
    assert np.abs(np.arctan2(contacts.edge_points[:, 1], contacts.edge_points[:, 0]) - t * np.pi / 2).max() < 1e-4


@pytest.mark.parametrize("radius", [0.5 * RADIUS, 0.99 * RADIUS])
def test_a_smaller_ball_rolls_along(radius):
    assert find_ball(radius) is None


def test_a_radius_that_differs_by_rounding_makes_no_difference():
    ball = find_ball(RADIUS * (1 - 1e-9))
    assert ball is not None
    assert 0 < ball.deviation < 1e-8
