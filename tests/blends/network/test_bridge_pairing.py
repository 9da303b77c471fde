"""Starts without twist and matched corners, against what symmetry and rotations give."""

import numpy as np
import pytest
from bridge_rings import make_loop, make_polygon, make_ring

from cqblend.blends.network.bridge_pairing import carry_frame, find_untwisted_start, pair_loops


@pytest.mark.parametrize("share", [0.0, 0.1, 0.37, 0.6])
def test_an_oval_that_starts_elsewhere_is_turned_back(share):
    """The second loop runs the same way round, as seen from the first, and starts at a share of its length."""
    first = make_loop([make_ring(3.0, 2.0, 0.0)])
    s = share * first.length
    (at,) = make_loop([make_ring(3.0, 2.0, 9.0)]).pieces[0].find_parameters(np.array([s]))
    ring = make_ring(3.0, 2.0, 9.0)
    low, high = ring.domain
    parts = [ring.clip(at, high), ring.clip(low, at)] if at > low else [ring]
    second = make_loop(parts, ["through"] * len(parts), outward=-1.0)
    found = find_untwisted_start(first, second)
    apart = (found - (1 - share) + 0.25) % 0.5 - 0.25  # an oval is the same after half a turn
    assert abs(apart) < 1e-3


def test_a_frame_carried_over_a_hairpin_is_half_a_turn_about_its_normal():
    """From z, along x, back down: x becomes -x, z becomes -z, y stays."""
    turn = carry_frame(np.zeros(3), np.array([0.0, 0, 1]), np.array([7.0, 0, 0]), np.array([0.0, 0, -1]))
    assert turn == pytest.approx(np.diag([-1.0, 1.0, -1.0]), abs=1e-12)
    straight = carry_frame(np.zeros(3), np.array([0.0, 0, 1]), np.array([2.0, 1, 7]), np.array([0.0, 0, 1]))
    assert straight == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1)


@pytest.mark.parametrize("start", [None, 0.0])
def test_as_many_corners_are_joined_in_order(start):
    first = make_polygon([(-3, -2), (3, -2), (3, 2), (-3, 2)], 0.0)
    second = make_polygon([(-2, -2), (2, -2), (2, 2), (-2, 2)], 9.0, outward=-1.0)
    pairing = pair_loops((first, second), start)
    assert pairing.breaks == pytest.approx([0, 0.3, 0.5, 0.8])
    for t in pairing.breaks:
        corners = [
            loop.evaluate(pairing.find_positions(k, np.array([t])))[0, 0] for k, loop in enumerate(pairing.loops)
        ]
        assert np.sign(corners[0][:2]) == pytest.approx(np.sign(corners[1][:2]))


def test_fewer_corners_find_the_nearest_ones():
    square = make_polygon([(-3, -3), (3, -3), (3, 3), (-3, 3)], 0.0)
    angle = np.arange(8) * np.pi / 4 + np.pi / 8
    octagon = make_polygon(np.stack([3 * np.cos(angle), 3 * np.sin(angle)], axis=-1), 9.0, outward=-1.0)
    assert len(pair_loops((square, octagon), None).breaks) == 8
    assert len(pair_loops((octagon, square), None).breaks) == 8
    ring = make_loop([make_ring(3.0, 3.0, 9.0)], outward=-1.0)
    pairing = pair_loops((square, ring), None)
    assert pairing.breaks == pytest.approx([0, 0.25, 0.5, 0.75])
    (corner,), (point,) = (
        loop.evaluate(pairing.find_positions(k, np.array([0.25])))[0] for k, loop in enumerate(pairing.loops)
    )
    assert np.arctan2(point[1], point[0]) == pytest.approx(np.arctan2(corner[1], corner[0]), abs=1e-3)


def test_a_start_that_is_given_is_where_it_lands():
    square = make_polygon([(-3, -3), (3, -3), (3, 3), (-3, 3)], 0.0)
    other = make_polygon([(-3, -3), (3, -3), (3, 3), (-3, 3)], 9.0, outward=-1.0)
    for start in (0.1, 0.25, 0.77):
        pairing = pair_loops((square, other), start)
        assert pairing.find_positions(1, np.array([0.0])) == pytest.approx([start * other.length])
        assert pairing.find_positions(1, np.array([1.0])) == pytest.approx([(start + 1) * other.length])
    assert len(pair_loops((square, other), 0.1).breaks) == 8
    assert len(pair_loops((square, other), 0.25).breaks) == 4
