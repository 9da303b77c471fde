"""B-splines in and out: extraction against de Boor in fractions, re-assembly against the pieces it came from."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from spline_oracles import clamped, cox_de_boor, de_boor, exact, piece_value

from cqblend.errors import InputError
from cqblend.splines import SMOOTH, Curve, knots


@st.composite
def bsplines(draw, most=7):
    """Degree, knots with any multiplicities, clamped or not, and poles of dim 2."""
    p = draw(st.integers(0, most))
    steps = draw(st.lists(st.integers(0, 3), min_size=2 * p + 2, max_size=2 * p + 8))
    values = np.cumsum(steps)
    vector = [values[0]]
    for value in values[1:]:  # keep multiplicities at p + 1
        vector.append(vector[-1] + 1 if vector.count(value) > p or value < vector[-1] else value)
    vector = np.array(vector, dtype=float)
    n = len(vector) - p - 1
    if vector[p] == vector[n]:
        vector[n:] += 1
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return p, vector, rng.uniform(-1, 1, (n, 2))


@given(bsplines(), st.fractions(0, 1))
def test_extraction_agrees_with_de_boor(bspline, x):
    p, vector, poles = bspline
    f = Curve.from_bspline(p, vector, poles)
    a, b = Fraction(vector[p]), Fraction(vector[len(poles)])
    t = a + x * (b - a)
    if t == b:
        return
    truth = de_boor(p, exact(vector), exact(poles), t)
    assert np.abs(exact(f(float(t))) - truth).max() < 1e-13
    assert np.abs(piece_value(f.breaks, f.coefs, t) - truth).max() < 1e-15 * (p + 1)


@given(bsplines(most=4), st.fractions(0, 1, max_denominator=50))
def test_extraction_agrees_with_the_definition(bspline, x):
    p, vector, poles = bspline
    t = Fraction(vector[p]) + x * (Fraction(vector[len(poles)]) - Fraction(vector[p]))
    if x == 1:
        return
    truth = sum(cox_de_boor(i, p, exact(vector), t) * pole for i, pole in enumerate(exact(poles)))
    f = Curve.from_bspline(p, vector, poles)
    assert np.abs(piece_value(f.breaks, f.coefs, t) - truth).max() < 1e-15 * (p + 1)


@given(bsplines())
def test_round_trip(bspline):
    p, vector, poles = bspline
    f = Curve.from_bspline(p, vector, poles)
    degree, back_knots, back_poles, weights = f.to_bspline()
    assert degree == p
    assert weights is None
    if knots.is_clamped(p, vector):
        assert (back_knots == vector).all()
        assert (back_poles == poles).all()
    again = Curve.from_bspline(degree, back_knots, back_poles)
    t = np.linspace(f.breaks[0], f.breaks[-1], 57)
    assert np.abs(again(t) - f(t)).max() < 1e-13


@pytest.mark.parametrize("p", [1, 2, 3, 5, 9, 18, 30, 48])
@pytest.mark.parametrize("continuity", [0, 1, 2, 3, 4, 47])
def test_reassembly_equals_the_pieces(p, continuity):
    """Ten spans of very different lengths; the pieces know nothing of the B-spline they came from."""
    continuity = min(continuity, p - 1)
    rng = np.random.default_rng(p)
    inner = np.sort(rng.uniform(0, 1, 9))
    inner[4] = inner[3] + 1e-6
    vector = np.concatenate([np.zeros(p + 1), np.repeat(inner, p - continuity), np.ones(p + 1)])
    source = Curve.from_bspline(p, vector, rng.uniform(-1, 1, (len(vector) - p - 1, 2)))
    f = Curve(source.breaks, source.coefs, continuity=source.continuity)
    back = Curve.from_bspline(*f.to_bspline())
    assert (back.breaks == f.breaks).all()
    assert np.abs(back.coefs - f.coefs).max() < 1e-13
    if continuity <= 2:
        assert len(f.to_bspline()[1]) == len(vector)  # no knot more than needed


def test_reassembly_is_minimal_for_products_of_cubics():
    f = Curve.from_bspline(3, clamped(3, 50), np.sin(np.arange(53.0))[:, None])
    assert len((f * f).to_bspline()[2]) == 203


def test_a_break_without_meaning_goes():
    f = Curve.bezier([[0.0], [1.0], [-1.0], [2.0]])
    cut = f.cut([0.5])
    assert cut.continuity.tolist() == [SMOOTH]
    _, vector, poles, _ = cut.to_bspline()
    assert vector.tolist() == [0] * 4 + [1] * 4
    assert np.abs(poles - [[0], [1], [-1], [2]]).max() < 1e-14


def test_discontinuous_pieces_stay_apart():
    f = Curve([0, 1, 2], np.array([[0.0, 5.0], [1.0, 6.0]])[:, None, :])
    assert f.continuity.tolist() == [-1]
    back = Curve.from_bspline(*f.to_bspline())
    assert back == f


@pytest.mark.parametrize(
    ("degree", "vector", "count", "message"),
    [
        (-1, [0, 1], 2, "negative"),
        (2, [0, 0, 0, 1, 1], 3, "has 6"),
        (2, [0, 0, 1, 1, 1], 2, "too few"),
        (1, [0, 0, 2, 1, 1], 3, "knot 3 is 1"),
        (1, [0, 0, np.nan, 1, 1], 3, "finite"),
        (1, [0, 1, 1, 2], 2, "empty"),
        (1, [0, 0, 1, 1, 1, 2, 2], 5, "repeated 3 times"),
    ],
)
def test_bad_knots_are_named(degree, vector, count, message):
    with pytest.raises(InputError, match=message):
        Curve.from_bspline(degree, vector, np.zeros((count, 2)))


@pytest.mark.parametrize(
    ("poles", "weights", "message"),
    [
        ([[0.0], [np.inf]], None, "not finite"),
        ([[0.0], [1.0]], [1.0], "shape"),
        ([[0.0], [1.0]], [1.0, 0.0], "positive"),
        ([0.0, 1.0], None, "axes"),
        ("ab", None, "numbers"),
    ],
)
def test_bad_poles_are_named(poles, weights, message):
    with pytest.raises(InputError, match=message):
        Curve.from_bspline(1, [0, 0, 1, 1], poles, weights)
