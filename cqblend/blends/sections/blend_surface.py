"""The blend surface between two rails: a Hermite section across, the rails' own splines along.

In homogeneous 4-space, with v running from rail 1 to rail 2 (Kim & Elber, section 2, with a gauge for the weight), for
G1 on both sides

    H(t, v) = C1 (2v^3 - 3v^2 + 1) + C2 (3v^2 - 2v^3) + T1 (v^3 - 2v^2 + v) - T2 (v^3 - v^2),

whose four rows of poles across are C1, C1 + T1/3, C2 + T2/3, C2: both fields point into the blend. Other orders of
continuity, on either side, take as many jets more or less. The *exact* form takes C = P(c) and T = DP(c) d as they are,
of any degree. The *compact* form replaces them by quintics within a tolerance
(:mod:`cqblend.blends.sections.compact_form`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from cqblend.blends.quality.creases import suggest_remedy
from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets, is_faded
from cqblend.blends.rails.steering import SLIVER_SHARE, find_required_turns
from cqblend.blends.sections.compact_form import compact_jets
from cqblend.blends.sections.hermite_section import Jets, build_section
from cqblend.errors import DegreeError, GeometryError, InputError
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import align_breaks
from cqblend.splines.evaluation import BreakSide
from cqblend.surfaces.vectors import cross_product, normalise_vectors

Form = Literal["exact", "compact"]
SectionBuilder = Callable[[tuple[Jets, Jets]], Surface]
LARGEST_DEGREE = 25  # of OCCT's B-splines
MOST_AUTO_DEGREE = 7  # up to which ``auto`` keeps the exact form
GRAZING_SINE = 1e-6  # sine of the angle between rail and cross direction, below which they span no tangent plane
FOLD_SAMPLES = np.array([0.001, 0.2, 0.4, 0.6, 0.8, 0.999])  # in a piece, where folds are looked for
SIDES: tuple[BreakSide, BreakSide] = ("left", "right")
TORN_JUMP = 1e-7  # of a field, relative: more is a crease of the surface, not rounding


@dataclass(frozen=True)
class BlendSurface:
    """A blend surface H(t, v), v = 0 on the first rail and 1 on the second, and what it was made from.

    ``residual`` is that of the equations which it solves, if there are any.
    """

    surface: Surface
    ribbons: tuple[Ribbon, Ribbon] = field(repr=False)
    form: Form
    residual: float | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        ribbons = self.ribbons if isinstance(self.ribbons, tuple) else ()
        if not isinstance(self.surface, Surface) or [isinstance(one, Ribbon) for one in ribbons] != [True, True]:
            raise InputError("a blend has a Surface and two ribbons: hermite_blend and the like make one")


def _align_jets(ribbons: tuple[Ribbon, Ribbon]) -> tuple[list[Curve], list[Curve]]:
    """Return the homogeneous jets of both ribbons on common breaks, none of which nearly coincide.

    Those of light ribbons are of the lowest degree that they really have.
    """
    sides = []
    for ribbon in ribbons:
        jets = [
            jet.reduce(tolerance=1e-13) if ribbon.light else jet for jet in ribbon.compose_jets()[: ribbon.order + 1]
        ]
        sides.append(jets)
    together, count = align_breaks([*sides[0], *sides[1]]), len(sides[0])
    gathered = together[:count], together[count:]
    _check_jumps(ribbons, gathered)
    for ribbon, jets in zip(ribbons, gathered, strict=True):
        if ribbon.order:
            _check_tangent_plane(ribbon, jets[0], jets[1])
    return gathered


def _check_tangent_plane(ribbon: Ribbon, rail: Curve, field: Curve) -> None:
    """Raise GeometryError where rail and cross direction are parallel: there, the blend would turn over."""
    t = (rail.breaks[:-1] + np.diff(rail.breaks) * (np.arange(4)[:, None] / 4)).T.ravel()
    t = t[~is_faded(ribbon, t)]
    rate, vector = dehomogenise_jets(rail.jet(t, 1))[1], dehomogenise_jets(np.stack([rail(t), field(t)]))[1]
    sine = (
        cross_product(normalise_vectors(rate), normalise_vectors(vector))
        * ribbon.primary.evaluate_normals(ribbon.find_native_parameters(t))
    ).sum(1)
    sine *= np.sign(sine.sum())
    if not np.all(sine > GRAZING_SINE):
        raise GeometryError(
            f"the cross direction runs along the rail at t = {t[sine.argmin()]:.6g}: there, it spans no tangent plane "
            "with it; choose other tangents, or a smaller steer"
        )


def _check_jumps(ribbons: tuple[Ribbon, Ribbon], sides: tuple[Jets, Jets]) -> None:
    """Raise GeometryError where a jet jumps along its rail: a blend with that jet would be torn.

    The first one jumps at a crease of the surface, the second one where its curvature jumps, unless the first direction
    is parallel to the knot line there.
    """
    torn = [(ribbon, *_measure_jumps(jets)) for ribbon, jets in zip(ribbons, sides, strict=True)]
    for _, t, jumps in torn:
        for k in range(1, len(jumps) + 1):
            jump = jumps[k - 1]
            if not jump.any():
                continue
            where = f"t = {t[jump.argmax()]:.6g}"
            if k == 1:
                raise GeometryError(
                    f"a face has a crease across the blend at {where}: the directions into it jump by "
                    f"{jump.max():.2g}; blend the smooth parts one by one"
                )
            places = [
                [
                    one
                    for one in find_required_turns(rough, rough.order)
                    if abs(one.crossing.t - at) <= SLIVER_SHARE * np.ptp(rough.c.domain)
                ]
                for rough, t, jumps in torn
                for at in t[jumps[1:].any(axis=0)].tolist()
            ]
            raise GeometryError(
                f"the surface's derivatives of order {k} jump by {jump.max():.2g} where the rail crosses a knot line "
                f"at {where}, at an angle to the direction of the blend that steering may not turn: take "
                f"{suggest_remedy(places)}; or take G{k - 1}"
            )


def _measure_jumps(jets: Jets) -> tuple[Array, Array]:
    """Return the breaks (n,) of jets, and by how much those of order 1 and more jump there; 0 if that is rounding."""
    t = jets[0].breaks[1:-1]
    before, after = (dehomogenise_jets(np.stack([jet(t, side=side) for jet in jets]))[1:] for side in SIDES)
    jumps = np.linalg.norm(after - before, axis=2)
    return t, np.where(jumps > TORN_JUMP * np.abs(after).max(initial=0.0), jumps, 0.0)


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
    if form == "compact" or (form == "auto" and degree > MOST_AUTO_DEGREE):
        return BlendSurface(fill(compact_jets(jets, tolerance, angular_tolerance)), ribbons, "compact")
    if degree > LARGEST_DEGREE:
        raise DegreeError(
            f"the exact blend has degree {degree} along the rail, OCCT holds {LARGEST_DEGREE}; take form='compact'"
        )
    return BlendSurface(fill(jets), ribbons, "exact")


def find_fold(surface: Surface) -> float | None:
    """Return a t at which the normal of a blend turns over between neighbours of a grid; None if it does not.

    The grid has six points a piece, some next to its ends, and 97 across.
    """
    breaks = surface.breaks[0]
    t = (breaks[:-1] + np.multiply.outer(FOLD_SAMPLES, np.diff(breaks))).T.ravel()
    v = (np.arange(97) + 0.5) / 97
    normals = cross_product(surface.grid(t, v, 1, 0), surface.grid(t, v, 0, 1))
    along, across = (normals[1:] * normals[:-1]).sum(axis=-1), (normals[:, 1:] * normals[:, :-1]).sum(axis=-1)
    for cosine in (along, across):
        over = np.argwhere(cosine <= 0)
        if len(over):
            return float(t[over[0][0]])
    return None
