"""Wire substitution: what it leaves alone and what it shares."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopLoc import TopLoc_Location

import cqblend
from cqblend.brep.topology import ShapeIndex, explore_subshapes, find_end_vertices, orient_forward

V = cq.Vector


def blended(body: cq.Shape, edge: cq.Edge, **options):
    return cqblend.blend_edges(body, edge, **options)


def plate() -> cq.Shape:
    """A plate with a post and a window: faces with several wires, curved and straight edges."""
    part = cq.Workplane().box(40, 30, 6).faces(">Z").workplane().pushPoints([(12, 0)]).rect(6, 6).cutThruAll()
    return part.faces(">Z").workplane(origin=(-10, 0, 0)).circle(5).extrude(8).val()


def surface(face: cq.Face):
    """Return the very surface object, without a copy made for the face's location."""
    return BRep_Tool.Surface_s(face.wrapped, TopLoc_Location())


def nearest(body: cq.Shape, x: float, y: float, z: float) -> cq.Edge:
    return min(body.Edges(), key=lambda e: (e.Center() - V(x, y, z)).Length)


CASES = {
    "edge of the plate": ((20, 15, 0), 4),
    "edge of the window": ((15, 3, 0), 4),
    "foot of the post": ((-10, 0, 3), 2),
    "top of the post": ((-10, 0, 11), 2),
}


@pytest.mark.parametrize("name", CASES)
def test_faces_that_do_not_touch_the_edge_are_taken_over_as_they_are(name):
    at, touched = CASES[name]
    body = plate()
    result = blended(body, nearest(body, *at), radius=0.8)
    kept = [f for f in body.Faces() if any(f.isSame(g) for g in result.shape.Faces())]
    assert len(kept) == len(body.Faces()) - touched
    surfaces = {surface(f) for f in body.Faces()}
    others = [f for f in result.shape.Faces() if not f.isSame(result.faces[0])]
    assert len(others) == len(body.Faces())
    assert all(surface(f) in surfaces for f in others)


@pytest.mark.parametrize("name", CASES)
def test_every_edge_is_shared_by_two_faces_and_runs_once_each_way(name):
    body = plate()
    shape = blended(body, nearest(body, *CASES[name][0]), radius=0.8).shape
    index = ShapeIndex(shape.wrapped, TopAbs_EDGE)
    uses: dict[int, list[str]] = {}
    for use in explore_subshapes(shape.wrapped, TopAbs_EDGE):
        uses.setdefault(index.find_number(use), []).append(use.Orientation().name)
    for number, orientations in uses.items():
        if not BRep_Tool.Degenerated_s(index[number]):
            assert sorted(orientations) == ["TopAbs_FORWARD", "TopAbs_REVERSED"]


@pytest.mark.parametrize("name", CASES)
def test_curves_of_the_blends_edges_lie_on_both_faces_within_their_tolerance(name):
    body = plate()
    result = blended(body, nearest(body, *CASES[name][0]), radius=0.8)
    for edge in result.faces[0].Edges():
        first, last = BRep_Tool.Range_s(edge.wrapped)
        curve = BRep_Tool.Curve_s(edge.wrapped, 0.0, 0.0)
        for face in edge.ancestors(result.shape, "Face").Faces():
            pcurve = BRep_Tool.CurveOnSurface_s(edge.wrapped, face.wrapped, 0.0, 0.0)
            surface = BRep_Tool.Surface_s(face.wrapped)
            for t in np.linspace(first, last, 40).tolist():
                on_face = surface.Value(*pcurve.Value(t).Coord())
                assert on_face.Distance(curve.Value(t)) <= BRep_Tool.Tolerance_s(edge.wrapped)
        for vertex, t in zip(find_end_vertices(orient_forward(edge.wrapped)), (first, last), strict=True):
            point = curve.Value(t)
            assert BRep_Tool.Pnt_s(vertex).Distance(point) <= BRep_Tool.Tolerance_s(vertex)


def test_rails_are_flagged_smooth_and_ends_are_not():
    body = plate()
    result = blended(body, nearest(body, 20, 15, 0), radius=0.8)
    flags = []
    for edge in result.faces[0].Edges():
        first, second = edge.ancestors(result.shape, "Face").Faces()
        flags.append(BRep_Tool.Continuity_s(edge.wrapped, first.wrapped, second.wrapped).name)
    assert sorted(flags) == ["GeomAbs_C0", "GeomAbs_C0", "GeomAbs_G1", "GeomAbs_G1"]


def test_holes_of_trimmed_faces_stay():
    body = plate()
    result = blended(body, nearest(body, 20, 0, 3), radius=2)
    top = max(result.shape.Faces(), key=lambda f: len(f.innerWires()))
    assert len(top.innerWires()) == 2
