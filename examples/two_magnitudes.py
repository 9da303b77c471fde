"""Two identical balls joined by blends of two magnitudes (Kim and Elber, figure 8).

Same rails, same directions, perpendicular to the rails (T2): the length of the cross derivative alone makes the neck
wide or narrow.
"""

import math

import cadquery as cq

import cqblend

POLE, RIM = math.pi / 2, 0.7  # values of v: about the angle from the equator, as NURBS spheres have it

faces = [cq.Solid.makeSphere(10, cq.Vector(x, 0, 0), cq.Vector(1, 0, 0), -90, 90).Faces()[0] for x in (-14, 14)]
left, right = (cqblend.to_surface(face) for face in faces)  # u once around the x axis, v from pole to pole
primaries = [left.clip(v=(-POLE, RIM)), right.clip(v=(-RIM, POLE))]  # without the caps that face each other

parallels = [cqblend.Curve.bezier([(0, v), (2 * math.pi, v)]) for v in (RIM, -RIM)]
rails = [cqblend.Rail(left, parallels[0], "left"), cqblend.Rail(right, parallels[1], "right")]

blends = {f"{length} mm": cqblend.hermite_blend(*rails, length=length, form="exact") for length in (8, 30)}
for name, blend in blends.items():
    print(f"{name}: {blend.certificate}")

if "show_object" in globals():
    faces = [cqblend.to_face(surface) for surface in (*primaries, blends["30 mm"].surface)]
    show_object(cq.Compound.makeCompound(map(cq.Face, faces)), name="balls")  # type: ignore[name-defined]  # noqa: F821
