"""Pictures of shapes and curves, rendered by VTK without a window: what the demo and the documentation show.

Exists because ``cadquery.vis`` draws one view at a time, and has no zebra: stripes reflected in a surface, which break
where normals do and bend sharply where curvature does. Normals are OCCT's own at every vertex of the mesh. Knows shapes
only through CadQuery; nothing else in cqblend needs this module.
"""

from __future__ import annotations

import ctypes.util
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from cqblend.errors import InstallationError
from cqblend.whole_files import write_atomically

if TYPE_CHECKING:
    import cadquery

Colour = tuple[float, float, float]
Triple = tuple[float, float, float]

WHITE: Colour = (1.0, 1.0, 1.0)
INK: Colour = (0.15, 0.15, 0.2)
MESH_DEVIATION, MESH_ANGLE = 3e-4, 0.08  # of the mesh: relative to the face, and rad between neighbouring normals
STRIPES = 9


@dataclass(frozen=True)
class ShadedFaces:
    """Faces to be drawn in one colour; ``None`` for a zebra."""

    faces: Iterable[cadquery.Face]
    colour: Colour | None

    @cached_property
    def meshes(self) -> list[Any]:
        """The faces as VTK's triangles, with exact normals."""
        return [_triangulate_face(face) for face in self.faces]

    def build_actors(self, eye: Triple) -> list[Any]:
        """Return what VTK draws, as seen from a direction."""
        return [_build_face_actor(triangles, self.colour, np.array(eye)) for triangles in self.meshes]


@dataclass(frozen=True)
class Polylines:
    """Polygons (n, 3) to be drawn as lines so many pixels wide."""

    lines: Sequence[NDArray[np.float64]]
    colour: Colour = INK
    width: float = 1.5

    def build_actors(self, eye: Triple) -> list[Any]:  # noqa: ARG002  (lines look the same from everywhere)
        """Return what VTK draws."""
        ends = np.cumsum([len(line) for line in self.lines])
        cells = [np.arange(end - len(line), end) for line, end in zip(self.lines, ends, strict=True)]
        return [_build_marker_actor(np.concatenate(self.lines), "SetLines", cells, self.colour, self.width)]


@dataclass(frozen=True)
class PointMarkers:
    """Points (n, 3) to be drawn as round dots so many pixels wide."""

    points: NDArray[np.float64]
    colour: Colour = INK
    size: float = 7.0

    def build_actors(self, eye: Triple) -> list[Any]:  # noqa: ARG002  (dots look the same from everywhere)
        """Return what VTK draws."""
        return [
            _build_marker_actor(self.points, "SetVerts", np.arange(len(self.points))[:, None], self.colour, self.size)
        ]


@dataclass(frozen=True)
class View:
    """Parts, strokes and dots as seen from a direction, in parallel projection with z upwards.

    ``focus`` is what the middle of the view shows, ``height`` how much of the model it shows (mm), ``window`` which
    part of the picture it fills, (x0, y0, x1, y1) between 0 and 1 from the lower left.
    """

    parts: Sequence[ShadedFaces | Polylines | PointMarkers]
    eye: Triple
    focus: Triple
    height: float
    window: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)


def draw_views(views: Sequence[View], path: Path, *, size: tuple[int, int]) -> None:
    """Render views into one PNG file of the given size in pixels.

    Raises
    ------
    InstallationError
        This machine has no OpenGL that draws without a display.
    OSError
        The file cannot be written.
    """
    from vtkmodules.vtkCommonCore import vtkLogger
    from vtkmodules.vtkIOImage import vtkPNGWriter
    from vtkmodules.vtkRenderingCore import vtkRenderWindow, vtkWindowToImageFilter

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)  # it warns of every kind of display that it looks for in vain
    window = vtkRenderWindow()
    if window.IsA("vtkOSOpenGLRenderWindow") and not ctypes.util.find_library(
        "OSMesa"
    ):  # VTK's last resort, and it crashes
        raise InstallationError("there is no OpenGL to draw with; on Debian and Ubuntu: apt-get install libegl1")
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(8)
    window.SetSize(*size)
    for view in views:
        window.AddRenderer(_build_renderer(view))
    window.Render()
    image = vtkWindowToImageFilter()
    image.SetInput(window)
    image.SetInputBufferTypeToRGB()
    image.ReadFrontBufferOff()
    writer = vtkPNGWriter()
    writer.SetCompressionLevel(9)
    writer.SetInputConnection(image.GetOutputPort())
    writer.WriteToMemoryOn()
    writer.Write()
    with write_atomically(path) as part:
        part.write_bytes(memoryview(writer.GetResult()))


def _build_renderer(view: View) -> Any:
    from vtkmodules.vtkRenderingCore import vtkRenderer

    renderer = vtkRenderer()
    renderer.SetViewport(*view.window)
    renderer.SetBackground(*WHITE)
    for part in view.parts:
        for actor in part.build_actors(view.eye):
            renderer.AddActor(actor)
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetParallelScale(view.height / 2)
    camera.SetFocalPoint(*view.focus)
    camera.SetPosition(*(np.array(view.focus) + 10 * view.height * np.array(view.eye)).tolist())
    camera.SetViewUp(0, 0, 1)
    renderer.ResetCameraClippingRange()
    return renderer


def _triangulate_face(face: cadquery.Face) -> Any:
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    mesh = face.toVtkPolyData(MESH_DEVIATION, MESH_ANGLE)
    triangles = vtkPolyData()
    triangles.SetPoints(mesh.GetPoints())
    triangles.SetPolys(mesh.GetPolys())
    triangles.GetPointData().SetNormals(mesh.GetPointData().GetNormals())
    return triangles


def _build_face_actor(triangles: Any, colour: Colour | None, eye: NDArray[np.float64]) -> Any:
    from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

    mapper = vtkPolyDataMapper()
    mapper.SetInputData(triangles)
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor = vtkActor()
    actor.SetMapper(mapper)
    look = actor.GetProperty()
    look.SetInterpolationToPhong()
    if colour is None:
        _colour_zebra(triangles, mapper, eye)
        look.SetAmbient(0.35)
        look.SetDiffuse(0.65)
    else:
        look.SetColor(*colour)
        look.SetAmbient(0.15)
        look.SetDiffuse(0.85)
        look.SetSpecular(0.2)
        look.SetSpecularPower(40)
    return actor


def _build_marker_actor(
    points: NDArray[np.float64], kind: str, cells: Iterable[Any], colour: Colour, size: float
) -> Any:
    """Unlit lines or dots, pixels wide."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonCore import vtkPoints
    from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
    from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

    array = vtkCellArray()
    for cell in cells:
        array.InsertNextCell(len(cell), cell.tolist())
    corners = vtkPoints()
    corners.SetData(numpy_to_vtk(np.ascontiguousarray(points, dtype=float), deep=True))
    data = vtkPolyData()
    data.SetPoints(corners)
    getattr(data, kind)(array)
    mapper = vtkPolyDataMapper()
    mapper.SetInputData(data)
    actor = vtkActor()
    actor.SetMapper(mapper)
    look = actor.GetProperty()
    look.SetColor(*colour)
    look.LightingOff()
    look.SetLineWidth(size)
    look.SetPointSize(size)
    look.RenderPointsAsSpheresOn()
    return actor


def _colour_zebra(triangles: Any, mapper: Any, eye: NDArray[np.float64]) -> None:
    """Colour a mesh in bands by the height of r = 2 (n.e) n - e, the direction in which it reflects the eye's rays."""
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkLookupTable

    e = eye / np.linalg.norm(eye)
    n = vtk_to_numpy(triangles.GetPointData().GetNormals()).astype(float)
    height = 2 * (n @ e) * n[:, 2] - e[2]
    triangles.GetPointData().SetScalars(numpy_to_vtk(height, deep=True))
    table = vtkLookupTable()
    table.SetNumberOfTableValues(2 * STRIPES)
    table.SetRange(-1, 1)
    for i in range(2 * STRIPES):
        table.SetTableValue(i, *(WHITE if i % 2 else INK), 1)
    mapper.SetLookupTable(table)
    mapper.SetScalarRange(-1, 1)
    mapper.InterpolateScalarsBeforeMappingOn()
