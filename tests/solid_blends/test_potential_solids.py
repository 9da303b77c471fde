"""Potential sections in solids: against the implicit potential method, OCCT's verification, and what users ask for."""

import re

import cadquery as cq
import numpy as np
import pytest

import cqblend
from cqblend.errors import GeometryError, InputError, SelectionError, SizeError, TopologyError

BOX = cq.Workplane().box(30, 20, 10)
CORNER = BOX.edges("|Z and >X and >Y")
CYLINDER = cq.Workplane().cylinder(10, 5)
BOSS = cq.Workplane().box(40, 40, 6).faces(">Z").workplane().circle(8).extrude(12)
BALL = cq.Workplane().sphere(10)
AXIS = cq.Vector(1, -0.15, 0.1)
ARM = BALL.union(cq.Workplane(cq.Solid.makeCylinder(4.5, 20, cq.Vector(0, 0, 0), AXIS)))
RING = ARM.edges(cq.NearestToPointSelector((9, -4, 0)))
WEDGE = cq.Workplane("XZ").polyline([(0, 0), (20, 0), (12, 8), (0, 8)]).close().extrude(15)


def conic(a, b, lam, s1, s2):
    return b**2 * s1**2 + a**2 * s2**2 + a**2 * b**2 - 2 * a * b**2 * s1 - 2 * a**2 * b * s2 + 2 * lam * s1 * s2


def axis_distance(p):
    return np.linalg.norm(np.cross(p, np.array(AXIS.toTuple()) / AXIS.Length), axis=-1)


SLOPE = np.array([1, 0, 1]) / np.sqrt(2)
SOLIDS = {
    # solid, edge, side 1, and how far points are on the blend's side of side 1 and side 2
    "box": (BOX, CORNER, BOX.faces(">X"), lambda p: (15 - p[..., 0], 10 - p[..., 1])),
    "cylinder": (
        CYLINDER,
        CYLINDER.edges(">Z"),
        CYLINDER.faces(">Z"),
        lambda p: (5 - p[..., 2], 5 - np.hypot(p[..., 0], p[..., 1])),
    ),
    "boss": (
        BOSS,
        BOSS.edges(cq.NearestToPointSelector((0, 0, 3))),
        BOSS.faces(cq.NearestToPointSelector((0, 0, 3))),
        lambda p: (p[..., 2] - 3, np.hypot(p[..., 0], p[..., 1]) - 8),
    ),
    "arm": (
        ARM,
        RING,
        ARM.faces(cq.NearestToPointSelector((-10, 0, 0))),
        lambda p: (np.linalg.norm(p, axis=-1) - 10, axis_distance(p) - 4.5),
    ),
    "wedge": (
        WEDGE,
        WEDGE.edges(cq.NearestToPointSelector((12, -7, 8))),
        WEDGE.faces(">Z"),
        lambda p: (8 - p[..., 2], np.sqrt(0.5) * 20 - p @ SLOPE),
    ),
}


@pytest.mark.parametrize("form", ["exact", "compact"])
@pytest.mark.parametrize(("a", "b", "share"), [(1.5, 1.5, 0.0), (1.0, 2.0, -8.0)])
@pytest.mark.parametrize("name", SOLIDS)
def test_blends_in_solids_solve_the_implicit_equation(name, a, b, share, form):
    solid, edge, first, amounts = SOLIDS[name]
    lam = share * a * b
    result = cqblend.blend_edges(solid, edge, section="potential", a=a, b=b, lam=lam, form=form, first=first.val())
    certificate = result.certificate
    assert certificate.form == form
    assert certificate.angle < (1e-10 if form == "exact" else 1e-5)
    assert certificate.gap < 1e-7
    report = cqblend.verify(result.shape, result.faces)
    assert report.ok, report
    (face,) = result.faces
    (u0, u1), (v0, v1) = cqblend.to_surface(face).domain
    surface = cqblend.to_surface(face)
    p = surface.grid(np.linspace(u0, u1, 41), np.linspace(v0, v1, 25))
    s1, s2 = amounts(p)
    width = np.linalg.norm(p[:, 0] - p[:, -1], axis=1).max()
    assert np.abs(conic(a, b, lam, s1, s2)).max() < 1e-5 * 4 * width * (1 + abs(share)) * a * b * max(a, b)
    rails = (
        {round(float(s1[:, end].mean()), 4) for end in (0, -1)},
        {round(float(s2[:, end].mean()), 4) for end in (0, -1)},
    )
    assert rails == ({0.0, a}, {0.0, b})  # side 1 is met where side 2 was moved by b, and conversely


def test_a_circle_is_the_fillet():
    """Between planes at a right angle, a = b and lambda = 0 is the rolling ball: volumes agree with OCCT's fillet."""
    result = cqblend.blend_edges(BOX, CORNER, section="potential", a=2)
    assert result.shape.Volume() == pytest.approx(BOX.edges("|Z and >X and >Y").fillet(2).val().Volume(), rel=1e-8)


def test_the_light_forms_stay_light():
    box, arm = (
        cqblend.blend_edges(*some, section="potential", a=1, lam=-3).certificate
        for some in ((BOX, CORNER), (ARM, RING))
    )
    assert box.degree[0] == 1
    assert box.poles[0] == 2
    assert arm.degree[0] == 2
    assert arm.poles[0] == 9


def test_one_of_a_and_b_is_enough_and_workplanes_blend_too():
    one = cqblend.blend_edges(BOX, CORNER, section="potential", b=2).shape.Volume()
    made = BOX.edges("|Z and >X and >Y").blend(section="potential", a=2, b=2)
    assert made.val().Volume() == pytest.approx(one, rel=1e-12)


def test_several_edges():
    result = cqblend.blend_edges(BOX, BOX.edges("|Z"), section="potential", a=2, b=1, lam=-2)
    assert len(result.faces) == 4
    assert cqblend.verify(result.shape, result.faces).ok


def test_sizes_that_do_not_fit_name_one_that_does():
    with pytest.raises(SizeError, match=r"at most about (\S+) fits") as caught:
        cqblend.blend_edges(ARM, RING, section="potential", a=9, b=9)
    assert "s = (" in str(caught.value)
    fits = float(re.search(r"at most about (\S+) fits", str(caught.value))[1])
    assert 1 < fits < 9
    assert cqblend.blend_edges(ARM, RING, section="potential", a=0.9 * fits).certificate.valid
    with pytest.raises(SizeError, match="larger than the whole solid"):
        cqblend.blend_edges(BOX, CORNER, section="potential", a=400)


def test_fairness_and_proof_are_there():
    certificate = cqblend.blend_edges(ARM, RING, section="potential", a=1.5).certificate
    assert certificate.proof.angle < 1e-9
    assert certificate.fairness > 0


def splines(solid):
    """Return a solid with all faces on splines."""
    return cq.Workplane(solid.val().toNURBS())


@pytest.mark.slow
def test_a_blend_of_surfaces_goes_into_its_solid():
    """Between the faces of a solid as they are, reshaped from references, of whichever sides and senses."""
    body = splines(BOSS)
    edge = body.edges(cq.NearestToPointSelector((0, 0, 3)))
    plate = cqblend.to_surface(body.faces(cq.NearestToPointSelector((0, 0, 3))).val())
    wall = cqblend.to_surface(body.faces(cq.NearestToPointSelector((0, 0, 9))).val())
    floor, pipe = cqblend.reshape(plate, reference=(0, 0, -5)), cqblend.reshape(wall, reference=(0, 0, 9))
    relation = cqblend.Conic(0.25, 0.2, 0)
    volumes = []
    for pair in ((floor, pipe), (pipe, floor)):
        if pair[0] is pipe:
            relation = cqblend.Conic(0.2, 0.25, 0)
        blend = cqblend.potential_blend(*pair, relation)
        result = cqblend.insert_blend(body, edge, blend)
        report = cqblend.verify(result.shape, result.faces)
        assert report.ok, report
        assert result.certificate.angle < 1e-5
        volumes.append(report.volume)
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-7)
    assert volumes[0] > body.val().Volume() + 10


def test_hermite_blends_go_into_solids_too():
    body = splines(CYLINDER)
    edge = body.edges(">Z")
    lid, wall = (cqblend.to_surface(body.faces(cq.NearestToPointSelector(at)).val()) for at in ((0, 0, 5), (5, 0, 0)))
    blend = cqblend.potential_blend(
        cqblend.reshape(lid, by="normal", amounts=-inside(lid, (0, 0, 1))),
        cqblend.reshape(wall, by="normal", amounts=-inside(wall, None)),
        cqblend.Conic(1, 1, 0),
        form="exact",
    )
    result = cqblend.insert_blend(body, edge, blend.hermite)
    assert cqblend.verify(result.shape, result.faces).ok
    assert result.certificate.angle < 1e-10


def inside(surface, outwards):
    """Return +1 if the normal of a surface points outwards, along a direction or away from the z axis; else -1."""
    (u0, u1), (v0, v1) = surface.domain
    jet = surface.jet((u0 + u1) / 2 + 0.01, (v0 + v1) / 2, 1)
    normal = np.cross(jet[1, 0], jet[0, 1])
    return float(np.sign(normal @ (jet[0, 0] * [1, 1, 0] if outwards is None else outwards)))


def test_what_does_not_belong_is_refused():
    body = splines(CYLINDER)
    lid, wall = (cqblend.to_surface(body.faces(cq.NearestToPointSelector(at)).val()) for at in ((0, 0, 5), (5, 0, 0)))
    blend = cqblend.potential_blend(
        cqblend.reshape(lid, by="normal", amounts=-inside(lid, (0, 0, 1))),
        cqblend.reshape(wall, by="normal", amounts=-inside(wall, None)),
        cqblend.Conic(1, 1, 0),
    )
    with pytest.raises(InputError, match="do not lie on the two faces"):
        cqblend.insert_blend(body, body.edges("<Z"), blend)
    with pytest.raises(InputError, match="do not lie on the two faces"):
        cqblend.insert_blend(CYLINDER, CYLINDER.edges(">Z"), blend)  # faces that are no splines
    with pytest.raises(SelectionError, match="several joints"):
        cqblend.insert_blend(body, body.edges("%CIRCLE or %BSPLINE").edges("<Z or >Z"), blend)
    with pytest.raises(InputError, match="a blend to insert is"):
        cqblend.insert_blend(body, body.edges(">Z"), "blend")


@pytest.mark.parametrize("swapped", [False, True])
def test_open_blends_of_surfaces_go_into_solids(swapped):
    """From one end of an edge to the other; a straight one is one span."""
    body = splines(BOX)
    faces = [body.faces(cq.NearestToPointSelector(at)).val() for at in ((15, 0, 0), (0, 10, 0))]
    sides = [cqblend.reshape(one, by="normal", amounts=-1) for one in (faces[::-1] if swapped else faces)]
    blend = cqblend.potential_blend(*sides, cqblend.Conic(2, 3))
    result = cqblend.insert_blend(body, body.edges(cq.NearestToPointSelector((15, 10, 0))), blend, first=faces[0])
    assert cqblend.verify(result.shape, result.faces).ok
    assert result.certificate.poles[0] == 2
    assert [record.side for record in result.certificate.rails] == [1, 2]
    assert [end.kind for end in result.certificate.ends] == ["natural", "natural"]
    expected = cqblend.blend_edges(
        BOX, CORNER, section="potential", a=3 if swapped else 2, b=2 if swapped else 3, first=BOX.faces(">X").val()
    )
    assert result.shape.Volume() == pytest.approx(expected.shape.Volume(), rel=1e-6)


def test_acute_edges_take_unequal_reaches():
    """Their sections set out backwards on the shorter side, and are affine images of the same conic all the same."""
    wedge = cq.Workplane("XZ").polyline([(0, 0), (20, 0), (12, 3.5), (0, 3.5)]).close().extrude(15)
    edge = wedge.edges(cq.NearestToPointSelector((20, -7, 0)))
    for b in (0.5, 0.45, 0.3):
        result = cqblend.blend_edges(wedge, edge, section="potential", a=0.5, b=b)
        assert cqblend.verify(result.shape, result.faces).ok
        assert result.certificate.angle < 1e-10


def test_blends_of_surfaces_do_not_end_where_a_joint_goes_on():
    body = cq.Workplane(cq.Workplane().box(30, 20, 10).edges("|Z").fillet(4).val().toNURBS())
    edge = body.edges(cq.NearestToPointSelector((0, 10, 5)))
    faces = [one for one in body.faces().vals() if any(other.isSame(edge.val()) for other in one.Edges())]
    blend = cqblend.potential_blend(
        *(cqblend.reshape(one, by="normal", amounts=-1) for one in faces), cqblend.Conic(1, 1)
    )
    with pytest.raises(
        TopologyError, match=r"^edge \d+: .* cannot end at vertex \d+ at .*: the joint goes on there in edge"
    ):
        cqblend.insert_blend(body, edge, blend)
    with pytest.raises(SelectionError, match="several joints"):
        cqblend.insert_blend(body, body.edges(">Z"), blend)


def test_blends_that_are_too_short_for_slanted_ends_say_so():
    tool = cq.Workplane().box(20, 60, 40).rotate((0, 0, 0), (0, 0, 1), 25).translate((22, 0, 0))
    body = cq.Workplane(cq.Workplane().box(30, 20, 10).cut(tool).val().toNURBS())
    edge = body.edges(cq.NearestToPointSelector((0, 10, 5)))
    faces = [one for one in body.faces().vals() if any(other.isSame(edge.val()) for other in one.Edges())]
    sides = [cqblend.reshape(one, by="normal", amounts=-1) for one in faces]
    blend = cqblend.potential_blend(*sides, cqblend.Conic(2, 1, -3))
    with pytest.raises(GeometryError, match=r"ends before it meets the faces .* extend the surfaces"):
        cqblend.insert_blend(body, edge, blend)
