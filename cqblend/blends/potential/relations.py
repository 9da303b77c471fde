r"""Relations tell how far two surfaces are reshaped together: curves (s1, s2)(x) from (a, 0) to (0, b).

Lee, Bedi and Dubey, eq. 2, after Hoffmann and Hopcroft: a conic that touches the axes at both ends,

.. math:: f(s_1, s_2) = b^2 s_1^2 + a^2 s_2^2 + a^2 b^2 - 2 a b^2 s_1 - 2 a^2 b s_2 + 2 \lambda s_1 s_2 = 0,

or any curve that does. Because it touches them, the blend is tangent to both surfaces: at x = 0 the second surface has
its own shape, and s2 has derivative 0. Depends on curves only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from cqblend.argument_checks import call_user_function, check_number, to_finite_array, to_float_array
from cqblend.blends.potential.tolerances import POTENTIAL_LIMITS, POTENTIAL_TOLERANCES
from cqblend.errors import CqblendError, InputError, shown
from cqblend.splines import Curve
from cqblend.splines.approximation import approximate_to_rounding
from cqblend.splines.bernstein import EPSILON, Array
from cqblend.splines.bracketing import bisect_intervals


@dataclass(frozen=True)
class Relation:
    """A curve (s1, s2)(x), x from 0 at (a, 0) to 1 at (0, b), that touches the axes at both ends.

    Parameters
    ----------
    curve
        Of dim 2, over [0, 1].

    Raises
    ------
    InputError
        It does not start on the first axis and along it, or does not end on the second one and along it, or stands
        still there.

    Examples
    --------
    >>> quarter = Conic(2, 3, 0)
    >>> quarter.a, quarter.b, quarter(0.5).round(6).tolist()
    (2.0, 3.0, [0.585786, 0.87868])
    """

    curve: Curve

    def __post_init__(self) -> None:
        if not isinstance(self.curve, Curve) or self.curve.dim != 2 or self.curve.domain != (0.0, 1.0):
            raise InputError(f"a relation is a Curve of dim 2 over [0, 1], not {shown(self.curve)}")
        (a, off1), (rate1, across1) = self.curve.jet(0.0, 1)
        (off2, b), (across2, rate2) = self.curve.jet(1.0, 1)
        size = max(abs(a), abs(b))
        if not a > 0 or not b > 0:
            raise InputError(f"a relation runs from (a, 0) to (0, b), both above 0, not from a = {a:g} to b = {b:g}")
        if max(abs(off1), abs(off2)) > POTENTIAL_TOLERANCES.axis_gap * size:
            raise InputError(
                f"a relation runs from (a, 0) to (0, b), not from ({a:g}, {off1:g}) to ({off2:g}, {b:g}): it must end "
                "on the axes"
            )
        if max(abs(across1), abs(across2)) > POTENTIAL_TOLERANCES.axis_slope * max(size, abs(rate1), abs(rate2)):
            raise InputError(
                f"the relation leaves its axes with slopes ds2/dx = {across1:.3g} at x = 0 and ds1/dx = {across2:.3g} "
                "at x = 1: they must be 0, or the blend is not tangent to its surfaces"
            )
        if not rate1 < 0 or not rate2 > 0:
            raise InputError(
                f"the relation must set out from (a, 0) towards 0 and arrive at (0, b) from below, not with ds1/dx = "
                f"{rate1:.3g} and ds2/dx = {rate2:.3g}"
            )

    @property
    def a(self) -> float:
        """The s1 at x = 0, where the blend meets the second surface: the largest, if the relation is monotone."""
        return float(self.curve(0.0)[0])

    @property
    def b(self) -> float:
        """The s2 at x = 1, where the blend meets the first surface: the largest, if the relation is monotone."""
        return float(self.curve(1.0)[1])

    def __call__(self, x: ArrayLike) -> Array:
        """Return (s1, s2) at x, (..., 2).

        Raises
        ------
        InputError
            An x is not between 0 and 1, where the relation ends.
        """
        x = to_finite_array("x", x)
        if x.size and not (x.min() >= 0 and x.max() <= 1):
            raise InputError(f"a relation runs over x from 0 to 1, not to {x.flat[np.abs(x - 0.5).argmax()]:.6g}")
        return self.curve(x)

    @cached_property
    def eased(self) -> Curve:
        r"""The curve reparametrised by x(y) = k y + (1 - k) (3 y^2 - 2 y^3), which limits its speed at both ends.

        The factor k is 1 where the speed is at most twice a, or b, and reduces it to that else. Cross derivatives at
        the rails are proportional to that speed: so they are about as long as the blend is wide, however sharp the
        relation is.
        """
        rate1, rate2 = self.curve(0.0, 1)[0], self.curve(1.0, 1)[1]
        k = min(1.0, 2 * self.a / abs(rate1), 2 * self.b / abs(rate2))
        return (
            self.curve if k == 1.0 else self.curve.compose(Curve.bezier(np.array([[0.0], [k / 3], [1 - k / 3], [1.0]])))
        )

    def first(self, s2: ArrayLike) -> Array:
        """Return the s1 that belongs to s2: where several do, the one nearest to x = 0.

        Raises
        ------
        InputError
            None does.
        """
        return self._solve_other_amount(0, s2)

    def second(self, s1: ArrayLike) -> Array:
        """Return the s2 that belongs to s1: where several do, the one nearest to x = 0.

        Raises
        ------
        InputError
            None does.
        """
        return self._solve_other_amount(1, s1)

    def _solve_other_amount(self, wanted: Literal[0, 1], given: ArrayLike) -> Array:
        values = to_finite_array(f"s{2 - wanted}", given)
        s = values.ravel()
        x = np.linspace(0, 1, POTENTIAL_LIMITS.root_samples)
        excess = self.curve(x)[:, 1 - wanted] - s[:, None]
        noise = 4 * EPSILON * max(self.a, self.b)
        before, after = excess[:, :-1], excess[:, 1:]
        has_root = (before * after <= 0) | (np.abs(before) <= noise) | (np.abs(after) <= noise)
        if not has_root.any(axis=1).all():
            name = f"s{2 - wanted}"
            missing = s[~has_root.any(axis=1)][0]
            raise InputError(
                f"the relation has no root: nowhere is {name} = {missing:.6g}; it runs over "
                f"{self.curve(x)[:, 1 - wanted].min():.6g} to {self.curve(x)[:, 1 - wanted].max():.6g}"
            )
        i = has_root.argmax(axis=1)
        low, high = x[i], x[i + 1]
        sign = np.sign(excess[np.arange(len(s)), i + 1] - excess[np.arange(len(s)), i])
        low, high = bisect_intervals(lambda x: ~((self.curve(x)[:, 1 - wanted] - s) * sign >= 0), low, high)
        errors = [np.abs(self.curve(end)[:, 1 - wanted] - s) for end in (low, high)]
        return self.curve(np.where(errors[0] <= errors[1], low, high))[:, wanted].reshape(values.shape)


@dataclass(frozen=True)
class Conic(Relation):
    r"""The conic of eq. 2 that touches the axes at (a, 0) and (0, b), exact and monotone.

    .. math:: s_1 = a (1 - x)^2 / D, \quad s_2 = b x^2 / D, \quad D = (1 - x)^2 + 2 w x (1 - x) + x^2,
        \quad w = \sqrt{(1 - \lambda / ab) / 2}.

    ``lam`` (lambda) is below ab, where it would be the straight line between the points: 0 is an ellipse, -ab a
    parabola, and less are hyperbolas. The less, the sharper. (The paper's lambda of 10 is -10 in eq. 2 as it stands.)

    Raises
    ------
    InputError
        a or b is not above 0, or lambda not below ab.

    Examples
    --------
    >>> s1, s2 = Conic(1, 1, -10)(0.25)
    >>> bool(abs(s1**2 + s2**2 + 1 - 2 * s1 - 2 * s2 - 20 * s1 * s2) < 1e-15)
    True
    """

    curve: Curve = field(init=False, repr=False)
    lam: float = field(init=False)

    def __init__(self, a: float, b: float, lam: float = 0.0) -> None:
        a, b, lam = check_number("a", a), check_number("b", b), check_number("lam", lam)
        if not a > 0 or not b > 0:
            raise InputError(f"a and b must be above 0, not {a:g} and {b:g}")
        if not lam < a * b:
            raise InputError(
                f"lam must be below a b = {a * b:g}, not {lam:g}: there, the conic is the straight line from (a, 0) to "
                "(0, b), and above it has no branch between them; 0 is an ellipse, negative values are sharper"
            )
        w = float(np.sqrt((1 - lam / (a * b)) / 2))
        object.__setattr__(self, "lam", lam)
        object.__setattr__(self, "curve", Curve.bezier(np.array([[a, 0], [0, 0], [0, b]]), weights=[1, w, 1]))
        self.__post_init__()

    def __repr__(self) -> str:
        return f"Conic(a={self.a:g}, b={self.b:g}, lam={self.lam:g})"


@dataclass(frozen=True)
class BezierRelation(Relation):
    """A Bezier curve (s1, s2)(x) of degree 2 or more, from points (n, 2).

    The first two lie on the first axis, the last two on the second one.

    Raises
    ------
    InputError
        They are not, or there are fewer than three.

    Examples
    --------
    >>> forked = BezierRelation([(1, 0), (0.2, 0), (0.5, 0.5), (0, 0.2), (0, 1)])
    >>> forked.first(0.0), forked(0.5).tolist()
    (array(1.), [0.3, 0.3])
    """

    curve: Curve = field(init=False)

    def __init__(self, points: Sequence[Sequence[float]] | Array) -> None:
        try:
            poles = to_float_array("points of a relation", points)
        except InputError:
            poles = np.empty(0)
        if poles.ndim != 2 or poles.shape[1] != 2 or len(poles) < 3:
            raise InputError(f"a relation takes three points (s1, s2) or more, not {shown(points)}")
        object.__setattr__(self, "curve", Curve.bezier(poles))
        self.__post_init__()


def to_relation(given: Any) -> Relation:
    """Return a relation from one, from a function x -> (s1, s2) of arrays, or from two functions x -> s1 and x -> s2.

    Raises
    ------
    InputError
        What is given is none of them, a function is not smooth or not finite, or :class:`Relation`'s conditions do not
        hold.
    """
    if isinstance(given, Relation):
        return given
    functions = given if isinstance(given, tuple | list) else (given,)
    if len(functions) > 2 or not functions or not all(callable(one) for one in functions):
        raise InputError(
            "a relation is a Conic, a BezierRelation, a function x -> (s1, s2) or a pair of functions x -> s1 and "
            f"x -> s2, not {shown(given)}"
        )

    def evaluate_amount_pairs(x: Array) -> Array:
        parts = [to_float_array("what a relation returns", part) for part in _call_functions(functions, x)]
        try:
            pair = np.broadcast_arrays(*parts, x)[:-1]
        except ValueError as error:
            raise InputError(f"a relation takes an array of x and returns as many s1 and s2: {error}") from error
        out = np.stack(pair, axis=-1)
        if out.shape != (len(x), 2) or not np.isfinite(out).all():
            raise InputError("a relation is not finite, or does not return s1 and s2, everywhere on [0, 1]")
        return out

    try:
        curve = approximate_to_rounding(evaluate_amount_pairs, (0.0, 1.0))
    except InputError:
        raise
    except CqblendError as error:
        raise InputError(f"the relation is not a smooth function of x: {error}") from error
    return Relation(curve)


def _call_functions(functions: Sequence[Callable[[Array], Any]], x: Array) -> Sequence[Any]:
    """Return s1 and s2 as two functions, or one that returns both as a pair or as rows (n, 2), give them."""
    rule = "a relation takes an array of x and returns as many s1 and s2"
    results = [call_user_function(rule, function, x) for function in functions]
    if len(results) == 2:
        return results
    if not isinstance(results[0], tuple | list | np.ndarray):
        raise InputError(f"a relation returns s1 and s2, not {shown(results[0])}")
    array = to_float_array("what a relation returns", results[0])
    return list(array.T) if array.ndim == 2 and array.shape == (len(x), 2) and len(x) != 2 else list(array)
