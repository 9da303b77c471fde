"""A cone and a cylinder that run through each other (Elber 1995, figure 7): each face is one piece, with its holes.

Nothing is approximated but the curves where the two meet; those are as fine as the tolerance.
"""

import cadquery as cq
import unroll_models


def written(pattern):
    """Print the report, and write the pieces for a laser that takes away 0.15 mm of sheet metal."""
    print(pattern.report)
    pattern.export("cone_with_cylinder.dxf", kerf=0.15)


flat = cq.Workplane(unroll_models.cone_with_cylinder()).unroll(0.05, report=written)
print(flat.faces().size(), "faces on XY")

if "show_object" in globals():
    show_object(flat, name="cone with cylinder")  # type: ignore[name-defined]  # noqa: F821  (given by CQ-editor)
