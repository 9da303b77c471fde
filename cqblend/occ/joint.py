"""What is selected: an edge between two faces of a solid, checked, measured and read into primaries.

A joint is the input of the whole pipeline in :mod:`cqblend.edges`: which solid, which edges, which faces on which side,
and the questions about them that only the topology can answer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.gp import gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_IN, TopAbs_ON, TopAbs_OUT, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex

from cqblend.blends.contact import Contacts, Stations, inward
from cqblend.blends.primaries import Array, Primary, unit
from cqblend.errors import GeometryError, SelectionError
from cqblend.occ.adapt import FaceSide, face_side
from cqblend.occ.spine import EdgeSpine, chain
from cqblend.occ.topology import Ancestors, Index, ends, ends_uv, explore, forward, location_of

SMOOTH = 1e-3  # rad: faces that meet at less are smooth already, at less from pi a knife edge
NEAR = 1e-6  # of the parameters: a contact this near to a face's boundary leaves nothing of the face
BEND = 1e-2  # rad: a joint goes on past a vertex only where it turns by less
ALONG = 0.15  # |cos| between an edge and the normal of the face at its end, below which the face runs along the edge


@dataclass(frozen=True)
class Joint:
    """An edge, or a chain of edges, between two faces of one solid, ready to be blended.

    ``edge`` and ``faces`` are numbers in the maps of the *input* shape, for messages and certificates.
    """

    solid: TopoDS_Shape
    spine: EdgeSpine
    sides: tuple[FaceSide, FaceSide]
    edge: int
    faces: tuple[int, int]

    @property
    def primaries(self) -> tuple[Primary, Primary]:
        """The two primary surfaces."""
        return self.sides[0].primary, self.sides[1].primary

    @cached_property
    def tolerance(self) -> float:
        """The largest tolerance of the edges (mm)."""
        return float(max(BRep_Tool.Tolerance_s(edge) for edge in self.spine.edges))

    @cached_property
    def convex(self) -> bool:
        """Whether blending removes material."""
        return bool(inward(self.sides, self.stations(np.array([0.5])))[2][0] > 0)

    @cached_property
    def extent(self) -> float:
        """The diagonal of the solid's bounding box (mm)."""
        box = Bnd_Box()
        BRepBndLib.Add_s(self.solid, box)
        return float(np.sqrt(box.SquareExtent()))

    def stations(self, t: Array) -> Stations:
        """Return the edge's stations at t; past its ends, an arc of a circle goes on, anything else straight."""
        return self.spine.onward(self.spine.stations(t, self.sides), self.sides)

    def native(self, contacts: Contacts) -> list[Array]:
        """Return contacts in the two faces' own parameters, in their windows."""
        return [side.windowed(side.own(uv)) for side, uv in zip(self.sides, contacts.uv, strict=True)]

    def outside(self, contacts: Contacts) -> tuple[int, float] | None:
        """Return the number of the face that contacts leave, and the first such t; None if they stay inside both."""
        for side, number, uv in zip(self.sides, self.faces, self.native(contacts), strict=True):
            classifier = BRepTopAdaptor_FClass2d(side.face, NEAR)
            for t, point in zip(contacts.t.tolist(), uv.tolist(), strict=True):
                state = classifier.Perform(gp_Pnt2d(*point))
                if state == TopAbs_OUT or (state == TopAbs_ON and not side.at_seam(np.array(point))):
                    return number, t
        return None

    def clear_start(self, contacts: Contacts) -> float:
        """Return the t, of contacts all around, at which a closed rail best starts: far from seams and knot lines."""
        clearance = np.full(len(contacts.t), np.inf)
        for side, uv in zip(self.sides, self.native(contacts), strict=True):
            for axis, width in enumerate(np.ptp(side.bounds, axis=1)):
                lines = np.append(side.bounds[axis], side.native.lines(axis))
                clearance = np.minimum(clearance, np.abs(uv[:, axis, None] - lines).min(axis=1) / width)
        return float(contacts.t[np.argmax(clearance)])

    def end_planes(self) -> list[tuple[Array, Array] | None]:
        """Return, for both ends, point and normal of the one face on which a blend can end there.

        None where there is no such face, or it runs along the edge: the joint goes on past that vertex.
        """
        faces_at = Ancestors(self.solid, TopAbs_VERTEX, TopAbs_FACE)
        directions = self.stations(np.array([0.0, 1.0])).direction
        planes: list[tuple[Array, Array] | None] = []
        for vertex, direction in zip(self.spine.vertices, directions, strict=True):
            others = [face for face in faces_at(vertex) if not any(face.IsSame(side.face) for side in self.sides)]
            if len(others) != 1:
                planes.append(None)
                continue
            corner = location_of(vertex)
            side = face_side(others[0], corner[None])
            normal = side.native.normals(_parameters_of(vertex, side.face)[None])[0]
            planes.append((corner, normal) if abs(normal @ direction) > ALONG else None)
        return planes

    def walled(self, contacts: Contacts, stations: Stations) -> bool:
        """Whether the straight ways, in the parameter planes, from edge points to contacts stay on the faces."""
        for side, uv, foot in zip(self.sides, contacts.uv, stations.uv, strict=True):
            classifier = BRepTopAdaptor_FClass2d(side.face, 1e-9)
            on_edge = self.spine.on_face(contacts.t, side.face)
            start, stop = side.beside(side.own(foot), on_edge), side.beside(side.own(uv), on_edge)
            for share in (0.05, 0.25, 0.5, 0.75, 1.0):
                for point in (start + share * (stop - start)).tolist():
                    if classifier.Perform(gp_Pnt2d(*point)) != TopAbs_IN:
                        return False
        return True


def _parameters_of(vertex: TopoDS_Vertex, face: TopoDS_Face) -> Array:
    """Return a vertex's (u, v) on a face, from the end of an edge of that face."""
    for use in explore(face, TopAbs_EDGE):
        for end, uv in zip(ends(use), ends_uv(use, face), strict=True):
            if end.IsSame(vertex) and not BRep_Tool.Degenerated_s(use):
                return uv
    raise GeometryError("a vertex is not on the boundary of its face")


def find_joint(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], number: int, faces: tuple[int, int], *, swap: bool
) -> Joint:
    """Return the joint that the first of some edges is part of, with all of it that goes on between the same two faces.

    ``number`` and ``faces`` are what messages and certificates call it; ``swap`` makes the second face side 1.

    Raises
    ------
    SelectionError
        If the edge is no sharp joint of two faces of a closed solid.
    """
    name, edge = f"edge {number}", edges[0]
    solids = [solid for solid in explore(shape, TopAbs_SOLID) if Index(solid, TopAbs_EDGE).of(edge)]
    if len(solids) != 1:
        many = f"part of {len(solids)} solids: take them apart first" if solids else "not part of a solid"
        raise SelectionError(f"{name} is {many}; a blend needs one closed solid")
    solid = solids[0]
    faces_at = Ancestors(solid, TopAbs_EDGE, TopAbs_FACE)
    pair = faces_at(edge)
    if BRep_Tool.Degenerated_s(edge):
        raise SelectionError(f"{name} is degenerate (a pole): it has no length to blend along")
    if len(pair) == 1 and BRep_Tool.IsClosed_s(edge, pair[0]):
        raise SelectionError(f"{name} is a seam of one closed face, not a joint of two")
    if len(pair) != 2:
        raise SelectionError(f"{name} has {len(pair)} face(s), not 2: the shell is open or not manifold")
    pair.sort(key=Index(solid, TopAbs_FACE).of, reverse=swap)
    between = [one for one in edges if _all_same(faces_at(one), pair)]
    ordered, closed = chain(_grown(between, pair, faces_at, solid), pair[0])
    spine = EdgeSpine(ordered, closed)
    points = spine.points(np.linspace(0, 1, 65)[: -1 if closed else None])
    around = closed or spine.turn() is not None
    first, second = (face_side(face, points, around=around) for face in pair)
    joint = Joint(solid, spine, (first, second), number, faces)
    _check_sharp(joint, name)
    return joint


def _all_same(faces: list[TopoDS_Face], pair: list[TopoDS_Face]) -> bool:
    return len(faces) == 2 and all(any(face.IsSame(one) for one in pair) for face in faces)


def _grown(
    edges: list[TopoDS_Edge], pair: list[TopoDS_Face], faces_at: Ancestors, solid: TopoDS_Shape
) -> list[TopoDS_Edge]:
    """Follow the joint past vertices at which only the two faces meet: there it merely happens to be cut into edges."""
    edges_at, faces_around = Ancestors(solid, TopAbs_VERTEX, TopAbs_EDGE), Ancestors(solid, TopAbs_VERTEX, TopAbs_FACE)
    grown, waiting = edges[:1], edges[:1]
    while waiting:
        for vertex in ends(waiting.pop()):
            if len(faces_around(vertex)) > 2 and not any(vertex.IsSame(v) for edge in edges[1:] for v in ends(edge)):
                continue
            passable = edges_at(vertex) if len(faces_around(vertex)) == 2 else edges
            for edge in passable:
                touches = any(vertex.IsSame(v) for v in ends(edge)) and _straight_on(vertex, edge, grown)
                if touches and _all_same(faces_at(edge), pair) and not any(edge.IsSame(one) for one in grown):
                    grown.append(edge)
                    waiting.append(edge)
    return grown


def _straight_on(vertex: TopoDS_Vertex, edge: TopoDS_Edge, others: list[TopoDS_Edge]) -> bool:
    """Whether an edge goes on at a vertex in the direction in which one of the others arrives there."""
    here = _away(vertex, edge)
    before = [_away(vertex, other) for other in others if any(vertex.IsSame(v) for v in ends(other))]
    return any(np.linalg.norm(here + one) < BEND for one in before)


def _away(vertex: TopoDS_Vertex, edge: TopoDS_Edge) -> Array:
    """Return the unit tangent of an edge at one of its vertices, pointing away from it."""
    curve, sign = BRepAdaptor_Curve(edge), 1.0
    at = curve.FirstParameter()
    if not ends(forward(edge))[0].IsSame(vertex):
        at, sign = curve.LastParameter(), -1.0
    tangent = curve.DN(at, 1)
    return sign * unit(np.array([tangent.X(), tangent.Y(), tangent.Z()]))


def _check_sharp(joint: Joint, name: str) -> None:
    stations = joint.stations(np.linspace(0.02, 0.98, 17))
    n1, n2 = (side.outward * side.primary.normals(uv) for side, uv in zip(joint.sides, stations.uv, strict=True))
    angle = np.arctan2(np.linalg.norm(np.cross(n1, n2), axis=1), (n1 * n2).sum(1))
    if angle.min() < SMOOTH:
        raise SelectionError(f"{name} is smooth already: its faces meet at {angle.min():.2g} rad")
    if angle.max() > np.pi - SMOOTH:
        raise SelectionError(f"{name} is a knife edge: its faces fold back onto each other")
