"""One end of an open blend, as planned: on the faces that lie there, or in a flat cap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from cqblend.blends.network.blend_plan import CapPlan, EdgeUse, FacePlan, NewEdge, PlannedVertex
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim
from cqblend.brep.shell_editing.strip_placement import StripPlacement
from cqblend.errors import GeometryError


class RailsTooShortError(GeometryError):
    """The blend must be made over a longer range, ``needed_domain``, to reach the faces at its ends.

    That is from a t of the first cell of its chain to one of the last cell.
    """

    def __init__(self, needed: tuple[float, float]) -> None:
        super().__init__(f"the rails must reach from t = {needed[0]:.4g} to {needed[1]:.4g}")
        self.needed_domain = needed


class StripsTooShortError(GeometryError):
    """Strips that end in a corner do not meet there, but would if they reached to given s, in the order of its ends.

    Those that are to stay as they are have None. With ``exactly``, the others must end there: in the compact form, only
    the ends of strips are exact.
    """

    def __init__(self, needed: Sequence[float | None], *, exactly: bool = False) -> None:
        super().__init__("the blends end before they meet")
        self.needed = tuple(needed)
        self.exactly = exactly


@dataclass(frozen=True)
class PlacedEnd:
    """The start (``end`` 0) or the stop (1) of a placed strip."""

    placement: StripPlacement
    end: int


@dataclass(frozen=True)
class StripEnd:
    """One end of an open blend.

    ``path`` has the end curves, in which the blend surface meets one face after the other, or the cap, or another
    blend: from the corner on rail 1 to that on rail 2, at the parameters ``rail_parameters`` of the rails.
    ``removed_faces`` are the numbers of faces that the blend takes the place of altogether. Where there is a ``cap``,
    its ``cap_borders`` run inside each support face, from the edge to the corner; none on a side where the cap stands
    on an edge of the input.
    """

    path: tuple[EdgeUse, ...]
    corners: tuple[PlannedVertex, PlannedVertex]
    rail_parameters: tuple[float, float]
    spine_vertex: PlannedVertex  # of the edge at this end: the input's, or a new one where a cap stands before it
    edge_trims: tuple[EdgeTrim, ...] = ()
    face_plans: tuple[FacePlan, ...] = ()
    removed_faces: tuple[int, ...] = ()
    cap_borders: tuple[tuple[EdgeUse, ...], tuple[EdgeUse, ...]] = ((), ())
    cap: CapPlan | None = None

    @property
    def edges(self) -> tuple[NewEdge, ...]:
        """The edges of its path."""
        return tuple(use.edge for use in self.path if isinstance(use.edge, NewEdge))

    @property
    def is_junction(self) -> bool:
        """Whether the chain goes on there."""
        return self.edges[0].role == "section"
