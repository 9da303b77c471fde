"""Primaries against OCCT's own surfaces and closed forms: whatever is lifted lies on the surface, and tangent to it."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from kernel_surfaces import ORIGIN, SIZE, Pair, pairs, sample_parameters, seeded_random

from cqblend.splines import Curve, interpolation
from cqblend.surfaces.quadrics import Cone, Plane, Quadric, Sphere
from cqblend.surfaces.tensor_surface import TensorSurface

every = pytest.mark.parametrize("pair", pairs().values(), ids=pairs().keys())
analytic = pytest.mark.parametrize(
    "pair",
    [p for p in pairs().values() if "spline" not in p.name and "ellipse" not in p.name],
    ids=lambda pair: pair.name,
)


def kinked(pair: Pair) -> bool:
    """Whether the homogeneous spline has kinks; then a rail's weight is levelled instead of scaled."""
    return isinstance(pair.primary, TensorSurface) and pair.primary.levels_weight


def constant(values: np.ndarray) -> Curve:
    return Curve([0.0, 1.0], np.asarray(values)[None, :, None])


def rail(pair: Pair, spans: int = 6) -> Curve:
    """A C2 cubic of lifted parameters along a random walk through the window, with its weight anything but constant."""
    draw = seeded_random(pair)
    angle = np.linspace(0, 4, spans + 1) + draw.uniform(0, 6)
    uv = pair.uv(0.5 + 0.45 * np.stack([np.cos(angle), np.sin(1.3 * angle)], -1))
    if isinstance(pair.primary, Sphere) and not pair.primary.follows_latitude:
        # stay within the hemisphere of the pole
        x, y, z = pair.primary.frame.axes @ pair.primary.pole
        uv = np.array([math.atan2(y, x), math.asin(z)]) + 0.5 * np.stack([np.cos(angle), np.sin(1.3 * angle)], -1)
    c = pair.primary.scale_weight(pair.primary.lift_points(uv), draw.uniform(0.5, 2, len(uv)))
    return interpolation.interpolate(np.linspace(0, 1, spans + 1), c)


def field(pair: Pair, c: Curve) -> Curve:
    """Return any lifted direction at all, on the rail's own breaks."""
    return interpolation.interpolate(c.breaks, seeded_random(pair).normal(size=(len(c.breaks), c.dim)))


def rounding(curve: Curve, k: int) -> float:
    """Return what rounding errors of the coefficients are multiplied by in a k-th derivative: (2 p / h)^k, at worst."""
    return float(np.abs(curve.coefs).max() * (2 * curve.degree / np.diff(curve.breaks).min()) ** k)


def euclidean(x: np.ndarray, dx: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    point = x[..., :3] / x[..., 3:]
    return point, (dx[..., :3] - point * dx[..., 3:]) / x[..., 3:]


def native(pair: Pair, c: np.ndarray) -> np.ndarray:
    """Native parameters of lifted points; where the surface goes on periodically, OCCT goes on too."""
    uv = pair.primary.unlift_points(c, np.zeros((len(c), 2)))
    for axis, period in enumerate(pair.primary.periods):
        if period is not None and isinstance(pair.primary, TensorSurface):
            uv[:, axis] %= period
    return uv


# Numbers.


@every
def test_jet_is_the_kernels(pair):
    uv = sample_parameters(pair)
    kernel = pair.jet(uv)
    scale = np.abs(kernel).max(axis=(1, 2), keepdims=True) + SIZE
    assert np.abs((pair.primary.jet(uv) - kernel) / scale).max() < 1e-14


@analytic
def test_jet_of_analytic_surfaces_is_the_derivative_of_their_closed_form(pair):
    mpmath.mp.dps = 40
    primary = pair.primary
    x, y, z = (mpmath.matrix(axis.tolist()) for axis in getattr(primary, "frame").axes)  # noqa: B009
    origin = mpmath.matrix(ORIGIN.tolist())

    def point(u, v):
        ring = mpmath.cos(u) * x + mpmath.sin(u) * y
        name = pair.name.split(",")[0].split()[0]
        if name == "plane":
            return origin + u * x + v * y
        if name == "cylinder":
            return origin + 4 * ring + v * z
        if name == "cone":
            h = mpmath.mpf(primary.half_angle)
            return origin + (3 + v * mpmath.sin(h)) * ring + v * mpmath.cos(h) * z
        if name in ("sphere", "spinning"):
            return origin + 6 * (mpmath.cos(v) * ring + mpmath.sin(v) * z)
        return origin + (6 + mpmath.cos(v) * 2.5) * ring + mpmath.sin(v) * 2.5 * z

    u, v = sample_parameters(pair)[0].tolist()
    jet = primary.jet(np.array([[u, v]]))[:, 0]
    for found, order in zip(jet, ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)), strict=True):
        for i in range(3):
            exact = mpmath.diff(lambda a, b, i=i: point(a, b)[i], (u, v), order) if any(order) else point(u, v)[i]
            assert abs(found[i] - float(exact)) < 2e-14 * SIZE


@every
def test_normals_are_the_kernels(pair):
    uv = sample_parameters(pair)
    _, su, sv = pair.jet(uv)[:3]
    normal = np.cross(su, sv)
    assert (
        np.abs(pair.primary.evaluate_normals(uv) - normal / np.linalg.norm(normal, axis=1, keepdims=True)).max() < 1e-13
    )


# Lifting.


@every
def test_lifted_points_come_back_and_have_weight_one(pair):
    uv = sample_parameters(pair)
    c = pair.primary.lift_points(uv)
    assert np.abs(pair.primary.unlift_points(c, uv) - uv).max() < 1e-13 * max(1, np.abs(uv).max())
    x = np.array([pair.primary.compose_position(constant(one))(0.5) for one in c])
    assert np.abs(x[:, :3] / x[:, 3:] - pair.jet(uv)[0]).max() < 1e-14 * SIZE
    assert np.abs(x[:, 3] - 1).max() < 1e-14


@every
def test_lift_is_continuous_over_more_than_a_turn(pair):
    n = 4000
    uv = pair.uv(np.stack([np.linspace(0, 1, n), np.full(n, 0.62)], -1))
    if isinstance(pair.primary, Sphere) and not pair.primary.follows_latitude:
        uv = uv[: n // 8]  # its lift is singular opposite to the pole
    step = np.diff(pair.primary.lift_points(uv), axis=0)
    assert np.abs(step).max() < 40 / n


@every
def test_pushed_directions_have_the_asked_velocity_and_keep_the_weight(pair):
    uv = sample_parameters(pair)
    rs = seeded_random(pair).normal(size=uv.shape)
    _, su, sv = pair.jet(uv)[:3]
    wanted = rs[:, :1] * su + rs[:, 1:] * sv
    for factor in (1.0, 1.7):
        c = pair.primary.scale_weight(pair.primary.lift_points(uv), np.full(len(uv), factor))
        d = pair.primary.lift_directions(uv, c, rs)
        x = np.array([pair.primary.compose_position(constant(one))(0.5) for one in c])
        dx = np.array(
            [pair.primary.compose_jets(constant(a), [constant(b)])[1](0.5) for a, b in zip(c, d, strict=True)]
        )
        scale = np.abs(wanted).max() + SIZE
        assert np.abs(euclidean(x, dx)[1] - wanted).max() < 1e-14 * scale
        assert np.abs(dx[:, 3]).max() < 1e-14 * scale


@every
def test_scale_multiplies_the_weight_and_moves_nothing(pair):
    uv = sample_parameters(pair)
    factor = seeded_random(pair).uniform(0.2, 3, len(uv))
    c = pair.primary.lift_points(uv)
    before, after = (
        np.array([pair.primary.compose_position(constant(one))(0.5) for one in many])
        for many in (c, pair.primary.scale_weight(c, factor))
    )
    if not kinked(pair):
        assert np.abs(after[:, 3] / before[:, 3] - factor).max() < 1e-14 * 3
    assert np.abs(after[:, :3] / after[:, 3:] - before[:, :3] / before[:, 3:]).max() < 1e-14 * SIZE


# Symbols.


@every
def test_every_lifted_curve_lies_on_the_surface(pair):
    c = rail(pair)
    t = np.linspace(0, 1, 301)
    x = pair.primary.compose_position(c)(t)
    assert x[:, 3].min() > 0
    on_surface = pair.jet(native(pair, c(t)))[0]
    assert np.abs(x[:, :3] / x[:, 3:] - on_surface).max() < 1e-14 * SIZE


@pytest.mark.parametrize(
    "pair",
    [p for p in pairs().values() if isinstance(p.primary, Quadric) and p.name != "extruded ellipse"],
    ids=lambda p: p.name,
)
def test_even_a_wild_lifted_curve_satisfies_the_equation_of_the_quadric(pair):
    """Random coefficients, weights of any sign: the homogeneous equation holds all the same."""
    primary = pair.primary
    k = primary.quadratic.shape[-1]
    c = Curve(np.linspace(0, 1, 5), seeded_random(pair).normal(size=(4, k, 4)), continuity=[-1, -1, -1])
    position = primary.compose_position(c)
    x = position(np.linspace(0, 1, 200, endpoint=False))
    size = np.abs(position.coefs).max()
    w = x[:, 3]
    px, py, pz = primary.frame.axes @ (x[:, :3] - w[:, None] * primary.frame.origin).T
    if isinstance(primary, Plane):
        residual, scale = pz, size
    elif isinstance(primary, Cone):
        residual = (px**2 + py**2) - ((3 * w + pz * math.tan(primary.half_angle)) ** 2)
        scale = size**2
    else:
        along = pz if isinstance(primary, Sphere) else 0 * pz
        residual = px**2 + py**2 + along**2 - (primary.radius * w) ** 2
        scale = size**2
    assert np.abs(residual).max() < 1e-14 * scale


@every
def test_every_lifted_direction_is_tangent(pair):
    c = rail(pair)
    d = field(pair, c)
    position, tangent = pair.primary.compose_position(c), pair.primary.compose_jets(c, [d])[1]
    t = np.linspace(0, 1, 301)
    _, vector = euclidean(position(t), tangent(t))
    _, su, sv = pair.jet(native(pair, c(t)))[:3]
    normal = np.cross(su, sv)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    vector /= np.linalg.norm(vector, axis=1, keepdims=True)
    assert np.abs((normal * vector).sum(1)).max() < 1e-12
    assert np.median(np.abs((normal * vector).sum(1))) < 2e-15


@every
def test_tangent_along_the_rail_itself_is_the_rails_velocity(pair):
    c = rail(pair)
    position = pair.primary.compose_position(c)
    tangent = pair.primary.compose_jets(c, [c.derivative()])[1]
    t = np.linspace(0.001, 0.999, 301)
    velocity = euclidean(position(t), position(t, 1))[1]
    assert np.abs(euclidean(position(t), tangent(t))[1] - velocity).max() < 1e-14 * rounding(position, 1)


@every
def test_unlifted_directions_are_the_derivative_of_the_kernels_point(pair):
    c = rail(pair)
    t = np.linspace(0.01, 0.99, 40)
    d = seeded_random(pair).normal(size=(40, c.dim)) * 0.1
    points, h = c(t), 1e-5
    near = pair.primary.unlift_points(points, np.tile(pair.uv(np.array([0.5, 0.5])), (40, 1)))
    rs = pair.primary.unlift_directions(points, d)
    before, after = (pair.primary.unlift_points(points + step * d, near) for step in (-h, h))
    assert np.abs((after - before) / (2 * h) - rs).max() < 1e-6 * max(1.0, np.abs(rs).max())
    if not kinked(pair):
        first, second = pair.primary.compose_jets(c, [interpolation.interpolate(t, d, degree=1)])
        _, velocity = euclidean(first(t), second(t))
        jet = pair.jet(pair.primary.unlift_points(points, near))
        inside = (near >= np.min(pair.window, axis=1)).all(1) & (near <= np.max(pair.window, axis=1)).all(1)
        found = rs[:, :1] * jet[1] + rs[:, 1:] * jet[2]
        assert np.abs(found - velocity)[inside].max() < 1e-9 * max(1.0, np.abs(velocity).max())


@pytest.mark.parametrize("pair", [p for p in pairs().values() if kinked(p)], ids=lambda pair: pair.name)
def test_weights_with_kinks_are_levelled_at_every_break(pair):
    c = rail(pair)
    position, tangent = pair.primary.compose_position(c), pair.primary.compose_jets(c, [field(pair, c)])[1]
    for ends, side in ((position.breaks[:-1], "right"), (position.breaks[1:], "left")):
        assert np.abs(position(ends, side=side)[:, 3] - 1).max() < 1e-14
        assert np.abs(position(ends, 1, side=side)[:, 3]).max() < 1e-14 * rounding(position, 1)
        assert np.abs(tangent(ends, side=side)[:, 3]).max() < 1e-13 * np.abs(tangent.coefs).max()


@every
@pytest.mark.parametrize("of", ["position", "tangent"])
def test_claimed_continuity_is_there(pair, of):
    c = rail(pair)
    curve = pair.primary.compose_position(c) if of == "position" else pair.primary.compose_jets(c, [field(pair, c)])[1]
    inner = curve.breaks[1:-1]
    assert len(inner)
    for k in range(4):
        claimed = curve.continuity >= k
        if not claimed.any():
            break
        left, right = (curve(inner[claimed], k, side=side) for side in ("left", "right"))
        assert np.abs(left - right).max() < 1e-14 * rounding(curve, k), k


@pytest.mark.parametrize("name", ["spinning sphere", "spinning sphere, left-handed"])
def test_circles_of_latitude_are_linear_in_the_half_angle_for_a_spinning_sphere(name):
    pair = pairs()[name]
    u = np.linspace(0.3, 0.3 + math.pi / 2, 9)
    c = pair.primary.lift_points(np.stack([u, np.full(9, 0.4)], -1))
    half = (u - u[0]) / 2
    first, last = c[0], c[-1]
    turned = (np.sin(half[-1] - half)[:, None] * first + np.sin(half)[:, None] * last) / np.sin(half[-1])
    assert np.abs(c - turned).max() < 1e-15


def test_patch_boundaries_are_crossed_both_ways_and_along_a_whole_lap():
    pair = pairs()["closed spline 3 x 2"]
    t = np.linspace(0, 1, 40)
    uv = np.stack([-0.4 + 2.2 * t, 0.5 + 0.3 * np.sin(9 * t)], -1)
    c = interpolation.interpolate(t, pair.primary.lift_points(uv))
    dense = np.linspace(0, 1, 700)
    wanted = pair.jet(native(pair, c(dense)))[0]
    found = pair.primary.compose_position(c)(dense)
    assert np.abs(found[:, :3] - wanted).max() < 1e-14 * SIZE
    assert set(pair.primary.inner_knot_lines(0)) == {0.2, 0.5, 0.8}


def test_crossings_are_located_where_they_are_found():
    for pair in (p for p in pairs().values() if isinstance(p.primary, TensorSurface)):
        c = rail(pair)
        for highest in (0, 1, 2, 3):
            found = [crossing.t for crossing in pair.primary.find_knot_crossings(c, highest)]
            assert pair.primary.locate_knot_crossings(c, highest).tolist() == found
