"""Rewrite one solid with all its blends at once, verify the result once, and find the blend at fault if that fails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

from cqblend.blends.network.blend_plan import PatchPlan, StripPlan
from cqblend.brep.selection.blend_corners import BlendCorner, ChainEnd
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.consumed_faces import check_swallowed_faces
from cqblend.brep.shell_editing.plan_application import BuiltPatch, BuiltStrip, ProposedSolid, apply_plan
from cqblend.brep.shell_editing.planned_solid import FaceConflictError, PlannedSolid
from cqblend.brep.shell_editing.remaining_faces import settle_faces
from cqblend.brep.shell_editing.strip_planning import ChainConflictError, merge_chains
from cqblend.brep.verification.blend_certification import certify_blend
from cqblend.brep.verification.patch_certification import CertifiedPatch, certify_patch
from cqblend.brep.verification.solid_verification import check_solid
from cqblend.certificate import Certificate
from cqblend.errors import CqblendError, SizeError, UnsupportedError, VerificationError
from cqblend.solid_blends.blend_acceptance import check_patch_promises, check_promises
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.chain_draft import ChainDraft
from cqblend.solid_blends.end_plan import EndAttempts
from cqblend.solid_blends.held_context import HeldStripContext
from cqblend.solid_blends.held_draft import HeldDrafts
from cqblend.solid_blends.network_draft import NetworkDrafts
from cqblend.solid_blends.strip_context import StripContext
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES


class DraftedNetwork:
    """A network of edges that touch, with the present draft of each of its chains.

    ``corners`` are where ends of chains meet; ``natural_ends`` are natural, whatever ends were asked for.

    Raises
    ------
    CqblendError
        If a chain has no draft.
    """

    def __init__(
        self,
        chains: Sequence[ChainContext],
        corners: Sequence[BlendCorner] = (),
        natural_ends: Sequence[ChainEnd] = (),
    ) -> None:
        self.chains = tuple(chains)
        self._source = _choose_drafts(chains, corners, natural_ends)
        self.drafts = self._source.make_first()

    @property
    def attempts(self) -> tuple[EndAttempts, ...]:
        """Which ends of each chain were tried."""
        return self._source.attempts

    @property
    def index(self) -> SolidIndex:
        """Facts of the solid that the network is part of."""
        return self.chains[0].index

    @property
    def name(self) -> str:
        """What messages call it: its first edge."""
        return self.chains[0].name

    def make_next(self, failure: CqblendError) -> None:
        """Replace the drafts by the next ones, because the present ones turned out to fail.

        Raises
        ------
        CqblendError
            If there are none.
        """
        self.drafts = self._source.make_next(failure)


def _choose_drafts(
    chains: Sequence[ChainContext], corners: Sequence[BlendCorner], natural_ends: Sequence[ChainEnd]
) -> NetworkDrafts | HeldDrafts:
    """Return the drafts of a network; of one chain, a rail may be held on an edge."""
    for context in chains:
        first = context.cells[0]
        if isinstance(first, HeldStripContext):
            if len(chains) > 1:
                raise UnsupportedError("a rail is held on an edge beside it, and its ends meet no other blends yet")
            return HeldDrafts(context, first)
    return NetworkDrafts(chains, corners, natural_ends)


class FaultyNetworkError(CqblendError):
    """One network cannot be blended in its solid: ``cause`` is why."""

    def __init__(self, network: DraftedNetwork, cause: CqblendError) -> None:
        super().__init__(str(cause), kind=cause.kind)
        self.network = network
        self.cause = cause


class PlacedStrip(NamedTuple):
    """A blend face in a verified solid, and the draft of its chain, of which it is cell ``cell``."""

    network: DraftedNetwork
    draft: ChainDraft
    attempts: EndAttempts
    cell: int
    strip: BuiltStrip


class PlacedPatch(NamedTuple):
    """A face of a corner in a verified solid, and the draft of a chain that ends there, at its cell ``cell``."""

    network: DraftedNetwork
    draft: ChainDraft
    cell: int
    patch: BuiltPatch


@dataclass(frozen=True)
class RewrittenSolid:
    """A solid with blends as it is proposed, verified, and its blend faces."""

    proposal: ProposedSolid
    strips: Sequence[PlacedStrip]
    patches: Sequence[PlacedPatch]


def rewrite_solid(index: SolidIndex, networks: Sequence[DraftedNetwork]) -> RewrittenSolid:
    """Rewrite a solid with all blends of some networks, and verify it.

    Raises
    ------
    FaultyNetworkError
        If that fails because of one of them.
    """
    while True:
        try:
            proposal = _propose_solid(index, networks)
            break
        except CqblendError as error:
            fault = _find_fault(index, networks, error)
        try:
            fault.network.make_next(fault.cause)
        except CqblendError as last:
            raise FaultyNetworkError(fault.network, last) from last
    cells = zip(_list_cells(networks), proposal.strips, strict=True)
    return RewrittenSolid(
        proposal,
        [PlacedStrip(*cell, built) for cell, built in cells],
        [PlacedPatch(*_find_patch_owner(networks, patch.plan), patch) for patch in proposal.patches],
    )


def _find_patch_owner(networks: Sequence[DraftedNetwork], patch: PatchPlan) -> tuple[DraftedNetwork, ChainDraft, int]:
    """Return the network that a patch belongs to, and a chain that ends there, with its cell at that end."""
    for network, draft, _, k in _list_cells(networks):
        joint = draft.context.cells[k].joint
        if patch.spine[0] in map(joint.index.edges.find_number, joint.spine.edges):
            return network, draft, k
    raise KeyError(patch.spine[0])


def _list_cells(networks: Sequence[DraftedNetwork]) -> list[tuple[DraftedNetwork, ChainDraft, EndAttempts, int]]:
    """Return every cell of networks: its network, the draft of its chain and the attempts at its ends, its index."""
    return [
        (network, draft, attempts, k)
        for network in networks
        for attempts, draft in zip(network.attempts, network.drafts, strict=True)
        for k in range(len(draft.blends))
    ]


def certify_strip(placed: PlacedStrip, edge_tolerance: float, gone_faces: Sequence[str]) -> Certificate:
    """Measure a blend, and check that it measures up to what it promises.

    ``edge_tolerance`` is the largest of an edge that was made or cut (mm), ``gone_faces`` are names of faces that the
    blends of the solid have taken the place of.
    """
    context, blend = placed.draft.context.cells[placed.cell], placed.draft.blends[placed.cell]
    certificate = certify_blend(context.joint, placed.strip, blend, edge_tolerance)
    if gone_faces:
        certificate = replace(certificate, method=f"{certificate.method}, {', '.join(gone_faces)} gone")
    check_promises(certificate, context, blend)
    return certificate


def certify_corner_patch(placed: PlacedPatch) -> CertifiedPatch:
    """Measure a face of a corner, and check that it measures up to what the blends there promise."""
    context = placed.draft.context.cells[placed.cell]
    certified = certify_patch(context.joint, placed.patch)
    check_patch_promises(certified, context)
    return certified


def _propose_solid(index: SolidIndex, networks: Sequence[DraftedNetwork]) -> ProposedSolid:
    """Rewrite a solid by the present drafts of networks, and verify it.

    Raises
    ------
    CqblendError
        If the blends do not fit together, or the result does not verify.
    """
    drafts = [draft for network in networks for draft in network.drafts]
    cells = [cell for draft in drafts for cell in draft.context.cells]
    plan = merge_chains(index, [draft.planned for draft in drafts])
    convex, name_part = [cell.joint.is_convex for cell in cells], cells[0].joint.name_part
    planned = settle_faces(PlannedSolid(index, plan, convex, name_part))
    proposal = apply_plan(index, planned.plan)
    blend_faces = [strip.blend_face for strip in proposal.strips]
    check_swallowed_faces(planned, proposal.solid, blend_faces)
    grows = [not cell.joint.is_convex for cell in cells]
    check = check_solid(
        index.solid,
        proposal.solid,
        [*blend_faces, *(patch.face for patch in proposal.patches)],
        grows=[*grows, *(_grows_patch(patch.plan, planned.plan.strips, grows) for patch in proposal.patches)],
        tolerance=max(map(_get_edge_tolerance, cells)),
        index_before=index.faces,
        free_edges=proposal.free_edges,
    )
    if check.crosses:
        raise SizeError("the blend runs into another boundary or face: the size is too large for it", kind="too large")
    if check.problems:
        raise VerificationError("the blended solid did not verify and is withheld: " + "; ".join(check.problems[:4]))
    return proposal


def _grows_patch(patch: PatchPlan, strips: Sequence[StripPlan], grows: Sequence[bool]) -> bool | None:
    """Whether a patch adds material, as all strips beside it do; None if some do, and others remove it."""
    found = {grow for strip, grow in zip(strips, grows, strict=True) if set(strip.spine) & set(patch.spine)}
    return found.pop() if len(found) == 1 else None


def _get_edge_tolerance(context: StripContext) -> float:
    """Return the largest tolerance (mm) that a new edge of a strip may have."""
    return max(SOLID_BLEND_TOLERANCES.edge, 2 * context.joint.tolerance, 2 * context.method.request.tolerance)


def _find_fault(index: SolidIndex, networks: Sequence[DraftedNetwork], error: CqblendError) -> FaultyNetworkError:
    """Return which of some networks is to blame for an error: one that fails alone, or with those before it."""
    if isinstance(error, FaceConflictError):
        owners = [network for network, *_ in _list_cells(networks)]
        first, last = owners[error.strips[0]], owners[error.strips[-1]]
        return FaultyNetworkError(last, _name_partner(error.cause, first) if last is not first else error.cause)
    if isinstance(error, ChainConflictError):
        chains = [network for network in networks for _ in network.drafts]
        first, last = chains[error.chains[0]], chains[error.chains[-1]]
        return FaultyNetworkError(last, _name_partner(error.cause, first) if last is not first else error.cause)
    if len(networks) == 1:
        return FaultyNetworkError(networks[0], error)
    for network in networks:
        failure = _try_networks(index, [network])
        if failure is not None:
            return FaultyNetworkError(network, failure)
    for count in range(2, len(networks) + 1):
        failure, last = _try_networks(index, networks[:count]), networks[count - 1]
        if failure is not None:
            partners = (one for one in networks[: count - 1] if _try_networks(index, [one, last]) is not None)
            return FaultyNetworkError(last, _name_partner(failure, next(partners, networks[0])))
    return FaultyNetworkError(networks[-1], error)


def _try_networks(index: SolidIndex, networks: Sequence[DraftedNetwork]) -> CqblendError | None:
    """Return why some networks cannot be in one solid; None if they can."""
    try:
        _propose_solid(index, networks)
    except CqblendError as error:
        return error
    return None


def _name_partner(error: CqblendError, network: DraftedNetwork) -> CqblendError:
    """Return an error that says together with which other blend it came about."""
    return error.with_details(after=f", together with the blend of {network.name}")
