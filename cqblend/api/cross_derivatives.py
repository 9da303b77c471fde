"""Cross derivatives along two rails: what a caller asks for, checked and fitted to ribbons.

Shared by the public functions that blend along rails, `cqblend.hermite_blend` and `cqblend.pde_blend`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, TypeAlias

import numpy as np

from cqblend.api.tolerances import BLEND_TOLERANCES
from cqblend.argument_checks import (
    call_user_function,
    check_angle,
    check_integer,
    check_pair,
    check_positive,
    refuse_ignored_options,
    to_float_array,
)
from cqblend.blend_numbers import check_bulge
from cqblend.blend_options import BLEND_DEFAULTS, G0_HAS_NO_CROSS_FIELD
from cqblend.blends.rails.direction_fit import DirectionFit, fit_ribbons_on_rails
from cqblend.blends.rails.rail import FIELDS, FieldName, Rail
from cqblend.blends.rails.regularity import sample_stations
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.errors import GeometryError, InputError, shown
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array

Amount: TypeAlias = float | Curve | Callable[[Array], Any]
"""A number, a curve of dim 1 over the rail's domain, or a function of arrays of the rail's parameter t."""

CrossLength: TypeAlias = Amount | Literal["field"] | None
"""Length of a cross derivative: as `Amount` (mm), that of the unnormalised field, or None for the rails' distance."""


@dataclass(frozen=True)
class Guide:
    """Kim and Elber's T4: the cross direction is the projection of a guiding curve K(t) on the tangent plane.

    For both sides at once, a second curve may be given; without it, K2 = -K1. Curves have dim 3, run over the rail's
    domain, and point into the blend.
    """

    first: Curve
    second: Curve | None = None

    def operands(self, side: int) -> tuple[Curve, ...]:
        """Return the guiding curve of side 0 or 1."""
        side = _check_side_index(self, side)
        return (self.first if side == 0 else -self.first if self.second is None else self.second,)


@dataclass(frozen=True)
class Combination:
    """Kim and Elber's T5: the cross direction r Su + s Sv, with a plane curve (r, s)(t), or the difference of two."""

    first: Curve
    second: Curve | None = None

    def operands(self, side: int) -> tuple[Curve, ...]:
        """Return the one curve or the two, the same on side 0 and 1."""
        _check_side_index(self, side)
        return (self.first,) if self.second is None else (self.first, self.second)


def _check_side_index(field: Guide | Combination, side: object) -> int:
    """Return side 0 or 1 of a field of cross directions that is made of one or two curves."""
    for curve in (field.first, field.second):
        if curve is not None and not isinstance(curve, Curve):
            raise InputError(f"a {type(field).__name__} is made of Curves, not {shown(curve)}")
    if field.first is None:
        raise InputError(f"a {type(field).__name__} takes a Curve")
    return check_integer("side", side, 0, 1)


Tangents: TypeAlias = FieldName | Guide | Combination


@dataclass(frozen=True, slots=True)
class CrossDerivativeOptions:
    """The options of cross derivatives along two rails, as in :func:`hermite_blend` and `cqblend.pde_blend`."""

    tangents: object
    bulge: object
    length: object
    steer: object

    def refuse_given(self, why: str) -> None:
        """Raise InputError if one was given where it has no effect; `why` completes "an option has no effect .."."""
        refuse_ignored_options(
            why,
            tangents=(self.tangents, BLEND_DEFAULTS.tangents),
            bulge=(self.bulge, BLEND_DEFAULTS.bulge),
            length=(self.length, None),
            steer=(self.steer, BLEND_DEFAULTS.steer),
        )


def prepare_rails(
    given: tuple[Rail, Rail], orders: tuple[int, int], options: CrossDerivativeOptions
) -> tuple[tuple[Rail, Rail], tuple[Ribbon, Ribbon]]:
    """Check rails and the options of cross derivatives; return the rails, with sides and one domain, and ribbons.

    Raises
    ------
    CqblendError
        As :func:`hermite_blend`.
    """
    for rail in given:
        if not isinstance(rail, Rail):
            raise InputError(f"a blend of surfaces takes two cqblend.Rail, not {shown(rail)}")
    rail1, rail2 = given
    if rail2.domain != rail1.domain:
        rail2 = rail2.reparametrized(*rail1.domain)
    _check_senses(rail1, rail2)
    rails = (
        rail1 if rail1.side is not None else rail1.towards(rail2),
        rail2 if rail2.side is not None else rail2.towards(rail1),
    )
    if orders == (0, 0):
        refuse_ignored_options(
            G0_HAS_NO_CROSS_FIELD,
            bulge=(options.bulge, BLEND_DEFAULTS.bulge),
            steer=(options.steer, BLEND_DEFAULTS.steer),
        )
    kinds = check_pair("tangents", options.tangents, _check_tangents)
    for kind in kinds:
        if isinstance(kind, Guide) and kind.second is not None and kinds[0] is not kinds[1]:
            raise InputError("the second curve of a Guide has no effect unless the Guide is that of both sides")
    bulges = check_pair("bulge", options.bulge, partial(_check_amount, check_number=check_bulge))
    lengths = check_pair("length", options.length, _check_length)
    steer = check_angle("steer", options.steer)
    closed = rail1.closed and rail2.closed
    fits = []
    for i in (0, 1):
        side = _BlendSide(rails[i], rails[1 - i], kinds[i], i, lengths[i], bulges[i])
        side.check_inputs()
        if orders[i] and given[i].side is not None:
            side.check_side()
        fits.append(
            DirectionFit(
                rails[i], side.cross_derivatives, orders[i], closed and side.has_closed_field(), side.exact_direction
            )
        )
    return rails, fit_ribbons_on_rails((fits[0], fits[1]), steer)


@dataclass(frozen=True)
class _BlendSide:
    """The wanted cross derivatives along one rail.

    Attributes
    ----------
    rail, other
        The rail, and that of the other side.
    index
        0 for side 1, 1 for side 2.
    tangents, length, bulge
        As in :func:`hermite_blend`, of this side.
    """

    rail: Rail
    other: Rail
    tangents: Tangents
    index: int
    length: CrossLength
    bulge: Amount

    @property
    def _field_name(self) -> FieldName:
        if isinstance(self.tangents, Guide):
            return "guide"
        return "combination" if isinstance(self.tangents, Combination) else self.tangents

    @property
    def _field_operands(self) -> tuple[Any, ...]:
        if isinstance(self.tangents, Guide | Combination):
            return self.tangents.operands(self.index)
        return (self.other,) if self.tangents == "chord" else ()

    def field_coordinates(self, t: Array) -> Array:
        """Return the field's own (r, s), (n, 2), at t."""
        return self.rail.coordinates(self._field_name, t, *self._field_operands)

    def cross_derivatives(self, t: Array) -> Array:
        """Return the wanted cross derivatives (n, 3) at t."""
        rs, uv = self.field_coordinates(t), self.rail.curve(t)
        jet = self.rail.surface.jet(uv[:, 0], uv[:, 1], 1)
        vectors = rs[:, :1] * jet[1, 0] + rs[:, 1:] * jet[0, 1]
        size = np.linalg.norm(vectors, axis=1)
        if self.length is None:
            size = np.linalg.norm(self.other.curve3d()(t) - jet[0, 0], axis=1) / size
        elif isinstance(self.length, str):  # "field"
            size = np.ones_like(size)
        else:
            size = _evaluate_amount(self.length, t) / size
        return vectors * (size * _evaluate_amount(self.bulge, t))[:, None]

    def check_inputs(self) -> None:
        """Check the domains of length and bulge, and that the cross derivative vanishes at no station."""
        for name, curve in (("length", self.length), ("bulge", self.bulge)):
            if isinstance(curve, Curve) and curve.domain != self.rail.domain:
                (a, b), (c, d) = self.rail.domain, curve.domain
                raise InputError(
                    f"the {name} of rail {self.index + 1} runs over [{c:.9g}, {d:.9g}], its rail over [{a:.9g}, "
                    f"{b:.9g}]; use .reparametrized({a:.9g}, {b:.9g})"
                )
        t = sample_stations(self.rail.curve3d().breaks)
        self.rail.check_direction(self.field_coordinates(t), t)
        size = np.linalg.norm(self.cross_derivatives(t), axis=1)
        if not np.all(size > 0):
            raise GeometryError(
                f"the cross derivative at t = {t[size.argmin()]:.9g} of rail {self.index + 1} has no length: do the "
                "rails meet there? give a length"
            )
        self._check_jumps()

    def check_side(self) -> None:
        """Raise InputError if the cross direction points to the other side of the rail than ``rail.side`` says."""
        t = np.array([sum(self.rail.domain) / 2])
        (rate,), ((r, s),) = self.rail.curve(t, 1), self.field_coordinates(t)
        side = "left" if rate[0] * s - rate[1] * r > 0 else "right"
        if side != self.rail.side:
            raise InputError(
                f'side="{self.rail.side}" of rail {self.index + 1} has no effect: the {self._field_name} points '
                f"to its {side}; leave the side out, or turn the direction"
            )

    def _check_jumps(self) -> None:
        """Raise InputError where the curve of a Guide or Combination is discontinuous."""
        if not isinstance(self.tangents, Guide | Combination):
            return
        for curve in self.tangents.operands(self.index):
            t = curve.breaks[1:-1]
            jump = np.linalg.norm(curve(t) - curve(t, side="left"), axis=1)
            if len(t) and jump.max() > BLEND_TOLERANCES.direction_jump * np.abs(curve(t)).max():
                raise InputError(
                    f"the {type(self.tangents).__name__} of rail {self.index + 1} jumps at t = "
                    f"{t[jump.argmax()]:.6g}: a cross direction must be continuous"
                )

    def has_closed_field(self) -> bool:
        """Whether the cross derivatives at both ends of the rail are equal."""
        first, last = self.cross_derivatives(np.array(self.rail.domain))
        return bool(np.linalg.norm(first - last) <= BLEND_TOLERANCES.closure * np.linalg.norm(first))

    @property
    def exact_direction(self) -> Curve | None:
        """The cross direction (r, s) as a curve, None if it has to be fitted.

        It is exact where the length is that of the field and the bulge a number, if it is a polynomial of class C1. One
        of class C0, such as T1 of a rail of class C1, would leave a crease in the blend.
        """
        if not isinstance(self.length, str) or not isinstance(self.bulge, float) or self.rail.curve.rational:
            return None
        rs = self.rail.symbolic_coordinates(self._field_name, *self._field_operands)
        return None if rs is None or rs.rational or (rs.continuity < 1).any() else rs * self.bulge


def _check_senses(rail1: Rail, rail2: Rail) -> None:
    """Raise GeometryError if two rails run in opposite directions, so that the sections between them would cross."""
    t = np.linspace(*rail1.domain, 65)
    one, two = rail1.curve3d()(t), rail2.curve3d()(t)
    if (np.diff(one, axis=0) * np.diff(two, axis=0)).sum() < 0:
        distances = [np.linalg.norm(one - other, axis=1).sum() for other in (two, two[::-1])]
        if distances[1] < distances[0]:
            raise GeometryError("the rails run in opposite senses, and the sections between them cross: .reverse() one")


def _evaluate_amount(amount: Amount, t: Array) -> Array:
    """Return the values (n,) of a length or bulge at t (n,); they must be above 0."""
    rule = "a length or bulge that is a function takes an array of parameters and returns as many numbers"
    given = to_float_array(
        f"{rule}, which", call_user_function(rule, amount, t) if callable(amount) else amount
    ).squeeze()
    if given.shape not in ((), t.shape):
        raise InputError(
            f"a length or bulge that is a function takes an array of parameters, here {len(t)}, and returns as many "
            f"numbers, or one, not an array of shape {given.shape}"
        )
    values = np.broadcast_to(given, t.shape)
    if not np.all(values > 0) or not np.all(np.isfinite(values)):
        worst = int(np.argmin(np.where(np.isfinite(values), values, -np.inf)))
        raise InputError(f"a length or bulge is {values[worst]:.4g} at t = {t[worst]:.6g}: it must be above 0")
    return values


def _check_tangents(name: str, value: object) -> Tangents:
    if isinstance(value, Guide | Combination):
        return value
    for known in FIELDS[:3]:
        if isinstance(value, str) and value == known:
            return known
    raise InputError(f"{name} must be one of {', '.join(FIELDS[:3])}, a Guide or a Combination, not {shown(value)}")


def _check_amount(name: str, value: object, check_number: Callable[[str, object], float] = check_positive) -> Amount:
    if isinstance(value, Curve) and value.dim != 1:
        raise InputError(f"{name} must be a curve of dim 1, not {value.dim}")
    return value if callable(value) else check_number(name, value)


def _check_length(name: str, value: object) -> CrossLength:
    if isinstance(value, str):
        if value != "field":
            raise InputError(f"{name} must be 'field', None, a number, a Curve or a function of t, not {shown(value)}")
        return "field"
    return None if value is None else _check_amount(name, value)
