"""The certificate of a blend: its rails, creases and tolerances, measured on the finished faces.

The measurements are those of :mod:`cqblend.brep.measurement.edge_continuity`, which depends on OCCT's geometry only.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from OCP.BRep import BRep_Tool

from cqblend.blends.quality.fairness import bending_energy
from cqblend.blends.quality.smoothness_proof import Proof, prove_blend
from cqblend.blends.rails.ribbon import Ribbon, is_faded
from cqblend.blends.sections.blend_surface import BlendSurface, find_fold
from cqblend.blends.sections.revolved_section import RevolvedSection
from cqblend.brep.conversion import spline_arrays
from cqblend.brep.conversion.spline_conversion import to_face
from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.edge_continuity import measure_continuity_between, measure_surface_contact
from cqblend.brep.measurement.edge_parameters import spread_samples
from cqblend.brep.measurement.edge_samples import sample_outline
from cqblend.brep.measurement.inner_creases import find_inner_crease
from cqblend.brep.measurement.knot_lines import find_knot_crossings
from cqblend.brep.measurement.pole_contact import measure_pole_contact
from cqblend.brep.shell_editing.plan_application import BuiltStrip
from cqblend.brep.topology import find_end_vertices
from cqblend.brep.verification.arc_joints import prove_arc_strip
from cqblend.brep.verification.circular_joints import prove_revolved_strip
from cqblend.brep.verification.edge_certification import BlendPlace, certify_edge
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.certificate import Certificate, EdgeRecord, RailRecord
from cqblend.splines import Curve, Surface
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class _Measurements:
    """What was measured of a blend, along its rails and inside."""

    rails: Sequence[RailRecord]
    inner_crease: float  # rad
    method: str
    stations: int  # along each rail, at least
    validity: tuple[Callable[[], bool], ...] = ()
    edge_tolerance: float = 0.0  # the largest of a new edge (mm)
    prove: Callable[[], Proof] | None = None  # None for that of the blend's spline, with exact pcurves
    edges: tuple[EdgeRecord, ...] = ()
    outlined: BuiltStrip | None = None  # the blend, if the boundary of its face cuts off some of it


def certify_blend(place: BlendPlace, strip: BuiltStrip, blend: BlendSurface, edge_tolerance: float) -> Certificate:
    """Measure a blend in a verified solid: along all edges of its face, and inside that face.

    ``edge_tolerance`` is the largest of an edge that was made or cut (mm).
    """
    blend_surface = SurfaceEvaluator(BRep_Tool.Surface_s(strip.blend_face))
    records = [_certify_rail(place, strip, blend, i, blend_surface) for i in (0, 1)]
    measured = _Measurements(
        records,
        inner_crease=find_inner_crease(strip.blend_face, surface=blend_surface).angle,
        prove=_choose_proof(place, strip, blend),
        method="wire substitution" + (", flat ends" if strip.cap_count else ""),
        stations=VERIFICATION_TOLERANCES.certificate_samples,
        edge_tolerance=edge_tolerance,
        edges=tuple(certify_edge(edge, place, blend_surface) for edge in strip.other_edges),
        outlined=None if place.is_closed else strip,
    )
    return _build_certificate(blend, measured)


def _certify_rail(
    place: BlendPlace, strip: BuiltStrip, blend: BlendSurface, i: int, blend_surface: SurfaceEvaluator
) -> RailRecord:
    """Measure a blend along one of its rails, or at the one point that the rail is."""
    ribbon = blend.ribbons[i]
    samples, pole, support = VERIFICATION_TOLERANCES.certificate_samples, strip.poles[i], strip.trimmed_faces[i]
    if pole is not None:
        found = [measure_pole_contact(strip.blend_face, pole, place.sides[i].face, samples)]
        tolerance = BRep_Tool.Tolerance_s(find_end_vertices(pole)[0])
    else:
        is_held = partial(_is_not_faded, ribbon) if ribbon.fades else None
        surfaces = (blend_surface, SurfaceEvaluator(BRep_Tool.Surface_s(support)))
        measured = [
            measure_continuity_between(((strip.blend_face, edge), (support, edge)), samples, is_held, surfaces)
            for edge in strip.rail_edges[i]
        ]
        found = [(one.gap, one.angle, one.curvature_jump) for one in measured]
        tolerance = max(one.tolerance for one in measured)
    gap, angle, curvature_jump = np.max(found, axis=0).tolist()
    return RailRecord(
        side=i + 1,
        face=place.face_numbers[i],
        edge=place.edge_number,
        gap=gap,
        angle=angle,
        curvature_jump=curvature_jump,
        direction=ribbon.direction,
        length=ribbon.length,
        tolerance=tolerance,
        kept=_measure_faded_share(ribbon),
        bend=ribbon.bend,
        held=strip.is_held[i],
        section=blend.kind,
    )


def _choose_proof(place: BlendPlace, strip: BuiltStrip, blend: BlendSurface) -> Callable[[], Proof]:
    """Return what proves the surface that is in the solid."""
    first, second = blend.ribbons
    if blend.arc is not None:
        return partial(prove_arc_strip, strip, blend, blend.arc)
    if isinstance(strip.geometry, RevolvedSection):
        return partial(prove_revolved_strip, strip, (first.order, second.order))
    # Twice the tolerance, for what lies between the parameters at which the fit of a pcurve was checked.
    one, other = (2 * side.pcurve_tolerance for side in place.sides)
    return partial(prove_blend, blend, (one, other))


def certify_surfaces(blend: BlendSurface, rails: Sequence[tuple[Surface, Curve]]) -> Certificate:
    """Measure a blend of surfaces along its rails, each a surface and a curve in its parameter plane."""
    face = to_face(blend.surface)
    records = []
    for i, ((surface, curve), ribbon) in enumerate(zip(rails, blend.ribbons, strict=True)):
        other = spline_arrays.surface_from_arrays(*surface.to_bspline())
        crossings = find_knot_crossings(partial(_evaluate_transposed, curve), *curve.domain, SurfaceEvaluator(other))
        breaks = [blend.surface.breaks[0], curve.breaks, crossings]
        t = spread_samples(np.unique(np.concatenate(breaks)), VERIFICATION_TOLERANCES.surface_certificate_samples)
        t = t[_is_not_faded(ribbon, t)]
        gap, angle, jump = measure_surface_contact(
            (BRep_Tool.Surface_s(face), other), partial(_evaluate_rail_parameters, curve, i), t
        )
        records.append(
            RailRecord(
                side=i + 1,
                face=0,
                edge=0,
                gap=gap,
                angle=angle,
                curvature_jump=jump,
                direction=ribbon.direction,
                length=ribbon.length,
                tolerance=0.0,
                kept=_measure_faded_share(ribbon),
                section=blend.kind,
            )
        )
    measured = _Measurements(
        records,
        inner_crease=find_inner_crease(face).angle,
        method="surfaces",
        stations=VERIFICATION_TOLERANCES.surface_certificate_samples,
        validity=(lambda: find_fold(blend.surface, blend.ribbons) is None,),
    )
    return _build_certificate(blend, measured)


def _evaluate_rail_parameters(curve: Curve, boundary: int, t: Array) -> tuple[Array, Array]:
    """Return the parameters (2, n) of a rail on the blend, at v = ``boundary`` (0 or 1), and on its surface."""
    return np.stack([t, np.full_like(t, boundary)]), _evaluate_transposed(curve, t)


def _evaluate_transposed(curve: Curve, t: Array) -> Array:
    """Return the points of a curve with their coordinates along the first axis."""
    return np.asarray(curve(t).T)


def _is_not_faded(ribbon: Ribbon, t: Array) -> Array:
    """Tell where a ribbon holds its continuity."""
    return ~is_faded(ribbon, t)


def _measure_faded_share(ribbon: Ribbon) -> float:
    """Return on what share of its rail a ribbon has faded."""
    return (
        float(
            is_faded(ribbon, np.linspace(*ribbon.c.domain, VERIFICATION_TOLERANCES.surface_certificate_samples)).mean()
        )
        if ribbon.fades
        else 0.0
    )


def _measure_bending_energy(blend: BlendSurface, strip: BuiltStrip | None) -> float:
    """Return the bending energy of a blend within the boundary of its face, or over its whole domain."""
    if strip is None:
        return bending_energy(blend.surface)
    outline, arc = sample_outline(strip.blend_face), blend.arc
    if arc is not None:
        s, v = arc.map_from_surface(outline.reshape(-1, 2))
        outline = arc.map_to_spline(s, v).reshape(outline.shape)
    elif isinstance(strip.geometry, RevolvedSection):
        outline[..., 0] = strip.geometry.map_to_parameters(outline[..., 0].ravel()).reshape(outline.shape[:2])
    return bending_energy(blend.surface, outline)


def _build_certificate(blend: BlendSurface, measured: _Measurements) -> Certificate:
    """Return the certificate of a measured blend; its proof and its bending energy are computed when asked for."""
    surface = blend.surface
    t = np.linspace(*surface.domain[0], 65)
    ends = surface(np.concatenate((t, t)), np.repeat((0.0, 1.0), len(t)))
    widths = np.linalg.norm(ends[: len(t)] - ends[len(t) :], axis=1)
    _, _, poles, weights = surface.to_bspline()
    return Certificate(
        rails=tuple(measured.rails),
        form=blend.form,
        degree=surface.degree,
        poles=poles.shape[:2],
        rational=weights is not None,
        inner_crease=measured.inner_crease,
        method=measured.method,
        validity=measured.validity,
        width=(float(widths.min()), float(widths.max())),
        stations=measured.stations,
        edge_tolerance=measured.edge_tolerance,
        edges=measured.edges,
        residual=blend.residual,
        proofs=(measured.prove or partial(prove_blend, blend),),
        energies=(partial(_measure_bending_energy, blend, measured.outlined),),
    )
