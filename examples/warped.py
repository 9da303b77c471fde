"""A blend between two sheets that is warped by guiding curves (Kim and Elber, figure 6), and one that is not.

The cross directions are guiding curves projected on the tangent planes (T4). Along the lower rail they turn from left
to right, along the upper one they lean to one side. Without them, chords from rail to rail guide the blend (T3).
"""

import cadquery as cq
import numpy as np

import cqblend

x, y = np.meshgrid(np.linspace(0, 24, 7), np.linspace(0, 10, 5), indexing="ij")
knots = ([0, 0, 0, 0, 6, 12, 18, 24, 24, 24, 24], [0, 0, 0, 0, 5, 10, 10, 10, 10])
hollow, hump = 0.002 * y * (x - 12) ** 2 + np.sin(y / 4), 9 - 0.01 * (x - 12) ** 2 + 0.5 * np.sin(y / 3)
lower = cqblend.Surface.from_bspline((3, 3), knots, np.stack([x, -4 - y, hollow], -1))
upper = cqblend.Surface.from_bspline((3, 3), knots, np.stack([x, 6 + y, hump], -1))
primaries = [lower, upper]

rails = [
    cqblend.Rail(lower, cqblend.Curve.bezier([(3, 2), (12, 0), (21, 2)])),
    cqblend.Rail(upper, cqblend.Curve.bezier([(3, 0.1), (12, 0.4), (21, 0.1)])),
]
turning = cqblend.Curve.bezier([(-14, 19, 0), (14, 19, 0)])
leaning = cqblend.Curve.bezier([(14, -19, 0), (14, -19, 0)])

blends = {
    "chord": cqblend.hermite_blend(*rails, tangents="chord", bulge=1.5, form="exact"),
    "guide": cqblend.hermite_blend(*rails, tangents=cqblend.Guide(turning, leaning), length="field", form="exact"),
}
for name, blend in blends.items():
    print(f"{name}: {blend.certificate}")

if "show_object" in globals():
    faces = [cqblend.to_face(surface) for surface in (*primaries, blends["guide"].surface)]
    show_object(cq.Compound.makeCompound(map(cq.Face, faces)), name="warped")  # type: ignore[name-defined]  # noqa: F821
