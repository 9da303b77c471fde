r"""Division of a surface into strips: as few ruled surfaces as a tolerance allows.

A surface is divided in one parameter, at kinks first, then by taking the longest strip that keeps to the tolerance, one
after the other. The end of a strip is searched for with sampled deviations, many candidates at once, and its deviation
is then bounded from coefficients (:mod:`cqblend.patterns.strips.ruled_deviation`). Since the deviation may fall again
when a strip grows (a chord across an inflection), the greedy choice need not be best: where Elber's halving happens to
need fewer strips, those are returned. Depends on nothing that lays strips flat or trims them.

References
----------
G. Elber: Model fabrication using surface layout projection (1995), Algorithm 1 and section 3.
"""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import isfinite

import numpy as np

from cqblend.errors import GeometryError, InputError, shown
from cqblend.patterns.strips.band_search import (
    BoundedBand,
    LongestFirstSearch,
    RulingDirection,
    bisect_domains,
    bound_bisected_bands,
    find_kinks,
    prove_bands,
    too_many_strips_error,
)
from cqblend.patterns.strips.isocurve_samples import IsocurveSamples
from cqblend.patterns.strips.normal_curvature import find_curvature_maxima
from cqblend.patterns.strips.ruled_strip import RuledStrip
from cqblend.patterns.strips.surface_bands import BezierPieces, PieceStack
from cqblend.patterns.strips.surface_samples import SurfaceSamples
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.unroll_options import Direction, Method

Bands = list[BoundedBand]


@dataclass(frozen=True, slots=True, eq=False)
class SurfaceDivision:
    r"""A surface divided into strips.

    Attributes
    ----------
    strips
        In the order of the parameter in which the surface is divided; the second rail of each is the first of the next.
    direction
        The parameter that runs along the rulings: the surface is divided in it.
    method
        By which it was divided.
    elber_count
        Number of strips by Elber's Algorithm 1 in this direction for the same tolerance.
    ideal_count
        N*, the number of strips in the limit of narrow ones:
        the integral of max_u sqrt(\|<n, S_vv>\| / (8 tolerance)) dv.
    """

    strips: tuple[RuledStrip, ...]
    direction: RulingDirection
    method: Method
    elber_count: int
    ideal_count: float

    @property
    def bound(self) -> float:
        """Proven bound on the distance between surface and strips, both ways, mm."""
        return max(strip.bound for strip in self.strips)


def divide_surface(
    surface: Surface,
    tolerance: float,
    *,
    direction: Direction = "auto",
    method: Method = "longest",
    even: bool = False,
    least_width: float | None = None,
) -> SurfaceDivision:
    r"""Divide a surface into ruled strips between isoparametric curves.

    Parameters
    ----------
    surface
        Of dim 3 (mm); polynomial, or rational with positive weights. Sides may shrink to points.
    tolerance
        Largest distance between surface and strips, both ways, mm.
    direction
        Of the rulings. ``"auto"``: the one that takes fewer strips; if both take as many, the one in which rails are
        closed, then the one with fewer control points. ``"rings"``: rails are closed where the surface is closed in one
        parameter, otherwise as ``"auto"``.
    method
        ``"longest"``: the longest strip first, or Elber's where those are fewer.

        ``"curvature"``: the same between the isolated maxima of the normal curvature in the ruled direction.

        ``"elber"``: the paper's Algorithm 1: halving in the parameter until the coefficients of the difference are
        below the tolerance. The fractions w of the rows of control points are those of the middle column of the control
        mesh (that with the longest chord, if the ends of the middle one coincide); where that column turns back its
        fractions are kept from decreasing, so that the strips keep to the tolerance. Kinks are not looked for.
    even
        Divide so that all strips between two kinks deviate about as much, without taking more of them.
    least_width
        Refuse strips whose longest ruling is shorter, mm. Strips are made even before one is refused, so that a narrow
        last one is no reason.

    Raises
    ------
    InputError
        If an argument is out of range.
    GeometryError
        If the surface is degenerate, the tolerance takes more than 10,000 strips, or a strip is too narrow.

    References
    ----------
    Elber (1995), Algorithm 1, equation (3), figures 1 and 5.

    Examples
    --------
    >>> bow = np.array([[[x, 0.0, 0.0], [x, 5.0, 5.0], [x, 10.0, 0.0]] for x in (0.0, 10.0)])
    >>> surface = Surface.from_bspline((1, 2), ([0, 0, 1, 1], [0, 0, 0, 1, 1, 1]), bow)
    >>> division = divide_surface(surface, 0.2, direction="v")
    >>> len(division.strips), division.elber_count, round(division.ideal_count, 2), division.bound <= 0.2
    (4, 8, 3.31, True)
    >>> divide_surface(surface, 0.2).direction  # it is a cylinder: one strip
    'u'
    """
    (found,) = divide_surfaces(
        [surface], tolerance, direction=direction, method=method, even=even, least_width=least_width
    )
    if isinstance(found, GeometryError):
        raise found
    return found


def divide_surfaces(
    surfaces: Sequence[Surface],
    tolerance: float,
    *,
    direction: Direction = "auto",
    method: Method = "longest",
    even: bool = False,
    least_width: float | None = None,
) -> list[SurfaceDivision | GeometryError]:
    """Divide several surfaces as :func:`divide_surface` does, those of equal degrees side by side, which is faster.

    Returns
    -------
    list
        For every surface its division, or the error that it cannot be divided.

    Raises
    ------
    InputError
        If an argument is out of range.
    """
    for surface in surfaces:
        _check_arguments(surface, tolerance, direction, method, least_width)
    jobs = [(i, ruled_along) for i, one in enumerate(surfaces) for ruled_along in rank_directions(one, direction)]
    found = divide_along_rulings(
        [(surfaces[i], ruled_along) for i, ruled_along in jobs],
        tolerance,
        method=method,
        even=even,
        least_width=least_width,
    )
    results: list[SurfaceDivision | GeometryError] = []
    for i in range(len(surfaces)):
        own = [one for (j, _), one in zip(jobs, found, strict=True) if j == i]
        divisions = [one for one in own if isinstance(one, SurfaceDivision)]
        results.append(min(divisions, key=lambda division: len(division.strips)) if divisions else own[0])
    return results


def divide_along_rulings(
    jobs: Sequence[tuple[Surface, RulingDirection]],
    tolerance: float,
    *,
    method: Method = "longest",
    even: bool = False,
    least_width: float | None = None,
) -> list[SurfaceDivision | GeometryError]:
    """Divide surfaces, each with the direction of its rulings, as :func:`divide_surfaces` does."""
    request = _DivisionRequest(tolerance, method, even, least_width)
    results: dict[int, SurfaceDivision | GeometryError] = {}
    prepared: dict[int, _PreparedSurface] = {}
    for i, (surface, direction) in enumerate(jobs):
        try:
            prepared[i] = _turn_rulings_along_v(surface, direction, tolerance)
        except GeometryError as error:
            results[i] = error
    for group in _group_alike(prepared):
        members = [prepared[i] for i in group]
        results.update(zip(group, _divide_alike(members, request), strict=True))
    return [results[i] for i in range(len(jobs))]


@dataclass(frozen=True, slots=True)
class _DivisionRequest:
    """The arguments of :func:`divide_surface` that are the same for all surfaces."""

    tolerance: float
    method: Method
    even: bool
    least_width: float | None


def rank_directions(surface: Surface, direction: Direction) -> list[RulingDirection]:
    """Return the directions that rulings may have, the better one of equal numbers of strips first.

    That is the one in which rails are closed, then the one with fewer control points.
    """
    if direction in ("u", "v"):
        return [direction]
    has_closed_rails = {"u": _is_closed(surface, 1), "v": _is_closed(surface, 0)}
    if direction == "rings" and has_closed_rails["u"] != has_closed_rails["v"]:
        return ["u" if has_closed_rails["u"] else "v"]
    directions: list[RulingDirection] = ["u", "v"]
    return sorted(directions, key=lambda one: (not has_closed_rails[one], _count_poles(surface, one)))


def fit_single_strip(
    surface: Surface, span: tuple[float, float], tolerance: float, *, transposed: bool
) -> RuledStrip | None:
    """Return the one strip over a span of v, if it keeps to a tolerance, else None."""
    direction: RulingDirection = "u" if transposed else "v"
    prepared = _PreparedSurface(surface, direction, BezierPieces.from_surface(surface))
    bands = PieceStack.from_members([prepared.pieces]).cut_bands(0, *span)
    (band,) = prove_bands(bands, tolerance)
    return prepared.make_strip(band) if band.bound <= tolerance else None


def _check_arguments(
    surface: Surface, tolerance: float, direction: str, method: str, least_width: float | None
) -> None:
    if not isinstance(surface, Surface):
        raise InputError(f"only a Surface is divided into strips, not {shown(surface)}")
    if surface.dim != 3:
        raise InputError(f"only a surface of dim 3 is divided into strips, not of dim {surface.dim}")
    for name, value in (("tolerance", tolerance), ("least_width", least_width)):
        if value is None and name == "least_width":
            continue
        if isinstance(value, bool) or not isinstance(value, (int, float, np.floating, np.integer)):
            raise InputError(f"{name}={shown(value)}: it is a number, mm")
        if not (isfinite(value) and value > 0):
            raise InputError(f"{name}={value}: it must be positive and finite")
    if direction not in ("auto", "rings", "u", "v"):
        raise InputError(f"direction={shown(direction)}: choose 'auto', 'rings', 'u' or 'v'")
    if method not in ("longest", "elber", "curvature"):
        raise InputError(f"method={shown(method)}: choose 'longest', 'elber' or 'curvature'")


def _count_poles(surface: Surface, direction: RulingDirection) -> int:
    axis = "uv".index(direction)
    return surface.degree[axis] * (len(surface.breaks[axis]) - 1)


def _is_closed(surface: Surface, axis: int) -> bool:
    """Whether the two borders on which u (axis 0) or v (axis 1) is constant are the same curve."""
    coefs = np.moveaxis(surface.coefs, (axis, 3 + axis), (0, -1))
    first, last = coefs[0, ..., 0], coefs[-1, ..., -1]  # (.., dim, ..)
    return bool(np.abs(first - last).max() <= STRIP_TOLERANCES.closed_gap * np.abs(coefs).max())


@dataclass(frozen=True, slots=True, eq=False)
class _PreparedSurface:
    """A surface with its rulings along v: transposed if they run along u."""

    surface: Surface
    direction: RulingDirection
    pieces: BezierPieces

    def make_strip(self, band: BoundedBand, border: Curve | None = None) -> RuledStrip:
        """Return a band of the surface as a strip; its first rail is the `border` if that is it."""
        fractions = band.row_fractions
        if border is None or not band.bands.starts_along(band.index, border):
            border = band.bands.make_rail(band.index, 0)
        return RuledStrip(
            (border, band.bands.make_rail(band.index, 1)),
            self.surface,
            (band.start, band.end),
            band.bound,
            self.direction == "u",
            None if fractions is None else band.bands.make_fraction_surface(band.index, fractions),
        )


def _turn_rulings_along_v(surface: Surface, direction: RulingDirection, tolerance: float) -> _PreparedSurface:
    """Prepare a surface, and refuse it if the tolerance is within its rounding."""
    ruled_along_v = surface.transpose() if direction == "u" else surface
    pieces = BezierPieces.from_surface(ruled_along_v)
    if tolerance <= 4 * pieces.slack:
        raise GeometryError(
            f"tolerance={tolerance:g} is within the rounding of a surface of size {pieces.size:.3g}: "
            f"{8 * pieces.slack:.1g} is the least"
        )
    return _PreparedSurface(ruled_along_v, direction, pieces)


def _group_alike(prepared: Mapping[int, _PreparedSurface]) -> list[list[int]]:
    """Group surfaces, by their keys, whose pieces can be stacked."""
    groups: dict[object, list[int]] = defaultdict(list)
    for i, one in prepared.items():
        groups[one.pieces.likeness].append(i)
    return list(groups.values())


def _divide_alike(
    surfaces: Sequence[_PreparedSurface], request: _DivisionRequest
) -> list[SurfaceDivision | GeometryError]:
    """Divide surfaces whose pieces can be stacked."""
    stack = PieceStack.from_members([one.pieces for one in surfaces])
    samples = SurfaceSamples(stack)
    results: dict[int, SurfaceDivision | GeometryError] = {}
    sound: dict[int, float] = {}  # N* of the others
    counts = samples.estimate_ideal_counts(request.tolerance).tolist()
    for i, (has_area, ideal_count) in enumerate(zip(samples.have_area().tolist(), counts, strict=True)):
        if not has_area:
            results[i] = GeometryError(
                "the surface is degenerate: it has no area (two opposite sides coincide, or are points)"
            )
        elif ideal_count > STRIP_TOLERANCES.max_strips:
            results[i] = too_many_strips_error(request.tolerance, surfaces[i].direction)
        else:
            sound[i] = ideal_count
    if results and sound:
        stack = PieceStack.from_members([surfaces[i].pieces for i in sound])
    if sound:
        divided = _divide_sound(stack, [surfaces[i] for i in sound], list(sound.values()), request)
        results.update(zip(sound, divided, strict=True))
    return [results[i] for i in range(len(surfaces))]


def _divide_sound(
    stack: PieceStack, surfaces: Sequence[_PreparedSurface], ideal_counts: Sequence[float], request: _DivisionRequest
) -> list[SurfaceDivision | GeometryError]:
    """Divide surfaces, stacked, that have an area and do not take too many strips."""
    intervals = bisect_domains(stack, request.tolerance, [one.direction for one in surfaces])
    results: dict[int, SurfaceDivision | GeometryError] = {}
    cut: dict[int, _CutSurface] = {}
    for i, found in enumerate(intervals):
        if isinstance(found, GeometryError):
            results[i] = found
            continue
        try:
            cut[i] = _cut_at_ridges(surfaces[i], ideal_counts[i], found, request.method)
        except GeometryError as error:
            results[i] = error
    if request.method == "elber":
        divided: list[Bands | GeometryError] = [
            bound_bisected_bands(stack, i, one.elber_intervals) for i, one in cut.items()
        ]
    else:
        divided = _find_fewest_bands(list(cut.values()), request, equalise=request.even)
    for (i, one), bands in zip(cut.items(), divided, strict=True):
        if isinstance(bands, GeometryError):
            results[i] = bands
            continue
        if request.method == "longest" and len(one.elber_intervals) < len(bands):  # across kinks
            bands = bound_bisected_bands(stack, i, one.elber_intervals)
        try:
            results[i] = _make_division(one, _widen_bands(one, bands, request), request)
        except GeometryError as error:
            results[i] = error
    return [results[i] for i in range(len(surfaces))]


@dataclass(frozen=True, slots=True, eq=False)
class _CutSurface:
    """A surface with breaks at the ridges of its curvature, (n,) parameters v; N*, and its intervals by halving."""

    prepared: _PreparedSurface
    ridges: Array
    ideal_count: float
    elber_intervals: list[tuple[float, float]]


def _cut_at_ridges(
    prepared: _PreparedSurface, ideal_count: float, elber_intervals: list[tuple[float, float]], method: Method
) -> _CutSurface:
    """Cut a surface at the ridges of its curvature, if the method asks for them."""
    ridges = find_curvature_maxima(prepared.surface) if method == "curvature" else np.empty(0)
    if len(ridges):
        surface = prepared.surface.cut(v=ridges)
        prepared = replace(prepared, surface=surface, pieces=BezierPieces.from_surface(surface))
    return _CutSurface(prepared, ridges, ideal_count, elber_intervals)


def _widen_bands(one: _CutSurface, bands: Bands, request: _DivisionRequest) -> Bands:
    """Return bands that are even if one of them is narrower than asked.

    Raises
    ------
    GeometryError
        If one is too narrow nevertheless.
    """
    if request.least_width is None:
        return bands
    if request.method != "elber" and not request.even and min(band.width for band in bands) < request.least_width:
        (even,) = _find_fewest_bands([one], request, equalise=True)
        if isinstance(even, GeometryError):
            raise even
        bands = even
    narrow = min(bands, key=lambda band: band.width)
    if narrow.width < request.least_width:
        raise GeometryError(
            f"the strip from {one.prepared.direction} = {narrow.start:.6g} to {narrow.end:.6g} is {narrow.width:.3g} "
            f"wide, less than least_width={request.least_width:g}: choose a larger tolerance than "
            f"{request.tolerance:g}, or the other direction"
        )
    return bands


def _make_division(one: _CutSurface, bands: Bands, request: _DivisionRequest) -> SurfaceDivision:
    """Make strips of bands. Neighbours have the same curve for a rail."""
    strips: list[RuledStrip] = []
    for band in bands:
        strips.append(one.prepared.make_strip(band, strips[-1].rails[1] if strips else None))
    direction = one.prepared.direction
    return SurfaceDivision(tuple(strips), direction, request.method, len(one.elber_intervals), one.ideal_count)


def _find_fewest_bands(
    surfaces: Sequence[_CutSurface], request: _DivisionRequest, *, equalise: bool
) -> list[Bands | GeometryError]:
    """Divide at kinks and at ridges of the curvature, and what is between into as few strips as can be found."""
    if not surfaces:
        return []
    stack = PieceStack.from_members([one.prepared.pieces for one in surfaces])
    samples = IsocurveSamples.from_stack(stack)
    borders = []
    for i, one in enumerate(surfaces):
        breaks = one.prepared.pieces.breaks[1]
        ridge_breaks = [int(np.abs(breaks - v).argmin()) for v in one.ridges]
        borders.append(sorted({0, len(breaks) - 1, *ridge_breaks, *find_kinks(samples, i)}))
    owner = [i for i, borders_of_one in enumerate(borders) for _ in borders_of_one[1:]]  # of the parts between borders
    parts = stack.divide_members(borders)
    intervals = _bisect_parts(parts, owner, surfaces, request.tolerance)
    directions = [surfaces[i].prepared.direction for i in owner]
    search = LongestFirstSearch(IsocurveSamples(parts, samples.coefs), request.tolerance, directions)
    guesses = [
        (end - start) / (1 if isinstance(found, GeometryError) else len(found))
        for start, end, found in zip(*(one.tolist() for one in parts.domains), intervals, strict=True)
    ]
    results: list[Bands | GeometryError] = [[] for _ in surfaces]
    for part, (i, halved, bands) in enumerate(zip(owner, intervals, search.find_bands(guesses), strict=True)):
        so_far = results[i]
        if isinstance(so_far, GeometryError):
            continue
        if isinstance(halved, GeometryError):
            results[i] = halved
            continue
        if isinstance(bands, GeometryError):
            results[i] = bands
            continue
        if not bands or len(bands) > len(halved):
            bands = bound_bisected_bands(parts, part, halved)
        so_far += search.equalise_bounds(part, bands) if equalise else bands
        if len(so_far) > STRIP_TOLERANCES.max_strips:
            results[i] = too_many_strips_error(request.tolerance, directions[part])
    return results


def _bisect_parts(
    parts: PieceStack, owner: Sequence[int], surfaces: Sequence[_CutSurface], tolerance: float
) -> list[list[tuple[float, float]] | GeometryError]:
    """Return the intervals by Elber's halving of the parts of surfaces; of a surface in one part they are known."""
    counts = Counter(owner)
    found: list[list[tuple[float, float]] | GeometryError] = [surfaces[i].elber_intervals for i in owner]
    several = [part for part, i in enumerate(owner) if counts[i] > 1]
    if several:
        stack = PieceStack.from_members([parts.members[part] for part in several])
        directions = [surfaces[owner[part]].prepared.direction for part in several]
        for part, intervals in zip(several, bisect_domains(stack, tolerance, directions), strict=True):
            found[part] = intervals
    return found
