"""Potential blends in solids: the intersection curves of both sides of a sharp edge while these are offset.

Every curve starts from the edge itself: both offsets grow in proportion, from 0 to the amounts that the relation has at
its x. So all stations along and all x are continued together, mostly in one step. What was solved is remembered, and
points between known ones are solved from starts that are interpolated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from cqblend.blends.contacts.contact_solver import (
    Contacts,
    Stations,
    SupportSurface,
    compute_inward_directions,
    project_to_intersection,
)
from cqblend.blends.contacts.surface_normals import differentiate_normal
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.blends.potential.continuation import (
    IntersectionCurves,
    LinearisedSystem,
    PlaneCut,
    map_rates_to_space,
)
from cqblend.blends.potential.family_pair import describe_offsets
from cqblend.blends.potential.relations import Relation
from cqblend.blends.potential.smooth_stations import smooth_stations, turns_steadily
from cqblend.blends.potential.solved_curves import SolvedCurves
from cqblend.blends.potential.tolerances import POTENTIAL_TOLERANCES
from cqblend.errors import GeometryError, SizeError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.primary_surface import Primary

RAIL_X = np.array([0.0, 1.0])
"""The x of the rails, that on side 2 first."""


@dataclass(frozen=True)
class OffsetPair:
    """Both sides of an edge at n places, each offset along its unit normals by a share x of amounts of its own.

    Attributes
    ----------
    primaries : tuple of Primary
        Side 1 and side 2.
    signs : tuple of float
        +1 where unit normals point to the side of the blend, else -1.
    amounts, rates : array of shape (n, 2)
        Offsets (mm) of both sides at x = 1, and their derivatives by the parameter that jets are differentiated by.
    scale : float
        The size of the blend (mm).
    """

    primaries: tuple[Primary, Primary]
    signs: tuple[float, float]
    amounts: Array
    rates: Array
    scale: float

    def evaluate_jets(self, q: Array, x: Array) -> tuple[Array, Array]:
        """Return S, Su, Sv, and the derivative by ``rates``, (4, n, 3), of both offset sides at (n, 4)."""
        count = len(q)
        base = np.concatenate(
            [primary.jet(q[:, 2 * i : 2 * i + 2]) for i, primary in enumerate(self.primaries)], axis=1
        )
        normals = differentiate_normal(base)
        amounts, rates = ((given * self.signs).T.reshape(-1, 1) for given in (x[:, None] * self.amounts, self.rates))
        out = np.empty((4, 2 * count, 3))
        for k, normal in enumerate(normals):
            out[k] = base[k] + amounts * normal
        out[3] = rates * normals[0]
        return out[:, :count], out[:, count:]

    def describe_place(self, q: Array, x: Array, row: int) -> str:
        """Describe one of the places q (n, 4) at x (n,) for messages: both offsets, and the coordinates."""
        return describe_offsets(x[row] * self.amounts[row], self.evaluate_jets(q, x)[0][0, row])


@dataclass(frozen=True)
class _SectionGrid:
    """The problem of n stations and m values of x, n * m places in all, station by station."""

    pair: OffsetPair
    stations: Stations
    count: int

    @property
    def edge_q(self) -> Array:
        """The parameters (n * m, 4) of the edge at all places."""
        return np.concatenate(self.stations.uv, axis=1).repeat(self.count, axis=0)

    @property
    def t(self) -> Array:
        """The parameters (n * m,) of the edge at all places."""
        return self.stations.t.repeat(self.count)

    @property
    def curves(self) -> IntersectionCurves[OffsetPair]:
        """The equations at all places."""
        stations = self.stations
        planes = stations.points.repeat(self.count, axis=0), stations.tangents.repeat(self.count, axis=0)
        return IntersectionCurves(self.pair, PlaneCut(lambda _: planes))

    def select_stations(self, index: Array) -> _SectionGrid:
        """Return the problem of some stations, by a mask (n,)."""
        stations, places = self.stations, index.repeat(self.count)
        chosen = Stations(
            stations.t[index],
            stations.points[index],
            stations.tangents[index],
            (stations.uv[0][index], stations.uv[1][index]),
        )
        pair = replace(self.pair, amounts=self.pair.amounts[places], rates=self.pair.rates[places])
        return _SectionGrid(pair, chosen, self.count)

    def linearise_system(self, q: Array) -> LinearisedSystem:
        """Return the equations at parameters (n * m, 4), with all offsets at their amounts."""
        return self.curves.linearise_system(q, self.t, np.ones(len(q)))

    def solve_from_edge(self) -> Array:
        """Return the parameters (n * m, 4) of all places, continued from the edge.

        Raises
        ------
        SizeError
            Where the moved sides do not meet, touch, or are folded; the message names s and the place.
        """
        curves = replace(self.curves, pair=replace(self.pair, rates=self.pair.amounts))
        try:
            q = curves.follow_solutions(self.edge_q, self.t, 0.0, 1.0)
            curves.check_regularity(q, np.ones(len(q)))
        except GeometryError as error:
            raise SizeError(error.message, kind=error.kind, place=error.place, value=error.value) from error
        return q

    def solve_from_start(self, start: Array) -> tuple[Array, LinearisedSystem, Array]:
        """Return the parameters (n * m, 4) next to a start, the equations there, and which stations (n,) to believe.

        These have converged, to solutions much nearer to the start than to the edge: on its own branch.
        """
        q, converged = self.curves.correct_solutions(start, self.t, np.ones(len(start)))
        system = self.linearise_system(q)
        moved, corrected = (system.estimate_displacement(q - other) for other in (self.edge_q, start))
        accepted = converged & (corrected <= POTENTIAL_TOLERANCES.start_correction * moved)
        return q, system, np.asarray(accepted.reshape(-1, self.count).all(axis=1))


@dataclass(frozen=True)
class EdgeSweep:
    """Intersection curves of the sides of a sharp edge, in the planes of its stations.

    A value: what it remembers only makes it faster. Those that :func:`dataclasses.replace` makes of it, over another
    domain or at another speed, share its memory.

    Attributes
    ----------
    primaries : tuple of Primary
        Both sides.
    signs : tuple of float
        +1 where their unit normals point to the side of the blend, else -1.
    relation : Curve
        The offsets (mm) of both sides at x in [0, 1].
    stations_at : callable
        The edge's stations at parameters of the edge.
    closed : bool
        Whether the edge is; then its parameters are taken modulo 1.
    domain : pair of float
        The range of t.
    edge_parameter_at : callable
        The map from t to the parameter of the edge.
    """

    primaries: tuple[Primary, Primary]
    signs: tuple[float, float]
    relation: Curve
    stations_at: Callable[[Array], Stations]
    closed: bool = False
    domain: tuple[float, float] = (0.0, 1.0)
    edge_parameter_at: Callable[[Array], Array] = np.positive
    _solved: dict[tuple[float, ...], SolvedCurves] = field(default_factory=dict, init=True, repr=False, compare=False)

    def evaluate_points(self, t: Array, x: Array) -> Array:
        """Return the points (n, m, 3) of the curves at t (n,) and x (m,).

        Raises
        ------
        SizeError
            Where the moved sides do not meet; the message names s and the place.
        """
        return self._solve_grid(t, x)[2].jets[0][0].reshape(len(t), len(x), 3)

    def solve_contacts(self, t: Array) -> Contacts:
        """Return the rails' points and cross derivatives at t, with their distances from the edge."""
        grid, q, system = self._solve_grid(t, RAIL_X)
        rates = system.differentiate_solutions()
        if rates is None:
            raise SizeError(grid.curves.make_lost_error(q, np.ones(len(q)), 0).message)
        on_second, on_first = slice(0, None, 2), slice(1, None, 2)
        vectors = [
            -map_rates_to_space(rates, system.jets, 0)[on_first],
            map_rates_to_space(rates, system.jets, 1)[on_second],
        ]
        rails = [system.jets[0][0, on_first], system.jets[1][0, on_second]]
        edge_points = grid.stations.points
        distances = [np.linalg.norm(points - edge_points, axis=1) for points in rails]
        uv = q[on_first, :2], q[on_second, 2:]
        return Contacts(t, edge_points, uv, np.stack(distances), np.stack(vectors))

    def _solve_grid(self, t: Array, x: Array) -> tuple[_SectionGrid, Array, LinearisedSystem]:
        """Return the problem at t (n,) and x (m,), the solutions (n * m, 4), and the equations there."""
        edge_t = self.edge_parameter_at(t)
        edge_t = np.mod(edge_t, 1.0) if self.closed else edge_t
        grid = self._pose_grid(self.stations_at(edge_t), x)
        solved = self._solved.setdefault(tuple(x.tolist()), SolvedCurves(self.closed))
        displacements, is_near = solved.predict_displacements(edge_t)
        edge_q = grid.edge_q.reshape(len(t), len(x), 4)
        q = edge_q + (displacements if is_near.any() else 0.0)
        missing = ~is_near
        system = None
        if is_near.any():
            near = grid if is_near.all() else grid.select_stations(is_near)
            found, system, accepted = near.solve_from_start(q[is_near].reshape(-1, 4))
            q[is_near] = found.reshape(-1, len(x), 4)
            missing[is_near] = ~accepted
        if missing.any():
            rest = grid if missing.all() else grid.select_stations(missing)
            q[missing] = rest.solve_from_edge().reshape(-1, len(x), 4)
            system = None
        solved.add_displacements(edge_t, q - edge_q)
        places = q.reshape(-1, 4)
        return grid, places, grid.linearise_system(places) if system is None else system

    def _pose_grid(self, stations: Stations, x: Array) -> _SectionGrid:
        amounts, rates = self.relation.jet(x, 1)
        count = len(stations.t)
        scale = 4 * float(np.abs(self.relation(RAIL_X)).max())
        pair = OffsetPair(self.primaries, self.signs, np.tile(amounts, (count, 1)), np.tile(rates, (count, 1)), scale)
        return _SectionGrid(pair, stations, len(x))


def sweep_from_edge(
    sides: tuple[SupportSurface, SupportSurface],
    stations: Callable[[Array], Stations],
    scale: float,
    relation: Relation,
    *,
    closed: bool,
) -> EdgeSweep:
    """Return the curves in which the two sides of an edge meet while they are offset along a relation.

    Offsets are to the side of the blend: into the material at a convex edge, out of it at a concave one. The offset of
    side 1, by a, determines the rail on side 2, and vice versa. Residuals of the projection of ``stations`` onto both
    sides are relative to ``scale`` (mm).

    Raises
    ------
    GeometryError
        The edge is convex in one place and concave in another.
    """

    def project_edge_stations(t: Array) -> Stations:
        return project_to_intersection(sides, stations(t), scale)

    spread = project_edge_stations(np.linspace(0.02, 0.98, 25))
    turn = compute_inward_directions(sides, spread)[2]
    if turn.max() > CONTACT_TOLERANCES.smooth_edge_sine and turn.min() < -CONTACT_TOLERANCES.smooth_edge_sine:
        raise GeometryError("the edge changes between convex and concave: its sides cannot be moved towards the blend")
    blend_sign = -float(np.sign(turn.sum()))
    first, second = sides
    signs = blend_sign * first.outward, blend_sign * second.outward
    primaries = first.primary, second.primary
    if turns_steadily(spread.tangents):
        return EdgeSweep(primaries, signs, relation.eased, project_edge_stations, closed)
    stations_at = smooth_stations(project_edge_stations, primaries, closed=closed)
    return EdgeSweep(primaries, signs, relation.eased, stations_at, closed)
