"""Strips of arcs: points, derivatives, rails, sections and cuts, against differences and the definition of a ball."""

from __future__ import annotations

import numpy as np
import pytest

from cqblend.blends.network.arc_strip import ArcStrip
from cqblend.blends.sections.arc_section import ArcSection
from cqblend.splines import Curve
from cqblend.surfaces.quadrics import Cylinder, Plane, Sphere
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse
from cqblend.surfaces.vectors import LocalFrame

AXES = np.linalg.qr(np.array([[0.3, -1.2, 0.5], [0.9, 0.4, -0.2], [-0.1, 0.8, 1.1]]))[0]
FRAME = LocalFrame(np.array([4.0, -2.5, 6.0]), AXES * np.sign(np.linalg.det(AXES)))
RADIUS = 1.5


def make_cylinder(sense: float) -> ArcStrip:
    surface, across = Cylinder(FRAME, RADIUS), np.array([1.2, 0.0])
    stops, breaks = np.array([0.0, 7.0]), np.array([-0.1, 1.1])
    return ArcStrip(ArcSection(surface, RADIUS, np.zeros(2), np.array([0.0, sense]), across, stops, breaks))


def make_torus(sense: float) -> ArcStrip:
    surface, across = RevolvedEllipse.from_radii(FRAME, 5.0, RADIUS), np.array([0.0, sense * 1.2])
    stops, breaks = np.array([0.0, 1.1, 2.9]), np.array([0.0, 0.4, 1.0])
    return ArcStrip(ArcSection(surface, RADIUS, np.array([0.0, 2.0]), np.array([1.0, 0.0]), across, stops, breaks))


def make_sphere(sense: float) -> ArcStrip:
    surface, across = Sphere(FRAME, RADIUS, FRAME.axes[2]), np.array([0.0, sense * 0.7])
    stops, breaks = np.array([0.0, 1.1, 2.9]), np.array([0.0, 0.4, 1.0])
    return ArcStrip(ArcSection(surface, RADIUS, np.array([0.0, 0.1]), np.array([1.0, 0.0]), across, stops, breaks))


STRIPS = {
    f"{make.__name__.removeprefix('make_')}, {'forward' if sense > 0 else 'backward'}": make(sense)
    for make in (make_cylinder, make_torus, make_sphere)
    for sense in (1.0, -1.0)
}


@pytest.fixture(params=STRIPS)
def strip(request: pytest.FixtureRequest) -> ArcStrip:
    return STRIPS[request.param]


def test_derivatives_are_limits_of_differences(strip):
    s, v, h = strip.domain[1] * np.array([0.2, 0.5, 0.8]), np.array([0.2, 0.5, 0.9]), 1e-5
    jet = strip.jet(s, v, 2)
    assert np.array_equal(jet[0, 0], strip(s, v))
    for i, j in ((0, 0), (1, 0), (0, 1)):
        along = (strip.jet(s + h, v, 2)[i, j] - strip.jet(s - h, v, 2)[i, j]) / (2 * h)
        across = (strip.jet(s, v + h, 2)[i, j] - strip.jet(s, v - h, 2)[i, j]) / (2 * h)
        assert np.abs(jet[i + 1, j] - along).max() < 1e-8
        assert np.abs(jet[i, j + 1] - across).max() < 1e-8


def test_rails_are_its_boundaries(strip):
    s = np.linspace(*strip.domain, 7)
    for end, rail in enumerate(strip.rail_curves):
        assert np.abs(rail(s) - strip(s, np.full(7, float(end)))).max() < 1e-14


def test_rails_run_at_unit_speed_or_by_the_angle(strip):
    s, h = strip.domain[1] / 3, 1e-6
    for rail in strip.rail_curves:
        for order in (0, 1):
            difference = (rail(np.array([s + h]), order) - rail(np.array([s - h]), order)) / (2 * h)
            assert np.abs(rail(np.array([s]), order + 1) - difference).max() < 1e-8


def test_sections_are_circles_of_the_ball(strip):
    s = 0.4 * strip.domain[1]
    section, v = strip.locate_section(s), np.linspace(0, 1, 7)
    points = section.curve(section.span[0] + v * (section.span[1] - section.span[0]))
    assert section.curve.radius == RADIUS
    assert np.abs(points - strip(np.full(7, s), v)).max() < 1e-14


def test_it_is_mirrored_where_its_normal_is_opposite_to_that_of_the_surface(strip):
    s, v = np.array([strip.domain[1] / 2]), np.array([0.5])
    jet = strip.jet(s, v, 1)
    own = strip.geometry.evaluate_normals(strip.section.map_to_surface(s, v))[0]
    assert (np.cross(jet[1, 0, 0], jet[0, 1, 0]) @ own < 0) == strip.is_mirrored


def test_curves_are_taken_to_the_parameters_of_the_surface(strip):
    curve = Curve.bezier([(0.1, 0.0), (0.9, 0.4), (1.3, 1.0)])
    t = np.linspace(0, 1, 5)
    s, v = curve(t).T
    uv = strip.map_to_surface(curve)(t)
    assert np.abs(strip.geometry.jet(uv)[0] - strip(s, v)).max() < 1e-14
    back = strip.section.map_from_surface(uv)
    assert np.abs(back - curve(t).T).max() < 1e-14


def test_parameters_of_the_spline_lead_back(strip):
    s, v = (grid.ravel() for grid in np.meshgrid(np.linspace(*strip.domain, 9), np.linspace(0, 1, 5)))
    found = strip.map_from_blend(strip.section.map_to_spline(s, v))
    assert np.abs(found - np.stack([s, v], axis=1)).max() < 1e-13 * max(1.0, strip.domain[1])
    low, high = strip.to_rail_parameters(np.array(strip.domain)).tolist()
    curve = Curve.bezier([[low, 0.0], [0.4 * low + 0.6 * high, 0.5], [high, 1.0]])
    x = np.linspace(0, 1, 21)
    gap = np.abs(strip.map_curve_from_blend(curve)(x) - strip.map_from_blend(curve(x))).max()
    assert gap < 2e-12 * max(1.0, strip.domain[1])


def test_parameters_of_rails_run_through_their_breaks(strip):
    section = strip.section
    assert np.abs(strip.to_rail_parameters(section.stops) - section.breaks).max() < 1e-15
    assert np.all(np.diff(strip.to_rail_parameters(np.linspace(*strip.domain, 50))) > 0)


def make_section_plane(strip: ArcStrip, s: float) -> Plane:
    """The plane of a section."""
    jet = strip.jet(np.array([s]), np.zeros(1), 1)
    normal = jet[1, 0, 0] / np.linalg.norm(jet[1, 0, 0])
    x = jet[0, 1, 0] / np.linalg.norm(jet[0, 1, 0])
    return Plane(LocalFrame(jet[0, 0, 0] + 0.3 * x, np.stack([x, np.cross(normal, x), normal])))


def test_a_plane_through_a_section_cuts_in_a_circle(strip):
    s = 0.6 * strip.domain[1]
    plane = make_section_plane(strip, s)
    cut = strip.cut_with_plane(plane, s)
    assert cut is not None
    t = np.linspace(*cut.span, 9)
    along, across = cut.on_strip(t).T
    assert np.abs(along - s).max() < 1e-13
    points = cut.curve(t)
    assert np.abs(points - strip(along, across)).max() < 1e-13
    assert np.abs(points - plane.jet(cut.on_other(t))[0]).max() < 1e-13
    assert np.abs(cut.rail_parameters - np.array([s, s])).max() < 1e-13


def turn_plane(plane: Plane, angle: float) -> Plane:
    x, y, z = plane.frame.axes
    axes = np.stack([np.cos(angle) * x + np.sin(angle) * z, y, np.cos(angle) * z - np.sin(angle) * x])
    return Plane(LocalFrame(plane.frame.origin, axes))


@pytest.mark.parametrize("angle", [1e-9, 1e-3, -0.8, 1.2])
@pytest.mark.parametrize("sense", [1.0, -1.0])
@pytest.mark.parametrize("flip", [False, True])
def test_an_oblique_plane_cuts_a_cylinder_in_an_ellipse(angle, sense, flip):
    strip = make_cylinder(sense)
    plane = turn_plane(make_section_plane(strip, 4.0), angle)
    if flip:
        x, y, z = plane.frame.axes
        plane = Plane(LocalFrame(plane.frame.origin, np.stack([y, x, -z])))
    cut = strip.cut_with_plane(plane, 4.0)
    assert cut is not None
    t = np.linspace(*cut.span, 33)
    s, v = cut.on_strip(t).T
    assert v[0] == pytest.approx(0, abs=1e-12)
    assert v[-1] == pytest.approx(1, abs=1e-12)
    points = cut.curve(t)
    assert np.abs(points - strip(s, v)).max() < 1e-11
    assert np.abs(points - plane.jet(cut.on_other(t))[0]).max() < 1e-13
    assert np.abs((points - plane.frame.origin) @ plane.frame.axes[2]).max() < 1e-13
    assert cut.curve.radii[0] >= cut.curve.radii[1] == RADIUS


@pytest.mark.parametrize("strip", [make_torus(1.0), make_sphere(-1.0)])
def test_an_oblique_plane_cuts_no_torus_in_closed_form(strip):
    s = 0.6 * strip.domain[1]
    assert strip.cut_with_plane(turn_plane(make_section_plane(strip, s), 1e-3), s) is None
