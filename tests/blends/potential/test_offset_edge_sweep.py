"""Sweeps from edges of solids: against implicit equations; and what they remember changes nothing but the work."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from cqblend.blends.contacts.contact_solver import Stations, SupportSurface
from cqblend.blends.potential.offset_edge_sweep import sweep_from_edge
from cqblend.blends.potential.relations import Conic
from cqblend.errors import SizeError
from cqblend.surfaces.quadrics import Cylinder, Sphere
from cqblend.surfaces.vectors import LocalFrame

BALL_RADIUS, ARM_RADIUS, A, B, LAM = 10.0, 4.5, 1.0, 2.0, -8.0
X = (1 - np.cos(np.pi * (np.arange(9) + 0.5) / 9)) / 2


@dataclass(frozen=True)
class CountedSphere(Sphere):
    """A sphere that counts the points at which it is evaluated."""

    counts: list = field(default_factory=list)

    def jet(self, uv):
        self.counts.append(len(uv))
        return super().jet(uv)


def stations_at(t):
    """The edge of an arm that leaves a ball off its middle: once around the arm's axis, the ball to its left."""
    angle = -2 * np.pi * t
    y, z = ARM_RADIUS * np.cos(angle) + 1, ARM_RADIUS * np.sin(angle)
    point = np.stack([np.sqrt(BALL_RADIUS**2 - y**2 - z**2), y, z], axis=-1)
    tangent = np.cross(np.stack([0 * y, y - 1, z], axis=-1), point)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    on_ball = np.stack([np.arctan2(point[:, 1], point[:, 0]), np.arcsin(point[:, 2] / BALL_RADIUS)], axis=-1)
    return Stations(t, point, tangent, (on_ball, np.stack([angle, point[:, 0]], axis=-1)))


def make_sweep(counts=None, a=A, b=B):
    counts = [] if counts is None else counts
    ball = CountedSphere(LocalFrame(np.zeros(3), np.eye(3)), radius=BALL_RADIUS, counts=counts)
    arm = Cylinder(LocalFrame(np.array([0.0, 1, 0]), np.roll(np.eye(3), 1, axis=1)), radius=ARM_RADIUS)
    sides = SupportSurface(ball, 1.0), SupportSurface(arm, 1.0)
    return sweep_from_edge(sides, stations_at, 2 * np.pi * ARM_RADIUS, Conic(a, b, LAM * a * b / (A * B)), closed=True)


def miss_conic(points):
    """How far points are from the implicit potential surface of both sides, moved away from the ball and the arm."""
    s1 = np.linalg.norm(points, axis=-1) - BALL_RADIUS
    s2 = np.hypot(points[..., 1] - 1, points[..., 2]) - ARM_RADIUS
    value = B**2 * s1**2 + A**2 * s2**2 + A**2 * B**2 - 2 * A * B**2 * s1 - 2 * A**2 * B * s2 + 2 * LAM * s1 * s2
    return np.abs(value).max()


def test_points_solve_the_implicit_equation():
    points = make_sweep().evaluate_points(np.arange(40) / 40, X)
    assert miss_conic(points) < 1e-11


def test_contacts_lie_on_both_sides_with_tangents_in_them():
    sweep = make_sweep()
    t = np.arange(24) / 24
    contacts = sweep.solve_contacts(t)
    points = sweep.evaluate_points(t, np.array([1.0, 0.0]))
    on_ball, on_arm = points[:, 0], points[:, 1]
    assert np.abs(np.linalg.norm(on_ball, axis=1) - BALL_RADIUS).max() < 1e-11
    assert np.abs(np.hypot(on_arm[:, 1] - 1, on_arm[:, 2]) - ARM_RADIUS).max() < 1e-11
    assert np.abs((contacts.cross_vectors[0] * on_ball).sum(axis=1)).max() < 1e-10
    step = 1e-5
    inner = sweep.evaluate_points(t, np.array([1 - step, step]))
    for side, start, direction in ((0, on_ball, inner[:, 0]), (1, on_arm, inner[:, 1])):
        difference = (direction - start) / step
        assert np.abs(difference - contacts.cross_vectors[side]).max() < 1e-2 * np.abs(difference).max()


def test_the_order_of_questions_does_not_matter():
    t = np.random.default_rng(5).random(60)
    whole = make_sweep().evaluate_points(np.sort(t), X)
    asked = make_sweep()
    for part in np.array_split(t, 7):
        asked.evaluate_points(part, X)
    assert np.abs(asked.evaluate_points(np.sort(t), X) - whole).max() < 1e-12
    alone = np.concatenate([make_sweep().evaluate_points(one, X) for one in np.sort(t)[:5, None]])
    assert np.abs(alone - whole[:5]).max() < 1e-12


def test_what_is_known_saves_work():
    counts = []
    sweep = make_sweep(counts)
    sweep.evaluate_points(np.arange(32) / 32, X)
    between = (np.arange(32) + 0.5) / 32
    counts.clear()
    sweep.evaluate_points(between, X)
    from_known = sum(counts)
    fresh = make_sweep(counts)
    counts.clear()
    fresh.evaluate_points(between, X)
    assert from_known < 0.7 * sum(counts)


def test_a_sweep_over_another_domain_shares_what_is_known():
    counts = []
    sweep = make_sweep(counts)
    sweep.evaluate_points(np.arange(32) / 32, X)
    shifted = replace(sweep, domain=(0.25, 1.25), edge_parameter_at=lambda t: t + 0.1)
    counts.clear()
    points = shifted.evaluate_points((np.arange(32) + 0.5) / 32, X)
    known = sum(counts)
    fresh = make_sweep(counts)
    counts.clear()
    expected = fresh.evaluate_points((np.arange(32) + 0.5) / 32 + 0.1, X)
    assert np.abs(points - expected).max() < 1e-12
    assert known < 0.7 * sum(counts)


@pytest.mark.parametrize(("a", "b"), [(40.0, 1.0), (1.0, 40.0)])
def test_sizes_that_do_not_fit_are_told_with_the_place(a, b):
    sweep = make_sweep(a=a, b=b)
    with pytest.raises(SizeError, match=r"s = \(.*\), at \("):
        sweep.solve_contacts(np.arange(24) / 24)


def test_stations_that_nearly_coincide_do_no_harm():
    t = np.concatenate([np.arange(32) / 32, 0.5 + 1e-13 * np.arange(1, 6)])
    sweep = make_sweep()
    sweep.evaluate_points(t, X)
    between = np.linspace(0.45, 0.55, 11)
    assert np.abs(sweep.evaluate_points(between, X) - make_sweep().evaluate_points(between, X)).max() < 1e-12
