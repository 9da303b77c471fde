"""How fast potential blends are made.

Run ``python -m benchmarks.potential`` from the project's folder. The paper's two Bezier patches (asked: a second) and
its wing and fuselage (asked: five), by what takes the time: finding and tracing the intersection half-way, carrying it
through both families, ribbons, and filling. Then, in the same run, the peer: OCCT's own intersection of the two
surfaces as they are half-way, GeomAPI_IntSS, of which a potential blend needs one for every section along x.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from OCP.GeomAPI import GeomAPI_IntSS

import cqblend
from benchmarks.timing import measure_cpu
from cqblend.blends.potential.family_pair import FamilyPair
from cqblend.blends.potential.intersection_branches import trace_branches
from cqblend.blends.potential.swept_blend import sweep_branch
from cqblend.blends.potential.swept_section import SweptSection
from cqblend.brep.conversion import spline_arrays

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))


def main() -> None:
    import potential_models
    import potential_patches

    tower, ground = potential_patches.primaries
    families = (
        cqblend.reshape(tower, reference="extents", tuning=(0, -1, 0.5), amounts=0.4),
        cqblend.reshape(ground, reference=(0, 0, -12), amounts=0.06),
    )
    print(
        f"{'':24s}{'tracing':>9s}{'carrying':>10s}{'ribbons':>9s}{'filling':>9s}{'whole':>8s}{'OCCT, one curve':>17s}"
    )
    for name, pair, relation in (
        ("two patches, elliptic", families, cqblend.Conic(1, 1, 0)),
        ("two patches, sharp", families, cqblend.Conic(1, 1, -10)),
        ("two patches, a = 3", families, cqblend.Conic(3, 1, 0)),
    ):
        report(name, pair, relation, lambda pair=pair, relation=relation: cqblend.potential_blend(*pair, relation))
    blend = potential_models.fairing()
    report("fairing of a wing", blend.families, blend.relation, potential_models.fairing)


def report(name: str, families: Any, relation: cqblend.Relation, whole: Callable[[], object]) -> None:
    """Print the CPU times of one blend, s."""
    meeting = FamilyPair.from_relation(families, relation)
    found = trace_branches(meeting, 0.5)
    swept = sweep_branch(meeting, found[0], 0.5)
    allowed = 1e-5 * swept.width
    ribbons = swept.fit_ribbons(allowed)
    fill = SweptSection.from_sweep(swept, swept.closed, allowed, swept.kinks)
    s1, s2 = meeting.s(0.5)
    one, two = (
        spline_arrays.surface_from_arrays(*family(s, 1e-4).to_bspline())
        for family, s in zip(families, (s1, s2), strict=True)
    )
    times = [
        measure_cpu(lambda: trace_branches(meeting, 0.5)),
        measure_cpu(lambda: sweep_branch(meeting, found[0], 0.5)),
        measure_cpu(lambda: swept.fit_ribbons(allowed)),
        measure_cpu(lambda: fill.blend_ribbons(ribbons, "auto", 1e-7, 1e-5)),
        measure_cpu(whole),
        measure_cpu(lambda: GeomAPI_IntSS(one, two, 1e-7)),
    ]
    widths = (9, 10, 9, 9, 8, 17)
    print(f"{name:24s}" + "".join(f"{one / 1e3:{width}.3f}" for one, width in zip(times, widths, strict=True)))


if __name__ == "__main__":
    main()
