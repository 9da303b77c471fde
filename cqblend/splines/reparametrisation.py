"""The same curve at another speed: composition with a change of parameter, and changes that have given end speeds.

A change of parameter t(r) is allowable if it runs once through the curve's domain, without turning back. That is proven
from the coefficients of t', not sampled. Depends on curves only.

References
----------
K. Kim, G. Elber: A symbolic approach to freeform parametric surface blends, section 2.1.1 and figure 1.
"""

import numpy as np

from cqblend.argument_checks import check_interval, check_number
from cqblend.errors import GeometryError, InputError, shown
from cqblend.splines.bernstein import EPSILON, Array
from cqblend.splines.coefficient_bounds import find_value_below
from cqblend.splines.curve import Curve
from cqblend.splines.tolerances import SPLINE_TOLERANCES

Interval = tuple[float, float]


def reparameterise(curve: Curve, change: Curve) -> Curve:
    """Compose a curve with a change of parameter: C(t(r)), which passes through the same points in the same order.

    Parameters
    ----------
    curve
        C, of any dim.
    change
        t(r), a continuous curve of dim 1, polynomial or rational, that runs from the start of the domain of C to its
        end and never decreases. Its derivative may be zero.

    Returns
    -------
    Curve
        Over the domain of the change, of the product of both degrees; rational if either is.

    Raises
    ------
    InputError
        If the change is not of dim 1, jumps, does not run from end to end, or has a weight that is not positive.
    GeometryError
        If the change decreases somewhere; the message says at which r.

    References
    ----------
    Kim and Elber, section 2.1.1.

    Examples
    --------
    >>> line = Curve.bezier([[0.0, 0.0], [4.0, 2.0]])
    >>> reparameterise(line, change_of_parameter(0, 1))([0.0, 0.5, 1.0])
    array([[0.  , 0.  ],
           [1.5 , 0.75],
           [4.  , 2.  ]])
    """
    for name, value in (("curve", curve), ("change of parameter", change)):
        if not isinstance(value, Curve):
            raise InputError(f"a {name} is a Curve, not {shown(value)}")
    if change.dim != 1:
        raise InputError(f"a change of parameter has dim 1, not {change.dim}")
    jump = change.continuity < 0
    if jump.any():
        raise InputError(f"the change of parameter jumps at r = {change.breaks[1:-1][jump][0]:.9g}")
    _, weight = change._split_weight()
    if weight is not None:
        weightless = find_value_below(weight[:, 0], SPLINE_TOLERANCES.least_weight * float(np.abs(weight).max()))
        if weightless is not None:
            raise InputError(
                f"the change of parameter has no positive weight at r = {_locate_parameter(change, weightless):.9g}"
            )
    start, end = curve.domain
    first, last = float(change(change.domain[0]).item()), float(change(change.domain[1], side="left").item())
    slack = 16 * EPSILON * max(abs(start), abs(end))
    if abs(first - start) > slack or abs(last - end) > slack:
        raise InputError(
            f"the change of parameter runs from {first:.17g} at r = {change.domain[0]:.9g} to {last:.17g} at "
            f"r = {change.domain[1]:.9g}, the domain of the curve is [{start:.17g}, {end:.17g}]"
        )
    rate, _ = change.derivative()._split_weight()
    back = find_value_below(rate[:, 0], -64 * EPSILON * float(np.abs(rate).max()))
    if back is not None:
        raise GeometryError(
            f"the change of parameter turns back at r = {_locate_parameter(change, back):.9g}: it must not decrease "
            "anywhere"
        )
    return curve.compose(change)


def change_of_parameter(
    start: float, end: float, *, domain: Interval = (0.0, 1.0), onto: Interval = (0.0, 1.0)
) -> Curve:
    r"""Change of parameter t(r) with given derivatives at its ends, increasing for all of them.

    Over unit intervals with slopes a and b, the cubic Hermite interpolant as long as a + b <= 3; its derivative has the
    coefficients a, 3 - a - b, b, and beyond that it would slow down to a halt on the way, or turn back. From there on

    .. math:: t(r) = \frac{r^2 + a\, r (1-r)}{1 + (a + b - 2)\, r (1-r)}

    which increases for all slopes, and makes the curve rational.

    Parameters
    ----------
    start, end
        dt/dr at the two ends, not negative; 0 for a motion that starts, or ends, at rest.
    domain
        Interval of r.
    onto
        Interval of t.

    Raises
    ------
    InputError
        If a slope is negative or not finite, or an interval is empty.

    References
    ----------
    J. A. Gregory, R. Delbourgo: Piecewise rational quadratic interpolation to monotonic data (1982).

    Examples
    --------
    >>> change_of_parameter(0, 0)([0.25, 0.5, 0.75]).ravel()
    array([0.15625, 0.5    , 0.84375])
    >>> change_of_parameter(100, 1)
    <rational Curve of degree 2, dim 1, 1 pieces on [0, 1]>
    """
    (first, last), (low, high) = check_interval("domain", domain), check_interval("onto", onto)
    start, end = _check_end_speed("start", start), _check_end_speed("end", end)
    mean = (high - low) / (last - first)
    a, b = start / mean, end / mean
    if a + b <= 3:
        poles = _to_column(low, low + (high - low) * a / 3, high - (high - low) * b / 3, high)
        return Curve.bezier(poles, None, (first, last))
    weights = np.array([1.0, (a + b) / 2, 1.0])
    return Curve.bezier(_to_column(low, low + (high - low) * a / (a + b), high), weights, (first, last))


def with_end_speeds(curve: Curve, start: float = 1.0, end: float = 1.0, *, domain: Interval | None = None) -> Curve:
    r"""Reparameterise a curve so that it leaves and arrives at given speeds.

    .. math:: \|C'(t(r))\| \; t'(r) = \text{speed}

    at both ends; in between the change of parameter is that of :func:`change_of_parameter`.

    Parameters
    ----------
    curve
        Of any dim; its derivative must not be zero at its ends.
    start, end
        Length of the derivative there, not negative, in units of length over units of the new parameter.
    domain
        Of the new parameter; the curve's own if None. A longer one leaves more time.

    Raises
    ------
    InputError
        If a speed is negative or not finite.
    GeometryError
        If the curve's derivative is zero at an end.

    References
    ----------
    Kim and Elber, section 2.1.1.

    Examples
    --------
    >>> arc = with_end_speeds(Curve.bezier([[0.0, 0.0], [3.0, 3.0], [5.0, 0.0]]))
    >>> np.linalg.norm(arc([0.0, 1.0], 1), axis=1)
    array([1., 1.])
    """
    if not isinstance(curve, Curve):
        raise InputError(f"a curve is a Curve, not {shown(curve)}")
    ends = curve.domain
    if domain is not None:
        domain = check_interval("domain", domain)
    start, end = _check_end_speed("start", start), _check_end_speed("end", end)
    slopes = []
    for name, t, speed in (("start", ends[0], start), ("end", ends[1], end)):
        present = float(np.linalg.norm(curve(t, 1, side="right" if name == "start" else "left")))
        if (
            present
            <= SPLINE_TOLERANCES.standing_speed * float(np.abs(curve(np.array(ends))).max()) / (ends[1] - ends[0])
            or present == 0
        ):
            raise GeometryError(f"the curve stands still at its {name}, t = {t:.9g}: no parameter gives it a speed")
        slopes.append(speed / present)
    return reparameterise(curve, change_of_parameter(*slopes, domain=domain or ends, onto=ends))


def _check_end_speed(name: str, value: object) -> float:
    """Return a derivative, or a speed, that is not negative."""
    try:
        rate = check_number(name, value)
    except InputError:
        rate = -1.0
    if rate < 0:
        raise InputError(f"{name}={shown(value)}: the slope of a change of parameter is a number that is not negative")
    return rate


def _to_column(*poles: float) -> Array:
    return np.array(poles)[:, None]


def _locate_parameter(change: Curve, place: tuple[int, float]) -> float:
    """Parameter of a place in a piece."""
    piece, x = place
    return float(change.breaks[piece] + x * (change.breaks[piece + 1] - change.breaks[piece]))
