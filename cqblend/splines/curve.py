"""Symbolic spline curves: evaluation, algebra, composition, and conversion from and to B-splines.

Everything in the package that depends on one parameter is a curve of this class: rails in a parameter plane, space
curves, weight and length functions. Depends on NumPy only.
"""

from collections.abc import Sequence
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from cqblend.argument_checks import check_integer, check_interval, to_finite_array, to_float_array
from cqblend.errors import InputError, shown
from cqblend.splines import bernstein
from cqblend.splines.bernstein import Array
from cqblend.splines.evaluation import (
    BLOCK_SIZE,
    BreakSide,
    check_break_side,
    contract_differences,
    dehomogenise_derivatives,
    locate_pieces,
    tabulate_derivative_basis,
)
from cqblend.splines.knot_line_cuts import cut_at_knot_lines, to_barycentric
from cqblend.splines.knots import (
    SMOOTH,
    assemble_bspline,
    check_knot_vector,
    extract_pieces,
    is_clamped,
    to_euclidean,
    to_homogeneous,
)
from cqblend.splines.piece_arrays import match_degrees
from cqblend.splines.spline import Spline
from cqblend.splines.tolerances import SPLINE_LIMITS, SPLINE_TOLERANCES

BSplineCurve = tuple[int, Array, Array, Array | None]


class Curve(Spline):
    r"""A piecewise polynomial or rational curve of one parameter, with values in any dimension.

    On the piece between ``breaks[j]`` and ``breaks[j+1]``, with x running from 0 to 1,

    .. math:: f = \sum_i \binom{p}{i} (1-x)^{p-i} x^i\; c_{i \cdot j}

    and divided by its last component if rational. Splines are values: frozen, compared by content. ``+ - *`` and the
    methods are those of functions, without approximation; numbers and vectors of dim numbers act as constants. Operands
    need the same domain, not the same breaks, degree or rationality.

    Parameters
    ----------
    breaks
        (n + 1,) strictly increasing.
    coefs
        (p + 1, dim, n), or (p + 1, dim + 1, n) homogeneous (w x, w y, .., w) if rational.
    rational
        Whether the last component is a weight.
    continuity
        (n - 1,) order of continuity known at the interior breaks, of the homogeneous coefficients; by default 0 where
        the pieces meet, else -1. It decides how few knots :meth:`to_bspline` needs; a break at which the polynomial
        goes on unchanged has ``knots.SMOOTH``.

    Raises
    ------
    InputError
        On shapes that do not fit, breaks that do not increase, or numbers that are not finite.

    Examples
    --------
    >>> f = Curve.bezier([[0.0, 0.0], [1.0, 2.0], [2.0, 0.0]])
    >>> f([0.0, 0.5])
    array([[0., 0.],
           [1., 1.]])
    >>> f.dot(f).degree
    4
    """

    __slots__ = ()
    _parameter_count: ClassVar[int] = 1

    def __init__(
        self, breaks: ArrayLike, coefs: ArrayLike, *, rational: bool = False, continuity: ArrayLike | None = None
    ) -> None:
        super().__init__((breaks,), coefs, rational=rational, continuity=(continuity,))

    @classmethod
    def bezier(
        cls, poles: ArrayLike, weights: ArrayLike | None = None, domain: tuple[float, float] = (0.0, 1.0)
    ) -> Self:
        """Single polynomial or rational piece from poles (p + 1, dim)."""
        array = to_float_array("poles", poles)
        if array.ndim != 2:
            raise InputError(f"poles have {array.ndim} axes, expected (p + 1, dim)")
        ends = np.repeat(check_interval("domain", domain), len(array))
        return cls.from_bspline(len(array) - 1, ends, array, weights)

    @classmethod
    def from_bspline(cls, degree: int, knots: ArrayLike, poles: ArrayLike, weights: ArrayLike | None = None) -> Self:
        """Curve of a B-spline or NURBS with full knot vector.

        Parameters
        ----------
        degree
            p.
        knots
            (n + p + 1,), repeated knots written out; clamped or not, the domain is knots[p] .. knots[n].
        poles
            (n, dim).
        weights
            (n,), or None for a polynomial curve.

        Raises
        ------
        InputError
            If the arrays do not fit each other, or are not finite.
        """
        knots, poles = to_float_array("knots", knots), to_float_array("poles", poles)
        if poles.ndim != 2:
            raise InputError(f"poles have {poles.ndim} axes, expected (n, dim)")
        degree = check_knot_vector(degree, knots, len(poles))
        homogeneous = to_homogeneous(poles, weights)
        breaks, coefs, continuity = extract_pieces(degree, knots, homogeneous)
        source = None
        if is_clamped(degree, knots):
            source = (degree, knots, poles, None if weights is None else np.array(weights, dtype=np.float64))
        return cls._from_pieces((breaks,), coefs, weights is not None, (continuity,), source)

    def to_bspline(self) -> BSplineCurve:
        """Return degree, full clamped knot vector, poles (n, dim), and weights (n,) or None.

        A curve that came from a clamped B-spline gives it back as it was. Otherwise knots are as few as the known
        continuity allows without losing digits; see :func:`cqblend.splines.knots.assemble_bspline`.

        Raises
        ------
        GeometryError
            If a pole's weight is not positive.
        """
        if self._source is not None:
            degree, knots, poles, weights = self._source
            return degree, knots.copy(), poles.copy(), None if weights is None else weights.copy()
        knots, homogeneous = assemble_bspline(self._breaks[0], self._coefs, self._continuity[0])
        return (self.degree, knots, *(to_euclidean(homogeneous) if self._rational else (homogeneous, None)))

    @property
    def degree(self) -> int:
        """Polynomial degree p."""
        return int(self._coefs.shape[0]) - 1

    @property
    def breaks(self) -> Array:
        """Ends of the pieces, (n + 1,), read-only."""
        return self._breaks[0]

    @property
    def continuity(self) -> Array:
        """Known order of continuity at the interior breaks, (n - 1,)."""
        return self._continuity[0]

    @property
    def domain(self) -> tuple[float, float]:
        """First and last break."""
        return float(self.breaks[0]), float(self.breaks[-1])

    # -- evaluation

    def _evaluate_derivatives(self, t: Array, orders: Sequence[int], side: BreakSide) -> Array:
        """Homogeneous derivatives (len(orders), dim_h, N) at flat t; orders increase."""
        if len(t) > BLOCK_SIZE:
            parts = [
                self._evaluate_derivatives(t[i : i + BLOCK_SIZE], orders, side) for i in range(0, len(t), BLOCK_SIZE)
            ]
            return np.concatenate(parts, axis=-1)
        piece, s, x, length = locate_pieces(self._breaks[0], t, side)
        factors = tabulate_derivative_basis(self.degree, orders, s, x, length)
        return contract_differences(self._coefs.take(piece, axis=-1), orders, factors)

    def __call__(self, t: ArrayLike, k: int = 0, *, side: BreakSide = "right") -> Array:
        """Values of the k-th derivative, shape (.., dim).

        At a break the piece to the right counts (at the last break the last piece), or the one on `side`. Beyond the
        domain the end pieces go on as polynomials.
        """
        t, k, side = (
            to_finite_array("t", t),
            check_integer("the order k", k, 0, SPLINE_LIMITS.derivative),
            check_break_side(side),
        )
        values = self._evaluate_derivatives(t.ravel(), range(k + 1) if self._rational else (k,), side)
        if self._rational:
            values = dehomogenise_derivatives(values[:, None])[:, 0]
        return np.asarray(values[-1].T.reshape(*t.shape, self.dim))

    def jet(self, t: ArrayLike, order: int, *, side: BreakSide = "right") -> Array:
        """Evaluate the derivatives of orders 0 .. order, shape (order + 1, .., dim)."""
        t, order, side = (
            to_finite_array("t", t),
            check_integer("the order", order, 0, SPLINE_LIMITS.derivative),
            check_break_side(side),
        )
        jets = self._evaluate_derivatives(t.ravel(), range(order + 1), side)
        if self._rational:
            jets = dehomogenise_derivatives(jets[:, None])[:, 0]
        return jets.transpose(0, 2, 1).reshape(order + 1, *t.shape, self.dim)

    # -- algebra of one parameter

    def derivative(self, k: int = 1) -> Self:
        """k-th derivative as a curve; of degree p - k, or (k + 1) p if rational."""
        return self._take_derivative((k,))

    def elevate(self, amount: int = 1) -> Self:
        """Raise the degree by `amount`; the curve stays the same."""
        return self._elevate_degrees((amount,))

    def reduce(self, amount: int | None = None, *, tolerance: float = 1e-12) -> Self:
        """Lower the degree by `amount`, or as far as it goes; the curve stays the same.

        Parameters
        ----------
        amount
            None for as much as changes no coefficient by more than the tolerance.
        tolerance
            Relative to the largest coefficient.

        Raises
        ------
        GeometryError
            If the curve is not of that degree to the tolerance.
        """
        return self._reduce_degrees((amount,), tolerance)

    def clip(self, t0: float, t1: float) -> Self:
        """Take the part over [t0, t1], which must lie inside the domain."""
        return self._clip_axis(0, t0, t1)

    def cut(self, breaks: ArrayLike) -> Self:
        """Insert breaks; those outside the domain or present already are ignored."""
        return self._insert_breaks(0, breaks)

    def reverse(self) -> Self:
        """Run backwards over the same domain."""
        return self._reverse_axis(0)

    def reparametrized(self, t0: float, t1: float) -> Self:
        """Change the parameter affinely, so that the domain becomes [t0, t1]."""
        (t0, t1), (a, b) = check_interval("the domain", (t0, t1)), self.domain
        breaks = t0 + (self.breaks - a) * ((t1 - t0) / (b - a))
        breaks[-1] = t1
        return self._from_pieces((breaks,), self._coefs, self._rational, self._continuity)

    def join(self, other: Self, *, continuity: int = 0) -> Self:
        """Append another curve, whose domain starts where this one's ends.

        Parameters
        ----------
        other
            Curve of the same dim.
        continuity
            Order of continuity known at the joint, of the homogeneous coefficients.

        Raises
        ------
        InputError
            If the dims differ, or the domains are not consecutive.
        """
        a, b = self.domain[1], self._check_same_kind(other).domain[0]
        continuity = check_integer("continuity", continuity, -1, SMOOTH)
        if self.dim != other.dim:
            raise InputError(f"cannot join curves of dim {self.dim} and {other.dim}")
        if abs(a - b) > SPLINE_TOLERANCES.consecutive_domains * max(abs(a), abs(b), self.domain[1] - self.domain[0]):
            raise InputError(f"cannot join: the first domain ends at {a:.17g}, the second starts at {b:.17g}")
        first, second = (
            (self, other) if self._rational is other._rational else (self._to_rational(), other._to_rational())
        )
        coefs = np.concatenate(match_degrees(first._coefs, second._coefs, 1), axis=-1)
        order = np.concatenate([first.continuity, [continuity], second.continuity])
        return self._from_pieces((np.concatenate([first.breaks, second.breaks[1:]]),), coefs, first._rational, (order,))

    def compose(self, parameter: "Curve") -> Self:
        """f(g(t)) for a scalar curve g, polynomial or rational; of degree p m.

        Where g runs beyond the domain of f, the end pieces of f go on as polynomials.
        """
        if not isinstance(parameter, Curve):
            raise InputError(f"the parameter of a curve is a Curve, not {shown(parameter)}")
        if parameter.dim != 1:
            raise InputError(f"the parameter of a curve has dim 1, not {parameter.dim}")
        cut, index, continuity = cut_at_knot_lines(parameter, self._breaks, self._continuity)
        alpha, beta = to_barycentric(cut, self._breaks, index)
        rational = self._rational or parameter._rational
        frame = self._to_rational() if rational else self
        coefs = bernstein.compose_curve(frame._coefs[..., index[0]], alpha, beta)
        return self._from_pieces(cut._breaks, coefs, rational, (continuity,))
