"""Cubic rails: smooth, and honest about what they miss."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_surfaces import Pair, bulges, pairs
from rail_cases import FRAME, TURN, WALL, fields, points, wedge

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.blends.contacts.parameter_unwrapping import unwrap_closed_solver, unwrap_open_solver
from cqblend.blends.rails.cubic_ribbons import fit_cubic_ribbons
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.rails.ribbon_fit import RibbonTargets
from cqblend.errors import GeometryError
from cqblend.surfaces.quadrics import Plane


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
    solve = unwrap_closed_solver(wobbling(pair), primaries) if closed else unwrap_open_solver(wobbling(pair), primaries)
    made = fit_cubic_ribbons(primaries, solve, (0.0, 1.0) if closed else (0.05, 0.8), wanted, closed=closed)
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


def test_bulge_multiplies_the_length_of_the_directions():
    pair = pairs()["torus"]
    primaries = (Plane(FRAME), pair.primary)
    solve = unwrap_open_solver(wobbling(pair), primaries)
    plain, full = (
        fit_cubic_ribbons(primaries, solve, (0.1, 0.7), RibbonTargets(1e-4, bulges=bulges(bulge)), closed=False)
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
        fit_cubic_ribbons(primaries, kinked, (0.0, 1.0), RibbonTargets(1e-7), closed=False)
