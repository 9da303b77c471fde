"""Facts of one body that every blend in it needs: numbered parts, what meets where, classifiers. Each found once."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.selection.same_surface import is_same_surface
from cqblend.brep.topology import AncestorMap, ShapeIndex


class SolidIndex:
    """One body: its numbered faces, edges and vertices, and what meets at them; found when first asked for.

    ``solid`` is the body: a solid, or a shell that bounds none (:mod:`cqblend.brep.bodies`).
    """

    def __init__(self, solid: TopoDS_Shape) -> None:
        self.solid = solid
        self._classifiers: dict[tuple[int, float], BRepTopAdaptor_FClass2d] = {}
        self._same_surface: dict[int, list[tuple[TopoDS_Edge, TopoDS_Face]]] = {}

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
