"""Where the rails of two blends cross on the face between them, and curves in which a blend ends there.

A blend that ends where its rails cross those of its neighbours leaves each of them in the direction of the other one:
only so do patches find common twists there. Knows splines only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.corners.tolerances import CORNER_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import normalise_vectors


@dataclass(frozen=True)
class RailCrossing:
    """Where two rails cross: their parameters (2,), the point (3,), and their unit tangents (2, 3)."""

    parameters: Array
    point: Array
    tangents: Array


def cross_rails(curves: tuple[Curve, Curve], ends: tuple[int, int]) -> RailCrossing:
    """Return the crossing of two rails on one face that is the nearest to given ends (0 or 1), or lies past them.

    Raises
    ------
    GeometryError
        If they do not cross.
    """
    t = _guess_crossing(curves, ends)
    longest = CORNER_TOLERANCES.crossing_step * np.array([np.ptp(one.domain) for one in curves])
    for _ in range(CORNER_TOLERANCES.crossing_steps):
        jets = np.stack([one.jet(np.array([at]), 1)[:, 0] for one, at in zip(curves, t, strict=True)])
        gap, rates = jets[0, 0] - jets[1, 0], np.stack([jets[0, 1], -jets[1, 1]], axis=1)
        step, *_ = np.linalg.lstsq(rates, -gap, rcond=None)
        t = t + np.clip(step, -longest, longest)
        if (np.abs(step) <= CORNER_TOLERANCES.crossing_exact * longest).all():
            break
    jets = np.stack([one.jet(np.array([at]), 1)[:, 0] for one, at in zip(curves, t, strict=True)])
    speed = float(np.linalg.norm(jets[:, 1], axis=1).max())
    apart = float(np.linalg.norm(jets[0, 0] - jets[1, 0]))
    if not apart <= CORNER_TOLERANCES.crossing_gap * speed * longest.max():
        raise GeometryError(f"the rails of two blends do not cross at the corner: they stay {apart:.3g} mm apart")
    return RailCrossing(t, jets[:, 0].mean(axis=0), normalise_vectors(jets[:, 1]))


def cross_end_tangents(curves: tuple[Curve, Curve], ends: tuple[int, int]) -> Array:
    """Return the parameters (2,) at which two rails would cross if they went on straight past given ends (0 or 1)."""
    stops = np.array([one.domain[end] for one, end in zip(curves, ends, strict=True)])
    jets = np.stack([one.jet(np.array([at]), 1)[:, 0] for one, at in zip(curves, stops, strict=True)])
    rates = np.stack([jets[0, 1], -jets[1, 1]], axis=1)
    steps, *_ = np.linalg.lstsq(rates, jets[1, 0] - jets[0, 0], rcond=None)
    return np.asarray(stops + steps)


def _guess_crossing(curves: tuple[Curve, Curve], ends: tuple[int, int]) -> Array:
    """Return the parameters (2,) of samples of two curves that are near to each other, the nearest to given ends.

    If none are as near as neighbours of one curve, they are those at the least distance.
    """
    count = CORNER_TOLERANCES.rail_crossing_samples
    t = [np.linspace(*(one.domain[::-1] if end else one.domain), count) for one, end in zip(curves, ends, strict=True)]
    first, second = (one(at) for one, at in zip(curves, t, strict=True))
    distances = np.linalg.norm(first[:, None] - second, axis=2)
    spacing = max(float(np.linalg.norm(np.diff(points, axis=0), axis=1).max()) for points in (first, second))
    far = np.add.outer(np.arange(count), np.arange(count))
    order = np.where(distances <= spacing, far, 2 * count + distances / spacing)
    i, k = np.unravel_index(order.argmin(), order.shape)
    return np.array([t[0][i], t[1][k]])


def build_end_section(surface: Surface, stops: Array, directions: Array) -> Curve:
    """Return the curve (t(v), v) in the parameter plane of a strip that ends where its rails cross others.

    Parameters
    ----------
    surface
        The strip H(t, v).
    stops
        The parameters t (2,) at v = 0 and v = 1.
    directions
        The directions (2, 3) of the other rails there, of any sense, in the tangent planes of the strip.

    Raises
    ------
    GeometryError
        If another rail runs in the direction of this strip's own.
    """
    v = np.array([0.0, 1.0])
    along, across = surface(stops, v, 1, 0), surface(stops, v, 0, 1)
    slopes = []
    for rate, width, direction in zip(along, across, directions, strict=True):
        factors, *_ = np.linalg.lstsq(np.stack([rate, width], axis=1), direction, rcond=None)
        if not abs(factors[1]) > CORNER_TOLERANCES.square_section * abs(factors[0]):
            raise GeometryError("the rails of two blends run in one direction where they meet")
        slopes.append(factors[0] / factors[1])
    low, high = stops
    t = np.array([low, low + slopes[0] / 3, high - slopes[1] / 3, high])
    if np.ptp(t) <= CORNER_TOLERANCES.square_section * np.ptp(surface.domain[0]):
        return build_square_section(float(t.mean()))
    return Curve.bezier(np.stack([t, [0.0, 1 / 3, 2 / 3, 1.0]], axis=1))


def build_square_section(t: float) -> Curve:
    """Return the curve (t, v) in the parameter plane of a strip that ends at one t."""
    return Curve.bezier([(t, 0.0), (t, 1.0)])
