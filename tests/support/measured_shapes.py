"""Shapes that the tests of measurements share, and their edges and faces."""

import math

import cadquery as cq
import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace
from OCP.Geom import Geom_BSplineSurface
from OCP.gp import gp_Pnt
from OCP.TColgp import TColgp_Array2OfPnt
from OCP.TColStd import TColStd_Array1OfInteger, TColStd_Array1OfReal
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE
from OCP.TopExp import TopExp
from OCP.TopoDS import TopoDS, TopoDS_Shape
from OCP.TopTools import TopTools_IndexedMapOfShape


def subshapes(shape, kind):
    """Return the distinct edges or faces of a shape."""
    found = TopTools_IndexedMapOfShape()
    TopExp.MapShapes_s(shape, kind, found)
    cast = TopoDS.Edge_s if kind == TopAbs_EDGE else TopoDS.Face_s
    return [cast(found.FindKey(i)) for i in range(1, found.Extent() + 1)]


def edges(shape):
    return subshapes(shape, TopAbs_EDGE)


def faces(shape):
    return subshapes(shape, TopAbs_FACE)


def real_edges(shape):
    return [edge for edge in edges(shape) if not BRep_Tool.Degenerated_s(edge)]


def wrapped(workplane: cq.Workplane) -> TopoDS_Shape:
    return workplane.val().wrapped


def bspline(poles, knots_u, knots_v, degrees):
    """A B-spline surface from poles (nu, nv, 3) and (knots, multiplicities) in each direction."""
    poles = np.asarray(poles, dtype=float)
    grid = TColgp_Array2OfPnt(1, poles.shape[0], 1, poles.shape[1])
    for i, j in np.ndindex(poles.shape[:2]):
        grid.SetValue(i + 1, j + 1, gp_Pnt(*poles[i, j].tolist()))
    reals, integers = [], []
    for knots, multiplicities in (knots_u, knots_v):
        reals.append(TColStd_Array1OfReal(1, len(knots)))
        integers.append(TColStd_Array1OfInteger(1, len(knots)))
        for i, (knot, multiplicity) in enumerate(zip(knots, multiplicities, strict=True), start=1):
            reals[-1].SetValue(i, float(knot))
            integers[-1].SetValue(i, multiplicity)
    return Geom_BSplineSurface(grid, *reals, *integers, *degrees)


def roof():
    """A ridge inside one bilinear surface: z = 1 - |x - 1| over [0, 2] x [0, 1], C0 at u = 1."""
    poles = [[[0, 0, 0], [0, 1, 0]], [[1, 0, 1], [1, 1, 1]], [[2, 0, 0], [2, 1, 0]]]
    return bspline(poles, ((0, 1, 2), (2, 1, 2)), ((0, 1), (2, 2)), (1, 1))


def wave():
    """One freeform face: a biquintic Bezier patch."""
    x, y = np.meshgrid(np.linspace(0, 10, 6), np.linspace(0, 10, 6), indexing="ij")
    z = np.sin(x) + np.cos(0.7 * y) + 0.02 * x * y
    surface = bspline(np.stack((x, y, z), axis=-1), ((0, 1), (6, 6)), ((0, 1), (6, 6)), (5, 5))
    return BRepBuilderAPI_MakeFace(surface, 1e-7).Face()


def prism(radius: float = 0.0) -> cq.Workplane:
    """A spline through 16 points of an ellipse, extruded; its upper rim rounded."""
    ellipse = [(20 * math.cos(a), 10 * math.sin(a)) for a in np.linspace(0, 2 * math.pi, 17)[:-1]]
    part = cq.Workplane().spline(ellipse, periodic=True).close().extrude(10)
    return part.faces(">Z").edges().fillet(radius) if radius else part
