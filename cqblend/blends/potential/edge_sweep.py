"""Potential blends in solids: curves that set out from a sharp edge while both of its sides are moved."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cqblend.blends.contacts.contact_solver import (
    Contacts,
    Stations,
    SupportSurface,
    compute_inward_directions,
    project_to_intersection,
)
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.blends.potential.continuation import IntersectionCurves, PlaneCut
from cqblend.blends.potential.family_pair import FamilyPair
from cqblend.blends.potential.relations import Relation
from cqblend.blends.potential.surface_family import Course, OffsetFamily
from cqblend.errors import GeometryError, SizeError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array

UNBOUNDED_DOMAINS = np.tile([-np.inf, np.inf], (4, 1))


@dataclass(frozen=True)
class EdgeSweep:
    """Curves that set out from a sharp edge, cut by its stations' planes; solved anew wherever they are asked for.

    ``continuation_pair`` is how both sides are moved from 0 to where the relation is half-way; ``stations_at`` returns
    the edge's stations at the edge's own t, which ``edge_parameter_at`` tells. On a ``closed`` edge, that is taken
    modulo 1.
    """

    family_pair: FamilyPair
    continuation_pair: FamilyPair
    stations_at: Callable[[Array], Stations]
    closed: bool = False
    domain: tuple[float, float] = (0.0, 1.0)
    edge_parameter_at: Callable[[Array], Array] = np.positive

    def _solve_curves(self, t: Array, x: Sequence[float] | Array) -> tuple[Array, Stations, IntersectionCurves]:
        """Return parameters (n, m, 4) at t (n,) and x (m,), ascending; the stations, and the curves there."""
        t = self.edge_parameter_at(t)
        at = self.stations_at(np.mod(t, 1.0) if self.closed else t)
        phase = PlaneCut(lambda _: (at.points, at.tangents))
        ramp, curves = IntersectionCurves(self.continuation_pair, phase), IntersectionCurves(self.family_pair, phase)
        try:
            half = ramp.continue_solutions(np.concatenate(at.uv, axis=1), at.t, 0.0, np.array([0.0, 1.0]))[:, 1]
            return curves.continue_solutions(half, at.t, 0.5, np.asarray(x, dtype=np.float64)), at, curves
        except GeometryError as error:
            raise SizeError(error.message, kind=error.kind, place=error.place, value=error.value) from error

    def evaluate_points(self, t: Array, x: Array) -> Array:
        """Return the points (n, m, 3) of the curves at t (n,) and x (m,).

        Raises
        ------
        SizeError
            Where the moved sides do not meet; the message names s and the place.
        """
        order = np.argsort(x)
        q, _, _ = self._solve_curves(t, x[order])
        found = np.empty((len(t), len(x), 3))
        points = self.family_pair.evaluate_jets(q.reshape(-1, 4), np.tile(x[order], len(t)))[0][0]
        found[:, order] = points.reshape(found.shape)
        return found

    def solve_contacts(self, t: Array) -> Contacts:
        """Return the rails' points and cross derivatives at t, with their distances from the edge."""
        q, at, curves = self._solve_curves(t, (0.0, 1.0))
        uv = q[:, 1, :2], q[:, 0, 2:]
        vectors = [
            -curves.evaluate_cross_derivatives(q[:, 1], at.t, np.ones(len(t)), 0),
            curves.evaluate_cross_derivatives(q[:, 0], at.t, np.zeros(len(t)), 1),
        ]
        primaries = (family.primary for family in self.family_pair.families)
        reach = [
            np.linalg.norm(primary.jet(one)[0] - at.points, axis=1) for primary, one in zip(primaries, uv, strict=True)
        ]
        return Contacts(t, at.points, uv, np.stack(reach), np.stack(vectors))


def sweep_from_edge(
    sides: tuple[SupportSurface, SupportSurface],
    stations: Callable[[Array], Stations],
    length: float,
    relation: Relation,
    *,
    closed: bool,
) -> EdgeSweep:
    """Return the curves in which two sides of an edge meet while they are moved along their normals.

    They move to where the blend will be: into the material at a convex edge, out of it at a concave one. Side 1 by a
    moves the rail on side 2, and conversely.

    Raises
    ------
    GeometryError
        The edge is convex here and concave there.
    """

    def project_edge_stations(t: Array) -> Stations:
        return project_to_intersection(sides, stations(t), length)

    turn = compute_inward_directions(sides, project_edge_stations(np.linspace(0.02, 0.98, 25)))[2]
    if turn.max() > CONTACT_TOLERANCES.smooth_edge_sine and turn.min() < -CONTACT_TOLERANCES.smooth_edge_sine:
        raise GeometryError("the edge changes between convex and concave: its sides cannot be moved towards the blend")
    into = -float(np.sign(turn.sum()))
    first, second = (OffsetFamily(side.primary, (np.positive,), sign=into * side.outward) for side in sides)
    size = 4 * max(relation.a, relation.b)

    def pair_along_relation(s: Curve) -> FamilyPair:
        return FamilyPair((first, second), s, (Course(s[0], None), Course(s[1], None)), UNBOUNDED_DOMAINS, size)

    return EdgeSweep(
        pair_along_relation(relation.eased),
        pair_along_relation(Curve.bezier(np.stack([np.zeros(2), relation.eased(0.5)]))),
        project_edge_stations,
        closed,
    )
