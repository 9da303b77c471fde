"""Rails that leave their face over a smooth edge: inside an edge, all along it, several times, around a rim."""

from collections.abc import Callable

import cadquery as cq
import numpy as np
import pytest
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.GeomAbs import GeomAbs_Cylinder

import cqblend
from cqblend.errors import SizeError, UnsupportedError


def pick_edge(body: cq.Workplane, point: tuple[float, float, float]) -> cq.Workplane:
    """Return the edge of a body that is nearest to a point."""
    return body.newObject([min(body.edges().vals(), key=lambda edge: (edge.Center() - cq.Vector(point)).Length)])


def make_slab(thickness: float, round_: float) -> cq.Workplane:
    """Return a slab with one rounded edge at its top."""
    slab = cq.Workplane().box(20, 12, thickness, centered=(True, True, False))
    return slab.faces(">Z").edges(">Y").fillet(round_)


def make_rounded_plate(thickness: float, round_: float) -> cq.Workplane:
    """Return a plate with rounded corners, and a rounded rim at its top."""
    plate = cq.Workplane().box(24, 18, thickness, centered=(True, True, False)).edges("|Z").fillet(4.5)
    return plate.faces(">Z").edges().fillet(round_)


def make_wedge(low: float, high: float, round_: float) -> cq.Workplane:
    """Return a wedge whose top slopes along x, with the upper edge of its wall at y = -12 rounded."""
    wedge = cq.Workplane("XZ").polyline([(-10, 0), (10, 0), (10, high), (-10, low)]).close().extrude(12)
    return pick_edge(wedge, (0, -12, (low + high) / 2)).fillet(round_)


def check_sound(body: cq.Workplane, blended: cqblend.BlendResult, fillet: cq.Workplane | None = None) -> None:
    """Check a blended body: valid, smooth as OCCT measures it, as large as with OCCT's fillet, fit for later cuts."""
    certificate = blended.certificate
    assert blended.shape.isValid()
    assert max(rail.angle for rail in certificate.rails) < 1e-6
    between = [edge for edge in certificate.edges if edge.kind == "between"]
    assert max((edge.angle for edge in between), default=0.0) < 1e-11
    assert max((edge.gap for edge in between), default=0.0) < 1e-11
    assert cqblend.verify(blended.shape).ok
    if fillet is not None:
        removed = body.val().Volume() - fillet.val().Volume()
        assert body.val().Volume() - blended.shape.Volume() == pytest.approx(removed, rel=1e-2)
    half = cq.Workplane(obj=blended.shape).cut(cq.Workplane().box(60, 60, 60).translate((30.3, 0, 0)))
    assert half.val().isValid()
    assert 0 < half.val().Volume() < blended.shape.Volume()


@pytest.mark.parametrize(("thickness", "round_", "radius"), [(3, 2, 1.4), (3, 2, 1.01), (3, 2, 1.49)])
def test_rail_runs_on_an_earlier_round_all_along(thickness, round_, radius):
    body = make_slab(thickness, round_)
    edge = pick_edge(body, (0, 6, 0))
    blended = cqblend.blend_edges(body, edge, radius)
    (face,) = blended.faces
    surface = BRepAdaptor_Surface(face.wrapped)
    assert surface.GetType() == GeomAbs_Cylinder
    assert surface.Cylinder().Radius() == pytest.approx(radius, abs=1e-12)
    assert len(blended.shape.Faces()) == 7  # the wall between both rounds has gone
    # the ball touches the bottom, and the earlier round from inside
    axis, earlier = surface.Cylinder().Axis().Location(), np.array([6 - round_, thickness - round_])
    centre = np.array([axis.Y(), axis.Z()])
    assert centre[1] == pytest.approx(radius, abs=1e-12)
    assert np.linalg.norm(centre - earlier) == pytest.approx(round_ - radius, abs=1e-12)
    check_sound(body, blended, edge.fillet(radius))
    assert blended.shape.Volume() == pytest.approx(edge.fillet(radius).val().Volume(), rel=1e-8)


def test_rail_runs_exactly_along_the_smooth_edge():
    body = make_slab(3, 2)
    blended = cqblend.blend_edges(body, pick_edge(body, (0, 6, 0)), 1.0)
    assert len(blended.shape.Faces()) == 7
    assert blended.shape.Volume() == pytest.approx(20 * (36 - (1 - np.pi / 4) * (2**2 + 1**2)), rel=1e-12)
    check_sound(body, blended)
    plate = make_rounded_plate(3, 2)
    rim = cqblend.blend_edges(plate, plate.faces("<Z").edges(), 1.0)
    assert len(rim.shape.Faces()) == 18
    check_sound(plate, rim)


def test_rail_passes_from_the_wall_to_the_round_above_it():
    body = make_wedge(2.6, 6, 2)
    edge = pick_edge(body, (0, -12, 0))
    blended = cqblend.blend_edges(body, edge, 1.0)
    assert len(blended.faces) == 2
    check_sound(body, blended, edge.fillet(1.0))
    widths = cqblend.blend_edges(body, edge, width=(1.0, 1.1))
    assert len(widths.faces) == 2
    check_sound(body, widths)


@pytest.mark.parametrize("radius", [1.2, 1.35])
def test_rim_whose_rails_all_run_on_another_rim(radius):
    body = make_rounded_plate(3, 2)
    rim = body.faces("<Z").edges()
    blended = cqblend.blend_edges(body, rim, radius)
    assert len(blended.faces) == 8
    assert len(blended.shape.Faces()) == 18  # top, bottom, two rims: the walls have gone
    check_sound(body, blended, rim.fillet(radius))


def test_rail_leaves_the_wall_and_comes_back_so_that_it_is_in_two_pieces():
    outline = cq.Workplane("XZ").moveTo(-10, 0).threePointArc((0, 1.5), (10, 0)).lineTo(10, 5).lineTo(-10, 5)
    body = outline.close().extrude(12)
    body = pick_edge(body, (0, -12, 5)).fillet(2.2)
    edge = pick_edge(body, (0, -12, 1.5))
    blended = cqblend.blend_edges(body, edge, 1.6)
    assert len(blended.faces) == 3
    walls = [face for face in blended.shape.Faces() if face.geomType() == "PLANE" and face.Center().y < -11.9]
    assert len(walls) == 2
    assert walls[0].Center().x * walls[1].Center().x < 0
    check_sound(body, blended, edge.fillet(1.6))


def test_rim_of_a_sloped_plate_runs_partly_on_the_rim_above():
    body = cq.Workplane().box(24, 18, 10, centered=(True, True, False)).edges("|Z").fillet(4)
    wedge = cq.Workplane("XZ").polyline([(-13, -1), (13, -1), (13, 3.5), (-13, 8)]).close().extrude(40, both=True)
    body = body.cut(wedge).faces(">Z").edges().fillet(2)
    bottom = min(body.faces("not >Z").vals(), key=lambda face: -abs(face.normalAt().z))
    rim = body.newObject(bottom.Edges())
    blended = cqblend.blend_edges(body, rim, 1.1)
    assert len(blended.faces) == 10
    check_sound(body, blended, rim.fillet(1.1))


def make_profile_with_arc() -> cq.Workplane:
    """Return a prism whose profile has a short line between a corner and an arc."""
    bend = 6 * np.array([np.sin(0.5), 1 - np.cos(0.5)]), 6 * np.array([np.sin(1.0), 1 - np.cos(1.0)])
    (x1, y1), (x2, y2) = bend
    profile = cq.Workplane().polyline([(0, 0), (10, 0), (10, 8), (9, 8)])
    return profile.threePointArc((9 - x1, 8 - y1), (9 - x2, 8 - y2)).lineTo(0, 2).close().extrude(15)


def test_rail_runs_on_an_arc_beside_a_narrow_face():
    body = make_profile_with_arc()
    edge = pick_edge(body, (10, 8, 7.5))
    blended = cqblend.blend_edges(body, edge, 1.8)
    check_sound(body, blended, edge.fillet(1.8))
    assert "face" in str(blended.certificate)


@pytest.mark.parametrize(
    ("make_body", "point", "size"),
    [(lambda: make_slab(3, 2), (0, 6, 0), 1.6), (lambda: make_slab(3, 1), (0, 6, 0), 2.1)],
)
def test_no_ball_of_that_size_is_refused_with_the_obstacle(make_body: Callable[[], cq.Workplane], point, size):
    body = make_body()
    with pytest.raises(SizeError, match="face 5 is only"):
        cqblend.blend_edges(body, pick_edge(body, point), size)


def test_rim_of_a_disc_runs_on_the_rim_above():
    body = cq.Workplane().circle(10).extrude(3).faces(">Z").edges().fillet(2)
    rim = body.faces("<Z").edges()
    blended = cqblend.blend_edges(body, rim, 1.4)
    assert len(blended.faces) == 1
    assert len(blended.shape.Faces()) == 4
    check_sound(body, blended, rim.fillet(1.4))


def test_no_corner_beside_a_rail_that_has_left_its_face():
    body = make_slab(3, 2)
    with pytest.raises(UnsupportedError, match="has gone on over a smooth edge where it meets another blend"):
        cqblend.blend_edges(body, [pick_edge(body, (0, 6, 0)).val(), pick_edge(body, (10, 0, 0)).val()], 1.4)


def test_largest_size_reaches_beyond_the_wall():
    body = make_slab(3, 2)
    assert cqblend.max_size(body, pick_edge(body, (0, 6, 0))) == pytest.approx(1.5, rel=0.02)
