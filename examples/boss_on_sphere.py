"""A leaning boss on a ball: no axis in common, so that both rails are free curves, on analytic faces that stay so."""

import cadquery as cq

import cqblend

ball = cq.Workplane().sphere(10)
boss = cq.Solid.makeCylinder(3.5, 14, cq.Vector(1, -2, 4), cq.Vector(0.5, -0.1, 1))
body = ball.union(cq.Workplane(boss))
ring = body.faces("%SPHERE").edges("not %CIRCLE").edges(cq.NearestToPointSelector((3, -2, 9)))

result = cqblend.blend_edges(body, ring, radius=1.2)
print(result.certificate)

if "show_object" in globals():
    show_object(result.shape, name="boss on a sphere")  # type: ignore[name-defined]  # noqa: F821  (given by CQ-editor)
