"""Which faces of a solid were replaced by which, and which of its edges are new: found once, for all checks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property

from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from cqblend.brep.topology import AncestorMap, ShapeIndex, explore_subshapes, make_compound


class Check(Enum):
    """The checks of a solid in which faces were replaced."""

    PRESENCE = "presence"
    EDGES = "edges"
    DEVIATION = "deviations"
    VALIDITY = "validity"
    SHELLS = "shells"
    SIDES = "inversion"
    FOLDS = "folds"
    COLLISIONS = "collisions"
    VOLUME = "volume"


@dataclass(frozen=True)
class ReplacementProblem:
    """Something wrong with a solid in which faces were replaced.

    Attributes
    ----------
    line
        What it is, in one line.
    check
        Which check found it.
    new_faces
        Indices of the new faces that it concerns, or that border on what it concerns; all of them if that is not known.
    shapes
        The faces or edges it was found at.
    crosses
        Whether the boundary of a face crosses itself, or a new face another one: a blend is too large.
    """

    line: str
    check: Check
    new_faces: tuple[int, ...]
    shapes: tuple[TopoDS_Shape, ...] = ()
    crosses: bool = False


class ReplacedFaces:
    """The faces of a solid that were replaced, and those in their places.

    Attributes
    ----------
    before, after : TopoDS_Shape
        The solids.
    index_before, index_after : ShapeIndex
        Their faces.
    new_faces : list of TopoDS_Face
        The faces that were added, as they were given.
    old, new : list of TopoDS_Face
        Faces that only ``before``, and that only ``after`` has, oriented as there.
    turned : list of TopoDS_Face
        Faces that both have, with opposite orientations.
    """

    def __init__(
        self,
        before: TopoDS_Shape,
        after: TopoDS_Shape,
        new_faces: Sequence[TopoDS_Face],
        index_before: ShapeIndex | None = None,
    ) -> None:
        self.before, self.after, self.new_faces = before, after, list(new_faces)
        self.index_before = ShapeIndex(before, TopAbs_FACE) if index_before is None else index_before
        self.index_after = ShapeIndex(after, TopAbs_FACE)
        self.old: list[TopoDS_Face] = [face for face in self.index_before if face not in self.index_after]
        self.new: list[TopoDS_Face] = []
        self.turned: list[TopoDS_Face] = []
        for face in self.index_after:
            number = self.index_before.find_number(face)
            if not number:
                self.new.append(face)
            elif face.Orientation() != self.index_before[number].Orientation():
                self.turned.append(face)

    @cached_property
    def bounds_solid(self) -> bool:
        """Whether the faces bound solids, and not a mere shell."""
        return len(ShapeIndex(self.before, TopAbs_SOLID)) > 0

    @cached_property
    def added_faces(self) -> ShapeIndex:
        """The faces that were added, numbered."""
        return ShapeIndex.from_shapes(self.new_faces, TopAbs_FACE)

    @cached_property
    def old_compound(self) -> TopoDS_Shape:
        """The faces that were replaced."""
        return make_compound(self.old)

    @cached_property
    def new_compound(self) -> TopoDS_Shape:
        """The faces in their places."""
        return make_compound(self.new)

    @cached_property
    def old_edges(self) -> ShapeIndex:
        """The edges of the faces that were replaced."""
        return ShapeIndex(self.old_compound, TopAbs_EDGE)

    @cached_property
    def old_vertices(self) -> ShapeIndex:
        """The vertices of the faces that were replaced."""
        return ShapeIndex(self.old_compound, TopAbs_VERTEX)

    @cached_property
    def edges_before(self) -> ShapeIndex:
        """All edges of the solid before."""
        return ShapeIndex(self.before, TopAbs_EDGE)

    @cached_property
    def new_uses(self) -> list[tuple[TopoDS_Shape, TopoDS_Face]]:
        """Uses of new edges, with the new face that uses it."""
        known = self.old_edges
        return [(use, face) for face in self.new for use in explore_subshapes(face, TopAbs_EDGE) if use not in known]

    @cached_property
    def faces_of_edge(self) -> AncestorMap:
        """The faces, of those that only ``after`` has, that use an edge."""
        return AncestorMap(self.new_compound, TopAbs_EDGE, TopAbs_FACE)

    @cached_property
    def _faces_of_vertex(self) -> AncestorMap:
        return AncestorMap(make_compound(self.new_faces), TopAbs_VERTEX, TopAbs_FACE)

    @cached_property
    def _index_of_new_face(self) -> ShapeIndex:
        return ShapeIndex.from_shapes(self.new_faces, TopAbs_FACE)

    def find_new_faces(self, shapes: Iterable[TopoDS_Shape]) -> tuple[int, ...]:
        """Return the indices of the new faces that are among some shapes, or share a vertex with one; else of all."""
        found = set()
        for shape in shapes:
            number = self._index_of_new_face.find_number(shape)
            if number:
                found.add(number - 1)
                continue
            for vertex in ShapeIndex(shape, TopAbs_VERTEX):
                found |= {self._index_of_new_face.find_number(face) - 1 for face in self._faces_of_vertex(vertex)}
        return tuple(sorted(found)) or tuple(range(len(self.new_faces)))
