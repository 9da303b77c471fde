"""A primary along a rail, worked out anew for those who check a blend: on pieces of its own, and beside the origin.

Nothing is taken over from the blend. Breaks are where the rail really crosses knot lines, however close together, and
derivatives along the rail come from its velocity, as derivatives into the blend come from their directions: no piece is
so short that they lose their digits. Positions are taken from a point next to the blend. It must not know what is
checked.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from cqblend.blends.quality.rounding import EPS, RoundingBounds, bound_rounding
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.knots import extract_pieces
from cqblend.splines.surface import BSplineSurface
from cqblend.surfaces.primary import Primary
from cqblend.surfaces.quadrics import Quadric
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse, RevolvedSpline
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import LocalFrame

CLOSED_FORM_ERROR = 64 * EPS  # relative error of derivatives of surfaces that OCCT evaluates by formulas
PARAMETER_ERROR = 4 * EPS  # by which a rail's parameters are off where they are evaluated, for each degree and one


@dataclass(frozen=True)
class RecomputedRibbon:
    """The primary of a ribbon, moved by -``origin``, along its rail."""

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
        """The second derivative towards C' + x T, with all that makes it one of the same map, and x."""
        c, directions = self.ribbon.c, self.ribbon.directions
        d = directions[0]
        speed, reach = (float(np.abs(curve.coefs).max()) for curve in (c.derivative(), d))
        x = speed / reach
        second = c.derivative(2) + d.derivative() * (2 * x)
        if len(directions) > 1:
            second = second + directions[1] * x**2
        return self.primary.compose_jets(c, [c.derivative() + d * x, second], 2)[2], x

    @cached_property
    def native_derivatives(self) -> dict[str, Curve]:
        """Homogeneous derivatives by the native parameters of a spline, along the rail: "u" and "v"."""
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
        """What gives the rounding of the surface's own evaluation at parameters t (n,); None if it has closed forms."""
        primary, c = self.ribbon.primary, self.ribbon.c
        if not isinstance(primary, TensorSurface) or primary.surface is None:
            return None
        degree = (c.degree + 1) * PARAMETER_ERROR
        lines = primary.breaks
        doubt = tuple(degree * max(abs(line[0]), abs(line[-1])) for line in lines)
        table = bound_rounding(primary.surface.to_bspline(), None, (doubt[0], doubt[1]))

        def select_rounding(t: Array) -> RoundingBounds:
            uv = primary.wrap_parameters(self.ribbon.find_native_parameters(t))
            spans = [
                np.clip(np.searchsorted(line, x, "right") - 1, 0, len(line) - 2)
                for line, x in zip(lines, uv.T, strict=True)
            ]
            return table.take_spans(spans[0], spans[1])

        return select_rounding


def _translate_primary(primary: Primary, by: Array) -> Primary:
    """Return a primary that has been moved; the same lifted parameters mean the same points."""
    if isinstance(primary, TensorSurface) and primary.surface is not None:
        coefs = extract_moved_pieces(primary.surface.to_bspline(), by)
        surface = Surface(primary.breaks, coefs[:, :, : 3 + primary.rational], rational=primary.rational)
        return replace(primary, surface=surface, patches=coefs)
    assert isinstance(primary, Quadric | RevolvedSpline | RevolvedEllipse)
    frame = LocalFrame(primary.frame.origin + by, primary.frame.axes)
    if isinstance(primary, RevolvedSpline):
        assert primary.profile is not None
        return RevolvedSpline.from_profile(frame, primary.profile, closed=primary.periods[1] is not None)
    return (
        RevolvedEllipse.from_ellipse(frame, primary.ellipse)
        if isinstance(primary, RevolvedEllipse)
        else replace(primary, frame=frame)
    )


def extract_moved_pieces(spline: BSplineSurface, by: Array, dtype: type[np.floating[Any]] = np.float64) -> Array:
    """Return the homogeneous Bernstein pieces (p+1, q+1, 4, nu, nv) of a spline that is moved, to their own rounding.

    They are worked out in long doubles, where the machine has them.
    """
    (p, q), (ku, kv), poles, weights = spline
    wide = np.longdouble
    factor = np.ones(poles.shape[:2], wide) if weights is None else weights.astype(wide)
    net = np.concatenate([(poles.astype(wide) + by) * factor[..., None], factor[..., None]], axis=-1)
    rows = extract_pieces(p, ku.astype(wide), net)[1]
    coefs = extract_pieces(q, kv.astype(wide), np.moveaxis(rows, 1, 0))[1]
    return np.asarray(np.swapaxes(coefs, 0, 1).astype(dtype))
