"""Blend edges of a solid: a blend surface for each joint, put into the solid, verified and certified.

Works on ``TopoDS`` shapes, which it only hands on; :mod:`cqblend.api` translates those of the hosts. A result that does
not verify is never returned.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from cqblend.blend_options import BlendRequest
from cqblend.blends.quality.creases import check_creases
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.pending_edges import PendingEdges
from cqblend.brep.selection.unified_faces import unify_faces
from cqblend.brep.shell_editing.blend_placement import place_blend
from cqblend.brep.shell_editing.end_curve import BlendEndError
from cqblend.brep.shell_editing.face_edits import CapStations
from cqblend.brep.shell_editing.shell_edit import ProposedSolid, RailsTooShortError, blend_closed_edge, blend_open_edge
from cqblend.brep.topology import replace_solid
from cqblend.brep.verification.blend_certification import certify_blend
from cqblend.brep.verification.brep_check import is_valid
from cqblend.brep.verification.solid_verification import ReplacementCheck, check_solid
from cqblend.certificate import Certificate, EndRecord
from cqblend.errors import (
    CqblendError,
    GeometryError,
    SelectionError,
    SizeError,
    TopologyError,
    UnsupportedError,
    VerificationError,
)
from cqblend.solid_blends import size_feasibility
from cqblend.solid_blends.blend_acceptance import check_promises, check_sections, get_crease_limits
from cqblend.solid_blends.blend_alignment import align_to_joint
from cqblend.solid_blends.blend_construction import fit_rails, make_blend_surface, make_contact_solver
from cqblend.solid_blends.end_plan import EndAttempts, EndPlan, plan_ends, record_ends
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape


def blend_shape(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], request: BlendRequest, *, hints: bool = True
) -> tuple[TopoDS_Shape, tuple[TopoDS_Face, ...], Certificate]:
    """Blend edges of a shape, one joint after the other; return the new shape, the blend faces, and the certificate.

    With ``hints``, errors of size say what may fit instead.

    Raises
    ------
    SelectionError
        An edge is foreign, a seam, degenerate, not between two faces of one closed solid, or smooth already.
    SizeError
        The size does not fit; the message names the largest that does, where that is known.
    CqblendError
        Whatever else stands in the way, by its own type. The input is never changed.
    """
    faces, certificates = [], []
    picks, before = PendingEdges(shape, edges, request.first), shape
    while picks:
        shape, joint = _unify_next_joint(shape, picks, request)
        _take_joint(shape, picks, joint, request, hints=hints)
        try:
            proposal, blend, plan, ends = _blend_joint(joint, request)
        except CqblendError as error:
            raise _annotate_error(error, joint, request, hints=hints) from error
        certificate = certify_blend(joint, proposal, blend)
        if plan is not None:
            certificate = replace(certificate, coverage=plan.coverage, ends=ends)
        check_promises(certificate, request, joint, get_crease_limits(request).find_limit(blend.ribbons))
        shape = replace_solid(shape, joint.solid, proposal.solid)
        faces.append(proposal.blend_face)
        certificates.append(replace(certificate, method=certificate.method + picks.describe_unified_faces()))
    certificate = Certificate.merge(certificates)
    return shape, tuple(faces), replace(certificate, valid=_check_still_valid(before, shape), skipped=picks.skipped)


def _check_still_valid(before: TopoDS_Shape, after: TopoDS_Shape) -> bool:
    """Whether OCCT's ordinary check accepts a result; it may refuse it only if it refuses what that was made from.

    Raises
    ------
    VerificationError
        If a valid shape became invalid.
    """
    if is_valid(after):
        return True
    if is_valid(before):
        raise VerificationError("the blended shape is not valid as a whole, and is withheld; blend fewer edges at once")
    return False


def _unify_next_joint(
    shape: TopoDS_Shape, picks: PendingEdges, request: BlendRequest, *, everything: bool = False
) -> tuple[TopoDS_Shape, Joint]:
    """Return the next joint, and the shape in which its faces are united with others on the same surfaces.

    Only those within reach of the blend are united, or ``everything``. That is repeated, as a joint between united
    faces may be longer and come near to more faces.
    """

    def estimate_reach(joint: Joint) -> float:
        if everything:
            return np.inf
        try:
            return size_feasibility.measure_reach(joint, request, make_contact_solver)
        except CqblendError:
            return 0.0  # whatever is wrong is raised later, about the joint as it is then

    joint = picks.find_next_joint(shape)
    while (united := unify_faces(joint, partial(estimate_reach, joint))) is not None:
        picks.record_unified_faces(united)
        shape = replace_solid(shape, joint.solid, united.solid)
        joint = picks.find_next_joint(shape)
    return shape, joint


def _take_joint(shape: TopoDS_Shape, picks: PendingEdges, joint: Joint, request: BlendRequest, *, hints: bool) -> None:
    """Mark the edges of a joint as blended.

    Raises
    ------
    UnsupportedError
        The joint cannot be blended together with others that were picked.
    SizeError
        That is so, but one of them is too small for the size anyway.
    """
    try:
        picks.take_joint(joint)
    except UnsupportedError:
        for one in picks.find_joints(shape):
            try:
                size_feasibility.check_size(one, request, make_contact_solver)
            except SizeError as error:
                raise _annotate_error(error, one, request, hints=hints) from error
        raise


def _annotate_error(error: CqblendError, joint: Joint, request: BlendRequest, *, hints: bool) -> CqblendError:
    """Return an error with the edge's number and, if it is one of size, what may fit."""
    hint = (
        size_feasibility.suggest_size(joint, request, make_contact_solver)
        if hints and isinstance(error, SizeError)
        else ""
    )
    return error.with_details(shape=joint.name, after=hint)


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
    picks = PendingEdges(shape, edges, request.first)
    joints = []
    while picks:
        shape, joint = _unify_next_joint(shape, picks, request, everything=True)
        joints.append(picks.take_joint(joint))
    extent = min(joint.extent for joint in joints)
    return lambda factor: all(
        size_feasibility.is_possible_size(joint, request.with_scaled_lengths(factor), make_contact_solver)
        for joint in joints
    ), extent


def insert_into_shape(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], blend: BlendSurface, first: TopoDS_Face | None
) -> tuple[TopoDS_Shape, TopoDS_Face, Certificate]:
    """Put a blend that was made between surfaces into a shape, in the place of an edge between faces on these surfaces.

    ``first`` is the face that counts as side 1.

    Raises
    ------
    SelectionError
        As :func:`blend_shape`, or the edges are several joints.
    InputError
        The blend's rails do not lie on the two faces.
    CqblendError
        The blend does not fit into the shape.
    """
    picks = PendingEdges(shape, edges, first)
    joint = picks.take_joint(picks.find_next_joint(shape))
    if picks:
        raise SelectionError("the edges belong to several joints: a blend takes the place of one")
    try:
        return _insert_at_joint(shape, joint, blend)
    except RailsTooShortError as error:
        (low, high), (first_t, last_t) = error.needed_domain, blend.ribbons[0].c.domain
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


def _insert_at_joint(
    shape: TopoDS_Shape, joint: Joint, blend: BlendSurface
) -> tuple[TopoDS_Shape, TopoDS_Face, Certificate]:
    """Put a blend in the place of a joint; return the shape, the blend's face and the certificate."""
    aligned = align_to_joint(joint, blend)
    natural = EndPlan.natural_at_both_ends(aligned.surface.domain[0])
    proposal = _rewrite_solid(joint, aligned, natural.cap_stations)
    check = _check_proposal(joint, proposal, max(SOLID_BLEND_TOLERANCES.edge, 2 * joint.tolerance))
    if check.problems:
        raise VerificationError("the solid did not verify and is withheld: " + "; ".join(check.problems[:4]))
    result = replace_solid(shape, joint.solid, proposal.solid)
    ends = () if joint.spine.closed else record_ends(joint, natural)
    valid = _check_still_valid(shape, result)
    return result, proposal.blend_face, replace(certify_blend(joint, proposal, aligned), valid=valid, ends=ends)


def _blend_joint(
    joint: Joint, request: BlendRequest
) -> tuple[ProposedSolid, BlendSurface, EndPlan | None, tuple[EndRecord, ...]]:
    """Propose a blended solid and verify it, an open one with the first ends, of those asked for, that can be built."""
    size_feasibility.check_size(joint, request, make_contact_solver)
    if joint.spine.closed:
        return *_propose_solid(joint, request, (None, None), (0.0, 1.0)), None, ()
    attempts = EndAttempts(request.ends[::-1] if joint.is_backward else request.ends)
    solve = make_contact_solver(joint, request)
    for methods in attempts:
        try:
            plan = plan_ends(joint, solve, methods)
            proposal, blend = _propose_solid(joint, request, plan.cap_stations, plan.rail_range)
        except (BlendEndError, SizeError, TopologyError, VerificationError) as error:
            attempts.record_failure(methods, error)
        else:
            return proposal, blend, plan, record_ends(joint, plan, attempts)
    raise attempts.make_error(joint)


def _propose_solid(
    joint: Joint, request: BlendRequest, caps: CapStations, domain: tuple[float, float]
) -> tuple[ProposedSolid, BlendSurface]:
    """Blend between given ends, over at least the given range of t, and verify the result."""
    for _ in range(SOLID_BLEND_TOLERANCES.max_rail_fits):
        blend = make_blend_surface(fit_rails(joint, request, domain), joint, request)
        check_sections(blend, request)
        first, second = joint.face_numbers
        check_creases(
            blend, get_crease_limits(request), (f"face {first}", f"face {second}"), steers=request.relation is None
        )
        try:
            proposal = _rewrite_solid(joint, blend, caps)
            break
        except RailsTooShortError as short:
            slack = 0.1 * (short.needed_domain[1] - short.needed_domain[0])
            domain = (min(domain[0], short.needed_domain[0] - slack), max(domain[1], short.needed_domain[1] + slack))
    else:
        raise TopologyError("the blend runs on beside the face at the end of the edge without ever meeting it")
    limit = max(SOLID_BLEND_TOLERANCES.edge, 2 * joint.tolerance, 2 * request.tolerance)
    check = _check_proposal(joint, proposal, limit)
    if check.crosses:
        raise SizeError("the blend runs into another boundary or face: the size is too large for it", kind="too large")
    if check.problems:
        raise VerificationError("the blended solid did not verify and is withheld: " + "; ".join(check.problems[:4]))
    return proposal, blend


def _rewrite_solid(joint: Joint, blend: BlendSurface, caps: CapStations) -> ProposedSolid:
    """Put a blend into the solid of a joint."""
    placement = place_blend(joint.solid, joint.spine, joint.sides, blend, joint.name_part)
    return blend_closed_edge(placement) if joint.spine.closed else blend_open_edge(placement, caps)


def _check_proposal(joint: Joint, proposal: ProposedSolid, tolerance: float) -> ReplacementCheck:
    """Look for what is wrong with a blended solid, whose new edges may have a tolerance (mm)."""
    grows = not joint.is_convex
    return check_solid(joint.solid, proposal.solid, [proposal.blend_face], grows=grows, tolerance=tolerance)
