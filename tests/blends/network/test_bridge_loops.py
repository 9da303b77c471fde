"""Closed rails by their lengths, on surfaces whose points are known."""

import numpy as np
import pytest
from bridge_rings import make_loop, make_ring
from scipy.special import ellipe

from cqblend.blends.contacts.contact_solver import SupportSurface
from cqblend.blends.network.bridge_loops import LoopJoin, LoopPiece, RailLoop, RailRun
from cqblend.splines import Curve
from cqblend.surfaces.quadrics import Cylinder
from cqblend.surfaces.vectors import LocalFrame

WORLD = LocalFrame(np.zeros(3), np.eye(3))


def around_cylinder(radius=2.0, height=3.0, turns_left=True):
    """A circle around a cylinder, as one piece of four rational arcs."""
    ring = make_ring(radius, radius, height)
    t = np.linspace(*ring.domain, 65)
    uv = np.stack([np.linspace(0, 2 * np.pi, 65), np.full(65, height)], axis=-1)
    piece = LoopPiece(SupportSurface(Cylinder(WORLD, radius), 1.0), ring, (t, uv))
    return RailLoop((piece,), (LoopJoin("through"),), 1.0 if turns_left else -1.0)


def test_an_ellipse_has_the_length_of_the_elliptic_integral():
    loop = make_loop([make_ring(3.0, 2.0, 0.0)])
    assert loop.length == pytest.approx(4 * 3 * ellipe(1 - 4 / 9), rel=1e-12)
    s = np.linspace(0, loop.length, 200, endpoint=False)
    points, tangents = loop.evaluate(s)
    assert np.abs((points[:, 0] / 3) ** 2 + (points[:, 1] / 2) ** 2 - 1).max() < 1e-13
    steps = np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1)
    assert steps.max() / steps.min() < 1.01  # chords of equal arcs
    assert np.abs((tangents**2).sum(axis=1) - 1).max() < 1e-14


def test_a_run_around_a_cylinder_goes_on_lap_after_lap():
    loop = around_cylinder()
    start = 0.3 * loop.length
    run = RailRun.from_loop(loop, (start, start + loop.length), True)
    s = start + np.array([-0.5, 0.0, 0.25, 0.75, 1.0, 1.5]) * loop.length
    uv, tangents = run.locate(s)
    assert np.abs(np.diff(uv[:, 0]) - 2 * np.pi * np.diff(s) / loop.length).max() < 1e-12
    assert np.abs(uv[:, 1] - 3).max() < 1e-14
    assert np.abs(tangents[:, 2]).max() < 1e-14


def test_the_direction_is_out_of_what_goes():
    assert make_loop([make_ring(2.0, 1.0, 0.0)]).direction == pytest.approx([0, 0, 1])
    assert around_cylinder(turns_left=False).direction == pytest.approx([0, 0, -1])


def test_room_in_an_opening_is_that_of_the_largest_circle():
    circle = make_loop([make_ring(2.5, 2.5, 0.0)])
    s = np.linspace(0, circle.length, 33)
    assert circle.tightness(s)[:, 0] == pytest.approx(np.full(33, 1 / 2.5), rel=1e-3)
    oval = make_loop([make_ring(3.0, 1.0, 0.0)])
    found = oval.tightness(np.array([0.0, oval.length / 4]))[:, 0]
    assert 2.0 < found[0] < 2.4  # three quarters of the curvature at the tip, a / b^2 = 3
    assert 0.95 < found[1] < 1.3  # in the middle the other side is 2 away
    assert np.abs(around_cylinder().tightness(s)).max() < 1e-12  # a wall goes on straight


def test_room_beside_corners_is_that_of_the_largest_circle_of_all():
    """Of the triangle with sides 3, 4, 5 its radius is 1."""
    corners = np.array([[0, 0, 0], [4, 0, 0], [0, 3, 0]], dtype=float)
    sides = [Curve.bezier([one, other]) for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    loop = make_loop(sides, ["sharp"] * 3)
    assert loop.tightness(np.array([0.0, 2.0, 4.0]))[:, 0] == pytest.approx([1, 1, 1], rel=1e-2)


def test_corners_are_breaks_and_bends_are_none():
    corners = np.array([[0, 0, 0], [4, 0, 0], [4, 3, 0], [0, 3, 0]], dtype=float)
    sides = [Curve.bezier([one, other]) for one, other in zip(corners, np.roll(corners, -1, axis=0), strict=True)]
    loop = make_loop(sides, ["sharp", "sharp", "through", "sharp"])
    assert loop.breaks == pytest.approx([0, 4, 11])
    assert loop.find_join(14.0) is loop.joins[0]
    assert loop.find_join(5.0) is None
