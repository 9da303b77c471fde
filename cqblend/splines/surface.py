"""Symbolic spline surfaces: evaluation, algebra, composition with curves, and conversion from and to B-splines.

Primary surfaces, ribbons and blends are surfaces of this class. Depends on NumPy only.
"""

from collections.abc import Sequence
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from cqblend.argument_checks import (
    check_integer,
    check_interval,
    check_number,
    to_finite_array,
    to_float_array,
    unpack_pair,
)
from cqblend.errors import InputError, shown
from cqblend.splines import bernstein
from cqblend.splines.bernstein import Array
from cqblend.splines.curve import Curve
from cqblend.splines.evaluation import (
    BLOCK_SIZE,
    BreakSide,
    check_break_side,
    contract_differences,
    dehomogenise_derivatives,
    evaluate_everywhere,
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
from cqblend.splines.piece_arrays import apply_along_axis
from cqblend.splines.spline import Spline
from cqblend.splines.tolerances import SPLINE_LIMITS, SPLINE_TOLERANCES

BSplineSurface = tuple[tuple[int, int], tuple[Array, Array], Array, Array | None]


def _check_axis(value: object) -> int:
    return check_integer("axis", value, 0, 1)


def _broadcast_parameters(u: object, v: object) -> tuple[Array, Array]:
    """Return parameters of scattered points, of one shape."""
    u, v = to_finite_array("u", u), to_finite_array("v", v)
    if u.shape == v.shape:
        return u, v
    try:
        u, v = np.broadcast_arrays(u, v)
    except ValueError as error:
        raise InputError(f"u of shape {u.shape} and v of shape {v.shape} do not go together") from error
    return u, v


class Surface(Spline):
    """A piecewise polynomial or rational tensor product of two parameters, with values in any dimension.

    Everything said of :class:`~cqblend.splines.curve.Curve` holds for each direction.

    Parameters
    ----------
    breaks
        Pair of (nu + 1,) and (nv + 1,), strictly increasing.
    coefs
        (p + 1, q + 1, dim, nu, nv), or dim + 1 homogeneous components if rational.
    rational
        Whether the last component is a weight.
    continuity
        Pair of (nu - 1,) and (nv - 1,), known orders of continuity across the interior knot lines; None as for curves.

    Raises
    ------
    InputError
        On shapes that do not fit, breaks that do not increase, or numbers that are not finite.

    Examples
    --------
    >>> saddle = Surface(([0, 1], [0, 1]), np.array([[0.0, 0.0], [0.0, 1.0]]).reshape(2, 2, 1, 1, 1))
    >>> saddle(0.5, [0.0, 0.5, 1.0]).ravel()
    array([0.  , 0.25, 0.5 ])
    >>> diagonal = Curve.bezier([[0.0, 0.0], [1.0, 1.0]])
    >>> saddle.compose(diagonal).coefs.ravel()
    array([0., 0., 1.])
    """

    __slots__ = ()
    _parameter_count: ClassVar[int] = 2

    def __init__(
        self,
        breaks: Sequence[ArrayLike],
        coefs: ArrayLike,
        *,
        rational: bool = False,
        continuity: Sequence[ArrayLike | None] | None = None,
    ) -> None:
        super().__init__(breaks, coefs, rational=rational, continuity=continuity)

    @classmethod
    def from_bspline(
        cls,
        degrees: tuple[int, int],
        knots: tuple[ArrayLike, ArrayLike],
        poles: ArrayLike,
        weights: ArrayLike | None = None,
    ) -> Self:
        """Surface of a B-spline or NURBS with full knot vectors.

        Parameters
        ----------
        degrees
            (p, q).
        knots
            Pair of full knot vectors (nu + p + 1,) and (nv + q + 1,); clamped or not, the domain is knots[p] ..
            knots[n].
        poles
            (nu, nv, dim).
        weights
            (nu, nv), or None for a polynomial surface.

        Raises
        ------
        InputError
            If the arrays do not fit each other, or are not finite.
        """
        ku, kv = (to_float_array("knots", vector) for vector in unpack_pair("knots", knots))
        poles = to_float_array("poles", poles)
        if poles.ndim != 3:
            raise InputError(f"poles have {poles.ndim} axes, expected 3")
        first, second = unpack_pair("degrees", degrees)
        p, q = check_knot_vector(first, ku, len(poles)), check_knot_vector(second, kv, poles.shape[1])
        homogeneous = to_homogeneous(poles, weights)
        bu, rows, cu = extract_pieces(p, ku, homogeneous)  # (p+1, Nv, dim, nu)
        bv, coefs, cv = extract_pieces(q, kv, np.moveaxis(rows, 1, 0))  # (q+1, p+1, dim, nu, nv)
        source = None
        if is_clamped(p, ku) and is_clamped(q, kv):
            source = ((p, q), (ku, kv), poles, None if weights is None else np.array(weights, dtype=np.float64))
        return cls._from_pieces((bu, bv), np.swapaxes(coefs, 0, 1), weights is not None, (cu, cv), source)

    @classmethod
    def from_rows(cls, rows: Sequence[Curve], domain: tuple[float, float] = (0.0, 1.0)) -> Self:
        """Surface (t, v) of degree len(rows) - 1 in v whose Bernstein rows in v are curves in t with a common domain.

        If any row is rational all are taken homogeneously, weight and all: the row's own weight is the weight of that
        row.

        Raises
        ------
        InputError
            If the domains or dims differ.
        """
        if not isinstance(rows, list | tuple) or not rows or not all(isinstance(row, Curve) for row in rows):
            raise InputError(f"the rows of a surface are Curves, one at least, not {shown(rows)}")
        dims = {row.dim for row in rows}
        if len(dims) != 1:
            raise InputError(f"rows of a surface need one dim, not {sorted(dims)}")
        rational = any(row.rational for row in rows)
        plain = [row._to_rational() if rational else row for row in rows]
        homogeneous = [Curve._from_pieces(row._breaks, row._coefs, False, row._continuity) for row in plain]
        together = Curve.stack(homogeneous)
        p, _, n = together.coefs.shape
        coefs = together.coefs.reshape(p, len(rows), -1, n)[..., None]
        breaks = np.array(check_interval("domain", domain))
        return cls._from_pieces(
            (together.breaks, breaks), coefs, rational, (together.continuity, np.empty(0, dtype=int))
        )

    def to_bspline(self) -> BSplineSurface:
        """Return degrees, full clamped knot vectors, poles (nu, nv, dim), and weights (nu, nv) or None.

        See the curve's method.

        Raises
        ------
        GeometryError
            If a pole's weight is not positive.
        """
        if self._source is not None:
            degrees, (ku, kv), poles, weights = self._source
            return degrees, (ku.copy(), kv.copy()), poles.copy(), None if weights is None else weights.copy()
        ku, rows = assemble_bspline(self._breaks[0], self._coefs.transpose(0, 1, 2, 4, 3), self._continuity[0])
        # (Nu, q+1, dim, nv)
        kv, poles = assemble_bspline(self._breaks[1], rows.swapaxes(0, 1), self._continuity[1])
        poles = np.ascontiguousarray(poles.swapaxes(0, 1))
        return (self.degree, (ku, kv), *(to_euclidean(poles) if self._rational else (poles, None)))

    @property
    def degree(self) -> tuple[int, int]:
        """Polynomial degrees (p, q)."""
        return self._coefs.shape[0] - 1, self._coefs.shape[1] - 1

    @property
    def breaks(self) -> tuple[Array, Array]:
        """Knot lines in u and in v, ends included, read-only."""
        return self._breaks[0], self._breaks[1]

    @property
    def continuity(self) -> tuple[Array, Array]:
        """Known orders of continuity across the interior knot lines in u and in v."""
        return self._continuity[0], self._continuity[1]

    @property
    def domain(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """((u0, u1), (v0, v1))."""
        (u, v) = self._breaks
        return (float(u[0]), float(u[-1])), (float(v[0]), float(v[-1]))

    # -- evaluation

    def _evaluate_partials(
        self,
        u: Array,
        v: Array,
        orders_u: Sequence[int],
        orders_v: Sequence[int],
        side: BreakSide,
        dropped: int | None = None,
    ) -> Array:
        """Homogeneous partial derivatives (len(orders_v), len(orders_u), dim_h, N) at flat u, v; orders increase.

        Those whose orders add up to `dropped` or more are zero.
        """
        if len(u) > BLOCK_SIZE:
            parts = [
                self._evaluate_partials(u[i : i + BLOCK_SIZE], v[i : i + BLOCK_SIZE], orders_u, orders_v, side, dropped)
                for i in range(0, len(u), BLOCK_SIZE)
            ]
            return np.concatenate(parts, axis=-1)
        (p, q), shape, n = self.degree, self._coefs.shape, len(u)
        iu, su, xu, hu = locate_pieces(self._breaks[0], u, side)
        iv, sv, xv, hv = locate_pieces(self._breaks[1], v, side)
        patches = self._coefs.reshape(*shape[:3], -1).take(iu * shape[4] + iv, axis=-1)
        if p == q and orders_u == orders_v:  # both directions at once
            pairs = [np.concatenate(pair) for pair in ((su, sv), (xu, xv), (hu, hv))]
            both = tabulate_derivative_basis(p, orders_u, *pairs)
            factors_u, factors_v = [basis[:, :n] for basis in both], [basis[:, n:] for basis in both]
        else:
            factors_u = tabulate_derivative_basis(p, orders_u, su, xu, hu)
            factors_v = tabulate_derivative_basis(q, orders_v, sv, xv, hv)
        rows = contract_differences(patches, orders_u, factors_u)  # (orders_u, q+1, dim_h, N)
        return contract_differences(rows.swapaxes(0, 1), orders_v, factors_v, dropped)

    def __call__(self, u: ArrayLike, v: ArrayLike, ku: int = 0, kv: int = 0, *, side: BreakSide = "right") -> Array:
        """Values of a partial derivative at scattered points, shape (.., dim); u and v broadcast.

        At a knot line the piece to the right counts (at the last line the last piece), or the one on `side`. Beyond the
        domain the end patches go on as polynomials.
        """
        u, v = _broadcast_parameters(u, v)
        ku, kv = (
            check_integer("the order ku", ku, 0, SPLINE_LIMITS.derivative),
            check_integer("the order kv", kv, 0, SPLINE_LIMITS.derivative),
        )
        orders_u, orders_v = ((range(k + 1) if self._rational else (k,)) for k in (ku, kv))
        values = self._evaluate_partials(u.ravel(), v.ravel(), orders_u, orders_v, check_break_side(side))
        if self._rational:
            values = dehomogenise_derivatives(values)
        return np.asarray(values[-1, -1].T.reshape(*u.shape, self.dim))

    def jet(self, u: ArrayLike, v: ArrayLike, order: int, *, side: BreakSide = "right") -> Array:
        """All partial derivatives up to a total order at scattered points.

        Returns
        -------
        Array
            (order + 1, order + 1, .., dim): entry [i, j] is the derivative of order i by u and j by v; zero for i + j
            > order.
        """
        u, v = _broadcast_parameters(u, v)
        order = check_integer("the order", order, 0, SPLINE_LIMITS.derivative)
        orders = range(order + 1)
        jets = self._evaluate_partials(u.ravel(), v.ravel(), orders, orders, check_break_side(side), order + 1)
        if self._rational:
            jets = dehomogenise_derivatives(jets, order)
        return jets.transpose(1, 0, 3, 2).reshape(order + 1, order + 1, *u.shape, self.dim)

    def grid(self, u: ArrayLike, v: ArrayLike, ku: int = 0, kv: int = 0) -> Array:
        """Values of a partial derivative on a grid, shape (len(u), len(v), dim)."""
        u, v = to_finite_array("u", u).ravel(), to_finite_array("v", v).ravel()
        ku, kv = (
            check_integer("the order ku", ku, 0, SPLINE_LIMITS.derivative),
            check_integer("the order kv", kv, 0, SPLINE_LIMITS.derivative),
        )
        orders_u, orders_v = ((range(k + 1) if self._rational else (k,)) for k in (ku, kv))
        rows = evaluate_everywhere(self._breaks[0], self._coefs.transpose(0, 1, 2, 4, 3), u, orders_u)
        jets = evaluate_everywhere(self._breaks[1], rows.transpose(1, 0, 2, 4, 3), v, orders_v)  # (kv, ku, dim_h, ..)
        values = (dehomogenise_derivatives(jets) if self._rational else jets)[-1, -1]
        return values.transpose(1, 2, 0)

    # -- algebra of two parameters

    def derivative(self, ku: int, kv: int) -> Self:
        """Partial derivative as a surface; of degree (p - ku, q - kv), or (1 + ku + kv)(p, q) if rational."""
        return self._take_derivative((ku, kv))

    def elevate(self, amount_u: int, amount_v: int) -> Self:
        """Raise the degrees; the surface stays the same."""
        return self._elevate_degrees((amount_u, amount_v))

    def reduce(self, amount_u: int | None = None, amount_v: int | None = None, *, tolerance: float = 1e-12) -> Self:
        """Lower the degrees, None as far as it goes; see the curve's method.

        Raises
        ------
        GeometryError
            If the surface is not of that degree to the tolerance.
        """
        return self._reduce_degrees((amount_u, amount_v), tolerance)

    def clip(self, u: tuple[float, float] | None = None, v: tuple[float, float] | None = None) -> Self:
        """Take the part over u x v, which must lie inside the domain; None leaves a direction whole."""
        result = self
        for axis, window in enumerate((u, v)):
            if window is not None:
                result = result._clip_axis(axis, *check_interval("uv"[axis], window))
        return result

    def cut(self, u: ArrayLike = (), v: ArrayLike = ()) -> Self:
        """Insert knot lines; those outside the domain or present already are ignored."""
        return self._insert_breaks(0, u)._insert_breaks(1, v)

    def reverse(self, axis: int) -> Self:
        """Run parameter 0 or 1 backwards over the same domain."""
        return self._reverse_axis(_check_axis(axis))

    def transpose(self) -> Self:
        """Exchange the parameters."""
        coefs = self._coefs.transpose(1, 0, 2, 4, 3)
        return self._from_pieces(self._breaks[::-1], coefs, self._rational, self._continuity[::-1])

    def tiled(self, axis: int, before: int, after: int, *, continuity: int = 0) -> Self:
        """Repeat a surface that is closed in one direction.

        Parameters
        ----------
        axis
            0 for u, 1 for v: the closed direction.
        before, after
            Number of further periods below and above the domain.
        continuity
            Order of continuity known at the joint, of the homogeneous coefficients.

        Raises
        ------
        InputError
            If the surface does not close, to 1e-7 of its largest coefficient.
        """
        axis, continuity = _check_axis(axis), check_integer("continuity", continuity, -1, SMOOTH)
        before, after = (
            check_integer("a number of periods", count, 0, SPLINE_LIMITS.periods) for count in (before, after)
        )
        lead = np.moveaxis(self._coefs, (axis, 3 + axis), (0, -1))
        gap = float(np.abs(lead[0, ..., 0] - lead[-1, ..., -1]).max())
        if continuity >= 0 and gap > SPLINE_TOLERANCES.closed_surface_gap * np.abs(self._coefs).max():
            raise InputError(
                f"the surface is open in {'uv'[axis]}: its ends are {gap:.3g} apart (homogeneous coefficients)"
            )
        old, order = self._breaks[axis], self._continuity[axis]
        period = old[-1] - old[0]
        copies = range(-before, after + 1)
        breaks = np.concatenate([old[:-1] + i * period for i in copies] + [old[-1:] + after * period])
        coefs = apply_along_axis(lambda c: np.concatenate([c] * len(copies), axis=-1), self._coefs, axis, 2)
        orders = np.concatenate([np.append(order, continuity)] * len(copies))[:-1]
        return self._replace_axis(axis, breaks, coefs, orders)

    def isoparametric(self, *, u: float | None = None, v: float | None = None) -> Curve:
        """Take the curve v -> S(u, v) for a given u, or u -> S(u, v) for a given v."""
        if (u is None) == (v is None):
            raise InputError("isoparametric needs exactly one of u and v")
        axis, value = (0, check_number("u", u)) if u is not None else (1, check_number("v", v))
        piece, s, x, _ = locate_pieces(self._breaks[axis], np.array([value]))
        row = self._coefs.take(int(piece[0]), axis=3 + axis)  # (p+1, q+1, dim, n)
        values = bernstein.evaluate_basis(self.degree[axis], s, x)[:, 0]
        coefs = np.tensordot(values, row, axes=(0, axis))
        return Curve._from_pieces((self._breaks[1 - axis],), coefs, self._rational, (self._continuity[1 - axis],))

    # -- composition

    def crossings(self, curve: Curve, axis: int | None = None) -> Array:
        """Parameters at which a curve in the parameter plane passes from one patch to another, increasing.

        Parameters
        ----------
        curve
            Curve of dim 2, polynomial or rational.
        axis
            0 or 1 for the knot lines of u or of v only.

        Returns
        -------
        Array
            To full precision. A knot line that the curve touches without crossing is not among them; where it leaves a
            line that it has run along, the end of the common part may be.
        """
        cut, index, _ = self._cut_at_knot_lines(curve)
        chosen = index if axis is None else index[[_check_axis(axis)]]
        return np.asarray(cut.breaks[1:-1][(chosen[:, 1:] != chosen[:, :-1]).any(axis=0)])

    def _cut_at_knot_lines(self, curve: Curve) -> tuple[Curve, Array, Array]:
        if not isinstance(curve, Curve):
            raise InputError(f"a curve in the parameter plane is a Curve, not {shown(curve)}")
        if curve.dim != 2:
            raise InputError(f"a curve in the parameter plane has dim 2, not {curve.dim}")
        return cut_at_knot_lines(curve, self._breaks, self._continuity)

    def compose(self, curve: Curve) -> Curve:
        """Compose with a curve in the parameter plane: t -> S(u(t), v(t)), exactly.

        Cut the curve at the knot lines it crosses, express it in barycentric coordinates of the patch it runs
        through, and compose by basis products. Degree m (p + q) for a curve of degree m, less where a coordinate is
        constant. A curve that runs beyond the domain sees the end patches continued as polynomials.

        Parameters
        ----------
        curve
            Curve of dim 2, polynomial or rational.

        Raises
        ------
        InputError
            If the curve's dim is not 2.
        """
        cut, index, continuity = self._cut_at_knot_lines(curve)
        rational = self._rational or curve.rational
        frame = self._to_rational() if rational else self
        shape = frame._coefs.shape
        patches = frame._coefs.reshape(*shape[:3], -1).take(index[0] * shape[4] + index[1], axis=-1)
        coefs = bernstein.compose_patch(patches, *to_barycentric(cut, self._breaks, index))
        return Curve._from_pieces(cut._breaks, coefs, rational, (continuity,))
