"""Loops of trimmed faces carried to the plane, run by run.

Exists because a piece's boundary comes from three kinds of curve: rails between the strips of one face, edges of the
shape, which may cross the strips anyhow, and cuts along rulings. Each becomes a draft that knows its vertices flat and
in space and the lengths its segments stand for; the neighbour across has a draft of the same key. Must not know how
drafts are bowed and joined.
"""

from collections import defaultdict
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from cqblend.errors import CqblendError, GeometryError
from cqblend.patterns.flatten.arc_length import ArcLength
from cqblend.patterns.flatten.flat_face import DividedPatch, UnrolledStrip, UnrollOptions, unroll_strips
from cqblend.patterns.outline import plane_path
from cqblend.patterns.outline.pieces import RunKind
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.trim import domain_cells
from cqblend.patterns.trim.domain_cells import BoundaryStep, DomainCell, DomainSide
from cqblend.patterns.trim.shared_vertices import EdgeVertices, UseWithLines, sample_edge
from cqblend.patterns.trim.trimmed_patch import PatchEdge, PatchShell
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array

_STRAIGHT_EXCESS = 1e-13
"""An arc that is longer than its chord by this part only is straight: the rest is rounding."""

_JOINT_GAP = 1e-8
"""Mm: a tenth of the tolerance that OCCT's vertices have."""

_STILL_SHARE = 1e-13
"""A rail stands still where it moves by less than this part of its length."""

_VERTEX_MERGE_SHARE = 1e-9
"""Vertices closer together than this part of their run are one."""


@dataclass(slots=True, eq=False)
class RunDraft:
    """A run before it is bowed.

    Its vertices, flat; where the exact curve is between them, (n, PARTS - 1, 2), at equal steps of the parameter; the
    vertices in space, and their parameters on the strip or the plane; the lengths that its segments stand for. `rising`
    tells whether it runs in the sense of its key. A pole has no key. On planes it may be `drawn` exactly.
    """

    key: Hashable | None
    kind: RunKind
    points: Array
    between: Array
    space: Array
    places: Array
    lengths: Array
    rising: bool
    inward: bool = False
    drawn: Curve | None = None

    def reverse_run(self) -> "RunDraft":
        """Return the same run backwards."""
        return replace(
            self,
            points=self.points[::-1],
            between=self.between[::-1, ::-1],
            space=self.space[::-1],
            places=self.places[::-1],
            lengths=self.lengths[::-1],
            rising=not self.rising,
            drawn=self.drawn and self.drawn.reverse(),
        )

    def drop_inner_vertices(self) -> "RunDraft":
        """Return the run without its inner vertices, as long as before."""
        return replace(
            self,
            points=self.points[[0, -1]],
            between=_sample_chord(self.points[[0, -1]]),
            space=self.space[[0, -1]],
            places=self.places[[0, -1]],
            lengths=self.lengths.sum()[None],
        )

    def to_trim_curve(self) -> Array | Curve:
        """Return the run in the parameters of the strip or plane, as it is drawn if that joins the next runs."""
        if self.drawn is not None:
            apart = np.abs(self.drawn(self.drawn.breaks[[0, -1]]) - self.places[[0, -1]]).max()
            if apart < _JOINT_GAP:
                return self.drawn
        return self.places

    @property
    def chord_lengths(self) -> Array:
        """Lengths of the chords, (n,)."""
        return np.asarray(np.linalg.norm(np.diff(self.points, axis=0), axis=1))

    @property
    def curve_lengths(self) -> Array:
        """Lengths of the exact curve in the plane, nearly, (n,)."""
        starts, stops = self.points[:-1, None], self.points[1:, None]
        steps = np.diff(np.concatenate([starts, self.between, stops], axis=1), axis=1)
        return np.asarray(np.linalg.norm(steps, axis=2).sum(axis=1))

    def to_path(self) -> Path:
        """Return the run with each segment bowed to its length, outwards where nothing tells the side.

        The end of a strip is straight, and becomes one arc: inwards if it is to follow another end.
        """
        bent = self.lengths - self.chord_lengths > _STRAIGHT_EXCESS * self.lengths
        bows = np.where(bent, plane_path.solve_bulges(self.chord_lengths, self.lengths), 0.0)
        if self.kind == "end":
            return Path(self.points, -bows if self.inward else bows)
        chord, arm = np.diff(self.points, axis=0), self.between[:, plane_path.ARC_SAMPLES // 2 - 1] - self.points[:-1]
        inwards = chord[:, 0] * arm[:, 1] - chord[:, 1] * arm[:, 0] > 1e-9 * (chord**2).sum(axis=1)
        return Path(self.points, np.where(inwards, -bows, bows))

    def measure_arc_error(self) -> Array:
        """Return how far the flat curve is from each segment or arc of the path, mm; (n,).

        Zero at ends of strips: their bows reach beyond the last ruling by what the edge is off that.
        """
        return (
            np.zeros(len(self.between))
            if self.kind == "end"
            else plane_path.measure_arc_deviations(self.to_path(), self.between)
        )


def _sample_chord(ends: Array) -> Array:
    """Return points (1, PARTS - 1, 2) of the segment between two ends (2, 2)."""
    part = np.arange(1, plane_path.ARC_SAMPLES)[:, None] / plane_path.ARC_SAMPLES
    return np.asarray((ends[0] + part * (ends[1] - ends[0]))[None])


def _subdivide_parameters(t: Array) -> Array:
    """Return parameters (n, PARTS - 1) between neighbours of parameters (n + 1,)."""
    return np.asarray(
        t[:-1, None] + np.diff(t)[:, None] * np.arange(1, plane_path.ARC_SAMPLES) / plane_path.ARC_SAMPLES
    )


@dataclass(slots=True, eq=False)
class PieceDraft:
    """A piece on its way: where it is from, and its loops."""

    face: DividedPatch
    row: int
    span: tuple[float, float]
    laying: UnrolledStrip | None
    loops: list[list[RunDraft]]


class SampledEdges:
    """The vertices along all edges, and the lengths between them."""

    def __init__(
        self,
        skin: PatchShell,
        faces: Sequence[DividedPatch],
        wishes: UnrollOptions,
        extra: Mapping[int, Array] | None = None,
    ) -> None:
        self.edges, self.extra, self.tolerance = skin.edges, extra or {}, wishes.tolerance
        users: dict[int, list[UseWithLines]] = defaultdict(list)
        sagittas: dict[int, float] = defaultdict(lambda: np.inf)
        finer: dict[int, float] = defaultdict(lambda: 1.0)
        least: dict[int, int] = defaultdict(lambda: 1)
        for face in faces:
            lines = face.make_cut_lines()
            for loop in face.patch.loops:
                for use in loop:
                    least[use.edge] = max(least[use.edge], domain_cells.MIN_CORNERS + 1 - len(loop))
            for use in (use for loop in face.patch.loops for use in loop):
                users[use.edge].append((use, lines, face.extent))
                finer[use.edge] = max(finer[use.edge], face.finer)
                if face.strips:
                    sagittas[use.edge] = min(sagittas[use.edge], wishes.tolerance / face.finer / 2)
        self.samples: dict[int, EdgeVertices] = {}
        self.uv: dict[int, Array] = {}  # by identity of the use
        self.lengths: dict[int, Array] = {}
        self.refused: dict[int, CqblendError] = {}
        for number, uses in users.items():
            edge = skin.edges[number]
            try:
                self._add_edge(edge, uses, wishes.flat / finer[number], sagittas[number], least[number])
            except CqblendError as error:
                self.refused[number] = error

    def _add_edge(
        self, edge: PatchEdge, uses: Sequence[UseWithLines], tolerance: float, sagitta: float, least: int
    ) -> None:
        samples = sample_edge(edge, uses, tolerance, sagitta, least, self.extra.get(edge.index, ()))
        self.samples[edge.index] = samples
        self.uv |= {id(use): uv for (use, _, _), uv in zip(uses, samples.uv, strict=True)}
        if edge.degenerate:
            self.lengths[edge.index] = np.zeros(len(samples.t) - 1)
        elif edge.curve is None:
            raise GeometryError("it has no curve in space, only curves on its faces; export the shape anew")
        else:
            self.lengths[edge.index] = np.diff(ArcLength(edge.curve)(edge.parameter(samples.t)))

    def make_sides(self, face: DividedPatch) -> list[list[DomainSide]]:
        """Return the loops of a patch in its parameter plane; a side's `use` counts the uses of the patch.

        Where a side ends on a line, the next one begins there.

        Raises
        ------
        CqblendError
            One of its edges could not be sampled.
        """
        loops, count, lines = [], 0, face.make_cut_lines()
        for loop in face.patch.loops:
            sides = []
            for use in loop:
                if use.edge in self.refused:
                    raise self.refused[use.edge].with_details(shape=f"edge {use.edge}")
                uv = self.uv[id(use)]
                sides.append(DomainSide(count, uv if use.forward else uv[::-1]))
                count += 1
            for side, after in zip(sides, [*sides[1:], sides[0]], strict=True):
                for axis in (0, 1):
                    here, there = side.points[-1, axis], after.points[0, axis]
                    after.points[0, axis] = here if here in lines.list_values(axis) else there
                    side.points[-1, axis] = after.points[0, axis]
            loops.append(sides)
        return loops


def flatten_patch_loops(face: DividedPatch, edges: SampledEdges, wishes: UnrollOptions) -> list[PieceDraft]:
    """Cut a patch's loops into the cells of its strips and carry them to the plane."""
    lines = face.make_cut_lines()
    values = (lines.list_values(0), lines.list_values(1))
    found = domain_cells.cut_domain(edges.make_sides(face), lines)
    breaks: dict[tuple[int, int], set[float]] = defaultdict(set)
    for step in (step for cell in found for loop in cell.loops for step in loop):
        for axis in (0, 1):
            for vertex in (step.start, step.stop):
                on = np.flatnonzero(values[axis] == vertex[axis])
                if len(on):
                    breaks[axis, int(on[0])].add(vertex[1 - axis])
    rows: dict[int, list[DomainCell]] = defaultdict(list)
    for cell in found:
        rows[cell.row].append(cell)
    layings = unroll_strips(face, _collect_vertices(face, rows, breaks), wishes) if face.strips else {}
    laid = []
    for row, members in sorted(rows.items()):
        laying = layings.get(row)
        carrier = _LoopFlattener(face, row, laying, edges, breaks)
        for cell in members:
            loops = [carrier.flatten_loop(loop) for loop in cell.loops]
            corners = face.to_rail_axes(np.array([step.start for step in cell.loops[0]]))[0]
            laid.append(PieceDraft(face, row, (float(corners.min()), float(corners.max())), laying, loops))
    return laid


def _collect_vertices(
    face: DividedPatch, rows: Mapping[int, Sequence[DomainCell]], breaks: Mapping[tuple[int, int], set[float]]
) -> dict[int, Array]:
    """Return, for every strip that has cells, the vertices on it and its borders: (t, across) of each."""
    vertices = {}
    for row, members in rows.items():
        corners = np.array([step.start for cell in members for loop in cell.loops for step in loop])
        borders = zip(face.strips[row].span, (row - 1, row), strict=True)
        broken = [(x, end) for end, i in borders for x in breaks[face.across_axis, i]]
        vertices[row] = np.concatenate([np.stack(face.to_rail_axes(corners), axis=-1), np.reshape(broken, (-1, 2))])
    return vertices


class _LoopFlattener:
    """Carries the loops of one strip's cells to the plane."""

    def __init__(
        self,
        face: DividedPatch,
        row: int,
        laying: UnrolledStrip | None,
        edges: SampledEdges,
        breaks: dict[tuple[int, int], set[float]],
    ) -> None:
        self.face, self.row, self.laying, self.edges, self.breaks = face, row, laying, edges, breaks
        self.uses = [use for loop in face.patch.loops for use in loop]
        self.reach = [ArcLength(rail) for rail in laying.rails] if laying else []

    def flatten_loop(self, steps: Sequence[BoundaryStep]) -> list[RunDraft]:
        """Return the runs of a closed chain of steps, the ends of each made the beginning of the next."""
        drafts = [self._make_run(group) for group in self._group_steps(steps)]
        if not self.face.patch.outward:
            drafts = [draft.reverse_run() for draft in reversed(drafts)]
        for draft, after in zip(drafts, [*drafts[1:], drafts[0]], strict=True):
            draft.points = np.concatenate([draft.points[:-1], after.points[:1]])
            draft.space = np.concatenate([draft.space[:-1], after.space[:1]])
            draft.places = np.concatenate([draft.places[:-1], after.places[:1]])
        return drafts

    def _group_steps(self, steps: Sequence[BoundaryStep]) -> list[list[BoundaryStep]]:
        """Break a closed chain where the border changes, or where a neighbour's does."""
        pieces = [part for step in steps for part in self._split_at_neighbours(step)]
        starts = [
            i
            for i, (before, after) in enumerate(zip([pieces[-1], *pieces[:-1]], pieces, strict=True))
            if self._is_run_boundary(before, after)
        ]
        if not starts:
            return [pieces]
        pieces = pieces[starts[0] :] + pieces[: starts[0]]
        bounds = [i - starts[0] for i in starts] + [len(pieces)]
        return [pieces[i:j] for i, j in pairwise(bounds)]

    def _split_at_neighbours(self, step: BoundaryStep) -> list[BoundaryStep]:
        """Break a step on a line wherever a neighbouring cell has a vertex."""
        if step.use is not None:
            return [step]
        axis, _ = step.line
        start, stop = step.start[1 - axis], step.stop[1 - axis]
        inner = sorted(x for x in self.breaks[step.line] if min(start, stop) < x < max(start, stop))
        stops = [start, *(inner if start < stop else inner[::-1]), stop]
        value = step.start[axis]
        corners = [(value, x) if axis == 0 else (x, value) for x in stops]
        return [replace(step, start=a, stop=b) for a, b in pairwise(corners)]

    def _is_run_boundary(self, before: BoundaryStep, after: BoundaryStep) -> bool:
        if before.use is None or before.use != after.use:
            return True
        return self._find_vertex_index(after, 0) in self.edges.samples[self.uses[before.use].edge].strip_breaks

    def _find_vertex_index(self, step: BoundaryStep, end: int) -> int:
        """Return the index among the samples of its edge of a step's start (0) or stop (1)."""
        assert step.use is not None
        use, place = self.uses[step.use], step.places[end]
        return place if use.forward else len(self.edges.samples[use.edge].t) - 1 - place

    def _make_run(self, steps: list[BoundaryStep]) -> RunDraft:
        return self._make_line_run(steps[0]) if steps[0].use is None else self._make_edge_run(steps)

    def _make_edge_run(self, steps: list[BoundaryStep]) -> RunDraft:
        assert steps[0].use is not None
        use = self.uses[steps[0].use]
        edge, samples = self.edges.edges[use.edge], self.edges.samples[use.edge]
        passed = [self._find_vertex_index(steps[0], 0), *(self._find_vertex_index(step, 1) for step in steps)]
        low, high, rising = min(passed), max(passed), passed[0] < passed[-1]
        window = slice(low, high + 1)
        t, uv = samples.t[window], self.edges.uv[id(use)][window]
        inner = _subdivide_parameters(t)
        if self.face.patch.frame is not None:
            space, places = edge.points(t), uv
            points, between = (
                self.face.patch.frame.to_local_coords(some) for some in (space, edge.points(inner.ravel()))
            )
        else:
            (points, places), (between, _) = self._flatten_points(uv), self._flatten_points(use.pcurve(inner.ravel()))
            space = self._map_to_space(places)
        kind: RunKind = "trim" if self._is_oblique(uv) else "rail" if self._is_along_rails(uv) else "end"
        lengths = self.edges.lengths[use.edge][low:high]
        key = None if edge.degenerate else ("edge", use.edge, low, high)
        draft = RunDraft(key, kind, points, between.reshape(*inner.shape, 2), space, places, lengths, True)
        if self.face.patch.frame is not None and edge.curve is not None:
            draft.drawn = self.face.patch.frame.project_curve(edge.curve.clip(*edge.parameter(t[[0, -1]])))
        return draft if rising else draft.reverse_run()

    def _pick_rail_nodes(self, side: int, ends: Array) -> Array:
        """Return the nodes along a rail from one parameter to another, one only where the rail stands still."""
        assert self.laying is not None
        nodes, near = self.laying.flat.nodes, _VERTEX_MERGE_SHARE * (ends[1] - ends[0])
        r = np.concatenate([ends[:1], nodes[(nodes > ends[0] + near) & (nodes < ends[1] - near)], ends[1:]])
        s = self.reach[side](r)
        moves = np.diff(s) > _STILL_SHARE * self.reach[side].length
        # the last of those that stand at the end is the end
        kept = np.append(True, moves)
        kept[-1] = True
        kept[1:-1] &= s[-1] - s[1:-1] > _STILL_SHARE * self.reach[side].length
        return np.asarray(r[kept])

    def _flatten_points(self, uv: Array) -> tuple[Array, Array]:
        """Return points of the parameter plane in the plane, and on the strip."""
        assert self.laying is not None
        r, w = self.laying.locate_on_ruling(*self.face.to_rail_axes(uv))
        return self.laying.flat(r, w), np.stack([r, w], axis=-1)

    def _map_to_space(self, places: Array) -> Array:
        """Return where points (r, w) of the strip are in space."""
        assert self.laying is not None
        first, second = (rail(places[:, 0]) for rail in self.laying.rails)
        return np.asarray(first + places[:, 1:] * (second - first))

    def _is_oblique(self, uv: Array) -> bool:
        return bool((np.ptp(uv, axis=0) > 1e-6 * np.array(self.face.extent)).all())

    def _is_along_rails(self, uv: Array) -> bool:
        return bool(np.ptp(uv[:, self.face.across_axis]) < np.ptp(uv[:, 1 - self.face.across_axis]))

    def _make_line_run(self, step: BoundaryStep) -> RunDraft:
        """Return the run along a rail, or across the strip along a ruling at which it is cut."""
        assert self.laying is not None
        laying, flat = self.laying, self.laying.flat
        axis, index = step.line
        start, stop = step.start[1 - axis], step.stop[1 - axis]
        low, high = min(start, stop), max(start, stop)
        key = ("line", id(self.face), axis, index, low, high)
        if axis == self.face.across_axis:
            side = 1 if index == self.row else 0
            ends, w = laying.locate_on_ruling(np.array([low, high]), np.full(2, laying.strip.span[side]))
            r = self._pick_rail_nodes(side, ends)
            w = np.full(len(r), float(side))
            between, lengths = flat(_subdivide_parameters(r), w[:-1, None]), np.diff(self.reach[side](r))
            kind: RunKind = "rail"
        else:
            r, w = laying.locate_on_ruling(np.full(2, step.start[axis]), np.array([low, high]))
            between, lengths = _sample_chord(flat(r, w)), np.zeros(1)
            kind = "cut"
        places = np.stack([r, w], axis=-1)
        draft = RunDraft(key, kind, flat(r, w), between, self._map_to_space(places), places, lengths, True)
        return draft if start < stop else draft.reverse_run()
