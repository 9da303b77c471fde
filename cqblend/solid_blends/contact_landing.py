"""On which faces the contacts of an edge lie: those at the edge, or others that these go on in over smooth edges.

A contact that lies outside of the face at the edge is followed over the smooth edge that is in its way: on the surface
of the face beyond it is solved again, and so on, until it lies inside a face. The edge is divided into *stretches*,
along which both contacts stay on their faces; where one ends, a rail crosses a smooth edge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from cqblend.blends.contacts.contact_solver import Contacts, ContactSolver
from cqblend.brep.conversion.support_face import SupportFace, read_support_face
from cqblend.brep.selection.joint import Joint
from cqblend.brep.selection.tolerances import SELECT_TOLERANCES
from cqblend.brep.shell_editing.face_boundary import FaceBoundary
from cqblend.brep.topology import is_among
from cqblend.errors import CqblendError, GeometryError, SizeError
from cqblend.solid_blends.section_strategy import SectionMethod
from cqblend.solid_blends.tolerances import SOLID_BLEND_TOLERANCES
from cqblend.splines.bernstein import Array
from cqblend.surfaces.vectors import to_tangent_coordinates

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Face

Sides = tuple[SupportFace, SupportFace]
"""The faces that both contacts lie on."""


@dataclass(frozen=True)
class Landing:
    """The contacts of one station, and the faces inside which they lie.

    ``entered`` are the edges, by side, over which they have come there last, or start at.
    """

    sides: Sides
    contacts: Contacts
    entered: tuple[Sequence[TopoDS_Edge], Sequence[TopoDS_Edge]] = ((), ())

    @property
    def t(self) -> float:
        """The parameter of the station."""
        return float(self.contacts.t[0])

    def shares_faces(self, other: Landing) -> bool:
        """Whether the contacts of another station lie on the same faces."""
        return all(one is two for one, two in zip(self.sides, other.sides, strict=True))


@dataclass(frozen=True)
class Stretch:
    """A stretch of an edge along which the contacts lie on one pair of faces.

    ``joint`` has these faces; ``window`` is where the stretch starts and stops. ``known`` are contacts on faces beyond
    those at the edge; None if these are the faces at the edge.
    """

    joint: Joint
    window: tuple[float, float]
    known: Contacts | None

    @property
    def length(self) -> float:
        """The length (mm) of the stretch."""
        return (self.window[1] - self.window[0]) * self.joint.spine.length


def find_stretches(joint: Joint, method: SectionMethod, solve: ContactSolver) -> tuple[Stretch, ...]:
    """Return the stretches of an edge, whose contacts on the surfaces at the edge are those of ``solve``.

    Next to the ends of an open edge contacts may lie outside of all faces, because faces may end obliquely.

    Raises
    ------
    SizeError
        If contacts lie on no face that goes on smoothly from those at the edge.
    GeometryError
        If contacts are not found on such a face.
    """
    search, count = _LandingSearch(joint, method, solve), SOLID_BLEND_TOLERANCES.landing_stations
    t = (np.arange(count) + 0.5) / count
    middle = count // 2
    landings, failures = [search.land_station(float(t[middle]))], dict[float, CqblendError]()
    for outward, last in ((t[middle + 1 :], -1), (t[:middle][::-1], 0)):
        for one in outward.tolist():
            try:
                landing = search.land_beside(one, landings[last])
            except CqblendError as error:
                failures[one] = error
            else:
                landings.insert(len(landings) if last else 0, landing)
    for one, failure in failures.items():
        if joint.spine.closed or landings[0].t < one < landings[-1].t:
            raise failure
    landings = search.refine(landings)
    groups: list[list[Landing]] = []
    for landing in landings:
        if not groups or not landing.shares_faces(groups[-1][-1]):
            groups.append([])
        groups[-1].append(landing)
    inner = [(one[-1].t + two[0].t) / 2 for one, two in pairwise(groups)]
    stops = [0.0, *inner, 1.0]
    return tuple(search.make_stretch(group, (stops[k], stops[k + 1])) for k, group in enumerate(groups))


class _LandingSearch:
    """The search for the faces on which the contacts of one edge lie. Each face is read once."""

    def __init__(self, joint: Joint, method: SectionMethod, solve: ContactSolver) -> None:
        self.joint, self.method, self.index, self._solve = joint, method, joint.index, solve
        own = map(self.index.faces.find_number, (side.face for side in joint.edge_sides))
        self._supports = dict(zip(own, joint.edge_sides, strict=True))
        self._boundaries: dict[int, FaceBoundary] = {}

    def _read_support(self, face: TopoDS_Face) -> SupportFace:
        number = self.index.faces.find_number(face)
        if number not in self._supports:
            spine = self.joint.spine
            points = spine.evaluate_points(
                np.linspace(0, 1, SELECT_TOLERANCES.spine_samples)[: -1 if spine.closed else None]
            )
            is_circular = spine.closed or spine.measure_arc_angle() is not None
            self._supports[number] = read_support_face(self.index.faces[number], points, edge_is_circular=is_circular)
        return self._supports[number]

    def _read_boundary(self, side: SupportFace) -> FaceBoundary:
        number = self.index.faces.find_number(side.face)
        if number not in self._boundaries:
            self._boundaries[number] = FaceBoundary(side.face)
        return self._boundaries[number]

    def _place_joint(self, sides: Sides) -> Joint:
        """Return the joint with its rails on given faces."""
        if all(one is two for one, two in zip(sides, self.joint.edge_sides, strict=True)):
            return self.joint
        first, second = (
            number if one is own else self.joint.find_face_number(one.face)
            for one, own, number in zip(sides, self.joint.edge_sides, self.joint.face_numbers, strict=True)
        )
        return replace(self.joint, sides=sides, face_numbers=(first, second), faces_at_edge=self.joint.edge_sides)

    def make_stretch(self, landings: Sequence[Landing], window: tuple[float, float]) -> Stretch:
        """Return the stretch of some landings on the same faces."""
        joint = self._place_joint(landings[0].sides)
        if joint is self.joint:
            return Stretch(joint, window, None)
        return Stretch(joint, window, reduce(Contacts.append, (one.contacts for one in landings)))

    def land_station(self, t: float) -> Landing:
        """Return where the contacts of a station land.

        At once on the surface beyond the face at the edge, or by growing the blend from none.

        Raises
        ------
        SizeError
            If they lie on no face that goes on smoothly from those at the edge.
        GeometryError
            If they are not found there.
        """
        at = np.array([t])
        try:
            return self._follow(self._start_at_edge(t), self._solve(at), self.method)
        except CqblendError:
            return self._grow(t)

    def land_beside(self, t: float, neighbour: Landing) -> Landing:
        """Return the same, from where the contacts of a station nearby have landed, if that helps."""
        near = neighbour.contacts.uv
        try:
            start = replace(neighbour, entered=((), ()))
            contacts = self._solve_on(neighbour.sides, t, (near[0], near[1]), self.method)
            return self._follow(start, contacts, self.method)
        except CqblendError:
            return self.land_station(t)

    def _start_at_edge(self, t: float) -> Landing:
        """Return the point of the edge at a station as contacts of no size."""
        joint, stations = self.joint, self.joint.locate_on_surfaces(np.array([t]))
        contacts = Contacts(stations.t, stations.points, stations.uv, np.zeros((2, 1)))
        edges = tuple(joint.spine.edges)
        return Landing(joint.edge_sides, contacts, (edges, edges))

    def _solve_on(self, sides: Sides, t: float, near: tuple[Array, Array], method: SectionMethod) -> Contacts:
        """Return the contacts of a station on given faces next to some parameters."""
        section = method.bind(self._place_joint(sides))
        return section.solve_near(self.joint.locate_on_surfaces(np.array([t])), near)

    def _follow(self, start: Landing, contacts: Contacts, method: SectionMethod) -> Landing:
        """Return where contacts land that lie on the surfaces of given faces, seen from contacts that lie inside these.

        Raises
        ------
        SizeError, GeometryError
            If that is nowhere, or not found.
        """
        t = float(contacts.t[0])
        sides, entered = start.sides, list(start.entered)
        inside = [side.to_face_parameters(uv)[0] for side, uv in zip(sides, start.contacts.uv, strict=True)]
        for _ in range(SOLID_BLEND_TOLERANCES.most_faces_beyond):
            outside = [i for i, side in enumerate(sides) if not self._is_inside(side, contacts.uv[i])]
            if not outside:
                return Landing(sides, contacts, (entered[0], entered[1]))
            i = outside[0]
            edge, parameter = self._find_way_out(sides[i], inside[i], contacts.uv[i], entered[i])
            beyond = self._find_face_beyond(sides[i], edge, t)
            boundary = self._read_boundary(beyond)
            inside[i], entered[i] = boundary.evaluate(boundary.find_uses(edge)[0], parameter)[0], (edge,)
            jet = beyond.face_primary.jet(inside[i][None])
            step = to_tangent_coordinates(jet, sides[i].primary.jet(contacts.uv[i])[0] - jet[0])
            ahead = beyond.to_working_parameters(inside[i] + step)
            near = (ahead, contacts.uv[1]) if i == 0 else (contacts.uv[0], ahead)
            sides = (beyond, sides[1]) if i == 0 else (sides[0], beyond)
            contacts = self._solve_on(sides, t, near, method)
        raise SizeError(f"the rail goes on over too many smooth edges at t = {t:.3g}", kind="too large", place=t)

    def _grow(self, t: float) -> Landing:
        """Return where the contacts of a station land, grown from none in steps that are small next to smooth edges.

        Raises
        ------
        SizeError, GeometryError
            If they are lost on their way.
        """
        found, size, step = self._start_at_edge(t), 0.0, 1.0 / SOLID_BLEND_TOLERANCES.landing_steps
        while size < 1.0:
            following = min(1.0, size + step)
            method = self.method.scale(following)
            try:
                contacts = (
                    self._solve_on(found.sides, t, found.contacts.uv, method)
                    if size
                    else method.bind(self.joint).make_solver()(np.array([t]))
                )
                found, size = self._follow(found, contacts, method), following
                step = min(2 * step, 1.0 / SOLID_BLEND_TOLERANCES.landing_steps)
            except GeometryError:
                step /= 2
                if step < SOLID_BLEND_TOLERANCES.least_landing_step:
                    raise
        return found

    def _is_inside(self, side: SupportFace, uv: Array) -> bool:
        """Whether a contact (1, 2) lies inside a face.

        Of a face at the edge nothing would remain where it lies on its boundary, and the rail is on the face beyond.
        """
        (at,) = side.wrap_to_window(side.to_face_parameters(uv))
        is_beyond = all(side is not own for own in self.joint.edge_sides)
        return self.index.is_inside_face(side.face, at, or_on_boundary=is_beyond or side.is_at_seam(at))

    def _find_way_out(
        self, side: SupportFace, start: Array, uv: Array, entered: Sequence[TopoDS_Edge]
    ) -> tuple[TopoDS_Edge, float]:
        """Return the edge over which the straight way to a contact leaves a face, and its parameter there."""
        boundary, stop = self._read_boundary(side), side.unwrap_near(side.to_face_parameters(uv), start[None])[0]
        seams = [k for k, use in enumerate(boundary.uses) if len(boundary.find_uses(use)) > 1]
        passed = [*seams, *(k for k, use in enumerate(boundary.uses) if is_among(use, entered))]
        stop = stop + SOLID_BLEND_TOLERANCES.landing_margin * (stop - start)
        found = boundary.find_first_crossing(np.stack([start, stop]), side.face_primary.periods, passed)
        if found is None:
            raise GeometryError(f"{self.joint.name_part(side.face)} ends in no definite edge there")
        return boundary.uses[found.use], found.parameter

    def _find_face_beyond(self, side: SupportFace, edge: TopoDS_Edge, t: float) -> SupportFace:
        """Return the face in which a face goes on smoothly over an edge."""
        others = [face for face in self.index.faces_at_edge(edge) if not face.IsSame(side.face)]
        angles = self.index.measure_dihedral_angles(edge)
        if len(others) != 1 or angles is None or not angles.is_smooth:
            into, border = self.joint.name_part(side.face), self.joint.name_part(edge)
            raise SizeError(
                f"the rail goes on into {into}, and at t = {t:.3g} it reaches {border}, where that ends",
                kind="too large",
                place=t,
            )
        return self._read_support(others[0])

    def refine(self, landings: Sequence[Landing]) -> list[Landing]:
        """Return landings with others between those on different faces, up to next to where the rail passes."""
        found = [landings[0]]
        for landing in landings[1:]:
            found += [*self._land_between(found[-1], landing), landing]
        return found

    def _land_between(self, low: Landing, high: Landing) -> list[Landing]:
        """Return landings between two stations, in their order, such that faces change in small steps of t only."""
        if low.shares_faces(high) or high.t - low.t < SOLID_BLEND_TOLERANCES.landing_resolution:
            return []
        middle = self.land_beside((low.t + high.t) / 2, low)
        return [*self._land_between(low, middle), middle, *self._land_between(middle, high)]
