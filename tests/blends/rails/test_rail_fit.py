"""Rails: light where the joint is simple, smooth where it is not, and honest about what they miss."""

from __future__ import annotations

import math

import numpy as np
import pytest
from kernel_surfaces import SIZE, Pair, bulges, pairs

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.blends.rails import rail_fit
from cqblend.blends.rails.rail_fit import RibbonTargets
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.errors import GeometryError
from cqblend.surfaces.primary import Primary
from cqblend.surfaces.quadrics import Cone, Cylinder, Plane, Sphere
from cqblend.surfaces.vectors import LocalFrame

FRAME = LocalFrame(np.zeros(3), np.eye(3))
WALL = LocalFrame(np.zeros(3), np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]]))
TURN = 2 * math.pi


def homogeneous(x: np.ndarray) -> np.ndarray:
    return x[..., :3] / x[..., 3:]


def points(rail: Ribbon, t: np.ndarray) -> np.ndarray:
    return homogeneous(rail.primary.compose_position(rail.c)(t))


def fields(rail: Ribbon, t: np.ndarray) -> np.ndarray:
    x, dx = (jet(t) for jet in rail.compose_jets())
    return (dx[:, :3] - homogeneous(x) * dx[:, 3:]) / x[:, 3:]


def wedge(t: np.ndarray) -> Contacts:
    """The floor z = 0 and the wall y = 0, along x: contacts at distance 2 and 3."""
    x = 10 * np.asarray(t)
    return Contacts(
        t,
        np.stack([x, 0 * x, 0 * x], -1),
        (np.stack([x, 2 + 0 * x], -1), np.stack([x, 3 + 0 * x], -1)),
        np.full((2, len(x)), 1.5),
    )


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


# Light forms.


def test_straight_rails_are_one_span_of_degree_one_and_exact():
    made = rail_fit.fit_straight_ribbons((Plane(FRAME), Plane(WALL)), wedge, (-0.1, 1.2), RibbonTargets(), SIZE)
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
    made = rail_fit.fit_circular_ribbons(
        (Plane(FRAME), second), rim(second, v, 6.5), (0.0, 1.0), TURN, RibbonTargets(bulges=bulges(bulge)), SIZE
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

    made = rail_fit.fit_circular_ribbons((Plane(FRAME), second), solve, (0.0, 1.0), turn, RibbonTargets(), SIZE)
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

    assert rail_fit.fit_circular_ribbons((Plane(FRAME), second), bent, (0.0, 1.0), TURN, RibbonTargets(), SIZE) is None
    assert rail_fit.fit_straight_ribbons((Plane(FRAME), second), bent, (0.0, 0.2), RibbonTargets(), SIZE) is None


# Cubic rails.


def wobbling(pair: Pair):
    """Contacts along wavy closed curves in the window of a primary and on the floor."""
    low, high = np.transpose(pair.window)
    middle, reach = (low + high) / 2, np.minimum(0.3 * (high - low), 0.9)

    def solve(t: np.ndarray) -> Contacts:
        a = TURN * np.asarray(t)
        uv = middle + reach * np.stack([np.cos(a) + 0.1 * np.sin(3 * a), np.sin(a)], -1)
        on_floor = np.stack([9 * np.cos(a), 7 * np.sin(a) + np.cos(2 * a)], -1)
        second = pair.jet(uv)[0]
        first = np.column_stack([on_floor, 0 * a])
        return Contacts(
            t, (first + second) / 2, (on_floor, uv), np.tile(np.linalg.norm(first - second, axis=1), (2, 1))
        )

    return solve


SMOOTH = [
    "cylinder",
    "cone -0.7, nappe +1",
    "torus, left-handed",
    "revolved spline",
    "NURBS cylinder, spline 2 x 1",
]


@pytest.mark.parametrize("name", SMOOTH)
@pytest.mark.parametrize("closed", [False, True])
def test_cubic_rails_are_c2_and_say_how_far_off_they_are(name, closed):
    pair = pairs()[name]
    primaries = (Plane(FRAME), pair.primary)
    wanted = RibbonTargets(1e-4)
    solve = (
        rail_fit.unwrap_closed_solver(wobbling(pair), primaries)
        if closed
        else rail_fit.unwrap_open_solver(wobbling(pair), primaries)
    )
    made = rail_fit.fit_cubic_ribbons(primaries, solve, (0.0, 1.0) if closed else (0.05, 0.8), wanted, closed=closed)
    low, high = made[0].c.domain
    t = np.linspace(low, high, 2001)
    exact = solve(t[:-1] if closed else t)
    if closed:
        t = t[:-1]
    for side, rail in enumerate(made):
        assert rail.c.degree == 3
        inner = rail.c.breaks[1:-1]
        for k in range(3):
            left, right = (rail.c(inner, k, side=at) for at in ("left", "right"))
            step = np.diff(rail.c.breaks).min()
            assert np.abs(left - right).max() < 1e-13 * np.abs(rail.c.coefs).max() * (6 / step) ** k
        jet = pair.jet(exact.uv[1]) if side else primaries[0].jet(exact.uv[0])
        missed = np.linalg.norm(points(rail, t) - jet[0], axis=1)
        assert missed.max() < 2 * wanted.position
        assert np.abs(rail.find_native_parameters(t) - exact.uv[side]).max() < 1e-3
        direction, length = deviations(rail, jet, exact, t)
        assert direction.max() < 2 * max(rail.direction, 1e-12)
        assert length.max() < 2 * max(rail.length, 1e-12)
        if closed:
            ends = rail.c.domain
            for k in range(2):
                first, last = (points_rate(rail, np.array([end]), k) for end in ends)
                assert np.abs(first - last).max() < 10 * wanted.position * (1 if k == 0 else 100)


def points_rate(rail: Ribbon, t: np.ndarray, k: int) -> np.ndarray:
    return points(rail, t) if k == 0 else (points(rail, t + 1e-7) - points(rail, t - 1e-7)) / 2e-7


def deviations(rail: Ribbon, jet: np.ndarray, exact: Contacts, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Measure direction (rad, up to its sign) and length (relative) against C' x n, by central differences."""
    n = np.cross(jet[1], jet[2])
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    h = 1e-6
    rate = (points(rail, t + h) - points(rail, t - h)) / (2 * h)
    wanted = np.cross(rate, n)
    found = fields(rail, t)
    angle = np.arctan2(np.linalg.norm(np.cross(found, wanted), axis=1), np.abs((found * wanted).sum(1)))
    return np.maximum(angle - 1e-8, 0), np.abs(np.linalg.norm(found, axis=1) / exact.cross_lengths[0] - 1)


def test_closed_rails_are_followed_through_the_seam_for_any_number_of_laps():
    pair = pairs()["cylinder"]
    primaries = (Plane(FRAME), pair.primary)

    def solve(t):
        u = TURN * np.asarray(t)
        winding = np.stack([(u + 2) % TURN, np.sin(u)], -1)
        flat = np.stack([np.cos(u), np.sin(u)], -1)
        return Contacts(t, np.column_stack([flat, 0 * u]), (flat, winding), np.ones((2, len(u))))

    t = np.linspace(-1, 2, 121)
    uv = rail_fit.unwrap_closed_solver(solve, primaries)(t).uv[1]
    assert np.abs(np.diff(uv[:, 0]) - TURN / 40).max() < 1e-12


def test_bulge_multiplies_the_length_of_the_directions():
    pair = pairs()["torus"]
    primaries = (Plane(FRAME), pair.primary)
    solve = rail_fit.unwrap_open_solver(wobbling(pair), primaries)
    plain, full = (
        rail_fit.fit_cubic_ribbons(
            primaries, solve, (0.1, 0.7), RibbonTargets(1e-4, bulges=bulges(bulge)), closed=False
        )
        for bulge in (1.0, 1.4)
    )
    t = np.linspace(0.1, 0.7, 33)
    for one, other in zip(plain, full, strict=True):
        ratio = np.linalg.norm(fields(other, t), axis=1) / np.linalg.norm(fields(one, t), axis=1)
        assert np.abs(ratio - 1.4).max() < 1e-3


def test_a_kink_that_no_smooth_rail_follows_is_an_error_with_its_size():
    primaries = (Plane(FRAME), Plane(WALL))

    def kinked(t):
        solved = wedge(t)
        solved.uv[0][:, 1] += 3 * np.abs(np.asarray(t) - 0.51)
        return solved

    with pytest.raises(GeometryError, match=r"the rails miss the contacts by .* mm on \d+ stations"):
        rail_fit.fit_cubic_ribbons(primaries, kinked, (0.0, 1.0), RibbonTargets(1e-7), closed=False)
