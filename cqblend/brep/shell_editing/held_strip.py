"""Plan a strip of which one rail is held on an existing edge: the face between it and the blended edge goes.

The held edge itself bounds the blend face; the face beyond it gets the same copy of that edge, which has a curve on the
blend. At its ends the blend ends on the faces across, each of which loses its edge with the face that goes.
"""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.blends.network.blend_plan import (
    EdgePiece,
    EdgeUse,
    FacePlan,
    NewEdge,
    PlannedEdge,
    PlannedVertex,
    StripPlan,
    reverse_path,
)
from cqblend.brep.selection.held_edges import HeldEdge
from cqblend.brep.shell_editing.end_curve import BlendEndError, EndCurveStart, plan_end_edge, solve_end_curve
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim
from cqblend.brep.shell_editing.rail_edges import RailSpan, SpineRemoval, trim_at_rail
from cqblend.brep.shell_editing.strip_end import StripEnd
from cqblend.brep.shell_editing.strip_placement import StripPlacement
from cqblend.brep.shell_editing.strip_planning import PlannedChain, check_reach, cut_shared_edges, list_spine_vertices
from cqblend.brep.topology import (
    CONFUSION,
    ShapeIndex,
    explore_subshapes,
    find_end_vertices,
    find_vertex_uv,
    locate_vertex,
)
from cqblend.errors import GeometryError, SizeError, TopologyError
from cqblend.splines import Curve


def plan_held_chain(placement: StripPlacement, held: HeldEdge) -> PlannedChain:
    """Plan to put a strip in the place of its edge and of the face between this and the held edge.

    Raises
    ------
    RailsTooShortError
        If the blend must reach further than its rails.
    BlendEndError
        If it cannot end on the face across one end.
    SizeError, TopologyError, GeometryError
        If the other rail does not fit on its face.
    """
    index, free = placement.index, 1 - held.side
    removed = SpineRemoval(dict.fromkeys(placement.spine_numbers, ()), list_spine_vertices(placement))
    ends: tuple[StripEnd, ...] = ()
    if placement.joint.spine.closed:
        corner = PlannedVertex(placement.rail_curves[free](np.array(placement.domain[:1]))[0])
        part = RailSpan(placement.domain, (corner, corner), joined=(True, True))
    else:
        low, high = ends = (_plan_end(placement, held, 0), _plan_end(placement, held, 1))
        check_reach((placement, placement), ends)
        span = (low.rail_parameters[free], high.rail_parameters[free])
        if span[0] >= span[1]:
            raise SizeError("the two ends of the blend meet: the size is too large for the length of the edge")
        part = RailSpan(span, (low.corners[free], high.corners[free]))
    rail = trim_at_rail(placement, free, part, removed)
    piece = _plan_held_piece(placement, held)
    held_path = [EdgeUse(piece, held.is_forward)]
    free_path = [EdgeUse(edge) for edge in rail.edges]
    first, second = (held_path, free_path) if held.side == 0 else (free_path, held_path)
    if ends:
        (start,), (stop,) = ends[0].path, ends[1].path
    else:
        start = stop = EdgeUse(_plan_seam(placement, held, part.vertices[0]))
    beyond = index.faces.find_number(held.face_beyond)
    faces, edges = [placement.face_numbers[free]] * 2, list[tuple[PlannedEdge, ...]]([rail.edges, rail.edges])
    faces[held.side], edges[held.side] = beyond, (piece,)
    strip = StripPlan(
        placement.spine_numbers,
        (faces[0], faces[1]),
        placement.surface,
        (*first, stop, *reverse_path(second), start.reverse()),
        (edges[0], edges[1]),
        end_edges=tuple(end.edges for end in ends),
        removed_faces=(index.faces.find_number(held.face),),
        is_mirrored=placement.strip.is_mirrored,
    )
    own = [
        rail.face_plan,
        FacePlan(beyond, {piece.number: (piece,)}),
        *(plan for end in ends for plan in end.face_plans),
    ]
    trims = tuple(trim for end in ends for trim in end.edge_trims)
    crossings = () if rail.crossings is None else (rail.crossings,)
    return PlannedChain((strip,), tuple(own), trims, crossings, tuple(cut_shared_edges(index, trims, crossings)))


def _plan_held_piece(placement: StripPlacement, held: HeldEdge) -> EdgePiece:
    """Plan the copy of the held edge that has a curve on the blend."""
    edge, v = held.edge, float(held.side)
    span = BRep_Tool.Range_s(edge)
    first, last = (placement.locate_edge_parameter(t) for t in ((0.0, 1.0) if held.is_forward else (1.0, 0.0)))
    pcurve = placement.plan_pcurve(Curve.bezier([(first, v), (last, v)], domain=span))
    start, stop = map(placement.keep_vertex, find_end_vertices(edge))
    number = placement.index.edges.find_number(edge)
    return EdgePiece(number, (span[0], span[1]), (start, stop), pcurves=(pcurve,))


def _plan_seam(placement: StripPlacement, held: HeldEdge, corner: PlannedVertex) -> NewEdge:
    """Plan the seam of a closed blend, from the vertex of the held edge to the start of the other rail."""
    low, high = placement.domain
    section, vertex = placement.strip.locate_section(low), placement.keep_vertex(held.vertices[0])
    pcurve = placement.plan_pcurve(section.make_pcurve(high), section.make_pcurve(low))
    vertices = (vertex, corner) if held.side == 0 else (corner, vertex)
    return NewEdge("seam", section.curve, section.span, vertices, (pcurve,))


def _plan_end(placement: StripPlacement, held: HeldEdge, end: int) -> StripEnd:
    """End the blend on the face across from its start (``end`` 0) or stop (1), from the end of the held edge."""
    try:
        return _end_on_face(placement, held, end)
    except (SizeError, TopologyError, GeometryError) as error:
        raise BlendEndError(end, error) from error


def _end_on_face(placement: StripPlacement, held: HeldEdge, end: int) -> StripEnd:
    joint, index, free = placement.joint, placement.index, 1 - held.side
    vertex, corner_vertex = joint.spine.vertices[end], held.vertices[end]
    between = held.end_edges[end]
    target = joint.read_end_face(end)
    if target is None:
        raise TopologyError("there is not one face across from the end of the edge")
    number, face = placement.number_face(target.face), placement.face_numbers[free]
    shared = [
        edge
        for edge in index.edges_at_vertex(vertex)
        if {index.faces.find_number(one) for one in index.faces_at_edge(edge)} == {number, face}
    ]
    if len(shared) != 1 or between not in ShapeIndex(target.face, TopAbs_EDGE):
        raise TopologyError("the face at the end of the edge does not share exactly one edge with each side")
    uv, point = find_vertex_uv(corner_vertex, target.face), locate_vertex(corner_vertex)
    start = EndCurveStart(end, placement.locate_edge_parameter(float(end)), uv, point)
    cut = solve_end_curve(placement.strip, target.face_primary, start)
    off = float(np.linalg.norm(cut.ends[held.side] - point))
    if off > 10 * max(BRep_Tool.Tolerance_s(corner_vertex), CONFUSION):
        raise TopologyError(f"the held edge does not end on the face across: the blend misses its end by {off:.2g} mm")
    planned, found = plan_end_edge(placement, cut, number)
    corners = [found[0], found[1]]
    corners[held.side] = placement.keep_vertex(corner_vertex)
    edge = NewEdge(planned.role, planned.curve, planned.span, (corners[0], corners[1]), planned.pcurves)
    trim = EdgeTrim(placement, end, shared[0], vertex, corners[free], (joint.sides[free].face, target.face))
    is_forward = _starts_at_side_1(between if held.side == 0 else shared[0], target.face, vertex)
    plan = FacePlan(number, {index.edges.find_number(between): ()}, (EdgeUse(edge, forward=is_forward),))
    vertices, parameters = (corners[0], corners[1]), cut.rail_parameters
    return StripEnd((EdgeUse(edge),), vertices, parameters, placement.keep_vertex(vertex), (trim,), (plan,))


def _starts_at_side_1(edge: TopoDS_Edge, face: TopoDS_Face, vertex: TopoDS_Vertex) -> bool:
    """Whether the boundary of a FORWARD face comes along its edge with side 1 to a vertex of the blended edge."""
    use = next(use for use in explore_subshapes(face, TopAbs_EDGE) if use.IsSame(edge))
    return bool(find_end_vertices(use)[1].IsSame(vertex))
