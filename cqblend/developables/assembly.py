"""From patches to pieces: strips are divided, flattened and trimmed, and their borders become seams.

Exists to keep one promise: both sides of every seam have the same length, to rounding. The length of a seam is that of
the curve in space it stands for, the longer of the two where a strip is stretched; a side whose chord is shorter is
bowed to it. Holds the order of the steps, and what is known of every piece. Must not know OCCT, tabs, sheets or files.
"""

from collections import defaultdict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from cqblend.developables import cells, paths
from cqblend.developables.arclength import ArcLength
from cqblend.developables.cells import Cell, Side, Step
from cqblend.developables.division import Direction, Method, divide
from cqblend.developables.flattening import Flat, Layout, flatten
from cqblend.developables.overlap import overlap
from cqblend.developables.patches import EdgeUse, Patch, Skin
from cqblend.developables.paths import Path
from cqblend.developables.pieces import Piece, Pieces, Place, Run, RunKind, Seam
from cqblend.developables.ruled import Strip
from cqblend.developables.sampling import Lines, Samples, sample
from cqblend.errors import CqblendError, GeometryError
from cqblend.splines.bernstein import Array

Progress = Callable[[float, str], object]
"""Is told the part of the work that is done, and what is done next."""

_ROUNDS = 8
"""A piece that covers itself is halved so often at most."""

_STRAIGHT = 1e-13
"""An arc that is longer than its chord by this part only is straight: the rest is rounding."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Wishes:
    """What is asked of a pattern; see :func:`cqblend.unroll`."""

    tolerance: float
    flat: float
    method: Method
    direction: Direction
    even: bool
    least_width: float | None
    developable: bool

    @property
    def layout(self) -> Layout:
        """How strips are laid flat."""
        return "elber" if self.method == "elber" else "smooth"


@dataclass(frozen=True, slots=True)
class Record:
    """What is known of a piece.

    Attributes
    ----------
    name
        Of the piece.
    faces
        Numbers of the faces it comes from.
    kind
        Of the strip: plane, cylinder, cone, tangent (developable), twisted.
    bound
        Certified distance between the face and the strip in space, both ways, mm.
    error
        Distance between the strip in space and the flat piece folded, mm.
    ruling
        Largest change in length of a ruling, relative.
    area, flat_area
        Of the whole strip before it was trimmed, in space and flat, mm^2.
    """

    name: str
    faces: tuple[int, ...]
    kind: str
    bound: float
    error: float
    ruling: float
    area: float
    flat_area: float


@dataclass(frozen=True, slots=True)
class Failure:
    """A face that could not be done, and why."""

    faces: tuple[int, ...]
    error: CqblendError


@dataclass(frozen=True, slots=True, eq=False)
class Unrolled:
    """Pieces with their seams, one record for each, their strips (None for planes), and what could not be done."""

    pieces: Pieces
    records: tuple[Record, ...]
    strips: tuple[Strip | None, ...]
    flats: tuple[Flat | None, ...]
    failures: tuple[Failure, ...]
    elber: int
    ideal: float


@dataclass(slots=True, eq=False)
class _Sheet:
    """A patch with its strips (none on a plane), and the cuts across them at which a piece would cover itself."""

    patch: Patch
    strips: tuple[Strip, ...] = ()
    transposed: bool = False
    elber: int = 1
    ideal: float = 1.0
    cuts: list[float] = field(default_factory=list)

    def lines(self) -> Lines:
        """Return the parameter lines that the patch's loops are cut at."""
        rows, cuts = np.array([strip.span[1] for strip in self.strips[:-1]]), np.array(sorted(self.cuts))
        (u0, u1), (v0, v1) = self.patch.surface.domain
        return Lines((rows, cuts) if self.transposed else (cuts, rows), (u1 - u0, v1 - v0))

    def oriented(self, uv: Array) -> tuple[Array, Array]:
        """Return the parameters along the rails and across them of points (n, 2)."""
        return (uv[:, 1], uv[:, 0]) if self.transposed else (uv[:, 0], uv[:, 1])

    def row(self, cell: Cell) -> int:
        """Return the index of the strip that a cell belongs to."""
        return cell.column if self.transposed else cell.row

    @property
    def across(self) -> int:
        """The axis of the parameter plane that runs across the strips."""
        return 0 if self.transposed else 1

    @property
    def upward(self) -> bool:
        """Whether R_t x R_w of the strips points to the outer side."""
        return self.patch.outward != self.transposed


@dataclass(slots=True, eq=False)
class _Draft:
    """A run before it is bowed.

    Its vertices and points about half-way between them, both flat, the vertices in space, and the lengths that its
    segments stand for. `rising` tells whether it runs in the sense in which its key is told.
    """

    key: Hashable
    kind: RunKind
    points: Array
    middles: Array
    space: Array
    lengths: Array
    rising: bool

    def turned(self) -> "_Draft":
        """Return the same run backwards."""
        return _Draft(
            self.key,
            self.kind,
            self.points[::-1],
            self.middles[::-1],
            self.space[::-1],
            self.lengths[::-1],
            not self.rising,
        )

    @property
    def chords(self) -> Array:
        return np.asarray(np.linalg.norm(np.diff(self.points, axis=0), axis=1))

    def path(self) -> Path:
        """Return the run with each segment bowed to its length, outwards where nothing tells the side."""
        chord, arm = np.diff(self.points, axis=0), self.middles - self.points[:-1]
        inwards = chord[:, 0] * arm[:, 1] - chord[:, 1] * arm[:, 0] > 1e-9 * (chord**2).sum(axis=1)
        bent = self.lengths - self.chords > _STRAIGHT * self.lengths
        bows = np.where(bent, paths.bulges(self.chords, self.lengths), 0.0)
        return Path(self.points, np.where(inwards, -bows, bows))


@dataclass(slots=True, eq=False)
class _Laid:
    """A piece on its way: where it is from, and its loops."""

    sheet: _Sheet
    row: int
    span: tuple[float, float]
    flat: Flat | None
    loops: list[list[_Draft]]


def unroll(skin: Skin, wishes: Wishes, progress: Progress | None = None) -> Unrolled:
    """Unroll patches to pieces.

    A patch that cannot be done is left out, its neighbours are not; see ``Unrolled.failures``.

    Raises
    ------
    GeometryError
        A piece still covers itself after eight cuts.
    """
    tell = progress or (lambda part, what: None)
    sheets: list[_Sheet] = []
    failures: list[Failure] = []
    for i, patch in enumerate(skin.patches):
        tell(0.6 * i / len(skin.patches), f"dividing face {patch.index}")
        try:
            sheets.append(_divided(patch, wishes))
        except CqblendError as error:
            failures.append(Failure(patch.faces, error))
    for _ in range(_ROUNDS):
        edges = _Edges(skin, sheets, wishes)
        laid: list[_Laid] = []
        for i, sheet in enumerate(tuple(sheets)):
            tell(0.6 + 0.4 * i / len(sheets), f"laying face {sheet.patch.index} flat")
            try:
                laid += _carried(sheet, edges, wishes)
            except CqblendError as error:
                failures.append(Failure(sheet.patch.faces, error))
                sheets.remove(sheet)
        result = _joined(skin, laid, tuple(failures), wishes)
        if not _cut_where_covered(result, laid):
            return result
    faces = ", ".join(str(sheet.patch.index) for sheet in sheets if sheet.cuts)
    raise GeometryError(f"pieces of face {faces} still cover themselves after {_ROUNDS} cuts; take a larger tolerance")


def _divided(patch: Patch, wishes: Wishes) -> _Sheet:
    if patch.kind == "plane":
        return _Sheet(patch)
    division = divide(
        patch.surface,
        wishes.tolerance,
        direction="v" if patch.kind in ("cylinder", "cone", "extrusion") else wishes.direction,
        method=wishes.method,
        even=wishes.even,
        least_width=wishes.least_width,
    )
    return _Sheet(patch, division.strips, division.direction == "u", division.elber, division.ideal)


class _Edges:
    """The vertices along all edges, and the lengths between them."""

    def __init__(self, skin: Skin, sheets: Sequence[_Sheet], wishes: Wishes) -> None:
        self.edges = skin.edges
        users: dict[int, list[tuple[EdgeUse, Lines, bool]]] = defaultdict(list)
        for sheet in sheets:
            lines, plane = sheet.lines(), sheet.patch.kind == "plane"
            for use in (use for loop in sheet.patch.loops for use in loop):
                users[use.edge].append((use, lines, plane))
        self.samples: dict[int, Samples] = {}
        self.uv: dict[int, Array] = {}  # by identity of the use
        self.lengths: dict[int, Array] = {}
        for number, uses in users.items():
            edge = skin.edges[number]
            sagitta = np.inf if all(plane for _, _, plane in uses) else wishes.tolerance / 2
            samples = sample(edge, [(use, lines) for use, lines, _ in uses], wishes.flat, sagitta)
            self.samples[number] = samples
            self.uv |= {id(use): uv for (use, _, _), uv in zip(uses, samples.uv, strict=True)}
            if not edge.degenerate:
                if edge.curve is None:
                    raise GeometryError(
                        f"edge {number} has no curve in space, only curves on its faces; export it anew"
                    )
                self.lengths[number] = np.diff(ArcLength(edge.curve)(edge.parameter(samples.t)))

    def sides(self, patch: Patch) -> list[list[Side]]:
        """Return the loops of a patch in its parameter plane; a side's `use` counts the uses of the patch."""
        loops, count = [], 0
        for loop in patch.loops:
            sides = []
            for use in loop:
                uv = self.uv[id(use)]
                sides.append(Side(count, uv if use.forward else uv[::-1]))
                count += 1
            loops.append(sides)
        return loops


def _carried(sheet: _Sheet, edges: _Edges, wishes: Wishes) -> list[_Laid]:
    """Cut a patch's loops into the cells of its strips and carry them to the plane."""
    lines = sheet.lines().values
    found = cells.cut(edges.sides(sheet.patch), lines)
    breaks: dict[tuple[int, int], set[float]] = defaultdict(set)
    for step in (step for cell in found for loop in cell.loops for step in loop):
        for axis in (0, 1):
            for vertex in (step.start, step.stop):
                on = np.flatnonzero(lines[axis] == vertex[axis])
                if len(on):
                    breaks[axis, int(on[0])].add(vertex[1 - axis])
    rows: dict[int, list[Cell]] = defaultdict(list)
    for cell in found:
        rows[sheet.row(cell)].append(cell)
    laid = []
    for row, members in sorted(rows.items()):
        steps = [step for cell in members for loop in cell.loops for step in loop]
        along = sheet.oriented(np.array([step.start for step in steps]))[0]
        borders = [*breaks[sheet.across, row - 1], *breaks[sheet.across, row]]
        flat = None
        if sheet.strips:
            strip = sheet.strips[row]
            nodes = np.unique(np.concatenate([along, borders]))
            flat = flatten(strip.rails, wishes.flat, nodes=nodes, flip=not sheet.upward, method=wishes.layout)
        carrier = _Carrier(sheet, row, flat, edges, breaks)
        for cell in members:
            loops = [carrier.loop(loop) for loop in cell.loops]
            corners = sheet.oriented(np.array([step.start for step in cell.loops[0]]))[0]
            laid.append(_Laid(sheet, row, (float(corners.min()), float(corners.max())), flat, loops))
    return laid


class _Carrier:
    """Carries the loops of one strip's cells to the plane."""

    def __init__(
        self, sheet: _Sheet, row: int, flat: Flat | None, edges: _Edges, breaks: dict[tuple[int, int], set[float]]
    ) -> None:
        self.sheet, self.row, self.flat, self.edges, self.breaks = sheet, row, flat, edges, breaks
        self.uses = [use for loop in sheet.patch.loops for use in loop]
        if flat is not None:
            self.strip = sheet.strips[row]
            zero = np.zeros((2, 1))
            self.reach = np.concatenate([zero, np.cumsum(flat.lengths, axis=1)], axis=1)

    def loop(self, steps: Sequence[Step]) -> list[_Draft]:
        """Return the runs of a closed chain of steps, the ends of each made the beginning of the next."""
        runs = [self._along(list(group)) for group in self._groups(steps)]
        drafts = [run for run in runs if run is not None]
        if not self.sheet.patch.outward:
            drafts = [draft.turned() for draft in reversed(drafts)]
        for draft, after in zip(drafts, [*drafts[1:], drafts[0]], strict=True):
            draft.points = np.concatenate([draft.points[:-1], after.points[:1]])
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

    def _along(self, steps: list[Step]) -> _Draft | None:
        return self._on_line(steps[0]) if steps[0].use is None else self._on_edge(steps)

    def _on_edge(self, steps: list[Step]) -> _Draft | None:
        assert steps[0].use is not None
        use = self.uses[steps[0].use]
        edge, samples = self.edges.edges[use.edge], self.edges.samples[use.edge]
        if edge.degenerate:
            return None
        places = np.array([self._place(steps[0], 0), *(self._place(step, 1) for step in steps)])
        low, high = int(places.min()), int(places.max())
        rising = bool(places[0] < places[-1])
        window = slice(low, high + 1)
        t, uv = samples.t[window], self.edges.uv[id(use)][window]
        middle = (t[:-1] + t[1:]) / 2
        space = edge.points(t)
        if self.sheet.patch.frame is not None:
            points, middles = self.sheet.patch.frame.flat(space), self.sheet.patch.frame.flat(edge.points(middle))
        else:
            points, middles = self._flat(uv), self._flat(use.pcurve(middle))
        kind: RunKind = "trim" if self._oblique(uv) else "rail" if self._level(uv) else "end"
        draft = _Draft(
            ("edge", use.edge, low, high), kind, points, middles, space, self.edges.lengths[use.edge][low:high], True
        )
        return draft if rising else draft.turned()

    def _flat(self, uv: Array) -> Array:
        assert self.flat is not None
        t, across = self.sheet.oriented(uv)
        start, stop = self.strip.rails[0].domain
        t = np.clip(t, start, stop)
        return self.flat(t, self.strip.fraction(t, np.clip(across, *self.strip.span)))

    def _oblique(self, uv: Array) -> bool:
        extent = self.sheet.lines().extent
        return bool((np.ptp(uv, axis=0) > 1e-6 * np.array(extent)).all())

    def _level(self, uv: Array) -> bool:
        return bool(np.ptp(uv[:, self.sheet.across]) < np.ptp(uv[:, 1 - self.sheet.across]))

    def _on_line(self, step: Step) -> _Draft:
        """Return the run along a rail, or across the strip along a ruling at which it is cut."""
        assert self.flat is not None
        axis, index = step.line
        start, stop = step.start[1 - axis], step.stop[1 - axis]
        low, high, rising = min(start, stop), max(start, stop), start < stop
        key = ("line", id(self.sheet), axis, index, low, high)
        rails = self.strip.rails
        if axis == self.sheet.across:
            side = 1 if index == self.row else 0
            i, j = np.searchsorted(self.flat.nodes, (low, high))
            t = self.flat.nodes[i : j + 1]
            w = np.full(len(t), float(side))
            points, middles = self.flat(t, w), self.flat((t[:-1] + t[1:]) / 2, w[:-1])
            draft = _Draft(key, "rail", points, middles, rails[side](t), np.diff(self.reach[side, i : j + 1]), True)
        else:
            t = np.full(2, step.start[axis])
            w = self.strip.fraction(t, np.clip([low, high], *self.strip.span))
            points = self.flat(t, w)
            space = rails[0](t) * (1 - w[:, None]) + rails[1](t) * w[:, None]
            draft = _Draft(key, "cut", points, points.mean(axis=0)[None], space, np.zeros(1), True)
        return draft if rising else draft.turned()


def _joined(skin: Skin, laid: Sequence[_Laid], failures: tuple[Failure, ...], wishes: Wishes) -> Unrolled:
    """Bow the runs to the lengths of their seams, and make the pieces."""
    members: dict[Hashable, list[tuple[Place, _Draft]]] = defaultdict(list)
    for i, one in enumerate(laid):
        for j, loop in enumerate(one.loops):
            for k, draft in enumerate(loop):
                members[draft.key].append((Place(i, j, k), draft))
    seams: list[Seam] = []
    numbers: dict[Hashable, int] = {}
    for key, sides in members.items():
        if wishes.layout == "elber":
            for _, draft in sides:
                draft.lengths = draft.chords
        elif isinstance(key, tuple) and key[0] == "edge":
            _agree([draft for _, draft in sides])
        if len(sides) == 2:
            numbers[key] = len(seams)
            (first, one), (second, other) = sides
            angle = _turn(skin, key, laid[first.piece], laid[second.piece])
            seams.append(Seam(str(len(seams) + 1), (first, second), one.rising != other.rising, angle))
    counts: dict[int, int] = defaultdict(int)
    for one in laid:
        counts[id(one.sheet)] += 1
    pieces, records, ordinals = [], [], defaultdict(int)
    for one in laid:
        ordinals[id(one.sheet)] += 1
        index = one.sheet.patch.index
        name = f"{index}.{ordinals[id(one.sheet)]}" if counts[id(one.sheet)] > 1 else str(index)
        loops = [
            tuple(Run(draft.path(), draft.space, draft.kind, numbers.get(draft.key)) for draft in loop)
            for loop in one.loops
        ]
        piece = Piece(name, tuple(loops))
        pieces.append(piece)
        records.append(_record(one, piece))
    sheets = {id(one.sheet): one.sheet for one in laid}.values()
    return Unrolled(
        Pieces(tuple(pieces), tuple(seams)),
        tuple(records),
        tuple(one.sheet.strips[one.row] if one.sheet.strips else None for one in laid),
        tuple(one.flat for one in laid),
        failures,
        sum(sheet.elber for sheet in sheets),
        sum(sheet.ideal for sheet in sheets),
    )


def _agree(drafts: Sequence[_Draft]) -> None:
    """Give the segments along an edge one length on all sides: that of the edge, or of the longest chord."""
    rising = [draft.lengths if draft.rising else draft.lengths[::-1] for draft in drafts]
    chords = [draft.chords if draft.rising else draft.chords[::-1] for draft in drafts]
    lengths = np.max([*rising, *chords], axis=0)
    for draft in drafts:
        draft.lengths = lengths if draft.rising else lengths[::-1]


def _turn(skin: Skin, key: Hashable, first: _Laid, second: _Laid) -> float:
    """Return the angle by which the outer normal turns across the middle of a seam, positive if convex."""
    assert isinstance(key, tuple)
    if key[0] == "edge":
        return skin.edges[key[1]].angle
    if first.row == second.row:
        return 0.0
    lower, upper = sorted((first, second), key=lambda one: one.row)
    t = (key[4] + key[5]) / 2
    below, above = lower.sheet.strips[lower.row].rails, upper.sheet.strips[upper.row].rails
    tangent = above[0](t, 1)
    down, up = below[1](t) - below[0](t), above[1](t) - above[0](t)
    sign = 1.0 if lower.sheet.upward else -1.0
    normals = [sign * np.cross(tangent, ruling) for ruling in (down, up)]
    before, after = (n / max(float(np.linalg.norm(n)), 1e-300) for n in normals)
    angle = float(np.arctan2(np.linalg.norm(np.cross(before, after)), before @ after))
    return angle if (after - before) @ up > 0 else -angle


def _record(one: _Laid, piece: Piece) -> Record:
    patch = one.sheet.patch
    if one.flat is None:
        return Record(piece.name, patch.faces, "plane", 0.0, 0.0, 0.0, piece.area, piece.area)
    flat, strip = one.flat, one.sheet.strips[one.row]
    return Record(
        piece.name, patch.faces, flat.kind, strip.bound, flat.error, flat.ruling, flat.area_space, flat.area_flat
    )


def _cut_where_covered(result: Unrolled, laid: Sequence[_Laid]) -> bool:
    """Mark cuts across strips whose pieces cover themselves, and tell whether there are any."""
    covered = [one for one, piece in zip(laid, result.pieces.pieces, strict=True) if overlap(piece).area > 0]
    for one in covered:
        one.sheet.cuts.append((one.span[0] + one.span[1]) / 2)
    return bool(covered)
