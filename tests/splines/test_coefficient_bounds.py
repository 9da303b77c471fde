"""Enclosures contain every value, and are close to values that are taken."""

from fractions import Fraction
from math import comb

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.polynomial import Polynomial
from spline_oracles import bernstein_value, exact

from cqblend.splines.coefficient_bounds import enclose_values, find_value_below, has_value_below

polynomials = st.tuples(st.integers(0, 9), st.integers(1, 4), st.integers(0, 2**32 - 1)).map(
    lambda a: np.random.default_rng(a[2]).uniform(-1, 1, (a[0] + 1, a[1])).round(3)
)
GRID = [Fraction(i, 40) for i in range(41)]


def values(f):
    """Exact values on a grid, (41, n)."""
    return np.array([bernstein_value(exact(f), x) for x in GRID])


@given(polynomials)
def test_an_enclosure_holds_and_is_sharp(f):
    low, high = enclose_values(f, ratio=1.05)
    taken = values(f)
    assert low <= taken.min()
    assert taken.max() <= high
    assert max(-low, high) <= 1.05 * largest(f) + 1e-13


def largest(f):
    """Largest absolute value: at the ends, or at a root of the derivative in the monomial basis."""
    n, x = len(f) - 1, Polynomial([0.0, 1.0])
    terms = [comb(n, i) * x**i * (1 - x) ** (n - i) for i in range(n + 1)]
    best = 0.0
    for column in f.T:
        p = sum((float(c) * term for c, term in zip(column, terms, strict=True)), Polynomial([0.0]))
        roots = np.atleast_1d(p.deriv().roots())
        best = max(best, np.abs(p(np.concatenate([[0.0, 1.0], np.clip(roots.real, 0, 1)]))).max())
    return best


@given(polynomials, st.floats(-1, 1))
def test_a_dip_is_one_or_there_is_none(f, floor):
    found = find_value_below(f, floor)
    if found is None:
        assert values(f).min() >= Fraction(floor) - Fraction(1, 10**12)
    else:
        piece, x = found
        assert bernstein_value(exact(f[:, piece]), Fraction(x)) < Fraction(floor)


@given(polynomials, st.floats(-1, 1), st.integers(0, 2**32 - 1))
def test_groups_have_a_dip_where_one_of_their_polynomials_has(f, floor, seed):
    group = np.random.default_rng(seed).integers(0, 3, f.shape[1])
    for i, found in enumerate(has_value_below(f, floor, group, 3).tolist()):
        surely, perhaps = (
            any(find_value_below(column[:, None], floor + off) for column in f.T[group == i]) for off in (-1e-12, 1e-12)
        )
        assert surely <= found <= perhaps


def test_touching_is_not_a_dip():
    """(x - 1/3)^2 touches zero where no halving lands."""
    third = 1 / 3
    assert find_value_below(np.array([[third**2], [-third * (1 - third)], [(1 - third) ** 2]]), 0.0) is None


def test_slack_widens():
    low, high = enclose_values(np.array([[1.0], [2.0]]), slack=0.5)
    assert low <= 0.5
    assert 2.5 <= high < 2.5 + 1e-12
