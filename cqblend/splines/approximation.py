"""Splines near given functions: on as few spans as a tolerance takes, or to rounding.

Depends on curves, surfaces and Hermite interpolation only.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array, differentiate_coefs, evaluate_basis
from cqblend.splines.curve import Curve
from cqblend.splines.interpolation import check_parameters, hermite
from cqblend.splines.surface import Surface
from cqblend.splines.tolerances import SPLINE_LIMITS, SPLINE_TOLERANCES


def approximate_curve(
    function: Callable[[Array], Array],
    breaks: ArrayLike,
    tolerance: float,
    *,
    kinks: ArrayLike = (),
    orders: ArrayLike = (),
    closed: bool = False,
    spans: int = 16,
    most: int = 512,
) -> Curve:
    """Least-squares quintic spline of a function, with knots among given breaks as far as these are dense enough.

    Spans in which it errs are halved until it does not. The function is asked once for each point.

    Parameters
    ----------
    function
        Vectorised, (n,) to (n, dim).
    breaks
        (m + 1,) increasing; the first and the last are the domain.
    tolerance
        Of every component.
    kinks, orders
        Parameters (k,) at which the function is less smooth than C5, and its continuity there, 0 to 4. Those outside
        the domain do not count, nor do the ends unless it is closed. Elsewhere the spline is C4.
    closed
        Whether the function goes on periodically: then the spline does.
    spans, most
        Number of equal spans to start with, and of spans to end with.

    Raises
    ------
    GeometryError
        If the tolerance is not met; the message says what was reached, and where.

    Examples
    --------
    >>> curve = approximate_curve(lambda t: np.cos(t)[:, None], [0, 2 * np.pi], 1e-6, closed=True)
    >>> curve.degree, len(curve.breaks), bool(abs(curve(1.0) - np.cos(1.0)) < 1e-6)
    (5, 17, True)
    >>> corner = approximate_curve(lambda t: abs(t - 0.3)[:, None], [0, 1], 1e-9, kinks=[0.3], orders=[0])
    >>> len(corner.breaks), int(corner.continuity.min())
    (17, 0)
    """
    given = check_parameters(breaks)
    at, times = _merge_kinks(
        given, np.asarray(kinks, dtype=np.float64), 5 - np.clip(np.asarray(orders, dtype=int), 0, 4)
    )
    inside = (at < given[-1]) & ((at > given[0]) | closed)
    at, times = at[inside], times[inside]
    t = _place_knots(given, spans, at)
    read: dict[tuple[float, float], Array] = {}  # by span, values at nodes and at points in between
    while True:
        ends = list(zip(t[:-1].tolist(), t[1:].tolist(), strict=True))
        fresh = np.array([pair for pair in ends if pair not in read])
        points = fresh[:, :1] + np.diff(fresh) * SPAN_SAMPLES
        values = function(points.ravel()).reshape(len(fresh), len(SPAN_SAMPLES), -1)
        read |= zip(map(tuple, fresh.tolist()), values, strict=True)
        found = np.stack([read[pair] for pair in ends])  # (spans, places, dim)
        repeats = np.ones(len(t) - 1, dtype=int)
        repeats[np.searchsorted(t, at)] = times
        splines = _build_quintic_basis(t, repeats, closed=closed)
        nodes, between = np.split(t[:-1, None] + np.diff(t)[:, None] * SPAN_SAMPLES, 2, axis=1)
        q, r = np.linalg.qr(splines(nodes.ravel()))
        poles = np.linalg.solve(r, q.T @ found[:, :8].reshape(-1, found.shape[2]))
        curve = Curve(t, np.einsum("pkn,kd->pdn", splines.coefs, poles), continuity=splines.continuity)
        missed = np.abs(curve(between.ravel()).reshape(*between.shape, -1) - found[:, 8:]).max(axis=(1, 2))
        bad = missed > tolerance
        if not bad.any():
            return curve
        middles = _bisect_spans(t[:-1][bad], t[1:][bad], given)
        if len(t) - 1 + len(middles) > most or np.diff(t)[bad].min() < SPLINE_LIMITS.shortest_span * (
            given[-1] - given[0]
        ):
            worst = t[missed.argmax()]
            raise GeometryError(
                f"a spline of {len(t) - 1} spans errs by {missed.max():.2g} near t = {worst:.6g}, more than "
                f"{tolerance:.2g}"
            )
        t = np.sort(np.concatenate([t, middles]))


SPAN_SAMPLES = np.concatenate([(np.arange(8) + 0.5) / 8, (np.arange(8) + 0.05) / 8])  # in a span: to fit, to measure


def _bisect_spans(starts: Array, ends: Array, breaks: Array) -> Array:
    """Return where to divide spans: half-way, or at a given break next to that."""
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
        Number of spans in one direction to end with.

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
        for some, (at, times) in zip(given, kinks, strict=True):
            t = _place_knots(some, spans, at)
            repeats = np.ones(len(t) - 1, dtype=int)
            repeats[np.searchsorted(t, at)] = times
            splines.append(_build_quintic_basis(t, repeats, closed=False))
            steps = np.diff(t)[:, None]
            nodes = (t[:-1, None] + steps * ((np.arange(8) + 0.5) / 8)).ravel()
            backs.append((nodes, np.linalg.pinv(splines[-1](nodes))))
            between.append((t[:-1, None] + steps * ((np.arange(8) + 0.05) / 8)).ravel())
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


def _merge_kinks(breaks: Array, at: Array, times: Array) -> tuple[Array, Array]:
    """Unite parameters that differ by rounding, at breaks where there are some, with the largest of their numbers.

    Those of functions that are C4 there move to breaks farther off: next to a break, a knot would leave a sliver.
    """
    near = breaks[np.abs(at[:, None] - breaks).argmin(axis=1)]
    same = SPLINE_TOLERANCES.same_kink * (breaks[-1] - breaks[0])
    at = np.where(
        np.abs(near - at) <= np.where(times > 1, same, SPLINE_TOLERANCES.kink_snap * (breaks[-1] - breaks[0])), near, at
    )
    order = np.argsort(at, kind="stable")
    at, times = at[order], times[order]
    first = np.append(True, np.diff(at) > same) if len(at) else np.empty(0, bool)
    starts = np.flatnonzero(first)
    return at[first], np.maximum.reduceat(times, starts) if len(at) else times


def _place_knots(breaks: Array, spans: int, kinks: Array) -> Array:
    """Return the ends of nearly equal spans, at given breaks where there are some nearby, and at all kinks."""
    even = np.linspace(breaks[0], breaks[-1], spans + 1)
    step = even[1] - even[0]
    near = breaks[np.abs(even[:, None] - breaks).argmin(axis=1)]
    t = np.where(np.abs(near - even) <= 0.4 * step, near, even)
    fixed = np.unique(np.concatenate([kinks, breaks[[0, -1]]]))
    clear = np.abs(t[:, None] - fixed).min(axis=1) > 0.4 * step
    return np.unique(np.concatenate([fixed, t[clear]]))


def _build_quintic_basis(t: Array, repeats: Array, *, closed: bool) -> Curve:
    """Return all quintic B-splines with knots t, all but the last repeated, as one curve; periodic ones if closed."""
    knots = t[:-1].repeat(repeats)
    if not closed:
        knots = np.concatenate([t[:1].repeat(6), knots[1:], t[-1:].repeat(6)])
        return Curve.from_bspline(5, knots, np.eye(len(knots) - 6))
    count, first = len(knots), int(repeats[0])
    index = np.arange(first - 6, count + 6)  # the domain starts at the last one of the first knots
    long = knots[index % count] + (t[-1] - t[0]) * (index // count)
    return Curve.from_bspline(5, long, np.eye(count)[np.arange(len(long) - 6) % count])


CHEBYSHEV_POINTS = 8  # Chebyshev points of a piece from which derivatives at its ends are taken; more only add rounding


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
    x = (1 - np.cos(np.pi * np.arange(CHEBYSHEV_POINTS) / (CHEBYSHEV_POINTS - 1))) / 2
    poles = np.linalg.inv(evaluate_basis(CHEBYSHEV_POINTS - 1, 1 - x, x).T)  # from values to Bernstein coefficients
    count = 16
    best: tuple[float, Curve] | None = None
    while True:
        t = np.linspace(*domain, count + 1)
        nodes = t[:-1] + x[:, None] * np.diff(t)
        coefs = np.einsum("pk,knd->pnd", poles, function(nodes.ravel()).reshape(CHEBYSHEV_POINTS, count, -1))
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
