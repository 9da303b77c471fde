"""Interpolation by polynomials through the nearest of many nodes: values in between, without a system to solve."""

from __future__ import annotations

import numpy as np

from cqblend.splines.bernstein import Array


def interpolate_locally(nodes: Array, values: Array, t: Array, count: int) -> Array:
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
    """
    first = np.clip(np.searchsorted(nodes, t) - count // 2, 0, len(nodes) - count)
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
