"""Arc lengths against closed forms and long floats."""

import itertools

import mpmath
import numpy as np
import pytest
from developable_strips import EDGE, circle
from hypothesis import given, settings
from hypothesis import strategies as st

from cqblend.errors import InputError
from cqblend.patterns.flattening.arc_length import ArcLength
from cqblend.splines import Curve


def test_circle_and_cubic_of_constant_slope():
    ring = circle(3.0, 1.0)
    length = ArcLength(ring)
    assert abs(length.length / (6 * np.pi) - 1) < 1e-15
    t = np.linspace(0, 4, 57)
    angle = np.unwrap(np.arctan2(*ring(t)[:, 1::-1].T))
    np.testing.assert_allclose(length(t), 3 * angle, rtol=0, atol=1e-13)
    t = np.linspace(0, 1, 9)
    np.testing.assert_allclose(ArcLength(EDGE)(t), 3 * np.sqrt(2) * (t + t**3 / 3), rtol=0, atol=1e-14)


def long_length(curve, end):
    """Integrate the speed of a single piece with 25 digits."""
    poles = [[mpmath.mpf(float(x)) for x in row] for row in curve.coefs[..., 0]]
    rates = [[(b - a) * (len(poles) - 1) for a, b in zip(p, q, strict=True)] for p, q in itertools.pairwise(poles)]

    def value(rows, t):
        n = len(rows) - 1
        basis = [mpmath.binomial(n, i) * (1 - t) ** (n - i) * t**i for i in range(n + 1)]
        return [mpmath.fdot(basis, column) for column in zip(*rows, strict=True)]

    def speed(t):
        x, dx = value(poles, t), value(rates, t)
        w, dw = (x[3], dx[3]) if curve.rational else (1, 0)
        return mpmath.sqrt(sum(((dx[k] - x[k] / w * dw) / w) ** 2 for k in range(3)))

    return mpmath.quad(speed, mpmath.linspace(0, end, 5))


@pytest.mark.parametrize("weights", [None, [1.0, 0.3, 2.0, 0.7]])
def test_against_long_floats(weights):
    curve = Curve.bezier([[0.0, 0, 0], [1, 2, 0], [2, -1, 1], [3, 0, 2]], weights)
    length = ArcLength(curve)
    with mpmath.workdps(25):
        for end in (0.3, 1.0):
            assert abs(float(long_length(curve, end)) / float(length(end)) - 1) < 1e-13


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6))
def test_parts_and_chords(seed):
    rng = np.random.default_rng(seed)
    curve = Curve.bezier(rng.normal(size=(5, 2)))
    length = ArcLength(curve)
    assert (np.diff(length(np.linspace(0, 1, 23))) >= 0).all()
    rest = ArcLength(curve.clip(0.4, 1.0))
    assert abs(length(0.4) + rest.length - length.length) <= 1e-13 * length.length
    chords = np.linalg.norm(np.diff(curve(np.linspace(0, 1, 200)), axis=0), axis=1).sum()
    assert 0 <= length.length - chords < 1e-2 * length.length


def test_curves_that_stop():
    cusp = Curve.bezier([[0.0, 0], [1, 1], [0, 1], [1, 0]])  # stops inside
    assert abs(ArcLength(cusp).length - 2 * ArcLength(cusp.clip(0, 0.5)).length) < 1e-13
    start = ArcLength(Curve.bezier([[0.0, 0], [0, 0], [3, 4]]))  # s = 5 t^2
    np.testing.assert_allclose(start([0.0, 0.1, 1.0]), [0, 0.05, 5], rtol=0, atol=1e-14)
    point = ArcLength(Curve.bezier([[1.0, 2, 3]] * 3))
    assert point.length == 0
    assert point([0.0, 0.5]).tolist() == [0, 0]


def test_not_a_curve():
    with pytest.raises(InputError, match="Curve"):
        ArcLength(3)
