"""Interpolates cubic splines that are C2 but for given corners, at which they are C1 or have a known kink.

Rails and directions are such splines of lifted parameters: their corners are where surfaces are not smooth enough.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.interpolation import solve_cyclic_tridiagonal


@dataclass(frozen=True)
class KinkData:
    """What a fit is given at m kinks in addition to values: the left limits there, and changes of the slopes.

    Kink i has its left limit at node ``nodes_before[i]`` and its right limit at node ``nodes_after[i]``: two nodes only
    where a closed rail meets itself. ``values_before`` (m, k) are the left limits; ``slope_changes`` (2, m, k) are
    added to the slopes on both sides that values alone would give.
    """

    nodes_before: Array
    nodes_after: Array
    values_before: Array
    slope_changes: Array

    def scale_values(self, factors: Array) -> KinkData:
        """Return the data of values multiplied by factors (m,)."""
        return KinkData(
            self.nodes_before,
            self.nodes_after,
            self.values_before * factors[:, None],
            self.slope_changes * factors[:, None],
        )


CurveMaker = Callable[[Array, KinkData | None], Curve]
"""A function from lifted values (n, k) at the samples of a rail, and its kinks, to a curve through them."""


def add_third_points(nodes: Array) -> Array:
    """Return the nodes, and two parameters between neighbouring ones; those of a span depend on its ends alone."""
    steps = np.diff(nodes)
    inside = np.stack([nodes[:-1], nodes[:-1] + steps / 3, nodes[:-1] + 2 * steps / 3], axis=1)
    return np.append(inside.ravel(), nodes[-1])


def interpolate_with_corners(
    nodes: Array,
    values: Array,
    corners: Array,
    *,
    closed: bool,
    sharp: Sequence[int] | Array = (),
    kinks: KinkData | None = None,
    end_slopes: tuple[Array | None, Array | None] = (None, None),
) -> Curve:
    """Interpolate values at the nodes by a cubic spline: C2, but C1 at corners (indices of nodes, both ends included).

    There are two more values between neighbouring nodes, at the parameters of :func:`add_third_points`. From them come
    the slopes at the corners, of third order, and the same on both sides; at ``sharp`` corners each side has its own
    slope, and at ``kinks``, which must be corners too, its own value besides. Slopes (k,) may be given at both ends.
    """
    steps = np.diff(nodes)
    weights = np.array([-11, 18, -9, 2]) / 2  # of the slope at the first of four equidistant values, times 3 steps
    spans = np.stack([values[i::3][: len(steps)] for i in range(4)])
    if kinks is not None:
        spans[3, kinks.nodes_before - 1] = kinks.values_before
    right, left = (
        np.einsum("w,wnd->nd", weights, spans) / steps[:, None],
        np.einsum("w,wnd->nd", -weights[::-1], spans) / steps[:, None],
    )
    before, after = (np.concatenate(pair) for pair in ((right[:1], left), (right, left[-1:])))
    even = np.ones(len(nodes), dtype=bool)
    even[np.asarray(sharp, dtype=int)] = False
    if kinks is not None:
        even[np.concatenate([kinks.nodes_before, kinks.nodes_after])] = False
        before[kinks.nodes_before] += kinks.slope_changes[0]
        after[kinks.nodes_after] += kinks.slope_changes[1]
    before[even] = after[even] = (before[even] + after[even]) / 2
    if closed and even[0] and even[-1]:
        before[-1] = after[0] = (right[0] + left[-1]) / 2
    if end_slopes[0] is not None:
        after[0] = end_slopes[0]
    if end_slopes[1] is not None:
        before[-1] = end_slopes[1]
    order = np.full(len(nodes), 2)
    order[corners] = np.where(even[corners], 1, 0)
    gaps = np.abs(spans[3] - values[3::3]).max(axis=1) > RAIL_TOLERANCES.same_value_share * np.abs(values).max()
    order[corners[1:]] = np.where(gaps[np.asarray(corners[1:]) - 1], -1, order[corners[1:]])
    first, last = _solve_inner_slopes(steps, (spans[3] - spans[0]) / steps[:, None], corners, (before, after))
    coefs = np.stack([spans[0], spans[0] + first * steps[:, None] / 3, spans[3] - last * steps[:, None] / 3, spans[3]])
    curve = Curve(nodes, coefs.swapaxes(1, 2), continuity=order[1:-1])
    has_given_slopes = any(slope is not None for slope in end_slopes)  # to be kept to the last digit
    return curve if has_given_slopes else curve.reduce(tolerance=1e-13)


def _solve_inner_slopes(
    steps: Array, chords: Array, corners: Array, corner_slopes: tuple[Array, Array]
) -> tuple[Array, Array]:
    """Return the slopes (n, k) at the start and at the end of every span, with which a spline is C2 between corners.

    ``chords`` (n, k) are the mean slopes of the spans, ``corner_slopes`` those before and after all nodes (n + 1, k),
    of which those at the corners are used.
    """
    before, after = corner_slopes
    is_corner = np.zeros(len(before), dtype=bool)
    is_corner[corners] = True
    low, middle, up, right = np.zeros(len(before)), np.ones(len(before)), np.zeros(len(before)), np.zeros_like(before)
    ahead = steps[:-1] / (steps[:-1] + steps[1:])
    low[1:-1], middle[1:-1], up[1:-1] = 1 - ahead, 2.0, ahead
    right[1:-1] = 3 * ((1 - ahead)[:, None] * chords[:-1] + ahead[:, None] * chords[1:])
    # slopes at corners are known, and may be two: they go to the right-hand sides of their neighbours
    right[1:] -= np.where(is_corner[:-1, None], low[1:, None] * after[:-1], 0.0)
    right[:-1] -= np.where(is_corner[1:, None], up[:-1, None] * before[1:], 0.0)
    low[1:][is_corner[:-1]] = up[:-1][is_corner[1:]] = 0.0
    low[is_corner], middle[is_corner], up[is_corner] = 0.0, 1.0, 0.0
    slopes = solve_cyclic_tridiagonal(low, middle, up, right)
    return np.where(is_corner[:-1, None], after[:-1], slopes[:-1]), np.where(
        is_corner[1:, None], before[1:], slopes[1:]
    )
