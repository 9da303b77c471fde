"""Fitted directions: exactly tangent whatever they miss, as smooth as needed, and honest about what they miss."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_surfaces import clamped

from cqblend.blends.rails.cornered_spline import add_third_points
from cqblend.blends.rails.direction_fit import DirectionFit, fit_ribbons_on_rails
from cqblend.blends.rails.rail import Rail
from cqblend.blends.rails.ribbon import dehomogenise_jets
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.splines import Curve, Surface

CUBIC = Curve.bezier([[0.1, 0.2], [0.4, 0.7], [0.6, 0.1], [0.9, 0.6]])
ARCS = Curve.from_bspline(
    2, clamped(2, [0.5, 0.5]), [[0.2, 0.2], [0.2, 0.6], [0.5, 0.6], [0.8, 0.6], [0.8, 0.2]], [1, 0.7, 1, 0.7, 1]
)
QUADRATIC = Curve.from_bspline(2, clamped(2, [0.4]), [[0.1, 0.3], [0.3, 0.8], [0.6, 0.2], [0.9, 0.7]])


def surface(*, rational=False, multiplicity=1):
    rng = np.random.default_rng(11)
    knots = clamped(3, [0.5] * multiplicity), clamped(3, np.repeat([0.33, 0.66], multiplicity))
    u, v = np.meshgrid(*([k[i + 1 : i + 4].mean() for i in range(len(k) - 4)] for k in knots), indexing="ij")
    poles = np.stack([10 * u, 10 * v, np.sin(4 * u + 3 * v)], -1) + rng.uniform(-0.2, 0.2, (*u.shape, 3))
    return Surface.from_bspline((3, 3), knots, poles, rng.uniform(0.7, 1.4, u.shape) if rational else None)


def wish(rail):
    """Tangent vectors of varying length, nowhere along the rail."""

    def vectors(t):
        uv, rate = rail.curve.jet(t, 1)
        jet = rail.surface.jet(uv[:, 0], uv[:, 1], 1)
        normal = np.cross(jet[1, 0], jet[0, 1])
        along = rate[:, :1] * jet[1, 0] + rate[:, 1:] * jet[0, 1]
        across = np.cross(along, normal)
        return (2 + np.sin(3 * t))[:, None] * across / np.linalg.norm(across, axis=1)[:, None]

    return vectors


def made(curve, order=1, steer=0.0, exact=None, **options):
    rail = Rail(surface(**options), curve, "right")
    aims = [
        DirectionFit(rail, wish(rail), order, False, exact),
        DirectionFit(rail, lambda t: -wish(rail)(t), order, False, None),
    ]
    return rail, fit_ribbons_on_rails(tuple(aims), steer)[0]


def first(ribbon, t, side="right"):
    return dehomogenise_jets(np.stack([jet(t, side=side) for jet in ribbon.jets[:2]]))[1]


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("curve", [CUBIC, ARCS, QUADRATIC])
def test_direction_and_length_are_as_stated_and_tangent(curve, rational):
    rail, ribbon = made(curve, rational=rational)
    t = np.linspace(0, 1, 2003)
    found, wanted = first(ribbon, t), wish(rail)(t)
    turned = np.arctan2(np.linalg.norm(np.cross(found, wanted), axis=1), (found * wanted).sum(1)).max()
    stretched = np.abs(np.linalg.norm(found, axis=1) / np.linalg.norm(wanted, axis=1) - 1).max()
    assert turned <= 1.05 * ribbon.direction + 1e-12
    assert stretched <= 1.05 * ribbon.length + 1e-12
    if curve is not QUADRATIC:  # whose perpendicular has a kink, which is rounded
        assert ribbon.direction <= 2e-5
    assert ribbon.length <= 3e-3
    uv = rail.curve(t)
    jet = rail.surface.jet(uv[:, 0], uv[:, 1], 1)
    normal = np.cross(jet[1, 0], jet[0, 1])
    off = (found * normal).sum(1) / np.linalg.norm(found, axis=1) / np.linalg.norm(normal, axis=1)
    assert np.abs(off).max() < 1e-12


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("curve", [CUBIC, ARCS, QUADRATIC])
def test_cross_derivatives_have_no_kink(curve, rational):
    """Not even where the rail's own weight or the wish has one: it would be a crease in the blend."""
    _, ribbon = made(curve, rational=rational)
    knots = np.unique(np.concatenate([jet.breaks for jet in ribbon.jets[:2]]))[1:-1]
    h = 1e-6
    assert np.abs(first(ribbon, knots, "left") - first(ribbon, knots)).max() < 1e-10
    before = (first(ribbon, knots, "left") - first(ribbon, knots - h)) / h
    after = (first(ribbon, knots + h) - first(ribbon, knots)) / h
    bend = np.abs(np.diff(first(ribbon, np.linspace(0, 1, 4001)), 2, axis=0)).max() * 4000**2
    assert np.abs(after - before).max() < 4 * h * bend + 1e-6


@pytest.mark.parametrize("order", [2, 3])
def test_second_and_third_derivatives_are_those_of_straight_sections(order):
    """K is normal to the surface; with G3 the section's speed does not change: <T, J> = -<K, K>."""
    rail, ribbon = made(Curve.bezier([[0.1, 0.1], [0.4, 0.3]]), order=order)
    nodes = ribbon.directions[0].breaks
    jets = dehomogenise_jets(np.stack([jet(nodes) for jet in ribbon.jets]))
    uv = rail.curve(nodes)
    jet = rail.surface.jet(uv[:, 0], uv[:, 1], 1)
    scale = np.linalg.norm(jets[2], axis=1).max()
    for partial in (jet[1, 0], jet[0, 1]):
        assert np.abs((jets[2] * partial).sum(1)).max() < 1e-9 * scale * np.abs(partial).max()
    if order == 3:
        assert np.abs((jets[1] * jets[3]).sum(1) + (jets[2] ** 2).sum(1)).max() < 1e-8 * scale**2


def test_exact_directions_are_taken_as_they_are():
    exact = Curve.bezier([[1.0, -2.0], [1.5, -1.0], [0.5, -1.5]])
    rail = Rail(surface(), CUBIC, "right")

    def vectors(t):
        uv, rs = rail.curve(t), exact(t)
        jet = rail.surface.jet(uv[:, 0], uv[:, 1], 1)
        return rs[:, :1] * jet[1, 0] + rs[:, 1:] * jet[0, 1]

    ribbons = fit_ribbons_on_rails(
        (DirectionFit(rail, vectors, 1, False, exact), DirectionFit(rail, vectors, 1, False, exact)), 0.0
    )
    t = np.linspace(0, 1, 501)
    assert np.abs(first(ribbons[0], t) - vectors(t)).max() < 1e-12
    assert ribbons[0].direction < 1e-13
    assert ribbons[0].directions[0].degree == 2


def test_spans_do_not_get_shorter_than_the_order_allows():
    for order in (1, 2):
        _, ribbon = made(QUADRATIC, order=order)
        steps = np.diff(ribbon.directions[0].breaks)
        assert steps.min() >= 0.3 * RAIL_TOLERANCES.shortest_span_by_order[order]


def test_thirds():
    assert add_third_points(np.array([0.0, 3.0, 9.0])) == pytest.approx([0, 1, 2, 3, 5, 7, 9])
