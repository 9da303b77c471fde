"""Whether blends add material where they are to add it, and remove it where they are to remove it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools
from OCP.gp import gp_Pnt, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FORWARD, TopAbs_IN, TopAbs_OUT, TopAbs_REVERSED
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape

from cqblend.brep.measurement.nearest_side import measure_height
from cqblend.brep.topology import (
    BUILDER,
    CONFUSION,
    ShapeIndex,
    drop_duplicate_shapes,
    explore_subshapes,
    make_closed_wire,
    make_compound,
)
from cqblend.brep.verification.replaced_faces import Check, ReplacedFaces, ReplacementProblem
from cqblend.brep.verification.slim_faces import ChangedPart, list_changed_parts
from cqblend.brep.verification.surface_distance import find_distance
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.brep.verification.volumes import compute_bounds, measure_volume

_SHARES = ((0.15, 0.3), (0.15, 0.7), (0.5, 0.5), (0.85, 0.3), (0.85, 0.7))
"""Shares of the ranges of u and v at which points of a new face are looked at."""

_START_SHARES = (0.1, 0.3, 0.5, 0.7, 0.9)
"""Shares of the range of an edge at which feet of points are looked for first."""


def find_wrong_sides(replaced: ReplacedFaces, grows: bool | Sequence[bool | None]) -> list[ReplacementProblem]:
    """Return a problem for all new faces where the volume changed in the wrong direction.

    Where all points of a new face that are looked at lie on the wanted side of the old solid, it is taken to be right;
    of the others the change of volume is measured, together with that of new faces that changed the same wires. If
    these are to change it in different directions, or it is not known of one, nothing can be said. A shell has no
    volume: there, all points must lie so. ``grows`` tells whether material is to be added, by all new faces or by each,
    None of one of which that is not known.
    """
    everything = tuple(range(len(replaced.new_faces)))
    wanted = [grows] * len(everything) if isinstance(grows, bool) else list(grows)
    faces = zip(replaced.new_faces, wanted, strict=True)
    doubtful = [
        i for i, (face, grow) in enumerate(faces) if grow is not None and not _is_on_wanted_side(replaced, face, grow)
    ]
    if everything and not doubtful:
        return []
    if not replaced.bounds_solid:
        wrong = "the blend is not on the side of the shell where it was to be"
        return [ReplacementProblem(wrong, Check.VOLUME, (i,), (replaced.new_faces[i],)) for i in doubtful]
    parts = list_changed_parts(replaced, whole_wires=True)
    matched = drop_duplicate_shapes(part.old_face for part in parts if part.old_face is not None)
    if len(everything) < 2 or len(matched) < len(replaced.old):
        groups = [(make_compound([*replaced.new, *_reverse(replaced.old)]), everything)]
    else:
        groups = []
        for i in doubtful:
            if not any(i in together for _, together in groups):
                groups.append(_enclose_change(replaced, i, parts))
    problems = []
    for between, together in groups:
        directions = {wanted[i] for i in together} if together else {grows}
        is_known = len(directions) == 1 and None not in directions
        line = _check_volume_change(between, directions == {True}) if is_known else None
        if line:
            shapes = tuple(replaced.new_faces[i] for i in together)
            problems.append(ReplacementProblem(line, Check.VOLUME, together, shapes))
    return problems


def _is_on_wanted_side(replaced: ReplacedFaces, face: TopoDS_Face, grows: bool) -> bool:
    """Whether points of a new face lie strictly outside the old solid, if it was to grow, or inside it.

    They do if they lie so beside each of the faces that the new one is tangent to; otherwise OCCT tells, or, of a
    shell, the nearest of its faces.
    """
    u0, u1, v0, v1 = BRepTools.UVBounds_s(face)
    surface = BRep_Tool.Surface_s(face)
    points = [surface.Value(u0 + u * (u1 - u0), v0 + v * (v1 - v0)) for u, v in _SHARES]
    supports = _find_supports(replaced, face)
    if len(supports) > 1 and all(_lie_beside(points, *support, grows) for support in supports):
        return True
    if not replaced.bounds_solid:
        heights = [measure_height(np.array(point.Coord()), replaced.old) for point in points]
        return all(height > CONFUSION if grows else height < -CONFUSION for height in heights)
    wanted = TopAbs_OUT if grows else TopAbs_IN
    classifier = BRepClass3d_SolidClassifier(replaced.before)
    for point in points:
        classifier.Perform(point, CONFUSION)
        if classifier.State() != wanted:
            return False
    return True


def _find_supports(replaced: ReplacedFaces, face: TopoDS_Face) -> list[tuple[TopoDS_Face, TopoDS_Edge]]:
    """Return the faces, new ones left out, that a new one is tangent to, with the edge at which it is."""
    found = []
    for use in explore_subshapes(face, TopAbs_EDGE):
        for other in replaced.faces_of_edge(use):
            if other in replaced.added_faces or BRep_Tool.Degenerated_s(use):
                continue
            normals = [_find_normal(one, _find_middle(use, one)) for one in (face, other)]
            if abs(normals[0].Dot(normals[1])) > VERIFICATION_TOLERANCES.tangent_cosine:
                found.append((other, use))
    return found


def _find_middle(use: TopoDS_Edge, face: TopoDS_Face) -> tuple[float, float]:
    """Return the parameters on a face of the middle of an edge."""
    pcurve, (first, last) = BRep_Tool.CurveOnSurface_s(use, face, 0.0, 0.0), BRep_Tool.Range_s(use, face)
    found: tuple[float, float] = pcurve.Value((first + last) / 2).Coord()
    return found


def _find_normal(face: TopoDS_Face, uv: tuple[float, float]) -> gp_Vec:
    """Return the outward unit normal of a face; a null vector where it has none."""
    point, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    BRep_Tool.Surface_s(face).D1(*uv, point, du, dv)
    normal = du.Crossed(dv)
    size = normal.Magnitude()
    return normal.Multiplied((-1.0 if face.Orientation() == TopAbs_REVERSED else 1.0) / size) if size else gp_Vec()


def _lie_beside(points: list[gp_Pnt], face: TopoDS_Face, edge: TopoDS_Edge, grows: bool) -> bool:
    """Whether points, near to an edge of a face, lie outside (or inside) of its surface."""
    surface, side = BRep_Tool.Surface_s(face), 1.0 if grows else -1.0
    measure = find_distance(surface)
    if measure is None:
        return all(side * _measure_height(point, face, edge) > CONFUSION for point in points)
    middle = _find_middle(edge, face)
    foot, normal = (np.array(one.Coord()) for one in (surface.Value(*middle), _find_normal(face, middle)))
    places = np.array([point.Coord() for point in points])
    outwards = float(measure((foot + CONFUSION * normal)[None])[0] - measure((foot - CONFUSION * normal)[None])[0])
    return bool((side * np.sign(outwards) * measure(places) > CONFUSION).all())


def _measure_height(point: gp_Pnt, face: TopoDS_Face, edge: TopoDS_Edge) -> float:
    """Return how far (mm) a point is outside of the tangent plane at its foot on a face, which is near an edge.

    0 if there is no foot to be found.
    """
    surface = BRep_Tool.Surface_s(face)
    pcurve, (first, last) = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0), BRep_Tool.Range_s(edge, face)
    starts = [pcurve.Value(first + share * (last - first)).Coord() for share in _START_SHARES]
    u, v = min(starts, key=lambda uv: surface.Value(*uv).SquareDistance(point))
    foot, du, dv = gp_Pnt(), gp_Vec(), gp_Vec()
    for _ in range(VERIFICATION_TOLERANCES.most_foot_steps):
        surface.D1(u, v, foot, du, dv)
        way = gp_Vec(foot, point)
        a, b, c = du.Dot(du), du.Dot(dv), dv.Dot(dv)
        determinant = a * c - b * b
        if not determinant > 0.0:
            return 0.0
        x, y = du.Dot(way), dv.Dot(way)
        step = ((c * x - b * y) / determinant, (a * y - b * x) / determinant)
        u, v = u + step[0], v + step[1]
        moved = du.Multiplied(step[0]).Added(dv.Multiplied(step[1])).Magnitude()
        if moved <= VERIFICATION_TOLERANCES.foot_accuracy * way.Magnitude():
            return float(_find_normal(face, (u, v)).Dot(gp_Vec(surface.Value(u, v), point)))
    return 0.0


def _enclose_change(
    replaced: ReplacedFaces, number: int, parts: list[ChangedPart]
) -> tuple[TopoDS_Shape, tuple[int, ...]]:
    """Return faces that enclose what a new face changed, and the new faces that changed the same parts of others.

    They are these new faces, the wires that others have gained, filled, and, reversed, those that they have lost.
    """
    together, found = {number}, list[ChangedPart]()
    while True:
        edges = ShapeIndex(make_compound(replaced.new_faces[i] for i in together), TopAbs_EDGE)
        touched = [part for part in parts if any(use in edges for use in part.uses)]
        if len(touched) == len(found):
            break
        found = touched
        borders = ShapeIndex(make_compound(use for part in found for use in part.uses), TopAbs_EDGE)
        together |= {
            i
            for i, face in enumerate(replaced.new_faces)
            if any(edge in borders for edge in ShapeIndex(face, TopAbs_EDGE))
        }
    faces: list[TopoDS_Shape] = []
    for part in found:
        if part.old_face is None:
            faces.append(part.face)
        else:
            orientation = part.face.Orientation()
            faces.append(_bound_face(part.face, part.uses).Oriented(orientation))
            faces.append(_bound_face(part.face, part.old_uses).Oriented(orientation).Reversed())
    return make_compound(faces), tuple(sorted(together))


def _bound_face(face: TopoDS_Face, uses: tuple[TopoDS_Edge, ...]) -> TopoDS_Face:
    """Return a FORWARD face on the surface of another, bounded by edges of closed wires, put into one."""
    bounded = TopoDS.Face_s(face.Oriented(TopAbs_FORWARD).EmptyCopied())
    BUILDER.Add(bounded, make_closed_wire(uses))
    return bounded


def _reverse(faces: list[TopoDS_Face]) -> list[TopoDS_Shape]:
    return [face.Reversed() for face in faces]


def _check_volume_change(between: TopoDS_Shape, grows: bool) -> str | None:
    """Return a line if a volume has the wrong sign, by more than integration may err.

    It is enclosed by new faces and old ones, reversed, but for gaps at edges, which lie on their faces to a tolerance
    only. ``grows`` tells whether material was to be added.
    """
    low, high = compute_bounds(between)
    gap_volume = float(np.linalg.norm(high - low)) * sum(map(_estimate_gap_area, ShapeIndex(between, TopAbs_EDGE)))
    for accuracy in VERIFICATION_TOLERANCES.volume_changes:
        change, error = measure_volume(between, accuracy=accuracy)
        if abs(change) > gap_volume + 3 * error + 10 * accuracy * float((high - low).prod()):
            break
    else:
        return None
    if (change > 0) == grows:
        return None
    verb, kind = ("fell", "add") if grows else ("rose", "remove")
    return f"the volume {verb} by {abs(change):.3g} mm^3, but the blend was to {kind} material"


def _estimate_gap_area(edge: TopoDS_Shape) -> float:
    """Return the area (mm^2) of the gap at an edge: its tolerance times its length, 0 at OCCT's own tolerance."""
    tolerance = BRep_Tool.Tolerance_s(TopoDS.Edge_s(edge))
    if tolerance <= 2 * CONFUSION:
        return 0.0
    properties = GProp_GProps()
    BRepGProp.LinearProperties_s(edge, properties)
    return float(tolerance * properties.Mass())
