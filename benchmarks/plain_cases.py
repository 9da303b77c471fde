"""What is mostly rounded, joints that are straight or circles, and where it gets slow, bodies with many faces.

Straight joints are the same at each place, those about an axis at each angle: that is where a native fillet is
quickest, and where there is least to compute.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import cadquery as cq
import numpy as np

from benchmarks.cases import Trial, make_trial
from cqblend.brep.step_files import read_step, write_step

PITCH, HOLE, RIM = 4.0, 2.0, 0.3
"""Distance and diameter of the holes of a plate, and the radius of the blends on their rims, mm."""


def straight_joints() -> Iterator[Trial]:
    """Yield edges along which nothing changes: lines between planes and cylinders."""
    box = cq.Workplane().box(30, 20, 10)
    yield _trial("plane, plane", box, "|Z and >X and >Y", 2)
    bracket = cq.Workplane().polyline([(0, 0), (20, 0), (20, 5), (5, 5), (5, 20), (0, 20)]).close().extrude(20)
    yield _trial("plane, plane, inside", bracket, _nearest(5, 5, 10), 2)
    log = cq.Workplane().circle(10).extrude(30).intersect(cq.Workplane().box(20, 20, 80).translate((4, 0, 0)))
    yield _trial("plane, cylinder", log, "|Z and >Y", 2)
    lens = cq.Workplane().circle(10).extrude(20).intersect(cq.Workplane().center(8, 0).circle(10).extrude(20))
    yield _trial("cylinder, cylinder", lens, "|Z and >Y", 2)


def circular_joints() -> Iterator[Trial]:
    """Yield circles and arcs about the axis of both faces."""
    arc = ">Z and %CIRCLE"
    rod, plate = cq.Workplane().circle(6).extrude(20), cq.Workplane().box(30, 30, 6)
    beside, quadrant = (cq.Workplane().box(20, 20, 80).translate((10, y, 0)) for y in (0, 10))
    yield _trial("rim of a cylinder", rod, ">Z", 1)
    yield _trial("arc of a rim, half", rod.intersect(beside), arc, 1)
    yield _trial("arc of a rim, quarter", rod.intersect(quadrant), arc, 1)
    yield _trial("rim of a hole", plate.faces(">Z").workplane().hole(8), arc, 1)
    boss = plate.faces(">Z").workplane().circle(5).extrude(8)
    yield _trial("foot of a boss", boss, _nearest(0, 5, 3), 1)
    yield _trial("rim of a cone", cq.Workplane(cq.Solid.makeCone(8, 4, 12)), "<Z", 1)
    tip = cq.Workplane(cq.Solid.makeCone(6, 2, 8, cq.Vector(0, 0, 20)))
    yield _trial("cone on a cylinder", rod.union(tip), _nearest(0, 6, 20), 1)
    shaft = rod.faces(">Z").workplane().circle(4).extrude(10)
    yield _trial("step of a shaft", shaft, _nearest(0, 4, 20), 1)
    ball = cq.Workplane(cq.Solid.makeSphere(8, angleDegrees1=-90)).union(cq.Workplane().circle(4).extrude(16))
    yield _trial("sphere, coaxial cylinder", ball, _nearest(0, 4, math.sqrt(48)), 1)
    ring = cq.Workplane(cq.Solid.makeTorus(12, 5)).intersect(cq.Workplane().box(60, 60, 20).translate((0, 0, 10)))
    yield _trial("plane, torus", ring, _nearest(0, 17, 0), 1)
    profile = cq.Workplane("XZ").lineTo(7, 0).spline([(9, 6), (7, 13), (4, 18)], includeCurrent=True)
    yield _trial("plane, revolved spline", profile.lineTo(0, 18).close().revolve(), "<Z and %CIRCLE", 1)


def hole_rims(count: int) -> Trial:
    """Return all upper rims of a square plate with so many holes."""
    plate = _plate(math.isqrt(count))
    return make_trial(
        f"{count} {'rims' if count > 1 else 'rim'}", plate.val(), plate.faces(">Z").edges("%CIRCLE").vals(), RIM
    )


def one_of_many_holes(count: int, folder: Path) -> Trial:
    """Return a rim in the middle of a plate with so many holes, which has been through a STEP file in a folder."""
    path = folder / "plate.step"
    write_step(_plate(math.isqrt(count)).val().wrapped, path)
    plate = cq.Workplane(cq.Shape.cast(read_step(path)))
    return make_trial(f"a rim of a plate with {count} holes", plate.val(), _middle_rim(plate), RIM)


def edges_of_many_faces() -> Iterator[Trial]:
    """Yield a rim and an outer edge of a block with 484 blind holes, which has 974 faces."""
    block = _plate(22, depth=3.0)
    faces = len(block.faces().vals())
    yield make_trial(f"a rim of a body with {faces} faces", block.val(), _middle_rim(block), RIM)
    yield make_trial(
        f"an outer edge of a body with {faces} faces", block.val(), block.edges("|Z and >X and >Y").vals(), RIM
    )


def rim_around_holes(side: int = 12) -> Trial:
    """Return the rim of a disk with a wavy top and a grid of holes: a box around its blend is one around them all."""
    rng, size, radius = np.random.default_rng(3), 100.0, 40.0
    at = np.linspace(-size / 2, size / 2, 12).tolist()
    points = [[cq.Vector(x, y, float(rng.uniform(-1.5, 1.5))) for y in at] for x in at]
    top = cq.Face.makeSplineApprox(points, tol=1e-4, minDeg=3, maxDeg=3)
    rod = cq.Solid.makeCylinder(radius, 60, cq.Vector(0, 0, -20))
    disk = cq.Workplane(min(rod.split(top).Solids(), key=lambda solid: solid.Center().z))
    pitch = 1.3 * radius / side
    tools = cq.Workplane().workplane(offset=-30).rarray(pitch, pitch, side, side).circle(1.2).extrude(80)
    body = disk.cut(tools, clean=False).val()
    rim = max((edge for edge in body.Edges() if edge.geomType() == "BSPLINE"), key=lambda edge: edge.Length())
    return make_trial(f"the rim around {side * side} holes of a wavy disk", body, [rim], 1.0)


def _plate(side: int, depth: float | None = None) -> cq.Workplane:
    """Return a plate with a square grid of holes, so many on each side, through it or of a depth."""
    top = cq.Workplane().box(side * PITCH, side * PITCH, 5).faces(">Z").workplane()
    return top.rarray(PITCH, PITCH, side, side).hole(HOLE, depth)


def _middle_rim(plate: cq.Workplane) -> list[cq.Edge]:
    return plate.faces(">Z").edges("%CIRCLE").edges(_nearest(0, 0, 2.5)).vals()[:1]


def _trial(name: str, body: cq.Workplane, edge: str | cq.Selector, radius: float) -> Trial:
    return make_trial(name, body.val(), body.edges(edge).vals(), radius)


def _nearest(x: float, y: float, z: float) -> cq.Selector:
    return cq.NearestToPointSelector((x, y, z))
