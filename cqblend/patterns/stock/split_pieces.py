"""Cuts pieces along straight lines into parts, which are joined again by new seams: pieces may be larger than a sheet.

A cut goes through runs whose seams have another side: that side is divided at the same lengths, so that each seam still
has two runs of equal length. Where a run is divided it gets a vertex, whose point in space the caller computes. Tabs
are added after cutting. Depends on outlines only.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import shapely

from cqblend.argument_checks import check_millimetres
from cqblend.errors import CqblendError, GeometryError, InputError, SizeError
from cqblend.patterns.outline.overlap import to_polygon
from cqblend.patterns.outline.path_by_length import PathByLength
from cqblend.patterns.outline.pieces import Piece, Pieces, Place, Run, Score, Seam, close_loop
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.outline.rotated_boxes import (
    find_convex_hull,
    find_fitting_angle,
    find_flattest_angle,
    measure_rotated_extents,
)
from cqblend.patterns.stock.cut_line import CutLine
from cqblend.patterns.stock.part_names import add_letters, make_cut_labels, reletter_names
from cqblend.patterns.stock.stock_proportions import CUTTING_LIMITS
from cqblend.splines.bernstein import Array

TRIED_OFFSETS = np.array([0.0, *(sign * k * 0.03 for k in range(1, 7) for sign in (1, -1))])
"""Offsets of the cuts that are tried from the wanted one, relative to the width of the part that is cut off."""

FoldPoints = Callable[[int, Array], Array]
"""Maps the index of a piece, and points (n, 2) of it, to where the points are in space, (n, 3)."""

_UNNUMBERED = Place(-1, -1, -1)
"""Stands for the address of a run of a new seam until the runs of all parts are numbered."""


class _SeamEnd(NamedTuple):
    """One side (0 or 1) of a seam, given by its index."""

    seam: int
    side: int


@dataclass(frozen=True, slots=True, eq=False)
class _SidedRun:
    """A run, the end of the seam it belongs to, and its side of the cut: 1 left, -1 right, 0 in pieces not cut."""

    run: Run
    end: _SeamEnd | None
    side: int = 0


_SidedLoop = list[_SidedRun]


def split_piece(pieces: Pieces, index: int, line: Array, fold_points: FoldPoints | None = None) -> Pieces:
    """Return pieces, one of which is cut along a straight line.

    Parameters
    ----------
    pieces
        Without tabs.
    index
        Of the piece to be cut.
    line
        (2, 2), two points on the line.
    fold_points
        Computes the points in space of new vertices. By default they are interpolated between the vertices of their
        runs, which is exact on polyhedra.

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
    >>> square = Path.from_points([[0, 0], [10, 0], [10, 10], [0, 10], [0, 0]])
    >>> whole = Pieces((Piece("1", ((Run(square, np.zeros((5, 3)), "trim"),),)),), ())
    >>> halves = split_piece(whole, 0, np.array([[4.0, 0.0], [4.0, 1.0]]))
    >>> [(piece.name, piece.area) for piece in halves.pieces], [seam.label for seam in halves.seams]
    ([('1A', 40.0), ('1B', 60.0)], ['C1'])
    """
    piece = pieces.pieces[index]
    if any(piece.tabs is not None for piece in pieces.pieces):
        raise InputError(f"piece {piece.name} is to be cut before tabs are added")
    cut = CutLine(piece, line)
    divisions = _find_divisions(pieces, index, cut)
    seams, ends = _divide_seams(pieces, divisions)
    old_ends = {side: _SeamEnd(k, end) for k, seam in enumerate(pieces.seams) for end, side in enumerate(seam.sides)}
    undivided = np.array([0.0, 1.0])
    assembled: list[tuple[Piece, list[_SidedLoop]]] = []
    for i, one in enumerate(pieces.pieces):
        loops: list[_SidedLoop] = [[] for _ in one.loops]
        for j, k, run in one.runs():
            place = Place(i, j, k)
            parts = divisions.get(place, undivided)
            own = ends[old_ends[place]] if place in old_ends else [None] * (len(parts) - 1)
            fold_own = None if fold_points is None else partial(fold_points, i)
            loops[j].extend(_divide_run(run, parts, own, cut if i == index else None, fold_own))
        if i == index:
            divided, cut_seams = _separate_parts(one, loops, cut, seams)
            seams = [*seams, *cut_seams]
            names = add_letters(one.name, len(divided), {piece.name for piece in pieces.pieces})
            assembled.extend((replace(part, name=name), own) for name, (part, own) in zip(names, divided, strict=True))
        else:
            assembled.append((one, loops))
    return _number_seams(assembled, seams)


def split_to_fit(pieces: Pieces, size: tuple[float, float], fold_points: FoldPoints | None = None) -> Pieces:
    """Return pieces, those cut that do not fit a size whichever way they are turned.

    A piece is cut across the longer side of its least box, about where that gives the fewest parts; near there, where
    the cut is short and not close to the ends of seams.

    Parameters
    ----------
    pieces
        Without tabs.
    size
        Width and height, mm: of the sheet, less its margins, and less a tab's width on all sides.
    fold_points
        See :func:`split_piece`; the index is that of the piece before any was cut.

    Raises
    ------
    InputError
        If the size is not two positive numbers.
    SizeError
        If a piece would need more than :attr:`CuttingLimits.most_parts` parts, or cannot be cut.
    """
    width, height = (check_millimetres("the side of what pieces are to fit", side) for side in size)
    most_parts = CUTTING_LIMITS.most_parts
    names, labels = [piece.name for piece in pieces.pieces], {seam.label for seam in pieces.seams}
    origins = [*range(len(names))]  # of each part, the index of the piece that it was cut from
    k = 0
    while k < len(pieces.pieces):
        piece = pieces.pieces[k]
        points = find_convex_hull(piece.outlines, CUTTING_LIMITS.hull_tolerance)
        if find_fitting_angle(points, (width, height)) is not None:
            k += 1
            continue
        if origins.count(origins[k]) >= most_parts or piece.area > most_parts * width * height:
            raise SizeError(
                f"piece {names[origins[k]]} does not fit {width:g} x {height:g} mm in {most_parts} parts: take larger "
                "sheets"
            )
        count = len(pieces.pieces)
        fold_parts = None if fold_points is None else _fold_by_origin(fold_points, tuple(origins))
        pieces = _split_cheapest(pieces, k, points, max(width, height), fold_parts)
        origins[k : k + 1] = [origins[k]] * (1 + len(pieces.pieces) - count)
    return _reletter_pieces(pieces, set(names), labels) if len(origins) > len(names) else pieces


def _fold_by_origin(fold_points: FoldPoints, origins: Sequence[int]) -> FoldPoints:
    """Return the mapping to space for parts, each of which is of the original piece that `origins` names."""
    return lambda part, points: fold_points(origins[part], points)


def _reletter_pieces(pieces: Pieces, names: set[str], labels: set[str]) -> Pieces:
    """Return pieces that were cut several times, lettered as if each of the first had been divided at once."""
    new_names = reletter_names([piece.name for piece in pieces.pieces], names)
    new_labels = reletter_names([seam.label for seam in pieces.seams], labels)
    return Pieces(
        tuple(replace(piece, name=name) for piece, name in zip(pieces.pieces, new_names, strict=True)),
        tuple(replace(seam, label=label) for seam, label in zip(pieces.seams, new_labels, strict=True)),
    )


def _split_cheapest(pieces: Pieces, index: int, points: Array, side: float, fold_points: FoldPoints | None) -> Pieces:
    """Return pieces, one of which is cut across the longer side of its least box.

    Cuts are tried in the order of their costs: length, distance from where parts would be equally wide, and closeness
    to ends of runs.

    Parameters
    ----------
    pieces, index
        The pieces, and which of them is cut.
    points
        (m, 2), convex hull of the piece.
    side
        Longer side of the box that parts have to fit, mm.
    fold_points
        See :func:`split_piece`.
    """
    piece = pieces.pieces[index]
    turn = find_flattest_angle(points)
    length = float(measure_rotated_extents(points, np.array([turn]))[0, 0])
    along, across = np.array([np.cos(turn), -np.sin(turn)]), np.array([np.sin(turn), np.cos(turn)])
    start = float((points @ along).min())
    width = length / max(np.ceil(length / side), 2)
    polygon = to_polygon(piece.outlines, 1e-3 * length)
    reach = 2 * length + float(np.abs(points).max())
    positions = start + width * (1 + TRIED_OFFSETS)
    feet = positions[:, None] * along
    chords = shapely.linestrings(np.stack([feet - reach * across, feet + reach * across], axis=1))
    ends = np.array([run.path.points[0] for *_, run in piece.runs()])
    clearances = np.abs(positions[:, None] - ends @ along).min(axis=1)
    costs = shapely.length(shapely.intersection(polygon, chords)) + 0.5 * width * np.abs(TRIED_OFFSETS)
    costs += np.maximum(CUTTING_LIMITS.end_clearance * side - clearances, 0.0)
    failure: CqblendError | None = None
    for k in np.argsort(costs, kind="stable"):
        try:
            return split_piece(pieces, index, np.array([feet[k], feet[k] + across]), fold_points)
        except (GeometryError, InputError) as error:
            failure = error
    raise SizeError(f"piece {piece.name}, {length:.1f} mm long, does not fit and cannot be cut: {failure}")


def _find_divisions(pieces: Pieces, index: int, line: CutLine) -> dict[Place, Array]:
    """Return the runs that are divided, of the cut piece and across its seams: parts of their length, 0 and 1 too."""
    crossings: dict[Place, Array] = {}
    for j, k, run in pieces.pieces[index].runs():
        if run.path.length > 0:
            path = PathByLength.from_path(run.path)
            crossings[Place(index, j, k)] = np.array(line.find_crossing_stations(path)) / path.length
    if not any(map(len, crossings.values())):
        raise InputError(f"the line does not cross piece {line.piece.name}: nothing is cut")
    for seam in pieces.seams:
        first, second = (crossings.get(side, np.zeros(0)) for side in seam.sides)
        both = np.unique(np.concatenate([first, 1 - second if seam.opposed else second]))
        if len(both):
            distinct = both[np.diff(both, prepend=-1.0) > 1e-12]
            crossings[seam.sides[0]] = distinct
            crossings[seam.sides[1]] = (1 - distinct)[::-1] if seam.opposed else distinct
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
        labels = [seam.label] if count == 1 else add_letters(seam.label, count, taken)
        taken.update(labels)
        seams.extend(replace(seam, label=label) for label in labels)
        ends[_SeamEnd(index, 0)] = [_SeamEnd(k, 0) for k in fresh]
        ends[_SeamEnd(index, 1)] = [_SeamEnd(k, 1) for k in (reversed(fresh) if seam.opposed else fresh)]
    return seams, ends


def _divide_run(
    run: Run,
    parts: Array,
    ends: Sequence[_SeamEnd | None],
    line: CutLine | None,
    fold_points: Callable[[Array], Array] | None,
) -> Iterator[_SidedRun]:
    """Yield the stretches of a run between parts of its length.

    Parameters
    ----------
    run
        The run.
    parts
        From 0 to 1.
    ends
        Of the seams of the stretches.
    line
        The cut, if the run is of the piece that is cut.
    fold_points
        Maps points (n, 2) of the run's piece to space.
    """
    if line is None and len(parts) == 2:
        yield _SidedRun(run, ends[0])
        return
    if run.path.length == 0:
        yield _SidedRun(run, ends[0], 0 if line is None else line.side_of(run.path.points[0]))
        return
    path = PathByLength.from_path(run.path)
    vertices = run.space[np.append(run.path.chords > 0, True)]
    for start, stop, end in zip(parts[:-1] * path.length, parts[1:] * path.length, ends, strict=True):
        side = 0 if line is None else line.side_of(path.points_at((start + stop) / 2))
        if len(parts) == 2:
            yield _SidedRun(run, end, side)
        else:
            stretch = path.clip_between(start, stop)
            stations = start + np.array([0.0, *np.cumsum(stretch.lengths)])
            space = _interpolate_space(path, vertices, stations)
            if fold_points is not None:
                new = [k for k, is_new in ((0, start > 0), (-1, stop < path.length)) if is_new]
                space[new] = fold_points(stretch.points[new])
            yield _SidedRun(Run(stretch, space, run.kind), end, side)


def _interpolate_space(path: PathByLength, vertices: Array, stations: Array) -> Array:
    """Return the points in space of stations, linear between those of the vertices (n + 1, 3)."""
    return np.stack([np.interp(stations, path.stations, values) for values in vertices.T], axis=1)


class _RunAddress(NamedTuple):
    """A run of the cut piece: indices of its loop, and in the loop."""

    loop: int
    run: int


class _Chord(NamedTuple):
    """A stretch of the cut as a run of one part, and the run of the boundary that follows it."""

    run: _SidedRun
    next_run: _RunAddress


def _separate_parts(
    piece: Piece, loops: Sequence[_SidedLoop], line: CutLine, seams: Sequence[Seam]
) -> tuple[list[tuple[Piece, list[_SidedLoop]]], list[Seam]]:
    """Return the parts of a piece with their loops, those to the left of the line first, and the seams along the line.

    Parameters
    ----------
    piece
        The piece that is cut.
    loops
        Its runs, divided at the line.
    line
        The cut.
    seams
        Those there are already: new ones are counted after them.
    """
    crossings = _find_crossings(loops, line)
    chords: dict[_RunAddress, _Chord] = {}  # by the run before
    cut_seams: list[Seam] = []
    labels = make_cut_labels(len(crossings) // 2, {seam.label for seam in seams})
    for label, first, second in zip(labels, crossings[::2], crossings[1::2], strict=True):
        if first.side == second.side:
            raise GeometryError(f"piece {piece.name} covers itself or has a hole outside: it cannot be cut")
        leaving, entering = (first, second) if first.side > 0 else (second, first)  # the left side of the line
        for end, (a, b) in enumerate(((leaving, entering), (entering, leaving))):
            run = Run(Path.from_points(np.array([a.point, b.point])), np.array([a.space, b.space]), "cut")
            seam_end = _SeamEnd(len(seams) + len(cut_seams), end)
            chords[a.before] = _Chord(_SidedRun(run, seam_end, a.side), b.after)
        cut_seams.append(Seam(label, (_UNNUMBERED, _UNNUMBERED), angle=0.0))
    outlines = [outline for side in (1, -1) for outline in _trace_outlines(loops, chords, side)]
    parts = [[outline] for outline in outlines]
    polygons = [to_polygon([close_loop(tuple(one.run for one in outline))], line.clearance) for outline in outlines]
    crossed = {crossing.before.loop for crossing in crossings}
    for j, loop in enumerate(loops):
        if j not in crossed:
            parts[_find_nearest_polygon(polygons, loop[0].run.path.points[0])].append(list(loop))
    scores: list[list[Score]] = [[] for _ in parts]
    for score in piece.scores:
        path = PathByLength.from_path(score.path)
        stations = [0.0, *line.find_crossing_stations(path), path.length]
        for start, stop in pairwise(stations):
            k = _find_nearest_polygon(polygons, path.points_at((start + stop) / 2))
            scores[k].append(Score(path.clip_between(start, stop), score.fold))
    divided = [(replace(piece, scores=tuple(own)), part) for own, part in zip(scores, parts, strict=True)]
    return divided, cut_seams


@dataclass(frozen=True, slots=True, eq=False)
class _LineCrossing:
    """A vertex at which a loop crosses the line.

    Attributes
    ----------
    point, space
        The vertex in the plane, (2,), and in space, (3,).
    before, after
        The runs that end and begin there.
    side
        The side of the line that the loop leaves: 1 is left, -1 right.
    """

    point: Array
    space: Array
    before: _RunAddress
    after: _RunAddress
    side: int


def _find_crossings(loops: Sequence[_SidedLoop], line: CutLine) -> list[_LineCrossing]:
    """Return where loops cross the line, in order along it."""
    found = []
    for j, loop in enumerate(loops):
        for k, sided in enumerate(loop):
            after = (k + 1) % len(loop)
            if loop[after].side != sided.side:
                run, ends = sided.run, (_RunAddress(j, k), _RunAddress(j, after))
                found.append(_LineCrossing(run.path.points[-1], run.space[-1], *ends, sided.side))
    return sorted(found, key=lambda crossing: float((crossing.point - line.foot) @ line.direction))


def _trace_outlines(loops: Sequence[_SidedLoop], chords: dict[_RunAddress, _Chord], side: int) -> Iterator[_SidedLoop]:
    """Yield the outlines of the parts on one side of the line, walked along the boundary and along the cut."""
    crossed = {address.loop for address in chords}
    remaining = {_RunAddress(j, k) for j in crossed for k, run in enumerate(loops[j]) if run.side == side}
    while remaining:
        first = at = min(remaining)
        outline = []
        while True:
            remaining.remove(at)
            outline.append(loops[at.loop][at.run])
            if at in chords:
                chord, at = chords[at]
                outline.append(chord)
            else:
                at = _RunAddress(at.loop, (at.run + 1) % len(loops[at.loop]))
            if at == first:
                break
        yield outline


def _find_nearest_polygon(polygons: Sequence[Any], point: Array) -> int:
    """Return the index of the polygon that a point (2,) is in, or nearest to."""
    return int(shapely.distance(polygons, shapely.points(point)).argmin())


def _number_seams(assembled: Sequence[tuple[Piece, list[_SidedLoop]]], seams: Sequence[Seam]) -> Pieces:
    """Return pieces of sided runs: each run gets the index of its seam, and each seam the addresses of its runs."""
    sides: dict[_SeamEnd, Place] = {}
    pieces = []
    for i, (piece, loops) in enumerate(assembled):
        for j, loop in enumerate(loops):
            for k, sided in enumerate(loop):
                if sided.end is not None:
                    sides[sided.end] = Place(i, j, k)
        numbered = (
            tuple(replace(one.run, seam=None if one.end is None else one.end.seam) for one in loop) for loop in loops
        )
        pieces.append(replace(piece, loops=tuple(numbered)))
    return Pieces(
        tuple(pieces),
        tuple(replace(seam, sides=(sides[_SeamEnd(k, 0)], sides[_SeamEnd(k, 1)])) for k, seam in enumerate(seams)),
    )
