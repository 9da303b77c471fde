"""Linear sizes and tables: their values against closed forms and SciPy's monotone cubics, and what is no table."""

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

import cqblend
from cqblend.errors import InputError
from cqblend.sizes.size_functions import Table

SIZES = st.lists(st.floats(0.01, 100), min_size=2, max_size=8)


def nodes(count):
    return np.linspace(0, 1, count) ** 1.7


@given(SIZES)
def test_a_table_is_the_monotone_cubic_of_fritsch_and_butland(sizes):
    t = nodes(len(sizes))
    law, oracle, at = cqblend.table(zip(t, sizes, strict=True)), PchipInterpolator(t, sizes), np.linspace(0, 1, 301)
    assert np.abs(law(at) - oracle(at)).max() <= 1e-12 * max(sizes)
    slope = oracle.derivative()
    for end in (0.0, 1.0):
        assert law.measure_slope(end) == pytest.approx(float(slope(end)), rel=1e-9, abs=1e-9 * max(sizes))


@given(SIZES)
def test_a_table_never_leaves_the_range_of_two_neighbours(sizes):
    t = nodes(len(sizes))
    law = cqblend.table(zip(t, sizes, strict=True))
    for i in range(len(t) - 1):
        values = law(np.linspace(t[i], t[i + 1], 50))
        slack = 1e-12 * max(sizes)
        assert values.min() >= min(sizes[i : i + 2]) - slack
        assert values.max() <= max(sizes[i : i + 2]) + slack


def test_a_periodic_table_has_one_slope_where_it_closes():
    law = Table((0.0, 0.2, 0.5, 1.0), (1.0, 3.0, 2.0, 1.0), periodic=True)
    assert law.measure_slope(0.0) == law.measure_slope(1.0)
    rising = Table((0.0, 0.3, 0.8, 1.0), (2.0, 3.0, 1.0, 2.0), periodic=True)
    assert rising.measure_slope(0.0) == pytest.approx(rising.measure_slope(1.0), rel=1e-14)
    assert rising.measure_slope(0.0) > 0
    step = 1e-6
    assert (rising(step) - rising(0.0)) / step == pytest.approx(rising.measure_slope(0.0), rel=1e-4)


def test_both_take_numbers_and_arrays():
    for law in (cqblend.linear(1, 3), cqblend.table([(0, 1), (0.4, 1.8), (1, 3)])):
        assert float(law(0.4)) == pytest.approx(1.8)
        assert law([[0.0, 1.0]]).tolist() == [[1.0, 3.0]]


@pytest.mark.parametrize(
    ("points", "message"),
    [
        ([], "ascends from 0 to 1, not nothing"),
        ([(0, 1)], "ascends from 0 to 1, not 0"),
        ([(0, 1), (0.9, 2)], "ascends from 0 to 1, not 0, 0.9"),
        ([(0, 1), (0.5, 2), (0.5, 3), (1, 1)], "ascends from 0 to 1, not 0, 0.5, 0.5, 1"),
        ([(0, 1), (0.5, 0), (1, 1)], "the size at t = 0.5 of a table must be above 0"),
        ([(0, -1), (1, 1)], "the size at t = 0 of a table must not be below 0"),
        ([(0, 0), (1, 0)], "all 0"),
        ([(0, 1), (1, np.nan)], "must be finite"),
        ([(0, 1), "ab"], "a table has pairs (t, size); each must be a pair, not 'ab'"),
        ([(0, 1), (1,)], "a table has pairs"),
        ("01", "a table has pairs"),
        (3, "a table has pairs"),
    ],
)
def test_what_is_no_table(points, message):
    with pytest.raises(InputError, match=re.escape(message)):
        cqblend.table(points)


@pytest.mark.parametrize("ends", [(0, 0), (-1, 2), (1, np.inf), ("1", 2)])
def test_what_is_no_linear_size(ends):
    with pytest.raises(InputError):
        cqblend.linear(*ends)
