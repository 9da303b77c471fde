"""The boundary of one face in its parameter plane: where a path in that plane first crosses it, and what is cut off.

A face is read FORWARD, so that its inside lies to the left of every use of an edge. Uses are numbered, all wires
together. Poles bound it, too, but nothing crosses them.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepTools import BRepTools_WireExplorer
from OCP.TopAbs import TopAbs_FORWARD, TopAbs_WIRE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.measurement.edge_sides import read_pcurve
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import explore_subshapes, find_end_vertices, orient_forward
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class BoundaryMark:
    """A point of a face's boundary, at a parameter of an edge: inside a use of it, or at the vertex where it stops."""

    use: int
    parameter: float
    vertex: TopoDS_Vertex | None = None


class BoundaryCrossing(NamedTuple):
    """Where a path crosses a boundary: how far along the path, in points of it, and on which use at which parameter."""

    share: float
    use: int
    parameter: float


class FaceBoundary:
    """The uses of edges around a face, in order, with their curves in its parameter plane."""

    def __init__(self, face: TopoDS_Face) -> None:
        self.face = TopoDS.Face_s(orient_forward(face))
        self.uses: list[TopoDS_Edge] = []
        self._following: list[int] = []
        for wire in explore_subshapes(self.face, TopAbs_WIRE):
            first = len(self.uses)
            explorer = BRepTools_WireExplorer(wire, self.face)
            while explorer.More():
                self.uses.append(explorer.Current())
                explorer.Next()
            self._following += [*range(first + 1, len(self.uses)), first]
        read = [read_pcurve(use, self.face) for use in self.uses]
        self._curves = [CurveEvaluator(curve) for curve, _, _ in read]
        crossable = [k for k, use in enumerate(self.uses) if not BRep_Tool.Degenerated_s(use)]
        self._chords = _chord_curves({k: (self._curves[k], read[k][1:]) for k in crossable})

    def evaluate(self, use: int, parameter: float) -> tuple[Array, Array]:
        """Return the face's parameters (2,) at a parameter of an edge, and their derivatives by it."""
        point, rate = self._curves[use](np.array([parameter]), 1)[..., 0]
        return point, rate

    def evaluate_points(self, use: int, parameters: Array) -> Array:
        """Return the face's parameters (n, 2) at parameters (n,) of an edge."""
        return self._curves[use](parameters)[0].T

    def find_span(self, use: int) -> tuple[float, float]:
        """Return the parameters of an edge where a use of it starts and stops."""
        first, last = BRep_Tool.Range_s(self.uses[use])
        return (first, last) if self.uses[use].Orientation() == TopAbs_FORWARD else (last, first)

    def find_uses(self, edge: TopoDS_Edge) -> list[int]:
        """Return the uses of an edge."""
        return [k for k, use in enumerate(self.uses) if use.IsSame(edge)]

    def find_vertex(self, vertex: TopoDS_Vertex) -> BoundaryMark | None:
        """Return the mark at a vertex, the first that the boundary has there; None if it has none."""
        uses = (k for k, use in enumerate(self.uses) if find_end_vertices(use)[1].IsSame(vertex))
        return next((self.mark_vertex(k, stops=True) for k in uses), None)

    def mark_vertex(self, use: int, *, stops: bool) -> BoundaryMark:
        """Return the mark at the vertex where a use stops, or else starts."""
        at = use if stops else self._following.index(use)
        return BoundaryMark(at, self.find_span(at)[1], find_end_vertices(self.uses[at])[1])

    def find_following(self, use: int) -> int:
        """Return the use that follows another one."""
        return self._following[use]

    def find_preceding(self, mark: BoundaryMark) -> int:
        """Return the use before a mark: before the marked one, or that one if the mark is at its end."""
        return mark.use if mark.vertex is not None else self._following.index(mark.use)

    def list_between(self, leaves: BoundaryMark, returns: Collection[BoundaryMark]) -> list[int] | None:
        """Return the whole uses from one mark forward to the first of others.

        None if there is none on its wire, or one further on the same use, of which two pieces would remain.
        """
        stops = {mark.use if mark.vertex is None else self._following[mark.use] for mark in returns}
        on_same_use = [mark for mark in returns if mark.vertex is None and mark.use == leaves.use]
        if leaves.vertex is None and any(self._is_ahead(leaves, mark) for mark in on_same_use):
            return None
        return self._walk(self._following[leaves.use], stops, self._following)

    def _is_ahead(self, mark: BoundaryMark, other: BoundaryMark) -> bool:
        """Whether another mark on the same use comes after a mark."""
        is_forward = self.uses[mark.use].Orientation() == TopAbs_FORWARD
        return (mark.parameter < other.parameter) == is_forward

    def list_until(self, mark: BoundaryMark, stops: Collection[int], *, backward: bool) -> list[int] | None:
        """Return the whole uses from a mark forward, or backward, up to one of some; None if there is none."""
        if not backward:
            return self._walk(self._following[mark.use], stops, self._following)
        preceding = [self._following.index(k) for k in range(len(self.uses))]
        return self._walk(self.find_preceding(mark), stops, preceding)

    def _walk(self, start: int, stops: Collection[int], step: Sequence[int]) -> list[int] | None:
        """Return the uses from one up to one of some stops, exclusively; None if there is none in its wire."""
        found, at = list[int](), start
        while at not in stops:
            found.append(at)
            at = step[at]
            if at == start:
                return None
        return found

    def find_lost_vertex(self, mark: BoundaryMark, *, leaves: bool) -> TopoDS_Vertex:
        """Return the end of a marked use that is cut off, where the boundary leaves the face's new one, or returns."""
        return find_end_vertices(self.uses[mark.use])[1 if leaves else 0]

    def find_first_crossing(
        self, path: Array, periods: tuple[float | None, float | None], skipped: Collection[int] = ()
    ) -> BoundaryCrossing | None:
        """Return where a path through points (n, 2) first crosses the boundary but for some uses; None if nowhere.

        To the accuracy of chords. The path may be whole periods outside of the face's window.
        """
        starts, stops, uses, parameters = self._chords
        kept = ~np.isin(uses, list(skipped))
        starts, stops, uses, parameters = starts[kept], stops[kept], uses[kept], parameters[:, kept]
        if not len(starts):
            return None
        ranges = []
        for axis, period in enumerate(periods):
            if period is None:
                ranges.append([0.0])
                continue
            low, high = path[:, axis].min() - starts[:, axis].max(), path[:, axis].max() - starts[:, axis].min()
            ranges.append([k * period for k in range(int(np.floor(low / period)), int(np.ceil(high / period)) + 1)])
        found = [_intersect_chords(path, starts + shift, stops + shift) for shift in product(*ranges)]
        hits = [(float(hit[0]), int(hit[1]), hit[2]) for hit in found if hit is not None]
        if not hits:
            return None
        share, chord, along = min(hits)
        first, last = parameters[:, chord].tolist()
        return BoundaryCrossing(share, int(uses[chord]), first + along * (last - first))


def _chord_curves(
    curves: Mapping[int, tuple[CurveEvaluator, tuple[float, float]]],
) -> tuple[Array, Array, Array, Array]:
    """Return chords of curves: their starts and stops (n, 2), the curve that each is of (n,), and its span (2, n)."""
    starts, stops, owners, parameters = [], [], [], []
    for k, (curve, (low, high)) in curves.items():
        knots = curve.knots
        count = 2 if curve.is_straight else SHELL_EDIT_TOLERANCES.boundary_chords + 1
        t = np.linspace(low, high, count)
        if knots is not None and count > 2:
            t = np.unique(np.concatenate([t, knots[(knots > low) & (knots < high)]]))
        points = curve(t)[0].T
        starts.append(points[:-1])
        stops.append(points[1:])
        owners.append(np.full(len(t) - 1, k))
        parameters.append(np.stack([t[:-1], t[1:]]))
    return np.concatenate(starts), np.concatenate(stops), np.concatenate(owners), np.concatenate(parameters, axis=1)


def _intersect_chords(path: Array, starts: Array, stops: Array) -> tuple[float, int, float] | None:
    """Return where a path (n, 2) first crosses chords: how far along it, which chord, and the share of the chord."""
    steps, chords = np.diff(path, axis=0)[:, None], (stops - starts)[None]
    offsets = starts[None] - path[:-1, None]
    across = steps[..., 0] * chords[..., 1] - steps[..., 1] * chords[..., 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along_path = (offsets[..., 0] * chords[..., 1] - offsets[..., 1] * chords[..., 0]) / across
        along_chord = (offsets[..., 0] * steps[..., 1] - offsets[..., 1] * steps[..., 0]) / across
    slack = SHELL_EDIT_TOLERANCES.chord_slack
    hit = (along_path >= 0) & (along_path <= 1) & (along_chord >= -slack) & (along_chord <= 1 + slack)
    if not hit.any():
        return None
    i, k = np.nonzero(hit)
    share = i + along_path[i, k]
    first = int(share.argmin())
    return float(share[first]), int(k[first]), float(np.clip(along_chord[i[first], k[first]], 0, 1))
