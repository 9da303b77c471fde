"""What can go wrong where a few faces of a solid are replaced: loose edges, collisions, a wrong change of volume."""

from collections.abc import Sequence

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Tool
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_IN, TopAbs_OUT, TopAbs_VERTEX
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape

from cqblend.brep.topology import CONFUSION, ShapeIndex, make_compound
from cqblend.brep.verification.brep_check import get_shared_curve
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.brep.verification.volumes import compute_bounds, measure_volume


def find_loose_edges(
    old: list[TopoDS_Shape], new: list[TopoDS_Shape], after: TopoDS_Shape, tolerance: float
) -> list[str]:
    """Return one line for every new edge whose tolerance is above the limit, but for pieces of old edges."""
    inherited = {get_shared_curve(edge) for edge in ShapeIndex(make_compound(old), TopAbs_EDGE)}
    loose = [
        edge
        for edge in ShapeIndex(make_compound(new), TopAbs_EDGE)
        if BRep_Tool.Tolerance_s(edge) > tolerance and get_shared_curve(edge) not in inherited
    ]
    index = ShapeIndex(after, TopAbs_EDGE)
    return [
        f"edge {index.find_number(edge)} has tolerance {BRep_Tool.Tolerance_s(edge):.2g} mm, above {tolerance:.2g}"
        for edge in loose
    ]


def find_collisions(face: TopoDS_Face, solid: TopoDS_Shape) -> list[str]:
    """Return one line for every face of the solid that shares no vertex with a face, but touches it or crosses it."""
    own, box = ShapeIndex(face, TopAbs_VERTEX), _make_bounding_box(face)
    lines = []
    for number, other in enumerate(ShapeIndex(solid, TopAbs_FACE), 1):
        if any(vertex in own for vertex in ShapeIndex(other, TopAbs_VERTEX)) or box.IsOut(_make_bounding_box(other)):
            continue
        if BRepExtrema_DistShapeShape(face, other).Value() <= CONFUSION:
            lines.append(f"a new face cuts through face {number}")
    return lines


def _make_bounding_box(shape: TopoDS_Shape) -> Bnd_Box:
    """Return a bounding box that is quick rather than tight."""
    box = Bnd_Box()
    BRepBndLib.AddClose_s(shape, box)
    box.Enlarge(2 * CONFUSION)
    return box


def is_on_wanted_side(before: TopoDS_Shape, new_faces: Sequence[TopoDS_Face], grows: bool) -> bool:
    """Whether five points of every new face lie strictly outside the old solid, if it was to grow, or inside it."""
    wanted = TopAbs_OUT if grows else TopAbs_IN
    classifier = BRepClass3d_SolidClassifier(before)
    for face in new_faces:
        u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
        surface = BRep_Tool.Surface_s(face)
        for u_share, v_share in ((0.15, 0.3), (0.15, 0.7), (0.5, 0.5), (0.85, 0.3), (0.85, 0.7)):
            point = surface.Value(u0 + u_share * (u1 - u0), v0 + v_share * (v1 - v0))
            classifier.Perform(point, CONFUSION)
            if classifier.State() != wanted:
                return False
    return bool(new_faces)


def check_volume_change(old: list[TopoDS_Shape], new: list[TopoDS_Shape], grows: bool) -> list[str]:
    """Return a line if replacing faces changed the volume in the wrong direction, by more than integration may err.

    The new faces and the old ones, reversed, enclose the change, but for gaps at edges, which lie on their faces to a
    tolerance only. ``grows`` tells whether material was to be added.
    """
    between = make_compound([*new, *(face.Reversed() for face in old)])
    low, high = compute_bounds(between)
    gap_volume = float(np.linalg.norm(high - low)) * sum(map(_estimate_gap_area, ShapeIndex(between, TopAbs_EDGE)))
    for accuracy in VERIFICATION_TOLERANCES.volume_changes:
        change, error = measure_volume(between, accuracy=accuracy)
        if abs(change) > gap_volume + 3 * error + 10 * accuracy * float((high - low).prod()):
            break
    else:
        return []
    if (change > 0) == grows:
        return []
    verb, kind = ("fell", "add") if grows else ("rose", "remove")
    return [f"the volume {verb} by {abs(change):.3g} mm^3, but the blend was to {kind} material"]


def _estimate_gap_area(edge: TopoDS_Shape) -> float:
    """Return the area (mm^2) of the gap at an edge: its tolerance times its length, 0 at OCCT's own tolerance."""
    tolerance = BRep_Tool.Tolerance_s(TopoDS.Edge_s(edge))
    if tolerance <= 2 * CONFUSION:
        return 0.0
    properties = GProp_GProps()
    BRepGProp.LinearProperties_s(edge, properties)
    return float(tolerance * properties.Mass())
