"""Rails around an axis are circles on planes and lines of slope 1 on coaxial faces, where they are so to rounding."""

from __future__ import annotations

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.Geom2d import Geom2d_Circle, Geom2d_Line
from round_solids import KINDS, find_corner, find_rails, is_turned, revolve_outline

import cqblend


@pytest.mark.parametrize("turn", [360.0, 200.0])
@pytest.mark.parametrize("kind", KINDS)
def test_rails_are_circles_and_lines_at_unit_speed(kind, turn):
    if turn < 360 and kind in ("ring", "ball"):
        turn = 360.0
    solid = revolve_outline(kind, 10.0, np.random.default_rng(3), turn).val()
    rails = find_rails(cqblend.blend_edges(solid, find_corner(solid, cq.Vector()), 0.5))
    assert len(rails) >= 2
    for _, face, edge in rails:
        pcurve = BRep_Tool.CurveOnSurface_s(edge.wrapped, face.wrapped, 0.0, 1.0)
        assert isinstance(pcurve, Geom2d_Circle | Geom2d_Line)
        if isinstance(pcurve, Geom2d_Line):
            assert [abs(x) for x in pcurve.Direction().Coord()] == [1.0, 0.0]
        else:
            assert pcurve.Radius() == pytest.approx(edge.radius(), rel=1e-14)


@pytest.mark.parametrize("by", [1e-13, 1e-11, 1e-9, 1e-7])
@pytest.mark.parametrize("tilted", [True, False])
def test_joints_that_are_not_coaxial_are_splines_or_exact(by, tilted):
    """A hole through a ball whose axis misses the centre, and a boss that leans on a plate."""
    if tilted:
        plate = cq.Workplane().box(30, 30, 6, centered=(True, True, False)).val()
        axis = cq.Vector(float(np.sin(by)), 0, float(np.cos(by)))
        solid = plate.fuse(cq.Solid.makeCylinder(5, 10, cq.Vector(0, 0, 5), axis))
        (edge,) = (one for one in solid.Edges() if abs(one.Center().z - 6) < 1e-5 and one.geomType() != "LINE")
    else:
        hole = cq.Solid.makeCylinder(3, 20, cq.Vector(by, 0, -10))
        solid = cq.Solid.makeSphere(8, angleDegrees1=-90).cut(hole)
        (edge,) = (one for one in solid.Edges() if one.Center().z > 1 and one.geomType() != "LINE" and one.IsClosed())
    result = cqblend.blend_edges(solid, edge, 0.8)
    certificate = result.certificate
    assert certificate.valid
    assert certificate.gap < 1e-10
    assert certificate.angle < 3e-11
    if is_turned(result):
        assert by < 1e-9
        assert certificate.gap < 1e-12
        assert certificate.angle <= certificate.proof.angle < 3e-13
