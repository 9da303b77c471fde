"""Ends of ribbons that are given, on every kind of surface."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_surfaces import pairs

from cqblend.blends.rails.ribbon_end import EndJets, find_foot, lift_end
from cqblend.splines import Curve

NAMES = ["cylinder", "cone -0.7, nappe +1", "torus, left-handed", "revolved spline", "NURBS cylinder, spline 2 x 1"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("step", [0.02, -0.02])
def test_curves_with_lifted_ends_have_the_wanted_jets_in_space(name, step):
    """What is tangent to the surface is as wanted; weights are 1, and their derivatives 0, in both parameters."""
    primary = pairs()[name].primary
    low, high = np.transpose(pairs()[name].window)
    uv = low + (high - low) * np.array([0.37, 0.58])
    jet = primary.jet(uv[None])[:, 0]
    wanted = EndJets(*np.random.default_rng(3).normal(size=(2, 4, 3)))
    end, found = lift_end(primary, uv, wanted, step)
    assert found.values[0] == pytest.approx(jet[0], abs=1e-12)
    normal = np.cross(jet[1], jet[2])
    for made, target in ((found.values[1:], wanted.values[1:]), (found.rates, wanted.rates)):
        off = np.cross(made - target, normal / np.linalg.norm(normal))
        assert np.abs(off).max() <= 1e-8 * max(1.0, np.abs(made).max())
    assert abs(found.values[1] @ normal) <= 1e-12 * np.linalg.norm(normal) * np.linalg.norm(found.values[1])
    t = np.sort([0.0, step / 100])
    curves = [
        Curve(t, np.stack([value + slope * x for x in t])[:, :, None])
        for value, slope in zip(end.values, end.slopes, strict=True)
    ]
    jets = primary.compose_jets(curves[0], curves[1:])
    weights = np.stack([one.jet(np.zeros(1), 1, side="left" if step < 0 else "right")[:, 0, 3] for one in jets])
    assert weights - np.eye(4)[:, :1] * [1, 0] == pytest.approx(np.zeros((4, 2)), abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_the_foot_of_a_point_near_a_surface_is_square_below_it(name):
    pair = pairs()[name]
    low, high = np.transpose(pair.window)
    uv = low + (high - low) * np.array([0.4, 0.6])
    point, normal = pair.primary.jet(uv[None])[0, 0], pair.primary.evaluate_normals(uv[None])[0]
    found = find_foot(pair.primary, point + 1e-7 * normal, uv + 0.02 * (high - low))
    foot = pair.primary.jet(found[None])[0, 0]
    assert np.linalg.norm(np.cross(point - foot, normal)) <= 1e-12
