"""Arc length of spline curves, accurate to rounding.

Both sides of a seam take their length from the same curve in space, however differently they are sampled. Depends on
splines only.
"""

import numpy as np
from numpy.typing import ArrayLike

from cqblend.errors import InputError, shown
from cqblend.splines import Curve
from cqblend.splines.antiderivative import Antiderivative
from cqblend.splines.bernstein import Array


class ArcLength:
    r"""The arc length of a curve from its start, as a function of the parameter.

    .. math:: s(t) = \int_{t_0}^t \|C'\|

    Accurate to about 1e-14 of the whole length, for polynomial and rational curves of any dim; the speed may vanish,
    also everywhere.

    Parameters
    ----------
    curve
        C.

    Raises
    ------
    InputError
        If the curve is not a Curve.

    Examples
    --------
    >>> quarter = ArcLength(Curve.bezier([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], [1.0, np.sqrt(0.5), 1.0]))
    >>> round(quarter.length / np.pi, 12), round(float(quarter(0.5)) / np.pi, 12)
    (0.5, 0.25)
    """

    __slots__ = ("_integral", "curve")

    def __init__(self, curve: Curve) -> None:
        if not isinstance(curve, Curve):
            raise InputError(f"arc length is that of a Curve, not of {shown(curve)}")
        self.curve = curve
        # the speed is accurate to the rounding of the points only: on a curve that is a point it is nothing else
        max_coordinate = np.abs(curve(curve.breaks)).max()
        self._integral = Antiderivative(self.speed, curve.breaks, scale=10 * float(max_coordinate))

    @property
    def length(self) -> float:
        """Length of the whole curve."""
        return float(self._integral.values[-1])

    def speed(self, t: ArrayLike) -> Array:
        r"""Return \|C'(t)\|, of the shape of t."""
        return np.asarray(np.linalg.norm(self.curve(t, 1), axis=-1))

    def __call__(self, t: ArrayLike) -> Array:
        """Return s(t), of the shape of t, with t clamped to the domain."""
        return np.clip(self._integral(np.clip(t, *self.curve.domain)), 0.0, self.length)
