"""Say in messages why a rail leaves its support face: the face is too narrow there, or the wall behind it too thin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.gp import gp_Pnt, gp_Pnt2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_IN, TopAbs_ON
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.brep.conversion.support_face import read_support_face
from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.topology import drop_duplicate_shapes, explore_subshapes, is_among
from cqblend.splines.bernstein import Array
from cqblend.splines.bracketing import bisect_interval


def find_leaving_contact(inside: Sequence[Array], *, closed: bool) -> tuple[int, int] | None:
    """Return the first side, 0 or 1, whose contacts leave their face, and the index of such a contact; None if none do.

    ``inside`` tells, by side, which contacts along an edge lie inside the face. At the ends of an edge that is not
    ``closed`` contacts may be outside, because faces may end obliquely; between contacts that are inside, and in the
    middle, they may not.
    """
    for side, found in enumerate(inside):
        middle, kept = len(found) // 2, found.copy()
        if not closed:
            within = np.flatnonzero(kept)
            if len(within) and within[0] <= middle <= within[-1]:
                kept[: within[0]] = kept[within[-1] :] = True
            elif not kept[middle]:
                return side, middle
        if not kept.all():
            return side, int(np.argmin(kept))
    return None


def describe_obstacle(joint: Joint, contacts: Contacts, side: int, index: int) -> str:
    """Say how far the face of a side, 0 or 1, reaches from the edge at a contact outside, and what is beyond."""
    support = joint.sides[side]
    stations = joint.locate_stations(contacts.t[[index]])
    share, point = _find_last_point_inside(joint, contacts, side, index)
    width = float(np.linalg.norm(point - stations.points[0]))
    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point.tolist())).Vertex()
    borders = [
        use
        for use in drop_duplicate_shapes(explore_subshapes(support.face, TopAbs_EDGE))
        if not is_among(use, joint.spine.edges)
    ]
    name = f"face {joint.face_numbers[side]}"
    if share < SELECT_TOLERANCES.least_width:
        return f"{name} ends at the edge there"
    if not borders:
        return f"{name} reaches only {width:.3g} there"
    border = min(borders, key=lambda use: BRepExtrema_DistShapeShape(vertex, use).Value())
    faces_beyond = [face for face in joint.index.faces_at_edge(border) if not face.IsSame(support.face)]
    if not faces_beyond:
        return f"{name} reaches only {width:.3g} there"
    opposite = joint.sides[1 - side]
    normal = opposite.outward * opposite.primary.evaluate_normals(stations.uv[1 - side])[0]
    normal_beyond = _evaluate_border_normal(faces_beyond[0], border, point)
    if joint.is_convex and normal_beyond @ normal < SELECT_TOLERANCES.opposite_cosine:
        names = f"face {joint.face_numbers[1 - side]} and {joint.name_part(faces_beyond[0])}"
        return f"the wall between {names} is only {width:.3g} thick there"
    return f"{name} is only {width:.3g} wide there, up to {joint.name_part(border)}"


def _find_last_point_inside(joint: Joint, contacts: Contacts, side: int, index: int) -> tuple[float, Array]:
    """Return how far the face reaches from the edge towards a contact: as a share of the way, and the point (3,)."""
    support = joint.sides[side]
    t = contacts.t[[index]]
    on_edge = joint.spine.evaluate_pcurves(np.mod(t, 1.0) if joint.spine.closed else np.clip(t, 0, 1), support.face)
    foot = joint.locate_stations(t).uv[side]
    start = support.unwrap_near(support.to_face_parameters(foot), on_edge)[0]
    stop = support.unwrap_near(support.to_face_parameters(contacts.uv[side][[index]]), on_edge)[0]
    classifier = joint.index.get_classifier(support.face, SELECT_TOLERANCES.face_boundary)

    def is_inside_face(share: float) -> bool:
        (uv,) = support.wrap_to_window((start + share * (stop - start))[None])
        state = classifier.Perform(gp_Pnt2d(*uv.tolist()))
        return bool(state == TopAbs_IN or (state == TopAbs_ON and support.is_at_seam(uv)))

    share, _ = bisect_interval(is_inside_face, 0.0, 1.0, SELECT_TOLERANCES.width_bisections)
    point: Array = support.face_primary.jet((start + share * (stop - start))[None])[0, 0]
    return share, point


def _evaluate_border_normal(face: TopoDS_Face, border: TopoDS_Edge, point: Array) -> Array:
    """Return the outward normal (3,) of a face at one of its edges, where that is nearest to a point."""
    support = read_support_face(face, point[None])
    curve = BRep_Tool.CurveOnSurface_s(border, support.face, 0.0, 0.0)
    first, last = BRep_Tool.Range_s(border)
    samples = map(curve.Value, np.linspace(first, last, SELECT_TOLERANCES.border_samples).tolist())
    uv = np.array([(sample.X(), sample.Y()) for sample in samples])
    nearest = np.linalg.norm(support.face_primary.jet(uv)[0] - point, axis=1).argmin()
    normal: Array = support.outward * support.face_primary.evaluate_normals(uv[[nearest]])[0]
    return normal
