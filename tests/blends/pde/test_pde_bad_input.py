"""Options, functions and boundaries that PDE blends refuse, and the messages that name them."""

import math
from functools import cache

import numpy as np
import pytest
from pde_data import INSIDE, OPEN, T, V

import cqblend
from cqblend.errors import CqblendError, GeometryError, InputError

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
