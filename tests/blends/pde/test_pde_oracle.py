"""The solutions of PDE blends against closed forms in 50 digits, and against the equations themselves.

Nothing of cqblend but its public interface is used: closed forms, differences and OCCT's derivatives are those of
``pde_witness``.
"""

import math
from functools import cache, partial
from itertools import product

import mpmath as mp
import numpy as np
import pytest
from pde_witness import (
    DIGITS,
    Waves,
    central,
    contact,
    hermite,
    hyperboloid_with_torus,
    occt_jets,
    symbol,
    unit_in_digits,
)

import cqblend
from cqblend.errors import CqblendError, GeometryError, InputError

SYMBOLS = {
    "2, Laplace": symbol(((1,), 1)),
    "2, root 2": symbol(((4,), 1)),
    "2, negative": symbol(((0.25,), 1), leading=-3),
    "4, distinct": symbol(((1,), 1), ((4,), 1)),
    "4, double": symbol(((1,), 2)),
    "4, complex": symbol(((1, 1), 1)),
    "4, beam": symbol(((0, 1), 1)),
    "4, b = -0.5": symbol(((-0.5, 1), 1)),
    "4, b = -1.5": symbol(((-1.5, 1), 1), leading=2),
    "6, distinct": symbol(((0.25,), 1), ((1,), 1), ((4,), 1)),
    "6, double": symbol(((1,), 2), ((4,), 1)),
    "6, triple": symbol(((1,), 3)),
    "6, complex": symbol(((1,), 1), ((1, 1), 1)),
    "6, negative": symbol(((0.5,), 1), ((-1, 1), 1)),
}
LAPLACE = {2: SYMBOLS["2, Laplace"], 4: SYMBOLS["4, double"], 6: SYMBOLS["6, triple"]}
MIXED = {
    (2, 2, 4): ("2, Laplace", "2, root 2", "4, complex"),
    (2, 2, 6): ("2, negative", "2, Laplace", "6, double"),
    (4, 4, 6): ("4, b = -0.5", "4, double", "6, triple"),
    (2, 4, 6): ("2, root 2", "4, distinct", "6, complex"),
    (6, 4, 2): ("6, negative", "4, beam", "2, Laplace"),
}
ORDERS = [2, 4, 6, (2, 4, 6)]
T = np.linspace(0.1, 6.2, 11)
V = np.array([0, 0.004, 0.03, 0.2, 0.45, 0.5, 0.71, 0.93, 0.99, 1])
INSIDE = np.linspace(0, 1, 21)


def boundary(waves, side, half=3, domain=None):
    """Return the data of side 0 or 1 with so many derivatives."""
    return cqblend.Boundary(*(lambda t, k=k: waves.data(side, k, t) for k in range(half)), domain=domain)


def blend_of(waves, equations, domain=None, **options):
    """Blend the data by equations, each with its parameters."""
    half = max(one.half for one in equations)
    return cqblend.pde_blend(
        boundary(waves, 0, half, domain),
        boundary(waves, 1, half, domain),
        order=tuple(one.order for one in equations),
        parameters=[one.parameters for one in equations],
        **options,
    )


def laplacians(order):
    """Return the powers of Laplace's operator for x, y and z."""
    return [LAPLACE[n] for n in np.broadcast_to(order, 3).tolist()]


def error(blend, waves, equations, t=T, v=V):
    """Return the largest distance of the solution from the closed form."""
    return np.linalg.norm(blend.solution(t[:, None], v) - waves.solution(equations, t, v), axis=-1).max()


@cache
def wavy(apart=4.0):
    """Return data of a few waves, different on both sides, with a circle among them, so that they span a surface."""
    waves = Waves.random(3, (0, 1, 2, 3), apart=apart, sizes=(0.5, 0.3, 0.1, 0.1))
    coefs = waves.coefs.copy()
    coefs[:, 0, 0, 1, 0] += 3
    coefs[:, 0, 1, 1, 1] += 2
    coefs[:, 1, 2, 0, 0] += apart
    return Waves(waves.frequencies, coefs)


DATA = {"waves": wavy, "hyperboloid with torus": hyperboloid_with_torus}


# The witness itself.


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


# 1. Closed forms.

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


# 2. Surfaces and faces.


@pytest.mark.parametrize("data", DATA)
@pytest.mark.parametrize("form", ["exact", "compact"])
@pytest.mark.parametrize("tolerance", [1e-7, 1e-9])
@pytest.mark.parametrize("order", [2, 4, 6, (2, 4, 6)])
def test_the_face_is_the_closed_form_within_the_tolerance(data, form, tolerance, order):
    waves = DATA[data]()
    equations = laplacians(order)
    blend = blend_of(waves, equations, form=form, tolerance=tolerance)
    assert blend.form == form
    t = np.linspace(0, 2 * np.pi, 24)
    closed_form = waves.solution(equations, t, INSIDE)
    apart = np.linalg.norm(blend.surface(t[:, None], INSIDE) - closed_form, axis=-1).max()
    assert apart <= tolerance
    tt, vv = (x.ravel() for x in np.meshgrid(t, INSIDE, indexing="ij"))
    points = occt_jets(blend.face(), tt, vv)[0].reshape(closed_form.shape)
    assert np.linalg.norm(points - closed_form, axis=-1).max() <= tolerance


def measured(blend, waves, side, t):
    """Return gap, angle and jump of the normal curvature of the face against what the data say."""
    c, ct, ctt = (waves.data(side, 0, t, k) for k in range(3))
    d, dt = (waves.data(side, 1, t, k) for k in range(2))
    wanted = np.stack([c, ct, d, ctt, waves.data(side, 2, t), dt])
    return contact(occt_jets(blend.face(), t, np.full_like(t, float(side))), wanted)


@pytest.mark.parametrize("data", DATA)
@pytest.mark.parametrize("order", [2, 4, 6, (2, 2, 4), (2, 2, 6), (4, 4, 6), (2, 4, 6)])
def test_exact_faces_keep_position_planes_and_curvature_of_the_data(data, order):
    """1e-13 of the size, 1e-10 rad, 1e-7 of 1/size: as much as the lowest order says, and no more."""
    waves = DATA[data]()
    lowest = min(np.atleast_1d(order))
    sides = [boundary(waves, side) for side in (0, 1)]
    blend = cqblend.pde_blend(*sides, order=order, parameters=1.0, form="exact")
    t = np.linspace(0, 2 * np.pi, 120)
    for side in (0, 1):
        gap, angle, jump = measured(blend, waves, side, t)
        record = blend.certificate.rails[side]
        assert gap <= 1e-13 * waves.size()
        assert record.gap <= 1e-13 * waves.size()
        if lowest >= 4:
            assert angle <= 1e-10
            assert record.angle <= 1e-10
        else:
            assert angle > 1e-2
            assert record.angle == pytest.approx(angle, rel=1e-2)
        if lowest == 6:
            assert jump <= 1e-7 / waves.size()
            assert record.curvature_jump <= 1e-7 / waves.size()
        else:
            assert jump > 1e-3
        if lowest == 4:
            assert record.curvature_jump == pytest.approx(jump, rel=1e-2)


@pytest.mark.parametrize(("tolerance", "angular"), [(1e-7, 1e-5), (1e-5, 1e-4)])
@pytest.mark.parametrize("order", [4, 6])
def test_compact_faces_keep_position_and_planes_within_the_tolerances(order, tolerance, angular):
    waves = hyperboloid_with_torus()
    blend = blend_of(waves, [LAPLACE[order]] * 3, form="compact", tolerance=tolerance, angular_tolerance=angular)
    for side in (0, 1):
        gap, angle, _ = measured(blend, waves, side, np.linspace(0, 2 * np.pi, 120))
        assert gap <= tolerance
        assert angle <= angular
        assert blend.certificate.rails[side].gap <= tolerance


def test_what_is_not_known_of_the_data_is_not_a_number():
    """Without derivatives there is no tangent plane to measure against, nor a curvature."""
    waves = wavy()
    for half, known in ((1, (False, False)), (2, (True, False)), (3, (True, True))):
        sides = [boundary(waves, side, half) for side in (0, 1)]
        record = cqblend.pde_blend(*sides, order=2, parameters=1.0).certificate.rails[0]
        assert (np.isfinite(record.angle), np.isfinite(record.curvature_jump)) == known
        assert record.gap < 1e-12


# 3. The equations themselves.

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


# 4. Open sides.

OPEN = (0.0, 1.0)
ALONG = np.linspace(0, 1, 9)


@cache
def open_waves():
    """Return data whose solutions separate, but not into waves that are periodic on the domain."""
    waves = Waves.random(8, (0, 1.3, 2.7, 3.4), apart=2, sizes=(0.5, 0.7, 0.3, 0.2))
    coefs = waves.coefs.copy()
    coefs[:, 0, 0, 1] += np.array([[0.0, 3.0]])  # something that goes on
    return Waves(waves.frequencies, coefs)


def ends_of(waves, equations, orders=None):
    """Return the closed form's own sections at both ends, with its derivatives along."""
    half = max(one.half for one in equations) if orders is None else orders
    return tuple(
        cqblend.Boundary(*(lambda v, k=k, w=w: waves.section(equations, w, v, k) for k in range(half)), domain=OPEN)
        for w in OPEN
    )


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


# 5. Symmetries.


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


# 6. Bad input.

STILL, UP = (0, 0, 0), (0, 0, 1)
CIRCLE = (np.cos, np.sin, 0)


@cache
def ring(z=0.0, half=3):
    return cqblend.Boundary(*((np.cos, np.sin, z), UP, STILL)[:half])


@cache
def arc(z=0.0, half=3, domain=OPEN):
    return cqblend.Boundary(*((np.cos, np.sin, z), UP, STILL)[:half], domain=domain)


@cache
def end(w, domain=OPEN):
    """Return the section of the blend between arcs at z = 0 and 1 at one of its ends."""
    across = lambda v: v  # noqa: E731
    return cqblend.Boundary(*((np.cos(w), np.sin(w), across), (-np.sin(w), np.cos(w), 0)), domain=domain)


OPTIONS = [
    *(({"order": n}, "order") for n in (3, 0, 8, -2, True, 4.0, math.nan, None, "4", (2, 4), (2, 2, 3), (2, 2, 2, 2))),
    ({"parameters": (1, 2)}, "parameters.* x"),
    ({"parameters": (1, 3, 3, 1)}, "parameters.* x"),
    ({"parameters": ((1, 2, 1), (1, 2), (1, 2, 1))}, "parameters.* y"),
    ({"parameters": ((1, 2, 1), (1, 2, 1))}, "parameters"),
    ({"parameters": ((1, 2, 1), 5, (1, 2, 1))}, "parameters"),
    *(
        ({"parameters": p}, "parameters")
        for p in (
            (1, math.nan, 1),
            (1, math.inf, 1),
            (0, 1, 1),
            (1, -2, 1),
            (1, 0, -1),
            (1, 2, 0),
            (0, 0, 0),
            (),
            "abc",
            ("a", "b", "c"),
            (1, True, 1),
            (1, 2j, 1),
            {1: 2},
            True,
            0,
            -1,
            math.nan,
            1e-200,
            1e200,
            10**400,
            (1, 10**400, 1),
        )
    ),
    ({"parameters": (1e-300, 1, 1)}, "^parameters"),
    ({"order": 2, "parameters": (1, -1)}, "parameters"),
    ({"order": 6, "parameters": (1, -3, 3, -1)}, "parameters"),
    *(({"terms": n}, "terms") for n in (0, -1, 2.5, True, None, "many", 10**6)),
    *(({"modes": n}, "modes") for n in (0, -3, 1.5, True, None, "all", 10**12)),
    ({"terms": 12, "points": 3}, "points.* 12 terms"),
    ({"terms": 12, "points": 11}, "points.* 12 terms"),
    ({"terms": 12, "points": (20, 2)}, "points along"),
    ({"points": (0, 5)}, r"points\[0\]"),
    ({"points": (5, 0)}, r"points\[1\]"),
    *(({"points": n}, "points") for n in (0, 2.5, None, "x", (20,), (1, 2, 3))),
    *(({"basis": b}, "basis") for b in ("fourier", "Trigonometric", 3, None, "polynomial")),
    *(({"minimise": m}, "minimise") for m in ("area", None, "energy")),
    *(({"tolerance": x}, "tolerance") for x in (0, -1, math.nan, math.inf, True, None, "x")),
    *(({"angular_tolerance": x}, "angular_tolerance") for x in (0, math.nan)),
    *(({"form": x}, "form") for x in ("smooth", None, 1)),
    ({"tolerance": 1e-17}, "tolerance"),
    ({"ends": (0, 1)}, "end"),
]


@pytest.mark.parametrize(("options", "culprit"), OPTIONS, ids=lambda x: str(x)[:50])
def test_bad_options_are_named(options, culprit):
    with pytest.raises(CqblendError, match=culprit):
        cqblend.pde_blend(ring(), ring(2), **options)


@pytest.mark.parametrize("factor", [-1.0, 3.0, 1e307, 1e-320])
def test_a_common_factor_of_parameters_does_not_matter(factor):
    first, second = (cqblend.pde_blend(ring(), ring(2), parameters=p) for p in ((1, 1, 1), (factor,) * 3))
    np.testing.assert_allclose(first.solution(T[:, None], V), second.solution(T[:, None], V), rtol=0, atol=1e-12)


PAIRS = {
    "domains differ": (lambda: (arc(), arc(1, domain=(0, 2))), {}, r"\(0.0, 1.0\) and \(0.0, 2.0\)"),
    "one is open": (lambda: (ring(), arc(1, domain=(0, 2 * np.pi - 1))), {}, "run over|closed"),
    "one does not return": (
        lambda: (ring(), cqblend.Boundary((np.cos, lambda t: t, 1), UP)),
        {},
        "first side is closed, the other open",
    ),
    "no first derivative": (lambda: (ring(), ring(2, 1)), {}, "first derivative on the second side"),
    "no first derivative on side 1": (lambda: (ring(0, 1), ring(2)), {}, "first derivative on the first side"),
    "no second derivative": (lambda: (ring(), ring(2, 2)), {"order": 6}, "second derivative on the second side"),
    "no second derivative for z": (
        lambda: (ring(0, 2), ring(2)),
        {"order": (2, 2, 6)},
        "second derivative on the first side",
    ),
    "a rail and a boundary": (lambda: (ring().rail(1), ring(2)), {}, "two rails or two boundaries"),
    "a boundary and a rail": (lambda: (ring(), ring(2).rail(2)), {}, "two rails or two boundaries"),
    "nothing": (lambda: (ring(), None), {}, "two rails or two boundaries"),
    "functions": (lambda: (CIRCLE, ring(2)), {}, "two rails or two boundaries"),
    "one and the same": (lambda: (ring(), ring()), {}, "same curve"),
    "of one position": (lambda: (ring(), cqblend.Boundary(CIRCLE, STILL)), {"order": 2}, "same curve"),
    "two points": (
        lambda: (cqblend.Boundary((0, 0, 0)), cqblend.Boundary((0, 0, 1))),
        {"order": 2},
        "rail|side|point|curve|singular",
    ),
    "no derivative": (lambda: (cqblend.Boundary(CIRCLE, STILL), ring(2)), {}, "rail|side|singular"),
    "waves on open sides": (lambda: (arc(), arc(1)), {"basis": "trigonometric"}, "basis.*trigonometric.*open"),
    "polynomials on closed sides": (lambda: (ring(), ring(1)), {"basis": "polynomial"}, "basis.*polynomial.*closed"),
    "ends of closed sides": (lambda: (ring(), ring(1)), {"ends": (end(0), end(1))}, "closed.*ends"),
    "ends of rails": (lambda: (arc().rail(1), arc(1).rail(2)), {"ends": (end(0), end(1))}, "ends"),
    "ends over another domain": (lambda: (arc(), arc(1)), {"ends": (end(0), end(1, domain=(0, 2)))}, r"\(0.0, 2.0\)"),
    "one end": (lambda: (arc(), arc(1)), {"ends": end(0)}, "ends"),
    "three ends": (lambda: (arc(), arc(1)), {"ends": (end(0),) * 3}, "ends"),
    "ends that are numbers": (lambda: (arc(), arc(1)), {"ends": (1, 2)}, "ends"),
    "ends at other corners": (
        lambda: (arc(), arc(1)),
        {"ends": (end(1), end(0)), "minimise": "energy", "tolerance": 1e-3},
        "end",
    ),
}


@pytest.mark.parametrize("name", PAIRS)
def test_sides_and_ends_that_do_not_match_are_named(name):
    make, options, culprit = PAIRS[name]
    sides = make()
    with pytest.raises(CqblendError, match=culprit):
        cqblend.pde_blend(*sides, **options)


def test_ends_that_match_are_taken():
    """The other half of the tests above: the same ends in their right places."""
    blend = cqblend.pde_blend(arc(), arc(1), parameters=1.0, ends=(end(0), end(1)), modes=8, terms=6, tolerance=1e-3)
    for w in OPEN:
        section = np.stack(np.broadcast_arrays(np.cos(w), np.sin(w), INSIDE), -1)
        assert np.abs(blend.solution(w, INSIDE) - section).max() < 1e-9


def raising(error):
    def function(t):
        raise error("no such t")

    return function


FUNCTIONS = {
    "two columns": (lambda t: np.stack([t, t], -1), InputError, "shape"),
    "four columns": (lambda t: np.stack([t] * 4, -1), InputError, "shape"),
    "transposed": (lambda t: np.stack([t, t, t]), InputError, "shape"),
    "too deep": (lambda t: np.zeros((len(t), 3, 1)), InputError, "shape"),
    "one point": (lambda t: np.zeros(3), InputError, "shape"),
    "nothing": (lambda t: [], InputError, "shape"),
    "text": (lambda t: "abc", InputError, "function"),
    "None": (lambda t: None, InputError, "finite|function"),
    "nan": (lambda t: np.stack([t, t, np.where(t > 3, np.nan, t)], -1), InputError, r"finite at t = [3-6]\."),
    "inf": (lambda t: np.stack([t, t, np.full_like(t, np.inf)], -1), InputError, "finite at t"),
    "a scalar function": (lambda t: math.cos(t), InputError, "array"),
    "no function of one variable": (lambda t, v: t, InputError, "function"),
    "raises TypeError": (raising(TypeError), InputError, "no such t"),
    "raises ValueError": (raising(ValueError), InputError, "no such t"),
    "a kink": (lambda t: np.stack([np.cos(t), np.sin(t), abs(t - 1)], -1), GeometryError, r"smooth enough at t = 1\.0"),
    "a step": (lambda t: np.stack([np.cos(t), np.sin(t), 1.0 * (t > 1)], -1), GeometryError, r"smooth .* at t = 1\.0"),
    "a kink of slope": (
        lambda t: np.stack([np.cos(t), np.sin(t), abs(t - 1) * (t - 1)], -1),
        GeometryError,
        r"smooth enough at t = 1\.0",
    ),
    "complex numbers": (lambda t: np.stack([t, t, 1j * t], -1), InputError, "real|complex|number"),
    "a root": (lambda t: np.stack([np.sqrt(t), np.sin(t), t], -1), GeometryError, "smooth enough at t = 0"),
}


@pytest.mark.parametrize("place", ["position", "first", "second"])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_bad_functions_are_named(name, place):
    function, kind, culprit = FUNCTIONS[name]
    given = {"position": CIRCLE, "first": UP, "second": STILL, place: function}
    with pytest.raises(kind, match=culprit):
        cqblend.Boundary(**given)


COMPONENTS = {
    "a table": (lambda t: np.stack([t] * 3, -1), "component|1|dim"),
    "nan": (math.nan, "component"),
    "inf": (math.inf, "component"),
    "None": (None, "component"),
    "text": ("a", "component"),
    "a number as text": ("1", "component"),
    "a long number": (10**400, "component|finite"),
    "a curve of space": (cqblend.Curve.bezier([[0, 0, 0], [1, 1, 1]], domain=(0, 2 * np.pi)), "component"),
}


@pytest.mark.parametrize("name", COMPONENTS)
def test_bad_components_are_named(name):
    value, culprit = COMPONENTS[name]
    with pytest.raises(CqblendError, match=culprit):
        cqblend.Boundary((np.cos, np.sin, value))


LINE, LONGER = (cqblend.Curve.bezier([[0.0], [1.0]], domain=(0, b)) for b in (1, 2))

BOUNDARIES = {
    "no position": (lambda: cqblend.Boundary(None), "position|boundary"),
    "no position but a derivative": (lambda: cqblend.Boundary(None, CIRCLE), "position|boundary"),
    "two components": (lambda: cqblend.Boundary((np.cos, np.sin)), "three components"),
    "text": (lambda: cqblend.Boundary("abc"), "three components"),
    "a derivative of two components": (lambda: cqblend.Boundary(CIRCLE, (0, 0)), "three components"),
    "a second derivative alone": (lambda: cqblend.Boundary(CIRCLE, None, STILL), "first"),
    "a plane curve": (lambda: cqblend.Boundary(cqblend.Curve.bezier([[0, 0], [1, 1]])), "dim 3.* dim 2"),
    "curves of two domains": (lambda: cqblend.Boundary((LINE, LONGER, 0)), "domain"),
    "a curve of another domain": (lambda: cqblend.Boundary((LINE, 0, 0), domain=(0, 2)), "domain"),
    **{
        f"domain {domain}": (lambda domain=domain: cqblend.Boundary(CIRCLE, domain=domain), "domain")
        for domain in ((1, 0), (0, 0), (0, math.nan), (0, math.inf), (0, 1, 2), (None, 1), "ab", 5)
    },
}


@pytest.mark.parametrize("name", BOUNDARIES)
def test_bad_boundaries_are_named(name):
    make, culprit = BOUNDARIES[name]
    with pytest.raises(InputError, match=culprit):
        make()
