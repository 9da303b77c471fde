"""Conversion of B-splines with full knot vectors to Bernstein pieces and back.

Inside the package splines are Bernstein pieces; knot vectors exist only here. Extraction is two triangular sweeps of
convex combinations over all spans at once, so it loses nothing. Re-assembly reads each pole as a blossom value of the
one piece that has to be extrapolated least, and keeps a knot more often than the known continuity asks for where
removing it would amplify rounding too much. Poles have any number of trailing axes; the last may be a weight.
"""

import numpy as np

from cqblend.argument_checks import check_integer, to_float_array
from cqblend.errors import InputError
from cqblend.splines.bernstein import Array, evaluate_blossom
from cqblend.splines.tolerances import SPLINE_LIMITS, SPLINE_TOLERANCES

SMOOTH = 1 << 20
"""Continuity order of a break at which both pieces are the same polynomial, so that it can be removed."""


def check_knot_vector(degree: object, knots: Array, count: int) -> int:
    """Check a full knot vector for `count` poles, and return the degree.

    Raises
    ------
    InputError
        If the degree is no whole number or negative, the number of knots is not count + degree + 1, a knot is not
        finite or smaller than its predecessor, a knot inside the domain is repeated more than degree + 1 times, or the
        domain is empty.
    """
    degree = check_integer("the degree", degree, 0, SPLINE_LIMITS.bspline_degree)
    if knots.ndim != 1 or len(knots) != count + degree + 1:
        raise InputError(
            f"{np.size(knots)} knots for {count} poles of degree {degree}: a full knot vector has {count + degree + 1}"
        )
    if count < degree + 1:
        raise InputError(f"{count} poles are too few for degree {degree}: give at least {degree + 1}")
    if not np.isfinite(knots).all():
        raise InputError("a knot is not a finite number")
    if (np.diff(knots) < 0).any():
        i = int(np.argmax(np.diff(knots) < 0))
        raise InputError(f"knots must not decrease: knot {i + 1} is {knots[i + 1]}, after {knots[i]}")
    if not knots[degree] < knots[count]:
        raise InputError(f"the domain from knot {degree} to knot {count} is empty, at {knots[degree]}")
    inside = knots[(knots > knots[degree]) & (knots < knots[count])]
    values, repeats = np.unique(inside, return_counts=True)
    if (repeats > degree + 1).any():
        i = int(np.argmax(repeats))
        raise InputError(f"knot {values[i]} is repeated {repeats[i]} times, more than degree + 1 = {degree + 1}")
    return degree


def extract_pieces(degree: int, knots: Array, poles: Array) -> tuple[Array, Array, Array]:
    """Bernstein pieces of a B-spline.

    For each span [a, b] the first sweep (de Boor at a) leaves the blossom values f[a^r, b, ..], the second replaces the
    remaining outer knots by b.

    Parameters
    ----------
    degree
        p.
    knots
        Full knot vector (n + p + 1,); the domain is knots[p] .. knots[n], clamped or not.
    poles
        (n, ..).

    Returns
    -------
    breaks, coefs, continuity
        (m + 1,), (p + 1, .., m) and the order of continuity p - multiplicity at each of the m - 1 interior breaks.

    Examples
    --------
    >>> breaks, coefs, continuity = extract_pieces(1, np.array([0.0, 0.0, 1.0, 2.0, 2.0]), np.array([0.0, 5.0, 6.0]))
    >>> coefs
    array([[0., 5.],
           [5., 6.]])
    >>> continuity
    array([0])
    """
    p = degree
    spans = p + np.flatnonzero(knots[p : -p - 1] < knots[p + 1 : len(knots) - p])
    a, b = knots[spans], knots[spans + 1]
    d = np.moveaxis(poles[spans - p + np.arange(p + 1)[:, None]], 1, -1)  # (p+1, .., m)
    e = np.empty_like(d)
    for r in range(p):
        e[r] = d[-1]
        i = np.arange(p - r)[:, None]
        left, right = knots[spans - p + r + 1 + i], knots[spans + 1 + i]
        x = _insert_axes((a - left) / (right - left), d.ndim)
        d = (1 - x) * d[:-1] + x * d[1:]
    e[p] = d[0]
    for s in range(1, p):
        i = np.arange(p - s)[:, None]
        outer = knots[spans + p - i - s + 1]
        x = _insert_axes((b - a) / (outer - a), d.ndim)
        e[: p - s] = x * e[: p - s] + (1 - x) * e[1 : p - s + 1]
    # e[r] = f[a^r, b^(p-r)]: the coefficients in descending order
    breaks = np.append(a, b[-1])
    first = np.searchsorted(knots, breaks[1:-1], "left")
    last = np.searchsorted(knots, breaks[1:-1], "right")
    return breaks, np.ascontiguousarray(e[::-1]), p - (last - first)


def _insert_axes(x: Array, ndim: int) -> Array:
    """Insert axes between the first and the last of x so that it broadcasts against an array of `ndim` axes."""
    return x.reshape(x.shape[0], *(1,) * (ndim - 2), x.shape[1])


def _choose_pole_pieces(breaks: Array, degree: int, repeats: Array) -> tuple[Array, Array, Array, Array]:
    """Find the full knot vector, each pole's knot window (p, n), the best piece to read it from, its amplification."""
    p = degree
    at = np.repeat(np.arange(len(breaks)), repeats)
    knots = breaks[at]
    n = len(knots) - p - 1
    window = knots[np.arange(1, p + 1)[:, None] + np.arange(n)]
    first, last = at[:n], at[p + 1 :] - 1
    best = first
    least = np.full(n, np.inf)
    for offset in range(int((last - first).max()) + 1):
        piece = np.minimum(first + offset, last)
        lo, hi = breaks[piece], breaks[piece + 1]
        outside = np.maximum(np.maximum(lo - window, window - hi), 0)
        factor = np.prod(1 + 2 * outside / (hi - lo), axis=0)
        best = np.where(factor < least, piece, best)
        least = np.minimum(least, factor)
    return knots, window, best, least


def assemble_bspline(breaks: Array, coefs: Array, continuity: Array) -> tuple[Array, Array]:
    """Clamped B-spline of Bernstein pieces.

    Each pole is the blossom of a piece in its support at the pole's knot window; of those pieces the one is read whose
    extrapolation amplifies rounding least. Up to C1 joints no arithmetic is done at all: the poles are coefficients. C2
    joints amplify by 3 at most, whatever the lengths of the pieces. Where the factor exceeds 50 (high
    degree and high continuity: a B-spline basis has condition 2^p) knots are kept with a higher multiplicity.

    Parameters
    ----------
    breaks
        (m + 1,).
    coefs
        (p + 1, .., m).
    continuity
        (m - 1,) order of continuity at the interior breaks; -1 where the pieces do not meet, `SMOOTH` where the break
        can go.

    Returns
    -------
    knots, poles
        Full clamped knot vector, and (n, ..).

    Examples
    --------
    >>> assemble_bspline(np.array([0.0, 1.0, 2.0]), np.array([[0.0, 5.0], [5.0, 6.0]]), np.array([0]))
    (array([0., 0., 1., 2., 2.]), array([0., 5., 6.]))
    """
    p = len(coefs) - 1
    ends = np.array([p + 1])
    inner = np.clip(p - continuity, 0, p + 1).astype(int)
    while True:
        knots, window, piece, factor = _choose_pole_pieces(breaks, p, np.concatenate([ends, inner, ends]))
        bad = np.flatnonzero(factor > SPLINE_TOLERANCES.amplification)
        if not len(bad):
            break
        raise_at = np.zeros(len(inner), dtype=bool)
        for i in bad:
            crossed = np.flatnonzero((breaks[1:-1] > knots[i]) & (breaks[1:-1] < knots[i + p + 1]))
            raise_at[crossed[inner[crossed] == inner[crossed].min()]] = True
        inner = inner + raise_at
    lo, hi = breaks[piece], breaks[piece + 1]
    x = (window - lo) / (hi - lo)
    poles = np.moveaxis(coefs, -1, 0)[piece, (x == 1).sum(axis=0)] if coefs.ndim else coefs
    inexact = np.flatnonzero(((x != 0) & (x != 1)).any(axis=0))
    if len(inexact):
        x = x[:, inexact]
        order = np.argsort(np.maximum(-x, x - 1), axis=0, kind="stable")
        values = evaluate_blossom(coefs[..., piece[inexact]], np.take_along_axis(x, order, axis=0))
        poles[inexact] = np.moveaxis(values, -1, 0)
    return knots, poles


def to_homogeneous(poles: Array, weights: object) -> Array:
    """Poles (.., dim) with weights (..) as homogeneous poles (.., dim + 1); without weights as they are.

    Raises
    ------
    InputError
        If the shapes differ, a number is not finite, or a weight is not positive.
    """
    if not np.isfinite(poles).all():
        raise InputError("a pole is not finite")
    if weights is None:
        return poles
    array = to_float_array("weights", weights)
    if array.shape != poles.shape[:-1]:
        raise InputError(f"weights of shape {array.shape} for poles of shape {poles.shape}")
    if not np.isfinite(array).all() or array.min() <= 0:
        raise InputError(f"weights must be finite and positive; the least is {array.min()}")
    with np.errstate(over="ignore"):
        made = np.concatenate([poles * array[..., None], array[..., None]], axis=-1)
    if not np.isfinite(made).all():
        raise InputError("a pole times its weight is beyond the range of doubles")
    return made


def is_clamped(degree: int, knots: Array) -> bool:
    """Whether the first and the last degree + 1 knots coincide."""
    return bool(knots[0] == knots[degree] and knots[-1] == knots[-degree - 1])
