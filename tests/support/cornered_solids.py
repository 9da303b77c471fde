"""Solids with blended corners whose way to be put together is given, and how smooth they are, measured by OCCT's D1."""

from __future__ import annotations

from dataclasses import dataclass

import cadquery as cq
import numpy as np
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Pnt, gp_Vec
from OCP.TopAbs import TopAbs_REVERSED
from OCP.TopoDS import TopoDS

import cqblend
from cqblend.blend_options import BlendOptions
from cqblend.brep.selection.blend_corners import find_blended_corners
from cqblend.brep.selection.picked_edges import select_chains
from cqblend.solid_blends.blend_contexts import BlendContexts
from cqblend.solid_blends.solid_rewriting import (
    DraftedNetwork,
    FaultyNetworkError,
    certify_corner_patch,
    certify_strip,
    rewrite_solid,
)

SAMPLES = np.linspace(0.0, 1.0, 41)


@dataclass
class CorneredSolid:
    """A rewritten solid, its blend faces along edges and at corners, and their records."""

    shape: cq.Shape
    strips: list[cq.Face]
    patches: list[cq.Face]
    certificates: list
    patch_records: list

    def check(self) -> CorneredSolid:
        """Check that it is sound, and that every edge of a patch is as smooth as rounding allows."""
        assert self.shape.isValid()
        new = [*self.strips, *self.patches]
        assert cqblend.verify(self.shape.wrapped, [face.wrapped for face in new]).problems == ()
        assert max(one.angle for one in self.certificates) <= 1e-11
        for face in self.patches:
            for edge in face.Edges():
                gap, angle = measure_edge(self.shape, edge)
                assert gap <= 2e-11
                assert angle <= 1e-10
        assert all(edge.angle <= 1e-10 for edge in self.patch_records)
        return self


def blend_corners(body: cq.Shape, edges, method: str, setbacks=None, **options) -> CorneredSolid:
    """Blend edges of a solid, all corners of which are put together by one method where all edges are blended.

    ``setbacks`` are those asked for, by the index of the edge.
    """
    request = BlendOptions(**options).to_request()
    contexts = BlendContexts(request)
    picked = [edge.wrapped for edge in edges]
    selection = select_chains(body.wrapped, picked, request.first, contexts.estimate_reach, follow=request.chain)
    (found,) = selection.networks
    chains = [contexts.get_chain(one.chain, one.edges) for one in found]
    corners = find_blended_corners([chain.chain for chain in chains], method, setbacks)
    try:
        network = DraftedNetwork([number for one in found for number in one.edges], chains, corners)
        done = rewrite_solid(network.index, [network])
    except FaultyNetworkError as fault:
        raise fault.cause from fault
    return CorneredSolid(
        cq.Shape.cast(done.proposal.solid),
        [cq.Face(one.strip.blend_face) for one in done.strips],
        [cq.Face(one.patch.face) for one in done.patches],
        [certify_strip(one, done.proposal.tolerance, ()) for one in done.strips],
        [edge for one in done.patches for edge in certify_corner_patch(one).edges],
    )


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
