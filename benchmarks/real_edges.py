"""Listed edges of real STEP parts, read with OCCT alone: what the benchmarks blend, and what their oracles judge.

``edges.json`` lists edges by file, each with its number, its middle and trials at some radii; ``edges_more.json`` is a
flat list of edges with one radius each. Numbers are places in OCCT's map of the edges of a shape, from 1. Nothing here
knows cqblend, so that what judges its results may read the same edges.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.IFSelect import IFSelect_ReturnStatus
from OCP.STEPControl import STEPControl_Reader
from OCP.TopAbs import TopAbs_EDGE
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape


@dataclass(frozen=True)
class RealEdge:
    """An edge of a part with a radius, mm; ``freeform`` if one of its faces is a B-spline."""

    part: str
    number: int
    shape: TopoDS_Shape
    edge: TopoDS_Edge
    radius: float
    freeform: bool

    @property
    def name(self) -> str:
        """The part and the number of the edge."""
        return f"{self.part} {self.number}"


def read_listed_edges(folder: Path) -> Iterator[RealEdge]:
    """Yield the listed edges of a folder: of ``edges.json`` at every radius, of ``edges_more.json`` at one."""
    for file, edges in json.loads((folder / "edges.json").read_text()).items():
        radii = {listed["edge"]: sorted({trial["radius"] for trial in listed["trials"]}) for listed in edges}
        yield from _read_of_file(folder / file, [(one, radius) for one in edges for radius in radii[one["edge"]]])
    more = folder / "edges_more.json"
    others = json.loads(more.read_text()) if more.exists() else []
    for file in dict.fromkeys(listed["file"] for listed in others):
        yield from _read_of_file(folder / file, [(one, one["radius"]) for one in others if one["file"] == file])


def list_edges(shape: TopoDS_Shape) -> list[TopoDS_Edge]:
    """Return the edges of a shape in the order of OCCT's map, which is that of their numbers."""
    found = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, TopAbs_EDGE, found)
    return [TopoDS.Edge_s(found.FindKey(number)) for number in range(1, found.Extent() + 1)]


def _read_of_file(path: Path, wanted: list[tuple[dict[str, Any], float]]) -> Iterator[RealEdge]:
    shape = _read_shape(path)
    present = list_edges(shape)
    part = path.stem.split("__")[-1].removeprefix("nist_")[:8]
    for listed, radius in wanted:
        edge = _find_edge(present, listed["edge"], listed.get("mid"))
        yield RealEdge(part, listed["edge"], shape, edge, radius, "BSplineSurface" in listed["faces"])


def _read_shape(path: Path) -> TopoDS_Shape:
    reader = STEPControl_Reader()
    if reader.ReadFile(str(path)) != IFSelect_ReturnStatus.IFSelect_RetDone:
        raise OSError(f"{path} cannot be read")
    reader.TransferRoots()
    return reader.OneShape()


def _find_edge(edges: list[TopoDS_Edge], number: int, middle: list[float] | None) -> TopoDS_Edge:
    """Return the edge of that number if it has that middle or none is known, else the one nearest to it."""
    if middle is None or (number <= len(edges) and np.linalg.norm(_locate_middle(edges[number - 1]) - middle) < 1e-3):
        return edges[number - 1]
    return min(edges, key=lambda edge: float(np.linalg.norm(_locate_middle(edge) - middle)))


def _locate_middle(edge: TopoDS_Edge) -> np.ndarray:
    curve = BRepAdaptor_Curve(edge)
    return np.array(curve.Value((curve.FirstParameter() + curve.LastParameter()) / 2).Coord())
