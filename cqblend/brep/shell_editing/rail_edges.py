"""The edges of a blend's rails, and the trimming of the support faces at them.

The 3D curve of a rail edge is the blend surface's own boundary row of poles. Where a rail crosses a seam of its face,
it is split there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from OCP.Geom2d import Geom2d_Curve, Geom2d_Line
from OCP.gp import gp_Dir2d, gp_Pnt2d
from OCP.TopoDS import TopoDS_Edge, TopoDS_Vertex

from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets
from cqblend.brep.conversion import spline_arrays
from cqblend.brep.shell_editing.blend_placement import BlendPlacement
from cqblend.brep.shell_editing.face_edits import FaceEdit, SpineRemoval
from cqblend.brep.shell_editing.periodic_seam_cuts import SeamCrossings, cut_seams
from cqblend.brep.shell_editing.realigned_spheres import make_realigned_face
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import attach_pcurves, find_seam_edges, make_edge, make_vertex, reverse_edge
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.roots import find_sign_changes


@dataclass(frozen=True)
class RailSpan:
    """The part of one rail that bounds the blend face: its range of t, and the vertices at both ends.

    Where the blend ends in flat caps, ``cap_borders`` are their borders in the support face at the low and at the high
    end, FORWARD from the blended edge to the rail.
    """

    span: tuple[float, float]
    vertices: tuple[TopoDS_Vertex, TopoDS_Vertex]
    cap_borders: tuple[tuple[TopoDS_Edge, ...], tuple[TopoDS_Edge, ...]] = ((), ())


def trim_at_rail(
    placement: BlendPlacement, i: int, part: RailSpan, removed: SpineRemoval
) -> tuple[list[TopoDS_Edge], FaceEdit]:
    """Make the edges of rail ``i`` (0 or 1), split at seams; return them and the edit that trims the support face.

    Raises
    ------
    SizeError
        If the rail passes beyond the end of the face.
    """
    side, sphere, face, span = placement.sides[i], placement.realigned[i], placement.support_faces[i], part.span
    crossings = find_seam_crossings(placement, i)
    crossings = crossings[(crossings > span[0]) & (crossings < span[1])]
    stops = np.concatenate([span[:1], crossings, span[1:]]).tolist()
    between = [make_vertex(point) for point in placement.rail_curves[i](crossings)]
    vertices = [part.vertices[0], *between, part.vertices[1]]
    rail_edges = [
        make_rail_edge(placement, i, (vertices[k], vertices[k + 1]), (stops[k], stops[k + 1]))
        for k in range(len(stops) - 1)
    ]
    runs_with_boundary = (side.outward > 0) == (i == 0)
    path = [*part.cap_borders[0], *rail_edges, *(reverse_edge(edge) for edge in part.cap_borders[1])]
    uses = path if runs_with_boundary else [reverse_edge(edge) for edge in reversed(path)]
    ribbon = placement.blend.ribbons[i]
    if sphere is not None:
        into_blend = _evaluate_rail(ribbon, np.array([span[0]]))[1][0]
        return rail_edges, FaceEdit(face, replacement_face=make_realigned_face(sphere, uses[0], into_blend))
    if part.vertices[0].IsSame(part.vertices[1]):  # a closed rail may cross a seam where it starts
        crossings, between = np.array(stops[:-1]), vertices[:-1]
    points, directions = _evaluate_rail(ribbon, crossings) if between else (np.empty((0, 3)), np.empty((0, 3)))
    seam_pieces = cut_seams(
        side.face, placement.edge_index, SeamCrossings(between, points, directions), removed.vertices
    )
    return rail_edges, FaceEdit(face, tuple(uses), {**removed.remainders, **seam_pieces})


def make_rail_edge(
    placement: BlendPlacement, i: int, vertices: tuple[TopoDS_Vertex, TopoDS_Vertex], span: tuple[float, float]
) -> TopoDS_Edge:
    """Make the edge of rail ``i`` over a span of t, with pcurves on the support face and on the blend face."""
    side, curve = placement.sides[i], placement.rail_pcurves[i]
    middle = curve(np.array([sum(span) / 2]))[0]
    shift = np.zeros(2)
    for axis, period in enumerate(side.face_primary.periods):
        if period is not None:
            periods = np.floor((middle[axis] - side.bounds[axis, 0]) / period + SHELL_EDIT_TOLERANCES.rail_end_at_seam)
            shift[axis] = -period * periods
    edge = make_edge(placement.occ_rail_curves[i], vertices, span)
    whole = span == placement.domain
    attach_pcurves(edge, side.face, _to_shifted_pcurve(curve if whole else curve.clip(*span), shift))
    attach_pcurves(edge, placement.blend_face, Geom2d_Line(gp_Pnt2d(0, i), gp_Dir2d(1, 0)))
    return edge


def find_seam_crossings(placement: BlendPlacement, i: int) -> Array:
    """Return where rail ``i`` crosses seams of its support face, in t, ascending; not at its ends."""
    side, curve, tolerance = placement.sides[i], placement.rail_pcurves[i], SHELL_EDIT_TOLERANCES.rail_end_at_seam
    found = [np.empty(0)]
    if find_seam_edges(side.face):
        coefs = curve.coefs
        for axis, period in enumerate(side.face_primary.periods):
            if period is None:
                continue
            weight = coefs[:, 2] if curve.rational else np.ones_like(coefs[:, 0])
            value = coefs[:, axis] / weight
            start = side.bounds[axis, 0]
            first, last = np.floor((value.min() - start) / period), np.ceil((value.max() - start) / period)
            for k in range(int(first), int(last) + 1):
                seam = start + k * period
                at_breaks = curve(curve.breaks)[:, axis] - seam
                found.append(curve.breaks[np.abs(at_breaks) < tolerance * period])
                column, root = find_sign_changes(coefs[:, axis] - seam * weight, 1e-14 * (1 + abs(seam)))
                found.append(curve.breaks[column] + root * np.diff(curve.breaks)[column])
    t = np.unique(np.concatenate(found))
    low, high = placement.domain
    t = t[(t > low + tolerance * (high - low)) & (t < high - tolerance * (high - low))]
    return t[np.append(True, np.diff(t) > tolerance * (high - low))] if len(t) else t


def _evaluate_rail(rail: Ribbon, t: Array) -> tuple[Array, Array]:
    """Return points and directions into the blend (n, 3) along a rail."""
    point, direction = dehomogenise_jets(np.stack([jet(t) for jet in rail.compose_jets()[:2]]))
    return point, direction


def _to_shifted_pcurve(curve: Curve, shift: Array) -> Geom2d_Curve:
    """Return a parameter curve as an OCCT pcurve, shifted by whole periods."""
    degree, knots, poles, weights = curve.to_bspline()
    return spline_arrays.curve2d_from_arrays(degree, knots, poles + shift, weights)
