"""Read a side of a bridge: which face goes or is cut, and the closed rail on the faces that stay."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepTools import BRepTools, BRepTools_WireExplorer
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_ON, TopAbs_OUT, TopAbs_REVERSED, TopAbs_WIRE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Wire

from cqblend.blends.network.bridge_loops import LoopPiece, RailLoop
from cqblend.brep.conversion.pcurves import edge_to_curve
from cqblend.brep.conversion.spline_conversion import to_surface
from cqblend.brep.conversion.support_face import SupportFace, read_support_face
from cqblend.brep.selection.bridge_joins import CornerPlace, PieceEnd, find_joins
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.topology import explore_subshapes, find_end_vertices, orient_forward, reverse_edge
from cqblend.errors import InputError, SelectionError, TopologyError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.angles import unwrap_parameters


class GivenSide(NamedTuple):
    """A side of a bridge as it was given: a face, the edges of a closed wire, or both, or a face and a curve on it."""

    face: TopoDS_Face | None
    edges: tuple[TopoDS_Edge, ...] = ()
    curve: Curve | None = None


@dataclass(frozen=True)
class BridgeSide:
    """One side of a bridge.

    Attributes
    ----------
    loop
        The rail.
    supports
        The face that each piece of it lies on, which stays.
    edges
        The number of the edge that each piece takes the place of; 0 in an opening.
    vertices
        The number of the vertex at which each piece starts; 0 in an opening.
    gone
        The number of the face that goes; 0 if an opening is cut in one that stays.
    name
        What messages call it.
    tolerance
        The largest tolerance (mm) of the edges.
    """

    loop: RailLoop
    supports: tuple[SupportFace, ...]
    edges: tuple[int, ...]
    vertices: tuple[int, ...]
    gone: int
    name: str
    tolerance: float

    def list_supports(self, index: SolidIndex) -> tuple[int, ...]:
        """Return the number of the face that each piece lies on."""
        return tuple(index.faces.find_number(support.face) for support in self.supports)


@dataclass(frozen=True)
class SideReader:
    """Reads one side of a bridge on one body.

    The rail runs around the outward normal of what goes counter-clockwise from its first vertex; or from there the
    other way round, if it is to be reversed. ``name`` is what messages call the side, ``name_part`` returns the names
    of faces, edges and vertices in them.
    """

    index: SolidIndex
    name: str
    name_part: Callable[[TopoDS_Shape], str]
    is_reversed: bool

    @property
    def outward(self) -> float:
        """+1 where the bridge leaves to the left of the rail, seen from outside; -1 where to the right."""
        return -1.0 if self.is_reversed else 1.0

    def read(self, given: GivenSide) -> BridgeSide:
        """Read what was given.

        Raises
        ------
        SelectionError, InputError
            If the side is foreign to the body, or does not tell what goes.
        TopologyError
            If what goes is not bounded by one loop that a bridge can take the place of.
        """
        if given.curve is not None:
            return self._read_opening(given)
        numbers = {self.index.edges.find_number(edge) for edge in given.edges}
        if given.face is not None and not numbers:
            return self._read_border(self._find_face(given.face))
        if given.face is not None and 0 in numbers:
            return self._read_opening(given)
        return self._read_border(self._find_bounded_face(given, numbers))

    def _find_face(self, face: TopoDS_Face) -> TopoDS_Face:
        """Return a face of the body, as it is oriented there."""
        number = self.index.faces.find_number(face)
        if not number:
            raise SelectionError(f"the face of {self.name} is not one of the shape: pick it from the shape itself")
        return TopoDS.Face_s(self.index.faces[number])

    def _find_bounded_face(self, given: GivenSide, numbers: set[int]) -> TopoDS_Face:
        """Return the face of which some edges are the outer boundary."""
        if 0 in numbers:
            raise SelectionError(
                f"an edge of {self.name} is not one of the shape: pick it from the shape itself, or give the pair of a "
                "face and the wire on it"
            )
        faces = map(TopoDS.Face_s, self.index.faces) if given.face is None else [self._find_face(given.face)]
        find = self.index.edges.find_number
        found = [face for face in faces if set(map(find, _list_wire_edges(BRepTools.OuterWire_s(face)))) == numbers]
        if len(found) == 1:
            return found[0]
        if not found:
            raise SelectionError(
                f"the edges of {self.name} are not the outer boundary of a face, so that nothing tells what goes: give "
                "the face, or the pair of a face and a closed wire drawn on it"
            )
        first, second = map(self.name_part, found[:2])
        raise SelectionError(
            f"the edges of {self.name} are the outer boundary of two faces, {first} and {second}: give the one to go"
        )

    def _read_border(self, face: TopoDS_Face) -> BridgeSide:
        """Read a side whose face goes: its rail is the border of the faces beside it."""
        index = self.index
        holes = len(list(explore_subshapes(face, TopAbs_WIRE))) - 1
        if holes:
            raise TopologyError(
                f"the {self.name_part(face)} of {self.name} has {holes} hole{'s' * (holes > 1)}, which would be left "
                "open: fill it, or give the pair of the face and a closed wire on it"
            )
        uses = self._order_uses(face)
        beside = [self._find_other_face(use, face) for use in uses]
        curves = [edge_to_curve(use) for use in uses]
        supports = _read_supports(beside, curves)
        pieces = [
            LoopPiece(support, curve, _follow_pcurve(use, other, support, curve))
            for use, other, support, curve in zip(uses, beside, supports, curves, strict=True)
        ]
        starts = [find_end_vertices(use)[0] for use in uses]
        corners = [CornerPlace(vertex, self.name_part(vertex)) for vertex in starts]
        ends = [PieceEnd(*one) for one in zip(pieces, beside, uses, strict=True)]
        return BridgeSide(
            RailLoop(tuple(pieces), find_joins(ends, corners, self.outward), self.outward),
            tuple(supports),
            tuple(map(index.edges.find_number, uses)),
            tuple(map(index.vertices.find_number, starts)),
            index.faces.find_number(face),
            self.name,
            max(map(BRep_Tool.Tolerance_s, uses)),
        )

    def _order_uses(self, face: TopoDS_Face) -> list[TopoDS_Edge]:
        """Return the edges around a face in the order and the sense of the loop."""
        forward = TopoDS.Face_s(orient_forward(face))
        explorer = BRepTools_WireExplorer(BRepTools.OuterWire_s(forward), forward)
        uses = []
        while explorer.More():
            uses.append(TopoDS.Edge_s(explorer.Current()))
            explorer.Next()
        is_loop = len(uses) == len(list(explore_subshapes(face, TopAbs_EDGE)))
        if not is_loop or any(
            BRep_Tool.Degenerated_s(use) or sum(use.IsSame(other) for other in uses) > 1 for use in uses
        ):
            raise TopologyError(
                f"the {self.name_part(face)} of {self.name} meets itself at a seam or in a pole: its boundary is not "
                "one closed loop"
            )
        if (face.Orientation() == TopAbs_REVERSED) != self.is_reversed:
            return [reverse_edge(use) for use in reversed(uses)]
        return uses

    def _find_other_face(self, edge: TopoDS_Edge, face: TopoDS_Face) -> TopoDS_Face:
        """Return the face on the other side of an edge."""
        others = [other for other in self.index.faces_at_edge(edge) if not other.IsSame(face)]
        if len(others) != 1:
            raise TopologyError(f"{self.name_part(edge)} of {self.name} is not between two faces")
        return TopoDS.Face_s(others[0])

    def _read_opening(self, given: GivenSide) -> BridgeSide:
        """Read a side whose opening is cut in a face: its rail is a curve on that face."""
        if given.face is None:
            raise InputError(f"the curve of {self.name} is on no face: give the pair of a face and the curve")
        face = self._find_face(given.face)
        if given.curve is None:
            curves = self._order_curves(given.edges)
        else:
            curves = [given.curve if given.curve.dim == 3 else to_surface(face).compose(given.curve)]
        self._require_closed(curves)
        support = _read_supports([face] * len(curves), curves)[0]
        guides = [self._project_guide(curve, face, support) for curve in curves]
        if self._turns_clockwise(face, support, guides, curves) != self.is_reversed:
            turned = list(zip(reversed(guides), [curve.reverse() for curve in reversed(curves)], strict=True))
            guides = [(sum(curve.domain) - t[::-1], uv[::-1]) for (t, uv), curve in turned]
            curves = [curve for _, curve in turned]
        pieces = [LoopPiece(support, curve, guide) for curve, guide in zip(curves, guides, strict=True)]
        corners = [CornerPlace(None, f"corner {k} of the wire of {self.name}") for k in range(len(pieces))]
        joins = find_joins([PieceEnd(piece, face, None) for piece in pieces], corners, self.outward)
        loop, count = RailLoop(tuple(pieces), joins, self.outward), len(pieces)
        self._check_inside(face, support, loop)
        nothing, tolerance = (0,) * count, BRep_Tool.Tolerance_s(face)
        return BridgeSide(loop, (support,) * count, nothing, nothing, 0, self.name, tolerance)

    def _order_curves(self, edges: Sequence[TopoDS_Edge]) -> list[Curve]:
        """Return edges head to tail as curves."""
        curves = [edge_to_curve(edge) for edge in edges]
        ordered, waiting = curves[:1], curves[1:]
        while waiting:
            tail = ordered[-1](np.array(ordered[-1].domain))[1]
            ends = [curve(np.array(curve.domain)) for curve in waiting]
            gaps = np.array([np.linalg.norm(pair - tail, axis=1) for pair in ends])
            k, end = np.unravel_index(gaps.argmin(), gaps.shape)
            if gaps[k, end] > SELECT_TOLERANCES.wire_gap:
                raise InputError(f"the edges of {self.name} do not join to one closed wire", value=float(gaps.min()))
            ordered.append(waiting[k].reverse() if end else waiting[k])
            del waiting[k]
        return ordered

    def _require_closed(self, curves: Sequence[Curve]) -> None:
        """Raise InputError if curves head to tail do not close."""
        for before, after in pairwise([*curves, curves[0]]):
            gap = float(np.linalg.norm(before(np.array(before.domain))[1] - after(np.array(after.domain))[0]))
            if gap > SELECT_TOLERANCES.wire_gap:
                raise InputError(f"the wire of {self.name} is not closed: it has a gap of {gap:.3g} mm", value=gap)

    def _project_guide(self, curve: Curve, face: TopoDS_Face, support: SupportFace) -> tuple[Array, Array]:
        """Return parameters (k,) of a curve, and native parameters (k, 2) of the nearest points of a face's surface."""
        t = np.linspace(*curve.domain, SELECT_TOLERANCES.spine_samples)
        surface, uv, apart = BRep_Tool.Surface_s(face), np.empty((len(t), 2)), 0.0
        for k, point in enumerate(curve(t).tolist()):
            foot = GeomAPI_ProjectPointOnSurf(gp_Pnt(*point), surface)
            apart = max(apart, foot.LowerDistance() if foot.NbPoints() else np.inf)
            if apart > SELECT_TOLERANCES.wire_gap:
                raise InputError(
                    f"the wire of {self.name} is {apart:.3g} mm off the surface of {self.name_part(face)}: project it "
                    "onto the face first",
                    value=apart,
                )
            uv[k] = foot.LowerDistanceParameters()
        return t, unwrap_parameters(support.to_working_parameters(uv), support.primary.periods)

    def _turns_clockwise(
        self,
        face: TopoDS_Face,
        support: SupportFace,
        guides: Sequence[tuple[Array, Array]],
        curves: Sequence[Curve],
    ) -> bool:
        """Whether a closed wire on a face runs around its outward normal clockwise."""
        points = np.concatenate([curve(t) for curve, (t, _) in zip(curves, guides, strict=True)])
        uv = unwrap_parameters(np.concatenate([own for _, own in guides]), support.primary.periods)
        has_pole = any(map(BRep_Tool.Degenerated_s, explore_subshapes(face, TopAbs_EDGE)))
        if np.linalg.norm(uv[-1] - uv[0]) > np.ptp(uv, axis=0).max() / 2 and not has_pole:
            raise InputError(f"the wire of {self.name} runs all around its face, and cuts no opening in it")
        arms = points - points.mean(axis=0)
        area = np.cross(arms, np.roll(arms, -1, axis=0)).sum(axis=0)
        return bool(area @ (support.outward * support.primary.evaluate_normals(uv).sum(axis=0)) < 0)

    def _check_inside(self, face: TopoDS_Face, support: SupportFace, loop: RailLoop) -> None:
        """Raise InputError if an opening reaches the boundary of its face, or has a hole of it inside."""
        classifier = self.index.get_classifier(TopoDS.Face_s(orient_forward(face)), SELECT_TOLERANCES.face_boundary)
        outline = []
        for piece in loop.pieces:
            uv = piece.locate(np.linspace(0.0, piece.length, SELECT_TOLERANCES.border_samples)[:-1])
            outline.append(support.to_face_parameters(uv))
            states = [
                (classifier.Perform(gp_Pnt2d(*point.tolist())), support.is_at_seam(point))
                for point in support.wrap_to_window(outline[-1])
            ]
            if any(state == TopAbs_OUT or (state == TopAbs_ON and not at_seam) for state, at_seam in states):
                raise InputError(
                    f"the opening of {self.name} reaches the boundary of {self.name_part(face)}: make it smaller, "
                    "or move it"
                )
        polygon = unwrap_parameters(np.concatenate(outline), support.face_primary.periods)
        middle = polygon.mean(axis=0)
        for use in explore_subshapes(support.face, TopAbs_EDGE):
            if BRep_Tool.Degenerated_s(use) or BRep_Tool.IsClosed_s(use, support.face):
                continue
            pcurve, (first, last) = BRep_Tool.CurveOnSurface_s(use, support.face, 0.0, 0.0), BRep_Tool.Range_s(use)
            samples = np.linspace(first, last, SELECT_TOLERANCES.dihedral_samples).tolist()
            points = np.array([pcurve.Value(s).Coord() for s in samples])
            if _is_inside(polygon, support.unwrap_near(points, np.tile(middle, (len(points), 1)))).any():
                raise InputError(
                    f"the opening of {self.name} swallows {self.name_part(use)} of a hole in {self.name_part(face)}: "
                    "leave the hole outside"
                )


def _list_wire_edges(wire: TopoDS_Wire) -> list[TopoDS_Edge]:
    """Return the edges of a wire that have a length."""
    return [TopoDS.Edge_s(edge) for edge in explore_subshapes(wire, TopAbs_EDGE) if not BRep_Tool.Degenerated_s(edge)]


def _read_supports(faces: Sequence[TopoDS_Face], curves: Sequence[Curve]) -> list[SupportFace]:
    """Return the support face of each piece, one for all pieces on a face."""
    supports: list[SupportFace] = []
    for k, face in enumerate(faces):
        known = next((supports[i] for i in range(k) if faces[i].IsSame(face)), None)
        if known is None:
            own = [curve for other, curve in zip(faces, curves, strict=True) if other.IsSame(face)]
            points = np.concatenate([one(np.linspace(*one.domain, SELECT_TOLERANCES.spine_samples)) for one in own])
            known = read_support_face(face, points, edge_is_circular=len(own) == len(curves))
        supports.append(known)
    return supports


def _follow_pcurve(use: TopoDS_Edge, face: TopoDS_Face, support: SupportFace, curve: Curve) -> tuple[Array, Array]:
    """Return parameters (k,) of an edge use as a curve, and native parameters (k, 2) near to it, from its pcurve."""
    own = next(other for other in explore_subshapes(orient_forward(face), TopAbs_EDGE) if other.IsSame(use))
    pcurve = BRep_Tool.CurveOnSurface_s(TopoDS.Edge_s(own), support.face, 0.0, 0.0)
    t = np.linspace(*curve.domain, SELECT_TOLERANCES.spine_samples)
    low, high = BRep_Tool.Range_s(use)
    at = low + (t - t[0]) / (t[-1] - t[0]) * (high - low)
    if use.Orientation() == TopAbs_REVERSED:
        at = at[::-1]
    uv = np.array([pcurve.Value(one).Coord() for one in at.tolist()])
    working = unwrap_parameters(support.to_working_parameters(uv), support.primary.periods)
    return t, working


def _is_inside(polygon: Array, points: Array) -> Array:
    """Whether points (n, 2) are inside a polygon (m, 2), by its winding."""
    arms = polygon[None] - points[:, None]
    following = np.roll(arms, -1, axis=1)
    cross = arms[..., 0] * following[..., 1] - arms[..., 1] * following[..., 0]
    return np.asarray(np.abs(np.arctan2(cross, (arms * following).sum(axis=-1)).sum(axis=1)) > np.pi)
