"""The blend surface between two rails: cubic Hermite across, the rails' own splines along.

In homogeneous 4-space, with v running from rail 1 to rail 2 (Kim & Elber, section 2, with a gauge for the weight),

    H(t, v) = C1 (2v^3 - 3v^2 + 1) + C2 (3v^2 - 2v^3) + T1 (v^3 - 2v^2 + v) - T2 (v^3 - v^2),

whose four rows of poles across are C1, C1 + T1/3, C2 + T2/3, C2: both fields point into the blend. The *exact* form
takes C = P(c) and T = DP(c) d as they are, of any degree. The *compact* form replaces them by quintics within a
tolerance in position and angle.
"""

from __future__ import annotations

from dataclasses import dataclass
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


def _rows(rails: tuple[Ribbon, Ribbon]) -> list[Curve]:
    """Return C1, T1, T2, C2 as homogeneous splines on common breaks, each of the lowest degree that it really has."""
    rows = []
    for rail in rails:
        rows.append(
            [
                _lowest(curve, rail.c)
                for curve in (rail.primary.position(rail.c), rail.primary.tangent(rail.c, rail.directions[0]))
            ]
        )
        _check_smooth(*rows[-1])
    curves = [rows[0][0], rows[0][1], rows[1][1], rows[1][0]]
    breaks = merge(*(curve.breaks for curve in curves))
    return [curve.cut(breaks[1:-1]) for curve in curves]


def _check_smooth(rail: Curve, field: Curve) -> None:
    """Raise GeometryError where the surface has a crease across the rail: there, the field jumps."""
    t = rail.breaks[1:-1]
    if not len(t):
        return
    before, after = (_jets(rail, field, t, side)[1][0] for side in ("left", "right"))
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


def _surface(rows: list[Curve]) -> Surface:
    """Assemble the Hermite surface of C1, T1, T2, C2 (homogeneous); polynomial if its weight is one."""
    degree = max(row.degree for row in rows)
    c1, t1, t2, c2 = (row.elevate(degree - row.degree) for row in rows)
    poles = np.stack([c1.coefs, c1.coefs + t1.coefs / 3, c2.coefs + t2.coefs / 3, c2.coefs], axis=1)[..., None]
    weight = poles[:, :, 3]
    if not np.all(weight > 0):
        raise GeometryError("the blend's weight is not positive everywhere: the size is too large for these faces")
    continuity = np.min([row.continuity for row in (c1, t1, t2, c2)], axis=0)
    breaks = (c1.breaks, np.array([0.0, 1.0]))
    rational = bool(np.abs(weight - 1).max() > 1e-14)
    return Surface(
        breaks, poles if rational else poles[:, :, :3], rational=rational, continuity=(continuity, np.empty(0, int))
    )


def hermite(rails: tuple[Ribbon, Ribbon], form: str, tolerance: float, angular_tolerance: float) -> Blend:
    """Blend two rails.

    ``form`` is "exact", "compact" or "auto" (exact where its degree is at most 7).

    Raises
    ------
    DegreeError
        If the exact form is asked for and its degree is above 25.
    GeometryError
        If the compact form does not reach the tolerances on 4096 pieces.
    """
    rows = _rows(rails)
    degree = max(row.degree for row in rows)
    if form == "compact" or (form == "auto" and degree > LIGHT_DEGREE):
        return Blend(_surface(_compact(rows, tolerance, angular_tolerance)), rails, "compact")
    if degree > LARGEST_DEGREE:
        raise DegreeError(
            f"the exact blend has degree {degree} along the rail, OCCT holds {LARGEST_DEGREE}; take form='compact'"
        )
    return Blend(_surface(rows), rails, "exact")


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


def _jets(rail: Curve, field: Curve, t: Array, side: Literal["left", "right"]) -> tuple[Array, Array]:
    return _euclidean(
        np.stack([rail(t, k, side=side) for k in range(3)]), np.stack([field(t, k, side=side) for k in range(3)])
    )


def _compact(rows: list[Curve], tolerance: float, angular_tolerance: float) -> list[Curve]:
    """Replace C1, T1, T2, C2 by quintics: local Hermite interpolation on their own breaks, halved where it errs.

    The error in angle is that of the plane of C' and T against the exact one; it decides long before the position does.
    """
    pairs = ((rows[0], rows[1]), (rows[3], rows[2]))
    breaks = rows[0].breaks
    inner = (np.arange(1, 8) / 8)[:, None]
    while True:
        fitted, bad = [], np.zeros(len(breaks) - 1, bool)
        for rail, field in pairs:
            starts, ends = _jets(rail, field, breaks[:-1], "right"), _jets(rail, field, breaks[1:], "left")
            c, f = (fit.hermite(breaks, np.stack([a, b], axis=2)) for a, b in zip(starts, ends, strict=True))
            t = (breaks[:-1] + inner * np.diff(breaks)).ravel()
            (point, rate, _), (vector, _, _) = _jets(rail, field, t, "right")
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
    order = [fitted[0], fitted[1], fitted[3], fitted[2]]
    return [
        _homogeneous(curve, row, weight) for curve, row, weight in zip(order, rows, (1.0, 0.0, 0.0, 1.0), strict=True)
    ]


def _homogeneous(curve: Curve, source: Curve, weight: float) -> Curve:
    """Append a constant weight to a fitted curve, whose continuity is that of its source, 2 at most."""
    known = dict(zip(source.breaks[1:-1].tolist(), source.continuity.tolist(), strict=True))
    continuity = np.array([min(2, known.get(t, 2)) for t in curve.breaks[1:-1].tolist()], int)
    coefs = np.concatenate([curve.coefs, np.full_like(curve.coefs[:, :1], weight)], axis=1)
    return Curve(curve.breaks, coefs, continuity=continuity)
