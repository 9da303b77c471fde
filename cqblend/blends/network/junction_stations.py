"""Where the rails of a chain pass from one cell to the next: where they cross the smooth edges between their faces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from cqblend.blends.network.chain_cell import CellEnd, CellRails
from cqblend.blends.network.tolerances import NETWORK_TOLERANCES
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.errors import GeometryError, SizeError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.angles import shift_to_period
from cqblend.surfaces.vectors import normalise_vectors, to_tangent_coordinates

CurveOnSurface = Callable[[Array], tuple[Array, Array]]
"""A function from parameters (n,) to native parameters (n, 2) on a surface and velocities (n, 3) in space."""


@dataclass(frozen=True)
class CrossedEdge:
    """A smooth edge that the rail of one side crosses from the face of one cell to that of the next.

    ``before`` and ``after`` are the edge on the surfaces of both cells, in their native parameters, as functions of one
    parameter over ``domain``.
    """

    before: CurveOnSurface
    after: CurveOnSurface
    domain: tuple[float, float]


Crossings = tuple[CrossedEdge | None, CrossedEdge | None]
"""The smooth edges that a chain crosses at a junction, by side; None where both cells have one face."""


class _Crossing(NamedTuple):
    """The station at which a rail crosses an edge, and the parameter of the edge."""

    station: float
    sigma: float


def locate_junction(before: CellRails, after: CellRails, crossed: Crossings) -> tuple[CellEnd, CellEnd]:
    """Return where the cell before a junction ends and where the one after it starts.

    A side that crosses nothing has the station of the other one.

    Raises
    ------
    SizeError
        If a rail passes by the end of the smooth edge that it should cross.
    GeometryError
        If the crossing is not found.
    """
    first: list[_Crossing | None] = [None, None]
    second: list[_Crossing | None] = [None, None]
    tangents: list[Array | None] = [None, None]
    for side, edge in enumerate(crossed):
        if edge is not None:
            first[side] = at = _find_crossing(before, side, edge.before, edge.domain, 1.0)
            second[side] = _find_crossing(after, side, edge.after, edge.domain, 0.0)
            tangents[side] = normalise_vectors(edge.before(np.array([at.sigma]))[1])[0]
    along = tangents[0], tangents[1]
    return CellEnd(_choose_stations(first, 1.0), along), CellEnd(_choose_stations(second, 0.0), along)


def _choose_stations(found: Sequence[_Crossing | None], vertex: float) -> tuple[float, float]:
    """Return the stations of both sides: that of the other side, or of the vertex, where nothing is crossed."""
    stations = [crossing.station for crossing in found if crossing is not None] or [vertex]
    return stations[0], stations[-1]


def _find_crossing(
    cell: CellRails, side: int, curve: CurveOnSurface, domain: tuple[float, float], start: float
) -> _Crossing:
    """Solve for the station, next to ``start``, whose contact on one side lies on a curve in native parameters."""
    primary = cell.primaries[side]
    low, high = domain
    cell.solve(np.linspace(0, 1, RAIL_TOLERANCES.initial_spans + 1))  # those that lead to all others
    sigmas = np.linspace(low, high, NETWORK_TOLERANCES.edge_samples)
    point = primary.jet(cell.solve(np.array([start])).uv[side])[0]
    nearest = np.linalg.norm(primary.jet(curve(sigmas)[0])[0] - point, axis=1).argmin()
    t, sigma = start, float(sigmas[nearest])
    probe = NETWORK_TOLERANCES.station_probe * np.array([-1.0, 0.0, 1.0])
    previous = np.inf
    for _ in range(NETWORK_TOLERANCES.station_steps):
        uv = cell.solve(t + probe).uv[side]
        at, velocity = curve(np.array([sigma]))
        (along,) = to_tangent_coordinates(primary.jet(at), velocity)
        difference = uv[1] - at[0]
        for axis, period in enumerate(primary.periods):
            if period is not None:
                difference[axis] = shift_to_period(difference[axis], np.zeros(()), period)
        rate = (uv[2] - uv[0]) / (probe[2] - probe[0])
        try:
            step_t, step_sigma = np.linalg.solve(np.stack([rate, -along], axis=1), -difference)
        except np.linalg.LinAlgError:
            break
        moved = max(abs(step_t), abs(step_sigma) / (high - low))
        if previous / 2 <= moved < NETWORK_TOLERANCES.station_rounding or moved == 0:
            slack = NETWORK_TOLERANCES.edge_slack * (high - low)
            if not low - slack <= sigma <= high + slack:
                raise SizeError(
                    "the rail passes by the end of the smooth edge that it should cross", kind="smooth edge"
                )
            return _Crossing(t, sigma)
        previous = moved
        damping = min(1.0, NETWORK_TOLERANCES.longest_station_step / moved)
        t, sigma = float(t + damping * step_t), float(sigma + damping * step_sigma)
    raise GeometryError("the rail of the blend does not cross the smooth edge at the end of its face")
