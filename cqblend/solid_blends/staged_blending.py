"""Blend networks of chains in stages: what is blended in one stage is what chains of the next ones run round.

Each stage rewrites and verifies a solid once, for all networks together. What was blended in a stage before is tracked
into the last solid, and certified there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, TypeVar

from cqblend.brep.selection.blend_corners import ChainEnd, CornerMethod, find_blended_corners, find_mitres
from cqblend.brep.selection.chains import Chain
from cqblend.brep.selection.picked_edges import FoundChain, PickedEdges, Selection
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.plan_application import ProposedSolid
from cqblend.brep.shell_editing.strip_tracking import list_end_edges, track_patch, track_strip
from cqblend.brep.topology import is_among
from cqblend.certificate import Certificate
from cqblend.errors import CqblendError, UnsupportedError
from cqblend.solid_blends.blend_contexts import BlendContexts
from cqblend.solid_blends.blend_sizes import read_sizes
from cqblend.solid_blends.blend_stages import NetworkStages, RoundedCorner, plan_stages
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.end_plan import record_ends
from cqblend.solid_blends.solid_rewriting import (
    DraftedNetwork,
    FaultyNetworkError,
    PlacedPatch,
    PlacedStrip,
    certify_corner_patch,
    certify_strip,
    rewrite_solid,
)

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Face, TopoDS_Shape, TopoDS_Vertex


class StagedNetwork:
    """A network of picked chains that touch, and the stages in which they are blended.

    ``failure`` is why it cannot be blended with blends that go round one another, so that corners are to be patched.

    Raises
    ------
    CqblendError
        One of its edges is no joint, has a size that cannot be, or the chains cannot be blended in any order.
    """

    def __init__(
        self, found: Sequence[FoundChain], contexts: BlendContexts, failure: StagedNetworkError | None = None
    ) -> None:
        self.found = tuple(found)
        self.contexts = contexts
        self.failure = failure
        chains = []
        for one in found:
            if one.error is not None:
                raise one.error
            if one.chain is not None:
                chains.append(contexts.get_chain(one.chain, one.edges))
        self.chains = tuple(chains)
        self.plan: NetworkStages = plan_stages(self.chains, contexts.request.corner, patches_only=failure is not None)
        if len(self.plan.stages) > 1 and any(contexts.list_held_edges(one.chain) for one in chains):
            raise UnsupportedError(f"{self.name} meets other picked edges at a corner, and a rail is held on an edge")

    @property
    def edges(self) -> tuple[int, ...]:
        """The numbers of the picked edges."""
        return tuple(number for one in self.found for number in one.edges)

    @property
    def name(self) -> str:
        """What messages call it: its first edge."""
        return self.chains[0].name

    def make_alternative(self, failure: StagedNetworkError) -> StagedNetwork | None:
        """Return the same network with patches at its corners, after it failed without; None if there is no such."""
        if self.failure is not None or not self.plan.corners:
            return None
        try:
            other = StagedNetwork(self.found, self.contexts, failure)
        except CqblendError:
            return None
        return None if other.plan.corners == self.plan.corners else other

    @cached_property
    def first_draft(self) -> DraftedNetwork:
        """The draft of its first stage, which does not depend on other networks."""
        return self._draft_chains([self.chains[k] for k in self.plan.stages[0]])

    def draft(self, stage: int, picks: PickedEdges) -> DraftedNetwork:
        """Return the draft of one of its stages, in the solid as the stages before have left it.

        Raises
        ------
        CqblendError
            A chain cannot be drafted, or does not go on round a corner.
        """
        if stage == 0:
            return self.first_draft
        numbers = [n for k in self.plan.stages[stage] for n in self.chains[k].chain.edge_numbers]
        found = picks.find_chains_round_corners(numbers)
        for corner in self.plan.list_corners(stage):
            self._check_corner(corner, found)
        return self._draft_chains([self._get_context(one.chain, one.edges) for one in found if one.chain is not None])

    def _draft_chains(self, chains: Sequence[ChainContext]) -> DraftedNetwork:
        """Return the draft of some of its chains, with mitres where two of them meet, and patches where all do."""
        own = [context.chain for context in chains]
        first_ends = [ChainEnd(k, end) for k, chain in enumerate(own) for end in self.find_first_ends(chain)]
        wanted = self.contexts.request.corner
        methods: tuple[CornerMethod, ...] = ("ball", "cross", "setback") if wanted == "auto" else (wanted,)
        corners = [*find_mitres(own), *find_blended_corners(own, methods, self._list_setbacks(own))]
        return DraftedNetwork(chains, corners, first_ends)

    def _list_setbacks(self, chains: Sequence[Chain]) -> dict[int, float]:
        """Return the setbacks that are asked for, by the index of the chain."""
        found: dict[int, float] = {}
        for k, chain in enumerate(chains):
            lookup = chain.cells[0].lookup_number
            for one in self.contexts.request.setbacks:
                if one.edge is None or (lookup is not None and lookup(one.edge) in chain.edge_numbers):
                    found[k] = one.distance
        return found

    def _check_corner(self, corner: RoundedCorner, found: Sequence[FoundChain]) -> None:
        """Raise UnsupportedError if two chains do not go on in one another round a corner."""
        one, other = (self.chains[end.chain].chain.edge_numbers[0] for end in corner.others)
        if not any(one in chain.edge_numbers and other in chain.edge_numbers for chain in _list_chains(found)):
            joint = self.chains[corner.first.chain].end_joints[corner.first.end]
            raise UnsupportedError(
                f"the blends of edges {one} and {other} do not go on in one another round that of {joint.name} at "
                f"{joint.name_end(corner.first.end)}"
            )

    def _get_context(self, chain: Chain, picked: Sequence[int]) -> ChainContext:
        """Return the context of a chain that may go round corners."""
        strands = [one for one in self.chains if set(one.chain.edge_numbers) & set(chain.edge_numbers)]
        request = self.contexts.request
        if len(strands) > 1 and not request.edge_sizes and read_sizes(request).laws:
            raise UnsupportedError(
                f"{chain.cells[0].name} goes on round a corner, and the size varies along each edge for itself: give "
                "numbers, one for each edge if they differ"
            )
        return self.contexts.get_chain(chain, picked)

    def find_first_ends(self, chain: Chain) -> list[int]:
        """Return at which ends, 0 or 1, of one of its chains another one is to go on round it."""
        if chain.closed:
            return []
        ends = (chain.cells[0].spine.vertices[0], chain.cells[-1].spine.vertices[1])
        return [end for end in (0, 1) if is_among(ends[end], map(self._find_vertex, self.plan.corners))]

    def _find_vertex(self, corner: RoundedCorner) -> TopoDS_Vertex:
        """Return the vertex of a corner."""
        return self.chains[corner.first.chain].end_joints[corner.first.end].spine.vertices[corner.first.end]


def _list_chains(found: Sequence[FoundChain]) -> list[Chain]:
    """Return the chains that were found."""
    return [one.chain for one in found if one.chain is not None]


class StagedNetworkError(CqblendError):
    """One network cannot be blended: ``cause`` is why, ``chain`` the one at fault, or the first one."""

    def __init__(self, network: StagedNetwork, cause: CqblendError, chain: ChainContext) -> None:
        super().__init__(str(cause), kind=cause.kind)
        self.network = network
        self.cause = cause
        self.chain = chain


@dataclass(frozen=True)
class StagedStrip:
    """A blend face in the last solid of all stages, and the network that it is part of."""

    network: StagedNetwork
    placed: PlacedStrip


@dataclass(frozen=True)
class StagedPatch:
    """A face of a corner in the last solid of all stages, and the network that it is part of."""

    network: StagedNetwork
    placed: PlacedPatch


@dataclass
class _Body:
    """A body of the input as it was, and as it is after some stages, with its blend faces."""

    before: SolidIndex
    now: SolidIndex
    strips: list[StagedStrip] = field(default_factory=list)
    patches: list[StagedPatch] = field(default_factory=list)
    edge_tolerance: float = 0.0
    gone_faces: tuple[str, ...] = ()


@dataclass(frozen=True)
class StagedBlend:
    """What all stages have made: bodies in the place of others, strips with their certificates, by their networks."""

    bodies: Sequence[tuple[TopoDS_Shape, TopoDS_Shape]]
    faces: dict[StagedNetwork, list[TopoDS_Face]]
    certificates: dict[StagedNetwork, list[Certificate]]
    uncovered: float  # mm of edges that are not blended, beyond flat caps


def blend_in_stages(networks: Sequence[StagedNetwork], selection: Selection) -> StagedBlend:
    """Blend networks, verify every solid on the way, and certify all blends in the last ones.

    Raises
    ------
    StagedNetworkError
        One of the networks cannot be blended.
    """
    picks = selection.picks.copy()
    bodies = [_Body(index, index) for index in dict.fromkeys(network.chains[0].index for network in networks)]
    for stage in range(max(len(network.plan.stages) for network in networks)):
        drafted = {_draft(network, stage, picks): network for network in networks if stage < len(network.plan.stages)}
        for body in bodies:
            own = [one for one in drafted if one.index is body.now]
            if own:
                _blend_stage(body, {one: drafted[one] for one in own}, picks)
    faces: dict[StagedNetwork, list[TopoDS_Face]] = {network: [] for network in networks}
    certificates: dict[StagedNetwork, list[Certificate]] = {network: [] for network in networks}
    for body in bodies:
        for strip in body.strips:
            faces[strip.network].append(strip.placed.strip.blend_face)
            certificates[strip.network].append(_certify(strip, body))
        for patch in body.patches:
            faces[patch.network].append(patch.placed.patch.face)
            certificates[patch.network][0] = _record_patch(certificates[patch.network][0], patch)
    return StagedBlend(
        [(body.before.solid, body.now.solid) for body in bodies],
        faces,
        certificates,
        sum(one.placed.draft.uncovered for body in bodies for one in body.strips if one.placed.cell == 0),
    )


def _draft(network: StagedNetwork, stage: int, picks: PickedEdges) -> DraftedNetwork:
    try:
        return network.draft(stage, picks)
    except CqblendError as error:
        raise StagedNetworkError(network, error, network.chains[network.plan.stages[stage][0]]) from error


def _blend_stage(body: _Body, drafted: dict[DraftedNetwork, StagedNetwork], picks: PickedEdges) -> None:
    """Rewrite a body by one stage of some networks, and record what has become of everything."""
    try:
        rewritten = rewrite_solid(body.now, list(drafted))
    except FaultyNetworkError as fault:
        network = drafted[fault.network]
        raise StagedNetworkError(network, fault.cause, fault.network.chains[0]) from fault
    index, proposal = body.now, rewritten.proposal
    new_strips = [StagedStrip(drafted[placed.network], placed) for placed in rewritten.strips]
    new_patches = [StagedPatch(drafted[placed.network], placed) for placed in rewritten.patches]
    body.strips = [*(_track(one, index, proposal) for one in body.strips), *new_strips]
    body.patches = [*(_track(one, index, proposal) for one in body.patches), *new_patches]
    body.now = picks.record_rewriting(index, proposal.solid, proposal.rebuilt_faces, proposal.edge_pieces)
    body.edge_tolerance = max(body.edge_tolerance, proposal.tolerance)
    joint = rewritten.strips[0].draft.context.cells[0].joint
    body.gone_faces += tuple(joint.name_part(index.faces[number]) for number in proposal.gone_faces)
    for placed in rewritten.strips:
        context, network = placed.draft.context, drafted[placed.network]
        for end in network.find_first_ends(context.chain):
            if placed.cell == (len(context.cells) - 1 if end else 0):
                picks.record_corner(list_end_edges(placed.strip, end), context.cells[placed.cell].joint.edge_number)


_Blend = TypeVar("_Blend", StagedStrip, StagedPatch)


def _track(one: _Blend, index: SolidIndex, proposal: ProposedSolid) -> _Blend:
    """Return a blend face as it is after the solid was rewritten once more."""
    try:
        if isinstance(one, StagedStrip):
            strip = track_strip(one.placed.strip, index, proposal)
            return replace(one, placed=one.placed._replace(strip=strip))
        patch = track_patch(one.placed.patch, index, proposal)
        return replace(one, placed=one.placed._replace(patch=patch))
    except CqblendError as error:
        context = one.placed.draft.context
        raise StagedNetworkError(one.network, error.with_details(shape=context.name), context) from error


def _record_patch(certificate: Certificate, patch: StagedPatch) -> Certificate:
    """Return a certificate with the records of a face of a corner."""
    placed = patch.placed
    try:
        found = certify_corner_patch(placed)
    except CqblendError as error:
        raise StagedNetworkError(patch.network, error, placed.draft.context) from error
    crease = max(certificate.inner_crease, found.inner_crease)
    return replace(certificate, inner_crease=crease, edges=(*certificate.edges, *found.edges))


def _certify(strip: StagedStrip, body: _Body) -> Certificate:
    """Return the certificate of a blend face, with the ends of its chain if it is the first cell."""
    placed = strip.placed
    context = placed.draft.context
    try:
        certificate = certify_strip(placed, body.edge_tolerance, body.gone_faces)
    except CqblendError as error:
        raise StagedNetworkError(strip.network, error, context) from error
    if placed.cell or placed.draft.ends is None:
        return certificate
    ends = record_ends(context.end_joints, placed.draft.ends, placed.attempts)
    gone_round = strip.network.find_first_ends(context.chain)
    return replace(certificate, ends=tuple(one for end, one in enumerate(ends) if end not in gone_round))
