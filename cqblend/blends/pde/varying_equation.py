r"""Equations whose shape parameters vary along the blend.

Where a parameter is a function of w, it stands inside the derivatives along, as the stiffness of a plate does:

.. math:: \sum_{i=0}^{n/2} \frac{\partial^i}{\partial w^i}
    \Big( c_i(w)\, \frac{\partial^{n-i} f}{\partial v^{n-2i}\, \partial w^i} \Big) = 0,

which is You and Zhang's equation where they are constant. It is what makes the energy
:math:`\int \sum_i c_i\, (\partial_v^{n/2-i} \partial_w^i f)^2` least, so that with parameters above 0 any boundary data
determine a solution. Knows no rails.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import comb
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np

from cqblend.argument_checks import call_user_function, check_number, to_float_array
from cqblend.blends.pde.equations import (
    COEFFICIENT_NAMES,
    DerivativeTerm,
    Equation,
    LinearEquation,
    Minimise,
    ShapeParameters,
    make_equations,
)
from cqblend.blends.pde.tolerances import PDE_LIMITS, PDE_TOLERANCES
from cqblend.errors import GeometryError, InputError, shown
from cqblend.splines import Curve
from cqblend.splines.approximation import approximate_curve
from cqblend.splines.bernstein import Array

ParameterFunction: TypeAlias = Callable[[Array], Any]
VaryingParameter: TypeAlias = float | ParameterFunction
VaryingParameters: TypeAlias = (
    ShapeParameters
    | VaryingParameter
    | Sequence[VaryingParameter]
    | Sequence[Sequence[VaryingParameter]]
    | Literal["local"]
)


class RailInterval(NamedTuple):
    """The range of w along the rails, and whether they are closed."""

    domain: tuple[float, float]
    closed: bool


class VaryingCoefficient(Protocol):
    """A coefficient that is a function of w, at least C3."""

    def __call__(self, w: Array, k: int = 0) -> Array:
        """Return its k-th derivative (n,) at w (n,), for k up to 3."""
        ...


@dataclass(frozen=True)
class CurveCoefficient:
    """A coefficient that is a curve of dim 1."""

    curve: Curve

    def __call__(self, w: Array, k: int = 0) -> Array:
        """Return its k-th derivative (n,) at w (n,)."""
        return self.curve(w, k)[:, 0]


@dataclass(frozen=True)
class PowerCoefficient:
    """A factor times a power of a width, which is given by its logarithm, a curve of dim 1."""

    log_width: Curve
    factor: float
    exponent: int

    def __call__(self, w: Array, k: int = 0) -> Array:
        """Return its k-th derivative (n,) at w (n,), for k up to 3."""
        g = [self.exponent * self.log_width(w, i)[:, 0] for i in range(k + 1)]
        value = self.factor * np.exp(g[0])
        if k == 0:
            return value
        if k == 1:
            return value * g[1]
        if k == 2:
            return value * (g[2] + g[1] ** 2)
        return value * (g[3] + 3 * g[1] * g[2] + g[1] ** 3)


@dataclass(frozen=True, eq=False)
class VaryingEquation(LinearEquation):
    """An equation whose coefficients are functions of w, on a ``domain``.

    Raises
    ------
    InputError
        If the first or the last is not above 0 everywhere, another one is below 0, or the first is nothing beside the
        others.
    """

    coefficients: tuple[VaryingCoefficient, ...]
    domain: tuple[float, float]

    def __post_init__(self) -> None:
        w = np.linspace(*self.domain, PDE_LIMITS.parameter_samples)
        values = np.stack([coefficient(w) for coefficient in self.coefficients])
        for i, row in enumerate(values):
            is_middle = 0 < i < self.half
            if row.min() < -PDE_TOLERANCES.parameter_fit * row.max() if is_middle else row.min() <= 0:
                raise InputError(
                    f"parameter {COEFFICIENT_NAMES[i]} is {row.min():.6g} at w = {w[row.argmin()]:.6g}: where "
                    "parameters vary, the first and the last must be above 0, and none below"
                )
        share = values[0] / np.abs(values).max(axis=0)
        if not share.min() * PDE_LIMITS.coefficient_ratio >= 1:
            raise InputError(
                f"parameter a is {values[0, share.argmin()]:.6g} at w = {w[share.argmin()]:.6g}, which is nothing "
                f"beside the others: take it above {1 / PDE_LIMITS.coefficient_ratio:g} of them"
            )

    @classmethod
    def from_width(
        cls, order: int, width: ParameterFunction, interval: RailInterval, accuracy: float
    ) -> VaryingEquation:
        r"""Return the power n/2 of Laplace's operator on a strip whose width is s(w) times a unit of w.

        Its coefficients are :math:`\tbinom{n/2}{i} s^{2i+1-n}`. The width is above 0, and fitted to a share
        ``accuracy`` of it.
        """
        half, log_width = order // 2, _fit_curve(lambda w: np.log(width(w)), interval, accuracy)
        return cls(
            tuple(PowerCoefficient(log_width, comb(half, i), 2 * i + 1 - order) for i in range(half + 1)),
            interval.domain,
        )

    @property
    def half(self) -> int:
        """Number of conditions on each rail, n/2."""
        return len(self.coefficients) - 1

    @property
    def largest_exponent(self) -> float:
        r"""Largest \|rho\| of the solutions :math:`e^{\rho v + i w}` with the parameters of any one place."""
        w = np.linspace(*self.domain, PDE_LIMITS.parameter_samples)[:: PDE_LIMITS.exponent_stride]
        rows = np.stack([coefficient(w) for coefficient in self.coefficients], axis=1)
        return max(Equation(tuple(row)).largest_exponent for row in np.maximum(rows, 0.0).tolist())

    def list_forms(self, minimise: Minimise, w: Array) -> list[list[DerivativeTerm]]:
        """Return the equation, by Leibniz's rule, or the square roots of its energy's terms."""
        half, n = self.half, self.order
        if minimise == "energy":
            values = [np.sqrt(np.maximum(coefficient(w), 0.0)) for coefficient in self.coefficients]
            return [[DerivativeTerm(c, half - i, i)] for i, c in enumerate(values) if c.any()]
        return [
            [
                DerivativeTerm(comb(i, k) * coefficient(w, k), n - 2 * i, 2 * i - k)
                for i, coefficient in enumerate(self.coefficients)
                for k in range(i + 1)
            ]
        ]


def make_varying_equations(
    order: tuple[int, int, int], parameters: VaryingParameters, scale: float, interval: RailInterval
) -> tuple[LinearEquation, LinearEquation, LinearEquation]:
    """Return the equations of x, y and z, whose parameters may be functions of w.

    Parameters
    ----------
    order, parameters, scale
        As :func:`cqblend.blends.pde.equations.make_equations` takes them, but that functions from w (n,) to values (n,)
        may stand for numbers. One function s(w) is the width of :meth:`VaryingEquation.from_width`.
    interval
        The range of w.

    Raises
    ------
    InputError
        As :func:`cqblend.blends.pde.equations.make_equations`, and if a function does not return finite numbers, is not
        smooth, does not return to where it started on closed rails, or is not above 0.
    """
    if callable(parameters):
        width = wrap_parameter(parameters)
        _check_positive_width(width, interval)
        return make_width_equations(order, width, interval, PDE_TOLERANCES.parameter_fit)
    if not has_functions(parameters):
        return make_equations(order, parameters, scale)  # type: ignore[arg-type]
    rows: list[Any] = list(parameters)  # type: ignore[arg-type]
    if not any(isinstance(row, list | tuple | np.ndarray) for row in rows):
        rows = [rows] * 3
    if len(rows) != 3 or not all(isinstance(row, list | tuple | np.ndarray) for row in rows):
        raise InputError(f"parameters must be a, b, .., or three times that, not {shown(parameters)}")
    curves: dict[int, Curve] = {}
    equations: dict[tuple[int, ...], LinearEquation] = {}
    found = []
    for name, row, n in zip("xyz", rows, order, strict=True):
        if len(row) != n // 2 + 1:
            raise InputError(f"an equation of order {n} has {n // 2 + 1} parameters; there are {len(row)} for {name}")
        key = tuple(map(id, row))
        if key not in equations:
            for value in row:
                if id(value) not in curves:
                    curves[id(value)] = _to_parameter_curve(value, interval)
            coefficients = tuple(CurveCoefficient(curves[id(value)]) for value in row)
            equations[key] = VaryingEquation(coefficients, interval.domain)
        found.append(equations[key])
    return found[0], found[1], found[2]


def make_width_equations(
    order: tuple[int, int, int], width: ParameterFunction, interval: RailInterval, accuracy: float
) -> tuple[LinearEquation, LinearEquation, LinearEquation]:
    """Return the equations of :meth:`VaryingEquation.from_width` for x, y and z, one for all of the same order."""
    made = {n: VaryingEquation.from_width(n, width, interval, accuracy) for n in set(order)}
    return made[order[0]], made[order[1]], made[order[2]]


def has_functions(parameters: object) -> bool:
    """Whether there is a function among parameters, or among those for x, y and z."""
    if not isinstance(parameters, list | tuple | np.ndarray):
        return callable(parameters)
    rows = (row if isinstance(row, list | tuple | np.ndarray) else [row] for row in parameters)
    return any(callable(one) for row in rows for one in row)


def replace_argument(parameters: VaryingParameters, locate: Callable[[Array], Array]) -> VaryingParameters:
    """Return parameters whose functions take what ``locate`` makes of w (n,)."""
    if not has_functions(parameters):
        return parameters
    if isinstance(parameters, list | tuple | np.ndarray):
        return tuple(replace_argument(one, locate) for one in parameters)  # type: ignore[return-value]
    if not callable(parameters):
        return parameters
    function: ParameterFunction = parameters
    return lambda w: function(locate(w))


def wrap_parameter(function: ParameterFunction) -> ParameterFunction:
    """Return a function of the caller's as one from w (n,) to finite values (n,); it raises InputError else."""

    def call_checked(w: Array) -> Array:
        rule = "parameters that are functions take an array of w and return as many numbers"
        values = to_float_array(f"{rule}: what one returns", call_user_function(rule, function, w.copy()))
        if values.shape not in ((), (len(w),), (len(w), 1)):
            raise InputError(f"{rule}, not {values.shape} of them for {w.shape}")
        values = np.broadcast_to(values.reshape(-1), w.shape)
        if not np.isfinite(values).all():
            i = int(np.isfinite(values).argmin())
            raise InputError(f"a parameter is {values[i]} at w = {w[i]:.6g}: it must be finite")
        return np.asarray(values)

    return call_checked


def _fit_curve(function: ParameterFunction, interval: RailInterval, tolerance: float) -> Curve:
    """Return a function of w as a curve of dim 1, C4, within a tolerance."""
    try:
        return approximate_curve(
            lambda w: function(w)[:, None],
            interval.domain,
            tolerance,
            closed=interval.closed,
        )
    except GeometryError as error:
        raise InputError(f"a parameter is not smooth along the rails: {error}; take one without corners") from error


def _to_parameter_curve(value: VaryingParameter, interval: RailInterval) -> Curve:
    """Return a number or a function as a curve."""
    if callable(value):
        function = wrap_parameter(value)
        _, values = _sample_function(function, interval)
        return _fit_curve(function, interval, PDE_TOLERANCES.parameter_fit * float(np.abs(values).max()))
    return Curve(interval.domain, np.full((1, 1, 1), check_number("each of the parameters", value)))


def _sample_function(function: ParameterFunction, interval: RailInterval) -> tuple[Array, Array]:
    """Return places w (n,) all along and values there, after checking that these close on closed rails."""
    w = np.linspace(*interval.domain, PDE_LIMITS.parameter_samples)
    values = function(w)
    if interval.closed and abs(values[-1] - values[0]) > PDE_TOLERANCES.closing_gap * np.abs(values).max():
        raise InputError(
            f"a parameter is {values[0]:.6g} at the start of closed rails and {values[-1]:.6g} at their end, which are "
            "one place: both must be the same"
        )
    return w, values


def _check_positive_width(width: ParameterFunction, interval: RailInterval) -> None:
    """Raise InputError where a width is not above 0, or too small beside others."""
    w, values = _sample_function(width, interval)
    if not values.min() > PDE_TOLERANCES.least_parameter_width * values.max():
        raise InputError(
            f"parameters is {values.min():.6g} at w = {w[values.argmin()]:.6g}: a function of w is to be above "
            f"{PDE_TOLERANCES.least_parameter_width:g} times its largest value, {values.max():.6g}"
        )
