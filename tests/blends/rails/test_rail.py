"""Kim and Elber's fields against OCCT's own evaluation and exact fractions, and the rails that must be refused."""

from __future__ import annotations

import copy
import pickle
from fractions import Fraction
from math import comb

import numpy as np
import pytest
from kernel_surfaces import clamped, kernel_surface
from OCP.gp import gp_Pnt, gp_Vec

from cqblend.blends.rails.rail import FIELDS, Rail
from cqblend.errors import GeometryError, InputError
from cqblend.splines import Curve, Surface, interpolate
from cqblend.splines.self_intersection import find_self_crossing

T = np.linspace(0, 1, 243)
INNER = ([0.2, 0.4, 0.6, 0.8], [0.25, 0.5, 0.75])
B = Curve.bezier
ZIGZAG = np.array([[0.1, 0.1], [0.2, 0.5], [0.4, 0.6], [0.6, 0.4], [0.8, 0.5], [0.85, 0.7], [0.9, 0.9]])
RAILS = {
    "cubic": B([[0.05, 0.10], [0.40, 0.95], [0.65, 0.05], [0.95, 0.90]]),
    "rational arc": B([[0.9, 0.5], [0.9, 0.9], [0.5, 0.9]], [1.0, 2**-0.5, 1.0]),
    "C1 pieces": Curve.from_bspline(3, clamped(3, [0.3, 0.3, 0.7]), ZIGZAG),
    "straight": B([[0.1, 0.2], [0.9, 0.7]]),
    "along a knot line": B([[0.1, 0.5], [0.9, 0.5]]),
}
GUIDE = B([[1.0, 0.2, 3.0], [-0.5, 2.0, 1.0], [0.7, -1.0, 2.0]], [1.0, 1.7, 0.8])
FIRST, SECOND = B([[0.4, 1.0], [-0.3, 0.8]]), B([[0.1, 0.0], [0.5, 0.2], [0.0, 0.1]])


def surface_and_kernel(degrees=(3, 3), inner=INNER, *, rational=False, seed=5):
    """A wavy spline, and OCCT's made pole by pole from the same arrays."""
    rng = np.random.default_rng(seed)
    knots = tuple(clamped(d, k) for d, k in zip(degrees, inner, strict=True))
    shape = tuple(len(k) - d - 1 for k, d in zip(knots, degrees, strict=True))
    u, v = np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij")
    poles = np.stack([10 * u, 10 * v, np.sin(5 * u + 3 * v)], -1) + rng.uniform(-0.3, 0.3, (*shape, 3))
    weights = rng.uniform(0.6, 1.6, shape) if rational else None
    return Surface.from_bspline(degrees, knots, poles, weights), kernel_surface(degrees, knots, poles, weights)


SURFACES = {
    "bicubic": surface_and_kernel(),
    "rational bicubic": surface_and_kernel(rational=True),
    "quadratic by quartic": surface_and_kernel((2, 4), ([0.3, 0.6], [0.5, 0.5])),
}
OTHER = Rail(surface_and_kernel((2, 2), ([0.5], []), rational=True, seed=9)[0], B([[0.1, 0.9], [0.9, 0.8]]))
OPERANDS = {"chord": (OTHER,), "guide": (GUIDE,), "combination": (FIRST, SECOND)}


def kernel_partials(kernel, uv):
    """OCCT's S, Su, Sv, each (n, 3)."""
    rows = []
    for u, v in uv.tolist():
        p, su, sv = gp_Pnt(), gp_Vec(), gp_Vec()
        kernel.D1(u, v, p, su, sv)
        rows.append([x.Coord() for x in (p, su, sv)])
    return np.array(rows).swapaxes(0, 1)


def dot(a, b):
    return (a * b).sum(axis=-1, keepdims=True)


def project(k, n):
    """Equation (6)."""
    return k - dot(k, n) / dot(n, n) * n


def paper(name, kernel, curve, t):
    """The paper's own equations, for the right side, on OCCT's partial derivatives."""
    s, su, sv = kernel_partials(kernel, curve(t))
    (du, dv), n = curve(t, 1).T[:, :, None], np.cross(su, sv)
    if name == "parametric":
        return dv * su - du * sv
    if name == "perpendicular":  # (5)
        return np.cross(du * su + dv * sv, n)
    if name == "chord":
        return project(OTHER.surface(*OTHER.curve(t).T) - s, n)
    if name == "guide":
        return project(GUIDE(t), n)
    r, s = (FIRST(t) - SECOND(t)).T[:, :, None]
    return r * su + s * sv  # (7)


@pytest.mark.parametrize("name", FIELDS)
@pytest.mark.parametrize("shape", SURFACES)
@pytest.mark.parametrize("path", RAILS)
def test_fields_are_the_papers(name, shape, path):
    surface, kernel = SURFACES[shape]
    rail = Rail(surface, RAILS[path], "right")
    truth = paper(name, kernel, rail.curve, T)
    field = rail.field(name, *OPERANDS.get(name, ()))
    error = np.linalg.norm(field(T) - truth, axis=1) / np.linalg.norm(truth, axis=1)
    assert error.max() < 1e-12
    r, s = rail.coordinates(name, T, *OPERANDS.get(name, ())).T[:, :, None]
    _, su, sv = kernel_partials(kernel, rail.curve(T))
    assert (np.linalg.norm(r * su + s * sv - truth, axis=1) / np.linalg.norm(truth, axis=1)).max() < 1e-12


@pytest.mark.parametrize("shape", SURFACES)
@pytest.mark.parametrize("path", RAILS)
def test_position_and_normal(shape, path):
    surface, kernel = SURFACES[shape]
    rail = Rail(surface, RAILS[path])
    s, su, sv = kernel_partials(kernel, rail.curve(T))
    n = np.cross(su, sv)
    assert np.abs(rail.curve3d()(T) - s).max() < 1e-13 * 12
    assert (np.linalg.norm(rail.normal()(T) - n, axis=1) / np.linalg.norm(n, axis=1)).max() < 1e-13


def test_fields_in_exact_arithmetic():
    """T2 of degree 47 and T3 of degree 78 on one bicubic patch, at points where everything is a fraction."""
    rng = np.random.default_rng(2)
    poles = rng.integers(-8, 9, (4, 4, 3)) / 8 + np.stack([*np.mgrid[0:4, 0:4] * 4.0, np.zeros((4, 4))], -1)
    path, guide = np.array([[1, 2], [5, 14], [9, 1], [15, 14]]) / 16, np.array([[1, 2, 3], [4, -1, 2]]) / 4
    rail = Rail(Surface.from_bspline((3, 3), (clamped(3, []),) * 2, poles), B(path), "right")
    t2, t3 = rail.field("perpendicular"), rail.field("guide", B(guide))
    assert t2.degree == 47

    def bezier(points, x):
        p = len(points) - 1
        return sum(comb(p, i) * x**i * (1 - x) ** (p - i) * np.vectorize(Fraction)(c) for i, c in enumerate(points))

    def slope(points):
        return (len(points) - 1) * np.diff(points, axis=0)

    for t in (Fraction(k, 7) for k in range(8)):
        (u, v), (du, dv) = bezier(path, t), bezier(slope(path), t)
        su = bezier([bezier(row, v) for row in slope(poles)], u)
        sv = bezier([bezier(slope(row), v) for row in poles], u)
        n = np.cross(su, sv)
        k = bezier(guide, t)
        for field, truth in ((t2, np.cross(du * su + dv * sv, n)), (t3, k - (k @ n) / (n @ n) * n)):
            error = [float(Fraction(x) - y) for x, y in zip(field(float(t)).tolist(), truth, strict=True)]
            assert np.linalg.norm(error) < 1e-13 * np.linalg.norm(truth.astype(float))


@pytest.mark.parametrize(("degree", "of_curve", "of_normal"), [(2, 8, 12), (3, 18, 30)])
def test_degrees_are_those_the_paper_states(degree, of_curve, of_normal):
    surface, _ = surface_and_kernel((degree, degree))
    path = B(
        np.linspace([0.1, 0.2], [0.9, 0.7], degree + 1) + np.random.default_rng(1).uniform(0, 0.1, (degree + 1, 2))
    )
    rail = Rail(surface, path, "left")
    assert (rail.curve3d().degree, rail.normal().degree) == (of_curve, of_normal)
    assert rail.field("perpendicular").degree == of_curve - 1 + of_normal
    assert rail.field("parametric").degree == of_curve - 1
    assert not rail.field("perpendicular").rational
    assert rail.field("guide", B([[0.0, 1, 2], [1, 0, 0]])).rational


def test_sides():
    flat = Surface.from_bspline((1, 1), (clamped(1, []),) * 2, [[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]])
    along_u = B([[0.1, 0.5], [0.9, 0.5]])
    for name in ("parametric", "perpendicular"):
        assert (Rail(flat, along_u, "left").field(name)(T)[:, 1] > 0).all()
        assert (Rail(flat, along_u, "right").field(name)(T)[:, 1] < 0).all()
        with pytest.raises(InputError, match="side="):
            Rail(flat, along_u).field(name)
        with pytest.raises(InputError, match="side="):
            Rail(flat, along_u).coordinates(name, T)
    rail = Rail(flat, along_u)
    assert rail.towards([0.5, 2.0, 7.0]).side == "left"
    assert rail.towards(Rail(flat, B([[0.2, 0.1], [0.8, 0.4]]))).side == "right"
    assert rail.towards([0.5, 2.0, 7.0]).reverse().side == "right"
    assert (rail.towards([0.5, 2, 7]).reverse().field("parametric")(T)[:, 1] > 0).all()
    with pytest.raises(GeometryError, match=r"t = 0\.5,"):
        rail.towards(Rail(flat, B([[0.1, 0.1], [0.9, 0.9]])))
    with pytest.raises(GeometryError, match="cannot be told: at t = 0,"):
        rail.towards([0.5, 0.5, 3.0])
    for nonsense in (3.0, [1.0, 2.0], [np.nan, 0, 0]):
        with pytest.raises(InputError, match="another Rail or a point"):
            rail.towards(nonsense)


def test_side_is_the_same_whichever_way_the_normal_points():
    """Left is left in the parameter plane, also where Su x Sv is turned over."""
    surface, _ = SURFACES["bicubic"]
    target = surface(0.1, 0.9)
    for flipped in (surface, surface.transpose()):
        swap = slice(None) if flipped is surface else slice(None, None, -1)
        rail = Rail(flipped, B(np.array([[0.1, 0.2], [0.9, 0.8]])[:, swap])).towards(target)
        assert rail.side == ("left" if flipped is surface else "right")
        assert (dot(rail.field("perpendicular")(T), target - rail.curve3d()(T)) > 0).all()


def test_symbolic_coordinates():
    surface, _ = SURFACES["bicubic"]
    rail = Rail(surface, RAILS["cubic"], "left")
    assert np.allclose(rail.symbolic_coordinates("parametric")(T), rail.curve(T, 1)[:, ::-1] * (-1, 1), rtol=1e-14)
    assert rail.symbolic_coordinates("combination", FIRST) is FIRST
    assert rail.symbolic_coordinates("perpendicular") is None
    assert rail.symbolic_coordinates("chord", OTHER) is None


def test_operands_are_checked():
    rail = Rail(SURFACES["bicubic"][0], RAILS["cubic"], "left")
    for name, operands, message in (
        ("tangential", (), "choose one of parametric, perpendicular"),
        ("perpendicular", (GUIDE,), "takes 0 operands, not 1"),
        ("combination", (), "takes 1 or 2 operands"),
        ("combination", (GUIDE,), "a Curve of dim 2"),
        ("guide", (FIRST,), "a Curve of dim 3, not one of dim 2"),
        ("chord", (GUIDE,), "takes the other Rail"),
        ("guide", (GUIDE.reparametrized(0, 2),), r"use \.reparametrized\(0, 1\)"),
        ("chord", (OTHER.reparametrized(1, 2),), r"not over \[1, 2\]"),
    ):
        for method in (rail.field, rail.symbolic_coordinates):
            if method == rail.symbolic_coordinates and name in ("guide", "chord"):
                continue
            with pytest.raises(InputError, match=message):
                method(name, *operands)
        with pytest.raises(InputError, match=message):
            rail.coordinates(name, T, *operands)


def test_directions_are_checked():
    flat = Surface.from_bspline((1, 1), (clamped(1, []),) * 2, [[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]])
    rail = Rail(flat, B([[0.1, 0.5], [0.9, 0.5]]))
    t = np.linspace(0, 1, 4)
    rail.check_direction(np.tile([3.0, 0.1], (4, 1)), t)
    with pytest.raises(GeometryError, match=r"t = 0\.5,"):
        rail.check_direction(np.stack([np.ones(4), t - 0.5], -1), t)
    with pytest.raises(GeometryError, match=r"t = 0\.333333333,"):
        rail.check_direction(np.stack([np.ones(4), t - t[1]], -1), t)
    with pytest.raises(GeometryError, match="zero or parallel"):
        rail.check_direction(np.zeros((4, 2)), t)


def sphere():
    """A rational sphere with both poles and the seam, over [0, 4] x [0, 2]."""
    h = 2**-0.5
    around = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]])
    up = np.array([[0, -1], [1, -1], [1, 0], [1, 1], [0, 1]])
    poles = np.stack(
        [
            np.multiply.outer(around[:, 0], up[:, 0]),
            np.multiply.outer(around[:, 1], up[:, 0]),
            np.tile(up[:, 1], (9, 1)),
        ],
        -1,
    )
    weights = np.outer([1, h] * 4 + [1], [1, h, 1, h, 1])
    knots = [np.repeat(np.arange(n + 1.0), [3, *[2] * (n - 1), 3]) for n in (4, 2)]
    return Surface.from_bspline((2, 2), tuple(knots), poles, weights)


def creased():
    rows = [[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]], [[2, 0, 1], [2, 1, 1]]]
    return Surface.from_bspline((1, 1), (clamped(1, [0.5]), clamped(1, [])), rows)


def circle(turns=1):
    h = 2**-0.5
    around = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]])
    knots = np.repeat(np.arange(5.0), [3, 2, 2, 2, 3])
    once = Curve.from_bspline(2, knots, 0.5 + 0.3 * around, [1, h] * 4 + [1])
    return once if turns == 1 else once.join(once.reparametrized(4, 8))


WAVY = SURFACES["bicubic"][0]
NEGATIVE = Curve([0, 1], np.array([[0.1, 0.1, 1], [-0.1, -0.1, -0.2], [0.9, 0.2, 1]])[..., None], rational=True)
BAD = {
    "outside": (WAVY, B([[0.1, 0.1], [0.5, 2.4], [0.9, 0.1]]), InputError, r"leaves the surface: at t = 0\.5 "),
    "ends outside": (WAVY, B([[0.1, 0.1], [1.1, 0.5]]), InputError, "leaves the surface: at t = 1 "),
    "a point": (WAVY, B([[0.5, 0.5], [0.5, 0.5]]), GeometryError, "no length: from t = 0 to t = 1"),
    "on a collapsed side": (sphere(), B([[0.5, 2.0], [2.0, 2.0]]), GeometryError, "singular on the rail, at t = 0,"),
    "through a pole": (
        sphere(),
        B([[0.5, 1.2], [0.9, 2.8], [1.5, 1.2]]),
        GeometryError,
        r"singular on the rail, at t = 0\.5",
    ),
    "a cusp": (WAVY, B([[0.2, 0.2], [0.8, 0.8], [0.2, 0.8], [0.8, 0.2]]), GeometryError, r"stands still at t = 0\.5"),
    "a slow start": (WAVY, B([[0.2, 0.2], [0.2, 0.2], [0.8, 0.2]]), GeometryError, "stands still at t = 0,"),
    "a loop": (
        WAVY,
        B([[0.2, 0.2], [0.9, 0.9], [0.1, 0.9], [0.8, 0.2]]),
        GeometryError,
        r"t = 0\.27639320.*t = 0\.72360679",
    ),
    "twice around": (WAVY, circle(2), GeometryError, "meets itself"),
    "in space only, at a seam": (sphere(), B([[0, 1], [8, 0.8], [0, 1.4]]), GeometryError, "meets itself"),
    "a kink": (
        WAVY,
        Curve.from_bspline(1, clamped(1, [0.4]), [[0.1, 0.1], [0.5, 0.5], [0.9, 0.2]]),
        GeometryError,
        r"kink of .* t = 0\.4",
    ),
    "a gap": (
        WAVY,
        B([[0.1, 0.1], [0.4, 0.4]]).join(B([[0.5, 0.5], [0.8, 0.8]], domain=(1, 2))),
        GeometryError,
        "broken at t = 1",
    ),
    "a crease": (creased(), B([[0.1, 0.5], [0.9, 0.6]]), GeometryError, r"crease of the surface at t = 0\.5"),
    "negative weight": (WAVY, NEGATIVE, GeometryError, "weight coefficient is -0.2"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_rails_are_refused_by_parameter(case):
    surface, curve, error, message = BAD[case]
    with pytest.raises(error, match=message):
        Rail(surface, curve)


def test_arguments_are_checked():
    for arguments, message in (
        ((GUIDE, FIRST), "needs a Surface of dim 3"),
        ((WAVY, GUIDE), "Curve of dim 2"),
        ((WAVY, WAVY), "Curve of dim 2"),
        ((WAVY, RAILS["cubic"], "up"), '"left", "right" or None'),
        ((Surface.from_bspline((1, 1), (clamped(1, []),) * 2, np.zeros((2, 2, 2))), FIRST), "needs a Surface of dim 3"),
    ):
        with pytest.raises(InputError, match=message):
            Rail(*arguments)


def test_rails_that_are_fine():
    assert Rail(WAVY, circle()).closed
    assert not Rail(WAVY, RAILS["cubic"]).closed
    assert Rail(sphere(), B([[0.0, 1.2], [4.0, 1.2]])).closed
    assert not Rail(WAVY, B([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])).closed  # touches three sides of the domain
    Rail(WAVY, B([[-1e-12, 0.5], [1 + 1e-12, 0.5]]))  # to rounding
    t = np.linspace(3, 20, 120)
    Rail(WAVY, interpolate(t, 0.5 + 0.02 * t[:, None] * np.stack([np.cos(t), np.sin(t)], -1)))  # a spiral, 2.7 turns
    Rail(sphere(), B([[0.5, 1.99], [3.0, 1.99]]))  # close to a pole


def test_values():
    rail = Rail(WAVY, RAILS["cubic"], "left")
    assert rail == Rail(WAVY, RAILS["cubic"], "left")
    assert rail != Rail(WAVY, RAILS["cubic"])
    for twin in (copy.copy(rail), pickle.loads(pickle.dumps(rail))):
        assert twin == rail
        assert hash(twin) == hash(rail)
    with pytest.raises(AttributeError):
        rail.side = "right"
    longer = rail.reparametrized(2, 5)
    assert longer.domain == (2, 5)
    assert np.allclose(longer.curve3d()(2 + 3 * T), rail.curve3d()(T), rtol=0, atol=1e-13)


def test_self_crossing_finds_what_sampling_sees():
    """On random curves, beside the brute force of intersecting chords."""
    rng = np.random.default_rng(11)
    found = 0
    for _ in range(40):
        curve = Curve.from_bspline(3, clamped(3, [0.25, 0.5, 0.75]), rng.uniform(0, 1, (7, 2)))
        p = curve(np.linspace(0, 1, 600))
        d, e = np.diff(p, axis=0)[:, None], p[None, :-1] - p[:-1, None]
        other = np.diff(p, axis=0)[None]
        area = d[..., 0] * other[..., 1] - d[..., 1] * other[..., 0]
        x = (e[..., 0] * other[..., 1] - e[..., 1] * other[..., 0]) / np.where(area == 0, np.inf, area)
        y = (e[..., 0] * d[..., 1] - e[..., 1] * d[..., 0]) / np.where(area == 0, np.inf, area)
        meet = np.triu((area != 0) & (x >= 0) & (x <= 1) & (y >= 0) & (y <= 1), 2).any()
        met = find_self_crossing(curve)
        assert (met is not None) == meet
        if met is not None:
            found += 1
            assert np.abs(curve(met[0]) - curve(met[1])).max() < 1e-8
    assert 5 < found < 35
