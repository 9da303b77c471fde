r"""Families: a surface reshaped by one number s, S(u, v; s), with S(u, v; 0) the surface itself.

Lee, Bedi and Dubey reshape in two ways. Control points move along their vectors from a reference point, each by its own
amount,

.. math:: p_{jk}(s) = p_{jk} + f_{jk}(s)\, (p_{jk} - C(s)),

or every point of the surface moves along the unit normal, :math:`S + f(s)\, n`. Amounts may differ from control point
to control point there too: then f is their own spline, :math:`\sum f_{jk}(s) N_{jk}(u, v)`.

Both are evaluated as they are, with their derivatives by u, v and s: nothing is approximated. Only where somebody wants
a whole offset surface as a spline is there a tolerance, unless its normals are a spline of its own kind, as those of
planes, cylinders, cones, spheres and tori are.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from cqblend.blends.contacts.surface_normals import differentiate_normal
from cqblend.checks import call_user_function, check_integer, check_number, to_float_array
from cqblend.errors import GeometryError, InputError, shown
from cqblend.splines import Curve, Surface
from cqblend.splines.approximation import approximate_surface, approximate_to_rounding
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import BreakSide
from cqblend.surfaces.primary import Primary
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import cross_product, normalise_vectors

AmountFunction = Callable[[Array], Any]

CLOSURE_TOLERANCE = 1e-9  # of the size: ends of a surface that differ by less meet
CREASE_ANGLE = 1e-4  # rad, by which normals may jump: files of other programs are no better
NORMAL_FIT_TOLERANCE = 1e-13  # of a normal: as near as that, a spline is the normal
STATIONARY_SHARE = 1e-9  # of the distance that a reference moves a surface by: less across the surface does not move it
ZERO_AMOUNT_TOLERANCE = 1e-6  # of an amount: as much as that may be left of it, or of its slope, where it must be zero


@dataclass(frozen=True)
class State:
    """What a family is at parameters x (n,) of a relation: amounts (n, m), the reference (n, 3), and their rates."""

    amounts: Array
    rates: Array
    reference: Array
    drift: Array


@dataclass(frozen=True)
class Course:
    """How amounts, and the reference, go along a relation: curves over x in [0, 1]."""

    amounts: Curve
    reference: Curve | None

    def __call__(self, x: Array) -> State:
        """Return the state at x (n,)."""
        amounts, rates = self.amounts.jet(x, 1)
        if self.reference is None:
            none = np.zeros((len(x), 3))
            return State(amounts, rates, none, none)
        return State(amounts, rates, *self.reference.jet(x, 1))


@dataclass(frozen=True)
class Family(ABC):
    """A surface and how it is reshaped.

    Attributes
    ----------
    primary : Primary
        The surface itself, s = 0.
    functions : tuple of callable
        The different amounts f(s), vectorised.
    tolerance : float
        Of the surfaces that :meth:`__call__` returns, relative to the largest amount.
    """

    primary: Primary = field(repr=False)
    functions: tuple[AmountFunction, ...]
    tolerance: float = field(default=1e-6, kw_only=True)

    lost: ClassVar[int] = 0  # orders of continuity, while the surface is reshaped

    @abstractmethod
    def jet(self, uv: Array, state: State) -> Array:
        """Return S, Su, Sv and the derivative by x, (4, n, 3), at (n, 2)."""

    @abstractmethod
    def __call__(self, s: float, tolerance: float | None = None) -> Surface:
        """Return the surface at s, over the same parameters; an offset that is no spline within a tolerance (mm).

        Raises
        ------
        GeometryError
            If an offset is not a spline within its tolerance.
        """

    def bounds(self) -> Array:
        """Return the domain of the native parameters, (2, 2); infinite where the surface goes on periodically."""
        assert isinstance(self.primary, TensorSurface)
        return np.array(
            [
                (-np.inf, np.inf) if period is not None else (breaks[0], breaks[-1])
                for breaks, period in zip(self.primary.breaks, self.primary.periods, strict=True)
            ]
        )

    def kinks(self, axis: int) -> tuple[Array, Array]:
        """Return the inner knot lines of a parameter, of the laps next to the first too, and the continuity there."""
        axis = check_integer("axis", axis, 0, 1)
        assert isinstance(self.primary, TensorSurface)
        assert self.primary.knot_continuity is not None
        lines, orders, period = (
            self.primary.inner_knot_lines(axis),
            self.primary.knot_continuity[axis] - self.lost,
            self.primary.periods[axis],
        )
        if period is None:
            return lines, orders
        lines = np.append(self.primary.breaks[axis][0], lines)
        orders = np.append(self.primary.seam_continuity[axis] - self.lost, orders)
        return np.concatenate([lines + lap * period for lap in (-1, 0, 1)]), np.tile(orders, 3)

    def size(self) -> float:
        """Return the diagonal of the box of the surface's control points (mm)."""
        assert isinstance(self.primary, TensorSurface)
        points = self.primary.patches[:, :, :3] / self.primary.patches[:, :, 3:]
        return float(np.linalg.norm(np.ptp(np.moveaxis(points, 2, -1).reshape(-1, 3), axis=0)))

    def course(self, s: Curve, which: str) -> Course:
        """Return the amounts, and the reference, for an s that goes along [0, 1].

        Raises
        ------
        InputError
            If an amount is not 0 at s = 0, or sets out from there so steeply that the blend would not be tangent to
            the surface, or is no smooth function.
        """
        if not isinstance(s, Curve) or s.dim != 1 or s.domain != (0.0, 1.0):
            raise InputError(f"s is a Curve of dim 1 over [0, 1], not {shown(s)}")
        if not isinstance(which, str):
            raise InputError(f"which surface it is, is said by a text, not {shown(which)}")
        amounts = approximate_to_rounding(lambda x: self._evaluate_amounts(s(x)[:, 0], which), (0.0, 1.0))
        end = 0.0 if abs(s(0.0)[0]) < abs(s(1.0)[0]) else 1.0
        largest = float(np.abs(amounts(np.linspace(0, 1, 65))).max())
        if not largest > 0:
            raise InputError(f"the amounts of surface {which} are 0 throughout: nothing of it is reshaped")
        value, slope = np.abs(amounts.jet(end, 1)).max(axis=1)
        if value > ZERO_AMOUNT_TOLERANCE * largest:
            raise InputError(
                f"an amount of surface {which} is {value:.3g} at s = 0, where the surface must be itself: let it start "
                "at 0"
            )
        if slope > ZERO_AMOUNT_TOLERANCE * largest:
            raise InputError(
                f"an amount of surface {which} sets out from s = 0 too steeply: along the relation its slope there is "
                f"{slope:.3g}, not 0, and the blend would not be tangent to the surface; amounts need a finite "
                "derivative at 0"
            )
        return Course(amounts, None)

    def _check_tolerance(self, given: object) -> float | None:
        """Return a tolerance that is given with s, checked also where the surface is exact."""
        tolerance = None if given is None else check_number("tolerance", given)
        if tolerance is not None and tolerance <= 0:
            raise InputError(f"tolerance must be above 0, not {tolerance:g}")
        return tolerance

    def _evaluate_amounts(self, s: Array, which: str) -> Array:
        made = np.empty((len(s), len(self.functions)))
        for i, function in enumerate(self.functions):
            rule = f"an amount of surface {which} takes an array of s and returns as many numbers"
            given = to_float_array(f"an amount of surface {which}", call_user_function(rule, function, s))
            try:
                made[:, i] = np.broadcast_to(given, s.shape)
            except ValueError as error:
                raise InputError(
                    f"an amount of surface {which} takes an array of s and returns as many numbers: {error}"
                ) from error
        if not np.isfinite(made).all():
            raise InputError(f"an amount of surface {which} is not finite for s from {s.min():.4g} to {s.max():.4g}")
        return made


@dataclass(frozen=True)
class ReferenceFamily(Family):
    """Control points moved along their vectors from a reference point.

    ``groups`` (nu, nv) tells which function each control point has, ``reference`` is a point (3,) or a function from
    an array of s to points (n, 3).
    """

    surface: Surface
    groups: Array = field(repr=False)
    reference: Array | Callable[[Array], Any]

    @classmethod
    def from_surface(
        cls,
        surface: Surface,
        functions: tuple[AmountFunction, ...],
        groups: Array,
        reference: Array | Callable[[Array], Any],
        tolerance: float,
    ) -> ReferenceFamily:
        """Make the family of a surface, which goes on periodically where it and its amounts do."""
        wide = _split_by_group(surface, groups, len(functions), surface.to_bspline()[2])
        primary = TensorSurface.from_spline(surface, find_closed_directions(wide))
        made = cls(primary, functions, surface, groups, reference, tolerance=tolerance)
        made._check_reference_moves()
        return made

    @cached_property
    def _group_shares(self) -> Surface:
        """Of each group, in turn: its control points' share of the surface (dim 3), and their part of unity."""
        return _split_by_group(self.surface, self.groups, len(self.functions), self.surface.to_bspline()[2])

    def jet(self, uv: Array, state: State) -> Array:
        """Return S, Su, Sv and the derivative by x, (4, n, 3), at (n, 2)."""
        _check_uv_and_state(uv, state)
        assert isinstance(self.primary, TensorSurface)
        u, v = self.primary.wrap_parameters(uv).T
        n, m = len(uv), len(self.functions)
        jet = self._group_shares.jet(u, v, 1)
        partials = np.stack([jet[0, 0], jet[1, 0], jet[0, 1]]).reshape(3, n, m, 4)
        share, one = partials[..., :3], partials[..., 3:]
        moved = share - one * state.reference[:, None]  # what amounts multiply
        out = np.empty((4, n, 3))
        out[:3] = (share + state.amounts[..., None] * moved).sum(axis=2)
        out[3] = (state.rates[..., None] * moved[0] - (state.amounts[..., None] * one[0]) * state.drift[:, None]).sum(
            axis=1
        )
        return out

    def __call__(self, s: float, tolerance: float | None = None) -> Surface:
        """Return the surface at s, over the same parameters, exactly."""
        self._check_tolerance(tolerance)
        degrees, knots, poles, weights = self.surface.to_bspline()
        at = np.array([check_number("s", s)])
        amounts = self._evaluate_amounts(at, "given")[0][self.groups][..., None]
        return Surface.from_bspline(
            degrees, knots, poles + amounts * (poles - self._evaluate_reference(at)[0]), weights
        )

    def course(self, s: Curve, which: str) -> Course:
        """Return the amounts, and the reference, for an s that goes along [0, 1].

        Raises
        ------
        InputError
            As :meth:`Family.course`.
        """
        amounts = super().course(s, which).amounts
        return Course(amounts, approximate_to_rounding(lambda x: self._evaluate_reference(s(x)[:, 0]), (0.0, 1.0)))

    def _evaluate_reference(self, s: Array) -> Array:
        """Return the reference points (n, 3)."""
        rule = "a reference that is a function takes an array of s and returns as many points"
        given = call_user_function(rule, self.reference, s) if callable(self.reference) else self.reference
        points = to_float_array("reference points", given)
        try:
            points = np.broadcast_to(
                points if points.ndim < 2 or points.shape[0] != 3 or len(s) == 3 else points.T, (len(s), 3)
            )
        except ValueError as error:
            raise InputError(
                f"a reference that is a function takes an array of s and returns as many points: {error}"
            ) from error
        if not np.isfinite(points).all():
            raise InputError("the reference point is not finite")
        return points

    def _check_reference_moves(self) -> None:
        """Raise InputError if the reference moves all points of the surface within it, as one inside a plane does."""
        poles = self.surface.to_bspline()[2]
        (u0, u1), (v0, v1) = self.surface.domain
        u, v = (grid.ravel() for grid in np.meshgrid(np.linspace(u0, u1, 9), np.linspace(v0, v1, 9), indexing="ij"))
        jet = self.surface.jet(u, v, 1)
        normal = cross_product(jet[1, 0], jet[0, 1])
        length = np.linalg.norm(normal, axis=1)
        normal[length > 0] /= length[length > 0, None]
        towards = jet[0, 0] - self._evaluate_reference(np.zeros(1))[0]
        size = float(np.abs(poles - poles.mean(axis=(0, 1))).max())
        if np.abs((normal * towards).sum(axis=1)).max() <= STATIONARY_SHARE * max(size, float(np.abs(towards).max())):
            point = ", ".join(f"{x:.6g}" for x in self._evaluate_reference(np.zeros(1))[0])
            raise InputError(
                f"the reference ({point}) lies in the surface, which is a plane, or a cone with its apex there: moving "
                'control points from it does not move the surface; take another reference, or by="normal"'
            )


@dataclass(frozen=True)
class OffsetFamily(Family):
    """Points moved along unit normals, ``sign`` times the amount.

    ``shares`` are the parts of unity of the functions, of dim m; None if there is one function.
    """

    sign: float = 1.0
    shares: Surface | None = field(default=None, repr=False)

    lost: ClassVar[int] = 1

    @classmethod
    def from_surface(
        cls, surface: Surface, functions: tuple[AmountFunction, ...], groups: Array, tolerance: float, sign: float = 1.0
    ) -> OffsetFamily:
        """Make the family of a spline surface, which goes on periodically where it and its amounts do.

        Raises
        ------
        GeometryError
            If the surface has a crease: there, it has two normals, and the offset is torn.
        """
        _check_creases(surface)
        one = np.zeros((*groups.shape, 0))
        shares = _split_by_group(surface, groups, len(functions), one)
        both = find_closed_directions(surface), find_closed_directions(shares)
        closed = both[0][0] and both[1][0], both[0][1] and both[1][1]
        return cls(TensorSurface.from_spline(surface, closed), functions, sign=sign, shares=shares, tolerance=tolerance)

    def jet(self, uv: Array, state: State) -> Array:
        """Return S, Su, Sv and the derivative by x, (4, n, 3), at (n, 2)."""
        _check_uv_and_state(uv, state)
        base = self.primary.jet(uv)
        n, nu, nv = differentiate_normal(base)
        out = np.empty((4, len(uv), 3))
        if self.shares is None:
            f = self.sign * state.amounts
            out[0], out[1], out[2] = base[0] + f * n, base[1] + f * nu, base[2] + f * nv
            out[3] = self.sign * state.rates * n
            return out
        assert isinstance(self.primary, TensorSurface)
        u, v = self.primary.wrap_parameters(uv).T
        jet = self.shares.jet(u, v, 1)
        f, fu, fv = (self.sign * (jet[k] * state.amounts).sum(axis=1)[:, None] for k in ((0, 0), (1, 0), (0, 1)))
        out[0] = base[0] + f * n
        out[1], out[2] = base[1] + f * nu + fu * n, base[2] + f * nv + fv * n
        out[3] = self.sign * (jet[0, 0] * state.rates).sum(axis=1)[:, None] * n
        return out

    def __call__(self, s: float, tolerance: float | None = None) -> Surface:
        """Return the surface at s, over the same parameters: exactly, or within a tolerance (mm).

        Raises
        ------
        GeometryError
            If it is not a spline within the tolerance.
        """
        tolerance = self._check_tolerance(tolerance)
        amounts = self._evaluate_amounts(np.array([check_number("s", s)]), "given")[0]
        surface, exact = self._spline, self.normals
        if not amounts.any():
            return surface
        if exact is not None and len(amounts) == 1:
            degrees, knots, poles, weights = surface.to_bspline()
            return Surface.from_bspline(degrees, knots, poles + self.sign * amounts[0] * exact.to_bspline()[2], weights)
        still = np.zeros_like(amounts)

        def evaluate_offset_grid(u: Array, v: Array) -> Array:
            uv = np.stack([grid.ravel() for grid in np.meshgrid(u, v, indexing="ij")], axis=-1)
            now, rates = (np.broadcast_to(one, (len(uv), len(amounts))) for one in (amounts, still))
            state = State(now, rates, uv, uv)
            return self.jet(uv, state)[0].reshape(len(u), len(v), 3)

        return approximate_surface(
            evaluate_offset_grid,
            surface.breaks,
            self.tolerance * float(np.abs(amounts).max()) if tolerance is None else tolerance,
            orders=(surface.continuity[0] - 1, surface.continuity[1] - 1),
        )

    @property
    def _spline(self) -> Surface:
        assert isinstance(self.primary, TensorSurface)
        assert self.primary.surface is not None
        return self.primary.surface

    @cached_property
    def normals(self) -> Surface | None:
        """The unit normals as a spline of the surface's own degrees, knots and weights, if that is what they are."""
        return interpolate_unit_normals(self._spline)


def _check_creases(surface: Surface) -> None:
    """Raise GeometryError where the normal jumps across a knot line."""
    for axis in (0, 1):
        lines = surface.breaks[axis][1:-1][surface.continuity[axis] < 1]
        along = np.linspace(*surface.domain[1 - axis], 35)[1:-1]
        at, other = (grid.ravel() for grid in np.meshgrid(lines, along, indexing="ij"))
        u, v = (at, other) if axis == 0 else (other, at)
        sides: list[BreakSide] = ["left", "right"]
        before, after = (
            cross_product(surface(u, v, 1, 0, side=side), surface(u, v, 0, 1, side=side)).reshape(-1, 3)
            for side in sides
        )
        angle = np.arctan2(np.linalg.norm(cross_product(before, after), axis=1), (before * after).sum(axis=1))
        if len(angle) and angle.max() > CREASE_ANGLE:
            i = int(angle.argmax())
            raise GeometryError(
                f"the surface has a crease of {angle[i]:.2g} rad at {'uv'[axis]} = {at[i]:.6g}: moved along its two "
                "normals there, it would be torn; reshape it from a reference, or the smooth parts one by one"
            )


def _check_uv_and_state(uv: object, state: object) -> None:
    """Raise InputError unless there are parameters (n, 2) and as many states."""
    if not isinstance(uv, np.ndarray) or uv.dtype != np.float64 or uv.ndim != 2 or uv.shape[1] != 2:
        raise InputError(f"parameters (u, v) are an array of shape (n, 2), not {shown(uv)}")
    if not isinstance(state, State) or len(state.amounts) not in (1, len(uv)):
        raise InputError(f"a state is what the course of a family gives at as many parameters, not {shown(state)}")


def interpolate_unit_normals(surface: Surface) -> Surface | None:
    """Return unit normals as a spline of the surface's own degrees, knots and weights; None if they are not one."""
    degrees, knots, poles, weights = surface.to_bspline()
    at = [_greville_abscissae(degree, vector) for degree, vector in zip(degrees, knots, strict=True)]
    designs = [
        Curve.from_bspline(degree, vector, np.eye(len(g)))(g)
        for degree, vector, g in zip(degrees, knots, at, strict=True)
    ]
    u, v = np.meshgrid(*at, indexing="ij")
    try:
        normal = _evaluate_unit_normals(surface, u.ravel(), v.ravel())
        weight = np.ones(poles.shape[:2]) if weights is None else designs[0] @ weights @ designs[1].T
        values = normal.reshape(*u.shape, 3) * weight[..., None]
        found = np.einsum("ij,jkd,lk->ild", np.linalg.inv(designs[0]), values, np.linalg.inv(designs[1]))
    except (ArithmeticError, np.linalg.LinAlgError):
        return None
    made = Surface.from_bspline(degrees, knots, found if weights is None else found / weights[..., None], weights)
    (u0, u1), (v0, v1) = surface.domain
    u, v = np.meshgrid(np.linspace(u0, u1, 37)[1:-1], np.linspace(v0, v1, 31)[1:-1], indexing="ij")
    missed = np.abs(made(u.ravel(), v.ravel()) - _evaluate_unit_normals(surface, u.ravel(), v.ravel())).max()
    return made if missed <= NORMAL_FIT_TOLERANCE * len(poles) * poles.shape[1] else None


def _evaluate_unit_normals(surface: Surface, u: Array, v: Array) -> Array:
    jet = surface.jet(u, v, 1)
    return normalise_vectors(cross_product(jet[1, 0], jet[0, 1]))


def _greville_abscissae(degree: int, knots: Array) -> Array:
    """Return the Greville abscissae, a little off the ends, where surfaces may be singular."""
    count = len(knots) - degree - 1
    g = np.array([knots[i + 1 : i + degree + 1].mean() for i in range(count)])
    return g + (knots[degree + 1] - knots[degree]) * 1e-2 * np.linspace(1, -1, count)


def _split_by_group(surface: Surface, groups: Array, count: int, values: Array) -> Surface:
    """Return, group by group, the part that its control points have in a surface of given values, and in unity."""
    degrees, knots, _, weights = surface.to_bspline()
    wide = np.concatenate([values, np.ones((*groups.shape, 1))], axis=-1)
    member = groups[..., None] == np.arange(count)
    poles = (member[..., None] * wide[:, :, None]).reshape(*groups.shape, -1)
    return Surface.from_bspline(degrees, knots, poles, weights)


def find_closed_directions(surface: Surface) -> tuple[bool, bool]:
    """Whether a surface meets itself, with the same derivative, in its two directions."""
    size = float(np.abs(surface.coefs[:, :, : surface.dim]).max())
    flags = []
    for axis in (0, 1):
        (a, b), (c, d) = surface.domain[axis], surface.domain[1 - axis]
        along = np.linspace(c, d, 17)
        ends = []
        for at in (a, b):
            uv = (np.full(17, at), along)
            u, v = uv if axis == 0 else uv[::-1]
            jet = surface.jet(u, v, 1)
            ends.append((jet[0, 0], jet[1, 0] if axis == 0 else jet[0, 1]))
        (first, slope1), (last, slope2) = ends
        scale = max(float(np.abs(slope1).max()), size / (b - a))
        flags.append(
            bool(
                np.abs(first - last).max() <= CLOSURE_TOLERANCE * size and np.abs(slope1 - slope2).max() <= 1e-6 * scale
            )
        )
    return flags[0], flags[1]
