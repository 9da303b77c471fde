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
from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.picked_edges import FoundChain, select_joints
from cqblend.brep.verification.brep_check import is_valid
from cqblend.certificate import Certificate, SkippedEdges
from cqblend.errors import CqblendError, SizeError, UnsupportedError
from cqblend.solid_blends.end_plan import record_ends
from cqblend.solid_blends.section_methods import SectionMethod, choose_section_method
from cqblend.solid_blends.size_feasibility import check_size, is_possible_size, suggest_size
from cqblend.solid_blends.solid_rewriting import CertifiedStrip, DraftedNetwork, FaultyNetworkError, rewrite_solid
from cqblend.solid_blends.strip_context import StripContext

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape


@dataclass(frozen=True)
class BlendedShape:
    """A blended shape, its blend faces in the order of the edges, and their certificate."""

    shape: TopoDS_Shape
    faces: tuple[TopoDS_Face, ...]
    certificate: Certificate


class _Contexts:
    """The context of every joint of a call: made once, so that contacts are solved once."""

    def __init__(self, method: SectionMethod) -> None:
        self.method = method
        self._of_joint: dict[Joint, StripContext] = {}

    def get(self, joint: Joint) -> StripContext:
        """Return the context of a joint."""
        return self._of_joint.setdefault(joint, StripContext(joint, self.method))

    def estimate_reach(self, joint: Joint) -> float:
        """Return the largest distance (mm) of the rails from the edge; 0 where they are not found."""
        try:
            return self.get(joint).measure_reach()
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
    contexts = _Contexts(choose_section_method(request))
    selection = select_joints(shape, edges, request.first, contexts.estimate_reach)
    networks: list[DraftedNetwork] = []
    failures: list[SkippedEdges] = []

    def leave_out(picked: Sequence[int], error: CqblendError, joint: Joint | None) -> None:
        """Leave out a network of picked edges, or raise the error that stands in its way."""
        if joint is not None:
            error = _annotate_error(error, contexts.get(joint), hints=hints)
        failures.append(SkippedEdges(tuple(picked), error.kind or type(error).__name__, error.place, str(error)))
        if request.on_error == "raise" or len(failures) == len(selection.networks):
            raise error

    for chains in selection.networks:
        picked = [number for chain in chains for number in chain.edges]
        joint: Joint | None = None
        try:
            joints = _require_joints(chains, contexts, hints=hints)
            joint = joints[0]
            networks.append(DraftedNetwork(picked, list(map(contexts.get, joints))))
        except CqblendError as error:
            leave_out(picked, error, joint)
    result, strips = selection.shape, dict[DraftedNetwork, Sequence[CertifiedStrip]]()
    for index in dict.fromkeys(network.index for network in networks):
        own = [network for network in networks if network.index is index]
        while own:
            try:
                rewritten = rewrite_solid(index, own)
            except FaultyNetworkError as fault:
                own.remove(fault.network)
                leave_out(fault.network.edges, fault.cause, fault.network.contexts[0].joint)
                continue
            strips |= rewritten.strips
            result = replace_body(result, index.solid, rewritten.solid)
            break
    blended = [network for network in networks if network in strips]
    certificates = [_record_strip_ends(network, strips[network]) for network in blended]
    certificate = Certificate.merge([one for some in certificates for one in some])
    return BlendedShape(
        result,
        tuple(strip.face for network in blended for strip in strips[network]),
        replace(
            certificate,
            method=certificate.method + selection.method,
            validity=(partial(is_valid, result),),
            skipped=(*selection.skipped, *failures),
        ),
    )


def _record_strip_ends(network: DraftedNetwork, strips: Sequence[CertifiedStrip]) -> list[Certificate]:
    """Return the certificates of a network's strips with the records of their ends; warn of ends that are flat."""
    return [
        strip.certificate
        if draft.ends is None
        else replace(strip.certificate, ends=record_ends(draft.context.joint, draft.ends, source.attempts))
        for source, draft, strip in zip(network.sources, network.drafts, strips, strict=True)
    ]


def _require_joints(chains: Sequence[FoundChain], contexts: _Contexts, *, hints: bool) -> list[Joint]:
    """Return the joints of a network, of which there must be one.

    Raises
    ------
    SelectionError
        One of the edges is no joint.
    UnsupportedError
        There are several.
    SizeError
        There are several, but one of them is too small or too large for the size anyway.
    """
    joints = []
    for chain in chains:
        if chain.error is not None:
            raise chain.error
        if chain.joint is not None:
            joints.append(chain.joint)
    if len(joints) > 1:
        for joint in joints:
            try:
                check_size(contexts.get(joint))
            except SizeError as error:
                raise _annotate_error(error, contexts.get(joint), hints=hints) from error
        first, second = chains[0].edges[0], chains[1].edges[0]
        raise UnsupportedError(
            f"edge {first} shares a vertex with edge {second}, and corners and chains over several faces are not built "
            "yet; pick edges without common vertices"
        )
    return joints


def _annotate_error(error: CqblendError, context: StripContext, *, hints: bool) -> CqblendError:
    """Return an error with the edge's number and, if it is one of size, what may fit."""
    hint = suggest_size(context) if hints and isinstance(error, SizeError) else ""
    return error.with_details(shape="" if error.shape else context.joint.name, after=hint)


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
    contexts = _Contexts(choose_section_method(request))
    selection = select_joints(shape, edges, request.first, lambda _: np.inf)
    joints = [joint for chains in selection.networks for joint in _require_joints(chains, contexts, hints=True)]
    return lambda factor: all(is_possible_size(contexts.get(joint).scale(factor)) for joint in joints), min(
        joint.extent for joint in joints
    )
