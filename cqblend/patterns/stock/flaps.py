"""Flaps: the shapes of tabs before they are joined to their pieces, and how they are made to fit.

A flap has a stretch of a run as its base, two straight legs, and a top that is an offset curve of the run. It lies in
zones: outside its own piece, where it must not meet the piece or another flap; and underneath the piece it is glued to,
where it must lie inside the outline and not meet another flap. A flap that does not fit is cut into shorter ones, then
lowered, then dropped. The same for all styles of tabs. Depends on outlines, and on the options of tabs for sizes.
"""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import shapely

from cqblend.patterns.outline.overlap import to_polygon
from cqblend.patterns.outline.path_by_length import PathByLength, signed_angles
from cqblend.patterns.outline.pieces import Pieces, Place
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.stock.stock_proportions import TAB_LIMITS
from cqblend.patterns.stock.tab_options import TabOptions
from cqblend.splines.bernstein import Array


@dataclass(frozen=True, slots=True)
class FlapZone:
    """Where a flap lies.

    Attributes
    ----------
    place
        Address of the run that it lies along.
    outside
        Whether it is outside of the run's piece; else underneath it.
    from_end
        Whether the flap's stations are counted from the end of this run.
    """

    place: Place
    outside: bool
    from_end: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Flap:
    """A flap as it is wanted; :meth:`fit_to_base` returns the one that its base has room for.

    Attributes
    ----------
    seam, side
        Index of the seam, and which of its two runs the stations are measured on.
    start, stop
        Stations of the base, mm along the run.
    cotangents, least_cotangents
        Of the angles of the legs at start and stop: how far a leg leans inwards per mm of height, wanted and at least.
    height
        Above the base, mm.
    zones
        In which it has to fit.
    divisible
        Whether it may be cut into shorter flaps.
    """

    seam: int
    side: int
    start: float
    stop: float
    cotangents: tuple[float, float]
    least_cotangents: tuple[float, float]
    height: float
    zones: tuple[FlapZone, ...]
    divisible: bool = True

    @property
    def length(self) -> float:
        """Length of the base, mm."""
        return self.stop - self.start

    @property
    def area(self) -> float:
        """Area as on a straight base, mm^2."""
        return self.height * (self.length - self.height * sum(self.cotangents) / 2)

    def fit_to_base(self) -> "Flap":
        """Return the flap with steeper legs if need be, then lower, so that its top is wide enough."""
        wanted, least = sum(self.cotangents), sum(self.least_cotangents)
        room = (1 - TAB_LIMITS.least_top_ratio) * self.length
        if self.height * wanted <= room:
            return self
        if self.height * least >= room:
            return replace(self, cotangents=self.least_cotangents, height=room / least)
        part = (room / self.height - least) / (wanted - least)
        first, second = (a + part * (b - a) for a, b in zip(self.least_cotangents, self.cotangents, strict=True))
        return replace(self, cotangents=(first, second))


def make_flap_top(
    path: PathByLength, start: float, stop: float, cotangents: tuple[float, float], height: float
) -> Path:
    """Return the top of a flap on a path, between two stations: on the right of the path, or left if negative.

    Where the cotangent of a leg is negative the flap is wider at its top than at its base.
    """
    first, last = measure_leg_insets(
        path, np.array(start), np.array(stop), np.array(cotangents), np.array(height)
    ).tolist()
    top = path.offset_curve(start + max(first, 0.0), stop - max(last, 0.0), height)
    points, bulges = [top.points], [top.bulges]
    directions = PathByLength(top).directions
    if first < 0:
        points.insert(0, top.points[:1] + first * directions[0, :1])
        bulges.insert(0, np.zeros(1))
    if last < 0:
        points.append(top.points[-1:] - last * directions[1, -1:])
        bulges.append(np.zeros(1))
    return Path(np.concatenate(points), np.concatenate(bulges))


def measure_leg_insets(path: PathByLength, start: Array, stop: Array, cotangents: Array, height: Array) -> Array:
    """Return by how much tops of flaps begin after, and end before, their bases: (..., 2), mm along the base.

    Flaps are (...), cotangents (..., 2). Where the base is an arc that bends away from the flap with the curvature k,
    the radius of its top is 1 / k + h. A straight leg with the cotangent c meets it at the angle f about the centre for
    which (1 / k + h) sin(f) = c ((1 / k + h) cos(f) - 1 / k); the inset is f / k. On a base that is too short for both
    legs they are steeper.
    """
    high, half = np.abs(height)[..., None], (stop - start)[..., None] / 2
    reach = np.clip(cotangents * high, 0.0, half)
    curvature = np.stack(
        [path.mean_curvature(start, start + reach[..., 0]), path.mean_curvature(stop - reach[..., 1], stop)], axis=-1
    )
    curvature = curvature * np.sign(height)[..., None]
    curved = (np.abs(curvature * high) > 1e-6) & (cotangents > 0)
    angle = np.arctan(cotangents)
    sine = np.sin(angle) / np.maximum(1 + curvature * high, 1e-12)
    on_arc = (angle - np.arcsin(np.clip(sine, -1.0, 1.0))) / np.where(curved, curvature, 1.0)
    inset = np.where(curved, on_arc, cotangents * high)
    inwards = np.maximum(inset, 0.0).sum(axis=-1, keepdims=True)
    return np.where(inset > 0, inset * np.minimum(1.0, 1.95 * half / np.maximum(inwards, 1e-300)), inset)


@dataclass(frozen=True)
class FlapFitter:
    """The pieces to which flaps are fitted, with what is computed once for each run, piece and flap.

    Attributes
    ----------
    pieces
        Without tabs.
    options
        Of the tabs: width, least height, length of teeth and taper.
    """

    pieces: Pieces
    options: TabOptions
    _paths: dict[Place, PathByLength] = field(default_factory=dict)
    _offset_samples: dict[Place, tuple[Array, Array, Array]] = field(default_factory=dict)
    _piece_polygons: dict[int, Any] = field(default_factory=dict)
    _flap_polygons: dict[tuple[Flap, FlapZone], Any] = field(default_factory=dict)

    @property
    def inset(self) -> float:
        """By how much flaps are inset when they are tested, mm."""
        return TAB_LIMITS.inset_ratio * self.options.width

    def path_by_length(self, place: Place) -> PathByLength:
        """Return the path of a run by its length."""
        if place not in self._paths:
            self._paths[place] = PathByLength.from_path(self.pieces.run(place).path)
        return self._paths[place]

    def offset_samples(self, place: Place) -> tuple[Array, Array, Array]:
        """Return stations, points and offset directions of a run, from which bases and tops of flaps are sampled."""
        if place not in self._offset_samples:
            path = self.path_by_length(place)
            self._offset_samples[place] = path.sample_for_offsets(self.inset / 4, self.options.width)
        return self._offset_samples[place]

    def piece_polygon(self, piece: int) -> Any:
        """Return the polygon of a piece."""
        if piece not in self._piece_polygons:
            self._piece_polygons[piece] = to_polygon(self.pieces.pieces[piece].outlines, self.inset / 4)
            shapely.prepare(self._piece_polygons[piece])
        return self._piece_polygons[piece]

    def measure_corner_angles(self, place: Place) -> tuple[float, float]:
        """Return the angles inside a piece (rad, 0 to 2 pi) at the beginning and at the end of a run."""
        loop = self.pieces.pieces[place.piece].loops[place.loop]
        extended = [k for k, run in enumerate(loop) if run.path.length > 0]
        at = extended.index(place.run)
        before, after = (self.path_by_length(replace(place, run=extended[k % len(extended)])) for k in (at - 1, at + 1))
        own = self.path_by_length(place)
        first = signed_angles(before.directions[1, -1], own.directions[0, 0])
        last = signed_angles(own.directions[1, -1], after.directions[0, 0])
        return float(np.pi - first), float(np.pi - last)

    def build_polygons(self, flaps: Iterable[Flap]) -> None:
        """Make the polygons of flaps in their zones, a little inset, as far as they are not known."""
        unknown: dict[Place, list[tuple[Flap, FlapZone]]] = defaultdict(list)
        for flap in flaps:
            for zone in flap.zones:
                if (flap, zone) not in self._flap_polygons:
                    unknown[zone.place].append((flap, zone))
        for place, members in unknown.items():
            self._flap_polygons.update(zip(members, self._make_polygons(place, members), strict=True))

    def flap_polygon(self, flap: Flap, zone: FlapZone) -> Any:
        """Return the polygon of a flap in a zone, a little inset."""
        return self._flap_polygons[flap, zone]

    def _make_polygons(self, place: Place, members: list[tuple[Flap, FlapZone]]) -> Any:
        """Return the polygons of flaps along one run: bases and tops are sampled within a quarter of the inset."""
        path = self.path_by_length(place)
        lengths = np.array(
            [self.path_by_length(self.pieces.seams[flap.seam].sides[flap.side]).length for flap, _ in members]
        )
        span = np.array([(flap.start, flap.stop) for flap, _ in members]) * (path.length / lengths)[:, None]
        cotangents = np.array([flap.cotangents for flap, _ in members])
        from_end = np.array([zone.from_end for _, zone in members])[:, None]
        span = np.where(from_end, path.length - span[:, ::-1], span)
        cotangents = np.where(from_end, cotangents[:, ::-1], cotangents)
        height = np.array([flap.height for flap, _ in members])
        sign = np.array([1.0 if zone.outside else -1.0 for _, zone in members])  # right of the run is outside
        inset = np.minimum(self.inset, 0.1 * TAB_LIMITS.least_top_ratio * (span[:, 1] - span[:, 0]))
        # base and top of each flap, one after another
        signs, start, stop = np.repeat(sign, 2), np.repeat(span[:, 0] + inset, 2), np.repeat(span[:, 1] - inset, 2)
        level = signs * np.stack([np.minimum(inset, height / 2), height], axis=1).ravel()
        leg_inset = measure_leg_insets(path, start, stop, np.repeat(cotangents, 2, axis=0), level)
        first, last = start + np.maximum(leg_inset[:, 0], 0.0), stop - np.maximum(leg_inset[:, 1], 0.0)
        stations, points, offset_directions = self.offset_samples(place)
        # the vertices of each: its first point, the samples inside, its last point; bases forwards, tops backwards
        begin, end = np.searchsorted(stations, first, side="right"), np.searchsorted(stations, last, side="left")
        counts = np.maximum(end - begin, 0) + 2
        edge = np.repeat(np.arange(len(counts)), counts)
        vertex = np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)
        vertex = np.where(edge % 2 == 0, vertex, counts[edge] - 1 - vertex)
        sample = np.clip(begin[edge] + vertex - 1, 0, len(stations) - 1)
        base, right = points[sample], offset_directions[sample]
        for chosen, station, overhang in (
            (vertex == 0, first, np.minimum(leg_inset[:, 0], 0.0)),
            (vertex == counts[edge] - 1, last, -np.minimum(leg_inset[:, 1], 0.0)),
        ):
            own = edge[chosen]
            tangent = path.tangents_at(station[own])
            base[chosen] = path.points_at(station[own]) + overhang[own, None] * tangent
            right[chosen] = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1)
        return shapely.polygons(shapely.linearrings(base + level[edge, None] * right, indices=edge // 2))

    def reduce_flap(self, flap: Flap) -> list[Flap]:
        """Return the flaps that replace one that does not fit: shorter ones, a lower one, or none."""
        if not self.is_divisible(flap):
            lower = TAB_LIMITS.lowering_ratio * flap.fit_to_base().height
            return [replace(flap, height=lower)] if lower >= self.options.least_height else []
        count = int(np.ceil(flap.length / self.options.tooth_length))
        cuts = np.linspace(flap.start, flap.stop, count + 1)
        inner, least_inner = ([cotangent] * (2 * count - 2) for cotangent in self.tooth_cotangents)
        wanted = [flap.cotangents[0], *inner, flap.cotangents[1]]
        least = [flap.least_cotangents[0], *least_inner, flap.least_cotangents[1]]
        return [
            replace(
                flap,
                start=float(cuts[k]),
                stop=float(cuts[k + 1]),
                cotangents=(wanted[2 * k], wanted[2 * k + 1]),
                least_cotangents=(least[2 * k], least[2 * k + 1]),
            )
            for k in range(count)
        ]

    def is_divisible(self, flap: Flap) -> bool:
        """Return whether a flap may be cut into shorter ones, and is long enough for that."""
        return flap.divisible and flap.length >= 1.5 * self.options.tooth_length

    @property
    def tooth_cotangents(self) -> tuple[float, float]:
        """Cotangents of the angles of legs between flaps of one run, wanted and least."""
        return self.options.leg_cotangent, float(1 / np.tan(TAB_LIMITS.steepest_leg))


def fit_flaps(fitter: FlapFitter, flaps: Iterable[Flap], *, together: bool = True) -> list[Flap]:
    """Return flaps reduced until they fit their pieces and, if `together`, do not meet each other."""
    fitting: dict[Flap, dict[FlapZone, Any]] = {}
    waiting = list(flaps)
    while waiting:
        fitting.update(_fit_to_pieces(fitter, waiting))
        colliding = _find_colliding(fitting) if together else []
        waiting = [smaller for flap in colliding for smaller in fitter.reduce_flap(flap)]
        for flap in colliding:
            del fitting[flap]
    return sorted((flap.fit_to_base() for flap in fitting), key=lambda flap: (flap.seam, flap.side, flap.start))


def _fit_to_pieces(fitter: FlapFitter, waiting: list[Flap]) -> dict[Flap, dict[FlapZone, Any]]:
    """Return flaps reduced until they fit their pieces, with their polygons in each of their zones."""
    fitting: dict[Flap, dict[FlapZone, Any]] = {}
    while waiting:
        rejected, candidates = [], []
        for flap in waiting:
            fitted = flap.fit_to_base()
            if fitted.height < 0.5 * flap.height and fitter.is_divisible(flap):
                rejected.append(flap)
            elif fitted.height >= fitter.options.least_height:
                candidates.append((flap, fitted))
        fitter.build_polygons(fitted for _, fitted in candidates)
        unfit = _find_unfit(fitter, [fitted for _, fitted in candidates])
        rejected += [flap for flap, fitted in candidates if fitted in unfit]
        fitting |= {
            flap: {zone: fitter.flap_polygon(fitted, zone) for zone in flap.zones}
            for flap, fitted in candidates
            if fitted not in unfit
        }
        waiting = [smaller for flap in rejected for smaller in fitter.reduce_flap(flap)]
    return fitting


def _find_unfit(fitter: FlapFitter, flaps: list[Flap]) -> set[Flap]:
    """Return the flaps with a polygon that is invalid, meets its own piece, or is not inside the piece above it."""
    zones: dict[tuple[int, bool], list[Flap]] = defaultdict(list)
    polygons: dict[tuple[int, bool], list[Any]] = defaultdict(list)
    for flap in flaps:
        for zone in flap.zones:
            key = zone.place.piece, zone.outside
            zones[key].append(flap)
            polygons[key].append(fitter.flap_polygon(flap, zone))
    unfit: set[Flap] = set()
    for (piece, outside), members in zones.items():
        flap_polygons = np.array(polygons[piece, outside])
        region = fitter.piece_polygon(piece)
        fits = ~shapely.intersects(region, flap_polygons) if outside else shapely.contains(region, flap_polygons)
        fits &= shapely.is_valid(flap_polygons)
        unfit.update(flap for flap, good in zip(members, fits, strict=True) if not good)
    return unfit


def _find_colliding(fitting: dict[Flap, dict[FlapZone, Any]]) -> list[Flap]:
    """Return the flaps to be reduced: the higher one of each two that meet, both if their heights are within 1 %."""
    zones: dict[tuple[int, bool], list[tuple[Flap, Any]]] = defaultdict(list)
    for flap, shapes in fitting.items():
        for zone, shape in shapes.items():
            zones[zone.place.piece, zone.outside].append((flap, shape))
    yielding: dict[Flap, None] = {}  # an ordered set
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
