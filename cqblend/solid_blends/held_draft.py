"""Drafts of strips of which one rail is held on an edge: there is one way for them to end, so there is one draft."""

from __future__ import annotations

from cqblend.brep.shell_editing.held_strip import plan_held_chain
from cqblend.brep.shell_editing.strip_end import RailsTooShortError
from cqblend.brep.shell_editing.strip_placement import place_strip
from cqblend.errors import CqblendError, TopologyError
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.chain_draft import ChainDraft, check_blend
from cqblend.solid_blends.end_plan import EndAttempts, EndPlan, lengthen_domain
from cqblend.solid_blends.held_context import HeldStripContext
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES


class HeldDrafts:
    """The one draft of a strip with a held rail."""

    def __init__(self, context: ChainContext, cell: HeldStripContext) -> None:
        self.context = context
        self.attempts = (EndAttempts(("natural", "natural")),)
        self._cell = cell

    def make_first(self) -> tuple[ChainDraft, ...]:
        """Return the draft.

        Raises
        ------
        CqblendError
            Why there is none.
        """
        cell = self._cell
        cell.check_size()
        domain = (0.0, 1.0)
        if not cell.joint.spine.closed:
            slack = SOLID_BLEND_TOLERANCES.held_overrun * cell.method.size / cell.joint.spine.length
            domain = (-slack, 1.0 + slack)
        for _ in range(SOLID_BLEND_TOLERANCES.max_rail_fits):
            blend = cell.make_blend(domain)
            check_blend(cell, blend)
            placement = place_strip(cell.joint, blend, cell.describe_sides(blend))
            try:
                planned = plan_held_chain(placement, cell.held)
            except RailsTooShortError as short:
                domain = lengthen_domain(domain, short.needed_domain)
                continue
            ends = None if cell.joint.spine.closed else EndPlan.natural_at_both_ends(domain)
            return (ChainDraft(self.context, (blend,), planned, ends),)
        raise TopologyError("the blend runs on beside the face at the end of the edge without ever meeting it")

    def make_next(self, failure: CqblendError) -> tuple[ChainDraft, ...]:
        """Raise the failure of the draft: there is no other one."""
        raise failure
