"""Measured continuity against closed forms: whatever the number, it was known before OCCT was asked."""

import math

import cadquery as cq
import numpy as np
import pytest
from measured_shapes import bspline, edges, faces, real_edges, roof, wave, wrapped
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_NurbsConvert, BRepBuilderAPI_Sewing
from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec2d
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Edge

from cqblend.brep.measurement.edge_continuity import measure_continuity
from cqblend.brep.measurement.edge_samples import SideSampler, choose_sample_parameters, read_edge_curve
from cqblend.brep.measurement.edge_sides import find_edge_sides
from cqblend.brep.measurement.surface_evaluation import compute_normals, express_curvature, normalise_vectors
from cqblend.errors import InputError, SelectionError


def picked(workplane: cq.Workplane, selector: str) -> TopoDS_Edge:
    (edge,) = workplane.edges(selector).vals()
    return edge.wrapped


def sample_parameters(sides, count):
    """Return where the sides of an edge are compared."""
    return choose_sample_parameters([SideSampler(side) for side in sides], read_edge_curve(sides[0][1]), count)


class Sampled:
    """Samples of a face along an edge, as rows: points and normals (n, 3), curvature (n, 3, 3), parameters (n, 2).

    The curvature is a symmetric tensor h: the normal curvature in the unit tangent direction w is w.h.w, positive where
    the face bends towards its outward normal.
    """

    def __init__(self, edge, face, ts):
        samples = SideSampler((face, edge)).sample(np.asarray(ts))
        self.points, self.normals, self.parameters = samples.points.T, samples.normals.T, samples.parameters.T
        normals, areas = compute_normals(samples.jets, samples.sign)
        along = normalise_vectors(samples.jets[1])
        frame = np.stack((along, np.cross(normals, along, axis=0)))
        first, mixed, second = express_curvature(samples.jets, normals, areas, along)
        self.curvature = np.einsum("kin,kln,ljn->nij", frame, np.array([[first, mixed], [mixed, second]]), frame)


def capsule():
    """A cylinder of radius 5 on z in [0, 10], capped below by half a ball."""
    return cq.Workplane().circle(5).extrude(10).union(cq.Workplane().sphere(5))


class TestSharpEdges:
    def test_all_edges_of_a_box_are_right_angles(self):
        box = wrapped(cq.Workplane().box(3, 4, 5))
        for edge in edges(box):
            measured = measure_continuity(box, edge)
            assert measured.kind == "convex"
            assert measured.angle == pytest.approx(math.pi / 2, abs=1e-15)
            assert measured.gap < 1e-15
            assert measured.curvature_jump == 0.0
            assert measured.tolerance == 1e-7

    def test_the_inner_corner_of_an_angle_bracket_is_concave(self):
        bracket = cq.Workplane().polyline([(0, 0), (9, 0), (9, 2), (2, 2), (2, 9), (0, 9)]).close().extrude(5)
        shape = wrapped(bracket)
        assert sorted(measure_continuity(shape, edge).kind for edge in edges(shape)) == ["concave"] + ["convex"] * 17

    def test_edges_of_a_void_are_concave(self):
        shape = wrapped(cq.Workplane().box(9, 9, 9).cut(cq.Workplane().box(5, 5, 5)))
        assert (
            sorted(measure_continuity(shape, edge).kind for edge in edges(shape)) == ["concave"] * 12 + ["convex"] * 12
        )

    @pytest.mark.parametrize("degrees", [0.5, 30.0, 60.0, 89.0, 120.0, 179.0])
    def test_a_wedge_turns_the_normal_by_the_supplement_of_its_angle(self, degrees):
        x, y = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
        wedge = cq.Workplane().polyline([(0, 0), (10, 0), (10 * x, 10 * y)]).close().extrude(7)
        edge = picked(wedge, cq.selectors.BoxSelector((-0.01, -0.01, -1), (0.01, 0.01, 8)))
        measured = measure_continuity(wrapped(wedge), edge)
        assert measured.kind == "convex"
        assert measured.angle == pytest.approx(math.pi - math.radians(degrees), abs=1e-13)

    def test_two_equal_crossed_cylinders(self):
        """Point (R c, R s, R c), normals (c, s, 0) and (0, s, c): cos(angle) = s^2, unfolded jump (2/R) s/(1 + s^2)."""
        radius = 10.0
        cross = cq.Workplane().circle(radius).extrude(30, both=True)
        shape = wrapped(cross.union(cq.Workplane("YZ").circle(radius).extrude(30, both=True)))
        measured = [measure_continuity(shape, edge) for edge in edges(shape)]
        ellipses = [one for one in measured if one.kind == "concave"]
        assert len(ellipses) >= 4
        for one in ellipses:
            assert one.angle == pytest.approx(math.pi / 2, abs=1e-6)
            assert one.curvature_jump == pytest.approx(1 / radius, rel=1e-6)

    @pytest.mark.parametrize("samples", [2, 17, 1000])
    def test_the_angle_along_a_crossing_of_cylinders_sample_by_sample(self, samples):
        shape = wrapped(
            cq.Workplane().circle(10).extrude(30, both=True).union(cq.Workplane("YZ").circle(10).extrude(30, both=True))
        )
        edge = next(edge for edge in edges(shape) if measure_continuity(shape, edge, 50).kind == "concave")
        sides = find_edge_sides(shape, edge)
        ts = sample_parameters(sides, samples)
        one, two = (Sampled(use, face, ts) for face, use in sides)
        cosine = np.einsum("ni,ni->n", one.normals, two.normals)
        np.testing.assert_allclose(cosine, one.points[:, 1] ** 2 / 100, atol=2e-8)  # gap of OCCT's boolean: 4e-8


class TestSmoothEdges:
    def test_a_round_meets_its_planes_with_a_jump_of_one_over_r(self):
        part = cq.Workplane().box(10, 10, 10).edges("|Z").fillet(2)
        for edge in part.edges("|Z").vals():
            measured = measure_continuity(wrapped(part), edge.wrapped)
            assert measured.kind == "smooth"
            assert measured.angle < 1e-15
            assert measured.gap < 1e-14
            assert measured.curvature_jump == pytest.approx(1 / 2, abs=1e-14)

    def test_a_concave_round_too(self):
        part = cq.Workplane().box(20, 20, 4).faces(">Z").workplane().rect(8, 8).extrude(6)
        part = part.edges(cq.selectors.BoxSelector((-4.1, -4.1, 1.9), (4.1, 4.1, 2.1))).fillet(1)
        jumps = [measure_continuity(wrapped(part), edge) for edge in edges(wrapped(part))]
        smooth = [one.curvature_jump for one in jumps if one.kind == "smooth"]
        assert max(smooth) == pytest.approx(1.0, abs=1e-12)

    def test_half_a_ball_on_a_cylinder_jumps_by_one_over_r_along_the_axis_only(self):
        shape = wrapped(capsule())
        rim = next(e for e in real_edges(shape) if abs(cq.Edge(e).Center().z) < 0.1 and cq.Edge(e).IsClosed())
        measured = measure_continuity(shape, rim)
        assert measured.kind == "smooth"
        assert measured.angle < 1e-15
        assert measured.curvature_jump == pytest.approx(1 / 5, abs=1e-14)
        sides = find_edge_sides(shape, rim)
        ts = sample_parameters(sides, 20)
        one, two = (Sampled(use, face, ts) for face, use in sides)
        tangents = np.cross(one.normals, [0.0, 0.0, 1.0])
        for phi in np.linspace(0, math.pi, 7):
            w = math.cos(phi) * tangents + math.sin(phi) * np.array([0.0, 0.0, 1.0])
            jump = np.einsum("ni,nij,nj->n", w, one.curvature - two.curvature, w)
            np.testing.assert_allclose(np.abs(jump), math.sin(phi) ** 2 / 5, atol=1e-14)

    @pytest.mark.parametrize("nurbs", [False, True])
    def test_seams_are_smooth(self, nurbs):
        # At a share d of the way from a NURBS pole, a normal is known to eps/d only; the nearest sample has d = 1e-5.
        for workplane, limit in ((cq.Workplane().circle(4).extrude(9), 1e-12), (cq.Workplane().sphere(4), 2e-11)):
            shape = wrapped(workplane)
            if nurbs:
                shape = BRepBuilderAPI_NurbsConvert(shape, True).Shape()
            seams = [
                edge
                for edge in real_edges(shape)
                if find_edge_sides(shape, edge)[0][0].IsSame(find_edge_sides(shape, edge)[1][0])
            ]
            assert len(seams) == 1
            measured = measure_continuity(shape, seams[0])
            assert measured.kind == "smooth"
            assert measured.angle < limit
            assert measured.gap < 1e-13
            assert measured.curvature_jump < 1e-7
            assert measured.samples >= 1000

    def test_the_poles_of_a_sphere_have_no_normal_and_are_left_out(self):
        ball = wrapped(cq.Workplane().sphere(4))
        (seam,) = real_edges(ball)
        sides = find_edge_sides(ball, seam)
        ts = sample_parameters(sides, 100)
        samples = Sampled(sides[0][1], sides[0][0], ts)
        lost = np.isnan(samples.normals).any(axis=1)
        assert lost.sum() == 2
        assert lost[0]
        assert lost[-1]
        np.testing.assert_allclose(samples.points[~lost], 4 * samples.normals[~lost], atol=1e-13)
        assert measure_continuity(ball, seam, 100).samples == ts.size - 2


class TestOrientationAndLocation:
    def test_the_sphere_sees_minus_one_over_r_from_inside_and_plus_one_from_a_void(self):
        ball = cq.Workplane().sphere(4)
        for shape, sign in ((wrapped(ball), -1), (wrapped(cq.Workplane().box(20, 20, 20).cut(ball)), 1)):
            seam = next(e for e in real_edges(shape) if cq.Edge(e).geomType() == "CIRCLE")
            (face, use), _ = find_edge_sides(shape, seam)
            samples = Sampled(use, face, sample_parameters(find_edge_sides(shape, seam), 50)[1:-1])
            w = np.cross(samples.normals, [0.3, -0.5, 0.9])
            w /= np.linalg.norm(w, axis=1, keepdims=True)
            np.testing.assert_allclose(np.einsum("ni,nij,nj->n", w, samples.curvature, w), sign / 4, rtol=1e-7)
            np.testing.assert_allclose(samples.normals, -sign * samples.points / 4, atol=1e-9)

    def test_moving_reversing_and_mirroring_change_nothing(self):
        part = cq.Workplane().box(10, 10, 10).edges("|Z").fillet(2)
        turn = gp_Trsf()
        turn.SetRotation(gp_Ax1(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 2)), 0.7)
        here = wrapped(part)
        reference = [measure_continuity(here, edge, 50) for edge in edges(here)]
        for shape in (here.Moved(TopLoc_Location(turn)), wrapped(part.mirror("XY")), here.Moved(TopLoc_Location(turn))):
            for edge, before in zip(edges(shape), reference, strict=True):
                after = measure_continuity(shape, edge, 50)
                assert after.kind == before.kind
                assert after.angle == pytest.approx(before.angle, abs=1e-14)
                assert after.curvature_jump == pytest.approx(before.curvature_jump, abs=1e-14)
                assert after.gap < 1e-13

    def test_an_inside_out_solid_swaps_convex_and_concave(self):
        box = wrapped(cq.Workplane().box(1, 2, 3))
        assert {measure_continuity(box.Reversed(), edge).kind for edge in edges(box)} == {"concave"}


class TestFreeform:
    def test_normal_curvature_along_the_edge_is_meusniers(self):
        """w.h.w in the edge's direction is C''.n / |C'|^2, by finite differences of the 3D curve."""
        face = wave()
        for edge in edges(face):
            ts = np.linspace(0.1, 0.9, 9)
            samples = Sampled(edge, face, ts)
            step = 1e-3
            before, at, after = (Sampled(edge, face, ts + d).points for d in (-step, 0.0, step))
            velocity, acceleration = (after - before) / (2 * step), (after - 2 * at + before) / step**2
            speed = np.linalg.norm(velocity, axis=1)
            w = velocity / speed[:, None]
            expected = np.einsum("ni,ni->n", acceleration, samples.normals) / speed**2
            np.testing.assert_allclose(np.einsum("ni,nij,nj->n", w, samples.curvature, w), expected, atol=2e-5)

    def test_the_tensor_is_symmetric_and_kills_the_normal(self):
        face = wave()
        samples = Sampled(edges(face)[0], face, np.linspace(0, 1, 11))
        np.testing.assert_allclose(samples.curvature, samples.curvature.transpose(0, 2, 1), atol=1e-15)
        np.testing.assert_allclose(np.einsum("nij,nj->ni", samples.curvature, samples.normals), 0, atol=1e-15)

    def test_a_native_fillet_on_a_freeform_rim_is_smooth_but_not_exactly(self):
        spline = [(20 * math.cos(a), 10 * math.sin(a)) for a in np.linspace(0, 2 * math.pi, 17)[:-1]]
        part = cq.Workplane().spline(spline, periodic=True).close().extrude(10).faces(">Z").edges().fillet(1)
        shape = wrapped(part)
        smooth = [one for one in (measure_continuity(shape, edge) for edge in edges(shape)) if one.kind == "smooth"]
        worst = max(one.angle for one in smooth)
        assert 1e-9 < worst < 1e-3
        assert max(one.curvature_jump for one in smooth) == pytest.approx(1.0, abs=0.3)


class TestGap:
    @pytest.mark.parametrize("shift", [1e-9, 1e-4, 0.3])
    def test_a_shifted_pcurve_is_a_gap_of_the_shift(self, shift):
        part = cq.Workplane().circle(5).extrude(10)
        shape = wrapped(part)
        (side,) = (face.wrapped for face in part.faces("%CYLINDER").vals())
        rim = picked(part.faces(">Z"), "%CIRCLE")
        pcurve = BRep_Tool.CurveOnSurface_s(rim, side, 0.0, 0.0)
        BRep_Builder().UpdateEdge(rim, pcurve.Translated(gp_Vec2d(0, -shift)), side, 1e-7)
        measured = measure_continuity(shape, rim)
        assert measured.gap == pytest.approx(shift, abs=1e-14)
        assert measured.angle == pytest.approx(math.pi / 2, abs=1e-14)


class TestKnotLines:
    def test_an_edge_on_a_knot_line_reads_each_face_on_its_own_side(self):
        """Two faces of one C0 surface, split at its ridge: OCCT alone would read the right-hand side for both."""
        sewing = BRepBuilderAPI_Sewing(1e-7)
        for low, high in ((0, 1), (1, 2)):
            sewing.Add(BRepBuilderAPI_MakeFace(roof(), low, high, 0, 1, 1e-7).Face())
        sewing.Perform()
        shell = sewing.SewedShape()
        shared = [edge for edge in edges(shell) if abs(cq.Edge(edge).Center().x - 1) < 1e-9]
        assert len(shared) == 1
        measured = measure_continuity(shell, shared[0])
        assert measured.angle == pytest.approx(math.pi / 2, abs=1e-14)
        assert measured.kind == "convex"
        assert measured.gap < 1e-15

    def test_samples_cluster_beside_crossings_of_knot_lines_and_never_on_them(self):
        x, y = np.meshgrid(np.linspace(0, 3, 6), np.linspace(0, 3, 6), indexing="ij")
        surface = bspline(np.stack((x, y, x * y), axis=-1), ((0, 0.3, 1), (4, 2, 4)), ((0, 0.6, 1), (4, 2, 4)), (3, 3))
        face = BRepBuilderAPI_MakeFace(surface, 1e-7).Face()
        for edge in edges(face):
            (knot,) = (k for k, axis in ((0.3, 1), (0.6, 0)) if np.ptp(self.uv(edge, face)[:, axis]) < 1e-12)
            ts = sample_parameters([(face, edge)], 101)
            nearest = np.sort(np.abs(self.uv(edge, face, ts)[:, 0 if knot == 0.3 else 1] - knot))
            np.testing.assert_allclose(nearest[:6], [1e-8, 1e-8, 1e-5, 1e-5, 1e-3, 1e-3], rtol=1e-6)

    @staticmethod
    def uv(edge, face, ts=(0.1, 0.9)):
        return Sampled(edge, face, ts).parameters


class TestRefusals:
    def test_a_foreign_edge(self):
        box = wrapped(cq.Workplane().box(1, 1, 1))
        with pytest.raises(SelectionError, match="not an edge of the shape"):
            measure_continuity(box, edges(wrapped(cq.Workplane().box(1, 1, 1)))[0])

    def test_a_degenerate_edge(self):
        ball = wrapped(cq.Workplane().sphere(1))
        pole = next(edge for edge in edges(ball) if BRep_Tool.Degenerated_s(edge))
        with pytest.raises(SelectionError, match="degenerate"):
            measure_continuity(ball, pole)

    def test_a_free_boundary(self):
        face = wave()
        with pytest.raises(SelectionError, match="free boundary"):
            measure_continuity(face, edges(face)[0])

    def test_an_edge_with_more_than_two_sides(self):
        corner = [(0, 0, 0), (0, 0, 1)]
        sheets = [
            cq.Face.makeFromWires(cq.Wire.makePolygon([*corner, p], close=True))
            for p in ((1, 0, 0), (0, 1, 0), (-1, 0, 0))
        ]
        sewing = BRepBuilderAPI_Sewing(1e-7)
        sewing.SetNonManifoldMode(True)
        for sheet in sheets:
            sewing.Add(sheet.wrapped)
        sewing.Perform()
        fan = sewing.SewedShape()
        hinge = next(
            edge for edge in edges(fan) if abs(cq.Edge(edge).Center().x) + abs(cq.Edge(edge).Center().y) < 1e-9
        )
        with pytest.raises(SelectionError, match="used 3 times"):
            measure_continuity(fan, hinge)

    @pytest.mark.parametrize("wrong", [None, "edge", 3, cq.Workplane()])
    def test_wrong_types(self, wrong):
        box = wrapped(cq.Workplane().box(1, 1, 1))
        with pytest.raises(InputError, match="shape is"):
            measure_continuity(wrong, edges(box)[0])
        with pytest.raises(InputError, match="edge is"):
            measure_continuity(box, wrong)

    def test_a_face_is_not_an_edge_and_a_null_shape_is_nothing(self):
        box = wrapped(cq.Workplane().box(1, 1, 1))
        with pytest.raises(InputError, match="edge is of type face: edge is needed"):
            measure_continuity(box, faces(box)[0])
        with pytest.raises(InputError, match="null"):
            measure_continuity(box, TopoDS_Edge())

    @pytest.mark.parametrize("samples", [1, 0, -3, 2.5, None, True])
    def test_too_few_samples(self, samples):
        box = wrapped(cq.Workplane().box(1, 1, 1))
        with pytest.raises(InputError, match="at least 2"):
            measure_continuity(box, edges(box)[0], samples)


def test_a_continuity_reads_aloud():
    box = wrapped(cq.Workplane().box(1, 1, 1))
    text = str(measure_continuity(box, edges(box)[0], 100))
    assert text.startswith("convex: gap 0 mm, angle 1.6 rad, curvature jump 0 1/mm, edge tolerance 1e-07 mm (10")
