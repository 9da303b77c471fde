"""OCCT as the witness of formulas: where they have been compared with it, and how it fails to evaluate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from OCP.Geom import Geom_UndefinedDerivative, Geom_UndefinedValue
from OCP.Standard import (
    Standard_ConstructionError,
    Standard_DomainError,
    Standard_Failure,
    Standard_NullValue,
    Standard_NumericError,
    Standard_OutOfRange,
    Standard_RangeError,
)

from cqblend.brep.measurement.tolerances import MEASURE_TOLERANCES
from cqblend.splines.bernstein import Array

EVALUATION_FAILURES = (
    Geom_UndefinedDerivative,
    Geom_UndefinedValue,
    Standard_ConstructionError,
    Standard_DomainError,
    Standard_Failure,
    Standard_NullValue,
    Standard_NumericError,
    Standard_OutOfRange,
    Standard_RangeError,
)
"""What OCCT raises where it cannot evaluate a curve or a surface; in Python they are no ``Standard_Failure``."""


class WitnessedRange:
    """The box of parameters, of one or two coordinates, within which OCCT has confirmed a formula."""

    def __init__(self) -> None:
        self._low: Array | None = None
        self._high: Array | None = None

    def covers(self, parameters: Array) -> bool:
        """Whether all parameters (d, n) are inside."""
        if self._low is None or self._high is None:
            return False
        is_inside = (parameters.min(axis=1) >= self._low) & (parameters.max(axis=1) <= self._high)
        return bool(is_inside.all())

    def extend(self, parameters: Array) -> None:
        """Take in parameters (d, n), some of which OCCT has evaluated."""
        low, high = parameters.min(axis=1), parameters.max(axis=1)
        self._low = low if self._low is None else np.minimum(self._low, low)
        self._high = high if self._high is None else np.maximum(self._high, high)


def choose_witnesses(count: int) -> NDArray[np.intp]:
    """Return which of a number of samples OCCT evaluates too: equally spaced ones, both ends included."""
    wanted = min(count, MEASURE_TOLERANCES.witness_count)
    return np.arange(wanted) * (count - 1) // (wanted - 1)
