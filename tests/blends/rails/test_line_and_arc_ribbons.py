"""Light rails: straight and circular ones are found where they are, and only there."""

from __future__ import annotations

import math

import numpy as np
import pytest
from kernel_surfaces import SIZE, bulges
from rail_cases import FRAME, TURN, WALL, fields, points, wedge

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.blends.rails.line_and_arc_ribbons import ArcLayout, fit_circular_ribbons, fit_straight_ribbons
from cqblend.blends.rails.ribbon_fit import RibbonTargets
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.quadrics import Cone, Cylinder, Plane, Sphere


def rim(second: Primary, v: float, ring: float):
    """Contacts of the plane z = 0 at radius ``ring`` and a surface of revolution at the constant parameter v."""

    def solve(t: np.ndarray) -> Contacts:
        u = TURN * np.asarray(t)
        around = np.stack([np.cos(u), np.sin(u)], -1)
        return Contacts(
            t,
            np.column_stack([8 * around, 0 * u]),
            (ring * around, np.stack([u, np.full_like(u, v)], -1)),
            np.full((2, len(u)), 1.25),
        )

    return solve


ROUND = {
    "cylinder": (Cylinder(FRAME, 8.0), 1.5, 8.0, 1.5),
    "cone": (Cone(FRAME, 8.0, 0.4, 1.0), 1.5, 8 + 1.5 * math.sin(0.4), 1.5 * math.cos(0.4)),
    "sphere": (Sphere(FRAME, 8.0, np.array([0, 0, 1.0]), True), 0.3, 8 * math.cos(0.3), 8 * math.sin(0.3)),
}


def test_straight_rails_are_one_span_of_degree_one_and_exact():
    made = fit_straight_ribbons((Plane(FRAME), Plane(WALL)), wedge, (-0.1, 1.2), RibbonTargets(), SIZE)
    assert made is not None
    t = np.linspace(-0.1, 1.2, 50)
    for rail, wanted in zip(made, (np.array([0, 2.0, 0]), np.array([0, 0, 3.0])), strict=True):
        assert rail.c.degree == 1
        assert len(rail.c.breaks) == 2
        assert np.abs(points(rail, t) - wanted - np.outer(10 * t, [1.0, 0, 0])).max() < 1e-14 * SIZE
        towards = -wanted / np.linalg.norm(wanted)
        assert np.abs(fields(rail, t) - 1.5 * towards).max() < 1e-14 * SIZE


@pytest.mark.parametrize("kind", ROUND)
@pytest.mark.parametrize("bulge", [1.0, 0.7])
def test_circular_rails_have_nine_poles_and_are_the_circles(kind, bulge):
    second, v, ring, height = ROUND[kind]
    made = fit_circular_ribbons(
        (Plane(FRAME), second),
        rim(second, v, 6.5),
        ArcLayout((0.0, 1.0), TURN),
        RibbonTargets(bulges=bulges(bulge)),
        SIZE,
    )
    assert made is not None
    t = np.linspace(0, 1, 401)
    for rail, radius, z in zip(made, (6.5, ring), (0.0, height), strict=True):
        circle = rail.primary.compose_position(rail.c).reduce(tolerance=1e-13)
        assert circle.degree == 2
        assert len(circle.to_bspline()[2]) == 9
        found = points(rail, t)
        assert np.abs(np.hypot(found[:, 0], found[:, 1]) - radius).max() < 1e-14 * SIZE
        assert np.abs(found[:, 2] - z).max() < 1e-14 * SIZE
        assert np.abs(np.linalg.norm(fields(rail, t), axis=1) - 1.25 * bulge).max() < 1e-13
        assert np.abs(np.diff(np.unwrap(np.arctan2(found[:, 1], found[:, 0])))).max() < 0.03
    turned = [np.arctan2(x[:, 1], x[:, 0]) for x in (points(made[0], t), points(made[1], t))]
    assert np.abs((turned[0] - turned[1] + math.pi) % TURN - math.pi).max() < 1e-13  # the same parameter on both


@pytest.mark.parametrize("turn", [0.3, math.pi / 2, 2.0, 5.5])
def test_arcs_take_one_piece_for_each_quarter_turn(turn):
    second = Cylinder(FRAME, 8.0)

    def solve(t):
        return rim(second, 1.5, 6.5)(np.asarray(t) * turn / TURN)

    made = fit_circular_ribbons((Plane(FRAME), second), solve, ArcLayout((0.0, 1.0), turn), RibbonTargets(), SIZE)
    assert made is not None
    assert len(made[0].c.breaks) - 1 == math.ceil(turn / (math.pi / 2) - 1e-9)
    end = points(made[1], np.array([1.0]))[0]
    assert np.abs(end - [8 * math.cos(turn), 8 * math.sin(turn), 1.5]).max() < 1e-14 * SIZE


def test_what_is_not_straight_or_round_is_not_taken_for_it():
    second = Cylinder(FRAME, 8.0)

    def bent(t):
        solved = rim(second, 1.5, 6.5)(t)
        solved.uv[1][:, 1] += 1e-6 * np.sin(3 * TURN * np.asarray(t))
        return solved

    assert (
        fit_circular_ribbons((Plane(FRAME), second), bent, ArcLayout((0.0, 1.0), TURN), RibbonTargets(), SIZE) is None
    )
    assert fit_straight_ribbons((Plane(FRAME), second), bent, (0.0, 0.2), RibbonTargets(), SIZE) is None
