"""The plan of a blended solid: what becomes of its faces, edges and vertices, before the first of them is touched.

A plan is plain data. It names the faces, edges and vertices of the input by their numbers in its maps, and describes
what is new by points and splines; two parts that share an edge or a vertex refer to one object. So a plan can be
printed, compared and tested without OCCT. :mod:`cqblend.brep.shell_editing.plan_application` builds it: each vertex and
edge once, each touched face once, one shell.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal, NamedTuple

from cqblend.blends.network.strip_surface import PlaneCurve, RailCurve
from cqblend.blends.sections.arc_section import BallSurface
from cqblend.blends.sections.revolved_section import RevolvedSection
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.surfaces.ellipse import Ellipse
from cqblend.surfaces.quadrics import Plane

EdgeRole = Literal[
    "rail", "seam", "section", "mitre", "end curve", "cap border", "extension", "pole", "spoke", "corner curve"
]
"""What a new edge is: a rail of a blend; where a closed face meets itself; where two blend faces meet smoothly, or two
at an angle; where a blend meets the face or cap that it ends on, or ends in a border; where a cap, or a border, crosses
a support face; where two faces of the input go on meeting; a point that bounds a sphere or a blend; where two patches
of a corner meet; where a patch meets a support face."""


@dataclass(frozen=True, eq=False)
class PlannedVertex:
    """A vertex of the input, by its number, or a new one (number 0), at a point (3,)."""

    point: Array
    number: int = 0
    gap: float = 0.0
    """How far (mm) the point may be from where the edges meet, beyond what the edges tell themselves."""


SurfaceGeometry = Surface | RevolvedSection | Plane | BallSurface
"""What a planned surface is."""


@dataclass(frozen=True, eq=False)
class PlannedSurface:
    """The surface of a new face, or the one that a face of the input gets in place of its own."""

    geometry: SurfaceGeometry


@dataclass(frozen=True)
class PlannedPcurve:
    """The parameter curve of an edge on a face: a face of the input by its number, or one on a planned surface.

    ``reversed_curve`` is that of the edge's second, REVERSED use, if the face meets itself there.
    """

    face: int | PlannedSurface
    curve: PlaneCurve
    reversed_curve: Curve | None = None


@dataclass(frozen=True, eq=False)
class NewEdge:
    """A new edge on a curve over a span of its parameter; a pole has no curve."""

    role: EdgeRole
    curve: RailCurve | Ellipse | None
    span: tuple[float, float]
    vertices: tuple[PlannedVertex, PlannedVertex]
    pcurves: tuple[PlannedPcurve, ...]
    order: int = 0
    """Continuity that is promised across it: 0 position, 1 tangent planes, 2 curvature."""


@dataclass(frozen=True, eq=False)
class EdgePiece:
    """An edge of the input over another span of its own curves.

    ``gaps`` (mm) are the distances of its vertices from its curve. A piece that also bounds a flat ``cap`` lies in its
    plane; one that a rail is held on has ``pcurves`` on the blend. No continuity is promised across it.
    """

    number: int
    span: tuple[float, float]
    vertices: tuple[PlannedVertex, PlannedVertex]
    gaps: tuple[float, float] = (0.0, 0.0)
    cap: PlannedSurface | None = None
    pcurves: tuple[PlannedPcurve, ...] = ()
    order = 0


@dataclass(frozen=True)
class KeptEdge:
    """An edge of the input that stays as it is, where others are added to it."""

    number: int


PlannedEdge = NewEdge | EdgePiece


class EdgeUse(NamedTuple):
    """An edge in a boundary, along its own sense or against it."""

    edge: PlannedEdge
    forward: bool = True

    @property
    def start_vertex(self) -> PlannedVertex:
        """The vertex at which the use starts."""
        return self.edge.vertices[0 if self.forward else 1]

    def reverse(self) -> EdgeUse:
        """Return the use in the opposite sense."""
        return EdgeUse(self.edge, not self.forward)


def reverse_path(path: Sequence[EdgeUse]) -> list[EdgeUse]:
    """Return a path of uses in the opposite sense."""
    return [use.reverse() for use in reversed(path)]


@dataclass(frozen=True)
class FacePlan:
    """What becomes of the boundary of one face of the input, with the uses as the face has them if oriented FORWARD.

    Edges that ``pieces`` does not name stay as they are. Those it names are replaced by their pieces, in the sense of
    the edge, or go, if there are none; ``added`` uses close the boundary again. With a ``surface`` in place of its own,
    the face has the added uses for its only boundary.
    """

    number: int
    pieces: Mapping[int, tuple[PlannedEdge | KeptEdge, ...]] = field(default_factory=dict)
    added: tuple[EdgeUse, ...] = ()
    surface: PlannedSurface | None = None


@dataclass(frozen=True)
class CapPlan:
    """A flat cap at the end of a blend: its plane and its boundary."""

    surface: PlannedSurface
    boundary: tuple[EdgeUse, ...]


@dataclass(frozen=True)
class StripPlan:
    """One blend face: its surface, its boundary, and the rails on both sides in the order of the spine.

    A boundary goes around the outward normal of the solid clockwise. Where the strip ``is_mirrored``, so does it around
    the normal of its surface, else counter-clockwise.

    ``spine`` has the numbers of the blended edges, ``support_faces`` those of the faces that the rails run on. A rail
    that is one point has no edges, but a pole of the blend face. The ``end_edges`` of an open strip are those at the
    start and at the stop of its spine. It takes the place of the ``removed_faces``, by their numbers.
    """

    spine: tuple[int, ...]
    support_faces: tuple[int, int]
    surface: PlannedSurface
    boundary: tuple[EdgeUse, ...]
    rails: tuple[tuple[PlannedEdge, ...], tuple[PlannedEdge, ...]]
    poles: tuple[NewEdge | None, NewEdge | None] = (None, None)
    end_edges: tuple[tuple[NewEdge, ...], ...] = ()
    caps: tuple[CapPlan, ...] = ()
    removed_faces: tuple[int, ...] = ()
    is_mirrored: bool = False

    @property
    def other_edges(self) -> tuple[NewEdge, ...]:
        """The edges of the boundary that are neither rails nor poles, each once."""
        rails = {edge for side in self.rails for edge in side}
        edges = dict.fromkeys(use.edge for use in self.boundary)
        return tuple(edge for edge in edges if isinstance(edge, NewEdge) and edge.role != "pole" and edge not in rails)


@dataclass(frozen=True)
class PatchPlan:
    """One face of a corner, between strips that end there.

    ``vertex`` is the number of the vertex that the corner takes the place of, ``spine`` has those of the blended edges
    that end there. Unlike that of a strip, the boundary goes around the outward normal of the solid counter-clockwise.
    Where the face ``is_inverted``, that is the opposite of the normal of its surface.
    """

    vertex: int
    spine: tuple[int, ...]
    surface: PlannedSurface
    boundary: tuple[EdgeUse, ...]
    is_inverted: bool = False


@dataclass(frozen=True)
class SolidPlan:
    """What becomes of a solid: the blend faces that it gets, and every face of it whose boundary changes, or that goes.

    Blend faces are ``strips`` along edges and ``patches`` at corners.
    ``consumed_faces`` lie between rails that meet on them; ``swallowed_faces`` hang on loops inside a strip.
    """

    strips: tuple[StripPlan, ...]
    faces: tuple[FacePlan, ...]
    consumed_faces: tuple[int, ...] = ()
    swallowed_faces: tuple[int, ...] = ()
    patches: tuple[PatchPlan, ...] = ()

    @cached_property
    def edges(self) -> tuple[PlannedEdge, ...]:
        """Every new edge and every piece of an old one, once."""
        return tuple(dict.fromkeys(self._list_edges()))

    @cached_property
    def vertices(self) -> tuple[PlannedVertex, ...]:
        """Every new vertex, once."""
        ends = (vertex for edge in self.edges for vertex in edge.vertices)
        return tuple(dict.fromkeys(vertex for vertex in ends if not vertex.number))

    @property
    def removed_faces(self) -> tuple[int, ...]:
        """The numbers of the faces of the input of which nothing remains."""
        past_ends = (number for strip in self.strips for number in strip.removed_faces)
        return (*past_ends, *self.consumed_faces, *self.swallowed_faces)

    @property
    def removed_edges(self) -> tuple[int, ...]:
        """The numbers of the edges of the input of which nothing remains."""
        changes = [change for face in self.faces for change in face.pieces.items()]
        kept = {number for number, pieces in changes if any(isinstance(one, EdgePiece | KeptEdge) for one in pieces)}
        return tuple(sorted({number for number, _ in changes} - kept))

    def _list_edges(self) -> Iterator[PlannedEdge]:
        for strip in self.strips:
            yield from (use.edge for use in strip.boundary)
            yield from (use.edge for cap in strip.caps for use in cap.boundary)
        for patch in self.patches:
            yield from (use.edge for use in patch.boundary)
        for face in self.faces:
            yield from (use.edge for use in face.added)
            yield from (one for pieces in face.pieces.values() for one in pieces if not isinstance(one, KeptEdge))

    def __str__(self) -> str:
        lines = [f"{len(self.vertices)} new vertices, {len(self.edges)} edges made or cut"]
        for strip in self.strips:
            first, second = strip.support_faces
            ends = f", {len(strip.caps)} flat ends" if strip.caps else ""
            spine = ", ".join(map(str, strip.spine))
            lines.append(f"blend of edge {spine} between faces {first} and {second}, {len(strip.boundary)} sides{ends}")
        for patch in self.patches:
            spine = ", ".join(map(str, patch.spine))
            lines.append(f"patch at vertex {patch.vertex} between edges {spine}, {len(patch.boundary)} sides")
        if self.removed_faces:
            lines.append(f"faces gone: {', '.join(map(str, self.removed_faces))}")
        for face in self.faces:
            cut = ", ".join(f"{number} in {len(pieces)}" for number, pieces in sorted(face.pieces.items()))
            roles = Counter(use.edge.role for use in face.added if isinstance(use.edge, NewEdge))
            added = ", ".join(f"{count} {role}" for role, count in roles.items())
            axis = ", axis turned" if face.surface is not None else ""
            lines.append(f"face {face.number}: edges cut: {cut or 'none'}; added: {added or 'none'}{axis}")
        return "\n".join(lines)
