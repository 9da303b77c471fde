"""The normal curvature in the ruled direction as a spline, and its maxima."""

import numpy as np
import pytest
from spline_witness import dot, norm, normal, surface_jet

from benchmarks.strips import revolved, sphere, torus
from cqblend.errors import GeometryError
from cqblend.patterns.strips.normal_curvature import find_curvature_maxima, squared_curvature
from cqblend.splines import Surface

KNOTS = np.array([0, 0, 0, 0, 0.4, 1, 1, 1, 1])


def bumpy(seed, rational):
    rng = np.random.default_rng(seed)
    base = np.stack([*np.meshgrid(np.arange(5.0), np.arange(5.0), indexing="ij"), rng.normal(size=(5, 5))], -1)
    weights = rng.uniform(0.5, 2, (5, 5)) if rational else None
    return Surface.from_bspline((3, 3), (KNOTS, KNOTS), base + 0.2 * rng.normal(size=base.shape), weights)


def witness(surface, uv, side="right"):
    """kappa_n^v by equation (6), from a B-spline evaluated by de Boor."""
    jet = surface_jet(surface.to_bspline(), uv, 2, float, side)
    n = normal(jet)
    return dot(n, jet[0, 2]) / norm(n) / dot(jet[0, 1], jet[0, 1])


@pytest.mark.parametrize("rational", [False, True])
def test_it_is_equation_6(rational):
    surface = bumpy(1, rational)
    uv = np.random.default_rng(2).uniform(size=(100, 2))
    expected = witness(surface, uv).astype(float) ** 2
    assert squared_curvature(surface)(*uv.T)[:, 0] == pytest.approx(expected, rel=1e-11, abs=1e-14)


def test_degrees():
    assert squared_curvature(bumpy(1, False)).degree == (22, 18)
    assert squared_curvature(bumpy(1, True)).degree == (40, 36)


def test_torus_and_sphere_are_constant():
    u, v = np.random.default_rng(3).uniform(size=(2, 50))
    assert squared_curvature(torus(30, 10))(4 * u, 4 * v)[:, 0] == pytest.approx(0.01, rel=1e-11)
    assert squared_curvature(sphere(5))(4 * u, 0.1 + 1.8 * v)[:, 0] == pytest.approx(0.04, rel=1e-9)
    assert len(find_curvature_maxima(torus())) == 0
    assert len(find_curvature_maxima(sphere())) == 0


def test_limits_from_both_sides_of_a_knot_line():
    poles = np.array([[(x, 0, 0), (x, 1, 0), (x, 2, 1), (x, 3, 5)] for x in (0.0, 1.0)])
    surface = Surface.from_bspline((1, 2), ([0, 0, 1, 1], [0, 0, 0, 1, 2, 2, 2]), poles)
    curvature = squared_curvature(surface)
    for side, v in (("left", 1 - 1e-9), ("right", 1 + 1e-9)):
        near = witness(surface, [[0.5, v]])[0] ** 2
        assert curvature(0.5, 1.0, side=side).item() == pytest.approx(float(near), rel=1e-6)


def dense(surface, count=151):
    """Maxima of kappa^2 among eight neighbours, in the interior of a dense grid: (u, v) of each."""
    (u0, u1), (v0, v1) = surface.domain
    u, v = np.linspace(u0, u1, count), np.linspace(v0, v1, count)
    grid = np.stack(np.meshgrid(u, v, indexing="ij"), -1)
    square = witness(surface, grid.reshape(-1, 2)).astype(float).reshape(count, count) ** 2
    here = square[1:-1, 1:-1]
    peak = np.ones_like(here, bool)
    for i in range(3):
        for j in range(3):
            if (i, j) != (1, 1):
                peak &= here > square[i : i + count - 2, j : j + count - 2]
    return grid[1:-1, 1:-1][peak]


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("rational", [False, True])
def test_all_interior_maxima_are_found_and_nothing_else(seed, rational):
    surface = bumpy(seed, rational)
    found, curvature = find_curvature_maxima(surface), squared_curvature(surface)
    step = np.linspace(-0.02, 0.02, 41)
    for u, v in dense(surface):
        around = curvature(np.clip(u + step[:, None], 0, 1), np.clip(v + step, 0, 1))[..., 0]
        i, j = np.unravel_index(around.argmax(), around.shape)
        if 0 < i < 40 and 0 < j < 40:  # else it is a place on a slanting ridge
            assert np.abs(found - (v + step[j])).min() <= 2e-3
    u = np.linspace(1e-3, 1 - 1e-3, 501)
    for v in found:
        rise = curvature(u, v)[..., 0] - np.maximum(curvature(u, v - 5e-3)[..., 0], curvature(u, v + 5e-3)[..., 0])
        assert rise.max() > 0


def test_a_ridge_of_a_surface_of_revolution_is_one_place():
    radii = [5, 5, 5, 8, 5, 5, 5]
    knots = np.array([0, 0, 0, 0, 1, 2, 3, 4, 4, 4, 4], float)
    surface = revolved(3, knots, np.column_stack([radii, np.arange(7.0)]))
    v = np.linspace(0, 4, 4001)
    square = witness(surface, np.column_stack([np.full(4001, 0.3), v])).astype(float) ** 2
    peaks = v[1:-1][(square[1:-1] > square[:-2]) & (square[1:-1] > square[2:])]
    assert find_curvature_maxima(surface) == pytest.approx(peaks, abs=1e-3)


def test_a_plane_has_none_and_a_line_no_curvature():
    ends = np.array([0.0, 0, 1, 1])
    sheet = Surface.from_bspline((1, 1), (ends, ends), [[(0, 0, 0), (0, 1, 0)], [(1, 0, 0), (1, 1, 0)]])
    assert len(find_curvature_maxima(sheet)) == 0
    line = Surface.from_bspline((1, 1), (ends, ends), [[(0, 0, 0), (1, 0, 0)], [(0, 0, 0), (1, 0, 0)]])
    with pytest.raises(GeometryError, match="degenerate"):
        squared_curvature(line)
