"""The edge tolerance that covers how far an edge's curve and the images of its pcurves lie apart.

A trimmed copy of an edge is checked at other parameters than the edge was: a body that was valid need not be so any
more. So every edge that is made or trimmed here is measured along its whole length, and gets the tolerance that it
needs.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.conversion.support_face import read_support_face
from cqblend.brep.measurement.curve_deviation import measure_curve_deviation
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import (
    BUILDER,
    ShapeIndex,
    explore_subshapes,
    find_end_vertices,
    raise_vertex_tolerance,
)
from cqblend.splines import interpolation
from cqblend.surfaces.vectors import to_tangent_coordinates


def refit_pcurve(use: TopoDS_Edge, face: TopoDS_Face, deviation: float) -> float:
    """Replace an edge's pcurve on a face by one through the projections of the edge's points, if that is much nearer.

    It helps where the edge's curve lies on the face and the pcurve alone is coarse. ``deviation`` is the distance (mm)
    between the edge's curve and the image of its pcurve; returns that distance afterwards.
    """
    old = BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0)
    span: tuple[float, float] = BRep_Tool.Range_s(use)
    if span != BRep_Tool.Range_s(use, face) or BRep_Tool.IsClosed_s(use, face):
        return deviation
    t = np.linspace(span[0], span[1], SHELL_EDIT_TOLERANCES.foot_count)
    curve = BRep_Tool.Curve_s(use, 0.0, 0.0)
    points = np.array([curve.Value(x).Coord() for x in t.tolist()])
    start = uv = np.array([old.Value(x).Coord() for x in t.tolist()])
    surface = read_support_face(face, points[:1]).face_primary
    for _ in range(SHELL_EDIT_TOLERANCES.foot_iterations):
        jet = surface.jet(uv)
        uv = uv + to_tangent_coordinates(jet, points - jet[0])
    found, before = surface.jet(uv)[0], surface.jet(start)[0]
    off, moved = (np.linalg.norm(found - other, axis=1).max() for other in (points, before))
    if not off < deviation / 2 or not moved < 4 * deviation:  # the face is far from the curve, or a foot has jumped
        return deviation
    degree, knots, poles, _ = interpolation.interpolate(t, uv).to_bspline()
    BUILDER.UpdateEdge(use, spline_arrays.curve2d_from_arrays(degree, knots, poles), face, BRep_Tool.Tolerance_s(use))
    deviation_now = measure_curve_deviation(use, face)
    if deviation_now < deviation / 2:
        return deviation_now
    BUILDER.UpdateEdge(use, old, face, BRep_Tool.Tolerance_s(use))
    return deviation


class EdgeDeviations:
    """The largest distance (mm) between the curve of every new edge and the images of its pcurves."""

    def __init__(self, faces: Iterable[TopoDS_Face]) -> None:
        self._edges = ShapeIndex.from_shapes(faces, TopAbs_EDGE)
        self._values: dict[int, float] = {}

    def record(self, edge: TopoDS_Edge, deviation: float) -> None:
        """Record the deviation of an edge on one more face."""
        number = self._edges.find_number(edge)
        self._values[number] = max(deviation, self._values.get(number, 0.0))

    def get(self, edge: TopoDS_Edge) -> float:
        """Return the largest deviation of an edge."""
        return self._values[self._edges.find_number(edge)]

    @property
    def largest_tolerance(self) -> float:
        """The largest tolerance (mm) of these edges."""
        return max(BRep_Tool.Tolerance_s(self._edges[number]) for number in self._values)


def raise_edge_tolerances(faces: Sequence[TopoDS_Face], index: SolidIndex) -> EdgeDeviations:
    """Raise the tolerance of every new edge of some faces to what its curves need, and that of its new vertices.

    New is what the input does not have; what it has is shared with it and stays as it is. Pcurves are fitted again
    first where that brings them much nearer.
    """
    deviations = EdgeDeviations(faces)
    for face in faces:
        for use in explore_subshapes(face, TopAbs_EDGE):
            if use in index.edges:
                continue
            deviation = measure_curve_deviation(use, face)
            if deviation > SHELL_EDIT_TOLERANCES.refit_deviation:
                deviation = refit_pcurve(use, face, deviation)
            needed = SHELL_EDIT_TOLERANCES.deviation_margin * deviation
            if needed > BRep_Tool.Tolerance_s(use):
                BUILDER.UpdateEdge(use, needed)
            deviations.record(use, deviation)
            for vertex in find_end_vertices(use):
                if vertex not in index.vertices:
                    raise_vertex_tolerance(vertex, BRep_Tool.Tolerance_s(use))
    return deviations
