"""Interpolation between the nearest nodes: polynomials come out as they are, and errors fall as they must."""

import numpy as np
import pytest

from cqblend.splines.local_interpolation import interpolate_locally, tabulate_node_derivatives

RNG = np.random.default_rng(11)
NODES = np.sort(RNG.random(23))
T = np.concatenate([RNG.uniform(-0.02, 1.02, 60), NODES[[0, 5, -1]]])


@pytest.mark.parametrize("count", [2, 4, 6])
def test_polynomials_are_reproduced(count):
    coefs = RNG.normal(size=(count, 3, 2))

    def evaluate(t):
        return np.einsum("kij,kn->nij", coefs, t ** np.arange(count)[:, None])

    found = interpolate_locally(NODES, evaluate(NODES), T, count)
    assert found.shape == (len(T), 3, 2)
    assert np.abs(found - evaluate(T)).max() < 1e-9


def test_values_at_nodes_are_exact():
    values = RNG.normal(size=(len(NODES), 4))
    assert np.array_equal(interpolate_locally(NODES, values, NODES, 6), values)


@pytest.mark.parametrize("count", [4, 6])
def test_errors_fall_with_the_order(count):
    t = RNG.random(200)
    errors = []
    for n in (33, 65):
        nodes = np.linspace(0, 1, n)
        errors.append(np.abs(interpolate_locally(nodes, np.sin(9 * nodes), t, count) - np.sin(9 * t)).max())
    assert errors[0] / errors[1] > 0.7 * 2**count


def test_no_polynomial_goes_across_a_kink():
    kinks = NODES[[6, 13]]

    def evaluate(t):
        return t**3 - 40 * np.maximum(t - kinks[0], 0) + 70 * np.maximum(t - kinks[1], 0) ** 2

    t = np.concatenate([T, kinks, kinks - 1e-9, kinks + 1e-9])
    assert np.abs(interpolate_locally(NODES, evaluate(NODES), t, 6, kinks) - evaluate(t)).max() < 1e-9
    assert np.abs(interpolate_locally(NODES, evaluate(NODES), t, 6) - evaluate(t)).max() > 1e-2


@pytest.mark.parametrize("count", [2, 5, 8])
def test_derivatives_of_polynomials_through_nodes_are_exact(count):
    nodes = RNG.permutation(NODES)[:count]
    coefs = RNG.normal(size=(count, 2))
    values, slopes = (np.stack([np.polyval(p, nodes) for p in q], -1) for q in (coefs.T, map(np.polyder, coefs.T)))
    assert tabulate_node_derivatives(nodes) @ values == pytest.approx(slopes, abs=1e-8)
