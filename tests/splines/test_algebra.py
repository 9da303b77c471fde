"""What the algebra of curves and surfaces claims about the functions they stand for."""

import copy
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from spline_oracles import clamped, curves, exact, parameters, piece_value, quarter_arc, surfaces, wavy

from cqblend.errors import CqblendError, GeometryError, InputError
from cqblend.splines import SMOOTH, Curve, Surface, hermite


def close(a, b, tolerance=1e-12):
    scale = 1 + np.abs(b).max(initial=0)
    np.testing.assert_allclose(a, b, rtol=0, atol=tolerance * scale)


@given(curves(), curves(), curves(dim=1), parameters)
def test_curve_algebra_is_pointwise(f, g, h, t):
    close((f + g)(t), f(t) + g(t))
    close((f - g)(t), f(t) - g(t))
    close((h * g)(t), h(t) * g(t))
    close((g * h)(t), h(t) * g(t))
    close(f.dot(g)(t), (f(t) * g(t)).sum(-1, keepdims=True))
    close(f.cross(g)(t), np.cross(f(t), g(t)))
    close((-f * 2 + [1, 2, 3])(t), -2 * f(t) + [1, 2, 3])
    close((1 - h / 2)(t), 1 - h(t) / 2)
    close((np.array([1.0, 2.0, 3.0]) * f)(t), f(t) * [1, 2, 3])
    close((np.float64(2) * f)(t), 2 * f(t))
    close(f[:2].cross(g[:2])(t)[..., 0], f(t)[..., 0] * g(t)[..., 1] - f(t)[..., 1] * g(t)[..., 0])
    close(Curve.stack([h, f])(t), np.concatenate([h(t), f(t)], axis=-1))


@given(surfaces(), surfaces(), surfaces(dim=1), parameters, parameters)
def test_surface_algebra_is_pointwise(f, g, h, u, v):
    u, v = u[:, None], v
    close((f + g)(u, v), f(u, v) + g(u, v))
    close((f - g)(u, v), f(u, v) - g(u, v))
    close((h * g)(u, v), h(u, v) * g(u, v))
    close(f.dot(g)(u, v), (f(u, v) * g(u, v)).sum(-1, keepdims=True))
    close(f.cross(g)(u, v), np.cross(f(u, v), g(u, v)))
    close((2 * f - 1)(u, v), 2 * f(u, v) - 1)


@given(curves(), curves(), st.floats(0, 1))
def test_leibniz(f, g, t):
    product = f.dot(g)
    close(product.derivative()(t), (f.derivative().dot(g) + f.dot(g.derivative()))(t), 1e-11)
    a, b = f.jet(t, 3), g.jet(t, 3)
    third = sum(c * (a[i] * b[3 - i]).sum(keepdims=True) for i, c in enumerate((1, 3, 3, 1)))
    close(product(t, 3), third, 1e-10)


@given(curves(), st.floats(0, 1), st.integers(0, 3))
def test_derivative_curves_agree_with_evaluation(f, t, k):
    close(f.derivative(k)(t), f(t, k), 1e-10)


@given(surfaces(), st.floats(0, 1), st.floats(0, 1), st.integers(0, 2), st.integers(0, 2))
def test_derivative_surfaces_agree_with_evaluation(f, u, v, ku, kv):
    close(f.derivative(ku, kv)(u, v), f(u, v, ku, kv), 1e-9)


@given(curves(), st.floats(0.02, 0.98))
def test_derivatives_are_limits_of_differences(f, t):
    j = np.searchsorted(f.breaks, t, "right") - 1
    room = min(t - f.breaks[j], f.breaks[j + 1] - t)
    h = 1e-4 * room
    if room > 1e-3:
        close((f(t + h) - f(t - h)) / (2 * h), f(t, 1), 1e-4)
        close((f(t + h, 1) - f(t - h, 1)) / (2 * h), f(t, 2), 1e-4)
        close((f(t + h, 2) - f(t - h, 2)) / (2 * h), f(t, 3), 1e-4)


@given(surfaces(), parameters, parameters)
def test_grid_jet_and_scattered_evaluation_agree(s, u, v):
    for i, j in [(0, 0), (1, 0), (1, 1), (0, 2), (3, 1)]:
        close(s.grid(u, v, i, j), s(u[:, None], v, i, j), 1e-10)
    jet = s.jet(u[:, None], v, 3)
    assert jet.shape == (4, 4, len(u), len(v), 3)
    for i in range(4):
        for j in range(4):
            expected = s(u[:, None], v, i, j) if i + j <= 3 else np.zeros((len(u), len(v), 3))
            close(jet[i, j], expected, 1e-10)


@given(curves(), parameters, st.integers(0, 4))
def test_elevate_and_reduce(f, t, r):
    higher = f.elevate(r)
    assert higher.degree == f.degree + r
    close(higher(t), f(t))
    close(higher.reduce(r).coefs, f.coefs, 1e-13)
    assert higher.reduce().degree <= f.degree


def test_reduce_finds_the_degree_and_refuses_to_go_below():
    f = Curve.bezier(np.random.default_rng(0).uniform(-1, 1, (9, 3)))
    assert f.elevate(40).reduce().degree == 8
    close(f.elevate(40).reduce(40).coefs, f.coefs, 1e-14)
    with pytest.raises(GeometryError, match="not of degree 7"):
        f.elevate(3).reduce(4)
    s = Surface.from_bspline(*wavy())
    higher = s.elevate(2, 5)
    assert higher.degree == (5, 8)
    assert higher.reduce().degree == (3, 3)
    close(higher.reduce(2, 5).coefs, s.coefs, 1e-14)
    plane = Surface.from_bspline((3, 3), (clamped(3, 1),) * 2, np.stack(np.mgrid[0:4, 0:4] / 3, -1))
    assert plane.reduce().degree == (1, 1)


@given(curves(), parameters, st.floats(0, 0.4), st.floats(0.5, 1))
def test_clip_and_cut_change_nothing(f, t, a, b):
    part = f.clip(a, b)
    np.testing.assert_allclose(part.domain, (a, b), rtol=0, atol=1e-15)  # ends on breaks to rounding
    inside = a + t * (b - a)
    close(part(inside), f(inside))
    cut = f.cut([a, b, 0.3, 7.0])
    close(cut(t), f(t))
    assert set(f.breaks) <= set(cut.breaks)


@given(surfaces(), st.floats(0, 1), st.floats(0, 1))
def test_clip_cut_transpose_reverse_of_surfaces(s, u, v):
    part = s.clip(u=(0.25, 0.75), v=(0.1, 0.9))
    assert part.domain == ((0.25, 0.75), (0.1, 0.9))
    a, b = 0.25 + u / 2, 0.1 + 0.8 * v
    close(part(a, b), s(a, b))
    close(s.cut(u=[0.3], v=[0.1, 0.2])(u, v), s(u, v))
    close(s.transpose()(v, u), s(u, v))
    close(s.reverse(0)(1 - u, v, side="left"), s(u, v))
    close(s.reverse(1)(u, 1 - v), s(u, v))
    close(s.isoparametric(u=u)(v), s(u, v))
    close(s.isoparametric(v=v)(u), s(u, v))


@given(curves(), curves(), parameters)
def test_reverse_join_and_reparametrized(f, g, t):
    close(f.reverse()(1 - t), f(t))
    shifted = g.reparametrized(1, 3)
    both = f.join(shifted, continuity=-1)
    assert both.domain == (0, 3)
    close(both(t, side="left"), f(t))
    close(both(1 + 2 * t), g(t))


@given(curves(), parameters)
def test_hull_contains_curve(f, t):
    lo, hi = f.bounds()
    assert (lo <= f(t)).all()
    assert (f(t) <= hi).all()


@given(surfaces(), parameters, parameters)
def test_hull_contains_surface(s, u, v):
    lo, hi = s.bounds()
    values = s(u[:, None], v)
    assert (lo <= values).all()
    assert (values <= hi).all()


def test_hull_needs_positive_weights():
    f = Curve([0, 1], np.array([[0.0, 1.0], [1.0, -1.0]])[..., None], rational=True)
    with pytest.raises(GeometryError, match="-1"):
        f.bounds()
    with pytest.raises(GeometryError, match="-1"):
        f.to_bspline()


def test_rational_arc_is_a_circle_through_the_third_derivative():
    arc, t = quarter_arc(), np.linspace(0, 1, 33)
    d = arc.jet(t, 3)
    d[0] -= 0.5
    close((d[0] ** 2).sum(-1), 0.16, 1e-15)
    close((d[0] * d[1]).sum(-1), 0 * t, 1e-15)
    close((d[0] * d[2] + d[1] ** 2).sum(-1), 0 * t, 1e-14)
    close((d[0] * d[3] + 3 * d[1] * d[2]).sum(-1), 0 * t, 1e-13)
    close(arc.dot(arc).degree, 4)


@pytest.mark.parametrize("p", [3, 6, 10, 18, 24])
def test_dot_and_cross_are_exact_to_rounding(p):
    """Ten spans, up to degree 48: coefficients against the products of exact values."""
    rng = np.random.default_rng(p)
    f, g = (Curve.from_bspline(p, clamped(p, 10), rng.uniform(-1, 1, (p + 10, 3))) for _ in range(2))
    dot, cross = f.dot(g), f.cross(g)
    for t in exact(rng.uniform(0, 1, 12)):
        a, b = (piece_value(c.breaks, c.coefs, t) for c in (f, g))
        truth = np.array([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])
        assert (
            abs(float((piece_value(dot.breaks, dot.coefs, t) - (a * b).sum()).item())) < 1e-15 * np.abs(dot.coefs).max()
        )
        assert (
            float(np.abs(piece_value(cross.breaks, cross.coefs, t) - truth).max()) < 1e-15 * np.abs(cross.coefs).max()
        )


def test_evaluation_at_degree_48():
    f = Curve.bezier(np.random.default_rng(1).uniform(-1, 1, (49, 3))).cut([0.3])
    t = np.random.default_rng(2).uniform(0, 1, 20)
    truth = np.array([piece_value(f.breaks, f.coefs, exact(x)[()]) for x in t])
    assert float(np.abs(exact(f(t)) - truth).max()) < 1e-14
    g = f.derivative(3)
    truth = np.array([piece_value(g.breaks, g.coefs, exact(x)[()]) for x in t])
    assert float(np.abs(exact(f(t, 3)) - truth).max()) < 1e-14 * np.abs(g.coefs).max()


def test_many_points_are_the_same_points():
    s, rng = Surface.from_bspline(*wavy()), np.random.default_rng(0)
    u, v = rng.uniform(0, 1, (2, 10000))
    np.testing.assert_array_equal(s(u, v)[9000:], s(u[9000:], v[9000:]))
    f = s.isoparametric(u=0.4)
    np.testing.assert_array_equal(f(v, 1)[9000:], f(v[9000:], 1))


def test_side_at_a_break():
    corner = Curve([0, 1, 2], np.array([[0.0, 1.0], [1.0, 3.0]])[:, None, :])
    assert corner(1.0, 1).item() == 2
    assert corner(1.0, 1, side="left").item() == 1
    assert corner(2.0, 1).item() == 2
    ridge = Surface.from_rows([corner, corner])
    assert ridge(1.0, 0.5, 1, 0).item() == 2
    assert ridge(1.0, 0.5, 1, 0, side="left").item() == 1


@given(curves(), curves(), st.floats(0, 1), st.floats(0, 1))
def test_surface_from_rows_is_ruled(f, g, t, v):
    s = Surface.from_rows([f, g], domain=(0.0, 2.0))
    assert s.domain == ((0, 1), (0, 2))
    if f.rational or g.rational:
        close(s(t, 0), f(t))
        close(s(t, 2), g(t))
    else:
        close(s(t, 2 * v), (1 - v) * f(t) + v * g(t))


def test_tiled_goes_on_periodically():
    arc = quarter_arc()
    quarter = Surface.from_rows([arc, arc])  # open
    with pytest.raises(InputError, match="open in u"):
        quarter.tiled(0, 1, 1)
    poles = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0.0]])
    circle = Curve.from_bspline(2, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], poles, [1, *[0.5**0.5, 1] * 4])
    tube = Surface.from_rows([circle, circle]).tiled(0, 1, 2)
    assert tube.domain == ((-4, 12), (0, 1))
    u = np.linspace(0, 3.9, 14)
    for shift in (-4, 4, 8):
        close(tube(u + shift, 0.5), circle(u), 1e-14)
    assert (tube.continuity[0] == 0).all()
    assert tube.transpose().tiled(1, 0, 0) == tube.transpose()


def test_continuity_is_propagated():
    f = Curve.from_bspline(3, clamped(3, 4), np.sin(np.arange(7.0))[:, None])
    g = Curve.from_bspline(2, clamped(2, 2), np.cos(np.arange(4.0))[:, None])
    assert f.continuity.tolist() == [2, 2, 2]
    assert (f * g).continuity.tolist() == [2, 1, 2]
    assert f.derivative().continuity.tolist() == [1, 1, 1]
    assert f.cut([0.1]).continuity.tolist() == [SMOOTH, 2, 2, 2]
    t = f.breaks[1:-1]
    for k in range(2):
        close((f * g)(t, k), (f * g)(t, k, side="left"), 1e-13)


def test_domains_must_agree():
    f = Curve.bezier([[0.0], [1.0]])
    with pytest.raises(InputError, match="clip"):
        f + f.reparametrized(0, 2)
    with pytest.raises(InputError, match="cannot clip"):
        f.clip(-1, 1)
    with pytest.raises(InputError, match="starts at 0"):
        f.join(f)
    s = Surface.from_rows([f, f])
    with pytest.raises(InputError, match="one of u and v"):
        s.isoparametric(u=0, v=0)


def test_dims_must_agree():
    f, g = Curve.bezier([[0.0, 0.0], [1.0, 0.0]]), Curve.bezier([[0.0] * 3, [1.0] * 3])
    for operation in (
        lambda: f + g,
        lambda: f * g,
        lambda: f.dot(g),
        lambda: f.cross(g),
        lambda: f[5:],
        lambda: f.compose(g),
    ):
        with pytest.raises(CqblendError):
            operation()
    with pytest.raises(TypeError):
        f + "a"


@pytest.mark.parametrize(
    ("breaks", "coefs", "keywords", "message"),
    [
        ([0, 0], np.zeros((2, 1, 1)), {}, "increasing"),
        ([0, np.nan], np.zeros((2, 1, 1)), {}, "finite"),
        ([0, 1], np.zeros((2, 1)), {}, "2 axes, expected 3"),
        ([0, 1], np.zeros((2, 1, 2)), {}, "pieces"),
        ([0, 1], np.zeros((2, 1, 1)), {"rational": True}, "no component"),
        ([0, 1], np.full((2, 1, 1), np.inf), {}, "finite"),
        ([0, 1, 2], np.zeros((2, 1, 2)), {"continuity": [0, 1]}, "continuity"),
        (["a", "b"], np.zeros((2, 1, 1)), {}, "numbers"),
    ],
)
def test_bad_construction_is_named(breaks, coefs, keywords, message):
    with pytest.raises(InputError, match=message):
        Curve(breaks, coefs, **keywords)


def test_splines_are_frozen_values():
    f = quarter_arc()
    with pytest.raises(AttributeError):
        f.rational = False
    with pytest.raises(ValueError, match="read-only"):
        f.coefs[0] = 1
    assert f == quarter_arc()
    assert hash(f) == hash(quarter_arc())
    assert f != f.elevate()
    assert pickle.loads(pickle.dumps(f)) == f
    assert copy.deepcopy(f).to_bspline()[0] == 2
    assert repr(f) == "<rational Curve of degree 2, dim 2, 1 pieces on [0, 1]>"


@given(surfaces())
def test_surface_round_trip(s):
    degrees, (ku, kv), poles, weights = s.to_bspline()
    again = Surface.from_bspline(degrees, (ku, kv), poles, weights)
    assert again == s
    assembled = Surface(s.breaks, s.coefs, rational=s.rational, continuity=s.continuity).to_bspline()
    np.testing.assert_array_equal(assembled[1][0], ku)
    np.testing.assert_array_equal(assembled[1][1], kv)
    close(assembled[2], poles, 1e-12)


def test_a_product_with_a_parabola_is_as_continuous_as_its_other_factor():
    """A parabola goes on unchanged across any break; what it is multiplied by does not."""
    t = np.linspace(0, 1, 3)
    other = hermite(t, [[[1.0], [2.0], [0.5]], [[0.3], [-1.0], [2.0]], [[0.0], [4.0], [1.0]]])
    parabola = Curve.bezier([[1.0], [3.0], [2.0]])
    for made in (parabola * other, other * parabola, parabola + other, Curve.stack([parabola, other])):
        degree, knots, poles, weights = made.to_bspline()
        again = Curve.from_bspline(degree, knots, poles, weights)
        x = np.linspace(0, 1, 101)
        assert np.abs(again(x) - made(x)).max() < 1e-13
