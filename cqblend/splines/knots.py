"""Conversion of B-splines with full knot vectors to Bernstein pieces and back.

Inside the package splines are Bernstein pieces; knot vectors exist only here. Extraction is two triangular sweeps of
convex combinations over all spans at once, so it loses nothing. Re-assembly reads each pole as a blossom value of the
one piece that has to be extrapolated least, and keeps a knot more often than the known continuity asks for where
removing it would amplify rounding too much. Poles have any number of trailing axes; the last may be a weight.
"""

from functools import lru_cache

import numpy as np

from cqblend.argument_checks import check_integer, to_float_array
from cqblend.errors import GeometryError, InputError
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
    falls = knots[1:] < knots[:-1]
    if falls.any():
        i = int(np.argmax(falls))
        raise InputError(f"knots must not decrease: knot {i + 1} is {knots[i + 1]}, after {knots[i]}")
    if not knots[degree] < knots[count]:
        raise InputError(f"the domain from knot {degree} to knot {count} is empty, at {knots[degree]}")
    first = knots[: -degree - 1]
    repeated = first[(first == knots[degree + 1 :]) & (first > knots[degree]) & (first < knots[count])]
    if len(repeated):
        value = float(repeated[0])
        times = int((knots == value).sum())
        raise InputError(f"knot {value} is repeated {times} times, more than degree + 1 = {degree + 1}")
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
    spans = (knots[p : -p - 1] < knots[p + 1 : len(knots) - p]).nonzero()[0] + p
    around = knots[spans + _list_offsets(1 - p, 2 * p)] if p else knots[:0, None]  # (2p, m): p knots on both sides
    a, b = knots[spans], knots[spans + 1]
    d = poles[spans + _list_offsets(-p, p + 1)]  # (p+1, m, ..)
    d = np.ascontiguousarray(d.transpose(0, *range(2, d.ndim), 1))
    breaks = np.concatenate([a, b[-1:]])
    if len(spans) == 1 and is_clamped(p, knots):
        return breaks, d, np.empty(0, dtype=int)
    e = np.empty_like(d)
    wide = (slice(None), *(None,) * (d.ndim - 2))
    after = a - around[:p]
    for r in range(p):
        e[r] = d[-1]
        x = (after[r:] / (around[p : 2 * p - r] - around[r:p]))[wide]
        d = (1 - x) * d[:-1] + x * d[1:]
    e[p] = d[0]
    length, beyond = b - a, around[p + 1 :] - a
    for s in range(1, p):
        x = (length / beyond[p - s - 1 :: -1])[wide]
        e[: p - s] = x * e[: p - s] + (1 - x) * e[1 : p - s + 1]
    # e[r] = f[a^r, b^(p-r)]: the coefficients in descending order
    return breaks, np.ascontiguousarray(e[::-1]), p - (spans[1:] - spans[:-1])


@lru_cache(maxsize=256)
def _list_offsets(first: int, count: int) -> Array:
    """Whole numbers from the first, (count, 1); read-only."""
    offsets = np.arange(first, first + count)[:, None]
    offsets.flags.writeable = False
    return offsets


def _choose_pole_pieces(breaks: Array, degree: int, at: Array) -> tuple[Array, Array, Array]:
    """Find the best piece to read each pole from.

    Parameters
    ----------
    breaks
        (m + 1,).
    degree
        p.
    at
        (n + p + 1,) for each knot the break at which it is.

    Returns
    -------
    piece, far, factor
        (n,); the poles that no piece gives without extrapolation, since the knots of their window are at more than two
        neighbouring breaks; and by how much their extrapolation amplifies rounding.
    """
    p = degree
    n = len(at) - p - 1
    first, last = at[:n], at[p + 1 :] - 1
    start, end = at[1 : n + 1], at[p : n + p]  # of the window
    piece = np.minimum(np.where(end > start, start, np.maximum(first, start - 1)), last)
    far = (end - start > 1).nonzero()[0]
    if not len(far):
        return piece, far, np.empty(0)
    window = breaks[at[far + _list_offsets(1, p)]]
    first, last = first[far], last[far]
    best, least = first, np.full(len(far), np.inf)
    for offset in range(int((last - first).max()) + 1):
        tried = np.minimum(first + offset, last)
        low, high = breaks[tried], breaks[tried + 1]
        # 1 at the ends of the piece and beyond them 1 + 2 d, at a distance of d lengths of the piece
        distance = np.abs((window - (low + high) / 2) * (2 / (high - low)))
        factor = np.multiply.reduce(np.maximum(distance, 1.0))
        best = np.where(factor < least, tried, best)
        least = np.minimum(least, factor)
    piece[far] = best
    return piece, far, least


def _raise_multiplicities(inner: Array, at: Array, degree: int, bad: Array) -> Array:
    """Add one to the multiplicity of the interior breaks that have the least of those in the support of a bad pole."""
    before, after = at[bad], at[bad + degree + 1]
    crossed = before + _list_offsets(1, int((after - before).max()) - 1)
    inside = crossed < after
    repeats = np.where(inside, inner[np.minimum(crossed - 1, len(inner) - 1)], degree + 1)
    least = inside & (repeats == repeats.min(axis=0))
    raised = np.zeros(len(inner), dtype=int)
    raised[crossed[least] - 1] = 1
    return np.asarray(inner + raised)


def _extrapolate_poles(coefs: Array, piece: Array, x: Array) -> Array:
    """Blossoms (n, ..) of n of the pieces (p+1, .., m) at local arguments (p, n), of which few are neither 0 nor 1.

    Those that are choose coefficients; the rest follow, from the nearest to the farthest.
    """
    p, n = x.shape
    one = x == 1
    chosen = one | (x == 0)
    steps = p - int(np.add.reduce(chosen).min())
    order = np.maximum(-x, x - 1).argsort(axis=0, kind="stable")[p - steps :]
    pole = np.arange(n)
    arguments = np.where(chosen[order, pole], 0.0, x[order, pole])
    rows = np.minimum(np.add.reduce(one) + _list_offsets(0, steps + 1), p)
    picked = coefs[rows, ..., piece]  # (steps + 1, n, ..)
    values = evaluate_blossom(picked.transpose(0, *range(2, picked.ndim), 1), arguments)
    return values.transpose(-1, *range(values.ndim - 1))


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
    if len(breaks) == 2:  # the coefficients of a single piece are its poles
        return breaks.repeat(p + 1), coefs[..., 0].copy()
    ends = np.array([p + 1])
    inner = np.minimum(np.maximum(p - continuity, 0), p + 1)
    index = np.arange(len(breaks))
    while True:
        at = index.repeat(np.concatenate([ends, inner, ends]))
        piece, far, factor = _choose_pole_pieces(breaks, p, at)
        bad = far[factor > SPLINE_TOLERANCES.amplification]
        if not len(bad):
            break
        inner = _raise_multiplicities(inner, at, p, bad)
    # knots of each pole's window at the end of its piece: so many arguments of the blossom are one
    pole = np.arange(len(piece))
    before = at.searchsorted(np.arange(len(breaks) + 1))
    low, high = pole + 1, pole + p + 1
    ones = np.minimum(np.maximum(before[piece + 2], low), high) - np.minimum(np.maximum(before[piece + 1], low), high)
    poles = coefs.transpose(-1, *range(coefs.ndim - 1))[piece, ones]
    if len(far):
        read = piece[far]
        start = breaks[read]
        x = (breaks[at[far + _list_offsets(1, p)]] - start) / (breaks[read + 1] - start)
        poles[far] = _extrapolate_poles(coefs, read, x)
    return breaks[at], poles


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


def to_euclidean(homogeneous: Array) -> tuple[Array, Array]:
    """Poles (.., dim) and weights (..) of homogeneous poles (.., dim + 1).

    Raises
    ------
    GeometryError
        If a weight is not positive.
    """
    weights = homogeneous[..., -1]
    if weights.min() <= 0:
        raise GeometryError(f"a pole has the weight {weights.min():.3g}, which no B-spline may have; clip or cut first")
    return homogeneous[..., :-1] / weights[..., None], weights


def is_clamped(degree: int, knots: Array) -> bool:
    """Whether the first and the last degree + 1 knots coincide."""
    return bool(knots[0] == knots[degree] and knots[-1] == knots[-degree - 1])
