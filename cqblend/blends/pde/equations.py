r"""The partial differential equations of You and Zhang's blends, one for each component of space.

Between two rails a blend is a function of v across, from 0 on the first to 1 on the second, and of w along them (the
paper's u and v). Each of its components x, y, z solves an equation of order n = 2, 4 or 6 ("Effects of different order
PDEs on blending surfaces", eq. 1 to 6), with shape parameters c_0 = a, c_1 = b, ..,

.. math:: \sum_{i=0}^{n/2} c_i \frac{\partial^n f}{\partial v^{n-2i} \partial w^{2i}} = 0.

It takes n/2 conditions on each rail: the position, for n = 4 the first derivative across, for n = 6 the second one.
Its symbol is the polynomial :math:`\sum_i c_i z^{n/2 - i}`; where that has a root z >= 0, the boundary does not
determine the solution. Depends on numbers and arrays only: boundary data and the solver are elsewhere in this package.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from math import comb
from numbers import Real
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from cqblend.argument_checks import check_number
from cqblend.blends.pde.tolerances import PDE_LIMITS, PDE_TOLERANCES
from cqblend.errors import InputError, shown
from cqblend.splines.bernstein import Array

COEFFICIENT_NAMES = "abcd"

ShapeParameters: TypeAlias = float | Sequence[float] | Sequence[Sequence[float]] | None


Minimise: TypeAlias = Literal["residual", "energy"]


class DerivativeTerm(NamedTuple):
    """A derivative, ``across`` times by v and ``along`` times by w, with its coefficient, (n,) at places along."""

    coefficient: Array
    across: int
    along: int


class LinearEquation(ABC):
    """A linear equation in v and w, with coefficients that are constant or vary with w."""

    @property
    @abstractmethod
    def half(self) -> int:
        """Number of conditions on each rail, n/2."""

    @property
    def order(self) -> int:
        """Order n."""
        return 2 * self.half

    @property
    @abstractmethod
    def largest_exponent(self) -> float:
        r"""Largest \|rho\| of the solutions :math:`e^{\rho v + i w}`; for :math:`e^{i \omega w}` times omega."""

    @abstractmethod
    def list_forms(self, minimise: Minimise, w: Array) -> list[list[DerivativeTerm]]:
        """Return the forms whose squares are integrated, at w (n,): the equation itself, or those of its energy.

        The energy of all functions with the same boundary data is least for the one that solves the equation.
        """


@dataclass(frozen=True)
class Equation(LinearEquation):
    """One equation, by its coefficients (a, b), (a, b, c) or (a, b, c, d).

    Raises
    ------
    InputError
        If it is degenerate: a is zero, or the symbol has a root z >= 0.

    Examples
    --------
    >>> Equation((1.0, 2.0, 1.0)).order
    4
    >>> Equation((1.0, -1.0))
    Traceback (most recent call last):
    ...
    cqblend.errors.InputError: parameters (1, -1) are degenerate: a z + b is zero at z = 1; take them all above 0
    """

    coefficients: tuple[float, ...]

    def __post_init__(self) -> None:
        largest = PDE_LIMITS.coefficient_ratio * abs(self.coefficients[0])
        if self.coefficients[0] and not np.abs(self.coefficients).max() <= largest:
            raise InputError(
                f"parameters ({', '.join(f'{c:.6g}' for c in self.coefficients)}) have an a that is nothing beside the "
                f"others: take one above {1 / PDE_LIMITS.coefficient_ratio:g} of them"
            )
        root = self._find_symbol_root()
        if root is not None:
            symbol = " + ".join(
                name + ("", " z", " z^2", " z^3")[self.half - i]
                for i, name in enumerate(COEFFICIENT_NAMES[: self.half + 1])
            )
            raise InputError(
                f"parameters ({', '.join(f'{c:.6g}' for c in self.coefficients)}) are degenerate: {symbol} is zero at "
                f"z = {root:.4g}; take them all above 0"
            )

    @classmethod
    def from_laplacian(cls, order: int, scale: float) -> Equation:
        r"""Return the power n/2 of Laplace's operator :math:`\partial_v^2 + s^2 \partial_w^2`, of order n."""
        half = order // 2
        return cls(tuple(comb(half, i) * scale ** (2 * i) for i in range(half + 1)))

    @property
    def normalised_coefficients(self) -> Array:
        """The coefficients over a, (n/2 + 1,)."""
        return np.array(self.coefficients) / self.coefficients[0]

    @property
    def half(self) -> int:
        """Number of conditions on each rail, n/2."""
        return len(self.coefficients) - 1

    @property
    def largest_exponent(self) -> float:
        r"""Largest \|rho\| of the solutions :math:`e^{\rho v + i w}`."""
        squares = np.roots([c * (-1) ** i for i, c in enumerate(self.normalised_coefficients)])
        return float(np.sqrt(np.abs(squares).max()))

    def list_forms(self, minimise: Minimise, w: Array) -> list[list[DerivativeTerm]]:
        """Return the equation, or the forms of its energy: :meth:`split_into_squares`."""
        ones = np.ones_like(w)
        if minimise == "residual":
            orders, rows = (self.order, 2), [self.normalised_coefficients]
        else:
            orders, rows = (self.half, 1), list(self.split_into_squares())
        highest, step = orders
        forms = [
            [DerivativeTerm(c * ones, highest - step * i, step * i) for i, c in enumerate(row.tolist()) if c]
            for row in rows
        ]
        return [form for form in forms if form]

    def split_into_squares(self) -> Array:
        r"""Return forms (m, n/2 + 1) of degree n/2 in the derivatives, whose squares add up to the symbol.

        Form f stands for :math:`\sum_i f_i \partial_v^{n/2 - i} \partial_w^i`. The integral of the sum of their squares
        is the energy whose minimum, among all functions with the same boundary data, solves the equation.
        """
        c = self.normalised_coefficients
        if (c >= 0).all():
            return np.asarray(np.diag(np.sqrt(c)))
        # z^2 + b z + c = (z - g)^2 + (b + 2 g) z, with g^2 = c; a cubic has a factor z + r besides
        if self.half == 2:
            g = np.sqrt(c[2])
            return np.array([[1.0, 0.0, -g], [0.0, np.sqrt(c[1] + 2 * g), 0.0]])
        roots = np.roots(c)
        r = -float(roots[np.abs(roots.imag).argmin()].real)
        pair = roots[np.argsort(np.abs(roots.imag))[1:]]
        g, b = float(np.sqrt(np.prod(pair).real)), -float(pair.sum().real)
        h, s = np.sqrt(b + 2 * g), np.sqrt(r)
        return np.array([[1.0, 0.0, -g, 0.0], [0.0, s, 0.0, -s * g], [0.0, h, 0.0, 0.0], [0.0, 0.0, s * h, 0.0]])

    def _find_symbol_root(self) -> float | None:
        """Return a z >= 0 (infinite for a = 0) at which the symbol vanishes, None if there is none."""
        if self.coefficients[0] == 0:
            return np.inf
        with np.errstate(over="ignore"):
            c = self.normalised_coefficients
        extrema = np.roots(np.polyder(c))
        real = extrema[np.abs(extrema.imag) <= PDE_TOLERANCES.real_extremum * np.abs(extrema)].real
        z = np.concatenate([[0.0], real])
        z = z[z >= 0]
        zeros = z[np.polyval(c, z) <= PDE_TOLERANCES.degenerate_symbol * np.polyval(np.abs(c), z)]
        if not len(zeros):
            return None
        roots = np.roots(c)
        real = roots[(roots.real >= 0) & (np.abs(roots.imag) <= PDE_TOLERANCES.real_root * np.abs(roots))].real
        return float(real.min()) if len(real) else float(zeros[0])


def make_equations(
    order: tuple[int, int, int], parameters: ShapeParameters, scale: float
) -> tuple[Equation, Equation, Equation]:
    """Return the equations of x, y and z.

    Parameters
    ----------
    order
        Order of each.
    parameters
        The coefficients of all three, or a sequence of three such sequences; or a number s, for the powers of
        Laplace's operator with that factor on the derivative along; None for s = ``scale``.
    scale
        The factor on the derivative along with which v and w both count in lengths.

    Raises
    ------
    InputError
        If the parameters are no finite numbers, not as many as the order takes, or degenerate.
    """
    if parameters is None or isinstance(parameters, Real):
        s = scale if parameters is None else check_number("each of the parameters", parameters)
        if not 0 < s <= PDE_LIMITS.coefficient_ratio:
            raise InputError(
                f"parameters must be above 0 if they are one number, and at most {PDE_LIMITS.coefficient_ratio:g}, not "
                f"{s:g}"
            )
        first, second, third = (Equation.from_laplacian(n, s) for n in order)
        return first, second, third
    if not isinstance(parameters, list | tuple | np.ndarray):
        raise InputError(
            f'parameters must be numbers (a, b, ..), or three times that, or "local", not {shown(parameters)}'
        )
    rows = list(parameters)
    if not any(isinstance(row, list | tuple | np.ndarray) for row in rows):
        rows = [rows] * 3
    if len(rows) != 3 or not all(isinstance(row, list | tuple | np.ndarray) for row in rows):
        raise InputError(f"parameters must be numbers (a, b, ..), or three times that, not {shown(parameters)}")
    equations = []
    for name, row, n in zip("xyz", rows, order, strict=True):
        if len(row) != n // 2 + 1:
            raise InputError(
                f"an equation of order {n} has {n // 2 + 1} parameters, "
                f"{', '.join(COEFFICIENT_NAMES[: n // 2 + 1])}; there are {len(row)} for {name}"
            )
        equations.append(Equation(tuple(check_number("each of the parameters", value) for value in row)))
    return equations[0], equations[1], equations[2]
