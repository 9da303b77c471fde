"""Witnesses of unrolled patterns that share no code with them: lengths, areas and distances by other means.

Lengths and areas of arcs come from their bulges by school formulas, distances from OCCT's projections onto trimmed
faces, edges from OCCT's topology and quadrature.
"""

from collections import defaultdict

import numpy as np
import shapely
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.GCPnts import GCPnts_AbscissaPoint
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.gp import gp_Pnt, gp_Pnt2d, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_IN, TopAbs_ON, TopAbs_REVERSED
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape, TopTools_IndexedMapOfShape

# Plane curves, given by points and bulges (tangents of a quarter of each arc's angle).


def lengths(points, bulges):
    """Chord times half the angle over its sine, in extended precision."""
    points, bulges = np.asarray(points, dtype=np.longdouble), np.asarray(bulges, dtype=np.longdouble)
    half = 2 * np.arctan(np.abs(bulges))
    small = half < 1e-4
    sine = np.where(small, 1, np.sin(half))
    return np.hypot(*np.diff(points, axis=0).T) * np.where(small, 1 + half**2 / 6 + 7 * half**4 / 360, half / sine)


def length(points, bulges):
    return float(lengths(points, bulges).sum())


def dense(points, bulges, count=16):
    """Points on the segments and arcs, `count` to each, by turning about the centres."""
    points, bulges = np.asarray(points, dtype=float), np.asarray(bulges, dtype=float)[:, None]
    start, chord = points[:-1], np.diff(points, axis=0)
    bent = np.abs(bulges) > 1e-9
    tangent = np.where(bent, bulges, 1.0)
    centre = start + chord / 2 + (1 - tangent**2) / (4 * tangent) * np.stack([-chord[:, 1], chord[:, 0]], axis=-1)
    part = np.arange(count) / count
    cos, sin = np.cos(4 * np.arctan(tangent) * part), np.sin(4 * np.arctan(tangent) * part)
    x, y = (start - centre).T[..., None]
    arcs = centre[:, None] + np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)
    straight = start[:, None] + part[:, None] * chord[:, None]
    return np.concatenate([np.where(bent[..., None], arcs, straight).reshape(-1, 2), points[-1:]])


def polygon(piece, count=32):
    """The piece as a shapely polygon, its arcs sampled."""
    rings = [
        np.concatenate([dense(run.path.points, run.path.bulges, count)[:-1] for run in loop]) for loop in piece.loops
    ]
    return shapely.Polygon(rings[0], rings[1:])


def inner_points(shape, count, rng):
    """Random points inside a polygon."""
    x0, y0, x1, y1 = shape.bounds
    found = np.empty((0, 2))
    while len(found) < count:
        tried = rng.uniform((x0, y0), (x1, y1), (8 * count, 2))
        found = np.concatenate([found, tried[shapely.contains_xy(shape, *tried.T)]])
    return found[:count]


# Shapes of OCCT.


def faces_of(shape):
    """Faces in the order of the shape's face map."""
    found = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, TopAbs_FACE, found)
    return [TopoDS.Face_s(found.FindKey(i)) for i in range(1, found.Extent() + 1)]


def area(shape):
    found = GProp_GProps()
    BRepGProp.SurfaceProperties_s(shape, found, 1e-10)
    return found.Mass()


def meshed_area(shape, deflection):
    """Area of a mesh: OCCT's quadrature is off by some thousandths on faces bounded by polygons of many corners."""
    vertices, triangles = shape.copy().tessellate(deflection, 0.1)
    a, b, c = np.array([vertex.toTuple() for vertex in vertices])[np.array(triangles)].swapaxes(0, 1)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def distance(point, shape):
    """Distance of a point from a shape: OCCT's extrema, and its projections onto each face that are inside it."""
    point = gp_Pnt(*map(float, point))
    best = BRepExtrema_DistShapeShape(BRepBuilderAPI_MakeVertex(point).Vertex(), shape).Value()
    for face in faces_of(shape):  # the extrema alone overlook some feet inside faces
        feet = GeomAPI_ProjectPointOnSurf(point, BRep_Tool.Surface_s(face))
        inside = BRepTopAdaptor_FClass2d(face, 1e-9)
        for i in range(1, feet.NbPoints() + 1):
            if feet.Distance(i) < best and inside.Perform(gp_Pnt2d(*feet.Parameters(i))) in (TopAbs_IN, TopAbs_ON):
                best = feet.Distance(i)
    return best


def points_on(face, count, rng):
    """Random points of a trimmed face."""
    plane = BRepAdaptor_Surface(face)
    low = plane.FirstUParameter(), plane.FirstVParameter()
    high = plane.LastUParameter(), plane.LastVParameter()
    inside = BRepTopAdaptor_FClass2d(face, 1e-9)
    found = []
    while len(found) < count:
        u, v = rng.uniform(low, high)
        if inside.Perform(gp_Pnt2d(u, v)) == TopAbs_IN:
            found.append(plane.Value(u, v))
    return [(point.X(), point.Y(), point.Z()) for point in found]


def outward(face, point):
    """Normal of a face at the foot of a point."""
    surface = BRep_Tool.Surface_s(face)
    u, v = GeomAPI_ProjectPointOnSurf(gp_Pnt(*map(float, point)), surface).LowerDistanceParameters()
    foot, along, across = gp_Pnt(), gp_Vec(), gp_Vec()
    surface.D1(u, v, foot, along, across)
    normal = along.Crossed(across)
    normal = np.array([normal.X(), normal.Y(), normal.Z()])
    return (-normal if face.Orientation() == TopAbs_REVERSED else normal) / np.linalg.norm(normal)


def edge_length(edge):
    return GCPnts_AbscissaPoint.Length_s(BRepAdaptor_Curve(edge), 1e-10)


def shared_lengths(shape, owner):
    """Length of all edges between two pieces' faces, by pair of owners; `owner` maps face numbers to a key."""
    faces = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, TopAbs_FACE, faces)
    edges = TopTools_IndexedDataMapOfShapeListOfShape()
    TopExp.MapShapesAndAncestors_s(shape, TopAbs_EDGE, TopAbs_FACE, edges)
    found = defaultdict(float)
    for i in range(1, edges.Extent() + 1):
        edge = TopoDS.Edge_s(edges.FindKey(i))
        owners = sorted({owner[faces.FindIndex(face)] for face in edges.FindFromIndex(i)})
        if len(owners) == 2 and not BRep_Tool.Degenerated_s(edge):
            found[tuple(owners)] += edge_length(edge)
    return dict(found)


# Patterns.


def seam_mismatch(pattern):
    """Largest relative difference between the two sides of a seam."""
    sides = [[pattern.pieces.run(side).path for side in seam.sides] for seam in pattern.seams]
    both = np.array([[length(path.points, path.bulges) for path in pair] for pair in sides]).reshape(-1, 2)
    return float((np.abs(both[:, 0] - both[:, 1]) / both.max(axis=1)).max(initial=0.0))


def seam_gap(pattern, count=33):
    """Largest distance between points of the two sides of a seam, rolled, at the same parts of their length."""
    spread = folded(pattern, lambda run: evenly(run.path, count))
    worst = 0.0
    for seam in pattern.seams:
        here, there = (spread[side.piece, side.loop, side.run] for side in seam.sides)
        worst = max(worst, np.linalg.norm(here - (there[::-1] if seam.opposed else there), axis=1).max())
    return worst


def evenly(path, count):
    """Points at equal parts of a path's length."""
    reached = np.append(0.0, np.cumsum(np.repeat(lengths(path.points, path.bulges).astype(float) / 16, 16)))
    at = np.linspace(0, reached[-1], count)
    return np.stack([np.interp(at, reached, x) for x in dense(path.points, path.bulges, 16).T], axis=-1)


def folded(pattern, points_of):
    """Points of each run rolled back, by (piece, loop, run)."""
    found = {}
    for i, piece in enumerate(pattern.strips):
        places, flat = zip(*(((i, loop, run), points_of(one)) for loop, run, one in piece.runs()), strict=True)
        space = pattern.fold(i, np.concatenate(flat))
        found |= zip(places, np.split(space, np.cumsum([*map(len, flat)])[:-1]), strict=True)
    return found


def fold_error(pattern):
    """Largest distance of vertices rolled back from where they are said to be."""
    spread = folded(pattern, lambda run: run.path.points)
    return max(
        np.abs(spread[i, loop, run] - one.space).max()
        for i, piece in enumerate(pattern.strips)
        for loop, run, one in piece.runs()
    )


def links_are_sound(pattern):
    """Seams and runs name each other, and no run is on two seams."""
    named = {
        (piece, loop, run): record.seam for piece, one in enumerate(pattern.strips) for loop, run, record in one.runs()
    }
    used = [
        ((side.piece, side.loop, side.run), number) for number, seam in enumerate(pattern.seams) for side in seam.sides
    ]
    labels = [seam.label for seam in pattern.seams]
    names = [piece.name for piece in pattern.strips]
    return (
        len({place for place, _ in used}) == len(used)
        and dict(used) == {place: seam for place, seam in named.items() if seam is not None}
        and len(set(labels)) == len(labels)
        and len(set(names)) == len(names)
    )


def is_drawn_well(piece):
    """The outer outline is counterclockwise, holes are clockwise, and nothing crosses."""
    shape = polygon(piece)
    return shape.is_valid and shape.exterior.is_ccw and not any(hole.is_ccw for hole in shape.interiors)


def chain_gap(pattern):
    """Largest distance between the end of a run and the beginning of the next, in the plane and in space."""
    return max(
        max(np.abs(a.path.points[-1] - b.path.points[0]).max(), np.abs(a.space[-1] - b.space[0]).max())
        for piece in pattern.strips
        for loop in piece.loops
        for a, b in zip(loop, [*loop[1:], loop[0]], strict=True)
    )


def strays(pattern, shape, count, rng):
    """Largest distance of rolled points of the pieces from their own faces."""
    faces = faces_of(shape)
    worst = 0.0
    for i, (piece, record) in enumerate(zip(pattern.strips, pattern.report.pieces, strict=True)):
        own = [faces[number - 1] for number in record.faces]
        for point in pattern.fold(i, inner_points(polygon(piece), count, rng)):
            worst = max(worst, min(distance(point, face) for face in own))
    return worst


def bareness(pattern, shape, count, rng):
    """Largest distance of points of the shape from the strips in space."""
    strips = pattern.strips_3d().wrapped
    return max(distance(point, strips) for face in faces_of(shape) for point in points_on(face, count, rng))


def facing(pattern, shape, rng):
    """Least cosine of the angles between small triangles, rolled, and the outer normals next to them."""
    faces = faces_of(shape)
    worst = 1.0
    for i, (piece, record) in enumerate(zip(pattern.strips, pattern.report.pieces, strict=True)):
        flat = polygon(piece)
        inner = flat.buffer(-0.1 * flat.area / flat.length)
        for corner in inner_points(inner if inner.area else flat, 2, rng):
            size = min(0.5 * shapely.Point(corner).distance(flat.boundary), 1e-3 * flat.length)
            a, b, c = pattern.fold(i, corner + size * np.array([[0, 0], [1, 0], [0, 1]]))
            normal = np.cross(b - a, c - a)
            face = min((faces[number - 1] for number in record.faces), key=lambda face, a=a: distance(a, face))
            worst = min(worst, float(normal @ outward(face, a) / np.linalg.norm(normal)))
    return worst
