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
from cqblend.splines.local_interpolation import interpolate_locally, tabulate_node_derivatives
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import cross_product, measure_lengths, normalise_vectors, to_tangent_coordinates

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
    edge_jets: list[Array | None] = [None, None]
    roughness = gap = 0.0
    for side, edge in enumerate(crossed):
        if edge is not None:
            first[side] = start = _find_crossing(before, side, edge.before, edge.domain, 1)
            second[side] = stop = _find_crossing(after, side, edge.after, edge.domain, 0)
            inside = (
                before.solve(np.array([start.station - NETWORK_TOLERANCES.inner_share * before.width])).uv[side],
                after.solve(np.array([stop.station + NETWORK_TOLERANCES.inner_share * after.width])).uv[side],
            )
            meeting = _compare_faces((before, after), side, edge, start.sigma, inside)
            roughness, gap = max(roughness, meeting.angle), max(gap, meeting.gap)
            if not meeting.is_one_surface(max(before.targets.orders[side], after.targets.orders[side])):
                edge_jets[side] = np.stack([meeting.tangent, *_differentiate_tangent(edge, start.sigma)])
    along = edge_jets[0], edge_jets[1]
    return (
        CellEnd(_choose_stations(first, before.window[1]), along, roughness, gap),
        CellEnd(_choose_stations(second, after.window[0]), along, roughness, gap),
    )


class _FaceMeeting(NamedTuple):
    """How two faces meet at a point of a smooth edge.

    The unit vector ``tangent`` (3,) along the edge, the ``angle`` (rad) between their tangent planes, by how much their
    normal curvatures (1/mm) across the edge differ, and the ``gap`` (mm) between them.
    """

    tangent: Array
    angle: float
    bend: float
    gap: float

    def is_one_surface(self, order: int) -> bool:
        """Whether cross derivatives of an order of continuity need not run along the edge for the faces to agree."""
        return (
            order <= 1
            and self.angle <= NETWORK_TOLERANCES.natural_angle
            and abs(self.bend) <= NETWORK_TOLERANCES.same_curvature
        )


def _compare_faces(
    cells: tuple[CellRails, CellRails], side: int, edge: CrossedEdge, sigma: float, inside: tuple[Array, Array]
) -> _FaceMeeting:
    """Compare the faces of two cells at a point of the smooth edge between them.

    ``inside`` are native parameters (1, 2) on the rail in either cell: the edge may be a knot line of the surface of
    its face, on whose side of it the surface is taken.

    Where they meet at an angle, their tangent planes have one direction in common: that of the edge, but for the errors
    of both. It is taken if it is no farther from the edge than the faces are from smooth.
    """
    at = np.array([sigma])
    normals, bends, points = [], [], []
    (along,) = normalise_vectors(edge.before(at)[1])
    for cell, curve, uv in zip(cells, (edge.before, edge.after), inside, strict=True):
        on_edge = curve(at)[0]
        step = _subtract_parameters(cell.primaries[side], uv[0], on_edge[0])
        jet = cell.primaries[side].jet(on_edge + NETWORK_TOLERANCES.side_step * step)
        (normal,) = normalise_vectors(cross_product(jet[1], jet[2]))
        ((r, s),) = to_tangent_coordinates(jet, cross_product(normal, along)[None])
        bends.append(float((r * r * jet[3, 0] + 2 * r * s * jet[4, 0] + s * s * jet[5, 0]) @ normal))
        normals.append(normal)
        points.append(jet[0, 0])
    if normals[0] @ normals[1] < 0:  # the parameters of one of the faces have the other sense
        normals[1], bends[1] = -normals[1], -bends[1]
    common = cross_product(normals[0], normals[1])
    angle = float(np.arcsin(min(1.0, float(np.linalg.norm(common)))))
    if angle > NETWORK_TOLERANCES.natural_angle:
        shared = normalise_vectors(common) * (1.0 if common @ along > 0 else -1.0)
        along = shared if np.linalg.norm(shared - along) <= angle else along
    gap = float(np.linalg.norm(points[1] - points[0]))
    return _FaceMeeting(along, angle, bends[0] - bends[1], gap)


def _differentiate_tangent(edge: CrossedEdge, sigma: float) -> tuple[Array, Array]:
    """Return the first two derivatives (3,) of the unit tangent of an edge by its arc length.

    They are those of polynomials through unit tangents at some points around, or beside an end of the edge.
    """
    (low, high), count = edge.domain, NETWORK_TOLERANCES.tangent_count
    step = NETWORK_TOLERANCES.tangent_step * (high - low)
    first = np.clip(sigma - step * (count - 1) / 2, low, high - step * (count - 1))
    offsets = np.insert(first + step * np.arange(count) - sigma, 0, 0.0)
    offsets = np.append(0.0, offsets[1:][np.abs(offsets[1:]) > step / 4])
    velocities = edge.before(sigma + offsets)[1]
    speeds = measure_lengths(velocities)[:, None]
    differentiate = tabulate_node_derivatives(offsets / step) / step
    curvatures = differentiate @ (velocities / speeds) / speeds
    return curvatures[0], differentiate[0] @ curvatures / speeds[0]


def _choose_stations(found: Sequence[_Crossing | None], end: float) -> tuple[float, float]:
    """Return the stations of both sides: that of the other side, or where the cell ends, where nothing is crossed."""
    stations = [crossing.station for crossing in found if crossing is not None] or [end]
    return stations[0], stations[-1]


def _find_crossing(
    cell: CellRails, side: int, curve: CurveOnSurface, domain: tuple[float, float], end: int
) -> _Crossing:
    """Solve for the station, next to one ``end`` of a cell, whose contact on one side lies on a curve.

    The end is 0, its start, or 1, its stop; the curve is one in native parameters.

    Newton's method, with the derivative of the contacts along the cell from a polynomial through some of them at first,
    then from the last step.
    """
    primary, (low, high) = cell.primaries[side], domain
    nodes = np.linspace(*cell.window, RAIL_TOLERANCES.initial_spans + 1)
    known, sigmas = cell.solve(nodes), np.linspace(low, high, NETWORK_TOLERANCES.edge_samples)
    first = -end
    point = primary.jet(known.uv[side][[first]])[0]
    t, sigma = cell.window[end], float(sigmas[measure_lengths(primary.jet(curve(sigmas)[0])[0] - point).argmin()])
    longest = max(
        NETWORK_TOLERANCES.longest_station_step,
        float(measure_lengths(point - known.edge_points[[first]])[0])
        * NETWORK_TOLERANCES.station_step_width
        / cell.length,
    )
    probes = t + NETWORK_TOLERANCES.station_probe * cell.width * np.array([-1.0, 1.0])
    rate = np.diff(interpolate_locally(nodes, known.uv[side], probes, NETWORK_TOLERANCES.probe_count), axis=0)[0]
    rate /= probes[1] - probes[0]
    uv, previous = known.uv[side][first], np.inf
    for _ in range(NETWORK_TOLERANCES.station_steps):
        at, velocity = curve(np.array([sigma]))
        (along,) = to_tangent_coordinates(primary.jet(at), velocity)
        try:
            step_t, step_sigma = np.linalg.solve(
                np.stack([rate, -along], axis=1), -_subtract_parameters(primary, uv, at[0])
            )
        except np.linalg.LinAlgError:
            break
        moved = max(abs(step_t), abs(step_sigma) / (high - low))
        is_stalled = previous / 2 <= moved < NETWORK_TOLERANCES.station_rounding
        if is_stalled or moved < NETWORK_TOLERANCES.station_exact:
            slack = NETWORK_TOLERANCES.edge_slack * (high - low)
            if not low - slack <= sigma <= high + slack:
                raise SizeError(
                    "the rail passes by the end of the smooth edge that it should cross", kind="smooth edge"
                )
            return _Crossing(t, sigma)
        previous = moved
        damping = min(1.0, longest / abs(step_t)) if step_t else 1.0
        step_t *= damping
        t, sigma = float(t + step_t), float(sigma + damping * step_sigma)
        following = cell.solve(np.array([t])).uv[side][0]
        if abs(step_t) > NETWORK_TOLERANCES.station_probe:
            rate = _subtract_parameters(primary, following, uv) / step_t
        uv = following
    raise GeometryError("the rail of the blend does not cross the smooth edge at the end of its face")


def _subtract_parameters(primary: Primary, first: Array, second: Array) -> Array:
    """Return the difference of native parameters (2,), less whole periods."""
    difference = first - second
    for axis, period in enumerate(primary.periods):
        if period is not None:
            difference[axis] -= period * np.round(difference[axis] / period)
    return np.asarray(difference)
