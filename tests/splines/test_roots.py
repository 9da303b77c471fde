"""Sign changes of Bernstein polynomials against exact arithmetic, in regular and in special positions."""

from fractions import Fraction

import numpy as np
import pytest
from spline_oracles import bernstein_value, exact

from cqblend.splines.bernstein import EPSILON
from cqblend.splines.roots import find_sign_changes

STEP = Fraction(1, 2**50)


def list_roots(f):
    """Roots of each column, ascending."""
    column, root = find_sign_changes(f, 16 * EPSILON * np.abs(f).max(axis=0))
    return [np.sort(root[column == j]) for j in range(f.shape[1])]


def check_bracketed(f, roots):
    """Each root is zero to rounding, or the sign differs at two places 2^-50 before and after it."""
    for column, found in zip(exact(f).T, roots, strict=True):
        for t in map(Fraction, found):
            value, before, after = (bernstein_value(column, x) for x in (t, t - STEP, t + STEP))
            assert before * after < 0 or abs(value) <= EPSILON * np.abs(column).max()


@pytest.mark.parametrize("p", [1, 2, 3, 4, 7])
def test_random_polynomials(p):
    """None is missed: signs change as often as on 2,000 samples, but for columns with two roots between samples."""
    f = np.random.default_rng(p).uniform(-1, 1, (p + 1, 200))
    roots = list_roots(f)
    check_bracketed(f, roots)
    t = np.linspace(0, 1, 2001)
    values = bernstein_value(f[:, :, None], t)
    changes = (values[:, 1:] * values[:, :-1] < 0).sum(axis=1)
    assert ([len(found) for found in roots] == changes).mean() > 0.99
    assert sum(changes) > 50


@pytest.mark.parametrize(
    "shape",
    [
        [0.05, 1.2, -0.2, 0.93],  # turns twice
        [0.0, 0.0, 1.0, 1.0],  # slope zero at the ends
        [0.0, 0.0, 0.0, 1.0],  # t^3
        [0.0, 1 / 3, 2 / 3, 1.0],  # a line
        [0.0, 0.0, 1 / 3, 1.0],  # a parabola
        [0.0, 0.5, 0.5, 1.0],
        [0.0, 5.0, -4.0, 1.0],
        [0.0, 30.0, -20.0, 1.0],
    ],
)
def test_cubics_through_many_lines(shape):
    """Levels at every scale: also those that a cubic reaches close to where its slope is zero."""
    levels = np.concatenate([np.linspace(0.01, 0.99, 21), 10.0 ** -np.arange(2, 12), 1 - 10.0 ** -np.arange(2, 12)])
    f = np.array(shape)[:, None] - levels
    roots = list_roots(f)
    check_bracketed(f, roots)
    assert ([len(found) % 2 == 1 for found in roots] == (f[0] * f[-1] < 0)).all()


@pytest.mark.parametrize("p", [2, 3, 5])
def test_two_roots_become_one_and_none(p):
    """A parabola, of any degree, that reaches 1/4: two roots below, none above, and no matter what to rounding."""
    parabola = [Fraction(i * (p - i), p * (p - 1)) for i in range(p + 1)]
    below = 10.0 ** -np.arange(1, 15)
    f = np.array(parabola, dtype=float)[:, None] - 0.25 + np.concatenate([below, -below])
    roots = list_roots(f)
    check_bracketed(f, roots)
    assert [len(found) for found in roots[:14]] == [2] * 14
    assert [len(found) for found in roots[14:28]] == [0] * 14
    np.testing.assert_allclose([found[1] - 0.5 for found in roots[:12]], np.sqrt(below[:12]), rtol=0.01)


@pytest.mark.parametrize("p", [1, 2, 3, 4])
def test_zero_to_rounding_has_no_sign(p):
    noise = np.random.default_rng(p).uniform(-1e-16, 1e-16, (p + 1, 9))
    assert find_sign_changes(noise, np.full(9, 1e-15))[0].size == 0
    touching = np.ones((p + 1, 1))
    touching[0] = -1e-17
    assert find_sign_changes(touching, np.full(1, 1e-15))[0].size == 0


def test_nothing_to_find():
    for p in (0, 1, 2, 3, 4):
        column, root = find_sign_changes(np.ones((p + 1, 3)), 0.0)
        assert column.size == root.size == 0
