"""The planned boundary of a face as curves in its parameter plane: what each of them is, and where it is."""

from __future__ import annotations

from collections.abc import Hashable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from OCP.Bnd import Bnd_Box2d
from OCP.BndLib import BndLib_Add2dCurve
from OCP.BRep import BRep_Tool
from OCP.Geom2d import Geom2d_Line
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_REVERSED, TopAbs_WIRE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face

from cqblend.blends.network.blend_plan import EdgePiece, EdgeUse, FacePlan, KeptEdge, NewEdge, PlannedVertex
from cqblend.blends.network.face_arrangement import BoundaryCurve
from cqblend.blends.network.strip_surface import PlaneCurve
from cqblend.brep.measurement.bulk_curves import CurveEvaluator
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import explore_subshapes, find_end_vertices, orient_forward
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class BoundaryPart:
    """A use of an edge in the planned boundary of a face.

    ``number`` is that of the edge of the input, or 0 of a ``new`` edge; ``wire`` the index of the wire of the face that
    it was part of, None of a new edge. ``ends`` are the numbers of vertices of the input, or new vertices.
    """

    face: TopoDS_Face
    number: int
    wire: int | None
    span: tuple[float, float]
    ends: tuple[Hashable, Hashable]
    use: TopoDS_Edge | None = None  # whose pcurve it lies on, if its edge is not new
    edge: NewEdge | None = None
    pcurve: PlaneCurve | None = None

    @cached_property
    def evaluator(self) -> CurveEvaluator | None:
        """The pcurve of an edge of the input."""
        return None if self.use is None else CurveEvaluator(BRep_Tool.CurveOnSurface_s(self.use, self.face, 0.0, 0.0))

    def evaluate(self, t: Array) -> Array:
        """Return the parameters (n, 2) of the face at parameters (n,) of the edge."""
        if self.evaluator is not None:
            return self.evaluator(t)[0].T
        assert self.pcurve is not None
        return self.pcurve(t)

    @property
    def is_straight(self) -> bool:
        """Whether it is a straight line in the parameter plane."""
        if self.evaluator is not None:
            return self.evaluator.is_straight
        curve = self.pcurve
        return isinstance(curve, Curve) and curve.degree == 1 and len(curve.breaks) == 2 and not curve.rational

    @cached_property
    def box(self) -> Array:
        """Two corners (2, 2) of a box around it in the parameter plane."""
        low, high = sorted(self.span)
        if self.use is not None:
            curve = BRep_Tool.CurveOnSurface_s(self.use, self.face, 0.0, 0.0)
            if isinstance(curve, Geom2d_Line):
                return np.sort([curve.Value(low).Coord(), curve.Value(high).Coord()], axis=0)
            box = Bnd_Box2d()
            BndLib_Add2dCurve.Add_s(curve, low, high, 0.0, box)
            return np.array(box.Get()).reshape(2, 2)
        if isinstance(self.pcurve, Curve):
            spline = self.pcurve if self.pcurve.domain == (low, high) else self.pcurve.clip(low, high)
            points = spline.coefs[:, :2] / spline.coefs[:, 2:] if spline.rational else spline.coefs
            return np.stack([points.min(axis=(0, 2)), points.max(axis=(0, 2))])
        assert self.pcurve is not None
        extremes = np.arctan2(self.pcurve.arms[1], self.pcurve.arms[0])  # of either coordinate, every half turn
        turns = np.arange(np.floor((low - np.pi) / np.pi), np.ceil((high + np.pi) / np.pi) + 1)
        t = (extremes[:, None] + np.pi * turns).ravel()
        points = self.pcurve(np.concatenate([[low, high], t[(t > low) & (t < high)]]))
        return np.stack([points.min(axis=0), points.max(axis=0)])

    def to_curve(self, scale: Array) -> BoundaryCurve:
        """Return it as a curve, with the parameters times a scale (2,)."""
        return BoundaryCurve(
            partial(_scale_points, self, scale), self.span, self.ends, self.is_straight, new=self.wire is None
        )


def _scale_points(part: BoundaryPart, scale: Array, t: Array) -> Array:
    return part.evaluate(t) * scale


def list_boundary_parts(index: SolidIndex, plan: FacePlan) -> list[BoundaryPart]:
    """Return the boundary that a plan gives to a face of a solid, on the face's own surface and oriented FORWARD."""
    face = TopoDS.Face_s(orient_forward(index.faces[plan.number]))
    parts: list[BoundaryPart] = []
    old_uses: dict[int, tuple[TopoDS_Edge, int]] = {}
    for wire_number, wire in enumerate(explore_subshapes(face, TopAbs_WIRE)):
        for use in explore_subshapes(wire, TopAbs_EDGE):
            number = index.edges.find_number(use)
            old_uses.setdefault(number, (use, wire_number))
            for piece in plan.pieces.get(number, (KeptEdge(number),)):
                forward = use.Orientation() != TopAbs_REVERSED
                if isinstance(piece, NewEdge):
                    parts.append(_describe_new_edge(face, plan.number, EdgeUse(piece, forward)))
                else:
                    parts.append(_describe_old_edge(index, face, piece, use, wire_number))
    for planned in plan.added:
        if isinstance(planned.edge, NewEdge):
            parts.append(_describe_new_edge(face, plan.number, planned))
        else:
            use, wire_number = old_uses[planned.edge.number]
            forward = TopoDS.Edge_s(orient_forward(use))
            use = forward if planned.forward else TopoDS.Edge_s(forward.Reversed())
            parts.append(_describe_old_edge(index, face, planned.edge, use, wire_number))
    return parts


def _describe_old_edge(
    index: SolidIndex, face: TopoDS_Face, piece: EdgePiece | KeptEdge, use: TopoDS_Edge, wire: int
) -> BoundaryPart:
    """Return the part that an edge of the input, or a piece of it, is in the sense of a use."""
    if isinstance(piece, EdgePiece):
        span, ends = piece.span, (_name_vertex(piece.vertices[0]), _name_vertex(piece.vertices[1]))
    else:
        low, high = BRep_Tool.Range_s(use)
        span = (low, high)
        first, last = find_end_vertices(TopoDS.Edge_s(orient_forward(use)))
        ends = (index.vertices.find_number(first), index.vertices.find_number(last))
    if use.Orientation() == TopAbs_REVERSED:
        span, ends = span[::-1], ends[::-1]
    return BoundaryPart(face, piece.number, wire, span, ends, use)


def _describe_new_edge(face: TopoDS_Face, face_number: int, use: EdgeUse) -> BoundaryPart:
    """Return the part that a use of a new edge is."""
    edge = use.edge
    assert isinstance(edge, NewEdge)
    (pcurve,) = (one.curve for one in edge.pcurves if one.face == face_number)
    span, ends = edge.span, (_name_vertex(edge.vertices[0]), _name_vertex(edge.vertices[1]))
    if not use.forward:
        span, ends = span[::-1], ends[::-1]
    return BoundaryPart(face, 0, None, span, ends, edge=edge, pcurve=pcurve)


def _name_vertex(vertex: PlannedVertex) -> Hashable:
    """Return the number of a vertex of the input, or a new vertex itself."""
    return vertex.number or vertex


def measure_scale(face: TopoDS_Face, uv: Array) -> Array:
    """Return the lengths (2,) of the derivatives of a face's surface at parameters (2,), 1 where there are none."""
    point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    BRep_Tool.Surface_s(face).D1(*uv.tolist(), point, du, dv)
    lengths = np.array([du.Magnitude(), dv.Magnitude()])
    return np.where(lengths > 0, lengths, 1.0)


def locate_point(face: TopoDS_Face, uv: Array) -> tuple[float, float, float]:
    """Return the point of a face's surface at parameters (2,)."""
    point = BRep_Tool.Surface_s(face).Value(*uv.tolist())
    return point.X(), point.Y(), point.Z()


def find_close_pairs(parts: list[BoundaryPart], slack: Array) -> Iterator[tuple[int, int]]:
    """Yield pairs of parts, the first of them new, whose boxes meet elsewhere than at a common end.

    ``slack`` (2,) is how near two places in the parameter plane may be to count as one.
    """
    low, high = (np.array([part.box[k] for part in parts]) for k in (0, 1))
    for i, part in enumerate(parts):
        if part.wire is not None:
            continue
        near = ((low <= high[i] + slack) & (high >= low[i] - slack)).all(axis=1)
        for k in np.flatnonzero(near).tolist():
            is_known = k == i or (k < i and parts[k].wire is None)
            if not is_known and not _meet_at_end_alone(part, parts[k], slack):
                yield i, k


def _meet_at_end_alone(one: BoundaryPart, other: BoundaryPart, slack: Array) -> bool:
    """Whether two parts that share a vertex surely do not meet elsewhere."""
    common = set(one.ends) & set(other.ends)
    if not common:
        return False
    low, high = np.maximum(one.box[0], other.box[0]), np.minimum(one.box[1], other.box[1])
    if (high - low <= slack).all():
        return True
    if len(common) == 1 and one.is_straight and other.is_straight:
        steps = [np.diff(part.evaluate(np.array(part.span)), axis=0)[0] for part in (one, other)]
        cross = steps[0][0] * steps[1][1] - steps[0][1] * steps[1][0]
        sine = abs(cross) / (np.linalg.norm(steps[0]) * np.linalg.norm(steps[1]))
        return bool(sine > SHELL_EDIT_TOLERANCES.distinct_lines)
    return False
