"""Whether a spline curve meets itself, in any dimension, decided on control polygons rather than samples.

A rail that crosses itself would make a blend that does. Depends on curves only.
"""

from __future__ import annotations

import numpy as np

from cqblend.splines import Curve, bernstein
from cqblend.splines.bernstein import Array
from cqblend.splines.tolerances import SPLINE_LIMITS, SPLINE_TOLERANCES


def control_points(curve: Curve) -> Array:
    """Return the Euclidean control points (degree + 1, dim, pieces)."""
    return _to_euclidean(curve.coefs, curve.rational)


def measure_diagonal(curve: Curve) -> float:
    """Return the diagonal of the box around a curve's control points."""
    low, high = curve.bounds()
    return float(np.linalg.norm(high - low))


def is_closed(curve: Curve) -> bool:
    """Whether a curve ends where it starts."""
    first, last = curve(curve.domain)
    return bool(np.linalg.norm(last - first) <= SPLINE_TOLERANCES.touching * measure_diagonal(curve))


def find_self_crossing(curve: Curve) -> tuple[float, float] | None:
    """Return two parameters at which a curve meets itself, None if it never does; ends that meet do not count.

    Pieces are halved for as long as their boxes overlap. Neighbours, and a piece and itself, cannot meet again once all
    steps of their control polygons advance in one direction, since then the curve does (variation diminishing).

    Parameters
    ----------
    curve
        Of positive weights, continuous, and nowhere at rest.

    Examples
    --------
    >>> find_self_crossing(Curve.bezier([[0.0, 0.0], [0.0, 2.0], [1.0, 2.0], [1.0, 0.0]])) is None
    True
    >>> a, b = find_self_crossing(Curve.bezier([[0.0, 0.0], [3.0, 2.0], [-2.0, 2.0], [1.0, 0.0]]))
    >>> round(a + b, 6)
    1.0
    """
    t0, t1 = curve.domain
    touching, closed, near = (
        SPLINE_TOLERANCES.touching * measure_diagonal(curve),
        is_closed(curve),
        SPLINE_TOLERANCES.neighbour_gap * (t1 - t0),
    )
    coefs, start, end = curve.coefs, curve.breaks[:-1], curve.breaks[1:]
    points = control_points(curve)
    if _is_advancing(points, (points[-1, :, -1:] - points[0, :, :1])).all():
        return None
    i, j = np.triu_indices(len(start))
    for _ in range(SPLINE_LIMITS.crossing_halvings):
        points = _to_euclidean(coefs, curve.rational)
        low, high = points.min(axis=0), points.max(axis=0)
        chord = points[-1] - points[0]
        chord = chord / np.maximum(np.linalg.norm(chord, axis=0), np.finfo(float).tiny)
        joined = (start[j] - end[i] <= near) | (closed & (start[i] - t0 + t1 - end[j] <= near))
        small = (high - low).max(axis=0) <= touching
        settled = (np.maximum(low[:, i] - high[:, j], low[:, j] - high[:, i]) > touching).any(axis=0)
        a, b = i[joined], j[joined]
        way = chord[:, a] + chord[:, b]
        settled[joined] = (_is_advancing(points[..., a], way) & _is_advancing(points[..., b], way)) | (
            small[a] & small[b]
        )
        i, j, joined = i[~settled], j[~settled], joined[~settled]
        met = ~joined & (small[i] & small[j] | (len(i) > SPLINE_LIMITS.close_pairs))
        if met.any():
            middle = points.mean(axis=0)
            closest = np.linalg.norm(middle[:, i[met]] - middle[:, j[met]], axis=0).argmin()
            first, second = i[met][closest], j[met][closest]
            return float(start[first] + end[first]) / 2, float(start[second] + end[second]) / 2
        if not len(i):
            break
        used, places = np.unique(np.concatenate([i, j]), return_inverse=True)
        coefs, start, end = _halve_pieces(coefs[..., used], start[used], end[used])
        i, j = (
            2 * np.repeat(k, 4) + np.tile(half, len(k))
            for k, half in zip(np.split(places, 2), _CHILD_PAIRS, strict=True)
        )
        i, j = i[i <= j], j[i <= j]
    return None


_CHILD_PAIRS = np.array([[0, 0, 1, 1], [0, 1, 0, 1]])
"""The four pairs of a half of one piece and a half of another."""


def _halve_pieces(coefs: Array, start: Array, end: Array) -> tuple[Array, Array, Array]:
    """Halve pieces; the halves of piece k are 2k and 2k + 1."""
    twice = np.repeat(coefs, 2, axis=-1)
    x = np.tile([0.0, 0.5], len(start))
    middle = (start + end) / 2
    return (
        bernstein.restrict_pieces(twice, x, x + 0.5),
        np.stack([start, middle], axis=-1).ravel(),
        np.stack([middle, end], axis=-1).ravel(),
    )


def _is_advancing(points: Array, way: Array) -> Array:
    """Tell which pieces (degree + 1, dim, n) have control polygons all of whose steps advance along (dim, n)."""
    return np.asarray((np.diff(points, axis=0) * way).sum(axis=1).min(axis=0) > 0)


def _to_euclidean(coefs: Array, rational: bool) -> Array:
    return coefs[:, :-1] / coefs[:, -1:] if rational else coefs
