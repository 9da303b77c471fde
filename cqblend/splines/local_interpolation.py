"""Interpolation by polynomials through the nearest of many nodes: values in between, without a system to solve."""

from __future__ import annotations

import numpy as np

from cqblend.splines.bernstein import Array


def interpolate_locally(nodes: Array, values: Array, t: Array, count: int, kinks: Array | None = None) -> Array:
    """Return values (n, ...) at t (n,) of polynomials through the ``count`` nodes around each, of degree count - 1.

    Parameters
    ----------
    nodes
        (k,) ascending, at least ``count``.
    values
        (k, ...) there.
    t
        (n,); beyond the ends of the nodes, the last polynomials go on.
    count
        Number of nodes that each value is interpolated from.
    kinks
        Those of the nodes, ascending, across which no polynomial goes; there are at least ``count`` between two of
        them, both included.
    """
    lowest: Array | int = 0
    highest: Array | int = len(nodes) - count
    if kinks is not None and len(kinks):
        ends, stretch = np.searchsorted(nodes, kinks), np.searchsorted(kinks, t)
        lowest, highest = np.append(0, ends)[stretch], np.append(ends + 1, len(nodes))[stretch] - count
    first = np.clip(np.searchsorted(nodes, t) - count // 2, lowest, highest)
    stencil = first[:, None] + np.arange(count)
    near = nodes[stencil]
    weights = np.ones((len(t), count))
    for other in range(count):
        ratio = (t[:, None] - near[:, other, None]) / np.where(
            np.arange(count) == other, 1.0, near - near[:, other, None]
        )
        ratio[:, other] = 1.0
        weights *= ratio
    flat = values.reshape(len(values), -1)
    result = weights[:, 0, None] * flat[first]
    for k in range(1, count):
        result += weights[:, k, None] * flat[first + k]
    return result.reshape(len(t), *values.shape[1:])


def tabulate_node_derivatives(nodes: Array) -> Array:
    """Return the matrix (n, n) that takes values at nodes (n,), in any order, to derivatives there of their polynomial.

    By barycentric weights (Berrut & Trefethen, 2004).
    """
    gaps = nodes[:, None] - nodes
    np.fill_diagonal(gaps, 1.0)
    weights = 1 / gaps.prod(axis=1)
    matrix = weights / weights[:, None] / gaps
    np.fill_diagonal(matrix, 0.0)
    np.fill_diagonal(matrix, -matrix.sum(axis=1))
    return matrix
