"""Bridges: a neck, a leaning pipe on freeform ground, a branch, a transition, a handle, and a wing at a distance."""

import cadquery as cq
import numpy as np

import cqblend


def ring(radius: float, middle: tuple[float, float, float], normal: tuple[float, float, float]) -> cq.Wire:
    """Return a circle."""
    return cq.Wire.makeCircle(radius, cq.Vector(*middle), cq.Vector(*normal))


# Two balls, each cut open at a circle that faces the other (Kim and Elber, figure 8, as a solid).
left, right = (cq.Workplane(origin=(x, 0, 0)).sphere(10) for x in (-14, 14))
rims = ring(7, (-14 + 51**0.5, 0, 0), (1, 0, 0)), ring(7, (14 - 51**0.5, 0, 0), (1, 0, 0))
neck = cqblend.bridge([left.val(), right.val()], (left.faces().val(), rims[0]), (right.faces().val(), rims[1]), bulge=2)

# A pipe that leans, on freeform ground in which the opening is an oval (figure 5, as a solid).
clamped = np.repeat([0, 1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6, 1], [4, 1, 1, 1, 1, 1, 4])
x, y = np.meshgrid(np.linspace(-22, 26, 9), np.linspace(-20, 20, 9), indexing="ij")
z = 1.2 * np.sin(x / 7) * np.cos(y / 8) - 0.007 * (x**2 + y**2)
lie = cqblend.Surface.from_bspline((3, 3), (clamped, clamped), np.stack([x, y, z], -1))
ground = cq.Workplane(cq.Face(cqblend.to_face(lie)).thicken(-4))
pipe = cq.Workplane("XY", origin=(-5, 0, 6)).circle(6).workplane(offset=18).center(-4, 0).circle(6).loft()
top = max(ground.faces().vals(), key=lambda face: face.Center().z)
angle = np.arange(11) * np.pi / 4
oval = np.stack([(1.5 + 15 * np.cos(angle) + 22) / 48, (11 * np.sin(angle) + 20) / 40], -1)
foot_rail = cqblend.Curve.from_bspline(3, np.arange(-3, 12) / 8, oval)
foot = cqblend.bridge([ground.val(), pipe.val()], (top, foot_rail), pipe.faces("<Z"), bulge=(1.5, 1))

# A branch of a tank: the opening is a closed curve in the parameters of its wall.
tank, branch = cq.Workplane().circle(8).extrude(30), cq.Workplane("YZ", origin=(-22, 4, 18)).circle(4).extrude(-8)
wall = tank.faces("%CYLINDER").val()
(u0, u1), (v0, v1) = cqblend.to_surface(wall).domain
cut = np.stack([(u0 + u1) / 2 + 0.7 * np.cos(angle), (v0 + v1) / 2 + 6 * np.sin(angle)], -1)
joined = cqblend.bridge(
    [tank.val(), branch.val()], (wall, cqblend.Curve.from_bspline(3, np.arange(-3, 12) / 8, cut)), branch.faces(">X")
)

# A transition from square to round: the corners of the square cut it into four faces. G2 on both sides.
square, round_end = cq.Workplane().rect(16, 16).extrude(6), cq.Workplane(origin=(6, 0, 24)).circle(5).extrude(6)
duct = cqblend.bridge([square.val(), round_end.val()], square.faces(">Z"), round_end.faces("<Z"), continuity="G2")

# A handle on one body, from stud to stud.
lid = (
    cq.Workplane().circle(18).extrude(4).faces(">Z").workplane().pushPoints([(-10, 0), (10, 0)]).circle(2.5).extrude(3)
)
handle = cqblend.bridge(lid, *lid.faces(">Z").vals())

# A wing at a distance from a fuselage, with an oval opening in the freeform flank.
fuselage = cq.Workplane("YZ").ellipse(4, 5).workplane(offset=18).ellipse(6, 7).workplane(offset=18).ellipse(3, 4).loft()
wing = cq.Workplane("XZ", origin=(18, -12, 0)).ellipse(6, 1).workplane(offset=24).center(4, 0).ellipse(3, 0.5).loft()
flank = fuselage.faces("%BSPLINE").val()
tool = cq.Workplane("XZ", origin=(18, 0, 0)).ellipse(9, 2.4).extrude(20)
root = [edge for edge in fuselage.cut(tool).edges().vals() if 10 < edge.Center().x < 26 and -9 < edge.Center().y < -2]
plane = cqblend.bridge([fuselage.val(), wing.val()], (flank, root), wing.faces(">Y"))

results = {"neck": neck, "foot": foot, "branch": joined, "duct": duct, "handle": handle, "wing": plane}
for name, one in results.items():
    print(name, one.certificate, sep="\n  ")

if "show_object" in globals():
    for name, one in results.items():
        show_object(one.shape, name=name)  # type: ignore[name-defined]  # noqa: F821  (given by CQ-editor)
