"""Join two places of one body or of two by a bridge: read both sides, pair their rails, build, verify and certify.

Works on ``TopoDS`` shapes, which it only hands on. A result that does not verify is never returned.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

from cqblend.blends.network.bridge_pairing import RailPairing, pair_loops
from cqblend.blends.network.bridge_ribbons import BridgeCell, BridgeDirections, fit_bridge_ribbons
from cqblend.blends.pde.pde_settings import PdeSettings, SideSetup
from cqblend.blends.quality.creases import CreaseLimit, check_creases
from cqblend.blends.sections.blend_surface import BlendSurface, blend_ribbons, find_fold
from cqblend.brep.bodies import is_solid, join_shells, list_bodies, make_shell, replace_bodies
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.selection.bridge_sides import BridgeSide, GivenSide, SideReader
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shape_kinds import find_shape_kind
from cqblend.brep.shell_editing.bridge_planning import PlacedCell, plan_bridge
from cqblend.brep.shell_editing.plan_application import BuiltStrip, ProposedSolid, apply_plan
from cqblend.brep.shell_editing.strip_placement import place_between
from cqblend.brep.verification.blend_certification import certify_blend
from cqblend.brep.verification.brep_check import is_valid
from cqblend.brep.verification.bridge_checks import find_point_inside, find_self_crossing, find_touching_point
from cqblend.brep.verification.solid_verification import check_solid
from cqblend.bridge_options import BridgeRequest
from cqblend.certificate import Certificate
from cqblend.errors import GeometryError, SelectionError, TopologyError, VerificationError
from cqblend.solid_blends.blend_pipeline import BlendedShape
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES
from cqblend.splines.bernstein import Array

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape


@dataclass(frozen=True)
class BridgedBodies:
    """The bodies of a shape that a bridge joins, as one body, and both sides on it."""

    shape: TopoDS_Shape
    bodies: tuple[TopoDS_Shape, ...]
    index: SolidIndex
    sides: tuple[BridgeSide, BridgeSide]
    name_part: Callable[[TopoDS_Shape], str]

    @property
    def tolerance(self) -> float:
        """The largest tolerance (mm) of what the rails run along."""
        return max(side.tolerance for side in self.sides)


@dataclass(frozen=True)
class _CellPlace:
    """Where a cell of a bridge is: between two faces that stay, by their numbers in the input. No edge is blended."""

    sides: tuple[SupportFace, SupportFace]
    face_numbers: tuple[int, int]
    is_closed: bool
    edge_number: int = 0

    def find_vertex_number(self, end: int) -> int:
        """Return 0: no end of a cell is one of a blended edge."""
        del end
        return 0


def bridge_shape(shape: TopoDS_Shape, given: tuple[GivenSide, GivenSide], request: BridgeRequest) -> BlendedShape:
    """Join two places of a shape by a bridge.

    Raises
    ------
    SelectionError, InputError, TopologyError
        The sides are not of the shape's solids, do not tell what goes, or are in each other's way.
    CqblendError
        The bridge cannot be made, crosses itself or a body, or the result does not verify.
    """
    joined = read_bodies(shape, given)
    pairing, cells = fit_cells(joined, request)
    blends = [fill_cell(cell, request) for cell in cells]
    placed = [place_cell(joined, cell, blend) for cell, blend in zip(cells, blends, strict=True)]
    proposal = apply_plan(joined.index, plan_bridge(joined.index, joined.sides, pairing, placed))
    faces = [strip.blend_face for strip in proposal.strips]
    crossing = find_self_crossing(faces)
    if crossing is not None:
        raise GeometryError(
            f"the bridge crosses itself near {_show_point(crossing)}: take a smaller bulge, another start, or sides "
            "that face each other"
        )
    if request.solid:
        _verify(joined, proposal, request)
        result = replace_bodies(shape, joined.bodies, proposal.solid)
    else:
        result = faces[0] if len(faces) == 1 else make_shell(faces)
    certificates = [
        _certify_cell(joined, one, strip, proposal) for one, strip in zip(placed, proposal.strips, strict=True)
    ]
    certificate = replace(
        Certificate.merge(certificates), method="bridge", validity=(partial(is_valid, result),), ends=()
    )
    _check_promises(certificate, joined, request)
    return BlendedShape(result, tuple(faces), certificate)


def read_bodies(shape: TopoDS_Shape, given: tuple[GivenSide, GivenSide]) -> BridgedBodies:
    """Find the bodies of both sides, make one of them, and read the sides on it."""
    whole = SolidIndex(shape)
    solids = [body for body in list_bodies(shape) if is_solid(body)]

    def name_part(part: TopoDS_Shape) -> str:
        return f"{find_shape_kind(part)} {whole.get_map(part).find_number(part)}"

    parts = [_choose_part(one, f"side {k}") for k, one in enumerate(given, start=1)]
    bodies: list[TopoDS_Shape] = []
    for k, part in enumerate(parts, start=1):
        body = next((body for body in solids if part in SolidIndex(body).get_map(part)), None)
        if body is None:
            raise SelectionError(
                f"side {k} is not of a solid of the shape: pick faces and edges from that very shape, not from a copy, "
                "and of a solid"
            )
        if not any(body.IsSame(other) for other in bodies):
            bodies.append(body)
    index = SolidIndex(join_shells(bodies, parts))
    first, second = (
        SideReader(index, f"side {k + 1}", name_part, is_reversed=k == 0).read(one) for k, one in enumerate(given)
    )
    _require_apart(index, (first, second), name_part)
    return BridgedBodies(shape, tuple(bodies), index, (first, second), name_part)


def fit_cells(joined: BridgedBodies, request: BridgeRequest) -> tuple[RailPairing, list[BridgeCell]]:
    """Pair the rails of both sides, and fit the ribbons of all cells between them."""
    first, second = joined.sides
    pairing = pair_loops((first.loop, second.loop), request.start)
    directions = BridgeDirections(request.tangents, request.bulge, request.orders, request.steer)
    return pairing, fit_bridge_ribbons(pairing, directions)


def _choose_part(given: GivenSide, name: str) -> TopoDS_Shape:
    """Return a face or an edge that tells which body a side is of."""
    if given.face is not None:
        return given.face
    if not given.edges:
        raise SelectionError(f"{name} is empty: give a face, a closed edge or wire, or a face and a curve on it")
    return given.edges[0]


def _require_apart(
    index: SolidIndex, sides: tuple[BridgeSide, BridgeSide], name_part: Callable[[TopoDS_Shape], str]
) -> None:
    """Raise TopologyError if both sides have a vertex in common, or one takes away the face that the other needs."""
    first, second = sides
    shared = (set(first.vertices) & set(second.vertices)) - {0}
    what = name_part(index.vertices[min(shared)]) if shared else ""
    if first.gone and first.gone == second.gone:
        what = name_part(index.faces[first.gone])
    if what:
        raise TopologyError(f"both sides have {what}: a bridge needs two rails that do not meet")
    for one, other in (sides, sides[::-1]):
        if one.gone in other.list_supports(index):
            raise TopologyError(
                f"{name_part(index.faces[one.gone])}, which goes on {one.name}, is beside {other.name}, where it must "
                "stay"
            )


def fill_cell(cell: BridgeCell, request: BridgeRequest) -> BlendSurface:
    """Make the surface of a cell, and check that it neither folds nor has a crease."""
    options = request.form, request.tolerance, request.angular_tolerance
    if request.section == "pde":
        settings = PdeSettings((request.equation_order,) * 3)
        blend = settings.blend_ribbons(cell.ribbons, *options, SideSetup(cell.closed, joined=not cell.closed))[0]
    else:
        blend = blend_ribbons(cell.ribbons, *options)
    fold = find_fold(blend.surface, blend.ribbons)
    if fold is not None:
        raise GeometryError(
            f"the bridge folds at t = {fold:.4g}: take a smaller bulge, or another start", kind="fold", place=fold
        )
    if not all(ribbon.light for ribbon in blend.ribbons):
        check_creases(blend, CreaseLimit(request.angular_tolerance, request.crease), ("side 1", "side 2"))
    return blend


def place_cell(joined: BridgedBodies, cell: BridgeCell, blend: BlendSurface) -> PlacedCell:
    """Prepare to put the surface of a cell between its support faces."""
    supports = []
    for run, side in zip(cell.runs, joined.sides, strict=True):
        supports.append(next(one for one in side.supports if one is run.support))
    alone = not (supports[0].face.IsSame(supports[1].face))
    ring = [joined.index.edges[number] for side in joined.sides for number in side.edges if number]
    return PlacedCell(
        cell, place_between(joined.index, (supports[0], supports[1]), blend, ring if cell.closed and alone else None)
    )


def _verify(joined: BridgedBodies, proposal: ProposedSolid, request: BridgeRequest) -> None:
    """Check the new solid, and that the bridge is outside of the bodies.

    Raises
    ------
    GeometryError
        If the bridge runs into a body.
    VerificationError
        If anything else is wrong.
    """
    faces = [strip.blend_face for strip in proposal.strips]
    solids = [body for body in list_bodies(joined.shape) if is_solid(body)]
    others = [body for body in solids if not any(body.IsSame(one) for one in joined.bodies)]
    inside = find_point_inside(faces, joined.bodies)
    if inside is None:
        inside = find_touching_point(faces, others)
    if inside is not None:
        raise GeometryError(
            f"the bridge runs into a body near {_show_point(inside)}: take another bulge, or sides that face each other"
        )
    check = check_solid(
        joined.index.solid,
        proposal.solid,
        faces,
        tolerance=max(SOLID_BLEND_TOLERANCES.edge, 2 * joined.tolerance, 2 * request.tolerance),
        index_before=joined.index.faces,
    )
    if check.crosses:
        raise GeometryError(f"the bridge runs into a body or into itself: {check.problems[0]}")
    if check.problems:
        raise VerificationError("the bridged solid did not verify and is withheld: " + "; ".join(check.problems[:4]))


def _show_point(point: Array) -> str:
    """Return a point for a message."""
    x, y, z = point.tolist()
    return f"({x:.4g}, {y:.4g}, {z:.4g})"


def _certify_cell(joined: BridgedBodies, one: PlacedCell, strip: BuiltStrip, proposal: ProposedSolid) -> Certificate:
    """Measure one face of the bridge."""
    whole = SolidIndex(joined.shape)
    first, second = (whole.faces.find_number(side.face) for side in one.placed.sides)
    place = _CellPlace(one.placed.sides, (first, second), one.cell.closed)
    certificate = certify_blend(place, strip, one.placed.blend, proposal.tolerance)
    if one.cell.smooth_ends[0]:
        return certificate
    corners = [replace(edge, angle=None) if edge.kind == "seam" else edge for edge in certificate.edges]
    return replace(certificate, edges=tuple(corners))  # a seam at a corner is not smooth


def _check_promises(certificate: Certificate, joined: BridgedBodies, request: BridgeRequest) -> None:
    """Check that the finished faces measure up to what was asked for.

    Raises
    ------
    VerificationError
        If a measurement is above its limit.
    """
    limits, size = SOLID_BLEND_TOLERANCES, certificate.width[1]
    is_exact = certificate.form == "exact"
    angle = limits.exact_angle if is_exact else request.angular_tolerance
    jump = (limits.exact_curvature_jump if is_exact else limits.compact_curvature_jump) / size
    gap = max(limits.gap, request.tolerance, 2 * joined.tolerance)
    promises = [("gap", rail.gap, gap, "mm") for rail in certificate.rails]
    for rail in certificate.rails:
        order = request.orders[rail.side - 1]
        promises += [("angle", rail.angle, angle, "rad")] * (order > 0)
        promises += [("curvature jump", rail.curvature_jump, jump, "1/mm")] * (order > 1)
    for name, value, limit, unit in promises:
        if not value <= limit:
            raise VerificationError(
                f"the bridge was made, but its {name} is {value:.2g} {unit}, over {limit:.2g}; it is withheld; try "
                "another bulge or form",
                kind=name,
                value=value,
            )
