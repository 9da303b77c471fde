"""How smoothly two faces meet along an edge, as OCCT itself evaluates them.

What cqblend promises is proven elsewhere, on the coefficients of splines. This module checks it independently: it reads
finished ``TopoDS`` shapes, of whatever origin, point by point through OCCT's own ``Geom_Surface.D2``. It evaluates none
of cqblend's splines, rails or blends, so that a certificate and what it certifies share no arithmetic.

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

from cqblend.brep.measurement.edge_parameters import SPAN_SHARES, resample_near_maxima
from cqblend.brep.measurement.edge_samples import EdgeSamples, choose_sample_parameters, sample_edge_side
from cqblend.brep.measurement.edge_sides import EdgeSide, find_edge_sides
from cqblend.brep.measurement.surface_evaluation import (
    compute_normals_curvatures,
    evaluate_edge,
    evaluate_surface_jets,
    measure_angle_between,
    normalise_rows,
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
    sides: tuple[EdgeSide, EdgeSide], samples: int = 1000, where: Callable[[Array], Array] | None = None
) -> Continuity:
    """Measure how two known sides of an edge meet: :func:`measure_continuity` without the search for them.

    ``where`` is a predicate of parameters (n,) of the edge: angle and curvature count only where it holds.
    """
    edge = sides[0][1]

    def compare_sides(ts: Array) -> tuple[Array, Array, Array]:
        points, tangents = evaluate_edge(edge, ts)
        one, two = (sample_edge_side(use, face, ts) for face, use in sides)
        pairs = ((one.points, two.points), (one.points, points), (two.points, points))
        gaps = np.max([np.linalg.norm(a - b, axis=1) for a, b in pairs], axis=0)
        angles = measure_angle_between(one.normals, two.normals)
        jumps = _spectral_norm(_express_in_edge_frame(one, tangents) - _express_in_edge_frame(two, tangents))
        if where is not None:
            counts = where(ts)
            angles, jumps = np.where(counts, angles, np.nan), np.where(counts, jumps, np.nan)
        return gaps, angles, jumps

    ts = choose_sample_parameters(sides, samples)
    first = compare_sides(ts)
    measured = int(np.isfinite(first[1]).sum())
    if not measured:
        raise GeometryError("the edge has no normal on both sides anywhere: a surface is degenerate all along it")
    ts, (gaps, angles, jumps) = resample_near_maxima(compare_sides, ts, first)
    worst = int(np.nanargmax(angles))
    at = ts[[worst]]
    one, two = (sample_edge_side(use, face, at) for face, use in sides)
    return Continuity(
        gap=float(gaps.max()),
        angle=float(angles[worst]),
        curvature_jump=float(np.nanmax(jumps)),
        tolerance=BRep_Tool.Tolerance_s(edge),
        kind=_classify_edge(edge, evaluate_edge(edge, at)[1][0], one.normals[0], two.normals[0], float(angles[worst])),
        samples=measured,
    )


def measure_surface_contact(
    surfaces: tuple[Geom_Surface, Geom_Surface], locate: Callable[[Array], tuple[Array, Array]], ts: Array
) -> tuple[float, float, float]:
    """Measure how two surfaces meet along a common curve, at its parameters ts (n,).

    ``locate`` returns parameters (n, 2) on each surface; on the first one, u runs along the curve. Returns gap, angle
    and curvature jump as in :class:`Continuity`; on a surface, normals have no outside, and are taken to point the same
    way on both. On short spans the rounding of products of poles and weights may hide that of poles, so that the
    largest angles are measured once more on copies of the surfaces that are moved to the origin, where coordinates have
    more digits.
    """
    sign = 0.0

    def compare_surfaces(pair: Sequence[Geom_Surface], ts: Array) -> tuple[Array, Array, Array]:
        nonlocal sign
        uv = locate(ts)
        first, second = (evaluate_surface_jets(surface, at, order=2) for surface, at in zip(pair, uv, strict=True))
        (n, n_curvature), (m, m_curvature) = (
            compute_normals_curvatures(jets, reverse=False) for jets in (first, second)
        )
        sign = sign or (-1.0 if np.nansum(n * m) < 0 else 1.0)
        one, two = (
            EdgeSamples(first[:, 0], n, n_curvature, uv[0]),
            EdgeSamples(second[:, 0], sign * m, sign * m_curvature, uv[1]),
        )
        tangents = first[:, 1]
        return (
            np.linalg.norm(one.points - two.points, axis=1),
            measure_angle_between(one.normals, two.normals),
            _spectral_norm(_express_in_edge_frame(one, tangents) - _express_in_edge_frame(two, tangents)),
        )

    ts, values = resample_near_maxima(partial(compare_surfaces, surfaces), ts, compare_surfaces(surfaces, ts))
    found = [values]
    for i in np.argsort(np.nan_to_num(values[1], nan=-1.0))[-MEASURE_TOLERANCES.worst_count :].tolist():
        x, y, z = evaluate_surface_jets(surfaces[0], locate(ts[[i]])[0], order=1)[0, 0].tolist()
        moved = [_translate_surface(surface, gp_Vec(-x, -y, -z)) for surface in surfaces]
        around = np.concatenate([ts[max(i - len(SPAN_SHARES), 0) : i + len(SPAN_SHARES) + 1], ts[::20]])
        found.append(list(compare_surfaces(moved, around)))
    gap, angle, jump = (max(float(np.nanmax(part[k])) for part in found) for k in range(3))
    return gap, angle, jump


def _translate_surface(surface: Geom_Surface, by: gp_Vec) -> Geom_Surface:
    """Return a moved copy of a surface."""
    copy = surface.Copy()
    copy.Translate(by)
    return copy


def _express_in_edge_frame(side: EdgeSamples, tangents: Array) -> Array:
    """Return curvature tensors (n, 2, 2) in the orthonormal frame (along the edge, across it) of each tangent plane."""
    across = normalise_rows(np.cross(side.normals, tangents))
    frame = np.stack((np.cross(across, side.normals), across), axis=1)
    return np.asarray(frame @ side.curvature @ frame.transpose(0, 2, 1))


def _spectral_norm(forms: Array) -> Array:
    """Return the largest |w.h.w| over all unit w, for symmetric 2 x 2 matrices h: Mohr's circle."""
    mean = (forms[:, 0, 0] + forms[:, 1, 1]) / 2
    return np.asarray(np.abs(mean) + np.hypot((forms[:, 0, 0] - forms[:, 1, 1]) / 2, forms[:, 0, 1]))


def _classify_edge(edge: TopoDS_Edge, tangent: Array, first: Array, second: Array, angle: float) -> EdgeKind:
    """Tell which way an edge bends: on a convex one the second normal points away from the first face."""
    if angle <= MEASURE_TOLERANCES.smooth_edge_angle:
        return "smooth"
    into_first = np.cross(first, tangent) * (1.0 if edge.Orientation() == TopAbs_FORWARD else -1.0)
    return "concave" if into_first @ second > 0.0 else "convex"
