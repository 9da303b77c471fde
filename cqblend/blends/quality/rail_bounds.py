"""Bounds of the gap, the angle and the jump of curvature at a joint, from bounds of the norms of polynomials.

The formulas are those of :mod:`cqblend.blends.quality.smoothness_proof`; the names of the polynomials are those of
:class:`cqblend.blends.quality.blend_boundary.RibbonSide`. ``low`` and ``high`` bound each norm from below and from
above, (n,) for n pieces.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np

from cqblend.blends.quality.blend_boundary import GAP_ERRORS
from cqblend.blends.quality.bounded_polynomials import NormBounds
from cqblend.blends.quality.tolerances import PROOF_TOLERANCES
from cqblend.splines.bernstein import Array

Slant: TypeAlias = tuple[Array, Array]  # of two vectors: the sine of their angle from below, its cosine from above


def bound_gap(low: NormBounds, high: NormBounds) -> Array:
    """Bound the distance of the blend from the primary, as both are evaluated."""
    evaluation = sum(high[name] for name in GAP_ERRORS if name in high)
    return high["gap"] / low["weight"] + evaluation


def _bound_slant(low: NormBounds, high: NormBounds, area: str, first: str, second: str) -> Slant:
    """Bound the angle between two tangent vectors."""
    sine = np.minimum(low[area] / (high["normal"] * high[first] * high[second]), 1.0)
    return sine, np.sqrt(1 - sine**2)


def _bound_turn(errors: tuple[Array, Array], lengths: tuple[Array, Array], sine: Array) -> Array:
    """Bound by how much errors of two tangent vectors turn their plane, and change coordinates in it."""
    return (errors[0] / lengths[0] + errors[1] / lengths[1]) / sine


def _bound_evaluation_turns(low: NormBounds, high: NormBounds) -> tuple[Array, Array]:
    """Bound by how much evaluation turns the tangent planes of the blend and of the primary (rad)."""
    blend_sine = _bound_slant(low, high, "area", "along", "across")[0]
    blend_errors = high["blend_error_10"] * high["weight"], high["blend_error_01"] * high["weight"]
    return _bound_turn(blend_errors, (low["along"], low["across"]), blend_sine), _bound_primary_turn(low, high)


def _bound_primary_turn(low: NormBounds, high: NormBounds) -> Array:
    """Bound by how much evaluation turns the tangent plane of the primary (rad)."""
    if "primary_area" not in high:
        return high["parameter_error"]
    primary_sine = _bound_slant(low, high, "primary_area", "primary_u", "primary_v")[0]
    w = high["primary_weight"]
    primary_errors = high["primary_error_10"] * w, high["primary_error_01"] * w
    primary_turn = _bound_turn(primary_errors, (low["primary_u"], low["primary_v"]), primary_sine)
    return high["parameter_error"] + primary_turn


def bound_angle(low: NormBounds, high: NormBounds) -> Array:
    """Bound the angle between the tangent planes, as it is evaluated (rad)."""
    sine, cosine = _bound_slant(low, high, "area", "along", "across")
    along = high["normal_along"] / (low["normal"] * low["along"])
    across = high["normal_across"] / (low["normal"] * low["across"])
    planes = np.sqrt(along**2 + across**2 + 2 * along * across * cosine) / sine
    blend_turn, primary_turn = _bound_evaluation_turns(low, high)
    return PROOF_TOLERANCES.normal_comparison + np.arcsin(planes) + np.arcsin(blend_turn) + np.arcsin(primary_turn)


def bound_pole_angle(low: NormBounds, high: NormBounds) -> Array:
    """Bound the angle between the sections of a blend, where its rail is one point, and the tangent plane (rad).

    The blend has no tangent plane there but the one that its sections span.
    """
    across = high["normal_across"] / (low["normal"] * low["across"])
    turn = high["blend_error_01"] * high["weight"] / low["across"]
    primary_turn = _bound_primary_turn(low, high)
    return PROOF_TOLERANCES.normal_comparison + np.arcsin(across) + np.arcsin(turn) + np.arcsin(primary_turn)


def bound_curvature_jump(low: NormBounds, high: NormBounds, sine: float) -> Array:
    """Bound the jump of the normal curvature, as it is evaluated (1/mm); ``sine`` is that of the angle's bound."""
    unit = low["normal"] * low["weight"]
    form = {name: high["form_" + name] / unit for name in ("tt", "tv", "vv")}  # II(G_t, G_t), II(G_t, G_v), ..
    x, y = ({name: high[f"shift_{axis}_{name}"] / low["ribbon_area"] for name in "tv"} for axis in "tv")

    def evaluate_form(x1: Array | float, y1: Array | float, x2: Array | float, y2: Array | float) -> Array:
        return x1 * x2 * form["tt"] + (x1 * y2 + y1 * x2) * form["tv"] + y1 * y2 * form["vv"]

    jumps = {}
    for name in ("tt", "tv", "vv"):
        i, j = name
        tangent_part = high["alpha_" + name] * high["normal_along"] + high["beta_" + name] * high["normal_across"]
        first, second = (1.0 if k == "t" else 0.0 for k in name)
        shifted = (
            evaluate_form(first, 1 - first, x[j], y[j])
            + evaluate_form(x[i], y[i], second, 1 - second)
            + evaluate_form(x[i], y[i], x[j], y[j])
        )
        jumps[name] = high["form_change_" + name] / unit + tangent_part / (low["area"] * unit) + shifted
    blend_lengths = low["along"] / high["weight"], low["across"] / high["weight"]
    blend_slant = _bound_slant(low, high, "area", "along", "across")
    jump = bound_largest_curvature((jumps["tt"], jumps["tv"], jumps["vv"]), blend_lengths, blend_slant)
    ribbon_lengths = low["ribbon_t"] / high["weight"], low["ribbon_v"] / high["weight"]
    ribbon_slant = _bound_slant(low, high, "ribbon_area", "ribbon_t", "ribbon_v")
    primary_curvature = bound_largest_curvature((form["tt"], form["tv"], form["vv"]), ribbon_lengths, ribbon_slant)

    def bound_evaluation_jump(
        name: str, turn: Array, lengths: tuple[Array, Array], slant: Slant, curvature: Array
    ) -> Array:
        errors = [high[f"{name}_error_{order}"] + turn * high[f"{name}_size_{order}"] for order in ("20", "11", "02")]
        changed = bound_largest_curvature((errors[0], errors[1], errors[2]), lengths, slant)
        return (1 + turn) ** 2 * changed + turn * (2 + turn) * curvature

    blend_turn, primary_turn = _bound_evaluation_turns(low, high)
    blend_curvature = primary_curvature + jump
    evaluated = (
        bound_evaluation_jump("blend", blend_turn, blend_lengths, blend_slant, blend_curvature)
        + (PROOF_TOLERANCES.normal_comparison / blend_slant[0] + 4 * high["parameter_error"]) * blend_curvature
    )
    if "primary_area" in high:
        w = high["primary_weight"]
        lengths = low["primary_u"] / w, low["primary_v"] / w
        slant = _bound_slant(low, high, "primary_area", "primary_u", "primary_v")
        # twice: as OCCT evaluates the primary, and as it is composed with the rail here
        evaluated = evaluated + 2 * bound_evaluation_jump("primary", primary_turn, lengths, slant, primary_curvature)
    return (1 + sine**2) * jump + 2 * sine**2 * primary_curvature + evaluated


def bound_largest_curvature(forms: tuple[Array, Array, Array], lengths: tuple[Array, Array], slant: Slant) -> Array:
    """Bound the absolute value of II(x, x) for all unit x of a plane.

    From bounds of that of II for (a, a), (a, b) and (b, b), of the lengths of a and b from below, and of their angle.
    """
    (a, b), (sine, cosine) = lengths, slant
    aa, ab, bb = forms[0] / a**2, forms[1] / (a * b), forms[2] / b**2
    across = (ab + cosine * aa) / sine
    both = (bb + 2 * cosine * ab + cosine**2 * aa) / sine**2
    return (aa + both) / 2 + np.hypot((aa - both) / 2, across)
