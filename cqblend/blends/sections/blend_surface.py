"""Builds the blend surface between two ribbons: a Hermite section across, the rails' own splines along.

In homogeneous 4-space, with v running from rail 1 to rail 2 (Kim & Elber, section 2, with a gauge for the weight), for
G1 on both sides

    H(t, v) = C1 (2v^3 - 3v^2 + 1) + C2 (3v^2 - 2v^3) + T1 (v^3 - 2v^2 + v) - T2 (v^3 - v^2),

whose four rows of poles across are C1, C1 + T1/3, C2 + T2/3, C2: both fields point into the blend. Other orders of
continuity, on either side, take as many jets more or less. The *exact* form takes C = P(c) and T = DP(c) d as they are,
of any degree. The *compact* form replaces them by quintics within a tolerance
(:mod:`cqblend.blends.sections.compact_form`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from cqblend.blends.rails.direction_steering import RequiredTurn, find_required_turns
from cqblend.blends.rails.ribbon import BREAK_SIDES, Ribbon, dehomogenise_jets, is_faded
from cqblend.blends.rails.steering_advice import suggest_remedy
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.blends.sections.arc_section import ArcSection
from cqblend.blends.sections.compact_form import compact_jets
from cqblend.blends.sections.hermite_section import Jets, build_section
from cqblend.blends.sections.tolerances import SECTION_TOLERANCES
from cqblend.blends.sections.turned_arcs import TurnedArcs
from cqblend.errors import DegreeError, GeometryError, InputError
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import align_breaks
from cqblend.surfaces.vectors import cross_product, measure_lengths, normalise_vectors

Form = Literal["exact", "compact"]
SectionKind = Literal["arc", "hermite", "pde", "potential"]
SectionBuilder = Callable[[tuple[Jets, Jets]], Surface]
FOLD_SAMPLES = np.array([0.001, 0.2, 0.4, 0.6, 0.8, 0.999])
"""Where in a piece, as shares of it, folds are looked for."""


@dataclass(frozen=True)
class BlendSurface:
    """A blend surface H(t, v), v = 0 on the first rail and 1 on the second, and what it was made from.

    ``kind`` is that of its sections. Of arcs, ``arc`` is the analytic surface that it is. ``residual`` is that of the
    partial differential equations that it solves, None if there are none.
    """

    surface: Surface
    ribbons: tuple[Ribbon, Ribbon] = field(repr=False)
    form: Form
    kind: SectionKind = field(default="hermite", kw_only=True)
    arc: ArcSection | TurnedArcs | None = field(default=None, kw_only=True)
    residual: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        ribbons = self.ribbons if isinstance(self.ribbons, tuple) else ()
        if not isinstance(self.surface, Surface) or [isinstance(ribbon, Ribbon) for ribbon in ribbons] != [True, True]:
            raise InputError("a blend has a Surface and two ribbons: hermite_blend and the like make one")


def _align_jets(ribbons: tuple[Ribbon, Ribbon]) -> tuple[list[Curve], list[Curve]]:
    """Return the homogeneous jets of both ribbons on common breaks, none of which nearly coincide.

    Those of light ribbons are reduced to the lowest degree that they really have. Jets of higher order may be small
    differences of large terms, so that their rounding is that of the position.
    """

    def compose_jets(ribbon: Ribbon) -> list[Curve]:
        jets = ribbon.jets[: ribbon.order + 1]
        if not ribbon.light:
            return list(jets)
        sizes = [float(np.abs(jet.coefs).max()) for jet in jets]
        shares = [RAIL_TOLERANCES.light_degree_share * max(1.0, sizes[0] / size) if size else 0.0 for size in sizes]
        return [jet.reduce(tolerance=share) if jet.degree > 1 else jet for jet, share in zip(jets, shares, strict=True)]

    first, second = (compose_jets(ribbon) for ribbon in ribbons)
    together = align_breaks([*first, *second])
    sides = together[: len(first)], together[len(first) :]
    _check_jumps(ribbons, sides)
    for ribbon, jets in zip(ribbons, sides, strict=True):
        if ribbon.order and not ribbon.is_point:
            _check_tangent_plane(ribbon, jets[0], jets[1])
    return sides


def _check_tangent_plane(ribbon: Ribbon, rail: Curve, field: Curve) -> None:
    """Raise GeometryError where rail and cross direction are parallel: there, the blend would turn over."""
    t = (rail.breaks[:-1] + np.diff(rail.breaks) * (np.arange(4)[:, None] / 4)).T.ravel()
    t = t[~is_faded(ribbon, t)]
    if ribbon.light:  # all its points are alike
        t = t[:1]
    rail_jet = rail.jet(t, 1)
    rate, vector = dehomogenise_jets(rail_jet)[1], dehomogenise_jets(np.stack([rail_jet[0], field(t)]))[1]
    sine = (
        cross_product(normalise_vectors(rate), normalise_vectors(vector))
        * ribbon.primary.evaluate_normals(ribbon.find_native_parameters(t))
    ).sum(1)
    sine *= np.sign(sine.sum())
    if not np.all(sine > SECTION_TOLERANCES.grazing_sine):
        raise GeometryError(
            f"the cross direction runs along the rail at t = {t[sine.argmin()]:.6g}: there, it spans no tangent plane "
            "with it; choose other tangents, or a smaller steer"
        )


def _check_jumps(ribbons: tuple[Ribbon, Ribbon], sides: tuple[Jets, Jets]) -> None:
    """Raise GeometryError where a jet jumps along its rail: a blend with that jet would be torn.

    The first one jumps at a crease of the surface, the second one where its curvature jumps, unless the first direction
    is parallel to the knot line there.
    """
    torn = [
        (ribbon, *_measure_jumps(jets))
        for ribbon, jets in zip(ribbons, sides, strict=True)
        if not ribbon.light  # whose curves meet at their breaks, on smooth surfaces
    ]
    for _, t, jumps in torn:
        for k, jump in enumerate(jumps, start=1):
            if not jump.any():
                continue
            where = f"t = {t[jump.argmax()]:.6g}"
            if k == 1:
                raise GeometryError(
                    f"a face has a crease across the blend at {where}: the directions into it jump by "
                    f"{jump.max():.2g}; blend the smooth parts one by one"
                )
            places = [
                _find_turns_at(ribbon, at) for ribbon, t, jumps in torn for at in t[jumps[1:].any(axis=0)].tolist()
            ]
            raise GeometryError(
                f"the surface's derivatives of order {k} jump by {jump.max():.2g} where the rail crosses a knot line "
                f"at {where}, at an angle to the direction of the blend that steering may not turn: take "
                f"{suggest_remedy(places)}; or take G{k - 1}"
            )


def _find_turns_at(ribbon: Ribbon, t: float) -> list[RequiredTurn]:
    """Return the turns that the knot lines crossed at t, or next to it, ask for."""
    slack = RAIL_TOLERANCES.sliver_share * np.ptp(ribbon.c.domain)
    return [turn for turn in find_required_turns(ribbon, ribbon.order) if abs(turn.crossing.t - t) <= slack]


def _measure_jumps(jets: Jets) -> tuple[Array, Array]:
    """Return the breaks (n,) of jets, and the jumps (orders, n) of those of order 1 and more; 0 if it is rounding."""
    t = jets[0].breaks[1:-1]
    before, after = (dehomogenise_jets(np.stack([jet(t, side=side) for jet in jets]))[1:] for side in BREAK_SIDES)
    jumps = np.linalg.norm(after - before, axis=2)
    return t, np.where(jumps > SECTION_TOLERANCES.torn_jump * np.abs(after).max(initial=0.0), jumps, 0.0)


def blend_ribbons(
    ribbons: tuple[Ribbon, Ribbon],
    form: str,
    tolerance: float,
    angular_tolerance: float,
    fill: SectionBuilder = build_section,
) -> BlendSurface:
    """Blend two ribbons, with as many orders of continuity on each as it has directions.

    ``form`` is "exact", "compact" or "auto" (exact where its degree is at most 7); ``fill`` makes the surface of the
    jets of both ribbons.

    Raises
    ------
    DegreeError
        If the exact form is asked for and its degree is above 25.
    GeometryError
        If the compact form does not reach the tolerances on 4096 pieces.
    """
    jets = _align_jets(ribbons)
    degree = max(jet.degree for side in jets for jet in side)
    if form == "compact" or (form == "auto" and degree > SECTION_TOLERANCES.most_auto_degree):
        compact = fill(compact_jets(jets, tolerance, angular_tolerance))
        return BlendSurface(_gather_poles(compact, ribbons), ribbons, "compact")
    if degree > SECTION_TOLERANCES.largest_degree:
        raise DegreeError(
            f"the exact blend has degree {degree} along the rail, OCCT holds {SECTION_TOLERANCES.largest_degree}; "
            "take form='compact'"
        )
    return BlendSurface(_gather_poles(fill(jets), ribbons), ribbons, "exact")


def _gather_poles(surface: Surface, ribbons: tuple[Ribbon, Ribbon]) -> Surface:
    """Return a surface whose boundaries are exactly one point where the rails are.

    Next to it, derivatives along the rail are small differences, which its rounding would be as large as.
    """
    if not any(ribbon.is_point for ribbon in ribbons):
        return surface
    coefs = surface.coefs.copy()
    for ribbon, row, piece in zip(ribbons, (0, -1), (0, -1), strict=True):
        if ribbon.is_point:
            rail = coefs[:, row, :, :, piece]  # (p + 1, dim, n)
            if surface.rational:
                point = rail[0, :3, 0] / rail[0, 3, 0]
                rail[:, :3] = point[:, None] * rail[:, 3:]
            else:
                rail[:] = rail[0, :, 0][:, None]
    return Surface(surface.breaks, coefs, rational=surface.rational, continuity=surface.continuity)


def find_fold(surface: Surface, ribbons: Sequence[Ribbon] = ()) -> float | None:
    """Return a t at which the normal of a blend turns over between neighbours of a grid; None if it does not.

    Where one of its ribbons has faded, it is not looked at: what is there is as thin as what a fit misses.

    The grid has six points for each piece, some next to its ends, and 97 across. It is looked at only if the normal
    turns, or gets shorter, so much between neighbours of a coarser one that it may turn over in between.
    """
    breaks, finest = surface.breaks[0], SECTION_TOLERANCES.fold_sections
    t = (breaks[:-1] + np.multiply.outer(FOLD_SAMPLES, np.diff(breaks))).T.ravel()
    for ribbon in ribbons:
        t = t[~is_faded(ribbon, t)]
    pieces = len(surface.breaks[1]) - 1
    coarse = min(finest, (SECTION_TOLERANCES.fold_sections_per_degree * surface.degree[1] + 1) * pieces)
    if not _may_turn_over(_evaluate_grid_normals(surface, t, coarse)):
        return None
    normals = _evaluate_grid_normals(surface, t, finest)
    along, across = (normals[1:] * normals[:-1]).sum(axis=-1), (normals[:, 1:] * normals[:, :-1]).sum(axis=-1)
    for cosine in (along, across):
        over = np.argwhere(cosine <= 0)
        if len(over):
            return float(t[over[0][0]])
    return None


def _evaluate_grid_normals(surface: Surface, t: Array, sections: int) -> Array:
    """Return normals of any length at t (n,) and in the middles of so many equal parts of the sections, (n, m, 3)."""
    v = (np.arange(sections) + 0.5) / sections
    return cross_product(surface.grid(t, v, 1, 0), surface.grid(t, v, 0, 1))


def _may_turn_over(normals: Array) -> bool:
    """Whether normals (n, m, 3) differ so much from their neighbours that they may turn over between them."""
    lengths = measure_lengths(normals)
    for first, second in (
        ((slice(None, -1),), (slice(1, None),)),
        ((slice(None), slice(None, -1)), (slice(None), slice(1, None))),
    ):
        dots, products = (normals[first] * normals[second]).sum(axis=-1), lengths[first] * lengths[second]
        shorter = np.minimum(lengths[first], lengths[second]) / np.maximum(lengths[first], lengths[second])
        if not ((dots > SECTION_TOLERANCES.quiet_cosine * products) & (shorter > SECTION_TOLERANCES.quiet_ratio)).all():
            return True
    return False
