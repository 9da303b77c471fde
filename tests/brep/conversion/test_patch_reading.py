"""Faces read as patches: against OCCT's evaluation and classifiers, closed forms of areas, and files of others."""

from __future__ import annotations

import math
from functools import cache
from itertools import pairwise

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepBuilderAPI import BRepBuilderAPI_Sewing
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.Geom import Geom_CylindricalSurface, Geom_SphericalSurface
from OCP.gp import gp_Ax3, gp_Pnt, gp_Trsf
from OCP.Poly import Poly_Triangle, Poly_Triangulation
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_IN, TopAbs_OUT
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape
from places import CASES

from cqblend.brep.conversion.patch_reading import read_patches
from cqblend.brep.conversion.spline_conversion import to_face
from cqblend.brep.topology import (
    ShapeIndex,
    explore_subshapes,
    find_end_vertices,
    make_closed_wire,
    make_edge,
    orient_forward,
)
from cqblend.errors import InputError, SelectionError, TopologyError
from cqblend.patterns.trimming.coplanar_patches import sample_loop_polygon
from cqblend.splines import Surface

BENT = np.array([[[0.0, 0, 0], [1, 0, 1], [2, 0, 0]], [[0, 3, 0], [1, 3, 1], [2, 3, 0]]])
NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
W = cq.Workplane


def mirrored_in_place(shape):
    mirror = gp_Trsf()
    mirror.SetMirror(gp_Pnt(1, 2, 3))
    return shape.Located(TopLoc_Location(mirror), False)


@cache
def bodies():
    wavy = [(0, 0), (4, 1), (5, 5), (1, 4)]
    cone = W(cq.Solid.makeCone(4, 1, 8))
    made = {
        "box": W().box(1, 2, 3),
        "notch": W().box(10, 10, 10).cut(W().box(5, 5, 20).translate((5, 5, 0))),
        "drilled": W().box(10, 10, 10).faces(">Z").workplane().hole(3),
        "cylinder": W().cylinder(10, 3),
        "cone": W(cq.Solid.makeCone(3, 0, 5)),
        "frustum": W(cq.Solid.makeCone(3, 1, 5)),
        "sphere": W().sphere(3),
        "segment": W().sphere(3, angle1=-30, angle2=60, angle3=200),
        "torus": W(cq.Solid.makeTorus(5, 1)),
        "loft": W().rect(4, 4).workplane(offset=5).circle(1).loft(),
        "cone and cylinder": cone.union(W("XZ").cylinder(12, 1).translate((0, 0, 3))),
        "fillets": W().box(10, 10, 10).edges("|Z").fillet(2).faces(">Z").edges().fillet(1),
        "mirror": W().box(10, 10, 10).faces(">Z").workplane().hole(3).mirror("XY"),
        "extruded": W().spline(wavy, periodic=True).close().extrude(5),
        "twisted": W().rect(4, 2).twistExtrude(5, 40),
        "swept": W().circle(1).sweep(W("XZ").spline([(0, 0), (1, 3), (4, 5)])),
        "revolved": W("XZ").moveTo(1, 0).spline([(3, 2), (2, 5)], includeCurrent=True).lineTo(1, 5).close().revolve(),
        "pierced sphere": W().sphere(10).cut(W().box(4, 5, 30).translate((3, 2, 0))),
        "hole at the seam": W().cylinder(10, 3).cut(W("YZ").cylinder(10, 1).translate((4, 0, 0))),
        "turned": W().box(3, 2, 1).union(W().cylinder(4, 0.5)).rotate((1, 0, 0), (0, 2, 3), 40).translate((5, 6, 7)),
    }
    shapes = {name: body.val().wrapped for name, body in made.items()}
    turned = W().cylinder(10, 3).cut(W().box(1, 1, 20)).val().wrapped
    return shapes | {"mirrored in place": mirrored_in_place(turned)}


NAMES = list(bodies())


@cache
def skin_of(name):
    return read_patches(bodies()[name])


def uses(skin):
    return [(patch, use) for patch in skin.patches for loop in patch.loops for use in loop]


def within(breaks, count=101):
    return np.linspace(breaks[0], breaks[-1], count)


def area(patch):
    """Return the area of a patch by Green's theorem on |Su x Sv|."""
    surface, total = patch.surface, 0.0
    u0, lines = surface.domain[0][0], surface.breaks[0]
    for loop in patch.loops:
        for use in loop:
            bounds = np.unique(np.concatenate([np.linspace(a, b, 9) for a, b in pairwise(use.breaks)]))
            half = np.diff(bounds)[:, None] / 2
            t, weights = (bounds[:-1, None] + half * (1 + NODES)).ravel(), (half * WEIGHTS).ravel()
            step = 1e-5 * (bounds[1] - bounds[0])
            rate = (use.pcurve(t + step)[:, 1] - use.pcurve(t - step)[:, 1]) / (2 * step)
            u, v = use.pcurve(t).T
            if np.ptp(v) < 1e-12 or (np.ptp(u) == 0 and u[0] == u0):
                continue
            low, high = np.minimum(lines[:-1], u[:, None]), np.minimum(lines[1:], u[:, None])
            at = low[..., None] + (high - low)[..., None] * (1 + NODES) / 2
            jet = surface.jet(at, np.broadcast_to(v[:, None, None], at.shape), 1)
            stretch = np.linalg.norm(np.cross(jet[1, 0], jet[0, 1]), axis=-1)
            inner = (stretch * WEIGHTS * (high - low)[..., None] / 2).sum(axis=(1, 2))
            total += (inner * rate * weights).sum() * (1 if use.forward else -1)
    return float(total)


@pytest.mark.parametrize("name", NAMES)
def test_edges_and_their_uses_are_those_of_occt(name):
    shape = bodies()[name]
    skin = read_patches(shape, merge_coplanar=False)
    edges = ShapeIndex(shape, TopAbs_EDGE)
    assert not skin.refused
    assert [patch.faces for patch in skin.patches] == [(i + 1,) for i in range(len(ShapeIndex(shape, TopAbs_FACE)))]
    for number, edge in skin.edges.items():
        t = within(edge.breaks)
        if not edge.degenerate:
            adaptor = BRepAdaptor_Curve(TopoDS.Edge_s(edges[number]))
            truth = np.array([adaptor.Value(float(one)).Coord() for one in t])
            np.testing.assert_allclose(edge.points(t), truth, rtol=0, atol=2e-14 * (1 + np.abs(truth).max()))
            np.testing.assert_array_equal(edge.curve(edge.parameter(t)), edge.points(t))
        ends = [skin.vertices[vertex] for vertex in edge.vertices]
        np.testing.assert_allclose(edge.points(t[[0, -1]]), ends, rtol=0, atol=1e-6)
        assert edge.gap <= BRep_Tool.Tolerance_s(TopoDS.Edge_s(edges[number]))
    for patch, use in uses(skin):
        edge = skin.edges[use.edge]
        t = within(edge.breaks)
        assert tuple(use.breaks[[0, -1]]) == tuple(edge.breaks[[0, -1]])
        apart = np.linalg.norm(patch.surface(*use.pcurve(t).T) - edge.points(t), axis=1).max()
        assert apart <= max(2 * edge.gap, 1e-13 * (1 + np.abs(edge.points(t)).max()))
        assert edge.degenerate == use.degenerate


@pytest.mark.parametrize("name", NAMES)
def test_loops_close_inside_their_surfaces_with_the_outer_one_first(name):
    for patch in skin_of(name).patches:
        (u0, u1), (v0, v1) = patch.surface.domain
        for loop in patch.loops:
            for before, use in zip(loop[-1:] + loop[:-1], loop, strict=True):
                np.testing.assert_allclose(before.ends[1], use.ends[0], rtol=0, atol=1e-7)
            u, v = sample_loop_polygon(loop).T
            assert u0 <= u.min() < u.max() <= u1
            assert v0 <= v.min() < v.max() <= v1
        turns = [signed_area(sample_loop_polygon(loop)) for loop in patch.loops]
        assert turns[0] > 0
        assert all(turn < 0 for turn in turns[1:])


def signed_area(points):
    x, y = points.T
    return (x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2


@pytest.mark.parametrize("name", NAMES)
def test_material_is_on_the_left_and_the_outer_side_outside(name):
    """A point beside the middle of each use, off the surface by a little, is in the solid on one side only."""
    shape = bodies()[name]
    classifier = BRepClass3d_SolidClassifier(shape)
    classifier.PerformInfinitePoint(1e-9)
    outside = classifier.State()  # OCCT takes a body mirrored by its location for its complement
    size = np.ptp([p for edge in skin_of(name).edges.values() for p in edge.points(within(edge.breaks))], axis=0).max()
    for patch, use in uses(skin_of(name)):
        low, high = use.breaks[0], use.breaks[-1]
        here, ahead = use.pcurve(np.array([0.47, 0.4701]) * (high - low) + low)
        jet = patch.surface.jet(*here, 1)
        along = (ahead - here) * (1 if use.forward else -1)
        if use.degenerate:
            continue
        left = np.array([-along[1], along[0]])
        left *= 1e-3 * size / np.linalg.norm(left @ [jet[1, 0], jet[0, 1]])
        jet = patch.surface.jet(*(here + left), 1)
        normal = np.cross(jet[1, 0], jet[0, 1]) * (1 if patch.outward else -1)
        normal *= 1e-4 * size / np.linalg.norm(normal)
        states = []
        for point in (jet[0, 0] - normal, jet[0, 0] + normal):
            classifier.Perform(gp_Pnt(*point), 1e-9)
            states.append(classifier.State())
        assert set(states) == {TopAbs_IN, TopAbs_OUT}, (patch.index, use.edge)
        assert states[1] == outside, (patch.index, use.edge)


AREAS = {
    "box": [6, 6, 3, 3, 2, 2],
    "cylinder": [60 * math.pi, 9 * math.pi, 9 * math.pi],
    "cone": [3 * math.pi * math.sqrt(34), 9 * math.pi],
    "frustum": [4 * math.pi * math.sqrt(29), 9 * math.pi, math.pi],
    "sphere": [36 * math.pi],
    "torus": [20 * math.pi**2],
    "drilled": [100 - 2.25 * math.pi] * 2 + [100] * 4 + [30 * math.pi],
}


@pytest.mark.parametrize("name", AREAS)
def test_areas_within_the_loops_are_the_closed_forms(name):
    found = sorted(area(patch) for patch in skin_of(name).patches)
    np.testing.assert_allclose(found, sorted(AREAS[name]), rtol=2e-10)


@pytest.mark.parametrize("name", NAMES)
def test_areas_within_the_loops_are_those_of_occt(name):
    shape = bodies()[name]
    faces = ShapeIndex(shape, TopAbs_FACE)
    for patch in skin_of(name).patches:
        # OCCT's own areas are good for four digits on trimmed and freeform faces
        assert area(patch) == pytest.approx(sum(cq.Shape.cast(faces[n]).Area() for n in patch.faces), rel=4e-4)


def test_kinds_and_rulings():
    kinds = {name: {patch.kind for patch in skin_of(name).patches} for name in NAMES}
    assert kinds["box"] == {"plane"}
    assert kinds["drilled"] == {"plane", "cylinder"}
    assert kinds["cone"] == {"plane", "cone"}
    assert kinds["sphere"] == {"sphere"}
    assert kinds["torus"] == {"torus"}
    assert kinds["extruded"] == {"plane", "extrusion"}
    assert kinds["revolved"] == {"plane", "cylinder", "revolution"}
    for name in NAMES:
        for patch in skin_of(name).patches:
            if patch.kind in ("plane", "cylinder", "cone", "extrusion"):
                assert patch.surface.degree[1] == 1


@pytest.mark.parametrize("flipped", [False, True])
def test_a_face_that_is_ruled_in_u_is_seen_with_its_parameters_exchanged(flipped):
    poles = np.random.default_rng(5).normal(size=(2, 5, 3)) + np.array([[[0, 0, 0]], [[9, 0, 0]]])
    poles[..., 1] += 3 * np.arange(5)
    face = to_face(Surface.from_bspline((1, 3), ([0, 0, 1, 1], [0, 0, 0, 0, 1, 2, 2, 2, 2]), poles))
    patch = read_patches(face.Reversed() if flipped else face).patches[0]
    assert patch.surface.degree == (3, 1)
    assert patch.outward == flipped
    assert signed_area(sample_loop_polygon(patch.loops[0])) > 0
    assert area(patch) == pytest.approx(cq.Shape.cast(face).Area(), rel=1e-4)


def test_a_flat_spline_is_a_plane_and_joins_its_neighbour():
    def plate(low, high):
        grid = np.array([[[x, y, 0.5 * x] for y in (0, 1, 4)] for x in (low, 0.3 * low + 0.7 * high, high)])
        return to_face(Surface.from_bspline((2, 2), ([0, 0, 0, 1, 1, 1], [0, 0, 0, 1, 1, 1]), grid))

    sewing = BRepBuilderAPI_Sewing(1e-6)
    for face in (plate(0.0, 2.0), plate(2.0, 3.0)):
        sewing.Add(face)
    sewing.Perform()
    (patch,) = read_patches(sewing.SewedShape()).patches
    assert (patch.kind, patch.faces, len(patch.loops)) == ("plane", (1, 2), 1)
    assert len(patch.loops[0]) == 6
    assert area(patch) == pytest.approx(12 * math.sqrt(1.25), rel=1e-9)


@pytest.mark.parametrize("turned", [False, True])
def test_planes_are_seen_from_outside(turned):
    shape = bodies()["drilled"]
    planes = [patch for patch in read_patches(shape.Reversed() if turned else shape).patches if patch.frame is not None]
    assert len(planes) == 6
    for patch in planes:
        xy = np.array([[0.1, 0.3], [0.2, 0.4]])
        np.testing.assert_allclose(patch.surface(*xy.T), patch.frame.to_world_coords(xy), atol=1e-12)
        np.testing.assert_allclose(patch.frame.to_local_coords(patch.frame.to_world_coords(xy)), xy, atol=1e-12)
        outer = patch.frame.normal @ patch.frame.origin  # the cube is centred, with sides of 10
        assert outer == pytest.approx(-5 if turned else 5)


def test_angles_across_edges():
    def angles(name):
        return {round(edge.angle, 9) for edge in skin_of(name).edges.values() if not math.isnan(edge.angle)}

    quarter = round(math.pi / 2, 9)
    assert angles("box") == {quarter}
    assert angles("notch") == {quarter, -quarter}
    assert angles("drilled") == {quarter, 0.0}
    assert angles("mirrored in place") == {quarter, -quarter, 0.0}
    assert angles("cone") == {0.0, round(math.pi - math.atan(5 / 3), 9)}
    assert {abs(angle) for angle in angles("fillets")} == {0.0, quarter}


def test_angles_are_unknown_where_there_is_one_face_or_none_has_a_normal():
    box = read_patches([face.wrapped for face in W().box(1, 2, 3).faces("<X or <Y").vals()])
    assert sorted(math.isnan(edge.angle) for edge in box.edges.values()) == [False] + [True] * 6
    sphere = read_patches(bodies()["sphere"])
    assert [edge.degenerate for edge in sphere.edges.values() if math.isnan(edge.angle)] == [True, True]


def test_faces_picked_from_a_shape_keep_its_numbers():
    shape = bodies()["drilled"]
    faces, edges = ShapeIndex(shape, TopAbs_FACE), ShapeIndex(shape, TopAbs_EDGE)
    skin = read_patches([faces[5], faces[2]], numbered_shape=shape)
    assert [patch.faces for patch in skin.patches] == [(2,), (5,)]
    expected = {edges.find_number(edge) for n in (2, 5) for edge in explore_subshapes(faces[n], TopAbs_EDGE)}
    assert set(skin.edges) == expected
    assert {n: edge.faces for n, edge in skin.edges.items() if len(edge.faces) == 2} == {
        n: edge.faces for n, edge in read_patches(shape).edges.items() if set(edge.faces) == {2, 5}
    }
    assert [patch.faces for patch in read_patches([faces[5], faces[2]]).patches] == [(1,), (2,)]


def test_instances_of_one_body_are_different_faces():
    body = W().box(1, 2, 3).val()
    skin = read_patches(cq.Compound.makeCompound([body, body.moved(cq.Location((5, 0, 0)))]).wrapped)
    assert len(skin.patches) == 12
    assert len(skin.edges) == 24


def test_a_face_without_wires_gets_its_natural_boundary():
    face = TopoDS_Face()
    BRep_Builder().MakeFace(face, Geom_SphericalSurface(gp_Ax3(), 2.0), 1e-7)
    (patch,) = read_patches(face).patches
    assert area(patch) == pytest.approx(16 * math.pi, rel=1e-9)
    assert len(patch.loops[0]) == 4


def test_uses_tell_who_shares_an_edge():
    skin = read_patches(bodies()["drilled"])
    for number, places in skin.locate_edge_uses().items():
        assert [skin.patches[i].index for i, _, _ in places] == list(skin.edges[number].faces)
        assert all(skin.patches[i].loops[j][k].edge == number for i, j, k in places)


def test_what_is_no_shape_or_has_no_face_is_refused():
    with pytest.raises(InputError, match="a null shape"):
        read_patches(TopoDS_Shape())
    with pytest.raises(InputError, match="'box'"):
        read_patches(["box"])
    with pytest.raises(SelectionError, match="no face"):
        read_patches([])
    with pytest.raises(SelectionError, match="no face"):
        read_patches(cq.Edge.makeCircle(1).wrapped)
    with pytest.raises(SelectionError, match="does not belong"):
        read_patches(W().box(1, 1, 1).faces(">Z").val().wrapped, numbered_shape=bodies()["box"])


def test_an_edge_of_three_faces_is_refused_by_name():
    sewing = BRepBuilderAPI_Sewing(1e-6, True, True, True, True)
    for angle in (0, 120, 240):
        sewing.Add(cq.Face.makePlane(2, 2, (1, 0, 0)).rotate((0, 0, 0), (0, 1, 0), angle).wrapped)
    sewing.Perform()
    with pytest.raises(TopologyError, match=r"faces 1, 2, 3 all meet at edge \d+"):
        read_patches(sewing.SewedShape())


def test_a_face_that_cannot_be_read_is_named_and_the_others_are_not_lost():
    triangles = Poly_Triangulation(3, 1, False)
    for i, point in enumerate([(0, 0, 0), (1, 0, 0), (0, 1, 0)], start=1):
        triangles.SetNode(i, gp_Pnt(*point))
    triangles.SetTriangle(1, Poly_Triangle(1, 2, 3))
    mesh, endless = TopoDS_Face(), TopoDS_Face()
    BRep_Builder().MakeFace(mesh, triangles)
    BRep_Builder().MakeFace(endless, Geom_CylindricalSurface(gp_Ax3(), 1.0), 1e-7)
    skin = read_patches([mesh, W().box(1, 1, 1).faces(">Z").val().wrapped, endless])
    assert [patch.index for patch in skin.patches] == [2]
    assert {n: str(error).split(":")[0] for n, error in skin.refused.items()} == {1: "face 1", 3: "face 3"}
    assert "only a triangulation" in str(skin.refused[1])
    assert "unbounded" in str(skin.refused[3])
    assert all(isinstance(error, InputError) for error in skin.refused.values())


def with_edges(face, change):
    """Return a copy of a face with other edges: those that a function returns for each."""
    copy = TopoDS.Face_s(face.EmptyCopied())
    edges = [other for i, edge in enumerate(explore_subshapes(face, TopAbs_EDGE)) for other in change(i, edge, copy)]
    BRep_Builder().Add(copy, make_closed_wire(edges))
    return copy


def bare(edge):
    """Return an edge with its curve in space alone."""
    copy = make_edge(
        BRep_Tool.Curve_s(edge, 0.0, 0.0), find_end_vertices(orient_forward(edge)), BRep_Tool.Range_s(edge)
    )
    return TopoDS.Edge_s(copy.Oriented(edge.Orientation()))


def shortened(edge, face):
    first, last = BRep_Tool.Range_s(edge)
    BRep_Builder().Range(edge, face, first, (first + last) / 2)
    return edge


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda i, edge, face: [edge] if i else [], r"face 1: its loop does not close between edges \d and \d"),
        (lambda i, edge, face: [edge if i else bare(edge)], r"face 1: edge \d has no curve in its parameters"),
        (lambda i, edge, face: [edge if i else shortened(edge, face)], r"face 1: edge \d runs over .* but over .*"),
        (lambda i, edge, face: [], "face 1: it has no boundary"),
    ],
)
def test_damaged_faces_say_what_is_wrong(change, message):
    patch = to_face(Surface.from_bspline((1, 2), ([0, 0, 1, 1], [0, 0, 0, 1, 1, 1]), BENT))
    skin = read_patches(with_edges(patch, change))
    assert not skin.patches
    with pytest.raises(TopologyError, match=message):
        raise skin.refused[1]


def test_an_edge_without_a_curve_in_space_is_taken_from_its_face():
    face = to_face(Surface.from_bspline((1, 2), ([0, 0, 1, 1], [0, 0, 0, 1, 1, 1]), BENT))
    expected = read_patches(face)
    for edge in explore_subshapes(face, TopAbs_EDGE):
        BRep_Builder().UpdateEdge(edge, None, 1e-7)
    skin = read_patches(face)
    assert area(skin.patches[0]) == pytest.approx(area(expected.patches[0]), rel=1e-12)
    for number, edge in skin.edges.items():
        t = within(edge.breaks)
        assert edge.curve is None
        np.testing.assert_allclose(edge.points(t), expected.edges[number].points(t), atol=1e-14)


def test_files_of_others_are_read():
    path = CASES / "nist__nist_ctc_01_asme1_ap242-e1.stp"
    if not path.exists():
        pytest.skip("the shared cases are not here")
    shape = cq.importers.importStep(str(path)).val().wrapped
    skin, edges, faces = read_patches(shape), ShapeIndex(shape, TopAbs_EDGE), ShapeIndex(shape, TopAbs_FACE)
    assert not skin.refused
    for number, edge in skin.edges.items():
        assert edge.gap <= 1.1 * BRep_Tool.Tolerance_s(TopoDS.Edge_s(edges[number]))
    for patch in skin.patches:
        assert area(patch) == pytest.approx(sum(cq.Shape.cast(faces[n]).Area() for n in patch.faces), rel=1e-5)
