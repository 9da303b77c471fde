"""The models of Elber's paper on unrolling (1995), rebuilt in CadQuery at the size of paper models: mm, z upwards.

Tube (figures 2 and 6), sphere (3), cone with cylinder (7), helicopter (8), pawn (9), teapot (10) and a fighter in the
manner of an F-16 (11). Each function returns one valid solid. Hulls are bicubic splines through a handful of rings,
lifting surfaces are ruled between aerofoils, and what meets is united by booleans, which trim the faces. The profile
of the pawn and the stations of the aircraft are this project's own.
"""

from collections.abc import Sequence

import cadquery as cq
import numpy as np
from cadquery.func import face, shell, solid

import cqblend
from cqblend import teapot as utah

Point = tuple[float, float, float]
Station = tuple[float, float, float, float, float, float]

RING = (2 + 0.5**0.5) / 3  # size of a closed cubic spline over that of its poles, if these are a regular octagon

# Meridian of the pawn: Bezier poles (radius, height) from the rim of the base to the top of the head.
PAWN = (
    ((36, 0), (36, 6)),
    ((36, 6), (41, 10), (38, 17), (29, 18)),
    ((29, 18), (29, 24), (18, 32), (14, 52), (11, 74), (12.5, 92)),
    ((12.5, 92), (21, 93.5)),
    ((21, 93.5), (24.5, 95.5), (24.5, 98.5), (21, 100)),
    ((21, 100), (11, 103)),
    ((11, 103), (27, 110), (25, 144), (0, 144)),
)

# The same of the fighter's nozzle and of a missile.
NOZZLE = (((8.6, 0), (8.8, 8), (10, 18), (8.6, 27), (7.2, 34)),)
MISSILE = (((1.8, 0), (1.8, 34)), ((1.8, 34), (1.8, 39), (1.1, 43), (0, 44)))

LENS = ((0, 0), (0.25, 1), (0.6, 1), (1, 0))  # Bezier poles of one side of an aerofoil, of chord 1

# Hulls of the aircraft: rings (x, z, half the width, height above z, depth below z, squareness), or poles (x, z).
POD = (
    (0, 29),
    (0, 29, 9, 8, 9, 0.71),
    (10, 31, 18, 17, 15, 0.72),
    (34, 35, 25, 24, 20, 0.76),
    (66, 37, 24, 24, 20, 0.76),
    (96, 41, 15, 17, 14, 0.72),
    (116, 45, 6, 7, 6, 0.71),
    (120, 46),
)
COWLING = (
    (30, 56),
    (31, 57, 6, 5, 5, 0.71),
    (42, 58, 10, 9, 8, 0.76),
    (64, 58, 11, 11, 8, 0.78),
    (86, 56, 9, 9, 8, 0.76),
    (106, 50, 4, 4, 4, 0.71),
    (112, 48),
)
FUSELAGE = (
    (0, -2.5),
    (8, -2.2, 2.3, 2.3, 2.3, 0.71),
    (18, -1.6, 4.6, 4.6, 4.6, 0.71),
    (32, -0.8, 7.2, 6.6, 6.8, 0.72),
    (55, 0, 10.2, 8.4, 8.8, 0.75),
    (85, 1, 12, 9.4, 9.6, 0.76),
    (120, 1.5, 14, 10, 11, 0.76),
    (155, 1, 14.5, 10, 13, 0.76),
    (188, 0.5, 13, 10, 12.5, 0.74),
    (210, 0, 11, 10.4, 11, 0.72),
    (224, 0, 10.2, 10.2, 10.2, 0.71),
)
INTAKE = (
    (76, -15.5, 10, 4.4, 4.6, 0.8),
    (88, -15, 11.5, 6, 6, 0.8),
    (112, -13.5, 12.5, 8, 7.5, 0.8),
    (145, -11, 12.5, 8, 8.5, 0.78),
    (178, -7, 10, 6, 7, 0.74),
    (204, 0, 6, 4, 4, 0.71),
)
DUCT = (
    (72, -15.5, 8.9, 3.3, 3.5, 0.8),
    (80, -15.5, 8.9, 3.3, 3.5, 0.8),
    (88, -15, 8, 3.2, 3.2, 0.78),
    (98, -14, 7, 3, 3, 0.71),
)
CANOPY = (
    (43, 4),
    (46, 5, 4, 3.5, 2, 0.71),
    (54, 7, 7.4, 7.5, 4, 0.71),
    (68, 8, 8.6, 11.5, 5, 0.71),
    (84, 8, 7.6, 9.5, 5, 0.71),
    (102, 8, 4.4, 5, 4, 0.71),
    (116, 7, 2, 2, 2, 0.71),
    (120, 6.5),
)


def tube() -> cq.Solid:
    """Return a bent tube that swells in the middle, with planar ends: 3 faces, one of them a spline closed around."""
    bend = np.radians([0, 12, 32, 54, 76, 96, 108])
    radius = np.array([22, 24, 34, 40, 31, 22, 24]) / RING
    around = np.arange(8) * np.pi / 4
    out = 110 + radius[:, None] * np.cos(around)
    net = np.stack(
        [out * np.cos(bend)[:, None], radius[:, None] * np.sin(around), out * np.sin(bend)[:, None]],
        axis=-1,
    )
    return closed(skin(net))


def sphere() -> cq.Solid:
    """Return a sphere of 150 mm: 1 face."""
    return cq.Solid.makeSphere(75, angleDegrees1=-90)


def cone_with_cylinder() -> cq.Solid:
    """Return a cone run through by a cylinder beside its axis: 6 faces, the cone's with two holes."""
    cone = cq.Solid.makeCone(70, 0, 180)
    cylinder = cq.Solid.makeCylinder(24, 200, cq.Vector(-100, 8, 50), cq.Vector(1, 0, 0))
    return united(cone, cylinder)


def pawn() -> cq.Solid:
    """Return a pawn of chess, 144 mm high: 8 faces of revolution, of which four have spline meridians."""
    return revolved(PAWN)


def teapot() -> cq.Solid:
    """Return the whole Utah teapot, 255 mm long: its 32 patches as 7 spline faces, and two planar ones.

    These close the gap around the lid and the tip of the spout. Spout and handle are trimmed by the body. The lower end
    of the handle only touches the body, so the handle is moved inwards by 2 mm.
    """
    rings_of_patches = (
        ((29, 30, 31, 28),),
        ((7, 4, 5, 6), (11, 8, 9, 10)),
        ((3, 0, 1, 2),),
        ((23, 20, 21, 22), (27, 24, 25, 26)),
        utah.SPOUT,
        utah.LIP,
        ((12, 13), (14, 15)),
    )
    bottom, body, rim, lid, *tubes = (40 * utah.surface(patches) for patches in rings_of_patches)
    # booleans are ten times as accurate with the seams of spout and handle off the plane of symmetry
    spout, lip, handle = (each.tiled(0, 0, 1, continuity=1).clip(u=(0.5, 2.5)) for each in tubes)
    return united(closed(bottom, body, rim), closed(lid), closed(spout, lip), closed(handle + np.array((2, 0, 0))))


def helicopter() -> cq.Solid:
    """Return a helicopter, 244 mm long under a rotor of 240 mm: 56 faces."""
    rotor = aerofoils(((-3, 5, 0), 9, 1.8), ((-3, 120, 0), 9, 1.8))
    tail_blade = aerofoils(((-1.5, 0, 0.8), 3, 1.2), ((-2, 0, 22), 4, 1.2), normal=(0, 1, 0))
    parts = [
        closed(skin(rings(COWLING))),
        cq.Solid.makeCone(8.5, 4, 150, cq.Vector(86, 0, 44), cq.Vector(1, 0, 0.06)),  # boom
        cq.Solid.makeCylinder(2.5, 26, cq.Vector(60, 0, 60)),  # mast
        cq.Solid.makeCylinder(7, 5, cq.Vector(60, 0, 82)),  # hub
        aerofoils(((208, 0, 50), 26, 4), ((230, 0, 84), 14, 2), normal=(0, 1, 0)),  # fin
        aerofoils(((212, 0, 53), 20, 3), ((226, 0, 34), 9, 1.5), normal=(0, 1, 0)),  # fin below
        aerofoils(((170, -32, 49), 18, 2.5), ((170, 32, 49), 18, 2.5)),  # stabiliser
        cq.Solid.makeCylinder(2, 9, cq.Vector(228, 0, 56), cq.Vector(0, 1, 0)),  # shaft of the tail rotor
    ]
    for angle in (45, 135, 225, 315):
        parts.append(rotor.rotate(cq.Vector(), cq.Vector(0, 0, 1), angle).moved(cq.Location((60, 0, 84.5))))
    for angle in (20, 200):
        parts.append(tail_blade.rotate(cq.Vector(), cq.Vector(0, 1, 0), angle).moved(cq.Location((228, 7, 56))))
    for x in (26, 62):  # struts: arcs through the runners and, between them, the pod
        parts.append(elbow((x, -28, 0), (x, 0, -6.8), (1, 0, 0), -152.6, radius=1.7))
    for y in (-28, 28):  # runners
        parts.append(cq.Solid.makeCylinder(2.4, 84, cq.Vector(14, y, 0), cq.Vector(1, 0, 0)))
        parts.append(elbow((14, y, 0), (14, y, 16), (0, 1, 0), 60, radius=2.4))
    return united(closed(skin(rings(POD))), *parts)


def fighter() -> cq.Solid:
    """Return a fighter in the manner of an F-16, 248 mm long with a span of 160 mm: 42 faces."""
    hull = skin(rings(FUSELAGE))
    joint = 1.0  # between radome and fuselage
    wing = aerofoils(((54, 6, 1), 130, 5), ((110, 20, 1), 74, 4), ((160, 78, 1), 22, 1.2))
    missile = revolved(MISSILE).moved(cq.Location((196, 78, 1), (0, 1, 0), -90))
    sides = [
        wing,
        missile,
        aerofoils(((190, 6, -1), 40, 3), ((222, 46, -4), 18, 1)),  # tailplane
        aerofoils(((184, 5, -7), 30, 2.4), ((193, 12, -24), 17, 1), normal=(0, 17, 7)),  # ventral fin
    ]
    parts = [
        closed(skin(rings(INTAKE))),
        closed(skin(rings(CANOPY))),
        *sides,
        *(side.mirror("XZ") for side in sides),
        aerofoils(((156, 0, 6), 62, 4), ((206, 0, 54), 22, 1.2), normal=(0, 1, 0)),  # fin
        revolved(NOZZLE).moved(cq.Location((214, 0, 0), (0, 1, 0), 90)),
    ]
    whole = united(closed(hull.clip(v=(0, joint)), hull.clip(v=(joint, hull.domain[1][1]))), *parts)
    jet = cq.Solid.makeCone(5, 6.2, 18, cq.Vector(232, 0, 0), cq.Vector(1, 0, 0))
    (hollow,) = whole.cut(jet, closed(skin(rings(DUCT)))).Solids()
    return hollow


def rings(stations: Sequence[Station | tuple[float, float]]) -> np.ndarray:
    """Return the poles of rings across x, (n, 8, 3), each from below around; squareness 0.71 is all but elliptic."""
    net = np.empty((len(stations), 8, 3))
    for ring, (x, z, *size) in zip(net, stations, strict=True):
        half, up, down, square = size or (0, 0, 0, 0)
        side = half / RING * np.array([0, square, 1, square, 0, -square, -1, -square])
        height = np.array([-down, -square * down, 0, square * up, up, square * up, 0, -square * down]) / RING
        ring[:] = np.stack([np.full(8, x), side, z + height], axis=-1)
    return net


def skin(net: np.ndarray) -> cqblend.Surface:
    """Return the bicubic C2 spline with rings of poles, (n, m, 3): closed around, from the first ring to the last."""
    n, m = net.shape[:2]
    knots = np.arange(m + 7) - 3, np.clip(np.arange(n + 4) - 3, 0, n - 3)
    return cqblend.Surface.from_bspline((3, 3), knots, np.concatenate([net, net[:, :3]], axis=1).swapaxes(0, 1))


def closed(*surfaces: cqblend.Surface) -> cq.Solid:
    """Sew splines that are closed around, and planar caps on their free rims, into a solid."""
    sides = shell(*(cq.Face(cqblend.to_face(one)) for one in surfaces))
    rims = [edge for edge in sides.Edges() if edge.IsClosed() and len(edge.ancestors(sides, "Face").Faces()) == 1]
    caps = [face(rim) for rim in rims if rim.Length() > 1e-6]  # the others are poles
    return solid(*sides.Faces(), *caps)


def revolved(meridian: Sequence[Sequence[tuple[float, float]]]) -> cq.Solid:
    """Revolve Bezier curves (radius, height), joined end to end, and the discs that close them about the z axis."""
    first, last = meridian[0][0], meridian[-1][-1]
    curves = [((0, first[1]), first), *meridian, (last, (0, last[1])), ((0, last[1]), (0, first[1]))]
    edges = []
    for poles in curves:
        points = [cq.Vector(r, 0, z) for r, z in poles]
        if points[0] != points[-1]:
            edges.append(cq.Edge.makeBezier(points) if len(points) > 2 else cq.Edge.makeLine(*points))
    return cq.Solid.revolve(cq.Wire.assembleEdges(edges), [], 360, cq.Vector(), cq.Vector(0, 0, 1))


def aerofoils(*sections: tuple[Point, float, float], normal: Point = (0, 0, 1)) -> cq.Solid:
    """Rule a solid through lens-shaped sections along x: (leading edge, chord, thickness), thick along the normal."""
    wires = []
    for nose, chord, thickness in sections:
        up = cq.Vector(normal).normalized() * (thickness * 2 / 3)
        edges = []
        for side in (up, -up):
            poles = (cq.Vector(nose) + cq.Vector(x * chord, 0, 0) + side * z for x, z in LENS)
            edges.append(cq.Edge.makeBezier(list(poles)))
        wires.append(cq.Wire.assembleEdges(edges))
    return cq.Solid.makeLoft(wires, ruled=True)


def elbow(start: Point, centre: Point, axis: Point, degrees: float, *, radius: float) -> cq.Solid:
    """Turn a disc of the given radius about an axis: a bent rod with planar ends."""
    arm, axle = cq.Vector(start) - cq.Vector(centre), cq.Vector(axis)
    disc = cq.Wire.makeCircle(radius, cq.Vector(start), axle.cross(arm))
    return cq.Solid.revolve(disc, [], degrees, cq.Vector(centre), cq.Vector(centre) + axle)


def united(*parts: cq.Solid) -> cq.Solid:
    """Return the one solid that overlapping parts are together."""
    (whole,) = parts[0].fuse(*parts[1:]).Solids()
    return whole


if "show_object" in globals():
    for row, model in enumerate((tube, sphere, cone_with_cylinder, pawn, teapot, helicopter, fighter)):
        show_object(model().moved(cq.Location((0, 300 * row, 0))), name=model.__name__)  # type: ignore[name-defined]  # noqa: F821
