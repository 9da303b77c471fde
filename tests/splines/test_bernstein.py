"""The float kernels against themselves on fractions, and those against the definition, point by point."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from spline_oracles import bernstein_value, exact

from cqblend.errors import GeometryError
from cqblend.splines import bernstein

POINTS = [Fraction(k, 97) for k in range(1, 97)]


def relative(got, truth):
    error = np.abs(exact(got) - truth).max()
    return float(error / np.abs(truth).max())


def random(*shape, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, shape)


@pytest.mark.parametrize(("p", "q"), [(0, 3), (3, 3), (6, 6), (9, 18), (24, 24), (18, 30), (47, 1)])
def test_product_is_exact_to_rounding(p, q):
    a, b = random(p + 1, 3, 2), random(q + 1, 1, 2, seed=1)
    truth = bernstein.multiply_polynomials(exact(a), exact(b))
    for t in POINTS[: p + q + 1]:
        assert (bernstein_value(truth, t) == bernstein_value(exact(a), t) * bernstein_value(exact(b), t)).all()
    assert relative(bernstein.multiply_polynomials(a, b), truth) < 1e-15


def test_product_of_two_variables():
    a, b = random(4, 3, 2, 1, 1), random(3, 5, 2, 1, 1, seed=1)
    truth = bernstein.multiply_polynomials(exact(a), exact(b), 2)
    for u, v in [(Fraction(1, 3), Fraction(2, 7)), (Fraction(5, 8), Fraction(1, 9))]:
        left = bernstein_value(bernstein_value(truth, u), v)
        right = bernstein_value(bernstein_value(exact(a), u), v) * bernstein_value(bernstein_value(exact(b), u), v)
        assert (left == right).all()
    assert relative(bernstein.multiply_polynomials(a, b, 2), truth) < 1e-15


@pytest.mark.parametrize(("p", "q", "m", "k"), [(3, 3, 1, 1), (3, 3, 3, 3), (2, 3, 3, 1), (5, 5, 3, 3), (8, 8, 3, 3)])
def test_composition_is_exact_to_rounding(p, q, m, k):
    patch = random(p + 1, q + 1, 3, 1)
    u, v = np.abs(random(m + 1, 1, seed=1)), np.abs(random(k + 1, 1, seed=2))
    one = np.ones(1, dtype=object)
    truth = bernstein.compose_patch(exact(patch), one - exact(u), exact(u), one - exact(v), exact(v))
    assert len(truth) == m * p + k * q + 1
    for t in POINTS[:4]:
        s, r = bernstein_value(exact(u), t)[0], bernstein_value(exact(v), t)[0]
        assert (bernstein_value(truth, t) == bernstein_value(bernstein_value(exact(patch), s), r)).all()
    assert relative(bernstein.compose_patch(patch, 1 - u, u, 1 - v, v), truth) < 1e-14


def test_composition_is_projective_in_each_direction():
    patch, t = random(4, 3, 4, 2), Fraction(1, 3)
    alpha, beta, gamma, delta = (random(3, 2, seed=s) for s in range(4))  # alpha and the rest pass through zero
    truth = bernstein.compose_patch(*map(exact, (patch, alpha, beta, gamma, delta)))
    a, b, c, d = (bernstein_value(exact(f), t) for f in (alpha, beta, gamma, delta))
    expected = sum(
        comb3 * comb2 * exact(patch)[i, j] * a ** (3 - i) * b**i * c ** (2 - j) * d**j
        for i, comb3 in enumerate((1, 3, 3, 1))
        for j, comb2 in enumerate((1, 2, 1))
    )
    assert (bernstein_value(truth, t) == expected).all()
    assert relative(bernstein.compose_patch(patch, alpha, beta, gamma, delta), truth) < 1e-14


@pytest.mark.parametrize("p", [3, 18, 24])
def test_composition_of_curves(p):
    coefs, x = random(p + 1, 2, 1), np.array([[0.125], [0.875], [0.25]])
    truth = bernstein.compose_curve(exact(coefs), 1 - exact(x), exact(x))
    t = Fraction(2, 7)
    assert (bernstein_value(truth, t) == bernstein_value(exact(coefs), bernstein_value(exact(x), t)[0])).all()
    assert relative(bernstein.compose_curve(coefs, 1 - x, x), truth) < 1e-14


@pytest.mark.parametrize(("p", "r"), [(1, 1), (2, 1), (9, 1), (18, 6), (30, 1), (47, 1), (46, 2), (8, 40), (0, 5)])
def test_reduce_undoes_elevate(p, r):
    a = random(p + 1, 3, 2)
    higher = bernstein.elevate_degree(exact(a), r).astype(float)
    assert relative(bernstein.reduce_degree(higher, r), exact(a)) < 1e-14


@pytest.mark.parametrize("p", [1, 3, 18, 48])
def test_restriction_is_the_same_polynomial(p):
    a = random(p + 1, 3, 3)
    x0, x1 = np.array([0.0, 0.25, 0.9]), np.array([1.0, 0.375, 1.0])
    part = bernstein.restrict_pieces(a, x0, x1)
    assert (part[..., 0] == a[..., 0]).all()
    truth = bernstein.restrict_pieces(exact(a), exact(x0), exact(x1))
    t = Fraction(3, 11)
    for j in range(3):
        at = Fraction(x0[j]) + t * (Fraction(x1[j]) - Fraction(x0[j]))
        assert (bernstein_value(truth[..., j], t) == bernstein_value(exact(a)[..., j], at)).all()
    assert relative(part, truth) < 1e-14


def test_blossom_is_multiaffine_symmetric_and_diagonal():
    a = exact(random(4, 2, 1))
    x, y, z, w = (Fraction(n, 7) for n in (-3, 2, 11, 5))
    f = lambda *args: bernstein.evaluate_blossom(a, np.array(args, dtype=object)[:, None])  # noqa: E731
    assert (f(x, x, x)[:, 0] == bernstein_value(a, x)[:, 0]).all()
    assert (f(x, y, z) == f(z, x, y)).all()
    assert (f(x, y, (z + w) / 2) == (f(x, y, z) + f(x, y, w)) / 2).all()


@pytest.mark.parametrize("p", [0, 1, 3, 18, 48, 94])
def test_basis_values(p):
    """Half a rounding of 1 - t enters with the power p: that bounds any evaluation from a rounded parameter."""
    t = np.array([0.0, 1e-9, 0.25, 0.5, 0.9, 1.0])
    values = bernstein.evaluate_basis(p, 1 - t, t)
    for column, x in zip(values.T, t, strict=True):
        unit = exact(np.eye(p + 1))
        assert np.abs(exact(column) - bernstein_value(unit, Fraction(x))).max() < 1.2e-16 * (p + 2)


@pytest.mark.parametrize("p", [1, 3, 19])
def test_derivative_is_the_limit_of_differences(p):
    a = exact(random(p + 1, 1, 1))
    slope, t, h = bernstein_value(bernstein.differentiate_coefs(a), Fraction(1, 3)), Fraction(1, 3), Fraction(1, 10**30)
    difference = (bernstein_value(a, t + h) - bernstein_value(a, t - h)) / (2 * h)
    assert abs(float((slope - difference).item())) < 1e-50


def test_kernels_run_on_mpmath():
    with mpmath.workdps(60):
        big = np.vectorize(mpmath.mpf, otypes=[object])
        patch, u = random(4, 4, 3, 2), np.abs(random(4, 2, seed=1))
        truth = bernstein.compose_patch(exact(patch), 1 - exact(u), exact(u), 1 - exact(u), exact(u))
        got = bernstein.compose_patch(big(patch), 1 - big(u), big(u), 1 - big(u), big(u))
        error = max(abs(x - mpmath.mpf(y.numerator) / y.denominator) for x, y in zip(got.flat, truth.flat, strict=True))
        assert error < mpmath.mpf(10) ** -55


def test_degrees_beyond_floats_are_told():
    with pytest.raises(GeometryError, match="degree 1200 is beyond floats") as caught:
        bernstein.multiply_polynomials(np.ones(601), np.ones(601))
    assert (caught.value.kind, caught.value.value) == ("degree", 1200.0)
