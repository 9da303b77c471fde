"""STEP files, in and out, in millimetres, with one clear error instead of OCCT's chatter.

OCCT reads a damaged file as far as it can and returns what is left, often with a face missing and no word about it, and
sometimes crashes on the way; it writes straight over the target, with 12 digits. Here reading refuses a file whose
geometry did not load completely, and writing keeps 16 digits and replaces the target only when the new file is
complete. This module knows shapes as opaque things to be moved, not what they mean to cqblend.
"""

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.GeomAbs import GeomAbs_SurfaceType
from OCP.GeomAdaptor import GeomAdaptor_Surface
from OCP.IFSelect import IFSelect_ReturnStatus
from OCP.Interface import Interface_CheckIterator, Interface_Static
from OCP.Message import Message
from OCP.STEPControl import STEPControl_Controller, STEPControl_Reader, STEPControl_StepModelType, STEPControl_Writer
from OCP.StepData import StepData_StepWriter
from OCP.StepGeom import StepGeom_Curve, StepGeom_Pcurve
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopExp import TopExp
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape

from cqblend.errors import StepError

_GEOMETRY: Final = ("StepShape_", "StepGeom_")
"""OCCT's classes of STEP entities without which a shape is incomplete; notes, colours and tolerances are others."""

_REAL: Final = "%#.16G"
"""OCCT formats a real into 24 bytes: one digit more, which would be bit exact, overruns them below 1e-99."""

_WRITE_SETTINGS: Final = {
    "write.step.schema": "AP214IS",
    "write.step.unit": "MM",
    "xstep.cascade.unit": "MM",
    "write.surfacecurve.mode": "1",  # pcurves: without them a reader projects anew, to 1e-7, and exact validity is lost
}


def read_step(path: str | os.PathLike[str]) -> TopoDS_Shape:
    """Read a STEP file of any length unit as one shape in millimetres.

    Raises
    ------
    StepError
        If the file is missing, unreadable, not STEP, damaged, or holds no geometry. A file counts as damaged when any
        entity of its geometry or topology fails to load or to translate, even if OCCT would return the rest; unreadable
        annotations are passed over.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise StepError(f"{path}: cannot be read: {error.strerror}") from error
    if not data.strip():
        raise StepError(f"{path}: the file is empty")
    if b"ISO-10303-21" not in data[:4096]:
        raise StepError(f"{path}: not a STEP file (no ISO-10303-21 at its start)")
    with _silence():
        reader = STEPControl_Reader()
        status = reader.ReadStream(path.name, io.BytesIO(data))
        if status != IFSelect_ReturnStatus.IFSelect_RetDone:
            cause = "its syntax is damaged" if b"END-ISO-10303-21" in data[-4096:] else "it is cut off before its end"
            raise StepError(f"{path}: cannot be read as STEP: {cause}")
        # OCCT crashes on some incomplete entities, so nothing is translated before all have loaded.
        _require_complete(path, reader, reader.WS().ModelCheckList(False))
        _require_pcurves(path, reader.StepModel())
        reader.SetSystemLengthUnit(1.0)
        reader.TransferRoots()
        _require_complete(path, reader, reader.WS().TransferReader().LastCheckList())
        shape = reader.OneShape()
    if shape.IsNull() or not _faces_and_edges(shape):
        raise StepError(f"{path}: the file holds no geometry")
    return shape


def write_step(shape: TopoDS_Shape, path: str | os.PathLike[str]) -> None:
    """Write a shape as STEP AP214 in millimetres, with 16 significant digits and with pcurves.

    The file is built beside its target and put in place in one step: one that was there before survives every failure.

    Raises
    ------
    StepError
        If there is nothing to write, or OCCT or the file system refuses.
    """
    path = Path(path)
    if shape is None or shape.IsNull() or not _faces_and_edges(shape):
        raise StepError(f"{path}: nothing to write: the shape is empty")
    with _silence(), _settings(_WRITE_SETTINGS):
        writer = STEPControl_Writer()
        status = writer.Transfer(_readable(shape), STEPControl_StepModelType.STEPControl_AsIs)
        if status != IFSelect_ReturnStatus.IFSelect_RetDone:
            raise StepError(f"{path}: OCCT cannot translate the shape to STEP ({status.name})")
        data = _serialise(writer.Model())
    if not data.rstrip().endswith(b"END-ISO-10303-21;"):
        raise StepError(f"{path}: OCCT wrote an incomplete file")
    _replace(path, data)


def _require_complete(path: Path, reader: STEPControl_Reader, checks: Interface_CheckIterator) -> None:
    """Refuse the model if a check has failed on an entity of its geometry."""
    model = reader.StepModel()
    failures = []
    checks.Start()
    while checks.More():
        check, number = checks.Value(), checks.Number()
        if check.HasFailed():
            kind = model.Value(number).DynamicType().Name() if number > 0 else _GEOMETRY[0] + "file"
            if kind.startswith(_GEOMETRY):
                failures.append(f"{kind.split('_', 1)[1]}: {check.CFail(1).strip()}")
        checks.Next()
    if failures:
        raise StepError(f"{path}: damaged: {len(failures)} entities of its geometry are unusable, first {failures[0]}")


def _require_pcurves(path: Path, model: Any) -> None:
    """Refuse a model in which a pcurve is no curve: OCCT takes it for one unseen, and crashes."""
    for number in range(1, model.NbEntities() + 1):
        entity = model.Value(number)
        if isinstance(entity, StepGeom_Pcurve):
            holder = entity.ReferenceToCurve()
            if holder is None or holder.NbItems() < 1 or not isinstance(holder.ItemsValue(1), StepGeom_Curve):
                raise StepError(f"{path}: damaged: a pcurve has no curve")


def _serialise(model: Any) -> bytes:
    writer = StepData_StepWriter(model)
    writer.FloatWriter().SetFormat(_REAL)
    writer.SendModel(model.Protocol())
    stream = io.BytesIO()
    writer.Print(stream)
    return stream.getvalue()


def _replace(path: Path, data: bytes) -> None:
    """Put the data in the place of the path's content, whole or not at all."""
    target = path.resolve()
    partial = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        try:
            with partial.open("wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            partial.replace(target)
        finally:
            partial.unlink(missing_ok=True)
    except OSError as error:
        raise StepError(f"{path}: cannot be written: {error.strerror}") from error


def _readable(shape: TopoDS_Shape) -> TopoDS_Shape:
    """Return the shape, without pcurves on the spheres that OCCT's own reader would destroy because of them.

    A sphere with both poles whose seam is cut into three or more comes back as its holes' walls and little else, with a
    seventh of its volume; if its pcurves are left out, the reader builds them anew, and all is well.
    """
    if not any(map(_loses_its_seam, _subshapes(shape, TopAbs_ShapeEnum.TopAbs_FACE))):
        return shape
    copy, builder = BRepBuilderAPI_Copy(shape, False).Shape(), BRep_Builder()
    for face in filter(_loses_its_seam, _subshapes(copy, TopAbs_ShapeEnum.TopAbs_FACE)):
        location = TopLoc_Location()
        surface = BRep_Tool.Surface_s(TopoDS.Face_s(face), location)
        for edge in map(TopoDS.Edge_s, _subshapes(face, TopAbs_ShapeEnum.TopAbs_EDGE)):
            if not BRep_Tool.Degenerated_s(edge):
                both = 2 if BRep_Tool.IsClosed_s(edge, TopoDS.Face_s(face)) else 1
                builder.UpdateEdge(edge, *[None] * both, surface, location, BRep_Tool.Tolerance_s(edge))
    return copy


def _loses_its_seam(face: TopoDS_Shape) -> bool:
    face = TopoDS.Face_s(face)
    if GeomAdaptor_Surface(BRep_Tool.Surface_s(face)).GetType() != GeomAbs_SurfaceType.GeomAbs_Sphere:
        return False
    edges = [TopoDS.Edge_s(edge) for edge in _subshapes(face, TopAbs_ShapeEnum.TopAbs_EDGE)]
    poles = sum(BRep_Tool.Degenerated_s(edge) for edge in edges)
    pieces = sum(BRep_Tool.IsClosed_s(edge, face) for edge in edges)
    return bool(poles == 2 and pieces >= 3)


def _faces_and_edges(shape: TopoDS_Shape) -> bool:
    return any(_subshapes(shape, kind) for kind in (TopAbs_ShapeEnum.TopAbs_FACE, TopAbs_ShapeEnum.TopAbs_EDGE))


def _subshapes(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> list[TopoDS_Shape]:
    found = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, kind, found)
    return [found.FindKey(i) for i in range(1, found.Extent() + 1)]


@contextmanager
def _silence() -> Iterator[None]:
    """Take OCCT's message printers away for a while: they write to standard output, past Python."""
    messenger = Message.DefaultMessenger_s()
    printers = list(messenger.Printers())
    messenger.ChangePrinters().Clear()
    try:
        yield
    finally:
        for printer in printers:
            messenger.AddPrinter(printer)


@contextmanager
def _settings(values: dict[str, str]) -> Iterator[None]:
    """Change OCCT's global settings for a while."""
    STEPControl_Controller.Init_s()  # which resets them, the first time
    before = {name: Interface_Static.CVal_s(name) for name in values}
    try:
        for name, value in values.items():
            Interface_Static.SetCVal_s(name, value)
        yield
    finally:
        for name, value in before.items():
            Interface_Static.SetCVal_s(name, value)
