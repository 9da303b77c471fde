"""Build the results of unrolling as shapes of OCCT: strips in space, pieces in the plane, formers.

Everything is built edge by edge on given curves: nothing is intersected, projected or fitted. Depends on the data
structures of patterns only, not on how strips and pieces are computed.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_Sewing
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.Geom import Geom_Circle, Geom_Curve, Geom_Line, Geom_Plane
from OCP.Geom2d import Geom2d_BSplineCurve
from OCP.gp import gp_Ax2, gp_Ax3, gp_Dir, gp_Pnt
from OCP.TopAbs import TopAbs_SHELL
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex, TopoDS_Wire

from cqblend.brep.conversion import spline_arrays
from cqblend.brep.conversion.spline_conversion import to_face
from cqblend.brep.conversion.tolerances import CONVERSION_TOLERANCES
from cqblend.brep.shape_kinds import downcast_shape
from cqblend.brep.topology import (
    BUILDER,
    CONFUSION,
    attach_pcurves,
    chain_segments,
    explore_subshapes,
    locate_vertex,
    make_bare_face,
    make_closed_wire,
    make_degenerate_edge,
    make_edge,
    make_vertex,
    reverse_edge,
)
from cqblend.errors import GeometryError, InputError, PatternWarning, warn
from cqblend.patterns.outline.pieces import Piece
from cqblend.patterns.outline.plane_path import Path
from cqblend.patterns.trimming.trimmed_patch import TrimmedSurface
from cqblend.splines import Curve, Surface, hermite
from cqblend.splines.bernstein import Array


@dataclass(frozen=True, slots=True)
class PatternShapeTolerances:
    """Tolerances and limits of the shapes of a pattern."""

    untrimmed: float = 1e-12
    """Part of a surface's parameter area: a loop that leaves out less is the surface's natural boundary."""
    least_chord: float = 1e-3
    """Least length of a chord in the parametrisation of a polygonal run, even if the chord is shorter in space.

    Relative to the surface's size, and to the part of its parameter range that the chord crosses.
    """
    quintic: float = 1e-11
    """Largest error, relative to their size, of quintic splines in place of curves above OCCT's largest degree."""
    quintic_spans: int = 2048
    """Number of spans above which such splines are not refined any more."""
    quintic_margin: float = 1.2
    """Factor on the largest error found at samples, as an estimate of the largest error anywhere."""
    least_bulge: float = 1e-8
    """Bulge (tangent of a quarter of the angle) below which an arc becomes a segment, as its radius is ill-defined."""


SHAPE_TOLERANCES = PatternShapeTolerances()


def sew_strip_faces(trims: Sequence[TrimmedSurface], tolerance: float) -> TopoDS_Shape:
    """Return strips as B-spline faces, sewn where their borders are closer than a tolerance.

    The curve of an edge is the exact image of its run, a piece of a loop in the parameter plane.

    Parameters
    ----------
    trims
        One for each strip or planar piece.
    tolerance
        Of the sewing, mm. Strips of one face share their rails, and need none; those of different faces are as far
        apart as both are from their faces.

    Returns
    -------
    TopoDS_Shape
        A shell, or a compound of shells and faces if they do not hang together.

    Raises
    ------
    InputError
        Nothing is given, or the tolerance is not a positive number.
    GeometryError
        OCCT finds a face invalid.

    Warns
    -----
    PatternWarning
        Strips or edges of a degree above 25, the most that OCCT holds, are there as quintic splines; the message says
        how far these are from them.
    """
    if not trims:
        raise InputError("there are no strips to make faces of")
    if not 0 < tolerance < np.inf:
        raise InputError(f"the tolerance of sewing is {tolerance:g} mm; it must be positive and finite")
    sewing = BRepBuilderAPI_Sewing(max(tolerance, CONFUSION))
    deviations: list[float] = []
    for number, trim in enumerate(trims, start=1):
        face, of_face = _make_trimmed_face(trim, number)
        deviations += of_face
        sewing.Add(face if trim.outward else face.Reversed())
    if deviations:
        warn(
            PatternWarning(
                f"{len(deviations)} strips or edges have a degree above {spline_arrays.MAX_DEGREE}, which OCCT cannot "
                f"hold: they are approximated by quintic splines within {max(deviations):.1g} mm"
            )
        )
    sewing.Perform()
    sewn = downcast_shape(sewing.SewedShape())
    for shell in explore_subshapes(sewn, TopAbs_SHELL):
        shell.Closed(BRep_Tool.IsClosed_s(shell))
    return sewn


def make_planar_faces(pieces: Iterable[Piece], *, tabs: bool = False) -> list[TopoDS_Face]:
    """Return pieces as faces in the plane z = 0, bounded by segments and exact arcs of circles.

    Parameters
    ----------
    pieces
        Their loops become wires, one edge for each segment or arc longer than 1e-7 mm.
    tabs
        Whether the tabs, if a piece has any, belong to its face.

    Raises
    ------
    GeometryError
        OCCT finds a face invalid; the message names the piece.

    Examples
    --------
    >>> disc = Path(np.array([[1.0, 0.0], [-1.0, 0.0], [1.0, 0.0]]), np.array([1.0, 1.0]))
    >>> (face,) = make_planar_faces([Piece("1", (), (disc,))], tabs=True)
    >>> face.ShapeType().name
    'TopAbs_FACE'
    """
    plane = Geom_Plane(gp_Ax3())
    faces = []
    for piece in pieces:
        face = make_bare_face(plane)
        for path in piece.cuts if tabs else piece.outlines:
            BUILDER.Add(face, make_closed_wire(_make_path_edges(path)))
        faces.append(_require_valid_face(face, f"piece {piece.name}"))
    return faces


def make_formers(rails: Sequence[Curve], tolerance: float = CONFUSION) -> list[TopoDS_Face | TopoDS_Wire]:
    """Return the formers over which strips are assembled (Elber 1995, figure 3b): faces or wires through rails.

    Rails are joined end to end where exactly two of them meet. A closed planar chain bounds a face, which can be cut
    from board; every other chain is a wire. Rails that are points, and repeated ones (the border of two strips), are
    left out.

    Parameters
    ----------
    rails
        Of dim 3, mm: the borders of strips, or those parts of them that trimming has left.
    tolerance
        How close ends have to be to meet, mm.

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0]])
    >>> [former.ShapeType().name for former in make_formers([Curve.bezier(corners[i : i + 2]) for i in range(3)])]
    ['TopAbs_FACE']
    """
    rails = [
        rail if rail.degree <= spline_arrays.MAX_DEGREE else _approximate_by_quintics([rail])[0][0] for rail in rails
    ]
    chains = _chain_rails(
        _drop_duplicate_rails([rail for rail in rails if _measure_extent(rail) > tolerance], tolerance), tolerance
    )
    return [_make_former(chain, tolerance) for chain in chains]


def _make_trimmed_face(trim: TrimmedSurface, number: int) -> tuple[TopoDS_Face, list[float]]:
    """Make a face whose edges are images of curves in the parameter plane.

    Also return the errors (mm) of the surface and of edges that are approximated because their degree is too high.
    """
    surface, deviations = trim.surface, list[float]()
    if surface.degree[0] > spline_arrays.MAX_DEGREE:
        rails, off = _approximate_by_quintics([surface.isoparametric(v=v) for v in surface.domain[1]])
        surface = Surface.from_rows(rails, surface.domain[1])
        deviations.append(off)
    loops = [[_convert_run(surface, run) for run in loop] for loop in trim.loops]
    (u0, u1), (v0, v1) = surface.domain
    area = _compute_signed_area(np.concatenate([curve(curve.breaks[:-1]) for curve in loops[0]])) if loops else np.inf
    if len(loops) <= 1 and abs(area) >= (1 - SHAPE_TOLERANCES.untrimmed) * (u1 - u0) * (v1 - v0):
        return to_face(surface), deviations
    if area < 0:
        loops = [[curve.reverse() for curve in loop[::-1]] for loop in loops]
    face = make_bare_face(spline_arrays.surface_from_arrays(*surface.to_bspline()))
    for loop in loops:
        images, of_loop = _compose_images(surface, loop)
        deviations += of_loop
        BUILDER.Add(face, make_closed_wire(_make_loop_edges(face, surface, loop, images)))
    return _require_valid_face(face, f"strip {number}"), deviations


def _convert_run(surface: Surface, run: Array | Curve) -> Curve:
    """Return a run as a curve: a polygon (n, 2) by its chord lengths in space, or straight along a parameter line."""
    if isinstance(run, Curve):
        return run
    low, high = np.array(surface.domain).T
    points = np.clip(run, low, high)
    shares = np.abs(np.diff(points, axis=0) / (high - low)).max(axis=1)
    points, shares = points[np.append(True, shares > 0)], shares[shares > 0]
    chords = np.linalg.norm(np.diff(surface(points[:, 0], points[:, 1]), axis=0), axis=1)
    least_chords = SHAPE_TOLERANCES.least_chord * _measure_extent(surface) * shares
    t = np.append(0.0, np.cumsum(np.maximum(chords, least_chords)))
    if (points == points[0]).all(axis=0).any():
        t, points = t[[0, -1]], points[[0, -1]]
    return Curve.from_bspline(1, np.concatenate([t[:1], t, t[-1:]]), points)


def _compose_images(surface: Surface, loop: list[Curve]) -> tuple[list[tuple[Curve, float]], list[float]]:
    """Return the image in space of every run of a loop with its error (mm), and the errors of approximated ones."""
    images, deviations = [], []
    for curve in loop:
        image, off = surface.compose(curve), 0.0
        if image.degree > spline_arrays.MAX_DEGREE:
            (image,), off = _approximate_by_quintics([image])
            deviations.append(off)
        images.append((image, off))
    return images, deviations


def _make_loop_edges(
    face: TopoDS_Face, surface: Surface, loop: list[Curve], images: list[tuple[Curve, float]]
) -> list[TopoDS_Edge]:
    """Make the edge uses of one wire; two runs with the same image, on a closed surface, become a seam."""
    vertices = _VertexPool()
    edges: dict[int, TopoDS_Edge] = {}
    for i, (curve, (image, off)) in enumerate(zip(loop, images, strict=True)):
        if i in edges:
            continue
        start, stop = (vertices.get_vertex(point) for point in image(image.domain))
        pcurve = _make_plane_curve(curve)
        if _measure_extent(image) <= CONFUSION:
            edges[i] = make_degenerate_edge(face, start, pcurve, curve.domain)
            continue
        edges[i] = make_edge(spline_arrays.curve_from_arrays(*image.to_bspline()), (start, stop), curve.domain, off)
        for j in range(i + 1, len(loop)):
            back = loop[j].reverse().reparametrized(*curve.domain)
            if j not in edges and _has_image(surface, back, image):
                edges[j] = reverse_edge(edges[i])
                attach_pcurves(edges[i], face, pcurve, _make_plane_curve(back))
                break
        else:
            attach_pcurves(edges[i], face, pcurve)
    return [edges[i] for i in range(len(loop))]


def _approximate_by_quintics(curves: Sequence[Curve]) -> tuple[list[Curve], float]:
    """Return curves over one domain as quintic splines with common breaks, and an estimate of their largest error, mm.

    The splines have the curves' values and first two derivatives at their breaks. Spans are halved until the error at
    samples is below 1e-11 of the size.
    """
    t = np.unique(np.concatenate([curve.breaks for curve in curves]))
    allowed = SHAPE_TOLERANCES.quintic * max(_measure_extent(curve) for curve in curves)
    shares = (np.arange(8) + 0.5) / 8
    while True:
        splines, worst = [], np.zeros(len(t) - 1)
        between = t[:-1, None] + np.diff(t)[:, None] * shares
        for curve in curves:
            jets = np.stack([curve.jet(t[:-1], 2, side="right"), curve.jet(t[1:], 2, side="left")], axis=2)
            jets[0, :-1, 1] = jets[0, 1:, 0]  # one point, rounded twice
            splines.append(hermite(t, jets))
            off = np.linalg.norm(splines[-1](between.ravel()) - curve(between.ravel()), axis=1).reshape(between.shape)
            worst = np.maximum(worst, off.max(axis=1))
        is_coarse = worst > allowed
        if not is_coarse.any() or len(t) > SHAPE_TOLERANCES.quintic_spans:
            return splines, float(SHAPE_TOLERANCES.quintic_margin * worst.max())
        t = np.sort(np.concatenate([t, (t[:-1] + t[1:])[is_coarse] / 2]))


class _VertexPool:
    """The vertices of one wire, one for each point."""

    def __init__(self) -> None:
        self._vertices: list[TopoDS_Vertex] = []

    def get_vertex(self, point: Array) -> TopoDS_Vertex:
        """Return the vertex at a point, made if there is none yet."""
        for vertex in self._vertices:
            if np.linalg.norm(locate_vertex(vertex) - point) <= CONFUSION:
                return vertex
        self._vertices.append(make_vertex(point))
        return self._vertices[-1]


def _has_image(surface: Surface, curve: Curve, image: Curve) -> bool:
    """Whether a curve in the parameter plane has a given image in space, at the same parameters."""
    start, stop = image.domain
    t = start + (stop - start) * np.arange(8) / 7
    uv = curve(t)
    return bool(np.abs(surface(uv[:, 0], uv[:, 1]) - image(t)).max() <= CONFUSION)


def _make_plane_curve(curve: Curve) -> Geom2d_BSplineCurve:
    return spline_arrays.curve2d_from_arrays(*curve.to_bspline())


def _make_path_edges(path: Path) -> list[TopoDS_Edge]:
    """Return the segments and arcs of a closed path as edges with common vertices."""
    long = path.lengths > CONFUSION
    starts, bulges = path.points[:-1][long], path.bulges[long]
    vertices = [make_vertex(np.append(point, 0.0)) for point in starts]
    edges = []
    for i, (start, bulge) in enumerate(zip(starts, bulges, strict=True)):
        following = (i + 1) % len(starts)
        curve, extent = _make_line_or_arc(start, starts[following], float(bulge))
        edges.append(make_edge(curve, (vertices[i], vertices[following]), (0.0, extent)))
    return edges


def _make_line_or_arc(start: Array, stop: Array, bulge: float) -> tuple[Geom_Curve, float]:
    """Return a line or a circle that starts at parameter 0, and the parameter at which it stops."""
    chord = stop - start
    length = float(np.linalg.norm(chord))
    if abs(bulge) < SHAPE_TOLERANCES.least_bulge:
        return Geom_Line(gp_Pnt(*start, 0.0), gp_Dir(*chord, 0.0)), length
    left = np.array([-chord[1], chord[0]])
    centre = start + chord / 2 + (1 - bulge**2) / (4 * bulge) * left
    radius = length * (1 + bulge**2) / (4 * abs(bulge))
    axes = gp_Ax2(gp_Pnt(*centre, 0.0), gp_Dir(0.0, 0.0, np.sign(bulge)), gp_Dir(*(start - centre), 0.0))
    return Geom_Circle(axes, radius), 4 * abs(float(np.arctan(bulge)))


def _drop_duplicate_rails(rails: Iterable[Curve], tolerance: float) -> list[Curve]:
    """Drop rails that coincide with an earlier one, in either sense."""
    kept: list[Curve] = []
    places: list[Array] = []
    for rail in rails:
        start, stop = rail.domain
        at = rail(start + (stop - start) * np.arange(5) / 4)
        if not any(min(np.abs(at - other).max(), np.abs(at[::-1] - other).max()) <= tolerance for other in places):
            kept.append(rail)
            places.append(at)
    return kept


def _chain_rails(rails: list[Curve], tolerance: float) -> list[list[Curve]]:
    """Join rails end to end at every point at which exactly two ends meet, with a common sense along each chain."""
    ends = np.array([rail(rail.domain) for rail in rails]).reshape(-1, 3)  # 2i and 2i + 1 are those of rail i
    near = np.linalg.norm(ends[:, None] - ends, axis=-1) <= tolerance
    partner = {
        end: int(np.flatnonzero(row & (np.arange(len(row)) != end))[0])
        for end, row in enumerate(near)
        if row.sum() == 2
    }
    # each rail is a segment from either of its ends; chains start at ends without a partner, or else are closed
    segments = sorted(range(len(ends)), key=lambda end: (end in partner, end))
    chains: list[list[Curve]] = []
    used: set[int] = set()
    for chain in chain_segments(segments, [partner.get(end ^ 1, -1) for end in segments]):
        entered = [segments[k] for k in chain]
        if used.isdisjoint(end // 2 for end in entered):  # else it is one of the others, run the other way
            used.update(end // 2 for end in entered)
            chains.append([rails[end // 2] if end % 2 == 0 else rails[end // 2].reverse() for end in entered])
    return chains


def _make_former(chain: list[Curve], tolerance: float) -> TopoDS_Face | TopoDS_Wire:
    """Make the face that a closed planar chain bounds, or else a wire."""
    starts = [make_vertex(curve(curve.domain[0]), tolerance) for curve in chain]
    end = chain[-1](chain[-1].domain[1])
    closed = bool(np.linalg.norm(end - locate_vertex(starts[0])) <= tolerance)
    stops = [*starts[1:], starts[0] if closed else make_vertex(end, tolerance)]
    wire = make_closed_wire(
        make_edge(spline_arrays.curve_from_arrays(*curve.to_bspline()), pair, curve.domain, tolerance)
        for curve, pair in zip(chain, zip(starts, stops, strict=True), strict=True)
    )
    wire.Closed(closed)
    plane = _find_plane(chain) if closed else None
    if plane is None:
        return wire
    face = make_bare_face(plane)
    BUILDER.Add(face, wire)
    return _require_valid_face(face, "former")


def _find_plane(chain: Sequence[Curve]) -> Geom_Plane | None:
    """Return the plane of a closed chain, with the normal around which it is counterclockwise; None if not planar."""
    poles = np.concatenate([curve.to_bspline()[2] for curve in chain])
    middle = poles.mean(axis=0)
    normal = np.linalg.svd(poles - middle)[2][-1]
    if np.abs((poles - middle) @ normal).max() > CONVERSION_TOLERANCES.planarity * np.ptp(poles, axis=0).max():
        return None
    points = np.concatenate([curve(np.linspace(*curve.domain, 65)[:-1]) for curve in chain])
    turning = np.cross(points - middle, np.roll(points, -1, axis=0) - middle).sum(axis=0) @ normal
    return Geom_Plane(gp_Pnt(*middle), gp_Dir(*(normal if turning > 0 else -normal)))


def _require_valid_face(face: TopoDS_Face, name: str) -> TopoDS_Face:
    if not BRepCheck_Analyzer(face).IsValid():
        raise GeometryError(f"OCCT finds the face of {name} invalid: does its boundary touch itself?")
    return face


def _measure_extent(spline: Curve | Surface) -> float:
    """Return the longest side of the box around all poles."""
    poles = spline.to_bspline()[2]
    return float(np.ptp(poles.reshape(-1, poles.shape[-1]), axis=0).max())


def _compute_signed_area(polygon: Array) -> float:
    x, y = (polygon - polygon[0]).T
    return float((x * np.roll(y, -1) - np.roll(x, -1) * y).sum() / 2)
