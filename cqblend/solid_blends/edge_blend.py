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
from cqblend.blends.contacts.contact_solver import Contacts, Solver, intersect, remembering, rolling_ball, set_back
from cqblend.blends.pde.problem import Problem
from cqblend.blends.potential.edge_sweep import EdgeSweep, from_edge
from cqblend.blends.potential.swept_section import Skin, loosened, tied
from cqblend.blends.quality.creases import Allowed, check_creases
from cqblend.blends.rails import cross_fields, rail_fit
from cqblend.blends.rails.rail_fit import Wanted
from cqblend.blends.rails.ribbon import Ribbon, in_space
from cqblend.blends.sections.blend_surface import Blend, folded, hermite
from cqblend.brep.read.face_surface import FaceSide
from cqblend.brep.rewrite.end_curve import EndError
from cqblend.brep.rewrite.shell_edit import Proposal, RailsTooShort, Surgery
from cqblend.brep.select.edge_joint import Joint
from cqblend.brep.select.selection import Picks
from cqblend.brep.select.united_faces import unified
from cqblend.brep.topology import replaced_solid
from cqblend.brep.verification.certify import certify
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
from cqblend.solid_blends.end_plan import Attempts, EndPlan, plan_ends, record_ends
from cqblend.surfaces.primaries import Array, Tensor, unit

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Shape

RAIL_TOLERANCE = 1e-5  # of the size asked for: how near rails run to the ball's contacts
EXACT_ANGLE = 1e-7  # rad: measured by OCCT, whose derivatives of high degree have rounding of their own
EXACT_BEND, COMPACT_BEND = 1e-6, 1e-3  # jump of the curvature where it is continuous, in units of 1/size
GAP = 1e-7  # mm
CROSSED = (
    "IntersectingWires",
    "SelfIntersectingWire",
    "InvalidImbricationOfWires",
    "cuts through",
)  # what is said of that
SAME_FACE = 1e-10  # of the size of a solid: a surface that differs less from a face's is that of the face
EDGE_TOLERANCE = 5e-7  # mm, the most that a new edge may have on clean input


FIELDS = {
    "parametric": cross_fields.parametric,
    "perpendicular": cross_fields.perpendicular,
    "chord": cross_fields.chord,
}

Caps = tuple[float | None, float | None]


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
    picks, before = Picks(shape, edges, request.first), shape
    while picks:
        shape, joint = _seen_through(shape, picks, request)
        _take(shape, picks, joint, request, hints=hints)
        try:
            proposal, blend, plan, ends = _blended(joint, request)
        except CqblendError as error:
            raise _named(error, joint, request, hints=hints) from error
        certificate = certify(joint, proposal, blend)
        if plan is not None:
            certificate = replace(certificate, coverage=plan.coverage, ends=ends)
        _check_promise(certificate, request, joint, _allowed(request).along(blend.ribbons))
        shape = replaced_solid(shape, joint.solid, proposal.solid)
        faces.append(proposal.blend)
        certificates.append(replace(certificate, method=certificate.method + picks.taken_as_one()))
    certificate = Certificate.merge(certificates)
    return shape, tuple(faces), replace(certificate, valid=_still_valid(before, shape), skipped=picks.skipped)


def _still_valid(before: TopoDS_Shape, after: TopoDS_Shape) -> bool:
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


def _seen_through(
    shape: TopoDS_Shape, picks: Picks, request: BlendRequest, *, everything: bool = False
) -> tuple[TopoDS_Shape, Joint]:
    """Return the next joint, and the shape in which its faces are one with what they go on in, as far as it gets.

    A joint whose faces have become one with others may be longer, and have others yet to become one with.
    """

    def reach(joint: Joint) -> float:
        if everything:
            return np.inf
        try:
            return size_limits.reach(joint, request, _solver)
        except CqblendError:
            return 0.0  # whatever is wrong is said later, of the joint as it is then

    joint = picks.find(shape)
    while (united := unified(joint, partial(reach, joint))) is not None:
        picks.unify(united)
        shape = replaced_solid(shape, joint.solid, united.solid)
        joint = picks.find(shape)
    return shape, joint


def _take(shape: TopoDS_Shape, picks: Picks, joint: Joint, request: BlendRequest, *, hints: bool) -> None:
    """Take a joint; where it may not go together with other picks, but one does not fit anyway, that is told."""
    try:
        picks.take(joint)
    except UnsupportedError:
        for one in picks.joints(shape):
            try:
                size_limits.check(one, request, _solver)
            except SizeError as error:
                raise _named(error, one, request, hints=hints) from error
        raise


def _named(error: CqblendError, joint: Joint, request: BlendRequest, *, hints: bool) -> CqblendError:
    """Return an error with the edge's number and, of sizes, with what may fit."""
    hint = size_limits.hint(joint, request, _solver) if hints and isinstance(error, SizeError) else ""
    return type(error)(f"edge {joint.edge}: {error}{hint}")


def cheap_trial(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], request: BlendRequest
) -> tuple[Callable[[float], bool], float]:
    """Return the cheap trial of :func:`blend_shape`, and the size (mm) of the smallest solid.

    The trial tells whether, for the request times a factor, contacts on both faces are right.

    Raises
    ------
    CqblendError
        As :func:`blend_shape`, of what no size would mend.
    """
    picks = Picks(shape, edges, request.first)
    joints = []
    while picks:
        shape, joint = _seen_through(shape, picks, request, everything=True)
        joints.append(picks.take(joint))
    extent = min(joint.extent for joint in joints)
    return lambda factor: all(size_limits.fits(joint, request.scaled(factor), _solver) for joint in joints), extent


def insert_shape(
    shape: TopoDS_Shape, edges: Sequence[TopoDS_Edge], blend: Blend, first: TopoDS_Face | None
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
    picks = Picks(shape, edges, first)
    joint = picks.take(picks.find(shape))
    if picks:
        raise SelectionError("the edges belong to several joints: a blend takes the place of one")
    try:
        return _inserted(shape, joint, blend)
    except RailsTooShort as error:
        (low, high), (first_t, last_t) = error.needed, blend.ribbons[0].c.domain
        raise GeometryError(
            f"edge {joint.edge}: the blend ends before it meets the faces at the ends of the edge: it runs over t = "
            f"{first_t:.4g} to {last_t:.4g}, and would have to over {low:.4g} to {high:.4g}; extend the surfaces that "
            "it is made between"
        ) from error
    except EndError as error:
        where = joint.name_end(error.end)
        raise type(error.cause)(f"edge {joint.edge}: the blend cannot end at {where}: {error.cause}") from error
    except CqblendError as error:
        raise type(error)(f"edge {joint.edge}: {error}") from error


def _inserted(shape: TopoDS_Shape, joint: Joint, blend: Blend) -> tuple[TopoDS_Shape, TopoDS_Face, Certificate]:
    """Put a blend in the place of a joint; return the shape, the blend's face and the certificate."""
    fitted = _fitted(joint, blend)
    surgery = Surgery(joint.solid, joint.spine, joint.sides, fitted, joint.named)
    natural = EndPlan.natural(surgery.domain)
    proposal = surgery.closed() if joint.spine.closed else surgery.open(natural.caps)
    limit = max(EDGE_TOLERANCE, 2 * joint.tolerance)
    problems = check_solid(joint.solid, proposal.solid, [proposal.blend], grows=not joint.convex, tolerance=limit)
    if problems:
        raise VerificationError("the solid did not verify and is withheld: " + "; ".join(problems[:4]))
    result = replaced_solid(shape, joint.solid, proposal.solid)
    ends = () if joint.spine.closed else record_ends(joint, natural)
    valid = _still_valid(shape, result)
    return result, proposal.blend, replace(certify(joint, proposal, fitted), valid=valid, ends=ends)


def _fitted(joint: Joint, blend: Blend) -> Blend:
    """Return a blend with its sides and its sense those of a joint, its ribbons on the joint's own surfaces."""
    size = joint.extent
    for swapped in (False, True):
        ribbons = blend.ribbons[::-1] if swapped else blend.ribbons
        if all(_on(ribbon, side, size) for ribbon, side in zip(ribbons, joint.sides, strict=True)):
            break
    else:
        raise InputError(
            "the blend's rails do not lie on the two faces in their own parameters: make it between "
            "cqblend.to_surface(face) of both, and of faces on splines (.toNURBS() of a CadQuery shape has no others)"
        )
    first, second = (replace(ribbon, primary=side.primary) for ribbon, side in zip(ribbons, joint.sides, strict=True))
    surface = blend.surface.reverse(1) if swapped else blend.surface
    t = np.linspace(*first.c.domain, 257)
    point, rate = in_space(first.primary.position(first.c).jet(t, 1))
    stations = joint.stations(np.linspace(0.02, 0.98, 33))
    nearest = np.linalg.norm(stations.point[:, None] - point, axis=2).argmin(axis=1)
    if (rate[nearest] * stations.direction).sum() < 0:
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


def _on(ribbon: Ribbon, side: FaceSide, size: float) -> bool:
    """Whether a ribbon runs on a face, in the face's own parameters."""
    if not isinstance(ribbon.primary, Tensor) or not isinstance(side.primary, Tensor) or not side.native.is_native():
        return False
    t = np.linspace(*ribbon.c.domain, 33)
    uv = ribbon.native(t)
    return bool(np.abs(side.primary.jet(uv)[0] - ribbon.primary.jet(uv)[0]).max() <= SAME_FACE * size)


def _size(request: BlendRequest) -> float:
    return max(request.lengths)


def _inside(request: BlendRequest) -> float:
    """Return how far a potential blend may be from the curves that it is made of (mm)."""
    return max(request.tolerance, RAIL_TOLERANCE * _size(request))


def _swept(joint: Joint, request: BlendRequest) -> EdgeSweep | None:
    """Return the intersection curves of the moved sides, for a potential section."""
    if request.relation is None:
        return None
    return from_edge(joint.sides, joint.stations, joint.spine.length, request.relation, closed=joint.spine.closed)


def _solver(joint: Joint, request: BlendRequest) -> Solver:
    """Return the function from t to contacts."""
    swept = _swept(joint, request)

    def solve(t: Array) -> Contacts:
        if swept is not None:
            return swept.contacts(t)
        stations = intersect(joint.sides, joint.stations(t), joint.spine.length)
        if request.radius is not None:
            return rolling_ball(joint.sides, stations, request.radius)
        assert request.width is not None
        return set_back(joint.sides, stations, request.width)

    if joint.spine.closed:
        return rail_fit.around(remembering(solve), joint.primaries)
    return rail_fit.along(remembering(solve), joint.primaries)


def _blended(joint: Joint, request: BlendRequest) -> tuple[Proposal, Blend, EndPlan | None, tuple[EndRecord, ...]]:
    """Propose a blended solid and verify it, an open one with the first ends, of those asked for, that can be built."""
    size_limits.check(joint, request, _solver)
    if joint.spine.closed:
        return *_proposed(joint, request, (None, None), (0.0, 1.0)), None, ()
    attempts, solve = Attempts(request.ends[::-1] if joint.backward else request.ends), _solver(joint, request)
    for how in attempts:
        try:
            plan = plan_ends(joint, solve, how)
            proposal, blend = _proposed(joint, request, plan.caps, plan.domain)
        except (EndError, SizeError, TopologyError, VerificationError) as error:
            attempts.fail(how, error)
        else:
            return proposal, blend, plan, record_ends(joint, plan, attempts)
    raise attempts.error(joint)


def _proposed(joint: Joint, request: BlendRequest, caps: Caps, domain: tuple[float, float]) -> tuple[Proposal, Blend]:
    """Blend between given ends, over at least the given range of t, and verify the result."""
    for _ in range(4):
        blend = _section(_rails(joint, request, domain), joint, request)
        _check_sections(blend, request)
        first, second = joint.faces
        check_creases(blend, _allowed(request), (f"face {first}", f"face {second}"), steers=request.relation is None)
        surgery = Surgery(joint.solid, joint.spine, joint.sides, blend, joint.named)
        try:
            proposal = surgery.closed() if joint.spine.closed else surgery.open(caps)
            break
        except RailsTooShort as short:
            slack = 0.1 * (short.needed[1] - short.needed[0])
            domain = (min(domain[0], short.needed[0] - slack), max(domain[1], short.needed[1] + slack))
    else:
        raise TopologyError("the blend runs on beside the face at the end of the edge without ever meeting it")
    limit = max(EDGE_TOLERANCE, 2 * joint.tolerance, 2 * request.tolerance)
    problems = check_solid(joint.solid, proposal.solid, [proposal.blend], grows=not joint.convex, tolerance=limit)
    if any(status in line for line in problems for status in CROSSED):
        raise SizeError("the blend runs into another boundary or face: the size is too large for it")
    if problems:
        raise VerificationError("the blended solid did not verify and is withheld: " + "; ".join(problems[:4]))
    return proposal, blend


def _section(ribbons: tuple[Ribbon, Ribbon], joint: Joint, request: BlendRequest) -> Blend:
    """Fill what is between two ribbons."""
    form = request.form, request.tolerance, request.angular_tolerance
    swept = _swept(joint, request)
    if swept is not None:
        domain, turn = ribbons[0].c.domain, joint.spine.turn()
        swept = replace(swept, domain=domain)
        if ribbons[0].light and turn is not None:
            arc = _largest_arc(joint)
            swept = replace(swept, clock=lambda t: rail_fit.arc_clock(domain, turn, t, arc)[0])
        curves, closed = swept, joint.spine.closed
        return loosened(lambda inside: Skin.over(curves, closed, inside).blend(ribbons, *form), _inside(request))
    if request.order is None:
        return hermite(ribbons, *form)
    problem = Problem(request.order, request.parameters, request.terms)
    return problem.blend(ribbons, *form, closed=joint.spine.closed)[0]


def _check_sections(blend: Blend, request: BlendRequest) -> None:
    """Raise GeometryError where a section loops, its cross derivatives being too long, or the blend folds.

    Those of potential blends may set out backwards, at acute edges, but not turn by more than half a turn.
    """
    surface = blend.surface
    t, v = np.meshgrid(np.linspace(*surface.domain[0], 33), np.linspace(0, 1, 33), indexing="ij")
    rate = surface(t, v, 0, 1)
    if request.relation is not None:
        way = unit(rate.reshape(-1, 3)).reshape(rate.shape)
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
    fold = folded(surface)
    if fold is not None:
        raise GeometryError(
            f"the blend folds at t = {fold:.4g}: its sections cross; take another size"
            + ("" if request.relation is not None else ", smaller bulge or other tangents")
        )


def _allowed(request: BlendRequest) -> Allowed:
    """Return how sharp creases inside a blend may be."""
    return Allowed(request.angular_tolerance, request.crease)


def _check_promise(certificate: Certificate, request: BlendRequest, joint: Joint, crease: float) -> None:
    """Raise VerificationError if the finished faces do not measure up to what the form promises."""
    exact = certificate.form == "exact"
    angle = EXACT_ANGLE if exact else request.angular_tolerance
    bend = (EXACT_BEND if exact else COMPACT_BEND) / _size(request)
    gap = max(GAP, request.tolerance, 2 * joint.tolerance)
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
                f"edge {joint.edge}: the blend was made, but its {name} is {value:.2g} {measure}, over {limit:.2g}; it "
                "is withheld; try another size or form"
            )


def _rails(joint: Joint, request: BlendRequest, domain: tuple[float, float]) -> tuple[Ribbon, Ribbon]:
    """Fit rails of the lightest form."""
    solve, closed = _solver(joint, request), joint.spine.closed
    wanted = _wanted(request)
    if not closed:
        rails = rail_fit.straight(joint.primaries, solve, domain, wanted, joint.extent)
        if rails is not None:
            return rails
    turn = joint.spine.turn()
    if turn is not None:
        rails = rail_fit.circular(joint.primaries, solve, domain, turn, wanted, joint.extent, _largest_arc(joint))
        if rails is not None:
            return rails
    if closed:
        start = joint.clear_start(solve(np.arange(64) / 64))
        domain = (start, start + 1)
    return rail_fit.cubic(joint.primaries, solve, domain, wanted, closed=closed)


def _largest_arc(joint: Joint) -> float:
    """Return the largest angle of a piece of a circular rail."""
    return rail_fit.QUARTER if joint.spine.closed else rail_fit.THIRD


def _wanted(request: BlendRequest) -> Wanted:
    """Return what the ribbons are to be."""
    if request.relation is not None:
        return tied(_inside(request), _size(request))
    first, second = (partial(np.full_like, fill_value=factor) for factor in request.bulge)
    return Wanted(
        position=max(RAIL_TOLERANCE * _size(request), 1e-7),
        fields=(FIELDS[request.tangents[0]], FIELDS[request.tangents[1]]),
        bulges=(first, second),
        orders=_orders(request),
        steer=request.steer,
    )


def _orders(request: BlendRequest) -> tuple[int, int]:
    """Return how many directions ribbons take: of equations, what the highest one needs."""
    if request.order is not None:
        return (max(request.order) // 2 - 1,) * 2
    return int(request.continuity[0][1]), int(request.continuity[1][1])
