"""A block with one blended edge and its certificate: runs from the shell and in CQ-editor."""

import cadquery as cq

import cqblend

block = cq.Workplane().box(30, 20, 10)
block = block.edges("|Z and >X and >Y").blend(4, report=lambda result: print(result.certificate))

result = cqblend.blend_edges(block, block.edges("|Z and <X and <Y"), width=3)
print(result.certificate)

if "show_object" in globals():
    show_object(result.shape, name="block")  # type: ignore[name-defined]  # noqa: F821  (given by CQ-editor)
