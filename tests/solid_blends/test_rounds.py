"""True rounds: where the arcs of a rolling ball are exact, blends are OCCT's own cylinders, tori and spheres.

What comes out is read by OCCT, and compared with its own fillet.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBuilderAPI import BRepBuilderAPI_Transform
from OCP.Geom import Geom_Circle, Geom_Line
from OCP.Geom2d import Geom2d_Circle, Geom2d_Line
from OCP.GeomAbs import GeomAbs_Cylinder, GeomAbs_Sphere, GeomAbs_Torus
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Trsf
from round_solids import find_corner, place_at_random, revolve_outline

import cqblend
from cqblend.errors import InputError, UnsupportedError

V = cq.Vector
Body = tuple[cq.Shape, cq.Edge]


def find_edge(body: cq.Shape, *point: float) -> cq.Edge:
    vertex = cq.Vertex.makeVertex(*point)
    return min((edge for edge in body.Edges() if not is_seam(edge, body)), key=vertex.distance)


def is_seam(edge: cq.Edge, body: cq.Shape) -> bool:
    return any(BRep_Tool.IsClosed_s(edge.wrapped, face.wrapped) for face in edge.ancestors(body, "Face").Faces())


def make_prism(angle: float) -> Body:
    """A wedge whose edge along Y has an angle (degrees) of material."""
    a = np.radians(angle)
    body = cq.Workplane("XZ").polyline([(0, 0), (30, 0), (30 * np.cos(a), 30 * np.sin(a))]).close().extrude(20).val()
    return body, find_edge(body, 0, -10, 0)


def make_bracket() -> Body:
    outline = [(0, 0), (20, 0), (20, 5), (5, 8), (5, 20), (0, 20)]
    body = cq.Workplane("XZ").polyline(outline).close().extrude(15).val()
    return body, find_edge(body, 5, -7, 8)


def make_lens() -> Body:
    body = cq.Workplane().circle(10).extrude(20).intersect(cq.Workplane().center(8, 0).circle(10).extrude(20)).val()
    return body, find_edge(body, 4, 9.165, 10)


def make_rod() -> Body:
    body = cq.Solid.makeCylinder(5, 10)
    return body, find_edge(body, 5, 0, 10)


def make_boss() -> Body:
    body = cq.Workplane().box(40, 40, 8).faces(">Z").workplane().circle(8).extrude(12).val()
    return body, find_edge(body, 8, 0, 4)


def make_hole() -> Body:
    body = cq.Workplane().box(30, 30, 6).faces(">Z").workplane().hole(8).val()
    return body, find_edge(body, 4, 0, 3)


def make_cone() -> Body:
    body = cq.Solid.makeCone(8, 4, 12)
    return body, find_edge(body, 8, 0, 0)


def make_tapered_rod() -> Body:
    rod, tip = cq.Workplane(cq.Solid.makeCylinder(6, 20)), cq.Workplane(cq.Solid.makeCone(6, 2, 8, V(0, 0, 20)))
    body = rod.union(tip).val()
    return body, find_edge(body, 6, 0, 20)


def make_ball_with_rod() -> Body:
    body = cq.Solid.makeSphere(8, angleDegrees1=-90).fuse(cq.Solid.makeCylinder(4, 16)).Solids()[0]
    return body, find_edge(body, 4, 0, 48**0.5)


def make_half_ring() -> Body:
    body = cq.Solid.makeTorus(12, 5).intersect(cq.Solid.makeBox(60, 60, 20, V(-30, -30, 0))).Solids()[0]
    return body, find_edge(body, 17, 0, 0)


def make_half_rod() -> Body:
    """The rim is half a circle, and ends on a plane through the axis."""
    body = cq.Solid.makeCylinder(6, 20).intersect(cq.Solid.makeBox(20, 40, 20, V(0, -20, 0))).Solids()[0]
    return body, find_edge(body, 6, 0, 20)


BODIES: dict[str, tuple[Callable[[], Body], bool, str]] = {
    "acute prism": (lambda: make_prism(40), False, "CYLINDER"),
    "square prism": (lambda: make_prism(90), False, "CYLINDER"),
    "obtuse prism": (lambda: make_prism(140), False, "CYLINDER"),
    "bracket": (make_bracket, True, "CYLINDER"),
    "lens": (make_lens, False, "CYLINDER"),
    "rod": (make_rod, False, "TORUS"),
    "boss": (make_boss, True, "TORUS"),
    "hole": (make_hole, False, "TORUS"),
    "cone": (make_cone, False, "TORUS"),
    "tapered rod": (make_tapered_rod, False, "TORUS"),
    "ball with rod": (make_ball_with_rod, True, "TORUS"),
    "half ring": (make_half_ring, False, "TORUS"),
    "half rod": (make_half_rod, False, "TORUS"),
}


def place(shape: cq.Shape, how: str) -> cq.Shape:
    if how == "moved":
        return shape.moved(cq.Location(V(5, 6, 7), V(1, 2, 0.5), 33))
    if how == "mirrored":
        turn = gp_Trsf()
        turn.SetMirror(gp_Ax2(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 1)))
        return cq.Shape.cast(BRepBuilderAPI_Transform(shape.wrapped, turn, True).Shape())
    return shape


def get_blend_face(result: cqblend.BlendResult) -> cq.Face:
    (face,) = result.faces
    return cq.Face(getattr(face, "wrapped", face))


def read_radius(face: cq.Face) -> float:
    surface = BRepAdaptor_Surface(face.wrapped)
    kind = surface.GetType()
    if kind == GeomAbs_Cylinder:
        return surface.Cylinder().Radius()
    if kind == GeomAbs_Sphere:
        return surface.Sphere().Radius()
    assert kind == GeomAbs_Torus
    return surface.Torus().MinorRadius()


@pytest.mark.parametrize("how", ["as made", "moved", "mirrored"])
@pytest.mark.parametrize("name", BODIES)
def test_the_blend_is_the_surface_of_the_ball_itself(name, how):
    make, grows, kind = BODIES[name]
    body, edge = make()
    number = next(k for k, one in enumerate(body.Edges()) if one.isSame(edge))
    body = place(body, how)
    edge = body.Edges()[number]
    result = cqblend.blend_edges(body, edge, 0.75)
    face, certificate = get_blend_face(result), result.certificate
    assert certificate.section == "arc"
    assert "valid blend, exact, arc, " in str(certificate)
    assert face.geomType() == kind
    assert read_radius(face) == 0.75
    assert (result.shape.Volume() > body.Volume()) == grows
    assert cqblend.verify(result.shape, result.faces).ok
    assert result.shape.isValid()
    assert certificate.angle <= 1e-13
    assert certificate.gap <= 1e-12
    assert max(edge.gap for edge in certificate.edges) <= 1e-12
    assert certificate.angle <= certificate.proof.angle <= 1e-10
    assert certificate.gap <= certificate.proof.gap <= 1e-10


@pytest.mark.parametrize("name", ["square prism", "obtuse prism", "bracket", "rod", "boss", "hole", "half rod"])
def test_it_is_as_large_and_as_light_as_the_fillet_of_occt(name, tmp_path: Path):
    """On planes and cylinders, where that is exact as well."""
    body, edge = BODIES[name][0]()
    blended, filleted = cqblend.blend_edges(body, edge, 0.75).shape, cq.Shape.cast(body.fillet(0.75, [edge]).wrapped)
    assert blended.Volume() == pytest.approx(filleted.Volume(), rel=1e-12)
    sizes = []
    for number, shape in enumerate((blended, filleted)):
        path = tmp_path / f"{number}.step"
        cq.exporters.export(cq.Workplane(shape), str(path))
        sizes.append(path.stat().st_size)
    assert sizes[0] < 1.1 * sizes[1]


@pytest.mark.parametrize("name", BODIES)
def test_curves_are_lines_and_circles_in_space_and_on_every_face(name):
    body, edge = BODIES[name][0]()
    result = cqblend.blend_edges(body, edge, 0.75)
    face = get_blend_face(result)
    for one in face.Edges():
        assert isinstance(BRep_Tool.Curve_s(one.wrapped, 0.0, 0.0), Geom_Line | Geom_Circle)
        for neighbour in one.ancestors(result.shape, "Face").Faces():
            pcurve = BRep_Tool.CurveOnSurface_s(one.wrapped, neighbour.wrapped, 0.0, 0.0)
            assert isinstance(pcurve, Geom2d_Line | Geom2d_Circle)


def test_another_program_reads_the_radius_from_a_step_file(tmp_path: Path):
    """In a process of its own, which has seen nothing of cqblend."""
    for name in ("square prism", "boss", "cone", "tapered rod"):
        body, edge = BODIES[name][0]()
        shape = cqblend.blend_edges(body, edge, 0.75).shape
        cq.exporters.export(cq.Workplane(shape), str(tmp_path / f"{name}.step"))
    code = (
        "import cadquery as cq, json, pathlib, sys\n"
        "from OCP.BRepAdaptor import BRepAdaptor_Surface\n"
        "found = {}\n"
        "for path in pathlib.Path(sys.argv[1]).glob('*.step'):\n"
        "    shape = cq.importers.importStep(str(path)).val()\n"
        "    surfaces = [(f.geomType(), BRepAdaptor_Surface(f.wrapped)) for f in shape.Faces()]\n"
        "    radii = [s.Torus().MinorRadius() for kind, s in surfaces if kind == 'TORUS']\n"
        "    radii += [s.Cylinder().Radius() for kind, s in surfaces if kind == 'CYLINDER']\n"
        "    found[path.stem] = (shape.isValid(), sorted(radii)[0])\n"
        "print(json.dumps(found))\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    assert len(found) == 4
    assert all(valid and radius == pytest.approx(0.75, rel=1e-12) for valid, radius in found.values())


def test_a_ball_as_large_as_the_rod_leaves_a_sphere():
    body, edge = make_tapered_rod()
    face = get_blend_face(cqblend.blend_edges(body, edge, 6.0))
    assert face.geomType() == "SPHERE"
    assert read_radius(face) == 6.0


@pytest.mark.parametrize(("radius", "round_kind"), [(2.0, "TORUS"), (4.0, "SPHERE")])
def test_a_chain_of_straight_and_circular_cells_is_as_light_as_its_cells(radius, round_kind):
    body = cq.Workplane().box(30, 20, 10).edges("|Z").fillet(4).val()
    result = cqblend.blend_edges(body, find_edge(body, 15, 0, 5), radius)
    kinds = [cq.Face(face.wrapped).geomType() for face in result.faces]
    assert sorted(kinds) == sorted(["CYLINDER", round_kind] * 4)
    assert result.certificate.section == "arc"
    rim = [edge for edge in body.Edges() if edge.Center().z > 4.9]
    assert result.shape.Volume() == pytest.approx(body.fillet(radius, rim).Volume(), rel=1e-9)
    between = [edge for edge in result.certificate.edges if edge.kind == "between"]
    assert len(between) == 8
    assert max(edge.angle for edge in between) <= 1e-13
    assert result.certificate.angle <= result.certificate.proof.angle <= 1e-10
    assert cqblend.verify(result.shape, result.faces).ok


def test_one_freeform_cell_makes_the_whole_chain_polynomial():
    outline = cq.Workplane().lineTo(20, 0).threePointArc((25, 5), (20, 10))
    outline = outline.spline([(10, 12), (0, 10)], tangents=[(-1, 0), (-1, 0)], includeCurrent=True)
    body = outline.threePointArc((-5, 5), (0, 0)).close().extrude(8).val()
    edge = find_edge(body, 10, 0, 8)
    assert cqblend.blend_edges(body, edge, 1).certificate.section == "hermite"
    with pytest.raises(UnsupportedError, match=r"face \d is freeform"):
        cqblend.blend_edges(body, edge, 1, section="arc")


@pytest.mark.parametrize("radius", [2.5, 3.0, 4.9])
def test_a_torus_may_reach_beyond_its_axis_elsewhere(radius):
    """The radius is more than half of the rod's: the torus crosses itself, but not where the blend is."""
    body, edge = make_rod()
    result = cqblend.blend_edges(body, edge, radius)
    assert get_blend_face(result).geomType() == "TORUS"
    volume = body.fillet(radius, [edge]).Volume()
    assert result.shape.Volume() == pytest.approx(volume, rel=1e-9)
    drilled = result.shape.cut(cq.Solid.makeCylinder(0.5, 30, V(2, 1, -5)))
    assert drilled.isValid()
    assert drilled.Volume() < result.shape.Volume() - 5


@pytest.mark.parametrize("name", ["square prism", "boss", "rod", "cone", "half rod"])
def test_cuts_shells_and_fillets_work_on_top(name):
    body, edge = BODIES[name][0]()
    shape = cqblend.blend_edges(body, edge, 1.2).shape
    at = edge.positionAt(0.3)
    drill = cq.Solid.makeCylinder(0.8, 60, at - V(30, 30, 30), V(1, 1, 1))
    parts = shape.cut(drill), shape.intersect(drill)
    assert all(part.isValid() for part in parts)
    assert sum(part.Volume() for part in parts) == pytest.approx(shape.Volume(), rel=1e-5)
    if name in ("rod", "boss"):
        hollow = cq.Workplane(shape).faces("<Z").shell(-0.4).val()
        assert hollow.isValid()
        assert 0 < hollow.Volume() < shape.Volume()
    far = [one for one in shape.Edges() if not is_seam(one, shape)]
    other = max(far, key=lambda one: (one.Center() - at).Length)
    later = cq.Shape.cast(shape.fillet(0.2, [other]).wrapped)
    assert later.isValid()


@pytest.mark.parametrize("kind", ["cylinder", "cone", "sphere", "torus", "spline", "step", "groove", "ring", "ball"])
@pytest.mark.parametrize("turn", [360.0, 130.0])
def test_corners_of_all_kinds_of_turned_bodies_are_tori_anywhere_in_space(kind, turn):
    body = revolve_outline(kind, 10.0, np.random.default_rng(12), turn).val()
    body, at = (place_at_random(one, 30.0, np.random.default_rng(5)) for one in (body, cq.Vertex.makeVertex(0, 0, 0)))
    result = cqblend.blend_edges(body, find_corner(body, at.Center()), 0.6)
    assert get_blend_face(result).geomType() == "TORUS"
    assert result.certificate.angle <= 1e-12
    assert result.certificate.gap <= 1e-11
    assert cqblend.verify(result.shape, result.faces).ok


def test_rails_on_a_sphere_about_another_axis_are_fitted_in_its_angles():
    ball = cq.Solid.makeSphere(10, angleDegrees1=-90).cut(cq.Solid.makeBox(40, 40, 40, V(4, -20, -20)))
    body = ball.cut(cq.Solid.makeBox(40, 40, 40, V(-20, -20, 5))).Solids()[0]
    result = cqblend.blend_edges(body, find_edge(body, 4, 84**0.5, 0), 0.7)
    assert {cq.Face(face.wrapped).geomType() for face in result.faces} == {"TORUS"}
    assert result.certificate.angle <= 1e-10
    assert result.certificate.angle <= result.certificate.proof.angle <= 1e-9
    assert result.certificate.gap <= result.certificate.proof.gap <= 1e-9


def test_the_energy_is_that_of_the_cylinder_within_the_face():
    """The ends are oblique: the integral of 1/R^2 over the face."""
    body, edge = make_prism(60)
    body = body.cut(cq.Solid.makeBox(200, 200, 200, V(-100, -200, -100)).rotate(V(), V(1, 0.2, 0.3), 25)).Solids()[0]
    edge = find_edge(body, 0, -18, 0)
    result = cqblend.blend_edges(body, edge, 0.8)
    face = get_blend_face(result)
    assert face.geomType() == "CYLINDER"
    assert result.certificate.fairness == pytest.approx(face.Area() / 0.8**2, rel=1e-5)


# What an arc is not.


def make_freeform() -> Body:
    outline = cq.Workplane().moveTo(0, 0).lineTo(20, 0).spline([(22, 8), (15, 15), (0, 10)], includeCurrent=True)
    body = outline.close().extrude(10).val()
    return body, max((e for e in body.Edges() if e.Center().z > 9.9), key=lambda e: e.Length())


def test_a_freeform_rim_is_polynomial_unless_arcs_are_demanded():
    body, edge = make_freeform()
    assert cqblend.blend_edges(body, edge, 0.5, chain=False).certificate.section == "hermite"
    with pytest.raises(UnsupportedError, match=r'section="arc" is not exact here: .*face \d is freeform'):
        cqblend.blend_edges(body, edge, 0.5, section="arc", chain=False)


def test_a_ball_beyond_the_axis_leaves_no_torus():
    """The rod has radius 6, the ball 8: the sections are arcs about points beyond the axis."""
    body, edge = make_tapered_rod()
    assert cqblend.blend_edges(body, edge, 8.0).certificate.section == "hermite"
    with pytest.raises(UnsupportedError, match="the ball's centre would be 2 mm beyond the axis"):
        cqblend.blend_edges(body, edge, 8.0, section="arc")


def test_a_radius_that_varies_makes_no_arcs_of_one_ball():
    body, edge = make_prism(90)
    varying = cqblend.linear(0.5, 1.0)
    assert cqblend.blend_edges(body, edge, varying).certificate.section == "hermite"
    with pytest.raises(UnsupportedError, match="the radius varies"):
        cqblend.blend_edges(body, edge, varying, section="arc")


@pytest.mark.parametrize(
    "options",
    [{"continuity": "G2"}, {"bulge": 0.9}, {"tangents": "chord"}, {"form": "compact"}, {"continuity": ("G1", "G0")}],
    ids=str,
)
def test_what_arcs_cannot_be_makes_the_sections_polynomial(options):
    body, edge = make_rod()
    result = cqblend.blend_edges(body, edge, 1.0, **options)
    assert result.certificate.section == "hermite"
    with pytest.raises(InputError, match=next(iter(options))):
        cqblend.blend_edges(body, edge, 1.0, section="arc", **options)


def test_widths_are_for_polynomials():
    body, edge = make_rod()
    assert cqblend.blend_edges(body, edge, width=1.0).certificate.section == "hermite"
    with pytest.raises(InputError, match="width is no option of section='arc': give the radius of the ball"):
        cqblend.blend_edges(body, edge, width=1.0, section="arc")


def test_polynomials_are_there_for_the_asking():
    body, edge = make_rod()
    result = cqblend.blend_edges(body, edge, 1.0, section="hermite")
    assert result.certificate.section == "hermite"
    assert get_blend_face(result).geomType() == "REVOLUTION"


def test_a_call_may_have_both_kinds_and_says_which_edge_has_which():
    body, freeform = make_freeform()
    body = cq.Workplane(body).faces(">Z").workplane(origin=(8, 5, 10)).hole(3).val()
    edges = [find_edge(body, 9.5, 5, 10), find_edge(body, *freeform.positionAt(0.5).toTuple())]
    result = cqblend.blend_edges(body, edges, 0.5, chain=False)
    assert result.certificate.section == "arc and hermite"
    numbers = [next(k for k, one in enumerate(body.Edges(), 1) if one.isSame(edge)) for edge in edges]
    found = {rail.edge: rail.section for rail in result.certificate.rails}
    assert found == dict(zip(numbers, ("arc", "hermite"), strict=True))
    table = str(result.certificate).splitlines()
    assert table[2].split()[-1] == "section"
    assert {line.split()[-1] for line in table[4:8]} == {"arc", "hermite"}
