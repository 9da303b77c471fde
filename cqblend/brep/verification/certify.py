"""The certificate of a blend: measured on what is finished.

By :mod:`cqblend.brep.verification.edge_continuity`, which knows no blends.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import numpy as np
from OCP.BRep import BRep_Tool

from cqblend.blends.quality.fairness import bending_energy
from cqblend.blends.quality.proof import prove
from cqblend.blends.rails.ribbon import Ribbon, faded
from cqblend.blends.sections.blend_surface import Blend, folded
from cqblend.brep.read import spline_arrays
from cqblend.brep.read.face_surface import PCURVE
from cqblend.brep.read.spline_conversion import to_face
from cqblend.brep.rewrite.shell_edit import Proposal
from cqblend.brep.select.edge_joint import Joint
from cqblend.brep.verification.edge_continuity import contact, continuity_between, inner_crease, outline
from cqblend.brep.verification.measuring_places import crossings, spread
from cqblend.certificate import Certificate, RailRecord
from cqblend.splines import Curve, Surface
from cqblend.surfaces.primaries import Array

SAMPLES = 400  # points at which each piece of a rail is measured, beside those at its knots
STATIONS = 1000  # and of a rail that is no edge


def certify(joint: Joint, proposal: Proposal, blend: Blend) -> Certificate:
    """Measure a verified proposal."""
    records = []
    for i, (rail, edges) in enumerate(zip(blend.ribbons, proposal.rails, strict=True)):
        sharp = partial(_tied, rail) if rail.fades else None
        found = [
            continuity_between(((proposal.blend, edge), (proposal.sides[i], edge)), SAMPLES, sharp) for edge in edges
        ]
        records.append(
            RailRecord(
                side=i + 1,
                face=joint.faces[i],
                edge=joint.edge,
                gap=max(one.gap for one in found),
                angle=max(one.angle for one in found),
                curvature_jump=max(one.curvature_jump for one in found),
                direction=rail.direction,
                length=rail.length,
                tolerance=max(one.tolerance for one in found),
                kept=_kept(rail),
            )
        )
    fitted = [0.0 if side.native.is_native() else 2 * PCURVE for side in joint.sides]  # and what is between the checks
    return _certificate(
        blend,
        records,
        inner_crease=inner_crease(proposal.blend).angle,
        doubts=(fitted[0], fitted[1]),
        method="wire substitution" + (", flat ends" if proposal.caps else ""),
        stations=SAMPLES,
        edge_tolerance=proposal.tolerance,
        outline=None if joint.spine.closed else outline(proposal.blend),
    )


def certify_surfaces(blend: Blend, rails: Sequence[tuple[Surface, Curve]]) -> Certificate:
    """Measure a blend of surfaces along its rails, each a surface and a curve in its parameter plane."""
    face = to_face(blend.surface)
    records = []
    for i, ((surface, curve), ribbon) in enumerate(zip(rails, blend.ribbons, strict=True)):
        other = spline_arrays.surface_from_arrays(*surface.to_bspline())
        breaks = [blend.surface.breaks[0], curve.breaks, crossings(curve, *curve.domain, other)]
        t = spread(np.unique(np.concatenate(breaks)), STATIONS)
        t = t[_tied(ribbon, t)]
        gap, angle, jump = contact((BRep_Tool.Surface_s(face), other), partial(_places, curve, i), t)
        records.append(RailRecord(i + 1, 0, 0, gap, angle, jump, ribbon.direction, ribbon.length, 0.0, _kept(ribbon)))
    return _certificate(
        blend,
        records,
        inner_crease=inner_crease(face).angle,
        method="surfaces",
        stations=STATIONS,
        valid=folded(blend.surface) is None,
    )


def _places(curve: Curve, end: int, t: Array) -> tuple[Array, Array]:
    """Return the parameters (n, 2) of a rail on a blend, at v = 0 or 1, and on its surface."""
    return np.stack([t, np.full_like(t, end)], -1), curve(t)


def _tied(ribbon: Ribbon, t: Array) -> Array:
    return ~faded(ribbon, t)


def _kept(ribbon: Ribbon) -> float:
    """Return on what share of its rail a ribbon has faded."""
    return float(faded(ribbon, np.linspace(*ribbon.c.domain, STATIONS)).mean()) if ribbon.fades else 0.0


def _certificate(
    blend: Blend,
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
        proofs=(partial(prove, blend, doubts),),
        energies=(partial(bending_energy, surface, outline),),
    )
