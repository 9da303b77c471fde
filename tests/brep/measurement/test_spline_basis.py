"""Basis functions against their definition, in exact arithmetic."""

from fractions import Fraction
from math import prod

import numpy as np
import pytest

from cqblend.brep.measurement.spline_basis import divide_by_weights, evaluate_basis


def basis_function(knots, i, degree, t):
    """Return a basis function by its definition, half-open spans, in fractions."""
    if degree == 0:
        return Fraction(knots[i] <= t < knots[i + 1])
    total = Fraction(0)
    if knots[i + degree] > knots[i]:
        total += (t - knots[i]) / (knots[i + degree] - knots[i]) * basis_function(knots, i, degree - 1, t)
    if knots[i + degree + 1] > knots[i + 1]:
        share = (knots[i + degree + 1] - t) / (knots[i + degree + 1] - knots[i + 1])
        total += share * basis_function(knots, i + 1, degree - 1, t)
    return total


@pytest.mark.parametrize(
    ("degree", "inner"), [(1, []), (1, [3, 5]), (2, [2, 2, 7]), (3, [1, 4, 4, 4, 6]), (5, []), (4, [5, 5, 6])]
)
def test_values_are_those_of_the_definition(degree, inner):
    knots = [Fraction(k, 8) for k in [0] * (degree + 1) + inner + [8] * (degree + 1)]
    exact = [Fraction(k, 64) for k in range(64)]
    basis = evaluate_basis(np.array(knots, dtype=float), degree, np.array(exact, dtype=float), 0)
    for n, t in enumerate(exact):
        dense = np.zeros(len(knots) - degree - 1)
        dense[basis.poles[:, n]] = basis.values[0][:, n]
        expected = [float(basis_function(knots, i, degree, t)) for i in range(len(dense))]
        np.testing.assert_allclose(dense, expected, rtol=1e-15, atol=1e-16)


@pytest.mark.parametrize("degree", [1, 2, 3, 6])
def test_a_power_and_its_derivatives(degree):
    """The poles of t^p are products of knots (Marsden): values and derivatives are known, also past the ends."""
    rng = np.random.default_rng(degree)
    knots = np.concatenate((np.zeros(degree + 1), np.sort(rng.uniform(0, 1, 4)), np.ones(degree + 1)))
    poles = np.array([prod(knots[i + 1 : i + degree + 1].tolist()) for i in range(degree + 5)])
    ts = np.linspace(-0.1, 1.1, 50)
    basis = evaluate_basis(knots, degree, ts, 2)
    found = basis.combine(poles[basis.poles])
    factor = 1.0
    for k in range(3):
        expected = factor * ts ** (degree - k) if k <= degree else np.zeros(50)
        np.testing.assert_allclose(found[k], expected, atol=1e-12 * 10**k)
        factor *= degree - k


def test_second_derivatives_of_straight_lines_vanish_exactly():
    knots = np.array([0, 0, 0, 0, 0.5, 1, 1, 1, 1])
    basis = evaluate_basis(knots, 3, np.linspace(0, 1, 20), 2)
    greville = np.array([0, 0.5, 1.5, 2.5, 3]) / 3
    assert np.abs(basis.combine(greville[basis.poles])[2]).max() < 1e-14
    assert np.array_equal(basis.combine(np.full(5, 0.3)[basis.poles])[1], np.zeros(20))


def test_a_rational_quarter_circle():
    knots, weights = np.array([0.0, 0, 0, 1, 1, 1]), np.array([1, np.sqrt(0.5), 1])
    poles = np.array([[1.0, 0], [1, 1], [0, 1]])
    homogeneous = np.column_stack((poles * weights[:, None], weights)).T
    basis = evaluate_basis(knots, 2, np.linspace(0, 1, 33), 2)
    point, rate, bend = divide_by_weights(basis.combine(homogeneous[:, basis.poles]))
    np.testing.assert_allclose((point**2).sum(axis=0), 1.0, atol=1e-15)
    np.testing.assert_allclose((point * rate).sum(axis=0), 0.0, atol=1e-14)
    np.testing.assert_allclose((point * bend).sum(axis=0), -(rate**2).sum(axis=0), atol=1e-13)
