"""Solids taken apart into faces, wires and edges, to be changed and put together again: how faults are put into them.

What a solid has in common with the one it was made from stays the same objects; everything else is copied, so that a
change harms neither of the two.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise

from blended_solids import Replacement
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.Geom import Geom_Surface
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_Orientation, TopAbs_SHELL, TopAbs_VERTEX
from OCP.TopoDS import (
    TopoDS,
    TopoDS_Edge,
    TopoDS_Face,
    TopoDS_Iterator,
    TopoDS_Shape,
    TopoDS_Shell,
    TopoDS_Solid,
    TopoDS_Vertex,
    TopoDS_Wire,
)

from cqblend.brep.topology import ShapeIndex, explore_subshapes, orient_forward

BUILDER = BRep_Builder()


@dataclass
class FaceDraft:
    """A face in pieces: itself FORWARD and without a boundary, and its wires."""

    bare: TopoDS_Face
    orientation: TopAbs_Orientation
    wires: list[list[TopoDS_Edge]]

    def build(self) -> TopoDS_Face:
        """Put the face together."""
        face = TopoDS.Face_s(self.bare.EmptyCopied())
        for edges in self.wires:
            wire = TopoDS_Wire()
            BUILDER.MakeWire(wire)
            for edge in edges:
                BUILDER.Add(wire, edge)
            wire.Closed(True)
            BUILDER.Add(face, wire)
        return TopoDS.Face_s(face.Oriented(self.orientation))

    def list_edges(self) -> list[TopoDS_Edge]:
        """Return the distinct edges, FORWARD."""
        edges: list[TopoDS_Edge] = []
        for use in (edge for wire in self.wires for edge in wire):
            if not any(use.IsSame(edge) for edge in edges):
                edges.append(TopoDS.Edge_s(orient_forward(use)))
        return edges

    def replace_surface(self, surface: Geom_Surface) -> None:
        """Put another surface under the face; its edges keep their curves in the parameters."""
        old, self.bare = self.bare, TopoDS_Face()
        BUILDER.MakeFace(self.bare, surface, BRep_Tool.Tolerance_s(old))
        for edge in self.list_edges():
            set_pcurves(edge, self.bare, *get_pcurves(edge, old))

    def replace_edge(self, old: TopoDS_Edge, new: TopoDS_Edge) -> None:
        """Put another edge in the place of one, in all its uses."""
        self.wires = [
            [TopoDS.Edge_s(new.Oriented(use.Orientation())) if use.IsSame(old) else use for use in wire]
            for wire in self.wires
        ]


def get_pcurves(edge: TopoDS_Edge, face: TopoDS_Face) -> list:
    """Return the pcurves of an edge on a face: two of a seam."""
    uses = [edge.Oriented(TopAbs_FORWARD)] + [edge.Reversed()] * BRep_Tool.IsClosed_s(edge, face)
    return [BRep_Tool.CurveOnSurface_s(TopoDS.Edge_s(use), face, 0.0, 0.0) for use in uses]


def set_pcurves(edge: TopoDS_Edge, face: TopoDS_Face, *pcurves) -> None:
    """Give an edge pcurves on a face."""
    BUILDER.UpdateEdge(edge, *pcurves, face, BRep_Tool.Tolerance_s(edge))


def iterate(shape: TopoDS_Shape) -> Iterator[TopoDS_Shape]:
    """Yield the children of a shape, oriented as it has them."""
    children = TopoDS_Iterator(shape, True, True)
    while children.More():
        yield children.Value()
        children.Next()


def draft_face(face: TopoDS_Face) -> FaceDraft:
    """Return a draft of a face, of its own edges."""
    forward = face.Oriented(TopAbs_FORWARD)
    wires = [[TopoDS.Edge_s(edge) for edge in iterate(wire)] for wire in iterate(forward)]
    return FaceDraft(TopoDS.Face_s(forward.EmptyCopied()), face.Orientation(), wires)


@dataclass
class SolidDraft:
    """The solid of a replacement in pieces.

    Attributes
    ----------
    before
        The solid it was made from.
    blends, trimmed
        Drafts of the new faces, and of the others that ``before`` has not.
    kept
        Faces that both have.
    shells
        Further shells of the solid, such as voids.
    reversed
        Whether the solid is turned inside out.
    finish
        Changes the list of faces: first the new ones, then the trimmed and the kept ones.
    """

    before: TopoDS_Shape
    blends: list[FaceDraft]
    trimmed: list[FaceDraft]
    kept: list[TopoDS_Face]
    grows: bool | None
    tolerance: float
    shells: list[TopoDS_Shape] = field(default_factory=list)
    reversed: bool = False
    finish: Callable[[list[TopoDS_Face]], list[TopoDS_Face]] = list

    def build(self, name: str) -> Replacement:
        """Put the solid together."""
        blends = [draft.build() for draft in self.blends]
        faces = self.finish([*blends, *(draft.build() for draft in self.trimmed), *self.kept])
        after = make_solid(faces, self.shells)
        after = after.Reversed() if self.reversed else after
        return Replacement(name, self.before, after, tuple(blends), self.grows, self.tolerance)

    def list_new_edges(self, *drafts: FaceDraft) -> list[TopoDS_Edge]:
        """Return the edges of drafts that ``before`` has not, degenerate ones left out."""
        known = ShapeIndex(self.before, TopAbs_EDGE)
        return [
            edge
            for draft in drafts
            for edge in draft.list_edges()
            if edge not in known and not BRep_Tool.Degenerated_s(edge)
        ]

    def list_rails(self, blend: FaceDraft) -> list[tuple[TopoDS_Edge, FaceDraft]]:
        """Return the edges that a blend shares with one other draft, and that draft, the longest first."""
        found = [
            (edge, other)
            for edge in self.list_new_edges(blend)
            for other in self.trimmed
            if any(edge.IsSame(one) for one in other.list_edges())
        ]
        return sorted(found, key=lambda pair: -measure_length(pair[0]))


def measure_length(edge: TopoDS_Edge) -> float:
    """Return the length of an edge's polygon through nine points."""
    curve, (first, last) = BRep_Tool.Curve_s(edge, 0.0, 0.0), BRep_Tool.Range_s(edge)
    points = [curve.Value(first + i / 8 * (last - first)) for i in range(9)]
    return sum(a.Distance(b) for a, b in pairwise(points))


def make_solid(faces: list[TopoDS_Face], shells: list[TopoDS_Shape] = ()) -> TopoDS_Solid:
    """Make a solid of the faces of its outer shell, as they are, and of further shells."""
    shell, solid = TopoDS_Shell(), TopoDS_Solid()
    BUILDER.MakeShell(shell)
    for face in faces:
        BUILDER.Add(shell, face)
    shell.Closed(BRep_Tool.IsClosed_s(shell))
    BUILDER.MakeSolid(solid)
    for one in (shell, *shells):
        BUILDER.Add(solid, one)
    return solid


def take_apart(replacement: Replacement) -> SolidDraft:
    """Return a draft of the solid ``after``."""
    copy = _Copier(replacement.before)
    blends, trimmed, kept = [], [], []
    known = ShapeIndex(replacement.before, TopAbs_FACE)
    shells = list(explore_subshapes(replacement.after, TopAbs_SHELL))
    for face in explore_subshapes(shells[0], TopAbs_FACE):
        if face in known:
            kept.append(face)
        elif any(face.IsSame(one) for one in replacement.new_faces):
            blends.append(copy.copy_face(face))
        else:
            trimmed.append(copy.copy_face(face))
    return SolidDraft(replacement.before, blends, trimmed, kept, replacement.grows, replacement.tolerance, shells[1:])


class _Copier:
    """Copies faces with their edges and vertices, each once; not those that a solid has already."""

    def __init__(self, known: TopoDS_Shape) -> None:
        self._known = {kind: ShapeIndex(known, kind) for kind in (TopAbs_EDGE, TopAbs_VERTEX)}
        self._copies: list[tuple[TopoDS_Shape, TopoDS_Shape]] = []

    def copy_face(self, face: TopoDS_Face) -> FaceDraft:
        """Copy a face into a draft."""
        draft = draft_face(face)
        draft.wires = [[self._copy_edge(edge) for edge in wire] for wire in draft.wires]
        return draft

    def _find(self, shape: TopoDS_Shape) -> TopoDS_Shape | None:
        known = shape if shape in self._known[shape.ShapeType()] else None
        return next((copy for original, copy in self._copies if original.IsSame(shape)), known)

    def _copy_edge(self, edge: TopoDS_Edge) -> TopoDS_Edge:
        copy = self._find(edge)
        if copy is None:
            copy = edge.Oriented(TopAbs_FORWARD).EmptyCopied()
            for vertex in iterate(edge.Oriented(TopAbs_FORWARD)):
                BUILDER.Add(copy, self._copy_vertex(vertex))
            self._copies.append((edge, copy))
        return TopoDS.Edge_s(copy.Oriented(edge.Orientation()))

    def _copy_vertex(self, vertex: TopoDS_Shape) -> TopoDS_Vertex:
        copy = self._find(vertex)
        if copy is None:
            copy, original = TopoDS_Vertex(), TopoDS.Vertex_s(vertex)
            BUILDER.MakeVertex(copy, BRep_Tool.Pnt_s(original), BRep_Tool.Tolerance_s(original))
            self._copies.append((vertex, copy))
        return TopoDS.Vertex_s(copy.Oriented(vertex.Orientation()))
