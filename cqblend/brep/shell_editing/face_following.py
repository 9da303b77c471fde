"""Follow the curve in which a blend meets one face at its end, from where it enters to where it leaves.

There are three ways. The curve crosses the face, and the blend cuts a part of it off. It runs beside the face, which
then grows up to the blend: a wall that stands in its way, or the end of a corner that it fills. Or it is an edge of the
face, which lies on the blend, such as that of an earlier round of the same radius.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from OCP.gp import gp_Pnt2d
from OCP.TopAbs import TopAbs_OUT

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.network.strip_surface import StripCut
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.shell_editing.end_crossings import BlendEnd, Crossing, RailExit, make_crossing
from cqblend.brep.shell_editing.end_curve import EndCurveStart, fit_solved_curve, solve_touch_point
from cqblend.brep.shell_editing.end_tracing import Meeting, MeetingPoint
from cqblend.brep.shell_editing.face_boundary import BoundaryMark, FaceBoundary
from cqblend.brep.shell_editing.neighbour_edges import LEAST_REMAINDER
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.errors import GeometryError, TopologyError
from cqblend.splines.bernstein import Array


@dataclass(frozen=True)
class FollowedCurve:
    """The curve on one face, where it leaves the face, as a mark and as a crossing, and x = (s, v, a, b) there."""

    cut: StripCut
    exit: BoundaryMark
    leaving: Crossing
    x: Array


@dataclass(frozen=True)
class FaceEntry:
    """A face that a blend goes on to at its end, and where: at a crossing, the ``mark`` on this face's boundary.

    ``x`` is (s, v, a, b) of the curve on the face before, or (s, 0, nan, nan) at the end of rail 1. ``rail_exits`` are
    where the rails leave their support faces; ``cut_edges`` the numbers of the edges that these lose there.
    """

    at: BlendEnd
    side: SupportFace
    boundary: FaceBoundary
    mark: BoundaryMark
    crossing: Crossing
    x: Array
    rail_exits: tuple[RailExit, RailExit]
    cut_edges: frozenset[int]

    @cached_property
    def _meeting(self) -> Meeting:
        return Meeting.at_end(self.at.placement, self.at.end, self.side)

    @property
    def _last(self) -> Crossing:
        """Where rail 2 ends."""
        return self.rail_exits[1].crossing

    @cached_property
    def runs_forward(self) -> bool:
        """Whether the way runs along the new boundary of the FORWARD face, not against it."""
        return (self.at.end == 1) == (self.side.outward > 0)

    @cached_property
    def _start(self) -> MeetingPoint:
        """Where the curve starts.

        Raises
        ------
        TopologyError, GeometryError
            If there is no such point.
        """
        near = np.concatenate([self.x[:2], self.boundary.evaluate(self.mark.use, self.mark.parameter)[0]])
        if not self.x[1]:
            return self._find_rail_end(self.crossing, near)
        row = self._meeting.measure_scales(near) ** 2 * self._meeting.evaluate_rates(near)[:2]
        found, good = self._meeting.solve_points(near[None], row[None], np.array([row @ self.x[:2]]))
        if not good[0]:
            raise TopologyError("the blend does not go on")
        return MeetingPoint(found[0], self._meeting.evaluate_rates(found[0]))

    @cached_property
    def _finish(self) -> tuple[MeetingPoint, BoundaryMark] | None:
        """Where the curve would arrive at the end of rail 2; None if the face is not there."""
        mark = self._last.find_entry(self.boundary)
        if mark is None:
            return None
        near = np.array([self.rail_exits[1].s, 1.0, *self.boundary.evaluate(mark.use, mark.parameter)[0]])
        try:
            stop = self._find_rail_end(self._last, near)
        except (TopologyError, GeometryError):
            return None
        return (stop, mark) if self._measure_rest(stop) <= SHELL_EDIT_TOLERANCES.near_rail_end * self._step else None

    @cached_property
    def _step(self) -> float:
        """The length (mm) of steps along the curve."""
        return self._meeting.size * SHELL_EDIT_TOLERANCES.trace_step

    def follow_across(self) -> FollowedCurve:
        """Follow the curve over the face.

        Raises
        ------
        RailsTooShortError
            If the blend must be longer for that.
        TopologyError, GeometryError
            If it does not go over the face, or not on from there.
        """
        meeting, point, finish = self._meeting, self._start, self._finish
        if not point.x[1] and point.rates[1] <= 0:
            raise TopologyError("the blend does not go over it")
        points, reach = [point], self.at.reach
        skipped = [self.mark.use, *([] if self.mark.vertex is None else [self.boundary.find_following(self.mark.use)])]
        for _ in range(SHELL_EDIT_TOLERANCES.max_trace_steps):
            is_near = finish is not None and self._measure_rest(point) < 1.5 * self._step
            following = finish[0] if finish is not None and is_near else self._advance(point)
            path = np.stack([point.x[2:], following.x[2:]])
            found = self.boundary.find_first_crossing(path, self.side.face_primary.periods, skipped)
            if found is not None:
                near = point.x + found.share * (following.x - point.x)
                apart = float(np.linalg.norm(meeting.target.jet(near[None, 2:])[0, 0] - self._last.point))
                if not is_near or apart > SHELL_EDIT_TOLERANCES.near_rail_end * self._step:
                    stop, leaving = self._cross(near, found.use, found.parameter)
                    return self._fit([*points, stop], leaving.mark, leaving)
            if finish is not None and is_near:
                return self._fit([*points, finish[0]], finish[1], self._last)
            if not 0.0 <= following.x[1] <= 1.0:
                raise TopologyError("the blend leaves it beside its rail, not where the rail ends")
            if skipped and self._is_outside(following.x[2:]):
                raise TopologyError("the blend does not go over it")
            if (following.x[0] - reach) * self.at.outward > 0:
                raise self.at.make_short_error()
            point, skipped = following, []
            points.append(point)
        raise TopologyError("the blend does not come to an end")

    def follow_beside(self) -> FollowedCurve:
        """Follow the curve beside the face, which then gets more of its surface.

        It goes on up to the edge, or past the vertex of the edge, that comes next in the face's boundary after what the
        support faces lose.

        Raises
        ------
        TopologyError, GeometryError
            If it does not get there.
        """
        at = self._find_next_use(self.mark)
        while self.at.placement.index.edges.find_number(self.boundary.uses[at]) in self.cut_edges:
            at = self._find_next_use(self.boundary.mark_vertex(at, stops=self.runs_forward))
        start = self._start.reverse()
        if self._finish is not None and self._finish[1].use == at:
            return self._fit([start, self._finish[0].reverse()], self._finish[1], self._last)
        start_of_edge = self.boundary.find_span(at)[0 if self.runs_forward else 1]
        near = np.concatenate([start.x[:2], self.boundary.evaluate(at, start_of_edge)[0]])
        stop, leaving = self._cross(near, at, start_of_edge)
        if not 0.0 <= stop.x[1] <= 1.0:
            raise TopologyError("the blend would have to end on a part that this face does not have")
        return self._fit([start, stop.reverse()], leaving.mark, leaving)

    def follow_edge(self) -> FollowedCurve:
        """Follow the edge of the face that comes next after the vertex where the blend enters, if it lies on the blend.

        Raises
        ------
        TopologyError
            If it does not, or the blend enters at no vertex.
        """
        if self.mark.vertex is None:
            raise TopologyError("the blend enters between two vertices")
        use, size, strip = self._find_next_use(self.mark), self._meeting.size, self.at.placement.strip
        first, last = self.boundary.find_span(use)[:: 1 if self.runs_forward else -1]

        def locate_points(share: Array, near: Array | None) -> Array:
            """Return (s, v, a, b, x, y, z) at shares (n,) of the edge, with the feet of its points on the blend."""
            uv = self.boundary.evaluate_points(use, first + share * (last - first))
            points = self._meeting.target.jet(uv)[0]

            def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
                h = strip.jet(x[:, 0], x[:, 1], 1)
                rates = np.stack([h[1, 0], h[0, 1]], axis=1)
                residual = np.einsum("nij,nj->ni", rates, h[0, 0] - points)
                return residual / size, np.einsum("nij,nkj->nik", rates, rates) / size, np.linalg.norm(rates, axis=2)

            guess = np.column_stack([np.full(len(share), self.x[0]), share]) if near is None else near[:, :2]
            return np.column_stack([solve_damped_newton(evaluate_system, guess, size, size)[0], uv, points])

        def measure_error(values: Array, _: Array) -> float:
            """Return how far (mm) points are from their images on the blend."""
            return float(np.abs(strip(values[:, 0], values[:, 1]) - values[:, 4:]).max())

        cut = StripCut.from_solution(fit_solved_curve(locate_points, measure_error))
        t = np.linspace(*cut.span, SHELL_EDIT_TOLERANCES.checked_end_points)
        if np.abs(strip(*cut.on_strip(t).T) - cut.curve(t)).max() > SHELL_EDIT_TOLERANCES.edge_on_blend:
            raise TopologyError("the blend does not run along its edge")
        there = self.boundary.mark_vertex(use, stops=self.runs_forward)
        leaving = Crossing(self.boundary, there, cut.ends[1])
        is_last = self._last.vertex is not None and self._last.vertex.IsSame(there.vertex)
        at_stop = np.concatenate([cut.on_strip(t[-1:])[0], cut.on_other(t[-1:])[0]])
        return FollowedCurve(cut, there, self._last if is_last else leaving, at_stop)

    def _find_next_use(self, mark: BoundaryMark) -> int:
        """Return the use that comes next after a mark, on the side of what is cut off."""
        return self.boundary.find_following(mark.use) if self.runs_forward else self.boundary.find_preceding(mark)

    def _fit(self, points: Sequence[MeetingPoint], exit_mark: BoundaryMark, leaving: Crossing) -> FollowedCurve:
        """Return the curve through some points of it, the last of which is where it leaves the face."""
        if np.linalg.norm(self._locate(points[0]) - self._locate(points[-1])) < LEAST_REMAINDER:
            raise TopologyError("the blend does not go over it")
        return FollowedCurve(self._meeting.fit_through(points), exit_mark, leaving, points[-1].x)

    def _advance(self, point: MeetingPoint) -> MeetingPoint:
        """Return the point of the curve a step further: a smaller one where parameters turn quickly, as at a pole."""
        step = self._step
        while True:
            following = self._meeting.advance(point, step)
            ends = np.stack([point.x[2:], following.x[2:]])
            first, middle, last = self._meeting.target.jet(np.insert(ends, 1, ends.mean(axis=0), axis=0))[0]
            if np.linalg.norm(middle - (first + last) / 2) < SHELL_EDIT_TOLERANCES.trace_sag * step:
                return following
            if step < SHELL_EDIT_TOLERANCES.least_trace_step * self._step:
                raise TopologyError("the blend runs too near to a pole of it")
            step /= 2

    def _locate(self, point: MeetingPoint) -> Array:
        """Return a point of the curve in space (3,)."""
        return self.at.placement.strip(point.x[:1], point.x[1:2])[0]

    def _measure_rest(self, point: MeetingPoint) -> float:
        """Return how far (mm) a point of the curve is from where rail 2 ends."""
        return float(np.linalg.norm(self._locate(point) - self._last.point))

    def _find_rail_end(self, crossing: Crossing, near: Array) -> MeetingPoint:
        """Return the point of the curve where a rail ends, at a crossing, near a point x with v = 0 or 1."""
        meeting, i = self._meeting, round(float(near[1]))
        support = self.at.placement.sides[i].face_primary
        on_support = support.evaluate_normals(self.at.locate_on_support(i, near[:1]))[0]
        sine = np.linalg.norm(np.cross(on_support, self.side.face_primary.evaluate_normals(near[None, 2:])[0]))
        if sine < SHELL_EDIT_TOLERANCES.tangent_faces:
            start = EndCurveStart(self.at.end, float(near[0]), near[2:], crossing.point)
            touch = solve_touch_point(meeting.blend, meeting.target, start, i, into_blend=False)
            x = np.array([touch.t, float(i), *touch.uv])
            return MeetingPoint(x, meeting.direct_rates(x, np.array([touch.slope, 1.0])), touches=True)
        x, good = meeting.solve_points(near[None], np.array([[0.0, meeting.size]]), np.array([i * meeting.size]))
        if not good[0]:
            raise TopologyError("the blend does not meet it where its rail ends")
        return MeetingPoint(x[0], meeting.evaluate_rates(x[0]))

    def _is_outside(self, uv: Array) -> bool:
        """Whether parameters (2,) are outside of the face."""
        classifier = self.at.placement.index.get_classifier(self.side.face, SELECT_TOLERANCES.face_boundary)
        (inside,) = self.side.wrap_to_window(uv[None])
        return bool(classifier.Perform(gp_Pnt2d(*inside.tolist())) == TopAbs_OUT)

    def _cross(self, near: Array, use: int, parameter: float) -> tuple[MeetingPoint, Crossing]:
        """Return where the curve crosses a use of an edge, near a point x and at about a parameter of the edge."""
        meeting, boundary, strip = self._meeting, self.boundary, self.at.placement.strip
        shift = np.zeros(2)
        for axis, period in enumerate(meeting.target.periods):
            if period is not None:
                offset = near[2 + axis] - boundary.evaluate(use, parameter)[0][axis]
                shift[axis] = period * np.round(offset / period)

        def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
            uv, rate = boundary.evaluate(use, float(x[0, 2]))
            h, n = strip.jet(x[:, 0], x[:, 1], 1), meeting.target.jet((uv + shift)[None])
            rates = np.stack([h[1, 0], h[0, 1], -(n[1] * rate[0] + n[2] * rate[1])], axis=2)
            return h[0, 0] - n[0], rates, np.linalg.norm(rates, axis=1)

        start = np.array([[*near[:2], parameter]])
        x, good = solve_damped_newton(evaluate_system, start, meeting.size, meeting.size)
        if not good[0]:
            part = self.at.placement.joint.name_part(boundary.uses[use])
            raise TopologyError(f"the blend does not cross {part} cleanly")
        at = float(x[0, 2])
        stop = np.concatenate([x[0, :2], boundary.evaluate(use, at)[0] + shift])
        crossing = make_crossing(boundary, use, at, strip(x[:, 0], x[:, 1])[0])
        return MeetingPoint(stop, meeting.evaluate_rates(stop)), crossing
