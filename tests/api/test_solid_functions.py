"""The front doors: CadQuery, build123d and plain OCP shapes in, the same out; and a package that is light to import."""

import re
import subprocess
import sys
from io import BytesIO

import cadquery as cq
import pytest
from OCP.BinTools import BinTools
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Solid
from OCP.TopTools import TopTools_IndexedMapOfShape
from places import ROOT

import cqblend
from cqblend.errors import InputError, SelectionError

BOX = (30.0, 20.0, 10.0)
RADIUS = 2.0
CUT = RADIUS**2 * 0.214602 * BOX[2]
"""What a quarter-circle of that radius takes off an edge of the box: (1 - pi/4) r^2 times its length."""


def subshapes(shape, kind):
    found = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, kind, found)
    return [found.FindKey(i) for i in range(1, found.Extent() + 1)]


def content(shape):
    stream = BytesIO()
    BinTools.Write_s(shape, stream)
    return stream.getvalue()


def python(code):
    """Run code in a fresh interpreter and return what it printed."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def is_blended(volume):
    """Whether so much is missing from the box as a blend of one vertical edge takes; a cubic is no circle to 1e-3."""
    return volume == pytest.approx(BOX[0] * BOX[1] * BOX[2] - CUT, abs=0.01 * CUT)


def corner(box):
    return box.edges("|Z and >X and >Y")


# CadQuery


def test_cadquery_solid():
    box = cq.Solid.makeBox(*BOX)
    before = content(box.wrapped)
    result = cqblend.blend_edges(box, corner(box), RADIUS)
    assert isinstance(result.shape, cq.Solid)
    assert all(isinstance(face, cq.Face) for face in result.faces)
    assert len(result.faces) == 1
    assert result.shape.isValid()
    assert is_blended(result.shape.Volume())
    assert any(face.isSame(result.faces[0]) for face in result.shape.Faces())
    assert result.certificate.valid
    assert content(box.wrapped) == before


def test_cadquery_workplane_as_shape_and_as_edges():
    part = cq.Workplane().box(*BOX)
    result = cqblend.blend_edges(part, corner(part), RADIUS)
    assert isinstance(result.shape, cq.Solid | cq.Compound)
    assert is_blended(result.shape.Volume())


@pytest.mark.parametrize(
    "form",
    [
        pytest.param(lambda edges: edges[0], id="one"),
        pytest.param(list, id="list"),
        pytest.param(tuple, id="tuple"),
        pytest.param(iter, id="iterator"),
        pytest.param(lambda edges: [[edges[0]], [[]]], id="nested"),
        pytest.param(lambda edges: [edges[0], edges[0]], id="twice the same"),
        pytest.param(lambda edges: cq.Compound.makeCompound(edges), id="compound"),
    ],
)
def test_edges_in_every_wrapping(form):
    box = cq.Solid.makeBox(*BOX)
    edges = [edge for edge in box.Edges() if edge.Center().toTuple() == (BOX[0], BOX[1], BOX[2] / 2)]
    assert is_blended(cqblend.blend_edges(box, form(edges), RADIUS).shape.Volume())


def test_workplane_blend_reads_like_a_fillet():
    reports = []
    part = cq.Workplane().box(*BOX)
    blended = corner(part).blend(RADIUS, report=reports.append)
    assert isinstance(blended, cq.Workplane)
    assert blended.size() == 1
    assert is_blended(blended.val().Volume())
    assert [type(report) for report in reports] == [cqblend.BlendResult]
    assert reports[0].shape is blended.val()
    assert blended.faces("<Z").workplane().hole(3).val().isValid()


def test_workplane_blend_takes_the_options_of_blend_edges():
    part = corner(cq.Workplane().box(*BOX))
    flat, plain, full = (part.blend(RADIUS, bulge=bulge).val().Volume() for bulge in (0.8, 1.0, 1.2))
    assert flat < plain < full
    reports = []
    part.blend(width=(1, 2), form="exact", report=reports.append)
    assert reports[0].certificate.width == pytest.approx((5**0.5, 5**0.5), abs=1e-12)


def test_workplane_blend_takes_all_edges_of_the_stack():
    part = cq.Workplane().box(*BOX)
    reports = []
    part.edges("|Z").blend(RADIUS, report=reports.append)
    assert len(reports[0].faces) == 4
    assert len(reports[0].certificate.rails) == 8


def test_workplane_without_edges_or_solid():
    with pytest.raises(SelectionError, match="no edge is selected"):
        cq.Workplane().box(*BOX).edges("|Z and >X and <X").blend(RADIUS)
    with pytest.raises(InputError, match="no solid"):
        cq.Workplane().rect(3, 4).edges().blend(1)


def test_first_is_a_face_of_the_same_library():
    box = cq.Solid.makeBox(*BOX)
    edge = corner(box)
    index = {name: 1 + [f.isSame(box.faces(name)) for f in box.Faces()].index(True) for name in (">X", ">Y")}
    for name, other in ((">X", ">Y"), (">Y", ">X")):
        rails = cqblend.blend_edges(box, edge, width=(1, 2), first=box.faces(name)).certificate.rails
        assert {rail.side: rail.face for rail in rails} == {1: index[name], 2: index[other]}


# build123d


def build123d():
    return pytest.importorskip("build123d", reason="the extra 'build123d' is not installed")


def test_build123d_part_keeps_class_label_and_color():
    bd = build123d()
    box = bd.Box(*BOX)
    box.label, box.color = "block", bd.Color("red")
    result = cqblend.blend_edges(box, box.edges().filter_by(bd.Axis.Z)[:1], RADIUS)
    assert type(result.shape) is bd.Part
    assert is_blended(result.shape.volume)
    assert (result.shape.label, tuple(result.shape.color)) == ("block", tuple(box.color))
    assert all(isinstance(face, bd.Face) for face in result.faces)


def test_build123d_solid():
    bd = build123d()
    box = bd.Box(*BOX).solid()
    result = cqblend.blend_edges(box, box.edges().filter_by(bd.Axis.Z)[0], RADIUS)
    assert type(result.shape) is bd.Solid
    assert is_blended(result.shape.volume)
    assert result.shape.is_valid


def test_build123d_sizes_by_edge():
    bd = build123d()
    box = bd.Box(*BOX)
    first, second = box.edges().filter_by(bd.Axis.Z)[:2]
    result = cqblend.blend_edges(box, [first, second], {first: 1, second: cqblend.linear(1, 2)})
    own, varying = result.certificate.rails[:2], result.certificate.rails[2:]
    assert len(own) == len(varying) == 2
    assert result.shape.is_valid
    assert len(result.faces) == 2


def test_build123d_null_shape():
    bd = build123d()
    with pytest.raises(InputError, match="shape must be"):
        cqblend.blend_edges(bd.Solid(), bd.Box(1, 1, 1).edges()[0], 0.1)


# plain OCP


def test_topods_in_and_out():
    box = cq.Solid.makeBox(*BOX).wrapped
    vertical = [e for e in subshapes(box, TopAbs_EDGE) if cq.Edge(e).tangentAt(0).toTuple()[2] != 0]
    assert type(vertical[0]) is TopoDS_Shape  # OCP does not say what it is
    result = cqblend.blend_edges(box, vertical[0], RADIUS)
    assert type(result.shape) is TopoDS_Solid
    assert [type(face) for face in result.faces] == [TopoDS_Face]
    assert is_blended(cq.Solid(result.shape).Volume())


def test_libraries_may_be_mixed():
    box = cq.Solid.makeBox(*BOX)
    edge = corner(box).wrapped
    assert isinstance(edge, TopoDS_Edge)
    assert isinstance(cqblend.blend_edges(box, edge, RADIUS).shape, cq.Solid)


def test_null_topods():
    with pytest.raises(InputError, match="shape must be"):
        cqblend.blend_edges(TopoDS_Shape(), cq.Edge.makeLine((0, 0, 0), (1, 0, 0)), 1)


# continuity, verify and the conversions


def test_continuity_of_any_shape():
    box = cq.Solid.makeBox(*BOX)
    sharp = cqblend.continuity(box, corner(box))
    assert isinstance(sharp, cqblend.Continuity)
    assert sharp.angle == pytest.approx(1.5707963267948966, abs=1e-12)
    assert sharp.gap < 1e-12
    with pytest.raises(InputError, match="one edge, not 4"):
        cqblend.continuity(box, box.edges("|Z"))


def test_continuity_along_the_rails_of_a_blend():
    box = cq.Solid.makeBox(*BOX)
    result = cqblend.blend_edges(box, corner(box), RADIUS)
    angles = sorted(cqblend.continuity(result.shape, edge).angle for edge in result.faces[0].Edges())
    assert len(angles) == 4
    assert angles[1] < 1e-10
    assert angles[2] > 1.5


def test_verify():
    box = cq.Workplane().box(*BOX)
    result = cqblend.blend_edges(box, corner(box), RADIUS)
    assert isinstance(cqblend.verify(result.shape, result.faces), cqblend.Verification)
    assert cqblend.verify(result.shape, result.faces).ok
    assert cqblend.verify(result.shape, result.faces[0]).ok
    assert cqblend.verify(box).ok


def test_surfaces_out_and_in():
    box = cq.Solid.makeBox(*BOX)
    result = cqblend.blend_edges(box, corner(box), RADIUS)
    surface = cqblend.to_surface(result.faces[0])
    assert isinstance(surface, cqblend.Surface)
    face = cqblend.to_face(surface)
    assert type(face) is TopoDS_Face
    assert cq.Face(face).Area() == pytest.approx(result.faces[0].Area(), rel=1e-9)
    with pytest.raises(InputError, match="face must be a face, not a solid"):
        cqblend.to_surface(box)


# the package


def test_import_is_light():
    """NumPy alone takes longer than all of it does, and so does asyncio; the time itself is in the benchmarks."""
    heavy = {"asyncio", "cadquery", "numpy", "OCP", "scipy"}
    code = "import sys; before = set(sys.modules); import cqblend; print(*set(sys.modules) - before)"
    loaded = {name.partition(".")[0] for name in python(code).split()}
    assert "cqblend" in loaded
    assert not loaded & heavy


@pytest.mark.parametrize("order", ["cadquery, cqblend", "cqblend, cadquery"])
def test_workplane_has_its_blend_whichever_is_imported_first(order):
    assert python(f"import {order}; print(cadquery.Workplane.blend.__module__)") == "cqblend.cadquery_plugin"


def test_public_names():
    assert set(cqblend.__all__) <= set(dir(cqblend))
    for name in cqblend.__all__:
        assert getattr(cqblend, name) is not None
    with pytest.raises(AttributeError, match="has no attribute 'nonsense'"):
        _ = cqblend.nonsense


def test_no_submodule_hides_a_function():
    hidden = {"bridge", "unroll", "continuity", "verify"}
    assert not hidden & {path.stem for path in (ROOT / "cqblend").iterdir()}


def test_examples_of_the_readme_run(capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)  # they write files
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(encoding="utf-8"), re.DOTALL)
    assert blocks
    namespace = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), namespace)
    assert "valid blend, exact" in capsys.readouterr().out


def test_edges_as_curves_and_back():
    for edge in (cq.Edge.makeCircle(3), cq.Edge.makeLine(cq.Vector(1, 2, 3), cq.Vector(4, 5, 6))):
        curve = cqblend.to_curve(edge)
        again = cq.Edge(cqblend.to_edge(curve))
        assert again.isValid()
        assert again.Length() == pytest.approx(edge.Length(), rel=1e-9)
        assert (again.startPoint() - edge.startPoint()).Length < 1e-12
    with pytest.raises(InputError):
        cqblend.to_curve(cq.Solid.makeBox(1, 1, 1))
    with pytest.raises(InputError, match="a curve in space"):
        cqblend.to_edge(cqblend.Curve.bezier([[0, 0], [1, 1]]))
