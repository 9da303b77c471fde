r"""What the coefficients of a finished blend prove: bounds that hold along the whole rail, not at samples of it.

Along one of its two boundaries a blend H(t, v) has the rows of poles X, V, W: the homogeneous H, H_v and H_vv there.
The primary gives, for the same t, the jets P(c), DP d, .. of the ribbon and a normal N of its tangent plane, worked out
on a way of its own (:meth:`cqblend.blends.primaries.Primary.normal`). Everything below is made of polynomials in t on
every piece, formed by exact products and bounded by the hull of their coefficients. With D = H(t, 0) - S(c(t)),
a = H_t and b = H_v in space, n = N/|N|, theta the angle between a and b, A = |n.a|/|a| and B = |n.b|/|b|:

*Gap.* D = (X w_S - P w_H)/(w_H w_S): the hull of the numerator over the least weights.

*Angle.* The blend's normal m = a x b has the part n x m = a (n.b) - b (n.a) in the primary's plane, so the angle phi
between the tangent planes of H at (t, 0) and of S at c(t) satisfies

.. math:: \sin^2 \varphi = \frac{|a\,(n \cdot b) - b\,(n \cdot a)|^2}{|a \times b|^2}
          \le \frac{A^2 + B^2 + 2 A B\, |\cos\theta|}{\sin^2\theta}

B is the determinant det[P, Pu, Pv, Hv] of Kim and Elber (section 2) over the lengths of what it is made of. A comes
from the rail: S(c)' is tangent, so n.a = n.D'. In an exact blend D is the rounding of poles, and D' is that rounding
over the length of a piece, which on short pieces says nothing of the shape. So on pieces where |D| is proven to be
below ``ROUNDING`` times the largest coordinate, the bound is that of the surface H(t, v) - D(t), which is nowhere
farther from H than that and has S(c) for its boundary: there a = S(c)' and A = 0. On all other pieces it is that of H.

*Jump of the normal curvature.* Let T and K be the first and second v-jet of the ribbon in space, q = b - T what the
final surface has beside the ribbon's direction, and II the primary's second fundamental form. The ribbon's map
(t, v) -> S(c + v d + v^2/2 e) parametrises the primary, so

.. math:: II(C', C') = n \cdot C'', \quad II(C', T) = n \cdot T', \quad II(T, T) = n \cdot K

are quotients of splines again. The normal curvature of H along b is m.H_vv/(|m| |b|^2). That of S along the projection
of b, which is T + q less its part along n, is II(T + q, T + q)/(|b|^2 (1 - B^2)). They differ by at most

.. math:: \Delta = \frac{|n \cdot (H_{vv} - K)| + 2\, |II(T, q)| + |II(q, q)| + (\varphi + B^2)\, |H_{vv}|}
          {|b|^2\, (1 - B^2)}

with q = x C' + y T + z n, |x| <= |q|/(|C'| sin), |y| <= |q|/(|T| sin), sin that of the angle between C' and T. Where
the surfaces are tangent along the rail, their forms differ by a multiple of the squared component across it. So the
jump is largest at right angles to the rail, and this is what is stated: Delta/sin^2 theta.

The rounding of what is computed here is carried along as a bound on the error of the coefficients, product by product;
P, its jets and N enter with ``COMPOSED`` of error. The blend's own coefficients count as exact. Positions are taken
from a point of each piece (x - x_0 w), so that products do not lose what coordinates far from the origin would.

This module must not know how blends are made, and believes nothing of what they were meant to be.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from cqblend.blends.primaries import Array
from cqblend.blends.ribbons import Ribbon
from cqblend.splines import Curve, Surface, bernstein
from cqblend.splines.spline import union

if TYPE_CHECKING:
    from cqblend.blends.hermite import Blend

EPS = float(np.finfo(float).eps)
ROUNDING = 2.0**-46  # of the largest coordinate, 1.4e-14: a rail nearer than that to the exact one is the exact one
COMPOSED = 16 * EPS  # error of P(c) and its like, relative to the largest coefficient of a piece
RATIO = 1.25  # how much larger than a value that is taken a bound may be; pieces are halved until it is
HALVINGS = 12


@dataclass(frozen=True, slots=True)
class Proof:
    """What is proven of how a blend meets a surface, for every point of the rail.

    Attributes
    ----------
    gap : float
        Distance between H(t, 0) and S(c(t)), at most, mm.
    angle : float
        Angle between the tangent planes there, at most, rad; pi/2 where nothing is proven.
    curvature_jump : float or None
        Difference of the normal curvatures at right angles to the rail, at most, 1/mm; None below G2.

    Examples
    --------
    >>> print(Proof(2e-16, 3.1e-15))
    proven for the whole rail: gap <= 2.0e-16 mm, angle <= 3.1e-15 rad
    """

    gap: float
    angle: float
    curvature_jump: float | None = None

    def __or__(self, other: Proof) -> Proof:
        """Return what is proven of two rails: the larger bounds."""
        jumps = [proof.curvature_jump for proof in (self, other) if proof.curvature_jump is not None]
        return Proof(max(self.gap, other.gap), max(self.angle, other.angle), max(jumps, default=None))

    def __str__(self) -> str:
        jump = "" if self.curvature_jump is None else f", curvature jump <= {self.curvature_jump:.1e} 1/mm"
        return f"proven for the whole rail: gap <= {self.gap:.1e} mm, angle <= {self.angle:.1e} rad{jump}"


def prove(blend: Blend) -> Proof:
    """Prove how a blend meets both of its surfaces: the larger bounds of the two rails.

    The proof is about the B-spline that the blend leaves as, with its knots.

    Raises
    ------
    InputError
        If the surface and a ribbon have different domains.
    """
    surface = Surface.from_bspline(*blend.surface.to_bspline())
    first, second = blend.ribbons
    return prove_side(surface, 0, first) | prove_side(surface, 1, second)


def prove_side(surface: Surface, end: Literal[0, 1], ribbon: Ribbon, order: int | None = None) -> Proof:
    """Prove how a surface meets the primary of a ribbon along its boundary v = first (``end`` 0) or last (1).

    Parameters
    ----------
    surface
        H(t, v), with the domain of the ribbon in t.
    end
        Which boundary.
    ribbon
        What it is to meet; its directions say which ones the boundary runs across in, and matter from order 2 on.
    order
        0 for the gap and the angle alone, 2 for the jump of curvature as well; by default that of the ribbon.

    Raises
    ------
    InputError
        If the surface and the ribbon have different domains.
    """
    order = ribbon.order if order is None else order
    side = _Side(surface, end, ribbon, 2 if order >= 2 else 1)
    gap = side.gap()
    angle = float(np.arcsin(min(1.0, side.sine())))
    return Proof(gap, angle, side.curvature_jump(angle) if order >= 2 else None)


# -- polynomials with an error


class _Poly(NamedTuple):
    """Bernstein coefficients (p+1, dim, n), and by how much those of each piece may be off (n,)."""

    coefs: Array
    error: Array

    @property
    def size(self) -> Array:
        """Largest absolute coefficient of each piece, (n,)."""
        return np.abs(self.coefs).max(axis=(0, 1))

    def pick(self, *components: int) -> _Poly:
        """Take components, in the given order."""
        return _Poly(self.coefs[:, list(components)], self.error)

    def at(self, pieces: Array) -> _Poly:
        """Take pieces, (n,) bool."""
        return _Poly(self.coefs[..., pieces], self.error[pieces])

    def elevated(self, amount: int) -> _Poly:
        """Raise the degree."""
        if not amount:
            return self
        return _Poly(bernstein.elevate(self.coefs, amount), self.error + EPS * (amount + 8) * self.size)

    def __mul__(self, other: _Poly) -> _Poly:  # type: ignore[override]
        """Multiply component by component; a scalar with each."""
        x, y = self.size, other.size
        rounding = EPS * (min(len(self.coefs), len(other.coefs)) + 8)
        error = rounding * x * y + x * other.error + self.error * y + self.error * other.error
        return _Poly(bernstein.product(self.coefs, other.coefs), error)

    def __sub__(self, other: _Poly) -> _Poly:
        degree = max(len(self.coefs), len(other.coefs))
        x, y = (poly.elevated(degree - len(poly.coefs)) for poly in (self, other))
        return _Poly(x.coefs - y.coefs, x.error + y.error + EPS * (x.size + y.size))

    def dot(self, other: _Poly) -> _Poly:
        """Scalar product."""
        terms = self * other
        return _Poly(terms.coefs.sum(axis=1, keepdims=True), terms.coefs.shape[1] * (terms.error + EPS * terms.size))

    def cross(self, other: _Poly) -> _Poly:
        """Vector product."""
        return self.pick(1, 2, 0) * other.pick(2, 0, 1) - self.pick(2, 0, 1) * other.pick(1, 2, 0)

    def halves(self) -> _Poly:
        """Both halves of every piece, the left ones first."""
        n = len(self.error)
        x0, x1 = np.repeat([0.0, 0.5], n), np.repeat([0.5, 1.0], n)
        error = self.error + EPS * len(self.coefs) * self.size
        return _Poly(bernstein.restrict(np.tile(self.coefs, 2), x0, x1), np.tile(error, 2))

    def norms(self) -> tuple[Array, Array]:
        """Bound the norm on each piece, (n,) from below, along the mean direction, and (n,) from above, by the hull."""
        slack = np.sqrt(self.coefs.shape[1]) * self.error * (1 + 16 * EPS)
        lengths = np.linalg.norm(self.coefs, axis=1)
        mean = self.coefs.mean(axis=0)
        length = np.linalg.norm(mean, axis=0)
        mean = np.divide(mean, length, out=np.zeros_like(mean), where=length > 0)
        low = (self.coefs * mean).sum(axis=1).min(axis=0) * (1 - 16 * EPS) - slack
        return np.maximum(low, 0.0), lengths.max(axis=0) * (1 + 16 * EPS) + slack

    def ends(self) -> tuple[Array, Array]:
        """Bound the norm at both ends of each piece, (2, n) from below and from above."""
        slack = np.sqrt(self.coefs.shape[1]) * self.error
        lengths = np.linalg.norm(self.coefs[[0, -1]], axis=1)
        return np.maximum(lengths - slack, 0.0), lengths + slack


class _Row(NamedTuple):
    """A homogeneous curve (xyz, w), its positions taken from a point of each piece."""

    xyz: _Poly
    w: _Poly

    def over(self, base: _Row) -> _Poly:
        """Return what a jet is in space, times the square of the weight: Y w - X Y_w, for a base (X, w)."""
        return self.xyz * base.w - base.xyz * self.w


def _weight(coefs: Array, error: Array) -> _Poly:
    """Return a weight; one that is constant to rounding, as a constant."""
    middle = coefs.mean(axis=0, keepdims=True)
    spread = np.abs(coefs - middle).max(axis=(0, 1))
    if np.all(spread <= 64 * EPS * np.maximum(np.abs(middle[0, 0]), 1.0)):
        return _Poly(middle, error + spread)
    return _Poly(coefs, error)


def _sizes(curve: Curve) -> Array:
    """Largest absolute coefficient of each piece, (n,)."""
    return np.abs(curve.coefs).max(axis=(0, 1))


# -- one boundary


class _Side:
    """The rows of a surface along one boundary and the jets of its ribbon, on common pieces."""

    def __init__(self, surface: Surface, end: Literal[0, 1], ribbon: Ribbon, order: int) -> None:
        rows = _rows(surface, end, order)
        jets = ribbon.primary.jets(ribbon.c, ribbon.directions, order)
        normal = ribbon.primary.normal(ribbon.c)
        self.breaks = union(union(rows[0].breaks, jets[0].breaks), normal.breaks)
        boundary, _ = self._cut(rows[0])
        self.origin = boundary[:, :3].mean(axis=0) / boundary[:, 3].mean(axis=0)
        self.reach = np.abs(boundary[:, :3]).max(axis=(0, 1)) / boundary[:, 3].min(axis=0)

        self.n = _Poly(*self._cut(normal, COMPOSED * _sizes(normal)))
        self.x, self.v, *self.vv = (self._row(row) for row in rows)
        self.jets = jets
        self.p, self.t, *self.k = (self._derived(jet, 0) for jet in jets)
        # differentiated before they are cut: a piece of rounding's length has no difference quotients
        self.x_t = self._row(rows[0].derivative())
        self.p_t = self._derived(jets[0], 1)

        self.b = self.v.over(self.x)
        numerator, weights = self.x.over(self.p), self.x.w * self.p.w
        gap, least = numerator.norms()[1], weights.norms()[0]
        same = gap <= ROUNDING * self.reach * least
        self.distance = numerator, weights
        self.a = _chosen(same, self.p_t.over(self.p), self.x_t.over(self.x))
        na = self.n.dot(self.a)
        self.na = _Poly(np.where(same, 0.0, na.coefs), np.where(same, 0.0, na.error))

    def _cut(self, curve: Curve, error: Array | None = None) -> tuple[Array, Array]:
        """Cut a curve on the common breaks; the coefficients of its own pieces may be off by ``error``."""
        cut = curve.cut(self.breaks)
        own = np.searchsorted(curve.breaks, (cut.breaks[:-1] + cut.breaks[1:]) / 2) - 1
        known = 0.0 if error is None else error[own]
        rounding = 2 * EPS * (curve.degree + 1) if len(cut.breaks) > len(curve.breaks) else 0.0
        return cut.coefs, known + rounding * _sizes(curve)[own]

    def _row(self, curve: Curve, error: Array | None = None) -> _Row:
        coefs, known = self._cut(curve, error)
        w = coefs[:, 3:]
        shift = self.origin * w
        moved = known + 2 * EPS * np.abs(shift).max(axis=(0, 1))
        return _Row(_Poly(coefs[:, :3] - shift, moved), _weight(w, known))

    def _derived(self, jet: Curve, k: int) -> _Row:
        """Return the k-th derivative along the rail of a jet of the primary."""
        return self._row(jet.derivative(k), COMPOSED * _sizes(jet) * (2 * jet.degree / np.diff(jet.breaks)) ** k)

    def gap(self) -> float:
        """Bound |H(t, 0) - S(c(t))|."""
        return _largest(self.distance, lambda low, high: high[0] / low[1])

    def sine(self) -> float:
        """Bound the sine of the angle between the tangent planes."""
        return _largest((self.n, self.a, self.b, self.a.cross(self.b), self.na, self.n.dot(self.b)), _sine)

    def curvature_jump(self, angle: float) -> float:
        """Bound the jump of the normal curvature at right angles to the rail, given the angle between the planes."""
        (h,), (k,) = ([row.over(base) for row in rows] for rows, base in ((self.vv, self.x), (self.k, self.p)))
        c, t = self.p_t.over(self.p), self.t.over(self.p)
        w, s = self.x.w * self.x.w, self.p.w * self.p.w
        q = self.b * s - t * w
        polys = (
            self.n,
            w,
            s,
            self.v.w,
            self.x.w,
            self.b,
            h,
            q,
            c,
            t,
            self.a,
            self.a.cross(self.b),
            c.cross(t),
            self.n.dot(self.b),
            self.n.dot(h * s - k * w),
            self.n.dot(self._derived(self.jets[0], 2).over(self.p)),
            self.n.dot(self._derived(self.jets[1], 1).over(self.p)),
            self.n.dot(k),
        )
        return _largest(polys, lambda low, high: _jump(low, high, angle))


def _rows(surface: Surface, end: Literal[0, 1], order: int) -> list[Curve]:
    """Return H, H_v, .. along a boundary, v running into the surface, as homogeneous curves (dim 4)."""
    coefs = surface.coefs[..., -end]
    if not surface.rational:
        coefs = np.concatenate([coefs, np.ones_like(coefs[:, :, :1])], axis=2)
    across = np.moveaxis(coefs[:, ::-1] if end else coefs, 1, 0)
    length = np.diff(surface.breaks[1])[-end]
    rows = []
    for _ in range(order + 1):
        rows.append(Curve(surface.breaks[0], across[0], continuity=surface.continuity[0]))
        across = bernstein.derivative(across) / length
    return rows


def _chosen(which: Array, first: _Poly, second: _Poly) -> _Poly:
    """Take the pieces of one polynomial where told, and of another elsewhere."""
    degree = max(len(first.coefs), len(second.coefs))
    x, y = (poly.elevated(degree - len(poly.coefs)) for poly in (first, second))
    return _Poly(np.where(which, x.coefs, y.coefs), np.where(which, x.error, y.error))


# -- bounds


def _largest(polys: Sequence[_Poly], quantity: Callable[[Array, Array], Array]) -> float:
    """Bound a quantity that depends on the norms of polynomials: from above, and within ``RATIO`` of a value if it can.

    ``quantity`` takes bounds of all norms, (len(polys), n) from below and from above, and returns a bound (n,).
    """
    taken = bound = 0.0
    for halving in range(HALVINGS + 1):
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found = quantity(*(np.array(side) for side in zip(*(poly.norms() for poly in polys), strict=True)))
            low, high = (np.array(side) for side in zip(*(poly.ends() for poly in polys), strict=True))
            values = quantity(low.reshape(len(polys), -1), high.reshape(len(polys), -1))
        found = np.where(np.isnan(found), np.inf, found)
        taken = max(taken, float(values[np.isfinite(values)].max(initial=0.0)))
        open_ = found > RATIO * taken if halving < HALVINGS else np.zeros(len(found), bool)
        bound = max(bound, float(found[~open_].max(initial=0.0)))
        if not open_.any():
            break
        polys = [poly.at(open_).halves() for poly in polys]
    return bound


def _sine(low: Array, high: Array) -> Array:
    """Bound the sine of the angle between the planes from norms of N, a, b, a x b, N.a and N.b."""
    n, a, b, area, _, _ = low
    _, a_most, b_most, _, na, nb = high
    rail, across = na / (n * a), nb / (n * b)
    sine = np.minimum(area / (a_most * b_most), 1.0)
    return np.sqrt(rail**2 + across**2 + 2 * rail * across * np.sqrt(1 - sine**2)) / sine


def _jump(low: Array, high: Array, angle: float) -> Array:
    """Bound the jump of curvature; norms in the order of :meth:`_Side.curvature_jump`."""
    n, w, s, _, x_w, b, _, _, c, t, _, area, area_s, *_ = low
    _, w_most, s_most, v_w, _, b_most, h, q, c_most, t_most, a_most, _, _, nb, f, cc, ct, tt = high
    across = nb / (n * b)
    gauge = 2 * (b_most / w) * v_w / x_w
    h = h / w + gauge
    # the primary's second fundamental form for C', T, and the parts x C' + y T of q
    cc, ct, tt = cc / (n * s), ct / (n * s), tt / (n * s)
    apart = q / (w * s) * (c_most * t_most) / area_s
    x, y = apart * s_most / c, apart * s_most / t
    mixed = 2 * (x * ct + y * tt) + x**2 * cc + 2 * x * y * ct + y**2 * tt
    jump = f / (n * w * s) + across * gauge + mixed + (angle + across**2) * h
    jump /= (b / w_most) ** 2 * np.maximum(1 - across**2, 0.0)
    return jump * (a_most * b_most / area) ** 2
