"""Blended solids: what `cqblend.blend_edges` promises, from picked edge to verified result, measured by OCCT alone."""

from __future__ import annotations

import math
from collections.abc import Callable
from io import BytesIO

import cadquery as cq
import numpy as np
import pytest
from OCP.BinTools import BinTools
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineSurface, Geom_SurfaceOfRevolution
from OCP.GeomLProp import GeomLProp_SLProps
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf
from OCP.GProp import GProp_GProps
from OCP.ShapeUpgrade import ShapeUpgrade_ShapeDivideClosedEdges
from OCP.TopAbs import TopAbs_IN
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS

import cqblend
from cqblend.errors import (
    CqblendError,
    DegreeError,
    GeometryError,
    InputError,
    SelectionError,
    SizeError,
)

V = cq.Vector
Pick = Callable[[cq.Shape], list[cq.Edge]]


# The witness: nothing below asks cqblend.


def content(shape: cq.Shape) -> bytes:
    stream = BytesIO()
    BinTools.Write_s(shape.wrapped, stream)
    return stream.getvalue()


def volume(shape: cq.Shape) -> float:
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape.wrapped, properties, 1e-9, False, False)
    return properties.Mass()


def normal(face: cq.Face, u: float, v: float) -> np.ndarray:
    found = GeomLProp_SLProps(BRep_Tool.Surface_s(face.wrapped), u, v, 1, 1e-12).Normal()
    return np.array(found.Coord())


def edge_between(shape: cq.Shape, one: cq.Face, other: cq.Face) -> list[cq.Edge]:
    return [edge for edge in one.Edges() if any(edge.isSame(o) for o in other.Edges())]


def met(blend: cq.Face, neighbour: cq.Face, edge: cq.Edge, n: int = 60) -> tuple[float, float]:
    """Measure gap and normal angle between two faces at points along their common edge, by pcurves."""
    gap = angle = 0.0
    first, last = BRep_Tool.Range_s(edge.wrapped)
    curves = [BRep_Tool.CurveOnSurface_s(edge.wrapped, face.wrapped, 0.0, 0.0) for face in (blend, neighbour)]
    surfaces = [BRep_Tool.Surface_s(face.wrapped) for face in (blend, neighbour)]
    for t in np.linspace(first, last, n)[1:-1].tolist():
        uv = [curve.Value(t).Coord() for curve in curves]
        points = [np.array(surface.Value(*at).Coord()) for surface, at in zip(surfaces, uv, strict=True)]
        n1, n2 = normal(blend, *uv[0]), normal(neighbour, *uv[1])
        gap = max(gap, float(np.linalg.norm(points[0] - points[1])))
        angle = max(angle, math.atan2(float(np.linalg.norm(np.cross(n1, n2))), abs(float(n1 @ n2))))
    return gap, angle


def sharp(shape: cq.Shape) -> list[cq.Edge]:
    found = []
    for edge in shape.Edges():
        faces = edge.ancestors(shape, "Face").Faces()
        if len(faces) == 2:
            _, angle = met(faces[0], faces[1], edge, 5)
            if angle > 1e-2:
                found.append(edge)
    return found


def near(x: float, y: float, z: float) -> Pick:
    """Pick the sharp edge that passes nearest to a point."""
    vertex = cq.Vertex.makeVertex(x, y, z)
    return lambda body: [min(sharp(body), key=lambda e: BRepExtrema_DistShapeShape(vertex.wrapped, e.wrapped).Value())]


def poles(face: cq.Face) -> tuple[int, int]:
    surface = BRep_Tool.Surface_s(face.wrapped)
    assert isinstance(surface, Geom_BSplineSurface)
    return surface.NbUPoles(), surface.NbVPoles()


def check(body: cq.Shape, picked: list[cq.Edge], *, grows: bool, angle: float = 1e-9, **options) -> cqblend.BlendResult:
    """Blend, and check everything that holds for every blend."""
    before, old = content(body), volume(body)
    kinds = sorted(face.geomType() for face in body.Faces())
    result = cqblend.blend_edges(body, picked, **options)
    shape, certificate = result.shape, result.certificate
    assert content(body) == before
    assert BRepCheck_Analyzer(shape.wrapped, True, False, True).IsValid()
    assert BRep_Tool.IsClosed_s(shape.Shells()[0].wrapped)
    assert certificate.valid
    assert (volume(shape) > old) == grows
    assert len(shape.Solids()) == len(body.Solids())
    blends = [f for f in shape.Faces() if any(f.isSame(b) for b in result.faces)]
    assert len(blends) == len(result.faces)
    assert sorted(f.geomType() for f in shape.Faces() if not any(f.isSame(b) for b in blends)) == kinds
    gap = turn = tolerance = 0.0
    for blend in blends:
        for edge in blend.Edges():
            tolerance = max(tolerance, BRep_Tool.Tolerance_s(edge.wrapped))
            faces = [f for f in edge.ancestors(shape, "Face").Faces() if not f.isSame(blend)]
            if faces and BRep_Tool.Continuity_s(edge.wrapped, blend.wrapped, faces[0].wrapped).value >= 1:
                found = met(blend, faces[0], edge)
                gap, turn = max(gap, found[0]), max(turn, found[1])
    assert tolerance <= 5e-7
    assert turn <= angle
    assert gap <= 1e-7
    assert turn <= 1.2 * certificate.angle + 1e-12
    assert certificate.angle <= angle
    assert certificate.gap <= 1e-7
    assert certificate.tolerance <= 5e-7
    return result


# Bodies.


def box() -> cq.Solid:
    return cq.Solid.makeBox(30, 20, 10)


def cylinder() -> cq.Solid:
    return cq.Solid.makeCylinder(8, 20)


def cone() -> cq.Solid:
    return cq.Solid.makeCone(8, 4, 12)


def stepped() -> cq.Solid:
    return cq.Solid.makeCylinder(10, 4).fuse(cq.Solid.makeCylinder(5, 10)).Solids()[0]


def plate_with_blind_hole() -> cq.Solid:
    return cq.Solid.makeCylinder(10, 6).cut(cq.Solid.makeCylinder(3, 3, V(0, 0, 3))).Solids()[0]


def capped_sphere() -> cq.Solid:
    ball = cq.Solid.makeSphere(10, angleDegrees1=-90)
    return ball.cut(cq.Solid.makeBox(40, 40, 40, V(-20, -20, 4))).Solids()[0]


def sphere_with(tool: cq.Solid) -> cq.Solid:
    return cq.Solid.makeSphere(10, angleDegrees1=-90).fuse(tool).Solids()[0]


def flat_torus() -> cq.Solid:
    return cq.Solid.makeTorus(10, 3).cut(cq.Solid.makeBox(60, 60, 60, V(-30, -30, 1.5))).Solids()[0]


def vase() -> cq.Solid:
    profile = cq.Workplane("XZ").moveTo(0, 0).lineTo(6, 0)
    profile = profile.spline([(6, 0), (8, 4), (5, 9), (6, 12)], includeCurrent=False)
    return profile.lineTo(0, 12).close().revolve(360, (0, 0), (0, 1)).val()


def mirrored(body: cq.Shape) -> cq.Shape:
    """Mirror without copying geometry's handedness away: surfaces get left-handed frames."""
    turn = gp_Trsf()
    turn.SetMirror(gp_Ax2(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 1)))
    return cq.Shape.cast(BRepBuilderAPI_Transform(body.wrapped, turn, True).Shape())


def moved(body: cq.Shape) -> cq.Shape:
    return body.moved(cq.Location(V(5, 6, 7), V(1, 2, 0.5), 33))


def all_of(body: cq.Shape) -> list[cq.Edge]:
    return sharp(body)


LIGHT: dict[str, tuple[Callable[[], cq.Shape], Pick, bool, tuple[int, int]]] = {
    "box": (box, near(30, 20, 5), False, (2, 4)),
    "cylinder and plane": (cylinder, near(8, 0, 20), False, (9, 4)),
    "cone and plane": (cone, near(4, 0, 12), False, (9, 4)),
    "blunt cone and plane": (cone, near(8, 0, 0), False, (9, 4)),
    "foot of a step": (stepped, near(5, 0, 4), True, (9, 4)),
    "floor of a blind hole": (plate_with_blind_hole, near(3, 0, 3), True, (9, 4)),
    "rim of a blind hole": (plate_with_blind_hole, near(3, 0, 6), False, (9, 4)),
    "sphere and plane": (capped_sphere, near(9, 0, 4), False, (9, 4)),
    "sphere and cylinder": (lambda: sphere_with(cq.Solid.makeCylinder(4, 20)), near(4, 0, 9), True, (9, 4)),
    "sphere and cone": (lambda: sphere_with(cq.Solid.makeCone(6, 2, 20)), near(4, 0, 9), True, (9, 4)),
    "torus and plane": (flat_torus, near(12.6, 0, 1.5), False, (9, 4)),
    "torus and plane, inside": (flat_torus, near(7.4, 0, 1.5), False, (9, 4)),
    "revolved spline and plane": (vase, near(6, 0, 12), False, (9, 4)),
}


@pytest.mark.parametrize("name", LIGHT)
@pytest.mark.parametrize("place", [lambda body: body, mirrored, moved], ids=["as made", "mirrored", "moved"])
def test_simple_joints_stay_light_and_exact(name, place):
    make, pick, grows, most = LIGHT[name]
    body = make()
    number = next(i for i, edge in enumerate(body.Edges()) if edge.isSame(pick(body)[0]))
    body = place(body)
    result = check(body, [body.Edges()[number]], grows=grows, radius=0.6, section="hermite")
    assert result.certificate.form == "exact"
    assert result.certificate.poles == most
    surface = BRep_Tool.Surface_s(result.faces[0].wrapped)
    if most[0] == 2:
        assert sorted(poles(result.faces[0])) == sorted(most)
    else:  # around an axis
        assert isinstance(surface, Geom_SurfaceOfRevolution)
        assert surface.BasisCurve().NbPoles() == most[1]
    assert result.certificate.angle <= 2e-11
    assert result.certificate.gap <= 1e-9


HEAVY: dict[str, tuple[Callable[[], cq.Shape], Pick, bool]] = {
    "tilted boss on a torus": (
        lambda: cq.Solid.makeTorus(10, 3).fuse(cq.Solid.makeCylinder(1.5, 20, V(10, 0, 0), V(0, 0.3, 1))).Solids()[0],
        near(11.5, 1, 3),
        True,
    ),
    "boss on a revolved spline": (
        lambda: vase().fuse(cq.Solid.makeCylinder(1.5, 12, V(0, 0, 6), V(1, 0.2, 0))).Solids()[0],
        near(7, 2, 7),
        True,
    ),
    "pipe into a pipe": (
        lambda: (
            cq.Solid.makeCylinder(10, 60, V(0, 0, -30))
            .fuse(cq.Solid.makeCylinder(6, 30, V(0, 2, 0), V(1, 0, 0)))
            .Solids()[0]
        ),
        near(9, 2, 6),
        True,
    ),
    "sector of a disc": (
        lambda: cq.Workplane().lineTo(10, 0).threePointArc((8.253, 5.646), (3.624, 9.32)).close().extrude(6).val(),
        near(8.253, 5.646, 6),
        False,
    ),
    "ball cut by a box": (
        lambda: (
            cq.Solid.makeSphere(10, angleDegrees1=-90)
            .intersect(cq.Solid.makeBox(30, 30, 30, V(-3, -4, -2)))
            .Solids()[0]
        ),
        near(-3, 6.7, 6.7),
        False,
    ),
}


@pytest.mark.parametrize("name", HEAVY)
def test_joints_that_are_not_simple_are_as_smooth_as_asked(name):
    make, pick, grows = HEAVY[name]
    body = make()
    check(body, pick(body), grows=grows, angle=1e-5, radius=0.4)


@pytest.mark.parametrize("name", HEAVY)
def test_joints_that_are_not_simple_are_exact_on_demand(name):
    make, pick, grows = HEAVY[name]
    body = make()
    result = check(body, pick(body), grows=grows, angle=1e-9, radius=0.4, form="exact")
    assert result.certificate.form == "exact"


def test_volume_taken_off_a_cylinder_rim_is_that_of_a_toroidal_fillet():
    radius, ring = 1.5, 8.0
    body = cylinder()
    result = cqblend.blend_edges(body, near(8, 0, 20)(body), radius)
    # the square r x r less the quarter disc, turned about the axis (Pappus)
    square, quarter = radius**2, math.pi * radius**2 / 4
    out = ring - radius
    moment = square * (out + radius / 2) - quarter * (out + 4 * radius / (3 * math.pi))
    assert volume(body) - volume(result.shape) == pytest.approx(2 * math.pi * moment, rel=0.01)


def test_width_sets_the_rails_at_that_distance():
    body = cylinder()
    top = next(f for f in body.Faces() if f.Center().z == pytest.approx(20))
    result = check(body, near(8, 0, 20)(body), grows=False, width=(1.0, 2.0), first=top)
    box_of = result.faces[0].BoundingBox()
    assert box_of.zmin == pytest.approx(18, abs=1e-6)
    circles = [e for e in result.faces[0].Edges() if e.IsClosed()]
    assert sorted(round(e.Length() / (2 * math.pi), 9) for e in circles) == [7.0, 8.0]
    assert [(rail.side, rail.face) for rail in result.certificate.rails] == [
        (1, body.Faces().index(top) + 1),
        (2, next(i for i, f in enumerate(body.Faces(), 1) if f.geomType() == "CYLINDER")),
    ]


def test_certificate_tells_width_and_names_of_the_input():
    body = box()
    edge = near(30, 20, 5)(body)[0]
    certificate = cqblend.blend_edges(body, edge, 2, section="hermite").certificate
    assert certificate.width == pytest.approx((2 * math.sqrt(2),) * 2, rel=1e-12)
    assert {rail.edge for rail in certificate.rails} == {body.Edges().index(edge) + 1}
    named = {body.Faces()[rail.face - 1].hashCode() for rail in certificate.rails}
    assert named == {face.hashCode() for face in edge.ancestors(body, "Face").Faces()}
    assert certificate.degree == (1, 3)
    assert not certificate.rational
    assert certificate.curvature_jump == pytest.approx(1 / 2, rel=0.05)


# Where a solid may sit.


def test_one_solid_of_a_compound_is_blended_and_the_other_left_alone():
    other = cq.Solid.makeCylinder(5, 10, V(60, 0, 0))
    body = cq.Compound.makeCompound([box(), other])
    result = check(body, near(30, 20, 5)(body), grows=False, radius=1)
    assert any(solid.isSame(other) for solid in result.shape.Solids())


def test_edges_of_two_solids_in_one_call():
    body = cq.Compound.makeCompound([box(), cq.Solid.makeCylinder(5, 10, V(60, 0, 0))])
    result = check(body, near(30, 20, 5)(body) + near(65, 0, 10)(body), grows=False, radius=1)
    assert len(result.faces) == 2
    assert len(result.certificate.rails) == 4


def test_one_of_two_instances_of_the_same_solid():
    part = box()
    body = cq.Compound.makeCompound([part, part.moved(cq.Location(V(50, 0, 0)))])
    result = check(body, near(80, 20, 5)(body), grows=False, radius=1)
    volumes = sorted(volume(solid) for solid in result.shape.Solids())
    assert volumes[0] < volumes[1] - 1
    assert volumes[1] == pytest.approx(6000)


def test_solid_in_a_located_compound_of_a_compound():
    body = cq.Compound.makeCompound([cq.Compound.makeCompound([box()]).moved(cq.Location(V(1, 2, 3), V(0, 0, 1), 20))])
    check(body, [sharp(body)[0]], grows=False, radius=1)


def test_workplane_translated():
    part = cq.Workplane().box(30, 20, 10).translate((5, 6, 7))
    blended = part.edges("|Z and >X and >Y").blend(2)
    assert blended.val().isValid()
    assert 6000 - volume(blended.val()) == pytest.approx((1 - math.pi / 4) * 4 * 10, rel=0.01)


def test_void_inside_a_solid():
    body = box().cut(cq.Solid.makeBox(10, 8, 4, V(5, 5, 3))).Solids()[0]
    result = check(body, near(5, 5, 5)(body), grows=True, radius=1)
    assert len(result.shape.Shells()) == 2
    hollow = BRepClass3d_SolidClassifier(result.shape.wrapped, gp_Pnt(10, 9, 5), 1e-7)
    assert hollow.State() != TopAbs_IN


# Several edges.


def test_several_joints_in_one_call():
    body = stepped()
    result = cqblend.blend_edges(body, sharp(body), 0.5)
    assert len(result.faces) == len(sharp(body)) == 4
    assert result.shape.isValid()
    assert cqblend.verify(result.shape, result.faces).ok


def test_four_edges_of_a_box_at_once_and_one_after_the_other():
    body = box()
    once = cqblend.blend_edges(body, body.edges("|Z"), 2).shape
    part = body
    for x, y in ((0, 0), (0, 20), (30, 0), (30, 20)):
        part = check(part, near(x, y, 5)(part), grows=False, radius=2).shape
    assert volume(once) == pytest.approx(volume(part), rel=1e-12)
    assert volume(once) == pytest.approx(6000 - 40 * 4 * (1 - math.pi / 4), rel=1e-4)


@pytest.mark.parametrize("picked", [1, 2])
def test_loops_cut_into_several_edges_are_followed_all_around(picked):
    body = stepped()
    divide = ShapeUpgrade_ShapeDivideClosedEdges(body.wrapped)
    divide.SetNbSplitPoints(3)
    divide.Perform()
    cut = cq.Shape.cast(divide.Result())
    ring = [e for e in sharp(cut) if abs(e.Center().z - 4) < 1e-6 and abs(e.BoundingBox().zlen) < 1e-6]
    ring = [e for e in ring if math.hypot(*e.startPoint().toTuple()[:2]) < 6]
    assert len(ring) > 1
    result = check(cut, ring[:picked], grows=True, radius=1, section="hermite")
    assert result.certificate.poles == (9, 4)


def test_three_edges_that_meet_in_a_vertex_are_blended_round_one_another():
    body = box()
    corner = [edge for edge in body.Edges() if any(near_corner(vertex) for vertex in edge.Vertices())]
    result = cqblend.blend_edges(body, corner, 2)
    assert len(corner) == 3
    assert len(result.faces) == 4
    assert result.shape.isValid()
    assert result.certificate.coverage == 1


def near_corner(vertex: cq.Vertex) -> bool:
    return bool((vertex.Center() - cq.Vector(30, 20, 10)).Length < 1e-9)


# Errors name the edge and the number.


def error(kind: type[CqblendError], text: str, body: cq.Shape, edges: list[cq.Edge], **options) -> None:
    before = content(body)
    with pytest.raises(kind, match=text):
        cqblend.blend_edges(body, edges, **options)
    assert content(body) == before


def test_radius_that_does_not_fit_is_answered_with_the_largest_that_does():
    body = box()
    edge = near(15, 20, 10)(body)
    number = body.Edges().index(edge[0]) + 1
    error(SizeError, rf"edge {number}: size 12 is too large.*at most about 9.99 fits.*max_size", body, edge, radius=12)


def test_sizes_larger_than_the_solid_are_refused():
    body = box()
    error(SizeError, r"edge \d+: size 1000 is larger than the whole solid, 37\.4", body, body.Edges()[:1], radius=1000)


@pytest.mark.parametrize("radius", [8.001, 8.5, 9, 12])
def test_balls_larger_than_the_cylinder_do_not_fit_its_rim(radius):
    """Beyond the axis the rail runs backwards; a result there is folded over itself."""
    body = cylinder()
    error(SizeError, r"edge \d+: .*at most about (8|7\.9)", body, near(8, 0, 20)(body), radius=radius)


def test_exact_form_of_too_high_a_degree_is_refused_by_number():
    face = cq.Face.makeSplineApprox(
        [[V(x, y, math.sin(x / 4) * math.cos(y / 5)) for y in range(-15, 16, 6)] for x in range(-15, 16, 6)],
        tol=1e-3,
        minDeg=5,
        maxDeg=5,
    )
    block = cq.Solid.makeBox(20, 20, 40, V(-10, -10, -20)).split(face)
    body = min(block.Solids(), key=lambda s: s.Center().z)
    edge = near(0, -10, 0)(body)
    error(DegreeError, r"edge \d+: the exact blend has degree 30 along the rail", body, edge, radius=1, form="exact")
    check(body, edge, grows=False, angle=1e-5, radius=1)


def test_seams_poles_smooth_and_foreign_edges_are_refused():
    rod = cylinder()
    seam = next(e for e in rod.Edges() if e.geomType() == "LINE")
    error(SelectionError, r"edge \d+ is a seam", rod, [seam], radius=1)
    ball = cq.Solid.makeSphere(9, angleDegrees1=-90)
    index = cq.occ_impl.shapes.TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(ball.wrapped, cq.occ_impl.shapes.ta.TopAbs_EDGE, index)
    edges = [TopoDS.Edge_s(index.FindKey(i)) for i in range(1, index.Extent() + 1)]
    pole = next(cq.Edge(e) for e in edges if BRep_Tool.Degenerated_s(e))
    error(SelectionError, r"edge \d+ is degenerate", ball, [pole], radius=1)
    blended = cqblend.blend_edges(rod, near(8, 0, 20)(rod), 1).shape
    smooth = next(e for e in blended.Edges() if e.IsClosed() and e.Center().z == pytest.approx(19))
    error(SelectionError, r"edge \d+ is smooth already", blended, [smooth], radius=0.5)
    error(SelectionError, "does not belong to the shape", rod, [box().Edges()[0]], radius=1)


def test_free_edges_and_nothing_are_refused():
    shell = cq.Shell.makeShell(box().Faces()[1:])
    free = box().Faces()[0].Edges()[0]
    edge = next(edge for edge in shell.Edges() if (edge.Center() - free.Center()).Length < 1e-9)
    error(SelectionError, "in the border of an open shell", shell, [edge], radius=1)
    error(InputError, "edges is empty", box(), [], radius=1)


def test_creased_face_is_refused_where_the_rail_would_have_to_cross_the_crease():
    """Two halves of one spline face that meet at an angle: no smooth rail follows the contacts over the crease."""
    x, far = np.linspace(-20, 20, 5), np.array([0, 1, 3, 1, 0])
    rows = [np.stack([x, np.full(5, y), z], -1) for y, z in ((-20, 0 * far), (20, far))]
    knots = ([0, 0, 0, 0.5, 0.5, 1, 1, 1], [0, 0, 1, 1])
    top = cq.Face(cqblend.to_face(cqblend.Surface.from_bspline((2, 1), knots, np.stack(rows, 1))))
    body = min(cq.Solid.makeBox(24, 24, 30, V(-12, -12, -20)).split(top).Solids(), key=lambda s: s.Center().z)
    error(GeometryError, r"edge \d+: the rails miss the contacts by .* mm", body, near(0, -12, 0.5)(body), radius=2)


def test_analytic_faces_keep_their_surfaces():
    body = sphere_with(cq.Solid.makeCylinder(3, 20, V(1, 0, 0), V(0.3, 0.2, 1)))
    edge = near(4, 0, 9)(body)
    result = check(body, edge, grows=True, angle=1e-5, radius=0.7)
    assert {f.geomType() for f in result.shape.Faces()} == {"SPHERE", "CYLINDER", "PLANE", "BSPLINE"}


def test_blend_domain_covers_its_face():
    body = box()
    face = cqblend.blend_edges(body, near(30, 20, 5)(body), 2, section="hermite").faces[0]
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face.wrapped)
    assert (v0, v1) == pytest.approx((0, 1), abs=1e-9)
    assert u1 - u0 > 0
