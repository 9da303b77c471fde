"""Cutting the seams of a support face where a rail crosses them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from OCP.BRep import BRep_Tool
from OCP.GeomAPI import GeomAPI_ProjectPointOnCurve
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import (
    CONFUSION,
    ShapeIndex,
    explore_subshapes,
    find_end_vertices,
    find_seam_edges,
    is_among,
    make_trimmed_copy,
    orient_forward,
    raise_vertex_tolerance,
)
from cqblend.errors import SizeError
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class SeamCrossings:
    """Where a rail may cross seams of its support face: n vertices, their points and the directions into the blend."""

    vertices: Sequence[TopoDS_Vertex]
    points: Array  # (n, 3)
    directions: Array  # (n, 3)


class _Mark(NamedTuple):
    """A vertex of the rail on a seam: the seam's parameter there, and whether the seam enters the blend's side."""

    parameter: float
    vertex: TopoDS_Vertex
    enters_blend: bool


def cut_seams(
    face: TopoDS_Face, edge_index: ShapeIndex, crossings: SeamCrossings, removed: Sequence[TopoDS_Vertex]
) -> dict[int, list[TopoDS_Edge]]:
    """Return what remains of a face's seams outside the rail: edge number -> FORWARD pieces.

    What lies between the rail and the blended edge, whose vertices are ``removed``, goes, and so do poles there.

    Raises
    ------
    SizeError
        If the rail passes beyond a seam that starts at the blended edge.
    """
    pieces: dict[int, list[TopoDS_Edge]] = {}
    dropped: list[TopoDS_Vertex] = []
    for edge in find_seam_edges(face):
        number = edge_index.find_number(edge)
        marks = _mark_crossings(edge, crossings)
        start, end = find_end_vertices(edge)
        if not marks:
            touching = [vertex for vertex in (start, end) if is_among(vertex, removed)]
            if len(touching) == 1:
                raise SizeError("the rail passes beyond the end of the face: the size is too large", kind="too large")
            if len(touching) == 2:
                pieces[number] = []
                dropped += [start, end]
            continue
        first, last = BRep_Tool.Range_s(edge)
        stations = [(first, start), *((mark.parameter, mark.vertex) for mark in marks), (last, end)]
        is_removed = [not marks[0].enters_blend, *(mark.enters_blend for mark in marks)]
        pieces[number] = []
        for (low, one), (high, other), goes in zip(stations[:-1], stations[1:], is_removed, strict=True):
            if goes:
                dropped += [vertex for vertex in (one, other) if vertex.IsSame(start) or vertex.IsSame(end)]
            elif high - low > SHELL_EDIT_TOLERANCES.rail_end_at_seam * (last - first):
                pieces[number].append(make_trimmed_copy(edge, (one, other), (low, high)))
    for use in explore_subshapes(orient_forward(face), TopAbs_EDGE):  # poles that lost their seam
        if BRep_Tool.Degenerated_s(use) and is_among(find_end_vertices(use)[0], dropped):
            pieces[edge_index.find_number(use)] = []
    return pieces


def _mark_crossings(seam: TopoDS_Edge, crossings: SeamCrossings) -> list[_Mark]:
    """Return the vertices that lie on a seam, in its order; their tolerances are raised to reach it."""
    curve = BRep_Tool.Curve_s(seam, 0.0, 0.0)
    marks = []
    for vertex, point, direction in zip(crossings.vertices, crossings.points, crossings.directions, strict=True):
        project = GeomAPI_ProjectPointOnCurve(gp_Pnt(*point.tolist()), curve, *BRep_Tool.Range_s(seam))
        if project.NbPoints() == 0 or project.LowerDistance() > 10 * CONFUSION:
            continue
        parameter = project.LowerDistanceParameter()
        tangent = curve.DN(parameter, 1)
        enters_blend = float(direction @ (tangent.X(), tangent.Y(), tangent.Z())) > 0
        marks.append(_Mark(parameter, vertex, enters_blend))
        raise_vertex_tolerance(vertex, SHELL_EDIT_TOLERANCES.deviation_margin * project.LowerDistance())
    return sorted(marks, key=lambda mark: mark.parameter)
