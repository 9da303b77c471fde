"""Flaps: what a tab is before it is drawn, and how flaps are made to fit.

A flap stands on a stretch of a run, between two legs, up to a parallel of the run. It lies in zones: outside its own
piece, where it must not meet the piece or another flap; and underneath the piece it is glued to, where it must lie
inside the outline and not meet another flap. What does not fit is cut into shorter flaps, then lowered, then dropped.
Exists apart from tabs because fitting is the same whatever the style. Must not know styles, scores or strips.
"""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import shapely

from cqblend.patterns.outline.overlap import to_polygon
from cqblend.patterns.outline.parallel_path import PathByLength, signed_angles
from cqblend.patterns.outline.pieces import Pieces, Place
from cqblend.patterns.outline.plane_path import Path
from cqblend.splines.bernstein import Array

LEAST_TOP_RATIO = 0.25
"""Least width of a flap at its top, beside its width at the base."""

LOWERING_RATIO = 0.8
"""Ratio by which a flap that does not fit is lowered."""

CLEARANCE_RATIO = 1e-3
"""Flaps are inset by this, relative to their width, when they are tested: what touches does not overlap."""


@dataclass(frozen=True, slots=True)
class FlapZone:
    """Where a flap lies: along a run, outside its piece or underneath it, its stations counted forwards or back."""

    place: Place
    outside: bool
    back: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Flap:
    """A flap as it is wanted; :meth:`fit_to_base` is what its base has room for.

    Attributes
    ----------
    seam, side
        Index of the seam, and which of its two runs the stations are measured on.
    start, stop
        Stations of the base, mm along the run.
    slopes, steepest
        Cotangents of the legs' angles at start and stop, wanted and least: how far a leg leans in per mm of height.
    height
        Above the base, mm.
    zones
        Where it lies.
    divisible
        Whether it may be cut into shorter flaps.
    """

    seam: int
    side: int
    start: float
    stop: float
    slopes: tuple[float, float]
    steepest: tuple[float, float]
    height: float
    zones: tuple[FlapZone, ...]
    divisible: bool = True

    @property
    def length(self) -> float:
        """Length of the base."""
        return self.stop - self.start

    @property
    def area(self) -> float:
        """Area, as on a straight base."""
        return self.height * (self.length - self.height * sum(self.slopes) / 2)

    def fit_to_base(self) -> "Flap":
        """Return the flap with legs so steep, then with a height so low, that its crest is wide enough."""
        wanted, least = sum(self.slopes), sum(self.steepest)
        room = (1 - LEAST_TOP_RATIO) * self.length
        if self.height * wanted <= room:
            return self
        if self.height * least >= room:
            return replace(self, slopes=self.steepest, height=room / least)
        part = (room / self.height - least) / (wanted - least)
        first, second = (a + part * (b - a) for a, b in zip(self.steepest, self.slopes, strict=True))
        return replace(self, slopes=(first, second))


def make_flap_top(track: PathByLength, start: float, stop: float, slopes: tuple[float, float], height: float) -> Path:
    """Return the top of a flap with its base between two stations: on the right of its run, or left if negative.

    The slopes are the cotangents of its legs. Where one is negative the flap is wider at its top than at its base.
    """
    first, last = measure_leg_insets(
        track, np.array(start), np.array(stop), np.array(slopes), np.array(height)
    ).tolist()
    top = track.offset_curve(start + max(first, 0.0), stop - max(last, 0.0), height)
    points, bulges = [top.points], [top.bulges]
    ahead = PathByLength(top).directions
    if first < 0:
        points.insert(0, top.points[:1] + first * ahead[0, :1])
        bulges.insert(0, np.zeros(1))
    if last < 0:
        points.append(top.points[-1:] - last * ahead[1, -1:])
        bulges.append(np.zeros(1))
    return Path(np.concatenate(points), np.concatenate(bulges))


def measure_leg_insets(track: PathByLength, start: Array, stop: Array, slopes: Array, height: Array) -> Array:
    """Return how far along their bases the legs of flaps (...) lean in, (..., 2), so that they are straight.

    Where the base is an arc that bends away from the flap with the curvature k, the parallel's radius is 1 / k + h, and
    the leg meets it at the angle f about the centre for which (1 / k + h) sin(f) = slope ((1 / k + h) cos(f) - 1 / k).
    On a base that is too short for both legs they are steeper.
    """
    high, half = np.abs(height)[..., None], (stop - start)[..., None] / 2
    reach = np.clip(slopes * high, 0.0, half)
    bend = np.stack(
        [track.mean_curvature(start, start + reach[..., 0]), track.mean_curvature(stop - reach[..., 1], stop)], axis=-1
    )
    bend = bend * np.sign(height)[..., None]
    arched = (np.abs(bend * high) > 1e-6) & (slopes > 0)
    angle = np.arctan(slopes)
    sine = np.sin(angle) / np.maximum(1 + bend * high, 1e-12)
    lean = np.where(arched, (angle - np.arcsin(np.clip(sine, -1.0, 1.0))) / np.where(arched, bend, 1.0), slopes * high)
    inwards = np.maximum(lean, 0.0).sum(axis=-1, keepdims=True)
    return np.where(lean > 0, lean * np.minimum(1.0, 1.95 * half / np.maximum(inwards, 1e-300)), lean)


@dataclass(frozen=True)
class FlapFitter:
    """The pieces to which flaps are fitted, and the measures that the flaps keep.

    Attributes
    ----------
    pieces
        The pieces, without tabs.
    width
        Height of flaps where there is room, mm.
    least
        Height below which they are dropped, mm.
    pitch
        Length to which they are cut, mm.
    slope, steepest
        Cotangents of the legs' angles between flaps of one run, wanted and least.
    """

    pieces: Pieces
    width: float
    least: float
    pitch: float
    slope: float
    steepest: float
    _tracks: dict[Place, PathByLength] = field(default_factory=dict)
    _marks: dict[Place, tuple[Array, Array, Array]] = field(default_factory=dict)
    _regions: dict[int, Any] = field(default_factory=dict)
    _shapes: dict[tuple[Flap, FlapZone], Any] = field(default_factory=dict)

    @property
    def clearance(self) -> float:
        """By how much flaps are inset when they are tested, mm."""
        return CLEARANCE_RATIO * self.width

    def path_by_length(self, place: Place) -> PathByLength:
        """Return the track of a run."""
        if place not in self._tracks:
            self._tracks[place] = PathByLength.from_path(self.pieces.run(place).path)
        return self._tracks[place]

    def offset_samples(self, place: Place) -> tuple[Array, Array, Array]:
        """Return the marks of a run, from which the edges of flaps are sampled."""
        if place not in self._marks:
            self._marks[place] = self.path_by_length(place).sample_for_offsets(self.clearance / 4, self.width)
        return self._marks[place]

    def piece_polygon(self, piece: int) -> Any:
        """Return the polygon of a piece."""
        if piece not in self._regions:
            self._regions[piece] = to_polygon(self.pieces.pieces[piece].outlines, self.clearance / 4)
            shapely.prepare(self._regions[piece])
        return self._regions[piece]

    def measure_corner_angles(self, place: Place) -> tuple[float, float]:
        """Return the angles inside a piece (0 to 2 pi) at the beginning and at the end of a run."""
        loop = self.pieces.pieces[place.piece].loops[place.loop]
        real = [k for k, run in enumerate(loop) if run.path.length > 0]
        at = real.index(place.run)
        before, behind = (self.path_by_length(replace(place, run=real[k % len(real)])) for k in (at - 1, at + 1))
        own = self.path_by_length(place)
        first = signed_angles(before.directions[1, -1], own.directions[0, 0])
        last = signed_angles(own.directions[1, -1], behind.directions[0, 0])
        return float(np.pi - first), float(np.pi - last)

    def build_polygons(self, flaps: Iterable[Flap]) -> None:
        """Make the polygons of trimmed flaps in their zones, a little inset, as far as they are not known."""
        unknown: dict[Place, list[tuple[Flap, FlapZone]]] = defaultdict(list)
        for flap in flaps:
            for zone in flap.zones:
                if (flap, zone) not in self._shapes:
                    unknown[zone.place].append((flap, zone))
        for place, members in unknown.items():
            self._shapes.update(zip(members, self._make_polygons(place, members), strict=True))

    def flap_polygon(self, flap: Flap, zone: FlapZone) -> Any:
        """Return the polygon of a trimmed flap in a zone, a little inset."""
        return self._shapes[flap, zone]

    def _make_polygons(self, place: Place, members: list[tuple[Flap, FlapZone]]) -> Any:
        """Return the polygons of flaps along one run: their edges sampled within a part of the clearance."""
        track = self.path_by_length(place)
        lengths = np.array(
            [self.path_by_length(self.pieces.seams[flap.seam].sides[flap.side]).length for flap, _ in members]
        )
        span = np.array([(flap.start, flap.stop) for flap, _ in members]) * (track.length / lengths)[:, None]
        slopes = np.array([flap.slopes for flap, _ in members])
        back = np.array([zone.back for _, zone in members])[:, None]
        span, slopes = np.where(back, track.length - span[:, ::-1], span), np.where(back, slopes[:, ::-1], slopes)
        height = np.array([flap.height for flap, _ in members])
        hand = np.array([1.0 if zone.outside else -1.0 for _, zone in members])
        inset = np.minimum(self.clearance, 0.1 * LEAST_TOP_RATIO * (span[:, 1] - span[:, 0]))
        # the lower and the upper edge of each flap, one after another
        hands, start, stop = np.repeat(hand, 2), np.repeat(span[:, 0] + inset, 2), np.repeat(span[:, 1] - inset, 2)
        level = hands * np.stack([np.minimum(inset, height / 2), height], axis=1).ravel()
        lean = measure_leg_insets(track, start, stop, np.repeat(slopes, 2, axis=0), level)
        first, last = start + np.maximum(lean[:, 0], 0.0), stop - np.maximum(lean[:, 1], 0.0)
        stations, points, outwards = self.offset_samples(place)
        # each edge: its first point, the marks inside, its last point; forth below, back above
        begin, end = np.searchsorted(stations, first, side="right"), np.searchsorted(stations, last, side="left")
        counts = np.maximum(end - begin, 0) + 2
        edge = np.repeat(np.arange(len(counts)), counts)
        along = np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)
        along = np.where(edge % 2 == 0, along, counts[edge] - 1 - along)
        mark = np.clip(begin[edge] + along - 1, 0, len(stations) - 1)
        base, right = points[mark], outwards[mark]
        for which, station, overhang in (
            (along == 0, first, np.minimum(lean[:, 0], 0.0)),
            (along == counts[edge] - 1, last, -np.minimum(lean[:, 1], 0.0)),
        ):
            own = edge[which]
            ahead = track.tangents_at(station[own])
            base[which] = track.points_at(station[own]) + overhang[own, None] * ahead
            right[which] = np.stack([ahead[:, 1], -ahead[:, 0]], axis=1)
        return shapely.polygons(shapely.linearrings(base + level[edge, None] * right, indices=edge // 2))

    def reduce_flap(self, flap: Flap) -> list[Flap]:
        """Return what a flap that does not fit is replaced by: shorter ones, a lower one, or nothing."""
        count = int(np.ceil(flap.length / self.pitch))
        if not flap.divisible or flap.length < 1.5 * self.pitch:
            lower = LOWERING_RATIO * flap.fit_to_base().height
            return [replace(flap, height=lower)] if lower >= self.least else []
        cuts = np.linspace(flap.start, flap.stop, count + 1)
        slopes = [flap.slopes[0], *[self.slope] * (2 * count - 2), flap.slopes[1]]
        steepest = [flap.steepest[0], *[self.steepest] * (2 * count - 2), flap.steepest[1]]
        return [
            replace(
                flap,
                start=float(cuts[k]),
                stop=float(cuts[k + 1]),
                slopes=(slopes[2 * k], slopes[2 * k + 1]),
                steepest=(steepest[2 * k], steepest[2 * k + 1]),
            )
            for k in range(count)
        ]


def fit_flaps(site: FlapFitter, flaps: Iterable[Flap], *, together: bool = True) -> list[Flap]:
    """Return flaps made to fit their pieces and, unless each is to be seen on its own, each other; trimmed."""
    fitting: dict[Flap, dict[FlapZone, Any]] = {}
    waiting = list(flaps)
    while waiting:
        fitting.update(_fit_to_pieces(site, waiting))
        bad = _find_colliding(fitting) if together else []
        waiting = [smaller for flap in bad for smaller in site.reduce_flap(flap)]
        for flap in bad:
            del fitting[flap]
    return sorted((flap.fit_to_base() for flap in fitting), key=lambda flap: (flap.seam, flap.side, flap.start))


def _fit_to_pieces(site: FlapFitter, waiting: list[Flap]) -> dict[Flap, dict[FlapZone, Any]]:
    """Return flaps that fit their pieces, and their polygons in each of their zones."""
    fitting: dict[Flap, dict[FlapZone, Any]] = {}
    while waiting:
        bad, able = [], []
        for flap in waiting:
            trimmed = flap.fit_to_base()
            if trimmed.height < 0.5 * flap.height and flap.divisible and flap.length >= 1.5 * site.pitch:
                bad.append(flap)
            elif trimmed.height >= site.least:
                able.append((flap, trimmed))
        site.build_polygons(trimmed for _, trimmed in able)
        unfit = _find_unfit(site, [trimmed for _, trimmed in able])
        bad += [flap for flap, trimmed in able if trimmed in unfit]
        fitting |= {
            flap: {zone: site.flap_polygon(trimmed, zone) for zone in flap.zones}
            for flap, trimmed in able
            if trimmed not in unfit
        }
        waiting = [smaller for flap in bad for smaller in site.reduce_flap(flap)]
    return fitting


def _find_unfit(site: FlapFitter, flaps: list[Flap]) -> set[Flap]:
    """Return the flaps of which a polygon is not sound, or meets its piece, or is not inside the one that covers it."""
    zones: dict[tuple[int, bool], list[Flap]] = defaultdict(list)
    polygons: dict[tuple[int, bool], list[Any]] = defaultdict(list)
    for flap in flaps:
        for zone in flap.zones:
            key = zone.place.piece, zone.outside
            zones[key].append(flap)
            polygons[key].append(site.flap_polygon(flap, zone))
    unfit: set[Flap] = set()
    for (piece, outside), members in zones.items():
        shapes = np.array(polygons[piece, outside])
        region = site.piece_polygon(piece)
        fits = ~shapely.intersects(region, shapes) if outside else shapely.contains(region, shapes)
        fits &= shapely.is_valid(shapes)
        unfit.update(flap for flap, good in zip(members, fits, strict=True) if not good)
    return unfit


def _find_colliding(fitting: dict[Flap, dict[FlapZone, Any]]) -> list[Flap]:
    """Return the flaps that have to give way: the higher one of each two that meet, both if they are alike."""
    zones: dict[tuple[int, bool], list[tuple[Flap, Any]]] = defaultdict(list)
    for flap, shapes in fitting.items():
        for zone, shape in shapes.items():
            zones[zone.place.piece, zone.outside].append((flap, shape))
    yielding: dict[Flap, None] = {}
    for members in zones.values():
        polygons = [shape for _, shape in members]
        first, second = shapely.STRtree(polygons).query(polygons, predicate="intersects")
        for i, j in zip(first[first < second], second[first < second], strict=True):
            one, other = members[i][0], members[j][0]
            heights = one.fit_to_base().height, other.fit_to_base().height
            if heights[0] >= 0.99 * heights[1]:
                yielding[one] = None
            if heights[1] >= 0.99 * heights[0]:
                yielding[other] = None
    return list(yielding)
