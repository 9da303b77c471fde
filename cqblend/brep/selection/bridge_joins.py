"""How the closed rail of a bridge passes from one piece to the next, and in which direction the bridge leaves there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.blends.network.bridge_loops import LoopJoin, LoopPiece
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.topology import explore_subshapes, find_end_vertices, is_among, orient_forward
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide
from cqblend.surfaces.vectors import normalise_vectors


class PieceEnd(NamedTuple):
    """A piece of a loop, the face that it lies on, and the edge that it is, if it is one."""

    piece: LoopPiece
    face: TopoDS_Face
    edge: TopoDS_Edge | None


class CornerPlace(NamedTuple):
    """Where two pieces meet: at a vertex of the body, if it is one; ``name`` is what messages call it."""

    vertex: TopoDS_Vertex | None
    name: str


class _Arrival(NamedTuple):
    """A loop at one end of a piece: tangent, outward normal, and the direction away from the face that stays."""

    point: Array
    tangent: Array
    normal: Array
    away: Array
    curvature: Array


def find_joins(pieces: Sequence[PieceEnd], places: Sequence[CornerPlace], outward: float) -> tuple[LoopJoin, ...]:
    """Return the joins of a loop at the places where its pieces start.

    ``outward`` is that of :class:`cqblend.blends.network.bridge_loops.RailLoop`.

    Raises
    ------
    GeometryError
        If two faces that stay have no direction in common in which a bridge can leave both of them.
    """
    edges = [one.edge for one in pieces if one.edge is not None]
    joins = []
    for k, (after, place) in enumerate(zip(pieces, places, strict=True)):
        before = pieces[k - 1]
        first, second = _arrive(before.piece, 1, outward), _arrive(after.piece, 0, outward)
        if before.face.IsSame(after.face):
            joins.append(_join_on_face(first, second, place.name))
            continue
        common = None if place.vertex is None else _find_common_edge(before.face, after.face, place.vertex, edges)
        extension = None if common is None or place.vertex is None else _extend_edge(common, place.vertex)
        joins.append(_join_faces(first, second, extension, place.name))
    return tuple(joins)


def _arrive(piece: LoopPiece, end: int, outward: float) -> _Arrival:
    """Evaluate a loop where a piece starts (``end`` 0) or stops (1)."""
    curve, s = piece.curve, np.array([piece.length * end])
    t = np.array([curve.domain[end]])
    side: BreakSide = "left" if end else "right"
    point, rate, bend = curve.jet(t, 2, side=side)[:, 0]
    tangent = normalise_vectors(rate)
    curvature = (bend - (bend @ tangent) * tangent) / (rate @ rate)
    normal = piece.support.outward * piece.support.primary.evaluate_normals(piece.locate(s))[0]
    return _Arrival(point, tangent, normal, normalise_vectors(outward * np.cross(normal, tangent)), curvature)


def _join_on_face(first: _Arrival, second: _Arrival, name: str) -> LoopJoin:
    """Return the join of two pieces on one face."""
    turn = _measure_angle(first.tangent, second.tangent)
    if turn > SELECT_TOLERANCES.smooth_angle:
        return LoopJoin("sharp", _leave_straight(first.away + second.away), on_edge=True, name=name)
    jump = np.linalg.norm(second.curvature - first.curvature)
    size = max(np.linalg.norm(first.curvature), np.linalg.norm(second.curvature))
    bends = jump > SELECT_TOLERANCES.bend * size or turn > SELECT_TOLERANCES.parallel_angle
    return LoopJoin("through", bends=bool(bends), name=name)


def _join_faces(first: _Arrival, second: _Arrival, extension: Array | None, name: str) -> LoopJoin:
    """Return the join of two pieces on different faces, with the edge between them, extended, if there is one."""
    bend = _measure_angle(first.normal, second.normal)
    turn = _measure_angle(first.tangent, second.tangent)
    jets, middle = extension, first.away + second.away
    if jets is None and bend > SELECT_TOLERANCES.smooth_angle:
        line = np.cross(first.normal, second.normal)
        jets = _leave_straight(line * np.sign(line @ middle))
    elif jets is None:
        jets = _leave_straight(middle)
    if not min(jets[0] @ first.away, jets[0] @ second.away) > 0:
        raise GeometryError(
            f"at {name}, the two faces that stay have no direction in common in which a bridge can leave both",
            shape=name,
        )
    if extension is not None and max(bend, turn) <= SELECT_TOLERANCES.smooth_angle:
        return LoopJoin("smooth", jets, on_edge=True, roughness=bend, name=name)
    return LoopJoin("sharp", jets, on_edge=extension is not None, name=name)


def _leave_straight(direction: Array) -> Array:
    """Return the first three derivatives (3, 3) of a straight line in a direction."""
    return np.stack([normalise_vectors(direction), np.zeros(3), np.zeros(3)])


def _measure_angle(one: Array, other: Array) -> float:
    """Return the angle (rad) between two unit vectors (3,)."""
    return float(np.arctan2(np.linalg.norm(np.cross(one, other)), one @ other))


def _find_common_edge(
    first: TopoDS_Face, second: TopoDS_Face, vertex: TopoDS_Vertex, loop: Sequence[TopoDS_Edge]
) -> TopoDS_Edge | None:
    """Return the edge between two faces that leaves their loop at a vertex; None if there is none."""
    others = list(explore_subshapes(second, TopAbs_EDGE))
    for edge in explore_subshapes(first, TopAbs_EDGE):
        if is_among(edge, others) and not is_among(edge, loop) and is_among(vertex, find_end_vertices(edge)):
            return TopoDS.Edge_s(edge)
    return None


def _extend_edge(edge: TopoDS_Edge, vertex: TopoDS_Vertex) -> Array:
    """Return the first three derivatives (3, 3), by length, of an edge that is extended beyond a vertex."""
    curve, (first, last) = BRep_Tool.Curve_s(edge, 0.0, 0.0), BRep_Tool.Range_s(edge)
    starts = find_end_vertices(TopoDS.Edge_s(orient_forward(edge)))[0].IsSame(vertex)
    t, sign = (first, -1.0) if starts else (last, 1.0)
    a, b, c = (np.array(curve.DN(t, k).Coord()) for k in (1, 2, 3))
    speed = float(np.linalg.norm(a))
    tangent = a / speed
    second = (b - (b @ tangent) * tangent) / speed**2
    slowing = float(b @ tangent) / speed**2
    third = (c - (c @ tangent) * tangent) / speed**3 - 3 * slowing * second - (second @ second) * tangent
    return np.stack([sign * tangent, second, sign * third])
