r"""What the coefficients of a finished blend prove: bounds that hold along the whole rail, not at samples of it.

They hold for the surface that is returned, the doubles in it, as OCCT evaluates them. Along one of its two boundaries a
blend H(t, v) has the rows of poles X, V, W: the homogeneous H, H_v and H_vv there. The primary gives, for the same t,
the jets P(c), DP d, .. of the ribbon and a normal N of its tangent plane, worked out on a way of its own
(:mod:`cqblend.blends.quality.rail_reevaluation`). Everything below is made of polynomials in t on every piece between
knots of the blend and places where the rail crosses knot lines, formed by exact products and bounded by the hull of
their coefficients (:mod:`cqblend.blends.quality.error_bounds`). With a = H_t and b = H_v in space, n = N/|N|, theta the
angle between a and b, A = |n.a|/|a| and B = |n.b|/|b|:

*Gap.* D = H(t, 0) - S(c(t)) = (X w_S - P w_H)/(w_H w_S): the hull of the numerator over the least weights.

*Angle.* The blend's normal m = a x b has the part n x m = a (n.b) - b (n.a) in the primary's plane, so the angle phi
between the tangent planes of H at (t, 0) and of S at c(t) satisfies

.. math:: \sin^2 \varphi = \frac{|a\,(n \cdot b) - b\,(n \cdot a)|^2}{|a \times b|^2}
          \le \frac{A^2 + B^2 + 2 A B\, |\cos\theta|}{\sin^2\theta}

B is the determinant det[P, Pu, Pv, Hv] of Kim and Elber (section 2) over the lengths of what it is made of. A comes
from the rail: S(c)' is tangent, so n.a = n.D'. In an exact blend D is the rounding of poles, and D' is that rounding
over the length of a piece, up to 2 p |D|/h: on short pieces it is what counts. Where breaks that nearly coincide have
been brought together, D and D' between them are what polynomials miss that go on past their end: these are pieces like
all others here.

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
The gauge of rational blends drops out: what it adds to H_ij is a combination of a and b. D'' is in it, up to
4 p^2 |D|/h^2. G_ij needs no quotients of differences: II(G_t, G_t) and II(G_t + x G_v, G_t + x G_v) come from second
derivatives along c' and c' + x d, whatever c', d and x are.

*Evaluation.* Where derivatives are evaluated with errors of up to E_a, E_b, E_ij
(:mod:`cqblend.blends.quality.rounding`), the plane of a and b turns by at most

.. math:: \psi = \frac{1}{\sin\theta} \Big(\frac{E_a}{|a|} + \frac{E_b}{|b|}\Big),

the form n.H_ij changes by E_ij + psi |H_ij|, and coordinates of unit vectors by a share psi. The same holds for S_u,
S_v and S_ij of the primary. What is measured differs by no more than that.

The rounding of what is computed here is carried along as a bound on the error of the coefficients, product by product;
P, its jets and N enter with ``COMPOSITION_ERROR`` of error. Positions are taken from a point of each piece (x - x_0 w),
so that products do not lose what coordinates far from the origin would. This module must not know how blends are made,
and believes nothing of what they were meant to be.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

import numpy as np

from cqblend.blends.quality.error_bounds import (
    EPS,
    BoundedPolynomial,
    HomogeneousRow,
    NormBounds,
    bound_largest,
    simplify_weight,
)
from cqblend.blends.quality.rail_reevaluation import CLOSED_FORM_ERROR, RecomputedRibbon, extract_moved_pieces
from cqblend.blends.quality.rounding import RoundingBounds, bound_rounding
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.errors import InputError
from cqblend.splines import Curve, Surface, bernstein
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import MOVED_BREAK, cut_at_breaks, merge_breaks

if TYPE_CHECKING:
    from cqblend.blends.sections.blend_surface import BlendSurface

COMPOSITION_ERROR = (
    8 * EPS
)  # error of P(c) and its like, relative to the largest coefficient of a piece; below 2 EPS measured
EQUAL_WEIGHT_TOLERANCE = (
    256 * EPS
)  # weights that differ by less, relatively, count as one, and the difference as an error
NORMAL_COMPARISON_ERROR = 8 * EPS  # angle by which two unit normals are off as they are compared


@dataclass(frozen=True, slots=True)
class Proof:
    """What is proven of how a blend meets its surfaces, for every point of the rails.

    Attributes
    ----------
    gap : float
        Distance between H(t, 0) and S(c(t)), at most, mm.
    angle : float
        Angle between the normals there, at most, rad; pi where nothing is proven.
    curvature_jump : float or None
        Difference of the normal curvatures in any direction, at most, 1/mm; None as soon as it is not proven for one of
        the rails, as below G2.
    sides : tuple of Proof
        The same for each rail alone, in the order of the certificate's rails.

    Examples
    --------
    >>> first, second = Proof(2e-16, 3.1e-15, 4e-13), Proof(1e-16, 7.2e-15)
    >>> print(first)
    proven for the whole rail: gap <= 2.0e-16 mm, angle <= 3.1e-15 rad, curvature jump <= 4.0e-13 1/mm
    >>> print(first | second)
    proven for the whole rail: gap <= 2.0e-16 mm, angle <= 7.2e-15 rad
    >>> [side.curvature_jump for side in (first | second).sides]
    [4e-13, None]
    """

    gap: float
    angle: float
    curvature_jump: float | None = None
    sides: tuple[Proof, ...] = field(default=(), repr=False, compare=False)

    def __or__(self, other: Proof) -> Proof:
        """Return what is proven of all rails of two: the larger bounds."""
        sides = tuple(side for proof in (self, other) for side in proof.sides or (proof,))
        jumps = [side.curvature_jump for side in (self, other)]
        jump = None if None in jumps else max(jump for jump in jumps if jump is not None)
        return Proof(max(self.gap, other.gap), max(self.angle, other.angle), jump, sides)

    def __str__(self) -> str:
        jump = "" if self.curvature_jump is None else f", curvature jump <= {self.curvature_jump:.1e} 1/mm"
        return f"proven for the whole rail: gap <= {self.gap:.1e} mm, angle <= {self.angle:.1e} rad{jump}"


def prove_blend(blend: BlendSurface, doubts: tuple[float, float] = (0.0, 0.0)) -> Proof:
    """Prove how a blend meets both of its surfaces: the larger bounds of the two rails.

    The proof is about the B-spline that the blend leaves as, with its knots; ``doubts`` as in :func:`prove_side`.

    Raises
    ------
    InputError
        If the surface and a ribbon have different domains.
    """
    surface = Surface.from_bspline(*blend.surface.to_bspline())
    first, second = blend.ribbons
    return prove_side(surface, 0, first, doubt=doubts[0]) | prove_side(surface, 1, second, doubt=doubts[1])


def prove_side(
    surface: Surface, end: Literal[0, 1], ribbon: Ribbon, order: int | None = None, doubt: float = 0.0
) -> Proof:
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
    doubt
        By how much the native parameters at which the primary is read may be off the rail's, where they are angles.

    Raises
    ------
    InputError
        If the surface and the ribbon have different domains.
    """
    order = ribbon.order if order is None else order
    (a, b), (c, d) = surface.domain[0], ribbon.c.domain
    if max(abs(a - c), abs(b - d)) > 8 * EPS * max(abs(a), abs(b)):
        raise InputError(f"the surface runs over t = [{a:.9g}, {b:.9g}], its ribbon over [{c:.9g}, {d:.9g}]: clip one")
    side = _RibbonSide(surface, end, ribbon, 2 if order >= 2 else 1, doubt)
    angle = side.bound_angle()
    jump = side.bound_curvature_jump(angle) if order >= 2 and angle < np.pi / 2 else np.inf
    return Proof(side.bound_gap(), angle if angle < np.pi / 2 else np.pi, jump if np.isfinite(jump) else None)


# -- one boundary


class _RibbonSide:
    """A surface H along one boundary and the ribbon's map G(t, v) = S(c + v d + ..) there, on common pieces.

    ``polys`` are what bounds depend on. What is called by a derivative, "tv" for H_tv, is that derivative in space,
    without the part along the first ones that the gauge adds, times the square "w" of the weight.
    """

    def __init__(self, surface: Surface, end: Literal[0, 1], ribbon: Ribbon, order: int, doubt: float) -> None:
        degrees, knots, poles, weights = surface.to_bspline()
        far = poles[:, -end].mean(axis=0)
        self.rows = _extract_boundary_rows(surface, end, -far, order)
        self.witness = witness = RecomputedRibbon(ribbon, far)
        native = list(witness.native_derivatives.values()) if witness.evaluation_rounding is not None else []
        curves = [self.rows[0, 0], witness.normal, witness.derivatives_along[0], *native]
        if order >= 2:
            curves += [witness.derivatives_across[0], witness.mixed_derivative[0]]
        self.breaks = merge_breaks(*(curve.breaks for curve in curves), near=MOVED_BREAK)
        boundary = self._cut_curve(self.rows[0, 0])[0]
        self.origin = boundary[:, :3].mean(axis=0) / boundary[:, 3].mean(axis=0)

        self.n = BoundedPolynomial(*self._cut_curve(witness.normal, COMPOSITION_ERROR))
        self.x, self.p = (
            self._make_row(self.rows[0, 0], EPS),
            self._make_row(witness.derivatives_along[0], COMPOSITION_ERROR),
        )
        self.distance = self.x.derive_in_space(self.p), self.x.w * self.p.w
        first, second = self.x.w * self.x.w, self.p.w * self.p.w
        apart = first - second
        self.even = bool(np.all(apart.size + apart.error <= EQUAL_WEIGHT_TOLERANCE * first.bound_norms()[0]))
        self.squares = first, second
        t, v = self._derive_surface(0, 1), self._derive_surface(1, 0)
        self.polys = {"n": self.n, "w": first, "t": t, "v": v, "area": self.n.dot(t.cross(v))}
        self.polys |= {"nt": self.n.dot(t), "nv": self.n.dot(v)}

        middles = (self.breaks[:-1] + self.breaks[1:]) / 2
        table = bound_rounding((degrees, knots, poles, weights), end)
        spans = len(surface.breaks[0]) - 1
        self.own = table.take_spans(np.clip(np.searchsorted(surface.breaks[0], middles) - 1, 0, spans - 1), 0)
        self.other = None if witness.evaluation_rounding is None else witness.evaluation_rounding(middles)
        self._add_rounding("h", self.own)
        self.shift = (
            doubt
            * 2
            * float(np.linalg.norm(ribbon.primary.jet(ribbon.find_native_parameters(middles))[1:3], axis=-1).max())
        )
        unsure = np.full_like(middles, doubt if self.other is not None else doubt + CLOSED_FORM_ERROR)
        self.polys["unsure"] = BoundedPolynomial(unsure[None, None], np.zeros_like(middles))
        if self.other is not None:
            self._add_rounding("s", self.other)
            self.polys["ws"] = second
            for name, curve in witness.native_derivatives.items():
                self.polys["s" + name] = self._make_row(curve, COMPOSITION_ERROR).derive_in_space(self.p)
            self.polys["sarea"] = self.n.dot(self.polys["su"].cross(self.polys["sv"]))

    def _add_rounding(self, name: str, table: RoundingBounds) -> None:
        """Add bounds of errors ("eh10") and of derivatives ("zh10") to what quantities depend on."""
        for prefix, values in (("e", table.error), ("z", table.size)):
            for (i, j), value in values.items():
                self.polys[f"{prefix}{name}{i}{j}"] = BoundedPolynomial(value[None, None], np.zeros_like(value))

    def _cut_curve(self, curve: Curve, known: float = 0.0) -> tuple[Array, Array]:
        """Cut a curve on the common breaks; the coefficients of its own pieces are off by a ``known`` share of them."""
        cut = cut_at_breaks(curve, self.breaks)
        own = np.searchsorted(curve.breaks, (cut.breaks[:-1] + cut.breaks[1:]) / 2) - 1
        rounding = 2 * EPS * (curve.degree + 1) if len(cut.breaks) > len(curve.breaks) else 0.0
        size = np.abs(curve.coefs).max(axis=(0, 1))[np.clip(own, 0, len(curve.breaks) - 2)]
        return cut.coefs, (known + rounding) * size

    def _make_row(self, curve: Curve, known: float = 0.0) -> HomogeneousRow:
        (xyz, error), (w, doubt) = (self._cut_curve(part, known) for part in (curve[:3], curve[3]))
        shift = self.origin * w
        error = error + 2 * EPS * np.abs(shift).max(axis=(0, 1))
        return HomogeneousRow(BoundedPolynomial(xyz - shift, error), simplify_weight(w, doubt))

    def _derive_surface(self, across: int, along: int) -> BoundedPolynomial:
        return self._make_row(self.rows[across, along], EPS).derive_in_space(self.x)

    def _derive_ribbon(self, jet: Curve) -> BoundedPolynomial:
        """Return a derivative of the ribbon's map, times the weight that the surface's derivatives have."""
        derivative = self._make_row(jet, COMPOSITION_ERROR).derive_in_space(self.p)
        if self.even:
            return BoundedPolynomial(derivative.coefs, derivative.error + EQUAL_WEIGHT_TOLERANCE * derivative.size)
        return derivative * self.squares[0]

    def bound_gap(self) -> float:
        """Bound |H(t, 0) - S(c(t))|."""
        polys = dict(zip("dw", self.distance, strict=True)) | {"eh00": self.polys["eh00"]}
        if self.other is not None:
            polys["es00"] = self.polys["es00"]

        def evaluate_gap(low: NormBounds, high: NormBounds) -> Array:
            read = sum(high[name] for name in ("eh00", "es00") if name in high)
            return high["d"] / low["w"] + read

        return bound_largest(polys, evaluate_gap) + self.shift

    def bound_angle(self) -> float:
        """Bound the angle between the tangent planes; infinite where nothing is sure."""
        return bound_largest(self.polys, _bound_angle)

    def bound_curvature_jump(self, angle: float) -> float:
        """Bound the jump of the normal curvature, given the angle between the tangent planes."""
        n, witness, polys = self.n, self.witness, dict(self.polys)
        h = {"t": polys["t"], "v": polys["v"]}
        for name, across, along in (("tt", 0, 2), ("tv", 1, 1), ("vv", 2, 0)):
            h[name] = self._derive_surface(across, along)
        if not self.even:
            h = {name: poly * self.squares[1] for name, poly in h.items()}
            polys["w"] = self.squares[0] * self.squares[1]
            polys |= {"t": h["t"], "v": h["v"], "area": n.dot(h["t"].cross(h["v"]))}
            polys |= {"nt": n.dot(h["t"]), "nv": n.dot(h["v"])}
        g = {
            "t": witness.derivatives_along[1],
            "v": witness.derivatives_across[1],
            "tt": witness.derivatives_along[2],
            "vv": witness.derivatives_across[2],
        }
        made = {name: self._derive_ribbon(curve) for name, curve in g.items()}
        mixed, x = witness.mixed_derivative
        both = self._derive_ribbon(mixed) - made["tt"] - made["vv"].scale_by(x**2)
        made["tv"] = both.scale_by(1 / (2 * x))
        for name in ("tt", "tv", "vv"):
            polys["g" + name], polys["d" + name] = n.dot(made[name]), n.dot(h[name] - made[name])
            polys["a" + name], polys["b" + name] = n.dot(h[name].cross(h["v"])), n.dot(h["t"].cross(h[name]))
        polys |= {"gt": made["t"], "gv": made["v"], "garea": n.dot(made["t"].cross(made["v"]))}
        for name in "tv":
            apart = h[name] - made[name]
            polys["x" + name], polys["y" + name] = n.dot(apart.cross(made["v"])), n.dot(made["t"].cross(apart))
        return bound_largest(polys, lambda low, high: _bound_curvature_jump(low, high, np.sin(angle)))


def _extract_boundary_rows(surface: Surface, end: Literal[0, 1], by: Array, order: int) -> dict[tuple[int, int], Curve]:
    """Return derivatives of a surface, moved, along a boundary, v running into it, as homogeneous curves (dim 4).

    By their orders across and along: differentiated before they are rounded, and before they are cut, since pieces of
    rounding's length have no difference quotients.
    """
    coefs = extract_moved_pieces(surface.to_bspline(), by, np.longdouble)[..., -end]
    across = np.moveaxis(coefs[:, ::-1] if end else coefs, 1, 0)
    (breaks, other), rows = surface.breaks, {}
    for i in range(order + 1):
        row = across[0]
        for j in range(order + 1 - i):
            rows[i, j] = Curve(breaks, row.astype(float), continuity=surface.continuity[0])
            row = bernstein.differentiate_coefs(row) / np.diff(breaks)
        across = bernstein.differentiate_coefs(across) / np.diff(other)[-end]
    return rows


# -- bounds


def _bound_slant(low: NormBounds, high: NormBounds, area: str, first: str, second: str) -> tuple[Array, Array]:
    """Bound the sine of the angle between two tangent vectors from below, and its cosine from above."""
    sine = np.minimum(low[area] / (high["n"] * high[first] * high[second]), 1.0)
    return sine, np.sqrt(1 - sine**2)


def _bound_turn(low: NormBounds, high: NormBounds, sine: Array, name: str, first: str, second: str) -> Array:
    """Bound by how much errors of two tangent vectors turn their plane, and change coordinates in it."""
    w = high["w" if name == "h" else "ws"]
    return (high[f"e{name}10"] * w / low[first] + high[f"e{name}01"] * w / low[second]) / sine


def _bound_evaluation_turns(low: NormBounds, high: NormBounds) -> tuple[Array, Array]:
    """Bound by how much evaluation turns the tangent planes of the blend and of the primary."""
    own = _bound_turn(low, high, _bound_slant(low, high, "area", "t", "v")[0], "h", "t", "v")
    if "sarea" not in high:
        return own, high["unsure"]
    return own, high["unsure"] + _bound_turn(
        low, high, _bound_slant(low, high, "sarea", "su", "sv")[0], "s", "su", "sv"
    )


def _bound_angle(low: NormBounds, high: NormBounds) -> Array:
    """Bound the angle between the tangent planes, as it is evaluated."""
    sine, cosine = _bound_slant(low, high, "area", "t", "v")
    rail, across = high["nt"] / (low["n"] * low["t"]), high["nv"] / (low["n"] * low["v"])
    planes = np.sqrt(rail**2 + across**2 + 2 * rail * across * cosine) / sine
    own, other = _bound_evaluation_turns(low, high)
    return NORMAL_COMPARISON_ERROR + np.arcsin(planes) + np.arcsin(own) + np.arcsin(other)


def _bound_curvature_jump(low: NormBounds, high: NormBounds, sine: float) -> Array:
    """Bound the jump of the normal curvature, as it is evaluated."""
    unit = low["n"] * low["w"]
    own = {name: high["g" + name] / unit for name in ("tt", "tv", "vv")}  # II(C', C'), II(C', T), II(T, T)
    x, y = ({name: high[axis + name] / low["garea"] for name in "tv"} for axis in "xy")

    def evaluate_form(x1: Array | float, y1: Array | float, x2: Array | float, y2: Array | float) -> Array:
        return x1 * x2 * own["tt"] + (x1 * y2 + y1 * x2) * own["tv"] + y1 * y2 * own["vv"]

    jumps = {}
    for name in ("tt", "tv", "vv"):
        i, j = name
        leaning = (high["a" + name] * high["nt"] + high["b" + name] * high["nv"]) / (low["area"] * unit)
        first, second = (1.0 if k == "t" else 0.0 for k in name)
        turned = (
            evaluate_form(first, 1 - first, x[j], y[j])
            + evaluate_form(x[i], y[i], second, 1 - second)
            + evaluate_form(x[i], y[i], x[j], y[j])
        )
        jumps[name] = high["d" + name] / unit + leaning + turned
    a, b, slant = low["t"] / high["w"], low["v"] / high["w"], _bound_slant(low, high, "area", "t", "v")
    jump = _bound_spectral_norm(jumps["tt"] / a**2, jumps["tv"] / (a * b), jumps["vv"] / b**2, *slant)
    c, t = low["gt"] / high["w"], low["gv"] / high["w"]
    straight = _bound_slant(low, high, "garea", "gt", "gv")
    most = _bound_spectral_norm(own["tt"] / c**2, own["tv"] / (c * t), own["vv"] / t**2, *straight)

    def bound_evaluation_jump(
        name: str, turn: Array, a: Array, b: Array, slant: tuple[Array, Array], bent: Array
    ) -> Array:
        forms = [high[f"e{name}{order}"] + turn * high[f"z{name}{order}"] for order in ("20", "11", "02")]
        changed = _bound_spectral_norm(forms[0] / a**2, forms[1] / (a * b), forms[2] / b**2, *slant)
        return (1 + turn) ** 2 * changed + turn * (2 + turn) * bent

    own_turn, other_turn = _bound_evaluation_turns(low, high)
    bent = most + jump
    evaluated = (
        bound_evaluation_jump("h", own_turn, a, b, slant, bent)
        + (NORMAL_COMPARISON_ERROR / slant[0] + 4 * high["unsure"]) * bent
    )
    if "sarea" in high:
        u, v = low["su"] / high["ws"], low["sv"] / high["ws"]
        # once as it is evaluated by OCCT, once as it is composed here
        evaluated = evaluated + 2 * bound_evaluation_jump(
            "s", other_turn, u, v, _bound_slant(low, high, "sarea", "su", "sv"), most
        )
    return (1 + sine**2) * jump + 2 * sine**2 * most + evaluated


def _bound_spectral_norm(aa: Array, ab: Array, bb: Array, sine: Array, cosine: Array) -> Array:
    """Bound |II(x, x)| for all unit x from bounds for two unit vectors a, b, and of the angle between them."""
    across = (ab + cosine * aa) / sine
    both = (bb + 2 * cosine * ab + cosine**2 * aa) / sine**2
    return (aa + both) / 2 + np.hypot((aa - both) / 2, across)
