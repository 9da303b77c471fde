"""Pairings are found where they are known, leave rails where they are, and say why there is none."""

import numpy as np
import pytest
from developable_strips import CYLINDER, EDGE, SADDLE, moved, tangent_strip

from cqblend.errors import GeometryError, InputError
from cqblend.patterns.flattening.flat_strip import flatten_rails
from cqblend.patterns.strips.developability import bound_twist, classify_strip
from cqblend.patterns.strips.ruling_pairing import pair_rulings
from cqblend.splines import Curve, change_of_parameter, reparameterise

LOWER = Curve.bezier([[0.0, 0, 0], [1, 0, 1], [2, 0, 0]])
UPPER = Curve.bezier([[0.2, 1, 0], [1, 1, 0.9], [2, 1, 0.1]])


def test_a_pairing_that_was_lost_is_found_again():
    change = change_of_parameter(0.6, 1.3)
    first, second = tangent_strip(0.5, 1.0)
    rails = first, reparameterise(second, change)
    assert classify_strip(rails) == "twisted"
    pairing = pair_rulings(rails)
    assert pairing.fan_lengths == (0, 0)
    assert pairing.twist < 1e-9
    s, t = pairing.parameters
    r = np.linspace(0, 1, 101)
    np.testing.assert_allclose(change(t(r)[:, 0]), s(r), atol=1e-10)
    assert classify_strip(pairing.rails) == "tangent"
    flat, plain = (flatten_rails(strip, 1e-3) for strip in (pairing.rails, (first, second)))
    assert abs(flat.area_flat / plain.area_flat - 1) < 1e-9
    np.testing.assert_allclose(flat.lengths.sum(axis=1), plain.lengths.sum(axis=1), rtol=1e-12)


def test_fans_where_the_pairing_runs_out():
    pairing = pair_rulings((LOWER, UPPER))
    assert pairing.reason == ""
    assert bound_twist((LOWER, UPPER)) > 0.1
    assert pairing.twist < 1e-9
    assert 0 < pairing.fan_lengths[0] < 0.1
    assert 0 < pairing.fan_lengths[1] < 0.1
    first, second = pairing.rails
    np.testing.assert_array_equal(first.breaks, second.breaks)
    r = np.linspace(0, 1, 400)
    s, t = (f(r)[:, 0] for f in pairing.parameters)
    assert (np.diff(s) >= -1e-15).all()
    assert (np.diff(t) >= -1e-15).all()
    assert (s[0], t[0]) == (0, 0)
    np.testing.assert_allclose([s[-1], t[-1]], 1, atol=1e-15)
    np.testing.assert_allclose(first(r), LOWER(s), atol=1e-14)
    np.testing.assert_allclose(second(r), UPPER(t), atol=1e-14)
    # every ruling outside of the fans lies in one tangent plane of both rails
    a, b, d = LOWER(s, 1), UPPER(t, 1), UPPER(t) - LOWER(s)
    inside = (r > pairing.fan_lengths[0]) & (r < 1 - pairing.fan_lengths[1])
    assert np.abs((np.cross(a, b) * d).sum(axis=1))[inside].max() < 1e-9
    flat = flatten_rails(pairing.rails, 1e-3)
    assert flat.kind == "tangent"
    ends = np.linalg.norm(flat.second_rail[[0, -1]] - flat.first_rail[[0, -1]], axis=1)
    np.testing.assert_allclose(ends, np.linalg.norm((UPPER - LOWER)([0.0, 1.0]), axis=1), rtol=1e-12)


def test_rails_of_several_pieces():
    """Paths cross breaks of either rail, where their second derivatives jump."""
    lower = Curve.from_bspline(2, [0, 0, 0, 0.4, 1, 1, 1], [[0.0, 0, 0], [0.6, 0, 0.7], [1.4, 0, 0.8], [2, 0, 0]])
    upper = Curve.from_bspline(2, [0, 0, 0, 0.5, 1, 1, 1], [[0.1, 1, 0], [0.7, 1, 0.6], [1.3, 1, 0.9], [2, 1, 0.1]])
    pairing = pair_rulings((lower, upper))
    assert pairing.rails is not None, pairing.reason
    assert pairing.twist < 1e-8


def test_what_is_developable_stays():
    for rails in (CYLINDER, tangent_strip(0.5, 1.5)):
        pairing = pair_rulings(rails)
        assert pairing.rails is rails
        assert pairing.twist < 1e-9
        np.testing.assert_allclose(pairing.parameters[1](0.3), 0.3)


def test_the_caller_judges():
    asked = []

    def deviation(rails):
        asked.append(rails)
        return 0.25

    pairing = pair_rulings((LOWER, UPPER), 0.3, deviation)
    assert pairing.deviation == 0.25
    assert asked == [pairing.rails]
    refused = pair_rulings((LOWER, UPPER), 0.2, deviation)
    assert refused.rails is None
    assert refused.parameters is None
    assert "deviate by 0.25, more than 0.2" in refused.reason


def test_where_there_is_none():
    assert "no ruling" in pair_rulings(SADDLE).reason or "turns back" in pair_rulings(SADDLE).reason
    bent = Curve([0, 0.5, 1], np.array([[[0.0, 1], [0, 0], [0, 1]], [[1, 2], [0, 0], [1, 0]]]))
    assert "corner at t = 0.5" in pair_rulings((bent, moved(bent * [1, 1, 0.5], [0, 1, 0]) + EDGE * 0.1)).reason
    with pytest.raises(InputError, match="tolerance"):
        pair_rulings((LOWER, UPPER), 0.0)
    with pytest.raises(GeometryError, match="same curve"):
        pair_rulings((LOWER, LOWER))
