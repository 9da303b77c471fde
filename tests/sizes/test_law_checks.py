"""Functions that callers give for sizes: how they are called, and what is refused, with its place."""

import math

import numpy as np
import pytest

import cqblend
from cqblend.errors import InputError
from cqblend.sizes.law_checks import check_law
from cqblend.sizes.size_law import SizeLaw

T = np.linspace(0, 1, 77)


@pytest.mark.parametrize(
    ("given", "same"),
    [
        (lambda t: 1 + t**2, lambda t: 1 + t**2),
        (lambda t: [1 + one for one in t], lambda t: 1 + t),
        (lambda t: 1 + math.sin(t), lambda t: 1 + np.sin(t)),  # of numbers only
        (lambda t: 2 + t if t < 0.5 else 1.5 + 2 * t - t**2 + 0.25, None),  # which arrays have no truth value for
        (lambda t: (1 + np.atleast_1d(t))[:, None], lambda t: 1 + t),
        (lambda t: 1 + np.max(t), lambda t: 1 + t),  # which is another function of arrays
        (np.exp, np.exp),
    ],
)
def test_functions_of_arrays_and_of_numbers(given, same):
    law = check_law("radius", given)
    assert isinstance(law, SizeLaw)
    expected = np.array([given(t) for t in T]) if same is None else same(T)
    assert np.array_equal(law(T), np.asarray(expected, dtype=float).ravel())


@pytest.mark.parametrize("size", [0.1, 1 / 3, 7.0])
@pytest.mark.parametrize("make", [lambda s: lambda _: s, lambda s: lambda t: s + 0 * t, lambda s: cqblend.linear(s, s)])
def test_what_is_one_number_becomes_it(size, make):
    found = check_law("radius", make(size))
    assert type(found) is float
    assert found == size


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda t: 1 if t < 0.3 else 2, r"radius jumps from 1 to 2 mm at t = 0\.3:"),
        (lambda t: 1 + 1e-4 * (t > 0.7), r"radius jumps from 1 to 1\.0001 mm at t = 0\.7:"),
        (lambda t: max(1, 3 * t), r"radius has a corner at t = 0\.3333, where its slope jumps from 0 to 3 mm"),
        (
            lambda t: 1 + 0.3 * abs(t - 0.371),
            r"radius has a corner at t = 0\.371, where its slope jumps from -0\.3 to 0\.3",
        ),
        (np.sqrt, r"radius has a corner at t = "),
        (lambda t: t - 0.5, r"radius is -0\.5 at t = 0: it must be above 0"),
        (lambda t: (t - 0.5) ** 2, r"radius is 0 at t = 0\.5: it must be above 0"),
        (lambda t: 1 / (1 - t), "radius is inf at t = 1: it must be finite|ZeroDivisionError"),
        (lambda t: 1 / (t - 0.37) ** 2, "radius"),
        (lambda t: np.nan * t, r"radius is nan at t = 0: it must be finite"),
        (lambda t: "a", "a function of t, from 0 to 1, that returns sizes in mm"),
        (lambda t: None, "radius is nan"),
        (lambda t: [1, 2, 3], "a function of t"),
        (lambda: 1, "takes 0 positional arguments"),
        (lambda t: t.missing, "missing"),
        (lambda t: -1.0, "radius must be above 0, not -1"),
    ],
)
def test_what_is_no_size(function, message):
    with pytest.raises(InputError, match=message):
        check_law("radius", function)


@pytest.mark.parametrize(
    "function",
    [
        lambda t: 2 + np.sin(40 * t),
        lambda t: 1 + np.tanh((t - 0.3) * 3000) / 2,
        lambda t: 1 + np.abs(t - 0.3) ** 1.9,
        lambda t: np.sin(np.pi * t) ** 2,
        cqblend.table([(0, 1), (0.3, 1), (0.4, 5), (1, 1)]),
    ],
)
def test_what_is_steep_but_smooth_is_taken(function):
    assert isinstance(check_law("radius", function), SizeLaw)
