"""How smoothly two faces meet along an edge, as OCCT itself evaluates them.

What cqblend promises is proven elsewhere, on the coefficients of splines. This module checks it independently: it reads
finished ``TopoDS`` shapes, of whatever origin, and evaluates OCCT's geometry in bulk with OCCT as the witness: at some
points of each side, and where the largest values were found. It evaluates none of cqblend's splines, rails or blends,
so that a certificate and what it certifies share no arithmetic.

Conventions: lengths in mm, angles in radians, curvatures in 1/mm. Normals point out of the material (``Su x Sv`` on a
FORWARD face, its opposite on a REVERSED one). Locations of shapes are respected.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_Surface
from OCP.gp import gp_Vec
from OCP.TopAbs import TopAbs_FORWARD
from OCP.TopoDS import TopoDS_Edge, TopoDS_Shape

from cqblend.brep.measurement.bulk_surfaces import SurfaceEvaluator
from cqblend.brep.measurement.edge_parameters import SPAN_SHARES, resample_near_maxima
from cqblend.brep.measurement.edge_samples import EdgeSamples, SideSampler, choose_sample_parameters, read_edge_curve
from cqblend.brep.measurement.edge_sides import EdgeSide, find_edge_sides
from cqblend.brep.measurement.surface_evaluation import (
    compute_normals,
    express_curvature,
    measure_angle_between,
    measure_lengths,
)
from cqblend.brep.measurement.tolerances import MEASURE_TOLERANCES
from cqblend.errors import GeometryError
from cqblend.splines.bernstein import Array

EdgeKind = Literal["convex", "concave", "smooth"]


@dataclass(frozen=True)
class Continuity:
    """How two faces meet along an edge: the largest values over all samples.

    Attributes
    ----------
    gap : float
        Largest distance at equal parameters between the two faces' images of the edge, and between each and the
        edge's own 3D curve, mm.
    angle : float
        Largest angle between the outward normals, ``atan2(|n1 x n2|, n1.n2)``, radians: 0 on a smooth joint, pi on a
        knife's edge.
    curvature_jump : float
        Largest difference of the two normal curvatures over all directions of the tangent plane, 1/mm. Across a sharp
        edge, the second tangent plane is first turned about the edge onto the first.
    tolerance : float
        The edge's tolerance, mm.
    kind : {'convex', 'concave', 'smooth'}
        Judged where the angle is largest; smooth up to :data:`MEASURE_TOLERANCES.smooth_edge_angle`.
    samples : int
        How many samples had a normal on both sides.
    """

    gap: float
    angle: float
    curvature_jump: float
    tolerance: float
    kind: EdgeKind
    samples: int

    def __str__(self) -> str:
        return (
            f"{self.kind}: gap {self.gap:.2g} mm, angle {self.angle:.2g} rad, "
            f"curvature jump {self.curvature_jump:.2g} 1/mm, "
            f"edge tolerance {self.tolerance:.2g} mm ({self.samples} samples)"
        )


def measure_continuity(shape: TopoDS_Shape, edge: TopoDS_Edge, samples: int = 1000) -> Continuity:
    """Measure how the two faces at an edge meet.

    Parameters
    ----------
    shape : TopoDS_Shape
        Any shape that contains the edge and its faces.
    edge : TopoDS_Edge
        An edge with a face on both sides; a seam, with the same face on both sides, is one too.
    samples : int
        Number of equidistant samples, both ends included; more are added beside the knots of the edge's curves and
        where it crosses knot lines of the surfaces.

    Returns
    -------
    Continuity

    Raises
    ------
    InputError
        An argument is of the wrong type, or there are fewer than 2 samples.
    SelectionError
        The edge is not in the shape, is degenerate, or does not have exactly two sides.
    GeometryError
        OCCT cannot evaluate a face along the edge, or no sample has a normal on both sides.

    Notes
    -----
    Ends are sampled 1e-8 of the range inside, knots on both sides and never on them: on a knot OCCT reads each
    surface on the side of larger parameters, which need not be the same side of the edge's point. Samples at which a
    normal does not exist (the pole at the end of a sphere's seam) count for the gap only.
    """
    return measure_continuity_between(find_edge_sides(shape, edge), samples)


def measure_continuity_between(
    sides: tuple[EdgeSide, EdgeSide],
    samples: int = 1000,
    where: Callable[[Array], Array] | None = None,
    surfaces: tuple[SurfaceEvaluator | None, SurfaceEvaluator | None] = (None, None),
) -> Continuity:
    """Measure how two known sides of an edge meet: :func:`measure_continuity` without the search for them.

    ``where`` is a predicate of parameters (n,) of the edge: angle and curvature count only where it holds. ``surfaces``
    are the evaluators of the faces' surfaces, of those that have one already.
    """
    edge = sides[0][1]
    curve = read_edge_curve(edge)
    first, second = (SideSampler(side, surface) for side, surface in zip(sides, surfaces, strict=True))

    def compare_sides(ts: Array) -> tuple[Array, Array, Array]:
        points, tangents = curve(ts, 1)
        one, two = first.sample(ts), second.sample(ts)
        gaps = [measure_lengths(side.points - points) for side in (one, two)]
        gaps.append(measure_lengths(one.points - two.points))
        angles, jumps = _compare_tangent_planes(one, two, tangents)
        if where is not None:
            counts = where(ts)
            angles, jumps = np.where(counts, angles, np.nan), np.where(counts, jumps, np.nan)
        return np.maximum(np.maximum(gaps[0], gaps[1]), gaps[2]), angles, jumps

    ts = choose_sample_parameters((first, second), curve, samples)
    values = compare_sides(ts)
    measured = int(np.isfinite(values[1]).sum())
    if not measured:
        raise GeometryError("the edge has no normal on both sides anywhere: a surface is degenerate all along it")
    ts, rows = resample_near_maxima(compare_sides, ts, values, MEASURE_TOLERANCES.negligible_continuity)
    worst = ts[np.nanargmax(rows, axis=1)]
    # so few points are evaluated by OCCT itself
    gap, angle, jump = np.fmax(np.fmax.reduce(rows, axis=1), np.fmax.reduce(compare_sides(worst), axis=1)).tolist()
    return Continuity(
        gap=gap,
        angle=angle,
        curvature_jump=jump,
        tolerance=BRep_Tool.Tolerance_s(edge),
        kind="smooth"
        if angle <= MEASURE_TOLERANCES.smooth_edge_angle
        else _classify_sharp_edge(first, second, worst[1]),
        samples=measured,
    )


def measure_surface_contact(
    surfaces: tuple[Geom_Surface, Geom_Surface], locate: Callable[[Array], tuple[Array, Array]], ts: Array
) -> tuple[float, float, float]:
    """Measure how two surfaces meet along a common curve, at its parameters ts (n,).

    ``locate`` returns parameters (2, n) on each surface; on the first one, u runs along the curve. Returns gap, angle
    and curvature jump as in :class:`Continuity`; on a surface, normals have no outside, and are taken to point the same
    way on both. On short spans the rounding of products of poles and weights may hide that of poles, so that the
    largest angles are measured once more on copies of the surfaces that are moved to the origin, where coordinates have
    more digits.
    """
    sign = 0.0

    def compare_surfaces(
        pair: Sequence[SurfaceEvaluator], ts: Array, *, by_occt: bool = False
    ) -> tuple[Array, Array, Array]:
        nonlocal sign
        uv = locate(ts)
        jets = [(surface.evaluate_by_occt if by_occt else surface)(at, 2) for surface, at in zip(pair, uv, strict=True)]
        one = EdgeSamples(jets[0], uv[0], 1.0)
        sign = sign or (-1.0 if np.nansum(one.normals * EdgeSamples(jets[1], uv[1], 1.0).normals) < 0 else 1.0)
        two = EdgeSamples(jets[1], uv[1], sign)
        return measure_lengths(one.points - two.points), *_compare_tangent_planes(one, two, jets[0][1])

    evaluators = [SurfaceEvaluator(surface) for surface in surfaces]
    values = compare_surfaces(evaluators, ts)
    negligible = MEASURE_TOLERANCES.negligible_continuity
    ts, rows = resample_near_maxima(partial(compare_surfaces, evaluators), ts, values, negligible)
    found = [rows]
    for i in np.argsort(np.nan_to_num(rows[1], nan=-1.0))[-MEASURE_TOLERANCES.worst_count :].tolist():
        x, y, z = evaluators[0].evaluate_by_occt(locate(ts[[i]])[0], 0)[0, :, 0].tolist()
        moved = [SurfaceEvaluator(_translate_surface(surface, gp_Vec(-x, -y, -z))) for surface in surfaces]
        around = np.concatenate([ts[max(i - len(SPAN_SHARES), 0) : i + len(SPAN_SHARES) + 1], ts[::20]])
        found.append(np.stack(compare_surfaces(moved, around, by_occt=True)))
    gap, angle, jump = np.max([np.fmax.reduce(part, axis=1) for part in found], axis=0).tolist()
    return gap, angle, jump


def _translate_surface(surface: Geom_Surface, by: gp_Vec) -> Geom_Surface:
    """Return a moved copy of a surface."""
    copy = surface.Copy()
    copy.Translate(by)
    return copy


def _compare_tangent_planes(one: EdgeSamples, two: EdgeSamples, tangents: Array) -> tuple[Array, Array]:
    """Return the angles between normals and the largest differences of normal curvatures, (n,) each.

    Curvatures are compared in the frames (along the edge, across it) of both tangent planes: the largest |w.h.w| over
    all unit w, for the symmetric 2 x 2 matrix h of the differences, by Mohr's circle.
    """
    jets = np.stack((one.jets, two.jets), axis=2)  # both sides are worked through at once
    normals, areas = compute_normals(jets, np.array([[one.sign], [two.sign]]))
    forms = express_curvature(jets, normals, areas, tangents[:, None])
    along, mixed, across = (form[0] - form[1] for form in forms)
    jumps = np.abs(along + across) / 2 + np.hypot((along - across) / 2, mixed)
    return measure_angle_between(normals[:, 0], normals[:, 1]), np.asarray(jumps)


def _classify_sharp_edge(first: SideSampler, second: SideSampler, t: float) -> EdgeKind:
    """Tell which way an edge bends at t: on a convex one the second normal points away from the first face."""
    at = np.array([t])
    normal, other = first.sample(at).normals[:, 0], second.sample(at).normals[:, 0]
    tangent = read_edge_curve(first.edge)(at, 1)[1, :, 0]
    into_first = np.cross(normal, tangent) * (1.0 if first.edge.Orientation() == TopAbs_FORWARD else -1.0)
    return "concave" if into_first @ other > 0.0 else "convex"
