"""Small jobs that users wait for, each beside a peer's in the same run.

Run ``python -m benchmarks.quick_jobs`` from the project's folder. Each line: the job, its CPU time and its peer's (ms,
medians of several runs), and their ratio. Peers do what is nearest to the job that NumPy, shapely or OCCT offer.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cadquery as cq
import numpy as np
import shapely

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "support"))

from pieces_cases import gores, lattice
from wavy_rails import wavy_pair

from benchmarks.timing import measure_cpu
from cqblend.blends.quality.smoothness_proof import prove_blend
from cqblend.blends.sections.blend_surface import blend_ribbons
from cqblend.patterns.outline.overlap import find_overlap
from cqblend.patterns.stock.labels import place_labels
from cqblend.patterns.stock.tab_options import TabOptions
from cqblend.patterns.stock.tabs import fit_tabs
from cqblend.splines import Curve, normalise

FIELD = Curve.bezier([(1, 0, 0.2), (0.6, 0.9, -0.1), (-0.4, 0.7, 0.5)])


def report(name: str, mine: float, peer_name: str, peer: float) -> None:
    """Print one line."""
    print(f"{name:44s}{mine:10.2f} ms   {peer_name:32s}{peer:10.2f} ms   ratio {mine / peer:8.2f}")


def main() -> None:
    """Run all jobs."""
    blend = blend_ribbons(wavy_pair(), "exact", 1e-7, 1e-5)
    box = cq.Workplane().box(30, 20, 10)
    fillet = measure_cpu(lambda: box.edges("|Z").fillet(2).val())
    report(
        "proof of a rail of degree 18", measure_cpu(lambda: prove_blend(blend)), "fillet of four edges of a box", fillet
    )

    pieces = gores(30, segments=300).pieces
    polygons = [shapely.Polygon(np.concatenate([run.path.points for run in piece.loops[0]])) for piece in pieces]
    valid = measure_cpu(lambda: [shapely.is_valid(polygon) for polygon in polygons])
    report(
        "overlap of 30 gores of 600 segments", measure_cpu(lambda: [find_overlap(p) for p in pieces]), "is_valid", valid
    )

    squares = lattice(20, 25)
    outlines = [shapely.Polygon(np.concatenate([r.path.points for r in p.loops[0]])) for p in squares.pieces]
    buffers = measure_cpu(lambda: shapely.buffer(outlines, -1.0))
    labels = measure_cpu(lambda: [place_labels(piece, squares.seams, height=2.0) for piece in squares.pieces])
    report("labels on 955 seams", labels, "500 offsets by shapely", buffers)
    few = lattice(10, 12)
    report(
        "tabs on 218 seams",
        measure_cpu(lambda: fit_tabs(few, TabOptions(width=3.0))),
        "500 offsets by shapely",
        buffers,
    )

    t = np.linspace(0, 1, 2001)
    report(
        "unit field within 1e-5",
        measure_cpu(lambda: normalise(FIELD, 1e-5)),
        "2001 points of it",
        measure_cpu(lambda: FIELD(t)),
    )


if __name__ == "__main__":
    main()
