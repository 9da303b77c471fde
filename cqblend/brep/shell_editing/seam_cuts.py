"""Cutting the seams of a support face where rails cross them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from OCP.BRep import BRep_Tool
from OCP.GeomAPI import GeomAPI_ProjectPointOnCurve
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.blends.network.blend_plan import EdgePiece, PlannedVertex
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import (
    explore_subshapes,
    find_end_vertices,
    find_seam_edges,
    is_among,
    locate_vertex,
    orient_forward,
)
from cqblend.errors import SizeError
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class SeamCrossings:
    """Where a rail may cross seams of its support face: n vertices and the directions (n, 3) into the blend there.

    ``removed`` are the vertices of the blended edges, which go.
    """

    face: TopoDS_Face
    vertices: Sequence[PlannedVertex]
    directions: Array
    removed: Sequence[TopoDS_Vertex]


class _Mark(NamedTuple):
    """A vertex of a rail on a seam: the seam's parameter there, its distance, and whether the seam enters the blend."""

    parameter: float
    vertex: PlannedVertex
    gap: float
    enters_blend: bool


def cut_seams(crossings: Sequence[SeamCrossings], index: SolidIndex) -> dict[int, tuple[EdgePiece, ...]]:
    """Return what remains of the seams of one face outside the rails that cross them: edge number -> pieces.

    What lies between a rail and the blended edge goes, and so do poles there.

    Raises
    ------
    SizeError
        If a rail passes beyond a seam that starts at the blended edge.
    """
    face, pieces = crossings[0].face, dict[int, tuple[EdgePiece, ...]]()
    dropped: list[TopoDS_Vertex] = []
    for edge in find_seam_edges(face):
        number = index.edges.find_number(edge)
        marks = sorted(
            (mark for one in crossings for mark in _mark_crossings(edge, one)), key=lambda mark: mark.parameter
        )
        start, end = find_end_vertices(edge)
        if not marks:
            touching = [sum(is_among(vertex, one.removed) for vertex in (start, end)) for one in crossings]
            if 1 in touching:
                raise SizeError("the rail passes beyond the end of the face: the size is too large", kind="too large")
            if 2 in touching:
                pieces[number] = ()
                dropped += [start, end]
            continue
        first, last = BRep_Tool.Range_s(edge)
        ends = [PlannedVertex(locate_vertex(vertex), index.vertices.find_number(vertex)) for vertex in (start, end)]
        stations = [
            _Mark(first, ends[0], 0.0, not marks[0].enters_blend),
            *marks,
            _Mark(last, ends[1], 0.0, not marks[-1].enters_blend),
        ]
        remaining = []
        gone = [vertex for one in crossings for vertex in one.removed]
        if (is_among(start, gone) and not stations[0].enters_blend) or (
            is_among(end, gone) and not stations[-2].enters_blend
        ):
            taken = (last - marks[0].parameter) + (marks[-1].parameter - first)
            raise SizeError(
                "nothing would remain of the face between the rails: they pass each other at its seam",
                kind="too large",
                room=(last - first) / taken,
            )
        for low, high in pairwise(stations):
            if low.enters_blend:
                dropped += [v for v, kept in zip((start, end), ends, strict=True) if kept in (low.vertex, high.vertex)]
            elif high.parameter - low.parameter > SHELL_EDIT_TOLERANCES.rail_end_at_seam * (last - first):
                vertices, gaps = (low.vertex, high.vertex), (low.gap, high.gap)
                remaining.append(EdgePiece(number, (low.parameter, high.parameter), vertices, gaps))
        pieces[number] = tuple(remaining)
    for use in explore_subshapes(orient_forward(face), TopAbs_EDGE):  # poles that lost their seam
        if BRep_Tool.Degenerated_s(use) and is_among(find_end_vertices(use)[0], dropped):
            pieces[index.edges.find_number(use)] = ()
    return pieces


def _mark_crossings(seam: TopoDS_Edge, crossings: SeamCrossings) -> list[_Mark]:
    """Return the vertices that lie on a seam."""
    curve = BRep_Tool.Curve_s(seam, 0.0, 0.0)
    marks = []
    for vertex, direction in zip(crossings.vertices, crossings.directions, strict=True):
        project = GeomAPI_ProjectPointOnCurve(gp_Pnt(*vertex.point.tolist()), curve, *BRep_Tool.Range_s(seam))
        if project.NbPoints() == 0 or project.LowerDistance() > SHELL_EDIT_TOLERANCES.at_seam:
            continue
        parameter = project.LowerDistanceParameter()
        tangent = curve.DN(parameter, 1)
        enters_blend = float(direction @ (tangent.X(), tangent.Y(), tangent.Z())) > 0
        marks.append(_Mark(parameter, vertex, project.LowerDistance(), enters_blend))
    return marks
