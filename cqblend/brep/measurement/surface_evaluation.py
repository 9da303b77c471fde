"""Curves and surfaces evaluated by OCCT, point by point: positions, normals and curvatures.

Nothing here uses cqblend's own evaluation of splines: certificates are measured with these functions.
"""

from typing import Literal

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import Geom_Surface
from OCP.Geom2d import Geom2d_Curve
from OCP.gp import gp_Pnt, gp_Pnt2d, gp_Vec
from OCP.Standard import Standard_Failure
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from cqblend.brep.measurement.tolerances import MEASURE_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array


def evaluate_pcurve(pcurve: Geom2d_Curve, ts: Array) -> Array:
    """Return points (n, 2) of a pcurve."""
    point, evaluate, flat = gp_Pnt2d(), pcurve.D0, []
    for t in ts.tolist():
        evaluate(t, point)
        flat += point.Coord()
    return np.array(flat).reshape(-1, 2)


def evaluate_edge(edge: TopoDS_Edge, ts: Array) -> tuple[Array, Array]:
    """Return points and derivatives, (n, 3) each, of an edge in space: of its 3D curve if it has one."""
    point, tangent, evaluate, flat = gp_Pnt(), gp_Vec(), BRepAdaptor_Curve(edge).D1, []
    for t in ts.tolist():
        evaluate(t, point, tangent)
        flat += point.Coord()
        flat += tangent.Coord()
    values = np.array(flat).reshape(-1, 2, 3)
    return values[:, 0], values[:, 1]


def evaluate_surface_jets(surface: Geom_Surface, uv: Array, order: Literal[1, 2]) -> Array:
    """Return jets of a surface: S, Su, Sv and, to order 2, Suu, Svv, Suv, as (n, 3 or 6, 3).

    The samples come first here, unlike in jets of cqblend's own surfaces.

    Raises
    ------
    GeometryError
        OCCT cannot evaluate the surface.
    """
    evaluate = surface.D1 if order == 1 else surface.D2
    point, vectors = gp_Pnt(), [gp_Vec() for _ in range(2 if order == 1 else 5)]
    readers = [point.Coord, *(vector.Coord for vector in vectors)]
    flat: list[float] = []
    for u, v in uv.tolist():
        try:
            evaluate(u, v, point, *vectors)
        except Standard_Failure as error:
            raise GeometryError(f"OCCT cannot differentiate the surface at (u, v) = ({u:.9g}, {v:.9g})") from error
        for read in readers:
            flat += read()
    return np.array(flat).reshape(-1, len(readers), 3)


def compute_normals_curvatures(jets: Array, reverse: bool) -> tuple[Array, Array]:
    """Return unit normals (n, 3) and curvature tensors (n, 3, 3) from second order jets (n, 6, 3).

    Normals are along ``Su x Sv``, or with ``reverse`` against it; nan where the surface is degenerate.
    """
    su, sv = jets[:, 1], jets[:, 2]
    cross = -np.cross(su, sv) if reverse else np.cross(su, sv)
    normals = normalise_rows(cross)
    size = np.linalg.norm(cross, axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        dual = np.stack((np.cross(sv, normals), np.cross(normals, su)), axis=1) / size[:, None]
    if reverse:
        dual = -dual
    luu, lvv, luv = np.einsum("nki,ni->kn", jets[:, 3:], normals)
    form = np.stack((luu, luv, luv, lvv), axis=-1).reshape(-1, 2, 2)
    return normals, np.asarray(dual.transpose(0, 2, 1) @ form @ dual)


def evaluate_face_normals(face: TopoDS_Face, uv: Array) -> tuple[Array, Array]:
    """Return points and outward unit normals (n, 3) of a face at parameters (n, 2); normals are nan where degenerate.

    Raises
    ------
    GeometryError
        OCCT cannot evaluate the surface.
    """
    jets = evaluate_surface_jets(BRep_Tool.Surface_s(face), uv, order=1)
    normals = normalise_rows(np.cross(jets[:, 1], jets[:, 2]))
    return jets[:, 0], -normals if face.Orientation() == TopAbs_REVERSED else normals


def normalise_rows(vectors: Array) -> Array:
    """Return unit vectors; nan for vectors that are so short beside the longest that they may be rounding."""
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    is_sound = size > MEASURE_TOLERANCES.degenerate_ratio * np.nanmax(size)
    return np.asarray(np.divide(vectors, size, out=np.full_like(vectors, np.nan), where=is_sound))


def measure_angle_between(a: Array, b: Array) -> Array:
    """Angles between vectors, ``atan2(|a x b|, a.b)``: exact to rounding also near 0 and pi, unlike arccos."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.einsum("...i,...i->...", a, b)))
