"""What radius fits a chain of edges, and how much it takes or adds: estimates from the edges and their tangent planes.

Neither sees what cqblend does. The radius is to fit with certainty on bodies like those of `benchmarks.chain_bodies`:
with some room, offset curves in both faces do not fold or meet each other or other edges, no face bends into the ball,
and none bends away from it much more sharply than the ball. The change of volume is that of circular arcs between the
tangent planes, carried along the edge (Pappus): right to a share of R times the curvatures of the faces.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.TopAbs import TopAbs_FACE, TopAbs_REVERSED
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Shape

from benchmarks.real_edges import list_edges
from benchmarks.tangent_chains import Chain, EdgeLinks, find_end_vertices, measure_length
from benchmarks.touching_balls import Array, Body, Station, find_station, measure_largest_bend, trace_pcurve

ROOM = 0.8
"""Share of what would just fit that counts as fitting."""
AWAY = 2.0
"""Largest radius, in curvature radii of faces that bend away from the ball, which alone would allow any."""
STATIONS = 48
"""Stations of each edge."""
POINTS = 40
"""Points of each other edge."""


def estimate_largest_radius(body: Body, chain: Chain) -> float:
    """Return a radius, mm, with which a chain can be blended."""
    stations = [station for edge in chain.edges for station in _list_stations(body, edge)]
    points = np.array([station.point for station in stations])
    others = np.concatenate([_sample(edge) for edge in _list_other_edges(body, chain)])
    largest = math.inf
    for station in stations:
        slope = math.tan(station.angle / 2)  # radius over the width of a face that it takes
        width = float(np.linalg.norm(others - station.point, axis=1).min())
        for side in station.inward:
            width = min(width, _find_inscribed_radius(points, station.point, side))
        largest = min(largest, width * slope)
        to_centre = station.inward[0] / slope + station.sense * station.normals[0]
        largest = min(largest, _invert(float(to_centre @ station.curvature)))
    for edge in chain.edges:
        for station in _list_stations(body, edge):
            largest = min(largest, _invert(_find_largest_bend(body, edge, station)))
            largest = min(largest, AWAY * _invert(_find_largest_bend(body, edge, station, both=True)))
    if not chain.closed:
        largest = min(largest, 0.4 * sum(chain.measure_lengths()) * min(math.tan(one.angle / 2) for one in stations))
    return ROOM * largest


def estimate_volume_change(body: Body, chain: Chain, radius: float) -> tuple[float, float]:
    """Return by how much a blend changes the volume, and how far that may be off, mm^3."""
    change = doubt = 0.0
    for edge in chain.edges:
        stations, step = list(_list_stations(body, edge)), measure_length(edge) / STATIONS
        for station in stations:
            area, centroid = _measure_section(station.angle, radius)
            ahead = station.inward[0] + station.inward[1]
            moment = centroid * float(ahead @ station.curvature) / max(float(np.linalg.norm(ahead)), 1e-9)
            change += station.sense * area * (1 - moment) * step
            doubt += area * radius * _find_largest_bend(body, edge, station, both=True) * step
            width = radius / math.tan(station.angle / 2)
            doubt += 0.0 if chain.closed else area * width * 2 / (STATIONS * len(chain.edges))
    return change, 0.15 * abs(change) + 2 * doubt


def measure_mesh_volume(shape: TopoDS_Shape, deflection: float) -> tuple[float, float]:
    """Return volume and area of a mesh that is no farther from a shape than a deflection, mm^3 and mm^2.

    OCCT's own integrals are off by more than a blend changes, on splines of many spans.
    """
    meshed = BRepBuilderAPI_Copy(shape).Shape()
    BRepMesh_IncrementalMesh(meshed, deflection, False, 0.2)
    volume = area = 0.0
    explorer = TopExp_Explorer(meshed, TopAbs_FACE)
    while explorer.More():
        face, location = TopoDS.Face_s(explorer.Current()), TopLoc_Location()
        explorer.Next()
        mesh = BRep_Tool.Triangulation_s(face, location)
        points = np.array([mesh.Node(n).Transformed(location.Transformation()).Coord() for n in _count(mesh.NbNodes())])
        corners = points[np.array([mesh.Triangle(n).Get() for n in _count(mesh.NbTriangles())]) - 1]
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
        sense = -1 if face.Orientation() == TopAbs_REVERSED else 1
        volume += sense * float((corners[:, 0] * normals).sum()) / 3
        area += float(np.linalg.norm(normals, axis=1).sum())
    return volume, area


def _count(number: int) -> range:
    return range(1, number + 1)


def _measure_section(angle: float, radius: float) -> tuple[float, float]:
    """Return the area between two lines at an angle and an arc that touches both, and its centroid's distance."""
    half = angle / 2
    turn = math.pi / 2 - half  # half the arc
    apex = radius / math.sin(half)
    kite, sector = radius**2 / math.tan(half), radius**2 * turn
    of_kite = (apex + radius / math.tan(half) * math.cos(half)) / 3
    of_sector = apex - 2 * radius * math.sin(turn) / (3 * turn)
    return kite - sector, (kite * of_kite - sector * of_sector) / (kite - sector)


def _list_stations(body: Body, edge: TopoDS_Edge) -> Iterator[Station]:
    for share in ((np.arange(STATIONS) + 0.5) / STATIONS).tolist():
        station = find_station(body, edge, share)
        if station is not None:
            yield station


def _find_inscribed_radius(points: Array, point: Array, inward: Array) -> float:
    """Return the radius of the largest circle that leaves a point inwards and contains none of the others."""
    away = points - point
    ahead, squares = away @ inward, (away**2).sum(axis=1)
    before = (squares > 0) & (ahead > 1e-3 * np.sqrt(squares))
    return float((squares[before] / (2 * ahead[before])).min(initial=math.inf))


def _find_largest_bend(body: Body, edge: TopoDS_Edge, station: Station, *, both: bool = False) -> float:
    """Return the largest curvature of the faces at a station towards the ball, or with ``both`` any way, 1/mm."""
    largest = 0.0
    for face in body.find_faces_at(edge):
        pcurve, first, last = trace_pcurve(edge, face)
        u, v = pcurve.Value(first + station.share * (last - first)).Coord()
        for sense in (station.sense, -station.sense) if both else (station.sense,):
            largest = max(largest, measure_largest_bend(face, u, v, sense))
    return largest


def _invert(curvature: float) -> float:
    return 1 / curvature if curvature > 1e-9 else math.inf


def _list_other_edges(body: Body, chain: Chain) -> Iterator[TopoDS_Edge]:
    """Yield the edges at which a rail would have to stop: not those that the chain passes or at which it ends."""
    links = EdgeLinks(body)
    passed = [*chain.edges, *links.list_passed_edges(chain), *links.list_edges_at(find_end_vertices(chain))]
    for edge in list_edges(body.shape):
        seam = len(body.find_faces_at(edge)) < 2 or BRep_Tool.Degenerated_s(edge)
        if not seam and not any(edge.IsSame(other) for other in passed):
            yield edge


def _sample(edge: TopoDS_Edge) -> Array:
    curve = BRepAdaptor_Curve(edge)
    at: Sequence[float] = np.linspace(curve.FirstParameter(), curve.LastParameter(), POINTS).tolist()
    return np.array([curve.Value(t).Coord() for t in at])
