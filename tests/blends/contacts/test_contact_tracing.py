"""Contacts traced along an edge are those solved for afresh, and none is solved for twice."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from kernel_surfaces import clamped

from cqblend.blends.contacts.contact_solver import (
    Contacts,
    Stations,
    SupportSurface,
    project_to_intersection,
    solve_ball_contacts,
    solve_setback_contacts,
)
from cqblend.blends.contacts.contact_tracing import cache_contacts, interpolate_known, trace_contacts
from cqblend.splines import Surface
from cqblend.surfaces.quadrics import Cylinder, Plane
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import LocalFrame

TILTED = np.array([[1.0, 0, 0], [0, np.cos(0.5), np.sin(0.5)], [0, -np.sin(0.5), np.cos(0.5)]])


def make_oblique_cap() -> tuple[tuple[SupportSurface, SupportSurface], Callable[[np.ndarray], Stations]]:
    """A cylinder about the z axis that is cut by an oblique plane: the edge runs through the seam of the angle."""
    plane, cylinder = (
        Plane(LocalFrame(np.array([0, 0, 6.0]), TILTED)),
        Cylinder(LocalFrame(np.zeros(3), np.eye(3)), 4.0),
    )

    def locate(t: np.ndarray) -> Stations:
        u = 2 * np.pi * t + 3.0
        ring = 4 * np.stack([np.cos(u), np.sin(u)], -1)
        slope = TILTED[2, 1] / TILTED[2, 2]
        points = np.column_stack([ring, 6 - slope * ring[:, 1]])
        tangents = np.column_stack([-ring[:, 1], ring[:, 0], -slope * ring[:, 0]])
        tangents /= np.linalg.norm(tangents, axis=1, keepdims=True)
        flat = (points - [0, 0, 6.0]) @ TILTED[:2].T
        return Stations(t, points, tangents, (flat, np.column_stack([np.mod(u, 2 * np.pi), points[:, 2]])))

    return (SupportSurface(plane, 1.0), SupportSurface(cylinder, 1.0)), locate


def make_wavy_block() -> tuple[tuple[SupportSurface, SupportSurface], Callable[[np.ndarray], Stations]]:
    """A wavy sheet, the top of a block, and the block's side y = 0; stations are on the plane alone."""
    greville = np.array([0, 1, 2, 3, 4, 5]) * 4.0
    x, y = np.meshgrid(greville, greville - 10, indexing="ij")
    poles = np.stack([x, y, 1.5 * np.sin(x / 3) * np.cos(y / 4)], -1)
    knots = (clamped(3, [1 / 3, 2 / 3]), clamped(3, [1 / 3, 2 / 3]))
    sheet = TensorSurface.from_spline(Surface.from_bspline((3, 3), knots, poles))
    side = Plane(LocalFrame(np.zeros(3), np.array([[0, 0, 1.0], [1.0, 0, 0], [0, 1.0, 0]])))

    def locate(t: np.ndarray) -> Stations:
        uv = np.column_stack([0.2 + 0.6 * t, np.full(len(t), 0.5)])
        points = sheet.jet(uv)[0] * [1, 0, 1]
        return Stations(t, points, np.tile([-1.0, 0, 0], (len(t), 1)), (uv, points[:, [2, 0]]))

    return (SupportSurface(sheet, 1.0), SupportSurface(side, 1.0)), locate


@pytest.mark.parametrize("make_edge", [make_oblique_cap, make_wavy_block])
@pytest.mark.parametrize("size", [0.3, 1.0])
@pytest.mark.parametrize("kind", ["ball", "setback"])
def test_traced_contacts_are_those_solved_for_afresh(make_edge, size, kind):
    sides, locate = make_edge()

    def solve(stations: Stations, expected: tuple[np.ndarray, np.ndarray] | None) -> Contacts:
        if kind == "ball":
            return solve_ball_contacts(sides, stations, size, expected)
        return solve_setback_contacts(sides, stations, (size, 0.7 * size), expected)

    traced = trace_contacts(sides, locate, 20.0, solve)
    rng = np.random.default_rng(8)
    for t in (np.linspace(0, 0.99, 17), rng.uniform(0, 0.99, 40), np.sort(rng.uniform(0, 0.99, 100))):
        found = traced(t)
        fresh = solve(project_to_intersection(sides, locate(t), 20.0), None)
        assert np.array_equal(found.t, t)
        for i in (0, 1):
            there, here = (sides[i].primary.jet(contacts.uv[i])[0] for contacts in (found, fresh))
            assert np.abs(there - here).max() < 1e-12
        assert np.abs(found.edge_points - fresh.edge_points).max() < 1e-12
        assert np.abs(found.cross_lengths - fresh.cross_lengths).max() < 1e-12


def test_a_wrong_expectation_is_not_followed():
    sides, locate = make_oblique_cap()
    stations = project_to_intersection(sides, locate(np.linspace(0, 0.9, 10)), 20.0)
    fresh = solve_ball_contacts(sides, stations, 1.0)
    turned = fresh.uv[0], fresh.uv[1] + [0.3, 0]
    found = solve_ball_contacts(sides, stations, 1.0, turned)
    assert np.abs(found.uv[1] - fresh.uv[1]).max() < 1e-12


def test_no_contact_is_solved_for_twice():
    asked = []

    def solve(t: np.ndarray, known: Contacts | None) -> Contacts:
        asked.extend(t.tolist())
        assert (known is None) == (len(asked) == len(t))
        flat = np.stack([t, t], -1)
        return Contacts(t, np.zeros((len(t), 3)), (flat, flat), np.ones((2, len(t))))

    cached = cache_contacts(solve)
    for t in ([0.0, 0.5, 1.0], [0.5, 0.25, 0.25], [1.0], [0.75, 0.0]):
        assert cached(np.array(t)).uv[0][:, 0].tolist() == t
    assert sorted(asked) == [0.0, 0.25, 0.5, 0.75, 1.0]


def test_local_polynomials_reproduce_quintics_and_survive_repeated_nodes():
    nodes = np.sort(np.random.default_rng(2).uniform(0, 2, 30))
    nodes = np.sort(np.append(nodes, nodes[[4, 11]] + 1e-13))

    def quintic(t: np.ndarray) -> np.ndarray:
        return np.stack([t**5 - 2 * t**3, 1 - t**4], -1)

    t = np.linspace(nodes[0] - 0.02, nodes[-1] + 0.02, 77)
    assert np.abs(interpolate_known(nodes, quintic(nodes), t) - quintic(t)).max() < 1e-11
