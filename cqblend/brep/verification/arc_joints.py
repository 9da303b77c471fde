"""The proof of a blend by arcs, from the finished faces: its cylinder, torus or sphere, and the rails on both sides."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.Geom2d import Geom2d_Circle, Geom2d_Line
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

from cqblend.blends.quality.arc_proof import prove_arc_side
from cqblend.blends.quality.smoothness_proof import Proof
from cqblend.blends.sections.arc_section import ArcSection, BallSurface
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.blends.sections.turned_arcs import TurnedArcs
from cqblend.brep.conversion.support_face import read_support_face
from cqblend.brep.conversion.tolerances import CONVERSION_TOLERANCES
from cqblend.brep.shell_editing.plan_application import BuiltStrip
from cqblend.brep.verification.pole_proof import prove_pole
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.splines.bernstein import Array
from cqblend.surfaces.quadrics import Cylinder, Sphere
from cqblend.surfaces.revolved_surfaces import RevolvedEllipse
from cqblend.surfaces.vectors import cross_product, measure_lengths


def prove_arc_strip(strip: BuiltStrip, blend: BlendSurface, arc: ArcSection | TurnedArcs) -> Proof:
    """Prove how a blend face on the surface of a ball's arcs meets both of its support faces, along all its rails.

    ``arc`` is that surface as it was planned.
    """
    surface = read_support_face(
        strip.blend_face, arc.surface.jet(arc.map_to_surface(np.zeros(1), np.full(1, 0.5)))[0]
    ).face_primary
    if not isinstance(surface, Cylinder | Sphere | RevolvedEllipse):
        raise TypeError(f"a blend by arcs is no {type(surface).__name__}")
    built = _put_on_surface(arc, surface)

    def prove_rail(end: Literal[0, 1]) -> Proof:
        pole = prove_pole(strip, end, arc.radius)
        if pole is not None:
            return pole
        face, edges = strip.trimmed_faces[end], strip.rail_edges[end]
        shifts, turns = zip(
            *(_measure_rail(blend, built, end, (strip.blend_face, face), edge) for edge in edges), strict=True
        )
        return prove_arc_side(blend, built, end, 2 * max(shifts), 2 * max(turns))

    return prove_rail(0) | prove_rail(1)


def _put_on_surface(arc: ArcSection | TurnedArcs, surface: BallSurface) -> ArcSection | TurnedArcs:
    """Return the same arcs on a surface that differs from theirs by rounding."""
    if isinstance(arc, ArcSection):
        return replace(arc, surface=surface)
    if not isinstance(surface, Sphere):
        raise TypeError(f"arcs of a ball that turns in place are on no {type(surface).__name__}")
    return replace(arc, surface=surface)


def _measure_rail(
    blend: BlendSurface,
    arc: ArcSection | TurnedArcs,
    end: Literal[0, 1],
    faces: tuple[TopoDS_Face, TopoDS_Face],
    edge: TopoDS_Edge,
) -> tuple[float, float]:
    """Return by how much the pcurve of a rail edge on its support face is off (mm), and the normals there (rad).

    ``faces`` are the blend face and that face. The edge need not run by the parameter of the blend: two blends that
    meet along a rail share it.
    """
    first, last = BRep_Tool.Range_s(edge)
    t = np.linspace(first, last, VERIFICATION_TOLERANCES.proof_samples)
    curves = [BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 1.0) for face in faces]
    own, uv = (np.array([curve.Value(at).Coord() for at in t.tolist()]) for curve in curves)
    s, ribbon, curve = arc.map_from_surface(own)[0], blend.ribbons[end], curves[1]
    found = ribbon.primary.jet(ribbon.find_native_parameters(arc.map_to_parameters(s)))
    there = read_support_face(faces[1], found[0]).face_primary.jet(uv)
    normals = [_evaluate_normals(jet) for jet in (found, there)]
    sines = measure_lengths(cross_product(*normals))
    shift, turn = float(measure_lengths(found[0] - there[0]).max()), float(np.arcsin(np.minimum(sines, 1.0)).max())
    if isinstance(curve, Geom2d_Line | Geom2d_Circle):
        return shift, turn
    fitted = CONVERSION_TOLERANCES.pcurve  # in angles or parameters, between the samples
    return shift + fitted * float(measure_lengths(there[1:3]).max()), turn + fitted


def _evaluate_normals(jet: Array) -> Array:
    """Return the unit normals (n, 3) of a native jet."""
    normals = cross_product(jet[1], jet[2])
    return np.asarray(normals / measure_lengths(normals)[:, None])
