"""Plan how blends go into a solid, by new boundaries of the faces that they touch.

No intersection is computed and no boolean is run. The two support faces are trimmed at the rails: the rail edges take
the place of the blended edge in their wires. The blend face goes in on the same rail edges. A closed rail may cross
seams: rail and seam are split there. An open blend ends, at each end, on the face across the edge or in a flat cap: the
end curve is solved point by point.

Strips are planned one by one (:func:`plan_strip`), and then together (:func:`merge_strips`): seams and neighbour edges
that several of them cut are cut once, for all of them.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from OCP.TopoDS import TopoDS_Vertex

from cqblend.blends.network.blend_plan import (
    EdgeUse,
    FacePlan,
    NewEdge,
    PlannedPcurve,
    PlannedVertex,
    SolidPlan,
    StripPlan,
    reverse_path,
)
from cqblend.blends.network.edge_networks import group_networks
from cqblend.brep.selection.solid_index import SolidIndex
from cqblend.brep.shell_editing.end_cap import end_in_cap, plan_edge_remainders
from cqblend.brep.shell_editing.end_curve import BlendEndError
from cqblend.brep.shell_editing.end_on_faces import end_on_faces
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim, trim_neighbour_edges
from cqblend.brep.shell_editing.rail_edges import RailSpan, SpineRemoval, TrimmedRail, trim_at_rail
from cqblend.brep.shell_editing.seam_cuts import SeamCrossings, cut_seams
from cqblend.brep.shell_editing.strip_end import RailsTooShortError, StripEnd
from cqblend.brep.shell_editing.strip_placement import CapStations, StripPlacement
from cqblend.brep.topology import find_end_vertices, is_among
from cqblend.errors import CqblendError, GeometryError, SizeError, TopologyError
from cqblend.splines import Curve


@dataclass(frozen=True)
class PlannedStrip:
    """One strip as planned for itself: the strip, what it does to faces, and what it shares with other strips.

    ``own_faces`` are the changes that concern no other strip, but for ``edge_trims`` and ``crossings`` of seams, which
    ``cut_faces`` has as they are if there is no other strip.
    """

    strip: StripPlan
    own_faces: tuple[FacePlan, ...]
    edge_trims: tuple[EdgeTrim, ...]
    crossings: tuple[SeamCrossings, ...]
    cut_faces: tuple[FacePlan, ...]

    @property
    def cut_edges(self) -> frozenset[int]:
        """The numbers of the seams and neighbour edges that it cuts."""
        return frozenset(number for face in self.cut_faces for number in face.pieces)


class StripConflictError(CqblendError):
    """Some strips, by their indices, cannot be in one solid, although each of them can: ``cause`` is why."""

    def __init__(self, strips: Sequence[int], cause: CqblendError) -> None:
        super().__init__(str(cause), kind=cause.kind)
        self.strips = tuple(strips)
        self.cause = cause


def plan_strip(placement: StripPlacement, caps: CapStations) -> PlannedStrip:
    """Plan to put a blend in the place of its edge; an open one ends in flat caps at the given t, or naturally (None).

    Raises
    ------
    RailsTooShortError
        If the blend must reach further than its rails.
    BlendEndError
        If it cannot end so at one end.
    SizeError, TopologyError, GeometryError
        If the rails do not fit on the support faces.
    """
    return _plan_closed_strip(placement) if placement.joint.spine.closed else _plan_open_strip(placement, caps)


def _plan_closed_strip(placement: StripPlacement) -> PlannedStrip:
    low, high = placement.domain
    corners = [PlannedVertex(row(np.array([low]))[0]) for row in placement.rail_curves]
    removed = SpineRemoval(dict.fromkeys(placement.spine_numbers, ()), _list_spine_vertices(placement))
    first, second = (
        trim_at_rail(placement, i, RailSpan(placement.domain, (corner, corner)), removed)
        for i, corner in enumerate(corners)
    )
    before, after = (Curve.bezier([(t, 0.0), (t, 1.0)]) for t in (low, high))
    pcurve = PlannedPcurve(placement.surface, after, before)
    seam = EdgeUse(NewEdge("seam", placement.strip.first_section, (0.0, 1.0), (corners[0], corners[1]), (pcurve,)))
    boundary = (*map(EdgeUse, first.edges), seam, *reverse_path([EdgeUse(e) for e in second.edges]), seam.reverse())
    return _finish_strip(placement, boundary, (first, second), ())


def _plan_open_strip(placement: StripPlacement, caps: CapStations) -> PlannedStrip:
    low, high = (_plan_end(placement, end, cap) for end, cap in enumerate(caps))
    needed = (min(low.rail_parameters), max(high.rail_parameters))
    if needed[0] < placement.domain[0] or needed[1] > placement.domain[1]:
        first, last = placement.strip.to_rail_parameters(np.array(needed)).tolist()
        raise RailsTooShortError((first, last))
    removed = SpineRemoval(
        plan_edge_remainders(placement, (low, high), caps),
        _list_removed_vertices(placement, caps),
    )
    rails = []
    for i in (0, 1):
        span = (low.rail_parameters[i], high.rail_parameters[i])
        if span[0] >= span[1]:
            raise SizeError(
                "the two ends of the blend meet: the size is too large for the length of the edge", kind="too large"
            )
        borders = (low.cap_borders[i], high.cap_borders[i])
        rails.append(trim_at_rail(placement, i, RailSpan(span, (low.corners[i], high.corners[i]), borders), removed))
    first, second = rails
    boundary = (
        *map(EdgeUse, first.edges),
        *map(EdgeUse, high.edges),
        *reverse_path([EdgeUse(edge) for edge in second.edges]),
        *reverse_path([EdgeUse(edge) for edge in low.edges]),
    )
    return _finish_strip(placement, boundary, (first, second), (low, high))


def _finish_strip(
    placement: StripPlacement,
    boundary: tuple[EdgeUse, ...],
    rails: tuple[TrimmedRail, TrimmedRail],
    ends: tuple[StripEnd, ...],
) -> PlannedStrip:
    """Return the plan of a strip, with the seams and the neighbour edges that it cuts."""
    strip = StripPlan(
        placement.spine_numbers,
        placement.face_numbers,
        placement.surface,
        boundary,
        (rails[0].edges, rails[1].edges),
        tuple(end.edges for end in ends),
        tuple(end.cap for end in ends if end.cap is not None),
        tuple(number for end in ends for number in end.removed_faces),
    )
    own = (*(rail.face_plan for rail in rails), *(plan for end in ends for plan in end.face_plans))
    trims = tuple(trim for end in ends for trim in end.edge_trims)
    crossings = tuple(rail.crossings for rail in rails if rail.crossings is not None)
    return PlannedStrip(strip, own, trims, crossings, tuple(_cut_shared_edges(placement.index, trims, crossings)))


def _cut_shared_edges(
    index: SolidIndex, trims: Iterable[EdgeTrim], crossings: Iterable[SeamCrossings]
) -> list[FacePlan]:
    """Return what cutting neighbour edges and seams means for the faces that have them."""
    by_face: dict[int, list[SeamCrossings]] = {}
    for one in crossings:
        by_face.setdefault(index.faces.find_number(one.face), []).append(one)
    seams = [FacePlan(number, cut_seams(own, index)) for number, own in by_face.items()]
    return [*trim_neighbour_edges(trims, index), *(plan for plan in seams if plan.pieces)]


def merge_strips(index: SolidIndex, strips: Sequence[PlannedStrip]) -> SolidPlan:
    """Return the plan of a solid with several strips.

    Raises
    ------
    StripConflictError
        If strips want to cut one edge of the solid in ways that exclude each other.
    """
    cuts: list[FacePlan] = []
    for group in group_networks([strip.cut_edges for strip in strips]):
        members = [strips[k] for k in group]
        try:
            cuts += (
                members[0].cut_faces
                if len(members) == 1
                else _cut_shared_edges(
                    index,
                    [trim for member in members for trim in member.edge_trims],
                    [one for member in members for one in member.crossings],
                )
            )
        except CqblendError as error:
            raise StripConflictError(group, error.cause if isinstance(error, BlendEndError) else error) from error
    own = [plan for strip in strips for plan in strip.own_faces]
    removed = [number for strip in strips for number in strip.strip.removed_faces]
    try:
        faces = _merge_face_plans([*own, *cuts])
        _require_unchanged(removed, faces)
    except TopologyError as error:
        raise StripConflictError(range(len(strips)), error) from error
    return SolidPlan(tuple(strip.strip for strip in strips), faces)


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


def _list_spine_vertices(placement: StripPlacement) -> list[TopoDS_Vertex]:
    """Return the vertices of the blended edges."""
    return [vertex for edge in placement.joint.spine.edges for vertex in find_end_vertices(edge)]


def _list_removed_vertices(placement: StripPlacement, caps: CapStations) -> list[TopoDS_Vertex]:
    """Return the vertices of the blended edges but for those at an end with a flat cap."""
    kept = [vertex for vertex, cap in zip(placement.joint.spine.vertices, caps, strict=True) if cap is not None]
    return [vertex for vertex in _list_spine_vertices(placement) if not is_among(vertex, kept)]


def _plan_end(placement: StripPlacement, end: int, cap: float | None) -> StripEnd:
    """End the blend at one end of the edge: in a flat cap at t = ``cap``, or on the face across the edge."""
    try:
        return end_on_faces(placement, end) if cap is None else end_in_cap(placement, end, cap)
    except RailsTooShortError:
        raise
    except (SizeError, TopologyError, GeometryError) as error:
        raise BlendEndError(end, error) from error
