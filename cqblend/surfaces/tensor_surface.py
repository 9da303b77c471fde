"""Tensor-product splines as primary surfaces: rails composed patch by patch, and where rails cross knot lines.

Also what surfaces of revolution share with them, one of whose parameters is an angle. Depends on splines and on the
interface in :mod:`cqblend.surfaces.primary_surface` only.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from math import comb, factorial
from typing import Literal

import numpy as np

from cqblend.splines import SMOOTH, Curve, Surface, bernstein, interpolation
from cqblend.splines.bernstein import EPSILON, Array
from cqblend.splines.breaks import align_breaks
from cqblend.splines.evaluation import BreakSide, dehomogenise_derivatives
from cqblend.splines.knot_line_cuts import cut_at_knot_lines
from cqblend.splines.tolerances import SPLINE_TOLERANCES
from cqblend.surfaces.angles import half_angle_velocity, shift_to_period, to_half_angle_pair
from cqblend.surfaces.knot_line_smoothness import expand_patches, measure_shape_continuity
from cqblend.surfaces.patch_evaluation import PatchTable
from cqblend.surfaces.primary_surface import KnotCrossing, Primary
from cqblend.surfaces.tolerances import SURFACE_TOLERANCES


@dataclass(frozen=True, kw_only=True)
class TensorSurface(Primary):
    """A tensor product of Bernstein pieces, in each of whose parameters it is a spline, or a circle.

    Lifted coordinates are one pair for each parameter. Where the parameter is that of a spline they are barycentric:
    (alpha, beta) with u = beta / (alpha + beta), and likewise (gamma, delta) for v. Where it is an angle they are its
    half-angle pair, in which the surface is a single Bernstein piece.
    """

    breaks: tuple[Array, Array]
    """Knot lines of both native parameters, ends included; (0, 1) for an angle."""
    patches: Array
    """Homogeneous Bernstein coefficients (p+1, q+1, 4, nu, nv)."""
    surface: Surface | None = None
    """The spline itself; None where a parameter is an angle."""
    rational: bool = False
    """Whether weights differ from 1 for another reason than an angle."""
    is_angular: tuple[bool, bool] = (False, False)
    """Which native parameters are angles."""
    periods: tuple[float | None, float | None] = (None, None)
    knot_continuity: tuple[Array, Array] = field(default_factory=lambda: (np.empty(0, int), np.empty(0, int)))
    """Continuity at the inner breaks of both parameters."""
    seam_continuity: tuple[int, int] = (0, 0)
    """Continuity with which the surface meets itself in a parameter that has a period, up to 2."""
    levels_weight: bool = False
    """Whether the weight of a rail is made 1 after composing it (`_level_weight`), not by scaling its lifted points."""

    @staticmethod
    def from_spline(
        surface: Surface, closed: tuple[bool, bool] = (False, False), *, level: bool = False
    ) -> SplineSurface:
        """Wrap a spline.

        Parameters
        ----------
        surface
            Of dim 3.
        closed
            In which parameters it goes on periodically past its ends.
        level
            Whether to make the weight of rails 1 after composing them, as for rails whose lifted points are given and
            must not be scaled. It is done in any case where the weight function of the surface has kinks.
        """
        coefs = surface.coefs
        if not surface.rational:
            coefs = np.concatenate([coefs, np.ones_like(coefs[:, :, :1])], axis=2)
        periods = [float(b[-1] - b[0]) if flag else None for b, flag in zip(surface.breaks, closed, strict=True)]
        seams = [_measure_seam_continuity(surface, axis) if closed[axis] else 0 for axis in (0, 1)]
        return SplineSurface(
            breaks=surface.breaks,
            patches=coefs,
            surface=surface,
            rational=surface.rational,
            periods=(periods[0], periods[1]),
            knot_continuity=surface.continuity,
            seam_continuity=(seams[0], seams[1]),
            levels_weight=level or (surface.rational and has_weight_kinks(surface.continuity)),
        )

    @abstractmethod
    def evaluate_weights(self, uv: Array) -> tuple[Array, Array]:
        """Return the weight w (n,) that lifted points of scale 1 have, and its derivatives (wu, wv), (n, 2)."""

    @abstractmethod
    def differentiate_beside_knot(self, uv: Array, axis: int, order: int, side: BreakSide) -> Array:
        """Return the derivative by a native parameter on one side of a knot line, (n, 3); in the frame of a profile."""

    @property
    def degrees(self) -> tuple[int, int]:
        """The degrees (p, q)."""
        return self.patches.shape[0] - 1, self.patches.shape[1] - 1

    def has_exact_pcurves(self) -> bool:
        return not any(self.is_angular)

    def inner_knot_lines(self, axis: int) -> Array:
        return self.breaks[axis][1:-1]

    def wrap_parameters(self, uv: Array) -> Array:
        """Shift native parameters (n, 2) into the domain along periodic directions."""
        if self.periods == (None, None):
            return uv
        out = uv.copy()
        for axis, period in enumerate(self.periods):
            if period is not None and not self.is_angular[axis]:
                start = self.breaks[axis][0]
                out[:, axis] = start + np.mod(uv[:, axis] - start, period)
        return out

    def _lift_parameter(self, value: Array, axis: int) -> Array:
        return to_half_angle_pair(value) if self.is_angular[axis] else np.stack([1 - value, value], -1)

    def lift_points(self, uv: Array) -> Array:
        scale = self.evaluate_weights(uv)[0] ** (-1 / sum(self.degrees))
        return (
            np.concatenate([self._lift_parameter(uv[:, 0], 0), self._lift_parameter(uv[:, 1], 1)], 1) * scale[:, None]
        )

    def lift_directions(self, uv: Array, c: Array, rs: Array) -> Array:
        weight, slope = self.evaluate_weights(uv)
        out = c * (-(rs * slope).sum(1) / weight / sum(self.degrees))[:, None]
        for axis in (0, 1):
            pair = c[:, 2 * axis : 2 * axis + 2]
            if self.is_angular[axis]:
                rate = half_angle_velocity(pair, rs[:, axis])
            else:
                rate = (rs[:, axis] * pair.sum(1))[:, None] * np.array([-1.0, 1.0])
            out[:, 2 * axis : 2 * axis + 2] += rate
        return out

    @property
    def weight_exponents(self) -> Array:
        if self.is_angular[0]:
            return np.array([0.5, 0.5, 0.0, 0.0])
        return np.full(4, 1 / sum(self.degrees))

    def unlift_points(self, c: Array, near: Array) -> Array:
        out = np.empty((len(c), 2))
        for axis in (0, 1):
            x, y = c[:, 2 * axis], c[:, 2 * axis + 1]
            if self.is_angular[axis]:
                out[:, axis] = shift_to_period(2 * np.arctan2(y, x), near[:, axis], 2 * np.pi)
            else:
                out[:, axis] = y / (x + y)
        return out

    def unlift_directions(self, c: Array, d: Array) -> Array:
        out = np.empty((len(c), 2))
        for axis in (0, 1):
            x, y, dx, dy = c[:, 2 * axis], c[:, 2 * axis + 1], d[:, 2 * axis], d[:, 2 * axis + 1]
            if self.is_angular[axis]:
                out[:, axis] = 2 * (x * dy - y * dx) / (x * x + y * y)
            else:
                out[:, axis] = (x * dy - y * dx) / (x + y) ** 2
        return out

    def compose_jets(self, c: Curve, directions: Sequence[Curve], order: int | None = None) -> tuple[Curve, ...]:
        order = len(directions) if order is None else order
        c, *rest = align_breaks([c, *directions], SPLINE_TOLERANCES.same_break)
        c, patches, spans, crossed = self._cut_at_knots(c)
        phi = [c, *(d.cut(c.breaks[1:-1]) for d in rest)]
        pairs = [self._localise_pairs(x, spans) for x in phi]
        none = [np.zeros((1, len(c.breaks) - 1))] * (order + 1 - len(phi))
        series = [[pair[i] / factorial(k) for k, pair in enumerate(pairs)] + none for i in range(4)]
        jets = []
        for k, coefs in enumerate(bernstein.compose_series(patches, *series)):
            continuity = np.min([*(x.continuity for x in phi[: k + 1]), crossed - k], axis=0)
            jets.append(Curve(c.breaks, factorial(k) * coefs, continuity=np.maximum(continuity, 0)))
        return _level_weight(jets) if self.levels_weight else tuple(jets)

    def compose_normal(self, c: Curve) -> Curve:
        c, patches, spans, _ = self._cut_at_knots(c)
        centre = patches[:, :, :3].mean(axis=(0, 1)) / patches[:, :, 3].mean(axis=(0, 1))
        patches = np.concatenate([patches[:, :, :3] - centre * patches[:, :, 3:], patches[:, :, 3:]], axis=2)
        pairs = self._localise_pairs(c, spans)
        su, sv = (self._compose_partial(patches, pairs, axis, c.breaks) for axis in (0, 1))
        normal = su[:3].cross(sv[:3])
        if not self.rational:
            return normal
        s = Curve(c.breaks, bernstein.compose_patch(patches, *pairs))
        return normal * s[3] + sv[:3].cross(s[:3]) * su[3] + s[:3].cross(su[:3]) * sv[3]

    def _compose_partial(
        self, patches: Array, pairs: tuple[Array, Array, Array, Array], axis: int, breaks: Array
    ) -> Curve:
        """Return the derivative of P by a native parameter along a rail, up to a positive factor."""
        p = patches.shape[axis] - 1
        first, last = (patches.take(range(i, i + p), axis) for i in (0, 1))
        if not self.is_angular[axis]:
            return Curve(breaks, bernstein.compose_patch(last - first, *pairs))
        a, b = (pair[:, None] for pair in pairs[2 * axis : 2 * axis + 2])
        turned = [bernstein.compose_patch(part, *pairs) for part in (first, last)]
        return Curve(
            breaks, bernstein.multiply_polynomials(a, turned[1]) - bernstein.multiply_polynomials(b, turned[0])
        )

    def _list_crossable_lines(self, c: Curve, axis: int) -> tuple[Array, Array]:
        """Return the knot values of all periods that a rail spans, ends included, and the continuity at inner ones."""
        breaks, orders = self.breaks[axis], np.asarray(self.knot_continuity[axis])
        period = self.periods[axis]
        if period is None:
            return breaks, orders
        pair = c.coefs[:, 2 * axis : 2 * axis + 2]
        value = pair[:, 1] / pair.sum(1)
        first, last = (int(np.floor((x - breaks[0]) / period)) for x in (value.min(), value.max()))
        laps = range(first, last + 1)  # numbers of the periods
        lines = np.concatenate([breaks[:-1] + lap * period for lap in laps] + [breaks[-1:] + last * period])
        seam = [self.seam_continuity[axis]]
        return lines, np.concatenate([orders, *([*seam, *orders] for _ in laps[1:])])

    def _trace_knot_crossings(self, c: Curve, axis: int, highest_continuity: int) -> tuple[Array, Array]:
        """Return where (n,) a lifted rail crosses knot lines of one native parameter, and the points there, (n, 2).

        Only lines of at most that continuity count.
        """
        nothing = np.empty(0), np.empty((0, 2))
        if self.is_angular[axis]:
            return nothing
        lines, orders = self._list_crossable_lines(c, axis)
        if not (orders <= highest_continuity).any():
            return nothing
        x, y = c.coefs[:, 2 * axis], c.coefs[:, 2 * axis + 1]
        cut, (index,), _ = cut_at_knot_lines(Curve(c.breaks, np.stack([y, x + y], 1), rational=True), [lines], [orders])
        steps = [
            (j, i) for j in np.flatnonzero(np.diff(index)).tolist() for i in _lines_between(index[j], index[j + 1])
        ]
        steps = [(j, i) for j, i in steps if orders[i - 1] <= highest_continuity]
        if not steps:
            return nothing
        piece, line = np.array(steps).T
        t = cut.breaks[piece + 1]
        uv = self.unlift_points(c(t), np.zeros((len(t), 2)))
        uv[:, axis] = lines[line]
        return t, uv

    def locate_knot_crossings(self, c: Curve, highest_continuity: int) -> Array:
        """Return where (n,) a lifted rail crosses knot lines at points of at most this continuity."""
        found = []
        for axis in (0, 1):
            t, uv = self._trace_knot_crossings(c, axis, highest_continuity)
            if len(t):
                found.append(t[self._measure_continuity(self._snap_to_knots(uv, axis), axis) <= highest_continuity])
        return np.sort(np.concatenate(found)) if found else np.empty(0)

    def find_knot_crossings(self, c: Curve, highest_continuity: int) -> list[KnotCrossing]:
        found = []
        for axis in (0, 1):
            t, uv = self._trace_knot_crossings(c, axis, highest_continuity)
            if len(t):
                smooth, shape, crease = self.measure_smoothness(uv, axis)
                axes, values = [axis] * len(t), uv[:, axis].tolist()
                found += [
                    KnotCrossing(*fields)
                    for fields in zip(t.tolist(), axes, values, smooth, shape, crease, strict=True)
                ]
        return sorted(crossing for crossing in found if crossing.continuity <= highest_continuity)

    def _snap_to_knots(self, uv: Array, axis: int) -> Array:
        """Return points (n, 2) of knot lines in the domain, exactly on the lines."""
        uv, breaks = self.wrap_parameters(uv).copy(), self.breaks[axis]
        uv[:, axis] = breaks[np.abs(uv[:, axis, None] - breaks).argmin(axis=1)]
        return uv

    def measure_smoothness(self, uv: Array, axis: int) -> tuple[list[int], list[int], list[float]]:
        """Measure the continuity of the surface at points of knot lines, up to 4.

        The surface may be smoother at a point than it is along the whole line, and its shape smoother than its
        parametrisation.

        Parameters
        ----------
        uv
            (n, 2) native parameters of the points.
        axis
            Which native parameter is constant along the knot lines.

        Returns
        -------
        continuity, shape_continuity, creases
            Of n each: the continuity of the parametrisation, that of the shape, and the angle by which the normal
            turns, rad.
        """
        uv = self._snap_to_knots(uv, axis)
        continuity = self._measure_continuity(uv, axis)
        before, after = (self._expand_beside_knot(uv, axis, step) for step in (-1, 0))
        rounding = SURFACE_TOLERANCES.derivative_jump * float(np.abs(self.patches).max())
        shape, crease = measure_shape_continuity(before, after, axis, rounding)
        return continuity.tolist(), np.maximum(shape, continuity).tolist(), crease.tolist()

    def _expand_beside_knot(self, uv: Array, axis: int, step: int) -> Array:
        """Return Taylor series at points (n, 2) of knot lines, of the patches before (step -1) or after (0) them."""
        index, pairs, rates = [], [], []
        for k in (0, 1):
            value, breaks, ones = uv[:, k], self.breaks[k], np.ones(len(uv))
            if self.is_angular[k]:
                index.append(np.zeros(len(uv), int))
                pairs.append(to_half_angle_pair(value).T)
                rates.append(half_angle_velocity(pairs[k].T, ones).T)
                continue
            if k == axis:
                index.append((np.searchsorted(breaks, value) + step) % (len(breaks) - 1))
                x = -float(step) * ones
            else:
                index.append(np.clip(np.searchsorted(breaks, value, "right") - 1, 0, len(breaks) - 2))
                x = (value - breaks[index[k]]) / np.diff(breaks)[index[k]]
            pairs.append(np.stack([1 - x, x]))
            rates.append(np.stack([-ones, ones]))
        return expand_patches(self.patches[..., index[0], index[1]], (pairs[0], pairs[1]), (rates[0], rates[1]))

    def _measure_continuity(self, uv: Array, axis: int) -> Array:
        """Return the order of continuity of the parametrisation, (n,), at points (n, 2) of knot lines."""
        before, after = uv.copy(), uv.copy()
        start, end = self.breaks[axis][[0, -1]]
        if self.periods[axis] is not None:
            from_end = np.minimum(after[:, axis] - start, end - after[:, axis])
            seam = from_end < SURFACE_TOLERANCES.seam_parameter * (end - start)
            after[seam, axis], before[seam, axis] = start, end
        span, size = np.diff(self.breaks[axis]).min(), np.abs(self.patches).max()
        smooth = np.full(len(uv), 4)
        for k in range(4, 0, -1):
            jump = self.differentiate_beside_knot(after, axis, k, "right")
            jump = jump - self.differentiate_beside_knot(before, axis, k, "left")
            smooth[np.abs(jump).max(axis=1) * span**k > SURFACE_TOLERANCES.derivative_jump * size] = k - 1
        return smooth

    def _cut_at_knots(self, c: Curve) -> tuple[Curve, Array, list[tuple[Array, Array] | None], Array]:
        """Cut a lifted rail at the knot lines that it crosses.

        Returns
        -------
        c, patches, spans, crossed
            The rail, in n pieces; the patch under each piece, (p+1, q+1, 4, n); for each native parameter the interval
            of knots, two (n,), in which each piece lies, None for an angle; and the surface's continuity, (n - 1,),
            where the rail passes from piece to piece.
        """
        axes = [axis for axis in (0, 1) if not self.is_angular[axis]]
        if not axes:
            count = len(c.breaks) - 1
            return c, np.repeat(self.patches[..., 0], count, axis=-1), [None, None], np.full(count - 1, SMOOTH)
        lines, orders = zip(*(self._list_crossable_lines(c, axis) for axis in axes), strict=True)
        weight = c.coefs[:, 2 * axes[0] : 2 * axes[0] + 2].sum(1)
        plain = np.stack([*(c.coefs[:, 2 * axis + 1] for axis in axes), weight], 1)
        bare = Curve(c.breaks, plain, rational=True, continuity=np.full(len(c.breaks) - 2, SMOOTH))
        cut, found, crossed = cut_at_knot_lines(bare, lines, orders, 0.0)
        c = c.cut(cut.breaks[1:-1])
        index = [np.zeros(len(c.breaks) - 1, int), np.zeros(len(c.breaks) - 1, int)]
        spans: list[tuple[Array, Array] | None] = [None, None]
        for axis, line, at in zip(axes, lines, found, strict=True):
            spans[axis] = line[at], line[at + 1]
            index[axis] = at % (len(self.breaks[axis]) - 1)
        return c, self.patches[..., index[0], index[1]], spans, crossed

    def _localise_pairs(self, c: Curve, spans: list[tuple[Array, Array] | None]) -> tuple[Array, Array, Array, Array]:
        """Return lifted points or directions as barycentric pairs of each piece's own patch, four (m+1, n).

        Pairs that are constant on all pieces have degree 0, which keeps isoparametric rails at the degree they have.
        """
        pairs = []
        for axis, span in enumerate(spans):
            pair = c.coefs[:, 2 * axis : 2 * axis + 2]
            if np.ptp(pair, axis=0).max() <= 16 * EPSILON * np.abs(pair).max():
                pair = pair.mean(axis=0, keepdims=True)
            x, y = pair[:, 0], pair[:, 1]
            if span is None:
                pairs += [x, y]
            else:
                low, high = span
                pairs += [(high * (x + y) - y) / (high - low), (y - low * (x + y)) / (high - low)]
        return pairs[0], pairs[1], pairs[2], pairs[3]


@dataclass(frozen=True, kw_only=True)
class SplineSurface(TensorSurface):
    """A spline surface in both of its parameters."""

    surface: Surface = field()

    @cached_property
    def _table(self) -> PatchTable:
        return PatchTable.from_patches(self.breaks, self.patches, rational=self.rational)

    def jet(self, uv: Array) -> Array:
        return self._table.evaluate_jet(self.wrap_parameters(uv))

    def evaluate_weights(self, uv: Array) -> tuple[Array, Array]:
        if not self.rational or self.levels_weight:
            return np.ones(len(uv)), np.zeros((len(uv), 2))
        weights = self._table.evaluate_homogeneous(self.wrap_parameters(uv))[:, :, 3]
        return weights[0], weights[1:3].T

    def differentiate_beside_knot(self, uv: Array, axis: int, order: int, side: BreakSide) -> Array:
        orders = (order, 0) if axis == 0 else (0, order)
        return self.surface(uv[:, 0], uv[:, 1], *orders, side=side)


def _lines_between(first: int, second: int) -> range:
    """Return the indices of the lines that separate two intervals, given by their indices in either order."""
    return range(min(first, second) + 1, max(first, second) + 1)


def has_weight_kinks(orders: Sequence[Array]) -> bool:
    """Whether a rational spline is less than C2 at a break: its weight may have kinks that its shape has not."""
    return any((np.asarray(order) < 2).any() for order in orders)


def _level_weight(jets: Sequence[Curve]) -> tuple[Curve, ...]:
    """Multiply homogeneous jets of a ribbon by a scalar spline lambda(t, v) that makes their weight 1 at breaks.

    Parameters
    ----------
    jets
        By order in v: homogeneous curves of dim 4, the weight last.

    Returns
    -------
    tuple of Curve
        The same points and derivatives in space; at breaks the weight is 1 and its derivatives are 0. Where the weight
        function of the surface has kinks, homogeneous jets so become as smooth as those in space are, although only
        C0 is claimed.

    Notes
    -----
    At breaks lambda is 1/w, to the order of the jets in v and to first order in t (second for jets of order 2 or more);
    between breaks it is a Hermite interpolant.
    """
    breaks, smooth = jets[0].breaks, 1 if len(jets) < 3 else 2

    def evaluate_end_weights(curve: Curve) -> Array:
        first, last = curve.jet(breaks[:-1], smooth, side="right"), curve.jet(breaks[1:], smooth, side="left")
        return np.stack([first, last], axis=-2)[..., 3]

    weight = np.stack([evaluate_end_weights(jet) for jet in jets], axis=1)  # (smooth+1, order+1, n, 2)
    one = np.zeros_like(weight)
    one[0, 0] = 1
    inverse = dehomogenise_derivatives(np.stack([one, weight], axis=2))[:, :, 0]
    factors = [interpolation.hermite(breaks, inverse[:, k, ..., None]) for k in range(len(jets))]
    level = np.zeros(len(breaks) - 2, int)
    result = []
    for k in range(len(jets)):
        terms = [comb(k, i) * bernstein.multiply_polynomials(factors[i].coefs, jets[k - i].coefs) for i in range(k + 1)]
        degree = max(map(len, terms))
        rows = sum(bernstein.elevate_degree(term, degree - len(term)) for term in terms)
        result.append(Curve(breaks, rows, continuity=level))
    return tuple(result)


def _measure_seam_continuity(surface: Surface, axis: int) -> int:
    """Return the order of continuity, up to 2, with which a surface that is closed in a parameter meets itself."""
    low, high = surface.domain[axis]
    other = np.linspace(*surface.domain[1 - axis], 17)
    size = float(np.abs(surface.coefs).max())

    def evaluate_boundary_row(at: float, k: int, side: Literal["left", "right"]) -> Array:
        here = np.full(17, at)
        if axis == 0:
            return surface(here, other, k, 0, side=side)
        return surface(other, here, 0, k, side=side)

    for k in (1, 2):
        jump = np.abs(evaluate_boundary_row(low, k, "right") - evaluate_boundary_row(high, k, "left")).max()
        if jump * (high - low) ** k > SURFACE_TOLERANCES.seam_jump * size:
            return k - 1
    return 2
