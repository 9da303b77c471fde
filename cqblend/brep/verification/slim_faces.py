"""Faces without the wires that cannot have come to harm: what BRepCheck is asked about in place of whole faces.

BRepCheck compares every wire of a face with every other: on a plate with a thousand holes that takes seconds, although
a blend has changed two of them. The wires of a face that changed differ from the old ones by the *changed uses*: edges
that only one of the two has. What was added to the face or taken from it is bounded by these. Their boxes in the
parameter plane are grouped by overlap; a piece that was added or taken lies in the box of one group. A wire that was
there before, and whose box meets none of these, has the same surroundings as before: as far as it goes, nothing is new.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from OCP.Bnd import Bnd_Box2d
from OCP.BndLib import BndLib_Add2dCurve
from OCP.BRep import BRep_Tool
from OCP.BRepTools import BRepTools
from OCP.Geom import Geom_Surface
from OCP.Geom2dAdaptor import Geom2dAdaptor_Curve
from OCP.TopAbs import TopAbs_EDGE, TopAbs_FORWARD, TopAbs_WIRE
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Edge, TopoDS_Face, TopoDS_Wire

from cqblend.brep.topology import BUILDER, ShapeIndex, explore_subshapes, orient_forward
from cqblend.brep.verification.brep_check import get_shared_curve
from cqblend.brep.verification.replaced_faces import ReplacedFaces
from cqblend.brep.verification.tolerances import VERIFICATION_TOLERANCES
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class ChangedPart:
    """A part of a face that changed.

    Attributes
    ----------
    face
        The face, as it is in the result.
    slim_face
        The face with the wires only that matter to this part; the face itself if all do.
    uses
        Uses of edges that changed there and that the face has; all of the face if it is new altogether.
    old_uses
        Uses of edges that the face it was made from had there instead.
    old_face
        That face; None if the face is new altogether.
    """

    face: TopoDS_Face
    slim_face: TopoDS_Face
    uses: tuple[TopoDS_Edge, ...]
    old_uses: tuple[TopoDS_Edge, ...] = ()
    old_face: TopoDS_Face | None = None


def list_changed_parts(replaced: ReplacedFaces, *, whole_wires: bool = False) -> list[ChangedPart]:
    """Return the parts of the faces that only the result has.

    Faces of few wires are one part each. With ``whole_wires``, they are taken apart as well, and the uses are all of
    the wires that changed, which are closed.
    """
    old_surfaces = [_find_surface(old) for old in replaced.old]
    parts: list[ChangedPart] = []
    for face in replaced.new:
        wires = list(explore_subshapes(orient_forward(face), TopAbs_WIRE))
        is_worth_it = whole_wires or (len(wires) >= VERIFICATION_TOLERANCES.many_wires and not _is_periodic(face))
        old = _find_old_face(face, replaced.old, old_surfaces) if is_worth_it else None
        if old is None:
            parts.append(ChangedPart(face, face, tuple(explore_subshapes(face, TopAbs_EDGE))))
        else:
            parts += _separate_parts(face, wires, old, whole_wires=whole_wires)
    return parts


def _is_periodic(face: TopoDS_Face) -> bool:
    """Whether BRepCheck moves curves by periods before it compares them, so that boxes do not tell."""
    surface = BRep_Tool.Surface_s(face)
    return bool(surface.IsUPeriodic() or surface.IsVPeriodic())


def _find_surface(face: TopoDS_Face) -> tuple[Geom_Surface, TopLoc_Location]:
    """Return the surface of a face and where it stands: moved copies of a face have one surface in several places."""
    place = TopLoc_Location()
    return BRep_Tool.Surface_s(face, place), place


def _find_old_face(
    face: TopoDS_Face, old_faces: list[TopoDS_Face], old_surfaces: list[tuple[Geom_Surface, TopLoc_Location]]
) -> TopoDS_Face | None:
    """Return the old face on the same surface, or None; the surfaces of the old faces are given."""
    surface, place = _find_surface(face)
    found = [
        old
        for old, (other, there) in zip(old_faces, old_surfaces, strict=True)
        if other is surface and there.IsEqual(place)
    ]
    return found[0] if len(found) == 1 and found[0].Orientation() == face.Orientation() else None


def _separate_parts(
    face: TopoDS_Face, wires: list[TopoDS_Wire], old: TopoDS_Face, *, whole_wires: bool
) -> list[ChangedPart]:
    """Return the parts of a face in which it differs from an old one."""
    forward_old = orient_forward(old)
    known, kept = ShapeIndex(forward_old, TopAbs_WIRE), ShapeIndex(orient_forward(face), TopAbs_WIRE)
    is_known = np.array([_has_wire(known, wire) for wire in wires])
    new_wires = [_list_uses(wire) for wire, same in zip(wires, is_known, strict=True) if not same]
    old_wires = [_list_uses(wire) for wire in known if not _has_wire(kept, wire)]
    uses, old_uses = list(chain.from_iterable(new_wires)), list(chain.from_iterable(old_wires))
    owners = np.repeat(np.arange(len(new_wires) + len(old_wires)), [len(wire) for wire in (*new_wires, *old_wires)])
    if not whole_wires:
        uses, old_uses = _drop_common_uses(uses, old_uses)
        owners = np.arange(len(uses) + len(old_uses))
    boxes = np.array([*_measure_changes(face, uses, old_uses), *_measure_changes(face, old_uses, uses)]).reshape(-1, 4)
    wire_boxes = np.array([_measure_box(face, wire) for wire in wires])
    outer = int(np.prod(wire_boxes[:, 2:] - wire_boxes[:, :2], axis=1).argmax())
    parts = []
    for group in _group_boxes(boxes, owners):
        low, high = boxes[group, :2].min(axis=0), boxes[group, 2:].max(axis=0)
        near = (wire_boxes[:, :2] <= high).all(axis=1) & (wire_boxes[:, 2:] >= low).all(axis=1)
        near[outer] = True
        slim = face if near.all() else _copy_with_wires(face, [wires[i] for i in np.flatnonzero(near).tolist()])
        mine = [edge for edge, inside in zip((*uses, *old_uses), group.tolist(), strict=True) if inside]
        count = int(group[: len(uses)].sum())
        parts.append(ChangedPart(face, slim, tuple(mine[:count]), tuple(mine[count:]), old))
    return parts


def _has_wire(index: ShapeIndex, wire: TopoDS_Wire) -> bool:
    """Whether a face has a wire, in the same orientation."""
    number = index.find_number(wire)
    return bool(number) and index[number].Orientation() == wire.Orientation()


def _list_uses(wire: TopoDS_Wire) -> list[TopoDS_Edge]:
    return list(explore_subshapes(wire, TopAbs_EDGE))


def _drop_common_uses(
    uses: list[TopoDS_Edge], old_uses: list[TopoDS_Edge]
) -> tuple[list[TopoDS_Edge], list[TopoDS_Edge]]:
    """Return two lists of uses without what is in both."""
    return (
        [use for use in uses if not any(use.IsEqual(other) for other in old_uses)],
        [use for use in old_uses if not any(use.IsEqual(other) for other in uses)],
    )


def _measure_changes(
    face: TopoDS_Face, uses: list[TopoDS_Edge], others: list[TopoDS_Edge]
) -> list[tuple[float, float, float, float]]:
    """Return the boxes of what some edges have that others have not.

    Where an edge is a piece of one of the others, or has it as its piece, that is the stretch beyond one of their ends.
    """
    known = [(get_shared_curve(other), other) for other in others]
    boxes = []
    for use in uses:
        curve, (first, last) = get_shared_curve(use), BRep_Tool.Range_s(use)
        pieces = [BRep_Tool.Range_s(other) for same, other in known if curve is not None and same is curve]
        stretches = [(first, last)]
        if len(pieces) == 1:
            low, high = pieces[0]
            # a piece that is contained adds nothing: its own end, where the boundary turns off, stands for it
            stretches = [(a, b) for a, b in ((first, min(low, last)), (max(high, first), last)) if a < b]
            stretches = stretches or [(first, first) if low < first else (last, last)]
        found = np.array([_measure_stretch(use, face, *ends) for ends in stretches])
        boxes.append((*found[:, :2].min(axis=0).tolist(), *found[:, 2:].max(axis=0).tolist()))
    return boxes


def _measure_stretch(
    edge: TopoDS_Edge, face: TopoDS_Face, first: float, last: float
) -> tuple[float, float, float, float]:
    """Return least u and v and largest u and v of an edge on a face between two parameters."""
    box = Bnd_Box2d()
    pcurve = BRep_Tool.CurveOnSurface_s(edge, face, 0.0, 0.0)
    for end in (first, last):
        box.Add(pcurve.Value(end))
    if first < last:
        BndLib_Add2dCurve.Add_s(Geom2dAdaptor_Curve(pcurve, first, last), 0.0, box)
    box.Enlarge(VERIFICATION_TOLERANCES.wire_box_margin)
    found: tuple[float, float, float, float] = box.Get()
    return found


def _measure_box(face: TopoDS_Face, wire: TopoDS_Wire) -> tuple[float, float, float, float]:
    """Return least u and v and largest u and v of a wire on a face."""
    box = Bnd_Box2d()
    BRepTools.AddUVBounds_s(face, wire, box)
    box.Enlarge(VERIFICATION_TOLERANCES.wire_box_margin)
    found: tuple[float, float, float, float] = box.Get()
    return found


def _group_boxes(boxes: Array, owners: NDArray[np.intp]) -> list[NDArray[np.bool_]]:
    """Return the groups of boxes (n, 4) that hang together by overlaps, or by an owner (n,), each as a mask (n,)."""
    low, high = boxes[:, :2], boxes[:, 2:]
    linked = (low[:, None] <= high[None]).all(axis=-1) & (high[:, None] >= low[None]).all(axis=-1)
    linked |= owners[:, None] == owners[None]
    labels = np.arange(len(boxes))
    while True:
        smallest = np.where(linked, labels[None], len(boxes)).min(axis=1, initial=len(boxes))
        if (smallest == labels).all():
            return [labels == label for label in np.unique(labels)]
        labels = smallest


def _copy_with_wires(face: TopoDS_Face, wires: list[TopoDS_Wire]) -> TopoDS_Face:
    """Return a copy of a face with some of its wires."""
    copy = TopoDS.Face_s(face.Oriented(TopAbs_FORWARD).EmptyCopied())
    for wire in wires:
        BUILDER.Add(copy, wire)
    return TopoDS.Face_s(copy.Oriented(face.Orientation()))
