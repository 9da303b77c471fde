"""Stations of an edge as a smooth function of its parameter.

An edge is a curve near the intersection of its sides, and its points are off along it by what its fit was off. Rails of
other blends do not notice, which may shift along themselves; cross derivatives that belong to points of the rails do,
and take twice the spans. Stations only select a plane for each section, so any that are smooth will do.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from cqblend.blends.contacts.contact_solver import Stations
from cqblend.blends.potential.tolerances import POTENTIAL_LIMITS, POTENTIAL_TOLERANCES
from cqblend.splines import Curve, interpolation
from cqblend.splines.bernstein import Array
from cqblend.surfaces.angles import shift_to_period, unwrap_parameters
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import normalise_vectors

StationFinder = Callable[[Array], Stations]


def smooth_stations(locate: StationFinder, primaries: tuple[Primary, Primary], *, closed: bool) -> StationFinder:
    """Return stations interpolated between a few of an edge; those of the edge itself where that would not do.

    It does not where the edge is not smooth itself, as at knot lines of its sides. Beyond the ends of an open edge,
    stations are those located.
    """
    t = np.linspace(0, 1, POTENTIAL_LIMITS.smoothed_stations + 1)
    located = locate(t[:-1] if closed else t)
    periods = [period for primary in primaries for period in primary.periods]
    uv = [unwrap_parameters(some, primary.periods) for some, primary in zip(located.uv, primaries, strict=True)]
    values = np.concatenate([located.points, located.tangents, *uv], axis=1)
    if closed:
        last = values[0].copy()
        for axis, period in enumerate(periods, 6):
            if period is not None:
                last[axis] = shift_to_period(last[axis], values[-1, axis], period)
        values = np.concatenate([values, last[None]])
    smooth = _SmoothStations(interpolation.interpolate(t, values, degree=5, periodic=closed), locate, closed)
    between = (t[:-1] + t[1:]) / 2
    exact, found = locate(between), smooth(between)
    turned = np.abs(exact.tangents - found.tangents).max()
    feet = [primary.jet(some)[0] for primary, some in zip(primaries, found.uv, strict=True)]
    moved = np.abs([exact.points - points for points in (found.points, *feet)]).max()
    step = float(np.linalg.norm(np.diff(located.points, axis=0), axis=1).max())
    is_smooth = turned <= POTENTIAL_TOLERANCES.station_turn and moved <= POTENTIAL_TOLERANCES.station_shift * step
    return smooth if is_smooth else locate


@dataclass(frozen=True)
class _SmoothStations:
    """Stations on a curve (dim 10) of points, tangents and parameters on both sides, over t in [0, 1]."""

    curve: Curve
    locate: StationFinder
    closed: bool

    def __call__(self, t: Array) -> Stations:
        values = self.curve(np.clip(t, 0.0, 1.0))
        beyond = (t < 0) | (t > 1)
        if beyond.any():
            located = self.locate(t[beyond])
            values[beyond] = np.concatenate([located.points, located.tangents, *located.uv], axis=1)
        return Stations(t, values[:, :3], normalise_vectors(values[:, 3:6]), (values[:, 6:8], values[:, 8:]))


def turns_steadily(tangents: Array) -> bool:
    """Whether unit tangents (n, 3) at equal steps are those of a line or a circle, to rounding."""
    neighbours = tangents[2:] + tangents[:-2]
    cosine = (neighbours * tangents[1:-1]).sum() / (2 * len(neighbours))
    return bool(np.abs(neighbours - 2 * cosine * tangents[1:-1]).max() <= POTENTIAL_TOLERANCES.steady_turn)
