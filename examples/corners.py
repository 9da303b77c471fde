"""Corners: selections of edges that meet, each blended in one call.

All edges of an angle profile with a boss, the outline of a plate whose uprights stay sharp, where blends are mitred,
the edges of a block in three sizes, and the feet of a tower that leans through a plate.
"""

import cadquery as cq

import cqblend

profile = [(0, 0), (24, 0), (24, 10), (10, 10), (10, 24), (0, 24)]
angle = cq.Workplane().polyline(profile).close().extrude(12)
angle = angle.faces(">Z").workplane(origin=(17, 5, 0)).rect(7, 5).extrude(6)

outline = cq.Workplane().polyline([(0, 0), (24, 0), (24, 9), (15, 9), (15, 16), (24, 16), (24, 24), (0, 24)]).close()
outline = outline.extrude(9)

block = cq.Workplane().box(26, 18, 14)
sizes = dict.fromkeys(block.edges("|X").vals(), 1.5)
sizes |= dict.fromkeys(block.edges("|Y").vals(), 2.5)
sizes |= dict.fromkeys(block.edges("|Z").vals(), 4.0)

tower = cq.Workplane().polygon(6, 15).extrude(50).translate((0, 0, -25)).rotate((0, 0, 0), (1, 0, 0), 20)
plate = cq.Workplane().box(34, 32, 10).union(tower)
feet = plate.edges(cq.selectors.BoxSelector((-9, -14, 4.9), (9, 14, 5.1)))

results = {
    "angle": cqblend.blend_edges(angle, angle.edges(), 1.2),
    "outline": cqblend.blend_edges(outline, outline.faces(">Z").edges(), 2.5),
    "block": cqblend.blend_edges(block, block.edges(), sizes),
    "tower": cqblend.blend_edges(plate, feet, 2),
}

for name, result in results.items():
    certificate = result.certificate
    angles = [edge.angle for edge in certificate.edges if edge.kind == "between" and edge.angle is not None]
    print(f"{name}: {len(result.faces)} faces, angle {max([certificate.angle, *angles]):.1e} rad")
