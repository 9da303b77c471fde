"""What unrolling makes, as shapes: valid, as large as the closed forms say, and the same after STEP."""

from __future__ import annotations

import math

import cadquery as cq
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from OCP.BRep import BRep_Tool
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.Geom import Geom_Circle
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_FACE, TopAbs_SHELL
from OCP.TopoDS import TopoDS_Face, TopoDS_Wire

from cqblend.brep.conversion.patch_reading import read_patches
from cqblend.brep.conversion.pattern_shapes import make_formers, make_planar_faces, sew_strip_faces
from cqblend.brep.topology import ShapeIndex
from cqblend.errors import GeometryError, InputError
from cqblend.patterns.outline.pieces import Piece, Run
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.strips.surface_division import divide_surface
from cqblend.patterns.trimming.trimmed_patch import TrimmedSurface
from cqblend.splines import Curve, Surface

W = cq.Workplane


def area(shape):
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(shape, properties)
    return properties.Mass()


def piece(*loops):
    """Return a piece of loops (points, bulges), closed."""
    runs = []
    for points, bulges in loops:
        closed = np.array([*points, points[0]], dtype=float)
        runs.append((Run(Path(closed, np.array(bulges, dtype=float)), np.zeros((len(closed), 3)), "trim"),))
    return Piece("7", tuple(runs))


def test_a_plate_with_arcs_and_a_round_hole():
    plate = piece(([(0, 0), (4, 0), (4, 3), (0, 3)], [0.1, -0.2, 0.0, 1.0]), ([(1, 1), (2, 1)], [-1.0, -1.0]))
    (face,) = make_planar_faces([plate])
    circle = math.pi / 4
    half = math.pi * 9 / 8  # the side with bulge 1 is half a circle on a diameter of 3
    assert area(face) == pytest.approx(plate.area, rel=1e-12)
    assert BRepCheck_Analyzer(face).IsValid()
    assert area(make_planar_faces([piece(([(0, 3), (0, 0)], [1.0, 0.0]))])[0]) == pytest.approx(half, rel=1e-12)
    assert area(make_planar_faces([piece(([(0, 0), (1, 0)], [1.0, 1.0]))])[0]) == pytest.approx(circle, rel=1e-12)
    edges = cq.Shape.cast(face).Edges()
    assert sorted(edge.geomType() for edge in edges) == ["CIRCLE"] * 5 + ["LINE"]
    assert cq.Shape.cast(face).normalAt().z == pytest.approx(1)


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.floats(0.5, 2.0), min_size=3, max_size=12),
    st.lists(st.floats(-0.15, 0.15) | st.sampled_from([0.0, 1e-12, 3e-9, -2e-8, 1e-6]), min_size=12, max_size=12),
)
def test_areas_of_star_shaped_pieces(radii, bulges):
    angles = 2 * np.pi * np.arange(len(radii)) / len(radii)
    points = 20 * np.array(radii)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    one = piece((points, bulges[: len(radii)]))
    try:
        (face,) = make_planar_faces([one])
    except GeometryError:  # the arcs cross
        return
    bulge = np.abs(bulges[: len(radii)])
    chords = np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1)
    # the caps of arcs that become segments, and the rounding of arcs whose centre is far away
    lost = np.where(bulge < 1e-8, bulge / 3, 2.0**-52 / np.maximum(bulge, 1e-8)) @ chords**2
    assert area(face) == pytest.approx(one.area, rel=0, abs=1e-9 * one.area + lost)


def test_steps_too_short_for_an_edge_are_left_out():
    short = piece(([(0, 0), (2, 0), (2, 1e-9), (2, 1), (0, 1)], [0.0] * 5))
    (face,) = make_planar_faces([short])
    assert len(cq.Shape.cast(face).Edges()) == 4
    assert area(face) == pytest.approx(2.0, rel=1e-9)


def test_tabs_belong_to_the_face_if_they_are_wanted():
    square = piece(([(0, 0), (1, 0), (1, 1), (0, 1)], [0.0] * 4))
    wide = Path.from_points(np.array([[0, -0.5], [1, -0.5], [1, 1], [0, 1], [0, -0.5]]))
    tabbed = Piece("7", square.loops, (wide,))
    assert [area(make_planar_faces([tabbed], tabs=tabs)[0]) for tabs in (False, True)] == pytest.approx([1.0, 1.5])


def test_a_piece_that_crosses_itself_is_refused_by_name():
    with pytest.raises(GeometryError, match="piece 7"):
        make_planar_faces([piece(([(0, 0), (1, 1), (1, 0), (0, 1)], [0.0] * 4))])


def strips(shape, tolerance):
    """Return the strips of all faces of a shape without holes, as trims and as rails."""
    trims, rails = [], []
    for patch in read_patches(shape.val().wrapped).patches:
        for strip in divide_surface(patch.surface, tolerance).strips:
            trims.append(TrimmedSurface(strip.to_ruled_surface(), (), patch.outward != strip.transposed))
            rails += strip.rails
    return trims, rails


def in_step(shape, path):
    cq.exporters.export(W(cq.Shape.cast(shape)), str(path))
    return cq.importers.importStep(str(path))


@pytest.mark.parametrize(
    ("shape", "poles"), [(W().sphere(10), 2), (W(cq.Solid.makeTorus(10, 3)), 0)], ids=["sphere", "torus"]
)
def test_strips_of_a_closed_face_are_sewn_to_a_closed_shell(shape, poles, tmp_path):
    trims, rails = strips(shape, 0.05)
    shell = sew_strip_faces(trims, 1e-6)
    assert shell.ShapeType() == TopAbs_SHELL
    assert BRepCheck_Analyzer(shell).IsValid()
    assert cq.Shape.cast(shell).Closed()
    assert len(ShapeIndex(shell, TopAbs_FACE)) == len(trims)
    truth = shape.val()
    assert 0.99 * truth.Area() < area(shell) < truth.Area()
    solid = cq.Solid.makeSolid(cq.Shape.cast(shell))
    assert 0.98 * truth.Volume() < solid.Volume() < 1.02 * truth.Volume()  # and positive: the outer side is outside
    back = in_step(shell, tmp_path / "strips.step").val()
    assert back.isValid()
    assert back.Area() == pytest.approx(area(shell), rel=1e-9)
    formers = make_formers(rails)
    assert len(formers) == (len(trims) - 1 if poles else len(trims))
    assert all(isinstance(former, TopoDS_Face) for former in formers)
    assert all(BRepCheck_Analyzer(former).IsValid() for former in formers)


def trimmed(skin, count):
    """Return whole patches, ruled by nature, with their loops as polygons, on planes as exact curves."""
    trims = []
    for patch in skin.patches:
        loops = []
        for loop in patch.loops:
            runs = []
            for use in loop:
                if patch.frame is None:
                    run = use.pcurve(np.linspace(use.breaks[0], use.breaks[-1], count))
                    runs.append(run if use.forward else run[::-1])
                else:
                    run = patch.frame.project_curve(skin.edges[use.edge].curve)
                    runs.append(run if use.forward else run.reverse())
            loops.append(tuple(runs))
        trims.append(TrimmedSurface(patch.surface, tuple(loops), patch.outward))
    return trims


@pytest.mark.slow
@pytest.mark.parametrize(
    "shape",
    [
        W(cq.Solid.makeCone(4, 1, 8)).union(W("XZ").cylinder(12, 1).translate((0, 0, 3))),
        W(cq.Solid.makeCone(4, 0, 8)).cut(W("XZ").cylinder(12, 1).translate((0, 0, 3))),
        W().cylinder(10, 3).cut(W("YZ").cylinder(10, 1).translate((4, 0, 0))),
        W().box(10, 10, 10).faces(">Z").workplane().hole(3).mirror("XZ"),
        W().rect(4, 4).workplane(offset=5).circle(1).loft(),
    ],
    ids=["cone and cylinder", "cone with an apex", "hole at the seam", "drilled", "loft"],
)
def test_trimmed_faces_are_sewn_to_a_closed_shell(shape, tmp_path):
    shell = sew_strip_faces(trimmed(read_patches(shape.val().wrapped), 257), 2e-3)
    assert shell.ShapeType() == TopAbs_SHELL
    assert BRepCheck_Analyzer(shell).IsValid()
    assert cq.Shape.cast(shell).Closed()
    assert len(ShapeIndex(shell, TopAbs_FACE)) == len(shape.faces().vals())
    assert len(cq.Shape.cast(shell).Edges()) == len(shape.edges().vals())
    assert area(shell) == pytest.approx(shape.val().Area(), rel=3e-3)
    back = in_step(shell, tmp_path / "trimmed.step").val()
    assert back.isValid()
    assert len(back.Faces()) == len(shape.faces().vals())


def test_trims_clockwise_mean_the_same():
    quarter = Surface.from_bspline(
        (1, 1), ([0, 0, 2, 2], [0, 0, 1, 1]), [[[0, 0, 0], [0, 1, 0]], [[2, 0, 0], [2, 1, 1]]]
    )
    corners = np.array([[0.2, 0.2], [1.5, 0.2], [1.5, 0.8], [0.2, 0.2]])
    areas = [
        area(sew_strip_faces([TrimmedSurface(quarter, (tuple(loop[i : i + 2] for i in range(3)),))], 1e-6))
        for loop in (corners, corners[::-1])
    ]
    assert areas[0] == pytest.approx(areas[1], rel=1e-12)
    whole = np.array([[0, 0], [2, 0], [2, 1], [0, 1], [0, 0]], dtype=float)
    runs = tuple(whole[i : i + 2] for i in range(4))
    faces = [sew_strip_faces([TrimmedSurface(quarter, loops)], 1e-6) for loops in ((), (runs,))]
    assert area(faces[0]) == pytest.approx(area(faces[1]), rel=1e-14)


def test_the_outer_side_is_the_one_told():
    square = Surface.from_bspline(
        (1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), [[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]]
    )
    for outward in (True, False):
        (face,) = cq.Shape.cast(sew_strip_faces([TrimmedSurface(square, (), outward)], 1e-6)).Faces()
        assert face.normalAt().z == pytest.approx(1 if outward else -1)


def test_nothing_to_sew_and_bad_tolerances_are_refused():
    square = Surface.from_bspline(
        (1, 1), ([0, 0, 1, 1], [0, 0, 1, 1]), [[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]]
    )
    with pytest.raises(InputError, match="no strips"):
        sew_strip_faces([], 1e-3)
    for tolerance in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="tolerance of sewing"):
            sew_strip_faces([TrimmedSurface(square)], tolerance)
    crossing = np.array([[0.1, 0.1], [0.9, 0.9], [0.9, 0.1], [0.1, 0.8], [0.1, 0.1]])
    with pytest.raises(GeometryError, match="strip 2"):
        sew_strip_faces(
            [TrimmedSurface(square), TrimmedSurface(square, (tuple(crossing[i : i + 2] for i in range(4)),))], 1e-6
        )


def arc(start, stop, radius=2.0, height=0.0):
    middle, half = (start + stop) / 2, (stop - start) / 2
    poles = [
        [math.cos(start), math.sin(start)],
        [math.cos(middle) / math.cos(half), math.sin(middle) / math.cos(half)],
        [math.cos(stop), math.sin(stop)],
    ]
    return Curve.bezier(np.column_stack([radius * np.array(poles), [height] * 3]), [1.0, math.cos(half), 1.0])


def test_rails_in_parts_are_joined_to_formers():
    parts = [arc(0.0, 2.0), arc(2.0, 4.0).reverse(), arc(4.0, 2 * math.pi), arc(0.0, 2.0).reverse()]
    (former,) = make_formers(parts)
    assert isinstance(former, TopoDS_Face)
    assert area(former) == pytest.approx(4 * math.pi, rel=1e-6)


def test_open_and_bent_chains_are_wires_and_points_are_left_out():
    bent = [
        Curve.bezier([[0, 0, 0], [1, 0, 0]]),
        Curve.bezier([[1, 0, 0], [1, 1, 1]]),
        Curve.bezier([[1, 1, 1], [0, 1, 0]]),
    ]
    point = Curve.bezier([[5, 5, 5], [5, 5, 5]])
    (chain,) = make_formers([*bent, point])
    assert isinstance(chain, TopoDS_Wire)
    assert len(cq.Shape.cast(chain).Edges()) == 3
    (ring,) = make_formers([*bent, Curve.bezier([[0, 1, 0], [0, 0, 0]])])
    assert isinstance(ring, TopoDS_Wire)
    assert cq.Shape.cast(ring).IsClosed()


def test_rails_are_not_joined_where_three_meet():
    star = [Curve.bezier([[0, 0, 0], [math.cos(a), math.sin(a), 0]]) for a in (0, 2, 4)]
    assert len(make_formers(star)) == 3


def test_circles_are_circles():
    (face,) = make_planar_faces([piece(([(0, 0), (1, 0)], [1.0, 1.0]))])
    curves = [BRep_Tool.Curve_s(edge.wrapped, 0.0, 0.0) for edge in cq.Shape.cast(face).Edges()]
    assert all(isinstance(curve, Geom_Circle) for curve in curves)
