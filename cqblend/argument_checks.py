"""Validators of what a caller gives: each returns the value in one form, or raises InputError with the caller's name.

They exist in one place so that a wrong argument is refused in the same words wherever it is given. Depends on NumPy and
`cqblend.errors` only. NumPy is imported by the functions that need it, because ``import cqblend`` loads this module and
must not load NumPy.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from numbers import Integral, Rational, Real
from typing import TYPE_CHECKING, Any, TypeVar

from cqblend.errors import InputError, UnsupportedError, reason, shown

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

ChosenT = TypeVar("ChosenT", bound=str)
CheckedT = TypeVar("CheckedT")
CallbackT = TypeVar("CallbackT", bound=Callable[..., object])

MIN_STOCK_LENGTH = 1e-9
"""Smallest length that is accepted on flat stock, mm: about the size of an atom."""

MAX_STOCK_LENGTH = 1e6
"""Largest length that is accepted on flat stock, mm: a kilometre."""


# -- single numbers


def _to_float(value: object) -> float | None:
    """Return a real number as a float, infinite beyond the range of doubles; None for anything else and for a bool."""
    if isinstance(value, bool) or not isinstance(value, Real):
        return None
    try:
        return float(value)
    except OverflowError:
        return math.inf


def check_number(name: str, value: object) -> float:
    """Return a finite number as a float. A bool is no number.

    Raises
    ------
    InputError
        If it is none.
    """
    number = _to_float(value)
    if number is None or not math.isfinite(number):
        raise InputError(f"{name} must be a finite number, not {shown(value)}")
    return number


def check_positive(name: str, value: object, *, zero: bool = False) -> float:
    """Return a finite number above 0 (or 0, if `zero` allows it) as a float. A bool is no number.

    Raises
    ------
    InputError
        If it is anything else.
    """
    number = _to_float(value)
    if number is None:
        raise InputError(f"{name} must be a number, not {shown(value)}")
    if number == math.inf and isinstance(value, Rational):
        raise InputError(f"{name} must be finite, not a number of more than 308 digits")
    if not math.isfinite(number):
        raise InputError(f"{name} must be finite, not {number}")
    if number < 0 or (number == 0 and not zero):
        raise InputError(f"{name} must {'not be below' if zero else 'be above'} 0, not {number:g}")
    return number


def check_angle(name: str, value: object) -> float:
    """Return an angle from 0 to pi/2, rad.

    Raises
    ------
    InputError
        If it is anything else.
    """
    angle = check_positive(name, value, zero=True)
    if angle > math.pi / 2:
        raise InputError(f"{name} is an angle in radians, at most pi/2, not {angle:g}; math.radians converts degrees")
    return angle


def check_millimetres(name: str, value: object, *, zero: bool = False) -> float:
    """Return a length on flat stock as a float: `MIN_STOCK_LENGTH` to `MAX_STOCK_LENGTH`, or 0 if `zero` allows it.

    Raises
    ------
    InputError
        If it is anything else. A bool is no length.

    Examples
    --------
    >>> check_millimetres("the width of a tab", 5)
    5.0
    """
    number = _to_float(value)
    if number is not None:
        if MIN_STOCK_LENGTH <= number <= MAX_STOCK_LENGTH or (zero and number == 0):
            return number
        if math.isfinite(number) and number > 0:
            raise InputError(
                f"{name} is a positive number of mm, from {MIN_STOCK_LENGTH:g} to {MAX_STOCK_LENGTH:g}, not "
                f"{shown(value)}"
            )
    raise InputError(f"{name} is {'0 or ' if zero else ''}a positive number of mm, not {shown(value)}")


def check_integer(name: str, value: object, least: int, most: int) -> int:
    """Return a whole number from `least` to `most`. A bool is none.

    Raises
    ------
    InputError
        If it is none.
    """
    if type(value) is int and least <= value <= most:
        return value  # what most calls give, without asking what else is a whole number
    found = None if isinstance(value, bool) or not isinstance(value, Integral) else int(value)
    if found is None or not least <= found <= most:
        what = " negative," if found is not None and found < 0 <= least else ""
        raise InputError(f"{name} must be a whole number from {least} to {most}, not{what} {shown(value)}")
    return found


def check_count(name: str, value: object, most: int | None = None) -> int:
    """Return a whole number above 0, at most `most` where that is given. A bool is none.

    Raises
    ------
    InputError
        If it is none.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or value < 1:
        raise InputError(f"{name} must be a whole number above 0, not {shown(value)}")
    number = int(value)
    if most is not None and number > most:
        raise InputError(f"{name} must be at most {most}, not {shown(number)}")
    return number


def check_count_or_auto(name: str, value: object, most: int) -> int | None:
    """Return a whole number above 0, at most `most`; None for "auto".

    Raises
    ------
    InputError
        If it is neither.
    """
    return None if is_auto(value) else check_count(name, value, most)


# -- pairs of values


def unpack_pair(name: str, value: object) -> tuple[object, object]:
    """Return the two items of a list, a tuple or an array of two.

    Raises
    ------
    InputError
        If it is anything else.
    """
    import numpy as np

    if not isinstance(value, list | tuple | np.ndarray) or getattr(value, "ndim", 1) == 0 or len(value) != 2:
        raise InputError(f"{name} must be a pair, not {shown(value)}")
    return value[0], value[1]


def check_interval(name: str, value: object) -> tuple[float, float]:
    """Return two finite numbers, the lower one first.

    Raises
    ------
    InputError
        If they are none.
    """
    low, high = (check_number(name, end) for end in unpack_pair(name, value))
    if not low < high:
        raise InputError(f"{name}={shown(value)}: not an interval, lower end first; it is empty")
    return low, high


def check_pair(
    name: str, value: object, check: Callable[[str, object], CheckedT], each: str = "side"
) -> tuple[CheckedT, CheckedT]:
    """Return two checked values, from a pair or from one value that holds for both.

    Parameters
    ----------
    name
        The caller's name for it.
    value
        A tuple or list of two, or anything else, which is one value.
    check
        Validator of one value.
    each
        What each of the two values is for, for the message.

    Raises
    ------
    InputError
        If it is a tuple or list of another length, or as `check`.
    """
    if not isinstance(value, tuple | list):
        checked = check(name, value)
        return checked, checked
    if len(value) != 2:
        raise InputError(f"{name} must be one value or a pair, one for each {each}, not {len(value)} values")
    return check(f"{name}[0]", value[0]), check(f"{name}[1]", value[1])


# -- arrays


def to_float_array(name: str, values: object) -> NDArray[Any]:
    """Copy to a float64 array.

    Raises
    ------
    InputError
        If that is not possible: texts are no numbers, and neither is an object whose conversion raises.
    """
    import numpy as np

    try:
        array = np.array(values)
        if array.dtype.kind in "biufO":
            return array.astype(np.float64, copy=False)
    except Exception as error:
        raise InputError(f"{name} must be an array of numbers: {reason(error)}") from error
    raise InputError(f"{name} must be an array of numbers, not {shown(values)}")


def to_finite_array(name: str, values: object) -> NDArray[Any]:
    """Return finite numbers as a float64 array, the same one if it is one already.

    Raises
    ------
    InputError
        If one is not finite, or as :func:`to_float_array`.
    """
    import numpy as np

    array = values if isinstance(values, np.ndarray) and values.dtype == np.float64 else to_float_array(name, values)
    if not np.isfinite(array).all():
        raise InputError(f"{name} must be finite, not {array[~np.isfinite(array)].flat[0]}")
    return array


def to_point(value: object) -> NDArray[np.float64] | None:
    """Return three finite numbers as an array (3,); None if the value is something else."""
    import numpy as np

    try:
        found = to_float_array("a point", value)
    except InputError:
        return None
    return found if found.shape == (3,) and np.isfinite(found).all() else None


# -- words and flags


def check_choice(name: str, value: object, built: tuple[ChosenT, ...], later: tuple[str, ...] = ()) -> ChosenT:
    """Return the one of several words that `value` is.

    Parameters
    ----------
    name, value
        The caller's name for it, and what is given.
    built
        The words that are accepted.
    later
        Words that belong to the interface, but whose meaning is not implemented.

    Raises
    ------
    UnsupportedError
        If it is one of `later`.
    InputError
        If it is anything else.
    """
    for option in built:
        if isinstance(value, str) and value == option:
            return option
    choices = " or ".join(map(repr, built))
    if isinstance(value, str) and value in later:
        raise UnsupportedError(f"{name}={value!r} is not built yet; use {choices}")
    raise InputError(f"{name} must be {choices}, not {shown(value)}")


def check_flag(name: str, value: object) -> bool:
    """Return a value that is True or False.

    Raises
    ------
    InputError
        If it is anything else.
    """
    if not isinstance(value, bool):
        raise InputError(f"{name} must be True or False, not {shown(value)}")
    return value


def is_auto(value: object) -> bool:
    """Whether a value is the word "auto"."""
    return is_default(value, "auto")


# -- options that have no effect


def is_default(value: object, default: object) -> bool:
    """Whether an option has its default value. Only texts, numbers and None are compared, never the caller's objects.

    Examples
    --------
    >>> is_default(1, 1.0), is_default(None, "auto"), is_default((1.0, 1.0), 1.0)
    (True, False, False)
    """
    known = str | int | float | None
    return isinstance(value, known) and isinstance(value, bool) == isinstance(default, bool) and value == default


def refuse_ignored_options(why: str, **options: tuple[object, object]) -> None:
    """Refuse options that have no effect in a combination.

    Parameters
    ----------
    why
        Completes "an option has no effect ..".
    **options
        The value and the default of each.

    Raises
    ------
    InputError
        If one is not at its default.
    """
    for name, (value, default) in options.items():
        if not is_default(value, default):
            raise InputError(f"{name} has no effect {why}: leave {name} out")


# -- functions


def check_callback(name: str, value: CallbackT | None, takes: str) -> CallbackT | None:
    """Return a function to be called, or None; `takes` names its arguments, for the message.

    Raises
    ------
    InputError
        If it is something that cannot be called.
    """
    if value is not None and not callable(value):
        raise InputError(f"{name} is called with {takes}; {shown(value)} cannot be")
    return value


def call_user_function(rule: str, function: Callable[..., Any], *arguments: Any) -> Any:
    """Return the result of a function of the caller's; `rule` says what it should take and return.

    Raises
    ------
    InputError
        If the function raises; that is the cause.
    """
    try:
        return function(*arguments)
    except Exception as error:
        raise InputError(f"{rule}: {reason(error)}") from error
