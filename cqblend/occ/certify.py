"""The certificate of a blend: measured on the finished faces by :mod:`cqblend.occ.measure`, which knows no blends."""

from __future__ import annotations

import numpy as np

from cqblend.blends.hermite import Blend
from cqblend.certificate import Certificate, RailRecord
from cqblend.occ.joint import Joint
from cqblend.occ.measure import continuity_between, inner_crease
from cqblend.occ.surgery import Proposal

SAMPLES = 400  # points at which each piece of a rail is measured, beside those at its knots


def certify(joint: Joint, proposal: Proposal, blend: Blend) -> Certificate:
    """Measure a verified proposal."""
    records = []
    for i, (rail, edges) in enumerate(zip(blend.ribbons, proposal.rails, strict=True)):
        found = [continuity_between(((proposal.blend, edge), (proposal.sides[i], edge)), SAMPLES) for edge in edges]
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
            )
        )
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
        inner_crease=inner_crease(proposal.blend).angle,
        method="wire substitution" + (", flat ends" if proposal.caps else ""),
        valid=True,
        width=(float(across.min()), float(across.max())),
        stations=SAMPLES,
    )
