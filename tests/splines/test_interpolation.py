"""Interpolants meet their conditions, whatever the spacing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cqblend.errors import InputError
from cqblend.splines import hermite, interpolate

steps = st.lists(st.floats(0.05, 2), min_size=7, max_size=20)


def jumps(f, k):
    at = f.breaks[1:-1]
    return np.abs(f(at, k) - f(at, k, side="left")).max() / (1 + np.abs(f(at, k)).max())


@given(steps, st.sampled_from([3, 5]))
def test_not_a_knot_is_smooth_and_interpolates(h, degree):
    t = np.cumsum([0, *h])
    values = np.random.default_rng(len(h)).uniform(-1, 1, (len(t), 2))
    f = interpolate(t, values, degree=degree)
    assert f.degree == degree
    assert (f.continuity == degree - 1).all()
    np.testing.assert_allclose(f(t), values, rtol=0, atol=1e-13)
    for k in range(1, degree):
        assert jumps(f, k) < 1e-9
    outer = np.concatenate([f.breaks[1 : 1 + degree // 2], f.breaks[-1 - degree // 2 : -1]])
    high = f(outer, degree)
    np.testing.assert_allclose(high, f(outer, degree, side="left"), rtol=0, atol=1e-7 * (1 + np.abs(high).max()))


@pytest.mark.parametrize(("degree", "evenness"), [(1, 0), (3, 0), (3, 1), (5, 1)])
def test_polynomials_are_reproduced(degree, evenness):
    t = np.cumsum(evenness + np.random.default_rng(degree).uniform(0, 1, 14))
    t = (t - t[0]) / (t[-1] - t[0])
    coefficients = np.random.default_rng(0).uniform(-1, 1, degree + 1)
    f = interpolate(t, np.polyval(coefficients, t)[:, None], degree=degree)
    x = np.linspace(t[0], t[-1], 50)
    np.testing.assert_allclose(f(x)[:, 0], np.polyval(coefficients, x), rtol=0, atol=1e-13)


def test_complete_ends():
    t = np.linspace(0, 2, 9)
    f = interpolate(t, np.sin(t)[:, None], derivatives=[[1.0], [np.cos(2)]])
    assert f(0, 1).item() == pytest.approx(1, abs=1e-14)
    assert f(2, 1).item() == pytest.approx(np.cos(2), abs=1e-14)
    errors = []
    for n in (20, 40):
        t = np.linspace(0, 2, n + 1)
        g = interpolate(t, np.sin(t)[:, None], derivatives=[[1.0], [np.cos(2)]])
        x = np.linspace(0, 2, 500)
        errors.append(np.abs(g(x)[:, 0] - np.sin(x)).max())
    assert 14 < errors[0] / errors[1] < 18  # fourth order


@given(steps, st.sampled_from([3, 5]))
def test_periodic_with_a_shift(h, degree):
    t = np.cumsum([0, *h])
    values = np.random.default_rng(len(h)).uniform(-1, 1, (len(t), 2))
    values[-1] = values[0] + [3, 0]
    f = interpolate(t, values, degree=degree, periodic=True)
    np.testing.assert_allclose(f(t), values, rtol=0, atol=1e-13)
    for k in range(1, degree):
        assert jumps(f, k) < 1e-9
        np.testing.assert_allclose(f(t[0], k), f(t[-1], k), rtol=0, atol=1e-9 * (1 + np.abs(f(t, k)).max()))


def test_antiperiodic():
    t = np.linspace(0, np.pi, 21)
    values = np.cos(t)[:, None]
    f = interpolate(t, values, periodic=True, sign=-1)
    for k in (1, 2):
        np.testing.assert_allclose(f(0, k), -f(np.pi, k), rtol=0, atol=1e-12)
    x = np.linspace(0, np.pi, 77)
    assert np.abs(f(x)[:, 0] - np.cos(x)).max() < 1e-5
    with pytest.raises(InputError, match="opposite sign"):
        interpolate(t, values + 1, periodic=True, sign=-1)


def test_interpolation_survives_extreme_scales():
    for scale in (1e-6, 1e6):
        t = scale * np.linspace(0, 1, 60)
        f = interpolate(t, np.sin(6 * t / scale)[:, None])
        assert np.abs(f(t)[:, 0] - np.sin(6 * t / scale)).max() < 1e-13
        assert jumps(f, 2) < 1e-9


@pytest.mark.parametrize("k", [0, 1, 2, 3])
def test_hermite_takes_the_jets_it_is_given(k):
    t = np.array([0.0, 0.5, 2.0, 2.25])
    jets = np.random.default_rng(k).uniform(-1, 1, (k + 1, 4, 3))
    f = hermite(t, jets)
    assert f.degree == 2 * k + 1
    assert (f.continuity == k).all()
    for side in ("left", "right"):
        np.testing.assert_allclose(f.jet(t, k, side=side), jets, rtol=0, atol=1e-11)


def test_one_sided_hermite_knows_its_continuity():
    jets = np.random.default_rng(0).uniform(-1, 1, (2, 3, 2, 1))
    jets[:, 1, 0] = jets[:, 0, 1]  # C1
    jets[0, 2, 0] = jets[0, 1, 1]  # C0
    f = hermite([0, 1, 2, 3], jets)
    assert f.continuity.tolist() == [1, 0]
    np.testing.assert_allclose(f(1.0, 1), jets[1, 1, 0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(f(2.0, 1, side="left"), jets[1, 1, 1], rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("t", "values", "keywords", "message"),
    [
        ([0, 1, 1], np.zeros((3, 1)), {}, "increasing"),
        ([0, 1, 2], np.zeros((3, 1)), {}, "too few"),
        ([0, 1, 2, 3], np.zeros((3, 1)), {}, "shape"),
        ([0, 1, 2, 3], np.zeros((4, 1)), {"degree": 4}, "degree 4"),
        ([0, 1, 2, 3], np.zeros((4, 1)), {"sign": -1}, "sign"),
        ([0, 1, 2, 3], np.zeros((4, 1)), {"derivatives": np.zeros((2, 1)), "periodic": True}, "periodic"),
    ],
)
def test_bad_data_is_named(t, values, keywords, message):
    with pytest.raises(InputError, match=message):
        interpolate(t, values, **keywords)


def test_an_end_may_have_a_given_slope_and_the_other_none():
    """A cubic is reproduced from its slope at one end; near the other, it is as not-a-knot ends make it."""
    t = np.array([0.0, 0.3, 0.5, 1.1, 1.6, 2.0])
    cubic = interpolate(t, (t**3 - t)[:, None], derivatives=(None, [11.0]))
    assert abs(cubic(0.17) - (0.17**3 - 0.17)).max() < 1e-14
    t = np.linspace(0, 2, 41)
    free = interpolate(t, np.exp(t)[:, None])
    half = interpolate(t, np.exp(t)[:, None], derivatives=([3.0], None))
    assert half(0.0, 1)[0] == pytest.approx(3.0, abs=1e-13)
    assert abs(half(1.97) - free(1.97)).max() < 1e-14
