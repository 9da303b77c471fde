"""Bounds of polynomials that their Bernstein coefficients prove, sharpened by subdivision.

A polynomial lies in the convex hull of its Bernstein coefficients, and the hull closes in on it quadratically under
subdivision. So a bound is sharpened by halving the pieces that it comes from, until a value nearby shows that there is
no more to gain: the end coefficients of every part are values. Rounding errors are added to the bounds. Depends on the
arithmetic of coefficients only.
"""

import numpy as np
from numpy.typing import NDArray

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
        Largest ratio of the bound that is larger in absolute value to a value that is taken.
    slack
        Error of the coefficients. It widens the interval, and bounds are not sharpened beyond it.

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
        unsettled = np.abs(f).max(axis=0) > max(ratio * taken, taken + slack)
        low = min(low, float(f[:, ~unsettled].min(initial=np.inf)))
        high = max(high, float(f[:, ~unsettled].max(initial=-np.inf)))
        f = _halve_pieces(f[:, unsettled])
        slack += rounding
    return low - slack, high + slack


def find_value_below(f: Array, floor: float) -> tuple[int, float] | None:
    """Find where a polynomial is below a floor, or prove that none is.

    Parameters
    ----------
    f
        (p+1, n) Bernstein coefficients.
    floor
        Values within rounding of the floor do not count as below it.

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
        unsettled = below.any(axis=0)
        f, width = _halve_pieces(f[:, unsettled]), width / 2
        piece, start = np.tile(piece[unsettled], 2), np.concatenate([start[unsettled], start[unsettled] + width])
        slack += rounding
    return None


def has_value_below(f: Array, floor: float, group: NDArray[np.intp], count: int) -> NDArray[np.bool_]:
    """Tell groups of polynomials of which one has a value below a floor from those of which none has.

    Parameters
    ----------
    f
        (p+1, n) Bernstein coefficients.
    floor
        Values within rounding of the floor do not count as below it.
    group
        (n,) index of the group that each belongs to.
    count
        Number of groups.

    Returns
    -------
    Array
        (count,) booleans.

    Examples
    --------
    >>> f = np.array([[1.0, 1.0], [-0.5, -2.0], [1.0, 1.0]])  # at least 0.25, and -0.5 in the middle
    >>> has_value_below(f, 0.0, np.array([0, 1]), 2)
    array([False,  True])
    """
    slack = rounding = _bound_halving_error(f) if f.size else 0.0
    found = np.zeros(count, dtype=bool)
    while f.size:
        below = f < floor - slack
        found[group[below[[0, -1]].any(axis=0)]] = True
        unsettled = below.any(axis=0) & ~found[group]
        f, group = _halve_pieces(f[:, unsettled]), np.tile(group[unsettled], 2)
        slack += rounding
    return found
