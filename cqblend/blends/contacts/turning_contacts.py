"""Contacts of a ball inside a round face: it rolls around there, or turns in place if it fits in exactly.

A round face is what a ball of some radius leaves behind, as the blend of an edge across: along one of its parameters it
is an arc of that ball. A ball of about the same radius that touches it from inside, and another face as well, hardly
moves when it goes around. If the radius is the same it stays where it is: of the other face it touches one point, and
of the round one all of an arc. So the planes of stations need not contain the centre of the ball, and do not tell its
contacts. Here, these are told by the parameter around the round face, t being the share of its range along the edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from cqblend.blends.contacts.contact_solver import (
    Contacts,
    Stations,
    SupportSurface,
    compute_inward_directions,
)
from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.contacts.surface_normals import differentiate_normals
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.errors import GeometryError, SizeError
from cqblend.splines.bernstein import Array
from cqblend.splines.local_interpolation import interpolate_locally
from cqblend.surfaces.angles import unwrap_parameters
from cqblend.surfaces.vectors import cross_product, measure_lengths, to_tangent_coordinates


@dataclass(frozen=True)
class StandingBall:
    """A ball that turns in place: it touches the other face at native parameters ``foot`` (2,).

    The parameter along the round face has the value ``held`` at all contacts there. ``deviation`` (mm) is the largest
    distance of the foot from where the ball alone would touch, which is not exactly one point where the round face is
    not exactly round.
    """

    foot: Array
    held: float
    deviation: float


@dataclass(frozen=True)
class RoundFace:
    """The round face on the side ``round_side``, 0 or 1, of an edge, which a ball goes around.

    ``senses`` (2,) are the signs of the ball's radius along the normals of both surfaces. The native parameter
    ``around`` (0 or 1) of the round surface runs along its arcs, which have about the radius ``radius`` (mm).
    """

    sides: tuple[SupportSurface, SupportSurface]
    locate_on_surfaces: Callable[[Array], Stations]
    senses: Array
    round_side: int
    around: int
    radius: float

    @cached_property
    def _edge_table(self) -> tuple[Array, Array]:
        """Stations (n,) of the edge, and the parameter around the round face there, (n,)."""
        stations = np.linspace(0, 1, CONTACT_TOLERANCES.turning_stations)
        return stations, self._read_round_parameters(self.locate_on_surfaces(stations))[:, self.around]

    @property
    def turn(self) -> float:
        """The range of the parameter around the round face, signed as the edge runs: an angle (rad) on a cylinder."""
        table = self._edge_table[1]
        return float(table[-1] - table[0])

    def _read_round_parameters(self, stations: Stations) -> Array:
        """Return the parameters (n, 2) of stations on the round face, without jumps by periods."""
        return unwrap_parameters(stations.uv[self.round_side], self.sides[self.round_side].primary.periods)

    def _locate_around(self, t: Array) -> Stations:
        """Return the stations of the edge (n,) at shares t (n,) of the way around, ascending or not."""
        nodes, table = self._edge_table
        shares, count = (table - table[0]) / self.turn, min(CONTACT_TOLERANCES.tracing_stations, len(nodes))
        found = self.locate_on_surfaces(interpolate_locally(shares, nodes[:, None], t, count)[:, 0])
        return replace(found, t=t)

    def find_standing_ball(self, radius: float, tolerance: float) -> StandingBall | None:
        """Return the ball of a radius that turns in place; None if it moves along.

        It stands still if its contact with the other face differs at both ends of the edge by no more than
        ``tolerance`` (mm), and elsewhere by no more than the sections of polynomial blends are off their balls.
        """
        t = np.linspace(0, 1, CONTACT_TOLERANCES.turning_probes)
        try:
            x = self._solve_held(t, self._locate_around(t), np.full(len(t), radius))
        except SizeError:
            return None
        points = self.sides[1 - self.round_side].primary.jet(x[:, :2])[0]
        spread = measure_lengths(points - (points[0] + points[-1]) / 2)
        most = max(tolerance, CONTACT_TOLERANCES.turning_share * radius)
        if spread[[0, -1]].max() > tolerance or spread.max() > most:
            return None
        return StandingBall(x[[0, -1], :2].mean(axis=0), float(x[[0, -1], 2].mean()), float(spread.max()))

    def solve_contacts(self, t: Array, radii: Array, standing: StandingBall | None = None) -> Contacts:
        """Return the contacts at t (n,) of balls with radii (n,), or of one that turns in place.

        Raises
        ------
        SizeError
            If a ball is not found.
        """
        stations = self._locate_around(t)
        on_round = np.empty((len(t), 2))
        on_round[:, self.around] = self._edge_table[1][0] + self.turn * t
        if standing is None:
            x = self._solve_held(t, stations, radii)
            on_other, on_round[:, 1 - self.around] = x[:, :2], x[:, 2]
        else:
            on_other, on_round[:, 1 - self.around] = np.tile(standing.foot, (len(t), 1)), standing.held
        first, second = (on_round, on_other) if self.round_side == 0 else (on_other, on_round)
        normals = [
            sense * side.primary.evaluate_normals(uv)
            for sense, side, uv in zip(self.senses, self.sides, (first, second), strict=True)
        ]
        openings = np.arctan2(measure_lengths(cross_product(*normals)), (normals[0] * normals[1]).sum(axis=1))
        lengths = np.tile(4 * radii * np.tan(openings / 4), (2, 1))
        return Contacts(t, stations.points, (first, second), lengths, edge_uv=np.concatenate(stations.uv, axis=1))

    @np.errstate(over="ignore", invalid="ignore", divide="ignore")  # of iterations that go astray
    def _solve_held(self, t: Array, stations: Stations, radii: Array) -> Array:
        """Return the contacts of balls (n, 3): parameters on the other face, and that along the round one.

        They are found from those of a ball that fits into the round face, by changing the radius in steps.
        """
        other_side, along = 1 - self.round_side, 1 - self.around
        round_one, other = self.sides[self.round_side].primary, self.sides[other_side].primary
        into = compute_inward_directions(self.sides, stations)[:2]
        held = self._read_round_parameters(stations)
        held[:, self.around] = self._edge_table[1][0] + self.turn * t

        def place_on_round(x: Array) -> Array:
            uv = held.copy()
            uv[:, along] = x[:, 2]
            return uv

        def solve_for_radii(radii: Array, start: Array) -> tuple[Array, Array]:
            reaches = self.senses[:, None] * radii

            def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
                jets = np.stack([other.jet(x[:, :2]), round_one.jet(place_on_round(x))])
                normals = differentiate_normals(jets)
                reach = np.stack([reaches[other_side], reaches[self.round_side]])[..., None]
                centres = jets[:, 0] + reach * normals[0]
                rates = jets[:, 1:3] + reach[:, None] * normals[1:].swapaxes(0, 1)
                jacobian = np.stack([rates[0, 0], rates[0, 1], -rates[1, along]], axis=2)
                metric = measure_lengths(np.stack([jets[0, 1], jets[0, 2], jets[1, 1 + along]])).T
                return centres[0] - centres[1], jacobian, metric

            return solve_damped_newton(evaluate_system, start, radii, radii)

        steps = [
            to_tangent_coordinates(side.primary.jet(uv), self.radius * way)
            for side, uv, way in zip(self.sides, stations.uv, into, strict=True)
        ]
        x = np.column_stack(
            [stations.uv[other_side] + steps[other_side], held[:, along] + steps[self.round_side][:, along]]
        )
        solved = np.ones(len(t), dtype=bool)
        count = CONTACT_TOLERANCES.radius_steps
        for k in range(count + 1):
            x, found = solve_for_radii(self.radius + (radii - self.radius) * k / count, x)
            solved &= found
        points = other.jet(x[:, :2])[0], round_one.jet(place_on_round(x))[0]
        for point, side in zip(points, (other_side, self.round_side), strict=True):
            solved &= ((point - stations.points) * into[side]).sum(axis=1) > 0
        if not solved.all():
            first = int((~solved).argmax())
            raise SizeError(
                f"no ball of radius {radii[first]:g} touches both faces at t = {t[first]:.4g} of the edge",
                kind="too large",
                place=float(t[first]),
                value=float(radii[first]),
            )
        return np.column_stack([unwrap_parameters(x[:, :2], other.periods), x[:, 2]])


def find_round_face(
    sides: tuple[SupportSurface, SupportSurface],
    locate_on_surfaces: Callable[[Array], Stations],
    radius: float,
    tolerance: float,
) -> RoundFace | None:
    """Return the round face beside an edge that a ball of a radius fits into, with little room; None if there is none.

    ``locate_on_surfaces`` returns stations at parameters (n,) that lie on both surfaces. A face is round if a ball as
    its arcs are turns in place between it and the other face, within ``tolerance`` (mm).
    """
    try:
        stations = locate_on_surfaces(np.array([0.0, 0.5, 1.0]))
        turn = compute_inward_directions(sides, stations)[2][1]
        if abs(turn) <= CONTACT_TOLERANCES.smooth_edge_sine:
            return None
        senses = -np.sign(turn) * np.array([side.outward for side in sides])
        for round_side, side in enumerate(sides):
            for around in (0, 1):
                arc = _measure_arc_radius(side, stations.uv[round_side], around, senses[round_side])
                least, most = CONTACT_TOLERANCES.round_radii
                if not least * radius <= arc <= most * radius:
                    continue
                face = RoundFace(sides, locate_on_surfaces, senses, round_side, around, radius)
                if face.find_standing_ball(radius, tolerance) is not None:
                    return face
                face, spread = replace(face, radius=arc), CONTACT_TOLERANCES.round_spread * arc
                if arc > radius and face.find_standing_ball(arc, spread) is not None:
                    return face
    except GeometryError:  # what is wrong, and where, is found when all stations are solved
        return None
    return None


def _measure_arc_radius(side: SupportSurface, uv: Array, around: int, sense: float) -> float:
    """Return the radius (mm) of a circle through three points of a surface, as far around it as parameters (3, 2) are.

    It is inf unless a ball that touches the surface there has the circle's centre on its side.
    """
    at = unwrap_parameters(uv, side.primary.periods)
    at[:, 1 - around] = at[1, 1 - around]
    points = side.primary.jet(at)[0]
    first, last = points[0] - points[1], points[2] - points[1]
    normal = cross_product(first, last)
    square = float(normal @ normal)
    if square <= (CONTACT_TOLERANCES.straight_arc * float(first @ first + last @ last)) ** 2:
        return np.inf
    arm = cross_product(last * (first @ first) - first * (last @ last), normal) / (2 * square)
    inside = sense * float(side.primary.evaluate_normals(at[1:2])[0] @ arm)
    return float(np.linalg.norm(arm)) if inside > 0 else np.inf
