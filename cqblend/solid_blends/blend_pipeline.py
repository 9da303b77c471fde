"""Blend edges of a shape: select, draft every strip, rewrite and verify each solid once, certify every blend.

Works on ``TopoDS`` shapes, which it only hands on; :mod:`cqblend.api` translates those of the hosts. A result that does
not verify is never returned.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from cqblend.blend_options import BlendRequest
from cqblend.brep.bodies import replace_body
from cqblend.brep.selection.chains import Chain
from cqblend.brep.selection.held_edges import is_beside
from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.picked_edges import FoundChain, Selection, select_chains
from cqblend.brep.verification.brep_check import is_valid
from cqblend.brep.verification.patch_certification import CertifiedPatch
from cqblend.certificate import Certificate, SkippedEdges
from cqblend.errors import CqblendError, SelectionError, SizeError, UnsupportedError
from cqblend.solid_blends.blend_sizes import take_largest_sizes
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.end_plan import record_ends
from cqblend.solid_blends.held_context import HeldStripContext, make_held_context
from cqblend.solid_blends.section_methods import choose_section_method
from cqblend.solid_blends.size_assignment import assign_sizes, check_edge_sizes
from cqblend.solid_blends.size_feasibility import check_chain_size, is_possible_size, suggest_size
from cqblend.solid_blends.solid_rewriting import CertifiedStrip, DraftedNetwork, FaultyNetworkError, rewrite_solid
from cqblend.solid_blends.strip_context import StripContext

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape


@dataclass(frozen=True)
class BlendedShape:
    """A blended shape, its blend faces, by network those along edges and those at corners, and their certificate."""

    shape: TopoDS_Shape
    faces: tuple[TopoDS_Face, ...]
    certificate: Certificate


class _Contexts:
    """The contexts of all joints of a call: each made once, so that contacts are solved once."""

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
        held = [edge for edge in self.request.hold if _is_beside_chain(edge, chain)]
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

    def check_held_edges(self, selection: Selection) -> None:
        """Raise SelectionError if an edge to hold a rail on is not beside any chain that was found."""
        chains = [one.chain for network in selection.networks for one in network if one.chain is not None]
        for edge in self.request.hold:
            if not any(_is_beside_chain(edge, chain) for chain in chains):
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


def blend_shape(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], request: BlendRequest, *, hints: bool = True
) -> BlendedShape:
    """Blend edges of a shape.

    With ``hints``, errors of size say what may fit instead. With ``on_error="skip"`` in the request, networks of edges
    that cannot be blended are left out, as long as others can.

    Raises
    ------
    SelectionError
        An edge is foreign, a seam, degenerate, not between two faces of one solid or shell, or smooth already.
    SizeError
        The size does not fit; the message names the largest that does, where that is known.
    CqblendError
        Whatever else stands in the way, by its own type. The input is never changed.
    """
    contexts = _Contexts(request)
    check_edge_sizes(request, shape, edges)
    selection = select_chains(shape, edges, request.first, contexts.estimate_reach, follow=request.chain)
    contexts.check_held_edges(selection)
    networks: list[DraftedNetwork] = []
    failures: list[SkippedEdges] = []

    def leave_out(picked: Sequence[int], error: CqblendError, chain: ChainContext | None) -> None:
        """Leave out a network of picked edges, or raise the error that stands in its way."""
        if chain is not None:
            error = _explain_following(_annotate_error(error, chain, hints=hints), chain, picked)
        failures.append(SkippedEdges(tuple(picked), error.kind or type(error).__name__, error.place, str(error)))
        if request.on_error == "raise" or len(failures) == len(selection.networks):
            raise error

    for found in selection.networks:
        picked = [number for one in found for number in one.edges]
        chain: ChainContext | None = None
        try:
            chain = _require_chain(found, contexts, hints=hints)
            networks.append(DraftedNetwork(picked, [chain]))
        except CqblendError as error:
            leave_out(picked, error, chain)
    result, strips = selection.shape, dict[DraftedNetwork, Sequence[CertifiedStrip]]()
    patches: dict[DraftedNetwork, Sequence[CertifiedPatch]] = {}
    for index in dict.fromkeys(network.index for network in networks):
        own = [network for network in networks if network.index is index]
        while own:
            try:
                rewritten = rewrite_solid(index, own)
            except FaultyNetworkError as fault:
                own.remove(fault.network)
                leave_out(fault.network.edges, fault.cause, fault.network.chains[0])
                continue
            strips |= rewritten.strips
            patches |= rewritten.patches
            result = replace_body(result, index.solid, rewritten.solid)
            break
    blended = [network for network in networks if network in strips]
    certificates = [
        _record_patches(_record_strip_ends(network, strips[network]), patches.get(network, ())) for network in blended
    ]
    certificate = Certificate.merge([one for some in certificates for one in some])
    return BlendedShape(
        result,
        tuple(face for network in blended for face in _list_faces(strips[network], patches.get(network, ()))),
        replace(
            certificate,
            method=certificate.method + selection.method,
            coverage=_measure_coverage(selection, blended),
            blended=tuple(n for network in blended for one in network.chains for n in one.chain.edge_numbers),
            validity=(partial(is_valid, result),),
            skipped=(*selection.skipped, *failures),
        ),
    )


def _measure_coverage(selection: Selection, blended: Sequence[DraftedNetwork]) -> float:
    """Return the blended length over that of all edges that were meant: picked, or on a chain with those."""
    done = {network.edges for network in blended}
    left_out = [found for found in selection.networks if tuple(n for one in found for n in one.edges) not in done]
    uncovered = sum(one.length for found in left_out for one in found)
    uncovered += sum(draft.uncovered for network in blended for draft in network.drafts)
    return 1.0 - uncovered / sum(one.length for found in selection.networks for one in found)


def _is_beside_chain(edge: TopoDS_Edge, chain: Chain) -> bool:
    """Whether an edge bounds a face beside a cell of a chain."""
    return any(is_beside(edge, cell) for cell in chain.cells)


def _record_strip_ends(network: DraftedNetwork, strips: Sequence[CertifiedStrip]) -> list[Certificate]:
    """Return the certificates of a network's strips, with the records of the ends of its chains; warn of flat ends."""
    certificates = [strip.certificate for strip in strips]
    first = 0
    for attempts, draft in zip(network.attempts, network.drafts, strict=True):
        if draft.ends is not None:
            ends = record_ends(draft.context.end_joints, draft.ends, attempts)
            certificates[first] = replace(certificates[first], ends=ends)
        first += len(draft.blends)
    return certificates


def _list_faces(strips: Sequence[CertifiedStrip], patches: Sequence[CertifiedPatch]) -> list[TopoDS_Face]:
    """Return the blend faces of a network: along edges, then at corners."""
    return [*(strip.face for strip in strips), *(patch.face for patch in patches)]


def _record_patches(certificates: list[Certificate], patches: Sequence[CertifiedPatch]) -> list[Certificate]:
    """Return the certificates of a network's strips, the first of them with the records of its corners."""
    if not patches:
        return certificates
    first, *others = certificates
    crease = max(first.inner_crease, *(patch.inner_crease for patch in patches))
    edges = (*first.edges, *(edge for patch in patches for edge in patch.edges))
    return [replace(first, inner_crease=crease, edges=edges), *others]


def _require_chain(found: Sequence[FoundChain], contexts: _Contexts, *, hints: bool) -> ChainContext:
    """Return the chain of a network, of which there must be one.

    Raises
    ------
    SelectionError
        One of the edges is no joint.
    UnsupportedError
        There are several.
    SizeError
        There are several, but one of them is too small or too large for the size anyway.
    """
    chains = []
    for one in found:
        if one.error is not None:
            raise one.error
        if one.chain is not None:
            chains.append(contexts.get_chain(one.chain, one.edges))
    if len(chains) > 1:
        for chain in chains:
            try:
                check_chain_size(chain)
            except SizeError as error:
                raise _annotate_error(error, chain, hints=hints) from error
        raise UnsupportedError(
            f"{chains[0].name} shares a vertex with {chains[1].name}, and corners are not built yet; pick edges "
            "without common vertices"
        )
    return chains[0]


def _annotate_error(error: CqblendError, context: ChainContext, *, hints: bool) -> CqblendError:
    """Return an error with the edge's number and, if it is one of size, what may fit."""
    is_held = isinstance(context.cells[0], HeldStripContext)
    hint = suggest_size(context, error) if hints and isinstance(error, SizeError) and not is_held else ""
    return error.with_details(shape="" if error.shape else context.name, after=hint)


def _explain_following(error: CqblendError, context: ChainContext, picked: Sequence[int]) -> CqblendError:
    """Return an error that says how edges are left out that were not picked, if it is about one of these."""
    names = [cell.joint.name for cell in context.cells if cell.joint.edge_number not in picked]
    if error.shape not in names:
        return error
    return error.with_details(after=f"; it continues edge {min(picked)}: chain=False blends just what is picked")


def make_cheap_trial(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], request: BlendRequest
) -> tuple[Callable[[float], bool], float]:
    """Return a trial of sizes that only solves contacts, and the extent (mm) of the smallest solid.

    The trial tells, for a factor on the request, whether the contacts on both faces of every joint pass.

    Raises
    ------
    CqblendError
        As :func:`blend_shape`, of what no size would mend.
    """
    contexts = _Contexts(request)
    check_edge_sizes(request, shape, edges)
    selection = select_chains(shape, edges, request.first, lambda _: np.inf, follow=request.chain)
    chains = [_require_chain(found, contexts, hints=True) for found in selection.networks]
    return lambda factor: all(is_possible_size(chain.scale(factor)) for chain in chains), min(
        chain.index.extent for chain in chains
    )
