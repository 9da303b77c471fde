"""A leaning pipe on a freeform ground, with a foot wider on one side (Kim and Elber, figure 5).

Directions are perpendicular to the rails (T2); on the ground, their length is a scaling curve k(t), larger where the
foot is wide.
"""

import cadquery as cq
import numpy as np

import cqblend

clamped = np.repeat([0, 1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6, 1], [4, 1, 1, 1, 1, 1, 4])
x, y = np.meshgrid(np.linspace(-22, 26, 9), np.linspace(-20, 20, 9), indexing="ij")
z = 1.2 * np.sin(x / 7) * np.cos(y / 8) - 0.007 * (x**2 + y**2)
ground = cqblend.Surface.from_bspline((3, 3), (clamped, clamped), np.stack([x, y, z], -1))

round_about = np.arange(-3, 12) / 8  # uniform knots of a closed cubic with eight different poles
angle = np.arange(11) * np.pi / 4
cos, sin = np.cos(angle), np.sin(angle)
h = np.linspace(0, 1, 5)
radius = 6 - 2 * h + 2 * h**2
rows = [np.outer(cos, radius) - 5 - 4 * h**2, np.outer(sin, radius), np.outer(cos**0, 5 + 20 * h)]
pipe = cqblend.Surface.from_bspline((3, 3), (round_about, [0, 0, 0, 0, 0.5, 1, 1, 1, 1]), np.stack(rows, -1))
primaries = [ground, pipe]

oval = np.stack([(1.5 + 18 * cos + 22) / 48, (13 * sin + 20) / 40], -1)
foot = cqblend.Rail(ground, cqblend.Curve.from_bspline(3, round_about, oval), "left")
rim = cqblend.Rail(pipe, cqblend.Curve.bezier([(0, 0), (1, 0)]), "right")

k = cqblend.Curve.from_bspline(3, round_about, 10 + 5 * cos[:, None])
blends = {"varying length": cqblend.hermite_blend(foot, rim, length=(k, 7), form="exact")}
print(blends["varying length"].certificate)

if "show_object" in globals():
    faces = [cqblend.to_face(surface) for surface in (*primaries, blends["varying length"].surface)]
    show_object(cq.Compound.makeCompound(map(cq.Face, faces)), name="foot")  # type: ignore[name-defined]  # noqa: F821
