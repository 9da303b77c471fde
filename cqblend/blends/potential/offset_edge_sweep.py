"""Potential blends in solids: the intersection curves of both sides of a sharp edge while these are offset.

The curves start from the edge itself: first both offsets grow from 0 to those of the middle of the relation, then the
curves follow the relation from there to both of its ends.
"""

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
from cqblend.blends.potential.offset_family import OffsetSide
from cqblend.blends.potential.relations import Relation
from cqblend.blends.potential.surface_family import Course
from cqblend.errors import GeometryError, SizeError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array

UNBOUNDED_DOMAINS = np.tile([-np.inf, np.inf], (4, 1))


@dataclass(frozen=True)
class EdgeSweep:
    """Intersection curves of the sides of a sharp edge, in the planes of its stations.

    Attributes
    ----------
    family_pair : FamilyPair
        Both sides, offset along the relation.
    continuation_pair : FamilyPair
        Both sides, offset from 0 to the middle of the relation.
    stations_at : callable
        The edge's stations at parameters of the edge.
    closed : bool
        Whether the edge is; then its parameters are taken modulo 1.
    domain : pair of float
        The range of t.
    edge_parameter_at : callable
        The map from t to the parameter of the edge.
    """

    family_pair: FamilyPair[OffsetSide]
    continuation_pair: FamilyPair[OffsetSide]
    stations_at: Callable[[Array], Stations]
    closed: bool = False
    domain: tuple[float, float] = (0.0, 1.0)
    edge_parameter_at: Callable[[Array], Array] = np.positive

    def _solve_curves(
        self, t: Array, x: Sequence[float] | Array
    ) -> tuple[Array, Stations, IntersectionCurves[OffsetSide]]:
        """Return parameters q (n, m, 4) at t (n,) and x (m,), ascending; the stations, and the curves there."""
        edge_t = self.edge_parameter_at(t)
        stations = self.stations_at(np.mod(edge_t, 1.0) if self.closed else edge_t)
        cut = PlaneCut(lambda _: (stations.points, stations.tangents))
        from_edge = IntersectionCurves(self.continuation_pair, cut)
        curves = IntersectionCurves(self.family_pair, cut)
        edge_q = np.concatenate(stations.uv, axis=1)
        try:
            middle_q = from_edge.continue_solutions(edge_q, stations.t, 0.0, np.array([0.0, 1.0]))[:, 1]
            q = curves.continue_solutions(middle_q, stations.t, 0.5, np.asarray(x, dtype=np.float64))
        except GeometryError as error:
            raise SizeError(error.message, kind=error.kind, place=error.place, value=error.value) from error
        return q, stations, curves

    def evaluate_points(self, t: Array, x: Array) -> Array:
        """Return the points (n, m, 3) of the curves at t (n,) and x (m,).

        Raises
        ------
        SizeError
            Where the moved sides do not meet; the message names s and the place.
        """
        order = np.argsort(x)
        q, _, _ = self._solve_curves(t, x[order])
        points = np.empty((len(t), len(x), 3))
        sorted_points = self.family_pair.evaluate_jets(q.reshape(-1, 4), np.tile(x[order], len(t)))[0][0]
        points[:, order] = sorted_points.reshape(points.shape)
        return points

    def solve_contacts(self, t: Array) -> Contacts:
        """Return the rails' points and cross derivatives at t, with their distances from the edge."""
        q, stations, curves = self._solve_curves(t, (0.0, 1.0))
        rails = q[:, 1, :2], q[:, 0, 2:]
        vectors = [
            -curves.evaluate_cross_derivatives(q[:, 1], stations.t, np.ones(len(t)), 0),
            curves.evaluate_cross_derivatives(q[:, 0], stations.t, np.zeros(len(t)), 1),
        ]
        distances = [
            np.linalg.norm(side.primary.jet(uv)[0] - stations.points, axis=1)
            for side, uv in zip(self.family_pair.families, rails, strict=True)
        ]
        return Contacts(t, stations.points, rails, np.stack(distances), np.stack(vectors))


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

    turn = compute_inward_directions(sides, project_edge_stations(np.linspace(0.02, 0.98, 25)))[2]
    if turn.max() > CONTACT_TOLERANCES.smooth_edge_sine and turn.min() < -CONTACT_TOLERANCES.smooth_edge_sine:
        raise GeometryError("the edge changes between convex and concave: its sides cannot be moved towards the blend")
    blend_sign = -float(np.sign(turn.sum()))
    first, second = (OffsetSide(side.primary, blend_sign * side.outward) for side in sides)
    size = 4 * max(relation.a, relation.b)

    def pair_along_relation(s: Curve) -> FamilyPair[OffsetSide]:
        return FamilyPair((first, second), s, (Course(s[0], None), Course(s[1], None)), UNBOUNDED_DOMAINS, size)

    return EdgeSweep(
        pair_along_relation(relation.eased),
        pair_along_relation(Curve.bezier(np.stack([np.zeros(2), relation.eased(0.5)]))),
        project_edge_stations,
        closed,
    )
