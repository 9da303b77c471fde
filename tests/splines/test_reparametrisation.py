"""Curves at another speed pass through the same points, in order, at the speeds asked for."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from spline_oracles import curves, piece_value

from cqblend.errors import GeometryError, InputError
from cqblend.splines import Curve, change_of_parameter, interpolate, reparameterise, with_end_speeds

ARC = Curve.bezier([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], [1.0, np.sqrt(0.5), 1.0])
slopes = st.floats(0, 50).map(lambda x: round(x, 3))


def value(curve, t):
    found = piece_value(curve.breaks, curve.coefs, t)
    return found[:-1] / found[-1] if curve.rational else found


@given(curves(), slopes, slopes)
def test_composition_against_fractions(curve, a, b):
    change = change_of_parameter(a, b)
    moved = reparameterise(curve, change)
    for r in (Fraction(0), Fraction(1, 7), Fraction(5, 8), Fraction(1)):
        expected = value(curve, min(value(change, r)[0], Fraction(1)))
        assert np.abs(value(moved, r) - expected).max() < 1e-11


@given(slopes, slopes)
def test_changes_of_parameter(a, b):
    change = change_of_parameter(a, b)
    assert change.degree == (3 if a + b <= 3 else 2)
    assert change.rational == (a + b > 3)
    assert change([0.0, 1.0]).ravel().tolist() == [0.0, 1.0]
    np.testing.assert_allclose(change([0.0, 1.0], 1).ravel(), [a, b], rtol=1e-14, atol=1e-14)
    if change.rational:  # Gregory and Delbourgo's form
        r = np.linspace(0, 1, 33)
        s = r * (1 - r)
        np.testing.assert_allclose(change(r)[:, 0], (r**2 + a * s) / (1 + (a + b - 2) * s), rtol=0, atol=1e-14)
    assert (change(np.linspace(0, 1, 200), 1) >= -1e-14).all()
    assert (change(np.linspace(0.01, 0.99, 200), 1) > 0).all()


def test_changes_between_other_intervals():
    for a, b in ((0.2, 0.3), (7.0, 0.0)):
        change = change_of_parameter(a, b, domain=(2, 7), onto=(-1, 3))
        np.testing.assert_allclose(change([2, 7])[:, 0], [-1, 3], rtol=0, atol=1e-15)
        np.testing.assert_allclose(change([2, 7], 1)[:, 0], [a, b], rtol=0, atol=1e-14)


@given(curves(rational=False), st.floats(0.01, 30), st.floats(0.01, 30))
def test_end_speeds(curve, start, end):
    speeds = np.linalg.norm(np.stack([curve(0.0, 1), curve(1.0, 1, side="left")]), axis=1)
    assume(speeds.min() > 1e-3)
    moved = with_end_speeds(curve, start, end, domain=(3, 5))
    found = np.linalg.norm(np.stack([moved(3.0, 1), moved(5.0, 1, side="left")]), axis=1)
    np.testing.assert_allclose(found, [start, end], rtol=1e-12, atol=1e-12)  # points are of size 2
    np.testing.assert_allclose(moved([3.0, 5.0]), curve([0.0, 1.0]), rtol=0, atol=1e-14)


def test_unit_speed_at_the_ends_of_a_circle():
    """The paper's |t'| = 1/|C'|, at both ends of a rational arc, in exact coefficients."""
    moved = with_end_speeds(ARC)
    np.testing.assert_allclose(np.linalg.norm(moved([0.0, 1.0], 1), axis=1), 1, rtol=1e-13)
    np.testing.assert_allclose(np.linalg.norm(moved(np.linspace(0, 1, 100)), axis=1), 1, rtol=1e-14)


def test_standing_starts():
    """Zero speed at both ends, and the same points in between."""
    moved = with_end_speeds(ARC, 0, 0)
    assert np.abs(moved([0.0, 1.0], 1)).max() < 1e-14
    r = np.linspace(0, 1, 50)
    np.testing.assert_allclose(moved(r), ARC(r * r * (3 - 2 * r)), rtol=0, atol=1e-14)


def test_a_change_with_breaks():
    """A cubic spline through increasing values, composed with a curve that has breaks of its own."""
    r = np.linspace(0, 1, 8)
    change = interpolate(r, (r**2 / 2 + r / 2)[:, None])
    curve = interpolate(r, np.stack([np.cos(3 * r), np.sin(2 * r)], -1))
    moved = reparameterise(curve, change)
    x = np.linspace(0, 1, 77)
    np.testing.assert_allclose(moved(x), curve(x**2 / 2 + x / 2), rtol=0, atol=1e-13)
    assert (moved.continuity == 2).all()


def test_it_may_stand_still():
    """For the middle third."""
    change = Curve.from_bspline(1, [0, 0, 1, 2, 3, 3], [[0.0], [0.5], [0.5], [1.0]])
    moved = reparameterise(ARC, change)
    np.testing.assert_array_equal(moved(np.linspace(1, 2, 5)), np.broadcast_to(moved(1.0), (5, 2)))


@pytest.mark.parametrize(
    ("poles", "r"),
    [([0, 2, -1, 1], 0.5), ([0, -0.1, 0.5, 1], 0.0), ([0, 0.5, 1.1, 1], 1.0), ([0, 1.001, 0, 1], 0.5)],
)
def test_changes_that_turn_back(poles, r):
    """Also those that a dozen samples would not notice; the parameter named is one at which it decreases."""
    change = Curve.bezier(np.array(poles, dtype=float)[:, None])
    with pytest.raises(GeometryError, match=r"turns back at r = ([\d.]+)") as caught:
        reparameterise(ARC, change)
    found = float(str(caught.value).split("r = ")[1].split(":")[0])
    assert found == pytest.approx(r, abs=0.2)
    assert change(found, 1) < 0


def test_a_change_that_only_touches_a_halt():
    """Poles 0, 1, 0, 1: the slope is 3 (1 - 2r)^2."""
    change = Curve.bezier([[0.0], [1.0], [0.0], [1.0]])
    r = np.linspace(0, 1, 30)
    np.testing.assert_allclose(reparameterise(ARC, change)(r), ARC(change(r)[:, 0]), rtol=0, atol=1e-14)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (ARC, "dim 1, not 2"),
        (Curve.bezier([[0.0], [0.9]]), "from 0 at r = 0 to 0.9.* at r = 1, the domain of the curve is"),
        (Curve.bezier([[1.0], [0.0]]), "from 1 at r = 0 to 0 at r = 1"),
        (Curve([0, 1, 2], [[[0.0, 0.6]], [[0.5, 1.0]]]), "jumps at r = 1"),
        (Curve([0, 1], [[[0.0], [1.0]], [[0.5], [-2.0]], [[1.0], [1.0]]], rational=True), "weight at r = 0.5"),
    ],
)
def test_changes_that_are_none(change, message):
    with pytest.raises(InputError, match=message):
        reparameterise(ARC, change)


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: change_of_parameter(-1, 1), InputError, "start=-1: the slope"),
        (lambda: change_of_parameter(1, float("nan")), InputError, "end=nan"),
        (lambda: change_of_parameter(1, 1, domain=(1, 1)), InputError, "domain=.*not an interval"),
        (lambda: change_of_parameter(1, 1, onto=(1, 0)), InputError, "onto=.*lower end first"),
        (lambda: with_end_speeds(Curve.bezier([[1.0], [2.0], [2.0]])), GeometryError, "still at its end, t = 1"),
        (lambda: with_end_speeds(ARC, -2.0), InputError, "start="),
    ],
)
def test_what_is_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()
