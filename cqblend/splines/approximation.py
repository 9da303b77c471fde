"""Splines near given functions: on as few spans as a tolerance takes, or to rounding.

Depends on curves, surfaces and Hermite interpolation only.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array, differentiate_coefs, evaluate_basis
from cqblend.splines.curve import Curve
from cqblend.splines.interpolation import check_parameters, hermite
from cqblend.splines.spline_space import SplineSpace
from cqblend.splines.surface import Surface
from cqblend.splines.tolerances import SPLINE_LIMITS, SPLINE_TOLERANCES


class Kinks(NamedTuple):
    """Where a function is less smooth than C5."""

    parameters: ArrayLike
    """(n,)."""
    continuity: ArrayLike
    """(n,) orders of continuity there, 0 to 4."""


def approximate_curve(
    function: Callable[[Array], Array],
    breaks: ArrayLike,
    tolerance: float,
    *,
    kinks: Kinks | None = None,
    closed: bool = False,
    most: int = 512,
) -> Curve:
    """Least-squares quintic spline of a function, with knots at given breaks where these are near even spacing.

    Spans in which the error is too large are halved. The function is evaluated once at each point.

    Parameters
    ----------
    function
        Vectorised, (n,) to (n, dim).
    breaks
        (m + 1,) increasing; the first and the last are the domain.
    tolerance
        Of every component.
    kinks
        Where the function is less smooth than C5. Those outside the domain do not count, nor do the ends unless it is
        closed. Elsewhere the spline is C4.
    closed
        Whether the function goes on periodically: then the spline does.
    most
        Largest number of spans.

    Raises
    ------
    GeometryError
        If the tolerance is not met; the message says what was reached, and where.

    Examples
    --------
    >>> curve = approximate_curve(lambda t: np.cos(t)[:, None], [0, 2 * np.pi], 1e-6, closed=True)
    >>> curve.degree, len(curve.breaks), bool(abs(curve(1.0) - np.cos(1.0)) < 1e-6)
    (5, 17, True)
    >>> corner = approximate_curve(lambda t: abs(t - 0.3)[:, None], [0, 1], 1e-9, kinks=Kinks([0.3], [0]))
    >>> len(corner.breaks), int(corner.continuity.min())
    (17, 0)
    """
    given = check_parameters(breaks)
    parameters, orders = Kinks((), ()) if kinks is None else kinks
    kinks_inside, multiplicities = _merge_kinks(
        given, np.asarray(parameters, dtype=np.float64), 5 - np.clip(np.asarray(orders, dtype=int), 0, 4)
    )
    inside = (kinks_inside < given[-1]) & ((kinks_inside > given[0]) | closed)
    kinks_inside, multiplicities = kinks_inside[inside], multiplicities[inside]
    t = _place_knots(given, SPLINE_LIMITS.initial_spans, kinks_inside)
    samples: dict[
        tuple[float, float], Array
    ] = {}  # by span, values kinks_inside nodes and kinks_inside points in between
    while True:
        ends = list(zip(t[:-1].tolist(), t[1:].tolist(), strict=True))
        new_spans = np.array([pair for pair in ends if pair not in samples])
        points = new_spans[:, :1] + np.diff(new_spans) * SPAN_SAMPLES
        values = function(points.ravel()).reshape(len(new_spans), len(SPAN_SAMPLES), -1)
        samples |= zip(map(tuple, new_spans.tolist()), values, strict=True)
        found = np.stack([samples[pair] for pair in ends])  # (spans, samples, dim)
        space = SplineSpace.from_knots(5, t, _list_multiplicities(multiplicities, kinks_inside, t), closed=closed)
        curve = space.fit_values(FIT_PLACES, found[:, : len(FIT_PLACES)])
        between = np.einsum("pdn,pm->nmd", curve.coefs, evaluate_basis(5, 1 - ERROR_PLACES, ERROR_PLACES))
        errors = np.abs(between - found[:, len(FIT_PLACES) :]).max(axis=(1, 2))
        bad = errors > tolerance
        if not bad.any():
            return curve
        middles = _bisect_spans(t[:-1][bad], t[1:][bad], given)
        shortest = SPLINE_LIMITS.shortest_span * (given[-1] - given[0])
        if len(t) - 1 + len(middles) > most or np.diff(t)[bad].min() < shortest:
            worst = t[errors.argmax()]
            raise GeometryError(
                f"a spline of {len(t) - 1} spans errs by {errors.max():.2g} near t = {worst:.6g}, more than "
                f"{tolerance:.2g}"
            )
        t = np.sort(np.concatenate([t, middles]))


FIT_PLACES, ERROR_PLACES = (np.arange(8) + 0.5) / 8, (np.arange(8) + 0.05) / 8
"""Relative places in a span of the points of a least-squares fit, and of those at which its error is measured."""

SPAN_SAMPLES = np.concatenate([FIT_PLACES, ERROR_PLACES])


def _bisect_spans(starts: Array, ends: Array, breaks: Array) -> Array:
    """Return where to divide spans: at the middle, or at a given break within a fifth of the span from it."""
    middle = (starts + ends) / 2
    near = breaks[np.abs(middle[:, None] - breaks).argmin(axis=1)]
    return np.where(np.abs(near - middle) <= 0.2 * (ends - starts), near, middle)


def approximate_surface(
    function: Callable[[Array, Array], Array],
    breaks: tuple[Array, Array],
    tolerance: float,
    *,
    orders: tuple[Array, Array],
    most: int = 128,
) -> Surface:
    """Biquintic spline that is within a tolerance of a function of two parameters, on the fewest spans by doubling.

    Least squares at eight points of each span, in both directions; the error is measured at eight others.

    Parameters
    ----------
    function
        Vectorised, (n,) and (m,) to the values (n, m, dim) on their grid.
    breaks
        Of its domain, in both directions, the ends first and last.
    tolerance
        Largest error of a component.
    orders
        Continuity of the function at the inner breaks, -1 to 4; those at which it is C4 need not stay.
    most
        Largest number of spans in one direction.

    Raises
    ------
    GeometryError
        If the tolerance is not met; the message says what was reached.

    Examples
    --------
    >>> wave = approximate_surface(
    ...     lambda u, v: np.cos(np.add.outer(u, v))[..., None], ([0, 2], [0, 1]), 1e-9, orders=([], [])
    ... )
    >>> wave.degree, bool(abs(wave(1.3, 0.4) - np.cos(1.7)) < 1e-9)
    ((5, 5), True)
    """
    given = [check_parameters(some) for some in breaks]
    kinks = []
    for some, order in zip(given, orders, strict=True):
        inner, least = some[1:-1], np.clip(np.asarray(order, dtype=int), 0, 4)
        kinks.append(_merge_kinks(some, inner[least < 4], 5 - least[least < 4]))
    spans = 4
    while True:
        splines, backs, between = [], [], []
        for domain, (kinks_inside, multiplicities) in zip(given, kinks, strict=True):
            t = _place_knots(domain, spans, kinks_inside)
            multiple = _list_multiplicities(multiplicities, kinks_inside, t)
            splines.append(SplineSpace.from_knots(5, t, multiple, closed=False).as_curve())
            steps = np.diff(t)[:, None]
            nodes = (t[:-1, None] + steps * FIT_PLACES).ravel()
            backs.append((nodes, np.linalg.pinv(splines[-1](nodes))))
            between.append((t[:-1, None] + steps * ERROR_PLACES).ravel())
        (u, first), (v, second) = backs
        poles = np.einsum("in,nmd,jm->ijd", first, function(u, v), second, optimize=True)
        along, across = splines
        surface = Surface(
            (along.breaks, across.breaks),
            np.einsum("pim,qjn,ijd->pqdmn", along.coefs, across.coefs, poles, optimize=True),
            continuity=(along.continuity, across.continuity),
        )
        u, v = between
        error = float(np.abs(surface.grid(u, v) - function(u, v)).max())
        if error <= tolerance:
            return surface
        if 2 * spans > most:
            raise GeometryError(f"a spline of {spans} x {spans} spans errs by {error:.2g}, more than {tolerance:.2g}")
        spans *= 2


def _merge_kinks(breaks: Array, kinks: Array, multiplicities: Array) -> tuple[Array, Array]:
    """Unite kinks that differ by rounding, and move them to a given break there; the largest multiplicity stays.

    Kinks that need a simple knot only, where the function is C4, move to breaks farther away: a knot next to a break
    would leave a sliver.

    Parameters
    ----------
    breaks
        (m + 1,) ascending.
    kinks, multiplicities
        (k,) parameters, and the multiplicities of the knots there.
    """
    near = breaks[np.abs(kinks[:, None] - breaks).argmin(axis=1)]
    same = SPLINE_TOLERANCES.same_kink * (breaks[-1] - breaks[0])
    kinks = np.where(
        np.abs(near - kinks)
        <= np.where(multiplicities > 1, same, SPLINE_TOLERANCES.kink_snap * (breaks[-1] - breaks[0])),
        near,
        kinks,
    )
    order = np.argsort(kinks, kind="stable")
    kinks, multiplicities = kinks[order], multiplicities[order]
    first = np.append(True, np.diff(kinks) > same) if len(kinks) else np.empty(0, bool)
    starts = np.flatnonzero(first)
    return kinks[first], np.maximum.reduceat(multiplicities, starts) if len(kinks) else multiplicities


def _place_knots(breaks: Array, spans: int, kinks: Array) -> Array:
    """Return the ends of nearly equal spans: all kinks, and given breaks within 0.4 of a span of even spacing."""
    even = np.linspace(breaks[0], breaks[-1], spans + 1)
    step = even[1] - even[0]
    near = breaks[np.abs(even[:, None] - breaks).argmin(axis=1)]
    t = np.where(np.abs(near - even) <= 0.4 * step, near, even)
    fixed = np.unique(np.concatenate([kinks, breaks[[0, -1]]]))
    clear = np.abs(t[:, None] - fixed).min(axis=1) > 0.4 * step
    return np.unique(np.concatenate([fixed, t[clear]]))


def _list_multiplicities(multiplicities: Array, kinks: Array, t: Array) -> Array:
    """Return the multiplicities of knots at breaks t, the last one left out: given at kinks, 1 elsewhere."""
    result = np.ones(len(t) - 1, dtype=int)
    result[np.searchsorted(t, kinks)] = multiplicities
    return result


PIECE_POINTS = 8
"""Chebyshev points of a piece from which the derivatives at its ends are computed; more only add rounding."""


def approximate_to_rounding(
    function: Callable[[Array], Array], domain: tuple[float, float], *, closed: bool = False
) -> Curve:
    """Spline of degree 7, C3, that is a smooth function to rounding: 5e-14 of its largest value, or the function's own.

    Derivatives up to the third at the breaks are those of local interpolants at Chebyshev points, the mean of both
    sides; pieces are equal, and as many as it takes.

    Parameters
    ----------
    function
        Vectorised, (n,) to (n, dim).
    domain
        (a, b).
    closed
        Whether the function goes on periodically: then the curve does, C3.

    Raises
    ------
    GeometryError
        If 4096 pieces are not enough, as at a kink; the message says where.

    Examples
    --------
    >>> wave = approximate_to_rounding(lambda t: np.sin(3 * t)[:, None], (0, 6))
    >>> bool(abs(wave(1.234) - np.sin(3.702)) < 1e-13)
    True
    """
    x = (1 - np.cos(np.pi * np.arange(PIECE_POINTS) / (PIECE_POINTS - 1))) / 2
    poles = np.linalg.inv(evaluate_basis(PIECE_POINTS - 1, 1 - x, x).T)  # from values to Bernstein coefficients
    count = 16
    best: tuple[float, Curve] | None = None
    while True:
        t = np.linspace(*domain, count + 1)
        nodes = t[:-1] + x[:, None] * np.diff(t)
        coefs = np.einsum("pk,knd->pnd", poles, function(nodes.ravel()).reshape(PIECE_POINTS, count, -1))
        sides = []
        for k in range(4):
            sides.append(np.stack([coefs[0], coefs[-1]]) / (t[1] - t[0]) ** k)
            coefs = differentiate_coefs(coefs)
        first, last = np.stack(sides).swapaxes(0, 1)  # (4, count, dim) each
        inner = (first[:, 1:] + last[:, :-1]) / 2
        start, end = first[:, :1], last[:, -1:]
        if closed:
            start = end = (start + end) / 2
        curve = hermite(t, np.concatenate([start, inner, end], axis=1))
        between = np.append((t[:-1, None] + np.diff(t)[:, None] * [0, 0.2, 0.5, 0.8]).ravel(), t[-1])
        values = function(between)
        error = np.abs(curve(between) - values).max(axis=1)
        share = float(error.max()) / (float(np.abs(values).max()) or 1.0)
        if share <= SPLINE_TOLERANCES.refined_fit or (
            best is not None and share > best[0] / 4 and best[0] <= SPLINE_TOLERANCES.accepted_fit
        ):
            return curve if best is None or share <= best[0] else best[1]
        best = share, curve
        if count >= SPLINE_LIMITS.fit_pieces and share <= SPLINE_TOLERANCES.accepted_fit:
            return curve
        if count >= SPLINE_LIMITS.fit_pieces:
            raise GeometryError(
                f"a function of t is not smooth enough at t = {between[error.argmax()]:.6g} to be a spline: give it as "
                "a Curve, with its kinks at breaks"
            )
        count *= 2
