"""Blend edges of a solid: where rails, sections, topology surgery and verification come together.

Works on ``TopoDS`` shapes, which it only hands on; the front doors translate. A result that does not verify is never
returned.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from cqblend.blend_options import BlendRequest
from cqblend.blends.contacts.contact_solver import (
    Contacts,
    ContactSolver,
    cache_contacts,
    project_to_intersection,
    solve_ball_contacts,
    solve_setback_contacts,
)
from cqblend.blends.contacts.unwrapped_solvers import unwrap_closed_solver, unwrap_open_solver
from cqblend.blends.pde.problem import PdeSettings, SideSetup
from cqblend.blends.potential.edge_sweep import EdgeSweep, sweep_from_edge
from cqblend.blends.potential.swept_section import SweptSection, loosen_until_feasible, make_ribbon_targets
from cqblend.blends.quality.creases import CreaseLimit, check_creases
from cqblend.blends.rails import cross_fields
from cqblend.blends.rails.cubic_rails import fit_cubic_ribbons
from cqblend.blends.rails.exact_rails import ArcLayout, fit_circular_ribbons, fit_straight_ribbons
from cqblend.blends.rails.ribbon import Ribbon, dehomogenise_jets
from cqblend.blends.rails.ribbon_fit import RibbonTargets
from cqblend.blends.rails.tolerances import RAIL_TOLERANCES
from cqblend.blends.sections.blend_surface import BlendSurface, blend_ribbons, find_fold
from cqblend.brep.read.face_surface import SupportFace
from cqblend.brep.rewrite.end_curve import BlendEndError
from cqblend.brep.rewrite.shell_edit import ProposedSolid, RailsTooShortError, ShellEdit
from cqblend.brep.select.edge_joint import Joint
from cqblend.brep.select.selection import PendingEdges
from cqblend.brep.select.united_faces import unify_faces
from cqblend.brep.topology import replace_solid
from cqblend.brep.verification.certify import certify_blend
from cqblend.brep.verification.soundness import check_solid, is_valid
from cqblend.certificate import Certificate, EndRecord
from cqblend.errors import (
    CqblendError,
    GeometryError,
    InputError,
    SelectionError,
    SizeError,
    TopologyError,
    UnsupportedError,
    VerificationError,
)
from cqblend.solid_blends import size_limits
from cqblend.solid_blends.end_plan import EndAttempts, EndPlan, plan_ends, record_ends
from cqblend.splines.bernstein import Array
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import normalise_vectors

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

RAIL_TOLERANCE = 1e-5  # of the size asked for: how near rails run to the ball's contacts
EXACT_ANGLE = 1e-7  # rad: measured by OCCT, whose derivatives of high degree have rounding of their own
EXACT_CURVATURE_JUMP, COMPACT_CURVATURE_JUMP = (
    1e-6,
    1e-3,
)  # jump of the curvature where it is continuous, in units of 1/size
GAP_TOLERANCE = 1e-7  # mm
CROSSING_STATUSES = (
    "IntersectingWires",
    "SelfIntersectingWire",
    "InvalidImbricationOfWires",
    "cuts through",
)  # what is said of that
SAME_SURFACE = 1e-10  # of the size of a solid: a surface that differs less from a face's is that of the face
EDGE_TOLERANCE = 5e-7  # mm, the most that a new edge may have on clean input


CROSS_FIELDS = {
    "parametric": cross_fields.parametric_field,
    "perpendicular": cross_fields.perpendicular_field,
    "chord": cross_fields.chord_field,
}

CapParameters = tuple[float | None, float | None]


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
        _check_promises(certificate, request, joint, _get_crease_limits(request).find_limit(blend.ribbons))
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
    """Return the next joint, and the shape in which its faces are one with what they go on in, as far as it gets.

    A joint whose faces have become one with others may be longer, and have others yet to become one with.
    """

    def estimate_reach(joint: Joint) -> float:
        if everything:
            return np.inf
        try:
            return size_limits.measure_reach(joint, request, _make_contact_solver)
        except CqblendError:
            return 0.0  # whatever is wrong is said later, of the joint as it is then

    joint = picks.find_next_joint(shape)
    while (united := unify_faces(joint, partial(estimate_reach, joint))) is not None:
        picks.record_unified_faces(united)
        shape = replace_solid(shape, joint.solid, united.solid)
        joint = picks.find_next_joint(shape)
    return shape, joint


def _take_joint(shape: TopoDS_Shape, picks: PendingEdges, joint: Joint, request: BlendRequest, *, hints: bool) -> None:
    """Take a joint; where it may not go together with other picks, but one does not fit anyway, that is told."""
    try:
        picks.take_joint(joint)
    except UnsupportedError:
        for one in picks.find_joints(shape):
            try:
                size_limits.check_size(one, request, _make_contact_solver)
            except SizeError as error:
                raise _annotate_error(error, one, request, hints=hints) from error
        raise


def _annotate_error(error: CqblendError, joint: Joint, request: BlendRequest, *, hints: bool) -> CqblendError:
    """Return an error with the edge's number and, of sizes, with what may fit."""
    hint = (
        size_limits.suggest_size(joint, request, _make_contact_solver) if hints and isinstance(error, SizeError) else ""
    )
    return error.with_details(shape=joint.name, after=hint)


def make_cheap_trial(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], request: BlendRequest
) -> tuple[Callable[[float], bool], float]:
    """Return the cheap trial of :func:`blend_shape`, and the size (mm) of the smallest solid.

    The trial tells whether, for the request times a factor, contacts on both faces are right.

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
        size_limits.is_possible_size(joint, request.with_scaled_lengths(factor), _make_contact_solver)
        for joint in joints
    ), extent


def insert_into_shape(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], blend: BlendSurface, first: TopoDS_Face | None
) -> tuple[TopoDS_Shape, TopoDS_Face, Certificate]:
    """Put a blend of surfaces into a shape, in the place of an edge between faces on these surfaces.

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
    fitted = _align_to_joint(joint, blend)
    surgery = ShellEdit(joint.solid, joint.spine, joint.sides, fitted, joint.name_part)
    natural = EndPlan.from_domain(surgery.domain)
    proposal = surgery.blend_closed_edge() if joint.spine.closed else surgery.blend_open_edge(natural.caps)
    limit = max(EDGE_TOLERANCE, 2 * joint.tolerance)
    problems = check_solid(
        joint.solid, proposal.solid, [proposal.blend_face], grows=not joint.is_convex, tolerance=limit
    )
    if problems:
        raise VerificationError("the solid did not verify and is withheld: " + "; ".join(problems[:4]))
    result = replace_solid(shape, joint.solid, proposal.solid)
    ends = () if joint.spine.closed else record_ends(joint, natural)
    valid = _check_still_valid(shape, result)
    return result, proposal.blend_face, replace(certify_blend(joint, proposal, fitted), valid=valid, ends=ends)


def _align_to_joint(joint: Joint, blend: BlendSurface) -> BlendSurface:
    """Return a blend with its sides and its sense those of a joint, its ribbons on the joint's own surfaces."""
    size = joint.extent
    for swapped in (False, True):
        ribbons = blend.ribbons[::-1] if swapped else blend.ribbons
        if all(_is_on_face(ribbon, side, size) for ribbon, side in zip(ribbons, joint.sides, strict=True)):
            break
    else:
        raise InputError(
            "the blend's rails do not lie on the two faces in their own parameters: make it between "
            "cqblend.to_surface(face) of both, and of faces on splines (.toNURBS() of a CadQuery shape has no others)"
        )
    first, second = (replace(ribbon, primary=side.primary) for ribbon, side in zip(ribbons, joint.sides, strict=True))
    surface = blend.surface.reverse(1) if swapped else blend.surface
    t = np.linspace(*first.c.domain, 257)
    point, rate = dehomogenise_jets(first.primary.compose_position(first.c).jet(t, 1))
    stations = joint.locate_stations(np.linspace(0.02, 0.98, 33))
    nearest = np.linalg.norm(stations.points[:, None] - point, axis=2).argmin(axis=1)
    if (rate[nearest] * stations.tangents).sum() < 0:
        first, second = (
            replace(
                one,
                c=one.c.reverse(),
                directions=tuple(direction.reverse() for direction in one.directions),
                uv=one.uv[::-1],
            )
            for one in (first, second)
        )
        surface = surface.reverse(0)
    return replace(blend, surface=surface, ribbons=(first, second))


def _is_on_face(ribbon: Ribbon, side: SupportFace, size: float) -> bool:
    """Whether a ribbon runs on a face, in the face's own parameters."""
    if (
        not isinstance(ribbon.primary, TensorSurface)
        or not isinstance(side.primary, TensorSurface)
        or not side.face_primary.has_exact_pcurves()
    ):
        return False
    t = np.linspace(*ribbon.c.domain, 33)
    uv = ribbon.find_native_parameters(t)
    return bool(np.abs(side.primary.jet(uv)[0] - ribbon.primary.jet(uv)[0]).max() <= SAME_SURFACE * size)


def _get_largest_size(request: BlendRequest) -> float:
    return max(request.lengths)


def _get_section_tolerance(request: BlendRequest) -> float:
    """Return how far a potential blend may be from the curves that it is made of (mm)."""
    return max(request.tolerance, RAIL_TOLERANCE * _get_largest_size(request))


def _make_edge_sweep(joint: Joint, request: BlendRequest) -> EdgeSweep | None:
    """Return the intersection curves of the moved sides, for a potential section."""
    if request.relation is None:
        return None
    return sweep_from_edge(
        joint.sides, joint.locate_stations, joint.spine.length, request.relation, closed=joint.spine.closed
    )


def _make_contact_solver(joint: Joint, request: BlendRequest) -> ContactSolver:
    """Return the function from t to contacts."""
    swept = _make_edge_sweep(joint, request)

    def solve_contacts_at(t: Array) -> Contacts:
        if swept is not None:
            return swept.solve_contacts(t)
        stations = project_to_intersection(joint.sides, joint.locate_stations(t), joint.spine.length)
        if request.radius is not None:
            return solve_ball_contacts(joint.sides, stations, request.radius)
        assert request.width is not None
        return solve_setback_contacts(joint.sides, stations, request.width)

    if joint.spine.closed:
        return unwrap_closed_solver(cache_contacts(solve_contacts_at), joint.primaries)
    return unwrap_open_solver(cache_contacts(solve_contacts_at), joint.primaries)


def _blend_joint(
    joint: Joint, request: BlendRequest
) -> tuple[ProposedSolid, BlendSurface, EndPlan | None, tuple[EndRecord, ...]]:
    """Propose a blended solid and verify it, an open one with the first ends, of those asked for, that can be built."""
    size_limits.check_size(joint, request, _make_contact_solver)
    if joint.spine.closed:
        return *_propose_solid(joint, request, (None, None), (0.0, 1.0)), None, ()
    attempts, solve = (
        EndAttempts(request.ends[::-1] if joint.is_backward else request.ends),
        _make_contact_solver(joint, request),
    )
    for how in attempts:
        try:
            plan = plan_ends(joint, solve, how)
            proposal, blend = _propose_solid(joint, request, plan.caps, plan.domain)
        except (BlendEndError, SizeError, TopologyError, VerificationError) as error:
            attempts.record_failure(how, error)
        else:
            return proposal, blend, plan, record_ends(joint, plan, attempts)
    raise attempts.make_error(joint)


def _propose_solid(
    joint: Joint, request: BlendRequest, caps: CapParameters, domain: tuple[float, float]
) -> tuple[ProposedSolid, BlendSurface]:
    """Blend between given ends, over at least the given range of t, and verify the result."""
    for _ in range(4):
        blend = _make_blend_surface(_fit_rails(joint, request, domain), joint, request)
        _check_sections(blend, request)
        first, second = joint.face_numbers
        check_creases(
            blend, _get_crease_limits(request), (f"face {first}", f"face {second}"), steers=request.relation is None
        )
        surgery = ShellEdit(joint.solid, joint.spine, joint.sides, blend, joint.name_part)
        try:
            proposal = surgery.blend_closed_edge() if joint.spine.closed else surgery.blend_open_edge(caps)
            break
        except RailsTooShortError as short:
            slack = 0.1 * (short.needed_domain[1] - short.needed_domain[0])
            domain = (min(domain[0], short.needed_domain[0] - slack), max(domain[1], short.needed_domain[1] + slack))
    else:
        raise TopologyError("the blend runs on beside the face at the end of the edge without ever meeting it")
    limit = max(EDGE_TOLERANCE, 2 * joint.tolerance, 2 * request.tolerance)
    problems = check_solid(
        joint.solid, proposal.solid, [proposal.blend_face], grows=not joint.is_convex, tolerance=limit
    )
    if any(status in line for line in problems for status in CROSSING_STATUSES):
        raise SizeError("the blend runs into another boundary or face: the size is too large for it")
    if problems:
        raise VerificationError("the blended solid did not verify and is withheld: " + "; ".join(problems[:4]))
    return proposal, blend


def _make_blend_surface(ribbons: tuple[Ribbon, Ribbon], joint: Joint, request: BlendRequest) -> BlendSurface:
    """Fill what is between two ribbons."""
    form = request.form, request.tolerance, request.angular_tolerance
    swept = _make_edge_sweep(joint, request)
    if swept is not None:
        domain, turn = ribbons[0].c.domain, joint.spine.measure_arc_angle()
        swept = replace(swept, domain=domain)
        if ribbons[0].light and turn is not None:
            layout = ArcLayout(domain, turn, _get_largest_arc(joint))
            swept = replace(swept, edge_parameter_at=lambda t: layout.map_parameters(t)[0])
        curves, closed = swept, joint.spine.closed
        return loosen_until_feasible(
            lambda inside: SweptSection.from_sweep(curves, closed, inside).blend_ribbons(ribbons, *form),
            _get_section_tolerance(request),
        )
    if request.order is None:
        return blend_ribbons(ribbons, *form)
    problem = PdeSettings(request.order, request.parameters, request.terms)
    return problem.blend_ribbons(ribbons, *form, SideSetup(joint.spine.closed))[0]


def _check_sections(blend: BlendSurface, request: BlendRequest) -> None:
    """Raise GeometryError where a section loops, its cross derivatives being too long, or the blend folds.

    Those of potential blends may set out backwards, at acute edges, but not turn by more than half a turn.
    """
    surface = blend.surface
    t, v = np.meshgrid(np.linspace(*surface.domain[0], 33), np.linspace(0, 1, 33), indexing="ij")
    rate = surface(t, v, 0, 1)
    if request.relation is not None:
        way = normalise_vectors(rate.reshape(-1, 3)).reshape(rate.shape)
        turned = np.arccos(np.clip((way[:, 1:] * way[:, :-1]).sum(axis=-1), -1, 1)).sum(axis=1)
        if turned.max() >= np.pi:
            raise GeometryError(
                f"the section at t = {t[turned.argmax(), 0]:.3g} turns by {turned.max():.3g} rad: choose smaller a and "
                "b"
            )
    else:
        chord = surface(t, np.ones_like(v)) - surface(t, np.zeros_like(v))
        ahead = (rate * chord).sum(axis=-1)
        if not np.all(ahead > 0):
            raise GeometryError(
                f"the section at t = {t.flat[ahead.argmin()]:.3g} turns back on itself: "
                + (
                    "it leaves its rails too fast; take a smaller bulge"
                    if blend.residual is None
                    else "take smaller parameters, which let more of the rails' shape reach the middle, or a smaller "
                    "bulge"
                )
            )
    fold = find_fold(surface)
    if fold is not None:
        raise GeometryError(
            f"the blend folds at t = {fold:.4g}: its sections cross; take another size"
            + ("" if request.relation is not None else ", smaller bulge or other tangents")
        )


def _get_crease_limits(request: BlendRequest) -> CreaseLimit:
    """Return how sharp creases inside a blend may be."""
    return CreaseLimit(request.angular_tolerance, request.crease)


def _check_promises(certificate: Certificate, request: BlendRequest, joint: Joint, crease: float) -> None:
    """Raise VerificationError if the finished faces do not measure up to what the form promises."""
    exact = certificate.form == "exact"
    angle = EXACT_ANGLE if exact else request.angular_tolerance
    bend = (EXACT_CURVATURE_JUMP if exact else COMPACT_CURVATURE_JUMP) / _get_largest_size(request)
    gap = max(GAP_TOLERANCE, request.tolerance, 2 * joint.tolerance)
    promises = [("inner crease", certificate.inner_crease, 1.05 * crease, "rad")]
    for rail, continuity in zip(certificate.rails, request.continuity, strict=True):
        promises.append(("gap", rail.gap, gap, "mm"))
        if continuity != "G0":
            promises.append(("angle", rail.angle, angle, "rad"))
        if continuity in ("G2", "G3"):
            promises.append(("curvature jump", rail.curvature_jump, bend, "1/mm"))
    for name, value, limit, measure in promises:
        if not value <= limit:
            raise VerificationError(
                f"the blend was made, but its {name} is {value:.2g} {measure}, over {limit:.2g}; it is withheld; try "
                "another size or form",
                kind=name,
                shape=joint.name,
                value=value,
            )


def _fit_rails(joint: Joint, request: BlendRequest, domain: tuple[float, float]) -> tuple[Ribbon, Ribbon]:
    """Fit rails of the lightest form."""
    solve, closed = _make_contact_solver(joint, request), joint.spine.closed
    wanted = _get_ribbon_targets(request)
    if not closed:
        rails = fit_straight_ribbons(joint.primaries, solve, domain, wanted, joint.extent)
        if rails is not None:
            return rails
    turn = joint.spine.measure_arc_angle()
    if turn is not None:
        layout = ArcLayout(domain, turn, _get_largest_arc(joint))
        rails = fit_circular_ribbons(joint.primaries, solve, layout, wanted, joint.extent)
        if rails is not None:
            return rails
    if closed:
        start = joint.choose_rail_start(solve(np.arange(64) / 64))
        domain = (start, start + 1)
    return fit_cubic_ribbons(joint.primaries, solve, domain, wanted, closed=closed)


def _get_largest_arc(joint: Joint) -> float:
    """Return the largest angle of a piece of a circular rail."""
    return RAIL_TOLERANCES.largest_closed_arc if joint.spine.closed else RAIL_TOLERANCES.largest_open_arc


def _get_ribbon_targets(request: BlendRequest) -> RibbonTargets:
    """Return what the ribbons are to be."""
    if request.relation is not None:
        return make_ribbon_targets(_get_section_tolerance(request), _get_largest_size(request))
    first, second = (partial(np.full_like, fill_value=factor) for factor in request.bulge)
    return RibbonTargets(
        position=max(RAIL_TOLERANCE * _get_largest_size(request), 1e-7),
        fields=(CROSS_FIELDS[request.tangents[0]], CROSS_FIELDS[request.tangents[1]]),
        bulges=(first, second),
        orders=_get_ribbon_orders(request),
        steer=request.steer,
    )


def _get_ribbon_orders(request: BlendRequest) -> tuple[int, int]:
    """Return how many directions ribbons take: of equations, what the highest one needs."""
    if request.order is not None:
        return (max(request.order) // 2 - 1,) * 2
    return int(request.continuity[0][1]), int(request.continuity[1][1])
