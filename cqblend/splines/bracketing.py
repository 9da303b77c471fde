"""Places where a function of one variable changes sign or a condition ends, between two where it is known.

Regula falsi for continuous functions whose values mean something, bisection where only a yes or no is known. Depends on
NumPy only.
"""

from collections.abc import Callable

import numpy as np

from cqblend.splines.bernstein import Array


def solve_in_brackets(
    function: Callable[[Array], Array],
    ends: tuple[Array, Array],
    values: tuple[Array, Array],
    tolerance: Array | float,
    steps: int = 60,
) -> Array:
    """Find a zero of a continuous function in each of n intervals, by regula falsi in the Illinois variant.

    Every step takes the zero of the chord. The value at an end that stays while the other end moves twice is halved, so
    that no end stays for long.

    Parameters
    ----------
    function
        Vectorised, (n,) to (n,): the value for each interval at one place in it.
    ends, values
        Pairs of (n,): both ends of the intervals, in either order, and the function there, of opposite signs or zero.
    tolerance
        Absolute value that counts as zero, a number or (n,).
    steps
        Largest number of steps.

    Returns
    -------
    Array
        (n,). Where the tolerance is not reached, the last place tried.

    Examples
    --------
    >>> square = lambda x: x**2 - np.array([2.0, 9.0])
    >>> low, high = np.array([1.0, 2.0]), np.array([2.0, 5.0])
    >>> solve_in_brackets(square, (low, high), (square(low), square(high)), 1e-14).round(12)
    array([1.41421356, 3.        ])
    """
    (low, high), (value_low, value_high) = ends, values
    x, moved = low, np.zeros(len(low), dtype=int)  # -1 or 1: the end that moved in the last step
    for _ in range(steps):
        rise = value_high - value_low
        chord = (low * value_high - high * value_low) / np.where(rise == 0, 1.0, rise)
        x = np.clip(np.where(rise == 0, low, chord), np.minimum(low, high), np.maximum(low, high))
        value = function(x)
        ahead = value * value_low > 0  # the zero is between x and high
        low, high = np.where(ahead, x, low), np.where(ahead, high, x)
        value_low, value_high = (
            np.where(ahead, value, np.where(moved == 1, value_low / 2, value_low)),
            np.where(ahead, np.where(moved == -1, value_high / 2, value_high), value),
        )
        moved = np.where(ahead, -1, 1)
        if ((np.abs(value) <= tolerance) | (np.abs(high - low) <= np.spacing(np.abs(x)))).all():
            break
    return x


def bisect_intervals(
    is_before: Callable[[Array], Array], low: Array, high: Array, steps: int = 60
) -> tuple[Array, Array]:
    """Halve intervals around the places up to which a condition holds.

    Parameters
    ----------
    is_before
        Vectorised, (n,) to (n,) booleans: whether the condition holds at one place in each interval.
    low, high
        (n,) ends of the intervals: at the low ones it holds, at the high ones it does not.
    steps
        Number of halvings.

    Returns
    -------
    low, high
        (n,) each, nearer to each other.

    Examples
    --------
    >>> low, high = bisect_intervals(lambda x: x**2 < [2.0, 9.0], np.zeros(2), np.full(2, 5.0))
    >>> low.round(12)
    array([1.41421356, 3.        ])
    """
    for _ in range(steps if np.size(low) else 0):
        middle = (low + high) / 2
        before = is_before(middle)
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    return low, high


def bisect_interval(
    is_before: Callable[[float], bool], low: float, high: float, steps: int = 2000
) -> tuple[float, float]:
    """Halve one interval around the place up to which a condition holds, as long as there are numbers between its ends.

    Parameters
    ----------
    is_before
        Whether the condition holds at a place: it does at ``low``, and not at ``high``, on whichever side that is.
    low, high
        Ends of the interval.
    steps
        Largest number of halvings.

    Returns
    -------
    low, high
        The last place found at which the condition holds, and the last at which it does not.

    Examples
    --------
    >>> bisect_interval(lambda x: x <= 0.3, 0.0, 1.0, steps=3)
    (0.25, 0.375)
    """
    for _ in range(steps):
        middle = (low + high) / 2
        if middle in (low, high):
            break
        low, high = (middle, high) if is_before(middle) else (low, middle)
    return low, high
