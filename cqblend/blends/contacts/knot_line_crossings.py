"""Finds where contact curves cross knot lines of a spline surface, before rails are fitted to them.

At a knot line at which the surface is less than C3, the native parameters of contacts may have kinks, even where the
surface has none in space: a circle as a rational spline is made of arcs whose parametrisations only just join. A fit
with a break at the crossing needs no more spans because of the kink.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from cqblend.blends.contacts.contact_solver import ContactSolver
from cqblend.blends.contacts.tolerances import CONTACT_TOLERANCES
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import solve_in_brackets
from cqblend.surfaces.angles import shift_to_period
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.tensor_surface import TensorSurface


@dataclass(frozen=True)
class ContactCrossing:
    """Where the contacts of one side (0 or 1) cross a knot line, native parameter ``axis`` = ``value``, at ``t``.

    ``below_c2``: the surface is less than C2 there, so that cross directions are no more than C0. ``parametric_kink``:
    it is its parametrisation that has the kink, its shape is smoother. Then ``smooth_in_parameters`` says that the
    contact curve has no kink in (u, v); it has one in space.
    """

    t: float
    side: int
    axis: int
    value: float
    below_c2: bool
    parametric_kink: bool = False
    smooth_in_parameters: bool = False


@dataclass(frozen=True)
class _KnotLine:
    """A knot line ``axis`` = ``value``, periodic with ``period``, and the continuity of the surface across it."""

    axis: int
    value: float
    period: float | None
    continuity: int


@dataclass(frozen=True)
class _CrossingBracket:
    """Stations ``low`` < t < ``high`` between which the contacts pass a line, and how far past it they are there."""

    line: _KnotLine
    low: float
    high: float
    low_distance: float
    high_distance: float


def find_contact_crossings(
    solve: ContactSolver, primary: Primary, side: int, domain: tuple[float, float], order: int
) -> list[ContactCrossing]:
    """Return where the contacts of a side cross knot lines at which its surface, a spline, is less than C3.

    Parametric kinks are reported for jets up to ``order``.
    """
    if not isinstance(primary, TensorSurface) or all(primary.is_angular):
        return []
    rough = [line for line in _list_knot_lines(primary) if line.continuity < CONTACT_TOLERANCES.rough_continuity]
    if not rough:
        return []
    brackets = _bracket_crossings(solve, rough, side, domain)
    if not brackets:
        return []
    t = _solve_crossings(solve, brackets, side)
    ascending = np.argsort(t, kind="stable")
    reached = solve(t[ascending]).uv[side]
    crossings = []
    for i, uv in zip(ascending.tolist(), reached, strict=True):
        line = brackets[i].line
        crossing = ContactCrossing(float(t[i]), side, line.axis, line.value, line.continuity < 2)
        uv[line.axis] -= distance_past_knot(uv[line.axis : line.axis + 1], line.value, line.period)[0]
        (continuity,), (shape_continuity,), _ = primary.measure_smoothness(uv[None], line.axis)
        if continuity <= order and continuity < shape_continuity:
            smooth = continuity > 0 and _is_smoother_in_parameters(solve, primary, crossing, domain)
            crossing = replace(crossing, parametric_kink=True, smooth_in_parameters=smooth)
        crossings.append(crossing)
    return crossings


def _list_knot_lines(primary: TensorSurface) -> list[_KnotLine]:
    """Return the knot lines inside the domain, and those at which a periodic surface closes."""
    lines = []
    for axis, period in enumerate(primary.periods):
        inner = zip(primary.inner_knot_lines(axis).tolist(), primary.knot_continuity[axis].tolist(), strict=True)
        lines += [_KnotLine(axis, value, period, continuity) for value, continuity in inner]
        if period is not None:
            lines.append(_KnotLine(axis, float(primary.breaks[axis][0]), period, primary.seam_continuity[axis]))
    return lines


def _bracket_crossings(
    solve: ContactSolver, lines: list[_KnotLine], side: int, domain: tuple[float, float]
) -> list[_CrossingBracket]:
    """Return the pairs of neighbouring stations between which contacts pass a line."""
    t = np.linspace(*domain, CONTACT_TOLERANCES.crossing_stations)
    uv = solve(t).uv[side]
    brackets = []
    for line in lines:
        past = distance_past_knot(uv[:, line.axis], line.value, line.period)
        jump = np.inf if line.period is None else line.period / 4
        passing = (past[:-1] * past[1:] <= 0) & (np.abs(np.diff(past)) < jump) & (past[:-1] != past[1:])
        brackets += [
            _CrossingBracket(line, float(t[i]), float(t[i + 1]), float(past[i]), float(past[i + 1]))
            for i in np.flatnonzero(passing)
        ]
    return brackets


def _solve_crossings(solve: ContactSolver, brackets: list[_CrossingBracket], side: int) -> Array:
    """Return the t (n,) at which contacts are on the lines, for all brackets at once."""
    ends = np.array([(one.low, one.high) for one in brackets]).T
    distances = np.array([(one.low_distance, one.high_distance) for one in brackets]).T
    axes = np.array([one.line.axis for one in brackets])

    def measure_past_lines(t: Array) -> Array:
        ascending = np.argsort(t, kind="stable")
        reached = np.empty_like(t)
        reached[ascending] = solve(t[ascending]).uv[side][np.arange(len(t)), axes[ascending]]
        return np.array(
            [
                float(distance_past_knot(reached[k : k + 1], one.line.value, one.line.period)[0])
                for k, one in enumerate(brackets)
            ]
        )

    residual, steps = CONTACT_TOLERANCES.crossing_residual, CONTACT_TOLERANCES.secant_steps
    return solve_in_brackets(measure_past_lines, (ends[0], ends[1]), (distances[0], distances[1]), residual, steps)


def _is_smoother_in_parameters(
    solve: ContactSolver, primary: TensorSurface, crossing: ContactCrossing, domain: tuple[float, float]
) -> bool:
    """Whether second derivatives of contacts jump less in the parameters of their surface than in space."""
    room = (crossing.t - domain[0]) / 4, (domain[1] - crossing.t) / 4
    step = min(CONTACT_TOLERANCES.kink_probe_share * (domain[1] - domain[0]), *room)
    uv = solve(crossing.t + step * np.arange(-3, 4)).uv[crossing.side]
    for axis, period in enumerate(primary.periods):
        if period is not None:
            uv[:, axis] = shift_to_period(uv[:, axis], uv[3:4, axis], period)
    jet = primary.jet(uv)
    weights = np.array([1, -4, 5, 0, -5, 4, -1])  # one-sided second differences, the one after less that before
    native, space = weights @ uv, weights @ jet[0]
    return bool(np.linalg.norm(native[0] * jet[1, 3] + native[1] * jet[2, 3]) < np.linalg.norm(space))


def distance_past_knot(values: Array, knot: float, period: float | None) -> Array:
    """Return how far (n,) native parameters are past a knot, or past its nearest repetition by the period."""
    return values - (knot if period is None else shift_to_period(np.full_like(values, knot), values, period))
