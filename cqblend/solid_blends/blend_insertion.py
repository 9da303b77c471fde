"""Put a blend that was made between surfaces into a shape, in the place of an edge between faces on these surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.bodies import replace_body
from cqblend.brep.selection.chains import Chain
from cqblend.brep.selection.picked_edges import FoundChain, select_chains
from cqblend.brep.shell_editing.end_curve import BlendEndError
from cqblend.brep.shell_editing.plan_application import apply_plan
from cqblend.brep.shell_editing.strip_placement import place_strip
from cqblend.brep.shell_editing.strip_planning import (
    FaultyChainError,
    PlacedChain,
    ShortChainsError,
    merge_chains,
    plan_network,
)
from cqblend.brep.verification.blend_certification import certify_blend
from cqblend.brep.verification.brep_check import is_valid
from cqblend.brep.verification.solid_verification import check_solid
from cqblend.certificate import Certificate
from cqblend.errors import CqblendError, GeometryError, SelectionError, TopologyError, VerificationError
from cqblend.solid_blends.blend_alignment import align_to_joint
from cqblend.solid_blends.blend_pipeline import BlendedShape
from cqblend.solid_blends.end_plan import EndPlan, record_ends
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape


def insert_into_shape(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], blend: BlendSurface, first: TopoDS_Face | None
) -> BlendedShape:
    """Put a blend into a shape; ``first`` is the face that counts as side 1.

    Raises
    ------
    SelectionError
        As :func:`cqblend.solid_blends.blend_pipeline.blend_shape`, or the edges are several joints.
    InputError
        The blend's rails do not lie on the two faces.
    CqblendError
        The blend does not fit into the shape.
    """
    found = [one for network in select_chains(shape, edges, first, None, follow=True).networks for one in network]
    for one in found:
        if one.error is not None:
            raise one.error
    chain = _take_single_chain(found)
    (joint,) = chain.cells
    try:
        return _insert_into_chain(shape, chain, blend)
    except ShortChainsError as error:
        (low, high), (first_t, last_t) = error.needed_domains[0], blend.ribbons[0].c.domain
        raise GeometryError(
            "the blend ends before it meets the faces at the ends of the edge: it runs over t = "
            f"{first_t:.4g} to {last_t:.4g}, and would have to over {low:.4g} to {high:.4g}; extend the surfaces that "
            "it is made between",
            shape=joint.name,
        ) from error
    except BlendEndError as error:
        before = f"the blend cannot end at {joint.name_end(error.end)}: "
        raise error.cause.with_details(before=before).with_details(shape=joint.name) from error
    except CqblendError as error:
        raise error.with_details(shape=joint.name) from error


def _take_single_chain(found: Sequence[FoundChain]) -> Chain:
    """Return the chain of one joint that picked edges are; an error if there are more, or if it goes on in others."""
    chains = [one.chain for one in found if one.chain is not None]
    picked = {number for one in found for number in one.edges}
    picked_cells = [(chain, k) for chain in chains for k, cell in enumerate(chain.cells) if cell.edge_number in picked]
    if len(picked_cells) > 1:
        raise SelectionError("the edges belong to several joints: a blend takes the place of one")
    ((chain, k),) = picked_cells
    if len(chain.cells) > 1:
        end = int(k < len(chain.junctions))  # it goes on after the last cell, too, if the chain is closed
        following = chain.cells[(k + 1) % len(chain.cells) if end else k - 1]
        raise TopologyError(
            f"the blend cannot end at {chain.cells[k].name_end(end)}: the joint goes on there in {following.name}, and "
            "a blend of surfaces takes the place of one between two faces; blend_edges blends all of them",
            shape=chain.cells[k].name,
        )
    return chain


def _insert_into_chain(shape: TopoDS_Shape, chain: Chain, blend: BlendSurface) -> BlendedShape:
    """Put a blend in the place of a chain of one joint, and verify and certify the result."""
    (joint,) = chain.cells
    aligned = align_to_joint(joint, blend)
    natural = EndPlan.natural_at_both_ends(aligned.surface.domain[0])
    placed = PlacedChain(chain, (place_strip(joint, aligned),), natural.cap_stations)
    try:
        planned = plan_network([placed])
    except FaultyChainError as fault:
        raise fault.cause from fault
    proposal = apply_plan(joint.index, merge_chains(joint.index, planned))
    (built,) = proposal.strips
    tolerance = max(SOLID_BLEND_TOLERANCES.edge, 2 * joint.tolerance)
    check = check_solid(
        joint.solid,
        proposal.solid,
        [built.blend_face],
        grows=[not joint.is_convex],
        tolerance=tolerance,
        free_edges=proposal.free_edges,
    )
    if check.problems:
        raise VerificationError("the solid did not verify and is withheld: " + "; ".join(check.problems[:4]))
    result = replace_body(shape, joint.solid, proposal.solid)
    certificate: Certificate = replace(
        certify_blend(joint, built, aligned, proposal.tolerance),
        validity=(partial(is_valid, result),),
        blended=chain.edge_numbers,
        ends=() if joint.spine.closed else record_ends((joint, joint), natural),
    )
    return BlendedShape(result, (built.blend_face,), certificate)
