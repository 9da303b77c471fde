"""Which sizes fit: balls on bent faces, the floor, the largest size, and what is said where one does not."""

from __future__ import annotations

import math
import re

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Builder
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.gp import gp_Pnt
from places import CASES

import cqblend
from cqblend.blends.contacts.contact_solver import project_to_intersection, solve_ball_contacts, solve_setback_contacts
from cqblend.brep.selection.picked_edges import select_chains
from cqblend.brep.step_files import read_step
from cqblend.errors import GeometryError, InputError, SelectionError, SizeError

V = cq.Vector
BOX = cq.Solid.makeBox(30, 20, 10)
UPRIGHT = BOX.edges("|Z and >X and >Y")


def joint_of(body: cq.Shape, edge: cq.Edge):
    return select_chains(body.wrapped, [edge.wrapped], None, None, follow=False).networks[0][0].chain.cells[0]


def stations_of(joint, t: np.ndarray):
    return project_to_intersection(joint.sides, joint.locate_stations(t), joint.spine.length)


def wavy() -> tuple[cq.Shape, cq.Edge]:
    """Return a block with a top that waves strongly, and its edge at the front."""
    places = np.linspace(-20, 20, 12)

    def height(x: float, y: float) -> float:
        return 2.73 * math.sin(0.156 * x) + 1.44 * math.cos(0.435 * y) + 0.32 * math.sin(0.469 * (x + y))

    points = [[V(x, y, height(x, y)) for y in places] for x in places]
    top = cq.Face.makeSplineApprox(points, tol=1e-3, minDeg=3, maxDeg=5)
    parts = cq.Solid.makeBox(32, 32, 40, V(-16, -16, -20)).split(top).Solids()
    body = min(parts, key=lambda part: part.Center().z)
    (front,) = (edge for edge in body.Edges() if edge.Center().y < -15.9 and edge.geomType() == "BSPLINE")
    return body, front


def distance(point: np.ndarray, face) -> float:
    vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*point.tolist())).Vertex()
    return BRepExtrema_DistShapeShape(vertex, face).Value()


# Balls.


@pytest.mark.parametrize("radius", [1.0, 3.0, 5.0])
def test_balls_leap_over_dents_and_touch_both_faces_as_the_kernel_measures_it(radius):
    """From the tangents at the edge, the ball of 5 mm is not found at t = 0.06."""
    body, edge = wavy()
    joint = joint_of(body, edge)
    contacts = solve_ball_contacts(joint.sides, stations_of(joint, np.linspace(0.02, 0.98, 25)), radius)
    for i in range(24):  # the last one is past the end of the face
        centres = []
        for side, uv in zip(joint.sides, contacts.uv, strict=True):
            inwards = -side.outward * side.primary.evaluate_normals(uv[[i]])[0]
            centres.append(side.primary.jet(uv[[i]])[0, 0] + radius * inwards)
        assert np.linalg.norm(centres[0] - centres[1]) < 1e-8
        for side in joint.sides:
            assert distance(centres[0], side.face) == pytest.approx(radius, abs=1e-6)


def test_a_station_alone_is_found_as_among_others():
    body, edge = wavy()
    joint = joint_of(body, edge)
    t = np.linspace(0.02, 0.98, 25)
    together = solve_ball_contacts(joint.sides, stations_of(joint, t), 1.6)
    for i in (3, 7, 12, 20):
        alone = solve_ball_contacts(joint.sides, stations_of(joint, t[[i]]), 1.6)
        for one, all_of_them in zip(alone.uv, together.uv, strict=True):
            assert np.abs(one[0] - all_of_them[i]).max() < 1e-9


def test_widths_are_found_on_a_wavy_face():
    body, edge = wavy()
    joint = joint_of(body, edge)
    stations = stations_of(joint, np.linspace(0.1, 0.9, 9))
    contacts = solve_setback_contacts(joint.sides, stations, (6.0, 6.0))
    for side, uv in zip(joint.sides, contacts.uv, strict=True):
        offset = side.primary.jet(uv)[0] - stations.points
        assert np.abs(np.linalg.norm(offset, axis=1) - 6).max() < 1e-9


@pytest.mark.skipif(not CASES.is_dir(), reason="the STEP cases are not at hand")
def test_balls_on_a_real_part_where_the_first_guess_goes_astray():
    """Found by a search with OCCT's distances alone at all of seven stations; the solver said "singular"."""
    shape = cq.Shape.cast(read_step(CASES / "f360__44647_d83249a9_0.stp"))
    for number, radius in ((347, 4.819272673), (372, 3.632961206), (400, 3.632961206)):
        joint = joint_of(shape, shape.Edges()[number - 1])
        contacts = solve_ball_contacts(joint.sides, stations_of(joint, (np.arange(7) + 0.5) / 7), radius)
        inwards = (-1.0 if joint.is_convex else 1.0) * joint.sides[0].outward
        centres = joint.primaries[0].jet(contacts.uv[0])[0]
        centres = centres + radius * inwards * joint.primaries[0].evaluate_normals(contacts.uv[0])
        for centre in centres:
            for side in joint.sides:
                assert distance(centre, side.face) == pytest.approx(radius, rel=1e-6)


# The floor.


@pytest.mark.parametrize("ratio", [9.9, 7.5, 3.1])
def test_sizes_of_a_few_tolerances_are_built(ratio):
    body = cq.Solid.makeBox(30, 20, 10)
    edge = body.edges("|Z and >X and >Y")
    BRep_Builder().UpdateEdge(edge.wrapped, 0.25)
    result = cqblend.blend_edges(body, edge, 0.25 * ratio)
    assert result.shape.isValid()
    assert body.Volume() - result.shape.Volume() == pytest.approx(
        (1 - math.pi / 4) * 10 * (0.25 * ratio) ** 2, rel=2e-3
    )


def test_sizes_within_the_tolerance_are_refused_with_one_that_works():
    body = cq.Solid.makeBox(30, 20, 10)
    edge = body.edges("|Z and >X and >Y")
    BRep_Builder().UpdateEdge(edge.wrapped, 0.25)
    with pytest.raises(
        SizeError, match=r"edge \d+: size 0.6 is too small.*three times.*0\.25.*at least 0\.757"
    ) as caught:
        cqblend.blend_edges(body, edge, 0.6)
    assert "at most" not in str(caught.value)
    assert cqblend.blend_edges(body, edge, 0.758).shape.isValid()


# The largest size.


def boss() -> tuple[cq.Workplane, cq.Workplane]:
    body = cq.Workplane().box(40, 40, 8).faces(">Z").workplane().circle(8).extrude(20)
    return body, body.faces(">Z[-2]").edges("%CIRCLE")


def drilled() -> tuple[cq.Workplane, cq.Workplane]:
    body = cq.Workplane().box(40, 40, 20).faces(">Z").workplane().pushPoints([(10, 0)]).hole(3)
    return body, body.edges("|Y and >X and >Z")


def cylinder() -> tuple[cq.Workplane, cq.Workplane]:
    body = cq.Workplane().circle(8).extrude(20)
    return body, body.edges(">Z")


def ell() -> tuple[cq.Shape, list[cq.Edge]]:
    """Return two boxes that make an L of walls of 2.2, not cleaned, and its outer edge."""
    one, two = cq.Workplane().box(12, 12, 2.2, centered=False), cq.Workplane().box(12, 2.2, 12, centered=False)
    body = one.union(two, clean=False).val()
    outer = [edge for edge in body.Edges() if edge.Length() > 11 and (edge.Center() - V(6, 0, 0)).Length < 1e-6]
    return body, outer


LIMITS = {
    "box, by width": (lambda: (BOX, UPRIGHT), "width", 20),
    "two edges, half the side between them": (lambda: (BOX, BOX.edges("|Z and >X")), "radius", 10),
    "boss, the plate's margin": (boss, "radius", 12),
    "rim of a cylinder, its radius": (cylinder, "radius", 8),
    "before a hole": (drilled, "radius", 8.5),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LIMITS)
def test_largest_sizes_are_those_of_closed_forms(name):
    make, by, limit = LIMITS[name]
    body, edges = make()
    largest = cqblend.max_size(body, edges, by=by)
    assert 0.98 * limit < largest <= limit * (1 + 1e-9)
    assert cqblend.blend_edges(body, edges, **{by: 0.98 * largest}).shape.isValid()
    with pytest.raises(cqblend.CqblendError):
        cqblend.blend_edges(body, edges, **{by: 1.05 * largest})


def test_the_largest_size_comes_as_near_as_its_tolerance():
    """Around the outer edge of an L, the ball ends at the inner corner, of which the two faces know nothing."""
    body, edges = ell()
    limit = 2.2 * math.sqrt(2) / (math.sqrt(2) - 1)
    largest = cqblend.max_size(body, edges, tolerance=0.003)
    assert 0.997 * limit < largest <= limit * (1 + 1e-9)
    assert cqblend.blend_edges(body, edges, 0.997 * largest).shape.isValid()
    with pytest.raises(cqblend.CqblendError):
        cqblend.blend_edges(body, edges, 1.005 * largest)


def test_options_are_those_of_blends():
    """With a bulge of 9 the sections loop at any size; the error says so."""
    with pytest.raises(GeometryError, match=r"no size was found that works.*edge 7: .*turns back"):
        cqblend.max_size(BOX, UPRIGHT, bulge=9, first=BOX.faces(">X"))


def test_largest_sizes_in_every_library():
    b3d = pytest.importorskip("build123d")
    solid = b3d.Box(30, 20, 10)
    edge = solid.edges().filter_by(b3d.Axis.Z)[0]
    for shape, edges in ((solid, edge), (BOX.wrapped, UPRIGHT.wrapped)):
        assert 10 < cqblend.max_size(shape, edges, tolerance=0.5) <= 20


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"by": "diameter"}, "by must be 'radius' or 'width'"),
        ({"by": None}, "by must be"),
        ({"tolerance": 0}, "tolerance must be above 0"),
        ({"tolerance": 1}, "from 0.001 to 0.5"),
        ({"tolerance": math.nan}, "finite"),
        ({"radius": 2}, "radius is a size, which max_size looks for"),
        ({"a": 2}, "a is a size"),
        ({"section": "potential"}, "potential"),
        ({"sharpness": 2}, "sharpness is no option of blend_edges"),
        ({"bulge": "x"}, "bulge must be a number"),
        ({"first": 3}, "first must be a face"),
    ],
)
def test_arguments_of_max_size_are_checked(options, text):
    with pytest.raises(InputError, match=text):
        cqblend.max_size(BOX, UPRIGHT, **options)


def test_what_no_size_mends_is_told_as_it_is():
    with pytest.raises(SelectionError, match="does not belong"):
        cqblend.max_size(BOX, cq.Solid.makeBox(1, 1, 1).Edges()[0])


# What is said.


def refused(body, edges, **options) -> str:
    with pytest.raises(SizeError) as caught:
        cqblend.blend_edges(body, edges, **options)
    return str(caught.value)


def tray() -> cq.Shape:
    return cq.Workplane().box(46, 38, 18).faces("+Z").shell(-1, kind="intersection").val()


def test_a_thin_wall_is_told_and_less_than_half_of_it_is_blended():
    for radius in (1.0, 1.5):
        body = tray()
        text = refused(body, body.Edges(), radius=radius)
        assert re.search(r"the wall between face \d+ and face \d+ is only 1 thick", text)
        assert "max_size" in text
    body = tray()
    result = cqblend.blend_edges(body, body.Edges(), 0.4)
    assert result.shape.isValid()
    assert len(result.faces) == 24 + 16
    assert result.certificate.coverage == 1


def test_the_wall_of_a_tube_is_told_with_its_faces():
    tube = cq.Workplane().circle(10).circle(9).extrude(20).val()
    rims = [edge for edge in tube.Edges() if abs(edge.Center().z - 20) < 1e-6]
    kinds = [face.geomType() for face in tube.Faces()]
    numbers = re.search(r"the wall between face (\d+) and face (\d+) is only 1 thick", refused(tube, rims, radius=1.2))
    assert [kinds[int(number) - 1] for number in numbers.groups()] == ["CYLINDER", "CYLINDER"]


def test_a_narrow_face_is_told_with_the_edge_that_bounds_it():
    rib = cq.Workplane().box(60, 40, 5).union(cq.Workplane().box(60, 2, 20).translate((0, 0, 12.5))).val()
    foot = min(rib.Edges(), key=lambda edge: (edge.Center() - V(0, 1, 2.5)).Length)
    found = re.search(r"face (\d+) is only 19 wide there, up to edge (\d+)", refused(rib, foot, radius=19.5))
    assert (rib.Edges()[int(found[2]) - 1].Center() - V(0, 20, 2.5)).Length < 1e-6
    assert abs(rib.Faces()[int(found[1]) - 1].Center().z - 2.5) < 1e-6


def test_a_size_that_the_faces_would_let_pass_points_to_what_finds_one():
    body, outer = ell()
    text = refused(body, outer, radius=8)
    assert "less than 8 may fit: cqblend.max_size finds what does" in text


def test_rails_that_leave_and_come_back_are_seen():
    """A hole halfway along is on the rail's way, and none of its ends, nor the middle station alone."""
    body = cq.Workplane().box(60, 40, 20).faces(">Z").workplane().pushPoints([(-10, 10)]).hole(4)
    edge = body.edges("|X and >Y and >Z")
    assert "is only" in refused(body, edge, radius=10)
    assert cqblend.blend_edges(body, edge, 7.9).shape.isValid()


def test_a_pair_of_radii_is_told_what_it_would_mean():
    with pytest.raises(
        InputError, match=r"radius must be a number, not \(1, 3\).*one.*width=\(1, 3\).*varies along the edge"
    ):
        cqblend.blend_edges(BOX, UPRIGHT, (1, 3))
    assert cqblend.blend_edges(BOX, UPRIGHT, width=(1, 3)).certificate.valid


def test_the_largest_size_next_to_the_least():
    """A strip 1 wide, along an edge that is drawn to .25: from .75 on sizes count, and at 1 the strip ends."""
    body = cq.Solid.makeBox(1, 20, 10)
    (edge,) = (one for one in body.Edges() if (one.Center() - V(1, 10, 10)).Length < 1e-6)
    BRep_Builder().UpdateEdge(edge.wrapped, 0.25)
    largest = cqblend.max_size(body, edge)
    assert 0.98 < largest <= 1 + 1e-9
    assert cqblend.blend_edges(body, edge, 0.98 * largest).shape.isValid()
    BRep_Builder().UpdateEdge(edge.wrapped, 0.4)
    with pytest.raises(
        SizeError, match=r"no size was found that works; with the smallest that was tried, .*edge \d+: size"
    ):
        cqblend.max_size(body, edge)


def test_a_face_is_as_wide_as_it_is_at_its_seam():
    disc = cq.Workplane().circle(10).extrude(5).val()
    rim = next(e for e in disc.Edges() if e.geomType() == "CIRCLE")
    with pytest.raises(SizeError, match=r"face \d reaches only 5 there.*at most about 4.99 fits"):
        cqblend.blend_edges(disc, rim, 5.2)


def test_widths_beyond_the_end_of_a_surface_are_errors_of_size():
    """Newton's steps leave every number there is on some of these ways; that is no error of input."""
    ball = cq.Solid.makeSphere(10, angleDegrees1=-90).transformGeometry(
        cq.Matrix([[1.5, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0.7, 4]])
    )
    body = cq.Workplane().box(50, 40, 8).union(cq.Workplane(ball)).val().Solids()[0]
    rim = max((e for e in body.Edges() if abs(e.Center().z - 4) < 1e-6), key=lambda e: -abs(e.Length() - 75))
    for width in (20, 27, 45):
        with pytest.raises(SizeError):
            cqblend.blend_edges(body, rim, width=width)
