r"""Families of surfaces S(u, v; s), reshaped by one number s, with S(u, v; 0) the surface itself: the common part.

Lee, Bedi and Dubey reshape in two ways. Control points move along their vectors from a reference point, each by its own
amount (:mod:`cqblend.blends.potential.reference_family`),

.. math:: p_{jk}(s) = p_{jk} + f_{jk}(s)\, (p_{jk} - C(s)),

or every point of the surface moves along the unit normal, :math:`S + f(s)\, n`
(:mod:`cqblend.blends.potential.offset_family`). There, too, amounts may differ from control point to control point:
then f is the spline :math:`\sum f_{jk}(s) N_{jk}(u, v)`.

Amounts f are functions of s; along a relation s is a function of x, and so are the amounts.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from cqblend.argument_checks import call_user_function, check_integer, check_interval, check_number, to_float_array
from cqblend.blends.potential.tolerances import POTENTIAL_TOLERANCES
from cqblend.errors import InputError, shown
from cqblend.splines import Curve, Surface
from cqblend.splines.approximation import approximate_to_rounding
from cqblend.splines.bernstein import Array
from cqblend.surfaces.tensor_surface import SplineSurface

AmountFunction = Callable[[Array], Any]


@dataclass(frozen=True)
class State:
    """How far a surface is reshaped at parameters x (n,) of a relation.

    ``amounts`` (n, m) and ``reference`` (n, 3), and their derivatives by x: ``rates`` (n, m) and ``drift`` (n, 3).
    """

    amounts: Array
    rates: Array
    reference: Array
    drift: Array


@dataclass(frozen=True)
class Course:
    """Amounts, and the reference if there is one, along a relation: curves over x in [0, 1]."""

    amounts: Curve
    reference: Curve | None

    def __call__(self, x: Array) -> State:
        """Return the state at x (n,)."""
        amounts, rates = self.amounts.jet(x, 1)
        if self.reference is None:
            zeros = np.zeros((len(x), 3))
            return State(amounts, rates, zeros, zeros)
        return State(amounts, rates, *self.reference.jet(x, 1))


@dataclass(frozen=True)
class Family(ABC):
    """A spline surface and how it is reshaped.

    Attributes
    ----------
    primary : SplineSurface
        The surface itself, s = 0; in closed directions it goes on periodically.
    functions : tuple of callable
        The different amounts f(s), vectorised.
    tolerance : float
        Of the surfaces that :meth:`__call__` returns, relative to the largest amount.
    """

    primary: SplineSurface = field(repr=False)
    functions: tuple[AmountFunction, ...]
    tolerance: float = field(default=1e-6, kw_only=True)

    lost: ClassVar[int] = 0  # derivatives that the reshaped surface has fewer than the surface itself

    @property
    def surface(self) -> Surface:
        """The surface itself, over its domain."""
        return self.primary.surface

    @abstractmethod
    def jet(self, uv: Array, state: State) -> Array:
        """Return S, Su, Sv and the derivative by x, (4, n, 3), at (n, 2)."""

    @abstractmethod
    def __call__(self, s: float, tolerance: float | None = None) -> Surface:
        """Return the surface at s, over the same parameters; an offset that is not a spline, within a tolerance (mm).

        Raises
        ------
        GeometryError
            If an offset cannot be approximated within its tolerance.
        """

    def bounds(self) -> Array:
        """Return the domain of the native parameters, (2, 2); infinite where the surface goes on periodically."""
        return np.array(
            [
                (-np.inf, np.inf) if period is not None else (breaks[0], breaks[-1])
                for breaks, period in zip(self.primary.breaks, self.primary.periods, strict=True)
            ]
        )

    def kinks(self, axis: int, within: tuple[float, float]) -> tuple[Array, Array]:
        """Return the inner knots of a parameter, and the continuity of the reshaped surface there.

        In a closed direction, the seam is one of them, and they are those of all periods that a range touches.
        """
        axis, (low, high) = check_integer("axis", axis, 0, 1), check_interval("within", within)
        knots, period = self.primary.inner_knot_lines(axis), self.primary.periods[axis]
        orders = self.surface.continuity[axis] - self.lost
        if period is None:
            return knots, orders
        knots = np.append(self.primary.breaks[axis][0], knots)
        orders = np.append(self.primary.seam_continuity[axis] - self.lost, orders)
        first, last = np.floor((np.array([low, high]) - knots[-1]) / period).astype(int).tolist()
        turns = np.arange(first, last + 2)
        return (knots + turns[:, None] * period).ravel(), np.tile(orders, len(turns))

    def size(self) -> float:
        """Return the diagonal of the box of the surface's control points (mm)."""
        points = self.primary.patches[:, :, :3] / self.primary.patches[:, :, 3:]
        return float(np.linalg.norm(np.ptp(np.moveaxis(points, 2, -1).reshape(-1, 3), axis=0)))

    def course(self, s: Curve, which: str) -> Course:
        """Return the amounts, and the reference, along a relation.

        Parameters
        ----------
        s
            s(x), a Curve of dim 1 over [0, 1].
        which
            "1" or "2": which surface this is, for messages.

        Raises
        ------
        InputError
            If an amount is not 0 at s = 0, or so steep there that the blend would not be tangent to the surface, or
            not a smooth function.
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
        if value > POTENTIAL_TOLERANCES.vanishing_amount * largest:
            raise InputError(
                f"an amount of surface {which} is {value:.3g} at s = 0, where the surface must be itself: let it start "
                "at 0"
            )
        if slope > POTENTIAL_TOLERANCES.vanishing_amount * largest:
            raise InputError(
                f"an amount of surface {which} sets out from s = 0 too steeply: along the relation its slope there is "
                f"{slope:.3g}, not 0, and the blend would not be tangent to the surface; amounts need a finite "
                "derivative at 0"
            )
        return Course(amounts, None)

    def _check_tolerance(self, given: object) -> float | None:
        """Check the tolerance that a caller gives with s, also where the surface is exact."""
        tolerance = None if given is None else check_number("tolerance", given)
        if tolerance is not None and tolerance <= 0:
            raise InputError(f"tolerance must be above 0, not {tolerance:g}")
        return tolerance

    def _evaluate_amounts(self, s: Array, which: str) -> Array:
        """Return the amounts (n, m) at s (n,)."""
        amounts = np.empty((len(s), len(self.functions)))
        for i, function in enumerate(self.functions):
            rule = f"an amount of surface {which} takes an array of s and returns as many numbers"
            given = to_float_array(f"an amount of surface {which}", call_user_function(rule, function, s))
            try:
                amounts[:, i] = np.broadcast_to(given, s.shape)
            except ValueError as error:
                raise InputError(
                    f"an amount of surface {which} takes an array of s and returns as many numbers: {error}"
                ) from error
        if not np.isfinite(amounts).all():
            raise InputError(f"an amount of surface {which} is not finite for s from {s.min():.4g} to {s.max():.4g}")
        return amounts


def check_uv_and_state(uv: object, state: object) -> None:
    """Raise InputError unless there are parameters (n, 2) and as many states."""
    if not isinstance(uv, np.ndarray) or uv.dtype != np.float64 or uv.ndim != 2 or uv.shape[1] != 2:
        raise InputError(f"parameters (u, v) are an array of shape (n, 2), not {shown(uv)}")
    if not isinstance(state, State) or len(state.amounts) not in (1, len(uv)):
        raise InputError(f"a state is what the course of a family gives at as many parameters, not {shown(state)}")


def split_by_group(surface: Surface, groups: Array, count: int, values: Array) -> Surface:
    """Split a surface whose control points have ``values`` (nu, nv, d) into the parts of the groups of control points.

    Returns a surface of dimension count (d + 1): for each group the sum over its control points of value times rational
    basis function, then the sum of the basis functions alone.
    """
    degrees, knots, _, weights = surface.to_bspline()
    values_and_one = np.concatenate([values, np.ones((*groups.shape, 1))], axis=-1)
    is_member = groups[..., None] == np.arange(count)
    poles = (is_member[..., None] * values_and_one[:, :, None]).reshape(*groups.shape, -1)
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
                np.abs(first - last).max() <= POTENTIAL_TOLERANCES.closing_gap * size
                and np.abs(slope1 - slope2).max() <= POTENTIAL_TOLERANCES.closing_slope * scale
            )
        )
    return flags[0], flags[1]
