"""The blend surface between two rails: cubic Hermite across, the rails' own splines along.

In homogeneous 4-space, with v running from rail 1 to rail 2 (Kim & Elber, section 2, with a gauge for the weight),

    H(t, v) = C1 (2v^3 - 3v^2 + 1) + C2 (3v^2 - 2v^3) + T1 (v^3 - 2v^2 + v) - T2 (v^3 - v^2),

whose four rows of poles across are C1, C1 + T1/3, C2 + T2/3, C2: both fields point into the blend. The *exact* form
takes C = P(c) and T = DP(c) d as they are, of any degree. The *compact* form replaces them by quintics within a
tolerance in position and angle.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import comb, perm
from typing import Literal

import numpy as np

from cqblend.blends.primaries import Array, cross
from cqblend.blends.ribbons import Ribbon
from cqblend.errors import DegreeError, GeometryError
from cqblend.splines import Curve, Surface, fit

Form = Literal["exact", "compact"]
LARGEST_DEGREE = 25  # of OCCT's B-splines
LIGHT_DEGREE = 7  # up to which ``auto`` keeps the exact form
FINEST = 4096  # pieces of a compact blend
JUMP = 1e-7  # of a field, relative: more is a crease of the surface, not rounding


@dataclass(frozen=True)
class Blend:
    """A blend surface H(t, v), v = 0 on the first rail and 1 on the second, and what it was made from."""

    surface: Surface
    ribbons: tuple[Ribbon, Ribbon]
    form: Form


def _jets(ribbons: tuple[Ribbon, Ribbon]) -> tuple[list[Curve], list[Curve]]:
    """Return the homogeneous jets of both ribbons on common breaks, each of the lowest degree that it really has."""
    sides = [[_lowest(jet, ribbon.c) for jet in ribbon.jets()[: ribbon.order + 1]] for ribbon in ribbons]
    for jets in sides:
        if len(jets) > 1:
            _check_smooth(jets[0], jets[1])
    breaks = merge(*(jet.breaks for jets in sides for jet in jets))
    first, second = ([jet.cut(breaks[1:-1]) for jet in jets] for jets in sides)
    return first, second


def _check_smooth(rail: Curve, field: Curve) -> None:
    """Raise GeometryError where the surface has a crease across the rail: there, the field jumps."""
    t = rail.breaks[1:-1]
    if not len(t):
        return
    before, after = (_values(rail, field, t, side)[1][0] for side in ("left", "right"))
    jump = np.linalg.norm(after - before, axis=1)
    if jump.max() > JUMP * np.abs(after).max():
        raise GeometryError(
            f"a face has a crease across the blend at t = {t[jump.argmax()]:.4g}: the directions into it jump by "
            f"{jump.max():.2g}; blend the smooth parts one by one"
        )


def merge(*sets: Array) -> Array:
    """Unite sets of breaks; those equal to rounding count once."""
    breaks = np.unique(np.concatenate(sets))
    tiny = 1e-13 * (breaks[-1] - breaks[0])
    return breaks[np.append(True, np.diff(breaks) > tiny)]


def _lowest(curve: Curve, rail: Curve) -> Curve:
    """Reduce the degree where a light rail, of degree 1 or 2, lets terms cancel; short cubic pieces only seem to."""
    return curve.reduce(tolerance=1e-13) if rail.degree < 3 else curve


def section(sides: tuple[list[Curve], list[Curve]]) -> Surface:
    """Assemble the Hermite surface H(t, v) of the jets of two ribbons, of degree k1 + k2 + 1 across.

    With p that degree, the rows of poles from the first rail on are

        b_i = sum_r C(i, r) (p - r)!/p! J_r,    i = 0 .. k1,

    and from the second rail on likewise: both ribbons run into the blend, so no signs change. Homogeneous jets (dim 4)
    give a rational surface, unless their weight is one.

    Raises
    ------
    GeometryError
        If a weight is not positive.
    """
    degree = len(sides[0]) + len(sides[1]) - 1
    largest = max(jet.degree for jets in sides for jet in jets)
    rows = []
    for jets in sides:
        coefs = [jet.elevate(largest - jet.degree).coefs for jet in jets]
        rows.append([sum(comb(i, r) / perm(degree, r) * coefs[r] for r in range(i + 1)) for i in range(len(coefs))])
    poles = np.stack([*rows[0], *reversed(rows[1])], axis=1)[..., None]
    continuity = np.min([jet.continuity for jets in sides for jet in jets], axis=0)
    rational = False
    if poles.shape[2] == 4:
        weight = poles[:, :, 3]
        if not np.all(weight > 0):
            raise GeometryError("the blend's weight is not positive everywhere: the size is too large for these faces")
        rational = bool(np.abs(weight - 1).max() > 1e-14)
        poles = poles if rational else poles[:, :, :3]
    breaks = (sides[0][0].breaks, np.array([0.0, 1.0]))
    return Surface(breaks, poles, rational=rational, continuity=(continuity, np.empty(0, int)))


def hermite(ribbons: tuple[Ribbon, Ribbon], form: str, tolerance: float, angular_tolerance: float) -> Blend:
    """Blend two ribbons, with as many orders of continuity on each as it has directions.

    ``form`` is "exact", "compact" or "auto" (exact where its degree is at most 7).

    Raises
    ------
    DegreeError
        If the exact form is asked for and its degree is above 25.
    GeometryError
        If the compact form does not reach the tolerances on 4096 pieces.
    """
    jets = _jets(ribbons)
    degree = max(jet.degree for side in jets for jet in side)
    if form == "compact" or (form == "auto" and degree > LIGHT_DEGREE):
        return Blend(section(compact(jets, tolerance, angular_tolerance)), ribbons, "compact")
    if degree > LARGEST_DEGREE:
        raise DegreeError(
            f"the exact blend has degree {degree} along the rail, OCCT holds {LARGEST_DEGREE}; take form='compact'"
        )
    return Blend(section(jets), ribbons, "exact")


def _euclidean(rail: Array, field: Array) -> tuple[Array, Array]:
    """Turn homogeneous jets (3, n, 4) of a rail and its field into Euclidean ones, (3, n, 3) each.

    The rail is X / w, the field (T_xyz - X/w T_w) / w, with their first and second derivatives by the product rule.
    """
    w, wt, wtt = rail[..., 3:]
    c0 = rail[0, :, :3] / w
    c1 = (rail[1, :, :3] - c0 * wt) / w
    c2 = (rail[2, :, :3] - 2 * c1 * wt - c0 * wtt) / w
    g, gt, gtt = field[..., 3:]
    f0 = (field[0, :, :3] - c0 * g) / w
    f1 = (field[1, :, :3] - c1 * g - c0 * gt - f0 * wt) / w
    f2 = (field[2, :, :3] - c2 * g - 2 * c1 * gt - c0 * gtt - 2 * f1 * wt - f0 * wtt) / w
    return np.stack([c0, c1, c2]), np.stack([f0, f1, f2])


def _values(rail: Curve, field: Curve, t: Array, side: Literal["left", "right"]) -> tuple[Array, Array]:
    return _euclidean(
        np.stack([rail(t, k, side=side) for k in range(3)]), np.stack([field(t, k, side=side) for k in range(3)])
    )


def compact(
    sides: tuple[list[Curve], list[Curve]], tolerance: float, angular_tolerance: float
) -> tuple[list[Curve], list[Curve]]:
    """Replace C1, T1, T2, C2 by quintics: local Hermite interpolation on their own breaks, halved where it errs.

    The error in angle is that of the plane of C' and T against the exact one; it decides long before the position does.
    """
    pairs = sides
    breaks = pairs[0][0].breaks
    inner = (np.arange(1, 8) / 8)[:, None]
    while True:
        fitted, bad = [], np.zeros(len(breaks) - 1, bool)
        for rail, field in pairs:
            starts, ends = _values(rail, field, breaks[:-1], "right"), _values(rail, field, breaks[1:], "left")
            c, f = (fit.hermite(breaks, np.stack([a, b], axis=2)) for a, b in zip(starts, ends, strict=True))
            t = (breaks[:-1] + inner * np.diff(breaks)).ravel()
            (point, rate, _), (vector, _, _) = _values(rail, field, t, "right")
            exact, fit_normal = cross(rate, vector), cross(c(t, 1), f(t))
            angle = np.arctan2(np.linalg.norm(cross(exact, fit_normal), axis=1), (exact * fit_normal).sum(1))
            gap = np.linalg.norm(c(t) - point, axis=1)
            errors = (gap > tolerance / 2) | (angle > angular_tolerance / 2)
            bad |= errors.reshape(len(inner), -1).any(axis=0)
            fitted += [c, f]
        if not bad.any():
            break
        if len(breaks) > FINEST:
            raise GeometryError(
                f"a compact blend of {FINEST} pieces does not reach {tolerance:g} mm and {angular_tolerance:g} rad"
            )
        breaks = np.sort(np.concatenate([breaks, (breaks[:-1] + breaks[1:])[bad] / 2]))
    sources = [curve for pair in pairs for curve in pair]
    made = [_known(curve, row) for curve, row in zip(fitted, sources, strict=True)]
    return made[:2], made[2:]


def _known(curve: Curve, source: Curve) -> Curve:
    """Give a fitted curve the continuity of its source, 2 at most."""
    known = dict(zip(source.breaks[1:-1].tolist(), source.continuity.tolist(), strict=True))
    continuity = np.array([min(2, known.get(t, 2)) for t in curve.breaks[1:-1].tolist()], int)
    return Curve(curve.breaks, curve.coefs, continuity=continuity)
