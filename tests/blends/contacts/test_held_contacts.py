"""Balls that roll along a curve and touch one surface, against closed forms."""

import numpy as np
import pytest

from cqblend.blends.contacts.contact_solver import SupportSurface
from cqblend.blends.contacts.held_contacts import HeldPoints, solve_held_contacts
from cqblend.errors import SizeError
from cqblend.surfaces.quadrics import Plane, Sphere
from cqblend.surfaces.vectors import LocalFrame

TOP = SupportSurface(Plane(LocalFrame(np.zeros(3), np.eye(3))), 1.0)
"""z = 0, outward up."""


def line_below(depth: float, count: int = 5) -> HeldPoints:
    """Points of a line along y, at x = 0 and a depth below the plane; the face is where x < 0."""
    y = np.linspace(0, 10, count)
    points = np.column_stack([np.zeros(count), y, np.full(count, -depth)])
    near = points * (1, 1, 0)
    along, away = (np.tile(way, (count, 1)) for way in ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)))
    return HeldPoints(points, along, near, near[:, :2].copy(), away)


@pytest.mark.parametrize(("radius", "depth"), [(5, 2), (2.5, 2), (1.01, 2), (300, 2)])
def test_below_a_plane(radius, depth):
    """c = (-w, y, -R) with w^2 + (R - depth)^2 = R^2."""
    found = solve_held_contacts(TOP, line_below(depth), radius, is_convex=True)
    reach = np.sqrt(2 * radius * depth - depth**2)
    assert found.uv[:, 0] == pytest.approx(-reach, rel=1e-12)
    assert found.uv[:, 1] == pytest.approx(np.linspace(0, 10, 5), abs=1e-12)
    arm = np.array([reach, 0, radius - depth]) / radius
    assert found.directions @ arm == pytest.approx(0, abs=1e-12)
    assert found.angles == pytest.approx(np.arccos(arm[2]), rel=1e-9)
    assert (found.directions[:, 2] > 0).all()


def test_above_a_plane():
    """At a concave edge the ball is outside; the line lies above the plane then."""
    held = line_below(-2)
    found = solve_held_contacts(TOP, held, 5, is_convex=False)
    assert found.uv[:, 0] == pytest.approx(-4, rel=1e-12)
    assert (found.directions[:, 2] < 0).all()


def test_a_sphere_and_a_circle_around_its_axis():
    """All balls touch it at one latitude; each touches the circle, and the sphere from inside."""
    sphere = SupportSurface(Sphere(LocalFrame(np.zeros(3), np.eye(3)), radius=10.0, pole=np.array([0, 0, 1.0])), 1.0)
    angle = np.linspace(0, 6, 9)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(9)])
    points, tangents = 7 * ring + (0, 0, 5), np.column_stack([-ring[:, 1], ring[:, 0], np.zeros(9)])
    uv = np.column_stack([angle, np.full(9, np.arctan2(5, 7))])
    near = sphere.primary.jet(uv)[0]
    outward = near / 10
    into = np.cross(tangents, outward)
    held = HeldPoints(points, tangents, near, uv, into * np.sign(into[:, 2:]))
    found = solve_held_contacts(sphere, held, 3, is_convex=True)
    contacts = sphere.primary.jet(found.uv)[0]
    centres = 0.7 * contacts
    assert np.linalg.norm(centres - points, axis=1) == pytest.approx(3, rel=1e-12)
    assert ((centres - points) * tangents).sum(1) == pytest.approx(0, abs=1e-12)
    assert np.ptp(contacts[:, 2]) < 1e-11


def test_a_ball_that_does_not_reach_is_refused_with_the_least_that_does():
    with pytest.raises(SizeError, match=r"must be above about 1\.25"):
        solve_held_contacts(TOP, line_below(2.5), 1.2, is_convex=True)
