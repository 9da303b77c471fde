"""Least squares span by span against dense ones, and the functions of a space against B-splines one by one."""

import numpy as np
import pytest

from cqblend.splines import Curve
from cqblend.splines.spline_space import SplineSpace, solve_block_tridiagonal

RNG = np.random.default_rng(21)
PLACES = (np.arange(8) + 0.5) / 8


def make_breaks(n):
    return np.concatenate([[0.0], np.cumsum(RNG.uniform(0.2, 3.0, n))])


def make_space(degree, n, closed):
    multiplicities = RNG.integers(1, degree + 1, n)
    if not closed:
        multiplicities[0] = 1
    return SplineSpace.from_knots(degree, make_breaks(n), multiplicities, closed=closed), multiplicities


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize(("degree", "n"), [(3, 6), (5, 12), (5, 37)])
def test_functions_are_the_b_splines(degree, n, closed):
    space, multiplicities = make_space(degree, n, closed)
    curve = space.as_curve()
    t = (space.breaks[:-1, None] + np.diff(space.breaks)[:, None] * PLACES).ravel()
    values = curve(t)
    assert np.abs(values.sum(axis=1) - 1).max() < 1e-12
    assert values.min() >= 0
    dense = np.zeros((n, len(PLACES), space.count))
    for span in range(n):
        dense[span][:, space.functions[span]] = space.evaluate_functions(PLACES)[span]
    assert np.abs(dense.reshape(-1, space.count) - values).max() < 1e-12
    if not closed:
        order = degree + 1
        knots = np.concatenate(
            [
                space.breaks[:1].repeat(order),
                space.breaks[1:-1].repeat(multiplicities[1:]),
                space.breaks[-1:].repeat(order),
            ]
        )
        assert np.abs(Curve.from_bspline(degree, knots, np.eye(space.count))(t) - values).max() < 1e-12


@pytest.mark.parametrize("multiplicity", [1, 3])
def test_closed_functions_are_smooth_through_the_seam(multiplicity):
    space = SplineSpace.from_knots(5, make_breaks(9), np.full(9, multiplicity), closed=True)
    jets = space.as_curve().jet(space.breaks[[0, -1]], 5 - multiplicity)
    assert np.abs(jets[:, 0] - jets[:, 1]).max() < 1e-9 * np.abs(jets).max()


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize(("degree", "n"), [(2, 16), (5, 16), (5, 61)])
def test_fits_are_those_of_dense_least_squares(degree, n, closed):
    space, _ = make_space(degree, n, closed)
    values = RNG.normal(size=(n, len(PLACES), 3))
    curve = space.fit_values(PLACES, values)
    t = (space.breaks[:-1, None] + np.diff(space.breaks)[:, None] * PLACES).ravel()
    design = space.as_curve()(t)
    expected = design @ np.linalg.lstsq(design, values.reshape(-1, 3), rcond=None)[0]
    assert np.abs(curve(t) - expected).max() < 1e-10
    assert np.array_equal(curve.continuity, space.continuity)


def test_splines_of_the_space_are_reproduced():
    space, _ = make_space(5, 40, True)
    curve = space.as_curve()
    t = (space.breaks[:-1, None] + np.diff(space.breaks)[:, None] * PLACES).ravel()
    values = curve(t) @ RNG.normal(size=(space.count, 2))
    fitted = space.fit_values(PLACES, values.reshape(40, len(PLACES), 2))
    assert np.abs(fitted(t) - values).max() < 1e-11


@pytest.mark.parametrize("blocks", range(1, 12))
def test_block_tridiagonal_systems(blocks):
    size = 3
    root = np.zeros((blocks * size, (blocks + 1) * size))
    for k in range(blocks):
        root[k * size : (k + 1) * size, k * size : (k + 2) * size] = RNG.normal(size=(size, 2 * size))
    dense = root @ root.T + np.eye(blocks * size)
    band = np.zeros((blocks, size, 3 * size))
    for k in range(blocks):
        for shift in (-1, 0, 1):
            if 0 <= k + shift < blocks:
                rows, columns = slice(k * size, (k + 1) * size), slice((k + shift) * size, (k + shift + 1) * size)
                band[k, :, (shift + 1) * size : (shift + 2) * size] = dense[rows, columns]
    right = RNG.normal(size=(blocks, size, 2))
    found = solve_block_tridiagonal(band, right)
    assert np.abs(dense @ found.reshape(-1, 2) - right.reshape(-1, 2)).max() < 1e-10
