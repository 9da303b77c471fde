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
from cqblend.brep.selection.picked_edges import select_chains
from cqblend.brep.verification.brep_check import is_valid
from cqblend.certificate import Certificate, SkippedEdges
from cqblend.errors import CqblendError, InputError, SizeError
from cqblend.solid_blends.blend_contexts import BlendContexts
from cqblend.solid_blends.chain_context import ChainContext
from cqblend.solid_blends.held_context import HeldStripContext
from cqblend.solid_blends.size_assignment import check_edge_sizes
from cqblend.solid_blends.size_feasibility import is_possible_size, suggest_size
from cqblend.solid_blends.staged_blending import StagedNetwork, StagedNetworkError, blend_in_stages

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape


@dataclass(frozen=True)
class BlendedShape:
    """A blended shape, its blend faces in the order of the edges, and their certificate."""

    shape: TopoDS_Shape
    faces: tuple[TopoDS_Face, ...]
    certificate: Certificate


def blend_shape(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], request: BlendRequest, *, hints: bool = True
) -> BlendedShape:
    """Blend edges of a shape.

    An open chain ends before an edge that was not picked and is too small for the size, if it can. With ``hints``,
    errors of size say what may fit instead. With ``on_error="skip"`` in the request, networks of edges
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
    stops: tuple[int, ...] = ()
    fault: _FollowedTooFarError | None = None
    while True:
        try:
            return _blend_selected(shape, edges, request, stops, hints=hints)
        except _FollowedTooFarError as error:
            fault, stops = fault or error, (*stops, *error.edges)
        except CqblendError:
            if fault is None:
                raise
            raise fault.explain(hints=hints) from fault


class _FollowedTooFarError(CqblendError):
    """A chain goes on along ``edges``, by their numbers, that were not picked and are too small for it."""

    def __init__(self, edges: Sequence[int], cause: CqblendError, chain: ChainContext, picked: Sequence[int]) -> None:
        super().__init__(str(cause), kind=cause.kind)
        self.edges = tuple(edges)
        self._cause, self._chain, self._picked = cause, chain, tuple(picked)

    def explain(self, *, hints: bool) -> CqblendError:
        """Return the error that says so."""
        return _explain_following(_annotate_error(self._cause, self._chain, hints=hints), self._chain, self._picked)


def _blend_selected(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], request: BlendRequest, stops: Sequence[int], *, hints: bool
) -> BlendedShape:
    """Blend edges of a shape, and what continues them but for ``stops``, as :func:`blend_shape`.

    Raises
    ------
    _FollowedTooFarError
        An edge that was not picked is too small for the blend that goes on along it.
    """
    contexts = BlendContexts(request)
    check_edge_sizes(request, shape, edges)
    selection = select_chains(shape, edges, request.first, contexts.estimate_reach, follow=request.chain, stops=stops)
    contexts.check_held_edges(selection)
    networks: list[StagedNetwork] = []
    failures: list[SkippedEdges] = []

    def leave_out(picked: Sequence[int], error: CqblendError, chain: ChainContext | None) -> None:
        """Leave out a network of picked edges, or raise the error that stands in its way."""
        if chain is not None:
            followed = _list_followed_edges(error, chain, picked)
            is_new = bool(followed) and not set(followed) <= set(stops)
            if is_new and isinstance(error, SizeError) and _may_end_before(chain, followed, picked):
                raise _FollowedTooFarError(followed, error, chain, picked)
            error = _explain_following(_annotate_error(error, chain, hints=hints), chain, picked)
        failures.append(SkippedEdges(tuple(picked), error.kind or type(error).__name__, error.place, str(error)))
        if request.on_error == "raise" or len(failures) == len(selection.networks):
            raise error

    for found in selection.networks:
        try:
            networks.append(StagedNetwork(found, contexts))
        except CqblendError as error:
            leave_out([number for one in found for number in one.edges], error, None)
    if request.corner != "auto" and networks and not any(network.plan.obeys_corner for network in networks):
        wanted = "two of three edges picked" if request.corner == "mitre" else "all edges picked, three or more"
        raise InputError(f"corner={request.corner!r} has no effect: at no vertex are {wanted}; leave it out")
    while True:
        try:
            blend = blend_in_stages(networks, selection)
            break
        except StagedNetworkError as fault:
            other = fault.network.make_alternative(fault)
            if other is not None:
                networks[networks.index(fault.network)] = other
                continue
            networks.remove(fault.network)
            first = fault.network.failure or fault
            leave_out(fault.network.edges, first.cause, first.chain)
    result = selection.shape
    for before, after in blend.bodies:
        result = replace_body(result, before, after)
    certificate = Certificate.merge([one for network in networks for one in blend.certificates[network]])
    meant = sum(one.length for found in selection.networks for one in found)
    blended = [network.found for network in networks]
    left_out = [found for found in selection.networks if found not in blended]
    uncovered = sum(one.length for found in left_out for one in found) + blend.uncovered
    return BlendedShape(
        result,
        tuple(face for network in networks for face in blend.faces[network]),
        replace(
            certificate,
            method=certificate.method + selection.method,
            coverage=1.0 - uncovered / meant,
            blended=tuple(n for network in networks for one in network.chains for n in one.chain.edge_numbers),
            validity=(partial(is_valid, result),),
            skipped=(*selection.skipped, *failures),
        ),
    )


def _annotate_error(error: CqblendError, context: ChainContext, *, hints: bool) -> CqblendError:
    """Return an error with the edge's number and, if it is one of size, what may fit."""
    is_held = isinstance(context.cells[0], HeldStripContext)
    hint = suggest_size(context, error) if hints and isinstance(error, SizeError) and not is_held else ""
    return error.with_details(shape="" if error.shape else context.name, after=hint)


def _explain_following(error: CqblendError, context: ChainContext, picked: Sequence[int]) -> CqblendError:
    """Return an error that says how edges are left out that were not picked, if it is about one of these."""
    if not _list_followed_edges(error, context, picked):
        return error
    return error.with_details(after=f"; it continues edge {min(picked)}: chain=False blends just what is picked")


def _list_followed_edges(error: CqblendError, context: ChainContext, picked: Sequence[int]) -> list[int]:
    """Return the edges of the cell that an error is about, by their numbers, if none of them was picked."""
    cells = [cell.joint for cell in context.cells if cell.joint.name == error.shape]
    lookups = [(cell.lookup_number, edge) for cell in cells for edge in cell.spine.edges]
    numbers = [lookup(edge) for lookup, edge in lookups if lookup is not None]
    return [] if set(numbers) & set(picked) else numbers


def _may_end_before(context: ChainContext, edges: Sequence[int], picked: Sequence[int]) -> bool:
    """Whether an open chain may end before some of its edges: nothing was picked beyond these."""
    numbers = context.chain.edge_numbers
    if not set(edges) <= set(numbers):  # round a corner, of an edge that the input has not
        return False
    first, last = numbers.index(edges[0]), numbers.index(edges[-1])
    parts = (numbers[: min(first, last)], numbers[max(first, last) + 1 :])
    return not context.chain.closed and any(set(part).isdisjoint(picked) for part in parts)


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
    contexts = BlendContexts(request)
    check_edge_sizes(request, shape, edges)
    selection = select_chains(shape, edges, request.first, lambda _: np.inf, follow=request.chain)
    chains = [chain for found in selection.networks for chain in StagedNetwork(found, contexts).chains]
    return lambda factor: all(is_possible_size(chain.scale(factor)) for chain in chains), min(
        chain.index.extent for chain in chains
    )
