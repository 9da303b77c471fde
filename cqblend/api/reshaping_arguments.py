"""What a caller gives to reshape a surface: amounts, a reference and its tuning, checked and in one form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from cqblend.argument_checks import check_choice, check_number, to_point
from cqblend.errors import InputError, shown
from cqblend.splines.bernstein import Array

DEFAULT_TUNING = (1.0, 1.0, 1.0)
"""Factors of the paper's rule for a reference point, for x, y and z."""


def group_amounts(given: Any, shape: tuple[int, ...]) -> tuple[tuple[Callable[[Array], Any], ...], Array]:
    """Return the distinct amounts as functions, and for each control point the index of its function."""
    if given is None or callable(given) or not isinstance(given, list | tuple | np.ndarray):
        return (_to_amount_function(given),), np.zeros(shape, dtype=int)
    rows = [list(row) if isinstance(row, list | tuple | np.ndarray) else [row] for row in given]
    if tuple(map(len, rows)) != (shape[1],) * shape[0]:
        raise InputError(
            f"amounts are one, or one for each of the {shape[0]} x {shape[1]} control points, in {shape[0]} rows, not "
            f"rows of {', '.join(map(str, map(len, rows)))}"
        )
    found: dict[Any, int] = {}
    functions: list[Callable[[Array], Any]] = []
    groups = np.empty(shape, dtype=int)
    for i, row in enumerate(rows):
        for j, one in enumerate(row):
            function = _to_amount_function(one)
            key = one if one is None or callable(one) else float(one)
            if key not in found:
                found[key] = len(functions)
                functions.append(function)
            groups[i, j] = found[key]
    return tuple(functions), groups


def _to_amount_function(given: Any) -> Callable[[Array], Any]:
    if given is None:
        return np.positive
    if callable(given):
        return given
    factor = check_number("amounts", given)
    return lambda s: factor * s


def check_tuning(given: object, *, has_effect: bool) -> tuple[float, ...]:
    """Return the three factors of the paper's rule; factors other than 1 are refused where they have no effect."""
    if not isinstance(given, list | tuple | np.ndarray) or getattr(given, "ndim", 1) == 0 or len(given) != 3:
        raise InputError(f"tuning is three numbers, not {shown(given)}")
    factors = tuple(check_number("tuning", one) for one in given)
    if not has_effect and factors != DEFAULT_TUNING:
        raise InputError('tuning has no effect but on reference="extents": leave tuning out')
    return factors


def resolve_reference(given: Any, tuning: Sequence[float], poles: Array) -> Array | Callable[[Array], Any]:
    """Return a reference point (3,), or the caller's function that returns points, by a rule or as given."""
    if callable(given):
        return given
    if isinstance(given, str):
        rule = check_choice("reference", given, ("centroid", "extents"))
        if rule == "extents":
            return np.asarray(np.array(tuning) * np.ptp(poles, axis=(0, 1)) / 2)
        return np.asarray(poles.mean(axis=(0, 1)))
    point = to_point(given)
    if point is None:
        raise InputError(f'a reference is "centroid", "extents", a point or a function of s, not {shown(given)}')
    return point
