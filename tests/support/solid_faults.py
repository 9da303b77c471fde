"""Faults of faces and shells that are put into sound blended solids, of tolerances, and changes that do no harm."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from fault_places import (
    CHECKED_PARAMETERS,
    Fault,
    Rng,
    choose,
    choose_blend,
    choose_magnitude,
    choose_rail,
    choose_use,
    choose_vertex,
    drill,
    fault,
    find_strip,
    measure_gap,
    measure_speed,
    place_on_blend,
    put_into_both,
    put_pcurve,
    require,
    sample_pcurve,
)
from OCP.BRep import BRep_Tool
from OCP.BRepBuilderAPI import BRepBuilderAPI_Copy, BRepBuilderAPI_NurbsConvert
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeSphere
from OCP.BRepTools import BRepTools
from OCP.BRepTopAdaptor import BRepTopAdaptor_FClass2d
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Pnt2d, gp_Vec
from OCP.TopAbs import (
    TopAbs_FACE,
    TopAbs_FORWARD,
    TopAbs_IN,
    TopAbs_REVERSED,
)
from OCP.TopoDS import TopoDS, TopoDS_Edge
from solid_drafts import (
    BUILDER,
    FaceDraft,
    SolidDraft,
    get_pcurves,
    iterate,
    set_pcurves,
)

from cqblend.brep.conversion.spline_arrays import (
    surface_from_arrays,
    surface_to_arrays,
)
from cqblend.brep.topology import (
    explore_subshapes,
    find_end_vertices,
    make_edge,
    make_trimmed_copy,
    make_vertex,
)

# ---------------------------------------------------------------- shells


@fault("face flipped")
def flip_face(draft: SolidDraft, rng: Rng) -> None:
    face = choose(rng, [*draft.blends, *draft.trimmed])
    face.orientation = TopAbs_FORWARD if face.orientation == TopAbs_REVERSED else TopAbs_REVERSED


@fault("face flipped")
def turn_face_over(draft: SolidDraft, rng: Rng) -> None:
    """A face whose edges run as they should, but which covers what is outside of them."""
    face = choose(rng, [*draft.blends, *draft.trimmed])
    flip_sign = TopAbs_FORWARD if face.orientation == TopAbs_REVERSED else TopAbs_REVERSED
    face.orientation = flip_sign
    face.wires = [[TopoDS.Edge_s(edge.Reversed()) for edge in reversed(wire)] for wire in face.wires]


@fault("face missing")
def drop_face(draft: SolidDraft, rng: Rng) -> None:
    place = rng.uniform()
    draft.finish = lambda faces: [f for i, f in enumerate(faces) if i != int(place * len(faces))]


@fault("face twice")
def repeat_face(draft: SolidDraft, rng: Rng) -> None:
    """A changed face twice in the shell, or a copy of it on edges of its own."""
    count = len(draft.blends) + len(draft.trimmed)
    i, copied = int(rng.integers(count)), bool(rng.integers(2))
    draft.finish = lambda faces: [*faces, BRepBuilderAPI_Copy(faces[i]).Shape() if copied else faces[i]]


@fault("solid inside out")
def turn_inside_out(draft: SolidDraft, rng: Rng) -> None:
    draft.reversed = True


@fault("edge not shared")
def unshare_edge(draft: SolidDraft, rng: Rng) -> None:
    """A blend face with an edge of its own in the place of one that it should share."""
    edge, _, blend = choose_rail(draft, rng)
    blend.replace_edge(edge, make_trimmed_copy(edge, find_end_vertices(edge), BRep_Tool.Range_s(edge)))


# ---------------------------------------------------------------- folds, collisions, the wrong side


def reshape_inner_poles(draft: SolidDraft, rng: Rng, reshape: Callable[[np.ndarray, np.ndarray], None]) -> FaceDraft:
    """Change the poles of a blend surface but for its rails and ends; return its face.

    ``reshape`` gets the poles (nu, nv, 3) and a weight (nu, 1, 1) that rises from 0 at the ends to 1 in the middle.
    """
    blend, surface = choose_blend(draft, rng)
    surface.IncreaseDegree(max(surface.UDegree(), 7), max(surface.VDegree(), 3))
    degrees, knots, poles, weights = surface_to_arrays(surface)
    inner = np.sin(np.linspace(0, np.pi, len(poles) - 2))[:, None, None]
    reshape(poles[1:-1], inner)
    blend.replace_surface(surface_from_arrays(degrees, knots, poles, weights))
    return blend


def folds(blend: FaceDraft) -> bool:
    """Whether the normal of a surface flips between points of its face that are very near to each other.

    A normal that merely turns fast is not a fold.
    """
    u0, u1, v0, v1 = BRepTools.UVBounds_s(blend.build())
    surface, point, du, dv = BRep_Tool.Surface_s(blend.bare), gp_Pnt(), gp_Vec(), gp_Vec()

    def evaluate_normals(us: np.ndarray, vs: np.ndarray) -> np.ndarray:
        normals = []
        for u, v in zip(us.tolist(), vs.tolist(), strict=True):
            surface.D1(u, v, point, du, dv)
            normals.append(du.Crossed(dv).Coord())
        return np.array(normals)

    u, v = np.linspace(u0, u1, 122)[1:-1], np.linspace(v0, v1, 32)[1:-1]
    normals = evaluate_normals(np.repeat(u, 30), np.tile(v, 120)).reshape(120, 30, 3)
    for axis in (0, 1):
        first, second = (normals[1:], normals[:-1]) if axis == 0 else (normals[:, 1:], normals[:, :-1])
        for i, j in np.argwhere(np.sum(first * second, axis=-1) < 0.0)[:20].tolist():
            ends = np.array([[u[i], v[j]], [u[i + (axis == 0)], v[j + (axis == 1)]]])
            for _ in range(2):
                steps = ends[0] + np.linspace(0.0, 1.0, 17)[:, None] * (ends[1] - ends[0])
                between = evaluate_normals(*steps.T)
                turns = np.sum(between[1:] * between[:-1], axis=-1)
                if not (turns < 0.0).any():
                    break
                worst = int(turns.argmin())
                ends = steps[worst : worst + 2]
            else:
                return True
    return False


@fault("blend folds over")
def swap_inner_rows(draft: SolidDraft, rng: Rng) -> None:
    """Sections that run forth, back and forth again."""
    factor = float(rng.uniform(1.5, 4.0))

    def reshape(poles: np.ndarray, inner: np.ndarray) -> None:
        chord = poles[:, -1:] - poles[:, :1]
        half = poles.shape[1] // 2
        poles[:, 1:half] += factor * inner * chord
        poles[:, -half:-1] -= factor * inner * chord

    require(folds(reshape_inner_poles(draft, rng, reshape)))


@fault("blend folds over")
def swap_inner_columns(draft: SolidDraft, rng: Rng) -> None:
    """A surface that runs back along the edge for a while."""
    factor = float(rng.uniform(1.0, 3.0))

    def reshape(poles: np.ndarray, inner: np.ndarray) -> None:
        middle = len(poles) // 2
        step = poles[middle + 1, 1:-1] - poles[middle - 1, 1:-1]
        poles[middle - 1, 1:-1] += factor * step
        poles[middle + 1, 1:-1] -= factor * step

    require(folds(reshape_inner_poles(draft, rng, reshape)))


@fault("blend on the wrong side")
def push_blend_out(draft: SolidDraft, rng: Rng) -> None:
    """A blend that bulges beyond the edge: it adds what it was to remove, or the other way round."""
    factor = float(rng.uniform(4.0, 8.0))

    def reshape(poles: np.ndarray, inner: np.ndarray) -> None:
        chord = poles[:, -1:] - poles[:, :1]
        across = poles[:, 1:-1] - poles[:, :1]
        share = np.sum(across * chord, axis=-1, keepdims=True) / np.sum(chord * chord, axis=-1, keepdims=True)
        poles[:, 1:-1] += factor * inner * (across - share * chord)

    reshape_inner_poles(draft, rng, reshape)


@fault("blend on the wrong side")
def expect_the_opposite(draft: SolidDraft, rng: Rng) -> None:
    draft.grows = not draft.grows


@fault("blend runs through a wall")
def put_sphere_across(draft: SolidDraft, rng: Rng) -> None:
    """A round void that the blend cuts, or is at least 1e-9 mm inside of it."""
    point, normal, width = place_on_blend(draft, rng)
    radius = width * choose_magnitude(rng, 0.01, 0.2)
    centre = point + normal * radius * float(choose(rng, [0.0, 0.7, -0.7, 0.95]))
    put_into_both(draft, BRepPrimAPI_MakeSphere(gp_Pnt(*centre.tolist()), radius).Shape())


@fault("blend runs through a wall")
def put_block_across(draft: SolidDraft, rng: Rng) -> None:
    """A thin wall, or slot, right through the blend."""
    point, normal, width = place_on_blend(draft, rng)
    size = width * choose_magnitude(rng, 0.02, 0.15)
    direction = rng.normal(size=3)
    axes = gp_Ax2(
        gp_Pnt(*(point - normal * size * 0.3).tolist()), gp_Dir(*normal.tolist()), gp_Dir(*direction.tolist())
    )
    block = BRepPrimAPI_MakeBox(axes, size, 0.1 * size, size).Shape()
    put_into_both(draft, block)


@fault("blend runs through a wall")
def put_freeform_across(draft: SolidDraft, rng: Rng) -> None:
    """A round void as above, on spline surfaces."""
    point, normal, width = place_on_blend(draft, rng)
    radius = width * choose_magnitude(rng, 0.05, 0.2)
    centre = point + normal * radius * float(rng.uniform(-0.8, 0.8))
    put_into_both(
        draft, BRepBuilderAPI_NurbsConvert(BRepPrimAPI_MakeSphere(gp_Pnt(*centre.tolist()), radius).Shape()).Shape()
    )


def put_sphere_near(draft: SolidDraft, rng: Rng, side: float) -> None:
    """Put a round void, or a body, inside (-1) or outside (1) of the blended solid, very near to the blend."""
    point, normal, width = place_on_blend(draft, rng)
    radius, gap = 0.05 * width, width * choose_magnitude(rng, 1e-4, 1e-2)
    centre = point + normal * (radius + gap) * side
    sphere = BRepPrimAPI_MakeSphere(gp_Pnt(*centre.tolist()), radius).Shape()
    changed = [face.build() for face in [*draft.blends, *draft.trimmed]]
    walls = [*changed, *explore_subshapes(draft.before, TopAbs_FACE)]
    (surface,) = explore_subshapes(sphere, TopAbs_FACE)
    require(all(BRepExtrema_DistShapeShape(surface, wall).Value() > 1e-5 for wall in walls))
    put_into_both(draft, sphere)


@fault("void cut away")
def cut_sphere_off(draft: SolidDraft, rng: Rng) -> None:
    """A void in what the blend takes away, or a body in what it fills."""
    put_sphere_near(draft, rng, -1.0 if draft.grows else 1.0)


# ---------------------------------------------------------------- tolerances, vertices, edges


@fault("tolerance too loose")
def loosen_edge(draft: SolidDraft, rng: Rng) -> None:
    edge, _, _ = choose_rail(draft, rng)
    BUILDER.UpdateEdge(edge, choose_magnitude(rng, 3e-5, 1e-1))
    for vertex in find_end_vertices(edge):
        BUILDER.UpdateVertex(vertex, BRep_Tool.Tolerance_s(edge))


@fault("tolerance too loose")
def loosen_vertex(draft: SolidDraft, rng: Rng) -> None:
    BUILDER.UpdateVertex(choose_vertex(draft, rng), choose_magnitude(rng, 1e-2, 1e-1))


@fault("vertex off its edges")
def move_vertex(draft: SolidDraft, rng: Rng) -> None:
    vertex = choose_vertex(draft, rng)
    direction = rng.normal(size=3)
    step = direction / np.linalg.norm(direction) * choose_magnitude(rng, 1e-4, 1e-1)
    point = BRep_Tool.Pnt_s(vertex).Translated(gp_Vec(*step.tolist()))
    BUILDER.UpdateVertex(vertex, point, BRep_Tool.Tolerance_s(vertex))


@fault("edge of a wrong range or kind")
def mark_degenerate(draft: SolidDraft, rng: Rng) -> None:
    edge, _, _ = choose_rail(draft, rng)
    BUILDER.Degenerated(edge, True)


@fault("edge of a wrong range or kind")
def lengthen_range(draft: SolidDraft, rng: Rng) -> None:
    edge, _, _ = choose_rail(draft, rng)
    first, last = BRep_Tool.Range_s(edge)
    BUILDER.Range(edge, first, last + float(choose(rng, [-0.2, 0.01])) * (last - first))


def drop_space_curve(draft: SolidDraft, rng: Rng) -> None:
    """Take the curve in space away from a new edge; BRepCheck crashes on it, so it is not among the faults."""
    edge, face, blend = choose_rail(draft, rng)
    bare = TopoDS_Edge()
    BUILDER.MakeEdge(bare)
    for vertex in iterate(edge.Oriented(TopAbs_FORWARD)):
        BUILDER.Add(bare, vertex)
    for one in (face, blend):
        BUILDER.UpdateEdge(bare, *get_pcurves(edge, one.bare), one.bare, BRep_Tool.Tolerance_s(edge))
        one.replace_edge(edge, bare)
    BUILDER.Range(bare, *BRep_Tool.Range_s(edge))


@fault("edge shorter than its tolerance")
def split_off_nothing(draft: SolidDraft, rng: Rng) -> None:
    """A rail with a vertex so near to its end that the piece between them is shorter than the tolerance."""
    edge, face, blend = choose_rail(draft, rng)
    (first, last), (start, stop) = BRep_Tool.Range_s(edge), find_end_vertices(edge)
    curve, point, tangent = BRep_Tool.Curve_s(edge, 0.0, 0.0), gp_Pnt(), gp_Vec()
    curve.D1(first, point, tangent)
    cut = first + choose_magnitude(rng, 1e-9, 5e-8) / tangent.Magnitude()
    vertex = make_vertex(np.array(curve.Value(cut).Coord()))
    pieces = (
        make_trimmed_copy(edge, (start, vertex), (first, cut)),
        make_trimmed_copy(edge, (vertex, stop), (cut, last)),
    )
    for one in (face, blend):
        for wire in one.wires:
            for i, use in enumerate(wire):
                if use.IsSame(edge):
                    forward = use.Orientation() == TopAbs_FORWARD
                    ordered = pieces if forward else pieces[::-1]
                    wire[i : i + 1] = [TopoDS.Edge_s(piece.Oriented(use.Orientation())) for piece in ordered]
                    break


@fault("seam with one pcurve")
def drop_seam_pcurve(draft: SolidDraft, rng: Rng) -> None:
    """The seam of a closed blend, known to its surface by one curve only."""
    seams = [(e, f) for f in draft.blends for e in draft.list_new_edges(f) if BRep_Tool.IsClosed_s(e, f.bare)]
    seam, blend = choose(rng, seams)
    single = make_edge(BRep_Tool.Curve_s(seam, 0.0, 0.0), find_end_vertices(seam), BRep_Tool.Range_s(seam))
    set_pcurves(single, blend.bare, get_pcurves(seam, blend.bare)[0])
    blend.replace_edge(seam, single)


# ---------------------------------------------------------------- what leaves a solid sound


def rebuild(draft: SolidDraft, rng: Rng) -> None:
    """Copy all that is new, and change nothing."""


def drill_beside_rail(draft: SolidDraft, rng: Rng) -> None:
    """A hole near the line at which a face is trimmed."""
    face, place, way = find_strip(draft, rng)
    radius = 0.25 * float(np.linalg.norm(way))
    centre = place - 1.3 * radius * way / np.linalg.norm(way)
    trimmed = BRepTopAdaptor_FClass2d(face.build(), 1e-9)
    around = [centre + 1.2 * radius * np.array([np.cos(a), np.sin(a)]) for a in np.linspace(0, 6, 13).tolist()]
    require(all(trimmed.Perform(gp_Pnt2d(*point.tolist())) == TopAbs_IN for point in around))
    drill(draft, face, centre, radius)


def put_sphere_beside(draft: SolidDraft, rng: Rng) -> None:
    """A round void that nearly touches the blend."""
    put_sphere_near(draft, rng, 1.0 if draft.grows else -1.0)


def roughen_within_tolerance(draft: SolidDraft, rng: Rng) -> None:
    """A pcurve that strays from its edge, which has the tolerance that this takes."""
    edge, face = choose_use(draft, rng)
    t, uv = sample_pcurve(edge, face, 4 * CHECKED_PARAMETERS - 3)
    wave = np.tile([0.0, 0.7, 1.0, 0.7, 0.0, -0.7, -1.0, -0.7], CHECKED_PARAMETERS)[: len(t)]
    put_pcurve(edge, face, t, uv + wave[:, None] * choose_magnitude(rng, 1e-6, 1e-4) / measure_speed(edge, face))
    tolerance = max(1.1 * measure_gap(edge, face), BRep_Tool.Tolerance_s(edge))
    draft.tolerance = max(draft.tolerance, 1.1 * tolerance)
    BUILDER.UpdateEdge(edge, tolerance)
    for vertex in find_end_vertices(edge):
        BUILDER.UpdateVertex(vertex, 2 * tolerance)


VARIATIONS: tuple[Fault, ...] = (rebuild, drill_beside_rail, put_sphere_beside, roughen_within_tolerance)
"""Functions that leave a draft sound."""
