"""Where the rails of a blend leave their support faces past an end of its edge, and other crossings of edges there."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.brep.shell_editing.face_boundary import BoundaryMark, FaceBoundary
from cqblend.brep.shell_editing.strip_end import RailsTooShortError
from cqblend.brep.shell_editing.strip_placement import StripPlacement
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import CONFUSION, find_end_vertices, is_among, locate_vertex
from cqblend.errors import TopologyError
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class Crossing:
    """A crossing of the boundary of a face: the point (3,), on an edge of that face or at a vertex of it."""

    boundary: FaceBoundary
    mark: BoundaryMark
    point: Array

    @property
    def edge(self) -> TopoDS_Edge:
        """The edge."""
        return self.boundary.uses[self.mark.use]

    @property
    def vertex(self) -> TopoDS_Vertex | None:
        """The vertex, where it is at one."""
        return self.mark.vertex

    def find_entry(self, beyond: FaceBoundary) -> BoundaryMark | None:
        """Return the mark of the crossing on the boundary of a face beyond; None if it is not there.

        Beyond a seam lies the same face, and nothing beyond a free edge.
        """
        if self.vertex is not None:
            return beyond.find_vertex(self.vertex)
        uses = [k for k in beyond.find_uses(self.edge) if beyond is not self.boundary or k != self.mark.use]
        return BoundaryMark(uses[0], self.mark.parameter) if uses else None


@dataclass(frozen=True)
class RailExit:
    """Where a rail leaves its support face: the crossing, and the parameter s of the strip there."""

    crossing: Crossing
    s: float


@dataclass(frozen=True)
class BlendEnd:
    """One end (0 or 1) of a blend in its solid: sizes there, and the boundaries of faces, read when first asked for."""

    placement: StripPlacement
    end: int
    _boundaries: dict[int, FaceBoundary] = field(default_factory=dict)

    @property
    def outward(self) -> float:
        """The sense of s past this end: 1 or -1."""
        return 1.0 if self.end else -1.0

    @property
    def size(self) -> float:
        """How far (mm) the rails are apart at the end of the edge."""
        at_end = np.full(2, self.placement.locate_edge_parameter(float(self.end)))
        first, last = self.placement.strip(at_end, np.array([0.0, 1.0]))
        return float(np.linalg.norm(last - first))

    @property
    def reach(self) -> float:
        """The s up to which a blend is followed past the end of its surface, which may be made longer."""
        at_end = np.array([self.placement.locate_edge_parameter(float(self.end))])
        rate = self.placement.strip.jet(at_end, np.array([0.5]), 1)[1, 0, 0]
        return self.placement.domain[self.end] + self.outward * self.size / float(np.linalg.norm(rate))

    def read_boundary(self, number: int) -> FaceBoundary:
        """Return the boundary of a face of the solid, by its number."""
        if number not in self._boundaries:
            self._boundaries[number] = FaceBoundary(self.placement.index.faces[number])
        return self._boundaries[number]

    def make_short_error(self) -> RailsTooShortError:
        """Return the error that asks for a blend that reaches further past this end."""
        needed = [*self.placement.domain]
        needed[self.end] = self.reach
        first, last = self.placement.strip.to_rail_parameters(np.array(needed)).tolist()
        return RailsTooShortError((first, last))

    def locate_on_support(self, i: int, s: Array) -> Array:
        """Return the parameters (n, 2) of rail ``i`` on its support face.

        Raises
        ------
        TopologyError
            If it is one point.
        """
        pcurve = self.placement.rail_pcurves[i]
        if pcurve is None:
            raise TopologyError(f"the rail on face {self.placement.joint.face_numbers[i]} is one point")
        return pcurve(s)

    def leaves_support(self, i: int) -> bool:
        """Whether the boundary of support face ``i``, FORWARD, leaves its new one where the rail ends, not comes back.

        Rail 1 has what remains of its face to its left, seen from outside, and rail 2 to its right.
        """
        return ((self.placement.sides[i].outward > 0) == (i == 0)) != (self.end == 1)

    def list_cut_uses(self, i: int, crossing: Crossing) -> list[int]:
        """Return the uses of support face ``i`` between the blended edge and where its rail leaves it past this end.

        Raises
        ------
        TopologyError
            If the rail leaves it over another boundary.
        """
        edges = self.placement.joint.spine.edges
        own = [k for k, use in enumerate(crossing.boundary.uses) if is_among(use, edges)]
        found = crossing.boundary.list_until(crossing.mark, own, backward=not self.leaves_support(i))
        if found is None:
            raise TopologyError(f"the rail on face {self.placement.joint.face_numbers[i]} runs into a hole of it")
        return found

    def find_rail_exit(self, i: int) -> RailExit:
        """Return where rail ``i`` leaves its support face, on its way from the middle of the edge past this end.

        Raises
        ------
        RailsTooShortError
            If it does not, as far as it goes.
        TopologyError
            If it does so in no definite point.
        """
        placement, side, v = self.placement, self.placement.sides[i], np.array([float(i)])
        boundary, size = self.read_boundary(placement.face_numbers[i]), self.size
        middle, count = placement.locate_edge_parameter(0.5), SHELL_EDIT_TOLERANCES.rail_chords + 1
        stations = np.linspace(middle, placement.domain[self.end], count)
        passed = [k for k, use in enumerate(boundary.uses) if self._may_pass(use, boundary.face)]
        path = self.locate_on_support(i, stations)
        found = boundary.find_first_crossing(path, side.face_primary.periods, passed)
        if found is None:
            raise self.make_short_error()

        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            """Return the distance of the rail from the edge along both tangents of the face."""
            uv, rate = boundary.evaluate(found.use, float(x[0, 1]))
            n, h = side.face_primary.jet(uv[None]), placement.strip.jet(x[:, 0], v, 1)
            rates = np.stack([h[1, 0, 0], -(n[1, 0] * rate[0] + n[2, 0] * rate[1])], axis=1)
            tangents = n[1:3, 0] / np.linalg.norm(n[1:3, 0], axis=1)[:, None]
            residual = tangents @ (h[0, 0, 0] - n[0, 0])
            return residual[None], (tangents @ rates)[None], np.linalg.norm(rates, axis=0)[None]

        start = np.array([[np.interp(found.share, np.arange(count), stations), found.parameter]])
        x, good = solve_damped_newton(evaluate_system, start, size, size)
        if not good[0]:
            raise TopologyError(f"the rail does not leave face {placement.joint.face_numbers[i]} cleanly there")
        point = placement.strip(x[:, 0], v)[0]
        return RailExit(make_crossing(boundary, found.use, float(x[0, 1]), point), float(x[0, 0]))

    def _may_pass(self, use: TopoDS_Edge, face: TopoDS_Face) -> bool:
        """Whether a rail may cross a use of an edge of its face on its way: those of blended edges, and seams."""
        return BRep_Tool.IsClosed_s(use, face) or is_among(use, self.placement.joint.spine.edges)


def make_crossing(boundary: FaceBoundary, use: int, parameter: float, point: Array) -> Crossing:
    """Return a crossing of a use of an edge, or of that vertex of it which is as near as its tolerance."""
    for stops, vertex in zip((False, True), find_end_vertices(boundary.uses[use]), strict=True):
        if np.linalg.norm(locate_vertex(vertex) - point) <= max(BRep_Tool.Tolerance_s(vertex), CONFUSION):
            return Crossing(boundary, boundary.mark_vertex(use, stops=stops), point)
    return Crossing(boundary, BoundaryMark(use, parameter), point)
