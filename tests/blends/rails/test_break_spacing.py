"""Breaks are spaced so that errors are met: as many as the order of a fit asks for, and where it errs."""

from __future__ import annotations

import numpy as np
import pytest

from cqblend.blends.rails.break_spacing import halve_spans, predict_growth, space_breaks
from cqblend.splines.interpolation import interpolate


def measure_errors(function, breaks: np.ndarray) -> np.ndarray:
    """Return the largest error of a cubic spline through a function, in each span."""
    curve = interpolate(breaks, function(breaks)[:, None])
    inside = breaks[:-1] + np.diff(breaks) * (np.arange(1, 20) / 20)[:, None]
    return np.abs(curve(inside.ravel())[:, 0].reshape(inside.shape) - function(inside)).max(axis=0)


@pytest.mark.parametrize("tolerance", [1e-4, 1e-6, 1e-8])
def test_two_predictions_meet_a_smooth_function_and_one_nearly(tolerance):
    breaks = np.linspace(0, 3, 17)
    while (errors := measure_errors(np.sin, breaks)).max() > 500 * tolerance:
        breaks = halve_spans(breaks, np.full((len(breaks) - 1, 2), 2.0))
    spaced = space_breaks(breaks, predict_growth(errors / tolerance, 4.0), np.empty(0))
    left = measure_errors(np.sin, spaced)
    assert left.max() <= 1.2 * tolerance
    again = space_breaks(spaced, predict_growth(left / tolerance, 4.0), np.empty(0))
    assert measure_errors(np.sin, again).max() <= tolerance
    least = len(breaks) * (errors.max() / tolerance) ** 0.25
    assert len(spaced) < 1.3 * max(least, len(breaks))


def test_spans_become_short_where_the_error_is():
    def bump(x):
        return np.exp(-((x - 0.3) ** 2) / 0.001)

    breaks, tolerance = np.linspace(0, 1, 65), 1e-6
    for _ in range(3):
        errors = measure_errors(bump, breaks)
        breaks = space_breaks(breaks, predict_growth(errors / tolerance, 4.0), np.empty(0))
    assert measure_errors(bump, breaks).max() <= tolerance
    assert np.diff(breaks).max() == pytest.approx(1 / 64, rel=0.1)
    evenly = np.linspace(0, 1, len(breaks))
    assert measure_errors(bump, evenly).max() > 10 * tolerance


def test_fixed_breaks_and_ends_stay_to_the_bit():
    breaks = np.array([0.1, 0.25, 0.7, 0.9, 1.3])
    for growth in (np.ones(4), np.array([1.0, 3.7, 2.2, 1.4])):
        spaced = space_breaks(breaks, growth, np.array([0.7, 0.25, 0.8]))
        assert {0.1, 0.25, 0.7, 1.3} <= set(spaced.tolist())
        assert (np.diff(spaced) > 0).all()
    assert space_breaks(breaks, np.ones(4), breaks).tolist() == breaks.tolist()


def test_spans_that_fit_get_no_shorter_than_allowed_for_the_sake_of_their_neighbours():
    breaks, growth = np.array([0.0, 1.0, 1.25, 2.25]), np.array([4.0, 1.0, 4.0])
    assert np.diff(space_breaks(breaks, growth, breaks)).min() < 0.1
    assert np.diff(space_breaks(breaks, growth, breaks, 0.25)).min() == 0.25


def test_growth_is_bounded_on_both_sides():
    growth = predict_growth(np.array([0.0, 1e-9, 1.0, 1e30]), 4.0)
    assert growth[0] == growth[1] == 1.0
    assert 1.0 < growth[2] < 1.3
    assert growth[3] == 5.0


def test_spans_are_halved_where_they_err_and_again_where_their_halves_will():
    breaks = np.array([0.0, 1.0, 3.0])
    assert halve_spans(breaks, np.array([[0.5, 1.0], [1.1, 0.0]])).tolist() == [0, 1, 2, 3]
    assert halve_spans(breaks, np.array([[2.0, 40.0], [0.9, 0.3]])).tolist() == [0, 0.5, 0.75, 1, 3]
    assert halve_spans(breaks, np.array([[0.0, 0.0], [300.0, 2.0]])).tolist() == [0, 1, 1.25, 1.5, 1.75, 2, 3]
    assert halve_spans(breaks, np.zeros((2, 2))).tolist() == breaks.tolist()
