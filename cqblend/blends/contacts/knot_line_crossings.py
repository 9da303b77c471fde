"""Corners: where rails, before they are fitted, cross knot lines at which a spline is not smooth enough for a fit.

Parameters of contacts have kinks there, even where the surface in space has none: circles as rational splines are made
of arcs whose parameters only just join. A fit that knows the places needs no more spans because of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cqblend.blends.contacts.contact_solver import ContactSolver
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import solve_in_brackets
from cqblend.surfaces.angles import shift_to_period
from cqblend.surfaces.primary import Primary
from cqblend.surfaces.tensor_surface import TensorSurface

LEAST_SMOOTH_CONTINUITY = 3  # continuity, below which a knot line makes corners
SEARCH_STATIONS, SECANT_STEPS = 129, 30  # contacts between which crossings are looked for, and steps to find them
KINK_PROBE_SHARE = 1e-3  # of a rail: as near to a line, kinks are looked for
CROSSING_TOLERANCE = 1e-13  # of a parameter: as near as that, a line is reached


class ContactCrossing(NamedTuple):
    """Where contacts of a side cross a knot line: at t, parameter ``axis`` = ``value``.

    It is ``sharp`` if the surface is less than C2 there, so that directions across are no more than C0, and a ``bend``
    if only its parameters have that kink, its shape not. Then ``smooth`` says that the contacts have none in these
    parameters: they have it in space.
    """

    t: float
    side: int
    axis: int
    value: float
    sharp: bool
    bend: bool = False
    smooth: bool = False


def find_contact_crossings(
    solve: ContactSolver, primary: Primary, side: int, domain: tuple[float, float], bent: int
) -> list[ContactCrossing]:
    """Return where contacts cross knot lines of a spline that is less than C3 there; bends are of order ``bent``."""
    if not isinstance(primary, TensorSurface) or all(primary.is_angular):
        return []
    rough: list[list[tuple[float, int]]] = [
        list(zip(primary.inner_knot_lines(axis).tolist(), primary.knot_continuity[axis].tolist(), strict=True))
        for axis in (0, 1)
    ]
    for axis, period in enumerate(primary.periods):
        if period is not None:
            rough[axis].append((float(primary.breaks[axis][0]), primary.seam_continuity[axis]))
    if all(order >= LEAST_SMOOTH_CONTINUITY for lines in rough for _, order in lines):
        return []
    t = np.linspace(*domain, SEARCH_STATIONS)
    uv = solve(t).uv[side]
    found: list[
        tuple[ContactCrossing, float, float, float]
    ] = []  # with the end of the bracket, and the values at both ends
    for axis, lines in enumerate(rough):
        period = primary.periods[axis]
        for line, order in lines:
            off = distance_past_knot(uv[:, axis], line, period)
            jump = np.inf if period is None else period / 4
            passing = (off[:-1] * off[1:] <= 0) & (np.abs(np.diff(off)) < jump) & (off[:-1] != off[1:])
            if order < 3:
                found += [
                    (
                        ContactCrossing(float(t[i]), side, axis, line, order < 2),
                        float(t[i + 1]),
                        float(off[i]),
                        float(off[i + 1]),
                    )
                    for i in np.flatnonzero(passing)
                ]
    if not found:
        return []
    low, first = np.array([one.t for one, *_ in found]), np.array([value for _, _, value, _ in found])
    high, last = np.array([end for _, end, _, _ in found]), np.array([value for *_, value in found])
    axes = np.array([one.axis for one, *_ in found])

    def measure_past_knots(t: Array) -> Array:
        ascending = np.argsort(t, kind="stable")
        reached = np.empty_like(t)
        reached[ascending] = solve(t[ascending]).uv[side][np.arange(len(t)), axes[ascending]]
        return np.array(
            [
                float(distance_past_knot(reached[k : k + 1], one.value, primary.periods[one.axis])[0])
                for k, (one, *_) in enumerate(found)
            ]
        )

    middle = solve_in_brackets(measure_past_knots, (low, high), (first, last), CROSSING_TOLERANCE, SECANT_STEPS)
    ascending = np.argsort(middle, kind="stable")
    reached = solve(middle[ascending]).uv[side]
    crossings = []
    for i, at in zip(ascending.tolist(), reached, strict=True):
        one = found[i][0]._replace(t=float(middle[i]))
        at[one.axis] -= distance_past_knot(at[one.axis : one.axis + 1], one.value, primary.periods[one.axis])[0]
        (continuity,), (shape,), _ = primary.measure_smoothness(at[None], one.axis)
        bend = continuity <= bent and continuity < shape
        smooth = bend and continuity > 0 and _is_smoother_in_parameters(solve, primary, one, domain)
        crossings.append(one._replace(bend=bend, smooth=smooth))
    return crossings


def _is_smoother_in_parameters(
    solve: ContactSolver, primary: TensorSurface, one: ContactCrossing, domain: tuple[float, float]
) -> bool:
    """Whether second derivatives of contacts jump less in the parameters of their surface than in space."""
    step = min(KINK_PROBE_SHARE * (domain[1] - domain[0]), (one.t - domain[0]) / 4, (domain[1] - one.t) / 4)
    uv = solve(one.t + step * np.arange(-3, 4)).uv[one.side]
    for axis, period in enumerate(primary.periods):
        if period is not None:
            uv[:, axis] = shift_to_period(uv[:, axis], uv[3:4, axis], period)
    jet = primary.jet(uv)
    weights = np.array([1, -4, 5, 0, -5, 4, -1])  # one-sided second differences, the one after less that before
    native, space = weights @ uv, weights @ jet[0]
    return bool(np.linalg.norm(native[0] * jet[1, 3] + native[1] * jet[2, 3]) < np.linalg.norm(space))


def distance_past_knot(values: Array, line: float, period: float | None) -> Array:
    """Return how far (n,) parameters are past a knot line, of the nearest lap."""
    return values - (line if period is None else shift_to_period(np.full_like(values, line), values, period))
