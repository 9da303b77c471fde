"""Fields of a prescribed length: the error is proven, small, and what it says; measured in mpmath."""

import math
from fractions import Fraction
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from spline_oracles import clamped, curves, piece_value

from cqblend.errors import CqblendError, GeometryError, InputError
from cqblend.splines import SMOOTH, Curve, normalise
from cqblend.splines.field_normalisation import _differentiate_reciprocal_length

QUADRATIC = Curve.bezier([(1, 0, 0.2), (0.6, 0.9, -0.1), (-0.4, 0.7, 0.5)])
I = np.arange(13)  # noqa: E741  (as the figures to beat are stated)
CUBIC = Curve.from_bspline(
    3, clamped(3, 10), np.stack([I + 0.3 * np.sin(2 * I), 2 * np.sin(0.9 * I), 1.5 * np.cos(0.6 * I)], -1)
)
TABLE2 = Curve.from_bspline(2, clamped(2, 3), [(2.1, 0.7), (1.3, 2.4), (-0.7, 1.5), (-0.5, 0.3), (-3.0, -0.6)])
ROOT = math.sqrt(0.5)
CIRCLE = Curve.from_bspline(
    2,
    [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4],
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)],
    [1, ROOT, 1, ROOT, 1, ROOT, 1, ROOT, 1],
)


def off(field, length, t):
    """Difference between the length of a field and the length asked for at t, from the coefficients, exactly."""
    value = piece_value(field.breaks, field.coefs, Fraction(float(t)))
    if field.rational:
        value = value[:-1] / value[-1]
    with mpmath.workdps(40):
        square = sum(x * x for x in value)
        return float(abs(mpmath.sqrt(mpmath.mpf(square.numerator) / square.denominator) - abs(length)))


def measured(unit, length=1.0, samples=60):
    """Largest of these differences on a grid, refined by the places where floats see the largest."""
    lo, hi = unit.field.domain
    dense = np.linspace(lo, hi, 4001)
    k = np.broadcast_to(length(dense)[:, 0] if isinstance(length, Curve) else length, dense.shape)
    found = np.abs(np.linalg.norm(unit.field(dense), axis=1) - np.abs(k))
    chosen = np.unique(np.concatenate([np.argsort(found)[-10:], np.arange(0, 4001, 4000 // samples)]))
    return max(off(unit.field, float(k[i]), dense[i]) for i in chosen)


def same_as_bspline(curve, tolerance=1e-13):
    t = np.linspace(*curve.domain, 301)
    np.testing.assert_allclose(Curve.from_bspline(*curve.to_bspline())(t), curve(t), rtol=0, atol=tolerance)


# -- the figures


@pytest.mark.parametrize(("field", "tolerance", "poles"), [(QUADRATIC, 1e-5, 18), (CUBIC.derivative(), 1e-4, 200)])
def test_figures_to_beat(field, tolerance, poles):
    unit = normalise(field, tolerance)
    assert measured(unit) <= unit.error <= tolerance
    assert len(unit.field.to_bspline()[2]) <= poles
    same_as_bspline(unit.field)


@pytest.mark.parametrize("exponent", range(1, 14))
@pytest.mark.parametrize("field", [QUADRATIC, CUBIC.derivative()], ids=["quadratic", "cubic"])
def test_the_error_is_proven_and_sharp(field, exponent):
    tolerance = 10.0**-exponent
    unit = normalise(field, tolerance)
    error = measured(unit)
    assert error <= unit.error <= tolerance
    assert unit.error <= 1.3 * error + 3e-14


def test_table_2():
    """Second order: each row against the paper's."""
    t = np.linspace(0, 1, 2001)
    assert np.abs(np.linalg.norm(TABLE2(t), axis=1) - 1).max() == pytest.approx(2.025, rel=0.03)
    for knots, paper in ((3, 0.25), (6, 0.08333), (12, 0.02571)):
        unit = normalise(TABLE2, math.inf, method="schoenberg", knots=knots)
        assert measured(unit) <= unit.error <= 1.1 * measured(unit)
        assert unit.error == pytest.approx(paper, rel=0.1)
    fine = [normalise(TABLE2, math.inf, method="schoenberg", knots=knots).error for knots in (47, 95, 191)]
    for coarse, finer in pairwise(fine):
        assert 3.5 < coarse / finer < 4.5


def test_schoenberg_is_what_the_paper_says():
    """Degree and knots of <T, T>, and its poles k as 1/sqrt(k), on a Bezier field where they are coefficients."""
    unit = normalise(QUADRATIC, math.inf, method="schoenberg", knots=0)
    squared = QUADRATIC.dot(QUADRATIC).coefs
    np.testing.assert_allclose(unit.factor.coefs, 1 / np.sqrt(squared), rtol=1e-14)
    refined = normalise(TABLE2, math.inf, method="schoenberg", knots=6)
    degree, knots, poles, _ = refined.factor.to_bspline()
    assert degree == 4
    inner, repeats = np.unique(knots[5:-5], return_counts=True)
    np.testing.assert_allclose(inner, np.unique(np.round([*np.arange(1, 7) / 7, 1 / 3, 2 / 3], 12)), atol=1e-11)
    assert (repeats == 3).all()
    assert len(poles) == 5 + 3 * 8


def test_schoenberg_refines_where_it_must():
    """A field that turns quickly in the middle, where <T, T> has a negative coefficient to begin with."""
    field = Curve.bezier([(-1.0, 0.1), (1.3, 0.1)])
    unit = normalise(field, 1e-3, method="schoenberg")
    assert measured(unit) <= unit.error <= 1e-3
    steps = np.diff(unit.field.breaks)
    assert steps.max() >= 4 * steps.min()
    with pytest.raises(GeometryError, match=r"with 2 knots inserted .* give more"):
        normalise(field, 1e-3, method="schoenberg", knots=2)


# -- what the result is


def test_factor_times_field():
    for field in (QUADRATIC * 3e5, CUBIC.derivative(), CIRCLE.derivative()):
        unit = normalise(field, 1e-6)
        t = np.linspace(*field.domain, 997)
        np.testing.assert_allclose(unit.factor(t) * field(t), unit.field(t), rtol=0, atol=1e-13)
        assert unit.factor.dim == 1


def test_a_smooth_factor_where_the_field_is_smooth():
    """C2 between the field's breaks, and as smooth as the field, up to C2, across them."""
    for field, order in ((CUBIC.derivative(), 1), (CUBIC, 2)):
        factor = normalise(field, 1e-8).factor
        known = factor.continuity
        of_field = np.isin(factor.breaks[1:-1], field.breaks)
        assert (known[of_field] == order).all()
        assert (known[~of_field] == 2).all()
        at = factor.breaks[1:-1]
        for k in range(3):
            jump = np.abs(factor(at, k) - factor(at, k, side="left"))[known >= k]
            assert jump.max() <= 1e-10 * np.abs(factor(at, k)).max()


def test_a_break_that_no_function_needs_is_not_kept():
    plain, cut = normalise(QUADRATIC, 1e-6), normalise(QUADRATIC.cut([0.2, 0.77]), 1e-6)
    assert plain.factor.degree == cut.factor.degree
    assert len(cut.factor.breaks) == 2


def test_refinement_only_where_the_error_is():
    """Nearly zero at .4, straight elsewhere: the pieces crowd there."""
    field = Curve.bezier([(-0.8, 1e-3), (1.2, 1e-3)])
    unit = normalise(field, 1e-7)
    assert measured(unit) <= unit.error <= 1e-7
    breaks = unit.field.breaks
    narrow = np.diff(breaks).argmin()
    assert abs(breaks[narrow] - 0.4) < 0.01
    assert np.diff(breaks).max() > 50 * np.diff(breaks).min()


@pytest.mark.parametrize("closeness", [1e-4, 1e-6, 1e-8])
def test_nearly_zero_fields(closeness):
    unit = normalise(Curve.bezier([(-1.0, closeness), (1.3, closeness)]), 1e-6)
    t = 10 / 23 + closeness * np.linspace(-5, 5, 41)
    assert max(off(unit.field, 1.0, x) for x in t) <= unit.error <= 1e-6


def test_constant_length_needs_only_a_number():
    assert normalise(Curve.bezier([(3.0, 4.0)]), 1e-14).factor == Curve.bezier([[0.2]])
    assert normalise(Curve.bezier([(3.0, 4.0), (3.0, 4.01)]), 1e-2).factor.degree == 0


def test_rational_fields_become_polynomial():
    """The tangent of the NURBS circle, and its points: unit vectors, in a plane, turned by a right angle."""
    velocity, point = normalise(CIRCLE.derivative(), 1e-10), normalise(CIRCLE, 1e-10)
    for unit in (velocity, point):
        assert not unit.field.rational
        assert measured(unit) <= unit.error <= 1e-10
    t = np.linspace(0, 4, 501)
    x, y = CIRCLE(t).T
    np.testing.assert_allclose(point.field(t), np.stack([x, y], -1), rtol=0, atol=1e-10)
    np.testing.assert_allclose(velocity.field(t), np.stack([-y, x], -1), rtol=0, atol=1e-10)


@pytest.mark.parametrize("method", ["hermite", "schoenberg"])
@pytest.mark.parametrize(
    "length",
    [2.5, -3.0, Curve.bezier([[1.0], [3.0], [-0.5]]), Curve.bezier([[1.0], [2.0]], [1.0, 4.0])],
    ids=["constant", "reversed", "quadratic", "rational"],
)
def test_lengths(length, method):
    unit = normalise(QUADRATIC, 1e-3, length=length, method=method)
    assert measured(unit, length) <= unit.error <= 1e-3
    t = np.linspace(0, 1, 50)
    k = length(t) if isinstance(length, Curve) else length
    straight = k * QUADRATIC(t) / np.linalg.norm(QUADRATIC(t), axis=1, keepdims=True)
    np.testing.assert_allclose(unit.field(t), straight, rtol=0, atol=1e-3)
    np.testing.assert_allclose(unit.factor(t) * QUADRATIC(t), unit.field(t), rtol=0, atol=1e-13)


@settings(max_examples=40)
@given(curves(), st.integers(2, 9))
def test_any_field(field, exponent):
    """Either the promise is kept, with the direction unchanged, or the reason is that the field has hardly a length."""
    tolerance = 10.0**-exponent
    try:
        unit = normalise(field, tolerance)
    except GeometryError:
        t = np.linspace(0, 1, 2001)
        lengths = np.linalg.norm(field(t), axis=1)
        assert lengths.min() < 1e-2 * lengths.max()
        return
    assert measured(unit, samples=20) <= unit.error <= tolerance
    t = np.linspace(0, 1, 101)
    expected = field(t) / np.linalg.norm(field(t), axis=1, keepdims=True)
    np.testing.assert_allclose(unit.field(t), expected, rtol=0, atol=2 * tolerance)
    same_as_bspline(unit.field, 1e-11)


def test_the_derivatives_of_a_reciprocal_length():
    """Against mpmath's Taylor series of 1/|T| for T = (1 + t, t^2 - 2, 3 t^3)."""
    at = mpmath.mpf("0.3")
    with mpmath.workdps(40):
        series = mpmath.taylor(lambda t: 1 / mpmath.sqrt((1 + t) ** 2 + (t**2 - 2) ** 2 + 9 * t**6), at, 4)
        expected = [float(c * math.factorial(k)) for k, c in enumerate(series)]
    t = 0.3
    jets = [
        [1 + t, t**2 - 2, 3 * t**3],
        [1, 2 * t, 9 * t**2],
        [0, 2, 18 * t],
        [0, 0, 18],
        [0, 0, 0],
    ]
    np.testing.assert_allclose(_differentiate_reciprocal_length(np.array(jets, dtype=float)), expected, rtol=1e-13)


def test_a_field_may_jump():
    field = Curve([0, 1, 2], [[[1.0, 3.0], [1.0, 0.0]], [[2.0, 5.0], [0.0, 1.0]]])
    unit = normalise(field, 1e-6)
    assert measured(unit) <= unit.error <= 1e-6
    assert unit.field.continuity.tolist() == [-1]


def test_sizes_far_from_one():
    for size in (1e200, 1e-200):
        unit = normalise(QUADRATIC * size, 1e-8)
        assert measured(unit) <= unit.error <= 1e-8
        assert unit.field.continuity.size == 0 or unit.field.continuity.max() <= SMOOTH


# -- what is refused


@pytest.mark.parametrize(
    ("field", "where"),
    [
        (Curve.bezier([(-1.0, -2.0), (1.0, 2.0)]), "t = 0.5"),
        (Curve.bezier([(1.0, 1.0), (-1.0, -1.0), (1.0, 1.0)]), "t = 0.5"),
        (Curve.bezier([(0.0, 0.0), (1.0, 2.0)]), "t = 0,"),
        (Curve.bezier([(-1.0, -2.0), (2.0, 4.0)], [1.0, 3.0], domain=(4, 5)), "t = 4.14285714"),
        (Curve.bezier([(0.0, 0.0), (0.0, 0.0)]), "zero everywhere"),
    ],
)
@pytest.mark.parametrize("method", ["hermite", "schoenberg"])
def test_fields_without_a_direction(field, where, method):
    with pytest.raises(GeometryError, match=where):
        normalise(field, 1e-3, method=method)


@pytest.mark.parametrize("tolerance", [0.0, -1e-3, math.nan])
def test_tolerances_that_are_none(tolerance):
    with pytest.raises(InputError, match=r"tolerance .* must be positive"):
        normalise(QUADRATIC, tolerance)


def test_tolerances_out_of_reach():
    with pytest.raises(GeometryError, match=r"within a relative 1e-17: it is shortest near t = 0\.\d+"):
        normalise(QUADRATIC, 1e-17)
    with pytest.raises(GeometryError, match="no 4096 pieces"):
        normalise(QUADRATIC, 1e-10, method="schoenberg")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"method": "fast"}, "method 'fast': choose"),
        ({"knots": 3}, "knots=3: .*schoenberg"),
        ({"knots": -1, "method": "schoenberg"}, "knots=-1"),
        ({"length": 0.0}, "not zero everywhere"),
        ({"length": math.nan}, "must be finite"),
        ({"length": QUADRATIC}, "dim 1, not 3"),
        ({"length": Curve.bezier([[1.0]], domain=(0, 2))}, "domains .* differ"),
    ],
)
def test_arguments_that_make_no_sense(options, message):
    with pytest.raises(InputError, match=message):
        normalise(QUADRATIC, 1e-3, **options)


def test_fields_that_are_not_numbers():
    with np.errstate(over="ignore", invalid="ignore"):
        field = QUADRATIC * 1e200 * Curve.bezier([[1e200]])
    with pytest.raises(InputError, match="not a finite number"):
        normalise(field, 1e-3)
    with pytest.raises(CqblendError, match="weight"):
        normalise(Curve([0, 1], [[[1.0], [1.0]], [[1.0], [-1.0]]], rational=True), 1e-3)
