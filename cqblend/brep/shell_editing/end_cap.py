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
from OCP.Geom import Geom_Plane
from OCP.GeomAPI import GeomAPI
from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.blends.contacts.contact_solver import Stations, project_to_intersection
from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.brep.selection.edge_ends import find_edge_in_plane
from cqblend.brep.shell_editing.blend_placement import BlendPlacement
from cqblend.brep.shell_editing.end_curve import (
    EndCurveStart,
    fit_solved_curve,
    get_end_parameters,
    make_end_edge,
    make_shared_edge,
    solve_end_curve,
)
from cqblend.brep.shell_editing.face_edits import BlendEnd, CapStations, EdgeTrim
from cqblend.brep.shell_editing.neighbour_edges import project_to_edge
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import (
    BUILDER,
    attach_pcurves,
    find_end_vertices,
    locate_vertex,
    make_bare_face,
    make_closed_wire,
    make_trimmed_copy,
    make_vertex,
    orient_forward,
    raise_vertex_tolerance,
    reverse_edge,
)
from cqblend.errors import TopologyError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.quadrics import Plane
from cqblend.surfaces.vectors import LocalFrame, normalise_vectors


@dataclass(frozen=True)
class _FlatCap:
    """A cap whose boundary is still to be made: its place across the edge at t."""

    t: float
    stations: Stations  # one, projected to the intersection of the support surfaces: the cap's foot on the edge
    plane: Plane  # origin at the foot
    occ_plane: Geom_Plane
    face: TopoDS_Face  # on the plane, without a boundary

    @property
    def foot(self) -> Array:
        """The point of the edge in the cap's plane."""
        return self.stations.points[0]


def end_in_cap(placement: BlendPlacement, end: int, t: float) -> BlendEnd:
    """End the blend in a flat cap in the plane across the edge at t.

    Raises
    ------
    TopologyError
        If the blend does not meet that plane, or the edge's vertex is too far from the surfaces for a cap there.
    """
    cap = _place_cap(placement, end, t)
    curve = solve_end_curve(placement.blend.surface, cap.plane, EndCurveStart(t, np.zeros(2), cap.foot))
    edge, corners = make_end_edge(placement.blend_face, curve, cap.face)
    vertex = _make_foot_vertex(placement, end, t, cap.foot)
    inner_borders: list[tuple[TopoDS_Edge, ...]] = []
    borders, trims = [], []
    for i, (side, corner) in enumerate(zip(placement.sides, corners, strict=True)):
        tangent, spine_edges = cap.stations.tangents[0], placement.spine.edges
        edge_in_plane = (
            find_edge_in_plane(side.face, vertex, spine_edges, tangent, locate_vertex(corner)) if t == end else None
        )
        if edge_in_plane is None:
            border = _make_cap_border(placement, i, cap, curve, (vertex, corner))
            inner_borders.append((border,))
        else:
            piece, border = _trim_to_corner(edge_in_plane, vertex, corner)
            attach_pcurves(piece, cap.face, GeomAPI.To2d_s(BRep_Tool.Curve_s(piece, 0.0, 0.0), cap.occ_plane.Pln()))
            inner_borders.append(())
            first, second = placement.faces_at_edge(edge_in_plane)
            trims.append(EdgeTrim(end, edge_in_plane, vertex, corner, (first, second), piece, side.face))
        borders.append(border)
    uses = (
        [edge, reverse_edge(borders[1]), borders[0]]
        if end
        else [reverse_edge(edge), reverse_edge(borders[0]), borders[1]]
    )
    face = TopoDS.Face_s(cap.face.EmptyCopied())
    BUILDER.Add(face, make_closed_wire(uses))
    return BlendEnd(
        edge,
        corners,
        get_end_parameters(curve),
        vertex,
        tuple(trims),
        cap_borders=(inner_borders[0], inner_borders[1]),
        cap_face=face,
    )


def _place_cap(placement: BlendPlacement, end: int, t: float) -> _FlatCap:
    """Return the plane across the edge at t, its normal out of the solid."""
    at = np.array([t])
    stations = project_to_intersection(
        placement.sides, placement.spine.locate_stations(at, placement.sides), placement.spine.length
    )
    foot, tangent = stations.points[0], stations.tangents[0]
    first, second = (row(at)[0] for row in placement.rail_curves)
    # The sense in which the end curve and the foot run around the tangent: at the far end, the end curve is FORWARD in
    # the boundary of the cap.
    turn = np.cross(second - first, foot - first) @ tangent
    normal = tangent * (np.sign(turn) * (1.0 if end else -1.0))
    chord_in_plane = (second - first) - (second - first) @ tangent * tangent
    x = normalise_vectors(chord_in_plane)
    plane = Plane(LocalFrame(foot, np.array([x, np.cross(normal, x), normal])))
    occ_plane = Geom_Plane(gp_Ax3(gp_Pnt(*foot.tolist()), gp_Dir(*normal.tolist()), gp_Dir(*x.tolist())))
    return _FlatCap(t, stations, plane, occ_plane, make_bare_face(occ_plane))


def _trim_to_corner(edge: TopoDS_Edge, vertex: TopoDS_Vertex, corner: TopoDS_Vertex) -> tuple[TopoDS_Edge, TopoDS_Edge]:
    """Return the part of a FORWARD edge between its vertex and a corner: FORWARD, and from the vertex to the corner."""
    first, last = BRep_Tool.Range_s(edge)
    at, distance = project_to_edge(edge, corner)
    raise_vertex_tolerance(corner, SHELL_EDIT_TOLERANCES.deviation_margin * distance)
    if find_end_vertices(edge)[0].IsSame(vertex):
        piece = make_trimmed_copy(edge, (vertex, corner), (first, at))
        return piece, piece
    piece = make_trimmed_copy(edge, (corner, vertex), (at, last))
    return piece, reverse_edge(piece)


def _make_foot_vertex(placement: BlendPlacement, end: int, t: float, foot: Array) -> TopoDS_Vertex:
    """Return the edge's own vertex if the cap stands there, else a new one on the edge."""
    if t == end:
        vertex = placement.spine.vertices[end]
        if np.linalg.norm(locate_vertex(vertex) - foot) > BRep_Tool.Tolerance_s(vertex):
            raise TopologyError("the edge's vertex is too far from its faces for a blend to end there")
        return vertex
    on_edge = placement.spine.evaluate_points(np.array([t]))[0]
    return make_vertex(foot, SHELL_EDIT_TOLERANCES.deviation_margin * float(np.linalg.norm(on_edge - foot)))


def _make_cap_border(
    placement: BlendPlacement,
    i: int,
    cap: _FlatCap,
    end_curve: Curve,
    vertices: tuple[TopoDS_Vertex, TopoDS_Vertex],
) -> TopoDS_Edge:
    """Make the edge in which support face ``i`` meets the plane of a cap, from the foot on the edge to corner ``i``."""
    side, plane, foot = placement.sides[i], cap.plane, cap.foot
    edge_uv = placement.spine.evaluate_pcurves(np.array([cap.t]), side.face)  # the face's own, to the edge's tolerance
    at_corner = end_curve(np.array([float(i)]))
    t, corner = at_corner[0, [0]], at_corner[0, 4:]
    start, stop = (
        side.unwrap_near(side.to_face_parameters(cap.stations.uv[i]), edge_uv),
        side.unwrap_near(placement.rail_pcurves[i](t), edge_uv),
    )
    chord, normal = corner - foot, plane.frame.axes[2]
    length = float(np.linalg.norm(chord))

    def solve_curve_points(shares: Array) -> Array:
        """Return (u, v, x, y on the plane, point) at shares (n,) of the chord from foot to corner."""

        def evaluate_system(uv: Array) -> tuple[Array, Array, Array]:
            jet = side.face_primary.jet(uv)
            offset = jet[0] - foot
            residual = np.stack([offset @ normal, offset @ chord / length - shares * length], -1)
            jacobian = np.stack([np.stack([rate @ normal, rate @ chord / length], -1) for rate in jet[1:3]], -1)
            return residual, jacobian, np.linalg.norm(jet[1:3], axis=2).T

        uv, good = solve_damped_newton(evaluate_system, start + shares[:, None] * (stop - start), length, length)
        if not good.all():
            raise TopologyError("a flat cap at the end of the edge does not cross its faces cleanly")
        point = side.face_primary.jet(uv)[0]
        return np.column_stack([uv, (point - foot) @ plane.frame.axes[:2].T, point])

    def measure_error(values: Array, _: Array) -> float:
        """Return how far (mm) points are from their images on the support face and on the plane."""
        on_face, on_plane = side.face_primary.jet(values[:, :2])[0], plane.jet(values[:, 2:4])[0]
        return float(max(np.abs(p - values[:, 4:]).max() for p in (on_face, on_plane)))

    return make_shared_edge(fit_solved_curve(solve_curve_points, measure_error), vertices, side.face, cap.face)


def make_edge_remainders(
    placement: BlendPlacement, low: BlendEnd, high: BlendEnd, caps: CapStations
) -> Mapping[int, list[TopoDS_Edge]]:
    """Return what remains, before the first cap and after the last, of every edge that the blend replaces."""
    spine = placement.spine
    stops = np.append(0.0, np.cumsum([table.length for table in spine.tables])) / spine.length
    first, last = caps[0] or 0.0, 1.0 if caps[1] is None else caps[1]
    remainders: dict[int, list[TopoDS_Edge]] = {}
    for edge, start, stop in zip(spine.edges, stops[:-1], stops[1:], strict=True):
        if stop <= first or start >= last:
            continue
        pieces = remainders.setdefault(placement.edge_index.find_number(edge), [])
        for t, end, is_before_cap in ((first, low, True), (last, high, False)):
            if start < t < stop:
                at = float(spine.locate_parameters(np.array([t]))[1][0])
                keeps_first_part = is_before_cap == (edge.Orientation() == orient_forward(edge).Orientation())
                span, own = BRep_Tool.Range_s(edge), find_end_vertices(TopoDS.Edge_s(orient_forward(edge)))
                pieces.append(
                    make_trimmed_copy(edge, (own[0], end.spine_vertex), (span[0], at))
                    if keeps_first_part
                    else make_trimmed_copy(edge, (end.spine_vertex, own[1]), (at, span[1]))
                )
    return remainders
