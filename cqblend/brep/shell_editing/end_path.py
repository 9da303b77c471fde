"""The way around the end of a blend, over whatever faces lie there: from the end of rail 1 to that of rail 2.

It starts where rail 1 leaves its support face, over an edge or a vertex of that face. On the face beyond, it is the
curve in which the blend meets that face, up to the next edge or vertex that it crosses; and so on, until it arrives
where rail 2 leaves its own support face.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from OCP.BRep import BRep_Tool
from OCP.gp import gp_Pnt2d
from OCP.TopAbs import TopAbs_OUT
from OCP.TopoDS import TopoDS_Edge, TopoDS_Face, TopoDS_Vertex

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.network.strip_surface import StripCut
from cqblend.brep.conversion.support_face import SupportFace, read_support_face
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.shell_editing.end_curve import EndCurveStart, solve_touch_point
from cqblend.brep.shell_editing.end_tracing import Meeting, MeetingPoint
from cqblend.brep.shell_editing.face_boundary import BoundaryMark, FaceBoundary
from cqblend.brep.shell_editing.neighbour_edges import LEAST_REMAINDER
from cqblend.brep.shell_editing.strip_end import RailsTooShortError
from cqblend.brep.shell_editing.strip_placement import StripPlacement
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import CONFUSION, find_end_vertices, is_among, locate_vertex
from cqblend.errors import CqblendError, GeometryError, TopologyError
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class Crossing:
    """Where the way crosses the boundary of a face: the point (3,), on an edge of that face or at a vertex of it."""

    boundary: FaceBoundary
    mark: BoundaryMark
    point: Array

    @property
    def edge(self) -> TopoDS_Edge:
        """The edge."""
        return self.boundary.uses[self.mark.use]

    @property
    def vertex(self) -> TopoDS_Vertex | None:
        """The vertex, where it is at one."""
        return self.mark.vertex


@dataclass(frozen=True)
class PathPiece:
    """The part of the way on one face: the curve in which the blend meets it, and where that enters and leaves."""

    side: SupportFace
    boundary: FaceBoundary
    cut: StripCut
    entry: BoundaryMark
    exit: BoundaryMark


@dataclass(frozen=True)
class EndPath:
    """A way around the end of a blend.

    ``crossings`` are the points at which pieces start and stop, one more than there are pieces: the first and the last
    as the support faces have them, the others as the face before has them.
    """

    pieces: tuple[PathPiece, ...]
    crossings: tuple[Crossing, ...]


def find_end_path(placement: StripPlacement, end: int) -> EndPath:
    """Return the way around one end (0 or 1) of a blend.

    Raises
    ------
    RailsTooShortError
        If a rail ends before it leaves its face.
    TopologyError, GeometryError
        If there is no such way.
    """
    return _PathWalker(placement, end).walk()


def list_cut_uses(placement: StripPlacement, end: int, i: int, crossing: Crossing) -> list[int]:
    """Return the uses of support face ``i`` between the blended edge and where its rail leaves it past an end.

    Raises
    ------
    TopologyError
        If the rail leaves it over another boundary.
    """
    own = [k for k, use in enumerate(crossing.boundary.uses) if is_among(use, placement.joint.spine.edges)]
    found = crossing.boundary.list_until(crossing.mark, own, backward=not leaves_support(placement, end, i))
    if found is None:
        raise TopologyError(f"the rail on face {placement.joint.face_numbers[i]} runs into a hole of it")
    return found


def leaves_support(placement: StripPlacement, end: int, i: int) -> bool:
    """Whether the boundary of support face ``i``, FORWARD, leaves its new one where the rail ends, or comes back to it.

    Rail 1 has what remains of its face to its left, seen from outside, and rail 2 to its right.
    """
    return ((placement.sides[i].outward > 0) == (i == 0)) != (end == 1)


class _PathWalker:
    """The search for the way around one end of a blend."""

    def __init__(self, placement: StripPlacement, end: int) -> None:
        self.placement, self.end = placement, end
        self.joint, self.index, self.strip = placement.joint, placement.index, placement.strip
        self.outward = 1.0 if end else -1.0  # the sense of s past this end
        at_end = np.array([placement.locate_edge_parameter(float(end))])
        first, last = (self.strip(at_end, np.array([v]))[0] for v in (0.0, 1.0))
        self.size = float(np.linalg.norm(last - first))
        self.step = self.size * SHELL_EDIT_TOLERANCES.trace_step
        speed = float(np.linalg.norm(self.strip.jet(at_end, np.array([0.5]), 1)[1, 0, 0]))
        self.reach = placement.domain[end] + self.outward * self.size / speed
        self.attempts = 0
        self.read_boundary = cache(lambda number: FaceBoundary(self.index.faces[number]))

    def make_short_error(self) -> RailsTooShortError:
        """Return the error that asks for a blend that reaches further past this end."""
        needed = [*self.placement.domain]
        needed[self.end] = self.reach
        first, last = self.strip.to_rail_parameters(np.array(needed)).tolist()
        return RailsTooShortError((first, last))

    def walk(self) -> EndPath:
        """Return the way: the first that arrives, of those that go on at every crossing as they can."""
        (first, s), (last, self.last_parameter) = (self._find_rail_exit(i) for i in (0, 1))
        self.cut_edges = {
            self.index.edges.find_number(crossing.boundary.uses[k])
            for i, crossing in enumerate((first, last))
            for k in list_cut_uses(self.placement, self.end, i, crossing)
        }
        return self._walk_on(EndPath((), (first,)), np.array([s, 0.0, np.nan, np.nan]), last)

    def _walk_on(self, path: EndPath, x: Array, last: Crossing) -> EndPath:
        """Return a way that begins with a given one and arrives; x is the point of the curve where that stops."""
        crossing = path.crossings[-1]
        if path.pieces and crossing is last:
            return path
        failures: list[CqblendError] = []
        for side, boundary, entry in self._list_faces_beyond(crossing):
            for follow in (self._trace, self._grow):
                self.attempts += 1
                if self.attempts > SHELL_EDIT_TOLERANCES.max_end_faces:
                    raise TopologyError("a natural end there would run over too many faces")
                try:
                    meeting = Meeting.at_end(self.placement, self.end, side)
                    start = self._find_start(meeting, side, boundary, entry, crossing, x)
                    points, leaving, exit_mark = follow(meeting, side, boundary, start, entry, last)
                    self._require_length(points)
                    piece = PathPiece(side, boundary, meeting.fit_through(points), entry, exit_mark)
                except (TopologyError, GeometryError) as failure:
                    is_short = isinstance(failure, RailsTooShortError)
                    name = self.joint.name_part(side.face)
                    failures.append(failure if is_short else failure.with_details(before=f"on {name}, "))
                    continue
                longer = EndPath((*path.pieces, piece), (*path.crossings, leaving))
                try:
                    return self._walk_on(longer, points[-1].x, last)
                except (TopologyError, GeometryError) as failure:
                    failures.append(failure)
        if not failures:
            part = self.joint.name_part(crossing.edge if crossing.vertex is None else crossing.vertex)
            raise TopologyError(f"there is no face to end on beyond {part}")
        raise next((one for one in failures if isinstance(one, RailsTooShortError)), failures[0])

    def _find_rail_exit(self, i: int) -> tuple[Crossing, float]:
        """Return where rail ``i`` leaves its face, on its way from the middle of the edge past its end, and s there."""
        placement, side = self.placement, self.placement.sides[i]
        boundary = self.read_boundary(placement.face_numbers[i])
        stations = np.linspace(
            placement.locate_edge_parameter(0.5), placement.domain[self.end], SHELL_EDIT_TOLERANCES.rail_chords + 1
        )
        passed = [k for k, use in enumerate(boundary.uses) if self._may_pass(use, boundary.face)]
        path = placement.get_rail_pcurve(i)(stations)
        found = boundary.find_first_crossing(path, side.face_primary.periods, passed)
        if found is None:
            raise self.make_short_error()
        v = np.array([float(i)])

        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            uv, rate = boundary.evaluate(found.use, float(x[0, 1]))
            n, h = side.face_primary.jet(uv[None]), self.strip.jet(x[:, 0], v, 1)
            rates = np.stack([h[1, 0, 0], -(n[1, 0] * rate[0] + n[2, 0] * rate[1])], axis=1)
            tangents = n[1:3, 0] / np.linalg.norm(n[1:3, 0], axis=1)[:, None]
            return (
                (tangents @ (h[0, 0, 0] - n[0, 0]))[None],
                (tangents @ rates)[None],
                np.linalg.norm(rates, axis=0)[None],
            )

        start = np.array([[np.interp(found.share, np.arange(len(stations)), stations), found.parameter]])
        x, good = solve_damped_newton(evaluate_system, start, self.size, self.size)
        if not good[0]:
            raise TopologyError(f"the rail does not leave face {self.joint.face_numbers[i]} cleanly there")
        point = self.strip(x[:, 0], v)[0]
        return self._make_crossing(boundary, found.use, float(x[0, 1]), point), float(x[0, 0])

    def _may_pass(self, use: TopoDS_Edge, face: TopoDS_Face) -> bool:
        """Whether a rail may cross a use of an edge of its face on its way: those of blended edges, and seams."""
        return BRep_Tool.IsClosed_s(use, face) or is_among(use, self.joint.spine.edges)

    def _make_crossing(self, boundary: FaceBoundary, use: int, parameter: float, point: Array) -> Crossing:
        """Return a crossing of a use, or of that vertex of it which is as near as its tolerance."""
        edge = boundary.uses[use]
        for stops, vertex in zip((False, True), find_end_vertices(edge), strict=True):
            if np.linalg.norm(locate_vertex(vertex) - point) <= max(BRep_Tool.Tolerance_s(vertex), CONFUSION):
                return Crossing(boundary, boundary.mark_vertex(use, stops=stops), point)
        return Crossing(boundary, BoundaryMark(use, parameter), point)

    def _list_faces_beyond(self, crossing: Crossing) -> Iterator[tuple[SupportFace, FaceBoundary, BoundaryMark]]:
        """Yield the faces that the way can go on to from a crossing, with the mark where it enters.

        Beyond a seam it is the same face.
        """
        here = crossing.boundary.face
        faces = (
            self.index.faces_at_edge(crossing.edge)
            if crossing.vertex is None
            else self.index.faces_at_vertex(crossing.vertex)
        )
        for face in [face for face in faces if not face.IsSame(here)] or [here]:
            number = self.index.faces.find_number(face)
            if number in self.placement.face_numbers:
                continue
            boundary = self.read_boundary(number)
            entry = self._find_entry(crossing, boundary)
            if entry is not None:
                yield read_support_face(self.index.faces[number], crossing.point[None]), boundary, entry

    def _find_entry(self, crossing: Crossing, boundary: FaceBoundary) -> BoundaryMark | None:
        """Return the mark of a crossing on the boundary of the face beyond; None if it is not there."""
        if crossing.vertex is not None:
            return boundary.find_vertex(crossing.vertex)
        uses = boundary.find_uses(crossing.edge)
        if boundary is crossing.boundary:  # which meets itself there
            uses.remove(crossing.mark.use)  # none is left of a free edge
        return BoundaryMark(uses[0], crossing.mark.parameter) if uses else None

    def _find_start(
        self,
        meeting: Meeting,
        side: SupportFace,
        boundary: FaceBoundary,
        entry: BoundaryMark,
        crossing: Crossing,
        x: Array,
    ) -> MeetingPoint:
        """Return where the curve on a face starts, at a crossing; x is the point of the curve before."""
        uv = boundary.evaluate(entry.use, entry.parameter)[0]
        if not x[1]:
            return self._find_rail_end(meeting, side, crossing, np.concatenate([x[:2], uv]))
        near = np.concatenate([x[:2], uv])
        row = meeting.measure_scales(near) ** 2 * meeting.evaluate_rates(near)[:2]
        found, good = meeting.solve_points(near[None], row[None], np.array([row @ x[:2]]))
        if not good[0]:
            raise TopologyError("the blend does not go on")
        return MeetingPoint(found[0], meeting.evaluate_rates(found[0]))

    def _find_rail_end(self, meeting: Meeting, side: SupportFace, crossing: Crossing, near: Array) -> MeetingPoint:
        """Return the point of the curve on a face where a rail ends, near a point x with v = 0 or 1."""
        i = round(float(near[1]))
        on_support = self.placement.get_rail_pcurve(i)(near[:1])
        normals = [
            self.placement.sides[i].face_primary.evaluate_normals(on_support)[0],
            side.face_primary.evaluate_normals(near[None, 2:])[0],
        ]
        if np.linalg.norm(np.cross(*normals)) < SHELL_EDIT_TOLERANCES.tangent_faces:
            start = EndCurveStart(self.end, float(near[0]), near[2:], crossing.point)
            touch = solve_touch_point(meeting.blend, meeting.target, start, i, into_blend=False)
            x = np.array([touch.t, float(i), *touch.uv])
            return MeetingPoint(x, meeting.direct_rates(x, np.array([touch.slope, 1.0])), touches=True)
        x, good = meeting.solve_points(near[None], np.array([[0.0, self.size]]), np.array([i * self.size]))
        if not good[0]:
            raise TopologyError("the blend does not meet it where its rail ends")
        return MeetingPoint(x[0], meeting.evaluate_rates(x[0]))

    def _trace(
        self,
        meeting: Meeting,
        side: SupportFace,
        boundary: FaceBoundary,
        start: MeetingPoint,
        entry: BoundaryMark,
        last: Crossing,
    ) -> tuple[list[MeetingPoint], Crossing, BoundaryMark]:
        """Follow the curve over a face; return points of it up to where it leaves it, and what it crosses there."""
        if not start.x[1] and start.rates[1] <= 0:
            raise TopologyError("the blend does not go over it")
        point, step, points = start, self.step, [start]
        skipped = [entry.use] if entry.vertex is None else [entry.use, boundary.find_following(entry.use)]
        finish = self._find_finish(meeting, side, boundary, last)
        for _ in range(SHELL_EDIT_TOLERANCES.max_trace_steps):
            is_near = finish is not None and np.linalg.norm(self._locate(point) - last.point) < 1.5 * step
            following = finish[0] if finish is not None and is_near else self._advance(meeting, point)
            path = np.stack([point.x[2:], following.x[2:]])
            found = boundary.find_first_crossing(path, side.face_primary.periods, skipped)
            if found is not None:
                near = point.x + found.share * (following.x - point.x)
                apart = np.linalg.norm(meeting.target.jet(near[None, 2:])[0, 0] - last.point)
                if not is_near or apart > SHELL_EDIT_TOLERANCES.near_rail_end * step:
                    stop, leaving = self._cross(meeting, boundary, near, found.use, found.parameter)
                    return [*points, stop], leaving, leaving.mark
            if finish is not None and is_near:
                return [*points, finish[0]], last, finish[1]
            if not 0.0 <= following.x[1] <= 1.0:
                raise TopologyError("the blend leaves it beside its rail, not where the rail ends")
            if skipped and self._is_outside(side, following.x[2:]):
                raise TopologyError("the blend does not go over it")
            if (following.x[0] - self.reach) * self.outward > 0:
                raise self.make_short_error()
            point, skipped = following, []
            points.append(point)
        raise TopologyError("the blend does not come to an end")

    def _grow(
        self,
        meeting: Meeting,
        side: SupportFace,
        boundary: FaceBoundary,
        start: MeetingPoint,
        entry: BoundaryMark,
        last: Crossing,
    ) -> tuple[list[MeetingPoint], Crossing, BoundaryMark]:
        """Follow the curve beside a face, which then gets more of its surface; return the same as for one on it.

        That is so where a wall stands in the way of the blend, or the blend fills a corner up to a wall's end. It goes
        on up to the edge, or past its vertex, that follows in the face's boundary on what is cut off the sides.
        """
        forward = self.runs_forward(side)
        at = boundary.find_following(entry.use) if forward else boundary.find_preceding(entry)
        while self.index.edges.find_number(boundary.uses[at]) in self.cut_edges:
            at = boundary.find_following(at) if forward else boundary.find_preceding(BoundaryMark(at, 0.0))
        finish = self._find_finish(meeting, side, boundary, last)
        if finish is not None and finish[1].use == at:
            return [start.reverse(), finish[0].reverse()], last, finish[1]
        near_vertex = boundary.mark_vertex(at, stops=not forward)
        near = np.concatenate([start.x[:2], boundary.evaluate(at, near_vertex.parameter)[0]])
        stop, leaving = self._cross(meeting, boundary, near, at, near_vertex.parameter)
        if not 0.0 <= stop.x[1] <= 1.0:
            raise TopologyError("the blend would have to end on a part that this face does not have")
        return [start.reverse(), stop.reverse()], leaving, leaving.mark

    def _require_length(self, points: Sequence[MeetingPoint]) -> None:
        """Raise TopologyError if the curve through some points is too short for an edge."""
        if np.linalg.norm(self._locate(points[0]) - self._locate(points[-1])) < LEAST_REMAINDER:
            raise TopologyError("the blend does not go over it")

    def runs_forward(self, side: SupportFace) -> bool:
        """Whether the way runs along the new boundary of a FORWARD face, not against it."""
        return (self.end == 1) == (side.outward > 0)

    def _advance(self, meeting: Meeting, point: MeetingPoint) -> MeetingPoint:
        """Return the point of the curve a step further: a smaller one where parameters turn quickly, as at a pole."""
        step = self.step
        while True:
            following = meeting.advance(point, step)
            ends = np.stack([point.x[2:], following.x[2:]])
            first, middle, last = meeting.target.jet(np.insert(ends, 1, ends.mean(axis=0), axis=0))[0]
            if np.linalg.norm(middle - (first + last) / 2) < SHELL_EDIT_TOLERANCES.trace_sag * step:
                return following
            if step < SHELL_EDIT_TOLERANCES.least_trace_step * self.step:
                raise TopologyError("the blend runs too near to a pole of it")
            step /= 2

    def _locate(self, point: MeetingPoint) -> Array:
        """Return a point of the curve in space (3,)."""
        return self.strip(point.x[:1], point.x[1:2])[0]

    def _find_finish(
        self, meeting: Meeting, side: SupportFace, boundary: FaceBoundary, last: Crossing
    ) -> tuple[MeetingPoint, BoundaryMark] | None:
        """Return where the curve on a face would arrive at the end of rail 2; None if the face is not there."""
        mark = self._find_entry(last, boundary)
        if mark is None:
            return None
        uv = boundary.evaluate(mark.use, mark.parameter)[0]
        try:
            stop = self._find_rail_end(meeting, side, last, np.array([self.last_parameter, 1.0, *uv]))
        except (TopologyError, GeometryError):
            return None
        apart = np.linalg.norm(self._locate(stop) - last.point)
        return None if apart > SHELL_EDIT_TOLERANCES.near_rail_end * self.step else (stop, mark)

    def _is_outside(self, side: SupportFace, uv: Array) -> bool:
        """Whether parameters (2,) are outside of a face."""
        classifier = self.index.get_classifier(side.face, SELECT_TOLERANCES.face_boundary)
        (inside,) = side.wrap_to_window(uv[None])
        return bool(classifier.Perform(gp_Pnt2d(*inside.tolist())) == TopAbs_OUT)

    def _cross(
        self, meeting: Meeting, boundary: FaceBoundary, near: Array, use: int, parameter: float
    ) -> tuple[MeetingPoint, Crossing]:
        """Return where the curve crosses a use of an edge, near a point x and at about a parameter of the edge."""
        shift = np.zeros(2)
        for axis, period in enumerate(meeting.target.periods):
            if period is not None:
                offset = near[2 + axis] - boundary.evaluate(use, parameter)[0][axis]
                shift[axis] = period * np.round(offset / period)

        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            uv, rate = boundary.evaluate(use, float(x[0, 2]))
            h, n = self.strip.jet(x[:, 0], x[:, 1], 1), meeting.target.jet((uv + shift)[None])
            rates = np.stack([h[1, 0], h[0, 1], -(n[1] * rate[0] + n[2] * rate[1])], axis=2)
            return h[0, 0] - n[0], rates, np.linalg.norm(rates, axis=1)

        x, good = solve_damped_newton(evaluate_system, np.array([[*near[:2], parameter]]), self.size, self.size)
        if not good[0]:
            part = self.joint.name_part(boundary.uses[use])
            raise TopologyError(f"the blend does not cross {part} cleanly")
        at = float(x[0, 2])
        stop = np.concatenate([x[0, :2], boundary.evaluate(use, at)[0] + shift])
        point = self.strip(x[:, 0], x[:, 1])[0]
        return MeetingPoint(stop, meeting.evaluate_rates(stop)), self._make_crossing(boundary, use, at, point)
