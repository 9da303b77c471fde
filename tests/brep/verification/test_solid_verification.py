"""Sound solids pass, and every way to break one is noticed by name."""

import math

import cadquery as cq
import numpy as np
import pytest
from measured_shapes import bspline, prism, subshapes, wrapped
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepTools import BRepTools
from OCP.GeomAbs import GeomAbs_G1
from OCP.gp import gp_Ax1, gp_Dir, gp_Pnt, gp_Trsf, gp_Vec2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Face, TopoDS_Shape, TopoDS_Shell, TopoDS_Solid
from solid_problems import list_problems

import cqblend
from cqblend.brep.bodies import make_shell
from cqblend.brep.shape_kinds import list_children
from cqblend.brep.topology import AncestorMap, ShapeIndex
from cqblend.brep.verification.brep_check import find_flaws
from cqblend.brep.verification.solid_verification import check_solid, verify_shape
from cqblend.errors import InputError, SelectionError


def solid_of(faces: list[TopoDS_Face]) -> TopoDS_Solid:
    """A solid of faces, as they are."""
    builder, shell, solid = BRep_Builder(), TopoDS_Shell(), TopoDS_Solid()
    builder.MakeShell(shell)
    for face in faces:
        builder.Add(shell, face)
    shell.Closed(BRep_Tool.IsClosed_s(shell))
    builder.MakeSolid(solid)
    builder.Add(solid, shell)
    return solid


def new_faces(before: TopoDS_Shape, after: TopoDS_Shape, kind: str) -> list[TopoDS_Face]:
    return [face for face in subshapes(after, TopAbs_FACE) if cq.Face(face).geomType() == kind]


def wavy(radius: float = 0.0) -> cq.Workplane:
    """A block under a freeform top, its edge at x = 20 rounded."""
    grid = np.linspace(-30, 30, 21)
    points = [[cq.Vector(x, y, 3 * math.sin(x / 5) * math.cos(y / 5)) for y in grid] for x in grid]
    top = cq.Workplane(cq.Face.makeSplineApprox(points, tol=1e-3))
    block = cq.Workplane().box(40, 40, 20).split(top).solids("<Z")
    return block.edges(cq.selectors.BoxSelector((15, -19, -9), (25, 19, 9))).fillet(radius) if radius else block


class TestVerify:
    @pytest.mark.parametrize(
        "shape",
        [
            cq.Workplane().box(3, 4, 5),
            cq.Workplane().box(9, 9, 9).cut(cq.Workplane().box(5, 5, 5)),
            cq.Workplane().circle(5).extrude(10).union(cq.Workplane().sphere(5)),
            cq.Workplane().box(10, 10, 10).edges("|Z").fillet(2),
        ],
        ids=["box", "hollow", "capsule", "rounded"],
    )
    def test_plain_solids_are_ok(self, shape):
        result = verify_shape(wrapped(shape))
        assert result.ok, str(result)
        assert result.valid
        assert result.closed
        assert result.angle < 1e-14
        assert result.gap < 1e-13
        assert result.box.mismatch < 1e-12
        assert result.step.mismatch < 1e-12
        assert result.step.faces == len(subshapes(wrapped(shape), TopAbs_FACE))

    @pytest.mark.parametrize("part", [prism, wavy])
    def test_a_native_fillet_on_a_freeform_face_passes_with_its_known_angle(self, part):
        shape = wrapped(part(1.0))
        result = verify_shape(shape)
        assert result.ok, str(result)
        assert 1e-7 < result.angle < 1e-4
        assert 1e-7 < result.gap < 1e-4
        assert result.step.angle == pytest.approx(result.angle, rel=0.1)

    def test_the_edges_of_given_faces_are_told_apart(self):
        part = cq.Workplane().box(10, 10, 10).edges("|Z").fillet(2)
        rounds = [face.wrapped for face in part.faces("%CYLINDER").vals()]
        result = verify_shape(wrapped(part), rounds)
        assert result.ok
        assert sorted(edge.smooth for edge in result.edges) == [False] * 8 + [True] * 8
        assert {round(edge.angle, 12) for edge in result.edges if not edge.smooth} == {round(math.pi / 2, 12)}
        lengths = {True: 10.0, False: math.pi}
        edges = subshapes(wrapped(part), TopAbs_EDGE)
        assert all(cq.Edge(edges[e.index - 1]).Length() == pytest.approx(lengths[e.smooth]) for e in result.edges)

    def test_a_located_compound(self):
        turn = gp_Trsf()
        turn.SetRotation(gp_Ax1(gp_Pnt(1, 2, 3), gp_Dir(1, 1, 2)), 0.7)
        shapes = [cq.Workplane().box(3, 4, 5).val(), cq.Workplane().sphere(2).translate((10, 0, 0)).val()]
        result = verify_shape(cq.Compound.makeCompound(shapes).wrapped.Moved(TopLoc_Location(turn)))
        assert result.ok, str(result)
        assert result.volume == pytest.approx(60 + 4 / 3 * math.pi * 8, rel=1e-6)

    def test_it_reads_aloud(self):
        text = str(verify_shape(wrapped(cq.Workplane().box(3, 4, 5))))
        assert text.splitlines()[0].split() == ["verification", "ok"]
        assert "60 mm^3" in text


class TestVerifyNotices:
    def test_inside_out(self):
        result = verify_shape(wrapped(cq.Workplane().box(3, 4, 5)).Reversed())
        assert not result.ok
        assert result.valid  # BRepCheck does not see it
        assert result.volume == pytest.approx(-60)
        assert "solid 1 is inside out" in result.problems

    def test_a_missing_face(self):
        faces = subshapes(wrapped(cq.Workplane().box(3, 4, 5)), TopAbs_FACE)
        result = verify_shape(solid_of(faces[1:]))
        assert not result.closed
        assert "shell 1 is not closed" in result.problems

    def test_a_flipped_face(self):
        faces = subshapes(wrapped(cq.Workplane().box(3, 4, 5)), TopAbs_FACE)
        result = verify_shape(solid_of([faces[0].Reversed(), *faces[1:]]))
        assert not result.closed
        assert "shell 1 is not consistently oriented" in result.problems

    def test_a_shifted_pcurve(self):
        part = cq.Workplane().circle(5).extrude(10)
        shape = wrapped(part)
        side = part.faces("%CYLINDER").val().wrapped
        rim = part.faces(">Z").edges().val().wrapped
        pcurve = BRep_Tool.CurveOnSurface_s(rim, side, 0.0, 0.0)
        BRep_Builder().UpdateEdge(rim, pcurve.Translated(gp_Vec2d(0, -1e-4)), side, 1e-7)
        result = verify_shape(shape, [side])
        assert not result.valid
        assert any("InvalidCurveOnSurface" in line for line in result.problems)
        assert any("faces are 0.0001 mm apart" in line for line in result.problems)

    def test_a_false_promise_of_smoothness(self):
        part = cq.Workplane().box(3, 4, 5)
        first, second = (part.faces(which).val().wrapped for which in (">X", ">Z"))
        shared = part.edges(">X and >Z").val().wrapped
        BRep_Builder().Continuity(shared, first, second, GeomAbs_G1)
        result = verify_shape(wrapped(part))
        assert result.angle == pytest.approx(math.pi / 2)
        assert any("flagged smooth, but its faces meet at 1.6 rad" in line for line in result.problems)

    def test_a_stricter_angle(self):
        shape = wrapped(wavy(1.0))
        assert verify_shape(shape).ok
        assert any("flagged smooth" in line for line in verify_shape(shape, angular_tolerance=1e-9).problems)

    def test_faces_that_fold_back_on_each_other(self):
        """Two squares back to back, flagged smooth: to OCCT their angle is 0, as it ignores orientation."""
        wire = cq.Wire.makePolygon([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], close=True)
        front, back = (cq.Face.makeFromWires(wire).wrapped for _ in range(2))
        for edge in subshapes(front, TopAbs_EDGE):
            BRep_Builder().Continuity(edge, front, back, GeomAbs_G1)
        result = verify_shape(solid_of([front, TopoDS.Face_s(back.Reversed())]))
        assert result.angle == 0.0
        assert sum("fold back on each other" in line for line in result.problems) == 4


def folded() -> TopoDS_Shape:
    """A flat sheet that runs out in x and comes back, x = u (1 - u): Su x Sv changes sign at u = 1/2."""
    poles = [[[0, 0, 0], [0, 1, 0]], [[0.5, 0, 0], [0.5, 1, 0]], [[0, 0, 0], [0, 1, 0]]]
    surface = bspline(poles, ((0, 1), (3, 3)), ((0, 1), (2, 2)), (2, 1))
    return BRepBuilderAPI_MakeFace(surface, 1e-7).Face()


class TestVerifyRefuses:
    @pytest.mark.parametrize("wrong", [None, 7, "solid", cq.Workplane()])
    def test_what_is_no_shape(self, wrong):
        with pytest.raises(InputError, match="shape is"):
            verify_shape(wrong)

    def test_a_shape_without_a_face(self):
        with pytest.raises(InputError, match="no face"):
            verify_shape(wrapped(cq.Workplane().box(1, 1, 1).edges(">Z and >X")))

    def test_faces(self):
        box = wrapped(cq.Workplane().box(1, 1, 1))
        face = subshapes(box, TopAbs_FACE)[0]
        with pytest.raises(InputError, match="empty"):
            verify_shape(box, [])
        with pytest.raises(InputError, match="iterable"):
            verify_shape(box, face)
        with pytest.raises(InputError, match=r"faces\[1\] is of type edge"):
            verify_shape(box, [face, subshapes(box, TopAbs_EDGE)[0]])
        with pytest.raises(SelectionError, match=r"faces\[0\] is not a face"):
            verify_shape(box, subshapes(wrapped(cq.Workplane().box(1, 1, 1)), TopAbs_FACE))


class TestCheckSolid:
    """``before`` and ``after`` share what was not touched; native fillets do that too."""

    @pytest.mark.parametrize(("part", "kind", "tolerance"), [(prism, "BSPLINE", 1e-3), (wavy, "BSPLINE", 1e-3)])
    def test_a_sound_result_has_no_problems(self, part, kind, tolerance):
        before = part()
        after = before.faces(">Z") if part is prism else before
        after = after.edges() if part is prism else after.edges(cq.selectors.BoxSelector((15, -19, -9), (25, 19, 9)))
        after = wrapped(after.fillet(1.0))
        blends = [f for f in new_faces(wrapped(before), after, kind) if cq.Face(f).Area() < 200]
        assert blends
        assert list_problems(wrapped(before), after, blends, grows=False, tolerance=tolerance) == []

    def test_growing_the_wrong_way(self):
        before = cq.Workplane().box(10, 10, 10)
        after = wrapped(before.edges("|Z").fillet(2))
        (line,) = list_problems(wrapped(before), after, [], grows=True)
        removed = 10 * 4 * 4 * (1 - math.pi / 4)
        assert line == f"the volume fell by {removed:.3g} mm^3, but the blend was to add material"
        (line,) = list_problems(after, wrapped(before), [], grows=False)
        assert line == f"the volume rose by {removed:.3g} mm^3, but the blend was to remove material"

    def test_a_blend_that_bulges_outside(self):
        """The top of a box replaced by one that rises: fine where material is to be added, noticed where not."""
        before = wrapped(cq.Workplane().box(10, 10, 10))
        dome = wrapped(cq.Workplane().box(10, 10, 10).faces(">Z").workplane().circle(4).extrude(0.5))
        assert list_problems(before, dome, [], grows=True) == []
        assert list_problems(before, dome, [], grows=False) == [
            f"the volume rose by {16 * math.pi / 2:.3g} mm^3, but the blend was to remove material"
        ]

    def test_a_loose_new_edge(self):
        part = cq.Workplane().box(10, 10, 10)
        before, after = wrapped(part), wrapped(part.edges("|Z").fillet(2))
        edge = next(e for e in subshapes(after, TopAbs_EDGE) if cq.Edge(e).geomType() == "CIRCLE")
        assert list_problems(before, after, []) == []
        BRep_Builder().UpdateEdge(edge, 3e-4)
        number = 1 + next(i for i, e in enumerate(subshapes(after, TopAbs_EDGE)) if e.IsSame(edge))
        assert list_problems(before, after, []) == [f"edge {number} has tolerance 0.0003 mm, above 1e-05"]
        assert list_problems(before, after, [], tolerance=1e-3) == []

    def test_a_new_face_that_is_not_there(self):
        box = wrapped(cq.Workplane().box(1, 1, 1))
        other = subshapes(wrapped(cq.Workplane().box(1, 1, 1)), TopAbs_FACE)[0]
        assert list_problems(box, box, [other]) == ["new face 1 is not in the result"]

    def test_a_hole_and_a_flip_and_an_inversion(self):
        box = wrapped(cq.Workplane().box(3, 4, 5))
        faces = subshapes(box, TopAbs_FACE)
        assert list_problems(box, solid_of(faces), []) == []
        assert list_problems(box, solid_of(faces[1:]), []) == ["shell 1 is not closed"]
        assert list_problems(box, solid_of([faces[0].Reversed(), *faces[1:]]), []) == [
            "shell 1 is not consistently oriented"
        ]
        assert list_problems(box, box.Reversed(), []) == ["solid 1 is inside out"]

    def test_a_fold(self):
        sheet = folded()
        (line,) = [one for one in list_problems(sheet, sheet, [sheet]) if "folds" in one]
        assert line.startswith("a face folds over near (0.25, ")
        assert line.endswith("its normal flips")

    def test_a_face_that_turns_fast_does_not_fold(self):
        """Nine turns of a thin helical strip: neighbours of a coarse grid look opposite ways, and yet it is smooth."""
        helix = cq.Wire.makeHelix(1, 9, 5)
        strip = cq.Workplane("XZ").center(5, 0).rect(0.2, 0.2).sweep(cq.Workplane(helix), isFrenet=True)
        assert list_problems(wrapped(strip), wrapped(strip), subshapes(wrapped(strip), TopAbs_FACE)) == []

    def test_flaws_of_the_input_are_not_the_results(self):
        """A face far from the change was flawed before: tolerated, unless it is new."""
        part, before = flawed()
        assert {flaw.status.name for flaw in find_flaws(before)} == {
            "BRepCheck_InvalidCurveOnSurface",  # of the rim's REVERSED use
            "BRepCheck_InvalidSameParameterFlag",
            "BRepCheck_SelfIntersectingWire",
            "BRepCheck_UnorientableShape",
        }
        after = wrapped(part.edges("|Z and >X and >Y").fillet(2))
        assert len(find_flaws(after)) > 0
        assert list_problems(before, after, [], grows=False) == []
        sound = wrapped(cq.Workplane().box(10, 10, 10))
        assert any("SelfIntersectingWire" in line for line in list_problems(sound, after, []))

    def test_a_flaw_travels_with_a_face_that_is_rebuilt(self):
        """The flawed face gets a new wire of the same edges, as a trimmed one does: nothing new to complain about."""
        part, before = flawed()
        side = part.faces("%CYLINDER").val().wrapped
        forward = TopoDS.Face_s(side.Oriented(TopAbs_FORWARD))
        old = BRepTools.OuterWire_s(forward)
        copy, wire = TopoDS.Face_s(forward.EmptyCopied()), old.Oriented(TopAbs_FORWARD).EmptyCopied()
        for edge in list_children(old.Oriented(TopAbs_FORWARD)):
            BRep_Builder().Add(wire, edge)
        wire.Closed(True)
        BRep_Builder().Add(copy, wire.Oriented(old.Orientation()))
        after = solid_of(
            [
                TopoDS.Face_s(copy.Oriented(side.Orientation())) if face.IsSame(side) else face
                for face in subshapes(before, TopAbs_FACE)
            ]
        )
        assert len(find_flaws(after)) > 0
        assert list_problems(before, after, []) == []


def flawed() -> tuple[cq.Workplane, TopoDS_Shape]:
    """A box with a hole, one rim's pcurve out of place by 0.01 mm."""
    part = cq.Workplane().box(10, 10, 10).faces("<Z").workplane().hole(3)
    side = part.faces("%CYLINDER").val().wrapped
    rim = part.edges("%CIRCLE").edges("<Z").val().wrapped
    pcurve = BRep_Tool.CurveOnSurface_s(rim, side, 0.0, 0.0)
    BRep_Builder().UpdateEdge(rim, pcurve.Translated(gp_Vec2d(0, 0.01)), side, 1e-7)
    return part, wrapped(part)


@pytest.fixture(scope="module")
def blended():
    """A box without a lid, and the same with one of its uprights blended."""
    shell = cq.Shell.makeShell(cq.Workplane().box(30, 20, 10).faces("not >Z").vals())
    edge = cq.Workplane(shell).edges("|Z and >X and >Y").val()
    return shell, cqblend.blend_edges(shell, edge, 2)


class TestShells:
    """Shells that bound no solid: what may be open, and what may not."""

    def problems(self, blended, faces, free=True):
        shell, result = blended
        after = make_shell(faces)
        new = [face.wrapped for face in result.faces]
        uses = ShapeIndex(new[0], TopAbs_EDGE)
        ends = [edge for edge in uses if len(AncestorMap(result.shape.wrapped, TopAbs_EDGE, TopAbs_FACE)(edge)) == 1]
        assert len(ends) == 1
        check = check_solid(shell.wrapped, after, new, grows=[False], free_edges=ends if free else ())
        return list(check.problems)

    def test_a_sound_one_passes(self, blended):
        _, result = blended
        assert self.problems(blended, [face.wrapped for face in result.shape.Faces()]) == []
        verification = verify_shape(result.shape.wrapped, [face.wrapped for face in result.faces])
        assert verification.ok
        assert not verification.closed

    def test_a_new_border_is_told(self, blended):
        _, result = blended
        faces = [face.wrapped for face in result.shape.Faces()]
        lost = self.problems(blended, [face for face in faces if not face.IsSame(faces[0])])
        assert any("used" in line for line in lost)
        (line,) = self.problems(blended, faces, free=False)
        assert "used" in line

    def test_a_turned_face_is_told(self, blended):
        shell, result = blended
        faces = [face.wrapped for face in result.shape.Faces()]
        kept = ShapeIndex(shell.wrapped, TopAbs_FACE)
        turned = [TopoDS.Face_s(face.Reversed()) if face in kept else face for face in faces]
        assert "faces that stay are turned over" in self.problems(blended, turned)
        wrong = [TopoDS.Face_s(face.Reversed()) if face.IsSame(result.faces[0].wrapped) else face for face in faces]
        assert any("2 times" in line for line in self.problems(blended, wrong))
        assert "open shell 1 is not consistently oriented" in verify_shape(make_shell(wrong)).problems

    def test_the_wrong_side_is_told(self, blended):
        shell, result = blended
        check = check_solid(
            shell.wrapped,
            result.shape.wrapped,
            [face.wrapped for face in result.faces],
            grows=[True],
            free_edges=list(ShapeIndex(result.shape.wrapped, TopAbs_EDGE)),
        )
        assert check.problems == ("the blend is not on the side of the shell where it was to be",)
