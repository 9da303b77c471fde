"""A circle at three speeds (Kim and Elber, figure 1): as NURBS have it, starting slowly, starting and ending slowly."""

import cadquery as cq
import numpy as np

from cqblend.splines import Curve, change_of_parameter, reparameterise

half = np.sqrt(0.5)
circle = Curve.from_bspline(
    degree=2,
    knots=np.repeat([0, 0.25, 0.5, 0.75, 1], [3, 2, 2, 2, 3]),
    poles=[(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)],
    weights=[1, half, 1, half, 1, half, 1, half, 1],
)
motions = {
    "plain": circle,
    "starting slowly": reparameterise(circle, change_of_parameter(0, 1)),
    "starting and ending slowly": reparameterise(circle, change_of_parameter(0, 0)),
}

steps = np.linspace(0, 1, 33)
for name, motion in motions.items():
    off = np.abs(np.linalg.norm(motion(np.linspace(0, 1, 2001)), axis=1) - 1).max()
    speeds = np.linalg.norm(motion([0, 0.5, 1], 1), axis=1)
    print(f"{name}: degree {motion.degree}, speed {speeds.round(6)} at 0, 1/2, 1; {off:.0e} off the circle")

if "show_object" in globals():
    places = cq.Workplane().pushPoints([tuple(point) for point in motions["starting slowly"](steps[:-1])])
    show_object(places.circle(0.02).extrude(0.02), name="equal steps of time")  # type: ignore[name-defined]  # noqa: F821
