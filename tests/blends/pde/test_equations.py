"""Equations of PDE blends: which are accepted, and the squares that make up their symbols."""

import itertools
import re

import numpy as np
import pytest

from cqblend.blends.pde.equations import Equation, make_equations
from cqblend.errors import InputError

GOOD = [
    (1, 1),
    (3, 0.2),
    (-1, -2),
    (1, 2, 1),
    (1, 0, 1),
    (1, -1.9, 1),
    (2, -0.5, 3),
    (1, 3, 3, 1),
    (1, 0, 0, 1),
    (1, -0.5, 0.4, 2),
    (1, 0.5, -0.6, 1),
    (-1, 0.5, 0.6, -1),
    (1e-6, 1, 1e-6),
]
BAD = [
    (0, 1),
    (1, 0),
    (1, -1),
    (0, 1, 1),
    (1, -2, 1),
    (1, -3, 1),
    (1, 0, -1),
    (1, 5, 0),
    (1, 1, 1, 0),
    (1, 0, 0, -1),
    (1, -3, 3, -1),
    (1, -1, -1, 1),
]


def symbol(c, xi, eta):
    half = len(c) - 1
    return sum(x * xi ** (2 * (half - i)) * eta ** (2 * i) for i, x in enumerate(c))


@pytest.mark.parametrize("c", GOOD)
def test_squares_add_up_to_the_symbol(c):
    """As polynomials in two variables: at more points than they have coefficients."""
    forms = Equation(tuple(map(float, c))).split_into_squares()
    half = len(c) - 1
    for xi, eta in itertools.product(np.linspace(-2, 2, 9), repeat=2):
        values = forms @ [xi ** (half - i) * eta**i for i in range(half + 1)]
        assert (values**2).sum() == pytest.approx(symbol(c, xi, eta) / c[0], rel=1e-10, abs=1e-10)


@pytest.mark.parametrize("c", GOOD)
def test_the_steepest_solution(c):
    """With rho as exponent the equation holds: the largest is a root of the characteristic polynomial."""
    steepest = Equation(tuple(map(float, c))).largest_exponent
    half = len(c) - 1
    found = np.roots(
        [x * (-1) ** (i // 2) if i % 2 == 0 else 0 for i, x in enumerate(np.insert(c, range(1, half + 1), 0))]
    )
    assert np.abs(found).max() == pytest.approx(steepest, rel=1e-4)  # multiple roots are known to that


@pytest.mark.parametrize("c", BAD)
def test_degenerate_equations_are_refused(c):
    with pytest.raises(
        InputError, match=r"^parameters \(.*\) are degenerate: .* is zero at z = .*; take them all above 0"
    ):
        Equation(tuple(map(float, c)))


@pytest.mark.parametrize("order", [2, 4, 6])
def test_a_number_is_a_power_of_laplaces_operator(order):
    """(x + s^2 y)^(n/2), expanded."""
    (one, two, three) = make_equations((order,) * 3, 0.7, 99.0)
    assert one == two == three
    for x, y in ((1, 2), (3, -1), (0.5, 4)):
        wanted = (x + 0.49 * y) ** (order // 2)
        assert sum(c * x ** (one.half - i) * y**i for i, c in enumerate(one.coefficients)) == pytest.approx(wanted)
    assert make_equations((order,) * 3, None, 0.7)[0] == one


def test_parameters_for_each_component():
    made = make_equations((2, 4, 6), ((1, 2), (1, 2, 3), (1, 2, 3, 4)), 1.0)
    assert [one.order for one in made] == [2, 4, 6]
    assert made[2].coefficients == (1, 2, 3, 4)


@pytest.mark.parametrize(
    ("order", "parameters", "message"),
    [
        ((4, 4, 4), (1, 2), "an equation of order 4 has 3 parameters, a, b, c; there are 2 for x"),
        ((2, 2, 6), ((1, 1), (1, 1), (1, 1)), "an equation of order 6 has 4 parameters, a, b, c, d; there are 2 for z"),
        ((2, 2, 2), (1, float("nan")), "each of the parameters must be a finite number, not nan"),
        ((2, 2, 2), (1, True), "each of the parameters must be a finite number, not True"),
        ((2, 2, 2), ("1", 1), "each of the parameters must be a finite number, not '1'"),
        ((2, 2, 2), "big", "parameters must be numbers"),
        ((2, 2, 2), ((1, 1), (1, 1)), "parameters must be numbers"),
        ((2, 2, 2), ((1, 1), 1, (1, 1)), "parameters must be numbers"),
        ((2, 2, 2), (), "an equation of order 2 has 2 parameters"),
        ((2, 2, 2), 0, "parameters must be above 0 if they are one number, and at most 1e+12, not 0"),
        ((2, 2, 2), -1.0, "parameters must be above 0"),
        ((2, 2, 2), float("inf"), "each of the parameters must be a finite number, not inf"),
    ],
)
def test_parameters_that_are_none(order, parameters, message):
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        make_equations(order, parameters, 1.0)
