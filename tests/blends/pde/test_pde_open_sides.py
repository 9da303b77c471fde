"""PDE blends between open sides: splines and polynomials along, with end sections that are given or not."""

import math
from functools import cache, partial
from itertools import product

import numpy as np
import pytest
from pde_data import (
    ALONG,
    INSIDE,
    LAPLACE,
    OPEN,
    ORDERS,
    SYMBOLS,
    blend_of,
    ends_of,
    error,
    laplacians,
    measured,
    open_waves,
)
from pde_witness import Waves, hermite, occt_jets

import cqblend


@cache
def open_error(name, basis, minimise, modes, terms):
    equations, waves = [SYMBOLS[name]] * 3, open_waves()
    blend = blend_of(
        waves,
        equations,
        OPEN,
        basis=basis,
        minimise=minimise,
        modes=modes,
        terms=terms,
        ends=ends_of(waves, equations),
        tolerance=1e-2,
    )
    return error(blend, waves, equations, ALONG)


@pytest.mark.parametrize("minimise", ["residual", "energy"])
@pytest.mark.parametrize("name", ["2, Laplace", "4, double", "4, beam", "4, b = -0.5", "6, triple", "6, negative"])
def test_splines_along_converge_to_the_closed_form(name, minimise):
    """By two orders of magnitude for each doubling, between ends of the closed form itself."""
    errors = [open_error(name, "bspline", minimise, modes, 10) for modes in (4, 8, 16)]
    assert errors[2] < errors[1] / 10 < errors[0] / 100
    assert errors[2] < 1e-6


@pytest.mark.parametrize("minimise", ["residual", "energy"])
@pytest.mark.parametrize("name", ["2, Laplace", "4, double", "4, beam", "4, b = -0.5", "6, triple", "6, negative"])
def test_polynomials_along_converge_to_the_closed_form(name, minimise):
    errors = [open_error(name, "polynomial", minimise, modes, 12) for modes in (10, 14, 18)]
    assert errors[1] < errors[0] / 30
    assert errors[2] < 1e-9
    assert errors[2] < errors[1] / 30 or errors[1] < 1e-9  # rounding


@pytest.mark.parametrize("order", [(2, 2, 4), (2, 4, 6)])
def test_mixed_orders_between_given_ends(order):
    equations, waves = [LAPLACE[n] for n in order], open_waves()
    ends = ends_of(waves, equations)
    blend = blend_of(waves, equations, OPEN, ends=ends, basis="polynomial", modes=18, terms=12, tolerance=1e-4)
    assert error(blend, waves, equations, ALONG) < 1e-9


@pytest.mark.parametrize("form", ["exact", "compact"])
@pytest.mark.parametrize("order", [2, 4, 6])
def test_open_faces_are_the_closed_form_within_the_tolerance(order, form):
    """By default the data take as many spans as they need, and between given ends the residual is minimised."""
    equations, waves = [LAPLACE[order]] * 3, open_waves()
    ends = ends_of(waves, equations)
    blend = blend_of(waves, equations, OPEN, ends=ends, terms=12, form=form, tolerance=1e-7)
    assert blend.solution.minimise == "residual"
    t, v = (x.ravel() for x in np.meshgrid(ALONG, INSIDE, indexing="ij"))
    points = occt_jets(blend.face(), t, v)[0].reshape(len(ALONG), len(INSIDE), 3)
    assert np.linalg.norm(points - waves.solution(equations, ALONG, INSIDE), axis=-1).max() <= 1e-7
    if form == "exact":
        for side in (0, 1):
            gap, angle, jump = measured(blend, waves, side, np.linspace(0, 1, 50))
            assert gap <= 1e-13 * waves.size(OPEN)
            assert order < 4 or angle <= 1e-10
            assert order < 6 or jump <= 1e-7 / waves.size(OPEN)


def power(n, r=0):
    """Return (w + i v)^n (w^2 + v^2)^r as coefficients of v^p w^q: its real and imaginary part are (poly)harmonic."""
    out = np.zeros((8, 8), complex)
    for k, i in product(range(n + 1), range(r + 1)):
        out[k + 2 * i, n - k + 2 * (r - i)] += math.comb(n, k) * 1j**k * math.comb(r, i)
    return out


POLYNOMIALS = {
    2: (power(1).real, power(2).real + power(1).imag, power(3).imag),
    4: (power(1).real + power(1, 1).real, power(2, 1).real + power(1).imag, power(4).imag + power(1, 1).imag),
    6: (power(1).real + power(1, 2).real, power(2, 2).imag + power(1).imag, power(1, 2).imag + power(3, 1).real),
}


def polynomial(order, v, w, kv=0, kw=0):
    """Return derivatives of the polynomials at v and w, which broadcast: (.., 3)."""
    p2 = np.polynomial.polynomial
    derived = [p2.polyder(p2.polyder(c, kv, axis=0), kw, axis=1) for c in POLYNOMIALS[order]]
    return np.stack([p2.polyval2d(*np.broadcast_arrays(v, w), c) for c in derived], axis=-1)


@pytest.mark.parametrize("minimise", ["residual", "energy"])
@pytest.mark.parametrize("basis", ["bspline", "polynomial"])
@pytest.mark.parametrize("order", [2, 4, 6])
def test_polynomial_solutions_are_found_exactly(order, basis, minimise):
    """(Poly)harmonic polynomials of degree 5 at most, in the span of all bases: nothing but rounding is left."""
    orders, modes = range(order // 2), {"bspline": 3, "polynomial": 7}[basis]
    f = partial(polynomial, order)
    sides = [cqblend.Boundary(*(lambda w, k=k, e=e: f(e, w, kv=k) for k in orders), domain=OPEN) for e in (0.0, 1.0)]
    ends = tuple(
        cqblend.Boundary(*(lambda v, k=k, e=e: f(v, e, kw=k) for k in orders), domain=OPEN) for e in (0.0, 1.0)
    )
    blend = cqblend.pde_blend(
        *sides, order=order, parameters=1.0, ends=ends, basis=basis, modes=modes, terms=6, minimise=minimise
    )
    w, v = np.meshgrid(ALONG, INSIDE, indexing="ij")
    assert np.abs(blend.solution(w, v) - f(v, w)).max() < 1e-10
    assert np.abs(blend.surface(w, v) - f(v, w)).max() < 1e-7


def sections_of_data(waves, equations, t, v):
    """Return the Hermite section of the data at t, each component of its own order."""
    parts = []
    for i, equation in enumerate(equations):
        first, second = (
            np.array([waves.data(e, k, np.array([t]))[0, i] for k in range(equation.half)])[:, None] for e in (0, 1)
        )
        parts.append(hermite(first, second, v)[:, 0])
    return np.stack(parts, axis=-1)


@pytest.mark.parametrize("minimise", ["residual", "energy"])
@pytest.mark.parametrize("order", ORDERS)
def test_without_ends_the_end_sections_are_those_of_hermite(order, minimise):
    """The surface's within its tolerance, the solution's as far as the functions along hold the data."""
    equations, waves = laplacians(order), open_waves()
    blend = blend_of(waves, equations, OPEN, minimise=minimise, modes=24, terms=5, form="exact", tolerance=1e-8)
    for t in OPEN:
        section = sections_of_data(waves, equations, t, INSIDE)
        assert np.abs(blend.surface(t, INSIDE) - section).max() < 1e-8
        assert np.abs(blend.solution(t, INSIDE) - section).max() < 1e-8
    middle = np.abs(blend.surface(0.5, INSIDE) - sections_of_data(waves, equations, 0.5, INSIDE)).max()
    assert middle > 1e-3  # not the Hermite blend itself


def simply_supported(waves, equation, t, v, count=30):
    """Return what solves the equation with Hermite's end sections and d2f/dw2 = 0 there, for v away from the sides.

    That is a surface ruled between the end sections, and a sine series along whose terms separate. They fade like
    exp(-n pi v): inside, few are enough, although the coefficients fall slowly where conditions do not fit at corners.
    """
    nodes, weights = np.polynomial.legendre.leggauss(4 * count)
    w, weights = (nodes + 1) / 2, weights / 2
    coefs = np.zeros((2, 3, 3, count, 2))
    for e, k in product((0, 1), range(equation.half)):
        first, last = waves.data(e, k, np.array(OPEN))
        rest = waves.data(e, k, w) - first - w[:, None] * (last - first)
        for n in range(count):
            coefs[e, k, :, n, 1] = 2 * (weights * np.sin((n + 1) * np.pi * w)) @ rest
    series = Waves(tuple((np.arange(count) + 1) * np.pi), coefs).solution([equation] * 3, t, v)
    first, last = (sections_of_data(waves, [equation] * 3, e, v) for e in OPEN)
    return series + first + t[:, None, None] * (last - first)


@pytest.mark.parametrize("basis", ["bspline", "polynomial"])
@pytest.mark.parametrize("name", ["2, Laplace", "2, root 2", "4, double", "4, distinct", "4, beam", "4, complex"])
def test_without_ends_the_energy_leaves_other_conditions_natural(name, basis):
    """A plate simply supported at its end sections, with the singularities that it has at its corners."""
    equation, waves = SYMBOLS[name], open_waves()
    v = np.linspace(0.3, 0.7, 5)
    wanted = simply_supported(waves, equation, ALONG, v)
    errors = []
    for modes, terms in ((10, 4), (20, 12)):
        blend = blend_of(waves, [equation] * 3, OPEN, basis=basis, modes=modes, terms=terms, tolerance=1e-4)
        assert blend.solution.minimise == "energy"
        errors.append(np.abs(blend.solution(ALONG[:, None], v) - wanted).max())
    assert errors[1] < 1e-5
    assert errors[1] < errors[0] / 10


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
@pytest.mark.parametrize("name", ["2, Laplace", "4, double", "4, beam"])
def test_spans_and_terms_are_as_many_as_the_tolerance_takes(name, tolerance):
    """Against the sine series, away from the sides only, where that converges."""
    equation, waves = SYMBOLS[name], open_waves()
    v = np.linspace(0.2, 0.8, 7)
    blend = blend_of(waves, [equation] * 3, OPEN, tolerance=tolerance)
    wanted = simply_supported(waves, equation, ALONG, v, count=60)
    assert np.abs(blend.solution(ALONG[:, None], v) - wanted).max() <= tolerance
    assert np.abs(blend.surface(ALONG[:, None], v) - wanted).max() <= 2 * tolerance
    assert blend.solution.change <= tolerance


def test_a_larger_tolerance_takes_fewer_unknowns():
    counts = []
    for tolerance in (1e-2, 1e-3, 1e-4):
        solution = blend_of(open_waves(), [SYMBOLS["4, double"]] * 3, OPEN, tolerance=tolerance).solution
        counts.append(solution.terms * solution.basis.count)
    assert counts[0] < counts[1] < counts[2] / 2


def test_what_is_asked_for_is_not_refined():
    data = open_waves(), [SYMBOLS["4, double"]] * 3, OPEN
    solution = blend_of(*data, terms=5, modes=9, tolerance=1e-3).solution
    assert (solution.terms, solution.basis.spans, solution.change) == (5, 9, 0.0)
    assert blend_of(*data, terms=5, tolerance=1e-3).solution.terms == 5
    assert blend_of(*data, modes=9, tolerance=1e-3).solution.basis.spans == 9


@pytest.mark.parametrize(
    "name",
    ["2, Laplace", "4, double", "4, complex", "4, distinct", "4, beam", "6, triple", "6, complex", "6, distinct"],
)
def test_the_energy_is_stationary(name):
    """The integral of sum c_i (d^(n/2) f / dv^(n/2-i) dw^i)^2, whose symbol is the equation's.

    No bubble that keeps the sides and the end sections changes it to first order. By interpolation of points alone:
    with polynomials along, the solution is one.
    """
    equation, modes, terms, chebyshev = SYMBOLS[name], 12, 8, np.polynomial.chebyshev
    half = equation.half
    blend = blend_of(open_waves(), [equation] * 3, OPEN, basis="polynomial", modes=modes, terms=terms, tolerance=1e-3)
    assert blend.solution.minimise == "energy"
    across, along = 2 * half + terms, modes + 1
    v, w = (np.cos(np.pi * (np.arange(n) + 0.5) / n) for n in (across, along))
    values = blend.solution((w + 1) / 2, (v[:, None] + 1) / 2)  # (v, w, 3)
    matrices = (np.linalg.inv(chebyshev.chebvander(x, len(x) - 1)) for x in (v, w))
    solution = np.einsum("iv,jw,vwc->cij", *matrices, values)

    def bubble(power, degree):
        one = np.polynomial.Polynomial([1, 0, -1]) ** power
        return chebyshev.chebmul(chebyshev.poly2cheb(one.coef), np.eye(degree + 1)[degree])

    nodes, weights = np.polynomial.legendre.leggauss(24)
    area = np.outer(weights, weights)

    def derived(series):  # forms of half the order, on [-1, 1]: common factors do not matter
        parts = [
            chebyshev.chebder(chebyshev.chebder(series, half - i, axis=-2), i, axis=-1)
            for i in range(len(equation.parameters))
        ]
        return [chebyshev.chebgrid2d(nodes, nodes, np.moveaxis(part, 0, -1)) for part in parts]

    def inner(one, other):
        terms_ = zip(equation.parameters, one, other, strict=True)
        return sum(c * np.einsum("ivw,kvw,vw->ik", x, y, area) for c, x, y in terms_)

    bubbles = np.zeros((12, across, along))
    for n, (i, k) in enumerate(product(range(3), range(4))):
        one = np.outer(bubble(half, i), bubble(1, k))
        bubbles[n, : one.shape[0], : one.shape[1]] = one
    one, other = derived(solution), derived(bubbles)
    sizes = np.sqrt(np.outer(np.diag(inner(one, one)), np.diag(inner(other, other))))
    assert np.abs(inner(one, other) / sizes).max() < 1e-9
    moved = derived(solution + 1e-3 * bubbles[:3])
    assert np.abs(inner(moved, other) / sizes).max() > 1e-6
