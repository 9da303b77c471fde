"""Ends of ribbons that are given: jets in space, and the values and slopes of lifted curves that have these jets.

Two blends share the section at a common end, and meet along it with one tangent plane, if they share their jets across
and the derivatives of these along the rails, up to one positive factor. Ribbons fitted with such ends do so to
rounding, on whatever surfaces they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.blends.rails.ribbon import Ribbon, evaluate_space_jets
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.vectors import to_tangent_coordinates


@dataclass(frozen=True)
class EndJets:
    """Derivatives across a blend at one end of a rail, ``values`` (m, 3) by order, and their ``rates`` (m, 3) along it.

    The first row is the position; there is a second one, the cross derivative, even if the order of continuity is 0.
    """

    values: Array
    rates: Array

    @classmethod
    def from_ribbon(cls, ribbon: Ribbon, end: int) -> EndJets:
        """Evaluate a ribbon where it starts (``end`` 0) or ends (1)."""
        side: BreakSide = "left" if end else "right"
        jets = evaluate_space_jets(ribbon.jets, np.array([ribbon.c.domain[end]]), 1, side)[:, :, 0]
        return cls(jets[:, 0], jets[:, 1])


@dataclass(frozen=True)
class RibbonEnd:
    """The end of a ribbon in lifted parameters: rows for the rail and for each direction.

    ``values`` and ``slopes``, (m, k), are those of the curves, ``uv`` (2,) the native parameters of the rail's end. The
    homogeneous weight of the ribbon is 1 there to the first order in both of its parameters, so that polynomial and
    rational ribbons with the same jets in space have the same section.

    Directions of order 2 and more differ from what they are without given ends over the length ``fade``, in the rail's
    parameter; if it is 0, at the end alone.
    """

    uv: Array
    values: Array
    slopes: Array
    fade: float = 0.0


GivenEnds = tuple[RibbonEnd | None, RibbonEnd | None]
"""The ends of a ribbon that are given, at its start and at its stop."""

FREE_ENDS: GivenEnds = (None, None)


def lift_end(primary: Primary, uv: Array, jets: EndJets, step: float) -> tuple[RibbonEnd, EndJets]:
    """Return the end of a ribbon on a surface with wanted jets at native parameters (2,), and the jets that it has.

    Of the wanted jets, only what is tangent to the surface is free: the position is that at ``uv``, and the normal
    parts of all others follow from the tangent ones. ``step`` is a small step along the rail into the ribbon, in the
    rail's parameter, on whose side of a knot line the surface is taken.
    """
    at = uv[None]
    native = primary.jet(at)
    point = primary.lift_points(at)
    rate = _lift_tangent(primary, at, point, native, jets.rates[0])
    values, slopes = [point[0]], [rate]
    for k in range(1, len(jets.values)):
        value = jets.values[k]
        if k > 1:  # before, nothing follows from lower orders
            found, weights = _evaluate_end(primary, values, slopes, k, step)
            value = value - found.values[k]
        values.append(_lift_tangent(primary, at, point, native, value))
        if k > 1:
            values[k] -= weights[0] * point[0] * primary.weight_exponents
        slopes.append(np.zeros_like(rate))
        found, weights = _evaluate_end(primary, values, slopes, k, step)
        slopes[k] = _lift_tangent(primary, at, point, native, jets.rates[k] - found.rates[k])
        slopes[k] -= weights[1] * point[0] * primary.weight_exponents
    end = RibbonEnd(uv, np.stack(values), np.stack(slopes))
    return end, _evaluate_end(primary, values, slopes, len(values) - 1, step)[0]


def _lift_tangent(primary: Primary, uv: Array, point: Array, native: Array, vector: Array) -> Array:
    """Return the lifted direction (k,) of the tangent part of a vector (3,)."""
    return primary.lift_directions(uv, point, to_tangent_coordinates(native, vector[None]))[0]


def _evaluate_end(
    primary: Primary, values: list[Array], slopes: list[Array], order: int, step: float
) -> tuple[EndJets, Array]:
    """Return the jets up to an order of curves with values and slopes (k,) at 0; also the weight of the last, (2,).

    That is its homogeneous weight and the derivative of it.
    """
    breaks = np.array(sorted((0.0, step)))
    lines = [
        Curve(breaks, np.stack([value + slope * t for t in breaks])[:, :, None])
        for value, slope in zip(values, slopes, strict=True)
    ]
    jets = primary.compose_jets(lines[0], lines[1:], order)
    side: BreakSide = "left" if step < 0 else "right"
    at = np.zeros(1)
    space = evaluate_space_jets(jets, at, 1, side)[:, :, 0]
    return EndJets(space[:, 0], space[:, 1]), jets[order].jet(at, 1, side=side)[:, 0, 3]


def find_foot(primary: Primary, point: Array, near: Array) -> Array:
    """Return the native parameters (2,) of the foot of a point (3,) on a surface, from parameters near to it."""
    uv = near[None]
    for _ in range(RAIL_TOLERANCES.foot_steps):
        jet = primary.jet(uv)
        step = to_tangent_coordinates(jet, point - jet[0])
        uv = uv + step
        if (
            np.linalg.norm(step[:, :1] * jet[1] + step[:, 1:] * jet[2])
            <= RAIL_TOLERANCES.foot_step * np.abs(point).max()
        ):
            break
    return np.asarray(uv[0])
