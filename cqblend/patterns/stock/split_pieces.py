"""Pieces cut along straight lines, into parts that are joined again by new seams.

Exists because pieces may be larger than the stock. A cut goes through runs whose seams have another side: that side is
divided at the same lengths, so that each seam still has two runs of equal length. Where a run is divided it gets a
vertex, whose place in space the caller knows. Tabs come after cutting. Must not know how parts are placed on sheets.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import count as count_from
from itertools import islice, pairwise
from string import ascii_uppercase
from typing import Any

import numpy as np
import shapely

from cqblend.checks import check_millimetres
from cqblend.errors import CqblendError, GeometryError, InputError, SizeError
from cqblend.patterns.outline.bounding_boxes import (
    find_convex_hull,
    find_fitting_angle,
    find_flattest_angle,
    measure_rotated_extents,
)
from cqblend.patterns.outline.overlap import to_polygon
from cqblend.patterns.outline.parallel_path import PathByLength
from cqblend.patterns.outline.pieces import Piece, Pieces, Place, Run, Score, Seam, close_loop
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.trim.trimmed_patch import CurveFunction
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import bisect_interval

VERTEX_CLEARANCE = 1e-6
"""A line keeps this distance from vertices, relative to the size of the piece."""

TRIED_OFFSETS = np.array([0.0, *(sign * k * 0.03 for k in range(1, 7) for sign in (1, -1))])
"""Where cuts are tried, relative to the width of the part that is cut off."""

END_CLEARANCE = 0.1
"""Cuts nearer than this to the ends of runs are avoided, relative to the side that parts may have: labels need room."""

MOST_PARTS = 1000
"""Largest number of parts of one piece."""

_SeamEnd = tuple[int, int]
"""A seam, and which side of it."""

_NOWHERE = Place(-1, -1, -1)

FoldPoints = Callable[[int, Array], Array]
"""Index of a piece, and points (n, 2) of it; where they are in space, (n, 3)."""


@dataclass(frozen=True, slots=True, eq=False)
class _SidedRun:
    """A run, the end of the seam it belongs to, and on which side of the line it is (0 if nobody asked)."""

    run: Run
    end: _SeamEnd | None
    side: int = 0


def split_piece(pieces: Pieces, index: int, line: Array, rolled: FoldPoints | None = None) -> Pieces:
    """Return pieces, one of which is cut along a straight line.

    Parameters
    ----------
    pieces
        Without tabs.
    index
        Of the piece to be cut.
    line
        (2, 2), two points on the line.
    rolled
        Tells where new vertices are in space. By default that is interpolated between the vertices of their runs, as
        is right for polyhedra.

    Returns
    -------
    Pieces
        With the parts in place of the piece: those to the left of the line first. Their names are the piece's with
        letters. Each stretch of the line inside the piece is a new seam, ``"C1"`` and so on; seams that are divided
        have letters behind their labels.

    Raises
    ------
    InputError
        If the line is not one, the piece has tabs, or the line misses it.
    GeometryError
        If the line touches a vertex or an arc of the boundary; shift it a little.

    Examples
    --------
    >>> square = Path.straight([[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]])
    >>> whole = Pieces((Piece("1", ((Run(square, np.zeros((5, 3)), "trim"),),)),), ())
    >>> halves = split(whole, 0, np.array([[4.0, 0.0], [4.0, 1.0]]))
    >>> [(piece.name, piece.area) for piece in halves.pieces], [seam.label for seam in halves.seams]
    ([('1A', 40.0), ('1B', 60.0)], ['C1'])
    """
    piece = pieces.pieces[index]
    if any(piece.tabs is not None for piece in pieces.pieces):
        raise InputError(f"piece {piece.name} is to be cut before tabs are added")
    cut = _CutLine(piece, line)
    divisions = _find_divisions(pieces, index, cut)
    seams, ends = _divide_seams(pieces, divisions)
    old = {side: (k, end) for k, seam in enumerate(pieces.seams) for end, side in enumerate(seam.sides)}
    whole = np.array([0.0, 1.0])
    assembled: list[tuple[Piece, list[list[_SidedRun]]]] = []
    for i, one in enumerate(pieces.pieces):
        loops: list[list[_SidedRun]] = [[] for _ in one.loops]
        for j, k, run in one.runs():
            at = Place(i, j, k)
            parts = divisions.get(at, whole)
            own = ends[old[at]] if at in old else [None] * (len(parts) - 1)
            place = None if rolled is None else partial(rolled, i)
            loops[j].extend(_divide_run(run, parts, own, cut if i == index else None, place))
        if i == index:
            fresh = _separate_parts(one, loops, cut, seams)
            names = _letter_labels(one.name, len(fresh), {piece.name for piece in pieces.pieces})
            assembled.extend((replace(part, name=name), own) for name, (part, own) in zip(names, fresh, strict=True))
        else:
            assembled.append((one, loops))
    return _number_seams(assembled, seams)


def split_to_fit(pieces: Pieces, size: tuple[float, float], rolled: FoldPoints | None = None) -> Pieces:
    """Return pieces, those cut that do not fit a size whichever way they are turned.

    A piece is cut across the longer side of its least box, about where that gives the fewest parts; near there, where
    the cut is short and not close to the ends of seams.

    Parameters
    ----------
    pieces
        Without tabs.
    size
        Width and height, mm: of the sheet, less its margins, and less a tab's width on all sides.
    rolled
        As `split` takes it; the index is that of the piece before any was cut.

    Raises
    ------
    InputError
        If the size is not two positive numbers.
    SizeError
        If a piece would need more than 1000 parts, or cannot be cut.
    """
    width, height = (check_millimetres("the side of what pieces are to fit", side) for side in size)
    calls = [piece.name for piece in pieces.pieces]
    origin = [*range(len(calls))]
    names, labels = set(calls), {seam.label for seam in pieces.seams}
    k = 0
    while k < len(pieces.pieces):
        piece = pieces.pieces[k]
        points = find_convex_hull(piece.outlines, 1e-3)
        if find_fitting_angle(points, (width, height)) is not None:
            k += 1
            continue
        if origin.count(origin[k]) >= MOST_PARTS or piece.area > MOST_PARTS * width * height:
            raise SizeError(
                f"piece {calls[origin[k]]} does not fit {width:g} x {height:g} mm in {MOST_PARTS} parts: take larger "
                "sheets"
            )
        count = len(pieces.pieces)
        whole = rolled and _fold_by_origin(rolled, tuple(origin))
        pieces = _split_cheapest(pieces, k, points, max(width, height), whole)
        origin[k : k + 1] = [origin[k]] * (1 + len(pieces.pieces) - count)
    return _reletter_pieces(pieces, names, labels) if len(origin) > len(names) else pieces


def _fold_by_origin(rolled: FoldPoints, origin: Sequence[int]) -> FoldPoints:
    """Return the same for the parts of pieces, each of which is of the piece that `origin` tells."""
    return lambda part, points: rolled(origin[part], points)


def _reletter_pieces(pieces: Pieces, names: set[str], labels: set[str]) -> Pieces:
    """Return pieces that were cut again and again, with one row of letters behind each name and label of the first."""
    calls = _reletter_names([piece.name for piece in pieces.pieces], names)
    marks = _reletter_names([seam.label for seam in pieces.seams], labels)
    return Pieces(
        tuple(replace(piece, name=call) for piece, call in zip(pieces.pieces, calls, strict=True)),
        tuple(replace(seam, label=mark) for seam, mark in zip(pieces.seams, marks, strict=True)),
    )


def _reletter_names(words: Sequence[str], stems: set[str]) -> list[str]:
    """Return words that are stems with letters behind, lettered in order; others are numbered as cuts.

    Examples
    --------
    >>> _lined_up(["1AA", "1AB", "1B", "C1AA", "2"], {"1", "2"})
    ['1A', '1B', '1C', 'C1', '2']
    """
    groups = defaultdict(list)
    for k, word in enumerate(words):
        heads = (word[:n] for n in range(len(word), 0, -1))
        groups[next((h for h in heads if h in stems and not word[len(h) :].strip(ascii_uppercase)), None)].append(k)
    found = list(words)
    taken = set(stems)
    for stem, members in groups.items():
        if stem is None:
            fresh = _make_cut_labels(len(members), taken)
        else:
            fresh = [stem] if len(members) == 1 else _letter_labels(stem, len(members), taken)
        for k, word in zip(members, fresh, strict=True):
            found[k] = word
    return found


def _make_cut_labels(count: int, taken: set[str]) -> list[str]:
    """Return labels for seams along cuts, none taken yet; they are then."""
    found = list(islice((label for k in count_from(1) if (label := f"C{k}") not in taken), count))
    taken.update(found)
    return found


def _split_cheapest(pieces: Pieces, index: int, points: Array, side: float, rolled: FoldPoints | None) -> Pieces:
    """Return pieces, one of which is cut across its longer side, about as many of such sides as the part may have."""
    piece = pieces.pieces[index]
    turn = find_flattest_angle(points)
    length = float(measure_rotated_extents(points, np.array([turn]))[0, 0])
    along, across = np.array([np.cos(turn), -np.sin(turn)]), np.array([np.sin(turn), np.cos(turn)])
    start = float((points @ along).min())
    width = length / max(np.ceil(length / side), 2)
    shape = to_polygon(piece.outlines, 1e-3 * length)
    reach = 2 * length + float(np.abs(points).max())
    places = start + width * (1 + TRIED_OFFSETS)
    feet = places[:, None] * along
    chords = shapely.linestrings(np.stack([feet - reach * across, feet + reach * across], axis=1))
    corners = np.array([run.path.points[0] for *_, run in piece.runs()])
    clear = np.abs(places[:, None] - corners @ along).min(axis=1)
    costs = shapely.length(shapely.intersection(shape, chords)) + 0.5 * width * np.abs(TRIED_OFFSETS)
    costs += np.maximum(END_CLEARANCE * side - clear, 0.0)
    failure: CqblendError | None = None
    for k in np.argsort(costs, kind="stable"):
        try:
            return split_piece(pieces, index, np.array([feet[k], feet[k] + across]), rolled)
        except (GeometryError, InputError) as error:
            failure = error
    raise SizeError(f"piece {piece.name}, {length:.1f} mm long, does not fit and cannot be cut: {failure}")


class _CutLine:
    """A line that cuts a piece, and where it crosses the boundary."""

    def __init__(self, piece: Piece, line: Array) -> None:
        line = np.asarray(line, dtype=np.float64)
        if line.shape != (2, 2) or not np.isfinite(line).all() or (line[0] == line[1]).all():
            raise InputError(f"piece {piece.name} is cut along a line through two different points (2, 2)")
        self.piece = piece
        self.foot = line[0]
        self.ahead = (line[1] - line[0]) / np.linalg.norm(line[1] - line[0])
        self.left = np.array([-self.ahead[1], self.ahead[0]])
        corners = np.concatenate([path.points for path in piece.outlines])
        self.clear = VERTEX_CLEARANCE * float(np.linalg.norm(np.ptp(corners, axis=0)))

    def signed_distances(self, points: Array) -> Array:
        """Return the distances of points to the left of the line."""
        return (points - self.foot) @ self.left

    def side_of(self, point: Array) -> int:
        """Return 1 for a point to the left of the line, -1 to the right."""
        return int(np.sign(self.signed_distances(point)))

    def find_crossing_stations(self, track: PathByLength) -> list[float]:
        """Return where a run crosses the line, in mm from its beginning."""
        path = track.path
        heights = self.signed_distances(path.points)
        self.check_clearance(heights, path.points)
        crossing = heights[:-1] * heights[1:] < 0
        near = np.minimum(np.abs(heights[:-1]), np.abs(heights[1:])) < path.lengths / 2
        found = []
        for k in np.flatnonzero(crossing | ((path.bulges != 0) & near)).tolist():
            breaks = np.array([0.0, *self._find_extremal_parts(path, k), 1.0])
            level = self.signed_distances(path.at(np.full(len(breaks), k), breaks))
            self.check_clearance(level, path.points[k : k + 1])
            for low, high, below in zip(breaks[:-1], breaks[1:], level[:-1] * level[1:] < 0, strict=True):
                if below:
                    part = self._bisect_crossing(path, k, low, high)
                    found.append(float(track.stations[k] + part * path.lengths[k]))
        return found

    def check_clearance(self, heights: Array, points: Array) -> None:
        """Refuse a line that touches the boundary."""
        if np.abs(heights).min() < self.clear:
            x, y = points[min(int(np.abs(heights).argmin()), len(points) - 1)]
            raise GeometryError(
                f"the line along which piece {self.piece.name} is to be cut touches its boundary "
                f"near ({x:.6g}, {y:.6g}): shift it by more than {self.clear:.1g} mm"
            )

    def _find_extremal_parts(self, path: Path, k: int) -> list[float]:
        """Return where along an arc its tangent is parallel to the line."""
        half = 2 * np.arctan(path.bulges[k])
        if half == 0:
            return []
        dx, dy = path.points[k + 1] - path.points[k]
        wanted = np.arctan2(self.ahead[1], self.ahead[0]) - np.arctan2(dy, dx) + np.pi * np.arange(-3, 4)
        return sorted(part for part in (1 + wanted / half) / 2 if 0 < part < 1)

    def _bisect_crossing(self, path: Path, k: int, low: float, high: float) -> float:
        """Return where a segment crosses the line, by bisection of a stretch on which its height is monotone."""
        which = np.array([k])
        rising = self.signed_distances(path.at(which, np.array([high])))[0] > 0

        def is_before_line(part: float) -> bool:
            return bool((self.signed_distances(path.at(which, np.array([part])))[0] > 0) != rising)

        low, high = bisect_interval(is_before_line, low, high)
        return (low + high) / 2


def _find_divisions(pieces: Pieces, index: int, line: _CutLine) -> dict[Place, Array]:
    """Return where runs are divided: parts of their length, 0 and 1 among them, for the cut piece and its partners."""
    crossings: dict[Place, Array] = {}
    for j, k, run in pieces.pieces[index].runs():
        if run.path.length > 0:
            track = PathByLength.from_path(run.path)
            crossings[Place(index, j, k)] = np.array(line.find_crossing_stations(track)) / track.length
    if not any(map(len, crossings.values())):
        raise InputError(f"the line does not cross piece {line.piece.name}: nothing is cut")
    for seam in pieces.seams:
        first, second = (crossings.get(side, np.zeros(0)) for side in seam.sides)
        both = np.unique(np.concatenate([first, 1 - second if seam.opposed else second]))
        if len(both):
            kept = both[np.diff(both, prepend=-1.0) > 1e-12]
            crossings[seam.sides[0]] = kept
            crossings[seam.sides[1]] = (1 - kept)[::-1] if seam.opposed else kept
    return {place: np.array([0.0, *parts, 1.0]) for place, parts in crossings.items() if len(parts)}


def _divide_seams(
    pieces: Pieces, divisions: dict[Place, Array]
) -> tuple[list[Seam], dict[_SeamEnd, list[_SeamEnd | None]]]:
    """Return the seams after division, and for each end of an old one those of the new ones, in the run's order."""
    seams: list[Seam] = []
    ends: dict[_SeamEnd, list[_SeamEnd | None]] = {}
    taken = {seam.label for seam in pieces.seams}
    for index, seam in enumerate(pieces.seams):
        count = len(divisions.get(seam.sides[0], (0, 1))) - 1
        fresh = list(range(len(seams), len(seams) + count))
        labels = [seam.label] if count == 1 else _letter_labels(seam.label, count, taken)
        seams.extend(replace(seam, label=label) for label in labels)
        ends[index, 0] = [(k, 0) for k in fresh]
        ends[index, 1] = [(k, 1) for k in (reversed(fresh) if seam.opposed else fresh)]
    return seams, ends


def _letter_labels(stem: str, count: int, taken: set[str]) -> list[str]:
    """Return labels: the stem with letters, none taken yet; they are then."""
    found: list[str] = []
    stems = [stem]
    while len(found) < count:
        stems = [stem + letter for stem in stems for letter in ascii_uppercase]
        found.extend([label for label in stems if label not in taken][: count - len(found)])
    taken.update(found)
    return found


def _divide_run(
    run: Run, parts: Array, ends: Sequence[_SeamEnd | None], line: _CutLine | None, rolled: CurveFunction | None
) -> Iterator[_SidedRun]:
    """Yield the stretches of a run between parts of its length, with their ends, and their sides of the line."""
    if line is None and len(parts) == 2:
        yield _SidedRun(run, ends[0])
        return
    if run.path.length == 0:
        yield _SidedRun(run, ends[0], 0 if line is None else line.side_of(run.path.points[0]))
        return
    track = PathByLength.from_path(run.path)
    places = run.space[np.append(run.path.chords > 0, True)]
    for start, stop, end in zip(parts[:-1] * track.length, parts[1:] * track.length, ends, strict=True):
        side = 0 if line is None else line.side_of(track.points_at((start + stop) / 2))
        if len(parts) == 2:
            yield _SidedRun(run, end, side)
        else:
            path = track.clip_between(start, stop)
            stations = start + np.array([0.0, *np.cumsum(path.lengths)])
            space = _interpolate_space(track, places, stations)
            if rolled is not None:
                new = [k for k, fresh in ((0, start > 0), (-1, stop < track.length)) if fresh]
                space[new] = rolled(path.points[new])
            yield _SidedRun(Run(path, space, run.kind), end, side)


def _interpolate_space(track: PathByLength, places: Array, stations: Array) -> Array:
    """Return the places in space of stations, linear between those of the vertices."""
    return np.stack([np.interp(stations, track.stations, values) for values in places.T], axis=1)


def _separate_parts(
    piece: Piece, loops: Sequence[Sequence[_SidedRun]], line: _CutLine, seams: list[Seam]
) -> list[tuple[Piece, list[list[_SidedRun]]]]:
    """Return the parts of a piece, to the left of the line first; seams along the line are added to those there are."""
    crossings = _find_crossings(loops, line)
    chords: dict[
        tuple[int, int], tuple[_SidedRun, tuple[int, int]]
    ] = {}  # from the last link before to the first behind
    for first, second in zip(crossings[::2], crossings[1::2], strict=True):
        if first.side == second.side:
            raise GeometryError(f"piece {piece.name} covers itself or has a hole outside: it cannot be cut")
        out, into = (first, second) if first.side > 0 else (second, first)
        (label,) = _make_cut_labels(1, {seam.label for seam in seams})
        for end, (a, b) in enumerate(((out, into), (into, out))):
            run = Run(Path.from_points(np.array([a.point, b.point])), np.array([a.place, b.place]), "cut")
            chords[a.before] = _SidedRun(run, (len(seams), end), a.side), b.after
        seams.append(Seam(label, (_NOWHERE, _NOWHERE), angle=0.0))
    rims = [rim for side in (1, -1) for rim in _trace_outlines(loops, chords, side)]
    parts = [[rim] for rim in rims]
    shapes = [to_polygon([close_loop(tuple(link.run for link in rim))], line.clear) for rim in rims]
    crossed = {crossing.before[0] for crossing in crossings}
    for j, loop in enumerate(loops):
        if j not in crossed:
            parts[_find_nearest_shape(shapes, loop[0].run.path.points[0])].append(list(loop))
    scores: list[list[Score]] = [[] for _ in parts]
    for score in piece.scores:
        track = PathByLength.from_path(score.path)
        stations = [0.0, *line.find_crossing_stations(track), track.length]
        for start, stop in pairwise(stations):
            k = _find_nearest_shape(shapes, track.points_at((start + stop) / 2))
            scores[k].append(Score(track.clip_between(start, stop), score.fold))
    return [(replace(piece, scores=tuple(own)), part) for own, part in zip(scores, parts, strict=True)]


@dataclass(frozen=True, slots=True, eq=False)
class _LineCrossing:
    """Where a loop crosses the line: the links before and after it (loop, place), and the side that it leaves."""

    point: Array
    place: Array
    before: tuple[int, int]
    after: tuple[int, int]
    side: int


def _find_crossings(loops: Sequence[Sequence[_SidedRun]], line: _CutLine) -> list[_LineCrossing]:
    """Return where loops cross the line, in order along it."""
    found = []
    for j, loop in enumerate(loops):
        for k, link in enumerate(loop):
            after = (k + 1) % len(loop)
            if loop[after].side != link.side:
                run = link.run
                found.append(_LineCrossing(run.path.points[-1], run.space[-1], (j, k), (j, after), link.side))
    return sorted(found, key=lambda crossing: float((crossing.point - line.foot) @ line.ahead))


def _trace_outlines(
    loops: Sequence[Sequence[_SidedRun]], chords: dict[tuple[int, int], tuple[_SidedRun, tuple[int, int]]], side: int
) -> Iterator[list[_SidedRun]]:
    """Yield the closed chains on one side of the line, made of links and of chords along it."""
    crossed = {j for j, _ in chords}
    left = {(j, k) for j in crossed for k, link in enumerate(loops[j]) if link.side == side}
    while left:
        first = at = min(left)
        rim = []
        while True:
            left.remove(at)
            rim.append(loops[at[0]][at[1]])
            if at in chords:
                chord, at = chords[at]
                rim.append(chord)
            else:
                at = at[0], (at[1] + 1) % len(loops[at[0]])
            if at == first:
                break
        yield rim


def _find_nearest_shape(shapes: Sequence[Any], point: Array) -> int:
    """Return which shape a point is in, or nearest to."""
    return int(shapely.distance(shapes, shapely.points(point)).argmin())


def _number_seams(assembled: Sequence[tuple[Piece, list[list[_SidedRun]]]], seams: Sequence[Seam]) -> Pieces:
    """Return pieces of links; their runs are told their seams, and the seams where their sides are."""
    sides: dict[_SeamEnd, Place] = {}
    pieces = []
    for i, (piece, loops) in enumerate(assembled):
        for j, loop in enumerate(loops):
            for k, link in enumerate(loop):
                if link.end is not None:
                    sides[link.end] = Place(i, j, k)
        numbered = (
            tuple(replace(link.run, seam=None if link.end is None else link.end[0]) for link in loop) for loop in loops
        )
        pieces.append(replace(piece, loops=tuple(numbered)))
    return Pieces(tuple(pieces), tuple(replace(seam, sides=(sides[k, 0], sides[k, 1])) for k, seam in enumerate(seams)))
