"""Surfaces of revolution as primary surfaces: a spline profile turned about an axis, and a turned ellipse (tori).

Depends on splines and on :mod:`cqblend.surfaces.tensor_surface` only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide
from cqblend.surfaces.angles import turn_parameters
from cqblend.surfaces.motions import Motion
from cqblend.surfaces.tensor_surface import TensorSurface, has_weight_kinks
from cqblend.surfaces.vectors import LocalFrame


def revolve_profile(frame: LocalFrame, profile: Array) -> Array:
    """Turn a homogeneous profile (q+1, 4, nv), in the frame, about its Z axis: patches (3, q+1, 4, 1, nv)."""
    x, y, z, w = profile.swapaxes(0, 1)
    zero = np.zeros_like(x)
    local = np.array([[x, y, z, w], [-y, x, zero, zero], [-x, -y, z, w]]).swapaxes(1, 2)[..., None, :]
    xyz = np.einsum("ijkuv,kl->ijluv", local[:, :, :3], frame.axes) + local[:, :, 3:] * frame.origin[:, None, None]
    return np.concatenate([xyz, local[:, :, 3:]], axis=2)


def revolve_jet(frame: LocalFrame, angle: Array, profile: Array) -> Array:
    """Return the native jet (6, n, 3) of a profile with derivatives (3, n, 3), in the frame, turned by angles (n,)."""
    cos, sin = np.cos(angle)[:, None], np.sin(angle)[:, None]
    along = np.array([1.0, 1.0, 0.0])

    def rotate_by_angle(p: Array) -> Array:
        x, y, z = p[:, :1], p[:, 1:2], p[:, 2:]
        return np.concatenate([cos * x - sin * y, sin * x + cos * y, z], 1)

    def rotate_quarter_turn(p: Array) -> Array:
        return np.stack([-p[:, 1], p[:, 0], np.zeros(len(p))], -1)

    s, sv, svv = (rotate_by_angle(p) for p in profile)
    out = frame.to_global(np.array([s, rotate_quarter_turn(s), sv, -s * along, rotate_quarter_turn(sv), svv]))
    out[0] += frame.origin
    return out


@dataclass(frozen=True, kw_only=True)
class RevolvedSpline(TensorSurface):
    """S(u, v) = the profile spline C(v) turned by u about the frame's Z axis; C is given in the frame."""

    frame: LocalFrame
    profile: Curve

    @classmethod
    def from_profile(cls, frame: LocalFrame, profile: Curve, *, closed: bool = False) -> RevolvedSpline:
        """Turn a profile; a ``closed`` one goes on periodically."""
        coefs = profile.coefs
        if not profile.rational:
            coefs = np.concatenate([coefs, np.ones_like(coefs[:, :1])], axis=1)
        period = float(profile.breaks[-1] - profile.breaks[0]) if closed else None
        return cls(
            breaks=(np.array([0.0, 1.0]), profile.breaks),
            patches=revolve_profile(frame, coefs),
            rational=profile.rational,
            is_angular=(True, False),
            periods=(2 * np.pi, period),
            knot_continuity=(np.empty(0, int), profile.continuity),
            levels_weight=profile.rational and has_weight_kinks((profile.continuity,)),
            frame=frame,
            profile=profile,
        )

    def jet(self, uv: Array) -> Array:
        v = self.wrap_parameters(uv)[:, 1]
        return revolve_jet(self.frame, uv[:, 0], np.stack([self.profile(v, k) for k in range(3)]))

    def carry_parameters(self, uv: Array, motion: Motion, amounts: Array) -> Array | None:
        sense = motion.find_turning_sense(self.frame)
        return turn_parameters(uv, sense * amounts) if sense else None

    def evaluate_weights(self, uv: Array) -> tuple[Array, Array]:
        if not self.rational or self.levels_weight:
            return np.ones(len(uv)), np.zeros((len(uv), 2))
        weight = Curve(self.profile.breaks, self.profile.coefs[:, 3:])
        value, slope = weight.jet(self.wrap_parameters(uv)[:, 1], 1)[..., 0]
        return value, np.stack([np.zeros_like(slope), slope], -1)

    def differentiate_beside_knot(self, uv: Array, axis: int, order: int, side: BreakSide) -> Array:
        return self.profile(uv[:, axis], order, side=side)


@dataclass(frozen=True, kw_only=True)
class RevolvedEllipse(TensorSurface):
    """S(u, v) = the ellipse M + A cos v + B sin v, given in the frame, turned by u about its Z axis: tori and more."""

    frame: LocalFrame
    ellipse: Array

    @classmethod
    def from_ellipse(cls, frame: LocalFrame, ellipse: Array) -> RevolvedEllipse:
        """Turn an ellipse, rows M, A, B (3, 3), about the frame's Z axis."""
        middle, a, b = ellipse
        profile = np.zeros((3, 4, 1))
        profile[:, :3, 0] = [middle + a, b, middle - a]
        profile[:, 3, 0] = [1, 0, 1]
        unit_span = np.array([0.0, 1.0])
        return cls(
            breaks=(unit_span, unit_span),
            patches=revolve_profile(frame, profile),
            rational=True,
            is_angular=(True, True),
            periods=(2 * np.pi, 2 * np.pi),
            frame=frame,
            ellipse=ellipse,
        )

    @classmethod
    def from_radii(cls, frame: LocalFrame, major: float, minor: float) -> RevolvedEllipse:
        """Return a torus about the frame's Z axis."""
        return cls.from_ellipse(frame, np.array([[major, 0.0, 0.0], [minor, 0.0, 0.0], [0.0, 0.0, minor]]))

    def jet(self, uv: Array) -> Array:
        middle, a, b = self.ellipse
        cos, sin = np.cos(uv[:, 1:]), np.sin(uv[:, 1:])
        profile = np.array([middle + cos * a + sin * b, cos * b - sin * a, -cos * a - sin * b])
        return revolve_jet(self.frame, uv[:, 0], profile)

    def carry_parameters(self, uv: Array, motion: Motion, amounts: Array) -> Array | None:
        sense = motion.find_turning_sense(self.frame)
        return turn_parameters(uv, sense * amounts) if sense else None

    def evaluate_weights(self, uv: Array) -> tuple[Array, Array]:
        return np.ones(len(uv)), np.zeros((len(uv), 2))

    def differentiate_beside_knot(self, uv: Array, axis: int, order: int, side: BreakSide) -> Array:
        raise NotImplementedError("both parameters are angles: there are no knot lines")
