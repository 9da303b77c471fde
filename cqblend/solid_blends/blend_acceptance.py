"""What a blend surface, and the certificate of its finished face, must fulfil."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from cqblend.blend_options import BlendRequest
from cqblend.blends.quality.creases import CreaseLimit
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.verification.patch_certification import CertifiedPatch
from cqblend.certificate import Certificate
from cqblend.errors import VerificationError
from cqblend.solid_blends.strip_context import StripContext
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES


class _Promise(NamedTuple):
    """A measurement of the certificate that has a limit."""

    name: str
    value: float
    limit: float
    unit: str


def get_crease_limits(request: BlendRequest) -> CreaseLimit:
    """Return how sharp creases inside a blend may be."""
    return CreaseLimit(request.angular_tolerance, request.crease)


def check_promises(certificate: Certificate, context: StripContext, blend: BlendSurface) -> None:
    """Check that the finished faces measure up to what the form of a blend promises.

    Raises
    ------
    VerificationError
        If a measurement is above its limit.
    """
    is_exact = certificate.form == "exact"
    tolerances, joint, request = SOLID_BLEND_TOLERANCES, context.joint, context.method.request
    size, crease = context.method.size, get_crease_limits(request).find_limit(blend.ribbons)
    angle = tolerances.exact_angle if is_exact else request.angular_tolerance
    jump = (tolerances.exact_curvature_jump if is_exact else tolerances.compact_curvature_jump) / size
    gap = max(tolerances.gap, request.tolerance, 2 * joint.tolerance)
    crease_limit = tolerances.inner_crease_margin * crease
    roughness = tolerances.inner_crease_margin * max(ribbon.roughness for ribbon in blend.ribbons)
    promises = [_Promise("inner crease", certificate.inner_crease, crease_limit, "rad")]
    for rail, continuity in zip(certificate.rails, request.continuity, strict=True):
        promises.append(_Promise("gap", rail.gap, gap, "mm"))
        if rail.held:
            continue
        if continuity != "G0":
            promises.append(_Promise("angle", rail.angle, angle, "rad"))
        if continuity in ("G2", "G3"):
            promises.append(_Promise("curvature jump", rail.curvature_jump, jump, "1/mm"))
    for edge in certificate.edges:
        promises.append(_Promise(f"gap at its {edge.kind}", edge.gap, edge.tolerance, "mm"))
        if edge.angle is not None:
            promises.append(
                _Promise(f"angle at its {edge.kind}", edge.angle, max(angle, crease_limit, roughness), "rad")
            )
    _require_promises(promises, joint.name, "blend")


def check_patch_promises(patch: CertifiedPatch, context: StripContext) -> None:
    """Check that a face of a corner measures up to what its blends promise; ``context`` is that of one of them.

    Raises
    ------
    VerificationError
        If a measurement is above its limit.
    """
    angle = context.method.request.angular_tolerance
    promises = [_Promise("inner crease", patch.inner_crease, angle, "rad")]
    for edge in patch.edges:
        promises.append(_Promise(f"gap at its {edge.kind}", edge.gap, edge.tolerance, "mm"))
        if edge.angle is not None:
            promises.append(_Promise(f"angle at its {edge.kind}", edge.angle, angle, "rad"))
    _require_promises(promises, context.joint.name, "corner")


def _require_promises(promises: Sequence[_Promise], shape: str, subject: str) -> None:
    """Raise VerificationError if a measurement of a subject is above its limit."""
    for name, value, limit, unit in promises:
        if not value <= limit:
            raise VerificationError(
                f"the {subject} was made, but its {name} is {value:.2g} {unit}, over {limit:.2g}; it is withheld; try "
                "another size or form",
                kind=name,
                shape=shape,
                value=value,
            )
