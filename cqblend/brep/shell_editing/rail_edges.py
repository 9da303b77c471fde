"""The edges of a blend's rails, and the trimming of the support faces at them.

The 3D curve of a rail edge is the blend surface's own boundary row of poles. Where a rail crosses a seam of its face,
it is split there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from OCP.TopoDS import TopoDS_Vertex

from cqblend.blends.network.blend_plan import (
    EdgePiece,
    EdgeUse,
    FacePlan,
    NewEdge,
    PlannedPcurve,
    PlannedVertex,
    reverse_path,
)
from cqblend.blends.rails.ribbon import dehomogenise_jets
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.shell_editing.realigned_spheres import plan_sphere_boundary
from cqblend.brep.shell_editing.seam_cuts import SeamCrossings
from cqblend.brep.shell_editing.strip_placement import PlacedStrip, StripPlacement
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import find_end_vertices, find_seam_edges, is_among
from cqblend.errors import TopologyError
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.splines.roots import find_sign_changes


@dataclass(frozen=True)
class RailSpan:
    """The part of one rail that bounds the blend face: its range of t, and the vertices at both ends.

    Where the blend ends in flat caps, ``cap_borders`` are their borders in the support face at the low and at the high
    end, from the blended edge to the rail. ``joined`` tells at which ends another rail of the
    chain goes on, or the rail itself, if it closes.
    """

    span: tuple[float, float]
    vertices: tuple[PlannedVertex, PlannedVertex]
    cap_borders: tuple[tuple[EdgeUse, ...], tuple[EdgeUse, ...]] = ((), ())
    joined: tuple[bool, bool] = (False, False)


@dataclass(frozen=True)
class SpineRemoval:
    """What becomes of the blended edges."""

    remainders: Mapping[int, tuple[EdgePiece, ...]]  # number of the edge -> pieces of it beyond flat caps
    vertices: Sequence[TopoDS_Vertex]  # that are no longer on the support faces


@dataclass(frozen=True)
class TrimmedRail:
    """The edges of one rail, in its order, what they do to the support face, and where they may cross its seams.

    A rail that is one point has a pole for its only edge, which is none of the support face.
    """

    edges: tuple[NewEdge, ...]
    face_plan: FacePlan
    crossings: SeamCrossings | None


def trim_at_rail(placement: StripPlacement, i: int, part: RailSpan, removed: SpineRemoval) -> TrimmedRail:
    """Plan the edges of rail ``i`` (0 or 1), split at seams, and the trimming of the support face there.

    Raises
    ------
    SizeError
        If the rail passes beyond the end of the face.
    """
    side, sphere, span = placement.sides[i], placement.spheres[i], part.span
    if placement.blend.ribbons[i].is_point:
        face_plan = FacePlan(placement.face_numbers[i], removed.remainders)
        return TrimmedRail((_plan_pole(placement, i, part),), face_plan, None)
    crossings = find_seam_crossings(placement, i) if sphere is None else np.empty(0)
    crossings = crossings[(crossings > span[0]) & (crossings < span[1])]
    points = placement.rail_curves[i](crossings)
    for corner in part.vertices:  # where that is on a seam, rounding may have the rail cross it just before
        is_apart = np.linalg.norm(points - corner.point, axis=1) > SHELL_EDIT_TOLERANCES.at_seam
        crossings, points = crossings[is_apart], points[is_apart]
    stops = np.concatenate([span[:1], crossings, span[1:]]).tolist()
    between = list(map(PlannedVertex, points))
    vertices = [part.vertices[0], *between, part.vertices[1]]
    edges = tuple(
        plan_rail_edge(placement, i, (vertices[k], vertices[k + 1]), (stops[k], stops[k + 1]))
        for k in range(len(stops) - 1)
    )
    runs_with_boundary = (side.outward > 0) == (i == 0)
    path = [*part.cap_borders[0], *map(EdgeUse, edges), *(use.reverse() for use in part.cap_borders[1])]
    uses = path if runs_with_boundary else reverse_path(path)
    number = placement.face_numbers[i]
    if sphere is not None:
        into_blend = evaluate_directions(placement, i, np.array([span[0]]))[0]
        boundary = plan_sphere_boundary(sphere, uses[0], into_blend)
        return TrimmedRail(edges, FacePlan(number, added=boundary, surface=sphere), None)
    if not any(side.face_primary.periods):  # no face without a period has seams
        return TrimmedRail(edges, FacePlan(number, removed.remainders, tuple(uses)), None)
    if part.joined[0]:  # it may cross a seam where it starts
        crossings, between = np.array(stops[:-1]), vertices[:-1]
    # an open chain may end on a seam, of which the rest remains
    for end in _find_ends_on_seams(placement, i, part, removed):
        crossings, between = np.append(crossings, span[end]), [*between, part.vertices[end]]
    directions = evaluate_directions(placement, i, crossings) if between else np.empty((0, 3))
    at_seams = SeamCrossings(side.face, between, directions, removed.vertices)
    return TrimmedRail(edges, FacePlan(number, removed.remainders, tuple(uses)), at_seams)


def _plan_pole(placement: StripPlacement, i: int, part: RailSpan) -> NewEdge:
    """Plan the degenerate edge of rail ``i``, which is one point.

    Raises
    ------
    TopologyError
        If the neighbours of the strip do not meet in that point.
    """
    first, last = part.vertices
    if first is not last:
        raise TopologyError(
            f"the ball turns about one point of face {placement.joint.face_numbers[i]} and has nothing to end on "
            "there: blend the edges that go on tangentially as well, with chain=True"
        )
    line = Curve.bezier([(part.span[0], i), (part.span[1], i)], domain=part.span)
    return NewEdge("pole", None, part.span, part.vertices, (placement.plan_pcurve(line),))


def _find_ends_on_seams(placement: StripPlacement, i: int, part: RailSpan, removed: SpineRemoval) -> list[int]:
    """Return at which ends, 0 and 1, an open chain ends at a vertex that goes, and from which a seam leaves."""
    seam_vertices = [v for seam in find_seam_edges(placement.sides[i].face) for v in find_end_vertices(seam)]
    ends = enumerate(placement.joint.spine.vertices)
    return [
        end
        for end, vertex in ends
        if not part.joined[end] and is_among(vertex, seam_vertices) and is_among(vertex, removed.vertices)
    ]


def plan_rail_edge(
    placement: PlacedStrip, i: int, vertices: tuple[PlannedVertex, PlannedVertex], span: tuple[float, float]
) -> NewEdge:
    """Plan the edge of rail ``i`` over a span of t, with pcurves on the support face and on the blend face."""
    side, curve = placement.sides[i], placement.get_rail_pcurve(i)
    shift = find_window_shift(side, curve(np.array([sum(span) / 2]))[0])
    if isinstance(curve, Curve):
        curve = curve if span == placement.domain else curve.clip(*span)
        curve = curve + shift if shift.any() else curve
    pcurves = (
        PlannedPcurve(placement.get_support(i), curve),
        placement.plan_pcurve(Curve.bezier([(span[0], i), (span[1], i)], domain=span)),
    )
    order = placement.blend.ribbons[i].order
    return NewEdge("rail", placement.rail_curves[i], span, vertices, pcurves, min(order, 2))


def find_window_shift(side: SupportFace, uv: Array) -> Array:
    """Return the whole periods (2,) by which a point's own parameters (2,) are to be shifted into a face's window."""
    shift = np.zeros(2)
    for axis, period in enumerate(side.face_primary.periods):
        if period is not None:
            periods = np.floor((uv[axis] - side.bounds[axis, 0]) / period + SHELL_EDIT_TOLERANCES.rail_end_at_seam)
            shift[axis] = -period * periods
    return shift


def find_seam_crossings(placement: PlacedStrip, i: int) -> Array:
    """Return where rail ``i`` crosses seams of its support face, in t, ascending; not at its ends."""
    side, curve, tolerance = placement.sides[i], placement.rail_pcurves[i], SHELL_EDIT_TOLERANCES.rail_end_at_seam
    found = [np.empty(0)]
    if isinstance(curve, Curve) and find_seam_edges(side.face):
        coefs = curve.coefs
        for axis, period in enumerate(side.face_primary.periods):
            if period is None:
                continue
            weight = coefs[:, 2] if curve.rational else np.ones_like(coefs[:, 0])
            value = coefs[:, axis] / weight
            start = side.bounds[axis, 0]
            first, last = np.floor((value.min() - start) / period), np.ceil((value.max() - start) / period)
            for k in range(int(first), int(last) + 1):
                seam = start + k * period
                at_breaks = curve(curve.breaks)[:, axis] - seam
                found.append(curve.breaks[np.abs(at_breaks) < tolerance * period])
                column, root = find_sign_changes(
                    coefs[:, axis] - seam * weight, np.full(coefs.shape[-1], 1e-14 * (1 + abs(seam)))
                )
                found.append(curve.breaks[column] + root * np.diff(curve.breaks)[column])
    t = np.unique(np.concatenate(found))
    low, high = placement.domain
    t = t[(t > low + tolerance * (high - low)) & (t < high - tolerance * (high - low))]
    return t[np.append(True, np.diff(t) > tolerance * (high - low))] if len(t) else t


def evaluate_directions(placement: PlacedStrip, i: int, s: Array) -> Array:
    """Return the directions into the blend (n, 3) along rail ``i``."""
    rail, t = placement.blend.ribbons[i], placement.strip.to_rail_parameters(s)
    return dehomogenise_jets(np.stack([jet(t) for jet in rail.jets[:2]]))[1]
