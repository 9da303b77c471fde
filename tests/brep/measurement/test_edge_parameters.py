"""Where edges are measured: beside breaks, in every span, and again where more is to be found."""

from itertools import pairwise

import numpy as np
import pytest

from cqblend.brep.measurement.edge_parameters import CLUSTER_OFFSETS, resample_near_maxima, spread_samples


class Counted:
    """A function that counts the parameters that it was asked for."""

    def __init__(self, *functions):
        self.functions, self.asked = functions, 0

    def __call__(self, ts):
        self.asked += len(ts)
        return tuple(function(ts) for function in self.functions)


def resampled(measure, negligible, count=101):
    ts = np.linspace(0, 1, count)
    values = measure(ts)
    measure.asked = 0
    return resample_near_maxima(measure, ts, values, negligible)


@pytest.mark.parametrize("at", [0.0, 0.3141, 0.5, 1.0])
@pytest.mark.parametrize("width", [1e-2, 1e-3])
def test_a_peak_between_samples_is_found(at, width):
    measure = Counted(lambda t: 1 / (1 + ((t - at) / width) ** 2))
    ts, (values,) = resampled(measure, [0.0])
    assert values.max() > 0.98
    assert abs(ts[values.argmax()] - at) < 0.2 * width


def test_what_is_level_or_negligible_is_not_measured_again():
    level = Counted(lambda t: 3 + 1e-6 * np.sin(40 * t))
    resampled(level, [0.0])
    assert level.asked == 0
    nothing = Counted(lambda t: 1e-15 * np.abs(np.sin(40 * t)))
    resampled(nothing, [1e-14])
    assert nothing.asked == 0
    both = Counted(lambda t: 3 + 0 * t, lambda t: 1e-15 * t, lambda t: np.sin(40 * t))
    resampled(both, [0.0, 1e-14, 0.0])
    assert 0 < both.asked < 150


def test_values_and_parameters_stay_together():
    measure = Counted(np.sin, np.cos)
    ts, (sines, cosines) = resampled(measure, [0.0, 0.0], 11)
    assert np.array_equal(sines, np.sin(ts))
    assert np.array_equal(cosines, np.cos(ts))
    assert (np.diff(ts) > 0).all()


def test_spans_beside_what_is_not_finite_are_left_out():
    measure = Counted(lambda t: np.where(t < 0.4949, np.nan, 1 / (t + 1e-9)))
    ts, (values,) = resampled(measure, [0.0])
    first = np.flatnonzero(np.isfinite(values))[0]
    assert ts[first] == 0.5
    assert np.nanmax(values) == values[first]


def test_no_sample_is_on_a_break_and_every_span_has_some():
    breaks = np.array([0.0, 0.25, 0.2501, 0.7, 1.0])
    ts = spread_samples(breaks, 101)
    distances = np.abs(ts[:, None] - breaks).min(axis=1)
    assert distances.min() == pytest.approx(CLUSTER_OFFSETS[0])
    assert all(((ts > low) & (ts < high)).sum() >= 11 for low, high in pairwise(breaks))
    assert len(ts) >= 101
