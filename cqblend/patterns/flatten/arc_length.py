"""Arc length of spline curves to rounding, and the parameter at a given length.

Exists because a seam has one length, that of the curve in space it stands for, however its two sides are sampled. Must
not know strips or pieces.
"""

import numpy as np
from numpy.typing import ArrayLike

from cqblend.errors import GeometryError, InputError, shown
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.integral import Antiderivative

_EPS = float(np.finfo(float).eps)


class ArcLength:
    r"""The arc length of a curve from its start, as a function of the parameter.

    .. math:: s(t) = \int_{t_0}^t \|C'\|

    Right to about 1e-14 of the whole length, for polynomial and rational curves of any dim; the speed may vanish, also
    everywhere.

    Parameters
    ----------
    curve
        C.

    Raises
    ------
    InputError
        If it is not a Curve.

    Examples
    --------
    >>> quarter = ArcLength(Curve.bezier([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], [1.0, np.sqrt(0.5), 1.0]))
    >>> round(quarter.length / np.pi, 12), float(quarter.inverse(np.pi / 4).round(12))
    (0.5, 0.5)
    """

    __slots__ = ("_integral", "curve")

    def __init__(self, curve: Curve) -> None:
        if not isinstance(curve, Curve):
            raise InputError(f"arc length is that of a Curve, not of {shown(curve)}")
        self.curve = curve
        # the speed is no better than the rounding of the points: on a pole it is nothing else
        ends = np.abs(curve(curve.breaks)).max()
        self._integral = Antiderivative(self.speed, curve.breaks, scale=10 * float(ends))

    @property
    def length(self) -> float:
        """Length of the whole curve."""
        return float(self._integral.values[-1])

    def speed(self, t: ArrayLike) -> Array:
        r"""Return \|C'(t)\|, of the shape of t."""
        return np.asarray(np.linalg.norm(self.curve(t, 1), axis=-1))

    def __call__(self, t: ArrayLike) -> Array:
        """Return s(t), of the shape of t; beyond the domain it stays what it is at the end."""
        return np.clip(self._integral(np.clip(t, *self.curve.domain)), 0.0, self.length)

    def find_parameters(self, s: ArrayLike) -> Array:
        """Return the parameters at given lengths, of the shape of s; lengths beyond the ends give the ends.

        Raises
        ------
        GeometryError
            If the curve is a point.
        """
        if self.length == 0:
            raise GeometryError("the curve is a point: no parameter belongs to a length along it")
        s = np.asarray(s, dtype=np.float64)
        wanted = np.clip(s.ravel(), 0.0, self.length)
        cells, values = self._integral.cells, self._integral.values
        cell = np.clip(np.searchsorted(values, wanted, "right") - 1, 0, len(cells) - 2)
        low, high = cells[cell], cells[cell + 1]
        rise = values[cell + 1] - values[cell]
        part = np.divide(wanted - values[cell], rise, out=np.zeros(len(wanted)), where=rise > 0)
        t = low + part * (high - low)
        for _ in range(80):  # Newton inside a shrinking bracket
            miss = self._integral(t) - wanted
            low, high = np.where(miss <= 0, t, low), np.where(miss >= 0, t, high)
            speed = self.speed(t)
            new = t - np.divide(miss, speed, out=np.full(len(t), np.inf), where=speed > 0)
            new = np.where((new >= low) & (new <= high), new, (low + high) / 2)
            settled = np.abs(new - t) <= 2 * _EPS * np.abs(cells).max()
            t = new
            if settled.all():
                break
        return t.reshape(s.shape)
