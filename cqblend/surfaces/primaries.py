"""Primary surfaces as a blend sees them: numerically in their own parameters, symbolically through lifted ones.

A blend needs two things of the surface it leaves from. Numbers, for the solvers: position and derivatives at many
points, in the *native* parameters (u, v) of the CAD surface (angles on a cylinder). And symbols, for the result: the
exact spline S(c(t)) of a rail and the exact tangent field along it.

The symbols use *lifted* parameters, homogeneous coordinates c in which the surface is a polynomial map P into
homogeneous 4-space and has neither seams nor knot lines that its geometry does not have:

===============  =====================================  ========================
surface          lifted coordinates c                   degree of P(c), c cubic
===============  =====================================  ========================
plane            (u, v, w)                              3
cylinder, cone   half-angle pair (a, b) and a length    6
sphere           unit quaternion                        6
torus, ring      two half-angle pairs                   12
revolution       half-angle pair, (gamma, delta)        6 + 3 q
spline (p, q)    barycentric pairs of u and of v        3 (p + q)
===============  =====================================  ========================

*Every* curve c(t) of lifted coordinates lies on the surface, and with *every* lifted direction d(t) the field DP(c) d
is tangent to it: approximation errors in c and d move a rail or turn a direction, never take the blend off the tangent
plane. A component of d along c itself is the scalar gauge of a rational Hermite blend; :meth:`Primary.lift_directions`
chooses it so that the weight starts flat.

Nothing here knows OCCT; :mod:`cqblend.brep.read.face_surface` reads a face into a primary.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import comb, factorial
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cqblend.errors import GeometryError
from cqblend.splines import SMOOTH, Curve, Surface, bernstein, fit
from cqblend.splines.breaks import SAME_BREAK, align_breaks
from cqblend.splines.composition import cut_at_knot_lines
from cqblend.splines.evaluation import BreakSide, dehomogenise_derivatives
from cqblend.surfaces.knot_line_smoothness import expand_patches, measure_shape_continuity

Array = NDArray[Any]

JUMP_ROUNDING = 1e-10  # of a surface: jumps of derivatives up to that are rounding

# Order of the partial derivatives in a native jet: S, Su, Sv, Suu, Suv, Svv.
JET_ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


class KnotCrossing(NamedTuple):
    """Where a rail crosses a knot line: at t, the line native parameter ``axis`` = ``value``.

    ``continuity`` is that of the surface at this very point, ``shape_continuity`` that of its shape, which may be
    smooth where parameters have a kink; both counted up to 4. ``crease`` is the angle by which its normal turns there,
    rad.
    """

    t: float
    axis: int
    value: float
    continuity: int
    shape_continuity: int
    crease: float

    def is_parametric_kink(self, order: int) -> bool:
        """Whether jets of an order have a kink here that is one of the parameters alone, at least in part."""
        return self.continuity <= order and self.continuity < self.shape_continuity


class Primary(ABC):
    """A surface that a blend leaves from. ``periods`` are those of the native parameters, None where there is none."""

    periods: tuple[float | None, float | None] = (None, None)

    @abstractmethod
    def jet(self, uv: Array) -> Array:
        """Return position and derivatives (6, n, 3), in the order of ``JET_ORDERS``, at native parameters (n, 2)."""

    @abstractmethod
    def lift_points(self, uv: Array) -> Array:
        """Lift native parameters (n, 2), continuous along a curve, to (n, k), continuous along it and of weight 1."""

    @abstractmethod
    def lift_directions(self, uv: Array, c: Array, rs: Array) -> Array:
        """Lift the directions r Su + s Sv, (n, 2), at lifted points c (n, k), with the gauge that keeps the weight."""

    @abstractmethod
    def unlift_points(self, c: Array, near: Array) -> Array:
        """Return the native parameters (n, 2) of lifted points (n, k), in the period next to ``near`` (n, 2)."""

    @property
    @abstractmethod
    def weight_exponents(self) -> Array:
        """Exponents (k,) with P(w^powers c) = w P(c): by them lifted points are scaled to a homogeneous weight."""

    @abstractmethod
    def compose_jets(self, c: Curve, directions: Sequence[Curve], order: int | None = None) -> tuple[Curve, ...]:
        """Return the derivatives by v, at v = 0, of P(c + v d + v^2/2 e + ..) along a rail.

        Parameters
        ----------
        c
            The rail, lifted.
        directions
            d, e, ..: as many derivatives of the lifted ribbon as there are; higher ones are zero.
        order
            The highest derivative, by default as many as there are directions.

        Returns
        -------
        tuple of Curve
            By order, exact, splines in homogeneous 4-space (dim 4, not flagged rational).
        """

    @abstractmethod
    def compose_normal(self, c: Curve) -> Curve:
        """Return a normal of the tangent plane along a rail: an exact spline (dim 3), of any sign and length.

        It is worked out beside the rail, so that its rounding does not grow with the distance from the origin.

        Parameters
        ----------
        c
            The rail, lifted.
        """

    def scale_weight(self, c: Array, weight: Array) -> Array:
        """Scale lifted points (n, k) so that the homogeneous weight of P(c) is multiplied by ``weight`` (n,)."""
        return c * weight[:, None] ** self.weight_exponents

    def compose_position(self, c: Curve) -> Curve:
        """Return P(c(t)), exact, in homogeneous 4-space."""
        return self.compose_jets(c, ())[0]

    def inner_knot_lines(self, axis: int) -> Array:
        """Return the inner knot lines of a native parameter."""
        return np.empty(0)

    def find_knot_crossings(self, c: Curve, most: int) -> list[KnotCrossing]:
        """Return where a rail crosses knot lines at points where the surface is C``most`` or less, along the rail."""
        return []

    def has_exact_pcurves(self) -> bool:
        """Whether a rail's native curve is the lifted one, so that a pcurve can be taken from it without fitting."""
        return False

    def evaluate_normals(self, uv: Array) -> Array:
        """Return unit normals Su x Sv / |Su x Sv|, (n, 3)."""
        jet = self.jet(uv)
        return normalise_vectors(cross_product(jet[1], jet[2]))


def cross_product(a: Array, b: Array) -> Array:
    """Return a x b of vectors (..., 3); four times as fast as NumPy's on the few hundred of a rail."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    u, v, w = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def normalise_vectors(vectors: Array) -> Array:
    """Normalise vectors (..., 3); raise GeometryError where one has no direction."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    if not np.all(length > 0):
        raise GeometryError("a surface is singular here: its partial derivatives span no tangent plane")
    return vectors / length


def to_tangent_coordinates(jet: Array, vector: Array) -> Array:
    """Return (r, s), (n, 2), with r Su + s Sv the projection of vectors (n, 3) on a native jet's tangent planes."""
    su, sv = jet[1], jet[2]
    e, f, g = (su * su).sum(1), (su * sv).sum(1), (sv * sv).sum(1)
    p, q = (su * vector).sum(1), (sv * vector).sum(1)
    det = e * g - f * f
    if not np.all(det > 0):
        raise GeometryError("a face is singular under the blend: its partial derivatives span no tangent plane")
    return np.stack([(g * p - f * q) / det, (e * q - f * p) / det], -1)


def shift_to_period(value: Array, near: Array, period: float) -> Array:
    """Shift values by whole periods to within half a period of ``near``."""
    return value + period * np.round((near - value) / period)


def unwrap_parameters(uv: Array, periods: tuple[float | None, float | None]) -> Array:
    """Take the jumps by whole periods out of parameters (n, 2) along a curve."""
    out = uv.copy()
    for axis, period in enumerate(periods):
        if period is not None:
            out[:, axis] = np.unwrap(out[:, axis], period=period)
    return out


def to_half_angle_pair(angle: Array) -> Array:
    """Return (cos, sin) of half the angles, (n, 2): the homogeneous parameter of a circle."""
    return np.stack([np.cos(angle / 2), np.sin(angle / 2)], -1)


def half_angle_velocity(pair: Array, rate: Array) -> Array:
    """Return the velocity (n, 2) of half-angle pairs that turn at the given angular rate (n,)."""
    return np.stack([-pair[:, 1], pair[:, 0]], -1) * (rate / 2)[:, None]


def multiply_quaternions(p: Array, q: Array) -> Array:
    """Return the products of quaternions (n, 4), real part first."""
    real = p[:, 0] * q[:, 0] - (p[:, 1:] * q[:, 1:]).sum(1)
    return np.column_stack([real, p[:, :1] * q[:, 1:] + q[:, :1] * p[:, 1:] + cross_product(p[:, 1:], q[:, 1:])])


# Coefficients of (a^2 - b^2, 2ab, a^2 + b^2), the circle, as a symmetric bilinear form (3, 2, 2).
CIRCLE_FORM = np.array([[[1, 0], [0, -1]], [[0, 1], [1, 0]], [[1, 0], [0, 1]]], float)


@dataclass(frozen=True)
class LocalFrame:
    """A placed coordinate system: origin (3,) and axes (3, 3), one vector a row; may be left-handed."""

    origin: Array
    axes: Array

    def to_global(self, local: Array) -> Array:
        """Map local vectors (..., 3) to global ones."""
        return local @ self.axes

    def to_global_normal(self, local: Array) -> Array:
        """Map normals (3, ...) of local planes to global ones, also where the axes are not orthonormal."""
        return np.tensordot(np.linalg.inv(self.axes), local, 1)


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
        """Turn forms (4, ...) whose rows are (x, y, z, w) in the frame into global ones."""
        xyz = np.tensordot(self.frame.axes.T, local[:3], 1)
        return np.concatenate([xyz + np.multiply.outer(self.frame.origin, local[3]), local[3:]])

    def compose_jets(self, c: Curve, directions: Sequence[Curve], order: int | None = None) -> tuple[Curve, ...]:
        phi = align_breaks([c, *directions], SAME_BREAK)
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


@dataclass(frozen=True)
class Cone(Quadric):
    """S(u, v) = O + (R + v sin h) (cos u X + sin u Y) + v cos h Z, h the half-angle.

    With rho = R + v sin h and the apex A, S = A + rho (cos u X + sin u Y + cot h Z). Lifted: (a, b, w) with
    a^2 + b^2 = |rho| w.
    """

    radius: float = 1.0
    half_angle: float = 0.5
    nappe: float = 1.0  # the sign of rho on the part of the cone that is meant
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


@dataclass(frozen=True)
class Sphere(Quadric):
    """S(u, v) = O + R n, n = cos v (cos u X + sin u Y) + sin v Z. Lifted: a quaternion that turns ``pole`` into n.

    ``pole`` is a global unit vector. The quaternion is that of the shortest turn, whose one singular point is -pole:
    take the pole from the middle of the rail. With ``spinning``, for rails around the frame's Z axis, which must be the
    pole, it is followed by half a turn by -u about the pole: on circles of latitude it is then linear in the half-angle
    pair.
    """

    radius: float = 1.0
    pole: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    spinning: bool = False
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
        if not np.all(real > 1e-6):
            raise GeometryError("the rail runs through the point of a sphere opposite to its own middle")
        q = np.column_stack([real, cross_product(self.pole, n)]) / np.sqrt(2 * real)[:, None]
        if not self.spinning:
            return q
        spin = to_half_angle_pair(
            uv[:, 0] * np.sign(np.linalg.det(self.frame.axes))
        )  # u turns the other way if left-handed
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


@dataclass(frozen=True)
class TensorSurface(Primary):
    """A tensor-product spline. Lifted: barycentric pairs (alpha, beta, gamma, delta), u = beta/(alpha + beta).

    A direction that is ``angular`` is one Bernstein span in the half-angle pair (a, b) itself and its native parameter
    is the angle; ``patches`` are homogeneous, (p+1, q+1, 4, nu, nv). ``surface`` serves the numbers of a plain spline;
    where a direction is angular a subclass computes them.
    """

    breaks: tuple[Array, Array]
    patches: Array
    surface: Surface | None = None
    rational: bool = False
    angular: tuple[bool, bool] = (False, False)
    periods: tuple[float | None, float | None] = (None, None)
    knot_continuity: tuple[Array, Array] | None = None  # continuity at the inner breaks
    seam_continuity: tuple[int, int] = (0, 0)  # and where a closed direction meets itself
    levels_weight: bool = False  # the weight of a rail is evened out after composing, not by scaling lifted parameters

    @classmethod
    def from_spline(
        cls, surface: Surface, closed: tuple[bool, bool] = (False, False), *, level: bool = False
    ) -> TensorSurface:
        """Wrap a spline; in a ``closed`` direction it goes on periodically past its ends.

        Lifted points can be scaled so that the weight of a rail is one; where the surface's own weight has kinks, or
        to ``level`` those of rails that are given as they are, it is evened out after composing.
        """
        coefs = surface.coefs
        if not surface.rational:
            coefs = np.concatenate([coefs, np.ones_like(coefs[:, :, :1])], axis=2)
        periods = [float(b[-1] - b[0]) if flag else None for b, flag in zip(surface.breaks, closed, strict=True)]
        joints = [_measure_seam_continuity(surface, axis) if closed[axis] else 0 for axis in (0, 1)]
        return cls(
            surface.breaks,
            coefs,
            surface,
            surface.rational,
            periods=(periods[0], periods[1]),
            knot_continuity=surface.continuity,
            seam_continuity=(joints[0], joints[1]),
            levels_weight=level or (surface.rational and _has_weight_kinks(surface.continuity)),
        )

    @property
    def degrees(self) -> tuple[int, int]:
        """The degrees (p, q)."""
        return self.patches.shape[0] - 1, self.patches.shape[1] - 1

    def has_exact_pcurves(self) -> bool:
        return not any(self.angular)

    def inner_knot_lines(self, axis: int) -> Array:
        return self.breaks[axis][1:-1]

    def wrap_parameters(self, uv: Array) -> Array:
        """Shift native parameters (n, 2) into the domain along periodic directions."""
        out = uv.copy()
        for axis, period in enumerate(self.periods):
            if period is not None and not self.angular[axis]:
                start = self.breaks[axis][0]
                out[:, axis] = start + np.mod(uv[:, axis] - start, period)
        return out

    def jet(self, uv: Array) -> Array:
        assert self.surface is not None
        jet = self._evaluate_spline_jet(self.surface, uv, 2)
        return np.stack([jet[i, j] for i, j in JET_ORDERS])

    def _evaluate_spline_jet(self, spline: Surface, uv: Array, order: int) -> Array:
        u, v = self.wrap_parameters(uv).T
        return spline.jet(u, v, order)

    def _lift_parameter(self, value: Array, axis: int) -> Array:
        return to_half_angle_pair(value) if self.angular[axis] else np.stack([1 - value, value], -1)

    def _evaluate_weight(self, uv: Array) -> tuple[Array, Array]:
        """Return the weight w (n,) of the spline and its derivatives (wu, wv), (n, 2)."""
        if not self.rational or self.surface is None or self.levels_weight:
            return np.ones(len(uv)), np.zeros((len(uv), 2))
        weight = Surface(self.breaks, self.patches[:, :, 3:])
        jet = self._evaluate_spline_jet(weight, uv, 1)[..., 0]
        return jet[0, 0], np.stack([jet[1, 0], jet[0, 1]], -1)

    def lift_points(self, uv: Array) -> Array:
        scale = self._evaluate_weight(uv)[0] ** (-1 / sum(self.degrees))
        return (
            np.concatenate([self._lift_parameter(uv[:, 0], 0), self._lift_parameter(uv[:, 1], 1)], 1) * scale[:, None]
        )

    def lift_directions(self, uv: Array, c: Array, rs: Array) -> Array:
        weight, slope = self._evaluate_weight(uv)
        out = c * (-(rs * slope).sum(1) / weight / sum(self.degrees))[:, None]
        for axis in (0, 1):
            pair = c[:, 2 * axis : 2 * axis + 2]
            if self.angular[axis]:
                rate = half_angle_velocity(pair, rs[:, axis])
            else:
                rate = (rs[:, axis] * pair.sum(1))[:, None] * np.array([-1.0, 1.0])
            out[:, 2 * axis : 2 * axis + 2] += rate
        return out

    @property
    def weight_exponents(self) -> Array:
        if self.angular[0]:
            return np.array([0.5, 0.5, 0.0, 0.0])
        return np.full(4, 1 / sum(self.degrees))

    def unlift_points(self, c: Array, near: Array) -> Array:
        out = np.empty((len(c), 2))
        for axis in (0, 1):
            x, y = c[:, 2 * axis], c[:, 2 * axis + 1]
            if self.angular[axis]:
                out[:, axis] = shift_to_period(2 * np.arctan2(y, x), near[:, axis], 2 * np.pi)
            else:
                out[:, axis] = y / (x + y)
        return out

    def compose_jets(self, c: Curve, directions: Sequence[Curve], order: int | None = None) -> tuple[Curve, ...]:
        order = len(directions) if order is None else order
        c, *rest = align_breaks([c, *directions], SAME_BREAK)
        c, patches, spans, crossed = self._cut_at_knots(c)
        phi = [c, *(d.cut(c.breaks[1:-1]) for d in rest)]
        pairs = [self._localise_pairs(x, spans) for x in phi]
        none = [np.zeros((1, len(c.breaks) - 1))] * (order + 1 - len(phi))
        series = [[pair[i] / factorial(k) for k, pair in enumerate(pairs)] + none for i in range(4)]
        jets = []
        for k, coefs in enumerate(bernstein.compose_series(patches, *series)):
            continuity = np.min([*(x.continuity for x in phi[: k + 1]), crossed - k], axis=0)
            jets.append(Curve(c.breaks, factorial(k) * coefs, continuity=np.maximum(continuity, 0)))
        return _level_weight(jets) if self.levels_weight else tuple(jets)

    def compose_normal(self, c: Curve) -> Curve:
        c, patches, spans, _ = self._cut_at_knots(c)
        centre = patches[:, :, :3].mean(axis=(0, 1)) / patches[:, :, 3].mean(axis=(0, 1))
        patches = np.concatenate([patches[:, :, :3] - centre * patches[:, :, 3:], patches[:, :, 3:]], axis=2)
        pairs = self._localise_pairs(c, spans)
        su, sv = (self._compose_partial(patches, pairs, axis, c.breaks) for axis in (0, 1))
        normal = su[:3].cross(sv[:3])
        if not self.rational:
            return normal
        s = Curve(c.breaks, bernstein.compose_patch(patches, *pairs))
        return normal * s[3] + sv[:3].cross(s[:3]) * su[3] + s[:3].cross(su[:3]) * sv[3]

    def _compose_partial(
        self, patches: Array, pairs: tuple[Array, Array, Array, Array], axis: int, breaks: Array
    ) -> Curve:
        """Differentiate P along a rail by u or v, or by the angle; up to a positive factor."""
        p = patches.shape[axis] - 1
        first, last = (patches.take(range(i, i + p), axis) for i in (0, 1))
        if not self.angular[axis]:
            return Curve(breaks, bernstein.compose_patch(last - first, *pairs))
        a, b = (pair[:, None] for pair in pairs[2 * axis : 2 * axis + 2])
        turned = [bernstein.compose_patch(part, *pairs) for part in (first, last)]
        return Curve(
            breaks, bernstein.multiply_polynomials(a, turned[1]) - bernstein.multiply_polynomials(b, turned[0])
        )

    def _list_crossable_lines(self, c: Curve, axis: int) -> tuple[Array, Array]:
        """Return the knot lines that the rail may cross, ends included, periodically repeated, and their continuity."""
        assert self.knot_continuity is not None
        breaks, orders = self.breaks[axis], np.asarray(self.knot_continuity[axis])
        period = self.periods[axis]
        if period is None:
            return breaks, orders
        pair = c.coefs[:, 2 * axis : 2 * axis + 2]
        value = pair[:, 1] / pair.sum(1)
        first, last = (int(np.floor((x - breaks[0]) / period)) for x in (value.min(), value.max()))
        laps = range(first, last + 1)
        lines = np.concatenate([breaks[:-1] + lap * period for lap in laps] + [breaks[-1:] + last * period])
        joint = [self.seam_continuity[axis]]
        return lines, np.concatenate([orders, *([*joint, *orders] for _ in laps[1:])])

    def find_knot_crossings(self, c: Curve, most: int) -> list[KnotCrossing]:
        found = []
        for axis in (0, 1):
            if self.angular[axis]:
                continue
            lines, orders = self._list_crossable_lines(c, axis)
            if not (orders <= most).any():
                continue
            x, y = c.coefs[:, 2 * axis], c.coefs[:, 2 * axis + 1]
            cut, (index,), _ = cut_at_knot_lines(
                Curve(c.breaks, np.stack([y, x + y], 1), rational=True), [lines], [orders]
            )
            steps = [
                (j, i) for j in np.flatnonzero(np.diff(index)).tolist() for i in _lines_between(index[j], index[j + 1])
            ]
            steps = [(j, i) for j, i in steps if orders[i - 1] <= most]
            if not steps:
                continue
            piece, line = np.array(steps).T
            t, value = cut.breaks[piece + 1], lines[line]
            uv = self.unlift_points(c(t), np.zeros((len(t), 2)))
            uv[:, axis] = value
            smooth, shape, crease = self.measure_smoothness(uv, axis)
            axes = [axis] * len(t)
            found += [
                KnotCrossing(*one) for one in zip(t.tolist(), axes, value.tolist(), smooth, shape, crease, strict=True)
            ]
        return sorted(one for one in found if one.continuity <= most)

    def measure_smoothness(self, uv: Array, axis: int) -> tuple[list[int], list[int], list[float]]:
        """Return the continuity at points (n, 2) of knot lines, that of the shape, and the crease (rad).

        Points may be smoother than coefficients tell, and the shape smoother than the parameters.
        """
        uv, breaks = self.wrap_parameters(uv), self.breaks[axis]
        uv[:, axis] = breaks[np.abs(uv[:, axis, None] - breaks).argmin(axis=1)]
        continuity = self._measure_continuity(uv, axis)
        before, after = (self._expand_beside_knot(uv, axis, step) for step in (-1, 0))
        shape, crease = measure_shape_continuity(before, after, axis, JUMP_ROUNDING * float(np.abs(self.patches).max()))
        return continuity.tolist(), np.maximum(shape, continuity).tolist(), crease.tolist()

    def _expand_beside_knot(self, uv: Array, axis: int, step: int) -> Array:
        """Expand the patches beside knot lines at points (n, 2) of them: those before (-1) or after (0) in the axis."""
        index, pairs, rates = [], [], []
        for k in (0, 1):
            value, breaks, ones = uv[:, k], self.breaks[k], np.ones(len(uv))
            if self.angular[k]:
                index.append(np.zeros(len(uv), int))
                pairs.append(to_half_angle_pair(value).T)
                rates.append(half_angle_velocity(pairs[k].T, ones).T)
                continue
            if k == axis:
                index.append((np.searchsorted(breaks, value) + step) % (len(breaks) - 1))
                x = -float(step) * ones
            else:
                index.append(np.clip(np.searchsorted(breaks, value, "right") - 1, 0, len(breaks) - 2))
                x = (value - breaks[index[k]]) / np.diff(breaks)[index[k]]
            pairs.append(np.stack([1 - x, x]))
            rates.append(np.stack([-ones, ones]))
        return expand_patches(self.patches[..., index[0], index[1]], (pairs[0], pairs[1]), (rates[0], rates[1]))

    def _measure_continuity(self, uv: Array, axis: int) -> Array:
        """Return the continuity of the parametrisation at points (n, 2) of knot lines."""
        before, after = uv.copy(), uv.copy()
        start, end = self.breaks[axis][[0, -1]]
        if self.periods[axis] is not None:
            seam = np.minimum(after[:, axis] - start, end - after[:, axis]) < 1e-12 * (end - start)
            after[seam, axis], before[seam, axis] = start, end
        span, size = np.diff(self.breaks[axis]).min(), np.abs(self.patches).max()
        smooth = np.full(len(uv), 4)
        for k in range(4, 0, -1):
            jump = self._one_sided_derivative(after, axis, k, "right") - self._one_sided_derivative(
                before, axis, k, "left"
            )
            smooth[np.abs(jump).max(axis=1) * span**k > JUMP_ROUNDING * size] = k - 1
        return smooth

    def _one_sided_derivative(self, uv: Array, axis: int, k: int, side: BreakSide) -> Array:
        """Return the k-th derivative along a native parameter on one side of a knot line."""
        assert self.surface is not None
        order = (k, 0) if axis == 0 else (0, k)
        return self.surface(uv[:, 0], uv[:, 1], *order, side=side)

    def _cut_at_knots(self, c: Curve) -> tuple[Curve, Array, list[tuple[Array, Array] | None], Array]:
        """Cut the rail at knot lines.

        Returns the rail; the patch under each piece, (p+1, q+1, 4, n); per direction the interval that each piece lies
        in, None if angular; and the surface's continuity where the rail crosses from one patch to another.
        """
        axes = [axis for axis in (0, 1) if not self.angular[axis]]
        if not axes:
            count = len(c.breaks) - 1
            return c, np.repeat(self.patches[..., 0], count, axis=-1), [None, None], np.full(count - 1, SMOOTH)
        lines, orders = zip(*(self._list_crossable_lines(c, axis) for axis in axes), strict=True)
        weight = c.coefs[:, 2 * axes[0] : 2 * axes[0] + 2].sum(1)
        plain = np.stack([*(c.coefs[:, 2 * axis + 1] for axis in axes), weight], 1)
        bare = Curve(c.breaks, plain, rational=True, continuity=np.full(len(c.breaks) - 2, SMOOTH))
        cut, found, crossed = cut_at_knot_lines(bare, lines, orders, 0.0)
        c = c.cut(cut.breaks[1:-1])
        index = [np.zeros(len(c.breaks) - 1, int), np.zeros(len(c.breaks) - 1, int)]
        spans: list[tuple[Array, Array] | None] = [None, None]
        for axis, line, at in zip(axes, lines, found, strict=True):
            spans[axis] = line[at], line[at + 1]
            index[axis] = at % (len(self.breaks[axis]) - 1)
        return c, self.patches[..., index[0], index[1]], spans, crossed

    def _localise_pairs(self, c: Curve, spans: list[tuple[Array, Array] | None]) -> tuple[Array, Array, Array, Array]:
        """Return the barycentric pairs of lifted points or directions, local to each piece's patch, four (m+1, n).

        Pairs that are constant on all pieces have degree 0, which keeps isoparametric rails at the degree they have.
        """
        pairs = []
        for axis, span in enumerate(spans):
            pair = c.coefs[:, 2 * axis : 2 * axis + 2]
            if np.ptp(pair, axis=0).max() <= 16 * np.finfo(float).eps * np.abs(pair).max():
                pair = pair.mean(axis=0, keepdims=True)
            x, y = pair[:, 0], pair[:, 1]
            if span is None:
                pairs += [x, y]
            else:
                low, high = span
                pairs += [(high * (x + y) - y) / (high - low), (y - low * (x + y)) / (high - low)]
        return pairs[0], pairs[1], pairs[2], pairs[3]


def _lines_between(first: int, second: int) -> range:
    """Return the numbers of the lines between two of the intervals that they bound, in either order."""
    return range(min(first, second) + 1, max(first, second) + 1)


def _has_weight_kinks(orders: Sequence[Array]) -> bool:
    """Whether a rational spline is less than C2 somewhere: its weight may have kinks that the surface has not."""
    return any((np.asarray(order) < 2).any() for order in orders)


def _level_weight(jets: Sequence[Curve]) -> tuple[Curve, ...]:
    """Multiply a homogeneous ribbon by a scalar function lambda(t, v) that makes its weight one, and level, at breaks.

    There, lambda is 1/w to the order of the jets in v and to first order in t, second for jets of order 2; between
    breaks, a Hermite interpolant. It changes nothing in space, but lets the homogeneous jets be as smooth as those in
    space are, where the weight of the surface has kinks. No more than continuity is claimed.
    """
    breaks, smooth = jets[0].breaks, 1 if len(jets) < 3 else 2

    def evaluate_end_weights(curve: Curve) -> Array:
        first, last = curve.jet(breaks[:-1], smooth, side="right"), curve.jet(breaks[1:], smooth, side="left")
        return np.stack([first, last], axis=-2)[..., 3]

    weight = np.stack([evaluate_end_weights(jet) for jet in jets], axis=1)  # (smooth+1, order+1, n, 2)
    one = np.zeros_like(weight)
    one[0, 0] = 1
    inverse = dehomogenise_derivatives(np.stack([one, weight], axis=2))[:, :, 0]
    factors = [fit.hermite(breaks, inverse[:, k, ..., None]) for k in range(len(jets))]
    level = np.zeros(len(breaks) - 2, int)
    result = []
    for k in range(len(jets)):
        terms = [comb(k, i) * bernstein.multiply_polynomials(factors[i].coefs, jets[k - i].coefs) for i in range(k + 1)]
        degree = max(map(len, terms))
        rows = sum(bernstein.elevate_degree(term, degree - len(term)) for term in terms)
        result.append(Curve(breaks, rows, continuity=level))
    return tuple(result)


def _measure_seam_continuity(surface: Surface, axis: int) -> int:
    """Return the continuity, up to 2, with which a closed surface meets itself."""
    low, high = surface.domain[axis]
    other = np.linspace(*surface.domain[1 - axis], 17)
    size = float(np.abs(surface.coefs).max())

    def evaluate_boundary_row(at: float, k: int, side: Literal["left", "right"]) -> Array:
        here = np.full(17, at)
        if axis == 0:
            return surface(here, other, k, 0, side=side)
        return surface(other, here, 0, k, side=side)

    for k in (1, 2):
        if (
            np.abs(evaluate_boundary_row(low, k, "right") - evaluate_boundary_row(high, k, "left")).max()
            * (high - low) ** k
            > 1e-11 * size
        ):
            return k - 1
    return 2


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


@dataclass(frozen=True)
class RevolvedSpline(TensorSurface):
    """S(u, v) = the profile spline C(v) turned by u about the frame's Z axis; C is given in the frame."""

    frame: LocalFrame = field(default_factory=lambda: LocalFrame(np.zeros(3), np.eye(3)))
    profile: Curve | None = None

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
            angular=(True, False),
            periods=(2 * np.pi, period),
            knot_continuity=(np.empty(0, int), profile.continuity),
            levels_weight=profile.rational and _has_weight_kinks((profile.continuity,)),
            frame=frame,
            profile=profile,
        )

    def jet(self, uv: Array) -> Array:
        assert self.profile is not None
        v = self.wrap_parameters(uv)[:, 1]
        return revolve_jet(self.frame, uv[:, 0], np.stack([self.profile(v, k) for k in range(3)]))

    def _one_sided_derivative(self, uv: Array, axis: int, k: int, side: BreakSide) -> Array:
        assert self.profile is not None
        return self.profile(uv[:, axis], k, side=side)

    def _evaluate_weight(self, uv: Array) -> tuple[Array, Array]:
        if not self.rational or self.levels_weight:
            return super()._evaluate_weight(uv)
        assert self.profile is not None
        weight, slope = Curve(self.profile.breaks, self.profile.coefs[:, 3:]).jet(self.wrap_parameters(uv)[:, 1], 1)[
            ..., 0
        ]
        return weight, np.stack([np.zeros_like(slope), slope], -1)


@dataclass(frozen=True)
class RevolvedEllipse(TensorSurface):
    """S(u, v) = the ellipse M + A cos v + B sin v, given in the frame, turned by u about its Z axis: tori and more."""

    frame: LocalFrame = field(default_factory=lambda: LocalFrame(np.zeros(3), np.eye(3)))
    ellipse: Array = field(default_factory=lambda: np.array([[2.0, 0, 0], [1.0, 0, 0], [0, 0, 1.0]]))

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
            angular=(True, True),
            periods=(2 * np.pi, 2 * np.pi),
            frame=frame,
            ellipse=ellipse,
        )

    def jet(self, uv: Array) -> Array:
        middle, a, b = self.ellipse
        cos, sin = np.cos(uv[:, 1:]), np.sin(uv[:, 1:])
        profile = np.array([middle + cos * a + sin * b, cos * b - sin * a, -cos * a - sin * b])
        return revolve_jet(self.frame, uv[:, 0], profile)
