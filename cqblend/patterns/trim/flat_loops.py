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
from cqblend.patterns.flatten.flat_face import DividedPatch, Laying, Wishes, laid_flat
from cqblend.patterns.outline import plane_path
from cqblend.patterns.outline.pieces import RunKind
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.trim import domain_cells
from cqblend.patterns.trim.domain_cells import Cell, Side, Step
from cqblend.patterns.trim.shared_vertices import Samples, Use, sample
from cqblend.patterns.trim.trimmed_patch import Edge, Skin
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array

_STRAIGHT = 1e-13
"""An arc that is longer than its chord by this part only is straight: the rest is rounding."""

_JOINT = 1e-8
"""Mm: a tenth of the tolerance that OCCT's vertices have."""

_STANDS = 1e-13
"""A rail stands still where it moves by less than this part of its length."""

_NEAR = 1e-9
"""Vertices closer together than this part of their run are one."""


@dataclass(slots=True, eq=False)
class Draft:
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

    def turned(self) -> "Draft":
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

    def straightened(self) -> "Draft":
        """Return the run without its inner vertices, as long as before."""
        return replace(
            self,
            points=self.points[[0, -1]],
            between=_on_chord(self.points[[0, -1]]),
            space=self.space[[0, -1]],
            places=self.places[[0, -1]],
            lengths=self.lengths.sum()[None],
        )

    def trim(self) -> Array | Curve:
        """Return the run in the parameters of the strip or plane, as it is drawn if that joins the next runs."""
        if self.drawn is not None:
            apart = np.abs(self.drawn(self.drawn.breaks[[0, -1]]) - self.places[[0, -1]]).max()
            if apart < _JOINT:
                return self.drawn
        return self.places

    @property
    def chords(self) -> Array:
        """Lengths of the chords, (n,)."""
        return np.asarray(np.linalg.norm(np.diff(self.points, axis=0), axis=1))

    @property
    def extents(self) -> Array:
        """Lengths of the exact curve in the plane, nearly, (n,)."""
        starts, stops = self.points[:-1, None], self.points[1:, None]
        steps = np.diff(np.concatenate([starts, self.between, stops], axis=1), axis=1)
        return np.asarray(np.linalg.norm(steps, axis=2).sum(axis=1))

    def path(self) -> Path:
        """Return the run with each segment bowed to its length, outwards where nothing tells the side.

        The end of a strip is straight, and becomes one arc: inwards if it is to follow another end.
        """
        bent = self.lengths - self.chords > _STRAIGHT * self.lengths
        bows = np.where(bent, plane_path.bulges(self.chords, self.lengths), 0.0)
        if self.kind == "end":
            return Path(self.points, -bows if self.inward else bows)
        chord, arm = np.diff(self.points, axis=0), self.between[:, plane_path.PARTS // 2 - 1] - self.points[:-1]
        inwards = chord[:, 0] * arm[:, 1] - chord[:, 1] * arm[:, 0] > 1e-9 * (chord**2).sum(axis=1)
        return Path(self.points, np.where(inwards, -bows, bows))

    def off(self) -> Array:
        """Return how far the flat curve is from each segment or arc of the path, mm; (n,).

        Zero at ends of strips: their bows reach beyond the last ruling by what the edge is off that.
        """
        return np.zeros(len(self.between)) if self.kind == "end" else plane_path.off_arcs(self.path(), self.between)


def _on_chord(ends: Array) -> Array:
    """Return points (1, PARTS - 1, 2) of the segment between two ends (2, 2)."""
    part = np.arange(1, plane_path.PARTS)[:, None] / plane_path.PARTS
    return np.asarray((ends[0] + part * (ends[1] - ends[0]))[None])


def _inner(t: Array) -> Array:
    """Return parameters (n, PARTS - 1) between neighbours of parameters (n + 1,)."""
    return np.asarray(t[:-1, None] + np.diff(t)[:, None] * np.arange(1, plane_path.PARTS) / plane_path.PARTS)


@dataclass(slots=True, eq=False)
class Laid:
    """A piece on its way: where it is from, and its loops."""

    face: DividedPatch
    row: int
    span: tuple[float, float]
    laying: Laying | None
    loops: list[list[Draft]]


class Edges:
    """The vertices along all edges, and the lengths between them."""

    def __init__(
        self, skin: Skin, faces: Sequence[DividedPatch], wishes: Wishes, extra: Mapping[int, Array] | None = None
    ) -> None:
        self.edges, self.extra, self.tolerance = skin.edges, extra or {}, wishes.tolerance
        users: dict[int, list[Use]] = defaultdict(list)
        sagittas: dict[int, float] = defaultdict(lambda: np.inf)
        finer: dict[int, float] = defaultdict(lambda: 1.0)
        least: dict[int, int] = defaultdict(lambda: 1)
        for face in faces:
            lines = face.lines()
            for loop in face.patch.loops:
                for use in loop:
                    least[use.edge] = max(least[use.edge], domain_cells.CORNERS + 1 - len(loop))
            for use in (use for loop in face.patch.loops for use in loop):
                users[use.edge].append((use, lines, face.extent))
                finer[use.edge] = max(finer[use.edge], face.finer)
                if face.strips:
                    sagittas[use.edge] = min(sagittas[use.edge], wishes.tolerance / face.finer / 2)
        self.samples: dict[int, Samples] = {}
        self.uv: dict[int, Array] = {}  # by identity of the use
        self.lengths: dict[int, Array] = {}
        self.refused: dict[int, CqblendError] = {}
        for number, uses in users.items():
            edge = skin.edges[number]
            try:
                self._sample(edge, uses, wishes.flat / finer[number], sagittas[number], least[number])
            except CqblendError as error:
                self.refused[number] = error

    def _sample(self, edge: Edge, uses: Sequence[Use], tolerance: float, sagitta: float, least: int) -> None:
        samples = sample(edge, uses, tolerance, sagitta, least, self.extra.get(edge.index, ()))
        self.samples[edge.index] = samples
        self.uv |= {id(use): uv for (use, _, _), uv in zip(uses, samples.uv, strict=True)}
        if edge.degenerate:
            self.lengths[edge.index] = np.zeros(len(samples.t) - 1)
        elif edge.curve is None:
            raise GeometryError("it has no curve in space, only curves on its faces; export the shape anew")
        else:
            self.lengths[edge.index] = np.diff(ArcLength(edge.curve)(edge.parameter(samples.t)))

    def sides(self, face: DividedPatch) -> list[list[Side]]:
        """Return the loops of a patch in its parameter plane; a side's `use` counts the uses of the patch.

        Where a side ends on a line, the next one begins there.

        Raises
        ------
        CqblendError
            One of its edges could not be sampled.
        """
        loops, count, lines = [], 0, face.lines()
        for loop in face.patch.loops:
            sides = []
            for use in loop:
                if use.edge in self.refused:
                    error = self.refused[use.edge]
                    raise type(error)(f"edge {use.edge}: {error}")
                uv = self.uv[id(use)]
                sides.append(Side(count, uv if use.forward else uv[::-1]))
                count += 1
            for side, after in zip(sides, [*sides[1:], sides[0]], strict=True):
                for axis in (0, 1):
                    here, there = side.points[-1, axis], after.points[0, axis]
                    after.points[0, axis] = here if here in lines.values(axis) else there
                    side.points[-1, axis] = after.points[0, axis]
            loops.append(sides)
        return loops


def carried(face: DividedPatch, edges: Edges, wishes: Wishes) -> list[Laid]:
    """Cut a patch's loops into the cells of its strips and carry them to the plane."""
    lines = face.lines()
    values = (lines.values(0), lines.values(1))
    found = domain_cells.cut(edges.sides(face), lines)
    breaks: dict[tuple[int, int], set[float]] = defaultdict(set)
    for step in (step for cell in found for loop in cell.loops for step in loop):
        for axis in (0, 1):
            for vertex in (step.start, step.stop):
                on = np.flatnonzero(values[axis] == vertex[axis])
                if len(on):
                    breaks[axis, int(on[0])].add(vertex[1 - axis])
    rows: dict[int, list[Cell]] = defaultdict(list)
    for cell in found:
        rows[cell.row].append(cell)
    layings = laid_flat(face, _vertices(face, rows, breaks), wishes) if face.strips else {}
    laid = []
    for row, members in sorted(rows.items()):
        laying = layings.get(row)
        carrier = _Carrier(face, row, laying, edges, breaks)
        for cell in members:
            loops = [carrier.loop(loop) for loop in cell.loops]
            corners = face.oriented(np.array([step.start for step in cell.loops[0]]))[0]
            laid.append(Laid(face, row, (float(corners.min()), float(corners.max())), laying, loops))
    return laid


def _vertices(
    face: DividedPatch, rows: Mapping[int, Sequence[Cell]], breaks: Mapping[tuple[int, int], set[float]]
) -> dict[int, Array]:
    """Return, for every strip that has cells, the vertices on it and its borders: (t, across) of each."""
    vertices = {}
    for row, members in rows.items():
        corners = np.array([step.start for cell in members for loop in cell.loops for step in loop])
        borders = zip(face.strips[row].span, (row - 1, row), strict=True)
        broken = [(x, end) for end, i in borders for x in breaks[face.across, i]]
        vertices[row] = np.concatenate([np.stack(face.oriented(corners), axis=-1), np.reshape(broken, (-1, 2))])
    return vertices


class _Carrier:
    """Carries the loops of one strip's cells to the plane."""

    def __init__(
        self,
        face: DividedPatch,
        row: int,
        laying: Laying | None,
        edges: Edges,
        breaks: dict[tuple[int, int], set[float]],
    ) -> None:
        self.face, self.row, self.laying, self.edges, self.breaks = face, row, laying, edges, breaks
        self.uses = [use for loop in face.patch.loops for use in loop]
        self.reach = [ArcLength(rail) for rail in laying.rails] if laying else []

    def loop(self, steps: Sequence[Step]) -> list[Draft]:
        """Return the runs of a closed chain of steps, the ends of each made the beginning of the next."""
        drafts = [self._along(group) for group in self._groups(steps)]
        if not self.face.patch.outward:
            drafts = [draft.turned() for draft in reversed(drafts)]
        for draft, after in zip(drafts, [*drafts[1:], drafts[0]], strict=True):
            draft.points = np.concatenate([draft.points[:-1], after.points[:1]])
            draft.space = np.concatenate([draft.space[:-1], after.space[:1]])
            draft.places = np.concatenate([draft.places[:-1], after.places[:1]])
        return drafts

    def _groups(self, steps: Sequence[Step]) -> list[list[Step]]:
        """Break a closed chain where the border changes, or where a neighbour's does."""
        pieces = [part for step in steps for part in self._broken(step)]
        starts = [
            i
            for i, (before, after) in enumerate(zip([pieces[-1], *pieces[:-1]], pieces, strict=True))
            if self._apart(before, after)
        ]
        if not starts:
            return [pieces]
        pieces = pieces[starts[0] :] + pieces[: starts[0]]
        bounds = [i - starts[0] for i in starts] + [len(pieces)]
        return [pieces[i:j] for i, j in pairwise(bounds)]

    def _broken(self, step: Step) -> list[Step]:
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

    def _apart(self, before: Step, after: Step) -> bool:
        if before.use is None or before.use != after.use:
            return True
        return self._place(after, 0) in self.edges.samples[self.uses[before.use].edge].stops

    def _place(self, step: Step, end: int) -> int:
        """Return the index among the samples of its edge of a step's start (0) or stop (1)."""
        assert step.use is not None
        use, place = self.uses[step.use], step.places[end]
        return place if use.forward else len(self.edges.samples[use.edge].t) - 1 - place

    def _along(self, steps: list[Step]) -> Draft:
        return self._on_line(steps[0]) if steps[0].use is None else self._on_edge(steps)

    def _on_edge(self, steps: list[Step]) -> Draft:
        assert steps[0].use is not None
        use = self.uses[steps[0].use]
        edge, samples = self.edges.edges[use.edge], self.edges.samples[use.edge]
        passed = [self._place(steps[0], 0), *(self._place(step, 1) for step in steps)]
        low, high, rising = min(passed), max(passed), passed[0] < passed[-1]
        window = slice(low, high + 1)
        t, uv = samples.t[window], self.edges.uv[id(use)][window]
        inner = _inner(t)
        if self.face.patch.frame is not None:
            space, places = edge.points(t), uv
            points, between = (self.face.patch.frame.flat(some) for some in (space, edge.points(inner.ravel())))
        else:
            (points, places), (between, _) = self._flat(uv), self._flat(use.pcurve(inner.ravel()))
            space = self._space(places)
        kind: RunKind = "trim" if self._oblique(uv) else "rail" if self._level(uv) else "end"
        lengths = self.edges.lengths[use.edge][low:high]
        key = None if edge.degenerate else ("edge", use.edge, low, high)
        draft = Draft(key, kind, points, between.reshape(*inner.shape, 2), space, places, lengths, True)
        if self.face.patch.frame is not None and edge.curve is not None:
            draft.drawn = self.face.patch.frame.drawn(edge.curve.clip(*edge.parameter(t[[0, -1]])))
        return draft if rising else draft.turned()

    def _nodes(self, side: int, ends: Array) -> Array:
        """Return the nodes along a rail from one parameter to another, one only where the rail stands still."""
        assert self.laying is not None
        nodes, near = self.laying.flat.nodes, _NEAR * (ends[1] - ends[0])
        r = np.concatenate([ends[:1], nodes[(nodes > ends[0] + near) & (nodes < ends[1] - near)], ends[1:]])
        s = self.reach[side](r)
        moves = np.diff(s) > _STANDS * self.reach[side].length
        # the last of those that stand at the end is the end
        kept = np.append(True, moves)
        kept[-1] = True
        kept[1:-1] &= s[-1] - s[1:-1] > _STANDS * self.reach[side].length
        return np.asarray(r[kept])

    def _flat(self, uv: Array) -> tuple[Array, Array]:
        """Return points of the parameter plane in the plane, and on the strip."""
        assert self.laying is not None
        r, w = self.laying.locate(*self.face.oriented(uv))
        return self.laying.flat(r, w), np.stack([r, w], axis=-1)

    def _space(self, places: Array) -> Array:
        """Return where points (r, w) of the strip are in space."""
        assert self.laying is not None
        first, second = (rail(places[:, 0]) for rail in self.laying.rails)
        return np.asarray(first + places[:, 1:] * (second - first))

    def _oblique(self, uv: Array) -> bool:
        return bool((np.ptp(uv, axis=0) > 1e-6 * np.array(self.face.extent)).all())

    def _level(self, uv: Array) -> bool:
        return bool(np.ptp(uv[:, self.face.across]) < np.ptp(uv[:, 1 - self.face.across]))

    def _on_line(self, step: Step) -> Draft:
        """Return the run along a rail, or across the strip along a ruling at which it is cut."""
        assert self.laying is not None
        laying, flat = self.laying, self.laying.flat
        axis, index = step.line
        start, stop = step.start[1 - axis], step.stop[1 - axis]
        low, high = min(start, stop), max(start, stop)
        key = ("line", id(self.face), axis, index, low, high)
        if axis == self.face.across:
            side = 1 if index == self.row else 0
            ends, w = laying.locate(np.array([low, high]), np.full(2, laying.strip.span[side]))
            r = self._nodes(side, ends)
            w = np.full(len(r), float(side))
            between, lengths = flat(_inner(r), w[:-1, None]), np.diff(self.reach[side](r))
            kind: RunKind = "rail"
        else:
            r, w = laying.locate(np.full(2, step.start[axis]), np.array([low, high]))
            between, lengths = _on_chord(flat(r, w)), np.zeros(1)
            kind = "cut"
        places = np.stack([r, w], axis=-1)
        draft = Draft(key, kind, flat(r, w), between, self._space(places), places, lengths, True)
        return draft if start < stop else draft.turned()
