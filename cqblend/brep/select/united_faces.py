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
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Shape
from OCP.TopTools import TopTools_MapOfShape

from cqblend.brep.select.edge_joint import SMOOTH, Joint
from cqblend.brep.shape_kinds import downcast
from cqblend.brep.topology import CONFUSION, Ancestors, Index, distinct, ends, explore, forward, seams, trimmed
from cqblend.brep.verification.edge_continuity import continuity_between

BESIDE = 1.1  # how much further than its rails a blend may touch something
SAME_AREA = 1e-4  # relative: OCCT integrates spline faces at few points
SAMPLES = 9  # along an edge
PARALLEL = 1e-9  # rad, between the normals of planes, the axes of cylinders that are the same


Groups = list[tuple[TopoDS_Shape, list[TopoDS_Shape]]]
"""New faces or edges, and for each of them those in whose place it is."""


@dataclass(frozen=True)
class Unified:
    """A solid in which faces on the same surface are one, and the faces and edges of it that are new."""

    solid: TopoDS_Shape
    faces: Groups
    edges: Groups


def unified(joint: Joint, reach: Callable[[], float]) -> Unified | None:
    """Make the faces at a joint one with their neighbours on the same surface, as far as a blend touches them.

    These faces are its sides and those at its ends; the edge to the neighbour is no further than ``reach`` (mm) from
    the joint. Returns None where there is nothing to be made one, or where that would not be sound.
    """
    solid, spine, made = joint.solid, joint.spine.edges, None
    faces_at = Ancestors(solid, TopAbs_VERTEX, TopAbs_FACE)
    faces = distinct(face for edge in spine for vertex in ends(edge) for face in faces_at(vertex))
    far: float | None = None

    def near(shape: TopoDS_Shape) -> bool:
        nonlocal far
        far = BESIDE * reach() if far is None else far
        return any(BRepExtrema_DistShapeShape(shape, edge).Value() <= far for edge in joint.spine.edges)

    while splits := _splits(solid, faces, spine, near):
        done = _made_one(solid, splits, spine, near)
        if done is None:
            break
        remade = [TopoDS.Edge_s(_descendant(done.edges, edge)) for edge in spine]
        if _ends_on_seam(done, remade):
            break
        solid, spine = done.solid, remade
        faces = distinct(_descendant(done.faces, face) for face in faces)
        if made is not None:
            done = Unified(solid, _composed(made.faces, done.faces), _composed(made.edges, done.edges))
        made = done
    return made


def _ends_on_seam(made: Unified, spine: Sequence[TopoDS_Edge]) -> bool:
    """Whether a joint would end at the seam of a face made one, where other faces are, too: none ends there."""
    faces_at = Ancestors(made.solid, TopAbs_VERTEX, TopAbs_FACE)
    meeting = [vertex for face, _ in made.faces for seam in seams(face) for vertex in ends(seam)]
    return any(_among(vertex, meeting) and len(faces_at(vertex)) > 2 for edge in spine for vertex in ends(edge))


def _descendant(groups: Groups, shape: TopoDS_Shape) -> TopoDS_Shape:
    return next((new for new, old in groups if _among(shape, old)), shape)


def _composed(first: Groups, then: Groups) -> Groups:
    """Return two steps as one."""
    groups = []
    for new, old in then:
        roots = [next((roots for shape, roots in first if shape.IsSame(one)), [one]) for one in old]
        groups.append((new, [shape for some in roots for shape in some]))
    used = [shape for _, old in then for shape in old]
    return groups + [group for group in first if not _among(group[0], used)]


def _among(shape: TopoDS_Shape, shapes: Sequence[TopoDS_Shape]) -> bool:
    return any(shape.IsSame(one) for one in shapes)


def _splits(
    solid: TopoDS_Shape,
    faces: Sequence[TopoDS_Shape],
    spine: Sequence[TopoDS_Edge],
    near: Callable[[TopoDS_Shape], bool],
) -> list[TopoDS_Edge]:
    """Return the edges at which faces go on in others on their surface, and these in further ones, as long as near.

    Where two of these meet each other, too, that edge is one of them, however far.
    """
    faces_at = Ancestors(solid, TopAbs_EDGE, TopAbs_FACE)
    reached, splits, others = list(faces), list[TopoDS_Edge](), list[tuple[TopoDS_Edge, TopoDS_Face]]()
    for face in reached:
        for edge in distinct(explore(face, TopAbs_EDGE)):
            beyond = [other for other in faces_at(edge) if not other.IsSame(face)]
            if (
                len(beyond) != 1
                or _among(edge, spine)
                or _among(edge, splits)
                or not _same_surface(face, beyond[0], edge)
            ):
                continue
            if near(edge):
                splits.append(edge)
                if not _among(beyond[0], reached):
                    reached.append(beyond[0])
            else:
                others.append((edge, beyond[0]))
    return splits + [edge for edge, beyond in others if splits and _among(beyond, reached)]


def _same_surface(one: TopoDS_Face, two: TopoDS_Face, shared: TopoDS_Edge) -> bool:
    """Whether a face goes on smoothly in a second one, whose boundary lies on its surface, of the same kind.

    Faces with a pole or an apex do not count: OCCT does not survive making them one.
    """
    if BRepAdaptor_Surface(one, False).GetType() != BRepAdaptor_Surface(two, False).GetType():
        return False
    surface = _basis(one)
    for edge in distinct(explore(two, TopAbs_EDGE)):
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
    if any(BRep_Tool.Degenerated_s(edge) for edge in explore(one, TopAbs_EDGE)):
        return False
    return continuity_between(((one, shared), (two, shared)), SAMPLES).angle < SMOOTH


def _basis(face: TopoDS_Face) -> Geom_Surface:
    surface = BRep_Tool.Surface_s(face)
    while isinstance(surface, Geom_RectangularTrimmedSurface):
        surface = surface.BasisSurface()
    return surface


def _made_one(
    solid: TopoDS_Shape, splits: list[TopoDS_Edge], spine: list[TopoDS_Edge], near: Callable[[TopoDS_Shape], bool]
) -> Unified | None:
    """Make the faces on both sides of edges one, without a change to any edge of the solid; None as `_without`."""
    own = _with_own_edges(solid, splits)
    splits, spine = ([TopoDS.Edge_s(_descendant(own.edges, edge)) for edge in some] for some in (splits, spine))
    done = _without(own.solid, splits, spine, near)
    return done and Unified(done.solid, _composed(own.faces, done.faces), _composed(own.edges, done.edges))


def _with_own_edges(solid: TopoDS_Shape, splits: list[TopoDS_Edge]) -> Unified:
    """Give curved faces that are to become one copies of their edges: OCCT leaves its parameter curves on them."""
    faces_at, reshape = Ancestors(solid, TopAbs_EDGE, TopAbs_FACE), BRepTools_ReShape()
    curved = [face for face in distinct(face for edge in splits for face in faces_at(edge)) if not _is_plane(face)]
    if not curved:
        return Unified(solid, [], [])
    edges: Groups = []
    for edge in distinct(forward(edge) for face in curved for edge in explore(face, TopAbs_EDGE)):
        edges.append((trimmed(edge, ends(edge), BRep_Tool.Range_s(edge)), [edge]))
        reshape.Replace(edge, edges[-1][0])
    (copy,) = explore(reshape.Apply(solid), TopAbs_SOLID)
    faces = [(downcast(reshape.Value(face)), face) for face in distinct(explore(solid, TopAbs_FACE))]
    return Unified(copy, [(new, [old]) for new, old in faces if not new.IsSame(old)], edges)


def _is_plane(face: TopoDS_Face) -> bool:
    return bool(BRepAdaptor_Surface(face).GetType() == GeomAbs_Plane)


def _without(
    solid: TopoDS_Shape, splits: list[TopoDS_Edge], spine: list[TopoDS_Edge], near: Callable[[TopoDS_Shape], bool]
) -> Unified | None:
    """Make the faces on both sides of edges one; None if OCCT leaves them, or makes something else than is wanted.

    Edges that are near and go on at what was the end of a split become one, too, but not the joint's.
    """
    kept, loose = TopTools_MapOfShape(), False
    faces_at, edges_at = Ancestors(solid, TopAbs_EDGE, TopAbs_FACE), Ancestors(solid, TopAbs_VERTEX, TopAbs_EDGE)
    along = [seam for split in splits for face in faces_at(split) for seam in seams(face)]
    for part in (*Index(solid, TopAbs_EDGE), *Index(solid, TopAbs_VERTEX)):
        kept.Add(part)
    for edge in (*splits, *along):
        kept.Remove(edge)
    for vertex in distinct(vertex for split in splits for vertex in ends(split)):
        left = [edge for edge in edges_at(vertex) if not _among(edge, splits)]
        beside = near(vertex) or all(_among(edge, along) for edge in left)
        if len(left) == 2 and beside and not any(_among(edge, spine) for edge in left):
            kept.Remove(vertex)
            loose = True
    unify = ShapeUpgrade_UnifySameDomain(solid, loose, True, False)
    unify.SetAngularTolerance(PARALLEL)
    unify.KeepShapes(kept)
    unify.Build()
    solids = list(explore(unify.Shape(), TopAbs_SOLID))
    if len(solids) != 1:
        return None
    faces, edges = (_changed(unify.History(), solid, solids[0], what) for what in (TopAbs_FACE, TopAbs_EDGE))
    sound = all(_sound(new, old) for new, old in faces)
    return Unified(solids[0], faces, edges) if sound and any(len(old) > 1 for _, old in faces) else None


def _sound(new: TopoDS_Face, old: list[TopoDS_Face]) -> bool:
    """Whether a face is as large as those in whose place it is, and valid in both of OCCT's modes, if they were."""
    if abs(_area(new) - sum(map(_area, old))) > SAME_AREA * _area(new):
        return False
    return all(
        BRepCheck_Analyzer(new, True, False, exact).IsValid()
        or not all(BRepCheck_Analyzer(one, True, False, exact).IsValid() for one in old)
        for exact in (False, True)
    )


def _area(face: TopoDS_Face) -> float:
    properties = GProp_GProps()
    BRepGProp.SurfaceProperties_s(face, properties)
    return float(properties.Mass())


def _changed(history: BRepTools_History, before: TopoDS_Shape, after: TopoDS_Shape, what: TopAbs_ShapeEnum) -> Groups:
    groups: Groups = []
    remaining = Index(after, what)
    for old in Index(before, what):
        if remaining.of(old):
            continue
        for new in map(downcast, history.Modified(old)):
            group = next((group for known, group in groups if known.IsSame(new)), None)
            if group is None:
                groups.append((new, [old]))
            else:
                group.append(old)
    return groups
