"""Samples of a face along one of its edges: where to take them, and what OCCT evaluates there."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.Geom import Geom_Surface
from OCP.Geom2d import Geom2d_Curve
from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
from OCP.GeomAbs import GeomAbs_C2
from OCP.gp import gp_Pnt2d, gp_Vec2d
from OCP.TopAbs import TopAbs_EDGE, TopAbs_REVERSED
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from cqblend.brep.measurement.edge_parameters import (
    find_curve_knots,
    find_knot_crossings,
    measure_line_distances,
    spread_samples,
)
from cqblend.brep.measurement.edge_sides import EdgeSide, find_sides_on_face, read_pcurve
from cqblend.brep.measurement.surface_evaluation import (
    compute_normals_curvatures,
    evaluate_pcurve,
    evaluate_surface_jets,
)
from cqblend.brep.measurement.tolerances import MEASURE_TOLERANCES
from cqblend.brep.topology import explore_subshapes
from cqblend.errors import InputError, SelectionError
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class EdgeSamples:
    """Points, normals and curvatures of one face along one of its edges.

    Attributes
    ----------
    points : ndarray, shape (n, 3)
        Images of the samples under the face's pcurve and surface, mm.
    normals : ndarray, shape (n, 3)
        Outward unit normals; nan where the surface is degenerate (the pole of a sphere).
    curvature : ndarray, shape (n, 3, 3)
        Symmetric tensors h: the normal curvature in the unit tangent direction w is ``w.h.w``, in 1/mm and positive
        where the face bends towards its outward normal (a sphere of radius R, seen from inside its material, has
        -1/R); nan as above.
    parameters : ndarray, shape (n, 2)
        Where the surface was evaluated.
    """

    points: Array
    normals: Array
    curvature: Array
    parameters: Array


def sample_edge_side(edge: TopoDS_Edge, face: TopoDS_Face, ts: ArrayLike) -> EdgeSamples:
    """Evaluate a face along one of its edges.

    Parameters
    ----------
    edge : TopoDS_Edge
        An edge of the face; if it is a seam, its orientation picks the side.
    face : TopoDS_Face
        The face, oriented as in its shape.
    ts : array_like, shape (n,)
        Parameters of the edge's 3D curve.

    Returns
    -------
    EdgeSamples

    Raises
    ------
    SelectionError
        The edge is not an edge of the face.
    GeometryError
        The edge has no pcurve on the face, or OCCT cannot evaluate the surface.

    Notes
    -----
    Where the edge runs along a knot line of the surface, derivatives are those of the face's own side of that line.
    """
    uses = find_sides_on_face(face, edge)
    if not uses:
        raise SelectionError("the edge is not an edge of the face")
    if len(uses) == 1:
        edge = uses[0][1]
    pcurve, low, high = read_pcurve(edge, face)
    surface = BRep_Tool.Surface_s(face)
    ts = _map_to_range(np.asarray(ts, dtype=float), BRep_Tool.Range_s(edge), (low, high))
    uv = evaluate_pcurve(pcurve, ts)
    is_left = edge.Orientation() == face.Orientation()  # a REVERSED edge of a REVERSED face runs forward on its surface
    face_side_uv = _shift_to_face_side(uv, ts, pcurve, surface, (high - low) * (1.0 if is_left else -1.0))
    jets = evaluate_surface_jets(surface, face_side_uv, order=2)
    moved = (face_side_uv != uv).any(axis=1)
    jets[moved, 0] = evaluate_surface_jets(surface, uv[moved], order=1)[:, 0]
    return EdgeSamples(jets[:, 0], *compute_normals_curvatures(jets, face.Orientation() == TopAbs_REVERSED), uv)


def choose_sample_parameters(sides: Sequence[EdgeSide], samples: int = 1000) -> Array:
    """Return parameters at which to compare the sides of an edge: equidistant, and clustered where a side may jump.

    That is at the ends, the knots of the 3D curve and of the pcurves, and at crossings with knot lines of the faces'
    surfaces.

    Raises
    ------
    InputError
        Fewer than 2 samples.
    """
    if not isinstance(samples, int | np.integer) or samples < 2:
        raise InputError(f"samples is {samples!r}: at least 2 are needed, one at each end")
    edge = sides[0][1]
    ends = BRep_Tool.Range_s(edge)
    unit = (0.0, 1.0)
    breaks = [np.array(unit), _map_to_range(find_curve_knots(BRepAdaptor_Curve(edge)), ends, unit)]
    for face, use in sides:
        pcurve, low, high = read_pcurve(use, face)
        knots = find_curve_knots(Geom2dAdaptor_Curve(pcurve, low, high))
        found = find_knot_crossings(partial(evaluate_pcurve, pcurve), low, high, BRep_Tool.Surface_s(face))
        breaks.append(_map_to_range(np.concatenate((knots, found)), (low, high), unit))
    return _map_to_range(spread_samples(np.unique(np.concatenate(breaks)), samples), unit, ends)


def sample_outline(face: TopoDS_Face, samples: int = 65) -> Array:
    """Return the boundary of a face in its parameter plane, as the ends (n, 2, 2) of short straight pieces."""
    pieces = []
    for use in explore_subshapes(face, TopAbs_EDGE):
        pcurve, low, high = read_pcurve(use, face)
        points = evaluate_pcurve(pcurve, np.linspace(low, high, samples))
        pieces.append(np.stack([points[:-1], points[1:]], axis=1))
    return np.concatenate(pieces)


def _shift_to_face_side(uv: Array, ts: Array, pcurve: Geom2d_Curve, surface: Geom_Surface, signed_span: float) -> Array:
    """Move points of a pcurve that runs along a knot line to the side of the line where the face lies.

    ``signed_span`` is the length of the edge's range, negative if the face lies to the right of its pcurve. Only lines
    where second derivatives may jump matter; a pcurve that merely crosses a line stays.
    """
    moved = uv.copy()
    for k, distances, size in measure_line_distances(surface, GeomAbs_C2, uv):
        offset = distances[np.arange(len(uv)), np.abs(distances).argmin(axis=1)]
        for i in np.nonzero(np.abs(offset) <= MEASURE_TOLERANCES.knot_line * size)[0].tolist():
            point, velocity = gp_Pnt2d(), gp_Vec2d()
            pcurve.D1(float(ts[i]), point, velocity)
            if abs(velocity.Coord()[k] * signed_span) <= MEASURE_TOLERANCES.knot_line * size:
                inward = (-velocity.Y(), velocity.X())[k] * signed_span
                line = uv[i, k] - offset[i]
                moved[i, k] = line + math.copysign(compute_side_step(size, line), inward)
    return moved


def compute_side_step(size: float, line: float) -> float:
    """Return a step off the knot line at parameter ``line`` that surely leaves it, in a domain of length ``size``."""
    return max(MEASURE_TOLERANCES.knot_line_step * size, 16.0 * float(np.spacing(abs(line))))


def _map_to_range(ts: Array, source: tuple[float, float], target: tuple[float, float]) -> Array:
    """Map parameters from one range onto another; identical ranges leave every bit as it was."""
    if source == target:
        return ts
    return target[0] + (ts - source[0]) * ((target[1] - target[0]) / (source[1] - source[0]))
