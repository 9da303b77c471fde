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

*Jump of the normal curvature.* The ribbon's map G(t, v) = S(c + v d + v^2/2 e) parametrises the primary. Its jets give
the primary's second fundamental form, II(G_i, G_j) = n.G_ij for i, j in {t, v}, as quotients of splines, and those of H
give the blend's. With H_i = G_i + q_i, q_i = x_i G_t + y_i G_v + z_i n and H_ij = alpha a + beta b + gamma n, where

.. math:: x_i = \frac{N \cdot (q_i \times G_v)}{N \cdot (G_t \times G_v)},
          \quad y_i = \frac{N \cdot (G_t \times q_i)}{N \cdot (G_t \times G_v)},
          \quad \alpha = \frac{N \cdot (H_{ij} \times b)}{N \cdot (a \times b)},
          \quad \beta = \frac{N \cdot (a \times H_{ij})}{N \cdot (a \times b)},

the blend's unit normal m/|m|, which is orthogonal to a and b, gives

.. math:: m \cdot H_{ij} / |m| = \cos\varphi\, (n \cdot H_{ij} - \alpha\, n \cdot a - \beta\, n \cdot b)

and the primary's form takes the projections of H_i and H_j on its plane to II(G_i + q_i, G_j + q_j). Up to the factor
cos(phi) the two forms differ by at most

.. math:: \Delta_{ij} = |n \cdot (H_{ij} - G_{ij})| + |\alpha|\,|n \cdot a| + |\beta|\,|n \cdot b|
          + |II(G_i, q_j)| + |II(q_i, G_j)| + |II(q_i, q_j)|

From these three, |a|, |b| and theta follows the largest difference on unit vectors, in all directions of the plane; the
factor cos(phi), and projected unit vectors being shorter by up to that much, cost a share sin^2(phi) of the curvatures.
The gauge of rational blends drops out: what it adds to H_ij is a combination of a and b.
On a piece of length h, II(G_t, G_t) is known up to the rounding of P(c) times (2 p/h)^2, and the bound with it.

The rounding of what is computed here is carried along as a bound on the error of the coefficients, product by product;
P, its jets and N enter with ``COMPOSED`` of error. The blend's own coefficients count as exact. Positions are taken
from a point of each piece (x - x_0 w), so that products do not lose what coordinates far from the origin would. Knots
of blend and surface that lie within 1e-9 of the rail of each other count as one (:mod:`cqblend.blends.breaks`): between
them, pieces go on as polynomials.

This module must not know how blends are made, and believes nothing of what they were meant to be.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np

from cqblend.blends.breaks import merged, onto
from cqblend.blends.primaries import Array
from cqblend.blends.ribbons import Ribbon
from cqblend.errors import InputError
from cqblend.splines import Curve, Surface, bernstein

if TYPE_CHECKING:
    from cqblend.blends.hermite import Blend

EPS = float(np.finfo(float).eps)
ROUNDING = 2.0**-46  # of the largest coordinate, 1.4e-14: a rail nearer than that to the exact one is the exact one
COMPOSED = 8 * EPS  # error of P(c) and its like, relative to the largest coefficient of a piece; below 2 EPS measured
EVEN = 256 * EPS  # weights that differ by less, relatively, count as one, and the difference as an error
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
        Difference of the normal curvatures in any direction, at most, 1/mm; None below G2.

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
    (a, b), (c, d) = surface.domain[0], ribbon.c.domain
    if max(abs(a - c), abs(b - d)) > 8 * EPS * max(abs(a), abs(b)):
        raise InputError(f"the surface runs over t = [{a:.9g}, {b:.9g}], its ribbon over [{c:.9g}, {d:.9g}]: clip one")
    side = _Side(surface, end, ribbon, 2 if order >= 2 else 1)
    gap = side.gap()
    sine = min(1.0, side.sine())
    return Proof(gap, float(np.arcsin(sine)), side.curvature_jump(sine) if order >= 2 else None)


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
    """A surface H along one boundary and the ribbon's map G(t, v) = S(c + v d + ..) there, on common pieces.

    What is called by a derivative, ``h["tv"]`` for H_tv, is that derivative in space, without the part along the first
    ones that the gauge adds, times the common ``weight``.
    """

    def __init__(self, surface: Surface, end: Literal[0, 1], ribbon: Ribbon, order: int) -> None:
        self.rows = _rows(surface, end, order)
        self.jets = ribbon.primary.jets(ribbon.c, ribbon.directions, max(order, len(ribbon.directions)))
        normal = ribbon.primary.normal(ribbon.c)
        self.breaks = merged(self.rows[0].breaks, self.jets[0].breaks, normal.breaks)
        boundary, _ = self._cut(self.rows[0])
        self.origin = boundary[:, :3].mean(axis=0) / boundary[:, 3].mean(axis=0)

        self.n = _Poly(*self._cut(normal, COMPOSED * _sizes(normal)))
        self.x, self.p = self._row(self.rows[0]), self._jet(0, 0)
        numerator, weights = self.x.over(self.p), self.x.w * self.p.w
        self.distance = numerator, weights
        reach = np.abs(boundary[:, :3]).max(axis=(0, 1)) / boundary[:, 3].min(axis=0)
        self.same = numerator.norms()[1] <= ROUNDING * reach * weights.norms()[0]

        first, second = self.x.w * self.x.w, self.p.w * self.p.w
        apart = first - second
        self.even = bool(np.all(apart.size + apart.error <= EVEN * first.norms()[0]))
        self.squares = first, second
        self.weight = first if self.even else first * second
        self.h = {"v": self._of_surface(1, 0)}
        self.g = {"t": self._of_ribbon(0, 1)}
        self.h["t"] = _chosen(self.same, self.g["t"], self._of_surface(0, 1))
        self.na = self._kept(self.n.dot(self.h["t"]))
        self.nb = self.n.dot(self.h["v"])
        self.area = self.n.dot(self.h["t"].cross(self.h["v"]))

    def _cut(self, curve: Curve, error: Array | None = None) -> tuple[Array, Array]:
        """Cut a curve on the common breaks; the coefficients of its own pieces may be off by ``error``."""
        cut = onto(curve, self.breaks)
        own = np.searchsorted(curve.breaks, (cut.breaks[:-1] + cut.breaks[1:]) / 2) - 1
        known = 0.0 if error is None else error[own]
        rounding = 2 * EPS * (curve.degree + 1) if len(cut.breaks) > len(curve.breaks) else 0.0
        return cut.coefs, known + rounding * _sizes(curve)[own]

    def _row(self, curve: Curve, errors: Sequence[Array | None] = (None, None)) -> _Row:
        parts = (curve[:3], curve[3])
        (xyz, error), (w, doubt) = (self._cut(part, known) for part, known in zip(parts, errors, strict=True))
        shift = self.origin * w
        error = error + 2 * EPS * np.abs(shift).max(axis=(0, 1))
        return _Row(_Poly(xyz - shift, error), _weight(w, doubt))

    def _jet(self, across: int, along: int) -> _Row:
        # differentiated before it is cut: a piece of rounding's length has no difference quotients
        jet = self.jets[across]
        factor = COMPOSED * (2 * jet.degree / np.diff(jet.breaks)) ** along
        return self._row(jet.derivative(along), [factor * _sizes(part) for part in (jet[:3], jet[3])])

    def _of_surface(self, across: int, along: int) -> _Poly:
        derivative = self._row(self.rows[across].derivative(along)).over(self.x)
        return derivative if self.even else derivative * self.squares[1]

    def _of_ribbon(self, across: int, along: int) -> _Poly:
        derivative = self._jet(across, along).over(self.p)
        if self.even:
            return _Poly(derivative.coefs, derivative.error + EVEN * derivative.size)
        return derivative * self.squares[0]

    def _kept(self, poly: _Poly) -> _Poly:
        """Take zero where the boundary is the rail to rounding."""
        return _Poly(np.where(self.same, 0.0, poly.coefs), np.where(self.same, 0.0, poly.error))

    def gap(self) -> float:
        """Bound |H(t, 0) - S(c(t))|."""
        return _largest(dict(zip("dw", self.distance, strict=True)), lambda low, high: high["d"] / low["w"])

    def sine(self) -> float:
        """Bound the sine of the angle between the tangent planes."""
        polys = {"n": self.n, "t": self.h["t"], "v": self.h["v"], "area": self.area, "nt": self.na, "nv": self.nb}
        return _largest(polys, _sine)

    def curvature_jump(self, sine: float) -> float:
        """Bound the jump of the normal curvature, given the sine of the angle between the tangent planes."""
        h, g, n = self.h, self.g, self.n
        g["v"] = self._of_ribbon(1, 0)
        for name, across, along in (("tt", 0, 2), ("tv", 1, 1), ("vv", 2, 0)):
            g[name], h[name] = self._of_ribbon(across, along), self._of_surface(across, along)
        h["tt"] = _chosen(self.same, g["tt"], h["tt"])
        polys = {"n": n, "w": self.weight, "area": self.area, "nt": self.na, "nv": self.nb}
        polys |= {"t": h["t"], "v": h["v"], "gt": g["t"], "gv": g["v"], "garea": n.dot(g["t"].cross(g["v"]))}
        for name in "tv":
            apart = h[name] - g[name]
            polys["x" + name], polys["y" + name] = n.dot(apart.cross(g["v"])), n.dot(g["t"].cross(apart))
        polys["xt"], polys["yt"] = self._kept(polys["xt"]), self._kept(polys["yt"])
        for name in ("tt", "tv", "vv"):
            polys["g" + name], polys["d" + name] = n.dot(g[name]), n.dot(h[name] - g[name])
            polys["a" + name], polys["b" + name] = n.dot(h[name].cross(h["v"])), n.dot(h["t"].cross(h[name]))
        polys["dtt"] = self._kept(polys["dtt"])
        return _largest(polys, lambda low, high: _jump(low, high, sine))


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


Norms = Mapping[str, Array]


def _largest(polys: Mapping[str, _Poly], quantity: Callable[[Norms, Norms], Array]) -> float:
    """Bound a quantity that depends on the norms of polynomials: from above, and within ``RATIO`` of a value if it can.

    ``quantity`` takes bounds of all norms, from below and from above, (n,) each, and returns a bound (n,).
    """
    taken = bound = 0.0
    for halving in range(HALVINGS + 1):
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found, values = (
                quantity(*({name: pair[k] for name, pair in bounds.items()} for k in (0, 1)))
                for bounds in (
                    {name: poly.norms() for name, poly in polys.items()},
                    {name: poly.ends() for name, poly in polys.items()},
                )
            )
        found = np.where(np.isnan(found), np.inf, found)
        taken = max(taken, float(values[np.isfinite(values)].max(initial=0.0)))
        open_ = found > RATIO * taken if halving < HALVINGS else np.zeros(len(found), bool)
        bound = max(bound, float(found[~open_].max(initial=0.0)))
        if not open_.any():
            break
        polys = {name: poly.at(open_).halves() for name, poly in polys.items()}
    return bound


def _slant(low: Norms, high: Norms) -> tuple[Array, Array]:
    """Bound the sine of the angle between a = H_t and b = H_v from below, and its cosine from above."""
    sine = np.minimum(low["area"] / (high["n"] * high["t"] * high["v"]), 1.0)
    return sine, np.sqrt(1 - sine**2)


def _sine(low: Norms, high: Norms) -> Array:
    """Bound the sine of the angle between the tangent planes."""
    sine, cosine = _slant(low, high)
    rail, across = high["nt"] / (low["n"] * low["t"]), high["nv"] / (low["n"] * low["v"])
    return np.sqrt(rail**2 + across**2 + 2 * rail * across * cosine) / sine


def _jump(low: Norms, high: Norms, sine: float) -> Array:
    """Bound the jump of the normal curvature."""
    unit = low["n"] * low["w"]
    own = {name: high["g" + name] / unit for name in ("tt", "tv", "vv")}  # II(C', C'), II(C', T), II(T, T)
    x, y = ({name: high[axis + name] / low["garea"] for name in "tv"} for axis in "xy")

    def form(x1: Array | float, y1: Array | float, x2: Array | float, y2: Array | float) -> Array:
        return x1 * x2 * own["tt"] + (x1 * y2 + y1 * x2) * own["tv"] + y1 * y2 * own["vv"]

    jumps = {}
    for name in ("tt", "tv", "vv"):
        i, j = name
        leaning = (high["a" + name] * high["nt"] + high["b" + name] * high["nv"]) / (low["area"] * unit)
        first, second = (1.0 if k == "t" else 0.0 for k in name)
        turned = (
            form(first, 1 - first, x[j], y[j]) + form(x[i], y[i], second, 1 - second) + form(x[i], y[i], x[j], y[j])
        )
        jumps[name] = high["d" + name] / unit + leaning + turned
    a, b, slant = low["t"] / high["w"], low["v"] / high["w"], _slant(low, high)
    jump = _spectral(jumps["tt"] / a**2, jumps["tv"] / (a * b), jumps["vv"] / b**2, *slant)
    c, t = low["gt"] / high["w"], low["gv"] / high["w"]
    straight = np.minimum(low["garea"] / (high["n"] * high["gt"] * high["gv"]), 1.0)
    most = _spectral(own["tt"] / c**2, own["tv"] / (c * t), own["vv"] / t**2, straight, np.sqrt(1 - straight**2))
    return (1 + sine**2) * jump + 2 * sine**2 * most


def _spectral(aa: Array, ab: Array, bb: Array, sine: Array, cosine: Array) -> Array:
    """Bound |II(x, x)| for all unit x from bounds for two unit vectors a, b, and of the angle between them."""
    across = (ab + cosine * aa) / sine
    both = (bb + 2 * cosine * ab + cosine**2 * aa) / sine**2
    return (aa + both) / 2 + np.hypot((aa - both) / 2, across)
