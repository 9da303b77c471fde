"""Flat caps: planar faces across the edge, for blends that end where no face crosses the edge.

A cap is bounded by the end curve X of the blend and by a wall on each side, from the corners of the blend down to the
edge: a curve inside the side face, or the part of an edge of the input that lies in the cap's plane.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_Plane
from OCP.GeomAPI import GeomAPI
from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.blends.contacts.contact_solver import project_to_intersection, solve_damped_newton
from cqblend.brep.rewrite.edge_accuracy import TOLERANCE_MARGIN
from cqblend.brep.rewrite.end_curve import (
    fit_solved_curve,
    get_end_parameters,
    make_end_edge,
    make_shared_edge,
    solve_end_curve,
)
from cqblend.brep.rewrite.end_on_face import BlendEnd
from cqblend.brep.rewrite.neighbour_edges import EdgeTrim, find_edge_in_plane, project_to_edge
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
from cqblend.surfaces.primaries import Array, LocalFrame, Plane, normalise_vectors

if TYPE_CHECKING:
    from cqblend.brep.rewrite.shell_edit import ShellEdit


def end_in_cap(surgery: ShellEdit, end: int, t: float) -> BlendEnd:
    """End the blend in a flat cap in the plane across the edge at t.

    Raises
    ------
    TopologyError
        If the blend does not meet that plane, or the edge's vertex is too far from the surfaces for a cap there.
    """
    at = np.array([t])
    stations = project_to_intersection(
        surgery.sides, surgery.spine.locate_stations(at, surgery.sides), surgery.spine.length
    )
    foot, tau = stations.point[0], stations.direction[0]
    first, second = (row(at)[0] for row in surgery.rail_curves)
    loop = np.cross(second - first, foot - first) @ tau  # X runs ahead in the boundary of the cap at the far end
    normal = tau * (np.sign(loop) * (1.0 if end else -1.0))
    across = (second - first) - (second - first) @ tau * tau
    x = normalise_vectors(across)
    plane = Plane(LocalFrame(foot, np.array([x, np.cross(normal, x), normal])))
    surface = Geom_Plane(gp_Ax3(gp_Pnt(*foot.tolist()), gp_Dir(*normal.tolist()), gp_Dir(*x.tolist())))
    cap = make_bare_face(surface)
    curve = solve_end_curve(surgery, plane, foot, np.zeros(2), t)
    edge, corners = make_end_edge(surgery, curve, cap)
    vertex = _make_foot_vertex(surgery, end, t, foot)
    walls: tuple[list[TopoDS_Edge], list[TopoDS_Edge]] = ([], [])
    bounds, cuts = [], []
    for i, (side, corner) in enumerate(zip(surgery.sides, corners, strict=True)):
        border = (
            find_edge_in_plane(side.face, vertex, surgery.spine.edges, tau, locate_vertex(corner)) if t == end else None
        )
        if border is None:
            foot_uv = stations.uv[i], surgery.spine.evaluate_pcurves(at, side.face)
            walls[i].append(_make_cap_border(surgery, i, foot_uv, curve, plane, cap, (vertex, corner)))
            bounds += walls[i]
            continue
        piece, wall = _trim_to_corner(border, vertex, corner)
        attach_pcurves(piece, cap, GeomAPI.To2d_s(BRep_Tool.Curve_s(piece, 0.0, 0.0), surface.Pln()))
        bounds.append(wall)
        first, second = surgery.faces_at_edge(border)
        cuts.append(EdgeTrim(end, border, vertex, corner, (first, second), piece, side.face))
    uses = (
        [edge, reverse_edge(bounds[1]), bounds[0]] if end else [reverse_edge(edge), reverse_edge(bounds[0]), bounds[1]]
    )
    BUILDER.Add(cap, make_closed_wire(uses))
    return BlendEnd(edge, corners, get_end_parameters(curve), vertex, tuple(cuts), walls, cap)


def _trim_to_corner(edge: TopoDS_Edge, vertex: TopoDS_Vertex, corner: TopoDS_Vertex) -> tuple[TopoDS_Edge, TopoDS_Edge]:
    """Return the part of a FORWARD edge between its vertex and a corner: FORWARD, and from the vertex to the corner."""
    first, last = BRep_Tool.Range_s(edge)
    at, distance = project_to_edge(edge, corner)
    raise_vertex_tolerance(corner, TOLERANCE_MARGIN * distance)
    if find_end_vertices(edge)[0].IsSame(vertex):
        piece = make_trimmed_copy(edge, (vertex, corner), (first, at))
        return piece, piece
    piece = make_trimmed_copy(edge, (corner, vertex), (at, last))
    return piece, reverse_edge(piece)


def _make_foot_vertex(surgery: ShellEdit, end: int, t: float, foot: Array) -> TopoDS_Vertex:
    """Return the edge's own vertex if the cap stands there, else a new one on the edge."""
    if t == end:
        vertex = surgery.spine.vertices[end]
        if np.linalg.norm(locate_vertex(vertex) - foot) > BRep_Tool.Tolerance_s(vertex):
            raise TopologyError("the edge's vertex is too far from its faces for a blend to end there")
        return vertex
    on_edge = surgery.spine.evaluate_points(np.array([t]))[0]
    return make_vertex(foot, TOLERANCE_MARGIN * float(np.linalg.norm(on_edge - foot)))


def _make_cap_border(
    surgery: ShellEdit,
    i: int,
    foot_uv: tuple[Array, Array],
    end_curve: Curve,
    plane: Plane,
    cap: TopoDS_Face,
    vertices: tuple[TopoDS_Vertex, TopoDS_Vertex],
) -> TopoDS_Edge:
    """Make the edge in which side i meets the plane of a cap, from the edge point to corner i.

    ``foot_uv`` are the edge point's parameters on the primary, and, to a tolerance, the face's own.
    """
    side, (uv, on_edge) = surgery.sides[i], foot_uv
    t, corner = end_curve(np.array([float(i)]))[0, [0]], end_curve(np.array([float(i)]))[0, 4:]
    foot = plane.frame.origin
    start, stop = (
        side.unwrap_near(side.to_face_parameters(uv), on_edge),
        side.unwrap_near(surgery.rail_pcurves[i](t), on_edge),
    )
    chord, normal = corner - foot, plane.frame.axes[2]
    length = float(np.linalg.norm(chord))

    def solve_curve_points(s: Array) -> Array:
        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            jet = side.face_primary.jet(x)
            offset = jet[0] - foot
            residual = np.stack([offset @ normal, offset @ chord / length - s * length], -1)
            jacobian = np.stack([np.stack([rate @ normal, rate @ chord / length], -1) for rate in jet[1:3]], -1)
            return residual, jacobian, np.linalg.norm(jet[1:3], axis=2).T

        x, good = solve_damped_newton(evaluate_system, start + s[:, None] * (stop - start), length, length)
        if not good.all():
            raise TopologyError("a flat cap at the end of the edge does not cross its faces cleanly")
        point = side.face_primary.jet(x)[0]
        return np.column_stack([x, (point - foot) @ plane.frame.axes[:2].T, point])

    def measure_error(values: Array, _: Array) -> float:
        on_face, on_plane = side.face_primary.jet(values[:, :2])[0], plane.jet(values[:, 2:4])[0]
        return float(max(np.abs(p - values[:, 4:]).max() for p in (on_face, on_plane)))

    return make_shared_edge(fit_solved_curve(solve_curve_points, measure_error), vertices, side.face, cap)


def make_edge_remainders(
    surgery: ShellEdit, low: BlendEnd, high: BlendEnd, caps: tuple[float | None, float | None]
) -> dict[int, list[TopoDS_Edge]]:
    """Return what remains, before the first cap and after the last, of every edge that the blend replaces."""
    spine = surgery.spine
    stops = np.append(0.0, np.cumsum([table.length for table in spine.tables])) / spine.length
    first, last = caps[0] or 0.0, 1.0 if caps[1] is None else caps[1]
    left: dict[int, list[TopoDS_Edge]] = {}
    for edge, start, stop in zip(spine.edges, stops[:-1], stops[1:], strict=True):
        if stop <= first or start >= last:
            continue
        pieces = left.setdefault(surgery.edge_index.find_number(edge), [])
        for t, ending, before in ((first, low, True), (last, high, False)):
            if start < t < stop:
                at = float(spine.locate_parameters(np.array([t]))[1][0])
                head = before == (edge.Orientation() == orient_forward(edge).Orientation())
                span, own = BRep_Tool.Range_s(edge), find_end_vertices(TopoDS.Edge_s(orient_forward(edge)))
                pieces.append(
                    make_trimmed_copy(edge, (own[0], ending.vertex), (span[0], at))
                    if head
                    else make_trimmed_copy(edge, (ending.vertex, own[1]), (at, span[1]))
                )
    return left
