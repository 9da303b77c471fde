"""Mitres: two strips that end in each other, where two blended edges and a sharp one meet.

Both strips run on one *common* face, and each on a *wall* of its own; the walls meet in the sharp edge. The strips meet
in a curve, the mitre: from where their rails cross on the common face, at which they touch, to where the rail of the
*shallower* strip on its wall arrives at the other strip. That is on the sharp edge, if both are equally deep there;
else the *deeper* strip goes on from there, and ends on the wall of the shallower one down to the sharp edge. So it is
at convex sharp edges, where the rails cross before the vertex, and at reflex ones, past it: there, that wall grows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from cqblend.blends.contacts.newton import solve_damped_newton
from cqblend.blends.network.blend_plan import EdgeUse, FacePlan, NewEdge, PlannedVertex, reverse_path
from cqblend.brep.shell_editing.corner_plan import CornerPlan
from cqblend.brep.shell_editing.end_curve import plan_cut_edge
from cqblend.brep.shell_editing.end_tracing import Meeting, MeetingPoint
from cqblend.brep.shell_editing.mitre_curve import cross_rails, solve_mitre_curve
from cqblend.brep.shell_editing.mitred_strip import MitredStrip, find_sharp_edge
from cqblend.brep.shell_editing.neighbour_edges import EdgeTrim
from cqblend.brep.shell_editing.strip_end import StripEnd
from cqblend.brep.shell_editing.tolerances import SHELL_EDIT_TOLERANCES
from cqblend.brep.topology import find_vertex_uv, locate_vertex
from cqblend.errors import TopologyError
from cqblend.splines.bernstein import Array

_Item = TypeVar("_Item")


def mitre_ends(first: MitredStrip, second: MitredStrip) -> CornerPlan:
    """Return what two strips end in that are mitred.

    Raises
    ------
    StripsTooShortError
        If the strips must reach further to meet.
    RailsApartError
        If their rails do not cross on the common face, or only far from the vertex.
    TopologyError
        If they do not meet so.
    """
    strips, crossing = (first, second), cross_rails(first.surface, second.surface)
    on_walls = _meet_wall(first, second), _meet_wall(second, first)
    vertex = locate_vertex(first.vertex)
    arms = [found.point - vertex for found in on_walls]
    if arms[0] @ arms[1] <= 0:
        raise TopologyError("the two blends arrive at the sharp edge there on both sides of its end")
    if np.linalg.norm(arms[0]) <= np.linalg.norm(arms[1]):
        return CornerPlan("mitre", _Mitre(strips, crossing, on_walls).end_strips())
    return CornerPlan("mitre", _Mitre(strips[::-1], crossing[::-1], on_walls[::-1]).end_strips()[::-1])


@dataclass(frozen=True)
class _WallPoint:
    """Where the rail of a strip on its wall meets the other wall: its s, the point (3,), and its (u, v) there (2,)."""

    s: float
    point: Array
    uv: Array


def _meet_wall(one: MitredStrip, other: MitredStrip) -> _WallPoint:
    """Return where the rail of one strip on its wall meets the wall of the other strip.

    Raises
    ------
    TopologyError
        If it does not.
    """
    surface, target = one.surface, other.wall_face
    across = np.array([float(one.wall)])

    def evaluate_system(x: Array) -> tuple[Array, Array, Array]:
        h, n = surface.strip.jet(x[:, 0], across, 1), target.face_primary.jet(x[:, 1:])
        jacobian = np.stack([h[1, 0], -n[1], -n[2]], axis=2)
        return h[0, 0] - n[0], jacobian, np.linalg.norm(jacobian, axis=1)

    start = np.array([[surface.start, *find_vertex_uv(one.vertex, target.face)]])
    x, good = solve_damped_newton(evaluate_system, start, surface.width, surface.width)
    if not good[0]:
        raise TopologyError(f"the blend does not meet {one.placement.joint.name_part(target.face)} there")
    return _WallPoint(float(x[0, 0]), surface.strip(x[:, 0], across)[0], x[0, 1:])


class _Mitre:
    """Two strips to be mitred, the shallower one first, and where their rails on their walls meet the other's."""

    def __init__(
        self, strips: tuple[MitredStrip, MitredStrip], crossing: Array, on_walls: tuple[_WallPoint, _WallPoint]
    ) -> None:
        self.shallower, self.deeper = strips
        self.at_sharp_edge = on_walls[1]
        apart = float(np.linalg.norm(on_walls[0].point - on_walls[1].point))
        self.is_equal = apart <= SHELL_EDIT_TOLERANCES.equal_depth
        near = on_walls[0].s, on_walls[1].s
        self.curve = solve_mitre_curve(strips[0].surface, strips[1].surface, crossing, near)
        self.sharp_corner = PlannedVertex(on_walls[1].point, gap=apart if self.is_equal else 0.0)

    def end_strips(self) -> tuple[StripEnd, StripEnd]:
        """Return what the shallower and the deeper strip end in."""
        shallower, deeper = self.shallower, self.deeper
        crossing, first_crossing, second_crossing = self.curve.evaluate_end(at_common=True)
        arrival, first_arrival, second_arrival = self.curve.evaluate_end(at_common=False)
        corner = PlannedVertex(crossing)
        wall_corner = self.sharp_corner if self.is_equal else PlannedVertex(arrival)
        mitre = self._plan_mitre(corner, wall_corner)
        tail, plans = ((), ()) if self.is_equal else self._end_on_wall(second_arrival, wall_corner)
        faces = (deeper.wall_face.face, shallower.wall_face.face)
        sharp_edge = find_sharp_edge(shallower, deeper)
        trim = EdgeTrim(deeper.placement, deeper.end, sharp_edge, deeper.vertex, self.sharp_corner, faces)
        return (
            _make_end(shallower, (mitre,), (corner, wall_corner), (first_crossing[0], first_arrival[0])),
            replace(
                _make_end(
                    deeper,
                    (mitre, *tail),
                    (corner, self.sharp_corner),
                    (second_crossing[0], self.at_sharp_edge.s),
                ),
                edge_trims=(trim,),
                face_plans=plans,
            ),
        )

    def _plan_mitre(self, corner: PlannedVertex, wall_corner: PlannedVertex) -> EdgeUse:
        """Plan the edge of the mitre; its use runs from the crossing on the common face to the wall."""
        curve, forward = self.curve, self.curve.starts_at_common
        vertices = (corner, wall_corner) if forward else (wall_corner, corner)
        first, second = (
            one.placement.plan_pcurve(own)
            for one, own in zip((self.shallower, self.deeper), curve.on_strips, strict=True)
        )
        return EdgeUse(NewEdge("mitre", curve.curve, curve.span, vertices, (first, second)), forward)

    def _end_on_wall(
        self, arrival: Array, wall_corner: PlannedVertex
    ) -> tuple[tuple[EdgeUse, ...], tuple[FacePlan, ...]]:
        """End the deeper strip on the wall of the shallower one, from ``arrival`` (s, v) to the sharp edge.

        Returns the use of the edge from there on, and what it means for that wall.
        """
        deeper, wall = self.deeper, self.shallower.wall_face
        meeting = Meeting.at_end(deeper.placement, deeper.end, wall)
        stop = np.array([self.at_sharp_edge.s, float(deeper.wall), *self.at_sharp_edge.uv])
        near = np.concatenate([arrival, self._locate_on_wall(wall_corner.point)])
        points = [MeetingPoint(x, meeting.evaluate_rates(x)) for x in (near, stop)]
        if deeper.common == 1:
            points.reverse()
        if points[0].rates[1] < 0:
            points = [point.reverse() for point in points]
        cut = meeting.fit_through(points)
        vertices = deeper.order((wall_corner, self.sharp_corner))
        edge = plan_cut_edge(deeper.placement, cut, vertices, self.shallower.wall_number)
        forward = deeper.common == 0
        shallower = self.shallower
        use = EdgeUse(edge, forward == shallower.enters_by(shallower.wall))
        return (EdgeUse(edge, forward),), (FacePlan(shallower.wall_number, added=(use,)),)

    def _locate_on_wall(self, point: Array) -> Array:
        """Return the parameters (2,) of a point of the wall of the shallower strip, near the sharp edge."""
        wall, near = self.shallower.wall_face.face_primary, self.at_sharp_edge.uv
        size = self.deeper.surface.width

        def evaluate_system(uv: Array) -> tuple[Array, Array, Array]:
            n = wall.jet(uv)
            rates = np.stack([n[1], n[2]], axis=2)
            residual = np.einsum("nki,nk->ni", rates, n[0] - point)
            return residual / size, np.einsum("nki,nkj->nij", rates, rates) / size, np.linalg.norm(rates, axis=1)

        uv, good = solve_damped_newton(evaluate_system, near[None], size, size)
        if not good[0]:
            raise TopologyError("the deeper of two blends does not end on the wall beside the other one")
        return uv[0]


def _make_end(
    one: MitredStrip,
    path: tuple[EdgeUse, ...],
    corners: tuple[PlannedVertex, PlannedVertex],
    parameters: tuple[float, float],
) -> StripEnd:
    """Return the end of a strip, given from the common face to the wall."""
    ordered = path if one.common == 0 else tuple(reverse_path(path))
    first, last = one.order((float(parameters[0]), float(parameters[1])))
    return StripEnd(ordered, one.order(corners), (first, last), one.placement.keep_vertex(one.vertex))
