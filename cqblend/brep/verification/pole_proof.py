"""What is proven of a rail that is one point: there, the finished faces are measured, and rounding is added."""

from __future__ import annotations

from typing import Literal

import numpy as np
from OCP.BRep import BRep_Tool

from cqblend.blends.quality.smoothness_proof import Proof
from cqblend.blends.quality.tolerances import PROOF_TOLERANCES
from cqblend.brep.measurement.pole_contact import measure_pole_contact
from cqblend.brep.shell_editing.plan_application import BuiltStrip
from cqblend.brep.topology import find_end_vertices
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES


def prove_pole(strip: BuiltStrip, end: Literal[0, 1], size: float) -> Proof | None:
    """Prove how a blend face meets its support face where its rail is one point; None if it is none.

    The sections leave that point along the meridians of a surface of revolution, all in the same way. ``size`` (mm) is
    that of the face, whose rounding adds to that of its place.
    """
    pole = strip.poles[end]
    if pole is None:
        return None
    gap, angle, _ = measure_pole_contact(
        strip.blend_face, pole, strip.trimmed_faces[end], VERIFICATION_TOLERANCES.proof_samples
    )
    point = BRep_Tool.Pnt_s(find_end_vertices(pole)[0])
    largest = float(np.abs(point.Coord()).max()) + size
    return Proof(gap + PROOF_TOLERANCES.point * largest, angle + PROOF_TOLERANCES.closed_form)
