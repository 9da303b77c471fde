"""One boundary of a blend beside its ribbon: the polynomials, on common pieces, from which a proof bounds their gap.

H(t, v) is the blend, with v running into it from the boundary; G(t, v) = S(c + v d + v^2/2 e) is the map of the ribbon
on the primary S. Depends on the arithmetic of bounded polynomials, not on what is bounded with it.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np

from cqblend.blends.quality.bounded_polynomials import BoundedPolynomial, HomogeneousRow, simplify_weight
from cqblend.blends.quality.evaluation_rounding import RoundingBounds, bound_rounding
from cqblend.blends.quality.rail_reevaluation import RecomputedRibbon, extract_moved_pieces
from cqblend.blends.quality.tolerances import PROOF_TOLERANCES
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.splines import Curve, Surface, bernstein
from cqblend.splines.bernstein import EPSILON, Array
from cqblend.splines.breaks import cut_at_breaks, merge_breaks
from cqblend.splines.tolerances import SPLINE_TOLERANCES

Polynomials: TypeAlias = dict[str, BoundedPolynomial]

GAP_ERRORS = ("blend_error_00", "primary_error_00")  # names of the rounding errors of points, as far as they are known


class RibbonSide:
    """A blend H along one boundary and the ribbon's map G there, as polynomials in t on common pieces.

    Derivatives of H in space are multiplied by the square of its weight, and have no component along the first
    derivatives that only comes from the weight. All polynomials have names:

    - "normal": N of the primary; "weight": the square of H's weight;
    - "along", "across": H_t and H_v; "area": N.(H_t x H_v); "normal_along", "normal_across": N.H_t and N.H_v;
    - "blend_error_ij", "blend_size_ij": bounds of the rounding of the derivative of H of orders i, j as OCCT evaluates
      it, and of the derivative;
    - "parameter_error": angle by which the primary's parameters may be off, and its evaluation by closed forms;
    - if the primary is a spline: "primary_error_ij", "primary_size_ij" as for H, "primary_weight": the square of its
      weight, "primary_u", "primary_v": S_u and S_v, "primary_area": N.(S_u x S_v).

    Parameters
    ----------
    surface
        H.
    end
        0 for its boundary v = first, 1 for v = last.
    ribbon
        What it is to meet there.
    order
        Number of derivatives, 1 or 2.
    parameter_error
        By how much native parameters at which the primary is evaluated may be off, where they are angles.
    """

    def __init__(
        self, surface: Surface, end: Literal[0, 1], ribbon: Ribbon, order: int, parameter_error: float
    ) -> None:
        poles = surface.to_bspline()[2]
        origin = poles[:, -end].mean(axis=0)
        self._rows = _extract_boundary_rows(surface, end, -origin, order)
        self._ribbon = recomputed = RecomputedRibbon(ribbon, origin)
        native = list(recomputed.native_derivatives.values()) if recomputed.evaluation_rounding is not None else []
        curves = [self._rows[0, 0], recomputed.normal, recomputed.derivatives_along[0], *native]
        if order >= 2:
            curves += [recomputed.derivatives_across[0], recomputed.mixed_derivative[0]]
        self._breaks = merge_breaks(*(curve.breaks for curve in curves), near=SPLINE_TOLERANCES.moved_break)
        boundary = self._cut_curve(self._rows[0, 0])[0]
        self._piece_origins = boundary[:, :3].mean(axis=0) / boundary[:, 3].mean(axis=0)

        composition = PROOF_TOLERANCES.composition
        self._normal = BoundedPolynomial(*self._cut_curve(recomputed.normal, composition))
        self._blend_row = self._make_row(self._rows[0, 0], EPSILON)
        self._primary_row = self._make_row(recomputed.derivatives_along[0], composition)
        blend_weight = self._blend_row.w * self._blend_row.w
        primary_weight = self._primary_row.w * self._primary_row.w
        difference = blend_weight - primary_weight
        largest = PROOF_TOLERANCES.equal_weight * blend_weight.bound_norms()[0]
        self._has_equal_weights = bool(np.all(difference.size + difference.error <= largest))
        self._squared_weights = blend_weight, primary_weight

        middles = (self._breaks[:-1] + self._breaks[1:]) / 2
        jets = ribbon.primary.jet(ribbon.find_native_parameters(middles))
        self.parameter_shift = parameter_error * 2 * float(np.linalg.norm(jets[1:3], axis=-1).max())
        self.polynomials = self._collect_polynomials(surface, end, middles, parameter_error)

    def _collect_polynomials(
        self, surface: Surface, end: Literal[0, 1], middles: Array, parameter_error: float
    ) -> Polynomials:
        """Return the polynomials that the angle depends on."""
        n, (blend_weight, primary_weight) = self._normal, self._squared_weights
        along, across = self._derive_surface(0, 1), self._derive_surface(1, 0)
        polynomials = {"normal": n, "weight": blend_weight} | self._pair_with_normal(along, across)
        spans = len(surface.breaks[0]) - 1
        span = np.clip(np.searchsorted(surface.breaks[0], middles) - 1, 0, spans - 1)
        polynomials |= _name_rounding("blend", bound_rounding(surface.to_bspline(), end).take_spans(span, 0))
        evaluation = self._ribbon.evaluation_rounding
        if evaluation is None:
            unsure = np.full_like(middles, parameter_error + PROOF_TOLERANCES.closed_form)
            return polynomials | {"parameter_error": _make_constant(unsure)}
        polynomials["parameter_error"] = _make_constant(np.full_like(middles, parameter_error))
        polynomials |= _name_rounding("primary", evaluation(middles))
        polynomials["primary_weight"] = primary_weight
        for name, curve in self._ribbon.native_derivatives.items():
            row = self._make_row(curve, PROOF_TOLERANCES.composition)
            polynomials["primary_" + name] = row.derive_in_space(self._primary_row)
        polynomials["primary_area"] = n.dot(polynomials["primary_u"].cross(polynomials["primary_v"]))
        return polynomials

    def collect_gap_polynomials(self) -> Polynomials:
        """Return the polynomials that the gap depends on: "gap" over "weight" is the distance."""
        blend, primary = self._blend_row, self._primary_row
        errors = {name: self.polynomials[name] for name in GAP_ERRORS if name in self.polynomials}
        return {"gap": blend.derive_in_space(primary), "weight": blend.w * primary.w} | errors

    def collect_curvature_polynomials(self) -> Polynomials:
        """Return the polynomials that the jump of the curvature depends on: those of the angle, and more.

        With i and j each t or v, these are

        - "form_ij": N.G_ij, the primary's second fundamental form; "form_change_ij": N.(H_ij - G_ij);
        - "alpha_ij", "beta_ij": N.(H_ij x H_v) and N.(H_t x H_ij);
        - "ribbon_t", "ribbon_v", "ribbon_area": G_t, G_v, and N.(G_t x G_v);
        - "shift_t_i", "shift_v_i": N.((H_i - G_i) x G_v) and N.(G_t x (H_i - G_i)).
        """
        n, ribbon, polynomials = self._normal, self._ribbon, dict(self.polynomials)
        h = {"t": polynomials["along"], "v": polynomials["across"]}
        for name, across, along in (("tt", 0, 2), ("tv", 1, 1), ("vv", 2, 0)):
            h[name] = self._derive_surface(across, along)
        if not self._has_equal_weights:
            h = {name: polynomial * self._squared_weights[1] for name, polynomial in h.items()}
            polynomials["weight"] = self._squared_weights[0] * self._squared_weights[1]
            polynomials |= self._pair_with_normal(h["t"], h["v"])
        jets = {
            "t": ribbon.derivatives_along[1],
            "v": ribbon.derivatives_across[1],
            "tt": ribbon.derivatives_along[2],
            "vv": ribbon.derivatives_across[2],
        }
        g = {name: self._derive_ribbon(curve) for name, curve in jets.items()}
        mixed, x = ribbon.mixed_derivative
        twice_tv = self._derive_ribbon(mixed) - g["tt"] - g["vv"].scale_by(x**2)
        g["tv"] = twice_tv.scale_by(1 / (2 * x))
        for name in ("tt", "tv", "vv"):
            polynomials["form_" + name] = n.dot(g[name])
            polynomials["form_change_" + name] = n.dot(h[name] - g[name])
            polynomials["alpha_" + name] = n.dot(h[name].cross(h["v"]))
            polynomials["beta_" + name] = n.dot(h["t"].cross(h[name]))
        polynomials |= {"ribbon_t": g["t"], "ribbon_v": g["v"], "ribbon_area": n.dot(g["t"].cross(g["v"]))}
        for name in "tv":
            difference = h[name] - g[name]
            polynomials["shift_t_" + name] = n.dot(difference.cross(g["v"]))
            polynomials["shift_v_" + name] = n.dot(g["t"].cross(difference))
        return polynomials

    def _pair_with_normal(self, along: BoundedPolynomial, across: BoundedPolynomial) -> Polynomials:
        """Return two derivatives of H, their parts along the normal, and the area that they span in the plane."""
        n = self._normal
        return {
            "along": along,
            "across": across,
            "area": n.dot(along.cross(across)),
            "normal_along": n.dot(along),
            "normal_across": n.dot(across),
        }

    def _cut_curve(self, curve: Curve, known: float = 0.0) -> tuple[Array, Array]:
        """Cut a curve at the common breaks; its own coefficients are off by a ``known`` share of the largest.

        Returns the coefficients of the pieces, and a bound of their errors (n,).
        """
        cut = cut_at_breaks(curve, self._breaks)
        own_piece = np.searchsorted(curve.breaks, (cut.breaks[:-1] + cut.breaks[1:]) / 2) - 1
        rounding = 2 * EPSILON * (curve.degree + 1) if len(cut.breaks) > len(curve.breaks) else 0.0
        size = np.abs(curve.coefs).max(axis=(0, 1))[np.clip(own_piece, 0, len(curve.breaks) - 2)]
        return cut.coefs, (known + rounding) * size

    def _make_row(self, curve: Curve, known: float = 0.0) -> HomogeneousRow:
        """Return a homogeneous curve of dim 4 on the common pieces, relative to the origin of each piece."""
        (xyz, xyz_error), (w, w_error) = (self._cut_curve(part, known) for part in (curve[:3], curve[3]))
        shift = self._piece_origins * w
        xyz_error = xyz_error + 2 * EPSILON * np.abs(shift).max(axis=(0, 1))
        return HomogeneousRow(BoundedPolynomial(xyz - shift, xyz_error), simplify_weight(w, w_error))

    def _derive_surface(self, across: int, along: int) -> BoundedPolynomial:
        """Return a derivative of H in space, times the square of its weight."""
        return self._make_row(self._rows[across, along], EPSILON).derive_in_space(self._blend_row)

    def _derive_ribbon(self, jet: Curve) -> BoundedPolynomial:
        """Return a derivative of G in space, times the weight that the derivatives of H have."""
        derivative = self._make_row(jet, PROOF_TOLERANCES.composition).derive_in_space(self._primary_row)
        if self._has_equal_weights:
            error = derivative.error + PROOF_TOLERANCES.equal_weight * derivative.size
            return BoundedPolynomial(derivative.coefs, error)
        return derivative * self._squared_weights[0]


def _make_constant(values: Array) -> BoundedPolynomial:
    """Return numbers (n,), one for each piece, as exact polynomials of degree 0."""
    return BoundedPolynomial(values[None, None], np.zeros_like(values))


def _name_rounding(name: str, rounding: RoundingBounds) -> Polynomials:
    """Return bounds of errors and of derivatives by their names."""
    tables = {"error": rounding.error, "size": rounding.size}
    return {
        f"{name}_{kind}_{i}{j}": _make_constant(value)
        for kind, table in tables.items()
        for (i, j), value in table.items()
    }


def _extract_boundary_rows(surface: Surface, end: Literal[0, 1], by: Array, order: int) -> dict[tuple[int, int], Curve]:
    """Return the derivatives of a surface, moved by ``by``, along a boundary, as homogeneous curves (dim 4).

    Keys are the orders across, with v into the surface, and along. Pieces are differentiated in long doubles before
    they are rounded, and before they are cut: on very short pieces differences of rounded coefficients mean nothing.
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
