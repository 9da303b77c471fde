"""Cutting a curve where it crosses the knot lines of the spline that it is composed with.

A curve in the parameter plane crosses knot lines, touches them, runs along them, turns back, or stands still.
`cut_at_knot_lines` cuts it so that every piece lies in one patch and says which; the rest of composition is arithmetic
(`bernstein.compose_patch`). Decisions are made on Bernstein coefficients with a tolerance of a few roundings, and a
decision for the wrong side costs rounding only, because patches continue as polynomials. Depends on splines and roots
only.
"""

from bisect import bisect_left
from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from cqblend.splines.bernstein import EPSILON, Array
from cqblend.splines.roots import find_sign_changes
from cqblend.splines.spline import Spline
from cqblend.splines.tolerances import SPLINE_TOLERANCES

SplineT = TypeVar("SplineT", bound=Spline)


class _Coordinates:
    """The coordinates of a curve, and how the lines lie to them.

    Attributes
    ----------
    numerator
        (m+1, k, n).
    weight
        (m+1, n), None of a polynomial curve.
    rounding
        (k,) values up to which coordinate - line * weight is zero to rounding.
    crossable
        For each coordinate the first of the interior lines that its hull reaches, and one beyond the last.
    """

    __slots__ = ("crossable", "numerator", "rounding", "weight")

    def __init__(self, curve: Spline, lines: Sequence[Array]) -> None:
        numerator, weight = curve._split_weight()
        self.numerator, self.weight = numerator, None if weight is None else weight[:, 0]
        position = numerator if weight is None else numerator / weight
        low, high = (extreme(position, axis=(0, 2)).tolist() for extreme in (np.minimum.reduce, np.maximum.reduce))
        if weight is None:
            size, heaviest = [max(-a, b) for a, b in zip(low, high, strict=True)], 1.0
        else:
            size, heaviest = np.abs(numerator).max(axis=(0, 2)).tolist(), float(np.abs(weight).max())
        self.rounding, self.crossable = [], []
        for line, a, b, most in zip(lines, low, high, size, strict=True):
            rounding = 16 * EPSILON * max(most, heaviest * max(abs(line.item(0)), abs(line.item(-1))))
            self.rounding.append(rounding)
            inner = 1, len(line) - 1
            self.crossable.append(
                (bisect_left(line, a - rounding, *inner) - 1, bisect_left(line, b + rounding, *inner) - 1)
            )


def _find_line_crossings(
    breaks: Array, coordinates: _Coordinates, lines: Sequence[Array], orders: Sequence[Array], merge: float
) -> tuple[Array, Array]:
    """Find the parameters where a coordinate may cross an interior line, and how far each may be moved."""
    numerator, weight = coordinates.numerator, coordinates.weight
    functions, tolerances, tight = [], [], []
    for k, (line, order) in enumerate(zip(lines, orders, strict=True)):
        low, high = coordinates.crossable[k]
        if low < high:
            u, reached = numerator[:, None, k], line[1 + low : 1 + high, None]
            functions.append(u - (reached if weight is None else reached * weight[:, None]))
            tolerances += [coordinates.rounding[k]] * (high - low)
            tight += (order[low:high] < 1).tolist()
    f = np.concatenate(functions, axis=1) if len(functions) > 1 else functions[0]
    n = len(breaks) - 1
    zero = np.array(tolerances)
    column, x = find_sign_changes(f.reshape(len(f), -1), zero.repeat(n) if n > 1 else zero)
    ends = breaks.item(0), breaks.item(-1)
    length, least = ends[1] - ends[0], 4 * EPSILON * max(abs(ends[0]), abs(ends[1]))
    slack = np.full(len(x), max(merge * length, least))
    if any(tight):
        slack[np.array(tight)[column // n]] = max(SPLINE_TOLERANCES.kink_crossing_merge * length, least)
    if n == 1:
        return ends[0] + x * length, slack
    start = breaks[:-1][column % n]
    return start + x * (breaks[1:][column % n] - start), slack


def _merge_crossings(fixed: Array, candidates: Array, slack: Array) -> Array:
    """Add to the fixed breaks those candidates that are not within their slack of a break already chosen."""
    if not len(candidates):
        return fixed
    together = np.concatenate([fixed, candidates])
    together.sort()
    if (together[1:] - together[:-1] > slack.max()).all():
        return together
    chosen = fixed.tolist()
    for candidate, tolerance in sorted(zip(candidates.tolist(), slack.tolist(), strict=True), key=lambda c: c[::-1]):
        at = bisect_left(chosen, candidate)
        if all(abs(candidate - b) > tolerance for b in chosen[max(at - 1, 0) : at + 1]):
            chosen.insert(at, candidate)
    return np.array(chosen)


def _assign_patches(mean: Array, weight: Array | None, lines: Array, rounding: float) -> Array:
    """Find the interval between lines that each piece lies in, from the means of its coefficients.

    A piece that runs along a line takes the interval of the piece before it, or else after it, if it is next to the
    line.
    """
    position = mean if weight is None else mean / weight
    inner = lines[1:-1]
    index: Array = inner.searchsorted(position, "right")
    distance = np.minimum(position - lines[:-1][index], lines[1:][index] - position)
    near = rounding if weight is None else rounding / np.abs(weight)
    if len(inner) and (distance <= near).any():
        nearest = np.abs(np.subtract.outer(position, inner)).argmin(axis=1)
        undecided = np.abs(position - inner[nearest]) <= near
        for j in np.flatnonzero(undecided):
            beside = (nearest[j], nearest[j] + 1)
            before = index[j - 1] if j else -1
            after = index[j + 1] if j + 1 < len(index) and not undecided[j + 1] else -1
            index[j] = before if before in beside else after if after in beside else index[j]
    return index


def cut_at_knot_lines(
    curve: SplineT, lines: Sequence[Array], orders: Sequence[Array], merge: float = SPLINE_TOLERANCES.crossing_merge
) -> tuple[SplineT, Array, Array]:
    """Cut a curve at the lines it crosses.

    Parameters
    ----------
    curve
        Curve of dim k, polynomial or rational.
    lines
        For each coordinate the increasing values that separate the pieces of what the curve runs through, both ends
        included; beyond the ends the end pieces go on.
    orders
        For each coordinate the continuity at the interior lines.
    merge
        Crossings of lines that are C1 or more, closer than this share of the domain, are one break; 0 for none.

    Returns
    -------
    cut, index, continuity
        The curve with a break at every crossing, the (k, n) indices of the piece that each of its n pieces runs
        through, and the (n - 1,) orders of continuity that a composition has. A line that is only touched gives no
        break.
    """
    (breaks,) = curve._breaks
    coordinates = _Coordinates(curve, lines)
    if all(low == high for low, high in coordinates.crossable):
        index = np.array([[low] * (len(breaks) - 1) for low, _ in coordinates.crossable])
        return curve, index, curve._continuity[0]
    merged = _merge_crossings(breaks, *_find_line_crossings(breaks, coordinates, lines, orders, merge))
    cut = curve._subdivide_at(0, merged)
    numerator, weight = cut._split_weight()
    mean = np.add.reduce(numerator) / len(numerator)
    mean_weight = None if weight is None else np.add.reduce(weight[:, 0]) / len(weight)
    index = np.empty(mean.shape, dtype=int)
    for k, line in enumerate(lines):
        index[k] = _assign_patches(mean[k], mean_weight, line, coordinates.rounding[k])
    steps = index[:, 1:] - index[:, :-1]
    changed = np.logical_or.reduce(steps, axis=0)
    if not changed.all():
        needed = changed.copy()
        needed[merged.searchsorted(breaks[1:-1]) - 1] = True
        if not needed.all():
            kept = np.concatenate([[True], needed])
            cut, index = curve._subdivide_at(0, np.append(merged[:-1][kept], merged[-1])), index[:, kept]
            steps = index[:, 1:] - index[:, :-1]
    continuity = cut._continuity[0].copy()
    for step, row, order in zip(steps, index, orders, strict=True):
        (moved,) = step.nonzero()
        continuity[moved] = np.minimum(continuity[moved], order[np.minimum(row[:-1], row[1:])[moved]])
        if len(moved) and np.maximum.reduce(np.abs(step)) > 1:  # only where the curve itself jumps
            for j in moved:
                continuity[j] = min(continuity[j], order[min(row[j : j + 2]) : max(row[j : j + 2])].min())
    return cut, index, continuity


def to_barycentric(cut: Spline, lines: Sequence[Array], index: Array) -> list[Array]:
    """Barycentric functions of the coordinates of `cut` in the intervals of lines that its pieces run through.

    Parameters
    ----------
    cut, lines, index
        A curve of k coordinates, lines and indices (k, n) as of :func:`cut_at_knot_lines`.

    Returns
    -------
    list of Array
        Two functions (m+1, n) for each coordinate. Those of a polynomial coordinate that is constant to rounding on
        every piece have degree 0, which keeps isoparametric curves at the degree they have.
    """
    numerator, weight = cut._split_weight()
    start, end = np.empty((2, *index.shape))
    for k, line in enumerate(lines):
        start[k], end[k] = line[:-1][index[k]], line[1:][index[k]]
    length = end - start
    if weight is not None:
        before, after = (end * weight - numerator) / length, (numerator - start * weight) / length
        return [function[:, k] for k in range(len(lines)) for function in (before, after)]
    before, after = (end - numerator) / length, (numerator - start) / length
    spread = np.maximum.reduce(np.maximum.reduce(numerator) - np.minimum.reduce(numerator), axis=1).tolist()
    functions = []
    for k in range(len(lines)):
        u: Array = numerator[:, k]
        if spread[k] <= 16 * EPSILON * np.maximum.reduce(np.abs(u[0])):
            mean = np.add.reduce(u)[None] / len(u)
            functions += [(end[k] - mean) / length[k], (mean - start[k]) / length[k]]
        else:
            functions += [before[:, k], after[:, k]]
    return functions
