"""Two strips that end beside a sharp edge: which of their sides are on the face that both run on, which on walls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Vertex

from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.shell_editing.mitre_curve import MitredSurface
from cqblend.brep.shell_editing.strip_end import PlacedEnd
from cqblend.brep.shell_editing.strip_placement import StripPlacement
from cqblend.errors import TopologyError

_Item = TypeVar("_Item")


@dataclass(frozen=True)
class MitredStrip:
    """One of two strips: its end (0 or 1), and which of its sides (0 or 1) is on the common face."""

    placement: StripPlacement
    end: int
    common: int

    @property
    def vertex(self) -> TopoDS_Vertex:
        """The vertex of its edge."""
        return self.placement.joint.spine.vertices[self.end]

    @property
    def wall(self) -> int:
        """Its side on its wall."""
        return 1 - self.common

    @property
    def common_face(self) -> SupportFace:
        """The common face."""
        return self.placement.joint.sides[self.common]

    @property
    def common_number(self) -> int:
        """The number of the common face in the solid."""
        return self.placement.face_numbers[self.common]

    @property
    def wall_face(self) -> SupportFace:
        """Its wall."""
        return self.placement.joint.sides[self.wall]

    @property
    def wall_number(self) -> int:
        """The number of its wall in the solid."""
        return self.placement.face_numbers[self.wall]

    @property
    def surface(self) -> MitredSurface:
        """Its surface."""
        start = self.placement.locate_edge_parameter(float(self.end))
        return MitredSurface(self.placement.strip, self.end, self.common, start)

    def order(self, pair: tuple[_Item, _Item]) -> tuple[_Item, _Item]:
        """Return what is at its rail on the common face and at that on the wall in the order of its sides."""
        return pair if self.common == 0 else pair[::-1]

    def enters_by(self, side: int) -> bool:
        """Whether the boundary of a support face comes along the rail there to this end, and does not leave it."""
        runs_along_rail = (self.placement.sides[side].outward > 0) == (side == 0)
        return runs_along_rail == (self.end == 1)


def pair_strips(ends: Sequence[PlacedEnd]) -> tuple[MitredStrip, MitredStrip]:
    """Return two strips that end beside a sharp edge: it and their edges go around the vertex counter-clockwise.

    That is the first edge, the second, and the sharp one.
    """
    first, second = ends
    return (
        MitredStrip(first.placement, first.end, first.end),
        MitredStrip(second.placement, second.end, 1 - second.end),
    )


def find_sharp_edge(one: MitredStrip, other: MitredStrip) -> TopoDS_Edge:
    """Return the edge at the vertex of two strips in which their walls meet.

    Raises
    ------
    TopologyError
        If there is not exactly one.
    """
    index, walls = one.placement.index, {one.wall_number, other.wall_number}
    edges = [
        edge
        for edge in index.edges_at_vertex(one.vertex)
        if {index.faces.find_number(face) for face in index.faces_at_edge(edge)} == walls
    ]
    if len(edges) != 1 or len(walls) != 2:
        raise TopologyError("the faces beside the two blends do not meet in one sharp edge there")
    return TopoDS.Edge_s(edges[0])
