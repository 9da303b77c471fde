"""Proposes the flaps of every seam for a style of tabs, and chooses the side of each seam that they stand on.

Flaps end at the corners of either side of a seam, lean inwards in pointed corners, and are cut into teeth where the
seam is curved. Whether they fit is found by :mod:`cqblend.patterns.stock.flaps`.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from cqblend.errors import InputError
from cqblend.patterns.outline.path_by_length import PathByLength
from cqblend.patterns.outline.pieces import Place, Seam
from cqblend.patterns.outline.tolerances import OUTLINE_TOLERANCES
from cqblend.patterns.stock.connecting_strips import has_same_curve
from cqblend.patterns.stock.flaps import Flap, FlapFitter, FlapZone, fit_flaps
from cqblend.patterns.stock.stock_proportions import TAB_LIMITS
from cqblend.splines.bernstein import Array


def lay_out_flaps(fitter: FlapFitter) -> list[Flap]:
    """Return the flaps of all seams that fit.

    Raises
    ------
    InputError
        If there would be too many teeth.
    """
    pitch = min(fitter.options.tooth_length, 3 * fitter.options.width)
    longest = max((fitter.pieces.run(seam.sides[0]).path.length for seam in fitter.pieces.seams), default=0.0)
    if longest > TAB_LIMITS.most_teeth * pitch:
        raise _make_tooth_count_error(fitter, longest / pitch)
    return _choose_sides(fitter) if fitter.options.style == "one" else fit_flaps(fitter, _propose_flaps(fitter))


def _propose_flaps(fitter: FlapFitter) -> list[Flap]:
    """Return the flaps that the seams are to have, whether they fit or not."""
    sides = (0,) if fitter.options.style == "strips" else (0, 1)
    flaps: list[Flap] = []
    for k, seam in enumerate(fitter.pieces.seams):
        if all(fitter.pieces.run(side).path.length > 0 for side in seam.sides):
            for side in sides:
                flaps += _propose_side_flaps(fitter, k, side)
            if len(flaps) > TAB_LIMITS.most_teeth * len(sides):
                expected = len(flaps) / len(sides) * len(fitter.pieces.seams) / (k + 1)
                raise _make_tooth_count_error(fitter, expected)
    return flaps


def _make_tooth_count_error(fitter: FlapFitter, teeth: float) -> InputError:
    options = fitter.options
    return InputError(
        f"tabs of {options.width:g} mm with a pitch of {options.tooth_length:g} mm would be about {teeth:.0f} teeth, "
        f"more than {TAB_LIMITS.most_teeth}: take wider tabs or a longer pitch"
    )


def _choose_sides(fitter: FlapFitter) -> list[Flap]:
    """Return flaps on one side of each seam: on the one with more area, first as if it were alone, then among all.

    Where the flaps of other seams leave less than half of what the other side would have alone, sides are exchanged,
    and the better of both results is returned.
    """
    count = len(fitter.pieces.seams)
    fitting: tuple[list[list[Flap]], ...] = tuple([[] for _ in range(count)] for _ in range(2))
    for flap in fit_flaps(fitter, _propose_flaps(fitter), together=False):
        fitting[flap.side][flap.seam].append(flap)
    alone = np.array([[sum(flap.area for flap in flaps) for flaps in side] for side in fitting]).reshape(2, count)
    seams = np.arange(count)

    def fit_on_sides(sides: Array) -> tuple[list[Flap], Array]:
        flaps = fit_flaps(fitter, [flap for k in seams for flap in fitting[sides[k]][k]])
        areas = np.zeros(count)
        np.add.at(areas, [flap.seam for flap in flaps], [flap.area for flap in flaps])
        return flaps, areas

    sides = np.where(alone[1] > 1.01 * alone[0], 1, 0)
    flaps, areas = fit_on_sides(sides)
    crowded = areas < 0.5 * alone[1 - sides, seams]
    if crowded.any():
        others, other_areas = fit_on_sides(np.where(crowded, 1 - sides, sides))
        if other_areas.sum() > areas.sum():
            return others
    return flaps


@dataclass(frozen=True, slots=True)
class _SeamStretch:
    """A stretch of a seam between two corners.

    Attributes
    ----------
    start, stop
        Stations of the seam's first side, mm.
    interior_angles
        (2,) of either piece: its angles (rad) at both ends of the stretch.
    teeth
        Into how many teeth a tab along it is cut.
    """

    start: float
    stop: float
    interior_angles: tuple[Array, Array]
    teeth: int


def _split_at_corners(fitter: FlapFitter, seam: Seam) -> list[_SeamStretch]:
    """Return the stretches of a seam between the corners of either side."""
    paths = [fitter.path_by_length(side) for side in seam.sides]
    length = paths[0].length
    corners: dict[float, Array] = {}  # station on the first side: interior angles of the two pieces
    for k, (path, side) in enumerate(zip(paths, seam.sides, strict=True)):
        sharp = np.flatnonzero(np.abs(path.kink_angles) > TAB_LIMITS.tooth_corner_angle)
        ends = fitter.measure_corner_angles(side)
        stations = np.array([0.0, *path.stations[sharp + 1], path.length]) * (length / path.length)
        angles = np.array([ends[0], *(np.pi - path.kink_angles[sharp]), ends[1]])
        if k and seam.opposed:
            stations, angles = length - stations[::-1], angles[::-1]
        for station, angle in zip(stations.tolist(), angles, strict=True):
            near = TAB_LIMITS.same_corner * length
            corner = next((known for known in corners if abs(known - station) < near), station)
            corners.setdefault(corner, np.full(2, np.pi))[k] = angle
    return [
        _SeamStretch(
            start,
            stop,
            (np.array([corners[start][0], corners[stop][0]]), np.array([corners[start][1], corners[stop][1]])),
            _count_teeth(fitter, seam, start, stop),
        )
        for start, stop in pairwise(sorted(corners))
    ]


def _propose_side_flaps(fitter: FlapFitter, number: int, side: int) -> list[Flap]:
    """Return the flaps of one side (0 or 1) of a seam, given by its index."""
    style, width = fitter.options.style, fitter.options.width
    seam = fitter.pieces.seams[number]
    place, other = seam.sides[side], seam.sides[1 - side]
    length = fitter.path_by_length(place).length
    outside, beneath = FlapZone(place, True), FlapZone(other, False, from_end=seam.opposed)
    if style == "allowance":
        half_outer_angles = (2 * np.pi - np.array(fitter.measure_corner_angles(place))) / 2
        least = np.where(_find_seam_neighbours(fitter, place), -TAB_LIMITS.mitre_limit, 0.0)
        mitre = np.maximum(_compute_cotangent(half_outer_angles), least)
        ends = (float(mitre[0]), float(mitre[1]))
        return [Flap(number, side, 0.0, length, ends, ends, width, (outside,), divisible=False)]
    zones = {"both": (outside,), "strips": (FlapZone(place, False), beneath)}.get(style, (outside, beneath))
    stretches = _split_at_corners(fitter, seam)
    whole = style == "strips" and len(stretches) == 1 and has_same_curve(fitter, seam)
    wanted_inner, least_inner = fitter.tooth_cotangents
    flaps: list[Flap] = []
    done = 0
    for stretch in stretches:
        limit = _limit_leg_angles(fitter, stretch, side)
        count = stretch.teeth
        if whole:
            first, last = fitter.path_by_length(place).path.points[[0, -1]]
            count = 2 if np.linalg.norm(last - first) < 2 * width else 1  # the ends of a ring would touch
        if style == "alternating":
            count = max(count, _count_pitches(fitter, stretch.stop - stretch.start), 3 - len(stretches))
        cuts = np.linspace(stretch.start, stretch.stop, count + 1).tolist()
        wanted, least = np.full((count, 2), wanted_inner), np.full((count, 2), least_inner)
        wanted[0, 0], wanted[-1, 1] = _compute_cotangent(np.minimum(fitter.options.taper, limit))
        least[0, 0], least[-1, 1] = _compute_cotangent(limit)
        for k in range(count):
            if style != "alternating" or (done + k) % 2 == side:
                legs = [(float(each[k, 0]), float(each[k, 1])) for each in (wanted, least)]
                flaps.append(Flap(number, side, cuts[k], cuts[k + 1], legs[0], legs[1], width, zones))
        done += count
    if side == 0:
        return flaps
    scale = length / fitter.path_by_length(other).length
    return [_map_to_other_side(flap, scale, length if seam.opposed else None) for flap in flaps]


def _limit_leg_angles(fitter: FlapFitter, stretch: _SeamStretch, side: int) -> Array:
    """Return the largest angles (2,), rad, of the legs at both ends of a stretch.

    A tab shares the angle outside its piece with the tab next to it, and half of the neighbour's corner with the other
    tab that is glued into it.
    """
    own, neighbours = stretch.interior_angles[side], stretch.interior_angles[1 - side]
    outside = TAB_LIMITS.corner_share * (2 * np.pi - own)
    if fitter.options.style == "both":
        limit = outside
    elif fitter.options.style == "strips":
        limit = np.minimum(own, neighbours) / 2
    else:
        limit = np.minimum(outside, neighbours / 2)
    return np.clip(limit, TAB_LIMITS.shallowest_leg, np.pi / 2)


def _map_to_other_side(flap: Flap, scale: float, length: float | None) -> Flap:
    """Return a flap with its stations on the other side of the seam: scaled, counted back from a length if given."""
    if length is None:
        return replace(flap, start=flap.start * scale, stop=flap.stop * scale)
    return replace(
        flap,
        start=length - flap.stop * scale,
        stop=length - flap.start * scale,
        cotangents=flap.cotangents[::-1],
        least_cotangents=flap.least_cotangents[::-1],
    )


def _compute_cotangent(angle: Array) -> Array:
    return np.asarray(1 / np.tan(angle))


def _find_seam_neighbours(fitter: FlapFitter, place: Place) -> tuple[bool, bool]:
    """Return whether the runs before and after a run have seams too."""
    loop = [run for run in fitter.pieces.pieces[place.piece].loops[place.loop] if run.path.length > 0]
    at = loop.index(fitter.pieces.run(place))
    return loop[at - 1].seam is not None, loop[(at + 1) % len(loop)].seam is not None


def _count_pitches(fitter: FlapFitter, length: float) -> int:
    """Return how many teeth of the wanted length a stretch needs."""
    return int(np.ceil(length / fitter.options.tooth_length - OUTLINE_TOLERANCES.rounding_of_stations))


def _count_teeth(fitter: FlapFitter, seam: Seam, start: float, stop: float) -> int:
    """Return into how many teeth a tab is cut between two stations of the first side.

    One where both sides are straight in the plane and the seam is in space; else as many as the pitch tells, and so
    many that the base of none turns by more than :attr:`TabLimits.most_tooth_bend`, but none shorter than half a width.
    """
    turn, excess, length = 0.0, 0.0, fitter.path_by_length(seam.sides[0]).length
    for k, side in enumerate(seam.sides):
        run, path = fitter.pieces.run(side), fitter.path_by_length(side)
        ends = np.array([start, stop]) * (path.length / length)
        if k and seam.opposed:
            ends = path.length - ends[::-1]
        stretch = path.clip_between(max(ends[0], 0.0), min(ends[1], path.length))
        turn = max(turn, float(np.abs(PathByLength(stretch).turning_angles).sum()))
        stations = np.append(0.0, np.cumsum(run.path.lengths))
        vertices = np.abs(stations - ends[:, None]).argmin(axis=1)
        chord = float(np.linalg.norm(np.diff(run.space[vertices], axis=0)))
        if np.abs(stations[vertices] - ends).max() < TAB_LIMITS.same_corner * length and np.isfinite(chord):
            excess = max(excess, stop - start - chord)
    width = fitter.options.width
    # sagittae of the bow, in the plane and in space: a bow of height h is longer than its chord by 8 h^2 / 3 chord
    sagitta = max(turn * (stop - start) / 8, np.sqrt(0.375 * (stop - start) * max(excess, 0.0)))
    if sagitta < TAB_LIMITS.same_curve * width:
        return 1
    shortest = max(1, int((stop - start) / (width / 2)))
    bent = int(np.ceil(turn / TAB_LIMITS.most_tooth_bend))
    return max(_count_pitches(fitter, stop - start), min(bent, shortest))
