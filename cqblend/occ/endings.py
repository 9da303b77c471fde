"""Where an open blend ends: on the face across its end, or in a flat cap of its own.

Either way the end curve X of the blend surface is solved point by point on the surface it ends on. On a neighbour face,
X replaces the corner and the two edges there are cut short. A *cap* is a planar face across the edge, bounded by X and
by a wall curve on each side, from the corners of the blend down to the edge: for edges that go on, smoothly or not,
past the point where their blend is to end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.Geom import Geom_Plane
from OCP.GeomAPI import GeomAPI_ProjectPointOnCurve
from OCP.gp import gp_Ax3, gp_Dir, gp_Pnt
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.blends.contact import intersect, newton
from cqblend.blends.primaries import Array, Frame, Plane, Primary, tangent_coordinates, unit
from cqblend.errors import SizeError, TopologyError
from cqblend.occ import bulk
from cqblend.occ.adapt import face_side
from cqblend.occ.edge_accuracy import MARGIN
from cqblend.occ.topology import (
    BUILDER,
    CONFUSION,
    Ancestors,
    attach,
    ends,
    ends_uv,
    explore,
    flipped,
    forward,
    location_of,
    loosen,
    make_edge,
    make_face,
    make_vertex,
    make_wire,
    trimmed,
)
from cqblend.splines import Curve, fit

if TYPE_CHECKING:
    from cqblend.occ.surgery import Surgery

FITTED = 1e-9  # mm: end and wall curves are fitted until they lie on both their faces to this, if they can
MOST = 64  # times six spans of such a curve


@dataclass(frozen=True)
class Ending:
    """One end of an open blend.

    ``edge`` is X, FORWARD from the corner on rail 1 to that on rail 2, at the parameters ``t`` of the rails. A capped
    end has ``walls``, FORWARD from the edge point to the corners, and the ``cap``; the others the edges that they
    ``trim`` at ``vertex``.
    """

    edge: TopoDS_Edge
    corners: tuple[TopoDS_Vertex, TopoDS_Vertex]
    t: tuple[float, float]
    vertex: TopoDS_Vertex
    trims: tuple[TopoDS_Edge, ...] = ()
    walls: tuple[TopoDS_Edge, ...] = ()
    cap: TopoDS_Face | None = None


def on_neighbour(surgery: Surgery, end: int) -> Ending:
    """End the blend on the one face across from the edge at its start (``end`` 0) or stop (1).

    Raises
    ------
    TopologyError
        If there is not exactly one such face, next to both sides.
    """
    vertex = surgery.spine.vertices[end]
    sides = [side.face for side in surgery.sides]
    others = [
        face
        for face in Ancestors(surgery.solid, TopAbs_VERTEX, TopAbs_FACE)(vertex)
        if not any(face.IsSame(side) for side in sides)
    ]
    if len(others) != 1:
        raise TopologyError(
            f"the edge ends at a vertex with {len(others)} further faces; a blend can end on exactly one"
        )
    neighbour = face_side(others[0], location_of(vertex)[None])
    edges, trims = Ancestors(surgery.solid, TopAbs_VERTEX, TopAbs_EDGE)(vertex), []
    for side in sides:
        pair = {surgery.faces.of(side), surgery.faces.of(others[0])}
        shared = [edge for edge in edges if {surgery.faces.of(face) for face in surgery.faces_at_edge(edge)} == pair]
        if len(shared) != 1:
            raise TopologyError("the face at the end of the edge does not share exactly one edge with each side")
        trims.append(shared[0])
    use = next(use for use in explore(neighbour.face, TopAbs_EDGE) if use.IsSame(trims[0]))
    arrives = ends(use)[1].IsSame(vertex)
    at = ends_uv(use, neighbour.face)[1 if arrives else 0]
    curve = _end_curve(surgery, neighbour.native, location_of(vertex), at, float(end))
    edge, corners = _end_edge(surgery, curve, neighbour.face)
    surgery.rewrite(others[0]).added.append(edge if arrives else flipped(edge))
    return Ending(edge, corners, _span(curve), vertex, trims=(trims[0], trims[1]))


def in_cap(surgery: Surgery, end: int, t: float) -> Ending:
    """End the blend in a flat cap in the plane across the edge at t.

    Raises
    ------
    TopologyError
        If the blend does not meet that plane, or the edge's vertex is too far from the surfaces for a cap there.
    """
    at = np.array([t])
    stations = intersect(surgery.sides, surgery.spine.stations(at, surgery.sides), surgery.spine.length)
    foot, tau = stations.point[0], stations.direction[0]
    first, second = (row(at)[0] for row in surgery.rows)
    loop = np.cross(second - first, foot - first) @ tau  # X runs ahead in the boundary of the cap at the far end
    normal = tau * (np.sign(loop) * (1.0 if end else -1.0))
    across = (second - first) - (second - first) @ tau * tau
    x = unit(across)
    plane = Plane(Frame(foot, np.array([x, np.cross(normal, x), normal])))
    cap = make_face(Geom_Plane(gp_Ax3(gp_Pnt(*foot.tolist()), gp_Dir(*normal.tolist()), gp_Dir(*x.tolist()))))
    curve = _end_curve(surgery, plane, foot, np.zeros(2), t)
    edge, corners = _end_edge(surgery, curve, cap)
    vertex = _foot_vertex(surgery, end, t, foot)
    walls = tuple(
        _wall(
            surgery, i, (stations.uv[i], surgery.spine.on_face(at, side.face)), curve, plane, cap, (vertex, corners[i])
        )
        for i, side in enumerate(surgery.sides)
    )
    uses = [edge, flipped(walls[1]), walls[0]] if end else [flipped(edge), flipped(walls[0]), walls[1]]
    BUILDER.Add(cap, make_wire(uses))
    return Ending(edge, corners, _span(curve), vertex, walls=walls, cap=cap)


def _foot_vertex(surgery: Surgery, end: int, t: float, foot: Array) -> TopoDS_Vertex:
    """Return the edge's own vertex if the cap stands there, else a new one on the edge."""
    if t == end:
        vertex = surgery.spine.vertices[end]
        if np.linalg.norm(location_of(vertex) - foot) > BRep_Tool.Tolerance_s(vertex):
            raise TopologyError("the edge's vertex is too far from its faces for a blend to end there")
        return vertex
    on_edge = surgery.spine.points(np.array([t]))[0]
    return make_vertex(foot, MARGIN * float(np.linalg.norm(on_edge - foot)))


def _span(curve: Curve) -> tuple[float, float]:
    first, last = curve(np.array([0.0, 1.0]))[:, 0]
    return float(first), float(last)


def _fitted(exact: Callable[[Array], Array], error: Callable[[Array, Array], float]) -> Curve:
    """Interpolate a curve on [0, 1]: one cubic if that is right, else C2 cubics on as many spans as it takes."""
    count = 1
    while True:
        v = np.linspace(0, 1, 6 * count + 1)
        values = exact(v)
        curve = _cubic(values) if count == 1 else fit.interpolate(v[::2], values[::2])
        if error(curve(v), v) <= FITTED or count >= MOST:
            return curve
        count *= 2


def _cubic(values: Array) -> Curve:
    """Return the cubic on [0, 1] through values at 0, 1/3, 2/3 and 1, the even ones of (7, k)."""
    q = values[::2]
    coefs = [
        q[0],
        (-5 * q[0] + 18 * q[1] - 9 * q[2] + 2 * q[3]) / 6,
        (2 * q[0] - 9 * q[1] + 18 * q[2] - 5 * q[3]) / 6,
        q[3],
    ]
    return Curve(np.array([0.0, 1.0]), np.stack(coefs)[..., None])


def _end_curve(surgery: Surgery, native: Primary, corner: Array, at: Array, start: float) -> Curve:
    """Return the curve v -> (t, v, a, b, x, y, z) with H(t, v) = N(a, b) = (x, y, z), v in [0, 1].

    ``corner`` is a point of N near the end, of parameters ``at``; t is looked for from ``start``.
    """
    surface = surgery.blend.surface
    size = float(np.linalg.norm(surface(start, 0.0) - surface(start, 1.0)))

    def exact(v: Array) -> Array:
        def system(x: Array) -> tuple[Array, Array, Array]:
            h = surface.jet(x[:, 0], v, 1)
            n = native.jet(x[:, 1:])
            jacobian = np.stack([h[1, 0], -n[1], -n[2]], axis=2)
            return h[0, 0] - n[0], jacobian, np.linalg.norm(jacobian, axis=1)

        t = np.full(len(v), start)
        offset = surface(t, v) - corner
        guess = at + tangent_coordinates(native.jet(np.tile(at, (len(v), 1))), offset)
        x, good = newton(system, np.column_stack([t, guess]), size, size)
        if not good.all():
            raise TopologyError("the blend does not meet the face at the end of the edge: the size is too large for it")
        return np.column_stack([x[:, 0], v, x[:, 1:], native.jet(x[:, 1:])[0]])

    def error(values: Array, v: Array) -> float:
        on_blend, on_face = surface(values[:, 0], v), native.jet(values[:, 2:4])[0]
        return float(max(np.abs(p - values[:, 4:]).max() for p in (on_blend, on_face)))

    return _fitted(exact, error)


def _end_edge(
    surgery: Surgery, curve: Curve, face: TopoDS_Face
) -> tuple[TopoDS_Edge, tuple[TopoDS_Vertex, TopoDS_Vertex]]:
    """Make the edge of an end curve, with its pcurves on the blend and on the face it ends on."""
    first, last = curve(np.array([0.0, 1.0]))[:, 4:]
    corners = (make_vertex(first), make_vertex(last))
    return _edge_between(curve, corners, surgery.face, face), corners


def _edge_between(
    curve: Curve,
    vertices: tuple[TopoDS_Vertex, TopoDS_Vertex],
    first: TopoDS_Face,
    second: TopoDS_Face,
) -> TopoDS_Edge:
    """Make the edge of a fitted curve (u1, v1, u2, v2, x, y, z) in which two faces meet."""
    degree, knots, poles, _ = curve.to_bspline()
    edge = make_edge(bulk.curve_from_arrays(degree, knots, poles[:, 4:]), vertices, (0.0, 1.0))
    attach(edge, first, bulk.curve2d_from_arrays(degree, knots, poles[:, :2]))
    attach(edge, second, bulk.curve2d_from_arrays(degree, knots, poles[:, 2:4]))
    return edge


def _wall(
    surgery: Surgery,
    i: int,
    foot_uv: tuple[Array, Array],
    end_curve: Curve,
    plane: Plane,
    cap: TopoDS_Face,
    vertices: tuple[TopoDS_Vertex, TopoDS_Vertex],
) -> TopoDS_Edge:
    """Make the edge in which side i meets the plane of a cap, from the edge point to corner i.

    ``foot_uv`` are the edge point's parameters on the primary, and, to a tolerance, the face's own.
    """
    side, (uv, on_edge) = surgery.sides[i], foot_uv
    t, corner = end_curve(np.array([float(i)]))[0, [0]], end_curve(np.array([float(i)]))[0, 4:]
    foot = plane.frame.origin
    start, stop = side.beside(side.own(uv), on_edge), side.beside(surgery.pcurves[i](t), on_edge)
    chord, normal = corner - foot, plane.frame.axes[2]
    length = float(np.linalg.norm(chord))

    def exact(s: Array) -> Array:
        def system(x: Array) -> tuple[Array, Array, Array]:
            jet = side.native.jet(x)
            offset = jet[0] - foot
            residual = np.stack([offset @ normal, offset @ chord / length - s * length], -1)
            jacobian = np.stack([np.stack([rate @ normal, rate @ chord / length], -1) for rate in jet[1:3]], -1)
            return residual, jacobian, np.linalg.norm(jet[1:3], axis=2).T

        x, good = newton(system, start + s[:, None] * (stop - start), length, length)
        if not good.all():
            raise TopologyError("a flat cap at the end of the edge does not cross its faces cleanly")
        point = side.native.jet(x)[0]
        return np.column_stack([x, (point - foot) @ plane.frame.axes[:2].T, point])

    def error(values: Array, _: Array) -> float:
        on_face, on_plane = side.native.jet(values[:, :2])[0], plane.jet(values[:, 2:4])[0]
        return float(max(np.abs(p - values[:, 4:]).max() for p in (on_face, on_plane)))

    return _edge_between(_fitted(exact, error), vertices, side.face, cap)


def trim_neighbours(surgery: Surgery, endings: tuple[Ending, Ending]) -> None:
    """Shorten the edges between the two sides and the end faces to where the blend's corners lie on them."""
    cuts: dict[int, list[tuple[TopoDS_Vertex, TopoDS_Vertex]]] = {}
    for ending in endings:
        for edge, corner in zip(ending.trims, ending.corners, strict=False):
            cuts.setdefault(surgery.edges.of(edge), []).append((ending.vertex, corner))
    for number, changes in cuts.items():
        edge = TopoDS.Edge_s(forward(surgery.edges[number]))
        curve = BRep_Tool.Curve_s(edge, 0.0, 0.0)
        span, vertices = list(BRep_Tool.Range_s(edge)), list(ends(edge))
        whole = span.copy()
        for old, new in changes:
            project = GeomAPI_ProjectPointOnCurve(gp_Pnt(*location_of(new).tolist()), curve, *whole)
            slack = 10 * max(BRep_Tool.Tolerance_s(edge), CONFUSION)
            if project.NbPoints() == 0 or project.LowerDistance() > slack:
                raise SizeError(f"the blend reaches beyond the end of edge {number} next to it: the size is too large")
            which = 0 if vertices[0].IsSame(old) else 1
            span[which], vertices[which] = project.LowerDistanceParameter(), new
            loosen(new, MARGIN * project.LowerDistance())
        if np.linalg.norm(location_of(vertices[0]) - location_of(vertices[1])) < 100 * CONFUSION or span[0] >= span[1]:
            raise SizeError(f"nothing would remain of edge {number} next to the blend: the size is too large")
        piece = trimmed(edge, (vertices[0], vertices[1]), (span[0], span[1]))
        for face in surgery.faces_at_edge(edge):
            surgery.rewrite(face).replaced[number] = [piece]


def remains(
    surgery: Surgery, low: Ending, high: Ending, caps: tuple[float | None, float | None]
) -> dict[int, list[TopoDS_Edge]]:
    """Return what remains, before the first cap and after the last, of every edge that the blend replaces."""
    spine = surgery.spine
    stops = np.append(0.0, np.cumsum([piece.length for piece in spine.pieces])) / spine.length
    first, last = caps[0] or 0.0, 1.0 if caps[1] is None else caps[1]
    left: dict[int, list[TopoDS_Edge]] = {}
    for edge, start, stop in zip(spine.edges, stops[:-1], stops[1:], strict=True):
        if stop <= first or start >= last:
            continue
        pieces = left.setdefault(surgery.edges.of(edge), [])
        for t, ending, before in ((first, low, True), (last, high, False)):
            if start < t < stop:
                at = float(spine.locate(np.array([t]))[1][0])
                head = before == (edge.Orientation() == forward(edge).Orientation())
                span, own = BRep_Tool.Range_s(edge), ends(TopoDS.Edge_s(forward(edge)))
                pieces.append(
                    trimmed(edge, (own[0], ending.vertex), (span[0], at))
                    if head
                    else trimmed(edge, (ending.vertex, own[1]), (at, span[1]))
                )
    return left
