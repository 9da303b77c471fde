"""Drafts of a network: the strips of all its chains made, placed and planned together, with the ends that can be built.

Strips are made over ranges that are long enough for what they end on, which is known when they are placed: what is too
short is made longer. Corners, where ends of chains meet, are planned from the strips of all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.selection.blend_corners import BlendCorner, ChainEnd
from cqblend.brep.selection.joint import Joint
from cqblend.brep.shell_editing.end_curve import BlendEndError
from cqblend.brep.shell_editing.mitre_curve import RailsApartError
from cqblend.brep.shell_editing.strip_placement import StripPlacement, place_strip
from cqblend.brep.shell_editing.strip_planning import FaultyChainError, PlacedChain, ShortChainsError, plan_network
from cqblend.brep.topology import is_among
from cqblend.errors import CqblendError, GeometryError, SizeError, TopologyError, UnsupportedError, VerificationError
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.chain_draft import ChainDraft, EndTrials, check_blend
from cqblend.solid_blends.end_plan import EndAttempts, EndMethod, EndPlan
from cqblend.solid_blends.size_feasibility import check_chain_size
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES


@dataclass(frozen=True)
class _MadeStrips:
    """The blends of the cells of a chain, and where they go."""

    blends: tuple[BlendSurface, ...]
    placements: tuple[StripPlacement, ...]


class NetworkDrafts:
    """The drafts of a network's chains, one set after the other: the next one is made if the one before fails.

    ``corners`` are where ends of the chains meet; ``natural_ends`` are natural, whatever was asked for. Where there can
    be no mitre, since the rails run apart, the corner is a turn.
    """

    def __init__(
        self,
        chains: Sequence[ChainContext],
        corners: Sequence[BlendCorner] = (),
        natural_ends: Sequence[ChainEnd] = (),
    ) -> None:
        self.corners = tuple(corners)
        self._methods: dict[ChainEnd, EndMethod] = {end: corner.method for corner in corners for end in corner.ends}
        self._methods |= dict.fromkeys(natural_ends, "natural")
        self._take_chains(chains)

    def _take_chains(self, chains: Sequence[ChainContext]) -> None:
        """Begin with drafts of some chains."""
        self.chains = tuple(chains)
        self._trials = [
            EndTrials(context, (self._methods.get(ChainEnd(k, 0)), self._methods.get(ChainEnd(k, 1))))
            for k, context in enumerate(chains)
        ]
        self._made: dict[tuple[int, EndPlan | None, bool], _MadeStrips] = {}
        self._without_arcs: set[int] = set()

    @property
    def attempts(self) -> tuple[EndAttempts, ...]:
        """Which ends of each chain were tried."""
        return tuple(trials.attempts for trials in self._trials)

    def make_first(self) -> tuple[ChainDraft, ...]:
        """Return the first draft of every chain.

        If rails leave faces over smooth edges, those are of divided chains. Next to the ends of open chains they may
        also go on beside the face, if that fails.

        Raises
        ------
        CqblendError
            Why there is none.
        """
        whole = self.chains
        for context in whole:
            check_chain_size(context)
        try:
            divided = tuple(context.divide() for context in whole)
            if any(one is not context for one, context in zip(divided, whole, strict=True)):
                self._take_chains(divided)
                self._check_corners()
                return self._draft_first_ends()
        except CqblendError:
            if any(context.must_be_divided for context in whole):
                raise
            self._take_chains(whole)
        return self._draft_first_ends()

    def _check_corners(self) -> None:
        """Raise UnsupportedError if a rail runs on a face beyond that at its edge where it meets another blend."""
        for end in (end for corner in self.corners for end in corner.ends):
            joint = self.chains[end.chain].end_joints[end.end]
            if joint.faces_at_edge is not None:
                raise UnsupportedError(
                    f"the rail of {joint.name} has gone on over a smooth edge where it meets another blend, at "
                    f"{joint.name_end(end.end)}: corners are not built there; take a smaller size"
                )

    def _draft_first_ends(self) -> tuple[ChainDraft, ...]:
        """Return drafts with the first ends that can be built."""
        for k in range(len(self.chains)):
            self._advance(k, None)
        return self._make_drafts()

    def make_next(self, failure: CqblendError) -> tuple[ChainDraft, ...]:
        """Return the next drafts, after those before turned out to fail.

        Raises
        ------
        CqblendError
            If there are none: the first failure.
        """
        ended: list[CqblendError] = []
        for k in range(len(self.chains)):
            try:
                self._advance(k, failure)
            except CqblendError as error:
                ended.append(error)
        if len(ended) == len(self.chains):
            raise ended[0]
        return self._make_drafts()

    def _advance(self, k: int, failure: CqblendError | None) -> None:
        """Take the next ends of a chain."""
        try:
            self._trials[k].advance(failure)
        except CqblendError as error:
            raise self._name_chain(k, error) from error

    def _name_chain(self, k: int, error: CqblendError) -> CqblendError:
        """Return an error that names the chain that it is about, if there are several."""
        named = error.shape or len(self.chains) == 1
        return error if named else error.with_details(shape=self.chains[k].name)

    def _make_drafts(self) -> tuple[ChainDraft, ...]:
        """Return drafts with the present ends, or with the next ones that can be built."""
        while True:
            try:
                return self._draft_present_ends()
            except FaultyChainError as fault:
                cause = fault.cause
                if isinstance(cause, BlendEndError) and isinstance(cause.cause, RailsApartError):
                    self._turn_corner(ChainEnd(fault.chain, cause.end))
                    continue
                if not isinstance(cause, BlendEndError | SizeError | TopologyError | VerificationError):
                    raise self._name_chain(fault.chain, cause) from fault
                self._advance(fault.chain, cause)

    def _turn_corner(self, end: ChainEnd) -> None:
        """Make the corner at an end of a chain a turn."""
        self.corners = tuple(
            replace(corner, method="turn") if end in corner.ends else corner for corner in self.corners
        )

    def _plan_ends(self) -> list[EndPlan | None]:
        """Return the plans of the present ends of all chains."""
        plans = [trials.plan for trials in self._trials]
        for end in (end for corner in self.corners if corner.method == "turn" for end in corner.ends):
            plan = plans[end.chain]
            plans[end.chain] = None if plan is None else plan.turn_at(end.end)
        return plans

    def _draft_present_ends(self) -> tuple[ChainDraft, ...]:
        """Return drafts with the present ends of all chains.

        Raises
        ------
        FaultyChainError
            Because of which chain there are none.
        """
        plans = self._plan_ends()
        short_ends: dict[int, int] = {}
        for _ in range(SOLID_BLEND_TOLERANCES.max_rail_fits):
            made = self._make_all_strips(plans, short_ends)
            placed = [
                PlacedChain(context.chain, strips.placements, (None, None) if plan is None else plan.cap_stations)
                for context, strips, plan in zip(self.chains, made, plans, strict=True)
            ]
            try:
                planned = plan_network(placed, self.corners)
            except ShortChainsError as short:
                for k, needed in short.needed_domains.items():
                    plan = plans[k]
                    if plan is None:
                        continue
                    if k in short.exact:
                        plans[k] = replace(plan, rail_range=needed)
                        continue
                    short_ends[k] = 0 if needed[0] < plan.rail_range[0] else 1
                    plans[k] = plan.lengthen(needed)
                continue
            return tuple(
                ChainDraft(
                    context, strips.blends, one, None if plan is None else plan.settle_corners(one.corner_methods)
                )
                for context, strips, one, plan in zip(self.chains, made, planned, plans, strict=True)
            )
        k, end = next(iter(short_ends.items()))
        nothing = TopologyError("the blend runs on beside the faces there without ever meeting them")
        raise FaultyChainError(k, BlendEndError(end, nothing))

    def _make_all_strips(self, plans: Sequence[EndPlan | None], short_ends: Mapping[int, int]) -> list[_MadeStrips]:
        """Return the strips of all chains, with sections of one kind where two of them nearly go on in each other.

        There, and where they turn into each other, arcs of a ball and other sections that differ from them by little
        would not meet in one curve.
        """
        while True:
            made = [self._make_strips(k, plan, short_ends.get(k)) for k, plan in enumerate(plans)]
            are_arcs = [all(blend.arc is not None for blend in strips.blends) for strips in made]
            unlike = {
                chain
                for pair in self._list_continued_pairs()
                if len({are_arcs[k] for k in pair}) > 1
                for chain in pair
                if are_arcs[chain]
            }
            if not unlike:
                return made
            self._without_arcs |= unlike

    def _list_continued_pairs(self) -> list[tuple[int, int]]:
        """Return the chains that meet in each turn, and in each mitre where their edges nearly go on in each other."""
        pairs = []
        for corner in self.corners:
            if corner.method in ("mitre", "turn"):
                first, second = corner.ends
                following = self._get_joint(first).find_continuing_edge(first.end)
                continues = following is not None and is_among(following, self._get_joint(second).spine.edges)
                if continues or corner.method == "turn":
                    pairs.append((first.chain, second.chain))
        return pairs

    def _get_joint(self, end: ChainEnd) -> Joint:
        """Return the joint of the cell at an end of a chain."""
        return self.chains[end.chain].end_joints[end.end]

    def _make_strips(self, k: int, plan: EndPlan | None, short_end: int | None) -> _MadeStrips:
        """Return the strips of chain ``k``, as far as the plan of its ends demands.

        ``short_end`` is the end, 0 or 1, because of which they must be longer than they were, if they must.

        Raises
        ------
        FaultyChainError
            If that is not possible.
        """
        arcs = k not in self._without_arcs
        if (k, plan, arcs) not in self._made:
            context = self.chains[k]
            domain = (0.0, 1.0) if plan is None else plan.rail_range
            settled = (False, False) if plan is None else (plan.methods[0] == "turn", plan.methods[1] == "turn")
            try:
                blends = tuple(context.make_blends(domain, arcs=arcs, settled=settled))
                for cell, blend in zip(context.cells, blends, strict=True):
                    check_blend(cell, blend)
            except CqblendError as error:
                if short_end is not None and isinstance(error, GeometryError | SizeError):
                    named = error.with_details(before="it meets no face that it could end on: ")
                    raise FaultyChainError(k, BlendEndError(short_end, named)) from error
                raise FaultyChainError(k, error) from error
            placements = (place_strip(cell.joint, blend) for cell, blend in zip(context.cells, blends, strict=True))
            self._made[k, plan, arcs] = _MadeStrips(blends, tuple(placements))
        return self._made[k, plan, arcs]
