"""Checks of the sizes that a caller gives as functions: values, jumps and corners; what is one number becomes it."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from cqblend.argument_checks import call_user_function, check_positive, to_float_array
from cqblend.errors import InputError
from cqblend.sizes.size_functions import FloatArray, Linear, Table
from cqblend.sizes.size_law import LawFunction, SizeLaw, make_corner_error
from cqblend.sizes.tolerances import LAW_TOLERANCES


def check_law(name: str, law: Any) -> float | SizeLaw:
    """Return a law of the caller's, checked; the number that it is at every t, if it is one.

    Parameters
    ----------
    name
        The caller's name for it.
    law
        A function of t in [0, 1]: of arrays, or of single numbers.

    Raises
    ------
    InputError
        It raises, does not return numbers, or they are not finite, not above 0 in between, jump, or have a corner.
    """
    function = _vectorise_function(name, law)
    tolerances = LAW_TOLERANCES
    even = np.linspace(0.0, 1.0, tolerances.samples + 1)
    golden = np.modf(np.arange(1.0, tolerances.irregular_samples + 1) * (np.sqrt(5) - 1) / 2)[0]
    t = np.unique(np.concatenate([even, golden]))
    sizes = function(t)
    if (sizes == sizes[0]).all():
        return check_positive(name, float(sizes[0]))
    _check_values(name, t, sizes)
    _check_jumps(name, function, t, sizes)
    corners: tuple[float, ...] = ()
    if isinstance(law, Linear):
        measure_slope = law.measure_slope
    elif isinstance(law, Table):
        measure_slope, corners = law.measure_slope, law.t[1:-1]
    else:
        _check_corners(name, function, even)
        measure_slope = partial(_estimate_slope, function)
    return SizeLaw(name, law if isinstance(law, Linear | Table) else function, measure_slope, corners)


def _vectorise_function(name: str, law: Callable[..., Any]) -> LawFunction:
    """Return a function of the caller's as one of arrays (n,): itself if it takes them, else value by value."""
    rule = f"{name} is a function of t, from 0 to 1, that returns sizes in mm"

    def call_with_array(t: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            found = to_float_array(f"{rule}: what it returns", call_user_function(rule, law, t.copy())).squeeze()
        if found.shape not in ((), t.shape):
            raise InputError(f"{rule}, not {found.shape} of them for {t.shape}")
        return np.asarray(np.broadcast_to(found, t.shape))

    def call_with_values(t: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            found = [
                to_float_array(f"{rule}: what it returns", call_user_function(rule, law, one)) for one in t.tolist()
            ]
        if any(one.size != 1 for one in found):
            raise InputError(f"{rule}: of one t, it must return one number")
        return np.array([float(one.item()) for one in found])

    t = np.array([0.0, 0.3, 0.5, 0.7, 1.0])
    try:
        together = call_with_array(t)
    except InputError:
        call_with_values(t)
        return call_with_values
    try:
        one_by_one = call_with_values(t)
    except InputError:
        return call_with_array
    same = np.isclose(together, one_by_one, rtol=LAW_TOLERANCES.same_size, atol=0.0, equal_nan=True)
    return call_with_array if same.all() else call_with_values


def _check_values(name: str, t: FloatArray, sizes: FloatArray) -> None:
    """Raise InputError where a size is not finite, or not above 0; at both ends, it may be 0."""
    if not np.isfinite(sizes).all():
        worst = int(np.argmin(np.isfinite(sizes)))
        raise InputError(f"{name} is {sizes[worst]:g} at t = {t[worst]:.4g}: it must be finite")
    vanishing = LAW_TOLERANCES.same_size * sizes.max()
    least = np.where((t == 0) | (t == 1), -vanishing, vanishing)
    if not (sizes > least).all():
        worst = int(np.argmin(sizes - least))
        raise InputError(
            f"{name} is {sizes[worst]:.4g} at t = {t[worst]:.4g}: it must be above 0, and may be 0 only at an end"
        )


def _check_jumps(name: str, function: LawFunction, t: FloatArray, sizes: FloatArray) -> None:
    """Raise InputError where the sizes jump: where halves of an interval go on to differ by as much."""
    least = LAW_TOLERANCES.least_jump * sizes.max()
    low, high, at_low, at_high = t[:-1], t[1:], sizes[:-1], sizes[1:]
    for _ in range(LAW_TOLERANCES.jump_halvings):
        open_ = np.abs(at_high - at_low) > least
        low, high, at_low, at_high = (one[open_] for one in (low, high, at_low, at_high))
        if not len(low):
            return
        middle = (low + high) / 2
        at_middle = function(middle)
        if not np.isfinite(at_middle).all():
            place = middle[int(np.argmin(np.isfinite(at_middle)))]
            raise InputError(f"{name} is not finite at t = {place:.6g}")
        is_left = np.abs(at_middle - at_low) > np.abs(at_high - at_middle)
        low, high = np.where(is_left, low, middle), np.where(is_left, middle, high)
        at_low, at_high = np.where(is_left, at_low, at_middle), np.where(is_left, at_middle, at_high)
    worst = int(np.abs(at_high - at_low).argmax())
    if abs(at_high[worst] - at_low[worst]) > least:
        raise InputError(
            f"{name} jumps from {at_low[worst]:.6g} to {at_high[worst]:.6g} mm at t = {low[worst]:.4g}: it must be "
            "continuous"
        )


def _check_corners(name: str, function: LawFunction, t: FloatArray) -> None:
    """Raise InputError where the slope of the sizes jumps: where it changes by as much in ever shorter parts."""
    low, high = t[:-2], t[2:]
    steepest = np.abs(np.diff(function(t))).max() * LAW_TOLERANCES.samples
    for _ in range(LAW_TOLERANCES.kink_halvings):
        width = high - low
        values = function((low + np.linspace(0, 1, 5)[:, None] * width).ravel()).reshape(5, -1)
        slopes = np.diff(values, axis=0) / (width / 4)
        steepest = max(steepest, float(np.abs(slopes).max()))
        change = np.abs(np.diff(slopes, axis=0))  # (3, n): about each quarter point
        where, largest = change.argmax(axis=0), change.max(axis=0)
        kept = largest > LAW_TOLERANCES.least_kink * steepest
        low, width, where, slopes, largest = low[kept], width[kept], where[kept], slopes[:, kept], largest[kept]
        if not len(low):
            return
        low, high = low + where * width / 4, low + (where + 2) * width / 4
    worst = int(largest.argmax())
    place = float((low[worst] + high[worst]) / 2)
    raise make_corner_error(name, place, slopes[0, worst], slopes[-1, worst])


def _estimate_slope(function: LawFunction, end: float) -> float:
    """Return the derivative at t = 0 or t = 1 by one-sided differences of fourth order."""
    step = LAW_TOLERANCES.slope_step * (1 if end == 0 else -1)
    weights = np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) / 12
    return float(weights @ function(end + step * np.arange(5)) / step)
