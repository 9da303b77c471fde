"""Checks of the numbers a caller gives.

Exists so that lengths are refused in one way and in the same words. Must not know what they are for.
"""

import math
from numbers import Real

from cqblend.errors import InputError, shown


def millimetres(name: str, value: object, *, zero: bool = False) -> float:
    """Return a finite length above 0 (or 0, if that is allowed) as a float. A bool is no length.

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
        number = float(value)
        if math.isfinite(number) and (number > 0 or (zero and number == 0)):
            return number
    raise InputError(f"{name} is {'0 or ' if zero else ''}a positive number of mm, not {shown(value)}")
