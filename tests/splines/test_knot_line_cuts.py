"""S.compose(c)(t) == S(*c(t)), wherever the curve runs."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from spline_oracles import clamped, curves, exact, parameters, piece_value, quarter_arc, surface_value, surfaces, wavy

from cqblend.splines import Curve, Surface

WAVY = Surface.from_bspline(*wavy())
LINE = Curve.bezier([[0.03, 0.07], [0.97, 0.91]])
CUBIC = Curve.bezier([[0.05, 0.10], [0.40, 0.95], [0.65, 0.05], [0.95, 0.90]])
_I = np.arange(8)
UV_SPLINE = Curve.from_bspline(3, clamped(3, 5), np.stack([0.05 + 0.9 * _I / 7, 0.5 + 0.4 * np.sin(1.3 * _I)], -1))
T = np.linspace(0, 1, 101)


def follows(surface, curve, t=T, tolerance=1e-13):
    """Compose and check values everywhere and the chain rule; returns the composition."""
    result = surface.compose(curve)
    uv = curve(t)
    truth = surface(uv[..., 0], uv[..., 1])
    np.testing.assert_allclose(result(t), truth, rtol=0, atol=tolerance * (1 + np.abs(truth).max()))
    return result


@pytest.mark.parametrize(
    ("curve", "degree"),
    [(LINE, 6), (CUBIC, 18), (UV_SPLINE, 18), (quarter_arc(), 12)],
    ids=["line", "cubic", "spline", "arc"],
)
def test_the_wavy_surface_exactly(curve, degree):
    """Against de Boor in fractions of the original B-spline: 1e-14 of the surface's size, and the arc as well."""
    result = WAVY.compose(curve)
    assert result.degree == degree
    assert (result.continuity >= 2).all()
    worst = 0.0
    for t in np.random.default_rng(0).uniform(0, 1, 25):
        t = exact(t)[()]
        value = piece_value(curve.breaks, curve.coefs, t)
        u, v = value[:2] / value[2] if curve.rational else value
        truth = surface_value(wavy(), u, v)
        got = piece_value(result.breaks, result.coefs, t)
        got = got[:3] / got[3] if result.rational else got
        worst = max(worst, float(np.abs(got - truth).max()))
    assert worst < 1e-14


@pytest.mark.parametrize("p", [5, 8])
def test_degrees_30_and_48(p):
    data = wavy(p, 10)
    surface, rail = Surface.from_bspline(*data), UV_SPLINE
    result = surface.compose(rail)
    assert result.degree == 6 * p
    for t in np.random.default_rng(0).uniform(0, 1, 6):
        t = exact(t)[()]
        truth = surface_value(data, *piece_value(rail.breaks, rail.coefs, t))
        assert float(np.abs(piece_value(result.breaks, result.coefs, t) - truth).max()) < 1e-14


@pytest.mark.parametrize("curve", [LINE, CUBIC, UV_SPLINE, quarter_arc()], ids=["line", "cubic", "spline", "arc"])
def test_reassembled_compositions_equal_their_pieces(curve):
    """C2 joints at degree 18 cost no digits, with crossings at random distances."""
    result = WAVY.compose(curve)
    degree, knots, poles, weights = result.to_bspline()
    inner = knots[degree + 1 : -degree - 1]
    assert np.unique(inner, return_counts=True)[1].max() <= degree - 2
    back = Curve.from_bspline(degree, knots, poles, weights)
    np.testing.assert_array_equal(back.breaks, result.breaks)
    assert np.abs(back.coefs - result.coefs).max() < 1e-13


@given(surfaces(), curves(dim=2, most=3), parameters)
def test_composition_is_pointwise(s, c, t):
    """The curves of this strategy run far outside the surface as well: end patches go on as polynomials."""
    c = 0.2 * c + [0.5, 0.5]
    lo, hi = c.bounds()
    if s.rational and (lo.min() < 0 or hi.max() > 1):
        return  # continued weights may vanish
    follows(s, c, t, 1e-11)


@given(surfaces(), curves(dim=2, most=3), parameters)
def test_chain_rule(s, c, t):
    lo, hi = c.bounds()
    c = (c - (lo + hi) / 2) * (1 / (hi - lo)) + [0.5, 0.5]
    result = s.compose(c)
    off = np.abs(t[:, None] - result.breaks).min(axis=1) > 1e-6
    t = t[off]
    uv, d = c(t), c(t, 1)
    jet = s.jet(uv[:, 0], uv[:, 1], 1)
    expected = jet[1, 0] * d[:, :1] + jet[0, 1] * d[:, 1:]
    np.testing.assert_allclose(result(t, 1), expected, rtol=0, atol=1e-7 * (1 + np.abs(expected).max(initial=0)))


def test_result_is_as_smooth_as_claimed():
    for curve in (LINE, CUBIC, UV_SPLINE, quarter_arc()):
        result = WAVY.compose(curve)
        at, h = result.breaks[1:-1], np.diff(result.breaks)
        for k in range(3):  # rounding of a piece's coefficients grows by degree / length with each derivative
            jump = np.abs(result(at, k) - result(at, k, side="left")).max(axis=1)
            assert (jump < 1e-15 * (2 * result.degree / np.minimum(h[:-1], h[1:])) ** k).all()


def test_crossings_are_found_to_full_precision():
    t = WAVY.crossings(LINE)
    u = (np.arange(1, 10) / 10 - 0.03) / 0.94
    v = (np.arange(1, 10) / 10 - 0.07) / 0.84
    np.testing.assert_allclose(t, np.sort(np.concatenate([u, v])), rtol=0, atol=4e-16)
    np.testing.assert_allclose(WAVY.crossings(LINE, axis=1), v, rtol=0, atol=4e-16)
    for t in WAVY.crossings(CUBIC):
        assert np.abs(CUBIC(t)[:, None] * 10 - np.arange(11)).min() < 1e-14


def test_crossings_against_fractions():
    """Each crossing of the cubic is bracketed by exact arithmetic within two units in the last place."""
    exact_coefs = exact(CUBIC.coefs[..., 0])
    for axis in (0, 1):
        for t in WAVY.crossings(CUBIC, axis):
            lines = [Fraction(x) for x in WAVY.breaks[axis]]
            before, after = (
                piece_value(CUBIC.breaks, CUBIC.coefs, Fraction(t) + sign * Fraction(1, 2**51))[axis]
                for sign in (-1, 1)
            )
            assert any((before - line) * (after - line) <= 0 for line in lines)
    assert len(exact_coefs) == 4


def creased(order):
    """Two by two patches whose derivative of order + 1 jumps strongly at u = 1/2 and v = 1/2."""
    p = order + 1
    knots = np.concatenate([np.zeros(p + 1), [0.5], np.ones(p + 1)])
    rng = np.random.default_rng(order)
    return Surface.from_bspline((p, p), (knots, knots), rng.uniform(-1, 1, (p + 2, p + 2, 3)))


@pytest.mark.parametrize("order", [0, 1, 2])
class TestSpecialPositions:
    def test_tangent_to_a_line(self, order):
        touching = Curve.bezier([[0.1, 0.75], [0.5, 0.25], [0.9, 0.75]])  # v = 1/2 at t = 1/2, from above
        result = follows(creased(order), touching)
        np.testing.assert_allclose(creased(order).crossings(touching), [0.5], atol=1e-15)  # the u line only
        assert creased(order).crossings(touching, axis=1).size == 0
        assert len(result.breaks) == 3

    def test_tangent_at_an_irrational_parameter(self, order):
        base = Curve.bezier([[0.1, 0.9], [0.2, -0.31], [0.3, 0.87]])
        t = -base(0.0, 1)[1] / base(0.0, 2)[1]
        touching = base + np.array([0, 0.5 - base(t)[1]])
        result = follows(creased(order), touching)
        assert len(result.breaks) <= 4

    def test_crossing_with_high_contact(self, order):
        inflected = Curve.bezier([[0.1, 0.3], [0.3, 0.5], [0.6, 0.5], [0.9, 0.5], [0.95, 0.5], [1.0, 0.8]])
        follows(creased(order), inflected)
        cubic = Curve.bezier(
            [[0.1, 0.5 - 0.027], [0.2, 0.5 + 0.063], [0.3, 0.5 - 0.147], [0.4, 0.5 + 0.343]]
        )  # (t - .3)^3
        result = follows(creased(order), cubic, tolerance=1e-13)
        assert len(result.breaks) == 3
        assert abs(result.breaks[1] - 0.3) < 1e-4

    def test_along_a_line(self, order):
        s = creased(order)
        for curve in (
            Curve.bezier([[0.1, 0.5], [0.9, 0.5]]),
            Curve.bezier([[0.5, 0.1], [0.5, 0.4], [0.5, 0.9]]),
            Curve.bezier([[0.5, 0.1], [0.5, 0.9]], [1.0, 0.3]),
            Curve.from_bspline(3, clamped(3, 7), np.stack([np.linspace(0.1, 0.9, 10), np.full(10, 0.5)], -1)),
            Curve.from_bspline(3, clamped(3, 7), np.stack([np.full(10, 0.5), np.linspace(0.1, 0.9, 10)], -1)),
        ):
            follows(s, curve)
            assert len(s.crossings(curve)) <= 1

    def test_along_a_line_with_rounding_noise(self, order):
        rng = np.random.default_rng(3)
        v = 0.5 + rng.uniform(-1, 1, 20) * 1e-16
        curve = Curve.from_bspline(3, clamped(3, 17), np.stack([np.linspace(0.1, 0.4, 20), v], -1))
        s = creased(order)
        follows(s, curve)
        assert s.crossings(curve).size == 0

    def test_joins_and_leaves_a_line(self, order):
        v = np.array([0.2, 0.3, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5, 0.7, 0.9])
        curve = Curve.from_bspline(3, clamped(3, 7), np.stack([np.linspace(0.1, 0.9, 10), v], -1))
        s = creased(order)
        result = follows(s, curve)
        assert len(s.crossings(curve, axis=1)) == 1
        at = result.breaks[1:-1]
        for k in range(order + 1):
            np.testing.assert_allclose(result(at, k), result(at, k, side="left"), rtol=0, atol=1e-10)

    def test_backtracking(self, order):
        curve = Curve.bezier([[0.3, 0.3], [1.1, 0.9], [0.1, 0.6], [0.3, 0.1]])
        s = creased(order)
        follows(s, curve)
        assert len(s.crossings(curve)) >= 2
        follows(s, Curve.bezier([[0.2, 0.2], [1.2, 1.2], [0.2, 0.2]]))

    def test_constant_curve(self, order):
        s = creased(order)
        for point in ([0.3, 0.8], [0.5, 0.5], [0.0, 1.0]):
            result = s.compose(Curve.bezier([point, point]))
            np.testing.assert_allclose(result(T), np.broadcast_to(s(*point), (101, 3)), rtol=0, atol=1e-15)

    def test_through_a_corner(self, order):
        s = creased(order)
        diagonal = Curve.bezier([[0.1, 0.1], [0.9, 0.9]])
        assert len(follows(s, diagonal).breaks) == 3
        near = Curve.bezier([[0.1, 0.1], [0.9, 0.9 + 1e-11]])
        follows(s, near)
        assert len(s.compose(near).breaks) == (4 if order == 0 else 3)

    def test_starts_and_ends_on_lines(self, order):
        s = creased(order)
        result = follows(s, Curve.bezier([[0.5, 0.1], [0.8, 0.2], [0.9, 0.5]]))
        assert len(result.breaks) == 2
        bent = Curve(
            [0, 1, 2], np.array([[[0.1, 0.5], [0.2, 0.3]], [[0.5, 0.9], [0.3, 0.8]]])
        )  # its break is a crossing
        result = follows(s, bent, 2 * T)
        assert 1.0 in result.breaks

    def test_outside_the_domain(self, order):
        s = creased(order)
        result = follows(s, Curve.bezier([[-0.3, 0.2], [1.4, 0.7]]), tolerance=1e-12)
        assert len(result.breaks) == 3 if order < 0 else len(result.breaks) <= 4


def test_isoparametric_rails_keep_their_degree():
    straight = Curve.bezier([[0.33, 0.1], [0.33, 0.9]])
    result = follows(WAVY, straight)
    assert result.degree == 3
    np.testing.assert_allclose(result(T), WAVY.isoparametric(u=0.33)(0.1 + 0.8 * T), rtol=0, atol=1e-14)


def test_rational_curve_in_rational_surface():
    poles, weights = wavy()[2], np.random.default_rng(0).uniform(0.5, 2, (13, 13))
    data = (3, 3), wavy()[1], poles, weights
    surface, arc = Surface.from_bspline(*data), quarter_arc()
    result = follows(surface, arc)
    for t in (0.1, 0.5, 0.77):
        t = exact(t)[()]
        x, y, w = piece_value(arc.breaks, arc.coefs, t)
        got = piece_value(result.breaks, result.coefs, t)
        assert float(np.abs(got[:3] / got[3] - surface_value(data, x / w, y / w)).max()) < 1e-14


@given(curves(dim=2, most=3), curves(dim=1, most=3, rational=False), parameters)
def test_curve_of_a_parameter(f, g, t):
    lo, hi = g.bounds()
    g = (g - (lo + hi) / 2) * (0.5 / (hi - lo)) + 0.5
    np.testing.assert_allclose(f.compose(g)(t), f(g(t)[:, 0]), rtol=0, atol=1e-11)


@given(curves(dim=2, most=3), st.floats(0.2, 5), parameters)
def test_projective_reparametrization(f, w, t):
    g = Curve.bezier([[0.0], [1.0]], [1.0, w])
    np.testing.assert_allclose(f.compose(g)(t), f(g(t)[:, 0]), rtol=0, atol=1e-11)
