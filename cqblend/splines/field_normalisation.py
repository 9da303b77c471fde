r"""Scales a vector field to a prescribed length by a spline factor, with a proven bound on the error.

Cross-boundary tangents, normals and velocities that are computed symbolically have varying length. No spline has a
prescribed length exactly, so it is approximated. A rational field N/w needs no treatment of its own: with M close to
1/\|N\| the product M N has the wanted length, and is polynomial. The error is bounded by the coefficients of the
product, so that the bound rests on no assumption about the approximation.

References
----------
K. Kim, G. Elber: A symbolic approach to freeform parametric surface blends, section 2.3.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import comb, inf, isfinite, nan
from numbers import Real
from typing import Literal

import numpy as np

from cqblend.argument_checks import check_integer, check_number
from cqblend.errors import GeometryError, InputError, shown
from cqblend.splines import bernstein
from cqblend.splines.bernstein import EPSILON, Array
from cqblend.splines.coefficient_bounds import enclose_values
from cqblend.splines.curve import Curve
from cqblend.splines.interpolation import hermite
from cqblend.splines.knots import SMOOTH, assemble_bspline
from cqblend.splines.roots import find_sign_changes
from cqblend.splines.tolerances import SPLINE_LIMITS, SPLINE_TOLERANCES

NormaliseMethod = Literal["hermite", "schoenberg"]

_DEGREES = np.arange(3, 25)
"""Degrees of M to choose from: the least that can be C1, and the last that Bernstein form holds at full precision."""

FACTOR_CONTINUITY = 2
"""Continuity of M where the field has it, from degree 5 on."""


_CHEBYSHEV_POINTS = 33
"""Points of an interval from which the degree is estimated that a polynomial needs there."""


@dataclass(frozen=True)
class Normalised:
    """A field of a prescribed length; see :func:`normalise`."""

    factor: Curve
    """M, of dim 1: what the field given was multiplied by, the length asked for included."""
    field: Curve
    """M T."""
    error: float
    """Proven bound on the largest difference between the length of ``field`` and the length asked for."""


def normalise(
    field: Curve,
    tolerance: float,
    *,
    method: NormaliseMethod = "hermite",
    length: float | Curve = 1.0,
    knots: int | None = None,
) -> Normalised:
    r"""Scale a vector field to a length, by a scalar spline.

    .. math:: \Bigl|\, \|M(t)\, T(t)\| - |k(t)| \,\Bigr| \le \text{error} \le \text{tolerance}

    Parameters
    ----------
    field
        T, of any dim; polynomial, or rational with positive weights. Where it is C1 so is the result, and M is C2
        from degree 5 on.
    tolerance
        Absolute, in the unit of the length; ``math.inf`` for no bound on the error.
    method
        ``"hermite"``: M meets 1/\|T\| with its derivatives at the ends of its pieces and at points between that make
        the error nearly as small as its degree allows. Degree and pieces are those that give the fewest poles, and the
        pieces are halved only where they have to be.

        ``"schoenberg"``: the paper's. M has the knots and the degree of <T, T>, on refined knots of T, and its
        poles are those of <T, T>, each k replaced by 1/sqrt(k). Of second order.
    length
        k, a number or a scalar curve over the same domain; a negative one turns the field round.
    knots
        With ``"schoenberg"``, the number of equidistant knots inserted into T; None for as many as the tolerance
        takes, where it takes them.

    Raises
    ------
    InputError
        If an argument is out of range, or the domain of the length is not the field's.
    GeometryError
        If the field vanishes, or the tolerance is out of reach; the message says where.

    References
    ----------
    Kim and Elber, section 2.3 and table 2.

    Examples
    --------
    >>> field = Curve.bezier([[1.0, 0.0, 0.2], [0.6, 0.9, -0.1], [-0.4, 0.7, 0.5]])
    >>> unit = normalise(field, 1e-5)
    >>> unit.error <= 1e-5, len(unit.field.to_bspline()[2])
    (True, 15)
    """
    tolerance = _check_arguments(field, tolerance, method, knots)
    reach = _bound_length(field, length)
    numerator, weight = _split_field(field)
    size = float(np.abs(numerator.coefs).max())
    if size == 0:
        raise GeometryError("the field is zero everywhere: it has no direction to scale")
    direction = numerator / size
    _refuse_zeros(direction)
    wanted = tolerance / reach
    if method == "schoenberg":
        factor, unit, error = _refine_schoenberg(direction, wanted, knots)
    else:
        factor, unit, error = _fit_fewest_poles(direction, wanted)
    factor = factor / size
    if weight is not None:
        factor = factor * weight
    return Normalised(factor * length, unit * length, error * reach)


# -- arguments


def _check_arguments(field: object, tolerance: object, method: object, knots: object) -> float:
    """Check the arguments, and return the tolerance."""
    if not isinstance(field, Curve):
        raise InputError(f"a vector field is a Curve, not {shown(field)}")
    if not np.isfinite(field.coefs).all():
        raise InputError("the field has a coefficient that is not a finite number")
    try:
        wanted = nan if isinstance(tolerance, bool) or not isinstance(tolerance, Real) else float(tolerance)
    except OverflowError:
        wanted = inf
    if not wanted > 0:
        raise InputError(f"tolerance {shown(tolerance)}: it must be positive")
    if not isinstance(method, str) or method not in ("hermite", "schoenberg"):
        raise InputError(f"method {shown(method)}: choose 'hermite' or 'schoenberg'")
    if knots is not None:
        try:
            check_integer("knots", knots, 0, SPLINE_LIMITS.factor_pieces if method == "schoenberg" else -1)
        except InputError as error:
            raise InputError(
                f"knots={shown(knots)}: a number of knots to insert, {SPLINE_LIMITS.factor_pieces} at most, "
                "for method='schoenberg'"
            ) from error
    return wanted


def _bound_length(field: Curve, length: float | Curve) -> float:
    """Return an upper bound of the absolute value of the wanted length."""
    if isinstance(length, Curve):
        if length.dim != 1:
            raise InputError(f"a length has dim 1, not {length.dim}")
        field._align_breaks(length)  # refuses another domain
        low, high = length.bounds()
        reach = float(max(-low[0], high[0]))
    else:
        try:
            reach = abs(check_number("length", length))
        except InputError:
            reach = nan
    if not isfinite(reach) or reach == 0:
        raise InputError(f"length {shown(length)}: it must be finite, and not zero everywhere")
    return reach


def _split_field(field: Curve) -> tuple[Curve, Curve | None]:
    """Numerator and weight as curves."""
    numerator, weight = field._split_weight()
    if weight is None:
        return field, None
    if weight.min() <= 0:
        at = field.breaks[int(weight.min(axis=(0, 1)).argmin())]
        raise GeometryError(f"a weight coefficient of the field is {weight.min():.3g} at t = {at:.6g}; cut it smaller")
    over, denominator = (
        Curve._from_pieces(field._breaks, part, False, field._continuity) for part in (numerator, weight)
    )
    return over, denominator


def _refuse_zeros(direction: Curve) -> None:
    """Raise where the field is zero to rounding: at a break, or where its length is least inside a piece."""
    rate = direction.dot(direction).derivative()
    scale = np.abs(rate.coefs).max()
    column, x = find_sign_changes(rate.coefs[:, 0], np.full(rate.coefs.shape[-1], 16 * EPSILON * scale))
    breaks = direction.breaks
    inside = breaks[column] + x * (breaks[column + 1] - breaks[column])
    t = np.concatenate([inside, breaks[:-1], breaks[1:]])
    values = np.concatenate([direction(np.concatenate([inside, breaks[:-1]])), direction(breaks[1:], side="left")])
    lengths = np.linalg.norm(values, axis=1)
    least = int(lengths.argmin())
    if lengths[least] <= SPLINE_TOLERANCES.vanishing_field * lengths.max():
        raise GeometryError(
            f"the field vanishes at t = {t[least]:.9g}, where it has no direction: cut it there and treat the parts"
        )


def _unreachable_error(direction: Curve, tolerance: float) -> GeometryError:
    t = np.linspace(*direction.domain, 1025)
    lengths = np.linalg.norm(direction(t), axis=1)
    at, ratio = t[lengths.argmin()], lengths.max() / lengths.min()
    return GeometryError(
        f"no {SPLINE_LIMITS.factor_pieces} pieces bring the field to its length within a relative {tolerance:.3g}: "
        f"it is shortest near t = {at:.6g}, and {ratio:.3g} times longer elsewhere; raise the tolerance, or cut it "
        "there"
    )


def _compute_length_errors(unit: Curve) -> Array:
    """Bernstein coefficients of <U, U> - 1, (2p+1, n)."""
    return unit.dot(unit).coefs[:, 0] - 1


def _bound_length_error(unit: Curve, misses: Array) -> float:
    r"""Bound \| \|U\| - 1 \| by the hull of <U, U> - 1, with the rounding of these and of one more product with U."""
    rounding = EPSILON * (unit.degree + unit.dim + 4) * unit.dim * float(np.abs(unit.coefs).max()) ** 2
    low, high = enclose_values(misses, slack=rounding)
    return float(max(1 - np.sqrt(max(1 + low, 0.0)), np.sqrt(1 + high) - 1)) + rounding


# -- method hermite


def _fit_fewest_poles(direction: Curve, tolerance: float) -> tuple[Curve, Curve, float]:
    """Find the factor that leads to the fewest poles, the unit field and its error."""
    target = tolerance
    for _ in range(SPLINE_LIMITS.factor_attempts):
        factor = _interpolate_reciprocal_length(direction, *_choose_breaks_and_degree(direction, target))
        unit = direction * factor if factor.degree == 0 else factor * direction
        error = _bound_length_error(unit, _compute_length_errors(unit))
        if error <= tolerance:
            return factor, unit, error
        target *= 0.5 * tolerance / error
    raise _unreachable_error(direction, tolerance)


@lru_cache(maxsize=1)
def _tabulate_chebyshev() -> tuple[Array, Array]:
    """Points in [0, 1], and the matrix from values there to Chebyshev coefficients."""
    angle = (np.arange(_CHEBYSHEV_POINTS) + 0.5) * (np.pi / _CHEBYSHEV_POINTS)
    matrix = (2 / _CHEBYSHEV_POINTS) * np.cos(np.outer(np.arange(_CHEBYSHEV_POINTS), angle))
    matrix[0] /= 2
    return (1 + np.cos(angle)) / 2, matrix


def _evaluate_lengths(direction: Curve, start: Array, end: Array, x: Array) -> Array:
    r"""\|T\| at local parameters x of each interval, (len(x), n)."""
    return np.linalg.norm(direction(np.multiply.outer(1 - x, start) + np.multiply.outer(x, end)), axis=-1)


def _estimate_degrees(direction: Curve, start: Array, end: Array, tolerance: float) -> Array:
    r"""Estimate the degree at which a polynomial is close enough to 1/\|T\| in each interval.

    By the Chebyshev coefficients that a lower degree leaves out; what is left out is small relative to 1/\|T\|.
    """
    x, matrix = _tabulate_chebyshev()
    lengths = _evaluate_lengths(direction, start, end, x)
    left_out = np.abs(matrix @ (1 / lengths))[::-1].cumsum(axis=0)[::-1] * lengths.max(axis=0)
    return np.asarray((left_out > tolerance).sum(axis=0) - 1)


def _choose_breaks_and_degree(direction: Curve, tolerance: float) -> tuple[Array, int]:
    """Choose breaks and degree of M such that M T has the fewest poles.

    Pieces are halved until a degree suffices. All degrees are looked at on one tree of halves, and each only as long as
    it may still lead to fewer poles than the best one so far.
    """
    x, _ = _tabulate_chebyshev()
    lengths = _evaluate_lengths(direction, direction.breaks[:-1], direction.breaks[1:], x)
    if lengths.max() <= (1 + tolerance) * lengths.min():
        return direction.breaks[[0, -1]], 0
    real = direction.continuity < SMOOTH
    fixed = direction.breaks[np.concatenate([[True], real, [True]])]
    # least_need: the smallest degree that sufficed for an interval or for one that contains it
    order = np.minimum(FACTOR_CONTINUITY, (_DEGREES - 1) // 2)
    shared = (np.minimum.outer(direction.continuity[real], order) + 1).sum(axis=0)
    start, end, least_need = fixed[:-1], fixed[1:], np.full(len(fixed) - 1, _DEGREES[-1] + 1)
    settled, possible = np.zeros(len(_DEGREES), dtype=int), np.ones(len(_DEGREES), dtype=bool)
    levels = []
    while True:
        need = _estimate_degrees(direction, start, end, tolerance)
        leaf = (need[:, None] <= _DEGREES) & (least_need[:, None] > _DEGREES)
        levels.append((start, leaf))
        settled += leaf.sum(axis=0)
        least_need = np.minimum(least_need, need)
        unsettled = (least_need[:, None] > _DEGREES).sum(axis=0)
        pieces = settled + 2 * unsettled
        poles = pieces * (direction.degree + _DEGREES + 1) - (pieces - len(fixed) + 1) * (order + 1) - shared
        done = possible & (unsettled == 0)
        possible &= done | (poles < poles[done].min(initial=SPLINE_LIMITS.factor_pieces * (direction.degree + 2)))
        promising = possible & ~done
        if not promising.any():
            break
        split = least_need > _DEGREES[promising].min()
        middle = (start[split] + end[split]) / 2
        start, end = np.concatenate([start[split], middle]), np.concatenate([middle, end[split]])
        least_need = np.tile(least_need[split], 2)
    if not done.any():
        raise _unreachable_error(direction, tolerance)
    best = int(np.where(done, poles, np.iinfo(int).max).argmin())
    starts = np.sort(np.concatenate([first[leaf[:, best]] for first, leaf in levels]))
    return np.append(starts, fixed[-1]), int(_DEGREES[best])


@lru_cache(maxsize=64)
def _tabulate_inner_points(degree: int, order: int) -> tuple[Array, Array, Array]:
    """Points between the ends of a piece, Bernstein polynomials there, and (x (1-x))^(order+1) times as many there.

    The points are zeros of the Gegenbauer polynomial that goes with the weight (x (1-x))^(order+1): interpolation at
    them, of what already vanishes to that order at both ends, is close to the best there is.
    """
    count = degree - 2 * order - 1
    k, index = np.arange(1, count), 2.0 * (order + 1)
    jacobi = np.zeros((count, count))
    jacobi[k, k - 1] = np.sqrt(k * (k + 2 * index - 1) / (4 * (k + index) * (k + index - 1)))
    x = (1 + np.linalg.eigvalsh(jacobi)) / 2  # which reads the lower triangle
    basis = bernstein.evaluate_basis(count - 1, 1 - x, x) if count else np.empty((0, 0))
    bubble = (x * (1 - x)) ** (order + 1)
    return x, basis, bubble


def _interpolate_reciprocal_length(direction: Curve, breaks: Array, degree: int) -> Curve:
    r"""Meet 1/\|T\| with its derivatives at the breaks, and at points between them."""
    if degree == 0:
        t = np.linspace(*direction.domain, 4 * len(direction.breaks) * direction.degree + 1)
        lengths = np.linalg.norm(direction(t), axis=1)
        constant = 2 / (lengths.min() + lengths.max())
        return Curve._from_pieces((breaks,), np.full((1, 1, 1), constant), False, (np.empty(0, dtype=int),))
    order = min(FACTOR_CONTINUITY, (degree - 1) // 2)
    start, end = breaks[:-1], breaks[1:]
    jets = np.stack([direction.jet(start, order), direction.jet(end, order, side="left")], axis=2)
    known = np.full(len(breaks) - 2, SMOOTH)
    at = np.searchsorted(breaks, direction.breaks[1:-1])
    on = np.isin(direction.breaks[1:-1], breaks)
    known[at[on] - 1] = direction.continuity[on]
    reciprocal = _differentiate_reciprocal_length(jets)
    reciprocal[:, :-1, 1] = np.where(
        known >= np.arange(order + 1)[:, None], reciprocal[:, 1:, 0], reciprocal[:, :-1, 1]
    )
    ends = hermite(breaks, reciprocal[..., None])
    coefs = bernstein.elevate_degree(ends.coefs, degree - ends.degree)
    x, basis, bubble = _tabulate_inner_points(degree, order)
    if len(x):
        values = bernstein.evaluate_basis(degree, 1 - x, x).T @ coefs[:, 0]
        wanted = (1 / _evaluate_lengths(direction, start, end, x) - values) / bubble[:, None]
        inner = np.linalg.solve(basis.T, wanted)
        share = [comb(len(x) - 1, i) / comb(degree, i + order + 1) for i in range(len(x))]
        coefs[order + 1 : degree - order, 0] += np.array(share)[:, None] * inner
    return Curve._from_pieces((breaks,), coefs, False, (ends.continuity,))


def _differentiate_reciprocal_length(jets: Array) -> Array:
    r"""Differentiate 1/\|T\|, from the derivatives of T: (k+1, .., dim) to (k+1, ..).

    By Leibniz' rule on m = <T, T> and on 2 m f' + m' f = 0, which f = m^(-1/2) solves.
    """
    orders = range(len(jets))
    m = [sum(comb(k, i) * (jets[i] * jets[k - i]).sum(axis=-1) for i in range(k + 1)) for k in orders]
    f = [1 / np.sqrt(m[0])]
    for k in orders[:-1]:
        right = sum(comb(k, i) * m[i + 1] * f[k - i] for i in range(k + 1))
        right = right + 2 * sum(comb(k, i) * m[i] * f[k + 1 - i] for i in range(1, k + 1))
        f.append(-right / (2 * m[0]))
    return np.stack(f)


# -- method schoenberg


def _refine_schoenberg(direction: Curve, tolerance: float, knots: int | None) -> tuple[Curve, Curve, float]:
    """Refine the field until the variation-diminishing factor is close enough, or as often as is asked."""
    a, b = direction.domain
    field = _insert_simple_knots(direction, a + (b - a) * np.arange(1, (knots or 0) + 1) / ((knots or 0) + 1))
    while True:
        factor = _fit_schoenberg_factor(field)
        if factor is not None:
            unit = factor * field
            misses = _compute_length_errors(unit)
            error = _bound_length_error(unit, misses)
            if error <= tolerance:
                return factor, unit, error
            bad = np.abs(misses).max(axis=0) > tolerance
        else:
            bad, error = np.ones(len(field.breaks) - 1, dtype=bool), inf
        if knots is not None:
            raise GeometryError(
                f"with {knots} knots inserted the length is off by a relative {error:.3g}, more than {tolerance:.3g}: "
                f"give more, leave knots=None, or use method='hermite'"
            )
        if len(bad) + bad.sum() > SPLINE_LIMITS.factor_pieces:
            raise _unreachable_error(direction, tolerance)
        field = _insert_simple_knots(field, (field.breaks[:-1] + field.breaks[1:])[bad] / 2)


def _insert_simple_knots(field: Curve, knots: Array) -> Curve:
    """Insert simple knots, which stay: across them the curve is held to be no smoother than its degree lets it be."""
    cut = field.cut(knots)
    return Curve._from_pieces(cut._breaks, cut._coefs, False, (np.minimum(cut.continuity, field.degree - 1),))


def _fit_schoenberg_factor(field: Curve) -> Curve | None:
    """Replace each pole k of <T, T> by 1/sqrt(k); None if there is one that is not positive."""
    squared = field.dot(field)
    knots, poles = assemble_bspline(squared.breaks, squared.coefs, squared.continuity)
    if poles.min() <= 0:
        return None
    return Curve.from_bspline(squared.degree, knots, 1 / np.sqrt(poles))
