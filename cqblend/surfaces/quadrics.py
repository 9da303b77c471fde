"""Plane, cylinder, cone and sphere as primary surfaces: one quadratic map of their lifted coordinates each.

Depends on splines and on the interface in :mod:`cqblend.surfaces.primary_surface` only.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import comb

import numpy as np

from cqblend.errors import GeometryError
from cqblend.splines import Curve, bernstein
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import align_breaks
from cqblend.splines.tolerances import SPLINE_TOLERANCES
from cqblend.surfaces.angles import (
    CIRCLE_FORM,
    half_angle_velocity,
    multiply_quaternions,
    shift_to_period,
    to_half_angle_pair,
    turn_parameters,
)
from cqblend.surfaces.motions import Motion
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.tolerances import SURFACE_TOLERANCES
from cqblend.surfaces.vectors import LocalFrame, cross_product


@dataclass(frozen=True)
class Quadric(Primary):
    """A surface P(c) = Q(c, c) + L c: plane, cylinder, cone and sphere.

    ``quadratic`` is Q, symmetric, (4, k, k); ``linear`` is L, (4, k).
    """

    frame: LocalFrame
    quadratic: Array = field(init=False, repr=False)
    linear: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        quadratic, linear = self._build_forms()
        object.__setattr__(self, "quadratic", quadratic)
        object.__setattr__(self, "linear", linear)

    @property
    def weight_exponents(self) -> Array:
        return np.where(self.quadratic.any(axis=(0, 1)), 0.5, 1.0)

    @abstractmethod
    def _build_forms(self) -> tuple[Array, Array]:
        """Return Q and L."""

    def _place_form(self, local: Array) -> Array:
        """Map forms (4, ...) with rows (x, y, z, w) from the frame's coordinates to global ones."""
        xyz = np.tensordot(self.frame.axes.T, local[:3], 1)
        return np.concatenate([xyz + np.multiply.outer(self.frame.origin, local[3]), local[3:]])

    def compose_jets(self, c: Curve, directions: Sequence[Curve], order: int | None = None) -> tuple[Curve, ...]:
        phi = align_breaks([c, *directions], SPLINE_TOLERANCES.same_break)
        breaks = phi[0].breaks
        jets = []
        for k in range(len(phi) if order is None else order + 1):
            terms = [self._apply_linear_form(phi[k])] if k < len(phi) else []
            for i in range(k // 2 + 1):
                if k - i < len(phi) and self.is_curved:
                    terms.append(
                        self._apply_quadratic_form(phi[i], phi[k - i], comb(k, i) * (1.0 if 2 * i == k else 2.0))
                    )
            degree = max(map(len, terms), default=1)
            rows = sum((bernstein.elevate_degree(term, degree - len(term)) for term in terms), np.zeros((1, 4, 1)))
            continuity = np.min([curve.continuity for curve in phi[: k + 1]], axis=0)
            jets.append(Curve(breaks, np.broadcast_to(rows, (degree, 4, len(breaks) - 1)), continuity=continuity))
        return tuple(jets)

    @abstractmethod
    def _build_normal_form(self) -> Array:
        """Return the form (3, k, k) in c whose value is normal to the surface."""

    def compose_normal(self, c: Curve) -> Curve:
        form = np.einsum("djk,mkn->mdjn", self._build_normal_form(), c.coefs)
        terms = [bernstein.multiply_polynomials(c.coefs[:, j, None], form[:, :, j]) for j in range(c.dim)]
        return Curve(c.breaks, np.sum(terms, axis=0))

    @property
    def is_curved(self) -> bool:
        """Whether the surface is no plane."""
        return bool(self.quadratic.any())

    def _apply_linear_form(self, x: Curve) -> Array:
        """Return L x, Bernstein coefficients (degree + 1, 4, n)."""
        return np.einsum("dk,mkn->mdn", self.linear, x.coefs)

    def _apply_quadratic_form(self, x: Curve, y: Curve, factor: float) -> Array:
        """Return factor Q(x, y)."""
        active = np.flatnonzero(self.quadratic.any(axis=(0, 1)))
        form = factor * np.einsum("djk,mkn->mdjn", self.quadratic[:, :, active], y.coefs[:, active])
        left = np.flatnonzero(self.quadratic.any(axis=(0, 2)))
        return np.sum([bernstein.multiply_polynomials(x.coefs[:, j, None, :], form[:, :, j]) for j in left], axis=0)


@dataclass(frozen=True)
class Plane(Quadric):
    """S(u, v) = O + u X + v Y. Lifted: (u, v, 1) times a weight."""

    def _build_forms(self) -> tuple[Array, Array]:
        local = np.zeros((4, 3))
        local[0, 0] = local[1, 1] = local[3, 2] = 1
        return np.zeros((4, 3, 3)), self._place_form(local)

    def jet(self, uv: Array) -> Array:
        local = np.zeros((6, len(uv), 3))
        local[0, :, :2] = uv
        local[1, :, 0] = local[2, :, 1] = 1
        out = self.frame.to_global(local)
        out[0] += self.frame.origin
        return out

    def lift_points(self, uv: Array) -> Array:
        return np.column_stack([uv, np.ones(len(uv))])

    def _build_normal_form(self) -> Array:
        x, y, _ = self.frame.axes
        return np.multiply.outer(cross_product(x, y), np.diag([0.0, 0.0, 1.0]))

    def lift_directions(self, uv: Array, c: Array, rs: Array) -> Array:
        return np.column_stack([rs * c[:, 2:], np.zeros(len(c))])

    def unlift_points(self, c: Array, near: Array) -> Array:
        return c[:, :2] / c[:, 2:]

    def unlift_directions(self, c: Array, d: Array) -> Array:
        return np.asarray((d[:, :2] - c[:, :2] * (d[:, 2:] / c[:, 2:])) / c[:, 2:])

    def carry_parameters(self, uv: Array, motion: Motion, amounts: Array) -> Array | None:
        x, y, _ = self.frame.axes
        normal = cross_product(x, y)
        if not motion.is_across(normal):
            return None
        if motion.centre is None:
            return uv + np.multiply.outer(amounts, np.array([motion.direction @ x, motion.direction @ y]))
        centre = self.frame.axes[:2] @ (motion.centre - self.frame.origin)
        angles = amounts * motion.find_sense(normal)
        cos, sin, (a, b) = np.cos(angles), np.sin(angles), uv - centre
        return centre + np.stack([cos * a - sin * b, sin * a + cos * b], -1)

    def has_exact_pcurves(self) -> bool:
        return True


@dataclass(frozen=True)
class Cylinder(Quadric):
    """S(u, v) = O + R (cos u X + sin u Y) + v Z. Lifted: (a, b, v w), w = a^2 + b^2.

    In a frame that is not orthonormal, any extruded ellipse.
    """

    radius: float = 1.0
    periods = (2 * np.pi, None)

    def _build_forms(self) -> tuple[Array, Array]:
        quadratic, linear = np.zeros((4, 3, 3)), np.zeros((4, 3))
        quadratic[:2, :2, :2] = self.radius * CIRCLE_FORM[:2]
        quadratic[3, :2, :2] = CIRCLE_FORM[2]
        linear[2, 2] = 1
        return self._place_form(quadratic), self._place_form(linear)

    def _build_normal_form(self) -> Array:
        local = np.zeros((3, 3, 3))
        local[:2, :2, :2] = CIRCLE_FORM[:2]
        return self.frame.to_global_normal(local)

    def jet(self, uv: Array) -> Array:
        cos, sin = np.cos(uv[:, 0]), np.sin(uv[:, 0])
        local = np.zeros((6, len(uv), 3))
        local[0] = np.stack([self.radius * cos, self.radius * sin, uv[:, 1]], -1)
        local[1, :, 0], local[1, :, 1] = -self.radius * sin, self.radius * cos
        local[2, :, 2] = 1
        local[3, :, 0], local[3, :, 1] = -self.radius * cos, -self.radius * sin
        out = self.frame.to_global(local)
        out[0] += self.frame.origin
        return out

    def lift_points(self, uv: Array) -> Array:
        return np.column_stack([to_half_angle_pair(uv[:, 0]), uv[:, 1]])

    def lift_directions(self, uv: Array, c: Array, rs: Array) -> Array:
        weight = (c[:, :2] ** 2).sum(1)
        return np.column_stack([half_angle_velocity(c[:, :2], rs[:, 0]), rs[:, 1] * weight])

    def unlift_points(self, c: Array, near: Array) -> Array:
        angle = 2 * np.arctan2(c[:, 1], c[:, 0])
        return np.stack([shift_to_period(angle, near[:, 0], 2 * np.pi), c[:, 2] / (c[:, :2] ** 2).sum(1)], -1)

    def carry_parameters(self, uv: Array, motion: Motion, amounts: Array) -> Array | None:
        along = self.frame.axes[2]
        if motion.centre is None:
            sense = motion.find_sense(along)
            step = np.array([0.0, sense / float(np.linalg.norm(along))])
            return uv + np.multiply.outer(amounts, step) if sense else None
        sense = motion.find_turning_sense(self.frame)
        return turn_parameters(uv, sense * amounts) if sense else None

    def unlift_directions(self, c: Array, d: Array) -> Array:
        weight, growth = (c[:, :2] ** 2).sum(1), 2 * (c[:, :2] * d[:, :2]).sum(1)
        turn = 2 * (c[:, 0] * d[:, 1] - c[:, 1] * d[:, 0]) / weight
        return np.stack([turn, (d[:, 2] - c[:, 2] * growth / weight) / weight], -1)


@dataclass(frozen=True)
class Cone(Quadric):
    """S(u, v) = O + (R + v sin h) (cos u X + sin u Y) + v cos h Z, h the half-angle.

    With rho = R + v sin h and the apex A, S = A + rho (cos u X + sin u Y + cot h Z). Lifted: (a, b, w) with
    a^2 + b^2 = |rho| w.
    """

    radius: float = 1.0
    half_angle: float = 0.5
    nappe: float = 1.0  # sign of rho on the half of the double cone that the face is on
    periods = (2 * np.pi, None)

    def _build_forms(self) -> tuple[Array, Array]:
        cot = 1 / np.tan(self.half_angle)
        quadratic, linear = np.zeros((4, 3, 3)), np.zeros((4, 3))
        quadratic[:2, :2, :2] = self.nappe * CIRCLE_FORM[:2]
        quadratic[2, :2, :2] = self.nappe * cot * CIRCLE_FORM[2]
        linear[2, 2] = -self.radius * cot
        linear[3, 2] = 1
        return self._place_form(quadratic), self._place_form(linear)

    def _build_normal_form(self) -> Array:
        local = np.zeros((3, 3, 3))
        local[:, :2, :2] = CIRCLE_FORM * np.array([1, 1, -np.tan(self.half_angle)])[:, None, None]
        return self.frame.to_global_normal(local)

    def jet(self, uv: Array) -> Array:
        cos, sin = np.cos(uv[:, 0]), np.sin(uv[:, 0])
        grow, rise = np.sin(self.half_angle), np.cos(self.half_angle)
        rho = self.radius + uv[:, 1] * grow
        zero = np.zeros_like(rho)
        local = np.array(
            [
                [rho * cos, rho * sin, uv[:, 1] * rise],
                [-rho * sin, rho * cos, zero],
                [grow * cos, grow * sin, zero + rise],
                [-rho * cos, -rho * sin, zero],
                [-grow * sin, grow * cos, zero],
                [zero, zero, zero],
            ]
        ).swapaxes(1, 2)
        out = self.frame.to_global(local)
        out[0] += self.frame.origin
        return out

    def _distance_from_axis(self, v: Array) -> Array:
        rho = self.nappe * (self.radius + v * np.sin(self.half_angle))
        if not np.all(rho > 0):
            raise GeometryError("the blend reaches the apex of a cone; take a smaller size")
        return rho

    def lift_points(self, uv: Array) -> Array:
        rho = self._distance_from_axis(uv[:, 1])
        return np.column_stack([np.sqrt(rho)[:, None] * to_half_angle_pair(uv[:, 0]), np.ones(len(uv))])

    def lift_directions(self, uv: Array, c: Array, rs: Array) -> Array:
        rate = self.nappe * rs[:, 1] * np.sin(self.half_angle) / (2 * self._distance_from_axis(uv[:, 1]))
        return np.column_stack([half_angle_velocity(c[:, :2], rs[:, 0]) + rate[:, None] * c[:, :2], np.zeros(len(c))])

    def unlift_points(self, c: Array, near: Array) -> Array:
        angle = 2 * np.arctan2(c[:, 1], c[:, 0])
        rho = self.nappe * (c[:, :2] ** 2).sum(1) / c[:, 2]
        v = (rho - self.radius) / np.sin(self.half_angle)
        return np.stack([shift_to_period(angle, near[:, 0], 2 * np.pi), v], -1)

    def carry_parameters(self, uv: Array, motion: Motion, amounts: Array) -> Array | None:
        sense = motion.find_turning_sense(self.frame)
        return turn_parameters(uv, sense * amounts) if sense else None

    def unlift_directions(self, c: Array, d: Array) -> Array:
        square, growth = (c[:, :2] ** 2).sum(1), 2 * (c[:, :2] * d[:, :2]).sum(1)
        turn = 2 * (c[:, 0] * d[:, 1] - c[:, 1] * d[:, 0]) / square
        rate = self.nappe * (growth - square * d[:, 2] / c[:, 2]) / c[:, 2]  # of rho
        return np.stack([turn, rate / np.sin(self.half_angle)], -1)


@dataclass(frozen=True)
class Sphere(Quadric):
    """S(u, v) = O + R n, n = cos v (cos u X + sin u Y) + sin v Z. Lifted: a quaternion that turns ``pole`` into n.

    ``pole`` is a global unit vector. The quaternion is that of the shortest turn, whose one singular point is -pole:
    take the pole from the middle of the rail. With ``follows_latitude``, for rails around the frame's Z axis, which
    must be the pole, it is combined with a turn about the pole that depends on u, so that on circles of latitude it is
    linear in the half-angle pair.
    """

    radius: float = 1.0
    pole: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    follows_latitude: bool = False
    periods = (2 * np.pi, None)

    def _build_forms(self) -> tuple[Array, Array]:
        norm = np.eye(4)[None]
        xyz = self.radius * self._build_normal_form() + np.multiply.outer(self.frame.origin, np.eye(4))
        return np.concatenate([xyz, norm]), np.zeros((4, 4))

    def _build_normal_form(self) -> Array:
        m = self.pole
        # R q m q* = (q0^2 - |v|^2) m + 2 (v.m) v + 2 q0 (v x m)
        turned = np.zeros((3, 4, 4))
        turned[:, 0, 0] = m
        for i in range(3):
            turned[:, 1 + i, 1 + i] -= m
            side = cross_product(np.eye(3)[i], m)
            turned[:, 0, 1 + i] += side
            turned[:, 1 + i, 0] += side
            turned[i, 1 + i, 1:] += m
            turned[i, 1:, 1 + i] += m
        return turned

    def jet(self, uv: Array) -> Array:
        cu, su, cv, sv = np.cos(uv[:, 0]), np.sin(uv[:, 0]), np.cos(uv[:, 1]), np.sin(uv[:, 1])
        zero = np.zeros_like(cu)
        local = np.array(
            [
                [cv * cu, cv * su, sv],
                [-cv * su, cv * cu, zero],
                [-sv * cu, -sv * su, cv],
                [-cv * cu, -cv * su, zero],
                [sv * su, -sv * cu, zero],
                [-cv * cu, -cv * su, -sv],
            ]
        ).swapaxes(1, 2)
        out = self.radius * self.frame.to_global(local)
        out[0] += self.frame.origin
        return out

    def lift_points(self, uv: Array) -> Array:
        n = (self.jet(uv)[0] - self.frame.origin) / self.radius
        real = 1 + n @ self.pole
        if not np.all(real > SURFACE_TOLERANCES.antipode):
            raise GeometryError("the rail runs through the point of a sphere opposite to its own middle")
        q = np.column_stack([real, cross_product(self.pole, n)]) / np.sqrt(2 * real)[:, None]
        if not self.follows_latitude:
            return q
        handedness = np.sign(np.linalg.det(self.frame.axes))  # u turns the other way in a left-handed frame
        spin = to_half_angle_pair(uv[:, 0] * handedness)
        return multiply_quaternions(q, np.column_stack([spin[:, 0], spin[:, 1:] * self.pole]))

    def lift_directions(self, uv: Array, c: Array, rs: Array) -> Array:
        jet = self.jet(uv)
        n = (jet[0] - self.frame.origin) / self.radius
        spin = cross_product(n, rs[:, :1] * jet[1] + rs[:, 1:] * jet[2]) / (2 * self.radius)
        return multiply_quaternions(np.column_stack([np.zeros(len(spin)), spin]), c)

    def unlift_points(self, c: Array, near: Array) -> Array:
        n = np.einsum("ijk,nj,nk->ni", self.quadratic[:3], c, c) / (c**2).sum(1)[:, None] - self.frame.origin
        x, y, z = self.frame.axes @ n.T / self.radius
        return np.stack([shift_to_period(np.arctan2(y, x), near[:, 0], 2 * np.pi), np.arctan2(z, np.hypot(x, y))], -1)

    def carry_parameters(self, uv: Array, motion: Motion, amounts: Array) -> Array | None:
        sense = motion.find_turning_sense(self.frame)
        return turn_parameters(uv, sense * amounts) if sense else None

    def unlift_directions(self, c: Array, d: Array) -> Array:
        norm, growth = (c**2).sum(1)[:, None], 2 * (c * d).sum(1)[:, None]
        form = self._build_normal_form()
        point = np.einsum("ijk,nj,nk->ni", form, c, c) / norm
        rate = (2 * np.einsum("ijk,nj,nk->ni", form, c, d) - point * growth) / norm
        (x, y, _), (dx, dy, dz) = self.frame.axes @ point.T, self.frame.axes @ rate.T
        ring = x * x + y * y
        return np.stack([(x * dy - y * dx) / ring, dz / np.sqrt(ring)], -1)
