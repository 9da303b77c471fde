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

from cqblend.developables.overlap import region
from cqblend.developables.parallels import Track, between
from cqblend.developables.paths import Path
from cqblend.developables.pieces import Pieces, Place
from cqblend.splines.bernstein import Array

CREST = 0.25
"""Least width of a flap at its top, beside its width at the base."""

LOWER = 0.8
"""Ratio by which a flap that does not fit is lowered."""

CLEARANCE = 1e-3
"""Flaps are inset by this, relative to their width, when they are tested: what touches does not overlap."""


@dataclass(frozen=True, slots=True)
class Zone:
    """Where a flap lies: along a run, outside its piece or underneath it, its stations counted forwards or back."""

    place: Place
    outside: bool
    back: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Flap:
    """A flap as it is wanted; :meth:`trimmed` is what its base has room for.

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
    zones: tuple[Zone, ...]
    divisible: bool = True

    @property
    def length(self) -> float:
        """Length of the base."""
        return self.stop - self.start

    @property
    def area(self) -> float:
        """Area, as on a straight base."""
        return self.height * (self.length - self.height * sum(self.slopes) / 2)

    def trimmed(self) -> "Flap":
        """Return the flap with legs so steep, then with a height so low, that its crest is wide enough."""
        wanted, least = sum(self.slopes), sum(self.steepest)
        room = (1 - CREST) * self.length
        if self.height * wanted <= room:
            return self
        if self.height * least >= room:
            return replace(self, slopes=self.steepest, height=room / least)
        part = (room / self.height - least) / (wanted - least)
        first, second = (a + part * (b - a) for a, b in zip(self.steepest, self.slopes, strict=True))
        return replace(self, slopes=(first, second))


def crest(track: Track, start: float, stop: float, slopes: tuple[float, float], height: float) -> Path:
    """Return the top of a flap with its base between two stations: on the right of its run, or left if negative.

    The slopes are the cotangents of its legs. Where one is negative the flap is wider at its top than at its base.
    """
    half = (stop - start) / 2
    reach = [min(max(slope, 0.0) * abs(height), half) for slope in slopes]
    bends = track.bend(start, start + reach[0]), track.bend(stop - reach[1], stop)
    first, last = (_lean(slope, abs(height), np.sign(height) * bend) for slope, bend in zip(slopes, bends, strict=True))
    inwards = max(first, 0.0) + max(last, 0.0)
    shrink = min(1.0, 1.95 * half / inwards) if inwards > 0 else 1.0  # the base was too short: the legs are steeper
    top = track.parallel(start + shrink * max(first, 0.0), stop - shrink * max(last, 0.0), height)
    points, bulges = [top.points], [top.bulges]
    ahead = Track(top).directions
    if first < 0:
        points.insert(0, top.points[:1] + first * ahead[0, :1])
        bulges.insert(0, np.zeros(1))
    if last < 0:
        points.append(top.points[-1:] - last * ahead[1, -1:])
        bulges.append(np.zeros(1))
    return Path(np.concatenate(points), np.concatenate(bulges))


def _lean(slope: float, height: float, bend: float) -> float:
    """Return how far along its base a leg leans in at a height, so that it is straight where the base is an arc.

    The base bends away from the flap with the curvature `bend`, so that the parallel's radius is 1 / bend + height. The
    leg meets it at the angle f about the centre, where (1 / bend + height) sin(f) = slope ((1 / bend + height) cos(f) -
    1 / bend).
    """
    if slope <= 0 or abs(bend * height) < 1e-6:
        return slope * height
    angle = np.arctan(slope)
    return float((angle - np.arcsin(np.clip(np.sin(angle) / (1 + bend * height), 0.0, 1.0))) / bend)


@dataclass(frozen=True)
class Site:
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
    _tracks: dict[Place, Track] = field(default_factory=dict)
    _regions: dict[int, Any] = field(default_factory=dict)
    _shapes: dict[tuple[Flap, Zone], Any] = field(default_factory=dict)

    @property
    def clearance(self) -> float:
        """By how much flaps are inset when they are tested, mm."""
        return CLEARANCE * self.width

    def track(self, place: Place) -> Track:
        """Return the track of a run."""
        if place not in self._tracks:
            self._tracks[place] = Track.of(self.pieces.run(place).path)
        return self._tracks[place]

    def region(self, piece: int) -> Any:
        """Return the polygon of a piece."""
        if piece not in self._regions:
            self._regions[piece] = region(self.pieces.pieces[piece].outlines, self.clearance / 4)
            shapely.prepare(self._regions[piece])
        return self._regions[piece]

    def corners(self, place: Place) -> tuple[float, float]:
        """Return the angles inside a piece (0 to 2 pi) at the beginning and at the end of a run."""
        loop = self.pieces.pieces[place.piece].loops[place.loop]
        real = [k for k, run in enumerate(loop) if run.path.length > 0]
        at = real.index(place.run)
        before, behind = (self.track(replace(place, run=real[k % len(real)])) for k in (at - 1, at + 1))
        own = self.track(place)
        first = between(before.directions[1, -1], own.directions[0, 0])
        last = between(own.directions[1, -1], behind.directions[0, 0])
        return float(np.pi - first), float(np.pi - last)

    def shape(self, flap: Flap, zone: Zone) -> Any:
        """Return the polygon of a trimmed flap in a zone, a little inset."""
        if (flap, zone) not in self._shapes:
            self._shapes[flap, zone] = shapely.Polygon(self._outline(flap, zone))
        return self._shapes[flap, zone]

    def _outline(self, flap: Flap, zone: Zone) -> Array:
        track = self.track(zone.place)
        scale = track.length / self.track(self.pieces.seams[flap.seam].sides[flap.side]).length
        start, stop, slopes = flap.start * scale, flap.stop * scale, flap.slopes
        if zone.back:
            start, stop, slopes = track.length - stop, track.length - start, (slopes[1], slopes[0])
        inset = min(self.clearance, 0.1 * CREST * flap.length)
        hand = 1.0 if zone.outside else -1.0
        low, high = (
            crest(track, start + inset, stop - inset, slopes, hand * height)
            for height in (min(inset, flap.height / 2), flap.height)
        )
        edges = [path.sampled(self.clearance / 4) if path.bulges.any() else path.points for path in (low, high)]
        return np.concatenate([edges[0], edges[1][::-1]])

    def smaller(self, flap: Flap) -> list[Flap]:
        """Return what a flap that does not fit is replaced by: shorter ones, a lower one, or nothing."""
        count = int(np.ceil(flap.length / self.pitch))
        if not flap.divisible or flap.length < 1.5 * self.pitch:
            lower = LOWER * flap.trimmed().height
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


def settled(site: Site, flaps: Iterable[Flap], *, together: bool = True) -> list[Flap]:
    """Return flaps made to fit their pieces and, unless each is to be seen on its own, each other; trimmed."""
    fitting: dict[Flap, dict[Zone, Any]] = {}
    waiting = list(flaps)
    while waiting:
        fitting.update(_alone(site, waiting))
        bad = _colliding(fitting) if together else []
        waiting = [smaller for flap in bad for smaller in site.smaller(flap)]
        for flap in bad:
            del fitting[flap]
    return sorted((flap.trimmed() for flap in fitting), key=lambda flap: (flap.seam, flap.side, flap.start))


def _alone(site: Site, waiting: list[Flap]) -> dict[Flap, dict[Zone, Any]]:
    """Return flaps that fit their pieces, and their polygons in each of their zones."""
    fitting: dict[Flap, dict[Zone, Any]] = {}
    while waiting:
        bad = []
        for flap in waiting:
            trimmed = flap.trimmed()
            if trimmed.height < 0.5 * flap.height and flap.divisible and flap.length >= 1.5 * site.pitch:
                bad.append(flap)
            elif trimmed.height >= site.least:
                shapes = {zone: site.shape(trimmed, zone) for zone in flap.zones}
                if all(_fits(site, zone, shape) for zone, shape in shapes.items()):
                    fitting[flap] = shapes
                else:
                    bad.append(flap)
        waiting = [smaller for flap in bad for smaller in site.smaller(flap)]
    return fitting


def _fits(site: Site, zone: Zone, shape: Any) -> bool:
    """Return whether a flap's polygon is sound, and outside its piece or inside the piece that covers it."""
    if not shape.is_valid:
        return False
    piece = site.region(zone.place.piece)
    return not piece.intersects(shape) if zone.outside else piece.contains(shape)


def _colliding(fitting: dict[Flap, dict[Zone, Any]]) -> list[Flap]:
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
            heights = one.trimmed().height, other.trimmed().height
            if heights[0] >= 0.99 * heights[1]:
                yielding[one] = None
            if heights[1] >= 0.99 * heights[0]:
                yielding[other] = None
    return list(yielding)
