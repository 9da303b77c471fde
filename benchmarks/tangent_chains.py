"""Chains of edges found by OCCT's evaluation and NumPy alone: how sharp edges of a body go on in one another.

A chain goes on past a vertex if exactly one other sharp edge leaves it tangentially there, convex if the first is, and
concave if it is. Nothing here knows cqblend.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_VERTEX
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Vertex
from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape

from benchmarks.touching_balls import Array, Body, find_station

TANGENT = 5e-3
"""Angle between edges that go on tangentially in each other, rad."""
SHARP = 0.05
"""Least angle between the faces of the edges of a chain, rad."""


@dataclass(frozen=True)
class Chain:
    """Edges that follow one another, in order, and whether the last one leads to the first."""

    edges: tuple[TopoDS_Edge, ...]
    closed: bool

    def measure_lengths(self) -> list[float]:
        """Return the length of each edge, mm."""
        return [measure_length(edge) for edge in self.edges]


@dataclass(frozen=True, eq=False)
class EdgeLinks:
    """How the edges of a body follow one another."""

    body: Body

    @cached_property
    def _at_vertices(self) -> TopTools_IndexedDataMapOfShapeListOfShape:
        found = TopTools_IndexedDataMapOfShapeListOfShape()
        TopExp.MapShapesAndUniqueAncestors_s(self.body.shape, TopAbs_VERTEX, TopAbs_EDGE, found)
        return found

    def follow_chain(self, edge: TopoDS_Edge) -> Chain:
        """Return the chain through an edge."""
        row = [edge]
        for forwards in (True, False):
            here, at_last = edge, forwards
            while (following := self._find_next(here, at_last)) is not None:
                here, at_last = following
                if here.IsSame(edge):
                    return Chain(tuple(row), closed=True)
                if any(here.IsSame(other) for other in row):
                    break
                row.insert(len(row) if forwards else 0, here)
        return Chain(tuple(row), closed=_is_smoothly_closed(edge))

    def list_passed_edges(self, chain: Chain) -> list[TopoDS_Edge]:
        """Return the edges that meet a chain at vertices which two of its edges share."""
        vertices = [vertex for edge in chain.edges for vertex in _find_ends(edge)]
        shared = [one for n, one in enumerate(vertices) if any(one.IsSame(other) for other in vertices[:n])]
        edges = self.list_edges_at(shared)
        return [edge for edge in edges if not any(edge.IsSame(other) for other in chain.edges)]

    def list_edges_at(self, vertices: Sequence[TopoDS_Vertex]) -> list[TopoDS_Edge]:
        """Return the edges at some vertices, those between two of them twice."""
        return [TopoDS.Edge_s(edge) for vertex in vertices for edge in self._at_vertices.FindFromKey(vertex)]

    def _find_next(self, edge: TopoDS_Edge, at_last: bool) -> tuple[TopoDS_Edge, bool] | None:
        """Return the edge into which one goes on at one of its ends, and at which end that goes on in turn."""
        ends = _find_ends(edge)
        here = ends[at_last]
        if ends[0].IsSame(ends[1]):
            return None
        into, station = _find_direction_inwards(edge, at_last), find_station(self.body, edge, 0.5)
        found = []
        for other in map(TopoDS.Edge_s, self._at_vertices.FindFromKey(here)):
            others = _find_ends(other)
            if other.IsSame(edge) or BRep_Tool.Degenerated_s(other) or others[0].IsSame(others[1]):
                continue
            other_at_last = not others[0].IsSame(here)
            turn = _find_direction_inwards(other, other_at_last)
            if turn @ into < 0 and np.linalg.norm(np.cross(turn, into)) < TANGENT:
                its = find_station(self.body, other, 0.5)
                if its is not None and its.angle < math.pi - SHARP:
                    found.append((other, not other_at_last, its))
        if len(found) != 1 or station is None or found[0][2].convex != station.convex:
            return None
        return found[0][:2]


def find_chain_ends(chain: Chain, place: int) -> tuple[float, float]:
    """Return how far an edge of a chain is from its beginning and its end, mm; infinite in a closed one."""
    if chain.closed:
        return math.inf, math.inf
    lengths = chain.measure_lengths()
    return sum(lengths[:place]), sum(lengths[place + 1 :])


def find_end_vertices(chain: Chain) -> list[TopoDS_Vertex]:
    """Return the two vertices at which an open chain ends; none of a closed one."""
    vertices = [] if chain.closed else [vertex for edge in chain.edges for vertex in _find_ends(edge)]
    return [one for one in vertices if sum(one.IsSame(other) for other in vertices) == 1]


def measure_length(edge: TopoDS_Edge) -> float:
    """Return the length of an edge, mm."""
    return GCPnts_AbscissaPoint.Length_s(BRepAdaptor_Curve(edge), 1e-6)


def _find_ends(edge: TopoDS_Edge) -> tuple[TopoDS_Vertex, TopoDS_Vertex]:
    return TopExp.FirstVertex_s(edge), TopExp.LastVertex_s(edge)


def _find_direction_inwards(edge: TopoDS_Edge, at_last: bool) -> Array:
    """Return the direction from an end of an edge into it, a unit vector; zero where the curve is singular."""
    curve = BRepAdaptor_Curve(edge)
    point, direction = gp_Pnt(), gp_Vec()
    curve.D1(curve.LastParameter() if at_last else curve.FirstParameter(), point, direction)
    unit = np.array(direction.Coord()) / max(direction.Magnitude(), 1e-300)
    return -unit if at_last else unit


def _is_smoothly_closed(edge: TopoDS_Edge) -> bool:
    first, last = _find_ends(edge)
    return first.IsSame(last) and _find_direction_inwards(edge, False) @ _find_direction_inwards(edge, True) < -0.999
