"""Loops of trimmed faces mapped to the plane, run by run.

The loops of a face are cut into the cells of its strips, and each side of a cell is mapped to the plane with the strip
it is on. What comes out are drafts of pieces, made of runs: rails between the strips, stretches of edges, and cuts
along rulings. The run on the other side of a seam has the same key. How runs are bent to the lengths of their seams and
joined to pieces is left to :mod:`cqblend.patterns.piece_assembly`.
"""

from abc import ABC, abstractmethod
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from cqblend.errors import GeometryError
from cqblend.patterns.flattening.flat_face import DividedPatch, UnrolledStrip, unroll_strips
from cqblend.patterns.flattening.sampled_edges import SampledEdges
from cqblend.patterns.outline.pieces import RunKind
from cqblend.patterns.strips.ruled_strip import RuledStrip
from cqblend.patterns.trimming.boundary_run_draft import RunDraft, sample_chord, subdivide_parameters
from cqblend.patterns.trimming.boundary_run_keys import EdgeRunKey, LineRunKey
from cqblend.patterns.trimming.domain_cells import BoundaryStep, DomainCell, EdgeStep, LineStep, cut_domain
from cqblend.patterns.trimming.tolerances import TRIM_TOLERANCES
from cqblend.patterns.trimming.trimmed_patch import EdgeUse, PatchEdge, PlaneFrame
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.unroll_options import UnrollOptions

LineVertices = Mapping[tuple[int, int], set[float]]
"""By axis and index of a cut line: the other parameter at the vertices that cells have on it."""


@dataclass(frozen=True, slots=True, eq=False)
class PieceDraft:
    """A piece before its runs are bent to the lengths of their seams.

    Attributes
    ----------
    face
        That it is part of.
    strip_index
        Of its strip within the face; 0 on a plane.
    rail_extent
        Least and largest parameter t along the rails at the vertices of its outer loop.
    unrolled_strip
        Its strip; None on a plane.
    loops
        Its runs, loop by loop, the outer one first.
    """

    face: DividedPatch
    strip_index: int
    rail_extent: tuple[float, float]
    unrolled_strip: UnrolledStrip | None
    loops: tuple[tuple[RunDraft, ...], ...]


def flatten_patch_loops(
    face: DividedPatch,
    edges: SampledEdges,
    options: UnrollOptions,
    known: Mapping[RuledStrip, UnrolledStrip] | None = None,
) -> list[PieceDraft]:
    """Cut a patch's loops into the cells of its strips and map them to the plane: one draft for each cell.

    `known` are strips of the face that have been laid flat before, with the same options.
    """
    cells = cut_domain(edges.make_sides(face), face.make_cut_lines())
    line_vertices = _collect_line_vertices(face, cells)
    cells_by_strip: dict[int, list[DomainCell]] = defaultdict(list)
    for cell in cells:
        cells_by_strip[cell.strip_index].append(cell)
    unrolled: Mapping[int, UnrolledStrip] = {}
    if face.strips:
        vertices = _collect_strip_vertices(face, cells_by_strip, line_vertices)
        unrolled = unroll_strips(face, vertices, options, known or {})
    drafts = []
    for strip_index, members in sorted(cells_by_strip.items()):
        strip = unrolled.get(strip_index)
        flattener = _make_flattener(face, edges, line_vertices, strip_index, strip)
        for cell in members:
            loops = tuple(flattener.flatten_loop(loop) for loop in cell.loops)
            t = face.to_rail_axes(np.array([step.start for step in cell.loops[0]]))[0]
            drafts.append(PieceDraft(face, strip_index, (float(t.min()), float(t.max())), strip, loops))
    return drafts


def _collect_line_vertices(face: DividedPatch, cells: Iterable[DomainCell]) -> LineVertices:
    lines = face.make_cut_lines()
    values = (lines.list_values(0), lines.list_values(1))
    found: dict[tuple[int, int], set[float]] = defaultdict(set)
    for step in (step for cell in cells for loop in cell.loops for step in loop):
        for axis in (0, 1):
            for vertex in (step.start, step.stop):
                met = np.flatnonzero(values[axis] == vertex[axis])
                if len(met):
                    found[axis, int(met[0])].add(vertex[1 - axis])
    return found


def _collect_strip_vertices(
    face: DividedPatch, cells_by_strip: Mapping[int, Sequence[DomainCell]], line_vertices: LineVertices
) -> dict[int, Array]:
    """Return, for every strip that has cells, the vertices (n, 2) on it and its borders: t along rails, and across."""
    found = {}
    for strip_index, cells in cells_by_strip.items():
        corners = np.array([step.start for cell in cells for loop in cell.loops for step in loop])
        borders = zip(face.strips[strip_index].span, (strip_index - 1, strip_index), strict=True)
        on_borders = [(t, v) for v, i in borders for t in line_vertices.get((face.across_axis, i), ())]
        vertices = [np.stack(face.to_rail_axes(corners), axis=-1), np.reshape(on_borders, (-1, 2))]
        found[strip_index] = np.concatenate(vertices)
    return found


def _make_flattener(
    face: DividedPatch,
    edges: SampledEdges,
    line_vertices: LineVertices,
    strip_index: int,
    unrolled: UnrolledStrip | None,
) -> "_LoopFlattener":
    if unrolled is not None:
        return _StripLoopFlattener(face, edges, line_vertices, strip_index, unrolled)
    if face.patch.frame is not None:
        return _PlaneLoopFlattener(face, edges, line_vertices, face.patch.frame)
    raise GeometryError("it has neither strips nor a plane")


@dataclass(frozen=True, slots=True, eq=False)
class _EdgeStretch:
    """A stretch of an edge: its vertices, as parameters t (n,) of the edge and uv (n, 2) in the parameter plane."""

    use: EdgeUse
    edge: PatchEdge
    t: Array
    uv: Array


@dataclass(frozen=True, slots=True, eq=False)
class _FlatStretch:
    """A stretch of an edge in the plane, with the fields of :class:`RunDraft`."""

    points: Array
    inner_points: Array
    points_3d: Array
    parameters: Array
    exact_curve: Curve | None = None


class _LoopFlattener(ABC):
    """Maps the loops of cells to the plane, run by run."""

    def __init__(self, face: DividedPatch, edges: SampledEdges, line_vertices: LineVertices) -> None:
        self.face, self.edges, self.line_vertices = face, edges, line_vertices
        self.uses = face.patch.list_uses()

    @abstractmethod
    def _flatten_stretch(self, stretch: _EdgeStretch) -> _FlatStretch:
        """Return the stretch of an edge in the plane."""

    @abstractmethod
    def _make_line_run(self, step: LineStep) -> RunDraft:
        """Return the run along a cut line."""

    def flatten_loop(self, steps: Sequence[BoundaryStep]) -> tuple[RunDraft, ...]:
        """Return the runs of a closed chain of steps; each ends exactly where the next one begins."""
        runs = [self._make_run(group) for group in self._group_steps(steps)]
        if not self.face.patch.outward:
            runs = [run.reverse_run() for run in reversed(runs)]
        return tuple(run.end_where_begins(after) for run, after in zip(runs, [*runs[1:], runs[0]], strict=True))

    def _group_steps(self, steps: Sequence[BoundaryStep]) -> list[list[BoundaryStep]]:
        """Group a closed chain of steps to runs: break it where the edge or line changes, or a neighbour's run ends."""
        parts = [part for step in steps for part in self._split_at_neighbours(step)]
        starts = [
            i
            for i, (before, after) in enumerate(zip([parts[-1], *parts[:-1]], parts, strict=True))
            if self._is_run_boundary(before, after)
        ]
        if not starts:
            return [parts]
        parts = parts[starts[0] :] + parts[: starts[0]]
        bounds = [i - starts[0] for i in starts] + [len(parts)]
        return [parts[i:j] for i, j in pairwise(bounds)]

    def _split_at_neighbours(self, step: BoundaryStep) -> Sequence[BoundaryStep]:
        """Split a step along a cut line wherever a cell on the other side has a vertex."""
        if isinstance(step, EdgeStep):
            return [step]
        axis = step.axis
        start, stop = step.start[1 - axis], step.stop[1 - axis]
        vertices = self.line_vertices.get((axis, step.line_index), ())
        inner = sorted(x for x in vertices if min(start, stop) < x < max(start, stop))
        stops = [start, *(inner if start < stop else inner[::-1]), stop]
        value = step.start[axis]
        corners = [(value, x) if axis == 0 else (x, value) for x in stops]
        return [replace(step, start=a, stop=b) for a, b in pairwise(corners)]

    def _is_run_boundary(self, before: BoundaryStep, after: BoundaryStep) -> bool:
        if not isinstance(before, EdgeStep) or not isinstance(after, EdgeStep) or before.use_index != after.use_index:
            return True
        _, use = self.uses[after.use_index]
        return self._find_vertex_index(after, 0) in self.edges.samples[use.edge].strip_breaks

    def _find_vertex_index(self, step: EdgeStep, end: int) -> int:
        """Return the index of a step's start (0) or stop (1) among the vertices along its edge."""
        _, use = self.uses[step.use_index]
        index = step.point_indices[end]
        return index if use.forward else len(self.edges.samples[use.edge].t) - 1 - index

    def _make_run(self, group: Sequence[BoundaryStep]) -> RunDraft:
        """Return the run of steps along one edge, or of one step along a cut line."""
        if isinstance(group[0], LineStep):
            return self._make_line_run(group[0])
        return self._make_edge_run([step for step in group if isinstance(step, EdgeStep)])

    def _make_edge_run(self, steps: Sequence[EdgeStep]) -> RunDraft:
        use_key, use = self.uses[steps[0].use_index]
        edge, samples = self.edges.edges[use.edge], self.edges.samples[use.edge]
        passed = [self._find_vertex_index(steps[0], 0), *(self._find_vertex_index(step, 1) for step in steps)]
        first, last = min(passed), max(passed)
        t, uv = samples.t[first : last + 1], self.edges.use_points[use_key][first : last + 1]
        flat = self._flatten_stretch(_EdgeStretch(use, edge, t, uv))
        draft = RunDraft(
            key=None if edge.degenerate else EdgeRunKey(use.edge, first, last),
            kind=self._classify_edge_run(uv),
            points=flat.points,
            inner_points=flat.inner_points.reshape(len(t) - 1, -1, 2),
            points_3d=flat.points_3d,
            parameters=flat.parameters,
            lengths=self.edges.lengths[use.edge][first:last],
            exact_curve=flat.exact_curve,
        )
        return draft if passed[0] < passed[-1] else draft.reverse_run()

    def _classify_edge_run(self, uv: Array) -> RunKind:
        """Return whether a stretch of an edge runs along the rails, the rulings, or neither (a trimming curve)."""
        extent = np.ptp(uv, axis=0)
        if (extent > TRIM_TOLERANCES.oblique_extent * np.array(self.face.extent)).all():
            return "trim"
        return "rail" if extent[self.face.across_axis] < extent[1 - self.face.across_axis] else "end"


class _PlaneLoopFlattener(_LoopFlattener):
    """Maps loops of a planar face to its coordinates."""

    def __init__(self, face: DividedPatch, edges: SampledEdges, line_vertices: LineVertices, frame: PlaneFrame) -> None:
        super().__init__(face, edges, line_vertices)
        self.frame = frame

    def _flatten_stretch(self, stretch: _EdgeStretch) -> _FlatStretch:
        edge, t = stretch.edge, stretch.t
        points_3d, inner_points_3d = edge.points(t), edge.points(subdivide_parameters(t).ravel())
        exact_curve = None
        if edge.curve is not None:
            exact_curve = self.frame.project_curve(edge.curve.clip(*edge.parameter(t[[0, -1]])))
        points, inner_points = (self.frame.to_local_coords(points) for points in (points_3d, inner_points_3d))
        return _FlatStretch(points, inner_points, points_3d, stretch.uv, exact_curve)

    def _make_line_run(self, step: LineStep) -> RunDraft:
        raise TypeError(f"a planar face is not cut along lines: {step}")


class _StripLoopFlattener(_LoopFlattener):
    """Maps loops of one strip's cells to the plane with the strip."""

    def __init__(
        self,
        face: DividedPatch,
        edges: SampledEdges,
        line_vertices: LineVertices,
        strip_index: int,
        unrolled: UnrolledStrip,
    ) -> None:
        super().__init__(face, edges, line_vertices)
        self.strip_index, self.unrolled = strip_index, unrolled
        self.rail_lengths = unrolled.flat.rail_lengths

    def _flatten_stretch(self, stretch: _EdgeStretch) -> _FlatStretch:
        inner = stretch.use.pcurve(subdivide_parameters(stretch.t).ravel())
        count = len(stretch.uv)
        points, parameters = self._flatten_points(np.concatenate([stretch.uv, inner]))
        vertices = parameters[:count]
        return _FlatStretch(points[:count], points[count:], self._map_to_space(vertices), vertices)

    def _flatten_points(self, uv: Array) -> tuple[Array, Array]:
        """Return points (n, 2) of the parameter plane mapped to the plane, and as (r, w) of the strip."""
        r, w = self.unrolled.locate_on_ruling(*self.face.to_rail_axes(uv))
        return self.unrolled.flat(r, w), np.stack([r, w], axis=-1)

    def _map_to_space(self, parameters: Array) -> Array:
        """Return the points (n, 3) of the strip at (r, w)."""
        first, second = (rail(parameters[:, 0]) for rail in self.unrolled.rails)
        return np.asarray(first + parameters[:, 1:] * (second - first))

    def _make_line_run(self, step: LineStep) -> RunDraft:
        """Return the run along a rail, or across the strip along a ruling at which it is cut."""
        flat, axis = self.unrolled.flat, step.axis
        start, stop = step.start[1 - axis], step.stop[1 - axis]
        low, high = min(start, stop), max(start, stop)
        kind: RunKind
        if axis == self.face.across_axis:
            kind = "rail"
            side = 1 if step.line_index == self.strip_index else 0
            across = np.full(2, self.unrolled.strip.span[side])
            ends, _ = self.unrolled.locate_on_ruling(np.array([low, high]), across)
            r = self._pick_rail_nodes(side, ends)
            w, lengths = np.full(len(r), float(side)), np.diff(self.rail_lengths[side](r))
            both = flat(np.append(r, subdivide_parameters(r)), float(side))
            points, inner_points = both[: len(r)], both[len(r) :].reshape(len(r) - 1, -1, 2)
        else:
            kind = "cut"
            r, w = self.unrolled.locate_on_ruling(np.full(2, step.start[axis]), np.array([low, high]))
            points, lengths = flat(r, w), np.zeros(1)
            inner_points = sample_chord(points)
        parameters = np.stack([r, w], axis=-1)
        draft = RunDraft(
            key=LineRunKey(self.face.patch.index, axis, step.line_index, low, high),
            kind=kind,
            points=points,
            inner_points=inner_points,
            points_3d=self._map_to_space(parameters),
            parameters=parameters,
            lengths=lengths,
        )
        return draft if start < stop else draft.reverse_run()

    def _pick_rail_nodes(self, side: int, ends: Array) -> Array:
        """Return the nodes (n,) of the flat strip along a rail between two r, without those where it does not move."""
        nodes, distance = self.unrolled.flat.nodes, TRIM_TOLERANCES.edge_vertex_merge * (ends[1] - ends[0])
        r = np.concatenate([ends[:1], nodes[(nodes > ends[0] + distance) & (nodes < ends[1] - distance)], ends[1:]])
        s = self.rail_lengths[side](r)
        stationary = TRIM_TOLERANCES.stationary_rail_step * self.rail_lengths[side].length
        # of the nodes at which the rail has stopped at its end only the end itself is kept
        is_kept = np.append(True, np.diff(s) > stationary)
        is_kept[-1] = True
        is_kept[1:-1] &= s[-1] - s[1:-1] > stationary
        return np.asarray(r[is_kept])
