"""Bridges as users make them: bodies joined at a distance, handles, openings; what OCCT says of the results."""

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepGProp import BRepGProp
from OCP.GProp import GProp_GProps

import cqblend
from cqblend.errors import CqblendError, GeometryError, InputError, SelectionError, TopologyError


def pillar(radius, x=0.0, y=0.0, z=0.0, height=6.0):
    return cq.Workplane(origin=(x, y, z)).circle(radius).extrude(height)


def block(x=0.0, y=0.0, z=0.0, size=(10, 6, 4)):
    return cq.Workplane(origin=(x, y, z)).box(*size)


def ring(radius, point, direction=(0, 0, 1)):
    return cq.Wire.makeCircle(radius, cq.Vector(*point), cq.Vector(*direction))


def check(result, *, faces, angle=1e-10):
    """The result is one solid, valid, also after STEP and a later cut, and smooth by OCCT's measure."""
    assert result.shape.ShapeType() == "Solid"
    assert result.certificate.valid
    assert len(result.faces) == faces
    assert result.certificate.angle <= angle
    assert result.certificate.gap <= 1e-10
    assert cqblend.verify(result.shape, result.faces).ok
    for face in result.faces:
        assert any(face.isSame(own) for own in result.shape.Faces())


def measure(shape):
    """Volume, and the first two coordinates of the centre, by OCCT's adaptive integration."""
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape.wrapped, properties, 1e-9)
    centre = properties.CentreOfMass()
    return properties.Mass(), [centre.X(), centre.Y()]


def measured_angle(result):
    """The largest angle between a bridge and the faces it starts from, edge by edge, by OCCT's evaluation."""
    angles = []
    for edge in result.shape.Edges():
        beside = [face for face in result.shape.Faces() if any(edge.isSame(one) for one in face.Edges())]
        of_bridge = [any(face.isSame(own) for own in result.faces) for face in beside]
        if sorted(of_bridge) == [False, True]:
            angles.append(cqblend.continuity(result.shape, edge).angle)
    assert angles
    return max(angles)


def test_coaxial_pillars_are_joined_by_a_surface_of_revolution():
    low, high = pillar(5), pillar(3, z=20)
    result = cqblend.bridge([low.val(), high.val()], low.faces(">Z"), high.faces("<Z"))
    check(result, faces=1)
    (face,) = result.faces
    assert face.geomType() == "REVOLUTION"
    # Pappus: the volume of the cubic profile (r, z) with its equal lengths L of cross derivatives, by Gauss's rule
    bridge_volume = result.shape.Volume() - low.val().Volume() - high.val().Volume()
    v, weights = np.polynomial.legendre.leggauss(12)
    v, weights = (v + 1) / 2, weights / 2
    lengths = [edge.tangentAt(0).Length for edge in face.Edges() if edge.geomType() != "CIRCLE"]
    assert lengths
    radius = 5 + (3 - 5) * (3 * v**2 - 2 * v**3)
    chord = np.hypot(2, 14)
    length = 2 * chord / np.hypot(1 + 14 / chord, 0.5)
    slope = 14 * (6 * v - 6 * v**2) + length * (1 - 6 * v + 6 * v**2)
    assert bridge_volume == pytest.approx(np.pi * (radius**2 * slope) @ weights, rel=1e-9)


def test_pillars_beside_each_other_at_any_continuity():
    low, high = pillar(5), pillar(3, x=6, z=20)
    for continuity, jump in (("G1", np.inf), ("G2", 1e-10), (("G1", "G2"), np.inf)):
        result = cqblend.bridge([low.val(), high.val()], low.faces(">Z"), high.faces("<Z"), continuity=continuity)
        check(result, faces=1)
        assert measured_angle(result) < 1e-10
        assert result.certificate.curvature_jump < jump
        if continuity == ("G1", "G2"):
            assert result.certificate.rails[1].curvature_jump < 1e-10


def test_equations_fill_a_bridge():
    low, high = pillar(5), pillar(3, x=6, z=20)
    result = cqblend.bridge([low.val(), high.val()], low.faces(">Z"), high.faces("<Z"), section="pde")
    check(result, faces=1)
    assert result.certificate.rails[0].section == "pde"
    assert result.certificate.residual is not None


def test_boxes_are_joined_corner_to_corner():
    """The four faces of a prism that is sheared along a curve: Cavalieri gives its volume."""
    low, high = block(), block(x=2, y=1, z=20)
    result = cqblend.bridge([low.val(), high.val()], low.faces(">Z"), high.faces("<Z"))
    check(result, faces=4)
    assert result.shape.Volume() == pytest.approx(60 * 24, rel=1e-12)


@pytest.mark.parametrize(("sides", "faces"), [(3, 5), (4, 4), (8, 8)])
def test_corners_of_either_rail_cut_the_bridge(sides, faces):
    low, high = block(), cq.Workplane(origin=(0, 0, 15)).polygon(sides, 6).extrude(4)
    result = cqblend.bridge([low.val(), high.val()], low.faces(">Z"), high.faces("<Z"))
    check(result, faces=faces)


def test_rounded_prisms_are_joined_smoothly_from_cell_to_cell():
    low = cq.Workplane().rect(10, 6).extrude(4).edges("|Z").fillet(1.5)
    high = cq.Workplane(origin=(3, 1, 20)).rect(8, 8).extrude(4).edges("|Z").fillet(1)
    result = cqblend.bridge([low.val(), high.val()], low.faces(">Z"), high.faces("<Z"))
    check(result, faces=8)
    between = [edge.angle for edge in result.certificate.edges if edge.kind == "between"]
    assert len(between) == 8
    assert max(between) < 1e-10


def test_openings_keep_their_faces():
    low, high = block(), block(x=2, y=1, z=20)
    floor, roof = low.faces(">Z").val(), high.faces("<Z").val()
    result = cqblend.bridge([low.val(), high.val()], (floor, ring(2, (0, 0, 2))), (roof, ring(2, (2, 1, 18))))
    check(result, faces=1)
    assert measured_angle(result) < 1e-10
    holes = [face for face in result.shape.Faces() if face.innerWires()]
    assert sorted(face.Area() for face in holes) == pytest.approx([60 - 4 * np.pi] * 2)


@pytest.mark.parametrize(
    ("outline", "faces", "continuity"), [("rectangle", 4, "G1"), ("rounded", 1, "G2"), ("triangle", 4, "G2")]
)
def test_openings_of_any_outline_have_room_for_what_leaves_into_them(outline, faces, continuity):
    low, high = block(size=(20, 16, 4)), block(x=2, y=1, z=20, size=(20, 16, 4))
    sketch = cq.Workplane(origin=(0, 0, 2))
    prism = sketch.polygon(3, 8).extrude(1) if outline == "triangle" else sketch.rect(8, 6).extrude(1)
    roof = cq.Workplane(origin=(0, 0, 17)).rect(6, 6).extrude(1)
    if outline == "rounded":
        prism, roof = prism.edges("|Z").fillet(1), roof.edges("|Z").fillet(2)
    sides = [
        (low.faces(">Z").val(), prism.faces("<Z").wires().val()),
        (high.faces("<Z").val(), roof.faces(">Z").wires().val()),
    ]
    result = cqblend.bridge([low.val(), high.val()], *sides, continuity=continuity)
    check(result, faces=faces)
    assert measured_angle(result) < 1e-10


def test_a_bridged_body_is_worked_on():
    low, high = pillar(5), pillar(3, x=6, z=20)
    bridged = cq.Workplane(cqblend.bridge([low.val(), high.val()], low.faces(">Z"), high.faces("<Z")).shape)
    assert bridged.faces(">Z").shell(-0.5).val().isValid()
    assert bridged.cut(block(z=12, size=(40, 2, 2))).val().isValid()
    assert cqblend.blend_edges(bridged, bridged.edges(">Z"), 0.5).shape.isValid()


def test_an_opening_given_as_a_curve_in_the_parameters_of_its_face():
    tank, pipe = pillar(5, height=20), cq.Workplane("YZ", origin=(-25, 0, 10)).circle(2).extrude(5)
    wall = tank.faces("%CYLINDER").val()
    (u0, u1), (v0, v1) = cqblend.to_surface(wall).domain
    unit = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]])
    weights = [1, *[np.sqrt(0.5), 1] * 4]
    oval = unit * [(u1 - u0) / 14, (v1 - v0) / 8] + [(u0 + u1) / 2, (v0 + v1) / 2]
    curve = cqblend.Curve.from_bspline(2, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], oval, weights)
    result = cqblend.bridge([tank.val(), pipe.val()], (wall, curve), pipe.faces(">X"))
    check(result, faces=1)
    assert measured_angle(result) < 1e-10


def test_a_neck_between_two_balls():
    centres, radii = np.array([[0, 0, 0], [15, 5, 8]]), (5, 4)
    balls = [cq.Workplane(origin=tuple(centre)).sphere(radius) for centre, radius in zip(centres, radii, strict=True)]
    sides = []
    for k, (ball, angle) in enumerate(zip(balls, (0.5, 0.4), strict=True)):
        way = (centres[1 - k] - centres[k]) / np.linalg.norm(centres[1] - centres[0])
        rim = ring(radii[k] * np.sin(angle), centres[k] + way * radii[k] * np.cos(angle), way)
        sides.append((ball.faces().val(), rim))
    result = cqblend.bridge([ball.val() for ball in balls], *sides)
    check(result, faces=1)
    assert result.faces[0].geomType() == "REVOLUTION"


def test_a_handle_on_one_body():
    studs = block(size=(40, 10, 4)).faces(">Z").workplane().pushPoints([(-10, 0), (10, 0)]).circle(2).extrude(3)
    left, right = studs.faces(">Z").vals()
    result = cqblend.bridge(studs, left, right)
    check(result, faces=1)
    # Euler: of one shell with holes in faces counted, V - E + F - (wires - F) = 2 (1 - genus)
    shape = result.shape
    rings = sum(len(face.innerWires()) for face in shape.Faces())
    assert len(shape.Vertices()) - len(shape.Edges()) + len(shape.Faces()) - rings == 0
    # the handle arches in one plane, as the studs are alike: it is symmetric about x = 0
    assert measure(shape)[1] == pytest.approx([0, 0], abs=1e-9)


def test_the_start_turns_the_bridge():
    low, high = block(), block(z=20)
    volumes = {}
    for start in (None, 0.0, 0.3125):
        sides = low.faces(">Z"), high.faces("<Z")
        volumes[start] = cqblend.bridge([low.val(), high.val()], *sides, start=start).shape.Volume()
    assert volumes[0.0] == pytest.approx(volumes[None], rel=1e-12)
    assert volumes[0.3125] < 0.9 * volumes[0.0]
    with pytest.raises(GeometryError, match=r"folds at t = .*another start"):
        cqblend.bridge([low.val(), high.val()], low.faces(">Z"), high.faces("<Z"), start=0.5)


def test_the_bridge_alone():
    low, high = pillar(5), pillar(3, z=20)
    alone = cqblend.bridge([low.val(), high.val()], low.faces(">Z"), high.faces("<Z"), solid=False)
    assert alone.shape.ShapeType() == "Face"
    assert alone.shape.isSame(alone.faces[0])
    assert alone.certificate.valid
    below, above = block(), block(z=20)
    cells = cqblend.bridge([below.val(), above.val()], below.faces(">Z"), above.faces("<Z"), solid=False)
    assert cells.shape.ShapeType() == "Shell"
    assert cells.shape.Area() == pytest.approx(32 * 16)
    assert cells.certificate.valid


def test_a_bulge_holds_the_direction_longer():
    """Of a bridge that turns aside, the middle keeps its place, and what is below it stays behind."""
    low, high = pillar(3), pillar(3, x=8, z=20)
    sides = [low.val(), high.val()], low.faces(">Z"), high.faces("<Z")
    centres = []
    for bulge in (0.3, 1.0, 1.5):
        surface = BRep_Tool.Surface_s(cqblend.bridge(*sides, bulge=(bulge, 1.0)).faces[0].wrapped)
        ring = [surface.Value(u, 0.25).X() for u in np.linspace(0, 1, 64, endpoint=False)]
        centres.append(np.mean(ring))
    assert centres[0] == pytest.approx(centres[2], abs=1e-6)  # cross derivatives along z move nothing sideways
    heights = [cqblend.bridge(*sides, bulge=(bulge, 1.0)).shape.Volume() for bulge in (0.3, 1.5)]
    assert heights[0] != pytest.approx(heights[1], rel=1e-6)


def test_a_workplane_is_bridged_and_its_other_solids_stay():
    low, high, far = pillar(5), pillar(3, z=20), block(x=50)
    stack = cq.Workplane().newObject([low.val(), high.val()])
    reports = []
    assert stack.bridge(low.faces(">Z"), high.faces("<Z"), report=reports.append).solids().size() == 1
    assert len(reports[0].faces) == 1
    all_three = cq.Compound.makeCompound([low.val(), far.val(), high.val()])
    result = cqblend.bridge(all_three, low.faces(">Z"), high.faces("<Z"))
    assert len(result.shape.Solids()) == 2
    assert any(one.isSame(far.val()) for one in result.shape.Solids())


def test_edges_and_wires_mean_the_face_that_they_bound():
    low, high = pillar(5), pillar(3, z=20)
    bodies = [low.val(), high.val()]
    by_faces = cqblend.bridge(bodies, low.faces(">Z"), high.faces("<Z")).shape.Volume()
    rim, wire = low.edges(">Z").val(), high.faces("<Z").wires().val()
    assert cqblend.bridge(bodies, rim, wire).shape.Volume() == pytest.approx(by_faces, rel=1e-12)
    pair = low.faces(">Z").val(), low.faces(">Z").wires().val()
    assert cqblend.bridge(bodies, pair, wire).shape.Volume() == pytest.approx(by_faces, rel=1e-12)


def refuse(kind, words, *arguments, **options):
    with pytest.raises(kind, match=words) as caught:
        cqblend.bridge(*arguments, **options)
    assert isinstance(caught.value, CqblendError)


def test_what_cannot_be_bridged_is_refused_by_name():
    low, high = block(), block(z=20)
    bodies, floor, roof = [low.val(), high.val()], low.faces(">Z").val(), high.faces("<Z").val()
    refuse(SelectionError, "side 2 is not of a solid", bodies, floor, block(z=40).faces("<Z").val())
    refuse(SelectionError, "not the outer boundary of a face", bodies, low.edges(">Z and >X").val(), roof)
    refuse(InputError, "a pair of a face and a closed wire", bodies, floor, 7)
    refuse(InputError, "a Curve needs its face", bodies, cqblend.Curve.bezier([[0, 0], [1, 1]]), roof)
    refuse(InputError, r"side 1 reaches the boundary of face \d+", bodies, (floor, ring(3, (0, 0, 2))), roof)
    refuse(InputError, "1 mm off the surface of face", bodies, (floor, ring(1, (0, 0, 3))), roof)
    refuse(InputError, "gap of", bodies, (floor, cq.Edge.makeLine((0, 0, 2), (1, 0, 2))), roof)
    refuse(TopologyError, r"both sides have face \d+", bodies, floor, floor)
    refuse(TopologyError, r"both sides have vertex \d+", bodies, floor, low.faces(">X").val())
    refuse(InputError, "share of the length of side 2", bodies, floor, roof, start=1.5)
    refuse(InputError, "is not that of equations", bodies, floor, roof, section="pde", continuity="G3")
    refuse(InputError, "no effect", bodies, floor, roof, continuity="G0", bulge=2)
    drilled = block().faces(">Z").workplane().hole(2)
    refuse(TopologyError, "has 1 hole", [drilled.val(), high.val()], drilled.faces(">Z").val(), roof)
    around = ring(2, (0, 0, 2))
    refuse(InputError, "swallows edge", [drilled.val(), high.val()], (drilled.faces(">Z").val(), around), roof)
    tube = pillar(5)
    refuse(TopologyError, "meets itself at a seam", [tube.val(), high.val()], tube.faces("%CYLINDER").val(), roof)


def test_a_bridge_through_a_body_is_refused():
    low, high = block(), block(z=20)
    bodies = [low.val(), high.val()]
    post = cq.Workplane(origin=(0, 0, -2)).rect(30, 4).extrude(-10)
    refuse(GeometryError, "runs into a body", post.val(), post.faces("<X"), post.faces(">X"), bulge=0.01)
    between = block(z=10, size=(30, 30, 1))
    compound = cq.Compound.makeCompound([*bodies, between.val()])
    refuse(GeometryError, "runs into", compound, low.faces(">Z"), high.faces("<Z"))
