"""The way around the end of a blend, over whatever faces lie there: from the end of rail 1 to that of rail 2.

It starts where rail 1 leaves its support face, over an edge or a vertex of that face. On the face beyond, it is the
curve in which the blend meets that face, up to the next edge or vertex that it crosses; and so on, until it arrives
where rail 2 leaves its own support face.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from cqblend.blends.network.strip_surface import StripCut
from cqblend.brep.conversion.support_face import SupportFace, read_support_face
from cqblend.brep.shell_editing.end_crossings import BlendEnd, Crossing
from cqblend.brep.shell_editing.face_boundary import BoundaryMark, FaceBoundary
from cqblend.brep.shell_editing.face_following import FaceEntry
from cqblend.brep.shell_editing.strip_end import RailsTooShortError
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.errors import CqblendError, GeometryError, TopologyError
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class PathPiece:
    """The part of the way on one face: the curve in which the blend meets it, and where that enters and leaves."""

    side: SupportFace
    boundary: FaceBoundary
    cut: StripCut
    entry: BoundaryMark
    exit: BoundaryMark
    runs_forward: bool


@dataclass(frozen=True)
class EndPath:
    """A way around the end of a blend.

    ``crossings`` are the points at which pieces start and stop, one more than there are pieces: the first and the last
    as the support faces have them, the others as the face before has them.
    """

    pieces: tuple[PathPiece, ...]
    crossings: tuple[Crossing, ...]


def find_end_path(at: BlendEnd) -> EndPath:
    """Return the way around one end of a blend.

    Raises
    ------
    RailsTooShortError
        If a rail ends before it leaves its face.
    TopologyError, GeometryError
        If there is no such way.
    """
    return _PathSearch(at).find_path()


class _PathSearch:
    """The search for the way around one end of a blend: the first that arrives, of those that can go on."""

    def __init__(self, at: BlendEnd) -> None:
        self.at, self.joint, self.index = at, at.placement.joint, at.placement.index
        self.rail_exits = (at.find_rail_exit(0), at.find_rail_exit(1))
        self.cut_edges = frozenset(
            self.index.edges.find_number(rail_exit.crossing.boundary.uses[k])
            for i, rail_exit in enumerate(self.rail_exits)
            for k in at.list_cut_uses(i, rail_exit.crossing)
        )
        self._attempts = 0

    def find_path(self) -> EndPath:
        """Return the way."""
        first = self.rail_exits[0]
        return self._go_on(EndPath((), (first.crossing,)), np.array([first.s, 0.0, np.nan, np.nan]))

    def _go_on(self, path: EndPath, x: Array) -> EndPath:
        """Return a way that begins with a given one and arrives; x is the point of the curve where that stops."""
        crossing = path.crossings[-1]
        if path.pieces and crossing is self.rail_exits[1].crossing:
            return path
        failures: list[CqblendError] = []
        for entry in self._list_entries(crossing, x):
            for follow in (entry.follow_edge, entry.follow_across, entry.follow_beside):
                self._attempts += 1
                if self._attempts > SHELL_EDIT_TOLERANCES.max_end_attempts:
                    raise TopologyError("a natural end there would run over too many faces")
                try:
                    found = follow()
                except RailsTooShortError as failure:
                    failures.append(failure)
                    continue
                except (TopologyError, GeometryError) as failure:
                    failures.append(failure.with_details(before=f"on {self.joint.name_part(entry.side.face)}, "))
                    continue
                piece = PathPiece(entry.side, entry.boundary, found.cut, entry.mark, found.exit, entry.runs_forward)
                try:
                    return self._go_on(EndPath((*path.pieces, piece), (*path.crossings, found.leaving)), found.x)
                except (TopologyError, GeometryError) as failure:
                    failures.append(failure)
        if not failures:
            part = self.joint.name_part(crossing.edge if crossing.vertex is None else crossing.vertex)
            raise TopologyError(f"there is no face to end on beyond {part}")
        raise next((one for one in failures if isinstance(one, RailsTooShortError)), failures[-1])

    def _list_entries(self, crossing: Crossing, x: Array) -> Iterator[FaceEntry]:
        """Yield the faces that the way can go on to from a crossing: beyond a seam the same face."""
        if crossing.vertex is None:
            faces = self.index.faces_at_edge(crossing.edge)
        else:
            faces = self.index.faces_at_vertex(crossing.vertex)
        for face in [face for face in faces if not face.IsSame(crossing.boundary.face)] or faces:
            number = self.index.faces.find_number(face)
            if number in self.at.placement.face_numbers:
                continue
            boundary = self.at.read_boundary(number)
            mark = crossing.find_entry(boundary)
            if mark is not None:
                side = read_support_face(self.index.faces[number], crossing.point[None])
                yield FaceEntry(self.at, side, boundary, mark, crossing, x, self.rail_exits, self.cut_edges)
