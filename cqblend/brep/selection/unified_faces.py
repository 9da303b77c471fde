"""Unify faces with neighbours on the same surface before they are blended.

Unions that were not cleaned and files of other systems leave such faces: coplanar ones, the two halves of a cylinder.
Only those that a blend touches are unified. All other faces, and all edges that remain, are the same topological
objects as before, except the edges of curved faces that are unified, which are replaced by copies.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from OCP.BRep import BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepCheck import BRepCheck_Analyzer
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp
from OCP.BRepTools import BRepTools_History, BRepTools_ReShape
from OCP.GeomAbs import GeomAbs_Plane
from OCP.GProp import GProp_GProps
from OCP.ShapeUpgrade import ShapeUpgrade_UnifySameDomain
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_ShapeEnum, TopAbs_VERTEX
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape, TopoDS_Vertex

from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.shape_kinds import downcast_shape
from cqblend.brep.topology import (
    AncestorMap,
    ShapeIndex,
    drop_duplicate_shapes,
    explore_subshapes,
    find_end_vertices,
    find_seam_edges,
    is_among,
    make_trimmed_copy,
    orient_forward,
)


class ShapeReplacement(NamedTuple):
    """A new face or edge, and the old ones that it replaces."""

    new: TopoDS_Shape
    old: list[TopoDS_Shape]


@dataclass(frozen=True)
class UnifiedSolid:
    """A body with unified faces, and which faces and edges of it replace which of the solid before."""

    solid: TopoDS_Shape
    face_replacements: list[ShapeReplacement]
    edge_replacements: list[ShapeReplacement]

    def after(self, before: UnifiedSolid | None) -> UnifiedSolid:
        """Return this solid with the replacements of an earlier step, if there was one, and of this one together."""
        if before is None:
            return self
        return UnifiedSolid(
            self.solid,
            _compose_replacements(before.face_replacements, self.face_replacements),
            _compose_replacements(before.edge_replacements, self.edge_replacements),
        )


def unify_faces(joint: Joint, reach: Callable[[], float]) -> UnifiedSolid | None:
    """Unify the faces at a joint with their neighbours on the same surface, as far as a blend touches them.

    These faces are its sides and those at its ends; the edge to the neighbour is no further than 1.1 ``reach()`` from
    the joint, the largest distance (mm) of the blend's rails. Returns None if there is nothing to unify, or if the
    result would not be valid.
    """
    index, spine_edges, unified = joint.index, joint.spine.edges, None
    faces = drop_duplicate_shapes(
        face for edge in spine_edges for vertex in find_end_vertices(edge) for face in index.faces_at_vertex(vertex)
    )
    largest_distance: float | None = None

    def is_near(shape: TopoDS_Shape) -> bool:
        nonlocal largest_distance
        if largest_distance is None:
            largest_distance = SELECT_TOLERANCES.reach_margin * reach()
        return any(BRepExtrema_DistShapeShape(shape, edge).Value() <= largest_distance for edge in joint.spine.edges)

    while splits := _find_split_edges(index, faces, spine_edges, is_near):
        step = _merge_faces(index.solid, splits, spine_edges, is_near)
        if step is None:
            break
        new_edges = [TopoDS.Edge_s(_find_descendant(step.edge_replacements, edge)) for edge in spine_edges]
        if _has_end_on_seam(step, new_edges):
            break
        index, spine_edges = SolidIndex(step.solid), new_edges
        faces = drop_duplicate_shapes(_find_descendant(step.face_replacements, face) for face in faces)
        unified = step.after(unified)
    return unified


def _has_end_on_seam(unified: UnifiedSolid, spine_edges: Sequence[TopoDS_Edge]) -> bool:
    """Whether a joint would end at the seam of a unified face, where other faces meet it: no blend can end there."""
    faces_at = AncestorMap(unified.solid, TopAbs_VERTEX, TopAbs_FACE)
    seam_vertices = [
        vertex
        for replacement in unified.face_replacements
        for seam in find_seam_edges(replacement.new)
        for vertex in find_end_vertices(seam)
    ]
    return any(
        is_among(vertex, seam_vertices) and len(faces_at(vertex)) > 2
        for edge in spine_edges
        for vertex in find_end_vertices(edge)
    )


def _find_descendant(replacements: Sequence[ShapeReplacement], shape: TopoDS_Shape) -> TopoDS_Shape:
    """Return what replaces a shape, or the shape itself."""
    return next((new for new, old in replacements if is_among(shape, old)), shape)


def _compose_replacements(first: list[ShapeReplacement], then: list[ShapeReplacement]) -> list[ShapeReplacement]:
    """Return the replacements of two steps, one after the other, as those of one step."""
    composed = []
    for new, old in then:
        roots = [next((roots for shape, roots in first if shape.IsSame(one)), [one]) for one in old]
        composed.append(ShapeReplacement(new, [shape for some in roots for shape in some]))
    replaced_again = [shape for _, old in then for shape in old]
    return composed + [one for one in first if not is_among(one.new, replaced_again)]


def _find_split_edges(
    index: SolidIndex,
    faces: Sequence[TopoDS_Shape],
    spine_edges: Sequence[TopoDS_Edge],
    is_near: Callable[[TopoDS_Shape], bool],
) -> list[TopoDS_Edge]:
    """Return the edges that split faces from neighbours on the same surface, and transitively those of the neighbours.

    Edges count that are near the joint, and all others, however far, between two of the faces that are found so.
    """
    reached, splits, others = list(faces), list[TopoDS_Edge](), list[tuple[TopoDS_Edge, TopoDS_Face]]()
    for face in reached:
        for edge, beyond in index.list_same_surface_neighbours(face):
            if is_among(edge, spine_edges) or is_among(edge, splits):
                continue
            if is_near(edge):
                splits.append(edge)
                if not is_among(beyond, reached):
                    reached.append(beyond)
            else:
                others.append((edge, beyond))
    return splits + [edge for edge, beyond in others if splits and is_among(beyond, reached)]


def _merge_faces(
    solid: TopoDS_Shape,
    splits: list[TopoDS_Edge],
    spine_edges: list[TopoDS_Edge],
    is_near: Callable[[TopoDS_Shape], bool],
) -> UnifiedSolid | None:
    """Unify the faces on both sides of edges without changing any edge of the solid; None if OCCT fails to."""
    copied = _copy_face_edges(solid, splits)
    splits, spine_edges = (
        [TopoDS.Edge_s(_find_descendant(copied.edge_replacements, edge)) for edge in edges]
        for edges in (splits, spine_edges)
    )
    merged = _remove_split_edges(copied.solid, splits, spine_edges, is_near)
    return None if merged is None else merged.after(copied)


def _copy_face_edges(solid: TopoDS_Shape, splits: list[TopoDS_Edge]) -> UnifiedSolid:
    """Replace the edges of curved faces that are to be unified by copies, because OCCT adds pcurves to these edges."""
    faces_at, reshape = AncestorMap(solid, TopAbs_EDGE, TopAbs_FACE), BRepTools_ReShape()
    curved = [
        face
        for face in drop_duplicate_shapes(face for edge in splits for face in faces_at(edge))
        if not _is_plane(face)
    ]
    if not curved:
        return UnifiedSolid(solid, [], [])
    edges: list[ShapeReplacement] = []
    for edge in drop_duplicate_shapes(
        orient_forward(edge) for face in curved for edge in explore_subshapes(face, TopAbs_EDGE)
    ):
        edges.append(
            ShapeReplacement(make_trimmed_copy(edge, find_end_vertices(edge), BRep_Tool.Range_s(edge)), [edge])
        )
        reshape.Replace(edge, edges[-1].new)
    (copy,) = explore_subshapes(reshape.Apply(solid), solid.ShapeType())
    faces = [
        (downcast_shape(reshape.Value(face)), face)
        for face in drop_duplicate_shapes(explore_subshapes(solid, TopAbs_FACE))
    ]
    return UnifiedSolid(copy, [ShapeReplacement(new, [old]) for new, old in faces if not new.IsSame(old)], edges)


def _is_plane(face: TopoDS_Face) -> bool:
    return bool(BRepAdaptor_Surface(face).GetType() == GeomAbs_Plane)


def _remove_split_edges(
    solid: TopoDS_Shape,
    splits: list[TopoDS_Edge],
    spine_edges: list[TopoDS_Edge],
    is_near: Callable[[TopoDS_Shape], bool],
) -> UnifiedSolid | None:
    """Unify the faces on both sides of edges; None if OCCT does not, or if the result is not one valid body.

    Two edges that are left at the end of a split are unified, too, if that end is near the joint, but not the joint's.
    """
    faces_at, edges_at = AncestorMap(solid, TopAbs_EDGE, TopAbs_FACE), AncestorMap(solid, TopAbs_VERTEX, TopAbs_EDGE)
    seams = [seam for split in splits for face in faces_at(split) for seam in find_seam_edges(face)]
    removable_vertices: list[TopoDS_Vertex] = []
    for vertex in drop_duplicate_shapes(vertex for split in splits for vertex in find_end_vertices(split)):
        left = [edge for edge in edges_at(vertex) if not is_among(edge, splits)]
        is_removable = is_near(vertex) or all(is_among(edge, seams) for edge in left)
        if len(left) == 2 and is_removable and not any(is_among(edge, spine_edges) for edge in left):
            removable_vertices.append(vertex)
    unify = ShapeUpgrade_UnifySameDomain(solid, bool(removable_vertices), True, False)
    unify.SetAngularTolerance(SELECT_TOLERANCES.parallel_angle)
    for part in (*ShapeIndex(solid, TopAbs_EDGE), *ShapeIndex(solid, TopAbs_VERTEX)):
        if not is_among(part, (*splits, *seams, *removable_vertices)):
            unify.KeepShape(part)
    unify.Build()
    solids = list(explore_subshapes(unify.Shape(), solid.ShapeType()))
    if len(solids) != 1:
        return None
    faces, edges = (
        _collect_replacements(unify.History(), solid, solids[0], kind) for kind in (TopAbs_FACE, TopAbs_EDGE)
    )
    is_valid = all(_is_valid_merge(new, old) for new, old in faces)
    return UnifiedSolid(solids[0], faces, edges) if is_valid and any(len(old) > 1 for _, old in faces) else None


def _is_valid_merge(new: TopoDS_Face, old: list[TopoDS_Face]) -> bool:
    """Whether a face has the area of those that it replaces, and is valid in OCCT's modes in which they were."""
    if abs(_measure_area(new) - sum(map(_measure_area, old))) > SELECT_TOLERANCES.merged_area * _measure_area(new):
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
    history: BRepTools_History, before: TopoDS_Shape, after: TopoDS_Shape, kind: TopAbs_ShapeEnum
) -> list[ShapeReplacement]:
    """Return which sub-shapes of a kind have replaced which, by OCCT's record of a change."""
    replacements: list[ShapeReplacement] = []
    remaining = ShapeIndex(after, kind)
    for old in ShapeIndex(before, kind):
        if old in remaining:
            continue
        for new in map(downcast_shape, history.Modified(old)):
            known = next((one for one in replacements if one.new.IsSame(new)), None)
            if known is None:
                replacements.append(ShapeReplacement(new, [old]))
            else:
                known.old.append(old)
    return replacements
