"""Stations between those of an edge: as smooth as the true curve where that is, and left alone where it is not."""

import numpy as np
import pytest

from cqblend.blends.contacts.contact_solver import Stations
from cqblend.blends.potential.smooth_stations import smooth_stations, turns_steadily
from cqblend.surfaces.quadrics import Cylinder, Plane
from cqblend.surfaces.vectors import LocalFrame

PIPES = (
    Cylinder(LocalFrame(np.zeros(3), np.roll(np.eye(3), 1, axis=1)), radius=3.0),  # about x
    Cylinder(LocalFrame(np.zeros(3), np.roll(np.eye(3), 2, axis=1)), radius=5.0),  # about y
)
PLANES = (Plane(LocalFrame(np.zeros(3), np.eye(3))), Plane(LocalFrame(np.zeros(3), np.eye(3))))
INSIDE = np.linspace(0.01, 0.99, 4001)


def cross_pipes(t, noise=0.0):
    """Return stations of the curve in which the pipes meet, off along it by some noise."""
    angle = 2 * np.pi * (t + noise * np.sin(3e5 * t))
    y, z = 3 * np.cos(angle), 3 * np.sin(angle)
    x = np.sqrt(25 - z**2)
    tangent = np.stack([-z * y / x, -z, y], axis=-1)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    uv = np.stack([np.mod(angle, 2 * np.pi), x], axis=-1), np.stack([np.arctan2(x, z), y], axis=-1)
    return Stations(t, np.stack([x, y, z], axis=-1), tangent, uv)


def bend_flat(t, kink):
    """Return stations of a curve in a plane that is an arc up to the middle, and goes on as one of another radius."""
    angle = np.where(t < 0.5, t, t + kink * (t - 0.5) ** 2)
    tangent = np.stack([np.cos(angle), np.sin(angle), 0 * t], axis=-1)
    fine = np.linspace(0, 1, 20001)
    along = np.where(fine < 0.5, fine, fine + kink * (fine - 0.5) ** 2)
    x, y = (np.interp(t, fine, np.cumsum(rate(along)) / 20000) for rate in (np.cos, np.sin))
    uv = np.stack([x, y], axis=-1)
    return Stations(t, np.stack([x, y, 0 * t], axis=-1), tangent, (uv, uv))


def test_noise_along_the_edge_is_gone():
    smooth = smooth_stations(lambda t: cross_pipes(t, 2e-7), PIPES, closed=True)
    located, found, true = cross_pipes(INSIDE, 2e-7), smooth(INSIDE), cross_pipes(INSIDE)
    assert np.abs(found.points - true.points).max() < 1e-5
    assert np.abs(np.linalg.norm(found.tangents, axis=1) - 1).max() < 1e-14
    rough, even = (np.abs(np.diff(some.points, 4, axis=0)).max() for some in (located, found))
    assert even < 1e-3 * rough


def test_parameters_stay_on_both_sides_through_the_seam():
    found = smooth_stations(cross_pipes, PIPES, closed=True)(INSIDE)
    for side, uv in zip(PIPES, found.uv, strict=True):
        assert np.abs(side.jet(uv)[0] - found.points).max() < 1e-6


def test_closed_stations_close():
    smooth = smooth_stations(cross_pipes, PIPES, closed=True)
    step = 1e-4
    t = np.array([1 - 2 * step, 1 - step, 0.0, step, 2 * step])
    assert np.abs(np.diff(smooth(t).points, 4, axis=0)).max() < 1e-10


def test_stations_beyond_an_open_edge_are_those_located():
    t = np.array([-0.03, 0.2, 1.05])
    smooth = smooth_stations(cross_pipes, PIPES, closed=False)
    assert smooth is not cross_pipes
    found, located = smooth(t), cross_pipes(t)
    assert np.array_equal(found.points[[0, 2]], located.points[[0, 2]])
    assert not np.array_equal(found.points[1], located.points[1])


@pytest.mark.parametrize("kink", [5.0, 50.0])
def test_edges_with_kinks_are_left_alone(kink):
    def locate(t):
        return bend_flat(t, kink)

    assert smooth_stations(locate, PLANES, closed=False) is locate


def test_lines_and_circles_turn_steadily():
    t = np.linspace(0.02, 0.98, 25)
    arc = np.stack([np.cos(3 * t), np.sin(3 * t), 0 * t], axis=-1) @ np.linalg.qr(np.arange(9.0).reshape(3, 3) ** 2)[0]
    assert turns_steadily(arc)
    assert turns_steadily(np.tile([[0.6, 0.0, 0.8]], (25, 1)))
    assert not turns_steadily(cross_pipes(t).tangents)
    helix = np.stack([0.8 * np.cos(3 * t), 0.8 * np.sin(3 * t), 0 * t + 0.6], axis=-1)
    assert not turns_steadily(helix)
