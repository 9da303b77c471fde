"""Whether a bridge stays outside of the bodies that it joins, and does not cross itself.

What has common vertices with a face is not compared with it by the checks of a rewritten solid. So a bridge is looked
at as a whole: points of its faces, away from the rails, are asked whether they are in or on the bodies, and a net of
triangles through them is searched for places where it passes through itself.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepTools import BRepTools
from OCP.gp import gp_Pnt
from OCP.TopAbs import TopAbs_FACE, TopAbs_OUT
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape

from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.topology import CONFUSION, ShapeIndex
from cqblend.brep.verification.face_boxes import FaceBoxes
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.splines.bernstein import Array


def find_point_inside(faces: Sequence[TopoDS_Face], bodies: Sequence[TopoDS_Shape]) -> Array | None:
    """Return a point (3,) of faces of a bridge, away from their rails, that is in or on one of the bodies; or None."""
    u, v = VERIFICATION_TOLERANCES.bridge_points
    shares = (np.arange(v) + 0.5) / v
    low, high = VERIFICATION_TOLERANCES.bridge_middle
    points = np.concatenate([_evaluate_net(face, np.arange(u) / u, low + (high - low) * shares) for face in faces])
    points = points.reshape(-1, 3)
    for body in bodies:
        classifier = BRepClass3d_SolidClassifier(body)
        for point in points.tolist():
            classifier.Perform(gp_Pnt(*point), CONFUSION)
            if classifier.State() != TopAbs_OUT:
                return np.array(point)
    return None


def find_touching_point(faces: Sequence[TopoDS_Face], bodies: Sequence[TopoDS_Shape]) -> Array | None:
    """Return a point (3,) in which faces of a bridge touch, or are in, other bodies; or None."""
    boxes = FaceBoxes(faces)
    for body in bodies:
        around = FaceBoxes([TopoDS.Face_s(face) for face in ShapeIndex(body, TopAbs_FACE)])
        low, high = around.low.min(axis=0), around.high.max(axis=0)
        for face, least, most in zip(faces, boxes.low, boxes.high, strict=True):
            if (least <= high).all() and (most >= low).all():
                nearest = BRepExtrema_DistShapeShape(face, body)
                if nearest.Value() <= CONFUSION:
                    return np.array(nearest.PointOnShape1(1).Coord())
    return None


def find_self_crossing(faces: Sequence[TopoDS_Face]) -> Array | None:
    """Return a point (3,) at which the faces of a bridge, one after the other around it, pass through themselves."""
    u, v = VERIFICATION_TOLERANCES.bridge_net
    rows = max(4, u // len(faces))
    nets = [_evaluate_net(face, np.arange(rows) / rows, np.arange(v + 1) / v) for face in faces]
    net = np.concatenate(nets)  # (n, v + 1, 3), closed around
    count = len(net)
    index = np.arange(count * (v + 1)).reshape(count, v + 1)
    following = np.roll(index, -1, axis=0)
    first = np.stack([index[:, :-1], following[:, :-1], following[:, 1:]], axis=-1).reshape(-1, 3)
    second = np.stack([index[:, :-1], following[:, 1:], index[:, 1:]], axis=-1).reshape(-1, 3)
    triangles = np.concatenate([first, second])
    across = np.stack([index[:, :-1], index[:, 1:]], axis=-1).reshape(-1, 2)
    along = np.stack([index, following], axis=-1).reshape(-1, 2)
    return _find_crossing(net.reshape(-1, 3), triangles, np.concatenate([across, along]), (count, v + 1))


def _evaluate_net(face: TopoDS_Face, s: Array, v: Array) -> Array:
    """Return points (n, m, 3) of a face of a bridge at shares of its parameters, the first of them along the rails."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    grid = np.meshgrid(u0 + s * (u1 - u0), v0 + v * (v1 - v0), indexing="ij")
    surface = SurfaceEvaluator(BRep_Tool.Surface_s(face))
    return np.asarray(surface(np.stack([one.ravel() for one in grid]), 0)[0].T.reshape(len(s), len(v), 3))


def _find_crossing(points: Array, triangles: Array, edges: Array, shape: tuple[int, int]) -> Array | None:
    """Return a point (3,) where an edge passes through a triangle of a net that it has no neighbour in; or None."""
    rows = points[triangles]
    low, high = rows.min(axis=1), rows.max(axis=1)
    places = np.stack(np.unravel_index(triangles, shape), axis=-1)  # (m, 3, 2)
    for part in np.array_split(edges, max(1, len(edges) // 64)):
        ends = points[part]
        least, most = ends.min(axis=1), ends.max(axis=1)
        near = (least[:, None] <= high[None]).all(axis=2) & (most[:, None] >= low[None]).all(axis=2)
        i, k = np.nonzero(near)
        apart = np.abs(np.stack(np.unravel_index(part[i], shape), axis=-1)[:, :, None] - places[k][:, None])
        apart[..., 0] = np.minimum(apart[..., 0], shape[0] - apart[..., 0])
        is_far = (apart.max(axis=-1) > 1).all(axis=(1, 2))
        i, k = i[is_far], k[is_far]
        if not len(i):
            continue
        start, way = ends[i, 0], ends[i, 1] - ends[i, 0]
        a, b, c = (rows[k, j] for j in range(3))
        matrix = np.stack([b - a, c - a, -way], axis=-1)
        determinant = np.linalg.det(matrix)
        regular = np.abs(determinant) > np.finfo(float).tiny
        i, k, matrix, offset = i[regular], k[regular], matrix[regular], (start - a)[regular]
        x, y, z = np.linalg.solve(matrix, offset[..., None])[..., 0].T
        hit = (x >= 0) & (y >= 0) & (x + y <= 1) & (z >= 0) & (z <= 1)
        if hit.any():
            first = int(hit.argmax())
            return np.asarray(start[regular][first] + z[first] * way[regular][first])
    return None
