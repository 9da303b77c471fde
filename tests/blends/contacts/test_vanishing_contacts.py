"""Contacts next to ends at which the size goes to 0: balls touch both surfaces there as everywhere."""

from functools import partial

import numpy as np
import pytest

from cqblend.blends.contacts.contact_solver import (
    Stations,
    SupportSurface,
    project_to_intersection,
    solve_ball_contacts,
    solve_setback_contacts,
)
from cqblend.blends.contacts.contact_tracing import trace_contacts
from cqblend.blends.contacts.vanishing_contacts import VanishingEnd, continue_to_ends
from cqblend.surfaces.quadrics import Cylinder, Plane
from cqblend.surfaces.vectors import LocalFrame

RADIUS, TURN = 8.0, 1.5
SIDES = (
    SupportSurface(Plane(LocalFrame(np.zeros(3), np.eye(3))), 1.0),
    SupportSurface(Cylinder(LocalFrame(np.zeros(3), np.eye(3)), RADIUS), 1.0),
)
"""The top of a cylinder and its side: the material is below and inside."""

NEAR = np.array([0.0, 1e-14, 1e-12, 1e-9, 1e-7, 1e-5, 1e-4, 4e-4, 2e-3, 9e-3, 0.02, 0.1])
"""Distances, in t, from an end."""

LAWS = {
    "linear": lambda t: 2 * t,
    "sine": lambda t: 2 * np.sin(np.pi * t),
    "square": lambda t: 2 * t**2,
}


def locate_stations(t):
    """Return stations on the rim, an arc of TURN rad around the axis."""
    angle = TURN * t
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    points = np.column_stack([RADIUS * ring, np.zeros(len(t))])
    tangents = np.column_stack([-ring[:, 1], ring[:, 0], np.zeros(len(t))])
    return Stations(t, points, tangents, (RADIUS * ring, np.column_stack([angle, np.zeros(len(t))])))


def locate_on_surfaces(t):
    return project_to_intersection(SIDES, locate_stations(t), RADIUS * TURN)


def make_solver(law, at_stations, ends):
    """Return the solver of a law that goes to 0 at some ends."""
    solve = trace_contacts(SIDES, locate_stations, RADIUS * TURN, at_stations, varies=True)
    return continue_to_ends(solve, locate_on_surfaces, SIDES, lambda t: np.tile(law(t), (2, 1)), ends)


def find_limit(law, end):
    """Return the t at which the size is a thousandth of the largest, by a table."""
    t = np.linspace(0, 1, 200001)
    large = t[law(t) > 1e-3 * law(t).max()]
    return float(large[0] if end == 0 else large[-1])


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_balls_of_any_size_touch_both_surfaces(law):
    """The contacts have a closed form: on the plane RADIUS - R from the axis, on the cylinder R below the plane."""
    ends = [VanishingEnd(0.0, find_limit(law, 0))]
    if law(np.array([1.0]))[0] < 1e-9:
        ends.append(VanishingEnd(1.0, find_limit(law, 1)))
    solve = make_solver(
        law, lambda stations, expected: solve_ball_contacts(SIDES, stations, law(stations.t), expected), tuple(ends)
    )
    t = np.concatenate([NEAR, [0.5], *([1 - NEAR[::-1]] if len(ends) == 2 else [])])
    contacts = solve(t)
    assert np.array_equal(contacts.t, t)
    radii, angle = law(t), TURN * t
    # the centre is in the station's plane, through the axis; so both contacts are
    assert np.abs(np.linalg.norm(contacts.uv[0], axis=1) - (RADIUS - radii)).max() < 1e-12
    assert np.abs(np.arctan2(contacts.uv[0][:, 1], contacts.uv[0][:, 0]) - angle).max() < 1e-12
    assert np.abs(contacts.uv[1] - np.column_stack([angle, -radii])).max() < 1e-12
    assert np.abs(contacts.cross_lengths - 4 * radii * np.tan(np.pi / 8)).max() < 1e-12
    assert (contacts.cross_lengths[:, radii == 0] == 0).all()


def test_at_the_end_itself_contacts_are_the_point_of_the_edge():
    law = LAWS["linear"]
    solve = make_solver(
        law,
        lambda stations, expected: solve_ball_contacts(SIDES, stations, law(stations.t), expected),
        (VanishingEnd(0.0, 1e-3),),
    )
    contacts, edge = solve(np.array([0.0])), locate_on_surfaces(np.array([0.0]))
    assert all(np.array_equal(uv, at) for uv, at in zip(contacts.uv, edge.uv, strict=True))


def test_widths_that_go_to_0():
    laws = (lambda t: t, lambda t: 2 * t)

    def solve_at_stations(stations, expected):
        return solve_setback_contacts(SIDES, stations, (laws[0](stations.t), laws[1](stations.t)), expected)

    solve = continue_to_ends(
        trace_contacts(SIDES, locate_stations, RADIUS * TURN, solve_at_stations, varies=True),
        locate_on_surfaces,
        SIDES,
        lambda t: np.stack([law(t) for law in laws]),
        (VanishingEnd(0.0, 1e-3),),
    )
    contacts = solve(NEAR)
    assert np.abs(np.linalg.norm(contacts.uv[0], axis=1) - (RADIUS - NEAR)).max() < 1e-12
    assert np.abs(contacts.uv[1][:, 1] + 2 * NEAR).max() < 1e-12
    chord = NEAR * np.sqrt(5)
    assert np.abs(contacts.cross_lengths - np.outer([2 / 3, 4 / 3], chord)).max() < 1e-12


def test_what_is_far_from_the_end_is_left_to_the_solver():
    law = LAWS["linear"]
    plain = partial(solve_ball_contacts, SIDES)
    solve = make_solver(
        law, lambda stations, expected: plain(stations, law(stations.t), expected), (VanishingEnd(0.0, 1e-3),)
    )
    t = np.linspace(0.1, 1, 7)
    assert np.array_equal(solve(t).uv[1], plain(locate_on_surfaces(t), law(t)).uv[1])
