"""A solid with the plan of its blends, as what decides about its faces sees it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from OCP.TopoDS import TopoDS_Shape

from cqblend.blends.network.blend_plan import NewEdge, SolidPlan
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.errors import CqblendError


class FaceConflictError(CqblendError):
    """Some strips, by their indices, leave no sound remainder of a face: ``cause`` is why."""

    def __init__(self, strips: Sequence[int], cause: CqblendError) -> None:
        super().__init__(str(cause), kind=cause.kind)
        self.strips = tuple(strips)
        self.cause = cause


@dataclass(frozen=True)
class PlannedSolid:
    """A solid and a plan of it: which strips are ``convex``, removing material, and how messages name parts of it.

    ``room_beside_swallowed`` is for what share of the widths there is room beside loops that are swallowed.
    """

    index: SolidIndex
    plan: SolidPlan
    convex: Sequence[bool]
    name_part: Callable[[TopoDS_Shape], str]
    room_beside_swallowed: float = 0.0

    def name_edge(self, number: int) -> str:
        """Return the name of an edge of the solid."""
        return self.name_part(self.index.edges[number])

    def name_face(self, number: int) -> str:
        """Return the name of a face of the solid."""
        return self.name_part(self.index.faces[number])

    def find_strip(self, edge: NewEdge | None) -> int | None:
        """Return the index of the strip that a new edge bounds, with its flat ends."""
        for k, strip in enumerate(self.plan.strips):
            uses = [*strip.boundary, *(use for cap in strip.caps for use in cap.boundary)]
            if any(use.edge is edge for use in uses):
                return k
        return None

    def list_strips(self, face: int) -> list[int]:
        """Return the indices of the strips that have a face for a support."""
        return [k for k, strip in enumerate(self.plan.strips) if face in strip.support_faces]
