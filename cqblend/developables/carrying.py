"""Loops of trimmed faces carried to the plane, run by run.

Exists because a piece's boundary comes from three kinds of curve: rails between the strips of one face, edges of the
shape, which may cross the strips anyhow, and cuts along rulings. Each becomes a draft that knows its vertices flat and
in space and the lengths its segments stand for; the neighbour across has a draft of the same key. Must not know how
drafts are bowed and joined.
"""

from collections import defaultdict
from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Literal

import numpy as np

from cqblend.developables import cells, paths
from cqblend.developables.arclength import ArcLength
from cqblend.developables.cells import Cell, Lines, Side, Step
from cqblend.developables.division import Direction, Method
from cqblend.developables.flattening import Flat, flatten
from cqblend.developables.pairing import pair
from cqblend.developables.patches import Edge, Patch, Skin
from cqblend.developables.paths import Path
from cqblend.developables.pieces import RunKind
from cqblend.developables.ruled import Strip
from cqblend.developables.sampling import Samples, Use, sample
from cqblend.errors import CqblendError, GeometryError
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array

Layout = Literal["smooth", "triangles"]
"""Rails and rulings with all their lengths, or the paper's triangles along one diagonal, with chords."""

_METHODS: dict[Layout, Literal["smooth", "elber"]] = {"smooth": "smooth", "triangles": "elber"}

_STRAIGHT = 1e-13
"""An arc that is longer than its chord by this part only is straight: the rest is rounding."""

_MARGIN = 1.05
"""What a sampled deviation is multiplied by before it counts."""

_JOINT = 1e-8
"""Mm: a tenth of the tolerance that OCCT's vertices have."""

_NEAR = 1e-9
"""Vertices closer together than this part of their run are one."""


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
    layout: Layout


@dataclass(slots=True, eq=False)
class Sheet:
    """A patch with its strips (none on a plane), and what keeps its pieces from covering themselves.

    That is cuts across strips, by how much all tolerances are finer than asked, and whether no other direction is left.
    """

    patch: Patch
    strips: tuple[Strip, ...] = ()
    transposed: bool = False
    elber: int = 1
    ideal: float = 1.0
    cuts: dict[int, list[float]] = field(default_factory=dict)
    finer: float = 1.0
    turned: bool = False

    def lines(self) -> Lines:
        """Return the parameter lines that the patch's loops are cut at."""
        return Lines(self.across, np.array([strip.span[1] for strip in self.strips[:-1]]), self.cuts)

    def cut(self, row: int, value: float) -> None:
        """Cut a strip across."""
        self.cuts[row] = sorted([*self.cuts.get(row, ()), value])

    @property
    def extent(self) -> tuple[float, float]:
        """How far both parameters reach."""
        (u0, u1), (v0, v1) = self.patch.surface.domain
        return u1 - u0, v1 - v0

    def oriented(self, uv: Array) -> tuple[Array, Array]:
        """Return the parameters along the rails and across them of points (n, 2)."""
        return (uv[:, 1], uv[:, 0]) if self.transposed else (uv[:, 0], uv[:, 1])

    @property
    def across(self) -> int:
        """The axis of the parameter plane that runs across the strips."""
        return 0 if self.transposed else 1

    @property
    def upward(self) -> bool:
        """Whether R_t x R_w of the strips points to the outer side."""
        return self.patch.outward != self.transposed


@dataclass(slots=True, eq=False)
class Draft:
    """A run before it is bowed.

    Its vertices and points about half-way between them, both flat; the vertices in space, and their parameters on the
    strip or the plane; the lengths that its segments stand for. `rising` tells whether it runs in the sense of its key.
    A pole has no key. On planes it may be `drawn` exactly.
    """

    key: Hashable | None
    kind: RunKind
    points: Array
    middles: Array
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
            middles=self.middles[::-1],
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
            middles=self.points[[0, -1]].mean(axis=0)[None],
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

    def path(self) -> Path:
        """Return the run with each segment bowed to its length, outwards where nothing tells the side.

        The end of a strip is straight, and becomes one arc: inwards if it is to follow another end.
        """
        bent = self.lengths - self.chords > _STRAIGHT * self.lengths
        bows = np.where(bent, paths.bulges(self.chords, self.lengths), 0.0)
        if self.kind == "end":
            return Path(self.points, -bows if self.inward else bows)
        chord, arm = np.diff(self.points, axis=0), self.middles - self.points[:-1]
        inwards = chord[:, 0] * arm[:, 1] - chord[:, 1] * arm[:, 0] > 1e-9 * (chord**2).sum(axis=1)
        return Path(self.points, np.where(inwards, -bows, bows))


@dataclass(frozen=True, slots=True, eq=False)
class Laying:
    """A strip laid flat, as it is or with its rulings paired anew.

    Attributes
    ----------
    strip
        As it was divided.
    rails
        Between which it is ruled now, over a parameter r.
    parameters
        The strip's own parameter t on both rails as functions of r; None where r is t.
    bound
        Distance from the surface, both ways, mm.
    proven
        Whether the bound is certified. That of a new pairing is the largest of a grid of samples.
    flat
        The strip in the plane.
    """

    strip: Strip
    rails: tuple[Curve, Curve]
    parameters: tuple[Curve, Curve] | None
    bound: float
    proven: bool
    flat: Flat

    def ruled(self) -> Surface:
        """Return the strip as a surface (r, w)."""
        return replace(self.strip, rails=self.rails).ruled()

    def locate(self, t: Array, across: Array) -> tuple[Array, Array]:
        """Return r and the fraction of the ruling of points given by the strip's own parameters.

        Of a strip that is paired anew only points on its rails and at its ends can be located.
        """
        start, stop = self.strip.rails[0].domain
        t = np.clip(t, start, stop)
        w = self.strip.fraction(t, np.clip(across, *self.strip.span))
        if self.parameters is None:
            return t, w
        return np.where(w < 1, _inverse(self.parameters[0], t), _inverse(self.parameters[1], t)), w


@dataclass(slots=True, eq=False)
class Laid:
    """A piece on its way: where it is from, and its loops."""

    sheet: Sheet
    row: int
    span: tuple[float, float]
    laying: Laying | None
    loops: list[list[Draft]]


class Edges:
    """The vertices along all edges, and the lengths between them."""

    def __init__(self, skin: Skin, sheets: Sequence[Sheet], wishes: Wishes) -> None:
        self.edges = skin.edges
        users: dict[int, list[Use]] = defaultdict(list)
        sagittas: dict[int, float] = defaultdict(lambda: np.inf)
        finer: dict[int, float] = defaultdict(lambda: 1.0)
        for sheet in sheets:
            lines = sheet.lines()
            for use in (use for loop in sheet.patch.loops for use in loop):
                users[use.edge].append((use, lines, sheet.extent))
                finer[use.edge] = max(finer[use.edge], sheet.finer)
                if sheet.strips:
                    sagittas[use.edge] = min(sagittas[use.edge], wishes.tolerance / sheet.finer / 2)
        self.samples: dict[int, Samples] = {}
        self.uv: dict[int, Array] = {}  # by identity of the use
        self.lengths: dict[int, Array] = {}
        self.refused: dict[int, CqblendError] = {}
        for number, uses in users.items():
            edge = skin.edges[number]
            try:
                self._sample(edge, uses, wishes.flat / finer[number], sagittas[number])
            except CqblendError as error:
                self.refused[number] = error

    def _sample(self, edge: Edge, uses: Sequence[Use], tolerance: float, sagitta: float) -> None:
        samples = sample(edge, uses, tolerance, sagitta)
        self.samples[edge.index] = samples
        self.uv |= {id(use): uv for (use, _, _), uv in zip(uses, samples.uv, strict=True)}
        if edge.degenerate:
            self.lengths[edge.index] = np.zeros(len(samples.t) - 1)
        elif edge.curve is None:
            raise GeometryError("it has no curve in space, only curves on its faces; export the shape anew")
        else:
            self.lengths[edge.index] = np.diff(ArcLength(edge.curve)(edge.parameter(samples.t)))

    def sides(self, sheet: Sheet) -> list[list[Side]]:
        """Return the loops of a patch in its parameter plane; a side's `use` counts the uses of the patch.

        Where a side ends on a line, the next one begins there.

        Raises
        ------
        CqblendError
            One of its edges could not be sampled.
        """
        loops, count, lines = [], 0, sheet.lines()
        for loop in sheet.patch.loops:
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


def _inverse(function: Curve, values: Array) -> Array:
    """Return where a function that never decreases takes values; the first and the last at its ends."""
    start, stop = function.domain
    low, high = np.full(values.shape, start), np.full(values.shape, stop)
    for _ in range(60):
        middle = (low + high) / 2
        below = function(middle)[..., 0] < values
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    ends = function(np.array([start, stop]))[:, 0]
    return np.where(values <= ends[0], start, np.where(values >= ends[1], stop, high))


def _laying(sheet: Sheet, row: int, vertices: Array, nodes: Array, wishes: Wishes) -> Laying:
    """Lay a strip flat, with nodes at the vertices (t, across) of its cells, and at given t."""
    strip = sheet.strips[row]
    t, across = vertices.T
    if wishes.developable and (np.isin(across, strip.span) | np.isin(t, strip.rails[0].domain)).all():
        paired = _paired(sheet, strip, t, wishes)
        if paired is not None:
            return paired
    nodes = np.unique(np.append(t, nodes))
    flat = flatten(
        strip.rails, wishes.flat / sheet.finer, nodes=nodes, flip=not sheet.upward, method=_METHODS[wishes.layout]
    )
    return Laying(strip, strip.rails, None, strip.bound, True, flat)


def _paired(sheet: Sheet, strip: Strip, t: Array, wishes: Wishes) -> Laying | None:
    """Pair the rulings of a strip anew, so that it is developable; None if that cannot be done within the tolerance."""
    pairing = pair(strip.rails)
    if pairing.rails is None or pairing.parameters is None or pairing.rails is strip.rails:
        return None
    bound = _MARGIN * _deviation(strip, pairing.rails, pairing.parameters)
    if bound > wishes.tolerance:
        return None
    nodes = np.unique([_inverse(one, np.unique(t)) for one in pairing.parameters])
    flat = flatten(
        pairing.rails, wishes.flat / sheet.finer, nodes=nodes, flip=not sheet.upward, method=_METHODS[wishes.layout]
    )
    if flat.kind == "twisted":
        return None
    return Laying(strip, pairing.rails, pairing.parameters, bound, False, flat)


def _deviation(strip: Strip, rails: tuple[Curve, Curve], parameters: tuple[Curve, Curve]) -> float:
    """Return the largest distance found between a strip paired anew and points of the surface at like places."""
    r, w = np.linspace(*rails[0].domain, 97)[:, None], np.linspace(0.0, 1.0, 17)[1:-1]
    points = rails[0](r) * (1 - w[:, None]) + rails[1](r) * w[:, None]
    u = parameters[0](r)[..., 0] * (1 - w) + parameters[1](r)[..., 0] * w
    low, high = np.full(u.shape, strip.span[0]), np.full(u.shape, strip.span[1])
    for _ in range(40):
        middle = (low + high) / 2
        below = strip.fraction(u, middle) < w
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return float(np.linalg.norm(strip.surface(u, high) - points, axis=-1).max())


def carried(sheet: Sheet, edges: Edges, wishes: Wishes) -> list[Laid]:
    """Cut a patch's loops into the cells of its strips and carry them to the plane."""
    lines = sheet.lines()
    values = (lines.values(0), lines.values(1))
    found = cells.cut(edges.sides(sheet), lines)
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
    layings = _layings(sheet, rows, breaks, wishes) if sheet.strips else {}
    laid = []
    for row, members in sorted(rows.items()):
        laying = layings.get(row)
        carrier = _Carrier(sheet, row, laying, edges, breaks)
        for cell in members:
            loops = [carrier.loop(loop) for loop in cell.loops]
            corners = sheet.oriented(np.array([step.start for step in cell.loops[0]]))[0]
            laid.append(Laid(sheet, row, (float(corners.min()), float(corners.max())), laying, loops))
    return laid


def _layings(
    sheet: Sheet, rows: Mapping[int, Sequence[Cell]], breaks: Mapping[tuple[int, int], set[float]], wishes: Wishes
) -> dict[int, Laying]:
    """Lay flat the strips that have cells.

    Triangles have the nodes of all strips of the face: the chords of a rail are the same on both sides.
    """
    vertices = {}
    for row, members in rows.items():
        corners = np.array([step.start for cell in members for loop in cell.loops for step in loop])
        borders = zip(sheet.strips[row].span, (row - 1, row), strict=True)
        broken = [(x, end) for end, i in borders for x in breaks[sheet.across, i]]
        vertices[row] = np.concatenate([np.stack(sheet.oriented(corners), axis=-1), np.reshape(broken, (-1, 2))])
    nodes = np.empty(0)
    if wishes.layout == "triangles":
        nodes = np.concatenate([corners[:, 0] for corners in vertices.values()])
    found = {row: _laying(sheet, row, corners, nodes, wishes) for row, corners in vertices.items()}
    if wishes.layout == "triangles":
        finest = max((laying.flat.nodes for laying in found.values()), key=len)
        found = {row: _laying(sheet, row, corners, finest, wishes) for row, corners in vertices.items()}
    return found


class _Carrier:
    """Carries the loops of one strip's cells to the plane."""

    def __init__(
        self, sheet: Sheet, row: int, laying: Laying | None, edges: Edges, breaks: dict[tuple[int, int], set[float]]
    ) -> None:
        self.sheet, self.row, self.laying, self.edges, self.breaks = sheet, row, laying, edges, breaks
        self.uses = [use for loop in sheet.patch.loops for use in loop]
        self.reach = [ArcLength(rail) for rail in laying.rails] if laying else []

    def loop(self, steps: Sequence[Step]) -> list[Draft]:
        """Return the runs of a closed chain of steps, the ends of each made the beginning of the next."""
        drafts = [self._along(group) for group in self._groups(steps)]
        if not self.sheet.patch.outward:
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
        middle = (t[:-1] + t[1:]) / 2
        if self.sheet.patch.frame is not None:
            space, places = edge.points(t), uv
            points, middles = self.sheet.patch.frame.flat(space), self.sheet.patch.frame.flat(edge.points(middle))
        else:
            (points, places), (middles, _) = self._flat(uv), self._flat(use.pcurve(middle))
            space = self._space(places)
        kind: RunKind = "trim" if self._oblique(uv) else "rail" if self._level(uv) else "end"
        lengths = self.edges.lengths[use.edge][low:high]
        key = None if edge.degenerate else ("edge", use.edge, low, high)
        draft = Draft(key, kind, points, middles, space, places, lengths, True)
        if self.sheet.patch.frame is not None and edge.curve is not None:
            draft.drawn = self.sheet.patch.frame.drawn(edge.curve.clip(*edge.parameter(t[[0, -1]])))
        return draft if rising else draft.turned()

    def _flat(self, uv: Array) -> tuple[Array, Array]:
        """Return points of the parameter plane in the plane, and on the strip."""
        assert self.laying is not None
        r, w = self.laying.locate(*self.sheet.oriented(uv))
        return self.laying.flat(r, w), np.stack([r, w], axis=-1)

    def _space(self, places: Array) -> Array:
        """Return where points (r, w) of the strip are in space."""
        assert self.laying is not None
        first, second = (rail(places[:, 0]) for rail in self.laying.rails)
        return np.asarray(first + places[:, 1:] * (second - first))

    def _oblique(self, uv: Array) -> bool:
        return bool((np.ptp(uv, axis=0) > 1e-6 * np.array(self.sheet.extent)).all())

    def _level(self, uv: Array) -> bool:
        return bool(np.ptp(uv[:, self.sheet.across]) < np.ptp(uv[:, 1 - self.sheet.across]))

    def _on_line(self, step: Step) -> Draft:
        """Return the run along a rail, or across the strip along a ruling at which it is cut."""
        assert self.laying is not None
        laying, flat = self.laying, self.laying.flat
        axis, index = step.line
        start, stop = step.start[1 - axis], step.stop[1 - axis]
        low, high = min(start, stop), max(start, stop)
        key = ("line", id(self.sheet), axis, index, low, high)
        if axis == self.sheet.across:
            side = 1 if index == self.row else 0
            ends, w = laying.locate(np.array([low, high]), np.full(2, laying.strip.span[side]))
            near = _NEAR * (ends[1] - ends[0])
            inner = flat.nodes[(flat.nodes > ends[0] + near) & (flat.nodes < ends[1] - near)]
            r = np.concatenate([ends[:1], inner, ends[1:]])
            w = np.full(len(r), float(side))
            middles, lengths = flat((r[:-1] + r[1:]) / 2, w[:-1]), np.diff(self.reach[side](r))
            kind: RunKind = "rail"
        else:
            r, w = laying.locate(np.full(2, step.start[axis]), np.array([low, high]))
            middles, lengths = flat(r, w).mean(axis=0)[None], np.zeros(1)
            kind = "cut"
        places = np.stack([r, w], axis=-1)
        draft = Draft(key, kind, flat(r, w), middles, self._space(places), places, lengths, True)
        return draft if start < stop else draft.turned()
