"""What a blended body is worth, judged by OCCT's evaluation and NumPy alone: complete, incomplete or unsound.

A blend is *complete* if nothing is left of its edge nor of the chain of edges into which it goes on, all along them:
the body's surface has moved off, inwards at a convex edge and outwards at a concave one. It is *unsound* if the body is
less valid than it was, or a joint that is to be smooth is not: the rails, the joints between two blend faces, and
seams. The other edges of blend faces are ends, and may be sharp; a closed chain has none, an open one only near its two
ends.

Normals are those of OCCT's first derivatives, taken on both faces at the parameters of their common edge. Where the
faces at the edge have smooth edges that are themselves not quite smooth, a blend may be as far off where it goes on
past them, and no further.

Nothing here knows cqblend.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_IN, TopAbs_ON, TopAbs_OUT, TopAbs_SOLID
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape

from benchmarks.real_edges import list_edges
from benchmarks.tangent_chains import Chain, EdgeLinks, find_end_vertices, measure_length
from benchmarks.touching_balls import Array, Body, Face, Station, find_station, measure_angles

POINTS = 41
"""Points of a joint at which it is measured."""
STATIONS = 9
"""Places of an edge at which nothing of it may be left."""
SHARP = 0.1
"""Angle from which on a joint counts as an end, rad."""
FADED = 1e-6
"""Share of the largest |S_u x S_v| along an edge below which a face has no normal: it ends in a point there."""
FAR_END = 6.0
"""Distance from the end of a chain within which there may be sharp edges of its blend, in widths."""
LEAST_DEPTH = 0.02
"""Share of the distance from edge to ball, or to the end of the edge, by which the surface must have moved off."""


@dataclass(frozen=True)
class Limits:
    """How far joints may be off: gap, mm, and angle, rad. A gap of None allows what the edge's tolerance says."""

    gap: float | None = None
    angle: float = 1e-8


@dataclass(frozen=True)
class Score:
    """What is wrong with a blend, what is left of the edges, and the largest gap and angle of its smooth joints."""

    unsound: tuple[str, ...]
    missing: tuple[str, ...]
    gap: float
    angle: float

    @property
    def verdict(self) -> str:
        """``"unsound"``, ``"incomplete"`` or ``"complete"``."""
        return "unsound" if self.unsound else "incomplete" if self.missing else "complete"

    @property
    def message(self) -> str:
        """All that is wrong, in words."""
        return "; ".join((*self.unsound, *self.missing))


@dataclass(frozen=True)
class Blended:
    """A body before and after its edges were blended with a radius, and the blend faces in it."""

    before: TopoDS_Shape
    edges: Sequence[TopoDS_Edge]
    radius: float
    after: TopoDS_Shape
    faces: Sequence[TopoDS_Face]


def score_blend(blended: Blended, limits: Limits, *, chain: bool = True) -> Score:
    """Judge a blend of some edges, and with ``chain`` of all edges into which they go on."""
    body = Body(blended.before)
    chains = _follow_chains(body, blended.edges) if chain else [Chain((edge,), False) for edge in blended.edges]
    joints = list(measure_joints(blended))
    smooth = [joint for joint in joints if joint.kind != "end"]
    unsound = [*check_validity(blended), *_check_joints(body, blended, chains, joints, limits)]
    missing = [problem for row in chains for edge in row.edges for problem in check_removal(body, blended, edge)]
    gap = max((joint.gap for joint in smooth), default=math.nan)
    angle = max((joint.angle for joint in smooth), default=math.nan)
    return Score(tuple(unsound), tuple(missing), gap, angle)


def _follow_chains(body: Body, edges: Sequence[TopoDS_Edge]) -> list[Chain]:
    links, found = EdgeLinks(body), []
    for edge in edges:
        if not any(edge.IsSame(other) for row in found for other in row.edges):
            found.append(links.follow_chain(edge))
    return found


# -- validity


def check_validity(blended: Blended) -> Iterator[str]:
    """Yield what makes the new body less valid than the old one."""
    if not blended.faces:
        yield "there is no blend face"
    if BRepCheck_Analyzer(blended.before).IsValid() and not BRepCheck_Analyzer(blended.after).IsValid():
        yield "the body is not valid any more"
    before, after = (map_parts(shape, TopAbs_FACE) for shape in (blended.before, blended.after))
    if any(not after.Contains(face) for face in blended.faces):
        yield "a blend face is not in the body"
    flawed = [
        sum(not BRepCheck_Analyzer(faces.FindKey(n), True, False, True).IsValid() for n in numbers)
        for faces, numbers in ((before, _list_missing(before, after)), (after, _list_missing(after, before)))
    ]
    if flawed[1] > flawed[0]:
        yield f"{flawed[1]} new faces fail BRepCheck's exact mode, of those before {flawed[0]}"


def _list_missing(parts: TopTools_IndexedMapOfShape, others: TopTools_IndexedMapOfShape) -> list[int]:
    return [n for n in range(1, parts.Extent() + 1) if not others.Contains(parts.FindKey(n))]


def map_parts(shape: TopoDS_Shape, kind: object) -> TopTools_IndexedMapOfShape:
    """Return the faces, edges or vertices of a shape."""
    found = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, kind, found)
    return found


# -- joints


@dataclass(frozen=True)
class Joint:
    """An edge of blend faces: a "rail", a joint "between" two blend faces, a "seam" or an "end".

    ``angle`` is the largest angle between the normals along it, ``middle`` their median.
    """

    kind: str
    gap: float
    angle: float
    middle: float
    tolerance: float
    points: Array


def measure_joints(blended: Blended) -> Iterator[Joint]:
    """Yield all edges of the blend faces, each once, as they are measured."""
    after = Body(blended.after)
    made = map_parts(blended.after, TopAbs_FACE)
    numbers = {made.FindIndex(face) for face in blended.faces}
    seen = TopTools_IndexedMapOfShape()
    for face in blended.faces:
        explorer = TopExp_Explorer(face, TopAbs_EDGE)
        while explorer.More():
            edge = TopoDS.Edge_s(explorer.Current())
            explorer.Next()
            if not BRep_Tool.Degenerated_s(edge) and not seen.Contains(edge):
                seen.Add(edge)
                yield _measure_joint(edge, after.find_faces_at(edge), numbers)


def _measure_joint(edge: TopoDS_Edge, faces: Sequence[Face], blend_numbers: set[int]) -> Joint:
    curve = BRepAdaptor_Curve(edge)
    first, last = curve.FirstParameter(), curve.LastParameter()
    at = np.concatenate([[0.0], (np.arange(POINTS) + 0.37) / POINTS, [1.0]])
    parameters = (first + (last - first) * at).tolist()
    points = np.array([curve.Value(t).Coord() for t in parameters])
    uses = _list_uses(edge, faces)
    sides = [_trace(use, face, parameters) for use, face in uses]
    tolerance = BRep_Tool.Tolerance_s(edge)
    if len(sides) != 2:
        return Joint("end", math.nan, math.nan, math.nan, tolerance, points)  # the border of an open shell
    (p, n), (q, m) = sides
    gap = max(float(np.linalg.norm(a - b, axis=1).max()) for a, b in ((p, points), (q, points), (p, q)))
    angles = np.arctan2(np.linalg.norm(np.cross(n, m), axis=1), (n * m).sum(1))
    angle, middle = float(np.nanmax(angles, initial=0.0)), float(np.nanmedian(angles))
    if len(faces) == 1:
        kind = "seam"
    elif all(face.number in blend_numbers for face in faces):
        kind = "between"
    else:
        kind = "rail" if middle < SHARP else "end"
    return Joint(kind, gap, angle, middle, tolerance, points)


def _list_uses(edge: TopoDS_Edge, faces: Sequence[Face]) -> list[tuple[TopoDS_Edge, Face]]:
    """Return how faces use an edge: twice each, if it is a seam."""
    found = []
    for face in faces:
        explorer = TopExp_Explorer(face.shape, TopAbs_EDGE)
        while explorer.More():
            if explorer.Current().IsSame(edge):
                found.append((TopoDS.Edge_s(explorer.Current()), face))
            explorer.Next()
    return found


def _trace(edge: TopoDS_Edge, face: Face, parameters: Sequence[float]) -> tuple[Array, Array]:
    """Return points and outward normals of a face along one of its edges; NaN where the face fades into a point."""
    first, last = BRep_Tool.Range_s(edge)
    pcurve = BRep_Tool.CurveOnSurface_s(edge, face.shape, first, last)
    jets = np.array([face.evaluate(*pcurve.Value(t).Coord())[:3] for t in parameters])
    cross = face.sign * np.cross(jets[:, 1], jets[:, 2])
    lengths = np.linalg.norm(cross, axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        return jets[:, 0], np.where(lengths > FADED * lengths.max(), cross / lengths, np.nan)


def _check_joints(
    body: Body, blended: Blended, chains: Sequence[Chain], joints: Sequence[Joint], limits: Limits
) -> Iterator[str]:
    allowed = limits.angle + max((_measure_roughness(body, edge) for row in chains for edge in row.edges), default=0.0)
    for joint in joints:
        if joint.kind == "end":
            if joint.gap > joint.tolerance:
                yield f"an end has a gap of {joint.gap:.2g} mm, above its tolerance"
            continue
        if not joint.angle <= allowed:
            yield f"a joint ({joint.kind}) has an angle of {joint.angle:.2g} rad"
        most = joint.tolerance if limits.gap is None else limits.gap
        if not joint.gap <= most:
            yield f"a joint ({joint.kind}) has a gap of {joint.gap:.2g} mm"
    yield from _check_ends(body, blended, chains, joints)


def _check_ends(body: Body, blended: Blended, chains: Sequence[Chain], joints: Sequence[Joint]) -> Iterator[str]:
    """Yield what is wrong with sharp edges of the blend: they lie near the ends of open chains."""
    ends, reach = [], 0.0
    for row in chains:
        stations = [find_station(body, edge, 0.5) for edge in row.edges]
        widths = [blended.radius / math.tan(one.angle / 2) for one in stations if one is not None]
        reach = max(reach, FAR_END * max(*widths, blended.radius))
        ends += [np.array(BRep_Tool.Pnt_s(vertex).Coord()) for vertex in find_end_vertices(row)]
    for joint in joints:
        if joint.kind == "end":
            middle = joint.points[len(joint.points) // 2]
            near = min((float(np.linalg.norm(middle - end)) for end in ends), default=math.inf)
            if near > reach:
                yield f"a sharp edge of the blend is {near:.3g} mm from every end of a chain"


def _measure_roughness(body: Body, edge: TopoDS_Edge) -> float:
    """Return the largest angle of the smooth edges around the faces at an edge, past which its blend may go on, rad."""
    angles = [0.0]
    for face in body.find_faces_at(edge):
        for other in list_edges(face.shape):
            faces = body.find_faces_at(other)
            if len(faces) == 2 and not BRep_Tool.Degenerated_s(other):
                angles.append(float(np.nanmax(measure_angles(other, *faces), initial=0.0)))
    return max(angle for angle in angles if angle < SHARP)


# -- what is left of the edges


def check_removal(body: Body, blended: Blended, edge: TopoDS_Edge, clear: float = 0.0) -> Iterator[str]:
    """Yield where something of an edge of the old body is left.

    Up to a distance in mm from its ends nobody looks: where convex and concave edges meet, the new surface crosses
    them.
    """
    number = body.find_number(edge)
    if map_parts(blended.after, TopAbs_EDGE).Contains(edge):
        yield f"edge {number} is still there"
        return
    length = measure_length(edge)
    for share in ((np.arange(STATIONS) + 0.5) / STATIONS).tolist():
        station, to_end = find_station(body, edge, share), length * min(share, 1 - share)
        if station is not None and to_end > clear and not _has_moved_off(blended, station, to_end):
            yield f"edge {number} is left at t = {share:.3f}"
            return


def _has_moved_off(blended: Blended, station: Station, to_end: float) -> bool:
    """Whether the surface of the new body is off a point of an edge, on the side where it should be.

    Near an end, at a distance in mm, the face that the blend ends on may pass the point more closely than the blend.
    """
    off = blended.radius * (1 / math.sin(station.angle / 2) - 1)
    depth = max(LEAST_DEPTH * min(off, to_end), 1e-7)
    point = gp_Pnt(*station.point.tolist())
    states = []
    solids = TopExp_Explorer(blended.after, TopAbs_SOLID)
    while solids.More():
        classifier = BRepClass3d_SolidClassifier(solids.Current())
        classifier.Perform(point, depth)
        states.append(classifier.State())
        solids.Next()
    wanted = TopAbs_OUT if station.convex else TopAbs_IN
    if states and (all if station.convex else any)(state == wanted for state in states):
        return True
    if states and TopAbs_ON not in states:
        return False
    # open shells have no inside, and OCCT's classifier says "on" too often: distances tell
    vertex = BRepBuilderAPI_MakeVertex(point).Vertex()
    faces = [face.shape for face in Body(blended.after).faces]
    return min(BRepExtrema_DistShapeShape(vertex, face).Value() for face in faces) > depth
