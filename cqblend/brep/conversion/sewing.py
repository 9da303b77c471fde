"""Sew faces that touch without sharing edges.

Exists because lists of faces, and files such as IGES, have every common border twice: unrolled as they are, such faces
would not know of each other. Depends on topology only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex, BRepBuilderAPI_Sewing
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face

from cqblend.brep.topology import ShapeIndex, explore_subshapes, make_compound
from cqblend.errors import PatternWarning, warn
from cqblend.splines.bernstein import Array

_BORDER_SAMPLE_SHARES = (np.arange(9) + 0.5) / 9
"""Parts of a border's range at which its distance from another one is measured."""


def sew_faces(faces: Mapping[int, TopoDS_Face], tolerance: float) -> dict[int, TopoDS_Face]:
    """Return the faces, with common edges where they touch.

    Parameters
    ----------
    faces
        By number, which they keep.
    tolerance
        How far borders may be apart to count as one, mm.

    Warns
    -----
    PatternWarning
        Borders coincide and could not be joined, as where three faces meet; the message says how many.
    """
    if not _count_coinciding_borders(list(faces.values()), tolerance):
        return dict(faces)
    sewing = BRepBuilderAPI_Sewing(tolerance)
    for face in faces.values():
        sewing.Add(face)
    sewing.Perform()
    result = {}
    for number, face in faces.items():
        found = next(explore_subshapes(sewing.Modified(face), TopAbs_FACE), face)
        result[number] = TopoDS.Face_s(found.Oriented(face.Orientation()))
    left = _count_coinciding_borders(list(result.values()), tolerance)
    if left:
        warn(
            PatternWarning(
                f"{left} borders of faces run along other faces and could not be joined: there is no seam where they "
                "do; make the faces one shell first"
            )
        )
    return result


def _count_coinciding_borders(faces: Sequence[TopoDS_Face], tolerance: float) -> int:
    """Count the free borders that run along an edge of another face."""
    edges = _find_edge_owners(faces)
    free = [i for i, (_, owners) in enumerate(edges) if len(owners) == 1]
    if len(faces) < 2 or not free:
        return 0
    points = np.array([_sample_edge(edge) for edge, _ in edges])
    reach = tolerance + np.ptp(points, axis=1).max(axis=1) / 8  # between two places, and to the ends
    low, high = points.min(axis=1) - reach[:, None], points.max(axis=1) + reach[:, None]
    count = 0
    for i in free:
        near = ((low[i] <= high) & (low <= high[i])).all(axis=1)
        others = [j for j in np.flatnonzero(near).tolist() if not edges[i][1] & edges[j][1]]
        count += any(
            _is_along_edge(points[one], edges[other][0], (low[other], high[other]), tolerance)
            for j in others
            for one, other in ((i, j), (j, i))
        )
    return count


def _find_edge_owners(faces: Sequence[TopoDS_Face]) -> list[tuple[TopoDS_Edge, set[int]]]:
    """Return the edges of faces with the indices of the faces that use each, without seams and degenerate edges."""
    index = ShapeIndex(make_compound(faces), TopAbs_EDGE)
    uses: dict[int, list[int]] = {}
    for number, face in enumerate(faces):
        for edge in explore_subshapes(face, TopAbs_EDGE):
            uses.setdefault(index.find_number(edge), []).append(number)
    found = ((TopoDS.Edge_s(index[number]), owners) for number, owners in uses.items())
    return [
        (edge, set(owners))
        for edge, owners in found
        if len(set(owners)) == len(owners) and not BRep_Tool.Degenerated_s(edge)
    ]


def _sample_edge(edge: TopoDS_Edge) -> Array:
    curve = BRepAdaptor_Curve(edge)
    start, stop = curve.FirstParameter(), curve.LastParameter()
    return np.array([curve.Value(start + part * (stop - start)).Coord() for part in _BORDER_SAMPLE_SHARES])


def _is_along_edge(points: Array, edge: TopoDS_Edge, box: tuple[Array, Array], tolerance: float) -> bool:
    """Whether two neighbouring points (of n, 3) lie on an edge; ``box`` is its bounding box, enlarged."""
    inside: Array = np.all((points >= box[0]) & (points <= box[1]), axis=1)
    if not (inside[:-1] & inside[1:]).any():
        return False
    near = [
        bool(here) and _measure_distance(point, edge) <= tolerance for point, here in zip(points, inside, strict=True)
    ]
    return any(one and other for one, other in pairwise(near))


def _measure_distance(point: Array, edge: TopoDS_Edge) -> float:
    return float(BRepExtrema_DistShapeShape(BRepBuilderAPI_MakeVertex(gp_Pnt(*point)).Vertex(), edge).Value())
