"""Faults of boundaries that are put into sound blended solids: gaps, wrong pcurves, wires that cross or are open."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from fault_places import (
    CHECKED_PARAMETERS,
    NotApplicableError,
    Rng,
    choose,
    choose_blend,
    choose_magnitude,
    choose_rail,
    choose_use,
    drill,
    fault,
    find_plane,
    find_strip,
    get_normal,
    measure_gap,
    measure_speed,
    move_poles,
    put_pcurve,
    require,
    sample_pcurve,
)
from OCP.BRep import BRep_Tool
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.Geom import Geom_BSplineSurface, Geom_Curve, Geom_Plane, Geom_TrimmedCurve
from OCP.GeomConvert import GeomConvert
from OCP.gp import gp_Pnt2d, gp_Vec2d
from OCP.TopAbs import (
    TopAbs_OUT,
)
from OCP.TopoDS import TopoDS, TopoDS_Face
from solid_drafts import (
    BUILDER,
    SolidDraft,
    get_pcurves,
    set_pcurves,
)

from cqblend.brep.conversion.spline_arrays import (
    curve2d_from_arrays,
    curve_from_arrays,
    curve_to_arrays,
    surface_from_arrays,
    surface_to_arrays,
)

# ---------------------------------------------------------------- gaps


@fault("gap at a rail")
def lift_rail_row(draft: SolidDraft, rng: Rng) -> None:
    """The poles of the blend surface along a rail are off, its ends are not."""
    blend, surface = choose_blend(draft, rng)
    row = int(choose(rng, [0, surface.NbVPoles() - 1]))
    share = float(row > 0)
    shift = get_normal(surface, 0.5, share)[1] * choose_magnitude(rng, 1e-5, 1e-1)
    lines = slice(2, -2) if surface.NbUPoles() > 5 else slice(1, -1) if surface.NbUPoles() > 2 else slice(0, 1)
    blend.replace_surface(move_poles(surface, lines, slice(row, row + 1), shift))


@fault("gap at an end curve")
def lift_end_column(draft: SolidDraft, rng: Rng) -> None:
    """The poles of the blend surface across an end are off, the rails are not."""
    blend, surface = choose_blend(draft, rng)
    if surface.NbVPoles() < 3:
        raise NotApplicableError
    first = bool(rng.integers(2))
    shift = get_normal(surface, 0.0 if first else 1.0, 0.5)[1] * choose_magnitude(rng, 1e-4, 1e-1)
    lines = slice(0, 1) if first else slice(surface.NbUPoles() - 1, None)
    blend.replace_surface(move_poles(surface, lines, slice(1, -1), shift))
    require(max(measure_gap(edge, blend) for edge in blend.list_edges()) > 2e-5)


@fault("gap between the parameters that BRepCheck looks at")
def bulge_rail_row_between(draft: SolidDraft, rng: Rng) -> None:
    """A narrow bulge of the blend surface at a rail."""
    blend, surface = choose_blend(draft, rng)
    u0, u1, _, _ = surface.Bounds()
    step = (u1 - u0) / (CHECKED_PARAMETERS - 1)
    start = u0 + step * (int(rng.integers(3, CHECKED_PARAMETERS - 4)) + 0.1)
    for share in np.linspace(0.0, 0.8, 2 * surface.UDegree() + 2).tolist():
        surface.InsertUKnot(start + share * step, 1, 0.0)
    degrees, knots, poles, weights = surface_to_arrays(surface)
    inside = (knots[0][: len(poles)] >= start - 1e-9) & (knots[0][-len(poles) :] <= start + 0.8 * step + 1e-9)
    row = int(choose(rng, [0, poles.shape[1] - 1]))
    _, normal = get_normal(surface, (start + 0.4 * step - u0) / (u1 - u0), float(row > 0))
    poles[inside, row] += normal * choose_magnitude(rng, 1e-3, 1e-1)
    blend.replace_surface(surface_from_arrays(degrees, knots, poles, weights))
    require(max(measure_gap(edge, blend) for edge in blend.list_edges()) > 2e-5)


def to_spline(curve: Geom_Curve, span: tuple[float, float]):
    """Return a curve over a range as arrays of a spline, with at least six poles."""
    spline = GeomConvert.CurveToBSplineCurve_s(Geom_TrimmedCurve(curve, *span))
    if spline.Degree() < 5:
        spline.IncreaseDegree(5)
    return curve_to_arrays(spline)


@fault("gap at a rail")
def bend_edge_curve(draft: SolidDraft, rng: Rng) -> None:
    """The curve in space of a new edge leaves both of its faces."""
    edge, _, _ = choose_rail(draft, rng)
    degree, knots, poles, weights = to_spline(BRep_Tool.Curve_s(edge, 0.0, 0.0), BRep_Tool.Range_s(edge))
    direction = rng.normal(size=3)
    poles[2:-2] += direction / np.linalg.norm(direction) * choose_magnitude(rng, 1e-4, 1e-1)
    BUILDER.UpdateEdge(edge, curve_from_arrays(degree, knots, poles, weights), BRep_Tool.Tolerance_s(edge))


# ---------------------------------------------------------------- wrong pcurves


@fault("pcurve shifted")
def shift_pcurve(draft: SolidDraft, rng: Rng) -> None:
    edge, face = choose_use(draft, rng)
    angle = rng.uniform(0, 2 * np.pi)
    step = np.array([np.cos(angle), np.sin(angle)]) * choose_magnitude(rng, 1e-4, 1e-1) / measure_speed(edge, face)
    (pcurve,) = get_pcurves(edge, face.bare)
    set_pcurves(edge, face.bare, pcurve.Translated(gp_Vec2d(*step.tolist())))


@fault("pcurve reversed")
def reverse_pcurve(draft: SolidDraft, rng: Rng) -> None:
    edge, face = choose_use(draft, rng)
    t, uv = sample_pcurve(edge, face, 65)
    put_pcurve(edge, face, t, uv[::-1])


@fault("pcurve of another edge")
def swap_pcurves(draft: SolidDraft, rng: Rng) -> None:
    face = choose(rng, [*draft.blends, *draft.trimmed])
    edges = [e for e in draft.list_new_edges(face) if not BRep_Tool.IsClosed_s(e, face.bare)]
    if len(edges) < 2:
        raise NotApplicableError
    first, second = (edges[int(i)] for i in rng.choice(len(edges), 2, replace=False))
    (t, _), (_, uv) = sample_pcurve(first, face, 65), sample_pcurve(second, face, 65)
    put_pcurve(first, face, t, uv)


@fault("pcurve coarse between the parameters that BRepCheck looks at")
def roughen_pcurve(draft: SolidDraft, rng: Rng) -> None:
    """A pcurve that meets the edge at 23 parameters, and waves in between."""
    edge, face = choose_use(draft, rng)
    t, uv = sample_pcurve(edge, face, 4 * CHECKED_PARAMETERS - 3)
    size = choose_magnitude(rng, 1e-4, 3e-2) / measure_speed(edge, face)
    angle = rng.uniform(0, 2 * np.pi)
    wave = np.tile([0.0, 0.7, 1.0, 0.7, 0.0, -0.7, -1.0, -0.7], CHECKED_PARAMETERS)[: len(t)]
    put_pcurve(edge, face, t, uv + wave[:, None] * size * [np.cos(angle), np.sin(angle)])


@fault("pcurve coarse between the parameters that BRepCheck looks at")
def kink_pcurve_once(draft: SolidDraft, rng: Rng) -> None:
    """A pcurve that strays between two of the 23 parameters, and nowhere else."""
    edge, face = choose_use(draft, rng)
    t, uv = sample_pcurve(edge, face, 40 * (CHECKED_PARAMETERS - 1) + 1)
    place = int(rng.integers(1, CHECKED_PARAMETERS - 2))
    wave = np.zeros(len(t))
    wave[40 * place + 8 : 40 * place + 33] = np.sin(np.linspace(0, np.pi, 25)) ** 4
    angle = rng.uniform(0, 2 * np.pi)
    size = choose_magnitude(rng, 1e-3, 1e-1) / measure_speed(edge, face)
    put_pcurve(edge, face, t, uv + wave[:, None] * size * [np.cos(angle), np.sin(angle)])


@fault("pcurve bulged")
def bulge_pcurve(draft: SolidDraft, rng: Rng) -> None:
    edge, face = choose_use(draft, rng)
    t, uv = sample_pcurve(edge, face, 65)
    bulge = np.sin(np.linspace(0, np.pi, 65)) ** 2 * choose_magnitude(rng, 1e-4, 3e-1)
    angle = rng.uniform(0, 2 * np.pi)
    put_pcurve(edge, face, t, uv + bulge[:, None] / measure_speed(edge, face) * [np.cos(angle), np.sin(angle)])


@fault("pcurve missing")
def drop_pcurve(draft: SolidDraft, rng: Rng) -> None:
    """The face gets another surface object: the edges know nothing of it but for those that are told."""
    edge, face = choose_use(draft, rng)
    old, face.bare = face.bare, TopoDS_Face()
    BUILDER.MakeFace(face.bare, BRep_Tool.Surface_s(old).Copy(), BRep_Tool.Tolerance_s(old))
    if isinstance(BRep_Tool.Surface_s(old), Geom_Plane):  # of planes, OCCT works pcurves out
        raise NotApplicableError
    for other in face.list_edges():
        if not other.IsSame(edge):
            set_pcurves(other, face.bare, *get_pcurves(other, old))


@fault("pcurve off by a period")
def shift_pcurve_by_period(draft: SolidDraft, rng: Rng) -> None:
    places = [
        (edge, face)
        for face in [*draft.blends, *draft.trimmed]
        if BRep_Tool.Surface_s(face.bare).IsUPeriodic()
        for edge in draft.list_new_edges(face)
        if not BRep_Tool.IsClosed_s(edge, face.bare) and len(face.wires[0]) > 1
    ]
    edge, face = choose(rng, places)
    period = BRep_Tool.Surface_s(face.bare).UPeriod()
    (pcurve,) = get_pcurves(edge, face.bare)
    set_pcurves(edge, face.bare, pcurve.Translated(gp_Vec2d(period, 0.0)))


# ---------------------------------------------------------------- wires that cross


def bend_rail(draft: SolidDraft, rng: Rng, bend: Callable[[np.ndarray, np.ndarray], None]) -> np.ndarray:
    """Move the inner poles of a rail in the plane it runs on: edge, pcurves and blend surface stay together.

    ``bend`` changes the poles (n, 2) in the plane; it gets the outward direction as well. Returns points (n, 2) of the
    rail.
    """
    edge, face, blend = find_plane(draft, rng)
    surface = BRep_Tool.Surface_s(blend.bare)
    (pcurve,) = get_pcurves(edge, blend.bare)
    span = BRep_Tool.Range_s(edge)
    ends = np.array([pcurve.Value(t).Coord() for t in span])
    if not isinstance(surface, Geom_BSplineSurface) or abs(np.ptp(ends[:, 1])) > 1e-12:
        raise NotApplicableError
    surface = surface.Copy()
    if surface.UDegree() < 5:
        surface.IncreaseDegree(5, surface.VDegree())
    degrees, knots, poles, weights = surface_to_arrays(surface)
    row = 0 if abs(ends[0, 1] - surface.Bounds()[2]) < 1e-9 else -1
    position = BRep_Tool.Surface_s(face.bare).Position()
    origin, x, y = (np.array(p.Coord()) for p in (position.Location(), position.XDirection(), position.YDirection()))
    flat = np.stack(((poles[:, row] - origin) @ x, (poles[:, row] - origin) @ y), axis=-1)
    inward = np.stack(((poles - origin) @ x, (poles - origin) @ y), axis=-1)
    outward = flat.mean(0) - inward.reshape(-1, 2).mean(0)
    bend(flat, outward / np.linalg.norm(outward))
    poles[:, row] = origin + flat[:, :1] * x + flat[:, 1:] * y
    blend.replace_surface(surface_from_arrays(degrees, knots, poles, weights))
    line = None if weights is None else weights[:, row]
    BUILDER.UpdateEdge(edge, curve_from_arrays(degrees[0], knots[0], poles[:, row], line), BRep_Tool.Tolerance_s(edge))
    set_pcurves(edge, face.bare, curve2d_from_arrays(degrees[0], knots[0], flat, line))
    require(abs(ends[0, 0] - span[0]) < 1e-9)
    return sample_pcurve(edge, face, 401)[1]


def crosses_itself(points: np.ndarray) -> bool:
    """Whether two segments of a polygon (n, 2) cross that are no neighbours."""
    start, step = points[:-1], np.diff(points, axis=0)
    apart = start[None] - start[:, None]
    sine = step[:, None, 0] * step[None, :, 1] - step[:, None, 1] * step[None, :, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = [
            (apart[..., 0] * one[..., 1] - apart[..., 1] * one[..., 0]) / sine for one in (step[None], step[:, None])
        ]
    inside = np.logical_and.reduce([(share > 0.0) & (share < 1.0) for share in shares])
    return bool(np.triu(inside, 2).any())


@fault("boundary crosses itself")
def loop_rail(draft: SolidDraft, rng: Rng) -> None:
    """A rail that makes a loop in the plane it runs on."""

    def bend(flat: np.ndarray, outward: np.ndarray) -> None:
        along = flat[-1] - flat[0] if np.ptp(flat[[0, -1]], axis=0).any() else np.array([-outward[1], outward[0]])
        size = float(rng.uniform(1.5, 4.0)) * np.linalg.norm(along) / 3
        along = along / np.linalg.norm(along)
        middle = len(flat) // 2
        flat[middle - 1] += size * (along + 0.5 * outward)
        flat[middle] += size * (-along + 0.5 * outward)

    require(crosses_itself(bend_rail(draft, rng, bend)))


@fault("boundary crosses another edge")
def push_rail_across_face(draft: SolidDraft, rng: Rng) -> None:
    """A rail that runs beyond the other side of its face."""

    def bend(flat: np.ndarray, outward: np.ndarray) -> None:
        flat[2:-2] += outward * float(rng.uniform(60, 200))

    bend_rail(draft, rng, bend)


@fault("hole across a rail")
def drill_across_rail(draft: SolidDraft, rng: Rng) -> None:
    """A hole through the line at which a face is trimmed."""
    face, place, way = find_strip(draft, rng)
    drill(draft, face, place + way * float(rng.uniform(-0.15, 0.15)), 0.25 * float(np.linalg.norm(way)))


@fault("hole cut away")
def drill_into_strip(draft: SolidDraft, rng: Rng) -> None:
    """A hole in what is trimmed off a face: its wire is left outside."""
    face, place, way = find_strip(draft, rng)
    centre = place + way * float(rng.uniform(0.6, 0.8))
    require(BRepTopAdaptor_FClass2d(face.build(), 1e-9).Perform(gp_Pnt2d(*centre.tolist())) == TopAbs_OUT)
    drill(draft, face, centre, 0.25 * float(np.linalg.norm(way)))


@fault("boundary open")
def drop_edge_use(draft: SolidDraft, rng: Rng) -> None:
    """A wire without one of its edges, in one face only."""
    face = choose(rng, [f for f in [*draft.blends, *draft.trimmed] if len(f.wires[0]) > 2])
    del face.wires[0][int(rng.integers(len(face.wires[0])))]


@fault("edge turned in its wire")
def turn_edge_use(draft: SolidDraft, rng: Rng) -> None:
    face = choose(rng, [f for f in [*draft.blends, *draft.trimmed] if len(f.wires[0]) > 2])
    i = int(rng.integers(len(face.wires[0])))
    face.wires[0][i] = TopoDS.Edge_s(face.wires[0][i].Reversed())


@fault("edge or wire used twice")
def repeat_edge_use(draft: SolidDraft, rng: Rng) -> None:
    face = choose(rng, [*draft.blends, *draft.trimmed])
    wire = choose(rng, face.wires)
    wire.insert(1, choose(rng, wire))


@fault("edge or wire used twice")
def repeat_wire(draft: SolidDraft, rng: Rng) -> None:
    face = choose(rng, [*draft.blends, *draft.trimmed])
    face.wires.append(list(choose(rng, face.wires)))
