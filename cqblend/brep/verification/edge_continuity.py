"""How smoothly two faces meet along an edge, and where a face has a crease of its own, as OCCT itself evaluates them.

What cqblend promises is proven elsewhere on the coefficients of splines. This module is the witness who was not
there: it reads finished ``TopoDS`` shapes, of whatever origin, point by point through OCCT's own ``Geom_Surface.D2``
and knows nothing of cqblend's splines, rails or blends. It must stay that way: a certificate and the thing it
certifies share no arithmetic.

Conventions: lengths in mm, angles in radians, curvatures in 1/mm. Normals point out of the material (``Su x Sv`` on a
FORWARD face, its opposite on a REVERSED one). Locations of shapes are respected.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve
from OCP.BRepTools import BRepTools
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.Geom import Geom_Surface
from OCP.Geom2d import Geom2d_Curve
from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
from OCP.GeomAbs import (
    GeomAbs_C1,
    GeomAbs_C2,
    GeomAbs_C3,
)
from OCP.GeomAdaptor import GeomAdaptor_Surface
from OCP.gp import gp_Pnt, gp_Pnt2d, gp_Vec, gp_Vec2d
from OCP.Standard import Standard_Failure
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_FORWARD, TopAbs_OUT, TopAbs_REVERSED, TopAbs_ShapeEnum
from OCP.TopExp import TopExp_Explorer
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.topology import AncestorMap
from cqblend.brep.verification.measuring_places import (
    CLUSTER_OFFSETS,
    KNOT_LINE_TOLERANCE,
    SPAN_SHARES,
    WORST_COUNT,
    find_curve_knots,
    find_knot_crossings,
    find_knot_lines,
    measure_line_distances,
    resample_near_maxima,
    spread_samples,
)
from cqblend.errors import GeometryError, InputError, SelectionError

Array = NDArray[np.float64]
EdgeKind = Literal["convex", "concave", "smooth"]

SMOOTH_ANGLE = 1e-3
"""Largest normal angle (radians) of an edge that is called smooth: 0.06 degrees. Native fillets stay below 1e-4."""

_KNOT_STEP = 1e-14
"""Step off a knot line to read one side of it, relative to the domain. OCCT tells sides apart down to 1e-15."""

_DEGENERATE_RATIO = 1e-7
"""|Su x Sv| below this share of its largest value along the edge has a direction made of rounding: nan."""


@dataclass(frozen=True)
class EdgeSamples:
    """What one face looks like along one of its edges.

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
        Judged where the angle is largest; smooth up to :data:`SMOOTH_ANGLE`.
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


@dataclass(frozen=True)
class Crease:
    """The sharpest crease inside a face: largest angle (radians) between the one-sided normals of its surface.

    ``parameters`` (u, v) and ``point`` (x, y, z) tell where; both are None if the surface has no knot line that could
    crease.
    """

    angle: float
    parameters: tuple[float, float] | None
    point: tuple[float, float, float] | None

    def __str__(self) -> str:
        if self.parameters is None or self.point is None:
            return "no crease"
        (u, v), (x, y, z) = self.parameters, self.point
        return f"crease of {self.angle:.2g} rad at (u, v) = ({u:.6g}, {v:.6g}), ({x:.6g}, {y:.6g}, {z:.6g})"


EdgeSide = tuple[TopoDS_Face, TopoDS_Edge]
"""A face, and the edge with the orientation it has in that face (which picks the pcurve of a seam)."""


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


def find_edge_sides(shape: TopoDS_Shape, edge: TopoDS_Edge) -> tuple[EdgeSide, EdgeSide]:
    """Return the two sides of an edge in a shape, in the order of the shape's faces.

    Raises
    ------
    InputError
        An argument is of the wrong type.
    SelectionError
        The edge is not in the shape, is degenerate, or does not have exactly two sides.
    """
    require_shape(shape, "shape")
    edge = TopoDS.Edge_s(require_shape(edge, "edge", TopAbs_EDGE))
    faces_of = AncestorMap(shape, TopAbs_EDGE, TopAbs_FACE)
    if edge not in faces_of:
        raise SelectionError("the edge is not an edge of the shape: pick it from the shape itself, not from a copy")
    if BRep_Tool.Degenerated_s(edge):
        raise SelectionError("the edge is degenerate (the pole of a surface): it has no length and no continuity")
    sides = [side for face in faces_of(edge) for side in find_sides_on_face(face, edge)]
    if len(sides) != 2:
        what = "a free boundary" if len(sides) == 1 else f"used {len(sides)} times"
        raise SelectionError(f"the edge is {what}: continuity is measured between exactly two sides")
    return sides[0], sides[1]


def measure_continuity_between(
    sides: tuple[EdgeSide, EdgeSide], samples: int = 1000, where: Callable[[Array], Array] | None = None
) -> Continuity:
    """Measure how two known sides of an edge meet: :func:`measure_continuity` without the search for them.

    ``where`` tells at which parameters (n,) of the edge angle and curvature count; everywhere if it is not given.
    """
    edge = sides[0][1]

    def compare_sides(ts: Array) -> tuple[Array, Array, Array]:
        points, tangents = _evaluate_edge(edge, ts)
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
        kind=_classify_edge(edge, _evaluate_edge(edge, at)[1][0], one.normals[0], two.normals[0], float(angles[worst])),
        samples=measured,
    )


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
    pcurve, low, high = _get_pcurve(edge, face)
    surface = BRep_Tool.Surface_s(face)
    ts = _map_to_range(np.asarray(ts, dtype=float), BRep_Tool.Range_s(edge), (low, high))
    uv = _evaluate_pcurve(pcurve, ts)
    left = edge.Orientation() == face.Orientation()  # a REVERSED edge of a REVERSED face runs forward on its surface
    beside = _shift_to_face_side(uv, ts, pcurve, surface, (high - low) * (1.0 if left else -1.0))
    jets = _evaluate_surface(surface, beside, order=2)
    moved = (beside != uv).any(axis=1)
    jets[moved, 0] = _evaluate_surface(surface, uv[moved], order=1)[:, 0]
    return EdgeSamples(jets[:, 0], *_compute_normals_curvatures(jets, face.Orientation() == TopAbs_REVERSED), uv)


def choose_sample_parameters(sides: Sequence[EdgeSide], samples: int = 1000) -> Array:
    """Parameters at which to compare the sides of an edge: equidistant, and clustered beside all that may jump.

    That is the ends, the knots of the 3D curve and of the pcurves, and the crossings with knot lines of the faces'
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
        pcurve, low, high = _get_pcurve(use, face)
        knots = find_curve_knots(Geom2dAdaptor_Curve(pcurve, low, high))
        found = find_knot_crossings(partial(_evaluate_pcurve, pcurve), low, high, BRep_Tool.Surface_s(face))
        breaks.append(_map_to_range(np.concatenate((knots, found)), (low, high), unit))
    return _map_to_range(spread_samples(np.unique(np.concatenate(breaks)), samples), unit, ends)


def measure_surface_contact(
    surfaces: tuple[Geom_Surface, Geom_Surface], places: Callable[[Array], tuple[Array, Array]], ts: Array
) -> tuple[float, float, float]:
    """Measure how two surfaces meet along a common curve, on which ``places`` gives parameters (n, 2) on each.

    On the first one, u runs along the curve. Returns gap, angle and curvature jump as in :class:`Continuity`; on a
    surface, normals have no outside, and are taken to point the same way on both. On short spans the rounding of
    products of poles and weights may hide that of poles, so that around the largest angles it is measured once more in
    a place beside the origin, where coordinates have more digits.
    """
    sign = 0.0

    def compare_surfaces(pair: Sequence[Geom_Surface], ts: Array) -> tuple[Array, Array, Array]:
        nonlocal sign
        at = places(ts)
        first, second = (_evaluate_surface(surface, uv, order=2) for surface, uv in zip(pair, at, strict=True))
        (n, bent), (m, other) = (_compute_normals_curvatures(jets, reverse=False) for jets in (first, second))
        sign = sign or (-1.0 if np.nansum(n * m) < 0 else 1.0)
        one, two = EdgeSamples(first[:, 0], n, bent, at[0]), EdgeSamples(second[:, 0], sign * m, sign * other, at[1])
        along = first[:, 1]
        return (
            np.linalg.norm(one.points - two.points, axis=1),
            measure_angle_between(one.normals, two.normals),
            _spectral_norm(_express_in_edge_frame(one, along) - _express_in_edge_frame(two, along)),
        )

    ts, values = resample_near_maxima(partial(compare_surfaces, surfaces), ts, compare_surfaces(surfaces, ts))
    found = [values]
    for i in np.argsort(np.nan_to_num(values[1], nan=-1.0))[-WORST_COUNT:].tolist():
        x, y, z = _evaluate_surface(surfaces[0], places(ts[[i]])[0], order=1)[0, 0].tolist()
        beside = [_translate_surface(surface, gp_Vec(-x, -y, -z)) for surface in surfaces]
        around = np.concatenate([ts[max(i - len(SPAN_SHARES), 0) : i + len(SPAN_SHARES) + 1], ts[::20]])
        found.append(list(compare_surfaces(beside, around)))
    gap, angle, jump = (max(float(np.nanmax(part[k])) for part in found) for k in range(3))
    return gap, angle, jump


def _translate_surface(surface: Geom_Surface, by: gp_Vec) -> Geom_Surface:
    """Return a moved copy of a surface."""
    copy = surface.Copy()
    copy.Translate(by)
    return copy


def find_inner_crease(face: TopoDS_Face, samples: int = 101) -> Crease:
    """Find the sharpest crease inside a face: along knot lines across which its surface need not be C1.

    Both one-sided normals are read beside every such line, at ``samples`` points of it and beside the knots that
    cross it; what lies outside the face's boundary does not count. Seams are edges: :func:`measure_continuity` measures
    those.

    Raises
    ------
    InputError
        ``face`` is not a face.
    """
    face = TopoDS.Face_s(require_shape(face, "face", TopAbs_FACE))
    bounds = BRepTools.UVBounds_s(face)
    window = GeomAdaptor_Surface(BRep_Tool.Surface_s(face), *bounds)
    lines = find_knot_lines(window, GeomAbs_C1)
    knots = find_knot_lines(window, GeomAbs_C3)
    pairs = [np.empty((0, 2, 2))]
    for k, other in ((0, 1), (1, 0)):
        low, high = bounds[2 * other : 2 * other + 2]
        beside = CLUSTER_OFFSETS[0] * (high - low)
        along = np.linspace(low + beside, high - beside, samples)
        along = np.concatenate((along, (knots[other][1:-1, None] + np.array([-beside, beside])).ravel()))
        for at in lines[k][1:-1]:
            step = _compute_side_step(bounds[2 * k + 1] - bounds[2 * k], at)
            pair = np.empty((along.size, 2, 2))
            pair[:, :, other] = along[:, None]
            pair[:, :, k] = at - step, at + step
            pairs.append(pair)
    uv = np.concatenate(pairs)
    if len(uv):
        boundary = BRepTopAdaptor_FClass2d(face, 1e-9)
        uv = uv[[boundary.Perform(gp_Pnt2d(*middle)) != TopAbs_OUT for middle in uv.mean(axis=1).tolist()]]
    if not len(uv):
        return Crease(0.0, None, None)
    points, normals = (array.reshape(-1, 2, 3) for array in evaluate_face_normals(face, uv.reshape(-1, 2)))
    angles = np.nan_to_num(measure_angle_between(normals[:, 0], normals[:, 1]))
    worst = int(angles.argmax())
    u, v = uv[worst].mean(axis=0).tolist()
    x, y, z = points[worst, 0].tolist()
    return Crease(float(angles[worst]), (u, v), (x, y, z))


def sample_outline(face: TopoDS_Face, samples: int = 65) -> Array:
    """Return the boundary of a face in its parameter plane, as the ends (n, 2, 2) of short straight pieces."""
    pieces = []
    explorer = TopExp_Explorer(face, TopAbs_EDGE)
    while explorer.More():
        pcurve, low, high = _get_pcurve(TopoDS.Edge_s(explorer.Current()), face)
        points = _evaluate_pcurve(pcurve, np.linspace(low, high, samples))
        pieces.append(np.stack([points[:-1], points[1:]], axis=1))
        explorer.Next()
    return np.concatenate(pieces)


def evaluate_face_normals(face: TopoDS_Face, uv: Array) -> tuple[Array, Array]:
    """Points and outward unit normals of a face at parameters (n, 2): (n, 3) each, normals nan at degenerate points.

    Raises
    ------
    GeometryError
        OCCT cannot evaluate the surface.
    """
    jets = _evaluate_surface(BRep_Tool.Surface_s(face), uv, order=1)
    normals = _normalise_rows(np.cross(jets[:, 1], jets[:, 2]))
    return jets[:, 0], -normals if face.Orientation() == TopAbs_REVERSED else normals


def measure_angle_between(a: Array, b: Array) -> Array:
    """Angles between vectors, ``atan2(|a x b|, a.b)``: exact to rounding also near 0 and pi, unlike arccos."""
    return np.asarray(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.einsum("...i,...i->...", a, b)))


# ------------------------------------------------------------------------------------------------------------- topology


def require_shape(shape: object, name: str, kind: TopAbs_ShapeEnum | None = None) -> TopoDS_Shape:
    """Let a shape of the right kind pass."""
    if not isinstance(shape, TopoDS_Shape):
        raise InputError(f"{name} is of type {type(shape).__name__}: a TopoDS shape is needed")
    if shape.IsNull():
        raise InputError(f"{name} is a null shape")
    if kind is not None and shape.ShapeType() != kind:
        is_a, must_be = (it.name.removeprefix("TopAbs_").lower() for it in (shape.ShapeType(), kind))
        raise InputError(f"{name} is of type {is_a}: {must_be} is needed")
    return shape


def find_sides_on_face(face: TopoDS_Face, edge: TopoDS_Edge) -> list[EdgeSide]:
    """Return the sides of an edge on which a face lies: two on a seam, none if the edge floats inside the face."""
    uses = []
    explorer = TopExp_Explorer(face, TopAbs_EDGE)
    while explorer.More():
        found = explorer.Current()
        if found.IsSame(edge) and found.Orientation() in (TopAbs_FORWARD, TopAbs_REVERSED):
            uses.append((face, TopoDS.Edge_s(found)))
        explorer.Next()
    return uses


def _get_pcurve(edge: TopoDS_Edge, face: TopoDS_Face) -> tuple[Geom2d_Curve, float, float]:
    """Return an edge's curve in the parameter plane of a face, and its range."""
    pcurve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
    if pcurve is None:
        raise GeometryError("the edge has no curve in the parameter plane of its face: repair it first (ShapeFix)")
    low, high = BRep_Tool.Range_s(edge, face)
    return pcurve, low, high


# ----------------------------------------------------------------------------------------------------------- evaluation


def _evaluate_pcurve(pcurve: Geom2d_Curve, ts: Array) -> Array:
    """Evaluate a plane curve: (n, 2)."""
    point, evaluate, flat = gp_Pnt2d(), pcurve.D0, []
    for t in ts.tolist():
        evaluate(t, point)
        flat += point.Coord()
    return np.array(flat).reshape(-1, 2)


def _evaluate_edge(edge: TopoDS_Edge, ts: Array) -> tuple[Array, Array]:
    """Evaluate an edge in space, its 3D curve if it has one: points and derivatives, (n, 3) each."""
    point, tangent, evaluate, flat = gp_Pnt(), gp_Vec(), BRepAdaptor_Curve(edge).D1, []
    for t in ts.tolist():
        evaluate(t, point, tangent)
        flat += point.Coord()
        flat += tangent.Coord()
    values = np.array(flat).reshape(-1, 2, 3)
    return values[:, 0], values[:, 1]


def _evaluate_surface(surface: Geom_Surface, uv: Array, order: Literal[1, 2]) -> Array:
    """Evaluate a surface by OCCT: S, Su, Sv and, to order 2, Suu, Svv, Suv, as (n, 3 or 6, 3)."""
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


def _compute_normals_curvatures(jets: Array, reverse: bool) -> tuple[Array, Array]:
    """Outward unit normals and curvature tensors from second order jets; nan where the surface is degenerate."""
    su, sv = jets[:, 1], jets[:, 2]
    cross = -np.cross(su, sv) if reverse else np.cross(su, sv)
    normals = _normalise_rows(cross)
    size = np.linalg.norm(cross, axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        dual = np.stack((np.cross(sv, normals), np.cross(normals, su)), axis=1) / size[:, None]
    if reverse:
        dual = -dual
    luu, lvv, luv = np.einsum("nki,ni->kn", jets[:, 3:], normals)
    form = np.stack((luu, luv, luv, lvv), axis=-1).reshape(-1, 2, 2)
    return normals, np.asarray(dual.transpose(0, 2, 1) @ form @ dual)


def _normalise_rows(vectors: Array) -> Array:
    """Normalise rows; nan for those that are nothing but rounding beside the longest."""
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    sound = size > _DEGENERATE_RATIO * np.nanmax(size)
    return np.asarray(np.divide(vectors, size, out=np.full_like(vectors, np.nan), where=sound))


def _express_in_edge_frame(side: EdgeSamples, tangents: Array) -> Array:
    """Curvature tensors in the orthonormal frame (along the edge, across it) of each tangent plane: (n, 2, 2)."""
    across = _normalise_rows(np.cross(side.normals, tangents))
    frame = np.stack((np.cross(across, side.normals), across), axis=1)
    return np.asarray(frame @ side.curvature @ frame.transpose(0, 2, 1))


def _spectral_norm(forms: Array) -> Array:
    """Largest |w.h.w| over all unit w, for symmetric 2 x 2 matrices h: Mohr's circle."""
    mean = (forms[:, 0, 0] + forms[:, 1, 1]) / 2
    return np.asarray(np.abs(mean) + np.hypot((forms[:, 0, 0] - forms[:, 1, 1]) / 2, forms[:, 0, 1]))


def _classify_edge(edge: TopoDS_Edge, tangent: Array, first: Array, second: Array, angle: float) -> EdgeKind:
    """Tell which way an edge bends: on a convex one the second normal points away from the first face."""
    if angle <= SMOOTH_ANGLE:
        return "smooth"
    into_first = np.cross(first, tangent) * (1.0 if edge.Orientation() == TopAbs_FORWARD else -1.0)
    return "concave" if into_first @ second > 0.0 else "convex"


# ------------------------------------------------------------------------------------------------ knots and their sides


def _shift_to_face_side(uv: Array, ts: Array, pcurve: Geom2d_Curve, surface: Geom_Surface, span: float) -> Array:
    """Move points of a pcurve that runs along a knot line to the side of the line where the face lies.

    ``span`` is the length of the edge's range, negative if the face lies to the right of its pcurve. Only lines where
    second derivatives may jump matter; a pcurve that merely crosses a line stays.
    """
    moved = uv.copy()
    for k, beyond, size in measure_line_distances(surface, GeomAbs_C2, uv):
        offset = beyond[np.arange(len(uv)), np.abs(beyond).argmin(axis=1)]
        for i in np.nonzero(np.abs(offset) <= KNOT_LINE_TOLERANCE * size)[0].tolist():
            point, velocity = gp_Pnt2d(), gp_Vec2d()
            pcurve.D1(float(ts[i]), point, velocity)
            if abs(velocity.Coord()[k] * span) <= KNOT_LINE_TOLERANCE * size:
                inward = (-velocity.Y(), velocity.X())[k] * span
                at = uv[i, k] - offset[i]
                moved[i, k] = at + math.copysign(_compute_side_step(size, at), inward)
    return moved


def _compute_side_step(size: float, at: float) -> float:
    """Length of the step off a knot line that surely changes sides."""
    return max(_KNOT_STEP * size, 16.0 * float(np.spacing(abs(at))))


def _map_to_range(ts: Array, source: tuple[float, float], target: tuple[float, float]) -> Array:
    """Map parameters from one range onto another; identical ranges leave every bit as it was."""
    if source == target:
        return ts
    return target[0] + (ts - source[0]) * ((target[1] - target[0]) / (source[1] - source[0]))
