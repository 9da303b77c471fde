"""Sizes that vary: a rounding that starts in a point, a foot that is wider on one side, a rim, and sizes by edge."""

import math

import cadquery as cq

import cqblend

# From nothing to 8 mm: the blend starts in the vertex, and is an exact cone.
block = cq.Workplane().box(40, 24, 14)
pointed = cqblend.blend_edges(block, block.edges(">Y and >Z"), cqblend.linear(0, 8), section="hermite")

# Around the foot of a boss, t runs from 0 to 1 around the axis, from the vertex of the edge.
boss = cq.Workplane().box(40, 40, 8).faces(">Z").workplane().circle(8).extrude(14)
foot = boss.faces(">Z[-2]").edges("%CIRCLE")
around = cqblend.blend_edges(boss, foot, lambda t: 4 - 2 * math.cos(2 * math.pi * t), continuity="G2")

# A chain of three edges that fades out at both ends; the law runs along all of it.
cover = cq.Workplane().box(40, 30, 10).edges("|Z and >X and <Y").fillet(12)
corner = cover.faces(">Z").edges("%CIRCLE")
fading = cqblend.blend_edges(cover, corner, cqblend.table([(0, 0), (0.5, 5), (1, 0)]))

# Each edge of a rim has its own radius, and between them the radius changes over 10 mm.
tray = cq.Workplane().box(40, 30, 10).edges("|Z").fillet(8)
rim = tray.faces(">Z").edges().vals()
radii = {edge: 3.5 if edge.geomType() == "CIRCLE" else 2.0 for edge in rim}
tapered = cqblend.blend_edges(tray, rim, radii, taper=10)

results = {"pointed": pointed, "around": around, "fading": fading, "tapered": tapered}
for name, result in results.items():
    print(name, result.certificate, *result.certificate.ends, sep="\n  ")

if "show_object" in globals():
    for name, result in results.items():
        show_object(result.shape, name=name)  # type: ignore[name-defined]  # noqa: F821  (given by CQ-editor)
