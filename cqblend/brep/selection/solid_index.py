"""Facts of one body that every blend in it needs: numbered parts, what meets where, classifiers. Each found once."""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.gp import gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_IN, TopAbs_ON, TopAbs_VERTEX
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.measurement.edge_sides import EdgeSide, get_two_sides
from cqblend.brep.selection.dihedral_angles import DihedralAngles, measure_dihedral_angles
from cqblend.brep.selection.same_surface import is_same_surface
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.topology import AncestorMap, ShapeIndex, explore_subshapes, find_end_vertices
from cqblend.splines.bernstein import Array


class EdgeUse(NamedTuple):
    """An edge as the boundary of a face uses it, and the numbers of the vertices at which that use starts and stops."""

    edge: TopoDS_Edge
    vertices: tuple[int, int]


class SolidIndex:
    """One body: its numbered faces, edges and vertices, and what meets at them; found when first asked for.

    ``solid`` is the body: a solid, or a shell that bounds none (:mod:`cqblend.brep.bodies`).
    """

    def __init__(self, solid: TopoDS_Shape) -> None:
        self.solid = solid
        self._classifiers: dict[tuple[int, float], BRepTopAdaptor_FClass2d] = {}
        self._same_surface: dict[int, list[tuple[TopoDS_Edge, TopoDS_Face]]] = {}
        self._angles: dict[int, DihedralAngles | None] = {}
        self._uses: dict[int, list[EdgeUse]] = {}

    @cached_property
    def faces(self) -> ShapeIndex:
        """The faces, numbered."""
        return ShapeIndex(self.solid, TopAbs_FACE)

    @cached_property
    def edges(self) -> ShapeIndex:
        """The edges, numbered."""
        return ShapeIndex(self.solid, TopAbs_EDGE)

    @cached_property
    def vertices(self) -> ShapeIndex:
        """The vertices, numbered."""
        return ShapeIndex(self.solid, TopAbs_VERTEX)

    def get_map(self, part: TopoDS_Shape) -> ShapeIndex:
        """Return the numbers of the parts of the same kind as a face, an edge or a vertex."""
        return {TopAbs_FACE: self.faces, TopAbs_EDGE: self.edges, TopAbs_VERTEX: self.vertices}[part.ShapeType()]

    @cached_property
    def faces_at_edge(self) -> AncestorMap:
        """The faces at each edge."""
        return AncestorMap(self.solid, TopAbs_EDGE, TopAbs_FACE)

    @cached_property
    def faces_at_vertex(self) -> AncestorMap:
        """The faces at each vertex."""
        return AncestorMap(self.solid, TopAbs_VERTEX, TopAbs_FACE)

    @cached_property
    def edges_at_vertex(self) -> AncestorMap:
        """The edges at each vertex."""
        return AncestorMap(self.solid, TopAbs_VERTEX, TopAbs_EDGE)

    @cached_property
    def extent(self) -> float:
        """The diagonal of the bounding box (mm)."""
        box = Bnd_Box()
        BRepBndLib.Add_s(self.solid, box)
        return float(np.sqrt(box.SquareExtent()))

    def get_classifier(self, face: TopoDS_Face, tolerance: float) -> BRepTopAdaptor_FClass2d:
        """Return the classifier of parameters on a face, with the distance up to which they lie on its boundary."""
        key = (self.faces.find_number(face), tolerance)
        if key not in self._classifiers:
            self._classifiers[key] = BRepTopAdaptor_FClass2d(face, tolerance)
        return self._classifiers[key]

    def is_inside_face(self, face: TopoDS_Face, uv: Array, *, or_on_boundary: bool) -> bool:
        """Whether a contact with parameters (2,), in the window of a face, lies inside it."""
        state = self.get_classifier(face, SELECT_TOLERANCES.contact_boundary).Perform(gp_Pnt2d(*uv.tolist()))
        return bool(state == TopAbs_IN or (or_on_boundary and state == TopAbs_ON))

    def list_same_surface_neighbours(self, face: TopoDS_Face) -> list[tuple[TopoDS_Edge, TopoDS_Face]]:
        """Return the edges at which a face goes on smoothly in another one on the same surface, with that face."""
        number = self.faces.find_number(face)
        if number not in self._same_surface:
            found = []
            for edge in ShapeIndex(face, TopAbs_EDGE):
                others = [other for other in self.faces_at_edge(edge) if not other.IsSame(face)]
                if len(others) == 1 and is_same_surface(face, others[0], edge):
                    found.append((edge, others[0]))
            self._same_surface[number] = found
        return self._same_surface[number]

    def list_edge_uses(self, face: TopoDS_Face) -> list[EdgeUse]:
        """Return the edges in the boundary of a face, each as it is used there; a seam comes twice."""
        number = self.faces.find_number(face)
        if number not in self._uses:
            find = self.vertices.find_number
            self._uses[number] = [
                EdgeUse(use, (find(start), find(stop)))
                for use in explore_subshapes(face, TopAbs_EDGE)
                for start, stop in (find_end_vertices(use),)
            ]
        return self._uses[number]

    def find_sides(self, edge: TopoDS_Edge) -> tuple[EdgeSide, EdgeSide] | None:
        """Return the two sides of an edge, in the order of the faces; None if it is degenerate, or has not two."""
        return get_two_sides(edge, self.faces_at_edge)

    def measure_dihedral_angles(self, edge: TopoDS_Edge) -> DihedralAngles | None:
        """Return the angles at which the faces at an edge meet; None if it has not two sides with normals."""
        number = self.edges.find_number(edge)
        if number not in self._angles:
            sides = self.find_sides(edge)
            self._angles[number] = None if sides is None else measure_dihedral_angles(sides)
        return self._angles[number]
