"""Plan to put a bridge into a body: its faces, their edges, and what the faces that stay lose and gain.

On a side whose face goes, rails take the place of its edges, between the vertices that these had. An opening is a new
hole in its face.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from OCP.TopoDS import TopoDS

from cqblend.blends.network.blend_plan import (
    EdgeRole,
    EdgeUse,
    FacePlan,
    NewEdge,
    PlannedVertex,
    SolidPlan,
    StripPlan,
    reverse_path,
)
from cqblend.blends.network.bridge_pairing import RailPairing
from cqblend.blends.network.bridge_ribbons import BridgeCell
from cqblend.brep.selection.bridge_sides import BridgeSide
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.rail_edges import evaluate_directions, find_seam_crossings, plan_rail_edge
from cqblend.brep.shell_editing.realigned_spheres import plan_sphere_boundary
from cqblend.brep.shell_editing.seam_cuts import SeamCrossings, cut_seams
from cqblend.brep.shell_editing.strip_placement import PlacedStrip
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import locate_vertex
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class PlacedCell:
    """A cell of a bridge, with its surface."""

    cell: BridgeCell
    placed: PlacedStrip


@dataclass(frozen=True)
class _RailStop:
    """A place on a rail at which an edge of it ends: t, a share of the loop, and the vertex there."""

    t: float
    vertex: PlannedVertex


@dataclass
class _FaceChanges:
    """What becomes of faces, collected from all cells."""

    pieces: dict[int, dict[int, tuple[()]]] = field(default_factory=dict)
    added: dict[int, list[EdgeUse]] = field(default_factory=dict)
    crossings: dict[int, list[SeamCrossings]] = field(default_factory=dict)
    realigned: dict[int, FacePlan] = field(default_factory=dict)


def plan_bridge(
    index: SolidIndex, sides: tuple[BridgeSide, BridgeSide], pairing: RailPairing, cells: Sequence[PlacedCell]
) -> SolidPlan:
    """Plan to put the cells of a bridge between its sides.

    Raises
    ------
    SizeError
        If seams of a face cannot be cut.
    """
    planner = _BridgePlanner(index, sides, pairing, cells)
    strips = planner.plan_strips()
    changes = planner.changes
    faces = []
    for number in dict.fromkeys([*changes.pieces, *changes.added]):
        pieces = dict(changes.pieces.get(number, {}))
        cut = cut_seams(changes.crossings[number], index) if number in changes.crossings else {}
        faces.append(FacePlan(number, {**pieces, **cut}, tuple(changes.added.get(number, ()))))
    faces += changes.realigned.values()
    gone = tuple(side.gone for side in sides if side.gone)
    return SolidPlan((replace(strips[0], removed_faces=gone), *strips[1:]), tuple(faces))


class _BridgePlanner:
    """Plans the edges of a bridge, each once, and collects what they do to faces."""

    def __init__(
        self,
        index: SolidIndex,
        sides: tuple[BridgeSide, BridgeSide],
        pairing: RailPairing,
        cells: Sequence[PlacedCell],
    ) -> None:
        self.index, self.sides, self.pairing, self.cells = index, sides, pairing, cells
        self.changes = _FaceChanges()
        self._kept = [self._list_kept_stops(side) for side in (0, 1)]
        for side in sides:
            for edge, face in zip(side.edges, side.list_supports(index), strict=True):
                if edge:
                    self.changes.pieces.setdefault(face, {})[edge] = ()

    def _list_kept_stops(self, side: int) -> list[_RailStop]:
        """Return the vertices of the input on one rail, in the order of t in [0, 1)."""
        own, positions = self.sides[side], self.pairing.positions[side]
        stops = []
        for number, start in zip(own.vertices, own.loop.starts.tolist(), strict=False):
            if number:
                s = positions[0] + np.mod(start - positions[0], own.loop.length)
                t = float(np.interp(s, positions, self.pairing.anchors))
                point = locate_vertex(TopoDS.Vertex_s(self.index.vertices[number]))
                stops.append(_RailStop(t % 1.0, PlannedVertex(point, number)))
        return sorted(stops, key=lambda stop: stop.t)

    def plan_strips(self) -> list[StripPlan]:
        """Return the plans of all cells, which share the vertices and the edges between them."""
        count = len(self.cells)
        corners = [[self._plan_corner(k, side) for side in (0, 1)] for k in range(count)]
        rails = [
            [self._plan_rail(k, side, (corners[k][side], corners[(k + 1) % count][side])) for side in (0, 1)]
            for k in range(count)
        ]
        if count == 1:
            seam = self._plan_seam((corners[0][0], corners[0][1]))
            sections = [(EdgeUse(seam), EdgeUse(seam))]
        else:
            starts = [EdgeUse(self._plan_section(k - 1, k, (corners[k][0], corners[k][1]))) for k in range(count)]
            sections = [(starts[k], starts[(k + 1) % count]) for k in range(count)]
        return [
            self._make_strip(one.placed, (first, second), *ends)
            for one, (first, second), ends in zip(self.cells, rails, sections, strict=True)
        ]

    def _make_strip(
        self,
        placed: PlacedStrip,
        rails: tuple[tuple[NewEdge, ...], tuple[NewEdge, ...]],
        start: EdgeUse,
        stop: EdgeUse,
    ) -> StripPlan:
        """Return the plan of one face, between the sections at which it starts and stops."""
        first, second = rails
        boundary = (
            *map(EdgeUse, first),
            stop,
            *reverse_path([EdgeUse(edge) for edge in second]),
            start.reverse(),
        )
        is_ring = start.edge is stop.edge
        ends = () if is_ring else tuple((use.edge,) for use in (start, stop) if isinstance(use.edge, NewEdge))
        return StripPlan(
            (),
            placed.face_numbers,
            placed.surface,
            boundary,
            rails,
            end_edges=ends,
            is_mirrored=placed.strip.is_mirrored,
        )

    def _plan_corner(self, k: int, side: int) -> PlannedVertex:
        """Return the vertex at which the rail of a cell starts: one of the input, or a new one."""
        cell, placed = self.cells[k].cell, self.cells[k].placed
        point = placed.rail_curves[side](np.array([placed.domain[0]]))[0]
        for stop in self._kept[side]:
            apart = abs((stop.t - cell.domain[0] + 0.5) % 1.0 - 0.5) * self.sides[side].loop.length
            if apart <= SHELL_EDIT_TOLERANCES.at_seam:
                return replace(stop.vertex, gap=float(np.linalg.norm(point - stop.vertex.point)))
        return PlannedVertex(point)

    def _plan_rail(self, k: int, side: int, corners: tuple[PlannedVertex, PlannedVertex]) -> tuple[NewEdge, ...]:
        """Plan the edges of one rail of a cell, which end at vertices of the input, and at seams."""
        cell, placed = self.cells[k].cell, self.cells[k].placed
        number, own = placed.face_numbers[side], self.sides[side]
        low, high = placed.domain
        stops = []
        for stop in self._kept[side]:
            for lap in (0, 1):
                share = (stop.t + lap - cell.domain[0]) / (cell.domain[1] - cell.domain[0])
                margin = SHELL_EDIT_TOLERANCES.at_seam / own.loop.length
                if margin < share < 1 - margin:
                    stops.append(self._find_on_rail(placed, side, low + share * (high - low), stop.vertex))
        crossed = []
        if placed.spheres[side] is None:
            for s in find_seam_crossings(placed, side).tolist():
                point = placed.rail_curves[side](np.array([s]))[0]
                known = [*corners, *(stop.vertex for stop in stops)]
                if all(np.linalg.norm(point - one.point) > SHELL_EDIT_TOLERANCES.at_seam for one in known):
                    crossed.append(_RailStop(s, PlannedVertex(point)))
        stops = sorted([*stops, *crossed], key=lambda stop: stop.t)
        parameters = [low, *(stop.t for stop in stops), high]
        vertices = [corners[0], *(stop.vertex for stop in stops), corners[1]]
        edges = tuple(
            plan_rail_edge(placed, side, (vertices[i], vertices[i + 1]), (parameters[i], parameters[i + 1]))
            for i in range(len(parameters) - 1)
        )
        self._change_face(placed, side, edges)
        is_opening = not own.gone
        if is_opening and any(placed.sides[side].face_primary.periods) and placed.spheres[side] is None:
            marks = [_RailStop(low, corners[0]), *crossed]
            directions = evaluate_directions(placed, side, np.array([mark.t for mark in marks]))
            at_seams = SeamCrossings(placed.sides[side].face, [mark.vertex for mark in marks], directions, ())
            self.changes.crossings.setdefault(number, []).append(at_seams)
        return edges

    def _change_face(self, placed: PlacedStrip, side: int, edges: tuple[NewEdge, ...]) -> None:
        """Record what rail edges do to the face beside them."""
        number, sphere = placed.face_numbers[side], placed.spheres[side]
        runs_with_boundary = (placed.sides[side].outward > 0) == (side == 0)
        path = list(map(EdgeUse, edges))
        uses = path if runs_with_boundary else reverse_path(path)
        if sphere is None:
            self.changes.added.setdefault(number, []).extend(uses)
            return
        into_blend: Array = evaluate_directions(placed, side, np.array([placed.domain[0]]))[0]
        boundary = plan_sphere_boundary(sphere, uses[0], into_blend)
        self.changes.pieces.pop(number, None)
        self.changes.realigned[number] = FacePlan(number, added=boundary, surface=sphere)

    def _find_on_rail(self, placed: PlacedStrip, side: int, near: float, vertex: PlannedVertex) -> _RailStop:
        """Return where a rail passes a vertex of the input."""
        curve, s = placed.rail_curves[side], near
        for _ in range(SHELL_EDIT_TOLERANCES.foot_iterations):
            at = np.array([s])
            rate = curve(at, 1)[0]
            s += float((vertex.point - curve(at)[0]) @ rate / (rate @ rate))
        gap = float(np.linalg.norm(curve(np.array([s]))[0] - vertex.point))
        return _RailStop(s, replace(vertex, gap=gap))

    def _plan_section(self, before: int, after: int, corners: tuple[PlannedVertex, PlannedVertex]) -> NewEdge:
        """Plan the edge between two cells: the end section of the one before."""
        first, second = self.cells[before].placed, self.cells[after].placed
        section = first.strip.locate_section(first.domain[1])
        pcurves = (
            first.plan_pcurve(section.make_pcurve(first.domain[1])),
            second.plan_pcurve(section.make_pcurve(second.domain[0])),
        )
        is_smooth = self.cells[after].cell.smooth_ends[0]
        role: EdgeRole = "section" if is_smooth else "mitre"
        return NewEdge(role, section.curve, section.span, corners, pcurves, int(is_smooth))

    def _plan_seam(self, corners: tuple[PlannedVertex, PlannedVertex]) -> NewEdge:
        """Plan the seam in which a bridge of one cell meets itself."""
        placed = self.cells[0].placed
        low, high = placed.domain
        section = placed.strip.locate_section(low)
        pcurve = placed.plan_pcurve(section.make_pcurve(high), section.make_pcurve(low))
        return NewEdge("seam", section.curve, section.span, corners, (pcurve,))
