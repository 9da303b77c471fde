"""Solutions of PDE blends between closed sides against closed forms in 50 digits, and these against the equations."""

import math

import mpmath as mp
import numpy as np
import pytest
from pde_data import LAPLACE, MIXED, SYMBOLS, T, V, blend_of, boundary, error, wavy
from pde_witness import DIGITS, Waves, symbol, unit_in_digits

import cqblend


@pytest.mark.parametrize("name", SYMBOLS)
def test_the_closed_form_solves_the_equation_and_has_its_boundary_data(name):
    """By differences in 50 digits: the oracle stands on the equation, not on its own algebra."""
    equation, j = SYMBOLS[name], 2.0
    with mp.workdps(DIGITS):
        for at in ("0.3", "0.8"):

            def value(v):
                return sum((1 + i) * x for i, x in enumerate(unit_in_digits(equation, j, v)))

            terms = [
                (-1) ** i
                * c
                * mp.mpf(j) ** (2 * i)
                * mp.diff(value, mp.mpf(at), equation.order - 2 * i, h=mp.mpf("1e-5"))
                for i, c in enumerate(equation.parameters)
            ]
            assert abs(sum(terms)) < 1e-8 * max(map(abs, terms))
        n = equation.half
        rows = [unit_in_digits(equation, j, e, k) for e in (0, 1) for k in range(n)]
        assert all(abs(rows[i][k] - (i == k)) < 1e-30 for i in range(2 * n) for k in range(2 * n))


STEEP = 4.0  # number of the wave times largest root, up to which 12 terms do


@pytest.mark.parametrize(
    ("name", "j"),
    [(name, j) for name, one in SYMBOLS.items() for j in (1, 2, 4, 8) if j * one.steepest() <= STEEP + 1e-9],
)
def test_single_waves_with_twelve_terms(name, j):
    """Amplitude 1, all kinds of roots: 1e-10 with 12 terms where no layer is steeper than exp(-4 v)."""
    equation, waves = SYMBOLS[name], Waves.random(j, [j])
    blend = blend_of(waves, [equation] * 3, terms=12, tolerance=1e-3)
    assert blend.solution.terms == 12
    assert error(blend, waves, [equation] * 3) < 1e-10
    assert max(blend.solution.residual) < 1e-7


@pytest.mark.parametrize(
    ("name", "j"),
    [(name, 16) for name in SYMBOLS] + [(name, 8) for name in ("2, root 2", "4, double", "6, negative")],
)
def test_steep_waves_with_as_many_terms_as_it_takes(name, j):
    """1e-10 for waves whose layers are as thin as 1/32 of the blend."""
    equation = SYMBOLS[name]
    waves = Waves.random(j, [j])
    blend = blend_of(waves, [equation] * 3, terms="auto", tolerance=1e-2)
    assert error(blend, waves, [equation] * 3) < 1e-10


@pytest.mark.parametrize("terms", [12, "auto"])
@pytest.mark.parametrize("order", MIXED)
def test_every_component_solves_an_equation_of_its_own(order, terms):
    equations = [SYMBOLS[name] for name in MIXED[order]]
    waves = Waves.random(1, (0, 1, 2), apart=3)
    blend = blend_of(waves, equations, terms=terms, tolerance=1e-4)
    assert error(blend, waves, equations) < 1e-10
    for i in range(3):  # and no equation of another
        others = [equations[(i + 1) % 3]] * 3
        if others[0] != equations[i]:
            apart = np.abs(blend.solution(T[:, None], V) - waves.solution(others, T, V))[..., i].max()
            assert apart > 1e-3


def test_parameters_differ_by_component_at_one_order():
    equations = [SYMBOLS[f"4, {name}"] for name in ("complex", "double", "b = -0.5")]
    waves = Waves.random(2, (0, 1, 3), apart=3)
    assert error(blend_of(waves, equations, terms=12, tolerance=1e-4), waves, equations) < 1e-10


@pytest.mark.parametrize("order", [2, 4, 6])
@pytest.mark.parametrize("s", [0.5, 1.5])
def test_a_number_stands_for_powers_of_laplaces_operator(order, s):
    """(d2/dv2 + s^2 d2/dw2)^(n/2)."""
    waves, equation = wavy(), symbol(((s * s,), order // 2))
    sides = [boundary(waves, side) for side in (0, 1)]
    blend = cqblend.pde_blend(*sides, order=order, parameters=s, tolerance=1e-4)
    assert error(blend, waves, [equation] * 3) < 1e-10


RADIUS, APART = 2.0, 3.0


def equal_circles():
    """Return data on two circles: their lengths, scaled to 2 pi, are their parameters."""
    coefs = np.zeros((2, 3, 3, 3, 2))
    coefs[:, 0, 0, 1, 0] = coefs[:, 0, 1, 1, 1] = RADIUS
    coefs[1, 0, 2, 0, 0] = APART
    coefs[:, 1:, :, 2] = 0.4
    coefs[:, 1, 2, 0, 0] = 3.0
    return Waves((0.0, 1.0, 3.0), coefs)


@pytest.mark.parametrize("order", [2, 4, 6])
def test_by_default_both_parameters_count_in_lengths(order):
    """Between equal circles: s is their distance over their radius."""
    waves, equation = equal_circles(), symbol((((APART / RADIUS) ** 2,), order // 2))
    sides = [boundary(waves, side) for side in (0, 1)]
    assert error(cqblend.pde_blend(*sides, order=order, tolerance=1e-4), waves, [equation] * 3) < 1e-10


@pytest.mark.parametrize("s", [None, 1.0])
@pytest.mark.parametrize("order", [2, 4])
def test_rails_of_boundary_data_give_the_same_solution(order, s):
    """On circles the length is the parameter. Between rails the surface is the solution to 1e-5 of their distance."""
    waves, equation = equal_circles(), symbol((((s or APART / RADIUS) ** 2,), order // 2))
    rails = [boundary(waves, side, 2).rail(side + 1) for side in (0, 1)]
    up = cqblend.Combination(cqblend.Curve.bezier([[0.0, 1.0], [0.0, 1.0]], domain=(0, 2 * np.pi)))
    blend = cqblend.pde_blend(*rails, order=order, parameters=s, terms=14, tangents=up, length="field")
    assert error(blend, waves, [equation] * 3) < 1e-9
    assert np.abs(blend.surface(T[:, None], V) - waves.solution([equation] * 3, T, V)).max() < 1e-5 * APART


@pytest.mark.parametrize("domain", [(0.0, 3.0), (-1.0, 2 * math.pi - 1), (2.0, 12.0)])
@pytest.mark.parametrize(("basis", "modes", "limit"), [("auto", "auto", 1e-10), ("bspline", 40, 2e-6)])
def test_along_counts_in_the_parameter_of_the_data(domain, basis, modes, limit):
    """On any period, w is t itself."""
    period = domain[1] - domain[0]
    waves = Waves.random(4, np.array([0, 1, 2]) * 2 * np.pi / period, apart=3)
    equations = [SYMBOLS["4, complex"]] * 3
    blend = blend_of(waves, equations, domain, basis=basis, modes=modes, terms=12, tolerance=1e-4)
    assert blend.surface.domain[0] == pytest.approx(domain)
    assert error(blend, waves, equations, t=np.linspace(*domain, 9)) < limit


def test_derivatives_across_are_those_of_the_closed_form():
    waves, equations = wavy(), [LAPLACE[6]] * 3
    blend = blend_of(waves, equations, terms=14)
    for k in range(4):
        apart = blend.solution(T[:, None], V, kv=k) - waves.solution(equations, T, V, kv=k)
        assert np.abs(apart).max() < 1e-10 * 100**k


@pytest.mark.parametrize("j", [16, 20, 24, 32])
@pytest.mark.parametrize("phase", [0.0, 1.0])
def test_smooth_functions_are_taken_as_data(j, phase):
    """A wave is smooth, whatever its number."""
    side = cqblend.Boundary((lambda t: np.cos(j * t + phase), np.sin, 0))
    t = np.linspace(0.1, 6, 31)
    assert np.abs(side.curves[0](t)[:, 0] - np.cos(j * t + phase)).max() < 1e-11
