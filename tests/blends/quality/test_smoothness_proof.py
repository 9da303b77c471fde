"""Proofs by coefficients: true against evaluation in high precision and by OCCT, sharp, and able to fail."""

from __future__ import annotations

from functools import cache, partial

import mpmath as mp
import numpy as np
import pytest
from kernel_surfaces import Pair, kernel_surface, pairs
from wavy_rails import wavy_pair

from cqblend.blends.quality.smoothness_proof import Proof, prove_blend, prove_side
from cqblend.blends.quality.tolerances import PROOF_TOLERANCES
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.sections.blend_surface import BlendSurface, blend_ribbons, build_section
from cqblend.errors import InputError
from cqblend.splines import Curve, Surface, interpolation
from cqblend.surfaces.quadrics import Cylinder, Plane, Sphere
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import LocalFrame, to_tangent_coordinates

EVERY = [name for name in pairs() if "left-handed" not in name]
every = pytest.mark.parametrize("name", EVERY)
SMOOTH_ENOUGH = [name for name in EVERY if name not in ("NURBS cylinder, spline 2 x 1", "rational spline 2 x 4")]
"""Those on which a G2 ribbon is continuous wherever the rail goes: second derivatives do not jump at knot lines."""


def ribbon(pair: Pair, order: int = 2) -> Ribbon:
    """A ribbon across a rail that turns through a window, with any second direction at all."""
    low, high = np.transpose(pair.window)
    middle, reach = (low + high) / 2, np.minimum(0.3 * (high - low), 0.5)
    if isinstance(pair.primary, Sphere) and not pair.primary.follows_latitude:
        x, y, z = pair.primary.frame.axes @ pair.primary.pole
        middle = np.array([np.arctan2(y, x), np.arcsin(z)])
    t = np.linspace(0, 1, 6)
    uv = middle + reach * np.stack([np.cos(2 * t), np.sin(3 * t)], -1)
    rate = reach * np.stack([-2 * np.sin(2 * t), 3 * np.cos(3 * t)], -1)
    jet, c = pair.jet(uv), pair.primary.lift_points(uv)
    across = np.cross(np.cross(jet[1], jet[2]), rate[:, :1] * jet[1] + rate[:, 1:] * jet[2])
    across /= np.linalg.norm(across, axis=1)[:, None]
    d = interpolation.interpolate(t, pair.primary.lift_directions(uv, c, to_tangent_coordinates(jet, across)))
    noise = np.random.default_rng(7).normal(size=c.shape)
    e = interpolation.interpolate(t, 0.2 * np.abs(d.coefs).max() * noise)
    return Ribbon(pair.primary, interpolation.interpolate(t, c), (d, e)[: max(order, 1)], uv, order)


def leaving(one: Ribbon) -> Surface:
    """Return a surface that leaves a ribbon for a copy of its rail higher up, as the B-spline that it is in the end."""
    jets = list(one.jets)
    weight = jets[0][3]
    above = jets[0] + Curve.stack([weight * 0.3, weight * 0.2, weight * 2.0, weight * 0.0])
    return Surface.from_bspline(*build_section((jets, [above])).to_bspline())


@cache
def made(name: str, order: int = 2) -> tuple[Ribbon, Surface]:
    one = ribbon(pairs()[name], order)
    return one, leaving(one)


def moved(surface: Surface, along: int, across: int, by: float) -> Surface:
    """Move one pole of the B-spline."""
    degrees, knots, poles, weights = surface.to_bspline()
    poles[along, across] += by * np.array([0.6, 0.48, 0.64])
    return Surface.from_bspline(degrees, knots, poles, weights)


# -- independent evaluation


def tensor(jet: np.ndarray, normal: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Curvature tensors (n, 2, 2) of a jet in the frame (along, across) of the plane of a unit normal."""
    first = along - (along * normal).sum(1)[:, None] * normal
    first /= np.linalg.norm(first, axis=1)[:, None]
    frame = np.stack([first, np.cross(normal, first)], 1)
    inverse = np.linalg.inv(frame @ np.stack([jet[1], jet[2]], -1))
    uu, uv, vv = np.einsum("kni,ni->kn", jet[3:], normal)
    form = np.stack([uu, uv, uv, vv], -1).reshape(-1, 2, 2)
    return inverse.transpose(0, 2, 1) @ form @ inverse


def sampled(pair: Pair, surface: Surface, rail: Ribbon, n: int = 400) -> tuple[float, float, float]:
    """Gap, angle and curvature jump, largest over samples, between OCCT's two surfaces."""
    t = (np.arange(n) + 0.5) / n
    (p, q), knots, poles, weights = surface.to_bspline()
    blend = Pair("", None, kernel_surface((p, q), knots, poles, weights), ((0, 1), (0, 1)))
    uv = rail.find_native_parameters(t)
    for axis, period in enumerate(rail.primary.periods):
        if period is not None and isinstance(rail.primary, TensorSurface):
            uv[:, axis] %= period
    mine, other = blend.jet(np.stack([t, 0 * t], -1)), pair.jet(uv)
    m, n_ = (np.cross(jet[1], jet[2]) for jet in (mine, other))
    m, n_ = (x / np.linalg.norm(x, axis=1)[:, None] for x in (m, n_))
    m *= np.sign((m * n_).sum(1))[:, None]
    angle = np.arctan2(np.linalg.norm(np.cross(m, n_), axis=1), (m * n_).sum(1))
    jump = np.abs(np.linalg.eigvalsh(tensor(mine, m, mine[1]) - tensor(other, n_, mine[1])))
    return float(np.linalg.norm(mine[0] - other[0], axis=1).max()), float(angle.max()), float(jump.max())


def casteljau(coefs: np.ndarray, x: mp.mpf) -> np.ndarray:
    while len(coefs) > 1:
        coefs = (1 - x) * coefs[:-1] + x * coefs[1:]
    return coefs[0]


def high(spline: Curve | Surface, *at: mp.mpf) -> np.ndarray:
    """Evaluate homogeneous coefficients in mpmath's precision, in the interior of a piece."""
    coefs = np.vectorize(mp.mpf, otypes=[object])(spline.coefs)
    breaks = [spline.breaks] if len(at) == 1 else list(spline.breaks)
    for axis, (x, ends) in reversed(list(enumerate(zip(at, breaks, strict=True)))):
        j = max(int(np.searchsorted(ends, float(x))) - 1, 0)
        low, width = mp.mpf(ends[j]), mp.mpf(ends[j + 1]) - mp.mpf(ends[j])
        coefs = casteljau(np.moveaxis(coefs[..., j], axis, 0), (x - low) / width)
    return coefs


def on_primary(primary, c: Curve, t: mp.mpf) -> np.ndarray:
    """Return S(c(t)) in mpmath's precision, by the closed form or the spline itself."""
    at = high(c, t)
    if isinstance(primary, Sphere):
        q0, q = at[0], at[1:]
        m = np.vectorize(mp.mpf, otypes=[object])(primary.pole)
        turned = (q0**2 - q @ q) * m + 2 * (q @ m) * q + 2 * q0 * np.cross(q, m)
        return primary.frame.origin + primary.radius * turned / (at @ at)
    if isinstance(primary, Cylinder):
        a, b, height = at
        w = a**2 + b**2
        x, y, z = primary.frame.axes
        return primary.frame.origin + (primary.radius * ((a * a - b * b) * x + 2 * a * b * y) + height * z) / w
    point = high(primary.surface, at[1] / (at[0] + at[1]), at[3] / (at[2] + at[3]))
    return point[:3] / (point[3] if primary.surface.rational else 1)


def length(x: np.ndarray) -> mp.mpf:
    return mp.sqrt(x @ x)


STEP = mp.mpf(10) ** -25


def slope(f, at: mp.mpf) -> np.ndarray:
    return (f(at + STEP) - f(at - STEP)) / (2 * STEP)


def true_normal(primary, c: Curve, t: mp.mpf) -> np.ndarray:
    at = high(c, t)
    if isinstance(primary, Sphere):
        return on_primary(primary, c, t) - primary.frame.origin
    if isinstance(primary, Cylinder):
        out = on_primary(primary, c, t) - primary.frame.origin
        return (
            out
            - (out @ primary.frame.axes[2]) / (primary.frame.axes[2] @ primary.frame.axes[2]) * primary.frame.axes[2]
        )
    u, v = at[1] / (at[0] + at[1]), at[3] / (at[2] + at[3])

    def s(u, v):
        point = high(primary.surface, u, v)
        return point[:3] / (point[3] if primary.surface.rational else 1)

    return np.cross(slope(lambda x: s(x, v), u), slope(lambda x: s(u, x), v))


# -- the exact form


@pytest.mark.parametrize("name", ["sphere", "cylinder", "spline 3 x 3", "rational spline 2 x 4", "closed spline 3 x 2"])
def test_exact_form_is_proven_and_the_proof_holds_in_high_precision(name):
    rail, surface = made(name, 1)
    proof = prove_side(surface, 0, rail)
    assert proof.angle < 1e-10  # most of it is what OCCT's own evaluation may add
    assert proof.gap < 1e-12 * 12
    assert proof.curvature_jump is None

    def h(t, v):
        point = high(surface, t, v)
        return point[:3] / (point[3] if surface.rational else 1)

    with mp.workdps(60):
        for t in np.random.default_rng(3).uniform(size=12):
            t = mp.mpf(float(t))
            assert length(h(t, mp.mpf(0)) - on_primary(rail.primary, rail.c, t)) <= proof.gap
            along = slope(lambda x: h(x, mp.mpf(0)), t)
            m = np.cross(along, slope(partial(h, t), mp.mpf(0)))
            n = true_normal(rail.primary, rail.c, t)
            assert length(np.cross(m, n)) / (length(m) * length(n)) <= proof.angle


@pytest.mark.parametrize("name", ["sphere", "cylinder", "spline 3 x 3", "rational spline 2 x 4"])
def test_what_is_composed_is_as_exact_as_is_taken_for_granted(name):
    rail = made(name)[0]
    position, field = rail.jets[:2]
    normal = rail.primary.compose_normal(rail.c)

    def size(curve, t):
        return float(np.abs(curve.coefs[..., np.searchsorted(curve.breaks, float(t)) - 1]).max())

    with mp.workdps(50):
        for t in np.random.default_rng(4).uniform(size=5):
            t = mp.mpf(float(t))
            point, n = on_primary(rail.primary, rail.c, t), true_normal(rail.primary, rail.c, t)
            n = n / length(n)
            x, d, m = (high(curve, t) for curve in (position, field, normal))
            assert length(x[:3] - x[3] * point) < PROOF_TOLERANCES.composition / 2 * size(position, t)
            assert abs(n @ (d[:3] - d[3] * point)) < PROOF_TOLERANCES.composition / 2 * size(field, t)
            assert length(np.cross(n, m)) < PROOF_TOLERANCES.composition / 2 * size(normal, t)


@every
def test_normal_is_the_kernels(name):
    pair = pairs()[name]
    rail = made(name, 1)[0]
    t = (np.arange(200) + 0.5) / 200
    uv = rail.find_native_parameters(t)
    for axis, period in enumerate(rail.primary.periods):
        if period is not None and isinstance(rail.primary, TensorSurface):
            uv[:, axis] %= period
    jet = pair.jet(uv)
    n, m = rail.primary.compose_normal(rail.c)(t), np.cross(jet[1], jet[2])
    turned = np.linalg.norm(np.cross(n, m), axis=1) / np.linalg.norm(n, axis=1) / np.linalg.norm(m, axis=1)
    assert turned.max() < 1e-14
    assert np.ptp(np.sign((n * m).sum(1))) == 0


@every
def test_g1_is_proven_on_every_primary(name):
    rail, surface = made(name, 1)
    proof = prove_side(surface, 0, rail)
    assert proof.gap < 1e-11
    assert proof.angle < 1e-10


@pytest.mark.parametrize("name", SMOOTH_ENOUGH)
def test_g2_is_proven_where_the_primary_is_smooth_enough(name):
    rail, surface = made(name)
    proof = prove_side(surface, 0, rail)
    assert proof.angle < 1e-10
    assert proof.curvature_jump < 2e-8  # of a second derivative of degree 18, as it may be evaluated
    assert prove_side(surface, 0, rail, 1).curvature_jump is None


@pytest.mark.parametrize("name", ["NURBS cylinder, spline 2 x 1", "rational spline 2 x 4"])
def test_a_b_spline_that_cannot_follow_a_jump_of_curvature_is_found_out(name):
    rail, surface = made(name)
    proof = prove_side(surface, 0, rail)
    jump = sampled(pairs()[name], surface, rail, 4000)[2]
    assert jump > 1e-4
    assert jump <= proof.curvature_jump <= 2 * jump


# -- a proof can fail


@every
@pytest.mark.parametrize("across", [0, 1, 2])
def test_bounds_answer_to_a_pole_that_is_moved_and_are_sharp(name, across):
    rail, surface = made(name)
    at = len(surface.to_bspline()[2]) // 2 - 3
    untouched = prove_side(surface, 0, rail)
    proofs = {}
    for by in (1e-7, 1e-4):
        other = moved(surface, at, across, by)
        proof = proofs[by] = prove_side(other, 0, rail)
        truth = sampled(pairs()[name], other, rail)
        for proven, true, floor in zip(
            (proof.gap, proof.angle, proof.curvature_jump), truth, (1e-11, 1e-10, 2e-8), strict=True
        ):
            assert true <= proven
            assert proven <= 3 * true + floor
    answers = [("gap", "angle", "curvature_jump"), ("angle", "curvature_jump"), ("curvature_jump",)][across]
    for key in answers:
        before, small, large = (getattr(proof, key) for proof in (untouched, proofs[1e-7], proofs[1e-4]))
        if before < 1e-7:
            assert large == pytest.approx(1000 * small, rel=0.1)
            assert small > 3 * before


def test_the_other_end_is_proven_as_well():
    rail, surface = made("spline 3 x 3")
    turned = Surface.from_bspline(*surface.to_bspline())
    coefs = turned.coefs[:, ::-1]
    turned = Surface(turned.breaks, coefs, rational=turned.rational, continuity=turned.continuity)
    a, b = prove_side(surface, 0, rail), prove_side(turned, 1, rail)
    # OCCT reads sections from v = 0: at the other end, the rounding of all rows of poles is in what it evaluates
    assert 0 < a.gap < b.gap < 1e-9
    assert 0 < a.angle < b.angle < 1e-5
    assert 0 < a.curvature_jump < b.curvature_jump
    assert prove_side(surface, 1, rail).angle > 0.1


def test_a_surface_of_another_rail_is_refused():
    rail, surface = made("spline 3 x 3")
    with pytest.raises(InputError, match=r"over t = \[0.1, 1\], its ribbon over \[0, 1\]"):
        prove_side(surface.clip(u=(0.1, 1.0)), 0, rail)


def test_where_no_tangent_plane_is_sure_nothing_is_proven():
    rail, surface = made("spline 3 x 3", 1)
    degrees, knots, poles, weights = surface.to_bspline()
    poles[4:30, 1] = poles[4:30, 0]  # H_v vanishes
    proof = prove_side(Surface.from_bspline(degrees, knots, poles, weights), 0, rail)
    assert proof.angle == np.pi
    assert proof.gap < 1e-12


# -- simple rails, far places, compact forms


def test_straight_rail_between_planes_is_proven_far_from_the_origin():
    def plane(origin, x, y):
        return Plane(LocalFrame(origin, np.array([x, y, np.cross(x, y)])))

    origin = np.array([5e3, -2e3, 9e3])
    x, y, z = np.eye(3)
    start, end = np.array([0.0, 1, 1]), np.array([7.0, 1, 1])
    c, d = Curve.bezier([start, end]), Curve.bezier([[0.0, -1, 0]])
    uv = np.array([start[:2], end[:2]])
    sides = (Ribbon(plane(origin, x, y), c, (d,), uv), Ribbon(plane(origin, x, z), c, (d,), uv))
    proof = prove_blend(blend_ribbons(sides, "exact", 1e-7, 1e-5))
    assert proof.angle < 3e-11  # coordinates of 1e4 mm are rounded to 2e-12 mm
    assert proof.gap < 1e-9


def angles(blend: BlendSurface, n: int = 4000) -> float:
    """Sample the largest angle along both rails, by the kernels' own evaluation."""
    (p, q), knots, poles, weights = blend.surface.to_bspline()
    kernel = Pair("", None, kernel_surface((p, q), knots, poles, weights), ((0, 1), (0, 1)))
    t = (np.arange(n) + 0.5) / n
    largest = 0.0
    for rail, v in zip(blend.ribbons, (0.0, 1.0), strict=True):
        mine, other = (
            kernel.jet(np.stack([t, np.full_like(t, v)], -1)),
            rail.primary.jet(rail.find_native_parameters(t)),
        )
        m, k = np.cross(mine[1], mine[2]), np.cross(other[1], other[2])
        turned = np.arctan2(np.linalg.norm(np.cross(m, k), axis=1), np.abs((m * k).sum(1)))
        largest = max(largest, float(turned.max()))
    return largest


def test_wavy_pair_exact():
    blend = blend_ribbons(wavy_pair(), "exact", 1e-7, 1e-5)
    assert angles(blend) <= prove_blend(blend).angle < 3e-9  # of degree 18, on a piece of 3e-4 of the rail


@pytest.mark.parametrize(("tolerance", "angular"), [(1e-4, 1e-3), (1e-7, 1e-5)])
def test_compact_form_is_proven_within_three_times_what_is_sampled(tolerance, angular):
    blend = blend_ribbons(wavy_pair(), "compact", tolerance, angular)
    proof, truth = prove_blend(blend), angles(blend)
    assert truth <= proof.angle <= 3 * truth
    assert proof.gap < 2 * tolerance


def test_proofs_of_two_rails_are_united():
    assert Proof(1.0, 4.0) | Proof(2.0, 3.0) == Proof(2.0, 4.0)
    both = Proof(1.0, 4.0, 5.0) | Proof(2.0, 3.0)
    assert both == Proof(2.0, 4.0)  # of one rail nothing is proven: nor of both
    assert [side.curvature_jump for side in both.sides] == [5.0, None]
    assert both | Proof(1.0, 1.0, 1.0) == Proof(2.0, 4.0)
    assert len((both | both).sides) == 4
    assert Proof(1.0, 4.0, 5.0) | Proof(2.0, 3.0, 6.0) == Proof(2.0, 4.0, 6.0)
    assert "curvature jump <= 5.0e+00 1/mm" in str(Proof(1.0, 4.0, 5.0))
