"""Zeros and thresholds between known ends."""

from __future__ import annotations

import math

import numpy as np
import pytest

from cqblend.splines.bracketing import bisect_interval, bisect_intervals, solve_in_brackets


@pytest.mark.parametrize("reverse", [False, True])
def test_zeros_are_found_from_either_end(reverse):
    wanted = np.array([0.25, 0.5, 0.9, 1e-9])

    def function(x: np.ndarray) -> np.ndarray:
        return (x**3 + x) - (wanted**3 + wanted)

    ends = (np.zeros(4), np.ones(4))[:: -1 if reverse else 1]
    found = solve_in_brackets(function, ends, (function(ends[0]), function(ends[1])), 1e-16)
    assert np.abs(found - wanted).max() < 2e-16


def test_a_flat_end_does_not_stay():
    """Plain regula falsi creeps here: the chord from the steep end hardly moves."""
    calls = []

    def function(x: np.ndarray) -> np.ndarray:
        calls.append(x)
        return np.exp(x) - 2

    low, high = np.array([0.0]), np.array([10.0])
    assert solve_in_brackets(function, (low, high), (function(low), function(high)), 1e-14)[0] == pytest.approx(
        math.log(2)
    )
    assert len(calls) < 40


def test_an_end_that_is_a_zero_is_found():
    ends = np.array([0.0]), np.array([2.0])
    assert solve_in_brackets(lambda x: x, ends, (ends[0], ends[1]), 0.0)[0] == 0
    assert solve_in_brackets(lambda x: x - 2, ends, (ends[0] - 2, ends[1] - 2), 0.0)[0] == 2


def test_bisection_ends_at_neighbouring_numbers():
    low, high = bisect_interval(lambda x: x * x < 2, 1.0, 2.0)
    assert high == math.nextafter(low, 2)
    assert low * low < 2 <= high * high
    assert bisect_interval(lambda x: x * x > 2, 2.0, 1.0) == (high, low)
    many = bisect_intervals(lambda x: x * x < [2.0, 3.0], np.ones(2), np.full(2, 2.0))
    assert (many[0][0], many[1][0]) == (low, high)


def test_no_interval_asks_nothing():
    def never(x: np.ndarray) -> np.ndarray:
        raise AssertionError

    assert [len(end) for end in bisect_intervals(never, np.empty(0), np.empty(0))] == [0, 0]
