"""Contacts of a ball that turns in place: it fits into the round face on one side, and touches one point of the other.

Such a face is what a ball of the same radius leaves behind, as the blend of an edge across. Where the ball touches the
other face as well, it stays: of that face it touches one point, and of the round one all of a section, along which one
of its parameters is constant. So contacts are not those of stations, whose planes need not contain the centre of the
ball. They are told by the parameter around the round face, t being the share of its range along the edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from cqblend.blends.contacts.contact_solver import (
    Contacts,
    Stations,
    SupportSurface,
    compute_inward_directions,
)
from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.contacts.surface_normals import differentiate_normal
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.splines.local_interpolation import interpolate_locally
from cqblend.surfaces.angles import unwrap_parameters
from cqblend.surfaces.vectors import cross_product, measure_lengths, to_tangent_coordinates


@dataclass(frozen=True)
class TurningBall:
    """A ball that turns about its contact with one face, in a round face on the side ``round_side``, 0 or 1.

    ``reaches`` (2,) are its radii, signed as the normals of both surfaces. The native parameter ``around`` (0 or 1) of
    the round surface runs along its contacts there, the other one has the value ``held``; ``foot`` (2,) are the native
    parameters of the contact on the other surface. ``deviation`` (mm) is the largest distance of that contact from
    where the ball alone would touch, which is not exactly one point where the round face is not exactly round.
    """

    sides: tuple[SupportSurface, SupportSurface]
    locate_on_surfaces: Callable[[Array], Stations]
    reaches: Array
    round_side: int
    around: int
    held: float
    foot: Array
    deviation: float

    @cached_property
    def _edge_table(self) -> tuple[Array, Array]:
        """Stations (n,) of the edge, and the parameter around the round face there, (n,)."""
        stations = np.linspace(0, 1, CONTACT_TOLERANCES.turning_stations)
        return stations, _read_round_parameters(self, self.locate_on_surfaces(stations))[:, self.around]

    @property
    def turn(self) -> float:
        """The range of the parameter around the round face, signed as the edge runs: an angle (rad) on a cylinder."""
        table = self._edge_table[1]
        return float(table[-1] - table[0])

    def solve_contacts(self, t: Array) -> Contacts:
        """Return the contacts at t (n,)."""
        nodes, table = self._edge_table
        around = table[0] + self.turn * t
        count = min(CONTACT_TOLERANCES.tracing_stations, len(nodes))
        stations = self.locate_on_surfaces(
            interpolate_locally((table - table[0]) / self.turn, nodes[:, None], t, count)[:, 0]
        )
        on_round, on_other = np.empty((len(t), 2)), np.tile(self.foot, (len(t), 1))
        on_round[:, self.around], on_round[:, 1 - self.around] = around, self.held
        first, second = (on_round, on_other) if self.round_side == 0 else (on_other, on_round)
        openings = _measure_openings(self.sides, self.reaches, (first, second))
        lengths = np.tile(4 * np.abs(self.reaches[0]) * np.tan(openings / 4), (2, 1))
        return Contacts(t, stations.points, (first, second), lengths, edge_uv=np.concatenate(stations.uv, axis=1))


def find_turning_ball(
    sides: tuple[SupportSurface, SupportSurface],
    locate_on_surfaces: Callable[[Array], Stations],
    radius: float,
    tolerance: float,
) -> TurningBall | None:
    """Return the ball of a radius that turns in place along all of an edge; None if it moves along.

    ``locate_on_surfaces`` returns stations at parameters (n,) that lie on both surfaces. The ball stands still if its
    contact with the other face differs at both ends of the edge by no more than ``tolerance`` (mm), and elsewhere by no
    more than the sections of polynomial blends are off their balls.
    """
    try:
        middle = locate_on_surfaces(np.array([0.5]))
        turn = compute_inward_directions(sides, middle)[2][0]
        if abs(turn) <= CONTACT_TOLERANCES.smooth_edge_sine:
            return None
        reaches = -np.sign(turn) * radius * np.array([side.outward for side in sides])
        for round_side in (0, 1):
            for around in (0, 1):
                side = sides[round_side]
                if _is_round(side, middle.uv[round_side], around, reaches[round_side]):
                    found = _find_place(sides, locate_on_surfaces, reaches, round_side, around, tolerance)
                    if found is not None:
                        return found
    except GeometryError:  # what is wrong, and where, is found when all stations are solved
        return None
    return None


def _is_round(side: SupportSurface, uv: Array, around: int, reach: float) -> bool:
    """Whether a surface bends, in the direction of one parameter, about as a ball does that touches it."""
    jet = side.primary.jet(uv)
    change = differentiate_normal(jet)[1 + around]
    motion = jet[1 + around] + reach * change
    return bool(measure_lengths(motion)[0] <= CONTACT_TOLERANCES.round_share * measure_lengths(jet[1 + around])[0])


def _read_round_parameters(ball: TurningBall, stations: Stations) -> Array:
    """Return the parameters (n, 2) of stations on the round face, without jumps by periods."""
    return unwrap_parameters(stations.uv[ball.round_side], ball.sides[ball.round_side].primary.periods)


def _find_place(
    sides: tuple[SupportSurface, SupportSurface],
    locate_on_surfaces: Callable[[Array], Stations],
    reaches: Array,
    round_side: int,
    around: int,
    tolerance: float,
) -> TurningBall | None:
    """Return where a ball stands; None if it does not, or if it is not found."""
    stations = locate_on_surfaces(np.linspace(0, 1, CONTACT_TOLERANCES.turning_probes))
    feet, held = _solve_held_contacts(sides, stations, reaches, round_side, around)
    if feet is None or held is None:
        return None
    other = sides[1 - round_side].primary
    points = other.jet(feet)[0]
    radius = float(np.abs(reaches[0]))
    spread = measure_lengths(points - (points[0] + points[-1]) / 2)
    if spread[[0, -1]].max() > tolerance or spread.max() > max(tolerance, CONTACT_TOLERANCES.turning_share * radius):
        return None
    return TurningBall(
        sides,
        locate_on_surfaces,
        reaches,
        round_side,
        around,
        float(held[[0, -1]].mean()),
        feet[[0, -1]].mean(axis=0),
        float(spread.max()),
    )


@np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of iterations that go astray
def _solve_held_contacts(
    sides: tuple[SupportSurface, SupportSurface], stations: Stations, reaches: Array, round_side: int, around: int
) -> tuple[Array | None, Array | None]:
    """Return the contacts (n, 2) of balls with the other face, and their parameters (n,) along the round face.

    Around it, they are where the edge is. None if a ball is not found.
    """
    other_side, along, radius = 1 - round_side, 1 - around, float(np.abs(reaches[0]))
    round_one, other = sides[round_side].primary, sides[other_side].primary
    into = compute_inward_directions(sides, stations)[:2]
    held = unwrap_parameters(stations.uv[round_side], round_one.periods)

    def place_on_round(x: Array) -> Array:
        uv = held.copy()
        uv[:, along] = x[:, 2]
        return uv

    def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
        jets = other.jet(x[:, :2]), round_one.jet(place_on_round(x))
        normals = [differentiate_normal(jet) for jet in jets]
        reach = reaches[other_side], reaches[round_side]
        residual = jets[0][0] + reach[0] * normals[0][0] - jets[1][0] - reach[1] * normals[1][0]
        jacobian = np.stack(
            [
                jets[0][1] + reach[0] * normals[0][1],
                jets[0][2] + reach[0] * normals[0][2],
                -jets[1][1 + along] - reach[1] * normals[1][1 + along],
            ],
            axis=2,
        )
        metric = measure_lengths(np.stack([jets[0][1], jets[0][2], jets[1][1 + along]])).T
        return residual, jacobian, metric

    start = np.empty((len(stations.t), 3))
    steps = [
        to_tangent_coordinates(side.primary.jet(uv), radius * way)
        for side, uv, way in zip(sides, stations.uv, into, strict=True)
    ]
    start[:, :2] = stations.uv[other_side] + steps[other_side]
    start[:, 2] = held[:, along] + steps[round_side][:, along]
    x, solved = solve_damped_newton(evaluate_system, start, radius, radius)
    if not solved.all():
        return None, None
    points = other.jet(x[:, :2])[0], round_one.jet(place_on_round(x))[0]
    ahead = [((points[k] - stations.points) * into[i]).sum(axis=1) for k, i in ((0, other_side), (1, round_side))]
    if min(one.min() for one in ahead) <= 0:
        return None, None
    return unwrap_parameters(x[:, :2], other.periods), x[:, 2]


def _measure_openings(sides: tuple[SupportSurface, SupportSurface], reaches: Array, uv: tuple[Array, Array]) -> Array:
    """Return the angles (n,) between the normals of both surfaces, towards the ball."""
    first, second = (
        np.sign(reach) * side.primary.evaluate_normals(at) for side, reach, at in zip(sides, reaches, uv, strict=True)
    )
    return np.asarray(np.arctan2(measure_lengths(cross_product(first, second)), (first * second).sum(axis=1)))
