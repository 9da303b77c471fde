"""Checks of the numbers a caller gives.

Exists so that lengths are refused in one way and in the same words. Must not know what they are for.
"""

import math
from numbers import Real

from cqblend.errors import InputError, shown

LEAST_LENGTH, MOST_LENGTH = 1e-9, 1e6
"""What makes sense on flat stock, mm: an atom, and a kilometre."""


def check_millimetres(name: str, value: object, *, zero: bool = False) -> float:
    """Return a length from `LEAST` to `MOST` (or 0, if that is allowed) as a float. A bool is no length.

    Raises
    ------
    InputError
        If it is anything else.

    Examples
    --------
    >>> millimetres("the width of a tab", 5)
    5.0
    """
    if not isinstance(value, bool) and isinstance(value, Real):
        try:
            number = float(value)
        except OverflowError:
            number = math.inf
        if LEAST_LENGTH <= number <= MOST_LENGTH or (zero and number == 0):
            return number
        if math.isfinite(number) and number > 0:
            raise InputError(
                f"{name} is a positive number of mm, from {LEAST_LENGTH:g} to {MOST_LENGTH:g}, not {shown(value)}"
            )
    raise InputError(f"{name} is {'0 or ' if zero else ''}a positive number of mm, not {shown(value)}")
