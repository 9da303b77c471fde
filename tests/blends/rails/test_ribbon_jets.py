"""Jets of ribbons, up to the third order, on every primary: against OCCT by differences, against fractions exactly."""

from __future__ import annotations

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from kernel_surfaces import SIZE, pairs

from cqblend.blends.rails.ribbon import dehomogenise_jets
from cqblend.splines import Curve, Surface, interpolate
from cqblend.surfaces.tensor_surface import TensorSurface

T = np.array([0.07, 0.31, 0.58, 0.83])
STEP = 0.02
# Central differences of sixth order, at -4 .. 4 steps, of derivatives 1 to 3.
STENCILS = (
    np.array([0, -1, 9, -45, 0, 45, -9, 1, 0]) / 60,
    np.array([0, 2, -27, 270, -490, 270, -27, 2, 0]) / 180,
    np.array([-7, 72, -338, 488, 0, -488, 338, -72, 7]) / 240,
)


def ribbon(pair, seed=3):
    """A lifted cubic rail inside one knot span, and three lifted directions of any kind along it."""
    rng = np.random.default_rng(seed)
    t = np.linspace(0, 1, 4)
    x = np.stack([0.44 + 0.04 * t, 0.42 + 0.05 * t - 0.03 * t**2], -1)
    c = interpolate(t, pair.primary.lift_points(pair.uv(x)))
    scale = 0.2 * np.abs(c.coefs).max(axis=(0, 2))
    return c, [Curve.bezier(scale * rng.uniform(-1, 1, (2 + k, c.dim))) for k in range(3)]


@pytest.mark.parametrize("name", pairs())
def test_jets_are_derivatives_of_the_surface_along_the_ribbon(name):
    pair = pairs()[name]
    c, directions = ribbon(pair)
    jets = pair.primary.compose_jets(c, directions)
    assert len(jets) == 4
    space = dehomogenise_jets(np.stack([jet(T) for jet in jets]))
    v = STEP * np.arange(-4, 5)[:, None, None]
    moved = c(T) + sum(curve(T) * v**k / math.factorial(k) for k, curve in enumerate(directions, 1))
    start = pair.primary.unlift_points(c(T), np.tile(pair.uv(np.array([[0.45, 0.45]])), (len(T), 1)))
    points = np.stack([pair.jet(pair.primary.unlift_points(row, start))[0] for row in moved])
    assert np.abs(points[4] - space[0]).max() < 1e-13 * 10 * SIZE
    for k, stencil in enumerate(STENCILS, 1):
        differences = np.tensordot(stencil, points, 1) / STEP**k
        scale = np.abs(space[1:]).max()
        assert np.abs(differences - space[k]).max() < 3e-5 * scale


@pytest.mark.parametrize("name", pairs())
def test_jets_of_higher_order_than_there_are_directions_take_the_rest_for_zero(name):
    pair = pairs()[name]
    c, directions = ribbon(pair)
    nothing = Curve.bezier(np.zeros((1, c.dim)))
    short, long = (
        pair.primary.compose_jets(c, directions[:1], 3),
        pair.primary.compose_jets(c, [directions[0], nothing, nothing]),
    )
    for one, other in zip(short, long, strict=True):
        assert np.abs(one(T) - other(T)).max() < 1e-13 * np.abs(other(T)).max() + 1e-14 * SIZE


def fractions(array):
    return np.vectorize(Fraction, otypes=[object])(array)


def product(a, b):
    """Multiply power series in v, (4,) and (4, dim), up to the third power."""
    return np.array([sum(a[i] * b[k - i] for i in range(k + 1)) for k in range(4)])


def bezier(rows, x):
    """De Casteljau on power series (4, dim), at a parameter that is one itself, (4,)."""
    while len(rows) > 1:
        rows = [a + product(x, b - a) for a, b in pairwise(rows)]
    return rows[0]


@pytest.mark.parametrize("degrees", [(1, 1), (3, 3), (2, 5)])
@pytest.mark.parametrize("rational", [False, True])
def test_jets_on_patches_are_exact(degrees, rational):
    """P(c + v d + v^2/2 e + v^3/6 f) as a power series in v, in fractions."""
    rng = np.random.default_rng(7)
    poles = rng.integers(-64, 64, (degrees[0] + 1, degrees[1] + 1, 3)) / 16
    weights = rng.integers(8, 24, poles.shape[:2]) / 16 if rational else None
    knots = tuple(np.repeat([0.0, 1.0], d + 1) for d in degrees)
    primary = TensorSurface.from_spline(Surface.from_bspline(degrees, knots, poles, weights))
    curves = [rng.integers(1, 15, (3, 2)) / 16, *(rng.integers(-8, 8, (3, 2)) / 16 for _ in range(3))]
    lifted = []
    for one, (u, v) in zip((1, 0, 0, 0), (x.T for x in curves), strict=True):
        lifted.append(Curve.bezier(np.stack([one - u, u, one - v, v], -1)))
    t = Fraction(3, 8)
    basis = np.array([(1 - t) ** 2, 2 * t * (1 - t), t**2])
    u, v = np.array([basis @ fractions(x) / math.factorial(k) for k, x in enumerate(curves)]).T
    w = np.ones((*poles.shape[:2], 1)) if weights is None else weights[..., None]
    constant = [
        [np.array([pole, 0 * pole, 0 * pole, 0 * pole]) for pole in row]
        for row in fractions(np.concatenate([poles * w, w], -1))
    ]
    series = bezier([bezier(row, v) for row in constant], u)
    true = np.array([math.factorial(k) * series[k] for k in range(4)]).astype(float)
    found = np.stack([jet([float(t)])[0] for jet in primary.compose_jets(lifted[0], lifted[1:])])
    assert np.abs(true - found).max() < 1e-14 * np.abs(true).max()
