"""Plan how blends go into a solid, by new boundaries of the faces that they touch.

No intersection is computed and no boolean is run. The two support faces are trimmed at the rails: the rail edges take
the place of the blended edge in their wires. The blend face goes in on the same rail edges. A closed rail may cross
seams: rail and seam are split there. An open blend ends, at each end, on the face across the edge or in a flat cap: the
end curve is solved point by point.

The chains of a network are planned together (:func:`plan_network`), from their placed strips: first its *nodes*, at
which the strips end, each for all the chains that meet there (:mod:`cqblend.brep.shell_editing.corner_ends`), then the
cells between two nodes, of which consecutive ones share an edge. All chains are then put together
(:func:`merge_chains`): seams and neighbour edges that several of them cut are cut once, for all of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from OCP.TopoDS import TopoDS_Vertex

from cqblend.blends.network.blend_plan import (
    EdgeRole,
    EdgeUse,
    FacePlan,
    NewEdge,
    PatchPlan,
    PlannedVertex,
    SolidPlan,
    StripPlan,
    reverse_path,
)
from cqblend.blends.network.edge_networks import group_networks
from cqblend.brep.selection.blend_corners import BlendCorner, ChainEnd, CornerMethod
from cqblend.brep.selection.chains import Chain
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.cell_junctions import join_chain
from cqblend.brep.shell_editing.corner_ends import plan_corner
from cqblend.brep.shell_editing.end_at_border import end_at_border
from cqblend.brep.shell_editing.end_cap import end_in_cap, plan_edge_remainders
from cqblend.brep.shell_editing.end_curve import BlendEndError
from cqblend.brep.shell_editing.end_in_point import end_in_point
from cqblend.brep.shell_editing.end_on_faces import end_on_faces
from cqblend.brep.shell_editing.full_round import SharedRails, share_rails
from cqblend.brep.shell_editing.lost_parts import LostParts, find_lost_parts, list_kept_vertices
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim, trim_neighbour_edges
from cqblend.brep.shell_editing.rail_edges import RailSpan, SpineRemoval, TrimmedRail, trim_at_rail
from cqblend.brep.shell_editing.seam_cuts import SeamCrossings, cut_seams
from cqblend.brep.shell_editing.strip_end import PlacedEnd, RailsTooShortError, StripEnd, StripsTooShortError
from cqblend.brep.shell_editing.strip_placement import CapStations, StripPlacement
from cqblend.brep.topology import find_end_vertices, is_among
from cqblend.errors import CqblendError, GeometryError, SizeError, TopologyError


@dataclass(frozen=True)
class PlannedChain:
    """The strips of one chain as planned for themselves: what they do to faces, and what they share with other chains.

    ``own_faces`` are the changes that concern no other chain, but for ``edge_trims`` and ``crossings`` of seams, which
    ``cut_faces`` has as they are if there is no other chain. ``patches`` are faces of corners that it ends at: a
    corner's are those of one of its chains. ``corner_methods`` tell how corners at both ends are put together.
    """

    strips: tuple[StripPlan, ...]
    own_faces: tuple[FacePlan, ...]
    edge_trims: tuple[EdgeTrim, ...]
    crossings: tuple[SeamCrossings, ...]
    cut_faces: tuple[FacePlan, ...]
    patches: tuple[PatchPlan, ...] = ()
    corner_methods: tuple[CornerMethod | None, CornerMethod | None] = (None, None)

    @property
    def cut_edges(self) -> frozenset[int]:
        """The numbers of the seams and neighbour edges that it cuts."""
        return frozenset(number for face in self.cut_faces for number in face.pieces)


class ChainConflictError(CqblendError):
    """Some chains, by their indices, cannot be in one solid, although each of them can: ``cause`` is why."""

    def __init__(self, chains: Sequence[int], cause: CqblendError) -> None:
        super().__init__(str(cause), kind=cause.kind)
        self.chains = tuple(chains)
        self.cause = cause


@dataclass(frozen=True)
class PlacedChain:
    """A chain with its strips placed, one for each of its cells.

    If open, it ends in flat caps at the given t of its first and its last cell, at a corner, or naturally (None).
    """

    chain: Chain
    placements: Sequence[StripPlacement]
    caps: CapStations = (None, None)

    @property
    def domain(self) -> tuple[float, float]:
        """The range that its strips reach over, from a t of the first cell to one of the last."""
        low, high = (self.to_rail_parameter(end, self.placements[-end].domain[end]) for end in (0, 1))
        return low, high

    def to_rail_parameter(self, end: int, s: float) -> float:
        """Return the t of the first cell (``end`` 0) or of the last (1) at the parameter s of its strip."""
        return float(self.placements[-end].strip.to_rail_parameters(np.array([s]))[0])

    def get_end(self, end: int) -> PlacedEnd:
        """Return its start (0) or its stop (1)."""
        return PlacedEnd(self.placements[-end], end)


class FaultyChainError(CqblendError):
    """One chain of a network, by its index, cannot be planned: ``cause`` is why."""

    def __init__(self, chain: int, cause: CqblendError) -> None:
        super().__init__(str(cause), kind=cause.kind)
        self.chain = chain
        self.cause = cause


class ShortChainsError(CqblendError):
    """Chains of a network, by their indices, must be made over longer ranges: see :class:`RailsTooShortError`.

    Those that are ``exact`` must be made over just these ranges, which may be shorter.
    """

    def __init__(self, needed: Mapping[int, tuple[float, float]], exact: Collection[int] = ()) -> None:
        super().__init__(f"{len(needed)} chains are too short for what they end on")
        self.needed_domains = needed
        self.exact = frozenset(exact)


def plan_network(chains: Sequence[PlacedChain], corners: Sequence[BlendCorner] = ()) -> list[PlannedChain]:
    """Plan to put the strips of all chains of a network in the place of their edges.

    Where ends of chains meet in ``corners``, they are planned together; each other end for itself.

    Raises
    ------
    ShortChainsError
        If chains must reach further than their rails.
    FaultyChainError
        If a chain cannot be planned: because of a :class:`BlendEndError`, if it cannot end so at one end, or because
        its rails do not fit on the support faces.
    """
    ends, patches, methods = _plan_corners(chains, corners)
    short: dict[int, tuple[float, float]] = {}
    for k, placed in enumerate(chains):
        if placed.chain.closed:
            continue
        try:
            low, high = (ends.get(ChainEnd(k, end)) or _plan_end(placed, end) for end in (0, 1))
            check_reach(placed.placements, (low, high))
        except RailsTooShortError as error:
            short[k] = error.needed_domain
        except CqblendError as error:
            raise FaultyChainError(k, error) from error
        else:
            ends[ChainEnd(k, 0)], ends[ChainEnd(k, 1)] = low, high
    if short:
        raise ShortChainsError(short)
    planned = []
    for k, placed in enumerate(chains):
        try:
            outer = None if placed.chain.closed else (ends[ChainEnd(k, 0)], ends[ChainEnd(k, 1)])
            at_corners = methods.get(ChainEnd(k, 0)), methods.get(ChainEnd(k, 1))
            own = tuple(patches.get(k, ()))
            planned.append(replace(_plan_chain(placed, outer), patches=own, corner_methods=at_corners))
        except CqblendError as error:
            raise FaultyChainError(k, error) from error
    return planned


def _plan_corners(
    chains: Sequence[PlacedChain], corners: Sequence[BlendCorner]
) -> tuple[dict[ChainEnd, StripEnd], dict[int, list[PatchPlan]], dict[ChainEnd, CornerMethod]]:
    """Return what ends of chains that meet in corners end in, faces of corners by their first chain, and methods."""
    ends: dict[ChainEnd, StripEnd] = {}
    patches: dict[int, list[PatchPlan]] = {}
    methods: dict[ChainEnd, CornerMethod] = {}
    short: dict[int, tuple[float, float]] = {}
    exact: set[int] = set()
    for corner in corners:
        try:
            plan = plan_corner(corner, [chains[one.chain].get_end(one.end) for one in corner.ends])
        except StripsTooShortError as error:
            for one, s in zip(corner.ends, error.needed, strict=True):
                if s is not None:
                    placed = chains[one.chain]
                    low, high = short.get(one.chain, placed.domain)
                    t = placed.to_rail_parameter(one.end, s)
                    if error.exactly:
                        low, high = (low, t) if one.end else (t, high)
                        exact.add(one.chain)
                    short[one.chain] = (low, max(high, t)) if one.end else (min(low, t), high)
            continue
        except CqblendError as error:
            first = corner.ends[0]
            raise FaultyChainError(first.chain, BlendEndError(first.end, error)) from error
        ends.update(zip(corner.ends, plan.ends, strict=True))
        patches.setdefault(corner.ends[0].chain, []).extend(plan.patches)
        methods |= dict.fromkeys(corner.ends, plan.method)
    if short:
        raise ShortChainsError(short, exact)
    return ends, patches, methods


def _plan_chain(placed: PlacedChain, outer: tuple[StripEnd, StripEnd] | None) -> PlannedChain:
    """Plan the strips of a chain between its two ends, which a closed one has not.

    Raises
    ------
    SizeError, TopologyError, GeometryError
        If the rails do not fit on the support faces.
    """
    placements, chain = placed.placements, placed.chain
    if chain.closed and not chain.junctions:
        (placement,) = placements
        lost = None if chain.divides is None else find_lost_parts(placements, chain, (), ((), ()), placed.caps)
        return _finish_chain(placement.index, [_plan_ring(placement, lost)], lost)
    joined = join_chain(placements, chain)
    starts, stops = [pair[1] for pair in joined], [pair[0] for pair in joined]
    if outer is None:
        starts = [starts[-1], *starts[:-1]]
    else:
        low, high = outer
        _require_apart(low, high)
        starts, stops = [low, *starts], [*stops, high]
    cell_caps: list[list[float | None]] = [[None, None] for _ in placements]
    cell_caps[0][0], cell_caps[-1][1] = placed.caps
    lost = None if chain.divides is None else find_lost_parts(placements, chain, joined, (starts, stops), placed.caps)
    cells = [
        _plan_cell(placement, ends, (cap[0], cap[1]), lost)
        for placement, ends, cap in zip(placements, zip(starts, stops, strict=True), cell_caps, strict=True)
    ]
    return _finish_chain(placements[0].index, cells, lost)


def check_reach(placements: Sequence[StripPlacement], ends: tuple[StripEnd, StripEnd]) -> None:
    """Raise RailsTooShortError if the end curves of an open chain are past the ends of its rails."""
    first, last = placements[0], placements[-1]
    low, high = min(ends[0].rail_parameters), max(ends[1].rail_parameters)
    if low < first.domain[0] or high > last.domain[1]:
        raise RailsTooShortError(
            (
                float(first.strip.to_rail_parameters(np.array([low]))[0]),
                float(last.strip.to_rail_parameters(np.array([high]))[0]),
            )
        )


def _require_apart(low: StripEnd, high: StripEnd) -> None:
    """Raise SizeError if both ends of a chain take away the same edge, or the same face."""
    edges = [{number for plan in end.face_plans for number in plan.pieces} for end in (low, high)]
    if edges[0] & edges[1] or set(low.removed_faces) & set(high.removed_faces):
        raise _make_meeting_error()


def _make_meeting_error() -> SizeError:
    return SizeError(
        "the two ends of the blend meet: the size is too large for the length of the edge", kind="too large"
    )


@dataclass(frozen=True)
class _PlannedCell:
    """One strip, its two rails, and its two ends, if it has any."""

    strip: StripPlan
    rails: tuple[TrimmedRail, TrimmedRail]
    ends: tuple[StripEnd, ...] = ()


def _plan_ring(placement: StripPlacement, lost: LostParts | None) -> _PlannedCell:
    """Plan a strip that closes by itself, in a seam; ``lost`` is what goes under it, if it is on faces beyond."""
    low, high = placement.domain
    corners = [PlannedVertex(row(np.array([low]))[0]) for row in placement.rail_curves]
    removed = (
        SpineRemoval(dict.fromkeys(placement.spine_numbers, ()), list_spine_vertices(placement))
        if lost is None
        else SpineRemoval({}, lost.vertices)
    )
    first, second = (
        trim_at_rail(placement, i, RailSpan(placement.domain, (corner, corner), joined=(True, True)), removed)
        for i, corner in enumerate(corners)
    )
    section = placement.strip.locate_section(low)
    pcurve = placement.plan_pcurve(section.make_pcurve(high), section.make_pcurve(low))
    seam = EdgeUse(NewEdge("seam", section.curve, section.span, (corners[0], corners[1]), (pcurve,)))
    boundary = (*map(EdgeUse, first.edges), seam, *reverse_path([EdgeUse(e) for e in second.edges]), seam.reverse())
    return _PlannedCell(_make_strip_plan(placement, boundary, (first, second), ()), (first, second))


def _plan_cell(
    placement: StripPlacement, ends: tuple[StripEnd, StripEnd], caps: CapStations, lost: LostParts | None
) -> _PlannedCell:
    """Plan a strip between two ends; ``lost`` is what goes under its chain, if that is divided."""
    low, high = ends
    removed = (
        SpineRemoval(plan_edge_remainders(placement, (low, high), caps), _list_removed_vertices(placement, caps))
        if lost is None
        else SpineRemoval({}, lost.vertices)
    )
    rails = []
    for i in (0, 1):
        span = (low.rail_parameters[i], high.rail_parameters[i])
        if span[0] >= span[1]:
            raise _make_meeting_error()
        borders = (low.cap_borders[i], high.cap_borders[i])
        part = RailSpan(span, (low.corners[i], high.corners[i]), borders, (low.is_junction, high.is_junction))
        rails.append(trim_at_rail(placement, i, part, removed))
    first, second = rails
    boundary = (
        *map(EdgeUse, first.edges),
        *high.path,
        *reverse_path([EdgeUse(edge) for edge in second.edges]),
        *reverse_path(low.path),
    )
    return _PlannedCell(_make_strip_plan(placement, boundary, (first, second), ends), (first, second), ends)


def _make_strip_plan(
    placement: StripPlacement,
    boundary: tuple[EdgeUse, ...],
    rails: tuple[TrimmedRail, TrimmedRail],
    ends: tuple[StripEnd, ...],
) -> StripPlan:
    """Return the plan of a blend face."""
    return StripPlan(
        placement.spine_numbers,
        placement.face_numbers,
        placement.surface,
        boundary,
        (_list_edges(rails[0], "rail"), _list_edges(rails[1], "rail")),
        (next(iter(_list_edges(rails[0], "pole")), None), next(iter(_list_edges(rails[1], "pole")), None)),
        tuple(end.edges for end in ends),
        tuple(end.cap for end in ends if end.cap is not None),
        tuple(number for end in ends for number in end.removed_faces),
        placement.strip.is_mirrored,
    )


def _list_edges(rail: TrimmedRail, role: EdgeRole) -> tuple[NewEdge, ...]:
    """Return the edges of a rail that have a role."""
    return tuple(edge for edge in rail.edges if edge.role == role)


def _finish_chain(index: SolidIndex, cells: Sequence[_PlannedCell], lost: LostParts | None = None) -> PlannedChain:
    """Return the plan of a chain, with the seams and the neighbour edges that it cuts.

    The first of its strips takes the place of faces that are lost under the chain.
    """
    own: list[FacePlan] = []
    for cell in cells:
        own += [rail.face_plan for rail in cell.rails]
        own += [plan for end in cell.ends for plan in end.face_plans]
    trims = tuple(trim for cell in cells for end in cell.ends for trim in end.edge_trims)
    strips = [cell.strip for cell in cells]
    if lost is not None:
        own += lost.face_plans
        trims += lost.edge_trims
        strips[0] = replace(strips[0], removed_faces=(*strips[0].removed_faces, *lost.faces))
    crossings = tuple(rail.crossings for cell in cells for rail in cell.rails if rail.crossings is not None)
    cuts = tuple(cut_shared_edges(index, trims, crossings))
    return PlannedChain(tuple(strips), tuple(own), trims, crossings, cuts)


def cut_shared_edges(
    index: SolidIndex, trims: Iterable[EdgeTrim], crossings: Iterable[SeamCrossings]
) -> list[FacePlan]:
    """Return what cutting neighbour edges and seams means for the faces that have them."""
    by_face: dict[int, list[SeamCrossings]] = {}
    for one in crossings:
        by_face.setdefault(index.faces.find_number(one.face), []).append(one)
    seams = [FacePlan(number, cut_seams(own, index)) for number, own in by_face.items()]
    return [*trim_neighbour_edges(trims, index), *(plan for plan in seams if plan.pieces)]


def merge_chains(index: SolidIndex, chains: Sequence[PlannedChain]) -> SolidPlan:
    """Return the plan of a solid with several chains of strips.

    Raises
    ------
    ChainConflictError
        If chains want to cut one edge of the solid in ways that exclude each other.
    """
    trims: dict[int, list[EdgeTrim]] = {}
    for trim in (trim for chain in chains for trim in chain.edge_trims):
        trims.setdefault(index.edges.find_number(trim.edge), []).append(trim)
    shared = share_rails([strip for chain in chains for strip in chain.strips], trims)
    if shared.vertices or shared.consumed:
        chains = [_use_shared_rails(chain, shared, index) for chain in chains]
    cuts: list[FacePlan] = []
    for group in group_networks([chain.cut_edges for chain in chains]):
        members = [chains[k] for k in group]
        try:
            cuts += (
                members[0].cut_faces
                if len(members) == 1
                else cut_shared_edges(
                    index,
                    [trim for member in members for trim in member.edge_trims],
                    [one for member in members for one in member.crossings],
                )
            )
        except CqblendError as error:
            raise ChainConflictError(group, error.cause if isinstance(error, BlendEndError) else error) from error
    own = [plan for chain in chains for plan in chain.own_faces]
    removed = [number for chain in chains for strip in chain.strips for number in strip.removed_faces]
    try:
        faces = _merge_face_plans(plan for plan in [*own, *cuts] if plan.number not in shared.consumed)
        _require_unchanged(removed, faces)
    except TopologyError as error:
        raise ChainConflictError(range(len(chains)), error) from error
    return SolidPlan(
        tuple(strip for chain in chains for strip in chain.strips),
        faces,
        consumed_faces=tuple(sorted(shared.consumed)),
        patches=tuple(patch for chain in chains for patch in chain.patches),
    )


def _use_shared_rails(chain: PlannedChain, shared: SharedRails, index: SolidIndex) -> PlannedChain:
    """Return the plan of a chain on the rails that it shares with others."""
    crossings = [one for one in chain.crossings if index.faces.find_number(one.face) not in shared.consumed]
    return PlannedChain(
        tuple(map(shared.replace_strip, chain.strips)),
        tuple(shared.replace_face(plan) for plan in chain.own_faces if plan.number not in shared.consumed),
        tuple(map(shared.replace_trim, chain.edge_trims)),
        tuple(map(shared.replace_crossings, crossings)),
        tuple(map(shared.replace_face, chain.cut_faces)),
        chain.patches,
        chain.corner_methods,
    )


def _merge_face_plans(plans: Iterable[FacePlan]) -> tuple[FacePlan, ...]:
    """Return one plan for each face.

    Raises
    ------
    TopologyError
        If an edge of a face, or its surface, is to be replaced twice.
    """
    merged: dict[int, FacePlan] = {}
    for plan in plans:
        before = merged.get(plan.number)
        if before is None:
            merged[plan.number] = plan
            continue
        twice = set(before.pieces) & set(plan.pieces)
        if twice or before.surface is not None or plan.surface is not None:
            what = f"its edge {min(twice)}" if twice else "its surface"
            raise TopologyError(f"two blends change face {plan.number} of the solid, and {what}, in different ways")
        pieces, added = {**before.pieces, **plan.pieces}, (*before.added, *plan.added)
        merged[plan.number] = FacePlan(plan.number, pieces, added)
    return tuple(merged.values())


def _require_unchanged(removed: Sequence[int], faces: Iterable[FacePlan]) -> None:
    """Raise TopologyError if a face that goes is changed by another blend, or goes with two."""
    changed = Counter([*removed, *(plan.number for plan in faces)])
    twice = [number for number in removed if changed[number] > 1]
    if twice:
        raise TopologyError(f"face {twice[0]} of the solid goes with one blend, and another changes it")


def list_spine_vertices(placement: StripPlacement) -> list[TopoDS_Vertex]:
    """Return the vertices of the blended edges."""
    return [vertex for edge in placement.joint.spine.edges for vertex in find_end_vertices(edge)]


def _list_removed_vertices(placement: StripPlacement, caps: CapStations) -> list[TopoDS_Vertex]:
    """Return the vertices of the blended edges that go."""
    kept = list_kept_vertices(placement, caps)
    return [vertex for vertex in list_spine_vertices(placement) if not is_among(vertex, kept)]


def _plan_end(placed: PlacedChain, end: int) -> StripEnd:
    """End a chain: in a flat cap, in a point, on the faces across the edge, or in the border."""
    placement, cap = placed.placements[-end], placed.caps[end]
    try:
        if cap is not None:
            return end_in_cap(placement, end, cap)
        if placement.ends_in_point(end):
            return end_in_point(placement, end)
        border = placement.joint.border_ends[end]
        return end_on_faces(placement, end) if border is None else end_at_border(placement, end, border)
    except RailsTooShortError:
        raise
    except (SizeError, TopologyError, GeometryError) as error:
        raise BlendEndError(end, error) from error
