"""Symbolic splines: curves and surfaces as exact piecewise Bernstein forms, on NumPy alone.

`Curve` and `Surface` are frozen values with an algebra (sum, product, scalar and vector product, derivative,
composition) that is exact to rounding at any degree; `interpolate` and `hermite` make curves from data.
"""

from cqblend.splines.curve import Curve
from cqblend.splines.fit import hermite, interpolate
from cqblend.splines.knots import SMOOTH
from cqblend.splines.surface import Surface

__all__ = ["SMOOTH", "Curve", "Surface", "hermite", "interpolate"]
