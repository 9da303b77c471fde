"""Run-outs: a blend by a ball ends in a point where the faces become tangent to each other at the end of an edge."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from chained_solids import fading_block, gently_fading_block
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.GeomLProp import GeomLProp_SLProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_REVERSED
from places import CASES

import cqblend
from cqblend.brep.step_files import read_step
from cqblend.brep.topology import ShapeIndex
from cqblend.errors import TopologyError

V = cq.Vector


def ridge(body: cq.Shape) -> cq.Edge:
    return min(body.Edges(), key=lambda edge: (edge.Center() - V(10, 0, 0)).Length)


def locate_centres(rail: cq.Edge, face: cq.Face, radius: float, count: int = 40) -> np.ndarray:
    """Return the centres (n, 3) of the balls that touch a face from inside at points of an edge, by OCCT."""
    curve, surface = BRepAdaptor_Curve(rail.wrapped), BRep_Tool.Surface_s(face.wrapped)
    low, high = curve.FirstParameter(), curve.LastParameter()
    centres = []
    for t in np.linspace(low, high, count):
        foot = GeomAPI_ProjectPointOnSurf(curve.Value(t), surface)
        assert foot.LowerDistance() < 1e-7
        normal = GeomLProp_SLProps(surface, *foot.LowerDistanceParameters(), 1, 1e-9).Normal()
        sign = -1 if face.wrapped.Orientation() == TopAbs_REVERSED else 1
        centres.append(np.array(curve.Value(t).Coord()) - sign * radius * np.array(normal.Coord()))
    return np.array(centres)


def test_a_run_out_ends_in_the_vertex_and_is_rolled_by_a_ball():
    body, radius = fading_block(), 3.0
    result = cqblend.blend_edges(body, ridge(body), radius)
    assert result.shape.isValid()
    assert cqblend.verify(result.shape, result.faces).ok
    certificate = result.certificate
    assert [end.kind for end in certificate.ends] in (["point", "natural"], ["natural", "point"])
    assert certificate.coverage == 1
    assert certificate.angle < 1e-10
    (blend,) = result.faces
    assert min((vertex.Center() - V(0, 0, 0)).Length for vertex in blend.Vertices()) < 1e-7
    sides = [face for face in result.shape.Faces() if face.Area() > 150 and face.normalAt().z > 0.5]
    assert len(sides) == 2
    tracks = []
    for side in sides:
        (rail,) = (edge for edge in blend.Edges() if any(edge.isSame(other) for other in side.Edges()))
        tracks.append(locate_centres(rail, side, radius))
    one, other = (track[np.argsort(track[:, 0])] for track in tracks)
    inside = one[one[:, 0] < 19]
    on_other = np.column_stack([np.interp(inside[:, 0], other[:, 0], other[:, k]) for k in range(3)])
    assert np.linalg.norm(inside - on_other, axis=1).max() < 1e-4 * radius


@pytest.mark.parametrize(
    "options",
    [
        {"radius": 1, "continuity": "G2"},
        {"radius": 1, "section": "pde"},
        {"radius": 1, "form": "compact"},
        {"radius": 1, "tangents": "chord", "bulge": 1.2},
        {"radius": cqblend.linear(0.5, 1)},
        {"radius": cqblend.linear(0, 1)},
    ],
)
def test_run_outs_with_all_sorts_of_options(options):
    body = fading_block()
    result = cqblend.blend_edges(body, ridge(body), **options)
    assert cqblend.verify(result.shape, result.faces).ok
    assert "point" in [end.kind for end in result.certificate.ends]


def test_a_run_out_at_which_the_angle_fades_with_its_slope():
    body = gently_fading_block()
    assert body.isValid()
    result = cqblend.blend_edges(body, ridge(body), 3)
    assert cqblend.verify(result.shape, result.faces).ok
    assert sorted(end.kind for end in result.certificate.ends) == ["natural", "point"]
    assert result.certificate.coverage == 1
    assert result.certificate.angle < 1e-5


def test_flat_ends_are_made_where_they_are_asked_for():
    body = fading_block()
    result = cqblend.blend_edges(body, ridge(body), 1, ends="flat")
    assert [end.kind for end in result.certificate.ends] == ["flat", "flat"]
    assert 0.9 < result.certificate.coverage < 1


def test_a_width_that_does_not_fade_has_no_point_to_end_in():
    body = fading_block()
    with pytest.raises(TopologyError, match="fades out"):
        cqblend.blend_edges(body, ridge(body), width=1)


@pytest.mark.skipif(not CASES.is_dir(), reason="the STEP cases are not at hand")
@pytest.mark.parametrize(
    ("name", "edge", "radius", "cells"),
    [
        ("nist__nist_ctc_01_asme1_ap242-e1.stp", 225, 1.0, 2),
        ("nist__nist_ctc_01_asme1_ap242-e1.stp", 89, 1.0, 3),
        ("nist__nist_ctc_05_asme1_ap242-e1.stp", 220, 0.355, 3),
    ],
)
def test_chains_of_real_parts_that_run_out(name, edge, radius, cells):
    shape = read_step(CASES / name)
    result = cqblend.blend_edges(shape, ShapeIndex(shape, TopAbs_EDGE)[edge], radius)
    certificate = result.certificate
    assert len(result.faces) == len(certificate.blended) == cells
    assert sorted(end.kind for end in certificate.ends) == ["natural", "point"]
    assert certificate.coverage == 1
    assert certificate.angle < 1e-10
    assert max(one.angle for one in certificate.edges if one.kind == "between") < 1e-8
    assert certificate.valid
