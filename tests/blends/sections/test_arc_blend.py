"""Blends by arcs are what a ball leaves behind: the rational spline, and the cylinder or torus that is the same."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from arc_cases import RADIUS, fit_ribbons, make_edges

from cqblend.blends.sections.arc_blend import blend_by_arcs
from cqblend.errors import UnsupportedError


@pytest.mark.parametrize("name", make_edges())
def test_the_rational_spline_is_the_analytic_surface(name):
    blend = blend_by_arcs(fit_ribbons(name), RADIUS)
    arc, rng = blend.arc, np.random.default_rng(2)
    s, v = arc.length * rng.uniform(size=200), rng.uniform(size=200)
    points = blend.surface(*arc.map_to_spline(s, v).T)
    assert np.abs(arc.surface.jet(arc.map_to_surface(s, v))[0] - points).max() < 1e-13
    assert blend.kind == "arc"
    assert blend.surface.degree == ((1, 2) if arc.is_straight else (2, 2))


@pytest.mark.parametrize("name", make_edges())
def test_every_section_is_an_arc_of_the_ball(name):
    """Its points are as far from the ball's centre, which is where normals of length R meet, as the radius says."""
    blend = blend_by_arcs(fit_ribbons(name), RADIUS)
    for t in np.linspace(*blend.surface.domain[0], 5):
        at, v = np.full(9, t), np.linspace(0, 1, 9)
        points = blend.surface(at, v)
        along, across = blend.surface(at, v, 1, 0), blend.surface(at, v, 0, 1)
        normals = np.cross(along, across)
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        towards = np.sign(normals[0] @ (points[-1] - points[0]))
        centres = points + RADIUS * towards * normals
        assert np.abs(centres - centres[0]).max() < 1e-13


@pytest.mark.parametrize("name", make_edges())
def test_it_leaves_both_surfaces_in_their_tangent_planes(name):
    ribbons = fit_ribbons(name)
    blend = blend_by_arcs(ribbons, RADIUS)
    t = np.linspace(*blend.surface.domain[0], 17)
    for end, ribbon in enumerate(ribbons):
        normals = ribbon.primary.evaluate_normals(ribbon.find_native_parameters(t))
        across = blend.surface(t, np.full(17, float(end)), 0, 1)
        assert np.abs((normals * across).sum(axis=1)).max() < 1e-13


def test_a_ball_of_another_size_leaves_other_arcs():
    with pytest.raises(UnsupportedError, match="off the arcs of one ball by"):
        blend_by_arcs(fit_ribbons("rod"), RADIUS * (1 + 1e-9))


def test_directions_that_do_not_meet_are_refused():
    first, second = fit_ribbons("box")
    shifted = replace(second, c=second.c + np.array([1e-6, 0.0, 0.0]))
    with pytest.raises(UnsupportedError, match="tangents at both rails do not meet"):
        blend_by_arcs((first, shifted), RADIUS)


def test_rails_that_are_not_light_are_refused():
    first, second = fit_ribbons("box")
    with pytest.raises(UnsupportedError, match="neither straight nor circles"):
        blend_by_arcs((first, replace(second, light=False)), RADIUS)
