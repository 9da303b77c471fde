"""Strips of a ball that turns in place: points, derivatives, rails and sections, against the definition of the ball."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest

from cqblend.blends.network.turned_strip import TurnedStrip
from cqblend.blends.sections.turned_arcs import TurnedArcs
from cqblend.splines import Curve
from cqblend.surfaces.circle import Circle
from cqblend.surfaces.quadrics import Sphere
from cqblend.surfaces.vectors import LocalFrame

RADIUS = 1.5
CENTRE = np.array([4.0, -2.5, 6.0])


def make_strip(pole_end: Literal[0, 1], sense: float) -> TurnedStrip:
    """A strip between a pole and a quarter of a great circle, oblique to the axis by 0.4 rad."""
    up = np.array([0.3, -0.5, 0.8])
    up /= np.linalg.norm(up)
    aside = np.cross(up, [1.0, 0.0, 0.0])
    aside /= np.linalg.norm(aside)
    normal = sense * (np.cos(0.4) * up + np.sin(0.4) * aside)
    first = np.cross(normal, [0.2, 0.9, -0.1])
    first /= np.linalg.norm(first)
    second = np.cross(normal, first)
    start = first if sense > 0 else np.cos(1.9) * first + np.sin(1.9) * second
    x = start - (start @ up) * up
    x /= np.linalg.norm(x)
    sphere = Sphere(LocalFrame(CENTRE, np.stack([x, np.cross(up, x), up])), RADIUS, up)
    rail = Circle(LocalFrame(CENTRE, np.stack([first, second, normal])), RADIUS)
    return TurnedStrip(
        TurnedArcs(sphere, rail, pole_end, sense, np.array([0.0, 0.6, 1.2, 1.9]), np.array([0.0, 0.3, 0.6, 1.0]))
    )


@pytest.fixture(params=[(0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)], ids=str)
def strip(request: pytest.FixtureRequest) -> TurnedStrip:
    return make_strip(*request.param)


S, V = (grid.ravel() for grid in np.meshgrid(np.linspace(0.05, 1.85, 7), np.linspace(0.1, 0.9, 5)))


def test_points_are_on_great_circles_between_the_pole_and_the_rail(strip):
    pole = CENTRE + RADIUS * strip.geometry.frame.axes[2]
    to_pole, to_rail = (pole - CENTRE) / RADIUS, (strip.section.rail(S) - CENTRE) / RADIUS
    arms = (strip(S, V) - CENTRE) / RADIUS
    assert np.abs(np.linalg.norm(arms, axis=1) - 1).max() < 1e-14
    share = V if strip.section.pole_end == 0 else 1 - V
    opening = np.arccos(to_rail @ to_pole)
    assert np.abs(np.arccos(arms @ to_pole) - share * opening).max() < 1e-12
    assert np.abs((np.cross(to_pole, to_rail) * arms).sum(axis=1)).max() < 1e-13


def test_derivatives_are_limits_of_differences(strip):
    h = 1e-5
    jet = strip.jet(S, V, 2)
    for i, j in ((0, 0), (1, 0), (0, 1)):
        along = (strip.jet(S + h, V, 2)[i, j] - strip.jet(S - h, V, 2)[i, j]) / (2 * h)
        across = (strip.jet(S, V + h, 2)[i, j] - strip.jet(S, V - h, 2)[i, j]) / (2 * h)
        assert np.abs(jet[i + 1, j] - along).max() < 1e-8
        assert np.abs(jet[i, j + 1] - across).max() < 1e-8


def test_the_rational_spline_is_the_same_surface(strip):
    spline = strip.section.make_surface()
    assert np.abs(spline(*strip.section.map_to_spline(S, V).T) - strip(S, V)).max() < 1e-13


def test_parameters_of_the_spline_lead_back(strip):
    tv = strip.section.map_to_spline(S, V)
    assert np.abs(strip.map_from_blend(tv) - np.stack([S, V], axis=1)).max() < 1e-14
    curve = Curve.bezier([[0.2, 0.1], [0.4, 0.5], [0.5, 0.9]])
    x = np.linspace(0, 1, 21)
    assert np.abs(strip.map_curve_from_blend(curve)(x) - strip.map_from_blend(curve(x))).max() < 2e-12


def test_parameters_on_the_sphere_lead_back(strip):
    s, v = strip.section.map_from_surface(strip.section.map_to_surface(S, V))
    assert np.abs(s - S).max() < 1e-12
    assert np.abs(v - V).max() < 1e-12


def test_the_sense_is_that_of_the_parameters(strip):
    uv = strip.section.map_to_surface(np.array([0.5, 0.51, 0.5]), np.array([0.5, 0.5, 0.51]))
    turn = np.linalg.det(uv[1:] - uv[0])
    assert strip.is_mirrored == (turn < 0)


def test_sections_and_rails_are_curves_of_the_strip(strip):
    v = np.linspace(0, 1, 9)
    for s in (0.0, 0.7, 1.9):
        section = strip.locate_section(s)
        low, high = section.span
        assert np.abs(section.curve(low + v * (high - low)) - strip(np.full(9, s), v)).max() < 1e-13
        on_sphere = strip.map_to_surface(section.make_pcurve(s))
        assert np.abs(strip.geometry.jet(on_sphere(low + v * (high - low)))[0] - strip(np.full(9, s), v)).max() < 1e-13
    s = np.linspace(0, 1.9, 23)
    for end, row in enumerate(strip.rail_curves):
        assert np.abs(row(s) - strip(s, np.full(23, float(end)))).max() < 1e-13
        on_sphere = strip.map_to_surface(Curve.bezier([(0.0, end), (1.9, end)], domain=(0.0, 1.9)))
        assert np.abs(strip.geometry.jet(on_sphere(s))[0] - row(s)).max() < 1e-11


def test_the_least_opening_is_that_nearest_to_the_pole(strip):
    openings = strip.section.measure_openings(np.linspace(0, strip.section.length, 2001))
    assert strip.section.least_opening == pytest.approx(openings.min(), abs=1e-6)
    assert strip.section.least_opening <= openings.min() + 1e-12
