"""The certificate of a blend: measured on what is finished.

By :mod:`cqblend.brep.verification.edge_continuity`, which knows no blends.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from OCP.BRep import BRep_Tool

from cqblend.blends.quality.fairness import bending_energy
from cqblend.blends.quality.proof import prove_blend
from cqblend.blends.rails.ribbon import Ribbon, is_faded
from cqblend.blends.sections.blend_surface import BlendSurface, find_fold
from cqblend.brep.read import spline_arrays
from cqblend.brep.read.spline_conversion import to_face
from cqblend.brep.rewrite.shell_edit import ProposedSolid
from cqblend.brep.select.edge_joint import Joint
from cqblend.brep.verification.edge_continuity import (
    find_inner_crease,
    measure_continuity_between,
    measure_surface_contact,
    sample_outline,
)
from cqblend.brep.verification.measuring_places import find_knot_crossings, spread_samples
from cqblend.certificate import Certificate, RailRecord
from cqblend.splines import Curve, Surface
from cqblend.surfaces.primaries import Array

SAMPLES_PER_EDGE = 400  # points at which each piece of a rail is measured, beside those at its knots
STATIONS_PER_RAIL = 1000  # and of a rail that is no edge


def certify_blend(joint: Joint, proposal: ProposedSolid, blend: BlendSurface) -> Certificate:
    """Measure a verified proposal."""
    records = []
    for i, (rail, edges) in enumerate(zip(blend.ribbons, proposal.rail_edges, strict=True)):
        sharp = partial(_is_not_faded, rail) if rail.fades else None
        found = [
            measure_continuity_between(
                ((proposal.blend_face, edge), (proposal.trimmed_faces[i], edge)), SAMPLES_PER_EDGE, sharp
            )
            for edge in edges
        ]
        records.append(
            RailRecord(
                side=i + 1,
                face=joint.face_numbers[i],
                edge=joint.edge_number,
                gap=max(one.gap for one in found),
                angle=max(one.angle for one in found),
                curvature_jump=max(one.curvature_jump for one in found),
                direction=rail.direction,
                length=rail.length,
                tolerance=max(one.tolerance for one in found),
                kept=_measure_faded_share(rail),
            )
        )
    fitted = [2 * side.pcurve_tolerance for side in joint.sides]  # and what is between the checks
    return _build_certificate(
        blend,
        records,
        inner_crease=find_inner_crease(proposal.blend_face).angle,
        doubts=(fitted[0], fitted[1]),
        method="wire substitution" + (", flat ends" if proposal.cap_count else ""),
        stations=SAMPLES_PER_EDGE,
        edge_tolerance=proposal.tolerance,
        outline=None if joint.spine.closed else sample_outline(proposal.blend_face),
    )


def certify_surfaces(blend: BlendSurface, rails: Sequence[tuple[Surface, Curve]]) -> Certificate:
    """Measure a blend of surfaces along its rails, each a surface and a curve in its parameter plane."""
    face = to_face(blend.surface)
    records = []
    for i, ((surface, curve), ribbon) in enumerate(zip(rails, blend.ribbons, strict=True)):
        other = spline_arrays.surface_from_arrays(*surface.to_bspline())
        breaks = [blend.surface.breaks[0], curve.breaks, find_knot_crossings(curve, *curve.domain, other)]
        t = spread_samples(np.unique(np.concatenate(breaks)), STATIONS_PER_RAIL)
        t = t[_is_not_faded(ribbon, t)]
        gap, angle, jump = measure_surface_contact(
            (BRep_Tool.Surface_s(face), other), partial(_evaluate_rail_parameters, curve, i), t
        )
        records.append(
            RailRecord(
                i + 1, 0, 0, gap, angle, jump, ribbon.direction, ribbon.length, 0.0, _measure_faded_share(ribbon)
            )
        )
    return _build_certificate(
        blend,
        records,
        inner_crease=find_inner_crease(face).angle,
        method="surfaces",
        stations=STATIONS_PER_RAIL,
        valid=find_fold(blend.surface) is None,
    )


def _evaluate_rail_parameters(curve: Curve, end: int, t: Array) -> tuple[Array, Array]:
    """Return the parameters (n, 2) of a rail on a blend, at v = 0 or 1, and on its surface."""
    return np.stack([t, np.full_like(t, end)], -1), curve(t)


def _is_not_faded(ribbon: Ribbon, t: Array) -> Array:
    return ~is_faded(ribbon, t)


def _measure_faded_share(ribbon: Ribbon) -> float:
    """Return on what share of its rail a ribbon has faded."""
    return float(is_faded(ribbon, np.linspace(*ribbon.c.domain, STATIONS_PER_RAIL)).mean()) if ribbon.fades else 0.0


def _build_certificate(
    blend: BlendSurface,
    records: Sequence[RailRecord],
    *,
    inner_crease: float,
    method: str,
    stations: int,
    valid: bool = True,
    edge_tolerance: float = 0.0,
    doubts: tuple[float, float] = (0.0, 0.0),
    outline: Array | None = None,
) -> Certificate:
    surface = blend.surface
    t = np.linspace(*surface.domain[0], 65)
    across = np.linalg.norm(surface(t, np.ones(65)) - surface(t, np.zeros(65)), axis=1)
    _, _, poles, weights = surface.to_bspline()
    return Certificate(
        rails=tuple(records),
        form=blend.form,
        degree=surface.degree,
        poles=poles.shape[:2],
        rational=weights is not None,
        inner_crease=inner_crease,
        method=method,
        valid=valid,
        width=(float(across.min()), float(across.max())),
        stations=stations,
        edge_tolerance=edge_tolerance,
        residual=blend.residual,
        proofs=(partial(prove_blend, blend, doubts),),
        energies=(partial(bending_energy, surface, outline),),
    )
