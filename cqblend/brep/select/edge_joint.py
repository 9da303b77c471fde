"""What is selected: an edge between two faces of a solid, checked, measured and read into primaries.

A joint is the input of the whole pipeline in :mod:`cqblend.solid_blends.edge_blend`: which solid, which edges, which
faces on which side, and the questions about them that only the topology can answer.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_IN, TopAbs_ON, TopAbs_OUT, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex

from cqblend.blends.contacts.contact_solver import Contacts, Stations, inward
from cqblend.brep.read.face_surface import FaceSide, face_side
from cqblend.brep.rewrite.neighbour_edges import border_in_plane, face_across, faces_beside
from cqblend.brep.select.spine import EdgeSpine, chain
from cqblend.brep.shape_kinds import kind
from cqblend.brep.topology import CONFUSION, Ancestors, Index, direction_from, ends, explore, location_of, parameters_at
from cqblend.certificate import SkippedKind
from cqblend.errors import SelectionError, TopologyError
from cqblend.surfaces.primaries import Array, Primary

SMOOTH = 1e-3  # rad: faces that meet at less are smooth already, at less from pi a knife edge
WITHIN, BEHIND = 0.12, 1e-3  # of the legs of a section: a point that it cuts off, and a step out of its plane
NEAR = 1e-6  # of the parameters: a contact this near to a face's boundary leaves nothing of the face
BEND = 1e-2  # rad: a joint goes on past a vertex only where it turns by less


class PassedOver(SelectionError):
    """An edge that there is nothing to blend at: smooth already, a seam, or degenerate; ``kind`` is which."""

    def __init__(self, kind: SkippedKind, message: str) -> None:
        super().__init__(message)
        self.kind: SkippedKind = kind


@dataclass(frozen=True)
class Joint:
    """An edge, or a chain of edges, between two faces of one solid, ready to be blended.

    ``edge`` and ``faces`` are numbers in the maps of the *input* shape, for messages and certificates; ``numbers``
    tells those of other faces, edges and vertices, 0 where they are not in the input. The spine runs ``backward`` if
    the edge, as it was picked, runs against it.
    """

    solid: TopoDS_Shape
    spine: EdgeSpine
    sides: tuple[FaceSide, FaceSide]
    edge: int
    faces: tuple[int, int]
    numbers: Callable[[TopoDS_Shape], int] | None = None
    backward: bool = False

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

    def inside(self, contacts: Contacts, which: int) -> Array:
        """Return which contacts (n,) of one side are inside its face."""
        side = self.sides[which]
        classifier = BRepTopAdaptor_FClass2d(side.face, NEAR)
        found = []
        for point in side.windowed(side.own(contacts.uv[which])):
            state = classifier.Perform(gp_Pnt2d(*point.tolist()))
            found.append(state == TopAbs_IN or (state == TopAbs_ON and side.at_seam(point)))
        return np.array(found)

    def named(self, part: TopoDS_Shape) -> str:
        """Return what messages call a face, edge or vertex of the solid: by its number in the input, if it has one."""
        number = 0 if self.numbers is None else self.numbers(part)
        return f"{kind(part)} {number}" if number else f"a new {kind(part)}"

    def clear_start(self, contacts: Contacts) -> float:
        """Return the t, of contacts all around, at which a closed rail best starts: far from seams and knot lines."""
        clearance = np.full(len(contacts.t), np.inf)
        for side, uv in zip(self.sides, self.native(contacts), strict=True):
            for axis, width in enumerate(np.ptp(side.bounds, axis=1)):
                lines = np.append(side.bounds[axis], side.native.lines(axis))
                clearance = np.minimum(clearance, np.abs(uv[:, axis, None] - lines).min(axis=1) / width)
        return float(contacts.t[np.argmax(clearance)])

    def vertex_number(self, end: int) -> int:
        """Return the number of the vertex at t = 0 or t = 1 in the input; 0 if that does not have it."""
        return 0 if self.numbers is None else self.numbers(self.spine.vertices[end])

    def name_end(self, end: int) -> str:
        """Return what messages call the vertex at t = 0 or t = 1, with the faces that meet there beside the sides."""
        vertex = self.spine.vertices[end]
        x, y, z = location_of(vertex).tolist()
        others = [self.named(face) for face in faces_beside(self.solid, vertex, self.sides)]
        beside = f", beside {', '.join(others)}" if others else ""
        return f"{self.named(vertex)} at ({x:.4g}, {y:.4g}, {z:.4g}){beside}"

    def end_plane(self, end: int) -> tuple[Array, Array]:
        """Return point and normal of the one face on which a blend can end at t = 0 or t = 1.

        Raises
        ------
        TopologyError
            If there is not exactly one.
        """
        vertex = self.spine.vertices[end]
        corner = location_of(vertex)
        across = face_across(self.solid, self.spine, end, self.sides)
        side = face_side(across, corner[None])
        return corner, side.native.normals(parameters_at(vertex, side.face)[None])[0]

    def check_cap(self, contacts: Contacts, stations: Stations, end: int) -> None:
        """Check that a flat cap at the one t of contacts stands on both faces, and has what it must have behind it.

        Each of its walls, from the edge to a contact, runs inside its face or, at the end of the edge, along a border.
        Behind the cap there is material if the edge is convex, none if it is concave.

        Raises
        ------
        TopologyError
            If it does not.
        """
        vertex, direction = self.spine.vertices[end], stations.direction[0]
        at_end = contacts.t[0] == end
        legs = np.zeros(3)
        for side, number, uv, foot in zip(self.sides, self.faces, contacts.uv, stations.uv, strict=True):
            corner = side.primary.jet(uv)[0, 0]
            legs += corner - stations.point[0]
            if at_end and border_in_plane(side.face, vertex, self.spine.edges, direction, corner) is not None:
                continue
            classifier = BRepTopAdaptor_FClass2d(side.face, 1e-9)
            on_edge = self.spine.on_face(contacts.t, side.face)
            start, stop = side.beside(side.own(foot), on_edge), side.beside(side.own(uv), on_edge)
            for share in (0.05, 0.25, 0.5, 0.75, 1.0):
                for point in (start + share * (stop - start)).tolist():
                    if classifier.Perform(gp_Pnt2d(*point)) != TopAbs_IN:
                        raise TopologyError(f"a wall across the edge leaves face {number}")
        behind = stations.point[0] + WITHIN * legs + BEHIND * np.linalg.norm(legs) * direction * (1 if end else -1)
        classifier = BRepClass3d_SolidClassifier(self.solid, gp_Pnt(*behind.tolist()), CONFUSION)
        if classifier.State() != (TopAbs_IN if self.convex else TopAbs_OUT):
            raise TopologyError(
                f"behind a cap there, the solid {'has no material' if self.convex else 'is in the way'}"
            )


def find_joint(
    shape: TopoDS_Shape,
    edges: Sequence[TopoDS_Edge],
    number: int,
    faces: tuple[int, int],
    *,
    swap: bool,
    numbers: Callable[[TopoDS_Shape], int] | None = None,
) -> Joint:
    """Return the joint that the first of some edges is part of, with all of it that goes on between the same two faces.

    ``number`` and ``faces`` are what messages and certificates call it, ``numbers`` what they call others; ``swap``
    makes the second face side 1.

    Raises
    ------
    PassedOver
        If there is nothing to blend at the edge: it is degenerate, a seam, or smooth all along.
    SelectionError
        If it is no sharp joint of two faces of a closed solid for another reason.
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
        raise PassedOver("degenerate", f"{name} is degenerate (a pole): it has no length to blend along")
    if len(pair) == 1 and BRep_Tool.IsClosed_s(edge, pair[0]):
        raise PassedOver("seam", f"{name} is a seam of one closed face, not a joint of two")
    if len(pair) != 2:
        raise SelectionError(f"{name} has {len(pair)} face(s), not 2: the shell is open or not manifold")
    pair.sort(key=Index(solid, TopAbs_FACE).of, reverse=swap)
    between = [one for one in edges if _all_same(faces_at(one), pair)]
    ordered, closed = chain(_grown(between, pair, faces_at, solid), pair[0])
    spine = EdgeSpine(ordered, closed)
    points = spine.points(np.linspace(0, 1, 65)[: -1 if closed else None])
    around = closed or spine.turn() is not None
    first, second = (face_side(face, points, around=around) for face in pair)
    joint = Joint(solid, spine, (first, second), number, faces, numbers)
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
    here = direction_from(vertex, edge)
    before = [direction_from(vertex, other) for other in others if any(vertex.IsSame(v) for v in ends(other))]
    return any(np.linalg.norm(here + one) < BEND for one in before)


def _check_sharp(joint: Joint, name: str) -> None:
    stations = joint.stations(np.linspace(0.02, 0.98, 17))
    n1, n2 = (side.outward * side.primary.normals(uv) for side, uv in zip(joint.sides, stations.uv, strict=True))
    angle = np.arctan2(np.linalg.norm(np.cross(n1, n2), axis=1), (n1 * n2).sum(1))
    if angle.max() < SMOOTH:
        raise PassedOver("smooth", f"{name} is smooth already: its faces meet at {angle.max():.2g} rad")
    if angle.min() < SMOOTH:
        raise SelectionError(f"{name} is smooth already in part: there its faces meet at {angle.min():.2g} rad")
    if angle.max() > np.pi - SMOOTH:
        raise SelectionError(f"{name} is a knife edge: its faces fold back onto each other")
