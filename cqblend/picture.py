"""Renders pictures of shapes and curves by VTK, without a window, for the demo and the documentation.

``cadquery.vis`` draws one view at a time, and has no zebra: stripes reflected in a surface, which break where normals
do and bend sharply where curvature does. Normals are OCCT's own at every vertex of the mesh. Shapes are those of
CadQuery; nothing else in cqblend needs this module.
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

from cqblend.atomic_files import write_atomically
from cqblend.errors import InstallationError

if TYPE_CHECKING:
    import cadquery

Colour = tuple[float, float, float]
"""Red, green and blue, 0 to 1."""

Vector3 = tuple[float, float, float]

WHITE: Colour = (1.0, 1.0, 1.0)
INK: Colour = (0.15, 0.15, 0.2)
ZEBRA_STRIPES = 9
"""Number of dark stripes of a zebra, and of light ones, over all directions."""


@dataclass(frozen=True, slots=True)
class MeshTolerances:
    """How fine the meshes of faces are.

    Attributes
    ----------
    deviation
        Largest distance from the face, relative to its size.
    angle
        Rad: largest angle between the normals of neighbouring triangles.
    """

    deviation: float = 3e-4
    angle: float = 0.08


MESH_TOLERANCES = MeshTolerances()


@dataclass(frozen=True)
class ShadedFaces:
    """Faces to be drawn in one colour; ``None`` for a zebra."""

    faces: Iterable[cadquery.Face]
    colour: Colour | None

    @cached_property
    def meshes(self) -> list[Any]:
        """The faces as meshes of VTK, with the exact normals of the surface at their vertices."""
        return [_triangulate_face(face) for face in self.faces]

    def build_actors(self, towards_viewer: Vector3) -> list[Any]:
        """Return the actors of VTK, a zebra as it is reflected to a viewer in a direction."""
        return [_build_face_actor(triangles, self.colour, np.array(towards_viewer)) for triangles in self.meshes]


@dataclass(frozen=True)
class Polylines:
    """Polygons (n, 3) to be drawn as lines so many pixels wide."""

    lines: Sequence[NDArray[np.float64]]
    colour: Colour = INK
    width: float = 1.5

    def build_actors(self, towards_viewer: Vector3) -> list[Any]:  # noqa: ARG002  (lines look the same from everywhere)
        """Return the actors of VTK."""
        ends = np.cumsum([len(line) for line in self.lines])
        cells = [np.arange(end - len(line), end) for line, end in zip(self.lines, ends, strict=True)]
        return [_build_marker_actor(np.concatenate(self.lines), "SetLines", cells, self.colour, self.width)]


@dataclass(frozen=True)
class PointMarkers:
    """Points (n, 3) to be drawn as round dots so many pixels wide."""

    points: NDArray[np.float64]
    colour: Colour = INK
    size: float = 7.0

    def build_actors(self, towards_viewer: Vector3) -> list[Any]:  # noqa: ARG002  (dots look the same from everywhere)
        """Return the actors of VTK."""
        return [
            _build_marker_actor(self.points, "SetVerts", np.arange(len(self.points))[:, None], self.colour, self.size)
        ]


@dataclass(frozen=True)
class View:
    """Faces, lines and markers as seen from a direction, in parallel projection with z upwards.

    Attributes
    ----------
    parts
        The faces, lines and markers.
    towards_viewer
        Direction from the model to the viewer.
    focus
        Point of the model in the middle of the view.
    height
        Height of the part of the model that is seen, mm.
    window
        The part (x0, y0, x1, y1) of the picture that the view fills, between 0 and 1 from the lower left.
    """

    parts: Sequence[ShadedFaces | Polylines | PointMarkers]
    towards_viewer: Vector3
    focus: Vector3
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
    software = window.IsA("vtkOSOpenGLRenderWindow")  # VTK's last resort, which crashes without its library
    if software and not ctypes.util.find_library("OSMesa"):
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
    with write_atomically(path) as file:
        file.write_bytes(memoryview(writer.GetResult()))


def _build_renderer(view: View) -> Any:
    """Return the renderer of a view, with its camera."""
    from vtkmodules.vtkRenderingCore import vtkRenderer

    renderer = vtkRenderer()
    renderer.SetViewport(*view.window)
    renderer.SetBackground(*WHITE)
    for part in view.parts:
        for actor in part.build_actors(view.towards_viewer):
            renderer.AddActor(actor)
    camera = renderer.GetActiveCamera()
    camera.ParallelProjectionOn()
    camera.SetParallelScale(view.height / 2)
    camera.SetFocalPoint(*view.focus)
    camera.SetPosition(*(np.array(view.focus) + 10 * view.height * np.array(view.towards_viewer)).tolist())
    camera.SetViewUp(0, 0, 1)
    renderer.ResetCameraClippingRange()
    return renderer


def _triangulate_face(face: cadquery.Face) -> Any:
    """Return the triangles of a face with their normals, as vtkPolyData, without its edges."""
    from vtkmodules.vtkCommonDataModel import vtkPolyData

    mesh = face.toVtkPolyData(MESH_TOLERANCES.deviation, MESH_TOLERANCES.angle)
    triangles = vtkPolyData()
    triangles.SetPoints(mesh.GetPoints())
    triangles.SetPolys(mesh.GetPolys())
    triangles.GetPointData().SetNormals(mesh.GetPointData().GetNormals())
    return triangles


def _build_face_actor(triangles: Any, colour: Colour | None, towards_viewer: NDArray[np.float64]) -> Any:
    """Return the actor of a mesh in a colour, or as a zebra if that is None."""
    from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper

    mapper = vtkPolyDataMapper()
    mapper.SetInputData(triangles)
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    actor = vtkActor()
    actor.SetMapper(mapper)
    look = actor.GetProperty()
    look.SetInterpolationToPhong()
    if colour is None:
        _colour_zebra(triangles, mapper, towards_viewer)
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
    """Return the actor of unlit lines or dots (kind: SetLines or SetVerts), with a width in pixels."""
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


def _colour_zebra(triangles: Any, mapper: Any, towards_viewer: NDArray[np.float64]) -> None:
    """Colour a mesh in bands by the z component of r = 2 (n.e) n - e.

    That is the direction e towards the viewer, reflected at the normal n.
    """
    from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
    from vtkmodules.vtkCommonCore import vtkLookupTable

    e = towards_viewer / np.linalg.norm(towards_viewer)
    n = vtk_to_numpy(triangles.GetPointData().GetNormals()).astype(float)
    height = 2 * (n @ e) * n[:, 2] - e[2]
    triangles.GetPointData().SetScalars(numpy_to_vtk(height, deep=True))
    table = vtkLookupTable()
    table.SetNumberOfTableValues(2 * ZEBRA_STRIPES)
    table.SetRange(-1, 1)
    for i in range(2 * ZEBRA_STRIPES):
        table.SetTableValue(i, *(WHITE if i % 2 else INK), 1)
    mapper.SetLookupTable(table)
    mapper.SetScalarRange(-1, 1)
    mapper.InterpolateScalarsBeforeMappingOn()
