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

import numpy as np

from cqblend.errors import GeometryError, InputError, shown
from cqblend.patterns.strips.band_search import (
    BoundedBand,
    LongestFirstSearch,
    RulingDirection,
    bisect_domain,
    bound_bisected_bands,
    find_kinks,
    prove_band,
    too_many_strips_error,
)
from cqblend.patterns.strips.normal_curvature import find_curvature_maxima
from cqblend.patterns.strips.ruled_deviation import BezierPieces, IsocurveSamples
from cqblend.patterns.strips.ruled_strip import RuledStrip
from cqblend.patterns.strips.tolerances import STRIP_TOLERANCES
from cqblend.splines import Surface
from cqblend.splines.bernstein import Array
from cqblend.unroll_options import Direction, Method


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
    band = prove_band(BezierPieces.from_surface(surface), *span, tolerance)
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
        raise too_many_strips_error(tolerance, direction)
    elber_intervals = bisect_domain(pieces, tolerance, direction)
    if method == "elber":
        bands = bound_bisected_bands(pieces, elber_intervals)
    else:
        ridges = find_curvature_maxima(ruled_along_v) if method == "curvature" else np.empty(0)
        if len(ridges):
            ruled_along_v = ruled_along_v.cut(v=ridges)
            pieces = BezierPieces.from_surface(ruled_along_v)
        bands = _find_fewest_bands(pieces, request, ridges, elber_intervals, equalise=request.even)
        if method == "longest" and len(elber_intervals) < len(bands):  # across kinks
            bands = bound_bisected_bands(pieces, elber_intervals)
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


def _make_strip(band: BoundedBand, surface: Surface, transposed: bool) -> RuledStrip:
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
) -> list[BoundedBand]:
    """Divide at kinks and at given ridges of the curvature, and what is between into as few strips as can be found."""
    samples = IsocurveSamples.from_pieces(pieces)
    breaks = pieces.breaks[1]
    ridge_breaks = [int(np.abs(breaks - v).argmin()) for v in ridges]
    borders = sorted({0, len(breaks) - 1, *ridge_breaks, *find_kinks(pieces, samples)})
    found: list[BoundedBand] = []
    for first, last in pairwise(borders):
        part = pieces.take_pieces(first, last)
        search = LongestFirstSearch(part, samples.take_pieces(first, last), request.tolerance, request.direction)
        intervals = elber_intervals
        if len(borders) > 2:
            intervals = bisect_domain(part, request.tolerance, request.direction)
        start, end = part.domain
        bands = search.find_bands((end - start) / len(intervals))
        if not bands or len(bands) > len(intervals):
            bands = bound_bisected_bands(part, intervals)
        found += search.equalise_bounds(bands) if equalise else bands
        if len(found) > STRIP_TOLERANCES.max_strips:
            raise too_many_strips_error(request.tolerance, request.direction)
    return found
