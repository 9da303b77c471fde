"""Faces that pass through themselves, or through bodies, and others that only come near."""

import cadquery as cq
import numpy as np
import pytest

import cqblend
from cqblend.brep.verification.bridge_checks import find_point_inside, find_self_crossing, find_touching_point

ANGLES = np.linspace(0, 2 * np.pi, 33)


def tube(rings):
    """A closed face through rings of points (m, 33, 3), the way around first."""
    knots = np.concatenate([[0.0] * 2, np.linspace(0, 1, 33)[1:-1], [1.0] * 2])
    across = np.concatenate([[0.0] * 2, np.linspace(0, 1, len(rings))[1:-1], [1.0] * 2])
    return cqblend.to_face(cqblend.Surface.from_bspline((1, 1), (knots, across), np.swapaxes(rings, 0, 1)))


def ring(radius, z):
    return np.stack([radius * np.cos(ANGLES), radius * np.sin(ANGLES), np.full(33, z)], axis=-1)


def test_a_straight_tube_is_sound_and_a_figure_of_eight_is_not():
    assert find_self_crossing([tube([ring(2.0, 0.0), ring(2.0, 5.0)])]) is None
    eight = [np.stack([2 * np.sin(ANGLES), np.sin(2 * ANGLES), np.full(33, z)], axis=-1) for z in (0.0, 5.0)]
    found = find_self_crossing([tube(eight)])
    assert found is not None
    assert found[:2] == pytest.approx([0, 0], abs=0.2)


def test_a_tube_that_comes_back_through_its_own_wall():
    """A bend of 300 degrees about an axis nearer than the tube's end is wide is sound; then its end runs on inwards."""
    bends = np.linspace(0, 2 * np.pi + 0.3, 24)
    path = 6 + 0.0 * bends

    def bend(angle, radius):
        flat = ring(1.0, 0.0)
        return np.stack(
            [(radius + flat[:, 0]) * np.cos(angle), flat[:, 1], (radius + flat[:, 0]) * np.sin(angle)], axis=-1
        )

    sound = [bend(angle, radius) for angle, radius in zip(0.8 * bends, path, strict=True)]
    assert find_self_crossing([tube(sound)]) is None
    spiral = [bend(angle, radius) for angle, radius in zip(bends, path + 0.15 * bends, strict=True)]
    assert find_self_crossing([tube(spiral)]) is not None


def test_what_runs_through_a_body_or_touches_one_is_found():
    pipe = tube([ring(1.0, 0.0), ring(1.0, 10.0)])
    through, beside = cq.Workplane().box(4, 4, 2).translate((0, 0, 5)), cq.Workplane().box(4, 4, 2).translate((9, 0, 5))
    point = find_point_inside([pipe], [through.val().wrapped])
    assert point is not None
    assert 4 <= point[2] <= 6
    assert find_point_inside([pipe], [beside.val().wrapped]) is None
    thin = cq.Workplane().box(4, 4, 0.001).translate((0, 0, 5.2))
    assert find_touching_point([pipe], [beside.val().wrapped]) is None
    assert find_touching_point([pipe], [thin.val().wrapped])[2] == pytest.approx(5.2, abs=1e-3)
