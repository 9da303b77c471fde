"""Flat caps: planar faces across the edge, for blends that end where no face crosses the edge.

A cap is bounded by the end curve, in which the blend surface meets the cap's plane, and on each side by a border from a
corner of the blend down to the edge: a curve inside the support face, or the part of an edge of the input that lies in
the cap's plane.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopoDS import TopoDS, TopoDS_Edge

from cqblend.blends.contacts.contact_solver import Stations, project_to_intersection
from cqblend.blends.network.blend_plan import CapPlan, EdgePiece, EdgeUse, NewEdge, PlannedSurface, PlannedVertex
from cqblend.brep.selection.edge_ends import find_edge_in_plane
from cqblend.brep.shell_editing.end_curve import (
    EndCurveStart,
    plan_end_edge,
    plan_shared_edge,
    solve_border_in_plane,
    solve_end_curve,
)
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim, project_to_edge
from cqblend.brep.shell_editing.strip_end import StripEnd
from cqblend.brep.shell_editing.strip_placement import CapStations, StripPlacement
from cqblend.brep.topology import find_end_vertices, locate_vertex, orient_forward
from cqblend.errors import TopologyError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.vectors import LocalFrame, normalise_vectors


@dataclass(frozen=True)
class _FlatCap:
    """A cap whose boundary is still to be made: its place across the edge at t."""

    t: float
    stations: Stations  # one, projected to the intersection of the support surfaces: the cap's foot on the edge
    plane: Plane  # origin at the foot
    surface: PlannedSurface  # on the plane

    @property
    def foot(self) -> Array:
        """The point of the edge in the cap's plane."""
        return self.stations.points[0]


def end_in_cap(placement: StripPlacement, end: int, t: float) -> StripEnd:
    """End the blend in a flat cap in the plane across the edge at t.

    Raises
    ------
    TopologyError
        If the blend does not meet that plane, or the edge's vertex is too far from the surfaces for a cap there.
    """
    cap, joint = _place_cap(placement, end, t), placement.joint
    start = EndCurveStart(end, placement.locate_edge_parameter(t), np.zeros(2), cap.foot)
    cut = solve_end_curve(placement.strip, cap.plane, start)
    edge, corners = plan_end_edge(placement, cut, cap.surface)
    vertex, foot = joint.spine.vertices[end], _plan_foot_vertex(placement, end, t, cap.foot)
    inner_borders: list[tuple[EdgeUse, ...]] = []
    borders, trims = [], []
    for i, (side, corner) in enumerate(zip(joint.sides, corners, strict=True)):
        tangent = cap.stations.tangents[0]
        edge_in_plane = (
            find_edge_in_plane(side.face, vertex, joint.spine.edges, tangent, corner.point) if t == end else None
        )
        if edge_in_plane is None:
            border = EdgeUse(_plan_cap_border(placement, i, cap, cut.rail_parameters[i], (foot, corner)))
            inner_borders.append((border,))
        else:
            border = _trim_to_corner(placement, edge_in_plane, (foot, corner), cap)
            inner_borders.append(())
            first, second = placement.index.faces_at_edge(edge_in_plane)
            piece = border.edge if isinstance(border.edge, EdgePiece) else None
            trims.append(EdgeTrim(placement, end, edge_in_plane, vertex, corner, (first, second), piece, side.face))
        borders.append(border)
    use = EdgeUse(edge)
    boundary = (use, borders[1].reverse(), borders[0]) if end else (use.reverse(), borders[0].reverse(), borders[1])
    return StripEnd(
        (use,),
        corners,
        cut.rail_parameters,
        foot,
        tuple(trims),
        cap_borders=(inner_borders[0], inner_borders[1]),
        cap=CapPlan(cap.surface, boundary),
    )


def _place_cap(placement: StripPlacement, end: int, t: float) -> _FlatCap:
    """Return the plane across the edge at t, its normal out of the solid."""
    at, joint = np.array([t]), placement.joint
    stations = project_to_intersection(joint.sides, joint.spine.locate_stations(at, joint.sides), joint.spine.length)
    foot, tangent = stations.points[0], stations.tangents[0]
    at_strip = np.array([placement.locate_edge_parameter(t)])
    first, second = (row(at_strip)[0] for row in placement.rail_curves)
    # The sense in which the end curve and the foot run around the tangent: at the far end, the end curve is FORWARD in
    # the boundary of the cap.
    turn = np.cross(second - first, foot - first) @ tangent
    normal = tangent * (np.sign(turn) * (1.0 if end else -1.0))
    chord_in_plane = (second - first) - (second - first) @ tangent * tangent
    x = normalise_vectors(chord_in_plane)
    plane = Plane(LocalFrame(foot, np.array([x, np.cross(normal, x), normal])))
    return _FlatCap(t, stations, plane, PlannedSurface(plane))


def _trim_to_corner(
    placement: StripPlacement, edge: TopoDS_Edge, vertices: tuple[PlannedVertex, PlannedVertex], cap: _FlatCap
) -> EdgeUse:
    """Return the use, from the foot of a cap to its corner, of the part of a FORWARD edge between these vertices."""
    first, last = BRep_Tool.Range_s(edge)
    at, distance = project_to_edge(edge, vertices[1])
    number, foot = placement.index.edges.find_number(edge), vertices[0]
    if placement.index.vertices.find_number(find_end_vertices(edge)[0]) == foot.number:
        return EdgeUse(EdgePiece(number, (first, at), vertices, (0.0, distance), cap.surface))
    return EdgeUse(EdgePiece(number, (at, last), vertices[::-1], (distance, 0.0), cap.surface), forward=False)


def _plan_foot_vertex(placement: StripPlacement, end: int, t: float, foot: Array) -> PlannedVertex:
    """Return the edge's own vertex if the cap stands there, else a new one on the edge."""
    spine = placement.joint.spine
    if t == end:
        vertex = spine.vertices[end]
        if np.linalg.norm(locate_vertex(vertex) - foot) > BRep_Tool.Tolerance_s(vertex):
            raise TopologyError("the edge's vertex is too far from its faces for a blend to end there")
        return placement.keep_vertex(vertex)
    on_edge = spine.evaluate_points(np.array([t]))[0]
    return PlannedVertex(foot, gap=float(np.linalg.norm(on_edge - foot)))


def _plan_cap_border(
    placement: StripPlacement,
    i: int,
    cap: _FlatCap,
    at_corner: float,
    vertices: tuple[PlannedVertex, PlannedVertex],
) -> NewEdge:
    """Plan the edge in which support face ``i`` meets the plane of a cap, from the foot on the edge to corner ``i``.

    The corner is at the parameter ``at_corner`` of the rail.
    """
    side, plane, foot = placement.joint.sides[i], cap.plane, cap.foot
    edge_uv = placement.joint.spine.evaluate_pcurves(
        np.array([cap.t]), side.face
    )  # the face's own, to the edge's tolerance
    corner = vertices[1].point
    start, stop = (
        side.unwrap_near(side.to_face_parameters(cap.stations.uv[i]), edge_uv),
        side.unwrap_near(placement.get_rail_pcurve(i)(np.array([at_corner])), edge_uv),
    )
    border = solve_border_in_plane(side, plane, (start, stop), (foot, corner))
    return plan_shared_edge("cap border", border, vertices, (placement.face_numbers[i], cap.surface))


def plan_edge_remainders(
    placement: StripPlacement, ends: tuple[StripEnd, StripEnd], caps: CapStations
) -> Mapping[int, tuple[EdgePiece, ...]]:
    """Return what remains, before the first cap and after the last, of every edge that the blend replaces."""
    spine, index = placement.joint.spine, placement.index
    stops = np.append(0.0, np.cumsum([table.length for table in spine.tables])) / spine.length
    first, last = caps[0] or 0.0, 1.0 if caps[1] is None else caps[1]
    remainders: dict[int, tuple[EdgePiece, ...]] = {}
    for edge, start, stop in zip(spine.edges, stops[:-1], stops[1:], strict=True):
        if stop <= first or start >= last:
            continue
        number = index.edges.find_number(edge)
        pieces = remainders.setdefault(number, ())
        for t, end, is_before_cap in ((first, ends[0], True), (last, ends[1], False)):
            if start < t < stop:
                at = float(spine.locate_parameters(np.array([t]))[1][0])
                keeps_first_part = is_before_cap == (edge.Orientation() == orient_forward(edge).Orientation())
                span, own = BRep_Tool.Range_s(edge), find_end_vertices(TopoDS.Edge_s(orient_forward(edge)))
                piece = (
                    EdgePiece(number, (span[0], at), (placement.keep_vertex(own[0]), end.spine_vertex))
                    if keeps_first_part
                    else EdgePiece(number, (at, span[1]), (end.spine_vertex, placement.keep_vertex(own[1])))
                )
                pieces = remainders[number] = (*pieces, piece)
    return remainders
