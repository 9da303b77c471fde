"""Random bodies all of whose edges are blended at once: ten families, seeded, drawn once and for all.

The draws were fixed before the code they try. Each body comes with its thinnest wall, or gap between walls, and its
shortest edge, both known from how it was drawn; the radius is up to a third of the less of the two. Where faces or
edges meet at acute angles that may be too much: `CornerCase.tight` names an edge that is used up by the rails across
its ends, from the angles at the vertices alone. Of ``draw_corners(FAMILY, NUMBER)`` every number is its own body.

Nothing here knows cqblend.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import cadquery as cq
import numpy as np

from benchmarks.touching_balls import Array, Body, Face, Station, find_station

Rng = np.random.Generator
LARGEST_SHARE = 1 / 3
"""Largest radius, in shortest edges or thinnest walls."""
LEAST_SHARE = 0.05
SHARP = 0.05
"""Least angle between the faces of an edge that is to be blended, rad."""


@dataclass(frozen=True)
class Drawn:
    """A body and its thinnest wall or gap, mm."""

    body: cq.Shape
    wall: float


Family = Callable[[Rng], Drawn]


@dataclass(frozen=True)
class CornerCase:
    """A body, its sharp edges, and a radius for all of them; what is too tight for it, in words, if anything is."""

    family: str
    number: int
    body: cq.Shape
    edges: tuple[cq.Edge, ...]
    wall: float
    radius: float
    tight: str

    @property
    def name(self) -> str:
        """Family and number."""
        return f"{self.family} {self.number}"


# -- outlines


def _draw_polygon(rng: Rng, corners: int, size: float) -> Array:
    """Draw a convex polygon with corners on an ellipse, none of them nearly straight."""
    gaps = rng.uniform(0.6, 1.4, corners)
    at = rng.uniform(0, 2 * math.pi) + 2 * math.pi * np.cumsum(gaps) / gaps.sum()
    return np.stack([np.cos(at) * size, np.sin(at) * size * rng.uniform(0.6, 1.0)], axis=1)


def _measure_width(polygon: Array) -> float:
    """Return the least distance between two parallel lines that hold a convex polygon between them."""
    sides = np.roll(polygon, -1, axis=0) - polygon
    normals = np.stack([-sides[:, 1], sides[:, 0]], axis=1) / np.linalg.norm(sides, axis=1, keepdims=True)
    return min(float(((polygon - start) @ normal).max()) for start, normal in zip(polygon, normals, strict=True))


def _inset(polygon: Array, distance: float) -> Array:
    """Move the sides of a convex polygon, counter-clockwise, inwards by a distance."""
    sides = np.roll(polygon, -1, axis=0) - polygon
    normals = np.stack([-sides[:, 1], sides[:, 0]], axis=1) / np.linalg.norm(sides, axis=1, keepdims=True)
    levels = (normals * polygon).sum(axis=1) + distance
    pairs = zip(np.roll(normals, 1, axis=0), normals, np.roll(levels, 1), levels, strict=True)
    return np.array([np.linalg.solve([before, after], [a, b]) for before, after, a, b in pairs])


def _extrude(polygon: Array | Sequence[Sequence[float]], height: float) -> cq.Solid:
    return cq.Workplane().polyline([tuple(map(float, p)) for p in polygon]).close().extrude(height).val()


def _make_polyhedron(bottom: Array, top: Array, height: float) -> cq.Solid:
    """Make a body of planes between two polygons with parallel sides, or a polygon and a point."""
    base = [cq.Vector(float(x), float(y), 0.0) for x, y in bottom]
    roof = [cq.Vector(float(x), float(y), height) for x, y in top]
    if len(roof) == 1:
        sides = [[p, q, roof[0]] for p, q in zip(base, base[1:] + base[:1], strict=True)]
        polygons = [base, *sides]
    else:
        rows = zip(base, base[1:] + base[:1], roof[1:] + roof[:1], roof, strict=True)
        polygons = [base, roof, *map(list, rows)]
    faces = [cq.Face.makeFromWires(cq.Wire.makePolygon(points, close=True)) for points in polygons]
    return cq.Solid.makeSolid(cq.Shell.makeShell(faces))


def _box(size: Sequence[float], corner: Sequence[float]) -> cq.Solid:
    return cq.Solid.makeBox(*map(float, size), cq.Vector(*map(float, corner)))


def _turn(shape: cq.Shape, degrees: float, axis: Sequence[float] = (0, 0, 1)) -> cq.Shape:
    return shape.rotate(cq.Vector(), cq.Vector(*map(float, axis)), float(degrees))


def _union(one: cq.Shape, *others: cq.Shape) -> cq.Shape:
    return one.fuse(*others).clean().Solids()[0]


# -- bodies


def box(rng: Rng) -> Drawn:
    """A box of any proportions."""
    sides = rng.uniform(5, 30, 3)
    return Drawn(_box(sides, (0, 0, 0)), float(sides.min()))


def wedge(rng: Rng) -> Drawn:
    """A prism over a triangle, or a block between two rectangles that are parallel."""
    if rng.uniform() < 0.5:
        a, b = rng.uniform(12, 25, 2)
        angle = rng.uniform(math.radians(35), math.radians(115))
        triangle = np.array([[0, 0], [a, 0], [b * math.cos(angle), b * math.sin(angle)]])
        height = float(rng.uniform(6, 20))
        return Drawn(_extrude(triangle, height), min(height, _measure_width(triangle)))
    x, y, z = (float(side) for side in rng.uniform(10, 25, 3))
    x0, x1, z0, z1 = (float(share) for share in rng.uniform(0.0, 0.35, 4))
    body = cq.Solid.makeWedge(x, y, z, x0 * x, z0 * z, (1 - x1) * x, (1 - z1) * z)
    return Drawn(body, min(x * (1 - x0 - x1), y, z * (1 - z0 - z1)))


def prism(rng: Rng) -> Drawn:
    """A prism over three to eight corners: upright, tapered or oblique."""
    polygon, height = _draw_polygon(rng, int(rng.integers(3, 9)), 12.0), float(rng.uniform(5, 20))
    wall, which = min(height, _measure_width(polygon)), rng.uniform()
    if which < 0.4:
        return Drawn(_extrude(polygon, height), wall)
    if which < 0.7:
        taper = float(rng.uniform(2, 12))
        lost = 2 * height * math.tan(math.radians(taper))
        if lost < 0.5 * wall:
            return Drawn(_make_polyhedron(polygon, _inset(polygon, lost / 2), height), wall - lost)
        return Drawn(_extrude(polygon, height), wall)
    lean, turn = math.tan(rng.uniform(0.1, 0.5)), rng.uniform(0, 2 * math.pi)
    along = cq.Vector(height * lean * math.cos(turn), height * lean * math.sin(turn), height)
    wire = cq.Wire.makePolygon([cq.Vector(*map(float, p)) for p in polygon], close=True)
    return Drawn(cq.Solid.extrudeLinear(wire, [], along), wall * math.cos(math.atan(lean)))


def angle_profile(rng: Rng) -> Drawn:
    """An L, a Z or steps, extruded: one to three concave edges."""
    a, b, h = (float(side) for side in rng.uniform(12, 25, 3))
    s, t = (float(wall) for wall in rng.uniform(3, 6, 2))
    which = rng.uniform()
    if which < 0.5:
        outline = [(0, 0), (a, 0), (a, t), (s, t), (s, b), (0, b)]
        return Drawn(_extrude(outline, h), min(s, t))
    if which < 0.75:
        outline = [(0, 0), (a, 0), (a, b), (2 * a - s, b), (2 * a - s, b + t), (a - s, b + t), (a - s, t), (0, t)]
        return Drawn(_extrude(outline, h), min(s, t))
    steps, rise = int(rng.integers(2, 4)), float(rng.uniform(3, 6))
    outline = [(0.0, 0.0), (steps * a / 2 + s, 0.0)]
    for n in range(steps):
        outline += [
            (steps * a / 2 + s - n * a / 2, (n + 1) * rise),
            (steps * a / 2 + s - (n + 1) * a / 2, (n + 1) * rise),
        ]
    outline += [(s, (steps + 1) * rise), (0.0, (steps + 1) * rise)]
    return Drawn(_extrude(outline, h), min(s, rise, a / 2))


def channel_profile(rng: Rng) -> Drawn:
    """A U, a T, a plus or an H, extruded: walls and gaps."""
    gap, s, t, u = (float(wall) for wall in rng.uniform(3, 8, 4))
    deep, h = float(rng.uniform(6, 15)), float(rng.uniform(6, 25))
    which, wide = int(rng.integers(4)), gap + s + u
    if which == 0:
        outline = [
            (0, 0),
            (wide, 0),
            (wide, t + deep),
            (s + gap, t + deep),
            (s + gap, t),
            (s, t),
            (s, t + deep),
            (0, t + deep),
        ]
        return Drawn(_extrude(outline, h), min(s, t, u, gap))
    if which == 1:
        outline = [(0, 0), (wide, 0), (wide, t), (s + gap, t), (s + gap, t + deep), (s, t + deep), (s, t), (0, t)]
        return Drawn(_extrude(outline, h), min(s, t, u, gap))
    if which == 2:
        one, two = _box((wide, gap, h), (-wide / 2, -gap / 2, 0)), _box((s, 2 * deep, h), (-s / 2, -deep, 0))
        return Drawn(_union(one, two), min(gap, s, (wide - s) / 2, deep - gap / 2))
    plate = _box((wide, 2 * deep + t, h), (0, 0, 0))
    cuts = [_box((gap, deep, h), (s, y, 0)) for y in (0, deep + t)]
    return Drawn(plate.cut(*cuts), min(s, u, t, gap))


def open_box(rng: Rng) -> Drawn:
    """A box without a lid, with one or two rooms, or a frame."""
    a, b, h = (float(side) for side in rng.uniform(18, 35, 3))
    s, floor = (float(wall) for wall in rng.uniform(1.5, 4, 2))
    which = rng.uniform()
    outer = _box((a, b, h), (0, 0, 0))
    if which < 0.5:
        return Drawn(outer.cut(_box((a - 2 * s, b - 2 * s, h), (s, s, floor))), min(s, floor))
    if which < 0.75:
        room = (a - 3 * s) / 2
        rooms = [_box((room, b - 2 * s, h), (x, s, floor)) for x in (s, 2 * s + room)]
        return Drawn(outer.cut(*rooms), min(s, floor))
    return Drawn(outer.cut(_box((a - 2 * s, b - 2 * s, 2 * h), (s, s, -h / 2))), s)


def boss_on_plate(rng: Rng) -> Drawn:
    """One or two bosses on a plate, turned about the upright: boxes, prisms, cylinders, tapered ones."""
    t, h, r = float(rng.uniform(4, 9)), float(rng.uniform(4, 12)), float(rng.uniform(4, 8))
    margin, count = float(rng.uniform(2, 5)), 1 + int(rng.uniform() < 0.3)
    long, wide = 2 * count * (r + margin), 2 * (r + margin)
    body: cq.Shape = _box((long, wide, t), (-long / 2, -wide / 2, -t))
    wall = min(t, h, margin)
    for n in range(count):
        which, at = rng.uniform(), (2 * n - count + 1) * (r + margin)
        if which < 0.2:
            boss, thin = cq.Solid.makeCylinder(r, h), 2 * r
        elif which < 0.6:
            lean = rng.uniform(0.4, 1.1)
            x, y = 2 * r * math.cos(lean), 2 * r * math.sin(lean)
            boss, thin = _box((x, y, h), (-x / 2, -y / 2, 0)), min(x, y)
            boss = _turn(boss, 0.0 if rng.uniform() < 0.4 else float(rng.uniform(5, 85)))
        else:
            polygon = _draw_polygon(rng, int(rng.integers(3, 7)), r)
            taper = math.radians(float(rng.uniform(3, 8))) if rng.uniform() < 0.5 else 0.0
            lost = min(h * math.tan(taper), 0.2 * _measure_width(polygon))
            thin = _measure_width(polygon) - 2 * lost
            boss = _make_polyhedron(polygon, _inset(polygon, lost), h)
        body, wall = _union(body, boss.translate(cq.Vector(at, 0, 0))), min(wall, thin)
    return Drawn(body, wall)


def meeting_boxes(rng: Rng) -> Drawn:
    """Two boxes: one through the other, tilted or turned, flush with a side or in a corner, or across."""
    which = int(rng.integers(5))
    t = float(rng.uniform(5, 9))
    if which == 0:  # a tower through a plate
        a, b = (float(side) for side in rng.uniform(6, 10, 2))
        tower = _turn(_turn(_box((a, b, 60), (-a / 2, -b / 2, -30)), rng.uniform(0, 90)), rng.uniform(0, 25), (1, 0, 0))
        return Drawn(_union(_box((36, 36, t), (-18, -18, -t / 2)), tower), min(a, b, t))
    if which == 1:  # two bars of one height that cross
        a, b = (float(side) for side in rng.uniform(5, 9, 2))
        angle = float(rng.uniform(45, 135))
        one = _box((40, a, t), (-20, -a / 2, 0))
        return Drawn(_union(one, _turn(_box((40, b, t), (-20, -b / 2, 0)), angle)), min(a, b, t))
    if which == 2:  # flush with one side
        a, b, h = (float(side) for side in rng.uniform(6, 12, 3))
        place = float(rng.uniform(3, 24 - a - 3)) if rng.uniform() < 0.6 else 0.0
        gap = min(24 - a - place, place) if place else 24 - a
        return Drawn(_union(_box((24, 20, t), (0, 0, 0)), _box((a, b, h), (place, 0, t))), min(a, b, h, t, gap, 20 - b))
    if which == 3:  # turned on top of one another, partly over the border
        a, h = float(rng.uniform(8, 12)), float(rng.uniform(6, 12))
        over = _turn(_box((a, a, h), (-a / 2, -a / 2, 0)), rng.uniform(15, 75)).translate(cq.Vector(12, 0, 0))
        return Drawn(
            _union(_box((24, 24, t), (-12, -12, -t)), over.translate(cq.Vector(0, 0, -0.5 * t))), min(t, a) / 2
        )
    a, b, c = (float(side) for side in rng.uniform(8, 14, 3))  # any two that overlap
    two = _turn(_box((a, b, c), (-a / 2, -b / 2, -c / 2)), rng.uniform(10, 60), rng.normal(size=3).tolist())
    one = _box((16, 14, 12), (-16, -7, -6))
    return Drawn(_union(one, two.translate(cq.Vector(2, 0, 0))), min(a, b, c) / 2)


def loft(rng: Rng) -> Drawn:
    """Between two outlines: frustums, twisted blocks, pyramids, and smooth ones through three rectangles."""
    h, which = float(rng.uniform(8, 18)), int(rng.integers(4))
    if which == 0:
        polygon = _draw_polygon(rng, int(rng.integers(3, 7)), 10.0)
        share, shift = float(rng.uniform(0.5, 0.9)), rng.uniform(-2, 2, 2)
        wires = [_make_wire(polygon, 0.0), _make_wire(share * polygon + shift, h)]
        return Drawn(cq.Solid.makeLoft(wires, True), min(h, share * _measure_width(polygon)))
    if which == 1:
        rectangle = _make_rectangle(*rng.uniform(5, 9, 2))
        angle, share = rng.uniform(0.05, 0.4), float(rng.uniform(0.7, 1.1))
        turned = share * rectangle @ np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        wall = min(h, _measure_width(rectangle), _measure_width(turned))
        return Drawn(cq.Solid.makeLoft([_make_wire(rectangle, 0.0), _make_wire(turned, h)], True), wall)
    if which == 2:
        polygon = _draw_polygon(rng, int(rng.integers(3, 7)), 10.0)
        apex = rng.uniform(-2, 2, (1, 2))
        return Drawn(_make_polyhedron(polygon, apex, h), min(h, _measure_width(polygon)))
    sides = rng.uniform(5, 9, (3, 2))
    wires = [_make_wire(_make_rectangle(*sides[n]), n * h / 2) for n in range(3)]
    return Drawn(cq.Solid.makeLoft(wires, False), min(h, 1.6 * float(sides.min())))


def _make_rectangle(a: float, b: float) -> Array:
    return np.array([[-a, -b], [a, -b], [a, b], [-a, b]])


def _make_wire(polygon: Array, z: float) -> cq.Wire:
    return cq.Wire.makePolygon([cq.Vector(float(x), float(y), z) for x, y in polygon], close=True)


def rounded_outline(rng: Rng) -> Drawn:
    """A prism over a polygon of which some corners are rounded and others sharp; some have a bay."""
    polygon, h = _draw_polygon(rng, int(rng.integers(3, 7)), 14.0), float(rng.uniform(5, 15))
    round_ones = rng.uniform(size=len(polygon)) < 0.5
    round_ones[int(rng.integers(len(polygon)))] = False
    radius = float(rng.uniform(2, 4))
    body = cq.Workplane(_extrude(polygon, h))
    corners = [tuple(p) for p, rounded in zip(polygon, round_ones, strict=True) if rounded]
    uprights = [
        edge
        for edge in body.edges("|Z").vals()
        if any(math.hypot(edge.Center().x - x, edge.Center().y - y) < 1e-6 for x, y in corners)
    ]
    solid = body.val().fillet(radius, uprights) if uprights else body.val()
    wall = min(h, _measure_width(polygon), radius * 2)
    if rng.uniform() < 0.3:
        deep = float(rng.uniform(2, 3))
        middle = (polygon[0] + polygon[1]) / 2
        bay = cq.Solid.makeCylinder(deep, 2 * h, cq.Vector(*map(float, middle), -h / 2))
        solid, wall = solid.cut(bay).Solids()[0], min(wall, deep)
    return Drawn(solid, wall)


FAMILIES: tuple[Family, ...] = (
    box,
    wedge,
    prism,
    angle_profile,
    channel_profile,
    open_box,
    boss_on_plate,
    meeting_boxes,
    loft,
    rounded_outline,
)


def draw_corners(family: Family, number: int) -> CornerCase:
    """Return the case of a family with the given number, turned about a random axis."""
    rng = np.random.default_rng([len(family.__name__), *family.__name__.encode(), number])
    drawn = family(rng)
    while min(edge.Length() for edge in list_sharp_edges(drawn.body)) < 1.0:
        drawn = family(rng)
    body = _turn(drawn.body, rng.uniform(0, 360), rng.normal(size=3).tolist())
    edges = list_sharp_edges(body)
    room = min(drawn.wall, *(edge.Length() for edge in edges))
    radius = room * float(rng.uniform(LEAST_SHARE, LARGEST_SHARE))
    tight = next(find_tight_places(Body(body.wrapped), edges, radius), "")
    return CornerCase(family.__name__, number, body, tuple(edges), drawn.wall, radius, tight)


def list_sharp_edges(shape: cq.Shape) -> list[cq.Edge]:
    """List the edges of a shape at which two faces meet at an angle."""
    body, found = Body(shape.wrapped), []
    for edge in shape.Edges():
        station = find_station(body, edge.wrapped, 0.5)
        if station is not None and station.angle < math.pi - SHARP:
            found.append(edge)
    return found


# -- what does not fit


@dataclass(frozen=True)
class _End:
    """An end of an edge on a face: where, where to, and how far from it the rail lies on the face."""

    vertex: Array
    ahead: Array
    inward: Array
    offset: float


def find_tight_places(body: Body, edges: Sequence[cq.Edge], radius: float) -> Iterator[str]:
    """Yield edges that are used up by the rails across their ends.

    On a face, rails at the distances d and d' from two edges that meet at the angle phi cross at (d' + d cos phi) / sin
    phi along the first; that of a ball between two planes at the angle theta is R cot(theta/2) away from the edge.
    """
    used = np.zeros(len(edges))
    for face in body.faces:
        at_ends = [(n, _list_ends(body, edge, face, radius)) for n, edge in enumerate(edges)]
        on_face = [(n, ends) for n, ends in at_ends if ends]
        taken: dict[int, list[float]] = {}
        for n, ends in on_face:
            for end in ends:
                others = [other for m, ends in on_face if m != n for other in ends]
                crossings = [_find_crossing(end, other) for other in others if _do_meet(end, other)]
                taken.setdefault(n, []).append(max(crossings, default=0.0))
        for n, setbacks in taken.items():
            used[n] = max(used[n], sum(setbacks))
    for n, edge in enumerate(edges):
        if used[n] > edge.Length():
            number = body.find_number(edge.wrapped)
            yield f"rails take {used[n]:.3g} of the {edge.Length():.3g} mm of edge {number}"


def _list_ends(body: Body, edge: cq.Edge, face: Face, radius: float) -> list[_End]:
    if not any(face.number == other.number for other in body.find_faces_at(edge.wrapped)):
        return []
    side = [other.number for other in body.find_faces_at(edge.wrapped)].index(face.number)
    found = []
    for share, sense in ((0.0, 1.0), (1.0, -1.0)):
        station = _find_station_near(body, edge, share)
        if station is not None:
            depth = radius / math.tan(station.angle / 2)
            found.append(_End(station.point, sense * station.tangent, station.inward[side], depth))
    return found


def _find_station_near(body: Body, edge: cq.Edge, share: float) -> Station | None:
    return find_station(body, edge.wrapped, share) or find_station(body, edge.wrapped, abs(share - 1e-3))


def _do_meet(one: _End, other: _End) -> bool:
    return float(np.linalg.norm(one.vertex - other.vertex)) < 1e-3


def _find_crossing(one: _End, other: _End) -> float:
    along, across = float(other.ahead @ one.ahead), float(other.ahead @ one.inward)
    if across <= 0.05:  # reflex, or one edge goes on in the other
        return 0.0
    return max((other.offset + one.offset * along) / across, 0.0)
