"""Samples of a face along one of its edges: where to take them, and what OCCT's geometry is there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.GeomAbs import GeomAbs_C2
from OCP.TopAbs import TopAbs_EDGE, TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.edge_parameters import map_to_range, spread_samples
from cqblend.brep.measurement.edge_sides import EdgeSide, find_sides_on_face, read_pcurve
from cqblend.brep.measurement.knot_lines import find_curve_knots, find_knot_crossings, list_inner_lines
from cqblend.brep.measurement.surface_evaluation import compute_normals
from cqblend.brep.measurement.tolerances import MEASURE_TOLERANCES
from cqblend.brep.topology import explore_subshapes
from cqblend.errors import InputError, SelectionError
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class EdgeSamples:
    """Jets of one face along one of its edges, and what follows from them.

    Attributes
    ----------
    jets : ndarray, shape (3 or 6, 3, n)
        S, Su, Sv and, to order 2, Suu, Svv and Suv at the samples; points S are images under the face's pcurve and
        surface, mm.
    parameters : ndarray, shape (2, n)
        Where the surface was evaluated.
    sign : float
        -1 on a REVERSED face, whose outward normals are against ``Su x Sv``, else 1.
    """

    jets: Array
    parameters: Array
    sign: float

    @property
    def points(self) -> Array:
        """The points (3, n), mm."""
        return self.jets[0]

    @cached_property
    def normals(self) -> Array:
        """Outward unit normals (3, n); nan where the surface is degenerate (the pole of a sphere)."""
        return compute_normals(self.jets, self.sign)[0]


class SideSampler:
    """Samples one face along one of its edges; what it reads of both, it reads once.

    Attributes
    ----------
    face, edge : TopoDS_Face, TopoDS_Edge
        As in the side: of a seam, the edge's orientation picks the pcurve.
    surface : SurfaceEvaluator
        Taken over if the face's surface has an evaluator already.

    Raises
    ------
    GeometryError
        The edge has no pcurve on the face.
    """

    def __init__(self, side: EdgeSide, surface: SurfaceEvaluator | None = None) -> None:
        self.face, self.edge = side
        if BRep_Tool.IsClosed_s(self.edge, self.face):
            self.edge = _orient_as_used(self.edge, self.face)
        pcurve, low, high = read_pcurve(self.edge, self.face)
        self.surface = surface or SurfaceEvaluator(BRep_Tool.Surface_s(self.face))
        self._pcurve = CurveEvaluator(pcurve)
        self._pcurve_ends = (low, high)
        self._ends: tuple[float, float] = BRep_Tool.Range_s(self.edge)
        self._lines = list_inner_lines(self.surface, GeomAbs_C2)

    def find_breaks(self) -> Array:
        """Return where the side may jump, as parameters of the edge: knots of its pcurve, crossings of knot lines."""
        knots = find_curve_knots(self._pcurve, *self._pcurve_ends)
        crossings = find_knot_crossings(self._pcurve, *self._pcurve_ends, self.surface)
        return map_to_range(np.concatenate((knots, crossings)), self._pcurve_ends, self._ends)

    def sample(self, ts: Array, order: Literal[1, 2] = 2) -> EdgeSamples:
        """Evaluate the face, with derivatives up to an order, at parameters (n,) of the edge's 3D curve.

        Where the edge runs along a knot line of the surface, derivatives are those of the face's own side of that line.

        Raises
        ------
        GeometryError
            OCCT cannot evaluate the surface.
        """
        ts = map_to_range(ts, self._ends, self._pcurve_ends)
        uv = self._pcurve(ts)[0]
        moved = self._shift_to_face_side(uv, ts)
        jets = self.surface(uv if moved is None else moved, order)
        if moved is not None:
            jets[0] = self.surface(uv, 0)[0]
        return EdgeSamples(jets, uv, -1.0 if self.face.Orientation() == TopAbs_REVERSED else 1.0)

    def _shift_to_face_side(self, uv: Array, ts: Array) -> Array | None:
        """Move points of a pcurve that runs along a knot line to the side of the line where the face lies.

        Only lines where second derivatives may jump matter; a pcurve that merely crosses a line stays. None if no point
        is moved.
        """
        moved = None
        for family in self._lines:
            k, reach = family.axis, MEASURE_TOLERANCES.knot_line * family.size
            distances = family.measure_distances(uv)
            offset = distances[np.arange(len(ts)), np.abs(distances).argmin(axis=1)]
            near = np.flatnonzero(np.abs(offset) <= reach)
            velocity = self._pcurve(ts[near], 1)[1] * self._span_to_left
            runs_along = np.abs(velocity[k]) <= reach
            near, velocity = near[runs_along], velocity[:, runs_along]
            if not near.size:
                continue
            inward = -velocity[1] if k == 0 else velocity[0]
            line = uv[k, near] - offset[near]
            moved = uv.copy() if moved is None else moved
            moved[k, near] = line + np.copysign(compute_side_step(family.size, line), inward)
        return moved

    @cached_property
    def _span_to_left(self) -> float:
        """The length of the pcurve's range, negative if the face lies to the right of it."""
        low, high = self._pcurve_ends
        use = _orient_as_used(self.edge, self.face)
        # a REVERSED edge of a REVERSED face runs forward on its surface
        return high - low if use.Orientation() == self.face.Orientation() else low - high


def read_edge_curve(edge: TopoDS_Edge) -> CurveEvaluator:
    """Return the evaluator of an edge in space: of its 3D curve, or of the image of a pcurve if it has none."""
    return CurveEvaluator(BRep_Tool.Curve_s(edge, 0.0, 0.0) or BRepAdaptor_Curve(edge))


def choose_sample_parameters(sides: Sequence[SideSampler], curve: CurveEvaluator, samples: int = 1000) -> Array:
    """Return parameters at which to compare the sides of an edge: equidistant, and clustered where a side may jump.

    That is at the ends, the knots of the 3D curve and of the pcurves, and at crossings with knot lines of the faces'
    surfaces.

    Raises
    ------
    InputError
        Fewer than 2 samples.
    """
    if not isinstance(samples, int | np.integer) or samples < 2:
        raise InputError(f"samples is {samples!r}: at least 2 are needed, one at each end")
    ends = BRep_Tool.Range_s(sides[0].edge)
    breaks = np.concatenate([find_curve_knots(curve, *ends), *(side.find_breaks() for side in sides)])
    unit = (0.0, 1.0)
    shares = np.unique(np.concatenate([unit, map_to_range(breaks, ends, unit).clip(*unit)]))
    return map_to_range(spread_samples(shares, samples), unit, ends)


def sample_outline(face: TopoDS_Face, samples: int = 65) -> Array:
    """Return the boundary of a face in its parameter plane, as the ends (n, 2, 2) of short straight pieces."""
    pieces = []
    for use in explore_subshapes(face, TopAbs_EDGE):
        pcurve, low, high = read_pcurve(use, face)
        points = CurveEvaluator(pcurve)(np.linspace(low, high, samples))[0].T
        pieces.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(pieces)


def compute_side_step(size: float, line: Array) -> Array:
    """Return steps off the knot lines at parameters ``line`` that surely leave them, in a domain of length ``size``."""
    return np.maximum(MEASURE_TOLERANCES.knot_line_step * size, 16.0 * np.spacing(np.abs(line)))


def _orient_as_used(edge: TopoDS_Edge, face: TopoDS_Face) -> TopoDS_Edge:
    """Return an edge with the orientation that it has in a face; of a seam, which has both, its own.

    Raises
    ------
    SelectionError
        The edge is not an edge of the face.
    """
    uses = find_sides_on_face(face, edge)
    if not uses:
        raise SelectionError("the edge is not an edge of the face")
    return uses[0][1] if len(uses) == 1 else edge
