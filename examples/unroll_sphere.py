"""A ball of rings (Elber 1995, figure 3): each is part of a cone, so that it lies flat without being stretched.

Prints the report, and writes what is to be cut of paper, and the discs of cardboard that it is glued on.
"""

import cadquery as cq
import unroll_models

patterns = []
flat = cq.Workplane(unroll_models.sphere()).unroll(1, report=patterns.append)

(pattern,) = patterns
print(pattern.report)
pattern.with_tabs(5).export("sphere.dxf")

formers = [former for former in pattern.cross_sections() if isinstance(former, cq.Face)]
print(len(formers), "formers")
cq.exporters.export(cq.Workplane(cq.Compound.makeCompound(formers)), "formers.step")

if "show_object" in globals():
    show_object(flat, name="sphere")  # type: ignore[name-defined]  # noqa: F821  (given by CQ-editor)
