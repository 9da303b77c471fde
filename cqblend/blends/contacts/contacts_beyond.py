"""Contacts with faces beyond those at the edge, which rails reach over smooth edges: found next to known ones.

A ball that has rolled off the face at the edge touches the one beyond; the edge only tells the planes of the stations.
The surfaces beyond need not come near the edge, so that contacts cannot start from there.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from cqblend.blends.contacts.contact_solver import (
    Contacts,
    ContactSolver,
    Stations,
    SupportSurface,
    evaluate_both_jets,
    measure_ball_openings,
    roll_balls,
)
from cqblend.blends.contacts.contact_tracing import interpolate_known
from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.angles import unwrap_parameters
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import measure_lengths

NearSolver = Callable[[Stations, tuple[Array, Array]], Contacts]
"""A function from stations, and native parameters near their contacts, to the contacts."""


def solve_balls_near(
    sides: tuple[SupportSurface, SupportSurface],
    stations: Stations,
    radius: float | Array,
    expected: tuple[Array, Array],
    *,
    is_convex: bool,
) -> Contacts:
    """Return the contacts of balls next to expected ones, as :func:`.contact_solver.solve_ball_contacts` has them.

    ``is_convex`` tells on which side of the faces the balls are.

    Raises
    ------
    GeometryError
        If there are none.
    """
    radii = np.broadcast_to(radius, stations.t.shape)
    signs = (-1.0 if is_convex else 1.0) * np.array([sides[0].outward, sides[1].outward])[:, None, None]
    start = np.concatenate(expected, axis=1)
    x, solved = roll_balls(sides, (stations.points, stations.tangents), radii[:, None] * signs, start)
    jets = evaluate_both_jets(sides, x)
    openings = measure_ball_openings(jets, signs)
    steps = evaluate_both_jets(sides, start)[:, 0] - jets[:, 0]
    solved &= (measure_lengths(steps) <= CONTACT_TOLERANCES.largest_prediction_error * radii).all(axis=0)
    solved &= openings > CONTACT_TOLERANCES.least_ball_opening
    _require_all(solved, stations, "no ball touches both faces")
    lengths = np.tile(4 * radii * np.tan(openings / 4), (2, 1))
    return Contacts(stations.t, stations.points, (x[:, :2], x[:, 2:]), lengths)


def solve_setbacks_near(
    sides: tuple[SupportSurface, SupportSurface],
    stations: Stations,
    widths: tuple[float | Array, float | Array],
    expected: tuple[Array, Array],
) -> Contacts:
    """Return the contacts at given widths next to expected ones, as :func:`.contact_solver.solve_setback_contacts` has.

    Raises
    ------
    GeometryError
        If there are none.
    """
    wanted = np.stack([np.broadcast_to(width, stations.t.shape) for width in widths])
    first, second = (
        _find_setback_points(side.primary, stations, width, near)
        for side, width, near in zip(sides, wanted, expected, strict=True)
    )
    chord = sides[1].primary.jet(second)[0] - sides[0].primary.jet(first)[0]
    lengths = 2 * wanted / wanted.sum(axis=0) * measure_lengths(chord)
    return Contacts(stations.t, stations.points, (first, second), lengths)


def _find_setback_points(primary: Primary, stations: Stations, widths: Array, near: Array) -> Array:
    """Return native parameters (n, 2) of points of a face at distances (n,) from the edge points, near to others."""

    def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
        jet = primary.jet(x)
        offset = jet[0] - stations.points
        distance = measure_lengths(offset)
        residual = np.stack([distance - widths, (offset * stations.tangents).sum(axis=1)], axis=1)
        jacobian = np.empty((len(x), 2, 2))
        jacobian[:, 0] = (jet[1:3] * (offset / distance[:, None])).sum(axis=2).T
        jacobian[:, 1] = (jet[1:3] * stations.tangents).sum(axis=2).T
        return residual, jacobian, measure_lengths(jet[1:3]).T

    x, solved = solve_damped_newton(evaluate_system, near, widths, widths)
    step = measure_lengths(primary.jet(near)[0] - primary.jet(x)[0])
    _require_all(
        solved & (step <= CONTACT_TOLERANCES.largest_prediction_error * widths), stations, "no point lies at that width"
    )
    return x


def _require_all(solved: Array, stations: Stations, what: str) -> None:
    """Raise GeometryError if not all stations are solved."""
    if not solved.all():
        t = float(stations.t[~solved][0])
        raise GeometryError(f"past a smooth edge of a face, {what} at t = {t:.4g} of the edge", place=t)


def trace_contacts_beyond(
    known: Contacts,
    locate_stations: Callable[[Array], Stations],
    solve_near: NearSolver,
    primaries: tuple[Primary, Primary],
) -> ContactSolver:
    """Return a solver of contacts that starts from known ones, at two stations or more, and goes on from those found.

    ``locate_stations`` returns stations, whose own parameters do not matter. ``primaries`` are those of both sides.
    """
    found = known

    def reach_out(t: Array) -> None:
        """Solve for stations (n,), all near to those found."""
        nonlocal found
        values = np.concatenate(
            [unwrap_parameters(uv, one.periods) for uv, one in zip(found.uv, primaries, strict=True)], axis=1
        )
        near = interpolate_known(found.t, values, t)
        found = found.merge_with(solve_near(locate_stations(t), (near[:, :2], near[:, 2:])))

    def solve_contacts(t: Array) -> Contacts:
        missing = np.setdiff1d(t, found.t)
        while len(missing):
            low, high = float(found.t[0]), float(found.t[-1])
            room = (high - low) * CONTACT_TOLERANCES.extrapolated_share
            near = missing[(missing >= low - room) & (missing <= high + room)]
            if not len(near):
                near = np.array([low - room if missing[0] < low - room else high + room])
            reach_out(near)
            missing = np.setdiff1d(t, found.t)
        return found.select_stations(np.searchsorted(found.t, t))

    return solve_contacts
