"""Solids with blended corners, and how smooth they are, measured by OCCT's D1."""

from __future__ import annotations

import cadquery as cq
import numpy as np
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import TopoDS

import cqblend

SAMPLES = np.linspace(0.0, 1.0, 41)

SMOOTH_KINDS = ("between", "spoke", "corner curve")


def check_corners(result, patches: int, angle: float = 1e-10) -> list[cq.Face]:
    """Check that a blend with corners is sound, and as smooth as rounding allows at every edge of its patches.

    Returns the faces of corners, which are as many as expected: the last ones of the result.
    """
    assert result.shape.isValid()
    assert cqblend.verify(result.shape, list(result.faces)).problems == ()
    assert result.certificate.angle <= max(angle, 1e-11)
    records = [one for one in result.certificate.edges if one.kind in SMOOTH_KINDS]
    assert records
    assert all(one.angle <= angle for one in records)
    found = list(result.faces[len(result.faces) - patches :])
    for edge in (edge for face in found for edge in face.Edges()):
        gap, turned = measure_edge(result.shape, edge)
        assert gap <= max(2e-11, 0.1 * angle)
        assert turned <= angle
    return found


def find_edges_at(body: cq.Shape, point) -> list[cq.Edge]:
    """Return the edges that end at a point."""
    at = cq.Vector(*point)
    return [edge for edge in body.Edges() if any((one.Center() - at).Length < 1e-6 for one in edge.Vertices())]


def make_pyramid(count: int, height: float = 6.0, radius: float = 8.0) -> cq.Shape:
    """Return a regular pyramid with its apex over the origin."""
    angles = 2 * np.pi * np.arange(count) / count
    base = [cq.Vector(radius * np.cos(a), radius * np.sin(a), 0) for a in angles]
    apex = cq.Vector(0, 0, height)
    rings = [base, *([base[i], base[(i + 1) % count], apex] for i in range(count))]
    faces = [cq.Face.makeFromWires(cq.Wire.makePolygon([*ring, ring[0]])) for ring in rings]
    return cq.Solid.makeSolid(cq.Shell.makeShell(faces))


def measure_edge(body: cq.Shape, edge: cq.Edge) -> tuple[float, float]:
    """Return the largest gap (mm) and angle (rad) between both faces at an edge, at the same parameters."""
    faces = [face for face in body.Faces() if any(edge.wrapped.IsSame(one.wrapped) for one in face.Edges())]
    assert len(faces) == 2
    (points, normals), (others, other_normals) = (_evaluate_along(face.wrapped, edge.wrapped) for face in faces)
    sine = np.linalg.norm(np.cross(normals, other_normals), axis=1)
    angles = np.arctan2(sine, (normals * other_normals).sum(axis=1))
    return float(np.linalg.norm(points - others, axis=1).max()), float(angles.max())


def _evaluate_along(face, edge) -> tuple[np.ndarray, np.ndarray]:
    """Return points and outward normals of a face along an edge of it."""
    curve = BRep_Tool.CurveOnSurface_s(TopoDS.Edge_s(edge), TopoDS.Face_s(face), 0.0, 0.0)
    low, high = BRep_Tool.Range_s(TopoDS.Edge_s(edge))
    surface, sign = BRep_Tool.Surface_s(TopoDS.Face_s(face)), -1 if face.Orientation() == TopAbs_REVERSED else 1
    points, normals = [], []
    for share in SAMPLES:
        uv, point, du, dv = curve.Value(low + share * (high - low)), gp_Pnt(), gp_Vec(), gp_Vec()
        surface.D1(uv.X(), uv.Y(), point, du, dv)
        normal = du.Crossed(dv)
        points.append(point.Coord())
        normals.append(np.array(normal.Coord()) * sign / normal.Magnitude())
    return np.array(points), np.array(normals)
