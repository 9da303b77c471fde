"""The spout of the Utah teapot blended onto its body (Kim and Elber, figure 9): compact for a small file, and exact."""

import cadquery as cq

import cqblend
from cqblend import teapot

pot = teapot.body().fuse(teapot.spout())
edge = cq.Workplane(pot).edges(cq.NearestToPointSelector((1.93, 0, 1.05)))

for form in ("compact", "exact"):
    result = cqblend.blend_edges(pot, edge, width=0.15, form=form)
    print(result.certificate)

if "show_object" in globals():
    show_object(result.shape, name="teapot")  # type: ignore[name-defined]  # noqa: F821  (given by CQ-editor)
