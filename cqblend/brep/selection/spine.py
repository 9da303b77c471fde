"""Describe blended edges as a spine: stations at fractions t of its arc length, also past the ends of an open edge.

A spine is one edge, or a chain of edges, between the same two faces. It has the sense of the first face's boundary,
seen from outside, so that the first face lies to its left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.blends.contacts.contact_solver import Stations
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.measurement.edge_samples import read_edge_curve
from cqblend.brep.measurement.edge_sides import read_pcurve
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.topology import find_end_vertices, orient_forward
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import normalise_vectors, to_tangent_coordinates


@dataclass(frozen=True)
class _ArcLengthTable:
    """Parameters of one edge of a spine by its arc length (mm), from where the spine enters the edge; (n,) each."""

    length: float
    arc_lengths: Array
    parameters: Array
    slopes: Array
    """d parameter / d arc length."""

    def find_parameters(self, arc_length: Array) -> Array:
        """Return edge parameters at arc lengths, by cubic Hermite interpolation of the table."""
        i = np.clip(np.searchsorted(self.arc_lengths, arc_length, side="right") - 1, 0, len(self.arc_lengths) - 2)
        h = self.arc_lengths[i + 1] - self.arc_lengths[i]
        x = (arc_length - self.arc_lengths[i]) / h
        p0, p1, m0, m1 = self.parameters[i], self.parameters[i + 1], h * self.slopes[i], h * self.slopes[i + 1]
        return p0 + x * (m0 + x * (3 * (p1 - p0) - 2 * m0 - m1 + x * (m0 + m1 - 2 * (p1 - p0))))


@dataclass(frozen=True)
class EdgeSpine:
    """Stations along a chain of edges between two faces."""

    edges: list[TopoDS_Edge]
    closed: bool

    @cached_property
    def tables(self) -> list[_ArcLengthTable]:
        """The parameters of each edge by arc length."""
        return [_tabulate_edge(edge, curve) for edge, curve in zip(self.edges, self._curves, strict=True)]

    @cached_property
    def _curves(self) -> list[CurveEvaluator]:
        """The curve of each edge in space."""
        return [read_edge_curve(edge) for edge in self.edges]

    @cached_property
    def _pcurves(self) -> dict[TopoDS_Face, list[CurveEvaluator]]:
        """The pcurves of the edges on faces that were asked for."""
        return {}

    @property
    def length(self) -> float:
        """Arc length (mm)."""
        return sum(table.length for table in self.tables)

    @property
    def vertices(self) -> tuple[TopoDS_Vertex, TopoDS_Vertex]:
        """The vertices at t = 0 and t = 1."""
        return find_end_vertices(self.edges[0])[0], find_end_vertices(self.edges[-1])[1]

    def locate_parameters(self, t: Array) -> tuple[Array, Array]:
        """Return which edge each t in [0, 1] is on, and its parameter there."""
        if len(self.tables) == 1:
            (table,) = self.tables
            return np.zeros(len(t), dtype=int), table.find_parameters(np.clip(t, 0.0, 1.0) * table.length)
        stops = np.cumsum([table.length for table in self.tables])
        arc_length = np.clip(t, 0.0, 1.0) * stops[-1]
        number = np.minimum(np.searchsorted(stops, arc_length, side="right"), len(self.tables) - 1)
        parameter = np.empty(len(t))
        for i, table in enumerate(self.tables):
            is_on_edge = number == i
            parameter[is_on_edge] = table.find_parameters(arc_length[is_on_edge] - (stops[i] - table.length))
        return number, parameter

    def evaluate_points(self, t: Array) -> Array:
        """Return points of the edge's 3D curve (n, 3) at t in [0, 1]."""
        return self._evaluate_with_tangents(*self.locate_parameters(t))[0]

    def _evaluate_with_tangents(self, number: Array, parameter: Array) -> tuple[Array, Array]:
        """Return points and unit tangents (n, 3) in the spine's sense, at parameters of edges given by index."""
        points, tangents = _evaluate_each(self._curves, number, parameter, order=1)
        senses = np.array([-1.0 if edge.Orientation() == TopAbs_REVERSED else 1.0 for edge in self.edges])
        return points, normalise_vectors(tangents) * senses[number, None]

    def evaluate_pcurves(self, t: Array, face: TopoDS_Face) -> Array:
        """Return the face's own parameters (n, 2) of the edge at t in [0, 1], as its pcurves have them."""
        return self._evaluate_pcurves(*self.locate_parameters(t), face)

    def _evaluate_pcurves(self, number: Array, parameter: Array, face: TopoDS_Face) -> Array:
        if face not in self._pcurves:
            pairs = (read_pcurve(orient_forward(edge), face) for edge in self.edges)
            self._pcurves[face] = [CurveEvaluator(pcurve) for pcurve, _, _ in pairs]
        return _evaluate_each(self._pcurves[face], number, parameter, order=0)[0]

    @cached_property
    def circle(self) -> tuple[Array, float] | None:
        """Centre (3,) and radius of the circle that the spine is an arc of, None if there is none."""
        curve = self._curves[0]
        if len(self.edges) == 1 and (curve.is_straight or curve.circle is not None):
            return curve.circle
        t = np.linspace(0, 1, SELECT_TOLERANCES.circle_samples)
        points = self.evaluate_points(t[: -1 if self.closed else None])
        middle = points.mean(axis=0)
        axes = np.linalg.svd(points - middle)[2]
        size = np.abs(points - middle).max()
        if np.abs((points - middle) @ axes[2]).max() > SELECT_TOLERANCES.circle * size:
            return None
        flat = (points - middle) @ axes[:2].T
        system = np.column_stack([2 * flat, np.ones(len(flat))])
        solution, _, rank, _ = np.linalg.lstsq(system, (flat**2).sum(1))
        if rank < 3:
            return None
        radius = float(np.sqrt(solution[2] + solution[:2] @ solution[:2]))
        if np.abs(np.linalg.norm(flat - solution[:2], axis=1) - radius).max() > SELECT_TOLERANCES.circle * radius:
            return None
        return middle + solution[:2] @ axes[:2], radius

    def measure_arc_angle(self) -> float | None:
        """Return the angle (rad) of the spine as an arc of a circle, None if it is no such arc."""
        if self.circle is None:
            return None
        turn = self.length / self.circle[1]
        if self.closed:
            return 2 * np.pi if abs(turn - 2 * np.pi) < SELECT_TOLERANCES.full_turn else None
        return float(turn) if turn < 2 * np.pi else None

    def locate_stations(self, t: Array, sides: tuple[SupportFace, SupportFace]) -> Stations:
        """Return stations at t; those past the ends of an open edge lie on its tangents.

        Their parameters on the support surfaces are first-order estimates, which the contact solver corrects.
        """
        number, parameter = self.locate_parameters(t)
        point, direction = self._evaluate_with_tangents(number, parameter)
        past = self._measure_overshoot(t)
        uv = []
        for side in sides:
            found = side.to_working_parameters(self._evaluate_pcurves(number, parameter, side.face))
            if past.any():
                jet = side.primary.jet(found)
                found = found + to_tangent_coordinates(jet, direction * past[:, None])
            uv.append(found)
        return Stations(t, point + direction * past[:, None], direction, (uv[0], uv[1]))

    def extend_along_circle(self, stations: Stations, sides: tuple[SupportFace, SupportFace]) -> Stations:
        """Move those of :meth:`locate_stations` that are past the ends of an arc of a circle onto that circle.

        So an arc is extended as an arc, and a blend along it remains a surface of revolution.
        """
        past = self._measure_overshoot(stations.t)
        if not past.any() or self.circle is None:
            return stations
        centre, radius = self.circle
        angle, direction = (past / radius)[:, None], stations.tangents
        arm = stations.points - direction * past[:, None] - centre
        cos, sin = np.cos(angle), np.sin(angle)
        point = np.where(angle == 0, stations.points, centre + cos * arm + radius * sin * direction)
        uv = [
            found + to_tangent_coordinates(side.primary.jet(found), point - stations.points)
            for side, found in zip(sides, stations.uv, strict=True)
        ]
        return Stations(stations.t, point, cos * direction - sin * arm / radius, (uv[0], uv[1]))

    def _measure_overshoot(self, t: Array) -> Array:
        """Return how far (mm, signed) parameters are past the ends."""
        return np.asarray(np.where(t < 0, t, np.maximum(t - 1, 0.0)) * self.length)


def _evaluate_each(curves: Sequence[CurveEvaluator], number: Array, parameter: Array, order: int) -> Array:
    """Return points and derivatives (order + 1, n, d) at parameters (n,) of curves given by index (n,)."""
    if len(curves) == 1:
        return curves[0](parameter, order).swapaxes(1, 2)
    out = np.empty((order + 1, len(parameter), curves[0].dimension))
    for i, curve in enumerate(curves):
        is_on_curve = number == i
        if is_on_curve.any():
            out[:, is_on_curve] = curve(parameter[is_on_curve], order).swapaxes(1, 2)
    return out


def _tabulate_edge(edge: TopoDS_Edge, curve: CurveEvaluator) -> _ArcLengthTable:
    """Tabulate an edge's arc length, by Simpson's rule on the speed of its curve."""
    first, last = BRep_Tool.Range_s(edge)
    parameter = np.linspace(first, last, 2 * SELECT_TOLERANCES.speed_samples - 1)
    speed = np.sqrt((curve(parameter, 1)[1] ** 2).sum(axis=0))
    if edge.Orientation() == TopAbs_REVERSED:
        parameter, speed = parameter[::-1], speed[::-1]
    step = (last - first) / (SELECT_TOLERANCES.speed_samples - 1)
    simpson = step / 6 * (speed[:-2:2] + 4 * speed[1::2] + speed[2::2])
    arc = np.append(0.0, np.cumsum(simpson))
    sign = np.sign(parameter[-1] - parameter[0])
    return _ArcLengthTable(float(arc[-1]), arc, parameter[::2], sign / np.maximum(speed[::2], 1e-9 * speed.max()))
