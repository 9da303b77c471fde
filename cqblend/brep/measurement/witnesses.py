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
        self._low: Array | float = np.inf
        self._high: Array | float = -np.inf

    def covers(self, parameters: Array) -> bool:
        """Whether all parameters (d, n) are inside."""
        return bool((parameters.min(axis=1) >= self._low).all() and (parameters.max(axis=1) <= self._high).all())

    def extend(self, parameters: Array) -> None:
        """Take in parameters (d, n), some of which OCCT has evaluated."""
        self._low = np.minimum(self._low, parameters.min(axis=1))
        self._high = np.maximum(self._high, parameters.max(axis=1))

    @staticmethod
    def choose_witnesses(count: int) -> NDArray[np.intp]:
        """Return which of a number of samples OCCT evaluates too: equally spaced ones, both ends included."""
        return np.unique(np.linspace(0, count - 1, MEASURE_TOLERANCES.witness_count).astype(np.intp))
