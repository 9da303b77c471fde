"""Splines for functions: by least squares within a tolerance, and smooth ones to rounding."""

import numpy as np
import pytest

from cqblend.errors import GeometryError
from cqblend.splines.approximation import Kinks, approximate_curve, approximate_to_rounding

DENSE = np.linspace(0, 2 * np.pi, 5001)


def wave(t):
    return np.stack([np.cos(3 * t), np.exp(np.sin(t))], axis=1)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("closed", [False, True])
def test_tolerance_holds_between_the_nodes(tolerance, closed):
    curve = approximate_curve(wave, [0, 2 * np.pi], tolerance, closed=closed)
    assert curve.degree == 5
    assert (curve.continuity == 4).all()
    assert np.abs(curve(DENSE) - wave(DENSE)).max() <= 1.5 * tolerance


def test_closed_splines_go_on_with_four_derivatives():
    curve = approximate_curve(wave, [0, 2 * np.pi], 1e-6, closed=True)
    for k in range(5):
        ends = curve(np.array([0.0, 2 * np.pi]), k)
        np.testing.assert_allclose(ends[0], ends[1], atol=1e-9 * 40.0**k)


def test_knots_lie_at_given_breaks():
    breaks = np.array([0, 0.41, 0.77, 1.2, 1.55, 2.0, 2.3, 2.8, 3.1, 3.6, 3.9, 4.3, 4.7, 5.1, 5.5, 5.9, 2 * np.pi])
    curve = approximate_curve(wave, breaks, 1e-3)
    assert np.isin(curve.breaks, breaks).all()


@pytest.mark.parametrize("order", [0, 1, 2, 3])
def test_kinks_of_every_order(order):
    def kinked(t):
        return (np.sin(t) + np.where(t > 2.2, (t - 2.2) ** (order + 1), 0))[:, None]

    with pytest.raises(GeometryError, match="spline of 64 spans errs by"):
        approximate_curve(kinked, [0, 5], 1e-12, most=64)
    curve = approximate_curve(kinked, [0, 5], 1e-12, kinks=Kinks([2.2], [order]))
    assert np.abs(curve(np.linspace(0, 5, 3001)) - kinked(np.linspace(0, 5, 3001))).max() <= 2e-12
    assert curve.continuity[np.searchsorted(curve.breaks, 2.2) - 1] == order


def test_a_closed_function_may_have_its_kink_at_the_start():
    def kinked(t):
        return np.abs(np.sin(t / 2))[:, None] ** 3

    curve = approximate_curve(kinked, [0, 2 * np.pi], 1e-10, closed=True, kinks=Kinks([0], [2]))
    np.testing.assert_allclose(curve(DENSE), kinked(DENSE), atol=2e-10)
    for k in range(3):
        np.testing.assert_allclose(curve(0.0, k), curve(2 * np.pi, k), atol=1e-8)


def test_kinks_that_differ_by_rounding_are_one_and_those_of_smooth_functions_move_to_breaks():
    curve = approximate_curve(
        wave, [0, 1, 2 * np.pi], 1e-3, kinks=Kinks([1 + 1e-12, 1 - 1e-12, 2.0, 0.99], [2, 3, 4, 4])
    )
    near = curve.breaks[np.abs(curve.breaks - 1) < 0.05]
    assert near.tolist() == [1.0]
    assert curve.continuity[np.searchsorted(curve.breaks, 1.0) - 1] == 2


@pytest.mark.parametrize("frequency", [1, 4, 16])
@pytest.mark.parametrize("offset", [0.0, 100.0])
def test_smooth_functions_to_rounding(frequency, offset):
    def function(t):
        return np.stack([offset + np.cos(frequency * t), np.sin(frequency * t)], axis=1)

    curve = approximate_to_rounding(function, (0, 2 * np.pi), closed=True)
    assert curve.degree == 7
    assert (curve.continuity >= 3).all()
    assert np.abs(curve(DENSE) - function(DENSE)).max() <= 1e-13 * (1 + offset) * max(1, frequency / 8)
    for k in range(1, 4):
        np.testing.assert_allclose(curve(0.0, k), curve(2 * np.pi, k), atol=1e-9 * frequency**k * (1 + offset))
    h = 1e-5
    slope = (function(DENSE[1:-1] + h) - function(DENSE[1:-1] - h)) / (2 * h)
    np.testing.assert_allclose(curve(DENSE[1:-1], 1), slope, atol=1e-7 * frequency**3 * (1 + offset))


def test_open_ends_need_not_meet():
    curve = approximate_to_rounding(lambda t: np.exp(t)[:, None], (-1, 2))
    t = np.linspace(-1, 2, 999)
    np.testing.assert_allclose(curve(t)[:, 0], np.exp(t), rtol=0, atol=1e-12)


def test_corners_are_refused():
    with pytest.raises(GeometryError, match=r"not smooth enough at t = 0\.(299|3).* give it as a Curve"):
        approximate_to_rounding(lambda t: np.abs(t - 0.3)[:, None], (0, 1))


def test_zero_is_a_function():
    assert not approximate_to_rounding(lambda t: np.zeros((len(t), 2)), (0, 1))(0.3).any()
