"""Recomputes a surface along a rail in local coordinates, so that the proof loses no digits.

Nothing is taken from the blend. Breaks are where the rail crosses knot lines, however close together; derivatives along
the rail come from its velocity, and derivatives into the blend from their directions, not from differences: so they are
accurate on very short pieces, too. Depends on ribbons and primary surfaces only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from cqblend.blends.quality.evaluation_rounding import RoundingBounds, bound_rounding
from cqblend.blends.quality.tolerances import PROOF_TOLERANCES
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.knots import extract_pieces
from cqblend.splines.surface import BSplineSurface
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.quadrics import Quadric
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse, RevolvedSpline
from cqblend.surfaces.tensor_surface import SplineSurface
from cqblend.surfaces.vectors import LocalFrame


@dataclass(frozen=True)
class RecomputedRibbon:
    """The primary of a ribbon along its rail, both moved by -``origin`` (3,)."""

    ribbon: Ribbon
    origin: Array

    @cached_property
    def primary(self) -> Primary:
        """The moved primary."""
        return _translate_primary(self.ribbon.primary, -self.origin)

    @cached_property
    def normal(self) -> Curve:
        """A normal of the tangent plane, dim 3."""
        return self.primary.compose_normal(self.ribbon.c)

    @cached_property
    def derivatives_along(self) -> tuple[Curve, ...]:
        """Homogeneous derivatives along the rail, of orders 0 to 2."""
        c = self.ribbon.c
        return self.primary.compose_jets(c, [c.derivative(), c.derivative(2)], 2)

    @cached_property
    def derivatives_across(self) -> tuple[Curve, ...]:
        """Homogeneous derivatives into the blend, of orders 0 to 2."""
        return self.primary.compose_jets(self.ribbon.c, self.ribbon.directions[:2], 2)

    @cached_property
    def mixed_derivative(self) -> tuple[Curve, float]:
        """The homogeneous second derivative of the ribbon's map in the direction (1, x) of (t, v), and x."""
        c, directions = self.ribbon.c, self.ribbon.directions
        d = directions[0]
        rail_speed, cross_length = (float(np.abs(curve.coefs).max()) for curve in (c.derivative(), d))
        x = rail_speed / cross_length
        second = c.derivative(2) + d.derivative() * (2 * x)
        if len(directions) > 1:
            second = second + directions[1] * x**2
        return self.primary.compose_jets(c, [c.derivative() + d * x, second], 2)[2], x

    @cached_property
    def native_derivatives(self) -> dict[str, Curve]:
        """Homogeneous derivatives of a spline by its native parameters "u" and "v", along the rail."""
        c = self.ribbon.c
        pairs = c.coefs[:, 0:2].sum(1), c.coefs[:, 2:4].sum(1)
        steps = {}
        for axis, name in enumerate("uv"):
            zero = np.zeros_like(pairs[axis])
            rows = [-pairs[axis], pairs[axis], zero, zero] if axis == 0 else [zero, zero, -pairs[axis], pairs[axis]]
            step = Curve(c.breaks, np.stack(rows, axis=1), continuity=c.continuity)
            steps[name] = self.primary.compose_jets(c, [step], 1)[1]
        return steps

    @cached_property
    def evaluation_rounding(self) -> Callable[[Array], RoundingBounds] | None:
        """Bounds of the rounding of OCCT's evaluation of the primary, as a function of t (n,).

        None if OCCT evaluates the primary by formulas.
        """
        primary, c = self.ribbon.primary, self.ribbon.c
        if not isinstance(primary, SplineSurface):
            return None
        relative = (c.degree + 1) * PROOF_TOLERANCES.rail_parameter
        u_error, v_error = (relative * max(abs(breaks[0]), abs(breaks[-1])) for breaks in primary.breaks)
        table = bound_rounding(primary.surface.to_bspline(), None, (u_error, v_error))

        def select_rounding(t: Array) -> RoundingBounds:
            uv = primary.wrap_parameters(self.ribbon.find_native_parameters(t))
            spans = [
                np.clip(np.searchsorted(breaks, values, "right") - 1, 0, len(breaks) - 2)
                for breaks, values in zip(primary.breaks, uv.T, strict=True)
            ]
            return table.take_spans(spans[0], spans[1])

        return select_rounding


def _translate_primary(primary: Primary, by: Array) -> Primary:
    """Return a primary moved by a vector; points have the same lifted parameters as before."""
    if isinstance(primary, SplineSurface):
        coefs = extract_moved_pieces(primary.surface.to_bspline(), by)
        surface = Surface(primary.breaks, coefs[:, :, : 3 + primary.rational], rational=primary.rational)
        return replace(primary, surface=surface, patches=coefs)
    if isinstance(primary, Quadric):
        return replace(primary, frame=_translate_frame(primary.frame, by))
    if isinstance(primary, RevolvedEllipse):
        return RevolvedEllipse.from_ellipse(_translate_frame(primary.frame, by), primary.ellipse)
    if isinstance(primary, RevolvedSpline):
        frame = _translate_frame(primary.frame, by)
        return RevolvedSpline.from_profile(frame, primary.profile, closed=primary.periods[1] is not None)
    raise TypeError(f"a {type(primary).__name__} cannot be moved")


def _translate_frame(frame: LocalFrame, by: Array) -> LocalFrame:
    return LocalFrame(frame.origin + by, frame.axes)


def extract_moved_pieces(spline: BSplineSurface, by: Array, dtype: type[np.floating[Any]] = np.float64) -> Array:
    """Return the homogeneous Bernstein pieces (p+1, q+1, 4, nu, nv) of a spline moved by a vector, rounded once.

    They are computed in long doubles, where the machine has them.
    """
    (p, q), (ku, kv), poles, weights = spline
    long = np.longdouble
    factor = np.ones(poles.shape[:2], long) if weights is None else weights.astype(long)
    net = np.concatenate([(poles.astype(long) + by) * factor[..., None], factor[..., None]], axis=-1)
    rows = extract_pieces(p, ku.astype(long), net)[1]
    coefs = extract_pieces(q, kv.astype(long), np.moveaxis(rows, 1, 0))[1]
    return np.asarray(np.swapaxes(coefs, 0, 1).astype(dtype))
