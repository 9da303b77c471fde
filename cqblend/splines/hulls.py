"""What the coefficients of functions prove about their values.

A polynomial lies in the convex hull of its Bernstein coefficients, and the hull closes in on it quadratically under
subdivision. So a bound is sharpened by halving the pieces that it comes from, until a value nearby shows that there is
no more to gain: the end coefficients of every part are values. Rounding is added to what is claimed. This module must
not know what the functions mean.
"""

import numpy as np

from cqblend.splines.bernstein import EPSILON, Array, restrict_pieces


def _halve_pieces(f: Array) -> Array:
    """Both halves of every column, (p+1, 2 n), the left ones first."""
    n = f.shape[1]
    return restrict_pieces(np.tile(f, 2), np.repeat([0.0, 0.5], n), np.repeat([0.5, 1.0], n))


def _bound_halving_error(f: Array) -> float:
    """By how much one halving may move a coefficient: two sweeps of averages."""
    return float(2 * len(f) * EPSILON * np.abs(f).max())


def enclose_values(f: Array, *, ratio: float = 1.1, slack: float = 0.0) -> tuple[float, float]:
    """Enclose the values of polynomials in an interval.

    Parameters
    ----------
    f
        (p+1, n) Bernstein coefficients of n pieces.
    ratio
        What the end that is larger in absolute value may be, relative to a value that is taken.
    slack
        By how much the coefficients may be off. It widens the interval, and nothing finer is looked for.

    Returns
    -------
    low, high
        low <= f <= high everywhere.

    Examples
    --------
    >>> low, high = enclose_values(np.array([[0.0], [1.0], [0.0]]))  # 2 x (1 - x); its hull is [0, 1]
    >>> bool(-1e-14 < low <= 0 and 0.5 <= high <= 0.55)
    True
    """
    rounding = _bound_halving_error(f)
    slack += rounding
    low, high, taken = np.inf, -np.inf, 0.0
    while f.size:
        taken = max(taken, float(np.abs(f[[0, -1]]).max()))
        open_ = np.abs(f).max(axis=0) > max(ratio * taken, taken + slack)
        low = min(low, float(f[:, ~open_].min(initial=np.inf)))
        high = max(high, float(f[:, ~open_].max(initial=-np.inf)))
        f = _halve_pieces(f[:, open_])
        slack += rounding
    return low - slack, high + slack


def find_value_below(f: Array, floor: float) -> tuple[int, float] | None:
    """Find where a polynomial is below a floor, or prove that none is.

    Parameters
    ----------
    f
        (p+1, n) Bernstein coefficients.
    floor
        The proof allows for rounding: a value that touches the floor is not below it.

    Returns
    -------
    (piece, x), or None
        Of the first part found with a value below the floor, the piece and the local parameter in [0, 1].

    Examples
    --------
    >>> find_value_below(np.array([[1.0], [-0.5], [1.0]]), 0.0)  # at least 0.25
    >>> find_value_below(np.array([[1.0], [-2.0], [1.0]]), 0.0)  # -0.5 in the middle
    (0, 0.5)
    """
    slack = rounding = _bound_halving_error(f)
    piece, start, width = np.arange(f.shape[1]), np.zeros(f.shape[1]), 1.0
    while f.size:
        below = f < floor - slack
        for end in (0, -1):
            if below[end].any():
                j = int(below[end].argmax())
                return int(piece[j]), float(start[j] - end * width)
        open_ = below.any(axis=0)
        f, width = _halve_pieces(f[:, open_]), width / 2
        piece, start = np.tile(piece[open_], 2), np.concatenate([start[open_], start[open_] + width])
        slack += rounding
    return None
