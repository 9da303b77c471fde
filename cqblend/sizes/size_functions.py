"""The functions of t that sizes are most often: linear ones, and smooth ones through the values of a table."""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cqblend.argument_checks import call_user_function, check_number, check_positive, unpack_pair
from cqblend.errors import InputError, shown

FloatArray: TypeAlias = NDArray[Any]
"""An array of float64."""


@dataclass(frozen=True)
class Linear:
    """The size ``a + (b - a) t``. Made by `linear`."""

    a: float
    b: float

    def __call__(self, t: ArrayLike) -> Any:
        """Return the sizes at t, of the shape of t."""
        return self.a + (self.b - self.a) * np.asarray(t, dtype=float)

    def measure_slope(self, t: float) -> float:
        """Return the derivative by t."""
        del t
        return self.b - self.a


@dataclass(frozen=True)
class Table:
    """A size through given ones, by monotone cubics that form one C1 function. Made by `table`.

    Between two nodes the size is the cubic Hermite interpolant whose slopes are those of Fritsch and Butland: the
    weighted harmonic mean of the slopes of the chords on both sides, 0 where these differ in sign. So it rises and
    falls only where the given sizes do, and never leaves their range.

    Attributes
    ----------
    t, sizes
        The nodes, from 0 to 1, and the sizes (mm) there.
    periodic
        Whether the ends meet, as on a closed edge: then the slopes at both are one.
    """

    t: tuple[float, ...]
    sizes: tuple[float, ...]
    periodic: bool = False

    @cached_property
    def _slopes(self) -> FloatArray:
        """The slopes at the nodes, (n,)."""
        steps = np.diff(self.t)
        chords = np.diff(self.sizes) / steps
        if self.periodic:
            steps, chords = (np.concatenate([one[-1:], one, one[:1]]) for one in (steps, chords))
        before, after, chord_before, chord_after = steps[:-1], steps[1:], chords[:-1], chords[1:]
        monotone = chord_before * chord_after > 0
        weights = 2 * after + before, after + 2 * before
        safe_before, safe_after = np.where(monotone, chord_before, 1.0), np.where(monotone, chord_after, 1.0)
        inner = np.where(monotone, sum(weights) / (weights[0] / safe_before + weights[1] / safe_after), 0.0)
        if self.periodic:
            return np.asarray(inner)
        first, last = _estimate_end_slope(steps, chords), _estimate_end_slope(steps[::-1], chords[::-1])
        return np.concatenate([[first], inner, [last]])

    def _find_pieces(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the steps of the pieces that hold t, how far t is in them, 0 to 1, and their Hermite data (4, ..)."""
        nodes, sizes = np.array(self.t), np.array(self.sizes)
        i = np.clip(np.searchsorted(nodes, t, side="right") - 1, 0, len(nodes) - 2)
        step = nodes[i + 1] - nodes[i]
        data = np.stack([sizes[i], sizes[i + 1], step * self._slopes[i], step * self._slopes[i + 1]])
        return step, (t - nodes[i]) / step, data

    def __call__(self, t: ArrayLike) -> Any:
        """Return the sizes at t, of the shape of t."""
        _, x, (p0, p1, m0, m1) = self._find_pieces(np.asarray(t, dtype=float))
        return p0 + x * (m0 + x * (3 * (p1 - p0) - 2 * m0 - m1 + x * (m0 + m1 - 2 * (p1 - p0))))

    def measure_slope(self, t: float) -> float:
        """Return the derivative by t."""
        step, x, (p0, p1, m0, m1) = self._find_pieces(np.array(t))
        return float((m0 + x * (2 * (3 * (p1 - p0) - 2 * m0 - m1) + 3 * x * (m0 + m1 - 2 * (p1 - p0)))) / step)


def _estimate_end_slope(steps: FloatArray, chords: FloatArray) -> float:
    """Return the slope at the first node: that of the parabola through three, limited so that all stays monotone."""
    if len(chords) == 1:
        return float(chords[0])
    slope = ((2 * steps[0] + steps[1]) * chords[0] - steps[0] * chords[1]) / (steps[0] + steps[1])
    if slope * chords[0] <= 0:
        return 0.0
    if chords[0] * chords[1] <= 0 and abs(slope) > 3 * abs(chords[0]):
        return float(3 * chords[0])
    return float(slope)


def linear(a: float, b: float) -> Linear:
    """Return the size that changes at a constant rate along a blend, for ``radius=`` and ``width=``.

    Parameters
    ----------
    a, b : float
        The sizes (mm) at t = 0 and at t = 1. One of them may be 0: there, the blend ends in a point.

    Returns
    -------
    Linear
        The function ``t -> a + (b - a) t``.

    Raises
    ------
    InputError
        One is no finite number, or below 0, or both are 0.

    Examples
    --------
    >>> import cadquery, cqblend
    >>> float(cqblend.linear(1, 3)(0.25))
    1.5
    >>> box = cadquery.Solid.makeBox(30, 20, 10)
    >>> cqblend.blend_edges(box, box.edges("|X and >Y and >Z"), cqblend.linear(1, 3)).certificate.form
    'exact'
    """
    sizes = [check_positive(name, value, zero=True) for name, value in (("a", a), ("b", b))]
    if not any(sizes):
        raise InputError("linear(0, 0) is no size: one end must be above 0")
    return Linear(*sizes)


def table(points: Iterable[Any]) -> Table:
    """Return the size that runs through given ones, for ``radius=`` and ``width=``.

    Between them it is a monotone cubic: it has a continuous slope, and rises and falls only where the given sizes do
    [1]_. On a closed edge its slope is continuous where it closes, too.

    Parameters
    ----------
    points : iterable of (float, float)
        Pairs (t, size): t ascending from 0 to 1, sizes in mm. The first and the last size may be 0: there, the blend
        ends in a point.

    Returns
    -------
    Table
        The function of t.

    Raises
    ------
    InputError
        The pairs are none, or t does not ascend from 0 to 1, or a size is below 0, or 0 in between.

    References
    ----------
    .. [1] F. N. Fritsch and J. Butland, A method for constructing local monotone piecewise cubic interpolants, SIAM
       Journal on Scientific and Statistical Computing 5 (1984), 300-304.

    Examples
    --------
    >>> import cqblend
    >>> law = cqblend.table([(0, 1), (0.5, 3), (1, 1)])
    >>> law([0.0, 0.25, 0.5]).tolist()
    [1.0, 2.5, 3.0]
    """
    rule = "a table has pairs (t, size)"
    if not isinstance(points, Iterable) or isinstance(points, str | bytes):
        raise InputError(f"{rule}, not {shown(points)}")
    pairs = [unpack_pair(f"{rule}; each", pair) for pair in call_user_function(rule, list, points)]
    nodes = [check_number("t of a table", t) for t, _ in pairs]
    sizes = [
        check_positive(f"the size at t = {t:g} of a table", size, zero=True)
        for t, (_, size) in zip(nodes, pairs, strict=True)
    ]
    if len(nodes) < 2 or nodes[0] != 0 or nodes[-1] != 1 or any(b <= a for a, b in itertools.pairwise(nodes)):
        raise InputError(f"t of a table ascends from 0 to 1, not {', '.join(f'{t:g}' for t in nodes) or 'nothing'}")
    if 0 in sizes[1:-1]:
        place = nodes[1 + sizes[1:-1].index(0)]
        raise InputError(f"the size at t = {place:g} of a table must be above 0: it may be 0 only at an end")
    if not any(sizes):
        raise InputError("a table of sizes that are all 0 is no size")
    return Table(tuple(nodes), tuple(sizes))
