"""The equations hold inside PDE blends, by differences of points; the residual is what it is said to be."""

import numpy as np
import pytest
from pde_data import SYMBOLS, blend_of, error, wavy
from pde_witness import Waves, central, hermite

REACH, STEP = 8, 0.04


def residual_by_differences(solution, equation, component, t, v):
    """Return what is left of an equation, and the sum of its terms' sizes, by differences of points alone."""
    steps = np.arange(-REACH, REACH + 1) * STEP
    values = solution(t[:, None, None, None] + steps[:, None], v[:, None, None] + steps)[..., component]
    left = size = 0.0
    for i, c in enumerate(equation.parameters):
        kv, kw = equation.order - 2 * i, 2 * i
        # a difference of order 0 is the value itself
        term = c * np.einsum("tvab,a,b->tv", values, central(kw, REACH, STEP), central(kv, REACH, STEP))
        left, size = left + term, size + np.abs(term)
    return np.sqrt((left**2).mean()), np.sqrt((size**2).mean())


@pytest.mark.parametrize(
    "name", ["2, root 2", "4, double", "4, b = -0.5", "4, complex", "6, triple", "6, double", "6, negative"]
)
def test_the_equation_holds_inside(name):
    """By central differences of points of the solution, on data that do not separate."""
    equation, waves = SYMBOLS[name], Waves.random(5, (0, 1, 2), apart=3)
    blend = blend_of(waves, [equation] * 3, terms=14, tolerance=1e-4)
    t, v = np.linspace(0.3, 6, 7), np.linspace(0.35, 0.65, 4)
    for component in range(3):
        left, size = residual_by_differences(blend.solution, equation, component, t, v)
        assert blend.solution.residual[component] < 1e-8
        assert left < 3e-6 * size


def residual_share(solution, waves, equation):
    """Return the residuals of x, y and z as a share of the Hermite interpolant's, by interpolation of points alone.

    Across by polynomials through Chebyshev nodes, along by Fourier transforms; both hold the solution exactly.
    """
    n, along = solution.terms + equation.order + 2, 32
    nodes = (1 - np.cos(np.pi * (np.arange(n) + 0.5) / n)) / 2
    t = np.arange(along) * 2 * np.pi / along
    sides = [[waves.data(e, k, t).ravel() for k in range(equation.half)] for e in (0, 1)]
    carried = hermite(*map(np.array, sides), nodes).reshape(n, along, 3).swapaxes(0, 1)
    at, weights = np.polynomial.legendre.leggauss(n)
    frequency = np.fft.fftfreq(along, 1 / along)
    norms = []
    for values in (solution(t[:, None], nodes), carried):
        waved = np.fft.fft(values, axis=0)
        left = 0.0
        for i, c in enumerate(equation.parameters):
            term = np.fft.ifft((-(frequency**2))[:, None, None] ** i * waved, axis=0).real
            series = np.polynomial.chebyshev.chebfit(2 * nodes - 1, np.moveaxis(term, 1, 0).reshape(n, -1), n - 1)
            derived = np.polynomial.chebyshev.chebder(series, equation.order - 2 * i) * 2.0 ** (equation.order - 2 * i)
            left = left + c * np.polynomial.chebyshev.chebval(at, derived).reshape(along, 3, n)
        norms.append(np.sqrt((left**2 @ weights).mean(axis=0)))
    return norms[0] / norms[1]


@pytest.mark.parametrize("name", ["2, Laplace", "4, double", "4, b = -0.5", "6, triple", "6, negative"])
@pytest.mark.parametrize("terms", [2, 4])
def test_the_residual_is_what_it_is_said_to_be(name, terms):
    """The root mean square of what is left, as a share of that of the Hermite interpolant: measured from points."""
    equation, waves = SYMBOLS[name], Waves.random(6, (1, 2, 4))
    blend = blend_of(waves, [equation] * 3, terms=terms, tolerance=1e-4)
    share = residual_share(blend.solution, waves, equation)
    assert min(share) > 1e-6
    np.testing.assert_allclose(blend.solution.residual, share, rtol=0.02)
    assert blend.certificate.residual == pytest.approx(max(blend.solution.residual))


@pytest.mark.parametrize("name", ["2, Laplace", "4, double", "4, complex", "6, triple", "6, negative"])
def test_the_residual_tells_few_terms_from_enough(name):
    equation, waves = SYMBOLS[name], Waves.random(7, [4])
    few, enough = (blend_of(waves, [equation] * 3, terms=n, tolerance=1e-4).solution for n in (2, 12))
    assert min(few.residual) > 1e-4
    assert max(enough.residual) < 1e-7


@pytest.mark.parametrize("name", ["2, Laplace", "4, complex", "6, negative"])
def test_more_collocation_points_do_not_matter(name):
    equations, waves = [SYMBOLS[name]] * 3, wavy()
    for points in (12, 30, (16, 40)):
        blend = blend_of(waves, equations, terms=12, points=points, tolerance=1e-4)
        assert error(blend, waves, equations) < 1e-10
