"""Sigma, its bound, and kinds of strips: against evaluation, fractions and dense sampling."""

import itertools
from fractions import Fraction

import numpy as np
import pytest
from developable_strips import (
    APEX,
    CONE,
    CYLINDER,
    EDGE,
    QUARTER,
    SADDLE,
    circle,
    helix_strip,
    moved,
    random_strip,
    tangent_strip,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from cqblend.errors import GeometryError, InputError
from cqblend.patterns.strips.developability import (
    bound_twist,
    classify_strip,
    compute_sigma,
    find_apex,
    find_ruling_direction,
)
from cqblend.splines import Curve, Surface, change_of_parameter, reparameterise


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("rational", [False, True])
def test_sigma_is_what_lemma_1_says(seed, rational):
    ruled = Surface.from_rows(random_strip(seed, rational), (-1.0, 2.0))
    found = compute_sigma(ruled)
    rng = np.random.default_rng(seed)
    t, v = rng.uniform(0, 1, 40), rng.uniform(-1, 2, 40)
    normal = np.cross(ruled(t, v, 1, 0), ruled(t, v, 0, 1))
    expected = (normal * ruled(t, v, 1, 1)).sum(axis=1)
    assert np.abs(found(t, v)[:, 0] - expected).max() < 1e-13 * np.abs(expected).max()
    assert found.degree == ((12, 4) if rational else (6, 0))  # 3 p - 2 is 7, of which one is formal
    assert found.domain == ruled.domain


def test_sigma_of_a_tangent_developable_vanishes_in_fractions_and_here():
    edge = [[Fraction(int(x)) for x in row] for row in EDGE.coefs[..., 0]]

    def jet(t, k):
        """Derivative k of the cubic at t, by differences of its poles."""
        poles, factor = edge, 1
        for i in range(k):
            poles = [[b - a for a, b in zip(p, q, strict=True)] for p, q in itertools.pairwise(poles)]
            factor *= 3 - i
        while len(poles) > 1:
            poles = [[(1 - t) * a + t * b for a, b in zip(p, q, strict=True)] for p, q in itertools.pairwise(poles)]
        return [factor * x for x in poles[0]]

    for t in (Fraction(0), Fraction(1, 3), Fraction(7, 8)):
        d1, d2 = jet(t, 1), jet(t, 2)
        a, b = ([x + m * y for x, y in zip(d1, d2, strict=True)] for m in (Fraction(1, 2), Fraction(3, 2)))
        cross = [a[i - 2] * d1[i - 1] - a[i - 1] * d1[i - 2] for i in range(3)]
        assert sum(x * y for x, y in zip(cross, b, strict=True)) == 0
    strip = tangent_strip(0.5, 1.5)
    assert np.abs(compute_sigma(Surface.from_rows(strip)).coefs).max() < 1e-13 * np.abs(strip[1].coefs).max() ** 3


def sampled_twist(rails, count=4001):
    t = np.linspace(0, 1, count)[1:-1]
    a, b, d = rails[0](t, 1), rails[1](t, 1), rails[1](t) - rails[0](t)
    normal = np.cross((a + b) / 2, d)
    return np.linalg.norm(d, axis=1) * np.abs((np.cross(a, d) * b).sum(axis=1)) / (normal**2).sum(axis=1)


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 10**6), st.booleans())
def test_twist_is_a_bound_and_not_much_more(seed, rational):
    rails = random_strip(seed, rational)
    largest = sampled_twist(rails).max()
    assert largest <= bound_twist(rails) <= 1.11 * largest


def test_twist_has_no_scale_and_knows_gaussian_curvature():
    def twist(ruled):
        return bound_twist(tuple(ruled.isoparametric(v=v) for v in ruled.domain[1]))

    ruled = Surface.from_rows(SADDLE)
    value = twist(ruled)
    for other in (
        ruled * 1e-4,
        ruled * 1e5,
        Surface.from_rows(SADDLE, (0, 7)),
        Surface.from_rows([r.reparametrized(3, 9) for r in SADDLE]),
    ):
        assert twist(other) == pytest.approx(value, rel=1e-12)
    change = change_of_parameter(2.0, 0.3)
    again = reparameterise(SADDLE[0], change), reparameterise(SADDLE[1], change)
    assert bound_twist(again) == pytest.approx(value, rel=0.11)
    # |D| sqrt(-K) of z = x y / 8 in the middle of the ruling at x: f_xy = 1/8, K = - f_xy^2 / (1 + f_x^2 + f_y^2)^2
    x = np.linspace(0, 4, 4001)
    closed = np.sqrt(1 + (x / 8) ** 2) / 8 / (1 + (x / 8) ** 2 + (0.5 / 8) ** 2)
    assert closed.max() <= value <= 1.1 * closed.max()
    # and it is about the angle between the normals at the ends of a ruling
    normals = np.cross([4.0, 0, 0], [0.0, 1, 0]), np.cross([4.0, 0, 0.5], [0.0, 1, 0])
    angle = np.arctan2(np.linalg.norm(np.cross(*normals)), np.dot(*normals))
    assert abs(closed[0] - angle) < angle**3


@pytest.mark.parametrize(
    ("kind", "rails"),
    [
        ("plane", (QUARTER, QUARTER * 2)),
        ("plane", (Curve.bezier([[0.0, 0, 0]] * 2), Curve.bezier([[1.0, 0, 1], [0, 1, 1]]))),
        ("cylinder", CYLINDER),
        ("cylinder", (EDGE, moved(EDGE, [1, -3, 2]))),
        ("cylinder", (circle(2, 0), circle(2, 5))),
        ("cone", CONE),
        ("cone", (APEX, QUARTER)),
        ("cone", (QUARTER, APEX)),
        ("cone", (circle(2, 0), circle(1, 5))),
        ("cone", (moved(EDGE, [0, 0, 3]), moved(EDGE * 1.5, [0, 0, 4.5]))),
        ("tangent", tangent_strip(0.5, 1.5)),
        ("tangent", tangent_strip(0.0, 1.0)),
        ("tangent", tangent_strip(1.0, 1.001)),
        ("tangent", helix_strip(1.0, 0.4, 0.5, 2.0)),
        ("twisted", SADDLE),
        ("twisted", random_strip(3)),
        ("twisted", random_strip(3, True)),
        ("twisted", (SADDLE[0], SADDLE[1] * [1, 1, 1e-4])),
    ],
)
def test_kinds(kind, rails):
    for scale in (1.0, 1e-3, 1e4):
        scaled = tuple(rail * scale for rail in rails)
        assert classify_strip(scaled) == kind
        assert classify_strip((scaled[1].reverse(), scaled[0].reverse())) == kind
    assert classify_strip(tuple(moved(rail, [30, -20, 10]) for rail in rails)) == kind


def test_directions_and_apexes():
    np.testing.assert_allclose(find_ruling_direction(CYLINDER), [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(find_apex(CONE), [0, 0, -1], atol=1e-14)
    assert find_ruling_direction(CONE) is None
    assert find_apex(SADDLE) is None


def test_gores_and_rails_that_stop():
    """Rails that meet, or stop, where the bound is a quotient of zeros."""
    rise = Curve.bezier([[0.0, 0, 1], [1, 0, 1], [1, 0, 0]])
    other = Curve.bezier([[0.0, 0, 1], [0.8, 0.4, 1.1], [0.9, 0.6, 0]])
    value = bound_twist((rise, other))
    assert sampled_twist((rise, other)).max() <= value < 1.11 * sampled_twist((rise, other)).max()
    slow = change_of_parameter(0.0, 1.0)
    stopped = tuple(reparameterise(rail, slow) for rail in random_strip(5))
    assert sampled_twist(stopped).max() <= bound_twist(stopped) < 1.11 * sampled_twist(stopped).max()


def test_what_is_refused():
    point = Curve.bezier([[1.0, 1, 1]] * 2)
    with pytest.raises(GeometryError, match="same curve"):
        classify_strip((QUARTER, QUARTER))
    with pytest.raises(GeometryError, match="points"):
        classify_strip((point, moved(point, [1, 0, 0])))
    for rails in ((QUARTER,), (QUARTER, 3), (QUARTER, Curve.bezier([[0.0, 0], [1, 1]]))):
        with pytest.raises(InputError, match="rail"):
            classify_strip(rails)
    with pytest.raises(InputError, match="weight"):
        classify_strip((QUARTER, Curve.bezier([[0.0, 0, 1], [1, 1, 1]], [1.0, -1.0])))
    with pytest.raises(InputError, match="domain"):
        classify_strip((QUARTER, moved(QUARTER.reparametrized(0, 2), [0, 0, 1])))
    for value in (QUARTER, Surface.from_rows([QUARTER] * 3), Surface.from_rows(CYLINDER)[:2]):
        with pytest.raises(InputError, match="ruled surface"):
            compute_sigma(value)
