"""Parts as people draw them, with the edges that they round: each a body, a selection, and a radius that fits."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import cadquery as cq


@dataclass(frozen=True)
class Part:
    """A body with picked edges and a radius; ``cells`` is how many edges are to be blended, picked ones and chains."""

    body: cq.Workplane
    edges: list[cq.Edge]
    radius: float
    cells: int


Maker = Callable[[], Part]


def at_height(body: cq.Workplane, z: float, within: float = math.inf) -> list[cq.Edge]:
    """List the edges that lie at a height, no farther out than a distance."""
    found = []
    for edge in body.val().Edges():
        box = edge.BoundingBox()
        if (
            abs(box.zmin - z) < 1e-5
            and abs(box.zmax - z) < 1e-5
            and max(-box.xmin, box.xmax, -box.ymin, box.ymax) < within
        ):
            found.append(edge)
    return found


def picked(body: cq.Workplane, edges: list[cq.Edge], radius: float, count: int | None = 1) -> Part:
    """Pick the first edges of a chain, by default one; None picks all of them."""
    return Part(body, edges[:count], radius, len(edges))


def slot_rim() -> Part:
    plate = (
        cq.Workplane().box(60, 30, 8, centered=(True, True, False)).faces(">Z").workplane().slot2D(30, 12).cutThruAll()
    )
    return picked(plate, at_height(plate, 8, within=20), 1.5)


def slot_boss() -> Part:
    boss = cq.Workplane().slot2D(30, 12).extrude(8)
    return picked(boss, at_height(boss, 8), 2.0)


def rounded_box(radius: float) -> Part:
    box = cq.Workplane().box(30, 20, 10, centered=(True, True, False)).edges("|Z").fillet(4)
    return picked(box, at_height(box, 10), radius)


def box_with_larger_uprights() -> Part:
    return rounded_box(1.5)


def box_with_slightly_larger_uprights() -> Part:
    return rounded_box(3.99)


def box_with_equal_uprights() -> Part:
    return rounded_box(4.0)


def d_shape() -> Part:
    half = cq.Workplane().moveTo(0, -10).lineTo(0, 10).threePointArc((10, 0), (0, -10)).close().extrude(6)
    shaft = half.edges("|Z").fillet(2)
    return picked(shaft, at_height(shaft, 6), 1.0)


def spline_outline_with_tangent_lines() -> Part:
    outline = (
        cq.Workplane().moveTo(-12, -6).lineTo(12, -6).spline([(20, 1), (12, 6)], [(1, 0), (-1, 0)], includeCurrent=True)
    )
    body = (
        outline.lineTo(-12, 6).spline([(-18, -1), (-12, -6)], [(-1, 0), (1, 0)], includeCurrent=True).close().extrude(7)
    )
    return picked(body, at_height(body, 7), 1.5)


def text_with_smooth_corners() -> Part:
    """The letter and the digit have no corners: every loop of the top is one chain."""
    text = cq.Workplane().text("O0", 22, 4, combine=False)
    return picked(text, at_height(text, 4), 0.4, None)


def pipe_along_a_spline() -> Part:
    path = cq.Workplane("XZ").spline([(0, 0), (4, 12), (14, 20), (26, 22)], tangents=[(0, 1), (1, 0)])
    pipe = cq.Workplane().circle(4).circle(2.6).sweep(path)
    rims = [edge for edge in pipe.val().Edges() if edge.geomType() == "CIRCLE" or edge.IsClosed()]
    return picked(pipe, rims, 0.4, None)


def pocket_floor() -> Part:
    pocket = cq.Workplane().box(50, 40, 12, centered=(True, True, False)).faces(">Z").workplane()
    pocket = pocket.sketch().rect(34, 24).vertices().fillet(5).finalize().cutBlind(-8)
    return picked(pocket, at_height(pocket, 4, within=20), 2.0)


def window_in_a_tube() -> Part:
    tube = cq.Workplane().circle(20).circle(15).extrude(50).rotate((0, 0, 0), (0, 0, 1), 180)
    tool = cq.Workplane("YZ").sketch().rect(14, 20).vertices().fillet(4).finalize().extrude(40).translate((0, 0, 25))
    body = tube.cut(tool)
    rim = []
    for edge in body.val().Edges():
        points = [edge.positionAt(t) for t in (0.0, 0.3, 0.7, 1.0)]
        if all(abs(math.hypot(p.x, p.y) - 20) < 1e-4 and 5 < p.z < 45 and p.x > 5 for p in points):
            rim.append(edge)
    return picked(body, rim, 1.0)


def thread_crest() -> Part:
    """A ridge that winds once and a half round a rod: its crest is one helical face between two helices."""
    path = cq.Wire.makeHelix(6, 9, 8)
    profile = cq.Workplane("XZ").polyline([(7.6, -1.8), (7.6, 1.8), (9.5, 0.9), (9.5, -0.9)]).close()
    ridge = profile.sweep(cq.Workplane(path), isFrenet=True)
    body = cq.Workplane(cq.Solid.makeCylinder(8, 20, cq.Vector(0, 0, -5))).union(ridge)
    crest = [
        e
        for e in body.val().Edges()
        if e.Length() > 40 and abs(e.positionAt(0.5).toTuple()[0] ** 2 + e.positionAt(0.5).y ** 2 - 90.25) < 0.5
    ]
    return picked(body, crest[:1], 0.3)


def foot_of_a_wing() -> Part:
    """A wing with rounded edges stands on a fuselage of ellipses."""
    fuselage = cq.Workplane("YZ").workplane(offset=-40).ellipse(9, 12).workplane(offset=80).ellipse(9, 12).loft()
    nose = [(-11, -1.2), (-13, 0), (-11, 1.2)], [(-1, 0.15), (1, 0.35)]
    upper = [(-11, 1.2), (-4, 2.4), (8, 1.2)], [(1, 0.35), (1, -0.15)]
    tail = [(8, 1.2), (9.3, 0), (8, -1.2)], [(1, -0.15), (-1, -0.15)]
    lower = [(8, -1.2), (-4, -2.4), (-11, -1.2)], [(-1, -0.15), (-1, 0.15)]
    profile = cq.Workplane("XZ").moveTo(-11, -1.2)
    for points, directions in (nose, upper, tail, lower):
        profile = profile.spline(points[1:], directions, includeCurrent=True)
    body = fuselage.union(profile.close().extrude(30))
    level = [edge for edge in body.val().Edges() if abs(edge.Center().z) < 4 and abs(edge.Center().x) < 20]
    return picked(body, [edge for edge in level if -11 < edge.Center().y < -5], 1.0)


def foot_of_a_spout() -> Part:
    """An oval spout leaves a tapered pot."""
    pot = cq.Workplane(cq.Solid.makeCone(20, 14, 40)).rotate((0, 0, 0), (0, 0, 1), 180)
    spout = (
        cq.Workplane("YZ")
        .slot2D(14, 8, 90)
        .extrude(34, taper=4)
        .rotate((0, 0, 0), (0, 1, 0), -25)
        .translate((0, 0, 15))
    )
    body = pot.union(spout)
    faces = cq.Workplane(body.val()).faces("%CONE").vals()
    largest = max(faces, key=lambda face: face.Area())
    feet = [edge for edge in largest.Edges() if abs(edge.Center().z - 20) < 14 and edge.Center().x > 8]
    return picked(body, feet, 1.0)


PARTS: tuple[Maker, ...] = (
    slot_rim,
    slot_boss,
    box_with_larger_uprights,
    box_with_slightly_larger_uprights,
    box_with_equal_uprights,
    d_shape,
    spline_outline_with_tangent_lines,
    text_with_smooth_corners,
    pipe_along_a_spline,
    pocket_floor,
    window_in_a_tube,
    foot_of_a_wing,
    foot_of_a_spout,
    thread_crest,
)
