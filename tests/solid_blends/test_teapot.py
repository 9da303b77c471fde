"""The Utah teapot: a spout blended onto its body, exactly smooth, out to STEP and cut in two."""

from __future__ import annotations

import math
from functools import cache

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.GCPnts import GCPnts_UniformAbscissa
from OCP.GeomAbs import GeomAbs_C1
from OCP.gp import gp_Dir, gp_Pln, gp_Pnt
from OCP.GProp import GProp_GProps
from spline_witness import along_edge

import cqblend
from cqblend import demo, teapot
from cqblend.brep.step_files import read_step, write_step
from cqblend.errors import GeometryError

STATIONS = 1000
KNOT_LINE = 0.9
"""Height at which the curvature of the body jumps: the patches above and below meet there with C1 only."""


@cache
def pot():
    return demo.sharp()


@cache
def blended():
    return demo.blended(pot())


def sides(edge):
    return edge.ancestors(pot(), "Face").Faces()


def valid(shape) -> bool:
    return BRepCheck_Analyzer(shape.wrapped, True, False, True).IsValid()


def volume(shape) -> float:
    """Return OCCT's volume by Gauss-Kronrod integration; its default is off by 1e-3 on this body."""
    properties = GProp_GProps()
    plane = gp_Pln(gp_Pnt(0.1, 0.2, 1.1), gp_Dir(0.3826, 0.5217, 0.7625))
    BRepGProp.VolumePropertiesGK_s(shape.wrapped, properties, plane, 1e-8, False, True, False, False, False)
    return properties.Mass()


def rails(shape, blend):
    """Return the edges between the blend and its neighbours, with these."""
    found = []
    for edge in blend.Edges():
        others = [f for f in edge.ancestors(shape, "Face").Faces() if not f.isSame(blend)]
        if others:
            found.append((edge, others[0]))
    return found


def along(edge, count: int) -> list[float]:
    """Return edge parameters at equal distances in space."""
    curve = BRepAdaptor_Curve(edge.wrapped)
    points = GCPnts_UniformAbscissa(curve, count, 1e-9)
    assert points.IsDone()
    return [points.Parameter(i) for i in range(1, points.NbPoints() + 1)]


def gap_and_angle(shape, blend) -> tuple[float, float]:
    gap = angle = 0.0
    for edge, other in rails(shape, blend):
        parameters = along(edge, STATIONS)
        (p, n), (q, m) = (along_edge(face, edge, parameters) for face in (blend, other))
        gap = max(gap, float(np.linalg.norm(p - q, axis=1).max()))
        turn = np.arctan2(np.linalg.norm(np.cross(n, m), axis=1), np.abs((n * m).sum(1)))
        angle = max(angle, float(turn.max()))
    return gap, angle


# The solids.


def test_body_is_one_solid_of_a_closed_c1_spline_a_bottom_and_a_planar_rim():
    body = teapot.body()
    assert valid(body)
    assert body.Volume() > 0
    kinds = sorted(face.geomType() for face in body.Faces())
    assert kinds == ["BSPLINE", "BSPLINE", "PLANE"]
    side = max((f for f in body.Faces() if f.geomType() == "BSPLINE"), key=lambda f: f.BoundingBox().zlen)
    surface = BRep_Tool.Surface_s(side.wrapped)
    assert surface.IsUClosed()
    assert surface.Continuity() == GeomAbs_C1
    seam = surface.UIso(surface.Bounds()[0]).Value(0.5)
    assert seam.X() < -1
    assert abs(seam.Y()) < 1e-12  # at -x, away from the spout


def test_spout_is_one_solid_with_its_lip_and_a_planar_tip():
    spout = teapot.spout()
    assert valid(spout)
    assert spout.Volume() > 0
    assert sorted(face.geomType() for face in spout.Faces()) == ["BSPLINE", "BSPLINE", "PLANE", "PLANE"]
    for face in spout.Faces():
        if face.geomType() == "BSPLINE":
            assert BRep_Tool.Surface_s(face.wrapped).IsUClosed()


def test_surfaces_pass_through_newells_points():
    """Corners of the patches as published in 1975."""
    corners = {
        (1.4, 0.0, 2.4),
        (1.75, 0.0, 1.875),
        (2.0, 0.0, 0.9),
        (1.5, 0.0, 0.15),
        (1.7, 0.0, 1.425),
        (2.7, 0.0, 2.4),
        (3.3, 0.0, 2.4),
    }
    published = {tuple(np.round(pole, 9).tolist()) for pole in teapot.poles().reshape(-1, 3)}
    assert {c for c in corners if c not in published} <= {(1.75, 0.0, 1.875)}
    assert teapot.poles().shape == (32, 4, 4, 3)


def test_fused_pot_is_one_solid():
    assert len(pot().Solids()) == 1
    assert valid(pot())


# The blend.


def test_blend_is_exact_in_form_of_the_stated_width_and_valid():
    result = blended()
    certificate = result.certificate
    assert certificate.form == "exact"
    assert certificate.degree == (18, 3)
    assert valid(result.shape)
    assert certificate.valid
    assert certificate.method == "wire substitution"
    assert certificate.tolerance <= 5e-7
    low, high = certificate.width
    assert demo.WIDTH < low < high < 2 * demo.WIDTH
    assert volume(result.shape) > volume(pot()) * (1 + 1e-5)
    assert len(result.shape.Faces()) == len(pot().Faces()) + 1


def test_rails_lie_at_the_width_from_the_old_edge():
    kept = [edge.Center() for edge in blended().shape.Edges()]
    (old,) = (e for e in pot().Edges() if all((e.Center() - c).Length > 1e-3 for c in kept) and len(sides(e)) == 2)
    (blend,) = blended().faces
    for edge, _ in rails(blended().shape, blend):
        for t in np.linspace(0.02, 0.98, 9):
            distance = cq.Vertex.makeVertex(*edge.positionAt(t).toTuple()).distance(old)
            assert distance <= demo.WIDTH * (1 + 1e-4)
            assert distance > 0.8 * demo.WIDTH


def test_gap_and_angle_at_a_thousand_equidistant_points_along_both_rails():
    (blend,) = blended().faces
    gap, angle = gap_and_angle(blended().shape, blend)
    assert gap <= 1e-10
    assert angle <= 1e-10
    assert blended().certificate.gap <= 1e-10
    assert blended().certificate.angle <= 1e-10


def crease(face) -> tuple[float, float]:
    """The largest angle between the normals beside the blend's own knots, and the height of its section's end."""
    surface = BRep_Tool.Surface_s(face.wrapped)
    worst, height = 0.0, math.nan
    for k in range(surface.FirstUKnotIndex() + 1, surface.LastUKnotIndex()):
        u = surface.UKnot(k)
        for v in np.linspace(0.02, 0.98, 25).tolist():
            sides = []
            for du in (-1e-9, 1e-9):
                n = np.cross(surface.DN(u + du, v, 1, 0).Coord(), surface.DN(u + du, v, 0, 1).Coord())
                sides.append(n / np.linalg.norm(n))
            angle = math.atan2(np.linalg.norm(np.cross(*sides)), sides[0] @ sides[1])
            if angle > worst:
                worst = angle
                height = min((surface.Value(u, end).Z() for end in (0.0, 1.0)), key=lambda z: abs(z - KNOT_LINE))
    return worst, height


def test_steering_leaves_no_crease_where_the_bodys_curvature_jumps():
    """At z = .9, by 18 degrees; what is seen beside knots then is the step off them, times the blend's curvature."""
    assert blended().certificate.inner_crease <= 1e-9
    assert crease(blended().faces[0])[0] < 1e-6
    assert 0.2 < blended().certificate.direction < math.radians(20)


def test_without_steering_there_is_a_crease_and_it_is_reported():
    sharp = pot()
    straight = cqblend.blend_edges(sharp, demo.joint(sharp), width=demo.WIDTH, form="exact", steer=0, crease=0.1)
    worst, height = crease(straight.faces[0])
    assert straight.certificate.inner_crease == pytest.approx(worst, rel=0.05)
    assert math.radians(0.01) < worst < math.radians(2)
    assert abs(height - KNOT_LINE) < 1e-6
    assert straight.certificate.direction < 1e-3


def test_curvature_is_continuous_if_asked_and_g3_is_refused_by_the_knot_line():
    sharp = pot()
    smooth = cqblend.blend_edges(sharp, demo.joint(sharp), width=demo.WIDTH, form="exact", continuity="G2")
    assert valid(smooth.shape)
    assert smooth.certificate.curvature_jump < 1e-8
    assert smooth.certificate.inner_crease < 1e-9
    with pytest.raises(GeometryError, match="G3 needs surfaces that are C3"):
        cqblend.blend_edges(sharp, demo.joint(sharp), width=demo.WIDTH, continuity="G3")


def test_verification_finds_nothing():
    found = cqblend.verify(blended().shape, blended().faces)
    assert found.ok, found.problems


def test_step_read_back_is_valid_and_as_smooth(tmp_path):
    path = tmp_path / "teapot.step"
    write_step(blended().shape.wrapped, path)
    again = cq.Shape.cast(read_step(path))
    assert valid(again)
    assert len(again.Faces()) == len(blended().shape.Faces())
    assert volume(again) == pytest.approx(volume(blended().shape), rel=1e-9)
    wanted = blended().faces[0].Center()
    blend = min(again.Faces(), key=lambda face: (face.Center() - wanted).Length)
    gap, angle = gap_and_angle(again, blend)
    assert gap <= 1e-10
    assert angle <= 1e-10
    for edge, _ in rails(again, blend):
        found = cqblend.continuity(again, edge)
        assert found.angle <= 2 * blended().certificate.angle + 1e-12
        assert found.tolerance <= 5e-7


def test_cut_with_a_box_through_the_blend_is_valid():
    shape, (blend,) = blended().shape, blended().faces
    middle = blend.Center()
    box = cq.Solid.makeBox(4, 4, 6).translate(cq.Vector(middle.x - 2, 0.05, middle.z - 3))
    outside, inside = shape.cut(box), shape.intersect(box)
    assert valid(outside)
    assert valid(inside)
    whole, out, within = (volume(one) for one in (shape, outside, inside))
    assert min(out, within) > 0.1 * whole
    assert out + within == pytest.approx(whole, rel=1e-6)
