"""Random bodies with a chain of edges: outlines of lines, arcs and splines, made into bodies in many ways.

A family is a function that draws a body and picks an edge of one of its chains; `draw_chain` turns both about a random
axis. The same number gives the same body. What radius is to fit, `benchmarks.chain_sizes` estimates.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cadquery as cq
import numpy as np

Rng = np.random.Generator
Picked = tuple[cq.Shape, cq.Edge]
Family = Callable[[Rng], Picked]

HEIGHT = 8.0
"""Height of prisms, mm; their outlines are 20 to 40 across."""


@dataclass(frozen=True)
class ChainCase:
    """A body and an edge of it, picked from a chain, by the name and the number that draw them again."""

    family: str
    number: int
    body: cq.Shape
    edge: cq.Edge

    @property
    def name(self) -> str:
        """Family and number."""
        return f"{self.family} {self.number}"


# -- outlines


def draw_outline(rng: Rng, *, sharp: int = 0, splines: bool = True, size: float = 14.0) -> cq.Wire:
    """Draw a polygon of 3 to 6 corners, all but some of them rounded by arcs, with some sides bulged as splines."""
    count = int(rng.integers(3, 7))
    turns = (np.arange(count) + rng.uniform(-0.2, 0.2, count)) * 2 * math.pi / count
    corners = size * rng.uniform(0.75, 1.25, count)[:, None] * np.column_stack([np.cos(turns), np.sin(turns)])
    sharp_ones = set(rng.choice(count, size=min(sharp, count), replace=False).tolist())
    shares = rng.uniform(0.25, 0.9, count)
    sides = np.roll(corners, -1, axis=0) - corners
    lengths = np.linalg.norm(sides, axis=1)
    units = sides / lengths[:, None]
    cuts = [0.0 if i in sharp_ones else 0.45 * shares[i] * min(lengths[i], lengths[i - 1]) for i in range(count)]
    edges: list[cq.Edge] = []
    for i in range(count):
        following = (i + 1) % count
        start, end = corners[i] + cuts[i] * units[i], corners[following] - cuts[following] * units[i]
        bulged = splines and rng.uniform() < 0.3
        edges.append(_bulge(start, end, units[i], float(rng.uniform(-0.06, 0.06))) if bulged else _line(start, end))
        if following not in sharp_ones:
            ahead = corners[following] + cuts[following] * units[following]
            edges.append(cq.Edge.makeTangentArc(_point(end), _point(units[i]), _point(ahead)))
    return cq.Wire.assembleEdges(edges)


def draw_slot(rng: Rng, size: float = 10.0) -> cq.Wire:
    """Draw two parallel lines with half circles at both ends, or a D with rounded corners."""
    long, radius = size * float(rng.uniform(0.4, 1.2)), size * float(rng.uniform(0.3, 0.6))
    if rng.uniform() < 0.6:
        return cq.Workplane().slot2D(2 * (long + radius), 2 * radius).wires().val()
    half = cq.Workplane().moveTo(0, -size).lineTo(0, size).threePointArc((size, 0), (0, -size)).close().wires().val()
    return half.fillet2D(size * float(rng.uniform(0.1, 0.4)), half.Vertices())


def draw_oval(rng: Rng, size: float = 12.0) -> cq.Wire:
    """Draw a closed smooth outline of one spline, or of two splines between parallel lines."""
    turn = np.arange(12) * 2 * math.pi / 12
    radii = size * (1 + 0.06 * rng.uniform(-1, 1, 12))
    if rng.uniform() < 0.5:
        points = [cq.Vector(r * math.cos(t), 0.7 * r * math.sin(t)) for t, r in zip(turn.tolist(), radii, strict=True)]
        return cq.Wire.assembleEdges([cq.Edge.makeSpline(points, periodic=True)])
    h, w, tip = 0.5 * size, 0.8 * size, size * float(rng.uniform(1.3, 1.6))
    right = cq.Edge.makeSpline([_xy(w, -h), _xy(tip, 0.1 * h), _xy(w, h)], tangents=[_xy(1, 0), _xy(-1, 0)])
    left = cq.Edge.makeSpline([_xy(-w, h), _xy(-tip, -0.1 * h), _xy(-w, -h)], tangents=[_xy(-1, 0), _xy(1, 0)])
    return cq.Wire.assembleEdges([_line((-w, -h), (w, -h)), right, _line((w, h), (-w, h)), left])


def draw_closed(rng: Rng, size: float = 14.0) -> cq.Wire:
    """Draw any smooth outline."""
    which = rng.uniform()
    if which < 0.5:
        return draw_outline(rng, size=size)
    return draw_slot(rng, 0.8 * size) if which < 0.75 else draw_oval(rng, size)


def _xy(x: float, y: float) -> cq.Vector:
    return cq.Vector(float(x), float(y), 0.0)


def _point(p: Sequence[float]) -> cq.Vector:
    return _xy(*p)


def _line(start: Sequence[float], end: Sequence[float]) -> cq.Edge:
    return cq.Edge.makeLine(_point(start), _point(end))


def _bulge(start: np.ndarray, end: np.ndarray, direction: np.ndarray, share: float) -> cq.Edge:
    """Return a spline with the directions of the straight side at both ends, moved aside in the middle."""
    aside = share * np.linalg.norm(end - start) * np.array([-direction[1], direction[0]])
    points = [start, (start + end) / 2 + aside, end]
    return cq.Edge.makeSpline([_point(p) for p in points], tangents=[_point(direction)] * 2)


# -- bodies


def _extrude(wire: cq.Wire, height: float = HEIGHT, taper: float = 0.0) -> cq.Solid:
    return cq.Solid.extrudeLinear(wire, [], cq.Vector(0, 0, height), taper)


def _pick(rng: Rng, edges: Sequence[cq.Edge]) -> cq.Edge:
    return edges[int(rng.integers(len(edges)))]


def _pick_at_height(rng: Rng, body: cq.Shape, height: float, within: float = math.inf) -> cq.Edge:
    """Pick one of the edges that lie at a height, all of them, and no farther than a distance from the axis."""
    found = []
    for edge in body.Edges():
        box = edge.BoundingBox()
        level = abs(box.zmin - height) < 1e-5 and abs(box.zmax - height) < 1e-5
        if level and max(abs(box.xmin), abs(box.xmax), abs(box.ymin), abs(box.ymax)) < within:
            found.append(edge)
    return _pick(rng, found)


def prism_rim(rng: Rng) -> Picked:
    """The top of a prism over a smooth outline."""
    body = _extrude(draw_closed(rng))
    return body, _pick_at_height(rng, body, HEIGHT)


def tapered_rim(rng: Rng) -> Picked:
    """The top or the bottom of a tapered prism over lines and arcs: planes and cones."""
    outline = draw_outline(rng, splines=False) if rng.uniform() < 0.7 else draw_slot(rng, 11.0)
    body = _extrude(outline, 0.5 * HEIGHT, float(rng.uniform(2, 12)))
    return body, _pick_at_height(rng, body, float(rng.choice([0.0, 0.5 * HEIGHT])))


def sheared_rim(rng: Rng) -> Picked:
    """The top of an oblique prism: smooth edges are not square to the rim."""
    lean, turn = math.tan(math.radians(float(rng.uniform(5, 35)))), float(rng.uniform(0, 2 * math.pi))
    along = cq.Vector(HEIGHT * lean * math.cos(turn), HEIGHT * lean * math.sin(turn), HEIGHT)
    body = cq.Solid.extrudeLinear(draw_closed(rng), [], along)
    return body, _pick_at_height(rng, body, HEIGHT)


def open_rim(rng: Rng) -> Picked:
    """The top of a prism of which some corners are sharp: chains end there."""
    body = _extrude(draw_outline(rng, sharp=int(rng.integers(2, 4))))
    return body, _pick_at_height(rng, body, HEIGHT)


def pocket_floor(rng: Rng) -> Picked:
    """The loop around the floor of a pocket."""
    body = _cut_pocket(rng)
    return body, _pick_at_height(rng, body, 4.0, within=29.0)


def pocket_rim(rng: Rng) -> Picked:
    """The loop around the opening of a pocket."""
    body = _cut_pocket(rng)
    return body, _pick_at_height(rng, body, 12.0, within=29.0)


def _cut_pocket(rng: Rng) -> cq.Shape:
    block = cq.Solid.makeBox(60, 60, 12, cq.Vector(-30, -30, 0))
    return block.cut(_extrude(draw_closed(rng), 20.0).translate(cq.Vector(0, 0, 4)))


def boss_foot(rng: Rng) -> Picked:
    """The foot of a boss on a plate, all round."""
    plate = cq.Solid.makeBox(60, 60, 6, cq.Vector(-30, -30, -6))
    body = plate.fuse(_extrude(draw_closed(rng), taper=0.0))
    return body, _pick_at_height(rng, body, 0.0, within=29.0)


def freeform_rim(rng: Rng) -> Picked:
    """The rim of a wavy spline top over an outline."""
    column = cq.Solid.extrudeLinear(draw_closed(rng, 12.0), [], cq.Vector(0, 0, 30)).translate(cq.Vector(0, 0, -15))
    body = min(column.split(_draw_wavy_face(rng)).Solids(), key=lambda solid: solid.Center().z)
    return body, _pick(rng, [edge for edge in body.Edges() if _touches_spline_top(body, edge)])


def freeform_foot(rng: Rng) -> Picked:
    """The foot of a boss that stands on a wavy spline face."""
    block = cq.Solid.makeBox(60, 60, 40, cq.Vector(-30, -30, -30))
    ground = min(block.split(_draw_wavy_face(rng)).Solids(), key=lambda solid: solid.Center().z)
    boss = cq.Solid.extrudeLinear(draw_closed(rng, 12.0), [], cq.Vector(0, 0, 20)).translate(cq.Vector(0, 0, -6))
    body = ground.fuse(boss)
    feet = [e for e in body.Edges() if _touches_spline_top(body, e) and e.BoundingBox().DiagonalLength < 50]
    feet = [e for e in feet if max(abs(e.Center().x), abs(e.Center().y)) < 25]
    return body, _pick(rng, feet)


def _draw_wavy_face(rng: Rng) -> cq.Face:
    at, height = np.linspace(-36, 36, 7), float(rng.uniform(0.2, 0.6))
    z = height * rng.uniform(-1, 1, (7, 7))
    rows = [[cq.Vector(float(x), float(y), float(z[i, j])) for j, y in enumerate(at)] for i, x in enumerate(at)]
    return cq.Face.makeSplineApprox(rows, tol=1e-5, minDeg=3, maxDeg=3)


def _touches_spline_top(body: cq.Shape, edge: cq.Edge) -> bool:
    faces = edge.ancestors(body, "Face").Faces()
    tops = [face for face in faces if face.geomType() == "BSPLINE" and abs(face.normalAt(edge.positionAt(0.5)).z) > 0.7]
    return len(faces) == 2 and len(tops) == 1


def loft_rim(rng: Rng) -> Picked:
    """The top of a loft between two rounded rectangles: ruled walls."""
    a, b, r = (float(x) for x in (*rng.uniform(14, 24, 2), rng.uniform(2, 5)))
    sketch = cq.Workplane().sketch().rect(a, b).vertices().fillet(r).finalize()
    share = float(rng.uniform(0.6, 0.95))
    top = sketch.placeSketch(
        cq.Sketch().rect(a, b).vertices().fillet(r),
        cq.Sketch().rect(share * a, share * b).vertices().fillet(share * r).moved(cq.Location(cq.Vector(0, 0, HEIGHT))),
    )
    body = top.loft(ruled=bool(rng.uniform() < 0.5)).val()
    return body, _pick_at_height(rng, body, HEIGHT)


def window_in_tube(rng: Rng) -> Picked:
    """The outer rim of a rounded window through the wall of a tube."""
    tube = _make_rod(20.0).cut(_make_rod(13.0))
    outline = draw_closed(rng, float(rng.uniform(6, 9)))
    tool = cq.Solid.extrudeLinear(outline, [], cq.Vector(0, 0, 40)).rotate(cq.Vector(), cq.Vector(0, 1, 0), 90)
    body = tube.cut(tool)
    return body, _pick(rng, _list_edges_on_rod(body))


def peg_on_rod(rng: Rng) -> Picked:
    """The foot of a peg of any outline that stands on a rod."""
    rod = _make_rod(20.0)
    outline = draw_closed(rng, float(rng.uniform(6, 9)))
    peg = cq.Solid.extrudeLinear(outline, [], cq.Vector(0, 0, 40)).rotate(cq.Vector(), cq.Vector(0, 1, 0), 90)
    body = rod.fuse(peg)
    return body, _pick(rng, _list_edges_on_rod(body))


def _make_rod(radius: float) -> cq.Shape:
    """Return a cylinder about the z axis whose seam is where x is least."""
    rod = cq.Solid.makeCylinder(radius, 60, cq.Vector(0, 0, -30))
    return rod.rotate(cq.Vector(), cq.Vector(0, 0, 1), 180)


def _list_edges_on_rod(body: cq.Shape, radius: float = 20.0) -> list[cq.Edge]:
    """List the edges on the side of a rod that are not its rims."""
    found = []
    for edge in body.Edges():
        points = edge.positions(np.linspace(0, 1, 5).tolist())
        on_rod = all(abs(math.hypot(p.x, p.y) - radius) < 1e-4 for p in points)
        if on_rod and edge.Center().x > 5 and abs(edge.Center().z) < 25:
            found.append(edge)
    return found


def turned_rim(rng: Rng) -> Picked:
    """An edge of a turned body, all round or in part: cylinders, cones, tori and planes."""
    r = 6 + float(rng.uniform(0, 4))
    profile = cq.Workplane("XZ").moveTo(r, 0).lineTo(r + float(rng.uniform(4, 7)), 0)
    profile = profile.lineTo(r + float(rng.uniform(4, 9)), 5).lineTo(r + 3, float(rng.uniform(6, 8)))
    profile = profile.threePointArc((r + float(rng.uniform(3.5, 4.5)), 10), (r + 2, 14)).lineTo(r, 14).close()
    angle = 360.0 if rng.uniform() < 0.5 else float(rng.uniform(60, 300))
    body = profile.revolve(angle, (0, 0, 0), (0, 1, 0)).val()
    return body, _pick(rng, [edge for edge in body.Edges() if edge.geomType() == "CIRCLE" and edge.Length() > 8])


def bent_bar(rng: Rng) -> Picked:
    """A long edge of a bar that is swept along lines and arcs."""
    path = cq.Workplane("XZ").lineTo(0, float(rng.uniform(8, 14)))
    bend = float(rng.uniform(10, 16))
    path = path.tangentArcPoint((bend, bend), relative=True).line(float(rng.uniform(6, 12)), 0)
    if rng.uniform() < 0.5:
        path = path.tangentArcPoint((bend, -bend), relative=True)
    a, b = (float(s) for s in rng.uniform(5, 9, 2))
    body = cq.Workplane().rect(a, b).sweep(path).val()
    return body, _pick(
        rng, [edge for edge in body.Edges() if edge.BoundingBox().zmin < 1e-6 < edge.tangentAt(0).z ** 2]
    )


FAMILIES: tuple[Family, ...] = (
    prism_rim,
    tapered_rim,
    sheared_rim,
    open_rim,
    pocket_floor,
    pocket_rim,
    boss_foot,
    freeform_rim,
    freeform_foot,
    loft_rim,
    window_in_tube,
    peg_on_rod,
    turned_rim,
    bent_bar,
)


def draw_chain(family: Family, number: int) -> ChainCase:
    """Return the case of a family with the given number, turned about a random axis."""
    rng = np.random.default_rng([len(family.__name__), *family.__name__.encode(), number])
    body, edge = family(rng)
    place = [other.isSame(edge) for other in body.Edges()].index(True)
    axis = cq.Vector(*rng.normal(size=3).tolist())
    turned = body.rotate(cq.Vector(), axis, float(rng.uniform(0, 360)))
    return ChainCase(family.__name__, number, turned, turned.Edges()[place])
