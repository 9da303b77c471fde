"""Volumes inside shapes, and solids that are inside out.

Volumes are OCCT's, by Gauss-Kronrod integration over knot spans from a skew plane: measured on solids of known
volume, it is as accurate as it says. OCCT's default is off by 1e-4 on freeform bodies and by 1 % on a screw, its
adaptive Gauss integration by 15 % on an extruded spline while it reports 1e-16, and Gauss-Kronrod from a point does
not end when a planar face passes through that point. Between different planes, it agrees within 1e-6 on clean solids
and 1e-5 on STEP bodies with sloppy pcurves.
"""

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepGProp import BRepGProp
from OCP.gp import gp_Dir, gp_Pln, gp_Pnt
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_IN, TopAbs_SOLID
from OCP.TopoDS import TopoDS_Shape

from cqblend.brep.topology import ShapeIndex
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.splines.bernstein import Array


def measure_volume(
    shape: TopoDS_Shape, plane: gp_Pln | None = None, accuracy: float = VERIFICATION_TOLERANCES.volume
) -> tuple[float, float]:
    """Return the volume inside a shape, mm^3, negative if it is inside out, and OCCT's estimate of its error.

    ``plane`` is what OCCT integrates from; where edges have gaps, only volumes from the same plane compare.
    """
    properties = GProp_GProps()
    relative = BRepGProp.VolumePropertiesGK_s(
        shape, properties, plane or make_skew_plane(shape), accuracy, False, True, False, False, False
    )
    volume = float(properties.Mass())
    return volume, abs(relative * volume)


def estimate_volume_error(shape: TopoDS_Shape, volume: float) -> float:
    """Estimate the error of a volume (mm^3): its difference from that by another of OCCT's integrations.

    On trimmed faces of many and uneven spans the error of either can be a hundred times what OCCT says.
    """
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, VERIFICATION_TOLERANCES.volume / 10, False, False)
    return abs(float(properties.Mass()) - volume)


def make_skew_plane(shape: TopoDS_Shape) -> gp_Pln:
    """Return a plane near the middle of a shape, at odd angles: volumes are integrated from it, face by face.

    A face in the plane of integration would enclose no volume, and its errors would not show.
    """
    low, high = compute_bounds(shape)
    normal = np.array([0.3826, 0.5217, 0.7625])
    point = (low + high) / 2 - 0.0719 * float(np.linalg.norm(high - low)) * normal
    return gp_Pln(gp_Pnt(*point.tolist()), gp_Dir(*normal.tolist()))


def compute_bounds(shape: TopoDS_Shape) -> tuple[Array, Array]:
    """Return the corners of a shape's bounding box."""
    box = Bnd_Box()
    BRepBndLib.Add_s(shape, box, False)
    if box.IsVoid():
        return np.zeros(3), np.zeros(3)
    return np.array(box.CornerMin().Coord()), np.array(box.CornerMax().Coord())


def find_inverted_solids(shape: TopoDS_Shape) -> list[str]:
    """Return one line for every solid that is inside out: infinity lies inside."""
    lines = []
    for i, solid in enumerate(ShapeIndex(shape, TopAbs_SOLID), 1):
        classifier = BRepClass3d_SolidClassifier(solid)
        classifier.PerformInfinitePoint(1e-7)
        if classifier.State() == TopAbs_IN:
            lines.append(f"solid {i} is inside out")
    return lines
