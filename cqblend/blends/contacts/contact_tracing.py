"""Traces contacts along an edge: those found already are kept, and tell where others nearby are to be looked for.

A rail is refined by stations in addition to those already solved. The new ones are between old ones, so that a
polynomial through these starts Newton's method a step or two from the solution.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from cqblend.blends.contacts.carried_contacts import find_edge_motion
from cqblend.blends.contacts.contact_solver import (
    Contacts,
    ContactSolver,
    Stations,
    SupportSurface,
    project_to_intersection,
)
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.errors import CqblendError
from cqblend.splines.bernstein import Array
from cqblend.splines.local_interpolation import interpolate_locally
from cqblend.surfaces.angles import unwrap_parameters

TracingSolver = Callable[[Array, Contacts | None], Contacts]
"""A function from parameters t (n,), and the contacts that are known already, to the contacts at t."""

StationSolver = Callable[[Stations, tuple[Array, Array] | None], Contacts]
"""A function from stations, and native parameters near their contacts if any are known, to the contacts."""


def cache_contacts(solve: TracingSolver) -> ContactSolver:
    """Return a solver that remembers contacts, and solves for none twice."""
    known: Contacts | None = None

    def solve_missing_stations(t: Array) -> Contacts:
        nonlocal known
        wanted = np.unique(t)
        if known is None:
            known = solve(wanted, None)
        else:
            missing = np.setdiff1d(wanted, known.t, assume_unique=True)
            if len(missing):
                known = known.merge_with(solve(missing, known))
        return known.select_stations(np.searchsorted(known.t, t))

    return solve_missing_stations


def trace_contacts(
    sides: tuple[SupportSurface, SupportSurface],
    locate_stations: Callable[[Array], Stations],
    scale: float,
    solve_at_stations: StationSolver,
    *,
    varies: bool = False,
) -> ContactSolver:
    """Return a solver of contacts along an edge between two faces, which starts from those that it has found.

    ``locate_stations`` returns stations near both surfaces at parameters (n,), ``scale`` is the length of the edge.
    Straight edges and arcs along which nothing changes take one station, unless the size ``varies`` along them.
    """

    def solve_contacts_at(t: Array, known: Contacts | None) -> Contacts:
        stations, expected = locate_stations(t), None
        if known is not None and len(known.t) >= CONTACT_TOLERANCES.tracing_stations:
            edge_uv, expected = _expect_parameters(known, t, sides)
            stations = replace(stations, uv=edge_uv)
        return solve_at_stations(project_to_intersection(sides, stations, scale), expected)

    solve: ContactSolver | None = None

    def solve_contacts(t: Array) -> Contacts:
        nonlocal solve
        if solve is None:
            solve = None if varies else _carry_from_middle(sides, locate_stations, scale, solve_at_stations)
            solve = cache_contacts(solve_contacts_at) if solve is None else solve
        return solve(t)

    return solve_contacts


def _carry_from_middle(
    sides: tuple[SupportSurface, SupportSurface],
    locate_stations: Callable[[Array], Stations],
    scale: float,
    solve_at_stations: StationSolver,
) -> ContactSolver | None:
    """Return the solver of an edge whose contacts are all those of its middle, moved; None if it is no such edge."""
    try:
        station = project_to_intersection(sides, locate_stations(np.array([0.5])), scale)
        motion = find_edge_motion(sides, station, scale)
        middle = None if motion is None else solve_at_stations(station, None)
    except CqblendError:  # what is wrong, and where, is found when all stations are solved
        return None
    if motion is None or middle is None:
        return None
    return partial(motion.carry_contacts, middle, sides)


def _expect_parameters(
    known: Contacts, t: Array, sides: tuple[SupportSurface, SupportSurface]
) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
    """Return the native parameters (n, 2) at t (n,) of edge points and of contacts, on both sides.

    They are interpolated by polynomials through the nearest known ones.
    """
    if known.edge_uv is None:
        raise TypeError("these contacts do not tell the parameters of the points of the edge")
    values = np.concatenate(
        [
            unwrap_parameters(uv, side.primary.periods)
            for parameters in ((known.edge_uv[:, :2], known.edge_uv[:, 2:]), known.uv)
            for side, uv in zip(sides, parameters, strict=True)
        ],
        axis=1,
    )
    found = interpolate_known(known.t, values, t)
    return (found[:, :2], found[:, 2:4]), (found[:, 4:6], found[:, 6:])


def interpolate_known(nodes: Array, values: Array, t: Array) -> Array:
    """Return at t (m,) the polynomials through the values (n, k) at the nearest of ascending nodes (n,), (m, k).

    Each runs through ``ContactTolerances.tracing_stations`` nodes, and those that nearly repeat another are left out.
    """
    kept = np.append(True, np.diff(nodes) > CONTACT_TOLERANCES.least_tracing_gap * (nodes[-1] - nodes[0]))
    if not kept.all():
        nodes, values = nodes[kept], values[kept]
    return interpolate_locally(nodes, values, t, min(CONTACT_TOLERANCES.tracing_stations, len(nodes)))
