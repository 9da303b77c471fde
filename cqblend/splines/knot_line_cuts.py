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


def _split_coordinates(curve: Spline) -> tuple[Array, Array]:
    """Numerator (m+1, k, n) and weight (m+1, n) of a curve; the weight of a polynomial one is (1, n), all ones."""
    numerator, denominator = curve._split_weight()
    return numerator, np.ones((1, numerator.shape[-1])) if denominator is None else denominator[:, 0]


def _bound_rounding(coordinate: Array, weight: Array, lines: Array) -> float:
    """Return the value up to which coordinate - line * weight is zero to rounding."""
    return float(16 * EPSILON * max(np.abs(coordinate).max(), np.abs(lines).max() * np.abs(weight).max()))


def _find_line_crossings(
    curve: Spline, lines: Sequence[Array], orders: Sequence[Array], merge: float
) -> tuple[Array, Array]:
    """Find the parameters where a coordinate may cross an interior line, and how far each may be moved."""
    (breaks,) = curve._breaks
    numerator, weight = _split_coordinates(curve)
    functions, tolerances, loose = [], [], []
    for k, (line, order) in enumerate(zip(lines, orders, strict=True)):
        u, inner, tolerance = numerator[:, k], line[1:-1], _bound_rounding(numerator[:, k], weight, line)
        position = u / weight
        low, high = np.searchsorted(inner, (position.min() - tolerance, position.max() + tolerance))
        functions.append(u[:, None, :] - inner[low:high, None] * weight[:, None, :])
        tolerances += [tolerance] * (high - low)
        loose.append(order[low:high] >= 1)
    f = np.concatenate(functions, axis=1)
    if not f.size:
        return np.empty(0), np.empty(0)
    n = len(breaks) - 1
    column, x = find_sign_changes(f.reshape(len(f), -1), np.repeat(tolerances, n))
    line_of, piece = np.divmod(column, n)
    size = max(abs(breaks[0]), abs(breaks[-1]))
    length = breaks[-1] - breaks[0]
    least = 4 * EPSILON * size
    slack = np.where(
        np.concatenate(loose)[line_of],
        np.maximum(merge * length, least),
        max(SPLINE_TOLERANCES.kink_crossing_merge * length, least),
    )
    return breaks[piece] + x * (breaks[piece + 1] - breaks[piece]), slack


def _merge_crossings(fixed: Array, candidates: Array, slack: Array) -> Array:
    """Add to the fixed breaks those candidates that are not within their slack of a break already chosen."""
    if not len(candidates):
        return fixed
    together = np.sort(np.concatenate([fixed, candidates]))
    if (np.diff(together) > slack.max()).all():
        return together
    chosen = fixed.tolist()
    for candidate, tolerance in sorted(zip(candidates.tolist(), slack.tolist(), strict=True), key=lambda c: c[::-1]):
        at = bisect_left(chosen, candidate)
        if all(abs(candidate - b) > tolerance for b in chosen[max(at - 1, 0) : at + 1]):
            chosen.insert(at, candidate)
    return np.array(chosen)


def _assign_patches(coordinate: Array, weight: Array, lines: Array) -> Array:
    """Find the interval between lines that each piece lies in.

    A piece that runs along a line takes the interval of the piece before it, or else after it, if it is next to the
    line.
    """
    inner = lines[1:-1]
    mean, mean_weight = coordinate.mean(axis=0), weight.mean(axis=0)
    index: Array = np.searchsorted(inner, mean / mean_weight, "right")
    if not len(inner):
        return index
    nearest = np.abs(np.subtract.outer(mean / mean_weight, inner)).argmin(axis=1)
    undecided = np.abs(mean - inner[nearest] * mean_weight) <= _bound_rounding(coordinate, weight, lines)
    if undecided.any():
        decided = ~undecided
        for j in np.flatnonzero(undecided):
            beside = (nearest[j], nearest[j] + 1)
            before, after = index[j - 1] if j else -1, index[j + 1] if j + 1 < len(index) and decided[j + 1] else -1
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
    merged = _merge_crossings(breaks, *_find_line_crossings(curve, lines, orders, merge))
    cut = curve._subdivide_at(0, merged)
    numerator, weight = _split_coordinates(cut)
    index = np.array([_assign_patches(numerator[:, k], weight, line) for k, line in enumerate(lines)])
    changed = (index[:, 1:] != index[:, :-1]).any(axis=0)
    needed = changed if changed.all() else changed | np.isin(merged[1:-1], breaks)
    if not needed.all():
        kept = np.concatenate([[True], needed])
        cut, index = curve._subdivide_at(0, np.append(merged[:-1][kept], merged[-1])), index[:, kept]
    continuity = cut._continuity[0].copy()
    for k, order in enumerate(orders):
        step = np.diff(index[k])
        moved = np.flatnonzero(step)
        lower = np.minimum(index[k, moved], index[k, moved + 1])
        continuity[moved] = np.minimum(continuity[moved], order[lower])
        for j in np.flatnonzero(np.abs(step) > 1):  # only where the curve itself jumps
            low, high = sorted(index[k, j : j + 2])
            continuity[j] = min(continuity[j], order[low:high].min())
    return cut, index, continuity


def to_barycentric(cut: Spline, coordinate: int, lines: Array, index: Array) -> tuple[Array, Array]:
    """Barycentric functions (m+1, n) of a coordinate in the interval of lines that each piece of `cut` runs through.

    A polynomial coordinate that is constant to rounding on every piece comes back with degree 0, which keeps
    isoparametric curves at the degree they have.
    """
    numerator, weight = _split_coordinates(cut)
    u = numerator[:, coordinate]
    if len(weight) == 1 and np.ptp(u, axis=0).max() <= 16 * EPSILON * np.abs(u).max():
        u = u.mean(axis=0, keepdims=True)
    start, end = lines[index], lines[index + 1]
    return (end * weight - u) / (end - start), (u - start * weight) / (end - start)
