"""A solid, or a shell, cut in two with a box: whether boolean operations work on its faces."""

import math
from dataclasses import dataclass

import numpy as np
from OCP.BRepAlgoAPI import BRepAlgoAPI_Common, BRepAlgoAPI_Cut
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox
from OCP.BRepTools import BRepTools
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt
from OCP.Standard import Standard_Failure
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from cqblend.brep.measurement.surface_evaluation import evaluate_face_normals
from cqblend.brep.verification.brep_check import is_valid
from cqblend.brep.verification.content import Content
from cqblend.brep.verification.volumes import compute_bounds
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class BoxCheck:
    """The solid minus and common with a box through the middle of the faces.

    ``cut`` and ``common`` are volumes in mm^3, ``mismatch`` is |cut + common - volume| / volume, ``valid`` says
    whether BRepCheck accepts both. The volumes of shells that bound no solid are those between them and some plane.
    """

    valid: bool
    cut: float
    common: float
    mismatch: float


def check_box(shape: TopoDS_Shape, faces: list[TopoDS_Face], content: Content) -> tuple[BoxCheck | None, list[str]]:
    """Cut a body in two with a box, one side of which runs through the middle of one of the faces.

    ``content`` is that of the body. Returns the volumes of both parts, None if OCCT fails, and one line for everything
    that is wrong.
    """
    box = _make_splitting_box(shape, faces)
    try:
        parts = [operation(shape, box) for operation in (BRepAlgoAPI_Cut, BRepAlgoAPI_Common)]
        if not all(part.IsDone() for part in parts):
            return None, ["OCCT cannot cut the body with a box"]
    except Standard_Failure as failure:
        return None, [f"OCCT cannot cut the body with a box: {failure}"]
    valid = all(is_valid(part.Shape()) for part in parts)
    (cut, cut_error), (common, common_error) = (content.measure(part.Shape()) for part in parts)
    slack = cut_error + common_error
    if content.differs(cut + common, slack):
        slack += sum(
            content.estimate_error(part.Shape(), found) for part, found in zip(parts, (cut, common), strict=True)
        )
    check = BoxCheck(valid, cut, common, content.measure_mismatch(cut + common))
    lines = [] if valid else ["cut or common with a box is not valid"]
    if content.is_nothing(cut) or content.is_nothing(common) or content.differs(cut + common, slack):
        sizes = f"{cut:.9g} + {common:.9g} against {content.whole:.9g} mm^3"
        lines.append(f"cut and common with a box do not add up: {sizes}")
    return check, lines


def _make_splitting_box(shape: TopoDS_Shape, faces: list[TopoDS_Face]) -> TopoDS_Shape:
    """Make a large box with one side through the middle of the middlemost face, at odd angles to it."""
    middles = [_evaluate_face_middle(face) for face in faces]
    points = np.array([point for point, _ in middles])
    nearest = int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmin())
    point, normal = middles[nearest]
    frame = gp_Ax2(gp_Pnt(*point.tolist()), gp_Dir(*normal.tolist()))
    x, y = (np.array(axis.Coord()) for axis in (frame.XDirection(), frame.YDirection()))
    out = math.cos(0.6) * x + math.sin(0.6) * y + 0.2 * normal
    along = y * math.cos(0.6) - x * math.sin(0.6)
    low, high = compute_bounds(shape)
    size = 4.0 * float(np.linalg.norm(high - low))
    out /= np.linalg.norm(out)
    corner = point - 0.5 * size * (along + np.cross(out, along))
    placed = gp_Ax2(gp_Pnt(*corner.tolist()), gp_Dir(*out.tolist()), gp_Dir(*along.tolist()))
    return BRepPrimAPI_MakeBox(placed, size, size, size).Shape()


def _evaluate_face_middle(face: TopoDS_Face) -> tuple[Array, Array]:
    """Return the point in the middle of a face's parameters, and a normal there."""
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    points, normals = evaluate_face_normals(face, np.array([[(u0 + u1) / 2, (v0 + v1) / 2]]))
    return points[0], normals[0] if np.isfinite(normals).all() else np.array([0.36, 0.48, 0.8])
