"""Read and write STEP files in millimetres, with one clear error in place of OCCT's messages.

OCCT reads a damaged file as far as it can and returns the rest, often with a face missing and without an error, and
sometimes crashes; it overwrites the target directly, with 12 digits. Here a file whose geometry did not load completely
is first translated by another process, and read only if its solids are complete nevertheless; writing keeps 16 digits
and replaces the target only when the new file is complete.
"""

import io
import os
import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.GeomAbs import GeomAbs_SurfaceType
from OCP.GeomAdaptor import GeomAdaptor_Surface
from OCP.IFSelect import IFSelect_ReturnStatus
from OCP.Interface import Interface_CheckIterator, Interface_Static
from OCP.Message import Message
from OCP.STEPControl import STEPControl_Controller, STEPControl_Reader, STEPControl_StepModelType, STEPControl_Writer
from OCP.StepData import StepData_StepWriter
from OCP.StepGeom import StepGeom_Curve, StepGeom_Pcurve
from OCP.StepShape import StepShape_FaceSurface, StepShape_ManifoldSolidBrep
from OCP.TopAbs import TopAbs_ShapeEnum
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS_Face, TopoDS_Shape

from cqblend.atomic_files import write_atomically
from cqblend.brep.topology import ShapeIndex
from cqblend.errors import DamagedFileWarning, StepError, shown, warn
from cqblend.installation_check import build_interpreter_command

_GEOMETRY_PREFIXES: Final = ("StepShape_", "StepGeom_")
"""Prefixes of OCCT's classes of STEP entities without which a shape is incomplete, unlike notes or colours."""

_STRUCTURAL_KINDS: Final = (
    "Shell",
    "Loop",
    "Bound",
    "OrientedEdge",
    "SolidBrep",
    "BrepWithVoids",
    "Context",
    "Ctx",
    "file",
)
"""Parts of the class names of STEP entities whose failure loses a face or the unit of length."""

_TRANSLATION_TIMEOUT: Final = 120.0
"""Seconds after which the translation of a damaged file counts as failed: OCCT may loop forever."""

_MOST_NAMED: Final = 20
"""Largest number of unusable entities that a message names."""

_REAL_FORMAT: Final = "%#.16G"
"""Format of reals: OCCT writes each into 24 bytes, which a 17th digit (bit exact) would overrun below 1e-99."""

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
        If the file is missing, unreadable, not STEP, damaged, or holds no geometry. A file counts as damaged when an
        entity of its geometry or topology fails to load or to translate, even if OCCT would return the rest, unless
        all solids and faces of the file are there and valid; unreadable annotations are ignored.

    Warns
    -----
    DamagedFileWarning
        If entities failed, but the solids are complete and valid; the message names the entities.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise StepError(f"{path}: cannot be read: {error.strerror}") from error
    except ValueError as error:
        raise StepError(f"{shown(str(path))} is no file name: {error}") from error
    if not data.strip():
        raise StepError(f"{path}: the file is empty")
    if b"ISO-10303-21" not in data[:4096]:
        raise StepError(f"{path}: not a STEP file (no ISO-10303-21 at its start)")
    with _silence_messages():
        reader = STEPControl_Reader()
        status = reader.ReadStream(path.name, io.BytesIO(data))
        if status != IFSelect_ReturnStatus.IFSelect_RetDone:
            cause = "its syntax is damaged" if b"END-ISO-10303-21" in data[-4096:] else "it is cut off before its end"
            raise StepError(f"{path}: cannot be read as STEP: {cause}")
        # OCCT crashes on some incomplete entities, so they are not translated here before another process has survived.
        failed = _find_unusable_entities(data, reader.StepModel(), reader.WS().ModelCheckList(False))
        _require_pcurve_curves(path, reader.StepModel())
        if failed and (any(map(_is_structural, failed)) or not _is_translatable(path)):
            raise _make_damage_error(path, failed)
        reader.SetSystemLengthUnit(1.0)
        reader.TransferRoots()
        failed += _find_unusable_entities(data, reader.StepModel(), reader.WS().TransferReader().LastCheckList())
        shape = reader.OneShape()
        if failed and not _is_whole(shape, reader.StepModel()):
            raise _make_damage_error(path, failed)
    if shape.IsNull() or not _has_geometry(shape):
        raise StepError(f"{path}: the file holds no geometry")
    if failed:
        instead = "OCCT has put something else in their place, and the solids are whole and valid"
        warn(DamagedFileWarning(f"{path}: {_describe_unusable(failed)}; {instead}"))
    return shape


def probe_translation(path: str) -> None:
    """Translate a file and drop the result, to find out whether OCCT crashes."""
    reader = STEPControl_Reader()
    if reader.ReadStream("probe", io.BytesIO(Path(path).read_bytes())) == IFSelect_ReturnStatus.IFSelect_RetDone:
        reader.TransferRoots()
        BRepCheck_Analyzer(reader.OneShape()).IsValid()


def write_step(shape: TopoDS_Shape, path: str | os.PathLike[str]) -> None:
    """Write a shape as STEP AP214 in millimetres, with 16 significant digits and with pcurves.

    The file is built beside its target and replaces it in one step: an older file survives every failure.

    Raises
    ------
    StepError
        If there is nothing to write, or OCCT or the file system refuses.
    """
    path = Path(path)
    if shape is None or shape.IsNull() or not _has_geometry(shape):
        raise StepError(f"{path}: nothing to write: the shape is empty")
    with _silence_messages(), _override_settings(_WRITE_SETTINGS):
        writer = STEPControl_Writer()
        status = writer.Transfer(_drop_sphere_pcurves(shape), STEPControl_StepModelType.STEPControl_AsIs)
        if status != IFSelect_ReturnStatus.IFSelect_RetDone:
            raise StepError(f"{path}: OCCT cannot translate the shape to STEP ({status.name})")
        data = _serialise_model(writer.Model())
    if not data.rstrip().endswith(b"END-ISO-10303-21;"):
        raise StepError(f"{path}: OCCT wrote an incomplete file")
    try:
        with write_atomically(path) as part:
            part.write_bytes(data)
    except OSError as error:
        raise StepError(f"{path}: cannot be written: {error.strerror}") from error


class _UnusableEntity(NamedTuple):
    """An entity of the geometry that OCCT cannot use: its name in the file, if known, its class, and what is wrong."""

    name: str
    kind: str
    reason: str


def _find_unusable_entities(data: bytes, model: Any, checks: Interface_CheckIterator) -> list[_UnusableEntity]:
    """Return the entities of the geometry on which a check has failed."""
    failures, names = [], None
    checks.Start()
    while checks.More():
        check, number = checks.Value(), checks.Number()
        if check.HasFailed():
            entity = model.Value(number) if number > 0 else None
            kind = _GEOMETRY_PREFIXES[0] + "file" if entity is None else entity.DynamicType().Name()
            if kind.startswith(_GEOMETRY_PREFIXES):
                names = _read_entity_names(data, model.NbEntities()) if names is None else names
                failures.append(_UnusableEntity(names.get(number, ""), kind.split("_", 1)[1], check.CFail(1).strip()))
        checks.Next()
    return failures


def _read_entity_names(data: bytes, count: int) -> dict[int, str]:
    """Return the names, such as #12, of a file's entities by their number; none unless exactly ``count`` are found."""
    plain = re.sub(rb"'[^']*'|/\*.*?\*/", b"", data, flags=re.DOTALL)
    found = re.findall(rb"(#\d+)\s*=", plain)
    return {i: name.decode() for i, name in enumerate(found, 1)} if len(found) == count else {}


def _is_structural(failure: _UnusableEntity) -> bool:
    return any(part in failure.kind for part in _STRUCTURAL_KINDS)


def _describe_unusable(failed: list[_UnusableEntity]) -> str:
    """Say which entities are unusable, and why the first is."""
    first = failed[0]
    text = f"damaged: {len(failed)} entities of its geometry are unusable, first {first.kind}: {first.reason}"
    named = ", ".join(f"{one.name} {one.kind}" for one in failed[:_MOST_NAMED] if one.name)
    more = f" and {len(failed) - _MOST_NAMED} more" if len(failed) > _MOST_NAMED else ""
    return f"{text} ({named}{more})" if named else text


def _make_damage_error(path: Path, failed: list[_UnusableEntity]) -> StepError:
    return StepError(f"{path}: {_describe_unusable(failed)}")


def _is_translatable(path: Path) -> bool:
    """Whether another process can translate the file without crashing or hanging."""
    code = "from cqblend.brep.step_files import probe_translation; probe_translation(sys.argv[1])"
    command = build_interpreter_command(code, str(path))
    try:
        done = subprocess.run(command, capture_output=True, check=False, timeout=_TRANSLATION_TIMEOUT)  # noqa: S603  (our own code)
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def _is_whole(shape: TopoDS_Shape, model: Any) -> bool:
    """Whether a shape is valid, with closed shells only, and has every solid and every face of its file."""
    if shape.IsNull() or not BRepCheck_Analyzer(shape).IsValid():
        return False
    if not all(map(BRep_Tool.IsClosed_s, ShapeIndex(shape, TopAbs_ShapeEnum.TopAbs_SHELL))):
        return False
    entities = [model.Value(number) for number in range(1, model.NbEntities() + 1)]
    return all(
        _count_distinct_subshapes(shape, kind) >= sum(isinstance(one, wanted) for one in entities) > 0
        for kind, wanted in (
            (TopAbs_ShapeEnum.TopAbs_SOLID, StepShape_ManifoldSolidBrep),
            (TopAbs_ShapeEnum.TopAbs_FACE, StepShape_FaceSurface),
        )
    )


def _count_distinct_subshapes(shape: TopoDS_Shape, kind: TopAbs_ShapeEnum) -> int:
    """Return the number of sub-shapes of a kind, counting one that occurs at several locations once."""
    return len(ShapeIndex.from_shapes((part.Located(TopLoc_Location()) for part in ShapeIndex(shape, kind)), kind))


def _require_pcurve_curves(path: Path, model: Any) -> None:
    """Refuse a model in which a pcurve has no curve: OCCT does not check that, and may crash later."""
    for number in range(1, model.NbEntities() + 1):
        entity = model.Value(number)
        if isinstance(entity, StepGeom_Pcurve):
            holder = entity.ReferenceToCurve()
            if holder is None or holder.NbItems() < 1 or not isinstance(holder.ItemsValue(1), StepGeom_Curve):
                raise StepError(f"{path}: damaged: a pcurve has no curve")


def _serialise_model(model: Any) -> bytes:
    writer = StepData_StepWriter(model)
    writer.FloatWriter().SetFormat(_REAL_FORMAT)
    writer.SendModel(model.Protocol())
    stream = io.BytesIO()
    writer.Print(stream)
    return stream.getvalue()


def _drop_sphere_pcurves(shape: TopoDS_Shape) -> TopoDS_Shape:
    """Return the shape without pcurves on those spheres that OCCT's reader would damage because of them.

    A solid sphere with both poles whose seam is split into three or more edges is read back with a seventh of its
    volume; without pcurves, the reader builds them anew, correctly.
    """
    if not any(map(_has_split_seam, ShapeIndex(shape, TopAbs_ShapeEnum.TopAbs_FACE))):
        return shape
    copy, builder = BRepBuilderAPI_Copy(shape, False).Shape(), BRep_Builder()
    for face in filter(_has_split_seam, ShapeIndex(copy, TopAbs_ShapeEnum.TopAbs_FACE)):
        location = TopLoc_Location()
        surface = BRep_Tool.Surface_s(face, location)
        for edge in ShapeIndex(face, TopAbs_ShapeEnum.TopAbs_EDGE):
            if not BRep_Tool.Degenerated_s(edge):
                pcurve_count = 2 if BRep_Tool.IsClosed_s(edge, face) else 1
                builder.UpdateEdge(edge, *[None] * pcurve_count, surface, location, BRep_Tool.Tolerance_s(edge))
    return copy


def _has_split_seam(face: TopoDS_Face) -> bool:
    """Whether a face is a sphere with both poles and a seam of three or more edges."""
    if GeomAdaptor_Surface(BRep_Tool.Surface_s(face)).GetType() != GeomAbs_SurfaceType.GeomAbs_Sphere:
        return False
    edges = ShapeIndex(face, TopAbs_ShapeEnum.TopAbs_EDGE)
    poles = sum(BRep_Tool.Degenerated_s(edge) for edge in edges)
    pieces = sum(BRep_Tool.IsClosed_s(edge, face) for edge in edges)
    return bool(poles == 2 and pieces >= 3)


def _has_geometry(shape: TopoDS_Shape) -> bool:
    return any(len(ShapeIndex(shape, kind)) for kind in (TopAbs_ShapeEnum.TopAbs_FACE, TopAbs_ShapeEnum.TopAbs_EDGE))


@contextmanager
def _silence_messages() -> Iterator[None]:
    """Remove OCCT's message printers, which write to standard output past Python, within the context."""
    messenger = Message.DefaultMessenger_s()
    printers = list(messenger.Printers())
    messenger.ChangePrinters().Clear()
    try:
        yield
    finally:
        for printer in printers:
            messenger.AddPrinter(printer)


@contextmanager
def _override_settings(values: dict[str, str]) -> Iterator[None]:
    """Change OCCT's global settings within the context."""
    STEPControl_Controller.Init_s()  # which resets them, the first time
    before = {name: Interface_Static.CVal_s(name) for name in values}
    try:
        for name, value in values.items():
            Interface_Static.SetCVal_s(name, value)
        yield
    finally:
        for name, value in before.items():
            Interface_Static.SetCVal_s(name, value)
