"""Full rounds: two strips whose rails coincide on the face between them share one rail edge, and that face goes.

Both strips are tangent to the face along the common rail, and so to each other, whatever became of the face. One rail
edge, on the curve of the first strip, takes the place of both; corners that coincide become one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np

from cqblend.blends.network.blend_plan import (
    CapPlan,
    EdgePiece,
    EdgeUse,
    FacePlan,
    KeptEdge,
    NewEdge,
    PlannedPcurve,
    PlannedSurface,
    PlannedVertex,
    StripPlan,
    reverse_path,
)
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim
from cqblend.brep.shell_editing.seam_cuts import SeamCrossings
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import CONFUSION
from cqblend.splines import Curve
from cqblend.splines.bernstein import Array
from cqblend.surfaces.circle import Circle


@dataclass
class SharedRails:
    """What takes the place of the rails that coincide: which faces they consume, and what replaces edges and vertices.

    ``edges`` has the new uses of each edge that was used forward.
    """

    consumed: set[int] = field(default_factory=set)
    edges: dict[NewEdge | EdgePiece, tuple[EdgeUse, ...]] = field(default_factory=dict)
    vertices: dict[PlannedVertex, PlannedVertex] = field(default_factory=dict)

    def join(self, rail: tuple[PlannedPcurve, NewEdge], twin: tuple[PlannedPcurve, NewEdge], *, opposite: bool) -> None:
        """Put one edge, on the curve of the first, in the place of two rails, each with its pcurve on its strip."""
        (pcurve, edge), (other_pcurve, other) = rail, twin
        partners = other.vertices[::-1] if opposite else other.vertices
        corners = [self._join_vertices(*pair) for pair in zip(edge.vertices, partners, strict=True)]
        ends = other_pcurve.curve(np.array(other.span[::-1] if opposite else other.span))
        across = PlannedPcurve(other_pcurve.face, _make_line(ends, edge.span))
        order = min(edge.order, other.order)
        common_edge = NewEdge("rail", edge.curve, edge.span, (corners[0], corners[1]), (pcurve, across), order)
        self.edges[edge], self.edges[other] = (EdgeUse(common_edge),), (EdgeUse(common_edge, forward=not opposite),)

    def join_circles(
        self, rail: tuple[PlannedPcurve, NewEdge], twin: tuple[PlannedPcurve, NewEdge], at: float, *, opposite: bool
    ) -> None:
        """Put two arcs in the place of two circles, of which the second one starts at a parameter of the first."""
        (pcurve, edge), (other_pcurve, other) = rail, twin
        (low, high), (start, stop), order = edge.span, other.span, min(edge.order, other.order)
        spans = ((low, at), (at, high))
        ends = (
            ((start + at - low, start), (stop, stop - high + at))
            if opposite
            else ((stop - at + low, stop), (start, start + high - at))
        )
        corners = ((edge.vertices[0], other.vertices[0]), (other.vertices[0], edge.vertices[0]))
        arcs = []
        for span, pair, between in zip(spans, ends, corners, strict=True):
            own = pcurve.curve.clip(*span) if isinstance(pcurve.curve, Curve) else pcurve.curve
            across = _make_line(other_pcurve.curve(np.array(pair)), span)
            pcurves = (PlannedPcurve(pcurve.face, own), PlannedPcurve(other_pcurve.face, across))
            arcs.append(NewEdge("rail", edge.curve, span, between, pcurves, order))
        first, second = map(EdgeUse, arcs)
        self.edges[edge] = (first, second)
        self.edges[other] = (first.reverse(), second.reverse()) if opposite else (second, first)

    def join_corners(self, corner: PlannedVertex, other: PlannedVertex) -> None:
        """Make two corners one if they coincide."""
        if corner is not other and np.linalg.norm(corner.point - other.point) <= CONFUSION:
            self._join_vertices(corner, other)

    def _join_vertices(self, vertex: PlannedVertex, other: PlannedVertex) -> PlannedVertex:
        common = self.vertices.get(vertex) or self.vertices.get(other)
        if common is None:
            gap = max(vertex.gap, other.gap, float(np.linalg.norm(vertex.point - other.point)))
            common = replace(vertex, gap=gap)
        self.vertices[vertex] = self.vertices[other] = common
        return common

    def replace_strip(self, strip: StripPlan) -> StripPlan:
        """Return the plan of a strip on the common edges."""
        first, second = (
            tuple(use.edge for edge in side for use in self._replace_use(EdgeUse(edge))) for side in strip.rails
        )
        poles = [None if edge is None else self._find_new_edge(edge) for edge in strip.poles]
        return replace(
            strip,
            boundary=self._replace_uses(strip.boundary),
            rails=(first, second),
            poles=(poles[0], poles[1]),
            end_edges=tuple(tuple(map(self._find_new_edge, edges)) for edges in strip.end_edges),
            caps=tuple(CapPlan(cap.surface, self._replace_uses(cap.boundary)) for cap in strip.caps),
        )

    def replace_face(self, plan: FacePlan) -> FacePlan:
        """Return the plan of a face on the common edges."""
        pieces = {
            number: tuple(one if isinstance(one, KeptEdge) else self._replace_use(EdgeUse(one))[0].edge for one in some)
            for number, some in plan.pieces.items()
        }
        return replace(plan, pieces=pieces, added=self._replace_uses(plan.added))

    def replace_trim(self, trim: EdgeTrim) -> EdgeTrim:
        """Return the trim of an edge to the common corner."""
        border = trim.cap_border
        if border is not None:
            edge = self._replace_use(EdgeUse(border))[0].edge
            border = edge if isinstance(edge, EdgePiece) else border
        return replace(trim, corner=self.vertices.get(trim.corner, trim.corner), cap_border=border)

    def replace_crossings(self, crossings: SeamCrossings) -> SeamCrossings:
        """Return the crossings of seams at the common vertices."""
        return replace(crossings, vertices=[self.vertices.get(vertex, vertex) for vertex in crossings.vertices])

    def _replace_uses(self, uses: Sequence[EdgeUse]) -> tuple[EdgeUse, ...]:
        return tuple(one for use in uses for one in self._replace_use(use))

    def _replace_use(self, use: EdgeUse) -> tuple[EdgeUse, ...]:
        if use.edge not in self.edges:
            low, high = (self.vertices.get(vertex, vertex) for vertex in use.edge.vertices)
            same = low is use.edge.vertices[0] and high is use.edge.vertices[1]
            self.edges[use.edge] = (EdgeUse(use.edge if same else replace(use.edge, vertices=(low, high))),)
        found = self.edges[use.edge]
        return found if use.forward else tuple(reverse_path(found))

    def _find_new_edge(self, edge: NewEdge) -> NewEdge:
        found = self._replace_use(EdgeUse(edge))[0].edge
        assert isinstance(found, NewEdge)
        return found


@dataclass(frozen=True)
class _SupportedRail:
    """One rail of a strip: its edges, the surface of the strip, and the number of the support face."""

    edges: tuple[NewEdge, ...]
    surface: PlannedSurface
    face: int

    def get_pcurve(self, edge: NewEdge) -> PlannedPcurve:
        """Return the pcurve of one of the edges on the strip."""
        return next(pcurve for pcurve in edge.pcurves if pcurve.face is self.surface)


def share_rails(strips: Sequence[StripPlan], trims: Mapping[int, Sequence[EdgeTrim]]) -> SharedRails:
    """Return what replaces rails of different strips that coincide on a common support face.

    Where they do not, but two corners coincide, ``trims`` by strips of the input's edge there, these become one.
    """
    rails = [
        _SupportedRail(tuple(edge for edge in edges if isinstance(edge, NewEdge)), strip.surface, face)
        for strip in strips
        for edges, face in zip(strip.rails, strip.support_faces, strict=True)
        if edges and not any(isinstance(edge, EdgePiece) for edge in edges)  # no points, none held on edges that stay
    ]
    by_face: dict[int, list[_SupportedRail]] = {}
    for rail in rails:
        by_face.setdefault(rail.face, []).append(rail)
    shared = SharedRails()
    for face, own in by_face.items():
        for one, other in _list_near_pairs(own):
            pairs = _match_rails(one.edges, other.edges)
            for edge, twin, opposite in pairs:
                shared.join((one.get_pcurve(edge), edge), (other.get_pcurve(twin), twin), opposite=opposite)
            circles = None if pairs else _match_circles(one.edges, other.edges)
            if circles is not None:
                (edge,), (twin,), (at, opposite) = one.edges, other.edges, circles
                shared.join_circles((one.get_pcurve(edge), edge), (other.get_pcurve(twin), twin), at, opposite=opposite)
            if pairs or circles is not None:
                shared.consumed.add(face)
    for at_edge in trims.values():
        for first, second in combinations(at_edge, 2):
            shared.join_corners(first.corner, second.corner)
    return shared


def _list_near_pairs(rails: Sequence[_SupportedRail]) -> list[tuple[_SupportedRail, _SupportedRail]]:
    """Return the pairs of rails that have an end in common, or are arcs of one circle."""
    if len(rails) < 2:
        return []
    starts = np.array([rail.edges[0].vertices[0].point for rail in rails])
    stops = np.array([rail.edges[-1].vertices[1].point for rail in rails])
    circles = np.full((len(rails), 4), np.nan)
    for row, rail in zip(circles, rails, strict=True):
        curve = rail.edges[0].curve
        if isinstance(curve, Circle):
            row[:] = *curve.frame.origin, curve.radius

    def measure_distances(one: Array, other: Array) -> Array:
        return np.linalg.norm(one[:, None] - other, axis=2)

    near = [measure_distances(*pair) for pair in ((starts, starts), (starts, stops), (circles, circles))]
    found = np.triu((np.array(near) <= 2 * CONFUSION).any(axis=0), 1)
    return [(rails[i], rails[j]) for i, j in np.argwhere(found).tolist()]


def _match_rails(one: Sequence[NewEdge], other: Sequence[NewEdge]) -> list[tuple[NewEdge, NewEdge, bool]]:
    """Return pairs of edges of two rails that coincide, each with whether their senses differ; empty if they do not."""
    if len(one) != len(other):
        return []
    for opposite in (False, True):
        pairs = list(zip(one, other[::-1] if opposite else other, strict=True))
        if all(_coincide(edge, twin, opposite=opposite) for edge, twin in pairs):
            return [(edge, twin, opposite) for edge, twin in pairs]
    return []


def _match_circles(one: Sequence[NewEdge], other: Sequence[NewEdge]) -> tuple[float, bool] | None:
    """Return where on a whole circle another one that coincides starts, and whether in the opposite sense; or None."""
    if len(one) != 1 or len(other) != 1:
        return None
    (edge,), (twin,) = one, other
    circle, partner = edge.curve, twin.curve
    is_closed = all(rail.vertices[0] is rail.vertices[1] for rail in (edge, twin))
    if not (is_closed and isinstance(circle, Circle) and isinstance(partner, Circle)):
        return None
    x, y = circle.frame.axes[:2] @ (twin.vertices[0].point - circle.frame.origin)
    at = edge.span[0] + float(np.mod(np.arctan2(y, x) - edge.span[0], 2 * np.pi))
    steps = np.linspace(0.0, 2 * np.pi, SHELL_EDIT_TOLERANCES.shared_rail_samples)
    for opposite in (False, True):
        apart = circle(at + steps) - partner(twin.span[0] + (-steps if opposite else steps))
        if np.linalg.norm(apart, axis=1).max() <= CONFUSION:
            return at, opposite
    return None


def _coincide(edge: NewEdge, twin: NewEdge, *, opposite: bool) -> bool:
    """Whether two edges run along each other at proportional parameters."""
    shares = np.linspace(0.0, 1.0, SHELL_EDIT_TOLERANCES.shared_rail_samples)
    points, others = (
        _evaluate_at_shares(edge, shares[:1]),
        _evaluate_at_shares(twin, shares[-1 if opposite else 0 :][:1]),
    )
    if np.linalg.norm(points - others) > CONFUSION:
        return False
    others = _evaluate_at_shares(twin, 1 - shares if opposite else shares)
    return bool(np.linalg.norm(_evaluate_at_shares(edge, shares) - others, axis=1).max() <= CONFUSION)


def _evaluate_at_shares(edge: NewEdge, shares: Array) -> Array:
    assert edge.curve is not None
    low, high = edge.span
    return edge.curve(low * (1 - shares) + high * shares)


def _make_line(ends: Array, span: tuple[float, float]) -> Curve:
    """Return the line between two points (2, 2) of a strip's parameter plane, over a span.

    It is at unit speed if it nearly is, so that lines along an angle remain such.
    """
    middle, step, length = ends.mean(axis=0), ends[1] - ends[0], span[1] - span[0]
    along = int(np.abs(step).argmax())
    if abs(abs(step[along]) - length) <= SHELL_EDIT_TOLERANCES.shared_rail_speed * length:
        step[along] = np.sign(step[along]) * length
    return Curve.bezier([middle - step / 2, middle + step / 2], domain=span)
