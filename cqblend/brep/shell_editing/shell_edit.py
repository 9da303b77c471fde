"""Put a blend face into a solid by rewriting the boundaries of the faces that it touches.

No intersection is computed and no boolean is run. The two support faces are trimmed at the rails: the rail edges take
the place of the blended edge in their wires. The blend face goes in on the same rail edges, and the shell is put
together again. A closed rail may cross seams: rail and seam are split there. An open blend ends, at each end, on the
face across the edge or in a flat cap: the end curve is solved point by point.

The result is a proposal: :mod:`cqblend.solid_blends.blend_pipeline` verifies it before anybody sees it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from OCP.Geom2d import Geom2d_Line
from OCP.GeomAbs import GeomAbs_C0, GeomAbs_G1, GeomAbs_G2
from OCP.gp import gp_Dir2d, gp_Pnt2d
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex, TopoDS_Wire

from cqblend.brep.shell_editing.blend_placement import BlendPlacement
from cqblend.brep.shell_editing.edge_tolerance import raise_edge_tolerances
from cqblend.brep.shell_editing.end_cap import end_in_cap, make_edge_remainders
from cqblend.brep.shell_editing.end_curve import BlendEndError
from cqblend.brep.shell_editing.end_on_face import end_on_face
from cqblend.brep.shell_editing.face_edits import (
    BlendEnd,
    CapStations,
    FaceEdit,
    SpineRemoval,
    merge_face_edits,
    rebuild_face,
)
from cqblend.brep.shell_editing.neighbour_edges import trim_neighbour_edges
from cqblend.brep.shell_editing.rail_edges import RailSpan, trim_at_rail
from cqblend.brep.topology import (
    BUILDER,
    attach_pcurves,
    find_end_vertices,
    is_among,
    make_closed_wire,
    make_edge,
    make_vertex,
    replace_solid_faces,
    reverse_edge,
)
from cqblend.errors import GeometryError, SizeError, TopologyError

CONTINUITY_FLAGS = (GeomAbs_C0, GeomAbs_G1, GeomAbs_G2)
"""OCCT's flags of an edge, by the order of the continuity across it."""


@dataclass(frozen=True)
class ProposedSolid:
    """A rewritten solid, not yet verified."""

    solid: TopoDS_Shape
    blend_face: TopoDS_Face
    trimmed_faces: tuple[TopoDS_Face, TopoDS_Face]  # the support faces, trimmed at the rails
    rail_edges: tuple[list[TopoDS_Edge], list[TopoDS_Edge]]  # between the blend face and these
    cap_count: int  # how many ends are flat caps
    tolerance: float  # the largest of an edge that was made or cut (mm)


class RailsTooShortError(GeometryError):
    """The blend must be made over a longer range of t, ``needed_domain``, to reach the faces at its ends."""

    def __init__(self, needed: tuple[float, float]) -> None:
        super().__init__(f"the rails must reach from t = {needed[0]:.4g} to {needed[1]:.4g}")
        self.needed_domain = needed


def blend_closed_edge(placement: BlendPlacement) -> ProposedSolid:
    """Put a blend in the place of a closed edge.

    Raises
    ------
    SizeError, TopologyError, GeometryError
        If the rails do not fit on the support faces.
    """
    low, high = placement.domain
    corners = [make_vertex(row(np.array([low]))[0]) for row in placement.rail_curves]
    numbers = [placement.edge_index.find_number(edge) for edge in placement.spine.edges]
    removed = SpineRemoval(dict.fromkeys(numbers, ()), _list_spine_vertices(placement))
    (first, first_edit), (second, second_edit) = (
        trim_at_rail(placement, i, RailSpan(placement.domain, (corner, corner)), removed)
        for i, corner in enumerate(corners)
    )
    seam = make_edge(placement.occ_surface.UIso(low), (corners[0], corners[1]), (0.0, 1.0))
    up = gp_Dir2d(0, 1)
    attach_pcurves(seam, placement.blend_face, Geom2d_Line(gp_Pnt2d(high, 0), up), Geom2d_Line(gp_Pnt2d(low, 0), up))
    uses = [*first, seam, *(reverse_edge(edge) for edge in reversed(second)), reverse_edge(seam)]
    return _assemble_solid(placement, make_closed_wire(uses), (first, second), [first_edit, second_edit])


def blend_open_edge(placement: BlendPlacement, caps: CapStations = (None, None)) -> ProposedSolid:
    """Put a blend in the place of an open edge.

    It ends on the one other face at each of the edge's vertices, or in flat caps at the given t.

    Raises
    ------
    RailsTooShortError
        If the blend must reach further than its rails.
    BlendEndError
        If it cannot end so at one end.
    SizeError, TopologyError, GeometryError
        If the rails do not fit on the support faces.
    """
    low, high = (_build_end(placement, end, cap) for end, cap in enumerate(caps))
    needed = (min(low.rail_parameters), max(high.rail_parameters))
    if needed[0] < placement.domain[0] or needed[1] > placement.domain[1]:
        raise RailsTooShortError(needed)
    removed = SpineRemoval(make_edge_remainders(placement, low, high, caps), _list_removed_vertices(placement, caps))
    edits = [*low.face_edits, *high.face_edits]
    rails = []
    for i in (0, 1):
        span = (low.rail_parameters[i], high.rail_parameters[i])
        if span[0] >= span[1]:
            raise SizeError(
                "the two ends of the blend meet: the size is too large for the length of the edge", kind="too large"
            )
        borders = (low.cap_borders[i], high.cap_borders[i])
        rail, edit = trim_at_rail(placement, i, RailSpan(span, (low.corners[i], high.corners[i]), borders), removed)
        rails.append(rail)
        edits.append(edit)
    edits += trim_neighbour_edges(placement, (*low.edge_trims, *high.edge_trims))
    uses = [*rails[0], high.end_edge, *(reverse_edge(edge) for edge in reversed(rails[1])), reverse_edge(low.end_edge)]
    cap_faces = [end.cap_face for end in (low, high) if end.cap_face is not None]
    return _assemble_solid(placement, make_closed_wire(uses), (rails[0], rails[1]), edits, cap_faces)


def _list_spine_vertices(placement: BlendPlacement) -> list[TopoDS_Vertex]:
    """Return the vertices of the blended edges."""
    return [vertex for edge in placement.spine.edges for vertex in find_end_vertices(edge)]


def _list_removed_vertices(placement: BlendPlacement, caps: CapStations) -> list[TopoDS_Vertex]:
    """Return the vertices of the blended edges but for those at an end with a flat cap."""
    kept = [vertex for vertex, cap in zip(placement.spine.vertices, caps, strict=True) if cap is not None]
    return [vertex for vertex in _list_spine_vertices(placement) if not is_among(vertex, kept)]


def _build_end(placement: BlendPlacement, end: int, cap: float | None) -> BlendEnd:
    """End the blend at one end of the edge: in a flat cap at t = ``cap``, or on the face across the edge."""
    try:
        return end_on_face(placement, end) if cap is None else end_in_cap(placement, end, cap)
    except (SizeError, TopologyError, GeometryError) as error:
        raise BlendEndError(end, error) from error


def _assemble_solid(
    placement: BlendPlacement,
    boundary: TopoDS_Wire,
    rails: tuple[list[TopoDS_Edge], list[TopoDS_Edge]],
    edits: Sequence[FaceEdit],
    caps: Sequence[TopoDS_Face] = (),
) -> ProposedSolid:
    """Close the blend face, rebuild every face that changed, and put the shell together."""
    forward_blend = TopoDS.Face_s(placement.blend_face.EmptyCopied())
    BUILDER.Add(forward_blend, boundary)
    blend_face = TopoDS.Face_s(forward_blend.Reversed())
    face_index = placement.face_index
    rebuilt = {
        number: rebuild_face(edit, placement.edge_index) for number, edit in merge_face_edits(edits, face_index).items()
    }
    for number, face in rebuilt.items():
        face.Orientation(face_index[number].Orientation())
    first, second = (rebuilt[face_index.find_number(face)] for face in placement.support_faces)
    for face, rail, ribbon in zip((first, second), rails, placement.blend.ribbons, strict=True):
        for edge in rail:
            BUILDER.Continuity(edge, face, blend_face, CONTINUITY_FLAGS[min(ribbon.order, 2)])
    tolerance = raise_edge_tolerances(
        [*rebuilt.values(), blend_face, *caps], placement.edge_index, placement.vertex_index
    )
    solid = replace_solid_faces(placement.solid, rebuilt, face_index, [blend_face, *caps])
    return ProposedSolid(solid, blend_face, (first, second), rails, len(caps), tolerance)
