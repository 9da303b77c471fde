"""Chains: one picked edge stands for all that go on from it tangentially, over whatever faces.

A prism on lines, a spline and an arc, the same kind of prism sheared, so that its smooth edges cross the chain at an
angle, and a window with rounded corners in a tube. Each is blended in one call, by one picked edge.
"""

import cadquery as cq

import cqblend

outline = (
    cq.Workplane()
    .moveTo(-10, -8)
    .lineTo(10, -8)
    .spline([(16, -2), (12, 8)], tangents=[(1, 0), (-1, 0)], includeCurrent=True)
    .lineTo(-10, 8)
    .threePointArc((-18, 0), (-10, -8))
    .close()
    .extrude(10)
)
plate = cq.Sketch().rect(24, 16).vertices().fillet(4)._faces.Faces()[0]
sheared = cq.Workplane(cq.Solid.extrudeLinear(plate, cq.Vector(6, 0, 10)))
tube = cq.Workplane().circle(20).circle(16).extrude(40)
opening = cq.Workplane("XZ").sketch().rect(14, 16).vertices().fillet(4).finalize().extrude(-40)
tube = tube.cut(opening.translate((0, 0, 20)))

picked = {
    "outline": (outline, outline.faces(">Z").edges("<Y"), 2.5),
    "sheared": (sheared, sheared.faces(">Z").edges("<Y"), 2.0),
    "window": (tube, tube.edges(cq.selectors.BoxSelector((-3, 17, 27), (3, 22, 29))), 1.2),
}
results = {name: cqblend.blend_edges(body, edges, radius) for name, (body, edges, radius) in picked.items()}

for name, result in results.items():
    certificate = result.certificate
    between = max(edge.angle for edge in certificate.edges if edge.kind == "between")
    print(f"{name}: {len(result.faces)} cells, angle {certificate.angle:.1e} rad, between cells {between:.1e} rad")
