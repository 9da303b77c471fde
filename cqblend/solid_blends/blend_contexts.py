"""The contexts of all chains of a call: each joint's made once, so that contacts are solved once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from cqblend.blend_options import BlendRequest
from cqblend.brep.selection.chains import Chain
from cqblend.brep.selection.held_edges import is_beside
from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.picked_edges import Selection
from cqblend.errors import CqblendError, SelectionError, UnsupportedError
from cqblend.solid_blends.blend_sizes import take_largest_sizes
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.held_context import make_held_context
from cqblend.solid_blends.section_methods import choose_section_method
from cqblend.solid_blends.size_assignment import assign_sizes
from cqblend.solid_blends.strip_context import StripContext

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge


class BlendContexts:
    """The contexts of all joints of a call, by what was asked for."""

    def __init__(self, request: BlendRequest) -> None:
        self.request = request
        self._of_joint: dict[Joint, StripContext] = {}

    def get_chain(self, chain: Chain, picked: Sequence[int]) -> ChainContext:
        """Return the context of a chain; ``picked`` are the numbers of those of its edges that were picked.

        Raises
        ------
        InputError
            The sizes that were asked for cannot be those of this chain.
        CqblendError
            A rail cannot be held on an edge that was given.
        """
        held = self.list_held_edges(chain)
        if held:
            return self._hold_chain(chain, held)
        requests = assign_sizes(self.request, chain, picked)
        return ChainContext(chain, tuple(map(self._get_cell, chain.cells, requests)))

    def _hold_chain(self, chain: Chain, edges: Sequence[TopoDS_Edge]) -> ChainContext:
        """Return the context of a chain of which one rail is held on some edges."""
        if len(chain.cells) > 1:
            raise UnsupportedError(
                f"{chain.cells[0].name} goes on tangentially past smooth edges, and a rail is held beside one face "
                "only; chain=False blends just what is picked"
            )
        return ChainContext(chain, (make_held_context(chain.cells[0], choose_section_method(self.request), edges),))

    def list_held_edges(self, chain: Chain) -> list[TopoDS_Edge]:
        """Return the edges beside a chain that a rail is to be held on."""
        return [edge for edge in self.request.hold if any(is_beside(edge, cell) for cell in chain.cells)]

    def check_held_edges(self, selection: Selection) -> None:
        """Raise SelectionError if an edge to hold a rail on is not beside any chain that was found."""
        chains = [one.chain for network in selection.networks for one in network if one.chain is not None]
        for edge in self.request.hold:
            if not any(is_beside(edge, cell) for chain in chains for cell in chain.cells):
                raise SelectionError("a held edge is not an edge of a face beside a blended edge")

    def _get_cell(self, joint: Joint, request: BlendRequest) -> StripContext:
        if request is not self.request:  # a share of sizes that vary
            return StripContext(joint, choose_section_method(request))
        return self._of_joint.setdefault(joint, StripContext(joint, choose_section_method(request)))

    def estimate_reach(self, joint: Joint) -> float:
        """Return the largest distance (mm) of the rails from the edge; 0 where they are not found."""
        try:
            return self._get_cell(joint, take_largest_sizes(self.request)).measure_reach()
        except CqblendError:
            return 0.0  # whatever is wrong is raised later, about the joint as it is then
