"""Splines with corners against one spline for each stretch between them."""

import numpy as np
import pytest

from cqblend.blends.rails.cornered_spline import KinkData, add_third_points, interpolate_with_corners
from cqblend.splines.interpolation import interpolate

RNG = np.random.default_rng(14)


def bend(t):
    """A curve whose curvature jumps at 0.4."""
    return np.stack([np.sin(3 * t), np.cos(2 * t) + np.maximum(t - 0.4, 0) ** 2, t**3], axis=-1)


def make_nodes(n):
    nodes = np.cumsum(RNG.uniform(0.5, 1.5, n))
    nodes = (nodes - nodes[0]) / (nodes[-1] - nodes[0])
    nodes[np.abs(nodes - 0.4).argmin()] = 0.4
    return nodes


@pytest.mark.parametrize("n", [5, 12, 33])
def test_each_stretch_is_the_spline_with_its_end_slopes(n):
    nodes = make_nodes(n)
    values = bend(add_third_points(nodes))
    corners = np.array([0, int(np.flatnonzero(nodes == 0.4)[0]), n - 1])
    curve = interpolate_with_corners(nodes, values, corners, closed=False)
    for i, j in zip(corners[:-1].tolist(), corners[1:].tolist(), strict=True):
        ends = nodes[[i, j]]
        slopes = np.stack([curve(ends[0], 1, side="right"), curve(ends[1], 1, side="left")])
        expected = interpolate(nodes[i : j + 1], values[3 * i : 3 * j + 1 : 3], derivatives=slopes)
        t = np.linspace(*ends, 50)[1:-1]
        assert np.abs(curve(t) - expected(t)).max() < 1e-13
    assert np.abs(curve(nodes) - bend(nodes)).max() < 1e-14
    assert sorted(set(curve.continuity.tolist())) == [1, 2]


def test_neighbouring_corners_leave_single_spans():
    nodes = make_nodes(7)
    curve = interpolate_with_corners(nodes, bend(add_third_points(nodes)), np.arange(7), closed=False)
    assert curve.continuity.tolist() == [1] * 5
    for t in nodes[1:-1]:
        assert np.abs(curve(t, 1, side="left") - curve(t, 1, side="right")).max() < 1e-13


def test_sharp_corners_have_two_slopes_and_kinks_two_values():
    nodes = make_nodes(13)
    t = add_third_points(nodes)
    corner = int(np.flatnonzero(nodes == 0.4)[0])
    rate, jump = np.array([1.0, -2.0, 0.5]), np.array([0.1, 0.0, 0.2])
    bent = bend(t) + np.maximum(t - 0.4, 0)[:, None] * rate
    corners = np.array([0, corner, 12])
    sharp = interpolate_with_corners(nodes, bent, corners, closed=False, sharp=[corner])
    assert sharp.continuity[corner - 1] == 0
    assert np.abs(sharp(0.4, 1, side="right") - sharp(0.4, 1, side="left") - rate).max() < 0.02
    torn = bend(t) + (t >= 0.4)[:, None] * jump
    kink = KinkData(np.array([corner]), np.array([corner]), bend(np.array([0.4])), np.zeros((2, 1, 3)))
    curve = interpolate_with_corners(nodes, torn, corners, closed=False, kinks=kink)
    assert curve.continuity[corner - 1] == -1
    assert np.abs(curve(0.4, side="left") - bend(np.array(0.4))).max() < 1e-14
    assert np.abs(curve(0.4, side="right") - bend(np.array(0.4)) - jump).max() < 1e-14


def test_cubics_are_reproduced():
    nodes = make_nodes(9)
    coefs = RNG.normal(size=(4, 2))

    def cubic(t):
        return (t[:, None] ** np.arange(4)) @ coefs

    curve = interpolate_with_corners(nodes, cubic(add_third_points(nodes)), np.array([0, 3, 8]), closed=False)
    t = np.linspace(0, 1, 77)
    assert np.abs(curve(t) - cubic(t)).max() < 1e-13
