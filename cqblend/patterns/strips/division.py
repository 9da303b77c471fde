r"""Division of a surface into strips: as few ruled surfaces as a tolerance allows.

A surface is divided in one parameter, at kinks first, then by taking the longest strip that keeps to the tolerance, one
after the other. Its end is looked for on sampled deviations, many candidates at once, and then proven on coefficients
(:mod:`cqblend.patterns.strips.ruled_deviation`). Since the deviation may fall again when a strip grows (a chord across
an inflection), the greedy choice need not be best: where Elber's halving happens to need fewer strips, those are
returned. Must not know how strips are trimmed or laid flat.

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
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array
from cqblend.unroll_options import Direction, Method

KINK_ANGLE = 1e-3
"""Angle (rad) between tangents in the ruled direction from which on a knot line is a kink, where strips have to end."""

MAX_STRIPS = 10_000
"""Strips of one surface before the tolerance counts as out of reach."""

_MIN_LENGTH_SHARE = 1e-11  # of the domain: no strip is shorter
_SAMPLED_TOLERANCE_SHARE = (
    0.998  # of the tolerance: what sampled deviations may be, so that bounds are mostly within it at once
)
_LENGTH_FACTORS = np.geomspace(0.5, 2.8, 13)  # of a guess: candidates for a length
_BRACKET_FRACTIONS = np.linspace(0.0, 1.0, 13)  # of a bracket


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
        That was asked for.
    elber
        How many strips Elber's Algorithm 1 needs in this direction for the same tolerance.
    ideal
        N*, about how many strips it takes where they are narrow:
        the integral of max_u sqrt(\|<n, S_vv>\| / (8 tolerance)) dv.
    """

    strips: tuple[RuledStrip, ...]
    direction: Literal["u", "v"]
    method: Method
    elber: int
    ideal: float

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
        below the tolerance. The rows of the ruled surface are spaced like the middle column of the control mesh (that
        with the longest chord, if the ends of the middle one coincide); where that column turns back its fractions are
        kept from decreasing, so that what is returned keeps to the tolerance. Kinks are not looked for.
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
        If the surface is degenerate, the tolerance takes more than `MOST` strips, or a strip is too narrow.

    References
    ----------
    Elber (1995), Algorithm 1, equation (3), figures 1 and 5.

    Examples
    --------
    >>> bow = np.array([[[x, 0.0, 0.0], [x, 5.0, 5.0], [x, 10.0, 0.0]] for x in (0.0, 10.0)])
    >>> surface = Surface.from_bspline((1, 2), ([0, 0, 1, 1], [0, 0, 0, 1, 1, 1]), bow)
    >>> division = divide(surface, 0.2, direction="v")
    >>> len(division.strips), division.elber, round(division.ideal, 2), division.bound <= 0.2
    (4, 8, 3.31, True)
    >>> divide(surface, 0.2).direction  # it is a cylinder: one strip
    'u'
    """
    _check_arguments(surface, tolerance, direction, method, least_width)
    _refuse_degenerate(surface)
    found: list[SurfaceDivision] = []
    failure: GeometryError | None = None
    for way in rank_directions(surface, direction):
        try:
            found.append(_divide_along(surface, tolerance, way, method, even, least_width))
        except GeometryError as error:
            failure = failure or error
    if not found:
        assert failure is not None
        raise failure
    return min(found, key=lambda one: len(one.strips))


def rank_directions(surface: Surface, direction: Direction) -> list[Literal["u", "v"]]:
    """Return the directions that rulings may have, the better one of equal numbers of strips first.

    That is the one in which rails are closed, then the one with fewer control points.
    """
    if direction in ("u", "v"):
        return [direction]
    closed = {way: _is_closed(surface, 1 - axis) for axis, way in enumerate(("u", "v"))}  # whether the rails are
    if direction == "rings" and closed["u"] != closed["v"]:
        return ["u" if closed["u"] else "v"]
    ways: list[Literal["u", "v"]] = ["u", "v"]
    return sorted(ways, key=lambda way: (not closed[way], _count_poles(surface, way)))


def fit_single_strip(
    surface: Surface, span: tuple[float, float], tolerance: float, *, transposed: bool
) -> RuledStrip | None:
    """Return the one strip over a span of v, if it keeps to a tolerance."""
    cut = _prove_band(BezierPieces.from_surface(surface), *span, tolerance)
    return _make_strip(cut, surface, transposed) if cut.bound <= tolerance else None


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


def _count_poles(surface: Surface, direction: str) -> int:
    axis = "uv".index(direction)
    return surface.degree[axis] * (len(surface.breaks[axis]) - 1)


def _is_closed(surface: Surface, axis: int) -> bool:
    """Whether a surface closes in a parameter, without the border being one point."""
    coefs = np.moveaxis(surface.coefs, (axis, 3 + axis), (0, -1))
    first, last = coefs[0, ..., 0], coefs[-1, ..., -1]  # (.., dim, ..)
    return bool(np.abs(first - last).max() <= 1e-9 * np.abs(coefs).max())


def _estimate_ideal_count(surface: Surface, tolerance: float) -> float:
    """N*: the integral over v of max_u sqrt(|<n, S_vv>| / (8 tolerance)), by 8-point Gauss on every piece."""
    nodes, weights = np.polynomial.legendre.leggauss(8)
    u, v = surface.breaks
    half = np.diff(v)[:, None] / 2
    x = np.append(np.arange(8) / 8, 1.0 - 1e-9)
    along = (u[:-1, None] + np.diff(u)[:, None] * x).ravel()
    jet = surface.jet(along[:, None, None], v[:-1, None] + half * (1 + nodes), 2)
    normal = np.cross(jet[1, 0], jet[0, 1])
    length = np.linalg.norm(normal, axis=-1)
    regular = length > 1e-9 * float(length.max())  # there is no normal at a pole
    bend = np.divide((normal * jet[0, 2]).sum(axis=-1), length, out=np.zeros(length.shape), where=regular)
    return float((half * weights * np.sqrt(np.abs(bend).max(axis=0) / (8 * tolerance))).sum())


def _refuse_degenerate(surface: Surface) -> None:
    u, v = (np.linspace(b[0], b[-1], 4 * len(b) + 5)[1:-1] for b in surface.breaks)
    points, along, across = (surface.grid(u, v, *order) for order in ((0, 0), (1, 0), (0, 1)))
    area = np.linalg.norm(np.cross(along, across), axis=-1).max() * (u[-1] - u[0]) * (v[-1] - v[0])
    if not area > 1e-10 * float(np.ptp(points, axis=(0, 1)).max()) ** 2:
        raise GeometryError("the surface is degenerate: it has no area (two opposite sides coincide, or are points)")


@dataclass(frozen=True, slots=True, eq=False)
class _BoundedBand:
    """A window that keeps to the tolerance, its bound, and the spacing of its rows (None: feet)."""

    band: SurfaceBands
    bound: float
    row_fractions: Array | None

    @property
    def end(self) -> float:
        """Where it ends in v."""
        return float(self.band.ends[0])

    @property
    def width(self) -> float:
        """Its largest width."""
        return float(self.band.measure_widths()[0])


def _divide_along(
    surface: Surface, tolerance: float, way: Literal["u", "v"], method: Method, even: bool, least_width: float | None
) -> SurfaceDivision:
    turned = surface.transpose() if way == "u" else surface
    spans = BezierPieces.from_surface(turned)
    if tolerance <= 4 * spans.slack:
        raise GeometryError(
            f"tolerance={tolerance:g} is within the rounding of a surface of size {spans.size:.3g}: "
            f"{8 * spans.slack:.1g} is the least"
        )
    ideal = _estimate_ideal_count(turned, tolerance)
    if ideal > MAX_STRIPS:
        raise _too_many_strips_error(tolerance, way)
    halved = _bisect_domain(spans, tolerance, way)
    if method == "elber":
        cuts = _bound_bisected_bands(spans, halved)
    else:
        places = find_curvature_maxima(turned) if method == "curvature" else np.empty(0)
        if len(places):
            turned = turned.cut(v=places)
            spans = BezierPieces.from_surface(turned)
        cuts = _find_fewest_bands(spans, tolerance, way, places, halved, even)
        if method == "longest" and len(halved) < len(cuts):  # across kinks
            cuts = _bound_bisected_bands(spans, halved)
        if least_width is not None and not even and min(cut.width for cut in cuts) < least_width:
            cuts = _find_fewest_bands(spans, tolerance, way, places, halved, True)
    if least_width is not None:
        narrow = min(cuts, key=lambda cut: cut.width)
        if narrow.width < least_width:
            raise GeometryError(
                f"the strip from {way} = {narrow.band.starts[0]:.6g} to {narrow.end:.6g} is {narrow.width:.3g} wide, "
                f"less than least_width={least_width:g}: choose a larger tolerance than {tolerance:g}, or the other "
                "direction"
            )
    return SurfaceDivision(tuple(_make_strip(cut, turned, way == "u") for cut in cuts), way, method, len(halved), ideal)


def _make_strip(cut: _BoundedBand, surface: Surface, transposed: bool) -> RuledStrip:
    return RuledStrip(
        cut.band.make_rails(),
        surface,
        (float(cut.band.starts[0]), cut.end),
        cut.bound,
        transposed,
        None if cut.row_fractions is None else cut.band.make_fraction_surface(cut.row_fractions),
    )


def _find_fewest_bands(
    spans: BezierPieces, tolerance: float, way: str, places: Array, halved: list[tuple[float, float]], even: bool
) -> list[_BoundedBand]:
    """Divide at kinks and given places, and what is between into as few strips as can be found."""
    samples = IsocurveSamples(spans)
    breaks = spans.breaks[1]
    given = [int(np.abs(breaks - v).argmin()) for v in places]
    borders = sorted({0, len(breaks) - 1, *given, *_find_kinks(spans, samples)})
    found: list[_BoundedBand] = []
    for first, last in pairwise(borders):
        part = spans.take_pieces(first, last)
        search = _LongestFirstSearch(part, samples.take_pieces(first, last), tolerance, way)
        rival = halved if len(borders) == 2 else _bisect_domain(part, tolerance, way)
        start, end = part.domain
        cuts = search.find_bands((end - start) / len(rival))
        if not cuts or len(cuts) > len(rival):
            cuts = _bound_bisected_bands(part, rival)
        found += search.equalise_bounds(cuts) if even else cuts
        if len(found) > MAX_STRIPS:
            raise _too_many_strips_error(tolerance, way)
    return found


def _find_kinks(spans: BezierPieces, samples: IsocurveSamples) -> list[int]:
    """Return the breaks in v across which the tangents of isoparametric curves turn, or the surface is torn.

    A tangent is the direction from the control point at the break to the first one that differs from it: speeds do not
    matter.
    """
    small = 1e-9 * spans.size
    found = []
    for j in range(1, len(spans.breaks[1]) - 1):
        left, right = samples.poles[j - 1, ::-1], samples.poles[j]  # (q+1, 3, u), from the break on
        if np.abs(left[0] - right[0]).max() > small:
            found.append(j)
            continue
        one, other = _find_end_tangents(left, small), _find_end_tangents(right, small)
        turn = np.arctan2(np.linalg.norm(np.cross(one, other, axis=0), axis=0), -(one * other).sum(axis=0))
        if turn[(one != 0).any(axis=0) & (other != 0).any(axis=0)].max(initial=0.0) > KINK_ANGLE:
            found.append(j)
    return found


def _find_end_tangents(poles: Array, small: float) -> Array:
    """Directions (3, n) from the first control point (q+1, 3, n) to the next that is not in the same place, else 0."""
    steps = poles[1:] - poles[0]
    away = np.linalg.norm(steps, axis=1) > small
    first = away.argmax(axis=0)
    return np.where(away.any(axis=0), steps[first, :, np.arange(poles.shape[2])].T, 0.0)


def _too_many_strips_error(tolerance: float, way: str) -> GeometryError:
    return GeometryError(
        f"tolerance={tolerance:g} takes more than {MAX_STRIPS} strips in {way}: choose a larger one, or the other "
        "direction"
    )


def _tolerance_unreachable_error(tolerance: float, way: str, at: float) -> GeometryError:
    return GeometryError(f"no strip from {way} = {at:.9g} on keeps to tolerance={tolerance:g}: choose a larger one")


def _bisect_domain(spans: BezierPieces, tolerance: float, way: str) -> list[tuple[float, float]]:
    """Elber's Algorithm 1, level by level."""
    start, end = spans.domain
    low, high = np.array([start]), np.array([end])
    found: list[tuple[float, float]] = []
    while len(low):
        windows = spans.cut_bands(low, high)
        good = (
            windows.bound_mesh_deviation(windows.fit_row_fractions(single=True)) + spans.slack < tolerance
        ) & windows.is_spannable()
        found += zip(low[good].tolist(), high[good].tolist(), strict=True)
        low, high = low[~good], high[~good]
        if len(low) and (high - low).min() < _MIN_LENGTH_SHARE * (end - start):
            raise _tolerance_unreachable_error(tolerance, way, float(low[0]))
        if len(low) + len(found) > MAX_STRIPS:
            raise _too_many_strips_error(tolerance, way)
        middle = (low + high) / 2
        low, high = np.concatenate([low, middle]), np.concatenate([middle, high])
    return sorted(found)


def _bound_bisected_bands(spans: BezierPieces, intervals: list[tuple[float, float]]) -> list[_BoundedBand]:
    """Return the strips of Algorithm 1."""
    found = []
    for interval in intervals:
        window = spans.cut_bands(*interval)
        spacing = window.fit_row_fractions(single=True)
        found.append(_BoundedBand(window, float(window.bound_mesh_deviation(spacing)[0]) + spans.slack, spacing))
    return found


def _prove_band(spans: BezierPieces, start: float, end: float, tolerance: float) -> _BoundedBand:
    """Return the strip from one parameter to another with its bound: infinite if it is none."""
    window = spans.cut_bands(start, end)
    if not window.is_spannable()[0]:
        return _BoundedBand(window, np.inf, None)
    bound = window.bound_deviation(tolerance)
    if np.isfinite(bound):
        return _BoundedBand(window, bound, None)
    spacing = window.fit_row_fractions()
    return _BoundedBand(window, window.bound_deviation(tolerance, spacing), spacing)


class _LongestFirstSearch:
    """The longest strip first, over a part of a surface without kinks."""

    def __init__(self, spans: BezierPieces, samples: IsocurveSamples, tolerance: float, way: str) -> None:
        self.spans, self.samples, self.tolerance, self.way = spans, samples, tolerance, way
        self.target = _SAMPLED_TOLERANCE_SHARE * tolerance

    def find_bands(self, guess: float, most: int = MAX_STRIPS) -> list[_BoundedBand]:
        """Return the strips, the first of about a guessed length; none if there would be more than `most`."""
        start, end = self.spans.domain
        found: list[_BoundedBand] = []
        while start < end:
            if len(found) == most:
                return []
            cut = self._find_longest_band(start, end, guess)
            found.append(cut)
            guess = cut.end - start
            start = cut.end
        return found

    def _find_longest_band(self, start: float, end: float, guess: float) -> _BoundedBand:
        shortest = _MIN_LENGTH_SHARE * (end - self.spans.domain[0])
        length = self._estimate_length(start, end, guess)
        shrink = 1.0
        while length > shortest:
            stop = min(start + length, end) if start + length < end - shortest else end
            cut = _prove_band(self.spans, start, stop, self.tolerance)
            if cut.bound <= self.tolerance:
                return cut
            # deviations grow with the square of the length; where they do not, go down ever faster
            shrink *= 0.998
            length = (cut.end - start) * min(max(np.sqrt(self.tolerance / cut.bound), 0.5), 1.0) * shrink
        raise _tolerance_unreachable_error(self.tolerance, self.way, start)

    def _estimate_length(self, start: float, end: float, guess: float) -> float:
        """Length of the longest strip from `start` that keeps to the tolerance where it is sampled."""
        rest = end - start
        guess = min(guess, rest)
        while guess > _MIN_LENGTH_SHARE * rest:
            lengths = np.unique(np.append(np.minimum(guess * _LENGTH_FACTORS, rest), rest))
            deviations = self.samples.sample_deviations(start, np.minimum(start + lengths, end))
            passed = np.flatnonzero(deviations <= self.target)
            if len(passed):
                return self._refine_length(start, lengths, deviations, int(passed[-1]))
            guess /= 4
        return 0.0

    def _refine_length(self, start: float, lengths: Array, deviations: Array, last: int) -> float:
        """Close in on the place between two candidates at which the deviation reaches the tolerance."""
        if last == len(lengths) - 1:
            return float(lengths[last])
        lengths = lengths[last] + _BRACKET_FRACTIONS * (lengths[last + 1] - lengths[last])
        deviations = self.samples.sample_deviations(start, start + lengths)
        i = int(np.flatnonzero(deviations <= self.target)[-1])
        if i == len(lengths) - 1 or not np.isfinite(deviations[i + 1]):
            return float(lengths[i])
        roots = np.sqrt(deviations[i : i + 2])  # nearly linear in the length
        share = (np.sqrt(self.target) - roots[0]) / (roots[1] - roots[0])
        return float(lengths[i] + min(share, 1.0) * (lengths[i + 1] - lengths[i])) * (1 - 1e-4)

    def equalise_bounds(self, cuts: list[_BoundedBand]) -> list[_BoundedBand]:
        """Return as many strips whose bounds are about the same."""
        start, end = self.spans.domain
        low, high = np.mean([np.sqrt(cut.bound) for cut in cuts]) ** 2, self.tolerance
        trial = low * 1.01
        for _ in range(10):
            if not self.spans.slack * 4 < trial < high:
                break
            finer = _LongestFirstSearch(self.spans, self.samples, trial, self.way).find_bands(
                (end - start) / len(cuts), len(cuts)
            )
            if len(finer) == len(cuts):
                cuts, high = finer, trial
            else:
                low = trial
            if high < 1.002 * low:
                break
            trial = np.sqrt(low * high)
        return cuts
