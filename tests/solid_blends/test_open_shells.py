"""Blends in shells that bound no solid: what comes out is a shell with the border it had, but for what the blend takes.

The witness is the solid that a shell was taken from: with a planar face more, its blend is the same face.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections import Counter

import cadquery as cq
import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepCheck import BRepCheck_NoError, BRepCheck_Shell
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FORWARD, TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS
from places import CASES

import cqblend
from cqblend.brep.bodies import make_shell
from cqblend.brep.step_files import read_step, write_step
from cqblend.brep.topology import (
    BUILDER,
    ShapeIndex,
    explore_subshapes,
    find_end_vertices,
    make_closed_wire,
    make_trimmed_copy,
    orient_forward,
)
from cqblend.errors import InputError, SelectionError, SizeError, TopologyError


def count_uses(shape: cq.Shape) -> Counter[int]:
    """Count the uses of every edge by faces, by number, with the sign of the sense."""
    index, uses = ShapeIndex(shape.wrapped, TopAbs_EDGE), Counter()
    explorer = TopExp_Explorer(shape.wrapped, TopAbs_EDGE)
    while explorer.More():
        use = explorer.Current()
        uses[index.find_number(use) * (1 if use.Orientation() == TopAbs_FORWARD else -1)] += 1
        explorer.Next()
    return uses


def list_border(shape: cq.Shape) -> list[cq.Edge]:
    """Return the edges that one face has, once; no other may be used but once in each sense."""
    index, uses = ShapeIndex(shape.wrapped, TopAbs_EDGE), count_uses(shape)
    pairs = {n: (uses[n], uses[-n]) for n in range(1, len(index) + 1)}
    assert set(pairs.values()) <= {(1, 1), (1, 0), (0, 1)}
    return [cq.Edge(index[n]) for n, pair in pairs.items() if sum(pair) == 1]


def inner_edges(shape: cq.Shape) -> list[cq.Edge]:
    border = list_border(shape)
    return [edge for edge in shape.Edges() if not any(edge.isSame(one) for one in border)]


def check_shell(result: cqblend.BlendResult, kind: type = cq.Shell) -> None:
    """Check that a result is a valid, consistently oriented shell, verified, with exactly smooth rails."""
    assert isinstance(result.shape, kind)
    assert result.shape.isValid()
    assert result.certificate.valid
    for shell in result.shape.Shells():
        assert BRepCheck_Shell(TopoDS.Shell_s(shell.wrapped)).Orientation(False) == BRepCheck_NoError
    assert result.certificate.angle < (1e-10 if result.certificate.form == "exact" else 1e-5)
    verification = cqblend.verify(result.shape, result.faces)
    assert verification.ok, verification.problems


def pick(shape: cq.Shape, selector: str) -> list[cq.Edge]:
    return cq.Workplane(shape).edges(selector).vals()


def without(body: cq.Shape, *selectors: str | cq.Selector) -> cq.Shell:
    """Return the shell of a body's faces but those of some CadQuery selectors."""
    gone = [face for selector in selectors for face in cq.Workplane(body).faces(selector).vals()]
    return cq.Shell.makeShell([face for face in body.Faces() if not any(face.isSame(one) for one in gone)])


def farthest(face: cq.Face, other: cq.Face) -> float:
    """Return how far (mm) points of the edges and of the inside of a face are from another face."""
    points = [edge.positionAt(share) for edge in face.Edges() for share in np.linspace(0, 1, 9)]
    u0, u1, v0, v1 = face._uvBounds()
    points += [face.positionAt(u0 + (u1 - u0) * a, v0 + (v1 - v0) * b) for a in (0.3, 0.6) for b in (0.3, 0.6)]
    return max(
        BRepExtrema_DistShapeShape(cq.Vertex.makeVertex(*p.toTuple()).wrapped, other.wrapped).Value() for p in points
    )


BOX = cq.Workplane().box(30, 20, 10).val()
WAVE = (
    cq.Workplane("XZ")
    .spline([(0, 0), (5, 1.5), (10, 0), (15, -1), (20, 0.5)])
    .lineTo(20, 12)
    .lineTo(0, 12)
    .close()
    .extrude(9)
    .val()
)
SLOPED = BOX.cut(cq.Solid.makeBox(60, 60, 20, (-30, -30, 2)).moved(cq.Location((0, 0, 0), (1, 2, 0), 9)))
NOTCH = cq.Workplane().box(30, 20, 10).faces(">Z").workplane().rect(12, 30).cutBlind(-4).val()


SLOTTED = BOX.cut(cq.Solid.makeBox(20, 8, 20, (3, -4, -10)))
END_OF_SLOT = cq.selectors.NearestToPointSelector((3, 0, 0))


def test_a_box_without_a_lid():
    shell, radius = without(BOX, ">Z"), 2.0
    result = cqblend.blend_edges(shell, pick(shell, "|Z and >X and >Y"), radius)
    check_shell(result)
    assert [end.kind for end in result.certificate.ends] == ["natural", "natural"]
    assert sorted(edge.kind for edge in result.certificate.edges) == ["border", "end"]
    border = list_border(result.shape)
    assert len(border) == 5  # the four of the opening, two of them shorter, and the end of the blend
    assert all(abs(edge.Center().z - 5) < 1e-9 for edge in border)
    arc = sum(edge.Length() for edge in border) - (2 * (30 + 20) - 2 * radius)
    assert arc == pytest.approx(np.pi / 2 * radius, rel=1e-3)
    assert len(list_border(shell)) == 4  # the input is as it was


def test_a_lid_still_fits():
    """The ends of the blends lie in the plane of the border."""
    shell = without(BOX, ">Z")
    rounded = cqblend.blend_edges(shell, pick(shell, "|Z"), 3).shape
    lid = cq.Face.makeFromWires(cq.Wire.assembleEdges(list_border(rounded)))
    solid = cq.Solid.makeSolid(cq.Shell.makeShell([*rounded.Faces(), lid]))
    assert solid.isValid()
    assert solid.Volume() == pytest.approx(10 * (30 * 20 - (4 - np.pi) * 9), rel=1e-3)


@pytest.mark.parametrize(
    ("body", "near", "missing"),
    [
        (BOX, (15, 10, 0), (">Z",)),
        (BOX, (15, 10, 0), (">Z", "<Z", "<X")),
        (SLOPED, (15, 10, 0), (">Z", "<Z")),
        (NOTCH, (6, 0, 1), (">Y",)),  # a concave edge
        (SLOTTED, (9, 4, 5), (END_OF_SLOT,)),  # where the top goes on past the missing wall
        (WAVE, (10, 0, 0), ("<X",)),
        (WAVE, (10, 0, 0), ("<X", ">X", ">Z")),
    ],
)
@pytest.mark.parametrize("continuity", ["G1", "G2"])
def test_the_blend_is_that_of_the_solid_with_the_missing_faces(body, near, missing, continuity):
    shell = without(body, *missing)
    edge = min(body.Edges(), key=lambda one: (one.positionAt(0.5) - cq.Vector(near)).Length)
    whole = cqblend.blend_edges(body, edge, 1.5, continuity=continuity)
    result = cqblend.blend_edges(shell, edge, 1.5, continuity=continuity)
    check_shell(result)
    assert len(result.shape.Faces()) == len(shell.Faces()) + 1
    assert farthest(result.faces[0], whole.faces[0]) < 1e-6
    assert farthest(whole.faces[0], result.faces[0]) < 1e-6


def test_a_border_that_is_not_planar_goes_on_without_a_kink():
    body = BOX.cut(cq.Solid.makeCylinder(9, 60, (18, -30, 0), (0, 1, 0)), cq.Solid.makeCylinder(7, 60, (-16, -3, -30)))
    shell = cq.Shell.makeShell(
        [f for f in body.Faces() if f.geomType() == "PLANE" and f.normalAt().toTuple()[1:] > (0.9,)]
    )
    shell = cq.Shell.makeShell([cq.Workplane(body).faces(f">{axis}").val() for axis in "ZY"])
    (edge,) = inner_edges(shell)
    result = cqblend.blend_edges(shell, edge, 2)
    check_shell(result)
    border = list_border(result.shape)
    ends = [edge for edge in border if any(edge.isSame(own) for own in result.faces[0].Edges())]
    assert len(ends) == 2
    for end in ends:
        for vertex in end.Vertices():
            (other,) = (e for e in border if not e.isSame(end) and any(v.isSame(vertex) for v in e.Vertices()))
            tangents = [
                np.array(
                    e.tangentAt(0 if (e.positionAt(0) - cq.Vector(vertex.toTuple())).Length < 1e-6 else 1).toTuple()
                )
                for e in (end, other)
            ]
            assert np.linalg.norm(np.cross(*tangents)) < 1e-6


def test_a_slit_at_the_end_of_an_edge():
    """The top and one wall of a box have edges of their own where they meet: the slit starts at the blend then."""
    top = cq.Workplane(BOX).faces(">Z").val().wrapped
    edge = cq.Workplane(BOX).edges(">Z and >X").val().wrapped
    copy = make_trimmed_copy(edge, find_end_vertices(orient_forward(edge)), BRep_Tool.Range_s(edge))
    uses = [
        TopoDS.Edge_s(copy.Oriented(use.Orientation())) if use.IsSame(edge) else use
        for use in explore_subshapes(orient_forward(top), TopAbs_EDGE)
    ]
    face = TopoDS.Face_s(orient_forward(top).EmptyCopied())
    BUILDER.Add(face, make_closed_wire(uses))
    others = [one for one in BOX.Faces() if not one.wrapped.IsSame(top)]
    shell = cq.Shell(make_shell([*(one.wrapped for one in others), face.Oriented(top.Orientation())]))
    assert len(list_border(shell)) == 2
    result = cqblend.blend_edges(shell, pick(shell, "|Z and >X and >Y"), 2, ends="natural")
    check_shell(result)
    border = list_border(result.shape)
    assert [one.Length() for one in border] == pytest.approx([18, 18])
    assert len(result.faces[0].Edges()) == 4


def test_both_senses_of_a_shell():
    """Turned inside out, a shell has the same blend, which then adds what it removed before."""
    shell = without(BOX, ">Z")
    turned = cq.Shell(TopoDS.Shell_s(shell.wrapped.Reversed()))
    first, second = (cqblend.blend_edges(one, pick(one, "|Z and >X and >Y"), 2) for one in (shell, turned))
    check_shell(second)
    assert farthest(first.faces[0], second.faces[0]) < 1e-9
    at = [face.normalAt(face.Center()) for face in (first.faces[0], second.faces[0])]
    assert at[0].dot(at[1]) == pytest.approx(-1, abs=1e-6)


def test_a_shell_that_is_closed_and_no_solid():
    (shell,) = BOX.Shells()
    for ends in ("natural", "flat"):
        result = cqblend.blend_edges(shell, pick(shell, "|Z and >X and >Y"), 2, ends=ends)
        check_shell(result)
        assert list_border(result.shape) == []
        assert cqblend.verify(result.shape).closed


def test_two_faces_of_a_compound_stay_faces_of_it():
    faces = [cq.Workplane(BOX).faces(f">{axis}").val() for axis in "XY"]
    (edge,) = inner_edges(cq.Compound.makeCompound(faces))
    inner = cq.Compound.makeCompound(faces)
    outer = cq.Compound.makeCompound([cq.Solid.makeBox(1, 1, 1), inner])
    result = cqblend.blend_edges(outer, edge, 2)
    check_shell(result, cq.Compound)
    solid, compound = result.shape
    assert (solid.ShapeType(), compound.ShapeType()) == ("Solid", "Compound")
    assert [part.ShapeType() for part in compound] == ["Face"] * 3
    assert solid.isSame(next(iter(outer)))
    assert len(list_border(compound)) == 8


def test_a_shell_in_a_compound_that_stands_elsewhere():
    shell = without(BOX, ">Z")
    compound = cq.Compound.makeCompound([cq.Solid.makeBox(1, 1, 1), shell]).moved(cq.Location((5, 6, 7), (0, 0, 1), 30))
    (moved,) = (one for one in compound.Shells() if not one.wrapped.Closed())
    result = cqblend.blend_edges(compound, [e for e in inner_edges(moved) if abs(e.tangentAt(0).z) > 0.9], 2)
    check_shell(result, cq.Compound)
    assert [part.ShapeType() for part in result.shape] == ["Solid", "Shell"]
    assert len(result.faces) == 4


def test_a_cut_rim_and_faces_split_on_one_surface():
    """A closed edge; and the lid of a can in two halves, which are taken as one."""
    can = cq.Workplane().circle(5).extrude(10).val()
    result = cqblend.blend_edges(cup := without(can, "<Z"), pick(cup, ">Z"), 1)
    check_shell(result)
    halves = BOX.fuse(BOX.moved(cq.Location((30, 0, 0))))
    shell = without(halves, "<Z")
    front = [edge for edge in inner_edges(shell) if edge.Center().z > 4.9 and edge.Center().y > 9.9]
    assert len(front) == 2
    result = cqblend.blend_edges(shell, front, 2)
    check_shell(result)
    assert len(result.faces) == 1
    assert "taken as one" in result.certificate.method


def test_workplanes_and_the_largest_size():
    shell = without(BOX, ">Z")
    found = cq.Workplane(shell).edges("|Z").blend(2).vals()
    assert [one.ShapeType() for one in found] == ["Shell"]
    assert len(found[0].Faces()) == 9
    largest = cqblend.max_size(shell, pick(shell, "|Z and >X and >Y"))
    assert 19.6 < largest < 20
    with pytest.raises(InputError, match="no solid and no shell"):
        cq.Workplane().rect(1, 2).edges().blend(1)


def test_what_is_refused():
    shell = without(BOX, ">Z")
    with pytest.raises(SelectionError, match="edge 6 has 1 face: it is in the border"):
        cqblend.blend_edges(shell, shell.Edges()[5], 1)
    with pytest.raises(TopologyError, match="border of an open shell, which a flat cap"):
        cqblend.blend_edges(shell, pick(shell, "|Z and >X and >Y"), 2, ends="flat")
    first, second = (cq.Workplane(BOX).faces(f">{axis}").val() for axis in "XY")
    against = cq.Compound.makeCompound([first, cq.Face(TopoDS.Face_s(second.wrapped.Reversed()))])
    with pytest.raises(SelectionError, match="that are oriented against each other"):
        cqblend.blend_edges(against, next(e for e in first.Edges() if any(e.isSame(o) for o in second.Edges())), 1)
    with pytest.raises(SizeError, match="too large"):
        cqblend.blend_edges(shell, pick(shell, "|Z and >X and >Y"), 20.5)


def test_an_edge_of_three_faces_is_refused():
    box, other = cq.Workplane().box(10, 10, 10), cq.Workplane().box(10, 10, 10).translate((10, 10, 0))
    both = box.union(other, clean=False).val()
    fan = cq.Compound.makeCompound([face for face in both.Faces() if abs(face.normalAt().z) < 0.1])
    edge = next(e for e in fan.Edges() if abs(e.Center().x - 5) < 1e-9 and abs(e.Center().y - 5) < 1e-9)
    with pytest.raises(SelectionError, match="4 faces: not manifold"):
        cqblend.blend_edges(fan, edge, 1)


def test_a_file_of_a_shell_read_by_another_process(tmp_path):
    """Through the command line, and back."""
    shell = without(BOX, ">Z")
    write_step(shell.wrapped, tmp_path / "open.step")
    command = [sys.executable, "-m", "cqblend", "blend", tmp_path / "open.step", tmp_path / "blended.step"]
    done = subprocess.run([*command, "--near=15,10,0", "--radius=2"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    back = cq.Shape.cast(read_step(tmp_path / "blended.step"))
    assert back.isValid()
    assert len(back.Shells()) == 1
    assert not back.Solids()
    assert len(back.Faces()) == 6
    assert len(list_border(back)) == 5


@pytest.mark.skipif(not CASES.is_dir(), reason="no real parts beside the project")
def test_edges_of_a_real_open_shell():
    name = "occt__trj7_k1-id-214.stp"
    shape = read_step(CASES / name)
    edges = ShapeIndex(shape, TopAbs_ShapeEnum.TopAbs_EDGE)
    rows = [row for row in json.loads((CASES / "edges_more.json").read_text()) if row["file"] == name]
    before = len(list_border(cq.Shape.cast(shape)))
    for row in rows:
        if row["edge"] in (1, 56, 61, 77, 87, 112):  # one closed, one at a slit, others that end on faces
            result = cqblend.blend_edges(shape, edges[row["edge"]], row["radius"], ends="natural")
            assert cq.Shape.cast(result.shape).isValid()
            assert result.certificate.angle < 1e-5
            assert result.certificate.coverage == 1
            assert len(list_border(cq.Shape.cast(result.shape))) == before


def test_shapes_of_build123d():
    build123d = pytest.importorskip("build123d")
    tray = build123d.Shell([face for face in build123d.Box(30, 20, 10).faces() if face.center().Z < 4.9])
    upright = next(edge for edge in tray.edges() if abs((edge % 0.5).Z) > 0.9)
    result = cqblend.blend_edges(tray, upright, 2)
    assert type(result.shape) is build123d.Shell
    assert len(result.shape.faces()) == 6
    assert cqblend.verify(result.shape, result.faces).ok
