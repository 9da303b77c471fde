"""Arrays of tensor-product pieces: their checks, kernels along one parameter, common degrees, united breaks.

A coefficient array of n parameters has n degree axes first, then the components, then n axes of pieces. Depends on the
arithmetic on Bernstein coefficients only.
"""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from cqblend.argument_checks import to_float_array
from cqblend.errors import InputError, shown
from cqblend.splines import bernstein
from cqblend.splines.bernstein import EPSILON, Array
from cqblend.splines.knots import SMOOTH


def check_pieces(
    name: str, breaks: Sequence[ArrayLike], coefs: ArrayLike, *, rational: bool
) -> tuple[tuple[Array, ...], Array]:
    """Return breaks, one array for each parameter, and coefficients as arrays that fit each other.

    Raises
    ------
    InputError
        If they do not, if breaks do not increase, or a number is not finite.
    """
    count = len(breaks)
    arrays = tuple(to_float_array(f"{name}: breaks", b) for b in breaks)
    values = to_float_array(f"{name}: coefficients", coefs)
    for b in arrays:
        # numbers that increase from a finite one to a finite one are finite
        has_ends = b.ndim == 1 and len(b) >= 2 and math.isfinite(b[0]) and math.isfinite(b[-1])
        if not has_ends or not (b[1:] > b[:-1]).all():
            raise InputError(
                f"{name}: breaks must be at least two finite, strictly increasing numbers, not {shown(b.tolist())}"
            )
    if values.ndim != 2 * count + 1:
        raise InputError(f"{name}: coefficients have {values.ndim} axes, expected {2 * count + 1}")
    expected = tuple(len(b) - 1 for b in arrays)
    if values.shape[count + 1 :] != expected:
        raise InputError(f"{name}: coefficients for {values.shape[count + 1 :]} pieces, breaks for {expected}")
    if min(values.shape) < 1 or values.shape[count] < 1 + rational:
        raise InputError(f"{name}: coefficients of shape {values.shape} leave no component")
    if not np.isfinite(values).all():
        raise InputError(f"{name}: a coefficient is not a finite number")
    return arrays, values


def check_continuity(name: str, continuity: ArrayLike, break_count: int) -> Array:
    """Return the orders of continuity at interior breaks, (break_count - 2,), whole numbers from -1 to `SMOOTH`.

    Raises
    ------
    InputError
        If they are none, or not one for each interior break.
    """
    order: Array
    if isinstance(continuity, np.ndarray) and continuity.dtype.kind == "i":
        order = continuity
    else:
        order = to_float_array(f"{name}: continuity", continuity)
        if not np.isfinite(order).all() or (order != np.floor(order)).any():
            raise InputError(f"{name}: continuity must be whole numbers, not {shown(order.tolist())}")
    if order.shape != (break_count - 2,):
        raise InputError(f"{name}: continuity of shape {order.shape}, expected {(break_count - 2,)}")
    return np.minimum(np.maximum(order, -1), SMOOTH).astype(int)


def apply_along_axis(kernel: Callable[[Array], Array], coefs: Array, axis: int, parameter_count: int) -> Array:
    """Apply a kernel of (p+1, .., n) arrays to parameter `axis` of an array with `parameter_count` parameters."""
    if parameter_count == 1:
        return kernel(coefs)
    here, there = ((3, 4), (0, 1))[axis]
    return kernel(coefs.swapaxes(here, there)).swapaxes(here, there)


def restrict_ends(coefs: Array, x0: float, x1: float) -> Array:
    """Restrict pieces (p+1, .., n), in place, so that they start at x0 in the first and end at x1 in the last."""
    if coefs.shape[-1] == 1:
        return bernstein.restrict_pieces(coefs, x0, x1)
    if x0 > 0:
        coefs[..., 0] = bernstein.restrict_pieces(coefs[..., 0], x0, 1.0)
    if x1 < 1:
        coefs[..., -1] = bernstein.restrict_pieces(coefs[..., -1], 0.0, x1)
    return coefs


def unite_breaks(first: Array, second: Array) -> Array:
    """Unite two sets of breaks; breaks of the second within rounding of one of the first are dropped."""
    nearest = np.abs(second[:, None] - first).min(axis=1)
    tolerance = 4 * EPSILON * max(abs(first[0]), abs(first[-1]))
    return np.sort(np.concatenate([first, second[nearest > tolerance]]))


def replace_item(items: tuple[Array, ...], axis: int, item: Array) -> tuple[Array, ...]:
    """Return the items, one for each parameter, with that of parameter `axis` replaced."""
    return (*items[:axis], item, *items[axis + 1 :])


def elevate_to(coefs: Array, degrees: Sequence[int]) -> Array:
    """Raise every degree of a coefficient array to the given one."""
    for axis, degree in enumerate(degrees):
        amount = degree + 1 - coefs.shape[axis]
        if amount:
            coefs = apply_along_axis(lambda c, a=amount: bernstein.elevate_degree(c, a), coefs, axis, len(degrees))  # type: ignore[misc]
    return coefs


def match_degrees(a: Array, b: Array, parameter_count: int) -> tuple[Array, Array]:
    """Raise the degrees of two coefficient arrays to the larger ones of both."""
    degrees = [max(m, n) - 1 for m, n in zip(a.shape[:parameter_count], b.shape[:parameter_count], strict=True)]
    return elevate_to(a, degrees), elevate_to(b, degrees)


def detect_continuity(coefs: Array, axis: int, parameter_count: int) -> Array:
    """Return the order of continuity at breaks where none is known: 0 where pieces meet to rounding, else -1."""
    if coefs.shape[parameter_count + 1 + axis] == 1:
        return np.empty(0, dtype=int)
    lead = np.moveaxis(coefs, (axis, parameter_count + 1 + axis), (0, -1))
    jump = np.abs(lead[-1, ..., :-1] - lead[0, ..., 1:]).max(axis=tuple(range(lead.ndim - 2)))
    return np.where(jump <= 64 * EPSILON * np.abs(coefs).max(), 0, -1)
