"""An implicit surface f(x, y, z) = 0, which is reshaped to its level sets f = s: the potential method's own kind.

Lee, Bedi and Dubey blend it with a parametric surface ("hybrid design applications"). Function and gradient are the
caller's: what they return is checked, and the gradient is compared with differences of the function.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from cqblend.argument_checks import call_user_function, to_float_array
from cqblend.blends.potential.tolerances import POTENTIAL_TOLERANCES
from cqblend.errors import InputError, shown
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class ImplicitSurface:
    """The surface f(x, y, z) = 0, and its level sets f = s, as a partner of a potential blend.

    Parameters
    ----------
    function
        f: takes three arrays (n,), mm, and returns (n,). It is below 0 on the side of the material, and above where
        level sets go to; s is in its units, mm where f is a distance.
    gradient
        Its gradient: takes the same, and returns three arrays (n,), or (3, n).

    Raises
    ------
    InputError
        If one of them is no function.

    Examples
    --------
    >>> ball = ImplicitSurface(
    ...     lambda x, y, z: np.sqrt(x * x + y * y + z * z) - 5,
    ...     lambda x, y, z: np.stack([x, y, z]) / np.sqrt(x * x + y * y + z * z),
    ... )
    >>> float(ball.function(3.0, 0.0, 4.0)), ball.gradient(3.0, 0.0, 4.0).tolist()
    (0.0, [0.6, 0.0, 0.8])
    """

    function: Callable[[Array, Array, Array], Any]
    gradient: Callable[[Array, Array, Array], Any]

    def __post_init__(self) -> None:
        for name, given in (("function", self.function), ("gradient", self.gradient)):
            if not callable(given):
                raise InputError(f"the {name} of an implicit surface is a function of x, y and z, not {shown(given)}")


def evaluate_implicit(implicit: ImplicitSurface, points: Array) -> tuple[Array, Array]:
    """Return f (n,) and its gradient (n, 3) at points (n, 3).

    Raises
    ------
    InputError
        If a function raises, or does not return finite numbers of that shape.
    """
    gradient = _call("gradient", implicit.gradient, points, 3)
    return evaluate_function(implicit, points), gradient


def evaluate_function(implicit: ImplicitSurface, points: Array) -> Array:
    """Return f (n,) at points (n, 3)."""
    return _call("function", implicit.function, points, 1)[:, 0]


def check_gradient(implicit: ImplicitSurface, points: Array, size: float) -> None:
    """Check the gradient at points (n, 3) by central differences of the function, on a shape of a size (mm).

    Raises
    ------
    InputError
        If it is another one; the message says where.
    """
    step = POTENTIAL_TOLERANCES.gradient_step * size
    _, gradient = evaluate_implicit(implicit, points)
    sides = [[evaluate_function(implicit, points + side * move) for move in step * np.eye(3)] for side in (1, -1)]
    differences = (np.stack(sides[0], axis=1) - np.stack(sides[1], axis=1)) / (2 * step)
    largest = float(np.linalg.norm(gradient, axis=1).max())
    error = np.linalg.norm(gradient - differences, axis=1)
    i = int(error.argmax())
    if not error[i] <= POTENTIAL_TOLERANCES.gradient_error * max(largest, float(np.abs(differences).max())):
        place, given, found = (
            "(" + ", ".join(f"{x:.5g}" for x in row) + ")" for row in (points[i], gradient[i], differences[i])
        )
        raise InputError(
            f"the gradient of the implicit surface is {given} at {place}, but differences of its function are {found}"
        )


def _call(name: str, function: Callable[..., Any], points: Array, count: int) -> Array:
    """Return the values (n, count) of one of the two functions."""
    shape = "as many numbers" if count == 1 else "three arrays of as many numbers"
    rule = f"the {name} of an implicit surface takes arrays x, y and z, and returns {shape}"
    values = to_float_array(f"{rule}: what it returns", call_user_function(rule, function, *points.T.copy()))
    wanted = (len(points),) if count == 1 else (3, len(points))
    if values.shape != wanted:
        raise InputError(f"{rule}, not an array of shape {values.shape} for {len(points)} points")
    values = values.reshape(count, -1).T
    if not np.isfinite(values).all():
        i = int(np.isfinite(values).all(axis=1).argmin())
        raise InputError(f"the {name} of an implicit surface is not finite at {points[i].tolist()}")
    return np.asarray(values)
