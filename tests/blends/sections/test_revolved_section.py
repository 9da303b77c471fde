"""Blends around an axis are their section, turned: that is seen, exactly, and only where it is so."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from kernel_surfaces import SIZE
from rail_cases import TURN, WALL, wedge

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.blends.rails.line_and_arc_ribbons import ArcLayout, fit_circular_ribbons, fit_straight_ribbons
from cqblend.blends.rails.ribbon_fit import RibbonTargets
from cqblend.blends.sections.blend_surface import BlendSurface, blend_ribbons
from cqblend.blends.sections.revolved_section import RevolvedSection, find_revolved_section
from cqblend.splines import Surface
from cqblend.surfaces.quadrics import Cone, Cylinder, Plane, Sphere
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse
from cqblend.surfaces.vectors import LocalFrame

TILTED = np.linalg.qr(np.array([[0.3, -1.2, 0.5], [0.9, 0.4, -0.2], [-0.1, 0.8, 1.1]]))[0]
PLACED = LocalFrame(np.array([40.0, -25.0, 60.0]), TILTED * np.sign(np.linalg.det(TILTED)))

ROUND = {
    "cylinder": (Cylinder(PLACED, 8.0), 1.5),
    "cone": (Cone(PLACED, 8.0, 0.4, 1.0), 1.5),
    "sphere": (Sphere(PLACED, 8.0, PLACED.axes[2], True), 0.3),
    "torus": (RevolvedEllipse.from_ellipse(PLACED, np.array([[6.0, 0, 0], [2.0, 0, 0], [0, 0, 2.0]])), 0.8),
}


def make_blend(kind: str, turn: float, orders: tuple[int, int], domain: tuple[float, float]) -> BlendSurface:
    """The blend between a circle of radius 6.5 in the plane z = 0 and one on a surface around the same axis."""
    second, v = ROUND[kind]

    def solve(t):
        u = turn * np.asarray(t)
        around = np.stack([np.cos(u), np.sin(u)], -1)
        return Contacts(
            t,
            np.column_stack([8 * around, 0 * u]) @ PLACED.axes + PLACED.origin,
            (6.5 * around, np.stack([u, np.full_like(u, v)], -1)),
            np.full((2, len(u)), 1.25),
        )

    ribbons = fit_circular_ribbons(
        (Plane(PLACED), second), solve, ArcLayout(domain, turn), RibbonTargets(orders=orders), SIZE
    )
    assert ribbons is not None
    return blend_ribbons(ribbons, "exact", 1e-7, 1e-5)


def turn_profile(section: RevolvedSection, t: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Turn the profile about the axis of the frame."""
    angle, (radius, height) = section.map_to_angles(t)[:, None], section.profile(v).T[..., None]
    x, y, z = section.frame.axes
    return section.frame.origin + radius * (np.cos(angle) * x + np.sin(angle) * y) + height * z


def compare_at_random_points(blend: BlendSurface, section: RevolvedSection) -> float:
    """Return the largest distance between a blend and its turned profile at 2000 random points."""
    rng = np.random.default_rng(5)
    t, v = rng.uniform(*blend.surface.domain[0], 2000), rng.uniform(0, 1, 2000)
    return float(np.linalg.norm(blend.surface(t, v) - turn_profile(section, t, v), axis=1).max())


@pytest.mark.parametrize("kind", ROUND)
@pytest.mark.parametrize("orders", [(1, 1), (0, 1), (2, 2), (3, 3)])
def test_a_blend_around_an_axis_is_its_section_turned(kind, orders):
    blend = make_blend(kind, TURN, orders, (0.0, 1.0))
    section = find_revolved_section(blend)
    assert section is not None
    assert section.closed
    assert section.profile.degree == sum(orders) + 1
    distance = compare_at_random_points(blend, section)
    assert distance < 1e-12
    assert distance <= section.deviation + 1e-13
    assert section.deviation < 1e-11


@pytest.mark.parametrize("turn", [0.05, 0.3, 2.0, 4.0, 6.0])
@pytest.mark.parametrize("domain", [(0.0, 1.0), (-0.02, 1.03)])
def test_so_is_a_blend_along_an_arc(turn, domain):
    blend = make_blend("cone", turn, (1, 1), domain)
    section = find_revolved_section(blend)
    assert section is not None
    assert not section.closed
    assert section.turn == pytest.approx(turn * (domain[1] - domain[0]), abs=1e-11)
    assert compare_at_random_points(blend, section) < 1e-12


@pytest.mark.parametrize("kind", ROUND)
def test_the_axis_is_that_of_the_surfaces_and_angles_are_those_about_it(kind):
    blend = make_blend(kind, TURN, (1, 1), (0.0, 1.0))
    section = find_revolved_section(blend)
    assert section is not None
    assert np.abs(section.frame.axes @ section.frame.axes.T - np.eye(3)).max() < 1e-14
    assert np.linalg.det(section.frame.axes) == pytest.approx(1)
    assert np.abs(section.frame.axes[2] - PLACED.axes[2]).max() < 1e-13
    away = (section.frame.origin - PLACED.origin) @ PLACED.axes.T
    assert np.abs(away[:2]).max() < 1e-12
    t = np.linspace(0, 1, 101)[:-1]
    for v in (0.0, 1.0):
        x, y, _ = PLACED.axes @ (blend.surface(t, np.full_like(t, v)) - PLACED.origin).T
        angles = np.unwrap(np.arctan2(y, x))
        assert np.abs(section.map_to_angles(t) - (angles - angles[0])).max() < 1e-13
        assert np.hypot(x, y)[0] == pytest.approx(section.profile(v)[0], abs=1e-12)


def make_circular_surface(weights: np.ndarray, radii: np.ndarray, heights: np.ndarray) -> Surface:
    """The surface whose rows of poles are NURBS circles of nine poles about the Z axis of the placed frame."""
    s = math.sqrt(0.5)
    ring = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)], float)
    local = np.stack(
        [np.column_stack([radius * ring, np.full(9, height)]) for radius, height in zip(radii, heights, strict=True)],
        axis=1,
    )
    around = np.tile([1, s], 5)[:9]
    degree = len(radii) - 1
    knots = np.repeat([0.0, 0.25, 0.5, 0.75, 1.0], [3, 2, 2, 2, 3]), np.repeat([0.0, 1.0], degree + 1)
    return Surface.from_bspline((2, degree), knots, local @ PLACED.axes + PLACED.origin, np.outer(around, weights))


def test_a_rational_section_stays_rational():
    weights, radii, heights = np.array([1.0, 2, 0.7, 3]), np.array([5.0, 6, 7, 7]), np.array([0.0, 0, 1, 4])
    surface = make_circular_surface(weights, radii, heights)
    blend = replace(make_blend("cylinder", TURN, (1, 1), (0.0, 1.0)), surface=surface)
    section = find_revolved_section(blend)
    assert section is not None
    assert section.profile.rational
    assert compare_at_random_points(blend, section) < 1e-12


@pytest.mark.parametrize("component", range(4))
@pytest.mark.parametrize("pole", [(1, 1), (4, 0), (7, 2), (8, 3)])
def test_a_blend_that_is_not_turned_to_rounding_is_not_taken_for_it(component, pole):
    surface = make_circular_surface(np.ones(4), np.array([5.0, 6, 7, 7]), np.array([0.0, 0, 1, 4]))
    degrees, knots, poles, weights = surface.to_bspline()
    assert weights is not None
    moved = np.concatenate([poles, weights[..., None]], axis=2)
    moved[(*pole, component)] += 1e-9
    blend = make_blend("cylinder", TURN, (1, 1), (0.0, 1.0))
    assert find_revolved_section(replace(blend, surface=surface)) is not None
    bent = Surface.from_bspline(degrees, knots, moved[..., :3], moved[..., 3])
    assert find_revolved_section(replace(blend, surface=bent)) is None


def test_a_straight_blend_has_no_axis():
    plane = LocalFrame(np.zeros(3), np.eye(3))
    ribbons = fit_straight_ribbons((Plane(plane), Plane(WALL)), wedge, (0.0, 1.0), RibbonTargets(), SIZE)
    assert ribbons is not None
    assert find_revolved_section(blend_ribbons(ribbons, "exact", 1e-7, 1e-5)) is None
