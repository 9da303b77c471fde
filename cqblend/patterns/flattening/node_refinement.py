"""Nodes along the rails of a strip: merged, and added by splitting the intervals between them."""

import numpy as np

from cqblend.errors import GeometryError
from cqblend.patterns.flattening.tolerances import FLATTENING_TOLERANCES
from cqblend.splines.bernstein import Array


def merge_nodes(breaks: Array, wanted: Array, distance: float) -> Array:
    """Return breaks and wanted nodes, sorted; nodes within a distance of a break or an earlier node are left out."""
    new = np.unique(wanted)
    new = new[np.abs(new[:, None] - breaks).min(axis=1) > distance]
    new = new[np.diff(new, prepend=-np.inf) > distance]
    return np.sort(np.concatenate([breaks, new]))


def split_intervals(nodes: Array, parts: Array, tolerance: float) -> Array:
    """Split each interval between nodes (n,) into a number of equal parts, (n - 1,).

    Raises
    ------
    GeometryError
        If that makes more than 20,000 intervals; the message names the tolerance.
    """
    limit = FLATTENING_TOLERANCES.max_segments
    if parts.sum() > limit:
        raise GeometryError(
            f"more than {limit} segments along the strip would be needed for a tolerance of {tolerance:.3g}: "
            "raise it, "
            "or divide the strip into narrower ones"
        )
    interval = np.repeat(np.arange(len(parts)), parts)
    part = (np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[interval]
    return np.append(nodes[interval] + part * np.diff(nodes)[interval], nodes[-1])
