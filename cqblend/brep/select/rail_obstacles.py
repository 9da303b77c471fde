"""What a rail comes upon where it leaves its face, for messages: how wide the face is there, and what is behind."""

from __future__ import annotations

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_IN, TopAbs_ON

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.brep.read.face_surface import read_support_face
from cqblend.brep.select.edge_joint import Joint
from cqblend.brep.topology import AncestorMap, drop_duplicate_shapes, explore_subshapes
from cqblend.splines.bracketing import bisect_interval

OPPOSITE_COSINE = -0.9  # cosine between the outward normals of two faces from which on they are both sides of a wall
BISECTION_STEPS = 40
LEAST_SHARE = 1e-6  # of the way to a contact: a face that does not even reach that far has no width
BORDER_SAMPLES = 65  # along an edge


def find_leaving_contact(joint: Joint, contacts: Contacts) -> tuple[int, int] | None:
    """Return the first side, and the index, at which contacts leave their face; None if they stay.

    At the ends of an open edge they may be outside, where the faces end obliquely; between contacts that are inside,
    and in the middle, they may not.
    """
    middle = len(contacts.t) // 2
    for side in (0, 1):
        inside = joint.classify_contacts(contacts, side)
        if not joint.spine.closed:
            within = np.flatnonzero(inside)
            if len(within) and within[0] <= middle <= within[-1]:
                inside[: within[0]] = inside[within[-1] :] = True
            elif not inside[middle]:
                return side, middle
        if not inside.all():
            return side, int(np.argmin(inside))
    return None


def describe_obstacle(joint: Joint, contacts: Contacts, side: int, index: int) -> str:
    """Say how far a face reaches from the edge, at a contact that is outside, and what is there."""
    one, other = joint.sides[side], joint.sides[1 - side]
    t = contacts.t[[index]]
    stations = joint.locate_stations(t)
    at = joint.spine.evaluate_pcurves(np.mod(t, 1.0) if joint.spine.closed else np.clip(t, 0, 1), one.face)
    start = one.unwrap_near(one.to_face_parameters(stations.uv[side]), at)[0]
    stop = one.unwrap_near(one.to_face_parameters(contacts.uv[side][[index]]), at)[0]
    classifier = BRepTopAdaptor_FClass2d(one.face, 1e-9)

    def is_inside_face(share: float) -> bool:
        (uv,) = one.wrap_to_window((start + share * (stop - start))[None])
        state = classifier.Perform(gp_Pnt2d(*uv.tolist()))
        return bool(state == TopAbs_IN or (state == TopAbs_ON and one.is_at_seam(uv)))

    low, _ = bisect_interval(is_inside_face, 0.0, 1.0, BISECTION_STEPS)
    point = one.face_primary.jet((start + low * (stop - start))[None])[0, 0]
    wide = float(np.linalg.norm(point - stations.points[0]))
    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point.tolist())).Vertex()
    bounds = [
        use
        for use in drop_duplicate_shapes(explore_subshapes(one.face, TopAbs_EDGE))
        if not any(use.IsSame(e) for e in joint.spine.edges)
    ]
    name = f"face {joint.face_numbers[side]}"
    if low < LEAST_SHARE:
        return f"{name} ends at the edge there"
    if not bounds:
        return f"{name} reaches only {wide:.3g} there"
    edge = min(bounds, key=lambda use: BRepExtrema_DistShapeShape(vertex, use).Value())
    behind = [face for face in AncestorMap(joint.solid, TopAbs_EDGE, TopAbs_FACE)(edge) if not face.IsSame(one.face)]
    if not behind:
        return f"{name} reaches only {wide:.3g} there"
    beyond = read_support_face(behind[0], point[None])
    curve = BRep_Tool.CurveOnSurface_s(edge, beyond.face, 0.0, 0.0)
    first, last = BRep_Tool.Range_s(edge)
    border = np.array(
        [(value.X(), value.Y()) for value in map(curve.Value, np.linspace(first, last, BORDER_SAMPLES).tolist())]
    )
    nearest = np.linalg.norm(beyond.face_primary.jet(border)[0] - point, axis=1).argmin()
    here = other.outward * other.primary.evaluate_normals(stations.uv[1 - side])[0]
    if (
        joint.is_convex
        and beyond.outward * beyond.face_primary.evaluate_normals(border[[nearest]])[0] @ here < OPPOSITE_COSINE
    ):
        names = f"face {joint.face_numbers[1 - side]} and {joint.name_part(behind[0])}"
        return f"the wall between {names} is only {wide:.3g} thick there"
    return f"{name} is only {wide:.3g} wide there, up to {joint.name_part(edge)}"
