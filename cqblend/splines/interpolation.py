"""Curves through given values or derivatives: smooth spline interpolants and local Hermite interpolants.

Both are piecewise Hermite forms: a linear system for the unknown derivatives, then Bernstein coefficients.
Depends on curves only.
"""

from functools import lru_cache
from math import comb, factorial

import numpy as np
from numpy.typing import ArrayLike

from cqblend.errors import InputError
from cqblend.splines.bernstein import Array
from cqblend.splines.curve import Curve
from cqblend.splines.tolerances import SPLINE_TOLERANCES


@lru_cache(maxsize=32)
def tabulate_hermite_basis(k: int) -> Array:
    """Bernstein coefficients (2k+2, 2, k+1) of degree 2k+1 from derivatives 0..k at both ends of the unit interval."""
    p = 2 * k + 1
    table = np.zeros((p + 1, 2, k + 1))
    for i in range(k + 1):
        for r in range(i + 1):
            # c_i = sum_r C(i, r) (p - r)!/p! f^(r)(0), mirrored with alternating signs at the other end
            weight = comb(i, r) * factorial(p - r) / factorial(p)
            table[i, 0, r] = weight
            table[p - i, 1, r] = (-1) ** r * weight
    table.setflags(write=False)
    return table


@lru_cache(maxsize=32)
def _tabulate_end_derivatives(k: int) -> Array:
    """Tabulate derivatives 0..p of the unit-interval Hermite form, (2 ends, p+1, 2 ends of data, k+1)."""
    table = tabulate_hermite_basis(k)
    p = len(table) - 1
    out = np.zeros((2, p + 1, 2, k + 1))
    for r in range(p + 1):
        difference = np.diff(table, n=r, axis=0) * (factorial(p) / factorial(p - r))
        out[0, r], out[1, r] = difference[0], difference[-1]
    out.setflags(write=False)
    return out


def check_parameters(t: ArrayLike) -> Array:
    """Return the parameters of data as an array: at least two, finite, strictly increasing."""
    breaks = np.array(t, dtype=np.float64)
    if breaks.ndim != 1 or len(breaks) < 2 or not np.isfinite(breaks).all() or (breaks[1:] <= breaks[:-1]).any():
        raise InputError("interpolation needs at least two finite, strictly increasing parameters")
    return breaks


def _pair_ends(jets: Array) -> Array:
    """Return derivatives at the start and at the end of each piece, (k+1, n, 2, dim), from those at the breaks."""
    out = np.empty((len(jets), jets.shape[1] - 1, 2, jets.shape[2]))
    out[:, :, 0], out[:, :, 1] = jets[:, :-1], jets[:, 1:]
    return out


def hermite(t: ArrayLike, jets: ArrayLike) -> Curve:
    """Piecewise Hermite interpolant of degree 2k + 1, of continuity k.

    Parameters
    ----------
    t
        (n + 1,) strictly increasing.
    jets
        Values and derivatives 0 .. k at the breaks, (k + 1, n + 1, dim); or separately for the start and the end of
        every piece, (k + 1, n, 2, dim), with the continuity that follows from the data: the number of leading
        derivatives that agree exactly, less one.

    Raises
    ------
    InputError
        On shapes that do not fit.

    Examples
    --------
    >>> hermite([0, 1], [[[0.0], [1.0]], [[1.0], [1.0]]])(0.25)
    array([0.25])
    """
    breaks = check_parameters(t)
    data = np.array(jets, dtype=np.float64)
    n = len(breaks) - 1
    if data.ndim == 3 and data.shape[1] == n + 1:
        data = _pair_ends(data)
    if data.ndim != 4 or data.shape[1:3] != (n, 2) or not len(data) or not data.shape[3]:
        raise InputError(
            f"jets of shape {data.shape} for {n + 1} parameters, expected (k+1, {n + 1}, dim) or (k+1, {n}, 2, dim)"
        )
    if not np.isfinite(data).all():
        raise InputError("a value or derivative to interpolate is not finite")
    agree = np.logical_and.reduce(data[:, :-1, 1] == data[:, 1:, 0], axis=-1)
    order = np.add.reduce(np.logical_and.accumulate(agree), dtype=int) - 1
    return Curve._from_pieces((breaks,), _form_hermite_coefs(breaks, data), False, (order,))


def _form_hermite_coefs(breaks: Array, jets: Array) -> Array:
    """Bernstein coefficients (2k+2, dim, n) from derivatives 0..k at the start and the end of each piece.

    Parameters
    ----------
    breaks
        (n + 1,).
    jets
        (k+1, n, 2, dim).
    """
    length = breaks[1:] - breaks[:-1]
    factors = np.empty((len(jets), len(length)))
    factors[0] = 1.0
    for r in range(1, len(jets)):
        np.multiply(factors[r - 1], length, out=factors[r])
    k, n, _, dim = jets.shape
    scaled = np.empty((2, k, n, dim))
    np.multiply(jets.transpose(2, 0, 1, 3), factors[..., None], out=scaled)
    table = tabulate_hermite_basis(k - 1).reshape(2 * k, 2 * k)
    return (table @ scaled.reshape(2 * k, n * dim)).reshape(2 * k, n, dim).transpose(0, 2, 1)


def interpolate(
    t: ArrayLike,
    values: ArrayLike,
    *,
    degree: int = 3,
    periodic: bool = False,
    sign: int = 1,
    derivatives: ArrayLike | tuple[ArrayLike | None, ArrayLike | None] | None = None,
) -> Curve:
    """Spline of odd degree 2k + 1 and continuity 2k through values at its breaks.

    The unknowns are the derivatives 1 .. k at the breaks; the equations say that derivatives k+1 .. 2k do not jump.

    Parameters
    ----------
    t
        (n + 1,) strictly increasing.
    values
        (n + 1, dim).
    degree
        1, 3 (C2) or 5 (C4). Cubics are exact to rounding at any spacing; quintics lose digits where neighbouring steps
        differ much (2e-11 of the values at 1 : 50).
    periodic
        Match all derivatives up to 2k at the two ends; the values may differ by a shift. Otherwise the ends are
        not-a-knot (derivative 2k + 1 does not jump either at the outermost k interior breaks) or given.
    sign
        -1 with `periodic` for a function that returns with the opposite sign: derivatives match up to that sign, and so
        must the values.
    derivatives
        Derivatives 1 .. k at both ends, (k, 2, dim); for a cubic also one slope (dim,) for each end, None for an end
        that is not-a-knot. None if both are.

    Returns
    -------
    Curve
        With break points t and continuity 2k.

    Raises
    ------
    InputError
        On shapes that do not fit, fewer than 2k + 2 points for not-a-knot ends, or values that contradict `sign`.

    Examples
    --------
    >>> t = np.linspace(0, 2, 5)
    >>> bool(abs(interpolate(t, t[:, None] ** 3)(1.3) - 1.3**3).max() < 1e-14)
    True
    """
    breaks = check_parameters(t)
    data = np.array(values, dtype=np.float64)
    n = len(breaks) - 1
    if data.ndim != 2 or len(data) != n + 1 or not data.shape[1] or not np.isfinite(data).all():
        raise InputError(f"values of shape {data.shape} for {n + 1} parameters, expected finite ({n + 1}, dim)")
    if degree not in (1, 3, 5):
        raise InputError(f"interpolation of degree {degree}: choose 1, 3 or 5")
    if sign not in (1, -1) or (sign == -1 and not periodic):
        raise InputError(f"sign={sign}: it is 1, or -1 together with periodic=True")
    if sign == -1 and np.abs(data[0] + data[-1]).max() > SPLINE_TOLERANCES.antiperiodic_gap * np.abs(data).max():
        raise InputError(f"antiperiodic values must return with the opposite sign, not from {data[0]} to {data[-1]}")
    k = (degree - 1) // 2
    jets = np.concatenate([data[None], np.zeros((k, n + 1, data.shape[1]))])
    if k:
        ends = _read_end_derivatives(derivatives, data.shape[1])
        counts = [len(end) for end in ends if end is not None]
        if counts and (set(counts) != {k} or periodic):
            raise InputError(f"{counts[0]} derivatives at the ends: degree {degree} takes {k}, and periodic ends none")
        least = degree + 1 - k * len(counts)
        if not periodic and n + 1 < least:
            raise InputError(f"{n + 1} points are too few for not-a-knot ends of degree {degree}: give {least}")
        lengths = breaks[1:] - breaks[:-1]
        if k == 1:
            jets[1] = _solve_slopes(lengths, data, sign if periodic else None, ends)
        else:
            jets[1:] = _solve_break_derivatives(lengths, data, k, periodic, sign, ends)
    coefs = _form_hermite_coefs(breaks, _pair_ends(jets))
    return Curve._from_pieces((breaks,), coefs, False, (np.full(n - 1, 2 * k),))


_EndDerivatives = tuple[Array | None, Array | None]
"""Derivatives 1 .. k at the first and at the last break, (k, dim) each; None where the end is not-a-knot."""


def _read_end_derivatives(
    derivatives: ArrayLike | tuple[ArrayLike | None, ArrayLike | None] | None, dim: int
) -> _EndDerivatives:
    if derivatives is None:
        return None, None
    if isinstance(derivatives, tuple) and len(derivatives) == 2 and any(end is None for end in derivatives):
        first, last = (None if end is None else np.array(end, dtype=np.float64).reshape(1, dim) for end in derivatives)
        return first, last
    given = np.array(derivatives, dtype=np.float64).reshape(-1, 2, dim)
    return given[:, 0], given[:, 1]


def _solve_slopes(lengths: Array, values: Array, sign: int | None, ends: _EndDerivatives) -> Array:
    """Solve for the slopes at all breaks, (n+1, dim), that make a cubic Hermite form C2.

    Parameters
    ----------
    lengths
        (n,) lengths of the pieces.
    values
        (n + 1, dim) at the breaks.
    sign
        What a periodic function returns times; None if it is not periodic.
    ends
        The slopes (1, dim) at both ends; None for not-a-knot, or periodic.
    """
    n, dim = len(lengths), values.shape[1]
    chord = (values[1:] - values[:-1]) / lengths[:, None]
    if sign is not None:
        before, slope = np.append(lengths[-1:], lengths[:-1]), np.concatenate([sign * chord[-1:], chord])
    else:
        before, slope = lengths[:-1], chord
    after = lengths if sign is not None else lengths[1:]
    both = before + after
    low, up = after / both, before / both
    inner = 3 * (low[:, None] * slope[:-1] + up[:, None] * slope[1:])
    if sign is not None:
        low[0] *= sign
        up[-1] *= sign
        found = solve_cyclic_tridiagonal(low, np.full(n, 2.0), up, inner)
        return np.concatenate([found, sign * found[:1]])
    diagonals = np.zeros((3, n + 1))
    diagonals[0, 1:-1], diagonals[1, 1:-1], diagonals[2, 1:-1] = low, 2.0, up
    right = np.empty((n + 1, dim))
    right[1:-1] = inner
    first, last = ends
    diagonals[1, [0, -1]] = 1.0
    if first is not None:
        right[:1] = first
    else:  # one cubic over the first two pieces
        diagonals[1, 0], diagonals[2, 0] = low[0], 1.0
        right[0] = ((2 + up[0]) * low[0]) * chord[0] + up[0] ** 2 * chord[1]
    if last is not None:
        right[-1:] = last
    else:
        diagonals[1, -1], diagonals[0, -1] = up[-1], 1.0
        right[-1] = low[-1] ** 2 * chord[-2] + ((2 + low[-1]) * up[-1]) * chord[-1]
    return solve_cyclic_tridiagonal(diagonals[0], diagonals[1], diagonals[2], right)


def solve_cyclic_tridiagonal(low: Array, middle: Array, up: Array, right: Array) -> Array:
    """Solve n equations low x[i-1] + middle x[i] + up x[i+1] = right, indices modulo n, by parallel cyclic reduction.

    Sweeps over whole columns, each of which doubles the distance between coupled rows and squares their coupling. A
    dense solver takes longer, and many times longer where its threads compete for the processor.

    Parameters
    ----------
    low, middle, up
        (n,). In all rows but the first and the last, `middle` outweighs the others; if there they are zero outside the
        matrix, it need not.
    right
        (n, dim).
    """
    n = len(middle)
    twice = np.concatenate([np.arange(n)] * 2)
    rows = np.concatenate([up[None], right.T, low[None]])
    step = 1
    while True:
        shift = step % n
        back, ahead = twice[n - shift : 2 * n - shift], twice[shift : n + shift]
        from_back = rows.take(back, axis=1) * (rows[-1] / middle[back])
        from_ahead = rows.take(ahead, axis=1) * (rows[0] / middle[ahead])
        middle = middle - from_back[0] - from_ahead[-1]
        rows[1:-1] -= from_back[1:-1] + from_ahead[1:-1]
        np.negative(from_ahead[0], out=rows[0])
        np.negative(from_back[-1], out=rows[-1])
        step *= 2
        if step >= min(n, _FEWEST_SWEPT_ROWS):
            coupling = np.maximum(np.abs(rows[0]), np.abs(rows[-1]))
            if (coupling <= SPLINE_TOLERANCES.coupling * np.abs(middle)).all():
                return np.asarray((rows[1:-1] / middle).T)


_FEWEST_SWEPT_ROWS = 32
"""Distance of coupled rows from which on their coupling may be below rounding: 0.27^32 at even spacing."""


def _solve_break_derivatives(
    lengths: Array, values: Array, k: int, periodic: bool, sign: int, ends: _EndDerivatives
) -> Array:
    """Solve for the derivatives 1..k at all breaks, (k, n+1, dim), that make the Hermite form C^2k.

    Parameters
    ----------
    lengths
        (n,) lengths of the pieces.
    values
        (n + 1, dim) at the breaks.
    k, periodic, sign
        As for :func:`interpolate`.
    ends
        Derivatives 1..k at both ends, (k, dim); None for not-a-knot, or periodic.
    """
    n, dim = len(lengths), values.shape[1]
    table = _tabulate_end_derivatives(k)
    # unknowns and equations of comparable size: f^(m) at a break times the m-th power of a length there
    around = np.concatenate([lengths[-1:], lengths, lengths[:1]] if periodic else [lengths[:1], lengths, lengths[-1:]])
    size = np.sqrt(around[:-1] * around[1:])
    powers = np.arange(1, k + 1)
    # derivative r of piece j at end e: sum over its data end d and order m of table[e, r, d, m] h^(m-r) f^(m)
    sizes = np.stack([size[:-1], size[1:]], axis=1)
    high = (sizes / lengths[:, None])[:, :, None] ** np.arange(2 * k + 2)  # (n, 2, p+1)
    low = (lengths[:, None] / sizes)[:, :, None] ** np.arange(k + 1)  # (n, 2, k+1)
    piece = table[None] * high[:, :, :, None, None] * low[:, None, None]  # (n, 2, p+1, 2, k+1)
    columns = np.arange((n + 1) * k).reshape(n + 1, k)
    matrix = np.zeros(((n + 1) * k, (n + 1) * k))
    right = np.zeros(((n + 1) * k, dim))
    chord = np.diff(values, axis=0)

    def add_smoothness_rows(rows: Array, left: Array, after: Array, orders: slice, factor: float = 1.0) -> None:
        """Write equations: derivatives where pieces `left` end, times a factor, are those where pieces `after` start.

        The factor is -1 at the seam of a function that returns with the opposite sign.
        """
        for sense, index, end in ((1.0, after, 0), (-factor, left, 1)):
            for data_end in (0, 1):
                block = sense * piece[index, end, orders, data_end, 1:]
                matrix[rows[:, :, None], columns[index + data_end][:, None, :]] += block
            right[rows] -= sense * piece[index, end, orders, 1, 0][..., None] * chord[index][:, None, :]

    inner = np.arange(1, n)
    add_smoothness_rows(columns[1:n], inner - 1, inner, slice(k + 1, 2 * k + 1))
    if periodic:
        last, first = np.array([n - 1]), np.array([0])
        add_smoothness_rows(columns[:1], last, first, slice(k + 1, 2 * k + 1), sign)
        matrix[columns[n], columns[n]], matrix[columns[n], columns[0]] = 1.0, -sign
    else:
        outer = np.arange(k)
        for node, given, left in ((0, ends[0], outer), (n, ends[1], n - 2 - outer)):
            if given is None:
                add_smoothness_rows(columns[node][:, None], left, left + 1, slice(2 * k + 1, 2 * k + 2))
            else:
                matrix[columns[node], columns[node]] = 1.0
                right[columns[node]] = given * (size[node] ** powers)[:, None]
    solution = np.linalg.solve(matrix, right).reshape(n + 1, k, dim)
    return np.asarray(np.swapaxes(solution / (size[:, None] ** powers)[..., None], 0, 1))
