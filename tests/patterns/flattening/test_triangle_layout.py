"""Strips of triangles laid out by hand, their limit, their distance from the surface, and rolled by their angles."""

import numpy as np
import pytest
from developable_strips import DEVELOPABLE, TWISTED, grid, ruled

from cqblend.patterns.flattening.flat_strip import flatten_rails


def both_triangulations(rails, n):
    """Lay out by both diagonals, average the turning angles of both, and keep the chords."""
    t = np.linspace(*rails[0].domain, n + 1)
    a, b = rails[0](t), rails[1](t)

    def angle(at, x, y):
        x, y = x - at, y - at
        return np.arctan2(np.linalg.norm(np.cross(x, y), axis=-1), (x * y).sum(axis=-1))

    out = []
    for diagonal in (0, 1):
        if diagonal == 0:  # a[i] - b[i+1]
            at_a = angle(a[:-1], b[:-1], b[1:]) + angle(a[:-1], b[1:], a[1:])
            at_b, next_a = angle(b[:-1], a[:-1], b[1:]), angle(a[1:], a[:-1], b[1:])
        else:
            at_a = angle(a[:-1], b[:-1], a[1:])
            at_b = angle(b[:-1], a[:-1], a[1:]) + angle(b[:-1], a[1:], b[1:])
            next_a = angle(a[1:], a[:-1], b[:-1]) + angle(a[1:], b[:-1], b[1:])
        out.append((at_a, at_b, next_a))
    results = []
    for at_a, at_b, next_a in (out[0], np.mean(out, axis=0)):
        # the ruling turns by what the angles at a[i], and at a[i+1], leave of pi
        ruling = np.pi / 2 + np.concatenate([[0], np.cumsum(np.pi - at_a - next_a)])
        steps = np.linalg.norm(np.diff(a, axis=0), axis=1) * np.exp(1j * (ruling[:-1] - at_a))
        first = np.concatenate([[0], np.cumsum(steps)])
        start = 1j * np.linalg.norm(b[0] - a[0])
        steps = np.linalg.norm(np.diff(b, axis=0), axis=1) * np.exp(1j * (ruling[:-1] - np.pi + at_b))
        results.append((first, np.concatenate([[start], start + np.cumsum(steps)])))
    return t, results


@pytest.mark.parametrize("name", TWISTED)
def test_triangles_along_both_diagonals_converge_to_the_flat_strip(name):
    rails = TWISTED[name]
    flat = flatten_rails(rails, 1e-3)
    errors = []
    for n in (64, 128, 256):
        t, results = both_triangulations(rails, n)
        expected = [flat(t, side) - flat(t[0], 0.0) for side in (0.0, 1.0)]
        errors.append(
            [max(np.abs(p - q @ [1, 1j]).max() for p, q in zip(result, expected, strict=True)) for result in results]
        )
    single, mean = np.array(errors).T
    assert (single[:-1] / single[1:] > 1.8).all()  # of first order
    assert (mean[:-1] / mean[1:] > 3.6).all()  # of second order
    assert mean[-1] < 1e-4


def to_triangles(points, corners):
    """Distances of points (m, 3) from triangles (k, 3, 3): to a grid of points on them."""
    x, y = (f.ravel() for f in np.meshgrid(*[np.linspace(0, 1, 25)] * 2))
    inside = x + y <= 1 + 1e-12
    x, y = x[inside, None], y[inside, None]
    cloud = (
        corners[:, None, 0]
        + x * (corners[:, 1] - corners[:, 0])[:, None]
        + y * (corners[:, 2] - corners[:, 0])[:, None]
    )
    cloud = cloud.reshape(-1, 3)
    return np.array([np.linalg.norm(cloud - p, axis=1).min() for p in points])


@pytest.mark.parametrize("name", ["saddle", "cubics", "rational"])
def test_the_error_of_triangles_is_a_bound(name):
    rails = TWISTED[name]
    flat = flatten_rails(rails, 0.02, layout="triangles")
    a, b = rails[0](flat.nodes), rails[1](flat.nodes)
    corners = np.concatenate([np.stack([a[:-1], a[1:], b[1:]], axis=1), np.stack([a[:-1], b[1:], b[:-1]], axis=1)])
    t, w = grid(rails, 41, 9)
    off = to_triangles(ruled(rails, t, w), corners)
    spacing = np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=2).max() / 24
    assert np.sqrt(np.maximum(off.max() ** 2 - spacing**2, 0)) <= flat.error <= 0.02
    assert off.max() > flat.error / 30 or flat.error < spacing


def test_elber():
    rails = TWISTED["cubics"]
    flat = flatten_rails(rails, 5e-3, layout="triangles")
    n = len(flat.nodes)
    assert np.ptp(np.diff(flat.nodes)) < 1e-15
    a, b = rails[0](flat.nodes), rails[1](flat.nodes)
    for found, points in ((flat.first_rail, a), (flat.second_rail, b)):
        np.testing.assert_allclose(
            np.linalg.norm(np.diff(found, axis=0), axis=1), np.linalg.norm(np.diff(points, axis=0), axis=1), rtol=1e-12
        )
    np.testing.assert_allclose(flat.lengths[0], np.linalg.norm(np.diff(a, axis=0), axis=1), rtol=1e-14)
    np.testing.assert_allclose(
        np.linalg.norm(flat.second_rail[1:] - flat.first_rail[:-1], axis=1),
        np.linalg.norm(b[1:] - a[:-1], axis=1),
        rtol=1e-12,
    )
    assert flat.ruling_error < 1e-14
    triangles = (
        np.linalg.norm(np.cross(a[1:] - a[:-1], b[1:] - a[:-1]), axis=1).sum()
        + np.linalg.norm(np.cross(b[1:] - a[:-1], b[:-1] - a[:-1]), axis=1).sum()
    ) / 2
    assert abs(flat.area_flat / triangles - 1) < 1e-12
    np.testing.assert_allclose(flat(flat.nodes, 0.0), flat.first_rail, atol=1e-13)
    np.testing.assert_allclose(flat(flat.nodes, 1.0), flat.second_rail, atol=1e-13)
    mirrored = flatten_rails(rails, 5e-3, layout="triangles", flip=True)
    np.testing.assert_allclose(mirrored.first_rail, flat.first_rail * [-1, 1], atol=1e-15)
    assert mirrored.area_flat == pytest.approx(flat.area_flat)
    assert n == 2 ** int(np.log2(n - 1)) + 1


@pytest.mark.parametrize("name", ["saddle", "cubics", "cone", "tangent"])
def test_triangles_rolled_by_their_dihedral_angles(name):
    rails = (DEVELOPABLE | TWISTED)[name]
    flat = flatten_rails(rails, 3e-2, layout="triangles")
    strip, plane = np.empty((2 * len(flat.nodes), 3)), np.zeros((2 * len(flat.nodes), 3))
    # b0, a0, b1, a1, ..: every three of them are a triangle
    strip[::2], strip[1::2] = rails[1](flat.nodes), rails[0](flat.nodes)
    plane[::2, :2], plane[1::2, :2] = flat.second_rail, flat.first_rail

    def normal(p, k):
        n = np.cross(p[k + 1] - p[k], p[k + 2] - p[k]) * (-1) ** k
        return n / np.linalg.norm(n)

    def frame(p):
        x = (p[1] - p[0]) / np.linalg.norm(p[1] - p[0])
        n = normal(p, 0)
        return np.stack([x, np.cross(n, x), n])

    turn, origin = frame(plane).T @ frame(strip), strip[0]
    rolled = [origin + (p - plane[0]) @ turn for p in plane[:3]]
    for k in range(1, len(plane) - 2):
        axis = strip[k + 2 - 1] - strip[k]
        axis /= np.linalg.norm(axis)
        before, after = normal(strip, k - 1), normal(strip, k)
        angle = np.arctan2(np.cross(before, after) @ axis, before @ after)
        # rotate what follows about the edge k, k + 1, where it lies now
        here = (plane[k + 1] - plane[k]) @ turn
        here /= np.linalg.norm(here)
        cross = np.array([[0, -here[2], here[1]], [here[2], 0, -here[0]], [-here[1], here[0], 0]])
        turn = turn @ (np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross).T
        rolled.append(rolled[k] + (plane[k + 2] - plane[k]) @ turn)
    assert np.abs(np.array(rolled) - strip).max() < 1e-9
