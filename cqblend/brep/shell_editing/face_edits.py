"""Edits of the boundaries of a solid's faces, as values: what the steps of putting a blend in return.

The ends of a blend (:mod:`.end_on_face`, :mod:`.end_cap`), its rails (:mod:`.rail_edges`) and the trimmed neighbour
edges (:mod:`.neighbour_edges`) each tell what is to change; :mod:`.shell_edit` merges and applies it.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from OCP.TopAbs import TopAbs_EDGE, TopAbs_VERTEX, TopAbs_WIRE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.brep.topology import (
    BUILDER,
    ShapeIndex,
    chain_segments,
    explore_subshapes,
    find_end_uv,
    find_end_vertices,
    make_closed_wire,
    orient_forward,
)
from cqblend.errors import TopologyError

CapStations = tuple[float | None, float | None]
"""The t of the flat caps at both ends of an open blend, None for an end on the face across the edge."""


@dataclass(frozen=True)
class FaceEdit:
    """Edits of the boundary of one face of the solid, or another face in its place."""

    face: TopoDS_Face
    added_uses: tuple[TopoDS_Edge, ...] = ()  # new edges, oriented as in the FORWARD face
    edge_pieces: Mapping[int, Sequence[TopoDS_Edge]] = field(default_factory=dict)
    """Number of an edge in the solid -> the FORWARD pieces that take its place, none if it goes."""
    replacement_face: TopoDS_Face | None = None  # FORWARD


@dataclass(frozen=True)
class SpineRemoval:
    """What becomes of the blended edges."""

    remainders: Mapping[int, Sequence[TopoDS_Edge]]  # number of the edge -> FORWARD pieces of it beyond flat caps
    vertices: Sequence[TopoDS_Vertex]  # that are no longer on the support faces


@dataclass(frozen=True)
class EdgeTrim:
    """An edge of the input next to one ``end`` (0 or 1) of the blend, to be trimmed or extended to the blend's corner.

    It loses what is between ``spine_vertex``, its end at the blended edge, and ``corner``; or it is lengthened to
    there. Where a flat cap stands on the edge, ``cap_border`` is the part between vertex and corner: then only the face
    ``face_without_border``, which ends at the rail, loses that part.
    """

    end: int
    edge: TopoDS_Edge
    spine_vertex: TopoDS_Vertex
    corner: TopoDS_Vertex
    faces: tuple[TopoDS_Face, TopoDS_Face]
    cap_border: TopoDS_Edge | None = None
    face_without_border: TopoDS_Face | None = None


@dataclass(frozen=True)
class BlendEnd:
    """One end of an open blend: on the face across the edge, or in a flat cap.

    ``end_edge`` is the edge of the end curve, in which the blend surface meets that face or cap: FORWARD from the
    corner on rail 1 to that on rail 2, at the parameters ``rail_parameters`` of the rails. Where there is a
    ``cap_face``, its ``cap_borders`` run inside each support face, FORWARD from the edge to the corner; none on a side
    where the cap stands on an edge of the input.
    """

    end_edge: TopoDS_Edge
    corners: tuple[TopoDS_Vertex, TopoDS_Vertex]
    rail_parameters: tuple[float, float]
    spine_vertex: TopoDS_Vertex  # of the edge at this end: the input's, or a new one where a cap stands before it
    edge_trims: tuple[EdgeTrim, ...] = ()
    face_edits: tuple[FaceEdit, ...] = ()
    cap_borders: tuple[tuple[TopoDS_Edge, ...], tuple[TopoDS_Edge, ...]] = ((), ())
    cap_face: TopoDS_Face | None = None


def merge_face_edits(edits: Iterable[FaceEdit], face_index: ShapeIndex) -> dict[int, FaceEdit]:
    """Return one edit for each face, by its number; of two replacements of one edge, the later one counts."""
    merged: dict[int, FaceEdit] = {}
    for edit in edits:
        number = face_index.find_number(edit.face)
        before = merged.get(number, FaceEdit(edit.face))
        merged[number] = replace(
            before,
            added_uses=(*before.added_uses, *edit.added_uses),
            edge_pieces={**before.edge_pieces, **edit.edge_pieces},
            replacement_face=before.replacement_face if edit.replacement_face is None else edit.replacement_face,
        )
    return merged


def rebuild_face(edit: FaceEdit, edge_index: ShapeIndex) -> TopoDS_Face:
    """Return the FORWARD face with its new boundary; wires without an edited edge are shared with the old face.

    Raises
    ------
    TopologyError
        If the new boundary does not close.
    """
    if edit.replacement_face is not None:
        return edit.replacement_face
    old = TopoDS.Face_s(orient_forward(edit.face))
    face = TopoDS.Face_s(old.EmptyCopied())
    loose = list(edit.added_uses)
    for wire in explore_subshapes(old, TopAbs_WIRE):
        uses = list(explore_subshapes(wire, TopAbs_EDGE))
        if not any(edge_index.find_number(use) in edit.edge_pieces for use in uses):
            BUILDER.Add(face, wire)
            continue
        for use in uses:
            pieces = edit.edge_pieces.get(edge_index.find_number(use))
            loose += [use] if pieces is None else [_orient_like(piece, use) for piece in pieces]
    for loop in trace_loops(loose, old):
        BUILDER.Add(face, make_closed_wire(loop))
    return face


def _orient_like(piece: TopoDS_Edge, use: TopoDS_Edge) -> TopoDS_Edge:
    """Return a FORWARD piece of an edge with the orientation of a use of the edge."""
    return TopoDS.Edge_s(piece.Oriented(use.Orientation()))


def trace_loops(uses: list[TopoDS_Edge], face: TopoDS_Face) -> list[list[TopoDS_Edge]]:
    """Sort edge uses of a FORWARD face into closed loops.

    Each use is followed by one that starts at its last vertex; by the one whose pcurve starts nearest, if several do.

    Raises
    ------
    TopologyError
        If a loop does not close: the new boundary crosses itself or leaves out an edge.
    """
    ends = [find_end_uv(use, face) for use in uses]
    vertices = ShapeIndex.from_shapes(uses, TopAbs_VERTEX)
    starts, stops = zip(*(map(vertices.find_number, find_end_vertices(use)) for use in uses), strict=True)

    def measure_gap(one: int, following: int) -> float:
        return float(np.abs(ends[following][0] - ends[one][1]).max())

    loops = chain_segments(starts, stops, measure_gap, until_closed=True)
    if any(stops[loop[-1]] != starts[loop[0]] for loop in loops):
        raise TopologyError(
            "the face's boundary cannot be closed along the rail: the size is too large for the face", kind="too large"
        )
    return [[uses[k] for k in loop] for loop in loops]
