"""Polynomials across, against polynomials in exact fractions, worked out from Rodrigues' formula."""

from fractions import Fraction
from math import factorial

import numpy as np
import pytest

from cqblend.blends.pde.bubble_basis import evaluate_bubbles, evaluate_hermite_basis

POINTS = [Fraction(i, 16) for i in range(17)]
V = np.array([float(x) for x in POINTS])


def times(a, b):
    out = [Fraction(0)] * (len(a) + len(b) - 1)
    for i, x in enumerate(a):
        for k, y in enumerate(b):
            out[i + k] += x * y
    return out


def slope(a, k=1):
    for _ in range(k):
        a = [i * x for i, x in enumerate(a)][1:] or [Fraction(0)]
    return a


def at(a, v):
    return sum(x * v**i for i, x in enumerate(a))


def bubble(half, m):
    """Return a multiple of the bubble: D^m (v (1 - v))^(m + h), in powers of v. Rodrigues' formula on [0, 1]."""
    power = [Fraction(1)]
    for _ in range(m + half):
        power = times(power, [Fraction(0), Fraction(1), Fraction(-1)])
    return slope(power, m)


@pytest.mark.parametrize("half", [1, 2, 3])
@pytest.mark.parametrize("m", [0, 1, 5, 12, 23])
def test_bubbles_and_all_their_derivatives_are_those_of_rodrigues(half, m):
    exact = bubble(half, m)
    own = evaluate_bubbles(half, m + 1, V)[:, m]
    scale = own[7] / float(at(exact, POINTS[7]))
    for k in range(2 * half + 1):
        wanted = scale * np.array([float(at(slope(exact, k), v)) for v in POINTS])
        np.testing.assert_allclose(
            evaluate_bubbles(half, m + 1, V, k)[:, m], wanted, rtol=0, atol=1e-13 * abs(wanted).max()
        )


@pytest.mark.parametrize("half", [1, 2, 3])
def test_bubbles_vanish_at_both_ends_with_their_derivatives_and_no_more(half):
    ends = np.array([0.0, 1.0])
    for k in range(half):
        assert not evaluate_bubbles(half, 9, ends, k).any()
    assert (np.abs(evaluate_bubbles(half, 9, ends, half)) > 1e-3).all()


@pytest.mark.parametrize("half", [1, 2, 3])
def test_their_highest_bound_derivatives_are_orthonormal(half):
    """By exact integration of products of polynomials: <D^h bubble, D^h bubble> is diagonal, and one."""
    exact = [slope(bubble(half, m), half) for m in range(6)]
    scale = [evaluate_bubbles(half, 6, V)[7, m] / float(at(bubble(half, m), POINTS[7])) for m in range(6)]
    for m, a in enumerate(exact):
        for n, b in enumerate(exact):
            integral = sum(x / (i + 1) for i, x in enumerate(times(a, b)))
            if m != n:
                assert integral == 0
            else:
                assert scale[m] ** 2 * float(integral) == pytest.approx(1, rel=1e-13)


@pytest.mark.parametrize("half", [1, 2, 3])
def test_carriers_have_one_datum_each(half):
    ends = np.array([0.0, 1.0])
    for k in range(half):
        found = evaluate_hermite_basis(half, ends, k)
        for e in (0, 1):
            for r in range(half):
                wanted = np.where(ends == e, float(k == r), 0.0)
                np.testing.assert_allclose(found[:, e, r], wanted, atol=1e-12)
    for k in range(1, 2 * half + 1):
        h = 1e-5
        middle = np.array([0.3, 0.6])
        difference = (
            evaluate_hermite_basis(half, middle + h, k - 1) - evaluate_hermite_basis(half, middle - h, k - 1)
        ) / (2 * h)
        np.testing.assert_allclose(evaluate_hermite_basis(half, middle, k), difference, atol=1e-6 * factorial(2 * half))


def test_the_cubic_carriers_are_hermites():
    v = V
    wanted = np.stack([2 * v**3 - 3 * v**2 + 1, v**3 - 2 * v**2 + v, 3 * v**2 - 2 * v**3, v**3 - v**2], axis=-1)
    np.testing.assert_allclose(evaluate_hermite_basis(2, v).reshape(-1, 4), wanted, atol=1e-15)
