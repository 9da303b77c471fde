"""What blends ask of numbers that they are given, and of fits that they make."""

from numbers import Real

import numpy as np
from numpy.typing import NDArray

from cqblend.errors import GeometryError, InputError, shown


class TooFine(GeometryError):
    """A fit within a tolerance takes more spans than there may be."""


def as_point(value: object) -> NDArray[np.float64] | None:
    """Return three finite numbers as an array (3,); None if the value is something else."""
    try:
        found = np.array(value, dtype=np.float64)
    except (TypeError, ValueError):
        return None
    return found if found.shape == (3,) and np.isfinite(found).all() else None


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
