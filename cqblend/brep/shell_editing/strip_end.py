"""One end of an open blend, as planned: on the face across the edge, or in a flat cap."""

from __future__ import annotations

from dataclasses import dataclass

from cqblend.blends.network.blend_plan import CapPlan, EdgeUse, FacePlan, NewEdge, PlannedVertex
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim


@dataclass(frozen=True)
class StripEnd:
    """One end of an open blend.

    ``edge`` is that of the end curve, in which the blend surface meets the face or the cap: from the corner on rail 1
    to that on rail 2, at the parameters ``rail_parameters`` of the rails. Where there is a ``cap``, its ``cap_borders``
    run inside each support face, from the edge to the corner; none on a side where the cap stands on an edge of the
    input.
    """

    edge: NewEdge
    corners: tuple[PlannedVertex, PlannedVertex]
    rail_parameters: tuple[float, float]
    spine_vertex: PlannedVertex  # of the edge at this end: the input's, or a new one where a cap stands before it
    edge_trims: tuple[EdgeTrim, ...] = ()
    face_plans: tuple[FacePlan, ...] = ()
    cap_borders: tuple[tuple[EdgeUse, ...], tuple[EdgeUse, ...]] = ((), ())
    cap: CapPlan | None = None

    @property
    def is_junction(self) -> bool:
        """Whether the chain goes on there."""
        return self.edge.role == "section"
