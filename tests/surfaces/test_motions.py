"""Motions that map a surface onto itself move its points as they move points in space, and no others are taken."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_surfaces import Pair, pairs, seeded_random

from cqblend.surfaces.motions import Motion
from cqblend.surfaces.quadrics import Cone, Cylinder, Plane, Sphere
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse, RevolvedSpline
from cqblend.surfaces.vectors import LocalFrame

every = pytest.mark.parametrize("pair", pairs().values(), ids=pairs().keys())
AROUND = (Cylinder, Cone, Sphere, RevolvedEllipse, RevolvedSpline)


def is_orthonormal(frame: LocalFrame) -> bool:
    return np.abs(frame.axes @ frame.axes.T - np.eye(3)).max() < 1e-13


def list_motions(pair: Pair) -> list[Motion]:
    """The motions, of those that are known to the package, that map the surface onto itself."""
    primary = pair.primary
    if isinstance(primary, Plane):
        x, y, z = primary.frame.axes
        return [
            Motion(0.6 * x - 0.8 * y),
            Motion(-z, primary.frame.origin + 3 * x - y),
            Motion(z, pair.jet(np.ones((1, 2)))[0, 0]),
        ]
    motions = []
    if isinstance(primary, AROUND) and is_orthonormal(primary.frame):
        x, y, z = primary.frame.axes
        motions += [Motion(z, primary.frame.origin), Motion(-z, primary.frame.origin + 5 * z)]
    if isinstance(primary, Cylinder):
        along = primary.frame.axes[2] / np.linalg.norm(primary.frame.axes[2])
        motions += [Motion(along), Motion(-along)]
    return motions


@every
def test_points_are_carried_as_points_in_space_are_moved(pair):
    draw = seeded_random(pair)
    uv, amounts = pair.uv(draw.uniform(0.4, 0.6, 2)), draw.uniform(-0.3, 0.3, 20)
    for motion in list_motions(pair):
        carried = pair.primary.carry_parameters(uv, motion, amounts)
        assert carried is not None
        point = pair.jet(uv[None])[0, 0]
        assert np.abs(pair.jet(carried)[0] - motion.move_point(point, amounts)).max() < 1e-12


@every
def test_other_motions_are_refused(pair):
    draw = seeded_random(pair)
    uv, still = pair.uv(np.array([0.5, 0.5])), np.zeros(1)
    axis = draw.normal(size=3)
    axis /= np.linalg.norm(axis)
    assert pair.primary.carry_parameters(uv, Motion(axis), still) is None
    assert pair.primary.carry_parameters(uv, Motion(axis, draw.normal(size=3)), still) is None
    for motion in list_motions(pair):
        off = np.cross(motion.direction, draw.normal(size=3)) * 1e-9
        tilted = motion.direction + off
        if isinstance(pair.primary, Plane) and motion.centre is None:
            tilted = motion.direction + 1e-9 * pair.primary.frame.axes[2]
        tilted = Motion(tilted / np.linalg.norm(tilted), motion.centre)
        assert pair.primary.carry_parameters(uv, tilted, still) is None
        if motion.centre is not None and not isinstance(pair.primary, Plane):
            assert pair.primary.carry_parameters(uv, Motion(motion.direction, motion.centre + off), still) is None


def test_vectors_turn_with_the_points():
    rng = np.random.default_rng(4)
    motion = Motion(np.array([2.0, -1, 2]) / 3, rng.normal(size=3))
    a, b, amounts = rng.normal(size=3), rng.normal(size=3), np.linspace(-7, 7, 30)
    moved = motion.move_point(b, amounts) - motion.move_point(a, amounts)
    assert np.abs(motion.move_vector(b - a, amounts) - moved).max() < 1e-14
    assert np.abs(np.linalg.norm(moved, axis=1) - np.linalg.norm(b - a)).max() < 1e-14
    assert np.abs((motion.move_point(a, amounts) - a) @ motion.direction).max() < 1e-14
    quarter = Motion(np.array([0, 0, 1.0]), np.zeros(3)).move_point(np.array([1.0, 0, 5]), np.array([np.pi / 2]))
    assert np.abs(quarter - [0, 1, 5]).max() < 1e-15
