"""Joints: what is picked, between which faces, and what may not be picked, by name."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.ShapeUpgrade import ShapeUpgrade_ShapeDivideClosedEdges
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS
from OCP.TopTools import TopTools_IndexedMapOfShape

from cqblend.blends.contacts.contact_solver import Contacts
from cqblend.brep.selection.picked_edges import select_chains
from cqblend.brep.selection.rail_obstacles import find_leaving_contact
from cqblend.errors import SelectionError

V = cq.Vector


def all_edges(body: cq.Shape) -> list:
    index = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(body.wrapped, TopAbs_EDGE, index)
    return [TopoDS.Edge_s(index.FindKey(i)) for i in range(1, index.Extent() + 1)]


def joint(body: cq.Shape, edge, side1: cq.Face | None = None):
    """Return the joint of an edge, or raise why it is none."""
    selection = select_chains(body.wrapped, [edge], side1 and side1.wrapped, None, follow=True)
    ((found,),) = selection.networks
    if found.error is not None:
        raise found.error
    (cell,) = found.chain.cells
    return cell


def bracket() -> cq.Solid:
    return cq.Workplane().polyline([(0, 0), (9, 0), (9, 2), (2, 2), (2, 8), (0, 8)]).close().extrude(5).val()


def test_sides_are_the_faces_in_the_order_of_the_solid_or_as_asked():
    body = bracket()
    edge = body.Edges()[0]
    faces = [f for f in body.Faces() if any(f.isSame(g) for g in edge.ancestors(body, "Face").Faces())]
    for first, order in ((None, faces), (faces[0], faces), (faces[1], faces[::-1])):
        found = joint(body, edge.wrapped, first)
        for side, face in zip(found.sides, order, strict=True):
            assert side.face.IsSame(face.wrapped)


def test_convex_and_concave_edges_of_a_bracket():
    body = bracket()
    inner = min(body.Edges(), key=lambda e: (e.Center() - V(2, 2, 2.5)).Length)
    outer = min(body.Edges(), key=lambda e: (e.Center() - V(0, 0, 2.5)).Length)
    for edge, is_convex in ((inner, False), (outer, True)):
        for side1 in edge.ancestors(body, "Face").Faces():
            assert joint(body, edge.wrapped, side1).is_convex == is_convex


def test_stations_face_one_to_the_left_seen_from_outside():
    body = bracket()
    for edge in body.Edges():
        for side1 in edge.ancestors(body, "Face").Faces():
            found = joint(body, edge.wrapped, side1)
            stations = found.locate_stations(np.array([0.5]))
            normal = cq.Face(found.sides[0].face).normalAt(V(*stations.points[0].tolist())).toTuple()
            outward = np.array(normal) * found.sides[0].outward  # of the FORWARD face
            left = np.cross(outward, stations.tangents[0])
            point = stations.points[0] + 1e-3 * left
            face = next(f for f in body.Faces() if f.wrapped.IsSame(found.sides[0].face))
            assert face.distance(cq.Vertex.makeVertex(*point.tolist())) < 1e-9


@pytest.mark.parametrize("picked", [0, 1, -1])
def test_a_joint_cut_into_edges_is_followed_all_around(picked):
    body = cq.Solid.makeCylinder(8, 3).fuse(cq.Solid.makeCylinder(4, 9)).Solids()[0]
    divide = ShapeUpgrade_ShapeDivideClosedEdges(body.wrapped)
    divide.SetNbSplitPoints(3)
    divide.Perform()
    cut = cq.Shape.cast(divide.Result())
    ring = [e for e in cut.Edges() if e.geomType() == "CIRCLE" and abs(e.Center().z - 3) < 1e-6 and e.radius() == 4]
    assert len(ring) > 1
    found = joint(cut, ring[picked].wrapped)
    assert found.spine.closed
    assert len(found.spine.edges) == len(ring)
    assert found.spine.length == pytest.approx(8 * np.pi, rel=1e-9)


def test_open_edges_stop_where_other_faces_begin():
    body = bracket()
    found = joint(body, body.Edges()[0].wrapped)
    assert not found.spine.closed
    assert len(found.spine.edges) == 1
    assert found.spine.length == pytest.approx(body.Edges()[0].Length())


def test_contacts_that_leave_their_face_are_told_with_its_side():
    body = cq.Solid.makeBox(10, 10, 10)
    found = joint(body, body.Edges()[0].wrapped)
    stations = found.locate_stations(np.array([0.5]))
    middle = [np.diff(side.bounds).T / 2 + side.bounds[:, 0] for side in found.sides]
    inside = Contacts(stations.t, stations.points, (middle[0], middle[1]), np.ones(1))
    assert find_leaving_contact([found.classify_contacts(inside, side) for side in (0, 1)], closed=False) is None
    far = Contacts(stations.t, stations.points, (middle[0] + 100, middle[1]), np.ones(1))
    assert find_leaving_contact([found.classify_contacts(far, side) for side in (0, 1)], closed=False) == (0, 0)


def refused(body: cq.Shape, edge, text: str) -> None:
    with pytest.raises(SelectionError, match=text):
        joint(body, edge)


def test_seams_and_poles_are_refused_by_name():
    rod = cq.Solid.makeCylinder(4, 9)
    refused(rod, next(e.wrapped for e in rod.Edges() if e.geomType() == "LINE"), "edge [0-9]+ is a seam")
    ball = cq.Solid.makeSphere(4, angleDegrees1=-90)
    refused(ball, next(e for e in all_edges(ball) if BRep_Tool.Degenerated_s(e)), "edge [0-9]+ is degenerate")


def test_smooth_and_free_edges_are_refused_by_name():
    body = cq.Solid.makeBox(10, 10, 10)
    rounded = body.fillet(2, [body.Edges()[0]])
    smooth = max((e for e in rounded.Edges() if e.geomType() == "LINE"), key=lambda e: _smoothness(rounded, e))
    refused(rounded, smooth.wrapped, "edge [0-9]+ is smooth already")
    shell = cq.Shell.makeShell(body.Faces()[1:])
    free = next(edge for edge in shell.Edges() if edge.Center().x == 0)
    refused(shell, free.wrapped, "edge [0-9]+ has 1 face: it is in the border of an open shell")
    refused(body.Wires()[0], body.Wires()[0].Edges()[0].wrapped, "edge 1 is not part of a solid or a shell")


def _smoothness(body: cq.Shape, edge: cq.Edge) -> float:
    first, second = (face.normalAt(edge.positionAt(0.5)) for face in edge.ancestors(body, "Face").Faces())
    return first.dot(second)
