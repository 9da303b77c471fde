"""Tabs (stubs): what is added along seams so that pieces can be glued, welded or stitched together.

Elber (1995), section 3 and figure 6: stubs are made by offsetting the boundary curves of the flat pieces; or they are
separate strips that span two pieces from underneath, which leaves no stair. Where a tab is glued under the neighbour
it has to lie inside the neighbour's outline, else it would show. Holds the styles: which flaps a seam is given, and
what is cut and folded once they fit. Nothing is dropped in silence. Must not know how flaps are made to fit, sheets
or files.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Literal, get_args

import numpy as np

from cqblend.checks import check_millimetres
from cqblend.errors import InputError, shown
from cqblend.patterns.outline.overlap import find_winding_errors
from cqblend.patterns.outline.parallel_path import PathByLength
from cqblend.patterns.outline.pieces import Fold, Piece, Pieces, Place, Run, Score, Seam
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.flaps import Flap, FlapFitter, FlapZone, fit_flaps, make_flap_top
from cqblend.splines.bernstein import Array

TabStyle = Literal["one", "alternating", "both", "strips", "allowance"]
"""Tabs on one side of each seam, teeth on either side in turn, flanges on both sides, separate connecting strips from
below, or a plain seam allowance on both sides."""

STEEPEST_LEG = np.radians(75.0)
"""Legs between teeth are at most this steep, so that two of them do not share a cut."""

SHALLOWEST_LEG = np.radians(3.0)
"""Legs in pointed corners are at least this steep."""

MOST_TOOTH_BEND = np.pi / 6
"""Angle by which a tooth may bend along its base."""

CORNER_SHARE = 0.45
"""Part of the angle outside a corner that the tab on either of its sides may take."""

MITRE_LIMIT = 2.0
"""A seam allowance is mitred at corners up to this multiple of its width, along the edge."""

TAB_CORNER_ANGLE = np.radians(20.0)
"""Where a run turns by more than this at once it has a corner, at which a tab ends and another begins."""

LEAST_TAB_HEIGHT = 2.0
"""Tabs lower than this are dropped, mm, or lower than a quarter of their width if that is less."""

MOST_TEETH = 20_000
"""No more teeth than this are made: they take a second for each few thousand."""

SAME_CURVE = 0.02
"""Curves closer than this to each other, relative to the width of tabs, count as the same, or as straight."""


@dataclass(frozen=True, slots=True, eq=False)
class Tabs:
    """Pieces with tabs, and how far the tabs are what was asked for.

    Attributes
    ----------
    pieces
        The pieces with their cut outlines and scores; connecting strips are appended as pieces of their own.
    coverage
        (seams,), the part of each seam's length that carries tabs; of both sides, where both should have some.
    heights
        (seams,), height of the lowest tab of each seam, mm; 0 where there is none.
    width
        The width asked for, mm.
    """

    pieces: Pieces
    coverage: Array
    heights: Array
    width: float

    @property
    def missing(self) -> tuple[str, ...]:
        """Labels of the seams that have no tab at all, for want of room."""
        return tuple(self.pieces.seams[k].label for k in np.flatnonzero(self.coverage == 0))

    @property
    def narrowed(self) -> tuple[str, ...]:
        """Labels of the seams whose tabs are partly missing or lower than the width."""
        short = (self.coverage > 0) & ((self.coverage < 1 - 1e-9) | (self.heights < self.width * (1 - 1e-9)))
        return tuple(self.pieces.seams[k].label for k in np.flatnonzero(short))


def add_tabs(
    pieces: Pieces,
    *,
    style: TabStyle = "one",
    width: float,
    taper: float = np.pi / 4,
    pitch: float | None = None,
    least: float | None = None,
) -> Pieces:
    """Return pieces with tabs; see :func:`fit_tabs`, which also tells what did not fit."""
    return fit_tabs(pieces, style=style, width=width, taper=taper, pitch=pitch, least=least).pieces


def fit_tabs(
    pieces: Pieces,
    *,
    style: TabStyle = "one",
    width: float,
    taper: float = np.pi / 4,
    pitch: float | None = None,
    least: float | None = None,
) -> Tabs:
    """Return pieces with tabs along their seams, and what did not fit.

    A tab's base is its run, its top the parallel of the run at the tab's height (arcs stay arcs). Its legs stand at
    the taper, flatter in corners: at most half of the neighbour's corner, so that two tabs glued into it do not meet.
    Where the seam is curved, in the plane or in space, the tab is cut into teeth.

    Styles
        ``"one"``: on the side where more of it fits, the seam's first side if both are alike; glued under the other
        piece. ``"alternating"``: congruent teeth on either side in turn, which interlock. ``"both"``: flanges on both
        sides, folded inwards and joined face to face; only the plane limits them. ``"strips"``: separate strips
        underneath, half under each piece, without the stair that a tab makes; of one part where both sides of the
        seam have the same curve in the plane, else straight stubs one after another. ``"allowance"``: both sides,
        without teeth, mitred at corners.

    Folds
        A tab lies underneath its neighbour, so it is folded as the surface is: a mountain where the seam is convex
        (also where its angle is unknown), a valley where it is concave, and not at all where the surface goes on
        smoothly, see :attr:`Seam.fold`. Flanges and allowances turn by (pi + angle) / 2 to the inner side: always a
        mountain.

    Parameters
    ----------
    pieces
        The pieces, without tabs.
    style
        See above.
    width
        Height of tabs above their base, mm; of connecting strips, on either side of the seam.
    taper
        Angle between base and legs (rad), above 0, at most pi / 2. Legs are made steeper where a tab is short.
    pitch
        Length of teeth along the base, mm; three widths if not given.
    least
        Least height, mm: lower tabs are dropped. A quarter of the width, but at most :data:`LEAST_TAB_HEIGHT`, if not
        given.

    Raises
    ------
    InputError
        If a length or the taper is out of range, the style unknown, a piece has tabs already, or there would be more
        than :data:`MOST_TEETH` teeth.

    Examples
    --------
    >>> corners = np.array([[0, 0], [40, 0], [40, 40], [0, 40], [0, 0]])
    >>> edges = [Run(Path.straight(corners[k : k + 2]), np.full((2, 3), np.nan), "trim") for k in range(4)]
    >>> left = Piece("1", ((*edges[:1], replace(edges[1], seam=0), *edges[2:]),))
    >>> right = Piece("2", ((*edges[:3], replace(edges[3], seam=0)),))
    >>> seam = Seam("1", (Place(0, 0, 1), Place(1, 0, 3)))
    >>> tabs = fitted_tabs(Pieces((left, right), (seam,)), width=5)
    >>> tabs.pieces.pieces[0].cuts[0].points.round(9).tolist()
    [[0.0, 0.0], [40.0, 0.0], [45.0, 5.0], [45.0, 35.0], [40.0, 40.0], [0.0, 40.0], [0.0, 0.0]]
    """
    if not isinstance(style, str) or style not in get_args(TabStyle):
        raise InputError(f"the style of tabs is one of {', '.join(get_args(TabStyle))}, not {shown(style)}")
    width = check_millimetres("the width of tabs", width)
    pitch = 3 * width if pitch is None else check_millimetres("the pitch of tabs", pitch)
    least = min(width / 4, LEAST_TAB_HEIGHT) if least is None else check_millimetres("the least height of tabs", least)
    if least > width:
        raise InputError(f"the least height of tabs, {least:g} mm, exceeds their width, {width:g} mm")
    if isinstance(taper, bool) or not isinstance(taper, int | float) or not 0 < taper <= np.pi / 2 + 1e-12:
        raise InputError(f"the taper of tabs is an angle above 0, at most pi/2 (rad), not {shown(taper)}")
    for piece in pieces.pieces:
        if piece.tabs is not None:
            raise InputError(f"piece {piece.name} has tabs already")
    slope = 1 / np.tan(min(taper, STEEPEST_LEG))
    site = FlapFitter(pieces, width, least, pitch, float(slope), float(1 / np.tan(STEEPEST_LEG)))
    longest = max((pieces.run(seam.sides[0]).path.length for seam in pieces.seams), default=0.0)
    if longest > MOST_TEETH * min(pitch, 3 * width):
        raise _tooth_count_error(site, longest / min(pitch, 3 * width))
    flaps = (
        _choose_sides(site, float(taper))
        if style == "one"
        else fit_flaps(site, _propose_flaps(site, style, float(taper)))
    )
    if style == "strips":
        connected, kept = _add_connecting_strips(site, flaps)
        return _measure_coverage(site, kept, 1, connected)
    by_piece: dict[int, list[Flap]] = defaultdict(list)
    for flap in flaps:
        by_piece[pieces.seams[flap.seam].sides[flap.side].piece].append(flap)
    cut, kept = list(pieces.pieces), []
    for k, own in by_piece.items():
        outlines, scores = _merge_flaps(site, k, own, flat=style in ("one", "alternating"))
        if not find_winding_errors(outlines):  # else the piece covers itself without tabs: it is left as it is
            cut[k] = replace(cut[k], tabs=outlines, scores=cut[k].scores + scores)
            kept += own
    sides = 2 if style in ("both", "allowance") else 1
    return _measure_coverage(site, kept, sides, Pieces(tuple(cut), pieces.seams))


def _measure_coverage(site: FlapFitter, flaps: Sequence[Flap], sides: int, pieces: Pieces) -> Tabs:
    """Return the record of what fitted; sides: how many sides of a seam should be full of tabs."""
    count = len(pieces.seams)
    covered, heights = np.zeros(count), np.full(count, np.inf)
    for flap in flaps:
        length = site.path_by_length(pieces.seams[flap.seam].sides[flap.side]).length
        covered[flap.seam] += flap.length / length / sides
        heights[flap.seam] = min(heights[flap.seam], flap.height)
    return Tabs(pieces, covered, np.where(covered > 0, heights, 0.0), site.width)


def _propose_flaps(site: FlapFitter, style: TabStyle, taper: float) -> list[Flap]:
    """Return the flaps that the seams are to have, whether they fit or not."""
    sides = (0,) if style == "strips" else (0, 1)
    flaps: list[Flap] = []
    for k, seam in enumerate(site.pieces.seams):
        if all(site.pieces.run(side).path.length > 0 for side in seam.sides):
            for side in sides:
                flaps += _propose_side_flaps(site, k, side, style, taper)
            if len(flaps) > MOST_TEETH * len(sides):
                raise _tooth_count_error(site, len(flaps) / len(sides) * len(site.pieces.seams) / (k + 1))
    return flaps


def _tooth_count_error(site: FlapFitter, teeth: float) -> InputError:
    return InputError(
        f"tabs of {site.width:g} mm with a pitch of {site.pitch:g} mm would be about {teeth:.0f} teeth, "
        f"more than {MOST_TEETH}: take wider tabs or a longer pitch"
    )


def _choose_sides(site: FlapFitter, taper: float) -> list[Flap]:
    """Return flaps on one side of each seam: on the one where more fits, alone first, then among the others."""
    count = len(site.pieces.seams)
    fitting: tuple[list[list[Flap]], ...] = tuple([[] for _ in range(count)] for _ in range(2))
    for flap in fit_flaps(site, _propose_flaps(site, "one", taper), together=False):
        fitting[flap.side][flap.seam].append(flap)
    alone = np.array([[sum(flap.area for flap in flaps) for flaps in side] for side in fitting]).reshape(2, count)
    side = np.where(alone[1] > 1.01 * alone[0], 1, 0)
    seams = np.arange(count)

    def fit_chosen_sides() -> tuple[list[Flap], Array]:
        flaps = fit_flaps(site, [flap for k in seams for flap in fitting[side[k]][k]])
        areas = np.zeros(count)
        np.add.at(areas, [flap.seam for flap in flaps], [flap.area for flap in flaps])
        return flaps, areas

    flaps, areas = fit_chosen_sides()
    crowded = areas < 0.5 * alone[1 - side, seams]
    if crowded.any():
        side = np.where(crowded, 1 - side, side)
        others, other_areas = fit_chosen_sides()
        if other_areas.sum() > areas.sum():
            return others
    return flaps


@dataclass(frozen=True, slots=True)
class _SeamStretch:
    """A stretch of a seam without corners: stations of the first side, the angles inside either piece at its ends."""

    start: float
    stop: float
    inside: tuple[Array, Array]
    teeth: int


def _split_at_corners(site: FlapFitter, seam: Seam) -> list[_SeamStretch]:
    """Return the stretches of a seam between the corners of either side."""
    tracks = [site.path_by_length(side) for side in seam.sides]
    length = tracks[0].length
    corners: dict[float, Array] = {}  # station of the first side: angles inside the two pieces
    for k, (track, side) in enumerate(zip(tracks, seam.sides, strict=True)):
        sharp = np.flatnonzero(np.abs(track.kink_angles) > TAB_CORNER_ANGLE)
        ends = site.measure_corner_angles(side)
        stations = np.array([0.0, *track.stations[sharp + 1], track.length]) * (length / track.length)
        angles = np.array([ends[0], *(np.pi - track.kink_angles[sharp]), ends[1]])
        if k and seam.opposed:
            stations, angles = length - stations[::-1], angles[::-1]
        for station, angle in zip(stations.tolist(), angles, strict=True):
            near = next((known for known in corners if abs(known - station) < 1e-6 * length), station)
            corners.setdefault(near, np.full(2, np.pi))[k] = angle
    order = sorted(corners)
    return [
        _SeamStretch(
            start,
            stop,
            (np.array([corners[start][0], corners[stop][0]]), np.array([corners[start][1], corners[stop][1]])),
            _count_teeth(site, seam, start, stop),
        )
        for start, stop in pairwise(order)
    ]


def _propose_side_flaps(site: FlapFitter, number: int, side: int, style: TabStyle, taper: float) -> list[Flap]:
    """Return the flaps of one side of a seam."""
    seam = site.pieces.seams[number]
    place, other = seam.sides[side], seam.sides[1 - side]
    length = site.path_by_length(place).length
    outside, beneath = FlapZone(place, True), FlapZone(other, False, back=seam.opposed)
    if style == "allowance":
        around = (2 * np.pi - np.array(site.measure_corner_angles(place))) / 2
        mitre = np.maximum(_compute_cotangent(around), np.where(_find_seam_neighbours(site, place), -MITRE_LIMIT, 0.0))
        ends = (float(mitre[0]), float(mitre[1]))
        return [Flap(number, side, 0.0, length, ends, ends, site.width, (outside,), divisible=False)]
    zones = {"both": (outside,), "strips": (FlapZone(place, False), beneath)}.get(style, (outside, beneath))
    spans = _split_at_corners(site, seam)
    alike = style == "strips" and len(spans) == 1 and _has_same_curve(site, seam)
    flaps: list[Flap] = []
    done = 0
    for span in spans:
        own, their = span.inside[side], span.inside[1 - side]
        around = CORNER_SHARE * (2 * np.pi - own)
        limit = {"both": around, "strips": np.minimum(own, their) / 2}.get(style, np.minimum(around, their / 2))
        limit = np.clip(limit, SHALLOWEST_LEG, np.pi / 2)
        count = span.teeth
        if alike:
            first, last = site.path_by_length(place).path.points[[0, -1]]
            count = 2 if np.linalg.norm(last - first) < 2 * site.width else 1  # the ends of a ring would touch
        if style == "alternating":
            count = max(count, int(np.ceil((span.stop - span.start) / site.pitch - 1e-9)), 3 - len(spans))
        cuts = np.linspace(span.start, span.stop, count + 1).tolist()
        slopes, steepest = np.full((count, 2), site.slope), np.full((count, 2), site.steepest)
        slopes[0, 0], slopes[-1, 1] = _compute_cotangent(np.minimum(taper, limit))
        steepest[0, 0], steepest[-1, 1] = _compute_cotangent(limit)
        for k in range(count):
            if style != "alternating" or (done + k) % 2 == side:
                legs = [(float(each[k, 0]), float(each[k, 1])) for each in (slopes, steepest)]
                flaps.append(Flap(number, side, cuts[k], cuts[k + 1], legs[0], legs[1], site.width, zones))
        done += count
    if side == 0:
        return flaps
    scale = length / site.path_by_length(other).length
    return [_map_to_other_side(flap, scale, length if seam.opposed else None) for flap in flaps]


def _map_to_other_side(flap: Flap, scale: float, length: float | None) -> Flap:
    """Return a flap with its stations on the other side of the seam: scaled, counted back from a length if given."""
    if length is None:
        return replace(flap, start=flap.start * scale, stop=flap.stop * scale)
    return replace(
        flap,
        start=length - flap.stop * scale,
        stop=length - flap.start * scale,
        slopes=flap.slopes[::-1],
        steepest=flap.steepest[::-1],
    )


def _compute_cotangent(angle: Array | float) -> Array:
    return np.asarray(1 / np.tan(angle))


def _find_seam_neighbours(site: FlapFitter, place: Place) -> tuple[bool, bool]:
    """Return whether the runs before and after a run have seams too."""
    loop = [run for run in site.pieces.pieces[place.piece].loops[place.loop] if run.path.length > 0]
    at = loop.index(site.pieces.run(place))
    return loop[at - 1].seam is not None, loop[(at + 1) % len(loop)].seam is not None


def _count_teeth(site: FlapFitter, seam: Seam, start: float, stop: float) -> int:
    """Return into how many teeth a tab is cut between two stations: one if straight in the plane and in space."""
    turn, excess, length = 0.0, 0.0, site.path_by_length(seam.sides[0]).length
    for k, side in enumerate(seam.sides):
        run, track = site.pieces.run(side), site.path_by_length(side)
        ends = np.array([start, stop]) * (track.length / length)
        if k and seam.opposed:
            ends = track.length - ends[::-1]
        stretch = track.clip_between(max(ends[0], 0.0), min(ends[1], track.length))
        turn = max(turn, float(np.abs(PathByLength(stretch).turning_angles).sum()))
        stations = np.append(0.0, np.cumsum(run.path.lengths))
        vertices = np.abs(stations - ends[:, None]).argmin(axis=1)
        chord = float(np.linalg.norm(np.diff(run.space[vertices], axis=0)))
        if np.abs(stations[vertices] - ends).max() < 1e-6 * length and np.isfinite(chord):
            excess = max(excess, stop - start - chord)
    # a bow of height h is longer than its chord by 8 h^2 / 3 chord
    straight = (
        max(turn * (stop - start) / 8, np.sqrt(0.375 * (stop - start) * max(excess, 0.0))) < SAME_CURVE * site.width
    )
    if straight:
        return 1
    shortest = max(1, int((stop - start) / (site.width / 2)))
    return max(int(np.ceil((stop - start) / site.pitch - 1e-9)), min(int(np.ceil(turn / MOST_TOOTH_BEND)), shortest))


def _has_same_curve(site: FlapFitter, seam: Seam) -> bool:
    """Return whether both sides of a seam have the same curve in the plane, so that one strip can follow both."""
    if not seam.opposed:
        return False
    first, second = (site.path_by_length(side) for side in seam.sides)
    part = np.linspace(0.0, 1.0, 65)
    one = first.points_at(part * first.length) @ [1, 1j]
    other = second.points_at((1 - part) * second.length) @ [1, 1j]
    one, other = one - one.mean(), other - other.mean()
    turn = np.vdot(other, one)
    return bool(np.abs(one - other * turn / max(abs(turn), 1e-300)).max() < SAME_CURVE * site.width)


def _merge_flaps(
    site: FlapFitter, number: int, flaps: Sequence[Flap], *, flat: bool
) -> tuple[tuple[Path, ...], tuple[Score, ...]]:
    """Return the outlines of a piece with its flaps, and their base lines; flat: they lie flat under the neighbour."""
    seams = site.pieces.seams
    by_run: dict[Place, list[Flap]] = defaultdict(list)
    for flap in flaps:
        by_run[seams[flap.seam].sides[flap.side]].append(flap)
    outlines, scores = [], []
    for i, loop in enumerate(site.pieces.pieces[number].loops):
        parts: list[Path] = []
        for j, run in enumerate(loop):
            place = Place(number, i, j)
            if place not in by_run:
                parts.append(run.path)
                continue
            track, done = site.path_by_length(place), 0.0
            bases: list[list[float]] = []
            for flap in sorted(by_run[place], key=lambda flap: flap.start):
                if flap.start > done + 1e-9 * track.length:
                    parts.append(track.clip_between(done, flap.start))
                if bases and flap.start <= done + 1e-9 * track.length:
                    bases[-1][1] = flap.stop
                else:
                    bases.append([flap.start, flap.stop])
                parts += _outline_flap(track, flap)
                done = flap.stop
            if done < track.length * (1 - 1e-9):
                parts.append(track.clip_between(done, track.length))
            fold = seams[by_run[place][0].seam].fold if flat else "mountain"
            if fold is not None:
                scores += [Score(track.clip_between(start, stop), fold) for start, stop in bases]
        outline = Path.from_paths(parts)
        points = outline.points.copy()
        points[-1] = points[0]
        outlines.append(_remove_spikes(Path(points, outline.bulges)))
    return tuple(outlines), tuple(scores)


def _outline_flap(track: PathByLength, flap: Flap) -> list[Path]:
    """Return the way around a flap, from the beginning of its base to the end."""
    top = make_flap_top(track, flap.start, flap.stop, flap.slopes, flap.height)
    base = track.clip_between(flap.start, flap.stop).points
    return [
        Path.from_points(np.stack([base[0], top.points[0]])),
        top,
        Path.from_points(np.stack([top.points[-1], base[-1]])),
    ]


def _remove_spikes(path: Path) -> Path:
    """Return a closed path without cuts that go somewhere and straight back, as two legs on one mitre do."""
    points, bulges = list(path.points[:-1]), list(path.bulges)
    size = float(np.ptp(path.points, axis=0).max())
    k = 0
    while k < len(points) and len(points) > 3:
        before, here, after = points[k - 1], points[k], points[(k + 1) % len(points)]
        into, out = here - before, after - here
        straight = bulges[k - 1] == 0 and bulges[k] == 0
        lengths = float(np.linalg.norm(into)), float(np.linalg.norm(out))
        if straight and into @ out < -(1 - 1e-12) * lengths[0] * lengths[1] and min(lengths) > 0:
            if abs(lengths[0] - lengths[1]) <= 1e-9 * size:  # there and back: nothing is left of the two legs
                del points[k], bulges[k]
                gone = k % len(points)
                del points[gone - 1 if gone else -1], bulges[gone - 1 if gone else -1]
            else:
                del points[k], bulges[k]
            k = max(k - 2, 0)
        else:
            k += 1
    return Path(np.array([*points, points[0]]), np.array(bulges))


def _add_connecting_strips(site: FlapFitter, flaps: Sequence[Flap]) -> tuple[Pieces, list[Flap]]:
    """Return the pieces with connecting strips behind them, named after their seams, and the flaps they are made of."""
    pieces, kept = list(site.pieces.pieces), []
    names = {piece.name for piece in pieces}
    by_seam: dict[int, list[Flap]] = defaultdict(list)
    for flap in flaps:
        by_seam[flap.seam].append(flap)
    for number, parts in by_seam.items():
        seam = site.pieces.seams[number]
        track = site.path_by_length(seam.sides[0])
        alike = _has_same_curve(site, seam)
        for k, flap in enumerate(parts):
            name = f"S{seam.label}" + (f".{k + 1}" if len(parts) > 1 else "")
            while name in names:
                name += "+"
            straight = Path.from_points(np.array([[0.0, 0.0], [flap.length, 0.0]]))
            line = track.clip_between(flap.start, flap.stop) if alike else straight
            strip = _make_connecting_strip(name, PathByLength(line), flap, seam.fold)
            if not find_winding_errors(strip.outlines):  # as where the seam is a hairpin
                names.add(name)
                pieces.append(strip)
                kept.append(flap)
    return Pieces(tuple(pieces), site.pieces.seams), kept


def _make_connecting_strip(name: str, line: PathByLength, flap: Flap, fold: Fold | None) -> Piece:
    """Return a connecting strip along a line, as wide on both sides; its places in space are not known."""
    right, left = (make_flap_top(line, 0.0, line.length, flap.slopes, hand * flap.height) for hand in (1.0, -1.0))
    start, stop = line.path.points[0], line.path.points[-1]
    outline = Path.from_paths(
        [
            Path.from_points(np.stack([start, right.points[0]])),
            right,
            Path.from_points(np.stack([right.points[-1], stop, left.points[-1]])),
            left.reversed(),
            Path.from_points(np.stack([left.points[0], start])),
        ]
    )
    run = Run(outline, np.full((len(outline.points), 3), np.nan), "cut")
    return Piece(name, ((run,),), scores=() if fold is None else (Score(line.path, fold),))
