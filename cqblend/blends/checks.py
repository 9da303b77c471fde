"""What blends ask of numbers that they are given, and of fits that they make."""

from numbers import Real

import numpy as np

from cqblend.errors import GeometryError, InputError, shown


class TooFine(GeometryError):
    """A fit within a tolerance takes more spans than there may be."""


def number(name: str, value: object) -> float:
    """Return a finite number as a float. A bool is no number.

    Raises
    ------
    InputError
        If it is none.
    """
    try:
        found = float("nan") if isinstance(value, bool) or not isinstance(value, Real) else float(value)
    except OverflowError:
        found = float("inf")
    if not np.isfinite(found):
        raise InputError(f"{name} must be a finite number, not {shown(value)}")
    return found
