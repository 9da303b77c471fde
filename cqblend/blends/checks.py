"""What blends ask of numbers that they are given, and of fits that they make."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cqblend.errors import GeometryError, InputError, reason
from cqblend.splines.knots import to_float_array


class TooManySpansError(GeometryError):
    """A fit within a tolerance takes more spans than there may be.

    Attributes
    ----------
    finding : str
        What was found.
    """

    def __init__(self, finding: str, advice: str) -> None:
        super().__init__(f"{finding}: {advice}", kind="spans")
        self.finding = finding


def to_point(value: object) -> NDArray[np.float64] | None:
    """Return three finite numbers as an array (3,); None if the value is something else."""
    try:
        found = to_float_array("a point", value)
    except InputError:
        return None
    return found if found.shape == (3,) and np.isfinite(found).all() else None


def call_user_function(rule: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """Return what a function of the caller's gives; `rule` says what it should take and return.

    Raises
    ------
    InputError
        If the function raises; that is the cause.
    """
    try:
        return function(*arguments)
    except Exception as error:
        raise InputError(f"{rule}: {reason(error)}") from error
