"""Which edge goes on in which, found anew by OCCT's first derivatives and brute force: nothing of cqblend is used."""

from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_REVERSED, TopAbs_VERTEX
from OCP.TopExp import TopExp, TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape

SMOOTH = 1e-3
"""rad."""

STRAIGHT = 1e-2
"""rad."""


def number_parts(shape: TopoDS_Shape, kind) -> TopTools_IndexedMapOfShape:
    numbers = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, kind, numbers)
    return numbers


def list_uses(shape: TopoDS_Shape, kind) -> list[TopoDS_Shape]:
    explorer, found = TopExp_Explorer(shape, kind), []
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


@dataclass
class EdgeEnd:
    """An end of an edge: its vertex, and the unit tangent there, away from the vertex."""

    vertex: int
    tangent: np.ndarray


class ChainWitness:
    """Kinds of all edges of a solid, and what continues them; edges, faces and vertices by their numbers."""

    def __init__(self, solid: TopoDS_Shape) -> None:
        edges, faces, vertices = (number_parts(solid, kind) for kind in (TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX))
        self.uses: dict[int, list[tuple[int, TopoDS_Face, TopoDS_Edge]]] = {}
        for face in map(TopoDS.Face_s, list_uses(solid, TopAbs_FACE)):
            for use in map(TopoDS.Edge_s, list_uses(face, TopAbs_EDGE)):
                if not BRep_Tool.Degenerated_s(use):
                    self.uses.setdefault(edges.FindIndex(use), []).append((faces.FindIndex(face), face, use))
        self.ends: dict[int, tuple[EdgeEnd, EdgeEnd]] = {}
        self.kinds: dict[int, str] = {}
        for number, uses in self.uses.items():
            edge = TopoDS.Edge_s(uses[0][2].Oriented(TopAbs_FORWARD))
            low, high = BRep_Tool.Range_s(edge)
            first, last = TopExp.FirstVertex_s(edge), TopExp.LastVertex_s(edge)
            self.ends[number] = (
                EdgeEnd(vertices.FindIndex(first), find_tangent(edge, low)),
                EdgeEnd(vertices.FindIndex(last), -find_tangent(edge, high)),
            )
            self.kinds[number] = classify(uses)

    def is_at(self, edge: int, vertex: int) -> bool:
        return any(end.vertex == vertex for end in self.ends[edge])

    def join_faces(self, vertex: int) -> dict[int, int]:
        """Return a label for each face at a vertex, equal for those that smooth edges there connect."""
        here = [number for number in self.uses if self.is_at(number, vertex)]
        labels = {face: face for number in here for face, _, _ in self.uses[number]}
        for number in here:
            if self.kinds[number] == "smooth":
                (one, _, _), (two, _, _) = self.uses[number]
                old, new = labels[one], labels[two]
                labels = {face: new if label == old else label for face, label in labels.items()}
        return labels

    def find_following(self, number: int, end: int) -> list[int]:
        """Return the edges that continue a sharp one past its end 0 or 1, in the sense of its curve."""
        here = self.ends[number][end]
        straight = [
            other
            for other, ends in self.ends.items()
            for k in (0, 1)
            if (other, k) != (number, end) and ends[k].vertex == here.vertex
            if np.linalg.norm(ends[k].tangent + here.tangent) < STRAIGHT and self.kinds[other] == self.kinds[number]
        ]
        if not straight or measure_angles(self.uses[number], [float(end)])[0] < SMOOTH:
            return []
        labels = self.join_faces(here.vertex)
        own = {labels[face] for face, _, _ in self.uses[number]}
        return [
            other for other in straight if len(own) == 2 and {labels[face] for face, _, _ in self.uses[other]} == own
        ]


def find_tangent(edge: TopoDS_Edge, parameter: float) -> np.ndarray:
    point, tangent = gp_Pnt(), gp_Vec()
    BRepAdaptor_Curve(edge).D1(parameter, point, tangent)
    return np.array(tangent.Coord()) / tangent.Magnitude()


def find_normal(face: TopoDS_Face, use: TopoDS_Edge, share: float) -> np.ndarray:
    curve = BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0)
    low, high = BRep_Tool.Range_s(use, face)
    uv = curve.Value(low + share * (high - low))
    point, su, sv = gp_Pnt(), gp_Vec(), gp_Vec()
    BRepAdaptor_Surface(face, False).D1(uv.X(), uv.Y(), point, su, sv)
    normal = np.cross(su.Coord(), sv.Coord())
    length = np.linalg.norm(normal)
    if length < 1e-9 * max(su.Magnitude(), sv.Magnitude()) ** 2:
        return np.full(3, np.nan)  # a pole
    return normal / length * (-1 if face.Orientation() == TopAbs_REVERSED else 1)


def measure_angles(uses, shares) -> np.ndarray:
    """Return the angles between the outward normals at shares of an edge's range."""
    (_, one, use), (_, two, other) = uses
    pairs = [(find_normal(one, use, share), find_normal(two, other, share)) for share in shares]
    return np.array([np.arctan2(np.linalg.norm(np.cross(n, m)), n @ m) for n, m in pairs])


def classify(uses) -> str:
    """Return "smooth", "convex", "concave", or "other" for seams, borders and edges of several kinds."""
    if len(uses) != 2 or uses[0][0] == uses[1][0]:
        return "other"
    angles = measure_angles(uses, np.linspace(0, 1, 15))
    if np.nanmax(angles) < SMOOTH:
        return "smooth"
    if np.nanmin(angles[1:-1]) < SMOOTH or np.nanmax(angles) > np.pi - SMOOTH:
        return "other"
    (_, one, use), (_, two, other) = uses
    low, high = BRep_Tool.Range_s(use)
    turns = []
    for share in (0.2, 0.5, 0.8):
        sense = find_tangent(use, low + share * (high - low)) * (-1 if use.Orientation() == TopAbs_REVERSED else 1)
        turns.append(np.cross(find_normal(one, use, share), find_normal(two, other, share)) @ sense > 0)
    return "other" if len(set(turns)) > 1 else "convex" if turns[0] else "concave"
