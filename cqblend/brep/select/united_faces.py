"""Seeing through splits: where a face goes on in a neighbour on the same surface, both are made one before a blend.

Unions that were not cleaned and files of other systems leave such faces: coplanar ones, the two halves of a cylinder.
Only those that a blend touches are made one. All other faces, and all edges that remain, are the very same objects as
before, but those around curved faces that are made one, which get copies.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Curve, BRepAdaptor_Surface
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools_History, BRepTools_ReShape
from OCP.Geom import Geom_RectangularTrimmedSurface, Geom_Surface
from OCP.GeomAbs import GeomAbs_Plane
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.GProp import GProp_GProps
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_ShapeEnum, TopAbs_SOLID, TopAbs_VERTEX
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex

from cqblend.brep.measure.edge_continuity import measure_continuity_between
from cqblend.brep.select.edge_joint import SMOOTH_ANGLE, Joint
from cqblend.brep.shape_kinds import downcast_shape
from cqblend.brep.topology import (
    CONFUSION,
    AncestorMap,
    ShapeIndex,
    drop_duplicate_shapes,
    explore_subshapes,
    find_end_vertices,
    find_seam_edges,
    make_trimmed_copy,
    orient_forward,
)

REACH_MARGIN = 1.1  # how much further than its rails a blend may touch something
AREA_TOLERANCE = 1e-4  # relative: OCCT integrates spline faces at few points
SAMPLES_ALONG_EDGE = 9  # along an edge
PARALLEL_ANGLE = 1e-9  # rad, between the normals of planes, the axes of cylinders that are the same


ShapeReplacements = list[tuple[TopoDS_Shape, list[TopoDS_Shape]]]
"""New faces or edges, and for each of them those in whose place it is."""


@dataclass(frozen=True)
class UnifiedSolid:
    """A solid in which faces on the same surface are one, and the faces and edges of it that are new."""

    solid: TopoDS_Shape
    face_replacements: ShapeReplacements
    edge_replacements: ShapeReplacements


def unify_faces(joint: Joint, reach: Callable[[], float]) -> UnifiedSolid | None:
    """Make the faces at a joint one with their neighbours on the same surface, as far as a blend touches them.

    These faces are its sides and those at its ends; the edge to the neighbour is no further than ``reach`` (mm) from
    the joint. Returns None where there is nothing to be made one, or where that would not be sound.
    """
    solid, spine, made = joint.solid, joint.spine.edges, None
    faces_at = AncestorMap(solid, TopAbs_VERTEX, TopAbs_FACE)
    faces = drop_duplicate_shapes(
        face for edge in spine for vertex in find_end_vertices(edge) for face in faces_at(vertex)
    )
    far: float | None = None

    def is_near(shape: TopoDS_Shape) -> bool:
        nonlocal far
        far = REACH_MARGIN * reach() if far is None else far
        return any(BRepExtrema_DistShapeShape(shape, edge).Value() <= far for edge in joint.spine.edges)

    while splits := _find_split_edges(solid, faces, spine, is_near):
        done = _merge_faces(solid, splits, spine, is_near)
        if done is None:
            break
        remade = [TopoDS.Edge_s(_find_descendant(done.edge_replacements, edge)) for edge in spine]
        if _has_end_on_seam(done, remade):
            break
        solid, spine = done.solid, remade
        faces = drop_duplicate_shapes(_find_descendant(done.face_replacements, face) for face in faces)
        if made is not None:
            done = UnifiedSolid(
                solid,
                _compose_replacements(made.face_replacements, done.face_replacements),
                _compose_replacements(made.edge_replacements, done.edge_replacements),
            )
        made = done
    return made


def _has_end_on_seam(made: UnifiedSolid, spine: Sequence[TopoDS_Edge]) -> bool:
    """Whether a joint would end at the seam of a face made one, where other faces are, too: none ends there."""
    faces_at = AncestorMap(made.solid, TopAbs_VERTEX, TopAbs_FACE)
    meeting = [
        vertex
        for face, _ in made.face_replacements
        for seam in find_seam_edges(face)
        for vertex in find_end_vertices(seam)
    ]
    return any(
        _is_among(vertex, meeting) and len(faces_at(vertex)) > 2 for edge in spine for vertex in find_end_vertices(edge)
    )


def _find_descendant(groups: ShapeReplacements, shape: TopoDS_Shape) -> TopoDS_Shape:
    return next((new for new, old in groups if _is_among(shape, old)), shape)


def _compose_replacements(first: ShapeReplacements, then: ShapeReplacements) -> ShapeReplacements:
    """Return two steps as one."""
    groups = []
    for new, old in then:
        roots = [next((roots for shape, roots in first if shape.IsSame(one)), [one]) for one in old]
        groups.append((new, [shape for some in roots for shape in some]))
    used = [shape for _, old in then for shape in old]
    return groups + [group for group in first if not _is_among(group[0], used)]


def _is_among(shape: TopoDS_Shape, shapes: Sequence[TopoDS_Shape]) -> bool:
    return any(shape.IsSame(one) for one in shapes)


def _find_split_edges(
    solid: TopoDS_Shape,
    faces: Sequence[TopoDS_Shape],
    spine: Sequence[TopoDS_Edge],
    near: Callable[[TopoDS_Shape], bool],
) -> list[TopoDS_Edge]:
    """Return the edges at which faces go on in others on their surface, and these in further ones, as long as near.

    Where two of these meet each other, too, that edge is one of them, however far.
    """
    faces_at = AncestorMap(solid, TopAbs_EDGE, TopAbs_FACE)
    reached, splits, others = list(faces), list[TopoDS_Edge](), list[tuple[TopoDS_Edge, TopoDS_Face]]()
    for face in reached:
        for edge in drop_duplicate_shapes(explore_subshapes(face, TopAbs_EDGE)):
            beyond = [other for other in faces_at(edge) if not other.IsSame(face)]
            if (
                len(beyond) != 1
                or _is_among(edge, spine)
                or _is_among(edge, splits)
                or not _is_same_surface(face, beyond[0], edge)
            ):
                continue
            if near(edge):
                splits.append(edge)
                if not _is_among(beyond[0], reached):
                    reached.append(beyond[0])
            else:
                others.append((edge, beyond[0]))
    return splits + [edge for edge, beyond in others if splits and _is_among(beyond, reached)]


def _is_same_surface(one: TopoDS_Face, two: TopoDS_Face, shared: TopoDS_Edge) -> bool:
    """Whether a face goes on smoothly in a second one, whose boundary lies on its surface, of the same kind.

    Faces with a pole or an apex do not count: OCCT does not survive making them one.
    """
    if BRepAdaptor_Surface(one, False).GetType() != BRepAdaptor_Surface(two, False).GetType():
        return False
    surface = _get_basis_surface(one)
    for edge in drop_duplicate_shapes(explore_subshapes(two, TopAbs_EDGE)):
        if edge.IsSame(shared):
            continue
        if BRep_Tool.Degenerated_s(edge):
            return False
        curve = BRepAdaptor_Curve(edge)
        within = max(CONFUSION, BRep_Tool.Tolerance_s(edge))
        for t in np.linspace(curve.FirstParameter(), curve.LastParameter(), 5).tolist():
            foot = GeomAPI_ProjectPointOnSurf(curve.Value(t), surface)
            if foot.NbPoints() == 0 or foot.LowerDistance() > within:
                return False
    if any(BRep_Tool.Degenerated_s(edge) for edge in explore_subshapes(one, TopAbs_EDGE)):
        return False
    return measure_continuity_between(((one, shared), (two, shared)), SAMPLES_ALONG_EDGE).angle < SMOOTH_ANGLE


def _get_basis_surface(face: TopoDS_Face) -> Geom_Surface:
    surface = BRep_Tool.Surface_s(face)
    while isinstance(surface, Geom_RectangularTrimmedSurface):
        surface = surface.BasisSurface()
    return surface


def _merge_faces(
    solid: TopoDS_Shape, splits: list[TopoDS_Edge], spine: list[TopoDS_Edge], near: Callable[[TopoDS_Shape], bool]
) -> UnifiedSolid | None:
    """Make the faces on both sides of edges one, without a change to any edge of the solid; None as `_without`."""
    own = _copy_face_edges(solid, splits)
    splits, spine = (
        [TopoDS.Edge_s(_find_descendant(own.edge_replacements, edge)) for edge in some] for some in (splits, spine)
    )
    done = _remove_split_edges(own.solid, splits, spine, near)
    return done and UnifiedSolid(
        done.solid,
        _compose_replacements(own.face_replacements, done.face_replacements),
        _compose_replacements(own.edge_replacements, done.edge_replacements),
    )


def _copy_face_edges(solid: TopoDS_Shape, splits: list[TopoDS_Edge]) -> UnifiedSolid:
    """Give curved faces that are to become one copies of their edges: OCCT leaves its parameter curves on them."""
    faces_at, reshape = AncestorMap(solid, TopAbs_EDGE, TopAbs_FACE), BRepTools_ReShape()
    curved = [
        face
        for face in drop_duplicate_shapes(face for edge in splits for face in faces_at(edge))
        if not _is_plane(face)
    ]
    if not curved:
        return UnifiedSolid(solid, [], [])
    edges: ShapeReplacements = []
    for edge in drop_duplicate_shapes(
        orient_forward(edge) for face in curved for edge in explore_subshapes(face, TopAbs_EDGE)
    ):
        edges.append((make_trimmed_copy(edge, find_end_vertices(edge), BRep_Tool.Range_s(edge)), [edge]))
        reshape.Replace(edge, edges[-1][0])
    (copy,) = explore_subshapes(reshape.Apply(solid), TopAbs_SOLID)
    faces = [
        (downcast_shape(reshape.Value(face)), face)
        for face in drop_duplicate_shapes(explore_subshapes(solid, TopAbs_FACE))
    ]
    return UnifiedSolid(copy, [(new, [old]) for new, old in faces if not new.IsSame(old)], edges)


def _is_plane(face: TopoDS_Face) -> bool:
    return bool(BRepAdaptor_Surface(face).GetType() == GeomAbs_Plane)


def _remove_split_edges(
    solid: TopoDS_Shape, splits: list[TopoDS_Edge], spine: list[TopoDS_Edge], near: Callable[[TopoDS_Shape], bool]
) -> UnifiedSolid | None:
    """Make the faces on both sides of edges one; None if OCCT leaves them, or makes something else than is wanted.

    Edges that are near and go on at what was the end of a split become one, too, but not the joint's.
    """
    faces_at, edges_at = AncestorMap(solid, TopAbs_EDGE, TopAbs_FACE), AncestorMap(solid, TopAbs_VERTEX, TopAbs_EDGE)
    along = [seam for split in splits for face in faces_at(split) for seam in find_seam_edges(face)]
    removable_vertices: list[TopoDS_Vertex] = []
    for vertex in drop_duplicate_shapes(vertex for split in splits for vertex in find_end_vertices(split)):
        left = [edge for edge in edges_at(vertex) if not _is_among(edge, splits)]
        beside = near(vertex) or all(_is_among(edge, along) for edge in left)
        if len(left) == 2 and beside and not any(_is_among(edge, spine) for edge in left):
            removable_vertices.append(vertex)
    unify = ShapeUpgrade_UnifySameDomain(solid, bool(removable_vertices), True, False)
    unify.SetAngularTolerance(PARALLEL_ANGLE)
    for part in (*ShapeIndex(solid, TopAbs_EDGE), *ShapeIndex(solid, TopAbs_VERTEX)):
        if not _is_among(part, (*splits, *along, *removable_vertices)):
            unify.KeepShape(part)
    unify.Build()
    solids = list(explore_subshapes(unify.Shape(), TopAbs_SOLID))
    if len(solids) != 1:
        return None
    faces, edges = (
        _collect_replacements(unify.History(), solid, solids[0], what) for what in (TopAbs_FACE, TopAbs_EDGE)
    )
    sound = all(_is_valid_merge(new, old) for new, old in faces)
    return UnifiedSolid(solids[0], faces, edges) if sound and any(len(old) > 1 for _, old in faces) else None


def _is_valid_merge(new: TopoDS_Face, old: list[TopoDS_Face]) -> bool:
    """Whether a face is as large as those in whose place it is, and valid in both of OCCT's modes, if they were."""
    if abs(_measure_area(new) - sum(map(_measure_area, old))) > AREA_TOLERANCE * _measure_area(new):
        return False
    return all(
        BRepCheck_Analyzer(new, True, False, exact).IsValid()
        or not all(BRepCheck_Analyzer(one, True, False, exact).IsValid() for one in old)
        for exact in (False, True)
    )


def _measure_area(face: TopoDS_Face) -> float:
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, properties)
    return float(properties.Mass())


def _collect_replacements(
    history: BRepTools_History, before: TopoDS_Shape, after: TopoDS_Shape, what: TopAbs_ShapeEnum
) -> ShapeReplacements:
    groups: ShapeReplacements = []
    remaining = ShapeIndex(after, what)
    for old in ShapeIndex(before, what):
        if remaining.find_number(old):
            continue
        for new in map(downcast_shape, history.Modified(old)):
            group = next((group for known, group in groups if known.IsSame(new)), None)
            if group is None:
                groups.append((new, [old]))
            else:
                group.append(old)
    return groups
