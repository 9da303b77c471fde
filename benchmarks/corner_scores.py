"""What a body is worth of which many edges were blended at once, corners and all, by OCCT's evaluation and NumPy alone.

Nothing may be left of a picked edge. A sharp edge of the new body is either what is left of one that was not picked, or
lies at a vertex where picked edges meet others, as a mitre or an end: where all edges are picked, nothing is sharp any
more. All else is smooth, within limits. Faces that are not told to be blend faces lie on the old body; blend faces are
nowhere farther from it than a radius, and where all edges are convex they are inside. The volume changes as expected.

Nothing here knows cqblend.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import cadquery as cq
import numpy as np
from OCP.BOPAlgo import BOPAlgo_ArgumentAnalyzer
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp
from OCP.gp import gp_Pnt
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_OUT, TopAbs_SHELL, TopAbs_VERTEX
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Shape

from benchmarks.blend_scores import (
    SHARP,
    Blended,
    Joint,
    Limits,
    Score,
    check_removal,
    check_validity,
    map_parts,
    measure_joints,
)
from benchmarks.corner_volumes import Volume
from benchmarks.real_edges import list_edges
from benchmarks.touching_balls import Array, Body, Face, find_station, measure_angles

ON = 1e-6
"""Distance within which a point is on a face or an edge, mm."""
GRID = 4
"""Points each way of a face at which it is compared with the old body."""
REACH = 6.0
"""Distance from a vertex within which there may be sharp edges of blends that end there, in radii."""
CLEAR = 2.0
"""Distance from a vertex within which something of an edge may be left, in radii."""
SAME_VOLUME = 1e-7
"""Share of the volume by which a body may differ after a STEP file."""


@dataclass(frozen=True)
class CornerScore(Score):
    """A score with the volume, mm^3, and the numbers of faces and of sharp edges of the new body."""

    volume: float = math.nan
    faces: int = 0
    sharp: int = 0


def score_corners(blended: Blended, limits: Limits, expected: Volume | None = None) -> CornerScore:
    """Judge a blend of just the given edges; its faces are all that is new."""
    old = OldBody(blended.before, blended.edges)
    joints = list(_measure_new_joints(blended))
    unsound = [
        *check_validity(blended),
        *_check_exactness(blended.after),
        *_check_smoothness(old, joints, limits),
        *_check_places(old, blended),
        *check_step(blended.after),
        *_check_volume(blended.after, expected),
    ]
    clear = CLEAR * blended.radius
    missing = [problem for edge in blended.edges for problem in check_removal(old.body, blended, edge, clear)]
    missing += _check_sharp_edges(old, joints, blended.radius)
    smooth = [joint for joint in joints if joint.middle < SHARP]
    return CornerScore(
        tuple(unsound),
        tuple(missing),
        max((joint.gap for joint in smooth), default=math.nan),
        max((joint.angle for joint in smooth), default=math.nan),
        measure_volume(blended.after),
        len(Body(blended.after).faces),
        len(joints) - len(smooth),
    )


def score_fillet(blended: Blended, expected: Volume | None = None) -> CornerScore:
    """Judge a fillet of OCCT's, which does not tell its faces: validity, volume, and how many edges are sharp."""
    joints = list(_measure_new_joints(blended))
    unsound = [*_check_exactness(blended.after), *_check_volume(blended.after, expected)]
    if not BRepCheck_Analyzer(blended.after).IsValid():
        unsound.append("the body is not valid")
    smooth = [joint for joint in joints if joint.middle < SHARP]
    return CornerScore(
        tuple(unsound),
        tuple(_check_sharp_edges(OldBody(blended.before, blended.edges), joints, blended.radius)),
        max((joint.gap for joint in smooth), default=math.nan),
        max((joint.angle for joint in smooth), default=math.nan),
        measure_volume(blended.after),
        len(Body(blended.after).faces),
        len(joints) - len(smooth),
    )


def measure_volume(shape: TopoDS_Shape) -> float:
    """Return the volume of a body, by OCCT's adaptive integrals, mm^3."""
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, 1e-9, True, False)
    return float(properties.Mass())


@dataclass(frozen=True, eq=False)
class OldBody:
    """A body before its picked edges were blended."""

    shape: TopoDS_Shape
    picked: Sequence[TopoDS_Edge]

    @cached_property
    def body(self) -> Body:
        """The body with its faces."""
        return Body(self.shape)

    @cached_property
    def edge_angles(self) -> list[tuple[TopoDS_Edge, float, float]]:
        """Of each edge between two faces the median and the largest angle of their normals."""
        found = []
        for edge in list_edges(self.shape):
            faces = self.body.find_faces_at(edge)
            if len(faces) == 2 and not BRep_Tool.Degenerated_s(edge):
                angles = measure_angles(edge, *faces)
                found.append((edge, float(np.nanmedian(angles)), float(np.nanmax(angles, initial=0.0))))
        return found

    @cached_property
    def left_sharp(self) -> list[TopoDS_Edge]:
        """The sharp edges that were not picked."""
        return [e for e, middle, _ in self.edge_angles if middle >= SHARP and not self._is_picked(e)]

    @cached_property
    def open_vertices(self) -> list[Array]:
        """Where picked edges meet sharp ones that are not, or end alone."""
        picked, others = (_count_vertices(edges) for edges in (self.picked, self.left_sharp))
        ends = [key for key, count in picked.items() if key in others or count == 1]
        return [np.array(key) for key in ends]

    @cached_property
    def roughness(self) -> float:
        """The largest angle of a smooth edge, rad."""
        return max((largest for _, middle, largest in self.edge_angles if middle < SHARP), default=0.0)

    @cached_property
    def boundary(self) -> TopoDS_Shape:
        """The boundary of the body."""
        shells = map_parts(self.shape, TopAbs_SHELL)
        return shells.FindKey(1) if shells.Extent() == 1 else self.shape

    @cached_property
    def is_convex(self) -> bool:
        """Whether all picked edges are convex, and no face is curved inwards: so it seems from edges between planes."""
        planes = all(cq.Face(face.shape).geomType() == "PLANE" for face in self.body.faces)
        return planes and all(_is_convex(self.body, edge) for edge, middle, _ in self.edge_angles if middle >= SHARP)

    def _is_picked(self, edge: TopoDS_Edge) -> bool:
        return any(edge.IsSame(other) for other in self.picked)


def _count_vertices(edges: Sequence[TopoDS_Edge]) -> dict[tuple[float, ...], int]:
    counts: dict[tuple[float, ...], int] = {}
    for edge in edges:
        vertices = map_parts(edge, TopAbs_VERTEX)
        for n in range(1, vertices.Extent() + 1):
            point = BRep_Tool.Pnt_s(TopoDS.Vertex_s(vertices.FindKey(n))).Coord()
            key = tuple(round(x, 5) + 0.0 for x in point)
            counts[key] = counts.get(key, 0) + (2 if vertices.Extent() == 1 else 1)
    return counts


def _is_convex(body: Body, edge: TopoDS_Edge) -> bool:
    station = find_station(body, edge, 0.5)
    return station is not None and station.convex


def _measure_new_joints(blended: Blended) -> Iterator[Joint]:
    """Yield all edges of the new body that the old one has not."""
    faces = [face.shape for face in Body(blended.after).faces]
    known = map_parts(blended.before, TopAbs_EDGE)
    edges = list_edges(blended.after)
    if not any(known.Contains(edge) for edge in edges):
        yield from measure_joints(replace(blended, faces=faces))
        return
    touched = [face for face in faces if any(not known.Contains(edge) for edge in list_edges(face))]
    yield from measure_joints(replace(blended, faces=touched))


def _check_exactness(after: TopoDS_Shape) -> Iterator[str]:
    if not BRepCheck_Analyzer(after, True, False, True).IsValid():
        yield "BRepCheck's exact mode finds faults"
    faces_at = Body(after)
    free = [e for e in list_edges(after) if not faces_at.find_faces_at(e)]
    if free:
        yield f"{len(free)} edges have no face"


def _check_smoothness(old: OldBody, joints: Sequence[Joint], limits: Limits) -> Iterator[str]:
    allowed = limits.angle + old.roughness
    for joint in joints:
        if joint.middle < SHARP:
            if not joint.angle <= allowed:
                yield f"a smooth edge at {_describe(joint)} has an angle of {joint.angle:.2g} rad"
            most = joint.tolerance if limits.gap is None else limits.gap
            if not joint.gap <= most:
                yield f"an edge at {_describe(joint)} has a gap of {joint.gap:.2g} mm"
        elif not joint.gap <= max(joint.tolerance, ON):
            yield f"a sharp edge at {_describe(joint)} has a gap of {joint.gap:.2g} mm"


def _check_sharp_edges(old: OldBody, joints: Sequence[Joint], radius: float) -> Iterator[str]:
    """Yield sharp edges that are neither left of old ones nor near a vertex at which blends end or are mitred."""
    for joint in joints:
        if joint.middle < SHARP:
            continue
        middle = joint.points[len(joint.points) // 2]
        near = min((float(np.linalg.norm(middle - end)) for end in old.open_vertices), default=math.inf)
        if near > REACH * radius and not any(_measure_distance(middle, edge) < ON for edge in old.left_sharp):
            yield f"there is a sharp edge at {_describe(joint)}, of {joint.middle:.2g} rad"


def _check_places(old: OldBody, blended: Blended) -> Iterator[str]:
    """Yield faces of the new body that are not where they can be."""
    faces = Body(blended.after).faces
    told = map_parts(blended.after, TopAbs_FACE)
    numbers = {told.FindIndex(face) for face in blended.faces}
    known = map_parts(blended.before, TopAbs_FACE)
    inside = BRepClass3d_SolidClassifier(old.shape) if old.is_convex else None
    for face in faces:
        if known.Contains(face.shape):
            continue
        points = _sample(face)
        away = max((_measure_distance(point, old.boundary) for point in points), default=0.0)
        if face.number not in numbers:
            if away > max(ON, 2 * BRep_Tool.Tolerance_s(face.shape)):
                yield f"face {face.number} is not a blend face, and {away:.2g} mm off the old body"
        elif away > blended.radius * (1 + 1e-6):
            yield f"blend face {face.number} is {away:.3g} mm off the old body"
        elif inside is not None and any(_is_outside(inside, point) for point in points):
            yield f"blend face {face.number} is outside of the old body"


def _sample(face: Face) -> list[Array]:
    u0, u1, v0, v1 = face.bounds
    at = (np.arange(GRID) + 0.5) / GRID
    places = [np.array([u0 + (u1 - u0) * s, v0 + (v1 - v0) * t]) for s in at for t in at]
    return [face.evaluate(*place)[0] for place in places if face.contains(place)]


def _is_outside(classifier: BRepClass3d_SolidClassifier, point: Array) -> bool:
    classifier.Perform(gp_Pnt(*point.tolist()), ON)
    return bool(classifier.State() == TopAbs_OUT)


def _measure_distance(point: Array, shape: TopoDS_Shape) -> float:
    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point.tolist())).Vertex()
    return float(BRepExtrema_DistShapeShape(vertex, shape).Value())


def check_step(shape: TopoDS_Shape) -> Iterator[str]:
    """Yield what is wrong with a body once it was written to a STEP file and read again."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "made.step"
        cq.exporters.export(cq.Workplane(cq.Shape.cast(shape)), str(path))
        read = cq.importers.importStep(str(path)).vals()
    if len(read) != 1 or not read[0].isValid():
        yield "what is read from a STEP file is not valid"
        return
    volumes = measure_volume(read[0].wrapped), measure_volume(shape)
    if abs(volumes[0] - volumes[1]) > SAME_VOLUME * abs(volumes[1]):
        yield f"the volume is {volumes[0]:.9g} mm^3 once read from a STEP file, and was {volumes[1]:.9g}"


def _check_volume(after: TopoDS_Shape, expected: Volume | None) -> Iterator[str]:
    if expected is not None:
        volume = measure_volume(after)
        if not abs(volume - expected.value) <= expected.doubt:
            yield f"the volume is {volume:.9g} mm^3, expected were {expected.value:.9g} +- {expected.doubt:.2g}"


def check_crossings(shape: TopoDS_Shape) -> Iterator[str]:
    """Yield whether faces of a body cross each other, by OCCT's Boolean operations; slow."""
    analyzer = BOPAlgo_ArgumentAnalyzer()
    analyzer.SetShape1(shape)
    analyzer.ArgumentTypeMode = True
    analyzer.SelfInterMode = True
    analyzer.Perform()
    if analyzer.HasFaulty():
        yield "OCCT's Boolean operations find that the body crosses itself"


def _describe(joint: Joint) -> str:
    middle = joint.points[len(joint.points) // 2]
    return "(" + ", ".join(f"{x:.4g}" for x in middle) + ")"
