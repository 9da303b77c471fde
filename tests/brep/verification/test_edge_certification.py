"""Every edge of a blend face is in the certificate, and one that strays from its faces or creases is found."""

import math

import cadquery as cq
import pytest
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.gp import gp_Vec2d
from OCP.TopAbs import TopAbs_EDGE

import cqblend
from cqblend.brep.measurement.curve_deviation import measure_curve_deviation
from cqblend.brep.shell_editing.plan_application import BuiltEdge
from cqblend.brep.topology import explore_subshapes
from cqblend.brep.verification.edge_certification import certify_edge


def box():
    return cq.Solid.makeBox(10, 12, 14)


class AnyJoint:
    """What is asked of a joint for a record of an edge."""

    edge_number = 7

    def find_vertex_number(self, end: int) -> int:
        return 100 + end


def test_an_open_blend_has_two_ends_with_the_vertices_of_its_edge():
    body = box()
    edge = body.Edges()[3]
    result = cqblend.blend_edges(body, edge, 2)
    records = result.certificate.edges
    assert [one.kind for one in records] == ["end", "end"]
    corners = {(round(v.X, 9), round(v.Y, 9), round(v.Z, 9)): n for n, v in enumerate(body.Vertices(), 1)}
    ends = {corners[tuple(round(x, 9) for x in edge.positionAt(t).toTuple())] for t in (0, 1)}
    assert {one.vertex for one in records} == ends == {end.vertex for end in result.certificate.ends}
    for one in records:
        assert one.edge == 4
        assert one.gap < 1e-12
        assert one.angle is None
        assert one.tolerance == 1e-7
        assert not one.strays
    assert "end at vertex" not in str(result.certificate)


def test_each_end_is_at_its_own_vertex():
    """One end is on a plane across the edge, the other on a cylinder, in which the blend ends to a fit only."""
    body = cq.Workplane().box(20, 10, 10).cut(cq.Workplane().center(25, 0).circle(18).extrude(20, both=True)).val()
    edge = cq.Workplane(body).edges("|X and >Y and >Z").val()
    plain, fitted = sorted(cqblend.blend_edges(body, edge, 1.5).certificate.edges, key=lambda record: record.gap)
    vertices = body.Vertices()
    assert plain.gap < 1e-13 < fitted.gap < 1e-7
    assert abs(vertices[plain.vertex - 1].X + 10) < 1e-9
    assert vertices[fitted.vertex - 1].X > 0


def test_a_closed_blend_has_a_smooth_seam():
    body = cq.Workplane().circle(5).extrude(8)
    certificate = cqblend.blend_edges(body.val(), body.faces(">Z").edges().val(), 1).certificate
    (seam,) = certificate.edges
    assert seam.kind == "seam"
    assert seam.vertex == 0
    assert seam.gap < 1e-11
    assert seam.angle < 1e-10


def test_certificates_of_several_blends_have_the_edges_of_all():
    body = box()
    picked = [body.Edges()[0], body.Edges()[2]]
    certificate = cqblend.blend_edges(body, picked, 1).certificate
    assert sorted({one.edge for one in certificate.edges}) == [1, 3]
    assert len(certificate.edges) == 4


def make_side_pair(body: cq.Shape, edge: cq.Edge):
    faces = [face.wrapped for face in edge.ancestors(body, "Face").Faces()]
    uses = [next(use for use in explore_subshapes(face, TopAbs_EDGE) if use.IsSame(edge.wrapped)) for face in faces]
    return tuple(zip(faces, uses, strict=True))


@pytest.mark.parametrize("shift", [1e-6, 1e-3])
def test_a_gap_at_an_end_is_measured_on_both_faces(shift):
    for moved in (0, 1):
        body = box()
        sides = make_side_pair(body, body.Edges()[0])
        face, use = sides[moved]
        pcurve = BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0)
        BRep_Builder().UpdateEdge(use, pcurve.Translated(gp_Vec2d(0.6 * shift, 0.8 * shift)), face, 1e-7)
        deviation = max(measure_curve_deviation(one, on) for on, one in sides)
        record = certify_edge(BuiltEdge("end", sides, deviation), AnyJoint())
        assert record.gap == pytest.approx(shift, rel=1e-9)
        assert record.tolerance == 1e-7
        assert record.strays
        assert "tolerance 1.0e-07" in str(record)


@pytest.mark.parametrize("degrees", [0.01, 5.0, 90.0])
def test_a_crease_between_two_faces_that_are_promised_to_be_smooth_is_measured(degrees):
    angle = math.radians(180 - degrees)
    wedge = cq.Workplane().polyline([(0, 0), (10, 0), (10 * math.cos(angle), 10 * math.sin(angle))]).close().extrude(7)
    edge = wedge.edges(cq.selectors.BoxSelector((-0.01, -0.01, -1), (0.01, 0.01, 8))).val()
    record = certify_edge(BuiltEdge("between", make_side_pair(wedge.val(), edge), 1e-9), AnyJoint())
    assert record.angle == pytest.approx(math.radians(degrees), abs=1e-12)
    assert record.gap == 1e-9
    assert (record.kind, record.edge, record.vertex) == ("between", 7, 0)


def test_what_is_measured_is_what_the_finished_edges_have():
    """The seam of a closed blend, on both of its sides."""
    body = cq.Workplane().sphere(9).union(cq.Workplane().circle(4).extrude(15)).val()
    edge = next(e for e in body.Edges() if e.IsClosed() and 5 < e.Center().z < 14)
    result = cqblend.blend_edges(body, edge, 1)
    (face,), (record,) = result.faces, result.certificate.edges
    seams = [use for use in explore_subshapes(face.wrapped, TopAbs_EDGE) if BRep_Tool.IsClosed_s(use, face.wrapped)]
    assert len(seams) == 2
    assert record.gap == max(measure_curve_deviation(use, face.wrapped) for use in seams)
    assert record.tolerance == BRep_Tool.Tolerance_s(seams[0])
