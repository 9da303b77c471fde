"""Antiderivatives are right at every parameter, whatever happens between the breaks."""

import numpy as np
import pytest

from cqblend.errors import GeometryError
from cqblend.splines.antiderivative import Antiderivative, evaluate_legendre, gauss_rule


def test_legendre_and_gauss():
    x = np.linspace(-1, 1, 7)
    np.testing.assert_allclose(evaluate_legendre(3, x)[3], (5 * x**3 - 3 * x) / 2, atol=1e-15)
    assert evaluate_legendre(0, x).shape == (1, 7)
    nodes, weights = gauss_rule(5)
    assert abs(weights @ nodes**9 - 0.1) < 1e-15


@pytest.mark.parametrize(
    ("f", "primitive"),
    [
        (np.cos, np.sin),
        (lambda t: np.exp(1j * t), lambda t: (np.exp(1j * t) - 1) / 1j),
        (lambda t: np.abs(t - 1 / np.pi), lambda t: (np.abs(t - 1 / np.pi) * (t - 1 / np.pi) + np.pi**-2) / 2),
        (lambda t: 1e-3 / (t * t + 1e-6), lambda t: np.arctan(1e3 * t)),
        (lambda t: 0 * t, lambda t: 0 * t),
    ],
)
def test_primitives(f, primitive):
    t = np.linspace(0, 2, 301)
    found = Antiderivative(f, [0.0, 0.7, 2.0])
    assert np.abs(found(t) - primitive(t)).max() < 3e-14
    assert found(t[:12].reshape(3, 4)).shape == (3, 4)
    assert found.values[-1] == pytest.approx(primitive(np.array(2.0)), abs=3e-14)


def test_what_is_not_finite_is_refused():
    with (
        np.errstate(divide="ignore", invalid="ignore"),
        pytest.raises(GeometryError, match=r"t = 0\.\d+: the geometry"),
    ):
        Antiderivative(lambda t: np.where(t > 0.5, np.nan, t), [0.0, 1.0])
