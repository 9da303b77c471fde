"""Faces that go because a strip swallows the loops that they hang on: a dimple, a pad, a hole across a corner.

They go if nothing of them reaches further: if they hang on nothing but swallowed loops, lie on the side of the support
face where the blend takes material away or adds it, and do not touch the finished blend.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from itertools import product

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepTools import BRepTools
from OCP.gp import gp_Pnt, gp_Pnt2d, gp_Vec, gp_Vec2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_IN, TopAbs_ON, TopAbs_OUT, TopAbs_REVERSED, TopAbs_State
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.bodies import is_solid
from cqblend.brep.shell_editing.planned_solid import FaceConflictError, PlannedSolid
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import CONFUSION, ShapeIndex, explore_subshapes, orient_forward
from cqblend.errors import SizeError
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import normalise_vectors


def collect_hanging_faces(solid: PlannedSolid, loops: Collection[int]) -> tuple[frozenset[int], str]:
    """Return the faces that hang on swallowed loops, given by the numbers of their edges, and why they cannot go.

    The reason is empty if they can.
    """
    index, touched = solid.index, {face.number for face in solid.plan.faces}
    found: set[int] = set()
    waiting = [
        number
        for edge in loops
        for number in map(index.faces.find_number, index.faces_at_edge(index.edges[edge]))
        if number not in touched
    ]
    while waiting:
        number = waiting.pop()
        if number in found:
            continue
        found.add(number)
        for edge in explore_subshapes(index.faces[number], TopAbs_EDGE):
            if index.edges.find_number(edge) in loops:
                continue
            beyond = [other for other in map(index.faces.find_number, index.faces_at_edge(edge)) if other != number]
            reached = touched.intersection(beyond)
            if reached:
                return frozenset(), f"{solid.name_face(number)} behind it goes on to {solid.name_face(min(reached))}"
            waiting += beyond
    return frozenset(found), ""


def find_wrong_side(solid: PlannedSolid, face: int, loop: Sequence[int], strips: Sequence[int]) -> str:
    """Return why a swallowed loop of a face cannot go, from the side on which its other faces lie; empty if it can.

    Below the face a blend that takes material away may swallow them, above it one that adds material.
    """
    index = solid.index
    for number in loop:
        edge = index.edges[number]
        for other in index.faces_at_edge(edge):
            if index.faces.find_number(other) == face:
                continue
            rise = _measure_rise(TopoDS.Edge_s(edge), TopoDS.Face_s(index.faces[face]), TopoDS.Face_s(other))
            name = solid.name_part(other)
            if any(solid.convex[k] == (rise > 0) for k in strips):
                return f"{name} stands on it" if rise > 0 else f"{name} leads on into the solid"
    return ""


def _measure_rise(edge: TopoDS_Edge, face: TopoDS_Face, other: TopoDS_Face) -> float:
    """Return the sine of the angle by which a face at an edge rises over another one, at the middle of the edge."""
    outward, _ = _evaluate_side(edge, face)
    _, into = _evaluate_side(edge, other)
    return float(outward @ into)


def _evaluate_side(edge: TopoDS_Edge, face: TopoDS_Face) -> tuple[Array, Array]:
    """Return the outward normal of a face at the middle of one of its edges, and the direction from there into it."""
    forward = TopoDS.Face_s(orient_forward(face))
    use = next(one for one in explore_subshapes(forward, TopAbs_EDGE) if one.IsSame(edge))
    pcurve, (first, last) = BRep_Tool.CurveOnSurface_s(use, forward, 0.0, 0.0), BRep_Tool.Range_s(use)
    at, rate = gp_Pnt2d(), gp_Vec2d()
    pcurve.D1((first + last) / 2, at, rate)
    point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    BRep_Tool.Surface_s(forward).D1(at.X(), at.Y(), point, du, dv)
    u, v = np.array(du.Coord()), np.array(dv.Coord())
    normal = normalise_vectors(np.cross(u, v))
    along = (u * rate.X() + v * rate.Y()) * (-1.0 if use.Orientation() == TopAbs_REVERSED else 1.0)
    return normal * (-1.0 if face.Orientation() == TopAbs_REVERSED else 1.0), normalise_vectors(np.cross(normal, along))


def check_consumed_edges(solid: PlannedSolid) -> None:
    """Check that nothing is left of the edges of faces between rails that coincide.

    Raises
    ------
    FaceConflictError
        If something is: one of these faces reaches further, or has a hole.
    """
    index, plan = solid.index, solid.plan
    for number in plan.consumed_faces:
        for edge in ShapeIndex(index.faces[number], TopAbs_EDGE):
            beyond = [other for other in map(index.faces.find_number, index.faces_at_edge(edge)) if other != number]
            own = index.edges.find_number(edge)
            removed = [not face.pieces.get(own, (own,)) for face in plan.faces if face.number in beyond]
            if beyond and not set(beyond) <= {*plan.consumed_faces} and not (removed and all(removed)):
                message = (
                    f"the two blends meet all along {solid.name_face(number)}, so that it goes, but "
                    f"{solid.name_part(edge)} of it would be left"
                )
                raise FaceConflictError(solid.list_strips(number), SizeError(message, kind="too large"))


def check_swallowed_faces(solid: PlannedSolid, blended: TopoDS_Shape, blend_faces: Sequence[TopoDS_Face]) -> None:
    """Check that the faces that went with swallowed loops do not reach through the finished blends.

    They keep a distance from the blend faces and lie outside the blended solid, if the blend takes material away, or
    inside. OCCT finds distances only where surfaces come nearest, and may miss that they cross. An open shell does not
    tell what is inside: there, nothing goes.

    Raises
    ------
    FaceConflictError
        If one reaches through a blend.
    """
    if not solid.plan.swallowed_faces:
        return
    classifier = BRepClass3d_SolidClassifier(blended) if is_solid(blended) else None
    for number in solid.plan.swallowed_faces:
        face = TopoDS.Face_s(solid.index.faces[number])
        distances = [BRepExtrema_DistShapeShape(blend_face, face).Value() for blend_face in blend_faces]
        nearest = int(np.argmin(distances))
        wanted = TopAbs_OUT if solid.convex[nearest] else TopAbs_IN
        is_clear = classifier is not None and distances[nearest] > CONFUSION
        if not (is_clear and all(_has_state(classifier, point, wanted) for point in _sample_face(solid, face))):
            reach = "which reaches through it" if classifier else "and an open shell does not tell what that leaves"
            message = f"the blend swallows the rim of {solid.name_face(number)}, {reach}"
            error = SizeError(message, kind="too large", room=solid.room_beside_swallowed)
            raise FaceConflictError([nearest], error)


def _has_state(classifier: BRepClass3d_SolidClassifier, point: gp_Pnt, wanted: TopAbs_State) -> bool:
    """Whether a point lies on the wanted side of the boundary of a solid, or on it."""
    classifier.Perform(point, CONFUSION)
    return classifier.State() in (wanted, TopAbs_ON)


def _sample_face(solid: PlannedSolid, face: TopoDS_Face) -> Iterator[gp_Pnt]:
    """Yield points of a face: along its edges, and inside."""
    for edge in explore_subshapes(face, TopAbs_EDGE):
        if not BRep_Tool.Degenerated_s(edge):
            curve = BRepAdaptor_Curve(edge)
            ends = curve.FirstParameter(), curve.LastParameter()
            yield from map(curve.Value, np.linspace(*ends, SHELL_EDIT_TOLERANCES.swallowed_edge_samples).tolist())
    surface, (u0, u1, v0, v1) = BRep_Tool.Surface_s(face), BRepTools.UVBounds_s(face)
    classifier = solid.index.get_classifier(face, CONFUSION)
    shares = (
        np.arange(SHELL_EDIT_TOLERANCES.swallowed_face_samples) + 0.5
    ) / SHELL_EDIT_TOLERANCES.swallowed_face_samples
    for u, v in product((u0 + shares * (u1 - u0)).tolist(), (v0 + shares * (v1 - v0)).tolist()):
        if classifier.Perform(gp_Pnt2d(u, v)) == TopAbs_IN:
            yield surface.Value(u, v)
