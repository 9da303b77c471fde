"""What a blend surface, and the certificate of its finished face, must fulfil."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cqblend.blend_options import BlendRequest
from cqblend.blends.quality.creases import CreaseLimit
from cqblend.blends.sections.blend_surface import BlendSurface, find_fold
from cqblend.brep.selection.joint import Joint
from cqblend.certificate import Certificate
from cqblend.errors import GeometryError, VerificationError
from cqblend.solid_blends.blend_construction import get_largest_size
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import normalise_vectors


class _Promise(NamedTuple):
    """A measurement of the certificate that has a limit."""

    name: str
    value: float
    limit: float
    unit: str


def check_sections(blend: BlendSurface, request: BlendRequest) -> None:
    """Check that no section of a blend loops, and that the blend does not fold.

    Raises
    ------
    GeometryError
        If a section loops, because its cross derivatives are too long, or the blend folds.
    """
    surface = blend.surface
    t, v = np.meshgrid(np.linspace(*surface.domain[0], 33), np.linspace(0, 1, 33), indexing="ij")
    tangents = surface(t, v, 0, 1)
    if request.relation is not None:
        _check_total_turns(t, tangents)
    else:
        chords = surface(t, np.ones_like(v)) - surface(t, np.zeros_like(v))
        progress = (tangents * chords).sum(axis=-1)
        if not np.all(progress > 0):
            raise GeometryError(
                f"the section at t = {t.flat[progress.argmin()]:.3g} turns back on itself: "
                + (
                    "it leaves its rails too fast; take a smaller bulge"
                    if blend.residual is None
                    else "take smaller parameters, which let more of the rails' shape reach the middle, or a smaller "
                    "bulge"
                )
            )
    fold = find_fold(surface)
    if fold is not None:
        raise GeometryError(
            f"the blend folds at t = {fold:.4g}: its sections cross; take another size"
            + ("" if request.relation is not None else ", smaller bulge or other tangents")
        )


def get_crease_limits(request: BlendRequest) -> CreaseLimit:
    """Return how sharp creases inside a blend may be."""
    return CreaseLimit(request.angular_tolerance, request.crease)


def _check_total_turns(t: Array, tangents: Array) -> None:
    """Raise GeometryError where a section of a potential blend turns by half a turn or more.

    At acute edges such sections leave their rails backwards, so that their progress along the chord tells nothing.
    """
    directions = normalise_vectors(tangents.reshape(-1, 3)).reshape(tangents.shape)
    cosines = (directions[:, 1:] * directions[:, :-1]).sum(axis=-1)
    turns = np.arccos(np.clip(cosines, -1, 1)).sum(axis=1)
    if turns.max() >= np.pi:
        raise GeometryError(
            f"the section at t = {t[turns.argmax(), 0]:.3g} turns by {turns.max():.3g} rad: choose smaller a and b"
        )


def check_promises(certificate: Certificate, request: BlendRequest, joint: Joint, crease: float) -> None:
    """Check that the finished faces measure up to what the form promises; ``crease`` is the largest inside (rad).

    Raises
    ------
    VerificationError
        If a measurement is above its limit.
    """
    is_exact = certificate.form == "exact"
    tolerances, size = SOLID_BLEND_TOLERANCES, get_largest_size(request)
    angle = tolerances.exact_angle if is_exact else request.angular_tolerance
    jump = (tolerances.exact_curvature_jump if is_exact else tolerances.compact_curvature_jump) / size
    gap = max(tolerances.gap, request.tolerance, 2 * joint.tolerance)
    crease_limit = tolerances.inner_crease_margin * crease
    promises = [_Promise("inner crease", certificate.inner_crease, crease_limit, "rad")]
    for rail, continuity in zip(certificate.rails, request.continuity, strict=True):
        promises.append(_Promise("gap", rail.gap, gap, "mm"))
        if continuity != "G0":
            promises.append(_Promise("angle", rail.angle, angle, "rad"))
        if continuity in ("G2", "G3"):
            promises.append(_Promise("curvature jump", rail.curvature_jump, jump, "1/mm"))
    for name, value, limit, unit in promises:
        if not value <= limit:
            raise VerificationError(
                f"the blend was made, but its {name} is {value:.2g} {unit}, over {limit:.2g}; it is withheld; try "
                "another size or form",
                kind=name,
                shape=joint.name,
                value=value,
            )
