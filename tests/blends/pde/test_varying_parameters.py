"""Parameters that vary along the blend, against closed forms, and spectral differences of the equation itself."""

from math import comb

import numpy as np
import pytest
from pde_data import ALONG, INSIDE, LAPLACE, V, open_waves, wavy

import cqblend
from cqblend.errors import InputError

CLOSED = np.linspace(0.1, 6.2, 11)


def phase(w, kw=0):
    """Return w + 0.4 sin w, which goes once around as w does, or its derivative."""
    return w + 0.4 * np.sin(w) if kw == 0 else 1 + 0.4 * np.cos(w)


@pytest.mark.parametrize("minimise", ["residual", "energy"])
@pytest.mark.parametrize("width", [True, False])
def test_laplaces_equation_at_another_speed(width, minimise):
    """With F harmonic in v and p, f(v, w) = F(v, p(w)) solves p' f_vv + (f_w / p')_w = 0: a strip of width 1 / p'."""
    waves = wavy(apart=2.0)
    sides = [cqblend.Boundary(lambda w, e=e: waves.data(e, 0, phase(w))) for e in (0, 1)]
    parameters = (lambda w: 1 / phase(w, 1)) if width else (lambda w: phase(w, 1), lambda w: 1 / phase(w, 1))
    blend = cqblend.pde_blend(*sides, order=2, parameters=parameters, minimise=minimise, tolerance=1e-8)
    wanted = waves.solution([LAPLACE[2]] * 3, phase(CLOSED), V)
    assert np.linalg.norm(blend.solution(CLOSED[:, None], V) - wanted, axis=-1).max() < 1e-8
    assert np.linalg.norm(blend.surface(CLOSED[:, None], V) - wanted, axis=-1).max() < 2e-8


@pytest.mark.parametrize("minimise", ["residual", "energy"])
@pytest.mark.parametrize("order", [2, 4, 6])
def test_waves_that_grow_along_an_open_blend(order, minimise):
    """f = w sin(k v) solves the equation if a = 1, b = b0 + (k w)^2 / 2, whatever further parameters are.

    So does v, and above order 2 w.
    """
    k = 1.7
    parameters = (1, lambda w: 2 + (k * w) ** 2 / 2, lambda w: 1 + np.exp(-w), lambda w: 2 + np.cos(3 * w))[
        : order // 2 + 1
    ]

    def f(v, w, kv=0, kw=0):
        wave = k**kv * np.sin(k * v + kv * np.pi / 2)
        growth = (w, 1.0, 0.0)[kw] * wave
        slow = w if (kv, kw) == (0, 0) else float((kv, kw) == (0, 1))
        steady = v if (kv, kw) == (0, 0) else float((kv, kw) == (1, 0))
        return np.stack(np.broadcast_arrays(growth, slow + 0 * growth, steady), axis=-1)

    orders = range(order // 2)
    sides = [cqblend.Boundary(*(lambda w, r=r, e=e: f(e, w, kv=r) for r in orders), domain=(1, 2)) for e in (0.0, 1.0)]
    ends = tuple(
        cqblend.Boundary(*(lambda v, r=r, e=e: f(v, e, kw=r) for r in orders), domain=(0, 1)) for e in (1.0, 2.0)
    )
    blend = cqblend.pde_blend(
        *sides, order=order, parameters=parameters, ends=ends, modes=3, terms=12, minimise=minimise, tolerance=1e-7
    )
    w, v = np.meshgrid(1 + ALONG, INSIDE, indexing="ij")
    solving = [0, 2] if order == 2 else [0, 1, 2]
    assert np.abs(blend.solution(w, v) - f(v, w))[..., solving].max() < 1e-9


@pytest.mark.parametrize("minimise", ["residual", "energy"])
@pytest.mark.parametrize("order", [4, 6])
def test_the_equation_holds_inside(order, minimise):
    """By differences over all points of a grid of Chebyshev's points across and even ones along."""
    waves = wavy(apart=2.0)
    half = order // 2
    functions = [lambda w: 1.5 + np.sin(w), lambda w: 0 * w, lambda w: 2 + np.cos(2 * w), lambda w: 1 + 0.3 * np.sin(w)]
    coefficients = [*functions[:half], functions[3]]
    sides = [cqblend.Boundary(*(lambda w, r=r, e=e: waves.data(e, r, w) for r in range(half))) for e in (0, 1)]
    parameters = [0 if i == 1 else c for i, c in enumerate(coefficients)]
    blend = cqblend.pde_blend(
        *sides, order=order, parameters=parameters, modes=24, terms=14, minimise=minimise, tolerance=1e-3
    )
    n, m = 64, 2 * half + 14
    w, x = 2 * np.pi * np.arange(n) / n, np.cos(np.pi * np.arange(m) / (m - 1))
    values = blend.solution(w[:, None], (1 + x) / 2)  # (n, m, 3)

    def along(f, k):
        waves = np.fft.fft(f, axis=0)
        return np.fft.ifft(waves * (1j * np.fft.fftfreq(n, 1 / n)[:, None, None]) ** k, axis=0).real

    series = np.linalg.solve(np.polynomial.chebyshev.chebvander(x, m - 1), values)  # broadcasts over w

    def across(k):
        if k == 0:
            return values
        derived = np.polynomial.chebyshev.chebder(series, k, scl=2, axis=1)
        return np.polynomial.chebyshev.chebvander(x, derived.shape[1] - 1) @ derived

    terms = [along(c(w)[:, None, None] * along(across(order - 2 * i), i), i) for i, c in enumerate(coefficients)]
    size = max(np.abs(term).max() for term in terms)
    assert np.abs(sum(terms))[:, 2:-2].max() < 1e-5 * size


@pytest.mark.parametrize("order", [2, 4, 6, (2, 4, 6)])
@pytest.mark.parametrize("domain", [None, (0, 1)])
def test_functions_that_are_constant_are_numbers(order, domain):
    waves = wavy(apart=2.0) if domain is None else open_waves()
    numbers = [tuple(comb(n // 2, i) * 1.3 ** (2 * i) for i in range(n // 2 + 1)) for n in np.broadcast_to(order, 3)]
    functions = [(lambda w, a=row[0]: a + 0 * w, *row[1:]) for row in numbers]
    sides = [
        cqblend.Boundary(*(lambda w, r=r, e=e: waves.data(e, r, w) for r in range(3)), domain=domain) for e in (0, 1)
    ]
    options = {"order": order, "terms": 9, "modes": 10, "tolerance": 1e-3}
    wanted = cqblend.pde_blend(*sides, parameters=numbers, **options).solution
    t = CLOSED if domain is None else ALONG
    for parameters in (functions, (lambda w: 1.3 + 0 * w)):
        found = cqblend.pde_blend(*sides, parameters=parameters, **options).solution
        assert np.abs(found(t[:, None], INSIDE) - wanted(t[:, None], INSIDE)).max() < 1e-8


def test_the_local_distance_keeps_sections_from_folding():
    """Where the distance varies from 0.05 to 8 mm, the mean distance lets waves along cross the narrow end."""

    def distance(w):
        return 0.05 + 7.95 * w**2

    low = cqblend.Boundary((lambda w: 10 * w, lambda w: 0.1 * np.sin(9 * w), 0), domain=(0, 1))
    high = cqblend.Boundary(
        (lambda w: 10 * w, lambda w: distance(w) + 0.1 * np.sin(9 * w + 0.5), distance), domain=(0, 1)
    )
    t, v = np.linspace(0, 1, 101)[:, None], np.linspace(0, 1, 33)

    def least_progress(parameters):
        surface = cqblend.pde_blend(low, high, order=2, parameters=parameters, tolerance=1e-4).surface
        chord = surface(t, np.ones((1, 1))) - surface(t, np.zeros((1, 1)))
        return ((surface(t, v, 0, 1) * chord).sum(axis=-1) / (chord**2).sum(axis=-1)).min()

    assert least_progress(None) < -0.5
    assert least_progress("local") > 0.3
    own = least_progress(lambda w: distance(w) * np.sqrt(2) / 10)
    assert own > 0.03


BAD = {
    "negative": (lambda w: np.cos(w), "parameters is -1 at w = 3.14"),
    "not closed": (lambda w: 1 + w, "1 at the start of closed rails and 7.28"),
    "a corner": (lambda w: 1 + np.abs(np.sin(w - 3)), "not smooth along the rails"),
    "two for one": (lambda w: np.stack([w, w]), "as many numbers"),
    "not a number": (lambda w: w * np.nan, "a parameter is nan"),
    "raises": (lambda w: {}[0], "take an array of w"),
    "last": ((1, lambda w: np.sin(w)), "parameter b is -1"),
    "first": ((lambda w: 0 * w, 1), "parameter a is 0"),
    "too many": ((1, lambda w: 1 + 0 * w, 1), "has 2 parameters"),
    "words": ("far", '"local"'),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_functions_are_named(name):
    parameters, message = BAD[name]
    sides = [cqblend.Boundary((np.cos, np.sin, height)) for height in (0, 1)]
    with pytest.raises(InputError, match=message):
        cqblend.pde_blend(*sides, order=2, parameters=parameters)
