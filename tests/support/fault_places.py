"""Places for a fault in the draft of a solid: chosen at random, measured, and made.

Faults are functions that change a draft, and are entered by kind in ``FAULTS``. Where a solid has no place for one, it
raises :class:`NotApplicableError`. Everything random comes from the generator that it is given.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_BSplineSurface, Geom_Plane
from OCP.GeomAPI import GeomAPI
from OCP.gp import gp_Ax2, gp_Pnt, gp_Vec
from OCP.TopAbs import (
    TopAbs_EDGE,
    TopAbs_FACE,
    TopAbs_REVERSED,
    TopAbs_SHELL,
    TopAbs_VERTEX,
)
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex
from solid_drafts import (
    FaceDraft,
    SolidDraft,
    draft_face,
    get_pcurves,
    make_solid,
    measure_length,
    set_pcurves,
)

from cqblend.brep.conversion.spline_arrays import (
    curve2d_from_arrays,
    surface_from_arrays,
    surface_to_arrays,
)
from cqblend.brep.topology import (
    ShapeIndex,
    explore_subshapes,
    find_end_vertices,
)
from cqblend.splines.interpolation import interpolate

CHECKED_PARAMETERS = 23
"""At how many parameters ordinary BRepCheck compares an edge with its pcurves, the ends included."""

Rng = np.random.Generator
Fault = Callable[[SolidDraft, Rng], None]


class NotApplicableError(Exception):
    """A solid has no place for a fault."""


FAULTS: dict[str, list[Fault]] = {}
"""Functions that put a fault into a draft, by the kind of fault."""


def fault(kind: str) -> Callable[[Fault], Fault]:
    """Enter a function among the faults of a kind."""

    def enter(function: Fault) -> Fault:
        FAULTS.setdefault(kind, []).append(function)
        return function

    return enter


def require(is_faulty: bool) -> None:
    """Turn a solid down that what was done to it does not harm: a pole may matter beyond the ends of the face only."""
    if not is_faulty:
        raise NotApplicableError


def choose(rng: Rng, found: list):
    """Return one of some places for a fault."""
    if not found:
        raise NotApplicableError
    return found[int(rng.integers(len(found)))]


def choose_magnitude(rng: Rng, low: float, high: float) -> float:
    """Return a number between two, each order of magnitude as likely as another."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def choose_blend(draft: SolidDraft, rng: Rng) -> tuple[FaceDraft, Geom_BSplineSurface]:
    """Return a blend face on a spline surface, and a copy of that."""
    blend = choose(rng, draft.blends)
    surface = BRep_Tool.Surface_s(blend.bare)
    if not isinstance(surface, Geom_BSplineSurface):
        raise NotApplicableError
    return blend, surface.Copy()


def choose_rail(draft: SolidDraft, rng: Rng) -> tuple[TopoDS_Edge, FaceDraft, FaceDraft]:
    """Return a rail or end curve of a blend, the other face and the blend."""
    blend = choose(rng, draft.blends)
    return *choose(rng, draft.list_rails(blend)), blend


def choose_use(draft: SolidDraft, rng: Rng) -> tuple[TopoDS_Edge, FaceDraft]:
    """Return a new edge and one of its faces, on which it is no seam."""
    face = choose(rng, [*draft.blends, *draft.trimmed])
    edge = choose(rng, [e for e in draft.list_new_edges(face) if not BRep_Tool.IsClosed_s(e, face.bare)])
    return edge, face


def sample_pcurve(edge: TopoDS_Edge, face: FaceDraft, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return parameters of an edge, and points (n, 2) of its pcurve there."""
    t = np.linspace(*BRep_Tool.Range_s(edge), count)
    pcurve = get_pcurves(edge, face.bare)[0]
    return t, np.array([pcurve.Value(x).Coord() for x in t.tolist()])


def measure_gap(edge: TopoDS_Edge, face: FaceDraft) -> float:
    """Return the largest distance (mm) of an edge from its pcurve, of 997 samples; 0 of a seam."""
    if BRep_Tool.IsClosed_s(edge, face.bare) or BRep_Tool.Degenerated_s(edge):
        return 0.0
    curve, surface = BRep_Tool.Curve_s(edge, 0.0, 0.0), BRep_Tool.Surface_s(face.bare)
    t, uv = sample_pcurve(edge, face, 997)
    return max(curve.Value(a).Distance(surface.Value(*b)) for a, b in zip(t.tolist(), uv.tolist(), strict=True))


def measure_speed(edge: TopoDS_Edge, face: FaceDraft) -> np.ndarray:
    """Return how fast (mm) a point of a face moves with u and with v, in the middle of an edge."""
    (uv,) = sample_pcurve(edge, face, 3)[1][1:2]
    point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    BRep_Tool.Surface_s(face.bare).D1(*uv.tolist(), point, du, dv)
    return np.maximum([du.Magnitude(), dv.Magnitude()], 1e-3)


def put_pcurve(edge: TopoDS_Edge, face: FaceDraft, t: np.ndarray, uv: np.ndarray) -> None:
    """Give an edge the pcurve on a face that interpolates points."""
    degree, knots, poles, _ = interpolate(t, uv).to_bspline()
    set_pcurves(edge, face.bare, curve2d_from_arrays(degree, knots, poles))


def move_poles(surface: Geom_BSplineSurface, rows: slice, columns: slice, shift: np.ndarray) -> Geom_BSplineSurface:
    """Return a surface some of whose poles are moved."""
    degrees, knots, poles, weights = surface_to_arrays(surface)
    poles[rows, columns] += shift
    return surface_from_arrays(degrees, knots, poles, weights)


def get_normal(surface: Geom_BSplineSurface, u_share: float, v_share: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a point of a surface and its normal there."""
    u0, u1, v0, v1 = surface.Bounds()
    point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    surface.D1(u0 + u_share * (u1 - u0), v0 + v_share * (v1 - v0), point, du, dv)
    return np.array(point.Coord()), np.array(du.Crossed(dv).Normalized().Coord())


def find_plane(draft: SolidDraft, rng: Rng) -> tuple[TopoDS_Edge, FaceDraft, FaceDraft]:
    """Return a rail on a plane, the face there and the blend."""
    places = [
        (edge, face, blend)
        for blend in draft.blends
        for edge, face in draft.list_rails(blend)
        if isinstance(BRep_Tool.Surface_s(face.bare), Geom_Plane) and measure_length(edge) > 0.5
    ]
    return choose(rng, places)


def drill(draft: SolidDraft, face: FaceDraft, centre: np.ndarray, radius: float) -> None:
    """Drill a blind hole into a planar face, of the solid before and of the draft, without looking what is there."""
    surface = BRep_Tool.Surface_s(face.bare)
    olds = [f for f in explore_subshapes(draft.before, TopAbs_FACE) if BRep_Tool.Surface_s(f) is surface]
    if not olds:
        raise NotApplicableError
    axis = surface.Axis().Direction()
    inwards = axis if olds[0].Orientation() == TopAbs_REVERSED else axis.Reversed()
    origin = gp_Pnt(*evaluate_plane(surface, centre).tolist())
    pocket = BRepPrimAPI_MakeCylinder(gp_Ax2(origin, inwards), radius, radius).Shape()
    (mouth,) = (f for f in explore_subshapes(pocket, TopAbs_FACE) if _is_in_plane(f, surface))
    walls = [TopoDS.Face_s(f.Reversed()) for f in explore_subshapes(pocket, TopAbs_FACE) if not f.IsSame(mouth)]
    (rim,) = (use for wall in walls for use in explore_subshapes(wall, TopAbs_EDGE) if _is_edge_of(use, mouth))
    set_pcurves(rim, face.bare, GeomAPI.To2d_s(BRep_Tool.Curve_s(rim, 0.0, 0.0), surface.Pln()))
    use = rim if face.orientation == TopAbs_REVERSED else rim.Reversed()  # against its use in the wall
    face.wires.append([TopoDS.Edge_s(use)])
    holed = draft_face(olds[0])
    holed.wires.append([TopoDS.Edge_s(use)])
    first, *others = explore_subshapes(draft.before, TopAbs_SHELL)
    faces = [holed.build() if f.IsSame(olds[0]) else f for f in explore_subshapes(first, TopAbs_FACE)]
    draft.before = make_solid([*faces, *walls], others)
    draft.kept += walls
    if not BRepCheck_Analyzer(draft.before).IsValid():
        raise NotApplicableError


def _is_in_plane(face: TopoDS_Face, plane: Geom_Plane) -> bool:
    vertices = [v for edge in explore_subshapes(face, TopAbs_EDGE) for v in find_end_vertices(edge)]
    return all(plane.Pln().Distance(BRep_Tool.Pnt_s(vertex)) < 1e-9 for vertex in vertices)


def _is_edge_of(edge: TopoDS_Edge, face: TopoDS_Face) -> bool:
    return any(edge.IsSame(other) for other in explore_subshapes(face, TopAbs_EDGE))


def evaluate_plane(surface: Geom_Plane, uv: np.ndarray) -> np.ndarray:
    """Return the point of a plane at parameters."""
    return np.array(surface.Value(*uv.tolist()).Coord())


def find_strip(draft: SolidDraft, rng: Rng) -> tuple[FaceDraft, np.ndarray, np.ndarray]:
    """Return a planar face, a point of a rail in its parameters, and from there the way across what was cut off."""
    edge, face, blend = find_plane(draft, rng)
    _, uv = sample_pcurve(edge, face, 101)
    place = int(rng.integers(30, 70))
    surface = BRep_Tool.Surface_s(face.bare)
    rail = evaluate_plane(surface, uv[place])
    _, on_blend = sample_pcurve(edge, blend, 101)
    v0, v1 = BRepTools.UVBounds_s(blend.build())[2:]
    middle = BRep_Tool.Surface_s(blend.bare).Value(on_blend[place, 0], (v0 + v1) / 2)
    position = surface.Position()
    way = np.array(
        [gp_Vec(gp_Pnt(*rail.tolist()), middle).Dot(gp_Vec(d)) for d in (position.XDirection(), position.YDirection())]
    )
    along = uv[place + 1] - uv[place - 1]
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    if abs(way @ across) < 0.05:  # an end curve: its face is across the blend
        raise NotApplicableError
    return face, uv[place], across * (way @ across)


def put_into_both(draft: SolidDraft, body: TopoDS_Shape) -> None:
    """Put a void into the solid before and after, or, where the blend adds material, a body beside it."""
    (shell,) = explore_subshapes(body, TopAbs_SHELL)
    shell = shell if draft.grows else shell.Reversed()
    first, *others = explore_subshapes(draft.before, TopAbs_SHELL)
    draft.before = make_solid(list(explore_subshapes(first, TopAbs_FACE)), [*others, shell])
    draft.shells.append(shell)


def place_on_blend(draft: SolidDraft, rng: Rng) -> tuple[np.ndarray, np.ndarray, float]:
    """Return a point inside a blend face, the normal there, which points out of the solid, and the blend's width."""
    blend = choose(rng, draft.blends)
    u0, u1, v0, v1 = BRepTools.UVBounds_s(blend.build())
    surface = BRep_Tool.Surface_s(blend.bare)
    point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    u, v = u0 + rng.uniform(0.2, 0.8) * (u1 - u0), v0 + rng.uniform(0.3, 0.7) * (v1 - v0)
    surface.D1(u, v, point, du, dv)
    width = surface.Value(u, v0).Distance(surface.Value(u, v1))
    normal = np.array(du.Crossed(dv).Normalized().Coord())
    return np.array(point.Coord()), -normal if blend.orientation == TopAbs_REVERSED else normal, width


def choose_vertex(draft: SolidDraft, rng: Rng) -> TopoDS_Vertex:
    """Return a new vertex of a blend."""
    known = ShapeIndex(draft.before, TopAbs_VERTEX)
    edges = [edge for blend in draft.blends for edge in blend.list_edges()]
    return choose(rng, [v for edge in edges for v in find_end_vertices(edge) if v not in known])
