"""Points and derivatives of patches are those of the spline, with weights and without, and far from the origin."""

from __future__ import annotations

import numpy as np
import pytest

from cqblend.splines import Surface
from cqblend.surfaces.patch_evaluation import PatchTable
from cqblend.surfaces.primary_surface import JET_ORDERS


def make_surface(degrees: tuple[int, int], spans: tuple[int, int], *, rational: bool, away: float) -> Surface:
    rng = np.random.default_rng(sum(degrees) + rational)
    knots = [
        np.concatenate([np.zeros(p), np.sort(rng.uniform(0, 3, n + 1)), np.full(p, 3.0)])
        for p, n in zip(degrees, spans, strict=True)
    ]
    for vector, p in zip(knots, degrees, strict=True):
        vector[p], vector[-p - 1] = 0.0, 3.0
    poles = rng.uniform(-1, 1, (degrees[0] + spans[0], degrees[1] + spans[1], 3)) + away
    weights = rng.uniform(0.5, 2, poles.shape[:2]) if rational else None
    return Surface.from_bspline(degrees, (knots[0], knots[1]), poles, weights)


def arrange(surface: Surface) -> PatchTable:
    coefs = surface.coefs
    if not surface.rational:
        coefs = np.concatenate([coefs, np.ones_like(coefs[:, :, :1])], axis=2)
    return PatchTable.from_patches(surface.breaks, coefs, rational=surface.rational)


@pytest.mark.parametrize("degrees", [(1, 1), (1, 3), (2, 2), (3, 3), (5, 4), (7, 1), (9, 9)])
@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("count", [1, 40])
def test_jets_are_those_of_the_spline(degrees, rational, count):
    surface = make_surface(degrees, (4, 3), rational=rational, away=0.0)
    uv = np.random.default_rng(count).uniform(-0.05, 3.05, (count, 2))  # the end patches go on outside
    uv[0] = surface.breaks[0][2], surface.breaks[1][1]  # on knot lines, from the right
    jet = arrange(surface).evaluate_jet(uv)
    wanted = surface.jet(*uv.T, 2)
    for k, (i, j) in enumerate(JET_ORDERS):
        assert np.abs(jet[k] - wanted[i, j]).max() <= 1e-12 * max(1.0, np.abs(wanted[i, j]).max()), (i, j)


@pytest.mark.parametrize("rational", [False, True])
def test_derivatives_keep_their_digits_far_from_the_origin(rational):
    near = make_surface((3, 3), (4, 3), rational=rational, away=0.0)
    far = arrange(near + np.array([2.0**20, -(2.0**21), 2.0**19]))  # the poles are rounded at 2e-10
    uv = np.random.default_rng(0).uniform(0, 3, (50, 2))
    jet, wanted = far.evaluate_jet(uv), near.jet(*uv.T, 2)
    for k, (i, j) in enumerate(JET_ORDERS[1:], start=1):
        assert np.abs(jet[k] - wanted[i, j]).max() < 1e-7


def test_homogeneous_weights_come_with_their_derivatives():
    surface = make_surface((3, 2), (4, 3), rational=True, away=0.0)
    uv = np.random.default_rng(1).uniform(0, 3, (30, 2))
    found = arrange(surface).evaluate_homogeneous(uv)[:, :, 3]
    wanted = Surface(surface.breaks, surface.coefs[:, :, 3:]).jet(*uv.T, 2)[..., 0]
    for k, (i, j) in enumerate(JET_ORDERS):
        assert np.abs(found[k] - wanted[i, j]).max() < 1e-12 * np.abs(wanted[i, j]).max()


def test_no_points_have_no_jets():
    table = arrange(make_surface((3, 2), (4, 3), rational=True, away=0.0))
    assert table.evaluate_jet(np.empty((0, 2))).shape == (6, 0, 3)
