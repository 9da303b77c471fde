"""What volume a body has once all its edges are blended: exactly for convex polyhedra, estimated for other bodies.

A ball that rolls inside a convex polyhedron whose corners have three edges leaves the opening of it: all points that a
ball reaches. That is what remains when every face is moved inwards by R, and what grows from there by R: Steiner's
formula, V + R A + R^2/2 sum l theta + 4/3 pi R^3, with the volume, the area, the lengths and the outer angles of the
edges of the smaller polyhedron. Elsewhere sections are added up along the edges, and corners are what is in doubt.

Nothing here knows cqblend.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools, BRepTools_WireExplorer
from OCP.Geom import Geom_Plane
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED, TopAbs_VERTEX
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedDataMapOfShapeListOfShape, TopTools_IndexedMapOfShape

from benchmarks.chain_sizes import estimate_volume_change
from benchmarks.tangent_chains import Chain, measure_length
from benchmarks.touching_balls import Array, Body, find_station

EXACT = 1e-9
"""Doubt of a volume that is known exactly, as a share of it."""
CORNER = 3.0
"""Doubt of the volume at the end of an edge, in prisms of its section as long as its rails are apart from it."""


@dataclass(frozen=True)
class Volume:
    """A volume and how far it may be off, mm^3."""

    value: float
    doubt: float


def expect_volume(shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], radius: float) -> Volume:
    """Return the volume once some edges are blended: ``edges`` are all sharp ones, or the estimate is made."""
    body = Body(shape)
    stations = [find_station(body, edge, 0.5) for edge in edges]
    if all(station is not None and station.convex for station in stations):
        opened = find_opened_volume(shape, radius, len(edges))
        if opened is not None:
            return Volume(opened, EXACT * opened)
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, 1e-9, True, False)
    change = doubt = 0.0
    for edge, station in zip(edges, stations, strict=True):
        assert station is not None
        half = station.angle / 2
        width = radius / math.tan(half)
        area = radius * width - radius**2 * (math.pi / 2 - half)
        if all(isinstance(face.surface, Geom_Plane) for face in body.find_faces_at(edge)):
            one, off = station.sense * area * measure_length(edge), 0.0
        else:
            one, off = estimate_volume_change(body, Chain((edge,), True), radius)
        change, doubt = change + one, doubt + off + CORNER * area * width
    return Volume(float(properties.Mass()) + change, doubt)


def find_opened_volume(shape: TopoDS_Shape, radius: float, edge_count: int) -> float | None:
    """Return the volume that a ball reaches inside a convex polyhedron; None if it is none, or loses an edge."""
    faces, vertices, around = TopTools_IndexedMapOfShape(), TopTools_IndexedMapOfShape(), _map_faces_at_vertices(shape)
    TopExp.MapShapes_s(shape, TopAbs_FACE, faces)
    TopExp.MapShapes_s(shape, TopAbs_VERTEX, vertices)
    planes = [_find_plane(TopoDS.Face_s(faces.FindKey(n))) for n in range(1, faces.Extent() + 1)]
    if any(plane is None for plane in planes):
        return None
    normals = np.array([plane[0] for plane in planes if plane is not None])
    levels = np.array([plane[1] for plane in planes if plane is not None]) - radius
    old, new = [], []
    for n in range(1, vertices.Extent() + 1):
        at = sorted({faces.FindIndex(face) - 1 for face in around.FindFromKey(vertices.FindKey(n))})
        if len(at) != 3:
            return None
        old.append(BRep_Tool.Pnt_s(TopoDS.Vertex_s(vertices.FindKey(n))).Coord())
        new.append(np.linalg.solve(normals[at], levels[at]))
    return _grow(_list_loops(faces, vertices), np.array(old), np.array(new), normals, radius, edge_count)


def _grow(
    loops: list[list[int]], old: Array, new: Array, normals: Array, radius: float, edge_count: int
) -> float | None:
    """Return the volume of a polyhedron, given by a loop of vertices for each face, grown by a radius."""
    centre = new.mean(axis=0)
    volume = area = bend = 0.0
    sides: dict[tuple[int, int], list[int]] = {}
    for number, (loop, normal) in enumerate(zip(loops, normals, strict=True)):
        corners = new[loop]
        size = 0.5 * abs(
            float(np.cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0]).sum(0) @ normal)
        )
        area += size
        volume += size * float((corners[0] - centre) @ normal) / 3
        for a, b in zip(loop, loop[1:] + loop[:1], strict=True):
            sides.setdefault((min(a, b), max(a, b)), []).append(number)
            if float((new[b] - new[a]) @ (old[b] - old[a])) <= 0:
                return None
    if len(sides) != edge_count or any(len(pair) != 2 for pair in sides.values()):
        return None
    for (a, b), (one, other) in sides.items():
        cross = float(np.linalg.norm(np.cross(normals[one], normals[other])))
        angle = math.atan2(cross, float(normals[one] @ normals[other]))
        bend += float(np.linalg.norm(new[a] - new[b])) * angle
    return volume + radius * area + radius**2 * bend / 2 + 4 / 3 * math.pi * radius**3


def _map_faces_at_vertices(shape: TopoDS_Shape) -> TopTools_IndexedDataMapOfShapeListOfShape:
    found = TopTools_IndexedDataMapOfShapeListOfShape()
    TopExp.MapShapesAndUniqueAncestors_s(shape, TopAbs_VERTEX, TopAbs_FACE, found)
    return found


def _find_plane(face: TopoDS_Shape) -> tuple[Array, float] | None:
    """Return the outward normal of a plane face and its distance from the origin along it."""
    surface = BRep_Tool.Surface_s(face)
    if not isinstance(surface, Geom_Plane):
        return None
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    place = surface.Pln()
    normal = np.array(place.Axis().Direction().Coord()) * (1 if place.Direct() else -1)
    if face.Orientation() == TopAbs_REVERSED:
        normal = -normal
    return normal, float(normal @ np.array(surface.Value((u0 + u1) / 2, (v0 + v1) / 2).Coord()))


def _list_loops(faces: TopTools_IndexedMapOfShape, vertices: TopTools_IndexedMapOfShape) -> list[list[int]]:
    """Return the vertices around each face, of its outer wire."""
    loops = []
    for n in range(1, faces.Extent() + 1):
        face = TopoDS.Face_s(faces.FindKey(n))
        explorer, loop = BRepTools_WireExplorer(BRepTools.OuterWire_s(face), face), []
        while explorer.More():
            loop.append(vertices.FindIndex(explorer.CurrentVertex()) - 1)
            explorer.Next()
        loops.append(loop)
    return loops
