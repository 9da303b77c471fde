"""STEP in and out: complete or one line of error, nothing on standard output, and the old file kept on failure."""

import math
import os
import random
import re

import numpy as np
import pytest
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepGProp import BRepGProp
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakePrism,
    BRepPrimAPI_MakeSphere,
    BRepPrimAPI_MakeTorus,
)
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.Interface import Interface_Static
from OCP.Message import Message
from OCP.STEPControl import STEPControl_Controller
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Compound, TopoDS_Shape
from places import CASES

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.step_files import read_step, write_step
from cqblend.errors import DamagedFileWarning, StepError


def box() -> TopoDS_Shape:
    return BRepPrimAPI_MakeBox(10, 20, 30).Shape()


def cylinder(x: float, y: float, radius: float, direction=(0, 0, 1)) -> TopoDS_Shape:
    start = [p - 20 * d for p, d in zip((x, y, 0), direction, strict=True)]
    return BRepPrimAPI_MakeCylinder(gp_Ax2(gp_Pnt(*start), gp_Dir(*direction)), radius, 40).Shape()


def wavy_face():
    rng = np.random.default_rng(7)
    knots = np.concatenate([np.zeros(4), [1 / 3, 0.7], np.ones(4)])
    poles = np.stack(np.meshgrid(np.linspace(-20, 20, 6), np.linspace(-15, 15, 6), [0.0], indexing="ij"), -1)[:, :, 0]
    poles = poles + rng.normal(size=poles.shape)
    weights = rng.uniform(0.5, 2, (6, 6))
    surface = spline_arrays.surface_from_arrays((3, 3), (knots, knots), poles, weights)
    return BRepBuilderAPI_MakeFace(surface, 1e-7).Face()


def faces(shape: TopoDS_Shape) -> list:
    found, explorer = [], TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE)
    while explorer.More():
        found.append(TopoDS.Face_s(explorer.Current()))
        explorer.Next()
    return found


def volume(shape: TopoDS_Shape) -> float:
    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties, 1e-9, False, False)
    return properties.Mass()


@pytest.fixture
def box_text(tmp_path) -> str:
    write_step(box(), tmp_path / "box.step")
    return (tmp_path / "box.step").read_text()


BODIES = {
    "box": box,
    "torus with a hole on its seam": lambda: BRepAlgoAPI_Cut(
        BRepPrimAPI_MakeTorus(10, 3).Shape(), cylinder(10, 0, 1)
    ).Shape(),
    "crossed cylinders": lambda: BRepAlgoAPI_Cut(cylinder(0, 0, 6), cylinder(0, 1, 3, (1, 0, 0))).Shape(),
    "wavy prism": lambda: BRepPrimAPI_MakePrism(wavy_face(), gp_Vec(1, 2, 25)).Shape(),
    "sphere with a hole": lambda: BRepAlgoAPI_Cut(BRepPrimAPI_MakeSphere(10).Shape(), cylinder(-4, 1, 3)).Shape(),
    "sphere with two holes on its seam": lambda: BRepAlgoAPI_Cut(
        BRepPrimAPI_MakeSphere(10).Shape(), cylinder(4, 1, 3)
    ).Shape(),
}


@pytest.mark.parametrize("name", BODIES)
def test_bodies_survive_the_round_trip(name, tmp_path):
    body = BODIES[name]()
    write_step(body, tmp_path / "body.step")
    again = read_step(tmp_path / "body.step")
    assert BRepCheck_Analyzer(again).IsValid()
    assert len(faces(again)) == len(faces(body))
    assert volume(again) == pytest.approx(volume(body), rel=1e-8)


def test_writing_leaves_the_shape_alone(tmp_path):
    body = BODIES["sphere with two holes on its seam"]()
    write_step(body, tmp_path / "body.step")
    assert BRepCheck_Analyzer(body, True, False, True).IsValid()


def test_bspline_keeps_fifteen_digits(tmp_path):
    face = wavy_face()
    write_step(face, tmp_path / "face.step")
    (again,) = faces(read_step(tmp_path / "face.step"))
    before = spline_arrays.surface_to_arrays(BRepAdaptor_Surface(face).BSpline())
    after = spline_arrays.surface_to_arrays(BRepAdaptor_Surface(again).BSpline())
    assert before[0] == after[0]
    for old, new in [*zip(before[1], after[1], strict=True), *zip(before[2:], after[2:], strict=True)]:
        np.testing.assert_allclose(new, old, rtol=2e-15)


def test_file_is_in_millimetres_whatever_others_have_set(tmp_path):
    STEPControl_Controller.Init_s()
    names = ("write.step.unit", "xstep.cascade.unit")
    before = [Interface_Static.CVal_s(name) for name in names]
    try:
        for name in names:
            Interface_Static.SetCVal_s(name, "INCH")
        write_step(box(), tmp_path / "box.step")
        again = read_step(tmp_path / "box.step")
        assert [Interface_Static.CVal_s(name) for name in names] == ["INCH", "INCH"]
    finally:
        for name, value in zip(names, before, strict=True):
            Interface_Static.SetCVal_s(name, value)
    assert "SI_UNIT(.MILLI.,.METRE.)" in (tmp_path / "box.step").read_text()
    assert volume(again) == pytest.approx(6000, rel=1e-12)


def test_inches_become_millimetres(tmp_path):
    STEPControl_Controller.Init_s()
    from OCP.STEPControl import STEPControl_StepModelType, STEPControl_Writer

    before = Interface_Static.CVal_s("write.step.unit")
    try:
        Interface_Static.SetCVal_s("write.step.unit", "INCH")
        writer = STEPControl_Writer()
        writer.Transfer(BRepPrimAPI_MakeBox(25.4, 25.4, 50.8).Shape(), STEPControl_StepModelType.STEPControl_AsIs)
        writer.Write(str(tmp_path / "inch.step"))
    finally:
        Interface_Static.SetCVal_s("write.step.unit", before)
    assert "INCH" in (tmp_path / "inch.step").read_text()
    assert volume(read_step(tmp_path / "inch.step")) == pytest.approx(2 * 25.4**3, rel=1e-9)


def test_several_bodies_come_back_as_one_shape(tmp_path):
    from OCP.BRep import BRep_Builder

    both = TopoDS_Compound()
    builder = BRep_Builder()
    builder.MakeCompound(both)
    builder.Add(both, box())
    builder.Add(both, cylinder(50, 0, 5))
    write_step(both, tmp_path / "both.step")
    assert len(faces(read_step(tmp_path / "both.step"))) == 9


def test_nothing_is_printed_and_the_printers_come_back(tmp_path, capfd):
    count = Message.DefaultMessenger_s().Printers().Size()
    write_step(box(), tmp_path / "box.step")
    read_step(tmp_path / "box.step")
    (tmp_path / "bad.step").write_text("ISO-10303-21; nonsense")
    with pytest.raises(StepError):
        read_step(tmp_path / "bad.step")
    assert capfd.readouterr() == ("", "")
    assert Message.DefaultMessenger_s().Printers().Size() == count > 0


EMPTY_MODEL = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('','',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));
ENDSEC;
DATA;
#1 = CARTESIAN_POINT('',(0.,0.,0.));
ENDSEC;
END-ISO-10303-21;
"""

UNREADABLE = {
    "empty": (b"", "the file is empty"),
    "blank": (b" \n\n", "the file is empty"),
    "text": (b"Dear Sir or Madam", "not a STEP file"),
    "random": (np.random.default_rng(3).bytes(4000), "not a STEP file"),
    "random after the magic word": (
        b"ISO-10303-21;" + np.random.default_rng(3).bytes(4000),
        "it is cut off before its end",
    ),
    "no geometry": (EMPTY_MODEL.encode(), "the file holds no geometry"),
    "syntax": (EMPTY_MODEL.replace("(0.,0.,0.)", "((0.,,0.)").encode(), "its syntax is damaged"),
}


@pytest.mark.parametrize("name", UNREADABLE)
def test_unreadable_files_are_named_in_one_line(name, tmp_path):
    data, message = UNREADABLE[name]
    path = tmp_path / "odd name é.step"
    path.write_bytes(data)
    with pytest.raises(StepError, match=re.escape(message)) as caught:
        read_step(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_file_and_directory(tmp_path):
    with pytest.raises(StepError, match="No such file"):
        read_step(tmp_path / "absent.step")
    with pytest.raises(StepError, match="Is a directory"):
        read_step(tmp_path)


@pytest.mark.parametrize("part", [0.05, 0.3, 0.8, 0.999])
def test_truncated_files_are_refused(part, box_text, tmp_path):
    path = tmp_path / "cut.step"
    path.write_text(box_text[: int(len(box_text) * part)])
    with pytest.raises(StepError, match="cut off before its end"):
        read_step(path)


@pytest.mark.parametrize(
    "entity", ["ADVANCED_FACE", "CLOSED_SHELL", "EDGE_CURVE", "EDGE_LOOP", "VERTEX_POINT", "LINE", "PLANE"]
)
def test_a_lost_entity_is_an_error_and_never_a_lost_face(entity, box_text, tmp_path):
    path = tmp_path / "lost.step"
    path.write_text(re.sub(rf"#\d+ = {entity}\([^;]*;\n", "", box_text, count=1))
    with pytest.raises(StepError, match=r"damaged: .* of its geometry are unusable, first"):
        read_step(path)


def test_a_pcurve_that_is_no_curve_is_an_error_and_no_crash(box_text, tmp_path):
    placement = re.search(r"#(\d+) = AXIS2_PLACEMENT_3D", box_text)[1]
    path = tmp_path / "crossed.step"
    crossed = re.sub(r"(= DEFINITIONAL_REPRESENTATION\('',\()#\d+", rf"\1#{placement}", box_text, count=1)
    assert crossed != box_text
    path.write_text(crossed)
    with pytest.raises(StepError, match="damaged: a pcurve has no curve"):
        read_step(path)


def shuffled(text: str) -> str:
    """Return a STEP file with its entities in another order, so that their names are not their places."""
    head, body, foot = re.split(r"(?<=DATA;\n)|(?=ENDSEC;\nEND-ISO)", text)
    entities = re.findall(r"#.*?;\n", body, flags=re.DOTALL)
    return head + "".join(random.Random(5).sample(entities, len(entities))) + foot


@pytest.mark.parametrize("entity", ["DIRECTION", "PCURVE"])
def test_what_is_whole_all_the_same_is_read_with_a_warning_that_names_the_bad_entities(entity, box_text, tmp_path):
    """CadQuery reads these as the valid box that they were; who refers to what is lost, is named as in the file."""
    path = tmp_path / "odd.step"
    lost = re.search(rf"(#\d+) = {entity}\([^;]*;\n", box_text)
    path.write_text(shuffled(box_text.replace(lost[0], "")))
    holder = re.search(rf"(#\d+) = (\w+)\([^;]*{lost[1]}\b[^;]*;", box_text.replace(lost[0], ""))
    with pytest.warns(DamagedFileWarning, match=rf"odd\.step: damaged: 1 .*\({holder[1]} \w+\)"):
        shape = read_step(path)
    assert volume(shape) == pytest.approx(volume(box()), rel=1e-12)
    assert len(faces(shape)) == 6


def test_a_real_file_with_seams_of_one_pcurve_is_read_with_a_warning():
    path = CASES / "occt__ec_exhaust-A.stp"
    if not path.exists():
        pytest.skip("the shared cases are not here")
    with pytest.warns(DamagedFileWarning, match=r"12 entities .*Seam Curve with twice the same geom.*#2679 SeamCurve"):
        shape = read_step(path)
    assert len(faces(shape)) == path.read_text().count("ADVANCED_FACE")


def test_lost_units_are_an_error(box_text, tmp_path):
    path = tmp_path / "lost.step"
    path.write_text(re.sub(r"#\d+ = \( LENGTH_UNIT[^;]*;\n", "", box_text, count=1))
    with pytest.raises(StepError, match="damaged"):
        read_step(path)


@pytest.mark.parametrize("name", ["nist__nist_ctc_01_asme1_ap242-e1.stp", "bd__M6-1x12-countersunk-screw.step"])
def test_real_files_with_unreadable_annotations_are_read(name):
    path = CASES / name
    if not path.exists():
        pytest.skip("the shared cases are not here")
    shape = read_step(path)
    assert len(faces(shape)) == path.read_text().count("ADVANCED_FACE")


def test_an_old_file_is_replaced(tmp_path):
    path = tmp_path / "out.step"
    path.write_text("old")
    write_step(box(), path)
    assert len(faces(read_step(path))) == 6
    assert os.listdir(tmp_path) == ["out.step"]


def test_a_link_stays_a_link(tmp_path):
    (tmp_path / "link.step").symlink_to(tmp_path / "real.step")
    write_step(box(), tmp_path / "link.step")
    assert (tmp_path / "link.step").is_symlink()
    assert len(faces(read_step(tmp_path / "real.step"))) == 6


def test_nothing_to_write_keeps_the_old_file(tmp_path):
    from OCP.BRep import BRep_Builder

    path = tmp_path / "out.step"
    path.write_text("old")
    empty = TopoDS_Compound()
    BRep_Builder().MakeCompound(empty)
    for nothing in (TopoDS_Shape(), empty):
        with pytest.raises(StepError, match="the shape is empty"):
            write_step(nothing, path)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["out.step"]


def test_a_failing_disk_keeps_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / "out.step"
    path.write_text("old")

    def full(descriptor: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StepError, match="cannot be written: No space left on device"):
        write_step(box(), path)
    assert path.read_text() == "old"
    assert os.listdir(tmp_path) == ["out.step"]


def test_writing_to_nowhere(tmp_path):
    with pytest.raises(StepError, match="cannot be written: No such file or directory"):
        write_step(box(), tmp_path / "absent" / "out.step")
    with pytest.raises(StepError, match="cannot be written: Is a directory"):
        write_step(box(), tmp_path)
    assert os.listdir(tmp_path) == []
    assert os.listdir(tmp_path.parent).count(tmp_path.name) == 1


def test_edge_tolerance_after_reading_is_occts_own(tmp_path):
    """Pcurves are in the file, so the reader has no reason to widen an edge."""
    write_step(BODIES["torus with a hole on its seam"](), tmp_path / "body.step")
    explorer = TopExp_Explorer(read_step(tmp_path / "body.step"), TopAbs_ShapeEnum.TopAbs_EDGE)
    largest = 0.0
    while explorer.More():
        largest = max(largest, BRep_Tool.Tolerance_s(TopoDS.Edge_s(explorer.Current())))
        explorer.Next()
    assert math.isclose(largest, 1e-7)
