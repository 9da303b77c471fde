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

from dataclasses import dataclass
from itertools import pairwise
from math import isfinite
from typing import Literal

import numpy as np

from cqblend.errors import GeometryError, InputError, shown
from cqblend.patterns.strips.normal_curvature import find_curvature_maxima
from cqblend.patterns.strips.ruled_deviation import BezierPieces, IsocurveSamples, SurfaceBands
from cqblend.patterns.strips.ruled_strip import RuledStrip
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array
from cqblend.unroll_options import Direction, Method

RulingDirection = Literal["u", "v"]
"""The parameter that runs along the rulings."""

_LENGTH_FACTORS = np.geomspace(0.5, 2.8, 13)
"""Of a guessed length of a strip: candidates for its length."""

_BRACKET_FRACTIONS = np.linspace(0.0, 1.0, 13)
"""Of the interval between two candidates: candidates of the second round."""


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
    _check_arguments(surface, tolerance, direction, method, least_width)
    _refuse_degenerate(surface)
    found: list[SurfaceDivision] = []
    failures: list[GeometryError] = []
    for ruled_along in rank_directions(surface, direction):
        try:
            found.append(_divide_along(surface, _DivisionRequest(tolerance, ruled_along, method, even, least_width)))
        except GeometryError as error:
            failures.append(error)
    if not found:
        raise failures[0]
    return min(found, key=lambda division: len(division.strips))


@dataclass(frozen=True, slots=True)
class _DivisionRequest:
    """The arguments of :func:`divide_surface`, for one direction."""

    tolerance: float
    direction: RulingDirection
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
    band = _prove_band(BezierPieces.from_surface(surface), *span, tolerance)
    return _make_strip(band, surface, transposed) if band.bound <= tolerance else None


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


def _estimate_ideal_count(surface: Surface, tolerance: float) -> float:
    """N*: the integral over v of max_u sqrt(|<n, S_vv>| / (8 tolerance)), by 8-point Gauss on every piece."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    u, v = surface.breaks
    half = np.diff(v)[:, None] / 2
    x = np.append(np.arange(8) / 8, 1.0 - 1e-9)  # up to just before the next piece
    u_samples = (u[:-1, None] + np.diff(u)[:, None] * x).ravel()
    jet = surface.jet(u_samples[:, None, None], v[:-1, None] + half * (1 + nodes), 2)
    normal = np.cross(jet[1, 0], jet[0, 1])
    length = np.linalg.norm(normal, axis=-1)
    regular = length > STRIP_TOLERANCES.pole_normal * float(length.max())  # there is no normal at a pole
    bend = np.divide((normal * jet[0, 2]).sum(axis=-1), length, out=np.zeros(length.shape), where=regular)
    return float((half * weights * np.sqrt(np.abs(bend).max(axis=0) / (8 * tolerance))).sum())


def _refuse_degenerate(surface: Surface) -> None:
    u, v = (np.linspace(b[0], b[-1], 4 * len(b) + 5)[1:-1] for b in surface.breaks)
    points, su, sv = (surface.grid(u, v, *order) for order in ((0, 0), (1, 0), (0, 1)))
    area = np.linalg.norm(np.cross(su, sv), axis=-1).max() * (u[-1] - u[0]) * (v[-1] - v[0])
    if not area > STRIP_TOLERANCES.degenerate_area * float(np.ptp(points, axis=(0, 1)).max()) ** 2:
        raise GeometryError("the surface is degenerate: it has no area (two opposite sides coincide, or are points)")


@dataclass(frozen=True, slots=True, eq=False)
class _BoundedBand:
    """A band of the surface that becomes a strip.

    Attributes
    ----------
    band
        The band.
    bound
        Of its distance from the ruled surface, mm; infinite if there is none.
    row_fractions
        Fractions w of its rows of control points; None if points of the surface are compared with their feet on the
        rulings.
    """

    band: SurfaceBands
    bound: float
    row_fractions: Array | None

    @property
    def end(self) -> float:
        """Where it ends in v."""
        return float(self.band.ends[0])

    @property
    def width(self) -> float:
        """Length of its longest ruling, mm."""
        return float(self.band.measure_widths()[0])


def _divide_along(surface: Surface, request: _DivisionRequest) -> SurfaceDivision:
    """Divide a surface with rulings along u or v; a surface with rulings along u is transposed."""
    tolerance, direction, method, least_width = (
        request.tolerance,
        request.direction,
        request.method,
        request.least_width,
    )
    transposed = direction == "u"
    ruled_along_v = surface.transpose() if transposed else surface
    pieces = BezierPieces.from_surface(ruled_along_v)
    if tolerance <= 4 * pieces.slack:
        raise GeometryError(
            f"tolerance={tolerance:g} is within the rounding of a surface of size {pieces.size:.3g}: "
            f"{8 * pieces.slack:.1g} is the least"
        )
    ideal_count = _estimate_ideal_count(ruled_along_v, tolerance)
    if ideal_count > STRIP_TOLERANCES.max_strips:
        raise _too_many_strips_error(tolerance, direction)
    elber_intervals = _bisect_domain(pieces, tolerance, direction)
    if method == "elber":
        bands = _bound_bisected_bands(pieces, elber_intervals)
    else:
        ridges = find_curvature_maxima(ruled_along_v) if method == "curvature" else np.empty(0)
        if len(ridges):
            ruled_along_v = ruled_along_v.cut(v=ridges)
            pieces = BezierPieces.from_surface(ruled_along_v)
        bands = _find_fewest_bands(pieces, request, ridges, elber_intervals, equalise=request.even)
        if method == "longest" and len(elber_intervals) < len(bands):  # across kinks
            bands = _bound_bisected_bands(pieces, elber_intervals)
        if least_width is not None and not request.even and min(band.width for band in bands) < least_width:
            bands = _find_fewest_bands(pieces, request, ridges, elber_intervals, equalise=True)
    if least_width is not None:
        narrow = min(bands, key=lambda band: band.width)
        if narrow.width < least_width:
            raise GeometryError(
                f"the strip from {direction} = {narrow.band.starts[0]:.6g} to {narrow.end:.6g} is {narrow.width:.3g} "
                f"wide, less than least_width={least_width:g}: choose a larger tolerance than {tolerance:g}, or the "
                "other direction"
            )
    strips = tuple(_make_strip(band, ruled_along_v, transposed) for band in bands)
    return SurfaceDivision(strips, direction, method, len(elber_intervals), ideal_count)


def _make_strip(band: _BoundedBand, surface: Surface, transposed: bool) -> RuledStrip:
    return RuledStrip(
        band.band.make_rails(),
        surface,
        (float(band.band.starts[0]), band.end),
        band.bound,
        transposed,
        None if band.row_fractions is None else band.band.make_fraction_surface(band.row_fractions),
    )


def _find_fewest_bands(
    pieces: BezierPieces,
    request: _DivisionRequest,
    ridges: Array,
    elber_intervals: list[tuple[float, float]],
    *,
    equalise: bool,
) -> list[_BoundedBand]:
    """Divide at kinks and at given ridges of the curvature, and what is between into as few strips as can be found."""
    samples = IsocurveSamples.from_pieces(pieces)
    breaks = pieces.breaks[1]
    ridge_breaks = [int(np.abs(breaks - v).argmin()) for v in ridges]
    borders = sorted({0, len(breaks) - 1, *ridge_breaks, *_find_kinks(pieces, samples)})
    found: list[_BoundedBand] = []
    for first, last in pairwise(borders):
        part = pieces.take_pieces(first, last)
        search = _LongestFirstSearch(part, samples.take_pieces(first, last), request.tolerance, request.direction)
        intervals = elber_intervals
        if len(borders) > 2:
            intervals = _bisect_domain(part, request.tolerance, request.direction)
        start, end = part.domain
        bands = search.find_bands((end - start) / len(intervals))
        if not bands or len(bands) > len(intervals):
            bands = _bound_bisected_bands(part, intervals)
        found += search.equalise_bounds(bands) if equalise else bands
        if len(found) > STRIP_TOLERANCES.max_strips:
            raise _too_many_strips_error(request.tolerance, request.direction)
    return found


def _find_kinks(pieces: BezierPieces, samples: IsocurveSamples) -> list[int]:
    """Return the breaks in v across which the tangents of isoparametric curves turn, or the surface is discontinuous.

    A tangent is the direction from the control point at the break to the first one that differs from it: speeds do not
    matter.
    """
    small = STRIP_TOLERANCES.coincident_points * pieces.size
    found = []
    for j in range(1, len(pieces.breaks[1]) - 1):
        left, right = samples.poles[j - 1, ::-1], samples.poles[j]  # (q+1, 3, u), from the break on
        if np.abs(left[0] - right[0]).max() > small:
            found.append(j)
            continue
        backward, forward = _find_end_tangents(left, small), _find_end_tangents(right, small)
        sine = np.linalg.norm(np.cross(backward, forward, axis=0), axis=0)
        turn = np.arctan2(sine, -(backward * forward).sum(axis=0))
        is_regular = (backward != 0).any(axis=0) & (forward != 0).any(axis=0)
        if turn[is_regular].max(initial=0.0) > STRIP_TOLERANCES.kink_angle:
            found.append(j)
    return found


def _find_end_tangents(poles: Array, small: float) -> Array:
    """Vectors (3, n) from the first control point (q+1, 3, n) to the next one that is not in the same place, else 0."""
    steps = poles[1:] - poles[0]
    is_away = np.linalg.norm(steps, axis=1) > small
    first = is_away.argmax(axis=0)
    return np.where(is_away.any(axis=0), steps[first, :, np.arange(poles.shape[2])].T, 0.0)


def _too_many_strips_error(tolerance: float, direction: RulingDirection) -> GeometryError:
    return GeometryError(
        f"tolerance={tolerance:g} takes more than {STRIP_TOLERANCES.max_strips} strips in {direction}: choose a larger "
        "one, or the other direction"
    )


def _tolerance_unreachable_error(tolerance: float, direction: RulingDirection, at: float) -> GeometryError:
    return GeometryError(
        f"no strip from {direction} = {at:.9g} on keeps to tolerance={tolerance:g}: choose a larger one"
    )


def _bisect_domain(pieces: BezierPieces, tolerance: float, direction: RulingDirection) -> list[tuple[float, float]]:
    """Return the intervals of v by Elber's Algorithm 1, which halves all that are too long at once."""
    start, end = pieces.domain
    low, high = np.array([start]), np.array([end])
    found: list[tuple[float, float]] = []
    while len(low):
        bands = pieces.cut_bands(low, high)
        bounds = bands.bound_mesh_deviation(bands.fit_row_fractions(middle_column=True)) + pieces.slack
        is_good = (bounds < tolerance) & bands.is_spannable()
        found += zip(low[is_good].tolist(), high[is_good].tolist(), strict=True)
        low, high = low[~is_good], high[~is_good]
        if len(low) and (high - low).min() < STRIP_TOLERANCES.shortest_strip * (end - start):
            raise _tolerance_unreachable_error(tolerance, direction, float(low[0]))
        if len(low) + len(found) > STRIP_TOLERANCES.max_strips:
            raise _too_many_strips_error(tolerance, direction)
        middle = (low + high) / 2
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return sorted(found)


def _bound_bisected_bands(pieces: BezierPieces, intervals: list[tuple[float, float]]) -> list[_BoundedBand]:
    """Return the strips of Elber's Algorithm 1 over its intervals."""
    found = []
    for interval in intervals:
        band = pieces.cut_bands(*interval)
        fractions = band.fit_row_fractions(middle_column=True)
        found.append(_BoundedBand(band, float(band.bound_mesh_deviation(fractions)[0]) + pieces.slack, fractions))
    return found


def _prove_band(pieces: BezierPieces, start: float, end: float, tolerance: float) -> _BoundedBand:
    """Return the strip from one v to another with its bound: infinite if there is no ruled surface."""
    band = pieces.cut_bands(start, end)
    if not band.is_spannable()[0]:
        return _BoundedBand(band, np.inf, None)
    bound = band.bound_deviation(tolerance)
    if np.isfinite(bound):
        return _BoundedBand(band, bound, None)
    fractions = band.fit_row_fractions()
    return _BoundedBand(band, band.bound_deviation(tolerance, fractions), fractions)


class _LongestFirstSearch:
    """The longest strip first, over a part of a surface without kinks."""

    def __init__(
        self, pieces: BezierPieces, samples: IsocurveSamples, tolerance: float, direction: RulingDirection
    ) -> None:
        self.pieces, self.samples, self.tolerance, self.direction = pieces, samples, tolerance, direction
        self.target = STRIP_TOLERANCES.sampled_deviation * tolerance

    def find_bands(self, guess: float, max_count: int = STRIP_TOLERANCES.max_strips) -> list[_BoundedBand]:
        """Return the strips, the first of about a guessed length; none if there would be more than `max_count`."""
        start, end = self.pieces.domain
        found: list[_BoundedBand] = []
        while start < end:
            if len(found) == max_count:
                return []
            band = self._find_longest_band(start, end, guess)
            found.append(band)
            guess = band.end - start
            start = band.end
        return found

    def _find_longest_band(self, start: float, end: float, guess: float) -> _BoundedBand:
        """Return the longest strip from `start` that keeps to the tolerance."""
        shortest = STRIP_TOLERANCES.shortest_strip * (end - self.pieces.domain[0])
        length = self._estimate_length(start, end, guess)
        shrink = 1.0
        while length > shortest:
            stop = min(start + length, end) if start + length < end - shortest else end
            band = _prove_band(self.pieces, start, stop, self.tolerance)
            if band.bound <= self.tolerance:
                return band
            # deviations grow with the square of the length; where they do not, lengths shrink ever faster
            shrink *= STRIP_TOLERANCES.length_shrink
            length = (band.end - start) * min(max(np.sqrt(self.tolerance / band.bound), 0.5), 1.0) * shrink
        raise _tolerance_unreachable_error(self.tolerance, self.direction, start)

    def _estimate_length(self, start: float, end: float, guess: float) -> float:
        """Length of the longest strip from `start` that keeps to the tolerance where it is sampled."""
        rest = end - start
        guess = min(guess, rest)
        while guess > STRIP_TOLERANCES.shortest_strip * rest:
            lengths = np.unique(np.append(np.minimum(guess * _LENGTH_FACTORS, rest), rest))
            deviations = self.samples.sample_deviations(start, np.minimum(start + lengths, end))
            passed = np.flatnonzero(deviations <= self.target)
            if len(passed):
                return self._refine_length(start, lengths, int(passed[-1]))
            guess /= 4
        return 0.0

    def _refine_length(self, start: float, lengths: Array, last: int) -> float:
        """Find the length, between the last candidate that passed and the next, at which the tolerance is reached."""
        if last == len(lengths) - 1:
            return float(lengths[last])
        lengths = lengths[last] + _BRACKET_FRACTIONS * (lengths[last + 1] - lengths[last])
        deviations = self.samples.sample_deviations(start, start + lengths)
        i = int(np.flatnonzero(deviations <= self.target)[-1])
        if i == len(lengths) - 1 or not np.isfinite(deviations[i + 1]):
            return float(lengths[i])
        roots = np.sqrt(deviations[i : i + 2])  # nearly linear in the length
        share = (np.sqrt(self.target) - roots[0]) / (roots[1] - roots[0])
        length = float(lengths[i] + min(share, 1.0) * (lengths[i + 1] - lengths[i]))
        return length * (1 - STRIP_TOLERANCES.length_margin)

    def equalise_bounds(self, bands: list[_BoundedBand]) -> list[_BoundedBand]:
        """Return as many strips whose bounds are about the same: those for the smallest tolerance that allows it."""
        start, end = self.pieces.domain
        low, high = np.mean([np.sqrt(band.bound) for band in bands]) ** 2, self.tolerance
        trial = low * STRIP_TOLERANCES.even_start
        for _ in range(10):
            if not self.pieces.slack * 4 < trial < high:
                break
            search = _LongestFirstSearch(self.pieces, self.samples, trial, self.direction)
            found = search.find_bands((end - start) / len(bands), len(bands))
            if len(found) == len(bands):
                bands, high = found, trial
            else:
                low = trial
            if high < STRIP_TOLERANCES.even_stop * low:
                break
            trial = np.sqrt(low * high)
        return bands
