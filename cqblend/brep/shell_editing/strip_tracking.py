"""What becomes of the blend faces of one rewriting of a solid in the next one, which trims them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face

from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.plan_application import BuiltEdge, BuiltPatch, BuiltStrip, ProposedSolid
from cqblend.errors import SizeError


def list_end_edges(strip: BuiltStrip, end: int) -> list[TopoDS_Edge]:
    """Return the edges in which a blend face ends at an end of its spine, 0 or 1, on faces that lie there."""
    return [edge.sides[0][1] for edge in strip.other_edges if edge.end == end]


def track_strip(strip: BuiltStrip, index: SolidIndex, proposal: ProposedSolid) -> BuiltStrip:
    """Return a blend face of a solid as it is after the solid was rewritten once more.

    Edges that are no rails, and of which nothing remains, are left out.

    Raises
    ------
    SizeError
        If nothing remains of the blend face, or of one of its rails.
    """
    others = (_track_edge(edge, index, proposal) for edge in strip.other_edges)
    rails = [[piece for edge in side for piece in _track_pieces(edge, index, proposal)] for side in strip.rail_edges]
    if any(before and not after for before, after in zip(strip.rail_edges, rails, strict=True)):
        raise _make_covered_error()
    first, second = (_track_face(face, index, proposal) for face in strip.trimmed_faces)
    return replace(
        strip,
        blend_face=_track_face(strip.blend_face, index, proposal),
        trimmed_faces=(first, second),
        rail_edges=(rails[0], rails[1]),
        other_edges=tuple(edge for edge in others if edge is not None),
    )


def track_patch(patch: BuiltPatch, index: SolidIndex, proposal: ProposedSolid) -> BuiltPatch:
    """Return a face of a corner of a solid as it is after the solid was rewritten once more.

    Raises
    ------
    SizeError
        If nothing remains of it.
    """
    edges = (_track_edge(edge, index, proposal) for edge in patch.edges)
    face = _track_face(patch.face, index, proposal)
    return replace(patch, face=face, edges=tuple(edge for edge in edges if edge is not None))


def _track_edge(edge: BuiltEdge, index: SolidIndex, proposal: ProposedSolid) -> BuiltEdge | None:
    """Return an edge that is no rail, in one piece; None if nothing remains of it."""
    pieces = _track_pieces(edge.sides[0][1], index, proposal)
    if not pieces:
        return None
    sides = [
        (_track_face(face, index, proposal), TopoDS.Edge_s(pieces[0].Oriented(use.Orientation())))
        for face, use in edge.sides
    ]
    return replace(edge, sides=tuple(sides))


def _track_pieces(edge: TopoDS_Edge, index: SolidIndex, proposal: ProposedSolid) -> Sequence[TopoDS_Edge]:
    """Return what remains of an edge."""
    return proposal.edge_pieces.get(index.edges.find_number(edge), (edge,))


def _track_face(face: TopoDS_Face, index: SolidIndex, proposal: ProposedSolid) -> TopoDS_Face:
    """Return what has become of a face."""
    number = index.faces.find_number(face)
    if number in proposal.removed_faces:
        raise _make_covered_error()
    if number in proposal.split_faces:
        raise SizeError("another blend that meets it at a corner cuts it in pieces", kind="too large")
    return proposal.rebuilt_faces.get(number, face)


def _make_covered_error() -> SizeError:
    return SizeError(
        "nothing remains of it beside another blend that meets it at a corner: the size is too large", kind="too large"
    )
