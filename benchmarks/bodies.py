"""Random bodies with an edge to blend: eleven families, seeded, drawn once and for all.

The draws were fixed before the code they try. Sizes, tilts and offsets vary so that poles, seams and oblique ends all
come up; the radius is 0.1 to 0.4 of the smallest local size. Tests run the first draws of each family, the benchmark
many more.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import cadquery as cq
import numpy as np


class Case(NamedTuple):
    """A body, the edge to blend, and the radius."""

    name: str
    body: cq.Shape
    edge: cq.Edge
    radius: float


Rng = np.random.Generator


def _direction(rng: Rng) -> cq.Vector:
    x = rng.normal(size=3)
    return cq.Vector(*(x / np.linalg.norm(x)))


def _tilted(rng: Rng, shape: cq.Shape) -> cq.Shape:
    """Turn a body about a random axis, so that nothing is aligned with the world and seams lie anywhere."""
    return shape.rotate(cq.Vector(0, 0, 0), _direction(rng), float(rng.uniform(0, 360)))


def _rod(start: cq.Vector, direction: cq.Vector, radius: float, height: float) -> cq.Solid:
    return cq.Solid.makeCylinder(radius, height, start, direction)


def _solid(shape: cq.Shape) -> cq.Solid:
    return shape.Solids()[0]


def _ring(body: cq.Shape, first: str, second: str) -> cq.Edge:
    """Return the longest edge between a face of each kind."""
    found = []
    for edge in body.Edges():
        faces = edge.ancestors(body, "Face").Faces()
        if len(faces) == 2 and sorted(face.geomType() for face in faces) == sorted([first, second]):
            found.append(edge)
    return max(found, key=lambda edge: edge.Length())


def sphere_and_boss(rng: Rng) -> Case:
    """A cylindrical boss on a sphere, at any place and somewhat tilted."""
    big = float(rng.uniform(8, 15))
    small = big * float(rng.uniform(0.2, 0.5))
    axis = _direction(rng)
    lean = (axis + _direction(rng) * 0.3).normalized()
    sphere = _tilted(rng, cq.Solid.makeSphere(big, angleDegrees1=-90))
    body = _solid(sphere.fuse(_rod(axis * (0.3 * big), lean, small, 1.5 * big)))
    return Case("sphere + boss", body, _ring(body, "SPHERE", "CYLINDER"), small * float(rng.uniform(0.1, 0.4)))


def sphere_with_hole(rng: Rng) -> Case:
    """A sphere with a blind hole."""
    big = float(rng.uniform(8, 15))
    small = big * float(rng.uniform(0.2, 0.5))
    axis = _direction(rng)
    lean = (axis + _direction(rng) * 0.3).normalized()
    sphere = _tilted(rng, cq.Solid.makeSphere(big, angleDegrees1=-90))
    body = _solid(sphere.cut(_rod(axis * (0.1 * big), lean, small, 2 * big)))
    return Case("sphere - cylinder", body, _ring(body, "SPHERE", "CYLINDER"), small * float(rng.uniform(0.1, 0.4)))


def cylinder_cap(rng: Rng) -> Case:
    """The rim of a cylinder cut off obliquely."""
    radius, height = float(rng.uniform(4, 10)), float(rng.uniform(15, 25))
    tilt = float(rng.uniform(0, 35))
    rod = cq.Solid.makeCylinder(radius, height).rotate(cq.Vector(), cq.Vector(0, 0, 1), float(rng.uniform(0, 360)))
    knife = cq.Solid.makeBox(80, 80, 40, cq.Vector(-40, -40, 0)).rotate(cq.Vector(), cq.Vector(1, 0, 0), tilt)
    body = _tilted(rng, _solid(rod.cut(knife.translate(cq.Vector(0, 0, height * 0.7)))))
    rings = [e for e in body.Edges() if e.IsClosed()]
    edge = max(rings, key=lambda e: e.Length())
    return Case("cylinder cap", body, edge, radius * float(rng.uniform(0.1, 0.4)) * math.cos(math.radians(tilt)))


def dome_and_boss(rng: Rng) -> Case:
    """A cylindrical boss on a block with a freeform top."""
    block = _freeform_block(rng, 30.0, 1.5)
    radius = float(rng.uniform(3, 6))
    lean = cq.Vector(*(float(x) for x in rng.uniform(-0.25, 0.25, 2)), 1).normalized()
    place = cq.Vector(*(float(x) for x in rng.uniform(-4, 4, 2)), -3)
    body = _solid(block.fuse(_rod(place, lean, radius, 25)))
    return Case("dome + boss", body, _ring(body, "BSPLINE", "CYLINDER"), radius * float(rng.uniform(0.1, 0.4)))


def two_spheres(rng: Rng) -> Case:
    """Two spheres that overlap."""
    a, b = (float(x) for x in rng.uniform(5, 10, 2))
    axis = _direction(rng)
    distance = max(a, b) + 0.45 * min(a, b) * float(rng.uniform(0.2, 1.5))
    one = _tilted(rng, cq.Solid.makeSphere(a, angleDegrees1=-90))
    two = _tilted(rng, cq.Solid.makeSphere(b, angleDegrees1=-90)).translate(axis * distance)
    body = _solid(one.fuse(two))
    ring = 0.5 * _ring(body, "SPHERE", "SPHERE").Length() / math.pi
    return Case("sphere + sphere", body, _ring(body, "SPHERE", "SPHERE"), ring * float(rng.uniform(0.1, 0.4)))


def _freeform_block(rng: Rng, size: float, height: float) -> cq.Solid:
    """Build a block whose top is a B-spline surface through a random wavy grid."""
    n = 6
    at = np.linspace(-size / 2, size / 2, n)
    z = height * rng.uniform(-1, 1, (n, n))
    points = [[cq.Vector(float(x), float(y), float(z[i, j])) for j, y in enumerate(at)] for i, x in enumerate(at)]
    top = cq.Face.makeSplineApprox(points, tol=1e-4, minDeg=3, maxDeg=3)
    floor = -(3 * height + 8)
    prism = cq.Solid.extrudeLinear(cq.Face.makePlane(size * 0.8, size * 0.8), cq.Vector(0, 0, 60))
    prism = prism.translate(cq.Vector(0, 0, floor))
    return max(prism.split(top).Solids(), key=lambda s: -s.Center().z)


def box(rng: Rng) -> Case:
    """An edge of a box."""
    sizes = [float(x) for x in rng.uniform(8, 30, 3)]
    body = _tilted(rng, cq.Solid.makeBox(*sizes))
    edge = body.Edges()[int(rng.integers(12))]
    return Case("box", body, edge, min(sizes) * float(rng.uniform(0.1, 0.4)))


def oblique_box(rng: Rng) -> Case:
    """An edge of a prism over an irregular quadrilateral, cut off obliquely at both ends."""
    corners = [(-10, -8), (9, -10), (11, 9), (-9, 10)]
    corners = [(x + float(rng.uniform(-3, 3)), y + float(rng.uniform(-3, 3))) for x, y in corners]
    body: cq.Shape = cq.Workplane().polyline(corners).close().extrude(60).translate((0, 0, -30)).val()
    for sign in (1, -1):
        axis = cq.Vector(*(float(x) for x in rng.uniform(-1, 1, 2)), 0)
        knife = cq.Solid.makeBox(100, 100, 50, cq.Vector(-50, -50, 0 if sign > 0 else -50))
        knife = knife.rotate(cq.Vector(), axis, float(rng.uniform(0, 35)))
        body = body.cut(knife.translate(cq.Vector(0, 0, sign * 15)))
    body = _solid(body)
    upright = [e for e in body.Edges() if abs(e.tangentAt(0.5).z) > 0.99]
    edge = upright[int(rng.integers(len(upright)))]
    return Case("oblique box", _solid(body), edge, 12 * float(rng.uniform(0.1, 0.4)))


def loft(rng: Rng) -> Case:
    """A side edge of a loft between two rectangles, of which one is turned: ruled B-spline sides."""
    a, b = (float(x) for x in rng.uniform(10, 20, 2))
    turn = float(rng.uniform(5, 25))
    body = (
        cq.Workplane()
        .rect(a, a * 0.8)
        .workplane(offset=15)
        .transformed(rotate=(0, 0, turn))
        .rect(b, b * 0.7)
        .loft(ruled=True)
        .val()
    )
    sides = [e for e in body.Edges() if abs(e.tangentAt(0.5).z) > 0.5]
    edge = sides[int(rng.integers(len(sides)))]
    return Case("loft", body, edge, min(a, b) * 0.7 * float(rng.uniform(0.1, 0.4)))


def angle_bracket(rng: Rng) -> Case:
    """The inner, concave edge of an L, or one of its outer ones."""
    a, b, t, h = (float(x) for x in (*rng.uniform(15, 25, 2), rng.uniform(4, 8), rng.uniform(10, 20)))
    outline = [(0, 0), (a, 0), (a, t), (t, t), (t, b), (0, b)]
    body = cq.Workplane().polyline(outline).close().extrude(h).val()
    upright = [e for e in body.Edges() if abs(e.tangentAt(0.5).z) > 0.99]
    inner = min(upright, key=lambda e: (e.Center() - cq.Vector(t, t, h / 2)).Length)
    edge = inner if rng.uniform() < 0.7 else upright[int(rng.integers(len(upright)))]
    return Case("L", body, edge, t * float(rng.uniform(0.1, 0.4)))


def box_with_round_end(rng: Rng) -> Case:
    """An edge of a box that ends on a cylindrical face."""
    a, b, h = (float(x) for x in rng.uniform(14, 25, 3))
    radius = float(rng.uniform(0.8, 2.0)) * b
    place = cq.Vector(a + 0.8 * radius, b * float(rng.uniform(0.3, 0.7)), -h)
    cutter = cq.Solid.makeCylinder(radius, 3 * h, place, cq.Vector(0, 0, 1))
    body = _solid(cq.Solid.makeBox(a, b, h).cut(cutter))
    along = [e for e in body.Edges() if abs(e.tangentAt(0.5).x) > 0.99]
    edge = along[int(rng.integers(len(along)))]
    return Case("round end", body, edge, edge.Length() * float(rng.uniform(0.1, 0.4)) * 0.7)


def freeform_top(rng: Rng) -> Case:
    """An edge between a wavy B-spline top and a plane side."""
    body = _freeform_block(rng, 30.0, 0.8)
    rims = [e for e in body.Edges() if {f.geomType() for f in e.ancestors(body, "Face")} == {"BSPLINE", "PLANE"}]
    edge = rims[int(rng.integers(len(rims)))]
    return Case("freeform top", body, edge, 8 * float(rng.uniform(0.1, 0.4)))


FAMILIES: tuple[Callable[[Rng], Case], ...] = (
    sphere_and_boss,
    sphere_with_hole,
    cylinder_cap,
    dome_and_boss,
    two_spheres,
    box,
    oblique_box,
    loft,
    angle_bracket,
    box_with_round_end,
    freeform_top,
)


def draw(family: Callable[[Rng], Case], number: int) -> Case:
    """Return the case of a family with the given number."""
    return family(np.random.default_rng([FAMILIES.index(family), number]))
