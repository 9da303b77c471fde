"""Relations: the paper's equation 2 in exact arithmetic, and what makes a curve fit for a blend."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cqblend.blends.potential.relations import BezierRelation, Conic, Relation, to_relation
from cqblend.errors import InputError
from cqblend.splines import Curve

X = np.linspace(0, 1, 41)
LAMBDAS = (0.0, 0.9, -1.0, -3.0, -10.0, -1e4)


def conic(a, b, lam, s1, s2):
    """Lee, Bedi and Dubey's equation 2."""
    return b**2 * s1**2 + a**2 * s2**2 + a**2 * b**2 - 2 * a * b**2 * s1 - 2 * a**2 * b * s2 + 2 * lam * s1 * s2


@given(st.floats(0.01, 100), st.floats(0.01, 100), st.floats(-100, 0.99, exclude_max=True), st.floats(0, 1, width=16))
def test_conics_solve_equation_2(a, b, share, x):
    lam = share * a * b
    s1, s2 = (Fraction(float(s)) for s in Conic(a, b, lam)(x))
    a, b = Fraction(a), Fraction(b)
    assert abs(conic(a, b, Fraction(lam), s1, s2)) <= 1e-13 * float(a * b) ** 2 * (1 + abs(share))


@pytest.mark.parametrize("lam", LAMBDAS)
def test_conics_run_from_axis_to_axis_and_along_them(lam):
    one = Conic(2, 1, lam * 2)
    assert np.allclose(one([0, 1]), [(2, 0), (0, 1)], rtol=0, atol=1e-15)
    assert one.curve(0.0, 1)[1] == one.curve(1.0, 1)[0] == 0
    s = one(X)
    assert (np.diff(s[:, 0]) < 0).all()
    assert (np.diff(s[:, 1]) > 0).all()


def test_conics_are_what_their_names_say():
    """The discriminant of the quadratic part tells an ellipse from a parabola and from a hyperbola; a circle is one."""
    for lam, sign in ((0, -1), (0.5, -1), (-1, 0), (-2, 1)):
        assert np.sign(lam**2 - 1) == sign
    assert np.allclose(np.linalg.norm(Conic(1, 1, 0)(X) - 1, axis=1), 1, rtol=0, atol=1e-15)


def test_sharpness_grows_as_lambda_falls():
    nearest = [np.linalg.norm(Conic(1, 1, lam)(X), axis=1).min() for lam in sorted(LAMBDAS)]
    assert (np.diff(nearest) > 0).all()


@pytest.mark.parametrize("lam", LAMBDAS)
def test_easing_keeps_the_curve_and_holds_its_speed(lam):
    one = Conic(2, 3, 6 * lam)
    x = X[1:-1]
    points = one.eased(x)
    size = conic(2, 3, 6 * lam, 0.0, 0.0)
    assert np.abs(conic(2, 3, 6 * lam, *points.T)).max() <= 1e-13 * size * (1 + abs(lam))
    assert np.allclose(one.eased([0, 1]), one([0, 1]), rtol=0, atol=1e-15)
    assert abs(one.eased(0.0, 1)[0]) <= 4 + 1e-12
    assert abs(one.eased(1.0, 1)[1]) <= 6 + 1e-12
    assert (np.diff(points[:, 0]) < 0).all()


@pytest.mark.parametrize("lam", LAMBDAS)
def test_each_amount_tells_the_other(lam):
    one = Conic(2, 3, 6 * lam)
    s = one(X)
    assert np.allclose(one.second(s[:, 0]), s[:, 1], rtol=0, atol=1e-12)
    assert np.allclose(one.first(s[:, 1]), s[:, 0], rtol=0, atol=1e-12)
    assert one.first(3.0) == 0
    assert one.second(2.0) == 0


def test_the_first_of_several_roots_counts():
    fork = BezierRelation([(1, 0), (0.5, 0), (0.5, 0.9), (0, 0.1), (0, 1)])
    x = 0.3
    s1, s2 = fork(x)
    assert fork.second(s1) == pytest.approx(s2, abs=1e-12)


def test_bezier_relations_are_their_points():
    points = np.array([(2, 0), (1, 0), (1.5, 2), (0, 1), (0, 3.0)])
    one = BezierRelation(points)
    x = 0.37
    for _ in range(4):  # de Casteljau
        points = (1 - x) * points[:-1] + x * points[1:]
    assert np.allclose(one(x), points[0], rtol=0, atol=1e-15)
    assert (one.a, one.b) == (2, 3)


@pytest.mark.parametrize(
    "made",
    [
        lambda x: ((1 - x) ** 2, 2 * x**2),
        lambda x: np.stack([(1 - x) ** 2, 2 * x**2], axis=-1),
        (lambda x: (1 - x) ** 2, lambda x: 2 * x**2),
        [lambda x: (1 - x) ** 2, lambda x: 2 * x**2],
    ],
)
def test_functions_make_relations(made):
    one = to_relation(made)
    assert np.allclose(one(X), np.stack([(1 - X) ** 2, 2 * X**2], axis=-1), rtol=0, atol=1e-13)
    assert to_relation(one) is one


def test_a_circle_by_functions_is_the_conic():
    one = to_relation((lambda x: 1 - np.sin(np.pi * x / 2), lambda x: 1 - np.cos(np.pi * x / 2)))
    assert np.abs(conic(1, 1, 0, *one(X).T)).max() < 1e-12


def test_functions_of_low_continuity_are_relations_too():
    """Their derivatives at the ends are known as well as splines through them tell."""
    one = to_relation(lambda x: ((1 - x) ** 2.5, x**2.5))
    assert np.allclose(one(0.3), [0.7**2.5, 0.3**2.5], rtol=0, atol=1e-9)


BAD = [
    (lambda: Conic(1, 1, 1), "lam must be below a b = 1"),
    (lambda: Conic(2, 3, 7), "lam must be below a b = 6, not 7"),
    (lambda: Conic(0, 1), "a and b must be above 0"),
    (lambda: Conic(1, -1), "a and b must be above 0"),
    (lambda: Conic(1, np.nan), "b must be a finite number"),
    (lambda: Conic(1, 1, "sharp"), "lam must be a finite number"),
    (lambda: Conic(1, 1, None), "lam must be a finite number"),
    (lambda: BezierRelation([(1, 0), (0, 1)]), "three points"),
    (lambda: BezierRelation("abc"), "three points"),
    (lambda: BezierRelation([(1, 0), (0.5, 0.1), (0, 1)]), "slopes"),
    (lambda: BezierRelation([(1, 0.1), (0, 0), (0, 1)]), "it must end on the axes"),
    (lambda: BezierRelation([(1, 0), (1, 0), (0, 0), (0, 1)]), "must set out"),
    (lambda: BezierRelation([(1, 0), (2, 0), (0, 0), (0, 1)]), "must set out"),
    (lambda: BezierRelation([(-1, 0), (0, 0), (0, 1)]), "both above 0"),
    (lambda: to_relation(lambda x: (1 - x, x)), "slopes"),
    (lambda: to_relation(lambda x: x), "a relation"),
    (lambda: to_relation((1, 2)), "a relation is"),
    (lambda: to_relation(None), "a relation is"),
    (lambda: to_relation((np.cos,) * 3), "a relation is"),
    (lambda: to_relation(lambda x: (np.log(x), x**2)), "not finite"),
    (lambda: to_relation(lambda x: (np.abs(x - 0.3), x**2)), "not a smooth function"),
    (lambda: Relation(Curve.bezier([[1.0], [0.0]])), "of dim 2"),
    (lambda: Conic(1, 2).first(2.5), "has no root: nowhere is s2 = 2.5"),
    (lambda: Conic(1, 2).second([0.5, -0.1]), "has no root: nowhere is s1 = -0.1"),
]


@pytest.mark.filterwarnings("ignore:divide by zero")
@pytest.mark.parametrize(("make", "message"), BAD)
def test_what_is_no_relation_says_why(make, message):
    with pytest.raises(InputError, match=message):
        make()
