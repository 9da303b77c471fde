"""The vertices along the edges of divided faces, and the lengths between them, which both faces at an edge share.

Faces are divided again until their pieces are sound, and edges are sampled again with them: only those that a changed
face uses, or that need more vertices than they have. Depends on divided faces and on what trims them.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from cqblend.errors import CqblendError, GeometryError
from cqblend.patterns.flattening.arc_length import ArcLength
from cqblend.patterns.flattening.flat_face import DividedPatch
from cqblend.patterns.trimming.domain_cells import MIN_CORNERS, DomainSide
from cqblend.patterns.trimming.shared_vertices import CutEdgeUse, EdgeVertices, sample_edge
from cqblend.patterns.trimming.trimmed_patch import EdgeUse, PatchEdge, PatchShell, UseKey
from cqblend.splines.bernstein import Array
from cqblend.unroll_options import UnrollOptions


@dataclass(frozen=True, slots=True, eq=False)
class _EdgeDemand:
    """What the vertices along an edge are chosen for.

    Attributes
    ----------
    uses
        Of the edge, with the divided face of each.
    required_parameters
        At which there are to be vertices.
    """

    uses: tuple[tuple[UseKey, EdgeUse, DividedPatch], ...]
    required_parameters: Array

    def is_same(self, other: "_EdgeDemand") -> bool:
        """Whether the vertices for another demand of the same edge are the same: no face was divided again."""
        faces, others = ([face for _, _, face in demand.uses] for demand in (self, other))
        return faces == others and np.array_equal(self.required_parameters, other.required_parameters)


@dataclass(frozen=True, slots=True, eq=False)
class _SampledEdge:
    """An edge with its vertices: the lengths (n - 1,) between them, mm, or why it could not be sampled."""

    demand: _EdgeDemand
    vertices: EdgeVertices | None = None
    lengths: Array = field(default_factory=lambda: np.empty(0))
    error: CqblendError | None = None


class SampledEdges:
    """The vertices along all edges that the loops of given faces use, and the lengths between them.

    Both faces at an edge take them from here, so that both sides of a seam have the same vertices and lengths.

    Parameters
    ----------
    shell
        With the edges.
    faces
        Whose loops use them.
    options
        What is asked of the pattern.
    required_parameters
        By number of the edge: parameters at which it needs vertices.
    previous
        The edges as they were sampled for an earlier division of the faces; what has not changed is taken from there.

    Attributes
    ----------
    edges
        By number: the edges of the shell.
    tolerance
        Between shape and strips, mm.
    samples
        By number of the edge: its vertices.
    lengths
        By number of the edge: lengths (n - 1,) between its vertices, mm.
    use_points
        By use: its vertices (n, 2) in the parameter plane, in the order of the edge. Where one side of a loop ends on a
        cut line, the next one begins exactly there.
    refused
        By number: edges that could not be sampled, and why.
    """

    def __init__(
        self,
        shell: PatchShell,
        faces: Sequence[DividedPatch],
        options: UnrollOptions,
        required_parameters: Mapping[int, Array] | None = None,
        previous: "SampledEdges | None" = None,
    ) -> None:
        self.edges, self.tolerance, self._options = shell.edges, options.tolerance, options
        self._arc_lengths: dict[int, ArcLength] = previous._arc_lengths if previous else {}
        self._sampled: dict[int, _SampledEdge] = {}
        for number, demand in _collect_demands(faces, required_parameters or {}):
            known = previous._sampled.get(number) if previous else None
            if known is None or not known.demand.is_same(demand):
                known = self._sample(shell.edges[number], demand)
            self._sampled[number] = known
        self.samples: dict[int, EdgeVertices] = {}
        self.use_points: dict[UseKey, Array] = {}
        self.lengths: dict[int, Array] = {}
        self.refused: dict[int, CqblendError] = {}
        for number, sampled in self._sampled.items():
            if sampled.error is not None:
                self.refused[number] = sampled.error
            elif sampled.vertices is not None:
                self.samples[number], self.lengths[number] = sampled.vertices, sampled.lengths
                keys = [key for key, _, _ in sampled.demand.uses]
                self.use_points.update(zip(keys, sampled.vertices.uv, strict=True))
        for face in faces:
            self._join_sides(face)

    def _sample(self, edge: PatchEdge, demand: _EdgeDemand) -> _SampledEdge:
        """Choose the vertices along an edge, and measure the lengths between them."""
        faces = [face for _, _, face in demand.uses]
        tolerance = self._options.flat / max(1.0, *(face.refinement for face in faces))
        sagittas = [self._options.tolerance / face.refinement / 2 for face in faces if face.strips]
        loop_sizes = [len(face.patch.loops[key.loop]) for key, _, face in demand.uses]
        uses = [CutEdgeUse(use, face.make_cut_lines(), face.extent) for _, use, face in demand.uses]
        try:
            vertices = sample_edge(
                edge,
                uses,
                tolerance,
                min(sagittas, default=np.inf),
                max(1, MIN_CORNERS + 1 - min(loop_sizes)),
                demand.required_parameters,
            )
            return _SampledEdge(demand, vertices, self._measure_lengths(edge, vertices.t))
        except CqblendError as error:
            return _SampledEdge(demand, error=error)

    def _measure_lengths(self, edge: PatchEdge, t: Array) -> Array:
        """Return the lengths (n - 1,) of an edge between parameters t (n,), mm."""
        if edge.degenerate:
            return np.zeros(len(t) - 1)
        if edge.curve is None:
            raise GeometryError("it has no curve in space, only curves on its faces; export the shape anew")
        if edge.index not in self._arc_lengths:
            self._arc_lengths[edge.index] = ArcLength(edge.curve)
        return np.diff(self._arc_lengths[edge.index](edge.parameter(t)))

    def _join_sides(self, face: DividedPatch) -> None:
        """Let each side of a face's loops begin where the one before ends on a cut line, or else that end there."""
        uses = face.patch.list_uses()
        if any(use.edge in self.refused for _, use in uses):
            return
        lines = face.make_cut_lines()
        values = [lines.list_values(axis) for axis in (0, 1)]
        loops: list[list[Array]] = [[] for _ in face.patch.loops]
        for key, use in uses:
            points = self.use_points[key] = self.use_points[key].copy()
            loops[key.loop].append(points if use.forward else points[::-1])
        for sides in loops:
            for side, following in zip(sides, [*sides[1:], sides[0]], strict=True):
                for axis in (0, 1):
                    if side[-1, axis] in values[axis]:
                        following[0, axis] = side[-1, axis]
                    side[-1, axis] = following[0, axis]

    def make_sides(self, face: DividedPatch) -> list[list[DomainSide]]:
        """Return the loops of a patch in its parameter plane.

        Raises
        ------
        CqblendError
            If one of its edges could not be sampled.
        """
        loops: list[list[DomainSide]] = [[] for _ in face.patch.loops]
        for use_index, (key, use) in enumerate(face.patch.list_uses()):
            if use.edge in self.refused:
                raise self.refused[use.edge].with_details(shape=f"edge {use.edge}")
            uv = self.use_points[key]
            loops[key.loop].append(DomainSide(use_index, uv if use.forward else uv[::-1]))
        return loops

    def is_same_for(self, face: DividedPatch, other: "SampledEdges") -> bool:
        """Whether a face, divided as it was, has the same vertices along all of its edges in both."""
        return all(self._is_same_use(key, use, other) for key, use in face.patch.list_uses())

    def _is_same_use(self, key: UseKey, use: EdgeUse, other: "SampledEdges") -> bool:
        if use.edge not in self.samples or use.edge not in other.samples:
            return False
        here, there = self.samples[use.edge], other.samples[use.edge]
        if not np.array_equal(self.use_points[key], other.use_points[key]):
            return False
        return here is there or (
            np.array_equal(here.t, there.t) and np.array_equal(here.strip_breaks, there.strip_breaks)
        )


def _collect_demands(
    faces: Sequence[DividedPatch], required_parameters: Mapping[int, Array]
) -> Iterator[tuple[int, _EdgeDemand]]:
    """Return, for every edge that faces use, its number and what its vertices are chosen for."""
    uses: dict[int, list[tuple[UseKey, EdgeUse, DividedPatch]]] = defaultdict(list)
    for face in faces:
        for key, use in face.patch.list_uses():
            uses[use.edge].append((key, use, face))
    for number, uses_of_edge in uses.items():
        yield number, _EdgeDemand(tuple(uses_of_edge), required_parameters.get(number, np.empty(0)))
