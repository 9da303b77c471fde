"""Symbolic splines: curves and surfaces as exact piecewise Bernstein forms, on NumPy alone.

`Curve` and `Surface` are frozen values with an algebra (sum, product, scalar and vector product, derivative,
composition) that is exact to rounding at any degree; `interpolate` and `hermite` make curves from data, `normalise`
gives a vector field a length, `reparameterise` and `with_end_speeds` a curve another speed.
"""

from cqblend.splines.curve import Curve
from cqblend.splines.field_normalisation import Normalised, normalise
from cqblend.splines.interpolation import hermite, interpolate
from cqblend.splines.knots import SMOOTH
from cqblend.splines.reparametrisation import change_of_parameter, reparameterise, with_end_speeds
from cqblend.splines.surface import Surface

__all__ = [
    "SMOOTH",
    "Curve",
    "Normalised",
    "Surface",
    "change_of_parameter",
    "hermite",
    "interpolate",
    "normalise",
    "reparameterise",
    "with_end_speeds",
]
