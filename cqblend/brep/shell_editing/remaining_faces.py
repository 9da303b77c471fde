"""Decide what remains of every face that blends touch, before anything is built, and refuse by name what cannot be.

Each new boundary is arranged in the parameter plane of its face (:mod:`cqblend.blends.network.face_arrangement`), where
boxes do not already tell that nothing meets. A loop that the strip has swallowed goes with all that hangs on it
(:mod:`.consumed_faces`), if nothing of that reaches further. Where curves meet, the blend runs into something: the
error names the face, what is in the way, and by what factor the size must be smaller to stay clear of it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.TopoDS import TopoDS, TopoDS_Face

from cqblend.blends.network.blend_plan import EdgePiece, FacePlan, KeptEdge
from cqblend.blends.network.face_arrangement import Meeting, Remainder, find_remainder
from cqblend.brep.shell_editing.consumed_faces import check_consumed_edges, collect_hanging_faces, find_wrong_side
from cqblend.brep.shell_editing.planned_boundary import (
    BoundaryPart,
    find_close_pairs,
    list_boundary_parts,
    locate_point,
    measure_scale,
)
from cqblend.brep.shell_editing.planned_solid import FaceConflictError, PlannedSolid
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import CONFUSION, orient_forward
from cqblend.errors import SizeError
from cqblend.splines.bernstein import Array


def settle_faces(solid: PlannedSolid) -> PlannedSolid:
    """Return the solid with what strips have swallowed taken out of its plan.

    Raises
    ------
    FaceConflictError
        If strips leave no sound remainder of a face.
    """
    check_consumed_edges(solid)
    views = [view for face_plan in solid.plan.faces for view in _examine_face(solid, face_plan)]
    swallowed = {view.face_plan.number: view.find_swallowed_loops() for view in views}
    edges = {number for loops in swallowed.values() for loop in loops for number in loop}
    if not edges:
        return solid
    for view in views:
        for loop in swallowed[view.face_plan.number]:
            view.check_swallowed_loop(loop, edges)
    gone, _ = collect_hanging_faces(solid, edges)
    room = min(view.measure_room_beside(loop) for view in views for loop in swallowed[view.face_plan.number])
    faces = [
        replace(plan, pieces={**plan.pieces, **{n: () for loop in swallowed.get(plan.number, ()) for n in loop}})
        for plan in solid.plan.faces
    ]
    plan = replace(solid.plan, faces=tuple(faces), swallowed_faces=tuple(sorted(gone)))
    return replace(solid, plan=plan, room_beside_swallowed=room)


def _examine_face(solid: PlannedSolid, face_plan: FacePlan) -> list[_FaceView]:
    """Return one face with what is wrong with its new boundary; nothing if that is sound.

    Raises
    ------
    FaceConflictError
        If parts of the boundary meet.
    """
    if face_plan.surface is not None:
        return []
    parts = list_boundary_parts(solid.index, face_plan)
    _check_loops(solid, face_plan, parts)
    new = [part for part in parts if part.wire is None]
    if not new:
        return []
    scale = measure_scale(parts[0].face, np.mean([part.box for part in new], axis=(0, 1)))
    slack = SHELL_EDIT_TOLERANCES.corner_slack * max(
        (BRep_Tool.Tolerance_s(part.use) for part in parts if part.use is not None), default=CONFUSION
    )
    is_simple = all(part.wire in (0, None) for part in parts)
    if is_simple and not any(find_close_pairs(parts, slack / scale)):
        return []
    before = list_boundary_parts(solid.index, FacePlan(face_plan.number))
    touched = {part.wire for part in before if part.number in face_plan.pieces} | {None}
    low, high = _bound_changes(new, before, face_plan)
    near = {wire for wire, box in _bound_wires(parts) if (box[0] <= high).all() and (box[1] >= low).all()} - touched
    if not near and not is_simple and not any(find_close_pairs(parts, slack / scale)):
        return []
    parts = [part for part in parts if part.wire in touched | near]
    if not _is_closed(parts, scale):
        return []  # the parameter plane is cut open in a way that only OCCT knows
    remainder = find_remainder([part.to_curve(scale) for part in parts], CONFUSION, slack)
    if remainder.is_sound:
        return []
    view = _FaceView(solid, face_plan, parts, before, scale, remainder)
    if remainder.meetings:
        raise view.describe_meeting(remainder.meetings[0])
    if not remainder.piece_count:
        raise view.describe_nothing_left()
    return [view]


def _check_loops(solid: PlannedSolid, face_plan: FacePlan, parts: Sequence[BoundaryPart]) -> None:
    """Check that as many parts of a boundary start as stop at every vertex.

    Raises
    ------
    FaceConflictError
        If not: a rail passes beyond what it should meet.
    """
    balance = Counter(part.ends[0] for part in parts)
    balance.subtract(part.ends[1] for part in parts)
    loose = {end for end, count in balance.items() if count}
    if not loose:
        return
    old = [part.number for part in parts if part.edge is None and loose.intersection(part.ends)]
    names = ", ".join(solid.name_edge(number) for number in dict.fromkeys(old)) or "its other edges"
    new = [solid.find_strip(part.edge) for part in parts if part.edge is not None]
    strips = sorted({k for k in new if k is not None}) or solid.list_strips(face_plan.number) or [0]
    name = solid.name_face(face_plan.number)
    message = f"the boundary of {name} cannot be closed along the rail, beside {names}: the size is too large for it"
    raise FaceConflictError(strips, SizeError(message, kind="too large"))


def _bound_wires(parts: Sequence[BoundaryPart]) -> Iterator[tuple[int | None, Array]]:
    """Yield each wire of a face, and two corners (2, 2) of the box around it."""
    for wire in dict.fromkeys(part.wire for part in parts):
        boxes = np.array([part.box for part in parts if part.wire == wire])
        yield wire, np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


def _bound_changes(
    new: Sequence[BoundaryPart], before: Sequence[BoundaryPart], face_plan: FacePlan
) -> tuple[Array, Array]:
    """Return two corners of the box around what is new in the boundary of a face, and what goes of it."""
    boxes = [part.box for part in new]
    for part in before:
        stops = sorted(part.span)
        for piece in face_plan.pieces.get(part.number, (KeptEdge(part.number),)):
            if isinstance(piece, EdgePiece):
                stops += piece.span
            elif isinstance(piece, KeptEdge):
                stops += part.span
        stops.sort()
        boxes += [
            replace(part, span=(low, high)).box for low, high in zip(stops[::2], stops[1::2], strict=True) if low < high
        ]
    return np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)


def _is_closed(parts: Sequence[BoundaryPart], scale: Array) -> bool:
    """Whether every part starts where another one stops, in the parameter plane."""
    ends = np.array([part.evaluate(np.array(part.span)) * scale for part in parts])
    gaps = np.linalg.norm(ends[:, None, 0] - ends[None, :, 1], axis=2)
    size = np.ptp(ends.reshape(-1, 2), axis=0).max()
    allowed = SHELL_EDIT_TOLERANCES.boundary_gap * size
    return bool((gaps.min(axis=0) <= allowed).all() and (gaps.min(axis=1) <= allowed).all())


@dataclass(frozen=True)
class _FaceView:
    """One face, its new boundary, and what was found about it."""

    solid: PlannedSolid
    face_plan: FacePlan
    parts: Sequence[BoundaryPart]
    before: Sequence[BoundaryPart]  # the boundary of the face as it was
    scale: Array
    remainder: Remainder

    @property
    def face(self) -> TopoDS_Face:
        return TopoDS.Face_s(orient_forward(self.solid.index.faces[self.face_plan.number]))

    @property
    def name(self) -> str:
        return self.solid.name_face(self.face_plan.number)

    def describe_meeting(self, meeting: Meeting) -> FaceConflictError:
        """Return the error that says which part of a blend runs into what."""
        first, second = (self.parts[k] for k in meeting.curves)
        if first.edge is None or (second.edge is not None and second.edge.role == "rail" != first.edge.role):
            first, second = second, first
        strips = self._list_strips([first, second])
        x, y, z = locate_point(self.face, meeting.point / self.scale)
        subject = f"the {'boundary' if first.edge is None else first.edge.role} on {self.name}"
        if second.edge is None:
            message = f"{subject} runs into {self._name_obstacle(second)}"
            room = self._measure_room(second, strips[0], meeting.point)
        elif len(strips) > 1:
            message = f"{subject} runs into the {second.edge.role} of the other blend"
            room = self._measure_room_between(strips[0], strips[1])
        else:
            message, room = f"{subject} runs into the {second.edge.role} of the same blend", 0.0
        pieces = ", and would cut the face in pieces" if self.remainder.piece_count > 1 else ""
        message += f" at ({x:.4g}, {y:.4g}, {z:.4g}){pieces}: the size is too large"
        return FaceConflictError(strips, SizeError(message, kind="too large", room=room))

    def describe_nothing_left(self) -> FaceConflictError:
        """Return the error that says that nothing remains of the face."""
        strips = self._list_strips(self.parts)
        room = self._measure_room_between(strips[0], strips[1]) if len(strips) > 1 else 0.0
        return FaceConflictError(strips, SizeError(f"nothing would remain of {self.name}", kind="too large", room=room))

    def _name_obstacle(self, part: BoundaryPart) -> str:
        """Return the name of an edge that is in the way, and whether it bounds a hole."""
        name = self.solid.name_edge(part.number)
        return name if part.wire in self._touched_wires else f"{name}, of a hole in it,"

    @property
    def _touched_wires(self) -> set[int | None]:
        """The wires of the face of which edges go."""
        return {one.wire for one in self.before if one.number in self.face_plan.pieces}

    def _list_strips(self, parts: Sequence[BoundaryPart]) -> list[int]:
        """Return the indices of the strips that some parts bound; of those on the face if that is not known."""
        found = {self.solid.find_strip(part.edge) for part in parts if part.edge is not None}
        return sorted(k for k in found if k is not None) or self.solid.list_strips(self.face_plan.number) or [0]

    def find_swallowed_loops(self) -> list[list[int]]:
        """Return the edges of each wire that stays as it is, but bounds nothing of what remains."""
        loops: dict[int, list[int]] = {}
        for part, share in zip(self.parts, self.remainder.bounding, strict=True):
            if part.wire is not None and part.wire not in self._touched_wires and share == 0:
                loops.setdefault(part.wire, []).append(part.number)
        return list(loops.values())

    def check_swallowed_loop(self, loop: Sequence[int], swallowed: Collection[int]) -> None:
        """Check that what hangs on a swallowed loop may go with it; ``swallowed`` are the edges of all such loops.

        Raises
        ------
        FaceConflictError
            If something of it reaches further.
        """
        strips = self._list_strips(self.parts)
        reason = find_wrong_side(self.solid, self.face_plan.number, loop, strips)
        reason = reason or collect_hanging_faces(self.solid, swallowed)[1]
        if reason:
            names = ", ".join(self.solid.name_edge(number) for number in dict.fromkeys(loop[:3]))
            message = f"the blend swallows the loop of {self.name} along {names}, but {reason}"
            error = SizeError(message, kind="too large", room=self.measure_room_beside(loop))
            raise FaceConflictError(strips[:1], error)

    def measure_room_beside(self, loop: Sequence[int]) -> float:
        """Return for what share of widths there is room beside a loop, given by its edges; 0 if that is not known."""
        strips = self._list_strips(self.parts)
        return min(self._measure_room(part, k, None) for part in self.parts if part.number in loop for k in strips)

    def _measure_room(self, obstacle: BoundaryPart, strip: int, point: Array | None) -> float:
        """Return for what share of a strip's width there is room up to an edge; 0 if that is not known.

        That is the distance of the obstacle from the blended edge, in the parameter plane, relative to that of the
        rail, at a point (2,) where they meet, or where the obstacle is nearest.
        """
        spine, rail = self._sample_spine(strip), self._sample_rails(strip)
        if not len(spine) or not len(rail):
            return 0.0
        found = self._sample(obstacle)
        near = measure_to_polyline(found, spine)
        at = found[near.argmin()] if point is None else point
        width = measure_to_polyline(rail[[measure_to_polyline(rail, at[None]).argmin()]], spine)[0]
        touches = near.min() <= SHELL_EDIT_TOLERANCES.boundary_gap * width  # as the neighbours of the blended edge do
        return 0.0 if touches else float(near.min() / width)

    def _measure_room_between(self, one: int, other: int) -> float:
        """Return for what share of the widths of two strips there is room between their edges; 0 if not known."""
        spines, rails = ([sample(k) for k in (one, other)] for sample in (self._sample_spine, self._sample_rails))
        if not all(map(len, (*spines, *rails))):
            return 0.0
        apart = measure_to_polyline(spines[0], spines[1])
        widths = [measure_to_polyline(spine, rail) for spine, rail in zip(spines, rails, strict=True)]
        partner = np.linalg.norm(spines[0][:, None] - spines[1][None], axis=2).argmin(axis=1)
        return float((apart / (widths[0] + widths[1][partner])).min())

    def _sample(self, part: BoundaryPart) -> Array:
        t = np.linspace(*part.span, SHELL_EDIT_TOLERANCES.clearance_samples)
        return part.evaluate(t) * self.scale

    def _sample_spine(self, strip: int) -> Array:
        spine = self.solid.plan.strips[strip].spine
        return np.concatenate([np.empty((0, 2)), *(self._sample(one) for one in self.before if one.number in spine)])

    def _sample_rails(self, strip: int) -> Array:
        rails = {edge for side in self.solid.plan.strips[strip].rails for edge in side}
        return np.concatenate([np.empty((0, 2)), *(self._sample(one) for one in self.parts if one.edge in rails)])


def measure_to_polyline(points: Array, others: Array) -> Array:
    """Return the distances (n,) of points (n, 2) from the polyline through others (m, 2)."""
    if len(others) < 2:
        return np.asarray(np.linalg.norm(points[:, None] - others[None], axis=2).min(axis=1))
    a, step = others[:-1], np.diff(others, axis=0)
    size = (step**2).sum(axis=1)
    share = np.clip(((points[:, None] - a) * step).sum(axis=2) / np.where(size > 0, size, 1.0), 0, 1)
    return np.asarray(np.linalg.norm(points[:, None] - a - share[..., None] * step, axis=2).min(axis=1))
