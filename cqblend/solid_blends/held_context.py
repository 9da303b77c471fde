"""What a strip needs whose rail on one side is held on an existing edge: contacts, ribbons, and its section.

The ball touches one face only, and rolls along the held edge. There the blend leaves in the direction of the ball, as
if it were smooth with the ruled surface A(u, v) = E(u) + v T(u), E the edge and T that direction: so the ribbon of the
held side is one on A, in place of a face, and everything else is as ever. With what lies beyond the edge the blend is
G0.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts, Stations, compute_inward_directions
from cqblend.blends.contacts.held_contacts import HeldContacts, HeldPoints, solve_held_contacts
from cqblend.blends.contacts.parameter_unwrapping import unwrap_closed_solver, unwrap_open_solver
from cqblend.blends.rails.cross_directions import perpendicular_field
from cqblend.blends.rails.cubic_ribbons import fit_cubic_ribbons
from cqblend.blends.rails.line_and_arc_ribbons import ArcLayout, fit_circular_ribbons, fit_straight_ribbons
from cqblend.blends.rails.ribbon import Ribbon
from cqblend.blends.sections.blend_surface import BlendSurface
from cqblend.brep.conversion.support_face import SupportFace
from cqblend.brep.selection.held_edges import HeldCircle, HeldEdge, find_held_edge
from cqblend.brep.selection.joint import Joint
from cqblend.errors import SizeError
from cqblend.solid_blends.section_methods import get_largest_arc
from cqblend.solid_blends.section_strategy import SectionMethod, fill_cells
from cqblend.solid_blends.strip_context import StripContext
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES
from cqblend.splines import Surface
from cqblend.splines.approximation import approximate_curve
from cqblend.splines.bernstein import Array
from cqblend.splines.breaks import align_breaks
from cqblend.surfaces.primary_surface import Primary
from cqblend.surfaces.quadrics import Cone, Cylinder, Plane
from cqblend.surfaces.tensor_surface import TensorSurface
from cqblend.surfaces.vectors import LocalFrame, normalise_vectors

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge

_Value = TypeVar("_Value")


@dataclass(frozen=True)
class _RuledSide:
    """The surface that stands for a face on the held side, and its parameters (n, 2) at shares t (n,) of the edge.

    ``turn`` is the angle (rad) of an edge that is an arc, about whose axis the surface runs, and None for others.
    """

    surface: Primary
    locate: Callable[[Array], Array]
    turn: float | None = None


@dataclass(frozen=True)
class HeldStripContext(StripContext):
    """The context of a joint of which one rail is held on an edge. Its parameter t is the share of that edge."""

    held: HeldEdge

    def scale(self, factor: float) -> HeldStripContext:
        """Return the context of the same joint with a ball of another radius."""
        return HeldStripContext(self.joint, self.method.scale(factor), self.held)

    def solve_ball(self, t: Array) -> HeldContacts:
        """Return where balls through the points of the edge at shares t (n,) touch the other face.

        Raises
        ------
        SizeError
            If they do not reach it.
        """
        (points, tangents), (edge, into) = self.held.evaluate(t), self._edge_stations
        nearest = np.linalg.norm(points[:, None] - edge.points, axis=2).argmin(axis=1)
        side = self.joint.sides[self._free]
        near = HeldPoints(points, tangents, edge.points[nearest], edge.uv[self._free][nearest], into[nearest])
        return solve_held_contacts(side, near, self.method.size, is_convex=self.joint.is_convex)

    @property
    def _free(self) -> int:
        """The side, 0 or 1, on which the ball touches a face."""
        return 1 - self.held.side

    @cached_property
    def _edge_stations(self) -> tuple[Stations, Array]:
        """Stations of the blended edge, and the directions (n, 3) from there into the face that the ball touches."""
        stations = self.joint.locate_stations(np.linspace(0, 1, SOLID_BLEND_TOLERANCES.held_stations))
        return stations, compute_inward_directions(self.joint.sides, stations)[self._free]

    def check_size(self) -> None:
        """Check that the contacts are inside the other face, and that the blend fits between both faces at the edge.

        Raises
        ------
        SizeError
            If not.
        """
        count = SOLID_BLEND_TOLERANCES.check_stations
        t = (np.arange(count) + 0.5) / count
        ball = self.solve_ball(t)
        self._check_room(t, ball)
        contacts = Contacts(t, self.held.evaluate(t)[0], (ball.uv, ball.uv), np.ones((2, count)))
        is_outside = ~self.joint.classify_contacts(contacts, self._free)
        is_outside &= self.joint.spine.closed | (np.abs(t - 0.5) < 0.25)  # next to oblique ends, rails may pass beside
        if is_outside.any():
            where = f"the rail reaches the end of face {self.joint.face_numbers[self._free]}"
            raise self._make_size_error("large", "", float(t[is_outside.argmax()]), where)

    def _check_room(self, t: Array, ball: HeldContacts) -> None:
        """Check that the blend leaves the edge, at shares t, between the face that goes and the one beyond."""
        held, least = self.held, SOLID_BLEND_TOLERANCES.held_angle
        normals, into_face = held.evaluate_face_directions(t, held.oriented_face)
        _, into_beyond = held.evaluate_face_directions(t, held.face_beyond)
        inside = -normals if self.joint.is_convex else normals
        angles, limits = (
            np.arctan2((way * inside).sum(1), (way * into_face).sum(1)) for way in (ball.directions, into_beyond)
        )
        name = f" to be held on {self.joint.name_part(held.edge)}"
        if angles.min() < least:
            where = f"the ball touches {self.joint.name_part(held.face)} before it"
            raise self._make_size_error("small", name, float(t[angles.argmin()]), where)
        room = np.mod(limits, 2 * np.pi) - angles
        if room.min() < least:
            where = f"the blend runs into {self.joint.name_part(held.face_beyond)} beyond it"
            raise self._make_size_error("large", name, float(t[room.argmin()]), where)

    def _make_size_error(self, how: Literal["small", "large"], what_for: str, t: float, where: str) -> SizeError:
        """Return the error of a size that is too small or too large, with the place and what is in the way there."""
        size = self.method.size
        message = f"size {size:g} is too {how}{what_for}: at t = {t:.3g} {where}"
        return SizeError(message, kind=f"too {how}", place=t, value=size)

    def make_blend(self, domain: tuple[float, float], *, arcs: bool = True) -> BlendSurface:
        """Return the blend surface, over at least the given range of t of an open edge; of arcs only if ``arcs``.

        Its ribbon on the held side has order 0: what it is smooth with is no face.
        """
        ruled = self._make_ruled_side(domain)
        ribbons = self._fit_ribbons(ruled, domain)
        (blend,) = fill_cells([(self.section, ribbons)], arcs=arcs)
        first, second = (
            replace(ribbon, order=0) if i == self.held.side else ribbon for i, ribbon in enumerate(blend.ribbons)
        )
        return replace(blend, ribbons=(first, second))

    def describe_sides(self, blend: BlendSurface) -> tuple[SupportFace, SupportFace]:
        """Return the support faces of a blend, with its ruled surface in the place of the held one's own."""
        side, ribbon = self.joint.sides[self.held.side], blend.ribbons[self.held.side]
        beside = np.array([0.0, 1.0])
        window = np.stack([ribbon.uv.min(axis=0) - beside, ribbon.uv.max(axis=0) + beside], axis=1)
        held = SupportFace(ribbon.primary, side.outward, side.face, ribbon.primary, window)
        return self._arrange(held, self.joint.sides[self._free])

    def _arrange(self, held: _Value, free: _Value) -> tuple[_Value, _Value]:
        """Return what belongs to the held and to the free side in the order of the sides."""
        return (held, free) if self.held.side == 0 else (free, held)

    def _make_ruled_side(self, domain: tuple[float, float]) -> _RuledSide:
        """Return the surface through the edge, over a range of t, that the blend leaves as if it were its face."""
        t = np.linspace(0, 1, SOLID_BLEND_TOLERANCES.check_stations)
        points, tangents = self.held.evaluate(t)
        directions = self.solve_ball(t).directions
        if _is_constant(np.concatenate([tangents, directions], axis=1)):
            return _make_plane(points, tangents[0], directions[0])
        circle = self.held.circle
        if circle is not None:
            cone = _make_cone(points, circle, directions)
            if cone is not None:
                return cone
        closed, size = self.joint.spine.closed, self.joint.extent
        breaks = np.linspace(*domain, SOLID_BLEND_TOLERANCES.held_spans + 1)

        def evaluate_both(t: Array) -> Array:
            at = np.mod(t, 1.0) if closed else t
            return np.concatenate(
                [self.held.evaluate(at)[0], self.method.size * self.solve_ball(at).directions], axis=1
            )

        def take_points(t: Array) -> Array:
            return evaluate_both(t)[:, :3]

        def take_ways(t: Array) -> Array:
            return evaluate_both(t)[:, 3:]

        curve = approximate_curve(
            take_points, breaks, SOLID_BLEND_TOLERANCES.held_curve * size, closed=closed, kinks=self.held.kinks
        )
        ways = approximate_curve(take_ways, breaks, SOLID_BLEND_TOLERANCES.held_way * self.method.size, closed=closed)
        first, second = align_breaks([curve, ways])
        coefs = np.stack([first.coefs - second.coefs, first.coefs + second.coefs], axis=1)[..., None]
        surface = Surface((first.breaks, (-1.0, 1.0)), coefs, continuity=(first.continuity, None))
        return _RuledSide(TensorSurface.from_spline(surface, (closed, False)), _place_on_spline)

    def _fit_ribbons(self, ruled: _RuledSide, domain: tuple[float, float]) -> tuple[Ribbon, Ribbon]:
        """Return the ribbons over a range of t of an open edge, or once around a closed one."""
        joint, closed, targets = self.joint, self.joint.spine.closed, self.method.targets
        free = self._free
        primaries = self._arrange(ruled.surface, joint.sides[free].primary)

        def solve(t: Array) -> Contacts:
            ball = self.solve_ball(t)
            uv = self._arrange(ruled.locate(t), ball.uv)
            radius, points = self.method.size, self.held.evaluate(t)[0]
            apexes = points + radius * np.tan(ball.angles / 2)[:, None] * ball.directions  # where both tangents meet
            return Contacts(t, apexes, uv, np.tile(4 * radius * np.tan(ball.angles / 4), (2, 1)))

        unwrap = unwrap_closed_solver if closed else unwrap_open_solver
        continuous = unwrap(solve, primaries)
        fields = self._arrange(perpendicular_field, targets.fields[free])
        wanted = replace(targets, fields=fields, orders=self._arrange(1, targets.orders[free]))
        rails = None if closed else fit_straight_ribbons(primaries, continuous, domain, wanted, joint.extent)
        if rails is None and ruled.turn is not None:
            layout = ArcLayout(domain, ruled.turn, get_largest_arc(joint))
            rails = fit_circular_ribbons(primaries, continuous, layout, wanted, joint.extent)
        return rails or fit_cubic_ribbons(primaries, continuous, domain, wanted, closed=closed)


def _is_constant(values: Array) -> bool:
    """Whether vectors (n, k) are all the same, to rounding."""
    return bool(np.abs(values - values[0]).max() <= SOLID_BLEND_TOLERANCES.held_constancy)


def _place_on_spline(t: Array) -> Array:
    return np.column_stack([t, np.zeros(len(t))])


def _make_plane(points: Array, tangent: Array, direction: Array) -> _RuledSide:
    """Return the plane through points (n, 3) of a line along a direction (3,)."""
    length, y = float(np.linalg.norm(points[-1] - points[0])), direction - (direction @ tangent) * tangent
    y = normalise_vectors(y)
    plane = Plane(LocalFrame(points[0], np.array([tangent, y, np.cross(tangent, y)])))
    return _RuledSide(plane, lambda t: np.column_stack([length * t, np.zeros(len(t))]))


def _make_cone(points: Array, circle: HeldCircle, directions: Array) -> _RuledSide | None:
    """Return the plane, cylinder or cone through points (n, 3) of a circle along directions (n, 3) there.

    None if these are not alike all around the axis.
    """
    x = normalise_vectors(points - circle.centre)
    components = np.stack([(directions * x).sum(1), directions @ circle.axis], axis=1)
    lengths = np.linalg.norm(components, axis=1)
    if not _is_constant(np.column_stack([components, lengths])) or lengths[0] < 1 - SOLID_BLEND_TOLERANCES.held_angle:
        return None
    radial, axial = (components[0] / lengths[0] * (1.0 if components[0, 1] >= 0 else -1.0)).tolist()
    frame = LocalFrame(circle.centre, np.array([x[0], np.cross(circle.axis, x[0]), circle.axis]))
    radius, turn, flat = circle.radius, circle.turn, SOLID_BLEND_TOLERANCES.held_constancy

    def turn_about_axis(t: Array) -> Array:
        return np.column_stack([turn * t, np.zeros(len(t))])

    def turn_in_plane(t: Array) -> Array:
        return radius * np.column_stack([np.cos(turn * t), np.sin(turn * t)])

    if abs(radial) <= flat:
        return _RuledSide(Cylinder(frame, radius), turn_about_axis, turn)
    if axial <= flat:
        return _RuledSide(Plane(frame), turn_in_plane, turn)
    return _RuledSide(Cone(frame, radius, float(np.arctan2(radial, axial))), turn_about_axis, turn)


def make_held_context(joint: Joint, method: SectionMethod, edges: Sequence[TopoDS_Edge]) -> HeldStripContext:
    """Return the context of a joint with a rail on some edges; its face there is, by number, the one beyond these.

    Raises
    ------
    CqblendError
        If a rail of the joint cannot be held on them.
    """
    held = find_held_edge(joint, edges)
    beyond = 0 if joint.lookup_number is None else joint.lookup_number(held.face_beyond)
    first, second = joint.face_numbers
    numbers = (beyond, second) if held.side == 0 else (first, beyond)
    return HeldStripContext(replace(joint, face_numbers=numbers), method, held)
