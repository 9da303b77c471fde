"""Two sheets at a right angle, blended perpendicularly to the rails and not (Kim and Elber, figures 4 and 7).

The rails run obliquely over the ends of the sheets. Cross directions perpendicular to them (T2) lead beyond these ends,
and the blend bends out of the sheets. Directions chosen in the parameter plane (T5), here the difference of the common
border and the rail, stay within them.
"""

import cadquery as cq
import numpy as np

import cqblend

x, across = np.meshgrid(np.linspace(0, 24, 7), np.linspace(0, 12, 5), indexing="ij")
bend, sag = 0.8 * np.sin(np.pi * x / 12), 0.012 * across**2
knots = ([0, 0, 0, 0, 6, 12, 18, 24, 24, 24, 24], [0, 0, 0, 0, 6, 12, 12, 12, 12])
floor = cqblend.Surface.from_bspline((3, 3), knots, np.stack([x, across + bend, sag * np.cos(x / 6)], -1))
wall = cqblend.Surface.from_bspline((3, 3), knots, np.stack([x, bend - sag, across], -1))
primaries = [floor, wall]

rail = cqblend.Curve.bezier([(0, 9), (12, -3), (24, 9)])  # in the parameter plane of either sheet
border = cqblend.Curve.bezier([(0, 0), (24, 0)])  # which both have in common
rails = [cqblend.Rail(sheet, rail) for sheet in primaries]

towards_border = cqblend.Combination(border, rail)
blends = {
    "perpendicular": cqblend.hermite_blend(*rails, tangents="perpendicular", form="exact"),
    "combination": cqblend.hermite_blend(*rails, tangents=towards_border, length="field", bulge=1.5, form="exact"),
}
for name, blend in blends.items():
    x = blend.surface.grid(np.linspace(0, 1, 101), np.linspace(0, 1, 101))[..., 0]
    beyond = max(0, -x.min(), x.max() - 24)
    print(f"{name}: {beyond:.2f} mm beyond the ends of the sheets\n{blend.certificate}")

if "show_object" in globals():
    faces = [cqblend.to_face(surface) for surface in (*primaries, blends["combination"].surface)]
    show_object(cq.Compound.makeCompound(map(cq.Face, faces)), name="sheets")  # type: ignore[name-defined]  # noqa: F821
