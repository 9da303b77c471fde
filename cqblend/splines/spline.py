"""What curves and surfaces have in common: a frozen tensor product of Bernstein pieces, and its algebra.

For each parameter (one of a curve, two of a surface) a spline holds ``breaks``, the ends of its pieces, and the order
of continuity known at each interior break. Its coefficients are one read-only array (degrees + 1, components, pieces),
with one degree axis and one axis of pieces for each parameter; of a rational spline the last component is a weight. All
algebra is written here once for both, on homogeneous coefficients, with the meaning it has for the Euclidean functions.
Evaluation, and what one kind alone can do, is in `curve` and `surface`. Depends on arrays and knot vectors only.
"""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from cqblend.argument_checks import check_integer, check_number, to_finite_array
from cqblend.errors import GeometryError, InputError, OperandError, shown
from cqblend.splines import bernstein
from cqblend.splines.bernstein import EPSILON, Array
from cqblend.splines.knots import SMOOTH
from cqblend.splines.piece_arrays import (
    apply_along_axis,
    check_continuity,
    check_pieces,
    detect_continuity,
    elevate_to,
    match_degrees,
    replace_item,
    restrict_ends,
    unite_breaks,
)
from cqblend.splines.tolerances import SPLINE_LIMITS


class Spline:
    """Base of :class:`~cqblend.splines.curve.Curve` and :class:`~cqblend.splines.surface.Surface`."""

    __slots__ = ("_breaks", "_coefs", "_continuity", "_rational", "_source")
    _breaks: tuple[Array, ...]
    _coefs: Array
    _rational: bool
    _continuity: tuple[Array, ...]
    _source: tuple[Any, ...] | None
    _parameter_count: ClassVar[int]
    __array_ufunc__ = None  # numpy arrays leave * and + to us

    def __init__(
        self,
        breaks: Sequence[ArrayLike],
        coefs: ArrayLike,
        *,
        rational: bool = False,
        continuity: Sequence[ArrayLike | None] | None = None,
    ) -> None:
        count = self._parameter_count
        name = type(self).__name__
        if not isinstance(rational, bool | np.bool_):
            raise InputError(f"{name}: rational is True or False, not {shown(rational)}")
        continuity = (None,) * count if continuity is None else continuity
        for what, given in (("breaks", breaks), ("continuity", continuity)):
            if not isinstance(given, list | tuple) or len(given) != count:
                raise InputError(f"{name}: {what} is given for {count} parameters, not as {shown(given)}")
        arrays, values = check_pieces(name, breaks, coefs, rational=bool(rational))
        orders = tuple(
            detect_continuity(values, axis, count) if known is None else check_continuity(name, known, len(b))
            for axis, (known, b) in enumerate(zip(continuity, arrays, strict=True))
        )
        self._set_state(arrays, values, bool(rational), orders, None)

    def _set_state(
        self,
        breaks: tuple[Array, ...],
        coefs: Array,
        rational: bool,
        continuity: tuple[Array, ...],
        source: tuple[Any, ...] | None,
    ) -> None:
        coefs = np.ascontiguousarray(coefs)
        coefs.flags.writeable = False
        for array in breaks:
            array.flags.writeable = False
        orders = []
        for order, size in zip(continuity, coefs.shape, strict=False):
            if len(order):
                order = np.where(order >= size - 1, SMOOTH, order)
                order.flags.writeable = False
            orders.append(order)
        write = object.__setattr__
        write(self, "_breaks", breaks)
        write(self, "_coefs", coefs)
        write(self, "_continuity", tuple(orders))
        write(self, "_rational", rational)
        write(self, "_source", source)

    @classmethod
    def _from_pieces(
        cls,
        breaks: tuple[Array, ...],
        coefs: Array,
        rational: bool,
        continuity: tuple[Array, ...],
        source: tuple[Any, ...] | None = None,
    ) -> Self:
        """Construct without validation; takes over the arrays and freezes them."""
        self = object.__new__(cls)
        self._set_state(breaks, coefs, rational, continuity, source)
        return self

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__} is frozen: {name} cannot be set")

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickle_spline, (type(self), self._breaks, self._coefs, self._rational, self._continuity, self._source)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Spline) or type(other) is not type(self):
            return NotImplemented
        return (
            self._rational == other._rational
            and all(np.array_equal(a, b) for a, b in zip(self._breaks, other._breaks, strict=True))
            and np.array_equal(self._coefs, other._coefs)
        )

    def __hash__(self) -> int:
        return hash((type(self), self._rational, self._coefs.shape, *(float(b[-1]) for b in self._breaks)))

    def __repr__(self) -> str:
        count = self._parameter_count
        degree = " x ".join(str(n - 1) for n in self._coefs.shape[:count])
        pieces = " x ".join(str(n) for n in self._coefs.shape[count + 1 :])
        domain = " x ".join(f"[{b[0]:g}, {b[-1]:g}]" for b in self._breaks)
        kind = "rational " if self._rational else ""
        return f"<{kind}{type(self).__name__} of degree {degree}, dim {self.dim}, {pieces} pieces on {domain}>"

    @property
    def dim(self) -> int:
        """Number of Euclidean components."""
        return int(self._coefs.shape[self._parameter_count]) - self._rational

    @property
    def coefs(self) -> Array:
        """Read-only Bernstein coefficients: degree axes, component (weight last if rational), pieces."""
        return self._coefs

    @property
    def rational(self) -> bool:
        """Whether the coefficients are homogeneous, (w x, w y, .., w)."""
        return self._rational

    # -- parts and alignment

    def _split_weight(self) -> tuple[Array, Array | None]:
        """Numerator and weight coefficients (component axis kept); the weight of a polynomial spline is None."""
        if not self._rational:
            return self._coefs, None
        before = (slice(None),) * self._parameter_count
        return self._coefs[(*before, slice(None, -1))], self._coefs[(*before, slice(-1, None))]

    def _replace_coefs(
        self, numerator: Array, weight: Array | None, continuity: tuple[Array, ...] | None = None
    ) -> Self:
        """Spline on the same breaks from a numerator and a weight of possibly different degrees."""
        continuity = self._continuity if continuity is None else continuity
        if weight is None:
            return self._from_pieces(self._breaks, numerator, False, continuity)
        count = self._parameter_count
        numerator, weight = match_degrees(numerator, weight, count)
        return self._from_pieces(self._breaks, np.concatenate([numerator, weight], axis=count), True, continuity)

    def _replace_axis(self, axis: int, breaks: Array, coefs: Array, continuity: Array) -> Self:
        """Spline with other breaks, and continuity, of one parameter and with the coefficients that go with them."""
        return self._from_pieces(
            replace_item(self._breaks, axis, breaks),
            coefs,
            self._rational,
            replace_item(self._continuity, axis, continuity),
        )

    def _subdivide_at(self, axis: int, breaks: Array) -> Self:
        """Subdivide at `breaks`, which contain the present ones."""
        old = self._breaks[axis]
        if len(breaks) == len(old):
            return self
        ends = breaks[:-1], breaks[1:]
        piece = old[1:-1].searchsorted(ends[0], "right")
        start = old[:-1][piece]
        length = old[1:][piece] - start
        x0, x1 = ((end - start) / length for end in ends)
        coefs = apply_along_axis(
            lambda c: bernstein.restrict_pieces(c.take(piece, axis=-1), x0, x1),
            self._coefs,
            axis,
            self._parameter_count,
        )
        order = np.full(len(breaks) - 2, SMOOTH)
        if len(old) > 2:
            order[breaks.searchsorted(old[1:-1]) - 1] = self._continuity[axis]
        return self._replace_axis(axis, breaks, coefs, order)

    def _snap_and_subdivide(self, axis: int, breaks: Array) -> Self:
        """Snap own breaks to the given ones that they equal to rounding, then subdivide at all given ones."""
        old = self._breaks[axis]
        moved = breaks[np.abs(old[:, None] - breaks).argmin(axis=1)]
        self = self._from_pieces(replace_item(self._breaks, axis, moved), self._coefs, self._rational, self._continuity)
        return self._subdivide_at(axis, breaks)

    def _align_breaks(self, other: Self) -> tuple[Self, Self, tuple[Array, ...]]:
        """Both splines on the union of their breaks, and the lesser continuity, which their sum or product has."""
        first, second = self, other
        for axis, (a, b) in enumerate(zip(self._breaks, other._breaks, strict=True)):
            if a is b or np.array_equal(a, b):
                continue
            slack = 4 * EPSILON * max(abs(a[0]), abs(a[-1]))
            if abs(a[0] - b[0]) > slack or abs(a[-1] - b[-1]) > slack:
                raise InputError(
                    f"the domains [{a[0]:.17g}, {a[-1]:.17g}] and [{b[0]:.17g}, {b[-1]:.17g}] differ: clip one of them"
                )
            breaks = unite_breaks(a, b)
            first, second = first._snap_and_subdivide(axis, breaks), second._snap_and_subdivide(axis, breaks)
        lesser = tuple(np.minimum(c, d) for c, d in zip(first._continuity, second._continuity, strict=True))
        return first, second, lesser

    def _combine_numerators(self, other: Self, join: Callable[[Array, Array], Array]) -> Self:
        """Join aligned numerators on a common denominator and of a common degree."""
        a, b, continuity = self._align_breaks(other)
        (x, v), (y, w) = a._split_weight(), b._split_weight()
        weight: Array | None
        if v is None and w is None:
            weight = None
        elif v is not None and w is not None and v.shape == w.shape and np.array_equal(v, w):
            weight = v
        else:
            weight = a._multiply_weights(v, w)
            x, y = (x if w is None else a._multiply_coefs(x, w)), (y if v is None else a._multiply_coefs(y, v))
        return a._replace_coefs(join(*match_degrees(x, y, self._parameter_count)), weight, continuity)

    def _multiply_coefs(self, a: Array, b: Array) -> Array:
        return bernstein.multiply_polynomials(a, b, self._parameter_count)

    def _multiply_weights(self, v: Array | None, w: Array | None) -> Array | None:
        """Product of two weights, None standing for one."""
        if v is None or w is None:
            return w if v is None else v
        return self._multiply_coefs(v, w)

    def _broadcast_constant(self, value: object) -> Array:
        """Shape a number, or one per component, to broadcast against a numerator."""
        name = type(self).__name__
        if isinstance(value, Spline):
            raise OperandError(f"a {name} and a {type(value).__name__} do not go together")
        try:
            array = to_finite_array("an operand", value)
        except InputError as error:
            raise OperandError(f"a {name} goes with a {name}, a number or {self.dim} numbers: {error}") from error
        if array.ndim > 1 or (array.ndim == 1 and len(array) != self.dim):
            raise OperandError(f"a {name} goes with a {name}, a number or {self.dim} numbers, not {shown(value)}")
        return array.reshape(*(1,) * self._parameter_count, -1, *(1,) * self._parameter_count)

    def _check_same_kind(self, value: object) -> Self:
        """Return another spline of the same kind."""
        if not isinstance(value, type(self)):
            raise OperandError(f"a {type(self).__name__} is needed, not {shown(value)}")
        return value

    # -- algebra

    def __neg__(self) -> Self:
        numerator, weight = self._split_weight()
        return self._replace_coefs(-numerator, weight)

    def __add__(self, other: object) -> Self:
        if isinstance(other, type(self)):
            if self.dim != other.dim:
                raise InputError(f"cannot add splines of dim {self.dim} and {other.dim}")
            return self._combine_numerators(other, np.add)
        vector = self._broadcast_constant(other)
        numerator, weight = self._split_weight()
        return self._replace_coefs(numerator + (vector if weight is None else vector * weight), weight)

    __radd__ = __add__

    def __sub__(self, other: object) -> Self:
        if isinstance(other, type(self)):
            return self + (-other)
        vector = self._broadcast_constant(other)
        return self + (-vector.ravel() if vector.size > 1 else -float(vector.item()))

    def __rsub__(self, other: object) -> Self:
        return (-self) + other

    def __mul__(self, other: object) -> Self:
        if isinstance(other, type(self)):
            if 1 not in (self.dim, other.dim):
                raise InputError(f"cannot multiply splines of dim {self.dim} and {other.dim}: use dot or cross")
            return self._apply_bilinear(other, self._multiply_coefs)
        vector = self._broadcast_constant(other)
        numerator, weight = self._split_weight()
        return self._replace_coefs(numerator * vector, weight)

    __rmul__ = __mul__

    def __truediv__(self, other: object) -> Self:
        vector = self._broadcast_constant(other)
        if not vector.all():
            raise OperandError(f"a {type(self).__name__} cannot be divided by 0")
        numerator, weight = self._split_weight()
        return self._replace_coefs(numerator / vector, weight)

    def _apply_bilinear(self, other: Self, kernel: Callable[[Array, Array], Array]) -> Self:
        a, b, continuity = self._align_breaks(other)
        (x, v), (y, w) = a._split_weight(), b._split_weight()
        return a._replace_coefs(kernel(x, y), a._multiply_weights(v, w), continuity)

    def dot(self, other: Self) -> Self:
        """Scalar product, a spline of dim 1."""
        if self.dim != self._check_same_kind(other).dim:
            raise InputError(f"no scalar product of splines of dim {self.dim} and {other.dim}")
        count = self._parameter_count
        return self._apply_bilinear(other, lambda x, y: self._multiply_coefs(x, y).sum(axis=count, keepdims=True))

    def cross(self, other: Self) -> Self:
        """Vector product: dim 3 for dim 3, and the determinant as dim 1 for dim 2."""
        if self.dim != self._check_same_kind(other).dim or self.dim not in (2, 3):
            raise InputError(f"no vector product of splines of dim {self.dim} and {other.dim}: both need 3, or both 2")
        count = self._parameter_count
        i, j = ([1, 2, 0], [2, 0, 1]) if self.dim == 3 else ([0], [1])

        def cross_coefs(x: Array, y: Array) -> Array:
            plus = self._multiply_coefs(x.take(i, count), y.take(j, count))
            return plus - self._multiply_coefs(x.take(j, count), y.take(i, count))

        return self._apply_bilinear(other, cross_coefs)

    def __getitem__(self, index: int | slice) -> Self:
        """Components: an int gives a spline of dim 1."""
        numerator, weight = self._split_weight()
        try:
            chosen = np.arange(self.dim)[
                index if isinstance(index, slice) else check_integer("an index", index, -99, 99)
            ]
        except (IndexError, TypeError, ValueError) as error:
            raise InputError(f"{shown(index)} chooses none of the {self.dim} components") from error
        chosen = np.atleast_1d(chosen)
        if not len(chosen):
            raise InputError(f"{index} chooses none of the {self.dim} components")
        return self._replace_coefs(numerator.take(chosen, self._parameter_count), weight)

    @classmethod
    def stack(cls, splines: Sequence[Self]) -> Self:
        """One spline with the components of several, in their order.

        Raises
        ------
        InputError
            If there are none, or their domains differ.
        """
        if not isinstance(splines, list | tuple) or not all(isinstance(one, cls) for one in splines):
            raise InputError(f"stack takes a list of {cls.__name__}s, not {shown(splines)}")
        if not splines:
            raise InputError("stack needs at least one spline")
        result = splines[0]
        for other in splines[1:]:
            result = result._combine_numerators(other, lambda x, y: np.concatenate([x, y], axis=cls._parameter_count))
        return result

    def _take_derivative(self, orders: Sequence[int]) -> Self:
        """Mixed partial derivative. For N / w^m the quotient rule keeps (N, w, m): (N' w - m N w') / w^(m+1)."""
        orders = [check_integer("the order of a derivative", order, 0, SPLINE_LIMITS.derivative) for order in orders]
        count = self._parameter_count
        numerator, weight = self._split_weight()
        power = 1
        for axis, order in enumerate(orders):
            lengths = np.diff(self._breaks[axis]).reshape(-1, *(1,) * (count - 1 - axis))

            def differentiate_axis(c: Array, axis: int = axis, lengths: Array = lengths) -> Array:
                return apply_along_axis(bernstein.differentiate_coefs, c, axis, count) / lengths

            for _ in range(order):
                if weight is None:
                    numerator = differentiate_axis(numerator)
                else:
                    left = self._multiply_coefs(differentiate_axis(numerator), weight)
                    right = self._multiply_coefs(numerator, differentiate_axis(weight))
                    numerator = left - power * right
                    power += 1
        continuity = tuple(
            np.where(c >= SMOOTH, SMOOTH, np.maximum(c - order, -1))
            for c, order in zip(self._continuity, orders, strict=True)
        )
        denominator = weight
        for _ in range(power - 1):
            denominator = self._multiply_weights(denominator, weight)
        return self._replace_coefs(numerator, denominator, continuity)

    def _elevate_degrees(self, amounts: Sequence[int]) -> Self:
        most = SPLINE_LIMITS.elevation
        amounts = [check_integer("the amount by which a degree is raised", amount, 0, most) for amount in amounts]
        degrees = [
            n - 1 + amount for n, amount in zip(self._coefs.shape[: self._parameter_count], amounts, strict=True)
        ]
        return self._from_pieces(self._breaks, elevate_to(self._coefs, degrees), self._rational, self._continuity)

    def _reduce_degrees(self, amounts: Sequence[int | None], tolerance: float) -> Self:
        count = self._parameter_count
        coefs = self._coefs
        scale = np.abs(coefs).max()
        tolerance = check_number("tolerance", tolerance)
        for axis, amount in enumerate(amounts):
            degree = self._coefs.shape[axis] - 1
            if amount is not None:
                amount = check_integer(f"the amount by which degree {degree} is reduced", amount, 0, degree)
            start, steps = coefs, range(1, degree + 1) if amount is None else [amount]
            for step in steps:
                lower = apply_along_axis(lambda c, r=step: bernstein.reduce_degree(c, r), start, axis, count)  # type: ignore[misc]
                back = elevate_to(lower, [n - 1 for n in start.shape[:count]])
                error = np.abs(back - start).max()
                if error > tolerance * scale:
                    if amount is None:
                        break
                    raise GeometryError(
                        f"not of degree {degree - step}: reducing changes a coefficient by {error:.3g}, "
                        f"more than {tolerance:g} of the largest, {scale:.3g}"
                    )
                coefs = lower
        return self._from_pieces(self._breaks, coefs, self._rational, self._continuity)

    def bounds(self) -> tuple[Array, Array]:
        """Box around the convex hull of the control points, widened by the rounding of an evaluation.

        Returns
        -------
        lo, hi
            (dim,) each; every value of the spline lies between them.

        Raises
        ------
        GeometryError
            If a weight coefficient is not positive: there is no hull.
        """
        count = self._parameter_count
        numerator, weight = self._split_weight()
        if weight is not None:
            if weight.min() <= 0:
                raise GeometryError(
                    f"no convex hull: a weight coefficient is {weight.min():.3g}; cut the pieces smaller"
                )
            numerator = numerator / weight
        points = np.moveaxis(numerator, count, 0).reshape(self.dim, -1)
        slack = 4 * EPSILON * (1 + sum(self._coefs.shape[:count])) * np.abs(points).max(axis=1)
        return points.min(axis=1) - slack, points.max(axis=1) + slack

    def _clip_axis(self, axis: int, start: float, end: float) -> Self:
        old = self._breaks[axis]
        start, end = check_number("the start of a part", start), check_number("the end of a part", end)
        slack = 4 * EPSILON * max(abs(old[0]), abs(old[-1]))
        if not (old[0] - slack <= start < end <= old[-1] + slack):
            raise InputError(
                f"cannot clip to [{start:.17g}, {end:.17g}]: the domain is [{old[0]:.17g}, {old[-1]:.17g}]"
            )
        distances = np.abs(old[:, None] - (start, end))
        nearest = distances.argmin(axis=0)
        lo, hi = (
            old.item(i) if distances[i, k] <= slack else x
            for k, (i, x) in enumerate(zip(nearest, (start, end), strict=True))
        )
        if lo == hi:
            raise InputError(f"cannot clip to [{start:.17g}, {end:.17g}]: it is empty to rounding")
        i, j = int(old.searchsorted(lo, "right")) - 1, int(old.searchsorted(hi))
        breaks = old[i : j + 1].copy()
        breaks[0], breaks[-1] = lo, hi
        x0, x1 = (lo - old[i]) / (old[i + 1] - old[i]), (hi - old[j - 1]) / (old[j] - old[j - 1])
        coefs = apply_along_axis(
            lambda c: restrict_ends(c[..., i:j].copy(), x0, x1), self._coefs, axis, self._parameter_count
        )
        return self._replace_axis(axis, breaks, coefs, self._continuity[axis][i : j - 1].copy())

    def _insert_breaks(self, axis: int, breaks: ArrayLike) -> Self:
        old = self._breaks[axis]
        new = np.sort(to_finite_array("breaks to cut at", breaks), axis=None)
        new = new[(new > old[0]) & (new < old[-1])]
        new = np.concatenate([new[:1], new[1:][new[1:] > new[:-1]]])
        return self._subdivide_at(axis, unite_breaks(old, new)) if len(new) else self

    def _reverse_axis(self, axis: int) -> Self:
        old = self._breaks[axis]
        coefs = apply_along_axis(lambda c: c[::-1, ..., ::-1], self._coefs, axis, self._parameter_count)
        breaks = old[0] + old[-1] - old[::-1]
        return self._replace_axis(axis, breaks, coefs, self._continuity[axis][::-1].copy())

    def _to_rational(self) -> Self:
        """Give it a weight component, one if it had none."""
        if self._rational:
            return self
        count, shape = self._parameter_count, self._coefs.shape
        one = np.ones((*shape[:count], 1, *shape[count + 1 :]))
        return self._from_pieces(self._breaks, np.concatenate([self._coefs, one], axis=count), True, self._continuity)


def _unpickle_spline(cls: type[Spline], *state: Any) -> Spline:
    return cls._from_pieces(*state)
