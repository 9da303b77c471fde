"""Strips as values: fractions, ruled surfaces, what they refuse."""

import numpy as np
import pytest

from cqblend.errors import InputError
from cqblend.patterns.strips.ruled_strip import RuledStrip
from cqblend.splines import Curve, Surface

FIRST = Curve.bezier([[0.0, 0, 0], [4, 1, 0], [9, 0, 2]], [1.0, 3.0, 2.0])
LAST = Curve.bezier([[0.0, 5, 1], [5, 6, 0], [9, 5, 3]], [1.0, 0.5, 4.0])
SHIFTED = FIRST + np.array([0.0, 7, 1])


def strip_between(first, last, **options):
    """Strip of the ruled surface itself, sped up in v."""
    rows = [rail if rail.rational else rail._to_rational() for rail in (first, last)]
    surface = Surface.from_rows(rows)
    return RuledStrip((first, last), surface, (0.0, 1.0), 0.0, **options)


@pytest.mark.parametrize("last", [LAST, Curve.bezier([[0.0, 5, 1], [9, 5, 3]]).elevate(), SHIFTED])
def test_ruled_surfaces_are_linear_in_space(last):
    strip = strip_between(FIRST, last)
    ruled = strip.to_ruled_surface()
    t, w = np.random.default_rng(0).uniform(size=(2, 50))
    expected = (1 - w)[:, None] * FIRST(t) + w[:, None] * last(t)
    assert np.abs(ruled(t, w) - expected).max() <= 1e-13
    weights = ruled.coefs[:, :, -1]
    assert (weights[:, 0] == weights[:, 1]).all()
    assert ruled.degree[1] == 1


def test_rails_with_proportional_weights_keep_their_degree():
    assert strip_between(FIRST, SHIFTED).to_ruled_surface().degree == (2, 1)
    assert strip_between(FIRST, LAST).to_ruled_surface().degree == (4, 1)


def test_polynomial_rails_give_a_polynomial_surface():
    first, last = Curve.bezier([[0.0, 0, 0], [1, 0, 0]]), Curve.bezier([[0.0, 1, 0], [0.5, 2, 0], [1, 1, 1]])
    surface = Surface.from_rows([first, last])
    ruled = RuledStrip((first, last), surface, (0.0, 1.0), 0.0).to_ruled_surface()
    assert not ruled.rational
    assert np.abs(ruled(0.3, 0.25) - (0.75 * first(0.3) + 0.25 * last(0.3))).max() <= 1e-15


def test_fractions_are_feet_of_perpendiculars():
    strip = strip_between(FIRST, LAST)
    u, v = np.random.default_rng(1).uniform(size=(2, 40))
    w = strip.find_fractions(u, v)
    off = strip.surface(u, v) - FIRST(u) - w[:, None] * (LAST(u) - FIRST(u))
    assert np.abs(off).max() <= 1e-13  # the surface is ruled
    assert strip.find_fractions(u, np.zeros(40)).tolist() == [0.0] * 40
    assert strip.find_fractions(u, np.ones(40)).tolist() == [1.0] * 40
    assert strip.find_fractions(0.3, [-1.0, 2.0]).tolist() == [0.0, 1.0]
    assert strip.find_fractions(u[:, None], v).shape == (40, 40)


def test_where_a_ruling_is_a_point_the_parameter_is_the_fraction():
    poles = np.array([[[0.0, 0, 0], [0, 0, 0]], [[5, 0, 0], [0, 5, 0]]])
    surface = Surface.from_bspline((1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), poles)
    strip = RuledStrip((surface.isoparametric(v=0), surface.isoparametric(v=1)), surface, (0.0, 1.0), 0.0)
    assert strip.find_fractions([0.0, 0.5], 0.25).tolist() == [0.25, 0.25]


def test_a_timing_is_followed():
    w = Surface.from_bspline((1, 2), ([0, 0, 1, 1], [0, 0, 0, 1, 1, 1]), [[[0], [0.1], [1]], [[0], [0.1], [1]]])
    strip = strip_between(FIRST, LAST, fraction_surface=w)
    assert strip.find_fractions(0.4, 0.5) == pytest.approx(0.3)


def test_what_is_no_strip():
    surface = Surface.from_rows([FIRST, LAST])
    with pytest.raises(InputError, match="same breaks"):
        RuledStrip((FIRST.cut([0.5]), LAST), surface, (0.0, 1.0), 0.0)
    with pytest.raises(InputError, match="dim 3"):
        RuledStrip((FIRST[:2], LAST), surface, (0.0, 1.0), 0.0)
    with pytest.raises(InputError, match=r"not within v = 0 \.\. 1"):
        RuledStrip((FIRST, LAST), surface, (0.0, 2.0), 0.0)
