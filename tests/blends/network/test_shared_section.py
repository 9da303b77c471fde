"""Sections that two cells share, and what they have not in common."""

from __future__ import annotations

import numpy as np
import pytest

from cqblend.blends.network.shared_section import SectionEnd, measure_mismatch
from cqblend.blends.rails.ribbon_end import EndJets

SEED = 5


def section(rates, orders=(1, 1)):
    values = [np.array([[0.0, 0, 0], [0, 0, 2.0]]), np.array([[2.0, 0, 2], [-2.0, 0, 0]])]
    return SectionEnd((EndJets(values[0], rates[0]), EndJets(values[1], rates[1])), orders)


def test_a_section_is_the_hermite_cubic_of_its_jets():
    v = np.linspace(0, 1, 7)
    points, tangents, rates = section(np.random.default_rng(SEED).normal(size=(2, 2, 3))).evaluate_section(v)
    (a, t), (b, s) = np.array([[0, 0, 0], [0, 0, 2.0]]), np.array([[2.0, 0, 2], [-2.0, 0, 0]])
    cubic = [2 * v**3 - 3 * v**2 + 1, 3 * v**2 - 2 * v**3, v**3 - 2 * v**2 + v, v**2 - v**3]
    assert points == pytest.approx(sum(np.multiply.outer(f, x) for f, x in zip(cubic, (a, b, t, s), strict=True)))
    assert tangents[0] == pytest.approx(t)
    assert tangents[-1] == pytest.approx(-s)
    assert rates.shape == (7, 3)


def test_rates_of_one_direction_are_found_and_need_no_common_ratio():
    lengths, other = np.random.default_rng(SEED).uniform(0.5, 2, size=(2, 2, 2, 1))
    along = np.array([0.0, 1.0, 0.0])
    first, second = section(lengths * along), section(other * along)
    assert first.find_common_direction() == pytest.approx(along)
    assert measure_mismatch(first, second).angle <= 1e-15
    bent = lengths * along
    bent[1, 1] += [1e-6, 0, 0]
    assert section(bent).find_common_direction() is None
    assert section(bent).find_common_direction(roughness=1e-5) is not None


def test_other_rates_need_one():
    rates = np.random.default_rng(SEED).normal(size=(2, 2, 3)) * 0.2 + np.array([0.0, 1.0, 0.0])
    assert section(rates).find_common_direction() is None
    assert measure_mismatch(section(rates), section(1.7 * rates)).angle <= 1e-14
    faster = rates * np.array([1.0, 1.7])[:, None, None]
    assert measure_mismatch(section(rates), section(faster)).angle > 1e-3


def test_a_gap_and_an_angle_are_measured():
    rates = np.tile([0.0, 1.0, 0.0], (2, 2, 1))
    turned = np.tile([0.0, np.cos(1e-3), np.sin(1e-3)], (2, 2, 1))
    one, other = section(rates), section(turned)
    found = measure_mismatch(one, other)
    assert found.gap == 0
    assert 5e-4 < found.angle < 1.1e-3
    moved = SectionEnd(
        (one.jets[0], EndJets(one.jets[1].values + np.array([0, 1e-3, 0]), one.jets[1].rates)), one.orders
    )
    assert measure_mismatch(one, moved).gap >= 1e-3
    assert not measure_mismatch(one, moved).is_natural(0.0)
    assert measure_mismatch(one, one).is_natural(0.0)


def test_rounding_counts_relative_to_the_distance_from_the_origin():
    rates = np.tile([0.0, 1.0, 0.0], (2, 2, 1))

    def far(shift):
        first, second = section(rates).jets
        return SectionEnd(
            tuple(EndJets(one.values + np.array([[shift, 0, 0], [0, 0, 0]]), one.rates) for one in (first, second)),
            (1, 1),
        )

    assert measure_mismatch(far(1e4), far(1e4 + 2e-12)).is_natural(0.0)
    assert not measure_mismatch(far(0.0), far(2e-12)).is_natural(0.0)
