"""The models of Elber's paper unrolled: strips, deviations, areas, seams and times, as tables in Markdown.

Run ``python -m benchmarks.models [MODEL ...]`` from the project's folder. The tolerance is 1e-3 of the diagonal of the
model's box. The first table gives the faces of the solid; the strips N, those of Elber's algorithm 1 for the same faces
and directions, their ratio, and N*; tolerance, the deviation that is certified, and two that are measured with nothing
of ours but the strips (`cqblend.Pattern.strips_3d`), one from faces to strips and one back, all in mm. The second gives
pieces, seams, the distance between strips and flat pieces folded; the largest change of a strip's area by laying it
flat, and of the whole area, from OCCT's of the solid; the largest difference in length between the two sides of a seam;
CPU seconds of `cqblend.unroll`, of placing the pieces and writing a DXF file, and the paper's, on an R3000 of 25 MHz.

The measured deviations are distances of OCCT: fine meshes of both shapes say where they are largest, and there points
of one are projected exactly onto the other.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

import cadquery as cq
import numpy as np
from numpy.typing import NDArray
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.gp import gp_Pnt
from OCP.TopoDS import TopoDS_Shape
from vtkmodules.util.numpy_support import numpy_to_vtk, vtk_to_numpy
from vtkmodules.vtkCommonCore import vtkPoints
from vtkmodules.vtkCommonDataModel import vtkCellArray, vtkPolyData
from vtkmodules.vtkFiltersCore import vtkImplicitPolyDataDistance

import cqblend

sys.path.insert(0, str(Path(__file__).parents[1] / "examples"))

import unroll_models

Array = NDArray[np.float64]

TOLERANCE = 1e-3
PAPER = {
    "tube": "1.4 s",
    "sphere": "",
    "cone_with_cylinder": "",
    "pawn": "3 s",
    "teapot": "5 s",
    "helicopter": "7 s",
    "fighter": "150 s",
}

FINENESS = 0.05  # of the meshes, relative to the tolerance
ORDER = 4  # a triangle is looked at in the points that divide its sides by this
WORST = 60  # places, by meshes, that are measured exactly


def mesh(shape: cq.Shape, fineness: float) -> tuple[Array, NDArray[np.int64]]:
    """Return corners (n, 3) and triangles (m, 3), nowhere further from a shape; of a copy, since shapes keep meshes."""
    copy = shape.copy()
    BRepMesh_IncrementalMesh(copy.wrapped, fineness, False, 0.06)  # CadQuery's own is relative to the size of edges
    corners, triangles = copy.tessellate(1e9)
    return np.array([corner.toTuple() for corner in corners]), np.array(triangles)


def spread(corners: Array, triangles: NDArray[np.int64]) -> Array:
    """Return points all over triangles, (k, 3)."""
    i, j = np.indices((ORDER + 1, ORDER + 1)).reshape(2, -1)
    inside = i + j <= ORDER
    parts = np.stack([i, j, ORDER - i - j], axis=-1)[inside] / ORDER
    return np.einsum("kc,mcx->mkx", parts, corners[triangles]).reshape(-1, 3)


def distances(points: Array, corners: Array, triangles: NDArray[np.int64]) -> Array:
    """Return the distances of points from a mesh."""
    data, cells, places = vtkPolyData(), vtkCellArray(), vtkPoints()
    places.SetData(numpy_to_vtk(corners, deep=True))
    for triangle in triangles:
        cells.InsertNextCell(3, triangle.tolist())
    data.SetPoints(places)
    data.SetPolys(cells)
    field = vtkImplicitPolyDataDistance()
    field.SetInput(data)
    result = numpy_to_vtk(np.zeros(len(points)), deep=True)
    field.FunctionValue(numpy_to_vtk(points, deep=True), result)
    return np.abs(vtk_to_numpy(result))


def nearest(point: Array, shape: TopoDS_Shape) -> tuple[float, Array]:
    """Return the exact distance of a point from a shape, and its foot there."""
    search = BRepExtrema_DistShapeShape(cq.Vertex.makeVertex(*point.tolist()).wrapped, shape)
    foot: gp_Pnt = search.PointOnShape2(1)
    return search.Value(), np.array([foot.X(), foot.Y(), foot.Z()])


def deviation(shape: cq.Shape, other: cq.Shape, fineness: float) -> float:
    """Return the largest distance of a point of a shape from the other one."""
    here, there = mesh(shape, fineness), mesh(other, fineness)
    points = spread(*here)
    apart = distances(points, *there)
    worst = []
    while len(worst) < WORST and apart.max() > 0:  # not all in one place
        worst.append(points[apart.argmax()])
        apart[np.linalg.norm(points - worst[-1], axis=1) < 20 * fineness] = 0
    feet = (nearest(point, shape.wrapped)[1] for point in worst)
    return max((nearest(foot, other.wrapped)[0] for foot in feet), default=0.0)


def rows(name: str) -> tuple[str, str]:
    """Return a model's rows of both tables."""
    solid = getattr(unroll_models, name)()
    tolerance = TOLERANCE * solid.BoundingBox().DiagonalLength
    start = time.process_time()
    pattern = cqblend.unroll(solid, tolerance)
    seconds = time.process_time() - start
    with tempfile.TemporaryDirectory() as folder:
        start = time.process_time()
        pattern.export(Path(folder) / "pattern.dxf")
        writing = time.process_time() - start
    report, fineness = pattern.report, FINENESS * tolerance
    faces, strips = (cq.Compound.makeCompound(shape.Faces()) for shape in (solid, pattern.strips_3d()))  # not filled
    title, ratio = name.replace("_", " "), report.elber / report.strips
    close = (
        f"{len(solid.Faces())} | {report.strips} | {report.elber} | {ratio:.2f} | {report.ideal:.1f} | {tolerance:.4f}",
        f"{report.deviation:.4f}" if report.deviation > 1e-9 else "rounding",
        f"{deviation(faces, strips, fineness):.4f} | {deviation(strips, faces, fineness):.4f}",
    )
    flat = (
        f"{len(pattern.strips)} | {report.seams} | {report.flattening:.2g} mm | {100 * report.area_change:.2g} %",
        f"{100 * (report.area / solid.Area() - 1):.2f} % | {report.seam_mismatch:.0e}",
        f"{seconds:.1f} s | {writing:.1f} s | {PAPER[name]}",
    )
    return f"| {title} | {' | '.join(close)} |", f"| {title} | {' | '.join(flat)} |"


CLOSE = "model | faces | N | Elber's N | ratio | N* | tolerance | certified | faces to strips | strips to faces"
FLAT = "model | pieces | seams | to flat | a strip's area | whole area | seam mismatch | unroll | export | paper"


def main() -> None:
    both = [rows(name) for name in sys.argv[1:] or PAPER]
    for header, table in zip((CLOSE, FLAT), zip(*both, strict=True), strict=True):
        print(f"| {header} |", "|---" + 9 * "|--:" + "|", *table, "", sep="\n")


if __name__ == "__main__":
    main()
