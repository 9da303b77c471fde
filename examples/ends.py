"""How blends of open edges end: at a wall flush with the side, on tangent sides, around a rib, and flat in a chain."""

import cadquery as cq

import cqblend


def nearest(body: cq.Shape, *point: float) -> cq.Edge:
    """Return the edge whose middle is nearest to a point."""
    return min(body.Edges(), key=lambda edge: (edge.Center() - cq.Vector(*point)).Length)


# The edge ends at a wall whose own border goes on upwards only: it is lengthened to where the blend meets it.
outline = cq.Workplane().lineTo(40, 0).lineTo(40, 10).lineTo(10, 10).spline([(12, 20), (9, 32)], includeCurrent=True)
leg = outline.lineTo(0, 32).close().extrude(20).val()
flush = cqblend.blend_edges(leg, nearest(leg, 25, 10, 20), radius=5)

# The foot of a boss that is tangent to the sides of its plate: the blend runs out on them.
plate = cq.Workplane().box(40, 26, 9, centered=(False, True, False))
lug = plate.union(cq.Workplane().center(40, 0).circle(13).extrude(24)).clean().val()
tangent = cqblend.blend_edges(lug, nearest(lug, 27, 0, 9), radius=5)

# A rib that the blend runs into stays, and stands on the blend: it ends on three of its faces, and below.
block = cq.Workplane().rect(32, 22).extrude(20, taper=7)
ribbed = block.union(cq.Workplane().box(2, 8, 14, centered=(True, True, False)).translate((11, 12, 0))).val()
rib = cqblend.blend_edges(ribbed, nearest(ribbed, 14.8, 9.8, 10), radius=5)

# One edge of a chain: in caps at its vertices, because that is asked for.
block = cq.Workplane().box(34, 24, 14).edges("|Z").fillet(7).val()
flat = cqblend.blend_edges(block, nearest(block, 0, -12, 7), radius=4, chain=False, ends="flat")

results = {"flush": flush, "tangent": tangent, "rib": rib, "flat": flat}
for name, result in results.items():
    print(name, *result.certificate.ends, sep="\n  ")

if "show_object" in globals():
    for name, result in results.items():
        show_object(result.shape, name=name)  # type: ignore[name-defined]  # noqa: F821  (given by CQ-editor)
