"""Symmetries of the solutions of PDE blends: motions, linearity, the order of the sides, the choice of the basis."""

import numpy as np
import pytest
from pde_data import ALONG, OPEN, ORDERS, T, V, blend_of, error, laplacians, open_waves, wavy
from pde_witness import Waves


@pytest.mark.parametrize("domain", [None, OPEN])
@pytest.mark.parametrize("order", ORDERS)
def test_solutions_move_with_their_data(order, domain):
    waves, by = wavy() if domain is None else open_waves(), np.array([10.0, -25.0, 3.0])
    t, options = ALONG[:, None], {"terms": 8, "form": "exact", "modes": 8}
    one, other = (blend_of(some, laplacians(order), domain, **options) for some in (waves, waves.moved(by)))
    assert np.abs(other.solution(t, V) - by - one.solution(t, V)).max() < 1e-11
    assert np.abs(other.surface(t, V) - by - one.surface(t, V)).max() < 1e-10


@pytest.mark.parametrize("domain", [None, OPEN])
@pytest.mark.parametrize("order", ORDERS)
def test_solutions_are_linear_in_their_data(order, domain):
    waves = wavy() if domain is None else open_waves()
    more = Waves(waves.frequencies, Waves.random(10, waves.frequencies).coefs)
    both = Waves(waves.frequencies, 2 * waves.coefs - more.coefs)
    solutions = [
        blend_of(some, laplacians(order), domain, terms=8, modes=8, tolerance=1e-4).solution(ALONG[:, None], V)
        for some in (waves, more, both)
    ]
    assert np.abs(2 * solutions[0] - solutions[1] - solutions[2]).max() < 1e-11


@pytest.mark.parametrize("domain", [None, OPEN])
@pytest.mark.parametrize("order", ORDERS)
def test_solutions_do_not_know_which_side_is_first(order, domain):
    """With sides swapped, v becomes 1 - v, and odd derivatives change their signs."""
    waves = wavy() if domain is None else open_waves()
    swapped = Waves(waves.frequencies, waves.coefs[::-1] * np.array([1, -1, 1])[:, None, None, None])
    one, other = (
        blend_of(some, laplacians(order), domain, terms=8, modes=8, form="exact") for some in (waves, swapped)
    )
    t = ALONG[:, None]
    assert np.abs(one.solution(t, V) - other.solution(t, 1 - V)).max() < 1e-11
    assert np.abs(one.surface(t, V) - other.surface(t, 1 - V)).max() < 1e-7


@pytest.mark.parametrize("order", [4, (2, 4, 6)])
def test_waves_and_periodic_splines_agree(order):
    waves, equations = wavy(), laplacians(order)
    one = blend_of(waves, equations, basis="trigonometric", terms=12, tolerance=1e-4)
    other = blend_of(waves, equations, basis="bspline", modes=48, terms=12, tolerance=1e-4)
    assert np.abs(one.solution(T[:, None], V) - other.solution(T[:, None], V)).max() < 1e-7
    assert error(other, waves, equations) < 1e-7
    for k in range(2):
        assert np.abs(other.solution(0.0, V, kv=k) - other.solution(2 * np.pi, V, kv=k)).max() < 1e-11


@pytest.mark.parametrize("minimise", ["residual", "energy"])
@pytest.mark.parametrize("order", [2, 4, 6])
def test_periodic_splines_converge_to_the_closed_form(order, minimise):
    waves, equations = wavy(), laplacians(order)
    errors = [
        error(
            blend_of(waves, equations, basis="bspline", minimise=minimise, modes=n, terms=10, tolerance=1e-3),
            waves,
            equations,
        )
        for n in (12, 24, 48)
    ]
    assert errors[2] < errors[1] / 10 < errors[0] / 100
