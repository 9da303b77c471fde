"""A leaning boss on a freeform block: where it meets the B-spline top, a ball of 1.5 mm rolls once around."""

import math

import cadquery as cq

import cqblend

ticks = range(-20, 21, 8)
points = [[cq.Vector(x, y, 2.5 * math.cos(x / 14) * math.cos(y / 11 + 0.3)) for y in ticks] for x in ticks]
top = cq.Face.makeSplineApprox(points, tol=1e-4, minDeg=3, maxDeg=3)
prism = cq.Workplane(origin=(0, 0, -10)).rect(32, 32).extrude(30).val()
block = min(prism.split(top).Solids(), key=lambda solid: solid.Center().z)

boss = cq.Solid.makeCylinder(4.5, 18, cq.Vector(1, -1, -3), cq.Vector(0.2, -0.15, 1))
body = cq.Workplane(block).union(cq.Workplane(boss))
ring = body.faces("%BSPLINE").edges("not %LINE").edges(cq.NearestToPointSelector((1, -1, 3)))

result = cqblend.blend_edges(body, ring, radius=1.5)
print(result.certificate)

if "show_object" in globals():
    show_object(result.shape, name="boss on a dome")  # type: ignore[name-defined]  # noqa: F821  (given by CQ-editor)
