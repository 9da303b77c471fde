"""What remains of a face: the arrangement of its new boundary in its parameter plane.

When blends trim a face, its boundary becomes a cycle of old curves, pieces of old ones and new ones, all with the
material to the left. The winding number of that cycle is additive: it is that of the old loops less that of the strips
between blended edge and rail. Where all is well, no two curves meet but at common ends, and it is 1 to the left of
each of them and 0 to the right. Where a rail cuts a hole, or leaves the face, curves cross; a loop that lies in a strip
has the wrong numbers on both sides. So crossings and winding numbers tell what remains, without a polygon of any strip.

Curves are made polylines, finer and finer where two of them come near each other, until it is certain whether they
meet. Knows nothing but points of curves in a plane with one unit of length.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from cqblend.blends.network.tolerances import NETWORK_TOLERANCES
from cqblend.splines.bernstein import Array

Indices = NDArray[np.intp]


@dataclass(frozen=True)
class BoundaryCurve:
    """One curve of a boundary: a function from parameters (n,) to points (n, 2), over a span in the boundary's sense.

    A span may decrease. ``ends`` name the vertices at its start and stop: curves with a common name join there. Curves
    that are not ``new`` did not meet before.
    """

    evaluate: Callable[[Array], Array]
    span: tuple[float, float]
    ends: tuple[Hashable, Hashable]
    straight: bool = False
    new: bool = True


@dataclass(frozen=True)
class Meeting:
    """A place where two curves, by their indices, cross or touch, but for a common end; and the parameters of both."""

    curves: tuple[int, int]
    parameters: tuple[float, float]
    point: Array  # (2,)


@dataclass(frozen=True)
class Remainder:
    """What the curves of a boundary enclose.

    ``bounding`` tells, of each curve, which share of it bounds the remainder: 1 of all of it, 0 of a swallowed one.
    ``areas`` are those of the loops of the remainder, negative of holes.
    """

    meetings: tuple[Meeting, ...]
    bounding: Array  # (m,)
    areas: tuple[float, ...]

    @property
    def is_sound(self) -> bool:
        """Whether the boundary encloses one region just as it is."""
        return not self.meetings and bool((self.bounding == 1).all()) and self.piece_count == 1

    @property
    def piece_count(self) -> int:
        """The number of separate regions: 0 if nothing remains."""
        return sum(area > 0 for area in self.areas)


def find_remainder(curves: Sequence[BoundaryCurve], tolerance: float, slack: float = 0.0) -> Remainder:
    """Return what remains inside a boundary.

    Parameters
    ----------
    curves
        A cycle: at every name of an end, as many curves start as stop.
    tolerance
        Curves nearer to each other than this meet.
    slack
        How far from a common end two curves may meet because their ends do not quite agree.
    """
    segments, pairs = _find_near_segments(curves, tolerance, slack)
    beside = _find_joined_pairs(curves, segments, pairs)
    meetings, cuts = _locate_meetings(segments, pairs, beside.joined | (beside.reach <= slack))
    runs = _split_into_runs(segments, cuts)
    inner, outer = _count_windings(segments, runs, tolerance)
    bounds = (inner > 0) & (outer <= 0)
    lengths = np.bincount(runs.curve, runs.length, len(curves))
    kept = np.bincount(runs.curve[bounds], runs.length[bounds], len(curves))
    share = np.where(kept == lengths, 1.0, kept / np.where(lengths > 0, lengths, 1.0))
    return Remainder(meetings, share, _measure_loops(runs, np.flatnonzero(bounds)))


@dataclass(frozen=True)
class _Segments:
    """Chords of curves: the curve, parameters (n, 2), end points (n, 2, 2), and how far (n,) the curve is from them."""

    curve: Indices
    t: Array
    points: Array
    sagitta: Array

    def take(self, which: Indices | NDArray[np.bool_]) -> _Segments:
        return _Segments(self.curve[which], self.t[which], self.points[which], self.sagitta[which])

    @property
    def length(self) -> Array:
        return np.asarray(np.linalg.norm(self.points[:, 1] - self.points[:, 0], axis=1))


def _cut_curve(curve: BoundaryCurve, number: int, starts: Array, stops: Array, count: int) -> _Segments:
    """Return chords of a curve, ``count`` for each of the ranges between some parameters (n,)."""
    shares = np.arange(2 * count + 1) / (2 * count)
    t = starts[:, None] * (1 - shares) + stops[:, None] * shares
    points = curve.evaluate(t.ravel()).reshape(*t.shape, 2)
    first, middle, last = points[:, :-1:2], points[:, 1::2], points[:, 2::2]
    sagitta = np.linalg.norm(middle - (first + last) / 2, axis=2) * NETWORK_TOLERANCES.sagitta_margin
    ranges = np.stack([t[:, :-1:2], t[:, 2::2]], axis=2).reshape(-1, 2)
    chords = np.stack([first, last], axis=2).reshape(-1, 2, 2)
    return _Segments(np.full(len(ranges), number), ranges, chords, sagitta.ravel())


def _join_segments(parts: Sequence[_Segments]) -> _Segments:
    fields = ([getattr(part, name) for part in parts] for name in ("curve", "t", "points", "sagitta"))
    return _Segments(*map(np.concatenate, fields))


def _find_near_segments(curves: Sequence[BoundaryCurve], tolerance: float, slack: float) -> tuple[_Segments, Indices]:
    """Return fine enough chords of all curves, and the pairs (k, 2) of chords of different curves that meet.

    Chords are cut finer several times over until their distance tells. Beside a common end two curves are always near
    each other: there they do not meet again if they leave it in different directions.
    """
    first = NETWORK_TOLERANCES.first_chords
    segments = _join_segments(
        [
            _cut_curve(curve, k, np.array(curve.span[:1]), np.array(curve.span[1:]), 1 if curve.straight else first)
            for k, curve in enumerate(curves)
        ]
    )
    is_new = np.array([curve.new for curve in curves])
    one, other = np.nonzero(
        is_new[segments.curve][:, None] & (segments.curve[:, None] < segments.curve)
        | (~is_new)[segments.curve] & is_new[segments.curve][:, None] & (segments.curve[:, None] > segments.curve)
    )
    pairs = np.stack([one, other], axis=1)
    for _ in range(NETWORK_TOLERANCES.chord_refinements):
        pairs = pairs[_have_near_boxes(segments, pairs, tolerance)]
        distance = _measure_distances(segments, pairs)
        pairs = pairs[distance <= segments.sagitta[pairs].sum(axis=1) + tolerance]
        beside = _find_joined_pairs(curves, segments, pairs)
        is_clear = beside.joined & beside.parting
        is_long = beside.joined & (beside.reach > max(20 * tolerance, slack))
        pairs, refined = pairs[~is_clear], is_long[~is_clear]
        rough = np.zeros(len(segments.curve), dtype=bool)
        rough[pairs[refined]] = True
        rough |= np.isin(np.arange(len(rough)), pairs) & (segments.sagitta > tolerance / 4)
        if not rough.any() or len(pairs) > NETWORK_TOLERANCES.most_chord_pairs:
            break
        segments, pairs = _refine_segments(curves, segments, pairs, rough)
    return segments, pairs


def _have_near_boxes(segments: _Segments, pairs: Indices, tolerance: float) -> NDArray[np.bool_]:
    reach = (segments.sagitta + tolerance)[:, None]
    low, high = segments.points.min(axis=1) - reach, segments.points.max(axis=1) + reach
    one, other = pairs.T
    return np.asarray(((low[one] <= high[other]) & (low[other] <= high[one])).all(axis=1))


def _measure_distances(segments: _Segments, pairs: Indices) -> Array:
    """Return the distances (k,) of pairs of chords: 0 where they cross."""
    (a, b), (c, d) = (np.moveaxis(segments.points[which], 1, 0) for which in pairs.T)
    ends = [_measure_to_chord(*chord) for chord in ((a, c, d), (b, c, d), (c, a, b), (d, a, b))]
    cross = (_cross(b - a, c - a) * _cross(b - a, d - a) < 0) & (_cross(d - c, a - c) * _cross(d - c, b - c) < 0)
    return np.asarray(np.where(cross, 0.0, np.min(ends, axis=0)))


def _measure_to_chord(p: Array, a: Array, b: Array) -> Array:
    """Return the distances of points from chords from a to b, all (k, 2)."""
    return np.asarray(np.linalg.norm(p - a - _find_foot(p, a, b)[:, None] * (b - a), axis=1))


def _find_nearest_shares(chord: tuple[Array, Array], other: tuple[Array, Array]) -> tuple[Array, Array]:
    """Return the shares (k,) of pairs of chords, each given by its ends (k, 2), where they cross or are nearest."""
    (a, b), (c, d) = chord, other
    det = _cross(b - a, d - c)
    with np.errstate(divide="ignore", invalid="ignore"):
        share, across = _cross(c - a, d - c) / det, _cross(c - a, b - a) / det
    ends = np.array([0.0, 1.0])[:, None]
    candidates = np.stack([np.broadcast_to(ends, (2, len(a))), [_find_foot(p, a, b) for p in (c, d)]]).reshape(4, -1)
    partners = np.stack([[_find_foot(p, c, d) for p in (a, b)], np.broadcast_to(ends, (2, len(a)))]).reshape(4, -1)
    apart = a + candidates[..., None] * (b - a) - c - partners[..., None] * (d - c)
    nearest = np.linalg.norm(apart, axis=2).argmin(axis=0), np.arange(len(a))
    cross = (np.abs(share - 0.5) <= 0.5) & (np.abs(across - 0.5) <= 0.5)
    return np.where(cross, share, candidates[nearest]), np.where(cross, across, partners[nearest])


def _find_foot(p: Array, a: Array, b: Array) -> Array:
    """Return the shares (k,) of chords at which they are nearest to points."""
    along = ((b - a) ** 2).sum(axis=1)
    return np.asarray(np.clip(((p - a) * (b - a)).sum(axis=1) / np.where(along > 0, along, 1.0), 0, 1))


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


@dataclass(frozen=True)
class _JoinedPairs:
    """Of pairs (k,) of chords, what they have to do with a common end of their curves.

    Both chords of ``joined`` ones start or stop there, and are not straight and parallel; they are ``parting`` if they
    leave it in so different directions that they do not meet again. ``reach`` is the largest distance of any of their
    points from the common end, infinite if there is none.
    """

    joined: NDArray[np.bool_]
    parting: NDArray[np.bool_]
    reach: Array


def _find_joined_pairs(curves: Sequence[BoundaryCurve], segments: _Segments, pairs: Indices) -> _JoinedPairs:
    """Find the pairs of chords beside common ends of their curves."""
    joined, parting, reach = np.zeros(len(pairs), bool), np.zeros(len(pairs), bool), np.full(len(pairs), np.inf)
    spans, straight = np.array([curve.span for curve in curves]), np.array([curve.straight for curve in curves])
    numbers = {name: i for i, name in enumerate(dict.fromkeys(end for curve in curves for end in curve.ends))}
    ends = np.array([[numbers[end] for end in curve.ends] for curve in curves])
    corners = np.array([curve.evaluate(np.array(curve.span)) for curve in curves])  # (m, 2 ends, 2)
    curve = segments.curve[pairs]
    for i, j in product((0, 1), repeat=2):
        common = np.flatnonzero(ends[curve[:, 0], i] == ends[curve[:, 1], j])
        one, other = pairs[common].T
        here = segments.t[one, i] == spans[curve[common, 0], i]
        here &= segments.t[other, j] == spans[curve[common, 1], j]
        away = [segments.points[which, 1 - end] - segments.points[which, end] for which, end in ((one, i), (other, j))]
        angle = np.arctan2(np.abs(_cross(*away)), (away[0] * away[1]).sum(axis=1))
        lengths = np.stack([segments.length[one], segments.length[other]])
        sagitta = np.stack([segments.sagitta[one], segments.sagitta[other]])
        bend = 2 * (sagitta / np.where(lengths > 0, lengths, 1.0)).sum(axis=0)
        lines = straight[curve[common]].all(axis=1)
        joined[common] |= here & ~(lines & (angle <= NETWORK_TOLERANCES.coincident_lines))
        parting[common] |= here & (lines | (angle > np.maximum(4 * bend, NETWORK_TOLERANCES.parting_angle)))
        points = np.concatenate([segments.points[one], segments.points[other]], axis=1)
        farthest = np.linalg.norm(points - corners[curve[common, 0], i][:, None], axis=2).max(axis=1)
        reach[common] = np.minimum(reach[common], farthest)
    return _JoinedPairs(joined, parting, reach)


def _refine_segments(
    curves: Sequence[BoundaryCurve], segments: _Segments, pairs: Indices, rough: NDArray[np.bool_]
) -> tuple[_Segments, Indices]:
    """Cut rough chords finer; return all chords and the pairs of all parts of each pair."""
    count = NETWORK_TOLERANCES.chord_parts
    parts, position = [segments.take(~rough)], np.cumsum(~rough) - 1
    children = np.empty((len(rough), count), dtype=np.intp)
    children[:] = position[:, None]
    total = int((~rough).sum())
    for number in np.unique(segments.curve[rough]).tolist():
        own = np.flatnonzero(rough & (segments.curve == number))
        parts.append(_cut_curve(curves[number], number, segments.t[own, 0], segments.t[own, 1], count))
        children[own] = total + np.arange(len(own) * count).reshape(-1, count)
        total += len(own) * count
    one, other = children[pairs[:, 0]], children[pairs[:, 1]]
    parted = np.stack(np.broadcast_arrays(one[:, :, None], other[:, None, :]), axis=3).reshape(-1, 2)
    return _join_segments(parts), np.unique(parted, axis=0)


def _locate_meetings(
    segments: _Segments, pairs: Indices, joined: NDArray[np.bool_]
) -> tuple[tuple[Meeting, ...], tuple[Indices, Array]]:
    """Return where curves meet, and where to cut them: chords, and the shares of these.

    Curves that touch meet at many neighbouring chords: the first place of these counts, and the last is cut as well.
    Where such a row of ``joined`` chords leads to a common end, curves only leave that end tangentially.
    """
    if not len(pairs):
        return (), (np.empty(0, dtype=np.intp), np.empty(0))
    one, other = pairs.T
    (a, b), (c, d) = (np.moveaxis(segments.points[which], 1, 0) for which in (one, other))
    share, across = _find_nearest_shares((a, b), (c, d))
    points = a + share[:, None] * (b - a)
    t = [segments.t[which, 0] * (1 - s) + segments.t[which, 1] * s for which, s in ((one, share), (other, across))]
    keys = np.stack([segments.curve[one], segments.curve[other]], axis=1)
    number = np.unique(keys, axis=0, return_inverse=True)[1].ravel()
    lengths = np.zeros((2, number.max() + 1))
    for longest, which in zip(lengths, (one, other), strict=True):
        np.maximum.at(longest, number, segments.length[which])
    spans = np.sort(segments.t[np.where((lengths[0] <= lengths[1])[number], one, other)], axis=1)  # of the finer curve
    order = np.lexsort((spans[:, 0], number))
    keys, points, spans, number = keys[order], points[order], spans[order], number[order]
    slack = NETWORK_TOLERANCES.same_parameter * np.abs(spans).max()
    starts = np.append(True, (np.diff(number) != 0) | (spans[1:, 0] > spans[:-1, 1] + slack))
    is_joint = np.bincount(np.cumsum(starts) - 1, joined[order]) > 0
    first, last = order[starts][~is_joint], order[np.append(starts[1:], True)][~is_joint]
    meetings = [
        Meeting((int(pair[0]), int(pair[1])), (float(t[0][k]), float(t[1][k])), point)
        for k, pair, point in zip(first, keys[starts][~is_joint], points[starts][~is_joint], strict=True)
    ]
    cut = np.append(first, last)
    return tuple(meetings), (np.append(one[cut], other[cut]), np.append(share[cut], across[cut]))


@dataclass(frozen=True)
class _Runs:
    """Stretches of curves between cuts: their curve (n,), length, ends (n, 2, 2), and area towards the origin.

    ``places`` (n, 2, 2) are the ends of the longest chord of each.
    """

    curve: Indices
    length: Array
    ends: Array
    area: Array
    places: Array


def _split_into_runs(segments: _Segments, cuts: tuple[Indices, Array]) -> _Runs:
    """Split all curves where they meet others."""
    chord = np.concatenate([np.arange(len(segments.curve)), cuts[0]])
    share = np.concatenate([np.zeros(len(segments.curve)), cuts[1]])
    start = segments.t[chord, 0]
    sense = np.sign(segments.t[:, 1] - segments.t[:, 0])[chord]
    order = np.lexsort((share, start * sense, segments.curve[chord]))
    chord, share, begins = chord[order], share[order], (np.arange(len(chord)) >= len(segments.curve))[order]
    following = np.roll(share, -1)
    following[np.roll(chord, -1) != chord] = 1.0
    a, b = segments.points[chord, 0], segments.points[chord, 1]
    low, high = a + share[:, None] * (b - a), a + following[:, None] * (b - a)
    curve = segments.curve[chord]
    begins |= np.append(True, np.diff(curve) > 0)
    run = np.cumsum(begins) - 1
    length = np.linalg.norm(high - low, axis=1)
    firsts = np.flatnonzero(begins)
    lasts = np.append(firsts[1:], len(run)) - 1
    longest = np.lexsort((length, run))[lasts]
    return _Runs(
        curve[firsts],
        np.bincount(run, length),
        np.stack([low[firsts], high[lasts]], axis=1),
        np.bincount(run, _cross(low, high) / 2),
        np.stack([low[longest], high[longest]], axis=1),
    )


def _count_windings(segments: _Segments, runs: _Runs, tolerance: float) -> tuple[Indices, Indices]:
    """Return the winding numbers (n,) of all curves about points just to the left and to the right of runs."""
    step = runs.places[:, 1] - runs.places[:, 0]
    size = np.linalg.norm(step, axis=1)[:, None]
    left = np.stack([-step[:, 1], step[:, 0]], axis=1) / np.where(size > 0, size, 1.0) * tolerance / 4
    middle = runs.places.mean(axis=1)
    found = []
    for p in (middle + left, middle - left):
        a, b = (segments.points[None, :, k] - p[:, None] for k in (0, 1))
        turn = np.arctan2(_cross(a, b), (a * b).sum(axis=2)).sum(axis=1)
        found.append(np.round(turn / (2 * np.pi)).astype(np.intp))
    return found[0], found[1]


def _measure_loops(runs: _Runs, kept: Indices) -> tuple[float, ...]:
    """Trace loops of the runs that are kept, each followed by the one that starts nearest, and return their areas."""
    waiting, areas = kept.tolist(), []
    while waiting:
        loop = [waiting.pop(0)]
        while True:
            candidates = [loop[0], *waiting]
            gaps = np.linalg.norm(runs.ends[candidates, 0] - runs.ends[loop[-1], 1], axis=1)
            following = candidates[int(gaps.argmin())]
            if following == loop[0]:
                break
            loop.append(following)
            waiting.remove(following)
        areas.append(float(runs.area[loop].sum()))
    return tuple(areas)
