"""Contacts of edges along which nothing changes: one is solved for, and the others are where each would be found."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from cqblend.blends.contacts.carried_contacts import find_edge_motion
from cqblend.blends.contacts.contact_solver import (
    Contacts,
    Stations,
    SupportSurface,
    project_to_intersection,
    solve_ball_contacts,
    solve_setback_contacts,
)
from cqblend.blends.contacts.contact_tracing import trace_contacts
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.quadrics import Cone, Cylinder, Plane, Sphere
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse
from cqblend.surfaces.vectors import LocalFrame

TILTED = np.linalg.qr(np.array([[0.3, -1.2, 0.5], [0.9, 0.4, -0.2], [-0.1, 0.8, 1.1]]))[0]
TILTED *= np.sign(np.linalg.det(TILTED))
PLACED = LocalFrame(np.array([40.0, -25.0, 60.0]), TILTED)
TOP = LocalFrame(PLACED.to_global(np.array([1.0, 2, 2])) + PLACED.origin, TILTED)
AROUND = {
    "cylinder": (Cylinder(PLACED, 8.0), 8.0, 2.0),
    "cone": (Cone(PLACED, 8.0, 0.4, 1.0), 8 + 2 * np.tan(0.4), 2 / np.cos(0.4)),
    "sphere": (Sphere(PLACED, 8.0, PLACED.axes[2], True), np.sqrt(60), np.arcsin(0.25)),
    "torus": (
        RevolvedEllipse.from_ellipse(PLACED, np.array([[7.0, 0, 0], [3, 0, 0], [0, 0, 3]])),
        7 + 3 * np.cos(np.arcsin(2 / 3)),
        np.arcsin(2 / 3),
    ),
}


def make_rim(kind: str, turn: float):
    """The edge at which the plane z = 2 cuts a surface about the z axis of the placed frame, over an angle ``turn``."""
    second, radius, v = AROUND[kind]

    def locate(t: np.ndarray) -> Stations:
        u = turn * t
        ring = np.column_stack([radius * np.cos(u), radius * np.sin(u), np.full_like(u, 2.0)])
        tangents = np.sign(turn) * np.column_stack([-np.sin(u), np.cos(u), 0 * u]) @ TILTED
        uv = ring[:, :2] - [1, 2], np.column_stack([u, np.full_like(u, v)])
        return Stations(t, ring @ TILTED + PLACED.origin, tangents, uv)

    return (SupportSurface(Plane(TOP), 1.0), SupportSurface(second, 1.0)), locate, abs(turn) * radius


def make_wedge(second: Primary, to_uv):
    """The straight edge along the z axis of the placed frame between its plane y = 0 and another surface."""
    x, y, z = TILTED
    plane = Plane(LocalFrame(PLACED.origin, np.array([z, x, y])))

    def locate(t: np.ndarray) -> Stations:
        points = PLACED.origin + np.outer(10 * t, z)
        uv = np.column_stack([10 * t, 0 * t]), to_uv(10 * t)
        return Stations(t, points, np.tile(z, (len(t), 1)), uv)

    return (SupportSurface(plane, 1.0), SupportSurface(second, 1.0)), locate, 10.0


def make_edges():
    x, y, z = TILTED
    yield (
        "planes",
        *make_wedge(
            Plane(LocalFrame(PLACED.origin, np.array([(x - 2 * y) / np.sqrt(5), z, (2 * x + y) / np.sqrt(5)]))),
            lambda s: np.column_stack([0 * s, s]),
        ),
    )
    yield (
        "ruling of a cylinder",
        *make_wedge(
            Cylinder(LocalFrame(PLACED.origin + 3 * x + 4 * y - 7 * z, TILTED), 5.0),
            lambda s: np.column_stack([np.full_like(s, np.arctan2(-4, -3)), s + 7]),
        ),
    )
    for kind in AROUND:
        for turn in (2 * np.pi, -2 * np.pi, 1.2, -0.3):
            yield f"{kind} rim of {turn:.1f}", *make_rim(kind, turn)


EDGES = {name: edge for name, *edge in make_edges()}


@pytest.mark.parametrize("name", EDGES)
@pytest.mark.parametrize("kind", ["ball", "setback"])
def test_carried_contacts_are_those_solved_for_at_each_station(name, kind):
    sides, locate, length = EDGES[name]
    asked = []

    def solve(stations: Stations, expected: tuple[np.ndarray, np.ndarray] | None) -> Contacts:
        asked.append(len(stations.t))
        if kind == "ball":
            return solve_ball_contacts(sides, stations, 0.3, expected)
        return solve_setback_contacts(sides, stations, (0.6, 0.4), expected)

    t = np.concatenate([np.linspace(0, 1, 21), [-0.05, 1.1]])
    carried = trace_contacts(sides, locate, length, solve)(t)
    assert asked == [1]
    each = solve(project_to_intersection(sides, locate(t), length), None)
    for i in (0, 1):
        there, here = (sides[i].primary.jet(found.uv[i])[0] for found in (carried, each))
        assert np.abs(there - here).max() < 1e-12
    assert np.abs(carried.edge_points - each.edge_points).max() < 1e-12
    assert np.abs(carried.cross_lengths - each.cross_lengths).max() < 1e-12
    assert np.abs(np.diff(carried.uv[1][:21], axis=0)).max() < 1.0  # no jumps at the seam


def test_no_motion_is_found_where_something_changes():
    sides, locate, length = EDGES["cylinder rim of 1.2"]
    station = project_to_intersection(sides, locate(np.array([0.5])), length)
    assert find_edge_motion(sides, station, length) is not None
    tilt = np.array([[1.0, 0, 0], [0, np.cos(1e-6), np.sin(1e-6)], [0, -np.sin(1e-6), np.cos(1e-6)]])
    leaning = SupportSurface(Plane(LocalFrame(TOP.origin, tilt @ TILTED)), 1.0)
    assert find_edge_motion((leaning, sides[1]), station, length) is None
    beside = SupportSurface(Sphere(LocalFrame(PLACED.origin + 1e-6 * TILTED[0], TILTED), 8.0, TILTED[2], True), 1.0)
    assert find_edge_motion((beside, sides[1]), station, length) is None
    moved = replace(station, tangents=TILTED[2:])
    assert find_edge_motion((SupportSurface(Plane(PLACED), 1.0), leaning), moved, length) is None
